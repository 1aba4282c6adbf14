"""What trials teach, as an instruction and tables, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.mounting.card import DIGITS, CardFacts
from hdassist.mounting.positions import hole_of, hole_words
from hdassist.mounting.seat_page import turn, wheel
from hdassist.preset.fields import Drive
from hdassist.preset.yamltext import shown
from hdassist.terminal.answers import Json, envelope
from hdassist.terminal.console import Style, table
from hdassist.terminal.runs import Answer, Figures
from hdassist.terminal.texts import Texts, texts
from hdassist.trials.advice import TrialAdvice
from hdassist.trials.posterior import OPEN, Direction
from hdassist.trials.prior import SCALE, SCALES
from hdassist.trials.trial import Trial
from hdassist.trials.weighted import quantile

TEACHES = 0.002  # of the expected loss: a trial that brings less is not worth naming
INTERVAL = {"low": 0.05, "high": 0.95}  # quantiles
ON_CARD = 8  # trials that a card tells
SHOWN = 6  # positions that are listed, best first
GO_BACK, UNSETTLED = 3, 6  # exit codes, those of the verdicts FAIL and INCONCLUSIVE


def warnings(advice: TrialAdvice, say: Texts | None = None) -> tuple[str, ...]:
    """What a reader should know beside the numbers."""
    known, found = advice.known, list(advice.drive.origin.warnings)
    say = say or texts()
    if not advice.settled:
        loss = say.percent(float(known.expected_loss[known.best]))
        hole = hole_of(advice.next.rotation_deg, advice.drive.mounting.holes)
        where = say.angle(advice.next.rotation_deg) if hole is None else say("foot.hole", hole=hole)
        found.append(say("warning.unsettled", loss=loss, where=where))
    if advice.outcome and not advice.outcome.as_predicted:
        found.append(
            f"{advice.outcome.trial.F_ior_arcsec:g} arcsec is outside of what the trials predict "
            f"({advice.outcome.low_arcsec:.1f} to {advice.outcome.high_arcsec:.1f}): check the seat and the measurement"
        )
    return tuple(found)


def answer(advice: TrialAdvice, seed: int) -> Answer:
    """What there is to say of an advice; seed, of what was drawn."""
    return Answer(
        to_json=lambda: to_json(advice, seed),
        page=lambda style: render(advice, style),
        summary_line=lambda: summary_line(advice),
        figures=lambda: figures(advice),
        warnings=warnings(advice),
        proof=advice.known.prior.certificate,
        exit_code=exit_code(advice),
    )


def exit_code(advice: TrialAdvice) -> int:
    """Exit code of the command: 3 where an outcome says to go back, 6 where the trials settle nothing."""
    if advice.outcome:
        return 0 if advice.outcome.keep else GO_BACK
    return 0 if advice.settled else UNSETTLED


def instruction(advice: TrialAdvice) -> str:
    """One sentence: what to do with the wheel."""
    if advice.outcome:
        return _verdict(advice)
    chosen, known = advice.chosen, advice.known
    gains = ", ".join(
        f"F'_ior {now:.1f} -> {new:.1f} arcsec at {M_g:g} N·m"
        for M_g, now, new in zip(
            known.prior.torques, known.now_arcsec @ known.weight, chosen.F_ior_arcsec, strict=False
        )
    )
    if not chosen.rotation_deg:
        return f"Mount the {wheel(advice.drive)} at {_where(advice, 0)}, where it stood at first."
    return (
        f"Mount the {wheel(advice.drive)} {turn(chosen)} from {_where(advice, 0)}, seen from the cam side: expected "
        f"{gains}."
    )


def render(advice: TrialAdvice, style: Style) -> RenderableType:
    """The instruction, the trials, the offset they tell, the positions, and what to measure next."""
    known = advice.known
    heading = f"{advice.drive.name}: the cam offset from {_count(len(known.trials), 'trial')} at {known.rig.M_g:g} N·m"
    parts: list[RenderableType] = [Text(style.text(heading), style="bold"), Text(style.text(instruction(advice)))]
    parts.append(_trials(advice, style))
    parts += [Text(style.text(_trace(advice, trial))) for trial in known.trials if trial.trace]
    parts += [_offset(advice, style), _positions(advice, style)]
    parts.append(Text(style.text(_next(advice))))
    parts.append(Text(style.text(_basis(advice))))
    return Group(*(line for part in parts for line in (part, Text(""))))


def _trace(advice: TrialAdvice, trial: Trial) -> str:
    trace = trial.trace
    assert trace is not None
    words = (
        f"{trace.file} at {_where(advice, trial.rotation_deg)}: {trace.cam_turns:.3g} cam turns, "
        f"{'growing' if trace.growing else 'falling'} angles, range {trial.F_ior_arcsec:.2f} arcsec, noise of a "
        f"reading {trace.reading_noise_arcsec:.2g}. The curve is compared, at an open start in the output's turn; slow "
        f"errors of {advice.known.rig.noise_arcsec:g} arcsec are allowed for."
    )
    return "\n".join([words, *(f"  {note}" for note in trace.notes)])


def _next(advice: TrialAdvice) -> str:
    known, then = advice.known, advice.next.loss
    now = known.expected_loss[known.best]
    if now - then < TEACHES:
        return "No further trial would teach much. Measure after mounting, and give it as --verify."
    return (
        f"A trial at {_where(advice, advice.next.rotation_deg)} would teach most: the choice is expected to lose "
        f"{then:.1%} against the best position after it, {now:.1%} now{_by(known.criterion.name)}. What is measured "
        "after mounting can be given as one more trial, or as --verify."
    )


def _by(criterion: str) -> str:
    """Words on what the next trial is chosen by: worst cases and quantiles hardly move by one more value."""
    return "" if criterion == "expected" else f" (by the expected loss, whatever decides the mounting: {criterion})"


def _verdict(advice: TrialAdvice) -> str:
    outcome = advice.outcome
    assert outcome is not None
    told = (
        f"{outcome.trial.F_ior_arcsec:g} arcsec at {_where(advice, outcome.trial.rotation_deg)}, predicted "
        f"{outcome.expected_arcsec:.1f} ({outcome.low_arcsec:.1f} to {outcome.high_arcsec:.1f})"
    )
    if outcome.back_to:
        back = outcome.back_to
        was = f"a trace with a range of {back.F_ior_arcsec:.1f}" if back.trace else f"{back.F_ior_arcsec:g}"
        return f"Go back to {_where(advice, back.rotation_deg)}, where {was} was measured: {told}."
    words = f"Keep it: {told}."
    after = outcome.after
    if after and after.rotations_deg[after.best] != outcome.trial.rotation_deg:
        best = _where(advice, after.rotations_deg[after.best])
        words += f" Of all positions, {best} is now expected to be the best; as a trial the outcome counts for that."
    return words


def _where(advice: TrialAdvice, rotation_deg: float) -> str:
    return hole_words(rotation_deg, advice.drive.mounting.holes)


def _count(number: int, words: str) -> str:
    return f"{number} {words}" + ("s" if number != 1 else "")


def _trials(advice: TrialAdvice, style: Style) -> Table:
    known = advice.known
    seat = f", seat {known.rig.reseat_um:g} um" if known.rig.reseat_um else ""
    grid = table(style, f"trials (standard deviations: noise {known.rig.noise_arcsec:g} arcsec{seat})")
    grid.add_column("position", no_wrap=True)
    for words in ("measured, arcsec", "explained as", "standard deviation of that"):
        grid.add_column(words, justify="right")
    for trial, mean, spread in zip(known.trials, known.predicted_arcsec, known.predicted_spread_arcsec, strict=True):
        where = _where(advice, trial.rotation_deg)
        told = f"trace {trial.F_ior_arcsec:.1f}" if trial.trace else f"{trial.F_ior_arcsec:g}"
        grid.add_row(where, told, f"{mean:.2f}", f"{spread:.2f}")
    return grid


def _offset(advice: TrialAdvice, style: Style) -> Table:
    mean, spread = advice.known.offset_um
    grid = table(style, f"cam offset: {mean:.0f} um, standard deviation {spread:.0f} um")
    for words in ("direction, deg", "standard deviation", "probability, %", "size, um", "best position"):
        grid.add_column(
            words, justify="left" if words == "best position" else "right", no_wrap=words == "best position"
        )
    for one in advice.known.directions():
        facing = ("open", "-") if _is_open(one) else (f"{one.direction_deg:.0f}", f"{one.spread_deg:.0f}")
        best = _where(advice, one.recommended_deg)
        grid.add_row(*facing, f"{one.share:.0%}".rstrip("%"), f"{one.size_um:.0f}", best)
    return grid


def _is_open(one: Direction) -> bool:
    return one.spread_deg >= OPEN


def _positions(advice: TrialAdvice, style: Style) -> Table:
    known = advice.known
    torques = " / ".join(f"{M_g:g}" for M_g in known.prior.torques[: known.deciding])
    grid = table(style, f"positions, best first: F'_ior in arcsec at {torques} N·m; loss expected against the best")
    grid.add_column("position", no_wrap=True)
    for words in ("best, %", "expected", "5 %", "95 %", "loss, %"):
        grid.add_column(words, justify="right", no_wrap=words in ("expected", "5 %", "95 %"))
    levels = [known.expected_F_ior(level) for level in (None, *INTERVAL.values())]
    for place in advice.ranked[:SHOWN]:
        values = [" / ".join(f"{v:.1f}" for v in level[: known.deciding, place]) for level in levels]
        share, loss = f"{known.probability_best[place]:.0%}", f"{known.expected_loss[place]:.1%}"
        grid.add_row(_where(advice, known.rotations_deg[place]), share.rstrip("%"), *values, loss.rstrip("%"))
    return grid


def _basis(advice: TrialAdvice) -> str:
    known = advice.known
    errors = " / ".join(f"{error:.2f}" for error in known.prior.standard_error_arcsec)
    mean, spread = known.scale
    draws = len(known.prior.model) // (len(known.model_share) * len(SCALES))
    drawn = f", with the offset that turns with the cam and what is uncertain drawn {draws} times" if draws > 1 else ""
    words = (
        f"Positions are turns from where the wheel stood at 0, counter-clockwise seen from the cam side. Offsets up to "
        f"{known.prior.size_um[-1]:.0f} um were weighed{drawn}, and with the model's scale: the drive shows {mean:.2f} "
        f"of the computed F'_ior, standard deviation {spread:.2f} (before the trials: 1.00, {SCALE:.2f}, assumed)"
    )
    sets = len(known.model_share)
    if sets > 1:
        shares = ", ".join(f"{share:.0%}" for share in known.model_share)
        words += f"; {sets} sets of stiffnesses hold {shares}"
    return f"{words}. F'_ior interpolated, standard error {errors} arcsec."


def to_json(advice: TrialAdvice, seed: int) -> Json:
    """What the trials teach as a JSON object: one shape, whatever was given."""
    known, ranked = advice.known, advice.ranked
    certificate, chosen, present = known.prior.certificate, advice.chosen, advice.present
    positions = _positions_object(advice)
    return {
        **envelope("trials", advice.drive, exit_code(advice), warnings(advice)),
        "complete": True,
        "instruction": instruction(advice),
        "turn": bool(chosen.rotation_deg),
        "M_g_Nm": list(known.prior.torques[: known.deciding]),
        "weights": None if known.weights is None else list(known.weights),
        "criterion": known.criterion.name,
        "positions": positions,
        "current": {
            **_place(advice, present.rotation_deg),
            "phase_deg": present.phase_deg,
            "F_ior_arcsec": {
                "expected": list(map(float, present.F_ior_arcsec)),
                **{
                    name: [quantile(values, known.weight, level) for values in known.now_arcsec[: known.deciding]]
                    for name, level in INTERVAL.items()
                },
            },
        },
        "recommended": positions[ranked[0]],
        "second": positions[ranked[1]] if len(ranked) > 1 else None,
        "worst": positions[ranked[-1]],
        "gain": float(-chosen.change_from(present)),
        "settled": advice.settled,
        "next": {
            **_place(advice, advice.next.rotation_deg),
            "expected_loss": advice.next.loss,
            "criterion": "expected",  # whatever decides the mounting
        },
        "trials": {
            "M_g_Nm": known.rig.M_g,
            "noise_arcsec": known.rig.noise_arcsec,
            "reseat_um": known.rig.reseat_um,
            "measured": [
                {**_trial(advice, trial), "explained_arcsec": float(mean), "explained_sd_arcsec": float(spread)}
                for trial, mean, spread in zip(
                    known.trials, known.predicted_arcsec, known.predicted_spread_arcsec, strict=True
                )
            ],
        },
        "offset": {
            "size_um": known.offset_um[0],
            "size_sd_um": known.offset_um[1],
            "directions": [
                {
                    "probability": one.share,
                    "direction_deg": None if _is_open(one) else one.direction_deg,
                    "direction_sd_deg": None if _is_open(one) else one.spread_deg,
                    "size_um": one.size_um,
                    "recommended": _place(advice, one.recommended_deg),
                }
                for one in known.directions()
            ],
        },
        "scale": known.scale[0],
        "scale_sd": known.scale[1],
        "stiffness_sets": known.model_share.tolist(),
        "standard_error_arcsec": known.prior.standard_error_arcsec.tolist(),
        "verification": _outcome(advice),
        "certificate": {
            "states": certificate.states,
            "max_residual": certificate.max_residual,
            "fallbacks": certificate.fallbacks,
        },
        "seed": seed,
    }


def _positions_object(advice: TrialAdvice) -> list[Json]:
    """The positions that may be chosen, with F'_ior at each torque that decides."""
    known = advice.known
    F_ior = {name: known.expected_F_ior(level) for name, level in (("expected", None), *INTERVAL.items())}
    return [
        {
            **_place(advice, rotation),
            "phase_deg": advice.phase(rotation),
            "F_ior_arcsec": {name: values[: known.deciding, place].tolist() for name, values in F_ior.items()},
            "probability_best": float(known.probability_best[place]),
            "expected_loss": float(known.expected_loss[place]),
        }
        for place, rotation in enumerate(known.rotations_deg)
    ]


