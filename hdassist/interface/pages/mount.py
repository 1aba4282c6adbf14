"""Reports of the best hole for the fixed wheel: the hole, its probability, and the benefit of measuring."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from math import ceil

import numpy as np

from hdassist.drive.model.deviations import unknown_names
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.text import shown
from hdassist.features.correction.forms import form_words
from hdassist.features.mounting.advice import UNSHOWN_VALUES, Advice, Verification
from hdassist.features.mounting.decision import FEWEST_SURE, FEWEST_VALUES, LEVELS
from hdassist.features.mounting.positions import MountingCurve, Position, bare, hole_of, named_position
from hdassist.features.mounting.posterior import HolePosterior, Trial
from hdassist.features.report import (
    CsvTable,
    Curve,
    CurveMark,
    Fact,
    Facts,
    Figure,
    Json,
    Report,
    Table,
    attributes,
    csv_columns,
    influence_objects,
    pitch_object,
    samples_object,
    to_error_digit,
    unknown_objects,
)
from hdassist.interface.pages.card import (
    ENGLISH,
    TRADE,
    WHEELS,
    hole_place,
    instruction,
    measured_value,
    outcome_name,
    place_at,
    seat_of,
    start_of_count,
    warnings_of,
)
from hdassist.interface.terminal.words import Texts, again, heading, influence_words, samples_words
from hdassist.readers.pitch import ASSUMED
from hdassist.run.errors import Verdict

WORDS = {"TURN": "TURN", "LEAVE": "LEAVE", "BEST_BET": "BEST BET", "ANY_HOLE": "ANY HOLE"}
_VERIFICATION_WORDS = {"KEEP": "KEEP", "GO_BACK": "GO BACK", "MEASURE_AGAIN": "MEASURE AGAIN"}
_ANY_LINE = "any"  # output of -q if any hole may be chosen
_NO_HOLE_BETTER = {
    "floating": "the wave generator aligns itself (stiffness of its support: 0), so its eccentricity has no effect",
    "standing": "no part that is fixed to the housing seat has a deviation",
    "turning": "the fixed wheel has no deviation, so its hole has no effect",
}
_ROWS = 3  # number of best-ranked holes on the first screen, which also shows the present and the worst hole
_APART = 3.0  # largest difference without a warning between two values of one hole, in standard deviations


def mount_report(
    advice: Advice,
    seed: int,
    *,
    carded: bool = False,
    sure: float | None = None,
) -> Report:
    """Return the report of the choice of a hole for a drive.

    advice: choice of a hole.
    seed: seed of the samples.
    carded: whether a card is written.
    sure: required probability that the choice is right, None if none is required. With a smaller probability, the exit
        code is 6.
    """
    drive = advice.drive
    figures = list[Figure](_position_curves(advice))
    say = ENGLISH.variant("trials") if advice.trials else ENGLISH
    figures.append(seat_of(advice, say, advice.chosen))
    count = len(advice.trials)
    where = f"{TRADE[drive.mounting.fixed]}{heading(advice.measured)}"
    if count:
        torques = " and ".join(f"{M_g:g}" for M_g in advice.torques_of_values)
        # a value without a stated uncertainty has the uncertainty given by --noise or by its default
        is_each_known = all(trial.noise_arcsec for trial in advice.trials)
        spread = "" if is_each_known else f" (± {2 * advice.setup.noise_arcsec:g}″, k = 2)"
        where = f"{count} measured value{'s' if count > 1 else ''}{spread} at {torques} N·m"
    decision = advice.decision
    stay = () if decision.stay is None else (decision.stay,)
    rows = dict.fromkeys((decision.best, *decision.ranked[:_ROWS], *stay, decision.worst))
    if decision.all_alike:  # the differences between the holes are due to chance
        rows = {decision.best: None}
    return Report(
        command="mount",
        drive=drive,
        head=f"{drive.name}, {where}",
        verdict=_verdict(advice),
        why=tuple(filter(None, _why(advice))),
        blocks=(_positions_table(advice, list(rows)), Facts.of(_facts(advice, carded=carded)), *figures[:1]),
        details=(
            *figures[1:],
            _positions_table(advice, range(len(decision.rotations_deg)), "all holes"),
            Facts.of(_more_facts(advice)),
        ),
        certificate=advice.certificate,
        cross_checks=advice.cross_checks,
        values=_values(advice, seed),
        csv=_csv(advice),
        line=bare(advice.chosen.rotation_deg, drive.mounting.holes) if advice.names_hole else _ANY_LINE,
        warnings=mount_warnings(advice),
        exit_code=_exit_code(advice, sure),
    )


def _verdict(advice: Advice) -> str:
    """Return the verdict in words: the word for the choice, followed by the hole unless all holes are equal."""
    if not advice.names_hole:
        return WORDS[advice.word]
    word = _VERIFICATION_WORDS[advice.verification.verdict] if advice.verification else WORDS[advice.word]
    return f"{word}, {hole_place(advice.chosen)}"


def _exit_code(advice: Advice, sure: float | None) -> int:
    """Return the exit code of a choice; sure: required probability of the choice, None if none is required."""
    if advice.verification and advice.verification.verdict == "GO_BACK":
        return Verdict.FAIL.exit_code
    if advice.verification and advice.verification.verdict == "MEASURE_AGAIN":
        return Verdict.INCONCLUSIVE.exit_code
    return Verdict.INCONCLUSIVE.exit_code if sure and not advice.decision.is_sure(sure) else 0


def mount_warnings(advice: Advice, say: Texts = ENGLISH) -> tuple[str, ...]:
    """Return the warnings about a choice in the language of the texts."""
    texts_of_warnings = list(warnings_of(advice.drive, say))
    if advice.open_ and not advice.decision.is_sampled:
        texts_of_warnings.append(say("warning.not_drawn", count=len(advice.open_)))
    if advice.measured and not advice.drive.mounting.holes:
        texts_of_warnings.append(say("warning.steps"))
    for name, measured in advice.measured.by_name.items() if advice.measured else ():
        if ASSUMED["sense"][1] in measured.pitch.notes:
            texts_of_warnings.append(
                say(
                    "warning.sense",
                    wheel=say(f"wheel.{WHEELS[name]}"),
                    file=shown(measured.pitch.file),
                )
            )
    return (*texts_of_warnings, *_warnings_of_values(advice, say))


def _warnings_of_values(advice: Advice, say: Texts) -> Iterator[str]:
    """Yield warnings about measured values in the language of the texts."""
    yield from advice.samples.remarks if advice.samples else ()
    after = advice.after
    if not after:
        return
    if after.samples.few:
        yield (
            f"{after.samples.few}: the probability of the choice is approximate; check the measured values, then the "
            "assumed ranges"
        )
    elif after.effective < FEWEST_SURE:
        # the effective sample size grows in proportion to the number of samples
        draws = ceil(after.samples.draws * FEWEST_SURE / after.effective)
        yield say(
            "warning.effective",
            count=f"{after.effective:.0f}",
            wanted=FEWEST_SURE,
            number=draws,
        )
    if M_g := advice.likelier_torque:
        stated = say.torque(advice.torques_of_values[0])
        yield say(
            "warning.torque",
            likelier=say.torque(M_g),
            stated=stated,
            M_g=f"{M_g:g}",
        )
    if trial := advice.suspected:
        probability = float(after.misread[advice.trials.index(trial)])
        name = "warning.misread" if probability > 0.5 else "warning.misread_of_several"
        yield say(name, value=_measured(advice, trial, say), share=say.percent(probability))
    yield from _out_of_range_warnings(advice, after, say)
    if after.by_values > UNSHOWN_VALUES:
        yield say("warning.by_values", share=say.percent(after.by_values))
    elif advice.contradicted:
        path, direction_deg, spread_deg = advice.contradicted
        yield say(
            "warning.contradicted",
            found=say.angle(round(direction_deg)),
            spread=say.angle(round(spread_deg)),
            stated=say.angle(advice.drive.number(path)),
        )
    yield from _repeat_warnings(advice, after, say)


def _out_of_range_warnings(
    advice: Advice,
    after: HolePosterior,
    say: Texts,
) -> Iterator[str]:
    """Yield a warning about each value outside its predicted range."""
    for trial in advice.trials:
        predicted = after.samples.predicted(trial)
        if predicted.is_above or predicted.is_below:
            yield say(
                "warning.above_range" if predicted.is_above else "warning.below_range",
                value=_measured(advice, trial, say),
                low=say.number(predicted.low_arcsec, ".3g"),
                high=say.number(predicted.high_arcsec, ".3g"),
            )


def _repeat_warnings(
    advice: Advice,
    after: HolePosterior,
    say: Texts,
) -> Iterator[str]:
    """Yield a warning for each pair of values of one position whose difference is too large to be noise."""
    for k, later in enumerate(advice.trials):
        for earlier in advice.trials[:k]:
            if advice.setup.point(later) != advice.setup.point(earlier):
                continue
            noise_arcsec = float(np.linalg.norm(after.samples.noise((later, earlier))))
            if abs(later.F_ior_arcsec - earlier.F_ior_arcsec) > _APART * noise_arcsec:
                yield say(
                    "warning.repeats",
                    where=_where(advice, later.rotation_deg, say),
                    values=f"{measured_value(earlier, say)}″, {measured_value(later, say)}″",
                    noise=say.number(advice.setup.noise_arcsec),
                )


def _where(
    advice: Advice,
    rotation_deg: float,
    say: Texts = ENGLISH,
) -> str:
    """Return a position as text, with its angle."""
    hole = hole_of(rotation_deg, advice.drive.mounting.holes)
    angle = say.angle(rotation_deg)
    return angle if hole is None else f"{place_at(rotation_deg, hole, say)} ({angle})"


def _measured(
    advice: Advice,
    trial: Trial,
    say: Texts = ENGLISH,
) -> str:
    """Return a measured value with its position and, if values were measured at several torques, its torque."""
    parts = [_where(advice, trial.rotation_deg, say)]
    if len(advice.torques_of_values) > 1:
        parts.append(say.torque(advice.torque_of(trial)))
    return say(
        "foot.trial",
        where=", ".join(parts),
        value=measured_value(trial, say),
    )


def instruction_of(advice: Advice) -> str:
    """Return the instruction for the fixed wheel, after the reason if no hole is better than another."""
    return " ".join(filter(None, reversed(order_and_reason(advice))))


def order_and_reason(advice: Advice) -> tuple[str, str]:
    """Return the instruction for the fixed wheel, and the reason why no hole is better than another.

    The reason is empty if one hole is better than the others.
    """
    if advice.verification:
        return _verification_words(advice, advice.verification), ""
    if advice.to_repeat:  # F'_ior in the chosen hole depends on the doubtful value
        return f"{_repeat_words(advice)} Until then, the best choice is: {instruction(advice, gains=False)}", ""
    order = instruction(advice)
    if advice.correction:
        order = instruction(advice, gains=False)
        form = form_words(advice.correction)
        order += f" Make the correction ({form}) in this hole; it is not valid in any other hole."
    if advice.compensated and not advice.correction:
        form = form_words(advice.compensated[0])
        equal = f"With a correction ({form}), the residual F'_ior is the same in all holes."
        order = f"{equal} Recommendation without a correction: {order}"
    if advice.names_hole:
        return order, ""
    if why := _NO_HOLE_BETTER.get(advice.no_hole_better):
        return order, f"No hole is better than another: {why}."
    if advice.decision.all_alike:
        return order, "The direction of the deviations is unknown, so no hole is expected to be better than another."
    return order, "No hole is expected to be better than another by 1 %."


def _verification_words(advice: Advice, checked: Verification) -> str:
    """Return the instruction that follows from a value measured after bolting.

    The instruction states the measured value and its predicted interval.
    """
    fixed = ENGLISH.fixed_wheel(advice.drive)
    predicted = f"predicted {checked.mean_arcsec:.1f}″ ({checked.low_arcsec:.1f} to {checked.high_arcsec:.1f}″, 95 %)"
    compared = f"Measured {_measured(advice, checked.trial)}; {predicted}."
    if not checked.as_predicted:
        compared += " The value is outside the predicted interval: check the seat and the measurement."
    place = _located(advice.chosen)
    if checked.verdict == "GO_BACK":
        back = measured_value(checked.goal)
        moved = instruction(advice, gains=False)
        decided = (
            "" if checked.as_predicted or checked.is_misread else " The measured values decide, not the prediction."
        )
        return f"{moved} F'_ior measured in that hole: {back}″. {compared}{decided}"
    if checked.verdict == "MEASURE_AGAIN":
        odds = advice.after.misread[-1] if advice.after else 1.0
        return (
            f"Make sure that the {fixed} is {place}, and measure there again. "
            f"Probability of a reading error: {100 * odds:.0f} %. {compared}"
        )
    return f"Keep the {fixed} {place}. {compared}"


def _located(position: Position) -> str:
    """Return where a position is, as text: in a hole, or at an angle if the seat has no holes."""
    return f"{'at' if position.hole is None else 'in'} {hole_place(position)}"


def _repeat_words(advice: Advice) -> str:
    """Return the instruction to measure a doubtful value again; empty if no value is doubtful."""
    doubted = advice.to_repeat
    if not (doubted and advice.after):
        return ""
    odds = 100 * advice.after.misread[advice.trials.index(doubted)]
    where = place_at(doubted.rotation_deg, hole_of(doubted.rotation_deg, advice.drive.mounting.holes))
    several = f" and {advice.torque_of(doubted):g} N·m" if len(advice.torques_of_values) > 1 else ""
    value = measured_value(doubted)
    return f"Repeat the measurement for {where}{several}. Probability that {value}″ is a reading error: {odds:.0f} %."


def _why(advice: Advice) -> Iterator[str]:
    """Yield the instruction, its probability, and the next measurement."""
    yield instruction_of(advice)
    if not advice.verification:
        yield _probability_words(advice)
        if not advice.to_repeat:
            yield next_value_words(advice)


def _probability_words(advice: Advice) -> str:
    """Return a sentence with the probability of the choice, or with the reason why the probability is unknown.

    If no hole is named, the sentence states the fault of the samples, and is empty without a fault.
    """
    decision = advice.decision
    if not advice.names_hole:
        return f"F'_ior is computed at nominal values: {advice.fault}." if advice.fault else ""
    if not decision.is_sampled:
        why = f": {advice.fault}" if advice.fault else ""
        return f"The choice is made at nominal values; its probability is unknown{why}."
    few = decision.probability.few
    by = f" by more than {100 * decision.cost:g} %"
    outcome = "LEAVE" if decision.best == decision.stay else "TURN"
    sure = decision.probability.text(advice.sure if few else None, outcome=outcome)
    place = hole_place(advice.chosen)
    start = start_of_count(advice.drive)
    if decision.best == decision.stay:
        sentence = f"Probability that no other hole is better than {start}{by}: {sure}."
    elif decision.stay is None:
        sentence = f"Probability that {place} is within 5 % of the best allowed hole: {sure}."
    else:
        sentence = f"Probability that {place} is better than {start}{by}: {sure}."
    if advice.after and advice.decision.effective:
        sentence += f" Effective sample size: {advice.after.effective:.0f}."
    return sentence


def next_value_words(advice: Advice) -> str:
    """Return the next measurement and its expected benefit, or the advice to stop; empty if the benefit is unknown."""
    value = advice.value
    worths = advice.worths
    if not value:
        return ""
    (count, _), *later = worths
    if count:
        (_, one), (_, three) = later
        if not advice.next:
            return f"Stop measuring: one more value would reduce {_reduction(advice, one)}."
        M_g = advice.next_torque
        again_ = " again" if (advice.next.rotation_deg, M_g) in map(advice.setup.point, advice.trials) else ""
        torque_words = f" at {M_g:g} N·m" if advice.torques_of_values != (M_g,) else ""
        action = f"Before bolting, measure F'_ior {_located(advice.next)}{torque_words}{again_}"
        reason = _reason_before_stop(advice)
        if reason:
            return f"{action}. {reason}"
        if not value.is_worth(advice.worth):
            action += f": with fewer than {advice.fewest_values} values, a reading error may go unnoticed"
        return f"{action}. {_expected(advice, (one, 'one more value'), (three, 'three'))}"
    after = dict(later)
    if not advice.next:
        return f"No need to measure: six values would reduce {_reduction(advice, after[6], 'only ')}."
    holes = ", ".join(hole_place(p) for p in advice.to_try)
    gain = _expected(advice, (after[FEWEST_VALUES], "five values"), (after[6], "six"))
    action = f"To reduce F'_ior, measure it at {advice.setup.M_g:g} N·m in {holes}"
    return f"{action}, then in the holes that this command names next. {gain}"


def _reason_before_stop(advice: Advice) -> str:
    """Return the reason to measure a further value although its expected gain is small.

    The text is empty if the gain is large enough, or if there are too few values to stop.
    """
    if advice.values < advice.fewest_values or not advice.value or advice.value.is_worth(advice.worth):
        return ""
    if advice.doubtful:
        trial, probability = advice.doubtful
        return f"Probability that {measured_value(trial)}″ is a reading error: {100 * probability:.0f} %."
    if advice.likely_neighbour:
        place, probability = advice.likely_neighbour
        better = f"{hole_place(advice.position(place))} is better than {hole_place(advice.chosen)}"
        return f"Probability that {better} by more than {100 * advice.worth:g} %: {100 * probability:.0f} %."
    return ""


def _reduction(
    advice: Advice,
    F_ior: float,
    only: str = "",
) -> str:
    """Return the reduction of F'_ior by further values as text.

    For several torques, the text gives the mean reduction in %; for one torque, the mean F'_ior before and after.

    F_ior: mean F'_ior [arcsec] expected after the further values.
    only: word before the reduction.
    """
    F_ior_now = advice.worths[0][1]
    if len(advice.torques) > 1:
        return f"F'_ior {only}by {100 * max(1 - F_ior / F_ior_now, 0.0):.1f} % on average"
    before = f"{F_ior_now:.1f}"
    after = f"{F_ior:.1f}"
    if before == after:
        return f"the mean F'_ior of {before}″ by less than 0.1″{_elsewhere(advice)}"
    return f"the mean F'_ior {only}from {before} to {after}″{_elsewhere(advice)}"


def _expected(advice: Advice, *gains: tuple[float, str]) -> str:
    """Return a sentence with F'_ior expected after further values; gains: pairs of F'_ior and a count as text."""
    F_ior_now = advice.worths[0][1]
    if len(advice.torques) > 1:
        shares = ", ".join(f"{100 * max(1 - F_ior / F_ior_now, 0.0):.1f} % after {count}" for F_ior, count in gains)
        return f"Expected reduction of F'_ior: {shares}."
    values = ", ".join(f"{F_ior:.1f}″ after {count}" for F_ior, count in gains)
    return f"Mean F'_ior{_elsewhere(advice)} expected in the hole then chosen: {values} (now {F_ior_now:.1f}″)."


def _elsewhere(advice: Advice) -> str:
    """Return the deciding torque as text; empty if all values were measured at this torque."""
    deciding = advice.torques[0]
    return "" if {deciding} == {*advice.torques_of_values} else f" at {deciding:g} N·m"


def _facts(advice: Advice, *, carded: bool) -> Iterator[Fact]:
    """Yield the best hole for each torque, limits and the next command, each as a label and a text."""
    decision = advice.decision
    best_deg = [position.rotation_deg for position in advice.by_torque]
    if advice.names_hole and not advice.verification and any(angle_deg != best_deg[0] for angle_deg in best_deg):
        texts_by_torque = (
            f"{M_g:g} N·m: {hole_place(position)}"
            for M_g, position in zip(advice.torques, advice.by_torque, strict=True)
        )
        yield "best hole for each torque", "; ".join(texts_by_torque)
    if decision.stay is None:
        yield "not allowed", f"{start_of_count(advice.drive)}, so the {ENGLISH.fixed_wheel(advice.drive)} has to move"
    if decision.is_sampled and not advice.correction and decision.probability_kept is not None:
        yield "limit", _limit_words(advice, decision.probability_kept)
    if advice.unknown and not decision.is_sampled:
        yield "unknown", f"set to 0: {unknown_names(advice.unknown)}"
    if advice.verification:
        return
    if advice.next and not advice.measured:
        yield "next", again("mount", advice.drive, *(f"{name}=F_IOR" for name in _next_names(advice)))
    elif not carded:
        yield "next", again("mount", advice.drive, "--card", "card.html")
    elif advice.trials:
        yield "next", again("mount", advice.drive, "--verify", f"{outcome_name(advice)}=F_IOR")
    elif advice.names_hole and not advice.measured:
        yield "next", again("mount", advice.drive, f"{outcome_name(advice)}=F_IOR")


def _limit_words(advice: Advice, probability_met: Array) -> str:
    """Return the probability of meeting the limits as text: in the chosen hole and, if this is another hole, in hole 0.

    probability_met: probability of meeting the limits in each hole, shape (holes,).
    """
    drive = advice.drive
    decision = advice.decision
    limits = [f"{limit:g}″ at {M_g:g} N·m" for M_g in advice.torques if (limit := drive.limit(M_g)) is not None]
    stays = ""
    if advice.chosen.rotation_deg and decision.stay is not None and advice.names_hole:
        stays = f"; {start_of_count(drive)}: {100 * probability_met[decision.stay]:.0f} %"
    goal = hole_place(advice.chosen) if advice.names_hole else "whichever hole is used"
    event = f"F'_ior + self error in {goal} is at most {', '.join(limits)}"
    return f"probability that {event}: {100 * probability_met[decision.best]:.0f} %{stays}"


def _next_names(advice: Advice) -> list[str]:
    """Return the names of the positions to measure next, as written on the command line."""
    if not advice.trials or not advice.next:
        return [_name(advice, position.rotation_deg) for position in advice.to_try]
    name = _name(advice, advice.next.rotation_deg)
    if advice.next_torque != advice.setup.M_g:
        name += f"@{advice.next_torque:g}"
    return [name]


def _name(advice: Advice, rotation_deg: float) -> str:
    """Return the name of a position, as written before a measured value on the command line."""
    return named_position(rotation_deg, advice.drive.mounting.holes)


def _more_facts(advice: Advice) -> Iterator[Fact]:
    """Yield gain, contributions, samples, repeatability, eccentricity and scale, each as a label and a text."""
    if advice.turn and advice.decision.is_sampled and not advice.correction:
        low, middle, high = (-100 * gain for gain in advice.gain_range)
        places = f"F'_ior in {hole_place(advice.chosen)} relative to that in {start_of_count(advice.drive)}"
        yield "gain", f"{places}: {middle:+z.0f} % ({low:+z.0f} to {high:+z.0f})"
    if advice.samples:
        yield "contributions", influence_words(advice.influences, "the gain")
        yield "unknown", unknown_names(advice.unknown)
        yield "samples", samples_words(advice.samples)
    if after := advice.after:
        noise_arcsec = advice.setup.noise_arcsec * after.noise.mean()
        yield "repeatability", f"stated {advice.setup.noise_arcsec:g}″, estimated {noise_arcsec:.2f}″ (1σ)"
        size, _ = after.offset
        if after.facing[0] is not None and len(size):
            direction_words = f"at {after.facing[0]:.0f}° ± {after.facing[1]:.0f}°"
            yield (
                "eccentricity",
                f"of the wave generator: {size.mean():.0f} ± {size.std():.0f} µm {direction_words} (k = 1)",
            )
        ratio = f"{after.scale.mean():.2f} ± {after.scale.std():.2f}"
        yield "scale", f"ratio of measured to computed F'_ior: {ratio} (k = 1)"
        yield "unknown", unknown_names(advice.unknown)


def _positions_table(
    advice: Advice,
    places: Sequence[int],
    title: str = "",
) -> Table:
    """Return a table of F'_ior (median and range) and the probabilities of holes; places: indices of the holes."""
    decision = advice.decision
    is_sampled = decision.is_sampled
    stands_for_all = decision.all_alike and not title  # one row represents all holes
    names = _names_of_places(advice)
    rows = []
    for place in places:
        label = "" if stands_for_all else names.get(place, "")
        rows.append(_position_row(advice, place, label, stands_for_all=stands_for_all))
    spread = ": median (5 to 95 %)" if is_sampled else ""
    if stands_for_all:
        spread += " in every hole"
    residual = f"residual F'_ior ({form_words(advice.correction)})" if advice.correction else "F'_ior"
    torque_heads = (f"at {M_g:g} N·m" for M_g in advice.torques)
    place_head = "angle, °"
    counting = "angles are positive"
    if advice.drive.mounting.holes:
        place_head = "hole"
        counting = "holes are numbered"
    probability_heads = ("P(better)", "P(within 5 %)") if is_sampled else ()
    notes = []
    if is_sampled:
        better = f"lower than in {start_of_count(advice.drive)} by > {100 * decision.cost:g} %"
        notes.append(f"P(better): {better}; P(within 5 %): of the best hole; in %")
    mean = " mean" if is_sampled else ""
    governing = " at governing torque" if len(advice.torques) > 1 else ""
    of_what = f":{mean}{governing}" if mean or governing else ""
    notes.append(f"excess over best hole{of_what}; {counting} counter-clockwise")
    title_start = f"{title}: " if title else ""
    return Table(
        f"{title_start}{residual}, ″{spread}",
        ("", place_head, *torque_heads, *probability_heads, "excess, %"),
        tuple(rows),
        notes=tuple(notes),
    )


