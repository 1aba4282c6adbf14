"""Answers of `hdassist accept`: the records that it works with, writes and reads back."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from hdassist.acceptance.decision import Decision
from hdassist.acceptance.predictions import Predictions
from hdassist.acceptance.request import Request
from hdassist.belief.statistics import CONFIDENCE, probability_by_share
from hdassist.errors import DataError, Fault
from hdassist.json_parts import (
    Json,
    certificate_object,
    influence_objects,
    measure_objects,
    pitch_object,
    samples_object,
    schema_of,
    unknown_objects,
)
from hdassist.model.wheels import MeasuredTeeth
from hdassist.preset.kinds import OneLine
from hdassist.run.kept import ClosedRecord, RecordKind, own_schema, read_kept, why_invalid
from hdassist.textfile import PART, STDIN, opened
from hdassist.verdict import Verdict

MOST_ANSWER_BYTES = 1_000_000_000
ACCEPT_SCHEMA = schema_of("accept")
BROKEN_VERDICT = "BROKEN"  # in place of a verdict, of a drive without an answer
LOT_VERDICTS = ("PASS", "FAIL", "INCONCLUSIVE", BROKEN_VERDICT)


@dataclass(frozen=True)
class Note(ClosedRecord):
    """A remark: its code and its text."""

    code: str
    text: str


@dataclass(frozen=True)
class PresetRecord(ClosedRecord):
    """The preset of an answer: name of the drive, SHA-256 of the text, overrides on top; as asked for without one."""

    name: OneLine
    sha256: str | None = None
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class ErrorRecord(ClosedRecord):
    """An error: message, hint, and code."""

    message: str
    hint: str
    code: Fault


@dataclass(frozen=True, kw_only=True)
class AcceptAnswer(ClosedRecord):
    """The answer about a drive: verdict, decisions, and all that it takes to do it again; or its error.

    request: None for a row of a lot that is wrong in itself; place: of the row, None without one; measured: traces,
    each with its torque, and the F'_ior that it shows, a lower bound of part of the cycle; rule: that of measured
    values with its guard band, and the probability that PASS of a prediction needs; certificate, unknown, influence,
    to_measure, samples and pitch (wheels with measured teeth): of its predictions, as `hdassist check` has them.
    """

    schema: Annotated[str, own_schema(ACCEPT_SCHEMA)] = ACCEPT_SCHEMA
    version: OneLine
    preset: PresetRecord
    exit_code: int
    warnings: tuple[str, ...] = ()
    serial: OneLine
    seed: Annotated[int, Field(ge=0)]
    request: Request | None
    time: OneLine
    verdict: Verdict | None = None
    checks: tuple[Decision, ...] = ()
    left_out: tuple[str, ...] = ()
    remarks: tuple[Note, ...] = ()
    measured: tuple[Json, ...] = ()
    rule: Json | None = None
    certificate: Json | None = None
    unknown: tuple[Json, ...] = ()
    pitch: tuple[Json, ...] = ()
    influence: tuple[Json, ...] = ()
    to_measure: tuple[Json, ...] = ()
    samples: Json | None = None
    place: OneLine | None = None
    error: ErrorRecord | None = None

    @property
    def status(self) -> str:
        """The verdict, or BROKEN in its place."""
        return BROKEN_VERDICT if self.error else str(self.verdict)


ANSWER = TypeAdapter(AcceptAnswer)
ANSWERS = RecordKind(ANSWER)


def of_predictions(found: Predictions | None, wheels: MeasuredTeeth | None) -> Json:
    """Fields of an answer that come from predictions, and the measured wheels that they are of."""
    fields: Json = {"pitch": tuple({"wheel": name, **wheel} for name, wheel in pitch_object(wheels).items() if wheel)}
    if found is None:
        return fields
    return fields | {
        "certificate": certificate_object(found.certificate, found.quantities.cross_checks),
        "unknown": tuple(unknown_objects(found.unknown)),
        "influence": tuple(influence_objects(found.influences)),
        "to_measure": tuple(measure_objects(found.to_measure)),
        "samples": samples_object(found.samples),
    }


def now() -> str:
    """The time as answers have it."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def provenance(answer: AcceptAnswer) -> Json:
    """Provenance of an answer as a flat table."""
    return {
        "version": answer.version,
        "preset_sha256": answer.preset.sha256,
        "measured_sha256": " ".join(trace["sha256"] for trace in answer.measured) or None,
        "pitch_sha256": " ".join(wheel["sha256"] for wheel in answer.pitch) or None,
        "seed": answer.seed,
        "engine": answer.certificate and answer.certificate["engine"],
        "max_residual": answer.certificate and answer.certificate["max_residual"],
        "time": answer.time,
    }


def answer_json(answer: AcceptAnswer) -> Json:
    """An answer as a JSON object; without its place where it has none."""
    fields: Json = ANSWER.dump_python(answer, mode="json", exclude=None if answer.place else {"place"})
    return fields


def lot_summary(answers: Sequence[AcceptAnswer]) -> Json:
    """Counts, and the share of PASS among drives that pass or fail with its interval, as JSON has them."""
    counts = {verdict: sum(answer.status == verdict for answer in answers) for verdict in LOT_VERDICTS}
    decided = counts["PASS"] + counts["FAIL"]
    share = probability_by_share(counts["PASS"] / decided, decided) if decided else None
    return {
        "drives": len(answers),
        "verdicts": counts,
        "yield": share and {"decided": decided, "share": share.value, "low": share.low, "high": share.high},
        "confidence": CONFIDENCE,
    }


def read_answers(path: str) -> list[AcceptAnswer]:
    """Answers of `hdassist accept` from a file: --json of one drive or of many, or --jsonl of a lot.

    A last line that breaks off is left out. Raises DataError: a file that cannot be read, or says something else.
    """
    data, file, hint = bytearray(), STDIN if path == "-" else path, "a file of --json or --jsonl"
    with opened(path) as stream:
        while part := stream.read(PART):
            data += part
            if b"\0" in part or len(data) > MOST_ANSWER_BYTES:  # a device may never end
                raise DataError(f"{file}: a binary file, or larger than {MOST_ANSWER_BYTES / 1e6:g} MB", hint)
    if (kept := read_kept(bytes(data), file, ANSWERS)) is not None:
        return kept
    try:
        found = json.loads(data.decode("utf-8", "replace"))
        json.dumps(found, allow_nan=False)
    except (ValueError, RecursionError) as fault:
        raise DataError(f"{file}: no JSON: {fault}", hint) from None
    found = found.get("results", [found]) if isinstance(found, dict) else []
    if not found:
        raise DataError(f"{file}: no answers in the file", hint)
    return [_read(one, f"{file}:{number}") for number, one in enumerate(found, 1)]


def _read(fields: Any, place: str) -> AcceptAnswer:
    """The answer that a JSON value is; place, of it in messages. Raises DataError: it is none."""
    try:
        return ANSWER.validate_python(fields)
    except ValidationError as error:
        words = f"{place}: an answer is not whole: {why_invalid(error)}"
        raise DataError(words, "it was changed, or another version wrote it") from None
