"""`hdassist tolerance`: random drives inside their tolerances."""

from __future__ import annotations

from contextlib import closing
from itertools import islice
from typing import Annotated

import typer

from hdassist.terminal import options as o
from hdassist.tolerance.draw_options import DrawOptions

Results = Annotated[
    str | None,
    typer.Option("--results", metavar="FILE", help="Keep a record of every drive; the same command goes on with it."),
]


@o.with_groups
def command(
    preset: o.Preset,
    *,
    count: Annotated[int, typer.Option("-n", min=1, max=100_000_000, help="Random drives.")] = 1000,
    drives: DrawOptions,
    wanted: Annotated[
        float | None, typer.Option("--yield", min=0, max=1, help="Share of drives that is to pass: 0.95.")
    ] = None,
    mounting: Annotated[bool, typer.Option("--mounting/--as-built", help="Turn each wheel to its best hole.")] = True,
    results: Results = None,
    work: o.WorkOptions,
    plot: o.Plot = True,
    options: o.FigureOptions,
) -> None:
    """Yield of random drives inside their tolerances, as built and with each fixed wheel in its best hole.

    \b
    Examples:
      hdassist tolerance vzp160
      hdassist tolerance vzp160 -n 10000 --limit 80:30 --yield 0.95 --json
      hdassist tolerance vzp160 --set tolerances.e_hb=40 --distribution uniform
      hdassist tolerance own.yaml --scatter tolerances.F_i2=measured.csv
      hdassist tolerance vzp160 --known phases.phi_hh
      hdassist tolerance vzp160 -n 100000 --results drives.jsonl

    Sizes of deviations lie between zero and the preset's tolerance, directions are any. A value with an uncertainty
    (±) is drawn around it, be it a stiffness, a clearance or a measured size. With --results FILE every drive is kept
    with what was drawn, and the same command goes on where a stopped one has ended. Exit codes: 0 done or the yield is
    reached, 3 it is not, 6 more drives are needed to tell, 4 bad preset, 5 no trustworthy answer, 130 stopped.
    """
    from hdassist.error.self_error import self_error
    from hdassist.run.kept import Owner, open_kept
    from hdassist.run.stops import at_stop, until_interrupted
    from hdassist.runfiles import claim_output
    from hdassist.terminal.output import note
    from hdassist.terminal.runs import give
    from hdassist.tolerance.draw_options import require_limits
    from hdassist.tolerance.production import Production
    from hdassist.tolerance.stream import stream
    from hdassist.tolerance.summary import Summary, rooms
    from hdassist.tolerance.tolerance_page import answer

    out = options.open()
    drive = drives.load(preset)
    draws, torques = drives.draws(drive), drive.operation.M_g
    if drives.limit or wanted is not None:
        require_limits(drive)
    limits = [drive.limit(M_g) for M_g in torques]
    own = [found.range_arcsec for found in self_error(drive, torques)]
    production = Production.of(drive, draws, torques, mounting=mounting, limits=rooms(limits, own))
    summary = Summary.of(torques, limits, own, positions=len(production.rotations), wanted=wanted)
    owner = Owner(
        command="tolerance", preset=drive.name, inputs={"preset": drive.origin.sha256}, options=production.told(),
        seed=draws.seed,
    )  # fmt: skip
    if results is not None:
        claim_output(results, is_kept=True)

    def known() -> str:
        where = f"are kept in {results}: the same command goes on"
        return f"{kept.done} of {count} drives {where if results else 'are done, none is kept: --results FILE'}"

    with work.pools() as pool, open_kept(results, owner, production.kind, force=options.force) as kept:
        summary.add(islice(kept.records(), count))
        if kept.done < count:
            with pool() as (executor, _), out.progress("table of the error", production.table_states) as progress:
                production = production.tabled(executor=executor, progress=progress)
        with (
            out.progress(drive.name, count - kept.done) as progress,
            closing(stream(production.records, count, done=kept.done, pool=pool)) as chunks,
            at_stop(known),
        ):
            for records in until_interrupted(chunks):
                kept.append(records)
                summary.add(records)
                progress(len(records))
        interrupted = kept.done < count
    if interrupted:
        note(f"interrupted: {known()}")
    told = answer(drive, draws, summary, plots=plot, interrupted=interrupted)
    raise typer.Exit(give("tolerance", [told], options, out))
