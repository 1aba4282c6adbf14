"""What fields must satisfy together: teeth that mesh, rings that fit, torques that can be used.

Each rule is a function whose arguments are named after the fields it needs; it runs when these are valid.
Lengths in mm as the fields are, angles in deg, torques in N*m.
"""

from __future__ import annotations

import inspect
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, pi, radians, sin, sqrt, tan
from typing import Any

MAX_THICKNESS = 0.2  # of its radius: beyond that the theory of thin rings means nothing
LEAST_SUPPORT = 1.0  # N/mm: a part of one kilogram hangs on it by a centimetre, so it holds none in place
LEAST_END = 1e-4  # of the rated torque, of a segment of the stiffness curve: below, there is only play
MAX_OVERLAP = 0.1  # modules that nominal teeth may overlap: the rings give way by some of it
ACTIVE_ROOT = 0.2  # modules above the root of the flexspline where its flank begins
HEIGHTS = 9  # places on a flank where the overlap is looked for


@dataclass(frozen=True)
class Conflict:
    """Fields that do not go together: path of the field to look at first, message, numbers and a hint."""

    path: str
    message: str
    got: str = ""
    hint: str = ""


def conflicts(values: Mapping[str, Any]) -> Iterator[tuple[Conflict, tuple[str, ...]]]:
    """Apply the rules whose fields are all there.

    Arguments: values, the valid fields by their path ("gears.z_g").
    Result: each conflict with the paths of the fields that its rule has looked at.
    """
    paths = {path.rpartition(".")[2]: path for path in values}
    no_mesh = values.get("gears.z_b", 0) - values.get("gears.z_g", 0) != 2  # nothing more can be said of such teeth
    for rule in RULES:
        names = tuple(inspect.signature(rule).parameters)
        if no_mesh and {"z_g", "z_b"} <= {*names} and rule is not teeth_difference:
            continue
        if all(name in paths for name in names):
            involved = tuple(paths[name] for name in names)
            yield from ((conflict, involved) for conflict in rule(*(values[path] for path in involved)))


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
    root_g, tip_b = _root_g(m, z_g, x_g, h_f), _tip_b(m, z_b, x_b, h_a)
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
    """Nowhere between the axes do the nominal flanks and tips of the two wheels run through each other.

    On the bending mode of the ring as the shape of the rim: near enough for an overlap of a tenth of a module.
    """
    flexspline, rigid = _Involute(z_g, m, alpha, x_g), _Involute(z_b, m, alpha, x_b)
    tip_g, tip_b, root_g = _tip_g(m, z_g, x_g, h_a), _tip_b(m, z_b, x_b, h_a), _root_g(m, z_g, x_g, h_f)
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


def shell_behind_teeth(l: float, b_w: float) -> Iterator[Conflict]:
    """The shell goes on behind the tooth ring."""
    if l <= b_w:
        yield Conflict("flexspline.l", "the shell must be longer than the tooth ring", f"l {l:g} mm, b_w {b_w:g} mm")


def rim_is_thin(m: float, z_g: int, x_g: float, h_f: float, h_1: float) -> Iterator[Conflict]:
    """The rim is a thin ring."""
    root = _root_g(m, z_g, x_g, h_f)
    if h_1 > MAX_THICKNESS * root:
        yield Conflict(
            "flexspline.h_1", f"too thick for a rim with a root radius of {root:.4g} mm",
            f"{h_1:g} mm", f"at most {MAX_THICKNESS * root:.3g} mm",
        )  # fmt: skip


