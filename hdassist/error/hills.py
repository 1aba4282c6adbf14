"""Places of estimated maps of the error that may be its extremes, and a way over a grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.model.geometry import Array

Indices = NDArray[np.int64]

LEAST_F_IOR = 4.0  # arcsec: F'_ior of which shares are taken, at least


@dataclass(frozen=True)
class Hills:
    """Points that may be an extreme: row of the drive, sign of the extreme, point, shape (hills, 2), height [arcsec].

    Height is that of the error upside down where the sign is negative.
    """

    row: Indices
    sign: Indices
    point: Indices
    height: Array

    def __len__(self) -> int:
        return len(self.row)

    def __getitem__(self, chosen: NDArray[np.bool_]) -> Hills:
        return Hills(self.row[chosen], self.sign[chosen], self.point[chosen], self.height[chosen])

    def and_these(self, others: Hills) -> Hills:
        """These and others."""
        return Hills(*(np.concatenate(both) for both in zip(vars(self).values(), vars(others).values(), strict=True)))

    @property
    def tops(self) -> Array:
        """Greatest height of each drive as it is, and of it upside down [arcsec], shape (drives, 2)."""
        best = np.full((self.row.max(initial=0) + 1, 2), -np.inf)
        np.maximum.at(best, (self.row, self.sign // 2), self.height)  # column 0, or -1 upside down
        return best

    def near_top(self, share: float) -> Hills:
        """Those that are no more than a share of F'_ior below the highest one of their drive and sign."""
        tops = self.tops
        F_ior = np.maximum(tops.sum(axis=1), LEAST_F_IOR)
        return self[tops[self.row, self.sign // 2] - self.height <= share * F_ior[self.row]]


def hills_of(maps: Array, to_points: Callable[[Array], Indices], lower: Array | None = None) -> Hills:
    """Points of maps of the torus, shape (drives, k, l), with no higher one beside them, and of the map upside down.

    Between the points of a map they lie where a parabola through their neighbours has its top. Arguments: to_points,
    from places in a map, shape (hills, 2), to points at which there is a state; lower, maps that are turned upside down
    in place of these.
    """
    up = np.concatenate([maps, -(maps if lower is None else lower)])
    highest = up
    for axis in (1, 2):
        beside = np.maximum(np.roll(highest, 1, axis), np.roll(highest, -1, axis))
        highest = np.maximum(highest, beside)
    side, *at = np.nonzero(up >= highest)
    steps, k, l = np.arange(-1, 2), *(each[:, None] for each in at)
    patch = up[side[:, None, None], ((k + steps) % up.shape[1])[:, :, None], ((l + steps) % up.shape[2])[:, None]]
    height, place = patch[:, 1, 1].copy(), np.stack(at, axis=1).astype(float)
    for axis, (before, here, behind) in enumerate((patch[:, :, 1].T, patch[:, 1, :].T)):
        bend = np.minimum(before + behind - 2 * here, -1e-12)
        shift = np.clip((before - behind) / (2 * bend), -0.5, 0.5)
        place[:, axis] += shift
        height -= bend * shift**2 / 2
    upside_down, row = np.divmod(side, len(maps))
    return Hills(row, 1 - 2 * upside_down, to_points(place), height)


def there_and_back(shape: tuple[int, ...]) -> Indices:
    """Flat places of a grid in an order in which each is next to the one before."""
    index = np.indices(shape).reshape(len(shape), -1)
    path = index.copy()
    for axis in range(1, len(shape)):
        back = path[:axis].sum(axis=0) % 2 == 1
        path[axis] = np.where(back, shape[axis] - 1 - index[axis], index[axis])
    return np.asarray(np.ravel_multi_index(tuple(path), shape))


def interpolated(maps: Array, shape: tuple[int, ...]) -> Array:
    """Maps of the torus, shape (n, k, l), between their points too by their Fourier series, shape (n, *shape)."""
    for axis, (points, more) in enumerate(zip(maps.shape[1:], shape, strict=True), 1):
        if more > points:
            waves = np.take(np.fft.rfft(maps, axis=axis), range((points + 1) // 2), axis=axis)
            maps = np.fft.irfft(waves, more, axis=axis) * (more / points)
    return maps
