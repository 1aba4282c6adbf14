"""Orders to which a measured trace is limited: those that are declared, and around each the beats with the output.

Deviations of the wheel that turns with the output beat with those that stand still, so around each order n the error
has lines n + k/ratio. BEATS of them to either side hold a model's error over the full cycle to about 1 % of its range.
A record of T cam turns tells lines apart that lie 1/T apart: of closer ones, fewer stand for all.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import UsageError

DEFAULT = "1-12"
BEATS = 6
RATIO = 100.0  # assumed for the width of the beats where none is known
HIGHEST = 200.0
FEWEST = 4.0  # turns: from here on one line to either side stands for beats that change the error slowly
WHOLE = 0.97  # of an output turn: a record that has its beats

Array = NDArray[np.float64]


def parse_orders(text: str) -> tuple[float, ...]:
    """Declared orders per cam turn, rising, from a text like "1-12" or "1,2,4".

    Raises UsageError: no such text, or orders beyond 0 to 200.
    """
    found: set[float] = set()
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(?:-\s*(\d+)\s*)?", part)
        if match is None:
            raise UsageError(f"no orders: {text}", 'write them like "1-12" or "1,2,4"')
        first, last = float(match[1]), float(match[2] or match[1])
        if not 0 < first <= last <= HIGHEST or (match[2] and not first.is_integer()):
            raise UsageError(f"orders must rise, above 0 and up to {HIGHEST:g}: {text}")
        found.update(np.arange(first, last + 0.5).tolist() if match[2] else [first])
    return tuple(sorted(found))


def lines(declared: Sequence[float], turns: float, ratio: float | None, *, beats: bool = True) -> Array:
    """Orders per cam turn to fit, rising, shape (lines,).

    Arguments: declared orders; turns of the cam that the record spans; ratio, None where it is not known; beats,
    whether to put them around the declared orders, as far as the record tells them apart.
    """
    base = 1 / (ratio or RATIO)
    width = BEATS * base
    step = base if turns * base >= WHOLE else 1 / turns
    count = max(int(width / step + 1e-9), int(turns >= FEWEST)) if beats else 0
    around = np.arange(-count, count + 1) * step
    every = np.concatenate([around[around > 0], *(order + around for order in declared)])
    every = np.sort(every[every > 0])
    keep = np.concatenate([[True], np.diff(every) > step / 2])
    return np.asarray(every[keep])
