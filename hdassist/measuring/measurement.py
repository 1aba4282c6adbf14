"""What is known of a measured trace: F'_ior, orders and coverage in each direction."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import numpy as np
from numpy.typing import NDArray

from hdassist.measuring.bins import Cells
from hdassist.measuring.coverage import Coverage
from hdassist.measuring.cycle import Gearing
from hdassist.measuring.fit import TraceFit
from hdassist.measuring.orders import MeasuredOrder
from hdassist.measuring.range import Range
from hdassist.measuring.uncertainty import COVERAGE_FACTOR, OWN, Source, combined
from hdassist.readers.trace import MeasuredTrace

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Direction:
    """What a trace says of one direction: 1 for growing cam angles, -1 for falling ones.

    fit: see there; range: over the visited angles, shape of grid_turns; revolution: the greatest within one turn of
    the cam; raw_range_arcsec: of the readings themselves,
    drift taken off where asked; coverage: None where the ratio is not known.
    """

    direction: int
    cells: Cells
    fit: TraceFit
    grid_turns: Array
    range: Range
    revolution: Range
    raw_range_arcsec: float
    orders: tuple[MeasuredOrder, ...]
    coverage: Coverage | None
    sources: tuple[Source, ...]

    @property
    def uncertainty_arcsec(self) -> float:
        """Combined standard uncertainty of F'_ior."""
        return combined(self.sources)

    @property
    def revolution_uncertainty_arcsec(self) -> float:
        """Combined standard uncertainty of the range within one cam turn: its own noise, the other sources alike."""
        return hypot(self.revolution.spread, self.revolution.bias_uncertainty, combined(self.sources[OWN:]))

    @property
    def interval_arcsec(self) -> tuple[float, float]:
        """F'_ior with its expanded uncertainty, k = 2, to either side."""
        reach = COVERAGE_FACTOR * self.uncertainty_arcsec
        return max(0.0, self.range.value - reach), self.range.value + reach

    @property
    def is_bound(self) -> bool:
        """Whether F'_ior of the full cycle may be greater, because not all of it was visited."""
        return self.coverage is None or not self.coverage.is_full


@dataclass(frozen=True)
class Reversal:
    """Error in growing minus error in falling direction at the same angles [arcsec]: mean, and greatest departure."""

    mean_arcsec: float
    greatest_arcsec: float


@dataclass(frozen=True, eq=False)
class Measurement:
    """A measured trace looked at: the directions, the one with the greatest F'_ior first; seed of the bootstrap."""

    trace: MeasuredTrace
    gearing: Gearing | None
    directions: tuple[Direction, ...]
    reversal: Reversal | None
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    seed: int

    @property
    def F_ior_arcsec(self) -> float:
        """F'_ior: the greater one of both directions."""
        return self.directions[0].range.value
