"""The mounting advice as a report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

import numpy as np

from hdassist.belief.statistics import Probability
from hdassist.json_parts import (
    Json,
    influence_objects,
    measure_objects,
    pitch_object,
    samples_object,
    unknown_objects,
)
from hdassist.model.deviations import standing_offset
from hdassist.model.unknown import unknown_names
from hdassist.mounting.advice import Advice
from hdassist.mounting.positions import bare
from hdassist.pages.card import CardFacts, warnings_of
from hdassist.pages.losses import beside, kept_line, losses_object, losses_table
from hdassist.pages.seat import TRADE, hole_place, instruction, seat_of, wheel
from hdassist.report.blocks import Block, Curve, CurveMark, Facts, Table
from hdassist.report.quantities import NO_VALUE
from hdassist.report.report import CsvTable, Report
from hdassist.solve.answers import EMPTY
from hdassist.terminal.brief import again
from hdassist.terminal.influence_words import influence_words, measure_words, samples_words
from hdassist.terminal.texts import Texts, texts
from hdassist.terminal.wheels_page import heading
from hdassist.verdict import Verdict

LISTED_POSITIONS = 6  # positions that the table of all samples lists, best first
OPEN_NAMED = 4  # fields that are not known exactly, which are named
RANGED = 2  # torques whose ranges stand beside their medians
ORDER_WORDS = {"turn": "TURN", "leave": "LEAVE", "none": "MEASURE FIRST"}
NEXT_DRAWS = 4  # times as many samples, where chance alone leaves an order open


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


def mount_report(advice: Advice, seed: int, *, carded: bool = False) -> Report:
    """The advice on a drive; seed, of its samples; carded, whether a card is written."""
    drive, curves = advice.drive, tuple(position_curves(advice))
    first = curves[_decisive(advice)] if curves else None
    seat = seat_of(advice.choice, texts(), advice.choice.chosen)
    table = () if advice.any_hole else (positions_table(advice),)
    plot = (first,) if first else () if advice.any_hole else (seat,)
    figures: tuple[Block, ...] = curves if advice.any_hole else (*curves, seat)
    others = (each for each in figures if each not in plot)
    return Report(
        command="mount",
        drive=drive,
        head=f"{drive.name}, {TRADE[drive.mounting.fixed]} on its seat{heading(advice.measured)}",
        verdict=ORDER_WORDS[advice.order],
        why=(what_to_do(advice),),
        blocks=(*table, Facts.of((*gain_lines(advice), *_facts(advice, carded=carded))), *plot),
        details=(*others, *_samples_table(advice), Facts.of(_more_facts(advice))),
        certificate=advice.curve.certificate + (advice.samples.certificate if advice.samples else EMPTY),
        cross_checks=tuple(advice.curve.cross_checks),
        values=_values(advice, seed),
        csv=_csv(advice),
        line=_line(advice),
        warnings=mount_warnings(advice),
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


def _samples_table(advice: Advice) -> Iterator[Table]:
    """The positions over the samples, if there are such."""
    if found := advice.positions:
        notes = []
        for M_g, ratios in zip(advice.curve.torques, found.ratios, strict=True):
            low, _, high = found.range_of(ratios)
            words = f"the worst hole has {low:.1f} to {high:.1f} times the error of the best (5 to 95 %)"
            notes.append(f"{M_g:g} N·m: {words}")
        title = f"all positions over the samples, best first ({found.criterion.name})"
        yield losses_table(found, advice.curve.holes, advice.curve.torques, title, LISTED_POSITIONS, *notes)


def gain_lines(advice: Advice) -> Iterator[tuple[str, str]]:
    """Gain of turning with its range, and how sure it is, a label and a text each."""
    say, found = texts(), advice.positions
    if found and not advice.no_hole_better:
        low, middle, high = (100 * each for each in (advice.best_gain_range if advice.any_hole else advice.gain_range))
        where = "the best hole, whichever it is," if advice.any_hole else hole_place(advice.chosen, say)
        if advice.any_hole or advice.chosen.rotation_deg:
            served = " at the torque served worst" if len(advice.curve.torques) > 1 else ""
            yield "gain", f"{middle:.0f} % less error in {where} than now{served} (5 to 95 %: {low:.0f} to {high:.0f})"
    if (gain := advice.gain_probability) and found and advice.order != "none" and not advice.no_hole_better:
        at = hole_place(found.position(advice.drive, 0.0, found.challenger), say)
        needed = f"{100 * advice.needed:g} % needed"
        yield "sure", f"{at} is better than now by more than 1 % with {_interval(gain, say)}, {needed}"
    if not advice.curve.usable[0]:
        yield "forbidden", "the wheel may not stay where it stands (mounting.allowed)"


def _facts(advice: Advice, *, carded: bool) -> Iterator[tuple[str, str]]:
    """Limits, largest influences, the next measurement and the next command, a label and a text each."""
    if advice.positions and advice.worth_turning:
        yield "limit", kept_line(advice.positions, advice.drive, advice.curve.torques)
    yield "influence", influence_words(advice.influences, "the gain") if advice.influences else ""
    yield "measure", _measure(advice)
    if advice.unknown and not advice.samples:
        yield "unknown", f"taken as 0: {unknown_names(advice.unknown)}"
    if advice.order != "none" and not carded:  # else the sentence above names it
        card = again("mount", advice.drive, "--card", "card.html")
        yield "next", card + (" with the same pitch files" if advice.measured else "")


def _more_facts(advice: Advice) -> Iterator[tuple[str, str]]:
    """More to be known beside the positions, a label and a text each."""
    samples = advice.samples
    yield "unknown", unknown_names(advice.unknown) if advice.unknown and samples else ""
    more = f"; the order from {advice.all_draws} drawn" if samples and advice.all_draws > samples.draws else ""
    yield "samples", samples_words(samples) + more if samples else ""
    solved, places = int(advice.curve.every_state.sum()), advice.curve.every_state.size
    if solved < places:
        yield "curves", f"every state solved at {solved} of {places} points of the curves, the others searched"


def _measure(advice: Advice) -> str:
    """Measurements where nothing is ordered; more samples where chance alone leaves it open."""
    found = advice.gain_probability
    if advice.order != "none" or advice.any_hole or not found or not advice.samples:
        return ""
    words = [measure_words(advice.to_measure, True, advice.curve.holes)]
    if found.low < advice.needed < found.high:
        words.append(f"more samples may settle it: --draws {NEXT_DRAWS * round(advice.samples.effective)}")
    return "; ".join(filter(None, words))


def _decisive(advice: Advice) -> int:
    """Place of the torque at which the chosen position gains least."""
    now, then = advice.choice.current.F_ior_arcsec, advice.choice.chosen.F_ior_arcsec
    return int(np.argmax(np.divide(then, np.maximum(now, 1e-9))))


def position_curves(advice: Advice) -> Iterator[Curve]:
    """F'_ior over the positions of the wheel at each torque; over the phase where nobody knows how it stands."""
    result = advice.curve
    if not advice.has_curve or len(result.rotation_deg) < 2:
        return
    per = 360 / result.holes if result.holes else 1.0
    turned, over = result.rotation_deg / per, "positions"
    x_label = "turned by, holes" if result.holes else "turned by, deg"
    if advice.any_hole:
        turned, over = result.phase_deg, "phases"
        x_label = f"phase {_phase_words(advice)}, deg"
    order = np.argsort(turned)
    now, target = advice.choice.current, advice.choice.chosen
    for k, M_g in enumerate(result.torques):
        label = f"F'_ior at {M_g:g} N·m, arcsec"
        notes = ["bars 5 to 95 % over all that is uncertain"] * bool(advice.positions)
        notes += ["line: unknown as 0"] * bool(advice.unknown and not advice.any_hole)
        marks = [] if advice.any_hole else [CurveMark(now.rotation_deg / per, now.F_ior_arcsec[k], "now", "now")]
        if target.rotation_deg and not advice.any_hole:
            marks.append(CurveMark(target.rotation_deg / per, target.F_ior_arcsec[k], "best", "target"))
        yield Curve(
            turned[order], result.F_ior_arcsec[k, order], x_label, "; ".join([label, *notes]),
            caption="; ".join([f"F'_ior over the {over} of the wheel at {M_g:g} N·m", *notes]),
            whiskers=tuple(_whiskers(advice, k, per)), marks=tuple(marks),
            points=bool(result.holes) and not advice.any_hole, from_zero=True, rows=6,
        )  # fmt: skip