def _names_of_places(advice: Advice) -> dict[int | None, str]:
    """Return the labels of the present, the worst and the best hole, by the index of the hole."""
    decision = advice.decision
    names = {decision.stay: _standing(advice)}
    if advice.names_hole:
        # the best hole is labelled "best" even if the wheel is already in it
        names = {decision.worst: "worst", **names, decision.best: "best"}
    if advice.verification:
        names[decision.best] = _VERIFICATION_WORDS[advice.verification.verdict].lower()
    return names


def _position_row(
    advice: Advice,
    place: int,
    label: str,
    *,
    stands_for_all: bool,
) -> tuple[str, ...]:
    """Return the table row of a hole: label, hole, F'_ior at each torque, probabilities and excess.

    place: index of the hole.
    label: text of the first cell.
    stands_for_all: whether the row represents all holes.
    """
    action = advice.decision.action(place)
    cells = [label, _ANY_LINE if stands_for_all else bare(action.rotation_deg, advice.drive.mounting.holes)]
    errors = {name: advice.decision.standard_errors(share, place) for name, share in LEVELS.items()}
    for k in range(len(advice.torques)):
        low, high = (to_error_digit(action.F_ior_arcsec[name][k], errors[name][k], 1) for name in ("p5", "p95"))
        median = to_error_digit(action.F_ior_arcsec["p50"][k], errors["p50"][k])
        cells.append(f"{median} ({low}-{high})" if advice.decision.is_sampled else median)
    if advice.decision.is_sampled:
        cells += [f"{100 * action.probability_better:.0f}", f"{100 * action.probability_good:.0f}"]
    return (*cells, f"{100 * action.expected_loss:.1f}")


