from __future__ import annotations

import pytest

from hdassist.explorer.levers import levers, step_of, stepped
from hdassist.explorer.state import opened_state
from hdassist.loading.load import load_text
from hdassist.preset.fields import field_table
from tests.explorer.rig import tiny
from tests.process import TINY


def test_every_field_is_a_lever_with_what_the_preset_says_of_it() -> None:
    found = {lever.path: lever for lever in levers(tiny().drive, {"cam.W_0"})}
    assert list(found) == list(field_table())
    assert found["mounting.allowed"].mark == found["harmonics.xi_b2"].mark == ""  # a setting; not known
    lever = found["gears.j_n"]
    assert (lever.text, lever.unit, lever.range, lever.mark) == ("18", "um", "0 to 200 um", "")
    assert "clearance" in lever.meaning
    assert (found["cam.W_0"].mark, found["gears.alpha"].mark) == ("*", "?")  # changed; left to its default


def test_the_text_of_a_value_is_read_back_as_the_same_value() -> None:
    session = opened_state(TINY)
    given = [lever for lever in levers(session.drive, set()) if lever.text != "unknown"]
    assert len(given) > len(field_table()) / 2
    for lever in given:
        there = load_text(session.source.text, TINY, [f"{lever.path}={lever.text}"])
        assert there.value(lever.path) == session.drive.value(lever.path), lever.path


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
def test_a_step_is_natural_to_its_unit_or_about_a_per_cent(path: str, value: float, step: float) -> None:
    assert step_of(field_table()[path], value) == pytest.approx(step)


def test_steps_leave_no_dust_of_binary_fractions() -> None:
    assert stepped(tiny("cam.W_0=0.58").drive, "cam.W_0", 1) == "0.59"
