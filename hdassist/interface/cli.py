"""The hdassist command: its subcommands, their help, and its exit."""

from __future__ import annotations

import errno
import io
import os
import re
import shutil
import sys
import textwrap
import traceback
from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from importlib import import_module
from inspect import unwrap
from typing import Annotated, Any, TypeAlias, get_args, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup

from hdassist import __version__
from hdassist.interface.terminal.streams import give_stdout, say, silence
from hdassist.run.errors import DataError, Fault, HdassistError, UntrustedError, UsageError, validation_words
from hdassist.run.files import GREATEST, begin_run, is_written
from hdassist.run.system import address_limit, limits_hint, pipe_stream

# typer has a copy of click, of which only the subclasses are public
_Context: TypeAlias = Any
_Formatter: TypeAlias = Any

_OTHERS = "Options"
_SECTIONS = (  # sections of options in sequence; sections of commands come before them
    "Arguments",
    _OTHERS,
    "Drive",
    "Recording",
    "Tooth deviations",
    "Trials",
    "Card",
    "Test sheet",
    "Lot",
    "Archive",
    "Controller",
    "Output",
    "Advanced",
)
_NOTE = re.compile(r"  \[(?:default: )?\(?([^;\]]*?)\)?(?:; [^\]]*)?\]$")  # default and range in typer's notation
_WIDEST = 31  # largest width of option names in columns, for example --limit [NAME@TORQUE=]VALUE ...
# smallest address space [bytes]; with a smaller one, OpenBLAS hangs or ends the process while it loads
_ADDRESSES = 512_000_000
_SECTION_COLUMNS = 12  # width of the section column on the start page
_NAME_COLUMNS = 13  # width of the name column on the start page
_LONGEST_SENTENCE = 1000  # limit for the first sentence of a help text [characters], which no sentence reaches


def bold(text: str) -> str:
    """Return a text in bold if standard output is a terminal with control codes."""
    plain = bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb" or "--no-color" in sys.argv
    return typer.style(text, bold=True) if sys.stdout.isatty() and not plain else text


class _Sectioned:
    """A command whose help shows its options in sections, after its own rows."""

    def rows(self) -> Iterable[Row]:
        """Return the rows that precede the options, with their sections."""
        return ()

    def format_options(self, ctx: _Context, formatter: _Formatter) -> None:
        """Write the rows and then the options, each in its section."""
        command: Any = self
        panels: dict[str, list[tuple[str, str]]] = {}
        for panel, record in (*self.rows(), *(_row(parameter, ctx) for parameter in command.get_params(ctx))):
            if record:
                panels.setdefault(panel, []).append(record)
        for panel, records in sorted(panels.items(), key=lambda p: _SECTIONS.index(p[0]) if p[0] in _SECTIONS else -1):
            with formatter.section(bold(panel)):
                formatter.write_dl([(bold(name), help_text) for name, help_text in records], col_max=_WIDEST)


