"""Commands for the design of a drive, and for random drives of it: tolerance, sensitivity and allocate."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, nullcontext
from dataclasses import asdict, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from hdassist.features.report import Report
from hdassist.features.tolerance import TOLERANCE_DRIVES
from hdassist.interface.terminal import options as o
from hdassist.interface.terminal.output import Output, ProgressBar, csv_text, failure, give, run_each, warn
from hdassist.interface.terminal.streams import say, write_parquet, write_text
from hdassist.run.errors import UntrustedError, UsageError
from hdassist.run.files import claim_output
from hdassist.run.stops import at_stop, until_interrupted

if TYPE_CHECKING:
    from hdassist.belief.samples import Samples
    from hdassist.drive.preset.fields import Drive
    from hdassist.features.design import Sweep, SweepRow
    from hdassist.features.tolerance.production import Production, ProductionLaw, RandomDrive
    from hdassist.features.tolerance.yields import Summary
    from hdassist.run.kept import Kept, KeptOwner


class CheckCommand(o.PlotOptions, o.SamplingOptions, o.PitchOptions, o.LimitedDriveOptions):
    """Kinematic error F'_ior of drives over the full mesh cycle, with a verdict.

    \b
    Examples:
      hdassist check vzp160
      hdassist check vzp160 --limit F_ior@80=30
      hdassist check my-drive.yaml --set tolerances.e_hb=60 --json
      hdassist check vzp160 --torque 40 --torque 80 --limit 45
      hdassist check my-drive.yaml --pitch-b wheel.csv --pitch-g flexspline.csv
      hdassist check *.yaml --csv figures.csv -q

    Every mesh position of the cycle is solved, and the residuals of each solution are checked. The verdict compares
    F'_ior plus the self error (the error of a drive without deviations, over tooth and ball phase) with --limit, or
    with the preset's acceptance limits. All uncertain inputs are sampled jointly and weighted by the preset's catalogue
    values (docs/unknown.md). PASS: the probability of meeting the limit is at least --sure. FAIL: it is at most 1 -
    --sure. INCONCLUSIVE: it lies between. Exit codes: 0 PASS or no limit, 3 FAIL, 4 invalid preset, 5 no trustworthy
    result, 6 INCONCLUSIVE.
    """

    presets: list[str]
    sure: float = 0.95
    solver: str | None = None
    cross_check: str = "highs"

    def report(self, out: Output, preset: str) -> Report:
        """Return the report of the design check of a drive."""
        # measured wheels belong to one drive, which is checked before any preset is read
        files = self.wheels_of_one(self.presets)
        drive = self.load(preset)
        measured = self.teeth(files, drive)
        # the progress bar shows the title
        torques = ", ".join(f"{M_g:g}" for M_g in drive.operation.M_g)
        title = f"{drive.name}, {drive.gears.z_g}/{drive.gears.z_b}, {torques} N·m"
        with out.progress(title):  # shown before numpy is imported
            from hdassist.features.design import check, check_states
            from hdassist.interface.pages.check import check_report

            with out.run(title, check_states(drive, measured, self.draws), self) as run:
                result = check(
                    drive,
                    measured=measured,
                    solver=self.solver,
                    draws=self.draws,
                    sure=self.sure,
                    run=run,
                )
        return check_report(result, self.seed)


class TraceCommand(o.PlotOptions, o.PitchOptions, o.OneTorqueOptions):
    """Kinematic error F_kpp against the input angle, with its orders and their causes.

    \b
    Examples:
      hdassist trace vzp160 --torque 80 --phi-g0 20
      hdassist trace vzp160 --torque 80 -n 100 --csv trace.csv
      hdassist trace vzp160 --torque 80 --gravity 60,90 -n 100
      hdassist trace my-drive.yaml --set phases.xi_b=260 --json

    One input revolution contains as many mesh positions as the fixed wheel has teeth. Orders and their sidebands are
    resolved only over the full mesh cycle (-n 100 for 200/202 teeth).
    """

    preset: str
    start: float = 0.0
    revolutions: int = 1
    speed: float | None = None
    gravity: str | None = None
    solver: str | None = None
    cross_check: str = "highs"
    seed: int = 0

    def report(self, out: Output, preset: str) -> Report:
        """Return the report of the error curve of a drive."""
        from hdassist.drive.error.waves import Gravity, trace
        from hdassist.drive.model.geometry import Kinematics
        from hdassist.interface.pages.curves import trace_report

        files = self.wheels_of_one([preset])
        # gravity is read first, so an invalid option is refused before the preset is loaded
        gravity = Gravity.of(self.gravity) if self.gravity is not None else None
        drive = self.load(preset)
        measured = self.teeth(files, drive)
        with out.run(drive.name, self.revolutions * Kinematics.of(drive).teeth_fixed, self) as run:
            result = trace(
                drive,
                drive.operation.M_g[0],
                measured=measured,
                start_deg=self.start,
                revolutions=self.revolutions,
                gravity=gravity,
                solver=self.solver,
                run=run,
            )
        return trace_report(drive, result, self.seed, self.speed)


class StiffnessCommand(o.PlotOptions, o.DriveOptions):
    """Torsional stiffness: twist against torque in both directions, lost motion, K1, K2, K3.

    \b
    Examples:
      hdassist stiffness vzp160
      hdassist stiffness my-drive.yaml --t1 29 --t2 108 --to 250
      hdassist stiffness my-drive.yaml --csv curve.csv -q

    The computed twist is that of mesh, rings and balls plus that of the shell, which is modelled as a tube. Deviations
    and friction are not included. The segments of the curve end at --t1 and --t2. The defaults are T_1 and T_2 of the
    preset's catalogue, or otherwise the usual catalogue values, scaled by the cube of the pitch diameter. K1, K2 and K3
    are chord stiffnesses, compared with those of the preset's catalogue.
    """

    preset: str
    t1: float | None = None
    t2: float | None = None
    to: float | None = None
    cross_check: str = "highs"

    def report(self, out: Output, preset: str) -> Report:
        """Return the report of the twist of a drive over the torque."""
        from hdassist.drive.error.stiffness import stiffness, stiffness_states
        from hdassist.interface.pages.curves import stiffness_report

        drive = self.load(preset)
        with out.run(drive.name, stiffness_states(), self) as run:
            return stiffness_report(
                drive,
                stiffness(
                    drive,
                    T_1=self.t1,
                    T_2=self.t2,
                    T_max=self.to,
                    run=run,
                ),
            )


_JSON_ROWS = 100_000  # largest number of rows with --json, which holds them in memory


class SweepCommand(o.RowsOptions, o.LoadedDriveOptions):
    """F'_ior over a grid of values of any numeric fields of a preset, row by row.

    \b
    Examples:
      hdassist sweep vzp160 --vary tolerances.e_hb=20:120:11
      hdassist sweep vzp160 --vary tolerances.e_hb=20:120:11 \\
          --vary operation.M_g=40:800:5
      hdassist sweep vzp160 --vary gears.j_n=0,5,10 | column -s, -t
      hdassist sweep my-drive.yaml --vary cam.W_0=0.9:1.0:201 -o rows.jsonl

    Each row gives F'_ior at one point of the grid and one torque. If operation.M_g is varied, the torque is part of the
    grid. Otherwise the grid is computed at each torque of the preset. In a pipe, rows are written as CSV as soon as
    they are computed; --csv FILE writes them to a file. -o FILE.jsonl writes JSON Lines: after an interruption the same
    command resumes after the last row in the file. A row without a result stays in the table, with its reason; the exit
    code is 0 if any row has a result. --parquet FILE writes the finished table.
    """

    preset: str
    vary: list[str]
    output: str = "-"
    jobs: int = 0
    executor: str | None = None

    @property
    def answer_file(self) -> str:
        """The destination of the result, always standard output, because -o names the file for the rows."""
        return "-"

    def report(self, out: Output, preset: str) -> Report:
        """Compute the rows, write them to the requested outputs, and return the report on the rows."""
        from hdassist.drive.loading import load_text
        from hdassist.features.design import Sweep, collect, read_axes
        from hdassist.interface.pages.curves import sweep_report
        from hdassist.run.files import read_preset
        from hdassist.run.kept import KeptOwner, open_kept

        # without a file, rows are computed and printed, but not stored
        file = None if self.output == "-" else self.output
        streamed = self._takes_stdout()
        text, path = read_preset(preset)
        drive = load_text(text, path, self.changes)
        # the sweep contains the text of the preset, because each row loads the preset with other values
        sweep = Sweep.of(text, path, drive, read_axes(self.vary, drive.origin.overrides))
        # a JSON object with all rows must fit in memory
        if self.json and sweep.rows > _JSON_ROWS:
            raise UsageError(
                f"--json cannot print {sweep.rows} rows: the maximum is {_JSON_ROWS}",
                "use -o FILE.jsonl for any number of rows",
            )
        options = {"vary": self.vary, "set": list(drive.origin.overrides)}
        # the owner states all inputs of the rows, so a file with rows of another preset or grid is refused
        owner = KeptOwner(
            command="sweep",
            preset=drive.name,
            inputs={"preset": drive.origin.sha256},
            options=options,
        )
        if file is not None:
            # the file may exist already, because the run may continue its rows
            claim_output(file, is_kept=True)
        with open_kept(file, owner, sweep.kind, force=self.force) as results:
            rows = _rows(sweep, drive.name, results, self, out)
            kept = f"are stored in {file}; repeat the command to resume" if file else "are done but not stored"
            # at_stop shows the message if the command is stopped
            with at_stop(lambda: f"{results.done} of {sweep.rows} rows {kept}"):
                # rows are not kept in memory; collect() keeps only the figures for the page
                swept = collect(sweep, drive, _printed(rows, sweep) if streamed else rows)
            self._write_tables(sweep, results, owner, out)
            if file is not None:
                # the file may have been moved during the computation
                results.require_there()
                as_lines = " as JSON Lines; for CSV use --csv" if file.endswith(".csv") else ""
                say(f"wrote {file}{as_lines}")
            report = sweep_report(swept, results.records() if self.json else ())
            if report.exit_code:
                say(f"error: no row has a result: {swept.reason}")
            # the rows were written to standard output, so the page there has no heading
            return replace(report, head="") if streamed else report

    def _write_tables(
        self,
        sweep: Sweep,
        results: Kept[SweepRow],
        owner: KeptOwner,
        out: Output,
    ) -> None:
        """Write the rows to the requested CSV and Parquet files.

        sweep: sweep, which determines the columns.
        results: computed rows.
        owner: inputs of the rows, stored in the metadata of the Parquet file.
        out: output of the command.
        """
        from hdassist.interface.pages.curves import cells, columns

        if out.csv is not None and out.csv != "-":
            write_text(out.csv, csv_text(columns(sweep), map(cells, results.records())), out.force)
        if self.parquet is not None:
            kinds = {column: str if column == "reason" else float for column in columns(sweep)}
            write_parquet(self.parquet, kinds, map(cells, results.records()), asdict(owner), self.force)

    def _takes_stdout(self) -> bool:
        """Return whether rows are written to standard output as CSV."""
        import sys

        # without a page on standard output, a pipe receives the rows
        no_page = not (self.json or self.quiet or sys.stdout.isatty())
        return self.csv == "-" or (no_page and self.csv is None and self.output == "-")


def _rows(
    sweep: Sweep,
    name: str,
    results: Kept[SweepRow],
    options: SweepCommand,
    out: Output,
) -> Iterator[SweepRow]:
    """Yield the stored rows, then the new rows, each as soon as it is computed and stored."""
    from hdassist.run.run import stream

    # the caller evaluates stored rows in the same way as new rows
    yield from results.records()
    with (
        out.progress(name, sweep.rows - results.done) as progress,
        out.engine(options) as engine,
        closing(
            stream(
                sweep,
                sweep.rows,
                done=results.done,
                jobs=options.jobs,
                executor=engine,
            )
        ) as chunks,
    ):
        for records in chunks:
            # rows are stored before they are passed on, so an interruption loses none of them
            results.append(records)
            progress(len(records))
            yield from records


def _printed(rows: Iterator[SweepRow], sweep: Sweep) -> Iterator[SweepRow]:
    """Write each row to standard output as CSV, and yield it."""
    from hdassist.interface.pages.curves import cells, columns

    write_text(
        "-",
        csv_text(columns(sweep), []),
        force=False,
    )
    for record in rows:
        write_text(
            "-",
            csv_text(cells(record), []),
            force=False,
        )
        yield record


_PRESET_SUFFIXES = (".yaml", ".yml")
_OF_TRACES = ("start", "zero", "error_is", "cam_sense")  # further options of recordings, besides TraceOptions


class CompareCommand(o.PlotOptions, o.SamplingOptions, o.SignOptions, o.TraceOptions, o.OneTorqueOptions):
    """A recording and its prediction, with the deviation that explains the difference; or presets side by side.

    \b
    Examples:
      hdassist compare own.yaml run.csv --torque 80
      hdassist compare own.yaml run.csv --error-is output-cam --drift linear
      hdassist compare own.yaml run.csv --angle enc1 --second enc2
      hdassist compare own.yaml run.csv --set phases.xi_b=230 --json
      hdassist compare vzp160 own.yaml --limit 30

    Each deviation of the wave generator, the circular spline or the flexspline is fitted alone, then all together,
    through the contact model. The page names causes that the recording does not distinguish.

    A FILE that is a name of the library, or ends in .yaml or .yml, is a preset; anything else is a recording (./NAME
    for one with the name of a preset). For presets the page gives the better drive with its probability, and F'_ior and
    the best hole of each drive. If the presets have no torque in common, they are compared at equal shares of their
    rated torques. The page also lists the fields that differ. Each of them is changed alone, to find the one with the
    largest effect. --torque, --set, --draws, --seed and --jobs apply to presets too. With --limit, or limits of the
    presets, the page gives the probability of meeting the limit as assembled and in the best hole. Exit codes: 0 done,
    4 invalid file, 5 the recording does not resolve the orders or the range, or no trustworthy result.
    """

    preset: str
    files: list[str]
    torque: str | None = None
    limit: list[str]
    start: str = "fit"
    zero: str | None = None

    def run(self) -> int:
        """Compare recordings with the drive, or presets with each other; return the exit code."""
        return self._compare_presets() if any(map(is_preset, self.files)) else self._compare_traces()

    def _compare_traces(self) -> int:
        """Compare recordings with the drive, and return the exit code."""
        if self.limit:
            raise UsageError(
                "--limit does not apply to recordings", "use hdassist accept to compare a recording with a limit"
            )
        o.stdin_once(*self.files, self.preset)
        out = self.open()
        # the angles are read first, so invalid angles are refused before any file is read
        start = o.degrees_or_fit("--phi-g0", self.start)
        given_zero = o.degrees_or_fit("--cam-zero", self.zero or "0")
        with out.progress(self.preset):  # shown before numpy is imported
            from hdassist.features.record_comparison.compare import FIT_STATES, compare, torque_of, zero_of
            from hdassist.interface.pages.compare import comparison_report
            from hdassist.run.run import Run

            drive = self.load(self.preset)
            reading = self.reading()
            M_g = torque_of(drive)

            def one(name: str) -> Report:
                measurement = reading.measured(
                    name,
                    drive,
                    seed=self.seed,
                    together=True,
                    M_g=M_g,
                )
                # without --cam-zero, it depends on the recording whether the zero is known or fitted
                zero = given_zero if self.zero else zero_of(measurement.trace, drive, start)
                fitted = (start is None, zero is None)
                alignment = replace(
                    self.alignment(),
                    start_deg=start or 0.0,
                    zero_deg=zero or 0.0,
                    fitted=fitted,
                )
                with out.progress(f"{drive.name}, {measurement.trace.file}", FIT_STATES) as progress:
                    result = compare(
                        measurement,
                        drive,
                        M_g=M_g,
                        asked=alignment,
                        run=Run(progress=progress),
                    )
                return comparison_report(result)

            answers = run_each(
                "compare",
                self.files,
                one,
                out,
                kind="file",
            )
        return give("compare", answers, out)

    def _limited(self, preset: str) -> Drive:
        """Return the drive of a preset with the torque and the limits from the command line.

        Raises DataError, PresetError or UsageError.
        """
        from hdassist.drive.loading import with_asked

        torques = [] if self.torque is None else [self.torque]
        options = o.LimitedDriveOptions(
            overrides=self.overrides,
            torque=torques,
            limit=self.limit,
        )
        return with_asked(options.load(preset), self.taken_over())

    def _require_presets_only(self) -> None:
        """Raise UsageError if recordings, options of recordings, or CSV are combined with presets."""
        # recordings and presets cannot be compared in one call
        if traces := [name for name in self.files if not is_preset(name)]:
            message = f"cannot compare the recording {traces[0]} with the preset {next(filter(is_preset, self.files))}"
            raise UsageError(message, "give only presets (library names or .yaml files), or only recordings")
        # an option that has its default value counts as not given
        plain = all(getattr(self, name) == getattr(type(self), name) for name in _OF_TRACES)
        if not plain or self.only(o.TraceOptions) != o.TraceOptions(budget=[]):
            raise UsageError(
                "options for reading recordings do not apply to presets", "leave out these options, or name a recording"
            )
        if self.csv is not None:
            raise UsageError(
                "a comparison of presets cannot be written as CSV",
                f"use hdassist check {' '.join([self.preset, *self.files])} --csv FILE",
            )

    def _compare_presets(self) -> int:
        """Compare presets, and return the exit code.

        Raises UsageError if recordings, options of recordings, or CSV are combined with presets.
        """
        self._require_presets_only()
        names = [self.preset, *self.files]
        o.stdin_once(*names)
        out = self.open()

        def one(_: str) -> Report:
            with out.progress(", ".join(names)):  # shown before numpy is imported
                from hdassist.features.preset_comparison import at_common_torques, compare_drives, estimate_comparison
                from hdassist.interface.pages.compare import comparison_warnings, drives_report

                drives = at_common_torques([self._limited(name) for name in names])
                title = ", ".join(drive.name for drive in drives)
                with out.run(title, estimate_comparison(drives, self.draws), self) as run:
                    result = compare_drives(drives, draws=self.draws, run=run)
            for text in comparison_warnings(result):
                warn(text)
            return drives_report(result, self.seed)

        schema = "compare-presets"
        answers = run_each(
            schema,
            [""],
            one,
            out,
            failed=lambda _, e: failure(schema, e, preset=names[0]),
        )
        return give(schema, answers, out)


def is_preset(name: str) -> bool:
    """Return whether an argument names a preset (of the library, or a YAML file) rather than a recording."""
    from hdassist.run.files import preset_names

    return Path(name).suffix.lower() in _PRESET_SUFFIXES or name in preset_names()


_REPORT_SUFFIXES = (".html", ".md")


class ReportCommand(o.AnswerOptions, o.SamplingOptions, o.LimitedDriveOptions):
    """Report on a drive, two pages: verdict, errors, mounting, stiffness, assumptions, provenance.

    \b
    Examples:
      hdassist report vzp160 -o report.html
      hdassist report my-drive.yaml --set tolerances.e_hb=60 -o better.html
      hdassist report my-drive.yaml --limit 45 -o report.md

    The report is one file without scripts, for screens (light and dark) and for A4 paper. Its numbers are those of
    check, mount and stiffness, and the same input gives the same bytes. -o names a .html or .md file; without it,
    Markdown is written to standard output. A mounting instruction is given only if uncertain inputs cannot reverse it.
    Exit codes: 0 PASS or no limit, 3 FAIL, 4 invalid preset, 5 no trustworthy result, 6 INCONCLUSIVE, or no recommended
    hole. The report is written with 0, 3 and 6.
    """

    preset: str

    def run(self) -> int:
        """Write the report, and return the exit code."""
        is_document = Path(self.output).suffix.lower() in _REPORT_SUFFIXES
        # --json and -q write their results like other commands, but a file named by -o is always a document
        if self.json or (self.quiet and not is_document):
            return super().run()
        kind = self._kind()
        out = self.open()
        [report] = run_each("report", [self.preset], partial(self.report, out), out)
        # a report without a heading has no page, so only its warnings are written, to stderr
        code = give("report", [replace(report, head="")], out)
        from hdassist.interface.pages.report import report_html, report_markdown

        if kind == ".html":
            page = report_html(report)
            out.text(page.encode("ascii", "xmlcharrefreplace").decode() if self.ascii else page)
        else:
            out.text(report_markdown(report, out.style))
        return code

    def report(self, out: Output, preset: str) -> Report:
        """Return the complete report of a drive."""
        from hdassist.features.preset_comparison import sheet_of, sheet_states
        from hdassist.interface.pages.report import drive_report

        drive = self.load(preset)
        with out.run(drive.name, sheet_states(drive, self.draws), self) as run:
            return drive_report(
                sheet_of(drive, draws=self.draws, run=run),
                draws=self.draws,
                seed=self.seed,
            )

    def _kind(self) -> str:
        """Return the suffix that decides the format of the report. Raises UsageError for an invalid file name."""
        if self.output == "-":
            return ".md"
        kind = Path(self.output).suffix.lower()
        if kind not in _REPORT_SUFFIXES:
            message = f"invalid report name: {self.output!r}"
            raise UsageError(message, f"use a name that ends in {' or '.join(_REPORT_SUFFIXES)}")
        return kind


class DrawOptions(o.LimitedDriveOptions):
    """Options for sampling random drives."""

    distribution: Literal["rayleigh", "uniform", "fixed"] = "rayleigh"
    known: list[str]
    seed: int = 0
    jobs: int = 0
    executor: str | None = None

    def law(self, drive: Drive, *, chosen: bool = False) -> ProductionLaw:
        """Return the distributions from which random drives are sampled.

        drive: drive whose tolerances apply.
        chosen: whether assumed sizes count as tolerances to be chosen.
        Raises UsageError for invalid options.
        """
        from hdassist.drive.preset.fields import DEVIATION_FIELDS
        from hdassist.features.tolerance.production import production_law

        law = production_law(
            drive,
            self.distribution,
            chosen=chosen,
            known=self.known,
        )
        # if no size varies, all drives are equal
        if not any(field.path == field.group and field.path in DEVIATION_FIELDS for field in law.own):
            raise UsageError("no field varies: all tolerances are 0", "set tolerances.e_hb or other tolerances above 0")
        return law

    def with_designs(
        self,
        out: Output,
        production: Production,
        count: int,
    ) -> tuple[Production, Samples | None]:
        """Return a production with sampled designs for its drives, and the samples of these designs.

        The samples are None if all drives have the same design.

        production: production without designs.
        count: number of drives.
        """
        with out.run("designs", production.design_states(count), self) as run:
            return production.with_designs(count, run=run)

    def records(
        self,
        out: Output,
        production: Production,
        count: int,
        progress: ProgressBar | None = None,
    ) -> list[RandomDrive]:
        """Return the results of random drives.

        production: production of the drives.
        count: number of drives.
        progress: progress bar shared with further work, None for a new bar.
        """
        from hdassist.run.run import stream

        drives: list[RandomDrive] = []
        # a given bar stays open, because several productions share it
        bar = nullcontext(progress) if progress else out.progress(production.drive.name, count)
        with bar as progress, out.engine(self) as engine:
            for records in stream(production.records, count, jobs=self.jobs, executor=engine):
                drives += records
                progress(len(records))
        return drives


def _require_limits(drive: Drive) -> list[float]:
    """Return the limit of F'_ior [arcsec] at each torque. Raises UsageError if a torque has no limit."""
    limits = []
    for M_g in drive.operation.M_g:
        limit = drive.limit(M_g)
        # a torque without a limit must not be skipped silently, because all torques count
        if limit is None:
            hint = f"use --limit 30 or --limit F_ior@{M_g:g}=30, or select the torques with a limit by --torque"
            raise UsageError(f"no limit of F'_ior is set at {M_g:g} N*m", hint)
        limits.append(limit)
    return limits


