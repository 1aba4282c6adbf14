"""What trials teach, as an instruction and tables, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.model.geometry import Array
from hdassist.model.unknown import unknowns
from hdassist.mounting.card import CardFacts, after_trials
from hdassist.mounting.losses import GOOD
from hdassist.mounting.positions import Position, hole_of, hole_words
from hdassist.mounting.seat_page import TRADE, wheel
from hdassist.preset.fields import Drive
from hdassist.terminal.answers import Json, envelope
from hdassist.terminal.basis import unknown_objects
from hdassist.terminal.console import Style, table
from hdassist.terminal.runs import Answer, Figures
from hdassist.terminal.texts import Texts, texts
from hdassist.trials.advice import OPEN, TrialAdvice
from hdassist.trials.draws import SCALE
from hdassist.trials.posterior import Prediction
from hdassist.trials.trial import Trial

LEVELS = {"low": 0.05, "high": 0.95}  # quantiles
ON_CARD = 8  # trials that a card tells
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
    yield from advice.drive.origin.warnings
    outcome, losses, rig = advice.outcome, advice.losses, advice.rig
    chance, needed = losses.probability_good[losses.best], say.percent(advice.needed)
    if not outcome and not advice.settled:
        next_ = _hole(advice.drive, advice.next.rotation_deg, say)
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
        found = rig.noise_arcsec * advice.draws.noise.mean()
        yield (
            f"{_where(advice, a.rotation_deg)}: {a.F_ior_arcsec:g} and {b.F_ior_arcsec:g} arcsec differ by more than "
            f"a noise of {rig.noise_arcsec:g} makes likely; it is taken for {found:.1f}"
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


def _hole(drive: Drive, rotation_deg: float, say: Texts) -> str:
    hole = hole_of(rotation_deg, drive.mounting.holes)
    return say.angle(rotation_deg) if hole is None else say("foot.hole", hole=hole)


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
    """The instruction, how sure it is, the trials, the positions, what to measure next, and what it rests on."""
    trials = f"{len(advice.trials)} trial{'s' * (len(advice.trials) > 1)}"
    heading = f"{advice.drive.name}: the cam offset from {trials} at {advice.rig.M_g:g} N·m"
    parts: list[RenderableType] = [Text(style.text(heading), style="bold")]
    parts += [Text(style.text(words)) for words in (instruction(advice), _chance(advice))]
    parts += [_trials(advice, style), _positions(advice, style)]
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


def _grid(style: Style, title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    grid = table(style, title)
    for k, words in enumerate(columns):
        grid.add_column(words, justify="right" if k else "left", no_wrap=True)
    for row in rows:
        grid.add_row(*row)
    return grid


def _trials(advice: TrialAdvice, style: Style) -> Table:
    rig, found = advice.rig, advice.rig.noise_arcsec * advice.draws.noise.mean()
    title = f"trials, predicted by those before (noise told {rig.noise_arcsec:g}, found {found:.2f} arcsec"
    rows = [
        [_where(advice, trial.rotation_deg), f"{trial.F_ior_arcsec:g}"]
        + ([f"{v:.1f}" for v in (p.expected_arcsec, p.low_arcsec, p.high_arcsec)] if p else ["-"] * 3)
        for trial, p in zip(advice.trials, (None, *advice.predictions), strict=True)
    ]
    seat = f"; seat {rig.reseat_um:g} um" if rig.reseat_um else ""
    return _grid(style, f"{title}{seat})", ["position", "measured", "predicted", "2.5 %", "97.5 %"], rows)


def _positions(advice: TrialAdvice, style: Style) -> Table:
    losses, torques = advice.losses, " / ".join(f"{M_g:g}" for M_g in advice.drive.operation.M_g)
    F_ior = [losses.F_ior_arcsec.mean(axis=1), *np.quantile(losses.F_ior_arcsec, list(LEVELS.values()), axis=1)]
    rows = [
        [
            _where(advice, losses.rotations_deg[place]),
            f"{100 * losses.probability_good[place]:.0f}",
            *(" / ".join(f"{v:.1f}" for v in level[:, place]) for level in F_ior),
            f"{100 * losses.expected[place]:.1f}",
        ]
        for place in losses.ranked[:SHOWN]
    ]
    title = f"positions, best first: F'_ior in arcsec at {torques} N·m; good: a loss below {GOOD:.0%}"
    return _grid(style, title, ["position", "good, %", "expected", "5 %", "95 %", "loss, %"], rows)


def _basis(advice: TrialAdvice) -> str:
    draws, cloud, (facing, spread) = advice.draws, advice.cloud, advice.direction
    size, scale = np.abs(cloud.offset_um[draws.places]), draws.scale
    toward = "direction open" if spread >= OPEN else f"towards {facing:.0f} deg, standard deviation {spread:.0f}"
    errors = " / ".join(f"{cloud.tables[M_g].standard_error:.2f}" for M_g in advice.drive.operation.M_g)
    return (
        f"Positions are turns of the {TRADE[advice.drive.mounting.fixed]} from where it stood at 0, counter-clockwise "
        f"seen from the cam side (that of the wave generator). Cam offset {size.mean():.0f} um, standard deviation "
        f"{size.std():.0f}, {toward}; {draws.effective:.0f} effective samples of {cloud.weight.size}. The drive shows "
        f"{scale.mean():.2f} of the computed F'_ior, standard deviation {scale.std():.2f} (before the trials 1.00, "
        f"{SCALE:.2f}, assumed), and a misfit from hole to hole of {draws.misfit.mean():.0%} (0 to 12 %, assumed). "
        f"F'_ior interpolated, standard error {errors} arcsec."
    )


def to_json(advice: TrialAdvice, seed: int) -> Json:
    """What the trials teach as a JSON object: one shape, whatever was given."""
    losses, draws, drive, (facing, spread) = advice.losses, advice.draws, advice.drive, advice.direction
    cloud, certificate, now = advice.cloud, advice.cloud.certificate, advice.at(None)
    size = np.abs(cloud.offset_um[draws.places])
    positions = [
        {
            **_position(advice.at(place), losses.F_ior_arcsec[:, :, place]),
            "probability_good": float(losses.probability_good[place]),
            "probability_best": float(losses.probability_best[place]),
            "expected_loss": float(losses.expected[place]),
        }
        for place in range(len(losses.rotations_deg))
    ]
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
        "current": _position(now, losses.now_arcsec),
        "recommended": ranked[0] if advice.settled else None,
        "best_bet": ranked[0],
        "second": ranked[1] if len(ranked) > 1 else None,
        "worst": ranked[-1],
        "gain": float(-advice.at(losses.best).change_from(now)),
        "unknown": unknown_objects(unknowns(drive)),
        "settled": advice.settled,
        "probability_needed": advice.needed,
        "next": {**_place(drive, advice.next.rotation_deg), "probability_after": advice.next.probability_after},
        "trials": {
            "M_g_Nm": advice.rig.M_g,
            "noise_arcsec": advice.rig.noise_arcsec,
            "noise_found_arcsec": float(advice.rig.noise_arcsec * draws.noise.mean()),
            "reseat_um": advice.rig.reseat_um,
            "measured": [{**_place(drive, t.rotation_deg), "F_ior_arcsec": t.F_ior_arcsec} for t in advice.trials],
        },
        "prediction_errors": [_prediction(drive, one) for one in advice.predictions],
        "unlike_told": advice.unlike_told,
        "offset": {
            "size_um": float(size.mean()),
            "size_sd_um": float(size.std()),
            "direction_deg": None if spread >= OPEN else facing,
            "direction_sd_deg": None if spread >= OPEN else spread,
        },
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


def _position(of: Position, F_ior: Array) -> Json:
    """A position with F'_ior at each torque, from draws of shape (torques, draws)."""
    spread = {name: np.quantile(F_ior, level, axis=1).tolist() for name, level in LEVELS.items()}
    place = {"rotation_deg": of.rotation_deg, "hole": of.hole, "phase_deg": of.phase_deg}
    return {**place, "F_ior_arcsec": {"expected": list(of.F_ior_arcsec), **spread}}


