"""Measured teeth in `hdassist accept`: of one drive and of a table; lots from standard input."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.features.acceptance.answer import ANSWERS
from hdassist.readers.pitch import WheelFiles
from hdassist.run.kept import KeptOwner, open_kept
from tests.helpers.acceptances import accept
from tests.helpers.process import TINY, in_a_line, run

HEAD = "# form: cumulative\n# unit: um\n# sense: ccw\n# mark: 1\n"
LIMITS = ("--limit", "F_ior@4=100000", "--limit", "self_error@4=100000")
FILES = ("--pitch-b", "b.csv", "--mark-b", "30", "--pitch-g", "g.csv")


def wheel(teeth: int, order: int) -> str:
    return HEAD + "".join(f"{k};{9 * np.sin(2 * np.pi * order * k / teeth):.2f}\n" for k in range(1, teeth + 1))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with pitch files of both wheels of the tiny drive."""
    (tmp_path / "b.csv").write_text(wheel(22, 1))
    (tmp_path / "g.csv").write_text(wheel(20, 2))
    return tmp_path


def checks(answer: dict) -> dict[str, float]:
    return {check["code"]: check["value"] for check in answer["checks"]}


def test_a_prediction_is_that_of_the_measured_teeth(folder):
    done = run("accept", TINY, *LIMITS, *FILES, "--json", "-o", "a.json", cwd=folder)
    assert done.returncode == 0
    assert "note: flexspline, g.csv: the mark is at 0 deg, from phases.xi_g of the preset" in done.stderr
    told = json.loads((folder / "a.json").read_text())
    told_by_check = json.loads(run("check", TINY, "--torque", "4", *FILES, "--json", cwd=folder).stdout)
    (point,) = told_by_check["operating_points"]
    assert checks(told) == {
        "F_IOR": pytest.approx(point["F_ior_upper_arcsec"], abs=1e-9),
        "SELF_ERROR": pytest.approx(point["self_error_arcsec"], abs=1e-9),
    }
    assert checks(told)["F_IOR"] != checks(json.loads(run("accept", TINY, *LIMITS, "--json").stdout))["F_IOR"]
    assert [(each["wheel"], each["file"], each["mark_deg"], each["sha256"]) for each in told["pitch"]] == [
        (name, f"{name}.csv", mark, hashlib.sha256((folder / f"{name}.csv").read_bytes()).hexdigest())
        for name, mark in (("b", 30.0), ("g", 0.0))
    ]
    page = run("accept", TINY, *LIMITS, *FILES, "--ascii", cwd=folder).stdout
    assert "measured pitch deviations: circular spline (b.csv), flexspline (g.csv)" in in_a_line(page)
    assert run("accept", "--replay", "a.json", "-q", cwd=folder).stdout == "agrees\n"
    (folder / "g.csv").write_text(wheel(20, 1))
    changed = run("accept", "--replay", "a.json", cwd=folder)
    assert (changed.returncode, "g.csv has changed" in changed.stdout) == (4, True)


def test_what_is_unknown_beside_measured_teeth_leaves_it_open(folder):
    drive = load_preset(TINY, ["phases.phi_hb=unknown", "operation.M_g=4", "acceptance.F_ior=100000"])
    wheels = WheelFiles(str(folder / "b.csv"), mark_b=0.0).read(drive)
    result = accept(drive, wheels=wheels)
    assert (result.verdict, [note.code for note in result.remarks]) == ("INCONCLUSIVE", ["UNKNOWN"])
    # what the teeth stand for needs not be known
    open_ = load_preset(TINY, ["tolerances.F_i2=unknown", "operation.M_g=4", "acceptance.F_ior=100000"])
    assert accept(open_, wheels=WheelFiles(str(folder / "b.csv"), mark_b=0.0).read(open_)).verdict == "PASS"


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (("--mark-b", "3"), "--mark-b requires the pitch deviations of this wheel"),
        (("--pitch-sense", "cw"), "require --pitch-b or --pitch-g"),
        (
            (*FILES, "--measured-only"),
            "--measured-only makes no prediction, so measured pitch deviations cannot be used",
        ),
        (("--pitch-b", "-", "--measured", "4=-"), "standard input can be read only once"),
        (("--pitch-b", "g.csv", "--mark-b", "0"), "the wheel has 22 teeth, the file has 20"),
        ((TINY, *FILES), "measured values apply to a single drive"),
    ],
)
def test_what_cannot_be_meant(folder, args, said):
    done = run("accept", TINY, *LIMITS, *args, cwd=folder)
    assert done.returncode in (2, 4)
    assert said in done.stderr
    assert done.stdout == ""


