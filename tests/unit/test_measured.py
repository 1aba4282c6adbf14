"""Measured wheels in a drive: the mark says where the teeth stand, and turning a wheel turns its pattern."""
"""Measured traces with a known answer: F'_ior, orders, directions, coverage and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from hdassist import check, kinematic_error, load_preset, mounting_curve, trace
from hdassist.analysis.advice import advise
from hdassist.analysis.mounting import phase_deg, rotated, seat_positions
from hdassist.errors import UsageError
from hdassist.model.deviations import first_harmonic, tooth_phases
from hdassist.model.measured import MeasuredTeeth, MeasuredWheel
from hdassist.preset.pitch import PitchFile
from tests.cli.process import SMALL

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


def test_the_rest_of_a_pitch_goes_to_the_cam_offset_that_stands_with_the_wheel():
    drive = load_preset(SMALL, ["phases.phi_hb=20", "phases.phi_hg=30"])
    there, teeth = MeasuredTeeth(g=wheel(range(60), 97.5), b=wheel(range(62), 90 + 9.7 * 360 / 62)).in_drive(drive)
    assert (teeth.g[1], teeth.b[10]) == (0, 0)
    assert there.phases.phi_hg == pytest.approx(30 - 1.5)
    assert there.phases.phi_hb == pytest.approx(20 + 0.3 * 360 / 62)
    assert there.phases.phi_hh == drive.phases.phi_hh


@pytest.mark.parametrize("fixed", FIXED)
def test_a_measured_first_harmonic_is_the_presets_in_every_hole(fixed):
    drive = load_preset(SMALL, [f"mounting.fixed={fixed}", "tolerances.e_hg=40", "mounting.mark_kind=runout"])
    measured = harmonic(drive, fixed, 33.0)
    phi_h, xi = ("phases.phi_hb", "phases.xi_b") if fixed == "rigid" else ("phases.phi_hg", "phases.xi_g")
    for rotation in seat_positions(drive):
        there, teeth = measured.rotated(drive, rotation).in_drive(drive)
        found = kinematic_error(there, 4, teeth=teeth, cross_check=None).F_ior_arcsec
        # the same cam angles: deviation and cam offset of the preset turned by what is left of a pitch
        rest = there.value(phi_h) - drive.value(phi_h)
        preset = drive.with_values({phi_h: there.value(phi_h), xi: drive.value(xi) + rotation + rest})
        once = kinematic_error(preset, 4, cross_check=None).F_ior_arcsec
        # a space of the rigid wheel has the deviation of its own place, a tooth pair of the preset that of the tooth
        assert found == pytest.approx(once, abs=1e-6 if fixed == "flexspline" else 0.03 * once)
        # and the cam angles between, up to 3 deg away where teeth are so few
        once = kinematic_error(rotated(drive, rotation), 4, cross_check=None).F_ior_arcsec
        assert found == pytest.approx(once, rel=0.05)


@pytest.mark.parametrize(("fixed", "rotation"), [("rigid", 270.0), ("rigid", 300.0), ("flexspline", 60.0)])
def test_a_measured_first_harmonic_is_the_presets_with_200_teeth(reference, fixed, rotation):
    drive = reference.model_copy(update={"mounting": reference.mounting.model_copy(update={"fixed": fixed})})
    once = kinematic_error(rotated(drive, rotation), 80, cross_check=None).F_ior_arcsec
    there, teeth = harmonic(drive, fixed, 33.0).rotated(drive, rotation).in_drive(drive)
    again = kinematic_error(there, 80, teeth=teeth, cross_check=None).F_ior_arcsec
    assert again == pytest.approx(once, abs=0.05)


def test_a_wheel_turned_by_whole_teeth_sees_the_same_pattern_further_on():
    drive = load_preset(SMALL, ["mounting.fixed=flexspline"])
    deviation = 20 * np.random.default_rng(1).standard_normal(60)
    turned = MeasuredTeeth(g=wheel(deviation, 40.0)).rotated(drive, 30.0)  # five teeth
    found = [m.in_drive(drive) for m in (turned, MeasuredTeeth(g=wheel(np.roll(deviation, 5), 40.0)))]
    assert found[0][0].phases.phi_hg == pytest.approx(found[1][0].phases.phi_hg)
    assert found[0][1].g == pytest.approx(found[1][1].g)


def test_only_the_fixed_wheel_turns():
    drive = load_preset(SMALL)
    both = MeasuredTeeth(g=wheel(np.zeros(60), 10.0), b=wheel(np.zeros(62), 20.0)).rotated(drive, 30.0)
    assert (both.g.mark_deg, both.b.mark_deg) == (10, 50)
    alone = MeasuredTeeth(g=wheel(np.zeros(60)))
    assert alone.rotated(drive, 30.0) == alone
    assert phase_deg(drive, both) == 50
    assert phase_deg(drive, alone) == phase_deg(drive) == 90


def test_a_second_harmonic_turns_the_output_by_itself_over_the_radius():
    """It moves the teeth of both zones alike, where a first one moves them against each other."""
    drive = load_preset(SMALL, ["tolerances.F_i1=0", "tolerances.F_i2=0", "tolerances.e_hb=0", "tolerances.e_hh=0"])
    second = MeasuredTeeth(b=wheel(10 * np.sin(4 * np.pi * np.arange(62) / 62)))
    assert check(drive).points[0].error.F_ior_arcsec < 1e-6
    found = check(drive, measured=second)
    lever = (drive.gears.m * 60 / 2) + 0.6  # mm, where flanks touch
    for point in found.points:
        assert point.error.F_ior_arcsec == pytest.approx(2 * 10e-3 / lever * 206265, rel=0.05)
    assert found.measured is second
    assert found.points[0].sensitivity is None


@pytest.mark.parametrize("fixed", FIXED)
def test_a_curve_has_every_state_and_each_position_is_the_check_there(fixed):
    drive = load_preset(SMALL, [f"mounting.fixed={fixed}", "mounting.holes=4"])
    rng = np.random.default_rng(2)
    measured = MeasuredTeeth(g=wheel(10 * rng.standard_normal(60), 12), b=wheel(10 * rng.standard_normal(62), 200))
    states = []
    curve = mounting_curve(
        drive, [4.0], seat_positions(drive), measured=measured, cross_check=None, progress=states.append
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
    curve = mounting_curve(drive, [4.0], [0, 120, 240], measured=harmonic(drive, "rigid", 0.0), cross_check=None)
    assert curve.rotation_deg.tolist() == [0, 120, 240]


def test_what_needs_searches_is_left_out_or_refused():
    drive = load_preset(SMALL, ["mounting.holes=2", "uncertainty.phases.xi_b=10"])
    measured = harmonic(drive, "rigid", 0.0)
    with pytest.raises(UsageError, match="not sampled") as caught:
        advise(drive, [4.0], [0, 180], measured=measured)
    assert "--samples 0" in caught.value.hint
    advice = advise(drive, [4.0], [0, 180], measured=measured, samples=0, cross_check=None)
    assert (advice.others, advice.now, advice.best, advice.robust) == ((), (), (), None)


def test_half_a_pitch_goes_the_same_way_in_every_state():
    """A flexspline that starts half a pitch on: no tooth is met twice, none is left out."""
    drive = load_preset(SMALL)
    measured = MeasuredTeeth(g=wheel(20 * np.random.default_rng(3).standard_normal(60)))
    half = trace(drive, 4, start_deg=3.0, measured=measured, cross_check=None).error.rotation_arcsec
    nearly = trace(drive, 4, start_deg=3.001, measured=measured, cross_check=None).error.rotation_arcsec
    other = trace(drive, 4, start_deg=2.999, measured=measured, cross_check=None).error.rotation_arcsec
    assert min(np.abs(half - nearly).max(), np.abs(half - other).max()) < 0.05


def test_wrong_number_of_teeth():
    with pytest.raises(UsageError, match="62 deviations, not 60"):
        MeasuredTeeth(b=wheel(np.zeros(60))).in_drive(load_preset(SMALL))
from hdassist import load_preset, trace
from hdassist.analysis.budget import combined, parse_stated
from hdassist.analysis.gearing import Gearing, gearing_of
from hdassist.analysis.lines import lines, parse_orders
from hdassist.analysis.measured import measure
from hdassist.errors import DataError, UntrustedError, UsageError
from tests.cli.process import SMALL
from tests.rigs import drive_error, recorded, slow_noise, whole_range

RATIO, PER_TURN = 30.0, 120


def simulated(seed: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Cam angles [turns], errors [arcsec] and the true F'_ior of one of five rigs."""
    rng = np.random.default_rng(seed)
    curve = drive_error(rng, RATIO, scale=rng.choice([1.5, 5.0]))
    turns = np.arange(RATIO * PER_TURN) / PER_TURN
    rig = seed % 5
    if rig == 1:  # uneven steps
        turns = np.sort(turns + rng.uniform(-0.5, 0.5, len(turns)) / PER_TURN)
    if rig == 2:  # a third of the samples is missing
        turns = turns[rng.random(len(turns)) > 1 / 3]
    noise = slow_noise(rng, len(turns), 1.0, 0.8) if rig == 3 else rng.standard_normal(len(turns))
    error = curve(turns) + noise
    if rig == 4:  # a coarse reading
        error = np.round(error * 2) / 2
    return turns, error, whole_range(curve, RATIO)


