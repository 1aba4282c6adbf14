"""The design check of a drive: F'_ior, self error and verdict at each of its torques."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Self

import numpy as np

from hdassist.belief.evidence import evidence_of
from hdassist.belief.prior import DrivePrior, beside_measured_teeth, prior_of
from hdassist.belief.samples import EFFECTIVE_SAMPLES, ErrorBelief, Samples, drive_samples
from hdassist.belief.statistics import Probability
from hdassist.belief.steps import Influence, Step, influences, steps_of
from hdassist.error.cycle import KinematicError, SelfError, cross_checks_of, self_error, whole_error
from hdassist.error.error_map import searchable
from hdassist.error.extremes import DRAWN_STATES
from hdassist.model.deviations import MeasuredTeeth
from hdassist.model.kinematics import Kinematics
from hdassist.model.unknown import Unknown, unknowns
from hdassist.preset.fields import Drive
from hdassist.run.run import CROSS_SOLVER, Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.through_cvxpy import CrossCheck, require_solver
from hdassist.verdict import SURE, Verdict, worst


@dataclass(frozen=True)
class OperatingPoint:
    """The error of a drive at one torque M_g [N*m], and the limit [arcsec] it is held against, if any.

    open_: whether something is not known exactly; belief: F'_ior over all of that, None where it was not computed;
    error over the full cycle: of the drive, or where it is open of the sample whose F'_ior is nearest to the median (of
    the preset's own numbers with the unknown as 0, where no samples were drawn); None before it is computed; sure:
    probability of keeping the limit that PASS needs.
    """

    M_g: float
    self_error: SelfError
    limit_arcsec: float | None
    open_: bool = False
    belief: ErrorBelief | None = None
    error: KinematicError | None = None
    sure: float = SURE

    @property
    def F_ior_arcsec(self) -> float | None:
        """F'_ior [arcsec]: the median over the unknown inputs; None where they were not drawn."""
        if self.belief:
            return self.belief.p50
        return self.error.F_ior_arcsec if self.error and not self.open_ else None

    @property
    def F_ior_or_error(self) -> float:
        """The same, or where nothing was drawn that of the error as the preset has it, unknown as 0 [arcsec]."""
        as_given = self.error.F_ior_arcsec if self.error else np.nan
        return as_given if self.F_ior_arcsec is None else self.F_ior_arcsec

    @property
    def F_ior_upper_arcsec(self) -> float | None:
        """The same with the self error on top [arcsec]."""
        return None if self.F_ior_arcsec is None else self.F_ior_arcsec + self.self_error.range_arcsec

    @property
    def range_arcsec(self) -> tuple[float, float] | None:
        """5th and 95th percentile of F'_ior [arcsec].

        Both the same where all is known; None where it is not and was not drawn.
        """
        if self.belief:
            return self.belief.p5, self.belief.p95
        return None if self.F_ior_arcsec is None else (self.F_ior_arcsec, self.F_ior_arcsec)

    @property
    def held_arcsec(self) -> tuple[float, float] | None:
        """The same with the self error on top [arcsec]."""
        own, ends = self.self_error.range_arcsec, self.range_arcsec
        return ends and (ends[0] + own, ends[1] + own)

    @property
    def left_arcsec(self) -> float | None:
        """Limit less self error [arcsec], None without a limit."""
        return None if self.limit_arcsec is None else self.limit_arcsec - self.self_error.range_arcsec

    @property
    def probability(self) -> Probability | None:
        """Probability that F'_ior with the self error on top keeps the limit; None without a limit or samples."""
        left = self.left_arcsec
        if left is None or self.belief is None:
            return None
        return self.belief.samples.probability_within(left, self.belief.torque, self.sure)

    @property
    def verdict(self) -> Verdict:
        """Verdict on the probability of keeping the limit; where all is known, on the value; NO_LIMIT without one."""
        if self.limit_arcsec is None:
            return Verdict.NO_LIMIT
        if kept := self.probability:
            return kept.verdict(self.sure)
        if self.F_ior_upper_arcsec is None:
            return Verdict.INCONCLUSIVE
        return Verdict.PASS if self.F_ior_upper_arcsec <= self.limit_arcsec else Verdict.FAIL


