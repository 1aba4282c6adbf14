"""F'_ior, orders and coverage of a measured trace, each direction by itself, and the options by which it is read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import hypot, isfinite, sqrt
from typing import Any

import numpy as np

from hdassist.errors import DataError, Fault, HdassistError, UntrustedError, UsageError
from hdassist.files import number_of
from hdassist.measuring.bench import LoopRecord, PositionRecord, bench_record
from hdassist.measuring.fit import COVERAGE_FACTOR, TraceFit, drift_of, fit_orders
from hdassist.measuring.orders import (
    BEATS,
    DEFAULT_ORDERS,
    FULL_SHARE,
    SCATTER,
    STATED,
    USUAL_RATIO,
    WHOLE_TURN,
    WIND_UP,
    Coverage,
    FullCycle,
    Gearing,
    MeasuredOrder,
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
from hdassist.measuring.residuals import with_lines, with_step, without_spikes
from hdassist.measuring.shafts import Shaft, ShaftComponent, shaft_components
from hdassist.measuring.slopes import (
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
from hdassist.measuring.terms import BINS_PER_COLUMN, Bins, SlowTerms, bins_of, curve_of, travel_of
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.readers.trace import BY_ORDER, MeasuredTrace, TraceForm, read_record, sweeps, trace_of
from hdassist.run.kept import ClosedRecord

_DRIFTS = {"none": 0, "linear": 1, "quadratic": 2}
_SHORTEST_TURNS = 1.0  # cam turns
_STEPS_PER_PERIOD = 2.5  # of the angle, in a period of the highest order, at least
DRIFT_LEFT = "a linear drift of {:.3g}″ over the recording is not removed (--drift linear), as it may be a slow order"
_DRIFT_OFF = (
    "the cycle does not close: a linear drift of {:.3g}″ is removed; with it the curve spans {:.1f}″; check the ratio"
)
_WIND_UP_LEFT = (
    "the torque follows the output angle: its wind-up is not removed (--drive PRESET with catalogue.K_1 to K_3)"
)
_CHANGES_LEFT = (
    "the recording does not show how the orders change with the torque, which may be part of F'_ior: "
    "record a sweep at each torque"
)
_STRAIGHT = (
    "F'_ior at {:g} N·m is interpolated linearly from {:.3g} to {:.3g} N·m: the recording does not show a curvature"
)
_CYCLES_OF_RATIO = 1.2  # full cycles, from which on a record shows whether its beats are those of the ratio
_BENT = 1 / 4  # of a drift: how far it may depart from a line to either side
_COARSE_STEP = 1 / 4  # of F'_ior: greatest step in time with the turns that the error is resolved from
_BOTH_WAYS = 2  # directions
_LAG_CLEAR = 3.0  # standard uncertainties of a lag that moves the angles
_UNMODELLED = 1 / 5  # of F'_ior: least error beyond the orders that is reported


@dataclass(frozen=True)
class _TorqueRange:
    """F'_ior at a torque of a record [N*m], with its standard uncertainty [arcsec]."""

    M_g_Nm: float
    F_ior_arcsec: float
    standard_uncertainty_arcsec: float


