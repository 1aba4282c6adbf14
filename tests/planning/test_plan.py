"""What a test of F'_ior sees: held against the solved cycle, and wrong verdicts against drives that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.belief.prior import FINE_TEETH_SHARE
from hdassist.drive.error.cycle import kinematic_error
from hdassist.drive.error.error_map import Batch, ErrorMap
from hdassist.drive.error.extremes import DRAWN_GRIDS
from hdassist.drive.error.readings import ranges_as_tested
from hdassist.drive.error.waves import error_lines
from hdassist.drive.model.deviations import ToothDeviations
from hdassist.drive.preset.fields import DEVIATIONS
from hdassist.features.planning import ApproachRun, DrivesUnderTest, PlanDemands, ReadingPlan, choose_plan, rough_curves
from hdassist.interface.pages.plan import plan_report
from hdassist.run.errors import Verdict
from hdassist.run.run import UNCHECKED
from tests.helpers.paper import facts_of
from tests.helpers.process import SMALL, TINY

ONE_WAVE = np.sin(2 * np.pi * np.arange(3600) / 3600)  # comes once in the cycle
TEN = ReadingPlan.positions(10)


def drives(*sizes: float, left: float | None = None, often: int = 1, **demands: float) -> DrivesUnderTest:
    """Drives with a wave that comes so often in the cycle, of an F'_ior each."""
    curves = np.array([size / 2 * ONE_WAVE[np.arange(3600) * often % 3600] for size in sizes])
    return DrivesUnderTest(curves, np.ones(len(sizes)), 1, left, PlanDemands(**demands))


@pytest.fixture(scope="module")
def small():
    """Error of the small drive in each state of its cycle [arcsec], and the drive under test."""
    drive = load_preset(SMALL)
    error = kinematic_error(drive, 4.0, run=UNCHECKED).error_arcsec
    return error, DrivesUnderTest(error_lines(drive, 4.0, [{}]).curves, np.ones(1), 1)


@pytest.mark.parametrize("positions", [10, 12, 20, 30, 31, 60, 62])
def test_seen_share_equals_that_of_positions_in_the_solved_cycle(small, positions: int):
    error, under_test = small
    starts, apart = np.arange(len(error)), len(error) // positions
    solved = np.ptp(error[(starts[:, None] + apart * np.arange(positions)) % len(error)], axis=1) / np.ptp(error)
    seen = under_test.seen_shares(ReadingPlan.positions(positions), starts[None] / len(error))
    assert np.abs(seen[0] - solved).max() < 0.03
    assert seen.mean() == pytest.approx(solved.mean(), abs=0.005)


def test_accuracy_at_twelve_positions_captures_the_share_of_the_plan(small):
    """The reference data read twelve positions of solved states; plan reads them on its curves."""
    error, under_test = small
    drive = load_preset(SMALL)
    starts = np.linspace(0, 1, 16, endpoint=False)
    batch = Batch(drive, {"tolerances.F_i2": np.full(len(starts), drive.number("tolerances.F_i2"))})
    tested, _ = ranges_as_tested(ErrorMap(drive, 4.0), batch, 12, starts, DRAWN_GRIDS)
    seen = under_test.seen_shares(ReadingPlan.positions(12), starts[None])[0]
    assert tested / np.ptp(error) == pytest.approx(seen, abs=0.03)


def test_curve_equals_the_error_of_the_solved_cycle(small):
    error, under_test = small
    curve = under_test.curves[0]
    at_states = np.interp(np.arange(len(error)) / len(error) * len(curve), np.arange(len(curve)), curve)
    assert np.std(at_states - error) < 0.01 * np.ptp(error)


@pytest.mark.parametrize(("readings", "turns"), [(12, 1), (211, 1), (24, 2), (7, 3)])
def test_a_line_looks_like_what_its_readings_show(readings: int, turns: int):
    plan = ReadingPlan.positions(readings, turns)
    often = np.array([1, 2, 100, 101, 120, 201, 202])
    for line, looks in zip(often, plan.seen_as(often), strict=True):
        read = np.cos(2 * np.pi * line * turns * np.arange(readings) / readings)
        spectrum = np.abs(np.fft.rfft(read))
        assert spectrum[round(float(looks))] == pytest.approx(spectrum.max())
        folded = line * turns % readings
        assert looks == min(folded, readings - folded)


@pytest.mark.parametrize("ratio", [60, 120])
def test_twelve_positions_cover_no_input_order_at_ratios_60_120(ratio: int):
    assert not ReadingPlan.positions(12).seen_as(ratio * np.arange(1.0, 13)).any()
    assert ReadingPlan.positions(13).seen_as(ratio * np.arange(1.0, 13)).all()


