"""The request of an acceptance as plain data: kept beside the answer, it can be carried out again."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import isnan
from typing import Annotated

from pydantic import Field

from hdassist.acceptance.decision import AcceptedValue
from hdassist.acceptance.limits import Limit, LimitText, limits_of, load_limited
from hdassist.acceptance.predictions import Predictions, order_place, predict
from hdassist.belief.samples import EFFECTIVE_SAMPLES
from hdassist.errors import DataError, UsageError
from hdassist.loading.load import Asked
from hdassist.measuring.measure import Measurement
from hdassist.measuring.reading import Reading
from hdassist.model.kinematics import Kinematics
from hdassist.model.wheels import MeasuredTeeth
from hdassist.numerals import number_of
from hdassist.preset.fields import Drive
from hdassist.preset.kinds import OneLine
from hdassist.preset.overrides import is_overridden
from hdassist.readers.wheels import WheelFiles
from hdassist.run.kept import ClosedRecord
from hdassist.run.run import Run
from hdassist.verdict import SURE


@dataclass(frozen=True)
class Inputs:
    """Inputs of a request, read: its drive, traces by torque [N*m], values by limit, measured wheels."""

    drive: Drive
    measurements: dict[float, Measurement] = field(default_factory=dict)
    stated: dict[Limit, AcceptedValue] = field(default_factory=dict)
    wheels: MeasuredTeeth | None = None

    @property
    def unmeasured(self) -> tuple[Limit, ...]:
        """Limits of the drive that neither a trace nor a stated value is for.

        Raises DataError: no limit, something measured that no limit is for, or an order that the full cycle does not
        have; UsageError: such an order on the command line.
        """
        drive, limits = self.drive, limits_of(self.drive)
        for order in filter(None, (limit.per_cam_rev for limit in limits)):
            try:
                order_place(Kinematics.of(drive), order)
            except UsageError as error:
                if is_overridden("acceptance.order_amplitude", drive.origin.overrides):
                    raise
                raise DataError(f"{drive.name}: acceptance.order_amplitude: {error.message}", error.hint) from None
        by_trace = [each for each in limits if each.check.measured and each.M_g_Nm in self.measurements]
        if without := set(self.measurements) - {each.M_g_Nm for each in by_trace}:
            words = f"{drive.name}: measured at {min(without):g} N*m, where it has no limit"
            raise DataError(words, f"--limit F_ior@{min(without):g}=30")
        return tuple(each for each in limits if each not in by_trace and each not in self.stated)


@dataclass(frozen=True)
class Request(ClosedRecord):
    """One drive to accept, each part as the options of the command line have it.

    preset, a name, path or -; serial, of the drive, for reports; overrides of the preset; limits, instead of the
    preset's; measured, traces; values, measured otherwise; reading, how traces are read; measured_only, predict
    nothing; cross_check, solver of some predicted states again; draws, effective samples of what is not known at least;
    sure, probability of keeping a limit that PASS of a prediction needs; seed; wheels, with measured teeth, for
    predictions.
    """

    preset: OneLine
    serial: OneLine = ""
    overrides: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()
    measured: tuple[str, ...] = ()
    values: tuple[str, ...] = ()
    reading: Reading = field(default_factory=Reading)
    measured_only: bool = False
    cross_check: str = "highs"
    seed: Annotated[int, Field(ge=0)] = 0
    wheels: WheelFiles = field(default_factory=WheelFiles)
    draws: Annotated[int, Field(ge=0)] = EFFECTIVE_SAMPLES
    sure: Annotated[float, Field(ge=0.5, lt=1)] = SURE

    def files(self) -> list[str]:
        """Paths of all that is read for it; its preset, the first one, may be one of the library."""
        wheels = [] if self.measured_only else self.wheels.files.values()
        return [self.preset, *(torque_and_file(text)[1] for text in self.measured), *wheels]

    def load(self, asked: Asked = ()) -> Drive:
        """The drive, its limits included; asked, options that go into its origin.

        Raises DataError, PresetError or UsageError (a bad override or limit).
        """
        limits = [LimitText.parse(text, "--limit") for text in self.limits]
        return load_limited(self.preset, self.overrides, limits, asked)

    def require_sound(self) -> None:
        """Raise UsageError for parts that every drive of a lot would be refused for, or the fault of their preset."""
        self.reading.require_sound()
        if self.preset:
            self.load()

    def traces(self, drive: Drive) -> dict[float, str]:
        """Files of traces by torque [N*m]. Raises UsageError: the limits leave a torque open, or one stands twice."""
        files: dict[float, str] = {}
        for text in self.measured:
            torque, file = torque_and_file(text)
            held = dict.fromkeys(each.M_g_Nm for each in limits_of(drive) if each.M_g_Nm is not None)
            torques = [float(torque)] if torque else list(held or drive.operation.M_g[:1])
            if len(torques) > 1:
                named = ", ".join(f"{M_g:g}={text}" for M_g in torques)
                raise UsageError(f"--measured {text}: at which torque was it measured?", f"one of {named}")
            if torques[0] in files:
                words = f"two traces at {torques[0]:g} N*m"
                raise UsageError(words, "one trace a torque: join repeated runs in one file")
            files[torques[0]] = file
        return files

    def read(self, drive: Drive) -> Inputs:
        """The inputs of the request, read, with the drive.

        Raises UsageError where the torque of a trace is open or stands twice, or a value is none of a limit;
        PresetError or DataError for a file that cannot be used; UntrustedError where a record does not tell its orders
        apart.
        """
        files = self.traces(drive).items()
        measurements = {M_g: self.reading.measured(file, drive, seed=self.seed) for M_g, file in files}
        return Inputs(drive, measurements, stated_values(self.values, drive), self.read_wheels(drive))

    def read_wheels(self, drive: Drive) -> MeasuredTeeth | None:
        """Measured wheels; None without any, and without a prediction. Raises what WheelFiles.read does."""
        self.wheels.require_sound()
        return None if self.measured_only else self.wheels.read(drive)

    def predict(
        self, drive: Drive, limits: Sequence[Limit], wheels: MeasuredTeeth | None, run: Run = Run()
    ) -> Predictions | None:
        """Predictions for limits of the drive; None without any, and without a prediction.

        Raises UntrustedError: no answer to be trusted.
        """
        limits = tuple(limit for limit in limits if limit.check.predicted)
        if self.measured_only or not limits:
            return None
        run = replace(run, seed=self.seed, cross_check=self.cross_check)
        return predict(drive, limits=limits, wheels=wheels, draws=self.draws, sure=self.sure, run=run)


def torque_and_file(text: str) -> tuple[str, str]:
    """Torque as it is written, empty for none, and file of [TORQUE=]FILE."""
    torque, _, file = text.partition("=")
    return ("", text) if isnan(number_of(torque)) else (torque, file)


def stated_values(texts: Sequence[str], drive: Drive) -> dict[Limit, AcceptedValue]:
    """Values measured otherwise, by the limit of the drive that they are for.

    Raises UsageError: a text that is no value, one without its uncertainty, or one that no limit of the drive is for.
    """
    found: dict[Limit, AcceptedValue] = {}
    for given in (LimitText.parse(text, "--value") for text in texts):
        limit = given.limit_of(limits_of(drive))
        if limit in found:
            raise UsageError(f"--value {given}: given twice")
        found[limit] = AcceptedValue.stated(given, limit)
    return found
