"""F'_ior, orders and coverage of a measured recording for each direction, and the options for reading it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import hypot, isfinite, sqrt
from typing import Any

import numpy as np

from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import Drive
from hdassist.features.measuring.bench import LoopRecord, PositionRecord, bench_record
from hdassist.features.measuring.fit import COVERAGE_FACTOR, TraceFit, drift_of, fit_orders
from hdassist.features.measuring.orders import (
    BEATS,
    BETWEEN_TORQUES,
    DEFAULT_ORDERS,
    FULL_SHARE,
    SCATTER,
    STATED,
    USUAL_RATIO,
    WHOLE_TURN,
    WIND_UP,
    Coverage,
    CurveRanges,
    FullCycle,
    Gearing,
    MeasuredOrder,
    OtherUncertainties,
    Range,
    UncertaintySource,
    combined,
    gearing_of,
    image_change,
    order_grid,
    order_tables,
    other_ratio,
    parse_orders,
    parse_stated,
    ranges_of,
    resolution_source,
    slow_terms,
    stated_sources,
    visited_angles,
)
from hdassist.features.measuring.residuals import with_lines, with_step, without_spikes
from hdassist.features.measuring.shafts import Shaft, ShaftComponent, shaft_components
from hdassist.features.measuring.slopes import (
    EncoderLag,
    RecordedTorque,
    Reversal,
    at_torque,
    require_recorded,
    reversal_and_lag,
    speed_changes,
    tells_compliance,
    with_order_changes,
    without_lag,
)
from hdassist.features.measuring.terms import BINS_PER_COLUMN, Bins, SlowTerms, bins_of, curve_of, travel_of
from hdassist.readers.trace import BY_ORDER, MeasuredTrace, TraceForm, read_record, sweeps, trace_of
from hdassist.run.errors import DataError, Fault, HdassistError, UntrustedError, UsageError
from hdassist.run.files import number_of
from hdassist.run.kept import ClosedRecord

_DRIFTS = {"none": 0, "linear": 1, "quadratic": 2}
_SHORTEST_TURNS = 1.0  # input revolutions that one direction must cover
DIRECTION_NAMES = {1: "increasing", -1: "decreasing"}  # direction of the input angle
_STEPS_PER_PERIOD = 2.5  # smallest number of angle steps in a period of the highest order
DRIFT_LEFT = (
    "a linear drift of {:.3g}″ over the recording is not removed, because it may be a slow "
    "order; --drift linear removes it"
)
_DRIFT_OFF = (
    "the curve does not close over the cycle, so a linear drift of {:.3g}″ is removed. With the drift, the range would "
    "be {:.1f}″; check the ratio"
)
_WIND_UP_LEFT = (
    "the torque varies with the output angle, but the resulting wind-up is not removed: use --drive with a preset that "
    "contains catalogue.K_1 to K_3"
)
_CHANGES_LEFT = (
    "the recording does not show how the orders change with the torque, and this change may contribute to F'_ior: "
    "record a sweep at each torque"
)
_STRAIGHT = (
    "F'_ior at {:g} N·m is interpolated linearly between {:.3g} and {:.3g} N·m: the recording does not show whether "
    "the dependence on torque is linear"
)
_RECORDED_TORQUE = 0.1  # distance from a recorded torque that needs no interpolation, as a share of their range
_CYCLES_OF_RATIO = 1.2  # full cycles from which a recording shows whether its sidebands are those of the ratio
_BENT = 1 / 4  # largest deviation of a drift from a straight line, as a share of the drift
_COARSE_STEP = 1 / 4  # largest step of readings at even angles, as a share of F'_ior
_BOTH_WAYS = 2  # number of directions
_LAG_CLEAR = 3.0  # standard uncertainties that a lag must exceed before the angles are corrected for it
_UNMODELLED = 1 / 5  # smallest error beyond the orders that is reported, as a share of F'_ior


@dataclass(frozen=True)
class _TorqueRange:
    """F'_ior at a torque of a recording [N*m], with its standard uncertainty [arcsec]."""

    M_g_Nm: float
    F_ior_arcsec: float
    standard_uncertainty_arcsec: float

    @classmethod
    def of(cls, M_g: float, F_ior: Range) -> _TorqueRange:
        """Return F'_ior at a torque.

        M_g: torque [N*m].
        F_ior: range of the curve at this torque.
        """
        return cls(
            M_g_Nm=M_g,
            F_ior_arcsec=F_ior.value,
            standard_uncertainty_arcsec=F_ior.uncertainty,
        )


