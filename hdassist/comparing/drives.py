"""Drives beside the first of them: fields that differ, and the change of F'_ior by each of these."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from operator import add

import numpy as np

from hdassist.belief.samples import EFFECTIVE_SAMPLES
from hdassist.belief.tabled import COARSE_POINTS
from hdassist.comparing.sheet import DriveSheet, sheet_of, sheet_states
from hdassist.error.error_map import GRID, SEARCHED, Batch, error_maps, every_state, searchable
from hdassist.errors import HdassistError, UsageError
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.model.unknown import unknowns
from hdassist.preset.fields import Drive
from hdassist.preset.kinds import UNKNOWN
from hdassist.preset.schema import ResolvedField, resolved_fields
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate

DRAWN_PAIRS = 16  # pairs of drives drawn from the unknown fields
SCREENED_PAIRS = 2  # of them on which every field is tried, before the largest are searched on all
REPORTED_FIELDS = 3
SAME_ERROR = 0.005  # arcsec: a change that is less counts as none
SURE_SHARE = 0.95  # of the pairs that agree: the least for a verdict
# have no bearing on F'_ior at a torque: loads, evidence, limits, the seat's holes, resolution of other answers,
# uncertainties
UNRELATED = (
    "operation.", "catalogue.", "measured.", "acceptance.", "mounting.holes", "mounting.first_hole", "mounting.allowed",
    "numerics.n_phase", "uncertainty.",
)  # fmt: skip

FieldRow = tuple[ResolvedField, ...]  # a field of each drive


@dataclass(frozen=True)
class ErrorChange:
    """Change of F'_ior of a drive [arcsec] where one field is changed, by path, or all together (no path), by torque.

    change_arcsec: median over the drawn pairs, with the least and the greatest; share: of the median of F'_ior before.
    """

    field: str
    change_arcsec: tuple[float, ...]
    least_arcsec: tuple[float, ...]
    greatest_arcsec: tuple[float, ...]
    share: tuple[float, ...]

    @classmethod
    def of(cls, field: str, before: Array, after: Array) -> ErrorChange:
        """The change from F'_ior before to F'_ior after [arcsec], shape (pairs, torques) each."""
        change = after - before
        median = np.median(change, axis=0)
        columns = median, change.min(axis=0), change.max(axis=0), np.abs(median) / np.median(before, axis=0)
        return cls(field, *(tuple(column.tolist()) for column in columns))


@dataclass(frozen=True)
class DriveChanges:
    """Changes of F'_ior from a first drive to a second one.

    pairs: that were drawn; F_ior_is: less, more or the same at each torque, unknown where unknown inputs could
    reverse it; single: fields changed alone, the greatest first; not_alone: paths of those that, alone, make no drive
    that can be computed, or leave more unknown.
    """

    pairs: int
    F_ior_is: tuple[str, ...]
    together: ErrorChange
    single: tuple[ErrorChange, ...]
    not_alone: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class DrivesComparison:
    """Drives beside the first of them.

    sheets, all at the same torques; differing, the fields in which they differ; changes from the first drive to each of
    the others; certificate of all states.
    """

    sheets: tuple[DriveSheet, ...]
    differing: tuple[FieldRow, ...]
    changes: tuple[DriveChanges, ...]
    certificate: Certificate

    @property
    def torques(self) -> tuple[float, ...]:
        """Torques [N*m] of all drives."""
        return self.sheets[0].drive.operation.M_g


def at_common_torques(drives: Sequence[Drive]) -> list[Drive]:
    """Drives at the torques that all of them have, in the order of the first. Raises UsageError: there is none."""
    first, *others = (drive.operation.M_g for drive in drives)
    torques = tuple(M_g for M_g in first if all(M_g in other for other in others))
    if not torques:
        lists = "; ".join(f"{d.name}: {', '.join(f'{M_g:g}' for M_g in d.operation.M_g)} N*m" for d in drives)
        raise UsageError(f"no torque that all presets have ({lists})", "--torque says at which to compare them")
    changed = (drive.operation.model_copy(update={"M_g": torques}) for drive in drives)
    return [drive.model_copy(update={"operation": each}) for drive, each in zip(drives, changed, strict=True)]


def differing_rows(drives: Sequence[Drive]) -> tuple[FieldRow, ...]:
    """Fields in which drives differ, in the order of the declarations; uncertainties of fields behind them."""
    rows = list(zip(*map(resolved_fields, drives), strict=True))
    units = {row[0].path: row[0].unit for row in rows}
    paths = dict.fromkeys(path for drive in drives for path in drive.uncertainty)
    for path in paths:
        values = (drive.uncertainty.get(path) for drive in drives)
        kinds = ((value, "default" if value is None else "given") for value in values)
        name, words = f"uncertainty.{path}", "expanded uncertainty (k = 2)"
        rows.append(tuple(ResolvedField(name, value, units[path], kind, "", words, None) for value, kind in kinds))
    return tuple(row for row in rows if any(cell.value != row[0].value for cell in row))


def differing_fields(drives: Sequence[Drive]) -> list[str]:
    """Paths of the fields in which drives differ and that may move F'_ior at a torque."""
    return [row[0].path for row in differing_rows(drives) if not row[0].path.startswith(UNRELATED)]


