"""The prior of a drive: the distributions of all fields that are not known exactly, from its preset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from hdassist.belief.statistics import sobol_points
from hdassist.drive.model.deviations import MeasuredTeeth, Unknown, assumptions, standing_offset, unknowns
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import DEVIATIONS, Drive, deviation_sizes, field_table, is_overridden, measures
from hdassist.drive.solve.answers import ARCSEC

RIGID_SHIFT = "gears.x_b"
# Largest profile shift, in modules, by which teeth are closer than just in mesh; at this value K_1 is a third above
# that of any catalogue.
PRELOAD = 0.04
LOGARITHMIC = 4.0  # ratio of the bounds of a positive range above which its logarithm is uniformly distributed
_EVEN_STEPS = 1024  # number of steps of probability over which a field is averaged
_SHARE_LIMITS = (1e-9, 1 - 1e-9)  # probabilities at which a normal distribution is cut

# Prior of the single pitch deviations f_p. In some drives the teeth are fine, so that the low orders alone determine
# their positions; in the others f_p has the accuracy class of the wheel. All three values are assumed, and
# benchmarks.honesty tests them.
FINE_TEETH_SHARE = 0.5  # probability that the teeth of a wheel are fine
FINE_TEETH_BOUND = 1 / 8  # largest f_p of fine teeth over that of the class: six classes of ISO 1328-1:2013
TEETH_CORRELATION = 0.9  # between the normal quantiles of f_p of both wheels of a drive

EVIDENCE = ("catalogue.", "measured.")  # sections with reference data, which are not properties of the drive

_FieldOwner = Literal["design", "drive", "assembly", "surroundings"]
_Distribution = Literal["even", "logarithmic", "normal", "drawn", "meshing", "teeth"]


@dataclass(frozen=True)
class FieldPrior:
    """Distribution of a field that is not known exactly, in the unit of the field.

    path: path of the field.
    distribution: kind of distribution; meshing is uniform beyond the profile shift at which the teeth just mesh, which
        follows from all other fields; teeth is uniform up to FINE_TEETH_BOUND of the upper bound for fine teeth, and
        uniform beyond it for the others.
    low, high: bounds; for a normal distribution the mean minus and plus the expanded uncertainty (k = 2).
    owner: owner of the value: all drives of a design, one drive, its assembly, or its surroundings.
    group: path of the size if the field is the size or direction of a deviation, otherwise the path itself.
    reason: origin of the bounds.
    draws: equally probable values of a fit; draws with the same index in different fields belong together.
    """

    path: str
    distribution: _Distribution
    low: float
    high: float
    owner: _FieldOwner
    group: str
    reason: str
    draws: tuple[float, ...] = ()

    def value(self, share: Array) -> Array:
        """Return values of the field [its unit] at shares of its probability, not below the smallest allowed value."""
        # a fit provides sampled values, and a share of probability selects one of them
        if self.draws:
            return np.sort(self.draws)[self._places(share)]
        # equal factors are equally probable, as for a stiffness known to a factor of ten
        if self.distribution == "logarithmic":
            return np.asarray(self.low * (self.high / self.low) ** share)
        if self.distribution in ("even", "meshing"):
            return np.asarray(self.low + (self.high - self.low) * share)
        if self.distribution == "teeth":
            return self.high * pitch_deviation_shares(share)
        mean = (self.low + self.high) / 2
        standard_deviation = (self.high - self.low) / 4  # the bounds are two standard deviations from the mean
        normal = mean + standard_deviation * ndtri(np.clip(share, *_SHARE_LIMITS))
        # a size cannot fall below the smallest value of its field
        return np.asarray(np.maximum(normal, field_table()[self.path].ge))

    def joined(self, share: Array) -> Array:
        """Return shares of the field's own probability from shares of the probability of its fit."""
        # rank of each draw among the draws of this field
        ranks = np.argsort(np.argsort(self.draws, kind="stable"))
        return np.asarray((ranks[self._places(share)] + 0.5) / len(self.draws))

    def _places(self, share: Array) -> NDArray[np.int64]:
        """Return the index of the draw of a fit at each share of its probability."""
        places: NDArray[np.int64] = np.minimum((share * len(self.draws)).astype(np.int64), len(self.draws) - 1)
        return places

    @property
    def root_mean_square(self) -> float:
        """Root mean square of the field, in its unit, over even steps of its probability."""
        steps = (np.arange(_EVEN_STEPS) + 0.5) / _EVEN_STEPS
        return float(np.sqrt(np.mean(self.value(steps) ** 2)))

    @property
    def is_any_direction(self) -> bool:
        """Whether the field is an unknown direction."""
        return self.distribution == "even" and self.path != self.group and self.low == 0


