"""What is asked of an acceptance, as plain data: it can be kept beside the answer and carried out again."""

from __future__ import annotations

import re
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Literal

from hdassist.acceptance.accept import Acceptance, accept
from hdassist.acceptance.limit_parser import limit_overrides, stated_values
from hdassist.acceptance.limits import limits_of
from hdassist.acceptance.predictions import Predictions
from hdassist.errors import UsageError
from hdassist.measuring.cycle import gearing_of
from hdassist.measuring.measure import Measurement, measure
from hdassist.measuring.orders import parse_orders
from hdassist.measuring.uncertainty import parse_stated
from hdassist.preset.fields import Drive
from hdassist.preset.library import load_preset
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.solve.answers import Progress

TORQUE_AND_FILE = re.compile(r"([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?):(.+)", re.DOTALL)


@dataclass(frozen=True)
class Reading(TraceForm):
    """How measured traces are read and looked at: the options of `hdassist measure`."""

    orders: str | None = None
    drift: str = "none"
    budget: tuple[str, ...] = ()


@dataclass(frozen=True)
class Request:
    """One drive to accept.

    preset, a name, path or -; serial, of the drive, for reports; overrides of the preset and limits, as on the command
    line; measured, traces like FILE or 80:FILE; values, measured otherwise; measured_only and seed as in accept.
    """

    preset: str
    serial: str = ""
    overrides: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()
    measured: tuple[str, ...] = ()
    values: tuple[str, ...] = ()
    reading: Reading = field(default_factory=Reading)
    measured_only: bool = False
    cross_check: str = "clarabel"
    seed: int = 0

    def load(self) -> Drive:
        """The drive, its limits included. Raises what load_preset does, and UsageError for what is no limit."""
        return load_preset(self.preset, [*self.overrides, *limit_overrides(self.limits)])


def read_measurements(request: Request, drive: Drive) -> dict[float, Measurement]:
    """Traces of a request by their torque [N*m].

    Raises what read_trace and measure do, and UsageError where the torque of a trace is open or stands twice.
    """
    files: dict[float, str] = {}
    for text in request.measured:
        torque, path = torque_and_file(text, drive)
        if torque in files:
            raise UsageError(f"two traces at {torque:g} N*m", "one trace a torque: join repeated runs in one file")
        files[torque] = path
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


def torque_and_file(text: str, drive: Drive) -> tuple[float, str]:
    """Torque [N*m] and path out of 80:FILE, or of FILE where the limits of the drive leave one torque."""
    if match := TORQUE_AND_FILE.fullmatch(text):
        try:
            return float(match[1]), match[2]
        except ValueError:
            raise UsageError(f"--measured {text}: {match[1]} is no torque", "like 80:run.csv") from None
    torques = list(dict.fromkeys(asked.M_g for asked in limits_of(drive) if asked.M_g is not None))
    if len(torques) > 1:
        named = ", ".join(f"{M_g:g}:{text}" for M_g in torques)
        raise UsageError(f"--measured {text}: at which torque was it measured?", f"one of {named}")
    return (torques or list(drive.operation.M_g))[0], text


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


FailOn = Literal["warn", "fail", "never"]


def exit_code(result: Acceptance, fail_on: FailOn) -> int:
    """Exit code of an acceptance: that of its verdict; with warn remarks count as FAIL, with never nothing does."""
    if fail_on == "never":
        return 0
    if fail_on == "warn" and result.remarks:
        return 3
    return result.verdict.exit_code
