"""A process beside the explorer's: it gives the terminal back if that one is killed, and ends it with its terminal."""

from __future__ import annotations

import os
import select
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# out of the alternate screen; cursor shown; mouse, focus, pasting and keys reported as before; colours off
GIVEN_BACK = (
    b"\x1b[?1049l\x1b[?25h\x1b[?1000l\x1b[?1002l\x1b[?1003l\x1b[?1006l\x1b[?1015l\x1b[?1016l\x1b[?1004l\x1b[?2004l"
    b"\x1b[<u\x1b[0m\r\n"
)
END_SECONDS = 5.0  # s that the explorer has to end in order once its terminal is gone
IGNORED = ("SIGINT", "SIGTERM", "SIGHUP", "SIGTTOU", "SIGTTIN", "SIGPIPE")


@contextmanager
def terminal_guarded() -> Iterator[None]:
    """Leave the terminal as it was, in whatever way this process ends, and end it when the terminal is gone.

    That the terminal hung up is no signal where SIGHUP is ignored (nohup), or the terminal is of another session.
    """
    import termios

    attributes = termios.tcgetattr(0)
    explorer = os.getpid()
    told, tell = os.pipe()  # not inherited by what is executed: it closes with this process alone
    beside = os.fork()
    if not beside:
        os.close(tell)
        _wait(told, attributes, explorer)
    os.close(told)
    try:
        yield
    finally:
        os.write(tell, b".")  # it ended in order
        os.close(tell)
        os.waitpid(beside, 0)


def _wait(told: int, attributes: list[Any], explorer: int) -> None:
    """Wait for the end of the process that forked this one; give the terminal back where that was not in order.

    Arguments: told, pipe that is written to at an end in order, and closed at any; attributes of the terminal before;
    explorer, id of the process that forked this one, which is ended when the terminal is gone.
    """
    import termios

    try:
        for name in IGNORED:
            signal.signal(getattr(signal, name), signal.SIG_IGN)
        os.setpgid(0, 0)
        if _has_hung_up(told):
            for stop in (signal.SIGTERM, signal.SIGKILL):
                if not select.select([told], [], [], 0)[0]:
                    os.kill(explorer, stop)
                    select.select([told], [], [], END_SECONDS)
        elif not os.read(told, 1):
            os.write(1, GIVEN_BACK)
            termios.tcsetattr(0, termios.TCSANOW, attributes)
    finally:
        os._exit(0)


def _has_hung_up(told: int) -> bool:
    """Wait until a pipe can be read (False), or the terminal on standard input has hung up before (True)."""
    poll = select.poll()
    poll.register(told, select.POLLIN)
    poll.register(0, 0)  # a hangup is reported unasked
    while True:
        events = dict(poll.poll())
        if told in events:
            return False
        if events[0] & select.POLLHUP:
            return True
        poll.unregister(0)  # a terminal that cannot be polled
