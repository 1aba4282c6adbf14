"""Rules on several fields together that need no geometry: numbers of teeth, supports, torques, holes.

Each rule is a function whose arguments are named after the fields it needs; it runs when these are valid.
Lengths in mm as the fields are, angles in deg, torques in N*m.
"""

from __future__ import annotations

import inspect
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from hdassist.preset.measured import position_fault

LEAST_SUPPORT = 1.0  # N/mm: a part of one kilogram hangs on it by a centimetre, so it holds none in place
LEAST_END = 1e-4  # of the rated torque, of a segment of the stiffness curve: below, there is only play


@dataclass(frozen=True)
class Conflict:
    """Fields that do not go together: path of the field to look at first, message, numbers and a hint."""

    path: str
    message: str
    got: str = ""
    hint: str = ""


def field_conflicts(values: Mapping[str, Any]) -> Iterator[tuple[Conflict, tuple[str, ...]]]:
    """Apply the rules whose fields are all there.

    Arguments: values, the valid fields by their path ("gears.z_g").
    Result: each conflict with the paths of the fields that its rule has looked at.
    """
    paths = {path.rpartition(".")[2]: path for path in values}
    for rule in PRESET_RULES:
        names = _parameters(rule)
        if all(name in paths for name in names):
            involved = tuple(paths[name] for name in names)
            yield from ((conflict, involved) for conflict in rule(*(values[path] for path in involved)))
    for key in values.get("measured.F_ior", ()) if "mounting.holes" in values else ():
        if fault := position_fault(key.split("@")[0], values["mounting.holes"]):
            yield Conflict(f"measured.F_ior.{key}", fault[0], key, fault[1]), ()
    for path, phase in values.items():
        size = path.replace("harmonics.xi_", "harmonics.a_")
        if size != path and phase is not None and values.get(size, phase) is None:
            hint = f"give {size} in um as well; a phase alone says nothing"
            yield Conflict(path, "a phase without an amplitude", f"{phase:g} deg", hint), (path, size)


@cache
def _parameters(rule: Callable[..., Iterator[Conflict]]) -> tuple[str, ...]:
    return tuple(inspect.signature(rule).parameters)


def teeth_difference(z_b: int, z_g: int) -> Iterator[Conflict]:
    """The rigid wheel has two teeth more than the flexspline."""
    got = f"z_b - z_g = {z_b - z_g}"
    if z_b <= z_g:
        yield Conflict("gears.z_b", "the rigid wheel needs more teeth than the flexspline", got)
    elif z_b - z_g != 2:
        yield Conflict(
            "gears.z_b", "only drives with two waves and z_b - z_g = 2 are supported", got, f"z_b: {z_g + 2}"
        )


def shell_behind_teeth(l: float, b_w: float) -> Iterator[Conflict]:
    """The shell goes on behind the tooth ring."""
    if l <= b_w:
        yield Conflict("flexspline.l", "the shell must be longer than the tooth ring", f"l {l:g} mm, b_w {b_w:g} mm")


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
    """At least one part is supported."""
    if C_1 == C_2 == C_3 == 0:
        yield Conflict("supports.C_1", "C_1, C_2 and C_3 are all 0: nothing holds the drive", hint="give one of them")


def supports_hold(C_1: float, C_2: float, C_3: float | None) -> Iterator[Conflict]:
    """A support has a stiffness of at least LEAST_SUPPORT, or 0; the equations of softer ones are ill-conditioned."""
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


def run_out_counts_once(mark_kind: str, F_i2: float, e_b: float) -> Iterator[Conflict]:
    """A run-out of the rigid wheel is given by one field, F_i2 with marks of run-out, or e_b."""
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


PRESET_RULES: tuple[Callable[..., Iterator[Conflict]], ...] = (
    teeth_difference,
    shell_behind_teeth,
    rolling_needs_balls,
    overhung_on_a_shaft,
    something_holds,
    supports_hold,
    torques_usable,
    run_out_counts_once,
    segments_end_in_order,
    holes_exist,
    nodes_resolve_modes,
)
