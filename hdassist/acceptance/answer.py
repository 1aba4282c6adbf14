"""Answers of `hdassist accept` as its files have them: made of an acceptance, and read back."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Discriminator, Tag, TypeAdapter, ValidationError

from hdassist.acceptance.accept import AcceptanceResult, Note
from hdassist.acceptance.checks import Extent, check_of
from hdassist.acceptance.decision import GUARD, Basis, Decision, Limit, MarginOrigin, Rule, Value, decide, margin_of
from hdassist.acceptance.request import FailOn, Request, Seed
from hdassist.acceptance.rests import (
    CertificateRecord,
    RestsOnRecord,
    UnknownRecord,
    WheelRecord,
    certificate_of,
    rests_on_of,
    unknown_of,
    wheels_of,
)
from hdassist.errors import DataError, Fault, HdassistError
from hdassist.measuring.uncertainty import COVERAGE_FACTOR
from hdassist.preset.kinds import Line
from hdassist.preset.yamltext import shown
from hdassist.run.kept import ClosedRecord, RecordKind, read_kept
from hdassist.solve.certificate import TOLERANCE
from hdassist.textfile import PART, STDIN, opened
from hdassist.verdict import Verdict, worst
from hdassist.version import __version__
from hdassist.visible import printable

MAX_BYTES = 1_000_000_000
SCHEMA: Literal["hdassist.accept/1"] = "hdassist.accept/1"
PROVENANCE = ("version", "preset_sha256", "measured_sha256", "pitch_sha256", "seed", "solver", "max_residual", "time")


@dataclass(frozen=True)
class CheckRecord(ClosedRecord):
    """A decision on a limit.

    limit_is: "greatest" or "least" value allowed; reason: None where the verdict is plain; rise: by how much the value
    may be greater in another cycle; unstated: sources of its uncertainty that nobody has stated.
    """

    code: str
    M_g_Nm: float | None
    per_cam_rev: float | None
    basis: Basis | None
    extent: Extent | None
    value: float | None
    expanded_uncertainty: float | None
    guard: float
    limit: float
    limit_is: Literal["greatest", "least"]
    margin: float | None
    unit: str
    verdict: Verdict
    reason: str | None
    rise: float = 0.0
    unstated: tuple[str, ...] = ()

    @classmethod
    def of(cls, decision: Decision) -> CheckRecord:
        """A decision as a record."""
        limit, value = decision.limit, decision.value
        basis, extent, number = (value.basis, value.extent, value.number) if value else (None, None, None)
        return cls(
            limit.check.code, limit.M_g, limit.order, basis, extent, number, decision.expanded, decision.guard,
            limit.bound, "greatest" if limit.check.upper else "least", decision.margin, limit.check.unit,
            decision.verdict, decision.reason or None, *((value.rise, value.unstated) if value else ()),
        )  # fmt: skip

    @property
    def held_against(self) -> Limit:
        """The limit of the decision. Raises DataError: no check has the code."""
        return Limit(check_of(self.code), self.limit, self.M_g_Nm, self.per_cam_rev)

    def decided_again(self, rule: Rule, margin: float) -> CheckRecord:
        """The check that follows from its own value, uncertainty and limit, by a rule and a margin [%]."""
        value = None
        if self.value is not None and self.basis is not None and self.extent is not None:
            uncertainty = (self.expanded_uncertainty or 0.0) / COVERAGE_FACTOR
            value = Value(self.value, uncertainty, self.basis, self.extent, self.rise, self.unstated)
        return CheckRecord.of(decide(self.held_against, value, rule, margin))


@dataclass(frozen=True)
class TraceRecord(ClosedRecord):
    """A trace: torque, file with its SHA-256, and the F'_ior that it shows, a lower bound of part of the cycle."""

    M_g_Nm: float
    file: Line
    sha256: str
    rows: int
    F_ior_arcsec: float
    F_ior_is_lower_bound: bool
    standard_uncertainty_arcsec: float


@dataclass(frozen=True)
class RuleRecord(ClosedRecord):
    """By what was decided: rule of measured values with its guard band, margin of predicted ones and its origin."""

    measured: Rule
    guard_standard_uncertainties: float
    prediction_margin_percent: float
    prediction_margin_origin: MarginOrigin = "given"


@dataclass(frozen=True)
class DriveRecord(ClosedRecord):
    """The preset of an answer: name of the drive, SHA-256 of the text, overrides on top."""

    name: Line
    sha256: str
    overrides: tuple[str, ...]


@dataclass(frozen=True)
class PresetRecord(ClosedRecord):
    """The preset of a drive that has no answer: as it was asked for."""

    name: Line
    sha256: None = None


@dataclass(frozen=True)
class ErrorRecord(ClosedRecord):
    """What went wrong, what to do about it, and its kind, which older files lack."""

    message: str
    hint: str
    code: Fault | None = None


