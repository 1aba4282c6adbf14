"""Pages of the docs whose commands are meant to run as they stand."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from tests.process import CLEAN, run

DOCS = Path(__file__).parents[1] / "docs"
PLAIN = r"(hdassist [\w .=@,:-]+\n)+"
SHELL = f'set -euo pipefail\nhdassist() {{ "{sys.executable}" -m hdassist "$@"; }}\n'


def told_by(page: str, folder: Path) -> str:
    """What the commands of a page say on stdout, run in a folder one block after the other; each must succeed."""
    told = ""
    for block in re.findall(r"```sh\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), flags=re.DOTALL):
        if re.fullmatch(PLAIN, block):
            done = [run(*line.split()[1:], cwd=folder) for line in block.splitlines()]
        else:  # a shell's work
            command = ["bash", "-c", SHELL + block]
            done = [subprocess.run(command, cwd=folder, env=CLEAN, capture_output=True, text=True, check=False)]
        for result in done:
            assert result.returncode == 0, result.stderr
            told += result.stdout
    return told
