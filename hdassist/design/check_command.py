"""`hdassist check`: the design check of drives."""

from __future__ import annotations

import time

import typer

from hdassist.terminal import options as o


def command(
    presets: o.Presets,
    torque: o.Torques = [],  # noqa: B006 (typer copies it)
    overrides: o.Overrides = [],  # noqa: B006 (typer copies it)
    pitch_b: o.PitchB = None,
    pitch_g: o.PitchG = None,
    mark_b: o.MarkB = None,
    mark_g: o.MarkG = None,
    pitch_form: o.PitchForm = None,
    pitch_sense: o.PitchSense = None,
    pitch_flank: o.PitchFlank = None,
    json: o.Json = False,
    csv: o.Csv = None,
    output: o.Target = "-",
    force: o.Force = False,
    solver: o.Solver = None,
    cross_check: o.CrossCheck = "clarabel",
    seed: o.Seed = 0,
    jobs: o.Jobs = 0,
    plot: o.Plot = True,
    ascii: o.Ascii = False,
    no_color: o.NoColor = False,
    quiet: o.Quiet = False,
    verbose: o.Verbose = False,
    debug: o.Debug = False,
) -> None:
    """Largest kinematic error F'_ior of drives over the full cycle, with verdict and proof.

    \b
    Examples:
      hdassist check vzp160
      hdassist check my-drive.yaml --set tolerances.F_i2=60 --json
      hdassist check vzp160 --torque 40 --torque 80
      hdassist check my-drive.yaml --pitch-b wheel.csv --pitch-g flexspline.csv
      hdassist check *.yaml --csv figures.csv -q

    Every state of the cycle is solved and proven; the verdict holds F'_ior with the self error against
    the preset's acceptance limits. Exit codes: 0 PASS or no limit, 3 FAIL, 4 bad preset, 5 no trustworthy
    answer.
    """
    from hdassist.design import check_page as report
    from hdassist.design.check import Check, check, work
    from hdassist.errors import HdassistError
    from hdassist.preset.library import load_preset
    from hdassist.terminal.answers import combine, failure, to_json
    from hdassist.terminal.output import Output, complain, note, warn
    from hdassist.terminal.wheels import PitchFiles
    from hdassist.terminal.workers import workers
    from hdassist.verdict import worst_exit_code

    out = Output.open(output, csv, force=force, ascii=ascii, no_color=no_color)
    pitch = PitchFiles.asked(
        presets, b=(pitch_b, mark_b), g=(pitch_g, mark_g), form=pitch_form, sense=pitch_sense, flank=pitch_flank
    )
    done: list[Check] = []
    answers = []
    pages = []
    for name in presets:
        begun = time.monotonic()
        try:
            drive = load_preset(name, [*overrides, *o.torque_overrides(torque)])
            measured = pitch.read(drive)
            with out.progress(drive.name, work(drive, measured)) as progress, workers(jobs) as executor:
                result = check(
                    drive,
                    measured=measured,
                    solver=solver,
                    cross_check=cross_check,
                    seed=seed,
                    executor=None if solver else executor,  # a slow solver shows its progress
                    progress=progress,
                )
        except HdassistError as error:
            if debug or (len(presets) == 1 and not json):
                raise
            complain(error, "" if name in error.message else name)
            answers.append(failure("check", name, error))
            continue
        done.append(result)
        answers.append(report.answer(result, seed))
        pages.append(report.brief(result) if quiet else report.render(result, out.style, plots=plot))
        for text in result.warnings:
            warn(f"{drive.name}: {text}")
        if verbose:
            note(f"{drive.name}: {time.monotonic() - begun:.1f} s, {result.certificate}")
    if json:
        out.text(to_json(combine("check", answers)))
    elif pages:
        from rich.console import Group

        out.human(Group(*pages))
    if done:
        out.figures(report.csv(done))
    raise typer.Exit(worst_exit_code(answer["exit_code"] for answer in answers))
