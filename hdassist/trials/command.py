"""The part of `hdassist mount` that takes measured trials."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hdassist.mounting.card_command import CardFile
    from hdassist.preset.fields import Drive
    from hdassist.terminal.output import Output

NOISE = 1.0  # arcsec, of a measured F'_ior where nothing is said


def with_trials(
    out: Output,
    page: CardFile | None,
    drive: Drive,
    trials: Sequence[str],
    verify: str | None,
    rig: tuple[float | None, float | None, float | None],
    *,
    reverse: bool,
    weights: Sequence[float] | None,
    criterion: str,
    seed: int,
    jobs: int,
    json: bool,
    quiet: bool,
    verbose: bool,
) -> int:
    """Advise from trials; returns the exit code.

    Arguments: out, where answers go; page, the card that is asked for; trials and verify as on the command line; rig:
    torque of the trials [N*m] (None: the lightest), noise [arcsec], error of the seat [um]; reverse the error of
    traces. Raises UsageError for what
    is no trial, and what the analysis raises.
    """
    from hdassist.errors import UsageError
    from hdassist.terminal.answers import json_text
    from hdassist.terminal.output import note, warn
    from hdassist.terminal.workers import workers
    from hdassist.trials import page as report
    from hdassist.trials.advice import advise_from_trials, work
    from hdassist.trials.trial import Rig, read_trial

    if not trials:
        raise UsageError("--verify needs the trials that the prediction rests on", "--trial 0:28.1 --trial h4:17.3")
    if verify is not None and page:
        raise UsageError("a card is for the mounting that --verify comes after", "leave --card or --verify out")
    measured = [read_trial(text, drive.mounting.holes, drive, reverse=reverse) for text in trials]
    traced = any(trial.trace for trial in measured)
    if reverse and not traced:
        raise UsageError("--reverse-error is for traces of trials", "--trial h4:run.csv gives one")
    outcome = None if verify is None else read_trial(verify, drive.mounting.holes)
    torque, noise, reseat = rig
    torques = drive.operation.M_g
    lightest = min(torques, key=abs)
    how = Rig(lightest if torque is None else torque, NOISE if noise is None else noise, reseat or 0.0)
    begun = time.monotonic()
    with out.progress(drive.name, work(drive, torques, how, traced=traced)) as progress, workers(jobs) as executor:
        advice = advise_from_trials(
            drive,
            torques,
            measured,
            how,
            outcome=outcome,
            criterion=criterion,
            weights=weights,
            seed=seed,
            executor=executor,
            progress=progress,
        )
    for text in report.warnings(advice):
        warn(text)
    if verbose:
        note(f"{drive.name}: {time.monotonic() - begun:.1f} s, {advice.known.prior.certificate}")
    if json:
        out.text(json_text(report.answer(advice, seed)))
    elif not (page and page.replaces(out)):
        out.human(report.brief(advice) if quiet else report.render(advice, out.style))
    out.figures(report.csv(advice))
    if page:
        page.write(advice.as_advice, advice.known.trials, how.M_g, report.warnings(advice, page.say))
    return report.exit_code(advice)
