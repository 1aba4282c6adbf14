"""Drives worked on by several processes: answers come in their order."""

from __future__ import annotations

import traceback
from collections import Counter, deque
from collections.abc import Hashable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import replace
from itertools import islice

from hdassist.acceptance.accept import accept
from hdassist.acceptance.answer import AcceptAnswer, ErrorRecord, PresetRecord, now
from hdassist.acceptance.lot import LotRow
from hdassist.acceptance.predictions import Predictions
from hdassist.acceptance.request import Request, torque_and_file
from hdassist.errors import DataError, HdassistError, UsageError
from hdassist.version import __version__


def answer_rows(
    rows: Sequence[LotRow], executor: Executor, *, jobs: int, debug: bool = False
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
        while key and not (key in predicted and predicted[key].done()):
            running = [each for each in predicted.values() if not each.done()]
            for name, request in islice(to_predict, jobs - len(running)):
                predicted[name] = executor.submit(_predict, request)
                running.append(predicted[name])
            while answered:  # before a wait that may be long
                yield answered.popleft().result()
            wait(running, return_when=FIRST_COMPLETED)
        if row.fault:
            answered.append(Future())
            answered[-1].set_result(failure_of(row, row.fault))
        else:
            answered.append(executor.submit(_answer, row, predicted[key].result() if key else None, debug))
        left[key] -= 1
        if not left[key]:
            predicted.pop(key, None)
        while answered and (answered[0].done() or len(answered) > jobs):
            yield answered.popleft().result()
    while answered:
        yield answered.popleft().result()


def _drive_key(request: Request) -> Hashable:
    """Key of equal predictions: all of a request but the serial, the files and the values measured."""
    measured = tuple(torque_and_file(text)[0] for text in request.measured)
    return replace(request, serial="", measured=measured, values=tuple(text.split("=")[0] for text in request.values))


def _predict(request: Request) -> Predictions | None:
    """Predictions of a drive; None where there are none, which the rows themselves then say."""
    try:
        drive = request.load()
        return request.predict(drive, request.read_wheels(drive))
    except Exception:  # a bug too: each row meets it again when it is answered, and says it with its place
        return None


def _answer(row: LotRow, predictions: Predictions | None, debug: bool) -> AcceptAnswer:
    try:
        drive = row.request.load()
        inputs = row.request.read(drive)
        predictions = predictions or row.request.predict(drive, inputs.wheels)
        return accept(row.request, inputs, predictions, row.place)
    except HdassistError as error:
        return failure_of(row, error)
    except (MemoryError, OSError):  # what the system refuses is no row's
        raise
    except Exception as bug:  # that row's answer, with the exit code of a bug: the others go on
        if debug:
            raise
        where = traceback.extract_tb(bug.__traceback__)[-1]
        words = f"internal error: {type(bug).__name__}: {bug} ({where.name})"
        return failure_of(row, HdassistError(words, "this is a bug in hdassist; --debug shows where"))


def failure_of(row: LotRow, error: HdassistError) -> AcceptAnswer:
    """The answer of a row with an error; the fault of a row is wrong data, not wrong usage."""
    kind, request = DataError if isinstance(error, UsageError) else error, row.request
    return AcceptAnswer(
        version=__version__, preset=PresetRecord(request.preset), exit_code=kind.exit_code, serial=request.serial,
        seed=request.seed, request=None if row.fault else request, time=now(), place=row.place,
        error=ErrorRecord(row.message(error), error.hint, kind.fault),
    )  # fmt: skip
