"""A torque that changes along a record: its wind-up is none of the drive's error."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from scipy.signal import lfilter

from hdassist.drive.loading import load_preset
from hdassist.drive.preset.fields import Drive
from hdassist.features.measuring.measure import Measurement, measure
from hdassist.readers.trace import read_trace
from hdassist.run.errors import UntrustedError
from tests.helpers.process import run
from tests.helpers.rigs import text

TURNS = np.arange(100 * 40) / 40
ERROR = 10 * np.cos(4 * np.pi * TURNS) + 3 * np.cos(2 * np.pi * 2.01 * TURNS) + 2 * np.cos(2 * np.pi * TURNS)
RANGE, STIFFNESS = float(np.ptp(ERROR)), 1e4  # arcsec, N*m/rad
WALKING = 20 + 3 * np.sin(2 * np.pi * TURNS / 7.3) + 2 * np.sin(TURNS**2 / 90)  # N*m
GRAVITY = 20 + 8 * np.sin(2 * np.pi * TURNS / 100)


def file(torque: np.ndarray, sign: float, twist: np.ndarray | None = None, unit: str = "torque [N·m]") -> str:
    noise = 0.3 * np.random.default_rng(4).standard_normal(len(TURNS))
    twist = torque / STIFFNESS * 648000 / np.pi if twist is None else twist
    return text([360 * TURNS, ERROR + sign * twist + noise, torque], f"cam_deg;error_arcsec;{unit}", ";")


def measured(words: str, drive: Drive | None = None) -> Measurement:
    return measure(read_trace(io.StringIO(words), ratio=100), drive=drive, ratio=None if drive else 100)


def drive() -> Drive:
    catalogue = {"K_1": STIFFNESS, "K_2": 2 * STIFFNESS, "K_3": 3 * STIFFNESS, "T_1": 15, "T_2": 22}
    return load_preset("size-17-100", [f"catalogue.{name}={value}" for name, value in catalogue.items()])


@pytest.mark.thorough
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_wind_up_that_the_record_tells_is_fitted(sign: float):
    result = measured(file(WALKING, sign))
    low, high = result.directions[0].interval_arcsec
    assert low < RANGE < high < RANGE + 2
    torque = result.torque
    assert torque is not None
    assert torque.stiffness_Nm_rad is not None
    assert (torque.by, torque.mean_Nm) == ("record", pytest.approx(WALKING.mean()))
    value, unsure = torque.stiffness_Nm_rad
    assert abs(value - STIFFNESS) < 3 * unsure < 0.01 * STIFFNESS
    # a trace without its column of torque has the wind-up as error of the drive
    bare = "\n".join(line.rpartition(";")[0] for line in file(WALKING, sign).splitlines())
    with pytest.raises(UntrustedError, match="does not exceed its noise"):
        measured(bare)


@pytest.mark.thorough
def test_wind_up_that_follows_the_output_needs_catalogue_stiffness():
    left = measured(file(GRAVITY, 1.0))
    assert left.F_ior_arcsec > 5 * RANGE
    assert any("the torque varies with the output angle" in warning for warning in left.warnings)
    beyond = np.maximum(GRAVITY - 22, 0)
    twist = (15 + (np.minimum(GRAVITY, 22) - 15) / 2 + beyond / 3) / STIFFNESS * 648000 / np.pi
    twist[GRAVITY < 15] = (GRAVITY / STIFFNESS * 648000 / np.pi)[GRAVITY < 15]
    for sign in (1.0, -1.0):
        result = measured(file(GRAVITY, sign, twist), drive())
        assert result.torque is not None
        assert result.torque.by == "catalogue"
        assert result.F_ior_arcsec == pytest.approx(RANGE, abs=1)
        source = {each.name: each.arcsec for each in result.directions[0].sources}
        assert source["wind-up"] == pytest.approx(0.1 * np.ptp(twist), rel=0.01)


@pytest.mark.thorough
def test_the_record_goes_before_the_catalogue():
    result = measured(file(WALKING, -1.0), drive())
    assert result.torque is not None
    assert result.torque.by == "record"
    assert result.torque.stiffness_Nm_rad is not None
    assert result.torque.stiffness_Nm_rad[0] == pytest.approx(STIFFNESS, rel=0.01)


def read_noisily(torque: np.ndarray, noise: np.ndarray, stiffness: float = np.inf) -> Measurement:
    """A record whose torque is read with noise, of which the true one winds the drive up."""
    return measured(file(torque + noise, 1.0, (torque - torque.mean()) / stiffness * 648000 / np.pi))


def low_passed(white: np.ndarray) -> np.ndarray:
    return np.asarray(lfilter([0.44], [1.0, -0.9], white))


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["white", "coloured", "counts"])
@pytest.mark.parametrize("mean", [0.0, 20.0])
def test_a_steady_torque_that_is_read_noisily_has_no_stiffness(kind: str, mean: float):
    for seed in range(3):
        white = np.random.default_rng([9, seed]).standard_normal(len(TURNS))
        noise = {"white": 0.5 * white, "coloured": 0.5 * low_passed(white), "counts": np.round(0.5 * white) / 10}[kind]
        result = read_noisily(np.full(len(TURNS), mean), noise)
        assert result.torque is not None
        assert (result.torque.by, result.torque.stiffness_Nm_rad) == ("", None)
        assert not result.warnings
        assert result.F_ior_arcsec == pytest.approx(RANGE, abs=0.4)


@pytest.mark.thorough
def test_noisy_torque_is_no_line_and_widens_the_stiffness():
    """Its noise makes the slope too small: the rest of the wind-up was fitted as a line, and then all of it."""
    waving = 20 + 0.3 * np.sin(2 * np.pi * TURNS / 7.3)
    for seed in range(3):
        noise = 0.1 * np.random.default_rng([9, seed]).standard_normal(len(TURNS))
        result = read_noisily(waving, noise, STIFFNESS)
        low, high = result.directions[0].interval_arcsec
        assert low < RANGE < high
        assert result.torque is not None
        assert result.torque.stiffness_Nm_rad is not None
        value, unsure = result.torque.stiffness_Nm_rad
        assert abs(value - STIFFNESS) < 2 * unsure < 0.6 * STIFFNESS


@pytest.mark.thorough
@pytest.mark.parametrize(("unit", "size"), [("M (mN·m)", 1e3), ("Moment/kNm", 1e-3), ("torque_Nm", 1.0)])
def test_a_constant_torque_is_told_and_changes_nothing(unit: str, size: float, tmp_path):
    columns = [360 * TURNS, ERROR, np.full(len(TURNS), 20.0 * size)]
    (tmp_path / "run.csv").write_text(text(columns, f"cam_deg;error_arcsec;torque {unit}", ";"))
    told = json.loads(run("measure", "run.csv", "--ratio", "100", "--json", cwd=tmp_path).stdout)
    assert told["torque"]["mean_Nm"] == pytest.approx(20)
    assert told["torque"]["by"] == ""
    assert told["F_ior_arcsec"] == pytest.approx(RANGE, abs=0.2)
    assert "torque    mean 20 N·m, 20 to 20 N·m\n" in run("measure", "run.csv", "--ratio", "100", cwd=tmp_path).stdout


RATIO, PER_TURN, MIDDLE = 30, 60, 20.0  # a small drive, whose orders change with the torque


def loaded(turns: np.ndarray, torque: np.ndarray | float, slope: float, bend: float, phase: np.ndarray) -> np.ndarray:
    """Error [arcsec] of a made-up drive at torques [N·m]: order 2 with a beat, order 1, once an output turn."""
    away, cam = (torque - MIDDLE) / 10, 2 * np.pi * turns
    oval = (10 + slope * away + bend * away**2) * np.cos(2 * cam + phase[0])
    beat = 1 + 0.2 * np.cos(cam / RATIO + phase[3])
    return oval * beat + 3 * np.cos(cam + phase[1] + 0.3 * away) + 2 * np.cos(cam / RATIO + phase[2])


def rig(seed: int, turns: np.ndarray, torque: np.ndarray, slope: float, bend: float, winds: bool = True):
    """A record of that drive, and its true F'_ior at a torque, or along torques, over the cycle."""
    rng = np.random.default_rng(seed)
    phase, fine = rng.uniform(0, 2 * np.pi, 4), np.arange(RATIO * 240) / 240
    error = loaded(turns, torque, slope, bend, phase) + 0.5 * rng.standard_normal(len(turns))
    error += winds * torque / STIFFNESS * 648000 / np.pi
    read = torque + 0.1 * rng.standard_normal(len(turns))
    words = text([360 * turns, error, read], "cam_deg;error_arcsec;torque [N·m]", ";")
    result = measure(read_trace(io.StringIO(words)), ratio=RATIO)
    return result, lambda at: float(np.ptp(loaded(fine, at(fine) if callable(at) else at, slope, bend, phase)))


