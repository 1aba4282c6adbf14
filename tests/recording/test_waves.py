"""Waves and their design: columns by their formula, means that damp nothing, curves by two ways."""

from fractions import Fraction

import numpy as np

from hdassist.recording.positions import ordered_readings, recording_from_columns
from hdassist.recording.waves import (
    CURVE_POINTS_PER_REV,
    LEAST_BLOCKS_PER_REV,
    MOST_BLOCKS,
    block_means,
    block_starts,
    curve_extremes,
    cycle_curves,
    distinct_pairs,
    fill_block_columns,
    visited_places,
    wave_pairs,
    wave_values,
)
from tests.recording.readings import RATIO, known_error

RNG = np.random.default_rng(3)


def test_pairs_have_both_sides_the_other_wheel_and_no_constant():
    pairs = {tuple(pair) for pair in wave_pairs(Fraction(100), blocks_per_rev=100).tolist()}
    assert (0, 0) not in pairs
    assert {(2, 6), (2, -6), (9, 9), (9, -9), (36, 0), (36, -36), (0, 6)} <= pairs
    assert not {(2, 7), (0, -1), (37, 0), (21, 1)} & pairs
    coarse = wave_pairs(Fraction(100), blocks_per_rev=8)
    assert coarse[coarse[:, 0] % 2 == 1, 0].max() == 15


def test_fine_waves_are_even_and_no_wave_occurs_twice():
    for cycle in (Fraction(30), Fraction(61, 2), Fraction(120)):
        pairs = wave_pairs(cycle, blocks_per_rev=8)
        fine = pairs[pairs[:, 0] > 16]
        assert (fine[:, 0] % 2 == 0).all()
        assert fine[:, 0].max() == min(80, int(cycle) + 1) // 2 * 2
        nearest = np.minimum(np.abs(fine[:, 1]), np.abs(np.abs(fine[:, 1]) - fine[:, 0]))
        assert nearest.max() == 1
        periods = pairs[:, 0] * cycle.numerator + pairs[:, 1] * cycle.denominator
        assert len(set(periods.tolist())) == len(pairs)


def test_columns_are_cosines_and_sines():
    phi, psi = RNG.random((2, 50))
    pairs = wave_pairs(Fraction(30), blocks_per_rev=30)
    angle = 2 * np.pi * (np.outer(phi, pairs[:, 0]) + np.outer(psi, pairs[:, 1]))
    assert np.allclose(wave_values(phi, psi, pairs), np.exp(1j * angle).T)


def test_curves_of_the_cycle_are_those_of_the_columns():
    for cycle in (Fraction(30), Fraction(61, 2)):
        pairs = wave_pairs(cycle, blocks_per_rev=30)
        amplitudes = RNG.standard_normal((2, 2 * len(pairs)))
        turns = np.arange(CURVE_POINTS_PER_REV * cycle.numerator) / CURVE_POINTS_PER_REV
        values = wave_values(turns % 1, turns / float(cycle) % 1, pairs).T
        columns = np.hstack([values.real, values.imag])
        assert np.allclose(cycle_curves(amplitudes, pairs, cycle), amplitudes @ columns.T)


def test_means_over_blocks_damp_no_wave():
    turns = np.sort(RNG.random(20_000)) * RATIO
    readings = ordered_readings(recording_from_columns(turns, known_error(turns), RATIO))
    starts = block_starts(readings)
    assert len(starts) <= 1.5 * LEAST_BLOCKS_PER_REV * RATIO
    pairs = wave_pairs(readings.cycle, blocks_per_rev=100)
    design = np.empty((len(starts), 2 * len(pairs)))
    fill_block_columns(readings, starts, pairs, list(design.T))
    solution = np.linalg.lstsq(design, block_means(readings.error_arcsec, starts), rcond=None)[0]
    cosine = solution[pairs.tolist().index([2, 0])]
    sine = solution[len(pairs) + pairs.tolist().index([2, 0])]
    assert np.allclose(readings.flipped * np.array([cosine, sine]), [9 * np.cos(1.0), 9 * np.sin(1.0)])


def test_blocks_of_equal_and_of_different_sizes_have_their_means():
    for rows in (9_000, 9_001):
        turns = np.sort(RNG.random(rows)) * RATIO
        readings = ordered_readings(recording_from_columns(turns, known_error(turns), RATIO))
        starts = block_starts(readings)
        pairs = wave_pairs(readings.cycle, 100)
        columns = np.empty((2 * len(pairs), len(starts)))
        fill_block_columns(readings, starts, pairs, list(columns))
        values = wave_values(readings.input_rev, readings.output_rev, pairs).T
        means = block_means(np.hstack([values.real, values.imag]), starts)
        assert np.allclose(columns.T, means, rtol=0, atol=1e-12)


