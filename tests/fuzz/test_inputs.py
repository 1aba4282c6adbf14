"""Short form of `python -m tests.fuzz inputs`."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from tests.fuzz import mutate
from tests.fuzz.inputs import Outcome, judged, made, outcomes, unsolved
from tests.fuzz.seeds import KINDS, Input
from tests.helpers.process import run

FEW = 156


@pytest.fixture(scope="module")
def found() -> list[Outcome]:
    return list(outcomes(range(1, FEW + 1), seed=14))


@pytest.mark.thorough
@pytest.mark.parametrize("kind", KINDS)
def test_no_input_causes_a_bug_or_excessive_time_or_memory(found: list[Outcome], kind: str) -> None:
    ours = [outcome for outcome in found if outcome.kind == kind]
    assert len(ours) == FEW // len(KINDS)
    assert [outcome for outcome in ours if outcome.fault] == []


@pytest.mark.thorough
def test_many_inputs_are_refused_and_many_are_read(found: list[Outcome]) -> None:
    codes = Counter(outcome.code in (2, 4) for outcome in found)
    assert min(codes[True], codes[False]) > FEW / 10


def test_inputs_are_the_same_again() -> None:
    assert [made(k, 3) for k in range(30)] == [made(k, 3) for k in range(30)]
    assert made(5, 3) != made(5, 4)
    assert made(7, 3, ["trace"]).kind == "trace"


@pytest.mark.thorough
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "options"])
def test_seeds_are_meant_as_they_are(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, kind: str) -> None:
    for name in ("yaml_text", "json_text", "table_text"):
        monkeypatch.setattr(mutate, name, lambda given, rng: given.encode())
    codes = set()
    for k in range(8):
        given = KINDS[kind](np.random.default_rng([1, k]))
        codes.add(judged(k, given, _folder(tmp_path, k), solves=False).code)
    assert codes & {0, 5, 6}


def test_a_file_that_is_lost_is_seen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    args = ("presets", "new", "x", "-o", "mine.txt", "--force")
    assert judged(0, Input("options", args, {"mine.txt": b"mine\n"}), _folder(tmp_path, 0), solves=True).fault == ""
    monkeypatch.setattr("hdassist.interface.terminal.streams.require_writable", lambda path, force: None)
    lost = judged(1, Input("options", args[:-1], {"mine.txt": b"mine\n"}), _folder(tmp_path, 1), solves=True)
    assert lost.fault == "mine.txt is changed"


def test_an_exception_and_a_process_that_dies_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdassist.drive.loading.read_preset", lambda name: 1 / 0)
    seen = list(outcomes([1, 2, 3], 0, ["preset"]))
    assert all("ZeroDivisionError" in outcome.fault for outcome in seen)
    monkeypatch.setattr("tests.fuzz.inputs.judged", lambda *_, **__: __import__("os")._exit(1))
    assert [outcome.fault for outcome in outcomes([1, 2], 0)] == ["died"] * 2


def test_what_is_not_solved_says_so() -> None:
    with unsolved():
        done = run("check", "vzp160")
    assert done.returncode == 5
    assert "not solved here" in done.stderr


def _folder(path: Path, k: int) -> Path:
    (path / str(k)).mkdir()
    return path / str(k)
