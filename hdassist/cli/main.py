"""The hdassist command: its subcommands, and how it ends."""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

from hdassist.acceptance import command as accept
from hdassist.acceptance import explain_command as explain
from hdassist.calibration import command as calibrate
from hdassist.cli import presets
from hdassist.comparing import command as compare
from hdassist.design import check_command as check
from hdassist.design import self_error_command as self_error
from hdassist.design import stiffness_command as stiffness
from hdassist.design import trace_command as trace
from hdassist.errors import DataError, HdassistError, UntrustedError, UsageError
from hdassist.explorer import command as explore
from hdassist.measuring import command as measure
from hdassist.mounting import command as mount
from hdassist.trials import command as trials
from hdassist.version import __version__

INTERRUPTED = 130
BUG = 1
# What typer makes of a wrong command line, click's or its own copy of it: nothing but its subclasses is public.
ClickException: type[typer.BadParameter] = typer.BadParameter.__mro__[2]
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # what a device says that takes no more
SCARCE = (errno.EMFILE, errno.ENFILE, errno.EAGAIN, errno.ENOMEM)  # of which a system gives no more
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

app = typer.Typer(
    name="hdassist",
    help="Kinematic error of harmonic drives, and how to make it less.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("accept")(accept.command)
app.command("calibrate")(calibrate.command)
app.command("check")(check.command)
app.command("compare")(compare.command)
app.command("explain")(explain.command)
app.command("explore")(explore.command)
app.command("measure")(measure.command)
app.command("mount")(mount.command)
app.command("self-error")(self_error.command)
app.command("stiffness")(stiffness.command)
app.command("trace")(trace.command)
app.command("trials")(trials.command)
app.add_typer(presets.app, name="presets")


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"hdassist {__version__}")
        raise typer.Exit


@app.callback()
def _global(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Kinematic error of harmonic drives, and how to make it less."""


def main() -> None:
    """Run the command line and leave with its exit code."""
    for name in THREADS:
        os.environ.setdefault(name, "1")  # read when numpy loads; the matrices are too small to share
    _open_streams()
    came: list[int] = []
    try:
        with _stops_heard(came):
            _require_lines(sys.argv[1:])
            sys.exit(app(standalone_mode=False))
    except ClickException as error:
        told = io.StringIO()
        error.show(told)
        _say(told.getvalue())
        sys.exit(error.exit_code)
    except HdassistError as error:
        _trace_if_asked()
        from hdassist.terminal.output import complain

        complain(error)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        _say("interrupted")
        sys.exit(INTERRUPTED)
    except MemoryError:
        _say("error: there is not memory enough for an answer\n  hint: fewer --jobs take less of it")
        sys.exit(UntrustedError.exit_code)
    except Exception as error:
        if came:  # raised while a module was imported, a stop comes out as another error
            sys.exit(128 + came[0])
        if isinstance(error, OSError) and error.errno in FULL:  # typer writes help and version; files say it themselves
            from hdassist.terminal.console import silence

            silence()  # or what is left in the buffer fails once more at the end
            _say(f"error: cannot write: {error.strerror}\n  hint: is standard output on a full device?")
            sys.exit(DataError.exit_code)
        if isinstance(error, OSError) and error.errno in SCARCE:
            _say(f"error: the system refuses: {error.strerror}\n  hint: ulimit -a shows what a process may have")
            sys.exit(DataError.exit_code)
        _trace_if_asked()
        words = f"internal error: {type(error).__name__}: {error}"
        _say(f"{words}\n  hint: this is a bug in hdassist; --debug shows where")
        sys.exit(BUG)


def _require_lines(arguments: list[str]) -> None:
    """Raise UsageError where an argument has a line break: it could forge a line of what is said or written."""
    for text in arguments:
        if "\n" in text:
            raise UsageError(f"a line break in {text[:60]!r}", "names, paths and values are written on one line")


def _say(text: str) -> None:
    from hdassist.terminal.console import say

    say(text.rstrip("\n"))


@contextmanager
def _stops_heard(came: list[int]) -> Iterator[None]:
    """End in order when told to: bars off, workers ended, no half file. came: the signals that said so.

    That is an interrupt, SIGTERM, or a terminal that goes: SIGHUP.
    """

    def end(number: int, _: object) -> None:
        came.append(number)
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        sys.exit(128 + number)

    own = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL, signal.SIGHUP: signal.SIG_DFL}
    # nohup has SIGHUP ignored, and means it
    heard = {number: handler for number, handler in own.items() if signal.getsignal(number) is handler}
    for number in heard:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in heard.items():
            signal.signal(number, handler)


def _open_streams() -> None:
    """Give a stream that was closed by the caller (>&-) somewhere to go: Python has None in its place."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8"))


def _trace_if_asked() -> None:
    if "--debug" in sys.argv:
        _say(traceback.format_exc())
