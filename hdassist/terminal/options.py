"""Options of commands, declared once, in frozen groups that a command is made of.

A command is a frozen dataclass: it inherits the groups that it takes, has its own options as fields, its docstring is
its help, and `run` carries it out. Annotations stay objects here (no `from __future__ import annotations`): typer reads
them in the module of each command.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from math import isfinite, isnan
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

import typer

from hdassist.errors import UsageError
from hdassist.numerals import number_of

if TYPE_CHECKING:
    from hdassist.acceptance.limits import LimitText
    from hdassist.comparing.record import Alignment
    from hdassist.measuring.reading import Reading
    from hdassist.preset.fields import Drive
    from hdassist.readers.trace import TraceForm
    from hdassist.readers.wheels import WheelFiles
    from hdassist.terminal.output import Output

GroupT = TypeVar("GroupT", bound="OptionGroup")
MOST_JOBS = 512  # all of them begin at once: more would be a mistake that takes the machine with it

# options by the section of the help in which they stand (cli/help.py orders the sections)
answer_option = partial(typer.Option, rich_help_panel="Answer")
advanced_option = partial(typer.Option, rich_help_panel="Advanced")
drive_option = partial(typer.Option, rich_help_panel="Drive")
trace_option = partial(typer.Option, rich_help_panel="Measured trace")
teeth_option = partial(typer.Option, rich_help_panel="Measured teeth")
archive_option = partial(typer.Option, rich_help_panel="Archive")
lot_option = partial(typer.Option, rich_help_panel="Lot")
card_option = partial(typer.Option, rich_help_panel="Card")
trials_option = partial(typer.Option, rich_help_panel="Trials")

Preset = Annotated[
    str,
    typer.Argument(metavar="PRESET", help="Preset name, path, or - for stdin."),
]
Presets = Annotated[
    list[str],
    typer.Argument(metavar="PRESET", help="Preset names, paths, or - for stdin."),
]
OneTorque = Annotated[
    str | None, drive_option("--torque", metavar="N*M", show_default="first of the preset", help="Torque M_g.")
]
Traces = Annotated[list[str], typer.Argument(metavar="FILE", help="Measured traces, or - for stdin.")]
Plot = Annotated[bool, answer_option("--plot/--no-plot", show_default=False, help="Draw the error.")]
Details = Annotated[bool, answer_option("--details", help="All tables, not the short page.")]
AsJson = Annotated[bool, answer_option("--json", help="Print one JSON object.")]
Target = Annotated[
    str, answer_option("--output", "-o", metavar="FILE", help="Write the answer to FILE (- for stdout).")
]
Force = Annotated[bool, answer_option("--force", help="Overwrite existing files.")]
Ascii = Annotated[bool, advanced_option("--ascii", help="Use 7-bit characters only.")]
NoColor = Annotated[bool, advanced_option("--no-color", help="Write no colours or control codes.")]
Debug = Annotated[bool, advanced_option("--debug", help="Show a traceback on errors.")]
Limits = Annotated[
    list[str],
    drive_option(
        "--limit", metavar="[NAME@TORQUE=]VALUE", default_factory=list, show_default=False,
        help="Limit, of F_ior without a NAME.",
    ),
]  # fmt: skip
Solver = Annotated[
    str | None, advanced_option(metavar="NAME", help="Solve each state through cvxpy: daqp, clarabel, osqp ...")
]
CrossCheckOption = Annotated[str, advanced_option(metavar="NAME", help="Solver that solves some states again.")]
SeedOption = Annotated[int, advanced_option(metavar="N", min=0, help="Seed of all that is drawn.")]
DrawsOption = Annotated[
    int, advanced_option(metavar="N", min=0, max=100_000, help="Effective samples of unknown inputs, at least.")
]
VerdictProbability = Annotated[
    float, typer.Option(metavar="P", min=0.5, max=0.999, help="Probability of keeping it that PASS needs.")
]
Jobs = Annotated[
    int, advanced_option(metavar="N", min=0, max=MOST_JOBS, help="Processes at work (0: one for each core).")
]


@dataclass(frozen=True, kw_only=True)
class OptionGroup:
    """Options that several commands share, as fields."""

    def only(self, group: type[GroupT]) -> GroupT:
        """The options of one of the groups that a command is made of."""
        return group(**{each.name: getattr(self, each.name) for each in fields(group)})


@dataclass(frozen=True, kw_only=True)
class PageOptions(OptionGroup):
    """How an answer is given."""

    json: AsJson = False
    output: Target = "-"
    force: Force = False
    ascii: Ascii = False
    no_color: NoColor = False
    debug: Debug = False

    def replaces(self, _path: str) -> bool:
        """Whether an existing file may be replaced."""
        return self.force

    def open(self) -> "Output":
        """Where the answer goes; refuses files that cannot be written before anything is computed.

        Raises UsageError and DataError for such files.
        """
        import sys

        from hdassist.terminal.console import PIPE_WIDTH, Style
        from hdassist.terminal.files import take_output
        from hdassist.terminal.output import Output

        csv = getattr(self, "csv", None)
        for path in filter(None, (self.output, csv)):
            take_output(path, self.replaces(path))
        style = Style.of(sys.stdout, ascii=self.ascii, no_color=self.no_color)
        style = style if self.output == "-" else Style(style.ascii, False, PIPE_WIDTH)
        plots, details = getattr(self, "plot", True), getattr(self, "details", False)
        return Output(style, self.output, csv, self.force, self.no_color, plots, details)


@dataclass(frozen=True, kw_only=True)
class AnswerOptions(PageOptions):
    """How an answer that was computed is given."""

    quiet: Annotated[bool, answer_option("--quiet", "-q", help="Print only the answer.")] = False
    verbose: Annotated[bool, advanced_option("--verbose", "-v", help="Print residuals and timings on stderr.")] = False


@dataclass(frozen=True, kw_only=True)
class FigureOptions(AnswerOptions):
    """How an answer with a table of figures is given."""

    csv: Annotated[
        str | None, answer_option("--csv", metavar="FILE", help="Write the figures as CSV (- for stdout).")
    ] = None


@dataclass(frozen=True, kw_only=True)
class SamplingOptions(OptionGroup):
    """Samples of the inputs that are not known exactly: how many, from which seed, by how many processes."""

    draws: DrawsOption = 64
    seed: SeedOption = 0
    jobs: Jobs = 0


@dataclass(frozen=True, kw_only=True)
class DriveOptions(OptionGroup):
    """Changes of a preset."""

    overrides: Annotated[
        list[str],
        drive_option(
            "--set", metavar="KEY=VALUE", default_factory=list, show_default=False,
            help="Change a field, like tolerances.F_i2=60.",
        ),
    ]  # fmt: skip

    @property
    def changes(self) -> list[str]:
        """All that the options change of a preset, as overrides, in the order in which they apply."""
        return list(self.overrides)

    def load(self, preset: str) -> "Drive":
        """The drive of a preset with the changes. Raises DataError, PresetError or UsageError."""
        from hdassist.loading.load import load_preset

        return load_preset(preset, self.changes)


@dataclass(frozen=True, kw_only=True)
class LoadedDriveOptions(DriveOptions):
    """Changes of a preset, its torques among them."""

    torque: Annotated[
        list[str],
        drive_option(
            metavar="N*M", default_factory=list, show_default=False,
            help="Torque M_g instead of the preset's; 80, or '80 N·m'.",
        ),
    ]  # fmt: skip

    @property
    def changes(self) -> list[str]:
        """All that the options change of a preset, its torques too."""
        return [*super().changes, *torque_overrides(self.torque)]


@dataclass(frozen=True, kw_only=True)
class LimitedDriveOptions(LoadedDriveOptions):
    """Changes of a preset, its limits of F'_ior among them."""

    limit: Limits

    @property
    def limits(self) -> "tuple[LimitText, ...]":
        """Limits of F'_ior, those of all torques first. Raises UsageError for any other limit."""
        return limits_of_options(self.limit, only="F_ior")

    @property
    def changes(self) -> list[str]:
        """All that the options change of a preset, its limits too."""
        return [*super().changes, *(limit.override for limit in self.limits)]

    def load(self, preset: str) -> "Drive":
        """The drive of a preset with the changes.

        Raises DataError, PresetError or UsageError, the last also for a limit at a torque that the drive does not have.
        """
        from hdassist.acceptance.limits import load_limited

        drive = load_limited(preset, super().changes, self.limits)
        torques = drive.operation.M_g
        for limit in self.limits:
            if limit.torque is not None and limit.torque not in torques:
                at = ", ".join(f"{M_g:g}" for M_g in torques)
                raise UsageError(
                    f"--limit {limit}: {drive.name} is not computed at {limit.torque:g} N*m, but at {at}",
                    f"--torque {limit.torque:g}",
                )
        return drive


