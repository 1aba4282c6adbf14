"""`hdassist calibrate` as its users meet it."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from pydantic import TypeAdapter

from hdassist import load_preset
from hdassist.run.kept import KeptOwner, RecordKind, open_kept
from tests.process import SMALL, run

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


def test_values_are_found_written_and_used(folder):
    args = ("calibrate", "small.yaml", "--targets", "rig.yaml", "--evaluations", "16")
    first = run(*args, "--state", "state.jsonl", "--write", "found.yaml", "--json", cwd=folder)
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
    # never over another file; the state is gone on with; people read a page
    assert run(*args, "--write", "found.yaml", cwd=folder).returncode == 2
    again = run(*args, "--state", "state.jsonl", cwd=folder)
    assert "going on from state.jsonl" in again.stderr
    assert max(map(len, again.stdout.splitlines())) <= 80
    for words in ("targets", "lost_motion, M_g 4 N·m".replace("·", "*"), "met", "gears.j_n", "--details"):
        assert words in again.stdout
    assert again.stdout.startswith("small, calibration (rig 3): 1 of 1 targets met\n")
    assert "best phase at 4 N*m" in run(*args, "--state", "state.jsonl", "--details", "--ascii", cwd=folder).stdout
    quiet = run(*args, "--state", "state.jsonl", "-q", cwd=folder)
    assert quiet.stdout == f"gears.j_n={found.gears.j_n!r}\n"


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (("gears.j_n", "gears.jn"), 4, "rig.yaml:4:3: unknowns.gears.jn"),
        (("M_g: 4", "M_g: 4000"), 5, "could be computed"),
        (("{low: 0, high: 15}", "{low: 8, high: 15}"), 4, "outside the bounds"),
    ],
)
def test_wrong_targets(tmp_path, change, code, words):
    (tmp_path / "rig.yaml").write_text(TARGETS.replace(*change))
    result = run("calibrate", SMALL, "--targets", "rig.yaml", "--state", "state.jsonl", *QUICK, cwd=tmp_path)
    assert result.returncode == code
    assert words in result.stderr
    assert result.stdout == ""
    # what was computed is kept
    assert (tmp_path / "state.jsonl").exists() == (code == 5)


def test_wrong_usage(folder):
    assert run("calibrate", SMALL, cwd=folder).returncode == 2
    assert run("calibrate", SMALL, "--targets", "none.yaml", cwd=folder).returncode == 4
    both = run("calibrate", SMALL, "--targets", "rig.yaml", "--write", "x.yaml", *QUICK, cwd=folder)
    assert both.returncode == 2
    assert "--set" in both.stderr


def test_two_runs_do_not_share_a_state_file(tmp_path):
    (tmp_path / "rig.yaml").write_text(TARGETS)
    state = tmp_path / "state.jsonl"
    with open_kept(str(state), KeptOwner(command="calibrate", inputs={}), RecordKind(TypeAdapter(dict))):
        before = state.read_bytes()
        done = run("calibrate", SMALL, "--targets", "rig.yaml", "--state", "state.jsonl", *QUICK, cwd=tmp_path)
    assert done.returncode == 2
    assert "state.jsonl is being written by another run" in done.stderr
    assert state.read_bytes() == before


def test_a_trace_that_was_measured_again_has_a_state_of_its_own(tmp_path):
    target = "  - {quantity: trace, M_g: 4, file: run.csv, tolerance: 1}"
    (tmp_path / "rig.yaml").write_text("\n".join([*TARGETS.splitlines()[:-1], target]))
    args = ("calibrate", SMALL, "--targets", "rig.yaml", "--state", "state.jsonl", "--jobs", "1", "-q")
    args = (*args, "--evaluations", "8", "--set", "operation.M_g=4")
    curve = [9 * math.sin(math.radians(cam)) for cam in range(0, 360, 20)]
    write_curve(tmp_path / "run.csv", curve)
    first = run(*args, cwd=tmp_path)
    before = (tmp_path / "state.jsonl").read_bytes()
    assert run(*args, cwd=tmp_path).stdout == first.stdout
    write_curve(tmp_path / "run.csv", [2 * value for value in curve])
    done = run(*args, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "state.jsonl holds the work of another run: inputs.trace run.csv: " in done.stderr
    assert (tmp_path / "state.jsonl").read_bytes() == before


def write_curve(path, values):
    rows = "".join(f"{20 * k},{value:.4f}\n" for k, value in enumerate(values))
    path.write_text(f"cam_deg,error_arcsec\n{rows}")
