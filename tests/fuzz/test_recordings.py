"""Relations between recordings of the same readings: two at random, of a full cycle and of part of it.

The study `python -m tests.fuzz recordings` has as many as are asked for.
"""

from __future__ import annotations

import pytest

from tests.fuzz.recordings import LESS, SAME, recording_faults


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [2, 3])
def test_additional_rig_output_of_equal_readings_changes_no_verdict(seed: int):
    found = dict(recording_faults(seed))
    assert len(found) == len(SAME) + len(LESS)
    assert not {name: fault for name, fault in found.items() if fault}
