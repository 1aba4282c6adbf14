"""Drives beside each other: what differs, and what that does to F'_ior, to the best hole and to the stiffness."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from hdassist.comparing.changes import PAIRS, TRIED, Changes, changes
from hdassist.comparing.fields import Difference, differences, other_origins
from hdassist.comparing.sheet import DriveSheet, at_torques, estimate_states, sheet_of
from hdassist.design.check import DRAWS
from hdassist.error.error_map import SEARCHED
from hdassist.errors import UsageError
from hdassist.model.unknown import unknowns
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Certificate, Progress

SAME = 0.005  # arcsec: changes that are less are none
SURE = 0.95  # of the pairs: less says nothing


@dataclass(frozen=True, eq=False)
class DrivesComparison:
    """Drives beside the first of them.

    torques [N*m]; differences; origins, fields of the same value from another kind of origin;
    changes from the first one to each of the others, of two drives with single fields.
    """

    sheets: tuple[DriveSheet, ...]
    torques: tuple[float, ...]
    differences: tuple[Difference, ...]
    origins: tuple[str, ...]
    changes: tuple[Changes, ...]

    @property
    def drives(self) -> tuple[Drive, ...]:
        """The drives, in the order asked for."""
        return tuple(sheet.drive for sheet in self.sheets)

    @property
    def certificate(self) -> Certificate:
        """Worst residuals of all that was solved."""
        return reduce(add, [*(sheet.certificate for sheet in self.sheets), *(c.certificate for c in self.changes)])

    def sense(self, other: int, torque: int) -> int | None:
        """Whether another drive has less (-1), more (1) or the same error (0) at a torque, by their places.

        None where what is not known could reverse it, or there is no range over that.
        """
        found = self.changes[other - 1].whole.change_arcsec[:, torque]
        open_ = [sheet for sheet in (self.sheets[0], self.sheets[other]) if sheet.check.unknown]
        if open_ and not all(sheet.check.points[torque].belief for sheet in open_):
            return None
        if np.all(np.abs(found) < SAME):
            return 0
        if max(np.mean(found < 0), np.mean(found > 0)) < SURE:
            return None
        return -1 if np.mean(found) < 0 else 1


def common_torques(drives: Sequence[Drive]) -> tuple[float, ...]:
    """Torques [N*m] that all drives have, in the order of the first. Raises UsageError where there are none."""
    first, *others = (drive.operation.M_g for drive in drives)
    found = tuple(M_g for M_g in first if all(M_g in other for other in others))
    if not found:
        lists = "; ".join(f"{d.name}: {', '.join(f'{M_g:g}' for M_g in d.operation.M_g)} N*m" for d in drives)
        raise UsageError(f"no torque that all presets have ({lists})", "--torque says at which to compare them")
    return found


def estimate_comparison(drives: Sequence[Drive], torques: Sequence[float], draws: int = DRAWS) -> int:
    """Number of states that a comparison solves, about, for a progress bar."""
    sheets = sum(estimate_states(at_torques(drive, torques), draws) for drive in drives)
    pairs = min(draws, PAIRS) if any(map(unknowns, drives)) else 1
    single = min(pairs, TRIED) * len(_moving(drives))
    return sheets + SEARCHED * len(torques) * (2 * pairs * (len(drives) - 1) + single)


def compare_drives(
    drives: Sequence[Drive],
    torques: Sequence[float],
    *,
    draws: int = DRAWS,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> DrivesComparison:
    """Compare drives with the first of them, at torques [N*m].

    Arguments: two drives or more; torques; draws, of each from what is not known, and seed of these and of samples;
    executor, to spread the work over (the numbers do not depend on it); progress, told how many states were solved.
    Raises UntrustedError where an answer cannot be trusted, KeyboardInterrupt.
    """
    sheets = tuple(
        sheet_of(drive, torques=torques, draws=draws, seed=seed, executor=executor, progress=progress)
        for drive in drives
    )
    fields, pairs = _moving(drives), min(draws, PAIRS)
    changed = tuple(
        changes(drives[0], other, torques, fields, pairs=pairs, seed=seed, executor=executor, progress=progress)
        for other in drives[1:]
    )
    return DrivesComparison(sheets, tuple(torques), differences(drives), other_origins(drives), changed)


def _moving(drives: Sequence[Drive]) -> list[Difference]:
    """Fields of two drives to change alone."""
    return [field for field in differences(drives) if field.moves] if len(drives) == 2 else []