@dataclass(frozen=True, eq=False)
class SweepResult:
    """Results for one direction of a recording.

    direction: 1 for increasing input angles, -1 for decreasing ones, 0 for both directions combined.
    fit: fit of the orders, lines and slow terms.
    grid_turns: covered input angles [revolutions], shape (angles,).
    range: range of the curve over the covered angles.
    revolution: largest range within one input revolution.
    cam: range of the orders of the input, excluding slow terms of the output.
    slope: largest slope [arcsec per input revolution].
    slow_arcsec: range of the slow terms.
    raw_range_arcsec: range of the readings, without the drift if its removal was requested.
    orders: orders of the fit.
    orders_of_cam: declared orders with their sidebands.
    coverage: coverage of the full cycle or the travel, None if the ratio is unknown.
    sources: sources of the uncertainty of F'_ior.
    torques: F'_ior at the smallest, mean and largest torque, if the orders change with the torque.
    torque_miss_arcsec: largest error of linear interpolation between these torques, None if it is unknown.
    is_scale_bound: whether all errors may be larger by one common factor.
    shafts: components of the stated shafts outside the drive.
    full_cycle: F'_ior of the full cycle from the model of the recording, or the reason why it is not available. It is
    None before `with_full_cycle`. If it is available, its value and interval are those of F'_ior.
    """

    direction: int
    fit: TraceFit
    grid_turns: Array
    range: Range
    revolution: Range
    cam: Range
    slope: Range
    slow_arcsec: float
    raw_range_arcsec: float
    orders: tuple[MeasuredOrder, ...]
    orders_of_cam: tuple[MeasuredOrder, ...]
    coverage: Coverage | None
    sources: tuple[UncertaintySource, ...]
    torques: tuple[_TorqueRange, ...] = ()
    torque_miss_arcsec: float | None = None
    is_scale_bound: bool = False
    shafts: tuple[ShaftComponent, ...] = ()
    full_cycle: FullCycle | str | None = None

    @property
    def bins(self) -> Bins:
        """The averaged readings to which the orders were fitted."""
        return self.fit.bins

    @property
    def by_model(self) -> FullCycle | None:
        """F'_ior from the model of the recording, or None if it is not available."""
        return self.full_cycle if isinstance(self.full_cycle, FullCycle) else None

    @property
    def F_ior_arcsec(self) -> float:
        """F'_ior from the model of the recording, or the range over the covered angles if there is no model."""
        return self.by_model.value_arcsec if self.by_model else self.range.value

    @property
    def budget(self) -> tuple[UncertaintySource, ...]:
        """The sources of the uncertainty of F'_ior; a model of the recording replaces the scatter of fitted orders."""
        if self.by_model is None:
            return self.sources
        by_model = self.by_model.standard_uncertainty_arcsec
        model = UncertaintySource("model", by_model, "noise and tooth waves, from the model of the recording")
        return (model, *(source for source in self.sources if source.name not in SCATTER))

    @property
    def uncertainty_arcsec(self) -> float:
        """The combined standard uncertainty of F'_ior."""
        return combined(self.budget)

    @property
    def interval_arcsec(self) -> tuple[float, float]:
        """The 95 % interval of F'_ior of the full cycle.

        Without the model it is F'_ior minus and plus its expanded uncertainty (k = 2). The upper end includes the rise
        by lines in another cycle. If F'_ior is a lower bound, the interval is that of the recorded part.
        """
        return self.by_model.interval_arcsec if self.by_model else self.range.interval

    @property
    def is_part(self) -> bool:
        """Whether the recording is a part of an output revolution, whose slow terms were removed by polynomials."""
        return self.fit.design.slow.by_angle

    @property
    def lines(self) -> tuple[MeasuredOrder, ...]:
        """The lines that are not declared orders."""
        return tuple(order for order in self.orders if order.is_line)

    def order_alone(self, per_cam_rev: float) -> MeasuredOrder | None:
        """Return the fitted order nearest to an order, without its sidebands, or None if none was fitted there."""
        candidates = [order for order in self.orders if abs(order.per_cam_rev - per_cam_rev) <= 0.5 / self.bins.span]
        return min(
            candidates,
            key=lambda order: abs(order.per_cam_rev - per_cam_rev),
            default=None,
        )

    @property
    def is_bound(self) -> bool:
        """Whether F'_ior of the full cycle may be larger, because the readings do not determine all of it.

        This is the case if angles were not covered, slow terms were removed, a travel was recorded in parts with
        unknown levels, or all errors may be larger by one common factor.
        """
        if self.coverage is None or self.coverage.share < FULL_SHARE or self.is_part or self.is_scale_bound:
            return True
        return bool(self.fit.design.slow.ridge) and self.coverage.longest_share < FULL_SHARE


@dataclass(frozen=True, eq=False)
class Measurement:
    """Results for a measured recording.

    trace: recording as read.
    gearing: gearing of the drive, None if the ratio is unknown.
    directions: results by direction, that with the largest F'_ior first.
    reversal: difference between the directions, None unless both were recorded.
    lag: lag between the encoders, None if it is unknown.
    notes, warnings: statements on what was omitted or removed.
    seed: seed of the bootstrap.
    torque: recorded torque, None if it was not recorded.
    alone: separate results by direction if both were combined and each is long enough, otherwise empty.
    """

    trace: MeasuredTrace
    gearing: Gearing | None
    directions: tuple[SweepResult, ...]
    reversal: Reversal | None
    lag: EncoderLag | None
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    seed: int
    torque: RecordedTorque | None = None
    alone: tuple[SweepResult, ...] = ()

    @property
    def greatest(self) -> SweepResult:
        """The result of the direction with the largest F'_ior."""
        return (self.alone or self.directions)[0]

    @property
    def is_of_travel(self) -> bool:
        """Whether F'_ior refers to less than the full cycle."""
        return bool(self.gearing and self.gearing.travel)

    @property
    def slope_arcsec_per_deg(self) -> tuple[float, float] | None:
        """The largest slope over the output angle and its standard uncertainty, or None if the ratio is unknown."""
        if self.gearing is None:
            return None
        slopes = [sweep.slope for sweep in self.alone or self.directions]
        steepest = max(slopes, key=lambda slope: slope.value)
        per_deg = self.gearing.ratio / 360  # input revolutions
        return steepest.value * per_deg, steepest.uncertainty * per_deg

    @property
    def F_ior_arcsec(self) -> float:
        """The larger F'_ior of the two directions."""
        return self.greatest.F_ior_arcsec


def _without_repeats(texts: Iterable[str]) -> tuple[str, ...]:
    """Return each text once, in order of first appearance, because both directions may produce the same text."""
    return tuple(dict.fromkeys(texts))


