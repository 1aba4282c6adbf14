"""Where the scatter of F'_ior comes from, and what a tighter tolerance would bring: Sobol indices, weighted drives.

A deviation is one input, its size and its direction together. Source: Saltelli et al. 2010, doi
10.1016/j.cpc.2009.09.018. A quantile under a tighter tolerance is that of the same drives, weighted by how much
likelier each would be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from warnings import catch_warnings, simplefilter

import numpy as np
from scipy.stats import qmc

from hdassist.error.table import DEVIATIONS
from hdassist.model.deviations import deviations_of
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.tolerance.scatter import TAIL, Draws, Scatter

CONFIDENCE = 0.95
RESAMPLES = 200
TIGHTER = 0.8  # times the tolerance
HIGH = 0.95  # of the drives stay below the quantile that is told


@dataclass(frozen=True)
class Design(Draws):
    """Drives of Saltelli's design: base, then as many others, then for each group the base with its inputs exchanged.

    count: drives of the base; groups: names of inputs, and places of their scatters.
    """

    count: int = 256
    groups: tuple[tuple[str, tuple[int, ...]], ...] = ()

    @classmethod
    def of(cls, drive: Drive, draws: Draws, count: int) -> Design:
        """Design of a drive with so many drives in its base."""
        places = {s.path: k for k, s in enumerate(draws.scatters)}
        groups = []
        for each in deviations_of(drive.mounting.mark_kind):
            found = tuple(places[path] for path in (each.size, each.direction) if path in places)
            if found:
                groups.append((each.size, found))
        groups += [(path, (k,)) for path, k in places.items() if not path.startswith(DEVIATIONS)]
        return cls(draws.scatters, draws.seed, "sobol", count, tuple(groups))

    @property
    def total(self) -> int:
        """Drives of the whole design."""
        return self.count * (2 + len(self.groups))

    def shares(self, first: int, last: int) -> Array:
        """Shares in 0..1, shape (drives, scatters), of drives first to last - 1."""
        base, other = np.split(self._both, 2, axis=1)
        found = []
        for block, row in (divmod(k, self.count) for k in range(first, last)):
            shares = (other if block == 1 else base)[row].copy()
            if block > 1:
                exchanged = list(self.groups[block - 2][1])
                shares[exchanged] = other[row, exchanged]
            found.append(shares)
        return np.array(found)

    @cached_property
    def _both(self) -> Array:
        sequence = qmc.Sobol(2 * len(self.scatters), scramble=True, rng=np.random.default_rng(self.seed))
        with catch_warnings():
            simplefilter("ignore")  # that their number is no power of two
            return np.asarray(sequence.random(self.count))


@dataclass(frozen=True, eq=False)
class Indices:
    """Sobol indices of groups at a torque, shape (groups,) each, with 95 % confidence, shape (groups, 2).

    first: share of the variance of F'_ior that goes when the group's inputs are known; total: that is left when all
    others are known.
    """

    first: Array
    first_bounds: Array
    total: Array
    total_bounds: Array


def indices(design: Design, F_ior: Array, seed: int = 0) -> list[Indices]:
    """Sobol indices at each torque, from F'_ior [arcsec] of the design's drives, shape (drives, torques).

    seed: of the resampling that tells how sure they are, rows of the design at a time.
    """
    blocks = np.moveaxis(F_ior.reshape(2 + len(design.groups), design.count, -1), 1, 2)  # design, torques, drives
    first, total = first_and_total(blocks)
    resampled = np.random.default_rng(seed).integers(0, design.count, (RESAMPLES, design.count))
    found = [first_and_total(blocks[..., rows]) for rows in resampled]
    ends = np.quantile(found, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2], axis=0)
    return [Indices(first[t], ends[:, 0, t].T, total[t], ends[:, 1, t].T) for t in range(F_ior.shape[1])]


def first_and_total(blocks: Array) -> tuple[Array, Array]:
    """First and total Sobol index of each group, shape (torques, groups), by Saltelli 2010, table 2 (b) and (f).

    Argument: F'_ior [arcsec] of the base A, of the others B, and of A with each group's inputs from B, shape
    (2 + groups, torques, drives), any number of drives. Where nothing varies the indices are 0.
    """
    base, other, exchanged = blocks[0], blocks[1], blocks[2:]
    mean = blocks[:2].mean(axis=(0, 2))[:, None]
    variance = blocks[:2].var(axis=(0, 2))
    variance = np.where(variance > 0, variance, np.inf)
    first = ((other - mean) * (exchanged - base)).mean(axis=2) / variance
    total = ((base - exchanged) ** 2).mean(axis=2) / (2 * variance)
    return first.T, total.T


@dataclass(frozen=True)
class Tightened:
    """What a tolerance that is TIGHTER brings at a torque: the 95 % quantile [arcsec] now and then, its bounds then.

    effective: how many drives the weighted ones are worth.
    """

    path: str
    now: float
    then: float
    low: float
    high: float
    effective: float


def tightened(design: Design, F_ior: Array, values: dict[str, Array], seed: int = 0) -> list[list[Tightened]]:
    """What tighter tolerances bring, a list for each torque, of what is drawn as rayleigh or uniform.

    Arguments: design; F_ior [arcsec] of the drives of its base and the others, shape (drives, torques); values drawn
    of each field, shape (drives,); seed of the resampling.
    """
    rng = np.random.default_rng(seed)
    resampled = rng.integers(0, len(F_ior), (RESAMPLES, len(F_ior)))
    found = []
    for F in F_ior.T:
        at_torque = []
        now = weighted_quantile(F, np.ones(len(F)), HIGH)
        for scatter in design.scatters:
            if scatter.kind not in ("rayleigh", "uniform"):
                continue
            weight = likelier(scatter, values[scatter.path])
            then = [weighted_quantile(F[rows], weight[rows], HIGH) for rows in resampled]
            low, high = np.quantile(then, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
            effective = float(weight.sum() ** 2 / (weight**2).sum())
            at_torque.append(
                Tightened(scatter.path, now, weighted_quantile(F, weight, HIGH), float(low), float(high), effective)
            )
        found.append(at_torque)
    return found


def likelier(scatter: Scatter, size: Array, factor: float = TIGHTER) -> Array:
    """How many times likelier sizes are under a tolerance that is factor times as great, shape of size."""
    inside = size <= factor * scatter.high
    if scatter.kind == "uniform":
        return np.where(inside, 1 / factor, 0.0)
    standard = size * TAIL / scatter.high
    return np.where(inside, np.exp(standard**2 / 2 * (1 - factor**-2)) / factor**2, 0.0)


def weighted_quantile(values: Array, weights: Array, share: float) -> float:
    """Value that a share of the weight lies at or below."""
    order = np.argsort(values, kind="stable")
    heaped = np.cumsum(weights[order])
    return float(values[order][min(np.searchsorted(heaped, share * heaped[-1]), len(values) - 1)])


def of_bases(design: Design, values: Sequence[dict[str, float]]) -> dict[str, Array]:
    """Values drawn of each field, shape (drives,), in the base and the others."""
    rows = values[: 2 * design.count]
    return {s.path: np.array([row[s.path] for row in rows]) for s in design.scatters}
