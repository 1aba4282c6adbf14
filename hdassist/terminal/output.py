"""Where a command's answer, its files and its progress go."""

from __future__ import annotations

import io
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from hdassist.errors import Fault, HdassistError
from hdassist.plaintext import visible
from hdassist.run.stops import at_stop
from hdassist.terminal.console import Style, console, say, stderr_style
from hdassist.terminal.files import write_text

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from rich.console import RenderableType
    from rich.progress import Progress

    from hdassist.run.run import Run

WIPED = "\r\x1b[2K\x1b[?25h"  # the line of a bar emptied, and the cursor shown
BAR_PATIENCE = 0.5  # s of work before a progress bar with a total appears
TASK: Any = 0  # the only one of a bar
REDRAWN = 0.1  # s between two of its pictures


@dataclass(frozen=True)
class Output:
    """Streams and files of one command: target takes the answer, csv the figures; "-" is stdout.

    plots, details: whether pages have figures and all that they can show.
    """

    style: Style
    target: str = "-"
    csv: str | None = None
    force: bool = False
    no_color: bool = False
    plots: bool = True
    details: bool = False

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
    def run(self, words: str, states: int, options: object, begun: ProgressBar | None = None) -> Iterator[Run]:
        """How work of so many states is carried out, with a bar and words beside it; begun: a bar that is there.

        Its processes, seed and other solver are those that the options of a command have; one that solves each state
        by a slow solver of its own works in this process, and shows how far it is.
        """
        from hdassist.run.run import CROSS_SOLVER, Run

        found = {"jobs": None, "seed": 0, "cross_check": CROSS_SOLVER, "solver": None} | vars(options)
        alone = found["jobs"] is None or found["solver"] is not None
        if begun:
            begun.expect(words, states)
        bar = nullcontext(begun) if begun else self.progress(words, states)
        with bar as progress, nullcontext() if alone else self.workers(options) as executor:
            yield Run(executor, progress, found["seed"], found["cross_check"])

    @contextmanager
    def engine(self, options: object) -> Iterator[Executor | None]:
        """The executor that the options of a command name, None for processes of its own on this machine."""
        from hdassist.run.run import cluster
        from hdassist.solve.walk import installation

        if not (name := getattr(options, "executor", None)):
            yield None
            return
        with cluster(name, getattr(options, "jobs", 0), installation) as engine:
            yield engine

    @contextmanager
    def workers(self, options: object) -> Iterator[Executor]:
        """The executor that the options of a command name, or processes of its own on this machine."""
        from hdassist.run.run import workers

        with self.engine(options) as engine:
            if engine:
                yield engine
                return
            with workers(getattr(options, "jobs", 0)) as own:
                yield own

    @contextmanager
    def progress(self, words: str, total: int | None = None) -> Iterator[ProgressBar]:
        """A bar with the time left, on a terminal only: at once without a total, else after BAR_PATIENCE of work.

        Arguments: words beside it; total of work, None before that is known (`ProgressBar.expect`).
        """
        style = stderr_style(no_color=self.no_color)
        if not style.codes:
            yield ProgressBar()
            return
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TextColumn("{task.percentage:3.0f} %"),
            TimeRemainingColumn(),
            console=console(sys.stderr, style), transient=True,
            auto_refresh=False,  # without a thread of its own, beside which processes could not be forked
            redirect_stdout=sys.stdout.isatty(),  # lines above the bar; a file is left alone
        )  # fmt: skip
        bar.add_task(style.text(words), total=total)
        if total is None:
            bar.start()

        def wipe() -> None:
            if bar.live.is_started:
                sys.stderr.write(WIPED)
                sys.stderr.flush()

        try:
            with at_stop(wipe):
                yield ProgressBar(bar, style)
        finally:
            if bar.live.is_started:
                bar.stop()


class ProgressBar:
    """Called with work that was done, it moves a bar with one task; None where nobody looks. style: of its words."""

    def __init__(self, bar: Progress | None = None, style: Style | None = None) -> None:
        self._bar, self._style = bar, style
        self._next = time.monotonic() + BAR_PATIENCE  # that it is drawn

    def __call__(self, done: int) -> None:
        """Move on by work that was done."""
        if self._bar:
            self._bar.advance(TASK, done)
            if (now := time.monotonic()) > self._next:
                self._next = now + REDRAWN
                self._bar.start()
                self._bar.refresh()

    def expect(self, words: str, total: int | None = None) -> None:
        """Words beside the bar and the total, as soon as they are known."""
        if self._bar and self._style:
            self._bar.update(TASK, description=self._style.text(words), total=total, refresh=True)


def complain(error: HdassistError, about: str = "") -> None:
    """Write an error on stderr, with its remedy."""
    where = f"{about}: " if about else ""
    note(f"error: {where}{error.message}\n  hint: {with_code(error.hint, error.fault)}")


def with_code(hint: str, fault: Fault) -> str:
    """A hint, and the command that explains errors of its kind."""
    return f"{hint} (hdassist explain {fault})" if hint else f"hdassist explain {fault}"


def warn(text: str) -> None:
    """Write a warning on stderr."""
    note(f"warning: {text}")


def note(text: str) -> None:
    """Write a line beside the answer on stderr."""
    say(text)
