"""Changes of F'_ior from one drive to another: of all fields together, and of each field that differs alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hdassist.comparing.fields import FieldDifference
from hdassist.error.error_map import extremes_of, searchable
from hdassist.errors import HdassistError
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.model.unknown import listed, unknowns
from hdassist.preset.fields import Drive
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.window import in_wide_enough_window

DRAWN_PAIRS = 16  # pairs of drives drawn from what is not known
SCREENED_PAIRS = 2  # of them on which every field is tried, before the largest are searched on all
REPORTED_FIELDS = 3


@dataclass(frozen=True, eq=False)
class ErrorChange:
    """Change of F'_ior of a drive where one field is changed, by path, or all of them together (no path).

    change_arcsec: shape (pairs, torques), one pair where all is known; F_ior_arcsec: before the change, same shape.
    """

    path: str
    change_arcsec: Array
    F_ior_arcsec: Array

    @property
    def median_arcsec(self) -> Array:
        """Median of the change over the pairs, shape (torques,)."""
        return np.asarray(np.median(self.change_arcsec, axis=0))

    @property
    def share(self) -> float:
        """Its size as a share of F'_ior before, at the torque where that is greatest."""
        return float(np.max(np.abs(self.median_arcsec) / np.median(self.F_ior_arcsec, axis=0)))


@dataclass(frozen=True, eq=False)
class DriveChanges:
    """Changes of F'_ior from a first drive to a second one at some torques.

    whole: all fields together; single: fields changed alone, the greatest first; impossible: paths of those that,
    alone, make no drive that can be computed, or leave more unknown; certificate of all states.
    """

    whole: ErrorChange
    single: tuple[ErrorChange, ...]
    impossible: tuple[str, ...]
    certificate: Certificate


def drive_changes(
    first: Drive,
    second: Drive,
    torques: Sequence[float],
    fields: Sequence[FieldDifference] = (),
    *,
    pairs: int = DRAWN_PAIRS,
    run: Run = Run(),
) -> DriveChanges:
    """Changes of F'_ior from a first drive to a second one at torques [N*m], of all fields and of some alone.

    With rolling balls there are no draws: what is not known is 0. Arguments: fields to change alone; pairs that are
    drawn. Raises UntrustedError where one of both drives has no answer that can be trusted.
    """
    pairs = pairs if searchable(first) and searchable(second) else 0
    before, after = paired_draws((first, second), pairs, run.seed)
    search = _Search(tuple(torques), run)
    errors = search.F_ior(before, required=True)  # (pairs, torques)
    whole = ErrorChange("", search.F_ior(after, required=True) - errors, errors)

    def alone(path: str, count: int) -> ErrorChange | None:
        moved = [one.with_values({path: other.value(path)}) for one, other in zip(before, after, strict=True)][:count]
        if not all(map(_is_drive, moved, before)):
            return None
        found = search.F_ior(moved)
        return None if np.isnan(found).any() else ErrorChange(path, found - errors[:count], errors[:count])

    screened = [change for field in fields if (change := alone(field.path, SCREENED_PAIRS))]
    chosen = sorted(screened, key=lambda change: -change.share)[:REPORTED_FIELDS]
    single = chosen
    if len(before) > SCREENED_PAIRS:
        single = [change for each in chosen if (change := alone(each.path, len(before)))]
    single.sort(key=lambda change: -change.share)
    failed = {change.path for change in chosen} - {change.path for change in single}
    possible = {change.path for change in screened} - failed
    impossible = tuple(field.path for field in fields if field.path not in possible)
    return DriveChanges(whole, tuple(single), impossible, search.certificate)


def paired_draws(drives: Sequence[Drive], count: int, seed: int = 0) -> list[list[Drive]]:
    """Draws from what is not known of each of some drives, a field at the same share of its range in all.

    Where all is known, or for a count of 0, each drive as it is.
    """
    open_ = [{unknown.path: unknown for unknown in unknowns(drive)} for drive in drives]
    paths = list(dict.fromkeys(path for own in open_ for path in own))
    if not paths or not count:
        return [[drive] for drive in drives]
    shares = dict(zip(paths, np.random.default_rng(seed).random((count, len(paths))).T, strict=True))
    columns = [{path: u.low + (u.high - u.low) * shares[path] for path, u in own.items()} for own in open_]
    return [listed(drive, own, count) for drive, own in zip(drives, columns, strict=True)]


@dataclass
class _Search:
    """Searches at some torques, and the certificate of all of them."""

    torques: tuple[float, ...]
    run: Run
    certificate: Certificate = EMPTY

    def F_ior(self, drives: Sequence[Drive], *, required: bool = False) -> Array:
        """F'_ior [arcsec] of drives, shape (drives, torques); NaN where one has no answer, unless it is required."""
        tasks = [(drive, M_g, required) for drive in drives for M_g in self.torques]
        values = []
        for value, proof in self.run.map(_F_ior, tasks):
            values.append(value)
            self.certificate += proof
            self.run.solved(proof.states)
        return np.reshape(values, (len(drives), len(self.torques)))


def _is_drive(moved: Drive, before: Drive) -> bool:
    """Whether the fields of a drive go together, and it leaves no more unknown than before: a direction, say."""
    return first_conflict(moved) is None and len(unknowns(moved)) <= len(unknowns(before))


def _F_ior(task: tuple[Drive, float, bool]) -> tuple[float, Certificate]:
    drive, M_g, required = task
    try:
        return in_wide_enough_window(drive, partial(_searched, M_g))
    except HdassistError:
        if required:
            raise
        return np.nan, EMPTY


def _searched(M_g: float, drive: Drive) -> tuple[float, Certificate]:
    (extremes,) = extremes_of(drive, [M_g])
    return extremes.first, extremes.certificate
