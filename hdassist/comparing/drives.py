"""Drives beside the first of them: fields that differ, and what each of these does to F'_ior."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from hdassist.comparing.sheet import DriveSheet, at_torques, sheet_of, sheet_states
from hdassist.design.check import DRAWS
from hdassist.error.error_map import SEARCHED, extremes_of, searchable
from hdassist.errors import HdassistError, UsageError
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.model.unknown import listed, unknowns
from hdassist.preset.fields import Drive
from hdassist.preset.schema import ResolvedField, resolved
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.window import in_wide_enough_window

DRAWN_PAIRS = 16  # pairs of drives drawn from what is not known
SCREENED_PAIRS = 2  # of them on which every field is tried, before the largest are searched on all
REPORTED_FIELDS = 3
SAME_ERROR = 0.005  # arcsec: a change that is less counts as none
SURE_SHARE = 0.95  # of the pairs that agree: the least for a verdict
# have no bearing on F'_ior at a torque: loads, figures of catalogues, limits, the seat's holes, resolution of other
# answers, uncertainties
UNRELATED = (
    "operation.", "catalogue.", "acceptance.", "mounting.holes", "mounting.first_hole", "mounting.allowed",
    "numerics.n_phase", "uncertainty.",
)  # fmt: skip

FieldRow = tuple[ResolvedField, ...]  # a field of each drive


@dataclass(frozen=True, eq=False)
class ErrorChange:
    """Change of F'_ior of a drive where one field is changed, by path, or all of them together (no path).

    F_ior_arcsec: before the change; change_arcsec; shape (pairs, torques) each, one pair where all is known.
    """

    path: str
    F_ior_arcsec: Array
    change_arcsec: Array

    @property
    def median_arcsec(self) -> Array:
        """Median of the change over the pairs, shape (torques,)."""
        return np.asarray(np.median(self.change_arcsec, axis=0))

    @property
    def share(self) -> Array:
        """Size of the median as a share of that of F'_ior before, shape (torques,)."""
        return np.asarray(np.abs(self.median_arcsec) / np.median(self.F_ior_arcsec, axis=0))


@dataclass(frozen=True, eq=False)
class DriveChanges:
    """Changes of F'_ior from a first drive to a second one at some torques.

    whole: all fields together; single: fields changed alone, the greatest first; impossible: paths of those that,
    alone, make no drive that can be computed, or leave more unknown; ranged: whether what is not known was drawn, or
    all is known; certificate of all states.
    """

    whole: ErrorChange
    single: tuple[ErrorChange, ...]
    impossible: tuple[str, ...]
    ranged: bool
    certificate: Certificate

    def sense(self, torque: int) -> int | None:
        """Whether the second drive has less (-1), more (1) or the same error (0) at a torque, by its place.

        None where what is not known could reverse it, or there is no range over that.
        """
        change = self.whole.change_arcsec[:, torque]
        if self.ranged and np.all(np.abs(change) < SAME_ERROR):
            return 0
        return next((way for way in (-1, 1) if self.ranged and np.mean(way * change > 0) >= SURE_SHARE), None)


@dataclass(frozen=True, eq=False)
class DrivesComparison:
    """Drives beside the first of them: the sheet of each, and the changes from the first one to each of the others."""

    sheets: tuple[DriveSheet, ...]
    changes: tuple[DriveChanges, ...]

    @property
    def drives(self) -> tuple[Drive, ...]:
        """The drives, in the order asked for."""
        return tuple(sheet.drive for sheet in self.sheets)

    @property
    def torques(self) -> tuple[float, ...]:
        """Torques [N*m] at which they are compared."""
        return self.drives[0].operation.M_g

    @property
    def certificate(self) -> Certificate:
        """Worst residuals of all that was solved."""
        proofs = *(sheet.certificate for sheet in self.sheets), *(changes.certificate for changes in self.changes)
        return reduce(add, proofs)


def common_torques(drives: Sequence[Drive]) -> tuple[float, ...]:
    """Torques [N*m] that all drives have, in the order of the first. Raises UsageError where there are none."""
    first, *others = (drive.operation.M_g for drive in drives)
    found = tuple(M_g for M_g in first if all(M_g in other for other in others))
    if not found:
        lists = "; ".join(f"{d.name}: {', '.join(f'{M_g:g}' for M_g in d.operation.M_g)} N*m" for d in drives)
        raise UsageError(f"no torque that all presets have ({lists})", "--torque says at which to compare them")
    return found


def field_rows(drives: Sequence[Drive]) -> list[FieldRow]:
    """Every field of some drives, in the order of the declarations; uncertainties of fields behind them."""
    rows = list(zip(*map(resolved, drives), strict=True))
    units = {row[0].path: row[0].unit for row in rows}
    paths = dict.fromkeys(path for drive in drives for path in drive.uncertainty)
    return rows + [tuple(_uncertainty(drive, path, units[path]) for drive in drives) for path in paths]


