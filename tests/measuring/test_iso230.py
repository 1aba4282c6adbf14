"""Figures of ISO 230-2 of approached positions: worked by hand, by another program, and as a file in either form."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdassist.drive.model.geometry import Array
from hdassist.features.measuring.bench import PositionRecord, bench_record, position_quantities
from hdassist.features.measuring.iso230 import PositioningTest, positioning_test
from hdassist.readers.trace import TraceForm, read_record
from hdassist.readers.words import run_side_in
from hdassist.run.errors import DataError, PresetError
from tests.helpers.process import SMALL, run

WIDE_NAMES = "target_deg,run1_fwd_arcsec,run1_bwd_arcsec,run2_fwd_arcsec,run2_bwd_arcsec"


def positions_of(text: str) -> PositionRecord:
    record = bench_record(read_record(io.StringIO(text), TraceForm()))
    assert isinstance(record, PositionRecord)
    return record


def figures_of(test: PositioningTest | None) -> dict[str, float]:
    assert test is not None
    return {figure.symbol: figure.arcsec for figure in test.figures}


def long_table(forward: Array, backward: Array) -> str:
    """A row for each approach of positions 10 degrees apart; deviations [arcsec], shape (positions, runs) each."""
    rows = ["target_deg,deviation_arcsec,side"]
    for side, deviations in ((1, forward), (-1, backward)):
        for position, runs in enumerate(deviations):
            rows += [f"{10 * position},{deviation!r},{side}" for deviation in runs.tolist()]
    return "\n".join(rows) + "\n"


def wide_table(forward: Array, backward: Array) -> str:
    """The same with a row for each position, and a column for each run from a side."""
    runs = forward.shape[1]
    names = ["target_deg", *(f"Run {run + 1} {side} [arcsec]" for run in range(runs) for side in "+-")]
    rows = [";".join(names)]
    for position in range(len(forward)):
        cells = [str(10 * position)]
        for pair in zip(forward[position].tolist(), backward[position].tolist(), strict=True):
            cells += map(repr, pair)
        rows.append(";".join(cells))
    return "\n".join(rows) + "\n"


def test_two_positions_worked_by_hand():
    """Means 1 and 5 forward, -2 and 4 backward; standard deviation sqrt(2) at the first position, 0 at the second."""
    text = f"{WIDE_NAMES}\n0,0,-3,2,-1\n90,5,4,5,4\n"
    found = figures_of(positioning_test(positions_of(text)))
    s = np.sqrt(2)
    assert found == pytest.approx({
        "E+": 4, "R+": 4 * s, "A+": max(1 + 2 * s, 5) - (1 - 2 * s),
        "E-": 6, "R-": 4 * s, "A-": 4 - (-2 - 2 * s),
        "B": 3, "B_mean": 2, "M": 4.5 - (-0.5), "E": 7, "R": 4 * s + 3, "A": 5 - (-2 - 2 * s),
    })  # fmt: skip


@pytest.mark.thorough
@given(st.integers(2, 6), st.integers(2, 5), st.integers(0, 2**31))
def test_positioning_figures_agree_with_another_program_in_both_file_forms(positions: int, runs: int, seed: int):
    rng = np.random.default_rng(seed)
    forward, backward = rng.normal(0, 20, (2, positions, runs))
    both = np.stack([forward, backward])
    mean, deviation = both.mean(axis=2), both.std(axis=2, ddof=1)
    reversal = mean[0] - mean[1]
    expected = {
        "B": np.abs(reversal).max(),
        "B_mean": reversal.mean(),
        "M": np.ptp(mean.mean(axis=0)),
        "E": np.ptp(mean),
        "R": max(*(2 * deviation.sum(axis=0) + np.abs(reversal)), *(4 * deviation).ravel()),
        "A": (mean + 2 * deviation).max() - (mean - 2 * deviation).min(),
    }
    for table in (long_table, wide_table):
        found = figures_of(positioning_test(positions_of(table(forward, backward))))
        assert {symbol: found[symbol] for symbol in expected} == pytest.approx(expected, abs=1e-9)


@pytest.mark.thorough
def test_uncertainty_of_the_mean_reversal_is_its_spread_over_tests():
    """Of 400 tests of 4 positions with 3 approaches from each side and a scatter of 2 arcsec."""
    rng, reversals, stated = np.random.default_rng(3), [], []
    for _ in range(400):
        forward, backward = rng.normal(0, 2.0, (2, 4, 3)) + np.array([5.0, 0.0])[:, None, None]
        test = positioning_test(positions_of(long_table(forward, backward)))
        assert test is not None
        assert test.reversal_uncertainty_arcsec is not None
        reversals.append(figures_of(test)["B_mean"])
        stated.append(test.reversal_uncertainty_arcsec)
    assert np.mean(stated) == pytest.approx(np.std(reversals), rel=0.1)
    assert np.mean(reversals) == pytest.approx(5.0, abs=0.15)


def test_approaches_that_do_not_determine_a_figure_leave_it_out():
    once = positioning_test(positions_of("target_deg;fwd [arcsec];bwd [arcsec]\n0;1;2\n90;3;5\n"))
    assert set(figures_of(once)) == {"E+", "E-", "B", "B_mean", "M", "E"}
    assert once is not None
    assert (once.approaches, once.is_complete, once.reversal_uncertainty_arcsec) == (1, False, None)
    one_side = positioning_test(positions_of("target_deg;run 1 [arcsec];run 2 [arcsec]\n0;1;2\n90;3;5\n"))
    assert set(figures_of(one_side)) == {"E+", "R+", "A+"}
    gap = "target_deg,deviation_arcsec,side\n0,1,1\n0,2,-1\n90,3,1\n90,4,1\n"
    assert set(figures_of(positioning_test(positions_of(gap)))) == {"E+"}  # 90 was approached from one side


def test_one_position_has_a_reversal_value_and_no_positioning(tmp_path):
    record = positions_of("target_deg,deviation_arcsec,side\n0,-10,1\n0,-12,1\n0,6,-1\n0,4,-1\n")
    assert {quantity.name for quantity in position_quantities(record)} == {"repeatability", "bidirectional"}
    assert figures_of(positioning_test(record))["B"] == pytest.approx(16)
    with pytest.raises(DataError, match="one approach"):
        position_quantities(positions_of("target_deg,deviation_arcsec,side\n0,-10,1\n"))
    (tmp_path / "place.csv").write_text("target_deg,deviation_arcsec,side\n0,-10,1\n0,-12,1\n0,6,-1\n0,4,-1\n")
    answer = json.loads(run("measure", "place.csv", "--json", cwd=tmp_path).stdout)
    assert answer["F_ior"] is None
    values = {figure["symbol"]: figure["value_arcsec"] for figure in answer["iso230_2"]["figures"]}
    assert values["B_mean"] == pytest.approx(-16)
    assert answer["iso230_2"]["reversal_standard_uncertainty_arcsec"] == pytest.approx(np.sqrt(2))
    refused = run("accept", SMALL, "--limit", "F_ior@1=30", "--measured", "1=place.csv", cwd=tmp_path)
    assert refused.returncode == 4


@pytest.mark.parametrize(
    ("name", "side"),
    [
        ("run1_fwd_arcsec", 1), ("run1_bwd_arcsec", -1), ("Lauf 3 vorwärts [']", 1), ("Lauf 3 rückwärts [']", -1),
        ("Run 2 - [arcsec]", -1), ("Run 2 + [arcsec]", 1), ("cycle 4", 0), ("проход 1 назад", -1), ("↓ 2", -1),
        ("run 1 rev [arcsec]", -1), ("run1_rev_arcsec", 0), ("run 1 rev", 0), ("measured [rev]", 0), ("run 1 [rev]", 0),
        ("Lauf 2 Rückweg", -1), ("run 2 negative", -1),
        ("forward", 1), ("deviation_arcsec", 0), ("temperature", 0), ("error [um-]", 0), ("fwd-bwd", 0), ("up/down", 0),
    ],
)  # fmt: skip
def test_the_side_of_a_run_is_in_its_name(name: str, side: int):
    assert run_side_in(name) == side


@pytest.mark.parametrize("name", ["run 1 return [arcsec]", "run 1 rev", "run 2 [arcsec]"])
def test_run_without_a_side_beside_runs_with_one_is_refused(name: str):
    with pytest.raises(PresetError, match="does not state the side"):
        positions_of(f"target_deg;run 1 fwd [arcsec];{name}\n0;1;2\n90;3;5\n")


def test_a_run_in_reverse_is_backward():
    reverse, backward = (
        figures_of(
            positioning_test(positions_of(f"target_deg;run 1 fwd [arcsec];run 1 {way} [arcsec]\n0;1;2\n90;3;7\n"))
        )
        for way in ("rev", "bwd")
    )
    assert reverse == backward
    assert reverse["B"] == pytest.approx(4)


def test_run_unit_is_converted_and_an_unknown_unit_is_refused(tmp_path):
    arcmin = positions_of("target_deg;fwd [arcmin];bwd [arcmin]\n0;1;2\n90;3;5\n")
    assert figures_of(positioning_test(arcmin))["B"] == pytest.approx(120)
    (tmp_path / "length.csv").write_text("target_deg;run1 fwd [um];run1 bwd [um]\n0;1;2\n90;3;5\n")
    assert run("measure", "length.csv", cwd=tmp_path).returncode == 4


def test_runs_of_angles_give_the_figures_of_their_deviations():
    rng = np.random.default_rng(4)
    forward, backward = rng.normal(0, 20, (2, 5, 3))
    names = ["target_deg", *(f"run {run + 1} measured {way} [deg]" for run in range(3) for way in ("fwd", "bwd"))]
    rows = [";".join(names)]
    for position in range(5):
        cells = [str(10 * position)]
        for pair in zip(forward[position].tolist(), backward[position].tolist(), strict=True):
            cells += [f"{10 * position + 350 + deviation / 3600:.10f}" for deviation in pair]  # from another zero
        rows.append(";".join(cells))
    found = figures_of(positioning_test(positions_of("\n".join(rows) + "\n")))
    expected = figures_of(positioning_test(positions_of(long_table(forward, backward))))
    assert found == pytest.approx(expected, abs=1e-5)
    with pytest.raises(PresetError, match="some runs contain deviations"):
        positions_of("target_deg;run 1 measured fwd [deg];run 1 bwd [arcsec]\n0;0;1\n90;90;2\n")
