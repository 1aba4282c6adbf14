"""What of a drive is assumed: what its preset says so of, and what it leaves to a default."""

from pathlib import Path

import pytest

from hdassist.drive.loading import load_preset, load_text
from hdassist.drive.model.deviations import assumptions
from hdassist.drive.preset.fields import Source
from tests.helpers.process import SMALL

LEFT_OUT = ", h_a: 0.6", ", h_f: 1.35", ", k_t: 1.4", ", g_b: 0", ", j_n: 6", "c_t: 6.0e-5, ", "c_ball: 7.0e-5, "
D = 30 / 160  # pitch diameter of the drive, of those that the ranges are stated for


def loose(*overrides: str):
    """The small drive with what has a default left to it."""
    text = Path(SMALL).read_text(encoding="utf-8")
    for given in LEFT_OUT:
        assert text.count(given) == 1
        text = text.replace(given, "")
    return load_text(text, "loose.yaml", overrides)


def test_defaulted_field_has_an_assumed_range_for_its_size():
    found = {a.path: (a.low, a.high) for a in assumptions(loose())}
    assert set(found) == {
        "gears.h_a", "gears.h_f", "gears.j_n", "flexspline.k_t", "bearing.g_b", "contact.c_t", "contact.c_ball",
    }  # fmt: skip
    assert (found["gears.h_a"], found["flexspline.k_t"]) == ((0.5, 0.7), (1.0, 1.8))
    # as in drives by similarity: of the bearing as the diameter, of the teeth as the module, compliances as one over
    # that; a value outside of its range is in it all the same, as the default of 0 of the bearing
    assert found["bearing.g_b"] == pytest.approx((0, 24 * D))
    assert found["gears.j_n"] == pytest.approx((0, 20 * 0.5 / 0.8))
    assert found["contact.c_t"] == pytest.approx((0.3e-5 / D, 6e-5 / D))
    assert found["contact.c_ball"] == pytest.approx((min(1.25e-5 / D, 2.5e-5), 2.857e-5 / D))
    reasons = {a.path: a.reason for a in assumptions(loose())}
    assert reasons["contact.c_t"] == "only one edge of the face width carries load"
    assert reasons["gears.h_f"] == "usual basic racks"


def test_only_the_stiffness_of_teeth_that_is_used_is_assumed():
    coned = {a.path: (a.low, a.high) for a in assumptions(loose("numerics.stations=5"))}
    assert coned["contact.k_face"] == (6.8, 10.0)  # per width: the same for every size
    assert "contact.c_t" not in coned


def test_what_was_asked_for_is_not_assumed():
    said = "source.cam.W_0={kind: assumed, range: [0.55, 0.6], ref: judged}"
    (wave,) = (a for a in assumptions(loose(said)) if a.path == "cam.W_0")
    assert (wave.low, wave.high, wave.reason) == (0.55, 0.6, "judged")
    assert "cam.W_0" not in {a.path for a in assumptions(loose("cam.W_0=0.57"))}
    (stated,) = (a for a in assumptions(loose(said, "cam.W_0=0.57")) if a.path == "cam.W_0")
    assert (stated.low, stated.high) == (0.55, 0.6)  # a range that is stated beside the value counts


@pytest.mark.parametrize("ends", [(0.58, 0.58), (-0.1, 0.6), (0.55, 1e6), (0.6, 0.55)])
def test_assumed_range_that_is_empty_or_impossible_is_omitted(ends):
    drive = loose()
    drive = drive.model_copy(update={"source": {"cam.W_0": Source(kind="assumed", range=ends)}})
    assert "cam.W_0" not in {a.path for a in assumptions(drive)}


def test_a_difference_of_temperatures_may_be_any_of_its_range():
    (found,) = (a for a in assumptions(load_preset("size-17-100")) if a.path == "operation.dT")
    assert (found.low, found.high) == (-5, 15)
    said = "source.operation.dT={kind: assumed, range: [-2 K, 8 K], ref: thermometer}"
    (narrow,) = (a for a in assumptions(load_preset("size-17-100", [said])) if a.path == "operation.dT")
    assert (narrow.low, narrow.high, narrow.reason) == (-2, 8, "thermometer")
    assert "operation.dT" not in {a.path for a in assumptions(load_preset("size-17-100", ["operation.dT=5 K"]))}
