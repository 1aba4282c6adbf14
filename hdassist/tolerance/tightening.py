"""Tolerances that are worth tightening, and the cheapest ones that reach a yield as surely as is asked.

Sensitivities: each sample is a random drive of a random design. The gain of a tolerance one step tighter is at most the
gain between the states of the present extremes; for the most promising tolerances all samples are solved again.

Allocation: a cost law is share (now/tolerance)^k. Random drives are solved with a set of tolerances; the change of each
drive's F'_ior by a step of each tolerance, taken as linear, gives a cheaper set; other random drives with that set
confirm or reject it, and the search is repeated from them until two sets agree.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize

from hdassist.belief.samples import Samples
from hdassist.belief.statistics import RESOLVED_ERROR, Probability, weighted_quantile
from hdassist.belief.steps import Influence, MeasurementGain, influences, measurements
from hdassist.errors import UntrustedError, Verdict
from hdassist.model.geometry import Array
from hdassist.preset.fields import DEVIATION_FIELDS, CostLaw, Drive
from hdassist.tolerance.production import TIGHTER_STEP, Production, ProductionLaw, RandomDrive
from hdassist.tolerance.yields import AtTorque, Summary, YieldBelief

_HIGH_SHARE = 0.95  # share of the drives below the percentile that is to become less
_RESAMPLES = 200
_ENDS = (0.05, 0.95)  # of the resampled values: the interval of a gain
_Records = Callable[[Production, int], list[RandomDrive]]
_LOOSER = 2.0  # times the preset's tolerance, at most
_TIGHTER = 0.1  # times it at least, where the preset gives no least value that can be made
_SLOPE_STEP = 0.1  # step of ln(tolerance) over which slopes are taken: it smooths drives that come and go
_AIM = 0.98  # share of the limit that the search aims at: a margin for the error of the linear model
_STRICTER = 0.93  # factor of the aim if the drives did not verify the tolerances found with it
_LIMIT_AGREES = 0.06  # margin to the limit that may remain, as a share of it
_UNSOLVED_RATIO = 1e6  # F'_ior over its room of a drive without an answer: beyond any limit
_LEAST_SHARE_LEFT = 1e-2  # share of F'_ior of a drive that remains whatever its sizes are scaled by


@dataclass(frozen=True)
class Tightened:
    """95th percentile of F'_ior [arcsec] at a torque now, and with a tolerance (by path) one STEP tighter.

    low, high: Monte Carlo interval of the percentile with the tighter tolerance.
    proven: whether F'_ior was searched again; otherwise it may be larger than `then`.
    """

    path: str
    now: float
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
        """Decrease of the percentile by the step, as a share of it."""
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
        """Return the decrease from the percentile now to another one [arcsec], as a share; 0 if there is no error."""
        return 1 - percentile / self.now if self.now else 0.0


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Gains of tightening, and contributions of inputs to the variance of F'_ior of a production.

    samples: samples of its random drives.
    worst: index of the governing torque (relative to its limit, if there are limits).
    tightened: gains at each torque, the largest first.
    influences: contributions at each torque.
    to_measure: measurements at the governing torque.
    drives, states, max_residual: of the certificate.
    """

    law: ProductionLaw
    samples: Samples
    worst: int
    tightened: tuple[tuple[Tightened, ...], ...]
    influences: tuple[tuple[Influence, ...], ...]
    to_measure: tuple[MeasurementGain, ...]
    drives: int
    states: int
    max_residual: float

    @property
    def first(self) -> Tightened:
        """The tolerance whose step takes most off at the worst torque."""
        return self.tightened[self.worst][0]

    @property
    def largest(self) -> Influence | None:
        """Input with the largest share of the variance at the worst torque; None if no share is computed."""
        return next(iter(self.influences[self.worst]), None)

    @property
    def is_worth_tightening(self) -> bool:
        """Whether a step of the first tolerance takes off anything for certain, and no field shared by all more."""
        # even the smallest gain of the interval has to be one
        if self.first.high >= self.first.now:
            return False
        return self.largest is None or self.largest.group in {way.path for way in self.tightened[self.worst]}


def _best_first(ways: Mapping[str, Sequence[Tightened]], torques: range) -> tuple[tuple[Tightened, ...], ...]:
    """Return the tightened sizes at each torque, the one that leaves the smallest F'_ior first."""
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
    """Return sensitivities of a production in which each drive has its own design, and the samples of the designs.

    records: function that returns a number of records of a production.
    Raises UntrustedError if a drive has no result.
    """
    law = production.law
    all_records = _sound(records(production, len(production.designs)))
    F_ior = np.array([record.F_ior_arcsec for record in all_records])
    weights = np.array([record.weight for record in all_records])
    # tolerances are ranked at the torque that needs them most
    worst = worst_torque(production.drive, samples)
    ways = {}
    for path in law.sizes:
        # solved with the drives themselves, at the states of their extremes
        then = np.array([(record.tighter or {})[path] for record in all_records])
        ways[path] = _tightened(
            path,
            F_ior,
            then,
            weights,
            proven=False,
        )
    # the estimate is a lower bound: the best size is solved anew until the best one is solved
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
        tightened=_best_first(ways, torques),
        influences=tuple(_influences_at(samples, torque) for torque in torques),
        to_measure=to_measure(law, samples, worst),
        drives=len(all_records),
        states=sum(record.states for record in all_records),
        max_residual=max(record.max_residual for record in all_records),
    )


