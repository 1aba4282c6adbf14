"""The value compared with a limit, predicted or measured, and the decision on it.

Predictions are made at the preset's nominal values, and over its uncertain inputs with the samples of `hdassist check`,
so that both commands give the same probability that F'_ior meets a limit.

Measured values, guard rule (JCGM 106, ISO 14253-1): a value is accepted if it is within the limit by at least GUARD
standard uncertainties, which corresponds to a probability of conformity of 95 %. It is rejected if it is beyond the
limit by at least this distance, and inconclusive in all other cases. The guard band also allows for spectral lines
outside the orders, which may increase the value in another cycle. If an uncertainty is not stated, the decision remains
open. For F'_ior of a recording, the upper end from its model replaces the guard band. This end, too, corresponds to a
probability of 95 %.

Simple rule: a value is accepted up to the limit.

Predicted values follow the rule of `hdassist check` under both rules: the probability of meeting the limit over all
uncertain inputs. A prediction is not a decision on conformity.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import hypot, isfinite
from typing import Literal, cast

import numpy as np

from hdassist.belief.evidence import evidence_of
from hdassist.belief.prior import DrivePrior, beside_measured_teeth
from hdassist.belief.samples import EFFECTIVE_SAMPLES, Samples, SamplingEffort, deviation_sets, draw_samples
from hdassist.belief.statistics import Probability, weighted_quantile
from hdassist.drive.error.cycle import KinematicError, SelfError, kinematic_error, self_error
from hdassist.drive.error.error_map import TABLE_SECTIONS, searchable
from hdassist.drive.error.stiffness import Stiffness, stiffness
from hdassist.drive.error.waves import EstimatedCycle, estimated_cycle, turn_range_arcsec
from hdassist.drive.model.deviations import MeasuredTeeth, unknowns
from hdassist.drive.model.geometry import Kinematics
from hdassist.drive.preset.fields import Drive
from hdassist.drive.preset.text import UnitError, is_spread, read_spread
from hdassist.drive.solve.answers import EMPTY, Certificate
from hdassist.drive.solve.loadcase import CrossCheck
from hdassist.features.acceptance.limits import F_IOR, Extent, Limit, LimitText, torques_of
from hdassist.features.design import DesignCheck, OperatingPoint
from hdassist.features.measuring.bench import SeenRange
from hdassist.features.measuring.fit import COVERAGE_FACTOR
from hdassist.features.measuring.full_cycle import LEAST_SHARE_OF_PASS
from hdassist.features.measuring.measure import DIRECTION_NAMES, SweepResult
from hdassist.features.measuring.orders import FullCycle, UncertaintySource, combined
from hdassist.run.errors import GUARD, SURE, UsageError, Verdict
from hdassist.run.files import number_of, with_decimal_points
from hdassist.run.kept import ClosedRecord
from hdassist.run.run import UNCHECKED, Run

_MAY_BE = "F'_ior over the full mesh cycle may be up to {:.4g}″ (one-sided 95 % bound)"
OF_TRAVEL = (
    "the prediction applies to the full mesh cycle; F'_ior over acceptance.travel may be smaller, and only a recording "
    "shows it"
)
_Basis = Literal["measured", "stated", "predicted"]
Rule = Literal["guard", "simple"]


@dataclass(frozen=True)
class _PredictedQuantities:
    """Errors over the full cycle and self errors of a drive by torque [N*m], and its stiffness.

    Quantities that no limit needs are empty.
    """

    kinematics: Kinematics
    errors: dict[float, KinematicError | EstimatedCycle]
    self_errors: dict[float, SelfError]
    stiffness: tuple[Stiffness, ...]

    @property
    def parts(self) -> list[KinematicError | EstimatedCycle | SelfError | Stiffness]:
        """The predicted quantities, each of which has a certificate."""
        return [*self.errors.values(), *self.self_errors.values(), *self.stiffness]

    @property
    def certificate(self) -> Certificate:
        """The largest residuals over all states."""
        return sum((part.certificate for part in self.parts), EMPTY)

    def amplitude(self, M_g: float, order: float) -> float:
        """Return the amplitude [arcsec] of an order per input revolution over the full cycle at a torque [N*m].

        Raises UsageError if the order does not exist in the cycle, or its states do not resolve it.
        """
        error_arcsec = self.errors[M_g].error_arcsec
        place = order_place(self.kinematics, order)
        return float(2 * np.abs(np.fft.rfft(error_arcsec)[place]) / len(error_arcsec))

    def value(self, limit: Limit) -> float:
        """Return the value compared with a limit, in its unit; NaN if it is not predicted."""
        predicted = PREDICTED.get(limit.code)
        return predicted(self, limit.M_g_Nm or 0.0, limit.per_cam_rev or 0.0) if predicted else float("nan")


# values of checks by code, as functions of the quantities, the torque [N*m] and the order per input revolution (0 if
# the limit has none)
PREDICTED: dict[str, Callable[[_PredictedQuantities, float, float], float]] = {
    "F_IOR": lambda of, M_g, _: float(np.ptp(of.errors[M_g].error_arcsec)) + of.self_errors[M_g].range_arcsec,
    "TURN_RANGE": lambda of, M_g, _: turn_range_arcsec(of.errors[M_g]),
    "SELF_ERROR": lambda of, M_g, _: of.self_errors[M_g].range_arcsec,
    "ORDER": lambda of, M_g, order: of.amplitude(M_g, order),
    "LOST_MOTION": lambda of, *_: of.stiffness[0].lost_motion_arcsec,
    **{f"K_{k}": lambda of, *_, k=k: of.stiffness[0].weaker(k) for k in (1, 2, 3)},
}


@dataclass(frozen=True)
class Belief(ClosedRecord):
    """Distribution of a value over all uncertain inputs, in its unit.

    p5, p50, p95: 5th, 50th and 95th percentile.
    probability: probability that the value meets its limit.
    probability_low, probability_high: Monte Carlo interval of this probability.
    few: whether there are fewer samples than a result requires.
    """

    p5: float
    p50: float
    p95: float
    probability: float
    probability_low: float
    probability_high: float
    few: bool = False

    @property
    def kept(self) -> Probability:
        """The probability of meeting the limit, with its interval."""
        return Probability(
            self.probability,
            self.probability_low,
            self.probability_high,
            few=self.few,
        )


@dataclass(frozen=True, kw_only=True)
class Predictions(DesignCheck):
    """Predicted values of a drive for its limits.

    They consist of a design check at the torques of the limits of F'_ior, and of further quantities.

    limits: limits for which values are predicted.
    quantities: quantities at the preset's nominal values, with unknown deviations set to 0.
    sure: probability of meeting a limit that PASS requires.
    """

    limits: tuple[Limit, ...]
    quantities: _PredictedQuantities
    sure: float = SURE

    @property
    def certificate(self) -> Certificate:
        """The largest residuals over all states."""
        return self.quantities.certificate + (self.samples.certificate if self.samples else EMPTY) + self.steps_proof

    @property
    def cross_checks(self) -> tuple[CrossCheck, ...]:
        """The cross-checks by another solver."""
        checks = (getattr(part, "cross_check", None) for part in self.quantities.parts)
        return tuple(filter(None, checks))

    def is_open(self, limit: Limit) -> bool:
        """Return whether an uncertain input affects the value compared with a limit.

        Deviations of the parts affect only values over the full cycle.
        """
        moves_cycle = "cycle" in limit.check.needs
        fields = self.prior.fields if self.prior else ()
        return any(moves_cycle or not field.path.startswith(TABLE_SECTIONS) for field in fields)

    @property
    def is_of_travel(self) -> bool:
        """Whether the drive's travel is less than the full cycle of the prediction, so that F'_ior may be smaller."""
        kinematics = Kinematics.of(self.drive)
        return self.drive.acceptance.travel < 360 * kinematics.cycle_cam_revolutions / abs(kinematics.u)

    def belief(self, limit: Limit) -> Belief | None:
        """Return the distribution of the value compared with a limit, or None.

        It is None if no uncertain input affects the value, or if there are no samples.
        """
        if self.samples is None or not self.is_open(limit):
            return None
        if limit.check is F_IOR:
            return self._error_belief(limit, self.samples)
        first = self.samples.of_ranges
        values = first.figures[limit.label]
        met = self.samples.probability(lambda stage: limit.room(stage.figures[limit.label]) >= 0, self.sure)
        return Belief(
            p5=weighted_quantile(values, first.weights, 0.05),
            p50=weighted_quantile(values, first.weights, 0.5),
            p95=weighted_quantile(values, first.weights, 0.95),
            probability=met.value,
            probability_low=met.low,
            probability_high=met.high,
            few=met.few,
        )

    def _error_belief(self, limit: Limit, samples: Samples) -> Belief:
        """Return the distribution of F'_ior plus the self error over the uncertain inputs, as in `hdassist check`."""
        M_g = limit.M_g_Nm or 0.0
        self_error = self.quantities.self_errors[M_g].range_arcsec
        torque = samples.torques.index(M_g)
        first = samples.of_ranges
        met = samples.probability_of_sets(lambda F_ior: limit.room(F_ior[:, :, torque] + self_error) >= 0, self.sure)
        return Belief(
            p5=first.percentile(0.05, torque) + self_error,
            p50=first.percentile(0.5, torque) + self_error,
            p95=first.percentile(0.95, torque) + self_error,
            probability=met.value,
            probability_low=met.low,
            probability_high=met.high,
            few=met.few,
        )


