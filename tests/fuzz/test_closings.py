"""Short form of `python -m tests.fuzz closings`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.closings import closings


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="needs /proc")
@pytest.mark.slow
def test_the_explorer_ends_with_its_terminal() -> None:
    tally = closings(20, 1)
    assert tally.runs == 20
    assert not tally.broken