class Command(_Sectioned, TyperCommand):
    """A command defined by a dataclass: fields are options, the docstring is the help, `run` returns the exit code.

    Its help has a section for each group of options. Its numbers must be in ASCII digits.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        kinds = get_type_hints(unwrap(options["callback"]))
        parameter: Any
        for parameter in self.params:
            kind = kinds.get(parameter.name)
            if {int, float} & {kind, *get_args(kind)}:
                parameter.process_value = partial(_process, parameter, parameter.process_value)

    def invoke(self, ctx: _Context) -> None:
        """Create the command from its options, run it, and exit with its exit code."""
        _require_memory()
        command = super().invoke(ctx)
        try:
            code = command.run()
        except KeyboardInterrupt:  # interrupted before a result was available
            say("interrupted")
            code = 130
        except HdassistError as error:
            # imported here because `hdassist --help` does not need it
            from hdassist.interface.terminal.options import PageOptions

            if isinstance(command, PageOptions) and not isinstance(error, UsageError):
                command.give_failure("-".join(ctx.command_path.split()[1:]), error)
            raise
        ctx.exit(code)


class _Commands(_Sectioned, TyperGroup):
    """A command with subcommands."""

    def rows(self) -> Iterator[Row]:
        """Yield the commands and their summaries, with their sections."""
        for name, command in self.commands.items():
            yield "Commands", (name, command.get_short_help_str(_LONGEST_SENTENCE))


def _require_memory() -> None:
    """Raise DataError if the address space of a process (ulimit -v) is too small for numpy and its solvers."""
    limit = address_limit()
    if limit is not None and limit < _ADDRESSES:
        message = f"the memory limit of a process, {limit / 1e6:.0f} MB, is too low for a computation"
        hint = f"raise the limit (in kB) to at least this value: ulimit -v {_ADDRESSES // 1000}"
        raise DataError(message, hint, Fault.SYSTEM_LIMITS)


def _process(
    parameter: Any,
    process: Callable[[_Context, Any], Any],
    ctx: _Context,
    value: Any,
) -> Any:
    """Process the text of a numeric option, without the underscores and non-ASCII digits that Python accepts.

    Raises typer.BadParameter for such texts, and for a number that is not finite or has no finite square.
    """
    for text in value if isinstance(value, list | tuple) else [value]:
        if isinstance(text, str) and ("_" in text or not text.isascii()):
            raise typer.BadParameter(f"{text!r} is not a number: expected ASCII digits", ctx=ctx, param=parameter)
    value_of_option = process(ctx, value)
    for number in value_of_option if isinstance(value_of_option, list | tuple) else [value_of_option]:
        if isinstance(number, float) and not abs(number) <= GREATEST:
            message = f"{number:g} is out of range: expected a number up to {GREATEST:g}"
            raise typer.BadParameter(message, ctx=ctx, param=parameter)
    return value_of_option


Row = tuple[str, tuple[str, str] | None]  # section of a help text; its left and right columns


def _row(parameter: Any, ctx: _Context) -> Row:
    """Return the row of a parameter in a help text, with its section, and with its default but without its range.

    Three dots follow an option that may be given several times.
    """
    kind = "Arguments" if parameter.param_type_name == "argument" else _OTHERS
    record = parameter.get_help_record(ctx)
    if kind != _OTHERS:
        return kind, record and (record[0].partition(" <")[0], _NOTE.sub("", record[1]))
    dots = " ..." if getattr(parameter, "multiple", False) else ""
    return parameter.rich_help_panel or kind, record and (record[0] + dots, _NOTE.sub(_default, record[1]))


def _default(note: re.Match[str]) -> str:
    return "" if note[1] == "-" or "<=" in note[1] else note[0] if note[1] == "required" else f" [{note[1]}]"


_SUMMARIES = {  # summaries of the commands, by their section of the help
    "Design": {
        "check": "compute F'_ior over the full mesh cycle, with a verdict",
        "explore": "change inputs and mounting angle interactively",
        "trace": "compute the error over the input angle, and its orders",
        "stiffness": "compute torsion curve, lost motion, K1, K2 and K3",
        "tolerance": "predict the yield, as assembled and with the best holes",
        "sensitivity": "rank tolerances by the gain from tightening them",
        "allocate": "find the cheapest tolerances that reach a yield",
        "sweep": "compute F'_ior over a grid of field values",
        "compare": "compare presets, or a recording with its prediction",
        "report": "write a two-page report as HTML or Markdown",
    },
    "Bench": {
        "mount": "choose the bolt hole of the fixed wheel",
        "trials": "old name of mount",
        "measure": "evaluate recordings: F'_ior, orders and coverage",
        "compensate": "compute a correction table and its residual error",
    },
    "Acceptance": {
        "plan": "find tests that capture enough of F'_ior",
        "accept": "decide PASS, FAIL or INCONCLUSIVE, for a drive or a lot",
    },
    "Data": {
        "presets": "list, show, validate and create drive presets",
        "calibrate": "fit stiffnesses and clearances to measurements",
        "doctor": "check this installation",
    },
    "Help": {
        "explain": "explain a check, error, field, symbol or term",
    },
}
COMMANDS = tuple(name for summaries in _SUMMARIES.values() for name in summaries)
OTHER_NAMES = {"trials": "mount"}  # old names of commands
# modules that do not follow from the section
_MODULES = {"explore": "hdassist.interface.explorer.command", "explain": "hdassist.interface.commands.data"}
_OPTIONS: Any = {"add_completion": False, "rich_markup_mode": None}  # options of every typer application
_PRESETS = ("list", "show", "validate", "schema", "new")  # commands of `hdassist presets`


def module_of(name: str) -> str:
    """Return the module of a command, which depends on its section in the help; its class has the command's name."""
    section = next(section for section, summaries in _SUMMARIES.items() if name in summaries)
    return _MODULES.get(name, f"hdassist.interface.commands.{section.lower()}")


@cache
def _loaded(name: str) -> Any:
    """Return the command with a name, imported on first use."""
    module = import_module(module_of(name))
    name = OTHER_NAMES.get(name, name)
    if name == "presets":
        summary = "List, show, validate and create drive presets."
        app = typer.Typer(
            name=name,
            cls=_Commands,
            help=summary,
            no_args_is_help=True,
            **_OPTIONS,
        )
        classes = {part: f"Presets{part.title()}Command" for part in _PRESETS}
    else:
        app = typer.Typer(**_OPTIONS)
        classes = {name: f"{name.title()}Command"}
    for command_part, class_name in classes.items():
        app.command(command_part, cls=Command)(getattr(module, class_name))
    return typer.main.get_command(app)


