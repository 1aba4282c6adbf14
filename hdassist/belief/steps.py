"""Which inputs the spread of F'_ior comes from, and what to measure next.

Influence is a weighted stepwise regression of ln F'_ior over the samples. The size and the direction of a deviation are
one group. Groups enter one after the other, the one that explains most first, as long as chance alone would hardly
explain as much; each has the share of the variance that it adds, less that which as many columns of chance would add.
The rest is unexplained: products of inputs, bends that no square follows. A measurement is taken alone: the share of
the variance that its columns explain of all of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from hdassist.belief.evidence import evidence_of
from hdassist.belief.samples import Samples
from hdassist.belief.statistics import effective_number, log_error
from hdassist.model.geometry import Array
from hdassist.preset.fields import DEVIATIONS

_CHANCE_OF_INFLUENCE = 0.05  # of any group at all to enter where none has an influence
# what single teeth do depends on all of these together, not on one: columns of them would be chance
_ONE_OF_MANY = frozenset(each.direction for each in DEVIATIONS if each.kind == "pitch")
_INDEPENDENT = 1e-8  # of a column's length, below which the part of it that is new is rounding


@dataclass(frozen=True)
class Influence:
    """Share of the variance of ln F'_ior that comes from a group of fields, by the path of its first."""

    group: str
    share: float


def influences(samples: Samples, torque: int) -> tuple[Influence, ...]:
    """Shares of the variance of ln F'_ior at a torque, by its place, the largest first.

    The rest to 1 is unexplained. Empty where samples are too few, or F'_ior does not vary.
    """
    return influences_on(samples, log_error(samples.F_ior_arcsec[:, torque]))


def influences_on(samples: Samples, y: Array) -> tuple[Influence, ...]:
    """Shares of the variance of another result of the samples, shape (samples,), the largest first."""
    groups = {name: columns_of(samples, samples.shares, name) for name in _groups_of(samples)}
    return shares_of_variance(groups, y, samples.weights)


def _groups_of(samples: Samples) -> tuple[str, ...]:
    """Groups of the fields of samples, by path, in the order of the preset."""
    return tuple(dict.fromkeys(each.group for each in samples.prior.fields))


def columns_of(samples: Samples, shares: Array, group: str) -> Array:
    """Columns of a regression that a group of fields makes of its shares, shape (samples, columns).

    A number and its square; sine and cosine of a direction that is unknown, times the size where that is not
    known either. None of single teeth whose size is known.
    """
    columns, size = [], np.ones(len(shares))
    for k, each in enumerate(samples.prior.fields):
        if each.group == group and not each.is_any_direction:
            x = 2 * shares[:, k] - 1
            columns += [x, x**2]
            size = shares[:, k] if each.path == group else size
    for k, each in enumerate(samples.prior.fields):
        if each.group == group and each.is_any_direction and each.path not in _ONE_OF_MANY:
            turn = 2 * np.pi * shares[:, k]
            columns += [size * np.cos(turn), size * np.sin(turn)]
    return np.array(columns).reshape(-1, len(shares)).T


def shares_of_variance(groups: Mapping[str, Array], y: Array, weights: Array) -> tuple[Influence, ...]:
    """Shares of the weighted variance of y, shape (samples,), that groups of columns add, the largest first."""
    root = np.sqrt(weights / weights.sum())[:, None]
    basis = root / np.linalg.norm(root)
    rest = _orthogonal_to(basis, root * y[:, None])
    whole, free = float(np.sum(rest**2)), effective_number(weights) - 1
    if whole <= 1e-18:
        return ()
    left = {name: root * columns for name, columns in groups.items()}
    found: list[Influence] = []
    while left:
        candidates = {name: _explained_by(columns, basis, rest, free) for name, columns in left.items()}
        best = min((chance, -gain, name) for name, (_, gain, chance) in candidates.items())[2]
        directions, gain, chance = candidates[best]
        if chance > _CHANCE_OF_INFLUENCE / len(groups):
            break
        found.append(Influence(best, gain / whole))
        basis = np.hstack([basis, directions])
        rest = _orthogonal_to(basis, rest)
        free -= directions.shape[1]
        del left[best]
    return tuple(sorted(found, key=lambda each: -each.share))


def _explained_by(columns: Array, basis: Array, rest: Array, free: float) -> tuple[Array, float, float]:
    """New directions of columns beside a basis, shares explained of the squares of a rest, and probability by chance.

    The share is less that of as many columns of chance; the probability is that of chance alone explaining
    as much (F test). Argument: free, degrees of freedom of the rest.
    """
    u, size, _ = np.linalg.svd(_orthogonal_to(basis, columns), full_matrices=False)
    directions = u[:, size > _INDEPENDENT * np.linalg.norm(columns)]
    count, remaining = directions.shape[1], float(np.sum(rest**2))
    if count == 0 or free - count < 1:
        return directions, 0.0, 1.0
    gain = float(np.sum((directions.T @ rest) ** 2))
    left = max((remaining - gain) / (free - count), 1e-30)
    return directions, gain - count * left, float(fdtrc(count, free - count, gain / count / left))


def _orthogonal_to(basis: Array, columns: Array) -> Array:
    """The part of columns that is orthogonal to a basis."""
    return columns - basis @ (basis.T @ columns)


@dataclass(frozen=True)
class MeasurementGain:
    """A measurement, by the path of a field or as `stiffness.K_1`, and the share of the spread that it takes off."""

    measured: str
    gain: float


def measurements(samples: Samples, torque: int) -> tuple[MeasurementGain, ...]:
    """Measurements by the share of the spread of ln F'_ior at a torque, by its place, that each takes off, best first.

    Each is taken as the only one, and as exact: a group of fields, or a stiffness that was not measured yet.
    """
    columns = {name: columns_of(samples, samples.shares, name) for name in _groups_of(samples)}
    known = {each.figure for each in evidence_of(samples.prior.drive) if each.path.startswith("measured.")}
    for name in [each for each in samples.figures if each not in known]:
        x = log_error(samples.figures[name])
        columns[f"stiffness.{name}"] = np.stack([x, x**2], axis=1)
    y = log_error(samples.F_ior_arcsec[:, torque])
    found = {name: shares_of_variance({name: some}, y, samples.weights) for name, some in columns.items()}
    gains = [MeasurementGain(name, 1 - float(np.sqrt(1 - each[0].share))) for name, each in found.items() if each]
    return tuple(sorted(gains, key=lambda each: -each.gain))