@dataclass(frozen=True)
class DesignCheck:
    """Design check of a drive: one operating point per torque, in the order of the preset.

    measured: wheels in place of first harmonics; unknown: deviations that are not known; prior: all that is not known
    exactly; samples of it, None where none were drawn; steps: what it would take at the torque that is least sure, none
    where all limits are kept; steps_proof: of the states behind these.
    """

    drive: Drive
    points: tuple[OperatingPoint, ...]
    measured: MeasuredTeeth | None = None
    unknown: tuple[Unknown, ...] = ()
    prior: DrivePrior | None = None
    samples: Samples | None = None
    steps: tuple[Step, ...] = ()
    steps_proof: Certificate = EMPTY

    def with_samples(self, samples: Samples) -> Self:
        """The same with samples of all that is not known exactly."""
        beliefs = (ErrorBelief.of(samples, samples.torques.index(point.M_g)) for point in self.points)
        points = (replace(point, belief=belief) for point, belief in zip(self.points, beliefs, strict=True))
        return replace(self, points=tuple(points), samples=samples)

    def with_errors(self, errors: Sequence[KinematicError]) -> Self:
        """The same with the error over the full cycle at each torque."""
        points = (replace(point, error=error) for point, error in zip(self.points, errors, strict=True))
        return replace(self, points=tuple(points))

    def with_steps(self, run: Run) -> Self:
        """The same with what it would take at the torque that decides, where not all limits are surely kept."""
        known = self.samples or not (self.prior and self.prior.fields)
        if self.verdict is Verdict.PASS or self.measured or not (self.points and self.prior and known):
            return self
        left = {point.M_g: point.left_arcsec for point in self.points}
        torques = self.samples.torques if self.samples else tuple(left)
        place = torques.index(self.points[self.least_sure].M_g)
        steps, proof = steps_of(self.prior, self.samples, torques, place, [left.get(M_g) for M_g in torques], run)
        return replace(self, steps=steps, steps_proof=proof)

    @property
    def verdict(self) -> Verdict:
        """Worst verdict of the operating points."""
        return worst(point.verdict for point in self.points)

    @property
    def certificate(self) -> Certificate:
        """Worst residuals over all states of all torques, those of self error and samples included."""
        parts = [part for point in self.points for part in (point.error, point.self_error)]
        return sum((part.certificate for part in (*parts, self.samples) if part is not None), self.steps_proof)

    @property
    def cross_checks(self) -> tuple[CrossCheck, ...]:
        """Cross-check of each torque."""
        return tuple(p.error.cross_check for p in self.points if p.error and p.error.cross_check)

    @property
    def least_sure(self) -> int:
        """Place of the torque that decides: of those with the worst verdict that where the limit is kept least.

        Without a limit, and where all are kept, that where F'_ior is least known.
        """
        by_limit = self.verdict in (Verdict.FAIL, Verdict.INCONCLUSIVE)

        def doubt(k: int) -> float:
            """How far the limit is from being kept for sure; else the ratio of the ends of the range of F'_ior."""
            point = self.points[k]
            if by_limit and point.probability:
                return 1 - point.probability.value
            if by_limit and point.limit_arcsec and point.F_ior_upper_arcsec:
                return point.F_ior_upper_arcsec / point.limit_arcsec
            low, high = point.range_arcsec or (1.0, 1.0)
            return high / max(low, 1e-9)

        worst_ones = [k for k, point in enumerate(self.points) if point.verdict is self.verdict]
        return max(worst_ones, key=doubt, default=0)

    @cached_property
    def influences(self) -> tuple[Influence, ...]:
        """Shares of the variance of ln F'_ior at the torque that is least sure, by field, the largest first."""
        if not (self.samples and self.points):
            return ()
        return influences(self.samples.of_ranges, self.samples.torques.index(self.points[self.least_sure].M_g))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Remarks on the numbers."""
        rated = self.drive.operation.rated
        over = [p.M_g for p in self.points if rated is not None and abs(p.M_g) > rated]
        remarks = [f"{M_g:g} N*m is above the rated torque of {rated:g} N*m" for M_g in over]
        if self.prior and self.prior.fields and not self.samples:
            paths = [field.path for field in self.prior.fields]
            more = f" and {len(paths) - 4} more" if len(paths) > 4 else ""
            remarks.append(f"not known, and computed as given or 0: {', '.join(paths[:4])}{more}; no range over them")
        measured = any(figure.path.startswith("measured.") for figure in evidence_of(self.drive))
        if measured and self.prior and not self.prior.fields:
            remarks.append("nothing in the preset is open, so what was measured on the drive weighs nothing")
        return (*self.drive.origin.warnings, *remarks, *(self.samples.remarks if self.samples else ()))


def accuracy_words(accuracy: float | None, points: Sequence[OperatingPoint]) -> str:
    """F'_ior at the least load beside an accuracy [arcsec], measured without any; empty where none is given."""
    if accuracy is None:
        return ""
    point = min(points, key=lambda point: abs(point.M_g))
    compared = " to ".join(dict.fromkeys(f"{100 * end / accuracy:.0f}" for end in point.range_arcsec or ()))
    words = f"F'_ior at {point.M_g:g} N·m is {compared} % of it" if compared else "F'_ior is not known"
    return f"accuracy {accuracy:g}″ (no load); {words}"


