"""The advice after trials as a report."""

from collections.abc import Iterator
from dataclasses import asdict

import numpy as np

from hdassist.belief.statistics import Probability, probability_by_share
from hdassist.json_parts import Json, attributes, unknown_objects
from hdassist.model.geometry import Array
from hdassist.model.unknown import unknown_names, unknowns
from hdassist.mounting.decision import GOOD
from hdassist.mounting.losses import PositionStatistics
from hdassist.mounting.positions import bare, hole_of
from hdassist.mounting.trial import Trial, Tried
from hdassist.pages.card import CardFacts, after_trials, warnings_of
from hdassist.pages.losses import SHARES, kept_line, losses_table, position_object, positions_object, whiskers_of
from hdassist.pages.mount import ORDER_WORDS
from hdassist.pages.seat import ENGLISH
from hdassist.report import (
    CsvTable,
    Curve,
    CurveMark,
    Fact,
    Facts,
    Quantities,
    Quantity,
    Report,
    as_object,
    csv_columns,
)
from hdassist.terminal.texts import Texts
from hdassist.trials.advice import TrialAdvice
from hdassist.trials.posterior import Prediction
from hdassist.verdict import Verdict

LISTED_HOLES = 3  # positions on the first screen, best first
TURNS = "turns counter-clockwise from the cam side"
APART = 3.0  # standard deviations by which values of one position may differ without a remark
UNLIKE = "the values came out unlike those of a drive as the preset has it"

POSTERIOR: Quantities[TrialAdvice] = (
    Quantity("offset.size_um", "cam offset", "um", ".0f", lambda a: a.offset[0]),
    Quantity("offset.size_sd_um", "standard deviation", "um", ".0f", lambda a: a.offset[1]),
    Quantity("offset.direction_deg", "towards", "deg", ".0f", lambda a: a.facing[0]),
    Quantity("offset.direction_sd_deg", "standard deviation", "deg", ".0f", lambda a: a.facing[1]),
    Quantity("scale", "F'_ior over the computed one", "", ".2f", lambda a: float(a.draws.scale.mean())),
    Quantity("scale_sd", "standard deviation (0.10 assumed before)", "", ".2f", lambda a: float(a.draws.scale.std())),
    Quantity("misfit", "misfit (0 to 12 % assumed)", "", ".0%", lambda a: float(a.draws.misfit.mean())),
    Quantity("effective_samples", "effective samples", "", ".0f", "draws.effective"),
)


def trials_report(advice: TrialAdvice, *, carded: bool = False) -> Report:
    """An advice after trials; carded, whether a card is written."""
    drive, losses, setup = advice.drive, advice.losses, advice.prior.rig
    count, holes, torques = len(advice.trials), drive.mounting.holes, drive.operation.M_g
    title = f"positions, least loss first, {TURNS}" + "; by the trials without the outcome" * (not advice.explained)
    back = Verdict.FAIL if advice.back_to else Verdict.INCONCLUSIVE
    listed = [losses_table(losses, holes, torques, title, losses.ranked[:most]) for most in (LISTED_HOLES, None)]
    return Report(
        command="trials",
        drive=drive,
        head=f"{drive.name}, {count} trial{'s' * (count > 1)} at {setup.M_g:g} N·m",
        verdict=_verdict(advice),
        why=(trials_instruction(advice),),
        blocks=(listed[0], Facts.of(_facts(advice, carded=carded)), _curve(advice)),
        details=(listed[1], Facts.of(_more_facts(advice))),
        certificate=advice.prior.certificate,
        values=_values(advice),
        csv=_csv(advice),
        line=bare(advice.stay[0], holes) if advice.outcome or advice.settled else "unknown",
        warnings=tuple(trials_warnings(advice, ENGLISH)),
        exit_code=(Verdict.PASS if advice.settled and not advice.back_to else back).exit_code,
    )


def _verdict(advice: TrialAdvice) -> str:
    if advice.outcome:
        return "GO BACK" if advice.back_to else "KEEP"
    return ORDER_WORDS[("turn" if advice.choice.turn else "leave") if advice.settled else "none"]


