"""What trials teach of F'_ior: draws of it in every position, as likely as the measured values make them.

Given a sample of the cloud all is normal. The drive shows the sample's F'_ior f times a scale, and on top a misfit that
goes smoothly from hole to hole, for no preset is the drive:

    y = f + SCALE u f + a GP + noise,  a^2 = (misfit mean(f))^2 + table^2,  GP ~ exp(-(2 sin(d/2) / LENGTH)^2 / 2)

with the misfit among MISFITS and the noise about the told one, both weighed by what is measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.special import softmax
from scipy.stats import chi2, norm

from hdassist.errors import UntrustedError
from hdassist.model.geometry import Array
from hdassist.mounting.positions import hole_words
from hdassist.trials.cloud import Cloud, Places
from hdassist.trials.trial import Rig, Trial

SCALE = 0.10  # standard deviation of the drive's F'_ior over the model's, assumed
LENGTH = (
    0.5  # rad of the seat over which a misfit is alike: so it is for other stiffnesses, second orders, an oval wheel
)
MISFITS = (0.0, 0.04, 0.08, 0.12)  # standard deviation of the misfit as a share of the mean F'_ior, all alike likely
NOISES = tuple(2.0 ** (k / 2) for k in range(-2, 5))  # of the told noise
NOISE_SPREAD = 0.35  # of its logarithm before any trial: within half and twice with 95 %
DRAWS = 2048
UNLIKELY = 1e-3  # of a chance that the best explanation misses the trials so far: then there is none


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws, all alike likely, of what is not known after trials.

    places among samples and directions of the cloud; misfit, noise, over the told one, and scale, shape (draws,);
    F_ior_arcsec at the torque of the trials and the noise of a value there, shape (draws, rotations); effective samples
    that they stand for.
    """

    places: Places
    misfit: Array
    noise: Array
    scale: Array
    F_ior_arcsec: Array
    noise_arcsec: Array
    effective: float

    def chance(self, value: float) -> float:
        """Probability that a value measured in the first position is less than so much [arcsec]."""
        return float(norm.cdf(value, self.F_ior_arcsec[:, 0], self.noise_arcsec[:, 0]).mean())


def drawn(
    cloud: Cloud,
    trials: Sequence[Trial],
    rig: Rig,
    rotations_deg: Sequence[float],
    *,
    misfits: Sequence[float] = MISFITS,
    noises: Sequence[float] = NOISES,
    seed: int = 0,
) -> Draws:
    """Draw F'_ior in positions [deg] after trials, of which there may be none, for misfits and noises to be weighed."""
    rng = np.random.default_rng(seed)
    y, tried = np.array([t.F_ior_arcsec for t in trials]), [t.rotation_deg for t in trials]
    told, kinds = told_noise(cloud, rig, y), np.array(list(product(misfits, noises)))
    with np.errstate(divide="ignore"):
        log = np.log(cloud.weight.ravel()) - 0.5 * np.square(np.log(kinds[:, 1:]) / NOISE_SPREAD)
    if trials:
        f = cloud.at(tried)
        log += [_log_likelihood(f, y, told, _variance(cloud, s), tried, factor) for s, factor in kinds]
    weight = softmax(log)
    at = np.searchsorted(np.cumsum(weight), (np.arange(DRAWS) + 0.5) / DRAWS)
    kind, places = np.divmod(np.minimum(at, weight.size - 1), weight.shape[1])
    misfit, noise = kinds[kind].T
    F_ior, scale = _conditional(cloud, places, misfit, noise[:, None] * told, y, tried, rotations_deg, rng)
    seen = noise[:, None] * told_noise(cloud, rig, F_ior)
    return Draws(places, misfit, noise, scale, F_ior, seen, float(1 / np.square(weight.sum(axis=0)).sum()))


def told_noise(cloud: Cloud, rig: Rig, F_ior: Array) -> Array:
    """Standard deviation of values of so much F'_ior [arcsec] by what was told: noise and the seat's error."""
    return np.asarray(np.hypot(rig.noise_arcsec, rig.reseat_um * np.interp(F_ior, *cloud.seat)))


def _variance(cloud: Cloud, misfit: Array | float, places: Places | None = None) -> Array:
    """Variance of the misfit [arcsec^2] of samples: the drive's and the table's."""
    mean = np.repeat(cloud.F_ior_arcsec.mean(axis=1), cloud.weight.shape[1])
    mean = mean if places is None else mean[places]
    return np.asarray(np.square(misfit * mean) + cloud.tables[cloud.rig_M_g].standard_error ** 2)


