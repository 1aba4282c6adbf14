"""Options that commands share, declared once."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from hdassist.errors import UsageError

if TYPE_CHECKING:
    from hdassist.readers.trace import Shaft

Preset = Annotated[str, typer.Argument(metavar="PRESET", help="Preset name, path, or - for stdin.")]
Presets = Annotated[list[str], typer.Argument(metavar="PRESET...", help="Preset names, paths, or - for stdin.")]
Overrides = Annotated[
    list[str],
    typer.Option("--set", metavar="KEY=VALUE", help="Override a preset field, e.g. tolerances.F_i2=60. Repeatable."),
]
Torques = Annotated[
    list[float], typer.Option("--torque", help="Torque M_g in N*m, instead of the preset's. Repeatable.")
]
Traces = Annotated[list[str], typer.Argument(metavar="FILE...", help="Measured traces, or - for stdin.")]
Angle = Annotated[str | None, typer.Option(metavar="NAME", help="Column of the angle, or its number.")]
AngleOf = Annotated[str | None, typer.Option(metavar="SHAFT", help="What turns by it: cam or output.")]
AngleUnit = Annotated[str | None, typer.Option(metavar="UNIT", help="deg, rad, arcsec, arcmin, turn.")]
ErrorColumn = Annotated[str | None, typer.Option(metavar="NAME", help="Column of the error, or its number.")]
ErrorUnit = Annotated[str | None, typer.Option(metavar="UNIT", help="arcsec, arcmin, deg, mdeg, rad, urad.")]
Second = Annotated[
    str | None, typer.Option(metavar="NAME", help="Column of the output's own angle, instead of an error.")
]
Wrap = Annotated[
    float | None,
    typer.Option(metavar="DEG", help="Angle after which encoders begin again.", show_default="guessed"),
]
Orders = Annotated[str | None, typer.Option(metavar="LIST", help="Orders per cam turn to keep.", show_default="1-12")]
Drift = Annotated[str, typer.Option(metavar="KIND", help="Drift to take off: none, linear, quadratic.")]
Budget = Annotated[
    list[str],
    typer.Option(metavar="NAME=ARCSEC", help="Standard uncertainty by encoder, coupling, ... Repeatable."),
]
Bootstrap = Annotated[int, typer.Option(min=0, help="Seed of the bootstrap.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Csv = Annotated[str | None, typer.Option("--csv", metavar="FILE", help="Write the figures as CSV (- for stdout).")]
Target = Annotated[
    str,
    typer.Option("--output", "-o", metavar="FILE", help="Write the answer to FILE (- for stdout)."),
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite existing files.")]
Card = Annotated[
    str | None,
    typer.Option("--card", metavar="FILE", help="Write an assembly card: .html, .md or .txt (- for stdout)."),
]
Lang = Annotated[
    str | None, typer.Option("--lang", metavar="NAME", help="Language of the card, such as ru (en without).")
]
Serial = Annotated[str | None, typer.Option("--serial", metavar="TEXT", help="Serial number on the card.")]
PitchB = Annotated[
    str | None,
    typer.Option("--pitch-b", metavar="FILE", help="Measured pitch deviations of the rigid wheel (- for stdin)."),
]
PitchG = Annotated[
    str | None, typer.Option("--pitch-g", metavar="FILE", help="Measured pitch deviations of the flexspline.")
]
MarkB = Annotated[
    float | None,
    typer.Option("--mark-b", metavar="DEG", help="Direction of the mark of --pitch-b; phases.xi_b without."),
]
MarkG = Annotated[
    float | None,
    typer.Option("--mark-g", metavar="DEG", help="Direction of the mark of --pitch-g; phases.xi_g without."),
]
PitchForm = Annotated[
    Literal["cumulative", "single"] | None,
    typer.Option(help="Form of the deviations in the pitch files, whatever they say."),
]
PitchSense = Annotated[
    Literal["ccw", "cw"] | None, typer.Option(help="Sense of the tooth numbers in them, seen from the cam side.")
]
PitchFlank = Annotated[
    Literal["left", "right"] | None, typer.Option(help="Flank to take from pitch files that have two.")
]
Solver = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Send each state through cvxpy to this solver (daqp, clarabel, osqp, ...)."),
]
CrossCheck = Annotated[
    str, typer.Option(metavar="NAME", help="Solver that solves the extremes and a sample of states again.")
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the sample that is solved again.")]
Jobs = Annotated[int, typer.Option(min=0, help="Processes at work (0: one for each core).")]
Plot = Annotated[bool, typer.Option("--plot/--no-plot", help="Draw the error.")]
Ascii = Annotated[bool, typer.Option("--ascii", help="Use 7-bit characters only.")]
NoColor = Annotated[bool, typer.Option("--no-color", help="Write no colours or control codes.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only the answer.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print residuals and timings on stderr.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")]


def torque_overrides(torques: list[float]) -> list[str]:
    """Torques of the command line as an override of the preset: the same checks, the same errors."""
    return [f"operation.M_g={torques!r}"] if torques else []


def shaft(text: str | None) -> Shaft | None:
    """A shaft of the command line: cam or output. Raises UsageError: anything else."""
    shafts: dict[str | None, Shaft | None] = {None: None, "cam": "cam", "output": "output"}
    if text not in shafts:
        raise UsageError(f"--angle-of must be cam or output, not {text}")
    return shafts[text]


def degrees_or_fit(option: str, text: str) -> float | None:
    """An angle [deg] of the command line, None for fit. Raises UsageError: anything else."""
    if text == "fit":
        return None
    try:
        angle = float(text)
    except ValueError:
        angle = float("nan")
    if not isfinite(angle):
        raise UsageError(f"{option} must be an angle in deg, or fit, not {text}")
    return angle
