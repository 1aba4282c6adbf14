"""The shape that the cam gives the unloaded rim, in two conventions.

Both give, for sections at angles theta [rad] of the undeformed mid-line, the radial displacement w [mm], the
tangential v [mm], so that the section stands at radius r_m + w and angle theta + v/r_m, and its turn chi [rad]
there.
"""

from __future__ import annotations

from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
NominalCurve = Literal["linear", "inextensible"]
Shape = tuple[Array, Array, Array]

HARMONICS = 32  # that the arc length is sampled for
KEPT = 8  # of them: the eighth is below 1e-16 of the first for any wave a drive could have
ANGLE_ROUNDS = 50  # of a fixed-point iteration that gains a factor W_0/r_m a round, at most
ANGLE_CONVERGED = 1e-15  # rad, the last change of an angle


def nominal_shape(theta: Array, W_0: float, r_m: float, curve: NominalCurve = "linear") -> Shape:
    """Shape (w, v, chi) of the rim on a cam of wave W_0 [mm], mid-line radius r_m [mm].

    linear: the bending mode n = 2 of a ring, w = W_0 cos 2 theta. inextensible: the closed curve
    r_0 + A cos 2 phi that has the length of the undeformed mid-line and stands off by W_0 at the major axis;
    sections keep their arc length and stay normal to it.
    """
    if curve == "inextensible":
        return _inextensible(theta, W_0, r_m)
    w = W_0 * np.cos(2 * theta)
    v = -W_0 / 2 * np.sin(2 * theta)
    chi = (v + 2 * W_0 * np.sin(2 * theta)) / r_m
    return w, v, chi


def _inextensible(theta: Array, W_0: float, r_m: float) -> Shape:
    r_0, wave, ripple = _closed_curve(W_0, r_m)
    k = 2 * np.arange(1, KEPT + 1)
    phi = np.asarray(theta, dtype=float)
    for _ in range(ANGLE_ROUNDS):
        # arc length r_m theta = r_m phi + sum of ripple sin(k phi)
        before, phi = phi, theta - np.sin(phi[..., None] * k) @ ripple / r_m
        if np.max(np.abs(phi - before), initial=0) < ANGLE_CONVERGED:
            break
    radius, slope = r_0 + wave * np.cos(2 * phi), -2 * wave * np.sin(2 * phi)
    return radius - r_m, r_m * (phi - theta), -np.arctan2(slope, radius)


@cache
def _closed_curve(W_0: float, r_m: float) -> tuple[float, float, Array]:
    """Mean radius and wave of the inextensible curve [mm], and the sine series of its arc length [mm]."""
    phi = np.pi * np.arange(2 * HARMONICS) / (2 * HARMONICS)  # a half turn, its period
    shrink = 0.0
    for _ in range(ANGLE_ROUNDS):
        r_0, wave = r_m - shrink, W_0 + shrink
        speed = np.hypot(r_0 + wave * np.cos(2 * phi), 2 * wave * np.sin(2 * phi))
        excess = float(speed.mean()) - r_m
        shrink += excess
        if abs(excess) < ANGLE_CONVERGED * r_m:
            break
    series = np.fft.rfft(speed).real / HARMONICS
    return r_0, wave, series[1 : KEPT + 1] / (2 * np.arange(1, KEPT + 1))
