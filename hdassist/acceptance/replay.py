"""Answers of `hdassist accept` computed again: whether their files are the same, and the differences."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

from hdassist.acceptance.answer import AcceptAnswer, answer_json, exit_code
from hdassist.acceptance.request import FailOn, Request
from hdassist.errors import DataError
from hdassist.preset.library import read_preset
from hdassist.readers.trace import MAX_TRACE_BYTES
from hdassist.textfile import read_bytes
from hdassist.version import __version__

RELATIVE = 1e-6  # of a value or its limit: how far numbers may lie apart that agree
# residuals, and arcsec between two solvers: another processor rounds otherwise
ROUNDING = {"certificate": 1e-12, "cross_check": 1e-3}
DIFFERS, CHANGED = 3, 4  # exit codes


@dataclass(frozen=True)
class InputFile:
    """A file that an answer rests on: its path, its SHA-256 then, and now (None: it cannot be read)."""

    file: str
    recorded_sha256: str | None
    sha256: str | None


def inputs(answer: AcceptAnswer, request: Request) -> Iterator[InputFile]:
    """Preset, traces and pitch files of a request. Raises DataError: standard input was read, which is gone."""
    recorded = {each.file: each.sha256 for each in (*answer.measured, *answer.pitch)}
    for place, file in enumerate(request.files()):
        if file == "-":
            hint = "save it, and name the file; of a preset: hdassist accept --replay RESULT PRESET"
            raise DataError("the preset or a file was read from standard input, which is gone", hint)
        try:
            data = read_bytes(file, MAX_TRACE_BYTES + 1)[0] if place else read_preset(file)[0]
        except DataError:
            data = None
        sha256 = None if data is None else hashlib.sha256(data).hexdigest()
        yield InputFile(file, recorded.get(file) if place else answer.preset.sha256, sha256)


def require_same(answer: AcceptAnswer, files: list[InputFile]) -> None:
    """Raise DataError where a file is not as it was. An answer of an error never got as far as its hashes."""
    for one in [] if answer.error else files:
        if one.sha256 is None:
            raise DataError(f"{one.file} cannot be read", "paths count from the folder in which the answer was made")
        if one.sha256 != one.recorded_sha256:
            then = f"sha256 {str(one.recorded_sha256)[:12]}... when the answer was made, {one.sha256[:12]}... now"
            raise DataError(f"{one.file} has changed: {then}", "hdassist accept makes a new answer")


def still_stands(answer: AcceptAnswer, request: Request, fail_on: FailOn) -> bool:
    """Whether an answer is what a request would get again: same version, options and files, and no error."""
    if (answer.version, answer.fail_on, answer.request) != (__version__, fail_on, request) or answer.error:
        return False
    try:
        require_same(answer, list(inputs(answer, request)))
    except DataError:
        return False
    return True


@dataclass(frozen=True)
class Difference:
    """Something that came out otherwise: the check (empty: the answer itself), its key, the value then and now."""

    check: str
    key: str
    recorded: Any
    now: Any

    def __str__(self) -> str:
        values = ("none" if each is None else each for each in (self.recorded, self.now))
        then, now = (f"{each:.9g}" if isinstance(each, float) else each for each in values)
        return f"{f'{self.check}, ' * bool(self.check)}{self.key}: {then} then, {now} now"


def answer_differences(recorded: AcceptAnswer, now: AcceptAnswer) -> list[Difference]:
    """Differences of the whole answer, without its time, version and request.

    Numbers agree within RELATIVE of the value or of the limit of its check, those of a certificate within ROUNDING;
    errors where they are of one kind.
    """
    if bool(recorded.error) != bool(now.error):
        errors = (each.error and each.error.message for each in (recorded, now))
        return [Difference("", "verdict", recorded.status, now.status), Difference("", "error", *errors)]
    if recorded.error and now.error and recorded.error.code == now.error.code:
        now = replace(now, error=recorded.error)  # in the words of a cell or of an option
    if now.verdict:
        code = exit_code(now.verdict, bool(now.remarks), recorded.fail_on)
        now = replace(now, fail_on=recorded.fail_on, exit_code=code)
    was, comes = (dict(_flat("", "", answer_json(each), 0.0)) for each in (recorded, now))
    found = []
    for name in dict.fromkeys([*was, *comes]):
        (old, allowed), (new, _) = was.get(name, (None, 0.0)), comes.get(name, (None, 0.0))
        are_numbers = isinstance(old, float) and isinstance(new, int | float)
        if abs(old - new) > max(RELATIVE * abs(old), allowed) if are_numbers else old != new:
            found.append(Difference(*name, old, new))
    return found


def _flat(check: str, key: str, value: Any, allowed: float) -> Iterator[tuple[tuple[str, str], tuple[Any, float]]]:
    """Check and path of each number and text of a JSON value that is compared, and how far numbers may be off."""
    if key in ("version", "time", "request", "place"):
        return
    if not isinstance(value, dict | list):
        yield (check, key), (value, allowed)
        return
    if isinstance(value, list):
        yield (check, f"{key}.length"), (len(value), allowed)
    for name, inner in value.items() if isinstance(value, dict) else enumerate(value):
        inside, within = f"{key}.{name}".lstrip("."), ROUNDING.get(str(name), allowed)
        if key == "checks":
            parts = (inner[part] for part in ("code", "M_g_Nm", "per_cam_rev"))
            check = " ".join(str(part) for part in parts if part is not None)
            inside, within = "", RELATIVE * abs(inner["limit"])
        yield from _flat(check, inside, inner, within)


@dataclass(frozen=True)
class Replay:
    """An answer done again.

    recorded; its files; fault that prevents it, or else the request to repeat; now, the new answer, None before it is
    made; differences.
    """

    recorded: AcceptAnswer
    inputs: tuple[InputFile, ...] = ()
    fault: DataError | None = None
    request: Request | None = None
    now: AcceptAnswer | None = None
    differences: tuple[Difference, ...] = ()

    @classmethod
    def prepare(cls, answer: AcceptAnswer, preset: str = "") -> Replay:
        """The replay before its answer is made; preset in place of the recorded one (empty: that one)."""
        files: list[InputFile] = []
        try:
            if answer.request is None:
                raise DataError("its row was wrong in itself: nothing was asked")
            request = replace(answer.request, preset=preset or answer.request.preset)
            files += inputs(answer, request)
            require_same(answer, files)
        except DataError as fault:
            return cls(answer, tuple(files), fault)
        return cls(answer, tuple(files), request=request)

    def done(self, now: AcceptAnswer) -> Replay:
        """It with the answer now."""
        return replace(self, now=now, differences=tuple(answer_differences(self.recorded, now)))

    @property
    def outcome(self) -> tuple[str, int]:
        """In a word or two, and the exit code: of 1 and 5 that of the answer now, where it differs."""
        if self.recorded.request is None:
            return "left out", 0
        if self.now is None:
            return "cannot be replayed", CHANGED
        if self.differences:
            return "differs", self.now.exit_code if self.now.exit_code in (1, 5) else DIFFERS
        return "agrees", 0

    def __str__(self) -> str:
        recorded = self.recorded
        verdict = "no answer" if recorded.error else recorded.status
        by = f", by version {recorded.version}" if recorded.version != __version__ else ""
        name = recorded.serial or recorded.preset.name
        lines = [f"{name}: {self.outcome[0]} ({verdict} of {recorded.time}{by})"]
        lines += [f"  {self.fault.message}"] if self.fault else []
        return "\n".join([*lines, *(f"  {each}" for each in self.differences)])

    def to_json(self) -> dict[str, Any]:
        """It as a JSON object."""
        recorded, fault = answer_json(self.recorded), self.fault
        return {
            "schema": "hdassist.accept-replay/1",
            "version": __version__,
            "preset": recorded["preset"],
            "exit_code": self.outcome[1],
            "warnings": [],
            "serial": self.recorded.serial,
            "agrees": None if self.now is None else not self.differences,
            "recorded": {key: recorded[key] for key in ("version", "time", "verdict", "exit_code")},
            "verdict": self.now and self.now.verdict,
            "time": self.now and self.now.time,
            "tolerance_relative": RELATIVE,
            "differences": [asdict(each) for each in self.differences],
            "inputs": [asdict(each) for each in self.inputs],
            **({"error": {"code": fault.fault, "message": fault.message, "hint": fault.hint}} if fault else {}),
        }
