"""The mounting advice as a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from hdassist.belief.samples import Samples
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
from hdassist.model.geometry import Array
from hdassist.model.unknown import unknown_names, unknown_turn
from hdassist.mounting.advice import Advice
from hdassist.mounting.losses import PositionStatistics
from hdassist.mounting.positions import bare
from hdassist.pages.card import WHEELS, CardFacts, warnings_of
from hdassist.pages.losses import LEVELS, kept_line, losses_table, positions_object, whiskers_of
from hdassist.pages.seat import ENGLISH, TRADE, hole_place, instruction, seat_of, wheel
from hdassist.preset.yamltext import shown
from hdassist.readers.pitch import ASSUMED
from hdassist.report import CsvTable, Curve, CurveMark, Facts, Figure, Report, Table, csv_columns
from hdassist.solve.answers import EMPTY
from hdassist.terminal.texts import Texts
from hdassist.terminal.wheels import heading
from hdassist.terminal.words import (
    again,
    influence_words,
    measure_words,
    probability_words,
    samples_words,
)
from hdassist.verdict import Verdict

EVEN = 0.5  # probability of a gain, up to which no position is told to be better
OPEN_NAMED = 4  # fields that are not known exactly, which are named
ORDER_WORDS = {"turn": "TURN", "leave": "LEAVE", "none": "MEASURE FIRST"}
NO_HOLE_BETTER = {
    "floating": "the cam aligns itself (its support has a stiffness of 0), so no offset of it is felt",
    "standing": "nothing that stands still with the seat is off",
    "turning": "the wheel has no deviation that could be turned",
}


def mount_warnings(advice: Advice, say: Texts = ENGLISH) -> tuple[str, ...]:
    """Warnings beside the numbers, in the language of the texts."""
    found = list(warnings_of(advice.drive, say))
    if advice.open_ and not advice.positions:
        found.append(say("warning.not_drawn", count=len(advice.open_)))
    if advice.measured and not advice.drive.mounting.holes:
        found.append(say("warning.steps"))
    for name, measured in advice.measured.by_name.items() if advice.measured else ():
        if ASSUMED["sense"][1] in measured.pitch.notes:
            found.append(say("warning.sense", wheel=say(f"wheel.{WHEELS[name]}"), file=shown(measured.pitch.file)))
    return tuple(found)


def mount_report(
    advice: Advice, seed: int, *, carded: bool = False, limits: Sequence[float | None] | None = None
) -> Report:
    """The advice on a drive.

    Arguments: seed, of its samples; carded, whether a card is written; limits that F'_ior is held against at each
    torque [arcsec], for curves.
    """
    drive, figures = advice.drive, list[Figure](position_curves(advice, limits))
    if not advice.any_hole:
        figures.append(seat_of(advice.choice, ENGLISH, advice.choice.chosen))
    table = () if advice.any_hole else (positions_table(advice),)
    more = (
        [("unknown", unknown_names(advice.unknown)), ("samples", samples_words(advice.samples))]
        if advice.samples
        else []
    )
    return Report(
        command="mount",
        drive=drive,
        head=f"{drive.name}, {TRADE[drive.mounting.fixed]} on its seat{heading(advice.measured)}",
        verdict=ORDER_WORDS[advice.order],
        why=(what_to_do(advice),),
        blocks=(*table, *corrected_table(advice), Facts.of(_facts(advice, carded=carded)), *figures[:1]),
        details=(*figures[1:], *_samples_table(advice), Facts.of(more)),
        certificate=advice.curve.certificate + (advice.samples.certificate if advice.samples else EMPTY),
        cross_checks=tuple(advice.curve.cross_checks),
        values=_values(advice, seed),
        csv=_csv(advice),
        line="unknown" if advice.order == "none" else bare(advice.choice.target.rotation_deg, advice.curve.holes),
        warnings=mount_warnings(advice),
        exit_code=Verdict.INCONCLUSIVE.exit_code if advice.order == "none" else 0,
    )


def what_to_do(advice: Advice) -> str:
    """The order; where none can be given, why, and the measurement to make."""
    if words := corrected_words(advice):
        return words
    if advice.order != "none":
        why = NO_HOLE_BETTER.get(advice.no_hole_better)
        return (f"No hole is better than another: {why}. " if why else "") + instruction(advice.choice)
    fixed = wheel(advice.drive)
    paths = unknown_turn(advice.drive) if advice.any_hole else advice.open_
    fields = ", ".join(paths[:OPEN_NAMED]) + (", ..." if len(paths) > OPEN_NAMED else "")
    if advice.any_hole:
        why = f"nothing is known of the direction that decides ({fields}), so any position may be the best"
    elif found := advice.gain_probability:
        why = (
            f"a turn of the {fixed} gains with {probability_words(found, advice.needed)}; "
            f"the best bet is {hole_place(advice.chosen)}"
        )
    else:
        why = f"what is not known ({fields}) could reverse it"
    where = f"at {min(advice.curve.torques, key=abs):g} N·m in {', '.join(map(hole_place, advice.to_try))}"
    if advice.measured:
        return f"No order: {why}. To decide, measure F'_ior {where}; hdassist trials does not take measured teeth"
    trials = [f"{f'h{p.hole}' if advice.drive.mounting.holes else f'{p.rotation_deg:g}'}=F_IOR" for p in advice.to_try]
    return f"No order: {why}. To decide, measure F'_ior {where}: {again('trials', advice.drive, *trials)}"


def _samples_table(advice: Advice) -> Iterator[Table]:
    """The best position over the samples, its neighbours and the present one; none where any may be the best."""
    if (found := advice.positions) and not advice.any_hole:
        title, best, now = "over the samples: best, its neighbours, now", found.best, found.place(0.0)
        around = [(best + step) % len(found.rotations_deg) for step in (0, -1, 1)]
        places = dict.fromkeys((*around, *(() if now is None else (now,))))
        yield losses_table(found, advice.curve.holes, advice.curve.torques, title, places)


def _facts(advice: Advice, *, carded: bool) -> Iterator[tuple[str, str]]:
    """Gain, limits, largest influences, the next measurement and the next command, a label and a text each."""
    found, torques = advice.positions, advice.curve.torques
    if found and not advice.no_hole_better and advice.order_corrected == "none":
        low, _, high = (100 * each for each in (advice.best_gain_range if advice.any_hole else advice.gain_range))
        where = "the best hole, whichever it is," if advice.any_hole else hole_place(advice.chosen)
        if advice.any_hole or advice.chosen.rotation_deg:
            served = " at the torque served worst" if len(torques) > 1 else ""
            yield "gain", f"{low:.0f} to {high:.0f} % less error in {where} than now{served} (5 to 95 %)"
        if (gain := advice.gain_probability) and advice.order != "none":
            at = hole_place(found.position(advice.drive, 0.0, found.challenger))
            sure = probability_words(gain, advice.needed)
            yield "sure", f"{at} is better than now by more than 1 % with {sure}"
    if not advice.curve.usable[0]:
        yield "forbidden", "the wheel may not stay where it stands (mounting.allowed)"
    if found and advice.samples and advice.order == "turn":
        place = found.place(advice.chosen.rotation_deg)
        kept = partial(_kept, advice.samples, found, advice.needed, place)
        yield "limit", kept_line(advice.chosen.rotation_deg, advice.drive, torques, kept, advice.needed)
    if advice.influences and advice.order_corrected == "none":
        yield "influence", influence_words(advice.influences, "the gain")
    yield "measure", _measure(advice)
    if advice.unknown and not advice.samples:
        yield "unknown", f"taken as 0: {unknown_names(advice.unknown)}"
    if advice.order != "none" and not carded:  # else the sentence above names it
        yield "next", again("mount", advice.drive, "--card", "card.html")


def _kept(
    samples: Samples, found: PositionStatistics, sure: float, place: int | None, torque: int, room_arcsec: float
) -> Probability:
    """Probability that F'_ior in a position, at a torque by its place, is at most a room [arcsec]."""

    def within(stage: Samples) -> Array:
        there = PositionStatistics.of(stage, found.rotations_deg).at(place)[torque]
        return np.asarray(there <= room_arcsec)

    return samples.probability(within, sure)


