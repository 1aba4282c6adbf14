"""The explorer in a true terminal, its screen read back."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import shlex
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import time
from base64 import b64encode
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pyte
import pytest

from tests.explorer.rig import FEW
from tests.explorer.test_service import needs_proc, processes, vanished
from tests.helpers.process import CLEAN, COMMAND, LONGEST, TINY, run

SETS = [word for text in FEW for word in ("--set", text)]
MEASURED = "--set 'measured.F_ior.h0@4=28.1 ± 2'"
COLUMNS, ROWS = 80, 24


class Terminal:
    """A process on a pseudo-terminal, and the screen that its user sees."""

    def __init__(self, *args: str, command: Sequence[str] = COMMAND, rows: int = ROWS) -> None:
        self.states = tempfile.TemporaryDirectory()
        self._leader, follower = pty.openpty()
        fcntl.ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", rows, COLUMNS, 0, 0))
        self.before = termios.tcgetattr(follower)
        self._follower = follower
        self.process = subprocess.Popen(
            [*command, *args], stdin=follower, stdout=follower, stderr=follower, close_fds=True,
            start_new_session=True, env=CLEAN | {"TERM": "xterm-256color", "XDG_STATE_HOME": self.states.name},
        )  # fmt: skip
        self._screen = pyte.Screen(COLUMNS, rows)
        self._stream = pyte.ByteStream(self._screen)
        self.sent = b""

    def press(self, keys: str) -> None:
        os.write(self._leader, keys.encode())

    def read(self, seconds: float = 0.2) -> str:
        """The screen after what is sent in some seconds."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0 and select.select([self._leader], [], [], left)[0]:
            try:
                part = os.read(self._leader, 65536)
            except OSError:
                break
            self.sent += part
            # pyte does not know the questions about the terminal that begin with CSI and a sign
            self._stream.feed(part.replace(b"\x1b[>", b"\x1b[").replace(b"\x1b[=", b"\x1b["))
        return "\n".join(self._screen.display)

    def wait_for(self, words: str) -> str:
        """The screen once words stand on it."""
        end = time.monotonic() + LONGEST
        while words not in (seen := self.read()):
            assert time.monotonic() < end and self.process.poll() is None, seen
        return seen

    def wait_for_end_of(self, words: str) -> None:
        """Wait until words stand on the screen no longer."""
        end = time.monotonic() + LONGEST
        while words in (seen := self.read()):
            assert time.monotonic() < end, seen

    def end(self) -> int:
        """Exit code; all that is sent until then is read."""
        end = time.monotonic() + 60
        while self.process.poll() is None and time.monotonic() < end:
            self.read()
        self.read(0.5)
        return self.process.wait(timeout=20)

    @property
    def as_it_was(self) -> bool:
        """Whether the line is as before, the alternate screen left and the cursor shown."""
        line = termios.tcgetattr(self._follower)[:4] == self.before[:4]
        left = self.sent.rfind(b"\x1b[?1049l") > self.sent.rfind(b"\x1b[?1049h") > -1
        return line and left and self.sent.rfind(b"\x1b[?25h") > self.sent.rfind(b"\x1b[?25l")

    @property
    def kept(self) -> str:
        """The command that returns to the session, as it is kept at each change."""
        return (Path(self.states.name) / "hdassist" / "explore.txt").read_text()

    def hang_up(self) -> None:
        """Close the end of the terminal that its user has."""
        os.close(self._leader)
        self._leader = -1

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        if self._leader >= 0:
            os.close(self._leader)
        os.close(self._follower)
        self.states.cleanup()


@contextmanager
def explorer(*args: str, rows: int = ROWS) -> Iterator[Terminal]:
    terminal = Terminal("explore", TINY, *SETS, *args, rows=rows)
    try:
        yield terminal
    finally:
        terminal.close()


@pytest.mark.thorough
@needs_proc
def test_a_session_in_a_terminal() -> None:
    before = processes()
    with explorer() as terminal:
        seen = terminal.wait_for("Put the circular spline")
        assert "7 advice" in seen and "F'_ior by hole, ″" in seen and "hole 0 (0°), present hole" in seen
        terminal.press("\x1b[C")
        terminal.wait_for("hole 1 (60°)")
        terminal.press("e")
        terminal.wait_for("known data of this drive")
        terminal.press("h9=3\r")
        terminal.wait_for("the seat's holes")
        terminal.press("\x1b")
        terminal.wait_for_end_of("known data of this drive")  # an escape and a letter at once would be another key
        terminal.press("e")
        terminal.wait_for("known data of this drive")
        terminal.press("h1=28.1\r")
        terminal.wait_for("undo")
        terminal.press("q")
        terminal.wait_for("Quit?")
        terminal.press("y")
        assert terminal.end() == 0
        assert terminal.as_it_was
        left = terminal.sent.rpartition(b"\x1b[?1049l")[2].decode()
        assert (
            f"restore the session: hdassist explore {TINY} --torque=4 --set {FEW[1]} {MEASURED.replace('h0', 'h1')}\r\n"
            in left
        )
        assert (
            f"check this drive: hdassist check {TINY} --torque=4 --set {FEW[1]} {MEASURED.replace('h0', 'h1')}\r\n"
            in left
        )
    assert vanished(before)


WHEEL = "\x1b[<65;20;14M"  # of a mouse, a notch down over the middle of the screen


