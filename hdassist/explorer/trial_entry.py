"""Trials as the explorer takes them, and the rig that they are measured on."""

from __future__ import annotations

from collections.abc import Sequence

from hdassist.mounting.positions import hole_of
from hdassist.mounting.trial import Trial, read_trial
from hdassist.preset.fields import Drive
from hdassist.terminal.options import TrialOptions
from hdassist.trials.prior import Rig


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
