"""Results of the explorer, computed in separate processes; `tell` receives each result as soon as it is available."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from hdassist.belief.draws import errors_by_turn, errors_now
from hdassist.belief.prior import prior_of
from hdassist.belief.samples import EFFECTIVE_SAMPLES
from hdassist.drive.error.cycle import kinematic_error
from hdassist.drive.error.error_map import error_maps, searchable
from hdassist.drive.error.waves import trace
from hdassist.drive.model.deviations import unknowns
from hdassist.drive.model.geometry import Array, Kinematics
from hdassist.drive.model.rules import first_conflict
from hdassist.drive.preset.fields import Drive, field_table
from hdassist.features.design import DesignCheck, check, check_states
from hdassist.features.mounting.advice import Advice, advice_states, advise, advise_after
from hdassist.features.mounting.positions import rotated, seat_positions
from hdassist.features.mounting.posterior import TrialSetup
from hdassist.features.preset_comparison import differing_fields
from hdassist.interface.explorer.state import SETTING_SECTIONS, TEETH_FIELDS, TRIALS, is_tried, key_step
from hdassist.interface.pages.check import check_report
from hdassist.interface.pages.curves import trace_report
from hdassist.interface.pages.mount import mount_report
from hdassist.run.errors import HdassistError
from hdassist.run.run import UNCHECKED, Run, workers

_TOLD_EVERY = 0.3  # time between two reports of the completed share [s]
_MOST_TOLD = 0.99  # largest reported share, because the total is an estimate
_FEWEST_SEEN = 8  # effective sample size below which no interim range is shown
_SEED = 0  # seed of samples and of states solved again, as in the commands
_SHARES_SHOWN = (0.05, 0.5, 0.95)  # percentiles of a range
SURE_REFINED = "REFINED"  # extremes found by a search
SURE_PROVEN = "PROVEN"  # every state solved
SURE_RANGE = "90 % RANGE"  # 5th to 95th percentile
_STEP = 0.34  # probability from the median to a step of an uncertain field, about one standard deviation


@dataclass(frozen=True)
class Effort:
    """Effort of the computation.

    draws: effective sample size of uncertain inputs.
    jobs: number of processes, 0 for one per core.
    """

    draws: int = EFFECTIVE_SAMPLES
    jobs: int = 0


FULL = Effort()


@dataclass(frozen=True, eq=False)
class SeatCurve:
    """F'_ior over rotations of the fixed wheel from its present position.

    rotations_deg: rotations [deg].
    F_ior_arcsec: 5th percentile, median and 95th percentile [arcsec], shape (3, torques, rotations); equal for a single
        value.
    sure: kind of verification at each rotation.
    """

    rotations_deg: tuple[float, ...]
    F_ior_arcsec: Array
    sure: tuple[str, ...]

    def surety(self, rotation_deg: float) -> str:
        """Return the kind of verification at a rotation; empty if it is not among the rotations."""
        place = self.place(rotation_deg)
        return "" if place is None else self.sure[place]

    def place(self, rotation_deg: float) -> int | None:
        """Return the index of a rotation; None if it is not among the rotations."""
        is_near = np.abs((np.array(self.rotations_deg) - rotation_deg + 180) % 360 - 180) < 1e-6
        return int(is_near.argmax()) if is_near.any() else None


@dataclass(frozen=True)
class FirstErrors:
    """F'_ior [arcsec] of a typical drive at each torque, and its kind of verification."""

    F_ior_arcsec: Sequence[float]
    sure: str = SURE_REFINED


@dataclass(frozen=True)
class LeverEffects:
    """Effects of plausible steps of fields on F'_ior.

    steps: by field, its step in its unit, and the change of F'_ior at each torque [arcsec].
    differing: fields in which the pinned drive differs, whose step leads to its value.
    is_whole: whether all effects are computed.
    """

    steps: Mapping[str, tuple[float, tuple[float, ...]]]
    differing: tuple[str, ...] = ()
    is_whole: bool = False


_Tell = Callable[[str, object], None]  # called with a field of `asking.Known` and its value


