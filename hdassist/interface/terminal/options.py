"""Groups of options from which commands inherit.

A command is a frozen dataclass. It inherits groups of options, its own options are fields, and its docstring is its
help. `report` returns the report on a preset, which `run` writes; commands without a report on each preset define `run`
themselves. A field has a type and a default; options.toml contains the texts of each field, by class and field.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from inspect import get_annotations
from math import isfinite
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeVar, dataclass_transform, get_origin

import typer

from hdassist.features.report import Report
from hdassist.interface.terminal.output import Output, failure, give, json_text, run_each
from hdassist.interface.terminal.streams import PIPE_WIDTH, Style, require_parquet, say, take_output, write_text
from hdassist.run.errors import HdassistError, UsageError
from hdassist.run.files import is_written, number_of, package_table

if TYPE_CHECKING:
    from hdassist.drive.model.deviations import MeasuredTeeth
    from hdassist.drive.preset.fields import AskedOption, Drive
    from hdassist.features.acceptance.limits import LimitText
    from hdassist.features.measuring.measure import Reading
    from hdassist.features.record_comparison.record import Alignment
    from hdassist.readers.pitch import WheelFiles

_PartT = TypeVar("_PartT")
DECLARED = package_table("interface/terminal/options.toml")


def _declared_parameter(
    field: str,
    kind: object,
    *,
    is_argument: bool = False,
    is_required: bool = False,
    names: Sequence[str] = (),
    section: str | None = None,
    **parameters: Any,
) -> Any:
    """Return the type of a field, annotated with the typer option or argument that options.toml declares."""
    if get_origin(kind) is list and not is_required:
        parameters = {"default_factory": list, "show_default": False} | parameters
    if is_argument:
        return Annotated[kind, typer.Argument(**parameters)]
    return Annotated[kind, typer.Option(*names or [option_name(field)], rich_help_panel=section, **parameters)]


def option_name(field: str) -> str:
    """Return the name of the option for a field."""
    return f"--{field.replace('_', '-')}"


@dataclass_transform(frozen_default=True, kw_only_default=True)
@dataclass(frozen=True, kw_only=True)
class OptionGroup:
    """Group of options, one per field; each subclass becomes a frozen dataclass without a decorator."""

    def __init_subclass__(cls) -> None:
        """Annotate each field declared in options.toml with its typer option, and make the class a dataclass."""
        declared = DECLARED["any"] | DECLARED.get(cls.__name__, {})
        for field, kind in get_annotations(cls, eval_str=True).items():
            if field in declared and not hasattr(kind, "__metadata__"):
                cls.__annotations__[field] = _declared_parameter(
                    field,
                    kind,
                    **declared[field],
                )
        dataclass(frozen=True, kw_only=True)(cls)

    @classmethod
    def command_name(cls) -> str:
        """Return the name of the command, for example presets-show for the class PresetsShowCommand."""
        return "-".join(re.findall("[A-Z][a-z]+", cls.__name__)[:-1]).lower()

    @classmethod
    def typed(cls, field: str, value: object) -> str:
        """Return a field and its value as text for the command line: an option with the value, or an argument."""
        tables = [DECLARED.get(base.__name__, {}) for base in cls.__mro__]
        declared: dict[str, Any] = next((table[field] for table in [*tables, DECLARED["any"]] if field in table), {})
        if declared.get("is_argument"):
            return str(value)
        name, _, off = declared.get("names", [option_name(field)])[0].partition("/")
        if isinstance(value, bool):
            return name if value else str(off)
        number = str(value).removesuffix(".0")
        return f"{name}={number}" if name.startswith("--") else f"{name}{number}"

    def only(self, part: type[_PartT]) -> _PartT:
        """Return one of the command's groups of options, or another dataclass with some of the same fields."""
        # the type variable cannot be restricted to dataclasses
        names = [field.name for field in fields(part)]  # type: ignore[arg-type]
        return part(**{name: getattr(self, name) for name in names})

    def given(self) -> Iterator[tuple[str, object]]:
        """Yield the name and value of each option that differs from its default; a list gives one pair per value."""
        values_of_fields = ((f, getattr(self, f.name)) for f in fields(self))
        items = ((f, item) for f, value in values_of_fields for item in (value if isinstance(value, list) else [value]))
        return ((f.name, item) for f, item in items if item != f.default)


