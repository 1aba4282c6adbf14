"""Torsional stiffness: the curve, its segments, lost motion and play."""

from dataclasses import replace

import numpy as np
import pytest

from hdassist import load_preset, stiffness
from hdassist.drive.error.stiffness import Segment, Twist, catalogue_torques
from hdassist.drive.model.contacts import shell_twist_stiffness
from hdassist.drive.model.geometry import Geometry
from hdassist.drive.preset.fields import Catalogue
from hdassist.run.errors import UntrustedError, UsageError
from hdassist.run.run import UNCHECKED
from tests.helpers.process import SMALL
from tests.helpers.support import changed, wind_up

ARCSEC = np.degrees(3600)


def of(drive, **options):
    return stiffness(drive, run=UNCHECKED, **options)


@pytest.fixture(scope="module")
def plain(reference):
    return stiffness(reference, T_1=80.0, T_2=800.0)


def test_twist_adds_the_contacts_and_the_tube_in_series(reference, plain):
    for M_g, contact in ((80.0, 7.66), (800.0, 137.83)):
        tube = M_g / 2.29e6 * ARCSEC
        assert plain.twist_at(M_g) == pytest.approx(contact + tube, abs=0.1)
        row = int(np.flatnonzero(plain.torque == M_g)[0])
        assert plain.contact_arcsec[row] == pytest.approx(wind_up(reference, M_g), abs=1e-8)
    # the thin tube by hand: 2 pi G r^3 h/l
    by_hand = 2 * np.pi * 2.06e5 / 2.6 * Geometry.of(reference).r_m ** 3 * 1.4 / 160 / 1e3
    assert plain.tube_arcsec == pytest.approx(plain.torque / by_hand * ARCSEC)


def test_segments_are_chords(plain):
    first, second, third = plain.positive
    assert (second.start, second.end) == (80, 800)
    chord = 720 / (plain.twist_at(800.0) - plain.twist_at(80.0)) * ARCSEC
    assert second.stiffness == pytest.approx(chord)
    assert second.stiffness == pytest.approx(0.76e6, rel=0.01)
    assert third.end == pytest.approx(1200)
    # without deviations the play is centred, and so is the first chord
    assert first.stiffness == pytest.approx(80 / plain.twist_at(80.0) * ARCSEC, rel=1e-6)


def test_both_directions_are_mirror_images(plain):
    assert plain.torque == pytest.approx(-plain.torque[::-1])
    assert plain.twist_arcsec == pytest.approx(-plain.twist_arcsec[::-1], abs=1e-7)
    for plus, minus in zip(plain.positive, plain.negative, strict=True):
        assert minus.stiffness == pytest.approx(plus.stiffness, rel=1e-9)
        assert (minus.start, minus.end) == (-plus.start, -plus.end)
    assert (np.diff(plain.twist_arcsec) > 0).all()


def test_the_certificate_covers_every_torque(plain):
    assert plain.certificate.states == len(plain.torque)
    assert plain.certificate.max_residual <= 1e-8
    assert plain.cross_check is not None
    assert plain.cross_check.states == 4
    assert plain.cross_check.max_difference_arcsec <= 0.01


def test_clearance_is_play_and_lost_motion(reference):
    # two flanks a side: opened by 1 um each, the flexspline turns 2 um/(r cos alpha) further from side to side
    loose, looser = (of(changed(reference, gears__j_n=j)) for j in (30.0, 31.0))
    per_um = 2e-3 / (82.5 * np.cos(np.radians(24.5))) * ARCSEC
    assert looser.play_arcsec - loose.play_arcsec == pytest.approx(per_um, rel=0.05)
    assert looser.lost_motion_arcsec - loose.lost_motion_arcsec == pytest.approx(per_um, rel=0.05)


def test_elastic_twist_is_no_play(reference):
    # teeth touch on both flanks: all that is left between the least torques is elastic
    tight = changed(reference, gears__j_n=0.0)
    assert of(tight).play_arcsec < 0.01
    assert of(reference).play_arcsec < 0.01


