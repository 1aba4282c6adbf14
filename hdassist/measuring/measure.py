"""F'_ior, orders and coverage of a measured trace, each direction by itself, and the options by which it is read.

Slopes are fitted together with the orders: over the speed, a lag between the encoders, and over the torque. A lag times
the speed is an offset that changes sign with the direction and grows with the speed. At an even speed it is part of the
level, and F'_ior has no part of it; friction and play change the level with the direction too. So what
grows with the speed is known only where that changes, within a sweep or from one to another; the rest is lost at the
reversal. Friction that grows with the speed looks like a lag: all of the fitted one may be that.

The wind-up by a torque that changes along a record is taken off, so that F'_ior is that of the mean torque: by the
record itself, where the torque does not go with the orders, as gravity goes with the turn of the output; else by K_1 to
K_3 of the drive's catalogue. There the orders change with the torque too, along straight lines between the least, the
mean and the greatest; a torque that goes with the output's turn changes its beats, and F'_ior is of the curve along it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import hypot, isfinite, sqrt
from typing import Any

import numpy as np

from hdassist.error.stiffness import catalogue_torques
from hdassist.errors import DataError, Fault, HdassistError, UntrustedError, UsageError
from hdassist.files import number_of
from hdassist.measuring.bench import LoopRecord, PositionRecord, bench_record
from hdassist.measuring.fit import (
    BINS_PER_COLUMN,
    COVERAGE_FACTOR,
    Bins,
    SlowTerms,
    TraceFit,
    bins_of,
    curve_of,
    drift_of,
    fit_orders,
    travel_of,
)
from hdassist.measuring.orders import (
    DEFAULT_ORDERS,
    FULL_SHARE,
    STATED,
    USUAL_RATIO,
    WHOLE_TURN,
    WIND_UP,
    Coverage,
    Gearing,
    MeasuredOrder,
    Range,
    UncertaintySource,
    combined,
    gearing_of,
    image_change,
    order_grid,
    order_tables,
    parse_orders,
    parse_stated,
    ranges_of,
    resolution_source,
    slow_terms,
    stated_sources,
    visited_angles,
)
from hdassist.measuring.residuals import with_lines, with_step, without_spikes
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.readers.table import NumberTable
from hdassist.readers.trace import MeasuredTrace, TraceForm, read_record, sweeps, trace_of
from hdassist.readers.words import TURN_ARCSEC
from hdassist.run.kept import ClosedRecord

_LEAST_SPEED_APART = 0.2  # of the greatest speed: between sweeps, from which on a lag is fitted to their levels
_LEAST_SPEED_CHANGE = 0.02  # of the speed: within sweeps, from which on a lag is fitted
_LEAST_CHANGE = 0.01  # of the greatest torque: smaller ones wind up too little to see
_LOAD_APART = 0.1  # of a torque's changes: least part that does not go with orders and slow terms
_TORQUE_CLEAR = 2.0  # times the noise of its readings: spread of a torque that changes
_SLOPE_CLEAR = 3.0  # standard uncertainties: a slope over the torque that is no chance
_CHANGE_TOLD = 3.0  # times the noise of a curve without changes: that at each torque, at most, where a record has them
_CATALOGUE_SHARE = 0.1  # of a wind-up: standard uncertainty of a drive's stiffness by its catalogue; a guess
_CLEAR_SENSE = 0.5  # correlation of error and wind-up
_ARCSEC_PER_RAD = 648000 / np.pi
_DRIFTS = {"none": 0, "linear": 1, "quadratic": 2}
_SHORTEST_TURNS = 1.0  # cam turns
_STEPS_PER_PERIOD = 2.5  # of the angle, in a period of the highest order, at least
DRIFT_LEFT = "linear drift of {:.3g}″ over the record left in (--drift linear), if it is no part of a slow order"
_DRIFT_OFF = (
    "the cycle does not close: linear drift of {:.3g}″ taken off; with it the curve spans {:.1f}″; is the ratio right?"
)
_WIND_UP_LEFT = (
    "the torque goes with the output's turn: its wind-up is left in (--drive PRESET with catalogue.K_1 to K_3)"
)
_CHANGES_LEFT = (
    "the record does not tell how the orders change with the torque, which may be part of F'_ior: "
    "record a sweep at each torque"
)
_BENT = 1 / 4  # of a drift: how far it may depart from a line to either side
_COARSE_STEP = 1 / 4  # of F'_ior: greatest step in time with the turns that the error is resolved from
_UNMODELLED = 1 / 5  # of F'_ior: least error beyond the orders that is reported


@dataclass(frozen=True)
class _EncoderLag:
    """Lag [ms] of the output's reading behind the cam's, and its standard uncertainty."""

    ms: float
    uncertainty_ms: float


def _speed_changes(bins: Bins) -> bool:
    """Whether the speed within the sweeps changes by enough to tell a lag."""
    apart = [speed - np.median(speed) for speed in (bins.speed[bins.sweep == k] for k in range(bins.sweeps))]
    low, high = np.quantile(np.concatenate(apart), (0.05, 0.95))  # a turning point alone tells no lag
    return float(high - low) / 2 > _LEAST_SPEED_CHANGE * float(np.abs(bins.speed).mean())


_ValueAndSpread = tuple[float, float]


def _lost_by_sweeps(fits: Sequence[TraceFit]) -> tuple[_ValueAndSpread, _ValueAndSpread] | None:
    """Parts of the levels of sweeps: lost at the reversal [arcsec], and over the speed [arcsec s/turn].

    Each with its standard uncertainty. None where the sweeps of both directions do not tell them apart, or slopes over
    the speed are fitted within them.
    """
    if any("speed" in fit.slopes or fit.bins.levels != fit.bins.sweeps for fit in fits):
        return None
    level = np.concatenate([fit.level for fit in fits])
    speed = np.concatenate([[f.bins.speed[f.bins.sweep == k].mean() for k in range(f.bins.sweeps)] for f in fits])
    pace = np.abs(speed)
    if len(level) < 3 or not np.ptp(pace) > _LEAST_SPEED_APART * pace.max():
        return None
    from scipy.linalg import block_diag  # 20 ms, which values in holes do without

    precision = np.linalg.pinv(block_diag(*[fit.level_covariance for fit in fits]))
    columns = np.column_stack([np.ones(len(level)), np.sign(speed) / 2, speed])
    covariance = np.linalg.pinv(columns.T @ precision @ columns)
    found = covariance @ columns.T @ precision @ level
    left, freedom = level - columns @ found, len(level) - 3
    spread = np.sqrt(np.diag(covariance) * max(1.0, float(left @ precision @ left) / max(freedom, 1)))
    return (abs(float(found[1])), float(spread[1])), (float(found[2]), float(spread[2]))


def _encoder_lag(
    fits: Sequence[TraceFit], ratio: float, sense: int, over_speed: _ValueAndSpread | None = None
) -> _EncoderLag | None:
    """Lag by the fits of both directions, or by the speeds of their sweeps; None where the speed does not change.

    Arguments: ratio, cam turns per output turn; sense, in which the two encoders count, 0 for a column of errors.
    """
    slopes = [fit.slopes["speed"] for fit in fits if "speed" in fit.slopes]
    slopes += [over_speed] if over_speed else []
    if not slopes:
        return None
    values, spreads = np.array(slopes).T * (1e3 * ratio * (sense or 1) / TURN_ARCSEC)  # ms
    weight = np.maximum(np.abs(spreads), 1e-15) ** -2
    return _EncoderLag(float(np.average(values, weights=weight)), float(weight.sum() ** -0.5))


@dataclass(frozen=True)
class RecordedTorque:
    """Torque of a record [N*m]: its mean, least and greatest, and the wind-up that was taken off.

    by: "record", "catalogue", or empty where none was; wind_up_arcsec: its range; uncertainty_arcsec: standard
    uncertainty of that; stiffness_Nm_rad: by the record, with its standard uncertainty.
    """

    mean_Nm: float
    least_Nm: float
    greatest_Nm: float
    by: str = ""
    wind_up_arcsec: float = 0.0
    uncertainty_arcsec: float = 0.0
    stiffness_Nm_rad: tuple[float, float] | None = None

    @classmethod
    def of(cls, torque: Array) -> RecordedTorque:
        """The torque of rows [N*m] in figures."""
        return cls(float(torque.mean()), float(torque.min()), float(torque.max()))

    def is_change(self, torques: Sequence[Array]) -> bool:
        """Whether it changes within some of its rows [N*m] by enough to matter."""
        least = max(_LEAST_CHANGE * abs(self.least_Nm), _LEAST_CHANGE * abs(self.greatest_Nm))
        is_large = float(max(map(np.ptp, torques))) > max(least, _LOAD_APART * (self.greatest_Nm - self.least_Nm))
        return is_large and any(float(np.std(each)) > _TORQUE_CLEAR * _noise_of(each) for each in torques)

    def fitted(self, slope: float, uncertainty: float) -> RecordedTorque:
        """The same with the slope over the torque that a fit has taken off, and its uncertainty [arcsec/(N*m)]."""
        size, reach = max(abs(slope), 1e-300), self.greatest_Nm - self.least_Nm
        stiffness = _ARCSEC_PER_RAD / size
        own = stiffness, stiffness * uncertainty / size
        return replace(
            self, by="record", wind_up_arcsec=size * reach, uncertainty_arcsec=uncertainty * reach, stiffness_Nm_rad=own
        )

    def by_catalogue(self, trace: MeasuredTrace, drive: Drive | None) -> tuple[MeasuredTrace, RecordedTorque] | None:
        """A trace less the twist by K_1 to K_3 of a drive, towards growing angles where its sense is not clear.

        None without all three.
        """
        stiffness = [drive.catalogue.K_1, drive.catalogue.K_2, drive.catalogue.K_3] if drive else []
        if trace.load is None or drive is None or not all(stiffness):
            return None
        size = np.abs(trace.load)
        T_1, T_2 = catalogue_torques(drive)
        knees = np.array([0.0, T_1, T_2, T_2 + float(size.max())])
        twist = np.cumsum([0.0, *(np.diff(knees) / np.array(stiffness, float))]) * _ARCSEC_PER_RAD
        load = np.sign(trace.load) * np.interp(size, knees, twist)
        sense = -1.0 if float(np.corrcoef(load, trace.error_arcsec)[0, 1]) < -_CLEAR_SENSE else 1.0
        span = float(np.ptp(load))
        found = replace(self, by="catalogue", wind_up_arcsec=span, uncertainty_arcsec=_CATALOGUE_SHARE * span)
        return replace(trace, error_arcsec=trace.error_arcsec - sense * load), found


def _noise_of(torque: Array) -> float:
    """Standard deviation of the noise that rows of a torque [N*m] are read with, by what each differs from the next."""
    return float(np.std(np.diff(torque))) / sqrt(2)


def _tells_compliance(fit: TraceFit) -> bool:
    """Whether the load of a fit's bins has a part that goes neither with its orders nor with its slow terms."""
    load = fit.bins.load
    return float(np.std(fit.design.fitted(load)[1])) > _LOAD_APART * float(np.std(load))


