"""The request of an acceptance as plain data: kept beside the answer, it can be carried out again."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import isnan
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PlainSerializer

from hdassist.acceptance.decision import AcceptedValue
from hdassist.acceptance.limits import Limit, LimitText, limits_of, named_limits
from hdassist.acceptance.predictions import Predictions, order_place, predict
from hdassist.belief.samples import EFFECTIVE_SAMPLES
from hdassist.errors import DataError, UsageError
from hdassist.loading.load import load_preset
from hdassist.measuring.measure import Measurement, measure
from hdassist.measuring.orders import parse_orders
from hdassist.measuring.uncertainty import parse_stated
from hdassist.model.kinematics import Kinematics
from hdassist.model.wheels import MeasuredTeeth
from hdassist.numerals import number_of
from hdassist.preset.fields import Drive
from hdassist.preset.kinds import OneLine
from hdassist.preset.overrides import is_overridden
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.readers.wheels import WheelFiles
from hdassist.run.kept import ClosedRecord
from hdassist.run.run import Run
from hdassist.solve.window import in_wide_enough_window
from hdassist.verdict import SURE

TORQUE_AND_FILE = re.compile(r"([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)([=:])(.+)", re.DOTALL)
FailOn = Literal["warn", "fail", "never"]
RequestSeed = Annotated[int, Field(ge=0)]  # of what is drawn


@dataclass(frozen=True)
class TraceFile:
    """A measured trace: its torque as written, empty where the limits of the drive have to tell it, and its file."""

    torque: str
    file: str

    @classmethod
    def parse(cls, text: str) -> TraceFile:
        """Read 80=FILE or FILE. Raises UsageError for the old form 80:FILE."""
        match = TORQUE_AND_FILE.fullmatch(text)
        if match and match[2] == ":":
            raise UsageError(f"invalid --measured {text}: expected [TORQUE=]FILE", f"--measured {match[1]}={match[3]}")
        return cls(match[1], match[3]) if match else cls("", text)

    @classmethod
    def recorded(cls, text: str) -> TraceFile:
        """Read the form in files of answers: 80=FILE, 80:FILE of older ones, or FILE."""
        return cls.parse(TORQUE_AND_FILE.sub(r"\1=\3", text))

    def __str__(self) -> str:
        return f"{self.torque}={self.file}" if self.torque else self.file

    def at(self, drive: Drive) -> float:
        """Torque [N*m]. Raises UsageError: it is none, or the limits of the drive leave it open."""
        if self.torque:
            if isnan(M_g := number_of(self.torque)):
                raise UsageError(f"--measured {self}: {self.torque} is no torque", "like 80=run.csv")
            return M_g
        torques = list(dict.fromkeys(each.M_g_Nm for each in limits_of(drive) if each.M_g_Nm is not None))
        if len(torques) > 1:
            named = ", ".join(f"{M_g:g}={self}" for M_g in torques)
            raise UsageError(f"--measured {self}: at which torque was it measured?", f"one of {named}")
        return (torques or list(drive.operation.M_g))[0]


def _as_text(parse: Callable[[str], Any]) -> tuple[BeforeValidator, PlainSerializer]:
    """Validator and serializer of a parsed text: files have it as it is written."""

    def checked(text: Any) -> Any:
        if not isinstance(text, str):
            raise ValueError("must be text")
        try:
            return parse(text)
        except UsageError as error:
            raise ValueError(error.message) from None

    return BeforeValidator(checked), PlainSerializer(str)


# options that may be given several times, and columns of lots: the field of a request that they add to, and their text
TEXTS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "--set": ("overrides", str),
    "--limit": ("limits", lambda text: LimitText.parse(text, "--limit")),
    "--measured": ("measured", TraceFile.parse),
    "--value": ("values", lambda text: LimitText.parse(text, "--value")),
}
_BOUND, _VALUE = (_as_text(TEXTS[option][1]) for option in ("--limit", "--value"))
_TRACE = _as_text(TraceFile.recorded)


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
class Inputs:
    """Inputs of a request, read: its drive, traces by torque [N*m], values by limit, measured wheels."""

    drive: Drive
    measurements: dict[float, Measurement] = field(default_factory=dict)
    stated: dict[Limit, AcceptedValue] = field(default_factory=dict)
    wheels: MeasuredTeeth | None = None


@dataclass(frozen=True)
class Request(ClosedRecord):
    """One drive to accept.

    preset, a name, path or -; serial, of the drive, for reports; overrides of the preset, as on the command line;
    limits, instead of the preset's; measured, traces; values, measured otherwise; reading, how traces are read;
    measured_only, predict nothing; cross_check, solver of some predicted states again; draws, effective samples of what
    is not known at least; sure, probability of keeping a limit that PASS of a prediction needs; seed; wheels, with
    measured teeth, for predictions.
    """

    preset: OneLine
    serial: OneLine = ""
    overrides: tuple[str, ...] = ()
    limits: tuple[Annotated[LimitText, *_BOUND], ...] = ()
    measured: tuple[Annotated[TraceFile, *_TRACE], ...] = ()
    values: tuple[Annotated[LimitText, *_VALUE], ...] = ()
    reading: Reading = field(default_factory=Reading)
    measured_only: bool = False
    cross_check: str = "highs"
    seed: RequestSeed = 0
    wheels: Wheels = field(default_factory=Wheels)
    draws: Annotated[int, Field(ge=0)] = EFFECTIVE_SAMPLES
    sure: Annotated[float, Field(ge=0.5, lt=1)] = SURE

    def files(self) -> list[str]:
        """Paths of all that is read for it; its preset, the first one, may be one of the library."""
        wheels = [] if self.measured_only else self.wheels.files.values()
        return [self.preset, *(trace.file for trace in self.measured), *wheels]

    def load(self) -> Drive:
        """The drive, its limits included. Raises DataError, PresetError or UsageError (a bad override or limit)."""
        try:
            return load_preset(self.preset, [*self.overrides, *(limit.override for limit in self.limits)])
        except UsageError as error:
            raise UsageError(named_limits(error.message, self.overrides, self.limits), error.hint) from None

    def read(self, drive: Drive) -> Inputs:
        """The inputs of the request, read, with the drive.

        Raises UsageError where the torque of a trace is open or stands twice, or a value is none of a limit;
        PresetError or DataError for a file that cannot be used; UntrustedError where a record does not tell its orders
        apart.
        """
        files: dict[float, str] = {}
        for trace in self.measured:
            torque = trace.at(drive)
            if torque in files:
                raise UsageError(f"two traces at {torque:g} N*m", "one trace a torque: join repeated runs in one file")
            files[torque] = trace.file
        reading, ratio = self.reading, abs(Kinematics.of(drive).u)
        orders, stated = parse_orders(reading.orders or None), parse_stated(reading.budget)
        measurements = {
            M_g: measure(
                read_trace(file, reading, ratio), drive=drive, orders=orders, drift=reading.drift, stated=stated,
                seed=self.seed,
            )
            for M_g, file in files.items()
        }  # fmt: skip
        return Inputs(drive, measurements, stated_values(self.values, drive), self.read_wheels(drive))

    def read_wheels(self, drive: Drive) -> MeasuredTeeth | None:
        """Measured wheels; None without any, and where nothing is predicted. Raises what WheelFiles.read does."""
        return None if self.measured_only else self.wheels.read(drive)

    def predict(self, drive: Drive, wheels: MeasuredTeeth | None, run: Run = Run()) -> Predictions | None:
        """Predictions that it needs, without a look at what was measured; None where it needs none.

        Raises DataError: no limit, or something measured that no limit is for; UntrustedError: no answer to be trusted.
        """
        limits = limits_of(drive)
        torques, stated = [each.at(drive) for each in self.measured], [each.limit_of(limits) for each in self.values]
        left = [] if self.measured_only else limits_to_predict(drive, torques, stated)
        run = replace(run, seed=self.seed, cross_check=self.cross_check)
        analysis = partial(predict, limits=left, wheels=wheels, draws=self.draws, sure=self.sure, run=run)
        return in_wide_enough_window(drive, analysis) if left else None


def stated_values(texts: Sequence[LimitText], drive: Drive) -> dict[Limit, AcceptedValue]:
    """Values measured otherwise, by the limit of the drive that they are for.

    Raises UsageError: a text that is no value, one without its uncertainty, or one that no limit of the drive is for.
    """
    limits = limits_of(drive) if texts else ()
    found: dict[Limit, AcceptedValue] = {}
    for text in texts:
        limit = text.limit_of(limits)
        if limit in found:
            raise UsageError(f"--value {text}: given twice")
        found[limit] = AcceptedValue.stated(text, limit)
    return found


def limits_to_predict(drive: Drive, torques: Sequence[float], stated: Sequence[Limit]) -> list[Limit]:
    """Limits of a drive that neither a trace at one of the torques [N*m] nor a stated value is for.

    Raises DataError: no limit, something measured that no limit is for, or an order that the full cycle does not have;
    UsageError: such an order on the command line.
    """
    limits = limits_of(drive)
    for order in filter(None, (limit.per_cam_rev for limit in limits)):
        try:
            order_place(Kinematics.of(drive), order)
        except UsageError as error:
            if is_overridden("acceptance.order_amplitude", drive.origin.overrides):
                raise
            raise DataError(f"{drive.name}: acceptance.order_amplitude: {error.message}", error.hint) from None
    for M_g in torques:
        if not any(limit.M_g_Nm == M_g and limit.check.measured for limit in limits):
            raise DataError(
                f"{drive.name}: measured at {M_g:g} N*m, where it has no limit", f"--limit F_ior@{M_g:g}=30"
            )
    return [each for each in limits if each not in stated and not (each.check.measured and each.M_g_Nm in torques)]
