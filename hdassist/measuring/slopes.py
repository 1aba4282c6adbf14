"""Slopes beside the orders of a record: over the speed a lag between its encoders, over its torque a wind-up.

A lag times the speed is an offset that changes sign with the direction and grows with the speed. At an even speed it is
part of the level, and F'_ior has no part of it; friction and play change the level with the direction too. So what
grows with the speed is known only where that changes, within a sweep or from one to another; the rest is lost at the
reversal. Friction that grows with the speed looks like a lag: all of the fitted one may be that.

The wind-up by a torque that changes along a record is taken off, so that F'_ior is that of the mean torque: by the
record itself, where the torque does not go with the orders, as gravity goes with the turn of the output; else by K_1 to
K_3 of the drive's catalogue. There the orders change with the torque too, along straight lines between the least, the
mean and the greatest; a torque that goes with the output's turn changes its beats, and F'_ior is of the curve along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import hypot, sqrt

import numpy as np

from hdassist.error.stiffness import catalogue_torques
from hdassist.errors import DataError, Fault, UntrustedError
from hdassist.measuring.fit import TraceFit, fit_orders
from hdassist.measuring.orders import ranges_of
from hdassist.measuring.terms import Bins
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.readers.trace import MeasuredTrace
from hdassist.readers.words import TURN_ARCSEC

_LEAST_SPEED_APART = 0.2  # of the greatest speed: between sweeps, from which on a lag is fitted to their levels
_LEAST_SPEED_CHANGE = 0.02  # of the speed: within sweeps, from which on a lag is fitted
_LEAST_CHANGE = 0.01  # of the greatest torque: smaller ones wind up too little to see
_LOAD_APART = 0.1  # of a torque's changes: least part that does not go with orders and slow terms
_SAME_TORQUE, _SAME_OF_RATED = 0.02, 0.01  # of a torque, and of the rated one: columns that differ so little are at it
_WIDEST_LOAD_GAP = 0.25  # of the torques of a sweep: a torque within a wider gap was not recorded
_TORQUE_CLEAR = 2.0  # times the noise of its readings: spread of a torque that changes
_SPEED_ROWS = 15  # rows that the speed of a row is averaged over
_SLOPE_CLEAR = 3.0  # standard uncertainties: a slope over the torque that is no chance
_CHANGE_TOLD = 3.0  # times the noise of a curve without changes: that at each torque, at most, where a record has them
_CATALOGUE_SHARE = 0.1  # of a wind-up: standard uncertainty of a drive's stiffness by its catalogue; a guess
_CLEAR_SENSE = 0.5  # correlation of error and wind-up
_ARCSEC_PER_RAD = 648000 / np.pi
_ValueAndSpread = tuple[float, float]


@dataclass(frozen=True)
class EncoderLag:
    """Lag [ms] of the output's reading behind the cam's, and its standard uncertainty."""

    ms: float
    uncertainty_ms: float


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


def speed_changes(bins: Bins) -> bool:
    """Whether the speed within the sweeps changes by enough to tell a lag."""
    apart = [speed - np.median(speed) for speed in bins.by_sweep(bins.speed)]
    low, high = np.quantile(np.concatenate(apart), (0.05, 0.95))  # a turning point alone tells no lag
    return float(high - low) / 2 > _LEAST_SPEED_CHANGE * float(np.abs(bins.speed).mean())


def reversal_and_lag(
    fits: Sequence[TraceFit], shared: Array, drift_arcsec: float, trace: MeasuredTrace, ratio: float | None
) -> tuple[Reversal | None, EncoderLag | None]:
    """What is lost where the shaft turns back, and the lag of the output's encoder; None where they are not known.

    Arguments: fits of the directions, growing angles first; shared, angles [turns] that all have visited, shape
    (angles,); drift_arcsec, standard uncertainty by drifts; ratio, cam turns per output turn, None where unknown.
    """
    timed = trace.time_s is not None
    lost, over_speed = (timed and len(fits) == 2 and _lost_by_sweeps(fits)) or (None, None)
    slopes = [fit.slopes["speed"] for fit in fits if "speed" in fit.slopes]
    slopes += [over_speed] if over_speed else []
    reversal, lag = None, None
    if ratio and slopes:
        values, spreads = np.array(slopes).T * (1e3 * ratio * (trace.sense or 1) / TURN_ARCSEC)  # ms
        weight = np.maximum(np.abs(spreads), 1e-15) ** -2
        lag = EncoderLag(float(np.average(values, weights=weight)), float(weight.sum() ** -0.5))
    if len(fits) == 2 and len(shared):
        apart = np.subtract(*(fit.curve(shared) + fit.level.mean() for fit in fits))
        mean, by, per_ms = float(apart.mean()), "one speed", None
        departure = float(np.abs(apart - mean).max())
        unsure = hypot(drift_arcsec, *(sqrt(float(fit.level_covariance.mean())) for fit in fits))
        if lost:
            by, per_ms = "speeds of sweeps", 0.0
        elif all("speed" in fit.slopes for fit in fits):
            by, per_ms = "speeds within sweeps", 0.0
        elif ratio and timed:
            speed = float(np.mean([np.median(np.abs(fit.bins.speed)) for fit in fits]))
            per_ms = 2e-3 * speed * TURN_ARCSEC / ratio
        reversal = Reversal(mean, departure, *(lost or (abs(mean), unsure)), per_ms, by)
    return reversal, lag


def without_lag(trace: MeasuredTrace, lag_s: float) -> MeasuredTrace:
    """Return a trace with time stamps whose angles are those of the cam when the output was read.

    lag_s: time by which the reading of the output is older than that of the cam [s].
    """
    cam_deg = trace.cam_deg.copy()
    for sweep in trace.sweeps:
        speed = np.gradient(trace.cam_deg[sweep.rows], np.asarray(trace.time_s)[sweep.rows])
        around = min(_SPEED_ROWS, len(speed))
        even = np.convolve(speed, np.ones(around), mode="same") / np.convolve(
            np.ones(len(speed)), np.ones(around), "same"
        )
        cam_deg[sweep.rows] -= even * lag_s
    return replace(trace, cam_deg=cam_deg)


def _lost_by_sweeps(fits: Sequence[TraceFit]) -> tuple[_ValueAndSpread, _ValueAndSpread] | None:
    """Return parts of the levels of sweeps: lost at the reversal [arcsec], and over the speed [arcsec s/turn].

    Each has its standard uncertainty. The result is None if the sweeps of both directions do not determine the parts,
    or if slopes over the speed are fitted within the sweeps.
    """
    if any("speed" in fit.slopes or fit.bins.levels != fit.bins.sweeps for fit in fits):
        return None
    level = np.concatenate([fit.level for fit in fits])
    speed = np.array([own.mean() for fit in fits for own in fit.bins.by_sweep(fit.bins.speed)])
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

    def is_change(self, torques: Sequence[Array]) -> bool:
        """Whether it changes within some of its rows [N*m] by enough to matter."""
        least = max(_LEAST_CHANGE * abs(self.least_Nm), _LEAST_CHANGE * abs(self.greatest_Nm))
        is_large = float(max(map(np.ptp, torques))) > max(least, _LOAD_APART * (self.greatest_Nm - self.least_Nm))
        return is_large and any(float(np.std(each)) > _TORQUE_CLEAR * _noise_of(each) for each in torques)

    def fitted(self, fit: TraceFit, wound: TraceFit, torques: Sequence[Array]) -> RecordedTorque | None:
        """The same with the slope over the torque that a fit has taken off; None of a slope that may be chance.

        Arguments: fit without that slope; wound, with it; torques [N*m] of the rows.
        """
        slope, unsure = wound.slopes["load"]
        if abs(slope) <= _SLOPE_CLEAR * unsure:
            return None
        # noise of the torque makes the slope too small, by its share of the variance of the bins' load
        noise = float(np.mean([_noise_of(each) for each in torques]) ** 2 * np.mean(1 / fit.bins.rows))
        unsure = hypot(unsure, slope * noise / float(np.var(fit.design.fitted(fit.bins.load)[1])))
        size, reach = max(abs(slope), 1e-300), self.greatest_Nm - self.least_Nm
        stiffness = _ARCSEC_PER_RAD / size
        own = stiffness, stiffness * unsure / size
        return replace(
            self, by="record", wind_up_arcsec=size * reach, uncertainty_arcsec=unsure * reach, stiffness_Nm_rad=own
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


def at_torque(trace: MeasuredTrace, M_g: float, rated: float = 0.0) -> MeasuredTrace:
    """A trace whose column of torque has a torque M_g [N*m]: its sweeps there, or all around it if it has none there.

    The column may count the other way. rated: torque of the drive [N*m]. A trace without the column stays as it is.
    Raises DataError: the column excludes the torque.
    """
    if trace.load is None:
        return trace
    loads, room = trace.by_sweep(trace.load), max(_SAME_TORQUE * abs(M_g), _SAME_OF_RATED * rated)
    low, high = np.array([np.quantile(load, (0.05, 0.95)) for load in loads]).T
    way = np.array([sweep.direction for sweep in trace.sweeps])
    recorded = np.zeros(len(loads), dtype=bool)
    around = np.zeros(len(loads), dtype=bool)
    for own in (way > 0, way < 0):
        least, greatest = np.min(low, where=own, initial=np.inf), np.max(high, where=own, initial=-np.inf)
        for torque in (M_g, -M_g):
            has_it = own & np.array([_has_torque(load, torque, room) for load in loads])
            is_between = bool(least <= torque <= greatest)
            if has_it.any() or is_between:
                recorded |= has_it
                around |= own & ~has_it.any()
                break
    kept = recorded if recorded.any() else around
    if not kept.any():
        has = dict.fromkeys(_torque_text(load, *ends) for load, *ends in zip(loads, low, high, strict=True))
        words = f"{trace.file}: its column of torque contains {', '.join(has)} N·m, not {M_g:g}"
        hint = f"select a torque of the recording, or record at {M_g:g} N·m; rename a column of another torque"
        raise DataError(words, hint, Fault.FILE_INVALID)
    if not recorded.any():
        trace = replace(trace, is_between_torques=True)
    if kept.all():
        return trace
    every = trace.by_sweep(np.arange(len(trace.line)))
    left = np.setdiff1d(np.arange(len(trace.line)), np.concatenate([every[k] for k in np.flatnonzero(kept)]))
    note = f"sweeps at other torques than {M_g:g} N·m left out: {np.sum(~kept)} of {len(kept)}"
    return replace(trace.without(left), notes=(*trace.notes, note))


def _has_torque(load: Array, torque: float, room: float) -> bool:
    """Return whether a sweep was recorded at a torque: its readings lie on both sides of it, without a wide gap there.

    load: torque of the readings [N*m], shape (rows,); torque [N*m]; room: difference that does not matter [N*m].
    """
    low, high = np.quantile(load, (0.05, 0.95))
    if not low - room <= torque <= high + room:
        return False
    if float(np.abs(load - torque).min()) <= room:
        return True
    gap = float(load[load > torque].min() - load[load < torque].max())
    return gap <= _WIDEST_LOAD_GAP * float(high - low)


def require_recorded(trace: MeasuredTrace, M_g: float | None) -> None:
    """Raise DataError if a torque M_g [N*m] that is asked of a trace lies between those that were recorded."""
    if trace.is_between_torques and M_g is not None:
        words = f"{trace.file}: no recording at {M_g:g} N·m, only below and above it"
        raise DataError(
            words, f"record a sweep at {M_g:g} N·m; between torques the error may not be linear", Fault.FILE_INVALID
        )


def _torque_text(load: Array, low: float, high: float) -> str:
    """Torque of a sweep [N*m], or its least and greatest where it changes."""
    changes = np.std(load) > _TORQUE_CLEAR * _noise_of(load) and high - low > _SAME_TORQUE * abs(load.mean())
    return f"{low:.3g} to {high:.3g}" if changes else f"{load.mean():.3g}"


def tells_compliance(fit: TraceFit) -> bool:
    """Whether the load of a fit's bins has a part that goes neither with its orders nor with its slow terms."""
    load = fit.bins.load
    return float(np.std(fit.design.fitted(load)[1])) > _LOAD_APART * float(np.std(load))


def with_order_changes(fit: TraceFit, seed: int) -> tuple[TraceFit, float | None]:
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
