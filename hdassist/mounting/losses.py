"""Positions of the fixed wheel over draws of F'_ior: which is best, how sure that is, and what a wrong one loses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hdassist.model.deviations import standing_offset
from hdassist.model.geometry import Array
from hdassist.mounting.positions import Chances, Choice, Position, hole_of, phase_deg, rotated
from hdassist.mounting.robust import Criterion, share_best
from hdassist.preset.fields import Drive

GOOD = 0.05  # loss against the best position below which a position is as good


@dataclass(frozen=True, eq=False)
class Losses:
    """Positions that may be chosen, over draws that are all alike likely.

    rotations_deg; F_ior_arcsec at the torques that decide, shape (torques, draws, positions), and now_arcsec, at
    rotation 0, shape (torques, draws); criterion over the losses; weights of the torques.
    """

    rotations_deg: tuple[float, ...]
    F_ior_arcsec: Array
    now_arcsec: Array
    criterion: Criterion
    weights: tuple[float, ...] | None = None

    def at(self, place: int | None) -> Array:
        """F'_ior [arcsec] in one of the positions, None: at rotation 0, shape (torques, draws)."""
        return self.now_arcsec if place is None else self.F_ior_arcsec[:, :, place]

    def position(self, drive: Drive, cam_deg: float, place: int | None) -> Position:
        """One of the positions, with the F'_ior expected there, of a drive whose standing offset points to cam_deg."""
        rotation = 0.0 if place is None else self.rotations_deg[place]
        turned = rotated(drive.with_values({standing_offset(drive)[1]: cam_deg}), rotation)
        expected = tuple(self.at(place).mean(axis=1).tolist())
        return Position(rotation, phase_deg(turned), hole_of(rotation, drive.mounting.holes), expected)

    def choice(self, drive: Drive, cam_deg: float) -> Choice:
        """The best position beside the others, at the torques of the drive; cam_deg as in position."""
        ranked = tuple(self.position(drive, cam_deg, place) for place in self.ranked)
        current = next((p for p in ranked if not p.rotation_deg), self.position(drive, cam_deg, None))
        torques, turn = tuple(drive.operation.M_g), bool(ranked[0].rotation_deg)
        return Choice(drive, torques, current, ranked[0], turn, ranked)

    @cached_property
    def merits(self) -> Array:
        """Greatest over the torques of F'_ior against the least over the positions, by weights.

        Shape (draws, positions). Where the wheel stands now plays no part.
        """
        return self._merit(self.F_ior_arcsec)

    def _merit(self, F_ior: Array) -> Array:
        share = np.ones(len(F_ior)) if self.weights is None else np.array(self.weights) / max(self.weights)
        least = self.F_ior_arcsec.min(axis=2, keepdims=True)
        return np.asarray(np.max(F_ior / least * share[:, None, None], axis=0))

    @cached_property
    def losses(self) -> Array:
        """What each position loses against the best one, as a share of the error there, shape (draws, positions)."""
        return np.asarray(self.merits / self.merits.min(axis=1, keepdims=True) - 1)

    @cached_property
    def expected_loss(self) -> Array:
        """Mean of the losses, shape (positions,)."""
        return np.asarray(self.losses.mean(axis=0))

    @cached_property
    def probability_good(self) -> Array:
        """Probability of each position to lose less than GOOD, shape (positions,)."""
        return np.asarray((self.losses < GOOD).mean(axis=0))

    @cached_property
    def probability_best(self) -> Array:
        """Probability of each position to be the best one, shape (positions,)."""
        return share_best(self.merits)

    @cached_property
    def ranked(self) -> list[int]:
        """Places of the positions, best first by the criterion."""
        return [int(place) for place in self.criterion.over(self.losses).argsort(kind="stable")]

    @property
    def best(self) -> int:
        """Which of the positions is the choice."""
        return self.ranked[0]

    @property
    def chances(self) -> Chances:
        """How sure the choice is."""
        best = self.probability_best
        current = float(best[self.rotations_deg.index(0.0)]) if 0.0 in self.rotations_deg else None
        gain = float(np.mean(self.merits[:, self.best] < self._merit(self.now_arcsec[..., None])[:, 0]))
        return Chances(len(self.merits), float(best[self.best]), current, gain)
