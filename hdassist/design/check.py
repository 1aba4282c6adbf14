"""The design check of a drive: F'_ior, self error and verdict at each of its torques."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial, reduce
from operator import add
from typing import Any

from hdassist.error.cycle import KinematicError, cross_checked, kinematic_error
from hdassist.error.error_map import SEARCHED, extremes_of, searchable
from hdassist.error.rests_on import Effect, reached, rests_on
from hdassist.error.self_error import SelfError, self_error
from hdassist.error.sensitivity import Sensitivity, sensitivity
from hdassist.error.unknown_range import DRAWS, UnknownRange, drawn_range, uncertain_deviations, unknown_ranges
from hdassist.model.deviations import ToothDeviations
from hdassist.model.kinematics import Kinematics
from hdassist.model.unknown import Unknown, names, unknowns
from hdassist.model.wheels import MeasuredTeeth
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Certificate
from hdassist.solve.throughcvxpy import CROSS_SOLVER, CrossCheck, require_solver
from hdassist.verdict import Verdict, worst


@dataclass(frozen=True)
class Floating:
    """F'_ior [arcsec] of a drive whose cam aligns itself (supports.C_3 of 0), and the proof of it."""

    F_ior_arcsec: float
    certificate: Certificate


@dataclass(frozen=True)
class OperatingPoint:
    """What a drive does at one torque M_g [N*m], and the limit [arcsec] it is held against, if any.

    open_: whether some of its deviations are not known, which error takes as zero, or are uncertain; over, F'_ior over
    them, None where that cannot be had.
    """

    M_g: float
    error: KinematicError
    self_error: SelfError
    limit_arcsec: float | None
    sensitivity: Sensitivity | None = None
    open_: bool = False
    over: UnknownRange | None = None
    floating: Floating | None = None

    @property
    def F_ior_upper_arcsec(self) -> float:
        """F'_ior with the self error on top [arcsec]: the value held against the limit."""
        return self.error.F_ior_arcsec + self.self_error.range_arcsec

    @property
    def held_arcsec(self) -> tuple[float, float] | None:
        """What is held against the limit [arcsec]: F'_ior with the self error that 5 and 95 % of what it may be have.

        Both the same where all is known; None where what is not known cannot be drawn.
        """
        own = self.self_error.range_arcsec
        if self.over:
            return self.over.low + own, self.over.high + own
        return None if self.open_ else (self.F_ior_upper_arcsec, self.F_ior_upper_arcsec)

    @property
    def certificates(self) -> tuple[Certificate, ...]:
        """Certificates of all states that stand behind the point."""
        parts = (self.error, self.self_error, self.sensitivity, self.over, self.floating)
        return tuple(part.certificate for part in parts if part is not None)

    @property
    def verdict(self) -> Verdict:
        """PASS where the upper value is within the limit, else FAIL; NO_LIMIT without one.

        Where deviations are not known or uncertain, PASS if 95 % of what they may be passes, FAIL if 95 % fails, else
        INCONCLUSIVE.
        """
        if self.limit_arcsec is None:
            return Verdict.NO_LIMIT
        if not self.held_arcsec:
            return Verdict.INCONCLUSIVE
        low, high = self.held_arcsec
        if high <= self.limit_arcsec:
            return Verdict.PASS
        return Verdict.FAIL if low > self.limit_arcsec else Verdict.INCONCLUSIVE


@dataclass(frozen=True)
class DesignCheck:
    """Design check of a drive: one operating point per torque, in the order of the preset.

    measured: wheels in place of first harmonics; unknown: deviations that are not known; rests_on: assumptions that
    move F'_ior most.
    """

    drive: Drive
    points: tuple[OperatingPoint, ...]
    measured: MeasuredTeeth | None = None
    unknown: tuple[Unknown, ...] = ()
    rests_on: tuple[Effect, ...] = ()

    @property
    def kinematics(self) -> Kinematics:
        """Ratio and cycle of the drive."""
        return Kinematics.of(self.drive)

    @property
    def verdict(self) -> Verdict:
        """Worst verdict of the operating points."""
        return worst(point.verdict for point in self.points)

    @property
    def certificate(self) -> Certificate:
        """Worst residuals over all states of all torques, those of the self error included."""
        return reduce(add, (part for point in self.points for part in point.certificates))

    @property
    def cross_checks(self) -> tuple[CrossCheck, ...]:
        """Cross-check of each torque."""
        return tuple(p.error.cross_check for p in self.points if p.error.cross_check)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader should know beside the numbers."""
        rated = self.drive.operation.rated
        over = [p.M_g for p in self.points if rated is not None and abs(p.M_g) > rated]
        told = [f"{M_g:g} N*m is above the rated torque of {rated:g} N*m" for M_g in over]
        if self.unknown and not any(point.over for point in self.points):
            told.append(f"not known, and computed as 0: {names(self.unknown)}; there is no range over them")
        if left := [path for path, spread in self.drive.uncertainty.items() if spread and path not in self.uncertain]:
            told.append(f"the uncertainty of {', '.join(left)} is not in F'_ior")
        return (*self.drive.origin.warnings, *told)

    @property
    def uncertain(self) -> tuple[str, ...]:
        """Deviations whose uncertainty is in the ranges of F'_ior, by path."""
        return tuple(uncertain_deviations(self.drive)) if any(point.over for point in self.points) else ()


