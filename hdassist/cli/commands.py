"""The commands of hdassist: module and summary of each, loaded when it is called."""

from collections.abc import Iterator
from functools import cache
from importlib import import_module
from typing import Any

import typer

from hdassist.cli.help import Command, Commands, Context, Row

SUMMARIES = {  # summary of each by the section of the help in which it stands
    "Design": {
        "check": "F'_ior over the full cycle, with verdict and proof",
        "explore": "the drive on the screen: turn its knobs and its wheel",
        "trace": "the error against the cam angle, with its orders",
        "stiffness": "twist against torque, lost motion, K1, K2, K3",
        "tolerance": "yield of random drives, as built and best mounted",
        "sensitivity": "which tolerance to tighten first, and its gain",
        "allocate": "the cheapest tolerances that reach a yield",
        "sweep": "F'_ior over a grid of values of any fields",
        "compare": "presets side by side; a measured trace over the predicted one",
        "report": "a drive on one page, HTML or Markdown",
    },
    "Bench": {
        "mount": "in which hole to bolt the fixed wheel; what to measure",
        "trials": "mount by its old name",
        "measure": "F'_ior, orders and coverage of measured traces",
        "compensate": "how much a stored correction takes off, and its table",
    },
    "Acceptance": {
        "plan": "how much a test of F'_ior sees, and which test is enough",
        "accept": "PASS, FAIL or INCONCLUSIVE, for a drive or a lot",
        "explain": "meaning of a check, error, field, symbol or word",
    },
    "Data": {
        "calibrate": "stiffnesses and clearances from measurements",
        "doctor": "whether this installation can be relied on",
        "presets": "drives: list, show, validate, start",
    },
}
COMMANDS = tuple(name for summaries in SUMMARIES.values() for name in summaries)
OTHER_NAMES = {"trials": "mount"}  # commands by an old name
ELSEWHERE = {"explore": "explorer.command", "doctor": "cli.doctor", "presets": "cli.presets"}


def module_of(name: str) -> str:
    """Module of a command, which has a class named after it, as `CheckCommand`, or a group, as `presets_app`."""
    name = OTHER_NAMES.get(name, name)
    return f"hdassist.{ELSEWHERE.get(name, f'commands.{name}')}"


@cache
def _loaded(name: str) -> Any:
    """A command, by name, loaded when it is called."""
    name = OTHER_NAMES.get(name, name)
    module = import_module(module_of(name))
    if group := getattr(module, f"{name}_app", None):
        return typer.main.get_command(group)
    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command(name, cls=Command)(getattr(module, f"{name.title()}Command"))
    return typer.main.get_command(app)


REMOVED_OPTIONS = {
    "--rule": "--set acceptance.rule=simple",
    "--assume-phases": "--set phases.phi_hb=0, or what it is",
    "--samples": "--draws N",
    **dict.fromkeys(("--scheduler", "--scheduler-file"), "--executor dask=tcp://HOST:PORT"),
    "--reseat": "--noise, the spread of repeats with the wheel mounted again",
    "--trial": "hdassist mount PRESET h0=28.1 h4=17.3",
}


class RootCommands(Commands):
    """The commands of hdassist: the one that is called is loaded, the help needs none of them."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        names: Any = dict.fromkeys(COMMANDS)
        self.commands = names

    def get_command(self, _ctx: Context, name: str) -> Any:
        """The command of a name."""
        return _loaded(name) if name in self.commands else None

    def rows(self) -> Iterator[Row]:
        """Commands and their summaries, with their sections."""
        yield from ((panel, row) for panel, summaries in SUMMARIES.items() for row in summaries.items())
