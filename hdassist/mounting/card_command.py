"""The assembly card of `hdassist mount`: what is asked for, checked before anything is computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from hdassist.errors import UsageError
from hdassist.terminal.files import require_writable, write_text
from hdassist.terminal.output import Output, note

if TYPE_CHECKING:
    from hdassist.mounting.advice import Advice
    from hdassist.terminal.texts import Texts
    from hdassist.trials.trial import Trial

KINDS = (".txt", ".md", ".html")
SERIAL = 60  # letters that a serial number may have


@dataclass(frozen=True)
class CardFile:
    """A card that was asked for: where it goes, its kind, language and serial number."""

    path: str
    kind: str
    say: Texts
    serial: str
    ascii: bool
    force: bool

    @classmethod
    def open(
        cls, path: str | None, lang: str | None, serial: str | None, *, out: Output, ascii: bool, instead: bool
    ) -> CardFile | None:
        """The card that options ask for, None without any.

        Arguments: options of the command line; out, where its other answers go; ascii, 7-bit characters only;
        instead, whether a card on stdout may stand in place of the answer. Raises UsageError and DataError before
        anything is computed.
        """
        if path is None:
            if lang is not None or serial is not None:
                raise UsageError("--lang and --serial are those of a card", "--card FILE writes one")
            return None
        from hdassist.terminal.texts import HOME, texts

        say = texts(HOME if lang is None else lang)
        kind = ".txt" if path == "-" else Path(path).suffix.lower()
        if kind not in KINDS:
            raise UsageError(f"a card cannot be written as {path!r}", f"its name ends in {', '.join(KINDS)}")
        if path == "-" and (out.csv == "-" or (out.target == "-" and not instead)):
            raise UsageError("--card - leaves no standard output for --json, -q or --csv -")
        if path != "-" and any(_same(path, other) for other in (out.target, out.csv)):
            raise UsageError(f"{path} is to take the card and another answer")
        number = serial or ""
        if not (number == "" or number.isprintable()) or len(number) > SERIAL:
            raise UsageError(f"a serial number has up to {SERIAL} printable characters")
        require_writable(path, out.force)
        return cls(path, kind, say, number.strip(), ascii or (path == "-" and out.style.ascii), out.force)

    def replaces(self, out: Output) -> bool:
        """Whether the card takes the place of the answer on stdout."""
        return self.path == "-" and out.target == "-"

    def write(
        self, advice: Advice, trials: Sequence[Trial] = (), at: float = 0.0, warned: Sequence[str] | None = None
    ) -> None:
        """Make the card and write it; an interrupted advice has none.

        Arguments: advice; trials that it rests on, and their torque [N*m]; warned, what the card warns of, without it
        what the advice does.
        """
        if advice.curve.interrupted:
            note("no card: the work was interrupted")
            return
        from hdassist.mounting import card_html, card_markdown, card_text
        from hdassist.mounting.card import card_of

        card = card_of(advice, self.say, serial=self.serial, made=date.today(), trials=trials, at=at, warned=warned)
        if self.kind == ".html":
            text = card_html.render(card)
        elif self.kind == ".md":
            text = card_markdown.render(card)
        else:
            text = card_text.render(card, ascii=self.ascii)
        write_text(self.path, text, self.force)


def _same(path: str, other: str | None) -> bool:
    return other not in (None, "-") and Path(path).resolve() == Path(str(other)).resolve()
