"""Slopes in addition to the orders of a recording: the encoder lag over the speed, and the wind-up over the torque.

A lag times the speed is an offset that changes sign with the direction and grows with the speed. At a constant speed it
is part of the level and does not affect F'_ior. Friction and backlash also change the level with the direction. The
part that grows with the speed is therefore known only if the speed changes, within a sweep or between sweeps. The
remaining difference is the lost motion at reversal. Friction that grows with the speed looks like a lag, so all of the
fitted lag may be due to friction.

The wind-up by a torque that changes along a recording is removed, so that F'_ior is that at the mean torque. The
recording itself determines the stiffness unless the torque looks like orders, as that of a weight does, which follows
the output angle. For such a torque, the stiffness comes from K_1 to K_3 of the drive's catalogue. If the recording
determines the stiffness, the orders may also change with the torque, linearly between the smallest, the mean and the
largest torque. A torque that follows the output angle changes the
sidebands, and F'_ior is that of the curve at this changing torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.error.stiffness import catalogue_torques
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import Drive
from hdassist.features.measuring.fit import TraceFit, fit_orders
from hdassist.features.measuring.orders import OtherUncertainties, ranges_of
from hdassist.features.measuring.terms import Bins
from hdassist.readers.trace import MeasuredTrace
from hdassist.readers.words import TURN_ARCSEC
from hdassist.run.errors import DataError, Fault, UntrustedError

# Smallest difference of the speeds of sweeps, as a share of the largest speed, at which a lag is fitted to the levels.
_LEAST_SPEED_APART = 0.2
_LEAST_SPEED_CHANGE = 0.02  # smallest relative change of the speed within sweeps at which a lag is fitted
# Smallest relevant change of torque, as a share of the largest torque. Smaller changes cause hardly any wind-up.
_LEAST_CHANGE = 0.01
_LOAD_APART = 0.1  # smallest part of a torque's changes that follows neither orders nor slow terms
_SAME_TORQUE = 0.02  # relative difference up to which a recorded torque counts as the requested one
_SAME_OF_RATED = 0.01  # difference up to which a torque counts as the requested one, as a share of the rated torque
_WIDEST_LOAD_GAP = 0.25  # widest gap around a recorded torque, as a share of the range of the sweep's torques
_TORQUE_CLEAR = 2.0  # smallest spread of a changing torque, as a multiple of the noise of its readings
_SPEED_ROWS = 15  # rows over which the speed is averaged
_SLOPE_CLEAR = 3.0  # number of standard uncertainties from which a slope over the torque is not due to chance
# largest noise of the curve at a torque, as a multiple of the noise without changes, at which changes are fitted
_CHANGE_TOLD = 3.0
_CATALOGUE_SHARE = 0.1  # relative standard uncertainty of a wind-up by catalogue stiffnesses (engineering estimate)
_CLEAR_SENSE = 0.5  # smallest correlation of error and wind-up that determines the sign of the torque
_ARCSEC_PER_RAD = 648000 / np.pi
_ValueAndSpread = tuple[float, float]


@dataclass(frozen=True)
class EncoderLag:
    """The lag of the output reading behind the input reading [ms], and its standard uncertainty."""

    ms: float
    uncertainty_ms: float


@dataclass(frozen=True)
class Reversal:
    """The error in the increasing direction minus that in the decreasing direction at the same angles [arcsec].

    mean_arcsec: mean difference.
    greatest_departure_arcsec: largest departure from the mean.
    lost_motion_arcsec: angle by which the output lags where the shaft reverses, due to backlash, friction and
    hysteresis. The part that grows with the speed is excluded if it is known.
    lost_motion_standard_uncertainty_arcsec: its standard uncertainty.
    arcsec_per_ms: at one speed, lost motion that 1 ms of encoder lag would cause, None if unknown; at several speeds 0.
    by: how the lag was separated: by "speeds within sweeps", by "speeds of sweeps", or not at all at "one speed".
    """

    mean_arcsec: float
    greatest_departure_arcsec: float
    lost_motion_arcsec: float = 0.0
    lost_motion_standard_uncertainty_arcsec: float = 0.0
    arcsec_per_ms: float | None = 0.0
    by: str = "one speed"


def speed_changes(bins: Bins) -> bool:
    """Return whether the speed within the sweeps changes enough to determine a lag."""
    # only changes within sweeps count, because changes between sweeps are evaluated from the levels
    departures = [speed - np.median(speed) for speed in bins.by_sweep(bins.speed)]
    # quantiles exclude turning points, which alone do not determine a lag
    low, high = np.quantile(np.concatenate(departures), (0.05, 0.95))
    return float(high - low) / 2 > _LEAST_SPEED_CHANGE * float(np.abs(bins.speed).mean())


def reversal_and_lag(
    fits: Sequence[TraceFit],
    shared: Array,
    drift_arcsec: float,
    trace: MeasuredTrace,
    ratio: float | None,
) -> tuple[Reversal | None, EncoderLag | None]:
    """Return the lost motion at reversal and the lag of the output encoder, each None if unknown.

    fits: one fit per direction, increasing angles first.
    shared: angles that all directions cover [revolutions], shape (angles,).
    drift_arcsec: standard uncertainty due to drift [arcsec].
    trace: recording of both directions.
    ratio: input revolutions per output revolution, None if it is unknown.
    """
    is_timed = trace.time_s is not None
    # a lag separates the two directions by twice the lag times the speed
    levels = _levels_over_speed(fits) if is_timed and len(fits) == 2 else None
    slopes = [fit.slopes["speed"] for fit in fits if "speed" in fit.slopes]
    if levels:
        slopes.append(levels.over_speed)
    lag = None
    # the slope is that of the output error over the input speed, so the ratio converts it to time
    if ratio and slopes:
        lag = _mean_lag(slopes, 1e3 * ratio * (trace.sense or 1) / TURN_ARCSEC)
    reversal = None
    if len(fits) == 2 and len(shared):
        reversal = _reversal(fits, shared, drift_arcsec, levels)
        # at one speed, lost motion and lag cannot be separated, so the result includes their exchange rate
        if reversal.by == "one speed":
            per_ms = _lost_per_ms(fits, ratio) if ratio and is_timed else None
            reversal = replace(reversal, arcsec_per_ms=per_ms)
    return reversal, lag


def _mean_lag(slopes: Sequence[_ValueAndSpread], ms_per_slope: float) -> EncoderLag:
    """Return the weighted mean of the lags from slopes over the speed [arcsec s/revolution]."""
    values, spreads = np.array(slopes).T * ms_per_slope
    weight = np.maximum(np.abs(spreads), 1e-15) ** -2
    return EncoderLag(float(np.average(values, weights=weight)), float(weight.sum() ** -0.5))


def _reversal(
    fits: Sequence[TraceFit],
    shared: Array,
    drift_arcsec: float,
    levels: _LevelsOverSpeed | None,
) -> Reversal:
    """Return the difference between two directions at shared angles [revolutions], and the lost motion.

    The arguments are those of `reversal_and_lag`.

    levels: parts of the levels of the sweeps, None if they do not determine the lost motion.
    """
    # the levels are part of the lost motion at reversal
    growing, falling = (fit.curve(shared) + fit.level.mean() for fit in fits)
    difference = growing - falling
    mean = float(difference.mean())
    lost_motion = abs(mean)
    # drift between the directions looks like lost motion
    uncertainty = hypot(drift_arcsec, *(sqrt(float(fit.level_covariance.mean())) for fit in fits))
    by = "one speed"
    if levels:
        lost_motion, uncertainty = levels.lost_motion
        by = "speeds of sweeps"
    elif all("speed" in fit.slopes for fit in fits):
        by = "speeds within sweeps"
    return Reversal(
        mean_arcsec=mean,
        greatest_departure_arcsec=float(np.abs(difference - mean).max()),
        lost_motion_arcsec=lost_motion,
        lost_motion_standard_uncertainty_arcsec=uncertainty,
        by=by,
    )


def _lost_per_ms(fits: Sequence[TraceFit], ratio: float) -> float:
    """Return the lost motion that each ms of lag causes at one speed [arcsec/ms]."""
    speed = float(np.mean([np.median(np.abs(fit.bins.speed)) for fit in fits]))
    return 2e-3 * speed * TURN_ARCSEC / ratio


def without_lag(trace: MeasuredTrace, lag_s: float) -> MeasuredTrace:
    """Return a recording with time stamps whose input angles are those at the times of the output readings.

    lag_s: time by which the output reading is older than the input reading [s].
    """
    cam_deg = trace.cam_deg.copy()
    time_s = np.asarray(trace.time_s)
    for sweep in trace.sweeps:
        # the speed is averaged below, because single differences are mostly noise
        speed = np.gradient(trace.cam_deg[sweep.rows], time_s[sweep.rows])
        window = np.ones(min(_SPEED_ROWS, len(speed)))
        rows_in_window = np.convolve(
            np.ones(len(speed)),
            window,
            mode="same",
        )  # fewer rows contribute at the ends of a sweep
        mean_speed = np.convolve(speed, window, mode="same") / rows_in_window
        cam_deg[sweep.rows] -= mean_speed * lag_s
    return replace(trace, cam_deg=cam_deg)


@dataclass(frozen=True)
class _LevelsOverSpeed:
    """Parts of the levels of sweeps, each with its standard uncertainty.

    lost_motion: lost motion at reversal [arcsec].
    over_speed: slope over the speed [arcsec s/revolution].
    """

    lost_motion: _ValueAndSpread
    over_speed: _ValueAndSpread


def _levels_over_speed(fits: Sequence[TraceFit]) -> _LevelsOverSpeed | None:
    """Return the parts of the levels of sweeps from level = mean + lost_motion sign(speed) / 2 + slope speed.

    The result is None if the sweeps of both directions do not determine the parts, or if slopes over the speed are
    fitted within the sweeps.
    """
    # a lag within the sweeps, or steps between levels, explain the differences already
    if any("speed" in fit.slopes or fit.bins.levels != fit.bins.sweeps for fit in fits):
        return None
    level = np.concatenate([fit.level for fit in fits])
    speed = np.array([speeds.mean() for fit in fits for speeds in fit.bins.by_sweep(fit.bins.speed)])
    # three unknowns require three levels and two speeds
    if len(level) < 3 or not np.ptp(np.abs(speed)) > _LEAST_SPEED_APART * np.abs(speed).max():
        return None
    from scipy.linalg import block_diag  # imported here because it takes 20 ms, which measured holes do not need

    precision = np.linalg.pinv(block_diag(*[fit.level_covariance for fit in fits]))
    # the levels of the two directions lie half of the lost motion above and below the mean
    columns = np.column_stack([np.ones(len(level)), np.sign(speed) / 2, speed])
    solution, spread = _weighted_fit(columns, level, precision)
    return _LevelsOverSpeed(
        lost_motion=(abs(float(solution[1])), float(spread[1])),
        over_speed=(float(solution[2]), float(spread[2])),
    )


def _weighted_fit(
    columns: Array,
    values: Array,
    precision: Array,
) -> tuple[Array, Array]:
    """Return the unknowns that fit values best, and their standard uncertainties, each of shape (unknowns,).

    The uncertainty is increased if the values differ from the fit by more than their noise, and never reduced.

    columns: columns of the unknowns, shape (values, unknowns).
    values: values to be fitted, shape (values,).
    precision: inverse of the covariance of the values, shape (values, values).
    """
    covariance = np.linalg.pinv(columns.T @ precision @ columns)
    solution = covariance @ columns.T @ precision @ values
    residual = values - columns @ solution
    freedom = len(values) - columns.shape[1]
    # Birge ratio: levels that scatter by more than their noise increase the uncertainties
    widening = max(1.0, float(residual @ precision @ residual) / max(freedom, 1))
    return solution, np.sqrt(np.diag(covariance) * widening)


@dataclass(frozen=True)
class RecordedTorque:
    """The torque of a recording [N*m], and the wind-up that was removed.

    mean_Nm, least_Nm, greatest_Nm: mean, smallest and largest torque.
    by: source of the stiffness, "record" or "catalogue"; empty if no wind-up was removed.
    wind_up_arcsec: range of the removed wind-up.
    uncertainty_arcsec: standard uncertainty of this range.
    stiffness_Nm_rad: stiffness determined from the recording, with its standard uncertainty.
    """

    mean_Nm: float
    least_Nm: float
    greatest_Nm: float
    by: str = ""
    wind_up_arcsec: float = 0.0
    uncertainty_arcsec: float = 0.0
    stiffness_Nm_rad: tuple[float, float] | None = None

    def is_change(self, torques: Sequence[Array]) -> bool:
        """Return whether the torque changes significantly within some sweeps.

        torques: torques of the rows of each sweep [N*m].
        """
        # limits as shares of the largest torque of the recording
        smallest = max(_LEAST_CHANGE * abs(self.least_Nm), _LEAST_CHANGE * abs(self.greatest_Nm))
        largest_change = float(max(map(np.ptp, torques)))
        is_large = largest_change > max(smallest, _LOAD_APART * (self.greatest_Nm - self.least_Nm))
        return is_large and any(float(np.std(torque)) > _TORQUE_CLEAR * _noise_of(torque) for torque in torques)

    def fitted(
        self,
        fit: TraceFit,
        wound: TraceFit,
        torques: Sequence[Array],
    ) -> RecordedTorque | None:
        """Return the torque with the wind-up and stiffness from a fit, or None if the slope may be due to chance.

        fit: fit without the slope over the torque.
        wound: fit with this slope.
        torques: torques of the rows of each sweep [N*m].
        """
        # the slope of this fit represents the wind-up
        slope, uncertainty = wound.slopes["load"]
        if abs(slope) <= _SLOPE_CLEAR * uncertainty:
            return None
        # noise of the torque makes the slope too small, by its share of the variance of the bins' load
        noise_variance = float(np.mean([_noise_of(torque) for torque in torques]) ** 2 * np.mean(1 / fit.bins.rows))
        load_variance = float(np.var(fit.design.fitted(fit.bins.load)[1]))
        uncertainty = hypot(uncertainty, slope * noise_variance / load_variance)
        size = max(abs(slope), 1e-300)
        span = self.greatest_Nm - self.least_Nm
        # conversion from N*m per arcsec to N*m/rad
        stiffness = _ARCSEC_PER_RAD / size
        return replace(
            self,
            by="record",
            wind_up_arcsec=size * span,
            uncertainty_arcsec=uncertainty * span,
            stiffness_Nm_rad=(stiffness, stiffness * uncertainty / size),
        )

    def by_catalogue(self, trace: MeasuredTrace, drive: Drive | None) -> tuple[MeasuredTrace, RecordedTorque] | None:
        """Return a trace without the twist by K_1 to K_3 of a drive, and the torque; None if one of them is unknown.

        If the sign of the torque is unclear, a positive torque is assumed to increase the error.
        """
        stiffness = [drive.catalogue.K_1, drive.catalogue.K_2, drive.catalogue.K_3] if drive else []
        if trace.load is None or drive is None or not all(stiffness):
            return None
        size = np.abs(trace.load)
        T_1, T_2 = catalogue_torques(drive)
        # the catalogue's curve consists of three straight lines
        knees = np.array([0.0, T_1, T_2, T_2 + float(size.max())])
        twist = np.cumsum([0.0, *(np.diff(knees) / np.array(stiffness, float))]) * _ARCSEC_PER_RAD
        load = np.sign(trace.load) * np.interp(size, knees, twist)
        # the file does not state the sign of the torque
        correlation = float(np.corrcoef(load, trace.error_arcsec)[0, 1])
        sense = -1.0 if correlation < -_CLEAR_SENSE else 1.0
        span = float(np.ptp(load))
        removed = replace(
            self,
            by="catalogue",
            wind_up_arcsec=span,
            uncertainty_arcsec=_CATALOGUE_SHARE * span,
        )
        return replace(trace, error_arcsec=trace.error_arcsec - sense * load), removed


def _noise_of(torque: Array) -> float:
    """Return the standard deviation of the noise of torque readings [N*m], from differences of successive readings."""
    # slow changes cancel in differences
    return float(np.std(np.diff(torque))) / sqrt(2)


def at_torque(
    trace: MeasuredTrace,
    M_g: float,
    rated: float = 0.0,
) -> MeasuredTrace:
    """Return the sweeps of a recording at a torque, or without such sweeps those whose directions span the torque.

    The column of torque may have the opposite sign. A recording without this column is returned unchanged.

    M_g: torque [N*m].
    rated: rated torque of the drive [N*m], 0 if it is unknown.
    Raises DataError if the torque is outside the range of the column.
    """
    if trace.load is None:
        return trace
    loads = trace.by_sweep(trace.load)
    coverage = _torque_coverage(trace, loads, M_g, rated)
    is_recorded = bool(coverage.is_at.any())
    is_kept = coverage.is_at if is_recorded else coverage.is_around
    if not is_kept.any():
        ranges = ", ".join(dict.fromkeys(_torque_text(load) for load in loads))
        message = f"{trace.file}: the torque column contains {ranges} N·m, not {M_g:g} N·m"
        hint = (
            f"select a recorded torque, or record at {M_g:g} N·m; rename the column if it does not "
            "contain the load torque"
        )
        raise DataError(message, hint, Fault.FILE_INVALID)
    if not is_recorded:
        trace = replace(trace, is_between_torques=True)
    if is_kept.all():
        return trace
    rows_of_sweeps = trace.by_sweep(np.arange(len(trace.line)))
    kept_rows = np.concatenate([rows_of_sweeps[number] for number in np.flatnonzero(is_kept)])
    omitted_rows = np.setdiff1d(np.arange(len(trace.line)), kept_rows)
    note = f"{np.sum(~is_kept)} of {len(is_kept)} sweeps omitted, because their torque is not {M_g:g} N·m"
    return replace(trace.without(omitted_rows), notes=(*trace.notes, note))


@dataclass(frozen=True, eq=False)
class _TorqueCoverage:
    """Whether each sweep was recorded at a torque, or at torques around it, both of shape (sweeps,)."""

    is_at: NDArray[np.bool_]
    is_around: NDArray[np.bool_]


def _torque_coverage(
    trace: MeasuredTrace,
    loads: Sequence[Array],
    M_g: float,
    rated: float,
) -> _TorqueCoverage:
    """Return which sweeps of a recording cover a torque, for each direction separately.

    loads: torque of the readings of each sweep [N*m].
    M_g: torque [N*m].
    rated: rated torque of the drive [N*m].
    """
    tolerance = max(_SAME_TORQUE * abs(M_g), _SAME_OF_RATED * rated)
    # single readings beyond the quantiles do not show that a torque was recorded
    low, high = np.array([np.quantile(load, (0.05, 0.95)) for load in loads]).T
    direction = np.array([sweep.direction for sweep in trace.sweeps])
    is_at = np.zeros(len(loads), dtype=bool)
    is_around = np.zeros(len(loads), dtype=bool)
    # each direction must cover the torque on its own
    for is_way in (direction > 0, direction < 0):
        smallest = np.min(
            low,
            where=is_way,
            initial=np.inf,
        )
        largest = np.max(
            high,
            where=is_way,
            initial=-np.inf,
        )
        # some test rigs measure the torque against the motion, so its sign changes with the direction
        for torque in (M_g, -M_g):
            has_torque = is_way & np.array([_has_torque(load, torque, tolerance) for load in loads])
            if has_torque.any() or smallest <= torque <= largest:
                is_at |= has_torque
                is_around |= is_way & ~has_torque.any()
                break
    return _TorqueCoverage(is_at=is_at, is_around=is_around)


def _has_torque(
    load: Array,
    torque: float,
    room: float,
) -> bool:
    """Return whether a sweep was recorded at a torque, with readings on both sides of it and no wide gap around it.

    load: torque of the readings [N*m], shape (rows,).
    torque: torque [N*m].
    room: negligible difference of torque [N*m].
    """
    low, high = np.quantile(load, (0.05, 0.95))
    if not low - room <= torque <= high + room:
        return False
    if float(np.abs(load - torque).min()) <= room:
        return True
    # gap between the nearest readings below and above the torque
    gap = float(load[load > torque].min() - load[load < torque].max())
    return gap <= _WIDEST_LOAD_GAP * float(high - low)


def require_recorded(trace: MeasuredTrace, M_g: float | None) -> None:
    """Raise DataError if a requested torque M_g [N*m] lies between the recorded ones."""
    if trace.is_between_torques and M_g is not None:
        message = f"{trace.file}: the recorded torques lie below and above {M_g:g} N·m, but not near this torque"
        hint = f"record a sweep at {M_g:g} N·m, because the error may not be linear between torques"
        raise DataError(message, hint, Fault.FILE_INVALID)


def _torque_text(load: Array) -> str:
    """Return the torque of a sweep [N*m] as text, or its range without extreme readings if it changes."""
    low, high = np.quantile(load, (0.05, 0.95))
    is_changing = np.std(load) > _TORQUE_CLEAR * _noise_of(load) and high - low > _SAME_TORQUE * abs(load.mean())
    return f"{low:.3g} to {high:.3g}" if is_changing else f"{load.mean():.3g}"


def tells_compliance(fit: TraceFit) -> bool:
    """Return whether the load of a fit's bins has a part that follows neither its orders nor its slow terms."""
    # a torque that follows the output angle, such as that of a weight, looks like orders
    load = fit.bins.load
    _, remainder = fit.design.fitted(load)
    return float(np.std(remainder)) > _LOAD_APART * float(np.std(load))