def test_known_ranges_lie_within_the_stated_uncertainty():
    hits, raw_too_large = 0, 0
    for seed in range(60):
        turns, error, true = simulated(seed)
        (found,) = measure(recorded(turns, error), ratio=RATIO).directions
        low, high = found.interval_arcsec
        hits += low <= true <= high
        raw_too_large += found.raw_range_arcsec > high
    assert hits >= 57
    assert raw_too_large > 30  # what the uncorrected range would have said


def test_the_uncertainty_is_not_idle():
    widths = [measure(recorded(*simulated(seed)[:2]), ratio=RATIO).directions[0] for seed in range(0, 60, 6)]
    assert np.median([d.uncertainty_arcsec / d.range.value for d in widths]) < 0.05


@pytest.fixture(scope="module")
def model():
    """Cam turns and error of the full cycle of the small drive."""
    result = trace(load_preset(SMALL), 4, revolutions=30, cross_check=None)
    return result.error.states.phi_h / (2 * np.pi), result.error.error_arcsec


def test_the_range_of_a_model_is_recovered(model):
    turns, error = model
    drive = load_preset(SMALL)
    hits = 0
    for seed in range(20):
        noisy = error + 0.5 * np.random.default_rng(seed).standard_normal(len(error))
        (found,) = measure(recorded(turns, noisy), drive=drive).directions
        hits += found.interval_arcsec[0] <= np.ptp(error) <= found.interval_arcsec[1]
        assert not found.is_bound
    assert hits >= 19


