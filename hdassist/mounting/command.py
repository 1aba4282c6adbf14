"""`hdassist mount`: the position in which to mount the fixed wheel."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Annotated

import typer

from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.preset.fields import Drive


WITHOUT_TRIALS = ("--step", "--every-state", "--samples", "--cross-check")


def command(
    context: typer.Context,
    preset: o.Preset,
    torque: o.Torques = [],  # noqa: B006 (typer copies it)
    step: Annotated[
        float | None,
        typer.Option(metavar="DEG", help="Step of the curve, a divisor of 360; without it the holes alone."),
    ] = None,
    weights: Annotated[
        str | None, typer.Option(metavar="W,W", help="Weights of the torques in the choice, in their order.")
    ] = None,
    criterion: Annotated[
        str, typer.Option(metavar="NAME", help="Under uncertainty: expected, worst, or quantile:0.9.")
    ] = "expected",
    samples: Annotated[int, typer.Option(min=0, help="Samples of what is uncertain (0: none).")] = 200,
    trial: Annotated[
        list[str],
        typer.Option(
            metavar="WHERE:F_IOR",
            help="F'_ior measured with the wheel turned: 120:17.3 (deg) or h4:17.3; or a trace's file, h4:run.csv. "
            "Repeatable.",
        ),
    ] = [],  # noqa: B006 (typer copies it)
    trial_torque: Annotated[
        float | None, typer.Option(metavar="N*M", help="Torque of the trials; the lightest of the torques without it.")
    ] = None,
    noise: Annotated[
        float | None,
        typer.Option(
            metavar="ARCSEC", help="Standard deviation of a trial's F'_ior, or of slow errors of its trace (1)."
        ),
    ] = None,
    reverse_error: Annotated[
        bool, typer.Option("--reverse-error", help="Traces of trials have the other sign of the error.")
    ] = False,
    reseat: Annotated[
        float | None,
        typer.Option(metavar="UM", help="Standard deviation of the wheel's centre each time it is mounted (0)."),
    ] = None,
    verify: Annotated[
        str | None, typer.Option(metavar="WHERE:F_IOR", help="Outcome to compare with what the trials predict.")
    ] = None,
    every_state: Annotated[
        bool, typer.Option("--every-state", help="Solve every state at every position instead of searching.")
    ] = False,
    jobs: o.Jobs = 0,
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
    card: o.Card = None,
    lang: o.Lang = None,
    serial: o.Serial = None,
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
    """Where to mount the fixed wheel: the hole of its seat with the least error F'_ior.

    \b
    Examples:
      hdassist mount vzp160
      hdassist mount vzp160 --step 10 --csv curve.csv
      hdassist mount my-drive.yaml --set uncertainty.phases.xi_b=10 --set uncertainty.tolerances.e_hb=15
      hdassist mount my-drive.yaml --set mounting.holes=0 --torque 80 -q
      hdassist mount vzp160 --trial h0:28.1 --trial h4:17.3 --trial h8:24.9
      hdassist mount my-drive.yaml --pitch-b wheel.csv --mark-b 120
      hdassist mount my-drive.yaml --card card.html --lang ru --serial 17-042

    Turns are counter-clockwise seen from the cam side, from where the wheel stands. The best position is that in
    which the torque served worst gains most, among the holes that mounting.allowed leaves; mounting.holes: 0 means a
    free angle. What the preset gives an uncertainty (k = 2) for is sampled. Where the wheel stands and at the
    advised position every state is solved and proven, elsewhere the extremes are searched for. -q prints the hole
    (or the angle) alone, 0 for "leave it".

    Where the direction of the cam offset is not known, mount the wheel in a few positions (three, 120 deg apart, at a
    light torque), measure F'_ior in each and give them as --trial: the offset is inferred, with all that is uncertain,
    and the best position with it. Repeat a position to learn the noise of a value. Where the trials do not settle it
    the exit code is 6, and the position to measure next is named. --verify compares the outcome with its prediction and
    says keep, or go back (exit code 3). -q prints the hole to be in, 0 being the first one.

    In place of F'_ior a trial may have a trace over one cam turn or more (two are better): h4:run.csv, with the cam's
    angle from its index, counter-clockwise seen from the cam side, and the error F_kpp = cam/u - output, as hdassist
    trace writes it, or both encoders. Growing angles are taken if it has them. It carries phase: one or two may do.

    --pitch-b and --pitch-g put measured teeth in place of the first harmonics, tooth by tooth from the mark. Every
    state is solved then; alternatives and what a micrometre does are left out.

    Ctrl-C ends the work early and prints what is done (exit code 130).
    """
    from hdassist.errors import UsageError
    from hdassist.mounting import page as report
    from hdassist.mounting.advice import advise, work
    from hdassist.mounting.card_command import CardFile
    from hdassist.preset.library import load_preset
    from hdassist.terminal.answers import json_text
    from hdassist.terminal.output import Output, note, warn
    from hdassist.terminal.wheels import PitchFiles
    from hdassist.terminal.workers import workers

    out = Output.open(output, csv, force=force, ascii=ascii, no_color=no_color)
    page = CardFile.open(card, lang, serial, out=out, ascii=ascii, instead=not (json or quiet))
    pitch = PitchFiles.asked(
        [preset], o.PitchOptions(pitch_b, pitch_g, mark_b, mark_g, pitch_form, pitch_sense, pitch_flank)
    )
    drive = load_preset(preset, [*overrides, *o.torque_overrides(torque)])
    measured = pitch.read(drive)
    torques, rotations, shares = drive.operation.M_g, _rotations(drive, step), _weights(weights)
    begun = time.monotonic()
    if trial or verify is not None:
        from hdassist.trials.command import with_trials

        if given := [option for option in WITHOUT_TRIALS if _given(context, option)]:
            raise UsageError(f"{' and '.join(given)}: no meaning with trials", "leave it out, or the trials")
        if measured:
            raise UsageError(
                "trials cannot be combined with measured teeth: they need searches, and measured teeth every state",
                "leave out --pitch-b and --pitch-g, or the trials",
            )
        rig = (trial_torque, noise, reseat)
        code = with_trials(
            out, page, drive, trial, verify, rig,
            reverse=reverse_error, weights=shares, criterion=criterion, seed=seed, jobs=jobs, json=json, quiet=quiet,
            verbose=verbose,
        )  # fmt: skip
        raise typer.Exit(code)
    if reverse_error or any(option is not None for option in (trial_torque, noise, reseat)):
        raise UsageError(
            "--trial-torque, --noise, --reverse-error and --reseat are those of trials", "--trial h4:17.3 gives one"
        )
    total = work(drive, torques, rotations, every_state=every_state, samples=samples, measured=measured)
    with out.progress(drive.name, total) as progress, workers(jobs) as executor:
        advice = advise(
            drive,
            torques,
            rotations,
            measured=measured,
            every_state=every_state,
            weights=shares,
            samples=samples,
            criterion=criterion,
            cross_check=cross_check,
            seed=seed,
            executor=executor,
            progress=progress,
        )
    for text in report.warnings(advice):
        warn(text)
    if verbose:
        note(f"{drive.name}: {time.monotonic() - begun:.1f} s, {advice.curve.certificate}")
    if json:
        out.text(json_text(report.answer(advice, seed)))
    elif not (page and page.replaces(out)):
        out.human(report.brief(advice) if quiet else report.render(advice, out.style, plots=plot))
    out.figures(report.csv(advice))
    if page:
        page.write(advice)
    raise typer.Exit(report.exit_code(advice))


def _given(context: typer.Context, option: str) -> bool:
    """Whether an option stands on the command line."""
    source = context.get_parameter_source(option.removeprefix("--").replace("-", "_"))
    return source is not None and source.name == "COMMANDLINE"


def _rotations(drive: Drive, step: float | None) -> list[float]:
    from hdassist.errors import UsageError
    from hdassist.mounting.positions import seat_positions

    positions = seat_positions(drive)
    if step is None:
        return positions
    count = round(360 / step) if 0 < step <= 360 else 0
    if not count or abs(count * step - 360) > 1e-6:
        raise UsageError(f"--step must divide 360 degrees, not {step:g}", "30 is the step of 12 seat holes")
    grid = [360 * k / count for k in range(count)]
    if not drive.mounting.holes:
        return grid
    return sorted({round(angle, 9) for angle in (*positions, *grid)})


def _weights(text: str | None) -> list[float] | None:
    from hdassist.errors import UsageError

    if text is None:
        return None
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        raise UsageError(f"--weights must be numbers with commas between, not {text!r}", "like --weights 2,1") from None
