"""The explorer's answers, computed in processes beside the screen; each is given to `tell` as soon as it is there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from hdassist.belief.prior import prior_of
from hdassist.belief.samples import EFFECTIVE_SAMPLES, Samples, errors_by_turn
from hdassist.comparing.drives import differing_fields
from hdassist.design.check import DesignCheck, check, drive_samples
from hdassist.error.cycle import kinematic_error
from hdassist.error.error_map import searchable
from hdassist.error.trace import trace
from hdassist.errors import HdassistError
from hdassist.explorer.levers import SETTING_SECTIONS, TEETH_FIELDS, step_of
from hdassist.explorer.state import Session, rig_of
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.model.unknown import no_hole_better, unknown_turn, unknowns
from hdassist.mounting.advice import Advice, advise
from hdassist.mounting.losses import PositionStatistics
from hdassist.mounting.positions import rotated, seat_positions
from hdassist.mounting.trial import read_trial
from hdassist.pages.check import check_report
from hdassist.pages.mount import mount_report
from hdassist.pages.trace import curve_of_turns
from hdassist.pages.trials import trials_report
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import kind_of
from hdassist.report.blocks import Curve, Lines
from hdassist.run.processes import workers
from hdassist.run.run import UNCHECKED, Run
from hdassist.trials.advice import advise_from_trials
from hdassist.trials.prior import TRIAL_EFFORT, TrialEffort

SEED = 0  # of samples and of what is solved again, as the commands have it
LOW_SHARE_SHOWN, MIDDLE_SHARE, HIGH_SHARE_SHOWN = 0.05, 0.5, 0.95  # percentiles
ORDERS = 5  # of a cam turn, the greatest
SURE_REFINED, SURE_PROVEN, SURE_RANGE = (
    "REFINED",
    "PROVEN",
    "90 % RANGE",
)  # extremes searched; every state solved; percentiles
STEP = 0.34  # of the probability of a field that is not known exactly: a step to either side, about one deviation


@dataclass(frozen=True)
class Effort:
    """How much is computed.

    draws: effective samples of what is not known exactly; trials: that of trials; jobs: processes at work, 0 for one
    each core.
    """

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
    sure: tuple[str, ...]

    def surety(self, rotation_deg: float) -> str:
        """How sure it is at a turn, empty at one that it has not."""
        place = self.place(rotation_deg)
        return "" if place is None else self.sure[place]

    def place(self, rotation_deg: float) -> int | None:
        """Which of the turns one is, None for another."""
        near = np.abs((np.array(self.rotations_deg) - rotation_deg + 180) % 360 - 180) < 1e-6
        return int(near.argmax()) if near.any() else None


@dataclass(frozen=True)
class FirstErrors:
    """F'_ior [arcsec] at each torque of a typical drive: what is there first."""

    F_ior_arcsec: Sequence[float]


@dataclass(frozen=True)
class LeverEffects:
    """By field: the step that is plausible [its unit], and what it does to F'_ior at each torque [arcsec].

    differing: fields in which the pinned drive differs; their step goes to its value.
    """

    steps: Mapping[str, tuple[float, tuple[float, ...]]]
    differing: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class TurnErrors:
    """The error of a drive as blocks of a page: over a cam turn, over the full cycle, and its greatest orders."""

    turn: Curve
    cycle: Curve
    orders: Lines


Tell = Callable[[object], None]


def is_any_hole(drive: Drive) -> bool:
    """Whether the direction that decides is not known: any hole may be the best one."""
    return bool(unknowns(drive) and unknown_turn(drive) and not no_hole_better(drive))


def drive_answers(drive: Drive, typical: Mapping[str, float], effort: Effort, tell: Tell) -> None:
    """F'_ior of a typical drive by a search, that over the seat, the answer of `check`, that of `mount`.

    Argument: typical, values by path of all that was not known exactly of a drive like it. Raises HdassistError where
    there is no answer.
    """
    if searchable(drive) and (typical or not unknowns(drive)):
        tell(FirstErrors(_searched((0.0,), with_typical(drive, typical))[:, 0].tolist()))
    if searchable(drive) and not unknowns(drive):
        rotations = tuple(seat_positions(drive))
        F_ior = _searched(rotations, drive)
        tell(SeatCurve(rotations, np.stack([F_ior] * 3), (SURE_REFINED,) * len(rotations)))
    with workers(effort.jobs) as executor:
        run = Run(executor, seed=SEED)
        _checked(drive, effort, run, tell)
        advice = advise(drive, drive.operation.M_g, seat_positions(drive), draws=effort.draws, run=run)
    if advice.positions or not advice.any_hole:
        tell(_mount_curve(advice))
    tell(mount_report(advice, SEED))
    tell(advice)


def typical_of(found: DesignCheck) -> tuple[Mapping[str, float], Sequence[float]]:
    """Values by path of the sample nearest to the median, and its F'_ior at each torque [arcsec]."""
    if not (samples := found.samples):
        return {}, [point.error.F_ior_arcsec for point in found.points]
    errors = samples.F_ior_arcsec[:, found.least_sure]
    near = np.argmin(np.abs(errors - samples.percentile(MIDDLE_SHARE, found.least_sure)))
    return samples.prior.values(samples.shares[[near]])[0], samples.F_ior_arcsec[near].tolist()


def with_typical(drive: Drive, typical: Mapping[str, float]) -> Drive:
    """The drive with typical values of what is not known exactly of it."""
    open_ = {each.path for each in prior_of(drive).fields}
    return drive.with_values({path: value for path, value in typical.items() if path in open_})


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