class ToleranceCommand(o.RowsOptions, DrawOptions):
    """Yield of random drives within their tolerances, as assembled and with each fixed wheel in its best hole.

    \b
    Examples:
      hdassist tolerance vzp160
      hdassist tolerance vzp160 -n 9000 --torque 80 --limit 30 --yield 0.95 --json
      hdassist tolerance vzp160 --set tolerances.e_hb=40 --distribution uniform
      hdassist tolerance vzp160 --known phases.phi_hh
      hdassist tolerance vzp160 -n 100000 --results drives.jsonl

    The drives are other drives of the type, not the one that check predicts. Designs are sampled from the uncertain
    inputs (as in check, weighted by the preset's catalogue values). Several drives are sampled for each design. Given
    sizes lie between zero and the preset's tolerance, other sizes are sampled as in check, directions are random, and
    clearances with a ± vary about their value. The yield is therefore a range over the designs. With --yield the
    verdict is PASS if the probability of reaching it is at least --sure, FAIL if it is at most 1 - --sure, else
    INCONCLUSIVE. --results FILE stores every drive, and the same command resumes an interrupted run; --parquet FILE
    writes a table of the drives at the end. Exit codes: 0 done or PASS, 3 FAIL, 6 INCONCLUSIVE, 4 invalid preset, 5 no
    trustworthy result, 130 stopped.
    """

    preset: str
    count: int = TOLERANCE_DRIVES
    wanted: float | None = None
    sure: float = 0.95
    mounting: bool = True
    results: str | None = None
    per_design: int = 10

    def report(self, out: Output, preset: str) -> Report:
        """Return the report on random drives of a preset, which are solved or read from an earlier run."""
        from hdassist.interface.pages.tolerance import drive_table, tolerance_report
        from hdassist.run.kept import KeptOwner, open_kept

        drive = self.load(preset)
        law = self.law(drive)
        production, summary = self._begun(drive, law)
        owner = KeptOwner(
            command="tolerance",
            preset=drive.name,
            inputs={"preset": drive.origin.sha256},
            options=production.options(),
            seed=self.seed,
        )
        if self.results is not None:
            claim_output(self.results, is_kept=True)

        def progress_words() -> str:
            if self.results:
                return f"{kept.done} of {self.count} drives are stored in {self.results}; the same command resumes"
            return f"{kept.done} of {self.count} drives are done but not stored; store them with --results FILE"

        samples = None
        with open_kept(self.results, owner, production.kind, force=self.force) as kept:
            # the result includes the drives of an earlier run
            summary.add(islice(kept.records(), self.count))
            # designs are needed only if a drive remains to be solved
            if kept.done < self.count:
                production, samples = self.with_designs(out, production, self.count)
            self._solve_drives(out, production, kept, summary, progress_words)
            interrupted = kept.done < self.count
            if not interrupted and self.parquet is not None:
                kinds, rows = drive_table(production, islice(kept.records(), self.count))
                write_parquet(self.parquet, kinds, rows, asdict(owner), self.force)
        if not summary.count:
            # no report can be made if no drive has a result
            if interrupted:
                raise KeyboardInterrupt
            raise UntrustedError(f"no random drive has a result: {summary.reason}", "reduce the tolerances and ranges")
        if interrupted:
            say(f"interrupted: {progress_words()}")
        return tolerance_report(law, self.seed, summary, samples, interrupted=interrupted)

    def _begun(self, drive: Drive, law: ProductionLaw) -> tuple[Production, Summary]:
        """Return the production of random drives, and the empty summary of their results.

        Raises UsageError if a yield is required without limits, UntrustedError if a self error cannot be trusted.
        """
        from hdassist.drive.error.cycle import self_error
        from hdassist.features.tolerance.production import Production
        from hdassist.features.tolerance.yields import AtTorque, Summary, rooms

        torques = drive.operation.M_g
        limits = [drive.limit(M_g) for M_g in torques]
        if (self.limit or self.wanted is not None) and not any(limits):
            _require_limits(drive)
        self_errors = [error.range_arcsec for error in self_error(drive, torques)]
        production = Production(
            law,
            torques,
            mounting=self.mounting,
            limits=rooms(limits, self_errors),
            seed=self.seed,
            per_design=self.per_design,
        )
        points = tuple(map(AtTorque, torques, limits, self_errors))
        summary = Summary(
            points=points,
            positions=len(production.rotations),
            wanted=self.wanted,
            sure=self.sure,
        )
        return production, summary

    def _solve_drives(
        self,
        out: Output,
        production: Production,
        kept: Kept[RandomDrive],
        summary: Summary,
        progress_words: Callable[[], str],
    ) -> None:
        """Solve the drives that are not stored yet, store their results, and add them to the summary.

        An interruption ends the work without an error.

        production: production of the drives.
        kept: file of stored results.
        summary: summary of all drives.
        progress_words: function that returns the state of the work as text, shown if the process is stopped.
        """
        from hdassist.run.run import stream

        with (
            out.progress(production.drive.name, self.count - kept.done) as progress,
            out.engine(self) as engine,
            closing(
                stream(
                    production.records,
                    self.count,
                    done=kept.done,
                    jobs=self.jobs,
                    executor=engine,
                )
            ) as chunks,
            at_stop(progress_words),
        ):
            for records in until_interrupted(chunks):
                kept.append(records)
                summary.add(records)
                progress(len(records))


