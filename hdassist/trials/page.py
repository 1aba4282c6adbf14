"""What trials teach: on a short page or in tables, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.model.unknown import names, unknowns
from hdassist.mounting.card import CardFacts, Tried, after_trials, warnings_of
from hdassist.mounting.losses import GOOD
from hdassist.mounting.positions import hole_of
from hdassist.mounting.seat_page import TRADE, wheel
from hdassist.mounting.stays_page import stays_line, stays_objects, stays_table
from hdassist.terminal.answers import Json, envelope
from hdassist.terminal.basis import unknown_objects
from hdassist.terminal.brief import facts, proof
from hdassist.terminal.console import Style, grid
from hdassist.terminal.quantities import Quantity, as_object
from hdassist.terminal.runs import Answer, Figures
from hdassist.terminal.texts import Texts, texts
from hdassist.trials.advice import TrialAdvice
from hdassist.trials.posterior import Prediction
from hdassist.verdict import Verdict

LEVELS = {"low": 0.05, "high": 0.95}  # quantiles
SHARES = ("probability_good", "probability_best", "expected_loss")  # of a position
SHOWN = {False: 3, True: 6}  # positions that are listed, best first, without details and with them
APART = 3.0  # standard deviations by which values of one position may differ without a remark
MANY = 4  # trials without a repeat, from which on one is asked for


def _beside(values: Iterable[float], digits: str = ".2f") -> str:
    """Values at the torques that decide, side by side."""
    return " / ".join(format(value, digits) for value in values)


LEARNT: tuple[Quantity[TrialAdvice], ...] = (
    Quantity("offset.size_um", "cam offset", "um", ".0f", lambda a: float(abs(a.offset_um).mean())),
    Quantity("offset.size_sd_um", "standard deviation", "um", ".0f", lambda a: float(abs(a.offset_um).std())),
    Quantity("offset.direction_deg", "towards", "deg", ".0f", lambda a: a.facing[0]),
    Quantity("offset.direction_sd_deg", "standard deviation", "deg", ".0f", lambda a: a.facing[1]),
    Quantity("scale", "F'_ior over the computed one", "", ".2f", lambda a: float(a.draws.scale.mean())),
    Quantity("scale_sd", "standard deviation (0.10 assumed before)", "", ".2f", lambda a: float(a.draws.scale.std())),
    Quantity("misfit", "misfit (0 to 12 % assumed)", "", ".0%", lambda a: float(a.draws.misfit.mean())),
    Quantity("effective_samples", "effective samples", "", ".0f", lambda a: a.draws.effective),
    Quantity("standard_error_arcsec", "standard error of F'_ior", "arcsec", _beside, lambda a: a.standard_errors),
)


def answer(advice: TrialAdvice, *, details: bool = False, carded: bool = False) -> Answer:
    """What there is to say of an advice; details, whether all tables are shown; carded, whether a card is asked for."""
    return Answer(
        to_json=lambda: to_json(advice),
        page=lambda style: render(advice, style, details=details, carded=carded),
        summary_line=lambda: summary_line(advice),
        figures=lambda: figures(advice),
        warnings=tuple(warnings(advice, texts())),
        proof=advice.cloud.certificate,
        exit_code=exit_code(advice),
    )


def exit_code(advice: TrialAdvice) -> int:
    """3 where an outcome says to go back, 6 where the position to be in is not known to be good."""
    if advice.outcome and advice.outcome.back_to:
        return Verdict.FAIL.exit_code
    return 0 if advice.settled else Verdict.INCONCLUSIVE.exit_code


def warnings(advice: TrialAdvice, say: Texts) -> Iterator[str]:
    """What a reader should know beside the numbers."""
    yield from warnings_of(advice.drive, say)
    outcome, rig = advice.outcome, advice.cloud.rig
    if outcome and not outcome.predicted.as_predicted:
        yield f"{_outcome(advice, outcome.predicted)}: outside of what the trials predict: check seat and measurement"
    if not outcome and not advice.settled:
        yield f"the trials do not settle it: {_chance(advice)}; measure {advice.where(advice.next[0])}"
    if outcome and outcome.best and not outcome.back_to and not advice.settled:
        best, good = outcome.best
        better = f"{advice.where(best)} may be better ({good:.0%})"
        yield f"{_chance(advice)}; {better if best != advice.stay[0] else 'measure it once more'}"
    for a, b in advice.repeats:
        noise = np.linalg.norm(advice.cloud.noise(np.array([a.F_ior_arcsec, b.F_ior_arcsec])))
        if abs(a.F_ior_arcsec - b.F_ior_arcsec) > APART * noise:
            values = f"{advice.where(a.rotation_deg)}: {a.F_ior_arcsec:g} and {b.F_ior_arcsec:g} arcsec differ by more"
            taken = f"it is taken for {advice.noise_arcsec:.1f}"
            yield f"{values} than a noise of {rig.noise_arcsec:g} makes likely; {taken}"
    if advice.unlike_told:
        unlike = "the values came out unlike those of a drive as the preset has it (one in twenty of them may)"
        yield f"{unlike}: check the preset, the noise and how the holes were counted"


def _chance(advice: TrialAdvice) -> str:
    here, good = advice.stay
    sure, needed = f"{good:.0%}", f"{advice.needed:.0%}"
    if sure == needed and not advice.settled:
        sure = f"{np.floor(1000 * good) / 10:.1f}%"
    return f"{advice.where(here)} is good (loses below {GOOD:.0%}) with {sure}, and {needed} are wanted"


def _outcome(advice: TrialAdvice, of: Prediction) -> str:
    predicted = f"predicted {of.expected_arcsec:.1f} ({of.low_arcsec:.1f} to {of.high_arcsec:.1f})"
    return f"{of.F_ior_arcsec:g} arcsec at {advice.where(of.rotation_deg)}, {predicted}"


def instruction(advice: TrialAdvice) -> str:
    """What to do with the wheel, and how sure that is; where the trials do not settle it, what to measure."""
    if outcome := advice.outcome:
        back, told = outcome.back_to, _outcome(advice, outcome.predicted)
        if not back:
            return f"Keep it: {told}."
        return f"Go back to {advice.where(back.rotation_deg)}, where {back.F_ior_arcsec:g} was measured: {told}."
    if advice.settled:
        return f"{after_trials(advice.choice, texts())} By the trials {_chance(advice)} (--sure)."
    return (
        f"No order yet: {_chance(advice)}. To decide, measure {advice.where(advice.next[0])} next. "
        f"{advice.next[1]:.0%} are expected after it. Five or six trials are normal."
    )


def render(advice: TrialAdvice, style: Style, *, details: bool = False, carded: bool = False) -> RenderableType:
    """The instruction, the best positions, and what to know of them; with details more positions and tables."""
    trials = f"{len(advice.trials)} trial{'s' * (len(advice.trials) > 1)} at {advice.cloud.rig.M_g:g} N·m"
    parts: list[RenderableType] = [
        Text(style.text(f"{advice.drive.name}: the cam offset from {trials}"), style="bold"),
        Text(style.text(instruction(advice))),
        _positions(advice, style, SHOWN[details]),
        *([stays_table(advice.drive, advice.rests_on, style, trials=True)] if details and advice.rests_on else []),
        facts(style, _lines(advice, details=details, carded=carded)),
    ]
    return Group(*(line for part in parts for line in (part, Text(""))))


def _lines(advice: TrialAdvice, *, details: bool, carded: bool) -> Iterator[tuple[str, str]]:
    """What is to be known beside the positions, a label and a text each."""
    rig = advice.cloud.rig
    if details:
        for one in advice.predictions:
            yield "trial", _outcome(advice, one)
        yield "noise", f"told {rig.noise_arcsec:g}, found {advice.noise_arcsec:.2f} arcsec; seat {rig.reseat_um:g} um"
        yield "learnt", "; ".join(f"{q.label} {q.text(advice)} {q.unit}".rstrip() for q in LEARNT)
    else:
        yield "rests on", stays_line(advice.drive, advice.rests_on)
    yield "limit", "" if advice.outcome else "; ".join(_held(advice))
    yield "unknown", names(unknowns(advice.drive))
    if len(advice.trials) >= MANY and not advice.repeats and not advice.outcome:
        first = advice.where(advice.trials[0].rotation_deg)
        yield "repeat", f"{first}, the wheel taken out and put back, to learn the noise: none was measured twice"
        turn = f"turn the {wheel(advice.drive)} by a hole as you counted: its mark must go"
        yield "look", f"{turn} counter-clockwise, seen from the cam side; no F'_ior tells how holes were counted"
    more = "--card card.html" if advice.settled else f"the value of {advice.where(advice.next[0])} as one more trial"
    yield "next", "" if advice.outcome or (carded and advice.settled) else f"the same command with {more}"
    yield "proof", proof(advice.cloud.certificate)
    yield "more", "" if details else "--details"


def _held(advice: TrialAdvice) -> Iterator[str]:
    """How sure the best position keeps the preset's limits, at each torque that decides."""
    drive, best = advice.drive, advice.losses.best
    for M_g, drawn in zip(drive.operation.M_g, advice.losses.at(best), strict=True):
        if (limit := drive.limit(M_g)) is not None:
            where = f"{advice.where(advice.losses.rotations_deg[best])} at {M_g:g} N·m"
            yield f"{np.mean(drawn <= limit):.0%} sure that {where} stays below {limit:g} arcsec, self error aside"


