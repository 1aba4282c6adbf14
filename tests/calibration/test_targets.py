"""Targets of a calibration: what is read, and what is refused with its place."""

import pytest

from hdassist import load_preset
from hdassist.features.calibration import read_targets
from hdassist.run.errors import PresetError
from tests.helpers.process import SMALL

GOOD = """\
schema: hdassist.targets/1
name: rig 3
unknowns:
  gears.j_n: {low: 0, high: 15 um}
  contact.c_t: {low: 1e-5, high: 2e-4}
targets:
  - {quantity: F_ior_max, M_g: 80, value: 31, tolerance: 7 %}
  - {quantity: self_error, M_g: 4, low: 0.25, high: 2.0}
  - {quantity: K_2, T_1: 1, T_2: 4, low: 5e3}
  - {quantity: lost_motion, M_g: 0.2, value: 4 arcmin, tolerance: 6 arcsec}
"""


def read(text: str, file: str = "rig.yaml"):
    return read_targets(text.encode(), file, load_preset(SMALL))


def test_what_is_written_is_what_is_meant():
    targets = read(GOOD)
    assert targets.name == "rig 3"
    assert [(u.path, u.low, u.high, u.distribution) for u in targets.unknowns] == [
        ("gears.j_n", 0, 15, "even"),
        ("contact.c_t", 1e-5, 2e-4, "logarithmic"),
    ]
    first, second, third, fourth = targets.targets
    assert (first.value, first.tolerance) == (31, pytest.approx(2.17))
    assert (first.low, first.high) == (pytest.approx(28.83), pytest.approx(33.17))
    assert (second.value, second.low, second.high) == (None, 0.25, 2.0)
    assert (third.low, third.high) == (5e3, float("inf"))
    assert (fourth.value, fourth.tolerance) == (pytest.approx(240), pytest.approx(6))
    assert fourth.words == "lost_motion, M_g 0.2 N*m"


@pytest.mark.parametrize(
    ("old", "new", "place", "words"),
    [
        ("gears.j_n:", "gears.jn:", "4:3", "the nearest name is gears.j_n"),
        ("gears.j_n:", "gears.z_g:", "4:3", "is not a numeric field"),
        ("high: 15 um", "high: 500", "4:14", "low must be below high, and both must be within 0 to"),
        ("high: 15 um", "high: 15 kg", "4:29", "unit"),
        ("high: 2e-4", "high: 1e-6", "5:16", "low must be below high"),
        ("2e-4}", "2e-4, scale: log}", "5:40", "unknown key"),
        ("low: 1e-5, ", "", "5:3", "missing key"),
        ("F_ior_max", "F_ior_most", "7:16", "the nearest name is F_ior"),
        ("M_g: 80, ", "", "7:5", "missing key"),
        ("M_g: 80", "M_g: 0", "7:32", "undetermined"),
        ("7 %", "-7 %", "7:58", "above 0"),
        (", tolerance: 7 %", "", "7:5", "above 0"),
        ("low: 0.25, high: 2.0", "low: 3, high: 2.0", "8:5", "low below high"),
        (", low: 5e3", "", "9:5", "needs either value"),
        ("low: 5e3", "weight: 5", "9:", "unknown key"),
        ("7 %", "true %", "7:58", "a percentage above 0, for example 5 %"),
        ("M_g: 80", "M_g: true", "7:32", "must be a number"),
        ("value: 31", "value: .inf", "7:43", "must be a finite number"),
        ("value: 31", "value: 31, low: 3", "7:5", "needs either value"),
        ("low: 0.25, high: 2.0", "low: 0, high: 2, tolerance: 0", "8:64", "above 0"),
        ("schema: hdassist.targets/1", "schema: other", "1:9", "must be hdassist.targets/1"),
        ("name: rig 3", "name: rig 3\nname: rig 4", "3:1", "duplicate key"),
    ],
)
def test_every_fault_has_its_place(old, new, place, words):
    assert old in GOOD
    with pytest.raises(PresetError) as error:
        read(GOOD.replace(old, new, 1))
    assert error.value.exit_code == 4
    assert [f for f in error.value.findings if str(f).startswith(f"rig.yaml:{place}") and words in str(f)], error.value


def test_a_field_takes_its_bounds_from_the_source():
    def bounds(line: str, *sets: str):
        text = GOOD.replace("  gears.j_n: {low: 0, high: 15 um}\n", f"  {line}\n")
        found = read_targets(text.encode(), "rig.yaml", load_preset(SMALL, sets)).unknowns[0]
        return found.low, found.high

    ranged = "source.gears.j_n={kind: assumed, range: [2, 12]}"
    assert bounds("gears.j_n:", ranged) == (2, 12)
    assert bounds("gears.j_n: {high: 8}", ranged) == (2, 8)
    with pytest.raises(PresetError, match=r"4:3: unknowns\.gears\.j_n\.high: missing key"):
        bounds("gears.j_n: {low: 0}")


@pytest.mark.parametrize("text", ["", "- 1", "schema: hdassist.targets/1", "schema: [", GOOD.split("targets:\n")[0]])
def test_incomplete_texts(text):
    with pytest.raises(PresetError):
        read(text)


def test_all_faults_at_once():
    with pytest.raises(PresetError) as error:
        read(GOOD.replace("gears.j_n", "gears.jn").replace("7 %", "no").replace("self_error", "self"))
    assert len(error.value.findings) == 3


def test_faults_of_the_text_come_first():
    with pytest.raises(PresetError, match="YAML anchors are not allowed") as error:
        read(GOOD.replace("value: 31", "value: !!int 31").replace("low: 0,", "low: &a 0,"))
    assert len(error.value.findings) == 2
