"""A trial from a record of the error: F'_ior with its uncertainty, as `measure` has them."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from math import isnan

from hdassist.errors import UntrustedError
from hdassist.measuring.reading import Reading
from hdassist.mounting.trial import Trial, read_trial, read_trial_position
from hdassist.numerals import number_of
from hdassist.preset.fields import Drive

LEAST_NOISE = 1e-3  # arcsec


def read_trial_or_record(
    text: str, drive: Drive, reading: Reading, seed: int = 0, allowed: Sequence[int] | str = "all"
) -> Trial:
    """Read h4=17.3 as read_trial does, or h4=run.csv, a record of the drive's error over its full cycle.

    A record's file has a suffix or a folder in its name, or is there and its name no number. reading: of the record;
    seed of its bootstrap. Raises those of read_trial, read_trace and measure; UntrustedError for a record of less than
    the cycle.
    """
    where, _, file = text.partition("=")
    if not (re.search(r"[/\\]|\.[A-Za-z]", file) or (isnan(number_of(file)) and os.path.lexists(file))):
        return read_trial(text, drive.mounting.holes, allowed)
    rotation = read_trial_position(where.lower(), text, drive.mounting.holes, allowed)
    greatest = reading.measured(file, drive, seed=seed).directions[0]
    if greatest.is_bound and (covered := greatest.coverage):
        turns, cycle = covered.cam_turns, covered.cam_turns / covered.share
        raise UntrustedError(
            f"{file}: {turns:.3g} of the {cycle:g} cam turns of the full cycle: F'_ior is a lower bound, and no trial",
            "record the full cycle in one direction",
        )
    return Trial(rotation, greatest.range.value, noise_arcsec=max(greatest.uncertainty_arcsec, LEAST_NOISE))
