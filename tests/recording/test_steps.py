"""Steps of the level: found where the readings show them, and only there."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from hdassist.recording.steps import clear_step, log_evidence
from tests.recording.readings import RATIO, noisy_readings


def one_run(turns):
    return np.zeros(len(turns), np.int64)


@pytest.mark.parametrize("size", [2.0, -3.0])
def test_a_step_is_found_where_it_is(size):
    turns, error = noisy_readings()
    step = clear_step(turns, error + size * (np.arange(len(turns)) >= 700), one_run(turns), RATIO)
    assert abs(step.first - 700) <= 1
    assert step.size_arcsec == pytest.approx(size, abs=0.5)


def test_a_recording_without_a_step_has_none():
    for seed in range(4):
        turns, error = noisy_readings(seed=seed)
        assert clear_step(turns, error, one_run(turns), RATIO) is None
        assert clear_step(turns, error + 0.2 * turns, one_run(turns), RATIO) is None  # drift
    counted = 2 * np.rint(noisy_readings(sigma=0.1)[1] / 2)
    assert clear_step(turns, counted, one_run(turns), RATIO) is None


def test_noise_with_a_memory_is_no_step():
    rng = np.random.default_rng(1)
    turns, error = noisy_readings(sigma=0.0)
    noise = rng.standard_normal(len(turns))
    for row in range(1, len(noise)):
        noise[row] = 0.9 * noise[row - 1] + np.sqrt(1 - 0.81) * noise[row]
    assert clear_step(turns, error + noise, one_run(turns), RATIO) is None


def test_slow_waves_of_a_test_rig_are_no_step():
    turns, error = noisy_readings()
    for periods in (8, 10, 12):
        slow = 20 * np.cos(2 * np.pi * periods * turns / RATIO)
        assert clear_step(turns, error + slow, one_run(turns), RATIO) is None


def test_runs_have_levels_of_their_own():
    turns, error = noisy_readings()
    run = (np.arange(len(turns)) >= 700).astype(np.int64)
    assert clear_step(turns, error + 5 * run, run, RATIO) is None


def test_a_short_recording_has_no_place_for_a_step():
    turns, error = noisy_readings(readings=40, span=0.9)
    assert clear_step(turns, error, one_run(turns), RATIO) is None


def test_evidence_is_the_ratio_of_two_densities():
    # (R19) without its formula: normal densities of the errors with and without a step at one reading
    rng = np.random.default_rng(2)
    design = rng.standard_normal((30, 4))
    column = (np.arange(30) >= 12).astype(float)
    prior, variance, wide = 0.5, 0.3, 4.0
    errors = rng.multivariate_normal(np.zeros(30), prior * design @ design.T + variance * np.eye(30)) + column
    without = prior * design @ design.T + variance * np.eye(30)
    ratio = multivariate_normal.logpdf(errors, cov=without + wide * np.outer(column, column))
    ratio -= multivariate_normal.logpdf(errors, cov=without)
    precision = design.T @ design / variance + np.eye(4) / prior
    residual = errors - design @ np.linalg.solve(precision, design.T @ errors / variance)
    free = column @ column - column @ design @ np.linalg.solve(precision, design.T @ column) / variance
    evidence = float(log_evidence(np.array(column @ residual), np.array(free), variance, wide))
    assert evidence == pytest.approx(ratio, abs=1e-9)