def _gearing_within(
    drive: Drive | None,
    ratio: float | None,
    travel_deg: float | None,
) -> Gearing | None:
    """Return the gearing of a drive or of a ratio, restricted to an output travel [deg] if one is stated."""
    gearing = gearing_of(drive, ratio)
    return gearing.within(travel_deg) if gearing else None


def measure(
    trace: MeasuredTrace,
    *,
    drive: Drive | None = None,
    ratio: float | None = None,
    orders: Sequence[float] | None = None,
    drift: str = "none",
    stated: Mapping[str, float] | None = None,
    seed: int = 0,
    together: bool = False,
    may_be_noise: bool = False,
    travel_deg: float | None = None,
    M_g: float | None = None,
    shafts: Sequence[Shaft] = (),
) -> Measurement:
    """Return F'_ior, orders and coverage of a measured recording.

    trace: recording of one or both directions.
    drive, ratio: at most one of them, which determines the cycle, the coverage and the sidebands; both None if the
    ratio is unknown.
    orders: orders per input revolution, increasing, to which the error is limited. None selects those of 1 to 12 that
    the steps of the angle resolve.
    drift: drift to remove: none, linear or quadratic.
    stated: standard uncertainties [arcsec] by source.
    seed: seed of the bootstrap.
    together: whether both directions are combined, with direction number 0.
    may_be_noise: whether an F'_ior that does not exceed its noise is allowed.
    travel_deg: travel of the output. If given, F'_ior is the range of the error within it, including slow terms.
    M_g: torque at which F'_ior is computed [N*m]; None for the torque of the recording.
    shafts: shafts outside the drive whose components are determined.
    Raises UsageError for an invalid argument.
    Raises DataError for less than one input revolution in one direction, or if the torque was not recorded.
    Raises UntrustedError if the recording does not resolve the orders, or F'_ior does not exceed its noise.
    """
    _require_drift(drift)
    gearing = _gearing_within(drive, ratio, travel_deg)
    if M_g is not None:
        trace = at_torque(trace, M_g, drive.rated_torque if drive else 0.0)
    record = _RecordUnderway(
        trace=trace,
        gearing=gearing,
        drive=drive,
        orders=orders,
        drift=drift,
        stated=stated or {},
        seed=seed,
        together=together,
        may_be_noise=may_be_noise,
        M_g=M_g,
        shafts=shafts,
    )
    alone = []
    if together:
        alone = record.directions_alone()
        record.read_in_time(alone)
    directions = record.directions()
    reversal, lag = _reversal_of(directions, trace, gearing)
    return Measurement(
        trace=trace,
        gearing=gearing,
        directions=tuple(directions),
        reversal=reversal,
        lag=lag,
        notes=_without_repeats(record.notes),
        warnings=_without_repeats(record.warnings),
        seed=seed,
        torque=record.torque,
        alone=tuple(alone),
    )


def _reversal_of(
    directions: Sequence[SweepResult],
    trace: MeasuredTrace,
    gearing: Gearing | None,
) -> tuple[Reversal | None, EncoderLag | None]:
    """Return the lost motion at reversal and the lag between the encoders, as far as both directions determine them."""
    growing_first = sorted(directions, key=lambda sweep: -sweep.direction)
    first_turns = np.rint(growing_first[0].grid_turns * 1e6)  # integers, so that equal angles compare as equal
    last_turns = np.rint(growing_first[-1].grid_turns * 1e6)
    drifts = [source for sweep in directions for source in sweep.sources if source.name == "drift"]
    return reversal_and_lag(
        fits=[sweep.fit for sweep in growing_first],
        shared=np.intersect1d(first_turns, last_turns) / 1e6,
        drift_arcsec=combined(drifts),
        trace=trace,
        ratio=gearing.ratio if gearing else None,
    )