@dataclass(frozen=True, eq=False)
class SweepResult:
    """One direction of a trace: 1 for growing cam angles, -1 for falling ones, 0 for both as one.

    fit: see there; range: over the visited angles, grid_turns, shape (angles,); revolution: the greatest within one
    turn of the cam; cam: of the orders of the cam, without slow terms of the output; slope: the
    greatest [arcsec a cam turn]; slow_arcsec: range of these;
    raw_range_arcsec: of the readings themselves, drift taken off where asked; orders_of_cam: each with its beats;
    coverage: None where the ratio is not known; sources: of the uncertainty of F'_ior; torques: the least, the mean and
    the greatest, where the orders change with it, and torque_miss_arcsec, the most that lines between them miss.
    is_scale_bound: whether all errors may be larger by one factor. shafts: components of stated shafts.
    full_cycle: F'_ior of the full cycle by the model of the recording, or why there is none (with_full_cycle); None
    before. Its value and its interval are then those of F'_ior.
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
        """Averages of the readings, to which the fit was made."""
        return self.fit.bins

    @property
    def by_model(self) -> FullCycle | None:
        """F'_ior by the model of the recording; None without."""
        return self.full_cycle if isinstance(self.full_cycle, FullCycle) else None

    @property
    def F_ior_arcsec(self) -> float:
        """F'_ior; of a lower bound the range of the recorded part."""
        return self.by_model.value_arcsec if self.by_model else self.range.value

    @property
    def budget(self) -> tuple[UncertaintySource, ...]:
        """Sources of the uncertainty of F'_ior: that of the model takes the place of the scatter of fitted orders."""
        if self.by_model is None:
            return self.sources
        by_model = self.by_model.standard_uncertainty_arcsec
        model = UncertaintySource("model", by_model, "noise and waves of the teeth, by the model of the recording")
        return (model, *(source for source in self.sources if source.name not in SCATTER))

    @property
    def uncertainty_arcsec(self) -> float:
        """Combined standard uncertainty of F'_ior."""
        return combined(self.budget)

    @property
    def interval_arcsec(self) -> tuple[float, float]:
        """95 % interval of F'_ior of the full cycle.

        Without the model: F'_ior less and plus its expanded uncertainty, k = 2, and above that the rise by lines in
        another cycle; of a lower bound that of the recorded part.
        """
        return self.by_model.interval_arcsec if self.by_model else self.range.interval

    @property
    def is_part(self) -> bool:
        """Whether the record is part of an output turn, whose slow terms were taken off as a whole."""
        return self.fit.design.slow.by_angle

    @property
    def lines(self) -> tuple[MeasuredOrder, ...]:
        """Lines that are none of the declared orders."""
        return tuple(order for order in self.orders if order.is_line)

    def order_alone(self, per_cam_rev: float) -> MeasuredOrder | None:
        """Return an order without its beats, the value that a limit of it is compared with; None if it has none."""
        near = [order for order in self.orders if abs(order.per_cam_rev - per_cam_rev) <= 0.5 / self.bins.span]
        return min(near, key=lambda order: abs(order.per_cam_rev - per_cam_rev), default=None)

    @property
    def is_bound(self) -> bool:
        """Whether F'_ior of the full cycle may be greater, because the readings do not determine all of it.

        That is so if places were not visited, if slow terms were removed, if a travel was recorded in parts, whose
        levels are not known, or if all errors may be larger by one factor.
        """
        if self.coverage is None or self.coverage.share < FULL_SHARE or self.is_part or self.is_scale_bound:
            return True
        return bool(self.fit.design.slow.ridge) and self.coverage.longest_share < FULL_SHARE


