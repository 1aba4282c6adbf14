"""Teeth that go together, in closed form: they reach each other, their tips come free, their flanks exist.

Arguments are named after the fields. Lengths in mm as the fields are, angles in deg.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import atan2, cos, degrees, hypot, pi, radians, sin, sqrt, tan

from hdassist.preset.conflict import Check, Conflict

MAX_OVERLAP = 0.1  # modules that nominal teeth may overlap: the rings give way by some of it
ACTIVE_ROOT = 0.2  # modules above the root of the flexspline where its flank begins
HEIGHTS = 9  # places on a flank where the overlap is looked for


def teeth_difference(z_b: int, z_g: int) -> Iterator[Conflict]:
    """The rigid wheel has two teeth more than the flexspline."""
    got = f"z_b - z_g = {z_b - z_g}"
    if z_b <= z_g:
        yield Conflict("gears.z_b", "the rigid wheel needs more teeth than the flexspline", got)
    elif z_b - z_g != 2:
        yield Conflict(
            "gears.z_b", "only drives with two waves and z_b - z_g = 2 are supported", got, f"z_b: {z_g + 2}"
        )


def teeth_reach(m: float, z_g: int, z_b: int, x_g: float, x_b: float, h_a: float, W_0: float) -> Iterator[Conflict]:
    """At the major axis the tips of the flexspline reach behind the tips of the rigid wheel."""
    tip, other = _tip_g(m, z_g, x_g, h_a), _tip_b(m, z_b, x_b, h_a)
    if tip + W_0 <= other:
        yield Conflict(
            "cam.W_0", "the teeth do not reach each other at the major axis",
            f"tip of the flexspline {tip + W_0:.4g} mm, of the rigid wheel {other:.4g} mm",
            f"above {other - tip:.4g} mm with these teeth",
        )  # fmt: skip


def tips_come_free(m: float, z_g: int, z_b: int, x_g: float, x_b: float, h_a: float, W_0: float) -> Iterator[Conflict]:
    """At the minor axis the tips pass each other."""
    tip, other = _tip_g(m, z_g, x_g, h_a), _tip_b(m, z_b, x_b, h_a)
    if tip - W_0 >= other:
        yield Conflict(
            "cam.W_0", "the tips interfere: they do not come free at the minor axis",
            f"tip of the flexspline {tip - W_0:.4g} mm, of the rigid wheel {other:.4g} mm",
            f"above {tip - other:.4g} mm with these teeth, or lower teeth (h_a)",
        )  # fmt: skip


def roots_have_room(
    m: float, z_g: int, z_b: int, x_g: float, x_b: float, h_a: float, h_f: float, W_0: float
) -> Iterator[Conflict]:
    """At the major axis no tip runs into the root of the other wheel."""
    root_b = m * (z_b + 2 * x_b + 2 * h_f) / 2
    tip_g = _tip_g(m, z_g, x_g, h_a)
    if tip_g + W_0 > root_b:
        yield Conflict(
            "cam.W_0", "beyond the teeth: the flexspline runs into the root of the rigid wheel",
            f"tip {tip_g + W_0:.4g} mm, root {root_b:.4g} mm",
            f"at most {root_b - tip_g:.4g} mm with these teeth",
        )  # fmt: skip
    root_g, tip_b = root_radius(m, z_g, x_g, h_f), _tip_b(m, z_b, x_b, h_a)
    if root_g + W_0 > tip_b:
        yield Conflict(
            "cam.W_0", "beyond the teeth: the rigid wheel runs into the root of the flexspline",
            f"tip {tip_b:.4g} mm, root {root_g + W_0:.4g} mm",
            f"at most {tip_b - root_g:.4g} mm with these teeth",
        )  # fmt: skip


def flanks_exist(m: float, z_g: int, z_b: int, x_g: float, x_b: float, h_a: float, alpha: float) -> Iterator[Conflict]:
    """The tips lie outside the base circles, and no tooth is pointed."""
    flexspline, rigid = _Involute(z_g, m, alpha, x_g), _Involute(z_b, m, alpha, x_b)
    tip_g, tip_b = _tip_g(m, z_g, x_g, h_a), _tip_b(m, z_b, x_b, h_a)
    for path, wheel, involute, tip in (
        ("gears.x_g", "flexspline", flexspline, tip_g), ("gears.x_b", "rigid wheel", rigid, tip_b),
    ):  # fmt: skip
        if tip <= involute.base:
            yield Conflict(
                path, f"the {wheel} has no involute flank: its tip lies inside the base circle",
                f"tip {tip:.4g} mm, base circle {involute.base:.4g} mm",
                "a larger profile shift, or lower teeth",
            )  # fmt: skip
    if tip_g > flexspline.base and flexspline.half_angle(tip_g) <= 0:
        yield Conflict(
            "gears.x_g", "the teeth of the flexspline are pointed", hint="less profile shift, or lower teeth"
        )
    if tip_b > rigid.base and rigid.half_angle(tip_b) >= pi / z_b:
        yield Conflict(
            "gears.x_b",
            "the teeth of the rigid wheel are pointed",
            hint="other profile shift, or lower teeth",
        )


def teeth_mesh(
    m: float, z_g: int, z_b: int, x_g: float, x_b: float, h_a: float, h_f: float, h_1: float,
    alpha: float, j_n: float, W_0: float,
) -> Iterator[Conflict]:  # fmt: skip
    """Nowhere between the axes do the nominal flanks and tips of the two wheels run through each other."""
    flexspline, rigid = _Involute(z_g, m, alpha, x_g), _Involute(z_b, m, alpha, x_b)
    tip_g, tip_b, root_g = _tip_g(m, z_g, x_g, h_a), _tip_b(m, z_b, x_b, h_a), root_radius(m, z_g, x_g, h_f)
    r_m = root_g - h_1 / 2
    low = max(root_g + ACTIVE_ROOT * m, flexspline.base)
    coarse = (
        *roots_have_room(m, z_g, z_b, x_g, x_b, h_a, h_f, W_0),
        *tips_come_free(m, z_g, z_b, x_g, x_b, h_a, W_0),
    )
    if coarse or tip_b <= rigid.base or low >= tip_g or r_m <= 0:
        return
    worst, at = 0.0, 0.0
    for tooth in range(z_g // 4 + 1):
        theta = 2 * pi * tooth / z_g
        for height in range(HEIGHTS):
            r_y = low + (tip_g - low) * height / (HEIGHTS - 1)
            for side in (1, -1):
                rho, phi = _flank_point(flexspline, r_y, theta, side, W_0, r_m)
                if rho < tip_b:
                    continue
                gap = (side * (theta * z_g / z_b - phi) + rigid.half_angle(rho)) * rigid.base + j_n * 1e-3
                if -gap > worst:
                    worst, at = -gap, theta
    if worst > MAX_OVERLAP * m:
        yield Conflict(
            "cam.W_0", "the teeth interfere: they run through each other under the shape the cam gives",
            f"an overlap of {worst * 1e3:.3g} um at {degrees(at):.3g} deg from the major axis",
            f"at most {MAX_OVERLAP * m * 1e3:.3g} um; check W_0 with m, x_g, x_b and h_a",
        )  # fmt: skip


CHECKS: tuple[Check, ...] = (
    teeth_difference,
    teeth_reach,
    tips_come_free,
    roots_have_room,
    flanks_exist,
    teeth_mesh,
)


def _tip_g(m: float, z_g: int, x_g: float, h_a: float) -> float:
    return m * (z_g + 2 * x_g + 2 * h_a) / 2


def _tip_b(m: float, z_b: int, x_b: float, h_a: float) -> float:
    return m * (z_b + 2 * x_b - 2 * h_a) / 2


def root_radius(m: float, z_g: int, x_g: float, h_f: float) -> float:
    """Root radius of the flexspline [mm]."""
    return m * (z_g + 2 * x_g - 2 * h_f) / 2


class _Involute:
    """Half angles of the teeth of a wheel, or of the spaces of the rigid one."""

    def __init__(self, z: int, m: float, alpha: float, x: float) -> None:
        slope = tan(radians(alpha))
        self.base = m * z * cos(radians(alpha)) / 2
        self._at_base = (pi / 2 + 2 * x * slope) / z + slope - radians(alpha)

    def half_angle(self, radius: float) -> float:
        slope = sqrt((radius / self.base) ** 2 - 1)
        return self._at_base - (slope - atan2(slope, 1))


def _flank_point(teeth: _Involute, r_y: float, theta: float, side: int, W_0: float, r_m: float) -> tuple[float, float]:
    """Polar place of a flank point at tooth radius r_y under the nominal shape W_0 cos 2 theta."""
    v = -W_0 / 2 * sin(2 * theta)
    chi = (v + 2 * W_0 * sin(2 * theta)) / r_m
    psi = teeth.half_angle(r_y)
    along, across = side * r_y * sin(psi), r_y * cos(psi) - r_m
    tangential = along * cos(chi) + across * sin(chi)
    radial = r_m + W_0 * cos(2 * theta) + across * cos(chi) - along * sin(chi)
    return hypot(radial, tangential), theta + v / r_m + atan2(tangential, radial)