def _measure(advice: Advice) -> str:
    """Measurements where no order is given, or more samples; empty where any hole may be the best one."""
    if advice.order != "none" or advice.any_hole or not advice.gain_probability:
        return ""
    return measure_words(advice.to_measure, True, advice.curve.holes)


def position_curves(advice: Advice, limits: Sequence[float | None] | None = None) -> Iterator[Curve]:
    """F'_ior over the positions of the wheel at each torque; over the phase where nobody knows how it stands."""
    result = advice.curve
    if not advice.has_curve or len(result.rotation_deg) < 2:
        return
    per = 360 / result.holes if result.holes else 1.0
    turned, over = result.rotation_deg / per, "positions"
    x_label = "turned by, holes" if result.holes else "turned by, °"
    marked, sampled = {"now": advice.choice.current, "target": advice.choice.chosen}, advice.positions
    if advice.any_hole:
        turned, over, marked, sampled = result.phase_deg, "phases", {}, None
        symbol, cam = ("xi_b", "phi_hb") if advice.drive.mounting.fixed == "rigid" else ("xi_g", "phi_hg")
        mark = "mark" if advice.measured and advice.measured.fixed(advice.drive) else symbol
        x_label = f"phase {mark} - {cam}, °"
    order = np.argsort(turned)
    notes = ["line: unknown as 0" if advice.unknown else "line: as given"] * bool(sampled or advice.unknown)
    notes = [] if advice.any_hole else [*notes, *["marks: median, 5 to 95 %"] * bool(sampled)]
    for k, (M_g, limit) in enumerate(zip(result.torques, limits or [None] * len(result.torques), strict=True)):
        marks = tuple(
            CurveMark(at.rotation_deg / per, at.F_ior_arcsec[k], "now" if kind == "now" else "best", kind)
            for kind, at in marked.items()
            if kind == "now" or at.rotation_deg
        )
        label = "; ".join([f"F'_ior at {M_g:g} N·m, ″", *notes])
        held = ["dashed: the limit less the self error"] * (limit is not None)
        yield Curve(
            turned[order], result.F_ior_arcsec[k, order], x_label, label,
            caption="; ".join([f"F'_ior over the {over} of the wheel at {M_g:g} N·m", *notes, *held]),
            whiskers=whiskers_of(sampled, k, per), marks=marks,
            limit=limit, points=bool(result.holes) and not advice.any_hole, from_zero=True, rows=6,
        )  # fmt: skip