@dataclass(frozen=True, eq=False)
class Measurement:
    """Answers from a measured trace: directions, that of the greatest F'_ior first; seed of the bootstrap.

    lag: between the encoders, None where it is not known; torque: None where it was not recorded; alone: each direction
    by itself beside both as one, empty otherwise or where they are too short.
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
        """The direction of the greatest F'_ior, of those measured by themselves."""
        return (self.alone or self.directions)[0]

    @property
    def is_of_travel(self) -> bool:
        """Whether the error counts in less than the full cycle."""
        return bool(self.gearing and self.gearing.travel)

    @property
    def slope_arcsec_per_deg(self) -> tuple[float, float] | None:
        """Greatest slope over the angle of the output, and its standard uncertainty; None without a ratio."""
        if self.gearing is None:
            return None
        steepest = max((each.slope for each in self.alone or self.directions), key=lambda slope: slope.value)
        per_deg = self.gearing.ratio / 360  # cam turns
        return steepest.value * per_deg, steepest.uncertainty * per_deg

    @property
    def F_ior_arcsec(self) -> float:
        """F'_ior: the greater one of both directions."""
        return self.greatest.F_ior_arcsec


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
    """F'_ior, orders and coverage of a measured trace.

    Arguments: trace; drive or ratio, for cycle, coverage and beats with the output; orders per cam turn, rising, to
    which the error is limited (None: 1 to 12, or as far as the steps of the angle resolve them); drift, none, linear
    or quadratic, to take off; stated, standard uncertainties [arcsec] by source; seed of the bootstrap;
    together, both directions as one, which is then 0; may_be_noise, whether F'_ior need not be clear of its noise;
    travel_deg, of the output: F'_ior is the range of the error there, and slow terms are part of it; M_g, torque [N*m]
    that is asked for, where the trace has a column of it; shafts, beside the drive, whose components are wanted.
    Raises UsageError: a wrong argument; DataError: less than one input revolution in one direction, or another torque;
    UntrustedError: orders that the record does not resolve, or an F'_ior that is not clear of its noise.
    """
    _require_drift(drift)
    gearing = gearing_of(drive, ratio)
    gearing = gearing and gearing.within(travel_deg)
    if M_g is not None:
        trace = at_torque(trace, M_g, drive.rated_torque if drive else 0.0)
    record = _RecordUnderway(
        trace, gearing, drive, orders, drift, stated or {}, seed, together, may_be_noise, M_g, shafts
    )
    apart, alone = replace(record, together=False, may_be_noise=True), list[SweepResult]()
    if together:
        with suppress(HdassistError):
            alone = apart.directions()
        record.read_in_time(alone)
    directions = record.directions()
    growing_first = sorted(directions, key=lambda each: -each.direction)
    places = [np.rint(each.grid_turns * 1e6) for each in growing_first]
    reversal, lag = reversal_and_lag(
        [each.fit for each in growing_first],
        np.intersect1d(places[0], places[-1]) / 1e6,
        combined([source for each in directions for source in each.sources if source.name == "drift"]),
        trace,
        gearing.ratio if gearing else None,
    )
    notes, warnings = (tuple(dict.fromkeys(words)) for words in (record.notes, record.warnings))
    return Measurement(
        trace, gearing, tuple(directions), reversal, lag, notes, warnings, seed, record.torque, tuple(alone)
    )


