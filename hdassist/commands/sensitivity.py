"""`hdassist sensitivity`: which tolerance to tighten first, or what to measure before."""

from __future__ import annotations

from typing import Annotated

import typer

from hdassist.commands.draw_options import DrawOptions
from hdassist.run.run import Run
from hdassist.terminal import options as o


@o.with_groups
def sensitivity_command(
    preset: o.Preset,
    *,
    count: Annotated[int, typer.Option("-n", min=16, max=65536, help="Random drives, each of another design.")] = 96,
    drives: DrawOptions,
    work: o.WorkOptions,
    details: o.Details = False,
    options: o.FigureOptions,
) -> None:
    """Which tolerance to tighten first, and how much a step takes off F'_ior; or what to measure before.

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
    from dataclasses import replace

    from hdassist.pages.sensitivity import sensitivity_report
    from hdassist.terminal.runs import answer_of, give
    from hdassist.tolerance.production import Production, RandomDrive
    from hdassist.tolerance.sensitivity import sensitivities
    from hdassist.tolerance.stream import collected

    out = options.open()
    drive = drives.load(preset)
    law = drives.law(drive)
    each_its_own = replace(law, shared=law.shared + law.own, own=())
    production = Production.of(
        each_its_own, drive.operation.M_g, mounting=False, seed=drives.seed, per_design=1, steps=True
    )
    with work.pools() as pool:
        with pool() as (executor, _), out.progress("designs", production.design_states(count)) as progress:
            production, samples = production.with_designs(count, run=Run(executor, progress))
        assert samples

        def records(production: Production, count: int) -> list[RandomDrive]:
            with out.progress(drive.name, count) as progress:
                return collected(production.records, count, pool, progress)

        found = sensitivities(production, samples, records)
    answer = answer_of(sensitivity_report(replace(found, law=law)), details=details)
    raise typer.Exit(give("sensitivity", [answer], options, out))