def positions_table(advice: Advice) -> Table:
    """The present, chosen and worst position: F'_ior, over samples its median and range."""
    choice, found = advice.choice, advice.positions
    spread = ": median (5 to 95 %)" if found else ""
    rows = []
    for words, position in (("now", choice.current), ("best", choice.chosen), ("worst", choice.ranked[-1])):
        cells, change = [f"{F_ior:.2f}" for F_ior in position.F_ior_arcsec], position.change_from(choice.current)
        if found:
            place = found.place(position.rotation_deg)
            change = 0.0 if place is None else 0.0 - found.range_of(found.gains(place))[1]
            cells = _ranges(found, place)
        rows.append((words, bare(position.rotation_deg, advice.curve.holes), *cells, f"{100 * change:+.0f} %"))
    heads = (f"at {M_g:g} N·m" for M_g in advice.curve.torques)
    title = f"F'_ior, ″{spread}; turns counter-clockwise from the cam side"
    where = "hole" if advice.curve.holes else "turn, °"
    return Table(title, ("position", where, *heads, "against now"), tuple(rows))


def _ranges(found: PositionStatistics, place: int | None) -> list[str]:
    """Median of a position at each torque, and its range."""
    ends = zip(*(found.quantile(level, place) for level in LEVELS.values()), strict=True)
    return [f"{middle:.2f} ({low:.1f}-{high:.1f})" for middle, low, high in ends]


def corrected_words(advice: Advice) -> str:
    """What to do where a stored correction takes off the rest; empty without one."""
    if not (found := advice.corrected):
        return ""
    if advice.order_corrected != "none":
        words = instruction(advice.choice, gains=False)
        return f"{words} The correction ({found.form}) is made there, and for no other hole."
    words = f"With {found.form} no hole is surely better by what is left"
    if (gain := found.gain_probability) and gain.value > EVEN:
        best = hole_place(found.most.position(advice.drive, 0.0, found.most.challenger))
        words = f"With {found.form} less is left in {best} with {probability_words(gain, advice.needed)}"
    return f"{words}. By F'_ior: {what_to_do(replace(advice, corrected=None))}"


