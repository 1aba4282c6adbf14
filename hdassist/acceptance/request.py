"""What is asked of an acceptance, as plain data: it can be kept beside the answer and carried out again."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import isnan
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PlainSerializer

from hdassist.acceptance.accept import AcceptanceResult, accept, without_values
from hdassist.acceptance.decision import Value
from hdassist.acceptance.limit_parser import LimitText
from hdassist.acceptance.limits import Limit, limits_of
from hdassist.acceptance.predictions import Predictions, predict
from hdassist.design.check import DRAWS
from hdassist.errors import UsageError
from hdassist.loading.load import load_preset
from hdassist.measuring.cycle import gearing_of
from hdassist.measuring.measure import Measurement, measure
from hdassist.measuring.orders import parse_orders
from hdassist.measuring.uncertainty import parse_stated
from hdassist.model.wheels import MeasuredTeeth
from hdassist.numerals import number_of
from hdassist.preset.fields import Drive
from hdassist.preset.kinds import Line
from hdassist.preset.yamltext import OVERRIDE
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.readers.wheels import WheelFiles
from hdassist.run.kept import ClosedRecord
from hdassist.run.run import Run
from hdassist.solve.window import in_wide_enough_window, with_window
from hdassist.verdict import SURE

TORQUE_AND_FILE = re.compile(r"([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?):(.+)", re.DOTALL)
_OVERRIDE = re.compile(rf"^{OVERRIDE}:(\d+):\d+: ", re.MULTILINE)
FailOn = Literal["warn", "fail", "never"]
Seed = Annotated[int, Field(ge=0)]  # of what is drawn


@dataclass(frozen=True)
class TraceFile:
    """A measured trace: its torque as written, empty where the limits of the drive have to tell it, and its file."""

    torque: str
    file: str

    @classmethod
    def parse(cls, text: str) -> TraceFile:
        """Read 80:FILE or FILE."""
        match = TORQUE_AND_FILE.fullmatch(text)
        return cls(match[1], match[2]) if match else cls("", text)

    def __str__(self) -> str:
        return f"{self.torque}:{self.file}" if self.torque else self.file

    def at(self, drive: Drive) -> float:
        """Torque [N*m]. Raises UsageError: it is none, or the limits of the drive leave it open."""
        if self.torque:
            if isnan(M_g := number_of(self.torque)):
                raise UsageError(f"--measured {self}: {self.torque} is no torque", "like 80:run.csv")
            return M_g
        torques = list(dict.fromkeys(limit.M_g for limit in limits_of(drive) if limit.M_g is not None))
        if len(torques) > 1:
            named = ", ".join(f"{M_g:g}:{self}" for M_g in torques)
            raise UsageError(f"--measured {self}: at which torque was it measured?", f"one of {named}")
        return (torques or list(drive.operation.M_g))[0]


def _kept_as_text(read: Callable[[str], Any]) -> tuple[BeforeValidator, PlainSerializer]:
    """How a typed text stands in a file: as it is written."""

    def checked(text: Any) -> Any:
        if not isinstance(text, str):
            raise ValueError("must be text")
        try:
            return read(text)
        except UsageError as error:
            raise ValueError(error.message) from None

    return BeforeValidator(checked), PlainSerializer(str)


_BOUND = _kept_as_text(lambda text: LimitText.parse(text, "--limit"))
_VALUE = _kept_as_text(lambda text: LimitText.parse(text, "--value"))
_TRACE = _kept_as_text(TraceFile.parse)


@dataclass(frozen=True)
class Reading(ClosedRecord, TraceForm):
    """How measured traces are read and looked at: the options of `hdassist measure`."""

    orders: str | None = None
    drift: str = "none"
    budget: tuple[str, ...] = ()


@dataclass(frozen=True)
class Wheels(ClosedRecord, WheelFiles):
    """Pitch files of the drive's wheels, and how they are read: the options of `hdassist check`."""


