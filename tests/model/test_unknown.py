"""What is not known of a drive: which of its fields, and how far they may go."""

import pytest

from hdassist import load_preset
from hdassist.drive.model.deviations import (
    Unknown,
    unknown_names,
    unknown_notes,
    unknown_turn,
    unknowns,
)
from hdassist.drive.preset.fields import DEVIATIONS, field_table
from hdassist.drive.preset.knowledge import F_p
from tests.helpers.process import SMALL


def open_fields(*overrides: str) -> set[str]:
    return {u.path for u in unknowns(load_preset(SMALL, list(overrides)))}


def test_a_drive_that_gives_everything_leaves_nothing_open():
    assert open_fields() == set()
    assert unknowns(load_preset("vzp160")) == unknowns(load_preset("synthetic-160-162")) == ()


def test_every_deviation_can_be_unknown_with_its_direction():
    paths = {path for path, field in field_table().items() if field.unknown}
    assert paths == {path for each in DEVIATIONS for path in (each.size, each.direction)}
    sizes = {each.size: each.direction for each in DEVIATIONS if each.kind != "pitch"}
    for size, direction in sizes.items():
        assert open_fields(f"{size}=unknown", f"{direction}=unknown") == {size, direction}
        assert open_fields(f"{size}=unknown", f"{size}=0", f"{direction}=unknown") == set()  # nothing has no direction
    whole = {size: direction for size, direction in sizes.items() if not direction.startswith("harmonics.")}
    assert len(whole) == 6
    for size, direction in whole.items():
        assert open_fields(f"{size}=3", f"{direction}=unknown") == {direction}
        assert open_fields(f"{size}=unknown", f"{direction}=20") == {size}


def test_unknown_sizes_and_directions_have_the_ranges_of_their_part():
    found = {u.path: u for u in unknowns(load_preset("vzp160", [
        "tolerances.F_i1=unknown", "tolerances.e_hb=unknown", "harmonics.a_b2=unknown", "harmonics.a_b3=unknown",
    ]))}  # fmt: skip
    # ISO 1328-1:2013, class 9 is four classes from 5: 4 (0.002 d + 0.55 sqrt d + 0.7 m + 12), d = 160, m = 0.8
    assert found["tolerances.F_i1"].high == pytest.approx(4 * (0.32 + 0.55 * 160**0.5 + 0.56 + 12))
    assert found["tolerances.e_hb"].high == pytest.approx(80)  # the paper's own, at its size
    assert found["harmonics.a_b2"].high == pytest.approx(3)
    assert (found["harmonics.xi_b2"].high, found["harmonics.xi_b3"].high) == (180, 120)
    assert all(u.low == 0 for u in found.values())
    assert found["tolerances.F_i1"].reason == "F_p of class 9, ISO 1328-1:2013"
    assert found["harmonics.xi_b2"].reason == "any direction"


def test_eccentricity_ranges_grow_with_the_diameter_and_fixed_ones_more():
    # of 30 mm, in um
    names = ("e_hh", "e_hg", "e_hb", "e_b")
    for fixed, most in (("rigid", (6, 6, 15, 1.8)), ("flexspline", (6, 15, 6, 1.8))):
        drive = load_preset(SMALL, [f"mounting.fixed={fixed}", *(f"tolerances.{name}=unknown" for name in names)])
        assert [u.high for u in unknowns(drive) if u.path.startswith("tolerances.")] == pytest.approx(most)


def test_classes_of_teeth_are_steps_of_the_root_of_two():
    drive = load_preset("vzp160")
    steps = [
        F_p(drive.gears.pitch_diameter, drive.gears.m, grade) / F_p(drive.gears.pitch_diameter, drive.gears.m, 5)
        for grade in (4, 5, 6, 7, 9)
    ]
    assert steps == pytest.approx([0.5**0.5, 1, 2**0.5, 2, 4])