def corrected_table(advice: Advice) -> Iterator[Table]:
    """What a stored correction leaves now, in the position where that is least, and where it is most."""
    if not (found := advice.corrected):
        return
    most, holes = found.most, advice.curve.holes
    rows = []
    for words, place in (("now", most.place(0.0)), ("least", most.best), ("most", most.ranked[-1])):
        rows.append((words, bare(0.0 if place is None else most.rotations_deg[place], holes), *_ranges(most, place)))
    heads = (f"at {M_g:g} N·m" for M_g in advice.curve.torques)
    title = f"left by {found.form}, made in each hole, ″: median (5 to 95 %)"
    yield Table(title, ("left", "hole" if holes else "turn, °", *heads), tuple(rows))


def _corrected_object(advice: Advice) -> Json | None:
    """What a stored correction leaves in each position; None without one."""
    if not (found := advice.corrected):
        return None
    most = found.most
    places = range(len(most.rotations_deg))
    left = {name: [most.quantile(level, place) for place in places] for name, level in LEVELS.items()}
    return {
        "form": found.form,
        "order": advice.order_corrected,
        "rotation_deg": most.rotations_deg,
        "left_arcsec": left,
    }


def _values(advice: Advice, seed: int) -> Json:
    """Curves and positions; those of no direction that is known are none."""
    result, choice, known = advice.curve, advice.choice, not advice.any_hole
    curves = zip(result.torques, result.F_ior_arcsec, result.every_state, strict=True)
    named = {
        "current": choice.current,
        "best_bet": choice.chosen,
        "worst": choice.ranked[-1],
        "gain": advice.gain,
        "gain_range": _percentiles(advice.gain_range),
        "probability_gain": advice.gain_probability,
    }
    return {
        "pitch": pitch_object(advice.measured),
        "instruction": what_to_do(advice),
        "order": advice.order,
        "turn": advice.order == "turn",
        "measure": advice.to_try if advice.order == "none" else [],
        "to_measure": measure_objects(advice.to_measure),
        "influence": influence_objects(advice.influences),
        "samples": samples_object(advice.samples),
        "curves": [
            {"M_g_Nm": M_g, "phase_deg": result.phase_deg, "F_ior_arcsec": values, "every_state": every}
            for M_g, values, every in curves
        ],
        "rotation_deg": result.rotation_deg,
        "recommended": choice.chosen if advice.order != "none" else None,
        **{name: value if known else None for name, value in named.items()},
        "belief": _belief(advice),
        "compensated": _corrected_object(advice),
        "unknown": unknown_objects(advice.unknown),
        "best_gain_range": _percentiles(advice.best_gain_range),
        "probability_needed": advice.needed,
        "seed": seed,
    }


def _percentiles(found: tuple[float, float, float]) -> Json:
    return dict(zip(("p5", "p50", "p95"), found, strict=True))


def _belief(advice: Advice) -> Json | None:
    """F'_ior over the samples: now at each torque, and in every position; None without samples."""
    if not (found := advice.positions):
        return None
    now = [_percentiles(found.range_of(each)) for each in found.now_arcsec]
    direction = advice.drive.number(standing_offset(advice.drive)[1])
    return {
        "now": [{"M_g_Nm": M_g, **each} for M_g, each in zip(advice.curve.torques, now, strict=True)],
        **positions_object(found, advice.drive, direction),
    }


def _csv(advice: Advice) -> CsvTable:
    """Header and rows of a table, one row per torque and position."""
    result = advice.curve
    torques, positions = result.F_ior_arcsec.shape
    return csv_columns(
        M_g_Nm=np.repeat(result.torques, positions),
        rotation_deg=np.tile(result.rotation_deg, torques),
        phase_deg=np.tile(result.phase_deg, torques),
        F_ior_arcsec=result.F_ior_arcsec.ravel(),
        every_state=result.every_state.ravel().astype(int),
    )


def mount_card_facts(advice: Advice, say: Texts) -> CardFacts:
    """Contents of the assembly card of an advice; say, the texts of its language."""
    drive, drawn = advice.drive, advice.positions
    offset, cam = standing_offset(drive)
    return CardFacts(
        choice=advice.choice,
        cam_deg=drive.number(cam) if drive.number(offset) else None,
        measured=advice.measured,
        gain_range=advice.gain_range if drawn else None,
        gain_probability=advice.gain_probability if advice.order_corrected == "none" else None,
        correction=advice.corrected.form if advice.corrected else "",
        open_=len(advice.open_) if drawn else 0,
        warnings=mount_warnings(advice, say),
    )
