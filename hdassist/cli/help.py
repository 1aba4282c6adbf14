"""Help texts: commands by what they are for, options by what they are about, no summary cut short."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import partial
from inspect import unwrap
from typing import Any, TypeAlias, get_args, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup

# of click, of which typer has a copy: nothing but its subclasses is public
Context: TypeAlias = Any
Formatter: TypeAlias = Any

OTHERS = "Options"
SECTIONS = (  # of options, in their order; sections of commands stand before them
    "Arguments", OTHERS, "Drive", "Measured trace", "Measured teeth", "Trials", "Card", "Lot", "Archive", "Controller",
    "Answer", "Advanced",
)  # fmt: skip
_NOTE = re.compile(r"  \[(?:default: )?\(?([^;\]]*?)\)?(?:; [^\]]*)?\]$")  # default and range, as typer writes them
WIDEST = 31  # columns of names of options: --limit [NAME@TORQUE=]VALUE ...
LONGEST_SENTENCE = 1000  # characters: no first sentence of a help text is longer


class Command(TyperCommand):
    """A command that is a dataclass: its fields are the options, its docstring the help, `run` gives the exit code.

    Its help has a section for each group of options, and its numbers are written in ASCII digits.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        kinds = get_type_hints(unwrap(options["callback"]))
        parameter: Any
        for parameter in self.params:
            if _is_numeric(kinds.get(parameter.name)):
                parameter.process_value = partial(_process, parameter, parameter.process_value)

    def invoke(self, ctx: Context) -> None:
        """Make the command of its options, run it, and leave with its exit code."""
        from hdassist.terminal.limits import require_memory

        require_memory()
        try:
            code = super().invoke(ctx).run()
        except KeyboardInterrupt:  # before there was anything to answer with
            from hdassist.terminal.output import note

            note("interrupted")
            code = 130
        ctx.exit(code)

    def format_options(self, ctx: Context, formatter: Formatter) -> None:
        """Write arguments and options in their sections."""
        help_sections(formatter, (with_panel(parameter, ctx) for parameter in self.get_params(ctx)))


class Commands(TyperGroup):
    """A command of commands whose help has a section for each group of them."""

    def format_options(self, ctx: Context, formatter: Formatter) -> None:
        """Write the commands, then the options."""
        shown = [command for name in self.list_commands(ctx) if not (command := self.commands[name]).hidden]
        help_sections(formatter, ((_panel(c, "Commands"), (str(c.name), _summary(c))) for c in shown))
        help_sections(formatter, (with_panel(parameter, ctx) for parameter in self.get_params(ctx)))


def _is_numeric(hint: Any) -> bool:
    return bool({int, float} & {hint, *get_args(hint)})


def _process(parameter: Any, process: Callable[[Context, Any], Any], ctx: Context, value: Any) -> Any:
    """Process texts of an option of numbers, without the underscores and other scripts' digits that Python reads."""
    for text in value if isinstance(value, list | tuple) else [value]:
        if isinstance(text, str) and ("_" in text or not text.isascii()):
            raise typer.BadParameter(f"{text!r} is not a number: expected ASCII digits", ctx=ctx, param=parameter)
    return process(ctx, value)


def _summary(command: Any) -> str:
    return str(command.short_help or command.get_short_help_str(LONGEST_SENTENCE))


Record = tuple[str, str]  # what stands to the left and to the right in a help text


def with_panel(parameter: Any, ctx: Context) -> tuple[str, Record | None]:
    """The row of a parameter in a help text, with its section: of its default and range the default alone.

    Three dots stand behind an option that may be given several times.
    """
    kind = "Arguments" if parameter.param_type_name == "argument" else OTHERS
    record = parameter.get_help_record(ctx)
    if kind != OTHERS:
        return kind, record and (record[0].partition(" <")[0], _NOTE.sub("", record[1]))
    dots = " ..." * bool(getattr(parameter, "multiple", False))
    return _panel(parameter, kind), record and (record[0] + dots, _NOTE.sub(_default, record[1]))


def _default(note: re.Match[str]) -> str:
    return "" if note[1] == "-" or "<=" in note[1] else note[0] if note[1] == "required" else f" [{note[1]}]"


def _panel(thing: Any, other: str) -> str:
    return getattr(thing, "rich_help_panel", None) or other


def help_sections(formatter: Formatter, records: Iterable[tuple[str, Record | None]]) -> None:
    """Write rows of a help text, each with the section that it belongs to."""
    panels: dict[str, list[Record]] = {}
    for panel, record in records:
        if record:
            panels.setdefault(panel, []).append(record)
    for panel, rows in sorted(panels.items(), key=lambda one: SECTIONS.index(one[0]) if one[0] in SECTIONS else -1):
        with formatter.section(panel):
            formatter.write_dl(rows, col_max=WIDEST)