@dataclass(eq=False)
class _RecordUnderway:
    """A recording that is being evaluated direction by direction, with the arguments of `measure`.

    trace: recording after the corrections so far: readings omitted, steps of the level marked, and wind-up
    removed by the catalogue stiffnesses.
    torque: recorded torque, None without a column of torque.
    notes, warnings: statements collected so far.
    """

    trace: MeasuredTrace
    gearing: Gearing | None
    drive: Drive | None
    orders: Sequence[float] | None
    drift: str
    stated: Mapping[str, float]
    seed: int
    together: bool
    may_be_noise: bool
    M_g: float | None
    shafts: Sequence[Shaft] = ()

    def __post_init__(self) -> None:
        """Set the recorded torque and the initial notes."""
        load = self.trace.load
        self.torque = None if load is None else RecordedTorque(float(load.mean()), float(load.min()), float(load.max()))
        self.notes = list(self.trace.notes)
        self.warnings: list[str] = []

    def directions_alone(self) -> list[SweepResult]:
        """Return the separate results of each direction, or an empty list if they are too short or not reliable."""
        with suppress(HdassistError):  # the two directions combined may still be sufficient
            return replace(self, together=False, may_be_noise=True).directions()
        return []

    def read_in_time(self, alone: Sequence[SweepResult]) -> None:
        """Remove the lag between the encoders from the input angles if this improves the agreement of the directions.

        A lag shifts the error along the angle, in opposite senses for the two directions, and more at a higher speed.
        The difference between the levels of the directions gives the size of the lag. The better agreement gives its
        sign, and shows that the difference is not due to friction.

        alone: separate results of each direction.
        """
        if self.trace.time_s is None or self.gearing is None or len(alone) != _BOTH_WAYS:
            return
        fits = [sweep.fit for sweep in sorted(alone, key=lambda sweep: -sweep.direction)]
        _, lag = reversal_and_lag(fits, np.empty(0), 0.0, self.trace, self.gearing.ratio)
        if lag is None or abs(lag.ms) <= _LAG_CLEAR * lag.uncertainty_ms:
            return
        trace_as_read = self.trace
        least_variance = self._fitted_once(0).variance
        for lag_s in (lag.ms / 1e3, -lag.ms / 1e3):
            moved = without_lag(trace_as_read, lag_s)
            variance = replace(self, trace=moved)._fitted_once(0).variance
            if variance < least_variance:
                self.trace = moved
                least_variance = variance

    def directions(self) -> list[SweepResult]:
        """Return the results of each direction, that with the largest F'_ior first. Raises the errors of `measure`."""
        signs = (0,) if self.together else (1, -1)
        results = [self._result(sign) for sign in signs]
        directions = [result for result in results if result is not None]
        if not directions:
            hint = (
                "record at least one input revolution in one direction; check the column and the "
                "unit of the input angle"
            )
            raise DataError(f"{self.trace.file}: less than one input revolution in one direction", hint)
        return sorted(directions, key=lambda sweep: -sweep.range.value)

    def _result(self, sign: int) -> SweepResult | None:
        """Return the results of a direction (0 for both), or None if it covers less than an input revolution."""
        if self._is_too_short(sign):
            return None
        fit = self._fitted(sign)
        fit, torque_miss = self._with_order_changes(sign, fit)
        fit, drift_left = self._with_lines(fit)
        if self.M_g is not None and len(fit.blocks) > 1:
            fit = self._at_requested_torque(
                fit,
                self.M_g,
                is_bend_known=torque_miss is not None,
            )
        self._require_ratio(fit)
        result = self._sweep_result(sign, fit, drift_left, torque_miss)
        if not fit.unmodelled < _UNMODELLED * result.range.value:
            size = f"{fit.unmodelled:.2g}″"
            self.warnings.append(
                f"the declared orders leave an error of {size}: declare more orders, or remove a drift"
            )
        shafts = shaft_components(self.trace.one_way(sign), fit, self.shafts, self.gearing)
        return replace(result, shafts=shafts)

    def _is_too_short(self, sign: int) -> bool:
        """Return whether a direction covers less than an input revolution, and add a note if it does."""
        trace = self.trace.one_way(sign)
        longest = 0.0  # revolutions of the longest sweep, including the step after its last reading
        for angles in trace.by_sweep(trace.cam_deg):
            longest = max(longest, float(np.ptp(angles)) / 360 * len(angles) / (len(angles) - 1))
        if longest >= _SHORTEST_TURNS - 0.01:
            return False
        if trace.sweeps:
            way = "increasing" if sign > 0 else "decreasing"
            self.notes.append(f"{way} angles omitted: they cover only {longest:.2g} of an input revolution")
        return True

    def _with_order_changes(self, sign: int, fit: TraceFit) -> tuple[TraceFit, float | None]:
        """Return a fit, with orders that depend on the torque if needed, and the largest interpolation error [arcsec].

        If the torque changes within sweeps and follows the output angle, its effect is part of the sidebands instead.
        """
        torque = self.torque
        if torque is None or not torque.is_change([fit.bins.load]):
            return fit, None
        trace = self.trace.one_way(sign)
        torque_miss = None
        if "load" in fit.slopes or not torque.is_change(trace.by_sweep(np.asarray(trace.load))):
            fit, torque_miss = with_order_changes(fit, self.seed)
        if "load" in fit.slopes and len(fit.blocks) == 1:
            self.warnings.append(_CHANGES_LEFT)
        return fit, torque_miss

    def _with_lines(self, fit: TraceFit) -> tuple[TraceFit, float]:
        """Return a fit with its lines, and the linear drift that remains in the fit [arcsec].

        The error of a completely recorded cycle ends where it began, so a drift over the cycle is removed. If both
        directions are combined, drift appears in their difference, and lines count as noise.
        """
        if self.together:
            return fit, 0.0
        bins = fit.bins
        fit, drift_left = _with_lines_or_drift(fit)
        if not drift_left:
            return fit, 0.0
        if self.gearing is None or bins.span < WHOLE_TURN * self.gearing.cycle:
            self.warnings.append(DRIFT_LEFT.format(drift_left))
            return fit, drift_left
        self.warnings.append(_DRIFT_OFF.format(drift_left, float(np.ptp(fit.curve(bins.turns)))))
        without_drift = fit_orders(bins, fit.orders[~fit.is_line], replace(fit.design.slow, degree=1))
        return _with_lines_or_drift(without_drift)

    def _at_requested_torque(
        self,
        fit: TraceFit,
        M_g: float,
        *,
        is_bend_known: bool,
    ) -> TraceFit:
        """Return a fit with its curve at the requested torque [N*m], whose column may have the opposite sign."""
        if not is_bend_known:
            low, _, high = fit.bins.torques
            self.warnings.append(_STRAIGHT.format(M_g, low, high))
        return fit.at_torque(self._torque_of(fit))

    def _torque_of(self, fit: TraceFit) -> float:
        """Return the torque of F'_ior, with the sign of its column [N*m]: the requested one, else the mean."""
        low, mean, high = fit.bins.torques
        if self.M_g is None:
            return mean
        nearest = min((self.M_g, -self.M_g), key=lambda load: max(low - load, load - high))
        return min(max(nearest, low), high)

    def _require_ratio(self, fit: TraceFit) -> None:
        """Raise DataError if the sidebands of a recording show a ratio other than that of the drive or of --ratio."""
        gearing = self.gearing
        if gearing is None or fit.bins.span < _CYCLES_OF_RATIO * gearing.cycle:
            return
        fit_with_lines = with_lines(fit) if self.together else fit
        shown_ratio = other_ratio(fit_with_lines, _declared(self.trace, self.orders, []), gearing.ratio)
        if shown_ratio is None:
            return
        period = f"every {shown_ratio:.3g} input revolutions, not every {gearing.ratio:g}"
        hint = (
            f"check the file and the ratio; the spacing of the sidebands indicates a ratio of about {shown_ratio:.0f}"
        )
        raise DataError(f"{self.trace.file}: the error repeats {period}", hint, Fault.FILE_INVALID)

    def _fitted(self, sign: int) -> TraceFit:
        """Return the fit to a direction after repeated removal of the readings and effects that the fits identify."""
        fitted_trace = self.trace
        fit = self._fitted_once(sign)
        while self.trace is not fitted_trace:
            fitted_trace = self.trace
            fit = self._fitted_once(sign)
        return fit

    def _fitted_once(self, sign: int) -> TraceFit:
        """Return the fit to a direction, and replace the trace if the fit shows something to omit or remove."""
        trace = self.trace.one_way(sign)
        ratio = self.gearing.ratio if self.gearing else USUAL_RATIO
        declared = _declared(trace, self.orders, self.notes)
        bins = bins_of(trace, declared[-1])
        slow = self._slow_terms(trace, bins, ratio)
        fit = _fit(bins, declared, ratio, slow, self.notes)
        torques = [] if trace.load is None else trace.by_sweep(trace.load)
        torque = self.torque
        if torque and torque.by != "catalogue" and torque.is_change(torques):
            if tells_compliance(fit):
                with_load = replace(slow, over=(*slow.over, "load"))
                wound = _fit(bins, declared, ratio, with_load, self.notes)
                torque_by_record = torque.fitted(fit, wound, torques)
                if torque_by_record:
                    fit = wound
                    self.torque = torque_by_record
            elif without_wind_up := torque.by_catalogue(self.trace, self.drive):
                self.trace, self.torque = without_wind_up
                return fit
            else:
                self.warnings.append(_WIND_UP_LEFT)
        change = without_spikes(trace, fit) or with_step(trace, fit, ratio)
        if change:
            self.trace = replace(change.trace, sweeps=tuple(sweeps(change.trace.cam_deg)))
            self.warnings.append(change.warning)
        return fit

    def _slow_terms(
        self,
        trace: MeasuredTrace,
        bins: Bins,
        ratio: float,
    ) -> SlowTerms:
        """Return the slow terms of a direction, including a lag between the encoders if its speed changes."""
        slow = SlowTerms(_DRIFTS[self.drift])
        is_travel = bool(self.gearing and self.gearing.travel)
        if is_travel or not self.together:
            slow = slow_terms(
                bins.span_on_output(ratio),
                ratio,
                slow.degree,
                is_travel=is_travel,
            )
        if trace.time_s is not None and not self.together and speed_changes(bins):
            slow = replace(slow, over=("speed",))
        return slow

    def _sweep_result(
        self,
        sign: int,
        fit: TraceFit,
        drift_left: float,
        torque_miss: float | None,
    ) -> SweepResult:
        """Return the range of a fit with its uncertainty, its orders and its coverage.

        drift_left: linear drift that remains in the fit [arcsec].
        torque_miss: largest error of linear interpolation between torques [arcsec], None if it is unknown.
        Raises UntrustedError for a range that steps of the readings or noise may explain.
        """
        trace = self.trace.one_way(sign)
        visited = _visited(fit, self.gearing)
        drifts = self._drift_sources(fit, drift_left)
        errors = self._error_sources(trace, fit, visited.grid_turns, torque_miss)

        bridges = _bridge_sources(fit, self._torque_of(fit), torque_miss)
        other_uncertainties = _other_uncertainties(drifts, (*errors, *bridges), fit.bins.span)
        fitted = self._ranges(fit, visited, other_uncertainties, sign)
        F_ior = fitted.visited
        # both ranges are bias-corrected, and the range of a part is at most that of the whole
        revolution_bias = max(fitted.revolution.bias, fitted.revolution.fitted - F_ior.value)
        revolution = replace(fitted.revolution, bias=revolution_bias)
        at_torques = []
        for torque in _torques_of(fit):
            bridges_at_torque = _bridge_sources(fit, torque, torque_miss)
            other_uncertainties = _other_uncertainties(drifts, (*errors, *bridges_at_torque), fit.bins.span)
            ranges = self._ranges(fit.at_torque(torque), visited, other_uncertainties, sign)
            at_torques.append(_TorqueRange.of(torque, ranges.visited))
        sources = (*_noise_sources(F_ior), *drifts, *errors, *bridges)
        _require_fine_steps(trace, F_ior)
        if not self.may_be_noise:
            _require_clear(trace, fit, F_ior, sources, is_drifting=bool(drift_left))
        orders, orders_of_cam = order_tables(fit, _declared(trace, self.orders, []), self.drive, self.gearing)
        result = SweepResult(
            direction=sign,
            fit=fit,
            grid_turns=visited.grid_turns,
            range=F_ior,
            revolution=revolution,
            cam=fitted.cam,
            slope=fitted.slope,
            slow_arcsec=_slow_range(fit),
            raw_range_arcsec=_range_without_drift(trace, fit),
            orders=orders,
            orders_of_cam=orders_of_cam,
            coverage=visited.coverage,
            sources=sources,
            torques=tuple(at_torques),
            torque_miss_arcsec=torque_miss,
            is_scale_bound=trace.is_lower_bound,
        )
        return _at_most_readings(result, trace)

    def _ranges(
        self,
        fit: TraceFit,
        visited: _Visited,
        others: OtherUncertainties,
        sign: int,
    ) -> CurveRanges:
        """Return the ranges of the curve of a fit.

        fit: fit at one torque, or at all torques.
        visited: covered input angles.
        others: uncertainties other than that of the fit.
        sign: direction. Each direction has its own draws, which are the same at each torque.
        """
        return ranges_of(
            fit,
            visited.grid_turns,
            np.random.default_rng([self.seed, sign + 1]),
            others,
            whole=visited.coverage is not None and visited.coverage.share >= FULL_SHARE,
        )

    def _drift_sources(self, fit: TraceFit, drift_left: float) -> tuple[UncertaintySource, ...]:
        """Return the uncertainty sources that change the error slowly along a recording.

        drift_left: linear drift that remains in the fit [arcsec].
        """
        # a remaining drift may not exist at all; a removed drift may be curved
        drift = abs(drift_left) / 2 if len(fit.drift) != 1 else _BENT * abs(float(fit.drift[0]))
        wind_up = self.torque.uncertainty_arcsec if self.torque and self.torque.by == "catalogue" else 0.0
        return (
            UncertaintySource("drift", drift / sqrt(3), "deviation of the drift from a straight line"),
            UncertaintySource(WIND_UP, wind_up, "catalogue stiffnesses used to remove it"),
        )

    def _error_sources(
        self,
        trace: MeasuredTrace,
        fit: TraceFit,
        turns: Array,
        torque_miss: float | None,
    ) -> tuple[UncertaintySource, ...]:
        """Return the uncertainty sources other than noise and drift.

        turns: covered angles [revolutions].
        torque_miss: largest error of linear interpolation between torques [arcsec], None if it is unknown.
        """
        errors_range = float(np.ptp(trace.error_arcsec[trace.rows]))
        reading_scatter = float(np.sqrt(np.mean(fit.bins.rows * fit.residual**2)))
        # sqrt(2), because both extremes of a range err independently
        images = image_change(fit, turns) / sqrt(2)
        unmodelled = sqrt(2) * fit.unmodelled
        sources = [
            UncertaintySource("between readings", images, "orders hidden by evenly spaced readings"),
            UncertaintySource("beyond the orders", unmodelled, "residuals correlated from step to step"),
            UncertaintySource("guide rate", trace.scale_uncertainty * errors_range, "guide pulses added back"),
            resolution_source(trace, reading_scatter),
        ]
        if torque_miss:
            bend = torque_miss / sqrt(12)
            sources.append(UncertaintySource(BETWEEN_TORQUES, bend, "curvature of the orders between torques"))
        return (*sources, *stated_sources(self.stated))