def test_plan_misses_a_line_as_frequent_as_its_readings():
    assert max(drives(20.0, often=10).judge(TEN).seen) == pytest.approx(0, abs=1e-9)
    assert min(drives(20.0, often=9).judge(TEN).seen) > 0.9


def test_full_cycle_recording_covers_all_and_judges_every_drive_correctly():
    whole = ReadingPlan.record(20, 20)
    judged = drives(*np.linspace(10, 30, 99), left=20.0).judge(whole)
    assert judged.seen == pytest.approx((1, 1, 1))
    assert (judged.false_pass.value, judged.false_fail.value) == (0, 0)
    assert judged.verdict is Verdict.PASS


def test_partially_covered_drive_can_pass_beyond_the_limit():
    three = ReadingPlan.positions(3)  # of a wave they see the share cos(30 deg) cos(d), d even from -30 to 30 deg
    assert drives(*[10.0] * 50, *[40.0] * 50, left=20.0).judge(three).verdict is Verdict.PASS
    found = drives(*[10.0] * 50, *[24.5] * 50, left=20.0).judge(three)
    passing = 1 - np.degrees(np.arccos(20 / 24.5 / np.cos(np.pi / 6))) / 30
    assert found.verdict is Verdict.FAIL
    assert found.false_pass.value == pytest.approx(0.5 * passing, abs=0.02)
    assert found.false_pass.low < found.false_pass.value < found.false_pass.high
    assert found.false_fail.value == 0


def test_a_corrected_reading_passes_fewer_and_fails_more():
    sizes = np.linspace(18, 22, 101)
    plan = ReadingPlan.positions(3)
    plain, corrected = (drives(*sizes, left=20.0, corrected=how).judge(plan) for how in (False, True))
    assert corrected.false_pass.value < plain.false_pass.value
    assert corrected.false_fail.value > plain.false_fail.value == 0


def test_noise_makes_both_wrong_and_a_second_direction_fails_more():
    sizes = np.linspace(10, 30, 101)
    whole = ReadingPlan.record(20, 20)
    once = drives(*sizes, left=20.0, noise_arcsec=4.0).judge(whole)
    assert once.false_pass.value > 0.03
    assert once.false_fail.value > 0.03
    twice = drives(*sizes, left=20.0, noise_arcsec=4.0).judge(ReadingPlan("both", 3600, 1 / 3600, both=True))
    assert twice.false_fail.value > once.false_fail.value
    assert twice.false_pass.value < once.false_pass.value


def test_shares_that_lie_about_the_demand_are_open():
    three = ReadingPlan.positions(3)
    sizes = [10.0] * 50 + [24.5] * 50
    share = drives(*sizes, left=20.0).judge(three).false_pass.value
    assert drives(*sizes, left=20.0, wrong=share).judge(three).verdict is Verdict.INCONCLUSIVE


def test_few_drives_without_a_limit_leave_a_test_inconclusive():
    nearly_all = ReadingPlan.positions(40)
    assert drives(*[20.0] * 200).judge(nearly_all).verdict is Verdict.PASS
    assert drives(*[20.0] * 8).judge(nearly_all).verdict is Verdict.INCONCLUSIVE  # no miss of 8 does not show 5 %
    assert drives(*[20.0] * 8).judge(ReadingPlan.record(20, 20)).verdict is Verdict.PASS  # no chance is in it
    assert drives(*[20.0] * 200).judge(ReadingPlan.positions(3)).verdict is Verdict.FAIL


def test_plans_of_a_drive_with_unknown_directions():
    drive = load_preset(TINY, ["phases.xi_b=unknown", "acceptance.F_ior={4: 2040}"])
    choice = choose_plan(drive, draws=8)
    assert choice.M_g == 4  # the torque with a limit
    assert choice.drives.F_ior_arcsec[:, 0] == pytest.approx(choice.samples.F_ior_arcsec[:, 1])
    assert [each.plan.readings for each in choice.over_positions] == list(range(6, 51))
    assert choice.judged[0].plan == ReadingPlan.positions(12)
    assert sum(line.variance_share for line in choice.lines) == pytest.approx(1, abs=0.1)
    assert all(line.per_output_turn.is_integer() for line in choice.lines)  # a cycle of one turn