def test_orders_of_a_model_have_its_causes(model):
    (found,) = measure(recorded(*model), drive=load_preset(SMALL)).directions
    causes = {round(o.per_cam_rev, 3): o for o in found.orders}
    assert causes[round(2 + 1 / 30, 3)].cause == "flexspline + rigid wheel"
    assert "once per output turn" in causes[round(1 / 30, 3)].cause
    spectrum = 2 * np.abs(np.fft.rfft(model[1])) / len(model[1])
    assert causes[2.0].amplitude_arcsec == pytest.approx(spectrum[60], abs=0.05)


def test_a_clean_wave_comes_back():
    turns = np.sort(np.random.default_rng(1).uniform(0, 4, 900))
    error = 7 + 10 * np.cos(2 * np.pi * 2 * turns + 0.5) + 1e-3 * np.sin(1e4 * turns)
    (found,) = measure(recorded(turns, error), ratio=100).directions
    order = next(o for o in found.orders if o.per_cam_rev == 2)
    assert (order.amplitude_arcsec, order.phase_deg) == pytest.approx((10, np.degrees(0.5)), abs=1e-2)
    assert found.range.value == pytest.approx(20, abs=0.05)


def test_amplitudes_are_as_uncertain_as_they_say():
    turns = np.arange(600) / 150
    departures = []
    for seed in range(80):
        noise = slow_noise(np.random.default_rng(seed), 600, 1.0, 0.9)
        (found,) = measure(recorded(turns, 10 * np.cos(4 * np.pi * turns) + noise), ratio=100).directions
        order = next(o for o in found.orders if o.per_cam_rev == 2)
        departures.append((order.amplitude_arcsec - 10) / order.uncertainty_arcsec)
    assert 0.6 < np.std(departures) < 1.4


