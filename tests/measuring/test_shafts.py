"""Components of stated shafts: their size, or why a recording does not determine them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hdassist.features.measuring.shafts import parse_shafts
from hdassist.run.errors import UsageError
from tests.helpers.process import run
from tests.helpers.rigs import text

PERIOD_S = 861.64  # of an input revolution: ratio 100 at 15.041 arcsec/s
SECONDS = np.arange(0, 10 * PERIOD_S, 5.0)
BELT_S, MOTOR_S = 257.0, 70.3
AMPLITUDE, PHASE_DEG = {"belt": 6.0, "motor": 2.5}, {"belt": 40.0, "motor": -57.0}


def wave(name: str, period_s: float) -> np.ndarray:
    return AMPLITUDE[name] * np.cos(2 * np.pi * SECONDS / period_s + np.radians(PHASE_DEG[name]))


def error_arcsec(noise: float = 0.5) -> np.ndarray:
    drawn = np.random.default_rng(5).standard_normal(len(SECONDS))
    order_2 = 20 * np.sin(4 * np.pi * SECONDS / PERIOD_S)
    return order_2 + wave("belt", BELT_S) + wave("motor", MOTOR_S) + noise * drawn


def answer(folder: Path, shafts: str, *options: str) -> dict[str, Any]:
    """The JSON of `measure` of the recording over time, with stated shafts."""
    (folder / "mount.csv").write_text(text([SECONDS, error_arcsec()], "time_s,error_arcsec", digits=4))
    done = run("measure", "mount.csv", "--ratio", "100", "--shafts", shafts, *options, "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def components(folder: Path, shafts: str, *options: str) -> dict[str, dict[str, Any]]:
    found = answer(folder, shafts, *(options or ("--speed", "15.041")))
    return {each["shaft"]: each for each in found["directions"][0]["shafts"]}


@pytest.mark.parametrize("pace", [("--speed", "15.041"), ("--period", "861.64")])
@pytest.mark.parametrize(
    "shafts", ["belt=257s,motor=70.3s", f"belt={PERIOD_S / BELT_S}/input,motor={100 * PERIOD_S / MOTOR_S}/output"]
)
def test_components_have_the_size_and_phase_of_their_shafts(shafts: str, pace: tuple[str, str], tmp_path: Path) -> None:
    found = components(tmp_path, shafts, *pace)
    for name, period in (("belt", BELT_S), ("motor", MOTOR_S)):
        own = found[name]
        assert own["missing"] is None
        assert own["period_s"] == pytest.approx(period, rel=1e-3)
        assert abs(own["amplitude_arcsec"] - AMPLITUDE[name]) < 4 * own["amplitude_uncertainty_arcsec"]
        assert 0 < own["amplitude_uncertainty_arcsec"] < 0.1
        assert own["phase_deg"] == pytest.approx(PHASE_DEG[name], abs=2)


def test_a_shaft_without_a_component_has_none_beyond_its_uncertainty(tmp_path: Path) -> None:
    own = components(tmp_path, "fan=151s")["fan"]
    assert own["amplitude_arcsec"] < 4 * own["amplitude_uncertainty_arcsec"] < 0.2
    assert own["measured_per_cam_rev"] is None


def test_f_ior_does_not_depend_on_stated_shafts(tmp_path: Path) -> None:
    both, none = (answer(tmp_path, shafts, "--speed", "15.041") for shafts in ("belt=257s", "fan=151s"))
    assert both["F_ior_arcsec"] == none["F_ior_arcsec"]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("shaft", "reason"),
    [
        ("near=288s", "order 3"),
        ("whole=4/input", "order 4"),
        ("beside=4.1/input", "order 4"),
        ("slow=1h", "slow terms"),
        ("fast=8s", "readings resolve"),
        ("belt=257s,twin=258s", "belt"),
    ],
)
def test_unresolved_shaft_component_has_a_reason_and_no_number(shaft: str, reason: str, tmp_path: Path) -> None:
    own = list(components(tmp_path, shaft).values())[-1]
    assert own["amplitude_arcsec"] is own["phase_deg"] is None
    assert reason in own["missing"]


def test_each_direction_has_its_components(tmp_path: Path) -> None:
    turns = np.arange(0, 12, 1 / 60)
    turns = np.concatenate([turns, turns[::-1]])
    noise = 0.1 * np.random.default_rng(1).standard_normal(len(turns))
    error = 20 * np.sin(4 * np.pi * turns) + 6 * np.cos(2 * np.pi * 3.35 * turns) + noise
    (tmp_path / "run.csv").write_text(text([360 * turns, error], "cam_deg,error_arcsec", digits=6))
    asked = ("measure", "run.csv", "--ratio", "100", "--shafts", "motor=3.35/input", "--json")
    found = json.loads(run(*asked, cwd=tmp_path).stdout)["directions"]
    assert len(found) == 2
    for direction in found:
        assert direction["shafts"][0]["amplitude_arcsec"] == pytest.approx(6, abs=0.1)
        assert direction["shafts"][0]["period_s"] is None


def test_a_motor_far_above_the_orders_keeps_its_amplitude(tmp_path: Path) -> None:
    turns = np.arange(0, 6, 1 / 2000)
    noise = 0.2 * np.random.default_rng(1).standard_normal(len(turns))
    error = 20 * np.sin(4 * np.pi * turns) + 4 * np.cos(2 * np.pi * 73.3 * turns) + noise
    (tmp_path / "run.csv").write_text(text([360 * turns, error], "cam_deg,error_arcsec", digits=6))
    asked = ("measure", "run.csv", "--ratio", "100", "--shafts", "motor=73.3/input", "--json")
    own = json.loads(run(*asked, cwd=tmp_path).stdout)["directions"][0]["shafts"][0]
    assert abs(own["amplitude_arcsec"] - 4) < 0.06


def timed(path: Path, uneven: float) -> None:
    """Write a recording with time stamps, whose input speed varies by a share."""
    time = np.arange(0, 600, 0.5)
    turns = time / 40 + uneven * np.sin(2 * np.pi * time / 300)
    error = 20 * np.sin(4 * np.pi * turns) + 6 * np.cos(2 * np.pi * time / 12)
    path.write_text(text([time, 360 * turns, error], "time_s,cam_deg,error_arcsec", digits=6))


@pytest.mark.thorough
def test_time_stamps_give_the_speed_and_varying_speed_is_refused(tmp_path: Path) -> None:
    timed(tmp_path / "even.csv", 0.0)
    timed(tmp_path / "uneven.csv", 0.5)
    asked = ("--ratio", "100", "--shafts", "motor=12s", "--json")
    own = json.loads(run("measure", "even.csv", *asked, cwd=tmp_path).stdout)["directions"][0]["shafts"][0]
    assert own["per_cam_rev"] == pytest.approx(40 / 12)
    assert own["amplitude_arcsec"] == pytest.approx(6, abs=0.05)
    refused = run("measure", "uneven.csv", *asked, cwd=tmp_path)
    assert refused.returncode == 4
    assert "speed varies" in refused.stderr


def test_what_is_stated_is_used_or_refused(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(
        text([np.arange(0, 3600, 6.0), np.sin(np.arange(600) / 5)], "cam_deg,error_arcsec")
    )
    (tmp_path / "positions.csv").write_text("target_deg,deviation_arcsec,side\n0,1,1\n90,2,1\n180,3,1\n")
    no_time = run("measure", "run.csv", "--shafts", "motor=12s", cwd=tmp_path)
    no_ratio = run("measure", "run.csv", "--shafts", "pulley=5/output", cwd=tmp_path)
    no_trace = run("measure", "positions.csv", "--shafts", "motor=12/input", cwd=tmp_path)
    assert (no_time.returncode, no_ratio.returncode, no_trace.returncode) == (4, 2, 2)


@pytest.mark.parametrize(
    "wrong", ["belt", "belt=", "belt=3", "=3s", "belt=0s", "belt=-3s", "belt=3m", "belt=3/cam", "a=3s,", "a=3s,a=4s"]
)
def test_a_text_that_is_no_shaft_is_refused(wrong: str) -> None:
    with pytest.raises(UsageError):
        parse_shafts(wrong)