def _best_size(ways: Mapping[str, Sequence[Tightened]], torque: int) -> str:
    """Return the path of the size whose step leaves least of F'_ior at a torque, by its place."""
    return min(ways, key=lambda path: ways[path][torque].then)


def _influences_at(samples: Samples, torque: int) -> tuple[Influence, ...]:
    """Return the influences at a torque, by its place; none if some sample has no error there."""
    return influences(samples, torque) if samples.F_ior_arcsec[:, torque].all() else ()


def _with_tighter(production: Production, path: str) -> Production:
    """Return a production of the same designs with one size a step smaller, which takes no further steps."""
    designs = []
    for values, weight in production.designs:
        designs.append(({**values, path: TIGHTER_STEP * values[path]}, weight))
    return replace(production, designs=tuple(designs), steps=False)


def worst_torque(drive: Drive, samples: Samples) -> int:
    """Return the place of the torque at which the 95th percentile of F'_ior is largest.

    It is taken as a share of the limit if all torques have one.

    samples of random drives, each of a design of its own.
    """
    # relative to the limits if every torque has one
    limits = [drive.limit(M_g) or 0.0 for M_g in samples.torques]
    now_arcsec = [weighted_quantile(column, samples.weights, _HIGH_SHARE) for column in samples.F_ior_arcsec.T]
    return int(np.argmax(np.array(now_arcsec) / (limits if all(limits) else 1)))


def to_measure(
    law: ProductionLaw,
    samples: Samples,
    torque: int,
) -> tuple[MeasurementGain, ...]:
    """Return the next measurements of a design, by the share of the spread of ln F'_ior that goes, the best first."""
    # only what all drives of a design share can be measured once
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
    """Return the gain of a step of a tolerance at each torque, from F'_ior now and then [arcsec].

    These have the shape (drives, torques).
    """
    # bootstrap over drives; the same drives now and then, so that their differences count
    resampled = np.random.default_rng(0).integers(0, len(F_ior), (_RESAMPLES, len(F_ior)))
    steps = []
    for before, after in zip(F_ior.T, then.T, strict=True):
        now_quantile, then_quantile = (weighted_quantile(values, weights, _HIGH_SHARE) for values in (before, after))
        gains = [
            weighted_quantile(before[rows], weights[rows], _HIGH_SHARE)
            - weighted_quantile(after[rows], weights[rows], _HIGH_SHARE)
            for rows in resampled
        ]
        # a large gain is a low percentile
        low, high = now_quantile - np.quantile(gains, _ENDS[::-1])
        steps.append(
            Tightened(
                path=path,
                now=now_quantile,
                then=then_quantile,
                low=float(low),
                high=float(high),
                proven=proven,
            )
        )
    return steps


@dataclass(frozen=True)
class _Tolerance:
    """A tolerance that may be chosen, by path: its value in the preset, its bounds, and its cost law.

    assumed_law: whether the preset gives no cost law.
    """

    path: str
    now: float
    least: float
    most: float
    law: CostLaw
    assumed_law: bool

    def cost(self, value: float) -> float:
        """Return the cost at a value, in the unit of the law's share."""
        return float(self.law.share * (self.now / value) ** self.law.k)


def tolerances(drive: Drive, law: ProductionLaw) -> tuple[_Tolerance, ...]:
    """Return the tolerances of a drive that may be chosen: sizes that are drawn up to a value of the preset."""
    choices = []
    for size in law.tolerances:
        cost = drive.cost.get(size.path)
        present = size.high
        # what the workshop can make, or a tenth of the present value
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
    """Tolerances, by path in the field's unit, their cost, and the yield of random drives with them.

    turned: whether each wheel is turned to its best position; tried: yield of drives other than those it was sought on;
    probability that it reaches the yield that is wanted, and the verdict on it.
    """

    turned: bool
    values: Mapping[str, float]
    cost: float
    tried: YieldBelief
    probability: Probability
    verdict: Verdict

    @property
    def fits(self) -> bool:
        """Whether the tolerances reach the yield as surely as is asked."""
        return self.verdict is Verdict.PASS


