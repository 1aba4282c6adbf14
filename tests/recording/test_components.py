"""Components of the residuals: waves and lines that are there are found, noise is not taken for one."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.signal import lfilter

from hdassist.recording import chain as module
from hdassist.recording.blocks import BlockModel
from hdassist.recording.components import Components, clear_components, line_columns
from hdassist.recording.figures import range_figure
from hdassist.recording.positions import ordered_readings, recording_from_columns
from hdassist.recording.posterior import posterior_of_recording
from tests.recording.readings import RATIO, known_range, noisy_readings

BLOCKS = 1200
PATH = np.arange(BLOCKS) * RATIO / BLOCKS
RUN = np.zeros(BLOCKS, int)
CYCLE = Fraction(RATIO)


def noise(seed, memory=0.0):
    """Noise of 0.4 arcsec, white or with a memory."""
    white = 0.4 * np.random.default_rng(seed).standard_normal(BLOCKS)
    return lfilter([1.0], [1.0, -memory], white)


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_noise_has_no_component(memory):
    found = [clear_components(noise(seed, memory), PATH, RUN, CYCLE) for seed in range(40)]
    assert sum(components != Components() for components in found) <= 1


def test_a_line_and_a_wave_are_told_apart():
    line = 0.3 * np.cos(2 * np.pi * 5.37 * PATH + 1.0)
    wave = 0.3 * np.cos(2 * np.pi * (4 + 9 / RATIO) * PATH)
    found = clear_components(noise(0) + line + wave, PATH, RUN, CYCLE)
    assert found.pairs == ((4, 9),)
    assert np.allclose(found.lines, [5.37], atol=0.2 / RATIO)


def test_lost_readings_do_not_move_a_component():
    is_kept = np.random.default_rng(5).random(BLOCKS) > 0.02
    line = 0.5 * np.cos(2 * np.pi * 14.37 * PATH)  # nearly the highest order that the readings resolve, 15
    found = clear_components((noise(0) + line)[is_kept], PATH[is_kept], RUN[is_kept], CYCLE)
    (component,) = found.lines
    assert component == pytest.approx(14.37, abs=0.2 / RATIO)


def test_a_part_of_the_cycle_has_lines_alone():
    part = PATH < 0.5 * RATIO
    wave = 0.4 * np.cos(2 * np.pi * (4 + 9 / RATIO) * PATH)
    found = clear_components((noise(0) + wave)[part], PATH[part], RUN[part], CYCLE)
    assert found.pairs == ()
    assert np.allclose(found.lines, [4 + 9 / RATIO], atol=0.5 / RATIO)


def test_line_has_its_own_phase_in_every_run():
    run = (PATH >= 12.0).astype(int)
    columns = line_columns(PATH, run, (5.37,))
    phase = 2 * np.pi * 5.37 * PATH
    first, second = run == 0, run == 1
    expected = [np.cos(phase) * first, np.sin(phase) * first, np.cos(phase) * second, np.sin(phase) * second]
    assert np.allclose(columns, np.stack(expected, axis=1))


@pytest.mark.thorough
def test_line_off_the_orders_widens_the_range_of_the_cycle():
    turns, error = noisy_readings()
    line = 3.0 * np.cos(2 * np.pi * 5.37 * turns)
    figure = range_figure(posterior_of_recording(recording_from_columns(turns, error + line, RATIO)))
    low, high = figure.interval_arcsec
    recorded = float(np.ptp(error + line))
    assert low < recorded < known_range() + 6.0 < high
    assert low > known_range()


def test_component_of_a_part_is_no_sum_of_waves():
    rng = np.random.default_rng(8)
    turns = np.arange(0, 23, 1 / 34)
    line = 6.6 * np.cos(2 * np.pi * (2 + 8 / 80) * turns)  # the model has sidebands up to 6
    error = 9 * np.cos(14 * np.pi * turns) + 3 * np.cos(2 * np.pi * turns / 80) + line
    recording = recording_from_columns(turns, error + 0.2 * rng.standard_normal(len(turns)), 80)
    low, high = range_figure(posterior_of_recording(recording, most_draws=200)).interval_arcsec
    assert low < np.ptp(error) < high < 1.5 * np.ptp(error)  # 440 times the range without this rule


def test_place_of_a_line_moves_to_its_best_fit():
    rng = np.random.default_rng(8)
    turns = np.arange(0, 20, 1 / 40)
    error = 9 * np.cos(4 * np.pi * turns) + 2 * np.cos(2 * np.pi * 5.37 * turns)
    recording = recording_from_columns(turns, error + 0.2 * rng.standard_normal(len(turns)), RATIO)
    readings = ordered_readings(recording)
    model = BlockModel(readings, drift_degree=2)
    components = Components(lines=(5.36,))
    for _ in range(4):
        larger = model.with_components(readings, components)
        components = larger.shifted_lines(module.Sampler(larger, seed=0).usual_fit())
    assert components.lines[0] == pytest.approx(5.37, abs=0.001)
