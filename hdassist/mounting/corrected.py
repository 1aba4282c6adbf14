"""Positions of the fixed wheel where a stored correction, made in each of them, takes off the rest of the error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.belief.statistics import Probability, probability_of
from hdassist.mounting.losses import LEAST_TURNED_GAIN, PositionStatistics
from hdassist.verdict import Verdict, verdict_by_probability


@dataclass(frozen=True, eq=False)
class CorrectedPositions:
    """Range [arcsec] that a correction leaves in each position, over drives of the same weight.

    form: words for the correction; most: with all that the lines of the error do not have, which is known of one drive
    alone, and least: without it.
    """

    form: str
    most: PositionStatistics
    least: PositionStatistics

    @property
    def gain_probability(self) -> Probability | None:
        """That the best other position is left with less than the present one; None where there is no other."""
        place = self.most.challenger
        return None if place is None else self._probability(self._is_better(place, self.most, self.least))

    def order(self, needed: float) -> str:
        """Order by what is left: turn or leave, each with the probability that is needed, else none."""
        if not (gain := self.gain_probability):
            return "none"
        if verdict_by_probability(gain.value, needed) is Verdict.PASS:
            return "turn"
        better = [self._is_better(at, self.least, self.most) for at, turn in enumerate(self.most.rotations_deg) if turn]
        found = self._probability(np.any(better, axis=0))
        return "leave" if verdict_by_probability(found.value, needed) is Verdict.FAIL else "none"

    @staticmethod
    def _is_better(place: int, there: PositionStatistics, now: PositionStatistics) -> NDArray[np.bool_]:
        """Whether less is left there than now at each torque by more than LEAST_TURNED_GAIN, shape (drives,)."""
        return np.asarray(np.all(there.at(place) < (1 - LEAST_TURNED_GAIN) * now.now_arcsec, axis=0))

    def _probability(self, outcome: NDArray[np.bool_]) -> Probability:
        weights = self.most.sample_weights
        return probability_of(outcome, weights) if len(weights) > 1 else Probability(*map(float, [outcome[0]] * 3))
