"""The outcome of a mounting against what the trials before it predict, and whether to keep it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from hdassist.errors import UntrustedError
from hdassist.trials.posterior import Posterior, posterior
from hdassist.trials.trial import Trial

SURPRISE = 0.975  # quantile of the prediction above which an outcome is a surprise
WORTH = 0.01  # of the error: going back for less is not worth it
SURE = 2.0  # standard deviations by which a value has to be worse where nothing explains it


@dataclass(frozen=True)
class Verification:
    """A measured outcome against its prediction: mean and 2.5 % and 97.5 % quantiles [arcsec] of one value.

    back_to: the position tried before to go back to [deg], None where the outcome's is to be kept; after, what is known
    with the outcome as one more trial, None where nothing explains them together.
    """

    trial: Trial
    expected_arcsec: float
    low_arcsec: float
    high_arcsec: float
    back_to: Trial | None
    after: Posterior | None

    @property
    def as_predicted(self) -> bool:
        """Whether the outcome lies between the quantiles."""
        return self.low_arcsec <= self.trial.F_ior_arcsec <= self.high_arcsec

    @property
    def keep(self) -> bool:
        """Whether to keep the position."""
        return self.back_to is None

    @property
    def stay_deg(self) -> float:
        """The position to be in [deg]."""
        return self.trial.rotation_deg if self.back_to is None else self.back_to.rotation_deg


def verify(known: Posterior, outcome: Trial) -> Verification:
    """Compare a measured outcome with what the trials before it predict.

    It is kept unless, with the outcome as one more trial, a position tried before is expected to lose less, over all
    torques that decide. Where nothing explains the outcome, its value alone is compared with the least measured one.
    """
    there = posterior(known.prior, known.trials, known.rig, [outcome.rotation_deg])
    place = known.prior.torques.index(known.rig.M_g)
    F_ior, spread = there.F_ior_arcsec[place, :, 0], there.spread_arcsec[:, 0]
    ends = float((F_ior - 9 * spread).min()), float((F_ior + 9 * spread).max())

    def quantile(level: float) -> float:
        return float(brentq(lambda value: norm.cdf(value, F_ior, spread) @ there.weight - level, *ends, xtol=1e-6))

    expected = float(there.weight @ F_ior)
    back, after = _back(known, outcome)
    return Verification(outcome, expected, quantile(1 - SURPRISE), quantile(SURPRISE), back, after)


def _back(known: Posterior, outcome: Trial) -> tuple[Trial | None, Posterior | None]:
    """The trial to go back to, and what is known with the outcome."""
    others = [trial for trial in known.trials if trial.rotation_deg != outcome.rotation_deg]
    trials, places = (*known.trials, outcome), [t.rotation_deg for t in (outcome, *others)]

    def learnt(rotations: Sequence[float]) -> Posterior:
        how = known.criterion.name
        return posterior(
            known.prior, trials, known.rig, rotations, criterion=how, deciding=known.deciding, weights=known.weights
        )

    try:
        after, loss = learnt(known.rotations_deg), learnt([*places, *known.rotations_deg]).expected_loss[: len(places)]
    except UntrustedError:
        numbers = [trial for trial in others if not trial.trace]  # a trace has seen a part of its F'_ior
        best = min(numbers, key=lambda t: t.F_ior_arcsec, default=None)
        noise = SURE * np.sqrt(2) * known.rig.noise_arcsec
        return best if best and best.F_ior_arcsec + noise < outcome.F_ior_arcsec else None, None
    place = int(np.argmin(loss))
    return others[place - 1] if place and loss[place] + WORTH < loss[0] else None, after
