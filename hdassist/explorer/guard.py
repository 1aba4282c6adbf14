"""A process beside the explorer's own that gives the terminal back should that one be killed."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# out of the alternate screen; cursor shown; mouse, focus, pasting and keys reported as before; colours off
GIVEN_BACK = (
    b"\x1b[?1049l\x1b[?25h\x1b[?1000l\x1b[?1002l\x1b[?1003l\x1b[?1006l\x1b[?1015l\x1b[?1016l\x1b[?1004l\x1b[?2004l"
    b"\x1b[<u\x1b[0m\r\n"
)
IGNORED = ("SIGINT", "SIGTERM", "SIGHUP", "SIGTTOU", "SIGTTIN", "SIGPIPE")


@contextmanager
def terminal_guarded() -> Iterator[None]:
    """Leave the terminal as it was, in whatever way this process ends; where there are no such terminals, nothing."""
    if sys.platform == "win32":
        yield
        return
    import termios

    attributes = termios.tcgetattr(0)
    told, tell = os.pipe()  # not inherited by what is executed: it closes with this process alone
    beside = os.fork()
    if not beside:
        os.close(tell)
        _wait(told, attributes)
    os.close(told)
    try:
        yield
    finally:
        os.write(tell, b".")  # it ended in order
        os.close(tell)
        os.waitpid(beside, 0)


def _wait(told: int, attributes: list[Any]) -> None:
    """Wait for the end of the process that forked this one; give the terminal back where nothing was told before."""
    import termios

    try:
        for name in IGNORED:
            signal.signal(getattr(signal, name), signal.SIG_IGN)
        os.setpgid(0, 0)
        if not os.read(told, 1):
            os.write(1, GIVEN_BACK)
            termios.tcsetattr(0, termios.TCSANOW, attributes)
    finally:
        os._exit(0)
