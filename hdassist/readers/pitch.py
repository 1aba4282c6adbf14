"""Pitch deviations of a wheel, measured on a gear checker, from a file with a row for each tooth.

The deviation of a tooth is where its flank lies against the place it should have, along the pitch circle, up to a
constant for the whole wheel. A file has two columns, tooth number and deviation, and may say in comments:

    # form: cumulative | single   cumulative deviations F_p (default), or single pitch deviations f_pt, that of tooth
                                  k between the teeth k - 1 and k; "index" means the same as "single"
    # unit: um | mm               or in the name of the column; um by default
    # sense: ccw | cw             in which sense the numbers grow, seen from the cam side; ccw by default
    # sign: along | ccw | cw      to where a positive deviation points: along the growing numbers (default), or
                                  to one side whatever the numbering
    # mark: 17                    the tooth that bears the mark; the first one by default
    # flank: left | right

What is read always counts counter-clockwise from the mark, with positive deviations counter-clockwise. A wheel of four
teeth, numbered clockwise, mark on tooth 2:

    # sense: cw
    # mark: 2              read: tooth 2, 1, 4, 3, with the signs turned round: -3, 0, -1, +2
    1; 0                   with "# sign: ccw" the order is the same and the signs stay: +3, 0, +1, -2
    2; 3
    3; -2
    4; 1

(here less the mean). The mean of the deviations has no effect and is taken off.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import PresetError, UsageError
from hdassist.preset.yamltext import in_order
from hdassist.readers.pitchsettings import Settings, settle
from hdassist.readers.table import MAX_BYTES, NumberTable, parse
from hdassist.readers.toothnumbers import rows_by_tooth
from hdassist.textfile import read_bytes

LEAST, MOST = 0.5, 1000.0  # um: range over a wheel that can be meant
CLOSING = 0.2  # of the range: how far the single deviations may be from closing
NOISE = 1e-9  # of the summed deviations: a closing error that is rounding of the sum

Form = Literal["cumulative", "single", "index"]
Sense = Literal["ccw", "cw"]
Sign = Literal["along", "ccw", "cw"]
Flank = Literal["left", "right"]


@dataclass(frozen=True, eq=False)
class PitchFile:
    """Measured pitch deviations of a wheel.

    deviation: cumulative deviations [um] without their mean, shape (teeth,), positive along +theta
    (counter-clockwise, seen from the cam side); element 0 is the tooth with the mark, and teeth follow
    counter-clockwise. mark: the number of that tooth in the file. notes: what was converted or assumed.
    """

    deviation: NDArray[np.float64]
    mark: int
    flank: Flank | None
    file: str
    sha256: str
    notes: tuple[str, ...]


def read_pitch(
    path: str | Path,
    teeth: int,
    *,
    form: Form | None = None,
    sense: Sense | None = None,
    sign: Sign | None = None,
    mark: int | None = None,
    flank: Flank | None = None,
) -> PitchFile:
    """Read the pitch deviations of a wheel; see the module for what a file may say.

    Arguments: path, or "-" for standard input; teeth of the wheel; the others win over what the file says,
    and flank chooses among columns for two flanks.
    Raises DataError: a file that cannot be read; PresetError: every fault of the file; UsageError: a wrong argument.
    """
    asked = {key: str(value) for key, value in _checked(teeth, form, sense, sign, mark, flank).items()}
    data, file = read_bytes(path, MAX_BYTES + 1)
    table = parse(data, file, ("tooth number", "deviation"))
    sound = not table.findings
    notes = table.notes
    settings = settle(table, asked, notes)
    start, order = rows_by_tooth(table, settings.teeth_in, teeth) if sound else (1, [])
    if mark is None and sound:
        _check_mark(table, settings, start, teeth)
    deviation = _deviations(table, settings, order, notes) if not table.findings else np.zeros(teeth)
    if table.findings:
        raise PresetError(in_order(table.findings))
    tooth = start if settings.mark is None else settings.mark
    if not start <= tooth < start + teeth:
        raise UsageError(
            f"mark {tooth} is no tooth of the wheel", f"{file} has the teeth {start} to {start + teeth - 1}"
        )
    deviation = _turned(deviation, settings, tooth - start, notes)
    deviation.setflags(write=False)
    side: Flank | None = "left" if settings.flank == "left" else "right" if settings.flank == "right" else None
    return PitchFile(deviation, tooth, side, file, hashlib.sha256(data).hexdigest(), tuple(notes))


def _checked(
    teeth: int, form: str | None, sense: str | None, sign: str | None, mark: int | None, flank: str | None
) -> dict[str, object]:
    """Arguments that are given, by key."""
    if teeth < 2:
        raise UsageError(f"a wheel has two teeth or more (got {teeth})")
    choices = (
        ("form", form, ("cumulative", "single", "index")),
        ("sense", sense, ("ccw", "cw")),
        ("sign", sign, ("along", "ccw", "cw")),
        ("flank", flank, ("left", "right")),
    )
    for key, value, options in choices:
        if value is not None and value not in options:
            raise UsageError(f"{key} must be one of {', '.join(options)} (got {value})")
    given = {"form": "single" if form == "index" else form, "sense": sense, "sign": sign, "mark": mark, "flank": flank}
    return {key: value for key, value in given.items() if value is not None}


def _check_mark(table: NumberTable, settings: Settings, start: int, teeth: int) -> None:
    """Note a mark that the file puts on no tooth, and one that it does not give."""
    if settings.mark is None:
        table.notes.append(f"no mark given: tooth {start} has it")
    elif not start <= settings.mark < start + teeth:
        message = f"no tooth of the wheel: {start} to {start + teeth - 1}"
        table.add(*settings.mark_at, "mark", message, str(settings.mark), "give the number of the tooth with the mark")


def _deviations(table: NumberTable, settings: Settings, order: list[int], notes: list[str]) -> NDArray[np.float64]:
    """Cumulative deviations [um] in the order of the tooth numbers, with their signs in the file."""
    column, row = settings.deviation_in, table.rows[0]
    place = row.line, row.columns[column], table.name(column)
    values = np.array([table.rows[index].numbers[column] for index in order]) * settings.scale
    if settings.scale != 1:
        notes.append(f"{settings.unit} to um")
    gap = 0.0
    if settings.form == "single":
        gap = float(values.sum())
        values = np.cumsum(values - gap / len(values))
    reach = float(np.ptp(values))
    if abs(gap) > NOISE * float(np.abs(values).sum()):
        if abs(gap) > CLOSING * reach:
            message = (
                f"single pitch deviations do not close: their sum is {gap:.3g} um, their curve spans {reach:.3g} um"
            )
            hint = "is it form cumulative? or rounded too far, or teeth measured in several passes?"
            table.add(*place, message, "", hint)
        else:
            notes.append(f"single pitch deviations summed up, closing error of {gap:.3g} um shared out")
    elif settings.form == "single":
        notes.append("single pitch deviations summed up")
    if reach > MOST:
        hint = "is the unit right, and are these deviations, not places?"
        table.add(*place, f"{reach:.4g} um over the whole wheel", f"unit {settings.unit}", hint)
    elif 0 < reach < LEAST:
        hint = "is it mm?" if settings.unit != "mm" else "is it um? no wheel is that good"
        table.add(*place, f"{reach:.3g} um over the whole wheel", f"unit {settings.unit}", hint)
    return values


def _turned(values: NDArray[np.float64], settings: Settings, first: int, notes: list[str]) -> NDArray[np.float64]:
    """Deviations counter-clockwise from the tooth at index first, positive counter-clockwise, without their mean."""
    values = np.roll(values, -first)
    if settings.sense == "cw":
        values = np.roll(values[::-1], 1)
        notes.append("numbers turned round")
    if (settings.sense if settings.sign == "along" else settings.sign) == "cw":
        values = -values
        notes.append("signs turned round")
    return np.asarray(values - values.mean(), dtype=np.float64)