def _place(advice: TrialAdvice, rotation_deg: float) -> Json:
    return {"rotation_deg": rotation_deg, "hole": hole_of(rotation_deg, advice.drive.mounting.holes)}


def _trial(advice: TrialAdvice, trial: Trial) -> Json:
    if trial.trace is None:
        return {**_place(advice, trial.rotation_deg), "F_ior_arcsec": trial.F_ior_arcsec, "trace": None}
    trace = trial.trace
    return {
        **_place(advice, trial.rotation_deg),
        "F_ior_arcsec": None,
        "trace": {
            "file": trace.file,
            "sha256": trace.sha256,
            "range_arcsec": trace.range_arcsec,
            "cam_turns": trace.cam_turns,
            "angles": "growing" if trace.growing else "falling",
            "reading_noise_arcsec": trace.reading_noise_arcsec,
            "notes": list(trace.notes),
        },
    }


def _outcome(advice: TrialAdvice) -> Json | None:
    outcome = advice.outcome
    if outcome is None:
        return None
    return {
        **_trial(advice, outcome.trial),
        "expected_arcsec": outcome.expected_arcsec,
        "low_arcsec": outcome.low_arcsec,
        "high_arcsec": outcome.high_arcsec,
        "as_predicted": outcome.as_predicted,
        "verdict": "KEEP" if outcome.keep else "GO_BACK",
        "position": _place(advice, outcome.stay_deg),
    }