def estimate_comparison(drives: Sequence[Drive], draws: int = EFFECTIVE_SAMPLES) -> int:
    """Number of states that a comparison solves, about, for a progress bar."""
    searches = sum(2 + len(differing_fields((drives[0], each))) for each in drives[1:])
    return sum(sheet_states(drive, draws) for drive in drives) + SEARCHED * len(drives[0].operation.M_g) * searches


def compare_drives(drives: Sequence[Drive], *, draws: int = EFFECTIVE_SAMPLES, run: Run = Run()) -> DrivesComparison:
    """Compare two drives or more with the first of them, all at the same torques.

    Argument: draws, of each from its unknown fields. Raises UntrustedError where an answer cannot be trusted,
    KeyboardInterrupt.
    """
    sheets = tuple(sheet_of(drive, draws=draws, run=run) for drive in drives)
    pairs = min(draws, DRAWN_PAIRS)
    compared = [drive_changes(drives[0], other, pairs=pairs, run=run) for other in drives[1:]]
    proofs = [sheet.certificate for sheet in sheets] + [proof for _, proof in compared]
    changes = tuple(
        _as_believed(change, sheets[0], sheet) for (change, _), sheet in zip(compared, sheets[1:], strict=True)
    )
    return DrivesComparison(sheets, differing_rows(drives), changes, reduce(add, proofs))


def drive_changes(
    first: Drive, second: Drive, *, pairs: int = DRAWN_PAIRS, run: Run = Run()
) -> tuple[DriveChanges, Certificate]:
    """Changes of F'_ior from a first drive to a second one at their torques, of all fields and of single ones alone.

    With rolling balls there are no draws: unknown fields are 0. Argument: pairs that are drawn. Raises UntrustedError
    where one of both drives has no answer that can be trusted.
    """
    drawn = searchable(first) and searchable(second)
    before, after = paired_draws((first, second), pairs if drawn else 0, run.seed)
    grid = COARSE_POINTS if len(before) > 1 else GRID
    proof = EMPTY

    def F_ior(batches: Iterable[Batch], *, required: bool = False) -> Iterator[Array]:
        """F'_ior [arcsec] of drives, shape (drives, torques), batch by batch."""
        nonlocal proof
        errors_of = partial(_errors, torques=first.operation.M_g, grid=grid, required=required)
        for values, certificate in run.map(errors_of, batches):
            proof += certificate
            run.solved(certificate.states)
            yield values

    def alone(paths: Iterable[str], count: int) -> dict[str, ErrorChange]:
        """Changes by each of some fields alone over the first pairs, without those that make no drive."""
        moved = {path: _moved(before, after, path).take(np.arange(count)) for path in paths}
        sound = {path: batch for path, batch in moved.items() if _is_sound(batch, before)}
        changed = zip(sound, F_ior(sound.values()), strict=True)
        return {path: ErrorChange.of(path, errors[:count], now) for path, now in changed if not np.isnan(now).any()}

    errors, others = F_ior((before, after), required=True)

    paths = differing_fields((first, second))
    screened = alone(paths, min(len(before), SCREENED_PAIRS))
    chosen = _largest_first(screened.values())[:REPORTED_FIELDS]
    single = alone([change.field for change in chosen], len(before)).values()
    ranged = drawn or not (unknowns(first) or unknowns(second))
    changes = DriveChanges(
        len(before),
        tuple(sense_of_change(change) if ranged else UNKNOWN for change in (others - errors).T),
        ErrorChange.of("", errors, others),
        tuple(_largest_first(single)),
        tuple(path for path in paths if path not in screened),
    )
    return changes, proof


