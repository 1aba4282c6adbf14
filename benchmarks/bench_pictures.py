"""Drawings of a drive and of a test rig for README and docs: `python -m benchmarks.bench_pictures`.

Their colours follow the light or dark scheme of the screen.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, radians, sin
from pathlib import Path

FIGURES = Path(__file__).parents[1] / "docs/figures"
HOLES = 12
LIGHT = {"paper": "#ffffff", "ink": "#24292e", "soft": "#d0d7de", "weak": "#57606a", "go": "#0550ae", "mark": "#b03a2e"}
DARK = {"paper": "#16191d", "ink": "#e6edf3", "soft": "#3d444d", "weak": "#9198a1", "go": "#79c0ff", "mark": "#ff9492"}
RULES = """
text{{fill:{ink}}} .paper{{fill:{paper}}} .solid{{fill:{ink}}} .weak{{fill:{weak}}} .gone{{fill:{go}}}
.marked{{fill:{mark}}}
.body{{fill:{soft};stroke:{ink}}} .hole{{fill:{paper};stroke:{ink}}} .line{{fill:none;stroke:{ink}}}
.thin{{fill:none;stroke:{weak}}} .axis{{fill:none;stroke:{weak};stroke-dasharray:5 4}}
.flex{{fill:{paper};stroke:{ink};stroke-width:1.3}} .zone{{fill:none;stroke:{mark};stroke-width:9;stroke-opacity:.45}}
.go{{fill:none;stroke:{go};stroke-width:3}} .mark{{fill:none;stroke:{mark};stroke-width:2.5}}"""
Point = tuple[float, float]


def at(centre: Point, angle_deg: float, distance: float) -> Point:
    """Return the point of a drawing at an angle (counter-clockwise from the right) and a distance from a centre.

    The y axis of a drawing points downwards.
    """
    return centre[0] + distance * cos(radians(angle_deg)), centre[1] - distance * sin(radians(angle_deg))


def text(place: Point, words: str, kind: str = "", anchor: str = "middle", size: int = 14) -> str:
    x, y = place
    return f'<text x="{x:.1f}" y="{y:.1f}" class="{kind}" text-anchor="{anchor}" font-size="{size}">{words}</text>'


def circle(centre: Point, radius: float, kind: str) -> str:
    return f'<circle cx="{centre[0]:.1f}" cy="{centre[1]:.1f}" r="{radius:g}" class="{kind}"/>'


def path(kind: str, *points: Point) -> str:
    way = "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
    return f'<path class="{kind}" d="M{way}"/>'


def box(left: float, top: float, width: float, height: float, kind: str = "body") -> str:
    return f'<rect x="{left:g}" y="{top:g}" width="{width:g}" height="{height:g}" class="{kind}"/>'


def head(tip: Point, direction_deg: float, kind: str, size: float = 11) -> str:
    """Return the head of an arrow."""
    corners = [tip, *(at(tip, direction_deg + side, size) for side in (155, -155))]
    return f'<polygon class="{kind}" points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in corners)}"/>'


def arrow(start: Point, angle_deg: float, length: float, line: str, end: str) -> Iterator[str]:
    yield path(line, start, at(start, angle_deg, length - 6))
    yield head(at(start, angle_deg, length), angle_deg, end)


def turn(centre: Point, radius: float, first: float, last: float) -> Iterator[str]:
    """Yield an arrow around a centre from the first to the last angle, counter-clockwise if the last is larger."""
    sense = 1 if last > first else -1
    (x, y), (u, v) = at(centre, first, radius), at(centre, last - 3 * sense, radius)
    wide = int(abs(last - first) > 180)
    yield f'<path class="go" d="M{x:.1f} {y:.1f}A{radius} {radius} 0 {wide} {int(sense < 0)} {u:.1f} {v:.1f}"/>'
    yield head(at(centre, last, radius), last + 90 * sense, "gone")


def wavy(centre: Point, radius: float, wave: float, teeth: int, depth: float, kind: str) -> str:
    """Return a closed line of teeth around a centre, with the radius largest above and below.

    At the top is a tooth if teeth point outwards, and a space if they point inwards (negative depth).

    centre: centre of the line.
    radius: mean radius.
    wave: amplitude of the change of the radius, which has two periods around the centre.
    teeth: number of teeth.
    depth: height of a tooth, negative if teeth point inwards.
    kind: class of the line.
    """
    points = []
    for k in range(4 * teeth):
        angle = 90 + 90 * (k - 0.5) / teeth
        tooth = depth if (k % 4 in (0, 1)) is (depth > 0) else 0.0
        points.append(at(centre, angle, radius + wave * cos(radians(2 * angle - 180)) + tooth))
    return path(kind, *points, points[0])


def drive() -> Iterator[str]:
    """Yield a drive, seen from the wave generator side: wheel with holes, flexspline in two mesh zones, bearing."""
    centre, teeth = (225.0, 225.0), 60
    yield circle(centre, 205, "body") + wavy(centre, 142, 0, teeth + 2, -10, "hole")
    for hole in range(HOLES):
        yield circle(at(centre, 360 * hole / HOLES, 176), 11, "hole")
    yield circle(at(centre, 0, 176), 7, "marked")
    yield from turn(centre, 155, 4, 116)
    yield circle(at(centre, 120, 176), 11, "hole") + circle(at(centre, 120, 176), 5, "gone")
    yield wavy(centre, 118, 7.5, teeth, 9, "flex")
    inner = [at(centre, k, 108 + 7.5 * cos(radians(2 * k - 180))) for k in range(0, 363, 3)]
    yield path("hole", *inner)
    for ball in range(24):
        angle = 15 * ball + 7.5
        yield circle(at(centre, angle, 97 + 7.5 * cos(radians(2 * angle - 180))), 9, "line")
    yield path("body", *(at(centre, k, 82 + 7.5 * cos(radians(2 * k - 180))) for k in range(0, 363, 3)))
    yield circle(centre, 20, "hole")
    yield from turn(centre, 52, 160, 30)
    for up in (90, 270):
        zone = [at(centre, angle, 134) for angle in range(up - 24, up + 25, 2)]
        yield path("zone", *zone)
    words = (
        (at(centre, 68, 190), 44, "fixed wheel", "circular spline, 202 teeth inside, bolted to the housing"),
        (at(centre, 0, 176), 109, "hole 0", "where its marked screw hole is now"),
        (None, 174, "hole 4", "bolted here instead, the same parts are more or less"),
        (None, 192, "", "accurate: hdassist finds the hole with the smallest error"),
        (at(centre, -21, 124), 257, "flexspline", "200 teeth outside, thin and elastic, drives the output"),
        (at(centre, -33, 91), 322, "ball bearing and wave generator", "the oval wave generator presses the flexspline"),
        (None, 340, "", "into the circular spline above and below"),
        (at(centre, -78, 137), 405, "two mesh zones", "teeth touch only here; the zones rotate with the input"),
    )
    for start, y, name, role in words:
        if start:
            yield path("thin", start, (452, y - 5)) + circle(start, 2.5, "solid")
        if name:
            yield text((460, y), name, "" if start else "gone", "start", 17)
        yield text((460, y + 20), role, "weak", "start", 13)


def cam_side() -> Iterator[str]:
    """Yield a section along the axis with the viewer, and the same rotation seen from both sides."""
    axis = 165.0
    for up in (-1, 1):  # upper and lower half of the section
        yield box(150, axis + up * 90 - 16, 46, 32)  # circular spline
        yield path("line", (152, axis + up * 70), (330, axis + up * 66), (330, axis + up * 14))  # flexspline
        yield path("line", (152, axis + up * 63), (322, axis + up * 59), (322, axis + up * 14))
        yield box(156, axis + up * 52 - 8, 34, 16, "hole")  # flexible bearing
    yield box(156, axis - 44, 34, 88)  # wave generator
    yield box(96, axis - 10, 60, 20)
    yield box(322, axis - 14, 68, 28)
    yield path("axis", (70, axis), (405, axis))
    yield f'<path class="line" d="M22 {axis}q22 -22 44 0q-22 22 -44 0Z"/>' + circle((46, axis), 7, "solid")
    yield text((58, axis - 34), "you", "gone", size=15)
    yield text((80, axis + 36), "wave generator side", "gone")
    for place, words, weak in (
        ((173, 46), "circular spline", ""), ((258, 135), "flexspline", ""), ((356, 205), "output", ""),
        ((94, 112), "wave generator", ""),
    ):  # fmt: skip
        yield text((place[0], place[1] - (16 if weak else 0)), words)
        yield text(place, weak, "weak", size=12) if weak else ""
    for left, title, first, last, word in (
        (500, "from the wave generator side", 20, 130, "counter-clockwise"),
        (690, "from the other side", 160, 50, "clockwise"),
    ):  # fmt: skip
        centre = (left, 165.0)
        yield circle(centre, 62, "line") + circle(centre, 46, "thin") + circle(centre, 3, "solid")
        yield from turn(centre, 78, first, last)
        yield text((left, 58), title)
        yield text((left, 268), word, "gone")
    yield text((595, 296), "the same rotation of the wheel", "weak")


def seat(centre: Point, turned: int) -> Iterator[str]:
    """Yield the seat with numbered holes, and the wheel in it; turned: hole at its marked screw hole."""
    yield circle(centre, 118, "body") + circle(centre, 92, "hole")
    for hole in range(HOLES):
        angle = 360 * hole / HOLES
        place = at(centre, angle, 105)
        yield circle(place, 9, "hole")
        yield text((at(centre, angle, 136)[0], at(centre, angle, 136)[1] + 5), str(hole), "", size=16)
    angle = 360 * turned / HOLES
    yield path("mark", at(centre, angle, 58), at(centre, angle, 95)) + circle(at(centre, angle, 105), 6, "marked")
    name = at(centre, angle, 46)
    yield text((name[0], name[1] + 6), "dot", "marked", size=15)


def holes() -> Iterator[str]:
    """Yield the wheel in hole 0 and in hole 4."""
    for left, hole, title, below in (
        (180, 0, "hole 0: where the wheel is now", "numbers on the housing, a paint dot on the wheel"),
        (540, 4, "hole 4: four holes counter-clockwise", "both seen from the wave generator side"),
    ):
        centre = (left, 205.0)
        yield from seat(centre, hole)
        yield from turn(centre, 74, 0, 360 * hole / HOLES) if hole else ()
        yield circle(centre, 3, "solid")
        yield text((left, 30), title, size=15)
        yield text((left, 380), below, "weak")


def marks() -> Iterator[str]:
    """Yield the directions of a runout and of the wave generator eccentricity, counted from hole 0."""
    centre, xi, phi = (200.0, 190.0), 60.0, 215.0
    teeth = at(centre, xi, 16)
    yield circle(centre, 140, "thin") + circle(teeth, 112, "line")
    yield path("axis", centre, (centre[0] + 165, centre[1]))
    yield text((centre[0] + 172, centre[1] + 5), "x, hole 0", anchor="start")
    yield from arrow(centre, xi, 152, "mark", "marked")
    yield text((at(centre, xi, 170)[0], at(centre, xi, 170)[1] + 4), "M", "marked", size=18)
    yield from turn(centre, 52, 0, xi)
    yield text(at(centre, 24, 84), "xi_b", "gone", size=15)
    yield from arrow(centre, phi, 64, "line", "solid")
    yield text((at(centre, phi, 78)[0], at(centre, phi, 78)[1] + 5), "C", size=18)
    yield circle(centre, 4, "solid")
    words = (
        ("M", "marked", "teeth of the circular spline are"), ("", "", "furthest from the axis here:"),
        ("", "", "phases.xi_b, mark_kind: runout"), ("C", "", "direction of the eccentricity of the"),
        ("", "", "wave generator: phases.phi_hb,"), ("", "", "usually unknown: trials find it"),
    )  # fmt: skip
    for line, (letter, kind, told) in enumerate(words):
        y = 96 + 26 * line + (22 if line > 2 else 0)
        yield text((480, y), letter, kind, size=18)
        yield text((502, y), told, anchor="start", size=15)


def rig() -> Iterator[str]:
    """Yield the parts of a test rig in a row along the axis."""
    axis = 110.0
    yield path("line", (60, axis), (640, axis))
    parts = (
        (30, 70, "motor", "slow, one way"), (150, 40, "encoder 1", "input"), (280, 110, "drive", "bolted as in use"),
        (470, 40, "encoder 2", "output"), (580, 56, "drum", "constant torque"),
    )  # fmt: skip
    for left, width, name, role in parts:
        tall = {"drive": 62, "drum": 50}.get(name, 34)
        yield box(left, axis - tall, width, 2 * tall)
        yield text((left + width / 2, 34), name, "gone" if "encoder" in name else "", size=15)
        yield text((left + width / 2, 196), role, "weak", size=13)
    yield path("line", (580 + 56, axis - 48), (672, axis - 48), (672, axis + 30))
    yield box(656, axis + 30, 32, 36) + text((672, axis + 53), "m g", "", size=12)


DRAWINGS = {
    "drive": (drive, 850, 450, "A harmonic drive, seen from the wave generator side"),
    "bench-cam-side": (cam_side, 790, 312, "Section of a drive, and a rotation seen from both sides"),
    "bench-holes": (holes, 720, 400, "Holes are numbered counter-clockwise, seen from the wave generator side"),
    "bench-mark": (marks, 770, 360, "Directions of marks are measured counter-clockwise from hole 0"),
    "bench-rig": (rig, 720, 216, "Test rig: motor, input encoder, drive, output encoder, drum with a weight"),
}


def drawn(name: str) -> str:
    """Return a drawing as SVG; name: key of DRAWINGS."""
    draw, width, height, title = DRAWINGS[name]
    dark = "@media (prefers-color-scheme: dark) {" + RULES.format(**DARK) + "}"
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" role="img" '
        'font-family="sans-serif" stroke-width="1.6">',
        f"<title>{title}</title>",
        f"<style>text{{stroke:none}} {RULES.format(**LIGHT)} {dark}</style>",
        f'<rect class="paper" width="{width}" height="{height}" rx="8"/>',
        *filter(None, draw()),
        "</svg>\n",
    ]
    return "\n".join(parts)


def main() -> None:
    for name in DRAWINGS:
        (FIGURES / f"{name}.svg").write_text(drawn(name), encoding="utf-8")


if __name__ == "__main__":
    main()
