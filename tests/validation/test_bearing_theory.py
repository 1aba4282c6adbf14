"""Balls: Hertz contact as ISO/TS 16281 uses it, and the load on the balls of a rigid bearing."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipkm1

from hdassist import load_preset
from hdassist.drive.model.contacts import FREEDOMS, ROTATION, contact_system
from hdassist.drive.model.geometry import Face
from hdassist.drive.solve.answers import residuals
from hdassist.drive.solve.formulation import formulate
from tests.helpers.support import load_case
from tests.validation.case import Case, Kind, about, parameters

TITLE = "Rolling bearings"
ABOUT = (
    "The first two rows test the deflection of the contacts between a ball and its raceways, computed with Hertz's "
    "theory as in ISO/TS 16281. The last two rows compare the load on the balls of a bearing with rigid rings, as "
    "computed by the solver for the drive, with a closed-form solution."
)
GROOVE = (0.515, 0.53)  # groove radius over ball diameter: usual for deep-groove bearings; assumed


def approach(load: float, curvatures: tuple[float, float, float, float], E: float, nu: float) -> float:
    """Hertz approach [mm] of two steel bodies under a load [N]; principal curvatures [1/mm], the first body's first."""
    a1, a2, b1, b2 = curvatures
    total = a1 + a2 + b1 + b2
    ratio = abs((a1 - a2) + (b1 - b2)) / total

    def off(log_k: float) -> float:
        k = np.exp(log_k)
        first, second = ellipkm1(1 / k**2), ellipe(1 - 1 / k**2)
        return ((k**2 + 1) * second - 2 * first) / ((k**2 - 1) * second) - ratio

    k = np.exp(brentq(off, 1e-3, 5)) if ratio > 1e-3 else 1.0
    first, second = ellipkm1(1 / k**2), ellipe(1 - 1 / k**2)
    unit = 2 * first / np.pi * (np.pi / (2 * k**2 * second)) ** (1 / 3)
    return float(unit * (3 * load / (2 * total) * 2 * (1 - nu**2) / E) ** (2 / 3) * total / 2)


def ball(load: float, groove: float) -> float:
    """Approach of both raceways [mm] over a ball of the drive."""
    drive = load_preset("vzp160")
    d, pitch = float(drive.bearing.d_ball or 0), 76.0 - float(drive.bearing.d_ball or 0) / 2
    outer = (2 / d, 2 / d, -1 / (pitch + d / 2), -1 / (groove * d))
    inner = (2 / d, 2 / d, 1 / (pitch - d / 2), -1 / (groove * d))
    return sum(approach(load, c, drive.material.E, drive.material.nu) for c in (outer, inner))


def tangent(load: float, groove: float) -> float:
    """Tangent compliance [mm/N] at a load."""
    return (ball(load * 1.001, groove) - ball(load * 0.999, groove)) / (0.002 * load)


def stribeck() -> tuple[float, float]:
    """Greatest ball load over 4 F/N, and deflection over 4 F c/N, of a bearing with rigid rings, no clearance."""
    balls, load, c = 24, 5000.0, 2.5e-5
    system = contact_system(load_preset("vzp160"))
    # the freedom that the programme leaves open takes the place of the inner ring's displacement
    G = np.zeros((balls, len(FREEDOMS)))
    G[:, ROTATION] = -np.cos(2 * np.pi * np.arange(balls) / balls)
    C = np.where(np.arange(len(FREEDOMS)) == ROTATION, 0.0, 1.0)
    bearing = replace(
        system,
        compliance=np.zeros((balls, balls)),
        local=np.full(balls, c),
        G=G,
        C=C,
        delta_p=np.zeros(balls),
        face=Face(np.zeros(1), np.array([c])),
        flanks=replace(system.flanks, theta=np.zeros(0)),
    )
    forces, free, _ = load_case(formulate(bearing), load).forces(bearing.delta_p[None])
    assert residuals(bearing, bearing.delta_p[None], load, forces, free).shares[0, 3] < 1e-12
    return float(forces.max() / (4 * load / balls)), float(free[0, 0] / (4 * load * c / balls))


CASES = [
    Case(
        "sphere on a plane: approach, divided by Q^(2/3) Σρ^(1/3)",
        "10⁻⁴mm/N^(2/3)",
        "Hertz",
        **about(2.79, 0.02),
        why="The elastic modulus stated in the textbook is used",
        kind=Kind.CLOSED_FORM,
        value=lambda: approach(1e3, (0.1, 0.1, 0.0, 0.0), 2.075e5, 0.3) / (1e2 * 0.2 ** (1 / 3)) * 1e4,
    ),
    Case(
        "contact.c_ball of vzp160",
        "10⁻⁵mm/N",
        "Hertz, tangent compliance at loads of 1000 and 100 N",
        low=tangent(1000, GROOVE[0]) * 1e5,
        high=tangent(100, GROOVE[1]) * 1e5,
        why="The ball has a diameter of 14.3 mm. A groove radius of 0.515 to 0.53 ball diameters is assumed",
        kind=Kind.BOUND,
        value=lambda: load_preset("vzp160").contact.c_ball * 1e5,
    ),
    Case(
        "largest ball load, divided by 4 F/N",
        "",
        "Stribeck",
        **about(1, 1e-9),
        why="The formula is exact if the number of balls N is divisible by 4",
        kind=Kind.CLOSED_FORM,
        value=lambda: stribeck()[0],
        digits=".6f",
    ),
    Case(
        "deflection, divided by 4 F c/N",
        "",
        "Stribeck",
        **about(1, 1e-9),
        why="The formula is exact",
        kind=Kind.CLOSED_FORM,
        value=lambda: stribeck()[1],
        digits=".6f",
    ),
]


@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case):
    case.check()
