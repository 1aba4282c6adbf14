"""What makers state, of simulated benches whose truth is known: approached positions and torque loops."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest

from hdassist.features.acceptance.limits import CHECKS
from hdassist.features.measuring.bench import (
    LoopRecord,
    PlaceLoop,
    PositionRecord,
    StatedQuantity,
    bench_record,
    place_loops,
    position_quantities,
    seen_range,
)
from hdassist.readers.trace import TraceForm, read_record
from hdassist.run.errors import DataError
from tests.helpers.process import SMALL, in_a_line, run
from tests.helpers.rigs import text

TARGETS, APPROACHES, REVERSAL, NOISE = 30.0 * np.arange(12), 7, 8.0, 1.0
CURVE = 12 * np.sin(np.radians(TARGETS + 20))


def record(words: str) -> PositionRecord | LoopRecord | None:
    return bench_record(read_record(io.StringIO(words), TraceForm()))


def positions(seed: int, sides: tuple[float, ...] = (1.0, -1.0), approaches: int = APPROACHES) -> str:
    target, side, _ = (each.ravel() for each in np.meshgrid(TARGETS, sides, np.arange(approaches), indexing="ij"))
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(target))
    error = np.interp(target, TARGETS, CURVE) + side * REVERSAL / 2 + noise
    return text([target, error, side], "target_deg,deviation_arcsec,approach")


def quantities(words: str, **effort: int) -> dict[str, StatedQuantity]:
    found = record(words)
    assert isinstance(found, PositionRecord)
    return {each.name: each for each in position_quantities(found, **effort)}


def test_positions_are_held_by_their_intervals():
    """Of 40 benches: the range of the true curve, and the mean half spread that such benches have."""
    runs = [quantities(positions(seed), draws=200) for seed in range(40)]
    truth = {name: np.mean([run[name].arcsec for run in runs]) for name in runs[0]} | {"positioning": np.ptp(CURVE)}
    assert set(truth) == {"positioning", "repeatability", "bidirectional"}
    for name, true in truth.items():
        held = [abs(run[name].arcsec - true) <= 2 * (run[name].uncertainty_arcsec or 0.0) for run in runs]
        assert sum(held) >= 36, name
    assert truth["bidirectional"] > REVERSAL / 2 + truth["repeatability"] / 2


def test_scatter_alone_is_no_positioning_deviation():
    target, _ = (each.ravel() for each in np.meshgrid(TARGETS, np.arange(3), indexing="ij"))
    truth = 5 * np.sin(np.radians(target + 20))
    held = []
    for seed in range(30):
        error = truth + 15 * np.random.default_rng(seed).standard_normal(len(target))
        words = text([target, error, np.ones(len(target))], "target_deg,deviation_arcsec,side")
        found = quantities(words, draws=200)["positioning"]
        held.append(abs(found.arcsec - np.ptp(truth)) <= 2 * (found.uncertainty_arcsec or 0.0))
    assert sum(held) >= 27


def test_positions_from_one_side_and_once():
    assert set(quantities(positions(1, (1.0,)))) == {"positioning", "repeatability"}
    (once,) = quantities(positions(1, (1.0,), 1)).values()
    assert (once.name, once.uncertainty_arcsec) == ("positioning", None)
    angles = text([TARGETS, np.mod(TARGETS + CURVE / 3600, 360)], "Soll [deg],Istwert [deg]", digits=9)
    assert quantities(angles)["positioning"].arcsec == pytest.approx(np.ptp(CURVE), abs=1e-3)
    one_position = text([np.zeros(7), CURVE[:7], np.ones(7)], "target_deg,deviation_arcsec,side")
    assert set(quantities(one_position)) == {"repeatability"}


def loops(places: tuple[float, ...], noise: float = 0.2) -> str:
    """Loops of 40 N·m: 3″/N·m, play of 20″ closed over some N·m, friction that opens the loop by twice the place."""
    torque = np.concatenate([np.arange(0, 40, 0.5), np.arange(40, -40, -0.5), np.arange(-40, 41, 0.5)])
    way = np.sign(np.gradient(torque))
    columns = [np.tile(torque, len(places))]
    twist = [3 * torque + 10 * np.tanh(torque / 4) - way * place for place in places]
    columns.append(np.concatenate(twist) + noise * np.random.default_rng(2).standard_normal(len(columns[0])))
    return text([*columns, np.repeat(places, len(torque))], "torque_Nm;twist_arcsec;place", ";")


def test_loops_have_hysteresis_and_lost_motion_at_each_place():
    found = record(loops((4.0, 9.0)))
    assert isinstance(found, LoopRecord)
    by_place = place_loops(found, rated=40.0)
    lost = 2 * (3 * 1.6 + 10 * np.tanh(0.4))
    for loop, place in zip(by_place, (4.0, 9.0), strict=True):
        assert isinstance(loop, PlaceLoop)
        for (value, unsure), true in ((loop.hysteresis, 2 * place), (loop.lost_motion, lost)):
            assert abs(value - true) <= 3 * unsure
            assert 0 < unsure < 0.5
    half = loops((4.0,)).split("\n40.00000;")[0] + "\n"
    rising = record(half)
    assert isinstance(rising, LoopRecord)
    with pytest.raises(DataError, match=r"place 4: no complete rising branch from -1\.6 to 1\.6"):
        place_loops(rising, rated=40.0)
    still = record(text([np.full(30, 4.0), np.arange(30.0)], "torque_Nm;twist_arcsec", ";"))
    assert isinstance(still, LoopRecord)
    with pytest.raises(DataError, match="place 1: the torque does not increase and decrease"):
        place_loops(still, rated=40.0)


@pytest.mark.parametrize("names", ["cam_deg,error_arcsec", "angle,error,torque_Nm", "motor_deg,load_deg,target"])
def test_a_trace_is_none_of_them(names: str):
    columns = [np.arange(30.0)] * len(names.split(","))
    assert record(text(columns, names)) is None


def test_the_page_has_values_as_accept_takes_them(tmp_path):
    (tmp_path / "positions.csv").write_text(positions(1))
    (tmp_path / "loops.csv").write_text(loops((4.0, 9.0)))
    page = in_a_line(run("measure", "positions.csv", cwd=tmp_path).stdout)
    assert "positions.csv, 168 rows: unidirectional positioning 2" in page
    assert "--value 'repeatability=" in page
    kept = run("measure", "positions.csv", "--archive", "rig", "--serial", "17-1", cwd=tmp_path)
    assert kept.returncode == 2
    assert "positions and torque loops cannot be stored" in kept.stderr
    told = json.loads(run("measure", "positions.csv", "--json", cwd=tmp_path).stdout)
    value = next(q for q in told["quantities"] if q["name"] == "repeatability")
    low, high = value["interval_arcsec"]
    assert low < value["value_arcsec"] < high
    given = f"repeatability={value['value_arcsec']:.3g}±{2 * value['standard_uncertainty_arcsec']:.2g}"
    for limit, code in (("20", 0), ("0.1", 3)):
        done = run("accept", SMALL, "--limit", f"repeatability={limit}", "--value", given, "--measured-only", "-q")
        assert done.returncode == code
    beside = run("measure", "loops.csv", "--drive", SMALL, "--details", cwd=tmp_path).stdout
    assert "manufacturers' catalogues" in in_a_line(beside)
    words = in_a_line(beside)
    assert f"next hdassist accept {SMALL}" in words
    assert "--limit hysteresis_loss=LIMIT --limit lost_motion=LIMIT" in words
    assert "rated torque 40.5 N·m: the largest torque of the loop; small has no operation.rated" in words
    assert '"torque_Nm": torque, N·m' in words
    assert "places" in beside


def test_a_limit_that_nothing_tells_is_never_passed():
    unpredicted = [check.field for check in CHECKS if not check.needs]
    assert unpredicted == [
        "positioning", "repeatability", "bidirectional", "hysteresis_loss", "starting_torque",
        "backdrive_torque", "ratchet_torque",
    ]  # fmt: skip
    given = ("--limit", "ratchet_torque=100", "--value", "ratchet_torque=150±1")
    assert run("accept", SMALL, *given, "-q").returncode == 0
    assert run("accept", SMALL, *given, "--limit", "starting_torque=1", "-q").returncode == 6


def test_lower_bound_of_positions_stays_below_a_scattered_true_range(tmp_path):
    """Of 60 benches with a scatter of three times the true range, at most a few have it above that range."""
    above = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        target = np.tile(TARGETS, 3)
        deviation = 5 * np.sin(np.radians(target)) + 30 * rng.standard_normal(len(target))
        found = record(text([target, deviation, np.ones(len(target))], "target_deg,deviation_arcsec,side"))
        assert isinstance(found, PositionRecord)
        above += seen_range(found, position_quantities(found, draws=300)).at_least_arcsec > 10
    assert above <= 4


def test_at_least_is_the_same_in_measure_and_accept(tmp_path):
    (tmp_path / "run.csv").write_text(positions(2))
    told = json.loads(run("measure", "run.csv", "--json", cwd=tmp_path).stdout)["F_ior"]
    asked = ("--limit", "F_ior@4=40", "--measured", "4=run.csv", "--measured-only", "--json")
    budget = ("--budget", "encoder=0,coupling=0,reseating=0,temperature=0")
    (check,) = json.loads(run("accept", SMALL, *asked, *budget, cwd=tmp_path).stdout)["checks"]
    assert check["value"] - check["expanded_uncertainty"] == pytest.approx(told["at_least_arcsec"])
    assert told["at_least_arcsec"] < told["range_arcsec"]


@pytest.mark.parametrize(
    ("uncertainty", "noise", "ends"), [(10.0, 0.0, (30, 70)), (10.0, 45.0, (5, 70)), (10.0, 80.0, (0, 70))]
)
def test_stated_uncertainty_reaches_both_ends_of_the_interval(uncertainty, noise, ends) -> None:
    quantity = StatedQuantity("positioning", 50.0, uncertainty, "36 approaches", noise_arcsec=noise)
    assert quantity.interval_arcsec == pytest.approx(ends)
    lower, upper = quantity.interval_arcsec
    assert max(0.0, quantity.arcsec - quantity.expanded_arcsec) <= lower
    assert quantity.arcsec + quantity.expanded_arcsec >= upper
    assert StatedQuantity("positioning", 50.0, None, "12 approaches").interval_arcsec is None
