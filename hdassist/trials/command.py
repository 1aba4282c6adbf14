"""`hdassist trials`: the position of the fixed wheel from measurements in a few positions."""

from __future__ import annotations

import time
from functools import partial
from typing import Annotated

import typer

from hdassist.mounting.card_command import CardFile, ChoiceOptions, give_with_card
from hdassist.terminal import options as o


@o.with_groups
def command(
    preset: o.Preset,
    trials: Annotated[
        list[str],
        typer.Argument(
            metavar="WHERE:F_IOR",
            help="F'_ior measured with the wheel turned: h4:17.3 (hole) or 120:17.3 (deg); or a trace, h4:run.csv.",
        ),
    ],
    *,
    drives: o.LoadedDriveOptions,
    trial_torque: Annotated[
        float | None, typer.Option(metavar="N*M", help="Torque of the trials; the lightest of the torques without it.")
    ] = None,
    noise: Annotated[
        float,
        typer.Option(metavar="ARCSEC", help="Standard deviation of a trial's F'_ior, or of slow errors of its trace."),
    ] = 1.0,
    reverse_error: Annotated[
        bool, typer.Option("--reverse-error", help="Traces of trials have the other sign of the error.")
    ] = False,
    reseat: Annotated[
        float, typer.Option(metavar="UM", help="Standard deviation of the wheel's centre each time it is mounted.")
    ] = 0.0,
    verify: Annotated[
        str | None, typer.Option(metavar="WHERE:F_IOR", help="Outcome to compare with what the trials predict.")
    ] = None,
    choosing: ChoiceOptions,
    seed: Annotated[int, typer.Option(min=0, help="Seed of what is drawn.")] = 0,
    jobs: o.Jobs = 0,
    card: o.CardOptions,
    options: o.FigureOptions,
) -> None:
    """Where to mount the fixed wheel when the direction of the cam offset is not known: trials tell.

    \b
    Examples:
      hdassist trials vzp160 h0:28.1 h4:17.3 h8:24.9
      hdassist trials my-drive.yaml h0:run.csv h4:run4.csv --noise 0.5
      hdassist trials my-drive.yaml h0:28.1 h4:17.3 h8:24.9 --trial-torque 80 --card card.html
      hdassist trials my-drive.yaml h0:28.1 h4:17.3 h8:24.9 --verify h5:16.2

    Mount the fixed wheel (the rigid wheel, that is the circular spline, or the flexspline) in a few positions of its
    seat, three, 120 deg apart, at a light torque, measure F'_ior in each and give them all: the offset of the cam (wave
    generator) is inferred, with all that is uncertain, and the best position with it. Turns and holes count from where
    the wheel stood before the first trial, counter-clockwise seen from the cam side. Repeat a position to learn the
    noise of a value. Where the trials do not settle it the exit code is 6, and the position to measure next is named.
    --verify compares the outcome with its prediction and says keep, or go back (exit code 3). -q prints the hole to be
    in, 0 being the first one.

    In place of F'_ior a trial may have a trace over one cam turn or more (two are better): h4:run.csv, with the cam's
    angle from its index, counter-clockwise seen from the cam side, and the error F_kpp = cam/u - output, as hdassist
    trace writes it, or both encoders. Growing angles are taken if it has them. It carries phase: one or two may do.
    Measured teeth cannot be combined with trials: these need searches, and measured teeth every state.
    """
    from hdassist.errors import UsageError
    from hdassist.solve.window import in_wide_enough_window
    from hdassist.terminal.output import note
    from hdassist.terminal.workers import workers
    from hdassist.trials.advice import advise_from_trials, estimate_states
    from hdassist.trials.page import answer, card_facts
    from hdassist.trials.trial import Rig, read_trial

    out = options.open()
    card_file = CardFile.open(card, options, out)
    drive, weights = drives.load(preset), choosing.numbers()
    if verify is not None and card_file:
        raise UsageError("a card is for the mounting that --verify comes after", "leave --card or --verify out")
    measured = [read_trial(text, drive.mounting.holes, drive, reverse=reverse_error) for text in trials]
    traced = any(trial.trace for trial in measured)
    if reverse_error and not traced:
        raise UsageError("--reverse-error is for traces of trials", "h4:run.csv is one")
    outcome = None if verify is None else read_trial(verify, drive.mounting.holes)
    torques = drive.operation.M_g
    rig = Rig(min(torques, key=abs) if trial_torque is None else trial_torque, noise, reseat)
    begun = time.monotonic()
    total = estimate_states(drive, torques, rig, traced=traced)
    with out.progress(drive.name, total) as progress, workers(jobs) as executor:
        analysis = partial(
            advise_from_trials,
            torques=torques,
            trials=measured,
            rig=rig,
            outcome=outcome,
            criterion=choosing.criterion,
            weights=weights,
            seed=seed,
            executor=executor,
            progress=progress,
        )
        advice = in_wide_enough_window(drive, analysis)
    if options.verbose:
        note(f"{drive.name}: {time.monotonic() - begun:.1f} s, {advice.known.prior.certificate}")
    told = answer(advice, seed)
    raise typer.Exit(give_with_card("trials", told, card_file, lambda say: card_facts(advice, say), options, out))
