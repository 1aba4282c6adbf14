"""Files that the explorer writes: cards, presets and pictures; never over a file without asking."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

from hdassist.commands.card import CARD_SUFFIXES, CardFile
from hdassist.errors import HdassistError, UsageError
from hdassist.explorer.asking import Asking
from hdassist.explorer.screens import Confirm
from hdassist.explorer.words import why_no_card
from hdassist.loading.write import with_changes
from hdassist.mounting.advice import Advice
from hdassist.pages.mount import mount_card_facts
from hdassist.pages.trials import trials_card_facts
from hdassist.terminal.files import put_text, require_writable
from hdassist.terminal.texts import texts
from hdassist.trials.advice import TrialAdvice
from hdassist.visible import visible


class Exporting(Asking):
    """Actions that write a file."""

    @property
    def advice(self) -> Advice | TrialAdvice | None:
        """The advice that is shown."""
        return (self.of_trials or self.known).advice

    def named(self, end: str) -> str:
        """A file's name that begins as the preset's."""
        return f"{Path(self.session.source.name).stem or 'drive'}{end}"

    def action_card(self) -> None:
        """Write the assembly card of the advice, if there is one to write."""
        advice = self.advice
        if advice is None or why_no_card(advice):
            self.notify(f"no card: {why_no_card(advice)}", severity="warning")
            return
        hint = f"{', '.join(CARD_SUFFIXES)}; from {'the prediction' if isinstance(advice, Advice) else 'these trials'}"
        fields, say = [("file", self.named("-card.html")), ("serial number", "")], texts()
        facts = mount_card_facts(advice, say) if isinstance(advice, Advice) else trials_card_facts(advice, say)

        def card(values: tuple[str, ...]) -> CardFile:
            return CardFile.named(values[0], say, values[1])

        self.fill_in(
            "assembly card", fields, hint, lambda values: self.write(values[0], lambda: card(values).text(facts)), card
        )

    def action_save(self) -> None:
        """Write the preset with the changes, its comments and order as they are."""
        source, overrides = self.session.source, self.session.drive.origin.overrides
        if not overrides:
            self.notify("nothing is changed: there is nothing to save")
            return

        text = partial(with_changes, source.text, source.file, overrides)
        fields = [("file", source.file if Path(source.file).suffix else self.named("-changed.yaml"))]
        hint = "comments and order of the original are kept"
        self.fill_in("save the preset", fields, hint, lambda values: self.write(values[0], text))

    def action_picture(self) -> None:
        """Write the screen as SVG."""

        def take(values: tuple[str, ...]) -> None:
            # once the form has gone
            self.set_timer(0.1, lambda: self.write(values[0], lambda: without_fonts(self.export_screenshot())))

        self.fill_in("picture", [("file", self.named(".svg"))], "the screen as it is, as SVG", take)

    def action_copy(self) -> None:
        """Put the command line on the clipboard."""
        self.copy_to_clipboard(self.session.command())
        self.notify("the command line is on the clipboard")

    def write(self, path: str, text: Callable[[], str]) -> None:
        """Write a text to a file, an existing one only after asking."""
        try:
            if path == "-":
                raise UsageError("the screen has standard output", "name a file")
            require_writable(path, force=True)
            made = text()
        except HdassistError as error:
            self.complain(error)
            return

        def put(sure: bool | None) -> None:
            if not sure:
                return
            try:
                put_text(path, made)
            except HdassistError as error:
                self.complain(error)
                return
            self.notify(visible(f"wrote {path}"), markup=False)

        if Path(path).exists():
            self.push_screen(Confirm(f"{path} exists. Replace it?"), put)
        else:
            put(True)


def without_fonts(svg: str) -> str:
    """A picture that loads no fonts from elsewhere: it is shown in those that are there."""
    return re.sub(r"\s*@font-face \{.*?\}", "", svg, flags=re.DOTALL)
