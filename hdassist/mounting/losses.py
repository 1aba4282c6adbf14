"""Positions of the fixed wheel over draws of F'_ior: which is best, how sure that is, and what a wrong one loses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hdassist.errors import UsageError
from hdassist.model.deviations import standing_offset
from hdassist.model.geometry import Array
from hdassist.mounting.positions import Chances, Choice, Position, hole_of, merit, phase_deg, rotated
from hdassist.numerals import number_of
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate

GOOD = 0.05  # loss against the best position below which a position is as good
TIE = 0.999  # of the merit: positions this near to the best of a draw share it


@dataclass(frozen=True)
class Criterion:
    """What decides over draws: the mean of the losses, the worst, or a quantile."""

    name: str
    quantile: float | None = None

    @classmethod
    def of(cls, text: str) -> Criterion:
        """Read expected, worst or quantile:0.9. Raises UsageError for anything else."""
        if text in ("expected", "worst"):
            return cls(text)
        name, _, number = text.partition(":")
        quantile = number_of(number)
        if name != "quantile" or not 0 < quantile < 1:
            raise UsageError(f"no criterion {text!r}", "expected, worst, or quantile:0.9")
        return cls(text, quantile)

    def over(self, losses: Array) -> Array:
        """One number a position from losses, shape (draws, positions)."""
        if self.quantile is not None:
            return np.asarray(np.quantile(losses, self.quantile, axis=0))
        return np.asarray(losses.mean(axis=0) if self.name == "expected" else losses.max(axis=0))


@dataclass(frozen=True, eq=False)
class Losses:
    """Positions that may be chosen, over draws that are all alike likely.

    rotations_deg; F_ior_arcsec at the torques that decide, shape (torques, draws, positions), and now_arcsec, at
    rotation 0, shape (torques, draws); criterion over the losses; weights of the torques; against_now: F'_ior counts
    against the mean of now_arcsec at its torque, as on a curve, else against the least of its draw, as where the wheel
    stands by chance; standard_error_arcsec of F'_ior that was interpolated, at each torque, empty where it was
    searched; certificate of what was solved for them.
    """

    rotations_deg: tuple[float, ...]
    F_ior_arcsec: Array
    now_arcsec: Array
    criterion: Criterion
    weights: tuple[float, ...] | None = None
    against_now: bool = False
    standard_error_arcsec: tuple[float, ...] = ()
    certificate: Certificate = EMPTY

    def place(self, rotation_deg: float) -> int | None:
        """Which of the positions a rotation is, None where it is none."""
        return next((place for place, at in enumerate(self.rotations_deg) if abs(at - rotation_deg) < 1e-6), None)

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
        """F'_ior over what it counts against, for the torque served worst, by weights, shape (draws, positions)."""
        return self._merits(self.F_ior_arcsec)

    def _merits(self, F_ior: Array) -> Array:
        least = self.F_ior_arcsec.min(axis=2, keepdims=True)
        against = self.now_arcsec.mean(axis=1)[:, None, None] if self.against_now else least
        return merit(F_ior / against, np.ones(len(F_ior)), self.weights)

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
        """Probability of each position to be the best one, ties shared, shape (positions,)."""
        first = self.losses <= 1 / TIE - 1
        return np.asarray((first / first.sum(axis=1, keepdims=True)).mean(axis=0))

    @cached_property
    def ranked(self) -> list[int]:
        """Places of the positions, best first by the criterion."""
        return [int(place) for place in self.criterion.over(self.losses).argsort(kind="stable")]

    @property
    def best(self) -> int:
        """Which of the positions is the choice."""
        return self.ranked[0]

    @property
    def chosen(self) -> tuple[float, float]:
        """The choice [deg], and the probability that it is good."""
        return self.rotations_deg[self.best], float(self.probability_good[self.best])

    @property
    def probability_gain(self) -> float:
        """Probability that the choice is better than rotation 0."""
        return float(np.mean(self.merits[:, self.best] < self._merits(self.now_arcsec[..., None])[:, 0]))

    @property
    def gain(self) -> float:
        """What the choice takes off the expected error at rotation 0, as a share, at the torque served worst."""
        return float(1 - merit(self.at(self.best).mean(axis=1), self.now_arcsec.mean(axis=1), self.weights))

    @property
    def ratios(self) -> Array:
        """F'_ior of the worst position over that of the best one, shape (torques, draws)."""
        return np.asarray(self.F_ior_arcsec.max(axis=2) / self.F_ior_arcsec.min(axis=2))

    @property
    def chances(self) -> Chances:
        """How sure the choice is."""
        best, now = self.probability_best, self.place(0.0)
        current = None if now is None else float(best[now])
        return Chances(len(self.merits), float(best[self.best]), current, self.probability_gain)
