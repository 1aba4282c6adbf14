"""`hdassist sweep`: F'_ior over a grid of values of a preset's fields."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.design.sweep import Sweep, SweepRow
    from hdassist.run.kept import Kept

JSON_ROWS = 100_000  # that --json holds in memory, at most


@dataclass(frozen=True, kw_only=True)
class SweepCommand(o.PlotOptions, o.LoadedDriveOptions):
    """F'_ior over a grid of values of any numeric fields of a preset, row by row.

    \b
    Examples:
      hdassist sweep vzp160 --vary tolerances.e_hb=20:120:11
      hdassist sweep vzp160 --vary tolerances.e_hb=20:120:11 \\
          --vary operation.M_g=40:800:5
      hdassist sweep vzp160 --vary gears.j_n=0,5,10 | column -s, -t
      hdassist sweep my-drive.yaml --vary cam.W_0=0.9:1.0:201 -o rows.jsonl

    A row is a point of the grid at one torque: that of the row where operation.M_g is varied, else each of the preset.
    In a pipe rows come as CSV, as they are computed; --csv FILE writes them to a file. -o FILE.jsonl keeps them as JSON
    Lines: when a run was stopped, the same command goes on behind the last row that is there. A row without an answer
    stays, with its reason; the exit code is 0 where any row has one.
    """

    preset: str
    vary: list[str]
    output: str = "-"
    jobs: int = 0
    executor: str | None = None

    @property
    def answer_file(self) -> str:
        """Standard output: -o takes the rows."""
        return "-"

    def report(self, out: o.Output, preset: str) -> o.Report:
        """The rows, computed and written."""
        from hdassist.design.sweep import Sweep, collect, read_axes
        from hdassist.errors import UsageError
        from hdassist.files import claim_output
        from hdassist.loading.load import load_text
        from hdassist.pages import curves as page
        from hdassist.preset.library import read_preset
        from hdassist.run.kept import KeptOwner, open_kept
        from hdassist.run.stops import at_stop
        from hdassist.terminal.answers import csv_text
        from hdassist.terminal.output import note

        file = None if self.output == "-" else self.output
        streamed = self._takes_stdout()
        text, path = read_preset(preset)
        drive = load_text(text, path, self.changes)
        sweep = Sweep.of(text, path, drive, read_axes(self.vary, drive.origin.overrides))
        if self.json and sweep.rows > JSON_ROWS:
            raise UsageError(f"--json of {sweep.rows} rows: more than {JSON_ROWS}", "-o FILE.jsonl takes any number")
        options = {"vary": self.vary, "set": list(drive.origin.overrides)}
        owner = KeptOwner(command="sweep", preset=drive.name, inputs={"preset": drive.origin.sha256}, options=options)
        if file is not None:
            claim_output(file, is_kept=True)
        with open_kept(file, owner, sweep.kind, force=self.force) as results:
            rows = _rows(sweep, drive.name, results, self, out)
            kept = f"are kept in {file}: the same command goes on" if file else "are done, none is kept"
            with at_stop(lambda: f"{results.done} of {sweep.rows} rows {kept}"):
                swept = collect(sweep, drive, _printed(rows, sweep) if streamed else rows)
            if out.csv not in (None, "-"):
                out.figures(csv_text(page.columns(sweep), map(page.cells, results.records())))
            if file is not None:
                results.require_there()
                note(f"wrote {file}")
            report = page.sweep_report(swept, results.records() if self.json else ())
            if report.exit_code:
                note(f"error: no row has an answer: {swept.reason}")
            return replace(report, head="") if streamed else report

    def _takes_stdout(self) -> bool:
        """Whether rows go to standard output as CSV. Raises UsageError: it is asked for JSON as well."""
        import sys

        from hdassist.errors import UsageError

        if self.json and self.csv == "-":
            raise UsageError("--json and --csv - both take standard output", "--csv FILE")
        no_page = not (self.json or self.quiet or sys.stdout.isatty())
        return self.csv == "-" or (no_page and self.csv is None and self.output == "-")


def _rows(sweep: Sweep, name: str, results: Kept[SweepRow], options: SweepCommand, out: o.Output) -> Iterator[SweepRow]:
    """Records of all rows: those that are kept, then the others as they are computed and kept."""
    from contextlib import closing

    from hdassist.run.run import stream

    yield from results.records()
    with (
        out.progress(name, sweep.rows - results.done) as progress,
        out.engine(options) as engine,
        closing(stream(sweep, sweep.rows, done=results.done, jobs=options.jobs, executor=engine)) as chunks,
    ):
        for records in chunks:
            results.append(records)
            progress(len(records))
            yield from records


def _printed(rows: Iterator[SweepRow], sweep: Sweep) -> Iterator[SweepRow]:
    """The same records, each written to standard output as CSV when it comes."""
    from hdassist.pages.curves import cells, columns
    from hdassist.terminal.answers import csv_text
    from hdassist.terminal.files import write_text

    write_text("-", csv_text(columns(sweep), []), force=False)
    for record in rows:
        write_text("-", csv_text(cells(record), []), force=False)
        yield record
