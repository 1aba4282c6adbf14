"""Run hdassist: in this process, as a process of its own, and on a pseudo-terminal of a given width.

Most tests ask for an answer and an exit code: `run` calls the command in this process. Streams that are closed,
signals, terminals, an environment or a hash seed are for true processes.
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

from hdassist.cli import run_command_line
from hdassist.run.kept import FOLDER, NO_CACHE
from hdassist.run.system import SPAWN, STOPS
from tests.helpers import answers

SMALL = str(Path(__file__).parents[1] / "data/small.yaml")
TINY = str(Path(__file__).parents[1] / "data/tiny.yaml")  # for what is said and done, whatever the numbers are
ASSUMED = "source.bearing.g_b={kind: assumed, range: [0, 3.75], ref: judged}"  # of the small drive all else is given
COMMAND = [sys.executable, "-m", "hdassist"]
ROOT = str(Path(__file__).parents[2])  # the tree under test, from whatever folder it runs
CLEAN = {
    "PATH": os.environ["PATH"],
    "LANG": "C.UTF-8",
    "HOME": os.environ.get("HOME", "/"),
    "PYTHONPATH": ROOT,
    "HDASSIST_STRICT": "1",
}
# the kernels numpy has here; the tests' own cache; how processes begin; without which nothing begins on Windows
_PASSED_ON = ("OPENBLAS_", FOLDER, NO_CACHE, SPAWN)
_OF_WINDOWS = ("SYSTEMROOT", "TEMP", "USERPROFILE", "LOCALAPPDATA", "APPDATA", "COMSPEC")
CLEAN |= {name: text for name, text in os.environ.items() if name.startswith((*_PASSED_ON, *_OF_WINDOWS))}
LONGEST = 240  # s of one process
_get_command = cache(typer.main.get_command)  # half of the time of a command that reads little


class InProcess(Executor):
    """Stands where processes share the work of a command, and does each task at once, pickled as a process gets it."""

    def __init__(self, count: int, *, has_beside: bool = False) -> None:
        """Take the number of processes."""

    def begin(self) -> None:
        """Begin no processes."""

    def end(self) -> None:
        """End none."""

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
    """Do in this process what would be shared among others: beginning these takes longer than the tiny drive."""
    with mock.patch("hdassist.run.run.Processes", InProcess):
        yield


def keep_answers(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep answers in a folder, for this process and for commands; elsewhere in the tests they are computed anew."""
    for variables in (os.environ, CLEAN):
        monkeypatch.setitem(variables, FOLDER, str(folder))
        monkeypatch.delitem(variables, NO_CACHE)


def in_a_line(page: str) -> str:
    """A page in a line, as are its commands, whose lines end as a shell goes on with the next one."""
    return " ".join(page.replace(" \\\n", "\n").split())


def run(
    *args: str, stdin: str | None = None, cwd: Path | None = None, shares: bool = False, held: bool = True
) -> subprocess.CompletedProcess[str]:
    """Run a command in this process, with arguments, streams, folder and environment of its own.

    It is main() that runs, as in a process: typer's CliRunner would call the app below it, and miss the messages and
    exit codes that main() makes of errors. shares: whether it begins the processes that it shares its work with;
    held: whether an answer in JSON is held to its schema, which was made of answers to inputs that are not random.
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
    """Have children hear stops where the tests were begun with these ignored (nohup, in the background).

    A handler that does nothing: unlike what is ignored it is not inherited. Where SIGCHLD is ignored the system waits
    for children, and their exit codes are lost.
    """
    if os.name == "posix":
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    for number in STOPS:
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, lambda *_: None)


def ends(pid: int) -> bool:
    """Whether a process that was begun by another one ends soon, or has ended; needs /proc."""
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
    """Mark a test, or a module of tests, that needs POSIX; reason: the part of it that the test needs."""
    return pytest.mark.skipif(os.name != "posix", reason=f"POSIX only: {reason}")


def _told(stream: io.TextIOWrapper) -> str:
    """All that a stream was given, to the last carriage return."""
    stream.seek(0)
    return stream.read()


def run_cold(
    *args: str, env: Mapping[str, str] | None = None, stdin: str | None = None, cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a command with pipes on all streams, in a process that Python starts from nothing."""
    return subprocess.run(
        [*COMMAND, *args], input=stdin or "", capture_output=True, text=True, encoding="utf-8",
        env=CLEAN | dict(env or {}), cwd=cwd, check=False, timeout=LONGEST,
    )  # fmt: skip


def interrupted(*args: str, after: float) -> subprocess.CompletedProcess[str]:
    """Run a command in a process, and interrupt it when its own processes have worked for so long [s]."""
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
    """Processor time [s] of the processes that a process has begun; without /proc a guess from the time elapsed."""
    if not Path(f"/proc/{pid}/task/{pid}/children").exists():
        return elapsed - 2
    try:
        stats = [Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split() for child in begun_by(pid)]
    except OSError:  # one of them has just ended
        return 0.0
    return sum(int(stat[k]) for stat in stats for k in (11, 12)) / os.sysconf("SC_CLK_TCK")


def begun_by(pid: int) -> list[int]:
    """Processes that a process has begun, and those that these have."""
    lists = [path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children")]  # of each of its threads
    children = [int(child) for text in lists for child in text.split()]
    return [*children, *(each for child in children for each in begun_by(child))]


def on_terminal(
    *args: str, columns: int, env: Mapping[str, str] | None = None, interrupt_at: bytes | None = None
) -> tuple[int, str]:
    """Exit code, and all that a terminal of so many columns is sent; Ctrl-C is pressed once it was sent such bytes."""
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