def bearing_fits(
    m: float, z_g: int, x_g: float, h_f: float, h_1: float, ring_h: float, d_ball: float | None, N: int
) -> Iterator[Conflict]:
    """Outer ring and balls have room in the bore."""
    bore = _root_g(m, z_g, x_g, h_f) - h_1
    raceway = bore - ring_h
    if ring_h > MAX_THICKNESS * bore:
        if bore > 0:
            yield Conflict(
                "bearing.ring_h", f"too thick for a bore with a radius of {bore:.4g} mm",
                f"{ring_h:g} mm", f"at most {MAX_THICKNESS * bore:.3g} mm",
            )  # fmt: skip
    elif d_ball is not None:
        room = 2 * raceway * sin(pi / N) / (1 + sin(pi / N))
        if d_ball >= raceway:
            yield Conflict(
                "bearing.d_ball", f"does not fit inside the raceway with a radius of {raceway:.4g} mm",
                f"{d_ball:g} mm", f"at most {room:.3g} mm for {N} balls",
            )  # fmt: skip
        elif d_ball > room:
            yield Conflict("bearing.d_ball", f"no room for {N} balls in the bearing", f"{d_ball:g} mm",
                           f"at most {room:.3g} mm")  # fmt: skip


def rolling_needs_balls(ball_motion: str, d_ball: float | None) -> Iterator[Conflict]:
    """Rolling balls turn the cage by an angle that depends on their size."""
    if ball_motion == "rolling" and d_ball is None:
        yield Conflict("bearing.ball_motion", "rolling balls need bearing.d_ball", hint="give d_ball in mm")


def overhung_on_a_shaft(
    coupling: str, shaft_d: float | None, overhang: float | None, C_3: float | None
) -> Iterator[Conflict]:
    """A cam that is overhung has the stiffness of its shaft."""
    if coupling == "overhung" and C_3 is None and (shaft_d is None or overhang is None):
        yield Conflict(
            "cam.coupling", "overhung needs cam.shaft_d and cam.overhang", hint="give both in mm, or supports.C_3"
        )


def something_holds(C_1: float, C_2: float, C_3: float | None) -> Iterator[Conflict]:
    """At least one body is supported."""
    if C_1 == C_2 == C_3 == 0:
        yield Conflict("supports.C_1", "C_1, C_2 and C_3 are all 0: nothing holds the drive", hint="give one of them")


def supports_hold(C_1: float, C_2: float, C_3: float | None) -> Iterator[Conflict]:
    """What is called a support is one; numbers between such and 0 mean nothing, and take the equations apart."""
    for name, C in {"C_1": C_1, "C_2": C_2, "C_3": C_3}.items():
        if C and C < LEAST_SUPPORT:
            yield Conflict(
                f"supports.{name}", "too soft to hold anything", f"{C:g} N/mm",
                f"0 where nothing holds the part, else at least {LEAST_SUPPORT:g} N/mm",
            )  # fmt: skip


def torques_usable(M_g: Sequence[float]) -> Iterator[Conflict]:
    """Each torque once, and none of them 0."""
    if not M_g:
        yield Conflict("operation.M_g", "needs at least one torque")
    if 0 in M_g:
        yield Conflict(
            "operation.M_g", "a torque of 0 leaves the rotation undetermined within the clearance",
            hint="a small torque instead, such as 1 % of the rated one",
        )  # fmt: skip
    twice = sorted(torque for torque, times in Counter(M_g).items() if times > 1)
    if twice:
        yield Conflict("operation.M_g", "the same torque twice", ", ".join(f"{torque:g}" for torque in twice))


def harmonics_have_sizes(
    a_g2: float | None, a_g3: float | None, a_g4: float | None, a_b2: float | None, a_b3: float | None,
    a_b4: float | None, a_s2: float | None, xi_g2: float | None, xi_g3: float | None, xi_g4: float | None,
    xi_b2: float | None, xi_b3: float | None, xi_b4: float | None, xi_s2: float | None,
) -> Iterator[Conflict]:  # fmt: skip
    """A phase belongs to an amplitude."""
    sizes = {"g2": a_g2, "g3": a_g3, "g4": a_g4, "b2": a_b2, "b3": a_b3, "b4": a_b4, "s2": a_s2}
    phases = {"g2": xi_g2, "g3": xi_g3, "g4": xi_g4, "b2": xi_b2, "b3": xi_b3, "b4": xi_b4, "s2": xi_s2}
    for name, phase in phases.items():
        if phase is not None and sizes[name] is None:
            yield Conflict(
                f"harmonics.xi_{name}", "a phase without an amplitude", f"{phase:g} deg",
                f"give harmonics.a_{name} in um as well; a phase alone says nothing",
            )  # fmt: skip