def _with_order_changes(fit: TraceFit, seed: int) -> tuple[TraceFit, float | None]:
    """A fit whose orders change with the torque, where its bins show that they do, and the most that lines miss.

    That is the bend of the curve [arcsec] at the mean torque, by which a straight line misses it there, or a quarter of
    it where there is a line to either side; None where the orders do not change, or the record does not tell a bend.
    """
    bins, miss = fit.bins, None
    for changes in (2, 1):
        with suppress(UntrustedError):
            trial = fit_orders(bins, fit.orders, replace(fit.design.slow, order_changes=changes))
            noise = max(float(np.linalg.norm(trial.at_torque(torque).order_root)) for torque in bins.torques)
            if noise > _CHANGE_TOLD * float(np.linalg.norm(fit.order_root)):
                continue
            last = trial.combined(*[0.0] * changes, 1.0)
            if changes == 2:
                rng = np.random.default_rng([seed, 4])
                bend, *_ = ranges_of(last, np.sort(bins.turns), rng, (0.0, 0.0, 0.0), whole=False)
                miss = bend.interval[1]
            if last.clear_of_noise:
                return trial, miss and miss / changes**2
    return fit, None


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

    @property
    def bins(self) -> Bins:
        """Averages of the readings, to which the fit was made."""
        return self.fit.bins

    @property
    def uncertainty_arcsec(self) -> float:
        """Combined standard uncertainty of F'_ior."""
        return self.range.uncertainty

    @property
    def interval_arcsec(self) -> tuple[float, float]:
        """F'_ior less and plus its expanded uncertainty, k = 2, and above that the rise by lines in another cycle."""
        return self.range.interval

    @property
    def is_part(self) -> bool:
        """Whether the record is part of an output turn, whose slow terms were taken off as a whole."""
        return self.fit.design.slow.by_angle

    @property
    def lines(self) -> tuple[MeasuredOrder, ...]:
        """Lines that are none of the declared orders."""
        return tuple(order for order in self.orders if order.is_line)

    @property
    def is_bound(self) -> bool:
        """Whether F'_ior of the full cycle may be greater, because not all of it was visited."""
        return self.coverage is None or self.coverage.share < FULL_SHARE