def drive_answers(
    drive: Drive,
    typical: Mapping[str, float],
    effort: Effort,
    tell: _Tell,
) -> None:
    """Report F'_ior of a typical drive and over the seat, and the results of `check` and `mount`.

    drive: the drive.
    typical: values by path of the uncertain inputs of a similar drive.
    effort: effort of the computation.
    tell: function that receives the results.
    Raises HdassistError if there is no result.
    """
    typical_drive = drive.with_values(typical)
    has_typical = bool(typical or not unknowns(drive))
    rotations = tuple(seat_positions(drive))
    tried = is_tried(drive)
    _tell_searched(drive, typical_drive if has_typical else None, rotations, tell)

    def seen(so_far: DesignCheck) -> None:
        if so_far.samples and so_far.samples.effective >= _FEWEST_SEEN:
            tell("check", so_far)

    states = check_states(drive, draws=effort.draws)
    states += advice_states(
        drive,
        0 if tried else len(rotations),
        draws=effort.draws,
        trials=tried,
    )
    with workers(effort.jobs) as executor:
        run = Run(executor, _Share(states, tell), _SEED)
        if has_typical:
            errors = run.map(
                partial(
                    kinematic_error,
                    typical_drive,
                    run=UNCHECKED,
                ),
                typical_drive.operation.M_g,
            )
            tell("first", FirstErrors([error.F_ior_arcsec for error in errors], SURE_PROVEN))
        checked = check(
            drive,
            draws=effort.draws,
            run=run,
            seen=seen,
        )
        tell("check", checked)
        tell("page", check_report(checked, _SEED))
        if tried:
            setup = TrialSetup(TRIALS.torque_of(drive.operation.M_g))
            advice = advise_after(
                drive,
                (),
                setup,
                draws=effort.draws,
                run=run,
            )
        else:
            advice = advise(
                drive,
                rotations,
                draws=effort.draws,
                run=run,
            )
    if advice.decision.is_sampled or not advice.unknown:
        tell("curve", _mount_curve(advice))
    tell("report", mount_report(advice, _SEED))
    tell("advice", advice)


def _tell_searched(
    drive: Drive,
    typical_drive: Drive | None,
    rotations: tuple[float, ...],
    tell: _Tell,
) -> None:
    """Report results of a quick search: F'_ior of a typical drive, and F'_ior over the seat if all inputs are known.

    drive: the drive.
    typical_drive: typical drive; None if it is not known.
    rotations: rotations of the fixed wheel [deg].
    tell: function that receives the results.
    """
    if not searchable(drive):
        return
    if typical_drive is not None:
        tell("first", FirstErrors(_searched((0.0,), typical_drive)[:, 0].tolist()))
    if not prior_of(drive).fields:  # otherwise medians follow, which are not comparable with nominal values
        F_ior = _searched(rotations, drive)
        sure = tuple(SURE_REFINED for _ in rotations)
        tell("curve", SeatCurve(rotations, np.stack([F_ior, F_ior, F_ior]), sure))


class _Share:
    """Progress callback that receives numbers of solved states and reports their share of a total at intervals."""

    def __init__(self, total: int, tell: _Tell) -> None:
        self._solved = 0
        self._total = total
        self._tell = tell
        self._next = 0.0

    def __call__(self, states: int) -> None:
        self._solved += states
        if (now_s := time.monotonic()) > self._next:
            self._next = now_s + _TOLD_EVERY
            self._tell("done", min(self._solved / self._total, _MOST_TOLD))


def typical_of(found: DesignCheck) -> tuple[Mapping[str, float], Sequence[float]]:
    """Return the values by path of the sample nearest to the median, and its F'_ior at each torque [arcsec]."""
    if not (samples := found.samples):
        return {}, [point.error.F_ior_arcsec for point in found.points if point.error]
    row = samples.middle_sample(found.governing)
    return samples.values(np.array([row]))[0], samples.F_ior_arcsec[row].tolist()


def still_typical(found: DesignCheck, drive: Drive) -> Mapping[str, float]:
    """Return the typical values of inputs that are also uncertain in another drive and have the same nominal value.

    found: check of the drive.
    drive: the other drive.
    """
    open_ = {field.path for field in prior_of(drive).fields if found.drive.value(field.path) == drive.value(field.path)}
    return {path: value for path, value in typical_of(found)[0].items() if path in open_}


def cam_turn(
    drive: Drive,
    typical: Mapping[str, float],
    rotation_deg: float,
    M_g: float,
    tell: _Tell,
) -> None:
    """Report the page of `trace` for a typical drive over its full cycle, with its fixed wheel turned.

    Raises HdassistError if there is no result.
    """
    rotated_drive = rotated(drive.with_values(typical), rotation_deg)
    turns = Kinematics.of(rotated_drive).cycle_cam_revolutions
    turn_trace = trace(rotated_drive, M_g, revolutions=turns, run=UNCHECKED)
    tell("turn", trace_report(rotated_drive, turn_trace, _SEED))


