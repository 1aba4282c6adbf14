"""Which inputs the spread of F'_ior comes from, and what to measure next, from the samples alone.

Influence is a weighted stepwise regression of ln F'_ior over the samples. The size and the direction of a deviation are
one group. Groups enter one after the other, the one that explains most first, as long as chance alone would hardly
explain as much; each has the share of the variance that it adds, less that which as many columns of chance would add.
The rest is unexplained: products of inputs, bends that no square follows.

Of the next measurement each sample in turn is taken for the drive that is measured. Given the measurement, ln F'_ior is
that of a regression over the samples, with the residuals of that regression; the verdict goes to the likelier side of
the limit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from hdassist.belief.evidence import evidence_of
from hdassist.belief.samples import Samples
from hdassist.belief.statistics import effective_number, log_error
from hdassist.model.geometry import Array

CHANCE_OF_INFLUENCE = 0.05  # of any group at all to enter where none has an influence
INDEPENDENT = 1e-8  # of a column's length, below which the part of it that is new is rounding


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
    groups = {name: columns_of(samples, samples.shares, name) for name in groups_of(samples)}
    return shares_of_variance(groups, y, samples.weights)


def groups_of(samples: Samples) -> tuple[str, ...]:
    """Groups of the fields of samples, by path, in the order of the preset."""
    return tuple(dict.fromkeys(each.group for each in samples.prior.fields))


def columns_of(samples: Samples, shares: Array, group: str) -> Array:
    """Columns of a regression that a group of fields makes of its shares, shape (samples, columns).

    A number and its square; sine and cosine of a direction that is unknown, times the size where that is not
    known either.
    """
    columns, size = [], np.ones(len(shares))
    for k, each in enumerate(samples.prior.fields):
        if each.group == group and not each.is_any_direction:
            x = 2 * shares[:, k] - 1
            columns += [x, x**2]
            size = shares[:, k] if each.path == group else size
    for k, each in enumerate(samples.prior.fields):
        if each.group == group and each.is_any_direction:
            turn = 2 * np.pi * shares[:, k]
            columns += [size * np.cos(turn), size * np.sin(turn)]
    return np.stack(columns, axis=1)


def shares_of_variance(groups: Mapping[str, Array], y: Array, weights: Array) -> tuple[Influence, ...]:
    """Shares of the weighted variance of y, shape (samples,), that groups of columns add, the largest first."""
    root = np.sqrt(weights / weights.sum())[:, None]
    basis = root / np.linalg.norm(root)
    rest = orthogonal_to(basis, root * y[:, None])
    whole, free = float(np.sum(rest**2)), effective_number(weights) - 1
    if whole <= 1e-18:
        return ()
    left = {name: root * columns for name, columns in groups.items()}
    found: list[Influence] = []
    while left:
        candidates = {name: explained_by(columns, basis, rest, free) for name, columns in left.items()}
        best = min((chance, -gain, name) for name, (_, gain, chance) in candidates.items())[2]
        directions, gain, chance = candidates[best]
        if chance > CHANCE_OF_INFLUENCE / len(groups):
            break
        found.append(Influence(best, gain / whole))
        basis = np.hstack([basis, directions])
        rest = orthogonal_to(basis, rest)
        free -= directions.shape[1]
        del left[best]
    return tuple(sorted(found, key=lambda each: -each.share))


def explained_by(columns: Array, basis: Array, rest: Array, free: float) -> tuple[Array, float, float]:
    """New directions of columns beside a basis, shares explained of the squares of a rest, and probability by chance.

    The share is less that of as many columns of chance; the probability is that of chance alone explaining
    as much (F test). Argument: free, degrees of freedom of the rest.
    """
    u, size, _ = np.linalg.svd(orthogonal_to(basis, columns), full_matrices=False)
    directions = u[:, size > INDEPENDENT * np.linalg.norm(columns)]
    count, remaining = directions.shape[1], float(np.sum(rest**2))
    if count == 0 or free - count < 1:
        return directions, 0.0, 1.0
    gain = float(np.sum((directions.T @ rest) ** 2))
    left = max((remaining - gain) / (free - count), 1e-30)
    return directions, gain - count * left, float(fdtrc(count, free - count, gain / count / left))


def orthogonal_to(basis: Array, columns: Array) -> Array:
    """The part of columns that is orthogonal to a basis."""
    return columns - basis @ (basis.T @ columns)


MEASURING_ERROR = 0.05  # standard one: of a field as a share of its probability, of a figure or F'_ior relative
LEAST_NAMED_GAIN = 0.005  # a smaller one is not named


@dataclass(frozen=True)
class MeasurementGain:
    """A measurement and its expected gain.

    measured: path of a field, `stiffness.K_1`, `F_ior@TORQUE`, or `F_ior@TORQUE+ROTATION`, F'_ior now and turned by so
    many degrees. gain: of the probability of a right verdict; without a limit, the share of the spread that goes.
    """

    measured: str
    gain: float


def measurements(samples: Samples, torque: int, limit_arcsec: float | None = None) -> tuple[MeasurementGain, ...]:
    """Measurements by their expected gain at a torque, by its place, the best first.

    Argument: limit_arcsec that F'_ior is held against, if any.
    """
    limit = None if limit_arcsec is None else float(np.log(limit_arcsec))
    return gains_for(replace(samples, rotations_deg=()), log_error(samples.F_ior_arcsec[:, torque]), limit)


def gains_for(samples: Samples, y: Array, limit: float | None = None) -> tuple[MeasurementGain, ...]:
    """Measurements by their expected gain for a result y of the samples, shape (samples,), the best first.

    Argument: limit that y is held against, if any.
    """
    weights = samples.weights / samples.weights.sum()
    if effective_number(weights) < 3 or np.ptp(y) == 0:
        return ()
    gains = []
    predictors = list(_predictors(samples, np.random.default_rng(0)))
    for name, columns in predictors:
        prediction, explained, by_chance = _regression(columns, y, weights)
        if by_chance > CHANCE_OF_INFLUENCE / len(predictors):
            continue
        gain = 1 - np.sqrt(1 - explained) if limit is None else _right(prediction, y, weights, limit)
        gains.append(MeasurementGain(name, float(gain)))
    return tuple(sorted((each for each in gains if each.gain >= LEAST_NAMED_GAIN), key=lambda each: -each.gain))


def _predictors(samples: Samples, rng: np.random.Generator) -> Iterator[tuple[str, Array]]:
    """Each measurement by name, with the columns that a regression makes of its values as measured."""
    shares = samples.shares + MEASURING_ERROR * rng.standard_normal(samples.shares.shape)
    for group in groups_of(samples):
        yield group, columns_of(samples, shares, group)
    known = {each.figure for each in evidence_of(samples.prior.drive) if each.path.startswith("measured.")}
    figures = {f"stiffness.{name}": values for name, values in samples.figures.items() if name not in known}
    figures |= {f"F_ior@{M_g:g}": samples.F_ior_arcsec[:, k] for k, M_g in enumerate(samples.torques)}
    read: dict[str, Array] = {}
    for name, values in figures.items():
        x = read[name] = log_error(values) + MEASURING_ERROR * rng.standard_normal(len(values))
        if name not in known:
            yield name, np.stack([x, x**2], axis=1)
    for r, rotation in enumerate(samples.rotations_deg):
        for k, M_g in enumerate(samples.torques):
            if rotation % 360:
                now, turned = f"F_ior@{M_g:g}", samples.turned_arcsec[:, k, r]
                error = MEASURING_ERROR * rng.standard_normal(len(turned))
                x = log_error(turned) + error - read[now]
                yield f"{now}+{rotation:g}", np.stack([x, x**2], axis=1)


def _regression(columns: Array, y: Array, weights: Array) -> tuple[Array, float, float]:
    """Prediction of y from columns, the share of its variance that is explained, and how probable by chance alone.

    The share is less that which chance would explain; weights of the samples sum to 1.
    """
    root = np.sqrt(weights)[:, None]
    rest = orthogonal_to(root, root * y[:, None])
    directions, gain, by_chance = explained_by(root * columns, root, rest, effective_number(weights) - 1)
    fitted = np.divide(directions @ (directions.T @ rest), root, out=np.zeros_like(root), where=root > 0)
    return weights @ y + fitted[:, 0], gain / float(np.sum(rest**2)), by_chance


def _right(prediction: Array, y: Array, weights: Array, limit: float) -> float:
    """Gain of the probability that the likelier side of a limit is the right one."""
    residual = y - prediction
    inside = (prediction[:, None] + residual <= limit) @ weights
    now = weights @ (y <= limit)
    return float(weights @ np.maximum(inside, 1 - inside) - max(now, 1 - now))
