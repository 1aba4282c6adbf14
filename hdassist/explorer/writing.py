"""What the explorer writes: cards, presets, JSON and pictures; never over a file without asking."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from hdassist.errors import DataError, HdassistError, UsageError
from hdassist.explorer.answers import Advised, Failed, Rendered
from hdassist.explorer.asking import Asking
from hdassist.explorer.questions import RenderQuestion
from hdassist.explorer.screens import Confirm
from hdassist.loading.write import with_changes
from hdassist.mounting.card_command import KINDS, SERIAL
from hdassist.terminal.files import put_text, require_writable
from hdassist.visible import visible


def name_of(session_name: str) -> str:
    """A preset's name as the beginning of a file's."""
    return Path(session_name).stem or "drive"


class Writing(Asking):
    """Actions that write a file."""

    def action_card(self) -> None:
        """Write the assembly card of the advice, if there is one to write."""
        advised = self._settled_advice()
        if advised is None:
            return
        fields = [("file", f"{name_of(self.session.source.name)}-card.html"), ("serial number", "")]
        hint = f"{', '.join(KINDS)}; from {'these trials' if advised.command == 'trials' else 'the prediction'}"

        def take(values: tuple[str, ...]) -> None:
            path, serial = values
            self._write_rendered(path, RenderQuestion(advised.sealed, Path(path).suffix.lower(), serial))

        self.fill_in("assembly card", fields, hint, take, _require_card)

    def _settled_advice(self) -> Advised | None:
        """The advice that a card may be made of; None, with the reason said, where there is none."""
        here = self.of_trials or self.known
        if here.advised is None:
            self.notify("no card yet: nothing is ordered before it is proven", severity="warning")
            return None
        if not here.advised.settled:
            self.notify(visible(f"no card: {here.advised.why_not}"), severity="warning", markup=False)
            return None
        return here.advised

    def action_json(self) -> None:
        """Write the JSON of the command that gives the same answer."""
        here = self.of_trials or self.known
        if (advised := here.advised) is None:
            self.notify("no JSON yet: the answer is being computed", severity="warning")
            return
        default = f"{name_of(self.session.source.name)}-{advised.command}.json"

        def take(values: tuple[str, ...]) -> None:
            self._write_rendered(values[0], RenderQuestion(advised.sealed, "json"))

        self.fill_in("JSON", [("file", default)], f"as {self.session.command()} --json", take)

    def _write_rendered(self, path: str, question: RenderQuestion) -> None:
        """Have a text made, and write it."""

        async def made() -> None:
            async for answer in self.service.ask(question):
                if isinstance(answer, Rendered):
                    self.write(path, partial(str, answer.text))
                elif isinstance(answer, Failed):
                    self.complain(DataError(answer.message, answer.hint))

        self.run_worker(made(), group="render")

    def action_save(self) -> None:
        """Write the preset with the changes, its comments and order as they are."""
        source, session = self.session.source, self.session
        if not (session.changes or source.overrides):
            self.notify("nothing is changed: there is nothing to save")
            return
        default = source.file if Path(source.file).suffix else f"{name_of(source.name)}-changed.yaml"

        def saved() -> None:
            self.settled = replace(self.settled, changes=session.changes)

        def take(values: tuple[str, ...]) -> None:
            self.write(values[0], partial(with_changes, source.text, source.file, session.overrides), saved)

        self.fill_in("save the preset", [("file", default)], "comments and order of the original are kept", take)

    def action_picture(self) -> None:
        """Write the screen as SVG."""

        def take(values: tuple[str, ...]) -> None:
            # once the form has gone
            self.set_timer(0.1, lambda: self.write(values[0], lambda: without_fonts(self.export_screenshot())))

        default = f"{name_of(self.session.source.name)}.svg"
        self.fill_in("picture", [("file", default)], "the screen as it is, as SVG", take)

    def action_copy(self) -> None:
        """Put the command line on the clipboard."""
        self.copy_to_clipboard(self.session.command())
        self.notify("the command line is on the clipboard")

    def write(self, path: str, text: Callable[[], str], done: Callable[[], None] = lambda: None) -> None:
        """Write a text to a file, one that is there only after asking, and then do what is to be done after it."""
        try:
            if path == "-":
                raise UsageError("the screen has standard output", "name a file")
            require_writable(path, force=True)
            there = text()
        except HdassistError as error:
            self.complain(error)
            return

        def put(sure: bool | None) -> None:
            if not sure:
                return
            try:
                put_text(path, there)
            except HdassistError as error:
                self.complain(error)
                return
            self.notify(visible(f"wrote {path}"), markup=False)
            done()

        if Path(path).exists():
            self.push_screen(Confirm(f"{path} exists. Replace it?"), put)
        else:
            put(True)


def _require_card(values: tuple[str, ...]) -> None:
    """Raise UsageError for a name or a serial number that a card cannot have."""
    path, serial = values
    if Path(path).suffix.lower() not in KINDS:
        raise UsageError(f"a card cannot be written as {path!r}", f"its name ends in {', '.join(KINDS)}")
    if len(serial) > SERIAL or (serial and not serial.isprintable()):
        raise UsageError(f"a serial number has up to {SERIAL} printable characters")


def without_fonts(svg: str) -> str:
    """A picture that loads no fonts from elsewhere: it is shown in those that are there."""
    return re.sub(r"\s*@font-face \{.*?\}", "", svg, flags=re.DOTALL)