def _whiskers(advice: Advice, torque: int, per: float) -> Iterator[tuple[float, float, float]]:
    """For each position that was sampled, its place and F'_ior [arcsec] of 5 and 95 % of the samples."""
    if found := advice.positions:
        for k, rotation in enumerate(found.rotations_deg):
            low, high = (found.quantile(share, k)[torque] for share in (0.05, 0.95))
            yield rotation / per, low, high


def positions_table(advice: Advice) -> Table:
    """The present, chosen and worst position: F'_ior, over samples its median and range."""
    choice, found, torques = advice.choice, advice.positions, advice.curve.torques
    title = "F'_ior in arcsec by position; turns counter-clockwise seen from the cam side"
    ranged = found is not None and len(torques) <= RANGED
    heads = [f"at {beside(torques, 'g')} N·m"]
    if ranged:
        title = "F'_ior in arcsec, median (5 to 95 %); turns ccw seen from the cam side"
        heads = [f"at {M_g:g} N·m" for M_g in torques]
    rows = []
    named = {"now": choice.current, "best": choice.chosen, "worst": choice.ranked[-1]}
    for words, position in named.items():
        if position is not None:
            cells = [beside(position.F_ior_arcsec)]
            if found and ranged:
                at = found.place(position.rotation_deg)
                ends = zip(position.F_ior_arcsec, found.quantile(0.05, at), found.quantile(0.95, at), strict=True)
                cells = [f"{F_ior:.2f} ({low:.1f}-{high:.1f})" for F_ior, low, high in ends]
            hole = NO_VALUE if position.hole is None else f"{position.hole}"
            change = f"{100 * position.change_from(choice.current):+.0f} %"
            rows.append((words, hole, f"{position.rotation_deg:g}", *cells, change))
    return Table(title, ("position", "hole", "turn, deg", *heads, "against now"), tuple(rows))


def _values(advice: Advice, seed: int) -> Json:
    """Curves and positions."""
    result, choice = advice.curve, advice.choice
    second, gain = choice.second, advice.gain_probability
    return {
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


def _csv(advice: Advice) -> CsvTable:
    """Header and rows of a table, one row per torque and position."""
    result = advice.curve
    rows = [
        [M_g, float(rotation), float(phase), float(value), int(every)]
        for M_g, values, solved in zip(result.torques, result.F_ior_arcsec, result.every_state, strict=True)
        for rotation, phase, value, every in zip(result.rotation_deg, result.phase_deg, values, solved, strict=True)
    ]
    return ["M_g_Nm", "rotation_deg", "phase_deg", "F_ior_arcsec", "every_state"], rows


def _line(advice: Advice) -> str:
    """The hole to turn the wheel to, or the angle in degrees where the seat has no holes; 0: stay."""
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
        warnings=mount_warnings(advice, say),
    )
