"""Libraries that write to standard output by themselves, which is for answers alone."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def muted_output() -> Iterator[None]:
    """Output of compiled code goes nowhere meanwhile: HiGHS 1.16 has a banner for each solver."""
    try:
        kept = os.dup(1)
    except OSError:  # it is closed
        yield
        return
    try:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