@dataclass(frozen=True, kw_only=True)
class PitchOptions(OptionGroup):
    """Measured teeth of the wheels in place of their first harmonics."""

    pitch_b: Annotated[
        str | None, teeth_option(metavar="FILE", help="Pitch deviations of the rigid wheel (- for stdin).")
    ] = None
    pitch_g: Annotated[str | None, teeth_option(metavar="FILE", help="Pitch deviations of the flexspline.")] = None
    mark_b: Annotated[
        float | None, teeth_option(metavar="DEG", help="Direction of the mark of --pitch-b [phases.xi_b].")
    ] = None
    mark_g: Annotated[
        float | None, teeth_option(metavar="DEG", help="Direction of the mark of --pitch-g [phases.xi_g].")
    ] = None
    pitch_form: Annotated[
        Literal["cumulative", "single"] | None,
        teeth_option(metavar="FORM", help="Deviations in the files: cumulative or single."),
    ] = None
    pitch_sense: Annotated[
        Literal["ccw", "cw"] | None,
        teeth_option(metavar="SENSE", help="Tooth numbers, seen from the cam: ccw or cw."),
    ] = None
    pitch_flank: Annotated[
        Literal["left", "right"] | None,
        teeth_option(metavar="FLANK", help="Flank to take of files with two: left or right."),
    ] = None

    def wheels(self) -> "WheelFiles":
        """The files and how they are read."""
        from hdassist.readers.wheels import WheelFiles

        return WheelFiles(**asdict(self.only(PitchOptions)))


