"""Corrections from recordings of both directions, whose error curves and levels differ by a hidden reversal."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hdassist.drive.model.geometry import Array
from hdassist.features.correction.correct import PHASORS, Correction, correction_alone
from hdassist.features.correction.forms import CorrectionForm
from hdassist.features.measuring.measure import measure
from hdassist.features.record_comparison.record import Alignment
from hdassist.readers.trace import read_trace

RATIO, PER_REV = 30, 50
LOST_MOTION_ARCSEC, NOISE_ARCSEC = 20.0, 0.5
WAVES = ((0, 1), (1, 0), (2, 0), (2, 1), (2, -1), (4, 0), (2, 2), (6, 0))  # periods per input and output revolution
USUAL_ARCSEC = np.array([3.0, 2.0, 10.0, 3.0, 2.0, 1.5, 1.0, 0.5])
HYSTERESIS = 0.15  # largest difference of a wave between the directions, relative to the wave, and in radians
TABLE = CorrectionForm("output", 1500)
INPUT_TABLE = CorrectionForm("cam", 256)
CYCLE = np.arange(RATIO * 200) / 200
WHOLE = ((0.0, 1.02), (0.0, 1.02))
WHOLE_AND_PART = ((0.0, 1.02), (0.3, 1.0))
HALF = ((0.0, 0.5), (0.0, 0.5))


class HiddenDrive:
    """A drive whose waves have another amplitude and another phase in each direction."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        waves = len(WAVES)
        self._periods = np.array([order + sideband / RATIO for order, sideband in WAVES])
        self._size = USUAL_ARCSEC * rng.uniform(0.5, 1.5, waves)
        self._phase = rng.uniform(0, 2 * np.pi, waves)
        self._size_change = self._size * rng.uniform(-HYSTERESIS, HYSTERESIS, waves)
        self._phase_change = rng.uniform(-HYSTERESIS, HYSTERESIS, waves)

    def error(self, turns: Array, direction: int) -> Array:
        """Error [arcsec] at input angles [rev] in a direction, without the lost motion."""
        size = self._size + direction * self._size_change / 2
        phase = self._phase + direction * self._phase_change / 2
        return np.asarray(size @ np.cos(2 * np.pi * self._periods[:, None] * turns + phase[:, None]))

    def recording(self, covered: tuple[tuple[float, float], ...]) -> bytes:
        """File of sweeps in both directions over these parts of the cycle, with lost motion and noise."""
        rng = np.random.default_rng(1000)
        rows = ["cam_deg,error_arcsec"]
        for (first, last), direction in zip(covered, (1, -1), strict=False):
            steps = np.arange(round(first * RATIO * PER_REV), round(last * RATIO * PER_REV) + 1)
            turns = steps[::direction] / PER_REV
            noise = NOISE_ARCSEC * rng.standard_normal(len(turns))
            error = self.error(turns, direction) - direction * LOST_MOTION_ARCSEC / 2 + noise
            rows += [f"{360 * angle:.6f},{value:.5f}" for angle, value in zip(turns, error, strict=True)]
        return "\n".join([*rows, ""]).encode()


@cache
def corrected(
    covered: tuple[tuple[float, float], ...],
    form: CorrectionForm,
    travel_deg: float | None = None,
    seed: int = 0,
) -> Correction:
    trace = read_trace(HiddenDrive(seed).recording(covered), None, RATIO)
    found = measure(trace, ratio=RATIO, together=True, travel_deg=travel_deg)
    return correction_alone(found, Alignment(), 1.0, form, "against")


def residual_curves(result: Correction, turns: Array, seed: int = 0) -> tuple[Array, Array]:
    """True error [arcsec] of each direction with a correction; a file has F_kpp, the opposite of the error."""
    drive = HiddenDrive(seed)
    correction = np.atleast_2d(result.correction.error_at(turns))[0]
    return -drive.error(turns, 1) - correction, -drive.error(turns, -1) - correction


@pytest.mark.parametrize("form", [PHASORS, TABLE])
def test_a_hidden_reversal_is_recovered(form: CorrectionForm) -> None:
    result = corrected(WHOLE, form)
    forward, backward = residual_curves(result, CYCLE)
    # the correction is that of the mean of both directions, and the lost motion is no part of it
    assert np.ptp(forward + backward) / 2 < 0.6
    difference = result.between_directions
    assert difference is not None
    true_difference = np.ptp(forward - backward)
    assert true_difference == pytest.approx(3.0, abs=0.1)
    assert 0.9 * difference.p5 <= true_difference <= difference.p95
    for residual, curve in zip(result.directions, (forward, backward), strict=True):
        assert np.ptp(curve) <= residual.p95 < 2 * np.ptp(curve)
    # the page states the larger residual of both directions
    assert result.chosen.residuals[0].p95 >= max(residual.p95 for residual in result.directions) - 1e-9
    assert [residual.direction for residual in result.directions] == [1, -1]


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3))
def test_a_part_recorded_in_one_direction_is_corrected_for_both(seed: int) -> None:
    result = corrected(WHOLE_AND_PART, PHASORS, None, seed)
    forward, backward = residual_curves(result, CYCLE, seed)
    assert np.ptp(forward + backward) / 2 < 0.8
    assert max(np.ptp(forward), np.ptp(backward)) <= result.chosen.residuals[0].p95


@pytest.mark.thorough
@pytest.mark.parametrize("travel_deg", [None, 180.0])
def test_an_input_table_states_the_residual_of_each_direction(travel_deg: float | None) -> None:
    result = corrected(HALF, INPUT_TABLE, travel_deg)
    turns = CYCLE if travel_deg is None else CYCLE[: RATIO * 100 + 1]
    for residual, curve in zip(result.directions, residual_curves(result, turns), strict=True):
        assert 0.9 * residual.p5 <= np.ptp(curve) <= residual.p95


@pytest.mark.thorough
@pytest.mark.parametrize("form", [PHASORS, TABLE])
def test_two_sweeps_of_a_travel_resolve_no_more_than_one(form: CorrectionForm) -> None:
    """Terms that no sweep resolves were stored: 21.6 of 23 arcsec remained, with 5.0 predicted."""
    result = corrected(HALF, form, 180.0)
    residuals = [np.ptp(curve) for curve in residual_curves(result, CYCLE[: RATIO * 100 + 1])]
    assert max(residuals) <= result.chosen.residuals[0].p95 < 5


def test_a_recording_in_one_direction_states_no_directions() -> None:
    result = corrected(WHOLE[:1], PHASORS)
    assert result.directions == ()
    assert result.between_directions is None
