"""Files that the explorer writes: cards, presets and pictures; never over a file without asking."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

from hdassist.commands.card import CARD_SUFFIXES, CardFile
from hdassist.errors import UsageError
from hdassist.explorer.asking import Asking
from hdassist.explorer.screens import Form, Notice
from hdassist.explorer.words import why_no_card
from hdassist.loading.write import with_changes
from hdassist.pages.mount import mount_card_facts
from hdassist.pages.report import report_html, report_markdown
from hdassist.plaintext import visible
from hdassist.terminal.console import Style
from hdassist.terminal.files import put_text, require_writable
from hdassist.terminal.texts import texts


class Exporting(Asking):
    """Actions that write a file."""

    def named(self, end: str) -> str:
        """A file's name that begins as the preset's."""
        return f"{Path(self.session.source.name).stem}{end}"

    def action_card(self) -> None:
        """Write the assembly card of the advice, if there is one to write."""
        advice, why = self.known.advice, why_no_card(self.known.report)
        if advice is None or why:
            self.notify(f"no card: {why}", severity="warning")
            return
        say = texts()
        facts = mount_card_facts(advice, say)
        hint = f"{', '.join(CARD_SUFFIXES)}; from {'the measured values' if advice.trials else 'the prediction'}"
        name = self.named("-card.html")
        self.ask_file("assembly card", name, hint, lambda path: CardFile.named(path, say, "").text(facts))

    def ask_file(
        self, title: str, name: str, hint: str, text: Callable[[str], str], written: Callable[[], object] = str
    ) -> None:
        """Ask for a file's name and write a text to it, made of that name; over a file only after asking.

        Argument: written, called once the text is in the file.
        """

        def put(path: str, made: str) -> None:
            put_text(path, made)
            written()
            self.notify(visible(f"wrote {path}"), markup=False)

        def write(path: str) -> None:
            if path == "-":
                raise UsageError("the screen has standard output", "name a file")
            require_writable(path, force=True)
            keep = partial(self.attempt, partial(put, path, text(path)))
            if Path(path).exists():
                question = f"{path} exists. Replace it?\n\ny yes\nn no"
                self.push_screen(Notice(question), lambda sure: keep() if sure else None)
            else:
                keep()

        def take(path: str) -> None:
            self.call_later(self.attempt, partial(write, path))  # once the form has gone

        self.push_screen(Form(f"{title}: file", name, hint, take))

    def action_report(self) -> None:
        """Write the page of `check` with all its tables."""
        if not (report := self.known.page):
            self.notify("no report before the answer is whole", severity="warning")
            return

        def text(path: str) -> str:
            style = Style(ascii=self.ascii, codes=False, width=80)
            return report_html(report) if path.endswith(".html") else report_markdown(report, style)

        hint = ".html, else Markdown: all of check; hdassist report has the tables of mount and stiffness too"
        self.ask_file("report", self.named("-check.html"), hint, text)

    def action_save(self) -> None:
        """Write the preset with the changes, its comments and order as they are."""
        source, overrides = self.session.source, self.session.drive.origin.overrides
        if not overrides:
            self.notify("nothing is changed: there is nothing to save")
            return
        name = source.file if Path(source.file).suffix else self.named("-changed.yaml")
        hint = "comments and order of the original are kept"
        saved = partial(setattr, self, "saved", self.session.changes)
        self.ask_file("save the preset", name, hint, lambda _: with_changes(source.text, source.file, overrides), saved)

    def action_picture(self) -> None:
        """Write the screen as SVG."""
        hint = "the screen as it is, as SVG"
        self.ask_file("picture", self.named(".svg"), hint, lambda _: without_fonts(self.export_screenshot()))

    def action_copy(self) -> None:
        """Put the command line on the clipboard."""
        self.copy_to_clipboard(self.session.command())
        self.notify("the command line is on the clipboard")

    async def action_quit(self) -> None:
        """Leave; ask before where there is a change, also one undone, that is in no preset and was not opened."""
        command = self.session.command("explore")
        question = f"{command}\n\ncomes back to this session, and is printed on leaving.\n\ny leave\nn stay"
        if self.session.changes != self.saved or self.session.future:
            self.push_screen(Notice(question), lambda sure: self.exit() if sure else None)
        else:
            self.exit()


def without_fonts(svg: str) -> str:
    """A picture that loads no fonts from elsewhere: it is shown in those that are there."""
    return re.sub(r"\s*@font-face \{.*?\}", "", svg, flags=re.DOTALL)
