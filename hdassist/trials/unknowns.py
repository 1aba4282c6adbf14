"""What is not known of a drive before a trial: the cam offset that stands with the fixed wheel, and the rest."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from hdassist.errors import UsageError
from hdassist.model.geometry import Array
from hdassist.model.unknown import uncertain_values, unknowns
from hdassist.preset.fields import Drive

WIDEST = 2.0  # a size without an uncertainty may be so many times the preset's
NARROWEST = 2.5  # deg: a direction needs some width to be weighed over
OUTERMOST = 0.001  # shares beyond are drawn as this one: no table reaches all of a normal distribution


def offset_fields(drive: Drive) -> tuple[str, str]:
    """Fields of size and direction of the offset that stands with the fixed wheel."""
    end = "b" if drive.mounting.fixed == "rigid" else "g"
    return f"tolerances.e_h{end}", f"phases.phi_h{end}"


def open_fields(drive: Drive) -> dict[str, tuple[float, float]]:
    """Fields of a drive that are not known, and their ranges; the direction of the standing offset is left out.

    The standing offset is anywhere up to WIDEST times the preset's, unless the preset gives an uncertainty for it; so
    is the one that turns with the cam, in any direction. Other fields vary by the uncertainty that they have;
    deviations that the preset does not give, over what they may be (model/unknown.py). Raises UsageError where nothing
    is known of the size of the standing offset.
    """
    size, direction = offset_fields(drive)
    ranges = {each.path: (each.low, each.high) for each in unknowns(drive)}
    if size not in {*drive.uncertainty, *ranges} and not drive.number(size) > 0:
        raise UsageError(
            f"nothing is known of the size of the cam offset {size}",
            f"--set {size}=80 says that up to {WIDEST:g} times 80 um are likely",
        )
    measured = {path: (0.0, 0.0) for path in drive.uncertainty if path != direction}
    own = drive.tolerances.e_hh or any(drive.uncertainty[path] for path in set(measured) - {size})
    wide = {path: (0.0, WIDEST * drive.number(path)) for path in (size, *(["tolerances.e_hh"] if own else []))}
    found = wide | ({"phases.phi_hh": (0.0, 360.0)} if own else {}) | ranges | measured
    return {path: found[path] for path in sorted(set(found) - {direction})}


def drawn_values(drive: Drive, path: str, reach: tuple[float, float], share: Array) -> Array:
    """Values of an open field from shares of their probability, by its uncertainty, or evenly over its range."""
    if path in drive.uncertainty:
        return uncertain_values(drive, path, np.clip(share, OUTERMOST, 1 - OUTERMOST))
    return reach[0] + (reach[1] - reach[0]) * share


def direction_density(drive: Drive, direction_deg: Array) -> Array:
    """How likely directions [deg] of the standing offset are, against one another, shape of them."""
    path = offset_fields(drive)[1]
    if path not in drive.uncertainty:
        return np.ones_like(direction_deg)
    away = (direction_deg - drive.number(path) + 180) % 360 - 180
    return np.asarray(norm.pdf(away, 0, max(drive.uncertainty[path] / 2, NARROWEST)))
