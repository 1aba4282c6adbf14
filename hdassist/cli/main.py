"""The hdassist command: its subcommands, and how it ends."""

import errno
import io
import os
import sys
import traceback
from typing import Annotated

import typer

from hdassist.cli.commands import REMOVED_OPTIONS, RootCommands
from hdassist.errors import DataError, Fault, HdassistError, UntrustedError, UsageError
from hdassist.files import begin_run
from hdassist.version import __version__

# The error of a wrong command line, click's or typer's own copy of it: only its subclasses are public.
ClickException: type[typer.BadParameter] = typer.BadParameter.__mro__[2]
# faults of the system: of a device that takes no more, or none; of resources that it has no more of
DEVICE_FAULTS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)
SCARCE = (errno.EMFILE, errno.ENFILE, errno.EAGAIN, errno.ENOMEM)
# each 1: small matrices gain nothing by more, and a process with several cannot be forked
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

app = typer.Typer(
    name="hdassist",
    help="Kinematic error of harmonic drives, and how to make it less.",
    cls=RootCommands,
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
    """Kinematic error of harmonic drives, and how to make it less.

    \b
    hdassist check vzp160           a first answer
    hdassist COMMAND -h             a command, examples first
    """
    if ctx.invoked_subcommand is None:
        typer.echo(ctx.get_help())


def run_command_line() -> None:
    """Run the command line and leave with its exit code."""
    for name in THREADS:
        os.environ.setdefault(name, "1")  # read when numpy loads
    _open_streams()
    begin_run()
    try:
        _require_lines(sys.argv[1:])
        sys.exit(app(prog_name="hdassist", standalone_mode=False))
    except ClickException as error:
        shown = io.StringIO()
        error.show(shown)
        lines = shown.getvalue().replace(": Value error, ", ": ").replace("\nError: ", "\nerror: ")
        hint = REMOVED_OPTIONS.get(getattr(error, "option_name", ""), "")
        _say(lines, hint, Fault.USAGE if "\nerror: " in lines else None)  # a group without a command shows its help
        sys.exit(error.exit_code)
    except Exception as error:  # whatever ends a command: known errors by their exit codes, the rest as a bug, 1
        if "--debug" in sys.argv:
            _say(traceback.format_exc())
        from hdassist.terminal.output import complain

        known = _as_known(error)
        complain(known)
        sys.exit(known.exit_code)
    finally:
        _say_of_cache()


def _say_of_cache() -> None:
    """Warn where the cache of a command that computes is not used, as another user could have put answers there."""
    if "hdassist.run.cache" in sys.modules:
        from hdassist.run.cache import FOLDER, keeps_answers, why_unsafe

        if keeps_answers() and (words := why_unsafe()):
            _say(f"warning: {words}: no answers are kept or read there; {FOLDER} names another folder")


def _as_known(error: Exception) -> HdassistError:
    """An error with the words and the exit code that it ends the command with."""
    if isinstance(error, HdassistError):
        return error
    if isinstance(error, MemoryError):
        words, hint = "there is not memory enough for an answer", "fewer --jobs take less of it"
        return UntrustedError(words, hint, Fault.MEMORY_SHORT)
    number = error.errno if isinstance(error, OSError) else None
    if number in DEVICE_FAULTS:  # typer writes help and version; files say it themselves
        from hdassist.terminal.console import silence

        silence()  # or the rest of the buffer fails once more at the end
        words, hint = f"cannot write: {os.strerror(number)}", "is standard output closed, or on a full device?"
        return DataError(words, hint, Fault.FILE_UNWRITABLE)
    if number in SCARCE:
        words, hint = f"the system refuses: {os.strerror(number)}", "ulimit -a shows what a process may have"
        return DataError(words, hint, Fault.SYSTEM_LIMITS)
    words = f"internal error: {type(error).__name__}: {error}"
    return HdassistError(words, "this is a bug in hdassist; --debug shows where")


def _require_lines(arguments: list[str]) -> None:
    """Raise UsageError where an argument has a line break: it could forge a line of the output."""
    for text in arguments:
        if "\n" in text:
            raise UsageError(f"a line break in {text[:60]!r}", "names, paths and values are written on one line")


def _say(text: str, hint: str = "", fault: Fault | None = None) -> None:
    from hdassist.terminal.console import say
    from hdassist.terminal.output import with_code

    say(text.rstrip("\n") + (f"\n  hint: {with_code(hint, fault)}" if fault else ""))


def _open_streams() -> None:
    """Give a stream that was closed by the caller (>&-) a place of its own: Python has None in it.

    Messages go nowhere; an answer on standard output cannot be written, and the command says so by its exit code.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            mode = os.O_RDONLY if name == "stdout" else os.O_WRONLY
            setattr(sys, name, os.fdopen(os.open(os.devnull, mode), "w", encoding="utf-8"))
