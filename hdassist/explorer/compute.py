"""The explorer's answers, computed in processes beside the screen; each is given to `tell` as soon as it is there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial

import numpy as np

from hdassist.belief.prior import FieldPrior, prior_of
from hdassist.belief.samples import EFFECTIVE_SAMPLES, ErrorBelief, Samples, errors_by_turn
from hdassist.design.check import DesignCheck, OperatingPoint, check, drive_samples
from hdassist.error.error_map import Batch, ErrorMap, searchable
from hdassist.error.self_error import limits_left
from hdassist.error.trace import Trace, trace
from hdassist.errors import HdassistError
from hdassist.explorer.failed import Failed
from hdassist.explorer.levers import SETTING_SECTIONS, step_of
from hdassist.explorer.state import Session, rig_of
from hdassist.model.contacts import contact_system
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.model.unknown import no_hole_better, unknown_turn, unknowns
from hdassist.mounting.advice import Advice, advise
from hdassist.mounting.losses import PositionStatistics
from hdassist.mounting.positions import rotated, seat_positions
from hdassist.mounting.trial import read_trial
from hdassist.pages.check import check_report
from hdassist.pages.mount import mount_report
from hdassist.pages.trials import trials_report
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import kind_of
from hdassist.report.report import Report
from hdassist.run.processes import workers
from hdassist.run.run import UNCHECKED, Run
from hdassist.solve.formulation import formulate
from hdassist.solve.window import in_wide_enough_window
from hdassist.trials.advice import TrialAdvice, advise_from_trials
from hdassist.trials.prior import TRIAL_EFFORT, TrialEffort
from hdassist.verdict import Verdict, verdict_by_probability

SEED = 0  # of samples and of what is solved again, as the commands have it
LOW_SHARE_SHOWN, MIDDLE_SHARE, HIGH_SHARE_SHOWN = 0.05, 0.5, 0.95  # percentiles
STEP = 0.34  # of the probability of a field that is not known exactly: a step to either side, about one deviation


class Sure(StrEnum):
    """How sure an F'_ior is: estimated from few states, its extremes searched, every state solved, a 90 % range."""

    COARSE = "COARSE"
    REFINED = "REFINED"
    PROVEN = "PROVEN"
    RANGE = "90 % RANGE"


@dataclass(frozen=True)
class Effort:
    """How much is computed.

    grid: positions of each wheel that an estimate rests on; draws: effective samples of what is not known exactly;
    trials: that of trials; jobs: processes at work, 0 for one each core.
    """

    grid: int = 8
    draws: int = EFFECTIVE_SAMPLES
    trials: TrialEffort = TRIAL_EFFORT
    jobs: int = 0


FULL = Effort()


@dataclass(frozen=True, eq=False)
class SeatCurve:
    """F'_ior [arcsec] over turns of the fixed wheel from where it stands [deg].

    F_ior_arcsec: shape (3, torques, turns): 5th percentile, median, 95th, all alike where it is one value; sure: how
    sure it is at each turn.
    """

    rotations_deg: tuple[float, ...]
    F_ior_arcsec: Array
    sure: tuple[Sure, ...]

    def place(self, rotation_deg: float) -> int | None:
        """Which of the turns one is, None for another."""
        near = np.abs((np.array(self.rotations_deg) - rotation_deg + 180) % 360 - 180) < 1e-6
        return int(near.argmax()) if near.any() else None

    @property
    def merits(self) -> Array:
        """Greatest over the torques of the median against that of how the wheel stands, shape (turns,)."""
        median = self.F_ior_arcsec[1]
        now = median[:, self.rotations_deg.index(0.0)]
        return np.asarray((median / np.maximum(now, 1e-9)[:, None]).max(axis=0))


@dataclass(frozen=True)
class ErrorRange:
    """F'_ior [arcsec] at a torque M_g [N*m] with the wheel as it stands, and the limit that it is held against.

    p5, p50, p95: percentiles over all that is not known exactly, all alike where all is known; left_arcsec, what the
    limit leaves F'_ior beside the self error; probability of keeping the limit, None where all is known; verdict by
    the rule of `check`.
    """

    M_g: float
    p5: float
    p50: float
    p95: float
    left_arcsec: float | None
    limit_arcsec: float | None
    probability: float | None
    verdict: Verdict

    @property
    def margin_arcsec(self) -> float | None:
        """What the limit leaves above the 95th percentile with the self error [arcsec]."""
        return None if self.left_arcsec is None else self.left_arcsec - self.p95


