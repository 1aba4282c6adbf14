"""Readings by their positions: one canonical order, whatever the rows, sweeps, begin, wrapping and sense."""

from dataclasses import fields
from io import BytesIO

import numpy as np
import pytest

from hdassist.readers.trace import TraceForm, read_trace
from hdassist.recording.positions import (
    Recording,
    cycle_of,
    ordered_readings,
    recording_from_columns,
    recording_from_trace,
)
from hdassist.run.errors import DataError
from tests.recording.readings import RATIO, noisy_readings

TURNS, ERROR = noisy_readings()
ROWS = len(TURNS)


def assert_same(one, other, left_out=()):
    """All arrays of two ordered recordings agree to rounding."""
    for field in fields(one):
        if field.name not in left_out:
            values = [np.asarray(getattr(each, field.name), float) for each in (one, other)]
            assert np.allclose(*values, atol=1e-8), field.name


REFERENCE = ordered_readings(recording_from_columns(TURNS, ERROR, RATIO))


def test_rows_may_be_permuted():
    rows = np.random.default_rng(1).permutation(ROWS)
    permuted = recording_from_columns(TURNS[rows], ERROR[rows], RATIO, time=rows)
    assert_same(ordered_readings(permuted), REFERENCE)


def test_a_sweep_may_be_split_where_it_goes_on():
    split = recording_from_columns(TURNS, ERROR, RATIO, sweep=np.arange(ROWS) // 250)
    assert_same(ordered_readings(split), REFERENCE)


def test_a_pause_between_two_sweeps_starts_a_run():
    sweep = (np.arange(ROWS) >= 300).astype(int)
    recording = recording_from_columns(TURNS, ERROR, RATIO, sweep=sweep, time=np.arange(ROWS) + 500.0 * sweep)
    assert ordered_readings(recording).run.max() == 1


def test_angles_may_be_wrapped_and_begin_anywhere_by_revolutions():
    wrapped = recording_from_columns(TURNS % RATIO + 7 * RATIO, ERROR, RATIO)
    assert_same(ordered_readings(wrapped), REFERENCE)


def test_a_recording_may_begin_elsewhere():
    start = 217
    rows = np.roll(np.arange(ROWS), -start)
    turns = TURNS[rows] + RATIO * (rows < start)
    assert_same(
        ordered_readings(recording_from_columns(turns, ERROR[rows], RATIO)), REFERENCE, left_out={"elapsed", "path_rev"}
    )


def test_a_mirrored_recording_is_turned_back():
    mirrored = ordered_readings(recording_from_columns(-TURNS, ERROR, RATIO))
    assert mirrored.turned == -1
    assert_same(mirrored, REFERENCE, left_out={"turned"})
    flipped = ordered_readings(recording_from_columns(TURNS, -ERROR, RATIO))
    assert flipped.flipped == -REFERENCE.flipped
    assert_same(flipped, REFERENCE, left_out={"flipped"})


def test_passes_over_the_cycle_and_sweeps_apart_are_runs():
    turns, error = noisy_readings(readings=1800, span=2 * RATIO)
    assert ordered_readings(recording_from_columns(turns, error, RATIO)).run.max() == 1
    apart = np.concatenate([TURNS[500:700], TURNS[:300]])
    recording = recording_from_columns(apart, np.resize(ERROR, 500), RATIO, sweep=np.repeat([0, 1], [200, 300]))
    runs = ordered_readings(recording).run
    assert np.bincount(runs).tolist() == [300, 200]


def test_the_cycle_of_a_half_ratio_has_two_output_revolutions():
    assert cycle_of(50.5).as_integer_ratio() == (101, 2)
    turns, error = noisy_readings(readings=1010, span=101.0, ratio=50.5)
    readings = ordered_readings(recording_from_columns(turns, error, 50.5))
    assert readings.run.max() == 0
    assert np.allclose(readings.place_rev, turns)


def test_a_trace_gives_its_sweeps():
    lines = ["cam_deg,error_arcsec", *(f"{360 * t:.9f},{e:.9f}" for t, e in zip(TURNS, ERROR, strict=True))]
    trace = read_trace(BytesIO("\n".join(lines).encode()), TraceForm())
    assert_same(ordered_readings(recording_from_trace(trace, RATIO)), REFERENCE)


def columns(**changes):
    """Columns of a sound recording with some changed."""
    sound = {
        "input_rev": TURNS,
        "output_rev": TURNS / RATIO,
        "error_arcsec": ERROR,
        "sweep": np.zeros(ROWS, int),
        "time": np.arange(ROWS, dtype=float),
        "ratio": RATIO,
    }
    return sound | changes


@pytest.mark.parametrize(
    "changes",
    [
        {"error_arcsec": np.ones(ROWS)},
        {"error_arcsec": np.append(ERROR[1:], np.nan)},
        {"time": np.arange(3.0)},
        {"ratio": 1.0},
        {"ratio": np.pi},
        {"output_rev": TURNS / 31},
        {name: column[:19] for name, column in columns().items() if name != "ratio"},
    ],
)
def test_a_recording_that_is_none_is_refused(changes):
    with pytest.raises(DataError):
        Recording(**columns(**changes))


def test_both_directions_are_refused():
    there_and_back = np.concatenate([TURNS, TURNS[::-1]])
    recording = recording_from_columns(there_and_back, np.tile(ERROR, 2), RATIO, sweep=np.repeat([0, 1], ROWS))
    with pytest.raises(DataError):
        ordered_readings(recording)