def quantities(
    drive: Drive,
    limits: Sequence[Limit],
    error_of: Callable[[float], KinematicError | EstimatedCycle],
    *,
    run: Run = Run(),
) -> _PredictedQuantities:
    """Return the quantities required for limits, at the nominal values of the preset.

    drive: the drive.
    limits: limits whose values are required.
    error_of: function that returns the error over the cycle at a torque [N*m].
    run: the run.
    """
    cycle_torques = torques_of(limits, "cycle")
    self_error_torques = torques_of(limits, "self error")
    errors = dict(
        zip(
            cycle_torques,
            run.map(error_of, cycle_torques),
            strict=True,
        )
    )
    self_errors: dict[float, SelfError] = {}
    if self_error_torques:
        answers = self_error(drive, self_error_torques, run=run.of_task)
        self_errors = dict(zip(self_error_torques, answers, strict=True))
    has_stiffness = any("stiffness" in limit.check.needs for limit in limits)
    predicted = _PredictedQuantities(
        kinematics=Kinematics.of(drive),
        errors=errors,
        self_errors=self_errors,
        stiffness=(stiffness(drive, points=1, run=run.of_task),) if has_stiffness else (),
    )
    run.finished(predicted.certificate.states)
    return predicted


def predict(
    drive: Drive,
    limits: Sequence[Limit],
    *,
    wheels: MeasuredTeeth | None = None,
    draws: int = EFFECTIVE_SAMPLES,
    sure: float = SURE,
    run: Run = Run(),
) -> Predictions:
    """Return predictions of the quantities required for limits.

    drive: the drive.
    limits: limits for which values are predicted.
    wheels: wheels with measured teeth instead of first harmonics; for them there are no samples.
    draws: minimum effective sample size of the uncertain inputs; 0 for no samples.
    sure: probability of meeting a limit that PASS requires.
    run: the run.
    Raises UntrustedError if a result is not reliable, or the preset's catalogue contradicts its other values.
    """
    with_teeth, teeth = wheels.in_drive(drive) if wheels else (drive, None)
    error_of = partial(
        kinematic_error,
        with_teeth,
        teeth=teeth,
        run=run.of_task,
    )
    at_nominal = quantities(drive, limits, error_of, run=run)
    bare, prior = beside_measured_teeth(drive, wheels)
    predictions = Predictions(
        drive=drive,
        points=tuple(
            OperatingPoint(
                M_g=M_g,
                self_error=at_nominal.self_errors[M_g],
                limit_arcsec=drive.limit(M_g),
                open_=bool(prior.fields),
                error=cast(KinematicError, at_nominal.errors[M_g]),
                sure=sure,
            )
            for M_g in torques_of((limit for limit in limits if limit.check is F_IOR), "cycle")
        ),
        measured=wheels,
        unknown=unknowns(bare) if at_nominal.errors else (),
        prior=prior,
        limits=tuple(limits),
        quantities=at_nominal,
        sure=sure,
    )
    open_limits = [limit for limit in limits if predictions.is_open(limit)]
    if not (open_limits and draws and searchable(drive) and not wheels):
        return predictions
    return predictions.with_samples(_samples(predictions, prior, open_limits, draws, run))


