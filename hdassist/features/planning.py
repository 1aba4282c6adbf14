"""Plans for tests of F'_ior: the share of F'_ior that readings at a few positions capture, over all uncertain inputs.

The module also determines how a test is carried out: the sequence of approaches, their duration, and the readings that
pass or fail a limit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from hdassist.belief.prior import pitch_deviation_shares, prior_of, share_of_second_wheel
from hdassist.belief.samples import EFFECTIVE_SAMPLES, Samples, drive_samples
from hdassist.belief.statistics import Probability, probability_of, weighted_quantile
from hdassist.drive.error.cycle import kinematic_error, limits_left
from hdassist.drive.error.error_map import searchable
from hdassist.drive.error.waves import POINTS_A_TURN, ErrorLines, error_lines
from hdassist.drive.model.deviations import ToothDeviations, largest_pitch_share, spread_of_teeth
from hdassist.drive.model.geometry import Array, Kinematics, pitch_locked_states
from hdassist.drive.preset.fields import DEVIATIONS, Drive
from hdassist.drive.solve.answers import EMPTY, Certificate
from hdassist.features.measuring.orders import LARGEST_UNCERTAINTY
from hdassist.run.errors import GUARD, UsageError, Verdict
from hdassist.run.files import number_of
from hdassist.run.run import UNCHECKED, Run

_QUOTED_POSITIONS = 12  # number of positions in the test that manufacturers state
_FEWEST_POSITIONS = 6  # smallest number of positions that is tried
_MOST_A_CAM_TURN = 5  # largest number of positions that is tried, per input revolution
_RANDOM_STARTS = 256  # total number of starts, distributed over the samples
_LEAST_STARTS = 16  # smallest number of starts per sample
_LEAST_ARCSEC = 1e-9  # arcsec; added to errors, which makes a test capture all of an error of 0
_LISTED_LINES = 12  # number of the largest lines that are listed
_NEVER = Probability(0.0, 0.0, 0.0)  # probability of a wrong verdict of a test that captures everything
SEEN_SHARE = 0.95  # captured share of F'_ior that is sufficient without a limit
_ROUGH_WHEELS = 8  # number of random wheels of each kind
_ROUGH_UM = 10.0  # single pitch deviation f_p at which the random wheels are solved [um]


@dataclass(frozen=True)
class ReadingPlan:
    """Readings at even steps of the output, from an unknown start.

    name: description of the plan.
    readings: number of readings in one direction.
    step_turns: step between readings [output revolutions].
    both: whether the readings are repeated backwards; the larger range then counts.
    is_record: whether the readings represent a continuous recording.
    """

    name: str
    readings: int
    step_turns: float
    both: bool = False
    is_record: bool = False

    @classmethod
    def positions(
        cls,
        readings: int,
        turns: float = 1.0,
        both: bool = False,
    ) -> ReadingPlan:
        """Return the plan of positions spaced evenly over output revolutions."""
        over = "" if turns == 1 else f" over {turns:.4g} output turns"
        ways = " both ways" if both else ""
        name = f"{readings} positions{over}{ways}"
        return cls(
            name=name,
            readings=readings,
            step_turns=turns / readings,
            both=both,
        )

    @classmethod
    def record(cls, cam_turns: float, ratio: float) -> ReadingPlan:
        """Return the plan of a recording over input revolutions; ratio: input revolutions per output revolution."""
        name = f"record of {cam_turns:.4g} cam turn{'' if cam_turns == 1 else 's'}"
        return cls(
            name,
            max(round(cam_turns * POINTS_A_TURN), 2),
            1 / POINTS_A_TURN / ratio,
            is_record=True,
        )

    def sees_all(self, output_turns: float) -> bool:
        """Return whether the plan is a recording of at least a number of output revolutions."""
        return self.is_record and self.readings * self.step_turns >= output_turns - 1e-9

    def seen_as(self, per_output_turn: Array) -> Array:
        """Return the number of periods of each line that appear in the test; 0 if the line only shifts all readings.

        A line with f periods per output revolution advances by f times the step between readings. Whole periods of this
        advance are not visible. With N readings over k revolutions, the line appears with r = f k mod N periods, or
        with N - r periods if that is smaller.

        per_output_turn: periods of the lines per output revolution, shape (lines,).
        """
        # readings show the phase of a line only modulo whole periods
        phase = per_output_turn * self.step_turns
        return np.asarray(np.round(np.abs(phase - np.rint(phase)) * self.readings, 6))


@dataclass(frozen=True)
class PlanDemands:
    """Requirements for a test.

    wrong: largest share of all tested drives that pass although they exceed the limit, or fail although they meet it.
    noise_arcsec: standard uncertainty of the measured range [arcsec].
    corrected: whether the measured range is divided by the median share that the plan captures.
    """

    wrong: float = 0.05
    noise_arcsec: float = 0.0
    corrected: bool = False


@dataclass(frozen=True)
class _PlanJudgement:
    """Judgement of a plan: the share of F'_ior that it captures, and its wrong verdicts.

    plan: the plan.
    seen: captured share at 5, 50 and 95 % of drives and starts.
    false_pass: probability that a drive passes although it exceeds the limit; None without a limit.
    false_fail: probability that a drive fails although it meets the limit; None without a limit.
    verdict: PASS if both probabilities meet the requirements over the whole Monte Carlo interval. Without a limit, the
        same for the probability of capturing less than SEEN_SHARE of F'_ior.
    """

    plan: ReadingPlan
    seen: tuple[float, float, float]
    false_pass: Probability | None
    false_fail: Probability | None
    verdict: Verdict


@dataclass(frozen=True, eq=False)
class DrivesUnderTest:
    """Drives that may be tested.

    curves: errors over the full cycle [arcsec], shape (drives, points).
    weights: weights of the drives, shape (drives,).
    cycle_output: output revolutions of the cycle.
    left_arcsec: largest F'_ior within the limit [arcsec]; None without a limit.
    demands: requirements for the test.
    seed: seed of starts and noise.
    travel: output revolutions in use, from the start of the test, whose range is F'_ior; None for the full cycle.
    stated_beyond: probability of exceeding the limit as stated by `check`; None if it states none.
    """

    curves: Array
    weights: Array
    cycle_output: int
    left_arcsec: float | None = None
    demands: PlanDemands = PlanDemands()
    seed: int = 0
    travel: float | None = None
    stated_beyond: Probability | None = None

    @cached_property
    def starts(self) -> Array:
        """Starts of tests as shares of the cycle, shape (drives, starts)."""
        drives = len(self.curves)
        return np.random.default_rng(self.seed).random((drives, max(_LEAST_STARTS, _RANDOM_STARTS // drives)))

    @cached_property
    def F_ior_arcsec(self) -> Array:
        """F'_ior of each drive [arcsec], shape (drives, 1); with a travel, from each start, shape (drives, starts)."""
        if self.travel is None:
            return np.asarray(
                np.ptp(
                    self.curves,
                    axis=1,
                    keepdims=True,
                )
            )
        # extremes of half input revolutions reduce a travel to a few values
        halves = self.curves.reshape(len(self.curves), -1, POINTS_A_TURN // 2)
        count = halves.shape[1]
        reach = np.arange(min(count, int(self.travel / self.cycle_output * count) + 2))
        # the half revolutions at both ends of a travel are included as a whole
        places = np.floor(self.starts[..., None] * count + reach).astype(np.int64) % count
        high, low = (np.take_along_axis(extreme[:, None], places, axis=2) for extreme in (halves.max(2), halves.min(2)))
        return np.asarray(high.max(axis=2) - low.min(axis=2))

    def percentiles(self, values: Array) -> tuple[float, float, float]:
        """Return the 5th, 50th and 95th percentiles of values, shape (drives, starts)."""
        weights = np.broadcast_to(self.weights[:, None], values.shape).ravel()
        low, middle, high = (weighted_quantile(values.ravel(), weights, share) for share in (0.05, 0.5, 0.95))
        return low, middle, high

    def probability(self, outcome: NDArray[np.bool_]) -> Probability:
        """Return the probability of an outcome, shape (drives, starts), with its Monte Carlo interval."""
        # starts of one drive are not independent, so the drives are the samples
        interval = probability_of(outcome.mean(axis=1), self.weights)
        return interval if len(outcome) > 1 else Probability(interval.value, interval.value, interval.value)

    @property
    def beyond(self) -> Probability | None:
        """Probability that a drive exceeds the limit; None without a limit."""
        if self.stated_beyond is not None:
            return self.stated_beyond
        # without a limit, no drive can exceed it
        return None if self.left_arcsec is None else self.probability(self.F_ior_arcsec > self.left_arcsec)

    def seen_shares(self, plan: ReadingPlan, starts: Array) -> Array:
        """Return the share of F'_ior that a plan captures, shape (drives, starts).

        plan: the plan.
        starts: starts as shares of the cycle, shape (drives, starts).
        """
        # steps between readings as shares of the cycle
        steps = np.arange(plan.readings) * plan.step_turns / self.cycle_output
        points = self.curves.shape[1]
        places_of_starts = (np.rint((start[:, None] + steps) * points).astype(np.int64) % points for start in starts)
        ranges = [np.ptp(curve[places], axis=1) for curve, places in zip(self.curves, places_of_starts, strict=True)]
        # every test captures all of a drive without error
        return np.asarray((np.array(ranges) + _LEAST_ARCSEC) / (self.F_ior_arcsec + _LEAST_ARCSEC))

    def judge(self, plan: ReadingPlan) -> _PlanJudgement:
        """Return the share of F'_ior that a plan captures, with the probabilities of wrong verdicts."""
        demands = self.demands
        shares = self.seen_shares(plan, self.starts)
        rng = np.random.default_rng(self.seed)
        rng.random(self.starts.shape)  # skips the numbers of the starts, because the noise needs other ones
        share_percentiles = self.percentiles(shares)
        # with both directions, the larger range counts, which has the larger noise
        noise = demands.noise_arcsec * rng.standard_normal((1 + plan.both, *shares.shape)).max(axis=0)
        sees_all = plan.sees_all(self.travel or self.cycle_output)
        if self.left_arcsec is None:
            missed = _NEVER if sees_all else self.probability(shares < SEEN_SHARE)
            return _PlanJudgement(
                plan=plan,
                seen=share_percentiles,
                false_pass=None,
                false_fail=None,
                verdict=self._verdict(missed.low, missed.high),
            )
        # if required, readings are divided by the median share that the plan captures
        read = (shares * self.F_ior_arcsec + noise) / (share_percentiles[1] if demands.corrected else 1)
        passed = read <= self.left_arcsec
        good = self.F_ior_arcsec <= self.left_arcsec
        is_exact = sees_all and not demands.noise_arcsec
        false_pass, false_fail = (
            _NEVER if is_exact else self.probability(is_wrong) for is_wrong in (passed & ~good, good & ~passed)
        )
        low, high = (
            max(getattr(probability, end) for probability in (false_pass, false_fail)) for end in ("low", "high")
        )
        return _PlanJudgement(
            plan=plan,
            seen=share_percentiles,
            false_pass=false_pass,
            false_fail=false_fail,
            verdict=self._verdict(low, high),
        )

    def test_of(
        self,
        judged: _PlanJudgement,
        run: ApproachRun,
        ratio: float,
        limit: float | None,
    ) -> PlannedTest:
        """Return the test of a judged plan.

        A reading plus its guard band must be within the limit times the share that is captured in all but 5 % of drives
        and starts. A reading fails if it exceeds the limit by its guard band, because a test cannot capture more than
        F'_ior.

        judged: the judged plan.
        run: approaches of the positions.
        ratio: input revolutions per output revolution.
        limit: limit including the self error [arcsec], None without a limit.
        """
        guard = GUARD * self.demands.noise_arcsec
        planned = PlannedTest(
            judged=judged,
            run=run,
            ratio=ratio,
            uncertainty_arcsec=self.demands.noise_arcsec,
        )
        if self.left_arcsec is None or limit is None:
            return planned
        # the self error is part of every reading
        margin_arcsec = limit - self.left_arcsec
        least = judged.seen[0]
        # a test captures at least the share `least` in 95 % of drives and starts
        passes = max(limit * least - guard, 0.0)
        fails = limit + guard
        rng = np.random.default_rng([self.seed, 1])
        read = self.seen_shares(judged.plan, self.starts) * self.F_ior_arcsec + margin_arcsec
        read += self.demands.noise_arcsec * rng.standard_normal(read.shape)
        passing = self.probability(read <= passes)
        failing = self.probability(read > fails)
        return replace(
            planned,
            passes_up_to=passes,
            fails_beyond=fails,
            passing=passing,
            failing=failing,
        )

    def _verdict(self, low: float, high: float) -> Verdict:
        """Return the verdict on a probability of wrong verdicts, from the ends of its Monte Carlo interval."""
        if high <= self.demands.wrong:
            return Verdict.PASS
        return Verdict.FAIL if low > self.demands.wrong else Verdict.INCONCLUSIVE


@dataclass(frozen=True)
class EncoderData:
    """Encoders of a test rig.

    step_arcsec: step of the output encoder's readings [arcsec].
    graduation_arcsec: graduation error ± of the output encoder [arcsec].
    cam_step_deg: step of the input encoder's readings [deg].
    """

    step_arcsec: float = 0.0
    graduation_arcsec: float = 0.0
    cam_step_deg: float = 0.0

    @classmethod
    def of(cls, text: str) -> EncoderData:
        """Read a text such as "0.5,1,0.1". Raises UsageError for an invalid text."""
        numbers = [number_of(part) for part in text.split(",")]
        if len(numbers) > 3 or not all(0 <= number <= LARGEST_UNCERTAINTY for number in numbers):
            hint = (
                "state resolution and graduation error of the output encoder in arcsec, and resolution of the input "
                "encoder in deg, for example 0.5,1,0.1"
            )
            message = f"expected STEP[,GRADUATION[,CAM]], each from 0 to {LARGEST_UNCERTAINTY:g}"
            raise UsageError(f"invalid --encoders {text}: {message}", hint)
        return cls(*numbers)

    def uncertainty_arcsec(self, ratio: float) -> float:
        """Return the standard uncertainty of the difference of two readings [arcsec], with uniform errors."""
        # full widths of uniform distributions, whose variance is width^2/12
        widths = self.step_arcsec, 2 * self.graduation_arcsec, self.cam_step_deg * 3600 / ratio
        return sqrt(2 / 12) * hypot(*widths)


@dataclass(frozen=True)
class ApproachRun:
    """Approaches of the positions of a plan.

    repeats: repeats of all positions.
    dwell_s: dwell at each position [s].
    warm_up_min: warm-up [min].
    cam_rpm: input speed [rpm].
    lead_turns: input revolutions before the first position, which take up backlash and friction.
    """

    repeats: int = 1
    dwell_s: float = 5.0
    warm_up_min: float = 30.0
    cam_rpm: float = 60.0
    lead_turns: float = 1.0


@dataclass(frozen=True)
class PlannedTest:
    """A test with the details of its execution. The last four fields are None without a limit.

    judged: judgement of its plan.
    run: approaches of the positions.
    ratio: input revolutions per output revolution.
    uncertainty_arcsec: standard uncertainty of the measured range [arcsec].
    passes_up_to: largest reading that shows that the limit is met in 95 % of drives and starts, less the guard band
        [arcsec].
    fails_beyond: limit plus the guard band; a larger reading shows that the drive exceeds the limit [arcsec].
    passing, failing: probabilities that a reading passes and that it fails.
    """

    judged: _PlanJudgement
    run: ApproachRun
    ratio: float
    uncertainty_arcsec: float
    passes_up_to: float | None = None
    fails_beyond: float | None = None
    passing: Probability | None = None
    failing: Probability | None = None

    @property
    def readings(self) -> int:
        """Number of readings in all passes."""
        return self.run.repeats * (1 + self.judged.plan.both) * self.judged.plan.readings

    @property
    def minutes(self) -> float:
        """Duration including warm-up [min]."""
        run = self.run
        passes = self.readings // self.judged.plan.readings
        first, turn_back, between_min = self._moves_min
        moving = first + (passes - 1) * turn_back + (self.readings - passes) * between_min
        return run.warm_up_min + moving + self.readings * run.dwell_s / 60

    @property
    def _moves_min(self) -> tuple[float, float, float]:
        """Durations of the first move, of the move to the first reading of a later pass, and of other moves [min]."""
        plan = self.judged.plan
        run = self.run
        # input revolutions divided by revolutions per minute
        lead = run.lead_turns / run.cam_rpm
        between_min = plan.step_turns * self.ratio / run.cam_rpm
        # a pass in the same direction starts at the same position as the previous pass
        return lead, 2 * lead + (0.0 if plan.both else between_min * (plan.readings - 1)), between_min

    @property
    def approaches(self) -> tuple[Array, Array, Array]:
        """Times [min], output targets [deg] and sides of approach (1: from below, -1: from above) of all readings."""
        plan = self.judged.plan
        run = self.run
        forth = 360 * plan.step_turns * np.arange(plan.readings)
        # positions are approached from below first and, if planned, from above in descending sequence
        ways = 1 + plan.both
        target = np.tile(np.concatenate([forth, forth[::-1]][:ways]), run.repeats)
        side = np.tile(np.repeat([1, -1][:ways], plan.readings), run.repeats)
        first, turn_back, between_min = self._moves_min
        # the first move of each pass takes up the backlash
        moves = np.where(np.arange(len(target)) % plan.readings == 0, turn_back, between_min)
        moves[0] = first
        return run.warm_up_min + np.cumsum(moves + run.dwell_s / 60), target, side


@dataclass(frozen=True)
class _LineSeen:
    """A line of the error and its appearance in a test.

    per_output_turn, per_cam_turn: periods per output revolution and per input revolution.
    variance_share: share of the variance.
    seen_as: apparent periods in the test; 0 if the test does not show the line.
    """

    per_output_turn: float
    per_cam_turn: float
    variance_share: float
    seen_as: float


@dataclass(frozen=True, eq=False)
class PlanChoice:
    """Judged plans of a test of a drive at a torque.

    drive: the drive.
    M_g: torque [N*m].
    drives: drives that may be tested.
    asked: whether a plan was requested.
    judged: all compared plans, beginning with the requested one if there is one.
    enough: the sufficient plan with the fewest positions and the shortest sufficient recording, if there are any.
    over_positions: plans in ascending order of the number of positions.
    lines: lines of the error as the first plan shows them, the largest first.
    samples: samples of the drive; None without uncertain inputs.
    certificate: certificate of the solved states.
    verdict: whether the requested plan is sufficient; if none is requested, whether any plan is sufficient.
    test: the test with the details of its execution.
    """

    drive: Drive
    M_g: float
    drives: DrivesUnderTest
    asked: bool
    judged: tuple[_PlanJudgement, ...]
    enough: tuple[_PlanJudgement, ...]
    over_positions: tuple[_PlanJudgement, ...]
    lines: tuple[_LineSeen, ...]
    samples: Samples | None
    certificate: Certificate
    verdict: Verdict
    test: PlannedTest


@dataclass(frozen=True, eq=False)
class _SampledDrives:
    """Samples of a drive at a torque, with the lines and the curves of their errors."""

    samples: Samples | None  # samples; None without uncertain inputs, when the drive itself is the only sample
    place: int  # index of the torque
    lines: ErrorLines
    curves: _RoughCurves

    @classmethod
    def of(
        cls,
        drive: Drive,
        room_arcsec: Sequence[float | None],
        place: int,
        draws: int,
        run: Run,
    ) -> _SampledDrives:
        """Return the samples of a drive.

        drive: the drive.
        room_arcsec: largest F'_ior within each limit [arcsec], None without a limit, shape (torques,).
        place: index of the torque.
        draws: effective sample size, 0 for none.
        run: processes, progress and seed.
        """
        prior = prior_of(drive)
        samples = drive_samples(prior, room_arcsec, draws=draws, run=run) if prior.fields and draws else None
        changes = samples.values() if samples else [{}]
        lines = error_lines(drive, drive.operation.M_g[place], changes, run)
        curves = _curves_of_drives(drive, lines, samples, place, run)
        return cls(
            samples=samples,
            place=place,
            lines=lines,
            curves=curves,
        )

    @property
    def certificate(self) -> Certificate:
        """Certificate of all states behind the samples, their lines and their curves."""
        certificate = self.lines.certificate + self.curves.certificate
        return certificate + self.samples.certificate if self.samples else certificate

    def under_test(
        self,
        room_arcsec: float | None,
        demands: PlanDemands,
        travel_deg: float,
        seed: int,
    ) -> DrivesUnderTest:
        """Return the samples as drives that may be tested.

        room_arcsec: largest F'_ior within the limit [arcsec], None without a limit.
        demands: requirements for a plan.
        travel_deg: travel of the output in use [deg], 0 for whole revolutions.
        seed: seed of starts and noise.
        """
        kinematics = self.lines.kinematics
        drives = DrivesUnderTest(
            self.curves.arcsec,
            self.samples.weights if self.samples else np.ones(1),
            round(kinematics.cycle_cam_revolutions / abs(kinematics.u)),
            left_arcsec=room_arcsec,
            demands=demands,
            seed=seed,
        )
        drives = replace(drives, travel=_travel_turns(travel_deg, drives.cycle_output))
        return _with_stated_probability(drives, self.samples, self.place) if self.samples else drives


def choose_plan(
    drive: Drive,
    asked: ReadingPlan | None = None,
    *,
    demands: PlanDemands = PlanDemands(),
    test: ApproachRun = ApproachRun(),
    draws: int = EFFECTIVE_SAMPLES,
    travel_deg: float | None = None,
    run: Run = Run(),
) -> PlanChoice:
    """Judge plans of a test at the first torque with a limit, or at the first torque if there is no limit.

    drive: the drive.
    asked: requested plan, which is judged in addition to the usual plans; None if no plan is requested.
    demands: requirements for a plan.
    test: approaches of the positions.
    draws: effective sample size of the uncertain inputs, 0 for none.
    travel_deg: travel of the output [deg], by default that of the preset.
    run: processes, progress and seed.
    Raises UsageError for rolling balls, and UntrustedError as `check` does.
    """
    # lines require an error that is a function of the wheels' angles
    if not searchable(drive):
        raise UsageError("planning a test requires bearing.ball_motion: locked", "use --set bearing.ball_motion=locked")
    torques = drive.operation.M_g
    rooms = limits_left(drive, torques, run)
    # a test is planned for one torque
    place = next((k for k, room in enumerate(rooms.arcsec) if room is not None), 0)
    sampled = _SampledDrives.of(drive, rooms.arcsec, place, draws, run)
    lines = sampled.lines
    drives = sampled.under_test(rooms.arcsec[place], demands, travel_deg or drive.acceptance.travel, run.seed)
    plans = _judged_plans(drives, lines.kinematics, asked)
    return PlanChoice(
        drive=drive,
        M_g=torques[place],
        drives=drives,
        asked=asked is not None,
        judged=plans.judged,
        enough=plans.enough,
        over_positions=plans.over_positions,
        lines=_lines_seen(lines, drives, plans.judged[0].plan),
        samples=sampled.samples,
        certificate=rooms.certificate + sampled.certificate,
        verdict=plans.verdict,
        test=drives.test_of(plans.carried_out, test, abs(lines.kinematics.u), drive.limit(torques[place])),
    )


def _with_stated_probability(
    drives: DrivesUnderTest,
    samples: Samples,
    place: int,
) -> DrivesUnderTest:
    """Return drives with the probability of exceeding their limit as stated by `check`, for the full cycle only.

    drives: drives of the samples.
    samples: samples of the drive.
    place: index of the torque.
    """
    # `check` does not state a probability for a travel
    if drives.left_arcsec is None or drives.travel:
        return drives
    return replace(drives, stated_beyond=samples.probability_within(drives.left_arcsec, place).complement)


def _travel_turns(travel_deg: float, output_turns: int) -> float | None:
    """Return a travel of the output [deg] in revolutions; None if it is at least the full cycle."""
    travel_turns = travel_deg / 360
    return travel_turns if travel_turns < output_turns - 1e-9 else None


@dataclass(frozen=True)
class _JudgedPlans:
    """Judged plans of a test, with fields as in PlanChoice, and the plan that is carried out."""

    judged: tuple[_PlanJudgement, ...]
    enough: tuple[_PlanJudgement, ...]
    over_positions: tuple[_PlanJudgement, ...]
    verdict: Verdict
    carried_out: _PlanJudgement


def _judged_plans(
    drives: DrivesUnderTest,
    kinematics: Kinematics,
    asked: ReadingPlan | None,
) -> _JudgedPlans:
    """Judge plans of evenly spaced positions, of recordings, and the requested plan if there is one."""
    ratio = abs(kinematics.u)
    counts = range(_FEWEST_POSITIONS, round(_MOST_A_CAM_TURN * ratio) + 1)
    # all numbers are tried because aliasing makes single numbers useless
    over_positions = tuple(drives.judge(ReadingPlan.positions(N, drives.travel or 1.0)) for N in counts)
    # the longest recording covers everything that counts
    longest = drives.travel * ratio if drives.travel else float(kinematics.cycle_cam_revolutions)
    lengths = sorted(length for length in {1.0, 10.0, ratio, longest} if length <= longest)
    recordings = [drives.judge(ReadingPlan.record(length, ratio)) for length in lengths]
    fewest, shortest = (
        [judgement for judgement in judgements if judgement.verdict is Verdict.PASS][:1]
        for judgements in (over_positions, recordings)
    )
    asked_judgement = [drives.judge(asked)] if asked else []
    # plan with the number of positions that manufacturers state
    quoted = over_positions[_QUOTED_POSITIONS - _FEWEST_POSITIONS]
    # each plan appears once
    judged = tuple(
        {judgement.plan: judgement for judgement in [*asked_judgement, quoted, *fewest, *recordings]}.values()
    )
    # the requested plan decides; without one, a sufficient plan decides, or the longest recording if no plan suffices
    deciding = [*asked_judgement, *fewest, *shortest, recordings[-1]][0]
    return _JudgedPlans(
        judged=judged,
        enough=(*fewest, *shortest),
        over_positions=over_positions,
        verdict=deciding.verdict,
        carried_out=[*asked_judgement, *fewest, judged[0]][0],
    )


def _curves_of_drives(
    drive: Drive,
    lines: ErrorLines,
    samples: Samples | None,
    place: int,
    run: Run,
) -> _RoughCurves:
    """Return the error of sampled drives over the full cycle, including that due to rough teeth.

    The certificate covers only the rough teeth.

    drive: the drive.
    lines: lines of the error at the torque.
    samples: samples of the drive, whose F'_ior scales the curves; None without uncertain inputs.
    place: index of the torque.
    run: the run, whose seed determines the rough teeth.
    """
    curves = lines.curves
    # F'_ior of the samples, which includes components that the curves do not contain
    F_ior = samples.F_ior_arcsec[:, [place]] if samples else np.ptp(curves, axis=1, keepdims=True)
    changes = samples.values() if samples else [{}]
    rough = rough_curves(drive, drive.operation.M_g[place], changes, curves.shape[1], run)
    # rough teeth are added first, then the sum is scaled to F'_ior
    curves += rough.arcsec
    curves *= F_ior / np.maximum(
        np.ptp(
            curves,
            axis=1,
            keepdims=True,
        ),
        _LEAST_ARCSEC,
    )
    return _RoughCurves(arcsec=curves, certificate=rough.certificate)


@dataclass(frozen=True)
class _RoughCurves:
    """Error of drives due to rough teeth over the full cycle.

    arcsec: error [arcsec], shape (drives, points).
    certificate: certificate of the solved states.
    """

    arcsec: Array
    certificate: Certificate


def rough_curves(
    drive: Drive,
    M_g: float,
    changes: Sequence[Mapping[str, float]],
    points: int,
    run: Run = Run(),
) -> _RoughCurves:
    """Return the error due to rough teeth over the full cycle, for each drive.

    Only wheels with a pitch deviation f_p of 0 have rough teeth. A few wheels with independent deviations of the teeth
    are solved in the drive without other deviations. Each drive gets one of them per wheel, in a random position and
    scaled to an f_p of the prior of single teeth. The errors of both wheels add up.

    drive: the drive.
    M_g: torque [N*m].
    changes: values of the drives, by path.
    points: number of points over the cycle.
    run: the run, whose seed determines the teeth.
    """
    rng = np.random.default_rng([run.seed, 2])
    cycle_states = Kinematics.of(drive).cycle_states
    certificate = EMPTY
    # rough teeth are solved at states and interpolated between them
    state, part = np.divmod(np.arange(points) * cycle_states / points, 1)
    index = state.astype(np.int64)
    curves = np.zeros((len(changes), points))
    sizes_of_wheels = _rough_sizes(drive, changes, rng)
    for wheel, teeth in (("g", drive.gears.z_g), ("b", drive.gears.z_b)):
        sizes = sizes_of_wheels[wheel]
        if not sizes.any():
            continue
        # a few solved wheels represent all wheels; each drive has one of them in a random position
        wheels = [_solved_rough_wheel(drive, M_g, wheel, rng, run) for _ in range(_ROUGH_WHEELS)]
        for solved_wheel in wheels:
            certificate += solved_wheel.certificate
        for curve, size in zip(curves, sizes, strict=True):
            error = wheels[rng.integers(_ROUGH_WHEELS)].error_arcsec
            places = (index + rng.integers(teeth)) % teeth
            curve += size * (error[places] * (1 - part) + error[(places + 1) % teeth] * part)
    return _RoughCurves(curves, certificate)


def _rough_sizes(
    drive: Drive,
    changes: Sequence[Mapping[str, float]],
    rng: np.random.Generator,
) -> dict[str, Array]:
    """Draw f_p of rough teeth over that of the solved wheels, by wheel, shape (drives,) each; 0 for a known f_p.

    changes: values of the drives, by path.
    """
    share_g = rng.random(len(changes))
    share_b = share_of_second_wheel(share_g, rng.random(len(changes)))
    sizes = {}
    for wheel, number, share in (("g", 1, share_g), ("b", 2, share_b)):
        composite_path = f"tolerances.F_i{number}"
        pitch_path = f"tolerances.f_p{number}"
        composite = np.array([change.get(composite_path, drive.number(composite_path)) for change in changes])
        pitch = np.array([change.get(pitch_path, drive.number(pitch_path)) for change in changes])
        drawn_pitch = composite * largest_pitch_share(drive) * pitch_deviation_shares(share)
        # known pitch deviations are already part of the sampled orders
        sizes[wheel] = np.where(pitch, 0.0, drawn_pitch / _ROUGH_UM)
    return sizes


@dataclass(frozen=True, eq=False)
class _RoughWheel:
    """Error due to rough teeth of one wheel.

    error_arcsec: error by tooth in contact [arcsec], shape (teeth,).
    certificate: certificate of the solved states.
    """

    error_arcsec: Array
    certificate: Certificate


def _solved_rough_wheel(
    drive: Drive,
    M_g: float,
    wheel: str,
    rng: np.random.Generator,
    run: Run,
) -> _RoughWheel:
    """Return the error of a drive without other deviations, due to a wheel whose teeth deviate independently.

    M_g: torque [N*m].
    wheel: g for the flexspline, b for the circular spline.
    """
    count = drive.gears.z_g if wheel == "g" else drive.gears.z_b
    teeth = spread_of_teeth(count) * rng.standard_normal(count)
    # without other deviations, the error is that of the wheel
    smooth = drive.with_values({deviation.size: 0.0 for deviation in DEVIATIONS})
    # with one state per tooth, each tooth meets each mesh zone once
    states = pitch_locked_states(Kinematics.of(drive), np.arange(count))
    deviations = ToothDeviations(**{wheel: _ROUGH_UM * teeth})
    solved = kinematic_error(
        smooth,
        M_g,
        states=states,
        teeth=deviations,
        run=UNCHECKED,
    )
    run.solved(solved.certificate.states)
    return _RoughWheel(solved.error_arcsec - solved.error_arcsec.mean(), solved.certificate)


def _lines_seen(
    lines: ErrorLines,
    drives: DrivesUnderTest,
    plan: ReadingPlan,
) -> tuple[_LineSeen, ...]:
    """Return the largest lines of drives as a plan shows them."""
    power = np.abs(lines.amplitude) ** 2
    # the share of a line in the variance is averaged over the drives
    total_power = np.maximum(power.sum(axis=1, keepdims=True), _LEAST_ARCSEC)
    shares = np.average(
        power / total_power,
        axis=0,
        weights=drives.weights,
    )
    largest = np.argsort(-shares)[:_LISTED_LINES]
    often = lines.per_cycle[largest] / drives.cycle_output
    per_cam_turn = lines.per_cycle[largest] / lines.kinematics.cycle_cam_revolutions
    columns = (often, per_cam_turn, shares[largest], plan.seen_as(often))
    return tuple(_LineSeen(*map(float, row)) for row in zip(*columns, strict=True))