def _standing(advice: Advice) -> str:
    """Return the word for hole 0: "now" if the wheel is still in it, or "first" after measurements in other holes."""
    return "first" if advice.trials else "now"


def _position_curves(advice: Advice) -> Iterator[Curve]:
    """Yield the curve of F'_ior over the positions of the wheel for each torque.

    A curve includes the ranges over the samples, the measured values and the limit, as far as these exist.
    """
    decision = advice.decision
    curve = advice.curve
    places = range(len(decision.rotations_deg))
    has_curve = curve is not None and len(curve.rotation_deg) > 1
    if (len(places) < 2 and not has_curve) or advice.no_hole_better == "standing":
        return
    # percentiles, each of shape (places, torques)
    low, middle, high = (np.array([decision.quantile(level, place) for place in places]) for level in LEVELS.values())
    holes = advice.drive.mounting.holes
    turns = np.array(decision.rotations_deg) / _turn_unit(advice)
    rooms = decision.room_arcsec or [None for _ in advice.torques]
    for k, (M_g, limit) in enumerate(
        zip(
            advice.torques,
            rooms,
            strict=True,
        )
    ):
        x = turns
        y = middle[:, k]
        if curve and not decision.is_sampled and len(curve.rotation_deg) > len(places):
            order = np.argsort(curve.rotation_deg)
            x = curve.rotation_deg[order] / _turn_unit(advice)
            y = curve.F_ior_arcsec[k, order]
        whiskers: tuple[tuple[float, float, float], ...] = ()
        if decision.is_sampled:
            whiskers = tuple(
                zip(
                    turns.tolist(),
                    low[:, k].tolist(),
                    high[:, k].tolist(),
                    strict=True,
                )
            )
        yield Curve(
            x=x,
            y=y,
            x_label="hole" if holes else "angle, °",
            y_label="; ".join([f"F'_ior at {M_g:g} N·m, ″", *_curve_notes(advice, M_g, limit)]),
            whiskers=whiskers,
            marks=tuple(_curve_marks(advice, k, middle[:, k])),
            limit=limit,
            points=bool(holes),
            from_zero=True,
            rows=5,
        )


