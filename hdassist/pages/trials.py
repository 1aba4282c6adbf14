"""What trials teach: on a short page or in tables, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.json_parts import Json, certificate_object, unknown_objects
from hdassist.model.unknown import unknown_names, unknowns
from hdassist.mounting.losses import GOOD
from hdassist.mounting.positions import bare, hole_of
from hdassist.mounting.trial import Trial, Tried
from hdassist.pages.card import CardFacts, after_trials, warnings_of
from hdassist.pages.losses import SHARES, kept_line, losses_object, losses_table
from hdassist.pages.seat import TRADE, wheel
from hdassist.report.quantities import Quantity, as_object
from hdassist.terminal.answers import envelope
from hdassist.terminal.brief import facts, proof
from hdassist.terminal.console import Style
from hdassist.terminal.page import block_on_page
from hdassist.terminal.runs import Answer, CsvTable
from hdassist.terminal.texts import Texts, texts
from hdassist.trials.advice import TrialAdvice
from hdassist.trials.posterior import Prediction
from hdassist.verdict import Verdict

LISTED_HOLES = {False: 3, True: 6}  # positions that are listed, best first, without details and with them
APART = 3.0  # standard deviations by which values of one position may differ without a remark
MANY_TRIALS = 4  # trials without a repeat, from which on one is asked for

LEARNT: tuple[Quantity[TrialAdvice], ...] = (
    Quantity("offset.size_um", "cam offset", "um", ".0f", lambda a: a.offset[0]),
    Quantity("offset.size_sd_um", "standard deviation", "um", ".0f", lambda a: a.offset[1]),
    Quantity("offset.direction_deg", "towards", "deg", ".0f", lambda a: a.facing[0]),
    Quantity("offset.direction_sd_deg", "standard deviation", "deg", ".0f", lambda a: a.facing[1]),
    Quantity("scale", "F'_ior over the computed one", "", ".2f", lambda a: float(a.draws.scale.mean())),
    Quantity("scale_sd", "standard deviation (0.10 assumed before)", "", ".2f", lambda a: float(a.draws.scale.std())),
    Quantity("misfit", "misfit (0 to 12 % assumed)", "", ".0%", lambda a: float(a.draws.misfit.mean())),
    Quantity("effective_samples", "effective samples", "", ".0f", lambda a: a.draws.effective),
)


def trials_answer(advice: TrialAdvice, *, details: bool = False, carded: bool = False) -> Answer:
    """What there is to say of an advice; details, whether all tables are shown; carded, whether a card is asked for."""
    return Answer(
        to_json=lambda: trials_json(advice),
        page=lambda style: trials_page(advice, style, details=details, carded=carded),
        summary_line=lambda: trials_summary(advice),
        figures=lambda: trials_figures(advice),
        warnings=tuple(trials_warnings(advice, texts())),
        proof=advice.prior.certificate,
        exit_code=trials_exit_code(advice),
    )


def trials_exit_code(advice: TrialAdvice) -> int:
    """3 where an outcome says to go back, 6 where the position to be in is not known to be good."""
    return (Verdict.FAIL if advice.back_to else Verdict.PASS if advice.settled else Verdict.INCONCLUSIVE).exit_code


def trials_warnings(advice: TrialAdvice, say: Texts) -> Iterator[str]:
    """What a reader should know beside the numbers."""
    yield from warnings_of(advice.drive, say)
    outcome, rig, (best, good) = advice.outcome, advice.prior.rig, advice.losses.chosen
    if advice.suspected:
        yield f"{_measured(advice, advice.suspected)} is probably misread ({_suspicion(advice)}): measure it again"
    elif (hinge := advice.hinges_on) and advice.stay[1] >= advice.needed:
        least = f"{100 * min(advice.without):.0f} %"
        yield f"the choice hinges on {_measured(advice, hinge)}: {least} without it, 60 % are wanted: measure it again"
    if outcome and not outcome.as_predicted:
        yield f"{_outcome(advice, outcome)}: outside of what the trials predict: check seat and measurement"
    if not advice.settled and not advice.to_repeat and not advice.back_to and advice.explained:
        best_bet = f"{advice.where(best)} may be better ({good:.0%})"
        again = "measure it once more" if best == advice.stay[0] else best_bet
        first = f"the trials do not settle it: {_chance(advice)}; measure {advice.where(advice.next[0])}"
        yield f"{_chance(advice)}; {again}" if outcome else first
    for a, b in advice.repeats:
        noise = np.linalg.norm(advice.prior.noise(np.array([a.F_ior_arcsec, b.F_ior_arcsec])))
        if abs(a.F_ior_arcsec - b.F_ior_arcsec) > APART * noise:
            values = f"{advice.where(a.rotation_deg)}: {a.F_ior_arcsec:g} and {b.F_ior_arcsec:g} arcsec differ by more"
            taken = f"it is taken for {advice.noise_arcsec:.1f}"
            yield f"{values} than a noise of {rig.noise_arcsec:g} makes likely; {taken}"
    if advice.unlike_told:
        unlike = "the values came out unlike those of a drive as the preset has it (one in twenty of them may)"
        yield f"{unlike}: check the preset, the noise and how the holes were counted{_repeat(advice)}"


def _measured(advice: TrialAdvice, trial: Trial) -> str:
    """A value and its position in words."""
    return f"{trial.F_ior_arcsec:g} arcsec at {advice.where(trial.rotation_deg)}"


def _suspicion(advice: TrialAdvice) -> str:
    return f"{100 * float(advice.draws.misread.max()):.0f} %"


def _repeat(advice: TrialAdvice) -> str:
    if not (trial := advice.to_repeat):
        return ""
    return f"; nothing is settled before a position is measured twice: measure {advice.where(trial.rotation_deg)} again"


def _chance(advice: TrialAdvice) -> str:
    here, good = advice.stay
    sure, needed = f"{good:.0%}", f"{advice.needed:.0%}"
    if sure == needed and not advice.settled:
        sure, needed = f"{np.floor(1000 * good) / 10:.1f}%", f"{np.ceil(1000 * advice.needed) / 10:.1f}%"
    return f"{advice.where(here)} is good (loses below {GOOD:.0%}) with {sure}, and {needed} are wanted"


def _outcome(advice: TrialAdvice, of: Prediction) -> str:
    predicted = f"predicted {of.expected_arcsec:.1f} ({of.low_arcsec:.2f} to {of.high_arcsec:.2f})"
    return f"{of.F_ior_arcsec:g} arcsec at {advice.where(of.rotation_deg)}, {predicted}"


def trials_instruction(advice: TrialAdvice) -> str:
    """What to do with the wheel, and how sure that is; where the trials do not settle it, what to measure."""
    if back := advice.back_to:
        there = f"Go back to {advice.where(back.rotation_deg)}, where {back.F_ior_arcsec:g} was measured"
    if advice.outcome:
        return f"{there if back else 'Keep it'}: {_outcome(advice, advice.outcome)}."
    if advice.settled:
        return f"{after_trials(advice.choice, texts())} By the trials {_chance(advice)} (--sure)."
    if advice.to_repeat and advice.unlike_told:
        return f"No order yet: the values came out unlike those of a drive as the preset has it{_repeat(advice)}."
    if advice.to_repeat:
        again = advice.where(advice.to_repeat.rotation_deg)
        return f"No order yet: {_chance(advice)}. Before a new position measure {again} again: none was measured twice."
    return (
        f"No order yet: {_chance(advice)}. To decide, measure {advice.where(advice.next[0])} next. "
        f"{advice.next[1]:.0%} are expected after it. Five or six trials are normal."
    )


def trials_page(advice: TrialAdvice, style: Style, *, details: bool = False, carded: bool = False) -> RenderableType:
    """The instruction, the best positions, and what to know of them; with details more positions and tables."""
    trials = f"{len(advice.trials)} trial{'s' * (len(advice.trials) > 1)} at {advice.prior.M_g:g} N·m"
    holes, torques = advice.drive.mounting.holes, advice.drive.operation.M_g
    turns = f"turns of the {TRADE[advice.drive.mounting.fixed]} counter-clockwise seen from the cam side"
    turns += "; by the trials without the outcome" * (not advice.explained)
    parts: list[RenderableType] = [
        Text(style.text(f"{advice.drive.name}: the cam offset from {trials}"), style="bold"),
        Text(style.text(trials_instruction(advice))),
        *block_on_page(
            losses_table(advice.losses, holes, torques, f"positions, least loss first, {turns}", LISTED_HOLES[details]),
            style,
        ),
        facts(style, _lines(advice, details=details, carded=carded)),
    ]
    return Group(*(line for part in parts for line in (part, Text(""))))


def _lines(advice: TrialAdvice, *, details: bool, carded: bool) -> Iterator[tuple[str, str]]:
    """What is to be known beside the positions, a label and a text each."""
    rig = advice.prior.rig
    if details:
        for one in advice.predictions:
            yield "trial", _outcome(advice, one)
        yield "noise", f"told {rig.noise_arcsec:g}, found {advice.noise_arcsec:.2f} arcsec; seat {rig.reseat_um:g} um"
        yield "learnt", "; ".join(f"{q.label} {q.text(advice)} {q.unit}".rstrip() for q in LEARNT)
    yield "limit", "" if advice.outcome else kept_line(advice.losses, advice.drive, advice.drive.operation.M_g)
    yield "unknown", unknown_names(unknowns(advice.drive))
    if len(advice.trials) >= MANY_TRIALS and not advice.repeats and not advice.outcome:
        again = advice.where((advice.to_repeat or advice.trials[0]).rotation_deg)
        yield "repeat", f"{again}, the wheel taken out and put back, to learn the noise: none was measured twice"
        turn = f"turn the {wheel(advice.drive)} by a hole as you counted: its mark must go"
        yield "look", f"{turn} counter-clockwise, seen from the cam side; no F'_ior tells how holes were counted"
    then = advice.where(advice.to_measure_next[0])
    more = "--card card.html" if advice.settled else f"the value of {then} as one more trial"
    many = not advice.settled and len(advice.drive.operation.M_g) > 1
    more += f"; with --torque {rig.M_g:g} alone it decides for that torque only" * many
    yield "next", "" if advice.outcome or (carded and advice.settled) else f"the same command with {more}"
    yield "proof", proof(advice.prior.certificate)
    yield "more", "" if details else "--details"


def trials_json(advice: TrialAdvice) -> Json:
    """What the trials teach as a JSON object: one shape, whatever was given."""
    drive, rig, (best, good) = advice.drive, advice.prior.rig, advice.losses.chosen
    then, after = advice.to_measure_next
    found = losses_object(advice.losses, drive, advice.offset[2])
    return {
        **envelope("trials", drive, trials_exit_code(advice), tuple(trials_warnings(advice, texts()))),
        "complete": True,
        "instruction": trials_instruction(advice),
        "turn": advice.settled and advice.choice.turn,
        "M_g_Nm": list(drive.operation.M_g),
        **found,
        "recommended": found["best_bet"] if advice.settled else None,
        "unknown": unknown_objects(unknowns(drive)),
        "settled": advice.settled,
        "probability_needed": advice.needed,
        "next": _place(advice, rotation_deg=then, probability_after=after),
        "trials": {
            "M_g_Nm": rig.M_g,
            "noise_arcsec": rig.noise_arcsec,
            "noise_found_arcsec": advice.noise_arcsec,
            "reseat_um": rig.reseat_um,
            "measured": [
                _place(advice, **asdict(trial), probability_misread=float(misread))
                for trial, misread in zip(advice.trials, advice.draws.misread, strict=True)
            ],
            "probability_good_without": list(advice.without),
        },
        "prediction_errors": [_prediction(advice, one) for one in advice.predictions],
        "unlike_told": advice.unlike_told,
        **as_object(LEARNT, advice),
        "verification": advice.outcome
        and {
            **_prediction(advice, advice.outcome),
            "verdict": "GO_BACK" if advice.back_to else "KEEP",
            "position": _place(advice, advice.stay[0]),
            "probability_good": advice.stay[1] if advice.explained else None,
            "best": _place(advice, best, probability_good=good),
        },
        "certificate": certificate_object(advice.prior.certificate),
        "seed": advice.prior.seed,
    }


def _place(advice: TrialAdvice, rotation_deg: float, **more: object) -> Json:
    return {"rotation_deg": rotation_deg, "hole": hole_of(rotation_deg, advice.drive.mounting.holes), **more}


def _prediction(advice: TrialAdvice, one: Prediction) -> Json:
    return _place(advice, **asdict(one), as_predicted=one.as_predicted)


def trials_figures(advice: TrialAdvice) -> CsvTable:
    """Header and rows of a table, one row per torque and position."""
    losses = advice.losses
    rows = [
        [M_g, rotation, losses.quantile(0.5, place)[k], *(float(getattr(losses, n)[place]) for n in SHARES)]
        for k, M_g in enumerate(advice.drive.operation.M_g)
        for place, rotation in enumerate(losses.rotations_deg)
    ]
    return ["M_g_Nm", "rotation_deg", "F_ior_expected_arcsec", *SHARES], rows


def trials_summary(advice: TrialAdvice) -> str:
    """The answer alone: the hole (or angle in degrees) to mount the wheel in, after an outcome the one to stay in."""
    if not advice.outcome and not advice.settled:
        return "unknown"
    return bare(advice.stay[0], advice.drive.mounting.holes)


def trials_card_facts(advice: TrialAdvice, say: Texts) -> CardFacts:
    """What the assembly card tells of an advice; say, the texts of its language."""
    return CardFacts(
        advice.choice,
        cam_deg=advice.facing[0],
        good=advice.losses.chosen[1],
        weights=advice.losses.weights,
        warnings=tuple(trials_warnings(advice, say)),
        tried=Tried(advice.prior.M_g, advice.trials),
    )
