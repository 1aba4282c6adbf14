"""Values found from targets: hidden ones are recovered, and what the targets cannot know is said."""

from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from pydantic import TypeAdapter

from hdassist import load_preset
from hdassist.calibration.calibrate import Fit, calibrate, shortfall
from hdassist.calibration.evaluations import Evaluations, evaluations_kind, evaluations_owner
from hdassist.calibration.quantities import REPORTING, SEARCHING, TargetQuantities
from hdassist.calibration.targets import read_targets
from hdassist.error.stiffness import stiffness
from hdassist.error.trace import trace
from hdassist.errors import DataError, UntrustedError, UsageError
from hdassist.pages.calibrate import calibrate_report
from hdassist.pages.trace import trace_csv
from hdassist.run.kept import RecordKind, open_kept
from hdassist.run.run import UNCHECKED, Run
from hdassist.terminal.answers import csv_text, report_object
from tests.process import SMALL

ONE = 1  # start: least squares from the best point alone, where sets that lie far from it are not the point
HIDDEN = {"gears.j_n": 9.3, "contact.c_t": 4.4e-5}
UNKNOWNS = """\
schema: hdassist.targets/1
unknowns:
  gears.j_n: {low: 0, high: 15}
  contact.c_t: {low: 1e-5, high: 2e-4, scale: log}
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
    return calibrate(drive_of(), cheap, Evaluations(drive_of(), cheap, Run(seed=3)), points=64)


def test_hidden_values_are_recovered(recovered):
    for value, half, hidden in zip(recovered.best.values, recovered.half_width, HIDDEN.values(), strict=True):
        assert abs(value - hidden) <= 2 * half
        assert half < 0.03 * hidden
    assert recovered.best.all_met
    assert min(recovered.determined) > 0.9
    assert len(recovered.fits) == 1
    assert recovered.start == (6, 6e-5)
    assert len(recovered.best.best_deg) == 1


def test_intervals_are_those_of_linear_propagation(recovered):
    # two targets, two unknowns: the intervals are what the inverse Jacobian makes of one tolerance each
    targets, paths = recovered.targets, list(HIDDEN)
    best = dict(zip(paths, recovered.best.values, strict=True))
    columns = []
    for path in paths:
        step = best[path] * 0.02
        there, here = (
            TargetQuantities(drive_of().with_values({**best, path: best[path] + by}), REPORTING) for by in (step, 0.0)
        )
        columns.append([float(there.residuals(t)[0] - here.residuals(t)[0]) / step for t in targets.targets])
    inverse = np.linalg.inv(np.array(columns).T)
    assert recovered.half_width == pytest.approx(np.sqrt((inverse**2).sum(axis=1)), rel=0.15)


def test_one_target_cannot_tell_two_unknowns_apart(cheap):
    one = targets_of(drive_of(), [f"quantity: lost_motion, M_g: 7, value: {cheap.targets[0].value}, tolerance: 0.5"])
    found = calibrate(drive_of(), one, Evaluations(drive_of(), one, Run(seed=1)), points=64)
    assert found.best.all_met
    ((a, b, correlation),) = found.indistinct
    assert {a, b} == set(HIDDEN)
    # more clearance with stiffer teeth is the same twist
    assert correlation < -0.95
    assert len(found.fits) > 1
    for other in found.fits[1:]:
        assert other.all_met
        apart = np.log(other.values[1] / found.best.values[1])
        assert abs(other.values[0] - found.best.values[0]) > 0.2 * 15 or abs(apart) > np.log(2)


def test_targets_that_cannot_be_met_get_the_nearest(cheap):
    impossible = targets_of(
        drive_of(), [f"quantity: lost_motion, M_g: 7, value: {10 * cheap.targets[0].value}, tolerance: 1 %"]
    )
    found = calibrate(drive_of(), impossible, Evaluations(drive_of(), impossible), points=32, starts=ONE)
    assert not found.best.all_met
    # both unknowns at the bound that gives the most twist
    assert found.best.values == pytest.approx((15, 2e-4), rel=0.1)


def test_what_stood_in_the_way_is_named_with_its_number(cheap):
    found = 1e4 * stiffness(drive_of("gears.j_n=2"), run=UNCHECKED).weaker(1)
    head = UNKNOWNS.replace("  gears.j_n: {low: 0, high: 15}\n", "").replace("high: 2e-4", "high: 7e-5")
    soft = targets_of(drive_of(), [f"quantity: K_1, value: {found / 1e5}, tolerance: 5 %"], head)
    result = calibrate(drive_of(), soft, Evaluations(drive_of(), soft), points=8, starts=ONE)
    assert result.held == (7e-5,)
    (warning,) = [text for text in calibrate_report(result).warnings if "missed" in text]
    over = result.best.predictions[0] / (found / 1e5) - 1
    assert f"is still {100 * over:.2g} % above its target" in warning
    assert "contact.c_t stands at its bound 7e-5; the values" in warning
    assert report_object(calibrate_report(result))["unknowns"][0]["held_at"] == 7e-5
    # what is missed with no bound in the way, and nothing at all
    torn = targets_of(drive_of(), ["quantity: K_1, value: 100, tolerance: 1", "quantity: K_1, low: 6000"])
    words = shortfall(torn, Fit((), (), (100, 5400), (True, False)), (None, None))
    assert words == "K_1 5400 N*m/rad is still 10 % below its target 6000; no bound is in the way"
    assert shortfall(torn, Fit((), (), (100, 6000), (True, True)), (15, None)) == ""


def test_a_fit_that_does_not_come_to_rest_says_what_it_misses(cheap):
    far = targets_of(drive_of(), ["quantity: lost_motion, M_g: 7, value: 5000, tolerance: 1 %"])
    with pytest.raises(UntrustedError, match=r"come to rest: lost_motion, M_g 7 N\*m \d+ arcsec is still \d\d % below"):
        calibrate(drive_of(), far, Evaluations(drive_of(), far), points=8, starts=ONE, iterations=1)


@contextmanager
def state_of(drive, targets, file):
    with open_kept(str(file), evaluations_owner(drive, targets), evaluations_kind(targets)) as kept:
        yield Evaluations(drive, targets, Run(seed=5), kept)


def test_a_state_file_is_gone_on_with(cheap, tmp_path):
    file = tmp_path / "state.jsonl"
    with state_of(drive_of(), cheap, file) as first:
        one = calibrate(drive_of(), cheap, first, points=32, starts=ONE)
    text = file.read_text()
    # stopped in the middle of a line
    file.write_text(text[: len(text) // 2])
    with state_of(drive_of(), cheap, file) as second:
        assert 0 < second.remembered < first.computed
        two = calibrate(drive_of(), cheap, second, points=32, starts=ONE)
    assert second.computed < first.computed
    assert two.fits == one.fits
    with state_of(drive_of(), cheap, file) as third:
        assert calibrate(drive_of(), cheap, third, points=32, starts=ONE).fits == one.fits
    assert third.computed == 0


def test_a_state_of_something_else_is_refused(cheap, tmp_path):
    file = tmp_path / "state.jsonl"
    with state_of(drive_of(), cheap, file):
        before = file.read_bytes()
    for drive, targets, words in (
        (drive_of("gears.j_n=5"), cheap, "options.set"),
        (drive_of(), targets_of(drive_of(), ["quantity: K_1, value: 100, tolerance: 1"]), "inputs.targets"),
    ):
        with pytest.raises(UsageError, match=words), state_of(drive, targets, file):
            pass
    assert file.read_bytes() == before


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"values": [9.3]}, "expected values of 2 unknowns, 2 residuals"),
        ({"residuals": [0.5, 0.5, 0.5]}, "expected values of 2 unknowns, 2 residuals"),
        ({"residuals": ["0.5", 0.5]}, "residuals.0: Input should be a valid number"),
    ],
)
def test_a_drive_that_cannot_have_been_computed_is_refused(cheap, tmp_path, change, why):
    file = tmp_path / "state.jsonl"
    entry = {"values": [9.3, 4.4e-5], "residuals": [0.5, 0.5]}
    with open_kept(str(file), evaluations_owner(drive_of(), cheap), RecordKind(TypeAdapter(dict))) as kept:
        kept.append([entry, {**entry, **change}])
    with pytest.raises(DataError) as refused, state_of(drive_of(), cheap, file):
        pass
    assert refused.value.message == f"{file}:3: invalid record: {why}"


def test_nothing_computable_is_an_error(cheap):
    # a torque beyond the model at every point
    wild = targets_of(drive_of(), ["quantity: lost_motion, M_g: 5000, value: 10, tolerance: 1"])
    with pytest.raises(UntrustedError, match=r"could be computed; as the preset has it: .*wind-up") as error:
        calibrate(drive_of(), wild, Evaluations(drive_of(), wild), points=8)
    assert error.value.exit_code == 5


def test_a_trace_names_the_drive_it_was_made_of(tmp_path):
    hidden = drive_of().with_values(HIDDEN)
    (tmp_path / "trace.csv").write_text(csv_text(*trace_csv(trace(hidden, 4.0, revolutions=2, run=UNCHECKED))))
    targets = targets_of(drive_of(), ["quantity: trace, M_g: 4, file: trace.csv, tolerance: 0.1"], folder=str(tmp_path))
    quantities = TargetQuantities(hidden, REPORTING)
    (target,) = targets.targets
    assert quantities.predict(target) == pytest.approx(np.zeros(124), abs=1e-6)
    found = calibrate(drive_of(), targets, Evaluations(drive_of(), targets, Run(seed=2)), points=48, starts=ONE)
    for value, half, right in zip(found.best.values, found.half_width, HIDDEN.values(), strict=True):
        assert abs(value - right) <= 2 * half


def test_quantities_are_those_of_the_commands(reference):
    quantities = TargetQuantities(reference, SEARCHING)
    head = UNKNOWNS.replace("contact.c_t: {low: 1e-5,", "contact.c_t: {low: 1e-6,")
    asked = [
        "quantity: F_ior, M_g: 80, phase: 180, value: 20.07, tolerance: 0.1",
        "quantity: F_ior, M_g: 800, phase: 0, value: 12.29, tolerance: 0.1",
        "quantity: revolution_range, M_g: 80, phi_g0: 20, value: 20.02, tolerance: 0.01",
        "quantity: torsional_stiffness, from: 80, to: 800, value: 0.76e6, tolerance: 1 %",
        "quantity: self_error, M_g: 800, value: 1.9, tolerance: 0.2",
    ]
    for target in targets_of(reference, asked, head).targets:
        assert np.abs(quantities.residuals(target)).max() <= 1, target.words


def test_stiffnesses_and_lost_motion_are_those_of_the_curve():
    """The data sheet's quantities are read off the curve that `stiffness` draws, whose points change nothing."""
    drive = drive_of("operation.rated=5")
    asked = ["K_1", "K_2, T_1: 1.5, T_2: 4", "K_3", "lost_motion", "lost_motion, M_g: 3"]
    lines = [f"quantity: {words}, value: 1, tolerance: 1" for words in asked]
    quantities = TargetQuantities(drive, SEARCHING)
    found = [quantities.predict(target)[0] for target in targets_of(drive, lines).targets]
    curve, own = stiffness(drive), stiffness(drive, T_1=1.5, T_2=4, run=UNCHECKED)
    lost = 2 * stiffness(drive, T_max=3, run=UNCHECKED).twist_at(3)
    assert found == pytest.approx([curve.weaker(1), own.weaker(2), curve.weaker(3), curve.lost_motion_arcsec, lost])
    assert curve.weaker(1) == min(curve.positive[0].stiffness, curve.negative[0].stiffness)


def test_extremes_over_the_phase_are_those_of_the_curve():
    drive, accuracy = drive_of(), replace(REPORTING, phases=12)
    values = [TargetQuantities(drive, accuracy).F_ior(4.0, phase) for phase in range(0, 360, 12)]
    fine = TargetQuantities(drive, accuracy).scan(4.0)
    assert fine.least <= min(values) + 1e-6
    assert fine.greatest >= max(values) - 1e-6
    assert abs((fine.worst_deg - 12 * np.argmax(values) + 180) % 360 - 180) < 12
    rough = TargetQuantities(drive, SEARCHING).scan(4.0)
    assert rough.least == pytest.approx(fine.least, rel=0.1)
    assert rough.greatest == pytest.approx(fine.greatest, rel=0.1)
