"""Advice on the hole for the fixed wheel: a decision based on the preset and on measured values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from hdassist.belief.evidence import measured_errors
from hdassist.belief.holes import LEAST_GAIN
from hdassist.belief.prior import DrivePrior, beside_measured_teeth, prior_of
from hdassist.belief.proposals import TableEffort
from hdassist.belief.samples import EFFECTIVE_SAMPLES, Samples, drive_samples
from hdassist.belief.steps import Influence, influences_on
from hdassist.drive.error.cycle import LimitRooms, limits_left
from hdassist.drive.error.error_map import searchable
from hdassist.drive.error.extremes import DRAWN_STATES, FINE_STATES
from hdassist.drive.model.deviations import (
    MeasuredTeeth,
    Unknown,
    no_hole_better,
    standing_offset,
    unknown_turn,
    unknowns,
)
from hdassist.drive.model.geometry import Array, Kinematics
from hdassist.drive.preset.fields import Drive
from hdassist.drive.solve.answers import EMPTY, Certificate
from hdassist.drive.solve.loadcase import CrossCheck
from hdassist.features.mounting.decision import (
    FEWEST_VALUES,
    WORTH,
    Decision,
    MeasurementValue,
    Word,
    as_measured,
    value_of_measurement,
)
from hdassist.features.mounting.positions import (
    MountingCurve,
    Position,
    begun_curve,
    hole_of,
    is_searched,
    phase_deg,
    usable_positions,
)
from hdassist.features.mounting.posterior import (
    SAMPLES_A_TABLE,
    TRIAL_HINT,
    HolePosterior,
    HoleSamples,
    Trial,
    TrialSetup,
    hole_samples,
    in_order,
    likelier_torque,
    posterior_of,
)
from hdassist.run.errors import SURE, UntrustedError, UsageError
from hdassist.run.run import Run

_VerificationVerdict = Literal["KEEP", "GO_BACK", "MEASURE_AGAIN"]
_WORD_AFTER: dict[_VerificationVerdict, Word] = {"KEEP": "LEAVE", "GO_BACK": "TURN", "MEASURE_AGAIN": "BEST_BET"}

_FORESEEN_VALUES = 6  # number of further values whose gain is predicted before the first value is measured
_DOUBTED = 0.5  # probability above which a value is considered misread
# Measuring continues if an unmeasured hole next to the chosen one is better with at least the first probability, or if
# a value that was not repeated is misread with at least the second probability.
_LIKELY_BETTER = 0.15
_LIKELY_MISREAD = 0.2
# probability that no drive of the preset explains the values, above which the preset is doubted
UNSHOWN_VALUES = 0.95


@dataclass(frozen=True)
class _PredictedValue:
    """Prediction of a value to be measured: its mean, and its 2.5 % and 97.5 % quantiles with noise [arcsec]."""

    mean_arcsec: float
    low_arcsec: float
    high_arcsec: float

    @classmethod
    def after(
        cls,
        posterior: HolePosterior,
        place: int,
        trial: Trial,
    ) -> _PredictedValue:
        """Return the prediction of the value of a trial from previously measured values.

        Args:
            posterior: posterior given the previous values; it must contain the torque of the trial.
            place: index of the trial's position among those of the posterior.
            trial: trial with the torque and the noise of the predicted value.
        """
        samples = posterior.samples
        M_g = samples.setup.point(trial)[1]
        normals = np.random.default_rng([samples.seed, 4]).standard_normal(len(posterior.noise))
        predicted = posterior.F_ior_by_torque[M_g][:, place]
        read = predicted + normals * posterior.noise * samples.noise([trial])
        low, high = np.quantile(read, (0.025, 0.975)).tolist()
        return cls(
            mean_arcsec=float(predicted.mean()),
            low_arcsec=low,
            high_arcsec=high,
        )


@dataclass(frozen=True)
class Verification:
    """A value measured in the present hole of the wheel after an advice, compared with its prediction.

    trial: the measured value.
    mean_arcsec: mean of the prediction from the previous values [arcsec].
    low_arcsec, high_arcsec: 2.5 % and 97.5 % quantiles of the prediction [arcsec].
    back_to: value measured in the hole to which the wheel should go back; None if the wheel stays.
    is_misread: whether the value itself is probably misread.
    """

    trial: Trial
    mean_arcsec: float
    low_arcsec: float
    high_arcsec: float
    back_to: Trial | None = None
    is_misread: bool = False

    @property
    def as_predicted(self) -> bool:
        """Whether the value lies between the two quantiles of its prediction."""
        return self.low_arcsec <= self.trial.F_ior_arcsec <= self.high_arcsec

    @property
    def verdict(self) -> _VerificationVerdict:
        """Instruction for the wheel: go back to another hole, measure a probably misread value again, or stay."""
        if self.back_to:
            return "GO_BACK"
        return "MEASURE_AGAIN" if self.is_misread else "KEEP"

    @property
    def goal(self) -> Trial:
        """Value measured in the hole in which the wheel should be."""
        return self.back_to or self.trial


@dataclass(frozen=True, eq=False)
class Advice:
    """The recommended hole for the fixed wheel, its probability, and the gain of further measurements.

    decision: decision over samples of all unknown inputs.
    setup: conditions of measurements in holes.
    curve: F'_ior over the positions for the preset with unknown deviations set to 0; None after measurements in holes.
    samples: samples of the uncertain inputs of the preset; None after measurements in holes or without samples.
    trials: values measured in holes.
    after: posterior given the measured values; None if there are none.
    value: gain expected from further values.
    likelier_torque: torque at which the values are far more probable than at the stated one [N*m]; None without one.
    measured: measured wheels that replace first harmonics.
    unknown: unknown deviations.
    open_: paths of the fields that are not known exactly.
    sure: probability from which a choice is an instruction.
    worth: gain below which measuring stops, as a share of F'_ior.
    compensated: description of a stored correction, and the decision based on the residual error after it.
    verification: comparison of the outcome with its prediction; None without an outcome.
    fault: reason why the inputs could not be sampled; empty if there is none.
    more_certificate: certificate of further states, such as those of the self error.
    """

    drive: Drive
    decision: Decision
    setup: TrialSetup
    curve: MountingCurve | None = None
    samples: Samples | None = None
    trials: tuple[Trial, ...] = ()
    after: HolePosterior | None = None
    value: MeasurementValue | None = None
    likelier_torque: float | None = None
    measured: MeasuredTeeth | None = None
    unknown: tuple[Unknown, ...] = ()
    open_: tuple[str, ...] = ()
    sure: float = SURE
    worth: float = WORTH
    compensated: tuple[str, Decision] | None = None
    verification: Verification | None = None
    fault: str = ""
    more_certificate: Certificate = EMPTY

    @property
    def torques(self) -> tuple[float, ...]:
        """Torques that determine the decision [N*m]."""
        return tuple(self.drive.operation.M_g)

    @property
    def word(self) -> Word:
        """The choice as one word."""
        if self.verification:
            return _WORD_AFTER[self.verification.verdict]
        return self.decision.word(self.sure)

    @property
    def names_hole(self) -> bool:
        """Whether the advice names a single hole, so that its word is not ANY_HOLE."""
        return self.word != "ANY_HOLE"

    @property
    def no_hole_better(self) -> str:
        """Reason of model.deviations why all holes are equally good; empty if a hole may be better than another."""
        reason = "" if self.trials else no_hole_better(self.drive)
        return "" if reason == "turning" and self.measured and self.measured.fixed(self.drive) else reason

    @property
    def certificate(self) -> Certificate:
        """Certificate of all states on which the advice is based."""
        parts = (self.curve, self.samples, self.after and self.after.samples)
        return sum((part.certificate for part in parts if part), self.more_certificate)

    @property
    def cross_checks(self) -> tuple[CrossCheck, ...]:
        """Comparisons of states of the curve with a second solver."""
        return tuple(self.curve.cross_checks) if self.curve else ()

    def position(self, place: int | None) -> Position:
        """Return the position of a hole, with its median F'_ior over the samples.

        place: index of the hole; None for the present position of the wheel.
        """
        decision = self.decision
        rotation = 0.0 if place is None else decision.rotations_deg[place]
        drive = self.drive
        if self.after and self.after.facing[0] is not None:
            drive = drive.with_values({standing_offset(drive)[1]: self.after.facing[0]})
        phase = phase_deg(drive, self.measured, rotation)
        return Position(
            rotation_deg=rotation,
            phase_deg=phase,
            hole=hole_of(rotation, drive.mounting.holes),
            F_ior_arcsec=decision.quantile(0.5, place),
        )

    def _position_at(self, rotation_deg: float) -> Position:
        """Return the position at a rotation; it has no F'_ior if it is not one of the positions of the decision."""
        place = self.decision.place(rotation_deg)
        if place is not None:
            return self.position(place)
        first = self.position(None)
        phase = (first.phase_deg + rotation_deg) % 360
        return Position(
            rotation_deg=rotation_deg,
            phase_deg=phase,
            hole=hole_of(rotation_deg, self.drive.mounting.holes),
            F_ior_arcsec=(),
        )

    @cached_property
    def current(self) -> Position:
        """Position of the wheel if it is not moved; after trials, its position before the first trial."""
        return self.position(self.decision.stay)

    @cached_property
    def chosen(self) -> Position:
        """Recommended position of the wheel."""
        return self.position(self.decision.best)

    @property
    def turn(self) -> bool:
        """Whether the wheel must be turned from hole 0."""
        return self.chosen.rotation_deg != 0

    @property
    def order(self) -> Literal["turn", "leave"]:
        """Whether the wheel must be moved from hole 0 or, after an outcome, from the hole of the outcome."""
        if self.verification:
            return "turn" if self.verification.back_to else "leave"
        return "turn" if self.turn else "leave"

    @cached_property
    def ranked(self) -> tuple[Position, ...]:
        """The usable positions in order of the decision, the best one first."""
        return tuple(map(self.position, self.decision.ranked))

    @property
    def worst(self) -> Position:
        """The usable position with the largest expected F'_ior."""
        return self.position(self.decision.worst)

    @property
    def correction(self) -> str:
        """Description of the stored correction on which the choice is based; empty if the choice is based on F'_ior."""
        return self.compensated[0] if self.compensated and self.compensated[1] is self.decision else ""

    @property
    def by_torque(self) -> tuple[Position, ...]:
        """The best position for each torque."""
        return tuple(self.position(self.decision.of_torque(k).best) for k in range(len(self.torques)))

    @property
    def gain_range(self) -> tuple[float, float, float]:
        """5th percentile, median and 95th percentile of the relative reduction of F'_ior in the chosen hole."""
        return self.decision.range_of(self.decision.gains(self.decision.best))

    @property
    def values(self) -> int:
        """Number of measured values on which the decision is based."""
        return len(self.trials) or len(measured_errors(self.drive))

    @property
    def fewest_values(self) -> int:
        """Smallest number of values before measuring may stop: in a small seat, one more than there are positions."""
        return min(FEWEST_VALUES, len(self.decision.rotations_deg) + 1)

    @property
    def to_try(self) -> tuple[Position, ...]:
        """Three usable positions to measure first, which are as far apart as possible."""
        return tuple(self.position(self.decision.place(turn)) for turn in _thirds(self.decision.rotations_deg))

    @property
    def next(self) -> Position | None:
        """The position to measure next; None if the expected gain is too small, or if an outcome ends the trials.

        A value that is probably misread is repeated before other positions are measured.
        """
        if self.verification and self.verification.verdict != "MEASURE_AGAIN":
            return None
        if repeat := self.to_repeat:
            return self._position_at(repeat.rotation_deg)
        value = self.value
        if not value:
            return None
        if self.values >= self.fewest_values and not value.is_worth(self.worth):
            return self._next_before_stop()
        if not self.values and value.F_ior_arcsec[0] - value.F_ior_arcsec[-1] < self.worth * value.F_ior_arcsec[0]:
            return None
        return self.position(self.decision.place(value.rotation_deg))

    def _next_before_stop(self) -> Position | None:
        """Return the position to measure although the gain is small: a doubtful value or a likely better neighbour.

        The result is None if there is neither.
        """
        if self.doubtful:
            doubtful_trial, _ = self.doubtful
            return self._position_at(doubtful_trial.rotation_deg)
        if self.likely_neighbour:
            place, _ = self.likely_neighbour
            return self.position(place)
        return None

    @cached_property
    def doubtful(self) -> tuple[Trial, float] | None:
        """The value that is most probably misread, and the probability that it is.

        The result is None if the probability is small or if the value was repeated.
        """
        if not self.after:
            return None
        probabilities = self.after.misread
        likeliest = int(np.argmax(probabilities))
        trial = self.trials[likeliest]
        if probabilities[likeliest] < _LIKELY_MISREAD or self._is_repeated(trial):
            return None
        return trial, float(probabilities[likeliest])

    def _is_repeated(self, trial: Trial) -> bool:
        """Return whether another value has the same position and torque."""
        points = [self.setup.point(value) for value in self.trials]
        return points.count(self.setup.point(trial)) > 1

    @cached_property
    def likely_neighbour(self) -> tuple[int, float] | None:
        """Index of an unmeasured hole next to the chosen one that may well be better, and its probability of that.

        A hole counts as better only if its F'_ior is lower by more than the share `worth`.
        The result is None if the probability is below _LIKELY_BETTER for both neighbours.
        """
        decision = self.decision
        rotations = decision.rotations_deg
        values = self.trials or measured_errors(self.drive)
        measured_places = {decision.place(value.rotation_deg) for value in values}
        best = decision.best
        neighbours = {(best + 1) % len(rotations), (best - 1) % len(rotations)} - measured_places - {best}
        probabilities = {}
        for place in sorted(neighbours):
            is_better = decision.served[:, place] < (1 - self.worth) * decision.served[:, best]
            probabilities[place] = float(np.average(is_better, weights=decision.sample_weights))
        likeliest = max(probabilities, key=probabilities.__getitem__, default=None)
        if likeliest is None or probabilities[likeliest] < _LIKELY_BETTER:
            return None
        return likeliest, probabilities[likeliest]

    @property
    def next_torque(self) -> float:
        """Torque of the value to measure next [N*m]."""
        if repeat := self.to_repeat:
            return self.torque_of(repeat)
        if not self.value:
            return self.setup.M_g
        if self.doubtful and self.values >= self.fewest_values and not self.value.is_worth(self.worth):
            doubtful_trial, _ = self.doubtful
            return self.torque_of(doubtful_trial)
        return self.value.M_g

    @property
    def to_repeat(self) -> Trial | None:
        """The probably misread value to measure again; None if there is none.

        A value that was already repeated is not measured again, unless it is the outcome.
        """
        doubted = self.suspected
        if not doubted:
            return None
        is_outcome = self.verification is not None and doubted is self.verification.trial
        return doubted if is_outcome or not self._is_repeated(doubted) else None

    @property
    def outcome_torque(self) -> float:
        """Torque at which the outcome is measured [N*m].

        It is the torque of the setup, or the reference torque of the samples if the posterior lacks that torque.
        """
        if self.after and self.setup.M_g not in self.after.F_ior_by_torque:
            return self.after.samples.setup.M_g
        return self.setup.M_g

    @property
    def predicted_outcome(self) -> _PredictedValue | None:
        """Prediction of the outcome in the chosen hole; None without values measured in holes."""
        if not self.after:
            return None
        trial = Trial(
            self.chosen.rotation_deg,
            0.0,
            M_g=self.outcome_torque,
            noise_arcsec=self.setup.noise_arcsec,
        )
        return _PredictedValue.after(self.after, self.decision.best, trial)

    @property
    def worths(self) -> tuple[tuple[int, float], ...]:
        """Pairs of a number of measured values and the F'_ior expected in the hole chosen after them [arcsec]."""
        if not self.value:
            return ()
        steps = (0, 3, 4, 5, 6) if not self.values else (0, 1, 3)
        expected = self.value.F_ior_arcsec
        return tuple((self.values + step, expected[step]) for step in steps if step < len(expected))

    def torque_of(self, trial: Trial) -> float:
        """Return the torque of a value [N*m]."""
        return self.setup.point(trial)[1]

    @property
    def torques_of_values(self) -> tuple[float, ...]:
        """Torques of the measured values [N*m], without repetition; the torque of the setup if there are no values."""
        return tuple(dict.fromkeys(map(self.torque_of, self.trials))) or (self.setup.M_g,)

    @property
    def suspected(self) -> Trial | None:
        """The most probably misread value; None unless the probability that any value is misread exceeds _DOUBTED."""
        misread = self.after.misread if self.after else np.zeros(0)
        return self.trials[int(np.argmax(misread))] if misread.sum() > _DOUBTED else None

    @property
    def contradicted(self) -> tuple[str, float, float] | None:
        """Contradiction between the values and the stated direction of the stationary eccentricity; None without one.

        The result is the path of the direction, and the direction determined from the values with its standard
        deviation [deg].
        """
        path = standing_offset(self.drive)[1]
        stated = self.drive.value(path)
        direction_deg, spread = self.after.facing if self.after else (None, None)
        if stated is None or direction_deg is None or spread is None or path in self.drive.uncertainty:
            return None
        off = abs((direction_deg - float(stated) + 180) % 360 - 180)
        return (path, direction_deg, spread) if off > 3 * max(spread, 5.0) else None

    @cached_property
    def influences(self) -> tuple[Influence, ...]:
        """Contributions of fields to the variance of the log ratio of F'_ior between the best other hole and this one.

        There are none without samples or without another hole.
        """
        decision = replace(self.decision, room_arcsec=())
        if self.samples is None or (place := decision.challenger) is None:
            return ()
        return influences_on(self.samples.of_ranges, np.log(np.maximum(1 - decision.gains(place), 1e-9)))


