"""`hdassist tolerance`: random drives inside their tolerances."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from itertools import islice

from hdassist.commands.draw_options import DrawOptions, require_limits
from hdassist.terminal import options as o


@dataclass(frozen=True, kw_only=True)
class ToleranceCommand(o.PlotOptions, DrawOptions):
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
    and the same command goes on where a stopped one has ended. Exit codes: 0 done or PASS, 3 FAIL, 6 INCONCLUSIVE, 4
    bad preset, 5 no trustworthy answer, 130 stopped.
    """

    preset: str
    count: int = 500
    wanted: float | None = None
    sure: float = 0.95
    mounting: bool = True
    results: str | None = None
    per_design: int = 10

    def report(self, out: o.Output, preset: str) -> o.Report:
        """Random drives of a preset."""
        with out.progress(preset):  # words before numpy is imported
            from hdassist.error.self_error import self_error
            from hdassist.errors import UntrustedError
            from hdassist.files import claim_output
            from hdassist.pages.tolerance import tolerance_report
            from hdassist.run.kept import KeptOwner, open_kept
            from hdassist.run.run import stream
            from hdassist.run.stops import at_stop, until_interrupted
            from hdassist.terminal.output import note
            from hdassist.tolerance.production import Production
            from hdassist.tolerance.yields import AtTorque, Summary, rooms

            count, results, drive = self.count, self.results, self.load(preset)
            law, torques = self.law(drive), drive.operation.M_g
            limits = [drive.limit(M_g) for M_g in torques]
            if (self.limit or self.wanted is not None) and not any(limits):
                require_limits(drive)
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
            interrupted = kept.done < count
        if not summary.count:
            if interrupted:
                raise KeyboardInterrupt
            raise UntrustedError(f"no random drive has an answer: {summary.reason}", "narrow what scatters")
        if interrupted:
            note(f"interrupted: {progress_words()}")
        return tolerance_report(law, self.seed, summary, samples, interrupted=interrupted)
