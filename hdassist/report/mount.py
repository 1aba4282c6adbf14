"""F'_ior against the mounting angle as plots and tables, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.analysis.mounting import FREE, Alternative, MountingCurve, Position
from hdassist.analysis.sensitivity import Sensitivity
from hdassist.preset.drive import Drive
from hdassist.report.console import Look, table
from hdassist.report.csvtext import to_csv
from hdassist.report.envelope import certificate_object, envelope
from hdassist.report.plot import curve

NOW, BEST = "now", "best"
Slopes = Mapping[str, Sequence[Sensitivity]]  # of a position, one for each torque


def _phase_words(drive: Drive) -> str:
    return "xi_b - phi_hb" if drive.mounting.fixed == "rigid" else "xi_g - phi_hg"


def _hole(drive: Drive, position: Position) -> int | None:
    """Holes that the wheel is turned by, where it is a whole number of them."""
    holes = position.rotation_deg * drive.mounting.holes / 360
    return round(holes) if drive.mounting.holes and abs(holes - round(holes)) < 1e-9 else None


def warnings(drive: Drive, result: MountingCurve, others: Sequence[Alternative] = ()) -> tuple[str, ...]:
    """What a reader should know beside the numbers."""
    hole = 360 / (drive.mounting.holes or FREE)
    phases = [result.recommended.phase_deg, *(other.recommended.phase_deg for other in others)]
    apart = [abs((phase - phases[0] + 180) % 360 - 180) for phase in phases]
    unsure = (
        "values that agree with the same calibration (alternatives) have their best position elsewhere, at the phases "
        f"{', '.join(f'{phase:g}' for phase in phases[1:])} deg: measure before relying on {phases[0]:g} deg"
    )
    total = result.missing + len(result.rotation_deg)
    undone = f"interrupted: {len(result.rotation_deg)} of {total} positions were done"
    if result.interrupted and not result.missing:
        undone = "interrupted: positions were searched, but not all of those named were solved in every state"
    found = [*([undone] if result.interrupted else []), *([unsure] if max(apart) > hole + 1e-9 else [])]
    return (*drive.origin.warnings, *found)


def exit_code(result: MountingCurve) -> int:
    """Exit code of the command: 130 where it was interrupted."""
    return 130 if result.interrupted else 0


def render(drive: Drive, result: MountingCurve, slopes: Slopes, look: Look, *, plots: bool = True) -> RenderableType:
    """A plot per torque, the best and worst position for each, and the recommendation for all."""
    wheel = "rigid wheel" if drive.mounting.fixed == "rigid" else "flexspline"
    parts: list[RenderableType] = [
        Text(look.text(f"{drive.name}: turning the fixed {wheel} on its seat"), style="bold")
    ]
    order = np.argsort(result.phase_deg)
    if plots and len(order) > 1:
        for M_g, values in zip(result.torques, result.F_ior_arcsec, strict=True):
            title = f"F'_ior at {M_g:g} N·m, arcsec"
            label = f"phase {_phase_words(drive)}, deg"
            parts.append(Text(curve(look, result.phase_deg[order], values[order], x_label=label, y_label=title)))
    parts += [_torques(result, look), _positions(drive, result, look)]
    if any(slopes.values()):
        parts.append(_slopes(result, slopes, look))
    proof = certificate_object(result.certificate, result.cross_checks)
    solved, places = int(result.every_state.sum()), result.every_state.size
    words = f"certificate: {proof['states']} states, greatest residual {proof['max_residual']:.1e} of its scale"
    if solved < places:
        words = f"every state solved at {solved} of {places} points of the curves, the others searched; {words}"
    if cross := proof["cross_check"]:
        words += f"; {cross['states']} again by {cross['solver']}: {cross['max_difference_arcsec']:.1e} arcsec apart"
    turns = "Rotations are counter-clockwise seen from the cam side, from where the wheel stands."
    parts += [Text(look.text(turns)), Text(words)]
    return Group(*(line for part in parts for line in (part, Text(""))))


def _torques(result: MountingCurve, look: Look) -> Table:
    grid = table(look, "each torque alone")
    grid.add_column(look.text("torque, N·m"), justify="right", no_wrap=True)
    for words in ("now, arcsec", "best, arcsec", "at phase, deg", "worst, arcsec", "at phase, deg"):
        grid.add_column(words, justify="right")
    for k, M_g in enumerate(result.torques):
        best, worst = result.extremes(k)
        numbers = (
            f"{result.current.F_ior_arcsec[k]:.2f}",
            f"{best.F_ior_arcsec[k]:.2f}",
            f"{best.phase_deg:g}",
            f"{worst.F_ior_arcsec[k]:.2f}",
            f"{worst.phase_deg:g}",
        )
        grid.add_row(f"{M_g:g}", *numbers)
    return grid


def _positions(drive: Drive, result: MountingCurve, look: Look) -> Table:
    grid = table(look, "all torques together (best for the torque served worst)")
    grid.add_column("position")
    for words in ("turn, deg", f"phase {_phase_words(drive)}, deg", "F'_ior, arcsec", "against now"):
        grid.add_column(words, justify="right")
    for words, position in ((NOW, result.current), (BEST, result.recommended), ("worst", result.worst)):
        values = " / ".join(f"{v:.2f}" for v in position.F_ior_arcsec)
        grid.add_row(
            words, f"{position.rotation_deg:g}", f"{position.phase_deg:g}", values, f"{gain(result, position):+.0%}"
        )
    return grid


def _slopes(result: MountingCurve, slopes: Slopes, look: Look) -> Table:
    grid = table(look, "what a micrometre more does to F'_ior, arcsec")
    grid.add_column("position")
    for words in ("torque, N·m", "flank clearance j_n", "wave W_0", "bearing clearance g_b"):
        grid.add_column(look.text(words), justify="right")
    for words, values in slopes.items():
        for M_g, slope in zip(result.torques, values, strict=True):
            grid.add_row(words, f"{M_g:g}", f"{slope.j_n:+.2f}", f"{slope.W_0:+.2f}", f"{slope.g_b:+.2f}")
    return grid


def gain(result: MountingCurve, position: Position) -> float:
    """Change of F'_ior against the present position, of the torque that is served worst."""
    return max(new / now for new, now in zip(position.F_ior_arcsec, result.current.F_ior_arcsec, strict=True)) - 1


