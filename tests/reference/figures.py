"""The drawings of docs/theory.md, from the model itself: vzp160 as it ships. Light or dark as the screen is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np

from benchmarks.bench_pictures import DARK, FIGURES, LIGHT, RULES, Point, at, box, circle, path, text
from hdassist import load_preset
from hdassist.drive.error.cycle import kinematic_error
from hdassist.drive.error.error_map import ErrorMap
from hdassist.drive.model.contacts import contact_system, flexspline_ring
from hdassist.drive.model.geometry import Array, Geometry, Kinematics, nominal_shape, pitch_locked_states
from hdassist.drive.solve.formulation import formulate
from hdassist.run.run import UNCHECKED
from tests.helpers.support import delta_p_of, load_case, solve_state

WIDTH, HEIGHT = 640, 330
AROUND = np.linspace(0, 2 * np.pi, 181)
LIGHT_LOAD, RATED = 80.0, 800.0  # N*m
BEARS = 1e-3  # of the greatest force on a flank: less is rounding
STEPS = 48  # positions of each wheel on the torus that are drawn
BANDS = (-0.75, -0.45, -0.15, 0.15, 0.45, 0.75)  # of half of F'_ior


def made() -> dict[Path, str]:
    """Each drawing by its path."""
    drawings = {
        "mesh-zones": ("Forces on flanks and balls around the ring", mesh_zones()),
        "ring-harmonics": ("Harmonics of the ring, and their stiffness", ring_harmonics()),
        "contact-sets": ("Flanks in contact over one input revolution", contact_sets()),
        "torus": ("The error over all positions of both splines before the wave generator", torus()),
    }
    return {FIGURES / f"{name}.svg": drawing(title, parts) for name, (title, parts) in drawings.items()}


def drawing(title: str, parts: Iterable[str]) -> str:
    """A drawing as SVG, with its colours for either kind of screen."""
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" role="img" '
        'font-family="sans-serif" stroke-width="1.4">',
        f"<title>{title}</title>",
        f"<style>text{{stroke:none}} {RULES.format(**LIGHT)} @media (prefers-color-scheme: dark) {{"
        f"{RULES.format(**DARK)}}}</style>",
        box(0, 0, WIDTH, HEIGHT, "paper"),
        *parts,
        "</svg>\n",
    ]
    return "\n".join(lines)


def curve(centre: Point, radii: Array) -> list[Point]:
    """Points of a closed curve by its radii at AROUND; 0 is the major axis, upwards."""
    return [at(centre, 90 + float(np.degrees(angle)), float(r)) for angle, r in zip(AROUND, radii, strict=True)]


def mesh_zones() -> Iterator[str]:
    """The rim on its cam, ten times as oval, with the forces on flanks (outside) and balls (inside) at both torques."""
    drive = load_preset("vzp160")
    system, geometry = contact_system(drive), Geometry.of(drive)
    scale, centres = 1.05, {LIGHT_LOAD: (160.0, 168.0), RATED: (480.0, 168.0)}  # px/mm
    w = nominal_shape(AROUND, drive.cam.W_0, geometry.r_m, geometry.curve)[0]
    for M_g, centre in centres.items():
        forces, _, _ = solve_state(system, M_g * 1e3, system.delta_p)
        flanks = system.at_places(forces[None])[0, : system.pairs]
        theta, side = (column[:: len(system.face.fall)] for column in (system.flanks.theta, system.flanks.side))
        yield text((centre[0], 24), f"{M_g:g} N·m", size=15)
        yield path("line", *curve(centre, scale * (geometry.r_m + 10 * w)))
        yield path("axis", *curve(centre, np.full(len(AROUND), scale * (geometry.r_m + 15))))
        longest = 34 / flanks.max()
        for angle, force, way in zip(theta, flanks, side, strict=True):
            if force > BEARS * flanks.max():
                start = at(centre, 90 + np.degrees(angle), scale * (geometry.r_m + 15))
                yield path("go" if way > 0 else "mark", start, at(start, 90 + np.degrees(angle), longest * force))
        balls = forces[system.balls]
        for angle, force in zip(system.ball_theta, balls, strict=True):
            r = scale * (geometry.r_raceway - 8 + 10 * drive.cam.W_0 * np.cos(2 * angle))
            spot = at(centre, 90 + np.degrees(angle), r)
            yield circle(spot, 4, "hole")
            if force > BEARS * balls.max():
                yield path("thin", spot, at(spot, 270 + np.degrees(angle), 30 * force / balls.max()))
        yield text((centre[0], 158), "zone at 0 above,", "weak", size=12)
        yield text((centre[0], 174), "zone at pi below", "weak", size=12)
        yield text((centre[0], 192), f"{flanks.max():.0f} N at most", "weak", size=12)
    yield text((320, 322), "flanks towards +theta blue, towards -theta red; balls within", "weak", size=12)


def ring_harmonics() -> Iterator[str]:
    """The first harmonics of the rim with its shell, and how stiff each is against the second."""
    ring = flexspline_ring(drive := load_preset("vzp160"), Geometry.of(drive))
    for k, n in enumerate((2, 3, 4, 6)):
        centre = (85.0 + 157 * k, 150.0)
        ratio = ring.stiffness[list(ring.order).index(n)] / ring.stiffness[list(ring.order).index(2)]
        yield path("axis", *curve(centre, np.full(len(AROUND), 58.0)))
        yield path("line", *curve(centre, 58 + 9 * np.cos(n * AROUND)))
        yield text((centre[0], 250), f"n = {n}")
        yield text((centre[0], 272), f"K_n = {ratio:.3g} K_2", "weak", size=13)
    yield text((320, 40), "w = A_n cos n theta (3), stiffness (4) and (5)", size=15)
    yield text((320, 312), "n = 0 is a uniform stretch, n = 1 a rigid displacement; n goes up to 40", "weak", size=12)


def contact_sets() -> Iterator[str]:
    """Which flanks bear in each state of a turn of the cam, at the light torque: a row for each tooth's flank."""
    drive = load_preset("vzp160")
    system, kinematics = contact_system(drive), Kinematics.of(drive)
    states = pitch_locked_states(kinematics, np.arange(kinematics.teeth_fixed))
    forces, _, _ = load_case(formulate(system), LIGHT_LOAD * 1e3).forces(delta_p_of(drive, system, states))
    flanks = system.at_places(forces)[:, : system.pairs]
    step = len(system.face.fall)
    zone, side, theta = (x[::step] for x in (system.flanks.zone, system.flanks.side, system.flanks.theta))
    bears = flanks > BEARS * flanks.max()
    left, wide, top, tall = 70.0, 540.0, 52.0, 104.0
    for place, words in ((0, "zone at 0"), (1, "zone at pi")):
        angles = theta[(zone == place) & bears.any(axis=0)] - np.pi * place
        low, high = angles.min(), angles.max()
        base = top + place * (tall + 26)
        yield box(left, base, wide, tall, "hole")
        yield text((left + 4, base - 6), words, "weak", "start", 12)
        for end, y in ((high, base + 10), (low, base + tall)):
            yield text((left - 6, y), f"{np.degrees(end):.0f}°", "weak", "end", 12)
        for k in np.flatnonzero((zone == place) & bears.any(axis=0)):
            y = base + 3 + (tall - 6) * (high - (theta[k] - np.pi * place)) / (high - low) - 1.6 * side[k]
            for first, length in runs(bears[:, k]):
                x = left + wide * first / len(states)
                yield path("go" if side[k] > 0 else "mark", (x, y), (x + wide * length / len(states), y))
    for turn in (0, 90, 180, 270, 360):
        yield text((left + wide * turn / 360, 300), f"{turn}°", "weak", size=12)
    yield text((320, 322), "input angle; flanks towards +theta blue, towards -theta red", "weak", size=12)
    yield text((320, 24), f"flanks in contact, {LIGHT_LOAD:g} N·m", size=15)


