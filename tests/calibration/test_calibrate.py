"""Values found from targets: hidden ones are recovered, and what the targets cannot know is said."""

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.error.error_map import ErrorMap
from hdassist.drive.error.stiffness import stiffness
from hdassist.features.calibration import F_ior_at_phases, calibrate, phase_scan, predictions, read_targets
from hdassist.interface.pages.data import calibrate_report
from hdassist.interface.terminal.output import report_object
from hdassist.run.errors import UntrustedError
from hdassist.run.run import UNCHECKED, Run
from tests.helpers.process import SMALL

ONE = 1  # start: least squares from the best point alone, where sets that lie far from it are not the point
HIDDEN = {"gears.j_n": 9.3, "contact.c_t": 4.4e-5}
UNKNOWNS = """\
schema: hdassist.targets/1
unknowns:
  gears.j_n: {low: 0, high: 15}
  contact.c_t: {low: 1e-5, high: 2e-4}
targets:
"""


def drive_of(*sets: str):
    return load_preset(SMALL, ["operation.M_g=[4]", *sets])


def targets_of(drive, lines: list[str], head: str = UNKNOWNS, folder: str = "."):
    text = head + "".join(f"  - {{{line}}}\n" for line in lines)
    return read_targets(text.encode(), f"{folder}/targets.yaml", drive)


@pytest.fixture(scope="module")
def cheap():
    """Targets that the hidden drive meets exactly."""
    curve = stiffness(drive_of().with_values(HIDDEN), T_1=2.0, T_2=6.0, T_max=7.0, run=UNCHECKED)
    lines = [
        f"quantity: lost_motion, M_g: 7, value: {curve.twist_at(7.0) - curve.twist_at(-7.0)}, tolerance: 0.5",
        f"quantity: K_2, T_1: 2, T_2: 6, value: {curve.weaker(2)}, tolerance: 0.1 %",
    ]
    return targets_of(drive_of(), lines)


@pytest.fixture(scope="module")
def recovered(cheap):
    return calibrate(drive_of(), cheap, points=64, run=Run(seed=3))


def test_hidden_values_are_recovered(recovered):
    for value, hidden in zip(recovered.values, HIDDEN.values(), strict=True):
        assert abs(value.found - hidden) <= 2 * value.half_width
        assert value.half_width < 0.03 * hidden
        assert value.determined > 0.9
    assert recovered.shortfall == ""
    assert len(recovered.fits) == 1
    assert [value.start for value in recovered.values] == [6, 6e-5]


def test_intervals_are_those_of_linear_propagation(recovered):
    # two targets, two unknowns: the intervals are what the inverse Jacobian makes of one tolerance each
    targets, paths = recovered.targets, list(HIDDEN)
    best = {value.path: value.found for value in recovered.values}
    columns = []
    for path in paths:
        step = best[path] * 0.02
        there, here = (
            targets.deviations(predictions(drive_of().with_values({**best, path: best[path] + by}), targets.targets))
            for by in (step, 0.0)
        )
        columns.append(np.subtract(there, here) / step)
    inverse = np.linalg.inv(np.array(columns).T)
    found = [value.half_width for value in recovered.values]
    assert found == pytest.approx(np.sqrt((inverse**2).sum(axis=1)), rel=0.15)


def test_one_target_cannot_tell_two_unknowns_apart(cheap):
    one = targets_of(drive_of(), [f"quantity: lost_motion, M_g: 7, value: {cheap.targets[0].value}, tolerance: 0.5"])
    found = calibrate(drive_of(), one, points=64, run=Run(seed=1))
    assert found.shortfall == ""
    ((a, b, correlation),) = found.indistinct
    assert {a, b} == set(HIDDEN)
    # more clearance with stiffer teeth is the same twist
    assert correlation < -0.95
    assert len(found.fits) > 1
    for other in found.fits[1:]:
        assert all(one.met(other.predictions))
        apart = np.log(other.values[1] / found.fits[0].values[1])
        assert abs(other.values[0] - found.fits[0].values[0]) > 0.2 * 15 or abs(apart) > np.log(2)


def test_targets_that_cannot_be_met_get_the_nearest(cheap):
    impossible = targets_of(
        drive_of(), [f"quantity: lost_motion, M_g: 7, value: {10 * cheap.targets[0].value}, tolerance: 1 %"]
    )
    found = calibrate(drive_of(), impossible, points=32, starts=ONE)
    assert found.shortfall
    # both unknowns at the bound that gives the most twist
    assert found.fits[0].values == pytest.approx((15, 2e-4), rel=0.1)


