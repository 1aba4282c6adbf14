"""Orders of the kinematic error: amplitude and phase per cam revolution, and what causes each."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics

DEGREE = 4  # products of up to so many deviations are named
LARGEST = 12  # orders without a known cause that are kept all the same
FLOOR = 1e-9  # arcsec: what is smaller is rounding


@dataclass(frozen=True)
class Order:
    """One order of the error: amplitude cos(per_cam_rev phi_h + phase), and its cause in words."""

    per_cam_rev: float
    amplitude_arcsec: float
    phase_deg: float
    cause: str


def known_causes(kinematics: Kinematics) -> dict[tuple[int, int], tuple[float, str]]:
    """Order per cam revolution and cause of each product of deviations up to DEGREE.

    Keys (k_g, k_b): how often what turns with the flexspline and what turns with the rigid wheel, seen from
    the cam, enter. The error is even in all deviations together (a half turn changes nothing), so an odd
    product needs the offset that turns with the cam, e_hh, as well.
    """
    rate_g = kinematics.teeth_fixed / kinematics.z_g
    rate_b = kinematics.teeth_fixed / kinematics.z_b
    found = {}
    for k_g, k_b in product(range(DEGREE + 1), range(-DEGREE, DEGREE + 1)):
        degree = abs(k_g) + abs(k_b)
        if 0 < degree <= DEGREE and (k_g > 0 or k_b > 0):
            found[k_g, k_b] = (abs(k_g * rate_g + k_b * rate_b), _words(k_g, k_b, degree % 2 == 1))
    return found


def _words(k_g: int, k_b: int, odd: bool) -> str:
    times = {1: "", 2: " twice", 3: " three times", 4: " four times"}
    parts = []
    if k_g:
        parts.append("flexspline" + times[k_g])
    if k_b:
        parts.append("rigid wheel and its cam offset" + times[abs(k_b)])
    if odd:
        parts.append("offset turning with the cam")
    return (" against " if k_b < 0 else " with ").join(parts)


def orders(kinematics: Kinematics, error_arcsec: Array, revolutions: int) -> list[Order]:
    """Orders of an error sampled at even steps over whole cam revolutions, by rising order.

    Arguments: error_arcsec, shape (states,); revolutions, cam revolutions that they span. Known orders are
    always there, others where they are among the largest. Where several causes fall within the resolution
    (1/revolutions), the simplest stand together.
    """
    count = len(error_arcsec)
    spectrum = np.fft.rfft(error_arcsec - np.mean(error_arcsec))
    amplitude = 2 * np.abs(spectrum) / count
    if count % 2 == 0:
        amplitude[-1] /= 2  # the last bin has no mirror image
    causes: dict[int, list[tuple[int, str]]] = {}
    for (k_g, k_b), (order, words) in known_causes(kinematics).items():
        place = round(order * revolutions)
        if 0 < place < len(amplitude):
            causes.setdefault(place, []).append((abs(k_g) + abs(k_b), words))
    places = sorted(set(causes) | {int(p) for p in np.argsort(amplitude)[::-1][:LARGEST] if p > 0})
    return [
        Order(place / revolutions, float(amplitude[place]), _phase(spectrum[place]), _simplest(causes.get(place, [])))
        for place in places
        if place in causes or amplitude[place] > FLOOR
    ]


def _phase(value: complex) -> float:
    return float(np.degrees(np.angle(value)))


def _simplest(causes: list[tuple[int, str]]) -> str:
    if not causes:
        return "no single cause known"
    least = min(degree for degree, _ in causes)
    return "; ".join(words for degree, words in causes if degree == least)