def runs(bears: Array) -> Iterator[tuple[int, int]]:
    """First state and length of each run of states in which a flank bears."""
    for value, group in groupby(range(len(bears)), key=lambda k: bool(bears[k])):
        found = list(group)
        if value:
            yield found[0], len(found)


def torus() -> Iterator[str]:
    """The error at the light torque by how both wheels stand before the cam, with the first two turns of the cycle."""
    search = ErrorMap(load_preset("vzp160"), LIGHT_LOAD)
    error = kinematic_error(search.drive, LIGHT_LOAD, run=UNCHECKED).error_arcsec
    low, high = error.min(), error.max()
    lines = [np.linspace(0, z, STEPS, endpoint=False) for z in search.board.shape]
    there = search.state(search.to_lattice(np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)))
    level = np.digitize((2 * error[there] - low - high) / (high - low), BANDS)
    left, top, cell = 60.0, 40.0, 5.0
    for k, row in enumerate(level):
        for value, group in groupby(range(STEPS), key=lambda i: int(row[i])):
            found = list(group)
            kind, strength = ("gone", 3 - value) if value < 3 else ("marked", value - 3)
            place = (left + cell * k, top + cell * (STEPS - 1 - found[-1]))
            if strength:
                shape = box(*place, cell, cell * len(found), kind)
                yield shape.replace("/>", f' fill-opacity="{(0.25, 0.55, 0.9)[strength - 1]}"/>')
    size = cell * STEPS
    yield box(left, top, size, size, "thin")
    for shift in (0.0, 2 * size / 200):  # of 200 pitches of the flexspline a turn of 202 ends 2 further on
        yield path("line", (left, top + size - shift), (left + size - shift, top))
    yield text((left + size / 2, top + size + 20), "circular spline, j mod 202", "weak", size=12)
    yield f'<g transform="translate({left - 12} {top + size / 2}) rotate(-90)">'
    yield text((0, 0), "flexspline, j mod 200", "weak", size=12) + "</g>"
    yield text((left + size / 2, 26), f"error at {LIGHT_LOAD:g} N·m", size=15)
    names = [f"{bound:+.2f}" for bound in BANDS]
    words = (
        f"below {names[0]}",
        *(f"{a} to {b}" for a, b in pairwise(names)),
        f"above {names[-1]}",
    )
    for value, word in enumerate(words):
        y = 70.0 + 24 * value
        kind, strength = ("gone", 3 - value) if value < 3 else ("marked", value - 3)
        opacity = (0, 0.25, 0.55, 0.9)[strength]
        yield box(350, y, 20, 18, kind).replace("/>", f' fill-opacity="{opacity}"/>') + box(350, y, 20, 18, "thin")
        yield text((380, y + 14), word, "weak", "start", 12)
    for y, word in (
        (56, f"of half of F'_ior = {high - low:.1f} arcsec"),
        (262, "opposite sides are one: the cycle runs along"),
        (278, "the diagonal, revolution by revolution,"),
        (294, "and meets all 20 200 positions in 100"),
    ):
        yield text((350, y), word, "weak", "start", 12)
