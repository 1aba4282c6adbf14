"""Predictions for an acceptance: at the preset's own numbers, and over the inputs that are not known exactly.

The samples are those of `hdassist check`: F'_ior has the same probability of keeping a limit on both pages.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from hdassist.acceptance.checks import F_IOR
from hdassist.acceptance.limits import Limit, torques_of
from hdassist.belief.evidence import evidence_of
from hdassist.belief.influence import Influence, influences
from hdassist.belief.prior import DrivePrior
from hdassist.belief.samples import EFFECTIVE_SAMPLES, Samples, SamplingEffort, draw_samples
from hdassist.belief.statistics import weighted_quantile
from hdassist.belief.steps import Step, steps_of
from hdassist.design.check import beside_measured_teeth
from hdassist.error.cycle import KinematicError, kinematic_error
from hdassist.error.error_map import SHORT_CYCLE, searchable
from hdassist.error.self_error import SelfError, self_error
from hdassist.error.stiffness import Stiffness, stiffness
from hdassist.error.table import TABLE_SECTIONS
from hdassist.error.waves import ErrorWaves
from hdassist.errors import UsageError
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics, pitch_locked_states
from hdassist.model.unknown import Unknown, unknowns
from hdassist.model.wheels import MeasuredTeeth
from hdassist.preset.fields import Drive
from hdassist.run.kept import ClosedRecord
from hdassist.run.run import UNCHECKED, Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.throughcvxpy import CrossCheck
from hdassist.verdict import SURE, is_settled


@dataclass(frozen=True)
class EstimatedCycle:
    """Error F_kpp [arcsec] of a drive in each state of its full cycle, up to a constant, shape (states,).

    turn_range_arcsec: the greatest range within one cam turn, from every state of the turn in which the estimate ranges
    most; certificate: of all states that were solved.
    """

    error_arcsec: Array
    turn_range_arcsec: float
    certificate: Certificate


def estimated_cycle(drive: Drive, M_g: float, *, short_cycle: int = SHORT_CYCLE) -> KinematicError | EstimatedCycle:
    """Error of a drive at a torque M_g [N*m] over its full cycle, read off its waves; of a short cycle every state.

    Argument: short_cycle, states of a cycle below which all are solved. Raises UsageError for rolling balls,
    UntrustedError where a state cannot be trusted.
    """
    kinematics = Kinematics.of(drive)
    states = kinematics.cycle_states
    if states < short_cycle:
        return kinematic_error(drive, M_g, run=UNCHECKED)
    torus = ErrorWaves(drive, M_g, UNCHECKED)
    periods = torus.k_g * (states // kinematics.z_g) + torus.k_b * (states // kinematics.z_b)  # of each wave in a cycle
    spectrum = np.zeros(states, dtype=complex)
    np.add.at(spectrum, periods % states, torus.waves([drive])[0])
    error = np.fft.fft(spectrum).real  # both wheels turn backwards in the cam's frame
    first = _turn_ranges(error, kinematics).argmax() - kinematics.teeth_fixed // 2
    turn = pitch_locked_states(kinematics, (first + np.arange(kinematics.teeth_fixed)) % states)
    worst = kinematic_error(drive, M_g, states=turn, run=UNCHECKED)
    return EstimatedCycle(error, worst.range_arcsec, torus.certificate + worst.certificate)


def turn_range_arcsec(error: KinematicError | EstimatedCycle) -> float:
    """Greatest range [arcsec] of an error over the full cycle within one cam turn."""
    if isinstance(error, EstimatedCycle):
        return error.turn_range_arcsec
    return float(_turn_ranges(error.error_arcsec, error.kinematics).max())


def _turn_ranges(error_arcsec: Array, kinematics: Kinematics) -> Array:
    """Range [arcsec] of an error over the full cycle within the cam turn around each state, shape (states,) each."""
    turn = kinematics.teeth_fixed
    extent = maximum_filter1d(error_arcsec, turn, mode="wrap") - minimum_filter1d(error_arcsec, turn, mode="wrap")
    return np.asarray(extent)


@dataclass(frozen=True)
class PredictedQuantities:
    """Errors over the full cycle and self errors of a drive by torque [N*m], and its stiffness.

    Empty where no limit needs them.
    """

    kinematics: Kinematics
    errors: dict[float, KinematicError | EstimatedCycle]
    self_errors: dict[float, SelfError]
    stiffness: tuple[Stiffness, ...]

    @property
    def _parts(self) -> Iterator[KinematicError | EstimatedCycle | SelfError | Stiffness]:
        return chain(self.errors.values(), self.self_errors.values(), self.stiffness)

    @property
    def certificate(self) -> Certificate:
        """Worst residuals over all states."""
        return sum((part.certificate for part in self._parts), EMPTY)

    @property
    def cross_checks(self) -> tuple[CrossCheck, ...]:
        """Cross-checks by another solver."""
        return tuple(filter(None, (getattr(part, "cross_check", None) for part in self._parts)))

    def F_ior(self, M_g: float) -> float:
        """F'_ior [arcsec] at a torque [N*m], with the self error on top."""
        return float(np.ptp(self.errors[M_g].error_arcsec)) + self.self_errors[M_g].range_arcsec

    def turn_range(self, M_g: float) -> float:
        """Greatest range [arcsec] of the error at a torque [N*m] within one cam turn of the full cycle."""
        return turn_range_arcsec(self.errors[M_g])

    def amplitude(self, M_g: float, order: float) -> float:
        """Amplitude [arcsec] of an order per cam turn over the full cycle at a torque [N*m].

        Raises UsageError: an order that is none of the cycle's, or beyond what its states resolve.
        """
        values, place = self.errors[M_g].error_arcsec, order_place(self.kinematics, order)
        return float(2 * np.abs(np.fft.rfft(values)[place]) / len(values))

    def value(self, limit: Limit) -> float:
        """Value that a limit is held against, in its unit; NaN of one that is not predicted."""
        predicted = limit.check.predicted
        return predicted(self, limit.M_g_Nm or 0.0, limit.per_cam_rev or 0.0) if predicted else float("nan")


