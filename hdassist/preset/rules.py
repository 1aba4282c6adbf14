"""What fields must satisfy together: teeth that mesh, rings that fit, torques that can be used.

Each check is a function whose arguments are named after the fields it needs; it runs when these are valid.
Lengths in mm as the fields are, angles in deg, torques in N*m.
"""

from __future__ import annotations

import inspect
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from math import pi, sin
from typing import Any

from hdassist.preset import teeth
from hdassist.preset.conflict import Check, Conflict
from hdassist.preset.teeth import root_radius

MAX_THICKNESS = 0.2  # of its radius: beyond that the theory of thin rings means nothing


def conflicts(values: Mapping[str, Any]) -> Iterator[tuple[Conflict, tuple[str, ...]]]:
    """Run the checks whose fields are all there.

    Arguments: values, the valid fields by their path ("gears.z_g").
    Result: each conflict with the paths of the fields that its check has looked at.
    """
    paths = {path.rpartition(".")[2]: path for path in values}
    for function in CHECKS:
        names = tuple(inspect.signature(function).parameters)
        if function is not teeth.teeth_difference and {"z_g", "z_b"} <= {*names} and _difference(values) != 2:
            continue  # nothing more can be said about such teeth
        if all(name in paths for name in names):
            involved = tuple(paths[name] for name in names)
            for conflict in function(*(values[path] for path in involved)):
                yield conflict, involved


def _difference(values: Mapping[str, Any]) -> int:
    return int(values.get("gears.z_b", 0)) - int(values.get("gears.z_g", 0))


def shell_behind_teeth(l: float, b_w: float) -> Iterator[Conflict]:
    """The shell goes on behind the tooth ring."""
    if l <= b_w:
        yield Conflict("flexspline.l", "the shell must be longer than the tooth ring", f"l {l:g} mm, b_w {b_w:g} mm")


def rim_is_thin(m: float, z_g: int, x_g: float, h_f: float, h_1: float) -> Iterator[Conflict]:
    """The rim is a thin ring."""
    root = root_radius(m, z_g, x_g, h_f)
    if h_1 > MAX_THICKNESS * root:
        yield Conflict(
            "flexspline.h_1", f"too thick for a rim with a root radius of {root:.4g} mm",
            f"{h_1:g} mm", f"at most {MAX_THICKNESS * root:.3g} mm",
        )  # fmt: skip


def bearing_fits(
    m: float, z_g: int, x_g: float, h_f: float, h_1: float, ring_h: float, d_ball: float | None, N: int
) -> Iterator[Conflict]:
    """Outer ring and balls have room in the bore."""
    bore = root_radius(m, z_g, x_g, h_f) - h_1
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


def something_holds(C_1: float, C_2: float, C_3: float) -> Iterator[Conflict]:
    """At least one body is supported."""
    if C_1 == C_2 == C_3 == 0:
        yield Conflict("supports.C_1", "C_1, C_2 and C_3 are all 0: nothing holds the drive", hint="give one of them")


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


CHECKS: tuple[Check, ...] = (
    *teeth.CHECKS,
    shell_behind_teeth,
    rim_is_thin,
    bearing_fits,
    rolling_needs_balls,
    something_holds,
    torques_usable,
    holes_exist,
    nodes_resolve_modes,
    window_holds_teeth,
)