def _as_believed(changes: DriveChanges, first: DriveSheet, other: DriveSheet) -> DriveChanges:
    """Changes, unknown where the medians over all uncertain inputs of both drives move the other way."""
    medians = [[point.F_ior_arcsec for point in sheet.check.points] for sheet in (first, other)]
    signs = {"less": -1, "more": 1}
    senses = (
        UNKNOWN if before and after and (after - before) * signs.get(sense, 0) < 0 else sense
        for sense, before, after in zip(changes.F_ior_is, *medians, strict=True)
    )
    return replace(changes, F_ior_is=tuple(senses))


def sense_of_change(change: Array) -> str:
    """Whether F'_ior gets less, more or stays the same, by changes [arcsec], shape (pairs,); unknown if they differ."""
    if np.all(np.abs(change) < SAME_ERROR):
        return "the same"
    less, more = np.mean(change < 0), np.mean(change > 0)
    return "less" if less >= SURE_SHARE else "more" if more >= SURE_SHARE else UNKNOWN


def _largest_first(changes: Iterable[ErrorChange]) -> list[ErrorChange]:
    return sorted(changes, key=lambda change: -max(change.share))


def paired_draws(drives: Sequence[Drive], count: int, seed: int = 0) -> list[Batch]:
    """Draws from the unknown fields of each of some drives, a field at the same share of its range in all.

    Where all is known, or for a count of 0, each drive as it is.
    """
    open_ = [unknowns(drive) for drive in drives]
    paths = list(dict.fromkeys(unknown.path for own in open_ for unknown in own))
    if not paths or not count:
        return [Batch.of(drive) for drive in drives]
    shares = dict(zip(paths, np.random.default_rng(seed).random((count, len(paths))).T, strict=True))
    drawn = [{u.path: u.low + (u.high - u.low) * shares[u.path] for u in own} for own in open_]
    return [Batch(drive, {**Batch.of(drive, count).columns, **own}) for drive, own in zip(drives, drawn, strict=True)]


def _moved(before: Batch, after: Batch, path: str) -> Batch:
    """Drives of a first batch, each with one field of its drive in a second one."""
    kept = {each: column for each, column in before.columns.items() if each != path}
    drawn = {path: after.columns[path]} if path in after.columns else {}
    return Batch(before.drive.with_values({path: after.drive.value(path)}), kept | drawn)


def drives_of(batch: Batch) -> list[Drive]:
    """Drives of a batch one by one."""
    rows = zip(*(column.tolist() for column in batch.columns.values()), strict=True)
    return [batch.drive.with_values(dict(zip(batch.columns, row, strict=True))) for row in rows]


def _is_sound(moved: Batch, before: Batch) -> bool:
    """Whether no drive has a conflict, or more unknown fields than before (a direction, for example)."""
    drives = zip(drives_of(moved), drives_of(before), strict=False)
    return all(first_conflict(now) is None and len(unknowns(now)) <= len(unknowns(then)) for now, then in drives)


def _errors(batch: Batch, torques: Sequence[float], grid: int, *, required: bool = True) -> tuple[Array, Certificate]:
    """F'_ior of drives [arcsec], shape (drives, torques), with its proof; NaN without an answer, unless required."""
    try:
        if searchable(batch.drive):
            found = [each.many_extremes(batch, grid=grid) for each in error_maps(batch.drive, torques)]
        else:
            found = [every_state(batch.drive, M_g) for M_g in torques]
    except HdassistError:
        if required:
            raise
        return np.full((len(batch), len(torques)), np.nan), EMPTY
    return np.stack([each.F_ior_arcsec for each in found], axis=1), sum((each.certificate for each in found), EMPTY)
