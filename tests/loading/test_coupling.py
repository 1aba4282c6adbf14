"""The cam's support by its coupling: where it is not given, in a file and on a command line, and saved again."""

from math import pi
from pathlib import Path

import pytest

from hdassist import Drive, load_preset
from hdassist.drive.loading import load_text, similar_preset, with_changes
from hdassist.drive.model.contacts import CAM, contact_system
from hdassist.drive.model.deviations import assumptions
from hdassist.drive.preset.knowledge import read_requirements
from hdassist.run.errors import PresetError, UsageError
from tests.helpers.process import TINY

TEXT = Path(TINY).read_text(encoding="utf-8")
SIZE = 30 / 160  # pitch diameter of the drive over that of the ranges


def coupled(cam: str, *overrides: str) -> Drive:
    """The tiny drive without C_3, with more said of its cam."""
    text = TEXT.replace(", C_3: 2.0e3}", "}").replace("{W_0: 1.74}", f"{{W_0: 1.74, {cam}}}")
    return load_text(text, "tiny.yaml", overrides)


@pytest.mark.moves("cam.coupling")
@pytest.mark.parametrize(
    ("cam", "value", "ends"),
    [
        ("coupling: oldham", 0, (0, 500 * SIZE)),
        ("coupling: solid", 4.5e4 * SIZE, (2e4 * SIZE, 1e5 * SIZE)),
        ("coupling: unknown", 1e4 * SIZE, (1e3 * SIZE, 1e5 * SIZE)),
        ("shaft_d: 14", 1e4 * SIZE, (1e3 * SIZE, 1e5 * SIZE)),
    ],
)
def test_missing_support_stiffness_follows_from_the_coupling(cam, value, ends):
    drive = coupled(cam)
    assert drive.number("supports.C_3") == pytest.approx(value, rel=1e-3)
    assert contact_system(drive).C[CAM] == pytest.approx([value, value], rel=1e-3)
    (found,) = (a for a in assumptions(drive) if a.path == "supports.C_3")
    assert (found.low, found.high) == pytest.approx(ends, rel=1e-3)
    assert found.reason.startswith(f"cam.coupling: {drive.cam.coupling}; ")


@pytest.mark.moves("cam.shaft_d", "cam.overhang")
def test_overhung_shaft_is_a_beam_in_series_with_its_bearing():
    drive = coupled("coupling: overhung, shaft_d: 14, overhang: 30")
    beam = 3 * 2.06e5 * (pi * 14**4 / 64) / 30**3  # 4.3e4 N/mm
    assert beam == pytest.approx(4.3e4, rel=0.01)
    assert 1 / drive.number("supports.C_3") == pytest.approx(1 / beam + 1 / (5e3 * 14), rel=1e-3)
    thick, long = (
        coupled(f"coupling: overhung, {sizes}") for sizes in ("shaft_d: 28, overhang: 30", "shaft_d: 14, overhang: 60")
    )
    assert thick.supports.C_3 > 3 * drive.supports.C_3
    assert long.supports.C_3 < drive.supports.C_3 / 3
    low, high = drive.source["supports.C_3"].range
    assert low < drive.supports.C_3 < high < beam


def test_an_overhung_cam_needs_its_shaft():
    with pytest.raises(PresetError, match=r"coupling overhung requires cam.shaft_d and cam.overhang"):
        coupled("coupling: overhung, shaft_d: 14")
    with pytest.raises(UsageError, match="overhung requires"):
        load_preset(TINY, ["cam.coupling=overhung"])


def test_given_support_overrides_the_coupling_unless_coupling_is_set():
    text = TEXT.replace("{W_0: 1.74}", "{W_0: 1.74, coupling: solid}")
    assert load_text(text, "").supports.C_3 == 2e3
    assert load_text(text, "", ["cam.coupling=oldham"]).supports.C_3 == 0
    assert load_text(text, "", ["cam.coupling=oldham", "supports.C_3=3e3"]).supports.C_3 == 3e3
    assert load_text(text, "", ["cam={W_0: 1.74}"]).supports.C_3 == 2e3
    # what was identified with another support, and its range, go with it
    paper = load_preset("vzp160", ["cam.coupling=oldham"])
    assert (paper.supports.C_3, paper.source["supports.C_3"].kind) == (0, "assumed")


@pytest.mark.parametrize("layout", [("C_3: 2.0e3}", "C_3: 2.0e3}"), ("supports: {C_1: 3.0e5, C_2: 6.0e3, C_3: 2.0e3}",
                                    "supports:\n  C_1: 3.0e5\n  C_2: 6.0e3\n  C_3: 2.0e3  # shaft\n")])  # fmt: skip
def test_a_coupling_is_saved_in_place_of_the_support(layout):
    text = TEXT.replace(*layout) + "source:\n  supports.C_3: {kind: identified, range: [1e3, 3e3], ref: rig}\n"
    saved = load_text(with_changes(text.encode(), "tiny", ["cam.coupling=oldham"]), "tiny")
    assert (saved.cam.coupling, saved.supports.C_3, saved.source["supports.C_3"].kind) == ("oldham", 0, "assumed")


def test_similar_drive_has_its_own_coupling_instead_of_the_support():
    def like(drive: Drive, **asked: str) -> Drive:
        return load_text(similar_preset("own", drive, read_requirements(drive, pitch_diameter="60", **asked)), "own")

    vzp160 = load_preset("vzp160")
    assert like(vzp160).number("supports.C_3") == pytest.approx(vzp160.supports.C_3 * 60 / 160, rel=1e-3)
    floats = like(vzp160, coupling="oldham")
    assert (floats.cam.coupling, floats.source["cam.coupling"].kind, floats.supports.C_3) == ("oldham", "given", 0)
    assert like(floats).cam.coupling == "oldham"
    overhung = like(vzp160, coupling="overhung", shaft="14x30")
    assert (overhung.cam.shaft_d, overhung.cam.overhang) == (14, 30)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"coupling": "oldam"}, "invalid --coupling oldam: expected one of solid, oldham, overhung, unknown"),
        ({"coupling": "overhung"}, "--coupling overhung and --shaft must be stated together"),
        ({"shaft": "14x30"}, "--coupling overhung and --shaft must be stated together"),
        ({"coupling": "overhung", "shaft": "14"}, "invalid --shaft 14: expected DIAMETERxOVERHANG in mm"),
        ({"coupling": "overhung", "shaft": "0x30"}, "invalid --shaft 0: expected a number above 0"),
    ],
)
def test_couplings_that_cannot_be_read_are_refused(asked, message):
    with pytest.raises(UsageError) as caught:
        read_requirements(load_preset("vzp160"), **asked)
    assert message in caught.value.message
