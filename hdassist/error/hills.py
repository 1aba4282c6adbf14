"""Places of estimated maps of the error that may be its extremes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.model.geometry import Array

Indices = NDArray[np.int64]

HILL_BLOCK = 4  # points of a map, of each wheel, of which the highest one is a hill
HILLS = 40  # of a drive that are looked at, at most


@dataclass(frozen=True)
class Hills:
    """Points that may be an extreme: row of the drive, sign of the extreme, point, shape (hills, 2), height [arcsec].

    rank: among those of its drive and sign.
    """

    row: Indices
    sign: Indices
    point: Indices
    height: Array
    rank: Indices

    def __getitem__(self, chosen: NDArray[np.bool_]) -> Hills:
        return Hills(self.row[chosen], self.sign[chosen], self.point[chosen], self.height[chosen], self.rank[chosen])

    def highest(self, value: Array, drives: int) -> Array:
        """Greatest of the values of each drive and sign, for each hill, shape (hills,)."""
        best = np.full((drives, 2), -np.inf)
        side = (self.sign > 0).astype(int)
        np.fmax.at(best, (self.row, side), value)
        return np.asarray(best[self.row, side])

    @property
    def ranges(self) -> Array:
        """Highest less lowest of each drive [arcsec]: the first hill of each sign, one of them upside down."""
        return np.asarray(np.bincount(self.row, np.where(self.rank, 0, self.height)), dtype=float)


def hills_of(maps: Array, to_points: Callable[[Array], Indices]) -> Hills:
    """The highest point of each block of maps, shape (drives, k, l), and of what is upside down.

    Between the points of a map they lie where a parabola through their neighbours has its top. Argument: to_points,
    from places in a map, shape (hills, 2), to points at which there is a state.
    """
    n, _, columns = maps.shape
    across = columns // HILL_BLOCK
    found = []
    for sign in (1, -1):
        up = sign * maps
        tiles = up.reshape(n, -1, HILL_BLOCK, across, HILL_BLOCK).swapaxes(2, 3).reshape(n, -1, HILL_BLOCK**2)
        row, tile = (axis.ravel() for axis in np.indices(tiles.shape[:2]))
        inside = np.divmod(tiles.argmax(axis=2).ravel(), HILL_BLOCK)
        at = np.stack(np.divmod(tile, across)) * HILL_BLOCK + np.stack(inside)
        here = up[row, at[0], at[1]]
        height, top = here.copy(), at.astype(float)
        for axis in (0, 1):
            before, behind = (np.roll(up, way, 1 + axis)[row, at[0], at[1]] for way in (1, -1))
            bend = np.minimum(before + behind - 2 * here, -1e-12)
            shift = np.clip((before - behind) / (2 * bend), -0.5, 0.5)
            top[axis] += shift
            height -= bend * shift**2 / 2
        order = np.lexsort((-height, row))
        rank = np.arange(len(order)) % tiles.shape[1]
        order, rank = order[rank < HILLS], rank[rank < HILLS]
        found.append((row[order], np.full(len(order), sign), to_points(top.T[order]), height[order], rank))
    return Hills(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def interpolated(maps: Array, shape: tuple[int, ...]) -> Array:
    """Maps of the torus, shape (n, k, l), between their points too by their Fourier series, shape (n, *shape)."""
    for axis, (points, more) in enumerate(zip(maps.shape[1:], shape, strict=True), 1):
        if more > points:
            waves = np.take(np.fft.rfft(maps, axis=axis), range((points + 1) // 2), axis=axis)
            maps = np.fft.irfft(waves, more, axis=axis) * (more / points)
    return maps