@dataclass(frozen=True)
class Envelope(ClosedRecord):
    """What every answer begins with."""

    schema: Literal["hdassist.accept/1"]
    version: Line
    preset: DriveRecord | PresetRecord
    exit_code: int
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class Accepted(Envelope):
    """The answer about a drive: verdict, decisions, and all that it takes to do it again.

    place: of the row of a lot, None without one; rests_on, unknown and pitch, wheels with measured teeth: of its
    predictions.
    """

    preset: DriveRecord
    serial: Line
    verdict: Verdict
    checks: tuple[CheckRecord, ...]
    left_out: tuple[str, ...]
    remarks: tuple[Note, ...]
    measured: tuple[TraceRecord, ...]
    rule: RuleRecord
    certificate: CertificateRecord | None
    solver: str | None
    seed: Seed
    fail_on: FailOn
    request: Request
    time: Line
    place: Line | None = None
    rests_on: tuple[RestsOnRecord, ...] = ()
    unknown: tuple[UnknownRecord, ...] = ()
    pitch: tuple[WheelRecord, ...] = ()

    @property
    def status(self) -> str:
        """The verdict."""
        return str(self.verdict)

    @property
    def contradiction(self) -> str:
        """What of the answer does not follow from its own figures; empty where all of it does."""
        for check in self.checks:
            try:
                again = check.decided_again(self.rule.measured, self.rule.prediction_margin_percent / 100)
            except DataError as error:
                return error.message
            if again != check:
                return f"{check.held_against.label}: {check.verdict} does not follow from its figures"
        verdict = worst(check.verdict for check in self.checks)
        if (
            not self.checks
            or self.verdict != verdict
            or self.exit_code != exit_code(verdict, bool(self.remarks), self.fail_on)
        ):
            return f"{self.verdict}, exit code {self.exit_code}, does not follow from its checks"
        if any(check.basis == "predicted" for check in self.checks) != (self.certificate is not None):
            return "certificate: expected one where anything is predicted"
        if self.certificate is not None and not self.certificate.is_sound:
            return f"certificate: expected residuals from 0 to {TOLERANCE:.0e}, and the greatest of them"
        return ""


@dataclass(frozen=True)
class Unanswered(Envelope):
    """The answer about a drive that has none: its error; request: None for a row that is wrong in itself."""

    preset: PresetRecord
    error: ErrorRecord
    serial: Line
    seed: Seed
    request: Request | None
    time: Line
    place: Line | None = None

    @property
    def status(self) -> str:
        """What stands where a verdict would."""
        return "BROKEN"

    @property
    def contradiction(self) -> str:
        """Empty: it says nothing but its error."""
        return ""


def _branch(answer: Any) -> str:
    """Which of the two an answer is, as an object or as its JSON has it."""
    has_error = "error" in answer if isinstance(answer, dict) else isinstance(answer, Unanswered)
    return "unanswered" if has_error else "accepted"


Answer: TypeAlias = Accepted | Unanswered
_ANSWER: TypeAdapter[Answer] = TypeAdapter(
    Annotated[
        Annotated[Accepted, Tag("accepted")] | Annotated[Unanswered, Tag("unanswered")], Discriminator(_branch)
    ]
)  # fmt: skip
ANSWERS = RecordKind(_ANSWER, lambda _, answer: answer.contradiction)


def answer_of(request: Request, result: AcceptanceResult, fail_on: FailOn, place: str | None = None) -> Accepted:
    """The answer that an acceptance is."""
    drive, acceptance, predictions = result.drive, result.drive.acceptance, result.predictions
    guard, margin = GUARD if acceptance.rule == "guard" else 0.0, margin_of(drive, result.predictions)
    return Accepted(
        schema=SCHEMA,
        version=__version__,
        preset=DriveRecord(drive.name, drive.origin.sha256, drive.origin.overrides),
        exit_code=exit_code(result.verdict, bool(result.notes), fail_on),
        warnings=drive.origin.warnings,
        serial=request.serial,
        verdict=result.verdict,
        checks=tuple(map(CheckRecord.of, result.decisions)),
        left_out=tuple(limit.label for limit in result.left_out),
        remarks=result.notes,
        measured=tuple(
            TraceRecord(
                M_g, m.trace.file, m.trace.sha256, len(m.trace.line), m.F_ior_arcsec, m.directions[0].is_bound,
                m.directions[0].uncertainty_arcsec,
            )
            for M_g, m in result.measurements.items()
        ),
        rule=RuleRecord(acceptance.rule, guard, margin.percent, margin.origin),
        certificate=certificate_of(predictions) if predictions else None,
        solver="engine" if predictions else None,
        seed=request.seed,
        fail_on=fail_on,
        request=request,
        time=_now(),
        place=place,
        rests_on=rests_on_of(predictions) if predictions else (),
        unknown=unknown_of(predictions) if predictions else (),
        pitch=wheels_of(result.wheels),
    )  # fmt: skip


