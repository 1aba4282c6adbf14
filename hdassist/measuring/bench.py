"""What makers and buyers state of a drive beside F'_ior: from approached positions, and from torque loops.

Positions: every deviation is that of its position and side, and scatter of the approach, alike everywhere. Statistics
of drawn approaches say how uncertain those of the measured ones are, and by how much scatter widens a range.
Loops: the twist at a torque is that of a parabola through the readings around it, on each branch.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import DataError
from hdassist.measuring.range import BIAS_SHARE
from hdassist.model.geometry import Array
from hdassist.readers.bench import LoopRecord, PositionRecord
from hdassist.readers.sweeps import WHOLE_TURN_DEG, sweeps

LOOP_SHARE = 0.04  # of the rated torque, to each side: between them lies the lost motion
AROUND = 5  # readings, at least, through which a parabola is laid
SAME_TARGET = 0.5  # arcsec: targets nearer than that are one


@dataclass(frozen=True)
class StatedQuantity:
    """A quantity that makers state: name of its limit in acceptance, value and standard uncertainty [arcsec].

    uncertainty_arcsec: None where nothing was repeated. of: the readings that it is of, in words.
    """

    name: str
    arcsec: float
    uncertainty_arcsec: float | None
    of: str


@dataclass(frozen=True)
class PlaceLoop:
    """Loops at one place: its number, hysteresis loss and lost motion [arcsec], each with its standard uncertainty."""

    place: float
    hysteresis: tuple[float, float]
    lost_motion: tuple[float, float]


def position_quantities(record: PositionRecord, *, seed: int = 0, draws: int = 2000) -> tuple[StatedQuantity, ...]:
    """Positioning one way, repeatability, and repeatability from both sides of positions, as far as they were measured.

    Raises DataError: fewer than two positions.
    """
    keys = np.column_stack([np.rint(record.target_arcsec / SAME_TARGET), record.side])
    groups, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.reshape(-1)
    targets, target = np.unique(groups[:, 0], return_inverse=True)
    if len(targets) < 2:
        raise DataError(f"{record.table.file}: one position", "approach two and more positions, 12 or better 211")
    count = np.bincount(group)
    means = np.bincount(group, record.deviation_arcsec) / count
    left = record.deviation_arcsec - means[group]
    freedom = len(group) - len(groups)
    measured = dict(_position_figures(record.deviation_arcsec[None], group, target, groups[:, 1]))
    spread: dict[str, tuple[float, float]] = {}
    if freedom:
        rng = np.random.default_rng(seed)
        sigma = sqrt(left @ left / freedom) * np.sqrt(freedom / rng.chisquare(freedom, (draws, 1)))
        drawn = means[group] + sigma * rng.standard_normal((draws, len(group)))
        spread = {
            name: (float(values.mean()), float(values.std()))
            for name, values in _position_figures(drawn, group, target, groups[:, 1])
        }
    often = f"{count.min()} to {count.max()}" if np.ptp(count) else f"{count.min()}"
    words = f"{len(targets)} positions, each approached {often} times"
    found = []
    for name, (value,) in measured.items():
        bias = max(0.0, spread[name][0] - float(value)) if spread and name == "positioning" else 0.0
        unsure = hypot(spread[name][1], BIAS_SHARE * bias) if spread else None
        found.append(StatedQuantity(name, max(0.0, float(value) - bias), unsure, words))
    return tuple(found)


def _position_figures(
    values: Array, group: NDArray[np.int64], target: NDArray[np.int64], side: Array
) -> Iterator[tuple[str, Array]]:
    """Quantities of sets of deviations, shape (sets, rows), by name, each of shape (sets,).

    Arguments: group of each row; target and side of each group.
    """
    own = [values[:, group == k] for k in range(len(side))]
    means = np.column_stack([each.mean(axis=1) for each in own])
    high, low = (np.column_stack([extreme(each, axis=1) for each in own]) for extreme in (np.max, np.min))
    ways = [np.ptp(means[:, side == way], axis=1) for way in np.unique(side) if (side == way).sum() > 1]
    if ways:
        yield "positioning", np.max(ways, axis=0)
    if any(each.shape[1] > 1 for each in own):
        yield "repeatability", (high - low).max(axis=1) / 2
    both = [target == k for k in range(target.max() + 1) if len(np.unique(side[target == k])) > 1]
    if both:
        spreads = [high[:, one].max(axis=1) - low[:, one].min(axis=1) for one in both]
        yield "bidirectional", np.max(spreads, axis=0) / 2


def place_loops(record: LoopRecord, rated: float) -> tuple[PlaceLoop, ...]:
    """Hysteresis loss and lost motion of loops at each place; rated torque [N*m].

    Raises DataError: a loop that does not go beyond the torques of the lost motion on a rising and a falling
    branch, or has too few readings there.
    """
    at = LOOP_SHARE * rated * np.array([-1.0, 0.0, 1.0])
    loops = []
    for place in np.unique(record.place):
        torque, twist = (each[record.place == place] for each in (record.torque_Nm, record.twist_arcsec))
        whole = float(np.ptp(torque)) or 1.0
        branches = sweeps(torque * (WHOLE_TURN_DEG / whole))
        sides = []
        for way in (1, -1):
            parts = [slice(b.start, b.stop) for b in branches if b.direction == way and b.stop - b.start >= AROUND]
            parts = [part for part in parts if torque[part].min() <= at[0] and torque[part].max() >= at[-1]]
            sides.append(
                np.array([[_twist_at(torque[part], twist[part], each, at[-1]) for each in at] for part in parts])
            )
        if not all(len(side) for side in sides):
            words = f"no {'falling' if len(sides[0]) else 'rising'} branch from {at[0]:.3g} to {at[2]:.3g} N*m"
            hint = f"go from -T_0 to T_0 and back, T_0 the rated torque, with {AROUND} readings a branch and more"
            raise DataError(f"{record.table.file}: place {place:g}: {words}", hint)
        # shape (2 sides, 3 torques): means over branches, and their variance
        mean = np.array([side[..., 0].mean(axis=0) for side in sides])
        again = [side[..., 0].var(axis=0, ddof=1) if len(side) > 1 else np.zeros(3) for side in sides]
        variance = np.array(
            [np.maximum(side[..., 1].mean(axis=0), own) / len(side) for side, own in zip(sides, again, strict=True)]
        )
        middle = mean.mean(axis=0)
        hysteresis = abs(float(mean[0, 1] - mean[1, 1])), sqrt(float(variance[:, 1].sum()))
        lost = abs(float(middle[2] - middle[0])), sqrt(float(variance[:, [0, 2]].sum())) / 2
        loops.append(PlaceLoop(float(place), hysteresis, lost))
    return tuple(loops)


def loop_quantities(loops: tuple[PlaceLoop, ...]) -> tuple[StatedQuantity, ...]:
    """The greatest hysteresis loss and lost motion over places."""
    words = f"the greatest of {len(loops)} places" if len(loops) > 1 else "one place"
    greatest = {
        "hysteresis_loss": max(loop.hysteresis for loop in loops),
        "lost_motion": max(loop.lost_motion for loop in loops),
    }
    return tuple(StatedQuantity(name, value, unsure, words) for name, (value, unsure) in greatest.items())


def _twist_at(torque: Array, twist: Array, at: float, within: float) -> tuple[float, float]:
    """Twist [arcsec] at a torque [N*m] by a parabola through the readings around it, and the variance of that."""
    off = torque - at
    near = np.abs(off) <= max(within, float(np.partition(np.abs(off), AROUND - 1)[AROUND - 1]))
    columns = np.vander(off[near], 3, increasing=True)
    inverse = np.linalg.pinv(columns.T @ columns)
    solution = inverse @ columns.T @ twist[near]
    left = twist[near] - columns @ solution
    return float(solution[0]), float(left @ left / (len(left) - 3) * inverse[0, 0])