class SensitivityCommand(o.FigureOptions, DrawOptions):
    """Tolerances ranked by the reduction of F'_ior from tightening each, or the measurement to make first.

    \b
    Examples:
      hdassist sensitivity vzp160
      hdassist sensitivity vzp160 --torque 80 -n 256 --json
      hdassist sensitivity own.yaml --distribution uniform --csv figures.csv

    The result is computed over random drives of random designs, as assembled (sampled as in hdassist tolerance). It
    gives the contribution of each field to the variance of ln F'_ior, with size and direction of a deviation taken
    together, and the 95th percentile of F'_ior with each tolerance tightened by a fifth. Exit codes: 0 done, 2 wrong
    usage, 4 invalid preset, 5 no trustworthy result, 130 stopped.
    """

    preset: str
    count: int = 96
    details: bool = False

    def report(self, out: Output, preset: str) -> Report:
        """Return the report of the ranked tolerances."""
        from hdassist.features.tolerance.production import Production
        from hdassist.features.tolerance.tightening import sensitivities
        from hdassist.interface.pages.tolerance import sensitivity_report

        drive = self.load(preset)
        law = self.law(drive)
        each_its_own = replace(
            law,
            shared=law.shared + law.own,
            own=(),
        )
        production = Production(
            each_its_own, drive.operation.M_g, mounting=False, seed=self.seed, per_design=1, steps=True
        )
        production, samples = self.with_designs(out, production, self.count)
        assert samples
        result = sensitivities(production, samples, partial(self.records, out))
        return sensitivity_report(replace(result, law=law))