@pytest.mark.thorough
@needs_proc
def test_mouse_scrolls_lists_and_copied_commands_reach_the_remote_clipboard() -> None:
    with explorer() as terminal:  # its plots fit any screen
        terminal.wait_for("PROVEN")
        terminal.press("3")
        terminal.wait_for("teeth of the flexspline")
        terminal.press(20 * WHEEL)
        terminal.wait_for_end_of("teeth of the flexspline")
        terminal.press("y")
        terminal.wait_for("clipboard")
        command = f"hdassist mount {TINY} --torque=4 --set {FEW[1]}"
        assert b"\x1b]52;c;" + b64encode(command.encode()) in terminal.sent


@pytest.mark.thorough
@needs_proc
@pytest.mark.parametrize(("stop", "code"), [(signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_killed_explorer_leaves_no_process_and_keeps_its_command(stop: signal.Signals, code: int) -> None:
    before = processes()
    with explorer() as terminal:
        terminal.wait_for("7 advice")  # what computes has begun
        terminal.press("e")
        terminal.wait_for("known data of this drive")
        terminal.press("h0=28.1\r")
        terminal.wait_for("undo")
        os.kill(terminal.process.pid, stop)
        assert terminal.end() == code
        assert terminal.as_it_was == (stop == signal.SIGTERM)
        assert terminal.kept == f"hdassist explore {TINY} --torque=4 --set {FEW[1]} {MEASURED}"
    assert vanished(before)


@pytest.mark.thorough
@needs_proc
@pytest.mark.parametrize("is_ignored", [True, False])
def test_an_explorer_ends_with_its_terminal(is_ignored: bool) -> None:
    """Also where no signal says so: SIGHUP ignored, as under nohup."""
    before = processes()
    ignoring = ["sh", "-c", "trap '' HUP; exec \"$@\"", "sh", *COMMAND] if is_ignored else COMMAND
    terminal = Terminal("explore", TINY, *SETS, command=ignoring)
    try:
        terminal.wait_for("7 advice")
        terminal.press("e")
        terminal.wait_for("known data of this drive")
        terminal.press("h0=28.1\r")
        terminal.wait_for("undo")
        terminal.hang_up()
        assert terminal.process.wait(timeout=20) > 128
        assert terminal.kept == f"hdassist explore {TINY} --torque=4 --set {FEW[1]} {MEASURED}"
    finally:
        terminal.close()
    assert vanished(before)


FULL = "import textual.drivers._writer_thread as writer; writer.MAX_QUEUED_WRITES = 1"


@pytest.mark.thorough
@needs_proc
@pytest.mark.parametrize("ignoring", ["", "import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)"])
def test_an_explorer_that_waits_to_write_ends_with_its_terminal(ignoring: str) -> None:
    """The thread that writes to the terminal ends with it, and what the screen writes next waits for ever."""
    before = processes()
    code = f"{FULL}\n{ignoring}\nimport hdassist.__main__ as begin; begin.main()"
    terminal = Terminal("explore", TINY, *SETS, command=[sys.executable, "-c", code])
    try:
        terminal.wait_for("7 advice")
        terminal.press("?")
        time.sleep(0.15)
        terminal.hang_up()
        assert terminal.process.wait(timeout=20) > 128
    finally:
        terminal.close()
    assert vanished(before)


@pytest.mark.thorough
@needs_proc
def test_a_crash_gives_the_terminal_back_too() -> None:
    before = processes()
    begin = "import hdassist.interface.explorer.panes as words; from hdassist.interface.cli import run_command_line"
    crash = f"{begin}; words.head_line = None; run_command_line()"
    terminal = Terminal("explore", TINY, *SETS, command=[sys.executable, "-c", crash])
    try:
        assert terminal.end() == 1  # a bug
        assert terminal.as_it_was
    finally:
        terminal.close()
    assert vanished(before)


@pytest.mark.thorough
def test_explorer_without_a_terminal_is_refused_with_a_script_command(tmp_path: Path) -> None:
    done = run("explore", TINY, "h0=28.1", "--set", "gears.j_n=7")
    assert done.returncode == 2 and done.stdout == ""
    assert "the explorer needs a terminal" in done.stderr
    dumb = Terminal("explore", TINY, command=["env", "TERM=dumb", *COMMAND])
    assert dumb.end() == 2 and b"needs a terminal with cursor control" in dumb.sent
    dumb.close()
    log = tmp_path / "log"  # the screen is drawn on stderr: in a file nobody would see it
    unseen = Terminal("-c", f"exec {shlex.join(COMMAND)} explore {TINY} 2>{log}", command=["sh"])
    try:
        assert unseen.end() == 2 and "needs a terminal with cursor control" in log.read_text("utf-8")
    finally:
        unseen.close()
    assert f"hdassist mount {TINY} --set gears.j_n=7 --set 'measured.F_ior.h0@1=28.1 ± 2'" in done.stderr


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        (("explore", "-"), 2, "reads keys from standard input"),
        (("explore", "nosuch"), 4, "no such preset"),
        (("explore", TINY, "--set", "gears.j_n=-1"), 2, "must be from"),
        (("explore", TINY, "h99=3"), 2, "h0 to h11"),
    ],
)
def test_what_cannot_be_opened_is_refused_before_the_screen(args: tuple[str, ...], code: int, words: str) -> None:
    done = run(*args)
    assert done.returncode == code and words in done.stderr


def test_help_imports_no_screen() -> None:
    code = (
        "import sys; sys.argv[1:] = ['explore', '--help']\ntry:\n import hdassist.__main__ as m; m.main()\nfinally:\n"
    )
    code += " assert not {'textual', 'numpy', 'cvxpy'} & set(sys.modules), sorted(sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], env=CLEAN, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "Interactive screen of a drive" in done.stdout, done.stderr
