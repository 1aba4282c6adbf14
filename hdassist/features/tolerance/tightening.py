"""Tolerances that pay off if tightened, and the cheapest tolerances that reach a yield with the required probability.

Sensitivities: each sample is a random drive of a random design. The gain of a tolerance one step tighter is at most the
gain between the states of the present extremes. For the most promising tolerances, all samples are solved again.

Allocation: a cost law is share (now/tolerance)^k. Random drives are solved with a set of tolerances. The change of each
drive's F'_ior by a step of each tolerance, assumed to be linear, gives a cheaper set. Other random drives with that set
confirm or reject it. The search continues from these drives until two sets agree.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import brentq, minimize

from hdassist.belief.samples import Samples
from hdassist.belief.statistics import RESOLVED_ERROR, Probability, weighted_quantile
from hdassist.belief.steps import Influence, MeasurementGain, influences, measurements
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import DEVIATION_FIELDS, CostLaw, Drive
from hdassist.features.tolerance.production import TIGHTER_STEP, Production, ProductionLaw, RandomDrive
from hdassist.features.tolerance.yields import AtTorque, Percentile, Summary, YieldBelief, percentile_over_designs
from hdassist.run.errors import UntrustedError, Verdict

_HIGH_SHARE = 0.95  # share of the drives below the percentile that tightening should reduce
PERCENTILE_SHARES = (0.05, 0.5, _HIGH_SHARE)  # quantile levels of the percentiles of a result
_RESAMPLES = 200  # number of bootstrap resamples
_ENDS = (0.05, 0.95)  # quantiles of the resampled values that limit the interval of a gain
_Records = Callable[[Production, int], list[RandomDrive]]
_LOOSER = 2.0  # largest tolerance, in multiples of the preset's tolerance
_TIGHTER = 0.1  # smallest tolerance, as a share of the preset's, if the preset gives no smallest value that can be made
# first and last step of the logarithms of tolerances in the search for the cheapest ones
_FIRST_STEP = 0.3
_LAST_STEP = 0.001
_AIM = 0.98  # target of F'_ior as a share of the limit, with a margin for the error of the linear model
_STRICTER = 0.93  # factor by which the target is reduced if the drives do not verify the tolerances
_LIMIT_AGREES = 0.06  # largest remaining margin to the limit, as a share
_UNSOLVED_RATIO = 1e6  # assumed F'_ior over its room for a drive without a result, beyond any limit
_LEAST_SHARE_LEFT = 1e-2  # smallest F'_ior of a drive with scaled sizes, as a share of its present F'_ior


@dataclass(frozen=True)
class Tightened:
    """95th percentile of F'_ior at a torque now, and with one tolerance TIGHTER_STEP tighter.

    path: path of the tolerance.
    now, then: percentile now and with the tighter tolerance [arcsec].
    now_error: standard error of the present percentile [arcsec].
    low, high: Monte Carlo interval of the percentile with the tighter tolerance [arcsec].
    proven: whether the extremes were located again; if not, the percentile may be larger than `then`.
    """

    path: str
    now: float
    now_error: float
    then: float
    low: float
    high: float
    proven: bool

    @property
    def gain(self) -> float:
        """Decrease of the percentile by the step [arcsec]."""
        return self.now - self.then

    @property
    def reduction(self) -> float:
        """Decrease of the percentile by the step, as a share of the present percentile."""
        return self._decrease(self.then)

    @property
    def reduction_low(self) -> float:
        """Lower end of the Monte Carlo interval of the reduction, as a share."""
        return self._decrease(self.high)

    @property
    def reduction_high(self) -> float:
        """Upper end of the Monte Carlo interval of the reduction, as a share."""
        return self._decrease(self.low)

    def _decrease(self, percentile: float) -> float:
        """Return the decrease to another percentile [arcsec], as a share of the present one; 0 if there is no error."""
        return 1 - percentile / self.now if self.now else 0.0


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Gains from tighter tolerances, and contributions of inputs to the variance of F'_ior of a production.

    law: distributions of the random drives.
    samples: samples of the random drives.
    worst: index of the governing torque (relative to its limit, if there are limits).
    count: number of random drives with the present tolerances.
    percentiles: percentiles of their F'_ior at each torque [arcsec], at the quantile levels PERCENTILE_SHARES.
    tightened: gains at each torque, the largest first.
    influences: contributions at each torque.
    to_measure: measurements at the governing torque.
    drives: number of solved drives.
    states, max_residual: number of solved states and largest residual of the certificate.
    """

    law: ProductionLaw
    samples: Samples
    worst: int
    count: int
    percentiles: tuple[tuple[Percentile, ...], ...]
    tightened: tuple[tuple[Tightened, ...], ...]
    influences: tuple[tuple[Influence, ...], ...]
    to_measure: tuple[MeasurementGain, ...]
    drives: int
    states: int
    max_residual: float

    @property
    def first(self) -> Tightened:
        """Tolerance with the largest reduction by one step at the governing torque."""
        return self.tightened[self.worst][0]

    @property
    def largest(self) -> Influence | None:
        """Input with the largest share of the variance at the governing torque; None if no share is computed."""
        return next(iter(self.influences[self.worst]), None)

    @property
    def is_worth_tightening(self) -> bool:
        """Whether a step of the first tolerance certainly reduces F'_ior, and no shared field contributes more."""
        # even the lower end of the interval must be a gain
        if self.first.high >= self.first.now:
            return False
        return self.largest is None or self.largest.group in {way.path for way in self.tightened[self.worst]}