_MOST_ROUNDS = 5  # largest number of rounds with further drives in the search for tolerances
_DRIVES_PER_DESIGN = 5  # number of drives per design; few drives in each of many designs give more information
_TIMED_DRIVES = 3  # number of drives solved first to estimate the total time
_SHORT_TIME = 10.0  # s; a shorter estimated time is not shown


def _rooms_beside_self_error(
    limits: Sequence[float],
    self_errors: Sequence[float],
    torques: Sequence[float],
) -> list[float]:
    """Return the limits of F'_ior minus the self error [arcsec], shape (torques,).

    Args:
        limits: limit at each torque [arcsec].
        self_errors: self error at each torque [arcsec].
        torques: torques [N*m].

    Raises UsageError if the self error, which no tolerance changes, exceeds a limit.
    """
    room = [limit - self_error_arcsec for limit, self_error_arcsec in zip(limits, self_errors, strict=True)]
    if min(room) <= 0:
        worst = room.index(min(room))
        message = f"the self error at {torques[worst]:g} N*m is {self_errors[worst]:.1f}″"
        hint = "raise the limit, or change cam.W_0 or gears.j_n; no tolerance reduces the self error"
        raise UsageError(f"{message}, which alone exceeds the limit of {limits[worst]:g}″", hint)
    return room


