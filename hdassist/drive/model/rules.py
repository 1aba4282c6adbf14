"""Rules that fields of a drive must satisfy together: rules of teeth, supports, torques and holes, and of the geometry.

Each rule of the geometry is listed with the fields that it uses. Lengths of fields are in mm, angles in deg, torques in
N*m; angles of the geometry are in rad.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import nan
from typing import Any

import numpy as np

from hdassist.drive.model.geometry import Geometry, flank_candidates
from hdassist.drive.preset.fields import Drive, field_table, sections
from hdassist.run.errors import UntrustedError
from hdassist.run.files import number_of

_LEAST_SUPPORT = 1.0  # N/mm: a 1 kg part sags by 1 cm on such a support, so anything softer holds no part in place
# largest torque of a measured F'_ior, over the largest torque of the drive; above it the number is probably mistyped
_FARTHEST_MEASURED = 100.0
# Smallest end of a segment of the stiffness curve, as a share of the rated torque; below it there is only backlash.
_LEAST_END = 1e-4
# Largest thickness of a ring, as a share of its radius: beyond it the theory of thin rings does not hold.
_MAX_THICKNESS = 0.2
MAX_OVERLAP = 0.1  # largest overlap of nominal teeth [modules]; the deflection of the rings removes some of it

_PROFILES = ("gears.m", "gears.z_g", "gears.z_b", "gears.x_g", "gears.x_b", "gears.h_a")
_TIPS = (*_PROFILES, "cam.W_0")
_ROOTS = (*_PROFILES, "gears.h_f", "cam.W_0")
_FLANKS = (*_PROFILES, "gears.alpha")
_WARMTH = ("material.alpha_T", "operation.dT")
_MESH_FIELDS = (*_ROOTS, *_WARMTH, "flexspline.h_1", "gears.alpha", "gears.j_n", "numerics.nominal_curve")
_RIM_FIELDS = ("gears.m", "gears.z_g", "gears.x_g", "gears.h_f", "flexspline.h_1")
BEARING_FIELDS = (*_RIM_FIELDS, "bearing.ring_h", "bearing.d_ball", "bearing.N")


@dataclass(frozen=True)
class _Conflict:
    """Fields that contradict each other."""

    path: str  # path of the field to check first
    message: str
    got: str = ""  # the numbers at fault
    hint: str = ""


@dataclass(frozen=True)
class FieldRule:
    """A rule that several fields must satisfy together.

    path: field to check first.
    fault: function whose arguments have the names of the fields; it returns the numbers at fault or True, and an empty
        text or False if the fields are consistent.
    """

    path: str
    message: str
    fault: Callable[..., str | bool]
    hint: str = ""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the fields that the rule uses."""
        return tuple(inspect.signature(self.fault).parameters)


def first_conflict(drive: Drive) -> _Conflict | None:
    """Return the first conflict between the fields of a drive, None if they are consistent."""
    values = {path: drive.value(path) for path in field_table()}
    return next((conflict for conflict, _ in conflicts(values)), None)


def conflicts(values: Mapping[str, Any]) -> Iterator[tuple[_Conflict, tuple[str, ...]]]:
    """Yield the conflicts between fields and in the geometry, for the rules whose fields are all present.

    Args:
        values: valid fields by path ("gears.z_g").

    Yields each conflict with the paths of the fields that its rule uses.
    """
    yield from _field_conflicts(values)
    if not {*_MESH_FIELDS, "bearing.ring_h"} <= values.keys():
        return
    # rules that use gears.z_b do not apply to other tooth numbers
    meshes = values["gears.z_b"] - values["gears.z_g"] == 2
    tables: dict[str, dict[str, Any]] = {section: {} for section, _ in sections()}
    for path, value in values.items():
        section, name = path.split(".")
        tables[section][name] = value
    valid: dict[str, Any] = {section: model.model_construct(**tables[section]) for section, model in sections()}
    geometry = Geometry.of(Drive.model_construct(**valid))
    for rule, paths in MODEL_RULES.items():
        if meshes or "gears.z_b" not in paths:
            yield from ((conflict, paths) for conflict in rule(geometry))
    if {"bearing.d_ball", "bearing.N"} <= values.keys():
        fits = _bearing_fits(geometry, values["bearing.d_ball"], values["bearing.N"])
        yield from ((conflict, BEARING_FIELDS) for conflict in fits)


