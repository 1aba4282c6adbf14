"""A flank window that is too narrow is widened, and the answer is that which the wider window gives when asked for."""

from __future__ import annotations

import json

import pytest

from hdassist import load_preset
from hdassist.error.stiffness import stiffness
from hdassist.errors import UntrustedError
from hdassist.run.run import UNCHECKED
from hdassist.solve.window import FIELD, WIDEST_WINDOW, EdgeOfWindowError, in_wide_enough_window, with_window
from tests.process import SMALL, run

NARROW, WIDE = "12", "18"


def windows_until(enough: float, *sets: str) -> list[float]:
    """Windows in which an analysis is done that has teeth at the edge below a width."""
    tried: list[float] = []

    def analysis(drive):
        tried.append(drive.numerics.window)
        if tried[-1] < enough:
            raise EdgeOfWindowError("edge", "widen it")
        return drive

    there = in_wide_enough_window(load_preset(SMALL, sets), analysis)
    assert there.numerics.window == tried[-1]
    assert there.origin.overrides == (*sets, *([f"{FIELD}={tried[-1]:g}"] if len(tried) > 1 else []))
    assert there.origin.warnings == load_preset(SMALL, sets).origin.warnings + tuple(
        f"teeth carry load at the edge of the flank window of {tried[0]:g}°: computed anew in one of {tried[-1]:g}°; "
        f"--set numerics.window={tried[-1]:g} makes it permanent"
        for _ in tried[1:2]
    )
    assert load_preset(SMALL, there.origin.overrides).model_dump() == there.model_dump()
    return tried


def test_the_window_grows_until_it_holds_the_load_or_is_the_widest():
    assert windows_until(0) == [40]
    assert windows_until(41) == [40, 60]
    assert windows_until(85, "gears.j_n=3") == [40, 60, 85]
    assert windows_until(16, f"{FIELD}=7") == [7, 10.5, 15.8, 23.7]  # to a tenth of a degree
    with pytest.raises(EdgeOfWindowError, match="edge"):
        windows_until(86)
    drive = load_preset(SMALL)
    assert drive.allows(FIELD, WIDEST_WINDOW)
    assert not drive.allows(FIELD, WIDEST_WINDOW + 0.1)


def test_a_drives_own_window_is_no_other_one():
    drive = load_preset(SMALL)
    assert with_window(drive, drive.numerics.window) is drive


def test_other_errors_are_not_met_with_a_wider_window():
    tried = []

    def analysis(drive):
        tried.append(drive)
        raise UntrustedError("not solved")

    with pytest.raises(UntrustedError, match="not solved"):
        in_wide_enough_window(load_preset(SMALL), analysis)
    assert len(tried) == 1


def test_a_program_is_told_the_override():
    with pytest.raises(EdgeOfWindowError, match="outermost tooth of the flank window") as error:
        stiffness(load_preset(SMALL, [f"{FIELD}={NARROW}"]), run=UNCHECKED)
    assert error.value.exit_code == 5
    assert "--set numerics.window=" in error.value.hint


def told(words: list[str], window: str) -> tuple[dict, list[str]]:
    """JSON of a command in a window without its time and what was asked, and its warnings, which are on stderr too."""
    sets = ["--set", "operation.M_g=4", "--set", "numerics.n_phase=2", "--set", f"numerics.window={window}"]
    done = run(words[0], SMALL, *words[1:], *sets, "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    warnings = answer.pop("warnings")
    assert all(text in done.stderr for text in warnings)
    overrides = answer["preset"].pop("overrides")
    assert f"numerics.window={WIDE}" in overrides
    return {key: value for key, value in answer.items() if key not in ("time", "request")}, warnings


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    file = str(tmp_path_factory.mktemp("window") / "run.csv")
    assert run("trace", SMALL, "--torque", "4", "-n", "3", "--csv", file, "-q").returncode == 0
    return file


@pytest.mark.parametrize(
    "words",
    [
        ["check"],
        ["trace"],
        ["mount", "--draws", "0", "--set", "mounting.holes=3"],
        ["stiffness"],
        ["accept", "--limit", "F_ior=50"],
        ["compare", "TRACE"],
    ],
    ids=lambda words: words[0],
)
def test_the_answer_is_that_of_the_wider_window(words, trace):
    words = [trace if word == "TRACE" else word for word in words]
    (narrow, warned), (wide, plain) = (told(words, window) for window in (NARROW, WIDE))
    (widened,) = set(warned) - set(plain)
    assert f"--set numerics.window={WIDE} makes it permanent" in widened
    assert narrow == wide


def test_rows_of_a_lot_that_share_predictions_share_their_window(tmp_path):
    (tmp_path / "lot.csv").write_text(f"serial;numerics.window\n1;{NARROW}\n2;{NARROW}\n3;{WIDE}\n")
    done = run("accept", "lot.csv", "--preset", SMALL, "--limit", "K_1=10", "--jobs", "1", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    one, two, three = json.loads(done.stdout)["results"]
    assert one["checks"] == two["checks"] == three["checks"]
    assert one["preset"]["overrides"][-1] == two["preset"]["overrides"][-1] == f"numerics.window={WIDE}"
    assert one["warnings"] == two["warnings"]
    assert "makes it permanent" in one["warnings"][-1]
    assert three["warnings"] == []