def _samples(
    predictions: Predictions,
    prior: DrivePrior,
    open_limits: Sequence[Limit],
    draws: int,
    run: Run,
) -> Samples:
    """Return samples of a drive that settle the verdict on each limit whose value depends on uncertain inputs.

    predictions: predictions at nominal values.
    prior: prior of the drive.
    open_limits: limits whose value depends on an uncertain input.
    draws: minimum effective sample size.
    run: the run.
    Raises UntrustedError if too few samples agree with the preset's catalogue.
    """
    drive = predictions.drive

    def enough(samples: Samples) -> bool:
        beliefs = map(predictions.with_samples(samples).belief, open_limits)
        return all(belief.kept.is_stable(predictions.sure) for belief in beliefs if belief)

    figured = tuple(limit for limit in open_limits if limit.check is not F_IOR)
    torques = [*drive.operation.M_g, *(point.M_g for point in predictions.points)]
    return draw_samples(
        prior,
        # the torques of `hdassist check` are included, so that both commands use the same draws
        tuple(dict.fromkeys(torques)),
        evidence=evidence_of(drive),
        figures_of=partial(_figures, figured) if figured else None,
        figures_name=" ".join(f"{limit.check.code}@{limit.M_g_Nm}#{limit.per_cam_rev}" for limit in figured),
        enough=enough,
        effort=SamplingEffort.of(draws),
        run=run,
        sets=deviation_sets(drive),
    )


