"""The commands of hdassist: module and summary of each, loaded when it is called."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any

import typer

from hdassist.cli.help import Command, Commands, Context, Formatter, help_sections, with_panel
from hdassist.errors import UsageError


@dataclass(frozen=True)
class LazyCommand:
    """A command that is loaded when it is called: its module in hdassist, section of the help, and summary.

    The module has a class named after the command, as `CheckCommand`, or a group of commands, as `presets_app`.
    """

    module: str
    panel: str
    summary: str

    def load(self, name: str) -> Any:
        """The command itself, by the name that it is called by."""
        return _loaded(f"hdassist.{self.module}", name)


@cache
def _loaded(module: str, name: str) -> Any:
    found = import_module(module)
    if group := getattr(found, f"{name}_app", None):
        return typer.main.get_command(group)
    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command(name, cls=Command)(getattr(found, f"{name.title()}Command"))
    return typer.main.get_command(app)


DESIGN, BENCH, ACCEPTANCE, DATA = "Design", "Bench", "Acceptance", "Data"
COMMANDS = {
    "check": LazyCommand("commands.check", DESIGN, "F'_ior over the full cycle, with verdict and proof"),
    "explore": LazyCommand("explorer.command", DESIGN, "the drive on the screen: turn its knobs and its wheel"),
    "trace": LazyCommand("commands.trace", DESIGN, "the error against the cam angle, with its orders"),
    "stiffness": LazyCommand("commands.stiffness", DESIGN, "twist against torque, lost motion, K1, K2, K3"),
    "tolerance": LazyCommand("commands.tolerance", DESIGN, "yield of random drives, as built and best mounted"),
    "sensitivity": LazyCommand(
        "commands.sensitivity", DESIGN, "which tolerance to tighten first, and what that brings"
    ),
    "allocate": LazyCommand("commands.allocate", DESIGN, "the cheapest tolerances that reach a yield"),
    "sweep": LazyCommand("commands.sweep", DESIGN, "F'_ior over a grid of values of any fields"),
    "compare": LazyCommand("commands.compare", DESIGN, "presets side by side; a measured trace over the predicted one"),
    "report": LazyCommand("commands.report", DESIGN, "a drive on one page, HTML or Markdown"),
    "mount": LazyCommand("commands.mount", BENCH, "in which hole to bolt the fixed wheel; the card"),
    "trials": LazyCommand("commands.trials", BENCH, "the same from F'_ior measured in a few holes"),
    "measure": LazyCommand("commands.measure", BENCH, "F'_ior, orders and coverage of measured traces"),
    "compensate": LazyCommand("commands.compensate", BENCH, "how much a stored correction takes off, and its table"),
    "plan": LazyCommand("commands.plan", ACCEPTANCE, "what a test of F'_ior sees, and which test is enough"),
    "accept": LazyCommand("commands.accept", ACCEPTANCE, "PASS, FAIL or INCONCLUSIVE, for a drive or a lot"),
    "explain": LazyCommand("commands.explain", ACCEPTANCE, "what a check, an error, a field, a symbol or a word is"),
    "calibrate": LazyCommand("commands.calibrate", DATA, "stiffnesses and clearances from measurements"),
    "doctor": LazyCommand("cli.doctor", DATA, "whether this installation can be relied on"),
    "presets": LazyCommand("cli.presets", DATA, "drives: list, show, validate, start"),
}

REMOVED_COMMANDS = {"self-error": "hdassist check --details has the self error"}
REMOVED_OPTIONS = {
    "--rule": "--set acceptance.rule=simple",
    "--assume-phases": "--set phases.phi_hb=0, or what it is",
    "--samples": "--draws N",
    **dict.fromkeys(("--scheduler", "--scheduler-file"), "--jobs N works with N processes of this machine"),
    "--reseat": "--noise, the spread of repeats with the wheel mounted again",
    **dict.fromkeys(("--trial", "--verify", "--trial-torque", "--noise"), "hdassist trials PRESET h0=28.1 h4=17.3"),
}


class RootCommands(Commands):
    """The commands of hdassist: the one that is called is loaded, the help needs none of them."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.commands = _Loaded(COMMANDS, self.commands)  # type: ignore[assignment]  # read only

    def get_command(self, ctx: Context, cmd_name: str) -> Any:
        """The command of a name. Raises UsageError for one that was removed."""
        if cmd_name in REMOVED_COMMANDS:
            raise UsageError(f"no command {cmd_name!r}", REMOVED_COMMANDS[cmd_name])
        return super().get_command(ctx, cmd_name)

    def format_options(self, ctx: Context, formatter: Formatter) -> None:
        """Write the commands, then the options."""
        rows = ((entry.panel, (name, entry.summary)) for name, entry in COMMANDS.items())
        help_sections(formatter, (*rows, *(with_panel(parameter, ctx) for parameter in self.get_params(ctx))))


class _Loaded(Mapping[str, Any]):
    """Commands by name: those of a table, each loaded when it is asked for, and others."""

    def __init__(self, table: Mapping[str, LazyCommand], others: Mapping[str, Any]) -> None:
        self._table, self._others = table, others

    def __getitem__(self, name: str) -> Any:
        return self._table[name].load(name) if name in self._table else self._others[name]

    def __iter__(self) -> Iterator[str]:
        return iter((*self._table, *self._others))

    def __len__(self) -> int:
        return len(self._table) + len(self._others)
