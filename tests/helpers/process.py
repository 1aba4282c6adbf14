"""Run hdassist in this process, in a separate process, or on a pseudo-terminal of a given width.

Most tests need only the result and the exit code, so `run` calls the command in this process. Tests of closed streams,
signals, terminals, the environment or the hash seed need a separate process.
"""

from __future__ import annotations

import contextlib
import io
import os
import pickle
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
import typer.main
from hypothesis import currently_in_test_context

from hdassist.interface.cli import run_command_line
from hdassist.run.kept import FOLDER, NO_CACHE
from hdassist.run.system import SPAWN, STOPS
from tests.helpers import answers

SMALL = str(Path(__file__).parents[1] / "data/small.yaml")
TINY = str(Path(__file__).parents[1] / "data/tiny.yaml")  # for tests that do not depend on numbers
# override that makes this field the only uncertain input of the small drive
ASSUMED = "source.bearing.g_b={kind: assumed, range: [0, 3.75], ref: judged}"
COMMAND = [sys.executable, "-m", "hdassist"]
ROOT = str(Path(__file__).parents[2])  # the tree under test, for commands that run in other folders
CLEAN = {
    "PATH": os.environ["PATH"],
    "LANG": "C.UTF-8",
    "HOME": os.environ.get("HOME", "/"),
    "PYTHONPATH": ROOT,
    "HDASSIST_STRICT": "1",
}
# settings of numpy's kernels, of the cache of the tests, of starting processes, and variables that Windows requires
_PASSED_ON = ("OPENBLAS_", FOLDER, NO_CACHE, SPAWN)
_OF_WINDOWS = ("SYSTEMROOT", "TEMP", "USERPROFILE", "LOCALAPPDATA", "APPDATA", "COMSPEC")
CLEAN |= {name: text for name, text in os.environ.items() if name.startswith((*_PASSED_ON, *_OF_WINDOWS))}
LONGEST = 240  # s; time limit of one process
_get_command = cache(typer.main.get_command)  # takes half of the time of a command that reads little


class InProcess(Executor):
    """Executor that replaces worker processes; it runs each task at once, pickled as for a process."""

    def __init__(self, count: int, *, has_beside: bool = False) -> None:
        """Accept the number of processes, which is not used."""

    def begin(self) -> None:
        """Do nothing, as there are no processes to start."""

    def end(self) -> None:
        """Do nothing, as there are no processes to stop."""

    kill = end

    def submit(self, task: Callable[..., Any], /, *args: Any, **more: Any) -> Future[Any]:
        done: Future[Any] = Future()
        try:
            task, args, more = pickle.loads(pickle.dumps((task, args, more)))
            done.set_result(pickle.loads(pickle.dumps(task(*args, **more))))
        except Exception as error:
            done.set_exception(error)
        return done


@contextlib.contextmanager
def no_processes() -> Iterator[None]:
    """Run tasks for worker processes in this process, because starting workers takes longer than the tiny drive."""
    with mock.patch("hdassist.run.run.Processes", InProcess):
        yield


