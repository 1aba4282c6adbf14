"""Records of each kind, made without any part of the tool: the short form of `python -m benchmarks.kinds`."""

from __future__ import annotations

from collections import Counter

import pytest

from benchmarks.kinds import KINDS, Rig, counted


@pytest.mark.parametrize("kind", KINDS)
def test_a_record_of_each_kind_is_held_and_gives_no_wrong_verdict(kind: str):
    count = sum((counted(Rig(kind, seed)) for seed in (2, 3)), Counter())
    assert count["F'_ior"] == 2
    assert count["F'_ior held"] >= 1
    assert not count["false PASS"] + count["false FAIL"] + count["refused"]
