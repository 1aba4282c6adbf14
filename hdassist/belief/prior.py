"""The prior of a drive: every field that is not known exactly, with its distribution, from the preset alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from hdassist.belief.statistics import sobol_points
from hdassist.model.deviations import MeasuredTeeth, assumptions, standing_offset, unknowns
from hdassist.model.geometry import Array
from hdassist.preset.fields import DEVIATIONS, Drive, deviation_sizes, field_table, is_overridden, measures
from hdassist.solve.answers import ARCSEC

RIGID_SHIFT = "gears.x_b"
# modules of profile shift that teeth are drawn closer than where they just mesh, at most; there K_1 is a third more
# than any catalogue has
PRELOAD = 0.04
LOGARITHMIC = 4.0  # upper over lower bound of a positive range above which it is even in the logarithm
_SHARE_LIMITS = (1e-9, 1 - 1e-9)  # probabilities that a normal distribution is drawn at

EVIDENCE = ("catalogue.", "measured.")  # sections that tell of fields, and are none of the drive's

_FieldOwner = Literal["design", "drive", "assembly", "surroundings"]


@dataclass(frozen=True)
class FieldPrior:
    """Distribution of a field that is not known exactly, by path, in the unit of the field.

    low, high: bounds; of a normal distribution the mean less and plus the expanded uncertainty (k = 2). meshing: even,
    beyond the profile shift at which the teeth just mesh, which follows from all else (meshing.py). owner: whose
    the value is, that of all drives of a design, of one drive, of its assembly or of its surroundings. group: path of
    the size where the field is the size or the direction of a deviation, else the path itself. reason: where the bounds
    come from; draws: of a fit, equally likely values, of which those of the same place in other fields belong together.
    """

    path: str
    distribution: Literal["even", "logarithmic", "normal", "drawn", "meshing"]
    low: float
    high: float
    owner: _FieldOwner
    group: str
    reason: str
    draws: tuple[float, ...] = ()

    def value(self, share: Array) -> Array:
        """Values of the field [its unit] at shares of its probability; a normal one is cut where the field ends."""
        if self.draws:
            return np.sort(self.draws)[self._places(share)]
        if self.distribution == "logarithmic":
            return np.asarray(self.low * (self.high / self.low) ** share)
        if self.distribution in ("even", "meshing"):
            return np.asarray(self.low + (self.high - self.low) * share)
        normal = (self.low + self.high) / 2 + (self.high - self.low) / 4 * ndtri(np.clip(share, *_SHARE_LIMITS))
        return np.asarray(np.maximum(normal, field_table()[self.path].ge))

    def joined(self, share: Array) -> Array:
        """Shares of the field's own probability where those of its fit are given."""
        ranks = np.argsort(np.argsort(self.draws, kind="stable"))
        return np.asarray((ranks[self._places(share)] + 0.5) / len(self.draws))

    def _places(self, share: Array) -> NDArray[np.int64]:
        places: NDArray[np.int64] = np.minimum((share * len(self.draws)).astype(np.int64), len(self.draws) - 1)
        return places

    @property
    def is_any_direction(self) -> bool:
        """Whether the field is a direction that is unknown."""
        return self.distribution == "even" and self.path != self.group and self.low == 0


@dataclass(frozen=True)
class DrivePrior:
    """A drive with the distributions of all its fields that are not known exactly.

    fitted: identified fields, by path, which are points: they were fitted to a measurement and carry no range.
    """

    drive: Drive
    fields: tuple[FieldPrior, ...]
    fitted: tuple[str, ...] = ()

    def counts(self) -> dict[str, int]:
        """Return the number of uncertain inputs of each kind; the kinds add up to the number of fields.

        Kinds: "assumed" within a range by the preset's source, "default" within the usual range of a field that the
        preset leaves out, "unknown" without any value, "stated" with an uncertainty, "fitted" together to
        measurements, "derived" from the catalogue's backlash.
        """
        counts = dict.fromkeys(("assumed", "default", "unknown", "stated", "fitted", "derived"), 0)
        kind_of_distribution = {"normal": "stated", "drawn": "fitted", "meshing": "derived"}
        for field in self.fields:
            if field.distribution in kind_of_distribution:
                kind = kind_of_distribution[field.distribution]
            elif self.drive.value(field.path) is None:
                kind = "unknown"
            else:
                kind = "assumed" if field.path in self.drive.source else "default"
            counts[kind] += 1
        return counts

    @property
    def meshing(self) -> tuple[int, FieldPrior] | None:
        """The shift of the rigid wheel where it follows from all else, and its place among the fields."""
        return next(((k, each) for k, each in enumerate(self.fields) if each.distribution == "meshing"), None)

    def shares(self, count: int, seed: int = 0) -> Array:
        """Joint draws as shares of each field's probability, shape (count, fields + 1); the last column is spare.

        A scrambled Sobol sequence: of more draws by the same seed the first are the same.
        """
        return self.joined(sobol_points(count, len(self.fields) + 1, seed))

    def joined(self, shares: Array) -> Array:
        """The same shares, those of fields that were fitted together by one draw of the fit, that of the first one."""
        together = [k for k, each in enumerate(self.fields) if each.draws]
        found = shares.copy()
        for k in together:
            found[:, k] = self.fields[k].joined(shares[:, together[0]])
        return found

    def values(self, shares: Array) -> list[dict[str, float]]:
        """Values by path of draws, from their shares, shape (draws, at least fields), without a shift that follows."""
        drawn = [(k, each) for k, each in enumerate(self.fields) if each.distribution != "meshing"]
        columns = {each.path: each.value(shares[:, k]).tolist() for k, each in drawn}
        return [{path: column[k] for path, column in columns.items()} for k in range(len(shares))]


