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
    "The recording shows joint 3 of a robot arm with two 24-bit encoders. It is a sweep of 298° under gravity, "
    "with a reading every 20.5° of the input (`measure --ratio 101`). Slow terms of the output span 1 070″ "
    "(graduation, coupling, wind-up by gravity, lag, drift). A recording of less than one output revolution "
    "cannot separate these terms from each other or from slow terms of the drive, so all slow terms are "
    "subtracted. The remaining orders of the input up to 6 give a lower bound of F'_ior, with two thirds of "
    "the mesh cycle and each order together with its sidebands. The lines at 4.86 and 5.22 belong to no "
    "deviation of the model. The load and its sign are unknown."
)
SOURCE = "allwinlucious/MasterThesis"


@cache
def sweep() -> SweepResult:
    """The record as `measure` reads it."""
    (direction,) = measure(read_trace(RECORD, ratio=RATIO), ratio=RATIO).directions
    return direction


def amplitude(order: float) -> float:
    """Amplitude [arcsec] at the order that lies nearest."""
    return min(sweep().orders, key=lambda found: abs(found.per_cam_rev - order)).amplitude_arcsec


def of_cam(order: float) -> float:
    """Amplitude [arcsec] of an order of the cam with its sidebands."""
    return next(found.amplitude_arcsec for found in sweep().orders_of_cam if found.per_cam_rev == order)


def turns() -> float:
    """Turns of the cam that the record visits."""
    visited = sweep().coverage
    assert visited is not None
    return visited.cam_turns


CASES = [
    Case(
        "input revolutions covered, of 101", "", SOURCE, SWEPT - 2, SWEPT, why="69.84 swept; gaps above 30°",
        kind=Kind.READING, value=turns, digits=".2f",
    ),
    Case(
        "F'_ior, at least", "arcsec", SOURCE, **about(46.7, 6),
        why="without output orders 0 to 12, by plain least squares, with the noise of two readings",
        kind=Kind.READING, value=lambda: sweep().range.fitted, digits=".1f",
    ),
    Case(
        "slow terms subtracted", "arcsec", SOURCE, **about(1063, 20),
        why="output orders 0 to 12 by plain least squares", kind=Kind.READING,
        value=lambda: sweep().slow_arcsec, digits=".0f",
    ),
    *(
        Case(
            f"order {order:g} with its sidebands", "arcsec", SOURCE, **about(value, 0.4),
            why="by plain least squares, noise included", kind=Kind.READING,
            value=lambda order=order: of_cam(order), digits=".1f",
        )
        for order, value in ((2.0, 4.1), (3.0, 1.4), (4.0, 2.8))
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
        "order 1 with its sidebands", "arcsec", "known to 1.6 only: most of the noise is slow; or the input encoder",
        value=lambda: of_cam(1.0), digits=".1f",
    ),
]  # fmt: skip


@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case: Case) -> None:
    case.check()
