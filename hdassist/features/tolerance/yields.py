"""Percentiles of F'_ior and yield of random drives, with the uncertainty due to the number of drives and designs.

The yields of designs are assumed to be beta distributed. Mean and concentration of that distribution have posterior
weights on a grid. Given mean and concentration, the yield of each design is also beta distributed. This is the
hierarchical model of Gelman et al., Bayesian Data Analysis, 3rd edition, section 5.3.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc, betaincinv
from scipy.stats import betabinom

from hdassist.belief.statistics import Probability, effective_number, probability_by_share, weighted_quantile
from hdassist.drive.model.geometry import Array
from hdassist.features.tolerance.production import RandomDrive
from hdassist.run.errors import SURE, Verdict, is_settled, verdict_by_probability

# means of yields, at the midpoints of equal shares of Jeffreys' prior
_MEANS = np.sin(np.pi / 2 * (np.arange(48) + 0.5) / 48) ** 2
# concentrations, from "all or none" to nearly the same yield of all designs
_CONCENTRATIONS = np.geomspace(0.1, 200, 12)
_POSSIBLE = 1e-4  # smallest relative posterior weight of a grid point that is used
_YIELDS = np.sin(np.pi / 2 * np.linspace(0, 1, 301)) ** 2  # yields at which their distribution is computed
_INTERVAL_ERRORS = 1.645  # half-width of an interval in standard errors, with 5 % beyond each end
YIELD_TAIL = 0.05  # share of the designs' yields beyond each end of their range


@dataclass(frozen=True, eq=False)
class YieldBelief:
    """Yield of a production over its designs.

    The yield of a single design has Jeffreys' prior. No range or interval is narrower than the number of drives allows
    (Clopper and Pearson 1934, doi 10.1093/biomet/26.4.404), where the number is that of equally weighted drives with
    the same information.

    passed: drives that pass, shape (designs,).
    drives: drives, shape (designs,).
    weights: weights of the designs, shape (designs,).
    """

    passed: NDArray[np.int64]
    drives: NDArray[np.int64]
    weights: Array

    @property
    def share(self) -> float:
        """Share of the drives that pass, weighted by design."""
        return float(self.weights @ self.passed / max(float(self.weights @ self.drives), 1e-300))

    def percentile(self, share: float) -> float:
        """Return a percentile of the yield over the designs; share: its level, 0..1."""
        return float(np.interp(share, self._below, _YIELDS))

    @property
    def range(self) -> tuple[float, float]:
        """Yields at the ends of the range, with YIELD_TAIL of the designs beyond each end."""
        passed, failed = self._counts
        low = betaincinv(passed, failed + 1, YIELD_TAIL) if passed else 0.0
        high = betaincinv(passed + 1, failed, 1 - YIELD_TAIL) if failed else 1.0
        return min(self.percentile(YIELD_TAIL), float(low)), max(self.percentile(1 - YIELD_TAIL), float(high))

    def probability(self, wanted: float) -> Probability:
        """Return the probability that the yield of the design reaches a required yield, and its Monte Carlo interval.

        The interval is the wider of two: one from the posterior of the distribution of yields, which covers the small
        number of drives, and Jeffreys' interval for the number of designs, which covers the small number of designs.
        """
        value = 1 - float(self._mixture(np.array([wanted]))[0])
        passed, failed = self._counts
        least = 1 - betainc(passed, failed + 1, wanted) if passed else 0.0
        highest = 1 - betainc(passed + 1, failed, wanted) if failed else 1.0
        if len(self.weights) == 1:
            return Probability(value, min(value, float(least)), max(value, float(highest)))
        a, b, chance = self._posterior(*self._kinds())
        shares = 1 - betainc(a, b, wanted)
        of_designs = probability_by_share(value, effective_number(self.weights))
        low, high = (weighted_quantile(shares, chance, share) for share in (YIELD_TAIL, 1 - YIELD_TAIL))
        ends = min(of_designs.low, value, low, least), max(of_designs.high, value, high, highest)
        return Probability(value, *map(float, ends))

    @property
    def _counts(self) -> tuple[float, float]:
        """Numbers of drives that pass and fail, as equally weighted drives with the same information (Kish)."""
        weight = float(self.weights @ self.drives)
        count = weight**2 / max(float(self.weights**2 @ self.drives), 1e-300)
        return self.share * count, (1 - self.share) * count

    @cached_property
    def _below(self) -> Array:
        return np.maximum.accumulate(self._mixture(_YIELDS))

    def _mixture(self, yields: Array) -> Array:
        """Return the share of the designs whose yield is below each given yield, with the shape of `yields`."""
        kinds, weights = self._kinds()
        a, b, chance = self._posterior(kinds, weights)
        passed = kinds[:, 0]
        failed = kinds[:, 1] - kinds[:, 0]
        probability_below = betainc(a[:, None, None] + passed[:, None], b[:, None, None] + failed[:, None], yields)
        return np.asarray(np.einsum("g,k,gky->y", chance, weights, probability_below))

    def _kinds(self) -> tuple[NDArray[np.integer], Array]:
        """Return the distinct pairs of passed drives and drives per design, shape (kinds, 2), and their weights."""
        pairs = np.stack([self.passed, self.drives], axis=1)
        kinds, where = np.unique(
            pairs,
            axis=0,
            return_inverse=True,
        )
        return kinds, np.asarray(np.bincount(where.ravel(), self.weights / self.weights.sum()), dtype=float)

    def _posterior(self, kinds: NDArray[np.integer], weights: Array) -> tuple[Array, Array, Array]:
        """Return beta distributions of the designs' yields, and their posterior weights, shape (distributions,)."""
        if len(self.weights) == 1:
            return np.array([0.5]), np.array([0.5]), np.ones(1)
        mean, concentration = (axis.ravel() for axis in np.meshgrid(_MEANS, _CONCENTRATIONS, indexing="ij"))
        a = mean * concentration
        b = (1 - mean) * concentration
        likelihood = betabinom.logpmf(kinds[:, 0], kinds[:, 1], a[:, None], b[:, None])
        posterior = effective_number(self.weights) * likelihood @ weights
        chance = np.exp(posterior - posterior.max())
        possible = chance > _POSSIBLE
        return a[possible], b[possible], chance[possible] / chance[possible].sum()


