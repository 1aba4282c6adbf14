"""What the model says of a drive for an acceptance: errors and self errors at torques, and its stiffness."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import partial
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from hdassist.error.cycle import KinematicError, kinematic_error
from hdassist.error.error_map import SEARCHED
from hdassist.error.rests_on import Effect, rests_on, weighed
from hdassist.error.self_error import SelfError, self_error
from hdassist.error.stiffness import Stiffness, stiffness
from hdassist.error.stiffness import estimate_states as stiffness_states
from hdassist.error.unknown_range import DRAWS, UnknownRange, drawn_range, unknown_ranges
from hdassist.errors import UsageError
from hdassist.model.kinematics import Kinematics
from hdassist.model.unknown import Unknown, unknowns
from hdassist.model.wheels import MeasuredTeeth
from hdassist.preset.fields import IDENTIFIED_WITH, Drive
from hdassist.preset.overrides import is_overridden
from hdassist.solve.answers import EMPTY, Certificate, Progress
from hdassist.solve.throughcvxpy import CROSS_SOLVER, CrossCheck

IDENTIFIED = (
    "supports.C_1", "supports.C_2", "supports.C_3", "contact.c_t", "contact.k_face", "contact.c_ball",
    "contact.c_bore", "gears.j_n", "bearing.g_b",
)  # fmt: skip
MODEL = tuple(f"numerics.{name}" for name in IDENTIFIED_WITH)


def is_calibrated(drive: Drive) -> bool:
    """Whether a stiffness or clearance of a drive was identified, on the model that it is used with."""
    changed = any(is_overridden(path, drive.origin.overrides) for path in IDENTIFIED + MODEL)
    return not changed and any(p in drive.source and drive.source[p].kind == "identified" for p in IDENTIFIED)


@dataclass(frozen=True)
class Needed:
    """What has to be predicted: torques [N*m] of full cycles and of self errors, and whether the stiffness."""

    cycles: tuple[float, ...] = ()
    self_errors: tuple[float, ...] = ()
    stiffness: bool = False

    def states(self, drive: Drive) -> int:
        """Number of states that this solves, for a progress bar."""
        states = len(self.cycles) * Kinematics.of(drive).cycle_states
        states += len(self.self_errors) * drive.numerics.n_phase**2
        if drawn_range(drive, DRAWS):
            states += len(self.cycles) * DRAWS * SEARCHED
        return states + (stiffness_states() if self.stiffness else 0)


@dataclass(frozen=True)
class Predictions:
    """What the model says of a drive: errors and self errors by torque [N*m], its stiffness; empty if not needed.

    window: the flank window [deg] in which it was computed; unknown: deviations that are not known, which errors take
    as 0; over: F'_ior over them and over deviations that have an uncertainty, by torque; spread: standard deviation of
    ln F'_ior over what is assumed of a drive that is not calibrated; rests_on: assumptions that move F'_ior most, at
    the torques of errors.
    """

    window: float
    errors: dict[float, KinematicError]
    self_errors: dict[float, SelfError]
    stiffness: Stiffness | None
    unknown: tuple[Unknown, ...] = ()
    over: dict[float, UnknownRange] = dataclass_field(default_factory=dict)
    spread: float | None = None
    rests_on: tuple[Effect, ...] = ()

    @property
    def certificate(self) -> Certificate:
        """Worst residuals over all states."""
        parts = [error.certificate for error in self.errors.values()]
        parts += [own.certificate for own in self.self_errors.values()]
        parts += [each.certificate for each in self.over.values()]
        return sum(parts, self.stiffness.certificate if self.stiffness else EMPTY)

    @property
    def cross_checks(self) -> tuple[CrossCheck, ...]:
        """Cross-checks by another solver."""
        found = [part.cross_check for part in self.errors.values()]
        return tuple(c for c in [*found, self.stiffness.cross_check if self.stiffness else None] if c)

    def turn_range(self, M_g: float) -> float:
        """Greatest range [arcsec] of the error at a torque [N*m] within one cam turn of the full cycle."""
        error = self.errors[M_g]
        turn, values = error.kinematics.teeth_fixed, error.error_arcsec
        extent = maximum_filter1d(values, turn, mode="wrap") - minimum_filter1d(values, turn, mode="wrap")
        return float(extent.max())

    def amplitude(self, M_g: float, order: float) -> float:
        """Amplitude [arcsec] of an order per cam turn over the full cycle at a torque [N*m].

        Raises UsageError: an order that is none of the cycle's, or beyond what its states resolve.
        """
        values = self.errors[M_g].error_arcsec
        place = order_place(self.errors[M_g].kinematics, order)
        return float(2 * np.abs(np.fft.rfft(values)[place]) / len(values))

    @property
    def twist(self) -> Stiffness:
        """The stiffness. Raises ValueError: it was not needed."""
        if self.stiffness is None:
            raise ValueError("the stiffness was not predicted")
        return self.stiffness


def predict(
    drive: Drive,
    needed: Needed,
    *,
    wheels: MeasuredTeeth | None = None,
    cross_check: str = CROSS_SOLVER,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Predictions:
    """Predict what is needed of a drive, and nothing else.

    Arguments: needed, torques [N*m] of cycles and self errors, and whether the stiffness is; wheels, with measured
    teeth in place of first harmonics, for which there are no ranges over what is unknown or assumed (the spread is that
    of the harmonics); cross_check, solver of some states again, and seed of their choice; executor, to spread the work
    over (the numbers do not depend on it); progress, told how many states were solved. Raises UntrustedError where an
    answer cannot be trusted.
    """
    told = None if executor else progress
    there, teeth = wheels.in_drive(drive) if wheels else (drive, None)
    error = partial(kinematic_error, there, teeth=teeth, cross_check=cross_check, seed=seed, progress=told)
    jobs: list[Callable[[], Any]] = [partial(error, M_g) for M_g in needed.cycles]
    if needed.self_errors:
        jobs.append(partial(self_error, drive, needed.self_errors, progress=told))
    if needed.stiffness:
        jobs.append(partial(stiffness, drive, cross_check=cross_check, progress=told))
    results = []
    for result in (executor.map if executor else map)(_run, jobs):
        results.append(result)
        if progress and executor:
            parts = result if isinstance(result, list) else [result]
            progress(sum(part.certificate.states for part in parts))
    errors = dict(zip(needed.cycles, results, strict=False))
    own = results[len(needed.cycles)] if needed.self_errors else []
    ranged = () if wheels else needed.cycles
    over = unknown_ranges(drive, ranged, seed=seed, executor=executor, progress=progress)
    known = weighed(drive, needed.cycles, executor=executor, progress=progress) if needed.cycles else None
    effects = rests_on(drive, ranged, known=known, executor=executor, progress=progress) if known and ranged else ()
    by_spread = known and drive.acceptance.margin is None and not is_calibrated(drive)
    return Predictions(
        drive.numerics.window,
        errors,
        dict(zip(needed.self_errors, own, strict=True)),
        results[-1] if needed.stiffness else None,
        unknowns(wheels.without_harmonics(drive) if wheels else drive) if needed.cycles else (),
        {each.M_g: each for each in over},
        known.spread if known and by_spread else None,
        effects,
    )


def _run(job: Callable[[], Any]) -> Any:
    return job()


def order_place(kinematics: Kinematics, order: float) -> int:
    """Periods of an order per cam turn in the full cycle. Raises UsageError as amplitude does."""
    turns = kinematics.cycle_cam_revolutions
    place = round(order * turns)
    if not 0 < place < kinematics.cycle_states / 2 or abs(place / turns - order) > 1e-6:
        raise UsageError(
            f"order {order:g} is none of the full cycle of {turns} cam turns", f"a multiple of 1/{turns}, such as 2"
        )
    return place
