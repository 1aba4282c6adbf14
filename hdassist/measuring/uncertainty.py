"""Sources of the uncertainty of a measured F'_ior, as standard uncertainties."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, sqrt

from hdassist.errors import UsageError
from hdassist.plaintext import number_of
from hdassist.readers.trace import MeasuredTrace

STATED = {  # sources that a single record cannot show
    "encoder": "graduation of the output's encoder, once per output turn; the cam's off its centre, once per cam turn",
    "coupling": "eccentricity of the output coupling: cannot be told from once-per-output error",
    "reseating": "taking the drive off the rig and putting it back",
    "temperature": "temperature of drive and rig: operation.dT, known only so well",
}
COVERAGE_FACTOR = 2.0
WIND_UP = "wind-up"


@dataclass(frozen=True)
class UncertaintySource:
    """One source: its name, standard uncertainty [arcsec] (None: nobody has stated it), and where that comes from."""

    name: str
    arcsec: float | None
    origin: str


def parse_stated(texts: Sequence[str]) -> dict[str, float]:
    """Stated standard uncertainties [arcsec] by source, from texts like "encoder=0.5" or "encoder=0.5,coupling=0".

    Raises UsageError: no such text, an unknown source, or one given twice.
    """
    stated: dict[str, float] = {}
    for text in (part for given in texts for part in given.split(",")):
        name, _, number = text.partition("=")
        value = number_of(number)
        if name not in STATED or name in stated or not isfinite(value) or value < 0:
            expected = "each source once" if name in stated else "NAME=ARCSEC"
            hint = f"a standard uncertainty of F'_ior, NAME one of {', '.join(STATED)}"
            raise UsageError(f"invalid --budget {text}: expected {expected}", hint)
        stated[name] = value
    return stated


def resolution_source(trace: MeasuredTrace, scatter: float) -> UncertaintySource:
    """Source of the step of a trace's readings; scatter of single readings [arcsec].

    A step below twice the scatter is dithered, but for counts of the cam at even angles, as noise of the output does
    not move them. In time with the turns the fit follows the rounding, and both extremes of a range may err together:
    hence 2; else by themselves: hence sqrt(2).
    """
    unit = trace.step_arcsec / sqrt(12)
    if trace.step_arcsec / 2 < scatter:
        if trace.in_time and trace.cam_step_arcsec:
            return UncertaintySource("resolution", 2 * trace.cam_step_arcsec / sqrt(12), "cam counts at even angles")
        return UncertaintySource("resolution", 0.0, "no step seen above the noise")
    if trace.in_time:
        return UncertaintySource("resolution", 2 * unit, "step of the readings, at even angles")
    return UncertaintySource("resolution", sqrt(2) * unit, "step of the readings")


def stated_sources(stated: Mapping[str, float]) -> tuple[UncertaintySource, ...]:
    """Sources that a single record cannot show, by their stated standard uncertainties [arcsec]."""
    return tuple(
        UncertaintySource(name, stated.get(name), "stated" if name in stated else f"not stated; {words}")
        for name, words in STATED.items()
    )


def combined(sources: Sequence[UncertaintySource]) -> float:
    """Combined standard uncertainty [arcsec] of the sources that have a value."""
    return sqrt(sum(source.arcsec**2 for source in sources if source.arcsec is not None))
