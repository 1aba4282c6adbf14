"""Options that commands share, declared once: alone, or in groups that a command takes whole."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from copy import copy
from dataclasses import MISSING, dataclass, field, fields
from functools import wraps
from math import isfinite
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, get_args, get_origin, get_type_hints

import typer

from hdassist.errors import UsageError
from hdassist.numerals import number_of
from hdassist.terminal import completion
from hdassist.terminal.limits import require_memory

if TYPE_CHECKING:
    from hdassist.preset.fields import Drive
    from hdassist.readers.trace import Shaft, TraceForm
    from hdassist.run.cluster import Pool
    from hdassist.terminal.output import Output

Preset = Annotated[
    str,
    typer.Argument(metavar="PRESET", help="Preset name, path, or - for stdin.", autocompletion=completion.presets),
]
Presets = Annotated[
    list[str],
    typer.Argument(metavar="PRESET", help="Preset names, paths, or - for stdin.", autocompletion=completion.presets),
]
Overrides = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a preset field, e.g. tolerances.F_i2=60. Repeatable.",
        autocompletion=completion.overrides,
    ),
]
Torques = Annotated[
    list[float], typer.Option("--torque", help="Torque M_g in N*m, instead of the preset's. Repeatable.")
]
Traces = Annotated[list[str], typer.Argument(metavar="FILE", help="Measured traces, or - for stdin.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Target = Annotated[str, typer.Option("--output", "-o", metavar="FILE", help="Write the answer to FILE (- for stdout).")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite existing files.")]
Ascii = Annotated[bool, typer.Option("--ascii", help="Use 7-bit characters only.")]
NoColor = Annotated[bool, typer.Option("--no-color", help="Write no colours or control codes.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")]
Plot = Annotated[bool, typer.Option("--plot/--no-plot", help="Draw the error.")]
Details = Annotated[bool, typer.Option("--details", help="All tables, not the short page.", rich_help_panel="Answer")]
Solver = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Send each state through cvxpy to this solver (daqp, clarabel, osqp, ...)."),
]
CrossCheckOption = Annotated[
    str, typer.Option(metavar="NAME", help="Solver that solves the extremes and a sample of states again.")
]
SeedOption = Annotated[int, typer.Option(min=0, help="Seed of the sample that is solved again.")]
DrawsOption = Annotated[int, typer.Option(min=0, max=100_000, help="Drives drawn from what the preset leaves unknown.")]
VerdictProbability = Annotated[
    float, typer.Option(min=0.5, max=0.999, help="Probability of keeping a limit from which on the verdict is PASS.")
]
Bootstrap = Annotated[int, typer.Option(min=0, help="Seed of the bootstrap.")]
MOST_JOBS = 512  # all of them begin at once: more would be a mistake that takes the machine with it
Jobs = Annotated[int, typer.Option(min=0, max=MOST_JOBS, help="Processes at work (0: one for each core).")]


class OptionGroup:
    """Base of dataclasses whose fields are options; a command takes a group as one argument (`with_groups`).

    panel: the section of a help text in which they stand.
    """

    panel: ClassVar[str] = "Options"


@dataclass(frozen=True)
class PageOptions(OptionGroup):
    """How an answer is given."""

    panel: ClassVar[str] = "Answer"

    json: AsJson = False
    output: Target = "-"
    force: Force = False
    ascii: Ascii = False
    no_color: NoColor = False
    debug: Debug = False

    def open(self) -> Output:
        """Where the answer goes. Raises UsageError and DataError for files that cannot be written."""
        from hdassist.terminal.output import Output

        csv = getattr(self, "csv", None)
        return Output.open(self.output, csv, force=self.force, ascii=self.ascii, no_color=self.no_color)


@dataclass(frozen=True)
class AnswerOptions(PageOptions):
    """How an answer that was computed is given."""

    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only the answer.")] = False
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print residuals and timings on stderr.")] = False


@dataclass(frozen=True)
class FigureOptions(AnswerOptions):
    """How an answer with a table of figures is given."""

    csv: Annotated[
        str | None, typer.Option("--csv", metavar="FILE", help="Write the figures as CSV (- for stdout).")
    ] = None


@dataclass(frozen=True)
class DriveOptions(OptionGroup):
    """What is said of a drive beside its preset."""

    panel: ClassVar[str] = "Drive"

    overrides: Overrides = field(default_factory=list)

    def load(self, preset: str, *more: str) -> Drive:
        """The drive of a preset with the overrides, and more of them. Raises DataError, PresetError or UsageError."""
        from hdassist.loading.load import load_preset

        return load_preset(preset, [*self.overrides, *more])


@dataclass(frozen=True)
class LoadedDriveOptions(DriveOptions):
    """What is said of a drive and its torques beside its preset."""

    torque: Torques = field(default_factory=list)

    def load(self, preset: str, *more: str) -> Drive:
        """The drive of a preset with the overrides and torques. Raises DataError, PresetError or UsageError."""
        return super().load(preset, *more, *torque_overrides(self.torque))


@dataclass(frozen=True)
class PitchOptions(OptionGroup):
    """Measured teeth of the wheels in place of their first harmonics."""

    panel: ClassVar[str] = "Measured teeth"

    pitch_b: Annotated[
        str | None, typer.Option(metavar="FILE", help="Measured pitch deviations of the rigid wheel (- for stdin).")
    ] = None
    pitch_g: Annotated[
        str | None, typer.Option(metavar="FILE", help="Measured pitch deviations of the flexspline.")
    ] = None
    mark_b: Annotated[
        float | None, typer.Option(metavar="DEG", help="Direction of the mark of --pitch-b; phases.xi_b without.")
    ] = None
    mark_g: Annotated[
        float | None, typer.Option(metavar="DEG", help="Direction of the mark of --pitch-g; phases.xi_g without.")
    ] = None
    pitch_form: Annotated[
        Literal["cumulative", "single"] | None,
        typer.Option(help="Form of the deviations in the pitch files, whatever they say."),
    ] = None
    pitch_sense: Annotated[
        Literal["ccw", "cw"] | None, typer.Option(help="Sense of the tooth numbers in them, seen from the cam side.")
    ] = None
    pitch_flank: Annotated[
        Literal["left", "right"] | None, typer.Option(help="Flank to take from pitch files that have two.")
    ] = None


@dataclass(frozen=True)
class TraceOptions(OptionGroup):
    """How the file of a measured trace is read, and what is kept of it."""

    panel: ClassVar[str] = "Trace"

    angle: Annotated[str | None, typer.Option(metavar="NAME", help="Column of the angle, or its number.")] = None
    angle_of: Annotated[str | None, typer.Option(metavar="SHAFT", help="What turns by it: cam or output.")] = None
    angle_unit: Annotated[str | None, typer.Option(metavar="UNIT", help="deg, rad, arcsec, arcmin, turn.")] = None
    error: Annotated[str | None, typer.Option(metavar="NAME", help="Column of the error, or its number.")] = None
    error_unit: Annotated[str | None, typer.Option(metavar="UNIT", help="arcsec, arcmin, deg, mdeg, rad, urad.")] = None
    second: Annotated[
        str | None, typer.Option(metavar="NAME", help="Column of the output's own angle, instead of an error.")
    ] = None
    wrap: Annotated[
        float | None,
        typer.Option(metavar="DEG", help="Angle after which encoders begin again.", show_default="guessed"),
    ] = None
    orders: Annotated[
        str | None, typer.Option(metavar="LIST", help="Orders per cam turn to keep.", show_default="1-12")
    ] = None
    drift: Annotated[str, typer.Option(metavar="KIND", help="Drift to take off: none, linear, quadratic.")] = "none"
    budget: Annotated[
        list[str],
        typer.Option(
            metavar="NAME=ARCSEC,...",
            help="Standard uncertainty by encoder, coupling, reseating, temperature. Repeatable.",
        ),
    ] = field(default_factory=list)

    def form(self) -> TraceForm:
        """What is asked of the columns of the file. Raises UsageError for a shaft that is none."""
        from hdassist.readers.trace import TraceForm

        angle_of = shaft(self.angle_of)
        return TraceForm(self.angle, angle_of, self.angle_unit, self.error, self.error_unit, self.second, self.wrap)


@dataclass(frozen=True)
class CardOptions(OptionGroup):
    """An assembly card beside the answer."""

    panel: ClassVar[str] = "Card"

    card: Annotated[
        str | None, typer.Option(metavar="FILE", help="Write an assembly card: .html, .md or .txt (- for stdout).")
    ] = None
    lang: Annotated[str | None, typer.Option(metavar="NAME", help="Language of the card, such as ru (en without).")] = (
        None
    )
    serial: Annotated[str | None, typer.Option(metavar="TEXT", help="Serial number on the card.")] = None


@dataclass(frozen=True)
class TrialOptions(OptionGroup):
    """How trials are measured, and how sure the choice has to be."""

    panel: ClassVar[str] = "Trials"

    trial_torque: Annotated[
        float | None, typer.Option(metavar="N*M", help="Torque of the trials; the lightest of the torques without it.")
    ] = None
    noise: Annotated[
        float, typer.Option(metavar="ARCSEC", min=1e-6, max=1e6, help="Standard deviation of a trial; repeats tell it.")
    ] = 1.0
    reseat: Annotated[
        float, typer.Option(metavar="UM", min=0, max=1000, help="Standard deviation of where the wheel sits.")
    ] = 0.0
    sure: Annotated[
        float, typer.Option(metavar="SHARE", min=0.01, max=0.999, help="Probability of a good choice that settles it.")
    ] = 0.9

    def torque_of(self, torques: Sequence[float]) -> float:
        """Torque of the trials [N*m], of a drive with such torques."""
        return min(torques, key=abs) if self.trial_torque is None else self.trial_torque

    def words(self) -> list[str]:
        """The options as a shell takes them, where they are not the usual ones."""
        told = ((f"--{one.name.replace('_', '-')}", getattr(self, one.name), one.default) for one in fields(self))
        return [word for name, value, usual in told if value != usual for word in (name, f"{value:g}")]


@dataclass(frozen=True)
class WorkOptions(OptionGroup):
    """Where the work of many items is done."""

    panel: ClassVar[str] = "Work"

    jobs: Jobs = 0
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Work on a dask cluster: tls://HOST:PORT or tcp://HOST:PORT."),
    ] = None
    scheduler_file: Annotated[
        str | None, typer.Option(metavar="FILE", help="The same, its address in the file that its scheduler wrote.")
    ] = None

    def pools(self) -> AbstractContextManager[Pool]:
        """What begins executors, for `stream`. Raises UsageError and DataError: a cluster that cannot be used."""
        from hdassist.run.cluster import pools, scheduler_address
        from hdassist.terminal.output import warn

        address = scheduler_address(self.scheduler, self.scheduler_file)
        if address is not None and not address.startswith("tls:"):
            warn(f"{address} asks for no key: whoever reaches it can run programs as you; tls:// keeps strangers out")
        return pools(address, self.jobs)


def with_groups(command: Callable[..., None]) -> Callable[..., None]:
    """A command with the options of its groups in its signature, as Typer reads it.

    Each parameter of the command that is an OptionGroup becomes the group's fields; when the command runs, groups
    are made of them again.
    """
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, type[Any]] = {}
    shown: list[inspect.Parameter] = []
    for name, parameter in inspect.signature(command).parameters.items():
        hint = hints[name]
        if isinstance(hint, type) and issubclass(hint, OptionGroup):
            groups[name] = hint
            shown += _parameters(hint)
        else:
            shown.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=hint))

    @wraps(command)
    def run(**given: Any) -> None:
        require_memory()
        made = {name: group(**{f.name: given.pop(f.name) for f in fields(group)}) for name, group in groups.items()}
        try:
            command(**given, **made)
        except KeyboardInterrupt:  # before anything was there to answer with
            from hdassist.terminal.output import note

            note("interrupted")
            raise typer.Exit(130) from None

    run.__signature__ = inspect.Signature(shown)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in shown}
    return run


def _parameters(group: type[Any]) -> list[inspect.Parameter]:
    """The fields of a group as parameters of a command."""
    hints = {name: _in_panel(hint, group.panel) for name, hint in get_type_hints(group, include_extras=True).items()}
    return [
        inspect.Parameter(
            one.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=one.default if one.default_factory is MISSING else one.default_factory(),
            annotation=hints[one.name],
        )
        for one in fields(group)
    ]


def _in_panel(hint: Any, panel: str) -> Any:
    """An annotated option, in a section of the help text."""
    if get_origin(hint) is not Annotated:
        return hint
    kind, info = get_args(hint)
    info = copy(info)
    info.rich_help_panel = panel
    return Annotated[kind, info]


def torque_overrides(torques: list[float] | float | None) -> list[str]:
    """Torques of the command line as an override of the preset: the same checks, the same errors."""
    torques = [] if torques is None else [torques] if isinstance(torques, float) else torques
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
    angle = number_of(text)
    if not isfinite(angle):
        raise UsageError(f"{option} must be an angle in deg, or fit, not {text}")
    return angle


def stdin_once(*names: str | None) -> None:
    """Raise UsageError where standard input is named twice."""
    if names.count("-") > 1:
        raise UsageError("standard input can be read once only")
