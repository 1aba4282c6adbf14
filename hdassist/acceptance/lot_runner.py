"""The drives of a lot, worked on by several processes: answers come in the order of the rows."""

from __future__ import annotations

import traceback
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import replace
from typing import Any

from hdassist.acceptance import figures
from hdassist.acceptance.lot import LotRow
from hdassist.acceptance.predictions import Predictions
from hdassist.acceptance.replaying import preset_sha256, traced_file
from hdassist.acceptance.request import FailOn, Request, carry_out, read_measurements
from hdassist.errors import DataError, HdassistError, UsageError

Answer = dict[str, Any]
Key = tuple[str | None, Request]


def answers(
    rows: Sequence[LotRow], executor: Executor, fail_on: FailOn, *, ahead: int, debug: bool = False
) -> Iterator[Answer]:
    """An answer for each row, in their order; what is wrong with a row is its answer.

    ahead: rows under way at a time; an interrupt loses what they have done out of order.

    Rows of the same preset, overrides and limits share their predictions: the first of them predicts, the others wait
    for it. An answer says the same as if its drive were alone.
    """
    hashes = {name: preset_sha256(name) for name in {row.request.preset for row in rows if not row.fault}}
    keys = [
        None if row.fault or row.request.measured_only else _key(row.request, hashes[row.request.preset])
        for row in rows
    ]
    left = Counter(key for key in keys if key is not None)
    known: dict[Key, Predictions] = {}
    alone: set[Key] = set()  # nothing to predict
    waiting, running, done = deque(range(len(rows))), dict[Future[Any], int](), dict[int, Answer]()
    given = 0
    while given < len(rows):
        busy = {keys[index] for index in running.values()} - known.keys() - alone - {None}
        for index in list(waiting):
            if len(running) >= ahead or index >= given + 4 * ahead:
                break
            row, key = rows[index], keys[index]
            if row.fault:
                waiting.remove(index)
                done[index] = failure(row, row.fault)
            elif key not in busy:
                waiting.remove(index)
                found = known.get(key) if key else None
                keep = key is not None and found is None and left[key] > 1
                running[executor.submit(_answer, row, fail_on, found, keep, debug)] = index
                if keep and key not in alone:
                    busy.add(key)
        if running and given not in done:
            for task in wait(running, return_when=FIRST_COMPLETED).done:
                index = running.pop(task)
                key = keys[index]
                done[index], found, read = task.result()
                if key is None:
                    continue
                left[key] -= 1
                if found is not None and left[key]:
                    known[key] = found
                elif read and key not in known:
                    alone.add(key)
                if not left[key]:
                    known.pop(key, None)
        while given in done:
            yield done.pop(given)
            given += 1


def _key(request: Request, sha256: str | None) -> Key:
    """What predictions depend on: all but the serial, the files and the values measured."""
    torques = tuple(text.removesuffix(traced_file(text)) for text in request.measured)
    values = tuple(text.partition("=")[0] for text in request.values)
    return sha256, replace(request, serial="", preset="" if sha256 else request.preset, measured=torques, values=values)


def _answer(
    row: LotRow, fail_on: FailOn, known: Predictions | None, keep: bool, debug: bool
) -> tuple[Answer, Predictions | None, bool]:
    """One row: its answer, predictions that others wait for, and whether it had an answer at all."""
    try:
        drive = row.request.load()
        result = carry_out(row.request, drive, read_measurements(row.request, drive), predictions=known)
    except HdassistError as error:
        return failure(row, error), None, False
    except Exception as bug:  # that row's answer, with the exit code of a bug: the others go on
        if debug:
            raise
        where = traceback.extract_tb(bug.__traceback__)[-1]
        words = f"internal error: {type(bug).__name__}: {bug} ({where.name})"
        return failure(row, HdassistError(words, "this is a bug in hdassist; --debug shows where")), None, False
    told = {**figures.answer(row.request, result, fail_on), "place": row.place}
    return told, result.predictions if keep else None, True


def failure(row: LotRow, error: HdassistError) -> Answer:
    """The answer about a row that has none; what is wrong with a row is wrong data, not wrong usage."""
    place = "" if row.place in error.message else f"{row.place}: "
    told = figures.failure(row.request, error)
    told["error"] = {"message": f"{place}{error.message}", "hint": error.hint}
    told["exit_code"] = DataError.exit_code if isinstance(error, UsageError) else error.exit_code
    told["request"] = None if row.fault else told["request"]
    return {**told, "place": row.place}