class PageOptions(OptionGroup):
    """Options for the output of a result."""

    json: bool = False
    output: str = "-"
    force: bool = False
    ascii: bool = False
    no_color: bool = False
    debug: bool = False
    beside: ClassVar[tuple[str, ...]] = ("csv", "parquet")  # options that name a further output file

    @property
    def answer_file(self) -> str:
        """File of the result, "-" for standard output."""
        return self.output

    def replaces(self, _path: str) -> bool:
        """Return whether an existing output file may be replaced."""
        return self.force

    def open(self) -> Output:
        """Return the output, after checking that its files can be written.

        Raises UsageError or DataError for a file that cannot be written, and UsageError if two results would use
        standard output.
        """
        import sys

        paths = {name: path for name in self.beside if (path := getattr(self, name, None)) is not None}
        paths_by_form = {**paths, "json": self.answer_file if self.json else None}
        if len(printed := [option_name(name) for name, path in paths_by_form.items() if path == "-"]) > 1:
            message = f"only one of {' and '.join(printed)} can use standard output"
            raise UsageError(message, f"write one of them to a file: {printed[0]} FILE")
        for path in (self.answer_file, *paths.values()):
            take_output(path, self.replaces(path))

        # options that are also fields of an Output
        shared_names = {field.name for field in fields(Output)} & vars(self).keys()
        options = {name: getattr(self, name) for name in shared_names}
        style = Style.of(
            sys.stdout,
            ascii=self.ascii,
            no_color=self.no_color,
        )
        if self.answer_file != "-":
            style = Style(style.ascii, codes=False, width=PIPE_WIDTH)
        has_page = self.answer_file != "-" or "-" not in paths.values()
        return Output(style, self.answer_file, has_page=has_page, **options)

    def run(self) -> int:
        """Write the reports on all presets of the command, and return the exit code."""
        out = self.open()
        presets = getattr(self, "presets", None) or [getattr(self, "preset", "")]
        command = self.command_name()
        return give(command, run_each(command, presets, partial(self.report, out), out), out)

    def give_failure(self, command: str, error: HdassistError) -> None:
        """Write the error that ended a command as its JSON result, unless a result was already written.

        Raises UsageError or DataError if the result cannot be written.
        """
        if self.json and not is_written(self.answer_file):
            answer = failure(
                command,
                error,
                preset=getattr(self, "preset", None),
            )
            write_text(self.answer_file, json_text(answer), self.force)

    def report(self, out: Output, preset: str) -> Report:
        """Return the report on a preset; out: output that shows the progress."""
        raise NotImplementedError  # commands with their own `run` do not call this method


class AnswerOptions(PageOptions):
    """Options for the output of a computed result."""

    quiet: bool = False
    verbose: bool = False


class FigureOptions(AnswerOptions):
    """Options for the output of a result with a table of numbers."""

    csv: str | None = None


class PlotOptions(FigureOptions):
    """Options for the output of a result with figures, plots and details."""

    plot: bool = True
    details: bool = False


class RowsOptions(PlotOptions):
    """Options for the output of a result with many records."""

    parquet: str | None = None

    def open(self) -> Output:
        """Return the output, after checking that its files can be written."""
        if self.parquet is not None:
            require_parquet(self.parquet)
        return super().open()


class SamplingOptions(OptionGroup):
    """Samples of the uncertain inputs: number, seed and processes."""

    draws: int = 64
    seed: int = 0
    jobs: int = 0


