"""`hdassist calibrate`: values of a preset found from targets."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hdassist.run.run import Run
from hdassist.terminal import options as o


@o.with_groups
def calibrate_command(
    preset: o.Preset,
    *,
    targets: Annotated[Path, typer.Option("--targets", metavar="FILE", help="What to find, and what is known (YAML).")],
    write: Annotated[
        str | None, typer.Option("--write", metavar="FILE", help="Write the preset with the values found to FILE.")
    ] = None,
    state: Annotated[
        Path | None, typer.Option("--state", metavar="FILE", help="Remember what was computed; go on from there.")
    ] = None,
    evaluations: Annotated[
        int, typer.Option(min=8, max=100_000, help="Drives that least squares is started from the best of.")
    ] = 128,
    jobs: o.Jobs = 0,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Seed of these drives.")] = 0,
    drives: o.DriveOptions,
    details: o.Details = False,
    options: o.AnswerOptions,
) -> None:
    """Find stiffnesses, clearances or any other measures of a preset from what is known of the drive.

    \b
    Examples:
      hdassist calibrate own.yaml --targets rig.yaml --write found.yaml
      hdassist calibrate own.yaml --targets rig.yaml --state rig.jsonl

    \b
    A targets file:
      schema: hdassist.targets/1
      name: acceptance rig, drive 17
      unknowns:
        gears.j_n: {low: 0, high: 20}
        supports.C_2: {scale: log}     # within its range in the preset's source
      targets:
        - {quantity: F_ior, M_g: 80, phase: 180, value: 20.1, tolerance: 0.5}
        - {quantity: K_1, value: 50e4, tolerance: 10 %}
        - {quantity: self_error, M_g: 80, low: 0.25, high: 2.0}

    Quantities: F_ior, F_ior_max and F_ior_min (over the mounting phase), revolution_range, self_error, K_1, K_2,
    K_3 and lost_motion (as hdassist stiffness has them), torsional_stiffness, trace. Drives spread evenly over the
    bounds, then least squares from the best ones that lie apart; every set that meets the targets is kept, and where
    none does, targets and bounds in the way are named. Ctrl-C keeps the --state file, from which the same command
    goes on. Exit code 5: the fit did not come to rest.
    """
    from hdassist.calibration.calibrate import calibrate, estimate_drives
    from hdassist.calibration.evaluations import Evaluations, evaluations_kind, evaluations_owner
    from hdassist.calibration.targets import read_targets
    from hdassist.errors import UsageError
    from hdassist.loading.write import with_found_values
    from hdassist.pages.calibrate import calibrate_report
    from hdassist.preset.fields import IDENTIFIED_WITH
    from hdassist.preset.library import READ_AT_MOST, read_preset
    from hdassist.run.kept import open_kept
    from hdassist.run.processes import workers
    from hdassist.run.stops import at_stop
    from hdassist.terminal.files import take_output, write_text
    from hdassist.terminal.output import note
    from hdassist.terminal.runs import Answer, answer_of, give, run_each
    from hdassist.textfile import read_bytes

    o.stdin_once(preset, str(targets))
    out, changed = options.open(), ""
    if write is not None:
        take_output(write, options.force)
        if preset == "-" or drives.overrides:
            raise UsageError("--write changes the preset as it stands in its file: no stdin, no --set with it")

    def one(name: str) -> Answer:
        nonlocal changed
        drive = drives.load(name)
        text, _ = read_bytes(targets, READ_AT_MOST)
        wanted = read_targets(text, str(targets), drive)
        given = read_preset(name)[0].decode("utf-8-sig") if write is not None else ""
        if write is not None:  # a text that cannot be changed is better known before than after
            with_found_values(given, name, {u.path: u.start for u in wanted.unknowns}, "")
        if state is not None:
            take_output(str(state), force=True, is_kept=True)
        words = f"{state} keeps what was computed: the same command goes on from there" if state is not None else ""
        file, owner = None if state is None else str(state), evaluations_owner(drive, wanted)
        with (
            open_kept(file, owner, evaluations_kind(wanted)) as kept,
            at_stop(lambda: words),
            out.progress(drive.name, estimate_drives(wanted, evaluations)) as progress,
            workers(jobs) as executor,
        ):
            known = Evaluations(drive, wanted, Run(executor, progress, seed), kept)
            if known.remembered:
                note(f"going on from {state}: {known.remembered} drives are known")
            result = calibrate(drive, wanted, known, points=evaluations)
        if write is not None:
            best, *others = (wanted.by_path(fit.values) for fit in result.fits)
            ref = f"hdassist calibrate, {wanted.name or targets.name}"
            model = {field: drive.value(f"numerics.{field}") for field in IDENTIFIED_WITH}
            changed = with_found_values(given, name, best, ref, others, model)
        return answer_of(calibrate_report(result), details=details)

    give("calibrate", run_each("calibrate", [preset], one, options, keep_failures=False), options, out)
    if write is not None:
        write_text(write, changed, options.force)
