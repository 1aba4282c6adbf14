"""What the explorer's processes compute: answers to a question, quick ones first, each by the function of a command.

An F'_ior is first the range over a few states, then that of a search, then of every state where `hdassist mount` solves
every state. Advice, cards and JSON are those of mount and trials.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from datetime import date
from functools import partial
from typing import Any

import numpy as np

from hdassist.belief.prior import prior_of
from hdassist.belief.samples import ErrorBelief, Samples
from hdassist.design.check import drive_samples
from hdassist.error.cycle import kinematic_error
from hdassist.error.error_map import Batch, ErrorMap, searchable
from hdassist.error.self_error import self_error
from hdassist.error.table import DEVIATIONS
from hdassist.errors import HdassistError
from hdassist.explorer import trial_entry
from hdassist.explorer.answers import (
    Advised,
    Answer,
    Believed,
    Curve,
    Facts,
    Place,
    Rendered,
    Slopes,
    Sure,
    TorqueBelief,
    Underway,
    Value,
)
from hdassist.explorer.compute_views import compared, turned
from hdassist.explorer.levers import SETTINGS, stepped
from hdassist.explorer.questions import (
    BeliefQuestion,
    Effort,
    MountQuestion,
    ProofQuestion,
    Question,
    RenderQuestion,
    SlopesQuestion,
    TraceQuestion,
    TrialsQuestion,
    TurnQuestion,
)
from hdassist.model.assumed import assumptions
from hdassist.model.contacts import StateGaps
from hdassist.model.deviations import deviation_scalars
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.model.unknown import unknown_turn, unknowns
from hdassist.mounting import card_render
from hdassist.mounting import page as mount_page
from hdassist.mounting.advice import Advice, advise
from hdassist.mounting.card import card_of
from hdassist.mounting.losses import PositionStatistics
from hdassist.mounting.positions import MountingCurve, hole_of, rotated, seat_positions
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import kind_of
from hdassist.run.processes import workers
from hdassist.run.run import Progress, Run
from hdassist.solve.loadcase import LoadCase
from hdassist.solve.window import in_wide_enough_window
from hdassist.terminal.answers import json_text
from hdassist.terminal.texts import texts
from hdassist.trials import page as trials_page
from hdassist.trials.advice import TrialAdvice, advise_from_trials
from hdassist.trials.prior import TRIAL_EFFORT, TrialEffort, trial_states
from hdassist.verdict import verdict_by_probability

FEWEST = 5  # positions of each wheel that the first values rest on: those of the first torque are there at once
FREE_STEP = 15.0  # deg between positions at first, where the seat has no holes
GROUP = 2  # positions that one task searches: few, so that the curve grows under the eye
STEPS = 20  # in which is told how far an answer is
SEED = 0  # of samples and of what is solved again, as the commands have it
LOW, HIGH = 0.05, 0.95


def answers(question: Question, tell: Callable[[Answer], None] = lambda _: None) -> Iterator[Answer]:
    """Answers to a question, ever surer. Raises HdassistError where there is none.

    tell is given what comes between them: how far one is.
    """
    match question:
        case MountQuestion():
            return _mount(question.drive, question.effort)
        case BeliefQuestion():
            return _believed(question.drive, question.effort, tell)
        case TrialsQuestion():
            return _trials(question, tell)
        case ProofQuestion():
            return _proof(question.drive, question.rotation_deg, question.effort)
        case SlopesQuestion():
            return _slopes(rotated(question.drive, question.rotation_deg), question)
        case TurnQuestion():
            return iter([turned(question)])
        case TraceQuestion():
            return iter([compared(question)])
        case RenderQuestion():
            return iter([Rendered(_rendered(question))])


def _mount(drive: Drive, effort: Effort) -> Iterator[Answer]:
    """What is known of a drive, its curve ever surer, advice of `hdassist mount`."""
    facts = _facts(drive)
    yield facts
    has_curve = searchable(drive) and not facts.any_hole
    if has_curve:
        yield from _coarse(drive, effort.turns)
    with workers(effort.jobs) as executor:
        if has_curve:
            yield from _refined(drive, executor)
        analysis = partial(
            advise,
            torques=drive.operation.M_g,
            rotations_deg=seat_positions(drive),
            draws=effort.draws,
            run=Run(executor, seed=SEED),
        )
        yield _mount_advised(in_wide_enough_window(drive, analysis))


def _believed(drive: Drive, effort: Effort, tell: Callable[[Answer], None]) -> Iterator[Answer]:
    """F'_ior over all that is not known exactly, by the samples of `hdassist check`; told on the way, so far."""
    with workers(effort.jobs) as executor:

        def drawn(there: Drive) -> Believed:
            prior, torques = prior_of(there), there.operation.M_g
            if not (prior.fields and effort.draws):
                return Believed(())
            if not searchable(there):
                return Believed((), failed="the cycle of rolling balls cannot be searched")
            limits = [there.limit(M_g) for M_g in torques]
            own = [each.range_arcsec for each in self_error(there, torques)] if any(limits) else [0.0] * len(torques)
            held = [None if limit is None else limit - more for limit, more in zip(limits, own, strict=True)]

            def row(samples: Samples, k: int) -> TorqueBelief:
                at = ErrorBelief(samples, k)
                if (limit := held[k]) is None:
                    return TorqueBelief(torques[k], at.p5, at.p50, at.p95)
                found = at.probability_within(limit)
                verdict = verdict_by_probability(found.low, found.high)
                return TorqueBelief(torques[k], at.p5, at.p50, at.p95, limits[k], found.value, verdict)

            def believed(samples: Samples, whole: bool) -> Believed:
                return Believed(tuple(row(samples, k) for k in range(len(torques))), samples.effective, whole)

            def seen(samples: Samples) -> None:
                if samples.effective:
                    tell(believed(samples, whole=False))

            found = drive_samples(prior, held, draws=effort.draws, run=Run(executor, seed=SEED), seen=seen)
            return believed(found, whole=True)

        try:
            yield in_wide_enough_window(drive, drawn)
        except HdassistError as error:
            yield Believed((), failed=error.message)


