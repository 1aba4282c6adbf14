"""The commands of hdassist: where each is, what it is for; each is loaded when it is called."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any

import typer

from hdassist.cli.help import Command, Commands, Context, Formatter, sections, with_panel


@dataclass(frozen=True)
class LazyCommand:
    """A command that is loaded when it is called: its module in hdassist, section of the help, and summary.

    The module has a function `command`, or a group of commands `app`.
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
    if group := getattr(found, "app", None):
        return typer.main.get_command(group)
    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command(name, cls=Command)(found.command)
    return typer.main.get_command(app)


DESIGN, BENCH, ACCEPTANCE, DATA = "Design", "Bench", "Acceptance", "Data"
COMMANDS = {
    "check": LazyCommand("design.check_command", DESIGN, "F'_ior over the full cycle, with verdict and proof"),
    "explore": LazyCommand("explorer.command", DESIGN, "the drive on the screen: turn its knobs and its wheel"),
    "trace": LazyCommand("design.trace_command", DESIGN, "the error against the cam angle, with its orders"),
    "self-error": LazyCommand("design.self_error_command", DESIGN, "what is left of a drive without deviations"),
    "stiffness": LazyCommand("design.stiffness_command", DESIGN, "twist against torque, lost motion, K1, K2, K3"),
    "tolerance": LazyCommand(
        "tolerance.tolerance_command", DESIGN, "yield of random drives, as built and best mounted"
    ),
    "sensitivity": LazyCommand(
        "tolerance.sensitivity_command", DESIGN, "which tolerance to tighten first, and what that brings"
    ),
    "allocate": LazyCommand("tolerance.allocate_command", DESIGN, "the cheapest tolerances that reach a yield"),
    "sweep": LazyCommand("tolerance.sweep_command", DESIGN, "F'_ior over a grid of values of any fields"),
    "compare": LazyCommand(
        "comparing.command", DESIGN, "presets side by side; a measured trace over the predicted one"
    ),
    "report": LazyCommand("reporting.command", DESIGN, "a drive on one page, HTML or Markdown"),
    "mount": LazyCommand("mounting.command", BENCH, "in which hole to bolt the fixed wheel; the card"),
    "trials": LazyCommand("trials.command", BENCH, "the same from F'_ior measured in a few holes"),
    "measure": LazyCommand("measuring.command", BENCH, "F'_ior, orders and coverage of measured traces"),
    "accept": LazyCommand("acceptance.command", ACCEPTANCE, "PASS, FAIL or INCONCLUSIVE, for a drive or a lot"),
    "explain": LazyCommand("explaining.command", ACCEPTANCE, "what a check, an error, a field, a symbol or a word is"),
    "calibrate": LazyCommand("calibration.command", DATA, "stiffnesses and clearances from measurements"),
    "doctor": LazyCommand("cli.doctor", DATA, "whether this installation can be relied on"),
    "presets": LazyCommand("cli.presets", DATA, "drives: list, show, validate, start"),
}


class RootCommands(Commands):
    """The commands of hdassist: the one that is called is loaded, the help needs none of them."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.commands = _Loaded(COMMANDS, self.commands)  # type: ignore[assignment]  # read only

    def format_options(self, ctx: Context, formatter: Formatter) -> None:
        """Write the commands, then the options."""
        rows = ((entry.panel, (name, entry.summary)) for name, entry in COMMANDS.items())
        sections(formatter, (*rows, *(with_panel(parameter, ctx) for parameter in self.get_params(ctx))))


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
