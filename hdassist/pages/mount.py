"""The mounting advice as an instruction, plots and tables, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.belief.samples import Probability
from hdassist.json_parts import (
    Json,
    certificate_object,
    influence_objects,
    measure_objects,
    pitch_object,
    samples_object,
    unknown_objects,
)
from hdassist.model.deviations import standing_offset
from hdassist.model.unknown import unknown_names
from hdassist.mounting.advice import Advice
from hdassist.mounting.positions import MountingCurve, Position, bare
from hdassist.pages.card import CardFacts, warnings_of
from hdassist.pages.losses import beside, kept_line, losses_object, losses_table
from hdassist.pages.seat import TRADE, hole_place, instruction, seat_text, wheel
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.terminal.answers import cross_check_words, envelope
from hdassist.terminal.brief import again, facts, proof
from hdassist.terminal.console import Style, TextTable, grid
from hdassist.terminal.influence_words import influence_words, measure_words, samples_words
from hdassist.terminal.plot import curve
from hdassist.terminal.runs import Answer, CsvTable
from hdassist.terminal.texts import Texts, texts
from hdassist.terminal.wheels_page import heading
from hdassist.verdict import Verdict

LISTED_POSITIONS = 6  # positions that the table of all samples lists, best first
OPEN_NAMED = 4  # fields that are not known exactly, which are named
RANGED = 2  # torques whose ranges stand beside their medians
ORDER_WORDS = {"turn": "TURN", "leave": "LEAVE", "none": "MEASURE FIRST"}
NEXT_DRAWS = 4  # times as many samples, where chance alone leaves an order open
TURN_WORDS = "Turns are counter-clockwise seen from the side of the cam (wave generator), from where the wheel stands."


def _phase_words(advice: Advice) -> str:
    symbol, cam = ("xi_b", "phi_hb") if advice.drive.mounting.fixed == "rigid" else ("xi_g", "phi_hg")
    return f"{'mark' if advice.measured and advice.measured.fixed(advice.drive) else symbol} - {cam}"


def mount_warnings(advice: Advice, say: Texts | None = None) -> tuple[str, ...]:
    """What a reader should know beside the numbers."""
    say = say or texts()
    result, found = advice.curve, list(warnings_of(advice.drive, say))
    done = len(result.rotation_deg)
    if result.missing:
        found.append(f"interrupted: {done} of {result.missing + done} positions were done")
    elif result.interrupted:
        found.append("interrupted: positions were searched, but every state was not yet solved at the advised one")
    if advice.open_ and not advice.as_given and not advice.positions and not result.interrupted:
        found.append(say("warning.not_drawn", count=len(advice.open_)))
    if advice.measured and not advice.drive.mounting.holes:
        found.append(say("warning.steps"))
    return tuple(found)


def mount_answer(advice: Advice, *, seed: int, plots: bool, details: bool = False, carded: bool = False) -> Answer:
    """What there is to say of an advice.

    Arguments: seed, of its samples; plots, whether seat and curves are drawn; details, whether all tables are shown;
    carded, whether a card is written.
    """
    return Answer(
        to_json=lambda: mount_json(advice, seed),
        page=lambda style: mount_page(advice, style, plots=plots, details=details, carded=carded),
        summary_line=lambda: mount_summary(advice),
        figures=lambda: mount_figures(advice),
        warnings=mount_warnings(advice),
        proof=_certificate(advice),
        exit_code=mount_exit_code(advice),
    )


def mount_exit_code(advice: Advice) -> int:
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
    fixed, where = wheel(advice.drive, say), ", ".join(hole_place(p, say) for p in advice.to_try)
    trials = [f"{f'h{p.hole}' if holes else f'{p.rotation_deg:g}'}=F_IOR" for p in advice.to_try]
    measure = say("instruction.measure", where=where, command=again("trials", advice.drive, *trials))
    if (found := advice.gain_probability) and not advice.any_hole:
        why = say(
            "instruction.unsure", wheel=fixed, gain=_interval(found, say), needed=say.percent(advice.needed),
            best=hole_place(advice.chosen, say), change=say.percent(-advice.gain, "+"),
        )  # fmt: skip
    else:
        key = "instruction.any_hole" if advice.any_hole else "instruction.unknown"
        paths = advice.deciding if advice.any_hole else advice.open_
        fields = ", ".join(paths[:OPEN_NAMED]) + (", ..." if len(paths) > OPEN_NAMED else "")
        why = say(key, wheel=fixed, fields=fields)
    return f"{why} {measure}"


def _interval(found: Probability, say: Texts) -> str:
    """A probability in per cent with its Monte Carlo interval."""
    return f"{say.percent(found.value)} ({100 * found.low:.0f}-{100 * found.high:.0f})"


def mount_page(
    advice: Advice, style: Style, *, plots: bool = True, details: bool = False, carded: bool = False
) -> RenderableType:
    """Verdict and instruction, gain and how sure it is, positions, seat; with details a plot per torque and tables."""
    drive, result = advice.drive, advice.curve
    words = f"{drive.name}: {ORDER_WORDS[advice.order]}, the fixed {TRADE[drive.mounting.fixed]} on its seat"
    head = Text(style.text(words + heading(advice.measured)), style="bold")
    parts: list[RenderableType] = [head, Text(style.text(what_to_do(advice))), facts(style, gain_lines(advice))]
    parts += [] if advice.any_hole else [positions_table(advice, style)]
    if plots and not advice.any_hole:
        parts.append(Text(seat_text(advice.choice, style)))
    if plots and details and advice.has_curve:
        parts += [Text(drawn) for drawn in _curves(advice, style)]
    if details:
        parts += advice_tables(advice, style)
    parts += [Text(style.text(TURN_WORDS)), facts(style, fact_lines(advice, details=details, carded=carded))]
    if details:
        parts.append(Text(curve_proof(result)))
    return Group(*(line for part in parts for line in (part, Text(""))))


def advice_tables(advice: Advice, style: Style) -> Iterator[TextTable]:
    """Each torque alone, and the positions over the samples."""
    if advice.has_curve:
        yield _torques(advice, style)
    if found := advice.positions:
        title = f"all positions over the samples, best first ({found.criterion.name})"
        for M_g, ratios in zip(advice.curve.torques, found.ratios, strict=True):
            low, _, high = found.range_of(ratios)
            title += (
                f"\n{M_g:g} N·m: the worst hole has {low:.1f} to {high:.1f} times the error of the best (5 to 95 %)"
            )
        yield losses_table(found, advice.curve.holes, advice.curve.torques, style, title, LISTED_POSITIONS)


def gain_lines(advice: Advice) -> Iterator[tuple[str, str]]:
    """Gain of turning with its range, and how sure it is."""
    say, found = texts(), advice.positions
    if found and not advice.no_hole_better:
        low, middle, high = (100 * each for each in (advice.best_gain_range if advice.any_hole else advice.gain_range))
        where = "the best hole, whichever it is," if advice.any_hole else hole_place(advice.chosen, say)
        if advice.any_hole or advice.chosen.rotation_deg:
            served = " at the torque served worst" if len(advice.curve.torques) > 1 else ""
            yield "gain", f"{middle:.0f} % less error in {where} than now{served} (5 to 95 %: {low:.0f} to {high:.0f})"
    if (gain := advice.gain_probability) and found and not advice.any_hole and not advice.no_hole_better:
        at = hole_place(found.position(advice.drive, 0.0, found.challenger), say)
        yield (
            "sure",
            f"{at} is better than now by more than 1 % with {_interval(gain, say)}, {100 * advice.needed:g} % needed",
        )
    if not advice.curve.usable[0]:
        yield "forbidden", "the wheel may not stay where it stands (mounting.allowed)"


def fact_lines(advice: Advice, *, details: bool, carded: bool) -> Iterator[tuple[str, str]]:
    """What is to be known beside the positions, a label and a text each."""
    samples, drive = advice.samples, advice.drive
    if advice.positions and advice.worth_turning:
        yield "limit", kept_line(advice.positions, drive, advice.curve.torques)
    yield "influence", influence_words(advice.influences, "the gain") if advice.influences else ""
    yield "measure", _measure(advice)
    yield "unknown", ("" if samples else "taken as 0: ") + unknown_names(advice.unknown) if advice.unknown else ""
    more = f"; the order from {advice.all_draws} drawn" if samples and advice.all_draws > samples.draws else ""
    yield "samples", samples_words(samples) + more if samples else ""
    if advice.order != "none" and not carded:  # else the sentence above names it
        card = again("mount", drive, "--card", "card.html")
        yield "next", card + (" with the same pitch files" if advice.measured else "")
    yield "proof", proof(_certificate(advice), advice.curve.cross_checks)
    yield "more", "" if details else "--details"


def _certificate(advice: Advice) -> Certificate:
    """Worst residuals of curve and samples."""
    return advice.curve.certificate + (advice.samples.certificate if advice.samples else EMPTY)


def _measure(advice: Advice) -> str:
    """What to measure where nothing is ordered; more samples where chance alone leaves it open."""
    found = advice.gain_probability
    if advice.order != "none" or advice.any_hole or not found or not advice.samples:
        return ""
    words = measure_words(advice.to_measure, True, advice.curve.holes).replace("right verdict", "right order")
    if found.low < advice.needed < found.high:
        words += f"; more samples may settle it: --draws {NEXT_DRAWS * round(advice.samples.effective)}" * bool(words)
        words = words or f"more samples may settle it: --draws {NEXT_DRAWS * round(advice.samples.effective)}"
    return words


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
    words += cross_check_words(result.cross_checks)
    if solved < places:
        words = f"every state solved at {solved} of {places} points of the curves, the others searched; {words}"
    return words


def positions_table(advice: Advice, style: Style) -> TextTable:
    """The present, chosen, second and worst position: F'_ior, over samples its median and range."""
    choice, found, torques = advice.choice, advice.positions, advice.curve.torques
    title = "positions (best for the torque served worst)"
    ranged = found is not None and len(torques) <= RANGED
    heads = [f"F'_ior, arcsec, at {beside(torques, 'g')} N·m"]
    if ranged:
        title += "\nF'_ior in arcsec over all that is not known exactly: median (5 to 95 %)"
        heads = [f"at {M_g:g} N·m" for M_g in torques]
    rows = grid(style, title, "position", "hole", "turn, deg", *heads, "against now")
    named = {"now": choice.current, "best": choice.chosen, "second": choice.second, "worst": choice.ranked[-1]}
    for words, position in named.items():
        if position is not None:
            cells = [beside(position.F_ior_arcsec)]
            if found and ranged:
                at = found.place(position.rotation_deg)
                ends = zip(position.F_ior_arcsec, found.quantile(0.05, at), found.quantile(0.95, at), strict=True)
                cells = [f"{F_ior:.2f} ({low:.1f}-{high:.1f})" for F_ior, low, high in ends]
            change = f"{100 * position.change_from(choice.current):+.0f} %"
            rows.add_row(words, *_where(position), *cells, change)
    return rows