_REMEDIES = {  # hints for options that a command does not have
    "--travel": "set the field of the preset: --set acceptance.travel=300",
    "--rule": "set the field of the preset: --set acceptance.rule=simple",
    "--assume-phases": "set the directions: --set phases.phi_hb=0",
    "--samples": "use --draws N",
    **dict.fromkeys(("--scheduler", "--scheduler-file"), "use --executor dask=tcp://HOST:PORT"),
    "--reseat": "use --noise: the standard deviation of repeated values, with the wheel reinstalled each time",
    "--trial": "list the trials after the preset: hdassist mount PRESET h0=28.1 h4=17.3",
}


class _RootCommands(_Commands):
    """The commands of hdassist; only the called command is imported, and none for the help."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        names: Any = dict.fromkeys(COMMANDS)
        self.commands = names

    def get_command(self, _ctx: _Context, name: str) -> Any:
        """Return the command with a name."""
        return _loaded(name) if name in self.commands else None

    def rows(self) -> Iterator[Row]:
        """Yield the commands and their summaries, with their sections."""
        yield from ((panel, row) for panel, summaries in _SUMMARIES.items() for row in summaries.items())


# The error class of a wrong command line, from click or typer's own copy, of which only the subclasses are public.
_ClickException: type[typer.BadParameter] = typer.BadParameter.__mro__[2]
# system faults of a device that is full or missing, and of exhausted resources
_DEVICE_FAULTS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)
_SCARCE = (errno.EMFILE, errno.ENFILE, errno.EAGAIN, errno.ENOMEM)
# variables that are set to 1: more threads do not speed up small matrices and prevent a fork of the process
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

app = typer.Typer(
    name="hdassist",
    help="Predict the kinematic error F'_ior of harmonic drives, and reduce it.",
    cls=_RootCommands,
    invoke_without_command=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"hdassist {__version__}")
        raise typer.Exit


@app.callback()
def _global(
    ctx: typer.Context,
    _: Annotated[
        bool, typer.Option("--version", "-V", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Predict the kinematic error F'_ior of harmonic drives, and reduce it.

    \b
    hdassist check vzp160           try it on a drive from the library
    hdassist COMMAND -h             examples and options of a command
    """
    if ctx.invoked_subcommand is None:
        typer.echo(_start_page(shutil.get_terminal_size().columns))


def _start_page(width: int) -> str:
    """Return the start page with one example and the commands by purpose, for a width in columns."""
    indent = _SECTION_COLUMNS + _NAME_COLUMNS

    def row(
        left: str,
        name: str,
        words: str,
    ) -> list[str]:
        first, *next_lines = textwrap.wrap(words, max(20, width - indent))
        title = bold(name.ljust(indent - len(left)))
        return [f"{left}{title}{first}", *(f"{'':{indent}}{line}" for line in next_lines)]

    lines = textwrap.wrap("Predict the kinematic error F'_ior of harmonic drives, and reduce it.", width)
    lines += ["", *row("  ", "hdassist check vzp160", "try it on a drive from the library")]
    for section, summaries in _SUMMARIES.items():
        rows = [summary for summary in summaries.items() if summary[0] not in OTHER_NAMES]
        lines.append("")
        for number, (name, help_text) in enumerate(rows):
            head = section if number == 0 else ""
            lines += row(f"{head:{_SECTION_COLUMNS}}", name, help_text)
    footer = "hdassist COMMAND -h shows examples and options; hdassist -h lists all commands."
    return "\n".join([*lines, "", *textwrap.wrap(footer, width)])


def _takes_one_preset(command: Any) -> bool:
    """Return whether the only argument of a command is a preset."""
    return [parameter.name for parameter in command.params if parameter.param_type_name == "argument"] == ["preset"]