def wave(turns: np.ndarray, seed: int = 0) -> np.ndarray:
    noise = 0.3 * np.random.default_rng(seed).standard_normal(len(turns))
    return 10 * np.cos(4 * np.pi * turns) + 3 * np.cos(2 * np.pi * turns + 1) + noise


EVEN = np.arange(600) / 200


def test_directions_are_kept_apart():
    turns = np.concatenate([EVEN, EVEN[::-1]])
    error = wave(turns) + np.repeat([0.0, 5.0], 600)
    result = measure(recorded(turns, error), ratio=100)
    assert {d.direction for d in result.directions} == {1, -1}
    assert result.reversal is not None
    assert result.reversal.mean_arcsec == pytest.approx(-5, abs=0.1)
    assert result.reversal.greatest_arcsec < 1
    for found in result.directions:  # the step between the directions is no part of F'_ior
        assert found.range.value == pytest.approx(24.2, abs=0.4)


def test_repeated_runs_in_one_record_share_their_orders():
    result = measure(recorded(np.concatenate([EVEN, EVEN]), np.concatenate([wave(EVEN), 3 + wave(EVEN, 1)])), ratio=100)
    (found,) = result.directions
    assert len(found.fit.level) == 2
    assert found.range.value == pytest.approx(24.2, abs=0.4)


def test_falling_angles_alone():
    (found,) = measure(recorded(EVEN[::-1], wave(EVEN)[::-1]), ratio=100).directions
    assert found.direction == -1
    assert found.range.value == pytest.approx(24.2, abs=0.4)


def test_a_shaft_that_stands_still_weighs_no_more():
    turns = np.concatenate([EVEN[:300], np.full(5000, EVEN[300]), EVEN[301:]])
    (found,) = measure(recorded(turns, wave(turns)), ratio=100).directions
    assert found.range.value == pytest.approx(24.2, abs=0.4)


def test_a_gap_is_not_visited():
    turns = np.concatenate([EVEN[:250], EVEN[400:]])
    (found,) = measure(recorded(turns, wave(turns)), ratio=100).directions
    gap = (found.grid_turns > EVEN[249] + 0.01) & (found.grid_turns < EVEN[400] - 0.01)
    assert not gap.any()
    assert found.coverage is not None
    assert found.coverage.visited < 3 * 36 - 20


def test_drift_is_taken_off_when_asked_and_said_when_not():
    error = wave(EVEN) + 4 * EVEN
    left = measure(recorded(EVEN, error), ratio=100)
    assert any("drift of 1" in text and "--drift linear" in text for text in left.warnings)
    (found,) = measure(recorded(EVEN, error), ratio=100, drift="linear").directions
    assert found.range.value == pytest.approx(24.2, abs=0.4)
    assert found.fit.drift.sum() == pytest.approx(12, abs=0.6)
    bent = measure(recorded(EVEN, error + 6 * (EVEN - 1.5) ** 2), ratio=100, drift="quadratic")
    assert bent.F_ior_arcsec == pytest.approx(24.2, abs=0.4)


def test_a_part_of_the_cycle_is_a_bound():
    (part,) = measure(recorded(EVEN, wave(EVEN)), ratio=100).directions
    assert part.is_bound
    assert part.coverage is not None
    assert (part.coverage.visited, part.coverage.cells) == (108, 3600)
    (unknown,) = measure(recorded(EVEN, wave(EVEN))).directions
    assert unknown.is_bound
    assert unknown.coverage is None