@dataclass(frozen=True)
class Allocator:
    """Search for the cheapest tolerances of a drive.

    production: production with designs, of records with steps.
    rooms: F'_ior [arcsec] that the limits allow at each torque.
    wanted: the yield as a share.
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
        """Tolerances that may be chosen: values of them are arrays in this order, shape (choices,)."""
        return tolerances(self.production.drive, self.production.law)

    @cached_property
    def bounds(self) -> Array:
        """Least and greatest values [the unit of each field], shape (2, choices)."""
        return np.array([(choice.least, choice.most) for choice in self.choices]).T

    def cheapest(self, turned: bool) -> Allocation:
        """Return the cheapest tolerances, with the wheel in its best position or not.

        If none are verified, those of the attempt with the greatest probability of the yield are returned, or of
        several such attempts those with the greatest share of drives within the limits.
        """
        # the search begins at the tolerances of the preset
        values = np.array([choice.now for choice in self.choices])
        aim = _AIM
        records, tried = self._tried(turned, values, 0)
        attempts = [tried]
        for attempt in range(1, self.rounds + 1):
            # cheapest by a linear model around the last drives
            sought = self._sought(records, values, aim)
            # the model asks for nothing new
            if np.all(np.abs(np.log(sought / values)) < _LIMIT_AGREES / 2):
                break
            values = sought
            records, tried = self._tried(turned, values, attempt)
            attempts.append(tried)
            ratio = self._ratio_of(records, values)(values)
            at_least = np.all(values <= self.bounds[0] * (1 + _LIMIT_AGREES))
            at_most = np.all(values >= self.bounds[1] * (1 - _LIMIT_AGREES))
            # verified and near the limit, or at the ends of the bounds
            if (tried.fits and (ratio > aim - _LIMIT_AGREES or at_most)) or (at_least and not tried.fits):
                break
            # random drives decide, not the model
            aim *= 1.0 if tried.fits else _STRICTER
        # of all attempts, as a later one may cost more
        verified = [allocation for allocation in attempts if allocation.fits]
        if verified:
            return min(verified, key=lambda allocation: allocation.cost)
        # the last of equal ones has the smallest tolerances
        return max(reversed(attempts), key=lambda allocation: (allocation.probability.value, allocation.tried.share))

    def _tried(
        self,
        turned: bool,
        values: Array,
        attempt: int,
    ) -> tuple[list[RandomDrive], Allocation]:
        """Return the random drives with given tolerances, other drives at each attempt, and their allocation."""
        chosen = dict(
            zip(
                self.choices,
                values.tolist(),
                strict=True,
            )
        )
        # other random numbers each time: no set of drives is fitted by chance
        law = self.production.law.scaled({choice.path: value / choice.now for choice, value in chosen.items()})
        production = replace(
            self.production,
            law=law,
            mounting=turned,
            seed=self.production.seed + attempt,
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
        cost = sum(choice.cost(value) for choice, value in chosen.items())
        return records, Allocation(
            turned=turned,
            values=by_path,
            cost=cost,
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
        """Return the cheapest tolerances for which drives, with sizes scaled, would stay below an aim.

        The least ones where none are.
        """
        low, high = np.log(self.bounds)
        share, k, first = np.array([(choice.law.share, choice.law.k, np.log(choice.now)) for choice in self.choices]).T
        ratio = self._ratio_of(records, now)

        def left(x: Array) -> float:
            return float(-np.log(ratio(np.exp(x)) / aim))

        if left(low) <= 0:
            return np.asarray(np.exp(low))
        cheapest = minimize(
            lambda x: float(np.sum(share * np.exp(k * (first - x)))),
            np.clip(np.log(now), low, high),
            jac=lambda x: -share * k * np.exp(k * (first - x)),
            bounds=list(zip(low, high, strict=True)),
            constraints={"type": "ineq", "fun": left},
            method="SLSQP",
            options={"eps": _SLOPE_STEP},
        )
        return np.asarray(np.exp(np.clip(cheapest.x, low, high)))

    def _ratio_of(self, records: Sequence[RandomDrive], now: Array) -> Callable[[Array], float]:
        """Return the function of F'_ior over its room by other tolerances, at the governing torque.

        The wanted share of the drives of most designs stays below this ratio.

        Arguments: drives as they were solved with the tolerances now. The result takes values of tolerances that the
        sizes of the drives are scaled to, F'_ior being taken as linear in each size.
        Raises UntrustedError: no drive has an answer.
        """
        is_solved = np.array([record.refused is None and record.tighter is not None for record in records])
        solved_records = [record for record, solved in zip(records, is_solved, strict=True) if solved]
        if not solved_records:
            raise UntrustedError(f"none of {len(records)} drives has a result: {records[0].refused}")
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
        """Return the change of F'_ior by the relative change of each tolerance, shape (drives, choices, torques).

        A tolerance takes with it the sizes whose bound is assumed from it.

        records: of drives, with a step of each size.
        F_ior: of these, shape (drives, torques) [arcsec].
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