def _bridge_sources(
    fit: TraceFit,
    torque: float,
    torque_miss: float | None,
) -> tuple[UncertaintySource, ...]:
    """Return the uncertainty source of an error that is interpolated between the two recorded torques, if it is.

    The error may lie anywhere between those at the two torques, with equal probability. The uncertainty is its root
    mean square distance from a straight line.

    torque: torque of the error [N*m].
    torque_miss: largest error of linear interpolation [arcsec], which replaces this source; None if it is unknown.
    """
    low, _, high = fit.bins.torques
    distance = float(np.abs(fit.bins.load - torque).min())
    if torque_miss is not None or len(fit.blocks) == 1 or distance <= _RECORDED_TORQUE * (high - low):
        return ()
    turns = fit.bins.turns
    change = float(np.ptp(fit.at_torque(high).curve(turns) - fit.at_torque(low).curve(turns)))
    share = (torque - low) / (high - low)
    bridge = change * sqrt(1 / 12 + (share - 1 / 2) ** 2)
    return (UncertaintySource(BETWEEN_TORQUES, bridge, "no recording between the torques"),)


def _torques_of(fit: TraceFit) -> Sequence[float]:
    """Return the torques at which a fit has separate curves [N*m], or an empty sequence if it has one curve."""
    return fit.bins.torques if len(fit.blocks) > 1 else ()


