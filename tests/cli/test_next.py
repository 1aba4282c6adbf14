"""Commands that pages print: they are taken as they stand, and keep the options that decide the answer."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from typer.main import get_command

from hdassist.interface.cli import OTHER_NAMES, app
from hdassist.interface.terminal.options import CardOptions, RowsOptions
from tests.helpers.process import TINY, in_a_line, run
from tests.helpers.rigs import even_wave, text

SETS = ("--set", "mounting.holes=6", "--set", "source.supports.C_3={kind: assumed, range: [1000, 8000], ref: judged}")
TRIALS = ("h0=900", "h2=800", "h4@2=700")
LIMITED = ("--torque", "4", "--limit", "900")
READ = ("--angle", "cam_deg", "--error", "error_arcsec", "--robust", "--budget", "encoder=0.3", "--seed", "3")
REQUIRED = {"compare": ("own.yaml",), "sweep": ("--vary", "gears.j_n=1,2")}
ANSWER = {*vars(RowsOptions())} | {*vars(CardOptions())}  # options that decide no answer


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A folder with a drive, and a record of its full cycle."""
    folder, turns = tmp_path_factory.mktemp("next"), np.arange(2000) / 200
    (folder / "own.yaml").write_bytes(Path(TINY).read_bytes())
    (folder / "run.csv").write_text(text([360 * turns, even_wave(turns)], "cam_deg,error_arcsec"), encoding="utf-8")
    return folder


def next_commands(page: str) -> list[list[str]]:
    """Commands of the lines that begin with "next", each with the lines that go on, in words."""
    found = re.findall(r"^ *next +(hdassist .*(?:\n {6,}\S.*)*)", page, re.MULTILINE)
    return [shlex.split(in_a_line(text)) for text in found]


def parsed(words: list[str]) -> dict[str, object]:
    """The options of a command line as the command gets them. Raises those of typer for any that it does not take."""
    name = OTHER_NAMES.get(words[0], words[0])
    return get_command(app).get_command(None, name).make_context(name, words[1:]).params


@pytest.mark.thorough
@pytest.mark.parametrize(
    "words",
    [
        ("check", *LIMITED, "--draws", "8", "--seed", "3"),
        ("trace", "--torque", "4", "--speed", "9", "--phi-g0", "30", "--gravity", "60"),
        ("trace", "-n", "10"),
        ("stiffness",),
        ("tolerance", *LIMITED, "-n", "16", "--yield", "0.9"),
        ("sensitivity", "--torque", "4", "-n", "16", "--known", "phases.phi_hh"),
        ("allocate", "--torque", "4", "--limit", "9000", "-n", "20", "--yield", "0.5", "--sure", "0.8", "--as-built"),
        ("sweep", "--torque", "4", "--vary", "gears.j_n=16:20:2", "-o", "rows.jsonl"),
        ("mount", "--draws", "8", "--worth", "50", "--bolted", "5", "--noise", "0.5", "--trial-torque", "2"),
        ("mount", *TRIALS, "--noise", "0.5", "--trial-torque", "4", "--worth", "0", "--bolted", "5", "--draws", "8"),
        ("mount", *TRIALS, "--noise", "0.5", "--trial-torque", "4", "--worth", "100", "--sure", "0.5", "--draws", "8"),
        ("mount", "h0=run.csv", *READ[:4], "--draws", "8"),
        ("mount", "--step", "30", "--draws", "8"),
        ("compensate", "--torque", "4", "--points", "20", "--draws", "8", "--travel", "90"),
        ("plan", "--torque", "4", "--travel", "90", "--draws", "8"),
        (
            "accept",
            "--limit",
            "2035",
            "--set",
            "operation.M_g=4",
            "--value",
            "lost_motion=41±3",
            "--limit",
            "lost_motion=60",
        ),
        ("accept", *LIMITED[2:], "--set", "operation.M_g=4", "--measured", "4=run.csv", *READ),
        ("measure", "run.csv", "--drive", "own.yaml", *READ),
        ("compare", "run.csv", "--torque", "4", *READ),
        ("compare", TINY, "--torque", "4", "--draws", "8"),
    ],
    ids=lambda words: " ".join(words[:3]),
)
def test_printed_next_command_runs_and_keeps_the_options_that_decide(folder, words):
    command, *options = words
    preset = [] if command == "measure" else ["own.yaml"]
    asked = [command, *preset, *options, *([] if command in ("measure", "compare") else SETS)]
    answer = run(*asked, cwd=folder)
    assert answer.returncode in (0, 3, 6), answer.stderr
    found = next_commands(answer.stdout + answer.stderr)
    assert found, answer.stdout
    for _, *again in found:
        before, after = parsed(asked), parsed(again)
        default = parsed([command, *asked[1:2], *REQUIRED.get(command, ())])
        given = {name for name in before.keys() & after.keys() - ANSWER if before[name] != default[name]} - {"count"}
        kept = given if again[0] == command else given & {"overrides", "torque", "seed", "draws"}
        for name in kept:
            line = " ".join(again) if name == "limit" else values(after[name])  # of others than F_ior it is a field
            assert all(value in line for value in values(before[name])), name


def values(value: object) -> list[str]:
    """An option's values, one or several, as text."""
    return [str(each) for each in (value if isinstance(value, list | tuple) else [value])]