def _turn_unit(advice: Advice) -> float:
    """Return the angle [deg] of one unit on the axis of positions: the hole spacing, or 1 if the angle is free."""
    holes = advice.drive.mounting.holes
    return 360 / holes if holes else 1.0


def _curve_notes(
    advice: Advice,
    M_g: float,
    limit: float | None,
) -> Iterator[str]:
    """Yield notes on the curve at a torque; limit: limit minus self error [arcsec], drawn as a line, or None."""
    if advice.decision.is_sampled:
        yield "median, 5 to 95 %"
    elif advice.unknown:
        yield "unknown inputs set to 0"
    if limit is not None:
        yield f"line: {limit:.4g} (limit {advice.drive.limit(M_g):g} minus self error)"


def _curve_marks(
    advice: Advice,
    torque: int,
    middle_arcsec: Array,
) -> Iterator[CurveMark]:
    """Yield the marks on the curve at a torque: measured values, and the present, the best and the next hole.

    Args:
        advice: choice of a hole.
        torque: index of the torque.
        middle_arcsec: median of F'_ior in each hole [arcsec], shape (holes,).
    """
    per_step = _turn_unit(advice)
    M_g = advice.torques[torque]
    for trial in advice.trials:
        if advice.torque_of(trial) == M_g:
            yield CurveMark(
                x=trial.rotation_deg / per_step,
                y=trial.F_ior_arcsec,
                words="measured",
                kind="now",
            )
    next_is_best = bool(advice.next and advice.names_hole and advice.next.rotation_deg == advice.chosen.rotation_deg)
    positions = []
    if advice.names_hole:
        positions.append((_standing(advice), advice.current, "now"))
        if not next_is_best:
            positions.append(("best", advice.chosen, "target"))
    for name, position, kind in positions:
        yield CurveMark(
            x=position.rotation_deg / per_step,
            y=position.F_ior_arcsec[torque],
            words=name,
            kind=kind,
        )
    next_place = advice.decision.place(advice.next.rotation_deg) if advice.next else None
    if next_place is not None:
        next_deg = advice.decision.rotations_deg[next_place]
        yield CurveMark(
            x=next_deg / per_step,
            y=float(middle_arcsec[next_place]),
            words="best and next" if next_is_best else "next",
            kind="target",
        )


