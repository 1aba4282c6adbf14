"""Decision among the holes of the fixed wheel: expected losses, probabilities, and the gain of further measurements.

All results are computed from weighted samples of F'_ior in each hole, before or after measured values. An action is
always named, because a wheel must be mounted in some hole.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from hdassist.belief.evidence import LEAST_ERROR_RATIO, MISFITS, SCALE, SMOOTH_NUMBERS, smooth_misfits
from hdassist.belief.holes import (
    LEAST_GAIN,
    NO_ERROR,
    chosen_hole,
    governing_share,
    limits_met,
    losses_of,
    ranked_holes,
)
from hdassist.belief.samples import Samples
from hdassist.belief.statistics import (
    Probability,
    effective_number,
    even_rows,
    probability_by_share,
    probability_of,
    weighted_quantile,
)
from hdassist.drive.model.geometry import Array
from hdassist.features.mounting.positions import MountingCurve
from hdassist.run.errors import SURE, Verdict

GOOD = 0.05  # largest loss relative to the best hole at which a hole is considered equally good
WORTH = 0.02  # gain of one more value below which measuring stops, as a share of F'_ior
# smallest number of measured values before measuring may stop: after four values, the excess of hidden drives is larger
# than expected from the values (benchmarks.regret)
FEWEST_VALUES = 5
LEVELS = {"p5": 0.05, "p50": 0.5, "p95": 0.95}  # percentiles of a result by name
FEWEST_SURE = 32  # effective sample size below which the whole interval of the probability must meet the requirement

_OUTCOMES = 9  # number of outcomes of a further value considered in each hole
_LOOKED_AT = 512  # number of samples used to evaluate further values
_FUTURES = 64  # number of true drives for which several further values are simulated
_MOST_CANDIDATES = 24  # largest number of holes considered for a further value
_CHOSEN_SHARE = 0.02  # probability of being good above which a hole may still become the choice

Word = Literal["TURN", "LEAVE", "BEST_BET", "ANY_HOLE"]


@dataclass(frozen=True)
class _Action:
    """Mounting of the wheel in one hole, compared with the other holes.

    rotation_deg: rotation to the hole [deg].
    F_ior_arcsec: percentiles of F'_ior at each torque [arcsec], by name.
    expected_loss: expected loss relative to the best hole, as a share of F'_ior in that hole.
    probability_good: probability that the loss is less than GOOD.
    probability_better: probability that the hole is better than the present one by more than the cost of moving.
    probability_kept: probability that all limits are met; None without a limit.
    """

    rotation_deg: float
    F_ior_arcsec: dict[str, tuple[float, ...]]
    expected_loss: float
    probability_good: float
    probability_better: float
    probability_kept: float | None


@dataclass(frozen=True, eq=False)
class Decision:
    """The choice among holes of the fixed wheel, based on weighted samples.

    rotations_deg: rotations to the usable holes [deg].
    F_ior_arcsec: F'_ior in the holes [arcsec], shape (torques, samples, holes).
    now_arcsec: F'_ior at rotation 0 [arcsec], shape (torques, samples).
    sample_weights: weights, shape (samples,); there is a single sample for nominal values.
    room_arcsec: limit minus self error at each torque [arcsec]; None without a limit.
    cost: smallest relative reduction of F'_ior for which the wheel is moved.
    all_alike: whether the known inputs cannot distinguish the holes.
    worth: effective sample size of resampled samples; None for original samples.
    settled_deg: rotation to the hole that follows from a measured outcome [deg]; None without an outcome.
    samples: samples from which the probability of meeting limits is computed; None to use F_ior_arcsec.
    torque_places: indices of the torques of the decision among those of `samples`.
    sure: probability of meeting the limits from which the verdict is PASS.
    """

    rotations_deg: tuple[float, ...]
    F_ior_arcsec: Array
    now_arcsec: Array
    sample_weights: Array
    room_arcsec: Sequence[float | None] = ()
    cost: float = LEAST_GAIN
    all_alike: bool = field(default=False, kw_only=True)
    worth: float | None = field(default=None, kw_only=True)
    settled_deg: float | None = field(default=None, kw_only=True)
    samples: Samples | None = field(default=None, kw_only=True)
    torque_places: tuple[int, ...] = field(default=(), kw_only=True)
    sure: float = field(default=SURE, kw_only=True)

    @classmethod
    def of(
        cls,
        samples: Samples,
        rotations_deg: tuple[float, ...],
        room_arcsec: Sequence[float | None] = (),
        sure: float = SURE,
    ) -> Decision:
        """Return the decision at all torques of the samples, based on the first samples.

        Probabilities of meeting limits are computed from as many samples as they need.

        samples: samples with F'_ior at these rotations.
        rotations_deg: rotations to the usable holes [deg].
        room_arcsec: limit minus self error at each torque [arcsec]; None without a limit.
        sure: probability of meeting the limits from which the verdict is PASS.
        """
        first = samples.of_ranges
        columns = [samples.rotations_deg.index(turn) for turn in rotations_deg]
        F_ior = np.moveaxis(first.turned_arcsec[..., columns], 0, 1)
        places = tuple(range(len(samples.torques)))
        return cls(
            rotations_deg,
            F_ior,
            first.F_ior_arcsec.T,
            first.weights,
            room_arcsec,
            samples=samples,
            torque_places=places,
            sure=sure,
        )

    @classmethod
    def as_given(cls, curve: MountingCurve, room_arcsec: Sequence[float | None] = ()) -> Decision:
        """Return the decision for nominal values, from the curve of F'_ior over the positions of the wheel."""
        usable = np.flatnonzero(curve.usable)[np.argsort(curve.rotation_deg[curve.usable])]
        rotations = tuple(curve.rotation_deg[usable].tolist())
        F_ior = curve.F_ior_arcsec[:, None, usable]
        return cls(rotations, F_ior, curve.F_ior_arcsec[:, :1], np.ones(1), room_arcsec)

    @property
    def is_sampled(self) -> bool:
        """Whether the decision is based on several samples, and not on nominal values."""
        return len(self.sample_weights) > 1

    @property
    def effective(self) -> float:
        """Effective sample size."""
        return self.worth or effective_number(self.sample_weights)

    # Holes and F'_ior in them

    def place(self, rotation_deg: float) -> int | None:
        """Return the index of the usable hole at a rotation; None if there is none."""
        for place, hole_deg in enumerate(self.rotations_deg):
            if abs(hole_deg - rotation_deg) < 1e-6:
                return place
        return None

    @property
    def stay(self) -> int | None:
        """Index of the present hole of the wheel; None if this hole is not usable."""
        return self.place(0.0)

    def at(self, place: int | None) -> Array:
        """Return F'_ior in a hole [arcsec], shape (torques, samples).

        place: index of the hole; None for rotation 0.
        """
        return self.now_arcsec if place is None else self.F_ior_arcsec[:, :, place]

    def quantile(self, share: float, place: int | None) -> tuple[float, ...]:
        """Return a percentile of F'_ior in a hole at each torque [arcsec].

        If the known inputs cannot distinguish the holes, the result is that of the present hole, because the samples of
        the holes differ only by chance.

        share: quantile level, for example 0.95.
        place: index of the hole; None for rotation 0.
        """
        if self.all_alike and self.samples:  # `check` prints the same percentiles
            return tuple(self.samples.of_ranges.percentile(share, torque) for torque in self.torque_places)
        F_ior = self.now_arcsec if self.all_alike else self.at(place)
        return tuple(weighted_quantile(at_torque, self.sample_weights, share) for at_torque in F_ior)

    def standard_errors(self, share: float, place: int | None) -> tuple[float, ...]:
        """Return the Monte Carlo standard error of a percentile of F'_ior in a hole at each torque [arcsec].

        It is half the difference between the percentiles at one standard error above and below the quantile level. It
        is 0 for nominal values.

        share: quantile level, for example 0.95.
        place: index of the hole; None for rotation 0.
        """
        if not self.is_sampled:
            return tuple(0.0 for _ in self.F_ior_arcsec)
        step = np.sqrt(share * (1 - share) / self.effective)
        low_ends = self.quantile(max(share - step, 0.0), place)
        high_ends = self.quantile(min(share + step, 1.0), place)
        return tuple((high - low) / 2 for low, high in zip(low_ends, high_ends, strict=True))

    def range_of(self, values: Array) -> tuple[float, float, float]:
        """Return the 5th percentile, median and 95th percentile of values, shape (samples,)."""
        low, middle, high = (weighted_quantile(values, self.sample_weights, share) for share in LEVELS.values())
        return low, middle, high

    # How good each hole is

    def served_at(self, F_ior_arcsec: Array) -> Array:
        """Return the ratio of F'_ior to its mean over all holes at the governing torque, shape (samples, ...).

        The mean over all holes is the reference because it does not favour the present hole.

        F_ior_arcsec: F'_ior [arcsec], shape (torques, samples, ...).
        """
        return governing_share(F_ior_arcsec, self.F_ior_arcsec)

    @cached_property
    def served(self) -> Array:
        """Ratio of F'_ior in each hole to its mean over all holes at the governing torque, shape (samples, holes)."""
        return self.served_at(self.F_ior_arcsec)

    @cached_property
    def losses(self) -> Array:
        """Loss of each hole relative to the best one at the governing torque, as a share, shape (samples, holes)."""
        return losses_of(self.served)

    @cached_property
    def expected_loss(self) -> Array:
        """Mean loss of each hole over the samples, shape (holes,)."""
        return self._of_holes(self.losses)

    @cached_property
    def probability_good(self) -> Array:
        """Probability that the loss of each hole is less than GOOD, shape (holes,)."""
        return self._of_holes(self.losses < GOOD)

    def _of_holes(self, values: NDArray[Any]) -> Array:
        """Return the means of values over the samples, shape (holes,); equivalent holes get a common mean.

        values: values for each sample and hole, shape (samples, holes).
        """
        means = np.average(
            values,
            axis=0,
            weights=self.sample_weights,
        )
        return np.full_like(means, means.mean()) if self.all_alike else means

    def gains(self, place: int) -> Array:
        """Return the smallest relative reduction of F'_ior in a hole over all torques, shape (samples,).

        The reduction is relative to F'_ior at rotation 0.

        place: index of the hole.
        """
        return np.asarray((1 - self.F_ior_arcsec[:, :, place] / np.maximum(self.now_arcsec, NO_ERROR)).min(axis=0))

    def is_better(self, place: int) -> NDArray[np.bool_]:
        """Return whether a hole is better than rotation 0 by more than the cost of moving, shape (samples,)."""
        return np.asarray(self.served[:, place] < (1 - self.cost) * self.served_at(self.now_arcsec))

    def probability_better(self, place: int) -> float:
        """Return the probability that a hole is better than the present one by more than the cost of moving.

        Equivalent holes get their mean probability.
        """
        places = [place]
        if self.all_alike and place != self.stay:
            places = [place for place in range(len(self.rotations_deg)) if place != self.stay]
        probabilities = [float(np.average(self.is_better(hole), weights=self.sample_weights)) for hole in places]
        return sum(probabilities) / len(probabilities)

    @cached_property
    def probability_kept(self) -> Array | None:
        """Probability that the limits at all torques are met, for each hole, shape (holes,); None without limits.

        It is computed from the same samples as in `check`. Equivalent holes have the probability of the present hole.
        """
        kept = limits_met(self.F_ior_arcsec, self.room_arcsec)
        if kept is None:
            return None
        if not self.samples:
            return np.average(kept, axis=0, weights=self.sample_weights)
        return np.array([self._probability_in(place) for place in range(len(self.rotations_deg))])

    def _probability_in(self, place: int) -> float:
        """Return the probability that all limits are met in a hole, from as many samples as the verdict needs."""
        assert self.samples

        def met(F_ior_arcsec: Array) -> Array:
            is_met = limits_met(np.moveaxis(F_ior_arcsec, -1, 0)[list(self.torque_places)], self.room_arcsec)
            assert is_met is not None
            return is_met

        if self.all_alike:
            return self.samples.probability_of_sets(met, self.sure).value
        column = self.samples.rotations_deg.index(self.rotations_deg[place])
        return self.samples.probability(lambda samples: met(samples.turned_arcsec[..., column]), self.sure).value

    # The choice

    @cached_property
    def ranked(self) -> list[int]:
        """Indices of the holes, the best first: by probability of meeting limits (to a hundredth), then by loss."""
        return ranked_holes(self.expected_loss, self.probability_kept)

    @property
    def worst(self) -> int:
        """Index of the hole with the largest expected loss, which need not be the least likely to meet limits."""
        return int(np.argmax(self.expected_loss))

    @property
    def best(self) -> int:
        """Index of the recommended hole, which is the present hole unless the expected gain exceeds the cost of moving.

        A hole that follows from a measured outcome takes precedence.
        """
        settled = None if self.settled_deg is None else self.place(self.settled_deg)
        if settled is not None:
            return settled
        if self.all_alike and self.stay is not None:
            return self.stay
        return chosen_hole(self.expected_loss, self.probability_kept, self.stay, self.cost)

    @property
    def challenger(self) -> int | None:
        """Index of the best hole other than the present one; None if there is no other hole."""
        return next((place for place in self.ranked if self.rotations_deg[place]), None)

    @property
    def outcome(self) -> NDArray[np.bool_]:
        """Whether the choice is right in each sample, shape (samples,).

        Moving the wheel is right if the hole is better than the present one by more than the cost. If the present hole
        is not usable, it is right if the loss of the chosen hole is below GOOD. Staying is right if the best other hole
        is not better by more than the cost.
        """
        if self.stay is None:
            return np.asarray(self.losses[:, self.best] < GOOD)
        if self.best != self.stay:
            return self.is_better(self.best)
        challenger = self.challenger
        return np.ones(len(self.sample_weights), bool) if challenger is None else ~self.is_better(challenger)

    @property
    def probability(self) -> Probability:
        """Probability that the choice is right, with its Monte Carlo interval."""
        if not self.is_sampled:
            value = float(self.outcome[0])
            return Probability(value, value, value)
        if self.worth is None:
            return probability_of(self.outcome, self.sample_weights)
        probability = probability_by_share(float(self.outcome.mean()), self.worth)
        return replace(probability, few=self.worth < FEWEST_SURE)

    def is_sure(self, sure: float = SURE) -> bool:
        """Return whether the choice is right with at least a given probability.

        With few samples, the whole interval of the probability must meet this requirement.
        """
        return self.probability.verdict(sure) is Verdict.PASS

    def word(self, sure: float = SURE) -> Word:
        """Return the choice as one word.

        The word is ANY_HOLE for equivalent holes, BEST_BET if the choice is right with less than the probability
        `sure`, and TURN or LEAVE in all other cases. Holes with equal losses are not equivalent if a limit makes it
        necessary to move the wheel.
        """
        has_to_turn = self.stay is not None and self.best != self.stay
        if self.all_alike or (np.ptp(self.expected_loss) < LEAST_GAIN and not has_to_turn):
            return "ANY_HOLE"
        if not self.is_sure(sure):
            return "BEST_BET"
        return "LEAVE" if self.best == self.stay else "TURN"

    def action(self, place: int) -> _Action:
        """Return the mounting in one hole, with its percentiles, expected loss and probabilities."""
        kept = self.probability_kept
        return _Action(
            rotation_deg=self.rotations_deg[place],
            F_ior_arcsec={name: self.quantile(share, place) for name, share in LEVELS.items()},
            expected_loss=float(self.expected_loss[place]),
            probability_good=float(self.probability_good[place]),
            probability_better=self.probability_better(place),
            probability_kept=None if kept is None else float(kept[place]),
        )

    def of_torque(self, torque: int) -> Decision:
        """Return the decision for one torque.

        torque: index of the torque.
        """
        return self.of_torques(slice(torque, torque + 1))

    def of_torques(self, some: slice) -> Decision:
        """Return the decision for some of the torques.

        some: slice of their indices.
        """
        F_ior = self.F_ior_arcsec[some]
        now_arcsec = self.now_arcsec[some]
        places = self.torque_places[some]
        room = self.room_arcsec[some]
        return replace(
            self,
            F_ior_arcsec=F_ior,
            now_arcsec=now_arcsec,
            room_arcsec=room,
            torque_places=places,
        )