@dataclass(frozen=True)
class Reversal:
    """Error in growing minus error in falling direction at the same angles [arcsec]: mean, and greatest departure.

    lost_motion_arcsec: size of the output's stay where the shaft turns back, by play, friction and hysteresis, without
    the part that grows with the speed, where that is known; with its standard uncertainty. by: "speeds within sweeps",
    "speeds of sweeps", or "one speed", where each ms of lag between the encoders is arcsec_per_ms of it (None without
    time stamps, 0 otherwise).
    """

    mean_arcsec: float
    greatest_departure_arcsec: float
    lost_motion_arcsec: float = 0.0
    lost_motion_standard_uncertainty_arcsec: float = 0.0
    arcsec_per_ms: float | None = 0.0
    by: str = "one speed"


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
    lag: _EncoderLag | None
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
        return self.gearing is not None and self.gearing.travel is not None

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
        return self.greatest.range.value


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
) -> Measurement:
    """F'_ior, orders and coverage of a measured trace.

    Arguments: trace; drive or ratio, for cycle, coverage and beats with the output; orders per cam turn, rising, to
    which the error is limited (None: 1 to 12, or as far as the steps of the angle resolve them); drift, none, linear
    or quadratic, to take off; stated, standard uncertainties [arcsec] by source; seed of the bootstrap;
    together, both directions as one, which is then 0; may_be_noise, whether F'_ior need not be clear of its noise;
    travel_deg, of the output: F'_ior is the range of the error there, and slow terms are part of it.
    Raises UsageError: a wrong argument; DataError: less than one cam turn in one direction; UntrustedError: orders that
    the record does not resolve, or an F'_ior that is not clear of its noise.
    """
    _require_drift(drift)
    gearing = gearing_of(drive, ratio)
    gearing = gearing and gearing.within(travel_deg)
    turns_ratio, is_travel = (gearing.ratio, gearing.travel is not None) if gearing else (USUAL_RATIO, False)
    notes, warnings = list(trace.notes), []
    cleaned, directions = trace, []
    torque = None if trace.load is None else RecordedTorque.of(trace.load)
    for sign in (0,) if together else (1, -1):
        own = cleaned.one_way(sign)
        angles = own.by_sweep(own.cam_deg)
        longest = max((float(np.ptp(each)) / 360 * len(each) / (len(each) - 1) for each in angles), default=0.0)
        if longest < _SHORTEST_TURNS - 0.01:
            if own.sweeps:
                notes.append(f"{'growing' if sign > 0 else 'falling'} angles left out: {longest:.2g} of a cam turn")
            continue
        while True:
            own = cleaned.one_way(sign)
            declared = _declared(own, orders, notes)
            bins = bins_of(own, declared[-1])
            slow = SlowTerms(_DRIFTS[drift])
            if is_travel or not together:
                slow = slow_terms(bins.span, turns_ratio, slow.degree, is_travel=is_travel)
            if not together:
                slow = replace(slow, over=("speed",) * (trace.time_s is not None and _speed_changes(bins)))
            fit = _fit(bins, declared, turns_ratio, slow, notes)
            loads = [] if own.load is None else own.by_sweep(own.load)
            if torque and torque.by != "catalogue" and torque.is_change(loads):
                if _tells_compliance(fit):
                    wound = _fit(bins, declared, turns_ratio, replace(slow, over=(*slow.over, "load")), notes)
                    slope, unsure = wound.slopes["load"]
                    if abs(slope) > _SLOPE_CLEAR * unsure:
                        # noise of the torque makes the slope too small, by its share of the variance of the bins' load
                        noise = float(np.mean([_noise_of(each) for each in loads]) ** 2 * np.mean(1 / bins.rows))
                        share = noise / float(np.var(fit.design.fitted(bins.load)[1]))
                        fit, torque = wound, torque.fitted(slope, hypot(unsure, share * slope))
                elif without := torque.by_catalogue(cleaned, drive):
                    cleaned, torque = without
                    continue
                else:
                    warnings.append(_WIND_UP_LEFT)
            found = without_spikes(own, fit) or with_step(own, fit)
            if not found:
                break
            changed, words = found
            cleaned = replace(changed, sweeps=tuple(sweeps(changed.cam_deg)))
            warnings.append(words)
        drift_left, miss = 0.0, None
        # a torque that changes within sweeps but goes with the output's turn changes the beats
        if torque and torque.is_change([bins.load]) and ("load" in fit.slopes or not torque.is_change(loads)):
            fit, miss = _with_order_changes(fit, seed)
            if "load" in fit.slopes and len(fit.blocks) == 1:
                warnings.append(_CHANGES_LEFT)
        if not together:  # a comparison looks for drift in the difference, and counts lines as noise
            fit, drift_left = _with_lines_or_drift(fit)
            if drift_left and gearing and bins.span >= WHOLE_TURN * gearing.cycle:
                warnings.append(_DRIFT_OFF.format(drift_left, float(np.ptp(fit.curve(bins.turns)))))
                fit = fit_orders(bins, fit.orders[~np.isin(fit.orders, fit.lines)], replace(fit.design.slow, degree=1))
                fit, drift_left = _with_lines_or_drift(fit)
            elif drift_left:
                warnings.append(DRIFT_LEFT.format(drift_left))
        wind_up = torque.uncertainty_arcsec if torque and torque.by == "catalogue" else 0.0
        result = _sweep_result(
            sign, own, fit, declared, drift_left, gearing, drive, stated or {}, seed, wind_up, may_be_noise, miss
        )
        if not fit.unmodelled < _UNMODELLED * result.range.value:
            size = f"{fit.unmodelled:.2g}″"
            warnings.append(f"error beyond the declared orders, {size}: declare more of them, or it drifts")
        directions.append(result)
    if not directions:
        hint = "F'_ior is looked for over whole turns; check that the angle is that of the cam, and its unit"
        raise DataError(f"{trace.file}: less than one cam turn in one direction", hint)
    fits = [each.fit for each in directions]
    parts = _lost_by_sweeps(fits) if len(directions) == 2 and trace.time_s is not None else None
    lost, over_speed = parts or (None, None)
    per_ms = None
    if gearing and trace.time_s is not None:
        per_ms = 2e-3 * float(np.mean([np.median(np.abs(f.bins.speed)) for f in fits])) * TURN_ARCSEC / gearing.ratio
    reversal = _reversal(directions[0], directions[1], lost, per_ms) if len(directions) == 2 else None
    lag = _encoder_lag(fits, gearing.ratio, trace.sense, over_speed) if gearing else None
    directions.sort(key=lambda each: -each.range.value)
    notes, warnings = list(dict.fromkeys(notes)), list(dict.fromkeys(warnings))
    alone: tuple[SweepResult, ...] = ()
    if together:
        with suppress(HdassistError):
            alone = measure(
                trace, drive=drive, ratio=None if drive else ratio, orders=orders, drift=drift, stated=stated,
                seed=seed, may_be_noise=True, travel_deg=travel_deg,
            ).directions  # fmt: skip
    answer = Measurement(trace, gearing, tuple(directions), reversal, lag, tuple(notes), tuple(warnings), seed, torque)
    return replace(answer, alone=alone)


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
            f"{trace.file}: {message}", f"up to {highest:.2g} can be declared: --orders", Fault.ORDERS_UNTOLD
        )
    notes.append(f"orders up to {kept[-1]:g} only: the steps of the angle resolve no more")
    return kept


