"""Moves of a shaft in one direction each, out of the angles that an encoder has recorded; wrapped angles joined."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

WHOLE_TURN_DEG = 360.0
COUNTER_BITS = (16, 24, 32)  # of counters that begin again where they are full
LEAP = 0.4  # of the wrap: the direction of a longer step is ambiguous
JITTER = 0.5  # deg: moves back that are noise of a shaft that stands or creeps
TURNING_STEPS, WIDEST_TURNING = 4.0, 5.0  # the same in median steps, at most so many deg, of coarse readings
WIDEST_TURN_BACK = 2.5  # median steps: how far a reading may lie off those around it where the shaft turns back
FEW_ROWS = 5  # fewer rows are no move
SPIKE = 10.0  # median steps: longest first step after a restart

Angles = NDArray[np.float64]


@dataclass(frozen=True)
class AngleSweep:
    """Rows start to stop (that one not) in one direction: 1 for growing angles, -1 for falling ones."""

    start: int
    stop: int
    direction: int


class AngleError(ValueError):
    """An impossible angle: its row, a message and a hint."""

    def __init__(self, row: int, message: str, hint: str) -> None:
        super().__init__(message)
        self.row, self.message, self.hint = row, message, hint


def guessed_wrap(angle: Angles, count: float) -> float | None:
    """Angle [deg] after which an encoder begins again: a turn, or the range of its counter; None if it does not.

    All angles lie within it, with steps of more than half of it. Argument: count, size of a count [deg].
    """
    span, longest = float(np.ptp(angle)), float(np.abs(np.diff(angle)).max(initial=0.0))
    wraps = (WHOLE_TURN_DEG, *(2**bits * count for bits in COUNTER_BITS))
    return next((wrap for wrap in wraps if span <= wrap < 2 * longest), None)


def unwrapped(angle: Angles, wrap: float, other: Angles | None = None) -> Angles:
    """Angles without the jumps of an encoder that begins again after wrap, shape (rows,), in the same unit.

    other: the same angle by another encoder, without jumps and in either sense, which says how far a long step went.
    Raises AngleError: a step that may have gone either way round.
    """
    steps = np.diff(angle)

    def off(expected: Angles) -> Angles:
        return np.asarray(steps - expected - wrap * np.rint((steps - expected) / wrap))

    expected = np.zeros(len(steps))
    if other is not None:
        expected = min((np.diff(other), -np.diff(other)), key=lambda each: float(np.abs(off(each)).sum()))
    steps = expected + off(expected)
    far = np.flatnonzero(np.abs(steps - expected) > LEAP * wrap)
    if len(far):
        row = int(far[0]) + 1
        raise AngleError(row, f"a step of {abs(steps[row - 1]):.4g} of a wrap of {wrap:g}", "record shorter steps")
    return np.asarray(np.concatenate([angle[:1], angle[0] + np.cumsum(steps)]))


def leaping(angle: Angles) -> NDArray[np.bool_]:
    """Rows, shape (rows,), whose angle [deg] lies off the median of the five around it, as it never does on its way."""
    padded = np.pad(angle, 2, mode="reflect", reflect_type="odd")
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1)
    steps = np.abs(np.diff(around))
    return np.asarray(np.abs(angle - around) > JITTER + WIDEST_TURN_BACK * float(np.median(steps)))


def sweeps(angle: Angles) -> list[AngleSweep]:
    """Moves in one direction each, in the order of the rows.

    Arguments: angle [deg], shape (rows,), without jumps of the encoder. Rows of a short move at the beginning or end
    are left out. Raises AngleError: an angle that runs backwards within a move.
    """
    steps = np.abs(np.diff(angle))
    steps = steps[steps > 0]
    if not len(steps):
        raise AngleError(0, "the angle does not change", "check the column of the angle")
    step = float(np.median(steps, overwrite_input=True))
    found = [AngleSweep(a, b, d) for a, b, d in _runs(angle, max(JITTER, min(TURNING_STEPS * step, WIDEST_TURNING)))]
    for index, sweep in enumerate(found[:-1]):
        following = found[index + 1]
        if following.stop - following.start >= FEW_ROWS or index + 2 == len(found):
            continue
        if sweep.stop - sweep.start < FEW_ROWS and index == 0:
            continue
        if not _is_restart(angle, sweep, following, found[index + 2], step):
            row = following.start
            message = f"the angle runs backwards: {angle[row]:.6g} deg after {angle[row - 1]:.6g} deg"
            raise AngleError(row, message, "put the rows in the order of time, which --robust does not, or --wrap 360")
    return [sweep for sweep in found if sweep.stop - sweep.start >= FEW_ROWS]


def _is_restart(angle: Angles, before: AngleSweep, back: AngleSweep, after: AngleSweep, step: float) -> bool:
    """Whether a jump back begins the same move again, and is no slip of a few rows."""
    leap = abs(angle[back.start] - angle[before.stop - 1])
    span = abs(angle[before.stop - 1] - angle[before.start])
    first = abs(angle[after.start] - angle[after.start - 1]) if after.stop > after.start else np.inf
    long = after.stop - after.start >= FEW_ROWS
    return back.stop - back.start == 1 and leap >= span / 2 and first <= SPIKE * step and long


def _runs(angle: Angles, least: float) -> list[tuple[int, int, int]]:
    """Runs (start, stop, direction) between turning points that lie at least so far apart."""
    signs = np.sign(np.diff(angle)).astype(np.int8)
    if (signs >= 0).all() or (signs <= 0).all():
        return [(0, len(angle), 1 if signs.max() > 0 else -1)]
    # only the last rows before the direction changes can be turning points
    moving = np.flatnonzero(signs)
    ends = [0, *(moving[:-1][np.diff(signs[moving]) != 0] + 1).tolist(), len(angle) - 1]
    runs: list[tuple[int, int, int]] = []
    start, extreme, direction = 0, 0, 0
    for row in ends[1:]:
        value = angle[row]
        if direction == 0:
            if abs(value - angle[start]) >= least:
                direction, extreme = (1 if value > angle[start] else -1), row
        elif direction * (value - angle[extreme]) >= 0:
            extreme = row
        elif direction * (angle[extreme] - value) >= least:
            runs.append((start, extreme + 1, direction))
            start, extreme, direction = extreme + 1, row, -direction
    runs.append((start, len(angle), direction or 1))
    return runs
