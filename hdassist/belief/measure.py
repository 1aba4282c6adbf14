"""The next measurement: how much nearer each would bring the right verdict, from the samples alone.

Each sample in turn is taken for the drive that is measured. Given the measurement, ln F'_ior is that of a regression
over the samples, with the residuals of that regression; the verdict goes to the likelier side of the limit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from hdassist.belief.evidence import evidence_of
from hdassist.belief.influence import CHANCE_OF_INFLUENCE, columns_of, explained_by, groups_of, orthogonal_to
from hdassist.belief.samples import Samples
from hdassist.belief.statistics import effective_number, log_error
from hdassist.model.geometry import Array

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
