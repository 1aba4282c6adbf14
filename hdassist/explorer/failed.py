"""What a process tells where it has no answer; light to import."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Failed:
    """There is no answer: why, and what to do about it."""

    message: str
    hint: str = ""
