"""docs/performance.md: its generator runs on this engine, and every target has its reason should it be missed."""

import pytest

from benchmarks import engine, processes, proposals
from benchmarks.__main__ import joined
from benchmarks.page import page
from benchmarks.rows import named, rows
from benchmarks.words import NUMPY, REASONS, WALK, WARM_DAQP
from hdassist import load_preset
from hdassist.drive.error.error_map import Batch, ErrorMap
from hdassist.drive.error.extremes import many_extremes
from hdassist.drive.model.contacts import contact_system
from hdassist.drive.solve.formulation import formulate
from tests.helpers.process import SMALL
from tests.helpers.support import PROVEN

M_G = 4.0  # N*m


def slow() -> dict:
    """Measurements that miss every target."""
    us = {order: {WALK: 99.0, NUMPY: 200.0, WARM_DAQP: 100.0} for order in ("cycle", "search")}
    run = {"runs": 1, "median_s": 90.0, "processor_s": 90.0, "one_process_MB": 900.0, "all_processes_MB": 900.0}
    runs = [
        run
        | {"command": p.words, "over": p.over and [p.over[0].words, p.over[1]], "processor_s": 90.0 if p.over else 1}
        for p in processes.PROCESSES
    ]
    summary = proposals._summary("random drives", [proposals.Compared((10.0, 9.0), (20200, 3800), (0.1, 0.04))])
    sizes = [{"z_g": z, "M_g": 80.0, "states": 1, "candidates": 1, "us": z**2} for z in (100, 400)]
    stations = [{"stations": n, "M_g": 80.0, "candidates": n, "us": n} for n in (1, 5)]
    search = {"M_g": 80.0, "searches": 12, "F_ior_arcsec": 9.0, "bias": -0.1, "rms": 0.9, "worst": 9.0, "over": 3}
    search |= {"states": [400.0, 300.0, 99.0], "ms": [9.0, 8.0]}
    return {
        "machine": {"processor": "P", "cores": 2, "load": 0.1, "python": "3"},
        "engine": [{"M_g": 80.0, "us": us, "certificate_us": 5.0, "cvxpy_us": {"DAQP": 9000.0}}],
        "processes": {"runs": runs, "first_output_s": {p.words: 9.0 for p in processes.WORDS_FIRST}},
        "proposals": [summary],
        "draws": [search],
        "growth": sizes,
        "coned": stations,
        "tolerance": [
            {"case": "vzp160", "value_ms": 99.0, "drive_ms": 999.0, "law_ms": 9.0, "drives": 2, "efficiency": 0.1}
        ],
        "explorer": [{"name": "vzp160", "first_s": 1.0, "proven_s": 2.0, "check_s": 4.0}],
    }


def test_every_target_that_may_be_missed_has_one_reason():
    targets = list(rows(slow()))
    assert [row.work for row in targets if row.met] == []
    assert {row.key for row in targets} == set(REASONS)


def test_the_page_has_every_target_and_part():
    made = page(slow())
    for row in rows(slow()):
        assert f"| {row.work} | {row.asked} | {row.got} | **missed** |" in made
    for run in slow()["processes"]["runs"]:
        assert f"| {named(run['command'])} | 1 | 90.00 |" in made
    assert "| random drives | 1 | 10.00″ to 10.00″ | 20200, 100 | 3800, 40 | 1.0e+00″ (10.00%) | 1 |" in made


def test_the_page_has_the_run_before_beside_each_number():
    fast = slow()
    fast["processes"]["runs"] = [run | {"processor_s": 1.5} for run in slow()["processes"]["runs"]]
    made = page(slow(), fast)
    asked = "processor time of `hdassist check vzp160`, relative to `python -c import cvxpy`"
    assert f"| {asked} | ≤ 3.8 | 1, met | 90 | **missed** |" in made
    assert "| ≤ 9 µs | 99 µs | 99 µs | **missed** |" in made


def test_parts_that_were_measured_anew_are_named():
    later = {"engine": slow()["engine"], "machine": {"load": 3.5}}
    made = page(joined(slow(), later))
    assert "Measured again later, and compared only within each part: engine at load 3.5." in made
    assert "load 0.1 at the start" in made
    assert "again later" not in page(slow())


def test_engines_take_turns_over_the_states_that_proposals_solve():
    drive = load_preset(SMALL)
    batches = engine.searched(drive, M_G)
    assert sum(map(len, batches)) == many_extremes(ErrorMap(drive, M_G), Batch.of(drive)).certificate.states
    found = engine._engines(formulate(contact_system(drive)), M_G * 1e3, [batches[0][:100]], 1)
    assert list(found) == [*(words for words, _ in engine.walks()), NUMPY, WARM_DAQP]


def test_proposals_are_compared_with_every_state():
    drive = load_preset(SMALL)
    found = proposals.compared((drive, M_G))
    assert found
    assert found.F_ior[0] == pytest.approx(ErrorMap(drive, M_G).extremes().first, abs=PROVEN)
    assert found.missed == pytest.approx(0, abs=0.01)
