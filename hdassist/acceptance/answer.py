"""Answers of `hdassist accept`: the records that it works with, writes and reads back."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from pydantic import Field, FiniteFloat, TypeAdapter, ValidationError

from hdassist.acceptance.decision import Decision, Rule, decide
from hdassist.acceptance.predictions import Predictions
from hdassist.acceptance.request import FailOn, Request, RequestSeed
from hdassist.errors import DataError, Fault, HdassistError
from hdassist.json_parts import (
    certificate_object,
    influence_objects,
    measure_objects,
    pitch_object,
    samples_object,
    unknown_objects,
)
from hdassist.model.wheels import MeasuredTeeth
from hdassist.preset.kinds import OneLine
from hdassist.preset.yamltext import shown
from hdassist.run.kept import ClosedRecord, Count, RecordKind, read_kept
from hdassist.solve.certificate import Residual
from hdassist.solve.throughcvxpy import CrossCheck
from hdassist.textfile import PART, STDIN, opened
from hdassist.verdict import Verdict, worst
from hdassist.version import __version__
from hdassist.visible import printable

MOST_ANSWER_BYTES = 1_000_000_000
ACCEPT_SCHEMA: Literal["hdassist.accept/1"] = "hdassist.accept/1"
BROKEN_VERDICT = "BROKEN"  # in place of a verdict, of a drive without an answer
InfluenceShare = dict[str, str | FiniteFloat]


@dataclass(frozen=True)
class Note(ClosedRecord):
    """A remark: its code and its text."""

    code: str
    text: str


@dataclass(frozen=True)
class FileRecord(ClosedRecord):
    """A file that an answer rests on."""

    file: OneLine
    sha256: str


@dataclass(frozen=True)
class TraceRecord(FileRecord):
    """A trace: its torque, and the F'_ior that it shows, a lower bound of part of the cycle."""

    M_g_Nm: float
    rows: int
    F_ior_arcsec: float
    F_ior_is_lower_bound: bool
    standard_uncertainty_arcsec: float


@dataclass(frozen=True)
class WheelRecord(FileRecord):
    """A measured wheel (b rigid, g flexspline): direction of its mark, and assumptions about it."""

    wheel: Literal["b", "g"]
    mark_tooth: int
    mark_deg: float
    flank: Literal["left", "right"] | None
    range_um: float
    notes: tuple[str, ...]


@dataclass(frozen=True)
class RuleRecord(ClosedRecord):
    """Decision rule: that of measured values with its guard band, probability that PASS of a prediction needs."""

    measured: Rule
    guard_standard_uncertainties: float
    sure: float


@dataclass(frozen=True)
class PresetRecord(ClosedRecord):
    """The preset of an answer: name of the drive, SHA-256 of the text, overrides on top; as asked for without one."""

    name: OneLine
    sha256: str | None = None
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class CertificateRecord(ClosedRecord):
    """Certificate of the predictions."""

    states: Annotated[int, Field(gt=0)]
    max_residual: Residual
    residuals: dict[Literal["negative_force", "negative_gap", "complementarity", "equilibrium"], Residual]
    fallbacks: Count
    cross_check: CrossCheck | None


@dataclass(frozen=True)
class ErrorRecord(ClosedRecord):
    """An error: message, hint, and code, which older files lack."""

    message: str
    hint: str
    code: Fault | None = None


@dataclass(frozen=True)
class AcceptAnswer(ClosedRecord):
    """The answer about a drive: verdict, decisions, and all that it takes to do it again; or its error.

    request: None for a row of a lot that is wrong in itself; place: of the row, None without one; unknown, influence,
    to_measure, samples and pitch (wheels with measured teeth): of its predictions, as `hdassist check` has them.
    """

    schema: Literal["hdassist.accept/1"]
    version: OneLine
    preset: PresetRecord
    exit_code: int
    warnings: tuple[str, ...]
    serial: OneLine
    seed: RequestSeed
    request: Request | None
    time: OneLine
    fail_on: FailOn = "fail"
    verdict: Verdict | None = None
    checks: tuple[Decision, ...] = ()
    left_out: tuple[str, ...] = ()
    remarks: tuple[Note, ...] = ()
    measured: tuple[TraceRecord, ...] = ()
    rule: RuleRecord | None = None
    certificate: CertificateRecord | None = None
    solver: str | None = None
    unknown: tuple[dict[str, str | list[FiniteFloat]], ...] = ()
    pitch: tuple[WheelRecord, ...] = ()
    influence: tuple[InfluenceShare, ...] = ()
    to_measure: tuple[InfluenceShare, ...] = ()
    samples: dict[str, int | FiniteFloat | list[dict[str, str | int]]] | None = None
    place: OneLine | None = None
    error: ErrorRecord | None = None

    @property
    def status(self) -> str:
        """The verdict, or BROKEN in its place."""
        return BROKEN_VERDICT if self.error else str(self.verdict)

    @property
    def missing(self) -> str:
        """The first required part that is missing, in words; empty where the answer is complete or has an error."""
        needed = {"preset.sha256": self.preset.sha256, "request": self.request, "rule": self.rule}
        return "" if self.error else next((f"{name}: missing" for name, value in needed.items() if value is None), "")

    @property
    def contradiction(self) -> str:
        """Part of the answer that does not follow from its figures; empty where all of it does."""
        if self.error:
            return ""
        if self.rule is None or self.missing:
            return self.missing
        for check in self.checks:
            try:
                if decide(check, check, self.rule.measured, self.rule.sure) != check:
                    return f"{check.label}: {check.verdict} does not follow from its figures"
            except DataError as error:
                return error.message
        verdict = worst(check.verdict for check in self.checks)
        code = exit_code(verdict, bool(self.remarks), self.fail_on)
        if not self.checks or (self.verdict, self.exit_code) != (verdict, code):
            return f"{self.verdict}, exit code {self.exit_code}, does not follow from its checks"
        if any(check.basis == "predicted" for check in self.checks) != (self.certificate is not None):
            return "certificate: expected one where anything is predicted"
        return ""