@pytest.mark.parametrize(
    ("overrides", "open_"),
    [
        (["phases.phi_hb=unknown"], True),
        (["phases.xi_b=unknown"], True),
        (["phases.xi_b=unknown", "tolerances.F_i2=0"], False),  # a wheel without deviations has no direction
        (["phases.xi_g=unknown", "phases.phi_hh=unknown"], False),
        (["phases.phi_hb=unknown", "harmonics.a_s2=2", "harmonics.xi_s2=10"], False),  # the seat's ovality is known
        (["phases.xi_b=unknown", "harmonics.a_b2=2", "harmonics.xi_b2=10"], False),
        (["tolerances.F_i2=0.5", "harmonics.a_b2=2", "harmonics.xi_b2=unknown"], False),  # little is not nothing
        (["mounting.fixed=flexspline", "tolerances.e_hg=20", "phases.phi_hg=unknown"], True),
        (["mounting.fixed=flexspline", "tolerances.e_hg=20", "phases.phi_hb=unknown"], False),
        ([], False),
    ],
)
def test_unknown_wheel_or_eccentricity_direction_makes_all_holes_equal(overrides, open_):
    assert bool(unknown_turn(load_preset(SMALL, overrides))) is open_


def test_what_is_computed_as_0_is_said():
    drive = load_preset(SMALL, ["phases.phi_hb=unknown", "harmonics.a_g3=unknown"])
    assert unknown_notes(drive) == ("unknown, and set to 0: phases.phi_hb, harmonics.a_g3, harmonics.xi_g3",)


def test_unknown_harmonics_are_limited_by_their_wheel():
    gears = load_preset(SMALL).gears
    class_9 = F_p(gears.pitch_diameter, gears.m, 9)
    found = {u.path: u.high for u in unknowns(load_preset(SMALL, ["harmonics.a_g2=unknown", "harmonics.a_b3=unknown"]))}
    assert (found["harmonics.a_g2"], found["harmonics.a_b3"]) == pytest.approx((0.08 * 20, 0.04 * 20))
    loose = load_preset(SMALL, ["tolerances.F_i1=unknown", "harmonics.a_g2=unknown"])
    assert {u.path: u.high for u in unknowns(loose)}["harmonics.a_g2"] == pytest.approx(0.08 * class_9 / 2)
    # a wheel without deviations has none of them
    none = ("tolerances.F_i1=0", "harmonics.a_g2=unknown", "harmonics.xi_g2=unknown")
    assert open_fields(*none) == set()
    assert open_fields(*none, "harmonics.a_b3=unknown") == {"harmonics.a_b3", "harmonics.xi_b3"}


def test_unknown_single_pitch_deviation_follows_the_class_of_its_wheel():
    """f_p and F_p of ISO 1328-1:2013, class 5: 0.001 d + 0.4 m + 5 and 0.002 d + 0.55 sqrt d + 0.7 m + 12 um."""
    share = (0.16 + 0.32 + 5) / (0.32 + 0.55 * 160**0.5 + 0.56 + 12)
    found = {u.path: u.high for u in unknowns(load_preset("vzp160", ["tolerances.f_p1=unknown", "tolerances.f_p2=2"]))}
    phases = {f"harmonics.xi_{wheel}{order}" for wheel in "gb" for order in range(6, 17, 2)}
    assert set(found) == {"tolerances.f_p1", *phases}
    assert found["tolerances.f_p1"] == pytest.approx(75 * share)
    assert {found[f"harmonics.xi_g{order}"] for order in (6, 16)} == {60, 22.5}
    assert open_fields("tolerances.F_i1=0", "tolerances.f_p1=unknown") == set()
    loose = {u.path: u.high for u in unknowns(load_preset("vzp160", ["tolerances={F_i2: 75, f_p2: 0, e_b: 0}"]))}
    assert loose["tolerances.f_p1"] == pytest.approx(loose["tolerances.F_i1"] * share)  # what is not written is open


def test_both_sides_may_be_open_that_of_the_wheel_first():
    drive = load_preset(SMALL, ["phases.phi_hb=unknown", "phases.xi_b=unknown"])
    assert unknown_turn(drive) == ("phases.xi_b", "phases.phi_hb")
    assert open_fields("tolerances.e_hb=0.5", "phases.phi_hb=unknown") == {"phases.phi_hb"}


@pytest.mark.parametrize(
    ("count", "said"), [(1, "p0"), (4, "p0, p1, p2, p3"), (6, "6 inputs, including p0, p1, p2, p3")]
)
def test_a_few_names_and_how_many_more(count, said):
    assert unknown_names([Unknown(f"p{k}", 0, 1, "") for k in range(count)]) == said
