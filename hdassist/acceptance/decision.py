"""The value of a limit, predicted or measured, and the decision on it.

Predictions are made at the preset's nominal values, and over its uncertain inputs with the samples of `hdassist
check`, so that both pages give the same probability that F'_ior meets a limit.

Measured values, guard rule (JCGM 106, ISO 14253-1): a value is accepted if it is within the limit by at least GUARD
standard uncertainties, which corresponds to a probability of conformity of 95 %. It is rejected if it is beyond the
limit by as much, and inconclusive between. The guard band also allows for spectral lines outside the orders, which
may add to the value in another cycle. An uncertainty that is not stated leaves the decision open. F'_ior of a
recording is accepted by the upper end of its model instead, which also holds with a probability of 95 %.

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

from hdassist.acceptance.limits import F_IOR, Extent, Limit, LimitText, torques_of
from hdassist.belief.evidence import evidence_of
from hdassist.belief.prior import beside_measured_teeth
from hdassist.belief.samples import EFFECTIVE_SAMPLES, Samples, SamplingEffort, deviation_sets, draw_samples
from hdassist.belief.statistics import Probability, weighted_quantile
from hdassist.design import DesignCheck, OperatingPoint
from hdassist.error.cycle import KinematicError, SelfError, kinematic_error, self_error
from hdassist.error.error_map import TABLE_SECTIONS, searchable
from hdassist.error.stiffness import Stiffness, stiffness
from hdassist.error.waves import EstimatedCycle, estimated_cycle, turn_range_arcsec
from hdassist.errors import GUARD, SURE, UsageError, Verdict
from hdassist.files import number_of, with_decimal_points
from hdassist.measuring.bench import SeenRange
from hdassist.measuring.fit import COVERAGE_FACTOR
from hdassist.measuring.full_cycle import LEAST_SHARE_OF_PASS
from hdassist.measuring.measure import SweepResult
from hdassist.measuring.orders import FullCycle, UncertaintySource, combined
from hdassist.model.deviations import MeasuredTeeth, unknowns
from hdassist.model.geometry import Array, Kinematics
from hdassist.preset.fields import Drive
from hdassist.preset.text import UnitError, is_spread, read_spread
from hdassist.run.kept import ClosedRecord
from hdassist.run.run import UNCHECKED, Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.loadcase import CrossCheck

_MAY_BE = "F'_ior of the full cycle may be up to {:.4g} (95 %)"
OF_TRAVEL = "predicted over the full mesh cycle: F'_ior over acceptance.travel may be smaller, and needs a recording"
_Basis = Literal["measured", "stated", "predicted"]
Rule = Literal["guard", "simple"]


@dataclass(frozen=True)
class _PredictedQuantities:
    """Errors over the full cycle and self errors of a drive by torque [N*m], and its stiffness.

    Empty where no limit needs them.
    """

    kinematics: Kinematics
    errors: dict[float, KinematicError | EstimatedCycle]
    self_errors: dict[float, SelfError]
    stiffness: tuple[Stiffness, ...]

    @property
    def parts(self) -> list[KinematicError | EstimatedCycle | SelfError | Stiffness]:
        """All of them, each with its certificate."""
        return [*self.errors.values(), *self.self_errors.values(), *self.stiffness]

    @property
    def certificate(self) -> Certificate:
        """Worst residuals over all states."""
        return sum((part.certificate for part in self.parts), EMPTY)

    def amplitude(self, M_g: float, order: float) -> float:
        """Amplitude [arcsec] of an order per cam turn over the full cycle at a torque [N*m].

        Raises UsageError: an order that is none of the cycle's, or beyond what its states resolve.
        """
        values, place = self.errors[M_g].error_arcsec, order_place(self.kinematics, order)
        return float(2 * np.abs(np.fft.rfft(values)[place]) / len(values))

    def value(self, limit: Limit) -> float:
        """Return the value that a limit is compared with, in its unit; NaN if it is not predicted."""
        predicted = PREDICTED.get(limit.code)
        return predicted(self, limit.M_g_Nm or 0.0, limit.per_cam_rev or 0.0) if predicted else float("nan")


# values of checks by their code, from quantities, torque [N*m] and order per cam turn (0 where the limit is for none)
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

    The fields give percentiles and the probability that the value meets its limit.
    probability_low, probability_high: Monte Carlo interval of this probability.
    few: whether there are fewer samples than a result needs.
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
        """Probability of meeting the limit, with its interval."""
        return Probability(self.probability, self.probability_low, self.probability_high, few=self.few)


@dataclass(frozen=True, kw_only=True)
class Predictions(DesignCheck):
    """Predicted values of a drive for its limits: a check at the torques of limits of F'_ior, and further quantities.

    quantities: at the preset's nominal values, with unknown deviations as 0.
    sure: probability of meeting a limit that PASS needs.
    """

    limits: tuple[Limit, ...]
    quantities: _PredictedQuantities
    sure: float = SURE

    @property
    def certificate(self) -> Certificate:
        """Worst residuals over all states."""
        return self.quantities.certificate + (self.samples.certificate if self.samples else EMPTY) + self.steps_proof

    @property
    def cross_checks(self) -> tuple[CrossCheck, ...]:
        """Cross-checks by another solver."""
        checks = (getattr(part, "cross_check", None) for part in self.quantities.parts)
        return tuple(filter(None, checks))

    def is_open(self, limit: Limit) -> bool:
        """Return whether an uncertain input moves the value of a limit. Deviations move the cycle only."""
        moves_cycle = "cycle" in limit.check.needs
        fields = self.prior.fields if self.prior else ()
        return any(moves_cycle or not field.path.startswith(TABLE_SECTIONS) for field in fields)

    @property
    def is_of_travel(self) -> bool:
        """Whether the drive turns through less than its full cycle, which is predicted: less may come."""
        kinematics = Kinematics.of(self.drive)
        return self.drive.acceptance.travel < 360 * kinematics.cycle_cam_revolutions / abs(kinematics.u)

    def belief(self, limit: Limit) -> Belief | None:
        """Return the distribution of the value of a limit; None if nothing moves it, or without samples."""
        if self.samples is None or not self.is_open(limit):
            return None

        def values(samples: Samples) -> Array:
            return samples.figures[limit.label]

        first = self.samples.of_ranges
        if limit.check is F_IOR:
            return self._error_belief(limit, self.samples)
        p5, p50, p95 = (weighted_quantile(values(first), first.weights, share) for share in (0.05, 0.5, 0.95))
        kept = self.samples.probability(lambda samples: limit.room(values(samples)) >= 0, self.sure)
        return Belief(p5, p50, p95, kept.value, kept.low, kept.high, kept.few)

    def _error_belief(self, limit: Limit, samples: Samples) -> Belief:
        """Return F'_ior with the self error on top over all that is not known exactly, as check states it."""
        M_g = limit.M_g_Nm or 0.0
        self_error = self.quantities.self_errors[M_g].range_arcsec
        torque = samples.torques.index(M_g)
        p5, p50, p95 = (samples.of_ranges.percentile(share, torque) + self_error for share in (0.05, 0.5, 0.95))
        met = samples.probability_of_sets(lambda F_ior: limit.room(F_ior[:, :, torque] + self_error) >= 0, self.sure)
        return Belief(
            p5,
            p50,
            p95,
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
    """Quantities that limits need, at the numbers of the preset; error_of gives the error over the cycle by torque."""
    cycles, own_at = torques_of(limits, "cycle"), torques_of(limits, "self error")
    twists = any("stiffness" in limit.check.needs for limit in limits)
    known = _PredictedQuantities(
        Kinematics.of(drive),
        dict(zip(cycles, run.map(error_of, cycles), strict=True)),
        dict(zip(own_at, self_error(drive, own_at, run=run.of_task) if own_at else (), strict=True)),
        (stiffness(drive, points=1, run=run.of_task),) if twists else (),
    )
    run.finished(known.certificate.states)
    return known


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

    limits: limits to predict values for.
    wheels: wheels with measured teeth instead of first harmonics; there are no samples for them.
    draws: minimum effective sample size of the uncertain inputs; 0 for none.
    sure: probability of meeting a limit that PASS needs.
    Raises UntrustedError if a result cannot be trusted, or the preset's catalogue contradicts its other values.
    """
    there, teeth = wheels.in_drive(drive) if wheels else (drive, None)
    known = quantities(drive, limits, partial(kinematic_error, there, teeth=teeth, run=run.of_task), run=run)
    without, prior = beside_measured_teeth(drive, wheels)
    unknown = unknowns(without) if known.errors else ()
    points = [
        OperatingPoint(
            M_g, known.self_errors[M_g], drive.limit(M_g), bool(prior.fields),
            error=cast(KinematicError, known.errors[M_g]), sure=sure,
        )
        for M_g in torques_of((limit for limit in limits if limit.check is F_IOR), "cycle")
    ]  # fmt: skip
    predictions = Predictions(
        drive, tuple(points), wheels, unknown, prior, limits=tuple(limits), quantities=known, sure=sure
    )
    open_ = [limit for limit in limits if predictions.is_open(limit)]
    if not (open_ and draws and searchable(drive) and not wheels):
        return predictions

    def enough(samples: Samples) -> bool:
        beliefs = map(predictions.with_samples(samples).belief, open_)
        return all(belief.kept.is_stable(sure) for belief in beliefs if belief)

    figured = tuple(limit for limit in open_ if limit.check is not F_IOR)
    samples = draw_samples(
        prior,
        tuple(dict.fromkeys([*drive.operation.M_g, *(point.M_g for point in points)])),  # those of check too
        evidence=evidence_of(drive),
        figures_of=partial(_figures, figured) if figured else None,
        figures_name=" ".join(f"{limit.check.code}@{limit.M_g_Nm}#{limit.per_cam_rev}" for limit in figured),
        enough=enough,
        effort=SamplingEffort.of(draws),
        run=run,
        sets=deviation_sets(drive),
    )
    return predictions.with_samples(samples)


def _figures(limits: tuple[Limit, ...], drive: Drive) -> tuple[dict[str, float], Certificate]:
    """Return values of a drive by the label of their limit, with the certificate of the solved states."""
    known = quantities(drive, limits, partial(estimated_cycle, drive), run=UNCHECKED)
    return {limit.label: known.value(limit) for limit in limits}, known.certificate


def order_place(kinematics: Kinematics, order: float) -> int:
    """Periods of an order per cam turn in the full cycle. Raises UsageError as amplitude does."""
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
    """The share of the full cycle that a recording covers, and what its model says about the full cycle.

    share: of the cycle, 0 to 1.
    interval: 95 % interval of F'_ior of the full cycle [arcsec], as `measure` gives it; None if the model does not
        hold.
    at_least: largest limit that F'_ior exceeds with a probability of 95 % [arcsec]; None as for the interval.
    at_most: smallest limit that F'_ior of the full cycle meets with a probability of 95 % [arcsec]; None if the share
        is too small to pass a drive, or if the model does not hold.
    record_next_deg: angles of the output between which a recording would narrow F'_ior most; None if not known.
    why_open: why there is no at_most; empty if there is one.
    """

    share: float
    at_most: float | None
    record_next_deg: tuple[float, float] | None
    why_open: str = ""
    interval: tuple[float, float] | None = None
    at_least: float | None = None

    @classmethod
    def of(cls, sweep: SweepResult, ratio: float) -> CoveredCycle:
        """Return what a direction of a measurement covers.

        sweep: the direction, with its full cycle.
        ratio: input revolutions per output revolution.
        """
        share = sweep.coverage.share if sweep.coverage else 0.0
        cycle = sweep.full_cycle
        if not isinstance(cycle, FullCycle):
            return cls(share=share, at_most=None, record_next_deg=None, why_open=cycle or "")
        first, last = cycle.record_next_rev or (0.0, 0.0)
        next_deg = (360 * first / ratio, 360 * last / ratio) if cycle.record_next_rev else None
        why = ""
        if cycle.at_most_arcsec is None:
            why = f"{100 * share:.3g} % of the cycle recorded, PASS needs {100 * LEAST_SHARE_OF_PASS:.3g} %"
        return cls(
            share=share,
            at_most=cycle.at_most_arcsec,
            record_next_deg=next_deg,
            why_open=why,
            interval=cycle.interval_arcsec,
            at_least=cycle.at_least_arcsec,
        )

    @property
    def advice(self) -> str:
        """The part of the cycle to record next, as a clause; empty if it is not known."""
        if self.record_next_deg is None:
            return ""
        return "; to narrow it, record the output from {:.0f} to {:.0f}°".format(*self.record_next_deg)


@dataclass(frozen=True)
class AcceptedValue(ClosedRecord):
    """A measured or predicted value with its uncertainty; unknown if made without arguments.

    value: in the unit of its check; the median if there is a distribution.
    expanded_uncertainty: with k = 2; None if the value is predicted.
    basis: how the value was obtained.
    extent: part of the cycle that the value stands for. It is the value of the whole cycle, a lower bound of it, the
    value of a part that does not hold for the whole, a prediction at the preset's nominal values although others are
    equally possible ("not known"), or no value at a torque between the recorded torques.
    rise: amount by which the value may be larger in another cycle.
    at_most: for a lower bound, the value that 95 of 100 drives with it do not exceed, by a plan of positions or by
    the model of a recording.
    unstated: sources of uncertainty without a statement.
    belief: distribution of a predicted value over the uncertain inputs.
    full_cycle: for F'_ior of a recording, the result of its model.
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
        """The value of predictions that a limit is for."""
        whole: Extent = "at most" if limit.check.of_trace and predictions.is_of_travel else "whole"
        if belief := predictions.belief(limit):
            return cls(belief.p50, None, "predicted", whole, belief=belief)
        extent = "not known" if predictions.is_open(limit) else whole
        return cls(predictions.quantities.value(limit), None, "predicted", extent)

    @classmethod
    def stated(cls, given: LimitText, limit: Limit) -> AcceptedValue:
        """The value that was measured otherwise, VALUE±U with U the expanded uncertainty, k = 2.

        Raises UsageError: it is none, has no uncertainty, or is below zero.
        """
        if not is_spread(given.text):
            number = given.text if isfinite(number_of(given.text)) else 28.1
            hint = f"state the expanded uncertainty (k = 2), for example {number}±1.2, or ±0 if there is none"
            raise UsageError(f"--value {given}: the uncertainty is missing", hint)
        try:
            value, expanded = read_spread(with_decimal_points(given.text), limit.check.unit)
        except UnitError as error:
            raise UsageError(f"--value {given}: {error.message}", error.hint) from None
        if value < 0:
            raise UsageError(
                f"--value {given}: {limit.label} cannot be below zero", "give its magnitude, without a sign"
            )
        if value == 0 and (limit.check is F_IOR or not expanded):
            words = f"--value {given}: {limit.label} must be above 0"
            raise UsageError(words, "omit the value if it was not measured")
        return cls(value, expanded, "stated", "whole")

    @classmethod
    def at_positions(cls, found: SeenRange, sources: Sequence[UncertaintySource]) -> AcceptedValue:
        """F'_ior by approached positions, which see a part of it; sources: of its uncertainty, stated or not."""
        unstated = tuple(source.name for source in sources if source.arcsec is None)
        expanded = hypot(found.expanded_arcsec, COVERAGE_FACTOR * combined(sources))
        if found.uncertainty_arcsec is None:
            extent: Extent = "at least" if found.expanded_arcsec else "scatter not known"
            return cls(found.arcsec, expanded, "measured", extent, unstated=unstated)
        greatest = found.estimates_arcsec[-1] if found.seen else None
        return cls(found.arcsec, expanded, "measured", "at least", unstated=unstated, at_most=greatest)

    @classmethod
    def between_torques(cls) -> AcceptedValue:
        """Return no value: the torque lies between those that were recorded, and the error may bend there."""
        return cls(extent="between torques")

    @classmethod
    def measured(cls, limit: Limit, sweep: SweepResult, cycle: CoveredCycle | None = None) -> AcceptedValue:
        """Return the value of one direction of a recording with its expanded uncertainty.

        The value is unknown if the direction does not determine it. cycle: coverage of the direction and the result
        of its model; None if the model does not hold.
        """
        read = MEASURED[limit.code](sweep, limit.per_cam_rev or 0.0) if limit.check.of_trace else None
        if read is None:
            return cls()
        value, uncertainty, rise = read
        unstated = tuple(source.name for source in sweep.sources if source.arcsec is None)
        extent = limit.check.of_part if sweep.is_bound else "whole"
        expanded = COVERAGE_FACTOR * uncertainty
        if cycle is None or limit.check is not F_IOR:
            return cls(value, expanded, "measured", extent, rise, unstated)
        at_most = cycle.at_most if sweep.is_bound else None
        return cls(value, expanded, "measured", extent, rise, unstated, at_most=at_most, full_cycle=cycle)


def _amplitude(sweep: SweepResult, order: float) -> tuple[float, float, float] | None:
    found = sweep.order_alone(order)
    return (found.amplitude_arcsec, found.uncertainty_arcsec, 0.0) if found else None


# values of checks by their code, from a direction of a trace and the order: with its standard uncertainty, and by how
# much lines off the orders may make it greater in another cycle; None where the trace does not have it
MEASURED: dict[str, Callable[[SweepResult, float], tuple[float, float, float] | None]] = {
    "F_IOR": lambda found, _: (found.F_ior_arcsec, found.uncertainty_arcsec, found.range.rise),
    "TURN_RANGE": lambda of, _: (of.revolution.value, of.revolution.uncertainty, of.revolution.rise),
    "ORDER": _amplitude,
}


@dataclass(frozen=True, kw_only=True)
class DecidedCheck(AcceptedValue, Limit):
    """A value and the limit with which it is compared, as the files of `hdassist accept` give them.

    guard: band on each side of the limit.
    limit_is: whether the limit is the largest or the smallest value allowed ("greatest", "least").
    margin: distance of the value from the limit, or of at_most if a lower bound is within it.
    reason: None if the verdict needs no explanation.
    """

    guard: float
    limit_is: Literal["greatest", "least"]
    margin: float | None
    unit: str
    verdict: Verdict
    reason: str | None = None


def decide(limit: Limit, held: AcceptedValue, rule: Rule, sure: float) -> DecidedCheck:
    """Decide on a value by a rule; sure: probability of meeting a limit that PASS of a prediction needs."""
    known = held.value is not None and held.basis != "predicted"
    held = replace(held, expanded_uncertainty=(held.expanded_uncertainty or 0.0) if known else None)
    guard = _guard_band(held) if rule == "guard" else 0.0
    room = margin = None if held.value is None else limit.room(held.value)
    verdict, reason = _verdict(held, room, guard, rule, sure)
    if held.at_most is not None and verdict is not Verdict.FAIL:
        margin = limit.room(held.at_most)
    return DecidedCheck(
        **vars(limit),
        **vars(held),
        guard=guard,
        limit_is="greatest" if limit.check.upper else "least",
        margin=margin,
        unit=limit.check.unit,
        verdict=verdict,
        reason=reason or None,
    )


def _guard_band(held: AcceptedValue) -> float:
    """Return the distance below a value at which a limit is exceeded with a probability of 95 %.

    The model of a recording states it; else it is a multiple of the standard uncertainty.
    """
    if held.full_cycle and held.full_cycle.at_least is not None and held.value is not None:
        return held.value - held.full_cycle.at_least
    return GUARD * (held.expanded_uncertainty or 0.0) / COVERAGE_FACTOR


def _below(held: AcceptedValue) -> float:
    """Return the distance of the lower end of the 95 % interval below a value."""
    if held.full_cycle and held.full_cycle.interval and held.value is not None:
        return held.value - held.full_cycle.interval[0]
    return held.expanded_uncertainty or 0.0


def _verdict(known: AcceptedValue, room: float | None, guard: float, rule: Rule, sure: float) -> tuple[Verdict, str]:
    """The verdict on a value by its room to the limit, and why where that is not plain."""
    if known.extent == "between torques":
        return Verdict.INCONCLUSIVE, "there is no recording at this torque, only at lower and higher torques"
    if room is None:
        return Verdict.INCONCLUSIVE, "neither the recording nor a reported value (--value) gives it"
    if belief := known.belief:
        verdict = belief.kept.verdict(sure)
        if verdict is Verdict.FAIL and known.extent == "at most":
            return Verdict.INCONCLUSIVE, OF_TRAVEL
        open_ = verdict is Verdict.INCONCLUSIVE
        return verdict, f"probability that the limit is met: {belief.kept.text(sure)}" * open_
    if known.extent == "not known":
        return Verdict.INCONCLUSIVE, "the uncertain inputs were not sampled"
    if known.extent == "scatter not known":
        return Verdict.INCONCLUSIVE, "each position was approached once, so scatter may increase the range"
    if known.extent == "part":
        return Verdict.INCONCLUSIVE, "the value covers only a part of the cycle"
    if room < -guard:
        if known.extent == "at most":
            return Verdict.INCONCLUSIVE, OF_TRAVEL
        within = known.extent == "at least" and room + _below(known) > 0
        return Verdict.FAIL, f"the estimate {known.value:.4g} is beyond the limit by its rule" * within
    strict = rule == "guard" and known.basis != "predicted"
    if known.extent == "at least":
        if why := _why_bound_is_open(known, room, guard):
            return Verdict.INCONCLUSIVE, why
    elif why := _why_within_guard(known, room, guard, strict=strict):
        return Verdict.INCONCLUSIVE, why
    if strict and known.unstated:
        names, options = ", ".join(known.unstated), ",".join(f"{name}=U" for name in known.unstated)
        words = f"no uncertainty is stated for {names}: --budget {options}, U in ″, 0 if a source adds nothing"
        return Verdict.INCONCLUSIVE, words
    return Verdict.PASS, ""


def _why_within_guard(known: AcceptedValue, room: float, guard: float, *, strict: bool) -> str:
    """Return why a value that is not beyond its limit does not pass; empty if it does.

    The upper end of the model of a recording takes the place of the guard band, where there is one: it contains what
    the orders of the fit leave out.

    room: that the value leaves to the limit.
    guard: guard band of the value.
    strict: whether the guard rule decides.
    """
    at_most = known.full_cycle.at_most if known.full_cycle else None
    if strict and at_most is not None:
        return _MAY_BE.format(at_most) if room < at_most - (known.value or 0.0) else ""
    rise = known.rise if strict else 0.0
    lines = f", with {rise:.3g} that spectral lines may add in another cycle" if rise else ""
    return f"within the guard band{lines}" if room - rise < guard else ""


def _why_bound_is_open(known: AcceptedValue, room: float, guard: float) -> str:
    """Return why a lower bound that is not beyond its limit does not pass; empty if its upper end meets the limit.

    room: that the value leaves to the limit.
    guard: guard band of the value.
    """
    cycle, at_most, value = known.full_cycle, known.at_most, known.value or 0.0
    if at_most is None:
        return f"a lower bound: {cycle.why_open + cycle.advice if cycle else 'only a part of the cycle was recorded'}"
    room_of_end = room - (at_most - value)
    if cycle is not None:  # its upper end contains the uncertainty
        return _MAY_BE.format(at_most) + cycle.advice if room_of_end < 0 else ""
    if room_of_end < guard * at_most / max(value, 1e-9):
        return f"a lower bound: the value may be up to {at_most:.4g}"
    return ""