@dataclass(eq=False)
class _RecordUnderway:
    """A record on its way to results, direction by direction, with the arguments of `measure`.

    trace: without readings that were left out, with its steps, and less the wind-up by a catalogue; torque: None
    without a column; notes and warnings so far.
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
        """Begin without anything left out."""
        load = self.trace.load
        self.torque = None if load is None else RecordedTorque(float(load.mean()), float(load.min()), float(load.max()))
        self.notes, self.warnings = list(self.trace.notes), list[str]()

    def read_in_time(self, alone: Sequence[SweepResult]) -> None:
        """Take the lag between the encoders off the angles of the cam, if both directions as one agree better then.

        A lag moves the error along the angle, one way in each direction, and more at a higher speed. The level tells
        its size; the better agreement tells its sense, and that it is no friction. alone: results of each direction.
        """
        if self.trace.time_s is None or self.gearing is None or len(alone) != _BOTH_WAYS:
            return
        fits = [each.fit for each in sorted(alone, key=lambda each: -each.direction)]
        _, lag = reversal_and_lag(fits, np.empty(0), 0.0, self.trace, self.gearing.ratio)
        if lag is None or abs(lag.ms) <= _LAG_CLEAR * lag.uncertainty_ms:
            return
        as_read = self.trace
        least = self._fitted_once(0).variance
        for lag_s in (lag.ms / 1e3, -lag.ms / 1e3):
            moved = without_lag(as_read, lag_s)
            other = replace(self, trace=moved)._fitted_once(0).variance
            if other < least:
                self.trace, least = moved, other

    def directions(self) -> list[SweepResult]:
        """Results of each direction, that of the greatest F'_ior first. Raises what `measure` does."""
        found = [each for sign in ((0,) if self.together else (1, -1)) if (each := self._result(sign))]
        if not found:
            hint = "F'_ior needs at least one input revolution; check that the angle is the input angle, and its unit"
            raise DataError(f"{self.trace.file}: less than one input revolution in one direction", hint)
        return sorted(found, key=lambda each: -each.range.value)

    def _result(self, sign: int) -> SweepResult | None:
        """Results of a direction, 0 for both as one; None of less than a turn of the cam."""
        own, gearing = self.trace.one_way(sign), self.gearing
        angles = own.by_sweep(own.cam_deg)
        longest = max((float(np.ptp(each)) / 360 * len(each) / (len(each) - 1) for each in angles), default=0.0)
        if longest < _SHORTEST_TURNS - 0.01:
            if own.sweeps:
                way = "growing" if sign > 0 else "falling"
                self.notes.append(f"{way} angles omitted: they cover only {longest:.2g} of an input revolution")
            return None
        fit = self._fitted(sign)
        own, bins = self.trace.one_way(sign), fit.bins
        drift_left, miss = 0.0, None
        # a torque that changes within sweeps but goes with the output's turn changes the beats
        if (torque := self.torque) and torque.is_change([bins.load]):
            if "load" in fit.slopes or not torque.is_change(own.by_sweep(np.asarray(own.load))):
                fit, miss = with_order_changes(fit, self.seed)
            if "load" in fit.slopes and len(fit.blocks) == 1:
                self.warnings.append(_CHANGES_LEFT)
        if not self.together:  # a comparison looks for drift in the difference, and counts lines as noise
            fit, drift_left = _with_lines_or_drift(fit)
            if drift_left and gearing and bins.span >= WHOLE_TURN * gearing.cycle:
                self.warnings.append(_DRIFT_OFF.format(drift_left, float(np.ptp(fit.curve(bins.turns)))))
                fit = fit_orders(bins, fit.orders[~fit.is_line], replace(fit.design.slow, degree=1))
                fit, drift_left = _with_lines_or_drift(fit)
            elif drift_left:
                self.warnings.append(DRIFT_LEFT.format(drift_left))
        if self.M_g is not None and len(fit.blocks) > 1:
            low, _, high = bins.torques
            nearest = min((self.M_g, -self.M_g), key=lambda load: max(low - load, load - high))
            fit = fit.at_torque(min(max(nearest, low), high))
            if miss is None:
                self.warnings.append(_STRAIGHT.format(self.M_g, low, high))
        self._require_ratio(fit)
        found = self._sweep_result(sign, fit, drift_left, miss)
        if not fit.unmodelled < _UNMODELLED * found.range.value:
            size = f"{fit.unmodelled:.2g}″"
            self.warnings.append(f"error beyond the declared orders, {size}: declare more orders, or remove a drift")
        shafts = shaft_components(self.trace.one_way(sign), fit, self.shafts, gearing)
        return replace(found, shafts=shafts)

    def _require_ratio(self, fit: TraceFit) -> None:
        """Raise DataError if the beats of a record show another ratio than that of the drive, or of --ratio."""
        gearing = self.gearing
        if gearing is None or fit.bins.span < _CYCLES_OF_RATIO * gearing.cycle:
            return
        shown = with_lines(fit) if self.together else fit
        other = other_ratio(shown, _declared(self.trace, self.orders, []), gearing.ratio)
        if other is None:
            return
        words = f"{self.trace.file}: the error repeats every {other:.3g} input revolutions, not every {gearing.ratio:g}"
        hint = f"check the file and the ratio; sidebands of such a spacing indicate a ratio of about {other:.0f}"
        raise DataError(words, hint, Fault.FILE_INVALID)

    def _fitted(self, sign: int) -> TraceFit:
        """The fit to a direction, once all is left out and taken off that fits before show."""
        trace = self.trace
        fit = self._fitted_once(sign)
        while self.trace is not trace:
            trace = self.trace
            fit = self._fitted_once(sign)
        return fit

    def _fitted_once(self, sign: int) -> TraceFit:
        """The fit to a direction; another trace takes its place where the fit shows something to leave out."""
        own, ratio = self.trace.one_way(sign), self.gearing.ratio if self.gearing else USUAL_RATIO
        declared = _declared(own, self.orders, self.notes)
        bins, slow = bins_of(own, declared[-1]), SlowTerms(_DRIFTS[self.drift])
        is_travel = bool(self.gearing and self.gearing.travel)
        if is_travel or not self.together:
            slow = slow_terms(bins.span_on_output(ratio), ratio, slow.degree, is_travel=is_travel)
        if own.time_s is not None and not self.together and speed_changes(bins):
            slow = replace(slow, over=("speed",))
        fit = _fit(bins, declared, ratio, slow, self.notes)
        torques, torque = [] if own.load is None else own.by_sweep(own.load), self.torque
        if torque and torque.by != "catalogue" and torque.is_change(torques):
            if tells_compliance(fit):
                wound = _fit(bins, declared, ratio, replace(slow, over=(*slow.over, "load")), self.notes)
                if by_record := torque.fitted(fit, wound, torques):
                    fit, self.torque = wound, by_record
            elif without := torque.by_catalogue(self.trace, self.drive):
                self.trace, self.torque = without
                return fit
            else:
                self.warnings.append(_WIND_UP_LEFT)
        if found := without_spikes(own, fit) or with_step(own, fit):
            changed, words = found
            self.trace = replace(changed, sweeps=tuple(sweeps(changed.cam_deg)))
            self.warnings.append(words)
        return fit

    def _sweep_result(self, sign: int, fit: TraceFit, drift_left: float, torque_miss: float | None) -> SweepResult:
        """The range of a fit with its uncertainty, refused where it is noise and may not be; orders and coverage.

        drift_left: linear drift [arcsec] that the fit has in it; torque_miss: of lines between torques.
        """
        trace, gearing, bins = self.trace.one_way(sign), self.gearing, fit.bins
        places, per_turn = visited_angles(fit)
        visits = None
        if gearing:
            cycle = gearing.cycle * per_turn
            visited = np.unique(np.mod(places, cycle))
            steps = int(np.isin(np.mod(visited + 1, cycle), visited).sum())  # from one visited place to the next
            share, longest = (min(1.0, turns / gearing.cam_turns) for turns in (steps / per_turn, bins.span))
            visits = Coverage(steps / per_turn, share, longest)
            if bins.span_on_output(gearing.ratio) >= WHOLE_TURN * gearing.ratio and not len(fit.lines):
                places = visited
        grid = places / per_turn
        slow = fit.design.drift_at(fit.drift, bins.turns, bins.travel)
        if not fit.design.slow.by_angle:
            slow = curve_of(fit.coefficients[np.tile(fit.is_slow, 2)], fit.orders[fit.is_slow], bins.turns)
        # a drift that was left in may be none at all; one that was taken off may be bent
        drift = abs(drift_left) / 2 if len(fit.drift) != 1 else _BENT * abs(float(fit.drift[0]))
        wind_up = self.torque.uncertainty_arcsec if self.torque and self.torque.by == "catalogue" else 0.0
        drifting = (
            UncertaintySource("drift", drift / sqrt(3), "departure of the drift from a straight line"),
            UncertaintySource(WIND_UP, wind_up, "catalogue stiffnesses by which it was removed"),
        )
        errors_range = float(np.ptp(trace.error_arcsec[trace.rows]))
        misses = [torque_miss] if torque_miss else []
        common = (
            # both extremes of a range err by themselves: hence sqrt(2)
            UncertaintySource(
                "between readings", image_change(fit, grid) / sqrt(2), "orders hidden by evenly spaced readings"
            ),
            UncertaintySource("beyond the orders", sqrt(2) * fit.unmodelled, "residuals correlated from step to step"),
            UncertaintySource("guide rate", trace.scale_uncertainty * errors_range, "guide pulses added back"),
            resolution_source(trace, float(np.sqrt(np.mean(bins.rows * fit.residual**2)))),
            *(
                UncertaintySource("between torques", each / sqrt(12), "curvature of the orders between torques")
                for each in misses
            ),
            *stated_sources(self.stated),
        )
        drifts, others = combined(drifting), combined(common)

        def ranges(own: TraceFit) -> tuple[Range, Range, Range, Range]:
            parts = hypot(drifts, others), hypot(drifts / bins.span, others), others
            is_whole = visits is not None and visits.share >= FULL_SHARE
            return ranges_of(own, grid, np.random.default_rng([self.seed, sign + 1]), parts, whole=is_whole)

        extent, revolution, cam, slope = ranges(fit)
        # both are without their own bias: a part is no more than the whole
        revolution = replace(revolution, bias=max(revolution.bias, revolution.fitted - extent.value))
        torques = bins.torques if len(fit.blocks) > 1 else ()
        at_torques = [(torque, ranges(fit.at_torque(torque))[0]) for torque in torques]
        sources = (
            UncertaintySource("noise", extent.spread, "bootstrap of the residuals"),
            UncertaintySource("bias correction", extent.bias_uncertainty, "a third of the removed bias"),
            *drifting,
            *common,
        )
        if trace.in_time and trace.step_arcsec > _COARSE_STEP * extent.value:
            size = f"{trace.step_arcsec:.2g}″"
            message = f"the output is read in steps of {size} at even angles: what they round looks like error"
            raise UntrustedError(
                f"{trace.file}: {message}", "sample both encoders at constant time intervals", Fault.ORDERS_UNTOLD
            )
        alone = combined([source for source in sources if source.name not in {*STATED, WIND_UP}])
        if not (self.may_be_noise or (fit.clear_of_noise and extent.value > COVERAGE_FACTOR * alone)):
            message = f"F'_ior of {max(extent.value, 0.0):.3g}″ is not above its noise, u = {alone:.3g}″"
            hint = (
                "the recording drifts; use --drift linear"
                if drift_left
                else "record longer or with less noise, and check the column"
            )
            if BY_ORDER in trace.notes:
                hint = f"{BY_ORDER} in arcsec; of a second encoder at the output: --second 2"
            raise UntrustedError(f"{trace.file}: {message}", hint, Fault.ORDERS_UNTOLD)
        rows = trace.rows
        drifted = fit.design.drift_at(fit.drift, trace.cam_deg[rows] / 360, travel_of(trace)[rows])
        at_each = tuple(_TorqueRange(torque, each.value, each.uncertainty) for torque, each in at_torques)
        raw = float(np.ptp(trace.error_arcsec[rows] - drifted))
        orders = order_tables(fit, _declared(trace, self.orders, []), self.drive, gearing)
        found = SweepResult(
            sign, fit, grid, extent, revolution, cam, slope, float(np.ptp(slow)), raw, *orders, visits, sources,
            at_each, torque_miss, trace.is_lower_bound,
        )  # fmt: skip
        if not found.is_bound:
            return found
        span = min(raw, float(np.ptp(trace.error_arcsec[rows])))
        return replace(found, range=extent.at_most(span), revolution=revolution.at_most(span))