def test_a_plan_of_a_joint_is_of_its_travel():
    drive = load_preset(SMALL)
    choices = [choose_plan(drive, draws=0, travel_deg=travel) for travel in (None, 60.0)]
    whole, joint = (choice.drives for choice in choices)
    assert whole.travel is None
    assert joint.F_ior_arcsec.shape == joint.starts.shape
    assert joint.F_ior_arcsec.max() <= whole.F_ior_arcsec.max() + 1e-9
    assert joint.F_ior_arcsec.min() < whole.F_ior_arcsec.min()
    points = joint.curves.shape[1]
    start = int(joint.starts[0, 0] * points)
    own = np.ptp(joint.curves[0][(start + np.arange(points // 6)) % points])
    assert own <= joint.F_ior_arcsec[0, 0] <= 1.1 * own
    plan = ReadingPlan.record(60 / 360 * 30, 30)
    assert joint.judge(plan).verdict == "PASS"
    assert plan.sees_all(joint.travel)
    following = [facts_of(plan_report(choice, "record.csv"))["next"] for choice in choices]
    assert [command.partition(" --travel ")[2] for command in following] == ["", "60"]


def test_rough_teeth_leave_the_range_and_lower_the_share():
    drive, cycle = load_preset(SMALL, ["operation.M_g=4"]), 30 * 180
    sizes = {"tolerances.F_i1": 40.0, "tolerances.F_i2": 25.0}
    none, one, both = rough_curves(
        drive, 4.0, [dict.fromkeys(sizes, 0.0), {"tolerances.F_i1": 40.0}, sizes], cycle
    ).arcsec
    assert not none.any()
    assert min(np.ptp(one), np.ptp(both)) > 0
    twice = rough_curves(drive, 4.0, [{path: 2 * size for path, size in sizes.items()}] * 3, cycle).arcsec[2]
    assert twice == pytest.approx(2 * rough_curves(drive, 4.0, [sizes] * 3, cycle).arcsec[2])
    curves = error_lines(drive, 4.0, [{}]).curves
    smooth = DrivesUnderTest(curves, np.ones(1), 1)
    assert choose_plan(drive, draws=0).drives.F_ior_arcsec == pytest.approx(smooth.F_ior_arcsec)  # that of every page
    many = curves + rough_curves(drive, 4.0, [sizes] * 64, cycle).arcsec
    rough = DrivesUnderTest(many, np.full(64, 1 / 64), 1)
    assert all(few < more for few, more in zip(rough.judge(TEN).seen, smooth.judge(TEN).seen, strict=True))


def test_rough_teeth_have_the_prior_of_single_teeth():
    """Half of the wheels have fine teeth, with at most an eighth of the largest error."""
    drive = load_preset(SMALL)
    errors = np.ptp(rough_curves(drive, 4.0, [{"tolerances.F_i1": 40.0}] * 200, 30 * 180).arcsec, axis=1)
    assert np.mean(errors < errors.max() / 8) == pytest.approx(FINE_TEETH_SHARE, abs=0.1)


def test_errors_of_rough_wheels_add_up_in_the_solved_cycle():
    drive = load_preset(SMALL)
    smooth = drive.with_values({each.size: 0.0 for each in DEVIATIONS})
    rng = np.random.default_rng(3)
    g, b = (1.5 * rng.standard_normal(z) for z in (drive.gears.z_g, drive.gears.z_b))
    each = [ToothDeviations(g), ToothDeviations(b=b), ToothDeviations(g, b)]
    of_g, of_b, of_both = (kinematic_error(smooth, 4.0, teeth=teeth, run=UNCHECKED).error_arcsec for teeth in each)
    assert of_g[: drive.gears.z_g] == pytest.approx(of_g[drive.gears.z_g : 2 * drive.gears.z_g], abs=1e-6)
    assert np.std(of_both - of_g - of_b) < 0.25 * np.std(of_both)


def test_a_reading_that_passes_is_of_a_good_drive():
    """Readings within the share that positions see and the guard band: of drives at the limit, 5 % pass."""
    under_test = drives(*np.linspace(19.9, 20.1, 200), left=20.0, noise_arcsec=0.2)
    test = under_test.test_of(under_test.judge(ReadingPlan.positions(3)), ApproachRun(), 20.0, 20.0)
    assert test.passing.value < 0.05
    assert test.failing.value < 0.05
    far = drives(*[5.0] * 50, *[60.0] * 50, left=20.0, noise_arcsec=0.2)
    test = far.test_of(far.judge(ReadingPlan.positions(3)), ApproachRun(), 20.0, 20.0)
    assert (test.passing.value, test.failing.value) == pytest.approx((0.5, 0.5))


@pytest.mark.parametrize("both", [False, True])
def test_test_duration_is_the_minute_of_its_last_reading(both: bool):
    plan, run = ReadingPlan.positions(7, both=both), ApproachRun(repeats=3)
    under_test = drives(20.0)
    test = under_test.test_of(under_test.judge(plan), run, 20.0, None)
    minutes, targets, _ = test.approaches
    assert test.readings == len(targets)
    assert test.minutes == pytest.approx(minutes[-1])
    once_more, longest = (replace(test, run=replace(run, repeats=repeats)) for repeats in (4, 10**9))
    each = once_more.minutes - test.minutes
    assert longest.minutes == pytest.approx(test.minutes + each * (10**9 - 3))  # a list of them would not fit
