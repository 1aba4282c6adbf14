"""`hdassist report`: everything about a drive as one page to hand on."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from hdassist.errors import UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.comparing.sheet import DriveSheet

REPORT_SUFFIXES = (".html", ".md")


@o.with_groups
def report_command(
    preset: o.Preset,
    *,
    drives: o.LoadedDriveOptions,
    draws: o.DrawsOption = 64,
    seed: o.SeedOption = 0,
    jobs: o.Jobs = 0,
    options: o.AnswerOptions,
) -> None:
    """Everything about a drive on one page: verdict, errors, mounting, stiffness, what it rests on, provenance.

    \b
    Examples:
      hdassist report vzp160 -o report.html
      hdassist report my-drive.yaml --set tolerances.F_i2=60 -o better.html
      hdassist report my-drive.yaml -o report.md

    One file without scripts, for screens (light and dark) and for A4 paper; the numbers are those of check, mount and
    stiffness, and the same input gives the same bytes. -o names a .html or .md file; without it Markdown goes to
    standard output. Nothing is ordered that what is not known could reverse.
    Exit codes: 0 PASS or no limit, 3 FAIL, 4 bad preset, 5 no trustworthy answer, 6 INCONCLUSIVE, or no position of the
    wheel that could be ordered; the report is written with 0, 3 and 6.
    """
    from hdassist.comparing.sheet import sheet_of, sheet_states
    from hdassist.pages.report import drive_report
    from hdassist.pages.report_render import report_html, report_markdown
    from hdassist.run.processes import workers
    from hdassist.run.run import Run
    from hdassist.terminal.answers import json_text, report_object
    from hdassist.terminal.output import note, warn

    kind = _kind(options)
    out, begun = options.open(), time.monotonic()
    drive = drives.load(preset)
    with out.progress(drive.name, sheet_states(drive, draws)) as progress, workers(jobs) as executor:
        sheet: DriveSheet = sheet_of(drive, draws=draws, run=Run(executor, progress, seed))
    report = drive_report(sheet, draws=draws, seed=seed)
    for text in report.warnings:
        warn(f"{drive.name}: {text}")
    if options.verbose:
        note(f"{drive.name}: {time.monotonic() - begun:.1f} s, {sheet.certificate}")
    if options.json:
        out.text(json_text(report_object(report)))
    elif options.quiet:
        out.text(f"{report.line}\n")
    elif kind == ".html":
        page = report_html(report)
        out.text(page.encode("ascii", "xmlcharrefreplace").decode() if options.ascii else page)
    else:
        out.text(report_markdown(report, out.style))
    raise typer.Exit(report.exit_code)


def _kind(options: o.AnswerOptions) -> str:
    """What the report is written as. Raises UsageError for a name that does not tell."""
    if options.output == "-" or options.json or options.quiet:
        return ".md"
    kind = Path(options.output).suffix.lower()
    if kind not in REPORT_SUFFIXES:
        raise UsageError(
            f"a report cannot be written as {options.output!r}", f"its name ends in {' or '.join(REPORT_SUFFIXES)}"
        )
    return kind
