"""Help texts: commands by their purpose, options by their subject, no summary cut short."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from inspect import unwrap
from typing import Any, TypeAlias, get_args, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup

from hdassist.errors import DataError, Fault, HdassistError, UsageError

# of click, of which typer has a copy: only its subclasses are public
Context: TypeAlias = Any
Formatter: TypeAlias = Any

OTHERS = "Options"
SECTIONS = (  # of options, in their order; sections of commands stand before them
    "Arguments", OTHERS, "Drive", "Measured trace", "Measured teeth", "Trials", "Card", "Lot", "Archive", "Controller",
    "Answer", "Advanced",
)  # fmt: skip
_NOTE = re.compile(r"  \[(?:default: )?\(?([^;\]]*?)\)?(?:; [^\]]*)?\]$")  # default and range, as typer writes them
WIDEST = 31  # columns of names of options: --limit [NAME@TORQUE=]VALUE ...
ADDRESSES = 512_000_000  # bytes: with less OpenBLAS waits for ever while it is loaded, or ends the process
LONGEST_SENTENCE = 1000  # characters: no first sentence of a help text is longer


class Sectioned:
    """A command whose help has its options in sections, behind rows of its own."""

    def rows(self) -> Iterable[Row]:
        """Rows that stand before the options, with their sections."""
        return ()

    def format_options(self, ctx: Context, formatter: Formatter) -> None:
        """Write the rows, then the options, each in its section."""
        command: Any = self
        panels: dict[str, list[tuple[str, str]]] = {}
        for panel, record in (*self.rows(), *(_row(parameter, ctx) for parameter in command.get_params(ctx))):
            if record:
                panels.setdefault(panel, []).append(record)
        for panel, records in sorted(panels.items(), key=lambda p: SECTIONS.index(p[0]) if p[0] in SECTIONS else -1):
            with formatter.section(panel):
                formatter.write_dl(records, col_max=WIDEST)


class Command(Sectioned, TyperCommand):
    """A command that is a dataclass: its fields are the options, its docstring the help, `run` gives the exit code.

    Its help has a section for each group of options, and its numbers are written in ASCII digits.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        kinds = get_type_hints(unwrap(options["callback"]))
        parameter: Any
        for parameter in self.params:
            kind = kinds.get(parameter.name)
            if {int, float} & {kind, *get_args(kind)}:
                parameter.process_value = partial(_process, parameter, parameter.process_value)

    def invoke(self, ctx: Context) -> None:
        """Make the command of its options, run it, and leave with its exit code."""
        require_memory()
        command = super().invoke(ctx)
        try:
            code = command.run()
        except KeyboardInterrupt:  # before there was anything to answer with
            from hdassist.terminal.output import note

            note("interrupted")
            code = 130
        except HdassistError as error:
            if getattr(command, "json", False) and not isinstance(error, UsageError):
                from hdassist.terminal.runs import give_failure

                give_failure("-".join(ctx.command_path.split()[1:]), error, command)
            raise
        ctx.exit(code)


class Commands(Sectioned, TyperGroup):
    """A command of commands."""

    def rows(self) -> Iterator[Row]:
        """Commands and their summaries, with their sections."""
        for name, command in self.commands.items():
            yield "Commands", (name, command.get_short_help_str(LONGEST_SENTENCE))


def require_memory() -> None:
    """Raise DataError where the addresses that a process may have (ulimit -v) do not hold numpy and its solvers."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if 0 <= limit < ADDRESSES:
        words = f"the memory that a process may have is {limit / 1e6:.0f} MB: too little to compute with"
        raise DataError(words, f"ulimit -v {ADDRESSES // 1000} or more, in kB", Fault.SYSTEM_LIMITS)


def _process(parameter: Any, process: Callable[[Context, Any], Any], ctx: Context, value: Any) -> Any:
    """Process texts of an option of numbers, without the underscores and other scripts' digits that Python reads."""
    for text in value if isinstance(value, list | tuple) else [value]:
        if isinstance(text, str) and ("_" in text or not text.isascii()):
            raise typer.BadParameter(f"{text!r} is not a number: expected ASCII digits", ctx=ctx, param=parameter)
    return process(ctx, value)


Row = tuple[str, tuple[str, str] | None]  # section of a help text; its left and right column


def _row(parameter: Any, ctx: Context) -> Row:
    """The row of a parameter in a help text, with its section: of its default and range the default alone.

    Three dots stand behind an option that may be given several times.
    """
    kind = "Arguments" if parameter.param_type_name == "argument" else OTHERS
    record = parameter.get_help_record(ctx)
    if kind != OTHERS:
        return kind, record and (record[0].partition(" <")[0], _NOTE.sub("", record[1]))
    dots = " ..." * bool(getattr(parameter, "multiple", False))
    return parameter.rich_help_panel or kind, record and (record[0] + dots, _NOTE.sub(_default, record[1]))


def _default(note: re.Match[str]) -> str:
    return "" if note[1] == "-" or "<=" in note[1] else note[0] if note[1] == "required" else f" [{note[1]}]"
