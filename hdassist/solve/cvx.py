"""cvxpy, imported whole or not at all: `from hdassist.solve.cvx import cp`.

It takes a second and tries many modules. An interrupt that is raised as an exception in there may be taken for a module
that is missing, and be lost; so while it is imported a stop ends the process, which has nothing yet to put away.
"""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

STOPS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


@contextmanager
def _stops_at_once() -> Iterator[None]:
    def end(number: int, _: object) -> None:
        if number == signal.SIGINT:
            os.write(2, b"interrupted\n")
        os._exit(128 + number)

    ours = threading.current_thread() is threading.main_thread()
    before = {number: signal.getsignal(number) for number in STOPS} if ours else {}
    heard = {number: handler for number, handler in before.items() if callable(handler)}
    for number in heard:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in heard.items():
            signal.signal(number, handler)


with _stops_at_once():
    import cvxpy as cp

__all__ = ["cp"]