def _best_first(ways: Mapping[str, Sequence[Tightened]], torques: range) -> tuple[tuple[Tightened, ...], ...]:
    """Return the gains at each torque, beginning with the size whose tightening gives the smallest F'_ior.

    ways: gains from tightening each size, one per torque, by path.
    torques: indices of the torques.
    """
    at_torques = []
    for torque in torques:
        ranked = sorted((way[torque] for way in ways.values()), key=lambda way: way.then)
        at_torques.append(tuple(ranked))
    return tuple(at_torques)


def sensitivities(
    production: Production,
    samples: Samples,
    records: _Records,
) -> Sensitivities:
    """Return the sensitivities of a production in which each drive has its own design.

    production: production with one drive per design.
    samples: samples of the designs.
    records: function that returns a number of records of a production.
    Raises UntrustedError if a drive has no result.
    """
    law = production.law
    all_records = _sound(records(production, len(production.designs)))
    F_ior = np.array([record.F_ior_arcsec for record in all_records])
    weights = np.array([record.weight for record in all_records])
    # tolerances are ranked at the governing torque
    worst = worst_torque(production.drive, samples)
    ways = {}
    for path in law.sizes:
        # the estimate is F'_ior at the states of the drives' present extremes
        then = np.array([(record.tighter or {})[path] for record in all_records])
        ways[path] = _tightened(
            path,
            F_ior,
            then,
            weights,
            proven=False,
        )
    # the estimate is a lower bound of F'_ior, so the best size is solved again until a solved size is the best
    best = _best_size(ways, worst)
    while not ways[best][worst].proven:
        tighter_records = _sound(records(_with_tighter(production, best), len(production.designs)))
        then = np.array([record.F_ior_arcsec for record in tighter_records])
        ways[best] = _tightened(
            best,
            F_ior,
            then,
            weights,
            proven=True,
        )
        all_records += tighter_records
        best = _best_size(ways, worst)
    torques = range(len(production.torques))
    return Sensitivities(
        law=law,
        samples=samples,
        worst=worst,
        count=len(F_ior),
        percentiles=tuple(_percentiles(column, weights) for column in F_ior.T),
        tightened=_best_first(ways, torques),
        influences=tuple(_influences_at(samples, torque) for torque in torques),
        to_measure=to_measure(law, samples, worst),
        drives=len(all_records),
        states=sum(record.states for record in all_records),
        max_residual=max(record.max_residual for record in all_records),
    )


def _percentiles(F_ior: Array, weights: Array) -> tuple[Percentile, ...]:
    """Return the percentiles of F'_ior [arcsec] of drives that have their own designs, with their intervals.

    F_ior: F'_ior of the drives [arcsec], shape (drives,).
    weights: weights of the drives, shape (drives,).
    """
    designs = np.arange(len(F_ior))
    return tuple(percentile_over_designs(F_ior, weights, designs, share) for share in PERCENTILE_SHARES)


def _best_size(ways: Mapping[str, Sequence[Tightened]], torque: int) -> str:
    """Return the path of the size whose tightening by one step gives the smallest F'_ior.

    torque: index of the torque.
    """
    return min(ways, key=lambda path: ways[path][torque].then)


def _influences_at(samples: Samples, torque: int) -> tuple[Influence, ...]:
    """Return the contributions at a torque, empty if a sample has no error there; torque: index of the torque."""
    return influences(samples, torque) if samples.F_ior_arcsec[:, torque].all() else ()


