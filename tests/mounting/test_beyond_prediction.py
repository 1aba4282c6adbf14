"""A measured F'_ior beyond the range that the preset predicts is named as such."""

from __future__ import annotations

import json
import re

import pytest

from tests.helpers.process import TINY, run

OPEN = ("--set", "tolerances.F_i2=unknown", "--draws", "16", "--json")


def warnings(*arguments: str) -> str:
    """Return the warnings of a command in one text."""
    answer = run(*arguments)
    assert answer.returncode == 0, answer.stderr
    return " ".join(json.loads(answer.stdout)["warnings"])


@pytest.mark.thorough
@pytest.mark.parametrize(("value", "side"), [("60", "above"), ("37", ""), ("25", "below")])
def test_check_names_a_measured_value_beyond_the_predicted_range(value: str, side: str) -> None:
    named = warnings("check", TINY, "--set", f"measured.F_ior={{h0@1: {value} ± 1}}", *OPEN)
    assert (re.search("(above|below) the range", named) is not None) == bool(side)
    assert not side or f"measured.F_ior.h0@1: {value}″ is {side} the range" in named


@pytest.mark.thorough
@pytest.mark.parametrize(("value", "side"), [("2500", "above"), ("40", ""), ("0.5", "below")])
def test_mount_names_a_measured_value_beyond_the_predicted_range(value: str, side: str) -> None:
    named = warnings("mount", TINY, f"h0@1={value}", "--noise", "0.1", *OPEN)
    assert (re.search("(above|below) the range", named) is not None) == bool(side)
    assert not side or f"{value}″ is {side} the range" in named


@pytest.mark.thorough
def test_value_within_its_uncertainty_of_the_range_raises_no_warning() -> None:
    assert "range predicted by the preset" not in warnings(
        "check", TINY, "--set", "measured.F_ior={h0@1: 45 ± 12}", *OPEN
    )
