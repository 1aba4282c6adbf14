"""What is varied: ranges and lists as their words say, or refused with the place."""

from __future__ import annotations

import pytest

from hdassist.errors import UsageError
from hdassist.tolerance.vary import MOST_ROWS, MOST_VALUES, grid_rows, read_axes, require_few
from tests.process import SMALL, run


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
    ("", "1:1: not of the form"),
    ("tolerances.e_hb", "1:1: not of the form"),
    ("tolerances.e_hx=1,2", "1:1: names no field (got tolerances.e_hx; did you mean tolerances.e_h"),
    ("e_hb=1,2", "1:1: names no field (got e_hb; did you mean tolerances.e_hb?)"),
    ("name=a,b", "1:1: names no field"),
    ("uncertainty.phases.xi_b=1,2", "1:1: names no field"),
    ("bearing.ball_motion=locked,rolling", "1:1: not a field of a single number"),
    ("acceptance.F_ior=1,2", "1:1: not a field of a single number"),
    ("tolerances.e_hb=", "1:17: must be a number"),
    ("tolerances.e_hb=1,,2", "1:19: must be a number"),
    ("tolerances.e_hb=1,a", "1:19: must be a number"),
    ("tolerances.e_hb=nan", "1:17: must be a finite number"),
    ("tolerances.e_hb=1:inf:3", "1:19: must be a finite number"),
    ("tolerances.e_hb=1,2 m", "1:19: the unit m could be mistaken"),
    ("tolerances.e_hb=1,1.0", "1:17: the same value twice"),
    ("tolerances.e_hb=1:2", "1:17: not of the form START:STOP:STEPS"),
    ("tolerances.e_hb=1:2:3:4", "1:17: not of the form START:STOP:STEPS"),
    ("tolerances.e_hb=1:2:0", "1:21: steps must be"),
    ("tolerances.e_hb=1:2:1", "1:21: steps must be"),
    ("tolerances.e_hb=1:2:-3", "1:21: steps must be"),
    ("tolerances.e_hb=1:2:2.5", "1:21: steps must be"),
    ("tolerances.e_hb=1:2:1000000", f"1:21: steps must be a whole number from 2 to {MOST_VALUES} (got 1000000"),
    ("tolerances.e_hb=1:1:3", "1:17: a range from a value to itself"),
    ("gears.z_g=60.5,62", "1:11: must be a whole number"),
    ("gears.z_g=60:62:4", "1:17: steps between whole numbers"),
    ("cam.W_0=1,2", "1:1: set to one value and varied too"),
]


@pytest.mark.parametrize(("text", "told"), WRONG)
def test_what_cannot_be_meant_is_refused_with_its_place(text, told):
    with pytest.raises(UsageError) as refused:
        read_axes([text], ["cam.W_0=0.9"])
    assert f"--vary:{told}" in refused.value.message


def test_all_that_is_wrong_is_said_at_once():
    with pytest.raises(UsageError) as refused:
        read_axes(["x=1", "gears.j_n=1,2", "gears.j_n=3", "operation.M_g=1"], ["operation.M_g=[4]"])
    told = refused.value.message.splitlines()
    assert [line[:10] for line in told] == ["--vary:1:1", "--vary:3:1", "--vary:4:1"]
    assert "varied twice" in told[1]


def test_a_grid_that_would_never_end_is_refused():
    axes = read_axes(["gears.j_n=0:9:1000", "cam.W_0=0:1:1001"], [])
    assert grid_rows(axes) == MOST_ROWS + 1000
    with pytest.raises(UsageError, match="1001000 rows, more than 1000000"):
        require_few(grid_rows(axes))


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
    assert done.stdout == ""
    assert not list(tmp_path.iterdir())