@dataclass(frozen=True, kw_only=True)
class TraceOptions(OptionGroup):
    """How the file of a measured trace is read, and which part of its error is kept."""

    angle: Annotated[str | None, trace_option(metavar="NAME", help="Column of the angle, or its number.")] = None
    angle_of: Annotated[
        Literal["cam", "output"] | None, trace_option(metavar="SHAFT", help="Shaft of that angle: cam or output.")
    ] = None
    angle_unit: Annotated[
        str | None,
        trace_option(metavar="UNIT[,UNIT]", help="deg, rad, arcsec, arcmin, turn, or counts a turn, of each encoder."),
    ] = None
    error: Annotated[str | None, trace_option(metavar="NAME", help="Column of the error, or its number.")] = None
    error_unit: Annotated[str | None, trace_option(metavar="UNIT", help="arcsec, arcmin, deg, mdeg, rad, urad.")] = None
    second: Annotated[
        str | None, trace_option(metavar="NAME", help="Column of the output's angle, in place of --error.")
    ] = None
    wrap: Annotated[
        float | None, trace_option(metavar="DEG", help="Angle at which encoders restart.", show_default="guessed")
    ] = None
    robust: Annotated[bool, trace_option("--robust", help="Leave out faulty rows and readings far off.")] = False
    orders: Annotated[
        str | None, trace_option(metavar="LIST", help="Orders per cam turn to keep.", show_default="1-12")
    ] = None
    drift: Annotated[str, trace_option(metavar="KIND", help="Drift to remove: none, linear, quadratic.")] = "none"
    budget: Annotated[
        list[str],
        trace_option(
            metavar="NAME=ARCSEC", default_factory=list, show_default=False,
            help="Standard uncertainty of encoder and others.",
        ),
    ]  # fmt: skip

    def form(self) -> "TraceForm":
        """Columns of the file and their units, as the options give them."""
        from hdassist.readers.trace import TraceForm

        return TraceForm(**{each.name: getattr(self, each.name) for each in fields(TraceForm)})

    def reading(self) -> "Reading":
        """How files are read and looked at."""
        from hdassist.measuring.reading import Reading

        given = {each.name: getattr(self, each.name) for each in fields(Reading)}
        return Reading(**{**given, "budget": tuple(self.budget)})


