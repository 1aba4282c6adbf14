"""Both directions of rotation as one model: a dense posterior by hand, and rigs that the model cannot represent."""

import numpy as np
import pytest

from hdassist.recording.blocks import BlockModel
from hdassist.recording.directions import DirectionsSampler, ModelledDirection
from hdassist.recording.figures import range_figure
from hdassist.recording.noise import WHITE
from hdassist.recording.positions import ordered_readings, recording_from_columns
from hdassist.recording.posterior import posterior_of_recording, posteriors_of_directions
from hdassist.recording.waves import wave_values
from tests.recording.readings import RATIO, known_error


def one_way(way, first, last, curve=known_error, sigma=0.3, per_rev=30, seed=0, offset=5.0):
    """A recording of a curve from one angle [rev] to another; in the backward direction the rows are in reverse."""
    turns = first + np.arange(int((last - first) * per_rev)) / per_rev
    noise = sigma * np.random.default_rng([seed, way > 0]).standard_normal(len(turns))
    error = curve(turns) - way * offset + noise
    return recording_from_columns(turns[::way], error[::way], RATIO)


def scaled(share):
    """The known error, larger by a share."""
    return lambda turns: (1 + share) * known_error(turns)


def true_range(curve):
    return float(np.ptp(curve(np.arange(0, RATIO, 1 / 500))))


def intervals(forward, backward):
    return [range_figure(posterior).interval_arcsec for posterior in posteriors_of_directions(forward, backward)]


def width(interval):
    return interval[1] - interval[0]


@pytest.mark.thorough
def test_coefficients_are_those_of_a_dense_normal_posterior():
    """By the covariance of all readings, in which the curves of both directions are correlated by (R20)."""
    recordings = [one_way(1, 0.0, 4.0, per_rev=24), one_way(-1, 2.0, 6.0, per_rev=24)]
    readings = [ordered_readings(recording) for recording in recordings]
    models = [BlockModel(each, drift_degree=0) for each in readings]
    pairs = models[0].pairs
    assert np.array_equal(pairs, models[1].pairs)
    directions = []
    for each, model in zip(readings, models, strict=True):
        signs = np.repeat([each.flipped, each.flipped * each.turned], len(pairs)).astype(float)
        directions.append(ModelledDirection(model=model, memory=WHITE, signs=signs))
    sampler = DirectionsSampler(directions, seed=0)
    wave, share = sampler._tree.wave.copy(), sampler._shares.share.copy()
    sigma2 = 0.09

    # columns of the recorded angles and errors, not those of the models
    columns, errors, way = [], [], []
    for recording, each in zip(recordings, readings, strict=True):
        values = wave_values(recording.input_rev, recording.output_rev, pairs).T
        columns.append(np.hstack([values.real, values.imag]))
        errors.append(recording.error_arcsec)
        way.append(np.full(len(recording.error_arcsec), 0.5 if each.turned > 0 else -0.5))
    design, error, half = np.vstack(columns), np.concatenate(errors), np.concatenate(way)
    common = (design * np.tile(wave, 2)) @ design.T
    difference = (design * np.tile(wave * share, 2)) @ design.T
    curve_prior = common + np.outer(half, half) * difference
    levels = 1e6 * (np.sign(half)[:, None] == np.sign(half))
    covariance = curve_prior + levels + sigma2 * np.eye(len(error))
    mean = curve_prior @ np.linalg.solve(covariance, error)
    curve_covariance = curve_prior - curve_prior @ np.linalg.solve(covariance, curve_prior)

    draws = []
    for _ in range(600):
        for side in sampler._sides:
            side.sigma2 = sigma2
        sampler._tree.wave, sampler._shares.share = wave, share
        sampler._draw_coefficients()
        beta = sampler._beta.copy()
        amplitudes = [beta[: sampler._waves], beta[sampler._partner : sampler._partner + sampler._waves]]
        draws.append(np.concatenate([x @ y for x, y in zip(columns, amplitudes, strict=True)]))
    drawn = np.array(draws[100:])
    sigmas = np.sqrt(np.diag(curve_covariance))
    assert np.all(np.abs(drawn.mean(axis=0) - mean) < 6 * sigmas / np.sqrt(500))
    assert np.allclose(drawn.std(axis=0), sigmas, rtol=0.25)