def _figures(limits: tuple[Limit, ...], drive: Drive) -> tuple[dict[str, float], Certificate]:
    """Return the values of a drive for limits, by label of the limit, and the certificate of the solved states."""
    predicted = quantities(
        drive,
        limits,
        partial(estimated_cycle, drive),
        run=UNCHECKED,
    )
    return {limit.label: predicted.value(limit) for limit in limits}, predicted.certificate


def order_place(kinematics: Kinematics, order: float) -> int:
    """Return the number of periods of an order per input revolution in the full cycle.

    Raises UsageError if the order does not exist in the cycle, or its states do not resolve it.
    """
    turns = kinematics.cycle_cam_revolutions
    place = round(order * turns)
    if not 0 < place < kinematics.cycle_states / 2 or abs(place / turns - order) > 1e-6:
        raise UsageError(
            f"order {order:g} does not exist in the full mesh cycle of {turns} input revolutions",
            f"use a multiple of 1/{turns}, for example 2",
        )
    return place


@dataclass(frozen=True)
class CoveredCycle(ClosedRecord):
    """The share of the full cycle that a recording covers, and the result of its model for the full cycle.

    share: covered share of the cycle, 0 to 1.
    at_most: smallest limit that F'_ior of the full cycle meets with a probability of 95 % [arcsec]; None if the share
    is too small to pass a drive, or the model does not apply.
    record_next_deg: range of output angles whose recording would narrow the interval of F'_ior most; None if unknown.
    why_open: reason why at_most is None; empty if it is a number.
    interval: 95 % interval of F'_ior of the full cycle [arcsec], as given by `measure`; None if the model does not
    apply.
    at_least: largest limit that F'_ior exceeds with a probability of 95 % [arcsec]; None if the model does not apply.
    record_direction: direction to record next, "increasing" or "decreasing" input angle; empty if only one direction
    was recorded.
    """

    share: float
    at_most: float | None
    record_next_deg: tuple[float, float] | None
    why_open: str = ""
    interval: tuple[float, float] | None = None
    at_least: float | None = None
    record_direction: str = ""

    @classmethod
    def of(
        cls,
        sweep: SweepResult,
        ratio: float,
        *,
        is_one_of_two: bool = False,
    ) -> CoveredCycle:
        """Return the coverage of a direction of a measurement.

        sweep: direction with its full cycle.
        ratio: input revolutions per output revolution.
        is_one_of_two: whether the measurement has two directions.
        """
        share = sweep.coverage.share if sweep.coverage else 0.0
        cycle = sweep.full_cycle
        if not isinstance(cycle, FullCycle):
            return cls(
                share=share,
                at_most=None,
                record_next_deg=None,
                why_open=cycle or "",
            )
        first, last = cycle.record_next_rev or (0.0, 0.0)
        next_deg = (360 * first / ratio, 360 * last / ratio) if cycle.record_next_rev else None
        why = ""
        if cycle.at_most_arcsec is None:
            why = f"{100 * share:.3g} % of the cycle was recorded, and PASS needs {100 * LEAST_SHARE_OF_PASS:.3g} %"
        return cls(
            share=share,
            at_most=cycle.at_most_arcsec,
            record_next_deg=next_deg,
            why_open=why,
            interval=cycle.interval_arcsec,
            at_least=cycle.at_least_arcsec,
            record_direction=DIRECTION_NAMES[sweep.direction] if is_one_of_two and next_deg else "",
        )

    @property
    def advice(self) -> str:
        """The part of the cycle to record next, as a clause; empty if it is unknown."""
        if self.record_next_deg is None:
            return ""
        if self.record_direction:
            return "; next, record output angles from {1:.0f} to {2:.0f}° with {0} input angle".format(
                self.record_direction, *self.record_next_deg
            )
        return "; next, record output angles from {:.0f} to {:.0f}°".format(*self.record_next_deg)