@dataclass(frozen=True)
class Request(ClosedRecord):
    """One drive to accept.

    preset, a name, path or -; serial, of the drive, for reports; overrides of the preset, as on the command line;
    limits, instead of the preset's; measured, traces; values, measured otherwise; reading, how traces are read;
    measured_only, predict nothing; cross_check, solver of some predicted states again; draws, effective samples of what
    is not known at least; sure, probability of keeping a limit that PASS of a prediction needs; seed; wheels, with
    measured teeth, for predictions.
    """

    preset: Line
    serial: Line = ""
    overrides: tuple[str, ...] = ()
    limits: tuple[Annotated[LimitText, *_BOUND], ...] = ()
    measured: tuple[Annotated[TraceFile, *_TRACE], ...] = ()
    values: tuple[Annotated[LimitText, *_VALUE], ...] = ()
    reading: Reading = field(default_factory=Reading)
    measured_only: bool = False
    cross_check: str = "highs"
    seed: Seed = 0
    wheels: Wheels = field(default_factory=Wheels)
    draws: Annotated[int, Field(ge=0)] = DRAWS
    sure: Annotated[float, Field(ge=0.5, lt=1)] = SURE

    @property
    def effort(self) -> dict[str, Any]:
        """How predictions are made, as arguments of predict and accept."""
        return {"draws": self.draws, "sure": self.sure}

    def seeded(self, run: Run) -> Run:
        """A run with the seed and the other solver of the request."""
        return replace(run, seed=self.seed, cross_check=self.cross_check)

    def files(self) -> list[str]:
        """Paths of all that is read for it; its preset may be one of the library."""
        return [self.preset, *(trace.file for trace in self.measured), *self.wheels.files.values()]

    def load(self) -> Drive:
        """The drive, its limits included. Raises DataError, PresetError or UsageError (a bad override or limit)."""
        try:
            return load_preset(self.preset, [*self.overrides, *(limit.override for limit in self.limits)])
        except UsageError as error:
            raise UsageError(self.as_said(error.message), error.hint) from None

    def as_said(self, message: str, *, overrides: bool = False) -> str:
        """A message about overrides of its preset that names limits as they were given; with overrides, those too."""

        def name(match: re.Match[str]) -> str:
            place = int(match[1]) - 1
            if place >= len(self.overrides):
                return f"--limit {self.limits[place - len(self.overrides)]}: "
            return f"{OVERRIDE} {self.overrides[place]}: " if overrides else match[0]

        return _OVERRIDE.sub(name, message)


def read_measurements(request: Request, drive: Drive) -> dict[float, Measurement]:
    """Traces of a request by their torque [N*m].

    Raises UsageError where the torque of a trace is open or stands twice; PresetError or DataError for a file that
    cannot be used; UntrustedError where a record does not tell its orders apart.
    """
    files: dict[float, str] = {}
    for trace in request.measured:
        torque = trace.at(drive)
        if torque in files:
            raise UsageError(f"two traces at {torque:g} N*m", "one trace a torque: join repeated runs in one file")
        files[torque] = trace.file
    reading, gearing = request.reading, gearing_of(drive, None)
    stated, ratio = parse_stated(reading.budget), gearing.ratio if gearing else None
    return {
        torque: measure(
            read_trace(path, reading, ratio),
            drive=drive,
            orders=parse_orders(reading.orders or None),
            drift=reading.drift,
            stated=stated,
            seed=request.seed,
        )
        for torque, path in files.items()
    }


def read_wheels(request: Request, drive: Drive) -> MeasuredTeeth | None:
    """Measured wheels of a request; None without any, and where nothing is predicted.

    Raises what WheelFiles.read does.
    """
    return None if request.measured_only else request.wheels.read(drive)


def stated_values(texts: Sequence[LimitText], drive: Drive) -> dict[Limit, Value]:
    """Values measured otherwise, by the limit of the drive that they are for.

    Raises UsageError: a text that is no value, one without its uncertainty, or one that no limit of the drive is for.
    """
    limits = limits_of(drive) if texts else ()
    found: dict[Limit, Value] = {}
    for text in texts:
        limit = text.limit_of(limits)
        if limit in found:
            raise UsageError(f"--value {text}: given twice")
        found[limit] = text.value_for(limit)
    return found


def predict_for(request: Request) -> Predictions | None:
    """Predictions that a request needs, without a look at what was measured; None where it needs none.

    Raises DataError: no limit, or something measured that no limit is for; UntrustedError: no answer to be trusted.
    """
    drive = request.load()
    limits = limits_of(drive)
    torques, stated = [trace.at(drive) for trace in request.measured], [v.limit_of(limits) for v in request.values]
    left = () if request.measured_only else without_values(drive, torques, stated)
    if not left:
        return None
    wheels, run = read_wheels(request, drive), request.seeded(Run())
    analysis = partial(predict, limits=left, wheels=wheels, run=run, **request.effort)
    return in_wide_enough_window(drive, analysis)


def carry_out(
    request: Request,
    drive: Drive,
    measurements: Mapping[float, Measurement],
    wheels: MeasuredTeeth | None = None,
    *,
    predictions: Predictions | None = None,
    run: Run = Run(),
) -> AcceptanceResult:
    """Accept the drive of a request, loaded and measured before.

    Arguments: measurements by torque [N*m]; wheels, with measured teeth; predictions, where they are known already,
    else run for them. Raises DataError: no limit, or something measured that no limit is for;
    UsageError: a value that no limit is for; UntrustedError where a prediction cannot be trusted.
    """
    analysis = partial(
        accept,
        measurements=measurements,
        wheels=wheels,
        stated=stated_values(request.values, drive),
        measured_only=request.measured_only,
        predictions=predictions,
        run=request.seeded(run),
        **request.effort,
    )
    there = with_window(drive, predictions.prior.drive.numerics.window) if predictions else drive
    return in_wide_enough_window(there, analysis)