@dataclass(frozen=True)
class Headline:
    """The answer of `check`, a row a torque.

    samples: effective ones so far, 0 where all is known; report, that of the whole answer; typical: values by path of
    the sample nearest to the median.
    """

    rows: tuple[ErrorRange, ...]
    samples: float
    report: Report | None = None
    typical: Mapping[str, float] = field(default_factory=dict)

    @property
    def whole(self) -> bool:
        """Whether it is the whole answer, not one of the samples so far."""
        return self.report is not None


@dataclass(frozen=True)
class LeverEffects:
    """By field: the step that is plausible [its unit], and what it does to F'_ior at each torque [arcsec]."""

    steps: Mapping[str, tuple[float, tuple[float, ...]]]


ExplorerAnswer = SeatCurve | Headline | LeverEffects | Report | Advice | TrialAdvice | Trace | Failed
Tell = Callable[[ExplorerAnswer], None]


def is_any_hole(drive: Drive) -> bool:
    """Whether the direction that decides is not known: any hole may be the best one."""
    return bool(unknowns(drive) and unknown_turn(drive) and not no_hole_better(drive))


def drive_answers(drive: Drive, effort: Effort, tell: Tell) -> None:
    """F'_ior over the seat by an estimate and a search, the answer of `check`, that of `mount`.

    Raises HdassistError where there is no answer.
    """
    if searchable(drive) and not is_any_hole(drive):
        rotations = tuple(seat_positions(drive))
        estimate = partial(_estimates, rotations, effort.grid)
        search = partial(_searched, rotations)
        for analysis, sure in ((estimate, Sure.COARSE), (search, Sure.REFINED)):
            F_ior = in_wide_enough_window(drive, analysis)
            tell(SeatCurve(rotations, np.stack([F_ior] * 3), (sure,) * len(rotations)))
    with workers(effort.jobs) as executor:
        run = Run(executor, seed=SEED)
        tell(in_wide_enough_window(drive, partial(_checked, effort=effort, run=run, tell=tell)))
        torques, rotations_deg = drive.operation.M_g, seat_positions(drive)
        mounting = partial(advise, torques=torques, rotations_deg=rotations_deg, draws=effort.draws, run=run)
        advice = in_wide_enough_window(drive, mounting)
    if not advice.any_hole:
        tell(_mount_curve(advice))
    tell(mount_report(advice, SEED))
    tell(advice)


def trial_answers(session: Session, effort: Effort, tell: Tell) -> None:
    """The answer of `trials`. Raises HdassistError where there is none."""
    drive = session.drive
    with workers(effort.jobs) as executor:
        advice = advise_from_trials(
            drive,
            [read_trial(text, drive.mounting.holes) for text in session.trials],
            rig_of(session),
            needed=session.rig.sure,
            effort=effort.trials,
            run=Run(executor, seed=SEED),
        )
    tell(_statistics_curve(advice.losses))
    tell(trials_report(advice))
    tell(advice)


def cam_turn(drive: Drive, rotation_deg: float, M_g: float, tell: Tell) -> None:
    """The answer of `trace` with the fixed wheel turned. Raises HdassistError where there is none."""
    tell(in_wide_enough_window(rotated(drive, rotation_deg), partial(trace, M_g=M_g, run=UNCHECKED)))


def lever_effects(drive: Drive, typical: Mapping[str, float], effort: Effort, tell: Tell) -> None:
    """What a plausible step of each field does to F'_ior of a typical drive, estimated from few states.

    A step of a field that is not known exactly goes about one standard deviation far. Raises HdassistError where the
    typical drive has no answer.
    """
    here = drive.with_values(dict(typical))
    if not searchable(here):
        return
    now = _estimates((0.0,), effort.grid, here)[:, 0]
    steps = dict(_steps(here, {each.path: each for each in prior_of(drive).fields}))
    found: dict[str, tuple[float, tuple[float, ...]]] = {}
    with workers(effort.jobs) as executor:
        ranges = executor.map(partial(_moved_ranges, here, effort.grid), steps.items())
        for (path, step), there in zip(steps.items(), ranges, strict=True):
            if there is not None:
                found[path] = step, tuple((there - now).tolist())
            if len(found) % 8 == 0:
                tell(LeverEffects(dict(found)))
    tell(LeverEffects(found))


