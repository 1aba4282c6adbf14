"""What trials teach, as an instruction and tables, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.model.unknown import unknowns
from hdassist.mounting.card import CardFacts, Tried, after_trials, warnings_of
from hdassist.mounting.losses import GOOD
from hdassist.mounting.positions import hole_of, hole_words
from hdassist.mounting.seat_page import TRADE, place_at, wheel
from hdassist.mounting.stays_page import stays_objects, stays_table
from hdassist.preset.fields import Drive
from hdassist.terminal.answers import Json, envelope
from hdassist.terminal.basis import unknown_objects
from hdassist.terminal.console import Style, grid
from hdassist.terminal.runs import Answer, Figures
from hdassist.terminal.texts import Texts, texts
from hdassist.trials.advice import OPEN, TrialAdvice
from hdassist.trials.draws import SCALE
from hdassist.trials.posterior import Prediction
from hdassist.trials.trial import Trial

LEVELS = {"low": 0.05, "high": 0.95}  # quantiles
SHARES = ("probability_good", "probability_best", "expected_loss")  # of a position
SHOWN = 6  # positions that are listed, best first
MANY = 4  # trials without a repeat, from which on one is asked for
GO_BACK, UNSETTLED = 3, 6  # exit codes, those of the verdicts FAIL and INCONCLUSIVE


def answer(advice: TrialAdvice, seed: int) -> Answer:
    """What there is to say of an advice; seed, of what was drawn."""
    return Answer(
        to_json=lambda: to_json(advice, seed),
        page=lambda style: render(advice, style),
        summary_line=lambda: summary_line(advice),
        figures=lambda: figures(advice),
        warnings=tuple(warnings(advice, texts())),
        proof=advice.cloud.certificate,
        exit_code=exit_code(advice),
    )


def exit_code(advice: TrialAdvice) -> int:
    """3 where an outcome says to go back, 6 where the position to be in is not known to be good."""
    return GO_BACK if advice.outcome and advice.outcome.back_to else 0 if advice.settled else UNSETTLED


def warnings(advice: TrialAdvice, say: Texts) -> Iterator[str]:
    """What a reader should know beside the numbers."""
    yield from warnings_of(advice.drive, say)
    outcome, losses, rig = advice.outcome, advice.losses, advice.rig
    chance, needed = losses.probability_good[losses.best], say.percent(advice.needed)
    if not outcome and not advice.settled:
        next_ = place_at(advice.next.rotation_deg, advice.drive.mounting.holes, say)
        yield say("warning.unsettled", chance=say.percent(chance), needed=needed, loss=say.percent(GOOD), where=next_)
    if outcome and not outcome.predicted.as_predicted:
        yield f"{_told(advice, outcome.predicted)}: outside of what the trials predict: check seat and measurement"
    if outcome and outcome.best and not outcome.back_to and not advice.settled:
        best = "measure it once more"
        if outcome.best[0] != outcome.stay_deg:
            best = f"{_where(advice, outcome.best[0])} may be better ({outcome.best[1]:.0%})"
        here = _where(advice, outcome.stay_deg)
        yield f"{here} loses less than {GOOD:.0%} with {outcome.probability_good:.0%}, {needed} is wanted; {best}"
    for a, b in advice.apart:
        yield (
            f"{_where(advice, a.rotation_deg)}: {a.F_ior_arcsec:g} and {b.F_ior_arcsec:g} arcsec differ by more than "
            f"a noise of {rig.noise_arcsec:g} makes likely; it is taken for {_noise(advice):.1f}"
        )
    if advice.unlike_told:
        yield (
            "the values came out unlike those of a drive as the preset has it, which happens to one in twenty such "
            "drives: check the preset, the noise and how the holes were counted"
        )


def _told(advice: TrialAdvice, of: Prediction) -> str:
    low, high = of.low_arcsec, of.high_arcsec
    where = _where(advice, of.trial.rotation_deg)
    return f"{of.trial.F_ior_arcsec:g} arcsec at {where}, predicted {of.expected_arcsec:.1f} ({low:.1f} to {high:.1f})"


def _where(advice: TrialAdvice, rotation_deg: float) -> str:
    return hole_words(rotation_deg, advice.drive.mounting.holes)


def _noise(advice: TrialAdvice) -> float:
    """Noise of a value [arcsec] by the trials."""
    return float(advice.rig.noise_arcsec * advice.draws.noise.mean())


def instruction(advice: TrialAdvice) -> str:
    """One sentence: what to do with the wheel; where the trials do not settle it, what to measure."""
    if not (outcome := advice.outcome):
        if advice.settled:
            return after_trials(advice.choice, texts())
        best, losses = advice.losses.best, advice.losses
        return (
            f"No order yet: the best bet, {_where(advice, losses.rotations_deg[best])}, is good with "
            f"{losses.probability_good[best]:.0%}, and {advice.needed:.0%} are wanted. To decide, measure "
            f"{_where(advice, advice.next.rotation_deg)} next."
        )
    if not (back := outcome.back_to):
        return f"Keep it: {_told(advice, outcome.predicted)}."
    was = f"where {back.F_ior_arcsec:g} was measured"
    return f"Go back to {_where(advice, back.rotation_deg)}, {was}: {_told(advice, outcome.predicted)}."


def render(advice: TrialAdvice, style: Style) -> RenderableType:
    """The instruction, how sure it is, the trials, the positions, what it rests on, and what to measure next."""
    trials = f"{len(advice.trials)} trial{'s' * (len(advice.trials) > 1)}"
    heading = f"{advice.drive.name}: the cam offset from {trials} at {advice.rig.M_g:g} N·m"
    parts: list[RenderableType] = [Text(style.text(heading), style="bold")]
    parts += [Text(style.text(words)) for words in (instruction(advice), _chance(advice))]
    parts += [_trials(advice, style), _positions(advice, style)]
    if advice.rests_on:
        parts.append(stays_table(advice.drive, advice.rests_on, style, trials=True))
    parts += [Text(style.text(words)) for words in (*_next(advice), _basis(advice))]
    return Group(*(line for part in parts for line in (part, Text(""))))


def _chance(advice: TrialAdvice) -> str:
    best = advice.losses.best
    where, good = _where(advice, advice.losses.rotations_deg[best]), advice.losses.probability_good[best]
    return (
        f"By the trials {where} loses less than {GOOD:.0%} against the best position with a probability of {good:.0%}, "
        f"settled from {advice.needed:.0%} on (--sure)."
    )


def _next(advice: TrialAdvice) -> Iterator[str]:
    yield (
        f"A trial at {_where(advice, advice.next.rotation_deg)} brings most: {advice.next.probability_after:.0%} are "
        "expected after it. Five or six trials are normal. What is measured after mounting can be given as one more "
        "trial, or as --verify."
    )
    if len(advice.trials) >= MANY and not advice.repeats:
        yield (
            f"No position was measured twice: repeat {_where(advice, advice.trials[0].rotation_deg)}, the wheel taken "
            "out and put back, to learn the noise. No F'_ior tells that holes were counted the other way round or from "
            f"another one than the first: turn the {wheel(advice.drive)} by a hole as you counted; its mark must have "
            "gone counter-clockwise, seen from the cam side."
        )


def _trials(advice: TrialAdvice, style: Style) -> Table:
    told = f"noise told {advice.rig.noise_arcsec:g}, found {_noise(advice):.2f} arcsec"
    told += f"; seat {advice.rig.reseat_um:g} um" if advice.rig.reseat_um else ""
    title = f"trials, predicted by those before ({told})"
    rows = grid(style, title, "position", "measured", "predicted", "2.5 %", "97.5 %")
    for trial, p in zip(advice.trials, (None, *advice.predictions), strict=True):
        predicted = [f"{v:.1f}" for v in (p.expected_arcsec, p.low_arcsec, p.high_arcsec)] if p else ["-"] * 3
        rows.add_row(_where(advice, trial.rotation_deg), f"{trial.F_ior_arcsec:g}", *predicted)
    return rows


def _positions(advice: TrialAdvice, style: Style) -> Table:
    torques = " / ".join(f"{M_g:g}" for M_g in advice.drive.operation.M_g)
    title = f"positions, best first: F'_ior in arcsec at {torques} N·m; good: a loss below {GOOD:.0%}"
    rows = grid(style, title, "position", "good, %", "expected", "5 %", "95 %", "loss, %")
    for told in (_position(advice, place) for place in advice.losses.ranked[:SHOWN]):
        levels = (" / ".join(f"{v:.1f}" for v in values) for values in told["F_ior_arcsec"].values())
        where, good, loss = _where(advice, told["rotation_deg"]), told["probability_good"], told["expected_loss"]
        rows.add_row(where, f"{100 * good:.0f}", *levels, f"{100 * loss:.1f}")
    return rows


def _basis(advice: TrialAdvice) -> str:
    draws, cloud, offset, scale = advice.draws, advice.cloud, _offset(advice), advice.draws.scale
    toward, facing = "direction open", offset["direction_deg"]
    if facing is not None:
        toward = f"towards {facing:.0f} deg, standard deviation {offset['direction_sd_deg']:.0f}"
    errors = " / ".join(f"{cloud.tables[M_g].standard_error:.2f}" for M_g in advice.drive.operation.M_g)
    return (
        f"Positions are turns of the {TRADE[advice.drive.mounting.fixed]} from where it stood at 0, counter-clockwise "
        f"seen from the cam side (that of the wave generator). Cam offset {offset['size_um']:.0f} um, standard "
        f"deviation {offset['size_sd_um']:.0f}, {toward}; {draws.effective:.0f} effective samples of "
        f"{cloud.weight.size}. The drive shows {scale.mean():.2f} of the computed F'_ior, standard deviation "
        f"{scale.std():.2f} (before the trials 1.00, {SCALE:.2f}, assumed), and a misfit from hole to hole of "
        f"{draws.misfit.mean():.0%} (0 to 12 %, assumed). "
        f"F'_ior interpolated, standard error {errors} arcsec."
    )


def to_json(advice: TrialAdvice, seed: int) -> Json:
    """What the trials teach as a JSON object: one shape, whatever was given."""
    losses, draws, drive, rig = advice.losses, advice.draws, advice.drive, advice.rig
    cloud, certificate = advice.cloud, advice.cloud.certificate
    positions = [_position(advice, place) for place in range(len(losses.rotations_deg))]
    ranked = [positions[place] for place in losses.ranked]
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
        "next": {**_place(drive, advice.next.rotation_deg), "probability_after": advice.next.probability_after},
        "trials": {
            "M_g_Nm": rig.M_g,
            "noise_arcsec": rig.noise_arcsec,
            "noise_found_arcsec": _noise(advice),
            "reseat_um": rig.reseat_um,
            "measured": [_trial(drive, trial) for trial in advice.trials],
        },
        "prediction_errors": [_prediction(drive, one) for one in advice.predictions],
        "unlike_told": advice.unlike_told,
        "offset": _offset(advice),
        "scale": float(draws.scale.mean()),
        "scale_sd": float(draws.scale.std()),
        "misfit": float(draws.misfit.mean()),
        "effective_samples": draws.effective,
        "standard_error_arcsec": [cloud.tables[M_g].standard_error for M_g in drive.operation.M_g],
        "verification": _outcome(advice),
        "certificate": {name: getattr(certificate, name) for name in ("states", "max_residual", "fallbacks")},
        "seed": seed,
    }


def _place(drive: Drive, rotation_deg: float) -> Json:
    return {"rotation_deg": rotation_deg, "hole": hole_of(rotation_deg, drive.mounting.holes)}


def _position(advice: TrialAdvice, place: int | None) -> Json:
    """A position with F'_ior at each torque, and what is probable of it; None: where the wheel stood at first."""
    losses, at = advice.losses, advice.at(place)
    F_ior = losses.now_arcsec if place is None else losses.F_ior_arcsec[:, :, place]
    spread = {name: np.quantile(F_ior, level, axis=1).tolist() for name, level in LEVELS.items()}
    shares = {} if place is None else {name: float(getattr(losses, name)[place]) for name in SHARES}
    return {**asdict(at), "F_ior_arcsec": {"expected": list(at.F_ior_arcsec), **spread}, **shares}


