"""Prior sizes of the waves.

Each amplitude is normal with mean 0 and its own variance, a_kj and b_kj ~ N(0, v_kj). The sizes form a tree: the size
s_k of an order, the size b_k of its sidebands, and the size sqrt v_kj of a wave. Each has a half-t distribution with nu
= 3 degrees of freedom, whose scale is the size above it in the tree:

    s_k ~ half-t(q_k A),   b_k ~ half-t(s_k),   sqrt v_k0 ~ half-t(s_k),   sqrt v_kj ~ half-t(r_kj b_k).        (R6)

A is the rms of the readings after subtraction of each run's level, so the result does not depend on the unit. The
profiles q (orders) and r (sidebands) are data from solved drives (`sizes.toml`): `ORDER_PROFILE`, `SIDEBAND_PROFILE`,
`OUTPUT_PROFILE`. A half-t distribution has most of its mass near 0 and a long tail. The readings therefore determine
the size of a wave that they show, and a wave that they do not show remains as uncertain as the profile.

A half-t variable of scale s is conjugate given an auxiliary variable x (Wand et al. 2011, Bayesian Analysis 6, 847):

    v | x ~ IG(nu/2, nu/x),   x ~ IG(1/2, 1/s^2),   IG the inverse gamma distribution.                         (R7)

Each variable given the others therefore has an inverse gamma distribution, which `SizeTree.draw` uses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.model.geometry import Array
from hdassist.recording.waves import USUAL_SIDEBANDS
from hdassist.run.files import package_table

_Indices = NDArray[np.int64]
FREEDOM = 3.0  # degrees of freedom nu: tails like x^-4, so that a wave far above its profile is not shrunk
_LEAST_VARIANCE = 1e-14  # smallest variance as a share of A^2, which prevents overflow of a precision
_PROFILES = package_table("recording/sizes.toml")  # written by benchmarks/sizes.py, from solved drives
# Size of an order relative to the rms of the error, for k = 0, 1, 2, ...; the last value applies to higher orders. The
# value for k = 0 is a cautious assumption, because slow waves of a recording also come from encoders, couplings and
# gravity.
ORDER_PROFILE: tuple[float, ...] = tuple(_PROFILES["order"])
# Size of a sideband relative to its order, for |j| = 1, 2, ...; the last value applies to wider ones. It is twice that
# of solved drives, which is a cautious assumption.
SIDEBAND_PROFILE: tuple[float, ...] = tuple(_PROFILES["sideband"])
_OTHER_WHEEL: float = _PROFILES["other_wheel"][0]  # size of the waves (k, +-k), relative to their order
# size of the waves (k, +-k +- 1) of even orders, relative to their order; twice that of solved drives, like the others
_BESIDE_OTHER_WHEEL: float = _PROFILES["beside_other_wheel"][0]
OUTPUT_PROFILE: tuple[float, ...] = tuple(_PROFILES["output"])  # size of the waves (0, j), by j = 1, 2, ...
# Waves beyond the pairs: their rms relative to that of the fine waves (orders from 12), and their contribution to the
# range relative to their rms. The contribution is nearly always positive, because the largest value is selected among
# rougher ones. Both grow with the gear ratio, because with more teeth there are more positions at which the largest
# value may occur.
FINE_ORDER: int = _PROFILES["rest"]["fine_order"]


@dataclass(frozen=True)
class _RestProfile:
    """Sizes of the waves that are not among the pairs of the model (see the comment on FINE_ORDER).

    size: median of their rms relative to that of the fine waves.
    size_log_sigma: standard deviation of its logarithm.
    added: mean contribution to the range relative to their rms.
    added_sigma: standard deviation of added.
    """

    size: float
    size_log_sigma: float
    added: float
    added_sigma: float


def rest_profile(highest: int, gear_ratio: float) -> _RestProfile:
    """Return the sizes of the waves that a model with pairs up to a highest odd order omits.

    The sizes are interpolated between tabulated orders, and linear in the logarithm of the ratio.

    highest: highest odd order of the pairs.
    gear_ratio: input revolutions per output revolution; below 50, where no drive was solved, it counts as 50.
    """
    table = _PROFILES["rest"]

    def entry(name: str) -> float:
        return float(np.interp(highest, table["highest_order"], table[name]))

    larger = float(np.log(max(gear_ratio, table["least_ratio"]) / table["usual_ratio"]))
    return _RestProfile(
        size=entry("size") * float(np.exp(entry("size_exponent") * larger)),
        size_log_sigma=entry("size_log_sigma"),
        added=entry("added") + entry("added_slope") * larger,
        added_sigma=entry("added_sigma"),
    )


def wave_profile(pairs: _Indices) -> tuple[Array, Array]:
    """Return q_k of each order 0, 1, ... up to the highest, and r_kj of each wave.

    pairs: waves (k, j), shape (waves, 2).
    """
    k = pairs[:, 0]
    distance = np.abs(pairs[:, 1])
    orders = np.array([ORDER_PROFILE[min(order, len(ORDER_PROFILE) - 1)] for order in range(int(k.max()) + 1)])
    waves = np.empty(len(pairs))
    for number, (order, sideband) in enumerate(
        zip(
            k.tolist(),
            distance.tolist(),
            strict=True,
        )
    ):
        step = sideband  # distance to the nearer wheel
        if sideband > USUAL_SIDEBANDS:
            step = min(sideband, abs(sideband - order))
        if sideband == 0:
            waves[number] = 1.0
        elif order == 0:
            waves[number] = OUTPUT_PROFILE[min(sideband, len(OUTPUT_PROFILE)) - 1]
        elif sideband == order:
            waves[number] = _OTHER_WHEEL
        elif order % 2 == 0 and sideband > USUAL_SIDEBANDS and step == 1:
            waves[number] = _BESIDE_OTHER_WHEEL
        else:
            waves[number] = SIDEBAND_PROFILE[min(step, len(SIDEBAND_PROFILE)) - 1]
    return orders, waves


def fine_size(pairs: _Indices) -> float:
    """Return the usual rms of the fine waves among pairs, relative to the rms of the error.

    pairs: waves (k, j), shape (waves, 2).
    """
    if not len(pairs):
        return 0.0
    orders, waves = wave_profile(pairs)
    is_fine = pairs[:, 0] >= FINE_ORDER
    return float(np.sqrt(np.sum((orders[pairs[:, 0]] * waves)[is_fine] ** 2)))


@dataclass(eq=False)
class SizeTree:
    """The state of (R6) during sampling: squared sizes and the auxiliary variables of (R7).

    order_prior: squared q_k A, shape (orders,).
    wave_prior: squared r_kj, shape (waves,).
    parent_of: index of the size above each wave; those of the sidebands b_k follow those of the orders s_k, shape
    (waves,).
    waves_below: number of waves below each of these sizes, shape (2 orders,).
    order, sideband: squared s_k and b_k [arcsec^2], shape (orders,).
    order_aux, sideband_aux: their auxiliary variables [1/arcsec^2], shape (orders,).
    wave, wave_aux: v_kj [arcsec^2] and its auxiliary variable [1/arcsec^2], shape (waves,).
    least: smallest v_kj [arcsec^2].
    """

    order_prior: Array
    wave_prior: Array
    parent_of: _Indices
    waves_below: _Indices
    order: Array
    sideband: Array
    order_aux: Array
    sideband_aux: Array
    wave: Array
    wave_aux: Array
    least: float

    @classmethod
    def start(cls, pairs: _Indices, mean_square: float) -> SizeTree:
        """Return the tree with the sizes of the profile.

        pairs: waves (k, j), shape (waves, 2).
        mean_square: A^2 [arcsec^2].
        """
        orders, waves = wave_profile(pairs)
        order_prior = orders**2 * mean_square
        wave_prior = waves**2
        wave = wave_prior * order_prior[pairs[:, 0]]
        parent_of = np.where(pairs[:, 1] == 0, pairs[:, 0], len(orders) + pairs[:, 0])
        return cls(
            order_prior=order_prior,
            wave_prior=wave_prior,
            parent_of=parent_of,
            waves_below=np.bincount(parent_of, minlength=2 * len(orders)),
            order=order_prior.copy(),
            sideband=order_prior.copy(),
            order_aux=1 / order_prior,
            sideband_aux=1 / order_prior,
            wave=wave,
            wave_aux=1 / wave,
            least=_LEAST_VARIANCE * mean_square,
        )

    def draw(
        self,
        squares: Array,
        rng: np.random.Generator,
        amplitudes: int = 1,
    ) -> None:
        """Draw every size given the amplitudes, each from its conditional distribution by (R7).

        squares: a_kj^2 + b_kj^2 [arcsec^2], or the sum of several such squares of the same size, shape (waves,).
        amplitudes: number of such squares in each sum.
        """
        nu = FREEDOM
        orders = len(self.order)
        self.wave = self.least + inverse_gamma(nu / 2 + amplitudes, nu / self.wave_aux + squares / 2, rng)
        parent = np.concatenate([self.order, self.sideband])[self.parent_of]
        self.wave_aux = inverse_gamma((nu + 1) / 2, nu / self.wave + 1 / (self.wave_prior * parent), rng)
        precision = 1 / (self.wave_prior * self.wave_aux)
        sums = np.bincount(
            self.parent_of,
            precision,
            minlength=2 * orders,
        )
        mains, sidebands = np.split(self.waves_below, 2)
        main_sum, sideband_sum = np.split(sums, 2)
        self.sideband = inverse_gamma((nu + sidebands) / 2, nu / self.sideband_aux + sideband_sum, rng)
        self.sideband_aux = inverse_gamma((nu + 1) / 2, nu / self.sideband + 1 / self.order, rng)
        rate = nu / self.order_aux + main_sum + 1 / self.sideband_aux
        self.order = inverse_gamma((nu + mains + 1) / 2, rate, rng)
        self.order_aux = inverse_gamma((nu + 1) / 2, nu / self.order + 1 / self.order_prior, rng)


def inverse_gamma(
    shape: float | Array,
    rate: Array,
    rng: np.random.Generator,
) -> Array:
    """Return a draw from the inverse gamma distribution for each rate, with the shape of rate."""
    return np.asarray(rate / rng.gamma(shape, size=np.shape(rate)))
