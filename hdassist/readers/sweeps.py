"""Moves of a shaft in one direction each, out of the angles that an encoder has recorded; wrapped angles joined."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

WHOLE_TURN_DEG = 360.0
COUNTER_BITS = (16, 24, 32)  # of counters that begin again where they are full
WRAP_STEPS, LEAST_WRAP_REST = 20.0, 1.0  # median steps, and deg, that a step over a wrap may go, at most
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

    def __len__(self) -> int:
        return self.stop - self.start

    @property
    def rows(self) -> slice:
        """Its rows."""
        return slice(self.start, self.stop)


class AngleError(ValueError):
    """An impossible angle: its row, a message and a hint."""

    def __init__(self, row: int, message: str, hint: str) -> None:
        super().__init__(message)
        self.row, self.message, self.hint = row, message, hint


def guessed_wrap(angle: Angles, count: float) -> float | None:
    """Angle [deg] after which an encoder begins again: a turn, or the range of its counter; None if it does not.

    All angles lie within it, with steps of more than half of it, over which the shaft goes on as far as over others: a
    run that begins anew is none. Argument: count, size of a count [deg].
    """
    steps = np.abs(np.diff(angle))
    span, longest = float(np.ptp(angle)), float(steps.max(initial=0.0))
    wraps = (WHOLE_TURN_DEG, *(2**bits * count for bits in COUNTER_BITS))
    for wrap in wraps:
        if span <= wrap < 2 * longest:
            over = np.abs(wrap - steps[2 * steps > wrap])  # steps over the wrap
            usual = float(np.median(steps[2 * steps <= wrap])) if (2 * steps <= wrap).any() else wrap
            return wrap if float(np.median(over)) <= max(WRAP_STEPS * usual, LEAST_WRAP_REST) else None
    return None


def unwrapped(angle: Angles, wrap: float, other: Angles | None = None) -> Angles:
    """Angles without the jumps of an encoder that begins again after wrap, shape (rows,), in the same unit.

    other: the same angle by another encoder, without jumps and in either sense, which says how far a long step went.
    Raises AngleError: a step that may have gone either way round.
    """
    expected = [np.zeros(len(angle))] if other is None else [other, -other]
    way, off = min(
        ((each, np.unwrap(angle - each, period=wrap)) for each in expected),
        key=lambda pair: float(np.abs(np.diff(pair[1])).sum()),
    )
    joined = way + off
    far = np.flatnonzero(np.abs(np.diff(off)) > LEAP * wrap)
    if len(far):
        step = abs(np.diff(joined)[far[0]])
        raise AngleError(int(far[0]) + 1, f"a step of {step:.4g} of a wrap of {wrap:g}", "record shorter steps")
    return joined


def leaping(angle: Angles) -> NDArray[np.bool_]:
    """Rows, shape (rows,), whose angle [deg] lies off the median of the five around it, as it never does on its way."""
    padded = np.pad(angle, 2, mode="reflect", reflect_type="odd")
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1)
    steps = np.abs(np.diff(around))
    return np.abs(angle - around) > JITTER + WIDEST_TURN_BACK * float(np.median(steps))


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
    moves = _moves(angle, max(JITTER, min(TURNING_STEPS * step, WIDEST_TURNING)))
    for before, back, after in zip(moves, moves[1:], moves[2:], strict=False):
        if len(back) >= FEW_ROWS or (before is moves[0] and len(before) < FEW_ROWS):
            continue
        row, last = back.start, before.stop - 1
        is_leap = len(back) == 1 and abs(angle[row] - angle[last]) >= abs(angle[last] - angle[before.start]) / 2
        follows = len(after) >= FEW_ROWS and abs(angle[after.start] - angle[after.start - 1]) <= SPIKE * step
        if not (is_leap and follows):  # no restart of the same move
            message = f"the angle runs backwards: {angle[row]:.6g} deg after {angle[last]:.6g} deg"
            raise AngleError(row, message, "put the rows in the order of time, which --robust does not, or --wrap 360")
    return [move for move in moves if len(move) >= FEW_ROWS]


def _moves(angle: Angles, least: float) -> list[AngleSweep]:
    """Moves between turning points that lie at least so far apart [deg]."""
    signs = np.sign(np.diff(angle)).astype(np.int8)
    moving = np.flatnonzero(signs)
    # only the last rows before the direction changes can be turning points
    ends = [*(moving[:-1][np.diff(signs[moving]) != 0] + 1).tolist(), len(angle) - 1]
    moves: list[AngleSweep] = []
    start, extreme, direction = 0, 0, 0
    for row in ends:
        gap = float(angle[row] - angle[extreme])
        if direction and direction * gap >= 0:
            extreme = row
        elif abs(gap) >= least:
            if direction:
                moves.append(AngleSweep(start, extreme + 1, direction))
                start = extreme + 1
            extreme, direction = row, 1 if gap > 0 else -1
    return [*moves, AngleSweep(start, len(angle), direction or (1 if angle[-1] > angle[0] else -1))]
