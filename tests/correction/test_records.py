"""Corrections from records: held against the solved cycle of drives that are not as their preset."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.error.cycle import kinematic_error
from hdassist.drive.error.waves import POINTS_A_TURN, error_lines
from hdassist.drive.model.geometry import Kinematics
from hdassist.features.correction.correct import IN_PLACE, correct
from hdassist.features.correction.forms import CorrectionForm
from hdassist.features.correction.records import RecordedError, recorded_error, shrunk, solved_error
from hdassist.features.measuring.measure import measure
from hdassist.features.record_comparison.record import Alignment
from hdassist.run.errors import UntrustedError
from hdassist.run.run import UNCHECKED
from tests.helpers.process import TINY, in_a_line, run
from tests.helpers.rigs import recorded

HIDDEN = ("phases.xi_b=130", "supports.C_2=8.0e3", "gears.j_n=18.7", "harmonics.a_b2=0.5")
NOISE = 0.3  # arcsec
TABLE = CorrectionForm("output", 720, each_load=True)
PHASORS = CorrectionForm(None, each_load=True)


def recording(M_g: float, turns: float = 10.5, begin: int = 0, hidden: tuple[str, ...] = HIDDEN):
    """Cam angles [turns] and errors [arcsec] of a record of the hidden drive, from some turn of its cycle on."""
    drive = load_preset(TINY, hidden)
    lines, (solved, _) = error_lines(drive, M_g, [{}]), solved_error(drive, M_g, UNCHECKED)
    rows = np.arange(round(turns * POINTS_A_TURN)) + begin * POINTS_A_TURN
    beyond = np.interp(rows / POINTS_A_TURN, solved.cam_turns, solved.apart(lines), period=10)
    noise = NOISE * np.random.default_rng(1).standard_normal(len(rows))
    return (rows - rows[0]) / POINTS_A_TURN, np.resize(lines.curves[0], 1 + rows[-1])[rows] + beyond + noise


def record(M_g: float, error_is: str = "cam-output", sign: float = 1.0, **how):
    drive, (turns, error) = load_preset(TINY), recording(M_g, **how)
    trace = recorded(turns, sign * error)
    measurement = measure(trace, drive=drive, together=True)
    return recorded_error(measurement, Kinematics.of(drive), Alignment(sign=-1.0 if error_is == "output-cam" else 1.0))


@pytest.fixture(scope="module")
def both():
    """Correction of the tiny drive from records at both of its torques."""
    return correct(load_preset(TINY), form=TABLE, records={M_g: record(M_g) for M_g in (1.0, 4.0)}, draws=0)


@pytest.mark.parametrize("again", [0, 8])
def test_even_readings_resolve_the_line_at_half_their_rate(again: int):
    """Single teeth may be such a line; from one reading of it to the next its sign changes."""
    kinematics, per_turn = Kinematics.of(load_preset(TINY)), 36
    rows = np.arange(per_turn * kinematics.cycle_cam_revolutions + again)
    error = 2.0 * (-1.0) ** rows + np.cos(2 * np.pi * rows / per_turn)
    lines = RecordedError(rows / per_turn, error).lines(kinematics)
    often = per_turn * kinematics.cycle_cam_revolutions // 2
    assert lines.per_cycle[-1] == often
    assert lines.amplitude[0, -1].real == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("M_g", [1.0, 4.0])
def test_residual_of_another_drive_is_within_the_predicted_residual(both, M_g: float):
    error = kinematic_error(load_preset(TINY, HIDDEN), M_g, run=UNCHECKED)
    lines = both.errors[M_g].lines
    table = TABLE.fitted(lines.mean, M_g)
    left = np.ptp(-error.error_arcsec - table.error_at(error.states.phi_h / (2 * np.pi))[0])
    promised = next(each for each in both.chosen.residuals if each.M_g == M_g)
    assert left <= promised.p95 < 0.5 * error.F_ior_arcsec
    assert promised.uncorrected_p50 == pytest.approx(error.F_ior_arcsec, rel=0.15)


def test_correction_terms_of_a_recording_include_lines_beyond_the_model():
    curve = error_lines(load_preset(TINY, HIDDEN), 1.0, [{}]).curves[0]
    turns = np.arange(len(curve)) / POINTS_A_TURN
    odd = 8 * np.cos(2 * np.pi * 46.3 * turns + 1)  # comes 463 times in the cycle, as no waves of 20 and 22 teeth do
    rows = np.arange(round(1.3 * len(curve)))
    noise = NOISE * np.random.default_rng(1).standard_normal(len(rows))
    trace = recorded(rows / POINTS_A_TURN, (curve + odd)[rows % len(curve)] + noise)
    alone = load_preset(TINY, ["operation.M_g=[1]"])
    read = recorded_error(measure(trace, drive=alone, together=True), Kinematics.of(alone), Alignment())
    found = correct(alone, records={1.0: read}, draws=0)
    left = np.ptp(-(curve + odd) - found.correction.error_at(turns))
    (promised,) = (each for each in found.chosen.residuals if each.case == IN_PLACE)
    assert left < 4  # of 16 by the odd line alone
    assert left <= promised.p95


def test_later_recording_start_gives_the_correction_of_its_angles(both):
    later = correct(load_preset(TINY, ["operation.M_g=[1]"]), form=TABLE, records={1.0: record(1.0, begin=3)}, draws=0)
    turns = np.linspace(0, 10, 101)
    assert later.correction.error_at(turns) == pytest.approx(both.correction.error_at(turns + 3), abs=5 * NOISE)


def test_a_file_with_the_other_sign_gives_the_same_correction(both):
    other = record(1.0, "output-cam", sign=-1.0)
    found = correct(load_preset(TINY), form=TABLE, records={1.0: other}, draws=0)
    assert found.correction.error_arcsec == pytest.approx(both.correction.error_arcsec, abs=1e-3)


def test_a_torque_without_a_record_is_not_promised(both):
    alone = correct(load_preset(TINY), form=TABLE, records={1.0: record(1.0)}, draws=0)
    promised = alone.chosen.residuals[1]
    assert promised.M_g == 4.0
    assert promised.p95 > promised.uncorrected_p50
    assert [*alone.records] == [1.0]


OPEN = ["phases.xi_b=unknown"]
ANOTHER = (
    ("phases.xi_b=290", "supports.C_2=6.6e3", "gears.j_n=18.5"),
    # refused before: one fit from the preset's own supports and clearance ended in a hollow beside it
    (
        "phases.xi_b=349", "supports.C_2=8.5e3", "supports.C_3=2.2e3", "contact.c_t=7.3e-5", "cam.W_0=1.79",
        "gears.j_n=17.2",
    ),
)  # fmt: skip


@pytest.mark.thorough
@pytest.mark.parametrize("hidden", ANOTHER)
def test_three_of_ten_revolutions_suffice_if_the_model_fits(hidden: tuple[str, ...]):
    part = {1.0: record(1.0, turns=3, hidden=hidden)}
    found = correct(load_preset(TINY, OPEN), form=PHASORS, records=part, draws=16)
    form = found.chosen.form
    for promised, M_g in zip(found.chosen.residuals, (1.0, 4.0), strict=False):
        error = kinematic_error(load_preset(TINY, hidden), M_g, run=UNCHECKED)
        lines = found.errors[M_g].lines
        left = np.ptp(-error.error_arcsec - form.fitted(lines.mean, M_g).error_at(error.states.phi_h / (2 * np.pi))[0])
        assert promised.M_g == M_g
        assert left <= promised.p95 < 0.25 * error.F_ior_arcsec


@pytest.mark.thorough
def test_partial_cycle_of_a_drive_outside_the_preset_is_refused():
    oval = {1.0: record(1.0, turns=3, hidden=("phases.xi_b=290", "harmonics.a_b2=3"))}
    with pytest.raises(
        UntrustedError, match=r"no drive within the ranges of tiny reproduces the recording: \d+ % of the error remains"
    ):
        correct(load_preset(TINY, OPEN), records=oval, draws=16)


@pytest.mark.thorough
def test_the_command_takes_records_in_the_order_of_the_torques(tmp_path: Path):
    files = []
    for M_g in (1.0, 4.0):
        turns, error = recording(M_g)
        rows = "".join(f"{360 * x:.3f},{y:.4f}\n" for x, y in zip(turns, error, strict=True))
        files.append(tmp_path / f"run{M_g:g}.csv")
        files[-1].write_text(f"cam_deg,error_arcsec\n{rows}")
    page = run("compensate", TINY, *map(str, files), "--each-load", "--no-plot", "--draws", "8")
    assert page.returncode == 0
    assert "recording at 1, 4 N·m; the correction uses the angles of the recording" in in_a_line(page.stdout)
    found = json.loads(run("compensate", TINY, str(files[0]), "--json", "--draws", "4").stdout)
    assert found["recorded_Nm"] == [1.0]
    many = run("compensate", TINY, *map(str, [*files, files[0]]))
    assert many.returncode == 2
    assert "but tiny has only 2 torques" in many.stderr


@pytest.mark.thorough
def test_mirrored_recording_is_refused_with_the_options_to_read_it(tmp_path: Path):
    turns, error = recording(1.0, hidden=())
    rows = "".join(f"{-360 * x:.3f},{y:.4f}\n" for x, y in zip(turns, error, strict=True))
    (tmp_path / "run.csv").write_text(f"cam_deg,error_arcsec\n{rows}")
    asked = ("compensate", TINY, "run.csv", "--torque", "1", "--no-plot", "--csv", "table.csv", "--draws", "4")
    refused = run(*asked, cwd=tmp_path)
    assert (refused.returncode, refused.stdout) == (5, "")
    assert "run.csv: the mirrored recording agrees clearly better with tiny" in refused.stderr
    assert not (tmp_path / "table.csv").exists()
    assert "--error-is output-cam --cam-sense cw" in refused.stderr
    read = (*asked, "--cam-sense", "cw", "--error-is", "output-cam", "--force")
    assert run(*read, cwd=tmp_path).returncode == 0
    mirrored = "".join(f"{-360 * x:.3f},{-y:.4f}\n" for x, y in zip(turns, error, strict=True))
    (tmp_path / "mirrored.csv").write_text(f"cam_deg,error_arcsec\n{mirrored}")  # all of it counts clockwise
    whole = (*asked[:2], "mirrored.csv", *asked[3:], "--cam-sense", "cw", "--force")
    assert run(*whole, cwd=tmp_path).returncode == 0
    assert "mirrored" in run("compare", TINY, "run.csv", "--torque", "1", "-q", cwd=tmp_path).stdout


@pytest.mark.thorough
def test_page_states_misfit_and_advice_for_a_partial_cycle(tmp_path: Path):
    turns, error = recording(1.0, turns=3, hidden=("phases.xi_b=290",))
    rows = "".join(f"{360 * x:.3f},{y:.4f}\n" for x, y in zip(turns, error, strict=True))
    (tmp_path / "part.csv").write_text(f"cam_deg,error_arcsec\n{rows}")
    page = run("compensate", TINY, "part.csv", "--set", *OPEN, "--draws", "8", "--no-plot", cwd=tmp_path)
    words = in_a_line(page.stdout)
    assert "computed as 0" not in page.stderr
    assert ", including noise of the recording" in words
    assert " of 10 input revolutions at 1 N·m; the correction uses the angles of the preset" in words
    assert "fitted phases.xi_b, supports, contacts, deflection and clearance (docs/correct.md); misfit " in words
    assert "the full mesh cycle, which needs no fit" in words


@pytest.mark.parametrize("count", [1001, 1836])
def test_lines_of_uneven_readings_agree_with_dense_least_squares(count: int):
    lines = error_lines(load_preset(TINY), 1.0, [{}])
    rng = np.random.default_rng(3)
    turns = np.sort((np.arange(count) + 0.2 * rng.random(count)) / 1000 * 10)
    waves = np.exp(2j * np.pi * turns[:, None] * np.arange(1, 120) / 10)
    size = (rng.standard_normal(119) + 1j * rng.standard_normal(119)) / np.arange(1, 120)
    read = RecordedError(turns, (waves @ size).real)
    by_hand = np.linalg.lstsq(np.concatenate([waves.real, -waves.imag], axis=1), read.error_arcsec)[0]
    found = read.lines(lines.kinematics).amplitude[0, :119]
    assert found == pytest.approx(by_hand[:119] + 1j * by_hand[119:], abs=0.01)
    assert np.ptp(read.apart(read.lines(lines.kinematics))) < 0.02 * np.ptp(read.error_arcsec)


def test_shrunk_lines_reduce_the_error_by_the_predicted_amount():
    rng = np.random.default_rng(4)
    size = np.concatenate([np.zeros(600), np.full(300, 2.0), np.full(60, 50.0)])  # root mean squares, of noise 1
    true, noise = (rng.standard_normal((2, 960)) + 1j * rng.standard_normal((2, 960))) / np.sqrt(2)
    true *= size
    share, square = shrunk(np.abs(true + noise) ** 2, 1.0)
    wrong = np.abs(share * (true + noise) - true) ** 2
    assert wrong.sum() < 0.55 * (np.abs(noise) ** 2).sum()
    assert wrong.sum() == pytest.approx((share**2 + (1 - share) ** 2 * square).sum(), rel=0.1)
    assert square.sum() == pytest.approx((np.abs(true) ** 2).sum(), rel=0.05)
