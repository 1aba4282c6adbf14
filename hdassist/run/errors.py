"""Errors that a user can act on, verdicts, and the exit codes of commands for both."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from math import ceil, floor


class Fault(StrEnum):
    """Kinds of errors, by stable codes; `hdassist explain CODE` shows the meaning of each."""

    USAGE = "USAGE"
    FILE_EXISTS = "FILE_EXISTS"
    DATA = "DATA"
    FILE_UNREADABLE = "FILE_UNREADABLE"
    FILE_UNWRITABLE = "FILE_UNWRITABLE"
    FILE_INVALID = "FILE_INVALID"
    SYSTEM_LIMITS = "SYSTEM_LIMITS"
    UNTRUSTED = "UNTRUSTED"
    UNTRUSTED_STATE = "UNTRUSTED_STATE"
    SOLVERS_DISAGREE = "SOLVERS_DISAGREE"
    BEYOND_MODEL = "BEYOND_MODEL"
    NO_MESH = "NO_MESH"
    ORDERS_UNTOLD = "ORDERS_UNTOLD"
    FIT_UNSETTLED = "FIT_UNSETTLED"
    WORKERS_LOST = "WORKERS_LOST"
    MEMORY_SHORT = "MEMORY_SHORT"
    BUG = "BUG"


class HdassistError(Exception):
    """Base class of errors that hdassist raises intentionally, with a message, a hint and a kind."""

    exit_code = 1
    fault = Fault.BUG

    def __init__(
        self,
        message: str,
        hint: str = "",
        fault: Fault | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint
        if fault is not None:
            self.fault = fault


class UsageError(HdassistError):
    """Invalid arguments of the command line or of a call."""

    exit_code = 2
    fault = Fault.USAGE


class DataError(HdassistError):
    """A file that cannot be read or written, or has invalid contents."""

    exit_code = 4
    fault = Fault.DATA


_WORDS_OF_PYDANTIC = {
    "Value error, ": "",
    "Input should be a valid integer, unable to parse string as an integer": "must be a whole number",
    "Input should be a valid number, unable to parse string as a number": "must be a number",
    "Input should be": "must be",
    "a valid integer": "a whole number",
    "a valid ": "a ",
    "greater than or equal to": "at least",
    "less than or equal to": "at most",
    "greater than": "above",
    "less than": "below",
    "Field required": "missing key",
    "Unexpected keyword argument": "unknown key",
}


def validation_words(message: str) -> str:
    """Return a message of pydantic in the terms used by all other messages."""
    for theirs, ours in _WORDS_OF_PYDANTIC.items():
        message = message.replace(theirs, ours)
    return message


@dataclass(frozen=True)
class Finding:
    """A fault in a file.

    file, line, column, path: position of the fault.
    message: description of the fault.
    got: text as written in the file.
    hint: hint for its correction.
    """

    file: str
    line: int
    column: int
    path: str
    message: str
    got: str = ""
    hint: str = ""

    def __str__(self) -> str:
        notes = "; ".join(filter(None, (f"got {self.got}" if self.got else "", self.hint)))
        where = f"{self.file}:{self.line}:{self.column}"
        path = f"{self.path}: " if self.path else ""
        return f"{where}: {path}{self.message}" + (f" ({notes})" if notes else "")


class PresetError(DataError):
    """An invalid preset or table, with all findings in the sequence of the file."""

    fault = Fault.FILE_INVALID

    def __init__(self, findings: list[Finding]) -> None:
        super().__init__("\n".join(map(str, findings)))
        self.findings = tuple(findings)


class UntrustedError(HdassistError):
    """A result that cannot be trusted and is therefore not returned."""

    exit_code = 5
    fault = Fault.UNTRUSTED


# --- verdicts


class Verdict(StrEnum):
    """Decision of a check, as in JSON."""

    PASS = "PASS"
    FAIL = "FAIL"
    INCONCLUSIVE = "INCONCLUSIVE"
    NO_LIMIT = "NO_LIMIT"

    @property
    def exit_code(self) -> int:
        """Exit code of a command that ends with this verdict."""
        return {Verdict.FAIL: 3, Verdict.INCONCLUSIVE: 6}.get(self, 0)


GUARD = 1.65  # standard uncertainties between a measured value and its limit, for a one-sided probability of 95 %
SURE = 0.95  # smallest probability of meeting a limit for PASS; FAIL needs at most 1 minus this value


def verdict_by_probability(kept: float, sure: float = SURE) -> Verdict:
    """Return the verdict on the probability of meeting a limit: PASS from sure upwards, FAIL up to 1 - sure."""
    if kept >= sure:
        return Verdict.PASS
    return Verdict.FAIL if kept <= 1 - sure else Verdict.INCONCLUSIVE


def percent_text(
    value: float,
    low: float,
    high: float,
    needed: float | None = None,
    *,
    outcome: str = Verdict.PASS,
) -> str:
    """Return a probability in per cent with its Monte Carlo interval: 89 % (81 to 94); PASS needs 95 %.

    value, low, high: probability and ends of its interval, which are rounded outwards.
    needed: smallest probability for the outcome, which is shown if given. A smaller value is not rounded up to it, and
        a value above 1 - needed is not rounded down to 1 - needed.
    outcome: verdict or instruction that requires this probability.
    """
    percent = f"{100 * value:.0f}"
    if needed and verdict_by_probability(value, needed) is not verdict_by_probability(round(value, 2), needed):
        percent = f"{(floor if value > 0.5 else ceil)(1000 * value) / 10:.1f}"
    ends = f" ({floor(round(100 * low, 6))} to {ceil(round(100 * high, 6))})" if low < high else ""
    return f"{percent} %{ends}" + ("" if needed is None else f"; {outcome} needs {100 * needed:g} %")


def is_settled(
    low: float,
    high: float,
    sure: float = SURE,
) -> bool:
    """Return whether no threshold of a verdict is within the Monte Carlo interval of a probability."""
    return not any(low < threshold < high for threshold in (sure, 1 - sure))


SEVERITY = (Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.PASS, Verdict.NO_LIMIT)
_EXIT_SEVERITY = (1, 5, 4, 2, 3, 6, 0)  # exit codes, most severe first, for the combined result of several drives


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the most severe verdict, or NO_LIMIT if there are no verdicts."""
    return min(verdicts, key=SEVERITY.index, default=Verdict.NO_LIMIT)


def worst_exit_code(codes: Iterable[int]) -> int:
    """Return the most severe exit code; 0 if there are no codes."""
    return min(
        codes,
        key=lambda code: _EXIT_SEVERITY.index(code) if code in _EXIT_SEVERITY else -1,
        default=0,
    )