def _trials(asked: TrialsQuestion, tell: Callable[[Answer], None]) -> Iterator[Answer]:
    """The advice of `hdassist trials`; told on the way, how far it is."""
    drive, rig = asked.drive, trial_entry.rig_of(asked.drive, asked.rig)
    effort = TrialEffort.of(asked.effort.trial_draws) if asked.effort.trial_draws else TRIAL_EFFORT
    progress = _in_shares(trial_states(drive, len({*drive.operation.M_g, rig.M_g}), effort), tell)
    with workers(asked.effort.jobs) as executor:
        trials, run = trial_entry.read(asked.trials, drive), Run(executor, progress, SEED)
        yield _trials_advised(advise_from_trials(drive, trials, rig, needed=asked.rig.sure, effort=effort, run=run))


def _in_shares(states: int, tell: Callable[[Answer], None]) -> Progress:
    """What counts states that are solved, and tells their share of so many, each step of it once."""
    solved = told = 0

    def progress(count: int) -> None:
        nonlocal solved, told
        solved += count
        if (step := min(STEPS * solved // states, STEPS)) > told:
            told = step
            tell(Underway(step / STEPS))

    return progress


def _proof(drive: Drive, rotation: float, effort: Effort) -> Iterator[Answer]:
    """The curve of one position alone."""
    with workers(effort.jobs) as executor:
        tasks = [(drive, M_g, rotation) for M_g in drive.operation.M_g]
        values = tuple(Value(value, Sure.PROVEN) for value in executor.map(_every_state, tasks))
    yield Curve(tuple(drive.operation.M_g), (_place(drive, rotation, values),), drive.mounting.holes)


def _slopes(drive: Drive, asked: SlopesQuestion) -> Iterator[Answer]:
    """Changes of the range over a few states with a step of each field, told as they come."""
    if not searchable(drive):
        return
    turns, torques = asked.effort.turns, drive.operation.M_g
    cases = [LoadCase.of(drive, M_g) for M_g in torques]
    now = [_ranges(case, [drive], turns)[0] for case in cases]
    found: dict[str, tuple[float, ...]] = {}
    for path in _moving(drive):
        there = drive.with_values({path: stepped(field_table()[path], drive.number(path))})
        with suppress(HdassistError):  # a drive that cannot be computed has no slope
            same = path.startswith(DEVIATIONS)  # the same contact system, moved otherwise
            there_cases = cases if same else [LoadCase.of(there, M_g) for M_g in torques]
            after = [_ranges(case, [there], turns)[0] for case in there_cases]
            found[path] = tuple(b - a for a, b in zip(now, after, strict=True))
            if len(found) % 8 == 0:
                yield Slopes(asked.rotation_deg, dict(found))
    yield Slopes(asked.rotation_deg, found)


def _moving(drive: Drive) -> Iterator[str]:
    """Fields that a step can be taken of."""
    for path, info in field_table().items():
        if kind_of(info) != "number" or path.split(".")[0] in SETTINGS or drive.value(path) is None:
            continue
        value = stepped(info, drive.number(path))
        there = drive.with_values({path: value})
        if drive.allows(path, value) and first_conflict(there) is None:
            yield path


def _rendered(asked: RenderQuestion) -> str:
    """A text as the command writes it."""
    advice = pickle.loads(asked.sealed)  # of this program's own process
    page: Any = mount_page if isinstance(advice, Advice) else trials_page
    if asked.kind == "json":
        return json_text(page.to_json(advice, *([SEED] if isinstance(advice, Advice) else [])))
    say = texts()
    card = card_of(page.card_facts(advice, say), say, serial=asked.serial, made=date.today())
    made = {".html": card_render.html, ".md": card_render.markdown, ".txt": card_render.plain_text}
    return made[asked.kind](card)


def _facts(drive: Drive) -> Facts:
    open_ = unknowns(drive)
    paths, fields = tuple(each.path for each in open_), prior_of(drive).fields
    return Facts(paths, bool(open_ and unknown_turn(drive)), len(list(assumptions(drive))), len(fields))


def _places(drive: Drive) -> list[float]:
    """Turns [deg] that the curve has at first: the holes, or steps where the angle is free."""
    return seat_positions(drive, FREE_STEP)


def _place(drive: Drive, rotation: float, values: tuple[Value, ...]) -> Place:
    hole, allowed = hole_of(rotation, drive.mounting.holes), drive.mounting.allowed
    return Place(rotation, hole, values, allowed == "all" or hole is None or hole in allowed)


def _curve(drive: Drive, values: Array, sure: Sequence[Sequence[Sure]]) -> Curve:
    """Arguments: values and sure, shape (torques, places), NaN where nothing is known."""
    places = tuple(
        _place(drive, rotation, tuple(Value(float(v[k]), s[k]) for v, s in zip(values, sure, strict=True)))
        for k, rotation in enumerate(_places(drive))
        if not np.isnan(values[:, k]).any()
    )
    return Curve(tuple(drive.operation.M_g)[: len(values)], places, drive.mounting.holes)


def _coarse(drive: Drive, turns: int) -> Iterator[Curve]:
    """The curve from a few states of each position: one torque after the other from the fewest, then all from more."""
    there = [rotated(drive, rotation) for rotation in _places(drive)]
    cases: list[LoadCase] = []
    rows: list[list[float]] = []
    for M_g in drive.operation.M_g:
        cases.append(LoadCase.of(drive, M_g))
        rows.append(_ranges(cases[-1], there, min(FEWEST, turns)))
        yield _curve(drive, np.array(rows), [[Sure.COARSE] * len(there)] * len(rows))
    if turns > FEWEST:
        rows = [_ranges(case, there, turns) for case in cases]
        yield _curve(drive, np.array(rows), [[Sure.COARSE] * len(there)] * len(rows))


def _ranges(case: LoadCase, drives: Sequence[Drive], turns: int) -> list[float]:
    """Ranges of the error [arcsec] over a few states, spread over both wheels' turns: never more than F'_ior.

    Drives differ in their deviations alone: the engine is far quicker with all of their states at once.
    """
    angles = 2 * np.pi * np.arange(turns) / turns
    alpha_g, alpha_b = (angle.ravel() for angle in np.meshgrid(angles, angles, indexing="ij"))
    scalars = [deviation_scalars(drive, alpha_g, alpha_b) for drive in drives]
    rotation = case.solve(StateGaps(np.concatenate(scalars)), lambda k: f"state {k}").rotation_arcsec
    return [float(each) for each in np.ptp(rotation.reshape(len(drives), -1), axis=1)]


def _refined(drive: Drive, executor: Executor) -> Iterator[Curve]:
    """The curve as its positions are searched, one group after the other."""
    rotations, torques = _places(drive), drive.operation.M_g
    groups = [list(range(first, min(first + GROUP, len(rotations)))) for first in range(0, len(rotations), GROUP)]
    values = np.full((len(torques), len(rotations)), np.nan)
    tasks = [(drive, M_g, [rotations[k] for k in group]) for group in groups for M_g in torques]
    found = executor.map(_searched, tasks)
    sure = [[_sure(drive, Sure.REFINED)] * len(rotations)] * len(torques)
    for group in groups:
        for t in range(len(torques)):
            values[t, group] = next(found)
        yield _curve(drive, values, sure)


def _sure(drive: Drive, reached: Sure) -> Sure:
    """How sure an F'_ior is that was searched or solved: no more than what is not known allows."""
    return Sure.AT_ZERO if unknowns(drive) else reached


def _searched(task: tuple[Drive, float, Sequence[float]]) -> list[float]:
    drive, M_g, rotations = task
    error_map = ErrorMap(drive, M_g)
    return [error_map.many_extremes(Batch.of(rotated(drive, rotation))).first for rotation in rotations]


def _every_state(task: tuple[Drive, float, float]) -> float:
    drive, M_g, rotation = task
    return kinematic_error(rotated(drive, rotation), M_g).F_ior_arcsec


def _sealed(advice: Advice | TrialAdvice) -> bytes:
    return pickle.dumps(advice, protocol=pickle.HIGHEST_PROTOCOL)


def _mount_advised(advice: Advice) -> Advised:
    drive, curve = advice.drive, advice.curve
    settled = advice.order != "none"
    why = "" if settled else "nothing can be ordered: what is not known could reverse it"
    return Advised(
        command="mount",
        words=mount_page.what_to_do(advice),
        best_deg=advice.chosen.rotation_deg,
        reasons=tuple(_mount_reasons(advice)),
        warnings=mount_page.warnings(advice),
        settled=settled,
        why_not=why,
        next_deg=advice.to_try[0].rotation_deg if not settled else None,
        curve=_mount_curve(drive, curve, advice),
        sealed=_sealed(advice),
    )


def _mount_reasons(advice: Advice) -> Iterator[str]:
    if gain := advice.gain_probability:
        yield f"P(gain) {gain.value:.0%}, {advice.needed:.0%} wanted, {advice.all_draws} draws"
    proof = advice.curve.certificate
    yield f"{proof.states} states, greatest residual {proof.max_residual:.0e}"


def _spread(found: PositionStatistics) -> Array:
    """5th and 95th percentile of F'_ior [arcsec] in each position, shape (2, torques, positions)."""
    places = range(len(found.rotations_deg))
    return np.array([np.transpose([found.quantile(share, place) for place in places]) for share in (LOW, HIGH)])


def _mount_curve(drive: Drive, curve: MountingCurve, advice: Advice) -> Curve:
    """The curve of an advice: where every state is solved it is proven, elsewhere searched."""
    bands: dict[int, Array] = {}
    if found := advice.positions:
        spread = _spread(found)
        bands = {int(place): spread[:, :, k] for k, place in enumerate(np.flatnonzero(curve.usable))}
    places = []
    for k in np.argsort(curve.rotation_deg):
        every, band = curve.every_state[:, k], bands.get(int(k))
        values = tuple(
            Value(
                float(value),
                _sure(drive, Sure.PROVEN if every[t] else Sure.REFINED),
                None if band is None else (float(band[0, t]), float(band[1, t])),
            )
            for t, value in enumerate(curve.F_ior_arcsec[:, k])
        )
        places.append(_place(drive, float(curve.rotation_deg[k]), values))
    return Curve(curve.torques, tuple(places), curve.holes)


def _trials_advised(advice: TrialAdvice) -> Advised:
    losses, drive = advice.losses, advice.drive
    spread = _spread(losses)
    places = []
    for place in np.argsort(losses.rotations_deg):
        values = tuple(
            Value(value, Sure.FITTED, (float(spread[0, t, place]), float(spread[1, t, place])))
            for t, value in enumerate(losses.quantile(0.5, int(place)))
        )
        places.append(_place(drive, losses.rotations_deg[place], values))
    best, good = losses.chosen
    size, about, facing, off = advice.offset
    toward = "direction open" if advice.facing[0] is None else f"at {facing:.0f} deg (sd {off:.0f})"
    return Advised(
        command="trials",
        words=trials_page.instruction(advice),
        best_deg=best,
        reasons=(
            f"P(good) {good:.0%}, {advice.needed:.0%} wanted",
            f"cam offset {size:.0f} um (sd {about:.0f}) {toward}",
        ),
        warnings=tuple(trials_page.warnings(advice, texts())),
        settled=advice.settled,
        why_not="" if advice.settled else "the trials do not settle it",
        next_deg=advice.to_measure_next[0],
        curve=Curve(tuple(drive.operation.M_g), tuple(places), drive.mounting.holes),
        sealed=_sealed(advice),
    )
