"""`hdassist measure`: F'_ior and orders of a measured trace."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hdassist.commands.archive_options import ArchiveOptions
from hdassist.errors import UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.measuring.measure import Measurement
    from hdassist.report import Report


@dataclass(frozen=True, kw_only=True)
class MeasureCommand(o.FigureOptions, o.TraceOptions, ArchiveOptions):
    """F'_ior, orders and coverage of measured traces, with their uncertainty.

    \b
    Examples:
      hdassist measure run.csv --drive my-drive.yaml
      hdassist measure run.csv --ratio 100 --error err_mdeg --drift linear
      hdassist measure run.csv --ratio 99.5 --angle enc1 --second enc2
      zcat run.csv.gz | hdassist measure - --ratio 100 --orders 1-6 --json
      hdassist measure run.csv --drive own.yaml --archive rig1 --serial 17-042
      hdassist measure --history 17-042 --archive rig1

    A file has a column of angles and one of errors, or of a second encoder. F'_ior is the range of the error limited to
    the orders, without the share of noise; it is a lower bound unless the full cycle was visited. Each direction stands
    by itself. A file of approached positions (target_deg, deviation_arcsec, side) or of torque loops (torque_Nm,
    twist_arcsec, place) has the figures that makers state beside F'_ior. Exit codes: 0, 4 bad file, 5 orders or F'_ior
    that the record does not tell.
    """

    files: list[str]
    preset: str | None = None
    ratio: float | None = None
    plot: bool = True
    details: bool = False
    seed: int = 0

    def run(self) -> int:
        """Measure the traces; returns the exit code."""
        from hdassist.loading.load import load_preset
        from hdassist.measuring.bench import bench_record
        from hdassist.measuring.orders import gearing_of
        from hdassist.pages.measure import bench_report, measure_report, repeats
        from hdassist.readers.trace import read_record
        from hdassist.terminal.answers import failure
        from hdassist.terminal.runs import give, run_each

        o.stdin_once(*self.files, self.preset)
        out, take = self.open(), self.archiving(self.files)
        if self.history is not None:
            return give("measure-history", [self.history_report(self.history)], self, out)
        drive = load_preset(self.preset) if self.preset is not None else None
        form = self.reading()
        form.require_sound()
        gearing_of(drive, self.ratio)  # a wrong ratio is refused before any file is read
        done: list[Measurement] = []

        def one(name: str) -> Report:
            table = read_record(name, form)
            if record := bench_record(table):
                if self.archive:
                    raise UsageError(f"{name}: positions and torque loops are not kept in an archive", "traces are")
                return bench_report(record, drive, self.seed)
            result = form.of_table(table, drive, self.ratio, seed=self.seed)
            done.append(result)
            take(result)
            return measure_report(result, drive, self.words_of_reading())

        answers = run_each("measure", self.files, one, self, failed=lambda name, e: failure("measure", e, file=name))
        more, below = repeats(done)
        return give("measure", answers, self, out, more=more, below=below)