@dataclass(frozen=True)
class DrivePrior:
    """A drive with the distributions of all fields that are not known exactly.

    fitted: paths of identified fields without a range, because a fit to a measurement gave only their values.
    """

    drive: Drive
    fields: tuple[FieldPrior, ...]
    fitted: tuple[str, ...] = ()

    def counts(self) -> dict[str, int]:
        """Return the number of uncertain fields of each kind; the counts add up to the number of fields.

        The kinds are "assumed" (within a range from the preset's source), "default" (within the usual range of a field
        that the preset omits), "unknown" (without any value), "stated" (with an uncertainty), "fitted" (jointly to
        measurements) and "derived" (from the catalogue's backlash).
        """
        counts = dict.fromkeys(("assumed", "default", "unknown", "stated", "fitted", "derived"), 0)
        kind_of_distribution = {"normal": "stated", "drawn": "fitted", "meshing": "derived"}
        # each field counts under the reason for its uncertainty
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
        """The profile shift of the circular spline if it follows from other fields, with its index among the fields."""
        for place, field in enumerate(self.fields):
            if field.distribution == "meshing":
                return place, field
        return None

    def shares(self, count: int, seed: int = 0) -> Array:
        """Return joint draws as shares of each field's probability and a spare share, shape (count, fields + 1).

        They are a scrambled Sobol sequence, so a larger count with the same seed only adds draws.
        """
        # one coordinate per field, and a spare one for the caller
        return self.joined(sobol_points(count, len(self.fields) + 1, seed))

    def joined(self, shares: Array) -> Array:
        """Return shares in which jointly fitted fields belong to one draw of their fit.

        The share of the first such field selects the draw.

        shares: shares of each field's probability, shape (draws, at least fields), which is also the shape of the
            result.
        """
        fitted = [k for k, field in enumerate(self.fields) if field.draws]
        joined = shares.copy()
        # parameters of a fit are correlated, so all come from one draw of the fit
        for k in fitted:
            joined[:, k] = self.fields[k].joined(shares[:, fitted[0]])
        return joined

    def values(self, shares: Array) -> list[dict[str, float]]:
        """Return the values of draws by path, except a profile shift that follows from them.

        shares: shares of each field's probability, shape (draws, at least fields).
        """
        meshing = self.meshing
        beyond = meshing[1].path if meshing else None
        # as lists, because a preset takes plain numbers
        columns = {path: column.tolist() for path, column in self.columns(shares).items() if path != beyond}
        return [{path: column[k] for path, column in columns.items()} for k in range(len(shares))]

    def columns(self, shares: Array) -> dict[str, Array]:
        """Return the values of draws by path, shape (draws,) each.

        A profile shift that follows from other fields is counted from the one at which the teeth just mesh. The single
        pitch deviations of the two wheels are correlated by equation (1).

        shares: shares of each field's probability, shape (draws, at least fields).
        """
        columns = {}
        share_of_first: Array | None = None  # if the first wheel is uncertain
        for k, field in enumerate(self.fields):
            share = shares[:, k]
            if field.distribution == "teeth":
                if share_of_first is None:
                    share_of_first = share
                else:
                    share = share_of_second_wheel(share_of_first, share)
            columns[field.path] = field.value(share)
        return columns