def _offset(advice: TrialAdvice) -> Json:
    """What was learnt of the cam offset; the direction is null where it is open."""
    size, (facing, spread) = np.abs(advice.cloud.offset_um[advice.draws.places]), advice.direction
    direction = (facing, spread) if spread < OPEN else (None, None)
    values = (float(size.mean()), float(size.std()), *direction)
    return dict(zip(("size_um", "size_sd_um", "direction_deg", "direction_sd_deg"), values, strict=True))


def _trial(drive: Drive, trial: Trial) -> Json:
    return {**_place(drive, trial.rotation_deg), "F_ior_arcsec": trial.F_ior_arcsec}


def _prediction(drive: Drive, one: Prediction) -> Json:
    names = ("expected_arcsec", "low_arcsec", "high_arcsec", "as_predicted")
    return {**_trial(drive, one.trial), **{name: getattr(one, name) for name in names}}


def _outcome(advice: TrialAdvice) -> Json | None:
    if not (outcome := advice.outcome):
        return None
    return {
        **_prediction(advice.drive, outcome.predicted),
        "verdict": "GO_BACK" if outcome.back_to else "KEEP",
        "position": _place(advice.drive, outcome.stay_deg),
        "probability_good": outcome.probability_good,
        "best": outcome.best and {**_place(advice.drive, outcome.best[0]), "probability_good": outcome.best[1]},
    }


