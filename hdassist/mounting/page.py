"""The mounting advice as an instruction, plots and tables, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.error.sensitivity import Sensitivity
from hdassist.mounting.advice import Advice
from hdassist.mounting.card import CardFacts
from hdassist.mounting.positions import Chances, MountingCurve, Position
from hdassist.mounting.robust import Robust
from hdassist.mounting.seat_page import instruction, seat_text, wheel
from hdassist.terminal.answers import Json, certificate_object, cross_checked, envelope
from hdassist.terminal.console import Style, table
from hdassist.terminal.plot import curve
from hdassist.terminal.runs import Answer, Figures
from hdassist.terminal.texts import Texts, texts
from hdassist.terminal.wheels_page import heading, pitch_object

SHOWN = 6  # positions that the table of uncertainty lists, best first


def _phase_words(advice: Advice) -> str:
    rigid = advice.drive.mounting.fixed == "rigid"
    if advice.measured and advice.measured.fixed(advice.drive):
        return "mark - phi_hb" if rigid else "mark - phi_hg"
    return "xi_b - phi_hb" if rigid else "xi_g - phi_hg"


def warnings(advice: Advice, say: Texts | None = None) -> tuple[str, ...]:
    """What a reader should know beside the numbers."""
    result, found = advice.curve, list(advice.drive.origin.warnings)
    done = len(result.rotation_deg)
    if result.missing:
        found.append(f"interrupted: {done} of {result.missing + done} positions were done")
    elif result.interrupted:
        found.append("interrupted: positions were searched, but every state was not yet solved at the advised one")
    say = say or texts()
    if advice.measured and advice.drive.alternatives:
        found.append(say("warning.alternatives"))
    if advice.measured and not advice.drive.mounting.holes:
        found.append(say("warning.steps"))
    if advice.disagreeing:
        phases = ", ".join(say.number(other.recommended.phase_deg) for other in advice.disagreeing)
        found.append(say("warning.disagree", phases=phases, phase=say.number(advice.chosen.phase_deg)))
    return tuple(found)


def answer(advice: Advice, *, seed: int, plots: bool) -> Answer:
    """What there is to say of an advice; seed, of its samples; plots, whether seat and curves are drawn."""
    return Answer(
        to_json=lambda: to_json(advice, seed),
        page=lambda style: render(advice, style, plots=plots),
        summary_line=lambda: summary_line(advice),
        figures=lambda: figures(advice),
        warnings=warnings(advice),
        proof=advice.curve.certificate,
        exit_code=exit_code(advice),
    )


def exit_code(advice: Advice) -> int:
    """Exit code of the command: 130 where it was interrupted."""
    return 130 if advice.curve.interrupted else 0


def render(advice: Advice, style: Style, *, plots: bool = True) -> RenderableType:
    """The instruction, the seat, a plot per torque, and tables of the positions."""
    drive, result = advice.drive, advice.curve
    words = f"{drive.name}: turning the fixed {wheel(drive)} on its seat{heading(advice.measured)}"
    parts: list[RenderableType] = [Text(style.text(words), style="bold"), Text(style.text(instruction(advice.choice)))]
    if plots:
        parts.append(Text(seat_text(advice.choice, style)))
        parts += [Text(drawn) for drawn in _curves(advice, style)]
    parts += [_positions(advice, style), _torques(result, style)]
    if advice.robust:
        parts.append(_uncertain(advice, advice.robust, style))
    if advice.now:
        parts.append(_slopes(advice, style))
    turns = "Turns are counter-clockwise seen from the cam side, from where the wheel stands."
    parts += [Text(style.text(turns)), Text(_proof(result))]
    return Group(*(line for part in parts for line in (part, Text(""))))


def _curves(advice: Advice, style: Style) -> list[str]:
    result = advice.curve
    order = np.argsort(result.phase_deg)
    if len(order) < 2:
        return []
    label = f"phase {_phase_words(advice)}, deg"
    return [
        curve(style, result.phase_deg[order], values[order], x_label=label, y_label=f"F'_ior at {M_g:g} N·m, arcsec")
        for M_g, values in zip(result.torques, result.F_ior_arcsec, strict=True)
    ]


def _proof(result: MountingCurve) -> str:
    solved, places = int(result.every_state.sum()), result.every_state.size
    proof = result.certificate
    words = f"certificate: {proof.states} states, greatest residual {proof.max_residual:.1e} of its scale"
    words += cross_checked(result.cross_checks)
    if solved < places:
        words = f"every state solved at {solved} of {places} points of the curves, the others searched; {words}"
    return words


def _positions(advice: Advice, style: Style) -> Table:
    result = advice.curve
    grid = table(style, "positions (best for the torque served worst)")
    grid.add_column("position")
    for words in ("hole", "turn, deg", f"phase {_phase_words(advice)}, deg", "F'_ior, arcsec", "against now"):
        grid.add_column(words, justify="right")
    named = {"now": result.current, "best": advice.chosen, "second": advice.second, "worst": result.worst}
    for words, position in named.items():
        if position is None:
            continue
        values = " / ".join(f"{v:.2f}" for v in position.F_ior_arcsec)
        hole = "-" if position.hole is None else f"{position.hole}"
        grid.add_row(
            words,
            hole,
            f"{position.rotation_deg:g}",
            f"{position.phase_deg:g}",
            values,
            f"{position.change_from(result.current):+.0%}",
        )
    return grid


def _torques(result: MountingCurve, style: Style) -> Table:
    grid = table(style, "each torque alone")
    grid.add_column(style.text("torque, N·m"), justify="right", no_wrap=True)
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


def _uncertain(advice: Advice, sampled: Robust, style: Style) -> Table:
    result = advice.curve
    title = f"under uncertainty: {len(sampled.merits)} samples, {sampled.criterion.name}"
    if any(sampled.standard_error_arcsec):
        errors = " / ".join(f"{error:.2f}" for error in sampled.standard_error_arcsec)
        title += f"; interpolated, standard error {errors} arcsec"
    grid = table(style, title)
    for words in ("hole", "turn, deg", "best in, %", "error against now: expected", "5 %", "95 %"):
        grid.add_column(words, justify="right")
    low, high = np.quantile(sampled.merits, (0.05, 0.95), axis=0)
    for k in np.argsort(sampled.value, kind="stable")[:SHOWN]:
        position = result.at(sampled.places[k])
        hole = "-" if position.hole is None else f"{position.hole}"
        numbers = (f"{sampled.merits[:, k].mean():.2f}", f"{low[k]:.2f}", f"{high[k]:.2f}")
        share = f"{sampled.probability_best[k]:.0%}".rstrip("%")
        grid.add_row(hole, f"{position.rotation_deg:g}", share, *numbers)
    return grid


def _slopes(advice: Advice, style: Style) -> Table:
    grid = table(style, "what a micrometre more does to F'_ior, arcsec")
    grid.add_column("position")
    for words in ("torque, N·m", "flank clearance j_n", "wave W_0", "bearing clearance g_b"):
        grid.add_column(style.text(words), justify="right")
    for words, values in (("now", advice.now), ("best", advice.best)):
        for M_g, slope in zip(advice.curve.torques, values, strict=True):
            grid.add_row(words, f"{M_g:g}", f"{slope.j_n:+.2f}", f"{slope.W_0:+.2f}", f"{slope.g_b:+.2f}")
    return grid


def to_json(advice: Advice, seed: int) -> Json:
    """The curves and positions as a JSON object."""
    result, second = advice.curve, advice.second
    return {
        **envelope("mount", advice.drive, exit_code(advice), warnings(advice)),
        "complete": not result.interrupted,
        "pitch": pitch_object(advice.measured),
        "instruction": instruction(advice.choice),
        "turn": advice.worth_turning,
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
        "current": _position(result.current, advice.now),
        "recommended": _position(advice.chosen, advice.best),
        "second": None if second is None else _position(second),
        "worst": _position(result.worst),
        "weights": None if result.weights is None else list(result.weights),
        "uncertainty": _robust(advice),
        "alternatives": [{"values": o.values, **_position(o.recommended)} for o in advice.others],
        "gain": advice.gain,
        "certificate": certificate_object(result.certificate, result.cross_checks),
        "seed": seed,
    }


def _position(position: Position, slopes: Sequence[Sensitivity] = ()) -> Json:
    told = {
        f"F_ior_{field}_arcsec_per_um": [getattr(slope, field) for slope in slopes] for field in ("j_n", "W_0", "g_b")
    }
    return {
        "rotation_deg": position.rotation_deg,
        "phase_deg": position.phase_deg,
        "hole": position.hole,
        "F_ior_arcsec": list(position.F_ior_arcsec),
        **({"sensitivity": told} if slopes else {}),
    }


def _robust(advice: Advice) -> Json | None:
    sampled, result = advice.robust, advice.curve
    if sampled is None:
        return None
    low, high = np.quantile(sampled.merits, (0.05, 0.95), axis=0)
    return {
        "samples": len(sampled.merits),
        "criterion": sampled.criterion.name,
        "standard_error_arcsec": list(sampled.standard_error_arcsec),
        "fields": dict(advice.drive.uncertainty),
        "probability_gain": sampled.probability_gain,
        "positions": [
            {
                "rotation_deg": result.at(place).rotation_deg,
                "hole": result.at(place).hole,
                "probability_best": float(sampled.probability_best[k]),
                "expected_relative": float(sampled.merits[:, k].mean()),
                "relative_5_percent": float(low[k]),
                "relative_95_percent": float(high[k]),
                "expected_loss": sampled.loss(place),
                "F_ior_expected_arcsec": sampled.F_ior_arcsec[:, :, k].mean(axis=0).tolist(),
            }
            for k, place in enumerate(sampled.places)
        ],
    }


def figures(advice: Advice) -> Figures:
    """Header and rows of a table, one row per torque and position."""
    result = advice.curve
    rows = [
        [M_g, float(rotation), float(phase), float(value), int(every)]
        for M_g, values, solved in zip(result.torques, result.F_ior_arcsec, result.every_state, strict=True)
        for rotation, phase, value, every in zip(result.rotation_deg, result.phase_deg, values, solved, strict=True)
    ]
    return ["M_g_Nm", "rotation_deg", "phase_deg", "F_ior_arcsec", "every_state"], rows


def summary_line(advice: Advice) -> str:
    """The answer alone: the hole to turn the wheel to, or the angle in degrees where the seat has no holes; 0: stay."""
    target = advice.choice.target
    return f"{target.rotation_deg:g}" if target.hole is None else f"{target.hole}"


def card_facts(advice: Advice, say: Texts) -> CardFacts:
    """What the assembly card tells of an advice; say, the texts of its language."""
    drive, sampled = advice.drive, advice.robust
    rigid = drive.mounting.fixed == "rigid"
    offset, cam = ("e_hb", "phi_hb") if rigid else ("e_hg", "phi_hg")
    chances = None
    if sampled:
        best = dict(zip(sampled.places, map(float, sampled.probability_best), strict=True))
        chances = Chances(len(sampled.merits), best[sampled.recommended], best.get(0), sampled.probability_gain)
    return CardFacts(
        choice=advice.choice,
        cam_deg=getattr(drive.phases, cam) if getattr(drive.tolerances, offset) else None,
        measured=advice.measured,
        chances=chances,
        weights=advice.curve.weights,
        warnings=warnings(advice, say),
    )