def _values(advice: Advice, seed: int) -> Json:
    """Return a choice as JSON with the same keys for any inputs."""
    curve = advice.curve
    after = advice.after
    return {
        **_choice_values(advice),
        **_gain_values(advice),
        "samples": samples_object(advice.samples),
        "effective_samples": after.effective if after else advice.decision.effective,
        "curves": [] if curve is None else [_curve(curve, k) for k in range(len(curve.torques))],
        "now": _present_ranges(advice),
        "compensated": _compensated(advice),
        "trials": _trials(advice),
        "offset": _offset(advice.after),
        "verification": _verification(advice),
        "pitch": pitch_object(advice.measured),
        "unknown": unknown_objects(advice.unknown),
        "seed": seed,
    }


def _choice_values(advice: Advice) -> Json:
    """Return the chosen position and the results of all positions, as JSON."""
    decision = advice.decision
    goal = _goal(advice)
    # 5th and 95th percentile, at each torque, of the ratio of the largest to the smallest F'_ior
    ratio_ranges = [decision.range_of(F_ior.max(axis=1) / F_ior.min(axis=1))[::2] for F_ior in decision.F_ior_arcsec]
    return {
        **attributes(advice, "word", M_g_Nm="torques", probability_needed="sure"),
        **attributes(advice, "current"),
        "hole": goal["hole"],
        "rotation_deg": goal["rotation_deg"],
        "recommended": goal,
        "best_bet": goal,
        "destination": _destination(advice),
        "worst": advice.worst,
        "probability": decision.probability if decision.is_sampled else None,
        "instruction": instruction_of(advice),
        "positions": [
            attributes(advice.position(place), "hole", "phase_deg") | asdict(decision.action(place))
            for place in range(len(decision.rotations_deg))
        ],
        "worst_over_best": ratio_ranges,
        "by_torque": [
            {"torque_Nm": M_g, **attributes(position, "hole", "rotation_deg")}
            for M_g, position in zip(advice.torques, advice.by_torque, strict=True)
        ],
    }


