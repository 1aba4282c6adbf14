"""Drives beside the first of them: fields that differ, and the change of F'_ior by each of these."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hdassist.belief.evidence import evidence_of
from hdassist.belief.prior import prior_of
from hdassist.belief.samples import EFFECTIVE_SAMPLES
from hdassist.belief.statistics import RESOLVED_ERROR, weighted_quantile
from hdassist.comparing.pairs import DRAWN_PAIRS, differently_open, drawn_pairs
from hdassist.comparing.sheet import DriveSheet, sheet_of, sheet_states
from hdassist.design.check import DesignCheck
from hdassist.error.error_map import Batch, error_maps, extremes_of, searchable
from hdassist.error.sloped import DRAWN_STATES, drawn_extremes
from hdassist.errors import HdassistError, UsageError
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.model.unknown import unknowns
from hdassist.preset.fields import Drive
from hdassist.preset.kinds import UNKNOWN
from hdassist.preset.schema import ResolvedField, resolved_fields
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate

SINGLE_PAIRS = 16  # in which single fields are changed: the first, as Sobol points lie evenly from the start
SCREENED_PAIRS = 2  # of them on which every field is tried, before the largest are searched on all
REPORTED_FIELDS = 3
# have no bearing on F'_ior at a torque: loads, evidence, limits, the seat's holes, resolution of other answers,
# uncertainties
UNRELATED = (
    "operation.M_g", "operation.rated", "catalogue.", "measured.", "acceptance.", "mounting.holes",
    "mounting.first_hole", "mounting.allowed", "numerics.n_phase", "uncertainty.",
)  # fmt: skip

FieldRow = tuple[ResolvedField, ...]  # a field of each drive


@dataclass(frozen=True)
class ErrorChange:
    """Change of F'_ior of a drive [arcsec] where one field is changed, by path, or all together (no path), by torque.

    change_arcsec: median over the drawn pairs, with its 5th and 95th percentile; share: of the median of F'_ior before.
    """

    field: str
    change_arcsec: tuple[float, ...]
    p5_arcsec: tuple[float, ...]
    p95_arcsec: tuple[float, ...]
    share: tuple[float, ...]

    @classmethod
    def of(cls, field: str, before: Array, after: Array, weights: Array) -> ErrorChange:
        """The change from F'_ior before to F'_ior after [arcsec], shape (pairs, torques); weights, shape (pairs,)."""

        def percentile(values: Array, share: float) -> tuple[float, ...]:
            return tuple(weighted_quantile(column, weights, share) for column in values.T)

        low, median, high = (percentile(after - before, share) for share in (0.05, 0.5, 0.95))
        shares = np.abs(median) / np.maximum(percentile(before, 0.5), RESOLVED_ERROR)
        return cls(field, median, low, high, tuple(shares.tolist()))


@dataclass(frozen=True)
class DriveChanges:
    """Changes of F'_ior from a first drive to a second one.

    pairs: that were drawn, alike in what both leave open in the same way; F_ior_is: less, more or the same at each
    torque, unknown where unknown inputs could reverse it; single: fields changed alone, the greatest first; not_alone:
    paths of those that, alone, make no drive that can be computed, or leave more unknown.
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
    changed = {"M_g": torques}
    return [d.model_copy(update={"operation": d.operation.model_copy(update=changed)}) for d in drives]


def differing_rows(drives: Sequence[Drive]) -> tuple[FieldRow, ...]:
    """Fields in which drives differ, in the order of the declarations; uncertainties of fields behind them."""
    rows = list(zip(*map(resolved_fields, drives), strict=True))
    units = {row[0].path: row[0].unit for row in rows}
    for path in dict.fromkeys(path for drive in drives for path in drive.uncertainty):
        field = partial(ResolvedField, f"uncertainty.{path}", unit=units[path], ref="", meaning="", range=None)
        values = (drive.uncertainty.get(path) for drive in drives)
        rows.append(tuple(field(value=value, kind="default" if value is None else "given") for value in values))
    open_ = {path for drive in drives[1:] for path in differently_open(drives[0], drive)}
    return tuple(row for row in rows if row[0].path in open_ or any(cell.value != row[0].value for cell in row))


def differing_fields(drives: Sequence[Drive]) -> list[str]:
    """Paths of the fields in which drives differ and that may move F'_ior at a torque."""
    return [row[0].path for row in differing_rows(drives) if not row[0].path.startswith(UNRELATED)]


def estimate_comparison(drives: Sequence[Drive], draws: int = EFFECTIVE_SAMPLES) -> int:
    """Number of states that a comparison solves, about, for a progress bar."""
    searches = sum(DRAWN_PAIRS + SCREENED_PAIRS * len(differing_fields((drives[0], each))) for each in drives[1:])
    return sum(sheet_states(drive, draws) for drive in drives) + DRAWN_STATES * len(drives[0].operation.M_g) * searches


