"""`hdassist stiffness`: twist against torque, lost motion, K1, K2, K3."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.preset.fields import Drive


@o.with_groups
def stiffness_command(
    preset: o.Preset,
    *,
    drives: o.DriveOptions,
    t1: Annotated[float | None, typer.Option("--t1", metavar="N*M", help="End of the first segment.")] = None,
    t2: Annotated[float | None, typer.Option("--t2", metavar="N*M", help="End of the second segment.")] = None,
    to: Annotated[float | None, typer.Option("--to", metavar="N*M", help="End of the curve, on both sides.")] = None,
    at: Annotated[
        list[float],
        typer.Option("--at", metavar="N*M", help="Torque of a tangent stiffness, else the preset's. Repeatable."),
    ] = [],  # noqa: B006 (typer copies it)
    cross_check: o.CrossCheckOption = "highs",
    plot: o.Plot = True,
    details: o.Details = False,
    options: o.FigureOptions,
) -> None:
    """Torsional stiffness: twist against torque in both directions, lost motion, K1, K2, K3.

    \b
    Examples:
      hdassist stiffness vzp160
      hdassist stiffness my-drive.yaml --t1 29 --t2 108 --to 250
      hdassist stiffness my-drive.yaml --at 20 --at 60
      hdassist stiffness my-drive.yaml --csv curve.csv -q

    Mesh, rings and balls of the contact model in series with the shell as a tube, without deviations and without
    friction. The segments end at T_1 and T_2 of the preset's catalogue, else where catalogues end them, by the cube of
    the pitch diameter, unless --t1 and --t2 say otherwise. K1, K2, K3 are chords, beside those of the
    preset's catalogue; the tangent stiffness is the slope at one torque, which counts for small moves about it. Without
    --at it is told at the torques of the preset that the curve reaches.
    """
    from hdassist.error.stiffness import curve_end, stiffness, stiffness_states
    from hdassist.pages.stiffness import stiffness_report
    from hdassist.run.run import Run
    from hdassist.solve.window import in_wide_enough_window
    from hdassist.terminal.runs import Answer, answer_of, give, run_each

    out = options.open()

    def one(name: str) -> Answer:
        return in_wide_enough_window(drives.load(name), of)

    def of(drive: Drive) -> Answer:
        end = curve_end(drive, t2, to)
        torques = at or [M_g for M_g in drive.operation.M_g if abs(M_g) <= end]
        with out.progress(drive.name, stiffness_states()) as progress:
            run = Run(progress=progress, cross_check=cross_check)
            result = stiffness(drive, T_1=t1, T_2=t2, T_max=to, tangents_at=torques, run=run)
        return answer_of(stiffness_report(drive, result), plots=plot, details=details)

    give("stiffness", run_each("stiffness", [preset], one, options, keep_failures=False), options, out)