def run_out_counts_once(mark_kind: str, F_i2: float, e_b: float) -> Iterator[Conflict]:
    """A run-out is said by F_i2 with marks of run-out, or by e_b."""
    if mark_kind == "runout" and F_i2 and e_b:
        yield Conflict(
            "tolerances.e_b", "the run-out of the rigid wheel is given twice", f"F_i2 {F_i2:g} um, e_b {e_b:g} um",
            "with mounting.mark_kind: runout F_i2 is that run-out (twice e_b); give one of the two",
        )  # fmt: skip


def segments_end_in_order(
    T_1: float | None, T_2: float | None, rated: float | None, M_g: Sequence[float]
) -> Iterator[Conflict]:
    """The catalogue's segments of the stiffness curve end one after the other, above zero."""
    least = LEAST_END * (rated or max(map(abs, M_g), default=0.0))
    for name, end in {"T_1": T_1, "T_2": T_2}.items():
        if end is not None and end <= least:
            yield Conflict(f"catalogue.{name}", "too small to end a segment", f"{end:g} N*m", f"above {least:g} N*m")
    if T_1 is not None and T_2 is not None and T_1 >= T_2:
        yield Conflict("catalogue.T_1", "the first segment must end below the second", f"T_1 {T_1:g}, T_2 {T_2:g} N*m")


def holes_exist(allowed: str | Sequence[int], holes: int) -> Iterator[Conflict]:
    """Usable holes are holes of the seat, each named once."""
    if isinstance(allowed, str):
        return
    beyond = sorted({hole for hole in allowed if not 0 <= hole < holes})
    if not allowed:
        yield Conflict("mounting.allowed", "no hole is left", hint="all, or a list of hole numbers")
    elif holes == 0:
        yield Conflict("mounting.allowed", "a free angle (holes: 0) has no holes to choose from", hint="all")
    elif beyond:
        yield Conflict("mounting.allowed", f"the seat has the holes 0 to {holes - 1}", ", ".join(map(str, beyond)))
    elif len(set(allowed)) < len(allowed):
        yield Conflict("mounting.allowed", "the same hole twice")


def nodes_resolve_modes(n_2: int, n_max: int) -> Iterator[Conflict]:
    """The nodes between bore and ring see every bending mode."""
    if n_2 < 2 * n_max:
        yield Conflict("numerics.n_2", "too few nodes for the bending modes", f"n_2 {n_2}, n_max {n_max}",
                       f"at least 2 n_max = {2 * n_max}")  # fmt: skip


def window_holds_teeth(window: float, z_g: int) -> Iterator[Conflict]:
    """The flank window holds more than a tooth."""
    pitch = 360 / z_g
    if window < pitch:
        yield Conflict("numerics.window", "holds no full tooth pitch", f"{window:g} deg", f"at least {pitch:.3g} deg")


RULES: tuple[Callable[..., Iterator[Conflict]], ...] = (
    teeth_difference,
    teeth_reach,
    tips_come_free,
    roots_have_room,
    flanks_exist,
    teeth_mesh,
    shell_behind_teeth,
    rim_is_thin,
    bearing_fits,
    rolling_needs_balls,
    overhung_on_a_shaft,
    something_holds,
    supports_hold,
    torques_usable,
    harmonics_have_sizes,
    run_out_counts_once,
    segments_end_in_order,
    holes_exist,
    nodes_resolve_modes,
    window_holds_teeth,
)


def _tip_g(m: float, z_g: int, x_g: float, h_a: float) -> float:
    return m * (z_g + 2 * x_g + 2 * h_a) / 2


def _tip_b(m: float, z_b: int, x_b: float, h_a: float) -> float:
    return m * (z_b + 2 * x_b - 2 * h_a) / 2


def _root_g(m: float, z_g: int, x_g: float, h_f: float) -> float:
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
