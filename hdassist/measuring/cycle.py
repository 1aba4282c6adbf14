"""Ratio and full cycle of a measured drive, and the share of the cycle that a trace has visited."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdassist.errors import UsageError
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.preset.fields import Drive

LEAST_RATIO, GREATEST_RATIO = 10.0, 1000.0
RATIO_ROUNDING = 1e-9
CELLS_PER_TURN = 36  # of the cam
FULL_SHARE = 0.95  # share from which the cycle counts as visited


@dataclass(frozen=True)
class Gearing:
    """Cam turns per output turn (without sign), and cam turns of the full cycle."""

    ratio: float
    cycle: int

    @property
    def cycle_output(self) -> int:
        """Output turns of the full cycle: 1, or 2 where the flexspline has an odd number of teeth."""
        return round(self.cycle / self.ratio)


@dataclass(frozen=True)
class Coverage:
    """Cells of cam angle and output angle: as many as there are in the full cycle, and how many were visited.

    In one direction the cam passes each of them once in a cycle. A cell is visited that has a reading, or lies between
    two that are near enough to follow the highest order. cam_deg, output_deg: size of a cell; step_deg: median step of
    the cam from reading to reading.
    """

    cells: int
    visited: int
    cam_deg: float
    output_deg: float
    step_deg: float

    @property
    def cam_turns(self) -> float:
        """Turns of the cam that were visited, each place of the cycle once."""
        return self.visited * self.cam_deg / 360

    @property
    def share(self) -> float:
        """Share of the cycle that was visited, 0 to 1."""
        return self.visited / self.cells

    @property
    def is_full(self) -> bool:
        """Whether F'_ior of the record is that of the cycle, not a lower bound only."""
        return self.share >= FULL_SHARE


def gearing_of(drive: Drive | None, ratio: float | None) -> Gearing | None:
    """Gearing of a drive, or of a drive with two waves by its ratio; None where neither is known.

    Raises UsageError: both are given, or no ratio that a drive with two waves can have.
    """
    if drive is not None:
        if ratio is not None:
            raise UsageError("invalid --ratio: expected none with --drive, which has the ratio", "leave out --ratio")
        kinematics = Kinematics.of(drive)
        return Gearing(abs(kinematics.u), kinematics.cycle_cam_revolutions)
    if ratio is None:
        return None
    ratio = abs(ratio)
    doubled = round(2 * ratio) if ratio <= GREATEST_RATIO else 0
    if not LEAST_RATIO <= ratio <= GREATEST_RATIO or abs(2 * ratio - doubled) > RATIO_ROUNDING:
        hint = "half the number of teeth of the wheel that turns, such as 100 or 99.5"
        span = f"from {LEAST_RATIO:g} to {GREATEST_RATIO:g}"
        raise UsageError(f"invalid --ratio {ratio:g}: expected a multiple of 0.5 {span}", hint)
    return Gearing(ratio, doubled // 2 if doubled % 2 == 0 else doubled)


def coverage(turns: Array, readings: Array, gearing: Gearing) -> Coverage:
    """Coverage of a drive's full cycle in one direction.

    Arguments: turns, cam angles that lie between neighbouring readings; readings, cam angles as they were read; both in
    turns.
    """
    total = gearing.cycle * CELLS_PER_TURN
    cells = np.mod(np.floor(np.concatenate([turns, readings]) * CELLS_PER_TURN + RATIO_ROUNDING), total)
    step = 360 * float(np.median(np.abs(np.diff(readings))))
    return Coverage(total, len(np.unique(cells)), 360 / CELLS_PER_TURN, 360 / gearing.ratio, step)
