"""Drives computed against targets, over processes, each once; remembered in a file, so that work can go on.

A search that chooses its points by a seed asks for the same ones again, and finds them there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np
from pydantic import TypeAdapter

from hdassist.calibration.quantities import MEDIUM, ROUGH, Accuracy, Quantities
from hdassist.calibration.targets import Target, Targets
from hdassist.errors import DataError, HdassistError
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.preset.fields import Drive
from hdassist.run.kept import ClosedRecord, Kept, Number, Owner, RecordKind
from hdassist.solve.window import in_wide_enough_window

Level = Literal["rough", "medium"]
LEVELS: dict[Level, Accuracy] = {"rough": ROUGH, "medium": MEDIUM}
IMPOSSIBLE = 1e6  # tolerances off each target, where a drive cannot be computed

Values = tuple[float, ...]
_Task = TypeVar("_Task")
_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Evaluation(ClosedRecord):
    """A drive that was computed: values of the unknowns, and how far it is off the targets, in tolerances."""

    level: Level
    values: tuple[Number, ...]
    off: tuple[Number, ...]


def evaluations_kind(targets: Targets) -> RecordKind[Evaluation]:
    """What evaluations of drives against targets are in a file."""
    count = sum(target.residuals for target in targets.targets)

    def fault(_: int, record: Evaluation) -> str:
        if len(record.values) != len(targets.unknowns) or len(record.off) != count:
            return f"expected values of {len(targets.unknowns)} unknowns, off {count} targets"
        for unknown, value in zip(targets.unknowns, record.values, strict=True):
            if not unknown.allows(value):
                return f"{unknown.path}: expected {unknown.low:g} to {unknown.high:g}"
        return ""

    return RecordKind(TypeAdapter(Evaluation), fault)


def evaluations_owner(drive: Drive, targets: Targets) -> Owner:
    """What decides the evaluations of a drive against targets."""
    return Owner(
        command="calibrate",
        preset=drive.name,
        inputs={"preset": drive.origin.sha256, **targets.inputs},
        options={"set": list(drive.origin.overrides)},
    )


class Evaluations:
    """Computes how far drives are off targets, and remembers.

    Arguments: drive and targets; executor, to spread the work over; kept, a file to remember in.
    """

    def __init__(
        self,
        drive: Drive,
        targets: Targets,
        executor: Executor | None = None,
        kept: Kept[Evaluation] | None = None,
    ) -> None:
        self.computed = 0
        self._drive, self._targets, self._executor, self._kept = drive, targets, executor, kept
        self._known = {(known.level, known.values): known.off for known in (kept.records() if kept else ())}

    @property
    def remembered(self) -> int:
        """Number of drives that are known."""
        return len(self._known)

    def off(self, points: Sequence[Values], level: Level) -> list[Array]:
        """How far drives are off the targets, in tolerances, one row each.

        Arguments: points, values of the unknowns; level, a name in LEVELS.
        """
        fresh = list(dict.fromkeys(p for p in points if (level, p) not in self._known))
        tasks = [(self._drive, self._targets.by_path(p), self._targets.targets, LEVELS[level]) for p in fresh]
        for point, row in zip(fresh, self.run(_off, tasks), strict=True):
            self._known[level, point] = row
            self.computed += 1
            if self._kept is not None:
                self._kept.append([Evaluation(level, point, row)])
        return [np.array(self._known[level, p]) for p in points]

    def run(self, function: Callable[[_Task], _Result], tasks: Sequence[_Task]) -> Iterator[_Result]:
        """Results of a function over tasks, on the executor."""
        return self._executor.map(function, tasks) if self._executor else map(function, tasks)


def _off(task: tuple[Drive, dict[str, float], tuple[Target, ...], Accuracy]) -> tuple[float, ...]:
    drive, values, targets, accuracy = task
    there = drive.with_values(values)
    try:
        return _computed(there, targets, accuracy)
    except HdassistError:
        return (IMPOSSIBLE,) * sum(target.residuals for target in targets)


def fault_of(drive: Drive, targets: Sequence[Target]) -> str:
    """Why a drive cannot be computed; empty where it can."""
    try:
        _computed(drive, targets, ROUGH)
    except HdassistError as error:
        return error.message
    return ""


def _computed(drive: Drive, targets: Sequence[Target], accuracy: Accuracy) -> tuple[float, ...]:
    """How far a drive is off targets, in their tolerances. Raises HdassistError where there is no such drive."""
    if (conflict := first_conflict(drive)) is not None:
        raise DataError(f"{conflict.path}: {conflict.message}", conflict.hint)

    def off(there: Drive) -> tuple[float, ...]:
        quantities = Quantities(there, accuracy)
        return tuple(float(x) for target in targets for x in quantities.off(target))

    return in_wide_enough_window(drive, off)