def trials_warnings(advice: TrialAdvice, say: Texts) -> Iterator[str]:
    """Warnings beside the numbers."""
    yield from warnings_of(advice.drive, say)
    outcome, rig, (best, good) = advice.outcome, advice.prior.rig, advice.losses.chosen
    if M_g := advice.likelier_torque:
        yield f"the values fit {M_g:g} N·m far better than {rig.M_g:g} N·m: measured at it? (--trial-torque {M_g:g})"
    if advice.suspected:
        share = f"{100 * advice.draws.misread.max():.0f} %"
        yield f"{_measured(advice, advice.suspected)} is probably misread ({share}): measure it again"
    elif (hinge := advice.hinges_on) and advice.stay[1] >= advice.needed:
        least = f"{100 * min(advice.without):.0f} % without it, {100 * advice.stable:g} % are wanted"
        yield f"the choice hinges on {_measured(advice, hinge)}: {least}: measure it again"
    if outcome and not outcome.as_predicted:
        yield f"{_outcome(advice, outcome)}: outside of what the trials predict: check seat and measurement"
    if outcome and advice.explained and not (advice.settled or advice.to_repeat or advice.back_to):
        best_bet = f"{advice.where(best)} may be better ({100 * good:.0f} %)"
        yield f"{_chance(advice)}; {'measure it once more' if best == advice.stay[0] else best_bet}"
    for a, b in advice.repeats:
        noise = np.linalg.norm(advice.prior.noise((a, b)))
        if abs(a.F_ior_arcsec - b.F_ior_arcsec) > APART * noise:
            values = f"{advice.where(a.rotation_deg)}: {a.F_ior_arcsec:g} and {b.F_ior_arcsec:g}″ differ by more"
            taken = f"it is taken for {advice.noise_arcsec:.1f}"
            yield f"{values} than a noise of {rig.noise_arcsec:g} makes likely; {taken}"
    if advice.unlike_told:
        check = "check the preset, the noise and how the holes were counted"
        yield f"{UNLIKE} (one in twenty of them may): {check}{_repeat(advice)}"


def _measured(advice: TrialAdvice, trial: Trial) -> str:
    """A value and its position in words."""
    return f"{trial.F_ior_arcsec:g}″ at {advice.where(trial.rotation_deg)}"


def _repeat(advice: TrialAdvice) -> str:
    if not (trial := advice.to_repeat):
        return ""
    return f"; nothing is settled before a position is measured twice: measure {advice.where(trial.rotation_deg)} again"


def _chance(advice: TrialAdvice) -> str:
    here, good = advice.stay
    sure = f"{np.floor(round(1000 * good, 6)) / 10:g} % probability, {100 * advice.needed:g} % are needed"
    return f"{advice.where(here)} loses less than {100 * GOOD:.0f} % with {sure}"


def _outcome(advice: TrialAdvice, of: Prediction) -> str:
    predicted = f"predicted {of.expected_arcsec:.1f} ({of.low_arcsec:.2f} to {of.high_arcsec:.2f})"
    return f"{of.F_ior_arcsec:g}″ at {advice.where(of.rotation_deg)}, {predicted}"


def trials_instruction(advice: TrialAdvice) -> str:
    """The order on the wheel, and how sure it is; where the trials do not settle it, the measurement to make."""
    if back := advice.back_to:
        there = f"Go back to {advice.where(back.rotation_deg)}, where {back.F_ior_arcsec:g} was measured"
    if advice.outcome:
        return f"{there if back else 'Keep it'}: {_outcome(advice, advice.outcome)}."
    if advice.settled:
        return f"{after_trials(advice.choice)} By the trials {_chance(advice)}."
    if advice.to_repeat and advice.unlike_told:
        return f"No order yet: {UNLIKE}{_repeat(advice)}."
    hinge = advice.hinges_on if advice.stay[1] >= advice.needed else None
    sure = f"{_chance(advice)}, but not without {_measured(advice, hinge)}" if hinge else _chance(advice)
    if advice.to_repeat:
        again = advice.where(advice.to_repeat.rotation_deg)
        return f"No order yet: {sure}. Before a new position measure {again} again: none was measured twice."
    return (
        f"No order yet: {sure}. To decide, measure {advice.where(advice.next[0])} next: "
        f"{100 * advice.next[1]:.0f} % are expected then. Five or six trials are normal."
    )


def _facts(advice: TrialAdvice, *, carded: bool) -> Iterator[Fact]:
    """Limits, how to go on, and the next command, a label and a text each."""
    torques, best = advice.drive.operation.M_g, advice.losses.best

    def kept(torque: int, room_arcsec: float) -> Probability:
        share = float(np.mean(advice.losses.at(best)[torque] <= room_arcsec))
        return probability_by_share(share, advice.draws.effective)

    yield "limit", "" if advice.outcome else kept_line(advice.stay[0], advice.drive, torques, kept)
    if not (advice.outcome or (carded and advice.settled)):
        value = f"the value of {advice.where(advice.to_measure_next[0])} as one more trial"
        if len(torques) > 1:
            value += f"; with --torque {advice.prior.rig.M_g:g} alone it decides for that torque only"
        yield "next", f"the same command with {'--card card.html' if advice.settled else value}"


