"""Corrections held against second ways: dense least squares, solved states, and figures known of the paper's drive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.error.cycle import kinematic_error
from hdassist.drive.error.waves import POINTS_A_TURN, error_lines
from hdassist.features.correction.correct import IN_PLACE, TURN_LOST, correct
from hdassist.features.correction.forms import (
    CorrectionForm,
    CorrectionTable,
    between_points,
    periods_a_cam_turn,
    phasors_of,
    table_values,
)
from hdassist.run.run import UNCHECKED
from tests.helpers.process import SMALL, TINY

FIXED = {"rigid": (), "flexspline": ("mounting.fixed=flexspline",)}


@pytest.fixture(scope="module", params=FIXED)
def lines(request):
    """Lines of the tiny drive's error, with either wheel fixed: the output turns against the cam, or with it."""
    return error_lines(load_preset(TINY, FIXED[request.param]), 1.0, [{}])


@pytest.fixture(scope="module")
def paper():
    """Corrections of the paper's drive as the preset has it, at 80 and 800 N*m, with tables of 256 points."""
    return correct(load_preset("vzp160"), form=CorrectionForm("output", 256), draws=0)


def left(result, name: str) -> float:
    """Share that a form leaves in place at the first torque."""
    return next(each.left[1] for each in result.forms if each.form.name == name)


@pytest.mark.parametrize(("turn", "points"), [("output", 64), ("output", 23), ("cam", 16), ("half-cam", 9)])
def test_a_table_is_the_least_squares_of_the_whole_cycle(lines, turn, points):
    curve = -lines.curves[0]
    periods = np.arange(len(curve)) / POINTS_A_TURN * periods_a_cam_turn(turn, lines.kinematics.u)
    triangles = np.array([between_points(row, periods) for row in np.eye(points)]).T
    by_samples = np.linalg.lstsq(triangles, curve)[0]
    assert table_values(lines, turn, points)[0] == pytest.approx(by_samples, abs=0.01 * np.ptp(curve))


def test_phasors_are_the_lines_of_the_error(lines):
    turns = np.linspace(0, 10, 37)
    every = replace(lines, amplitude=np.where(lines.per_cycle <= 4, lines.amplitude, 0))
    found = phasors_of(every, 1.0, 40)
    curve = -every.curves[0]
    expected = np.interp(turns * POINTS_A_TURN, np.arange(len(curve) + 1), np.append(curve, curve[0]))
    cycle = lines.kinematics.cycle_cam_revolutions
    assert found.error_at(np.mod(turns, cycle))[0] == pytest.approx(expected, abs=0.01) or cycle > 10


@pytest.mark.parametrize(("preset", "points"), [(SMALL, 256), (SMALL, 1500), (TINY, 256), (TINY, 1500)])
def test_residuals_are_those_of_the_solved_cycle(preset, points):
    drive = load_preset(preset)
    result = correct(drive, form=CorrectionForm("output", points), draws=0)
    M_g = drive.operation.M_g[0]
    error = kinematic_error(drive, M_g, run=UNCHECKED)
    corrected = -error.error_arcsec - result.correction.error_at(error.states.phi_h / (2 * np.pi))
    told = result.chosen.residuals[0]
    assert told.case == IN_PLACE
    assert told.uncorrected_p50 == pytest.approx(error.F_ior_arcsec)
    assert np.ptp(corrected) == pytest.approx(told.p50, abs=0.03 * error.F_ior_arcsec)
    flipped = -error.error_arcsec + result.correction.error_at(error.states.phi_h / (2 * np.pi))
    assert np.ptp(flipped) > 1.5 * error.F_ior_arcsec


@pytest.mark.thorough
def test_paper_drive_needs_correction_terms_rather_than_short_tables(paper):
    assert paper.strong_lines == pytest.approx([201, 200, 1])
    assert 0.6 < left(paper, "cam turn, 256 points") < 1.52
    assert left(paper, "output turn, 256 points") > 0.9
    by_form = [left(paper, name) for name in ("1280 phasors", "output turn, 1500 points", "output turn, 720 points")]
    assert by_form == sorted(by_form)
    assert by_form[0] < 0.006
    assert 256 < paper.fewest_points <= 720


