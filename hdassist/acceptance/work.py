"""The rows of a lot as work for `run/run.stream`: each row's answer is that of its drive alone."""

import traceback
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from functools import lru_cache

from hdassist.acceptance.accept import accept
from hdassist.acceptance.answer import AcceptAnswer, ErrorRecord, PresetRecord, now
from hdassist.acceptance.limits import Limit
from hdassist.acceptance.lot import LotRow
from hdassist.acceptance.predictions import Predictions
from hdassist.acceptance.request import Request
from hdassist.errors import DataError, HdassistError, UsageError
from hdassist.version import __version__


def answer_rows(rows: Sequence[LotRow], debug: bool, first: int, last: int) -> list[AcceptAnswer]:
    """Answers to the rows first ... last - 1; debug: whether a bug in a row is raised, and no answer."""
    return [answer_row(row, debug=debug) for row in rows[first:last]]


def answer_row(row: LotRow, *, debug: bool = False) -> AcceptAnswer:
    """The answer of a row; whatever is wrong with it is its answer."""
    try:
        if row.fault:
            raise row.fault
        drive = row.request.load()
        inputs = row.request.read(drive)
        alike = replace(row.request, serial="", measured=(), values=())
        predictions = predicted(alike, inputs.unmeasured)
        return accept(row.request, inputs, predictions, row.place)
    except HdassistError as error:
        return failure_of(row, error)
    except (MemoryError, OSError, BrokenExecutor):  # a refusal of the system, or a lost process, is no row's
        raise
    except Exception as bug:  # that row's answer, with the exit code of a bug: the others go on
        if debug:
            raise
        where = traceback.extract_tb(bug.__traceback__)[-1]
        words = f"internal error: {type(bug).__name__}: {bug} ({where.name})"
        return failure_of(row, HdassistError(words, "this is a bug in hdassist; --debug shows where"))


@lru_cache(maxsize=2)
def predicted(request: Request, limits: tuple[Limit, ...]) -> Predictions | None:
    """Predictions for limits of a drive, kept for the next row in this process that needs the same."""
    drive = request.load()
    return request.predict(drive, limits, request.read_wheels(drive))


def failure_of(row: LotRow, error: HdassistError) -> AcceptAnswer:
    """The answer of a row with an error; the fault of a row is wrong data, not wrong usage."""
    kind, request = DataError if isinstance(error, UsageError) else error, row.request
    return AcceptAnswer(
        version=__version__, preset=PresetRecord(request.preset), exit_code=kind.exit_code, serial=request.serial,
        seed=request.seed, request=None if row.fault else request, time=now(), place=row.place,
        error=ErrorRecord(row.message(error), error.hint, kind.fault),
    )  # fmt: skip
