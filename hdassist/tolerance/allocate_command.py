"""`hdassist allocate`: the cheapest tolerances that reach a yield."""

from __future__ import annotations

from itertools import chain
from typing import Annotated

import typer

from hdassist.terminal import options as o
from hdassist.tolerance.draw_options import DrawOptions


@o.with_groups
def command(
    preset: o.Preset,
    *,
    drives: DrawOptions,
    wanted: Annotated[
        float, typer.Option("--yield", min=0.01, max=0.999, help="Share of drives that is to pass.")
    ] = 0.95,
    count: Annotated[
        int, typer.Option("-n", min=20, max=100_000, help="Random drives that prove the tolerances.")
    ] = 200,
    mounting: Annotated[
        bool, typer.Option("--mounting/--as-built", help="Also with each wheel turned to its best hole.")
    ] = True,
    classes: Annotated[bool, typer.Option("--classes", help="Also with teeth of whole ISO 1328-1 classes.")] = False,
    work: o.WorkOptions,
    options: o.FigureOptions,
) -> None:
    """The cheapest tolerances with which enough drives pass, as built and with each fixed wheel in its best hole.

    \b
    Examples:
      hdassist allocate vzp160 --torque 80 --limit 20
      hdassist allocate vzp160 --limit 80:20 --limit 800:6 --yield 0.99 --classes
      hdassist allocate own.yaml --limit 30 --set cost.tolerances.e_hb.share=3

    What a tolerance costs stands in the preset: cost: {tolerances.e_hb: {share: 3, k: 1.5, least: 10}} costs 3 as the
    preset has it and 3 (now/tolerance)^1.5 else, and no less than 10 um can be made; without it 1, k = 1 and a tenth.
    Tolerances may grow to twice what they are. Exit codes: 0 done, 3 no tolerances reach the yield, 2 wrong usage,
    4 bad preset, 5 no trustworthy answer, 130 stopped.
    """
    from hdassist.error.self_error import self_error
    from hdassist.errors import UsageError
    from hdassist.terminal.runs import give
    from hdassist.tolerance.allocate_page import Allocated, answer
    from hdassist.tolerance.allocation import Allocator, loosest
    from hdassist.tolerance.draw_options import require_limits
    from hdassist.tolerance.production import Production, RandomDrive
    from hdassist.tolerance.stream import stream
    from hdassist.tolerance.summary import rooms

    out = options.open()
    drive = drives.load(preset)
    draws, torques, limits = drives.draws(drive), drive.operation.M_g, require_limits(drive)
    own = [found.range_arcsec for found in self_error(drive, torques)]
    room = rooms(limits, own)
    if room is None:
        worst = max(range(len(own)), key=lambda t: own[t] - limits[t])
        raise UsageError(
            f"the self error alone is {own[worst]:.1f} arcsec at {torques[worst]:g} N*m, the limit {limits[worst]:g}",
            "no tolerance changes that: a limit above it, or another wave or clearance",
        )
    with work.pools() as pool, pool() as (executor, _):

        def records(production: Production, drives: int) -> list[RandomDrive]:
            with out.progress(drive.name, drives) as progress:
                found = []
                for some in stream(production.records, drives, pool=pool):
                    found.append(some)
                    progress(len(some))
            return list(chain.from_iterable(found))

        production = Production.of(drive, loosest(drive, draws), torques, mounting=mounting, limits=room)
        with out.progress("table of the error", production.table_states) as progress:
            production = production.tabled(executor=executor, progress=progress)
        allocator = Allocator(production.drawing(draws), room, wanted, records, count, executor)
        if not allocator.choices:
            raise UsageError(
                "no tolerance to choose: none that the preset gives is drawn", "set tolerances.F_i2 above 0"
            )
        ways = []
        for turned in (False, True) if mounting else (False,):
            ways.append(allocator.cheapest(turned))
            if classes and ways[-1].fits:
                ways.append(allocator.in_classes(ways[-1]))
    found = Allocated(drive, draws, wanted, limits, own, allocator.choices, ways)
    raise typer.Exit(give("allocate", [answer(found)], options, out))
