"""What is varied: ranges and lists as their words say, or refused with the place."""

from __future__ import annotations

import json

import pytest

from hdassist import load_preset
from hdassist.features.design import MOST_VALUES, Sweep, read_axes
from hdassist.run.errors import UsageError
from tests.helpers.process import SMALL, run


@pytest.mark.parametrize(
    ("text", "path", "values"),
    [
        ("tolerances.e_hb=20:120:11", "tolerances.e_hb", tuple(map(float, range(20, 121, 10)))),
        ("cam.W_0=0.1:0.2:3", "cam.W_0", (0.1, 0.15, 0.2)),
        ("cam.W_0=0:1:11", "cam.W_0", (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)),
        ("tolerances.e_hb=0.12 mm:20um:2", "tolerances.e_hb", (120.0, 20.0)),
        (" gears.j_n = 5, 1e1 ,0.02 mm", "gears.j_n", (5.0, 10.0, 20.0)),
        ("operation.M_g=40", "operation.M_g", (40.0,)),
        ("gears.z_g=60:66:4", "gears.z_g", (60, 62, 64, 66)),
        ("supports.C_2=1e4,2e4", "supports.C_2", (1e4, 2e4)),
    ],
)
def test_values_are_what_their_words_say_in_every_digit(text, path, values):
    (axis,) = read_axes([text], [])
    assert axis.path == path
    assert axis.values == values
    assert {type(value) for value in axis.values} == {int if path == "gears.z_g" else float}


WRONG = [
    ("", "nothing: expected KEY=START:STOP:STEPS"),
    ("tolerances.e_hb", "expected KEY=START:STOP:STEPS"),
    ("tolerances.e_hx=1,2", "expected a field with a single number", "the nearest name is tolerances.e_h"),
    ("e_hb=1,2", "expected a field with a single number", "the nearest name is tolerances.e_hb"),
    ("name=a,b", "expected a field with a single number"),
    ("uncertainty.phases.xi_b=1,2", "expected a field with a single number"),
    ("bearing.ball_motion=locked,rolling", "expected a field with a single number"),
    ("acceptance.F_ior=1,2", "expected a field with a single number"),
    ("tolerances.e_hb=", "numbers, but a value is missing"),
    ("tolerances.e_hb=1,,2", "numbers, but a value is missing"),
    ("tolerances.e_hb=1,a", "(a must be a number)"),
    ("tolerances.e_hb=nan", "(nan must be a finite number)"),
    ("tolerances.e_hb=1:inf:3", "(inf must be a finite number)"),
    ("tolerances.e_hb=1,2 m", "the unit m is ambiguous"),
    ("tolerances.e_hb=1,1.0", "expected different values"),
    ("tolerances.e_hb=1:2", "expected KEY=START:STOP:STEPS", "from 20 to 120 in 11 steps"),
    ("tolerances.e_hb=1:2:3:4", "expected KEY=START:STOP:STEPS"),
    ("tolerances.e_hb=1:2:0", f"expected a number of steps from 2 to {MOST_VALUES}"),
    ("tolerances.e_hb=1:2:1", "expected a number of steps from 2"),
    ("tolerances.e_hb=1:2:-3", "expected a number of steps from 2"),
    ("tolerances.e_hb=1:2:2.5", "expected a number of steps from 2"),
    ("tolerances.e_hb=1:2:1000000", "expected a number of steps from 2"),
    ("tolerances.e_hb=1:1:3", "expected different values"),
    ("gears.z_g=60.5,62", "must be a whole number"),
    ("gears.z_g=60:62:4", "expected a number of steps that gives whole numbers only"),
    ("cam.W_0=1,2", "expected a field that neither --set nor --torque sets", "leave out either --vary or the other"),
]


@pytest.mark.parametrize("wrong", WRONG, ids=lambda wrong: wrong[0])
def test_what_cannot_be_meant_is_refused(wrong):
    text, words, *hints = wrong
    with pytest.raises(UsageError) as refused:
        read_axes([text], ["cam.W_0=0.9"])
    assert f"invalid --vary {text or 'nothing'}: expected" in refused.value.message
    assert words in refused.value.message
    assert all(hint in refused.value.hint for hint in hints)


def test_a_field_is_varied_once():
    with pytest.raises(UsageError, match=r"--vary gears\.j_n is given more than once"):
        read_axes(["gears.j_n=1,2", "gears.j_n=3"], [])
    with pytest.raises(UsageError, match="neither --set nor --torque sets"):
        read_axes(["operation.M_g=1"], ["operation.M_g=[4]"])


def test_a_grid_that_would_never_end_is_refused():
    axes = read_axes(["gears.j_n=0:9:1000", "cam.W_0=0:1:1001"], [])
    with pytest.raises(UsageError, match="2002000 rows; the maximum is 1000000"):
        Sweep.of(b"", SMALL, load_preset(SMALL), axes)  # at its two torques


@pytest.mark.parametrize(
    "options",
    [
        (), ("--vary", "gears.j_n=1:2:0"), ("--vary", "gears.j_n=1,2", "--json", "--csv", "-"),
        ("--vary", "gears.j_n=0:9:1000", "--vary", "phases.xi_b=0:9:1000", "--torque", "1", "--json"),
        ("--vary", "gears.j_n=1,2", "--scheduler", "here"),
    ],
)  # fmt: skip
def test_wrong_usage_ends_before_anything_is_written(tmp_path, options):
    done = run("sweep", SMALL, *options, "-o", "rows.jsonl", cwd=tmp_path)
    assert done.returncode == 2
    answer = json.loads(done.stdout or "null")  # with --json the error is an object
    assert (answer and answer["error"]["code"]) == ("USAGE" if "--json" in options else None)
    assert not list(tmp_path.iterdir())