def _require_drift(kind: str) -> None:
    """Raise UsageError unless it is a kind of drift that can be taken off."""
    if kind not in _DRIFTS:
        raise UsageError(f"invalid --drift {kind}: expected one of {', '.join(_DRIFTS)}")


def _with_lines_or_drift(fit: TraceFit) -> tuple[TraceFit, float]:
    """A fit with its lines, and the linear drift [arcsec] that it has not taken off."""
    fit = with_lines(fit)
    extent = float(np.ptp(fit.bins.error - fit.residual))
    return fit, 0.0 if len(fit.drift) else drift_of(fit, extent)


def _declared(trace: MeasuredTrace, orders: Sequence[float] | None, notes: list[str]) -> Sequence[float]:
    """Declared orders, refused where the steps of the angle do not resolve them, the default ones cut instead."""
    declared = orders or DEFAULT_ORDERS
    steps = np.concatenate(list(map(np.diff, trace.by_sweep(trace.cam_deg)))) / 360
    highest = 1 / (_STEPS_PER_PERIOD * float(np.quantile(np.abs(steps[steps != 0]), 0.75)))
    if declared[-1] <= highest:
        return declared
    kept = tuple(order for order in declared if order <= highest)
    if orders is not None or not kept:
        message = f"steps of {360 / (_STEPS_PER_PERIOD * highest):.3g}° are too long for order {declared[-1]:g}"
        raise UntrustedError(
            f"{trace.file}: {message}",
            f"use smaller steps, or declare orders up to {highest:.2g} with --orders",
            Fault.ORDERS_UNTOLD,
        )
    notes.append(
        f"orders up to {kept[-1]:g} only: the angle steps do not resolve higher orders, which may appear as lower ones"
    )
    return kept