@dataclass(frozen=True, eq=False)
class _Visited:
    """Covered input angles [revolutions], increasing, shape (angles,), and their coverage (None without a ratio)."""

    grid_turns: Array
    coverage: Coverage | None


def _visited(fit: TraceFit, gearing: Gearing | None) -> _Visited:
    """Return the input angles that a recording covers.

    Each angle of the cycle occurs only once if whole output revolutions are recorded and the fit has no lines.
    """
    places, per_turn = visited_angles(fit)
    if gearing is None:
        return _Visited(places / per_turn, None)
    cycle = gearing.cycle * per_turn
    places_in_cycle = np.unique(np.mod(places, cycle))
    # a grid point counts as covered if the next one is covered too
    steps = int(np.isin(np.mod(places_in_cycle + 1, cycle), places_in_cycle).sum())
    cam_turns = steps / per_turn
    coverage = Coverage(
        cam_turns=cam_turns,
        share=min(1.0, cam_turns / gearing.cam_turns),
        longest_share=min(1.0, fit.bins.span / gearing.cam_turns),
    )
    is_whole = fit.bins.span_on_output(gearing.ratio) >= WHOLE_TURN * gearing.ratio
    if is_whole and not len(fit.lines):
        places = places_in_cycle
    return _Visited(places / per_turn, coverage)