def _field_conflicts(values: Mapping[str, Any]) -> Iterator[tuple[_Conflict, tuple[str, ...]]]:
    """Yield the conflicts between fields, for the rules whose fields are all present.

    Args:
        values: valid fields by path ("gears.z_g").

    Yields each conflict with the paths of the fields that its rule uses.
    """
    path_of = {path.rpartition(".")[2]: path for path in values}
    for rule in FIELD_RULES:
        if not path_of.keys() >= set(rule.names):
            continue
        paths = tuple(path_of[name] for name in rule.names)
        fault = rule.fault(*(values[path] for path in paths))
        if fault:
            got = fault if isinstance(fault, str) else ""
            yield _Conflict(path=rule.path, message=rule.message, got=got, hint=rule.hint), paths
    for conflict in _measured_conflicts(values):
        yield conflict, ()
    yield from _lone_phases(values)


def _measured_conflicts(values: Mapping[str, Any]) -> Iterator[_Conflict]:
    """Yield conflicts of measured values with the drive's torques and with its seat."""
    if "mounting.holes" not in values:
        return
    torques = (values.get("operation.rated") or 0.0, *values.get("operation.M_g", ()))
    largest_torque = max(map(abs, torques))
    for key in values.get("measured.F_ior", ()):
        position, _, torque = key.partition("@")
        if abs(number_of(torque)) > _FARTHEST_MEASURED * largest_torque > 0:
            limit = f"{_FARTHEST_MEASURED:g} times the largest torque of the drive, {largest_torque:g} N*m"
            message = f"the torque of this value exceeds {limit}"
            yield _Conflict(
                path=f"measured.F_ior.{key}", message=message, got=key, hint="check that the torque is in N*m"
            )
        if fault := position_fault(position, values["mounting.holes"]):
            message, hint = fault
            yield _Conflict(
                path=f"measured.F_ior.{key}",
                message=message,
                got=key,
                hint=hint,
            )


def _lone_phases(values: Mapping[str, Any]) -> Iterator[tuple[_Conflict, tuple[str, ...]]]:
    """Yield a conflict for each phase of a harmonic without an amplitude."""
    for phase_path, phase in values.items():
        size_path = phase_path.replace("harmonics.xi_", "harmonics.a_")
        if size_path == phase_path or phase is None:
            continue
        if values.get(size_path, phase) is None:
            conflict = _Conflict(
                path=phase_path,
                message="the phase has no amplitude",
                got=f"{phase:g} deg",
                hint=f"state {size_path} in um, because a phase has no meaning without its amplitude",
            )
            yield conflict, (phase_path, size_path)


def _too_soft(C: float | None) -> str:
    """Return a stiffness C [N/mm] as text if it makes the equations ill-conditioned, otherwise an empty text."""
    return f"{C:g} N/mm" if C and C < _LEAST_SUPPORT else ""


def _too_small(
    end: float | None,
    rated: float | None,
    M_g: Sequence[float],
) -> str:
    """Return a torque that is too small to end a segment of the stiffness curve, as text, otherwise an empty text.

    end: end of the segment [N*m].
    rated: rated torque [N*m].
    M_g: torques of the drive [N*m].
    """
    least = _LEAST_END * (rated or max(map(abs, M_g), default=0.0))
    return f"{end:g} N*m; above {least:g} N*m" if end is not None and end <= least else ""


def _listed(numbers: set[float]) -> str:
    return ", ".join(f"{number:g}" for number in sorted(numbers))


