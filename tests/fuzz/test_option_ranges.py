"""Options of numbers and of choices, from their declarations: both ends of each range and odd values between.

One by one they are read, with nothing solved; then those that have a range stand together at their low ends, and
together at odd and high values, and the tiny drive is solved. Exit code 1 would be a bug.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from inspect import unwrap
from math import nextafter, sqrt
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import pytest
import typer
from typer.models import OptionInfo

from hdassist.interface.cli import COMMANDS, app
from tests.fuzz.inputs import GOOD, unsolved
from tests.fuzz.seeds import TRACES
from tests.helpers.process import TINY, run

ONE = ("drive.yaml", "--set", "operation.M_g=[4]")
LINES: dict[str, tuple[str, ...]] = {
    "check": ONE, "explore": ONE, "trace": (*ONE, "--torque", "4"), "stiffness": ONE,
    "tolerance": (*ONE, "-n", "2", "--limit", "3000"), "sensitivity": (*ONE, "-n", "16"),
    "sweep": (*ONE, "--vary", "gears.j_n=5,6"),
    "allocate": (*ONE, "-n", "20", "--limit", "3000"), "compare": (*ONE, "run.csv", "--no-plot"), "report": ONE,
    "plan": ONE, "compensate": (*ONE, "--draws", "1"),
    "mount": (*ONE, "--draws", "1"), "trials": (*ONE, "h0=280", "h4=170", "--draws", "8"),
    "measure": ("run.csv", "--ratio", "10"), "accept": (*ONE, "--limit", "F_ior@4=300"),
    "calibrate": (*ONE, "--targets", "targets.yaml", "--evaluations", "8"), "presets new": ("own",),
    "explain": ("F_ior",), "doctor": (), "presets list": (), "presets show": ("drive.yaml",),
    "presets validate": ("drive.yaml",), "presets schema": (),
}  # fmt: skip
TARGETS = """\
schema: hdassist.targets/1
name: tiny
unknowns: {gears.j_n: {low: 15, high: 20}}
targets: [{quantity: self_error, M_g: 4, low: 0, high: 1000}]
"""
EFFORT = ("count", "draws", "samples", "evaluations", "revolutions", "jobs")  # which nobody affords at the high end
OF_OTHER_FILES = ("declination", "guide_rate")  # of guide logs: refused with any other recording
INSTEAD_OF_SPEED = "period"  # the same of a column of time, refused together with it
HEAVY = ("tolerance", "sensitivity", "allocate", "compare")  # which solve a table or many drives whatever is asked
ANY = (-1e300, -0.5, 0, 1e-300, 359.9, 1e300, float("nan"), float("inf"))


@dataclass(frozen=True)
class Declared:
    """An option as its command declares it: its flag, its type, the ends of its range (None: open), its choices."""

    name: str
    flag: str
    kind: type
    low: float | None
    high: float | None
    choices: tuple[str, ...]

    def values(self) -> Iterator[str]:
        """Texts of values: each choice, or both ends of the range and odd values between."""
        if self.choices:
            yield from self.choices
        elif self.kind is int:
            low, high = int(self.low or 0), int(2**63 if self.high is None else self.high)
            yield from (str(value) for value in (low, low + 1, 17, 20, 1_000_003, high) if low <= value <= high)
        elif self.low is None or self.high is None:
            yield from map(str, ANY)
        else:
            between = nextafter(self.low, self.high), 0.1 + 0.2, sqrt(max(self.low, 1e-9) * self.high)
            yield from map(str, (self.low, *between, self.high))


def declared(command: str) -> list[Declared]:
    found = []
    for name, annotation in get_type_hints(commands()[command], include_extras=True).items():
        hint, info = (*get_args(annotation), None, None)[:2]
        kinds = {hint, *(part for part in get_args(hint) if isinstance(part, type))} & {int, float}
        choices = tuple(c for part in (hint, *get_args(hint)) if get_origin(part) is Literal for c in get_args(part))
        if isinstance(info, OptionInfo) and (kinds or choices):
            written = (d for d in (info.default, *(info.param_decls or ())) if isinstance(d, str))
            flag = next(written, "--" + name.replace("_", "-"))
            found.append(Declared(name, flag, *(kinds or {str}), info.min, info.max, choices))
    return found


@cache
def commands() -> dict[str, Any]:
    """Classes of all commands, by the words that call them."""
    found = {}
    for name in COMMANDS:
        command = typer.main.get_command(app).get_command(None, name)  # type: ignore[attr-defined]  # a group of typer
        inner = getattr(command, "commands", None)
        leaves = {f"{name} {each}": c for each, c in inner.items()} if inner else {name: command}
        found |= {words: unwrap(leaf.callback) for words, leaf in leaves.items()}
    return found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    text = Path(TINY).read_text(encoding="utf-8")
    for name, content in (("drive.yaml", text), ("run.csv", TRACES[0][0]), ("targets.yaml", TARGETS)):
        (tmp_path / name).write_text(content, encoding="utf-8")
    return tmp_path


def code_of(command: str, folder: Path, *options: str) -> int:
    done = run(*command.split(), *LINES[command], *options, cwd=folder)
    assert done.returncode in GOOD, (options, done.stderr)
    assert not any(words in done.stderr for words in ("internal error", "No such option")), (options, done.stderr)
    return done.returncode


def test_every_command_is_looked_at() -> None:
    assert LINES.keys() == commands().keys()
    assert sum(len(declared(command)) for command in LINES) > 90


@pytest.mark.thorough
@pytest.mark.parametrize("command", [command for command in LINES if declared(command)])
def test_no_value_of_an_option_is_a_bug(folder: Path, command: str) -> None:
    with unsolved(at_once=True):
        for option in declared(command):
            for value in option.values():
                code_of(command, folder, option.flag, value)


@pytest.mark.parametrize("command", [c for c in LINES if any(not option.choices for option in declared(c))])
def test_digits_of_other_scripts_and_underscores_are_no_numbers(folder: Path, command: str) -> None:
    for option in declared(command):
        for value in ("1_0", "١٠", "２５") * (not option.choices):
            done = run(*command.split(), *LINES[command], option.flag, value, cwd=folder)
            assert (done.returncode, "is not a number: expected ASCII digits" in done.stderr) == (2, True), option


@pytest.mark.thorough
@pytest.mark.parametrize(
    "command",
    [pytest.param(c, marks=[pytest.mark.slow] * (c in HEAVY)) for c in LINES if declared(c) and c != "explore"],
)
@pytest.mark.parametrize("place", ["low", "high"])
def test_ends_and_odd_values_are_solved(folder: Path, command: str, place: str) -> None:
    options = ["--jobs=1"] * any(option.name == "jobs" for option in declared(command))
    for option in declared(command):
        if option.low is None or option.name == "jobs" or option.name in (*OF_OTHER_FILES, INSTEAD_OF_SPEED):
            continue
        values = list(option.values())
        options += [option.flag, values[0 if place == "low" else 1 if option.name in EFFORT else -1]]
    assert code_of(command, folder, *options) != 2