def keep_answers(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cache results in a folder, for this process and for commands; other tests compute their results anew."""
    for variables in (os.environ, CLEAN):
        monkeypatch.setitem(variables, FOLDER, str(folder))
        monkeypatch.delitem(variables, NO_CACHE)


def in_a_line(page: str) -> str:
    """Return a page as one line; commands that continue on the next line with a backslash are joined."""
    return " ".join(page.replace(" \\\n", "\n").split())


def run(
    *args: str, stdin: str | None = None, cwd: Path | None = None, shares: bool = False, held: bool = True
) -> subprocess.CompletedProcess[str]:
    """Run a command in this process with its own arguments, streams, folder and environment.

    It calls run_command_line, as a process does. The CliRunner of typer would call the app below it, and miss the
    messages and exit codes that are made from errors.

    args: arguments of the command.
    stdin: text of standard input, None if it is empty.
    cwd: working folder, None for the present one.
    shares: whether the command starts worker processes.
    held: whether a JSON result is validated against its schema; schemas were made from results of fixed inputs.
    """
    given = io.TextIOWrapper(io.BytesIO((stdin or "").encode()), encoding="utf-8")
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", newline="")
    err = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="backslashreplace", newline="")
    with (
        mock.patch.multiple(sys, argv=["hdassist", *args], stdin=given, stdout=out, stderr=err),
        mock.patch.dict(os.environ, CLEAN, clear=True),
        mock.patch("typer.main.get_command", _get_command),
        contextlib.chdir(cwd or Path.cwd()),
        contextlib.nullcontext() if shares else no_processes(),
    ):
        code = 0
        try:
            run_command_line()
        except SystemExit as end:
            code = int(end.code or 0)
    if held and not currently_in_test_context():
        answers.hold(args, _told(out))
    return subprocess.CompletedProcess(["hdassist", *args], code, _told(out), _told(err))


def hear_what_is_ignored() -> None:
    """Let child processes receive stop signals even if the tests were started with these signals ignored.

    The tests ignore them if they run with nohup or in the background. A handler that does nothing replaces the ignored
    signal, because children inherit an ignored signal, but not a handler. An ignored SIGCHLD would make the system reap
    children, so their exit codes would be lost.
    """
    if os.name == "posix":
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    for number in STOPS:
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, lambda *_: None)


def ends(pid: int) -> bool:
    """Return whether a process started by another process has ended or ends within 5 s; needs /proc."""
    until = time.monotonic() + 5
    while time.monotonic() < until:
        try:
            if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except OSError:
            return True
        time.sleep(0.02)
    return False


def posix_only(reason: str) -> pytest.MarkDecorator:
    """Return the mark for a test or a module that needs POSIX; reason: part of POSIX that it needs."""
    return pytest.mark.skipif(os.name != "posix", reason=f"POSIX only: {reason}")


def _told(stream: io.TextIOWrapper) -> str:
    """Return the complete text written to a stream, including carriage returns."""
    stream.seek(0)
    return stream.read()


def run_cold(
    *args: str, env: Mapping[str, str] | None = None, stdin: str | None = None, cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a command with pipes on all streams, in a new Python process."""
    return subprocess.run(
        [*COMMAND, *args], input=stdin or "", capture_output=True, text=True, encoding="utf-8",
        env=CLEAN | dict(env or {}), cwd=cwd, check=False, timeout=LONGEST,
    )  # fmt: skip


def interrupted(*args: str, after: float) -> subprocess.CompletedProcess[str]:
    """Run a command in a process, and interrupt it; after: processor time of its worker processes until then [s]."""
    process = subprocess.Popen(
        [*COMMAND, *args], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=CLEAN, text=True, encoding="utf-8",
    )  # fmt: skip
    begun = time.monotonic()
    while process.poll() is None and _worked(process.pid, time.monotonic() - begun) < after:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    return subprocess.CompletedProcess([*COMMAND, *args], process.returncode, out, err)


def _worked(pid: int, elapsed: float) -> float:
    """Return the processor time of the processes that a process has started [s].

    Without /proc, it is estimated from the elapsed time [s].
    """
    if not Path(f"/proc/{pid}/task/{pid}/children").exists():
        return elapsed - 2
    try:
        stats = [Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split() for child in begun_by(pid)]
    except OSError:  # one of the processes has just ended
        return 0.0
    return sum(int(stat[k]) for stat in stats for k in (11, 12)) / os.sysconf("SC_CLK_TCK")


def begun_by(pid: int) -> list[int]:
    """Return the descendants of a process."""
    lists = [path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children")]  # one text per thread
    children = [int(child) for text in lists for child in text.split()]
    return [*children, *(each for child in children for each in begun_by(child))]


def on_terminal(
    *args: str, columns: int, env: Mapping[str, str] | None = None, interrupt_at: bytes | None = None
) -> tuple[int, str]:
    """Run a command on a terminal, and return its exit code and the complete text sent to the terminal.

    args: arguments of the command.
    columns: width of the terminal.
    env: further variables of the environment.
    interrupt_at: bytes after whose output the command is interrupted as by Ctrl-C, None for no interruption.
    """
    pytest.importorskip("pty", reason="needs pseudo-terminals, which Windows has not")
    import fcntl
    import pty
    import termios

    leader, follower = pty.openpty()
    fcntl.ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    process = subprocess.Popen(
        [*COMMAND, *args], stdin=follower, stdout=follower, stderr=follower, close_fds=True,
        env=CLEAN | {"TERM": "xterm-256color"} | dict(env or {}),
    )  # fmt: skip
    os.close(follower)
    sent = b""
    while True:
        try:
            part = os.read(leader, 65536)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        sent += part
        if interrupt_at is not None and interrupt_at in sent:
            process.send_signal(signal.SIGINT)
            interrupt_at = None
    os.close(leader)
    return process.wait(timeout=LONGEST), sent.decode("utf-8").replace("\r\n", "\n")
