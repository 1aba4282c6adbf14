"""Settings of controllers that compensate backlash only, played by an axis with backlash as their manuals have it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hdassist.features.correction.backlash import BACKLASH_FORMATS
from tests.helpers.process import run

BACKLASH_ARCSEC, PERIODIC_ARCSEC = 12.0, 20.0
Compensation = Callable[[str, np.ndarray], np.ndarray]


def recording(folder: Path, *, both: bool = True, backlash_arcsec: float = BACKLASH_ARCSEC) -> None:
    """Write a recording of the full cycle at ratio 100, there and back, whose output lags in each direction."""
    cam = np.arange(0, 100 * 360 + 1e-9, 7.2)
    noise = np.random.default_rng(1).normal(0, 0.3, (2, len(cam)))
    rows = []
    for way, scatter in zip((1, -1) if both else (1,), noise, strict=False):
        angles = cam[::way]
        error = PERIODIC_ARCSEC * np.sin(np.radians(2 * angles)) - way * backlash_arcsec / 2 + scatter
        rows += [f"{angle:.3f},{angle / 100 + off / 3600:.8f}" for angle, off in zip(angles, error, strict=True)]
    (folder / "both.csv").write_text("\n".join(["cam_deg,output_deg", *rows, ""]))


def written(folder: Path, controller: str, axis: str) -> str:
    """Return the file of a controller for the recording."""
    asked = ("compensate", "both.csv", "--ratio", "100", "--torque", "10", "--write", f"{controller}=out.txt")
    done = run(*asked, "--axis", axis, "-q", cwd=folder)
    assert done.returncode == 0, done.stderr
    return (folder / "out.txt").read_text()


def setting(text: str, comment: str = ";") -> str:
    """Return the only line of a file that is no comment."""
    (line,) = (line for line in text.splitlines() if not line.startswith(comment))
    return line


def output_of(motor_deg: np.ndarray, backlash_deg: float) -> np.ndarray:
    """Return the output that a motor drags along within its backlash, from the middle on."""
    positions, output = [], float(motor_deg[0])
    for angle in motor_deg.tolist():
        output = min(max(output, angle - backlash_deg / 2), angle + backlash_deg / 2)
        positions.append(output)
    return np.array(positions)


def duet(text: str, commanded_deg: np.ndarray) -> np.ndarray:
    """M425: the steps of the backlash are inserted over S times the backlash after the motor has reversed."""
    match = re.fullmatch(r"M425 A([0-9.]+) S([0-9]+)", setting(text))
    assert match is not None
    return motor_of(commanded_deg, float(match[1]), float(match[2]))


def grblhal(text: str, commanded_deg: np.ndarray) -> np.ndarray:
    """$160 and following: a motion of the backlash goes before the first one in the other direction; A is 163."""
    match = re.fullmatch(r"\$163=([0-9.]+)", setting(text))
    assert match is not None
    return motor_of(commanded_deg, float(match[1]))


def heidenhain(text: str, commanded_deg: np.ndarray) -> np.ndarray:
    """MP710: added to the signal of the encoder, or taken off it, after a reversal; up to 1 deg, in steps of 0.0001."""
    match = re.fullmatch(r"MP710\.4 ([+-]\d\.\d{4})", setting(text))
    assert match is not None
    assert abs(float(match[1])) <= 1
    return motor_of(commanded_deg, float(match[1]))


def motor_of(commanded_deg: np.ndarray, backlash_deg: float, distance: float = 0.0) -> np.ndarray:
    """Return where a motor stands that goes on by the backlash after a reversal, within so many times the backlash."""
    steps = np.diff(commanded_deg, prepend=commanded_deg[0] - 1)
    extra_deg, motor = backlash_deg / 2, []
    for position, step in zip(commanded_deg.tolist(), steps.tolist(), strict=True):
        aim = np.sign(step) * backlash_deg / 2
        reach = abs(step) / distance if distance else np.inf
        extra_deg += min(max(aim - extra_deg, -reach), reach)
        motor.append(position + extra_deg)
    return np.array(motor)


THERE_AND_BACK = np.concatenate([np.linspace(0, 10, 4001), np.linspace(10, 0, 4001)[1:]])
SETTLED = slice(400, 4000), slice(5000, 7600)  # of the way there, and of that back, beyond the distance of Duet


def reversal_arcsec(motor_deg: np.ndarray) -> float:
    """Return how far apart an axis with the backlash of the recording stands on its ways there and back."""
    off = output_of(motor_deg, BACKLASH_ARCSEC / 3600) - THERE_AND_BACK
    forward, backward = (float(off[way].mean()) for way in SETTLED)
    return (forward - backward) * 3600


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("controller", "axis", "played"), [("duet", "a", duet), ("grblhal", "A", grblhal), ("heidenhain", "4", heidenhain)]
)
def test_a_setting_takes_the_backlash_off(controller: str, axis: str, played: Compensation, tmp_path: Path) -> None:
    recording(tmp_path)
    text = written(tmp_path, controller, axis)
    assert reversal_arcsec(THERE_AND_BACK) == pytest.approx(-BACKLASH_ARCSEC, rel=1e-6)
    assert abs(reversal_arcsec(played(text, THERE_AND_BACK))) < 0.2
    flipped = 2 * THERE_AND_BACK - played(text, THERE_AND_BACK)
    assert reversal_arcsec(flipped) == pytest.approx(-2 * BACKLASH_ARCSEC, abs=0.2)


@pytest.mark.thorough
def test_a_file_states_what_stays(tmp_path: Path) -> None:
    recording(tmp_path)
    text = written(tmp_path, "duet", "A")
    assert "arcsec (k = 2)" in text
    assert "not compensated" in text
    assert "both.csv, sha256" in text


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("write", "options", "code"),
    [
        ("fluidnc=out.txt", (), 2),
        ("grbl=out.txt", (), 2),
        ("duet=out.txt", ("--zero", "3"), 2),
        ("duet=out.txt", ("--clockwise",), 2),
        ("duet=out.txt", ("--axis", "12"), 2),
        ("grblhal=out.txt", ("--axis", "U"), 2),
        ("heidenhain=out.txt", ("--axis", "C"), 2),
        ("duet=", (), 2),
    ],
)
def test_what_a_controller_does_not_take_is_refused(
    write: str, options: tuple[str, ...], code: int, tmp_path: Path
) -> None:
    recording(tmp_path)
    asked = ("compensate", "both.csv", "--ratio", "100", "--torque", "10", "--write", write)
    done = run(*asked, *options, cwd=tmp_path)
    assert done.returncode == code
    assert not (tmp_path / "out.txt").exists()


@pytest.mark.thorough
@pytest.mark.parametrize(("how", "code"), [({"both": False}, 4), ({"backlash_arcsec": 0.0}, 5)])
def test_a_recording_without_a_clear_backlash_is_refused(how: dict[str, float], code: int, tmp_path: Path) -> None:
    recording(tmp_path, **how)
    asked = ("compensate", "both.csv", "--ratio", "100", "--torque", "10", "--write", "duet=out.txt", "--axis", "A")
    assert run(*asked, cwd=tmp_path).returncode == code
    assert not (tmp_path / "out.txt").exists()


def test_a_preset_has_no_measured_backlash(tmp_path: Path) -> None:
    done = run("compensate", "vzp160", "--draws", "0", "--write", "duet=out.txt", cwd=tmp_path)
    assert done.returncode == 2


@pytest.mark.parametrize("name", BACKLASH_FORMATS)
def test_table_for_a_backlash_only_controller_is_refused_with_reason(name: str, tmp_path: Path) -> None:
    done = run("compensate", "vzp160", "--draws", "0", "--write", f"{name}=out.txt", "--form", "output", cwd=tmp_path)
    assert done.returncode == 2
    assert BACKLASH_FORMATS[name].why_no_table in done.stderr
    assert not (tmp_path / "out.txt").exists()
