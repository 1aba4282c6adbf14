"""A record with a column of torque is taken for the torque that is asked for, or refused there."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest

from hdassist.features.measuring.measure import Measurement, measure
from hdassist.features.measuring.slopes import at_torque
from hdassist.readers.trace import read_trace
from hdassist.run.errors import DataError
from tests.helpers.process import SMALL, run
from tests.helpers.rigs import text

RATIO, PER_TURN = 30, 60
ONCE = np.arange(RATIO * PER_TURN) / PER_TURN


def curve(turns: np.ndarray, torque: np.ndarray | float) -> np.ndarray:
    """Error [arcsec] of a made-up drive that falls with the torque [N*m]."""
    size = 12 - np.abs(torque) / 5
    return size * np.cos(4 * np.pi * turns) + 2 * np.cos(2 * np.pi * turns * (1 + 1 / RATIO) + 1)


def true(torque: float) -> float:
    fine = np.arange(RATIO * 240) / 240
    return float(np.ptp(curve(fine, torque)))


def record(turns: np.ndarray, torque: np.ndarray, seed: int = 5) -> str:
    rng = np.random.default_rng(seed)
    error = curve(turns, torque) + 0.4 * torque + 0.3 * rng.standard_normal(len(turns))
    read = torque + 0.1 * rng.standard_normal(len(turns))
    return text([360 * turns, error, read], "cam_deg;error_arcsec;torque [N·m]", ";")


def at(words: str, M_g: float | None) -> Measurement:
    return measure(read_trace(io.StringIO(words)), ratio=RATIO, M_g=M_g)


def sweeps(seed: int) -> str:
    return record(np.tile(ONCE, 3), np.repeat([10.0, 20.0, 30.0], len(ONCE)), seed)


SWEEPS = sweeps(5)


@pytest.mark.thorough
@pytest.mark.parametrize("M_g", [10.0, -30.0, 30.3, 25.0])
def test_the_value_is_that_of_the_torque_asked(M_g: float):
    held = 0
    for seed in range(5):
        (found,) = at(sweeps(seed), M_g).directions
        held += abs(found.range.value - true(M_g)) <= 2 * found.uncertainty_arcsec
        order = next(each for each in found.orders_of_cam if each.per_cam_rev == pytest.approx(2, abs=0.01))
        assert order.amplitude_arcsec == pytest.approx(12 - abs(M_g) / 5, abs=0.2)
        assert 2 * found.uncertainty_arcsec < abs(true(M_g) - true(20.0))
    assert held >= 4


@pytest.mark.thorough
def test_a_record_without_the_column_stays_as_it_was():
    plain = "\n".join(line.rpartition(";")[0] for line in SWEEPS.splitlines()) + "\n"
    assert at(plain, 10.0).F_ior_arcsec == at(plain, None).F_ior_arcsec


@pytest.mark.thorough
def test_a_torque_that_the_column_excludes_is_refused():
    with pytest.raises(DataError, match=r"torque column contains 10, 20, 30 N·m, not 800"):
        at(SWEEPS, 800.0)
    wandering = record(ONCE, 20 + 4 * np.sin(ONCE**2 / 9))
    assert at(wandering, 21.0).F_ior_arcsec == at(wandering, None).F_ior_arcsec
    with pytest.raises(DataError, match=r"contains 16.1 to 23.9 N·m, not 40"):
        at(wandering, 40.0)


@pytest.mark.thorough
def test_each_direction_is_taken_by_its_own_torque():
    words = record(np.append(ONCE, ONCE[::-1]), np.repeat([10.0, -30.0], len(ONCE)))
    assert [each.direction for each in at(words, 10.0).directions] == [1]
    assert [each.direction for each in at(words, 30.0).directions] == [-1]
    opposite = record(np.append(ONCE, ONCE[::-1]), np.repeat([10.0, -10.0], len(ONCE)))
    assert {each.direction for each in at(opposite, 10.0).directions} == {1, -1}


@pytest.mark.thorough
def test_two_torques_tell_no_value_between_without_a_warning():
    words = record(np.tile(ONCE, 2), np.repeat([10.0, 30.0], len(ONCE)))
    assert any("interpolated linearly" in warning for warning in at(words, 20.0).warnings)
    assert not at(words, 10.0).warnings


@pytest.mark.parametrize(
    "command",
    [
        ("accept", SMALL, "--limit", "F_ior@800=99", "--measured", "800=run.csv", "--measured-only"),
        ("mount", SMALL, "h0@800=run.csv"),
        ("compare", SMALL, "run.csv", "--torque", "800"),
        ("compensate", "run.csv", "--ratio", "30", "--torque", "800"),
        ("compensate", SMALL, "run.csv", "--torque", "800"),
    ],
)
def test_commands_refuse_a_record_of_other_torques(command: tuple[str, ...], tmp_path: Path):
    (tmp_path / "run.csv").write_text(SWEEPS)
    found = run(*command, cwd=tmp_path)
    assert found.returncode == 4
    assert "run.csv: the torque column contains 10, 20, 30 N·m, not 800" in found.stderr


BETWEEN = {
    "two sweeps": record(np.tile(ONCE, 2), np.repeat([10.0, 30.0], len(ONCE))),
    "three sweeps": SWEEPS,
    "a jump within a sweep": record(ONCE, np.repeat([10.0, 30.0], len(ONCE) // 2)),
}


@pytest.mark.thorough
@pytest.mark.parametrize("words", BETWEEN.values(), ids=BETWEEN)
@pytest.mark.parametrize("limit", [1, 99])
def test_a_torque_between_two_recorded_ones_neither_passes_nor_fails(words: str, limit: int, tmp_path: Path):
    """A straight line from one to the other may miss a bend by any size."""
    (tmp_path / "run.csv").write_text(words)
    asked = ("--limit", f"F_ior@15={limit}", "--measured", "15=run.csv", "--measured-only", "--json")
    budget = ("--budget", "encoder=0,coupling=0,reseating=0,temperature=0")
    found = run("accept", SMALL, *asked, *budget, cwd=tmp_path)
    assert found.returncode == 6
    answer = json.loads(found.stdout)
    (check,) = answer["checks"]
    assert check["verdict"] == "INCONCLUSIVE"
    assert check["extent"] == "between torques"
    assert check.get("value") is None
    assert answer["measured"][0]["is_between_torques"]


@pytest.mark.thorough
@pytest.mark.parametrize(
    "command",
    [
        ("mount", SMALL, "h0@15=run.csv"),
        ("compare", SMALL, "run.csv", "--torque", "15"),
        ("compensate", "run.csv", "--ratio", "30", "--torque", "15"),
        ("compensate", SMALL, "run.csv", "--torque", "15"),
    ],
)
def test_commands_ask_for_a_record_at_a_torque_between(command: tuple[str, ...], tmp_path: Path):
    (tmp_path / "run.csv").write_text(SWEEPS)
    found = run(*command, cwd=tmp_path)
    assert found.returncode == 4
    assert "record a sweep at 15 N·m" in found.stderr


def test_a_torque_that_changes_steadily_has_all_between():
    wandering = read_trace(io.StringIO(record(ONCE, 20 + 4 * np.sin(ONCE**2 / 9))))
    assert not at_torque(wandering, 21.0).is_between_torques