def estimate_states(drive: Drive, measured: MeasuredTeeth | None = None, draws: int = DRAWS) -> int:
    """Number of states that a check solves, for a progress bar."""
    drawn = draws if not measured and drawn_range(drive, draws) else 0
    searched = drawn * SEARCHED if searchable(drive) and not measured else 0
    return len(drive.operation.M_g) * (Kinematics.of(drive).cycle_states + drive.numerics.n_phase**2 + searched)


def check(
    drive: Drive,
    *,
    measured: MeasuredTeeth | None = None,
    solver: str | None = None,
    cross_check: str = CROSS_SOLVER,
    draws: int = DRAWS,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[int], None] | None = None,
) -> DesignCheck:
    """Check a drive at the torques of its preset.

    Arguments: measured, wheels in place of first harmonics, for which there are no sensitivities, and no ranges over
    what is unknown or assumed; solver, a name that cvxpy knows, to send each state through cvxpy instead of the engine;
    cross_check, the solver that solves the extremes and a sample drawn by seed again; draws, drives drawn from what is
    not known; executor, to spread the work over (any concurrent.futures executor; the numbers do not depend on it);
    progress, told how many states were solved.
    Raises UsageError for an unknown solver, UntrustedError where an answer cannot be trusted.
    """
    torques = drive.operation.M_g
    there, teeth = measured.in_drive(drive) if measured else (drive, None)
    told = None if executor else progress  # a process tells nothing before it is done
    run = executor.map if executor else map
    require_solver(cross_check)
    every = partial(kinematic_error, there, teeth=teeth, solver=solver, cross_check=None, progress=told)
    solved = []
    for error in run(every, torques):
        solved.append(error)
        if progress and executor:
            progress(len(error.states))
    # cvxpy takes a second to import: another solver looks at the extremes in one process, and the self error in another
    again: Callable[[], Any] = partial(_cross_checked, there, solved, teeth, cross_check, seed)
    own_error: Callable[[], Any] = partial(self_error, drive, torques, progress=told)
    errors, own = run(_run, [again, own_error])
    if progress and executor:
        progress(sum(part.certificate.states for part in own))
    unknown = unknowns(measured.without_harmonics(drive) if measured else drive)
    over: tuple[UnknownRange, ...] = ()
    effects: tuple[Effect, ...] = ()
    slopes: Sequence[Sensitivity | None] = [None] * len(torques)
    floating: Sequence[Floating | None] = [None] * len(torques)
    if searchable(drive) and not measured:
        if drive.number("supports.C_3"):
            end, found = reached(drive, "supports.C_3", 0.0, partial(extremes_of, torques=torques))
            if end == 0:
                floating = [Floating(each.first, each.certificate) for each in found]
        slopes = sensitivity(drive, errors)
        over = unknown_ranges(drive, torques, draws=draws, seed=seed, executor=executor, progress=progress)
        effects = rests_on(drive, torques, executor=executor, progress=progress)
    held = [drive.limit(M_g) for M_g in torques]
    open_ = [bool(unknown) or bool(over)] * len(torques)
    rows = zip(torques, errors, own, held, slopes, open_, over or [None] * len(torques), floating, strict=True)
    return DesignCheck(drive, tuple(OperatingPoint(*row) for row in rows), measured, unknown, effects)


def _run(job: Callable[[], Any]) -> Any:
    return job()


def _cross_checked(
    drive: Drive, errors: Sequence[KinematicError], teeth: ToothDeviations | None, solver: str, seed: int
) -> list[KinematicError]:
    return [cross_checked(drive, error, teeth, solver, seed=seed) for error in errors]