@dataclass(frozen=True, kw_only=True)
class SignOptions(OptionGroup):
    """How the error and the cam's angle of a record count."""

    error_is: Annotated[
        Literal["cam-output", "output-cam"],
        trace_option(metavar="SIGN", help="Errors are cam-output (cam/ratio - output) or output-cam."),
    ] = "cam-output"
    cam_sense: Annotated[
        Literal["ccw", "cw"], trace_option(metavar="SENSE", help="Sense of angles, seen from the cam: ccw or cw.")
    ] = "ccw"

    def alignment(self) -> "Alignment":
        """The signs, with both angles given as 0."""
        from hdassist.comparing.record import Alignment

        sign = 1.0 if self.error_is == "cam-output" else -1.0
        return Alignment(sign=sign, sense=1.0 if self.cam_sense == "ccw" else -1.0)


@dataclass(frozen=True, kw_only=True)
class ChoiceOptions(OptionGroup):
    """How positions are chosen."""

    weights: Annotated[str | None, typer.Option(metavar="W,W", help="Weights of the torques, in their order.")] = None
    criterion: Annotated[str, typer.Option(metavar="NAME", help="Choose by expected, worst, or quantile=0.9.")] = (
        "expected"
    )

    def numbers(self) -> list[float] | None:
        """The weights as numbers. Raises UsageError for anything else."""
        if self.weights is None:
            return None
        weights = [number_of(word) for word in self.weights.split(",")]
        if any(map(isnan, weights)):
            raise UsageError(
                f"--weights must be numbers with commas between, not {self.weights!r}", "like --weights 2,1"
            )
        return weights


@dataclass(frozen=True, kw_only=True)
class CardOptions(OptionGroup):
    """An assembly card beside the answer."""

    card: Annotated[
        str | None, card_option(metavar="FILE", help="Write an assembly card: .html, .md or .txt (- for stdout).")
    ] = None
    lang: Annotated[str | None, card_option(metavar="NAME", help="Language of the card, such as ru [en].")] = None
    serial: Annotated[str | None, card_option(metavar="TEXT", help="Serial number on the card.")] = None


@dataclass(frozen=True, kw_only=True)
class TrialOptions(OptionGroup):
    """How trials are measured, and how sure the choice has to be."""

    trial_torque: Annotated[
        float | None, trials_option(metavar="N*M", help="Torque of the trials.", show_default="the lightest")
    ] = None
    noise: Annotated[
        float, trials_option(metavar="ARCSEC", min=1e-6, max=1e6, help="Standard deviation of one trial.")
    ] = 1.0
    sure: Annotated[
        float, trials_option(metavar="P", min=0.01, max=0.999, help="Probability of a good choice that settles it.")
    ] = 0.9

    def torque_of(self, torques: Sequence[float]) -> float:
        """Torque of the trials [N*m], of a drive with such torques."""
        return min(torques, key=abs) if self.trial_torque is None else self.trial_torque

    def words(self) -> list[str]:
        """The options as a shell takes them, where they are not the usual ones."""
        values = ((f"--{one.name.replace('_', '-')}", getattr(self, one.name), one.default) for one in fields(self))
        return [word for name, value, usual in values if value != usual for word in (name, f"{value:g}")]


def limits_of_options(texts: Sequence[str], only: str = "") -> "tuple[LimitText, ...]":
    """Limits of the command line, those of all torques first; only: name of the limits that a command holds.

    Raises UsageError: a text that is no limit, or one that the command does not hold.
    """
    from hdassist.acceptance.limits import LimitText

    found = [LimitText.parse(text, "--limit") for text in texts]
    for limit in found:
        if only and limit.name.partition("@")[0] != only:
            raise UsageError(f"--limit {limit}: expected a limit of {only}", "hdassist accept holds the others")
    return tuple(sorted(found, key=lambda limit: limit.torque is not None))


def torque_value(text: str) -> float:
    """Torque [N*m] of the command line, as 80 or '80 N·m'. Raises UsageError: any other text, or 0."""
    from hdassist.preset.requirements import option_value

    torque = option_value("--torque", text, "N*m")
    if not 0 < abs(torque) <= 1e7:
        raise UsageError(f"invalid --torque {text}: expected a torque in N*m up to 1e7, and not 0")
    return torque


def torque_overrides(texts: Sequence[str | None]) -> list[str]:
    """Torques of the command line, where given, as an override of the preset. Raises UsageError as above."""
    torques = [torque_value(text) for text in texts if text is not None]
    return [f"operation.M_g={torques!r}"] if torques else []


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
