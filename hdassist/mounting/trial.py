"""Trials: F'_ior measured with the fixed wheel in a few positions of its seat, as values or records of the error."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import isnan

from hdassist.errors import UntrustedError, UsageError
from hdassist.measuring.reading import Reading
from hdassist.mounting.positions import hole_of
from hdassist.numerals import number_of
from hdassist.preset.fields import Drive
from hdassist.preset.measured import position_fault, turn_of
from hdassist.preset.yamltext import shown
from hdassist.readers.trace import LARGEST_ERROR

LEAST_NOISE = 1e-3  # arcsec
TRIAL_HINT = "like 120=17.3 (deg) or h4=17.3 (hole): F'_ior in arcsec, with a point; or h4=run.csv, a record"


@dataclass(frozen=True)
class Trial:
    """F'_ior measured [arcsec] with the fixed wheel turned by rotation_deg from where it stood at 0.

    noise_arcsec: standard deviation of this value; None: that of all values.
    """

    rotation_deg: float
    F_ior_arcsec: float
    noise_arcsec: float | None = field(default=None, kw_only=True)


def read_trial(text: str, holes: int, allowed: Sequence[int] | str = "all") -> Trial:
    """Read 120=17.3 (degrees) or h4=17.3 (holes of the seat, of which some are allowed). Raises UsageError for else."""
    where, _, value = text.lower().partition("=")
    rotation, F_ior = read_trial_position(where, text, holes, allowed), number_of(value)
    if not 0 < F_ior <= LARGEST_ERROR:
        wanted = f"expected F'_ior in arcsec, as {where}=17.3, or the file of a record, as {where}=run.csv"
        raise UsageError(f"invalid trial {shown(text)!r}: {wanted}", TRIAL_HINT)
    return Trial(rotation, F_ior)


def read_trial_position(where: str, text: str, holes: int, allowed: Sequence[int] | str = "all") -> float:
    """Turn [deg] of the position in a trial's text: degrees, or a hole of the seat. Raises UsageError for else."""
    rotation = turn_of(where, holes)
    if rotation != rotation and not (where.startswith("h") and where[1:].isdecimal()):
        raise UsageError(f"invalid trial {shown(text)!r}: expected HOLE=VALUE", TRIAL_HINT)
    if fault := position_fault(where, holes):
        raise UsageError(f"{text!r}: {fault[0]}", fault[1] or TRIAL_HINT)
    hole = hole_of(rotation, holes)
    if hole is not None and allowed != "all" and hole % holes not in allowed:
        raise UsageError(
            f"{text!r}: hole {hole % holes} is not one of mounting.allowed",
            "an advice never chooses it: give it as one more trial",
        )
    return 360 * (hole % holes) / holes if hole is not None else rotation % 360


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