@dataclass(frozen=True)
class Percentile:
    """Percentile of F'_ior [arcsec] with its Monte Carlo interval (5 % beyond each end)."""

    value: float
    low: float
    high: float

    @property
    def standard_error(self) -> float:
        """Monte Carlo standard error [arcsec], from the width of the interval."""
        return (self.high - self.low) / (2 * _INTERVAL_ERRORS)


def percentile_over_designs(
    values: Array,
    weights: Array,
    designs: NDArray[np.int64],
    share: float,
) -> Percentile:
    """Return a percentile of F'_ior [arcsec], or of another value, over random drives.

    The interval takes into account that drives of one design are not independent (Cochran 1977, Sampling Techniques,
    section 9A.2).

    values: values of the drives, shape (drives,).
    weights: weights of the drives, shape (drives,).
    designs: number of the design of each drive, shape (drives,).
    share: quantile level, for example 0.95.
    """
    value = weighted_quantile(values, weights, share)
    # standard error of the share below the percentile, which is a ratio of totals over designs
    residual = np.bincount(designs, weights * ((values <= value) - share))
    step = _INTERVAL_ERRORS * float(np.sqrt(np.sum(residual**2))) / weights.sum()
    low, high = (weighted_quantile(values, weights, float(np.clip(share + s, 0, 1))) for s in (-step, step))
    return Percentile(value, min(low, value), max(high, value))


@dataclass(eq=False)
class AtTorque:
    """Random drives at a torque.

    M_g: torque [N*m].
    limit: limit of F'_ior including the self error [arcsec], or None.
    self_error: self error of the preset's drive [arcsec].
    as_built: F'_ior as assembled [arcsec], one value per drive.
    best: F'_ior in the best position [arcsec], one value per drive.
    """

    M_g: float
    limit: float | None
    self_error: float
    as_built: array[float] = field(default_factory=lambda: array("d"))
    best: array[float] = field(default_factory=lambda: array("d"))

    def gains(self) -> Array:
        """Return the relative reduction of F'_ior in the best position, shape (drives,)."""
        return np.asarray(1 - np.array(self.best) / np.array(self.as_built))

    def passes(self, F_ior: Array) -> NDArray[np.bool_]:
        """Return whether F'_ior [arcsec] plus the self error is within the limit, shape (drives,); True without one."""
        return np.asarray(F_ior + self.self_error <= (np.inf if self.limit is None else self.limit))


