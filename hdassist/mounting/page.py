"""The mounting advice as an instruction, plots and tables, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.error.rests_on import LEAST
from hdassist.error.sensitivity import Sensitivity
from hdassist.model.deviations import standing_offset
from hdassist.model.unknown import names
from hdassist.mounting.advice import Advice
from hdassist.mounting.card import CardFacts, warnings_of
from hdassist.mounting.losses import Losses
from hdassist.mounting.losses_page import beside, kept_line, losses_object, losses_table
from hdassist.mounting.positions import MountingCurve, Position, bare
from hdassist.mounting.seat_page import TRADE, instruction, place, seat_text, wheel
from hdassist.mounting.stays_page import stays_line, stays_objects, stays_table
from hdassist.terminal.answers import Json, certificate_object, cross_checked, envelope
from hdassist.terminal.basis import unknown_objects
from hdassist.terminal.brief import again, facts, proof
from hdassist.terminal.console import Style, TextTable, grid
from hdassist.terminal.plot import curve
from hdassist.terminal.runs import Answer, Figures
from hdassist.terminal.texts import Texts, texts
from hdassist.terminal.wheels_page import heading, pitch_object
from hdassist.verdict import Verdict

MICROMETRES = {"j_n": "flank clearance j_n", "W_0": "wave W_0", "g_b": "bearing clearance g_b"}
TURNS = "Turns are counter-clockwise seen from the side of the cam (wave generator), from where the wheel stands."
SHOWN = 6  # positions that the table of uncertainty lists, best first


def _phase_words(advice: Advice) -> str:
    symbol, cam = ("xi_b", "phi_hb") if advice.drive.mounting.fixed == "rigid" else ("xi_g", "phi_hg")
    return f"{'mark' if advice.measured and advice.measured.fixed(advice.drive) else symbol} - {cam}"


def warnings(advice: Advice, say: Texts | None = None) -> tuple[str, ...]:
    """What a reader should know beside the numbers."""
    say = say or texts()
    result, found = advice.curve, list(warnings_of(advice.drive, say))
    done = len(result.rotation_deg)
    if result.missing:
        found.append(f"interrupted: {done} of {result.missing + done} positions were done")
    elif result.interrupted:
        found.append("interrupted: positions were searched, but every state was not yet solved at the advised one")
    if advice.measured and advice.drive.alternatives:
        found.append(say("warning.alternatives"))
    if advice.measured and not advice.drive.mounting.holes:
        found.append(say("warning.steps"))
    if advice.disagreeing:
        phases = ", ".join(say.number(other.recommended.phase_deg) for other in advice.disagreeing)
        found.append(say("warning.disagree", phases=phases, phase=say.number(advice.chosen.phase_deg)))
    return tuple(found)


def answer(advice: Advice, *, seed: int, plots: bool, details: bool = False, carded: bool = False) -> Answer:
    """What there is to say of an advice.

    Arguments: seed, of its samples; plots, whether seat and curves are drawn; details, whether all tables are shown;
    carded, whether a card is written.
    """
    return Answer(
        to_json=lambda: to_json(advice, seed),
        page=lambda style: render(advice, style, plots=plots, details=details, carded=carded),
        summary_line=lambda: summary_line(advice),
        figures=lambda: figures(advice),
        warnings=warnings(advice),
        proof=advice.curve.certificate,
        exit_code=exit_code(advice),
    )


def exit_code(advice: Advice) -> int:
    """Exit code of the command: 130 where it was interrupted, 6 where nothing can be ordered."""
    if advice.curve.interrupted:
        return 130
    return Verdict.INCONCLUSIVE.exit_code if advice.order == "none" else 0


def what_to_do(advice: Advice, say: Texts | None = None) -> str:
    """The order; where none can be given, why, and what to measure."""
    say = say or texts()
    if advice.order != "none":
        why = advice.no_hole_better
        return (say(f"no_hole.{why}", wheel=wheel(advice.drive, say)) + " " if why else "") + instruction(
            advice.choice, say
        )
    holes = bool(advice.drive.mounting.holes)
    fixed, where = wheel(advice.drive, say), ", ".join(place(p, say) for p in advice.to_measure)
    trials = [f"{f'h{p.hole}' if holes else f'{p.rotation_deg:g}'}:F_IOR" for p in advice.to_measure]
    measure = say("instruction.measure", where=where, command=again("trials", advice.drive, *trials))
    if sampled := advice.robust:
        change = say.percent(-advice.gain, "+")
        chances = (say.percent(sampled.probability_gain), say.percent(advice.needed))
        why = say(
            "instruction.unsure", wheel=fixed, gain=chances[0], needed=chances[1], best=place(advice.chosen, say),
            change=change,
        )  # fmt: skip
    else:
        key = "instruction.any_hole" if advice.any_hole else "instruction.unknown"
        fields = ", ".join(advice.deciding) if advice.any_hole else names(advice.unknown)
        why = say(key, wheel=fixed, fields=fields)
    return f"{why} {measure}"


def render(
    advice: Advice, style: Style, *, plots: bool = True, details: bool = False, carded: bool = False
) -> RenderableType:
    """The instruction, the seat, the positions, and what to know of them; with details a plot per torque and tables."""
    drive, result = advice.drive, advice.curve
    words = f"{drive.name}: turning the fixed {TRADE[drive.mounting.fixed]} on its seat{heading(advice.measured)}"
    parts: list[RenderableType] = [Text(style.text(words), style="bold"), Text(style.text(what_to_do(advice)))]
    if plots and not advice.any_hole:
        parts.append(Text(seat_text(advice.choice, style)))
    if plots and details and advice.has_curve:
        parts += [Text(drawn) for drawn in _curves(advice, style)]
    parts += [] if advice.any_hole else [positions_table(advice, style)]
    if details:
        parts += advice_tables(advice, style)
    parts += [Text(style.text(TURNS)), Text(curve_proof(result)) if details else facts(style, _lines(advice, carded))]
    return Group(*(line for part in parts for line in (part, Text(""))))


def advice_tables(advice: Advice, style: Style) -> Iterator[TextTable]:
    """Each torque alone, positions under uncertainty, what a micrometre does, and what the advice rests on."""
    if advice.has_curve:
        yield _torques(advice, style)
    if advice.robust:
        yield _uncertain(advice, advice.robust, style)
    if advice.now:
        yield _slopes(advice, style)
    if advice.rests_on:
        yield stays_table(advice.drive, advice.rests_on, style)


def _lines(advice: Advice, carded: bool) -> Iterator[tuple[str, str]]:
    """What is to be known beside the positions, a label and a text each."""
    sampled = advice.robust
    sure = f"gains with {sampled.probability_gain:.0%} over {len(sampled.merits)} samples" if sampled else ""
    if not advice.curve.usable[0]:
        sure = "; ".join(filter(None, (sure, "the wheel may not stay where it stands (mounting.allowed)")))
    yield "sure", sure if advice.order != "none" else ""
    if sampled and advice.worth_turning:
        yield "limit", kept_line(sampled, advice.drive, advice.curve.torques, sampled.standard_error_arcsec)
    yield "lever", _lever(advice)
    yield "rests on", stays_line(advice.drive, advice.rests_on)
    yield "unknown", names(advice.unknown)
    if advice.order != "none" and not carded:  # else the sentence above names it
        card = again("mount", advice.drive, "--card", "card.html")
        yield "next", card + (" with the same pitch files" if advice.measured else "")
    yield "proof", proof(advice.curve.certificate, advice.curve.cross_checks)
    yield "more", "--details"


def _lever(advice: Advice) -> str:
    """The micrometre that changes the greatest share of F'_ior where the wheel is to stand; empty if not computed."""
    target, at = ("there", advice.best) if advice.choice.turn else ("now", advice.now)
    if not at:
        return ""
    place = advice.choice.target
    slopes = [
        (abs(value) / max(F_ior, LEAST), value, words, M_g)
        for M_g, F_ior, slope in zip(advice.curve.torques, place.F_ior_arcsec, at, strict=True)
        for name, words in MICROMETRES.items()
        if (value := getattr(slope, name))
    ]
    if not slopes:
        return ""
    _, value, words, M_g = max(slopes)
    return f"a micrometre more of {words}: {value:+.2f} arcsec at {M_g:g} N·m {target}"


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