def _prediction(drive: Drive, one: Prediction) -> Json:
    return {
        **_place(drive, one.trial.rotation_deg),
        "F_ior_arcsec": one.trial.F_ior_arcsec,
        "expected_arcsec": one.expected_arcsec,
        "low_arcsec": one.low_arcsec,
        "high_arcsec": one.high_arcsec,
        "as_predicted": one.as_predicted,
    }


def _outcome(advice: TrialAdvice) -> Json | None:
    if not (outcome := advice.outcome):
        return None
    best = outcome.best and {**_place(advice.drive, outcome.best[0]), "probability_good": outcome.best[1]}
    return {
        **_prediction(advice.drive, outcome.predicted),
        "verdict": "GO_BACK" if outcome.back_to else "KEEP",
        "position": _place(advice.drive, outcome.stay_deg),
        "probability_good": outcome.probability_good,
        "best": best,
    }


def figures(advice: TrialAdvice) -> Figures:
    """Header and rows of a table, one row per torque and position."""
    losses = advice.losses
    shares = np.stack([losses.probability_good, losses.probability_best, losses.expected], axis=1).tolist()
    rows = [
        [M_g, at.rotation_deg, at.F_ior_arcsec[k], *share]
        for k, M_g in enumerate(advice.drive.operation.M_g)
        for at, share in zip(map(advice.at, range(len(shares))), shares, strict=True)
    ]
    names = ["F_ior_expected_arcsec", "probability_good", "probability_best", "expected_loss"]
    return ["M_g_Nm", "rotation_deg", *names], rows


def summary_line(advice: TrialAdvice) -> str:
    """The answer alone: the hole (or angle in degrees) to mount the wheel in, after an outcome the one to stay in."""
    if not advice.outcome and not advice.settled:
        return "unknown"
    rotation = advice.outcome.stay_deg if advice.outcome else advice.losses.rotations_deg[advice.losses.best]
    hole = hole_of(rotation, advice.drive.mounting.holes)
    return f"{rotation:g}" if hole is None else f"{hole}"


def card_facts(advice: TrialAdvice, say: Texts) -> CardFacts:
    """What the assembly card tells of an advice; say, the texts of its language."""
    facing, spread = advice.direction
    told, said = trials_line(advice.drive, advice.trials, advice.rig.M_g, say), tuple(warnings(advice, say))
    cam_deg = facing if spread < OPEN else None  # else there is no direction to draw
    return CardFacts(advice.choice, cam_deg, None, advice.losses.chances, advice.losses.weights, said, told)


def trials_line(drive: Drive, trials: Sequence[Trial], M_g: float, say: Texts) -> str:
    """The trials that a card rests on, at a torque [N*m], in a sentence: as many as it has room for."""
    told = [
        say("foot.trial", where=_hole(drive, trial.rotation_deg, say), value=say.number(trial.F_ior_arcsec))
        for trial in trials[:ON_CARD]
    ]
    return say("foot.trials", torque=say.torque(M_g), trials="; ".join(told))