@dataclass(frozen=True)
class AcceptedValue(ClosedRecord):
    """A measured or predicted value with its uncertainty; an unknown value if created without arguments.

    value: value in the unit of its check; the median if there is a distribution.
    expanded_uncertainty: expanded uncertainty (k = 2); None if the value is predicted.
    basis: how the value was obtained.
    extent: scope of the value: the whole cycle, a lower or upper bound for it, a part that does not represent the
    whole, a range at positions whose scatter is unknown, a prediction at nominal values although uncertain inputs were
    not sampled ("not known"), or no value because the torque lies between the recorded torques.
    rise: amount by which the value may be larger in another cycle.
    unstated: sources whose uncertainty is not stated.
    belief: distribution of a predicted value over the uncertain inputs.
    at_most: for a lower bound, the value that F'_ior of the full cycle does not exceed with a probability of 95 %, from
    a plan of positions or from the model of a recording.
    full_cycle: result of the model, for F'_ior of a recording.
    """

    value: float | None = None
    expanded_uncertainty: float | None = None
    basis: _Basis | None = None
    extent: Extent | None = None
    rise: float = 0.0
    unstated: tuple[str, ...] = ()
    belief: Belief | None = None
    at_most: float | None = None
    full_cycle: CoveredCycle | None = None

    @classmethod
    def predicted(cls, limit: Limit, predictions: Predictions) -> AcceptedValue:
        """Return the predicted value compared with a limit."""
        extent: Extent = "at most" if limit.check.of_trace and predictions.is_of_travel else "whole"
        belief = predictions.belief(limit)
        if belief is not None:
            return cls(
                value=belief.p50,
                basis="predicted",
                extent=extent,
                belief=belief,
            )
        if predictions.is_open(limit):
            extent = "not known"
        return cls(
            value=predictions.quantities.value(limit),
            basis="predicted",
            extent=extent,
        )

    @classmethod
    def stated(cls, stated: LimitText, limit: Limit) -> AcceptedValue:
        """Return a reported value, VALUE±U with the expanded uncertainty U (k = 2).

        Raises UsageError if the text is not a value or has no uncertainty, if the value is negative, and if it is 0
        for F'_ior or with an uncertainty of 0.
        """
        option = f"--value {stated}"
        if not is_spread(stated.text):
            number = stated.text if isfinite(number_of(stated.text)) else 28.1
            hint = f"state the expanded uncertainty (k = 2), for example {number}±1.2, or ±0 if there is none"
            raise UsageError(f"{option}: the uncertainty is missing", hint)
        try:
            value, expanded = read_spread(with_decimal_points(stated.text), limit.check.unit)
        except UnitError as error:
            raise UsageError(f"{option}: {error.message}", error.hint) from None
        if value < 0:
            raise UsageError(f"{option}: {limit.label} cannot be below zero", "give its magnitude, without a sign")
        if value == 0 and (limit.check is F_IOR or not expanded):
            raise UsageError(f"{option}: {limit.label} must be above 0", "omit the value if it was not measured")
        return cls(
            value=value,
            expanded_uncertainty=expanded,
            basis="stated",
            extent="whole",
        )

    @classmethod
    def at_positions(cls, seen: SeenRange, sources: Sequence[UncertaintySource]) -> AcceptedValue:
        """Return F'_ior from approached positions, which capture only a part of it.

        seen: range at the positions.
        sources: further sources of its uncertainty; arcsec is None for those not stated.
        """
        accepted = cls(
            value=seen.arcsec,
            expanded_uncertainty=hypot(seen.expanded_arcsec, COVERAGE_FACTOR * combined(sources)),
            basis="measured",
            extent="at least",
            unstated=tuple(source.name for source in sources if source.arcsec is None),
        )
        if seen.uncertainty_arcsec is not None:
            return replace(accepted, at_most=seen.estimates_arcsec[-1] if seen.seen else None)
        return accepted if seen.expanded_arcsec else replace(accepted, extent="scatter not known")

    @classmethod
    def between_torques(cls) -> AcceptedValue:
        """Return an unknown value for a torque between the recorded ones, where linear interpolation may be wrong."""
        return cls(extent="between torques")

    @classmethod
    def measured(
        cls,
        limit: Limit,
        sweep: SweepResult,
        cycle: CoveredCycle | None = None,
    ) -> AcceptedValue:
        """Return the value for one direction of a recording with its expanded uncertainty.

        The value is unknown if the direction does not determine it.

        limit: limit compared with the value.
        sweep: the direction.
        cycle: coverage of the direction and result of its model; None if the model does not apply.
        """
        read = MEASURED[limit.code](sweep, limit.per_cam_rev or 0.0) if limit.check.of_trace else None
        if read is None:
            return cls()
        value, uncertainty, rise = read
        accepted = cls(
            value=value,
            expanded_uncertainty=COVERAGE_FACTOR * uncertainty,
            basis="measured",
            extent=limit.check.of_part if sweep.is_bound else "whole",
            rise=rise,
            unstated=tuple(source.name for source in sweep.sources if source.arcsec is None),
        )
        if cycle is None or limit.check is not F_IOR:
            return accepted
        return replace(
            accepted,
            at_most=cycle.at_most if sweep.is_bound else None,
            full_cycle=cycle,
        )