_SOFT = "the support is too soft for the equations to be solved"
_HOLDS = f"use 0 if nothing supports the part, otherwise at least {_LEAST_SUPPORT:g} N/mm"
_SMALL = "the torque is too small for the end of a segment"
FIELD_RULES = (
    FieldRule(
        "gears.z_b",
        "the circular spline needs more teeth than the flexspline",
        lambda z_b, z_g: z_b <= z_g and f"z_b - z_g = {z_b - z_g}",
    ),
    FieldRule(
        "gears.z_b",
        "only drives with two waves and z_b - z_g = 2 are supported",
        lambda z_b, z_g: z_b > z_g and z_b != z_g + 2 and f"z_b - z_g = {z_b - z_g}; z_b: {z_g + 2}",
    ),
    FieldRule(
        "flexspline.l",
        "the shell must be longer than the tooth ring",
        lambda l, b_w: l <= b_w and f"l {l:g} mm, b_w {b_w:g} mm",
    ),
    FieldRule(
        path="bearing.ball_motion",
        message="rolling balls require bearing.d_ball",
        fault=lambda ball_motion, d_ball: ball_motion == "rolling" and d_ball is None,
        hint="state d_ball in mm",
    ),
    FieldRule(
        path="cam.coupling",
        message="the coupling overhung requires cam.shaft_d and cam.overhang",
        fault=lambda coupling, shaft_d, overhang, C_3: (
            coupling == "overhung" and C_3 is None and None in (shaft_d, overhang)
        ),
        hint="state both in mm, or supports.C_3",
    ),
    FieldRule(
        path="supports.C_1",
        message="C_1, C_2 and C_3 are all 0, so nothing supports the drive",
        fault=lambda C_1, C_2, C_3: C_1 == C_2 == C_3 == 0,
        hint="set at least one of them above 0",
    ),
    FieldRule(path="supports.C_1", message=_SOFT, fault=lambda C_1: _too_soft(C_1), hint=_HOLDS),
    FieldRule(path="supports.C_2", message=_SOFT, fault=lambda C_2: _too_soft(C_2), hint=_HOLDS),
    FieldRule(path="supports.C_3", message=_SOFT, fault=lambda C_3: _too_soft(C_3), hint=_HOLDS),
    FieldRule("operation.M_g", "needs at least one torque", lambda M_g: not M_g),
    FieldRule(
        path="operation.M_g",
        message="at a torque of 0, the rotation is undetermined within the clearance",
        fault=lambda M_g: 0 in M_g,
        hint="use a small torque, for example 1 % of the rated torque",
    ),
    FieldRule(
        "operation.M_g",
        "a torque is given twice",
        lambda M_g: _listed({torque for torque in M_g if M_g.count(torque) > 1}),
    ),
    FieldRule(
        path="tolerances.e_b",
        message="the runout of the circular spline is given twice",
        fault=lambda mark_kind, F_i2, e_b: (
            mark_kind == "runout" and F_i2 and e_b and f"F_i2 {F_i2:g} um, e_b {e_b:g} um"
        ),
        hint="give either F_i2 or e_b; with mounting.mark_kind: runout, F_i2 is the runout (twice e_b)",
    ),
    FieldRule("catalogue.T_1", _SMALL, lambda T_1, rated, M_g: _too_small(T_1, rated, M_g)),
    FieldRule("catalogue.T_2", _SMALL, lambda T_2, rated, M_g: _too_small(T_2, rated, M_g)),
    FieldRule(
        "catalogue.T_1",
        "the first segment must end below the second",
        lambda T_1, T_2: None not in (T_1, T_2) and T_1 >= T_2 and f"T_1 {T_1:g}, T_2 {T_2:g} N*m",
    ),
    FieldRule(
        path="mounting.allowed",
        message="the list of holes is empty",
        fault=lambda allowed: not allowed,
        hint="write all, or a list of hole numbers",
    ),
    FieldRule(
        path="mounting.allowed",
        message="a seat with a free mounting angle (holes: 0) has no holes",
        fault=lambda allowed, holes: allowed and allowed != "all" and not holes,
        hint="write all",
    ),
    FieldRule(
        "mounting.allowed",
        "the seat does not have these holes",
        lambda allowed, holes: (
            allowed != "all"
            and holes > 0
            and (beyond := _listed(set(allowed) - set(range(holes))))
            and f"{beyond}; its holes are 0 to {holes - 1}"
        ),
    ),
    FieldRule(
        "mounting.allowed",
        "a hole is given twice",
        lambda allowed: allowed != "all" and len(set(allowed)) < len(allowed),
    ),
    FieldRule(
        "numerics.n_2",
        "there are too few nodes for the bending modes",
        lambda n_2, n_max: n_2 < 2 * n_max and f"n_2 {n_2}, n_max {n_max}; use at least 2 n_max = {2 * n_max}",
    ),
)


# --- positions at which F'_ior was measured: holes of the seat, or rotations of the fixed wheel

