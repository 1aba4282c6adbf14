"""The part of `hdassist accept` that does answers again and says whether they agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

from hdassist.acceptance.answer import read_answers
from hdassist.acceptance.answer import to_json as answer_json
from hdassist.acceptance.command import AcceptRun
from hdassist.acceptance.lot_runner import answer_rows
from hdassist.acceptance.replay import RELATIVE, Replayed, differences, prepare
from hdassist.errors import DataError, UsageError
from hdassist.run.processes import count, workers
from hdassist.terminal.answers import combine, json_text
from hdassist.terminal.output import complain
from hdassist.verdict import worst_exit_code
from hdassist.version import __version__


def replay_answers(path: str, presets: Sequence[str], run: AcceptRun) -> int:
    """Do the answers of a file again; returns the exit code.

    Arguments: path of --json or --jsonl; presets, one at most, in place of the recorded one; run.
    Raises DataError: no file of answers; UsageError: several presets, or one for several answers.
    """
    out, options = run.out, run.options
    recorded = read_answers(path)
    if not recorded:
        raise DataError(f"{path}: no answers in the file")
    if len(presets) > 1 or (presets and len(recorded) > 1):
        raise UsageError("a preset for --replay takes the place of that of one answer")
    prepared = [prepare(answer, *presets) for answer in recorded]
    to_do = [row for row, _ in prepared if row is not None]
    with out.progress("replay", len(to_do)) as progress, workers(run.jobs) as executor:
        # what makes an exit code of verdicts is no part of what is compared
        found = answer_rows(to_do, executor, "fail", jobs=count(run.jobs), debug=options.debug)
        replayed = []
        for row, before in prepared:
            if row is not None:
                now = next(found)
                before = replace(before, now=now, differences=tuple(differences(before.recorded, now)))
                progress(1)
            replayed.append(before)
    if options.json:
        out.text(json_text(to_json(replayed)))
    elif options.quiet:
        out.text(summary_line(replayed) + "\n")
    else:
        out.text(out.style.text("\n".join(map(line, replayed))) + "\n")
    for one in replayed:
        if one.fault and not one.left_out:
            complain(DataError(one.fault, one.hint))
    return worst_exit_code(one.exit_code for one in replayed)


def line(one: Replayed) -> str:
    """One answer: whether it agrees, and what it says."""
    recorded = one.recorded
    said = "no answer" if recorded.error else recorded.status
    by = f", by version {recorded.version}" if recorded.version != __version__ else ""
    lines = [f"{recorded.serial or recorded.preset.name}: {one.words} ({said} of {recorded.time}{by})"]
    lines += [f"  {one.fault}"] if one.fault else []
    for difference in one.differences:
        what = f"{difference.check}, {difference.key}" if difference.check else difference.key
        lines.append(f"  {what}: {_shown(difference.recorded)} then, {_shown(difference.now)} now")
    return "\n".join(lines)


def _shown(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else "none" if value is None else str(value)


def summary_line(replayed: Sequence[Replayed]) -> str:
    """The answer alone."""
    words = [one.words for one in replayed]
    return words[0] if len(set(words)) == 1 else ", ".join(f"{words.count(w)} {w}" for w in dict.fromkeys(words))


def to_json(replayed: Sequence[Replayed]) -> dict[str, Any]:
    """One object, of one answer or with a list of them."""
    return combine("accept-replay", [_one(one) for one in replayed])


def _one(one: Replayed) -> dict[str, Any]:
    recorded = answer_json(one.recorded)
    now = answer_json(one.now) if one.now else {}
    return {
        "schema": "hdassist.accept-replay/1",
        "version": __version__,
        "preset": recorded["preset"],
        "exit_code": one.exit_code,
        "warnings": [],
        "serial": one.recorded.serial,
        "agrees": None if one.now is None else not one.differences,
        "recorded": {key: recorded.get(key) for key in ("version", "time", "verdict", "exit_code")},
        "verdict": now.get("verdict"),
        "time": now.get("time"),
        "tolerance_relative": RELATIVE,
        "differences": [asdict(difference) for difference in one.differences],
        "inputs": [asdict(file) for file in one.inputs],
        **({"error": {"code": str(DataError.fault), "message": one.fault, "hint": one.hint}} if one.fault else {}),
    }
