"""`hdassist sensitivity`: which tolerance, stiffness or clearance F'_ior hangs on."""

from __future__ import annotations

from typing import Annotated

import typer

from hdassist.terminal import options as o
from hdassist.tolerance.draw_options import DrawOptions

MOST = 65536
MORE = 4  # times the drives make the ranges half as wide


@o.with_groups
def command(
    preset: o.Preset,
    *,
    count: Annotated[
        int, typer.Option("-n", min=16, max=MOST, help="Drives in the base of the design: a power of two is best.")
    ] = 256,
    drives: DrawOptions,
    work: o.WorkOptions,
    options: o.FigureOptions,
) -> None:
    """What F'_ior hangs on, by slopes and by shares of its scatter, and which tolerance to tighten first.

    \b
    Examples:
      hdassist sensitivity vzp160
      hdassist sensitivity vzp160 --torque 80 -n 1024 --json
      hdassist sensitivity own.yaml --distribution uniform --csv figures.csv

    Over random drives as built (as hdassist tolerance draws them): the share of the variance of F'_ior that comes from
    a deviation alone, and together with others (Sobol indices with 95 % confidence), and what 95 % of the drives stay
    below were its tolerance a fifth tighter. About the preset's values: arcsec for a unit more of each field. Exit
    codes: 0 done, 2 wrong usage, 4 bad preset, 5 no trustworthy answer, 130 stopped.
    """
    import numpy as np

    from hdassist.error.slopes import slopes
    from hdassist.errors import UntrustedError
    from hdassist.terminal.runs import give
    from hdassist.tolerance.indices import Design, indices, of_bases, tightened
    from hdassist.tolerance.production import Production
    from hdassist.tolerance.sensitivity_page import Sensitivities, answer
    from hdassist.tolerance.stream import stream

    out = options.open()
    drive = drives.load(preset)
    design = Design.of(drive, drives.draws(drive), count)
    torques = drive.operation.M_g
    production = Production.of(drive, design, torques, mounting=False)
    with work.pools() as pool:
        with pool() as (executor, _), out.progress("table of the error", production.table_states) as progress:
            production = production.tabled(executor=executor, progress=progress)
            steepest, here, proof = slopes(drive, torques, executor=executor)
        records = []
        with out.progress(drive.name, design.total) as progress:
            for some in stream(production.records, design.total, pool=pool):
                records += some
                progress(len(some))
    for record in records:
        if record.refused is not None:
            raise UntrustedError(f"a random drive has no answer: {record.refused}", "narrow what scatters")
    F_ior = np.array([record.F_ior_arcsec for record in records])
    drawn = of_bases(design, [record.values for record in records])
    found = Sensitivities(
        drive, here, steepest, design,
        indices(design, F_ior), tightened(design, F_ior[: 2 * count], drawn),
        proof, sum(record.states for record in records), max(record.max_residual for record in records),
        ["-n", str(count * MORE), *drives.words] if count * MORE <= MOST else None,
    )  # fmt: skip
    raise typer.Exit(give("sensitivity", [answer(found)], options, out))
