"""Distributions of random drives: fields that all drives of a design share, and fields that each drive has alone.

A size of a deviation that the preset gives is a tolerance here: parts lie between zero and it, by a law. A size that it
does not give, or only assumes, is drawn as `check` draws it. Directions are any: parts are put together as they come.
All else that is not known exactly is the same in all drives of a design, but for clearances that have a tolerance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from hdassist.belief.prior import DrivePrior, FieldPrior, prior_of
from hdassist.errors import UsageError
from hdassist.model.assumed import assumptions
from hdassist.model.geometry import Array
from hdassist.preset.deviations import DEVIATION_FIELDS, DEVIATIONS
from hdassist.preset.fields import Drive

SizeLaw = Literal["rayleigh", "uniform", "fixed"]
RAYLEIGH_TAIL = (
    3.0  # the tolerance in standard deviations of each part of a Rayleigh-distributed size: 1 in 90 lies beyond
)


@dataclass(frozen=True)
class TolerancedSize(FieldPrior):
    """Size of a deviation in a production, by a law between 0 and its tolerance `high`."""

    law: SizeLaw = "rayleigh"

    def value(self, share: Array) -> Array:
        """Sizes [the field's unit] that shares of the parts stay below."""
        if self.law == "fixed":
            return np.full_like(share, self.high)
        if self.law == "rayleigh":
            return np.asarray(
                self.high / RAYLEIGH_TAIL * np.sqrt(-2 * np.log1p(share * np.expm1(-(RAYLEIGH_TAIL**2) / 2)))
            )
        return super().value(share)


@dataclass(frozen=True)
class ProductionLaw:
    """Distributions of random drives: shared fields, alike in all drives of a design, and own fields of each drive."""

    drive: Drive
    shared: tuple[FieldPrior, ...]
    own: tuple[FieldPrior, ...]

    @cached_property
    def joint(self) -> DrivePrior:
        """The prior of a random drive of a random design."""
        return DrivePrior(self.drive, self.shared + self.own)

    @property
    def tolerances(self) -> tuple[TolerancedSize, ...]:
        """Sizes that are drawn up to a tolerance of the preset."""
        return tuple(each for each in self.own if isinstance(each, TolerancedSize))

    @property
    def not_given(self) -> tuple[str, ...]:
        """Sizes that are drawn up to a bound which is no tolerance, as `check` draws them."""
        sizes = [each for each in self.own if each.path == each.group and each.path in DEVIATION_FIELDS]
        return tuple(f.path for f in sizes if not isinstance(f, TolerancedSize) and f.distribution != "normal")

    def values(self, seed: int, drive: int) -> dict[str, float]:
        """Own fields of a drive by its number, by path: they depend on the seed and the number alone."""
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(drive,)))
        return {f.path: float(f.value(np.array(s))) for f, s in zip(self.own, rng.random(len(self.own)), strict=True)}

    def scaled(self, factors: Mapping[str, float]) -> ProductionLaw:
        """The same law with some tolerances that many times as great."""
        own = tuple(replace(f, high=f.high * factors[f.path]) if f.path in factors else f for f in self.own)
        return replace(self, own=own)


def production_law(
    drive: Drive,
    law: SizeLaw = "rayleigh",
    *,
    chosen: bool = False,
    known: Sequence[str] = (),
) -> ProductionLaw:
    """The law of a preset's production.

    Arguments: drive; law of sizes up to their tolerance; chosen, whether sizes that are assumed are tolerances too;
    known, directions that are as the preset has them. Raises UsageError for a direction that is none, or is called
    known and is not.
    """
    if none := {*known} - {each.direction for each in DEVIATIONS if drive.value(each.direction) is not None}:
        raise UsageError(f"{min(none)} cannot be known: it is no direction that the preset gives")
    priors = {each.path: each for each in prior_of(drive).fields}
    assumed = {each.path for each in assumptions(drive)} if chosen else set()
    own: list[FieldPrior] = []
    for each in DEVIATIONS:
        high = drive.number(each.size)
        if each.size in priors and not (each.size in assumed and high):
            own.append(priors[each.size])
        elif high > 0:
            own.append(TolerancedSize(each.size, "even", 0.0, high, "drive", each.size, "its tolerance", law=law))
        else:
            continue
        given = drive.value(each.direction) is not None
        if given and each.direction in priors:
            own.append(priors[each.direction])
        elif each.direction not in known:
            reason = "parts are put together as they come"
            own.append(FieldPrior(each.direction, "even", 0.0, 360.0 / each.order, "drive", each.size, reason))
    others = [each for each in priors.values() if each.path not in DEVIATION_FIELDS]
    clearances = tuple(f for f in others if f.distribution == "normal" and f.owner != "design")
    shared = tuple(f for f in others if f not in clearances)
    return ProductionLaw(drive, shared, (*own, *clearances))
