"""Answers of `hdassist accept` as its files have them: made of an acceptance, and read back."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any, Literal

from pydantic import FiniteFloat, TypeAdapter, ValidationError

from hdassist.acceptance.accept import AcceptanceResult, Note
from hdassist.acceptance.decision import GUARD, Decision, Rule, decide
from hdassist.acceptance.request import FailOn, Request, Seed
from hdassist.errors import DataError, Fault, HdassistError
from hdassist.measuring.measure import Measurement
from hdassist.preset.kinds import Line
from hdassist.preset.yamltext import shown
from hdassist.run.kept import ClosedRecord, RecordKind, read_kept
from hdassist.solve.certificate import TOLERANCE
from hdassist.solve.throughcvxpy import CrossCheck
from hdassist.terminal.answers import certificate_object
from hdassist.terminal.basis import unknown_objects
from hdassist.terminal.influence_words import influence_objects, measure_objects, samples_object
from hdassist.terminal.wheels_page import pitch_object
from hdassist.textfile import PART, STDIN, opened
from hdassist.verdict import Verdict, worst
from hdassist.version import __version__
from hdassist.visible import printable

MAX_BYTES = 1_000_000_000
SCHEMA: Literal["hdassist.accept/1"] = "hdassist.accept/1"
PROVENANCE = ("version", "preset_sha256", "measured_sha256", "pitch_sha256", "seed", "solver", "max_residual", "time")
BROKEN = "BROKEN"  # in place of a verdict, of a drive without an answer
Share = dict[str, str | FiniteFloat]


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
class WheelRecord(ClosedRecord):
    """A measured wheel (b rigid, g flexspline): its pitch file, where its mark stands, and what was assumed of it."""

    wheel: Literal["b", "g"]
    file: Line
    sha256: str
    mark_tooth: int
    mark_deg: float
    flank: Literal["left", "right"] | None
    range_um: float
    notes: tuple[str, ...]


@dataclass(frozen=True)
class RuleRecord(ClosedRecord):
    """By what was decided: rule of measured values with its guard band, probability that PASS of a prediction needs."""

    measured: Rule
    guard_standard_uncertainties: float
    sure: float


@dataclass(frozen=True)
class PresetRecord(ClosedRecord):
    """The preset of an answer: name of the drive, SHA-256 of the text, overrides on top; as asked for without one."""

    name: Line
    sha256: str | None = None
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class CertificateRecord(ClosedRecord):
    """The proof of what was predicted."""

    states: int
    max_residual: float
    residuals: dict[Literal["negative_force", "negative_gap", "complementarity", "equilibrium"], float]
    fallbacks: int
    cross_check: CrossCheck | None

    @property
    def is_sound(self) -> bool:
        """Whether it proves anything: states, and residuals within their tolerance."""
        found = self.residuals.values()
        sound = len(found) == 4 and self.states > 0 and self.fallbacks >= 0
        return sound and min(found) >= 0 and self.max_residual == max(found) <= TOLERANCE


@dataclass(frozen=True)
class ErrorRecord(ClosedRecord):
    """What went wrong, what to do about it, and its kind, which older files lack."""

    message: str
    hint: str
    code: Fault | None = None


@dataclass(frozen=True)
class Answer(ClosedRecord):
    """The answer about a drive: verdict, decisions, and all that it takes to do it again; or its error.

    request: None for a row of a lot that is wrong in itself; place: of the row, None without one; unknown, influence,
    to_measure, samples and pitch (wheels with measured teeth): of its predictions, as `hdassist check` has them.
    """

    schema: Literal["hdassist.accept/1"]
    version: Line
    preset: PresetRecord
    exit_code: int
    warnings: tuple[str, ...]
    serial: Line
    seed: Seed
    request: Request | None
    time: Line
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
    influence: tuple[Share, ...] = ()
    to_measure: tuple[Share, ...] = ()
    samples: dict[str, int | FiniteFloat | list[dict[str, str | int]]] | None = None
    place: Line | None = None
    error: ErrorRecord | None = None

    @property
    def status(self) -> str:
        """The verdict, or what stands where one would."""
        return BROKEN if self.error else str(self.verdict)

    @property
    def missing(self) -> str:
        """What an answer without an error has to have and this one has not; empty where nothing is missing."""
        needed = {"preset.sha256": self.preset.sha256, "request": self.request, "rule": self.rule}
        return "" if self.error else next((name for name, value in needed.items() if value is None), "")

    @property
    def contradiction(self) -> str:
        """What of the answer does not follow from its own figures; empty where all of it does."""
        if self.error:
            return ""
        if self.rule is None or self.missing:
            return f"{self.missing}: missing"
        for check in self.checks:
            try:
                again = decide(check.held_against, check.held, self.rule.measured, self.rule.sure)
            except DataError as error:
                return error.message
            if again != check:
                return f"{check.held_against.label}: {check.verdict} does not follow from its figures"
        verdict = worst(check.verdict for check in self.checks)
        code = exit_code(verdict, bool(self.remarks), self.fail_on)
        if not self.checks or (self.verdict, self.exit_code) != (verdict, code):
            return f"{self.verdict}, exit code {self.exit_code}, does not follow from its checks"
        if any(check.basis == "predicted" for check in self.checks) != (self.certificate is not None):
            return "certificate: expected one where anything is predicted"
        if self.certificate is not None and not self.certificate.is_sound:
            return f"certificate: expected residuals from 0 to {TOLERANCE:.0e}, and the greatest of them"
        return ""


_ANSWER = TypeAdapter(Answer)
ANSWERS = RecordKind(_ANSWER, lambda _, answer: answer.contradiction)


def answer_of(request: Request, result: AcceptanceResult, fail_on: FailOn, place: str | None = None) -> Answer:
    """The answer that an acceptance is."""
    drive, rule, found = result.drive, result.drive.acceptance.rule, result.predictions
    fields = {
        "schema": SCHEMA,
        "version": __version__,
        "preset": PresetRecord(drive.name, drive.origin.sha256, drive.origin.overrides),
        "exit_code": exit_code(result.verdict, bool(result.notes), fail_on),
        "warnings": drive.origin.warnings,
        "serial": request.serial,
        "seed": request.seed,
        "request": request,
        "time": _now(),
        "fail_on": fail_on,
        "verdict": result.verdict,
        "checks": result.decisions,
        "left_out": [limit.label for limit in result.left_out],
        "remarks": result.notes,
        "measured": [_trace_record(M_g, measurement) for M_g, measurement in result.measurements.items()],
        "rule": RuleRecord(rule, GUARD if rule == "guard" else 0.0, result.sure),
        "pitch": [{"wheel": name, **wheel} for name, wheel in pitch_object(result.wheels).items() if wheel],
        "influence": influence_objects(result.influences),
        "to_measure": measure_objects(result.to_measure),
        "place": place,
    }
    if found:
        fields["certificate"] = certificate_object(found.certificate, found.quantities.cross_checks)
        fields |= {"solver": "engine", "unknown": unknown_objects(found.unknown)}
        fields["samples"] = samples_object(found.samples)
    return _ANSWER.validate_python(fields)


def _trace_record(M_g: float, measurement: Measurement) -> TraceRecord:
    trace, first = measurement.trace, measurement.directions[0]
    return TraceRecord(
        M_g, trace.file, trace.sha256, len(trace.line), measurement.F_ior_arcsec, first.is_bound,
        first.uncertainty_arcsec,
    )  # fmt: skip


def failure_of(request: Request, error: HdassistError) -> Answer:
    """The answer about a drive that has none."""
    record = ErrorRecord(error.message, error.hint, error.fault)
    return Answer(
        SCHEMA, __version__, PresetRecord(request.preset), error.exit_code, (), request.serial, request.seed, request,
        _now(), error=record,
    )  # fmt: skip


def exit_code(verdict: Verdict, remarked: bool, fail_on: FailOn) -> int:
    """Exit code of an acceptance: that of its verdict; with warn remarks count as FAIL, with never nothing does."""
    if fail_on == "never":
        return 0
    return 3 if fail_on == "warn" and remarked else verdict.exit_code


def with_fail_on(answer: Answer, fail_on: FailOn) -> Answer:
    """An answer with the exit code that its verdict has under another rule."""
    if answer.verdict is None:
        return answer
    return replace(answer, fail_on=fail_on, exit_code=exit_code(answer.verdict, bool(answer.remarks), fail_on))


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def provenance(answer: Answer) -> dict[str, Any]:
    """What an answer rests on, flat: the keys of PROVENANCE."""
    values = (
        answer.version,
        answer.preset.sha256,
        " ".join(trace.sha256 for trace in answer.measured) or None,
        " ".join(wheel.sha256 for wheel in answer.pitch) or None,
        answer.seed,
        answer.solver,
        answer.certificate and answer.certificate.max_residual,
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
        whole = _parsed(text)
    except ValueError:  # lines; what stands after the last end of a line was broken off
        lines = [(number, line) for number, line in enumerate(text.split("\n")[:-1], 1) if line.strip()]
        if not lines:
            raise DataError(f"{file}: no answer of hdassist accept", "a file of --json or --jsonl") from None
    else:
        results = whole.get("results") if isinstance(whole, dict) and whole.get("schema") == SCHEMA else None
        found = results if isinstance(results, list) else [whole]
        return [_answer(one, file, place) for place, one in enumerate(found, 1)]
    answers = []
    for number, line in lines:
        try:
            answers.append(_answer(_parsed(line), file, number))
        except ValueError as fault:
            raise DataError(f"{file}:{number}: no JSON: {fault}", "an answer of hdassist accept a line") from None
    return answers


def _bytes_of(path: str) -> tuple[bytes, str]:
    """Bytes of a file of answers, and its name. Raises DataError: one that cannot be read, or cannot be meant."""
    with opened(path) as stream:
        file, data = STDIN if path == "-" else path, bytearray()
        while part := stream.read(PART):
            data += part
            if b"\0" in part or len(data) > MAX_BYTES:
                fault = "a binary file" if b"\0" in part else f"larger than {MAX_BYTES / 1e6:g} MB"
                raise DataError(f"{file}: {fault}", "a file of --json or --jsonl")
    return bytes(data), file


def _parsed(text: str) -> Any:
    """What a JSON text says. Raises ValueError: it is none, or its brackets are nested without end."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("nested too deep") from None


def _answer(told: Any, file: str, number: int) -> Answer:
    schema = told.get("schema") if isinstance(told, dict) else None
    if schema != SCHEMA:
        raise DataError(
            f"{file}:{number}: no answer of hdassist accept (schema {shown(str(schema))})", f"schema {SCHEMA}"
        )
    try:
        answer = _ANSWER.validate_python(told)
        faults = [(answer.missing, "missing")] * bool(answer.missing)
    except ValidationError as error:
        faults = [
            (".".join(str(key) or "''" for key in each["loc"]), each["msg"]) for each in error.errors(include_url=False)
        ]
    for where, fault in faults:
        words = "does not say what was asked" if where.partition(".")[0] == "request" else "is not whole"
        place = f"{where}: " if where else ""
        message = f"{file}:{number}: an answer {words}: {place}{fault.removeprefix('Value error, ')}"
        raise DataError(message, "it was changed, or another version wrote it")
    return answer
