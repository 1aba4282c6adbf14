"""A robot joint with two encoders: what `measure` reads off its record, before any model."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from hdassist.features.measuring.measure import SweepResult, measure
from hdassist.readers.trace import read_trace
from tests.validation.case import Case, Information, Kind, about, parameters

RECORD = Path(__file__).parent / "data/lara8-j3.csv"
RATIO, SWEPT = 101.0, 69.84  # turns of the cam: per turn of the output, in the record

TITLE = "A robot joint"
ABOUT = (
    "The recording shows joint 3 of a robot arm with two 24-bit encoders, one at the input and one at the output. "
    "Under gravity load, the output turned by 298°, with one reading every 20.5° of the input. The recording was "
    "evaluated with `measure --ratio 101`, without a preset. The load and its sign are unknown.\n\nSlow terms with a "
    "range of about 1 070″ dominate the recording. Their possible causes are graduation and coupling of the encoder, "
    "wind-up by gravity, lag and drift. A recording of less than one output revolution cannot separate these terms "
    "from slow terms of the drive, so all slow terms are subtracted. The orders up to 6 of the input remain. They "
    "give a lower bound of F'_ior, because the recording covers only two thirds of the mesh cycle. An order cannot be "
    "separated from its sidebands, so the table gives each order together with its sidebands. The lines at 4.86 and "
    "5.22 periods per input revolution do not correspond to any deviation in the model."
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
        "covered input revolutions, of 101 in the mesh cycle",
        "",
        SOURCE,
        SWEPT - 2,
        SWEPT,
        why="The input turned by 69.84 revolutions. Gaps between readings of more than 30° are not counted",
        kind=Kind.READING,
        value=turns,
        digits=".2f",
    ),
    Case(
        "lower bound of F'_ior",
        "arcsec",
        SOURCE,
        **about(46.7, 6),
        why="A least-squares fit without a prior gives this value after subtraction of the output orders 0 to 12. The "
        "value contains the noise of the two extreme readings",
        kind=Kind.READING,
        value=lambda: sweep().range.fitted,
        digits=".1f",
    ),
    Case(
        "range of the subtracted slow terms",
        "arcsec",
        SOURCE,
        **about(1063, 20),
        why="A least-squares fit without a prior gives this value for the output orders 0 to 12",
        kind=Kind.READING,
        value=lambda: sweep().slow_arcsec,
        digits=".0f",
    ),
    *(
        Case(
            f"order {order:g} with its sidebands",
            "arcsec",
            SOURCE,
            **about(value, 0.4),
            why="A least-squares fit without a prior gives this value, which contains noise",
            kind=Kind.READING,
            value=lambda order=order: of_cam(order),
            digits=".1f",
        )
        for order, value in ((2.0, 4.1), (3.0, 1.4), (4.0, 2.8))
    ),
    *(
        Case(
            f"line at {order} periods per input revolution",
            "arcsec",
            SOURCE,
            **about(value, 1),
            why="A least-squares fit without a prior gives this value",
            kind=Kind.READING,
            value=lambda order=order: amplitude(order),
            digits=".1f",
        )
        for order, value in ((4.86, 5.2), (5.22, 6.2))
    ),
]
INFORMATION = [
    Information(
        "order 1 with its sidebands",
        "arcsec",
        "The uncertainty of 1.6 arcsec is nearly as large as the value, because most of the noise is of low "
        "frequency. The input encoder may also cause order 1.",
        value=lambda: of_cam(1.0),
        digits=".1f",
    ),
]


@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case: Case) -> None:
    case.check()
