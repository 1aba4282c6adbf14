"""What a lot says as a whole: the share that passed with its interval, and how its values spread."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np

Z = 1.959963984540054  # standard normal: 95 % within
QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)


def wilson(passed: int, of: int) -> tuple[float, float]:
    """The 95 % interval of a share, after Wilson (1927); 0 to 1 where nothing was counted."""
    if not of:
        return 0.0, 1.0
    share, weight = passed / of, Z**2 / of
    centre = (share + weight / 2) / (1 + weight)
    half = Z / (1 + weight) * sqrt(share * (1 - share) / of + weight / (4 * of))
    return max(centre - half, 0.0), min(centre + half, 1.0)


def quantiles(values: Sequence[float]) -> list[float]:
    """Least, 5 %, 50 %, 95 % and greatest of some values, straight between neighbours."""
    return [float(value) for value in np.quantile(np.asarray(values, dtype=float), QUANTILES)]
