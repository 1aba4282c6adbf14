"""Contributions of inputs to the spread of F'_ior, and the measurements that reduce it most.

The contributions result from a weighted stepwise regression of ln F'_ior over the samples. The size and the direction
of a deviation form one group. Groups enter in the order of the explained variance, as long as chance alone is unlikely
to explain as much. The contribution of a group is the share of the variance that it adds, minus the share that equally
many random columns would add. The remainder is unexplained, for example products of inputs and nonlinear effects beyond
squares. A measurement is considered on its own: its gain follows from the share of the total variance that its columns
explain.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from hdassist.belief.evidence import evidence_of
from hdassist.belief.samples import Samples
from hdassist.belief.statistics import effective_number, log_error
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import DEVIATIONS

_CHANCE_OF_INFLUENCE = 0.05  # probability that some group enters although none has an influence
# the effect of single teeth depends on all of these together, so columns of single ones would be random
_ONE_OF_MANY = frozenset(deviation.direction for deviation in DEVIATIONS if deviation.kind == "pitch")
_INDEPENDENT = 1e-8  # smallest new part of a column, as a share of its length, that is not a rounding error
_NO_VARIANCE = 1e-18  # variance of ln F'_ior below which samples are considered equal
_LEAST_MEAN_SQUARE = 1e-30  # smallest divisor, because columns may explain a residual to the last digit


@dataclass(frozen=True)
class Influence:
    """Contribution of a group of fields to the variance of ln F'_ior, as a share.

    group: path of the first field of the group.
    """

    group: str
    share: float


def influences(samples: Samples, torque: int) -> tuple[Influence, ...]:
    """Return the contributions to the variance of ln F'_ior at a torque, as shares, the largest first.

    The shares add up to 1 together with the unexplained part. The result is empty if there are too few samples or if
    F'_ior does not vary.

    torque: index of the torque.
    """
    return influences_on(samples, log_error(samples.F_ior_arcsec[:, torque]))


def influences_on(samples: Samples, y: Array) -> tuple[Influence, ...]:
    """Return the contributions to the variance of another result of the samples, as shares, the largest first.

    y: values of the result, shape (samples,).
    """
    groups = {name: columns_of(samples, samples.shares, name) for name in _groups_of(samples)}
    return shares_of_variance(groups, y, samples.weights)


def _groups_of(samples: Samples) -> tuple[str, ...]:
    """Return the groups of the fields of samples, by path, in the order of the preset."""
    return tuple(dict.fromkeys(field.group for field in samples.prior.fields))


def columns_of(
    samples: Samples,
    shares: Array,
    group: str,
) -> Array:
    """Return the regression columns of a group of fields, shape (samples, columns).

    A number has two columns, itself and its square. An unknown direction has its sine and cosine, multiplied by the
    size if that is unknown too. Single teeth of known size have no columns.

    samples: samples of the drive, whose prior names the fields.
    shares: shares of each field's probability, shape (samples, fields).
    group: path of the group.
    """
    columns: list[Array] = []
    size = np.ones(len(shares))
    fields = [(field, shares[:, k]) for k, field in enumerate(samples.prior.fields) if field.group == group]
    for field, share in fields:
        if not field.is_any_direction:
            x = 2 * share - 1
            columns += [x, x**2]
            if field.path == group:
                size = share
    for field, share in fields:
        if field.is_any_direction and field.path not in _ONE_OF_MANY:
            direction = 2 * np.pi * share
            columns += [size * np.cos(direction), size * np.sin(direction)]
    return np.array(columns).reshape(-1, len(shares)).T


@dataclass(frozen=True, eq=False)
class _Explanation:
    """Part of a residual explained by the columns of a group.

    directions: new directions, orthogonal to the groups that entered before, shape (samples, directions).
    gain: explained squares, minus those that equally many random columns would explain.
    chance: probability that chance alone explains as much (F test).
    """

    directions: Array
    gain: float
    chance: float


def shares_of_variance(
    groups: Mapping[str, Array],
    y: Array,
    weights: Array,
) -> tuple[Influence, ...]:
    """Return the shares of the weighted variance of y that groups of columns add, the largest first.

    groups: columns by the name of their group, shape (samples, columns) each.
    y: values, shape (samples,).
    weights: weights of the samples, shape (samples,).
    """
    root = np.sqrt(weights / weights.sum())[:, None]
    basis = root / np.linalg.norm(root)
    residual = _orthogonal_to(basis, root * y[:, None])
    variance = float(np.sum(residual**2))
    if variance <= _NO_VARIANCE:
        return ()
    free = effective_number(weights) - 1
    remaining = {name: root * columns for name, columns in groups.items()}
    influences: list[Influence] = []
    while remaining:
        explanations = {name: _explained_by(columns, basis, residual, free) for name, columns in remaining.items()}
        # with equal chances the larger gain enters, then the first name, so that the order is reproducible
        best = min((explained.chance, -explained.gain, name) for name, explained in explanations.items())[2]
        explained = explanations[best]
        if explained.chance > _CHANCE_OF_INFLUENCE / len(groups):
            break
        influences.append(Influence(best, explained.gain / variance))
        basis = np.hstack([basis, explained.directions])
        residual = _orthogonal_to(basis, residual)
        free -= explained.directions.shape[1]
        del remaining[best]
    return tuple(sorted(influences, key=lambda influence: -influence.share))


def _explained_by(
    columns: Array,
    basis: Array,
    residual: Array,
    free: float,
) -> _Explanation:
    """Return the part of a residual that columns explain in addition to a basis.

    columns: columns, shape (samples, columns).
    basis: orthonormal directions that entered before, shape (samples, directions).
    residual: residual, shape (samples, 1).
    free: degrees of freedom of the residual.
    """
    u, size, _ = np.linalg.svd(_orthogonal_to(basis, columns), full_matrices=False)
    directions = u[:, size > _INDEPENDENT * np.linalg.norm(columns)]
    count = directions.shape[1]
    if count == 0 or free - count < 1:
        return _Explanation(
            directions=directions,
            gain=0.0,
            chance=1.0,
        )
    squares = float(np.sum(residual**2))
    explained = float(np.sum((directions.T @ residual) ** 2))
    # squares that one random column explains
    by_chance = max((squares - explained) / (free - count), _LEAST_MEAN_SQUARE)
    chance = float(fdtrc(count, free - count, explained / count / by_chance))
    return _Explanation(
        directions=directions,
        gain=explained - count * by_chance,
        chance=chance,
    )


def _orthogonal_to(basis: Array, columns: Array) -> Array:
    """Return the part of the columns that is orthogonal to a basis."""
    return columns - basis @ (basis.T @ columns)


@dataclass(frozen=True)
class MeasurementGain:
    """A measurement and the share of the spread that it removes.

    measured: path of a field, or for example `stiffness.K_1`.
    """

    measured: str
    gain: float


def measurements(samples: Samples, torque: int) -> tuple[MeasurementGain, ...]:
    """Return measurements by the share of the spread of ln F'_ior that each removes, the best first.

    Each measurement is considered as the only one, and as exact: a group of fields, or a stiffness not measured yet.

    samples: samples of the drive.
    torque: index of the torque.
    """
    columns = {name: columns_of(samples, samples.shares, name) for name in _groups_of(samples)}
    evidence = evidence_of(samples.prior.drive)
    measured_figures = {datum.figure for datum in evidence if datum.path.startswith("measured.")}
    for name, values in samples.figures.items():
        if name not in measured_figures:
            x = log_error(values)
            columns[f"stiffness.{name}"] = np.stack([x, x**2], axis=1)
    y = log_error(samples.F_ior_arcsec[:, torque])
    gains = []
    for name, columns_of_one in columns.items():
        influences = shares_of_variance({name: columns_of_one}, y, samples.weights)
        gains += [MeasurementGain(name, 1 - float(np.sqrt(1 - influence.share))) for influence in influences]
    return tuple(sorted(gains, key=lambda gain: -gain.gain))
