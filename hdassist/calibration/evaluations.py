"""Drives computed against targets, over processes, each once; remembered in a file, so that work can go on.

The file has one JSON object a line: first its owner, what it belongs to, then one entry a drive. A search that chooses
its points by a seed asks for the same ones again, and finds them here.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from hdassist.calibration.quantities import MEDIUM, ROUGH, Accuracy, Quantities
from hdassist.calibration.targets import Target, Targets
from hdassist.errors import DataError, HdassistError
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.preset.fields import Drive
from hdassist.solve.window import in_wide_enough_window
from hdassist.textfile import is_file, is_there, read_bytes

Level = Literal["rough", "medium"]
LEVELS: dict[Level, Accuracy] = {"rough": ROUGH, "medium": MEDIUM}
MAX_BYTES = 100_000_000  # of a state file
IMPOSSIBLE = 1e6  # tolerances off each target, where a drive cannot be computed

Values = tuple[float, ...]
_Task = TypeVar("_Task")
_Result = TypeVar("_Result")


class _Line(BaseModel):
    """A line of a state file."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Owner(_Line):
    """What a state file belongs to: a preset and targets (SHA-256), and how closely quantities were computed."""

    stated_schema: Literal["hdassist.calibration-state/2"] = Field(alias="schema")
    preset: str
    overrides: tuple[str, ...]
    targets: str
    levels: dict[Level, Accuracy]


class Entry(_Line):
    """A drive that was computed: values of the unknowns, and how far it is off the targets, in tolerances."""

    level: Level
    values: Values
    off: tuple[float, ...]


class Evaluations:
    """Computes how far drives are off targets, and remembers.

    Arguments: drive and targets; executor, to spread the work over; file, to remember in, created or gone on
    with. Raises DataError where the file belongs to other targets, another preset or version, or is damaged.
    """

    def __init__(
        self, drive: Drive, targets: Targets, executor: Executor | None = None, file: Path | None = None
    ) -> None:
        self.computed = 0
        self._drive, self._targets, self._executor, self._file = drive, targets, executor, file
        self._known: dict[tuple[Level, Values], tuple[float, ...]] = {}
        if file is not None:
            owner = Owner(
                schema="hdassist.calibration-state/2",
                preset=drive.origin.sha256,
                overrides=drive.origin.overrides,
                targets=targets.sha256,
                levels=LEVELS,
            )
            if is_there(file):
                self._resume(file, owner)
            else:
                self._write(owner)

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
            self._write(Entry(level=level, values=point, off=row))
        return [np.array(self._known[level, p]) for p in points]

    def run(self, function: Callable[[_Task], _Result], tasks: Sequence[_Task]) -> Iterator[_Result]:
        """Results of a function over tasks, on the executor."""
        return self._executor.map(function, tasks) if self._executor else map(function, tasks)

    def _resume(self, file: Path, owner: Owner) -> None:
        """Take over what a state file knows; a file that is none, or is another one's, is left as it is."""
        if not is_file(file):
            raise DataError(f"{file} is no file that work can be kept in", "name another --state file")
        try:
            data, _ = read_bytes(file, MAX_BYTES + 1)
            if len(data) > MAX_BYTES:
                raise DataError(f"{file} is larger than {MAX_BYTES / 1e6:g} MB", "name another --state file")
            whole = data[: data.rfind(b"\n") + 1]
            first, *lines = whole.decode().splitlines() or [""]
            found = Owner.model_validate_json(first)
            entries = [Entry.model_validate_json(line) for line in lines]
        except ValidationError as error:
            message = f"{file}: not the state of a calibration: {error.errors()[0]['msg']}"
            raise DataError(message, "name another --state file") from None
        except UnicodeDecodeError as error:
            raise DataError(f"{file}: not the state of a calibration: {error}", "name another --state file") from None
        if found != owner:
            raise DataError(f"{file} belongs to another preset or other targets", "name another --state file")
        self._known = {(entry.level, entry.values): entry.off for entry in entries}
        if whole != data:  # the line that was being written when the work was stopped
            try:
                os.truncate(file, len(whole))
            except OSError as error:
                raise DataError(f"cannot write {file}: {error.strerror}") from None

    def _write(self, line: _Line) -> None:
        if self._file is None:
            return
        try:
            with self._file.open("a", encoding="utf-8") as stream:
                stream.write(line.model_dump_json(by_alias=True) + "\n")
        except OSError as error:
            raise DataError(f"cannot write {self._file}: {error.strerror}") from None


def _off(task: tuple[Drive, dict[str, float], tuple[Target, ...], Accuracy]) -> tuple[float, ...]:
    drive, values, targets, accuracy = task
    there = drive.with_values(values)
    try:
        return _computed(there, targets, accuracy)
    except HdassistError:
        lengths = [len(target.trace[0]) if target.trace else 1 for target in targets]
        return (IMPOSSIBLE,) * sum(lengths)


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
