"""The instruction to the person at the bench, and the seat drawn with its holes."""

from __future__ import annotations

from math import cos, radians, sin

from hdassist.analysis.advice import Advice
from hdassist.analysis.mounting import Position
from hdassist.preset.drive import Drive
from hdassist.report.console import Look

WIDE, HIGH = 41, 15  # of the drawing, in characters


def wheel(drive: Drive) -> str:
    """The wheel that is fixed, in words."""
    return "rigid wheel" if drive.mounting.fixed == "rigid" else "flexspline"


def turn(position: Position) -> str:
    """The turn to a position by the shorter way: holes, degrees and direction."""
    way = position.short_way_deg
    direction = "counter-clockwise" if way > 0 else "clockwise"
    angle = f"{abs(way):g} deg"
    if position.hole is None:
        return f"{angle} {direction}"
    per_hole = position.rotation_deg / position.hole if position.hole else 360.0
    holes = round(abs(way) / per_hole)
    return f"{holes} {'hole' if holes == 1 else 'holes'} ({angle}) {direction}"


def instruction(advice: Advice) -> str:
    """One sentence: what to do with the wheel."""
    if not advice.worth_turning:
        return f"Leave the {wheel(advice.drive)} as it is."
    gains = ", ".join(
        f"F'_ior {now:.2f} -> {new:.2f} arcsec at {M_g:g} N·m"
        for M_g, now, new in zip(
            advice.curve.torques, advice.curve.current.F_ior_arcsec, advice.chosen.F_ior_arcsec, strict=True
        )
    )
    return f"Turn the {wheel(advice.drive)} by {turn(advice.chosen)}, seen from the cam side: {gains}."


def circle(advice: Advice, look: Look) -> str:
    """The seat seen from the cam side: its holes by number, the present (N), chosen (B) and worst (W) one marked.

    Hole 0 is where the wheel stands; it lies at mounting.first_hole, counted counter-clockwise from the right.
    """
    drive, curve = advice.drive, advice.curve
    canvas = [[" "] * WIDE for _ in range(HIGH)]
    holes = drive.mounting.holes
    marks = {round(p.rotation_deg, 3): letter for p, letter in (
        (curve.worst, "W"), (curve.current, "N"), (advice.chosen, "B"),
    )}  # fmt: skip
    angles = [360 * k / (holes or 24) for k in range(holes or 24)]
    for k, angle in enumerate(angles):
        label = str(k) if holes else "."
        usable = not holes or curve.allowed is None or k in curve.allowed
        _put(canvas, drive.mounting.first_hole + angle, label if usable else "x", 1.0)
    for angle, letter in marks.items():
        _put(canvas, drive.mounting.first_hole + angle, letter, 0.72)
    _put(canvas, 0, "+", 0.0)
    legend = "seat from the cam side: N now, B best, W worst; numbers count holes counter-clockwise from now"
    if any(c == "x" for row in canvas for c in row):
        legend += "; x not allowed"
    lines = ["".join(row).rstrip() for row in canvas]
    return look.text("\n".join([*lines, "", legend]))


def _put(canvas: list[list[str]], angle: float, text: str, radius: float) -> None:
    x = (WIDE - 1) / 2 * (1 + 0.9 * radius * cos(radians(angle)))
    y = (HIGH - 1) / 2 * (1 - 0.95 * radius * sin(radians(angle)))
    start = max(0, min(WIDE - len(text), round(x) - (len(text) - 1) // 2))
    canvas[round(y)][start : start + len(text)] = list(text)
