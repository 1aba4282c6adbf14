"""Results of `hdassist accept`: the records that it writes, reads back, and compares when it computes them again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError

from hdassist import __version__
from hdassist.belief.options import Step
from hdassist.belief.statistics import CONFIDENCE, probability_by_share
from hdassist.drive.model.deviations import MeasuredTeeth
from hdassist.drive.preset.fields import OneLine
from hdassist.features.acceptance.decision import DecidedCheck, Predictions, Rule
from hdassist.features.acceptance.request import Request
from hdassist.features.report import (
    Json,
    as_json,
    certificate_object,
    influence_objects,
    pitch_object,
    samples_object,
    schema_of,
    unknown_objects,
)
from hdassist.readers.trace import MAX_TRACE_BYTES
from hdassist.run.errors import DataError, Fault, HdassistError, UntrustedError, Verdict
from hdassist.run.files import PART, STDIN, opened, read_bytes, read_preset
from hdassist.run.kept import ClosedRecord, Count, Magnitude, RecordKind, own_schema, read_kept, why_invalid

_MOST_ANSWER_BYTES = 1_000_000_000
_ACCEPT_SCHEMA = schema_of("accept")
_NO_VERDICT = "DATA_ERROR"  # status of a drive without a result
# possible exit codes of a drive without a result
_ERROR_CODES = tuple(kind.exit_code for kind in (HdassistError, DataError, UntrustedError))
LOT_VERDICTS = ("PASS", "FAIL", "INCONCLUSIVE", _NO_VERDICT)
RELATIVE = 1e-6  # numbers agree within this share of the largest number of their object
_ROUNDING = 1e-12  # smallest tolerance: residuals differ between processors
# fields that describe the run rather than the drive; residuals differ between engines
_OF_THE_RUN = (
    "version", "time", "request", "place", "max_difference_arcsec", "engine", "max_residual", "residuals", "fallbacks",
)  # fmt: skip
# texts, which may differ between versions; codes, numbers and verdicts are compared
_WORDS = ("message", "hint", "text", "reason", "why_open", "notes", "warnings")
_NOT_COMPARED = (*_OF_THE_RUN, *_WORDS)


@dataclass(frozen=True)
class Note(ClosedRecord):
    """A note: its code and its text."""

    code: str
    text: str


@dataclass(frozen=True)
class PresetRecord(ClosedRecord):
    """The preset of a result.

    name: name of the drive, or the requested preset if it could not be loaded.
    sha256: checksum of the text.
    overrides: overrides applied to the preset.
    """

    name: OneLine
    sha256: str | None = None
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class ErrorRecord(ClosedRecord):
    """An error: its message, hint and code."""

    message: str
    hint: str
    code: Fault


@dataclass(frozen=True)
class TraceRecord(ClosedRecord):
    """A measured recording: its file, torque, and F'_ior with its standard uncertainty.

    is_between_torques: whether it was recorded only at torques below and above M_g; F'_ior is then interpolated
    linearly.
    """

    file: str
    sha256: str
    M_g_Nm: float
    rows: Count
    F_ior_arcsec: float
    F_ior_is_lower_bound: bool
    standard_uncertainty_arcsec: Magnitude
    is_between_torques: bool = False


@dataclass(frozen=True)
class RuleRecord(ClosedRecord):
    """The decision rule for measured values with its guard band, and the required probability of a prediction.

    measured: decision rule.
    guard_standard_uncertainties: guard band in standard uncertainties.
    sure: probability of meeting a limit that PASS of a prediction requires.
    """

    measured: Rule
    guard_standard_uncertainties: Magnitude
    sure: float


@dataclass(frozen=True)
class ResidualsRecord(ClosedRecord):
    """The largest residuals of solved states, each as a share of its scale."""

    negative_force: Magnitude
    negative_gap: Magnitude
    complementarity: Magnitude
    equilibrium: Magnitude


@dataclass(frozen=True)
class CrossCheckRecord(ClosedRecord):
    """A cross-check by another solver: its name, the number of states, and the largest difference."""

    solver: str
    states: Count
    max_difference_arcsec: Magnitude


@dataclass(frozen=True)
class ProofRecord(ClosedRecord):
    """The verification of solved states: the largest residuals, the engine, and the cross-check by another solver."""

    states: Count
    max_residual: Magnitude
    engine: str
    fallbacks: Count
    residuals: ResidualsRecord
    cross_check: CrossCheckRecord | None


@dataclass(frozen=True)
class UnknownRecord(ClosedRecord):
    """An unknown field: the possible range of its value, in its unit, and the reason."""

    field: str
    range: tuple[float, float]
    reason: str


@dataclass(frozen=True)
class WheelRecord(ClosedRecord):
    """A wheel with measured teeth: its file and how it was read."""

    wheel: Literal["b", "g"]
    file: str
    sha256: str
    flank: str | None
    mark_tooth: int
    mark_deg: float
    range_um: Magnitude
    notes: tuple[str, ...]


@dataclass(frozen=True)
class InfluenceRecord(ClosedRecord):
    """The contribution of a field to the variance of F'_ior."""

    field: str
    share: float