def _fit(bins: Bins, declared: Sequence[float], ratio: float, slow: SlowTerms, notes: list[str]) -> TraceFit:
    """Fit with as many beats as the record resolves and has bins for, or with none."""
    turns = bins.span if slow.ridge else bins.span_on_output(ratio)
    every = ((beats, order_grid(declared, turns, ratio, slow, beats=beats)) for beats in range(BEATS, -1, -1))
    *grids, (_, without) = {len(orders): (beats, orders) for beats, orders in every}.values()  # each size once
    for beats, orders in grids:
        if len(bins) >= BINS_PER_COLUMN * 2 * (2 * len(orders) + 4):
            with suppress(UntrustedError):
                fit = fit_orders(bins, orders, slow)
                if orders is not grids[0][1]:
                    notes.append(f"{beats} sidebands on each side of an order: too few angles for {BEATS}")
                return fit
    if len(without) < len(declared):
        notes.append(f"orders closer than 1/{turns:.3g} combined: the recording does not resolve them")
    notes.append("sidebands at the output frequency are not resolved and are included in the orders")
    return fit_orders(bins, without, slow)


@dataclass(frozen=True)
class LoggedJoint:
    """A joint of a log of several: its name, the columns of its angle and of its second encoder, and its ratio."""

    name: str
    angle: str
    second: str
    ratio: float

    @classmethod
    def of(cls, text: str) -> LoggedJoint:
        """Read "J1=cam1,out1,100". Raises UsageError: no such text."""
        name, _, columns = text.partition("=")
        parts = columns.rsplit(",", 2)
        if not name or len(parts) != 3 or not all(parts) or not isfinite(number_of(parts[-1])):
            hint = "give the columns of input and output encoder, and the ratio: J1=cam1,out1,100"
            raise UsageError(f"invalid --joint {text}: expected NAME=ANGLE,SECOND,RATIO", hint)
        gearing_of(None, number_of(parts[-1]))
        return cls(name, parts[0], parts[1], number_of(parts[-1]))


