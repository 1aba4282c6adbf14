"""The posterior against a second way: a normal posterior by hand, known amplitudes, and relations."""

import numpy as np
import pytest

from hdassist.recording import chain as module
from hdassist.recording.blocks import BlockModel
from hdassist.recording.chain import effective_samples
from hdassist.recording.components import Components
from hdassist.recording.figures import range_figure
from hdassist.recording.noise import WHITE
from hdassist.recording.positions import ordered_readings, recording_from_columns
from hdassist.recording.posterior import posterior_of_recording
from tests.recording.readings import RATIO, WAVES, noisy_readings

TURNS, ERROR = noisy_readings()
ROWS = len(TURNS)


@pytest.fixture(scope="module")
def reference():
    return posterior_of_recording(recording_from_columns(TURNS, ERROR, RATIO), drift_degree=0)


@pytest.mark.thorough
def test_coefficients_are_those_of_a_dense_normal_posterior():
    turns, error = noisy_readings(readings=120, span=6.0)
    readings = ordered_readings(recording_from_columns(turns, error, RATIO))
    model = BlockModel(readings, drift_degree=1)
    sampler = module.Sampler(model, seed=0)
    variances = np.concatenate([sampler._tree.wave, sampler._tree.wave, [1e4], sampler._drift2])
    sigma2 = sampler._sigma2
    # by the covariance of the readings, not by the precision of the coefficients
    covariance = sigma2 * np.eye(len(model.errors)) + (model.design * variances) @ model.design.T
    gain = (model.design * variances).T @ np.linalg.inv(covariance)
    mean = gain @ model.errors
    curve_covariance = model.design @ (np.diag(variances) - gain @ (model.design * variances)) @ model.design.T
    tree, draws = sampler._tree.wave.copy(), []
    for _ in range(500):
        draws.append(sampler._step())
        sampler._tree.wave, sampler._sigma2, sampler._drift2 = tree, sigma2, variances[-1:]
    curves = np.array(draws) @ model.design.T
    sigmas = np.sqrt(np.diag(curve_covariance))
    assert np.all(np.abs(curves.mean(axis=0) - model.design @ mean) < 5 * sigmas / np.sqrt(500))
    assert np.allclose(curves.std(axis=0), sigmas, rtol=0.2)


def test_columns_of_a_smaller_model_are_those_computed_alone():
    readings = ordered_readings(recording_from_columns(TURNS, ERROR, RATIO))
    smaller = BlockModel(readings, drift_degree=2)
    components = Components(pairs=((3, 12),), lines=(4.56,))
    arguments = {"drift_degree": 2, "more_sidebands": 4, "components": components}
    shared = BlockModel(readings, **arguments, smaller=smaller)
    alone = BlockModel(readings, **arguments)
    assert np.allclose(shared.design, alone.design, rtol=0, atol=1e-12)
    assert np.allclose(shared.gram, alone.gram, rtol=0, atol=1e-9)


def test_columns_joined_by_others_are_one_group(monkeypatch):
    monkeypatch.setattr(module, "_GROUP_COLUMNS", 1)  # small groups stay apart
    gram = np.eye(6)
    for one, other in ((0, 4), (4, 2), (1, 5)):
        gram[one, other] = gram[other, one] = 0.3
    assert [group.tolist() for group in module.coherent_groups(gram)] == [[0, 2, 4], [1, 5], [3]]


def test_known_amplitudes_are_recovered(reference):
    mean, sigma = reference.amplitudes.mean(axis=0), reference.amplitudes.std(axis=0)
    pairs = reference.pairs.tolist()
    for k, j, size, phase in WAVES:
        place = pairs.index([k, j])
        for column, true in ((place, size * np.cos(phase)), (len(pairs) + place, size * np.sin(phase))):
            assert abs(mean[column] - true) < 4 * sigma[column]
            assert sigma[column] < 0.05
    assert reference.memory == WHITE
    assert np.isclose(np.median(reference.sigma_arcsec), 0.4, rtol=0.15)


@pytest.mark.thorough
@pytest.mark.parametrize("relation", ["permuted", "split", "elsewhere", "wrapped", "mirrored", "negated", "units"])
def test_relations_hold_to_rounding(reference, relation):
    turns, error, sweep, time, scale = TURNS, ERROR, None, None, 1.0
    if relation == "permuted":
        time = np.random.default_rng(1).permutation(ROWS)
        turns, error = TURNS[time], ERROR[time]
    elif relation == "split":
        sweep = np.arange(ROWS) // 250
    elif relation == "elsewhere":
        rows = np.roll(np.arange(ROWS), -217)
        turns, error = TURNS[rows] + RATIO * (rows < 217), ERROR[rows]
    elif relation == "wrapped":
        turns = TURNS + 3 * RATIO
    elif relation == "mirrored":
        turns = -TURNS
    elif relation == "negated":
        error = -ERROR
    else:
        scale = 60.0
        error = ERROR * scale
    posterior = posterior_of_recording(
        recording_from_columns(turns, error, RATIO, sweep=sweep, time=time), drift_degree=0
    )
    figure, first = range_figure(posterior), range_figure(reference)
    assert np.allclose(figure.whole_arcsec, scale * first.whole_arcsec, rtol=1e-6)
    assert np.allclose(figure.seen_arcsec, scale * first.seen_arcsec, rtol=1e-6)
    signs = np.ones(2 * len(posterior.pairs))
    if relation == "mirrored":
        signs[len(posterior.pairs) :] = -1
    signs *= -scale if relation == "negated" else scale
    assert np.allclose(posterior.amplitudes, signs * reference.amplitudes, rtol=1e-6, atol=1e-6 * scale)


def test_a_memory_does_not_swallow_waves_beyond_the_pairs():
    turns, error = noisy_readings(readings=1500)  # with 1320 it has the same readings as (30, 31)
    extra = 3.0 * np.cos(2 * np.pi * (2 + 9 / RATIO) * turns)
    recording = recording_from_columns(turns, error + extra, RATIO)
    posterior = posterior_of_recording(recording, most_draws=40)
    pairs = posterior.pairs.tolist()
    size = np.hypot(*posterior.amplitudes.mean(axis=0).reshape(2, -1)[:, pairs.index([2, 9])])
    assert abs(size - 3.0) < 0.1


def test_a_chain_is_worth_the_samples_that_it_has():
    rng = np.random.default_rng(2)
    white = rng.standard_normal(4000)
    slow = np.zeros(4000)
    for step in range(1, 4000):
        slow[step] = 0.9 * slow[step - 1] + white[step]
    assert effective_samples(white) > 3000
    assert 100 < effective_samples(slow) < 400  # 4000 (1 - 0.9) / (1 + 0.9) = 211
    assert effective_samples(np.ones(10)) == 10
