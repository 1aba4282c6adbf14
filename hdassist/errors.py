"""Errors that a user can act on; each class knows the exit code it ends a command with."""

from dataclasses import dataclass
from enum import StrEnum


class Fault(StrEnum):
    """Kinds of errors, by stable codes; `hdassist explain CODE` has the meaning of each."""

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
    """Base of every error that hdassist raises on purpose: a message, a hint at the remedy, and its kind."""

    exit_code = 1
    fault = Fault.BUG

    def __init__(self, message: str, hint: str = "", fault: Fault | None = None) -> None:
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
    """A file cannot be read or written, or has invalid contents."""

    exit_code = 4
    fault = Fault.DATA


@dataclass(frozen=True)
class Finding:
    """One fault of a file: its place (file, line, column, path), message, the text as written, and a hint."""

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
    """A preset or a table is invalid; it has all findings, in the order of the file."""

    fault = Fault.FILE_INVALID

    def __init__(self, findings: list[Finding]) -> None:
        super().__init__("\n".join(map(str, findings)))
        self.findings = tuple(findings)


class UntrustedError(HdassistError):
    """An answer that cannot be trusted, and so is not given."""

    exit_code = 5
    fault = Fault.UNTRUSTED