class DriveOptions(OptionGroup):
    """Changes of a preset."""

    overrides: list[str]

    @property
    def changes(self) -> list[str]:
        """Changes of the preset by the options, as overrides in the order in which they apply."""
        return list(self.overrides)

    def load(self, preset: str) -> Drive:
        """Return the drive of a preset with the changes. Raises DataError, PresetError or UsageError."""
        from hdassist.drive.loading import load_preset

        return load_preset(preset, self.changes, self.taken_over())

    def taken_over(self) -> tuple[AskedOption, ...]:
        """Return the given options that affect the result, which the next command on the drive may take over."""
        from hdassist.drive.preset.fields import AskedOption

        command = self.command_name()
        other_names = _OF_DRIVES | _OF_RUNS
        other_names |= {field.name for group in _OF_PAGES for field in fields(group)}
        stated_options = [(name, value) for name, value in self.given() if name not in other_names]
        return tuple(AskedOption(command, name, self.typed(name, value)) for name, value in stated_options)


class LoadedDriveOptions(DriveOptions):
    """Changes of a preset including its torques; a torque of 0 means no load."""

    torque: list[str]

    @property
    def changes(self) -> list[str]:
        """Changes of the preset by the options, including the torques."""
        return [*super().changes, *torque_overrides(self.torque)]

    def load(self, preset: str) -> Drive:
        """Return the drive of a preset with the changes. Raises DataError, PresetError or UsageError."""
        if not any(map(_is_no_load, self.torque)):
            return self.load_at_torques(preset)
        no_load_Nm = _no_load_of(preset, self.overrides)
        torques = [f"{no_load_Nm:.6g}" if _is_no_load(text) else text for text in self.torque]
        return _with_no_load_warning(replace(self, torque=torques).load_at_torques(preset), no_load_Nm)

    def load_at_torques(self, preset: str) -> Drive:
        """Return the drive of a preset with changes that include no torque of 0. Raises the errors of `load`."""
        return DriveOptions.load(self, preset)


class OneTorqueOptions(DriveOptions):
    """Changes of a preset including a single torque."""

    torque: str | None = None

    @property
    def changes(self) -> list[str]:
        """Changes of the preset by the options, including the torque."""
        return [*super().changes, *torque_overrides([self.torque])]

    def load(self, preset: str) -> Drive:
        """Return the drive of a preset with the changes. Raises DataError, PresetError or UsageError."""
        if self.torque is None or not _is_no_load(self.torque):
            return DriveOptions.load(self, preset)
        no_load_Nm = _no_load_of(preset, self.overrides)
        loaded = replace(self, torque=f"{no_load_Nm:.6g}")
        return _with_no_load_warning(DriveOptions.load(loaded, preset), no_load_Nm)


class LimitedDriveOptions(LoadedDriveOptions):
    """Changes of a preset including its limits of F'_ior."""

    limit: list[str]

    @property
    def limits(self) -> tuple[LimitText, ...]:
        """Limits of F'_ior, those for all torques first. Raises UsageError for a limit of another quantity."""
        return limits_of_options(self.limit, only="F_ior")

    def load_at_torques(self, preset: str) -> Drive:
        """Return the drive of a preset with the changes, none of which is a torque of 0.

        Raises DataError, PresetError or UsageError; UsageError also for a limit at a torque that is not computed.
        """
        from hdassist.features.acceptance.limits import load_limited

        drive = load_limited(preset, self.changes, self.limits, self.taken_over())
        torques = drive.operation.M_g
        for limit in self.limits:
            if limit.torque is not None and limit.torque not in torques:
                torque_list = ", ".join(f"{M_g:g}" for M_g in torques)
                raise UsageError(
                    f"--limit {limit}: {drive.name} is not computed at {limit.torque:g} N*m, but at {torque_list}",
                    f"add --torque {limit.torque:g}",
                )
        return drive