def curve_proof(result: MountingCurve) -> str:
    """The certificate of the curves, and at how many of their points every state was solved."""
    solved, places = int(result.every_state.sum()), result.every_state.size
    proven = result.certificate
    words = f"certificate: {proven.states} states, greatest residual {proven.max_residual:.1e} of its scale"
    words += cross_checked(result.cross_checks)
    if solved < places:
        words = f"every state solved at {solved} of {places} points of the curves, the others searched; {words}"
    return words


def positions_table(advice: Advice, style: Style) -> TextTable:
    """The position now, the best, the second and the worst."""
    choice, phase = advice.choice, f"phase {_phase_words(advice)}, deg"
    title = "positions (best for the torque served worst)"
    if advice.robust:
        title += "\nF'_ior as expected over what is uncertain or not known"
    rows = grid(style, title, "position", "hole", "turn, deg", phase, "F'_ior, arcsec", "against now")
    named = {"now": choice.current, "best": choice.chosen, "second": choice.second, "worst": choice.ranked[-1]}
    for words, position in named.items():
        if position is not None:
            values = " / ".join(f"{v:.2f}" for v in position.F_ior_arcsec)
            change = f"{position.change_from(choice.current):+.0%}"
            rows.add_row(words, *_where(position), f"{position.phase_deg:g}", values, change)
    return rows


