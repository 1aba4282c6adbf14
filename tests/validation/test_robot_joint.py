"""A robot joint with two encoders: what `measure` reads off its record, before any model."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from hdassist.measuring.measure import SweepResult, measure
from hdassist.readers.trace import read_trace
from tests.validation.case import Case, Information, Kind, about, parameters

RECORD = Path(__file__).parent / "data/lara8-j3.csv"
RATIO, SWEPT = 101.0, 69.84  # turns of the cam: per turn of the output, in the record

TITLE = "A robot joint"
ABOUT = (
    "Joint 3 of an arm, two 24-bit encoders, a sweep of 298° under gravity, a reading every 20.5° of the cam (`measure "
    "--ratio 101 --drift linear`). F'_ior is a lower bound: two thirds of the cycle, most of it once per turn of the "
    "output (graduation, coupling, wind-up). The lines at 4.86 and 5.22 are of no deviation that the model has."
)
SOURCE = "allwinlucious/MasterThesis"


@cache
def sweep() -> SweepResult:
    """The record as `measure` reads it, a linear drift taken off."""
    (direction,) = measure(read_trace(RECORD, ratio=RATIO), ratio=RATIO, drift="linear").directions
    return direction


def amplitude(order: float) -> float:
    """Amplitude [arcsec] at the order that lies nearest."""
    return min(sweep().orders, key=lambda found: abs(found.per_cam_rev - order)).amplitude_arcsec


def turns() -> float:
    """Turns of the cam that the record visits."""
    visited = sweep().coverage
    assert visited is not None
    return visited.cam_turns


CASES = [
    Case(
        "cam turns visited, of 101", "", SOURCE, SWEPT - 2, SWEPT, why="69.84 swept; gaps above 30°",
        kind=Kind.READING, value=turns, digits=".2f",
    ),
    Case(
        "greatest range within a cam turn", "arcsec", SOURCE, **about(46.7, 3),
        why="without output orders 0 to 12, by plain least squares",
        kind=Kind.READING, value=lambda: sweep().revolution.value, digits=".1f",
    ),
    Case(
        "order 2", "arcsec", SOURCE, **about(2.4, 0.4), why="by plain least squares; 2.9 at 1.98: a beat",
        kind=Kind.READING, value=lambda: amplitude(2.0), digits=".1f",
    ),
    *(
        Case(
            f"line at {order}", "arcsec", SOURCE, **about(value, 1), why="by plain least squares",
            kind=Kind.READING, value=lambda order=order: amplitude(order), digits=".1f",
        )
        for order, value in ((4.86, 5.2), (5.22, 6.2))
    ),
]  # fmt: skip
INFORMATION = [
    Information(
        "F'_ior, at least", "arcsec", "known to a third only", value=lambda: sweep().range.value, digits=".0f",
    ),
]  # fmt: skip


@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case: Case) -> None:
    case.check()
