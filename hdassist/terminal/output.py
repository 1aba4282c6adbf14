"""Where a command's answer, its files and its progress go."""

from __future__ import annotations

import io
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from hdassist.errors import Fault, HdassistError
from hdassist.run.stops import at_stop
from hdassist.terminal.console import PIPE_WIDTH, Style, console, say, stderr_style
from hdassist.terminal.files import take_output, write_text
from hdassist.visible import visible

if TYPE_CHECKING:
    from rich.console import RenderableType

WIPED = "\r\x1b[2K\x1b[?25h"  # the line of a bar emptied, and the cursor shown
PATIENCE = 0.5  # s of work before a progress bar appears


@dataclass(frozen=True)
class Output:
    """Streams and files of one command: target takes the answer, csv the figures; "-" is stdout."""

    style: Style
    target: str = "-"
    csv: str | None = None
    force: bool = False
    no_color: bool = False

    @classmethod
    def open(
        cls,
        target: str = "-",
        csv: str | None = None,
        *,
        force: bool = False,
        ascii: bool = False,
        no_color: bool = False,
    ) -> Output:
        """Output of a command; refuses files that cannot be written before anything is computed."""
        for path in filter(None, (target, csv)):
            take_output(path, force)
        style = Style.of(sys.stdout, ascii=ascii, no_color=no_color)
        return cls(style if target == "-" else Style(style.ascii, False, PIPE_WIDTH), target, csv, force, no_color)

    def human(self, answer: RenderableType) -> None:
        """Give the answer for people; silent where the figures take stdout."""
        if self.csv == "-":
            return
        if self.style.codes:
            console(sys.stdout, self.style).print(answer)
            return
        self.text(self.page(answer))

    def page(self, answer: RenderableType) -> str:
        """The answer for people as plain text."""
        page = io.StringIO()
        console(page, replace(self.style, codes=False)).print(answer)
        return "\n".join(line.rstrip() for line in page.getvalue().splitlines()).rstrip() + "\n"

    def text(self, answer: str) -> None:
        """Give an answer that is text, hidden characters escaped: JSON has none."""
        write_text(self.target, visible(answer), self.force)

    def figures(self, csv: str) -> None:
        """Write the figures where they were asked for."""
        if self.csv is not None:
            write_text(self.csv, csv, self.force)

    @contextmanager
    def progress(self, words: str, total: int) -> Iterator[Callable[[int], None]]:
        """A bar with the time left, on a terminal only and once the work has taken PATIENCE."""
        style = stderr_style(no_color=self.no_color)
        if not style.codes:
            yield lambda _: None
            return
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TextColumn("{task.percentage:3.0f} %"),
            TimeRemainingColumn(),
            console=console(sys.stderr, style), transient=True,
            redirect_stdout=sys.stdout.isatty(),  # lines above the bar; what goes to a file is none of its business
        )  # fmt: skip
        task = bar.add_task(style.text(words), total=total)
        begun = time.monotonic()

        def advance(states: int) -> None:
            bar.advance(task, states)
            if not bar.live.is_started and time.monotonic() - begun > PATIENCE:
                bar.start()

        def wipe() -> None:
            if bar.live.is_started:
                sys.stderr.write(WIPED)
                sys.stderr.flush()

        try:
            with at_stop(wipe):
                yield advance
        finally:
            if bar.live.is_started:
                bar.stop()


def complain(error: HdassistError, about: str = "") -> None:
    """Say an error on stderr, with what to do about it."""
    where = f"{about}: " if about else ""
    note(f"error: {where}{error.message}\n  hint: {with_code(error.hint, error.fault)}")


def with_code(hint: str, fault: Fault) -> str:
    """A hint, and the command that says more about an error of its kind."""
    return f"{hint} (hdassist explain {fault})" if hint else f"hdassist explain {fault}"


def warn(text: str) -> None:
    """Say a warning on stderr."""
    note(f"warning: {text}")


def note(text: str) -> None:
    """Say something beside the answer on stderr."""
    say(text)
