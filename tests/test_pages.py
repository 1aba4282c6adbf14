"""Pages of docs/ whose commands run as they stand: each command ends as the page has it, and prints the output shown.

A block `sh` runs, a block `text` is output of them, a block `none` is only shown. Numbers in ″ and in % that sentences
of a page state are in its output too, except for those of other runs.
"""

import json
import re
import shlex
import subprocess
import sys
from math import isclose
from pathlib import Path
from string import Template

import pytest

from tests.helpers.process import CLEAN, run

DOCS = Path(__file__).parents[1] / "docs"
NAME, COMMAND = r"\w+=\S+", r"hdassist [^|&;<>\n]+( > [\w.-]+)?"  # lines that need no shell
NUMBER = r"\d+(?:\.\d+)?"
OF_OTHER_RUNS = {  # numbers of benchmarks, of longer runs and of other settings, by page
    "start.md": {"26.4", "26.9", "82"},
    "mount.md": {"0.1", "0.7", "0.8", "0.9", "1.4", "17.3", "19", "2.0", "2.1", "2.6", "2.8", "3.1"}
    | {"3.3", "33", "4.0", "4.3", "4.6", "5.5", "5.7", "95"},
    "measure.md": {"2.3", "9", "28.7"},
    "correct.md": {"0.10", "0.16", "0.23", "0.5", "0.57", "15", "30", "31.2", "90", "95", "98"}
    | {"0.2", "1.5", "1.6", "2.2", "2.4", "3.0", "3.5", "8.3", "20"},
    "tolerance.md": {"11.1", "14.7", "15.4", "16", "35"},
    "plan.md": {"0.2", "0.3", "38", "55", "71", "89", "90", "92"},
    "design.md": {"13", "55", "106", "120", "145", "268"},
    "accept.md": {"0.3", "0.4", "4", "5.4", "90"},
    "explore.md": {"3", "5", "45", "64", "79", "95", "100"},  # tests/explorer/test_path.py compares these
}
PLAIN = rf"(({NAME}|{COMMAND})\n)+"
SHELL = f'set -euo pipefail\nhdassist() {{ "{sys.executable}" -m hdassist "$@"; }}\n'

pytestmark = pytest.mark.slow  # .ci/run runs them


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), flags=re.DOTALL)


def output_of(page: str, folder: Path) -> str:
    """Output of the commands of a page, run in a folder; runs of blanks as one. What the page shows of it is there."""
    words = "".join(output_of_block(block, folder) for block in blocks(page, "sh")).split()
    for block in blocks(page, "text"):
        shown = block.split()
        starts = range(len(words) - len(shown) + 1)
        assert any(all(map(alike, shown, words[start:])) for start in starts), f"{block}is not in {' '.join(words)}"
    output = " ".join(words)
    printed = [float(number) for number in re.findall(NUMBER, output)]
    restated = restated_numbers(page) - OF_OTHER_RUNS.get(page, set())
    missing = {text for text in restated if not any(isclose(float(text), value, rel_tol=0.01) for value in printed)}
    assert not missing, f"{page}: numbers of its sentences that its commands do not print"
    return output


def restated_numbers(page: str) -> set[str]:
    """Numbers in ″ and in % of the sentences of a page, both ends of a range."""
    prose = re.sub(r"```.*?```", "", (DOCS / page).read_text(encoding="utf-8"), flags=re.DOTALL)
    prose = re.sub(r"`[^`\n]*`|\]\([^)]*\)", "", prose)
    ranges = re.findall(rf"({NUMBER})(?:(?: to | and |-)({NUMBER}))? ?[″%]", prose)
    return {number for ends in ranges for number in ends if number}