def _amplitude(sweep: SweepResult, order: float) -> tuple[float, float, float] | None:
    """Return the amplitude of an order [arcsec], its standard uncertainty, and a rise of 0; None if not fitted."""
    fitted = sweep.order_alone(order)
    return (fitted.amplitude_arcsec, fitted.uncertainty_arcsec, 0.0) if fitted else None


# values of checks by code, as functions of a direction and the order: the value, its standard uncertainty, and the
# possible increase by lines outside the orders in another cycle; None if the recording does not determine the value
MEASURED: dict[str, Callable[[SweepResult, float], tuple[float, float, float] | None]] = {
    "F_IOR": lambda sweep, _: (sweep.F_ior_arcsec, sweep.uncertainty_arcsec, sweep.range.rise),
    "TURN_RANGE": lambda sweep, _: (sweep.revolution.value, sweep.revolution.uncertainty, sweep.revolution.rise),
    "ORDER": _amplitude,
}


@dataclass(frozen=True, kw_only=True)
class DecidedCheck(AcceptedValue, Limit):
    """A value and the limit with which it is compared, as in the files of `hdassist accept`.

    guard: guard band on each side of the limit.
    limit_is: whether the limit is the largest or the smallest value allowed ("greatest", "least").
    margin: margin of the value to the limit; for a lower bound that does not fail, margin of at_most.
    unit: unit of the check.
    verdict: the verdict.
    reason: reason for the verdict, None if it needs none.
    """

    guard: float
    limit_is: Literal["greatest", "least"]
    margin: float | None
    unit: str
    verdict: Verdict
    reason: str | None = None