@dataclass(frozen=True)
class RefusedRecord(ClosedRecord):
    """The number of rejected draws, which are not possible drives, and the reason."""

    reason: str
    draws: Count


@dataclass(frozen=True)
class SamplesRecord(ClosedRecord):
    """The size of a sample.

    effective: effective sample size.
    draws: number of draws.
    seed: seed of the draws.
    draws_of_ranges: number of draws from which ranges are computed.
    refused: numbers of rejected draws by reason.
    """

    effective: Magnitude
    draws: Count
    seed: int
    draws_of_ranges: Count
    refused: tuple[RefusedRecord, ...]


@dataclass(frozen=True, kw_only=True)
class AcceptAnswer(ClosedRecord):
    """The result for a drive: verdict, decisions, and all inputs needed to compute it again, or an error.

    request: request with all options, None for a row of a lot that is itself invalid.
    status: verdict, or DATA_ERROR for a drive with an error; computed from the other fields.
    place: position of the row, FILE:LINE; None for a single drive.
    certificate, unknown, influence, steps, samples: results of the predictions, as in `hdassist check`.
    pitch: wheels with measured teeth.
    Raises ValueError unless there is either a verdict with checks or an error, with the matching exit code.
    """

    schema: Annotated[str, own_schema(_ACCEPT_SCHEMA)] = _ACCEPT_SCHEMA
    version: OneLine
    preset: PresetRecord
    exit_code: int
    warnings: tuple[str, ...] = ()
    serial: OneLine
    seed: Annotated[int, Field(ge=0)]
    request: Request | None
    time: OneLine
    verdict: Verdict | None = None
    checks: tuple[DecidedCheck, ...] = ()
    left_out: tuple[str, ...] = ()
    remarks: tuple[Note, ...] = ()
    measured: tuple[TraceRecord, ...] = ()
    rule: RuleRecord | None = None
    certificate: ProofRecord | None = None
    unknown: tuple[UnknownRecord, ...] = ()
    pitch: tuple[WheelRecord, ...] = ()
    influence: tuple[InfluenceRecord, ...] = ()
    steps: tuple[Step, ...] = ()
    samples: SamplesRecord | None = None
    place: OneLine | None = None
    error: ErrorRecord | None = None
    status: OneLine = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "status", _NO_VERDICT if self.error else str(self.verdict))
        if bool(self.verdict) == bool(self.error):
            raise ValueError("expected either a verdict or an error")
        if self.verdict and not self.checks:
            raise ValueError("checks: a result with a verdict needs at least one check")
        codes = (self.verdict.exit_code,) if self.verdict else _ERROR_CODES
        if self.exit_code not in codes:
            raise ValueError(f"exit_code: expected {' or '.join(map(str, codes))}, got {self.exit_code}")


ANSWER = TypeAdapter(AcceptAnswer)


ANSWERS = RecordKind(ANSWER)