def pitch_deviation_shares(share: Array) -> Array:
    """Return f_p of a wheel over its upper bound, at shares of its probability."""
    return np.interp(share, (0.0, FINE_TEETH_SHARE, 1.0), (0.0, FINE_TEETH_BOUND, 1.0))


def share_of_second_wheel(first: Array, second: Array) -> Array:
    """Return shares of probability of f_p of the second wheel, correlated with those of the first wheel.

    Both wheels are made with the same care:

    (1)  z = R z_1 + sqrt(1 - R^2) z_2

    z_1 and z_2 are the normal quantiles of the arguments, and z is that of the result.

    first: shares of probability of the first wheel.
    second: independent shares of probability.
    """
    R = TEETH_CORRELATION
    z_1 = ndtri(np.clip(first, *_SHARE_LIMITS))
    z_2 = ndtri(np.clip(second, *_SHARE_LIMITS))
    return np.asarray(ndtr(R * z_1 + np.sqrt(1 - R**2) * z_2))


def prior_of(drive: Drive) -> DrivePrior:
    """Return the prior of a drive, which its preset determines.

    A field with an uncertainty is normal. A field that is assumed, or has a default with a plausible range, is uniform
    over its range, or in the logarithm if the range is positive and spans more than a factor of 4. An unspecified
    deviation is uniform up to the largest plausible size of its part, with any direction. A single pitch deviation with
    a range from 0 has the distribution "teeth". A jointly fitted field is drawn with its fit, as long as it has the
    fitted value. If the catalogue states a backlash, the profile shift of the circular spline follows, provided that it
    is only assumed. All other fields are exact.
    """
    knowledge = _Knowledge.of(drive)
    candidates = [knowledge.field_prior(path) for path in measures() if not path.startswith(EVIDENCE)]
    fields = tuple(field for field in candidates if field is not None)
    varied = {field.path for field in fields}
    exact = tuple(path for path, source in drive.source.items() if source.kind == "identified" and path not in varied)
    return DrivePrior(drive, fields, exact)


@dataclass(frozen=True, eq=False)
class _Knowledge:
    """Statements of a preset on the fields of a drive, by path.

    uncertain: expanded uncertainty (k = 2) of values that have one.
    fitted: equally probable values of jointly fitted fields.
    assumed: ranges of values that are assumed or defaults.
    unknown: ranges of unspecified deviations.
    """

    drive: Drive
    uncertain: Mapping[str, float]
    fitted: Mapping[str, tuple[float, ...]]
    assumed: Mapping[str, Unknown]
    unknown: Mapping[str, Unknown]

    @classmethod
    def of(cls, drive: Drive) -> _Knowledge:
        """Return the statements of a drive's preset on its fields."""
        assumed = {assumption.path: assumption for assumption in assumptions(drive)}
        uncertain = {
            path: spread for path, spread in drive.uncertainty.items() if spread and drive.value(path) is not None
        }
        # the direction of a deviation of size 0 matters if its true size may differ
        largest = {path: assumed[path].high for path in deviation_sizes() if path in assumed}
        largest |= {path: drive.number(path) + uncertain[path] for path in deviation_sizes() if path in uncertain}
        fitted = {
            path: draws
            for path, draws in drive.fit.items()
            if drive.value(path) == draws[0] and not is_overridden(path, drive.origin.overrides)
        }
        all_unknown = (*unknowns(drive.with_values(largest)), *unknowns(drive))
        return cls(
            drive=drive,
            uncertain=uncertain,
            fitted=fitted,
            assumed=assumed,
            unknown={unknown.path: unknown for unknown in all_unknown},
        )

    def field_prior(self, path: str) -> FieldPrior | None:
        """Return the prior of a field from the first applicable statement; None if the field is exact."""
        if path in self.uncertain:
            value = self.drive.number(path)
            spread = self.uncertain[path]
            return self._prior(path, "normal", value - spread, value + spread, "stated uncertainty, k = 2")
        if path in self.fitted:
            draws = self.fitted[path]
            fitted = self._prior(path, "drawn", min(draws), max(draws), "fitted together with other fields")
            return replace(fitted, draws=draws)
        if path in self.assumed:
            assumption = self.assumed[path]
            is_wide = assumption.low > 0 and assumption.high / assumption.low > LOGARITHMIC
            distribution: _Distribution = "logarithmic" if is_wide else _bounded_distribution(path, assumption.low)
            return self._prior(path, distribution, assumption.low, assumption.high, assumption.reason)
        play = self.drive.catalogue.play
        if path == RIGID_SHIFT and play and _follows(self.drive):
            reason = (
                f"the teeth mesh with a backlash of at most {play:g} arcsec and a preload of at most "
                f"{PRELOAD:g} modules"
            )
            return self._prior(path, "meshing", -PRELOAD, _shift_of_backlash(self.drive, play), reason)
        if path in self.unknown:
            unknown = self.unknown[path]
            distribution = _bounded_distribution(path, unknown.low)
            return self._prior(path, distribution, unknown.low, unknown.high, unknown.reason)
        return None

    def _prior(
        self,
        path: str,
        distribution: _Distribution,
        low: float,
        high: float,
        reason: str,
    ) -> FieldPrior:
        """Return the prior of a field, with its owner and its group."""
        return FieldPrior(
            path=path,
            distribution=distribution,
            low=low,
            high=high,
            owner=owner_of(self.drive, path),
            group=_deviation_groups().get(path, path),
            reason=reason,
        )