def output_of_block(block: str, folder: Path) -> str:
    """Output of a block: plain commands in this process, where Python need not start anew, the rest in a shell."""
    if not re.fullmatch(PLAIN, block):
        command = ["bash", "-c", SHELL + block]
        done = subprocess.run(command, cwd=folder, env=CLEAN, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout + done.stderr
    output, names = "", {}
    for line in block.splitlines():
        if re.fullmatch(NAME, line):
            names.update([line.split("=", 1)])
            continue
        line, _, code = line.partition("  # exit code ")
        line, _, file = line.partition(" > ")
        words = [Template(word).substitute(names) for word in shlex.split(line, comments=True)]
        answer = run(*words[1:], cwd=folder)
        assert answer.returncode == int(code or 0), f"{line}: {answer.returncode}\n{answer.stderr}"
        if file:
            (folder / file).write_text(answer.stdout)
        output += ("" if file else answer.stdout) + answer.stderr
    return output


def alike(shown: str, word: str) -> bool:
    """Whether two words are the same but for one per cent of their numbers."""
    parts = [re.split(r"(\d[\d.]*)", text) for text in (shown, word)]
    return len(parts[0]) == len(parts[1]) and all(
        a == b or (k % 2 == 1 and isclose(float(a.rstrip(".")), float(b.rstrip(".")), rel_tol=0.01))
        for k, (a, b) in enumerate(zip(*parts, strict=True))
    )


def words_of(file: Path) -> str:
    return " ".join(file.read_text(encoding="utf-8").split())


def test_start(tmp_path: Path):
    output_of("start.md", tmp_path)
    card = words_of(tmp_path / "card.txt")
    assert "Put the circular spline in hole 4. That is 4 holes (120°) counter-clockwise from hole 0" in card
    assert "Inputs: 64 uncertain, 4 given in the preset, 0 identified from measurements." in card
    assert "Probability that hole 4 is better than hole 0 by more than 1 %" in card
    assert "hole 4: 26.2″" in card


def test_design(tmp_path: Path):
    output_of("design.md", tmp_path)
    assert (tmp_path / "own.html").stat().st_size > 0


def test_explore(tmp_path: Path):
    output_of("explore.md", tmp_path)
    assert (tmp_path / "mine.yaml").exists()  # tests/explorer/test_path.py types the keys


def test_mount(tmp_path: Path):
    output_of("mount.md", tmp_path)
    assert "That is 4 holes (120°) clockwise from hole 0" in words_of(tmp_path / "known.txt")
    assert "That is 2 holes (60°) clockwise from hole 0" in words_of(tmp_path / "card.txt")


def test_measure(tmp_path: Path):
    output = output_of("measure.md", tmp_path)
    for words in ("at least", "full mesh cycle of 100 input revolutions"):
        assert words in output
    for words in ("agrees", "explained by one deviation", "mirrored --error-is output-cam"):
        assert words in output
    assert "the recording indicates a ratio of 101.000" in output
    assert json.loads((tmp_path / "cycle.json").read_text())["schema"] == "hdassist.measure/1"


def test_files(tmp_path: Path):
    output = output_of("files.md", tmp_path)
    for recording in ("guided.txt", "counts.csv", "moteus.csv", "epics.csv", "sexagesimal.csv"):
        assert recording in output


def test_correct(tmp_path: Path):
    output = output_of("correct.md", tmp_path)
    assert "vzp160, correction at 80 N·m: residual F'_ior 0.1″ (0 % of 28.7″) with 1280 correction terms" in output
    assert len((tmp_path / "table.csv").read_text().splitlines()) == 1501
    assert json.loads((tmp_path / "correction.json").read_text())["schema"] == "hdassist.compensate/1"


def test_controllers(tmp_path: Path):
    output_of("controllers.md", tmp_path)
    for table in ("achskw2.lis", "table.cfg"):
        assert (tmp_path / table).stat().st_size > 0


def test_plan(tmp_path: Path):
    output = output_of("plan.md", tmp_path)
    assert "12 positions capture" in output
    assert json.loads((tmp_path / "plan.json").read_text())["schema"] == "hdassist.plan/1"


def test_accept(tmp_path: Path):
    output = output_of("accept.md", tmp_path)
    assert json.loads((tmp_path / "result.json").read_text())["schema"] == "hdassist.accept/2"
    assert len((tmp_path / "lot.jsonl").read_text().splitlines()) == 4  # the owner, and a line each
    assert "ship it" in output
    assert output.count("agrees") >= 2


def test_tolerance(tmp_path: Path):
    output_of("tolerance.md", tmp_path)
    assert len((tmp_path / "rows.jsonl").read_text().splitlines()) == 4  # the owner, and a line each
