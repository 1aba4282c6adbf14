"""Readings of a recording by their positions.

A reading has a position: the input angle phi and the output angle psi, both in revolutions modulo 1. They are two
coordinates of one position on the full cycle, after which both shafts return to their initial angles. With the ratio i
= p/q in lowest terms, the cycle has p input revolutions, and the position t (input revolutions from the start of the
cycle) is

    phi = t mod 1,   psi = t / i mod 1,   0 <= t < p.                                                          (R1)

(R1) does not depend on the sequence of the rows, on wrapping, or on the start of the recording. Three further
properties of a reading matter: its direction of rotation, its run, and its neighbours in time. A
run is continuous and at most one cycle long: sweeps that continue one another in position and time form one run, and a
second pass over the cycle starts a new one. Each run has its own level, because encoders are often zeroed between two
runs.

`ordered_readings` sorts readings into one canonical order, so that equal readings give equal results except for
rounding. It also mirrors backward rotation and negative errors; the posterior restores both.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hdassist.drive.model.geometry import Array
from hdassist.readers.trace import MeasuredTrace
from hdassist.run.errors import DataError

_Indices = NDArray[np.int64]
# largest denominator of the ratio, in output revolutions; longer cycles are not recorded in practice
LARGEST_DENOMINATOR = 20
_FEWEST_READINGS = 20  # minimum number of readings in a recording
_MISFIT_REV = 0.1  # largest disagreement of the two angles of a reading, in input revolutions
_PLACE_DIGITS = 9  # decimal digits of a revolution to which positions are distinguished
_JOINED_STEPS = 3.0  # longest gap within a run, in median steps
_ONE_WAY = 0.9  # smallest share of the steps of a sweep that are in its direction


@dataclass(frozen=True, eq=False)
class Recording:
    """Readings of the error of one drive at one torque, in one direction.

    input_rev: input angle [rev], not necessarily within one revolution, shape (readings,).
    output_rev: output angle [rev], shape (readings,).
    error_arcsec: error [arcsec], shape (readings,).
    sweep: number of the sweep of each reading, shape (readings,).
    time: time stamp of each reading in any unit, or the number of the reading, shape (readings,).
    ratio: input revolutions per output revolution, above 1.
    Raises DataError for arrays of different lengths, values that are not finite, fewer than 20 readings, a constant
    error, a ratio for which the cycle does not close, and angles that contradict the ratio.
    """

    input_rev: Array
    output_rev: Array
    error_arcsec: Array
    sweep: _Indices
    time: Array
    ratio: float

    def __post_init__(self) -> None:
        columns = (self.input_rev, self.output_rev, self.error_arcsec, self.sweep, self.time)
        rows = len(self.error_arcsec)
        if any(np.shape(column) != (rows,) for column in columns):
            raise DataError("the columns of the recording have different lengths", "give one value for each reading")
        if not all(np.isfinite(column).all() for column in columns):
            raise DataError("the recording contains values that are not finite", "remove these readings")
        if rows < _FEWEST_READINGS:
            raise DataError(
                f"the recording contains only {rows} readings",
                f"record at least {_FEWEST_READINGS} readings",
            )
        if not np.ptp(self.error_arcsec):
            raise DataError("the error is constant", "check the error column")
        if not (np.isfinite(self.ratio) and self.ratio > 1):
            raise DataError(
                f"invalid ratio {self.ratio:g}", "state the input revolutions per output revolution, a number above 1"
            )
        misfit = float(_place_and_misfit(self)[1].max())
        if misfit > _MISFIT_REV:
            message = (
                f"with a ratio of {self.ratio:g}, input and output angles disagree by {misfit:.3g} input revolutions"
            )
            raise DataError(message, "check the ratio and the units of both angles")

    @property
    def cycle(self) -> Fraction:
        """The ratio in lowest terms: input revolutions per cycle over output revolutions per cycle."""
        return cycle_of(self.ratio)


@dataclass(frozen=True, eq=False)
class OrderedReadings:
    """Readings in canonical order: by run, then by position.

    place_rev: position on the cycle [input rev], shape (readings,).
    path_rev: input angle along the run [rev], without a jump where the cycle closes, shape (readings,).
    input_rev, output_rev: angles [rev] from 0 to 1, shape (readings,).
    error_arcsec: error [arcsec], shape (readings,).
    run: number of the run, ascending from 0, shape (readings,).
    elapsed: time within the run, scaled to -1/2 to 1/2, shape (readings,).
    turned: factor by which the angles were multiplied, -1 if the shaft rotated backwards and 1 if not.
    flipped: factor by which the error was multiplied, 1 or -1.
    cycle: ratio in lowest terms.
    """

    place_rev: Array
    path_rev: Array
    input_rev: Array
    output_rev: Array
    error_arcsec: Array
    run: _Indices
    elapsed: Array
    turned: int
    flipped: int
    cycle: Fraction


def cycle_of(ratio: float) -> Fraction:
    """Return a ratio in lowest terms.

    Raises DataError if the cycle does not close within 20 output revolutions.
    """
    fraction = Fraction(ratio).limit_denominator(LARGEST_DENOMINATOR)
    if abs(float(fraction) - ratio) > 1e-9 * ratio:
        message = (
            f"with a ratio of {ratio:.6g}, the mesh does not repeat within {LARGEST_DENOMINATOR} output revolutions"
        )
        raise DataError(message, "state the exact ratio that follows from the numbers of teeth")
    return fraction


def recording_from_columns(
    input_rev: ArrayLike,
    error_arcsec: ArrayLike,
    ratio: float,
    sweep: ArrayLike | None = None,
    time: ArrayLike | None = None,
) -> Recording:
    """Return a recording whose output angle follows from the input angle.

    input_rev: unwrapped input angle [rev], shape (readings,).
    error_arcsec: error [arcsec], shape (readings,).
    ratio: input revolutions per output revolution.
    sweep: number of the sweep, shape (readings,); None for one sweep.
    time: time stamps, shape (readings,); None for the number of the reading.
    Raises DataError under the conditions of `Recording`.
    """
    angle = np.asarray(input_rev, float)
    error = np.asarray(error_arcsec, float)
    sweeps = np.zeros(len(error), np.int64) if sweep is None else np.asarray(sweep, np.int64)
    times = np.arange(len(error), dtype=float) if time is None else np.asarray(time, float)
    return Recording(
        input_rev=angle, output_rev=angle / ratio, error_arcsec=error, sweep=sweeps, time=times, ratio=ratio
    )


def recording_from_trace(trace: MeasuredTrace, ratio: float) -> Recording:
    """Return the readings of the sweeps of a measured recording.

    trace: recording with sweeps in one direction.
    ratio: input revolutions per output revolution.
    Raises DataError for sweeps in both directions, and under the conditions of `Recording`.
    """
    if len({sweep.direction for sweep in trace.sweeps}) > 1:
        raise DataError("the recording has sweeps in both directions", "use only sweeps in one direction")
    rows = trace.rows
    numbers = [np.full(len(sweep), number) for number, sweep in enumerate(trace.sweeps)]
    return recording_from_columns(
        input_rev=trace.cam_deg[rows] / 360.0,
        error_arcsec=trace.error_arcsec[rows],
        ratio=ratio,
        sweep=np.concatenate(numbers),
        time=None if trace.time_s is None else trace.time_s[rows],
    )


def ordered_readings(recording: Recording) -> OrderedReadings:
    """Return the readings of a recording in canonical order.

    Raises DataError for sweeps in both directions.
    """
    cycle = recording.cycle
    length = float(cycle.numerator)
    place = _place_and_misfit(recording)[0]
    sweeps = _sweeps_in_time(recording)
    senses = [_sense(place[rows], length) for rows in sweeps]
    if {1, -1} <= set(senses):
        raise DataError("the recording has sweeps in both directions", "use only sweeps in one direction")
    turned = -1 if -1 in senses else 1
    # rounding gives equal positions equal bits
    place = np.round(np.round(turned * place, _PLACE_DIGITS) % length, _PLACE_DIGITS) % length
    centred = recording.error_arcsec - recording.error_arcsec.mean()
    flipped = -1 if centred[np.argmax(np.abs(centred))] < 0 else 1
    error = flipped * recording.error_arcsec

    joined = _joined(sweeps, senses, place, recording.time, length)
    runs = [run for rows, sense in joined for run in _passes(rows, sense, place, length)]
    sorted_runs = [rows[np.lexsort((error[rows], place[rows]))] for rows in runs]
    sorted_runs.sort(key=lambda rows: (place[rows[0]], len(rows), error[rows[0]]))
    order = np.concatenate(sorted_runs)
    path = np.empty(len(place))
    for rows, sense in joined:
        path[rows] = np.unwrap(place[rows], period=length) if sense else place[rows]
    return OrderedReadings(
        place_rev=place[order],
        path_rev=path[order],
        input_rev=place[order] % 1.0,
        output_rev=place[order] / float(cycle) % 1.0,
        error_arcsec=error[order],
        run=np.repeat(np.arange(len(sorted_runs)), [len(rows) for rows in sorted_runs]),
        elapsed=np.concatenate([_elapsed(recording.time[rows]) for rows in sorted_runs]),
        turned=turned,
        flipped=flipped,
        cycle=cycle,
    )


def _place_and_misfit(recording: Recording) -> tuple[Array, Array]:
    """Return the positions (R1) of readings on the cycle and the disagreement of their angles [input rev].

    The input angle determines in which of the q output revolutions of the cycle a reading lies, as the output angle
    alone does not show it.
    """
    cycle = cycle_of(recording.ratio)
    phi = recording.input_rev % 1.0
    psi = recording.output_rev % 1.0
    candidates = float(cycle) * (psi + np.arange(cycle.denominator)[:, None])
    misfits = np.abs(candidates - phi - np.round(candidates - phi))
    chosen = misfits.argmin(axis=0)
    readings = np.arange(len(phi))
    place = phi + np.round(candidates[chosen, readings] - phi)
    return place % float(cycle.numerator), misfits[chosen, readings]


def _sweeps_in_time(recording: Recording) -> list[_Indices]:
    """Return the rows of each sweep in order of time, with the sweeps in order of their first reading."""
    rows_by_time = np.lexsort((recording.time, recording.sweep))
    borders = np.flatnonzero(np.diff(recording.sweep[rows_by_time])) + 1
    sweeps = np.split(rows_by_time, borders)
    return sorted(sweeps, key=lambda rows: float(recording.time[rows[0]]))


def _sense(place: Array, length: float) -> int:
    """Return 1 if the positions of a sweep ascend along the cycle, -1 if they descend, 0 if they are unordered."""
    steps = np.diff(np.unwrap(place, period=length))
    steps = steps[steps != 0]
    if not len(steps):
        return 0
    ascending = float(np.mean(steps > 0))
    if ascending >= _ONE_WAY:
        return 1
    return -1 if ascending <= 1 - _ONE_WAY else 0


def _joined(
    sweeps: list[_Indices],
    senses: list[int],
    place: Array,
    time: Array,
    length: float,
) -> list[tuple[_Indices, int]]:
    """Return sweeps and their directions, joined if they continue the previous sweep in position and time.

    A pause between sweeps separates two runs, because the encoders may have been zeroed in it.

    place: positions in the forward direction, so that every sweep with a direction ascends.
    """
    joined: list[tuple[_Indices, int]] = []
    for rows, sense in zip(sweeps, senses, strict=True):
        if joined and sense and joined[-1][1]:
            before = joined[-1][0]
            steps = np.diff(np.unwrap(place[np.concatenate([before, rows])], period=length))
            step = float(np.median(np.abs(steps)))
            gap = (place[rows[0]] - place[before[-1]] + step / 2) % length - step / 2
            time_step = float(np.median(np.diff(time[np.concatenate([before, rows])])))
            pause = float(time[rows[0]] - time[before[-1]])
            if gap <= _JOINED_STEPS * step and pause <= _JOINED_STEPS * time_step:
                joined[-1] = (np.concatenate([before, rows]), sense)
                continue
        joined.append((rows, sense))
    return joined


def _passes(
    rows: _Indices,
    sense: int,
    place: Array,
    length: float,
) -> list[_Indices]:
    """Return the rows of each pass over the cycle in a joined sweep."""
    if not sense:
        return [rows]
    progress = np.unwrap(place[rows], period=length)
    number = np.floor((progress - progress[0]) / length + 10.0**-_PLACE_DIGITS).astype(np.int64)
    return [rows[number == chosen] for chosen in np.unique(number)]


def _elapsed(time: Array) -> Array:
    """Return times scaled to -1/2 to 1/2, or zeros if all are equal."""
    span = float(np.ptp(time))
    return (time - time.min()) / span - 0.5 if span else np.zeros(len(time))
