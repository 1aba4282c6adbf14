"""Short forms of `python -m tests.fuzz faults`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz import faults
from tests.fuzz.faults import CASES, OLD, Tally, Usual, faults_of_files, folder, kills, signals, usual
from tests.fuzz.surroundings import SURROUNDINGS, run_in, two_at_once, unavailable

pytestmark = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="needs /proc")

TRIED = [
    ("disk full", "new"), ("folder read-only", "new"), ("folder of another user", "new"), ("no environment", "new"),
    ("LC_ALL=C without UTF-8", "new"), ("all streams closed", "new"), ("shared memory full", "lot"),
    ("shared memory read-only", "lot"), ("12 open files", "lot"), ("350 MB of addresses", "lot"),
    ("1 processes", "lot"), ("3 processes", "lot"),
]  # fmt: skip
GIVES_LITTLE = {one.name: one for one in SURROUNDINGS}


@pytest.mark.slow
def test_killed_run_leaves_no_partial_files_and_can_continue():
    tally = kills(3, 0, ("new", "lot"))
    assert tally.runs == 3
    assert not tally.broken


@pytest.mark.thorough
def test_a_run_that_is_told_to_stop_leaves_nothing(monkeypatch):
    monkeypatch.setattr(faults, "SOON", 60.0)  # how soon is for the study of many, on a machine without other work
    tally = signals(3, 0, seconds=2.0)
    assert tally.runs == 3
    assert not tally.broken


def test_run_that_ends_before_its_signal_counts_as_done(monkeypatch):
    monkeypatch.setattr(faults, "COMMAND", ["true"])
    tally = signals(1, 0, seconds=8.0)
    assert (tally.runs, tally.done, tally.broken) == (1, 1, [])


@pytest.mark.thorough
@pytest.mark.parametrize(("surrounding", "name"), TRIED)
def test_scarce_system_resources_give_a_result_or_a_refusal(surrounding: str, name: str):
    if reason := unavailable(GIVES_LITTLE[surrounding]):
        pytest.skip(reason)
    tally = Tally()
    run_in(GIVES_LITTLE[surrounding], CASES[name], usual(CASES[name]), tally)
    assert not tally.broken


@pytest.mark.thorough
def test_two_runs_at_once_keep_one_file_whole():
    tally = two_at_once(("lot",), (0.1,))
    assert tally.runs == 1
    assert not tally.broken


def test_partial_lost_or_foreign_files_are_detected():
    case, whole = CASES["lot"], Usual(0, "", {"a.csv": "whole", "a.xml": "whole", "a.jsonl": "one\ntwo\n"}, 1.0)
    with folder(old=("a.csv",)) as place:
        (place / "a.xml").write_text("wh")
        (place / "a.jsonl").write_text("one\nx")
        (place / "lot.csv").write_text("")
        (place / "a.jsonl.lock").touch()
        (place / "run.csv").unlink()
        said = faults_of_files(case, place, ("a.csv",), whole, ended_in_order=True)
        assert sorted(text.split(":")[0] for text in said) == ["a.jsonl", "a.jsonl.lock", "a.xml", "lot.csv", "run.csv"]
        assert (place / "a.csv").read_text() == OLD
