"""All that the explorer asks of trials: reading one, and what they teach."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from functools import partial
from typing import TYPE_CHECKING

from hdassist.mounting.positions import hole_of
from hdassist.mounting.trial import Trial, read_trial
from hdassist.preset.fields import Drive
from hdassist.terminal.options import TrialOptions
from hdassist.trials.prior import Rig

if TYPE_CHECKING:
    from hdassist.solve.answers import Progress
    from hdassist.trials.advice import TrialAdvice


def told(text: str, drive: Drive, turn_deg: float) -> str:
    """A trial as the command takes it; a value alone is one at the turn [deg] that is looked at.

    Raises UsageError for what is none.
    """
    if ":" not in text:
        hole = hole_of(turn_deg, drive.mounting.holes)
        text = f"{turn_deg:g}:{text}" if hole is None else f"h{hole}:{text}"
    read_trial(text, drive.mounting.holes)
    return text


def read(texts: Sequence[str], drive: Drive) -> list[Trial]:
    """Trials with their turns and values."""
    return [read_trial(text, drive.mounting.holes) for text in texts]


def rig_of(drive: Drive, asked: TrialOptions) -> Rig:
    """The rig of a drive's trials. Raises UsageError for what none can be."""
    return Rig(asked.torque_of(drive.operation.M_g), asked.noise, asked.reseat)


def advice(
    drive: Drive,
    trials: Sequence[str],
    asked: TrialOptions,
    *,
    samples: int | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> TrialAdvice:
    """What trials teach, as `hdassist trials` computes it; samples: those of the command without."""
    from hdassist.solve.window import in_wide_enough_window
    from hdassist.trials.advice import advise_from_trials
    from hdassist.trials.prior import SAMPLES

    analysis = partial(
        advise_from_trials,
        trials=read(trials, drive),
        rig=rig_of(drive, asked),
        needed=asked.sure,
        samples=samples or SAMPLES,
        executor=executor,
        progress=progress,
    )
    return in_wide_enough_window(drive, analysis)
