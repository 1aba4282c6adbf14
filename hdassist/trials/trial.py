"""Trials: F'_ior measured with the fixed wheel in a few positions of its seat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hdassist.errors import UsageError
from hdassist.mounting.positions import FREE_STEP, hole_of
from hdassist.preset.fields import Drive
from hdassist.preset.yamltext import shown
from hdassist.readers.trace import MOST
from hdassist.textfile import is_file
from hdassist.trials.trial_traces import TrialTrace, read_trial_trace

FARTHEST = 3600.0  # deg that a wheel can be meant to be turned by


@dataclass(frozen=True)
class Trial:
    """F'_ior measured [arcsec] with the fixed wheel turned by rotation_deg from where it stood at 0.

    Or a trace in place of it; F_ior_arcsec is then the range of the trace, which F'_ior is at least.
    """

    rotation_deg: float
    F_ior_arcsec: float
    trace: TrialTrace | None = None


LEAST_NOISE, MOST_NOISE = 1e-6, 1e6  # arcsec; beyond them squares of it leave the range of numbers
MOST_RESEAT = 1e3  # um, as any eccentricity of a preset


@dataclass(frozen=True)
class Rig:
    """How trials are measured: at a torque [N*m], with noise of a value [arcsec] and an error of the seat [um].

    Both are standard deviations; reseat_um is that of the wheel's centre along any direction.
    """

    M_g: float
    noise_arcsec: float = 1.0
    reseat_um: float = 0.0

    def require_sound(self) -> None:
        """Raise UsageError unless the torque turns something and the standard deviations are such."""
        if not (0 < abs(self.M_g) <= 1e7):  # as operation.M_g
            raise UsageError(f"the torque of a trial must not be {self.M_g:g}", "--trial-torque 80")
        if not (self.noise_arcsec > 0):
            raise UsageError(f"the noise of a trial must be above zero, not {self.noise_arcsec:g}", "--noise 1")
        if not (LEAST_NOISE <= self.noise_arcsec <= MOST_NOISE):
            words = f"from {LEAST_NOISE:g} to {MOST_NOISE:g} arcsec, not {self.noise_arcsec:g}"
            raise UsageError(f"the noise of a trial must be {words}", "--noise 1")
        if not (0 <= self.reseat_um <= MOST_RESEAT):
            raise UsageError(f"the error of the seat must not be {self.reseat_um:g}", "--reseat 10")


def trial_positions(holes: int, allowed: Sequence[int] | str) -> list[float]:
    """Positions that may be chosen [deg]: the usable holes, or 5 degree steps where the angle is free."""
    if not holes:
        return [FREE_STEP * k for k in range(round(360 / FREE_STEP))]
    return [360 * k / holes for k in range(holes) if allowed == "all" or k in allowed]


def read_trial(text: str, holes: int, traces_of: Drive | None = None, *, reverse: bool = False) -> Trial:
    """Read 120:17.3 (degrees) or h4:17.3 (holes), or a trace: h4:run.csv.

    Arguments: holes of the seat; traces_of, the drive that traces are of, None where there may be none; reverse the
    error of traces. Raises UsageError for anything else, DataError for a file that is no trace of a trial.
    """
    where, _, value = text.partition(":")
    where, path = where.lower(), Path(value)
    hint = "like 120:17.3 (degrees) or h4:17.3 (holes), then the measured F'_ior in arcsec"
    if traces_of:
        hint += ", or the file of a trace: h4:run.csv"
    try:
        rotation = float(where.removeprefix("h"))
        F_ior = None if traces_of and not _is_number(value) and is_file(path) else float(value)
    except ValueError:
        raise UsageError(f"{text!r} is no trial{_why_none(value, traces_of)}", hint) from None
    if not ((F_ior is None or 0 < F_ior <= MOST) and abs(rotation) <= FARTHEST):
        raise UsageError(f"{shown(text)!r} is no trial", hint)
    if where.startswith("h"):
        if not holes:
            raise UsageError(f"{text!r} names a hole of a seat that has none", "mounting.holes says how many")
        if rotation not in range(holes):
            raise UsageError(f"{text!r}: the seat's holes are h0 to h{holes - 1}", hint)
        rotation *= 360 / holes
    elif holes and hole_of(rotation, holes) is None:
        near = round(rotation) % holes
        raise UsageError(
            f"{text!r}: {rotation:g} deg is no hole of the seat, whose holes are {360 / holes:g} deg apart",
            f"was hole {near} meant? h{near}:{value}",
        )
    if F_ior is None and traces_of:
        trace = read_trial_trace(path, traces_of, rotation % 360, reverse=reverse)
        return Trial(rotation % 360, trace.range_arcsec, trace)
    return Trial(rotation % 360, float(value))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _why_none(value: str, traces_of: Drive | None) -> str:
    if not value or _is_number(value):
        return ""
    return f": {value} is neither a number nor a file" if traces_of else f": {value} is no number"
