"""Play, friction and lag of records in both directions, of simulated rigs in time whose truth is known."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest

from hdassist.features.measuring.measure import Measurement, measure
from hdassist.readers.trace import TraceForm, read_trace
from tests.helpers.process import in_a_line, run
from tests.helpers.rigs import Array, text

RATIO = 30


def there_and_back(
    seed: int,
    speeds: tuple[float, ...],
    play: float,
    lag_ms: float,
    friction: float = 0.0,
    uneven: float = 0.0,
    first: int = 1,
) -> str:
    """A file of sweeps over the cycle there and back at speeds [turns/s], read every 10 ms, the output lag_ms later.

    play [arcsec] and friction [arcsec s/turn] hold the output back in either direction; uneven: share of the speed;
    first: row of a way, by 0 the turning point is read on the way back.
    """
    rng, rows, start = np.random.default_rng(seed), [], 0.0
    phases = rng.uniform(0, 2 * np.pi, 3)

    def turns(time: Array, speed: float, way: int) -> Array:
        """Cam angle; ways back begin at the end."""
        gone = speed * time + uneven * speed / 1.7 * np.sin(1.7 * time)
        return gone if way > 0 else RATIO - gone

    def error(cam: Array) -> Array:
        x, p = 2 * np.pi * cam, phases
        return np.asarray(9 * np.cos(2 * x + p[0]) * (1 + 0.2 * np.cos(x / RATIO)) + 3 * np.cos(x + p[1]))

    for speed in speeds:
        for way in (1, -1):
            time = np.arange(first, round(100 * RATIO / speed) + first) / 100  # 1: the end is reached by the way to it
            late = turns(time + lag_ms / 1000, speed, way)
            pace = np.gradient(turns(time, speed, way), time)
            output = late / RATIO * 360 + error(late) / 3600 - (way * play / 2 + friction * pace) / 3600
            output += 0.4 / 3600 * rng.standard_normal(len(time))
            rows.append(np.array([start + time, turns(time, speed, way) * 360, output]))
            start += time[-1] + 0.5
    return text(np.concatenate(rows, axis=1), "time_s,cam_deg,output_deg", digits=8)


def measured(*rig, **how) -> Measurement:
    return measure(
        read_trace(io.StringIO(there_and_back(*rig, **how)), TraceForm(second="output_deg"), RATIO), ratio=RATIO
    )


@pytest.mark.thorough
def test_play_and_lag_are_told_apart_by_two_speeds():
    """At twice the uncertainty; `python -m benchmarks.records` has more."""
    held = np.zeros(2)
    for seed in range(10):
        rng = np.random.default_rng([seed, 1])
        play, lag = rng.uniform(0, 20), rng.uniform(-1, 1)
        found = measured(seed, (1.0, 2.5), play, lag)
        reversal = found.reversal
        assert reversal.by == "speeds of sweeps"
        held += (
            abs(reversal.lost_motion_arcsec - play) <= 2 * reversal.lost_motion_standard_uncertainty_arcsec,
            abs(found.lag.ms - lag) <= 2 * found.lag.uncertainty_ms,
        )
    assert (held >= 8).all(), held


def test_friction_that_grows_with_speed_is_no_lost_motion():
    found = measured(3, (1.0, 2.5), 8.0, 0.0, friction=2.0)
    assert found.reversal.lost_motion_arcsec == pytest.approx(8.0, abs=0.3)
    per_ms = 1e-3 * 1296000 / RATIO  # arcsec s/turn
    assert found.lag.ms == pytest.approx(-2.0 / per_ms, abs=0.02)  # which it looks like


@pytest.mark.thorough
@pytest.mark.parametrize(("seed", "speeds", "play"), [(3, (3.0, 6.0), 3.0), (0, (0.6, 1.2), 40.0)])
def test_turning_point_read_after_reversal_is_neither_drift_nor_spike(seed, speeds, play):
    """It seems to be the last row of the way forth, on the wrong side of the play."""
    found = measured(seed, speeds, play, 0.0, friction=0.1 * play, first=0)
    assert not found.warnings
    reversal = found.reversal
    assert abs(reversal.lost_motion_arcsec - play) <= 2 * reversal.lost_motion_standard_uncertainty_arcsec


def test_varying_speed_within_sweeps_separates_lost_motion_from_lag():
    found = measured(4, (1.5,), 8.0, 0.8, uneven=0.3)
    assert found.reversal.by == "speeds within sweeps"
    assert (
        abs(found.reversal.lost_motion_arcsec - 8.0) <= 3 * found.reversal.lost_motion_standard_uncertainty_arcsec + 0.3
    )
    assert abs(found.lag.ms - 0.8) <= 3 * found.lag.uncertainty_ms


@pytest.mark.thorough
def test_page_gives_the_effect_of_a_lag_at_one_speed(tmp_path):
    found = measured(5, (1.5,), 8.0, 0.5)
    per_ms = 2 * 1.5 * 1e-3 * 1296000 / RATIO
    assert found.lag is None
    assert found.reversal.arcsec_per_ms == pytest.approx(per_ms, rel=0.01)
    assert found.reversal.lost_motion_arcsec == pytest.approx(0.5 * per_ms - 8.0, abs=0.3)
    (tmp_path / "run.csv").write_text(there_and_back(5, (1.5,), 8.0, 0.5))
    page = run("measure", "run.csv", "--ratio", str(RATIO), "--second", "output_deg", "--no-plot", cwd=tmp_path).stdout
    words = in_a_line(page)
    assert re.search(
        r"reversal lost motion 5\d\.\d\d ± 0\.\d\d″ \(k = 2\) at reversal .* encoder lag \(130″ per ms; record", words
    )