def test_what_stood_in_the_way_is_named_with_its_number(cheap):
    found = 1e4 * stiffness(drive_of("gears.j_n=2"), run=UNCHECKED).weaker(1)
    head = UNKNOWNS.replace("  gears.j_n: {low: 0, high: 15}\n", "").replace("high: 2e-4", "high: 7e-5")
    soft = targets_of(drive_of(), [f"quantity: K_1, value: {found / 1e5}, tolerance: 5 %"], head)
    result = calibrate(drive_of(), soft, points=8, starts=ONE)
    assert result.values[0].held_at == 7e-5
    (warning,) = [text for text in calibrate_report(result).warnings if "missed" in text]
    assert f"K_1 is {result.fits[0].predictions[0]:.4g} N*m/rad, wanted {found / 1e5:g}"[:30] in warning
    assert "contact.c_t is at its bound 7e-5; the values" in warning
    assert report_object(calibrate_report(result))["unknowns"][0]["held_at"] == 7e-5


def test_missed_target_without_active_bounds_is_reported_as_such(cheap):
    torn = targets_of(drive_of(), [f"quantity: K_1, value: {k}, tolerance: 1 %" for k in (4000, 4500)])
    result = calibrate(drive_of(), torn, points=16, starts=ONE)
    assert "wanted 4000 ± 40; K_1 is" in result.shortfall
    assert result.shortfall.endswith("wanted 4500 ± 45; no fitted value is at its bound")


def test_unconverged_fit_reports_the_targets_that_it_misses(cheap):
    far = targets_of(drive_of(), ["quantity: lost_motion, M_g: 7, value: 5000, tolerance: 1 %"])
    with pytest.raises(UntrustedError, match=r"lost_motion, M_g 7 N\*m is \d+\.\d arcsec, wanted 5000 ± 50"):
        calibrate(drive_of(), far, points=8, starts=ONE, iterations=1)


def test_nothing_computable_is_an_error(cheap):
    # a torque beyond the model at every point
    wild = targets_of(drive_of(), ["quantity: lost_motion, M_g: 5000, value: 10, tolerance: 1"])
    with pytest.raises(UntrustedError, match=r"could be computed; at the preset's values: .*wind-up") as error:
        calibrate(drive_of(), wild, points=8)
    assert error.value.exit_code == 5


def test_quantities_are_those_of_the_commands(reference):
    head = UNKNOWNS.replace("contact.c_t: {low: 1e-5,", "contact.c_t: {low: 1e-6,")
    asked = [
        "quantity: F_ior, M_g: 80, phase: 180, value: 20.07, tolerance: 0.1",
        "quantity: F_ior, M_g: 800, phase: 0, value: 12.29, tolerance: 0.1",
        "quantity: self_error, M_g: 800, value: 1.9, tolerance: 0.2",
    ]
    targets = targets_of(reference, asked, head)
    assert targets.met(predictions(reference, targets.targets)) == [True] * 3


def test_stiffnesses_and_lost_motion_are_those_of_the_curve():
    """The data sheet's quantities are read off the curve that `stiffness` draws, whose points change nothing."""
    drive = drive_of("operation.rated=5")
    asked = ["K_1", "K_2, T_1: 1.5, T_2: 4", "K_3", "lost_motion", "lost_motion, M_g: 3"]
    lines = [f"quantity: {words}, value: 1, tolerance: 1" for words in asked]
    found = predictions(drive, targets_of(drive, lines).targets)
    curve, own = stiffness(drive), stiffness(drive, T_1=1.5, T_2=4, run=UNCHECKED)
    lost = 2 * stiffness(drive, T_max=3, run=UNCHECKED).twist_at(3)
    assert found == pytest.approx([curve.weaker(1), own.weaker(2), curve.weaker(3), curve.lost_motion_arcsec, lost])
    assert curve.weaker(1) == min(curve.positive[0].stiffness, curve.negative[0].stiffness)


def test_extremes_over_the_phase_are_those_of_the_curve():
    drive, phases = drive_of(), range(0, 360, 12)
    values, found = F_ior_at_phases(ErrorMap(drive, 4.0), phases), phase_scan(drive, 4.0)
    assert found.least <= min(values) + 1e-6
    assert found.greatest >= max(values) - 1e-6
    assert abs((found.worst_deg - phases[np.argmax(values)] + 180) % 360 - 180) < 12