# --- gain of further values


@dataclass(frozen=True)
class MeasurementValue:
    """The next value to measure, and the F'_ior that is expected after further measured values.

    rotation_deg: rotation to the hole of the next value [deg].
    M_g: torque of the next value [N*m].
    F_ior_arcsec: expected F'_ior in the hole that would be chosen now, after one more value, after two, and so on
        [arcsec]. If one torque decides, it is F'_ior at that torque, regardless of the torque of the values. If several
        torques decide, it is F'_ior at the torque of the values, scaled by the ratio at the governing torque.
    """

    rotation_deg: float
    M_g: float
    F_ior_arcsec: tuple[float, ...]

    @property
    def gain_arcsec(self) -> float:
        """Expected gain of one more value [arcsec]."""
        return self.F_ior_arcsec[0] - self.F_ior_arcsec[1]

    def is_worth(self, worth: float = WORTH) -> bool:
        """Return whether the expected gain of one more value is at least the given share of F'_ior."""
        return self.gain_arcsec >= worth * self.F_ior_arcsec[0]


def value_of_measurement(
    decision: Decision,
    measured_arcsec: Mapping[float, Array],
    noise_arcsec: Array,
    *,
    steps: int = 3,
    first: Sequence[float] = (),
    seed: int = 0,
) -> MeasurementValue:
    """Return the hole and torque to measure next, and the F'_ior expected after that value and after further ones.

    Each value is measured in the hole and at the torque that are expected to reduce the loss of the hole chosen
    afterwards most (knowledge gradient). Each sample in turn is the true drive, and its simulated values reweight the
    other samples. One value is simulated for _LOOKED_AT true drives, and further values for _FUTURES of them.

    Args:
        decision: choice among holes, over weighted samples.
        measured_arcsec: F'_ior of each sample in each hole [arcsec], shape (samples, holes), by the torque [N*m] of
            possible values; the reference torque comes first.
        noise_arcsec: standard deviation of a value [arcsec], shape (samples,).
        steps: number of further values.
        first: rotations at which the first values are measured in any case [deg].
        seed: seed of the simulation.
    """
    simulation = _Simulation.of(decision, measured_arcsec, noise_arcsec, np.random.default_rng(seed))
    planned = [simulation.nearest_hole(rotation) for rotation in first]
    if not planned:
        planned = [simulation.best_candidate(simulation.prior)]
    repeated = even_rows(simulation.prior, _FUTURES)  # true drives for which all steps are simulated
    one_step = []  # F'_ior now and after one value, for every true drive
    excess_arcsec = []  # excess over the best hole after two and more values, for the drives in `repeated`
    for truth in range(_LOOKED_AT):
        is_repeated = truth in repeated
        expected = simulation.played(truth, planned, steps if is_repeated else 1)
        one_step.append(expected[:2])
        if is_repeated:
            excess_arcsec.append(np.array(expected[2:]) - simulation.least_arcsec[truth])
    # control variate: the excess over the best hole varies little, so a few true drives are sufficient
    F_ior_now, after_one = np.mean(one_step, axis=0)
    after_more = simulation.least_arcsec.mean() + np.mean(excess_arcsec, axis=0)
    # a further value never increases the expected F'_ior, so an increase is a simulation error
    expected_arcsec = np.minimum.accumulate([F_ior_now, after_one, *after_more])
    torque_index, hole = divmod(planned[0], len(decision.rotations_deg))
    return MeasurementValue(
        rotation_deg=decision.rotations_deg[hole],
        M_g=list(measured_arcsec)[torque_index],
        F_ior_arcsec=tuple(expected_arcsec.tolist()),
    )


