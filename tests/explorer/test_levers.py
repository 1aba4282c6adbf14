from __future__ import annotations

import pytest

from hdassist.drive.loading import load_text
from hdassist.drive.preset.fields import field_table, resolved_fields, text_of
from hdassist.interface.explorer.state import about_field, key_step, opened_state, stepped
from tests.explorer.rig import tiny
from tests.helpers.process import TINY


def test_a_field_has_its_meaning_and_range() -> None:
    fields = {field.path: field for field in resolved_fields(tiny().drive)}
    assert list(fields) == list(field_table())
    assert about_field(fields["gears.j_n"]).endswith("; 0 to 200 um") and "clearance" in about_field(
        fields["gears.j_n"]
    )


def test_value_text_is_read_back_as_the_same_value() -> None:
    session = opened_state(TINY)
    given = [field for field in resolved_fields(session.drive) if field.value is not None]
    assert len(given) > len(field_table()) / 2
    for field in given:
        there = load_text(session.source.text, TINY, [f"{field.path}={text_of(field.value)}"])
        assert there.value(field.path) == session.drive.value(field.path), field.path


@pytest.mark.parametrize(
    ("path", "value", "step"),
    [
        ("gears.j_n", 6, 1),
        ("gears.z_g", 60, 1),
        ("phases.xi_b", 90, 5),
        ("gears.alpha", 20, 1),
        ("operation.rated", 67, 10),
        ("cam.W_0", 0.58, 0.01),
        ("contact.c_t", 6e-5, 1e-6),
    ],
)
def test_input_step_is_natural_to_its_unit_or_one_percent(path: str, value: float, step: float) -> None:
    assert key_step(field_table()[path], value) == pytest.approx(step)


def test_steps_leave_no_dust_of_binary_fractions() -> None:
    assert stepped(tiny("cam.W_0=0.58").drive, "cam.W_0", 1) == "0.59"
