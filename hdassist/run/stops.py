"""Stops by signals: SIGINT, SIGTERM, SIGHUP and SIGBREAK end the command immediately, whatever it is doing.

No exception is raised, because an import, a fork or a library may swallow it. Code that must clean up registers an
action. This module is imported before all others and imports only `system`.
"""

import os
import signal
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn, TypeVar

from hdassist.run.system import STOPS

_ItemT = TypeVar("_ItemT")

_at_stop: list[Callable[[], str | None]] = []
_process = 0  # id of the process to be ended; forked processes have other ids
_is_waiting = _is_interruptible = _is_interrupted = False


def end_at_stops() -> None:
    """End this process at the first stop from now on; signals that its caller ignores (nohup) remain ignored."""
    global _process
    _process = os.getpid()
    for number in STOPS:
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, _end)


@contextmanager
def at_stop(action: Callable[[], str | None]) -> Iterator[None]:
    """Perform an action if a stop arrives during the block, and add its result to the line on standard error."""
    _at_stop.append(action)
    try:
        yield
    finally:
        _at_stop.remove(action)


def until_interrupted(items: Iterator[_ItemT]) -> Generator[_ItemT, None, bool]:
    """Yield items until the first interrupt, which ends the wait for the next item but not the process.

    It is meant for work that has a result after any number of items. A second stop ends the process. The return value
    of the generator is whether the work was interrupted.
    """
    global _is_waiting, _is_interruptible
    _is_interruptible = True
    is_known = False
    try:
        while not _is_interrupted:
            _is_waiting = True
            try:
                item = next(items)
            except StopIteration:
                return False
            except KeyboardInterrupt:
                is_known = True
                return True
            finally:
                _is_waiting = False
            yield item
        is_known = True
        return True
    finally:
        _is_interruptible = False
        if _is_interrupted and not is_known:  # interrupted while the last item was being computed
            signal.raise_signal(signal.SIGINT)


def _end(number: int, _: FrameType | None) -> None:
    global _is_interrupted
    if os.getpid() != _process:
        os._exit(128 + number)
    if number == signal.SIGINT and _is_interruptible and not _is_interrupted:
        _is_interrupted = True
        if _is_waiting:
            raise KeyboardInterrupt
        return
    for stop in STOPS:
        if signal.getsignal(stop) is _end:
            signal.signal(stop, signal.SIG_DFL)  # a second signal ends the process even if the actions below hang
    end_now(number)


def end_now(number: int) -> NoReturn:
    """End this process as at a stop, from any thread, regardless of all other threads."""
    said = [STOPS[number]]
    for action in reversed(_at_stop):
        with suppress(Exception):
            said += filter(None, [action()])
    encoding = getattr(sys.stderr, "encoding", None) or "ascii"
    with suppress(OSError):
        os.write(2, f"{': '.join(said)}\n".encode(encoding, "backslashreplace"))
    os._exit(128 + number)