def _at_most_readings(result: SweepResult, trace: MeasuredTrace) -> SweepResult:
    """Return a result whose ranges, if they are lower bounds, are no larger than the range of the readings."""
    if not result.is_bound:
        return result
    largest = min(result.raw_range_arcsec, float(np.ptp(trace.error_arcsec[trace.rows])))
    return replace(
        result,
        range=result.range.at_most(largest),
        revolution=result.revolution.at_most(largest),
    )


def _noise_sources(F_ior: Range) -> tuple[UncertaintySource, ...]:
    """Return the sources of uncertainty of a range that are due to noise."""
    return (
        UncertaintySource("noise", F_ior.spread, "bootstrap of the residuals"),
        UncertaintySource("bias correction", F_ior.bias_uncertainty, "a third of the removed bias"),
    )


def _other_uncertainties(
    drifts: Sequence[UncertaintySource],
    errors: Sequence[UncertaintySource],
    span: float,
) -> OtherUncertainties:
    """Return the uncertainties of the ranges due to sources other than noise.

    drifts: sources whose effect on a range grows with the span.
    errors: sources whose effect does not grow with the span.
    span: input revolutions of the recording.
    """
    drift = combined(drifts)
    error = combined(errors)
    return OtherUncertainties(
        visited=hypot(drift, error),
        revolution=hypot(drift / span, error),
        cam=error,
    )


def _slow_range(fit: TraceFit) -> float:
    """Return the range of the slow terms of a fit at its bins [arcsec]."""
    bins = fit.bins
    if fit.design.slow.by_angle:
        return float(np.ptp(fit.design.drift_at(fit.drift, bins.turns, bins.travel)))
    return float(np.ptp(curve_of(fit.coefficients[np.tile(fit.is_slow, 2)], fit.orders[fit.is_slow], bins.turns)))


def _range_without_drift(trace: MeasuredTrace, fit: TraceFit) -> float:
    """Return the range of the readings of a recording without the fitted drift [arcsec]."""
    rows = trace.rows
    drift = fit.design.drift_at(fit.drift, trace.cam_deg[rows] / 360, travel_of(trace)[rows])
    return float(np.ptp(trace.error_arcsec[rows] - drift))


def _require_fine_steps(trace: MeasuredTrace, F_ior: Range) -> None:
    """Raise UntrustedError if the output readings have steps so coarse that rounding looks like error."""
    if trace.in_time and trace.step_arcsec > _COARSE_STEP * F_ior.value:
        size = f"{trace.step_arcsec:.2g}″"
        message = (
            f"the output is sampled at even angles in steps of {size}, so rounding cannot be distinguished from error"
        )
        hint = "sample both encoders at constant time intervals"
        raise UntrustedError(f"{trace.file}: {message}", hint, Fault.ORDERS_UNTOLD)


def _require_clear(
    trace: MeasuredTrace,
    fit: TraceFit,
    F_ior: Range,
    sources: Sequence[UncertaintySource],
    *,
    is_drifting: bool,
) -> None:
    """Raise UntrustedError if F'_ior does not exceed its noise.

    is_drifting: whether a drift remains in the fit.
    """
    by_recording = [source for source in sources if source.name not in {*STATED, WIND_UP, BETWEEN_TORQUES}]
    uncertainty = combined(by_recording)
    if fit.clear_of_noise and F_ior.value > COVERAGE_FACTOR * uncertainty:
        return
    hint = "record longer or with less noise, and check the column of the error"
    if is_drifting:
        hint = "use --drift linear, because the recording drifts"
    if BY_ORDER in trace.notes:
        hint = f"use --second 2 if the second column is an encoder at the output ({BY_ORDER} in arcsec)"
    message = f"F'_ior of {max(F_ior.value, 0.0):.3g}″ does not exceed its noise (u = {uncertainty:.3g}″)"
    raise UntrustedError(f"{trace.file}: {message}", hint, Fault.ORDERS_UNTOLD)


def _require_drift(kind: str) -> None:
    """Raise UsageError unless the kind of drift is known."""
    if kind not in _DRIFTS:
        raise UsageError(f"invalid --drift {kind}: expected one of {', '.join(_DRIFTS)}")


def _with_lines_or_drift(fit: TraceFit) -> tuple[TraceFit, float]:
    """Return a fit with its lines, and the linear drift that remains in the fit [arcsec]."""
    # lines first, because a missing line would look like drift
    fit = with_lines(fit)
    extent = float(np.ptp(fit.bins.error - fit.residual))
    return fit, 0.0 if len(fit.drift) else drift_of(fit, extent)


def _declared(
    trace: MeasuredTrace,
    orders: Sequence[float] | None,
    notes: list[str],
) -> Sequence[float]:
    """Return the declared orders, or the default orders that the steps of the angle resolve.

    notes: list to which a note on unresolved orders is added.
    Raises UntrustedError if declared orders are not resolved.
    """
    declared = orders or DEFAULT_ORDERS
    # the difference between two sweeps is not a step of the angle
    steps = np.concatenate(list(map(np.diff, trace.by_sweep(trace.cam_deg)))) / 360
    # three quarters of the steps are at most this long; a few longer gaps do not limit the orders
    highest = 1 / (_STEPS_PER_PERIOD * float(np.quantile(np.abs(steps[steps != 0]), 0.75)))
    if declared[-1] <= highest:
        return declared
    resolved = tuple(order for order in declared if order <= highest)
    # orders that the user declared are never omitted silently
    if orders is not None or not resolved:
        step_deg = 360 / (_STEPS_PER_PERIOD * highest)
        message = f"{trace.file}: steps of {step_deg:.3g}° are too long for order {declared[-1]:g}"
        hint = f"use smaller steps, or declare orders up to {highest:.2g} with --orders"
        raise UntrustedError(message, hint, Fault.ORDERS_UNTOLD)
    limit = f"only orders up to {resolved[-1]:g} are fitted"
    notes.append(f"{limit}: the angle steps do not resolve higher orders, which may appear as lower orders")
    return resolved