def cam_turn(drive: Drive, typical: Mapping[str, float], rotation_deg: float, M_g: float, tell: Tell) -> None:
    """The errors of a typical drive with its fixed wheel turned, as `trace` has them.

    Raises HdassistError where there is no answer.
    """
    there = rotated(drive.with_values(dict(typical)), rotation_deg)
    of_turn, cycle = trace(there, M_g=M_g, run=UNCHECKED), kinematic_error(there, M_g, run=UNCHECKED)
    turn, full = (
        curve_of_turns(error.states.phi_h / (2 * np.pi), error.error_arcsec, f"error at {M_g:g} N·m, ″")
        for error in (of_turn.error, cycle)
    )
    orders = sorted(of_turn.orders, key=lambda order: -order.amplitude_arcsec)[:ORDERS]
    lines = (f"{o.per_cam_rev:5.2f} {o.amplitude_arcsec:7.2f}  {o.cause.split(';')[0]}" for o in orders)
    tell(TurnErrors(turn, full, Lines("orders of the cam turn, ″", tuple(lines))))


def lever_effects(drive: Drive, pinned: Drive, typical: Mapping[str, float], effort: Effort, tell: Tell) -> None:
    """What a plausible step of each field does to F'_ior of a typical drive, by a search.

    A step of a field that is not known exactly goes about one standard deviation far, one of a field in which a pinned
    drive differs to its value. Raises HdassistError where the typical drive has no answer.
    """
    here = with_typical(drive, typical)
    if not searchable(here):
        return
    now = _searched((0.0,), here)[:, 0]
    found = LeverEffects({}, tuple(differing_fields((drive, pinned))))
    steps = _steps(drive, here, {path: pinned.value(path) for path in found.differing})
    with workers(effort.jobs) as executor:
        for path, step, there in executor.map(partial(_stepped_errors, here), steps):
            if there is not None:
                found = replace(found, steps={**found.steps, path: (step, tuple((there - now).tolist()))})
            if len(found.steps) % 8 == 0:
                tell(found)
    tell(found)


def _steps(drive: Drive, here: Drive, others: Mapping[str, Any]) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Plausible steps of the fields of a typical drive, in order of preference.

    Arguments: drive, with its ranges; here, the typical one; others, values where a pinned one differs.
    """
    priors = {each.path: each for each in prior_of(drive).fields}
    for path, info in field_table().items():
        value, is_setting = here.value(path), path.split(".")[0] in SETTING_SECTIONS
        if kind_of(info) not in ("number", "count") or value is None:
            continue
        if others.get(path) is not None:
            yield path, (others[path] - value,)
        elif path in priors:
            low, high = priors[path].value(np.array([MIDDLE_SHARE - STEP, MIDDLE_SHARE + STEP]))
            step = float(f"{(high - low) / 2:.2g}")
            yield path, (step, -step)
        elif path == TEETH_FIELDS[0]:
            yield path, (here.gears.z_b - here.gears.z_g,)
        elif kind_of(info) == "number" and not is_setting:
            yield path, (step_of(info, value), -step_of(info, value))


def _stepped_errors(drive: Drive, steps: tuple[str, tuple[float, ...]]) -> tuple[str, float, Array | None]:
    """A field, the first of its steps that makes a drive, and F'_ior at each torque there, None without an answer."""
    path, sizes = steps
    together = TEETH_FIELDS if path in TEETH_FIELDS else [path]
    for by in sizes:
        moved = drive.with_values({each: drive.value(each) + by for each in together})
        if by and moved.allows(path, moved.number(path)) and first_conflict(moved) is None:
            with suppress(HdassistError):
                return path, by, _searched((0.0,), moved)[:, 0]
    return path, 0.0, None


def _searched(rotations_deg: tuple[float, ...], drive: Drive) -> Array:
    return errors_by_turn(drive, drive.operation.M_g, rotations_deg)[1]


def _statistics_curve(found: PositionStatistics) -> SeatCurve:
    rotations = tuple(sorted({0.0, *found.rotations_deg}))
    values = [
        [found.quantile(share, found.place(at)) for at in rotations]
        for share in (LOW_SHARE_SHOWN, MIDDLE_SHARE, HIGH_SHARE_SHOWN)
    ]
    return SeatCurve(rotations, np.swapaxes(values, 1, 2), (SURE_RANGE,) * len(rotations))


def _mount_curve(advice: Advice) -> SeatCurve:
    if advice.positions:
        return _statistics_curve(advice.positions)
    curve = advice.curve
    order = np.argsort(curve.rotation_deg)
    done = np.atleast_1d(curve.every_state[:, order].all(axis=0)).tolist()
    at_zero = f"{SURE_REFINED}, unknown as 0"
    sure = [at_zero if advice.unknown else SURE_PROVEN if each else SURE_REFINED for each in done]
    return SeatCurve(
        tuple(curve.rotation_deg[order].tolist()), np.stack([curve.F_ior_arcsec[:, order]] * 3), tuple(sure)
    )


def _checked(drive: Drive, effort: Effort, run: Run, tell: Tell) -> None:
    """The answer of `check`, and its page; told on the way: F'_ior of every state, then by the samples so far."""
    prior, torques = prior_of(drive), drive.operation.M_g
    if not prior.fields:
        found = run.map(partial(kinematic_error, drive, run=UNCHECKED), torques)
        tell(FirstErrors([error.F_ior_arcsec for error in found]))
    whole = check(drive, draws=0, run=run)
    if prior.fields and effort.draws and searchable(drive):

        def seen(samples: Samples) -> None:
            if samples.effective:
                tell(whole.with_samples(samples))

        left = [point.left_arcsec for point in whole.points]
        whole = whole.with_samples(drive_samples(prior, left, draws=effort.draws, run=run, seen=seen))
    tell(whole)
    tell(check_report(whole, SEED))