@dataclass(frozen=True)
class Belief(ClosedRecord):
    """A value over all that is not known exactly, in its unit: percentiles, and the probability of keeping its limit.

    probability_low, probability_high: its Monte Carlo interval.
    """

    p5: float
    p50: float
    p95: float
    probability: float
    probability_low: float
    probability_high: float


@dataclass(frozen=True)
class Predictions:
    """Predicted values of a drive for its limits.

    quantities: at the preset's own numbers, unknown deviations as 0; unknown: these deviations; prior: all that is not
    known exactly; samples of it, None where none were drawn; sure, probability of keeping a limit that PASS needs;
    steps: what it would take to keep the limit of F'_ior that is least sure; steps_proof, of the states behind them.
    """

    limits: tuple[Limit, ...]
    quantities: PredictedQuantities
    unknown: tuple[Unknown, ...]
    prior: DrivePrior
    samples: Samples | None = None
    sure: float = SURE
    steps: tuple[Step, ...] = ()
    steps_proof: Certificate = EMPTY

    @property
    def certificate(self) -> Certificate:
        """Worst residuals over all states."""
        return self.quantities.certificate + (self.samples.certificate if self.samples else EMPTY) + self.steps_proof

    def with_steps(self, run: Run) -> Predictions:
        """The same with steps, where samples leave a limit of F'_ior that is not surely kept."""
        limit = self.least_sure
        if not (limit and self.samples and (kept := self.belief(limit)) and kept.probability < self.sure):
            return self
        torques, limits = self.samples.torques, {each.M_g_Nm: each.limit for each in self.limits if each.check is F_IOR}
        left = [limits[M] - self.quantities.self_errors[M].range_arcsec if M in limits else None for M in torques]
        steps, proof = steps_of(self.prior, self.samples, torques, torques.index(limit.M_g_Nm or 0.0), left, run)
        return replace(self, steps=steps, steps_proof=proof)

    @cached_property
    def least_sure(self) -> Limit | None:
        """The limit of F'_ior that is kept with the least probability; None where none was drawn."""
        held = ((limit, self.belief(limit)) for limit in self.limits if limit.check is F_IOR)
        odds = {limit: found.probability for limit, found in held if found}
        return min(odds, key=lambda limit: odds[limit], default=None)

    @cached_property
    def influences(self) -> tuple[Influence, ...]:
        """Shares of the variance of ln F'_ior at the torque that is least sure, by field, the largest first."""
        if self.least_sure is None or self.samples is None:
            return ()
        return influences(self.samples.of_ranges, self.samples.torques.index(self.least_sure.M_g_Nm or 0.0))

    def is_open(self, limit: Limit) -> bool:
        """Whether anything that is not known exactly moves the value of a limit: deviations move the cycle alone."""
        moves_cycle = "cycle" in limit.check.needs
        return any(moves_cycle or not each.path.startswith(TABLE_SECTIONS) for each in self.prior.fields)

    def belief(self, limit: Limit) -> Belief | None:
        """The value of a limit over all that is not known exactly; None where nothing moves it, or was not drawn."""
        if self.samples is None or not self.is_open(limit):
            return None

        def values(samples: Samples) -> Array:
            if limit.check is not F_IOR:
                return samples.figures[limit.label]
            M_g = limit.M_g_Nm or 0.0
            own = self.quantities.self_errors[M_g].range_arcsec  # on top of F'_ior
            return np.asarray(samples.F_ior_arcsec[:, samples.torques.index(M_g)] + own)

        first = self.samples.of_ranges
        p5, p50, p95 = (weighted_quantile(values(first), first.weights, share) for share in (0.05, 0.5, 0.95))
        kept = self.samples.probability(lambda samples: limit.room(values(samples)) >= 0, self.sure)
        return Belief(p5, p50, p95, kept.value, kept.low, kept.high)