def figures(advice: TrialAdvice) -> Figures:
    """Header and rows of a table, one row per torque and position."""
    known, expected = advice.known, advice.known.expected_F_ior()
    rows = [
        [M_g, rotation, float(expected[k, p]), float(known.probability_best[p]), float(known.expected_loss[p])]
        for k, M_g in enumerate(known.prior.torques[: known.deciding])
        for p, rotation in enumerate(known.rotations_deg)
    ]
    return ["M_g_Nm", "rotation_deg", "F_ior_expected_arcsec", "probability_best", "expected_loss"], rows


def summary_line(advice: TrialAdvice) -> str:
    """The answer alone: the hole (or angle in degrees) to mount the wheel in, after an outcome the one to stay in."""
    rotation = advice.outcome.stay_deg if advice.outcome else advice.chosen.rotation_deg
    hole = _place(advice, rotation)["hole"]
    return f"{rotation:g}" if hole is None else f"{hole}"


def card_facts(advice: TrialAdvice, say: Texts) -> CardFacts:
    """What the assembly card tells of an advice; say, the texts of its language."""
    known = advice.known
    return CardFacts(
        choice=advice.choice,
        cam_deg=known.likeliest_deg if known.pointed else None,  # else there is no direction to draw
        chances=advice.chances,
        weights=known.weights,
        warnings=warnings(advice, say),
        trials=trials_line(advice.drive, known.trials, known.rig.M_g, say),
    )


def trials_line(drive: Drive, trials: Sequence[Trial], M_g: float, say: Texts) -> str:
    """The trials that a card rests on, in a sentence: as many as it has room for.

    Arguments: drive; trials, and their torque [N*m]; say, the texts of the card's language.
    """
    told = []
    for trial in trials[:ON_CARD]:
        hole = hole_of(trial.rotation_deg, drive.mounting.holes)
        where = say.angle(trial.rotation_deg) if hole is None else say("foot.hole", hole=hole)
        if trial.trace:
            file, digest = shown(trial.trace.file), trial.trace.sha256[:DIGITS]
            value = say.number(trial.F_ior_arcsec, ".1f")
            told.append(say("foot.traced", where=where, file=file, digest=digest, value=value))
        else:
            told.append(say("foot.trial", where=where, value=say.number(trial.F_ior_arcsec)))
    return say("foot.trials", torque=say.torque(M_g), trials="; ".join(told))
