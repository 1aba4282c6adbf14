"""The drives of a lot, worked on by several processes: answers come in the order of the rows."""

from __future__ import annotations

import traceback
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import replace
from itertools import islice
from typing import TypeAlias

from hdassist.acceptance.answer import Answer, ErrorRecord, answer_of, failure_of
from hdassist.acceptance.cells import of_cells
from hdassist.acceptance.limit_parser import LimitName
from hdassist.acceptance.lot import LotRow
from hdassist.acceptance.predictions import Predictions
from hdassist.acceptance.replay import preset_sha256
from hdassist.acceptance.request import FailOn, Request, carry_out, predict_for, read_measurements, read_wheels
from hdassist.errors import DataError, HdassistError, UsageError
from hdassist.preset.library import read_preset

DriveKey: TypeAlias = tuple[str | None, Request, tuple[str, ...], tuple[LimitName, ...]]


def answer_rows(
    rows: Sequence[LotRow], executor: Executor, fail_on: FailOn, *, jobs: int, debug: bool = False
) -> Iterator[Answer]:
    """An answer for each row, in their order; what is wrong with a row is its answer.

    Each different drive is predicted once, then its rows are answered: an answer says the same as if its drive were
    alone. jobs: processes of the executor, and so drives that are predicted at a time; an interrupt loses what is done
    out of order.
    """
    hashes = {name: preset_sha256(name) for name in {row.request.preset for row in rows if not row.fault}}
    unread = {name: _unread(name) for name, sha256 in hashes.items() if sha256 is None}
    faults = [row.fault or unread.get(row.request.preset) for row in rows]
    keys = [None if fault else _drive_key(row, hashes) for row, fault in zip(rows, faults, strict=True)]
    left = Counter(keys)
    first: dict[DriveKey, Request] = {}
    for row, key in zip(rows, keys, strict=True):
        if key is not None:
            first.setdefault(key, row.request)
    to_predict = iter(first.items())
    predicted: dict[DriveKey, Future[Predictions | None]] = {}
    asked: deque[Future[Answer]] = deque()

    def predict_on() -> list[Future[Predictions | None]]:
        """Predictions under way, as many as there are processes."""
        under_way = [found for found in predicted.values() if not found.done()]
        for key, request in islice(to_predict, jobs - len(under_way)):
            predicted[key] = executor.submit(_predict, request)
            under_way.append(predicted[key])
        return under_way

    for row, key, fault in zip(rows, keys, faults, strict=True):
        predictions = None
        if key is not None:
            while (under_way := predict_on()) and not predicted[key].done():
                while asked:  # before a wait that may be long
                    yield asked.popleft().result()
                wait(under_way, return_when=FIRST_COMPLETED)
            predictions = predicted[key].result()
            left[key] -= 1
            if not left[key]:
                del predicted[key]
        asked.append(_known(row, fault) if fault else executor.submit(_answer, row, fail_on, predictions, debug))
        while asked and (asked[0].done() or len(asked) > jobs):
            yield asked.popleft().result()
    while asked:
        yield asked.popleft().result()


def _unread(preset: str) -> DataError | None:
    """Why a preset cannot be read: said to each of its rows without a worker, where there may be many."""
    try:
        read_preset(preset)
    except DataError as error:
        return error
    return None


def _drive_key(row: LotRow, hashes: dict[str, str | None]) -> DriveKey | None:
    """What predictions depend on: all but the serial, the files and the values measured; None where there are none."""
    request = row.request
    if request.measured_only:
        return None
    sha256 = hashes[request.preset]
    alike = replace(request, serial="", preset="" if sha256 else request.preset, measured=(), values=())
    return sha256, alike, tuple(t.torque for t in request.measured), tuple(v.name for v in request.values)


def _predict(request: Request) -> Predictions | None:
    """Predictions of a drive; None where there are none, which the rows themselves then say."""
    try:
        return predict_for(request)
    except Exception:  # a bug too: each row meets it again when it is answered, and says it with its place
        return None


def _answer(row: LotRow, fail_on: FailOn, predictions: Predictions | None, debug: bool) -> Answer:
    try:
        drive = row.request.load()
        measured, wheels = read_measurements(row.request, drive), read_wheels(row.request, drive)
        result = carry_out(row.request, drive, measured, wheels, predictions=predictions)
    except HdassistError as error:
        return failure(row, error)
    except (MemoryError, OSError):  # what the system refuses is no row's
        raise
    except Exception as bug:  # that row's answer, with the exit code of a bug: the others go on
        if debug:
            raise
        where = traceback.extract_tb(bug.__traceback__)[-1]
        words = f"internal error: {type(bug).__name__}: {bug} ({where.name})"
        return failure(row, HdassistError(words, "this is a bug in hdassist; --debug shows where"))
    return answer_of(row.request, result, fail_on, row.place)


def _known(row: LotRow, fault: HdassistError) -> Future[Answer]:
    """The answer of a row that is known to be wrong: nothing is asked."""
    found: Future[Answer] = Future()
    found.set_result(failure(row, fault))
    return found


def failure(row: LotRow, error: HdassistError) -> Answer:
    """The answer about a row that has none; what is wrong with a row is wrong data, not wrong usage."""
    message = error.message if row.fault else of_cells(error.message, row.request, row.cells)
    place = "" if row.place in message else f"{row.place}: "
    usage = isinstance(error, UsageError)
    return replace(
        failure_of(row.request, error),
        error=ErrorRecord(f"{place}{message}", error.hint, DataError.fault if usage else error.fault),
        exit_code=DataError.exit_code if usage else error.exit_code,
        request=None if row.fault else row.request,
        place=row.place,
    )
