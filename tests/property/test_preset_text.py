"""Whatever text is given as a preset: an answer or a finding, never a crash; numbers come back exactly."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hdassist.drive.loading import load_text
from hdassist.drive.preset.fields import Drive, field_table
from hdassist.drive.preset.text import UnitError, convert, read_yaml, scalar_value, units_for
from hdassist.run.errors import HdassistError, PresetError, UsageError
from hdassist.run.files import GREATEST
from tests.helpers.support import fresh_preset

BASE = fresh_preset("base")
PATHS = list(field_table())
PIECES = (
    *"{}[]:,|>#@`~!\t\n\\'\"", ": ", "- ", "? ", "\n  ", " #", "&a", "*a", "!!str ", "%YAML 1.2",
    "---", "...", "<<", "null", "1e-3", ".nan", "12:30", "gears", "source", "uncertainty",
    "acceptance", "F_ior", "operation", "M_g", "schema", "hdassist.preset/1",
    "\x00", "\ufeff", "\x85", "\u2028", "\ud800", "\\U99999999",
)  # fmt: skip
SYNTAX = st.sampled_from(PIECES)
FINITE = st.floats(allow_nan=False, allow_infinity=False)
ATOMS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
KEYS = st.text(max_size=5) | st.sampled_from(PATHS)
VALUES = st.recursive(
    ATOMS | st.sampled_from(["80 N*m", "1.2 m", "5 um"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=6,
)


def check(text: str | bytes, *overrides: str) -> None:
    """A drive, or an error with findings that each fit on a line and can be printed."""
    try:
        drive = load_text(text, "f", overrides)
    except HdassistError as error:
        assert error.message.splitlines() == error.message.split("\n")
        error.message.encode()
        if isinstance(error, PresetError):
            assert error.findings
            assert all(finding.line >= 1 and finding.column >= 1 for finding in error.findings)
        else:
            assert isinstance(error, UsageError) and overrides
    else:
        assert isinstance(drive, Drive)


@settings(max_examples=150)
@given(st.binary(max_size=200))
def test_random_bytes(data: bytes) -> None:
    check(data)


@pytest.mark.thorough
@settings(max_examples=300)
@given(st.lists(SYNTAX | st.text(max_size=3), max_size=25).map("".join))
@example("a: &a [*a]")
@example("b: *a\nb: 1")
@example("*a : 1")
@example("? {a: 1}\n: 2")
@example('"\\ud800": 1')
@example("%")
@example("\ufeff{\ud800")
@example("a: !<tag:x,2000:y> b")
def test_random_syntax(text: str) -> None:
    check(text)


@pytest.mark.thorough
@settings(max_examples=150)
@given(st.sampled_from(range(len(BASE))), st.integers(0, 12), SYNTAX | st.text(max_size=3))
def test_a_preset_with_a_piece_torn_out(start: int, length: int, piece: str) -> None:
    check(BASE[:start] + piece + BASE[start + length :])


@pytest.mark.thorough
@settings(max_examples=200)
@given(
    st.sampled_from([*PATHS, "gears", "source", "uncertainty", "name", "schema", "acceptance.F_ior.80", "x.y.z"]),
    VALUES,
)
def test_any_value_in_any_field(path: str, value: object) -> None:
    check(BASE, f"{path}={json.dumps(value)}")
    if "." not in path:
        check(json.dumps({**read_yaml(BASE, "f").data, path: value}))


@settings(max_examples=100)
@given(st.text(max_size=30))
def test_random_overrides(text: str) -> None:
    check(BASE, text)


@given(FINITE)
def test_numbers_come_back_exactly(number: float) -> None:
    assert scalar_value(repr(number)) == number
    assert scalar_value(f"{number:.17e}") == number


@given(st.floats(-GREATEST, GREATEST), st.sampled_from(sorted({field.unit for field in field_table().values()} - {""})))
def test_numbers_with_the_unit_of_the_field_come_back_exactly(number: float, unit: str) -> None:
    assert convert(f"{number!r} {unit}", unit) == number


@given(st.floats(1e-30, 1e-9 * GREATEST), st.sampled_from(["mm", "deg", "N*m", "MPa", "N/mm", "mm/N"]), st.data())
def test_units_of_one_dimension_convert_there_and_back(number: float, unit: str, data: st.DataObject) -> None:
    other = data.draw(st.sampled_from(units_for(unit)))
    there = convert(f"{number!r} {unit}", other)
    assert math.isclose(convert(f"{there!r} {other}", unit), number, rel_tol=1e-15)


@given(st.text(max_size=20), st.sampled_from(["mm", "", "N*m"]))
def test_any_text_is_a_number_or_refused(text: str, unit: str) -> None:
    try:
        assert math.isfinite(convert(text, unit))
    except UnitError as error:
        assert error.message


@pytest.mark.thorough
@settings(max_examples=50)
@given(st.text(min_size=1, max_size=200).filter(str.isprintable))
def test_any_name_survives_the_template(name: str) -> None:
    assert load_text(fresh_preset(name), "f").name == name