def _log_likelihood(f: Array, y: Array, told: Array, variance: Array, tried: Sequence[float], noise: float) -> Array:
    """Log likelihood of measured values, shape (samples,), from F'_ior of samples there, shape (samples, trials).

    Arguments: told, standard deviation of each value, shape (trials,), and noise, over that. In the eigenvectors of the
    GP's kernel, whitened by what was told, the covariance is diagonal, but for the scale's, which has rank one.
    """
    own, basis = np.linalg.eigh(kernel(tried, tried) / np.multiply.outer(told, told))
    f, off = f / told @ basis, (y - f) / told @ basis
    each = noise**2 + variance[:, None] * np.maximum(own, 0)
    more = 1 + SCALE**2 * (f**2 / each).sum(axis=1)
    squares = (off**2 / each).sum(axis=1) - (SCALE * (f * off / each).sum(axis=1)) ** 2 / more
    return np.asarray(-0.5 * (squares + np.log(each).sum(axis=1) + np.log(more)))


def kernel(a_deg: Sequence[float], b_deg: Sequence[float]) -> Array:
    """Correlation of the misfit between positions [deg], shape (a, b)."""
    apart = np.radians(np.subtract.outer(a_deg, b_deg))
    return np.asarray(np.exp(-0.5 * np.square(2 * np.sin(apart / 2) / LENGTH)))


def smooth(rotations_deg: Sequence[float], draws: int, rng: np.random.Generator) -> Array:
    """Draws of the misfit of variance 1, shape (draws, rotations)."""
    own, basis = np.linalg.eigh(kernel(rotations_deg, rotations_deg))
    return np.asarray(rng.standard_normal((draws, len(own))) @ (np.sqrt(np.maximum(own, 0))[:, None] * basis.T))


def _conditional(
    cloud: Cloud,
    places: Places,
    misfit: Array,
    noise: Array,
    y: Array,
    tried: Sequence[float],
    rotations_deg: Sequence[float],
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """F'_ior of draws in positions, and their scale, given the measured values.

    Drawn before them, then moved by what the values differ from their own draw (Matheron's rule).
    """
    count, everywhere = len(rotations_deg), [*rotations_deg, *tried]
    f, variance = cloud.at(everywhere, places), _variance(cloud, misfit, places)
    scale = 1 + SCALE * rng.standard_normal(len(places))
    F_ior = f * scale[:, None] + np.sqrt(variance)[:, None] * smooth(everywhere, len(places), rng)
    there, seen = f[:, count:], F_ior[:, count:] + noise * rng.standard_normal((len(places), len(tried)))
    both = variance[:, None, None] * kernel(everywhere, tried) + SCALE**2 * f[:, :, None] * there[:, None, :]
    of_values = both[:, count:] + np.square(noise)[:, :, None] * np.eye(len(tried))
    moved = np.linalg.solve(of_values, (y - seen)[..., None])
    F_ior = (F_ior + (both @ moved)[..., 0])[:, :count]
    # a normal distribution has no end, an error has
    return np.maximum(F_ior, 0.1 * f[:, :count]), scale + SCALE**2 * (there * moved[..., 0]).sum(axis=1)


def require_reachable(cloud: Cloud, trials: Sequence[Trial], rig: Rig) -> None:
    """Raise UntrustedError where no sample comes to the measured values, saying what would have to change.

    Values of one position count by their mean: that they differ is the noise's.
    """
    tried = sorted({trial.rotation_deg for trial in trials})
    y = np.array([np.mean([t.F_ior_arcsec for t in trials if t.rotation_deg == rotation]) for rotation in tried])
    possible = np.flatnonzero(cloud.weight)
    f, variance = cloud.at(tried, possible), _variance(cloud, MISFITS[-1], possible)
    covariance = variance[:, None, None] * kernel(tried, tried) + SCALE**2 * f[:, :, None] * f[:, None, :]
    covariance += np.diag(told_noise(cloud, rig, y) ** 2)
    squares = ((y - f) * np.linalg.solve(covariance, (y - f)[..., None])[..., 0]).sum(axis=1)
    nearest = int(np.argmin(squares))
    if chi2.sf(squares[nearest], len(tried)) >= UNLIKELY:
        return
    told = ", ".join(
        f"{hole_words(rotation, cloud.drive.mounting.holes)}: measured {value:g}, at best {best:.1f}"
        for rotation, value, best in zip(tried, y, f[nearest], strict=True)
    )
    low, high = float(f.min()), float(f.max())
    change = (
        "they differ more from hole to hole than offsets of that size make them: a larger offset, or --noise, may fit"
    )
    if y.max() > high or y.max() < low:
        change = f"deviations or offsets had to be {y.max() / (high if y.max() > high else low):.2g} times as large"
    raise UntrustedError(
        f"no cam offset up to {np.abs(cloud.offset_um).max():.0f} um explains the trials ({told} arcsec)",
        f"this drive shows {low:.1f} to {high:.1f} arcsec at {rig.M_g:g} N*m: check values and torque; {change}",
    )