def of_predictions(predictions: Predictions | None, wheels: MeasuredTeeth | None) -> Json:
    """Return the fields of a result that come from predictions and measured wheels, in the form of JSON."""
    fields: Json = {"pitch": [{"wheel": name, **wheel} for name, wheel in pitch_object(wheels).items() if wheel]}
    if predictions is None:
        return fields
    return fields | {
        "certificate": certificate_object(predictions.certificate, predictions.cross_checks),
        "unknown": unknown_objects(predictions.unknown),
        "influence": influence_objects(predictions.influences),
        "steps": as_json(predictions.steps),
        "samples": samples_object(predictions.samples),
    }


def now() -> str:
    """Return the current time in the format of results."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def provenance(answer: AcceptAnswer) -> Json:
    """Return the provenance of a result as a flat table."""
    return {
        "version": answer.version,
        "preset_sha256": answer.preset.sha256,
        "measured_sha256": " ".join(trace.sha256 for trace in answer.measured) or None,
        "pitch_sha256": " ".join(wheel.sha256 for wheel in answer.pitch) or None,
        "seed": answer.seed,
        "engine": answer.certificate and answer.certificate.engine,
        "max_residual": answer.certificate and answer.certificate.max_residual,
        "time": answer.time,
    }


def answer_json(answer: AcceptAnswer) -> Json:
    """Return a result as a JSON object, in which the place is omitted if it is None."""
    fields: Json = ANSWER.dump_python(
        answer,
        mode="json",
        exclude=None if answer.place else {"place"},
    )
    return fields


def lot_summary(answers: Sequence[AcceptAnswer]) -> Json:
    """Return the counts by verdict and the yield (share of PASS among decided drives) with its interval, for JSON."""
    counts = {verdict: sum(answer.status == verdict for answer in answers) for verdict in LOT_VERDICTS}
    decided = counts["PASS"] + counts["FAIL"]
    share = probability_by_share(counts["PASS"] / decided, decided) if decided else None
    return {
        "drives": len(answers),
        "verdicts": {**counts, "BROKEN": counts[_NO_VERDICT]},  # the former name is included, because scripts read it
        "yield": share and {"decided": decided, "share": share.value, "low": share.low, "high": share.high},
        "confidence": CONFIDENCE,
    }


def read_answers(path: str) -> list[AcceptAnswer]:
    """Return the results of `hdassist accept` in a file written by --json (one or several drives) or --jsonl (a lot).

    An incomplete last line is omitted.

    Raises DataError if the file cannot be read or does not contain results.
    """
    data = bytearray()
    file = STDIN if path == "-" else path
    hint = "use a file written by --json or --jsonl"
    with opened(path) as stream:
        while part := stream.read(PART):
            data += part
            if b"\0" in part or len(data) > _MOST_ANSWER_BYTES:  # a device may be endless
                raise DataError(f"{file} is a binary file, or larger than {_MOST_ANSWER_BYTES / 1e6:g} MB", hint)
    if (kept := read_kept(bytes(data), file, ANSWERS)) is not None:
        if not kept:
            raise DataError(
                f"{file} contains no results",
                "compute the results with hdassist accept LOT.csv --jsonl FILE; this file has only its first line",
            )
        return kept
    try:
        content = json.loads(data.decode("utf-8", "replace"))
        json.dumps(content, allow_nan=False)
    except (ValueError, RecursionError) as fault:
        raise DataError(f"{file} is not valid JSON: {fault}", hint) from None
    content = content.get("results", [content]) if isinstance(content, dict) else []
    if not (content and isinstance(content, list)):
        raise DataError(f"{file} contains no results", hint)
    return [_read(one, f"{file}:{number}") for number, one in enumerate(content, 1)]


def _read(fields: Any, place: str) -> AcceptAnswer:
    """Return the result described by a JSON value.

    place: name of the result in messages.
    Raises DataError if the value is not a valid result.
    """
    try:
        return ANSWER.validate_python(fields)
    except ValidationError as error:
        message = f"{place}: a result is incomplete: {why_invalid(error)}"
        raise DataError(message, "use an unchanged file that this version of hdassist has written") from None


def changed_file(answer: AcceptAnswer) -> DataError | None:
    """Return the error for the first file of a result that has changed or was standard input, or None.

    Files of a result with an error are not compared, because their checksums were not recorded.
    """
    if answer.request is None:
        return None
    recorded: dict[str, str | None] = {trace.file: trace.sha256 for trace in answer.measured}
    recorded |= {wheel.file: wheel.sha256 for wheel in answer.pitch}
    recorded[answer.request.preset] = answer.preset.sha256
    for file in answer.request.files():
        if file == "-":
            message = "the preset or a file was read from standard input and is no longer available"
            return DataError(message, "save the input in a file, and run hdassist accept with that file")
        if answer.error:
            continue
        try:
            data = read_preset(file)[0] if file == answer.request.preset else read_bytes(file, MAX_TRACE_BYTES + 1)[0]
        except DataError:
            hint = "run the command in the folder in which the result was computed"
            return DataError(f"{file} cannot be read", hint)
        sha256 = hashlib.sha256(data).hexdigest()
        if sha256 != recorded.get(file):
            change = f"sha256 {str(recorded.get(file))[:12]}... when the result was computed, {sha256[:12]}... now"
            return DataError(f"{file} has changed: {change}", "compute a new result with hdassist accept")
    return None


def still_stands(answer: AcceptAnswer, request: Request) -> bool:
    """Return whether a result is still valid for a request: same version, options and files, and no error."""
    is_same_request = (answer.version, answer.request, answer.error) == (__version__, request, None)
    return is_same_request and changed_file(answer) is None


@dataclass(frozen=True)
class _AnswerDifference:
    """A value that differs between two results: its key, the former value and the present one."""

    key: str
    recorded: Any
    now: Any

    def __str__(self) -> str:
        return f"{self.key}: {_value_text(self.recorded)} then, {_value_text(self.now)} now"


def _value_text(value: Any) -> str:
    """Return the text of a JSON value in a difference."""
    if value is None:
        return "none"
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def answer_differences(recorded: AcceptAnswer, now: AcceptAnswer) -> list[_AnswerDifference]:
    """Return the differences between two results. If only one has an error, only verdict and error are compared."""
    if bool(recorded.error) != bool(now.error):
        errors = (answer.error and answer.error.message for answer in (recorded, now))
        return [_AnswerDifference("verdict", recorded.status, now.status), _AnswerDifference("error", *errors)]
    return list(_differences(_by_check(recorded), _by_check(now)))


def _by_check(answer: AcceptAnswer) -> Json:
    """Return a result as JSON, with its checks by name and only the number of its omitted limits.

    The texts of omitted limits are not compared, because they may differ between versions.
    """
    names = (f"{place} {check.label}" for place, check in enumerate(answer.checks, 1))
    fields = answer_json(answer)
    checks = dict(
        zip(
            names,
            fields["checks"],
            strict=True,
        )
    )
    return fields | {"checks": checks, "left_out": len(answer.left_out)}


def _differences(
    recorded: Any,
    now: Any,
    key: str = "",
    allowed: float = _ROUNDING,
) -> Iterator[_AnswerDifference]:
    """Yield the differences between two JSON values.

    key: key of both values.
    allowed: largest difference of numbers that count as equal.
    """
    then, comes = (dict(enumerate(value)) if isinstance(value, list) else value for value in (recorded, now))
    if isinstance(then, dict) and isinstance(comes, dict):
        numbers = [abs(number) for number in (*then.values(), *comes.values()) if isinstance(number, float)]
        within = max([_ROUNDING, *(RELATIVE * number for number in numbers)])
        for name in dict.fromkeys([*then, *comes]):
            if name not in _NOT_COMPARED:
                inner = f"{key}.{name}".removeprefix(".")
                yield from _differences(then.get(name), comes.get(name), inner, within)
    elif isinstance(recorded, float) and isinstance(now, float):
        if abs(recorded - now) > allowed:
            yield _AnswerDifference(key, recorded, now)
    elif recorded != now:
        yield _AnswerDifference(key, recorded, now)