def _fit(
    bins: Bins,
    declared: Sequence[float],
    ratio: float,
    slow: SlowTerms,
    notes: list[str],
) -> TraceFit:
    """Return a fit with as many sidebands as the recording resolves and has bins for, possibly none.

    notes: list to which a note on missing sidebands is added.
    """
    turns = bins.span if slow.ridge else bins.span_on_output(ratio)
    grids: dict[int, tuple[int, Array]] = {}  # number of sidebands and the orders, by the number of orders
    # fewer sidebands have fewer unknowns; grids with the same number of orders are identical
    for beats in range(BEATS, -1, -1):
        orders = order_grid(declared, turns, ratio, slow, beats=beats)
        grids[len(orders)] = (beats, orders)
    *with_sidebands, (_, without_sidebands) = grids.values()
    for number, (beats, orders) in enumerate(with_sidebands):
        # twice the minimum number of bins, to leave room for noise and lines
        if len(bins) < BINS_PER_COLUMN * 2 * (2 * len(orders) + 4):
            continue
        # angles that do not resolve this many sidebands may resolve fewer
        with suppress(UntrustedError):
            fit = fit_orders(bins, orders, slow)
            if number:
                notes.append(
                    f"sidebands fitted on each side of an order: {beats} of {BEATS}, because there are too few angles"
                )
            return fit
    if len(without_sidebands) < len(declared):
        notes.append(f"orders less than 1/{turns:.3g} apart are combined, because the recording does not resolve them")
    notes.append("sidebands at the output frequency are not resolved and are included in the orders")
    return fit_orders(bins, without_sidebands, slow)


@dataclass(frozen=True)
class LoggedJoint:
    """A joint in a recording of several joints.

    name: name of the joint.
    angle: column of the input angle.
    second: column of the output encoder.
    ratio: ratio of the drive.
    """

    name: str
    angle: str
    second: str
    ratio: float

    @classmethod
    def of(cls, text: str) -> LoggedJoint:
        """Return the joint described by a text such as "J1=cam1,out1,100".

        Raises UsageError if the text does not have this form.
        """
        # names of columns may contain commas, so the ratio and the second column are split off from the right
        name, _, columns = text.partition("=")
        parts = columns.rsplit(",", 2)
        if not name or len(parts) != 3 or not all(parts) or not isfinite(number_of(parts[-1])):
            hint = "state the columns of the input and output encoders, and the ratio: J1=cam1,out1,100"
            raise UsageError(f"invalid --joint {text}: expected NAME=ANGLE,SECOND,RATIO", hint)
        gearing_of(None, number_of(parts[-1]))
        return cls(name, parts[0], parts[1], number_of(parts[-1]))


@dataclass(frozen=True)
class Reading(ClosedRecord, TraceForm):
    """Form of the file, orders such as "1-12", kind of drift, and stated uncertainties such as "encoder=0.3"."""

    orders: str | None = None
    drift: str = "none"
    budget: tuple[str, ...] = ()

    def require_sound(self) -> None:
        """Raise UsageError for options that are invalid for any file."""
        super().require_sound()
        parse_stated(self.budget)
        parse_orders(self.orders or None)
        _require_drift(self.drift)

    def measured(
        self,
        file: str,
        drive: Drive | None,
        ratio: float | None = None,
        **how: Any,
    ) -> Measurement:
        """Return the results of a recording.

        file: path of the recording.
        drive, ratio: at most one of them.
        how: further arguments of `measure`.
        Raises DataError for a torque between the recorded ones, and for a file of another kind. Further errors are
        those of `measure` and `read_trace`.
        """
        result = self.measured_or_bench(file, drive, ratio, **how)
        if not isinstance(result, Measurement):
            kind = "approached positions or a torque loop, not a recording of angles and errors"
            hint = (
                "compute its quantities with hdassist measure, and pass them to hdassist accept with "
                "--value NAME=VALUE±U"
            )
            raise DataError(f"{result.table.file}: {kind}", hint)
        require_recorded(result.trace, how.get("M_g"))
        if result.trace.is_lower_bound:
            message = "the declination of the guide star, which sets the scale of the error, is unknown"
            raise DataError(f"{result.trace.file}: {message}", "state the declination: --declination DEG")
        return result

    def measured_or_bench(
        self,
        file: str,
        drive: Drive | None,
        ratio: float | None = None,
        **how: Any,
    ) -> Measurement | PositionRecord | LoopRecord:
        """Return the results of a recording, or the data of a file of approached positions or torque loops.

        The arguments are those of `measured`.
        """
        table = read_record(file, self)
        gearing = gearing_of(drive, ratio)
        record = bench_record(table, self)
        # approached positions and torque loops are identified by their column names
        if record:
            if self.has_pace or how.get("shafts"):
                kind = "positions or torque loops, which have neither times nor components of shafts"
                raise UsageError(f"{table.file} contains {kind}", "leave out --speed, --period and --shafts")
            return record
        return measure(
            trace_of(table, self, gearing.ratio if gearing else None),
            drive=drive,
            ratio=ratio,
            orders=parse_orders(self.orders or None),
            drift=self.drift,
            stated=parse_stated(self.budget),
            **how,
        )
