"""Commands of random drives: tolerance, sensitivity, allocate."""

from __future__ import annotations

from contextlib import closing, nullcontext
from dataclasses import asdict, replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Literal

from hdassist.errors import UntrustedError, UsageError
from hdassist.files import claim_output
from hdassist.report import Report
from hdassist.run.stops import at_stop, until_interrupted
from hdassist.terminal import options as o
from hdassist.terminal.output import Output, ProgressBar
from hdassist.terminal.streams import say, write_parquet

if TYPE_CHECKING:
    from hdassist.belief.samples import Samples
    from hdassist.preset.fields import Drive
    from hdassist.tolerance.production import Production, ProductionLaw, RandomDrive


class DrawOptions(o.LimitedDriveOptions):
    """How random drives are drawn."""

    distribution: Literal["rayleigh", "uniform", "fixed"] = "rayleigh"
    known: list[str]
    seed: int = 0
    jobs: int = 0
    executor: str | None = None

    def law(self, drive: Drive, *, chosen: bool = False) -> ProductionLaw:
        """Distributions of the random drives; chosen, whether sizes that are assumed are tolerances to choose too.

        Raises UsageError for invalid options.
        """
        from hdassist.preset.fields import DEVIATION_FIELDS
        from hdassist.tolerance.production import production_law

        found = production_law(drive, self.distribution, chosen=chosen, known=self.known)
        if not any(each.path == each.group and each.path in DEVIATION_FIELDS for each in found.own):
            raise UsageError("no field scatters: all tolerances are 0", "set tolerances.e_hb or others above 0")
        return found

    def with_designs(self, out: Output, production: Production, count: int) -> tuple[Production, Samples | None]:
        """A production with the designs of so many drives, and the samples that they are of, if they differ."""
        with out.run("designs", production.design_states(count), self) as run:
            return production.with_designs(count, run=run)

    def records(
        self, out: Output, production: Production, count: int, progress: ProgressBar | None = None
    ) -> list[RandomDrive]:
        """Records of so many drives of a production; progress: the bar of more work than these."""
        from hdassist.run.run import stream

        found: list[RandomDrive] = []
        bar = nullcontext(progress) if progress else out.progress(production.drive.name, count)
        with bar as progress, out.engine(self) as engine:
            for records in stream(production.records, count, jobs=self.jobs, executor=engine):
                found += records
                progress(len(records))
        return found


def _require_limits(drive: Drive) -> list[float]:
    """Limit of F'_ior [arcsec] at each torque. Raises UsageError where there is none at one of them."""
    limits = []
    for M_g in drive.operation.M_g:
        limit = drive.limit(M_g)
        if limit is None:
            hint = f"--limit 30, --limit F_ior@{M_g:g}=30, or --torque for those that have one"
            raise UsageError(f"no limit of F'_ior at {M_g:g} N*m", hint)
        limits.append(limit)
    return limits


class ToleranceCommand(o.RowsOptions, DrawOptions):
    """Yield of random drives inside their tolerances, as built and with each fixed wheel in its best hole.

    \b
    Examples:
      hdassist tolerance vzp160
      hdassist tolerance vzp160 -n 9000 --torque 80 --limit 30 --yield 0.95 --json
      hdassist tolerance vzp160 --set tolerances.e_hb=40 --distribution uniform
      hdassist tolerance vzp160 --known phases.phi_hh
      hdassist tolerance vzp160 -n 100000 --results drives.jsonl

    The drives are others of the type, not the one that check predicts. Designs are drawn from their uncertain inputs
    (as check draws them, weighted by the preset's catalogue), and of each some drives: sizes that are given lie between
    zero and the preset's tolerance, others are drawn as check draws them, directions are any, clearances with a ± lie
    around their value. So the yield is a range over the designs; with --yield the verdict is PASS where the probability
    of reaching it is at least --sure, FAIL where it is at most 1 less that. With --results FILE every drive is kept,
    and the same command goes on where a stopped one has ended; --parquet FILE writes them as a table at the end. Exit
    codes: 0 done or PASS, 3 FAIL, 6 INCONCLUSIVE, 4 bad preset, 5 no trustworthy answer, 130 stopped.
    """

    preset: str
    count: int = 500
    wanted: float | None = None
    sure: float = 0.95
    mounting: bool = True
    results: str | None = None
    per_design: int = 10

    def report(self, out: Output, preset: str) -> Report:
        """Random drives of a preset."""
        from hdassist.error.cycle import self_error
        from hdassist.pages.tolerance import drive_table, tolerance_report
        from hdassist.run.kept import KeptOwner, open_kept
        from hdassist.run.run import stream
        from hdassist.tolerance.production import Production
        from hdassist.tolerance.yields import AtTorque, Summary, rooms

        count, results, drive = self.count, self.results, self.load(preset)
        law, torques = self.law(drive), drive.operation.M_g
        limits = [drive.limit(M_g) for M_g in torques]
        if (self.limit or self.wanted is not None) and not any(limits):
            _require_limits(drive)
        own = [found.range_arcsec for found in self_error(drive, torques)]
        production = Production(
            law,
            torques,
            mounting=self.mounting,
            limits=rooms(limits, own),
            seed=self.seed,
            per_design=self.per_design,
        )
        points, samples = tuple(map(AtTorque, torques, limits, own)), None
        summary = Summary(points, len(production.rotations), self.wanted, self.sure)
        owner = KeptOwner(
            command="tolerance",
            preset=drive.name,
            inputs={"preset": drive.origin.sha256},
            options=production.options(),
            seed=self.seed,
        )
        if results is not None:
            claim_output(results, is_kept=True)

        def progress_words() -> str:
            where = f"are kept in {results}: the same command goes on"
            return f"{kept.done} of {count} drives {where if results else 'are done, none is kept: --results FILE'}"

        with open_kept(results, owner, production.kind, force=self.force) as kept:
            summary.add(islice(kept.records(), count))
            if kept.done < count:
                production, samples = self.with_designs(out, production, count)
            with (
                out.progress(drive.name, count - kept.done) as progress,
                out.engine(self) as engine,
                closing(stream(production.records, count, done=kept.done, jobs=self.jobs, executor=engine)) as chunks,
                at_stop(progress_words),
            ):
                for records in until_interrupted(chunks):
                    kept.append(records)
                    summary.add(records)
                    progress(len(records))
            if not (interrupted := kept.done < count) and self.parquet is not None:
                kinds, rows = drive_table(production, islice(kept.records(), count))
                write_parquet(self.parquet, kinds, rows, asdict(owner), self.force)
        if not summary.count:
            if interrupted:
                raise KeyboardInterrupt
            raise UntrustedError(f"no random drive has an answer: {summary.reason}", "narrow what scatters")
        if interrupted:
            say(f"interrupted: {progress_words()}")
        return tolerance_report(law, self.seed, summary, samples, interrupted=interrupted)