def _fit(bins: Bins, declared: Sequence[float], ratio: float, slow: SlowTerms, notes: list[str]) -> TraceFit:
    """Fit with beats where the record resolves them and has bins enough, else without."""
    with_beats, without = (
        order_grid(declared, bins.span, ratio, beats=beats, slow=not slow.by_angle, is_travel=slow.ridge > 0)
        for beats in (True, False)
    )
    if len(with_beats) > len(without) and len(bins) >= BINS_PER_COLUMN * 2 * (2 * len(with_beats) + 4):
        try:
            return fit_orders(bins, with_beats, slow)
        except UntrustedError:
            pass
    if len(without) < len(declared):
        notes.append(f"orders closer than 1/{bins.span:.3g} joined: the record does not tell them apart")
    notes.append("beats with the output are not resolved: each order stands for them too")
    return fit_orders(bins, without, slow)


def _sweep_result(
    sign: int,
    trace: MeasuredTrace,
    fit: TraceFit,
    declared: Sequence[float],
    drift_left: float,
    gearing: Gearing | None,
    drive: Drive | None,
    stated: Mapping[str, float],
    seed: int,
    wind_up: float,
    may_be_noise: bool,
    torque_miss: float | None,
) -> SweepResult:
    """The range of a fit with its uncertainty, refused where it is noise and may not be; orders and coverage.

    drift_left: linear drift [arcsec] that the fit has in it; wind_up: uncertainty of one taken off by a catalogue;
    torque_miss: of lines between torques.
    """
    bins = fit.bins
    places, per_turn = visited_angles(fit)
    visits = None
    if gearing:
        cycle = gearing.cycle * per_turn
        visited = np.unique(np.mod(places, cycle))
        steps = int(np.isin(np.mod(visited + 1, cycle), visited).sum())  # from one visited place to the next
        visits = Coverage(steps / per_turn, min(1.0, steps / per_turn / gearing.cam_turns))
        if bins.span >= WHOLE_TURN * gearing.ratio and not len(fit.lines):
            places = visited
    grid = places / per_turn
    slow = fit.design.drift_at(fit.drift, bins.turns, bins.travel)
    if not fit.design.slow.by_angle:
        slow = curve_of(fit.coefficients[np.tile(fit.is_slow, 2)], fit.orders[fit.is_slow], bins.turns)
    # a drift that was left in may be none at all; one that was taken off may be bent
    drift = abs(drift_left) / 2 if len(fit.drift) != 1 else _BENT * abs(float(fit.drift[0]))
    drifting = (
        UncertaintySource("drift", drift / sqrt(3), "how straight it is, or whether it is one"),
        UncertaintySource(WIND_UP, wind_up, "stiffnesses of a catalogue, by which it was taken off"),
    )
    misses = [torque_miss] if torque_miss else []
    common = (
        # both extremes of a range err by themselves: hence sqrt(2)
        UncertaintySource("between readings", image_change(fit, grid) / sqrt(2), "orders that even readings hide"),
        UncertaintySource("beyond the orders", sqrt(2) * fit.unmodelled, "residuals that go on from step to step"),
        resolution_source(trace, float(np.sqrt(np.mean(bins.rows * fit.residual**2)))),
        *(UncertaintySource("between torques", each / sqrt(12), "how straight the orders change") for each in misses),
        *stated_sources(stated),
    )
    drifts, others = combined(drifting), combined(common)

    def ranges(own: TraceFit) -> tuple[Range, Range, Range, Range]:
        parts = hypot(drifts, others), hypot(drifts / bins.span, others), others
        is_whole = visits is not None and visits.share >= FULL_SHARE
        return ranges_of(own, grid, np.random.default_rng([seed, sign + 1]), parts, whole=is_whole)

    extent, revolution, cam, slope = ranges(fit)
    torques = bins.torques if len(fit.blocks) > 1 else ()
    at_torques = [(torque, ranges(fit.at_torque(torque))[0]) for torque in torques]
    sources = (
        UncertaintySource("noise", extent.spread, "bootstrap of the residuals"),
        UncertaintySource("bias correction", extent.bias_uncertainty, "a third of what was taken off"),
        *drifting,
        *common,
    )
    if trace.in_time and trace.step_arcsec > _COARSE_STEP * extent.value:
        size = f"{trace.step_arcsec:.2g}″"
        message = f"the output is read in steps of {size} at even angles: what they round looks like error"
        raise UntrustedError(f"{trace.file}: {message}", "read both encoders by the clock", Fault.ORDERS_UNTOLD)
    alone = combined([source for source in sources if source.name not in {*STATED, WIND_UP}])
    if not (may_be_noise or (fit.clear_of_noise and extent.value > COVERAGE_FACTOR * alone)):
        message = f"F'_ior of {max(extent.value, 0.0):.3g}″ is not clear of its noise, u = {alone:.3g}″"
        hint = "it drifts: --drift linear" if drift_left else "record longer or with less noise; check the column"
        raise UntrustedError(f"{trace.file}: {message}", hint, Fault.ORDERS_UNTOLD)
    rows = trace.rows
    drifted = fit.design.drift_at(fit.drift, trace.cam_deg[rows] / 360, travel_of(trace)[rows])
    return SweepResult(
        sign, fit, grid, extent, revolution, cam, slope, float(np.ptp(slow)),
        float(np.ptp(trace.error_arcsec[rows] - drifted)), *order_tables(fit, declared, drive, gearing), visits,
        sources, tuple(_TorqueRange(torque, each.value, each.uncertainty) for torque, each in at_torques), torque_miss,
    )  # fmt: skip