ONCE = np.arange(RATIO * PER_TURN) / PER_TURN


@pytest.mark.thorough
@pytest.mark.parametrize("bend", [0.0, 2.0])
def test_sweeps_give_the_error_and_linear_misfit_at_several_torques(bend: float):
    """At twice the uncertainty; of a parabola lines between three torques miss a quarter of its bend."""
    held = []
    for seed in range(4):
        turns, torque = np.tile(ONCE, 3), np.repeat([10.0, 20.0, 30.0], len(ONCE))
        result, true = rig(seed, turns, torque, 2.0, bend)
        (found,) = result.directions
        assert not result.warnings  # the wind-up is in the levels of the sweeps
        assert [each.M_g_Nm for each in found.torques] == pytest.approx([10, 20, 30], abs=0.2)
        assert found.torques[1].F_ior_arcsec == pytest.approx(found.range.value)
        held += [
            abs(each.F_ior_arcsec - true(each.M_g_Nm)) <= 2 * each.standard_uncertainty_arcsec for each in found.torques
        ]
        assert found.torque_miss_arcsec is not None
        between = (found.torques[1].F_ior_arcsec + found.torques[2].F_ior_arcsec) / 2
        assert abs(between - true(25.0)) < found.torque_miss_arcsec + found.torques[2].standard_uncertainty_arcsec
    assert sum(held) >= 11


