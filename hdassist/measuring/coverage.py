"""How much of a drive's full cycle a trace has visited in one direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.measuring.cycle import Gearing

PER_TURN = 36  # cells in a turn of the cam
FULL = 0.95  # share from which the cycle counts as visited


@dataclass(frozen=True)
class Coverage:
    """Cells of cam angle and output angle: as many as there are in the full cycle, and how many were visited.

    In one direction the cam passes each of them once in a cycle. cam_deg, output_deg: size of a cell.
    """

    cells: int
    visited: int
    cam_deg: float
    output_deg: float

    @property
    def share(self) -> float:
        """Share of the cycle that was visited, 0 to 1."""
        return self.visited / self.cells

    @property
    def is_full(self) -> bool:
        """Whether F'_ior of the record is that of the cycle, not a lower bound only."""
        return self.share >= FULL


def coverage(turns: NDArray[np.float64], gearing: Gearing) -> Coverage:
    """Coverage of a drive's full cycle by cam angles [turns] in one direction."""
    total = gearing.cycle * PER_TURN
    visited = len(np.unique(np.mod(np.floor(turns * PER_TURN), total)))
    return Coverage(total, visited, 360 / PER_TURN, 360 / gearing.ratio)
