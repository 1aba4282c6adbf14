"""Sources of the uncertainty of a measured F'_ior, as standard uncertainties."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, sqrt

from hdassist.errors import UsageError
from hdassist.numerals import number_of

STATED = {  # sources that a single record cannot show
    "encoder": "graduation of the output's encoder, once per output turn; the cam's off its centre, once per cam turn",
    "coupling": "eccentricity of the output coupling: cannot be told from once-per-output error",
    "reseating": "taking the drive off the rig and putting it back",
    "temperature": "temperature of drive and rig: operation.dT, known only so well",
}
COVERAGE_FACTOR = 2.0
WIND_UP = "wind-up"
RANGE_SOURCES = 4  # so many sources, the first ones, belong to one range alone


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


def budget(
    noise: float,
    bias: float,
    drift: float,
    unmodelled: float,
    step: float,
    scatter: float,
    stated: Mapping[str, float],
    *,
    in_time: bool = False,
    wind_up: float = 0.0,
) -> tuple[UncertaintySource, ...]:
    """Sources of uncertainty of a range.

    Arguments, all in arcsec: noise, spread of the range by bootstrap; bias, uncertainty of its correction; drift, by a
    drift; unmodelled, size of error beyond the declared orders; step, resolution of a reading; scatter,
    of single readings; stated, by source; in_time, whether the rounding of a step repeats with the turns; wind_up, by
    one taken off by a catalogue. The two extremes of a range err by themselves: hence sqrt(2). A step below twice the
    scatter is dithered. In time with the turns the fit follows the rounding, and both extremes may err together: hence
    2.
    """
    resolution = sqrt(2) * step / sqrt(12), "step of the readings"
    if step / 2 < scatter:
        resolution = 0.0, "no step seen above the noise"
    elif in_time:
        resolution = 2 * step / sqrt(12), "step of the readings, at even angles"
    sources = [
        UncertaintySource("noise", noise, "bootstrap of the residuals"),
        UncertaintySource("bias correction", bias, "a third of what was taken off"),
        UncertaintySource("drift", drift, "how straight it is, or whether it is one"),
        UncertaintySource(WIND_UP, wind_up, "stiffnesses of a catalogue, by which it was taken off"),
        UncertaintySource("beyond the orders", sqrt(2) * unmodelled, "residuals that go on from step to step"),
        UncertaintySource("resolution", *resolution),
    ]
    given = [
        UncertaintySource(name, stated.get(name), "stated" if name in stated else f"not stated; {words}")
        for name, words in STATED.items()
    ]
    return (*sources, *given)


def combined(sources: Sequence[UncertaintySource]) -> float:
    """Combined standard uncertainty [arcsec] of the sources that have a value."""
    return sqrt(sum(source.arcsec**2 for source in sources if source.arcsec is not None))