def prior_of(drive: Drive) -> DrivePrior:
    """The prior of a drive, made from its preset alone.

    Teeth mesh without play where a catalogue says so: the rigid wheel's shift follows, where it is assumed.
    A field with an uncertainty is normal. One that is assumed, or left to a default with a plausible range, is even
    over its range, in the logarithm where the range is positive and spans more than a factor of 4. A deviation that is
    not given is even up to the largest that its part may have, its direction even around. One that was fitted with
    others is drawn with them, while it has the value of their fit. All others are points.
    """
    groups = {path: each.size for each in DEVIATIONS for path in (each.size, each.direction)}
    assumed = {each.path: each for each in assumptions(drive)}
    uncertain = {path: spread for path, spread in drive.uncertainty.items() if spread and drive.value(path) is not None}
    # the direction of a deviation of size 0 matters where that size may be another
    largest = {path: assumed[path].high for path in deviation_sizes() if path in assumed}
    largest |= {path: drive.number(path) + uncertain[path] for path in deviation_sizes() if path in uncertain}
    unknown = {each.path: each for each in (*unknowns(drive.with_values(largest)), *unknowns(drive))}
    fitted = {
        path: draws
        for path, draws in drive.fit.items()
        if drive.value(path) == draws[0] and not is_overridden(path, drive.origin.overrides)
    }
    found = []
    for path in [path for path in measures() if not path.startswith(EVIDENCE)]:
        own, owner = groups.get(path, path), owner_of(drive, path)
        if path in uncertain:
            low, high = (drive.number(path) + sign * uncertain[path] for sign in (-1, 1))
            found.append(FieldPrior(path, "normal", low, high, owner, own, "its uncertainty, k = 2"))
        elif path in fitted:
            draws = fitted[path]
            found.append(FieldPrior(path, "drawn", min(draws), max(draws), owner, own, "fitted with others", draws))
        elif path in assumed:
            low, high, reason = assumed[path].low, assumed[path].high, assumed[path].reason
            wide = low > 0 and high / low > LOGARITHMIC
            found.append(FieldPrior(path, "logarithmic" if wide else "even", low, high, owner, own, reason))
        elif path == RIGID_SHIFT and (play := drive.catalogue.play) and _follows(drive):
            reason = f"the teeth mesh: a backlash of {play:g} arcsec at most, a preload of {PRELOAD:g} modules at most"
            most = play / ARCSEC * drive.gears.z_g / 4 / np.tan(np.radians(drive.gears.alpha))
            found.append(FieldPrior(path, "meshing", -PRELOAD, float(most), owner, own, reason))
        elif path in unknown:
            each = unknown[path]
            found.append(FieldPrior(path, "even", each.low, each.high, owner, own, each.reason))
    drawn = {each.path for each in found}
    exact = tuple(p for p, source in drive.source.items() if source.kind == "identified" and p not in drawn)
    return DrivePrior(drive, tuple(found), exact)


def _follows(drive: Drive) -> bool:
    """Whether the shift of the rigid wheel is assumed, nothing else is said of it, and no other value found by it."""
    source = drive.source.get(RIGID_SHIFT)
    found = any(each.kind == "identified" for each in drive.source.values())
    return bool(
        source and source.kind == "assumed" and not found and not is_overridden(RIGID_SHIFT, drive.origin.overrides)
    )


def owner_of(drive: Drive, path: str) -> _FieldOwner:
    """Whose the value of a field is, by path: the design's, a single drive's, or its assembly's."""
    if path in (*standing_offset(drive), "harmonics.a_s2", "harmonics.xi_s2"):
        return "assembly"
    if path.startswith(("tolerances.", "phases.", "harmonics.")) or path in _DRIVES_OWN:
        return "drive"
    return "design"


_DRIVES_OWN: Sequence[str] = ("gears.j_n", "bearing.g_b", "bearing.beta")  # clearances and ball phase


def beside_measured_teeth(drive: Drive, measured: MeasuredTeeth | None) -> tuple[Drive, DrivePrior]:
    """The drive without the harmonics that measured teeth replace, and the prior of its inputs that are still open."""
    if measured is None:
        return drive, prior_of(drive)
    known = measured.without_harmonics(drive)
    prior = prior_of(known)
    return known, replace(prior, fields=tuple(f for f in prior.fields if known.value(f.path) == drive.value(f.path)))