def _positions(advice: TrialAdvice, style: Style, most: int) -> Table:
    turns = f"turns of the {TRADE[advice.drive.mounting.fixed]} counter-clockwise seen from the cam side"
    title = f"positions, least loss first, {turns}\nF'_ior in arcsec at {_beside(advice.drive.operation.M_g, 'g')} N·m"
    rows = grid(style, title, "position", "good, %", "expected", "5 %", "95 %", "loss, %")
    for at in (_position(advice, place) for place in advice.losses.ranked[:most]):
        good, loss = f"{100 * at['probability_good']:.0f}", f"{100 * at['expected_loss']:.1f}"
        levels = (_beside(values, ".1f") for values in at["F_ior_arcsec"].values())
        rows.add_row(advice.where(at["rotation_deg"]), good, *levels, loss)
    return rows


def to_json(advice: TrialAdvice) -> Json:
    """What the trials teach as a JSON object: one shape, whatever was given."""
    losses, drive, rig, certificate = advice.losses, advice.drive, advice.cloud.rig, advice.cloud.certificate
    positions = [_position(advice, place) for place in range(len(losses.rotations_deg))]
    ranked, best = [positions[place] for place in losses.ranked], advice.outcome and advice.outcome.best
    return {
        **envelope("trials", drive, exit_code(advice), tuple(warnings(advice, texts()))),
        "complete": True,
        "instruction": instruction(advice),
        "turn": advice.settled and advice.choice.turn,
        "M_g_Nm": list(drive.operation.M_g),
        "weights": None if losses.weights is None else list(losses.weights),
        "criterion": losses.criterion.name,
        "positions": positions,
        "current": _position(advice, None),
        "recommended": ranked[0] if advice.settled else None,
        "best_bet": ranked[0],
        "second": ranked[1] if len(ranked) > 1 else None,
        "worst": ranked[-1],
        "gain": float(-advice.at(losses.best).change_from(advice.at(None))),
        "unknown": unknown_objects(unknowns(drive)),
        "rests_on": stays_objects(drive, advice.rests_on, trials=True),
        "settled": advice.settled,
        "probability_needed": advice.needed,
        "next": _place(advice, advice.next[0], probability_after=advice.next[1]),
        "trials": {
            "M_g_Nm": rig.M_g,
            "noise_arcsec": rig.noise_arcsec,
            "noise_found_arcsec": advice.noise_arcsec,
            "reseat_um": rig.reseat_um,
            "measured": [_place(advice, **asdict(trial)) for trial in advice.trials],
        },
        "prediction_errors": [_prediction(advice, one) for one in advice.predictions],
        "unlike_told": advice.unlike_told,
        **as_object(LEARNT, advice),
        "verification": advice.outcome
        and {
            **_prediction(advice, advice.outcome.predicted),
            "verdict": "GO_BACK" if advice.outcome.back_to else "KEEP",
            "position": _place(advice, advice.stay[0]),
            "probability_good": advice.outcome.probability_good,
            "best": best and _place(advice, best[0], probability_good=best[1]),
        },
        "certificate": {name: getattr(certificate, name) for name in ("states", "max_residual", "fallbacks")},
        "seed": advice.cloud.seed,
    }


