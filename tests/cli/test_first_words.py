"""Commands that compute show words before they import what computes, which takes longer than many answers."""

import subprocess
import sys

import pytest

COMMANDS = (
    *("check", "trace", "stiffness", "report", "tolerance", "sensitivity", "allocate", "plan", "accept", "compensate"),
    *("mount", "mount --card card.html", "trials", "measure", "compare run.csv", "compare size-17-100"),
    *("sweep --vary gears.j_n=0,5", "calibrate --targets rig.yaml", "explore", "doctor"),
)
LOOK = """
import sys
from hdassist.interface.terminal.output import Output

def look(*_args, **_options):
    print(sorted({"numpy", "scipy"} & {*sys.modules}))
    raise KeyboardInterrupt

Output.progress = Output.run = look
sys.argv = ["hdassist", *sys.argv[1:]]
from hdassist.interface.cli import run_command_line
run_command_line()
"""


@pytest.mark.thorough
@pytest.mark.parametrize("command", COMMANDS)
def test_words_come_before_numpy(command: str) -> None:
    drive = [] if command == "doctor" else ["vzp160"]
    look = [sys.executable, "-c", LOOK, *command.split(), *drive]
    found = subprocess.run(look, capture_output=True, text=True, check=False)
    assert found.stdout.splitlines()[:1] == ["[]"], found.stderr