def _where(position: Position) -> tuple[str, str]:
    """Cells of hole and turn."""
    return "-" if position.hole is None else f"{position.hole}", f"{position.rotation_deg:g}"


def _torques(advice: Advice, style: Style) -> TextTable:
    result, now = advice.curve, () if advice.any_hole else ("now, arcsec",)
    heads = ("torque, N·m", *now, "best, arcsec", "at phase, deg", "worst, arcsec", "at phase, deg")
    title = "each torque alone" + ", by values as given, the unknown as 0" * bool(advice.robust)
    rows = grid(style, title, *heads, words=0)
    rows.unwrapped = 1
    for k, M_g in enumerate(result.torques):
        found = [cell for p in result.extremes(k) for cell in (f"{p.F_ior_arcsec[k]:.2f}", f"{p.phase_deg:g}")]
        rows.add_row(f"{M_g:g}", *([f"{result.current.F_ior_arcsec[k]:.2f}"] if now else []), *found)
    return rows


def _uncertain(advice: Advice, sampled: Losses, style: Style) -> TextTable:
    title = f"under uncertainty: {len(sampled.merits)} samples, {sampled.criterion.name}"
    if errors := sampled.standard_error_arcsec:
        title += f"; interpolated, standard error {beside(errors)} arcsec"
    if advice.unknown:
        title += f"\nnot known: {names(advice.unknown)}"
    for M_g, (low, high) in zip(advice.curve.torques, _spread(sampled), strict=True):
        title += f"\n{M_g:g} N·m: the worst hole has {low:.1f} to {high:.1f} times the error of the best (5 to 95 %)"
    title += f"\nthe advised one lies up to {_most_lost(sampled):.0%} above the best (95 %)"
    return losses_table(sampled, advice.curve.holes, advice.curve.torques, style, title, SHOWN)


