"""Values that the model predicts for the limits of a drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from hdassist.acceptance.checks import F_IOR, FROM_TRACES, SELF_ERROR, STIFFNESSES, TURN_RANGE
from hdassist.acceptance.decision import Asked, Known
from hdassist.error.cycle import KinematicError, kinematic_error
from hdassist.error.self_error import SelfError, self_error
from hdassist.error.stiffness import Stiffness, stiffness
from hdassist.error.stiffness import estimate_states as stiffness_states
from hdassist.errors import UsageError
from hdassist.model.kinematics import Kinematics
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate, Progress
from hdassist.solve.throughcvxpy import CrossCheck


@dataclass(frozen=True)
class Predictions:
    """What the model says of a drive: errors and self errors by torque [N*m], and its stiffness; empty if not asked."""

    errors: dict[float, KinematicError]
    self_errors: dict[float, SelfError]
    stiffness: Stiffness | None

    @property
    def certificate(self) -> Certificate:
        """Worst residuals over all states."""
        parts = [error.certificate for error in self.errors.values()]
        parts += [own.certificate for own in self.self_errors.values()]
        return sum(parts, self.stiffness.certificate if self.stiffness else EMPTY)

    @property
    def cross_checks(self) -> tuple[CrossCheck, ...]:
        """Cross-checks by another solver."""
        found = [part.cross_check for part in self.errors.values()]
        return tuple(c for c in [*found, self.stiffness.cross_check if self.stiffness else None] if c)

    def known(self, asked: Asked) -> Known:
        """The predicted value that a limit is for. Raises UsageError: a stiffness beyond the curve."""
        return Known(self._value(asked), 0.0, "predicted")

    def _value(self, asked: Asked) -> float:
        check, M_g = asked.check, asked.M_g
        if M_g is None:
            return self._of_twist(asked)
        if check == SELF_ERROR:
            return self.self_errors[M_g].range_arcsec
        error = self.errors[M_g]
        if check == F_IOR:
            return error.F_ior_arcsec + self.self_errors[M_g].range_arcsec
        return range_in_a_turn(error) if check == TURN_RANGE else amplitude(error, asked.order or 0.0)

    def _of_twist(self, asked: Asked) -> float:
        if self.stiffness is None:
            raise ValueError("the stiffness was not asked for")
        if asked.check not in STIFFNESSES:
            return self.stiffness.lost_motion_arcsec
        place = STIFFNESSES.index(asked.check)
        # the weaker side: the limit is the least
        return min(side[place].stiffness for side in (self.stiffness.positive, self.stiffness.negative))


def range_in_a_turn(error: KinematicError) -> float:
    """Greatest range [arcsec] of the error within one cam turn of the full cycle."""
    turn, values = error.kinematics.teeth_fixed, error.error_arcsec
    extent = maximum_filter1d(values, turn, mode="wrap") - minimum_filter1d(values, turn, mode="wrap")
    return float(extent.max())


def amplitude(error: KinematicError, order: float) -> float:
    """Amplitude [arcsec] of an order per cam turn over the full cycle.

    Raises UsageError: an order that is none of the cycle's, or beyond what its states resolve.
    """
    place, values = order_place(error.kinematics, order), error.error_arcsec
    return float(2 * np.abs(np.fft.rfft(values)[place]) / len(values))


def order_place(kinematics: Kinematics, order: float) -> int:
    """Periods of an order per cam turn in the full cycle. Raises UsageError as amplitude does."""
    turns = kinematics.cycle_cam_revolutions
    place = round(order * turns)
    if not 0 < place < kinematics.cycle_states / 2 or abs(place / turns - order) > 1e-6:
        raise UsageError(
            f"order {order:g} is none of the full cycle of {turns} cam turns", f"a multiple of 1/{turns}, such as 2"
        )
    return place


def work(drive: Drive, asked: Sequence[Asked]) -> int:
    """Number of states that predictions solve, for a progress bar."""
    cycles, own, twist = _needed(asked)
    cycle = Kinematics.of(drive).cycle_states
    return len(cycles) * cycle + len(own) * drive.numerics.n_phase**2 + (stiffness_states() if twist else 0)


def predict(
    drive: Drive,
    asked: Sequence[Asked],
    *,
    cross_check: str = "CLARABEL",
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Predictions:
    """Predict what the limits of a drive are for, and nothing else.

    Arguments: asked, the limits; executor, to spread the work over; the others and the errors as in kinematic_error.
    """
    cycles, own, twist = _needed(asked)
    told = None if executor else progress
    jobs: list[Callable[[], Any]] = [
        partial(kinematic_error, drive, M_g, cross_check=cross_check, seed=seed, progress=told) for M_g in cycles
    ]
    if own:
        jobs.append(partial(self_error, drive, own, progress=told))
    if twist:
        jobs.append(partial(stiffness, drive, cross_check=cross_check, progress=told))
    results = []
    for result in (executor.map if executor else map)(_run, jobs):
        results.append(result)
        if progress and executor:
            parts = result if isinstance(result, list) else [result]
            progress(sum(part.certificate.states for part in parts))
    errors = dict(zip(cycles, results, strict=False))
    self_errors = dict(zip(own, results[len(cycles)], strict=True)) if own else {}
    return Predictions(errors, self_errors, results[-1] if twist else None)


def _needed(asked: Sequence[Asked]) -> tuple[list[float], list[float], bool]:
    """Torques of which the full cycle is needed, those of which the self error is, and whether the stiffness is."""
    cycles = {a.M_g: None for a in asked if a.check in FROM_TRACES and a.M_g is not None}
    own = {a.M_g: None for a in asked if a.check in (F_IOR, SELF_ERROR) and a.M_g is not None}
    return list(cycles), list(own), any(a.M_g is None for a in asked)


def _run(job: Callable[[], Any]) -> Any:
    return job()