def test_gearings():
    assert gearing_of(None, 100) == Gearing(100, 100)
    odd = gearing_of(None, -99.5)
    assert odd == Gearing(99.5, 199)
    assert odd is not None
    assert odd.cycle_output == 2
    assert gearing_of(load_preset("vzp160"), None) == Gearing(100, 100)
    for ratio in (99.7, 3.0, float("nan")):
        with pytest.raises(UsageError, match="must be a multiple"):
            gearing_of(None, ratio)
    with pytest.raises(UsageError, match="knows the ratio"):
        gearing_of(load_preset("vzp160"), 100)


def test_declared_orders():
    assert parse_orders("1-3, 6") == (1, 2, 3, 6)
    assert parse_orders("2.02") == (2.02,)
    for wrong in ("", "0", "3-1", "x", "1;2", "1-", "-1", "1e9", "1.5-3"):
        with pytest.raises(UsageError):
            parse_orders(wrong)


def test_lines_follow_what_the_record_resolves():
    assert lines((1.0, 2.0), 3.0, 100).tolist() == [1, 2]
    assert len(lines((1.0, 2.0), 100.0, 100)) == 6 + 2 * 13
    part = lines((1.0, 2.0), 20.0, 100)
    assert np.diff(part).min() == pytest.approx(1 / 20)
    assert lines((2.0, 2.02), 10.0, 100).tolist() == pytest.approx([0.1, 1.9, 2.0, 2.1])
    assert lines((2.01, 2.02), 10.0, 100, beats=False).tolist() == [2.01]


@pytest.mark.parametrize(
    ("turns", "error", "words"),
    [
        (EVEN, np.random.default_rng(0).standard_normal(600), "not clear of its noise"),
        (EVEN[:190], wave(EVEN[:190]), "less than one cam turn"),
        (EVEN, wave(EVEN) + 60 * EVEN, "not clear"),
    ],
)
def test_what_cannot_be_trusted_is_not_given(turns, error, words):
    with pytest.raises((UntrustedError, DataError), match=words):
        measure(recorded(turns, error), ratio=100)


def test_steps_too_long_for_an_order():
    turns = np.arange(60) / 20
    assert any("orders up to 8 only" in text for text in measure(recorded(turns, wave(turns)), ratio=100).notes)
    with pytest.raises(UntrustedError, match="too long for order 12"):
        measure(recorded(turns, wave(turns)), ratio=100, orders="1-12")


def test_budget():
    stated = parse_stated(["encoder=0.3", "temperature=0.4"])
    (found,) = measure(recorded(EVEN, wave(EVEN)), ratio=100, stated=stated).directions
    (bare,) = measure(recorded(EVEN, wave(EVEN)), ratio=100).directions
    assert found.uncertainty_arcsec == pytest.approx(np.hypot(bare.uncertainty_arcsec, 0.5))
    assert {s.name for s in bare.sources if s.arcsec is None} == {"encoder", "coupling", "reseating", "temperature"}
    assert combined(bare.sources) == bare.uncertainty_arcsec
    for wrong in (["x=1"], ["encoder"], ["encoder=-1"], ["encoder=nan"], ["encoder=1", "encoder=2"]):
        with pytest.raises(UsageError):
            parse_stated(wrong)


def test_a_coarse_reading_without_noise_counts():
    error = np.round(10 * np.cos(4 * np.pi * EVEN))
    coarse = measure(recorded(EVEN, error, step=1.0), ratio=100).directions[0]
    (source,) = (s for s in coarse.sources if s.name == "resolution")
    assert source.arcsec == pytest.approx(1 / np.sqrt(6))


def test_the_same_seed_gives_the_same_figures():
    first, again = (measure(recorded(EVEN, wave(EVEN)), ratio=100, seed=4).F_ior_arcsec for _ in range(2))
    assert first == again