def _more_facts(advice: TrialAdvice) -> Iterator[Fact]:
    """Predicted and measured values, noise, and results of the fit, a label and a text each."""
    setup = advice.prior.rig
    for one in advice.predictions:
        yield "trial", _outcome(advice, one)
    found = f"found {advice.noise_arcsec:.2f}″"
    yield "noise", f"given {setup.noise_arcsec:g}, {found}"
    yield "found", "; ".join(f"{q.label} {q.text(advice)} {q.unit}".rstrip() for q in POSTERIOR)
    yield "unknown", unknown_names(unknowns(advice.drive))


def _curve(advice: TrialAdvice) -> Curve:
    """F'_ior over the positions at the torque of the trials, if it decides, with measured values."""
    losses, holes, torques = advice.losses, advice.drive.mounting.holes, advice.drive.operation.M_g
    M_g = advice.prior.rig.M_g if advice.prior.rig.M_g in torques else torques[0]
    per, k = 360 / holes if holes else 1.0, torques.index(M_g)
    measured = advice.trials if M_g == advice.prior.rig.M_g else ()
    return Curve(
        np.array(losses.rotations_deg) / per, _medians(losses)[k], "turned by, holes" if holes else "turned by, °",
        f"F'_ior at {M_g:g} N·m, ″: median, 5 to 95 %; M measured",
        whiskers=whiskers_of(losses, k, per), from_zero=True, rows=6,
        marks=tuple(CurveMark(t.rotation_deg / per, t.F_ior_arcsec, "measured", "now") for t in measured),
    )  # fmt: skip


def _medians(losses: PositionStatistics) -> Array:
    """Median of F'_ior [arcsec] in each position, shape (torques, positions)."""
    return np.array([losses.quantile(0.5, place) for place in range(len(losses.rotations_deg))]).T


def _values(advice: TrialAdvice) -> Json:
    """One shape, whatever was given."""
    drive, rig, losses, (best, good) = advice.drive, advice.prior.rig, advice.losses, advice.losses.chosen
    then, after = advice.to_measure_next
    positions = positions_object(losses, drive, advice.offset[2])
    first, worst = (positions["positions"][losses.ranked[place]] for place in (0, -1))
    return {
        "instruction": trials_instruction(advice),
        "turn": advice.settled and advice.choice.turn,
        "M_g_Nm": drive.operation.M_g,
        **positions,
        "best_bet": first,
        "worst": worst,
        "current": position_object(losses, drive, advice.offset[2], None),
        "recommended": first if advice.settled else None,
        "unknown": unknown_objects(unknowns(drive)),
        "probability_needed": advice.needed,
        "next": _place(advice, rotation_deg=then, probability_after=after),
        "trials": {
            **attributes(rig, "noise_arcsec"),
            "M_g_Nm": rig.M_g,
            "noise_found_arcsec": advice.noise_arcsec,
            "measured": [
                _place(advice, **asdict(trial), probability_misread=misread)
                for trial, misread in zip(advice.trials, advice.draws.misread, strict=True)
            ],
            "probability_good_without": advice.without,
        },
        "prediction_errors": [_prediction(advice, one) for one in advice.predictions],
        **attributes(advice, "settled", "unlike_told"),
        **as_object(POSTERIOR, advice),
        "verification": advice.outcome
        and {
            **_prediction(advice, advice.outcome),
            "verdict": "GO_BACK" if advice.back_to else "KEEP",
            "position": _place(advice, advice.stay[0]),
            "probability_good": advice.stay[1] if advice.explained else None,
            "best": _place(advice, best, probability_good=good),
        },
        "seed": advice.prior.seed,
    }


def _place(advice: TrialAdvice, rotation_deg: float, **more: object) -> Json:
    return {"rotation_deg": rotation_deg, "hole": hole_of(rotation_deg, advice.drive.mounting.holes), **more}


def _prediction(advice: TrialAdvice, one: Prediction) -> Json:
    return _place(advice, **asdict(one), as_predicted=one.as_predicted)


def _csv(advice: TrialAdvice) -> CsvTable:
    """Header and rows of a table, one row per torque and position."""
    losses, torques, medians = advice.losses, advice.drive.operation.M_g, _medians(advice.losses)
    return csv_columns(
        M_g_Nm=np.repeat(torques, medians.shape[1]),
        rotation_deg=np.tile(losses.rotations_deg, len(torques)),
        F_ior_expected_arcsec=medians.ravel(),
        **{name: np.tile(getattr(losses, name), len(torques)) for name in SHARES},
    )


def trials_card_facts(advice: TrialAdvice, say: Texts) -> CardFacts:
    """Contents of the assembly card of an advice; say, the texts of its language."""
    return CardFacts(
        advice.choice,
        cam_deg=advice.facing[0],
        good=advice.losses.chosen[1],
        warnings=tuple(trials_warnings(advice, say)),
        tried=Tried(advice.prior.M_g, advice.trials),
    )