ANSWER = TypeAdapter(AcceptAnswer)
ANSWERS = RecordKind(ANSWER, lambda _, answer: answer.contradiction)


def failure_of(request: Request, error: HdassistError) -> AcceptAnswer:
    """The answer about a drive that has none."""
    record = ErrorRecord(error.message, error.hint, error.fault)
    return AcceptAnswer(
        ACCEPT_SCHEMA, __version__, PresetRecord(request.preset), error.exit_code, (), request.serial, request.seed,
        request, now(), error=record,
    )  # fmt: skip


def of_predictions(found: Predictions | None, wheels: MeasuredTeeth | None) -> dict[str, Any]:
    """Fields of an answer that come from predictions, and the measured wheels that they are of."""
    fields = {"pitch": [{"wheel": name, **wheel} for name, wheel in pitch_object(wheels).items() if wheel]}
    if found is None:
        return fields
    return fields | {
        "certificate": certificate_object(found.certificate, found.quantities.cross_checks),
        "solver": "engine",
        "unknown": unknown_objects(found.unknown),
        "influence": influence_objects(found.influences),
        "to_measure": measure_objects(found.to_measure),
        "samples": samples_object(found.samples),
    }


def exit_code(verdict: Verdict, remarked: bool, fail_on: FailOn) -> int:
    """Exit code of an acceptance: that of its verdict; with warn remarks count as FAIL, with never nothing does."""
    if fail_on == "never":
        return 0
    return 3 if fail_on == "warn" and remarked else verdict.exit_code


def now() -> str:
    """The time as answers have it."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def provenance(answer: AcceptAnswer) -> dict[str, Any]:
    """Provenance of an answer as a flat table."""
    return {
        "version": answer.version,
        "preset_sha256": answer.preset.sha256,
        "measured_sha256": " ".join(trace.sha256 for trace in answer.measured) or None,
        "pitch_sha256": " ".join(wheel.sha256 for wheel in answer.pitch) or None,
        "seed": answer.seed,
        "solver": answer.solver,
        "max_residual": answer.certificate and answer.certificate.max_residual,
        "time": answer.time,
    }


def answer_json(answer: AcceptAnswer) -> dict[str, Any]:
    """An answer as a JSON object; without its place where it has none."""
    fields: dict[str, Any] = ANSWER.dump_python(answer, mode="json", exclude=None if answer.place else {"place"})
    return fields


def to_lines(answers: Iterable[AcceptAnswer]) -> str:
    """Answers as JSON Lines; never NaN or Infinity."""
    lines = (json.dumps(answer_json(one), ensure_ascii=True, allow_nan=False, separators=(",", ":")) for one in answers)
    return "".join(printable(line) + "\n" for line in lines)


def read_answers(path: str) -> list[AcceptAnswer]:
    """Answers of `hdassist accept` from a file: --json of one drive or of many, or JSON Lines.

    A last line that breaks off is left out. Raises DataError: a file that cannot be read, or says something else.
    """
    data, file = bytearray(), STDIN if path == "-" else path
    with opened(path) as stream:
        while part := stream.read(PART):
            data += part
            if b"\0" in part or len(data) > MOST_ANSWER_BYTES:  # a device may never end
                words = f"{file}: a binary file, or larger than {MOST_ANSWER_BYTES / 1e6:g} MB"
                raise DataError(words, "a file of --json or --jsonl")
    if (kept := read_kept(bytes(data), file, RecordKind(ANSWER))) is not None:
        return kept
    text = data.decode("utf-8", "replace")
    try:
        try:
            found = [json.loads(text)]
        except ValueError:  # lines; what stands after the last end of a line was broken off
            found = [json.loads(line) for line in text.split("\n")[:-1] if line.strip()]
    except (ValueError, RecursionError) as fault:
        raise DataError(f"{file}: no JSON: {fault}", "a file of --json or --jsonl") from None
    if len(found) == 1 and isinstance(found[0], dict) and isinstance(found[0].get("results"), list):
        found = found[0]["results"]
    if not found:
        raise DataError(f"{file}: no answers in the file", "a file of --json or --jsonl")
    return [_read(one, f"{file}:{number}") for number, one in enumerate(found, 1)]


def _read(fields: Any, place: str) -> AcceptAnswer:
    """The answer that a JSON value is; place, of it in messages. Raises DataError: it is none."""
    schema = fields.get("schema") if isinstance(fields, dict) else None
    if schema != ACCEPT_SCHEMA:
        raise DataError(
            f"{place}: no answer of hdassist accept (schema {shown(str(schema))})", f"schema {ACCEPT_SCHEMA}"
        )
    try:
        answer = ANSWER.validate_python(fields)
        fault = answer.missing
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(key) or "''" for key in first["loc"])
        fault = f"{where}: {first['msg'].removeprefix('Value error, ')}"
    if fault:
        raise DataError(f"{place}: an answer is not whole: {fault}", "it was changed, or another version wrote it")
    return answer