def failure_of(request: Request, error: HdassistError) -> Unanswered:
    """The answer about a drive that has none."""
    return Unanswered(
        SCHEMA, __version__, PresetRecord(request.preset), error.exit_code, (),
        ErrorRecord(error.message, error.hint, error.fault), request.serial, request.seed, request, _now(),
    )  # fmt: skip


def exit_code(verdict: Verdict, remarked: bool, fail_on: FailOn) -> int:
    """Exit code of an acceptance: that of its verdict; with warn remarks count as FAIL, with never nothing does."""
    if fail_on == "never":
        return 0
    return 3 if fail_on == "warn" and remarked else verdict.exit_code


def with_fail_on(answer: Accepted, fail_on: FailOn) -> Accepted:
    """An answer with the exit code that its verdict has under another rule."""
    return replace(answer, fail_on=fail_on, exit_code=exit_code(answer.verdict, bool(answer.remarks), fail_on))


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def provenance(answer: Answer) -> dict[str, Any]:
    """What an answer rests on, flat: the keys of PROVENANCE."""
    accepted = answer if isinstance(answer, Accepted) else None
    values = (
        answer.version,
        answer.preset.sha256,
        " ".join(trace.sha256 for trace in accepted.measured) or None if accepted else None,
        " ".join(wheel.sha256 for wheel in accepted.pitch) or None if accepted else None,
        answer.seed,
        accepted and accepted.solver,
        accepted and accepted.certificate and accepted.certificate.max_residual,
        answer.time,
    )
    return dict(zip(PROVENANCE, values, strict=True))


def to_json(answer: Answer) -> dict[str, Any]:
    """An answer as a JSON object; without its place where it has none."""
    fields: dict[str, Any] = _ANSWER.dump_python(answer, mode="json")
    if fields["place"] is None:
        del fields["place"]
    return fields


def to_lines(answers: Iterable[Answer]) -> str:
    """Answers as JSON Lines; never NaN or Infinity."""
    told = (json.dumps(to_json(one), ensure_ascii=True, allow_nan=False, separators=(",", ":")) for one in answers)
    return "".join(printable(line) + "\n" for line in told)


def read_answers(path: str) -> list[Answer]:
    """Answers of `hdassist accept` from a file: --json of one drive or of many, or JSON Lines.

    A last line that breaks off is left out. Raises DataError: a file that cannot be read, or says something else.
    """
    data, file = _bytes_of(path)
    if (kept := read_kept(data, file, RecordKind(_ANSWER))) is not None:
        return kept
    text = data.decode("utf-8", "replace")
    try:
        found = _parsed(text)
    except ValueError:
        return _answers_of_lines(text, file)
    if isinstance(found, dict) and found.get("schema") == SCHEMA and isinstance(found.get("results"), list):
        return [_answer(one, file, place) for place, one in enumerate(found["results"], 1)]
    return [_answer(found, file, 1)]


def _bytes_of(path: str) -> tuple[bytes, str]:
    """Bytes of a file of answers, and its name. Raises DataError: one that cannot be read, or cannot be meant."""
    with opened(path) as stream:
        file, parts, size = STDIN if path == "-" else path, [], 0
        while part := stream.read(PART):
            parts.append(part)
            size += len(part)
            if b"\0" in part or size > MAX_BYTES:
                fault = "a binary file" if b"\0" in part else f"larger than {MAX_BYTES / 1e6:g} MB"
                raise DataError(f"{file}: {fault}", "a file of --json or --jsonl")
    return b"".join(parts), file


def _parsed(text: str) -> Any:
    """What a JSON text says. Raises ValueError: it is none, or its brackets are nested without end."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("nested too deep") from None


def _answers_of_lines(text: str, file: str) -> list[Answer]:
    answers = []
    *lines, last = text.split("\n")  # what stands after the last end of a line was broken off
    for number, line in enumerate(lines, 1):
        if line.strip():
            try:
                told = _parsed(line)
            except ValueError as fault:
                raise DataError(f"{file}:{number}: no JSON: {fault}", "an answer of hdassist accept a line") from None
            answers.append(_answer(told, file, number))
    if not answers and last.strip():
        raise DataError(f"{file}: no answer of hdassist accept", "a file of --json or --jsonl")
    return answers


def _answer(told: Any, file: str, number: int) -> Answer:
    schema = told.get("schema") if isinstance(told, dict) else None
    if schema != SCHEMA:
        raise DataError(
            f"{file}:{number}: no answer of hdassist accept (schema {shown(str(schema))})", f"schema {SCHEMA}"
        )
    try:
        return _ANSWER.validate_python(told)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        path = first["loc"][1:]  # behind the name of the branch
        where, what = ".".join(map(str, path)), first["msg"].removeprefix("Value error, ")
        words = "does not say what was asked" if path[:1] == ("request",) else "is not whole"
        raise DataError(
            f"{file}:{number}: an answer {words}: {where}: {what}", "it was changed, or another version wrote it"
        ) from None