def advice_states(
    drive: Drive,
    positions: int,
    *,
    draws: int,
    measured: MeasuredTeeth | None = None,
    trials: bool = False,
) -> int:
    """Return the approximate number of states solved for an advice, for the progress bar."""
    cycle = Kinematics.of(drive).cycle_states
    torques = len(drive.operation.M_g)
    if trials:
        return max(1, draws // SAMPLES_A_TABLE) * torques * (TableEffort().mesh.states(drive) + DRAWN_STATES)
    drawn = bool(draws and prior_of(drive).fields) and not measured and searchable(drive)
    if not is_searched(drive, positions, drawn=drawn, measured=measured):
        return torques * positions * cycle
    sampled = draws * DRAWN_STATES * (1 + positions) if drawn else 0
    return torques * (positions * FINE_STATES + 2 * cycle + sampled)


def advise(
    drive: Drive,
    rotations_deg: Sequence[float],
    *,
    measured: MeasuredTeeth | None = None,
    setup: TrialSetup | None = None,
    draws: int = EFFECTIVE_SAMPLES,
    sure: float = SURE,
    cost: float = LEAST_GAIN,
    worth: float = WORTH,
    run: Run = Run(),
) -> Advice:
    """Return the advice on the hole for the fixed wheel of a drive, from its preset.

    Args:
        drive: the drive.
        rotations_deg: positions of the curve [deg]; the first is 0, the present position.
        measured: measured wheels that replace harmonics; their deviations are not sampled.
        setup: conditions of measurements in holes.
        draws: smallest effective sample size of uncertain inputs; 0 for no samples.
        sure: probability from which the choice is an instruction.
        cost: smallest relative reduction of F'_ior for which the wheel is moved.
        worth: gain below which measuring stops, as a share of F'_ior.
        run: processes, progress and seed.

    Raises UsageError for invalid positions, and UntrustedError if a result cannot be trusted.
    """
    setup = setup or TrialSetup(min(drive.operation.M_g, key=abs))
    prediction = _Prediction.of(
        drive,
        rotations_deg,
        measured,
        setup.M_g,
        draws=draws,
        sure=sure,
        run=run,
    )
    # the tables of advise_after give more samples that agree with measured values
    if prediction.has_few_samples and measured_errors(drive):
        by_values = advise_after(
            drive,
            (),
            setup,
            draws=draws,
            sure=sure,
            cost=cost,
            worth=worth,
            run=run,
        )
        return replace(by_values, more_certificate=by_values.more_certificate + prediction.superseded_certificate)
    decisions = prediction.decisions(sure)
    advice = prediction.advice(
        decisions.deciding,
        setup,
        sure=sure,
        worth=worth,
    )
    has_any_direction = bool(advice.unknown and unknown_turn(prediction.assumed_drive))
    all_alike = bool(advice.no_hole_better) or (has_any_direction and not measured_errors(drive))
    return _with_first_value(advice, decisions.with_rules(cost, all_alike), prediction.torques, run.seed)


@dataclass(frozen=True, eq=False)
class _Prediction:
    """Predicted F'_ior in the holes, for the nominal drive and for samples of its uncertain inputs."""

    drive: Drive
    measured: MeasuredTeeth | None
    assumed_drive: Drive  # drive without the deviations that measured wheels replace
    prior: DrivePrior
    positions: tuple[float, ...]  # usable rotations of the fixed wheel [deg]
    torques: tuple[float, ...]  # torques of the samples [N*m], those of the drive first
    curve: MountingCurve
    checked: Callable[[], MountingCurve]  # returns the curve with its cross-checks, once these are finished
    rooms: LimitRooms
    drawn: _Drawn | None  # samples; None if none were requested

    @classmethod
    def of(
        cls,
        drive: Drive,
        rotations_deg: Sequence[float],
        measured: MeasuredTeeth | None,
        trial_M_g: float,
        *,
        draws: int,
        sure: float,
        run: Run,
    ) -> _Prediction:
        """Return the prediction of a drive in its holes.

        Args:
            drive: the drive.
            rotations_deg: positions of the curve [deg], starting with 0.
            measured: measured wheels that replace harmonics.
            trial_M_g: torque of measurements in holes [N*m]; it may differ from the torques of the decision.
            draws: smallest effective sample size; 0 for no samples.
            sure: probability from which a choice is an instruction.
            run: processes, progress and seed.
        """
        assumed_drive, prior = beside_measured_teeth(drive, measured)
        torques = tuple(drive.operation.M_g)
        other_torques = () if trial_M_g in torques else (trial_M_g,)
        positions = tuple(usable_positions(drive.mounting.holes, drive.mounting.allowed))
        is_drawn = draws > 0 and bool(prior.fields) and not measured and searchable(drive)
        # the cross-checks of the curve run in parallel with the sampling
        curve, checked = begun_curve(
            drive,
            torques,
            rotations_deg,
            measured=measured,
            drawn=is_drawn,
            run=run,
        )
        rooms = limits_left(drive, torques, run)
        drawn = None
        if is_drawn:
            sampled_deg = sorted({0.0, *positions})
            sampling: Any = {"rotations_deg": sampled_deg, "other_torques": other_torques, "draws": draws}
            drawn = _drawn_samples(
                prior,
                rooms.arcsec,
                **sampling,
                sure=sure,
                run=run,
            )
        return cls(
            drive=drive,
            measured=measured,
            assumed_drive=assumed_drive,
            prior=prior,
            positions=positions,
            torques=(*torques, *other_torques),
            curve=curve,
            checked=checked,
            rooms=rooms,
            drawn=drawn,
        )

    @property
    def samples(self) -> Samples | None:
        """The samples of the uncertain inputs; None if there are none."""
        return self.drawn.samples if self.drawn else None

    @property
    def has_few_samples(self) -> bool:
        """Whether samples were requested, but their effective sample size is too small for percentiles."""
        return self.drawn is not None and (self.samples is None or bool(self.samples.few))

    @property
    def superseded_certificate(self) -> Certificate:
        """Certificate of the curve and the samples, to be added to the advice that supersedes this prediction."""
        certificate = self.curve.certificate
        if self.drawn:
            certificate += self.drawn.certificate
        if self.samples:
            certificate += self.samples.certificate
        return certificate

    def decisions(self, sure: float) -> _PresetDecisions:
        """Return the decisions based on the samples, or on the curve of the nominal drive if there are no samples.

        sure: probability from which a choice is an instruction.
        """
        room_arcsec = self.rooms.arcsec
        if not self.samples:
            as_given = Decision.as_given(self.curve, room_arcsec)
            return _PresetDecisions(deciding=as_given, of_all_torques=as_given)
        of_all_torques = Decision.of(self.samples, self.positions, room_arcsec, sure)
        deciding = of_all_torques.of_torques(slice(len(self.drive.operation.M_g)))
        return _PresetDecisions(deciding=deciding, of_all_torques=of_all_torques)

    def advice(
        self,
        decision: Decision,
        setup: TrialSetup,
        *,
        sure: float,
        worth: float,
    ) -> Advice:
        """Return the advice with a decision, after waiting for the cross-checks of the curve.

        Args:
            decision: decision at the torques of the drive.
            setup: conditions of measurements in holes.
            sure: probability from which a choice is an instruction.
            worth: gain below which measuring stops, as a share of F'_ior.

        Raises UntrustedError if two solvers disagree.
        """
        return Advice(
            drive=self.drive,
            decision=decision,
            setup=setup,
            curve=self.checked(),
            samples=self.samples,
            measured=self.measured,
            unknown=unknowns(self.assumed_drive),
            open_=tuple(field.path for field in self.prior.fields),
            sure=sure,
            worth=worth,
            fault=self.drawn.fault if self.drawn else "",
            more_certificate=self.rooms.certificate + (self.drawn.certificate if self.drawn else EMPTY),
        )


@dataclass(frozen=True)
class _PresetDecisions:
    """The decisions among the holes from a preset without trials, at two sets of torques."""

    deciding: Decision  # at the torques of the drive, which determine the choice
    of_all_torques: Decision  # at all torques of the samples, including that of the setup

    def with_rules(self, cost: float, all_alike: bool) -> _PresetDecisions:
        """Return the same decisions with the rules on moving the wheel.

        cost: smallest relative reduction of F'_ior for which the wheel is moved.
        all_alike: whether all holes are equally good.
        """
        return _PresetDecisions(
            deciding=replace(self.deciding, cost=cost, all_alike=all_alike),
            of_all_torques=replace(self.of_all_torques, cost=cost, all_alike=all_alike),
        )


def _with_first_value(
    advice: Advice,
    decisions: _PresetDecisions,
    torques: tuple[float, ...],
    seed: int,
) -> Advice:
    """Return the advice before any trial, with its decision and the gain expected from measuring values.

    Args:
        advice: advice from the preset, whose own measured values are already taken into account.
        decisions: decisions at the torques of the drive, and at all torques of the samples.
        torques: torques of the samples [N*m], those of the drive first.
        seed: seed of the simulation.
    """
    advice = replace(advice, decision=decisions.deciding)
    if not advice.samples or advice.no_hole_better:
        return advice
    count = len(measured_errors(advice.drive))
    # samples that no measured values have weighted lack the model error, which as_measured adds
    simulated = decisions.of_all_torques if count else as_measured(decisions.of_all_torques, seed=seed)
    F_ior_at_setup = simulated.F_ior_arcsec[torques.index(advice.setup.M_g)]
    deciding = simulated.of_torques(slice(len(advice.torques)))
    value = _value(deciding, {advice.setup.M_g: F_ior_at_setup}, None, advice.setup, count, seed)
    return replace(advice, value=value)


@dataclass(frozen=True)
class _Drawn:
    """Samples of the uncertain inputs, or the reason why there are none."""

    samples: Samples | None
    fault: str
    certificate: Certificate  # certificate of states solved for unusable samples


def _drawn_samples(prior: DrivePrior, room_arcsec: Sequence[float | None], **options: Any) -> _Drawn:
    """Draw samples of a prior with the options of drive_samples, or return the reason why there are none."""
    try:
        samples = drive_samples(prior, room_arcsec, **options)
    except UntrustedError as refusal:
        return _Drawn(
            samples=None,
            fault=refusal.message,
            certificate=EMPTY,
        )
    # the percentiles of a single sample would be those of a random drive
    if samples and len(samples.of_ranges.weights) < 2:
        fault = "a single sample of the uncertain inputs gives no range"
        return _Drawn(
            samples=None,
            fault=fault,
            certificate=samples.certificate,
        )
    return _Drawn(
        samples=samples,
        fault="",
        certificate=EMPTY,
    )


def advise_after(
    drive: Drive,
    trials: Sequence[Trial],
    setup: TrialSetup,
    *,
    outcome: Trial | None = None,
    draws: int = EFFECTIVE_SAMPLES,
    samples: HoleSamples | None = None,
    sure: float = SURE,
    cost: float = LEAST_GAIN,
    worth: float = WORTH,
    other_torques: Sequence[float] = (),
    run: Run = Run(),
) -> Advice:
    """Return the advice on the hole for the fixed wheel after F'_ior was measured in some holes.

    Args:
        drive: the drive.
        trials: values measured with the setup, in addition to those of the preset.
        setup: conditions of the measurements.
        outcome: last value, measured after an advice from the previous values.
        draws: smallest effective sample size of uncertain inputs.
        samples: samples of the drive in its holes; None to draw them.
        sure: probability from which the choice is an instruction.
        cost: smallest relative reduction of F'_ior for which the wheel is moved.
        worth: gain below which measuring stops, as a share of F'_ior.
        other_torques: torques [N*m] at which the values may have been measured by mistake.
        run: processes, progress and seed.

    Raises UsageError if there are no values before the outcome, and the errors of hole_samples.
    """
    all_trials = _all_trials(drive, trials, outcome, setup)
    by_values = _PosteriorOfTrials.of(
        drive,
        all_trials,
        setup,
        samples,
        draws=draws,
        run=run,
    )
    after = by_values.after
    rooms = limits_left(drive, drive.operation.M_g, run)
    decision = after.decision(drive.operation.M_g, rooms.arcsec, cost)
    likelier = by_values.likelier_torque(
        drive,
        other_torques,
        draws=draws,
        run=run,
    )
    noise_arcsec = after.noise * setup.noise_arcsec  # noise of each sample, shape (samples,)
    advice = Advice(
        drive=drive,
        decision=decision,
        setup=setup,
        trials=all_trials,
        after=after,
        value=_value(decision, by_values.measurable(setup), noise_arcsec, setup, len(all_trials), run.seed),
        likelier_torque=likelier.M_g,
        unknown=unknowns(drive),
        open_=tuple(field.path for field in prior_of(drive).fields),
        sure=sure,
        worth=worth,
        more_certificate=rooms.certificate + likelier.certificate,
    )
    return _with_outcome(advice, by_values) if outcome else advice


def _all_trials(
    drive: Drive,
    trials: Sequence[Trial],
    outcome: Trial | None,
    setup: TrialSetup,
) -> tuple[Trial, ...]:
    """Return the values of a preset together with further trials, sorted by in_order, and then the outcome.

    Raises UsageError if there is no value other than the outcome.
    """
    preset_trials = _of_preset(drive, setup, (*trials, outcome))
    ordered = in_order([*preset_trials, *trials], setup)
    if not ordered:
        message = f"no measured value at {setup.M_g:g} N·m: expected HOLE=VALUE, or measured.F_ior in the preset"
        raise UsageError(message, TRIAL_HINT)
    return (*ordered, outcome) if outcome else ordered


@dataclass(frozen=True)
class _LikelierTorque:
    """The torque at which measured values are far more probable than at the stated one, if there is one."""

    M_g: float | None  # [N*m]
    certificate: Certificate  # certificate of the states solved for torques without samples


@dataclass(frozen=True, eq=False)
class _PosteriorOfTrials:
    """Measured values, and samples of a drive in its holes before and after they are reweighted by these values."""

    trials: tuple[Trial, ...]  # the values as entered
    values: list[Trial]  # the same values, each with its torque
    setup: TrialSetup  # setup whose torque is the reference of F'_ior at the other torques
    samples: HoleSamples
    after: HolePosterior  # posterior in the usable positions and, as the last one, in the present position

    @classmethod
    def of(
        cls,
        drive: Drive,
        trials: tuple[Trial, ...],
        setup: TrialSetup,
        samples: HoleSamples | None,
        *,
        draws: int,
        run: Run,
    ) -> _PosteriorOfTrials:
        """Return the posterior of a drive given measured values; its samples are drawn if they are not passed.

        Args:
            drive: drive that is sampled at its torques and at those of the values.
            trials: all values in order.
            setup: conditions of the measurements.
            samples: samples of the drive in its holes; None to draw them.
            draws: smallest effective sample size.
            run: processes, progress and seed.
        """
        trial_torques = [setup.point(trial)[1] for trial in trials]
        values = [replace(trial, M_g=M_g) for trial, M_g in zip(trials, trial_torques, strict=True)]
        # the reference torque depends on the values, not on the way they are entered
        common = replace(setup, M_g=min(trial_torques, key=lambda M_g: (abs(M_g), M_g)))
        if samples is None:
            samples = hole_samples(
                drive,
                (*drive.operation.M_g, *trial_torques),
                common,
                draws=draws,
                run=run,
            )
        # the gain refers to the position before the first trial, which is 0 deg and need not be a usable hole
        positions = [*_positions_with_trials(drive, trials), 0.0]
        after = posterior_of(samples.with_free_curves(values), values, positions)
        return cls(
            trials=trials,
            values=values,
            setup=common,
            samples=samples,
            after=after,
        )

    def measurable(self, setup: TrialSetup) -> dict[float, Array]:
        """Return F'_ior in the holes [arcsec], shape (samples, holes), by the torque of a further value [N*m].

        The reference torque comes first. Further values are measured at the torques of the previous values. They are
        also measured at the other torques of the setup, unless each value was entered with its own torque.
        """
        has_own_torques = all(trial.M_g is not None for trial in self.trials)
        torques = {value.M_g for value in self.values if value.M_g is not None}
        if not has_own_torques:
            torques |= {*setup.others}
        ordered = (self.setup.M_g, *sorted(torques - {self.setup.M_g}))
        return {M_g: self.after.F_ior_by_torque[M_g][:, :-1] for M_g in ordered}

    def likelier_torque(
        self,
        drive: Drive,
        other_torques: Sequence[float],
        *,
        draws: int,
        run: Run,
    ) -> _LikelierTorque:
        """Return a torque at which the values are far more probable than at the stated one, which may be wrong.

        The stated torque is doubted only if the drive hardly explains the values or if a value is probably misread.

        Args:
            drive: the drive.
            other_torques: torques [N*m] to try in addition to those of the samples.
            draws: smallest effective sample size at these torques.
            run: processes, progress and seed.
        """
        is_unshown = self.after.by_values > UNSHOWN_VALUES
        if not is_unshown and self.after.misread.sum() <= _DOUBTED:
            return _LikelierTorque(M_g=None, certificate=EMPTY)
        likelier_M_g = likelier_torque(self.samples, self.values)
        untried = sorted({*other_torques} - {*self.samples.F_ior_by_torque})
        # a misread value explains itself, so further torques are solved only if no drive explains the values
        if likelier_M_g or not untried or not is_unshown:
            return _LikelierTorque(M_g=likelier_M_g, certificate=EMPTY)
        untried_samples = hole_samples(
            drive,
            untried,
            self.setup,
            draws=draws,
            run=run,
        )
        return _LikelierTorque(
            M_g=likelier_torque(untried_samples, self.values), certificate=untried_samples.certificate
        )


def _with_outcome(advice: Advice, by_values: _PosteriorOfTrials) -> Advice:
    """Return the advice with its last value, the outcome, verified, and with the hole that follows from it."""
    verification = _verified(advice, by_values.values, by_values.samples)
    settled = replace(advice.decision, settled_deg=verification.goal.rotation_deg)
    return replace(advice, decision=settled, verification=verification)


def _positions_with_trials(drive: Drive, trials: Sequence[Trial]) -> list[float]:
    """Return the usable positions of the fixed wheel [deg]; without holes, the positions of the values are added."""
    positions = usable_positions(drive.mounting.holes, drive.mounting.allowed)
    if drive.mounting.holes:
        return positions
    return sorted({*positions, *(trial.rotation_deg for trial in trials)})


def _value(
    decision: Decision,
    measurable: Mapping[float, Array],
    noise: Array | None,
    setup: TrialSetup,
    count: int,
    seed: int,
) -> MeasurementValue | None:
    """Return the gain expected from further values; None if there is only one position.

    decision: decision before the further values.
    measurable: F'_ior in the holes [arcsec], shape (samples, holes), by the torque of a further value [N*m].
    noise: standard deviation of a further value [arcsec], shape (samples,); None for the noise of the setup.
    setup: conditions of the measurements.
    count: number of values measured so far.
    seed: seed of the simulation.
    """
    if len(decision.rotations_deg) < 2:
        return None
    noise = np.full(len(decision.sample_weights), setup.noise_arcsec) if noise is None else noise
    steps, first = (3, ()) if count else (_FORESEEN_VALUES, _thirds(decision.rotations_deg))
    return value_of_measurement(
        decision,
        measurable,
        noise,
        steps=steps,
        first=first,
        seed=seed,
    )


def _verified(
    advice: Advice,
    values: Sequence[Trial],
    samples: HoleSamples,
) -> Verification:
    """Return the outcome of an advice with its prediction, and the hole in which the wheel should be.

    The wheel goes back to the measured hole with the smallest expected loss, given all values. It stays if the loss in
    the hole of the outcome is not larger by more than the cost of moving it. If the outcome is neither as predicted nor
    probably misread, the prediction is doubtful, and the measured values are compared instead of the expected losses.

    advice: advice given all values, of which the outcome is the last.
    values: the same values with their torques, shape (trials,).
    samples: samples of the drive.
    """
    decision = advice.decision
    outcome = advice.trials[-1]
    before_outcome = posterior_of(samples.with_free_curves(values[:-1]), values[:-1], [outcome.rotation_deg])
    predicted = _PredictedValue.after(before_outcome, 0, values[-1])
    checked = Verification(
        trial=outcome,
        mean_arcsec=predicted.mean_arcsec,
        low_arcsec=predicted.low_arcsec,
        high_arcsec=predicted.high_arcsec,
        back_to=None,
        is_misread=advice.suspected is outcome,
    )

    def loss(trial: Trial) -> float:
        """Return the relative loss in the hole of a value; infinite if the hole is not usable or not comparable."""
        place = decision.place(trial.rotation_deg)
        if place is None:
            return np.inf
        if checked.as_predicted:
            return float(decision.expected_loss[place])
        is_comparable = advice.torque_of(trial) == advice.torque_of(outcome)
        return trial.F_ior_arcsec / outcome.F_ior_arcsec if is_comparable else np.inf

    # a probable reading error is measured again before the wheel moves
    if checked.is_misread:
        return checked
    other_trials = [trial for trial in advice.trials[:-1] if trial.rotation_deg != outcome.rotation_deg]
    least = min(reversed(other_trials), key=loss, default=outcome)
    back = least if loss(least) + decision.cost < loss(outcome) else None
    return replace(checked, back_to=back)


def _of_preset(
    drive: Drive,
    setup: TrialSetup,
    given: Sequence[Trial | None],
) -> list[Trial]:
    """Return the measured values of the preset, except those that are also in given."""
    known_values = {(*setup.point(trial), trial.F_ior_arcsec) for trial in given if trial}
    return [
        Trial(e.rotation_deg, e.value, M_g=e.M_g, noise_arcsec=e.spread)
        for e in measured_errors(drive)
        if (e.rotation_deg, e.M_g, e.value) not in known_values
    ]


def _thirds(rotations_deg: Sequence[float]) -> tuple[float, ...]:
    """Return the rotations nearest to 0, 120 and 240 degrees, without repetition [deg]."""
    nearest_deg = [
        min(rotations_deg, key=lambda p: abs((p - third_deg + 180) % 360 - 180)) for third_deg in (0.0, 120.0, 240.0)
    ]
    return tuple(dict.fromkeys(nearest_deg))
