"""Drives beside each other: what differs, and what that does to F'_ior, to the best hole and to the stiffness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from hdassist.comparing.changes import DRAWN_PAIRS, SCREENED_PAIRS, DriveChanges, drive_changes
from hdassist.comparing.fields import FieldDifference, field_differences, other_origins
from hdassist.comparing.sheet import DriveSheet, at_torques, sheet_of, sheet_states
from hdassist.design.check import DRAWS
from hdassist.error.error_map import SEARCHED
from hdassist.errors import UsageError
from hdassist.model.unknown import unknowns
from hdassist.preset.fields import Drive
from hdassist.run.run import Run
from hdassist.solve.answers import Certificate

SAME_ERROR = 0.005  # arcsec: a change that is less counts as none
SURE_SHARE = 0.95  # of the pairs that agree: the least for a verdict


@dataclass(frozen=True, eq=False)
class DrivesComparison:
    """Drives beside the first of them.

    torques [N*m]; differences; origins, fields of the same value from another kind of origin;
    changes from the first one to each of the others, of two drives with single fields.
    """

    sheets: tuple[DriveSheet, ...]
    torques: tuple[float, ...]
    differences: tuple[FieldDifference, ...]
    origins: tuple[str, ...]
    changes: tuple[DriveChanges, ...]

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
        change = self.changes[other - 1].whole.change_arcsec[:, torque]
        unsure = [sheet.check for sheet in (self.sheets[0], self.sheets[other]) if sheet.check.unknown]
        less, more = float(np.mean(change < 0)), float(np.mean(change > 0))
        if not all(check.points[torque].belief for check in unsure):
            return None
        if np.all(np.abs(change) < SAME_ERROR):
            return 0
        return None if max(less, more) < SURE_SHARE else -1 if less >= SURE_SHARE else 1


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
    sheets = sum(sheet_states(at_torques(drive, torques), draws) for drive in drives)
    pairs = min(draws, DRAWN_PAIRS) if any(map(unknowns, drives)) else 1
    single = min(pairs, SCREENED_PAIRS) * len(_moving(drives))
    return sheets + SEARCHED * len(torques) * (2 * pairs * (len(drives) - 1) + single)


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
    sheets = tuple(sheet_of(drive, torques=torques, draws=draws, run=run) for drive in drives)
    fields, pairs = _moving(drives), min(draws, DRAWN_PAIRS)
    changed = tuple(drive_changes(drives[0], other, torques, fields, pairs=pairs, run=run) for other in drives[1:])
    return DrivesComparison(sheets, tuple(torques), field_differences(drives), other_origins(drives), changed)


def _moving(drives: Sequence[Drive]) -> list[FieldDifference]:
    """Fields of two drives to change alone."""
    return [field for field in field_differences(drives) if field.moves] if len(drives) == 2 else []
