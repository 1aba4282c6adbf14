"""The part of `hdassist accept` that takes drives by their presets."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

from rich.console import Group, RenderableType

from hdassist.acceptance import page as report
from hdassist.acceptance.answer import Answer, answer_of, as_object, failure_of
from hdassist.acceptance.decision import limits_of, needed_for
from hdassist.acceptance.lot_command import Files
from hdassist.acceptance.request import FailOn, Request, carry_out, read_measurements
from hdassist.errors import HdassistError, UsageError
from hdassist.terminal.answers import combine, to_json
from hdassist.terminal.output import Output, complain, note, warn
from hdassist.terminal.workers import workers
from hdassist.verdict import worst_exit_code


def accept_presets(
    presets: Sequence[str],
    base: Request,
    out: Output,
    files: Files,
    *,
    fail_on: FailOn,
    jobs: int,
    json: bool,
    quiet: bool,
    verbose: bool,
    debug: bool,
) -> int:
    """Accept drives one after the other; returns the exit code.

    Arguments: presets; base, what is asked of each but its preset; out and files, where answers go; the others as on
    the command line. Raises what is wrong with the only drive, and UsageError with any.
    """
    answers: list[Answer] = []
    pages: list[RenderableType] = []
    for preset in presets:
        request = replace(base, preset=preset)
        begun = time.monotonic()
        try:
            drive = request.load()
            traces = read_measurements(request, drive)
            states = 0 if request.measured_only else needed_for(limits_of(drive)).states(drive)
            with out.progress(drive.name, states) as progress, workers(jobs) as executor:
                result = carry_out(request, drive, traces, executor=executor, progress=progress)
        except HdassistError as fault:
            alone = len(presets) == 1 and not (json or files.asked)
            if debug or isinstance(fault, UsageError) or alone:
                raise
            complain(fault, "" if preset in fault.message else preset)
            answers.append(failure_of(request, fault))
            continue
        answers.append(answer_of(request, result, fail_on))
        pages.append(str(result.verdict) if quiet else report.render(result, out.look, request.serial))
        for text in drive.origin.warnings:
            warn(f"{drive.name}: {text}")
        if verbose:
            note(f"{drive.name}: {time.monotonic() - begun:.1f} s")
    if json:
        out.text(to_json(combine("accept", [as_object(answer) for answer in answers])))
    elif pages and not files.take_stdout:
        out.human(Group(*pages))
    if pages:
        out.figures(report.csv(answers))
    files.write_lines(out, answers)
    files.write_suite(out, "accept", answers, {"seed": base.seed})
    return worst_exit_code(answer.exit_code for answer in answers)
