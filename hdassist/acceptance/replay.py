"""Answers of `hdassist accept` done again: whether their files are the same, and the differences of the results."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from hdassist.acceptance.answer import AcceptAnswer, answer_json
from hdassist.acceptance.request import Request
from hdassist.errors import DataError
from hdassist.json_parts import Json
from hdassist.preset.library import read_preset
from hdassist.readers.trace import MAX_TRACE_BYTES
from hdassist.textfile import read_bytes
from hdassist.version import __version__

RELATIVE = 1e-6  # of the greatest number of its object: how far a number may lie off that agrees
ROUNDING = 1e-12  # how far in any case: residuals of another processor
# of the run and not of the drive; residuals are proven anew, each engine has its own
NOT_COMPARED = (
    "version", "time", "request", "place", "message", "hint", "max_difference_arcsec", "engine", "max_residual",
    "residuals", "fallbacks",
)  # fmt: skip


def changed_file(answer: AcceptAnswer) -> DataError | None:
    """The fault of the first file of an answer that is not as it was, or was standard input.

    An answer of an error never got as far as its hashes.
    """
    if answer.request is None:
        return None
    recorded: dict[str, str | None] = {each.file: each.sha256 for each in answer.measured}
    recorded |= {each.file: each.sha256 for each in answer.pitch}
    recorded[answer.request.preset] = answer.preset.sha256
    for file in answer.request.files():
        if file == "-":
            words = "the preset or a file was read from standard input, which is gone"
            return DataError(words, "save it, and accept it as a file")
        if answer.error:
            continue
        try:
            data = read_preset(file)[0] if file == answer.request.preset else read_bytes(file, MAX_TRACE_BYTES + 1)[0]
        except DataError:
            words = "paths count from the folder in which the answer was made"
            return DataError(f"{file} cannot be read", words)
        if (now := hashlib.sha256(data).hexdigest()) != recorded.get(file):
            then = f"sha256 {str(recorded.get(file))[:12]}... when the answer was made, {now[:12]}... now"
            return DataError(f"{file} has changed: {then}", "hdassist accept makes a new answer")
    return None


def still_stands(answer: AcceptAnswer, request: Request) -> bool:
    """Whether an answer is that which a request would get again: same version, options and files, and no error."""
    same = (answer.version, answer.request, answer.error) == (__version__, request, None)
    return same and changed_file(answer) is None


@dataclass(frozen=True)
class Difference:
    """A value that came out otherwise: its place in the answer, the value then and now."""

    key: str
    recorded: Any
    now: Any

    def __str__(self) -> str:
        values = ("none" if each is None else each for each in (self.recorded, self.now))
        then, now = (f"{each:.9g}" if isinstance(each, float) else each for each in values)
        return f"{self.key}: {then} then, {now} now"


def answer_differences(recorded: AcceptAnswer, now: AcceptAnswer) -> list[Difference]:
    """Differences of two answers, with the names of their checks; of one without an answer that alone."""
    if bool(recorded.error) != bool(now.error):
        errors = (each.error and each.error.message for each in (recorded, now))
        return [Difference("verdict", recorded.status, now.status), Difference("error", *errors)]
    return list(differences(_by_check(recorded), _by_check(now)))


def _by_check(answer: AcceptAnswer) -> Json:
    """An answer with its checks by name."""
    names = (f"{place} {check.label}" for place, check in enumerate(answer.checks, 1))
    found = answer_json(answer)
    return found | {"checks": dict(zip(names, found["checks"], strict=True))}


def differences(recorded: Any, now: Any, key: str = "", allowed: float = ROUNDING) -> Iterator[Difference]:
    """Differences of two JSON values, but for NOT_COMPARED; key, of both; allowed, how far numbers may lie apart."""
    then, comes = (dict(enumerate(each)) if isinstance(each, list) else each for each in (recorded, now))
    if isinstance(then, dict) and isinstance(comes, dict):
        numbers = [abs(each) for each in (*then.values(), *comes.values()) if isinstance(each, float)]
        within = max([ROUNDING, *(RELATIVE * each for each in numbers)])
        for name in dict.fromkeys([*then, *comes]):
            if name not in NOT_COMPARED:
                inner = f"{key}.{name}".removeprefix(".")
                yield from differences(then.get(name), comes.get(name), inner, within)
    elif isinstance(recorded, float) and isinstance(now, float):
        if abs(recorded - now) > allowed:
            yield Difference(key, recorded, now)
    elif recorded != now:
        yield Difference(key, recorded, now)