def _gain_values(advice: Advice) -> Json:
    """Return the expected gain from further values, the gain from a turn and the contributions to the gain, as JSON."""
    return {
        "next": _next(advice),
        "worth": [{"values": count, "F_ior_arcsec": F_ior} for count, F_ior in advice.worths],
        "suspected": advice.suspected and _trial(advice, advice.suspected),
        "order": advice.order,
        "gain": dict(
            zip(
                LEVELS,
                advice.gain_range,
                strict=True,
            )
        ),
        "to_try": advice.to_try if advice.next and not advice.trials else [],
        "influence": influence_objects(advice.influences),
    }


def _present_ranges(advice: Advice) -> list[Json] | None:
    """Return the percentiles of F'_ior in the present hole at each torque, as JSON; None without samples."""
    decision = advice.decision
    if not decision.is_sampled:
        return None
    return [
        {
            "M_g_Nm": M_g,
            **dict(
                zip(
                    LEVELS,
                    decision.range_of(F_ior),
                    strict=True,
                )
            ),
        }
        for M_g, F_ior in zip(advice.torques, decision.now_arcsec, strict=True)
    ]


def _trials(advice: Advice) -> Json:
    """Return the measured values and their agreement with the samples, as JSON."""
    after = advice.after
    setup = advice.setup
    probabilities = after.misread if after else ()
    return {
        **attributes(setup, "noise_arcsec", M_g_Nm="M_g"),
        "noise_found_arcsec": setup.noise_arcsec * float(after.noise.mean()) if after else None,
        "measured": [
            {**_trial(advice, trial), "probability_misread": probability}
            for trial, probability in zip(advice.trials, probabilities, strict=True)
        ],
        "probability_by_values_alone": after.by_values if after else None,
    }


