"""Terminals that are closed under the explorer at any moment: the process and all that it began end with them."""

from __future__ import annotations

import fcntl
import os
import pty
import secrets
import select
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import time
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from tests.fuzz.faults import MARK, SOON, Tally, has_mark, processes, record
from tests.helpers.process import CLEAN, COMMAND, TINY

KEYS = ("\x1b[C", "1", "3", "5", "7", "/", "m", "?", "b", "e", "\x1b", "u", "y", "r")
BEGINS = 60.0  # s for the first picture
LONGEST_WAIT = 30.0  # s for the end of a process


EXPLORER = (*COMMAND, "explore", TINY)
BARE = (
    sys.executable,
    "-c",
    "import time; print('\\x1b[?1049h', flush=True); time.sleep(600)",
)  # how busy the machine is


def closings(count: int, seed: int, seconds: float = 2.5) -> Tally:
    """Close the explorer's own terminal, in half of the runs with a key just before it.

    Arguments: count, of runs; seed, of the moments; seconds after the first picture in which they lie.
    """
    tally, bare = Tally(), 0.0
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        moment, key = rng.uniform(0, seconds), str(rng.choice(KEYS)) if rng.random() < 0.5 else ""
        alive, took = _closed(EXPLORER, moment, key)
        where = f"closed after {moment:.2f} s{f' with {key!r}' if key else ''}"
        if took > tally.slowest:
            tally.slowest, tally.slowest_of = took, where
        record(tally, [f"{alive} processes after {took:.1f} s"] if took > SOON else [], where)
        bare = max(bare, _closed(BARE, 0.1, "")[1])
    print(f"a process that does nothing took {bare:.1f} s at most", flush=True)
    return tally


def _closed(command: Sequence[str], moment: float, key: str) -> tuple[int, float]:
    """Processes that a command leaves when its terminal is closed, and the time until there are none [s]."""
    leader, follower = pty.openpty()
    fcntl.ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    mark = secrets.token_hex(8)
    with tempfile.TemporaryDirectory() as states:
        process = subprocess.Popen(
            command, stdin=follower, stdout=follower, stderr=follower, start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
            env=CLEAN | {"TERM": "xterm-256color", "XDG_STATE_HOME": states, MARK: mark},
        )  # fmt: skip
        os.close(follower)
        _read(leader, BEGINS, until=b"\x1b[?1049h")
        _read(leader, max(0.0, moment - 0.15))
        os.write(leader, key.encode())
        _read(leader, 0.15)
        os.close(leader)
        closed = time.monotonic()
        while (alive := _alive(mark)) and time.monotonic() < closed + LONGEST_WAIT:
            process.poll()
            time.sleep(0.01)
        seconds = time.monotonic() - closed
        for pid in alive:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        process.wait()
    return len(alive), seconds


def _alive(mark: str) -> list[int]:
    return [pid for pid in processes() if has_mark(pid, mark)]


def _read(leader: int, seconds: float, until: bytes = b"") -> None:
    """Read what the screen is sent for some seconds, or until it has been sent some bytes."""
    end, sent = time.monotonic() + seconds, b""
    while (left_s := end - time.monotonic()) > 0 and not (until and until in sent):
        if select.select([leader], [], [], left_s)[0]:
            with suppress(OSError):
                sent = sent[-100:] + os.read(leader, 65536)
