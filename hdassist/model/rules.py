"""Rules that the fields of a drive satisfy together: teeth that mesh, rings that fit, by the model's geometry.

Beside each rule stand the fields that it looks at. Lengths in mm, angles in rad.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from hdassist.errors import UntrustedError
from hdassist.model.geometry import Geometry, flank_candidates
from hdassist.preset.fields import Drive, field_table, sections
from hdassist.preset.rules import Conflict, field_conflicts

_MAX_THICKNESS = 0.2  # of its radius: beyond that the theory of thin rings does not hold
MAX_OVERLAP = 0.1  # modules that nominal teeth may overlap: the rings give way by some of it

_PROFILES = ("gears.m", "gears.z_g", "gears.z_b", "gears.x_g", "gears.x_b", "gears.h_a")
_TIPS = (*_PROFILES, "cam.W_0")
_ROOTS = (*_PROFILES, "gears.h_f", "cam.W_0")
_FLANKS = (*_PROFILES, "gears.alpha")
_WARMTH = ("material.alpha_T", "operation.dT")
_MESH_FIELDS = (*_ROOTS, *_WARMTH, "flexspline.h_1", "gears.alpha", "gears.j_n", "numerics.nominal_curve")
_RIM_FIELDS = ("gears.m", "gears.z_g", "gears.x_g", "gears.h_f", "flexspline.h_1")
BEARING_FIELDS = (*_RIM_FIELDS, "bearing.ring_h", "bearing.d_ball", "bearing.N")


def first_conflict(drive: Drive) -> Conflict | None:
    """First conflict between the fields of a drive; None where they go together."""
    values = {path: drive.value(path) for path in field_table()}
    return next((conflict for conflict, _ in conflicts(values)), None)


def conflicts(values: Mapping[str, Any]) -> Iterator[tuple[Conflict, tuple[str, ...]]]:
    """Conflicts between fields, of the rules whose fields are all there.

    Arguments: values, the valid fields by their path ("gears.z_g").
    Result: each conflict with the paths of the fields that its rule has looked at.
    """
    yield from field_conflicts(values)
    if not {*_MESH_FIELDS, "bearing.ring_h"} <= values.keys():
        return
    meshes = values["gears.z_b"] - values["gears.z_g"] == 2  # other teeth have no such rule
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


def _teeth_reach(geometry: Geometry) -> Iterator[Conflict]:
    """At the major axis the tips of the flexspline reach behind the tips of the rigid wheel."""
    tip, other = geometry.r_ag, geometry.r_ab
    if tip + geometry.W_0 <= other:
        yield Conflict(
            "cam.W_0", "the teeth do not reach each other at the major axis",
            f"tip of the flexspline {tip + geometry.W_0:.4g} mm, of the rigid wheel {other:.4g} mm",
            f"above {other - tip:.4g} mm with these teeth",
        )  # fmt: skip


def _tips_come_free(geometry: Geometry) -> Iterator[Conflict]:
    """At the minor axis the tips pass each other."""
    tip, other = geometry.r_ag, geometry.r_ab
    if tip - geometry.W_0 >= other:
        yield Conflict(
            "cam.W_0", "the tips interfere: they do not come free at the minor axis",
            f"tip of the flexspline {tip - geometry.W_0:.4g} mm, of the rigid wheel {other:.4g} mm",
            f"above {tip - other:.4g} mm with these teeth, or lower teeth (h_a)",
        )  # fmt: skip


def _roots_have_room(geometry: Geometry) -> Iterator[Conflict]:
    """At the major axis no tip runs into the root of the other wheel."""
    to_rigid, to_flexspline = geometry.r_fb - geometry.r_ag, geometry.r_ab - geometry.r_f
    for wheel, other, room, tip, root in (
        ("flexspline", "rigid wheel", to_rigid, geometry.r_ag + geometry.W_0, geometry.r_fb),
        ("rigid wheel", "flexspline", to_flexspline, geometry.r_ab, geometry.r_f + geometry.W_0),
    ):
        if room < geometry.W_0:
            yield Conflict(
                "cam.W_0", f"beyond the teeth: the {wheel} runs into the root of the {other}",
                f"tip {tip:.4g} mm, root {root:.4g} mm", f"at most {room:.4g} mm with these teeth",
            )  # fmt: skip


def _flanks_exist(geometry: Geometry) -> Iterator[Conflict]:
    """The tips lie outside the base circles, and no tooth is pointed."""
    for path, words, wheel, tip, least, most in (
        ("gears.x_g", "flexspline", geometry.flexspline, geometry.r_ag, 0.0, np.inf),
        ("gears.x_b", "rigid wheel", geometry.rigid, geometry.r_ab, -np.inf, np.pi / geometry.rigid.z),
    ):
        if tip <= wheel.base_radius:
            yield Conflict(
                path, f"the {words} has no involute flank: its tip lies inside the base circle",
                f"tip {tip:.4g} mm, base circle {wheel.base_radius:.4g} mm",
                "a larger profile shift, or lower teeth",
            )  # fmt: skip
        elif not least < wheel.half_angle(np.array(tip)) < most:
            yield Conflict(path, f"the teeth of the {words} are pointed", "", "another profile shift, or lower teeth")


def _teeth_mesh(geometry: Geometry) -> Iterator[Conflict]:
    """Nowhere between the axes do the nominal flanks and tips of the two wheels run through each other."""
    wheels = (geometry.flexspline.base_radius, geometry.r_ag), (geometry.rigid.base_radius, geometry.r_ab)
    coarse = (_teeth_reach, _tips_come_free, _roots_have_room, _rim_is_thin)
    if any(base >= tip for base, tip in wheels) or any(any(rule(geometry)) for rule in coarse):
        return  # faults of the other rules
    try:
        flanks = flank_candidates(geometry, 0.0)  # as contact systems ask for them
    except UntrustedError:  # the tips just reach each other, the flanks do not
        return
    least = int(np.argmin(flanks.gap))
    overlap, most = -flanks.gap[least] - geometry.j_n, MAX_OVERLAP * geometry.flexspline.m
    if overlap > most:
        angle = abs(flanks.theta[least] - flanks.zone[least] * np.pi)
        yield Conflict(
            "cam.W_0", "the teeth interfere: they run through each other under the shape the cam gives",
            f"an overlap of {overlap * 1e3:.3g} um at {np.degrees(angle):.3g}° from the major axis",
            f"at most {most * 1e3:.3g} um; check W_0 with m, x_g, x_b and h_a",
        )  # fmt: skip


def _rim_is_thin(geometry: Geometry) -> Iterator[Conflict]:
    """The rim is a thin ring."""
    h_1, most = 2 * (geometry.r_f - geometry.r_m), _MAX_THICKNESS * geometry.r_f
    if h_1 > most:
        yield Conflict(
            "flexspline.h_1", f"too thick for a rim with a root radius of {geometry.r_f:.4g} mm",
            f"{h_1:g} mm", f"at most {most:.3g} mm",
        )  # fmt: skip


def _bearing_fits(geometry: Geometry, d_ball: float | None, N: int) -> Iterator[Conflict]:
    """Outer ring and balls have room in the bore."""
    raceway, ring_h = geometry.r_raceway, 2 * (geometry.r_ring - geometry.r_raceway)
    bore = raceway + ring_h
    if ring_h > _MAX_THICKNESS * bore:
        if bore > 0:
            yield Conflict(
                "bearing.ring_h", f"too thick for a bore with a radius of {bore:.4g} mm",
                f"{ring_h:g} mm", f"at most {_MAX_THICKNESS * bore:.3g} mm",
            )  # fmt: skip
    elif d_ball is not None:
        share = float(np.sin(np.pi / N))
        room = 2 * raceway * share / (1 + share)
        hint = f"at most {room:.3g} mm for {N} balls"
        if d_ball >= raceway:
            message = f"does not fit inside the raceway with a radius of {raceway:.4g} mm"
            yield Conflict("bearing.d_ball", message, f"{d_ball:g} mm", hint)
        elif d_ball > room:
            yield Conflict("bearing.d_ball", f"no room for {N} balls in the bearing", f"{d_ball:g} mm", hint)


MODEL_RULES: dict[Callable[[Geometry], Iterator[Conflict]], tuple[str, ...]] = {
    _teeth_reach: _TIPS,
    _tips_come_free: _TIPS,
    _roots_have_room: _ROOTS,
    _flanks_exist: _FLANKS,
    _teeth_mesh: _MESH_FIELDS,
    _rim_is_thin: _RIM_FIELDS,
}