def _where(position: Position) -> tuple[str, str]:
    """Cells of hole and turn."""
    return "-" if position.hole is None else f"{position.hole}", f"{position.rotation_deg:g}"


def _torques(advice: Advice, style: Style) -> TextTable:
    result, now = advice.curve, () if advice.any_hole else ("now, arcsec",)
    heads = ("torque, N·m", *now, "best, arcsec", "at phase, deg", "worst, arcsec", "at phase, deg")
    title = "each torque alone" + ", by values as given, the unknown as 0" * bool(advice.positions)
    rows = grid(style, title, *heads, words=0)
    rows.unwrapped = 1
    for k, M_g in enumerate(result.torques):
        found = [cell for p in result.extremes(k) for cell in (f"{p.F_ior_arcsec[k]:.2f}", f"{p.phase_deg:g}")]
        rows.add_row(f"{M_g:g}", *([f"{result.current.F_ior_arcsec[k]:.2f}"] if now else []), *found)
    return rows


def mount_json(advice: Advice, seed: int) -> Json:
    """The curves and positions as a JSON object."""
    result, choice = advice.curve, advice.choice
    second, gain = choice.second, advice.gain_probability
    return {
        **envelope("mount", advice.drive, mount_exit_code(advice), mount_warnings(advice)),
        "complete": not result.interrupted,
        "pitch": pitch_object(advice.measured),
        "instruction": what_to_do(advice),
        "order": advice.order,
        "turn": advice.worth_turning,
        "measure": [asdict(p) for p in advice.to_try] if advice.order == "none" else [],
        "to_measure": measure_objects(advice.to_measure),
        "influence": influence_objects(advice.influences),
        "samples": samples_object(advice.samples),
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
        "current": None if advice.any_hole else asdict(choice.current),
        "recommended": asdict(choice.chosen) if advice.order != "none" else None,
        "best_bet": asdict(choice.chosen) if not advice.any_hole else None,
        "second": None if second is None or advice.any_hole else asdict(second),
        "worst": None if advice.any_hole else asdict(choice.ranked[-1]),
        "weights": None if result.weights is None else list(result.weights),
        "belief": _belief(advice),
        "unknown": unknown_objects(advice.unknown),
        "gain": None if advice.any_hole else advice.gain,
        "gain_range": None if advice.any_hole else _percentiles(advice.gain_range),
        "best_gain_range": _percentiles(advice.best_gain_range),
        "probability_gain": None if gain is None or advice.any_hole else asdict(gain),
        "probability_needed": advice.needed,
        "certificate": certificate_object(_certificate(advice), result.cross_checks),
        "seed": seed,
    }