def check_states(drive: Drive, measured: MeasuredTeeth | None = None, draws: int = EFFECTIVE_SAMPLES) -> int:
    """Number of states that a check solves, for a progress bar."""
    drawn = draws if not measured and searchable(drive) and prior_of(drive).fields else 0
    return len(drive.operation.M_g) * (
        Kinematics.of(drive).cycle_states + drive.numerics.n_phase**2 + drawn * DRAWN_STATES
    )


def check(
    drive: Drive,
    *,
    measured: MeasuredTeeth | None = None,
    solver: str | None = None,
    draws: int = EFFECTIVE_SAMPLES,
    samples: Samples | None = None,
    sure: float = SURE,
    run: Run = Run(),
    seen: Callable[[DesignCheck], None] | None = None,
) -> DesignCheck:
    """Check a drive at the torques of its preset.

    Arguments: measured, wheels in place of first harmonics, for which there are no samples;
    solver, a name that cvxpy knows, to send each state through cvxpy instead of the engine; draws, effective samples of
    what is not known at least, 0 for none; samples of the same drive, where they were drawn before; sure, probability
    of keeping a limit that PASS needs, and FAIL of not keeping it; seen, called with the check by the samples so far.
    Raises UsageError for an unknown solver, UntrustedError where an answer cannot be trusted, or the preset's catalogue
    contradicts its other values.
    """
    torques = drive.operation.M_g
    there, teeth = measured.in_drive(drive) if measured else (drive, None)
    require_solver(run.cross_check or CROSS_SOLVER)
    known, prior = beside_measured_teeth(drive, measured)
    rows = zip(torques, self_error(drive, torques, run=run), [drive.limit(M_g) for M_g in torques], strict=True)
    points = tuple(OperatingPoint(*row, open_=bool(prior.fields), sure=sure) for row in rows)
    checked = DesignCheck(drive, points, measured, unknowns(known), prior)
    left = [point.left_arcsec for point in points]
    sampled = searchable(drive) and not measured and bool(prior.fields)
    if sampled and draws and not samples:
        so_far = None if seen is None else lambda samples: seen(checked.with_samples(samples))
        samples = drive_samples(prior, left, draws=draws, sure=sure, run=run, seen=so_far)
    checked = checked.with_samples(samples) if samples else checked
    shown = [_middle(there, samples, k) if samples else there for k in range(len(torques))]
    errors = list[KinematicError]()
    for error in run.map(partial(whole_error, teeth=teeth, solver=solver, run=run.of_task), shown, torques):
        errors.append(error)
        run.finished(len(error.states))
    # another solver looks at the extremes while steps are taken
    solved = [(there, teeth, error.sampled(seed=run.seed)) for there, error in zip(shown, errors, strict=True)]
    checks = run.beside(cross_checks_of, solved, run.of_task)
    checked = checked.with_errors(errors).with_steps(run)
    return checked.with_errors([replace(e, cross_check=c) for e, c in zip(errors, checks.result(), strict=True)])


def _middle(drive: Drive, samples: Samples, torque: int) -> Drive:
    """The drive of the sample in the middle at a torque, by its place."""
    return drive.with_values(samples.values(np.array([samples.middle_sample(torque)]))[0])
