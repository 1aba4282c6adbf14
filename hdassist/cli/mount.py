"""`hdassist mount`: F'_ior against the mounting angle of the fixed wheel."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Annotated

import typer

from hdassist.cli import options as o

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from hdassist.analysis.mounting import MountingCurve
    from hdassist.analysis.sensitivity import Sensitivity
    from hdassist.preset.drive import Drive
    from hdassist.solve.answers import Progress


def command(
    preset: o.Preset,
    torque: o.Torques = [],  # noqa: B006 (typer copies it)
    step: Annotated[float, typer.Option(metavar="DEG", help="Step between positions; a divisor of 360.")] = 10.0,
    every_state: Annotated[
        bool, typer.Option("--every-state", help="Solve every state at every position instead of searching.")
    ] = False,
    jobs: Annotated[int, typer.Option(min=0, help="Processes at work (0: one for each core).")] = 0,
    overrides: o.Overrides = [],  # noqa: B006 (typer copies it)
    json: o.Json = False,
    csv: o.Csv = None,
    output: o.Target = "-",
    force: o.Force = False,
    cross_check: o.CrossCheck = "clarabel",
    seed: o.Seed = 0,
    plot: o.Plot = True,
    ascii: o.Ascii = False,
    no_color: o.NoColor = False,
    quiet: o.Quiet = False,
    verbose: o.Verbose = False,
    debug: o.Debug = False,  # noqa: ARG001 (main reads it)
) -> None:
    """Largest error F'_ior over the positions of the fixed wheel on its seat.

    \b
    Examples:
      hdassist mount vzp160 --step 30
      hdassist mount vzp160 --torque 80 --csv curve.csv
      hdassist mount my-drive.yaml --json

    The extremes of the full cycle are searched for at each position; where the wheel stands, and at the best
    and the worst positions, every state is solved and proven, and should the search have missed anything there,
    everywhere. The best position is that in which the torque served worst gains most. Ctrl-C ends the work early
    and prints what is done (exit code 130).
    """
    from hdassist.analysis.mounting import alternatives, mounting_curve, work
    from hdassist.cli.output import Output, note, warn
    from hdassist.cli.workers import workers
    from hdassist.preset.library import load_preset
    from hdassist.report import mount as report
    from hdassist.report.envelope import to_json

    out = Output.open(output, csv, force=force, ascii=ascii, no_color=no_color)
    drive = load_preset(preset, [*overrides, *o.torque_overrides(torque)])
    rotations = _rotations(step)
    begun = time.monotonic()
    with (
        out.progress(drive.name, work(drive, drive.operation.M_g, rotations, every_state=every_state)) as progress,
        workers(jobs) as executor,
    ):
        result = mounting_curve(
            drive,
            drive.operation.M_g,
            rotations,
            every_state=every_state,
            cross_check=cross_check,
            seed=seed,
            executor=executor,
            progress=progress,
        )
        slopes = _slopes(drive, result, executor, progress)
        others = [] if result.interrupted else alternatives(drive, result.torques, executor=executor, progress=progress)
    for text in report.warnings(drive, result, others):
        warn(text)
    if verbose:
        note(f"{drive.name}: {time.monotonic() - begun:.1f} s, {result.certificate}")
    if json:
        out.text(to_json(report.answer(drive, result, slopes, others, seed)))
    else:
        out.human(report.brief(result) if quiet else report.render(drive, result, slopes, out.look, plots=plot))
    out.figures(report.csv(result))
    raise typer.Exit(report.exit_code(result))


def _slopes(
    drive: Drive, result: MountingCurve, executor: Executor, progress: Progress
) -> dict[str, list[Sensitivity]]:
    """What a micrometre does where the wheel stands and where it should; empty if that cannot be had."""
    from hdassist.analysis.mounting import rotated
    from hdassist.analysis.sensitivity import sensitivities
    from hdassist.report.mount import BEST, NOW

    positions = {NOW: result.current, BEST: result.recommended}
    if result.interrupted:
        return {}
    if result.current == result.recommended:
        del positions[BEST]
    cases = [(rotated(drive, p.rotation_deg), M_g) for p in positions.values() for M_g in result.torques]
    try:
        found = [s for s in sensitivities(cases, executor=executor, progress=progress) if s is not None]
    except KeyboardInterrupt:
        return {}
    many = len(result.torques)
    return {name: found[k * many : (k + 1) * many] for k, name in enumerate(positions)} if found else {}


def _rotations(step: float) -> list[float]:
    from hdassist.errors import UsageError

    count = round(360 / step) if 0 < step <= 360 else 0
    if not count or abs(count * step - 360) > 1e-6:
        raise UsageError(f"--step must divide 360 degrees, not {step:g}", "30 is the step of 12 seat holes")
    return [360 * k / count for k in range(count)]
