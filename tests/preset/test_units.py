"""Unit strings and measures with their uncertainty: what converts to what, and what is refused with which hint."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from hdassist import load_preset
from hdassist.drive.loading import load_text
from hdassist.drive.preset.fields import field_table
from hdassist.drive.preset.text import UnitError, convert, read_spread, units_for
from hdassist.run.errors import PresetError, UsageError
from tests.helpers.process import SMALL


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("75 um", "mm", 0.075),
        ("75 µm", "mm", 0.075),
        ("75 μm", "mm", 0.075),
        ("75um", "um", 75.0),
        ("0.007 mm", "um", 7.0),
        ("16 cm", "mm", 160.0),
        ("50 nm", "um", 0.05),
        ("25 arcsec", "deg", 25 / 3600),
        ('25"', "arcsec", 25.0),
        ("30′", "deg", 0.5),
        ("45 arcmin", "deg", 0.75),
        ("0.2 rad", "deg", math.degrees(0.2)),
        ("2 mrad", "deg", math.degrees(0.002)),
        ("260°", "deg", 260.0),
        ("0.5 arcmin", "arcsec", 30.0),
        ("206 GPa", "MPa", 206_000.0),
        ("206 kN/mm^2", "MPa", 206_000.0),
        ("5 N/mm²", "MPa", 5.0),
        ("23 N/um", "N/mm", 23_000.0),
        ("1.3 kN/mm", "N/mm", 1300.0),
        ("8.4 kN / mm", "N/mm", 8400.0),
        ("2e-2 um/N", "mm/N", 2e-5),
        ("20 nm/N", "mm/N", 2e-5),
        ("80 N*m", "N*m", 80.0),
        ("80 Nm", "N*m", 80.0),
        ("80 N·m", "N*m", 80.0),
        ("80 N⋅m", "N*m", 80.0),
        ("80 N m", "N*m", 80.0),
        ("0.5 kN*m", "N*m", 500.0),
        ("-8e4 N*mm", "N*m", -80.0),
        (".5 mN*m", "N*m", 5e-4),
        ("-5 K", "K", -5.0),
        ("11.5e-6/K", "/K", 11.5e-6),
        ("11.5 µm/(m·K)", "/K", 11.5e-6),
    ],
)
def test_units_convert(text: str, unit: str, value: float) -> None:
    assert convert(text, unit) == pytest.approx(value, rel=1e-15)


def test_decimal_conversion_rounds_once() -> None:
    for micrometres in range(1, 1000):
        assert convert(f"{micrometres} um", "mm") == float(f"{micrometres}e-3")


@pytest.mark.parametrize(
    ("text", "unit", "message", "hint"),
    [
        ("1.2 m", "mm", "is ambiguous", "metre or module"),
        ("1.2m", "um", "is ambiguous", "metre or module"),
        ("80 mN", "N*m", "is ambiguous", "N*m"),
        ("80 nm", "N*m", "is ambiguous", "N*m"),
        ("3 MNm", "N*m", "is ambiguous", "kN*m"),
        ("206 mPa", "MPa", "is ambiguous", "MPa"),
        ("10 °C", "K", "is ambiguous", "write K"),
        ("5 min", "deg", "is ambiguous", "arcmin"),
        ("5 sec", "arcsec", "is ambiguous", "arcsec"),
        ("25 deg", "mm", "deg is a unit of an angle; expected a unit of a length", "use one of mm"),
        ("25 um", "N/mm", "um is a unit of a length; expected a unit of a stiffness", "use one of N/mm"),
        ("3 foo", "mm", "unknown unit foo", "use one of mm, um"),
        ("3 NM", "N*m", "unknown unit NM", "the nearest name is N*m"),
        ("3 MM", "mm", "unknown unit MM", "the nearest name is mm"),
        ("3 %", "um", "% is a unit of a share; expected a unit of a length", "use one of"),
        ("200 teeth", "", "must be a number without a unit", ""),
        ("3 mm", "", "must be a number without a unit", ""),
        ("160", "mm", "must be a number, not text", "quotes"),
        ("0,96", "mm", "must be a number", "not a comma"),
        ("1,000.5 mm", "mm", "must be a number", "no thousands separator"),
        ("1_000", "mm", "must be a number", "underscores"),
        ("12:30", "mm", "must be a number", "in mm"),
        ("no", "", "must be a number", ""),
        ("\u22125 um", "um", "must be a number", "ASCII minus"),
        ("nan", "mm", "must be a finite number", ""),
        (".nan", "mm", "must be a finite number", ""),
        ("-.inf", "mm", "must be a finite number", ""),
        ("inf mm", "mm", "must be a finite number", ""),
        ("1e999 mm", "mm", "must be a finite number", ""),
        ("", "mm", "must be a number", ""),
    ],
)
def test_what_is_no_number_in_that_unit_is_refused(text: str, unit: str, message: str, hint: str) -> None:
    with pytest.raises(UnitError) as caught:
        convert(text, unit)
    assert message in caught.value.message
    assert hint in caught.value.hint


def test_extreme_exponents_are_quick() -> None:
    assert convert("1e-999999999 um", "mm") == 0
    assert convert("0e999999999999 um", "mm") == 0
    assert convert("1e-300 um", "mm") == pytest.approx(1e-303)


def test_every_unit_of_the_declarations_converts_to_itself() -> None:
    units = {field.unit for field in field_table().values()} - {""}
    assert units == {unit for unit in units if unit in units_for(unit) and convert(f"3.5 {unit}", unit) == 3.5}


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


@pytest.mark.parametrize(("text", "unit"), BAD)
def test_anything_else_is_refused(text: str, unit: str) -> None:
    with pytest.raises(UnitError):
        read_spread(text, unit)


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
    with pytest.raises(PresetError, match=r"uncertainty.phases.xi_b: the uncertainty is given twice"):
        load_text(text, "a")
    with pytest.raises(UsageError, match="is given twice"):
        load_preset(SMALL, ["phases.xi_b=90±5", "uncertainty.phases.xi_b=4"])


def test_faults_have_their_place() -> None:
    with pytest.raises(UsageError, match=r"--set:1:13: phases.xi_b: the uncertainty has a sign"):
        load_preset(SMALL, ["phases.xi_b=90 ± -5"])
    with pytest.raises(UsageError, match="must be a whole number"):
        load_preset(SMALL, ["gears.z_g=60±1"])
