"""Drives worked on by several processes: answers come in their order."""

from __future__ import annotations

import traceback
from collections import Counter, deque
from collections.abc import Hashable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import replace
from itertools import islice

from hdassist.acceptance.accept import accept
from hdassist.acceptance.answer import AcceptAnswer, ErrorRecord, failure_of
from hdassist.acceptance.lot import LotRow
from hdassist.acceptance.predictions import Predictions
from hdassist.acceptance.request import FailOn, Request
from hdassist.errors import DataError, HdassistError, UsageError


def answer_rows(
    rows: Sequence[LotRow], executor: Executor, fail_on: FailOn, *, jobs: int, debug: bool = False
) -> Iterator[AcceptAnswer]:
    """An answer for each row, in their order; the fault of a row is its answer.

    Each different drive is predicted once, then its rows are answered: an answer says the same as if its drive were
    alone. jobs: processes of the executor, and so drives that are predicted at a time; an interrupt loses what is done
    out of order.
    """
    keys = [None if row.fault or row.request.measured_only else _drive_key(row.request) for row in rows]
    left, predicted = Counter(keys), dict[Hashable, Future[Predictions | None]]()
    to_predict = iter({key: row.request for key, row in zip(keys, rows, strict=True) if key}.items())
    answered: deque[Future[AcceptAnswer]] = deque()
    for key, row in zip(keys, rows, strict=True):
        while key:
            running = [each for each in predicted.values() if not each.done()]
            for name, request in islice(to_predict, jobs - len(running)):
                predicted[name] = executor.submit(_predict, request)
                running.append(predicted[name])
            if key in predicted and predicted[key].done():
                break
            while answered:  # before a wait that may be long
                yield answered.popleft().result()
            wait(running, return_when=FIRST_COMPLETED)
        if row.fault:  # known to be wrong: nothing is asked
            answered.append(Future())
            answered[-1].set_result(row_failure(row, row.fault))
        else:
            predictions = predicted[key].result() if key else None
            answered.append(executor.submit(_answer, row, fail_on, predictions, debug))
        left[key] -= 1
        if not left[key]:
            predicted.pop(key, None)
        while answered and (answered[0].done() or len(answered) > jobs):
            yield answered.popleft().result()
    while answered:
        yield answered.popleft().result()


def _drive_key(request: Request) -> Hashable:
    """Key of equal predictions: all of a request but the serial, the files and the values measured."""
    names = tuple(value.name for value in request.values)
    return replace(request, serial="", measured=(), values=()), tuple(each.torque for each in request.measured), names


def _predict(request: Request) -> Predictions | None:
    """Predictions of a drive; None where there are none, which the rows themselves then say."""
    try:
        drive = request.load()
        return request.predict(drive, request.read_wheels(drive))
    except Exception:  # a bug too: each row meets it again when it is answered, and says it with its place
        return None


def _answer(row: LotRow, fail_on: FailOn, predictions: Predictions | None, debug: bool) -> AcceptAnswer:
    try:
        drive = row.request.load()
        inputs = row.request.read(drive)
        predictions = predictions or row.request.predict(drive, inputs.wheels)
        return accept(row.request, inputs, predictions, fail_on=fail_on, place=row.place)
    except HdassistError as error:
        return row_failure(row, error)
    except (MemoryError, OSError):  # what the system refuses is no row's
        raise
    except Exception as bug:  # that row's answer, with the exit code of a bug: the others go on
        if debug:
            raise
        where = traceback.extract_tb(bug.__traceback__)[-1]
        words = f"internal error: {type(bug).__name__}: {bug} ({where.name})"
        return row_failure(row, HdassistError(words, "this is a bug in hdassist; --debug shows where"))


def row_failure(row: LotRow, error: HdassistError) -> AcceptAnswer:
    """The answer of a row with an error; the fault of a row is wrong data, not wrong usage."""
    kind = DataError if isinstance(error, UsageError) else error
    return replace(
        failure_of(row.request, error),
        error=ErrorRecord(row.message(error), error.hint, kind.fault),
        exit_code=kind.exit_code,
        request=None if row.fault else row.request,
        place=row.place,
    )
