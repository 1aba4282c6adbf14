"""A conflict between fields of a preset."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Conflict:
    """Fields that do not go together: path of the field to look at first, message, numbers and a hint."""

    path: str
    message: str
    got: str = ""
    hint: str = ""


Check = Callable[..., Iterator[Conflict]]
