"""`hdassist mount`: the position in which to mount the fixed wheel."""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from hdassist.commands.card import CardFile, ChoiceOptions, give_with_card
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.preset.fields import Drive


@o.with_groups
def mount_command(
    preset: o.Preset,
    *,
    drives: o.LoadedDriveOptions,
    step: Annotated[
        float | None,
        typer.Option(metavar="DEG", help="Step of the curve, a divisor of 360; without it the holes alone."),
    ] = None,
    choosing: ChoiceOptions,
    draws: Annotated[
        int, typer.Option(min=0, help="Effective samples of what is not known exactly, at least (0: none).")
    ] = 64,
    probability: Annotated[
        float, typer.Option(min=0, max=1, help="Probability of a gain for which a turn is ordered.")
    ] = 0.95,
    assume_phases: Annotated[
        bool, typer.Option("--assume-phases", help="Take what the preset does not give as 0; the card says so.")
    ] = False,
    every_state: Annotated[
        bool, typer.Option("--every-state", help="Solve every state at every position instead of searching.")
    ] = False,
    cross_check: o.CrossCheckOption = "highs",
    seed: o.SeedOption = 0,
    jobs: o.Jobs = 0,
    plot: o.Plot = True,
    pitch: o.PitchOptions,
    card: o.CardOptions,
    details: o.Details = False,
    options: o.FigureOptions,
    moved: Annotated[
        list[str],
        typer.Option("--trial", "--verify", "--trial-torque", "--noise", "--reseat", hidden=True),
    ] = [],  # noqa: B006 (typer copies it)
) -> None:
    """Where to mount the fixed wheel: the hole of its seat with the least error F'_ior.

    \b
    Examples:
      hdassist mount vzp160
      hdassist mount vzp160 --step 10 --csv curve.csv
      hdassist mount my-drive.yaml --set "phases.xi_b=260±10"
      hdassist mount my-drive.yaml --set mounting.holes=0 --torque 80 -q
      hdassist mount my-drive.yaml --pitch-b wheel.csv --mark-b 120
      hdassist mount my-drive.yaml --card card.html --lang ru --serial 17-042

    The fixed wheel is the rigid wheel (circular spline) or the flexspline. Turns are counter-clockwise seen from the
    side of the cam (wave generator), from where the wheel stands. The best position is that in which the torque served
    worst gains most, among the holes that mounting.allowed leaves; mounting.holes: 0 means a free angle. All that the
    preset does not know exactly is drawn jointly, as check draws it (docs/unknown.md): what is assumed with a range,
    has an uncertainty (k = 2), or is not given. A turn is ordered where it gains more than 1 % with the --probability;
    else there is no order, no card, and exit code 6, and the page says what to measure. --assume-phases takes
    deviations that are not known as 0, on your word. -q prints the hole (or the angle) alone, 0 for "leave it", unknown
    where nothing can be ordered.

    Where the direction of the cam offset is not known, hdassist trials finds it from measurements in a few positions.

    --pitch-b and --pitch-g put measured teeth in place of the first harmonics, tooth by tooth from the mark. Every
    state is solved then, and nothing is drawn.

    Ctrl-C ends the work early and prints what is done (exit code 130).
    """
    from hdassist.errors import UsageError
    from hdassist.model.unknown import with_zeros
    from hdassist.mounting.advice import advice_states, advise
    from hdassist.pages.mount import mount_card_facts, mount_report
    from hdassist.run.processes import workers
    from hdassist.run.run import Run
    from hdassist.solve.answers import EMPTY
    from hdassist.solve.window import in_wide_enough_window
    from hdassist.terminal.output import note
    from hdassist.terminal.runs import answer_of
    from hdassist.terminal.wheels import PitchFiles

    if moved:
        raise UsageError("trials have a command of their own", "like hdassist trials PRESET h0:28.1 h4:17.3")
    out = options.open()
    card_file = CardFile.open(card, options, out)
    files = PitchFiles.asked([preset], pitch)
    drive = drives.load(preset)
    drive = with_zeros(drive) if assume_phases else drive
    measured = files.read(drive)
    torques, rotations, weights = drive.operation.M_g, _rotations(drive, step), choosing.numbers()
    begun = time.monotonic()
    total = advice_states(drive, torques, rotations, every_state=every_state, draws=draws, measured=measured)
    with out.progress(drive.name, total) as progress, workers(jobs) as executor:
        analysis = partial(
            advise,
            torques=torques,
            rotations_deg=rotations,
            measured=measured,
            every_state=every_state,
            weights=weights,
            draws=draws,
            criterion=choosing.criterion,
            needed=probability,
            run=Run(executor, progress, seed, cross_check),
        )
        advice = in_wide_enough_window(drive, analysis)
    if options.verbose:
        proof = advice.curve.certificate + (advice.samples.certificate if advice.samples else EMPTY)
        note(f"{drive.name}: {time.monotonic() - begun:.1f} s, {proof}")
    facts = None if advice.curve.interrupted or advice.order == "none" else lambda say: mount_card_facts(advice, say)
    told = answer_of(mount_report(advice, seed, carded=card_file is not None), plots=plot, details=details)
    raise typer.Exit(give_with_card("mount", told, card_file, facts, options, out))


def _rotations(drive: Drive, step: float | None) -> list[float]:
    """Turns of the wheel to try [deg]: those of the seat, and a step between. Raises UsageError: not a part of 360."""
    from hdassist.errors import UsageError
    from hdassist.mounting.positions import LEAST_STEP, seat_positions

    positions = seat_positions(drive)
    if step is None:
        return positions
    if 0 < step < LEAST_STEP:
        raise UsageError(f"--step must be {LEAST_STEP:g} deg or more, not {step:g}", "5 shows the curve")
    count = round(360 / step) if 0 < step <= 360 else 0
    if not count or abs(count * step - 360) > 1e-6:
        raise UsageError(f"--step must divide 360 degrees, not {step:g}", "30 is the step of 12 seat holes")
    grid = [360 * k / count for k in range(count)]
    if not drive.mounting.holes:
        return grid
    return sorted({round(angle, 9) for angle in (*positions, *grid)})
