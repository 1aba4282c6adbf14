"""Answers of `hdassist accept` done again: whether their files are the same, and what differs now."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Any

from hdassist.acceptance.answer import Answer, to_json, with_fail_on
from hdassist.acceptance.lot import LotRow
from hdassist.acceptance.request import FailOn, Request
from hdassist.errors import DataError
from hdassist.preset.library import read_preset
from hdassist.readers.trace import MAX_TRACE_BYTES
from hdassist.textfile import read_bytes

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


@dataclass(frozen=True)
class Difference:
    """Something that came out otherwise: the check (empty: the answer itself), its key, the value then and now."""

    check: str
    key: str
    recorded: Any
    now: Any


@dataclass(frozen=True)
class Replayed:
    """An answer done again: as recorded, its files, the answer now (None: not done), what differs, why it was not."""

    recorded: Answer
    inputs: tuple[InputFile, ...] = ()
    now: Answer | None = None
    differences: tuple[Difference, ...] = ()
    fault: str = ""
    hint: str = ""

    @property
    def left_out(self) -> bool:
        """Whether there was nothing to do in the first place: a row of a lot that was wrong in itself."""
        return self.recorded.request is None

    @property
    def exit_code(self) -> int:
        """0 agrees, 3 differs, 4 its files changed or it cannot be done; 1 and 5 as the answer now where it differs."""
        if self.left_out:
            return 0
        if self.now is None:
            return CHANGED
        return 0 if not self.differences else self.now.exit_code if self.now.exit_code in (1, 5) else DIFFERS

    @property
    def words(self) -> str:
        """In a word or two."""
        if self.left_out:
            return "left out"
        return "cannot be replayed" if self.now is None else "differs" if self.differences else "agrees"


def prepare(answer: Answer, preset: str = "") -> tuple[LotRow | None, Replayed]:
    """What is to be done again, and what is known of it before; nothing to do where its files are not the same.

    Arguments: answer; preset, to be taken in place of the recorded one (empty: that one).
    """
    if answer.request is None:
        return None, Replayed(answer, fault="its row was wrong in itself: nothing was asked")
    request = replace(answer.request, preset=preset or answer.request.preset)
    try:
        files = tuple(inputs(answer, request))
    except DataError as fault:
        return None, Replayed(answer, fault=fault.message, hint=fault.hint)
    if not answer.error:  # one without an answer never got as far as its hashes
        for one in files:
            if one.sha256 is None:
                hint = "paths count from the folder in which the answer was made"
                return None, Replayed(answer, files, fault=f"{one.file} cannot be read", hint=hint)
            if one.sha256 != one.recorded_sha256:
                then, now = str(one.recorded_sha256)[:12], one.sha256[:12]
                words = f"{one.file} has changed: sha256 {then}... when the answer was made, {now}... now"
                return None, Replayed(answer, files, fault=words, hint="hdassist accept makes a new answer")
    return LotRow(request.serial, request, answer.place or ""), Replayed(answer, files)


def inputs(answer: Answer, request: Request) -> Iterator[InputFile]:
    """Preset and traces of a request, with the hashes of its answer and those now.

    Raises DataError: standard input was read, which is gone.
    """
    if request.preset == "-":
        raise DataError("the preset was read from standard input", "name it: hdassist accept --replay RESULT PRESET")
    yield InputFile(request.preset, answer.preset.sha256, preset_sha256(request.preset))
    found = {trace.file: trace.sha256 for trace in answer.measured}
    found |= {wheel.file: wheel.sha256 for wheel in answer.pitch}
    wheels = [] if request.measured_only else request.wheels.files.values()
    for what, file in [*(("trace", trace.file) for trace in request.measured), *(("pitch file", f) for f in wheels)]:
        if file == "-":
            raise DataError(f"the {what} was read from standard input, which is gone", "save it, and name the file")
        yield InputFile(file, found.get(file), file_sha256(file))


def preset_sha256(name: str) -> str | None:
    """SHA-256 of a preset; None where it cannot be read."""
    try:
        return hashlib.sha256(read_preset(name)[0]).hexdigest()
    except DataError:
        return None


def file_sha256(path: str) -> str | None:
    """SHA-256 of a trace as the reader takes it; None where it cannot be read."""
    try:
        return hashlib.sha256(read_bytes(path, MAX_TRACE_BYTES + 1)[0]).hexdigest()
    except DataError:
        return None


def still_stands(answer: Answer, request: Request, version: str, fail_on: FailOn) -> bool:
    """Whether an answer is what a request would get again: same version, options and files, and no error."""
    if answer.error or (answer.version, answer.fail_on, answer.request) != (version, fail_on, request):
        return False
    try:
        return all(one.sha256 is not None and one.recorded_sha256 == one.sha256 for one in inputs(answer, request))
    except DataError:
        return False


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
    now = with_fail_on(now, recorded.fail_on)
    was, comes = to_json(recorded), to_json(now)
    old_checks, new_checks = was.pop("checks", []), comes.pop("checks", [])
    left_out = dict.fromkeys(("version", "time", "request", "place"))
    found = list(_differences("", "", was | left_out, comes | left_out, 0.0))
    for old, new in zip_longest(old_checks, new_checks):
        parts = ((old or new)[key] for key in ("code", "M_g_Nm", "per_cam_rev"))
        name = " ".join(str(part) for part in parts if part is not None)
        if old is None or new is None:
            found.append(Difference(name, "check", old and "there", new and "there"))
        else:
            found += _differences(name, "", old, new, RELATIVE * abs(old["limit"]))
    return found


def _differences(check: str, key: str, old: Any, new: Any, allowed: float) -> Iterator[Difference]:
    """Differences of two JSON values, each with its path; allowed, how far numbers may be apart at least."""
    if isinstance(old, dict) and isinstance(new, dict):
        for name in dict.fromkeys([*old, *new]):
            inner = ROUNDING.get(name, allowed)
            yield from _differences(check, f"{key}.{name}".lstrip("."), old.get(name), new.get(name), inner)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for place, pair in enumerate(zip(old, new, strict=True)):
            yield from _differences(check, f"{key}.{place}", *pair, allowed)
    elif isinstance(old, float) and isinstance(new, int | float):
        if abs(old - new) > max(RELATIVE * abs(old), allowed):
            yield Difference(check, key, old, new)
    elif old != new:
        yield Difference(check, key, old, new)
