"""Thin rings and plain tubes, whose closed forms stand in textbooks on strength of materials."""

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.model.contacts import plain_ring, shell_twist_stiffness
from hdassist.drive.model.geometry import Geometry
from tests.validation.case import Case, Kind, about, parameters

TITLE = "Closed forms of rings and shells"
ABOUT = (
    "The first two rows concern a thin ring under two opposite forces P. Its diameter increases along the forces and "
    "decreases across them. The last row compares the torsional stiffness of the shell, computed as a thin tube, with "
    "that of a thick-walled tube."
)

RADIUS, E, WIDTH, THICKNESS = 80.0, 2.06e5, 24.0, 4.0
INERTIA = WIDTH * THICKNESS**3 / 12


def diameter(at: float, n_max: int = 40) -> float:
    """Change of the diameter at an angle, under forces at 0 and pi, in P r^3/(E I); bending only."""
    ring = plain_ring(E, WIDTH * THICKNESS, INERTIA, RADIUS, n_max)
    compliance = ring.compliance.copy()
    compliance[0] = 0  # the closed forms leave stretching out
    loads = ring.radial(np.array([0.0, np.pi])).sum(axis=0)
    seen = ring.radial(np.array([at, at + np.pi])).sum(axis=0)
    return float(seen * compliance @ loads * E * INERTIA / RADIUS**3)


def tube() -> float:
    drive = load_preset("vzp160")
    G = drive.material.E / 2 / (1 + drive.material.nu)
    inner = Geometry.of(drive).r_m - drive.flexspline.h_3 / 2
    polar = np.pi / 2 * ((inner + drive.flexspline.h_3) ** 4 - inner**4)  # thick tube, exact
    return float(shell_twist_stiffness(drive, Geometry.of(drive)) / (G * polar / drive.flexspline.l))


CASES = [
    Case(
        "change of the diameter along the forces", "P·r³/(E·I)", "textbooks: pi/4-2/pi",
        **about(np.pi / 4 - 2 / np.pi, 1e-5), why="The series of the ring is truncated after 40 harmonics",
        kind=Kind.CLOSED_FORM, value=lambda: diameter(0), digits=".5f",
    ),
    Case(
        "reduction of the diameter across the forces", "P·r³/(E·I)", "2/pi-1/2",
        **about(2 / np.pi - 0.5, 1e-5), why="The series of the ring is truncated after 40 harmonics",
        kind=Kind.CLOSED_FORM, value=lambda: -diameter(np.pi / 2), digits=".5f",
    ),
    Case(
        "torsional stiffness of the shell, divided by that of a thick tube", "", "G pi (r_o⁴ - r_i⁴)/(2 l)",
        **about(1, 1e-3), why="The theory of the thin tube neglects terms in (h/2r)²",
        kind=Kind.CLOSED_FORM, value=tube, digits=".5f",
    ),
]  # fmt: skip


@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case):
    case.check()