def quantities(
    drive: Drive,
    limits: Sequence[Limit],
    error_of: Callable[[float], KinematicError | EstimatedCycle],
    *,
    run: Run = Run(),
) -> PredictedQuantities:
    """Quantities that limits need, at the numbers of the preset; error_of gives the error over the cycle by torque."""
    cycles, own_at = torques_of(limits, "cycle"), torques_of(limits, "self error")
    twists = any("stiffness" in limit.check.needs for limit in limits)
    errors = run.map(error_of, cycles)
    own = run.map(partial(self_error, drive, run=run.of_task), [own_at] * bool(own_at))
    twist = run.map(partial(stiffness, points=1, run=run.of_task), [drive] * twists)
    found = PredictedQuantities(
        Kinematics.of(drive),
        dict(zip(cycles, errors, strict=True)),
        dict(zip(own_at, next(own, []), strict=True)),
        tuple(twist),
    )
    run.finished(found.certificate.states)
    return found


def predict(
    drive: Drive,
    limits: Sequence[Limit],
    *,
    wheels: MeasuredTeeth | None = None,
    draws: int = EFFECTIVE_SAMPLES,
    sure: float = SURE,
    run: Run = Run(),
) -> Predictions:
    """Predict the quantities that limits need.

    Arguments: limits; wheels, with measured teeth in place of first harmonics, for which there are no samples;
    draws, effective samples of the unknown inputs at least, 0 for none; sure, probability of keeping a limit that PASS
    needs. Raises UntrustedError where an answer cannot be trusted, or the preset's catalogue contradicts its other
    values.
    """
    there, teeth = wheels.in_drive(drive) if wheels else (drive, None)
    known = quantities(drive, limits, partial(kinematic_error, there, teeth=teeth, run=run.of_task), run=run)
    without, prior = beside_measured_teeth(drive, wheels)
    unknown = unknowns(without) if known.errors else ()
    found = Predictions(tuple(limits), known, unknown, prior, sure=sure)
    open_ = [limit for limit in limits if found.is_open(limit)]
    if not (open_ and draws and searchable(drive) and not wheels):
        return found

    def enough(samples: Samples) -> bool:
        beliefs = (replace(found, samples=samples).belief(limit) for limit in open_)
        return all(is_settled(b.probability_low, b.probability_high, sure) for b in beliefs if b)

    figured = tuple(limit for limit in open_ if limit.check is not F_IOR)
    held = torques_of((limit for limit in open_ if limit.check is F_IOR), "cycle")
    samples = draw_samples(
        prior,
        tuple(dict.fromkeys([*drive.operation.M_g, *held])),  # those of check too
        evidence=evidence_of(drive),
        further=partial(_figures, figured) if figured else None,
        further_name=" ".join(f"{each.check.code}@{each.M_g_Nm}#{each.per_cam_rev}" for each in figured),
        enough=enough,
        effort=SamplingEffort.of(draws),
        run=run,
    )
    return replace(found, samples=samples)


def _figures(limits: tuple[Limit, ...], drive: Drive) -> tuple[dict[str, float], Certificate]:
    """Values of a drive, by the label of the limit that they are for, with their proof."""
    found = quantities(drive, limits, partial(estimated_cycle, drive), run=UNCHECKED)
    return {each.label: found.value(each) for each in limits}, found.certificate


def order_place(kinematics: Kinematics, order: float) -> int:
    """Periods of an order per cam turn in the full cycle. Raises UsageError as amplitude does."""
    turns = kinematics.cycle_cam_revolutions
    place = round(order * turns)
    if not 0 < place < kinematics.cycle_states / 2 or abs(place / turns - order) > 1e-6:
        raise UsageError(
            f"order {order:g} is none of the full cycle of {turns} cam turns", f"a multiple of 1/{turns}, such as 2"
        )
    return place
