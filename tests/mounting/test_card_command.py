"""`hdassist mount --card` as an assembler meets it: files, languages, refusals."""

from __future__ import annotations

import json
from datetime import date

import pytest

from tests.helpers.process import TINY, run

QUICK = ("mount", TINY, "--set", "mounting.holes=4", "--torque", "4", "--set", "numerics.n_max=8", "--jobs", "1")


def test_cards_are_written_beside_the_answer(tmp_path):
    target = tmp_path / "card.html"
    result = run(*QUICK, "--card", str(target), "--serial", "17-<042>", "--json")
    assert (result.returncode, result.stderr) == (0, f"wrote {target}\n")
    told = json.loads(result.stdout)
    page = target.read_text(encoding="utf-8")
    assert told["instruction"].partition(" F'_ior: ")[0] in page
    assert "17-&lt;042&gt;" in page
    assert told["preset"]["sha256"][:12] in page
    assert f"card made {date.today()}" in page
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.slow
def test_kinds_and_languages(tmp_path):
    target = tmp_path / "card.TXT"
    result = run(*QUICK, "--card", str(target), "--lang", "ru", "-q")
    assert result.stdout.strip().isdigit()
    assert target.read_text(encoding="utf-8").startswith("Карта сборки")
    again = run(*QUICK, "--card", str(target))
    assert again.returncode == 2
    assert again.stdout == ""
    assert "--force" in again.stderr
    assert target.read_text(encoding="utf-8").startswith("Карта сборки")
    assert run(*QUICK, "--card", str(target), "--force").returncode == 0
    assert target.read_text(encoding="utf-8").startswith("Assembly card")


def test_the_card_alone_on_stdout():
    result = run(*QUICK, "--card", "-", "--ascii")
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.startswith("Assembly card: position of the fixed wheel\n\ndrive  ")
    assert result.stdout.isascii()
    assert "certificate" not in result.stdout


def test_the_card_on_stdout_and_the_tables_in_a_file(tmp_path):
    answer = tmp_path / "answer.json"
    result = run(*QUICK, "--card", "-", "--json", "-o", str(answer))
    assert result.stdout.startswith("Assembly card")
    assert json.loads(answer.read_text())["schema"] == "hdassist.mount/3"


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["--card", "card.pdf"], ".txt, .html"),
        (["--card", "card"], ".txt, .html"),
        (["--card", "card.html", "--lang", "xx"], "use one of en, ru"),
        (["--lang", "ru"], "--card"),
        (["--serial", "1"], "--card"),
        (["--card", "-", "--json"], "standard output"),
        (["--card", "-", "-q"], "standard output"),
        (["--card", "-", "--csv", "-"], "standard output"),
        (["--card", "card.txt", "-o", "card.txt"], "two results would be written to"),
        (["--card", "card.txt", "--serial", "x" * 61], "serial number"),
        (["--card", "card.txt", "--serial", "a\nb"], "line break"),
    ],
)
def test_what_cannot_be_meant_is_refused_at_once(tmp_path, args, words):
    # before the preset is read: its name is wrong too
    result = run("mount", "none", *(str(tmp_path / arg) if arg.startswith("card") else arg for arg in args))
    assert result.returncode == 2
    if "--json" in args:  # an object says what is wrong there too
        assert json.loads(result.stdout)["error"]["code"] == "USAGE"
    else:
        assert result.stdout == ""
    assert words in result.stderr
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").touch()
    for folder in ("none", "file"):
        result = run("mount", "none", "--card", str(tmp_path / folder / "card.html"))
        assert result.returncode == 4
        assert "there is no directory" in result.stderr