def with_order_changes(fit: TraceFit, seed: int) -> tuple[TraceFit, float | None]:
    """Return a fit whose orders change with the torque if its bins show this, and the interpolation error [arcsec].

    The interpolation error is an upper bound, from the upper end of the interval of the bend of the curve at the mean
    torque. If the orders change linearly, it is the bend. If they change linearly on either side of the mean torque, it
    is a quarter of the bend. It is None if the orders do not change, or if the recording does not determine a bend.

    fit: fit whose orders do not change.
    seed: seed of the bootstrap.
    """
    miss_arcsec = None
    for changes in (2, 1):
        with suppress(UntrustedError):
            trial = fit_orders(fit.bins, fit.orders, replace(fit.design.slow, order_changes=changes))
            if _noise_at_torques(trial) > _CHANGE_TOLD * float(np.linalg.norm(fit.order_root)):
                continue
            last_change = trial.combined(*np.zeros(changes), 1.0)
            if changes == 2:
                rng = np.random.default_rng([seed, 4])
                turns = np.sort(fit.bins.turns)
                bend = ranges_of(last_change, turns, rng, OtherUncertainties(), whole=False).visited
                miss_arcsec = bend.interval[1]
            if last_change.clear_of_noise:
                return trial, miss_arcsec and miss_arcsec / changes**2
    return fit, None


def _noise_at_torques(fit: TraceFit) -> float:
    """Return the largest noise of the curve at the torques of a recording, relative to that of a single reading."""
    return max(float(np.linalg.norm(fit.at_torque(torque).order_root)) for torque in fit.bins.torques)