def _reversal(
    up: SweepResult, down: SweepResult, lost: _ValueAndSpread | None, per_ms: float | None
) -> Reversal | None:
    """Difference of the two directions at the angles that both have visited; None if there are none.

    lost: part of the levels by the direction alone, where it is known; per_ms: change by a ms of lag of the
    difference [arcsec], None where that is not known.
    """
    shared = np.intersect1d(np.rint(up.grid_turns * 1e6), np.rint(down.grid_turns * 1e6)) / 1e6
    if not len(shared):
        return None
    above, below = (each.fit.curve(shared) + each.fit.level.mean() for each in (up, down))
    apart = above - below
    mean, departure = float(apart.mean()), float(np.abs(apart - apart.mean()).max())
    if lost:
        return Reversal(mean, departure, *lost, 0.0, "speeds of sweeps")
    drifts = [source.arcsec for each in (up, down) for source in each.sources if source.name == "drift"]
    levels = [sqrt(float(each.fit.level_covariance.mean())) for each in (up, down)]
    unsure = hypot(*levels, *filter(None, drifts))
    if "speed" in up.fit.slopes and "speed" in down.fit.slopes:
        return Reversal(mean, departure, abs(mean), unsure, 0.0, "speeds within sweeps")
    return Reversal(mean, departure, abs(mean), unsure, per_ms, "one speed")


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
            hint = "columns of the cam's and the output's encoder, and the ratio: J1=cam1,out1,100"
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

        Raises what it and read_trace do.
        """
        found = self.measured_or_bench(file, drive, ratio, **how)
        if isinstance(found, Measurement):
            return found
        words = f"{found.table.file}: approached positions or a torque loop, which is no trace"
        raise DataError(words, "hdassist measure has its figures; accept takes them as --value NAME=VALUE±U")

    def measured_or_bench(
        self, file: str, drive: Drive | None, ratio: float | None = None, **how: Any
    ) -> Measurement | PositionRecord | LoopRecord:
        """The same of a trace; approached positions and torque loops as they were recorded."""
        table = read_record(file, self)
        return bench_record(table) or self.of_table(table, drive, ratio, **how)

    def of_table(self, table: NumberTable, drive: Drive | None, ratio: float | None = None, **how: Any) -> Measurement:
        """Results of the trace in a table, of a drive or of one of a ratio; how: more arguments of `measure`."""
        gearing = gearing_of(drive, ratio)
        trace = trace_of(table, self, gearing.ratio if gearing else None)
        orders, stated = parse_orders(self.orders or None), parse_stated(self.budget)
        return measure(trace, drive=drive, ratio=ratio, orders=orders, drift=self.drift, stated=stated, **how)