class PitchOptions(OptionGroup):
    """Measured tooth deviations of the wheels, which replace their first harmonics."""

    pitch_b: str | None = None
    pitch_g: str | None = None
    mark_b: float | None = None
    mark_g: float | None = None
    pitch_form: Literal["cumulative", "single"] | None = None
    pitch_sense: Literal["ccw", "cw"] | None = None
    pitch_flank: Literal["left", "right"] | None = None

    def wheels(self) -> WheelFiles:
        """Return the files of measured teeth and the conventions for reading them."""
        from hdassist.readers.pitch import WheelFiles

        return self.only(WheelFiles)

    def wheels_of_one(self, presets: Sequence[str]) -> WheelFiles:
        """Return the files of measured teeth of a single drive. Raises UsageError for contradictory options."""
        wheels = self.wheels()
        wheels.require_sound()
        if wheels.files and len(presets) > 1:
            raise UsageError(
                f"the pitch files belong to one drive, but {len(presets)} presets are named",
                "check one drive at a time",
            )
        stdin_once(*presets, *wheels.files.values())
        return wheels

    @staticmethod
    def teeth(files: WheelFiles, drive: Drive) -> MeasuredTeeth | None:
        """Read the measured teeth of a drive, and report assumptions on standard error.

        Return None if there are no files. Raises PresetError for a file with invalid contents, and DataError for a file
        that cannot be read.
        """
        measured = files.read(drive)
        note_teeth(measured)
        return measured


class TraceOptions(OptionGroup):
    """Options for reading the file of a recording, and for the part of its error that is evaluated."""

    angle: str | None = None
    angle_of: Literal["cam", "output"] | None = None
    angle_unit: str | None = None
    error: str | None = None
    error_unit: str | None = None
    second: str | None = None
    wrap: float | None = None
    robust: bool = False
    orders: str | None = None
    drift: str = "none"
    budget: list[str]
    speed: float | None = None
    declination: float | None = None
    guide_rate: float | None = None
    period: float | None = None

    def reading(self) -> Reading:
        """Return the options for reading and evaluating recordings."""
        from hdassist.features.measuring.measure import Reading

        return replace(self.only(Reading), budget=tuple(self.budget))

    def words_of_reading(self) -> list[str]:
        """Return the given options as text, to be repeated in the next command on the same file."""
        return [self.typed(name, value) for name, value in self.only(TraceOptions).given()]


class SignOptions(OptionGroup):
    """Sign conventions of the error and the input angle of a recording."""

    error_is: Literal["cam-output", "output-cam"] = "cam-output"
    cam_sense: Literal["ccw", "cw"] = "ccw"

    def alignment(self) -> Alignment:
        """Return the sign conventions, with start and zero given as 0."""
        from hdassist.features.record_comparison.record import Alignment

        sign = 1.0 if self.error_is == "cam-output" else -1.0
        return Alignment(sign=sign, sense=1.0 if self.cam_sense == "ccw" else -1.0)


class CardOptions(OptionGroup):
    """Options for an assembly card, which is written in addition to the result."""

    card: str | None = None
    lang: str | None = None
    serial: str | None = None


class TrialOptions(OptionGroup):
    """Options for measured values in holes, and for the required probability of the choice."""

    trial_torque: float | None = None
    noise: float = 1.0
    sure: float | None = None

    def torque_of(self, torques: Sequence[float]) -> float:
        """Return the torque of the measured values [N*m]: --trial-torque, or the smallest torque of the drive."""
        return min(torques, key=abs) if self.trial_torque is None else self.trial_torque


