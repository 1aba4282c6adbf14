"""The path of docs/explore.md: its keys typed into the explorer, and its numbers held against screen and `check`."""

from __future__ import annotations

import asyncio
import json
import re
import shlex
from pathlib import Path

import pytest

from benchmarks.explorer_pictures import DOCS, key_lines, played, rows
from tests.helpers.process import run

TABLE = re.findall(
    r"^\| `(e .*?)` \| (.*?) \| (.*?) \| (.*?) \| (.*?) \|$", (DOCS / "explore.md").read_text(), re.MULTILINE
)


def test_path_table_contains_every_key_line_that_changes_the_drive() -> None:
    assert [cells[0] for cells in TABLE] == [line for line in key_lines() if line.startswith("e ")]


@pytest.mark.slow
def test_numbers_of_the_documented_path_are_on_the_screen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    screens: dict[str, tuple[str, str]] = {}

    async def play() -> None:
        async for line, app, _ in played():
            screens[line] = " ".join(" ".join(rows(app)[:6]).split()), app.session.command("check")

    asyncio.run(play())
    assert list(screens) == key_lines()
    page = (DOCS / "explore.md").read_text()
    for keys, F_ior, ends, verdict, kept in TABLE:
        told, command = screens[keys]
        assert f" {F_ior} {ends} 45 {verdict}" in told and f" {kept} " in told
        assert f"\n{command}\n" in page
        answer = json.loads(run(*shlex.split(command)[1:], "--json", cwd=tmp_path).stdout)
        (point,) = answer["operating_points"]
        belief = point["belief"]
        assert f"{belief['p50_arcsec']:.2f}" == F_ior and point["verdict"] == verdict
        assert f"{belief['p5_arcsec']:.1f} to {belief['p95_arcsec']:.1f}" == ends
        assert f"{100 * belief['probability']:.0f} %" == kept
    saved = json.loads(run("check", "known.yaml", "--json", cwd=tmp_path).stdout)
    assert saved["operating_points"] == answer["operating_points"]