@dataclass(eq=False)
class Summary:
    """Results of random drives, accumulated as they are computed.

    points: results at each torque.
    positions: number of tried positions of the wheel; 1 if it is not turned.
    wanted: required yield, as a share.
    sure: required probability of the yield.
    designs, weights: number and weight of the design of each drive with a result.
    refused: design numbers of drives without a result.
    reason: reason of the first refused drive; empty if all drives have a result.
    states, max_residual: number of solved states and largest residual of the certificate.
    """

    points: tuple[AtTorque, ...]
    positions: int
    wanted: float | None = None
    sure: float = SURE
    designs: array[int] = field(default_factory=lambda: array("q"))
    weights: array[float] = field(default_factory=lambda: array("d"))
    refused: array[int] = field(default_factory=lambda: array("q"))
    reason: str = ""
    states: int = 0
    max_residual: float = 0.0

    def add(self, records: Iterable[RandomDrive]) -> None:
        """Add the records of drives."""
        for record in records:
            if record.refused is not None:
                self.refused.append(record.design)
                self.reason = self.reason or record.refused
                continue
            self.designs.append(record.design)
            self.weights.append(record.weight)
            self.states += record.states
            self.max_residual = max(self.max_residual, record.max_residual)
            for point, F_ior_arcsec, best in zip(
                self.points, record.F_ior_arcsec, record.best_F_ior_arcsec, strict=True
            ):
                point.as_built.append(F_ior_arcsec)
                point.best.append(best)

    @property
    def count(self) -> int:
        """Number of drives with a result."""
        return len(self.designs)

    @property
    def design_count(self) -> int:
        """Number of designs with at least one result."""
        return len(np.unique(self.designs))

    @property
    def has_limit(self) -> bool:
        """Whether any torque has a limit."""
        return any(point.limit is not None for point in self.points)

    def yield_of(
        self,
        best: bool,
        point: AtTorque | None = None,
        *,
        refused_pass: bool = False,
    ) -> YieldBelief:
        """Return the yield as assembled or with each wheel in its best position, at all torques or at one.

        best: whether each wheel is in its best position.
        point: the torque; None for all torques.
        refused_pass: whether drives without a result count as good; otherwise they count as bad.
        """
        points = self.points if point is None else (point,)
        ok = np.all([point.passes(np.array(point.best if best else point.as_built)) for point in points], axis=0)
        designs = np.concatenate([np.array(self.designs, dtype=np.int64), np.array(self.refused, dtype=np.int64)])
        ok = np.concatenate([ok, np.full(len(self.refused), refused_pass)])
        names, place = np.unique(designs, return_inverse=True)
        weights = np.zeros(len(names))
        weights[place[: self.count]] = self.weights
        kept = weights > 0
        passed = np.bincount(place, ok, len(names)).astype(np.int64)
        return YieldBelief(passed[kept], np.bincount(place, minlength=len(names))[kept], weights[kept])

    @property
    def verdict(self) -> Verdict:
        """Verdict on the probability that the yield reaches the required one, with the wheel turned if this is allowed.

        The number of designs is fixed. If it is too small for a verdict, the result is INCONCLUSIVE.
        """
        if self.wanted is None or not self.has_limit:
            return Verdict.NO_LIMIT
        if not self.count:
            return Verdict.INCONCLUSIVE
        reached = [self.yield_of(True, refused_pass=good).probability(self.wanted) for good in (False, True)]
        settled = is_settled(reached[0].low, reached[1].high, self.sure)
        return verdict_by_probability(reached[0].value, self.sure) if settled else Verdict.INCONCLUSIVE

    def percentile(self, F_ior: Sequence[float] | Array, share: float) -> Percentile:
        """Return a percentile over the drives of F'_ior [arcsec] or of another value."""
        count = len(self.designs)
        designs = np.unique(self.designs, return_inverse=True)[1] if self.design_count > 1 else np.arange(count)
        return percentile_over_designs(np.array(F_ior), np.array(self.weights), designs, share)

    def reduction(self, point: AtTorque, share: float) -> Percentile:
        """Return a percentile of the relative reduction of F'_ior in the best position; share: from 0 to 1."""
        return self.percentile(point.gains(), share)


def rooms(limits: Sequence[float | None], self_errors: Sequence[float]) -> list[float | None] | None:
    """Return the limits minus the self error at each torque [arcsec], None for a torque without a limit.

    The result is None if no torque has a limit, or if a limit is not above the self error.
    """
    rooms_arcsec = [
        None if limit is None else limit - self_error for limit, self_error in zip(limits, self_errors, strict=True)
    ]
    return rooms_arcsec if min((room for room in rooms_arcsec if room is not None), default=0) > 0 else None