def _candidate_holes(losses: Array) -> NDArray[np.int64]:
    """Return the indices of evenly spaced holes that may still become the choice, to be considered for a value.

    losses: losses of equally weighted samples in each hole, shape (samples, holes).
    """
    holes = losses.shape[1]
    even_holes = np.linspace(0, holes, min(holes, _MOST_CANDIDATES), endpoint=False).astype(int)
    good_share = (losses[:, even_holes] < GOOD).mean(axis=0)
    may_be_chosen = good_share >= min(_CHOSEN_SHARE, good_share.max())
    return np.asarray(even_holes[may_be_chosen])


@dataclass(frozen=True, eq=False)
class _Simulation:
    """Equally weighted samples with which further values are simulated.

    A place is a pair of a torque and a hole; all holes of the first torque come first.
    """

    rotations_deg: Array
    losses: Array  # losses of each hole, shape (samples, holes)
    F_ior_arcsec: Array  # F'_ior in each place, shape (samples, places)
    governing_arcsec: Array  # F'_ior in each hole at the governing torque, shape (samples, holes)
    noise_arcsec: Array  # standard deviation of a value, shape (samples,)
    candidates: NDArray[np.int64]  # places to consider for a value
    readings: Array  # value of each sample in each candidate, with noise, shape (candidates, samples)
    order: NDArray[np.int64]  # indices that sort the readings of each candidate
    rng: np.random.Generator

    @classmethod
    def of(
        cls,
        decision: Decision,
        measured_arcsec: Mapping[float, Array],
        noise_arcsec: Array,
        rng: np.random.Generator,
    ) -> _Simulation:
        """Return the simulation of a decision; the arguments are those of `value_of_measurement`."""
        rows = even_rows(decision.sample_weights, _LOOKED_AT)
        holes = len(decision.rotations_deg)
        F_ior = np.hstack([by_hole[rows] for by_hole in measured_arcsec.values()])
        tried_holes = _candidate_holes(decision.losses[rows])
        candidates = np.add.outer(np.arange(0, F_ior.shape[1], holes), tried_holes).ravel()
        errors = rng.permutation(ndtri((np.arange(_LOOKED_AT) + 0.5) / _LOOKED_AT))  # stratified normal numbers
        noise = noise_arcsec[rows]
        readings = F_ior[:, candidates].T + noise * errors
        # with one torque, the scaled ratio is F'_ior itself
        has_several_torques = len(decision.F_ior_arcsec) > 1
        level = F_ior[:, :holes] if has_several_torques else decision.F_ior_arcsec[0, rows]
        return cls(
            rotations_deg=np.array(decision.rotations_deg),
            losses=decision.losses[rows],
            F_ior_arcsec=F_ior,
            governing_arcsec=decision.served[rows] * level.mean(axis=1, keepdims=True),
            noise_arcsec=noise,
            candidates=candidates,
            readings=readings,
            order=np.argsort(readings, axis=1),
            rng=rng,
        )

    @property
    def prior(self) -> Array:
        """Weights before any value, shape (samples,)."""
        return np.full(_LOOKED_AT, 1 / _LOOKED_AT)

    @cached_property
    def least_arcsec(self) -> Array:
        """F'_ior in the best hole of each sample, shape (samples,)."""
        return np.asarray(self.governing_arcsec.min(axis=1))

    def nearest_hole(self, rotation_deg: float) -> int:
        """Return the index of the hole nearest to a rotation, at the first torque."""
        turn = (self.rotations_deg - rotation_deg + 180) % 360 - 180
        return int(np.argmin(abs(turn)))

    def chosen_hole(self, weights: Array) -> int:
        """Return the hole with the smallest expected loss."""
        return int(np.argmin(weights @ self.losses))

    def best_candidate(self, weights: Array) -> int:
        """Return the candidate place whose value is expected to reduce the loss of the chosen hole most."""
        return int(self.candidates[np.argmax(self.expected_gains(weights))])

    def expected_gains(self, weights: Array) -> Array:
        """Return the expected gain of a value in each candidate, as a share of F'_ior, shape (candidates,).

        It is E[loss of the hole chosen now - loss of the hole chosen after the value], over _OUTCOMES quantiles of the
        value.
        """
        quantiles = (np.arange(_OUTCOMES) + 0.5) / _OUTCOMES
        cumulative = weights[self.order].cumsum(axis=1)
        picked = [
            row[np.searchsorted(total, quantiles * total[-1])]
            for row, total in zip(self.order, cumulative, strict=True)
        ]
        outcomes = np.take_along_axis(
            self.readings,
            np.array(picked),
            axis=1,
        )
        true = self.F_ior_arcsec[:, self.candidates].T
        residual = (outcomes[..., None] - true[:, None]) / self.noise_arcsec
        density = np.exp(-0.5 * residual**2) / self.noise_arcsec * weights  # shape (candidates, outcomes, samples)
        posterior_loss = density @ self.losses / np.maximum(density.sum(axis=2, keepdims=True), 1e-300)
        loss_of_chosen = posterior_loss[..., self.chosen_hole(weights)]
        return np.asarray((loss_of_chosen - posterior_loss.min(axis=2)).mean(axis=1))

    def played(
        self,
        truth: int,
        planned: Sequence[int],
        steps: int,
    ) -> list[float]:
        """Return F'_ior of a true drive [arcsec] in the holes chosen before any value, after one value, and so on.

        Args:
            truth: index of the sample that is the true drive.
            planned: places of the first values; later ones are measured where the expected gain is largest.
            steps: number of values.
        """
        weights = self.prior
        weights[truth] = 0  # exclude the true drive from the samples
        expected = [self.governing_arcsec[truth, self.chosen_hole(weights)]]
        for step in range(steps):
            place = planned[step] if step < len(planned) else self.best_candidate(weights)
            reading = self.F_ior_arcsec[truth, place] + self.noise_arcsec[truth] * self.rng.standard_normal()
            weights = self.reweighed(weights, place, reading)
            expected.append(self.governing_arcsec[truth, self.chosen_hole(weights)])
        return expected

    def reweighed(
        self,
        weights: Array,
        place: int,
        reading: float,
    ) -> Array:
        """Return the weights multiplied by the normal likelihood of a value in a place [arcsec], with sum 1."""
        residual = (reading - self.F_ior_arcsec[:, place]) / self.noise_arcsec
        log_likelihood = -0.5 * residual**2 - np.log(self.noise_arcsec)
        log_likelihood = np.where(weights > 0, log_likelihood, -np.inf)
        weights = weights * np.exp(log_likelihood - log_likelihood.max())
        return np.asarray(weights / weights.sum())


