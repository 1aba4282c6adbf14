"""`hdassist check`: the design check of drives."""

from __future__ import annotations

from functools import partial

import typer

from hdassist.terminal import options as o


@o.with_groups
def check_command(
    presets: o.Presets,
    *,
    drives: o.LoadedDriveOptions,
    solver: o.Solver = None,
    cross_check: o.CrossCheckOption = "highs",
    draws: o.DrawsOption = 64,
    sure: o.VerdictProbability = 0.95,
    seed: o.SeedOption = 0,
    jobs: o.Jobs = 0,
    plot: o.Plot = True,
    pitch: o.PitchOptions,
    details: o.Details = False,
    options: o.FigureOptions,
) -> None:
    """Largest kinematic error F'_ior of drives over the full cycle, with verdict and proof.

    \b
    Examples:
      hdassist check vzp160
      hdassist check my-drive.yaml --set tolerances.F_i2=60 --json
      hdassist check vzp160 --torque 40 --torque 80
      hdassist check my-drive.yaml --pitch-b wheel.csv --pitch-g flexspline.csv
      hdassist check *.yaml --csv figures.csv -q

    Every state of the cycle is solved and proven; the verdict holds F'_ior with the self error against the preset's
    acceptance limits. Whatever the preset does not give exactly is drawn jointly (deviations that are left out, values
    with a ±, values assumed with a range), weighted by the preset's catalogue, and solved (--draws effective samples
    at least). PASS where the probability of keeping the limit is at least --sure, FAIL where it is at most 1 less that,
    else INCONCLUSIVE; the error of sampling counts. Exit codes: 0 PASS or no limit, 3 FAIL, 4 bad preset, 5 no
    trustworthy answer (also: a catalogue that contradicts the other values), 6 INCONCLUSIVE.
    """
    from hdassist.terminal.runs import Answer, answer_of, give, run_each
    from hdassist.terminal.wheels import PitchFiles

    out = options.open()
    files = PitchFiles.asked(presets, pitch)

    def one(name: str) -> Answer:
        with out.progress(name) as progress:
            drive = drives.load(name)
            measured = files.read(drive)
            torques = ", ".join(f"{M_g:g}" for M_g in drive.operation.M_g)
            progress.expect(words := f"{drive.name}, {drive.gears.z_g}/{drive.gears.z_b}, {torques} N·m")
            from hdassist.design.check import check, check_states
            from hdassist.pages.check import check_report
            from hdassist.run.processes import workers
            from hdassist.run.run import Run
            from hdassist.solve.window import in_wide_enough_window

            progress.expect(words, check_states(drive, measured, draws))
            with workers(jobs) as executor:
                analysis = partial(
                    check,
                    measured=measured,
                    solver=solver,
                    draws=draws,
                    sure=sure,
                    run=Run(
                        None if solver else executor, progress, seed, cross_check
                    ),  # a slow solver shows how far it is
                )
                result = in_wide_enough_window(drive, analysis)
        return answer_of(check_report(result, seed), plots=plot, details=details)

    raise typer.Exit(give("check", run_each("check", presets, one, options), options, out))
