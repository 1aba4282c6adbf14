"""Encoders of a rig: steps of their readings, and a lag between them."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import encoders
from hdassist.features.measuring.measure import measure
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.run.errors import UntrustedError
from tests.helpers.rigs import EVEN, recorded, text, whole_range


def test_a_coarse_reading_without_noise_counts():
    error = np.round(10 * np.cos(4 * np.pi * EVEN))
    coarse = measure(recorded(EVEN, error, step=1.0), ratio=100).directions[0]
    (source,) = (s for s in coarse.sources if s.name == "resolution")
    assert source.arcsec == pytest.approx(1 / np.sqrt(6))


def by_two_encoders(step: float, uneven: float):
    """What is read of an error of 30 arcsec by encoders at both shafts, the output's with steps [arcsec]."""
    turns = np.arange(6000) / 200
    error = 14 * np.cos(4 * np.pi * turns) + np.cos(2 * np.pi * turns / 30)
    file = encoders.recorded(error, 30, step, 0.01, 0.0, uneven)
    return measure(read_trace(file, TraceForm(second="output_deg"), ratio=30), ratio=30).directions[0]


@pytest.mark.thorough
@pytest.mark.parametrize("step", [1.0, 5.0])
def test_periodic_encoder_steps_are_included_in_the_interval(step: float):
    found = by_two_encoders(step, encoders.CAM)
    low, high = found.interval_arcsec
    assert low < 30 < high
    (source,) = (s for s in found.sources if s.name == "resolution")
    assert source.arcsec == pytest.approx(step / np.sqrt(3), rel=1e-3)
    by_clock = by_two_encoders(step, encoders.CLOCK)
    assert next(s for s in by_clock.sources if s.name == "resolution").arcsec == 0
    low, high = by_clock.interval_arcsec
    assert low < 30 < high


@pytest.mark.parametrize(("uneven", "in_time"), [(encoders.CAM, True), (encoders.CLOCK, False)])
def test_steps_are_seen_in_a_record_of_both_directions(uneven: float, in_time: bool):
    head, *rows = encoders.recorded(14 * np.cos(np.arange(6000) * np.pi / 50), 30, 1.0, 0.01, 0.0, uneven).splitlines()
    found = read_trace(b"\n".join([head, *rows, *rows[-2::-1]]), TraceForm(second="output_deg"), ratio=30)
    assert len(found.sweeps) == 2
    assert found.in_time is in_time
    assert found.step_arcsec == pytest.approx(1.0 if in_time else 0.0, rel=1e-3)


def test_a_missing_row_is_no_step():
    turns = np.arange(5000) / 50
    error = 14 * np.cos(4 * np.pi * turns) + np.cos(2 * np.pi * turns / 100)
    file = encoders.recorded(error, 100, 1e-3, 0.01, 0.0, encoders.CAM).splitlines()
    file.pop(1234)
    trace = read_trace(b"\n".join(file), TraceForm(second="output_deg"), ratio=100)
    assert (trace.step_arcsec, trace.in_time) == (0, False)
    assert measure(trace, ratio=100).F_ior_arcsec == pytest.approx(30, abs=0.2)


@pytest.mark.thorough
@pytest.mark.parametrize(("uneven", "least"), [(0.0, 1.5), (0.4, 0.0)])
def test_counts_at_uneven_angles_are_noise_without_a_resolution_source(uneven: float, least: float):
    turns = (np.arange(1800) + np.random.default_rng(0).uniform(0, uneven, 1800)) / 60
    output = turns / 30 + 10 * np.cos(4 * np.pi * turns) / 1296000
    columns = [np.round(turns * 16384) % 16384, np.round(output * 4194304) % 4194304]
    form = TraceForm(angle="enc1", second="enc2", angle_unit="14bit,22bit")
    (found,) = measure(read_trace(text(columns, "enc1,enc2", digits=0).encode(), form, 30), ratio=30).directions
    assert next(s for s in found.sources if s.name == "resolution").arcsec >= least
    assert found.uncertainty_arcsec < 0.6 or uneven == 0
    assert abs(found.range.value - 20) <= 2 * found.uncertainty_arcsec


@pytest.mark.thorough
def test_steps_that_may_be_the_error_are_refused():
    with pytest.raises(UntrustedError, match="at even angles in steps of 20″"):
        by_two_encoders(20.0, encoders.CAM)
    assert by_two_encoders(20.0, encoders.CLOCK).range.value == pytest.approx(30, abs=5)


def timed(speeds: list[np.ndarray], lag_s: float, play: float = 0.0):
    """A record of two encoders at speeds [turns/s] of sweeps in turn, the output read later by a lag [s]."""
    rng = np.random.default_rng(0)
    speed = np.concatenate(speeds)
    time = np.arange(len(speed)) * 0.02
    cam = np.cumsum(speed) * 0.02
    later = cam + speed * lag_s
    way = np.repeat([np.sign(each.mean()) for each in speeds], [len(each) for each in speeds])
    error = 14 * np.cos(4 * np.pi * later) + 2 * np.cos(2 * np.pi * later) + play * way / 2
    output = later / 100 + (error + 0.3 * rng.standard_normal(len(cam))) / 1296000
    file = text([time, cam * 360, output * 360], "time_s,cam_deg,output_deg", digits=8)
    return measure(read_trace(file.encode(), ratio=100), ratio=100)


UNEVEN = 1 + 0.1 * np.sin(np.arange(600) / 40)


EVEN_SPEED = np.ones(600)


def test_varying_speed_resolves_the_lag_between_encoders():
    for speeds in ([UNEVEN], [UNEVEN, -UNEVEN]):
        found = timed(speeds, 0.004, play=8.0)
        assert found.lag is not None
        assert abs(found.lag.ms - 4) <= 3 * found.lag.uncertainty_ms < 1.5
        for direction in found.directions:  # the way in between is none of the error
            assert direction.range.value == pytest.approx(30, abs=1)


def test_lag_at_one_speed_is_unresolved_and_causes_no_error():
    turning = np.append(np.ones(350), [0.5])  # a change of speed at the turning point alone
    for speeds in ([EVEN_SPEED], [EVEN_SPEED, -EVEN_SPEED], [turning, -turning[::-1]]):
        found = timed(speeds, 0.004, play=8.0)
        assert found.lag is None
        assert found.F_ior_arcsec == pytest.approx(30, abs=1)


def test_input_counts_at_even_angles_are_within_the_interval():
    rng = np.random.default_rng(2)
    phase, turns = rng.uniform(0, 2 * np.pi, 4), np.arange(30.2 * 60) / 60

    def curve(turns):
        beat = 1 + 0.2 * np.cos(2 * np.pi * turns / 30 + phase[1])
        return 12 * np.cos(4 * np.pi * turns + phase[0]) * beat + 2 * np.cos(2 * np.pi * turns + phase[2])

    output = turns / 30 + (curve(turns) + 0.4 * rng.standard_normal(len(turns))) / 1296000
    columns = [np.floor(turns * 65536) % 65536, np.floor(output * 4194304) % 4194304]
    form = TraceForm(angle="enc1", second="enc2", angle_unit="16bit,22bit")
    (found,) = measure(read_trace(text(columns, "enc1,enc2", digits=0).encode(), form, 30), ratio=30).directions
    low, high = found.interval_arcsec
    assert low <= whole_range(curve, 30) <= high
    assert found.uncertainty_arcsec > 2 / np.sqrt(12) * 1296000 / 65536 / 30  # two extremes, a count of the cam each
