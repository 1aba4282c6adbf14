"""Positions of the fixed wheel over samples of F'_ior: which is best, how sure that is, and the loss by a wrong one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hdassist.belief.samples import Samples
from hdassist.belief.statistics import weighted_quantile
from hdassist.model.deviations import standing_offset
from hdassist.model.geometry import Array
from hdassist.mounting.decision import GOOD
from hdassist.mounting.positions import NO_ERROR, Choice, Position, hole_of, phase_deg, rotated
from hdassist.preset.fields import Drive

LEAST_TURNED_GAIN = 0.01  # of the error: a smaller one is not worth a turn


@dataclass(frozen=True, eq=False)
class PositionStatistics:
    """Positions that may be chosen, over weighted samples.

    rotations_deg; F_ior_arcsec at the torques that decide, shape (torques, samples, positions), and now_arcsec, at
    rotation 0, shape (torques, samples); sample_weights, shape (samples,); against_now: F'_ior counts against that at
    rotation 0 of its sample, else against the least of its sample, as where the wheel stands by chance.
    """

    rotations_deg: tuple[float, ...]
    F_ior_arcsec: Array
    now_arcsec: Array
    sample_weights: Array
    against_now: bool = False

    @classmethod
    def of(cls, samples: Samples, rotations_deg: tuple[float, ...]) -> PositionStatistics:
        """Statistics of samples that were drawn at these rotations, against how the wheel stands."""
        columns = [samples.rotations_deg.index(each) for each in rotations_deg]
        F_ior = np.moveaxis(samples.turned_arcsec[..., columns], 0, 1)
        return cls(rotations_deg, F_ior, samples.F_ior_arcsec.T, samples.weights, against_now=True)

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
        """F'_ior over what it counts against, for the torque served worst, shape (samples, positions)."""
        against = self.now_arcsec[:, :, None] if self.against_now else self.F_ior_arcsec.min(axis=2, keepdims=True)
        return np.asarray((self.F_ior_arcsec / np.maximum(against, NO_ERROR)).max(axis=0))

    @cached_property
    def losses(self) -> Array:
        """Loss of each position against the best one, as a share of the error there, shape (samples, positions)."""
        return np.asarray(self.merits / self.merits.min(axis=1, keepdims=True) - 1)

    @cached_property
    def expected_loss(self) -> Array:
        """Mean of the losses, shape (positions,)."""
        return np.average(self.losses, axis=0, weights=self.sample_weights)

    @cached_property
    def probability_good(self) -> Array:
        """Probability of each position to lose less than GOOD, shape (positions,)."""
        return np.average(self.losses < GOOD, axis=0, weights=self.sample_weights)

    @cached_property
    def ranked(self) -> list[int]:
        """Places of the positions, the least expected loss first."""
        return [int(p) for p in self.expected_loss.argsort(kind="stable")]

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
        return np.asarray(1 - (self.at(place) / np.maximum(self.now_arcsec, NO_ERROR)).max(axis=0))

    @property
    def best_gains(self) -> Array:
        """The same of the position that is best in each sample: the most that turning may bring, shape (samples,)."""
        return np.asarray(1 - self.merits.min(axis=1))

    def range_of(self, values: Array) -> tuple[float, float, float]:
        """5th percentile, median and 95th percentile of values, shape (samples,)."""
        low, middle, high = (weighted_quantile(values, self.sample_weights, share) for share in (0.05, 0.5, 0.95))
        return low, middle, high

    def is_better(self, place: int) -> NDArray[np.bool_]:
        """Whether a position is better than rotation 0 by more than LEAST_TURNED_GAIN, shape (samples,)."""
        return self.gains(place) > LEAST_TURNED_GAIN

    def is_close(self, place: int) -> NDArray[np.bool_]:
        """Whether a position loses less than GOOD against the best one, shape (samples,)."""
        return np.asarray(self.losses[:, place] < GOOD)

    @property
    def ratios(self) -> Array:
        """F'_ior of the worst position over that of the best one, shape (torques, samples)."""
        return np.asarray(self.F_ior_arcsec.max(axis=2) / self.F_ior_arcsec.min(axis=2))
