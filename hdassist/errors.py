"""Errors that a user can act on; each class knows the exit code it ends a command with."""

from __future__ import annotations

from dataclasses import dataclass


class HdassistError(Exception):
    """Base of every error that hdassist raises on purpose: a message, and a hint at what to do."""

    exit_code = 1

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


class UsageError(HdassistError):
    """The command line or a call asks for something that cannot be meant."""

    exit_code = 2


class DataError(HdassistError):
    """A file cannot be read or written, or says something that cannot be used."""

    exit_code = 4


@dataclass(frozen=True)
class Finding:
    """One thing wrong with a preset: where (file, line, column, path), what, the value and a hint."""

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
    """A preset is invalid; carries every finding at once, in the order of the file."""

    def __init__(self, findings: list[Finding]) -> None:
        super().__init__("\n".join(map(str, findings)))
        self.findings = tuple(findings)


class UntrustedError(HdassistError):
    """An answer was found that cannot be trusted, so it is not given."""

    exit_code = 5
