"""`hdassist report`: everything about a drive as one page to hand on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from hdassist.errors import UsageError
from hdassist.terminal import options as o

REPORT_SUFFIXES = (".html", ".md")


@dataclass(frozen=True, kw_only=True)
class ReportCommand(o.AnswerOptions, o.SamplingOptions, o.LimitedDriveOptions):
    """Everything about a drive on one page: verdict, errors, mounting, stiffness, assumptions, provenance.

    \b
    Examples:
      hdassist report vzp160 -o report.html
      hdassist report my-drive.yaml --set tolerances.e_hb=60 -o better.html
      hdassist report my-drive.yaml --limit 45 -o report.md

    One file without scripts, for screens (light and dark) and for A4 paper; the numbers are those of check, mount and
    stiffness, and the same input gives the same bytes. -o names a .html or .md file; without it Markdown goes to
    standard output. An order is given only if unknown inputs cannot reverse it.
    Exit codes: 0 PASS or no limit, 3 FAIL, 4 bad preset, 5 no trustworthy answer, 6 INCONCLUSIVE, or no position of the
    wheel that could be ordered; the report is written with 0, 3 and 6.
    """

    preset: str

    def run(self) -> int:
        """Make the report; returns the exit code."""
        from hdassist.terminal.runs import give, run_each

        if self.json or self.quiet:
            return super().run()
        kind, out = self._kind(), self.open()
        [report] = run_each("report", [self.preset], partial(self.report, out), self)
        code = give("report", [replace(report, head="")], self, out)  # its warnings: the page is a document
        from hdassist.pages.report import report_html, report_markdown

        if kind == ".html":
            page = report_html(report)
            out.text(page.encode("ascii", "xmlcharrefreplace").decode() if self.ascii else page)
        else:
            out.text(report_markdown(report, out.style))
        return code

    def report(self, out: o.Output, preset: str) -> o.Report:
        """All about a drive."""
        with out.progress(preset) as progress:  # words before numpy is imported
            from hdassist.comparing.drives import sheet_of, sheet_states
            from hdassist.pages.report import drive_report

            drive = self.load(preset)
            with out.run(drive.name, sheet_states(drive, self.draws), self, progress) as run:
                return drive_report(sheet_of(drive, draws=self.draws, run=run), draws=self.draws, seed=self.seed)

    def _kind(self) -> str:
        """Suffix of the file that the report is written as. Raises UsageError for any other."""
        if self.output == "-":
            return ".md"
        kind = Path(self.output).suffix.lower()
        if kind not in REPORT_SUFFIXES:
            words = f"a report cannot be written as {self.output!r}"
            raise UsageError(words, f"its name ends in {' or '.join(REPORT_SUFFIXES)}")
        return kind
