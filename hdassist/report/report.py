"""A report: the answer of a command, declared once for people, scripts and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from hdassist.json_parts import Json
from hdassist.report.blocks import Block

if TYPE_CHECKING:
    from hdassist.preset.fields import Drive
    from hdassist.solve.answers import Certificate
    from hdassist.solve.throughcvxpy import CrossCheck

CsvTable = tuple[Sequence[str], Sequence[Sequence[Any]]]  # header and rows


@dataclass(frozen=True)
class Report:
    """The answer of a command about one drive or file.

    command; drive, None where there is none; head, what the answer is about, empty where there is no page; verdict, a
    word; why, sentences below it.
    blocks of the page, and those that only --details shows; certificate and cross-checks of the states behind it, or
    proof, words in their place.
    values: keys of JSON beside those that all answers have; csv; line: the answer alone.
    about: of what warnings are said, the drive or its file where it is empty; warnings; exit_code.
    """

    command: str
    drive: Drive | None
    head: str
    verdict: str = ""
    why: tuple[str, ...] = ()
    blocks: tuple[Block, ...] = ()
    details: tuple[Block, ...] = ()
    certificate: Certificate | None = None
    cross_checks: tuple[CrossCheck | None, ...] = ()
    proof: str = ""
    values: Json = field(default_factory=dict)
    csv: CsvTable | None = None
    line: str = ""
    about: str = ""
    warnings: tuple[str, ...] = ()
    exit_code: int = 0

    @property
    def subject(self) -> str:
        """What warnings are said of; empty without any."""
        return self.about or (self.drive.name if self.drive else "")