def test_only_the_tube_twists_if_contacts_lock_the_rim(reference):
    part = reference.contact
    stiff = {f"contact__{name}": getattr(part, name) / 1e4 for name in ("c_t", "c_ball", "c_bore")}
    curve = of(changed(reference, gears__j_n=0.0, **stiff))
    tube = shell_twist_stiffness(reference, Geometry.of(reference)) / 1e3
    assert [s.stiffness for s in curve.positive] == pytest.approx([tube] * 3, rel=0.01)
    assert all(s.stiffness < tube for s in curve.positive)


@pytest.mark.parametrize("name", ["c_t", "c_ball"])
def test_stiffer_contacts_raise_each_segment(reference, plain, name):
    stiffer = changed(reference, **{f"contact__{name}": getattr(reference.contact, name) / 2})
    curve = of(stiffer, T_1=80.0, T_2=800.0)
    assert all(new.stiffness > old.stiffness for new, old in zip(curve.positive, plain.positive, strict=True))


def test_stiffness_is_independent_of_the_number_of_torques(reference, plain):
    coarse = of(reference, T_1=80.0, T_2=800.0, points=7)
    assert len(coarse.torque) < len(plain.torque)
    ours, theirs = ([s.stiffness for s in c.positive] for c in (coarse, plain))
    assert ours == pytest.approx(theirs, rel=1e-9)
    assert coarse.lost_motion_arcsec == pytest.approx(plain.lost_motion_arcsec, abs=1e-7)


def test_catalogue_torques_follow_the_cube_of_the_diameter(reference):
    T_1, T_2 = catalogue_torques(reference)
    size_65 = changed(reference, gears__m=2.54 * 65 / 200)
    assert catalogue_torques(size_65) == pytest.approx((235, 843), rel=0.01)
    assert 168 < T_1 < 235
    assert 598 < T_2 < 843


def test_of_one_end_that_the_catalogue_gives_the_other_follows(reference):
    for given, ends in (({"T_1": 16.8}, (16.8, 59.8)), ({"T_2": 59.8}, (16.8, 59.8)), ({"T_1": 9, "T_2": 60}, (9, 60))):
        assert catalogue_torques(reference.model_copy(update={"catalogue": Catalogue(**given)})) == pytest.approx(ends)


def test_lost_motion_is_at_four_hundredths_of_the_rated_torque(reference):
    rated = of(changed(reference, operation__rated=1000.0))
    assert rated.rated == 1000
    assert rated.lost_motion_arcsec == pytest.approx(rated.twist_at(40.0) - rated.twist_at(-40.0))
    assert 40.0 in rated.torque
    assert of(reference).rated == 800


def test_a_short_curve_has_fewer_segments(reference):
    # a chord to the end of the curve would be no K2
    assert [s.end for s in of(reference, T_1=100.0, T_2=600.0, T_max=300.0).positive] == [100]
    assert [s.end for s in of(reference, T_1=100.0, T_2=600.0, T_max=600.0).positive] == [100, 600]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"T_1": 900.0}, r"T_1 \(900 N.m\) must be below T_2 \(766.083 N.m\)"),
        ({"T_2": 30.0}, r"T_1 \(215.221 N.m\) must be below T_2 \(30 N.m\)"),
        ({"T_2": -5.0}, "invalid T_2: -5 "),
        ({"T_2": np.inf}, "invalid T_2: inf "),
        ({"T_max": 0.0}, "the end of the curve: 0 "),
        ({"T_max": np.nan}, "the end of the curve: nan "),
    ],
)
def test_a_torque_that_cannot_be_meant_is_named(reference, options, said):
    with pytest.raises(UsageError, match=said):
        of(reference, **options)


def test_beyond_the_model_there_is_no_number(reference):
    with pytest.raises(UntrustedError, match="wind-up of"):
        of(reference, T_max=50e3)


def test_small_drives_too():
    small = load_preset(SMALL)
    curve = of(small)
    assert curve.positive[1].stiffness > 1e3
    low, high = curve.torque[3], curve.torque[-5]
    assert Twist(small).between(low, high) == pytest.approx(curve.twist_at(high) - curve.twist_at(low), abs=1e-7)


def test_the_weaker_side_counts(plain):
    sides = {"positive": (1e6, 2e6), "negative": (3e6, 1e6)}
    curve = replace(plain, **{side: tuple(Segment(0.0, 1.0, K) for K in values) for side, values in sides.items()})
    assert [curve.weaker(segment) for segment in (1, 2)] == [1e6, 1e6]
