"""Logs with the column names of EPICS, Bluesky and moteus, and the units that these names stand for."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hdassist.readers.words import is_of_moteus, moteus_unit_of, role_in
from tests.helpers.process import run
from tests.helpers.rigs import text

CAM_DEG = np.arange(0, 100 * 360, 7.2)
OUTPUT_DEG = CAM_DEG / 100 + 20 * np.sin(np.radians(2 * CAM_DEG)) / 3600
TIME_S = np.arange(len(CAM_DEG)) / 10


def measured(folder: Path, columns: list[np.ndarray], names: str, *options: str) -> dict[str, Any]:
    """The JSON of `measure` of a log."""
    (folder / "log.csv").write_text(text(columns, names, digits=9))
    done = run("measure", "log.csv", *options, "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


POSITIONS_DEG = np.repeat(np.arange(0, 360, 30.0), 5)
DEVIATIONS_ARCSEC = 12 * np.sin(POSITIONS_DEG / 20) + np.random.default_rng(3).normal(0, 0.8, len(POSITIONS_DEG))


@pytest.mark.parametrize(
    "names",
    [
        "timestamp,SR:rot:motor1.VAL,SR:rot:motor1.RBV",
        "time,rot_user_setpoint,rot_readback",
        "time,m1.DVAL,m1.DRBV [deg]",
    ],
)
def test_set_points_and_readbacks_are_approached_positions(names: str, tmp_path: Path) -> None:
    reached_deg = POSITIONS_DEG + DEVIATIONS_ARCSEC / 3600
    log = measured(tmp_path, [np.arange(60.0), POSITIONS_DEG, reached_deg], names)
    plain = measured(tmp_path, [POSITIONS_DEG, DEVIATIONS_ARCSEC], "target_deg,deviation_arcsec")
    assert log["quantities"][0]["value_arcsec"] == pytest.approx(plain["quantities"][0]["value_arcsec"], abs=1e-3)


@pytest.mark.thorough
def test_epics_pulses_and_counts_need_their_number_per_revolution(tmp_path: Path) -> None:
    columns = [TIME_S, np.rint(CAM_DEG / 360 * 51200), np.rint(OUTPUT_DEG / 360 * 2**26)]
    names = "timestamp,SR:rot:m1.RMP,SR:rot:m1.REP"
    answer = measured(tmp_path, columns, names, "--ratio", "100", "--angle-unit", "51200,26bit")
    assert answer["F_ior_arcsec"] == pytest.approx(40, abs=0.1)
    refused = run("measure", "log.csv", "--ratio", "100", cwd=tmp_path)
    assert refused.returncode == 4
    assert "--angle-unit" in refused.stderr


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("names", "options"),
    [
        ("TIME,POSITION,TORQUE,ENCODER_1_POSITION", ("--angle", "POSITION", "--second", "ENCODER_1_POSITION")),
        (
            "timestamp,servo_stats.position,servo_stats.torque_Nm,servo_stats.unwrapped_position",
            ("--angle", "servo_stats.position", "--second", "servo_stats.unwrapped_position"),
        ),
    ],
)
def test_positions_of_moteus_are_revolutions(names: str, options: tuple[str, ...], tmp_path: Path) -> None:
    columns = [TIME_S, CAM_DEG / 360, np.full(len(TIME_S), 0.2), OUTPUT_DEG / 360]
    answer = measured(tmp_path, columns, names, "--ratio", "100", *options)
    assert answer["F_ior_arcsec"] == pytest.approx(40, abs=0.1)
    assert any("turn" in note for note in answer["notes"])


def test_a_torque_loop_of_moteus_is_read_in_revolutions(tmp_path: Path) -> None:
    phase = np.linspace(0, 6.5 * np.pi, 1500)
    torque = 20 * np.sin(phase)
    twist_deg = torque / 200 - 0.02 * np.sign(np.gradient(torque))
    own = measured(tmp_path, [phase, twist_deg / 360, torque], "TIME,POSITION,TORQUE")
    plain = measured(tmp_path, [torque, twist_deg], "torque_Nm,twist_deg")
    assert own["quantities"][0]["value_arcsec"] == pytest.approx(plain["quantities"][0]["value_arcsec"], rel=1e-3)
    assert own["quantities"][0]["value_arcsec"] > 100


def test_a_recording_of_moteus_with_a_torque_needs_its_columns(tmp_path: Path) -> None:
    columns = [TIME_S, CAM_DEG / 360, np.full(len(CAM_DEG), 0.2), OUTPUT_DEG / 360]
    (tmp_path / "log.csv").write_text(text(columns, "TIME,POSITION,TORQUE,ENCODER_1_POSITION", digits=9))
    done = run("measure", "log.csv", "--ratio", "100", cwd=tmp_path)
    assert done.returncode == 4
    assert "--angle and --second" in done.stderr


def test_other_names_are_not_those_of_these_programs() -> None:
    assert not is_of_moteus(["time", "position", "torque"])
    assert not is_of_moteus(["POSITION", "ERROR"])
    assert not is_of_moteus(["ENCODER_1_POSITION", "VELOCITY"])  # other robots have such counts
    assert moteus_unit_of("motor_position.sources.1.filtered_value") == "counts"
    assert role_in("interval_arcsec") == ""
    assert role_in("VAL") == ""