def decide(
    limit: Limit,
    accepted: AcceptedValue,
    rule: Rule,
    sure: float,
) -> DecidedCheck:
    """Return the decision on a value by a rule.

    limit: limit with which the value is compared.
    accepted: the value.
    rule: decision rule for measured values.
    sure: probability of meeting a limit that PASS of a prediction requires.
    """
    is_measured = accepted.value is not None and accepted.basis != "predicted"
    expanded = (accepted.expanded_uncertainty or 0.0) if is_measured else None
    accepted = replace(accepted, expanded_uncertainty=expanded)
    guard = _guard_band(accepted) if rule == "guard" else 0.0
    room = None if accepted.value is None else limit.room(accepted.value)
    verdict, reason = _verdict(accepted, room, guard, rule, sure)
    margin = room
    if accepted.at_most is not None and verdict is not Verdict.FAIL:
        margin = limit.room(accepted.at_most)
    return DecidedCheck(
        **vars(limit),
        **vars(accepted),
        guard=guard,
        limit_is="greatest" if limit.check.upper else "least",
        margin=margin,
        unit=limit.check.unit,
        verdict=verdict,
        reason=reason or None,
    )


def _guard_band(accepted: AcceptedValue) -> float:
    """Return the distance below a value at which a limit is exceeded with a probability of 95 %.

    The distance follows from the model of a recording. Without a model it is a multiple of the standard uncertainty.
    """
    if accepted.full_cycle and accepted.full_cycle.at_least is not None and accepted.value is not None:
        return accepted.value - accepted.full_cycle.at_least
    return GUARD * (accepted.expanded_uncertainty or 0.0) / COVERAGE_FACTOR


def _below(accepted: AcceptedValue) -> float:
    """Return the distance of the lower end of the 95 % interval below a value."""
    if accepted.full_cycle and accepted.full_cycle.interval and accepted.value is not None:
        return accepted.value - accepted.full_cycle.interval[0]
    return accepted.expanded_uncertainty or 0.0


# reasons why a value with one of these extents is inconclusive
_OPEN_EXTENTS: dict[Extent | None, str] = {
    "not known": "the uncertain inputs were not sampled",
    "scatter not known": "each position was approached only once, so scatter may have increased the range",
    "part": "the value was measured over only part of the cycle",
}


def _verdict(
    accepted: AcceptedValue,
    room: float | None,
    guard: float,
    rule: Rule,
    sure: float,
) -> tuple[Verdict, str]:
    """Return the verdict on a value, and the reason if the verdict needs one.

    accepted: the value.
    room: margin of the value to the limit; None if there is no value.
    guard: guard band of the value.
    rule: decision rule for measured values.
    sure: probability of meeting a limit that PASS of a prediction requires.
    """
    if accepted.extent == "between torques":
        return Verdict.INCONCLUSIVE, "there is no recording at this torque, only at lower and higher torques"
    if room is None:
        return Verdict.INCONCLUSIVE, "there is no value from a recording and no reported value (--value)"
    if accepted.belief:
        return _verdict_by_probability(accepted.belief, accepted.extent, sure)
    if accepted.extent in _OPEN_EXTENTS:
        return Verdict.INCONCLUSIVE, _OPEN_EXTENTS[accepted.extent]
    if room < -guard:
        return _verdict_beyond(accepted, room)
    is_strict = rule == "guard" and accepted.basis != "predicted"
    reason = _why_open(accepted, room, guard, is_strict=is_strict)
    return (Verdict.INCONCLUSIVE, reason) if reason else (Verdict.PASS, "")


