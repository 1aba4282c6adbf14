"""Answers as JSON Lines: one object a line, added as it is known."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any


def to_line(answer: dict[str, Any]) -> str:
    """An answer on one line, without its end; never NaN or Infinity."""
    return json.dumps(answer, ensure_ascii=True, allow_nan=False, separators=(",", ":"))


def to_lines(answers: Iterable[dict[str, Any]]) -> str:
    """Answers as the text of a file."""
    return "".join(to_line(answer) + "\n" for answer in answers)
