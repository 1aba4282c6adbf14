"""An archive of measured drives: one file that only grows and that every version of hdassist reads.

Each line is one direction of a record: the drive, how it was measured, and F'_ior with its uncertainty. It is kept work
(run/kept.py) of an owner without a version: each entry has its own beside a schema, and may have fields of a later one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter, ValidationError
from scipy.special import chdtrc

from hdassist import __version__
from hdassist.errors import DataError, UsageError
from hdassist.files import read_bytes
from hdassist.measuring.measure import Measurement, SweepResult
from hdassist.preset.fields import OneLine
from hdassist.report import Json
from hdassist.run.kept import KeptOwner, RecordKind, open_kept, own_schema, read_kept, why_invalid

_ARCHIVE_SCHEMA = "hdassist.archive/1"
ARCHIVE_FILE = "archive.jsonl"
_MAX_ARCHIVE_BYTES = 1_000_000_000
_WRITERS_WAIT = 30.0  # s, for each other
_CHANGED = 0.05  # probability: a spread of less, over all comparisons of a drive together, is a change
_Arcsec = Annotated[float, Field(strict=True, ge=0, le=1e7)]
_CONDITIONS = {
    "hole": "hole",
    "torque": "M_g_Nm",
    "temperature": "temperature_C",
    "date": "date",
    "encoders": "encoders",
}


@dataclass(frozen=True, kw_only=True)
class ArchiveEntry:
    """F'_ior by one direction of a record of a drive, with its uncertainty and the ends of its 95 % interval.

    file, sha256: of the record; F_ior_is_lower_bound: of a part of the cycle; unstated: sources that the uncertainty
    does not have; hole of the seat, torque [N*m], temperature [deg C], encoders, as far as they were stated.
    """

    __pydantic_config__ = ConfigDict(extra="ignore", allow_inf_nan=False)
    schema: Annotated[str, own_schema(_ARCHIVE_SCHEMA)] = _ARCHIVE_SCHEMA
    version: OneLine = __version__
    serial: Annotated[OneLine, Field(min_length=1)]
    date: Annotated[str, AfterValidator(lambda text: date.fromisoformat(text).isoformat())]
    hole: Annotated[str, Field(pattern=r"^h[0-9]{1,4}$")] | None = None
    M_g_Nm: Annotated[float, Field(ge=-1e7, le=1e7)] | None = None
    temperature_C: float | None = None
    encoders: OneLine | None = None
    file: OneLine
    sha256: str
    direction: Literal[1, -1]
    F_ior_arcsec: _Arcsec
    standard_uncertainty_arcsec: Annotated[_Arcsec, Field(ge=1e-9)]
    low_arcsec: _Arcsec
    high_arcsec: _Arcsec
    F_ior_is_lower_bound: bool
    travel_deg: float | None = None
    unstated: tuple[str, ...]
    is_by_model: bool = False  # else F'_ior is the range of the fitted orders, as in entries of earlier versions


_ENTRY = TypeAdapter(ArchiveEntry)
_ENTRIES = RecordKind(_ENTRY, hint="the archive was changed or damaged; restore it from a copy")
OWNER = KeptOwner(
    command="archive",
    version="",
    inputs={},
)


@dataclass(frozen=True)
class DriveHistory:
    """Results of a drive in one hole, at one torque [N*m], the cam turning one way, over whole cycles; by date.

    chi_square of no change, and its probability.
    """

    entries: tuple[ArchiveEntry, ...]
    chi_square: float
    probability: float
    is_changed: bool


def read_conditions(serial: str, texts: Sequence[str]) -> Json:
    """Return fields of an entry from a serial number and texts like "torque=80,hole=h4".

    Raises UsageError for any other text.
    """
    conditions = {"serial": serial}
    for text in ",".join(texts).split(",") if texts else ():
        name, _, value = text.partition("=")
        if name not in _CONDITIONS or not value:
            hint = f"use NAME one of {', '.join(_CONDITIONS)}, for example hole=h4,torque=80,date=2026-03-01"
            raise UsageError(f"invalid --conditions {text}: expected NAME=VALUE", hint)
        conditions[_CONDITIONS[name]] = value
    return conditions


def _fields_of(sweep: SweepResult) -> Json:
    """Return the fields of an entry that follow from one direction of a recording."""
    low_arcsec, high_arcsec = sweep.interval_arcsec
    return {
        "direction": sweep.direction,
        "F_ior_arcsec": sweep.F_ior_arcsec,
        "standard_uncertainty_arcsec": sweep.uncertainty_arcsec,
        "low_arcsec": low_arcsec,
        "high_arcsec": high_arcsec,
        "F_ior_is_lower_bound": sweep.is_bound,
        "unstated": tuple(source.name for source in sweep.sources if source.arcsec is None),
        "is_by_model": sweep.by_model is not None,
    }


def add_to_archive(
    folder: str,
    conditions: Json,
    measurement: Measurement,
) -> bool:
    """Add a recording to the archive of a folder; return whether some of its directions are new.

    An entry of this drive, recording and direction is added once more if its conditions are stated otherwise, or if
    F'_ior comes from the model and did not before: the last one counts.

    conditions: of the recording, as `read_conditions` returns them.
    Raises UsageError for conditions that cannot be, or another file; DataError for an archive that cannot be written,
    or is damaged.
    """
    common = {
        "date": datetime.now(UTC).date().isoformat(),
        "travel_deg": measurement.gearing and measurement.gearing.travel_deg,
        **conditions,
        "file": measurement.trace.file,
        "sha256": measurement.trace.sha256,
    }
    try:
        entries = [_ENTRY.validate_python({**common, **_fields_of(sweep)}) for sweep in measurement.directions]
    except ValidationError as error:
        raise UsageError(f"invalid --serial or --conditions: {why_invalid(error)}") from None
    with suppress(OSError):  # the file's fault is reported
        Path(folder).mkdir()
    with open_kept(str(Path(folder) / ARCHIVE_FILE), OWNER, _ENTRIES, patience=_WRITERS_WAIT) as kept:
        archived = {_identity(entry): entry for entry in kept.records()}
        new_entries = []
        for entry in entries:
            former = archived.get(_identity(entry))
            if former and former.is_by_model == entry.is_by_model:
                entry = replace(former, **{name: getattr(entry, name) for name in conditions})
            if entry not in archived.values():
                new_entries.append(entry)
        kept.append(new_entries)
    return bool(new_entries)


def _identity(entry: ArchiveEntry) -> tuple[str, str, int]:
    """Return what entries of one direction of one recording of a drive have in common."""
    return entry.serial, entry.sha256, entry.direction


def is_cut_off(folder: str) -> bool:
    """Return whether the last line of the archive of a folder was not written to its end: that result is lost."""
    return not (Path(folder) / ARCHIVE_FILE).read_bytes().endswith(b"\n")


def read_archive(folder: str, serial: str) -> list[ArchiveEntry]:
    """Return the entries of a drive in the archive of a folder, by date.

    Raises DataError: no archive, an entry that does not hold, or none of the drive.
    """
    data, name = read_bytes(Path(folder) / ARCHIVE_FILE, _MAX_ARCHIVE_BYTES + 1)
    if len(data) > _MAX_ARCHIVE_BYTES:
        raise DataError(f"{name} is larger than {_MAX_ARCHIVE_BYTES / 1e6:g} MB", "start another archive")
    entries = read_kept(data, name, _ENTRIES) or []
    last = {(entry.sha256, entry.direction): entry for entry in entries if entry.serial == serial}
    if not last:
        serials = ", ".join(sorted({entry.serial for entry in entries})[:10])
        raise DataError(f"{name} has no measurement of {serial}", f"it contains {serials or 'no drive'}")
    return sorted(last.values(), key=lambda entry: entry.date)


def histories(entries: Iterable[ArchiveEntry]) -> tuple[DriveHistory, ...]:
    """Return the changes of a drive by hole, torque and direction, if it was measured over the cycle twice or more.

    F'_ior by the model of the recording is not compared with the range of the fitted orders, which is smaller.
    """
    groups: dict[tuple[str | float | None, ...], list[ArchiveEntry]] = {}
    for entry in entries:
        if not entry.F_ior_is_lower_bound:
            key = (entry.hole, entry.M_g_Nm, entry.travel_deg, entry.direction, entry.is_by_model)
            groups.setdefault(key, []).append(entry)
    repeated = [group for group in groups.values() if len(group) > 1]
    return tuple(_history(group, comparisons=len(repeated)) for group in repeated)


def _history(entries: Sequence[ArchiveEntry], comparisons: int) -> DriveHistory:
    """Return whether results under equal conditions differ by more than their uncertainty.

    comparisons: number of such groups; each has its share of the probability that chance looks like a change.
    """
    y, u = np.array([(entry.F_ior_arcsec, entry.standard_uncertainty_arcsec) for entry in entries]).T
    mean = np.average(y, weights=u**-2)
    chi_square = float((((y - mean) / u) ** 2).sum())
    probability = float(chdtrc(len(entries) - 1, chi_square))
    return DriveHistory(
        entries=tuple(entries),
        chi_square=chi_square,
        probability=probability,
        is_changed=probability < _CHANGED / comparisons,
    )
