"""Answers of `hdassist accept` done again: whether their files are the same, and what differs now."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import zip_longest
from typing import Any

from hdassist.acceptance.answer import Answer, exit_code, to_json
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

    @classmethod
    def of(cls, answer: Answer, request: Request) -> list[InputFile]:
        """Preset, traces and pitch files of a request. Raises DataError: standard input was read, which is gone."""
        if request.preset == "-":
            raise DataError(
                "the preset was read from standard input", "name it: hdassist accept --replay RESULT PRESET"
            )
        preset, *others = request.files()
        if "-" in others:
            raise DataError("a file was read from standard input, which is gone", "save it, and name the file")
        recorded = {each.file: each.sha256 for each in (*answer.measured, *answer.pitch)}
        read = [cls(file, recorded.get(file), _sha256(file)) for file in others]
        return [cls(preset, answer.preset.sha256, _sha256(preset, is_preset=True)), *read]


def _sha256(file: str, *, is_preset: bool = False) -> str | None:
    """SHA-256 of a file as its reader takes it; None where it cannot be read."""
    try:
        return hashlib.sha256(
            (read_preset(file) if is_preset else read_bytes(file, MAX_TRACE_BYTES + 1))[0]
        ).hexdigest()
    except DataError:
        return None


@dataclass(frozen=True)
class Difference:
    """Something that came out otherwise: the check (empty: the answer itself), its key, the value then and now."""

    check: str
    key: str
    recorded: Any
    now: Any


@dataclass(frozen=True)
class Replay:
    """An answer done again.

    recorded; its files; fault, what hinders it, or else the request that is made again; the answer now, None before it
    is made; what differs.
    """

    recorded: Answer
    inputs: Sequence[InputFile] = ()
    fault: DataError | None = None
    request: Request | None = None
    now: Answer | None = None
    differences: Sequence[Difference] = ()

    @classmethod
    def prepare(cls, answer: Answer, preset: str = "") -> Replay:
        """What is known before it is done; a fault where its files are not the same.

        Arguments: answer; preset, to be taken in place of the recorded one (empty: that one).
        """
        files: list[InputFile] = []
        try:
            if answer.request is None:
                raise DataError("its row was wrong in itself: nothing was asked")
            request = replace(answer.request, preset=preset or answer.request.preset)
            files = InputFile.of(answer, request)
            for one in [] if answer.error else files:  # one without an answer never got as far as its hashes
                if one.sha256 is None:
                    hint = "paths count from the folder in which the answer was made"
                    raise DataError(f"{one.file} cannot be read", hint)
                if one.sha256 != one.recorded_sha256:
                    then = (
                        f"sha256 {str(one.recorded_sha256)[:12]}... when the answer was made, {one.sha256[:12]}... now"
                    )
                    raise DataError(f"{one.file} has changed: {then}", "hdassist accept makes a new answer")
        except DataError as fault:
            return cls(answer, files, fault)
        return cls(answer, files, request=request)

    def done(self, now: Answer) -> Replay:
        """It with the answer now."""
        return replace(self, now=now, differences=differences(self.recorded, now))

    @property
    def words(self) -> str:
        """In a word or two; a row of a lot that was wrong in itself is left out."""
        if self.recorded.request is None:
            return "left out"
        return "cannot be replayed" if self.now is None else "differs" if self.differences else "agrees"

    @property
    def exit_code(self) -> int:
        """0 agrees, 3 differs, 4 its files changed or it cannot be done; 1 and 5 as the answer now where it differs."""
        if self.now is None:
            return CHANGED if self.recorded.request else 0
        return 0 if not self.differences else self.now.exit_code if self.now.exit_code in (1, 5) else DIFFERS

    def __str__(self) -> str:
        recorded = self.recorded
        verdict = "no answer" if recorded.error else recorded.status
        by = f", by version {recorded.version}" if recorded.version != __version__ else ""
        lines = [f"{recorded.serial or recorded.preset.name}: {self.words} ({verdict} of {recorded.time}{by})"]
        lines += [f"  {self.fault.message}"] if self.fault else []
        for each in self.differences:
            name = f"{each.check}, {each.key}" if each.check else each.key
            lines.append(f"  {name}: {_shown(each.recorded)} then, {_shown(each.now)} now")
        return "\n".join(lines)

    def object(self) -> dict[str, Any]:
        """It as a JSON object."""
        recorded, fault = to_json(self.recorded), self.fault
        return {
            "schema": "hdassist.accept-replay/1",
            "version": __version__,
            "preset": recorded["preset"],
            "exit_code": self.exit_code,
            "warnings": [],
            "serial": self.recorded.serial,
            "agrees": None if self.now is None else not self.differences,
            "recorded": {key: recorded.get(key) for key in ("version", "time", "verdict", "exit_code")},
            "verdict": self.now and self.now.verdict,
            "time": self.now and self.now.time,
            "tolerance_relative": RELATIVE,
            "differences": [asdict(each) for each in self.differences],
            "inputs": [asdict(each) for each in self.inputs],
            **({"error": {"code": fault.fault, "message": fault.message, "hint": fault.hint}} if fault else {}),
        }


def still_stands(answer: Answer, request: Request, fail_on: FailOn) -> bool:
    """Whether an answer is what a request would get again: same version, options and files, and no error."""
    if (answer.version, answer.fail_on, answer.request) != (__version__, fail_on, request) or answer.error:
        return False
    return Replay.prepare(answer).fault is None


def differences(recorded: Answer, now: Answer) -> list[Difference]:
    """What came out otherwise, of the whole answer but when, by which version and from which request it was made.

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
    left_out = dict.fromkeys(("version", "time", "request", "place", "checks"))
    found = list(_differences("", "", to_json(recorded) | left_out, to_json(now) | left_out, 0.0))
    for old, new in zip_longest(to_json(recorded)["checks"], to_json(now)["checks"]):
        name = " ".join(
            str(part) for key in ("code", "M_g_Nm", "per_cam_rev") if (part := (old or new)[key]) is not None
        )
        if old is None or new is None:
            found.append(Difference(name, "check", old and "there", new and "there"))
        else:
            found += _differences(name, "", old, new, RELATIVE * abs(old["limit"]))
    return found


def _differences(check: str, key: str, old: Any, new: Any, allowed: float) -> Iterator[Difference]:
    """Differences of two JSON values, each with its path; allowed, how far numbers may be apart at least."""
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        old, new = (dict(enumerate(each)) for each in (old, new))
    if isinstance(old, dict) and isinstance(new, dict):
        for name in dict.fromkeys([*old, *new]):
            inner = ROUNDING.get(name, allowed)
            yield from _differences(check, f"{key}.{name}".lstrip("."), old.get(name), new.get(name), inner)
    elif isinstance(old, float) and isinstance(new, int | float):
        if abs(old - new) > max(RELATIVE * abs(old), allowed):
            yield Difference(check, key, old, new)
    elif old != new:
        yield Difference(check, key, old, new)


def _shown(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else "none" if value is None else str(value)


def summary_line(replayed: Sequence[Replay]) -> str:
    """The answer alone."""
    words = [one.words for one in replayed]
    return words[0] if len(set(words)) == 1 else ", ".join(f"{words.count(w)} {w}" for w in dict.fromkeys(words))