def _percentiles(found: tuple[float, float, float]) -> Json:
    return dict(zip(("p5", "p50", "p95"), found, strict=True))


def _belief(advice: Advice) -> Json | None:
    """F'_ior over the samples: now at each torque, and in every position; None where nothing was drawn."""
    if not (found := advice.positions):
        return None
    now = [_percentiles(found.range_of(each)) for each in found.now_arcsec]
    direction = advice.drive.number(standing_offset(advice.drive)[1])
    return {
        "now": [{"M_g_Nm": M_g, **each} for M_g, each in zip(advice.curve.torques, now, strict=True)],
        **losses_object(found, advice.drive, direction),
    }


def mount_figures(advice: Advice) -> CsvTable:
    """Header and rows of a table, one row per torque and position."""
    result = advice.curve
    rows = [
        [M_g, float(rotation), float(phase), float(value), int(every)]
        for M_g, values, solved in zip(result.torques, result.F_ior_arcsec, result.every_state, strict=True)
        for rotation, phase, value, every in zip(result.rotation_deg, result.phase_deg, values, solved, strict=True)
    ]
    return ["M_g_Nm", "rotation_deg", "phase_deg", "F_ior_arcsec", "every_state"], rows


def mount_summary(advice: Advice) -> str:
    """The answer alone: the hole to turn the wheel to, or the angle in degrees where the seat has no holes; 0: stay."""
    if advice.order == "none":
        return "unknown"
    return bare(advice.choice.target.rotation_deg, advice.curve.holes)


def mount_card_facts(advice: Advice, say: Texts) -> CardFacts:
    """What the assembly card tells of an advice; say, the texts of its language."""
    drive = advice.drive
    offset, cam = standing_offset(drive)
    return CardFacts(
        choice=advice.choice,
        cam_deg=drive.number(cam) if drive.number(offset) else None,
        measured=advice.measured,
        gain_range=advice.gain_range if advice.positions else None,
        gain_probability=advice.gain_probability,
        open_=len(advice.open_) if advice.positions else 0,
        weights=advice.curve.weights,
        warnings=mount_warnings(advice, say),
    )
