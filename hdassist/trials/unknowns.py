"""What is not known of a drive before a trial: the cam offset that stands with the fixed wheel, and the rest.

The fields that are open, and draws of them by shares in 0..1 that are uniform.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.stats import norm

from hdassist.errors import UsageError
from hdassist.model.geometry import Array
from hdassist.model.unknown import Unknown, unknowns
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import least_of

WIDEST = 2.0  # a size without an uncertainty may be so many times the preset's
NARROWEST = 2.5  # deg: a direction needs some width to be weighed over
OUTERMOST = 0.001  # shares beyond are drawn as this one: no table reaches all of a normal distribution


@dataclass(frozen=True)
class OffsetNames:
    """Fields of the offset that stands with the fixed wheel."""

    size: str
    direction: str

    @classmethod
    def of(cls, drive: Drive) -> OffsetNames:
        """Those of a drive, by the wheel that is fixed."""
        if drive.mounting.fixed == "rigid":
            return cls("tolerances.e_hb", "phases.phi_hb")
        return cls("tolerances.e_hg", "phases.phi_hg")


@dataclass(frozen=True)
class OpenField:
    """A field that is not known: its values from shares of their probability."""

    path: str
    values: Callable[[Array], Array]


def open_fields(drive: Drive) -> list[OpenField]:
    """Fields of a drive that are not known, the direction of the standing offset left out.

    The standing offset is anywhere up to WIDEST times the preset's, unless the preset gives an uncertainty for it; so
    is the one that turns with the cam, in any direction. Other fields that have an uncertainty vary by it, and what the
    preset does not give is anything that it may be. Raises UsageError for a drive without a standing offset.
    """
    names, open_ = OffsetNames.of(drive), {each.path: each for each in unknowns(drive)}
    if not {names.size} & {*drive.uncertainty, *open_} and not drive.number(names.size) > 0:
        raise UsageError(
            f"nothing is known of the size of the cam offset {names.size}",
            f"--set {names.size}=80 says that up to {WIDEST:g} times 80 um are likely",
        )
    measured = {path for path in drive.uncertainty if path != names.direction}
    paths = {names.size} | measured | {*open_} - {names.direction}
    if drive.number("tolerances.e_hh") or any(drive.uncertainty[path] for path in measured - {names.size}):
        paths |= {"tolerances.e_hh", "phases.phi_hh"}
    return [OpenField(path, partial(_drawn, drive, path, open_.get(path))) for path in sorted(paths)]


def _drawn(drive: Drive, path: str, unknown: Unknown | None, share: Array) -> Array:
    if path in drive.uncertainty:
        off = drive.uncertainty[path] / 2 * norm.ppf(np.clip(share, OUTERMOST, 1 - OUTERMOST))
        return np.asarray(np.maximum(drive.number(path) + off, least_of(field_table()[path])))
    if unknown:
        return unknown.low + (unknown.high - unknown.low) * share
    return share * (360.0 if path.startswith("phases.") else WIDEST * drive.number(path))


def direction_density(drive: Drive, direction_deg: Array) -> Array:
    """How likely directions [deg] of the standing offset are, against one another, shape of them."""
    path = OffsetNames.of(drive).direction
    if path not in drive.uncertainty:
        return np.ones_like(direction_deg)
    away = (direction_deg - drive.number(path) + 180) % 360 - 180
    return np.asarray(norm.pdf(away, 0, max(drive.uncertainty[path] / 2, NARROWEST)))
