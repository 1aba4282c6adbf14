"""What came out of doing an answer again, for people and as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from hdassist.acceptance.replaying import RELATIVE, Difference, InputFile
from hdassist.terminal.answers import together
from hdassist.version import __version__

DIFFERS, CHANGED = 3, 4


@dataclass(frozen=True)
class Replayed:
    """An answer done again: as recorded, its files, the answer now (None: not done), what differs, why it was not."""

    recorded: Mapping[str, Any]
    inputs: tuple[InputFile, ...] = ()
    now: Mapping[str, Any] | None = None
    differences: tuple[Difference, ...] = ()
    fault: str = ""
    hint: str = ""

    @property
    def left_out(self) -> bool:
        """Whether there was nothing to do in the first place: a row of a lot that was wrong in itself."""
        return "error" in self.recorded and "place" in self.recorded and self.recorded.get("request") is None

    @property
    def exit_code(self) -> int:
        """0 agrees, 3 differs, 4 its files changed or it cannot be done; 1 and 5 as the answer now where it differs."""
        if self.left_out:
            return 0
        if self.now is None:
            return CHANGED
        code = int(self.now["exit_code"])
        return 0 if not self.differences else code if code in (1, 5) else DIFFERS

    @property
    def words(self) -> str:
        """In a word or two."""
        if self.left_out:
            return "left out"
        return "cannot be replayed" if self.now is None else "differs" if self.differences else "agrees"


def line(one: Replayed) -> str:
    """One answer: whether it agrees, and what it says."""
    recorded = one.recorded
    name = recorded.get("serial") or recorded["preset"]["name"]
    version = recorded.get("version")
    said = recorded.get("verdict") or "no answer"
    by = f", by version {version}" if version != __version__ else ""
    lines = [f"{name}: {one.words} ({said} of {recorded.get('time') or 'an unknown time'}{by})"]
    lines += [f"  {one.fault}"] if one.fault else []
    for difference in one.differences:
        what = f"{difference.check}, {difference.key}" if difference.check else difference.key
        lines.append(f"  {what}: {_shown(difference.recorded)} then, {_shown(difference.now)} now")
    return "\n".join(lines)


def _shown(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else "none" if value is None else str(value)


def brief(replayed: Sequence[Replayed]) -> str:
    """The answer alone."""
    words = [one.words for one in replayed]
    return words[0] if len(set(words)) == 1 else ", ".join(f"{words.count(w)} {w}" for w in dict.fromkeys(words))


def answer(replayed: Sequence[Replayed]) -> dict[str, Any]:
    """One object, of one answer or with a list of them."""
    objects = [_object(one) for one in replayed]
    return objects[0] if len(objects) == 1 else together("accept-replay", objects)


def _object(one: Replayed) -> dict[str, Any]:
    recorded = one.recorded
    return {
        "schema": "hdassist.accept-replay/1",
        "version": __version__,
        "preset": dict(recorded["preset"]),
        "exit_code": one.exit_code,
        "warnings": [],
        "serial": recorded.get("serial", ""),
        "agrees": None if one.now is None else not one.differences,
        "recorded": {key: recorded.get(key) for key in ("version", "time", "verdict", "exit_code")},
        "verdict": one.now.get("verdict") if one.now else None,
        "time": one.now.get("time") if one.now else None,
        "tolerance_relative": RELATIVE,
        "differences": [asdict(difference) for difference in one.differences],
        "inputs": [
            {"file": one.file, "recorded_sha256": one.recorded, "sha256": one.now} for one in one.inputs
        ],
        **({"error": {"message": one.fault, "hint": one.hint}} if one.fault else {}),
    }  # fmt: skip
