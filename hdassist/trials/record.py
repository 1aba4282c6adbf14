"""A trial from a record of the error: F'_ior with its uncertainty, as `measure` has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from hdassist.errors import UntrustedError
from hdassist.measuring.cycle import gearing_of
from hdassist.measuring.measure import measure
from hdassist.mounting.trial import Trial, read_trial, read_trial_position
from hdassist.preset.fields import Drive
from hdassist.readers.trace import TraceForm, read_trace

LEAST_NOISE = 1e-3  # arcsec


@dataclass(frozen=True)
class RecordReading:
    """How records of trials are read: form of the file, and the arguments of `measure`."""

    form: TraceForm | None = None
    orders: Sequence[float] | None = None
    drift: str = "none"
    stated: Mapping[str, float] = field(default_factory=dict)
    seed: int = 0


def read_trial_or_record(
    text: str, drive: Drive, reading: RecordReading = RecordReading(), allowed: Sequence[int] | str = "all"
) -> Trial:
    """Read h4=17.3 as read_trial does, or h4=run.csv, a record of the drive's error over its full cycle.

    Raises what read_trial, read_trace and measure do; UntrustedError for a record of less than the cycle.
    """
    where, _, file = text.partition("=")
    if not any(letter.isalpha() for letter in file.lower().replace("e", "")):
        return read_trial(text, drive.mounting.holes, allowed)
    rotation = read_trial_position(where.lower(), text, drive.mounting.holes, allowed)
    gearing = gearing_of(drive, None)
    trace = read_trace(file, reading.form, gearing.ratio if gearing else None)
    found = measure(
        trace, drive=drive, orders=reading.orders, drift=reading.drift, stated=reading.stated, seed=reading.seed
    )
    greatest = found.directions[0]
    if greatest.is_bound and greatest.coverage:
        turns, cycle = greatest.coverage.cam_turns, greatest.coverage.cells * greatest.coverage.cam_deg / 360
        raise UntrustedError(
            f"{file}: {turns:.3g} of the {cycle:g} cam turns of the full cycle: F'_ior is a lower bound, and no trial",
            "record the full cycle in one direction",
        )
    return Trial(rotation, greatest.range.value, noise_arcsec=max(greatest.uncertainty_arcsec, LEAST_NOISE))
