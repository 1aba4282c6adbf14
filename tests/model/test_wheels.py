"""Measured wheels in a drive: the mark says where the teeth stand, and turning a wheel turns its pattern."""

from __future__ import annotations

import numpy as np
import pytest

from hdassist import check, kinematic_error, load_preset, mounting_curve, trace
from hdassist.drive.model.deviations import MeasuredTeeth, MeasuredWheel, PitchFile, tooth_phases
from hdassist.features.mounting.advice import advise
from hdassist.features.mounting.positions import phase_deg, rotated, seat_positions
from hdassist.run.errors import UsageError
from hdassist.run.run import UNCHECKED, Run
from tests.helpers.process import SMALL
from tests.helpers.support import first_harmonic

FIXED = ("rigid", "flexspline")


def wheel(deviation, mark_deg: float = 90.0) -> MeasuredWheel:
    return MeasuredWheel(PitchFile(np.asarray(deviation, dtype=float), 1, None, "wheel.csv", "", ()), mark_deg)


def harmonic(drive, fixed: str, mark_deg: float) -> MeasuredTeeth:
    """The preset's first harmonic of a wheel, as a gear checker would find it from a mark on."""
    xi_g, xi_b = tooth_phases(drive)
    gears, tolerances = drive.gears, drive.tolerances
    F_i, xi, z = (tolerances.F_i2, xi_b, gears.z_b) if fixed == "rigid" else (tolerances.F_i1, xi_g, gears.z_g)
    found = wheel(first_harmonic(F_i, xi - np.radians(mark_deg - 90), z), mark_deg)
    return MeasuredTeeth(b=found) if fixed == "rigid" else MeasuredTeeth(g=found)


def test_the_mark_says_where_teeth_stand():
    drive = load_preset(SMALL)
    places = np.arange(62.0)
    # tooth 0 of the model stands on the major axis, 90 deg from x; the pitch is 5.806 deg
    same, teeth = MeasuredTeeth(b=wheel(places)).in_drive(drive)
    assert (same.phases, teeth.g) == (drive.phases, None)
    assert teeth.b == pytest.approx(places)
    _, teeth = MeasuredTeeth(b=wheel(places, 90 + 3 * 360 / 62)).in_drive(drive)
    assert (teeth.b[3], teeth.b[4], teeth.b[2]) == (0, 1, 61)
    _, teeth = MeasuredTeeth(g=wheel(places[:60], 90 - 6)).in_drive(drive)
    assert (teeth.g[59], teeth.g[0]) == (0, 1)


def test_fractional_pitch_rotation_is_transferred_to_the_eccentricity_direction():
    drive = load_preset(SMALL, ["phases.phi_hb=20", "phases.phi_hg=30"])
    there, teeth = MeasuredTeeth(g=wheel(range(60), 97.5), b=wheel(range(62), 90 + 9.7 * 360 / 62)).in_drive(drive)
    assert (teeth.g[1], teeth.b[10]) == (0, 0)
    assert there.phases.phi_hg == pytest.approx(30 - 1.5)
    assert there.phases.phi_hb == pytest.approx(20 + 0.3 * 360 / 62)
    assert there.phases.phi_hh == drive.phases.phi_hh


@pytest.mark.parametrize("fixed", FIXED)
def test_a_measured_first_harmonic_is_the_presets_in_every_hole(fixed):
    drive = load_preset(
        SMALL,
        [f"mounting.fixed={fixed}", "tolerances.e_hg=40", "phases.phi_hg=0", "phases.xi_g=180", "phases.xi_b=270"],
    )
    measured = harmonic(drive, fixed, 33.0)
    phi_h, xi = ("phases.phi_hb", "phases.xi_b") if fixed == "rigid" else ("phases.phi_hg", "phases.xi_g")
    for rotation in seat_positions(drive):
        there, teeth = measured.rotated(drive, rotation).in_drive(drive)
        found = kinematic_error(there, 4, teeth=teeth, run=UNCHECKED).F_ior_arcsec
        # the same cam angles: deviation and cam offset of the preset turned by what is left of a pitch
        rest = there.value(phi_h) - drive.value(phi_h)
        preset = drive.with_values({phi_h: there.value(phi_h), xi: drive.value(xi) + rotation + rest})
        once = kinematic_error(preset, 4, run=UNCHECKED).F_ior_arcsec
        # a space of the rigid wheel has the deviation of its own place, a tooth pair of the preset that of the tooth
        assert found == pytest.approx(once, abs=1e-6 if fixed == "flexspline" else 0.03 * once)
        # and the cam angles between, up to 3 deg away where teeth are so few
        once = kinematic_error(rotated(drive, rotation), 4, run=UNCHECKED).F_ior_arcsec
        assert found == pytest.approx(once, rel=0.05)


@pytest.mark.parametrize(
    ("fixed", "rotation"),
    [
        ("rigid", 270.0),
        pytest.param("rigid", 300.0, marks=pytest.mark.slow),
        pytest.param("flexspline", 60.0, marks=pytest.mark.slow),
    ],
)
def test_a_measured_first_harmonic_is_the_presets_with_200_teeth(reference, fixed, rotation):
    drive = reference.model_copy(update={"mounting": reference.mounting.model_copy(update={"fixed": fixed})})
    once = kinematic_error(rotated(drive, rotation), 80, run=UNCHECKED).F_ior_arcsec
    there, teeth = harmonic(drive, fixed, 33.0).rotated(drive, rotation).in_drive(drive)
    again = kinematic_error(there, 80, teeth=teeth, run=UNCHECKED).F_ior_arcsec
    assert again == pytest.approx(once, abs=0.05)