def test_whole_cycles_have_nearly_the_result_of_each_alone():
    recordings = [one_way(1, 0.0, RATIO), one_way(-1, 0.0, RATIO, curve=scaled(0.06))]
    both = intervals(*recordings)
    alone = [range_figure(posterior_of_recording(recording)).interval_arcsec for recording in recordings]
    for curve, joint, single in zip((known_error, scaled(0.06)), both, alone, strict=True):
        assert joint[0] < true_range(curve) < joint[1]
        assert np.abs(np.subtract(joint, single)).max() < 0.02 * true_range(curve)
        assert width(joint) < 1.3 * width(single)  # each end is known to a tenth of the width


@pytest.mark.thorough
def test_mirrored_recordings_exchange_the_directions():
    """Mirrored angles exchange both directions, and a mirrored error changes nothing."""
    recordings = [one_way(1, 0.0, 15.0), one_way(-1, 10.0, 25.0)]
    forward, backward = intervals(*recordings)
    mirrored = [
        recording_from_columns(-each.input_rev, -each.error_arcsec, RATIO) for each in (recordings[1], recordings[0])
    ]
    again = intervals(*mirrored)
    assert np.allclose(again[0], backward, rtol=0.04)
    assert np.allclose(again[1], forward, rtol=0.04)


@pytest.mark.thorough
def test_each_direction_informs_the_other_where_it_has_no_readings():
    halves = [one_way(1, 0.0, RATIO / 2), one_way(-1, RATIO / 2, RATIO)]
    alone = [range_figure(posterior_of_recording(recording)).interval_arcsec for recording in halves]
    for joint, single in zip(intervals(*halves), alone, strict=True):
        assert joint[0] < true_range(known_error) < joint[1]
        assert width(joint) < width(single)


@pytest.mark.thorough
def test_halves_without_common_positions_may_differ():
    curves = (known_error, scaled(0.08))
    halves = [one_way(1, 0.0, RATIO / 2), one_way(-1, RATIO / 2, RATIO, curve=curves[1])]
    for curve, posterior in zip(curves, posteriors_of_directions(*halves), strict=True):
        figure = range_figure(posterior)
        low, high = figure.interval_arcsec
        assert low < true_range(curve) < high
        assert figure.verdict(0.97 * true_range(curve)) != "PASS"


def dead_band(way):
    """A rig with a dead band: the output follows the rising flanks of the error in one direction only."""

    def curve(turns):
        rate = (known_error(turns + 1e-4) - known_error(turns - 1e-4)) / 2e-4
        return known_error(turns) + way * 1.5 * np.tanh(rate / 60)

    return curve


def lagging(way):
    """A rig whose output encoder is late by 1.5 % of an input revolution."""
    return lambda turns: known_error(turns + 0.015 * way)


@pytest.mark.thorough
@pytest.mark.parametrize("rig", [dead_band, lagging])
@pytest.mark.parametrize("ends", [((0.0, 1.0), (0.0, 1.0)), ((0.0, 0.5), (0.5, 1.0)), ((0.0, 1.0), (0.2, 0.6))])
def test_rigs_that_the_model_does_not_represent(rig, ends):
    """The intervals of 3 recordings, two each. One of 20 may miss, as those of one direction do."""
    held = 0
    for seed in (3, 4, 5):
        recordings = [
            one_way(way, first * RATIO, last * RATIO, curve=rig(way), seed=seed)
            for way, (first, last) in zip((1, -1), ends, strict=True)
        ]
        for way, posterior in zip((1, -1), posteriors_of_directions(*recordings), strict=True):
            figure = range_figure(posterior)
            true = true_range(rig(way))
            low, high = figure.interval_arcsec
            held += low < true < high
            assert figure.verdict(0.97 * true) != "PASS"
            assert figure.verdict(1.03 * true) != "FAIL"
    assert held >= 5
