"""Answers on standard output that a device takes in part only: exit code 4, as on a full one, and never 0."""

from __future__ import annotations

import resource
import subprocess
from pathlib import Path

import pytest

from tests.helpers.process import CLEAN, COMMAND, TINY

ROOM = 512  # bytes that the file of standard output takes

WHOLE_CODE = {"PYTHONDONTWRITEBYTECODE": "1"}  # which the limit would cut off too
ACCEPT = ("accept", TINY, "--value", "F_ior@4=10±1", "--limit", "F_ior@4=20", "--measured-only")
WRITERS = {
    "text": ("presets", "schema"),
    "page": ("explain", "F_ior"),
    "help": ("check", "-h"),
    "json": (*ACCEPT, "--json"),
    "junit": (*ACCEPT, "--junit", "-"),
    "csv": ("presets", "list", "--json"),
    "card": ("plan", TINY, "--positions", "40", "--draws", "0", "--approach", "-"),
}


@pytest.mark.thorough
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("words", WRITERS.values(), ids=WRITERS)
def test_an_answer_that_is_cut_off_is_no_success(words: tuple[str, ...], unbuffered: str, tmp_path: Path) -> None:
    file = tmp_path / "answer"
    with file.open("wb") as stream:
        done = subprocess.run(
            [*COMMAND, *words], stdout=stream, stderr=subprocess.PIPE, cwd=tmp_path, text=True, encoding="utf-8",
            env=CLEAN | WHOLE_CODE | {"PYTHONUNBUFFERED": unbuffered}, check=False, timeout=120,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, ROOM)),
        )  # fmt: skip
    assert file.stat().st_size <= ROOM
    assert done.returncode == 4, done.stderr
    assert "cannot write" in done.stderr