_FARTHEST_TURN = 3600.0  # deg; largest plausible rotation of a wheel


def turn_of(position: str, holes: int) -> float:
    """Return the rotation [deg] of the fixed wheel to a position, or NaN if the position is invalid.

    position: hole of the seat ("h4") or angle in deg ("120").
    holes: number of holes of the seat.
    """
    number = number_of(position.removeprefix("h"))
    turn = number * 360 / holes if position.startswith("h") and holes else number
    return turn if position.startswith("h") or abs(turn) <= _FARTHEST_TURN else nan


def position_fault(position: str, holes: int) -> tuple[str, str] | None:
    """Return the reason why a position is not on the seat, with a hint, or None if it is.

    position: hole of the seat ("h4") or angle in deg ("120").
    holes: number of holes of the seat; 0 permits any angle.
    """
    number = number_of(position.removeprefix("h"))
    if position.startswith("h"):
        if not holes:
            return "the seat has no holes", "state an angle in deg, or set the number of holes in mounting.holes"
        return None if number in range(holes) else (f"the seat's holes are h0 to h{holes - 1}", "")
    turned = number * holes / 360
    if not holes or abs(turned - round(turned)) < 1e-9:
        return None
    return (
        f"{number:g} deg is not a hole of the seat; its holes are {360 / holes:g} deg apart",
        f"write h{round(number) % holes} for hole {round(number) % holes}",
    )


# --- the model's geometry


def _teeth_reach(geometry: Geometry) -> Iterator[_Conflict]:
    """Yield a conflict if the tips of the flexspline do not reach those of the circular spline at the major axis."""
    tip = geometry.r_ag
    rigid_tip = geometry.r_ab
    if tip + geometry.W_0 <= rigid_tip:
        yield _Conflict(
            path="cam.W_0",
            message="the teeth do not reach each other at the major axis",
            got=f"tip of the flexspline {tip + geometry.W_0:.4g} mm, of the circular spline {rigid_tip:.4g} mm",
            hint=f"use more than {rigid_tip - tip:.4g} mm with these teeth",
        )


def _tips_come_free(geometry: Geometry) -> Iterator[_Conflict]:
    """Yield a conflict if the tips do not pass each other at the minor axis."""
    tip = geometry.r_ag
    rigid_tip = geometry.r_ab
    if tip - geometry.W_0 >= rigid_tip:
        yield _Conflict(
            path="cam.W_0",
            message="the tips interfere: they do not clear each other at the minor axis",
            got=f"tip of the flexspline {tip - geometry.W_0:.4g} mm, of the circular spline {rigid_tip:.4g} mm",
            hint=f"use more than {tip - rigid_tip:.4g} mm with these teeth, or a smaller addendum (h_a)",
        )


def _roots_have_room(geometry: Geometry) -> Iterator[_Conflict]:
    """Yield a conflict for each tip that reaches the root of the opposite wheel at the major axis."""
    to_rigid = geometry.r_fb - geometry.r_ag
    to_flexspline = geometry.r_ab - geometry.r_f
    for wheel, opposite, room, tip, root in (
        ("flexspline", "circular spline", to_rigid, geometry.r_ag + geometry.W_0, geometry.r_fb),
        ("circular spline", "flexspline", to_flexspline, geometry.r_ab, geometry.r_f + geometry.W_0),
    ):
        if room < geometry.W_0:
            yield _Conflict(
                path="cam.W_0",
                message=f"the deflection is too large: the tips of the {wheel} reach the roots of the {opposite}",
                got=f"tip {tip:.4g} mm, root {root:.4g} mm",
                hint=f"use at most {room:.4g} mm with these teeth",
            )


def _flanks_exist(geometry: Geometry) -> Iterator[_Conflict]:
    """Yield a conflict for each wheel whose tips lie inside the base circle or whose teeth are pointed."""
    for path, name, wheel, tip, min_angle, max_angle in (
        ("gears.x_g", "flexspline", geometry.flexspline, geometry.r_ag, 0.0, np.inf),
        ("gears.x_b", "circular spline", geometry.rigid, geometry.r_ab, -np.inf, np.pi / geometry.rigid.z),
    ):
        if tip <= wheel.base_radius:
            yield _Conflict(
                path=path,
                message=f"the {name} has no involute flank: its tip lies inside the base circle",
                got=f"tip {tip:.4g} mm, base circle {wheel.base_radius:.4g} mm",
                hint="use a larger profile shift, or a smaller addendum",
            )
        elif not min_angle < wheel.half_angle(np.array(tip)) < max_angle:
            yield _Conflict(
                path=path,
                message=f"the teeth of the {name} are pointed",
                got="",
                hint="use another profile shift, or a smaller addendum",
            )