def _uncertainty(drive: Drive, path: str, unit: str) -> ResolvedField:
    value = drive.uncertainty.get(path)
    kind = "default" if value is None else "given"
    return ResolvedField(f"uncertainty.{path}", value, unit, kind, "", "expanded uncertainty (k = 2)", None)


def differs(row: FieldRow) -> bool:
    """Whether drives have different values of a field."""
    return any(cell.value != row[0].value for cell in row)


def moving(drives: Sequence[Drive]) -> list[str]:
    """Paths of the fields in which drives differ and that may move F'_ior at a torque."""
    return [row[0].path for row in field_rows(drives) if differs(row) and not row[0].path.startswith(UNRELATED)]


def estimate_comparison(drives: Sequence[Drive], torques: Sequence[float], draws: int = DRAWS) -> int:
    """Number of states that a comparison solves, about, for a progress bar."""
    pairs = min(draws, DRAWN_PAIRS) if any(map(unknowns, drives)) else 1
    searches = sum(2 * pairs + min(pairs, SCREENED_PAIRS) * len(moving((drives[0], each))) for each in drives[1:])
    sheets = sum(sheet_states(at_torques(drive, torques), draws) for drive in drives)
    return sheets + SEARCHED * len(torques) * searches


def compare_drives(
    drives: Sequence[Drive],
    torques: Sequence[float],
    *,
    draws: int = DRAWS,
    run: Run = Run(),
) -> DrivesComparison:
    """Compare drives with the first of them, at torques [N*m].

    Arguments: two drives or more; torques; draws, of each from what is not known.
    Raises UntrustedError where an answer cannot be trusted, KeyboardInterrupt.
    """
    sheets, pairs = (
        tuple(sheet_of(drive, torques=torques, draws=draws, run=run) for drive in drives),
        min(draws, DRAWN_PAIRS),
    )
    return DrivesComparison(
        sheets, tuple(drive_changes(drives[0], each, torques, pairs=pairs, run=run) for each in drives[1:])
    )


def drive_changes(
    first: Drive,
    second: Drive,
    torques: Sequence[float],
    *,
    pairs: int = DRAWN_PAIRS,
    run: Run = Run(),
) -> DriveChanges:
    """Changes of F'_ior from a first drive to a second one at torques [N*m], of all fields and of single ones alone.

    With rolling balls there are no draws: what is not known is 0. Argument: pairs that are drawn. Raises UntrustedError
    where one of both drives has no answer that can be trusted.
    """
    drawn = searchable(first) and searchable(second)
    before, after = paired_draws((first, second), pairs if drawn else 0, run.seed)
    proof, paths = EMPTY, moving((first, second))

    def F_ior(drives: Sequence[Drive], *, required: bool = False) -> Array:
        """F'_ior [arcsec], shape (drives, torques); NaN where one has no answer, unless it is required."""
        nonlocal proof
        tasks, values = [(drive, M_g, required) for drive in drives for M_g in torques], []
        for value, certificate in run.map(_searched, tasks):
            values.append(value)
            proof += certificate
            run.solved(certificate.states)
        return np.reshape(values, (len(drives), len(torques)))

    errors = F_ior(before, required=True)  # (pairs, torques)
    whole = ErrorChange("", errors, F_ior(after, required=True) - errors)

    def alone(path: str, count: int) -> ErrorChange | None:
        moved = [one.with_values({path: other.value(path)}) for one, other in zip(before, after, strict=True)][:count]
        if not all(map(_is_drive, moved, before)):
            return None
        found = F_ior(moved)
        return None if np.isnan(found).any() else ErrorChange(path, errors[:count], found - errors[:count])

    found = {path: alone(path, SCREENED_PAIRS) for path in paths}
    chosen = _largest_first(found.values())[:REPORTED_FIELDS]
    if len(before) > SCREENED_PAIRS:
        found |= {change.path: alone(change.path, len(before)) for change in chosen}
    single = _largest_first(found[change.path] for change in chosen)
    impossible = tuple(path for path in paths if not found[path])
    return DriveChanges(whole, tuple(single), impossible, drawn or not (unknowns(first) or unknowns(second)), proof)


def _largest_first(changes: Iterable[ErrorChange | None]) -> list[ErrorChange]:
    return sorted((each for each in changes if each), key=lambda change: -float(change.share.max()))


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


def _is_drive(moved: Drive, before: Drive) -> bool:
    """Whether the fields of a drive go together, and it leaves no more unknown than before: a direction, say."""
    return first_conflict(moved) is None and len(unknowns(moved)) <= len(unknowns(before))


def _searched(task: tuple[Drive, float, bool]) -> tuple[float, Certificate]:
    drive, M_g, required = task
    try:
        (extremes,) = in_wide_enough_window(drive, lambda there: extremes_of(there, [M_g]))
    except HdassistError:
        if required:
            raise
        return np.nan, EMPTY
    return extremes.first, extremes.certificate
