"""How measured F'_ior differs from that of a model which is otherwise right: scale, misfit, noise, misreading.

No preset is the drive. Of a model whose F'_ior is f in the measured positions the drive shows

    y = f + SCALE u f + a GP + noise,  a = misfit mean(f),  GP ~ exp(-(2 sin(d/2) / LENGTH)^2 / 2)

with u normal, d the turn between two positions, the misfit among MISFITS, and one value perhaps misread (MISREAD).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import logsumexp

from hdassist.model.geometry import Array

SCALE = 0.10  # standard deviation of the drive's F'_ior over the model's, assumed
LENGTH = 0.5  # rad of the seat over which a misfit is alike: of other stiffnesses, second orders, an oval wheel
MISFITS = (0.0, 0.04, 0.08, 0.12)  # standard deviation of the misfit as a share of the mean F'_ior, all alike likely
MISREAD = 0.05  # probability of one of the values to be misread
MISREAD_SHARE = 0.3  # standard deviation of a misread value, as a share of it


def kernel(a_deg: Sequence[float], b_deg: Sequence[float]) -> Array:
    """Correlation of the misfit between positions [deg], shape (a, b)."""
    apart = np.radians(np.subtract.outer(a_deg, b_deg))
    return np.asarray(np.exp(-0.5 * np.square(2 * np.sin(apart / 2) / LENGTH)))


def spreads_with_misread(spreads: Array, y: Array, misread: int) -> Array:
    """Standard deviations of values [arcsec], shape (values,), where one is misread, by its place; -1: none of them."""
    return np.where(np.arange(len(y)) == misread, np.hypot(spreads, MISREAD_SHARE * y), spreads)


def likelihood_of_errors(
    f: Array, y: Array, spreads: Array, variance: Array, correlation: Array, noise: float = 1.0
) -> tuple[Array, Array]:
    """How far measured F'_ior lies off that of samples, squared, in standard deviations, and the log likelihood.

    Arguments: f of the samples there, y measured [arcsec], shape (samples, values) and (values,); spreads, standard
    deviations of y, and noise, over these; variance of the misfit [arcsec^2], shape (samples,), and its correlation,
    shape (values, values). In the eigenvectors of the correlation, whitened by the spreads, the covariance is diagonal,
    but for the scale's, which has rank one.
    """
    own, basis = np.linalg.eigh(correlation / np.multiply.outer(spreads, spreads))
    f, off = f / spreads @ basis, (y - f) / spreads @ basis
    each = noise**2 + variance[:, None] * np.maximum(own, 0)
    more = 1 + SCALE**2 * (f**2 / each).sum(axis=1)
    squares = (off**2 / each).sum(axis=1) - (SCALE * (f * off / each).sum(axis=1)) ** 2 / more
    return squares, -0.5 * (squares + np.log(each).sum(axis=1) + np.log(more)) - np.log(spreads).sum()


def log_likelihood_of_errors(f: Array, y: Array, spreads: Array, correlation: Array) -> Array:
    """Log likelihood of measured F'_ior over misfits and misread values, less that of samples with just these values.

    Arguments as those of likelihood_of_errors. Result of shape (samples,).
    """
    both, found = np.vstack([f, y]), []
    for misread in range(-1, len(y)):
        share = np.log(1 - MISREAD if misread < 0 else MISREAD / len(y))
        widened = spreads_with_misread(spreads, y, misread)
        for misfit in MISFITS:
            variance = np.square(misfit * both.mean(axis=1))
            found.append(share + likelihood_of_errors(both, y, widened, variance, correlation)[1])
    log = logsumexp(found, axis=0)
    return np.asarray(log[:-1] - log[-1])
