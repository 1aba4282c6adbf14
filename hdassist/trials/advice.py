"""Advice from trials: where to mount the fixed wheel when the direction of the cam offset is not known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations

import numpy as np
from scipy.special import chdtrc

from hdassist.belief.evidence import measured_errors
from hdassist.errors import UntrustedError, UsageError
from hdassist.mounting.losses import PositionStatistics
from hdassist.mounting.positions import Choice, hole_words, usable_positions
from hdassist.mounting.trial import TRIAL_HINT, Trial
from hdassist.preset.fields import Drive
from hdassist.run.run import Run
from hdassist.trials.posterior import (
    Draws,
    Prediction,
    drawn,
    learnt,
    likelier_torque,
    next_trial,
    prediction,
    require_effective,
    require_reachable,
    weeded,
)
from hdassist.trials.prior import TRIAL_EFFORT, Prior, Rig, TrialEffort, trial_prior

NEEDED = 0.9  # probability that the choice is good from which on the trials settle it
STABLE = 0.6  # probability that the choice is good which it has to keep without any one of the trials
SUSPECTED = 0.5  # probability of a value to be misread from which on it is named
OPEN = 40.0  # deg: a direction whose standard deviation is more is not known
FITTING_TRIALS = 3  # trials, which fit any drive: predictions of later ones are held against the drive as stated
ENOUGH_VALUES = 6  # in positions of their own: they tell the noise as a repeat does, if they agree with the model
FALSE_ALARM = 0.05
LEAST_RETURN = 0.01  # of the error: going back for less is not worth it
SURE_DEVIATIONS = 2.0  # standard deviations by which a value has to be worse where no sample explains it


@dataclass(frozen=True)
class TrialAdvice:
    """Result of trials: the choice, the next trial, and the prediction of each but the first.

    next: its position [deg], and the probability of a good choice that is expected after it; verifies: whether the last
    prediction is of the outcome of an advice, and the wheel stands there; explained: whether anything explains that,
    which then is the last trial too; needed: probability from which on it is settled; without: probability that the
    choice is good without each of the trials, empty of fewer than FEW; likelier_torque [N*m], at which values of which
    one is suspected are far more probable than at that of the rig.
    """

    prior: Prior
    trials: tuple[Trial, ...]
    draws: Draws
    losses: PositionStatistics
    next: tuple[float, float]
    predictions: tuple[Prediction, ...]
    verifies: bool = False
    explained: bool = True
    needed: float = NEEDED
    without: tuple[float, ...] = ()
    likelier_torque: float | None = None

    @property
    def drive(self) -> Drive:
        """The drive as stated."""
        return self.prior.drive

    @property
    def outcome(self) -> Prediction | None:
        """The outcome of an advice, against the prediction from the trials before it."""
        return self.predictions[-1] if self.verifies else None

    @property
    def back_to(self) -> Trial | None:
        """The trial to whose position to go back after an outcome: that which is expected to lose least, if less.

        Where no sample explains the outcome, measured values tell, if they are further apart than noise makes likely.
        """
        if not (here := self.outcome):
            return None
        others = [trial for trial in reversed(self.trials) if trial.rotation_deg != here.rotation_deg]
        least = min(others, key=self._lost, default=here)
        worth = LEAST_RETURN if self.explained else SURE_DEVIATIONS * 2**0.5 * self.prior.rig.noise_arcsec
        return least if self._lost(least) + worth < self._lost(here) else None

    def _lost(self, trial: Trial) -> float:
        """The expected loss in the position of a trial; where no sample explains the outcome, the measured value."""
        place = self.losses.place(trial.rotation_deg)
        if place is None:  # a hole that is not allowed
            return np.inf
        return float(self.losses.expected_loss[place]) if self.explained else trial.F_ior_arcsec

    @property
    def stay(self) -> tuple[float, float]:
        """The position to be in [deg], and the probability that it is good: after an outcome one that was tried."""
        if not (tried := self.back_to or self.outcome):
            return self.losses.chosen
        place = self.losses.place(tried.rotation_deg) if self.explained else None
        return tried.rotation_deg, 0.0 if place is None else float(self.losses.probability_good[place])

    @property
    def stable(self) -> float:
        """Probability that the choice is good which it has to keep without any one of the trials.

        Where the values came out unlike the preset's drive, one of them, the noise or the model is off, and no one says
        which: then no single value may carry the choice, and it has to keep all of the probability that is needed.
        """
        return self.needed if self.unlike_told else STABLE

    @property
    def hinges_on(self) -> Trial | None:
        """The trial without which the choice is least probable to be good, where that is less than `stable`."""
        if not self.without or self.outcome or min(self.without) >= self.stable:
            return None
        return self.trials[int(np.argmin(self.without))]

    @property
    def suspected(self) -> Trial | None:
        """The trial whose value is more probably misread than not."""
        misread = self.draws.misread
        return self.trials[int(np.argmax(misread))] if len(misread) and misread.max() > SUSPECTED else None

    @property
    def sure(self) -> bool:
        """Whether the position to be in is good with the probability needed, whichever of the trials is left out."""
        return self.stay[1] >= self.needed and self.hinges_on is None

    @property
    def settled(self) -> bool:
        """Whether that is so, and no trial has to be repeated."""
        return self.sure and self.to_repeat is None

    @property
    def unlike_told(self) -> bool:
        """Whether the values are off by more than they are in FALSE_ALARM of drives that are as the preset has them."""
        squares = [one.surprise**2 for one in self.predictions[FITTING_TRIALS - 1 :]]
        return bool(squares) and bool(chdtrc(len(squares), sum(squares)) < FALSE_ALARM)

    @property
    def to_repeat(self) -> Trial | None:
        """The trial to measure again where none was: fewer than ENOUGH_VALUES tell no noise without it.

        Of values unlike the preset's drive it is the most surprising one. Else, where a choice is probable enough from
        few values or not from more, that which is suspected, that the choice hinges on, or that of the chosen position.
        """
        if self.repeats:
            return None
        if self.unlike_told:
            return max(self.predictions[FITTING_TRIALS - 1 :], key=lambda one: abs(one.surprise))
        few = len(self.trials) < ENOUGH_VALUES
        if self.outcome or (self.stay[1] < self.needed if few else self.sure):
            return None
        chosen = (trial for trial in self.trials if trial.rotation_deg == self.stay[0])
        return self.suspected or self.hinges_on or next(chosen, self.trials[0])

    @property
    def to_measure_next(self) -> tuple[float, float | None]:
        """Position to measure next [deg], and the probability of a good choice expected after it, None for a repeat."""
        return (self.to_repeat.rotation_deg, None) if self.to_repeat else self.next

    @property
    def repeats(self) -> list[tuple[Trial, Trial]]:
        """Trials of one position, in pairs."""
        return [(a, b) for a, b in combinations(self.trials, 2) if a.rotation_deg == b.rotation_deg]

    @property
    def noise_arcsec(self) -> float:
        """Noise of a value by the trials."""
        return float(self.prior.rig.noise_arcsec * self.draws.noise.mean())

    @cached_property
    def offset(self) -> tuple[float, float, float, float]:
        """Offset that stands with the fixed wheel: size [um] and direction [deg], each with its standard deviation."""
        size, direction = self.prior.offset(self.draws.places)
        mean = np.exp(1j * np.radians(direction)).mean()  # its length is less the more the directions differ
        angles = np.degrees([np.angle(mean) % (2 * np.pi), np.sqrt(-2 * np.log(np.abs(mean)))]).tolist()
        return float(size.mean()), float(size.std()), angles[0], angles[1]

    @property
    def facing(self) -> tuple[float, float] | tuple[None, None]:
        """Its direction, and the standard deviation of that [deg]; None where it is open."""
        return self.offset[2:] if self.offset[3] < OPEN else (None, None)

    def where(self, rotation_deg: float) -> str:
        """A position in words."""
        return hole_words(rotation_deg, self.drive.mounting.holes)

    @property
    def choice(self) -> Choice:
        """The chosen position beside the others."""
        return self.losses.choice(self.drive, self.offset[2])


def advise_from_trials(
    drive: Drive,
    trials: Sequence[Trial],
    rig: Rig,
    *,
    outcome: Trial | None = None,
    needed: float = NEEDED,
    effort: TrialEffort = TRIAL_EFFORT,
    other_torques: Sequence[float] = (),
    run: Run = Run(),
) -> TrialAdvice:
    """Infer the cam offset from trials and choose the position of the fixed wheel, at the torques of the drive.

    Arguments: trials, measured on the rig, beside those that the preset has at its torque; outcome, a last one, that of
    an advice by the others; needed, probability that settles; effort and run as in trial_prior; other_torques beside
    those of the drive [N*m], at which trials that it does not show may have been measured. Raises what trial_prior
    does; UntrustedError: trials that the drive does not show, with the torque at which it would.
    """
    torques, positions = drive.operation.M_g, usable_positions(drive.mounting.holes, drive.mounting.allowed)
    trials = (*_of_preset(drive, rig, (*trials, outcome)), *trials)
    if not trials:
        raise UsageError(f"no trials at {rig.M_g:g} N·m: expected HOLE=VALUE, or measured.F_ior", TRIAL_HINT)
    every = (*trials, outcome) if outcome else trials
    if not drive.mounting.holes:
        positions = sorted({*positions, *(trial.rotation_deg for trial in every)})

    def enough(prior: Prior) -> bool:
        require_reachable(prior, trials)
        return drawn(weeded(prior, trials), trials, [0.0]).effective >= effort.effective

    at_torques = partial(trial_prior, drive, rig=rig, effort=effort, run=run)
    try:
        whole = at_torques(torques, enough=enough)
        prior = weeded(whole, every)
        teach = partial(learnt, prior, rotations_deg=positions, torques=torques)
        predictions = tuple(prediction(prior, every[:k], every[k]) for k in range(1, len(every)))
        try:
            draws, losses = teach(every)
            require_effective(prior, every, draws, effort.effective)
            # an outcome that is taken for misread does not count for its hole
            explained = not outcome or draws.misread[-1] <= SUSPECTED
        except UntrustedError:
            if not outcome:
                raise
            explained = False
        if not explained:
            draws, losses = teach(every := trials)
    except UntrustedError as fault:
        others = {*torques, *other_torques} - {rig.M_g}
        if not others or not (M_g := likelier_torque(at_torques(sorted(others)), trials)):
            raise
        words = f"measured at another torque? The trials fit {M_g:g} N·m far better than {rig.M_g:g} N·m"
        hint = f"--trial-torque {M_g:g}; if not, {fault.hint}"
        raise UntrustedError(f"{words}: {fault.message}", hint) from None
    without = () if outcome or len(every) < FITTING_TRIALS else _without_each(every, losses.best, teach)
    best = next_trial(draws, losses, rig.noise_arcsec, run.seed)
    found = TrialAdvice(prior, every, draws, losses, best, predictions, bool(outcome), explained, needed, without)
    return replace(found, likelier_torque=likelier_torque(whole, every)) if found.suspected else found


def _of_preset(drive: Drive, rig: Rig, given: Sequence[Trial | None]) -> list[Trial]:
    """Trials that the preset has as measured at the torque of the rig, without those that are given once more."""
    known = {(each.rotation_deg, each.F_ior_arcsec) for each in given if each}
    found = [Trial(e.rotation_deg, e.value, noise_arcsec=e.spread) for e in measured_errors(drive) if e.M_g == rig.M_g]
    return [each for each in found if (each.rotation_deg, each.F_ior_arcsec) not in known]


def _without_each(
    trials: Sequence[Trial], best: int, teach: Callable[[Sequence[Trial]], tuple[Draws, PositionStatistics]]
) -> tuple[float, ...]:
    """Probability that a choice, by its place, is good, without each of the trials; 0 where no sample explains them."""
    found = []
    for k in range(len(trials)):
        try:
            _, left = teach([*trials[:k], *trials[k + 1 :]])
            found.append(float(left.probability_good[best]))
        except UntrustedError:
            found.append(0.0)
    return tuple(found)