def _spread(sampled: Losses) -> list[list[float]]:
    """Worst over best position at each torque: what 5 and 95 % of the samples have less than."""
    found: list[list[float]] = np.quantile(sampled.ratios, (0.05, 0.95), axis=1).T.tolist()
    return found


def _most_lost(sampled: Losses) -> float:
    """What the choice loses less than in 95 % of the samples."""
    return float(np.quantile(sampled.losses[:, sampled.best], 0.95))


def _slopes(advice: Advice, style: Style) -> TextTable:
    heads = ("torque, N·m", *MICROMETRES.values())
    rows = grid(style, "what a micrometre more does to F'_ior, arcsec", "position", *heads)
    for words, values in (("now", advice.now), ("best", advice.best)):
        for M_g, slope in zip(advice.curve.torques, values, strict=True):
            rows.add_row(words, f"{M_g:g}", f"{slope.j_n:+.2f}", f"{slope.W_0:+.2f}", f"{slope.g_b:+.2f}")
    return rows


def to_json(advice: Advice, seed: int) -> Json:
    """The curves and positions as a JSON object."""
    result, choice = advice.curve, advice.choice
    second = choice.second
    return {
        **envelope("mount", advice.drive, exit_code(advice), warnings(advice)),
        "complete": not result.interrupted,
        "pitch": pitch_object(advice.measured),
        "instruction": what_to_do(advice),
        "order": advice.order,
        "turn": advice.worth_turning,
        "measure": [asdict(p) for p in advice.to_measure] if advice.order == "none" else [],
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
        "current": None if advice.any_hole else _position(choice.current, advice.now),
        "recommended": _position(choice.chosen, advice.best) if advice.order != "none" else None,
        "best_bet": _position(choice.chosen) if not advice.any_hole else None,
        "second": None if second is None or advice.any_hole else _position(second),
        "worst": None if advice.any_hole else _position(choice.ranked[-1]),
        "weights": None if result.weights is None else list(result.weights),
        "uncertainty": _robust(advice, advice.robust) if advice.robust else None,
        "alternatives": [{"values": o.values, **_position(o.recommended)} for o in advice.others],
        "unknown": unknown_objects(advice.unknown),
        "rests_on": stays_objects(advice.drive, advice.rests_on),
        "gain": None if advice.any_hole else advice.gain,
        "probability_needed": advice.needed,
        "certificate": certificate_object(result.certificate, result.cross_checks),
        "seed": seed,
    }


def _position(position: Position, slopes: Sequence[Sensitivity] = ()) -> Json:
    if not slopes:
        return asdict(position)
    fields = ("j_n", "W_0", "g_b")
    told = {f"F_ior_{field}_arcsec_per_um": [getattr(slope, field) for slope in slopes] for field in fields}
    return {**asdict(position), "sensitivity": told}


def _robust(advice: Advice, sampled: Losses) -> Json:
    return {
        "samples": len(sampled.merits),
        "fields": dict(advice.drive.uncertainty),
        "worst_over_best": _spread(sampled),
        "loss_95_percent": _most_lost(sampled),
        "certificate": certificate_object(sampled.certificate),
        **losses_object(sampled, advice.drive, advice.drive.number(standing_offset(advice.drive)[1])),
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
    if advice.order == "none":
        return "unknown"
    return bare(advice.choice.target.rotation_deg, advice.curve.holes)


def card_facts(advice: Advice, say: Texts) -> CardFacts:
    """What the assembly card tells of an advice; say, the texts of its language."""
    drive = advice.drive
    offset, cam = standing_offset(drive)
    return CardFacts(
        choice=advice.choice,
        cam_deg=drive.number(cam) if drive.number(offset) else None,
        measured=advice.measured,
        chances=advice.robust.chances if advice.robust else None,
        weights=advice.curve.weights,
        warnings=warnings(advice, say),
        rests_on=advice.rests_on if advice.choice.target.rotation_deg == advice.chosen.rotation_deg else (),
    )
