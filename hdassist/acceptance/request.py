"""What is asked of an acceptance, as plain data: it can be kept beside the answer and carried out again.

Limits and values stand as the command line writes them: F_ior@80=30, order_2=5, K_1=1e5, F_ior@80=28.1±1.2.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, PlainSerializer

from hdassist.acceptance.accept import Acceptance, accept, without_values
from hdassist.acceptance.checks import CHECKS, ORDER
from hdassist.acceptance.decision import Limit, Value, limits_of, needed_for
from hdassist.acceptance.predictions import Predictions, predict
from hdassist.errors import UsageError
from hdassist.measuring.cycle import gearing_of
from hdassist.measuring.measure import measure
from hdassist.measuring.measurement import Measurement
from hdassist.measuring.uncertainty import COVERAGE_FACTOR, parse_stated
from hdassist.preset.fields import Drive
from hdassist.preset.library import load_preset
from hdassist.preset.spread import is_spread, read_spread
from hdassist.preset.units import UnitError
from hdassist.readers.trace import read_trace
from hdassist.readers.tracecolumns import TraceForm
from hdassist.solve.answers import Progress

CLOSED = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)  # of what is read back from files of ours

TORQUE_AND_FILE = re.compile(r"([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?):(.+)", re.DOTALL)
ORDER_PREFIX = "order_"
KINDS = {check.field: check.kind for check in CHECKS if check != ORDER}
HINT = f"NAME[@TORQUE]=VALUE, NAME one of {', '.join(KINDS)}, or order_2 and so on"

Option = Literal["--limit", "--value"]
FailOn = Literal["warn", "fail", "never"]


@dataclass(frozen=True)
class LimitName:
    """The name of a limit: its field of the section acceptance, order and torque as written (empty: none)."""

    field: str
    order: str = ""
    torque: str = ""

    @classmethod
    def parse(cls, text: str, option: Option, whole: str = "") -> LimitName:
        """Read a name such as F_ior@80 or order_2; whole, what messages show.

        Raises UsageError: no such name, or a torque or order that cannot be.
        """
        name, at, torque = text.strip().partition("@")
        order = name.removeprefix(ORDER_PREFIX) if name.startswith(ORDER_PREFIX) else ""
        per_torque = option == "--value" if order else KINDS.get(name) == "limits"
        if not (order or name in KINDS) or (at and not (torque and per_torque)):
            raise UsageError(f"{option} {whole or text}: not understood", HINT)
        if order:
            _number(order, whole or text)
        return cls(ORDER.field if order else name, order, torque)

    @classmethod
    def of_column(cls, text: str, option: Option) -> LimitName | None:
        """The name that a column has; None where it is none. Raises UsageError as parse does."""
        if text.strip().partition("@")[0] not in KINDS and not text.strip().startswith(ORDER_PREFIX):
            return None
        found = cls.parse(text, option)
        if found.torque:
            _number(found.torque, text)
        return found

    def __str__(self) -> str:
        name = ORDER_PREFIX + self.order if self.order else self.field
        return f"{name}@{self.torque}" if self.torque else name

    def fits(self, limit: Limit) -> bool:
        """Whether a limit may be meant. Raises UsageError: the torque is no number."""
        return (
            limit.check.field == self.field
            and (not self.order or limit.order == float(self.order))
            and (not self.torque or limit.M_g == _number(self.torque, str(self)))
        )


@dataclass(frozen=True)
class LimitText:
    """What is said of a limit: its name, and the text behind the equals sign."""

    name: LimitName
    text: str

    @classmethod
    def parse(cls, text: str, option: Option) -> LimitText:
        """Read NAME[@TORQUE]=VALUE. Raises UsageError: a text that is none."""
        name, _, value = text.partition("=")
        if not value.strip():
            raise UsageError(f"{option} {text}: not understood", HINT)
        return cls(LimitName.parse(name, option, text), value.strip())

    def __str__(self) -> str:
        return f"{self.name}={self.text}"

    @property
    def override(self) -> str:
        """The limit as an override of the preset: the same checks, the same errors."""
        parts = ("acceptance", self.name.field, self.name.order, self.name.torque)
        return f"{'.'.join(filter(None, parts))}={self.text}"

    def limit_of(self, limits: Sequence[Limit]) -> Limit:
        """The limit of a drive that a value is for. Raises UsageError: there is none, or several."""
        fitting = [limit for limit in limits if self.name.fits(limit)]
        if not fitting:
            raise UsageError(f"--value {self}: the drive has no such limit", f"--limit {self.name}=...")
        if len(fitting) > 1:
            torques = ", ".join(f"@{limit.M_g:g}" for limit in fitting)
            raise UsageError(f"--value {self}: at which torque?", f"one of {torques}")
        return fitting[0]

    def value_for(self, limit: Limit) -> Value:
        """The value that was measured otherwise; what stands after ± is its expanded uncertainty, k = 2.

        Raises UsageError: it is none, has no uncertainty, or is below zero.
        """
        if not is_spread(self.text):
            hint = f"like {self.text}±1.2: expanded, k = 2; ±0 for none"
            raise UsageError(f"--value {self}: without its uncertainty", hint)
        try:
            number, expanded = read_spread(self.text, limit.check.unit)
        except UnitError as error:
            raise UsageError(f"--value {self}: {error.message}", error.hint) from None
        if number < 0:
            raise UsageError(f"--value {self}: {limit.label} cannot be below zero", "its size, without a sign")
        return Value(number, expanded / COVERAGE_FACTOR, "stated")


def _number(text: str, whole: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"{whole}: {text} is no number", HINT) from None


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
            try:
                return float(self.torque)
            except ValueError:
                raise UsageError(f"--measured {self}: {self.torque} is no torque", "like 80:run.csv") from None
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
class Reading(TraceForm):
    """How measured traces are read and looked at: the options of `hdassist measure`."""

    __pydantic_config__ = CLOSED

    orders: str | None = None
    drift: str = "none"
    budget: tuple[str, ...] = ()


@dataclass(frozen=True)
class Request:
    """One drive to accept.

    preset, a name, path or -; serial, of the drive, for reports; overrides of the preset, as on the command line;
    limits, instead of the preset's; measured, traces; values, measured otherwise; measured_only and seed as in accept.
    """

    __pydantic_config__ = CLOSED

    preset: str
    serial: str = ""
    overrides: tuple[str, ...] = ()
    limits: tuple[Annotated[LimitText, *_BOUND], ...] = ()
    measured: tuple[Annotated[TraceFile, *_TRACE], ...] = ()
    values: tuple[Annotated[LimitText, *_VALUE], ...] = ()
    reading: Reading = field(default_factory=Reading)
    measured_only: bool = False
    cross_check: str = "clarabel"
    seed: int = 0

    def load(self) -> Drive:
        """The drive, its limits included. Raises what load_preset does."""
        return load_preset(self.preset, [*self.overrides, *(limit.override for limit in self.limits)])


def read_measurements(request: Request, drive: Drive) -> dict[float, Measurement]:
    """Traces of a request by their torque [N*m].

    Raises what read_trace and measure do, and UsageError where the torque of a trace is open or stands twice.
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
            orders=reading.orders,
            drift=reading.drift,
            stated=stated,
            seed=request.seed,
        )
        for torque, path in files.items()
    }


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

    Raises what accept does of drive and limits.
    """
    drive = request.load()
    limits = limits_of(drive)
    torques, stated = [trace.at(drive) for trace in request.measured], [v.limit_of(limits) for v in request.values]
    left = () if request.measured_only else without_values(drive, torques, stated)
    needed = needed_for(left)
    return predict(drive, needed, cross_check=request.cross_check, seed=request.seed) if left else None


def carry_out(
    request: Request,
    drive: Drive,
    measurements: Mapping[float, Measurement],
    *,
    predictions: Predictions | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Acceptance:
    """Accept the drive of a request, loaded and measured before; the others and the errors as in accept."""
    return accept(
        drive,
        measurements,
        stated=stated_values(request.values, drive),
        measured_only=request.measured_only,
        predictions=predictions,
        cross_check=request.cross_check,
        seed=request.seed,
        executor=executor,
        progress=progress,
    )