def _with_tighter(production: Production, path: str) -> Production:
    """Return a production of the same designs with one size a step smaller, whose records have no `tighter`."""
    designs = []
    for values, weight in production.designs:
        designs.append(({**values, path: TIGHTER_STEP * values[path]}, weight))
    return replace(production, designs=tuple(designs), steps=False)


def worst_torque(drive: Drive, samples: Samples) -> int:
    """Return the index of the torque with the largest 95th percentile of F'_ior.

    The percentile is relative to the limit if all torques have one.

    drive: the drive of the preset, with its limits.
    samples: samples of random drives, each of its own design.
    """
    # the comparison is relative to the limits if every torque has one
    limits = [drive.limit(M_g) or 0.0 for M_g in samples.torques]
    now_arcsec = [weighted_quantile(column, samples.weights, _HIGH_SHARE) for column in samples.F_ior_arcsec.T]
    return int(np.argmax(np.array(now_arcsec) / (limits if all(limits) else 1)))


def to_measure(
    law: ProductionLaw,
    samples: Samples,
    torque: int,
) -> tuple[MeasurementGain, ...]:
    """Return the measurements of a design, beginning with that which reduces the spread of ln F'_ior most.

    law: law of the production.
    samples: samples of random drives.
    torque: index of the torque.
    """
    # only fields shared by all drives of a design can be measured once for all drives
    shared = {field.path for field in law.shared} - DEVIATION_FIELDS
    gains = measurements(samples, torque) if samples.F_ior_arcsec[:, torque].all() else ()
    return tuple(gain for gain in gains if gain.measured in shared or gain.measured.startswith("stiffness."))


def _sound(records: list[RandomDrive]) -> list[RandomDrive]:
    for record in records:
        if record.refused is not None:
            raise UntrustedError(f"a random drive has no result: {record.refused}", "reduce the tolerances and ranges")
    return records


def _tightened(
    path: str,
    F_ior: Array,
    then: Array,
    weights: Array,
    *,
    proven: bool,
) -> list[Tightened]:
    """Return the gain from one step of a tolerance at each torque.

    F_ior: F'_ior now [arcsec], shape (drives, torques).
    then: F'_ior with the tighter tolerance [arcsec], shape (drives, torques).
    weights: weights of the drives, shape (drives,).
    """
    # the bootstrap selects the same drives with both tolerances, because only their differences matter
    resampled = np.random.default_rng(0).integers(0, len(F_ior), (_RESAMPLES, len(F_ior)))
    steps = []
    for before, after in zip(F_ior.T, then.T, strict=True):
        now_quantile, then_quantile = (weighted_quantile(values, weights, _HIGH_SHARE) for values in (before, after))
        resampled_now = np.array([weighted_quantile(before[rows], weights[rows], _HIGH_SHARE) for rows in resampled])
        resampled_then = np.array([weighted_quantile(after[rows], weights[rows], _HIGH_SHARE) for rows in resampled])
        # the largest gain gives the lower end of the percentile
        low, high = now_quantile - np.quantile(resampled_now - resampled_then, _ENDS[::-1])
        steps.append(
            Tightened(
                path=path,
                now=now_quantile,
                now_error=float(resampled_now.std()),
                then=then_quantile,
                low=float(low),
                high=float(high),
                proven=proven,
            )
        )
    return steps


@dataclass(frozen=True)
class _Tolerance:
    """A tolerance that may be chosen.

    path: path of the size.
    now: value in the preset.
    least, most: bounds of the value.
    law: cost law.
    assumed_law: whether the preset gives no cost law.
    """

    path: str
    now: float
    least: float
    most: float
    law: CostLaw
    assumed_law: bool

    def cost(self, value: float) -> float:
        """Return the cost of a value, in the unit of the law's share."""
        return float(self.law.share * (self.now / value) ** self.law.k)


def tolerances(drive: Drive, law: ProductionLaw) -> tuple[_Tolerance, ...]:
    """Return the tolerances that may be chosen, which are the sizes that are sampled up to a value of the preset."""
    choices = []
    for size in law.tolerances:
        cost = drive.cost.get(size.path)
        present = size.high
        # smallest value that the workshop can make, or a tenth of the present value
        least = cost.least if cost and cost.least is not None else _TIGHTER * present
        loosest = max(_LOOSER * present, least)
        choices.append(
            _Tolerance(
                path=size.path,
                now=present,
                least=least,
                most=loosest,
                law=cost or CostLaw.of_defaults(),
                assumed_law=cost is None,
            )
        )
    return tuple(choices)


