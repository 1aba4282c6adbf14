"""How the drives of a production scatter: what each field of a preset is drawn from, and the draws themselves.

A size of a deviation is a tolerance here: sizes lie between zero and it. A direction is any, since parts are put
together as they come. What stands with an uncertainty (k = 2) is known, and drawn around its value.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args
from warnings import catch_warnings, simplefilter

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from hdassist.error.table import DEVIATIONS
from hdassist.errors import UsageError
from hdassist.model.deviations import deviations_of
from hdassist.model.geometry import Array
from hdassist.model.unknown import unknowns
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import bounds_of

Distribution = Literal["rayleigh", "uniform", "fixed"]
DISTRIBUTIONS = get_args(Distribution)
Method = Literal["mc", "sobol"]
TAIL = 3.0  # the tolerance in standard deviations of each part of a Rayleigh-distributed size: 1 in 90 lies beyond
K = 2.0  # expanded uncertainties, in standard deviations


@dataclass(frozen=True)
class Scatter:
    """What a field, by path, is drawn from.

    kind: rayleigh, uniform or fixed, a size up to high; direction, evenly from 0 to high; normal, around the middle of
    low and high, which are two standard deviations from it, and never beyond them; measured, one of the values.
    assumed: whether high is no number of the preset but taken for what is not known.
    """

    path: str
    kind: Literal["rayleigh", "uniform", "fixed", "direction", "normal", "measured"]
    low: float
    high: float
    values: tuple[float, ...] = ()
    assumed: bool = False

    def at(self, share: Array) -> Array:
        """Values in the field's unit that a share of all stay below, shape of share, in 0..1."""
        if self.kind == "fixed":
            return np.full_like(share, self.high)
        if self.kind == "rayleigh":
            return np.asarray(self.high / TAIL * np.sqrt(-2 * np.log1p(share * np.expm1(-(TAIL**2) / 2))))
        if self.kind == "normal":
            within = ndtr(-K) + share * (ndtr(K) - ndtr(-K))
            middle, sd = (self.low + self.high) / 2, (self.high - self.low) / (2 * K)
            return np.asarray(np.clip(middle + sd * ndtri(within), self.low, self.high))
        if self.kind == "measured":
            place = np.minimum((share * len(self.values)).astype(np.int64), len(self.values) - 1)
            return np.asarray(self.values)[place]
        return np.asarray(self.low + share * (self.high - self.low))

    @property
    def is_size(self) -> bool:
        """Whether the field is the size of a deviation, drawn up to a tolerance."""
        return self.kind in DISTRIBUTIONS or self.kind == "measured"


def scatters(
    drive: Drive,
    distribution: Distribution = "rayleigh",
    *,
    by_field: Mapping[str, Distribution | Sequence[float]] | None = None,
    known: Sequence[str] = (),
) -> tuple[Scatter, ...]:
    """What the fields of a drive are drawn from.

    Arguments: drive; distribution of sizes up to their tolerance; by_field, another one of some sizes, or values
    measured of them, in the field's unit; known, directions that are as the preset has them. Raises UsageError for a
    field that is none, or a direction that is called known and is not.
    """
    by_field = dict(by_field or {})
    bounds = {u.path: u.high for u in unknowns(drive)}
    found: list[Scatter] = []
    left_known, uncertain = set(known), drive.uncertainty
    for each in deviations_of(drive.mounting.mark_kind):
        left_known.discard(each.direction)
        given = by_field.pop(each.size, distribution)
        limit = drive.value(each.size)
        high = bounds.get(each.size, 0.0) if limit is None else float(limit)
        if not isinstance(given, str):
            found.append(Scatter(each.size, "measured", min(given), max(given), tuple(given)))
        elif each.size in uncertain and limit is not None:
            found.append(_around(drive, each.size))
        elif high > 0:
            found.append(Scatter(each.size, given, 0.0, high, assumed=limit is None))
        else:
            continue
        if each.direction in uncertain and drive.value(each.direction) is not None:
            found.append(_around(drive, each.direction))
        elif each.direction not in known:
            found.append(Scatter(each.direction, "direction", 0.0, 360.0 / each.order))
        elif drive.value(each.direction) is None:
            raise UsageError(f"{each.direction} cannot be known: the preset does not give it")
    for path in (*by_field, *left_known):
        raise UsageError(f"{path} is no {'size' if path in by_field else 'direction'} of a deviation")
    others = (path for path in sorted(uncertain) if not path.startswith(DEVIATIONS))
    return (*found, *(_around(drive, path) for path in others))


def _around(drive: Drive, path: str) -> Scatter:
    value, reach = drive.number(path), drive.uncertainty[path]
    bounds = bounds_of(field_table()[path])
    if value - reach < bounds.get("ge", -np.inf):  # an offset of 5 ± 8 um: what would be less than none is folded up
        return Scatter(path, "normal", bounds["ge"], 2 * value - bounds["ge"])
    return Scatter(path, "normal", value - reach, value + reach)


@dataclass(frozen=True)
class Draws:
    """Random drives: drive k is the same, however many are drawn and whoever draws it.

    scatters: what fields are drawn from; seed; method: mc, independent draws, or sobol, a scrambled sequence that
    fills the space more evenly.
    """

    scatters: tuple[Scatter, ...]
    seed: int
    method: Method = "mc"

    def shares(self, first: int, last: int) -> Array:
        """Shares in 0..1, shape (drives, scatters), of drives first to last - 1."""
        if self.method == "sobol":
            sequence = qmc.Sobol(len(self.scatters), scramble=True, rng=np.random.default_rng(self.seed))
            if first:
                sequence.fast_forward(first)
            with catch_warnings():
                simplefilter("ignore")  # that a number of them is no power of two
                return np.asarray(sequence.random(last - first))
        rows = [
            np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(k,))).random(len(self.scatters))
            for k in range(first, last)
        ]
        return np.array(rows)

    def values(self, first: int, last: int) -> dict[str, Array]:
        """Values of the fields by path, shape (drives,), of drives first to last - 1."""
        shares = self.shares(first, last)
        return {s.path: s.at(shares[:, k]) for k, s in enumerate(self.scatters)}

    def widest(self, drive: Drive) -> Drive:
        """The drive with each size as great as it can be drawn, so that a table of it spans all drives."""
        sizes = {each.size for each in deviations_of(drive.mounting.mark_kind)}
        return drive.with_values({s.path: s.high for s in self.scatters if s.path in sizes})

    @property
    def moves_system(self) -> bool:
        """Whether stiffnesses, clearances or shapes scatter too, so that each drive has a contact system of its own."""
        return any(not s.path.startswith(DEVIATIONS) for s in self.scatters)

    def scaled(self, factors: Mapping[str, float]) -> Draws:
        """The same draws with some tolerances that many times as great."""
        found = [replace(s, high=s.high * factors[s.path]) if s.path in factors else s for s in self.scatters]
        return replace(self, scatters=tuple(found))
