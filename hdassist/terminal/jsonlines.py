"""Answers as JSON Lines: one object a line, added as it is known, and read back to go on."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from hdassist.errors import DataError
from hdassist.textfile import read_bytes

MAX_BYTES = 1_000_000_000
SCHEMA = "hdassist.accept/1"


def to_line(answer: dict[str, Any]) -> str:
    """An answer on one line, without its end; never NaN or Infinity."""
    return json.dumps(answer, ensure_ascii=True, allow_nan=False, separators=(",", ":"))


def to_lines(answers: Iterable[dict[str, Any]]) -> str:
    """Answers as the text of a file."""
    return "".join(to_line(answer) + "\n" for answer in answers)


def read_answers(path: str) -> list[dict[str, Any]]:
    """Answers of `hdassist accept` from a file: --json of one drive or of many, or JSON Lines.

    A last line that breaks off is left out. Raises DataError: a file that cannot be read, or is something else.
    """
    data, file = read_bytes(path, MAX_BYTES)
    text = data.decode("utf-8", "replace")
    try:
        told = json.loads(text)
    except ValueError:
        return _answers_of_lines(text, file)
    if isinstance(told, dict) and isinstance(told.get("results"), list):
        return [_checked(one, file, place) for place, one in enumerate(told["results"], 1)]
    return [_checked(told, file, 1)]


def _answers_of_lines(text: str, file: str) -> list[dict[str, Any]]:
    answers = []
    *lines, last = text.split("\n")  # what stands after the last end of a line was broken off
    for number, line in enumerate(lines, 1):
        if line.strip():
            try:
                answers.append(_checked(json.loads(line), file, number))
            except ValueError as fault:
                raise DataError(f"{file}:{number}: no JSON: {fault}", "an answer of hdassist accept a line") from None
    if not answers and last.strip():
        raise DataError(f"{file}: no answer of hdassist accept", "a file of --json or --jsonl")
    return answers


def _checked(answer: Any, file: str, number: int) -> dict[str, Any]:
    schema = answer.get("schema") if isinstance(answer, dict) else None
    if schema != SCHEMA:
        raise DataError(f"{file}:{number}: no answer of hdassist accept (schema {schema})", f"schema {SCHEMA}")
    assert isinstance(answer, dict)
    preset = answer.get("preset")
    if not isinstance(preset, dict) or not isinstance(preset.get("name"), str):
        raise DataError(f"{file}:{number}: an answer without the name of its preset", "is the file whole?")
    return answer
