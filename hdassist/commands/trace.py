"""`hdassist trace`: the error against the cam angle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.model.wheels import MeasuredTeeth
    from hdassist.preset.fields import Drive


@o.with_groups
def trace_command(
    preset: o.Preset,
    *,
    drives: o.DriveOptions,
    torque: Annotated[
        float | None, typer.Option("--torque", help="Torque M_g in N*m.", show_default="first of the preset")
    ] = None,
    start: Annotated[
        float, typer.Option("--phi-g0", metavar="DEG", help="Angle of the moving wheel at phi_h = 0.")
    ] = 0.0,
    revolutions: Annotated[int, typer.Option("--revolutions", "-n", min=1, help="Cam revolutions.")] = 1,
    solver: o.Solver = None,
    cross_check: o.CrossCheckOption = "highs",
    seed: o.SeedOption = 0,
    plot: o.Plot = True,
    pitch: o.PitchOptions,
    details: o.Details = False,
    options: o.FigureOptions,
) -> None:
    """Kinematic error F_kpp against the cam angle, with its orders and their causes.

    \b
    Examples:
      hdassist trace vzp160 --torque 80 --phi-g0 20
      hdassist trace vzp160 --torque 80 -n 100 --csv trace.csv
      hdassist trace my-drive.yaml --set phases.xi_b=260 --json

    One cam revolution has as many states as the fixed wheel has teeth. Orders that differ by the
    flexspline's slow turn come apart over the full cycle only (for 200/202 teeth: -n 100).
    """
    from hdassist.error.trace import trace
    from hdassist.model.kinematics import Kinematics
    from hdassist.pages.trace import trace_report
    from hdassist.run.run import Run
    from hdassist.solve.window import in_wide_enough_window
    from hdassist.terminal.runs import Answer, answer_of, give, run_each
    from hdassist.terminal.wheels import PitchFiles

    out = options.open()
    files = PitchFiles.asked([preset], pitch)

    def one(name: str) -> Answer:
        drive = drives.load(name, *o.torque_overrides(torque))
        measured = files.read(drive)
        return in_wide_enough_window(drive, lambda drive: of(drive, measured))

    def of(drive: Drive, measured: MeasuredTeeth | None) -> Answer:
        with out.progress(drive.name, revolutions * Kinematics.of(drive).teeth_fixed) as progress:
            result = trace(
                drive,
                drive.operation.M_g[0],
                measured=measured,
                start_deg=start,
                revolutions=revolutions,
                solver=solver,
                run=Run(None, progress, seed, cross_check),
            )
        return answer_of(trace_report(drive, result, seed), plots=plot, details=details)

    give("trace", run_each("trace", [preset], one, options, keep_failures=False), options, out)
