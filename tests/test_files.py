"""An output is never an input of the same run, nor another output of it, --force or not."""

from __future__ import annotations

import os
import subprocess
import sys
from math import radians, sin
from pathlib import Path

import pytest

from hdassist.run.errors import UsageError
from hdassist.run.files import begin_run, claim_output, note_input
from tests.helpers.process import CLEAN, TINY, posix_only, run

pytestmark = posix_only("links that any user may make")

TRACE = "cam_deg,error_arcsec\n" + "".join(f"{k},{15 * sin(radians(k)):.4f}\n" for k in range(721))
LOT = "serial,limit F_ior@4,measured@4\n1,30,run.csv\n"
TARGETS = """
schema: hdassist.targets/1
unknowns: {gears.j_n: {low: 0, high: 40}}
targets: [{quantity: F_ior, M_g: 4, phase: 0, value: 14, tolerance: 0.5}]
"""
INPUT, TWO = "is also an input of this run", "two results would be written to"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Inputs, with a symbolic and a hard link to the trace."""
    inputs = {"own.yaml": Path(TINY).read_text(), "run.csv": TRACE, "lot.csv": LOT, "targets.yaml": TARGETS}
    for name, text in inputs.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "own.md").symlink_to("own.yaml")
    (tmp_path / "soft.csv").symlink_to("run.csv")
    (tmp_path / "hard.csv").hardlink_to(tmp_path / "run.csv")
    return tmp_path


MEASURE = ("measure", "run.csv", "--ratio", "31")
ACCEPT = ("accept", "lot.csv", "--preset", "own.yaml", "--measured-only")
MOUNT = ("mount", "own.yaml", "--draws", "0")
RESULTS = ("tolerance", "own.yaml", "-n", "2")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((*MEASURE, "--csv", "run.csv"), INPUT), ((*MEASURE, "--csv", "soft.csv"), INPUT),
        ((*MEASURE, "--csv", "hard.csv"), INPUT), ((*MEASURE, "--csv", "./run.csv"), INPUT),
        ((*MEASURE, "--csv", "a.csv", "-o", "a.csv"), TWO), ((*MEASURE, "--csv", "a.csv", "-o", "A.CSV"), TWO),
        (("check", "own.yaml", "--csv", "own.yaml"), INPUT), (("trace", "own.yaml", "-o", "own.yaml"), INPUT),
        (("compare", "own.yaml", "run.csv", "--torque", "4", "-o", "run.csv"), INPUT),
        (("report", "own.md", "-o", "own.md"), INPUT),
        ((*MOUNT, "--card", "c.html", "-o", "C.html"), TWO),
        ((*ACCEPT, "--csv", "lot.csv"), INPUT), ((*ACCEPT, "--jsonl", "lot.csv"), INPUT),
        ((*ACCEPT, "--csv", "run.csv"), INPUT), ((*ACCEPT, "--junit", "own.yaml"), INPUT),
        ((*ACCEPT, "--jsonl", "a", "--junit", "a"), TWO), ((*ACCEPT, "--csv", "a", "--jsonl", "./a"), TWO),
        (("calibrate", "own.yaml", "--targets", "targets.yaml", "--write", "targets.yaml"), INPUT),
        (("calibrate", "own.yaml", "--targets", "targets.yaml", "-o", "s", "--write", "s"), TWO),
        ((*RESULTS, "--results", "own.yaml"), INPUT), ((*RESULTS, "--results", "r", "--csv", "r"), TWO),
        (("sweep", "own.yaml", "--vary", "gears.j_n=0:1:2", "-o", "own.yaml"), INPUT),
        (("sweep", "own.yaml", "--vary", "gears.j_n=0:1:2", "-o", "r.jsonl", "--csv", "r.jsonl"), TWO),
    ],
)  # fmt: skip
def test_file_already_used_by_the_run_is_refused_as_output(folder, arguments, words):
    before = {path: path.read_bytes() for path in folder.iterdir()}
    done = run(*arguments, "--force", cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert {path: before.get(path, b"") for path in folder.iterdir()} == {
        path: path.read_bytes() for path in folder.iterdir()
    }


def test_names_that_differ_only_in_case_are_one_file(tmp_path):
    begin_run()
    claim_output(str(tmp_path / "Größe.csv"))
    with pytest.raises(UsageError, match=TWO):
        claim_output(str(tmp_path / "GRÖSSE.CSV"))
    claim_output(str(tmp_path / "other.csv"))
    begin_run()
    claim_output(str(tmp_path / "GRÖSSE.CSV"))


def test_what_a_run_goes_on_with_is_read_and_written(tmp_path):
    (tmp_path / "a").touch()
    (tmp_path / "b").hardlink_to(tmp_path / "a")
    begin_run()
    claim_output(str(tmp_path / "a"), is_kept=True)
    note_input(str(tmp_path / "a"))
    with pytest.raises(UsageError, match=INPUT):
        note_input(str(tmp_path / "b"))


def test_devices_and_pipes_take_any_number_of_answers(folder):
    done = run(*MEASURE, "--csv", os.devnull, "-o", os.devnull, cwd=folder)
    assert done.returncode == 0, done.stderr


def shell(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    words = command.replace("hdassist", f'"{sys.executable}" -m hdassist')
    return subprocess.run(["bash", "-c", words], capture_output=True, text=True, env=CLEAN, cwd=folder, check=False)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "command",
    ["hdassist measure run.csv --ratio 31 >> run.csv", "hdassist measure - --ratio 31 < run.csv --csv run.csv --force"],
)
def test_streams_are_files_of_the_run_too(folder, command):
    done = shell(command, folder)
    assert done.returncode == 2
    assert INPUT in done.stderr
    assert (folder / "run.csv").read_text() == TRACE


@pytest.mark.thorough
@pytest.mark.skipif(os.name == "nt", reason="closed streams of a shell")
@pytest.mark.parametrize("arguments", ["explain F_IOR", "--version", "check --help", "presets list", "presets new own"])
def test_an_answer_on_a_closed_standard_output_is_not_given(tmp_path, arguments):
    done = shell(f"hdassist {arguments} >&-", tmp_path)
    assert done.returncode == 4
    assert done.stderr.startswith("error: cannot write")
    assert len(done.stderr.splitlines()) == 2


def test_closed_standard_output_is_no_error_beside_an_output_file(tmp_path):
    done = shell("hdassist presets new own -o own.yaml >&-", tmp_path)
    assert (done.returncode, done.stderr) == (0, "wrote own.yaml\n")


@pytest.mark.thorough
def test_resumed_lot_replaces_only_its_own_report(folder):
    def resumed() -> subprocess.CompletedProcess[str]:
        return run(*ACCEPT, "--resume", "--jsonl", "a.jsonl", "--junit", "a.xml", cwd=folder)

    for _ in range(2):
        done = resumed()
        assert done.returncode == 6, done.stderr
    suite = (folder / "a.xml").read_text()
    assert "<testsuites" in suite
    for other in ("notes\n", suite.replace("<!-- hdassist accept -->", "<!-- another tool -->")):
        (folder / "a.xml").write_text(other)
        assert resumed().returncode == 2
        assert (folder / "a.xml").read_text() == other
