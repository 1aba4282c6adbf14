"""`hdassist accept`: drives, and lots of them, held against their limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hdassist.errors import UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.acceptance.request import Request
    from hdassist.terminal.output import Output


@dataclass(frozen=True, kw_only=True)
class AcceptOptions(o.FigureOptions, o.SamplingOptions):
    """How answers are worked out and given; jsonl and junit also have the drives without an answer."""

    details: bool = False
    jsonl: str | None = None
    resume: bool = False
    junit: str | None = None
    executor: str | None = None

    def replaces(self, path: str) -> bool:
        """Whether an existing file may be replaced: a lot that goes on replaces figures and suites of its last run."""
        from hdassist.pages.accept import FIGURES_HEAD, SUITES_HEAD
        from hdassist.terminal.files import begins_with

        return self.force or (self.resume and begins_with(path, (FIGURES_HEAD, SUITES_HEAD)))

    def open(self) -> Output:
        """Where answers go. Raises UsageError and DataError unless each file has its own place, and can be written."""
        from hdassist.terminal.files import take_output

        if self.jsonl == "-" or (self.resume and self.jsonl is None):
            raise UsageError("answers of a lot are kept in a file", "--jsonl FILE")
        if [self.csv, self.junit, self.output if self.json else None].count("-") > 1:
            raise UsageError("standard output can take one of --json, --csv and --junit")
        out = super().open()
        if self.jsonl is not None:
            take_output(self.jsonl, self.force, is_kept=self.resume)
        if self.junit is not None:
            take_output(self.junit, self.replaces(self.junit))
        return out


@dataclass(frozen=True, kw_only=True)
class AcceptCommand(AcceptOptions, o.PitchOptions, o.TraceOptions, o.DriveOptions):
    """PASS, FAIL or INCONCLUSIVE: drives held against the limits of their presets.

    \b
    Examples:
      hdassist accept my-drive.yaml
      hdassist accept my-drive.yaml --measured 80=run.csv \\
          --budget encoder=0.3,coupling=0,reseating=0.3,temperature=0.4
      hdassist accept vzp160 --limit 30 --limit lost_motion=60
      hdassist accept my-drive.yaml --value lost_motion=41±3 --json
      hdassist accept lot.csv --preset my-drive.yaml --measured-only \\
          --jsonl lot.jsonl --resume --junit lot.xml
      grep -v '^17-04' lot.csv | hdassist accept - --preset my-drive.yaml
      hdassist accept --replay result.json

    A limit is decided by the measured value, with its uncertainty and a decision rule (acceptance.rule), or else by the
    model's prediction, as hdassist check does it. A trace passes only where --budget states encoder, coupling,
    reseating and temperature, 0 allowed. hdassist explain CODE has the meaning of a check. A lot has a row for each
    drive, with the columns serial, preset, measured or measured@80, pitch_b, pitch_g (files), mark_b, mark_g,
    NAME[@TORQUE] (values like 28.1±1.2), limit NAME[@TORQUE], section.key (overrides). Exit codes: 0 PASS, 3 FAIL or a
    replay that differs, 6 INCONCLUSIVE, 4 bad preset, file or no limit, 5 no trustworthy answer; of several drives the
    worst, in the order 1, 5, 4, 3, 6, 0.
    """

    presets: list[str]
    limit: list[str]
    measured: list[str]
    value: list[str]
    measured_only: bool = False
    sure: float = 0.95
    serial: str = ""
    preset: str = ""
    replay: str | None = None
    cross_check: str = "highs"

    def run(self) -> int:
        """Accept the drives, the lot, or recorded answers again; returns the exit code."""
        from hdassist.acceptance.lot import is_lot
        from hdassist.acceptance.request import Request
        from hdassist.commands.accept_run import accept_lot, accept_presets, replay_answers

        lots = [name for name in self.presets if is_lot(name) or (name == "-" and self.preset)]
        if not self.presets and self.replay is None:
            raise UsageError("nothing to accept", "name a preset or a lot.csv; hdassist accept -h")
        if len(self.presets) > 1 and lots:
            raise UsageError(f"{lots[0]} is a lot: one lot at a time, without other drives")
        base = self.request()
        wheels, files = base.wheels, base.files()[1:]
        if not lots:
            wheels.require_sound()
        of_one = self.measured or self.value or self.serial or wheels.files or wheels.marks
        if (len(self.presets) > 1 or lots) and of_one:
            raise UsageError("what was measured belongs to one drive", "one PRESET, or columns of a lot: LOT.csv")
        if (self.preset or self.resume or self.jsonl) and not (lots or self.replay):
            raise UsageError("--preset, --jsonl and --resume are for lots", "hdassist accept LOT.csv")
        o.stdin_once(*self.presets, *files, self.replay)
        if self.measured_only and wheels.files:
            raise UsageError("--measured-only predicts nothing, and measured teeth are for predictions")
        if self.preset == "-":
            raise UsageError("rows of a lot cannot read standard input", "--preset FILE")
        if self.replay is not None:
            if self.presets or self.csv or self.jsonl or self.junit or base != Request(""):
                words = "no PRESET, and no other options than --json, -o, --jobs"
                raise UsageError("--replay does what its answer says", words)
            return replay_answers(self.replay, self)
        return accept_lot(lots[0], base, self) if lots else accept_presets(self.presets, base, self)

    def request(self) -> Request:
        """The request that every drive gets. Raises UsageError for an invalid limit."""
        from hdassist.acceptance.request import Request

        return Request(
            self.preset,
            self.serial,
            overrides=tuple(self.overrides),
            limits=tuple(map(str, o.limits_of_options(self.limit))),
            measured=tuple(self.measured),
            values=tuple(self.value),
            reading=self.reading(),
            measured_only=self.measured_only,
            cross_check=self.cross_check,
            seed=self.seed,
            wheels=self.wheels(),
            draws=self.draws,
            sure=self.sure,
        )