def _bounded_distribution(path: str, low: float) -> _Distribution:
    """Return the distribution of a field between its bounds.

    path: path of the field.
    low: lower bound, in the unit of the field.
    """
    return "teeth" if path in _PITCH_DEVIATIONS and low == 0 else "even"


@cache
def _deviation_groups() -> dict[str, str]:
    """Return the path of the size of each deviation, by the paths of its size and of its direction."""
    return {path: deviation.size for deviation in DEVIATIONS for path in (deviation.size, deviation.direction)}


def _shift_of_backlash(drive: Drive, play_arcsec: float) -> float:
    """Return the profile shift of the circular spline beyond the meshing one that gives a backlash [modules].

    play_arcsec: backlash [arcsec].
    """
    return float(play_arcsec / ARCSEC * drive.gears.z_g / 4 / np.tan(np.radians(drive.gears.alpha)))


def _follows(drive: Drive) -> bool:
    """Return whether the profile shift of the circular spline follows from other fields.

    It does if it is only assumed and no value was identified together with it.
    """
    source = drive.source.get(RIGID_SHIFT)
    if source is None or source.kind != "assumed" or is_overridden(RIGID_SHIFT, drive.origin.overrides):
        return False
    return not any(other_source.kind == "identified" for other_source in drive.source.values())


def owner_of(drive: Drive, path: str) -> _FieldOwner:
    """Return the owner of the value of a field: the design, a single drive, or its assembly.

    path: path of the field.
    """
    if path in (*standing_offset(drive), "harmonics.a_s2", "harmonics.xi_s2"):
        return "assembly"
    if path.startswith(("tolerances.", "phases.", "harmonics.")) or path in _DRIVES_OWN:
        return "drive"
    return "design"


_PITCH_DEVIATIONS = frozenset(deviation.size for deviation in DEVIATIONS if deviation.kind == "pitch")
_DRIVES_OWN: Sequence[str] = ("gears.j_n", "bearing.g_b", "bearing.beta")  # clearances and ball phase


def beside_measured_teeth(drive: Drive, measured: MeasuredTeeth | None) -> tuple[Drive, DrivePrior]:
    """Return the drive without the harmonics that measured teeth replace, and the prior of its uncertain inputs."""
    if measured is None:
        return drive, prior_of(drive)
    bare = measured.without_harmonics(drive)
    prior = prior_of(bare)
    open_fields = tuple(field for field in prior.fields if bare.value(field.path) == drive.value(field.path))
    return bare, replace(prior, fields=open_fields)
