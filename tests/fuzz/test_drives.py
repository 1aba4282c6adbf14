"""Short form of `python -m tests.fuzz drives`."""

from __future__ import annotations

import pytest

from tests.fuzz.drives import Outcome, at_random, ends, numbers, outcomes, preset

ENDS = [  # what comes out, and the end of a range
    ("refused", {"supports.C_1": 1e-6}),
    ("refused", {"supports.C_3": 1e-300}),
    ("solved", {"supports.C_1": 0.0}),
    ("solved", {"supports.C_1": 1e9}),
    ("solved", {"supports.C_3": 1.0}),
    ("refused", {"gears.m": 5.0}),
    ("solved", {"material.E": 1e3}),
    ("solved", {"contact.c_t": 1e-2}),
    ("solved", {"contact.c_t": 1e-8}),
    ("solved", {"contact.c_bore": 1e-9}),
    ("refused", {"flexspline.l": 2.0}),
    ("untrusted", {"operation.M_g": [1e7]}),
]


@pytest.fixture(scope="module")
def found() -> list[Outcome]:
    few = {"numerics.n_phase": 2, "operation.M_g": [1.0]}
    return list(outcomes([few | change for _, change in ENDS]))


@pytest.mark.thorough
@pytest.mark.parametrize("k", range(len(ENDS)), ids=[str(change) for _, change in ENDS])
def test_drive_at_a_range_end_is_verified_or_refused(found: list[Outcome], k: int) -> None:
    assert found[k].end == ENDS[k][0], found[k]
    assert found[k].end == "solved" or found[k].said


def test_every_number_of_a_preset_is_tried_at_its_ends() -> None:
    tried = list(ends())
    for path, pair in numbers().items():
        values = {change[path] for change in tried if path in change}
        assert {*pair} <= values
    assert len(numbers()) > 40


def test_random_drives_are_the_same_again() -> None:
    assert [preset(change) for change in at_random(5, 1)] == [preset(change) for change in at_random(5, 1)]
    assert [*at_random(3, 1)] == [*at_random(5, 1)][:3]