def run_command_line() -> None:
    """Run the command line and exit with its exit code."""
    for name in THREADS:
        os.environ.setdefault(name, "1")  # numpy reads these variables when it loads
    _open_streams()
    begin_run()
    try:
        _require_lines(sys.argv[1:])
        sys.exit(app(prog_name="hdassist", standalone_mode=False))
    except _ClickException as error:
        wrong: Any = error
        shown = io.StringIO()
        hint = ""
        if hasattr(wrong, "possibilities"):  # an unknown option, with similar known ones
            hint = _REMEDIES.get(getattr(wrong, "option_name", ""), "")
            wrong.possibilities = wrong.possibilities if not hint else ()
        elif "unexpected extra argument" in wrong.message and _takes_one_preset(wrong.ctx.command):
            hint = "to compare presets, use hdassist compare A.yaml B.yaml"
        # messages of pydantic; other messages contain the user's own words
        elif wrong.message.startswith(("Input should", "Value error")):
            wrong.message = validation_words(wrong.message)
        error.show(shown)
        lines = f"\n{shown.getvalue()}".replace("\nError: ", "\nerror: ")[1:]
        _say(lines, hint, Fault.USAGE if "error: " in lines else None)  # a group without a command shows its help
        if "error: " in lines:
            _give_wrong_usage(UsageError(lines.partition("error: ")[2].strip(), hint))
        sys.exit(error.exit_code)
    except Exception as error:  # known errors have their own exit codes; all others are bugs with exit code 1
        if "--debug" in sys.argv:
            _say(traceback.format_exc())
        from hdassist.interface.terminal.output import complain

        fault = _as_known(error)
        complain(fault)
        if isinstance(fault, UsageError):
            _give_wrong_usage(fault)
        sys.exit(fault.exit_code)
    finally:
        _say_of_cache()


def _give_wrong_usage(error: UsageError) -> None:
    """Write wrong usage as JSON to standard output, if --json is given and nothing was written there before.

    The JSON has its own schema because the command itself may be wrong. It is never written to the file of -o, which
    may also be wrong.
    """
    from hdassist.interface.terminal.output import failure, json_text

    if "--json" not in sys.argv or is_written("-"):
        return
    try:
        give_stdout(json_text(failure("usage", error)))
    except DataError as unwritten:
        _say(f"error: {unwritten.message}")


def _say_of_cache() -> None:
    """Warn if a command does not use the cache because another user could have placed results there."""
    if "hdassist.run.kept" in sys.modules:
        from hdassist.run.kept import FOLDER, keeps_answers, why_unsafe

        if keeps_answers() and (reason := why_unsafe()):
            _say(f"warning: {reason}: the cache is not used; set {FOLDER} to another folder")


def _as_known(error: Exception) -> HdassistError:
    """Return an error with the message and the exit code of the command."""
    if isinstance(error, HdassistError):
        return error
    if isinstance(error, MemoryError):
        message = "not enough memory to compute the result"
        hint = "reduce --jobs"
        return UntrustedError(message, hint, Fault.MEMORY_SHORT)
    number = error.errno if isinstance(error, OSError) else None
    if number in _DEVICE_FAULTS:  # typer writes help and version; other output reports its own errors
        silence()  # otherwise the rest of the buffer causes another error at the end
        message = f"cannot write: {os.strerror(number)}"
        hint = "check that standard output is open and that its device is not full"
        return DataError(message, hint, Fault.FILE_UNWRITABLE)
    if number in _SCARCE:
        message = f"the operating system refused a resource: {os.strerror(number)}"
        hint = limits_hint("check the limits of a process with ulimit -a")
        return DataError(message, hint, Fault.SYSTEM_LIMITS)
    message = f"internal error: {type(error).__name__}: {error}"
    return HdassistError(message, "report this bug in hdassist, with the traceback shown by --debug")


def _require_lines(arguments: list[str]) -> None:
    """Raise UsageError if an argument contains a line break, which could forge a line of the output."""
    for text in arguments:
        if "\n" in text:
            raise UsageError(
                f"an argument contains a line break: {text[:60]!r}", "write names, paths and values on one line"
            )


def _say(
    text: str,
    hint: str = "",
    fault: Fault | None = None,
) -> None:
    from hdassist.interface.terminal.output import with_code

    say(text.rstrip("\n") + (f"\n  hint: {with_code(hint, fault)}" if fault else ""))


def _open_streams() -> None:
    """Replace standard streams that the caller closed (>&-), for which Python has None.

    Messages are discarded. A result for standard output cannot be written, and the exit code of the command reports
    this. Standard output without a buffer (PYTHONUNBUFFERED) gets one. Otherwise Python treats a result that a full
    device wrote only in part as complete.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            mode = os.O_RDONLY if name == "stdout" else os.O_WRONLY
            setattr(
                sys,
                name,
                os.fdopen(
                    os.open(os.devnull, mode),
                    "w",
                    encoding="utf-8",
                ),
            )
    bare = getattr(sys.stdout, "buffer", None)
    if isinstance(bare, io.RawIOBase):
        stream: Any = sys.stdout
        sys.stdout = io.TextIOWrapper(
            io.BufferedWriter(bare),
            encoding=stream.encoding,
            errors=stream.errors,
        )
    sys.stdout = pipe_stream(sys.stdout)
    sys.stderr = pipe_stream(sys.stderr)
