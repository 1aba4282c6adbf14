"""The outcome of a mounting against what the trials before it predict."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.optimize import brentq
from scipy.stats import norm

from hdassist.analysis.offset_posterior import Posterior, posterior
from hdassist.analysis.trials import Trial

SURPRISE = 0.975  # quantile of the prediction above which an outcome is a surprise


@dataclass(frozen=True)
class Verification:
    """A measured outcome against its prediction: mean and 2.5 % and 97.5 % quantiles [arcsec] of one value.

    best_tried, the trial with the least value; keep: whether to keep the position, or to go back to that trial's.
    """

    trial: Trial
    expected_arcsec: float
    low_arcsec: float
    high_arcsec: float
    best_tried: Trial

    @property
    def as_predicted(self) -> bool:
        """Whether the outcome lies between the quantiles."""
        return self.low_arcsec <= self.trial.F_ior_arcsec <= self.high_arcsec

    @property
    def keep(self) -> bool:
        """Whether nothing better was tried."""
        return self.trial.F_ior_arcsec <= self.best_tried.F_ior_arcsec


def verify(known: Posterior, outcome: Trial) -> Verification:
    """Compare a measured outcome with what the trials before it predict."""
    there = posterior(known.prior, known.trials, known.rig, [outcome.rotation_deg])
    place = known.prior.torques.index(known.rig.M_g)
    F_ior, spread = there.F_ior_arcsec[place, :, 0], there.spread_arcsec[:, 0]
    ends = float((F_ior - 9 * spread).min()), float((F_ior + 9 * spread).max())

    def quantile(level: float) -> float:
        return float(brentq(lambda value: norm.cdf(value, F_ior, spread) @ there.weight - level, *ends, xtol=1e-6))

    best = min(known.trials, key=lambda t: t.F_ior_arcsec)
    return Verification(outcome, float(there.weight @ F_ior), quantile(1 - SURPRISE), quantile(SURPRISE), best)
