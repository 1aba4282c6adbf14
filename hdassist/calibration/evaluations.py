"""Residuals of drives against targets, over processes, each computed once; kept in a file, so that work can go on.

A search that chooses its points by a seed asks for the same ones again, and finds them in the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from pydantic import TypeAdapter

from hdassist.calibration.quantities import SEARCHING, TargetQuantities
from hdassist.calibration.targets import CalibrationTarget, Targets
from hdassist.errors import DataError, HdassistError
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.preset.fields import Drive
from hdassist.run.kept import ClosedRecord, Kept, KeptOwner, Number, RecordKind
from hdassist.run.run import Run

IMPOSSIBLE = 1e6  # tolerances, each residual of a drive that cannot be computed

Values = tuple[float, ...]


@dataclass(frozen=True)
class Evaluation(ClosedRecord):
    """A drive that was computed: values of the unknowns, and its residuals [tolerances]."""

    values: tuple[Number, ...]
    residuals: tuple[Number, ...]


def evaluations_kind(targets: Targets) -> RecordKind[Evaluation]:
    """Records of drives computed against targets, and how they are checked."""
    count = len(targets.unknowns), sum(target.residual_count for target in targets.targets)

    def fault(_: int, record: Evaluation) -> str:
        fits = (len(record.values), len(record.residuals)) == count
        return "" if fits else f"expected values of {count[0]} unknowns, {count[1]} residuals"

    return RecordKind(TypeAdapter(Evaluation), fault)


def evaluations_owner(drive: Drive, targets: Targets) -> KeptOwner:
    """All that decides the residuals of a drive against targets."""
    return KeptOwner(
        command="calibrate",
        preset=drive.name,
        inputs={"preset": drive.origin.sha256, **targets.inputs},
        options={"set": list(drive.origin.overrides)},
    )


class Evaluations:
    """Computes residuals of drives, and remembers them.

    Arguments: drive and targets; run, on which they are computed; kept, a file to remember in. computed: drives
    computed so far; remembered: drives that the file had.
    """

    def __init__(
        self,
        drive: Drive,
        targets: Targets,
        run: Run = Run(),
        kept: Kept[Evaluation] | None = None,
    ) -> None:
        self.computed = 0
        self.run, self._drive, self._targets, self._kept = run, drive, targets, kept
        self._known = {known.values: known.residuals for known in (kept.records() if kept else ())}
        self.remembered = len(self._known)

    def residuals(self, points: Sequence[Values]) -> Array:
        """Residuals [tolerances] at values of the unknowns, shape (points, residuals)."""
        fresh = [point for point in dict.fromkeys(points) if point not in self._known]
        tasks = [self._drive.with_values(self._targets.by_path(point)) for point in fresh]
        for point, (row, _) in zip(
            fresh, self.run.map(partial(residuals_or_fault, self._targets.targets), tasks), strict=True
        ):
            self._known[point] = row
            self.computed += 1
            if self._kept is not None:
                self._kept.append([Evaluation(point, row)])
        return np.array([self._known[point] for point in points])


def residuals_or_fault(targets: Sequence[CalibrationTarget], drive: Drive) -> tuple[Values, str]:
    """Residuals [tolerances] of a drive, and why it cannot be computed: empty where it can."""
    try:
        if (conflict := first_conflict(drive)) is not None:
            raise DataError(f"{conflict.path}: {conflict.message}", conflict.hint)
        quantities = TargetQuantities(drive, SEARCHING)
        return tuple(float(x) for target in targets for x in quantities.residuals(target)), ""
    except HdassistError as error:
        return (IMPOSSIBLE,) * sum(target.residual_count for target in targets), error.message