def answer(
    drive: Drive, result: MountingCurve, slopes: Slopes, others: Sequence[Alternative], seed: int
) -> dict[str, Any]:
    """The curves and positions as a JSON object."""

    def position(p: Position, name: str = "") -> dict[str, Any]:
        told = {
            f"F_ior_{field}_arcsec_per_um": [getattr(slope, field) for slope in slopes[name]]
            for field in ("j_n", "W_0", "g_b")
            if name in slopes
        }
        return {
            "rotation_deg": p.rotation_deg,
            "phase_deg": p.phase_deg,
            "hole": _hole(drive, p),
            "F_ior_arcsec": list(p.F_ior_arcsec),
            **({"sensitivity": told} if told else {}),
        }

    return {
        **envelope("mount", drive, exit_code(result), warnings(drive, result, others)),
        "complete": not result.interrupted,
        "curves": [
            {
                "M_g_Nm": M_g,
                "phase_deg": result.phase_deg.tolist(),
                "F_ior_arcsec": values.tolist(),
                "every_state": every.tolist(),
            }
            for M_g, values, every in zip(result.torques, result.F_ior_arcsec, result.every_state, strict=True)
        ],
        "rotation_deg": result.rotation_deg.tolist(),
        "current": position(result.current, NOW),
        "recommended": position(result.recommended, BEST),
        "worst": position(result.worst),
        "alternatives": [{"values": o.values, **position(o.recommended)} for o in others],
        "gain": -gain(result, result.recommended),
        "certificate": certificate_object(result.certificate, result.cross_checks),
        "seed": seed,
    }


def csv(result: MountingCurve) -> str:
    """One row per torque and position."""
    rows = [
        [M_g, float(rotation), float(phase), float(value), int(every)]
        for M_g, values, solved in zip(result.torques, result.F_ior_arcsec, result.every_state, strict=True)
        for rotation, phase, value, every in zip(result.rotation_deg, result.phase_deg, values, solved, strict=True)
    ]
    return to_csv(["M_g_Nm", "rotation_deg", "phase_deg", "F_ior_arcsec", "every_state"], rows)


def brief(result: MountingCurve) -> str:
    """The answer alone: the rotation to make, in degrees."""
    return f"{result.recommended.rotation_deg:g}"
