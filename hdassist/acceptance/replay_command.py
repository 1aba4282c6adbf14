"""The part of `hdassist accept` that does answers again and says whether they agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from hdassist.acceptance import replay_page as report
from hdassist.acceptance.lot import LotRow
from hdassist.acceptance.lot_runner import answers as work
from hdassist.acceptance.replay_page import Replayed
from hdassist.acceptance.replaying import differences, inputs, request_of
from hdassist.errors import DataError, HdassistError, UsageError
from hdassist.terminal.answers import json_text
from hdassist.terminal.jsonlines import read_answers
from hdassist.terminal.output import Output, complain
from hdassist.terminal.workers import count, workers
from hdassist.verdict import worst_exit_code


def replay_answers(
    path: str, presets: Sequence[str], out: Output, *, jobs: int, json: bool, quiet: bool, debug: bool
) -> int:
    """Do the answers of a file again; returns the exit code.

    Arguments: path of --json or --jsonl; presets, one at most, in place of the recorded one; the others as on the
    command line. Raises DataError: no file of answers; UsageError: several presets, or one for several answers.
    """
    recorded = read_answers(path)
    if not recorded:
        raise DataError(f"{path}: no answers in the file")
    if len(presets) > 1 or (presets and len(recorded) > 1):
        raise UsageError("a preset for --replay takes the place of that of one answer")
    looked = [_look(answer, presets) for answer in recorded]
    to_do = [row for row, _ in looked if row is not None]
    with out.progress("replay", len(to_do)) as progress, workers(jobs) as executor:
        # what makes an exit code of verdicts is no part of what is compared
        found = work(to_do, executor, "fail", ahead=count(jobs) + 1, debug=debug)
        replayed = []
        for row, before in looked:
            if row is not None:
                now = next(found)
                before = replace(before, now=now, differences=tuple(differences(before.recorded, now)))
                progress(1)
            replayed.append(before)
    if json:
        out.text(json_text(report.answer(replayed)))
    elif quiet:
        out.text(report.brief(replayed) + "\n")
    else:
        out.text(out.style.text("\n".join(map(report.line, replayed))) + "\n")
    for one in replayed:
        if one.fault and not one.left_out:
            complain(HdassistError(one.fault, one.hint))
    return worst_exit_code(one.exit_code for one in replayed)


def _look(answer: dict[str, Any], presets: Sequence[str]) -> tuple[LotRow | None, Replayed]:
    """What is to be done again, and what is known of it before; nothing where its files are not the same."""
    if Replayed(answer).left_out:
        return None, Replayed(answer, fault="its row was wrong in itself: nothing was asked")
    try:
        request = request_of(answer)
        request = replace(request, preset=presets[0]) if presets else request
        files = tuple(inputs(answer, request))
    except DataError as fault:
        return None, Replayed(answer, fault=fault.message, hint=fault.hint)
    place = str(answer.get("place") or "")
    if "error" in answer:  # it never got as far as its hashes
        return LotRow(request.serial, request, place), Replayed(answer, files)
    for one in files:
        if one.now is None:
            hint = "paths count from the folder in which the answer was made"
            return None, Replayed(answer, files, fault=f"{one.file} cannot be read", hint=hint)
        if one.now != one.recorded:
            then, now = str(one.recorded)[:12], one.now[:12]
            words = f"{one.file} has changed: sha256 {then}... when the answer was made, {now}... now"
            return None, Replayed(answer, files, fault=words, hint="hdassist accept makes a new answer")
    return LotRow(request.serial, request, place), Replayed(answer, files)