@dataclass(frozen=True)
class Reading(ClosedRecord, TraceForm):
    """Form of the file, orders like "1-12", kind of drift and stated uncertainties like "encoder=0.3"."""

    orders: str | None = None
    drift: str = "none"
    budget: tuple[str, ...] = ()

    def require_sound(self) -> None:
        """Raise UsageError for options that cannot be, whatever the file."""
        super().require_sound()
        parse_stated(self.budget)
        parse_orders(self.orders or None)
        _require_drift(self.drift)

    def measured(self, file: str, drive: Drive | None, ratio: float | None = None, **how: Any) -> Measurement:
        """Results of a record of a drive, or of one of a ratio; how: more arguments of `measure`.

        Raises what it and read_trace do; DataError for a torque between those that were recorded.
        """
        found = self.measured_or_bench(file, drive, ratio, **how)
        if isinstance(found, Measurement):
            require_recorded(found.trace, how.get("M_g"))
            if found.trace.is_lower_bound:
                words = "the declination of the guide star is unknown, and with it the size of the error"
                raise DataError(f"{found.trace.file}: {words}", "--declination DEG")
            return found
        words = f"{found.table.file}: approached positions or a torque loop, not a recording of angles and errors"
        raise DataError(
            words, "compute its figures with hdassist measure; pass them to accept with --value NAME=VALUE±U"
        )

    def measured_or_bench(
        self, file: str, drive: Drive | None, ratio: float | None = None, **how: Any
    ) -> Measurement | PositionRecord | LoopRecord:
        """The same of a trace; approached positions and torque loops as they were recorded."""
        table, gearing = read_record(file, self), gearing_of(drive, ratio)
        if record := bench_record(table, self):
            if self.has_pace or how.get("shafts"):
                message = (
                    f"{table.file} contains positions or torque loops, which have no components of shafts and no times"
                )
                raise UsageError(message, "leave out --speed, --period and --shafts")
            return record
        trace = trace_of(table, self, gearing.ratio if gearing else None)
        orders, stated = parse_orders(self.orders or None), parse_stated(self.budget)
        return measure(trace, drive=drive, ratio=ratio, orders=orders, drift=self.drift, stated=stated, **how)