def _offset(after: HolePosterior | None) -> Json:
    """Return the wave generator's eccentricity given the measured values, as JSON.

    Size and direction are each given by mean and standard deviation, which are null if unknown.
    """
    size_um = after.offset[0] if after else np.zeros(0)  # shape (draws,)
    direction_deg, direction_sd_deg = after.facing if after else (None, None)
    return {
        "size_um": float(size_um.mean()) if len(size_um) else None,
        "size_sd_um": float(size_um.std()) if len(size_um) else None,
        "direction_deg": direction_deg,
        "direction_sd_deg": direction_sd_deg,
    }


def _verification(advice: Advice) -> Json | None:
    """Return the verification of the choice as JSON; None if the choice was not verified."""
    verification = advice.verification
    if not verification:
        return None
    return {
        **_trial(advice, verification.trial),
        **attributes(verification, "mean_arcsec", "low_arcsec", "high_arcsec", "as_predicted"),
        "verdict": verification.verdict,
        "position": _trial(advice, verification.goal),
    }


def _goal(advice: Advice) -> Json:
    """Return the chosen position as JSON; hole and angles are null if all holes are equal."""
    names = ("rotation_deg", "phase_deg", "hole", "F_ior_arcsec")
    goal = attributes(advice.chosen, *names)
    if advice.names_hole:
        return goal
    return goal | {"rotation_deg": None, "phase_deg": None, "hole": None}