def compare_drives(drives: Sequence[Drive], *, draws: int = EFFECTIVE_SAMPLES, run: Run = Run()) -> DrivesComparison:
    """Compare two drives or more with the first of them, all at the same torques.

    Argument: draws, of each from what is not known of it. Raises UntrustedError where an answer cannot be trusted,
    KeyboardInterrupt.
    """
    sheets = tuple(sheet_of(drive, draws=draws, run=run) for drive in drives)
    first, *others = (sheet.check for sheet in sheets)
    found = [drive_changes(first, other, pairs=min(draws, DRAWN_PAIRS), run=run) for other in others]
    changes, proofs = zip(*found, strict=True)
    proof = sum(proofs, sum((sheet.certificate for sheet in sheets), EMPTY))
    return DrivesComparison(sheets, differing_rows(drives), changes, proof)


def drive_changes(
    first: DesignCheck, second: DesignCheck, *, pairs: int = DRAWN_PAIRS, run: Run = Run()
) -> tuple[DriveChanges, Certificate]:
    """Changes of F'_ior from a first drive to a second one at their torques, of all fields and of single ones alone.

    Argument: pairs of their samples that are drawn. Raises UntrustedError where one of both drives has no answer that
    can be trusted.
    """
    differing = differing_fields((first.drive, second.drive))
    same = not differing and evidence_of(first.drive) == evidence_of(second.drive)
    found = drawn_pairs(first, second, same=same, count=pairs, run=run)
    proof, drives = found.certificate, found.drives[:SINGLE_PAIRS]
    # bounds of what is unknown hang on other fields
    open_ = [each.path for each in prior_of(second.drive).fields]
    moved = [path for path in open_ if any(one.value(path) != other.value(path) for one, other in drives)]
    paths = dict.fromkeys((*differing, *moved))
    drawn = bool(first.samples or second.samples)
    errors_of = partial(_errors, torques=first.drive.operation.M_g, drawn=drawn)

    def F_ior(drives: Sequence[Drive]) -> Array:
        """F'_ior [arcsec] of drives, shape (drives, torques); NaN where there is none."""
        nonlocal proof
        values = np.empty((len(drives), len(first.points)))
        for row, (errors, certificate) in zip(values, run.map(errors_of, drives), strict=True):
            proof += certificate
            run.solved(certificate.states)
            row[:] = errors
        return values

    def alone(path: str, count: int) -> ErrorChange | None:
        """The change by a field alone over the first pairs; None where most of them make no drive."""
        # sound: without a conflict, nor more unknown fields than before (a direction, for example)
        sound = {}
        for k, (one, other) in enumerate(drives[:count]):
            changed = one.with_values({path: other.value(path)})
            if len(unknowns(changed)) <= len(unknowns(one)) and first_conflict(changed) is None:
                sound[k] = changed
        after = F_ior([*sound.values()])
        solved = ~np.isnan(after).any(axis=1)
        if 2 * solved.sum() < min(count, len(drives)):
            return None
        return ErrorChange.of(path, before[[*sound]][solved], after[solved], np.ones(solved.sum()))

    before = F_ior([one for one, _ in drives]) if paths else np.zeros((0, 0))

    def largest_first(paths: Iterable[str], count: int) -> list[ErrorChange]:
        return sorted(filter(None, (alone(path, count) for path in paths)), key=lambda change: -max(change.share))

    screened = [change.field for change in largest_first(paths, SCREENED_PAIRS)]
    single = largest_first(screened[:REPORTED_FIELDS], len(drives))
    undrawn = any(point.F_ior_arcsec is None for point in (*first.points, *second.points))
    rows, columns = np.nonzero(found.weights)
    changes = DriveChanges(
        len(found.drives),
        (UNKNOWN,) * len(first.points) if undrawn and not same else found.senses(),
        ErrorChange.of("", found.before_arcsec[rows], found.after_arcsec[columns], found.weights[rows, columns]),
        tuple(single),
        tuple(path for path in paths if path not in screened),
    )
    return changes, proof


def _errors(drive: Drive, torques: Sequence[float], drawn: bool) -> tuple[Array, Certificate]:
    """F'_ior of a drive [arcsec], shape (torques,), with its proof; NaN where there is no answer."""
    try:
        found = (
            [drawn_extremes(each, Batch.of(drive)) for each in error_maps(drive, torques)]
            if drawn and searchable(drive)
            else extremes_of(drive, torques)
        )
    except HdassistError:
        return np.full(len(torques), np.nan), EMPTY
    return np.array([each.first for each in found]), sum((each.certificate for each in found), EMPTY)
