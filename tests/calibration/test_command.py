"""`hdassist calibrate` as its users meet it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hdassist import load_preset
from tests.helpers.process import SMALL, run

TARGETS = """\
schema: hdassist.targets/1
name: rig 3
unknowns:
  gears.j_n: {low: 0, high: 15}
targets:
  - {quantity: lost_motion, M_g: 4, value: 500, tolerance: 5}
"""
QUICK = ("--evaluations", "16", "--set", "operation.M_g=4")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("calibrate")
    (folder / "rig.yaml").write_text(TARGETS)
    (folder / "small.yaml").write_text(Path(SMALL).read_text().replace("M_g: [1, 4]", "M_g: 4"))
    return folder


@pytest.mark.thorough
def test_values_are_found_written_and_used(folder):
    args = ("calibrate", "small.yaml", "--targets", "rig.yaml", "--evaluations", "16")
    first = run(*args, "--write", "found.yaml", "--json", cwd=folder)
    assert first.returncode == 0, first.stderr
    told = json.loads(first.stdout)
    assert told["schema"] == "hdassist.calibrate/1"
    assert told["best"]["met"]
    assert told["best"]["found"][0] == pytest.approx(500, abs=5)
    assert "wrote found.yaml" in first.stderr
    found = load_preset(str(folder / "found.yaml"))
    assert found.gears.j_n == told["best"]["values"]["gears.j_n"]
    assert found.source["gears.j_n"].kind == "identified"
    assert "rig 3" in found.source["gears.j_n"].ref
    # never over another file; people read a page
    assert run(*args, "--write", "found.yaml", cwd=folder).returncode == 2
    again = run(*args, cwd=folder)
    assert max(map(len, again.stdout.splitlines())) <= 80
    for words in ("targets", "lost_motion, M_g 4 N·m", "met", "gears.j_n", "--details"):
        assert words in again.stdout
    assert again.stdout.startswith("small, calibration (rig 3): 1 of 1 targets met\n")
    written = run(*args, "--details", "--ascii", "--write", "other.yaml", cwd=folder).stdout
    assert "sets of values that meet the targets" in written
    assert "next  hdassist check other.yaml\n" in written
    quiet = run(*args, "-q", cwd=folder)
    assert quiet.stdout == f"gears.j_n={found.gears.j_n!r}\n"


def test_missed_target_exits_3_and_writes_no_preset(folder):
    (folder / "torn.yaml").write_text(TARGETS + "  - {quantity: lost_motion, M_g: 4, value: 900, tolerance: 5}\n")
    done = run("calibrate", "small.yaml", "--targets", "torn.yaml", "--evaluations", "8", "--write", "near.yaml",
               "--json", cwd=folder)  # fmt: skip
    told = json.loads(done.stdout)
    assert (done.returncode, told["exit_code"], told["best"]["met"]) == (3, 3, False)
    assert not (folder / "near.yaml").exists()
    page = run("calibrate", "small.yaml", "--targets", "torn.yaml", "--evaluations", "8", cwd=folder)
    assert page.returncode == 3
    assert "\nnext  check the measured values" in page.stdout
    missed = told["best"]["targets_met"].count(False)
    assert page.stdout.splitlines()[0] == f"small, calibration (rig 3): {missed} of 2 targets MISSED"


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (("gears.j_n", "gears.jn"), 4, "rig.yaml:4:3: unknowns.gears.jn"),
        (("M_g: 4", "M_g: 4000"), 5, "could be computed"),
        (("{low: 0, high: 15}", "{low: 15, high: 8}"), 4, "low must be below high"),
    ],
)
def test_wrong_targets(tmp_path, change, code, words):
    (tmp_path / "rig.yaml").write_text(TARGETS.replace(*change))
    result = run("calibrate", SMALL, "--targets", "rig.yaml", *QUICK, cwd=tmp_path)
    assert result.returncode == code
    assert words in result.stderr
    assert result.stdout == ""


def test_wrong_usage(folder):
    assert run("calibrate", SMALL, cwd=folder).returncode == 2
    assert run("calibrate", SMALL, "--targets", "none.yaml", cwd=folder).returncode == 4
    both = run("calibrate", SMALL, "--targets", "rig.yaml", "--write", "x.yaml", *QUICK, cwd=folder)
    assert both.returncode == 2
    assert "--set" in both.stderr
