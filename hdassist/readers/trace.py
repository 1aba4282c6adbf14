"""Measured traces: the error of a drive's output against the angle of its cam, from the file of an encoder rig.

A file has a column of angles, of the cam or of the output, and one of errors, or that of a second encoder at the
output; then the error is output angle - cam angle / ratio, with the sign of the ratio as the encoders count.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import DataError, Finding, PresetError, UsageError
from hdassist.readers.columns import Columns, read_columns
from hdassist.readers.sweeps import AngleError, Sweep, looks_wrapped, sweeps, unwrapped
from hdassist.readers.tracecolumns import Roles, Shaft, TraceForm, roles
from hdassist.textfile import read_bytes

MAX_BYTES = 100_000_000
ARCSEC = 3600.0  # per degree
MOST = 7200.0  # arcsec: range of an error that can be meant
SLIP = 0.02  # of the ratio: how far the two encoders may disagree with it
FEWEST = 20  # rows

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MeasuredTrace:
    """A measured trace in the order of its rows.

    cam_deg, error_arcsec, line: shape (rows,), angle of the cam without wraps, error, line of the file. step_arcsec:
    resolution of the readings, 0 where no step is seen. sweeps: moves in one direction each. sha256: of the
    file as it lies there. angle_of: what the angles were counted at; those of the output were multiplied by the ratio.
    sense: of two encoders, 1 where both count up, -1 where one counts down, 0 for a column of errors.
    notes: what was converted, assumed or left out.
    """

    file: str
    sha256: str
    cam_deg: Array
    error_arcsec: Array
    line: NDArray[np.int64]
    step_arcsec: float
    sweeps: tuple[Sweep, ...]
    notes: tuple[str, ...]
    angle_of: Shaft = "cam"
    sense: int = 0


def read_trace(path: str | Path, form: TraceForm | None = None, ratio: float | None = None) -> MeasuredTrace:
    """Read a measured trace.

    Arguments: path, or "-" for standard input; form, what is asked of the columns; ratio, cam turns per output turn,
    needed for angles of the output and for two encoders. Raises DataError: a file that cannot be read; PresetError:
    every fault of its rows, or the first one of its angles; UsageError: a wrong argument.
    """
    form = form or TraceForm()
    if form.wrap is not None and not (np.isfinite(form.wrap) and form.wrap > 0):
        raise UsageError(f"--wrap must be an angle above 0 deg, not {form.wrap:g}")
    data, file = read_bytes(path, MAX_BYTES + 1)
    table = read_columns(data, file, ("angle", "error"), MAX_BYTES)
    sha256 = hashlib.sha256(data).hexdigest()
    del data
    notes = list(table.notes)
    column = roles(table, form, notes)
    if len(table.lines) < FEWEST:
        raise _fault(table, 0, column.angle, f"{len(table.lines)} rows", f"a trace has {FEWEST} rows or more")
    if ratio is None and (column.angle_of == "output" or column.other_is == "second"):
        raise DataError(
            f"{file}: the ratio is needed to bring output and cam together", "--ratio 100, or --drive PRESET"
        )
    angle = _angle(table, column.angle, column.angle_size, form.wrap, notes)
    cam = angle * (abs(ratio) if ratio and column.angle_of == "output" else 1.0)
    readings = table.values[:, column.other]
    if not np.ptp(readings):
        raise _fault(table, 0, column.other, "a constant column", "is it the column of the error?")
    step = _step(readings) * column.other_size
    if column.other_is == "second":
        error, sense = _second(table, column, form, cam, abs(ratio or 0), notes)
    else:
        error, sense = readings * column.other_size, 0
    try:
        moves = sweeps(cam)
    except AngleError as wrong:
        raise _fault(table, wrong.row, column.angle, wrong.message, wrong.hint) from None
    reach = max((float(np.ptp(error[s.start : s.stop])) for s in moves), default=0.0)
    if reach > MOST:
        row = int(np.abs(error - np.median(error)).argmax())
        message = f"an error that spans {reach / ARCSEC:.3g} deg"
        raise _fault(table, row, column.other, message, "is it the error, and are its unit and the ratio right?")
    left = len(cam) - sum(s.stop - s.start for s in moves)
    if left:
        notes.append(f"left out, short moves to the other side: {left} of {len(cam)} rows")
    return MeasuredTrace(
        file, sha256, cam, np.array(error), table.lines, step, tuple(moves), tuple(notes), column.angle_of, sense
    )


def _angle(table: Columns, column: int, size: float, wrap: float | None, notes: list[str]) -> Array:
    """A column of angles [deg] without wraps."""
    angle = np.asarray(table.values[:, column] * (size / ARCSEC))
    if not np.ptp(angle):
        raise _fault(table, 0, column, "a constant column", "is it the column of the angle?")
    if wrap is None and looks_wrapped(angle):
        wrap = 360.0
        notes.append(f'"{table.name(column)}" begins again after 360 deg: joined')
    if wrap is None:
        return angle
    try:
        return unwrapped(angle, wrap)
    except AngleError as wrong:
        raise _fault(table, wrong.row, column, wrong.message, wrong.hint) from None


def _second(
    table: Columns, column: Roles, form: TraceForm, cam: Array, ratio: float, notes: list[str]
) -> tuple[Array, int]:
    """Error [arcsec] out of the angles of two encoders, and the sense in which they count."""
    output = _angle(table, column.other, column.other_size, form.wrap, notes)
    centred = cam - cam.mean()
    slope = float(centred @ output / (centred @ centred))
    if np.ptp(cam) >= 360 and abs(abs(slope) * ratio - 1) > SLIP:
        found = f"the cam turns {1 / abs(slope):.5g} times as far" if slope else "the output does not turn"
        hint = "are the units, the ratio and the columns right?"
        raise _fault(table, 0, column.other, f"{found}, the ratio is {ratio:g}", hint)
    sense = 1 if slope > 0 else -1
    notes.append(f"error = output - cam/ratio, ratio {sense * ratio:+g}: as the two encoders count")
    error = (output - output[0] - sense * (cam - cam[0]) / ratio) * ARCSEC
    return np.asarray(error), sense


def _step(readings: Array) -> float:
    """Resolution of readings that repeat themselves and lie on even steps; 0 where no such step is seen."""
    levels = np.unique(readings)
    apart = np.diff(levels)
    apart = apart[apart > 1e-9 * (np.abs(readings).max() + np.ptp(readings))]
    if 2 * len(levels) > len(readings) or not len(apart):
        return 0.0
    step = float(apart.min())
    return step if np.abs(apart / step - np.rint(apart / step)).max() < 0.01 else 0.0


def _fault(table: Columns, row: int, column: int, message: str, hint: str) -> PresetError:
    return PresetError([Finding(table.file, int(table.lines[row]), 1, table.name(column), message, hint=hint)])
