"""Measures with their uncertainty in one text."""

import re
from pathlib import Path

import pytest

from hdassist import load_preset
from hdassist.errors import PresetError, UsageError
from hdassist.preset.load import load_text
from hdassist.preset.units import UnitError, read_spread, spread_pattern
from tests.process import SMALL

GOOD = [
    ("260±10", "deg", 260, 10),
    ("260 ± 10 deg", "deg", 260, 10),
    ("260 deg ± 10", "deg", 260, 10),
    ("260° ± 30 arcmin", "deg", 260, 0.5),
    ("80+-15 µm", "um", 80, 15),
    ("0.08 +/- 0.015 mm", "um", 80, 15),
    ("-3±0", "deg", -3, 0),
    ("1e-5 ± 2e-6", "mm/N", 1e-5, 2e-6),
    ("1.4±.1", "", 1.4, 0.1),
]
BAD = [
    ("260±", "deg"),
    ("±10", "deg"),
    ("260 ± -10", "deg"),
    ("260 ± 10 ± 3", "deg"),
    ("260 ± 10 um", "deg"),
    ("260,5 ± 10", "deg"),
    ("1.4 ± 0.1 mm", ""),
    ("a ± b", "deg"),
    ("260 ± 10 %", "deg"),
]


@pytest.mark.parametrize(("text", "unit", "value", "spread"), GOOD)
def test_both_numbers_are_in_the_unit_of_the_field(text: str, unit: str, value: float, spread: float) -> None:
    assert read_spread(text, unit) == pytest.approx((value, spread), rel=1e-15)
    assert re.search(spread_pattern(unit), text)


@pytest.mark.parametrize(("text", "unit"), BAD)
def test_anything_else_is_refused(text: str, unit: str) -> None:
    with pytest.raises(UnitError):
        read_spread(text, unit)
    assert not re.search(spread_pattern(unit), text)


def test_it_is_the_same_as_the_section_uncertainty() -> None:
    beside = load_preset(SMALL, ["phases.xi_b=260±10", "tolerances.e_hb=0.08 ± 0.015 mm"])
    apart = load_preset(
        SMALL,
        ["phases.xi_b=260", "uncertainty.phases.xi_b=10", "tolerances.e_hb=80", "uncertainty.tolerances.e_hb=15"],
    )
    assert beside.model_dump() == apart.model_dump()


def test_the_command_line_wins() -> None:
    over = load_preset(SMALL, ["uncertainty.phases.xi_b=4"])
    assert over.uncertainty == {"phases.xi_b": 4}
    text = Path(SMALL).read_text(encoding="utf-8")
    beside = text.replace("xi_b: 90", "xi_b: 90 ± 10")
    assert load_text(beside, "a").uncertainty == {"phases.xi_b": 10}
    assert load_text(beside, "a", ["uncertainty.phases.xi_b=4"]).uncertainty == {"phases.xi_b": 4}
    apart = text + "uncertainty: {phases.xi_b: 3}\n"
    assert load_text(apart, "a", ["phases.xi_b=90±5"]).uncertainty == {"phases.xi_b": 5}


def test_given_twice_is_a_fault() -> None:
    text = Path(SMALL).read_text(encoding="utf-8").replace("xi_b: 90", "xi_b: 90 ± 10")
    text += "uncertainty: {phases.xi_b: 3}\n"
    with pytest.raises(PresetError, match=r"uncertainty.phases.xi_b: given twice"):
        load_text(text, "a")
    with pytest.raises(UsageError, match="given twice"):
        load_preset(SMALL, ["phases.xi_b=90±5", "uncertainty.phases.xi_b=4"])


def test_faults_have_their_place() -> None:
    with pytest.raises(UsageError, match=r"--set:1:13: phases.xi_b: an uncertainty has no sign"):
        load_preset(SMALL, ["phases.xi_b=90 ± -5"])
    with pytest.raises(UsageError, match="takes a whole number"):
        load_preset(SMALL, ["gears.z_g=60±1"])
