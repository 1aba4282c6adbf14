"""What is wrong with a cell of a lot is said of the cell: file, line, column and heading."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from hdassist.features.acceptance.accept import answer_row
from hdassist.features.acceptance.answer import AcceptAnswer, answer_differences, answer_json, read_answers
from hdassist.features.acceptance.request import LotRow, Request, read_lot
from hdassist.run.errors import Fault
from tests.helpers.process import SMALL, run

FAULTS = """\
serial;F_ior@4;limit F_ior@4;lost_motion;limit order_2@4;phases.xi_b;measured;preset;pitch_b;mark_b
a;28,1;30;;;;;;;
b;28±x;30;;;;;;;
c;28±1;abc;;;;;;;
d;28±1;30;41;;;;;;
e;28±1;30;;x;;;;;
f;28±1;30;;2;here;;;;
g;28±1;-3;;3;1e9;;;;
h;;30;;3;;4=none.csv;;;
i;28±1;30;;;;;none;;
j;28±1;30;;;;none.csv;-;;
k;;30;;;;;;none.csv;10
l;;30;;;;;;short.csv;10
m;;30;;;;;;;10
n;;30;;;;;;short.csv;left
o;;30;;3;60;,x:none.csv;;;
"""
SAID = {
    "a": "lot.csv:2:3: F_ior@4: the uncertainty is missing (got 28,1)",
    "b": "lot.csv:3:3: F_ior@4: must be a number (got 28±x)",
    "c": "lot.csv:4:8: limit F_ior@4: must be a number (got abc; write a number in arcsec)",
    "d": "lot.csv:5:11: lost_motion: the drive has no limit of this name (got 41)",
    "e": "lot.csv:6:12: limit order_2@4: must be a number (got x; write a number in arcsec)",
    "f": "lot.csv:7:14: phases.xi_b: must be a number (got here; write a number in deg)",
    "g": "lot.csv:8:14: phases.xi_b: must be from -3600 to 3600 deg (got 1e9)\n"
    "lot.csv:8:8: limit F_ior@4: must be above 0, up to 1e6 arcsec (got -3)",
    "h": "lot.csv:9:11: measured: no such file: none.csv",
    "i": "lot.csv:10:15: preset: no such preset or file: none",
    "j": "lot.csv:11:23: preset: a row cannot read standard input (got -; name a file)",
    "k": "lot.csv:12:12: pitch_b: no such file: none.csv",
    "l": "lot.csv:13:12: pitch_b: short.csv:1:1: column 1: the wheel has 62 teeth, the file has 2",
    "m": "lot.csv:14:13: mark_b: --mark-b requires the pitch deviations of this wheel",
    "n": "lot.csv:15:22: mark_b: must be an angle in deg (got left)",
    "o": "lot.csv:16:13: measured: the torque is missing (got ,x:none.csv)",
}


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[AcceptAnswer]]:
    """Answers to a row for each fault, in their folder."""
    with contextlib.chdir(tmp_path_factory.mktemp("cells")):
        Path("lot.csv").write_text(FAULTS, encoding="utf-8")
        Path("short.csv").write_text("1;0\n2;1\n", encoding="utf-8")
        rows = read_lot("lot.csv", Request(SMALL, limits=("F_ior@1=30",))).rows
        yield list(map(answer_row, rows))


def test_each_fault_is_said_of_its_cell(told: list[AcceptAnswer]) -> None:
    assert {answer.serial: answer.error.message.partition(" (got no row")[0] for answer in told} == SAID
    assert {answer.exit_code for answer in told} == {4}
    codes = {answer.serial: answer.error.code for answer in told}
    assert (codes["a"], codes["h"], codes["l"]) == (Fault.DATA, Fault.FILE_UNREADABLE, Fault.FILE_INVALID)


def test_faulty_row_replays_with_the_same_error(told: list[AcceptAnswer]) -> None:
    Path("a.jsonl").write_text(json.dumps({"results": list(map(answer_json, told))}), encoding="utf-8")
    recorded = read_answers("a.jsonl")
    assert [answer.serial for answer in recorded if answer.request is None] == ["j", "n"]
    rows = [LotRow(each.request, each.place) for each in recorded if each.request]
    again = list(map(answer_row, rows))
    asked = [answer for answer in recorded if answer.request is not None]
    for was, now in zip(asked, again, strict=True):
        assert answer_differences(was, now) == []
        other = replace(now, error=replace(now.error, code=Fault.BUG))
        assert "error.code" in [each.key for each in answer_differences(was, other)]


def test_errors_repeat_a_command_line_limit_as_it_was_typed() -> None:
    done = run("accept", SMALL, "--set", "cam.W_0=x", "--limit", "F_ior@4=30 mm", "--limit", "order_2@4=y")
    assert done.returncode == 2
    assert done.stderr.splitlines()[:3] == [
        "error: --set:1:9: cam.W_0: must be a number (got x; write a number in mm)",
        "--limit F_ior@4=30 mm: mm is a unit of a length; expected a unit of an angle (got 30 mm; use one of "
        "deg, arcmin, arcsec, rad, mrad, urad; a number without a unit is in arcsec)",
        "--limit order_2@4=y: must be a number (got y; write a number in arcsec)",
    ]
    assert done.stderr.endswith("  hint: hdassist explain USAGE\n")


def test_an_error_has_the_code_that_explain_takes() -> None:
    for args, code, status in (
        (("accept", "none.yaml"), "FILE_UNREADABLE", 4),
        (("accept", SMALL), "DATA", 4),
        (("check", SMALL, "--set", "operation.M_g=1e6"), "BEYOND_MODEL", 5),
    ):
        done = run(*args, "--json")
        assert (done.returncode, json.loads(done.stdout)["error"]["code"]) == (status, code)
        assert f"hdassist explain {code}" in done.stderr
    for args in (("check",), ("check", SMALL, "--none"), ("nothing",), ("check", SMALL, "--jobs", "x")):
        done = run(*args)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.endswith("\n  hint: hdassist explain USAGE\n")
    assert "hint" not in run("presets").stderr  # the help of a group is no error