def test_extremes_of_curves_are_those_of_their_points():
    curves = RNG.standard_normal((3, 50)).cumsum(axis=1)
    is_visited = np.arange(50) < 20
    extremes = curve_extremes(curves, is_visited)
    assert np.allclose(extremes.range_arcsec, np.ptp(curves, axis=1))
    assert np.allclose(extremes.visited_range_arcsec, np.ptp(curves[:, :20], axis=1))
    assert (extremes.highest == curves.argmax(axis=1)).all()
    assert not curve_extremes(curves, np.zeros(50, bool)).visited_range_arcsec.any()
    mirrored = extremes.mirrored(-1, -1, points=50)
    backwards = curve_extremes(-np.roll(curves[:, ::-1], 1, axis=1), is_visited)
    assert (mirrored.highest == backwards.highest).all()
    assert (mirrored.lowest == backwards.lowest).all()


def test_peaks_lie_between_points():
    turns = (np.arange(16) + 0.37) / 16
    extremes = curve_extremes(np.cos(2 * np.pi * turns)[None], np.ones(16, bool))
    assert np.isclose(extremes.peak_range_arcsec[0], 2.0, rtol=2e-3)
    assert extremes.range_arcsec[0] < 1.99


def test_no_block_reaches_over_two_runs():
    turns = np.concatenate([np.arange(1000) / 333, 10 + np.arange(700) / 333])
    sweep = np.repeat([0, 1], [1000, 700])
    readings = ordered_readings(recording_from_columns(turns, known_error(turns), RATIO, sweep=sweep))
    borders = set((np.flatnonzero(np.diff(readings.run)) + 1).tolist())
    assert borders <= set(block_starts(readings).tolist())


def test_more_pairs_are_taken_once():
    usual = wave_pairs(Fraction(100), blocks_per_rev=20)
    more = wave_pairs(Fraction(100), blocks_per_rev=20, more_pairs=[(4, 9), (2, 0)])
    assert {tuple(pair) for pair in more.tolist()} - {tuple(pair) for pair in usual.tolist()} == {(4, 9)}


def test_places_near_a_reading_are_visited():
    visited = visited_places(np.array([0.0, 5.0]), Fraction(30))
    places = np.flatnonzero(visited) / CURVE_POINTS_PER_REV
    off = np.minimum.reduce([np.abs(places - place) for place in (0.0, 5.0, 30.0)])
    assert off.max() <= 0.009 + 1e-12
    assert len(places) == 10  # a step is 1/240 of a revolution: two to each side, also where the cycle closes


def test_order_that_is_constant_at_the_readings_is_left_out():
    places = np.arange(40 * 50) / 40.0
    cycle = Fraction(50)
    kept = distinct_pairs(np.array([[2, 0], [20, 0], [38, 0], [40, 0]]), places, cycle)
    assert kept.tolist() == [[2, 0], [20, 0]]
    uneven = np.sort(np.random.default_rng(3).random(2000)) * 50
    assert len(distinct_pairs(np.array([[2, 0], [20, 0], [38, 0], [40, 0]]), uneven, cycle)) == 4


def test_blocks_are_short_enough_for_the_highest_wave():
    # 80 blocks per revolution would attenuate order 80 to 0, although 480 readings show it
    for ratio, highest in ((30, 31), (100, 80)):
        turns = np.arange(480 * ratio) / 480
        readings = ordered_readings(recording_from_columns(turns, known_error(turns), ratio))
        starts = block_starts(readings)
        columns = np.empty((2, len(starts)))
        fill_block_columns(readings, starts, np.array([[highest, 0]]), list(columns))
        attenuation = np.sqrt(float(np.mean(columns[0] ** 2 + columns[1] ** 2)))
        assert attenuation > 0.6
        assert len(starts) <= 180 * ratio


def test_a_recording_of_many_cycles_has_longer_blocks():
    turns = np.arange(300 * 300) / 300  # three cycles
    starts = block_starts(ordered_readings(recording_from_columns(turns, known_error(turns), 100)))
    assert len(starts) <= 1.01 * MOST_BLOCKS