@dataclass(frozen=True)
class Allocation:
    """Tolerances with their cost and the yield of random drives with them.

    turned: whether each wheel is turned to its best position.
    values: tolerances by path, in the field's unit.
    cost: cost of the tolerances.
    tried: yield of drives that were not used in the search for the tolerances.
    probability: probability that the yield reaches the required one.
    verdict: verdict on this probability.
    """

    turned: bool
    values: Mapping[str, float]
    cost: float
    tried: YieldBelief
    probability: Probability
    verdict: Verdict

    @property
    def fits(self) -> bool:
        """Whether the tolerances reach the yield with the required probability."""
        return self.verdict is Verdict.PASS


@dataclass(frozen=True)
class Allocator:
    """Search for the cheapest tolerances of a drive.

    production: production with designs, whose records have steps.
    rooms: largest F'_ior within the limits, at each torque [arcsec].
    wanted: required yield, as a share.
    sure: required probability of the yield.
    records: function that returns a number of verified drives of a production.
    drives: number of drives.
    rounds: maximum number of rounds after the first.
    """

    production: Production
    rooms: tuple[float, ...]
    wanted: float
    sure: float
    records: Callable[[Production, int], list[RandomDrive]]
    drives: int
    rounds: int = 5

    @cached_property
    def choices(self) -> tuple[_Tolerance, ...]:
        """Tolerances that may be chosen, in the sequence of all arrays of shape (choices,)."""
        return tolerances(self.production.drive, self.production.law)

    @cached_property
    def bounds(self) -> Array:
        """Smallest and largest values, in the unit of each field, shape (2, choices)."""
        return np.array([(choice.least, choice.most) for choice in self.choices]).T

    def cheapest(self, turned: bool, start: Mapping[str, float] | None = None) -> Allocation:
        """Return the cheapest tolerances.

        If none are verified, return those of the attempt with the largest probability of the yield. Among equal
        attempts, the one with the largest share of drives within the limits is returned.

        turned: whether each wheel is turned to its best position.
        start: tolerances from which the search starts, by path; None for those of the preset.
        """
        values = np.array([start[choice.path] if start else choice.now for choice in self.choices])
        aim = _AIM
        records, tried = self._tried(turned, values, 0)
        attempts = [tried]
        for attempt in range(1, self.rounds + 1):
            # a linear model around the last drives gives the cheapest tolerances
            sought = self._sought(records, values, aim)
            # the search ends if the model gives the same tolerances again
            if np.all(np.abs(np.log(sought / values)) < _LIMIT_AGREES / 2):
                break
            values = sought
            records, tried = self._tried(turned, values, attempt)
            attempts.append(tried)
            ratio = self._ratio_of(records, values)(values)
            at_least = np.all(values <= self.bounds[0] * (1 + _LIMIT_AGREES))
            at_most = np.all(values >= self.bounds[1] * (1 - _LIMIT_AGREES))
            # the search stops if the tolerances are verified and near the limit, or at the ends of their bounds
            if (tried.fits and (ratio > aim - _LIMIT_AGREES or at_most)) or (at_least and not tried.fits):
                break
            # the random drives decide, not the model: if they do not verify the tolerances, the target becomes stricter
            aim *= 1.0 if tried.fits else _STRICTER
        # the cheapest attempt is returned because a later one may cost more
        verified = [allocation for allocation in attempts if allocation.fits]
        if verified:
            return min(verified, key=lambda allocation: allocation.cost)
        # the last of equal attempts has the smallest tolerances
        return max(reversed(attempts), key=lambda allocation: (allocation.probability.value, allocation.tried.share))

    def _tried(
        self,
        turned: bool,
        values: Array,
        attempt: int,
    ) -> tuple[list[RandomDrive], Allocation]:
        """Return the random drives with given tolerances, different at each attempt, and their allocation."""
        # tolerances that were found as assembled are verified in the best holes by other random drives
        attempt_number = attempt + (1 + self.rounds if turned else 0)
        chosen = dict(
            zip(
                self.choices,
                values.tolist(),
                strict=True,
            )
        )
        # with new random numbers each time, no set of drives is fitted by chance
        law = self.production.law.scaled({choice.path: value / choice.now for choice, value in chosen.items()})
        production = replace(
            self.production,
            law=law,
            mounting=turned,
            seed=self.production.seed + attempt_number,
        )
        records = self.records(production, self.drives)
        points = [AtTorque(M_g, room, 0.0) for M_g, room in zip(production.torques, self.rooms, strict=True)]
        summary = Summary(
            points=tuple(points),
            positions=len(production.rotations),
            wanted=self.wanted,
            sure=self.sure,
        )
        summary.add(records)
        tried = summary.yield_of(True)
        by_path = {choice.path: value for choice, value in chosen.items()}
        return records, Allocation(
            turned=turned,
            values=by_path,
            cost=self._cost(values),
            tried=tried,
            probability=tried.probability(self.wanted),
            verdict=summary.verdict,
        )

    def _sought(
        self,
        records: Sequence[RandomDrive],
        now: Array,
        aim: float,
    ) -> Array:
        """Return the cheapest tolerances with which the drives, with scaled sizes, stay below an aim.

        If no tolerances achieve the aim, the smallest ones are returned.
        """
        low, high = np.log(self.bounds)
        ratio = self._ratio_of(records, now)

        def left(x: Array) -> float:
            """Return the logarithm of the aim over the ratio, for logarithms of tolerances."""
            return float(-np.log(ratio(np.exp(np.clip(x, low, high))) / aim))

        if left(low) <= 0:
            return np.asarray(np.exp(low))
        if left(high) >= 0:  # each tolerance costs least at its upper bound
            return np.asarray(np.exp(high))
        # quantiles over drives have kinks, so the method must not need derivatives
        cheapest = minimize(
            lambda x: self._cost(np.exp(x)),
            np.clip(np.log(now), low, high),
            bounds=list(zip(low, high, strict=True)),
            constraints={"type": "ineq", "fun": left},
            method="COBYLA",
            options={"rhobeg": _FIRST_STEP, "tol": _LAST_STEP},
        )
        # all tolerances are scaled by one factor until the aim is just achieved
        span = float(np.max(high - low))
        shift = brentq(lambda of_all: left(cheapest.x + of_all), -span, span, xtol=_LAST_STEP / 10)
        return np.asarray(np.exp(np.clip(cheapest.x + shift, low, high)))

    def _cost(self, values: Array) -> float:
        """Return the cost of tolerances, shape (choices,)."""
        return sum(choice.cost(value) for choice, value in zip(self.choices, values.tolist(), strict=True))

    def _ratio_of(self, records: Sequence[RandomDrive], now: Array) -> Callable[[Array], float]:
        """Return a function that gives F'_ior over its room at the governing torque for other tolerances.

        In most designs, the required share of the drives is below this ratio. The function scales the sizes of the
        drives to the tolerances, with F'_ior assumed to be linear in each size.

        records: drives solved with the present tolerances.
        now: present tolerances, shape (choices,).
        Raises UntrustedError if no drive has a result.
        """
        is_solved = np.array([record.refused is None and record.tighter is not None for record in records])
        solved_records = [record for record, solved in zip(records, is_solved, strict=True) if solved]
        if not solved_records:
            message = f"none of {len(records)} drives has a result: {records[0].refused}"
            raise UntrustedError(message, "reduce the tolerances and ranges")
        F_ior = np.array([record.best_F_ior_arcsec for record in solved_records])
        slopes = self._slopes(solved_records, F_ior)
        design_of_record = np.array([record.design for record in records])
        designs = np.unique(design_of_record)
        weights = np.array([self.production.designs[design][1] for design in designs])

        def ratio(values: Array) -> float:
            """Return F'_ior over its room with other tolerances, shape (choices,)."""
            change = np.einsum("p,dpt->dt", values / now - 1, slopes)
            scaled = np.maximum(F_ior + change, _LEAST_SHARE_LEFT * F_ior)
            ratios = np.full(len(records), _UNSOLVED_RATIO)
            ratios[is_solved] = np.max(np.maximum(scaled, RESOLVED_ERROR) / np.array(self.rooms), axis=1)
            ratios_of_designs = [
                float(
                    np.quantile(
                        ratios[design_of_record == design],
                        self.wanted,
                        method="hazen",
                    )
                )
                for design in designs
            ]
            return weighted_quantile(np.array(ratios_of_designs), weights, self.sure)

        return ratio

    def _slopes(self, records: Sequence[RandomDrive], F_ior: Array) -> Array:
        """Return the change of F'_ior by the relative change of each tolerance [arcsec].

        The shape is (drives, choices, torques). Sizes whose bound is assumed from a tolerance change with it.

        records: drives with a step of each size.
        F_ior: F'_ior of these drives [arcsec], shape (drives, torques).
        """
        law = self.production.law
        decreases = {}
        for path in law.sizes:
            decreases[path] = F_ior - np.array([(record.tighter or {})[path] for record in records])
        by_choice = []
        for choice in self.choices:
            following = (decreases[path] for path in law.following(choice.path))
            by_choice.append(sum(following, decreases[choice.path]))
        return np.stack(by_choice, axis=1) / (1 - TIGHTER_STEP)