def _teeth_mesh(geometry: Geometry) -> Iterator[_Conflict]:
    """Yield a conflict if nominal flanks of the two wheels overlap anywhere between the axes."""
    wheels = (geometry.flexspline.base_radius, geometry.r_ag), (geometry.rigid.base_radius, geometry.r_ab)
    coarse = (_teeth_reach, _tips_come_free, _roots_have_room, _rim_is_thin)
    if any(base >= tip for base, tip in wheels) or any(any(rule(geometry)) for rule in coarse):
        return  # the other rules report these faults
    try:
        # the same arguments as in contact systems, so that the result is cached
        flanks = flank_candidates(geometry, 0.0)
    except UntrustedError:  # the tips just reach each other, but the flanks do not
        return
    least = int(np.argmin(flanks.gap))
    overlap = -flanks.gap[least] - geometry.j_n
    allowed_overlap = MAX_OVERLAP * geometry.flexspline.m
    if overlap > allowed_overlap:
        angle = abs(flanks.theta[least] - flanks.zone[least] * np.pi)
        yield _Conflict(
            path="cam.W_0",
            message="the teeth interfere: they overlap when the flexspline is deflected",
            got=f"an overlap of {overlap * 1e3:.3g} um at {np.degrees(angle):.3g}° from the major axis",
            hint=f"check W_0, m, x_g, x_b and h_a; an overlap of at most {allowed_overlap * 1e3:.3g} um is allowed",
        )


def _rim_is_thin(geometry: Geometry) -> Iterator[_Conflict]:
    """Yield a conflict if the rim is too thick for the theory of thin rings."""
    h_1 = 2 * (geometry.r_f - geometry.r_m)
    max_h_1 = _MAX_THICKNESS * geometry.r_f
    if h_1 > max_h_1:
        yield _Conflict(
            path="flexspline.h_1",
            message=f"the rim is too thick for a root radius of {geometry.r_f:.4g} mm",
            got=f"{h_1:g} mm",
            hint=f"use at most {max_h_1:.3g} mm",
        )


def _bearing_fits(
    geometry: Geometry,
    d_ball: float | None,
    N: int,
) -> Iterator[_Conflict]:
    """Yield a conflict if outer ring and balls do not fit the bore."""
    raceway = geometry.r_raceway
    ring_h = 2 * (geometry.r_ring - geometry.r_raceway)
    bore = raceway + ring_h
    if ring_h > _MAX_THICKNESS * bore:
        if bore > 0:
            yield _Conflict(
                path="bearing.ring_h",
                message=f"the ring is too thick for a bore with a radius of {bore:.4g} mm",
                got=f"{ring_h:g} mm",
                hint=f"use at most {_MAX_THICKNESS * bore:.3g} mm",
            )
    elif d_ball is not None:
        share = float(np.sin(np.pi / N))
        room = 2 * raceway * share / (1 + share)
        hint = f"use at most {room:.3g} mm for {N} balls"
        if d_ball >= raceway:
            message = f"the ball does not fit inside the raceway with a radius of {raceway:.4g} mm"
            yield _Conflict(
                path="bearing.d_ball",
                message=message,
                got=f"{d_ball:g} mm",
                hint=hint,
            )
        elif d_ball > room:
            yield _Conflict(
                path="bearing.d_ball", message=f"the bearing has no room for {N} balls", got=f"{d_ball:g} mm", hint=hint
            )


MODEL_RULES: dict[Callable[[Geometry], Iterator[_Conflict]], tuple[str, ...]] = {
    _teeth_reach: _TIPS,
    _tips_come_free: _TIPS,
    _roots_have_room: _ROOTS,
    _flanks_exist: _FLANKS,
    _teeth_mesh: _MESH_FIELDS,
    _rim_is_thin: _RIM_FIELDS,
}