def _verdict_by_probability(
    belief: Belief,
    extent: Extent | None,
    sure: float,
) -> tuple[Verdict, str]:
    """Return the verdict on a predicted value from its distribution, and the reason if the verdict needs one."""
    verdict = belief.kept.verdict(sure)
    if verdict is Verdict.FAIL and extent == "at most":
        return Verdict.INCONCLUSIVE, OF_TRAVEL
    if verdict is Verdict.INCONCLUSIVE:
        return verdict, f"probability that the limit is met: {belief.kept.text(sure)}"
    return verdict, ""


def _verdict_beyond(accepted: AcceptedValue, room: float) -> tuple[Verdict, str]:
    """Return the verdict on a value that exceeds its limit by the guard band, and the reason if it needs one."""
    if accepted.extent == "at most":
        return Verdict.INCONCLUSIVE, OF_TRAVEL
    if accepted.extent == "at least" and room + _below(accepted) > 0:
        # the rule rejects the value although the lower end of its interval is within the limit
        return (
            Verdict.FAIL,
            f"the decision rule of the test plan rejects the estimate, {accepted.value:.4g}″",
        )
    return Verdict.FAIL, ""


def _why_open(
    accepted: AcceptedValue,
    room: float,
    guard: float,
    *,
    is_strict: bool,
) -> str:
    """Return the reason why a value that is not beyond its limit does not pass; empty if it passes.

    accepted: the value.
    room: margin of the value to the limit.
    guard: guard band of the value.
    is_strict: whether the guard rule applies.
    """
    if accepted.extent == "at least":
        reason = _why_bound_is_open(accepted, room, guard)
    else:
        reason = _why_within_guard(accepted, room, guard, is_strict=is_strict)
    if reason or not (is_strict and accepted.unstated):
        return reason
    names = ", ".join(accepted.unstated)
    options = ",".join(f"{name}=U" for name in accepted.unstated)
    return (
        f"no standard uncertainty is stated for {names}: use --budget {options} (in ″; 0 for a source without effect)"
    )


def _why_within_guard(
    accepted: AcceptedValue,
    room: float,
    guard: float,
    *,
    is_strict: bool,
) -> str:
    """Return the reason why a value that is not beyond its limit does not pass; empty if it passes.

    The upper end of the model of a recording, if there is one, replaces the guard band, because it includes components
    that the fitted orders omit.

    accepted: the value.
    room: margin of the value to the limit.
    guard: guard band of the value.
    is_strict: whether the guard rule applies.
    """
    cycle = accepted.full_cycle
    at_most = cycle.at_most if cycle else None
    if is_strict and cycle and at_most is None:
        return cycle.why_open
    if is_strict and at_most is not None:
        return _MAY_BE.format(at_most) if room < at_most - (accepted.value or 0.0) else ""
    rise = accepted.rise if is_strict else 0.0
    is_within_guard_band = room - rise < guard
    if is_within_guard_band and rise:
        return f"within the guard band if spectral lines add up to {rise:.3g}″ in another cycle"
    return "within the guard band" if is_within_guard_band else ""


def _why_bound_is_open(
    accepted: AcceptedValue,
    room: float,
    guard: float,
) -> str:
    """Return the reason why a lower bound that is not beyond its limit does not pass; empty if it passes.

    accepted: the lower bound.
    room: margin of the value to the limit.
    guard: guard band of the value.
    """
    cycle = accepted.full_cycle
    at_most = accepted.at_most
    value = accepted.value or 0.0
    if at_most is None:
        why = cycle.why_open + cycle.advice if cycle else "only part of the cycle was recorded"
        return f"the measured range is a lower bound: {why}"
    room_of_end = room - (at_most - value)
    if cycle is not None:  # the upper end of the model includes the uncertainty
        return _MAY_BE.format(at_most) + cycle.advice if room_of_end < 0 else ""
    if room_of_end < guard * at_most / max(value, 1e-9):
        return f"the measured range is a lower bound: F'_ior over the full mesh cycle may be up to {at_most:.4g}″"
    return ""
