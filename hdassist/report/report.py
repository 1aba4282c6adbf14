"""A report: the answer of a command, declared once for people, scripts and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from hdassist.json_parts import Json
from hdassist.report.blocks import Block

if TYPE_CHECKING:
    from hdassist.preset.fields import Drive
    from hdassist.solve.throughcvxpy import CrossCheck


class ReportProof(Protocol):
    """States that were solved behind an answer, and their greatest residual as a share of its scale.

    A Certificate has the residuals one by one too.
    """

    @property
    def states(self) -> int:
        """How many there are."""

    @property
    def max_residual(self) -> float:
        """Their greatest residual."""


CsvTable = tuple[Sequence[str], Sequence[Sequence[Any]]]  # header and rows


@dataclass(frozen=True)
class Report:
    """The answer of a command about one drive or file.

    command; drive, None where there is none; head, the subject of the answer, empty where there is no page; verdict, a
    word; why, sentences below it.
    blocks of the page, and those that only --details shows; certificate and cross-checks of the states behind it.
    values: keys of JSON beside those that all answers have, results among them as as_json takes them; csv; line: the
    answer alone.
    about: the subject of warnings, the drive or its file where it is empty; warnings; exit_code.
    """

    command: str
    drive: Drive | None
    head: str
    verdict: str = ""
    why: tuple[str, ...] = ()
    blocks: tuple[Block, ...] = ()
    details: tuple[Block, ...] = ()
    certificate: ReportProof | None = None
    cross_checks: tuple[CrossCheck | None, ...] = ()
    values: Json = field(default_factory=dict)
    csv: CsvTable | None = None
    line: str = ""
    about: str = ""
    warnings: tuple[str, ...] = ()
    exit_code: int = 0

    @property
    def subject(self) -> str:
        """The subject of warnings; empty without any."""
        return self.about or (self.drive.name if self.drive else "")
