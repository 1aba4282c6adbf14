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
from hdassist.measuring.measure import Measurement
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
OWNER = KeptOwner(command="archive", version="", inputs={})


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
    """Fields of an entry from a serial and texts like "torque=80,hole=h4". Raises UsageError: no such text."""
    found = {"serial": serial}
    for text in (part for each in texts for part in each.split(",")):
        name, _, value = text.partition("=")
        if name not in _CONDITIONS or not value:
            hint = f"use NAME one of {', '.join(_CONDITIONS)}, for example hole=h4,torque=80,date=2026-03-01"
            raise UsageError(f"invalid --conditions {text}: expected NAME=VALUE", hint)
        found[_CONDITIONS[name]] = value
    return found


def add_to_archive(folder: str, conditions: Json, found: Measurement) -> bool:
    """Add a record to the archive of a folder; False where each of its directions is there as one of this drive.

    One that is there is added once more where conditions are stated otherwise, or where F'_ior comes from the model and
    did not: the last one counts.
    Raises UsageError: conditions that cannot be, or another file; DataError: it cannot be written, or does not hold.
    """
    today = datetime.now(UTC).date().isoformat()
    travel = found.gearing and found.gearing.travel_deg
    about = {"date": today, "travel_deg": travel, **conditions, "file": found.trace.file, "sha256": found.trace.sha256}
    try:
        fresh = [
            _ENTRY.validate_python(
                {
                    **about,
                    "direction": each.direction,
                    "F_ior_arcsec": each.F_ior_arcsec,
                    "standard_uncertainty_arcsec": each.uncertainty_arcsec,
                    "low_arcsec": each.interval_arcsec[0],
                    "high_arcsec": each.interval_arcsec[1],
                    "F_ior_is_lower_bound": each.is_bound,
                    "unstated": tuple(source.name for source in each.sources if source.arcsec is None),
                    "is_by_model": each.by_model is not None,
                }
            )
            for each in found.directions
        ]
    except ValidationError as error:
        raise UsageError(f"invalid --serial or --conditions: {why_invalid(error)}") from None
    with suppress(OSError):  # the file's fault is reported
        Path(folder).mkdir()
    with open_kept(str(Path(folder) / ARCHIVE_FILE), OWNER, _ENTRIES, patience=_WRITERS_WAIT) as kept:
        known = {(each.serial, each.sha256, each.direction): each for each in kept.records()}
        for k, each in enumerate(fresh):
            entry = known.get((each.serial, each.sha256, each.direction))
            if entry and entry.is_by_model == each.is_by_model:
                fresh[k] = replace(entry, **{name: getattr(each, name) for name in conditions})
        fresh = [each for each in fresh if each not in known.values()]
        kept.append(fresh)
    return bool(fresh)


def is_cut_off(folder: str) -> bool:
    """Whether the last line of the archive of a folder was not written to its end: that result is lost."""
    return not (Path(folder) / ARCHIVE_FILE).read_bytes().endswith(b"\n")


def read_archive(folder: str, serial: str) -> list[ArchiveEntry]:
    """Entries of a drive in the archive of a folder, by date.

    Raises DataError: no archive, an entry that does not hold, or none of the drive.
    """
    data, name = read_bytes(Path(folder) / ARCHIVE_FILE, _MAX_ARCHIVE_BYTES + 1)
    if len(data) > _MAX_ARCHIVE_BYTES:
        raise DataError(f"{name} is larger than {_MAX_ARCHIVE_BYTES / 1e6:g} MB", "start another archive")
    entries = read_kept(data, name, _ENTRIES) or []
    last = {(each.sha256, each.direction): each for each in entries if each.serial == serial}.values()
    own = sorted(last, key=lambda each: each.date)
    if not own:
        serials = ", ".join(sorted({each.serial for each in entries})[:10])
        raise DataError(f"{name} has no measurement of {serial}", f"it contains {serials or 'no drive'}")
    return own


def histories(entries: Iterable[ArchiveEntry]) -> tuple[DriveHistory, ...]:
    """Changes of a drive by hole, torque and direction, where it was measured over the whole cycle twice or more.

    F'_ior by the model of the recording is not compared with the range of the fitted orders, which is smaller.
    """
    groups: dict[tuple[str | float | None, ...], list[ArchiveEntry]] = {}
    for each in entries:
        if not each.F_ior_is_lower_bound:
            group = (each.hole, each.M_g_Nm, each.travel_deg, each.direction, each.is_by_model)
            groups.setdefault(group, []).append(each)
    compared = [own for own in groups.values() if len(own) > 1]
    found = []
    for own in compared:
        y, u = np.array([(each.F_ior_arcsec, each.standard_uncertainty_arcsec) for each in own]).T
        chi_square = float((((y - np.average(y, weights=u**-2)) / u) ** 2).sum())
        probability = float(chdtrc(len(own) - 1, chi_square))
        found.append(
            DriveHistory(
                entries=tuple(own),
                chi_square=chi_square,
                probability=probability,
                is_changed=probability < _CHANGED / len(compared),
            )
        )
    return tuple(found)
