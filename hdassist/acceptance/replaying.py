"""Answers of `hdassist accept` read back: what was asked, whether its files are the same, and what differs now."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import NoneType
from typing import Any

from hdassist.acceptance.request import TORQUE_AND_FILE, Reading, Request
from hdassist.errors import DataError
from hdassist.preset.library import read_preset
from hdassist.readers.trace import MAX_BYTES
from hdassist.textfile import read_bytes

RELATIVE = 1e-6  # of a value or its limit: how far numbers may lie apart that agree
NUMBERS = ("value", "expanded_uncertainty", "guard", "limit")
WORDS = ("unit", "basis", "extent", "verdict")

Answer = Mapping[str, Any]


@dataclass(frozen=True)
class InputFile:
    """A file that an answer rests on: its path, its SHA-256 then, and now (None: it cannot be read)."""

    file: str
    recorded: str | None
    now: str | None


@dataclass(frozen=True)
class Difference:
    """Something that came out otherwise: the check (empty: the answer itself), its key, the value then and now."""

    check: str
    key: str
    recorded: Any
    now: Any


def request_of(answer: Answer) -> Request:
    """What was asked. Raises DataError: the answer does not tell."""
    said = answer.get("request")
    try:
        if not isinstance(said, dict):
            raise TypeError("nothing recorded")
        reading = _fields(Reading, said["reading"])
        return Request(**{**_fields(Request, said), "reading": Reading(**reading)})
    except (TypeError, KeyError, AttributeError) as fault:
        what = answer.get("serial") or "the answer"
        raise DataError(f"{what} does not say what was asked: {fault}", "an answer of hdassist accept --json") from None


def _fields(kind: type, said: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a dataclass as JSON has them: lists stand for tuples. Raises TypeError: one that it does not have."""
    declared = {field.name: field for field in dataclasses.fields(kind)}
    found = {}
    for name, value in said.items():
        if name not in declared:
            raise TypeError(f"{name} is unknown")
        default = declared[name].default
        wanted = {dataclasses.MISSING: (str,), None: (str, float, int, NoneType)}.get(default, (type(default),))
        value = tuple(value) if isinstance(value, list) else value
        texts = not isinstance(value, tuple) or all(isinstance(item, str) for item in value)
        if name != "reading" and not (isinstance(value, wanted) and texts):
            raise TypeError(f"{name} is {json.dumps(said[name])}")
        found[name] = value
    return found


def inputs(answer: Answer, request: Request) -> Iterator[InputFile]:
    """Preset and traces of an answer, with their hashes then and now.

    Raises DataError: standard input was read, which is gone; and where the answer is none of a drive.
    """
    try:
        found = {entry["file"]: entry["sha256"] for entry in answer.get("measured", ())}
        preset = answer["preset"]["sha256"]
    except (TypeError, KeyError) as fault:
        raise DataError(f"{request.serial or request.preset}: the answer has no hashes: {fault}") from None
    if request.preset == "-":
        raise DataError("the preset was read from standard input", "name it: hdassist accept --replay RESULT PRESET")
    yield InputFile(request.preset, preset, preset_sha256(request.preset))
    for text in request.measured:
        file = traced_file(text)
        if file == "-":
            raise DataError("the trace was read from standard input, which is gone", "save it, and name the file")
        yield InputFile(file, found.get(file), file_sha256(file))


def traced_file(text: str) -> str:
    """The file of 80:FILE or FILE."""
    match = TORQUE_AND_FILE.fullmatch(text)
    return match[2] if match else text


def preset_sha256(name: str) -> str | None:
    """SHA-256 of a preset; None where it cannot be read."""
    try:
        return hashlib.sha256(read_preset(name)[0]).hexdigest()
    except DataError:
        return None


def file_sha256(path: str) -> str | None:
    """SHA-256 of a trace as the reader takes it; None where it cannot be read."""
    try:
        return hashlib.sha256(read_bytes(path, MAX_BYTES + 1)[0]).hexdigest()
    except DataError:
        return None


def still_stands(answer: Answer, request: Request, version: str, fail_on: str) -> bool:
    """Whether an answer is what a request would get again: same version, options and files, and no error."""
    asked = json.loads(json.dumps(dataclasses.asdict(request)))
    if "error" in answer or (answer.get("version"), answer.get("fail_on")) != (version, fail_on):
        return False
    if answer.get("request") != asked:
        return False
    try:
        return all(one.now is not None and one.recorded == one.now for one in inputs(answer, request))
    except DataError:
        return False


def differences(recorded: Answer, now: Answer) -> list[Difference]:
    """What came out otherwise; numbers agree within RELATIVE of the value or its limit."""
    was, comes = _said(recorded), _said(now)
    found = [Difference("", key, was[key], comes[key]) for key in was if was[key] != comes[key]]
    before, after = _checks(recorded), _checks(now)
    for name in dict.fromkeys([*before, *after]):
        old, new = before.get(name), after.get(name)
        if old is None or new is None:
            found.append(Difference(name, "check", old and "there", new and "there"))
            continue
        found += [
            Difference(name, key, old.get(key), new.get(key))
            for key in (*NUMBERS, *WORDS)
            if not _agree(old.get(key), new.get(key), old.get("limit"))
        ]
    return found


def _said(answer: Answer) -> dict[str, Any]:
    error = answer.get("error")
    return {
        "verdict": answer.get("verdict"),
        "error": error.get("message") if isinstance(error, dict) else None,
        "left_out": list(answer.get("left_out") or []),
    }


def _checks(answer: Answer) -> dict[str, Mapping[str, Any]]:
    """Checks of an answer by what they are."""
    checks: Sequence[Any] = answer.get("checks") or []
    return {
        " ".join(str(check.get(key)) for key in ("code", "M_g_Nm", "per_cam_rev") if check.get(key) is not None): check
        for check in checks
        if isinstance(check, dict)
    }


def _agree(old: Any, new: Any, limit: Any) -> bool:
    if isinstance(old, int | float) and isinstance(new, int | float):
        scale = max(abs(old), abs(limit) if isinstance(limit, int | float) else 0.0)
        return abs(old - new) <= RELATIVE * scale
    return bool(old == new)