class SensitivityCommand(o.FigureOptions, DrawOptions):
    """Which tolerance to tighten first, and how much a step takes off F'_ior; or the measurement to make before.

    \b
    Examples:
      hdassist sensitivity vzp160
      hdassist sensitivity vzp160 --torque 80 -n 256 --json
      hdassist sensitivity own.yaml --distribution uniform --csv figures.csv

    Over random drives of random designs as built (as hdassist tolerance draws them): the share of the variance of
    ln F'_ior that comes from each field, the size and the direction of a deviation together, and what the 95th
    percentile of F'_ior were with each tolerance a fifth tighter. Exit codes: 0 done, 2 wrong usage, 4 bad preset, 5 no
    trustworthy answer, 130 stopped.
    """

    preset: str
    count: int = 96
    details: bool = False

    def report(self, out: Output, preset: str) -> Report:
        """The tolerances, ranked."""
        from hdassist.pages.tolerance import sensitivity_report
        from hdassist.tolerance.production import Production
        from hdassist.tolerance.tightening import sensitivities

        drive = self.load(preset)
        law = self.law(drive)
        each_its_own = replace(law, shared=law.shared + law.own, own=())
        production = Production(
            each_its_own, drive.operation.M_g, mounting=False, seed=self.seed, per_design=1, steps=True
        )
        production, samples = self.with_designs(out, production, self.count)
        assert samples
        found = sensitivities(production, samples, partial(self.records, out))
        return sensitivity_report(replace(found, law=law))


_MOST_ROUNDS = 5  # of drives that try tolerances, beside the first, at most
_DRIVES_PER_DESIGN = 5  # of many designs few drives each tell more than the reverse


class AllocateCommand(o.FigureOptions, DrawOptions):
    """The cheapest tolerances with which enough drives pass, as built and with each fixed wheel in its best hole.

    \b
    Examples:
      hdassist allocate vzp160 --torque 80 --limit 20
      hdassist allocate vzp160 --limit 20 --limit F_ior@800=6
      hdassist allocate own.yaml --limit 30 --set cost.tolerances.e_hb.share=3

    Tolerances are recommended only where they reach the yield with a probability of --sure over all that is not known
    of the design; a size that the preset assumes is a tolerance to choose too. What one costs stands in the preset:
    cost: {tolerances.e_hb: {share: 3, k: 1.5, least: 10}} costs 3 as the preset has it and 3 (now/tolerance)^1.5 else,
    and no less than 10 um can be made; without it 1, k = 1 and a tenth. Tolerances may grow to twice their value.
    Exit codes: 0 done, 3 no tolerances reach the yield, 6 none is shown to reach it, 2 wrong usage, 4 bad preset, 5 no
    trustworthy answer, 130 stopped.
    """

    preset: str
    wanted: float = 0.95
    count: int = 250
    sure: float = 0.95
    mounting: bool = True

    def report(self, out: Output, preset: str) -> Report:
        """The cheapest tolerances."""
        from hdassist.error.cycle import self_error
        from hdassist.pages.tolerance import allocate_report
        from hdassist.tolerance.production import Production
        from hdassist.tolerance.tightening import Allocator, to_measure

        drive = self.load(preset)
        law, torques, limits = self.law(drive, chosen=True), drive.operation.M_g, _require_limits(drive)
        own = [found.range_arcsec for found in self_error(drive, torques)]
        room = [limit - each for limit, each in zip(limits, own, strict=True)]
        if min(room) <= 0:
            worst = room.index(min(room))
            words = f"the self error alone is {own[worst]:.1f}″ at {torques[worst]:g} N*m"
            hint = "no tolerance changes that: a limit above it, or another wave or clearance"
            raise UsageError(f"{words}, the limit {limits[worst]:g}", hint)
        production = Production(
            law, torques, mounting=self.mounting, limits=room, seed=self.seed, per_design=_DRIVES_PER_DESIGN, steps=True
        )
        if not law.tolerances:
            raise UsageError(
                "no tolerance to choose: none that the preset gives is drawn", "set tolerances.e_hb above 0"
            )
        production, samples = self.with_designs(out, production, self.count)
        turned = (False, True) if self.mounting else (False,)
        with out.progress(f"{drive.name}, at most", len(turned) * (1 + _MOST_ROUNDS) * self.count) as progress:
            records = partial(self.records, out, progress=progress)
            allocator = Allocator(production, tuple(room), self.wanted, self.sure, records, self.count, _MOST_ROUNDS)
            ways = [allocator.cheapest(way) for way in turned]
        gains = to_measure(law, samples, 0) if samples else ()
        return allocate_report(allocator, ways, own, gains)