def _destination(advice: Advice) -> Json | None:
    """Return the destination of the wheel and the shorter turn from hole 0 to it, as JSON.

    Return None if all holes are equal.
    """
    if not advice.names_hole:
        return None
    chosen = advice.chosen
    drive = advice.drive
    turn_deg = chosen.short_way_deg
    direction = "counter-clockwise" if turn_deg > 0 else "clockwise" if turn_deg else None
    return {
        "fixed": drive.mounting.fixed,
        "fixed_wheel": ENGLISH.fixed_wheel(drive),
        "hole": chosen.hole,
        "rotation_deg": chosen.rotation_deg,
        "from": start_of_count(drive),
        "turn_deg": abs(turn_deg),
        "turn_holes": None if chosen.hole is None else round(abs(turn_deg) * drive.mounting.holes / 360),
        "direction": direction,
        "seen_from": "wave generator side",
    }


def _next(advice: Advice) -> Json | None:
    """Return the hole to measure next, as JSON; None if no further value is needed.

    The gain from repeating a doubtful value is null.
    """
    value = advice.value
    if not advice.next or not (value or advice.to_repeat):
        return None
    repeats = advice.to_repeat is not None
    has_gain = value is not None and not repeats and value.rotation_deg == advice.next.rotation_deg
    gain_arcsec = value.gain_arcsec if value and has_gain else None
    place = attributes(advice.next, "hole", "rotation_deg")
    return place | {"gain_arcsec": gain_arcsec, "M_g_Nm": advice.next_torque, "repeats_misread": repeats}


def _curve(curve: MountingCurve, torque: int) -> Json:
    """Return the curve of F'_ior over the positions of the wheel as JSON; torque: index of its torque."""
    F_ior = curve.F_ior_arcsec[torque]
    every_state = curve.every_state[torque]
    angles = attributes(curve, "rotation_deg", "phase_deg")
    return {"M_g_Nm": curve.torques[torque], **angles, "F_ior_arcsec": F_ior, "every_state": every_state}


def _compensated(advice: Advice) -> Json | None:
    """Return the residual error with a stored correction in each position, as JSON; None if there is no correction."""
    if not advice.compensated:
        return None
    form, compensated = advice.compensated
    places = range(len(compensated.rotations_deg))
    ranges = {name: [compensated.quantile(level, place) for place in places] for name, level in LEVELS.items()}
    order = advice.order if advice.correction else "none"
    return {"form": form, "order": order, "rotation_deg": compensated.rotations_deg, "left_arcsec": ranges}


def _trial(advice: Advice, trial: Trial) -> Json:
    hole = hole_of(trial.rotation_deg, advice.drive.mounting.holes)
    of_value = attributes(trial, "rotation_deg", "F_ior_arcsec", "noise_arcsec", value="F_ior_arcsec")
    return {"hole": hole, **of_value, "M_g_Nm": advice.torque_of(trial), "file": trial.file or None}


def _csv(advice: Advice) -> CsvTable:
    """Return the CSV table with one row per torque and position."""
    decision = advice.decision
    curve = advice.curve
    count = len(advice.torques)
    rotations = curve.rotation_deg if curve else np.array(decision.rotations_deg)
    columns = {"M_g_Nm": np.repeat(advice.torques, len(rotations)), "rotation_deg": np.tile(rotations, count)}
    if curve:
        return csv_columns(
            **columns,
            phase_deg=np.tile(curve.phase_deg, count),
            F_ior_arcsec=curve.F_ior_arcsec.ravel(),
            every_state=curve.every_state.ravel().astype(int),
        )
    medians = [decision.quantile(0.5, place)[k] for k in range(count) for place in range(len(rotations))]
    return csv_columns(
        **columns,
        F_ior_p50_arcsec=medians,
        probability_good=np.tile(decision.probability_good, count),
        expected_loss=np.tile(decision.expected_loss, count),
    )
