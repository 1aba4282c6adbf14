"""Help texts: what a newcomer sees first."""

import subprocess
import sys

import pytest

from hdassist.cli.commands import COMMANDS
from tests.process import run

NAMES = sorted({*COMMANDS} - {"presets"})


def test_without_a_command_there_is_help() -> None:
    done = run()
    assert done.returncode == 0
    assert done.stdout == run("--help").stdout == run("help").stdout
    assert not done.stderr


def test_commands_stand_in_groups_with_their_whole_summaries() -> None:
    lines = run("--help").stdout.splitlines()
    heads = [line for line in lines if line and not line.startswith(" ")]
    assert heads[1:] == ["Design:", "Bench:", "Acceptance:", "Data:", "Options:"]
    assert lines.index("Bench:") < next(k for k, line in enumerate(lines) if line.split()[:1] == ["mount"])
    assert not any("..." in line for line in lines if not line.startswith("Usage"))
    assert {line.split()[0] for line in lines if line.startswith("  ")} >= {*NAMES, "presets"}


@pytest.mark.parametrize("name", NAMES)
def test_help_of_a_command_is_the_same_either_way(name: str) -> None:
    told = run(name, "--help").stdout
    assert run("help", name).stdout == told
    assert "Examples:" in told
    assert ("Answer:" in told) is (name != "explore")
    assert max(map(len, told.splitlines())) <= 80


def test_options_stand_in_sections() -> None:
    told = run("check", "--help").stdout
    sections = [line for line in told.splitlines() if line.endswith(":") and not line.startswith(" ")]
    assert sections == ["Arguments:", "Drive:", "Options:", "Measured teeth:", "Answer:"]


def test_a_command_that_is_none_has_its_neighbour_named() -> None:
    done = run("help", "mont")
    assert done.returncode == 2
    assert "did you mean mount?" in done.stderr


def test_the_version_has_a_short_option() -> None:
    assert run("-V").stdout == run("--version").stdout


def test_help_loads_no_command() -> None:
    code = """
import sys
from hdassist.cli.main import app
app(["--help"], standalone_mode=False)
loaded = {name.removeprefix("hdassist.") for name in sys.modules if name.startswith("hdassist.")}
assert not loaded & {entry.module for entry in COMMANDS.values()}, loaded
assert not {"numpy", "pydantic"} & {*sys.modules}
"""
    subprocess.run([sys.executable, "-c", "from hdassist.cli.commands import COMMANDS" + code], check=True)
