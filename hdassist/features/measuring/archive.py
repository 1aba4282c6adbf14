"""An archive of measured drives: an append-only file that every version of hdassist can read.

Each line is the result for one direction of a recording: the drive, the conditions, and F'_ior with its uncertainty.
The file is written through run/kept.py with an owner that has no version. Each entry states its own version and schema,
and may contain fields that a later schema added.
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
from hdassist.drive.preset.fields import OneLine
from hdassist.features.measuring.measure import Measurement, SweepResult
from hdassist.features.report import Json
from hdassist.run.errors import DataError, UsageError
from hdassist.run.files import read_bytes
from hdassist.run.kept import KeptOwner, RecordKind, open_kept, own_schema, read_kept, why_invalid

_ARCHIVE_SCHEMA = "hdassist.archive/1"
ARCHIVE_FILE = "archive.jsonl"
_MAX_ARCHIVE_BYTES = 1_000_000_000
_WRITERS_WAIT = 30.0  # s: longest wait for another process that writes to the archive
_CHANGED = 0.05  # probability, over all comparisons of a drive, below which a spread counts as a change
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
    """F'_ior from one direction of a recording of a drive, with its uncertainty and 95 % interval.

    file, sha256: name and checksum of the recording.
    low_arcsec, high_arcsec: ends of the 95 % interval.
    F_ior_is_lower_bound: whether the recording covers only a part of the cycle.
    unstated: sources of uncertainty that have no value.
    hole, M_g_Nm, temperature_C, encoders: hole of the housing seat, torque [N*m], temperature [deg C] and encoders,
    each None if not stated.
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
    is_by_model: bool = False  # if false, F'_ior is the range of the fitted orders, as in early versions


_ENTRY = TypeAdapter(ArchiveEntry)
_ENTRIES = RecordKind(_ENTRY, hint="restore the archive from a backup, because it was changed or damaged")
OWNER = KeptOwner(
    command="archive",
    version="",
    inputs={},
)


@dataclass(frozen=True)
class DriveHistory:
    """Results of a drive in one hole, at one torque and in one input direction, over full cycles, sorted by date.

    chi_square: statistic of the hypothesis that the drive did not change.
    probability: probability of a chi-square at least as large if the drive did not change.
    """

    entries: tuple[ArchiveEntry, ...]
    chi_square: float
    probability: float
    is_changed: bool


def read_conditions(serial: str, texts: Sequence[str]) -> Json:
    """Return the fields of an entry from a serial number and texts such as "torque=80,hole=h4".

    Raises UsageError if a text does not have this form.
    """
    conditions = {"serial": serial}
    for text in ",".join(texts).split(",") if texts else ():
        name, _, value = text.partition("=")
        if name not in _CONDITIONS or not value:
            hint = f"use the names {', '.join(_CONDITIONS)}; for example hole=h4,torque=80,date=2026-03-01"
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
    """Add a recording to the archive of a folder, and return whether any of its directions are new.

    A new line supersedes an existing entry for the same drive, recording and direction if the stated conditions differ,
    or if only one of the two values of F'_ior comes from the model. The last line for a direction counts.

    folder: path of the folder, which is created if it does not exist.
    conditions: conditions of the recording, as `read_conditions` returns them.
    measurement: results for the recording.
    Raises UsageError for invalid conditions or a file that is not an archive.
    Raises DataError if the archive is damaged or cannot be written.
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
    with suppress(OSError):  # opening the archive reports the error
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
    """Return the key shared by all entries of one direction of one recording of a drive."""
    return entry.serial, entry.sha256, entry.direction


def is_cut_off(folder: str) -> bool:
    """Return whether the last line of the archive is incomplete, in which case that result is lost."""
    return not (Path(folder) / ARCHIVE_FILE).read_bytes().endswith(b"\n")


def read_archive(folder: str, serial: str) -> list[ArchiveEntry]:
    """Return the entries of a drive in the archive of a folder, sorted by date.

    Raises DataError if there is no archive, an entry is invalid, or the drive has no entry.
    """
    data, name = read_bytes(Path(folder) / ARCHIVE_FILE, _MAX_ARCHIVE_BYTES + 1)
    if len(data) > _MAX_ARCHIVE_BYTES:
        raise DataError(
            f"{name} is larger than {_MAX_ARCHIVE_BYTES / 1e6:g} MB", "start a new archive in another folder"
        )
    entries = read_kept(data, name, _ENTRIES) or []
    last = {(entry.sha256, entry.direction): entry for entry in entries if entry.serial == serial}
    if not last:
        serials = ", ".join(sorted({entry.serial for entry in entries})[:10])
        hint = f"use a serial number that it contains: {serials}" if serials else "store measurements with --archive"
        raise DataError(f"{name} contains no measurement of {serial}", hint)
    return sorted(last.values(), key=lambda entry: entry.date)


def histories(entries: Iterable[ArchiveEntry]) -> tuple[DriveHistory, ...]:
    """Return the history of a drive for each hole, torque and direction with at least two full-cycle results.

    F'_ior from the model of the recording is not compared with the range of the fitted orders, which is smaller.
    """
    groups: dict[tuple[str | float | None, ...], list[ArchiveEntry]] = {}
    for entry in entries:
        if not entry.F_ior_is_lower_bound:
            key = (entry.hole, entry.M_g_Nm, entry.travel_deg, entry.direction, entry.is_by_model)
            groups.setdefault(key, []).append(entry)
    repeated = [group for group in groups.values() if len(group) > 1]
    return tuple(_history(group, comparisons=len(repeated)) for group in repeated)


def _history(entries: Sequence[ArchiveEntry], comparisons: int) -> DriveHistory:
    """Return the history of results under equal conditions, and whether they differ by more than their uncertainty.

    comparisons: number of groups that are tested; each gets an equal share of the probability of a false alarm.
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