def _place(advice: TrialAdvice, rotation_deg: float, **more: object) -> Json:
    return {"rotation_deg": rotation_deg, "hole": hole_of(rotation_deg, advice.drive.mounting.holes), **more}


def _prediction(advice: TrialAdvice, one: Prediction) -> Json:
    return _place(advice, **asdict(one), as_predicted=one.as_predicted)


def _position(advice: TrialAdvice, place: int | None) -> Json:
    """A position with F'_ior at each torque, and what is probable of it; None: where the wheel stood at first."""
    losses, at = advice.losses, advice.at(place)
    spread = {name: np.quantile(losses.at(place), level, axis=1).tolist() for name, level in LEVELS.items()}
    shares = {} if place is None else {name: float(getattr(losses, name)[place]) for name in SHARES}
    return {**asdict(at), "F_ior_arcsec": {"expected": list(at.F_ior_arcsec), **spread}, **shares}


def figures(advice: TrialAdvice) -> Figures:
    """Header and rows of a table, one row per torque and position."""
    rows = [
        [M_g, at["rotation_deg"], at["F_ior_arcsec"]["expected"][k], *(at[name] for name in SHARES)]
        for k, M_g in enumerate(advice.drive.operation.M_g)
        for at in (_position(advice, place) for place in range(len(advice.losses.rotations_deg)))
    ]
    return ["M_g_Nm", "rotation_deg", "F_ior_expected_arcsec", *SHARES], rows


def summary_line(advice: TrialAdvice) -> str:
    """The answer alone: the hole (or angle in degrees) to mount the wheel in, after an outcome the one to stay in."""
    if not advice.outcome and not advice.settled:
        return "unknown"
    hole = hole_of(advice.stay[0], advice.drive.mounting.holes)
    return f"{advice.stay[0]:g}" if hole is None else f"{hole}"


def card_facts(advice: TrialAdvice, say: Texts) -> CardFacts:
    """What the assembly card tells of an advice; say, the texts of its language."""
    return CardFacts(
        advice.choice,
        cam_deg=advice.facing[0],
        chances=advice.losses.chances,
        weights=advice.losses.weights,
        warnings=tuple(warnings(advice, say)),
        rests_on=advice.rests_on,
        tried=Tried(advice.cloud.rig.M_g, tuple((t.rotation_deg, t.F_ior_arcsec) for t in advice.trials)),
    )