def _steps(drive: Drive, priors: Mapping[str, FieldPrior]) -> Iterator[tuple[str, float]]:
    """Plausible steps of the fields of a drive, the other way where the first leaves what is allowed."""
    for path, info in field_table().items():
        prior = priors.get(path)
        is_setting = path.split(".")[0] in SETTING_SECTIONS and not prior
        if kind_of(info) != "number" or is_setting or drive.value(path) is None:
            continue
        if prior:
            low, high = prior.value(np.array([MIDDLE_SHARE - STEP, MIDDLE_SHARE + STEP]))
            step = float(f"{(high - low) / 2:.2g}")
        else:
            step = step_of(info, drive.number(path))
        for each in (step, -step):
            value = drive.number(path) + each
            if each and drive.allows(path, value) and first_conflict(drive.with_values({path: value})) is None:
                yield path, each
                break


def _moved_ranges(drive: Drive, grid: int, step: tuple[str, float]) -> Array | None:
    """F'_ior at each torque after a step, estimated; None where such a drive has no answer."""
    path, by = step
    with suppress(HdassistError):
        return _estimates((0.0,), grid, drive.with_values({path: drive.number(path) + by}))[:, 0]
    return None


def _estimates(rotations_deg: tuple[float, ...], grid: int, drive: Drive) -> Array:
    """F'_ior of turned drives from a grid of states, shape (torques, turns)."""
    turned = Batch.turned(drive, rotations_deg)
    formulation, like, found = formulate(contact_system(drive)), None, []
    for M_g in drive.operation.M_g:
        error_map = ErrorMap(drive, M_g, formulation, like)
        like = error_map.fresh
        found.append(error_map.estimated_ranges(turned, grid)[0])
    return np.array(found)


def _searched(rotations_deg: tuple[float, ...], drive: Drive) -> Array:
    return errors_by_turn(drive, drive.operation.M_g, rotations_deg)[1]


def _statistics_curve(found: PositionStatistics) -> SeatCurve:
    rotations = tuple(sorted({0.0, *found.rotations_deg}))
    values = [
        [found.quantile(share, found.place(at)) for at in rotations]
        for share in (LOW_SHARE_SHOWN, MIDDLE_SHARE, HIGH_SHARE_SHOWN)
    ]
    return SeatCurve(rotations, np.swapaxes(values, 1, 2), (Sure.RANGE,) * len(rotations))


def _mount_curve(advice: Advice) -> SeatCurve:
    if advice.positions:
        return _statistics_curve(advice.positions)
    curve = advice.curve
    order = np.argsort(curve.rotation_deg)
    done = np.atleast_1d(curve.every_state[:, order].all(axis=0)).tolist()
    sure = [Sure.PROVEN if each and not advice.unknown else Sure.REFINED for each in done]
    return SeatCurve(
        tuple(curve.rotation_deg[order].tolist()), np.stack([curve.F_ior_arcsec[:, order]] * 3), tuple(sure)
    )


def _checked(drive: Drive, effort: Effort, run: Run, tell: Tell) -> Headline:
    """The answer of `check`; told on the way, by the samples so far."""
    prior, torques, samples = prior_of(drive), drive.operation.M_g, None
    if prior.fields and effort.draws and searchable(drive):
        left = limits_left(drive, torques)

        def seen(samples: Samples) -> None:
            if samples.effective:
                rows = tuple(_sampled(samples, k, each, drive.limit(torques[k])) for k, each in enumerate(left))
                tell(Headline(rows, samples.effective))

        samples = drive_samples(prior, left, draws=effort.draws, run=run, seen=seen)
    found = check(drive, draws=effort.draws, samples=samples, run=run)
    rows = tuple(map(_of_point, found.points))
    return Headline(rows, samples.effective if samples else 0.0, check_report(found, SEED), _typical(found))


def _sampled(samples: Samples, torque: int, left: float | None, limit: float | None) -> ErrorRange:
    belief = ErrorBelief(samples, torque)
    kept = None if left is None else belief.probability_within(left)
    verdict = verdict_by_probability(kept.low, kept.high) if kept else Verdict.NO_LIMIT
    return ErrorRange(
        samples.torques[torque], belief.p5, belief.p50, belief.p95, left, limit, kept.value if kept else None, verdict
    )


def _of_point(point: OperatingPoint) -> ErrorRange:
    belief, value = point.belief, point.error.F_ior_arcsec
    percentiles = (belief.p5, belief.p50, belief.p95) if belief else (value,) * 3
    left, kept = point.left_arcsec, point.probability
    return ErrorRange(point.M_g, *percentiles, left, point.limit_arcsec, kept.value if kept else None, point.verdict)


def _typical(found: DesignCheck) -> Mapping[str, float]:
    if not found.samples:
        return {}
    values = found.samples.F_ior_arcsec[:, found.least_sure]
    near = np.argmin(np.abs(values - found.samples.percentile(MIDDLE_SHARE, found.least_sure)))
    return found.samples.prior.values(found.samples.shares[[near]])[0]
