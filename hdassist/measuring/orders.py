"""The order table of a measured trace: amplitude, its uncertainty, phase and cause of each order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdassist.error.orders import UNKNOWN, known_causes
from hdassist.measuring.cycle import Gearing
from hdassist.measuring.fit import TraceFit
from hdassist.preset.fields import Drive

OUTPUT = "once per output turn: also encoder graduation and coupling"


@dataclass(frozen=True)
class MeasuredOrder:
    """amplitude cos(per_cam_rev phi + phase), with the standard uncertainty of the amplitude and the cause in words.

    cause: empty where no drive is known.
    """

    per_cam_rev: float
    amplitude_arcsec: float
    uncertainty_arcsec: float
    phase_deg: float
    cause: str


def named(fit: TraceFit, drive: Drive | None, gearing: Gearing | None) -> tuple[MeasuredOrder, ...]:
    """Orders of a fit, rising, with the simplest causes of each that lie nearest to it."""
    cosine, sine = fit.pair(fit.coefficients)
    phase = np.degrees(np.arctan2(-sine, cosine))
    causes: dict[int, list[tuple[int, str]]] = {}
    width = float(np.diff(fit.orders).min()) / 2 if len(fit.orders) > 1 else 0.5
    for (k_g, k_b), (order, words) in (known_causes(drive) if drive else {}).items():
        place = int(np.abs(fit.orders - order).argmin())
        if abs(fit.orders[place] - order) <= width + 1e-9:
            causes.setdefault(place, []).append((abs(k_g) + abs(k_b), words))
    rows = zip(fit.orders, fit.amplitude, fit.amplitude_uncertainty, phase, strict=True)
    return tuple(
        MeasuredOrder(
            float(order),
            float(amplitude),
            float(uncertainty),
            float(angle),
            _cause(float(order), causes.get(place, []), drive, gearing, width),
        )
        for place, (order, amplitude, uncertainty, angle) in enumerate(rows)
    )


def _cause(
    order: float, causes: list[tuple[int, str]], drive: Drive | None, gearing: Gearing | None, width: float
) -> str:
    least = min((degree for degree, _ in causes), default=0)
    words = [text for degree, text in causes if degree == least]
    if gearing and abs(order - 1 / gearing.ratio) < min(width, 0.5 / gearing.ratio):
        words.append(OUTPUT)
    return "; ".join(words) or (UNKNOWN if drive else "")
