"""What a change from one drive to another does to F'_ior: all together, and each field that differs alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from hdassist.comparing.fields import Difference
from hdassist.error.error_map import extremes_of, searchable
from hdassist.errors import HdassistError
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.model.unknown import listed, unknowns
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate, Progress
from hdassist.solve.window import in_wide_enough_window

PAIRS = 16  # drives drawn of each from what is not known: as many pairs
TRIED = 2  # of them on which every field is tried, before those that do most are looked at on all
MOST = 3  # fields that are told


@dataclass(frozen=True, eq=False)
class Change:
    """What changing a field, by path, or all of them together (no path) does to F'_ior of a drive.

    change_arcsec: shape (pairs, torques), one pair where all is known; F_ior_arcsec, as it was before, same shape.
    """

    path: str
    change_arcsec: Array
    F_ior_arcsec: Array

    @property
    def median_arcsec(self) -> Array:
        """The change in the middle one of the pairs, shape (torques,)."""
        return np.asarray(np.median(self.change_arcsec, axis=0))

    @property
    def share(self) -> float:
        """The same as a share of F'_ior before, its size at the torque where that is greatest."""
        return float(np.max(np.abs(self.median_arcsec) / np.median(self.F_ior_arcsec, axis=0)))


@dataclass(frozen=True, eq=False)
class Changes:
    """Changes from a first drive to a second one at some torques.

    whole: all together; single: fields changed alone, the greatest first; none: paths of those that, alone, make no
    drive that can be computed, or need what neither drive says; certificate of all states behind them.
    """

    whole: Change
    single: tuple[Change, ...]
    none: tuple[str, ...]
    certificate: Certificate


def changes(
    first: Drive,
    second: Drive,
    torques: Sequence[float],
    fields: Sequence[Difference] = (),
    *,
    pairs: int = PAIRS,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Changes:
    """What changing a first drive into a second one does to F'_ior at torques [N*m], and what fields alone do.

    What is not known of either is drawn, pair by pair: what both do not know lies at the same share of its range in
    both. With rolling balls there is nothing drawn: what is not known is 0 then. Arguments: fields to change alone, as
    differences of both; pairs that are drawn; seed; executor, to spread the work over (the numbers do not depend on
    it); progress, told how many states were solved. Raises UntrustedError where one of both drives has no answer that
    can be trusted.
    """
    pairs = pairs if searchable(first) and searchable(second) else 0
    here, there = drawn_alike((first, second), pairs, seed)
    run = _Run(tuple(torques), executor, progress)
    before, after = run.of(here, must=True), run.of(there, must=True)
    assert before is not None
    assert after is not None
    tried = {}
    for field in fields:
        few = slice(TRIED)
        moved = _moved(here[few], there[few], field.path)
        if not _is_drive(moved, here[few]):
            continue
        if (found := run.of(moved)) is not None:
            tried[field.path] = Change(field.path, found - before[few], before[few])
    chosen = sorted(tried, key=lambda path: -tried[path].share)[:MOST]
    single = [tried[path] for path in chosen]
    if len(here) > TRIED:
        full = {path: run.of(_moved(here, there, path)) for path in chosen}
        single = [Change(path, found - before, before) for path, found in full.items() if found is not None]
    single.sort(key=lambda change: -change.share)
    alone = {change.path for change in single}
    none = tuple(field.path for field in fields if field.path not in tried or (field.path in {*chosen} - alone))
    return Changes(Change("", after - before, before), tuple(single), none, run.certificate)


def drawn_alike(drives: Sequence[Drive], count: int, seed: int = 0) -> list[list[Drive]]:
    """So many drives drawn from what is not known of each of some: a field lies at the same share of its range in all.

    Where all is known, or for a count of 0, each of them as it is.
    """
    open_ = [{unknown.path: unknown for unknown in unknowns(drive)} for drive in drives]
    paths = list(dict.fromkeys(path for each in open_ for path in each))
    if not paths or not count:
        return [[drive] for drive in drives]
    shares = np.random.default_rng(seed).random((count, len(paths)))
    found = []
    for drive, own in zip(drives, open_, strict=True):
        bounds = {path: (own[path].low, own[path].high) for path in paths if path in own}
        columns = {path: low + (high - low) * shares[:, paths.index(path)] for path, (low, high) in bounds.items()}
        found.append(listed(drive, columns, count))
    return found


def _moved(here: Sequence[Drive], there: Sequence[Drive], path: str) -> list[Drive]:
    """Drives with a field as others have it."""
    return [one.with_values({path: other.value(path)}) for one, other in zip(here, there, strict=True)]


@dataclass
class _Run:
    """Searches at some torques, and the certificate of all of them."""

    torques: tuple[float, ...]
    executor: Executor | None
    progress: Progress | None
    certificate: Certificate = EMPTY

    def of(self, drives: Sequence[Drive], *, must: bool = False) -> Array | None:
        """F'_ior [arcsec] of drives, shape (drives, torques); None where one of them has none, unless it must."""
        tasks = [(drive, M_g, must) for drive in drives for M_g in self.torques]
        found: Iterable[tuple[float, Certificate]] = (self.executor.map if self.executor else map)(_F_ior, tasks)
        values = []
        for value, proof in found:
            values.append(value)
            self.certificate += proof
            if self.progress:
                self.progress(proof.states)
        table = np.reshape(values, (len(drives), len(self.torques)))
        return None if np.isnan(table).any() else table


def _is_drive(moved: Sequence[Drive], before: Sequence[Drive]) -> bool:
    """Whether drives that were moved go together, and leave no more unknown than before: a direction, say."""
    return all(
        first_conflict(drive) is None and len(unknowns(drive)) <= len(unknowns(other))
        for drive, other in zip(moved, before, strict=True)
    )


def _F_ior(task: tuple[Drive, float, bool]) -> tuple[float, Certificate]:
    drive, M_g, must = task
    try:
        return in_wide_enough_window(drive, partial(_solved, M_g))
    except HdassistError:
        if must:
            raise
        return np.nan, EMPTY


def _solved(M_g: float, drive: Drive) -> tuple[float, Certificate]:
    (found,) = extremes_of(drive, [M_g])
    return found.first, found.certificate