def limits_of_options(texts: Sequence[str], only: str = "") -> tuple[LimitText, ...]:
    """Return the limits from the command line, those for all torques first.

    texts: limits as entered.
    only: name of the quantity whose limits the command uses; empty if it uses all limits.
    Raises UsageError for a text that is not a limit, and for a limit that the command does not use.
    """
    from hdassist.features.acceptance.limits import LimitText

    limits = [LimitText.parse(text, "--limit") for text in texts]
    for limit in limits:
        if only and limit.name.partition("@")[0] != only:
            raise UsageError(f"--limit {limit}: expected a limit of {only}", "use hdassist accept for other limits")
    return tuple(sorted(limits, key=lambda limit: limit.torque is not None))


def _is_no_load(text: str) -> bool:
    """Return whether a torque from the command line is 0 in any unit. Raises UsageError for an invalid torque."""
    from hdassist.drive.preset.knowledge import option_value

    return option_value("--torque", text, "N*m") == 0


def _no_load_of(preset: str, overrides: Sequence[str]) -> float:
    """Return the torque at which a drive without load is computed [N*m].

    Raises UsageError for a preset from standard input, which can be read only once.
    """
    from hdassist.belief.evidence import ACCURACY_LOAD
    from hdassist.drive.loading import load_preset

    if preset == "-":
        hint = "save the preset in a file, or state a small torque"
        raise UsageError("--torque 0 reads the preset twice, but standard input can be read only once", hint)
    return ACCURACY_LOAD * load_preset(preset, overrides).rated_torque


def _with_no_load_warning(drive: Drive, no_load_Nm: float) -> Drive:
    """Return the drive with a warning about no_load_Nm, the torque [N*m] at which it is computed without load."""
    from hdassist.drive.loading import with_warning

    text = (
        f"no load (--torque 0) is computed at {no_load_Nm:.4g} N*m, 2 % of the rated torque, as in the comparison with "
        "the catalogue accuracy. Without any torque, the output is undetermined within the backlash"
    )
    return with_warning(drive, text)


def torque_overrides(texts: Sequence[str | None]) -> list[str]:
    """Return a list with the override of the preset by torques from the command line; empty without torques.

    texts: torques, such as 80 or '80 N·m'; None for an option that was not given.
    Raises UsageError for an invalid torque, or 0.
    """
    from hdassist.drive.preset.knowledge import option_value

    stated_texts = [text for text in texts if text is not None]
    torques = [option_value("--torque", text, "N*m") for text in stated_texts]
    for text, torque in zip(stated_texts, torques, strict=True):
        if not 0 < abs(torque) <= 1e7:
            hint = "commands such as check, trace and mount accept 0 for no load" if not torque else ""
            raise UsageError(f"invalid --torque {text}: expected a torque in N*m up to 1e7, other than 0", hint)
    return [f"operation.M_g={torques!r}"] if torques else []


def degrees_or_fit(option: str, text: str) -> float | None:
    """Return an angle [deg] from the command line, None for the word fit. Raises UsageError for any other text."""
    if text == "fit":
        return None
    angle = number_of(text)
    if not isfinite(angle):
        raise UsageError(
            f"invalid {option} {text}: expected an angle in degrees, or fit", f"use, for example, {option} 30"
        )
    return angle


def note_teeth(measured: MeasuredTeeth | None) -> None:
    """Report the assumptions about measured teeth on standard error."""
    from hdassist.interface.terminal.words import WHEEL_WORDS

    for name, wheel in measured.by_name.items() if measured else ():
        for text in wheel.pitch.notes:
            say(f"note: {WHEEL_WORDS[name]}, {wheel.pitch.file}: {text}")


def stdin_once(*names: str | None) -> None:
    """Raise UsageError if more than one of the names is standard input."""
    if names.count("-") > 1:
        raise UsageError("standard input can be read only once", "save one of the inputs as a file, and name this file")


_OF_PAGES = (RowsOptions, CardOptions)  # groups of options for the output, which do not affect the result
# options that a next command states with the drive
_OF_DRIVES = {"preset", "presets", "files", "overrides", "torque", "limit"}
_OF_RUNS = {"jobs", "executor", "junit", "write"}