def lever_effects(
    drive: Drive,
    pinned: Drive,
    typical: Mapping[str, float],
    effort: Effort,
    tell: _Tell,
) -> None:
    """Report the effect of a plausible step of each field on F'_ior of a typical drive, from a search.

    The step of an uncertain field is about one standard deviation. The step of a field in which the pinned drive
    differs leads to its value.

    Raises HdassistError if there is no result for the typical drive.
    """
    typical_drive = drive.with_values(typical)
    if not searchable(typical_drive):
        return
    F_ior_now = _searched((0.0,), typical_drive)[:, 0]
    effects = LeverEffects({}, tuple(differing_fields((drive, pinned))))
    steps = _steps(drive, typical_drive, {path: pinned.value(path) for path in effects.differing})
    with workers(effort.jobs) as executor:
        for path, step, F_ior_changed in executor.map(partial(_stepped_errors, typical_drive), steps):
            if F_ior_changed is not None:
                effects = replace(
                    effects, steps={**effects.steps, path: (step, tuple((F_ior_changed - F_ior_now).tolist()))}
                )
            if len(effects.steps) % 8 == 0:
                tell("effects", effects)
    tell("effects", replace(effects, is_whole=True))


def _steps(
    drive: Drive,
    here: Drive,
    others: Mapping[str, Any],
) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Yield the plausible steps of the fields of a typical drive, in order of preference.

    drive: the drive with its ranges.
    here: the typical drive.
    others: values of the pinned drive where it differs.
    """
    priors = {field.path: field for field in prior_of(drive).fields}
    for path, field in field_table().items():
        value = here.value(path)
        is_setting = path.split(".")[0] in SETTING_SECTIONS
        if field.kind not in ("number", "count") or value is None:
            continue
        if others.get(path) is not None:
            yield path, (others[path] - value,)
        elif path in priors:
            low, high = priors[path].value(np.array([0.5 - _STEP, 0.5 + _STEP]))
            step = float(f"{(high - low) / 2:.2g}")
            yield path, (step, -step)
        elif path == TEETH_FIELDS[0]:
            yield path, (here.gears.z_b - here.gears.z_g,)
        elif field.kind == "number" and not is_setting:
            yield path, (key_step(field, value), -key_step(field, value))


def _stepped_errors(drive: Drive, steps: tuple[str, tuple[float, ...]]) -> tuple[str, float, Array | None]:
    """Return a field, its first step to a valid drive, and F'_ior [arcsec] after this step, shape (torques,).

    Without a result, the step is 0 and F'_ior is None.

    drive: the drive.
    steps: path of the field, and its steps in order of preference.
    """
    path, sizes = steps
    together = TEETH_FIELDS if path in TEETH_FIELDS else [path]
    for by in sizes:
        moved = drive.with_values({path: drive.value(path) + by for path in together})
        if by and moved.allows(path, moved.number(path)) and first_conflict(moved) is None:
            with suppress(HdassistError):
                return path, by, _searched((0.0,), moved)[:, 0]
    return path, 0.0, None


def _searched(rotations_deg: tuple[float, ...], drive: Drive) -> Array:
    torques = drive.operation.M_g
    maps = error_maps(drive, torques)
    return errors_by_turn(maps, drive, torques, errors_now(maps, drive, torques)[0].tolist(), rotations_deg)[0]


def _mount_curve(advice: Advice) -> SeatCurve:
    curve = advice.curve
    decision = advice.decision
    if not curve or decision.is_sampled:
        turns = tuple(sorted({0.0, *decision.rotations_deg}))
        places = [decision.place(turn) for turn in turns]
        ranges = [[decision.quantile(share, place) for place in places] for share in _SHARES_SHOWN]
        return SeatCurve(turns, np.swapaxes(ranges, 1, 2), tuple(SURE_RANGE for _ in turns))
    sure = tuple(
        SURE_PROVEN if is_every_state else SURE_REFINED
        for is_every_state in np.atleast_1d(curve.every_state.all(axis=0))
    )
    F_ior = curve.F_ior_arcsec
    return SeatCurve(tuple(curve.rotation_deg.tolist()), np.stack([F_ior, F_ior, F_ior]), sure)
