"""Drives computed against targets, over processes, each once; remembered in a file, so that work can go on.

The file has one JSON object a line: first what it belongs to, then one line a drive. A search that chooses its
points by a seed asks for the same ones again, and finds them here.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from hdassist.calibration.quantities import MEDIUM, ROUGH, Accuracy, Quantities
from hdassist.calibration.targets import Target, Targets
from hdassist.errors import DataError, HdassistError
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive, fields
from hdassist.preset.rules import conflicts

LEVELS: dict[str, Accuracy] = {"rough": ROUGH, "medium": MEDIUM}
IMPOSSIBLE = 1e6  # tolerances off each target, where a drive cannot be computed

Values = tuple[float, ...]
_Task = TypeVar("_Task")
_Result = TypeVar("_Result")


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
        self._known: dict[tuple[str, Values], list[float]] = {}
        self._owner = {
            "schema": "hdassist.calibration-state/1",
            "preset": drive.origin.sha256,
            "overrides": list(drive.origin.overrides),
            "targets": targets.sha256,
            "levels": {name: asdict(level) for name, level in LEVELS.items()},
        }
        if file is not None:
            self._resume(file)

    @property
    def remembered(self) -> int:
        """Number of drives that are known."""
        return len(self._known)

    def off(self, points: Sequence[Values], level: str) -> list[Array]:
        """How far drives are off the targets, in tolerances, one row each.

        Arguments: points, values of the unknowns; level, a name in LEVELS.
        """
        fresh = list(dict.fromkeys(p for p in points if (level, p) not in self._known))
        paths = [unknown.path for unknown in self._targets.unknowns]
        tasks = [(self._drive, dict(zip(paths, p, strict=True)), self._targets.targets, LEVELS[level]) for p in fresh]
        for point, row in zip(fresh, self.run(_off, tasks), strict=True):
            self._known[level, point] = row
            self.computed += 1
            self._write({"level": level, "values": point, "off": row})
        return [np.array(self._known[level, p]) for p in points]

    def run(self, function: Callable[[_Task], _Result], tasks: Sequence[_Task]) -> Iterator[_Result]:
        """Results of a function over tasks, on the executor."""
        return self._executor.map(function, tasks) if self._executor else map(function, tasks)

    def _resume(self, file: Path) -> None:
        if not file.exists():
            self._write(self._owner)
            return
        try:
            text = file.read_text(encoding="utf-8")
            whole = text[: text.rfind("\n") + 1]
            if whole != text:  # the line that was being written when the work was stopped
                file.write_text(whole, encoding="utf-8")
            owner, *entries = map(json.loads, whole.splitlines())
            for entry in entries:
                self._known[entry["level"], tuple(entry["values"])] = entry["off"]
        except (OSError, ValueError, KeyError, IndexError, TypeError) as error:
            raise DataError(f"{file}: not the state of a calibration: {error}", "name another --state file") from None
        if owner != self._owner:
            raise DataError(f"{file} belongs to another preset or other targets", "name another --state file")

    def _write(self, entry: dict[str, Any]) -> None:
        if self._file is None:
            return
        try:
            with self._file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(entry) + "\n")
        except OSError as error:
            raise DataError(f"cannot write {self._file}: {error.strerror}") from None


def _off(task: tuple[Drive, dict[str, float], tuple[Target, ...], Accuracy]) -> list[float]:
    drive, values, targets, accuracy = task
    there = drive.with_values(values)
    lengths = [len(target.trace[0]) if target.trace else 1 for target in targets]
    if any(conflicts({path: there.value(path) for path, _ in fields()})):
        return [IMPOSSIBLE] * sum(lengths)
    quantities = Quantities(there, accuracy)
    try:
        return [float(x) for target in targets for x in quantities.off(target)]
    except HdassistError:
        return [IMPOSSIBLE] * sum(lengths)