def figures(advice: TrialAdvice) -> Figures:
    """Header and rows of a table, one row per torque and position."""
    positions = [_position(advice, place) for place in range(len(advice.losses.rotations_deg))]
    rows = [
        [M_g, told["rotation_deg"], told["F_ior_arcsec"]["expected"][k], *(told[name] for name in SHARES)]
        for k, M_g in enumerate(advice.drive.operation.M_g)
        for told in positions
    ]
    return ["M_g_Nm", "rotation_deg", "F_ior_expected_arcsec", *SHARES], rows


def summary_line(advice: TrialAdvice) -> str:
    """The answer alone: the hole (or angle in degrees) to mount the wheel in, after an outcome the one to stay in."""
    if not advice.outcome and not advice.settled:
        return "unknown"
    rotation = advice.outcome.stay_deg if advice.outcome else advice.losses.rotations_deg[advice.losses.best]
    hole = hole_of(rotation, advice.drive.mounting.holes)
    return f"{rotation:g}" if hole is None else f"{hole}"


def card_facts(advice: TrialAdvice, say: Texts) -> CardFacts:
    """What the assembly card tells of an advice; say, the texts of its language."""
    return CardFacts(
        advice.choice,
        cam_deg=_offset(advice)["direction_deg"],
        chances=advice.losses.chances,
        weights=advice.losses.weights,
        warnings=tuple(warnings(advice, say)),
        rests_on=advice.rests_on,
        tried=Tried(advice.rig.M_g, tuple((trial.rotation_deg, trial.F_ior_arcsec) for trial in advice.trials)),
    )