def as_measured(
    decision: Decision,
    number: int = _LOOKED_AT,
    seed: int = 0,
) -> Decision:
    """Return the decision based on resampled drives, to which a random scale and a smooth misfit are applied.

    The samples follow the model, from which real drives differ in this way (belief/evidence.py). If the known inputs
    cannot distinguish the holes, each drive is turned to a random hole.

    decision: decision based on samples of the model.
    number: number of drives.
    seed: seed of the random numbers.
    """
    rng = np.random.default_rng(seed)
    rows = even_rows(decision.sample_weights, number)
    count = len(decision.rotations_deg)
    whole_turn = np.allclose(decision.rotations_deg, 360 / count * np.arange(count))
    turns = rng.integers(count, size=number) if decision.all_alike and whole_turn else np.zeros(number, int)
    columns = (np.arange(count) + turns[:, None]) % count
    scale = 1 + SCALE * rng.standard_normal((number, 1))
    misfit = rng.choice(MISFITS, (number, 1))
    shown = []
    for F_ior in decision.F_ior_arcsec:
        f = F_ior[rows[:, None], columns]
        smooth = smooth_misfits(decision.rotations_deg, rng.standard_normal((number, SMOOTH_NUMBERS)))
        shown.append(np.maximum(f * scale + misfit * f.mean(axis=1, keepdims=True) * smooth, LEAST_ERROR_RATIO * f))
    F_ior_arcsec = np.array(shown)
    stay = decision.stay
    now_arcsec = decision.now_arcsec[:, rows] if stay is None else F_ior_arcsec[..., stay]
    return replace(
        decision, F_ior_arcsec=F_ior_arcsec, now_arcsec=now_arcsec, sample_weights=np.ones(number), samples=None
    )
