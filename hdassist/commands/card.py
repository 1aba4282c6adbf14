"""The assembly card that `hdassist mount` writes beside its answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from hdassist.errors import UsageError
from hdassist.terminal.options import AnswerOptions, CardOptions

if TYPE_CHECKING:
    from hdassist.pages.card import CardFacts
    from hdassist.report import Report
    from hdassist.terminal.output import Output
    from hdassist.terminal.texts import Texts

CARD_SUFFIXES = (".txt", ".html")
SERIAL = 60  # letters that a serial number may have


@dataclass(frozen=True)
class CardFile:
    """A card that was asked for: where it goes, its kind, language and serial number."""

    path: str
    kind: str
    say: Texts
    serial: str
    ascii: bool = False
    force: bool = False

    @classmethod
    def asked(cls, asked: CardOptions, options: AnswerOptions, out: Output) -> CardFile | None:
        """The card that options ask for, None without any.

        Arguments: asked; options of the other answers, and out, where they go. Raises UsageError and DataError before
        anything is computed.
        """
        path = asked.card
        if path is None:
            if asked.lang is not None or asked.serial is not None:
                raise UsageError("--lang and --serial are those of a card", "--card FILE writes one")
            return None
        from hdassist.terminal.files import take_output
        from hdassist.terminal.texts import HOME, texts

        say = texts(HOME if asked.lang is None else asked.lang)
        card = cls.named(path, say, asked.serial or "")
        if path == "-" and (out.csv == "-" or (out.target == "-" and (options.json or options.quiet))):
            raise UsageError("--card - leaves no standard output for --json, -q or --csv -")
        take_output(path, out.force)
        ascii = options.ascii or (path == "-" and out.style.ascii)
        return replace(card, ascii=ascii, force=out.force)

    @classmethod
    def named(cls, path: str, say: Texts, serial: str) -> CardFile:
        """The card that a file's name asks for. Raises UsageError for a name or serial number that no card has."""
        kind = ".txt" if path == "-" else Path(path).suffix.lower()
        if kind not in CARD_SUFFIXES:
            raise UsageError(f"a card cannot be written as {path!r}", f"its name ends in {', '.join(CARD_SUFFIXES)}")
        if len(serial) > SERIAL or (serial and not serial.isprintable()):
            raise UsageError(f"a serial number has up to {SERIAL} printable characters")
        return cls(path, kind, say, serial.strip())

    def text(self, facts: CardFacts) -> str:
        """The card as its file has it."""
        from hdassist.pages.card import card_of
        from hdassist.pages.report import card_html, card_text

        card = card_of(facts, self.say, serial=self.serial, made=date.today())
        return card_html(card) if self.kind == ".html" else card_text(card, ascii=self.ascii)


def give_with_card(
    command: str,
    report: Report,
    card: CardFile | None,
    facts: Callable[[Texts], CardFacts],
    options: AnswerOptions,
    out: Output,
) -> int:
    """Write a report and its card; returns the exit code.

    Arguments: command, for the schema; report; card that was asked for; facts that it tells, in the language of its
    texts; options; out.
    """
    from hdassist.terminal.files import write_text
    from hdassist.terminal.runs import give

    if card and card.path == out.target == "-":  # the card in place of the page
        report = replace(report, head="")
    code = give(command, [report], options, out)
    if card:
        write_text(card.path, card.text(facts(card.say)), card.force)
    return code