@pytest.mark.thorough
def test_a_sampled_table_is_worse_than_least_squares(paper):
    curve = -paper.errors[80.0].lines.curves[0]
    cam_turns = np.arange(len(curve)) / POINTS_A_TURN
    points = np.rint(-np.arange(256) / 256 * len(curve)).astype(int)  # the output turns against the cam
    sampled = replace(paper.correction, error_arcsec=curve[points % len(curve)])
    ranges = [np.ptp(curve - table.error_at(cam_turns)) for table in (sampled, paper.correction)]
    assert ranges[0] > 1.3 * ranges[1]


def test_table_for_one_load_harms_another_unlike_load_specific_tables(paper):
    phasors, each_load = (each for each in paper.forms if each.form.turn is None)
    single, own = (next(left for left in each.residuals if left.M_g == 800) for each in (phasors, each_load))
    assert single.p50 > single.uncorrected_p50 > own.p50


@pytest.mark.thorough
def test_zero_offset_and_lost_revolution_cost_what_shifted_tables_leave(paper):
    phasors = paper.forms[0]
    curve = -paper.errors[80.0].lines.curves
    cam_turns = np.arange(curve.shape[1]) / POINTS_A_TURN
    correction = phasors.form.fitted(paper.errors[80.0].lines, 80.0)
    by_case = {each.case: each for each in phasors.residuals}
    in_place = correction.error_at(cam_turns)  # over the full cycle: a shift of the table turns it round
    off = POINTS_A_TURN * 10 // 360
    some = slice(7, None, 400)
    assert np.roll(in_place, -off, axis=1)[:, some] == pytest.approx(correction.error_at(cam_turns[some] + 10 / 360))
    shifted = [np.ptp(curve - np.roll(in_place, shift)) for shift in (-off, off)]
    assert by_case["zero 10 deg off"].p95 == pytest.approx(max(shifted), rel=0.01)
    lost = [np.ptp(curve - np.roll(in_place, -POINTS_A_TURN * k)) for k in range(1, 100)]
    assert 0.99 * min(lost) <= by_case[TURN_LOST].p5 <= by_case[TURN_LOST].p95 <= 1.01 * max(lost)
    of_cam = next(each for each in paper.forms if each.form.turn == "cam")
    assert of_cam.residuals[-1].p95 == pytest.approx(of_cam.residuals[0].p50)


def test_oval_wheel_is_corrected_by_a_table_per_input_revolution():
    drive = load_preset("vzp160", ["harmonics.a_b2=8", "operation.M_g=[80]"])
    oval = correct(drive, draws=0)
    assert left(oval, "cam turn, 256 points") < 0.5
    assert oval.strong_lines[0] == pytest.approx(200)


def test_where_phases_are_not_known_only_a_record_can_correct():
    drive = load_preset(TINY, ["phases.xi_b=unknown"])
    result = correct(drive, draws=16)
    assert result.chosen.is_refused
    assert not result.forms[0].is_refused  # as if the drive's own error were recorded
    assert len(result.errors[1.0].actual) == 16


def test_the_other_direction_has_the_table_of_the_opposite_torque():
    drive = load_preset(TINY, ["operation.M_g=[1, -1]"])
    found = correct(drive, form=CorrectionForm("output", 40, each_load=True), draws=0).correction
    assert isinstance(found, CorrectionTable)
    other = table_values(error_lines(drive, -1.0, [{}]), "output", 40)[0]
    assert found.other_M_g == -1
    near = 0.02 * np.abs(other).max()
    assert found.other_direction_arcsec == pytest.approx(other, abs=near)
    turns = np.linspace(0, 10, 11)
    assert found.error_at(turns, other_direction=True) == pytest.approx(between_points(other, -turns / 10), abs=near)