def test_rows_have_wheels_of_their_own(folder):
    (folder / "lot.csv").write_text(
        "serial,pitch_b,mark_b,pitch_g,mark_g\nboth,b.csv,30,g.csv,\nnone,,,,\nturned,b.csv,120,,\n"
    )
    done = run("accept", "lot.csv", "--preset", TINY, *LIMITS, "--jsonl", "a.jsonl", "--csv", "a.csv", cwd=folder)
    assert done.returncode == 0
    told = [json.loads(line) for line in (folder / "a.jsonl").read_text().splitlines()[1:]]
    alone = run("accept", TINY, *LIMITS, "--pitch-b", "b.csv", "--mark-b", "120", "--json", cwd=folder)
    assert checks(told[2]) == checks(json.loads(alone.stdout))
    assert len({answer["checks"][0]["value"] for answer in told}) == 3
    assert [[each["file"] for each in answer["pitch"]] for answer in told] == [["b.csv", "g.csv"], [], ["b.csv"]]
    again = run("accept", "lot.csv", "--preset", TINY, *LIMITS, "--jsonl", "a.jsonl", "--resume", cwd=folder)
    assert "a.jsonl: 3 of 3 rows are already computed" in again.stderr
    (folder / "b.csv").write_text(wheel(22, 2))
    again = run("accept", "lot.csv", "--preset", TINY, *LIMITS, "--jsonl", "a.jsonl", "--resume", cwd=folder)
    assert "a.jsonl: 1 of 3 rows are already computed" in again.stderr


LOT = "serial;F_ior@4;limit F_ior@4;preset;pitch_b\n1;28±1;30;;\n2;31±0,1;30;;\n3;28±1;30;-;\n4;;30;;-\n"


def test_a_lot_from_standard_input(folder):
    asked = ("accept", "-", "--preset", TINY, "--measured-only")
    done = run(*asked, "--jsonl", "a.jsonl", "--junit", "a.xml", stdin=LOT, cwd=folder)
    assert done.returncode == 4
    page = [line for line in done.stdout.splitlines() if re.match(r"\d  ", line)]
    verdicts = ["PASS", "FAIL", "DATA_ERROR", "DATA_ERROR"]
    assert [line.split()[:2] for line in page] == [[f"{k}", each] for k, each in enumerate(verdicts, 1)]
    for place in ("<stdin>:4:11: preset", "<stdin>:5:8: pitch_b"):
        assert f"{place}: a row cannot read standard input (got -; name a file)" in done.stderr
    told = [json.loads(line) for line in (folder / "a.jsonl").read_text().splitlines()[1:]]
    (folder / "lot.csv").write_text(LOT)
    for mine, theirs in zip(
        told,
        json.loads(run("accept", "lot.csv", *asked[2:], "--json", cwd=folder).stdout)["results"],
        strict=True,
    ):
        same = {"time", "place", "error", "item", "checksum"}
        assert {k: v for k, v in mine.items() if k not in same} == {k: v for k, v in theirs.items() if k not in same}
    assert '<testsuites name="&lt;stdin&gt;"' in (folder / "a.xml").read_text()
    again = run(*asked, "--jsonl", "a.jsonl", "--resume", stdin=LOT, cwd=folder)
    assert "a.jsonl: 2 of 4 rows are already computed" in again.stderr
    replayed = run("accept", "--replay", "a.jsonl", "-q", cwd=folder)
    assert (replayed.returncode, replayed.stdout.split("\n")) == (
        0,
        ["1 agrees", "2 agrees", "3 not replayed", "4 not replayed", ""],
    )
    with open_kept(str(folder / "a.jsonl"), KeptOwner(command="accept", inputs={}), ANSWERS):
        locked = run(*asked, "--jsonl", "a.jsonl", "--resume", stdin=LOT, cwd=folder)
    assert (locked.returncode, "being written by another run" in locked.stderr) == (2, True)


@pytest.mark.parametrize(
    ("args", "stdin", "code", "said"),
    [
        (("-", "--preset", "-"), LOT, 2, "the preset of a lot cannot be read from standard input"),
        (("-", TINY, "--preset", TINY), LOT, 2, "- is a lot and cannot be combined"),
        (("-", "--preset", TINY, "--serial", "1"), LOT, 2, "measured values apply to a single drive"),
        (("-", "--preset", TINY), "", 4, "<stdin>:1:1: the file is empty"),
        (
            ("-", "--preset", TINY),
            "serial,nothing\n1,2\n",
            4,
            "<stdin>:1:8: nothing: no column of a lot file has this name",
        ),
        (("-",), LOT, 4, "<stdin>:1:1: a preset must be a table of keys"),
    ],
)
def test_what_a_lot_from_standard_input_cannot_be(args, stdin, code, said):
    done = run("accept", *args, stdin=stdin)
    assert (done.returncode, done.stdout) == (code, "")
    assert said in done.stderr