@pytest.mark.thorough
@pytest.mark.parametrize("bend", [0.0, 2.0, -2.0])
def test_two_torques_leave_the_error_between_them_open(bend: float):
    turns, torque = np.tile(ONCE, 2), np.repeat([10.0, 30.0], len(ONCE))
    result, true = rig(1, turns, torque, 4.0, bend)
    (found,) = result.directions
    assert found.torque_miss_arcsec is None
    low, middle, high = found.torques
    assert low.standard_uncertainty_arcsec + high.standard_uncertainty_arcsec < middle.standard_uncertainty_arcsec / 4
    assert found.range.interval[0] <= true(middle.M_g_Nm) <= found.range.interval[1]
    (bridge,) = (source.arcsec for source in found.sources if source.name == "between torques")
    # an error anywhere between two curves has this standard deviation from their mean
    fit = found.fit
    change = np.ptp(fit.at_torque(30.0).curve(turns) - fit.at_torque(10.0).curve(turns))
    assert bridge == pytest.approx(change / np.sqrt(12), rel=0.02)
    for each in (found.torques[0], found.torques[-1]):
        assert abs(each.F_ior_arcsec - true(each.M_g_Nm)) <= 3 * each.standard_uncertainty_arcsec


@pytest.mark.thorough
def test_interval_covers_the_error_along_a_varying_gravity_torque():
    def gravity(turns: np.ndarray) -> np.ndarray:
        return MIDDLE + 10 * np.cos(2 * np.pi * turns / RATIO + 0.4)

    held = []
    for seed in range(4):
        result, true = rig(seed, ONCE, gravity(ONCE), 2.0, 1.0, winds=False)
        (found,) = result.directions
        assert not found.torques
        low, high = found.interval_arcsec
        held.append(low <= true(gravity) <= high)
    assert sum(held) >= 3


@pytest.mark.thorough
def test_recording_that_cannot_resolve_the_effect_of_torque_is_reported():
    torque = MIDDLE + 6 * np.sin(2 * np.pi * ONCE / 7.3) + 4 * np.sin(ONCE**2 / 9)
    result, _ = rig(0, ONCE, torque, 2.0, 0.0)
    assert any("record a sweep at each torque" in warning for warning in result.warnings)


@pytest.mark.thorough
def test_error_at_several_torques_is_on_page_and_json(tmp_path):
    turns, torque = np.tile(ONCE, 2), np.repeat([10.0, 30.0], len(ONCE))
    error = loaded(turns, torque, 2.0, 0.0, np.arange(4.0)) + 0.1 * np.sin(turns**2)
    (tmp_path / "run.csv").write_text(text([360 * turns, error, torque], "cam_deg;error_arcsec;torque [N·m]", ";"))
    page = run("measure", "run.csv", "--ratio", "30", cwd=tmp_path).stdout
    assert "″ at 10 N·m, " in page
    (direction,) = json.loads(run("measure", "run.csv", "--ratio", "30", "--json", cwd=tmp_path).stdout)["directions"]
    assert [each["M_g_Nm"] for each in direction["torques"]] == pytest.approx([10, 20, 30], abs=0.01)
