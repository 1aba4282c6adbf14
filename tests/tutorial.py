"""Pages of the docs whose commands are meant to run as they stand."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from math import isclose
from pathlib import Path
from string import Template

from tests.process import CLEAN, run

DOCS = Path(__file__).parents[1] / "docs"
NAME, WORDS = r"\w+=\S+", r"hdassist [^|&;<>\n]+( > [\w.-]+)?"  # lines that need no shell
PLAIN = rf"(({NAME}|{WORDS})\n)+"
SHELL = f'set -euo pipefail\nhdassist() {{ "{sys.executable}" -m hdassist "$@"; }}\n'


def require_told(page: str, told: str) -> None:
    """Require that what a page prints as told was told: the same words, and numbers to a hundredth."""
    text = (DOCS / page).read_text(encoding="utf-8")
    words = told.split()
    for block in re.findall(r"```text\n(.*?)```", text, flags=re.DOTALL):
        printed = block.split()
        places = range(len(words) - len(printed) + 1)
        assert any(all(map(_alike, printed, words[k:])) for k in places), f"{block}is not in\n{told}"


def _alike(printed: str, word: str) -> bool:
    parts = [re.split(r"(\d[\d.]*)", text) for text in (printed, word)]
    return len(parts[0]) == len(parts[1]) and all(
        a == b or (k % 2 == 1 and isclose(float(a.rstrip(".")), float(b.rstrip(".")), rel_tol=0.01))
        for k, (a, b) in enumerate(zip(*parts, strict=True))
    )


def told_by(page: str, folder: Path) -> str:
    """What the commands of a page say, run in a folder one block after the other; each must end as the page says."""
    text = (DOCS / page).read_text(encoding="utf-8")
    return "".join(_told(block, folder) for block in re.findall(r"```sh\n(.*?)```", text, flags=re.DOTALL))


def _told(block: str, folder: Path) -> str:
    """What a block says: commands alone in this process, where Python need not start anew, the rest in a shell."""
    if not re.fullmatch(PLAIN, block):
        command = ["bash", "-c", SHELL + block]
        done = subprocess.run(command, cwd=folder, env=CLEAN, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout + done.stderr
    told, names = "", {}
    for line in block.splitlines():
        if re.fullmatch(NAME, line):
            names.update([line.split("=", 1)])
            continue
        line, _, code = line.partition("  # exit code ")
        line, _, file = line.partition(" > ")
        words = [Template(word).substitute(names) for word in shlex.split(line)]
        answer = run(*words[1:], cwd=folder)
        assert answer.returncode == int(code or 0), answer.stderr
        if file:
            (folder / file).write_text(answer.stdout)
        told += ("" if file else answer.stdout) + answer.stderr
    return told