class AllocateCommand(o.FigureOptions, DrawOptions):
    """The cheapest tolerances that reach a yield, as assembled and with each fixed wheel in its best hole.

    \b
    Examples:
      hdassist allocate vzp160 --torque 80 --limit 20
      hdassist allocate vzp160 --limit 20 --limit F_ior@800=6
      hdassist allocate own.yaml --limit 30 --set cost.tolerances.e_hb.share=3

    Tolerances are recommended only if the probability that they reach the yield is at least --sure, over all uncertain
    inputs of the design. Assumed sizes are also treated as tolerances to choose. The preset gives the costs: cost:
    {tolerances.e_hb: {share: 3, k: 1.5, least: 10}} costs 3 at the present tolerance and 3 (now/tolerance)^1.5
    otherwise, and the smallest feasible tolerance is 10 um. Defaults: share 1, k 1, least a tenth of the present
    tolerance. A tolerance may grow to twice its value. Exit codes: 0 done, 3 no tolerances achieve the required yield,
    6 none is shown to achieve it, 2 wrong usage, 4 invalid preset, 5 no trustworthy result, 130 stopped.
    """

    preset: str
    wanted: float = 0.95
    count: int = 250
    sure: float = 0.95
    mounting: bool = True

    def report(self, out: Output, preset: str) -> Report:
        """Return the report of the cheapest tolerances."""
        from hdassist.drive.error.cycle import self_error
        from hdassist.features.tolerance.production import Production
        from hdassist.features.tolerance.tightening import Allocator, to_measure, worst_torque
        from hdassist.interface.pages.tolerance import allocate_report

        drive = self.load(preset)
        law = self.law(drive, chosen=True)
        torques = drive.operation.M_g
        limits = _require_limits(drive)
        self_errors = [self_error_of_torque.range_arcsec for self_error_of_torque in self_error(drive, torques)]
        room = _rooms_beside_self_error(limits, self_errors, torques)
        production = Production(
            law, torques, mounting=self.mounting, limits=room, seed=self.seed, per_design=_DRIVES_PER_DESIGN, steps=True
        )
        if not law.tolerances:
            raise UsageError(
                "no tolerance can be chosen: all tolerances of the preset are 0", "set tolerances.e_hb above 0"
            )
        production, samples = self.with_designs(out, production, self.count)
        turned = (False, True) if self.mounting else (False,)
        self._say_time([replace(production, mounting=is_turned) for is_turned in turned])
        with out.progress(f"{drive.name}, at most", len(turned) * (1 + _MOST_ROUNDS) * self.count) as progress:
            records = partial(self.records, out, progress=progress)
            allocator = Allocator(
                production=production,
                rooms=tuple(room),
                wanted=self.wanted,
                sure=self.sure,
                records=records,
                drives=self.count,
                rounds=_MOST_ROUNDS,
            )
            ways = [allocator.cheapest(turned=False)]
            if self.mounting:
                # tolerances that are verified as assembled are sufficient in the best holes too
                ways.append(allocator.cheapest(turned=True, start=ways[0].values if ways[0].fits else None))
        torque = worst_torque(drive, samples) if samples else 0
        gains = to_measure(law, samples, torque) if samples else ()
        return allocate_report(allocator, ways, self_errors, gains, torques[torque])

    def _say_time(self, productions: Sequence[Production]) -> None:
        """Write the estimated maximum time of the search to stderr, after solving a few drives of each production.

        No time is written if it is short, or if an executor solves the drives.
        """
        from hdassist.run.run import count

        if self.executor:
            return
        most_drives = (1 + _MOST_ROUNDS) * self.count
        seconds = 0.0
        for production in productions:
            start = time.perf_counter()
            production.records(0, _TIMED_DRIVES)
            seconds += (time.perf_counter() - start) / _TIMED_DRIVES * most_drives / count(self.jobs)
        if seconds > _SHORT_TIME:
            duration = f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
            drives = len(productions) * most_drives
            say(f"time: up to {duration} for at most {drives} random drives; -n sets the number of drives per round")