def test_wheel_turned_by_whole_teeth_shifts_its_measured_pattern():
    drive = load_preset(SMALL, ["mounting.fixed=flexspline"])
    deviation = 20 * np.random.default_rng(1).standard_normal(60)
    turned = MeasuredTeeth(g=wheel(deviation, 40.0)).rotated(drive, 30.0)  # five teeth
    found = [m.in_drive(drive) for m in (turned, MeasuredTeeth(g=wheel(np.roll(deviation, 5), 40.0)))]
    assert found[0][0].phases.phi_hg == pytest.approx(found[1][0].phases.phi_hg)
    assert found[0][1].g == pytest.approx(found[1][1].g)


def test_a_measured_wheel_has_no_harmonics_besides():
    drive = load_preset(SMALL, ["harmonics.a_g2=3", "harmonics.a_b4=2"])
    there = MeasuredTeeth(g=wheel(np.zeros(60))).without_harmonics(drive)
    assert (there.tolerances.F_i1, there.harmonics.a_g2) == (0, 0)
    assert (there.tolerances.F_i2, there.harmonics.a_b4) == (40, 2)
    both = MeasuredTeeth(g=wheel(np.zeros(60)), b=wheel(np.zeros(62))).without_harmonics(drive)
    assert (both.tolerances.F_i2, both.harmonics.a_b4, both.tolerances.e_hb) == (0, 0, 30)


def test_only_the_fixed_wheel_turns():
    drive = load_preset(SMALL)
    both = MeasuredTeeth(g=wheel(np.zeros(60), 10.0), b=wheel(np.zeros(62), 20.0)).rotated(drive, 30.0)
    assert (both.g.mark_deg, both.b.mark_deg) == (10, 50)
    alone = MeasuredTeeth(g=wheel(np.zeros(60)))
    assert alone.rotated(drive, 30.0) == alone
    assert phase_deg(drive, both) == 50
    assert phase_deg(drive, alone) == phase_deg(drive) == 90


def test_second_harmonic_turns_the_output_by_itself_over_the_radius():
    """It moves the teeth of both zones alike, where a first one moves them against each other."""
    drive = load_preset(SMALL, ["tolerances.F_i1=0", "tolerances.F_i2=0", "tolerances.e_hb=0", "tolerances.e_hh=0"])
    second = MeasuredTeeth(b=wheel(10 * np.sin(4 * np.pi * np.arange(62) / 62)))
    assert check(drive).points[0].error.F_ior_arcsec < 1e-6
    found = check(drive, measured=second)
    lever = (drive.gears.m * 60 / 2) + 0.6  # mm, where flanks touch
    for point in found.points:
        assert point.error.F_ior_arcsec == pytest.approx(2 * 10e-3 / lever * 206265, rel=0.05)
    assert found.measured is second


@pytest.mark.parametrize("fixed", FIXED)
def test_curve_of_measured_teeth_agrees_with_check_at_every_position(fixed):
    drive = load_preset(SMALL, [f"mounting.fixed={fixed}", "mounting.holes=4"])
    rng = np.random.default_rng(2)
    measured = MeasuredTeeth(g=wheel(10 * rng.standard_normal(60), 12), b=wheel(10 * rng.standard_normal(62), 200))
    states = []
    curve = mounting_curve(
        drive, [4.0], seat_positions(drive), measured=measured, run=Run(None, states.append, cross_check=None)
    )
    assert curve.every_state.all()
    assert sum(states) == curve.certificate.states == 4 * 1860
    turned = measured.rotated(drive, 180.0)
    alone = check(drive.model_copy(update={"operation": drive.operation.model_copy(update={"M_g": (4.0,)})}),
                  measured=turned)  # fmt: skip
    assert curve.F_ior_arcsec[0, 2] == pytest.approx(alone.points[0].error.F_ior_arcsec, abs=1e-9)
    assert curve.phase_deg.tolist() == ([200, 290, 20, 110] if fixed == "rigid" else [12, 102, 192, 282])


def test_a_free_angle_keeps_to_its_steps():
    drive = load_preset(SMALL, ["mounting.holes=0"])
    curve = mounting_curve(drive, [4.0], [0, 120, 240], measured=harmonic(drive, "rigid", 0.0), run=UNCHECKED)
    assert curve.rotation_deg.tolist() == [0, 120, 240]


def test_measured_teeth_disable_sampling_but_the_advice_names_a_hole():
    drive = load_preset(SMALL, ["mounting.holes=2", "uncertainty.phases.xi_b=10"])
    measured = harmonic(drive, "rigid", 0.0)
    advice = advise(drive, [0, 180], measured=measured, run=UNCHECKED)
    assert (advice.word in ("TURN", "LEAVE"), advice.samples, advice.decision.is_sampled) == (True, None, False)
    advice = advise(drive, [0, 180], measured=measured, draws=0, run=UNCHECKED)
    assert advice.open_ and advice.chosen


def test_half_a_pitch_goes_the_same_way_in_every_state():
    """A flexspline that starts half a pitch on: no tooth is met twice, none is left out."""
    drive = load_preset(SMALL)
    measured = MeasuredTeeth(g=wheel(20 * np.random.default_rng(3).standard_normal(60)))
    half = trace(drive, 4, start_deg=3.0, measured=measured, run=UNCHECKED).error.rotation_arcsec
    nearly = trace(drive, 4, start_deg=3.001, measured=measured, run=UNCHECKED).error.rotation_arcsec
    other = trace(drive, 4, start_deg=2.999, measured=measured, run=UNCHECKED).error.rotation_arcsec
    assert min(np.abs(half - nearly).max(), np.abs(half - other).max()) < 0.05


def test_wrong_number_of_teeth():
    with pytest.raises(UsageError, match=r"expected 62 deviations .* not 60"):
        MeasuredTeeth(b=wheel(np.zeros(60))).in_drive(load_preset(SMALL))
