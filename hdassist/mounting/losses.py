"""Positions of the fixed wheel over samples of F'_ior: which is best, how sure that is, and what a wrong one loses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hdassist.belief.samples import Samples
from hdassist.belief.statistics import Probability, probability_of, weighted_quantile
from hdassist.errors import UsageError
from hdassist.model.deviations import standing_offset
from hdassist.model.geometry import Array
from hdassist.mounting.positions import Choice, Position, hole_of, merit, phase_deg, rotated
from hdassist.numerals import number_of
from hdassist.preset.fields import Drive

GOOD = 0.05  # loss against the best position below which a position is as good
LEAST_TURNED_GAIN = 0.01  # of the error: a smaller one is not worth a turn
TIE = 0.999  # of the merit: positions this near to the best of a sample share it


@dataclass(frozen=True)
class Criterion:
    """What decides over samples: a quantile of the losses, 1 for the worst, or their mean where there is none."""

    name: str
    quantile: float | None = None

    @classmethod
    def of(cls, text: str) -> Criterion:
        """Read expected, worst or quantile=0.9. Raises UsageError for anything else."""
        if text in ("expected", "worst"):
            return cls(text, 1.0 if text == "worst" else None)
        name, _, number = text.partition("=")
        quantile = number_of(number)
        if name != "quantile" or not 0 < quantile < 1:
            raise UsageError(f"invalid criterion {text!r}: expected, worst, or quantile=0.9")
        return cls(text, quantile)

    def over(self, losses: Array, weights: Array) -> Array:
        """One number a position from losses, shape (samples, positions), and weights of the samples."""
        if self.quantile is None:
            return np.asarray(weights @ losses / weights.sum())
        return np.array([weighted_quantile(each, weights, self.quantile) for each in losses.T])


@dataclass(frozen=True, eq=False)
class PositionStatistics:
    """Positions that may be chosen, over weighted samples.

    rotations_deg; F_ior_arcsec at the torques that decide, shape (torques, samples, positions), and now_arcsec, at
    rotation 0, shape (torques, samples); sample_weights, shape (samples,); criterion over the losses; weights of the
    torques; against_now: F'_ior counts against that at rotation 0 of its sample, else against the least of its sample,
    as where the wheel stands by chance.
    """

    rotations_deg: tuple[float, ...]
    F_ior_arcsec: Array
    now_arcsec: Array
    sample_weights: Array
    criterion: Criterion
    weights: tuple[float, ...] | None = None
    against_now: bool = False

    @classmethod
    def of(
        cls, samples: Samples, rotations_deg: tuple[float, ...], criterion: str, weights: tuple[float, ...] | None
    ) -> PositionStatistics:
        """Statistics of samples that were drawn at these rotations, against how the wheel stands."""
        columns = [samples.rotations_deg.index(each) for each in rotations_deg]
        F_ior = np.moveaxis(samples.turned_arcsec[..., columns], 0, 1)
        now, how = samples.F_ior_arcsec.T, Criterion.of(criterion)
        return cls(rotations_deg, F_ior, now, samples.weights, how, weights, against_now=True)

    def place(self, rotation_deg: float) -> int | None:
        """Which of the positions a rotation is, None where it is none."""
        return next((place for place, at in enumerate(self.rotations_deg) if abs(at - rotation_deg) < 1e-6), None)

    def at(self, place: int | None) -> Array:
        """F'_ior [arcsec] in one of the positions, None: at rotation 0, shape (torques, samples)."""
        return self.now_arcsec if place is None else self.F_ior_arcsec[:, :, place]

    def quantile(self, share: float, place: int | None) -> tuple[float, ...]:
        """Percentile of F'_ior [arcsec] in a position at each torque, by its share (0.95)."""
        return tuple(weighted_quantile(each, self.sample_weights, share) for each in self.at(place))

    def position(self, drive: Drive, cam_deg: float, place: int | None) -> Position:
        """One of the positions, with its median F'_ior, of a drive whose standing offset points to cam_deg."""
        rotation = 0.0 if place is None else self.rotations_deg[place]
        turned = rotated(drive.with_values({standing_offset(drive)[1]: cam_deg}), rotation)
        hole = hole_of(rotation, drive.mounting.holes)
        return Position(rotation, phase_deg(turned), hole, self.quantile(0.5, place))

    def choice(self, drive: Drive, cam_deg: float) -> Choice:
        """The best position beside the others, at the torques of the drive; cam_deg as in position."""
        ranked = tuple(self.position(drive, cam_deg, place) for place in self.ranked)
        current = next((p for p in ranked if not p.rotation_deg), self.position(drive, cam_deg, None))
        torques, turn = tuple(drive.operation.M_g), bool(ranked[0].rotation_deg)
        return Choice(drive, torques, current, ranked[0], turn, ranked)

    @cached_property
    def merits(self) -> Array:
        """F'_ior over what it counts against, for the torque served worst, by weights, shape (samples, positions)."""
        against = self.now_arcsec[:, :, None] if self.against_now else self.F_ior_arcsec.min(axis=2, keepdims=True)
        return merit(self.F_ior_arcsec / np.maximum(against, 1e-9), np.ones(len(self.F_ior_arcsec)), self.weights)

    @cached_property
    def losses(self) -> Array:
        """What each position loses against the best one, as a share of the error there, shape (samples, positions)."""
        return np.asarray(self.merits / self.merits.min(axis=1, keepdims=True) - 1)

    def _mean(self, values: Array) -> Array:
        """Weighted mean over the samples."""
        return np.asarray(self.sample_weights @ values / self.sample_weights.sum())

    @cached_property
    def expected_loss(self) -> Array:
        """Mean of the losses, shape (positions,)."""
        return self._mean(self.losses)

    @cached_property
    def probability_good(self) -> Array:
        """Probability of each position to lose less than GOOD, shape (positions,)."""
        return self._mean((self.losses < GOOD).astype(float))

    @cached_property
    def probability_best(self) -> Array:
        """Probability of each position to be the best one, ties shared, shape (positions,)."""
        first = self.losses <= 1 / TIE - 1
        return self._mean(first / first.sum(axis=1, keepdims=True))

    @cached_property
    def ranked(self) -> list[int]:
        """Places of the positions, best first by the criterion."""
        return [int(p) for p in self.criterion.over(self.losses, self.sample_weights).argsort(kind="stable")]

    @property
    def best(self) -> int:
        """Which of the positions is the choice."""
        return self.ranked[0]

    @property
    def chosen(self) -> tuple[float, float]:
        """The choice [deg], and the probability that it is good."""
        return self.rotations_deg[self.best], float(self.probability_good[self.best])

    @property
    def challenger(self) -> int | None:
        """The best position but that where the wheel stands, None where there is no other."""
        return next((place for place in self.ranked if self.rotations_deg[place]), None)

    def gains(self, place: int) -> Array:
        """Share of F'_ior at rotation 0 that a position takes off at the torque served worst, shape (samples,)."""
        return np.asarray(1 - (self.at(place) / np.maximum(self.now_arcsec, 1e-9)).max(axis=0))

    @property
    def best_gains(self) -> Array:
        """The same of the position that is best in each sample: what turning may bring at most, shape (samples,)."""
        rows = np.arange(len(self.merits))
        F_ior = self.F_ior_arcsec[:, rows, self.merits.argmin(axis=1)]
        return np.asarray(1 - (F_ior / np.maximum(self.now_arcsec, 1e-9)).max(axis=0))

    def range_of(self, values: Array) -> tuple[float, float, float]:
        """5th percentile, median and 95th percentile of values, shape (samples,)."""
        low, middle, high = (weighted_quantile(values, self.sample_weights, share) for share in (0.05, 0.5, 0.95))
        return low, middle, high

    def probability_gain(self, place: int) -> Probability:
        """Probability that a position is better than rotation 0 by more than LEAST_GAIN."""
        return probability_of(self.gains(place) > LEAST_TURNED_GAIN, self.sample_weights)

    def probability_close(self, place: int) -> Probability:
        """Probability that a position loses less than GOOD against the best one."""
        return probability_of(self.losses[:, place] < GOOD, self.sample_weights)

    @property
    def ratios(self) -> Array:
        """F'_ior of the worst position over that of the best one, shape (torques, samples)."""
        return np.asarray(self.F_ior_arcsec.max(axis=2) / self.F_ior_arcsec.min(axis=2))
