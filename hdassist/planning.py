"""Which test of F'_ior is enough: the share of it that readings at some positions see, over all that is not known.

And the test itself, as it can be carried out: approaches in their order, how long they take, and the readings of a
limit that pass and fail.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from hdassist.belief.prior import prior_of
from hdassist.belief.samples import EFFECTIVE_SAMPLES, Samples, drive_samples
from hdassist.belief.statistics import Probability, probability_of, weighted_quantile
from hdassist.error.cycle import kinematic_error, limits_left
from hdassist.error.error_map import searchable
from hdassist.error.waves import POINTS_A_TURN, ErrorLines, error_lines
from hdassist.errors import GUARD, UsageError, Verdict
from hdassist.files import number_of
from hdassist.measuring.orders import LARGEST_UNCERTAINTY
from hdassist.model.deviations import ToothDeviations
from hdassist.model.geometry import Array, Kinematics, pitch_locked_states
from hdassist.preset.fields import DEVIATIONS, Drive
from hdassist.run.run import UNCHECKED, Run
from hdassist.solve.answers import EMPTY, Certificate

_QUOTED_POSITIONS = 12  # positions of a test as manufacturers quote it
_FEWEST_POSITIONS = 6  # that are tried
_MOST_A_CAM_TURN = 5  # positions that are tried, for each input revolution
_RANDOM_STARTS = 256  # over all samples
_LEAST_STARTS = 16  # random starts of each sample, at least
_LEAST_ARCSEC = 1e-9  # a test captures all of an error below this size [arcsec]
_LISTED_LINES = 12  # the largest
_NEVER = Probability(0.0, 0.0, 0.0)  # of a test that sees all: no chance is in it
SEEN_SHARE = 0.95  # share of F'_ior that a sufficient test captures if there is no limit
_ROUGH_NOISE = 0.03  # largest rms of single teeth, as a share of F'_i; evenly distributed from 0 (engineering estimate)
_ROUGH_ORDERS = range(5, 13)  # around a wheel
_ROUGH_SIZE = 0.1  # scale of Rayleigh's law over the order
_ROUGH_WHEELS = 8  # drawn of each kind
_ROUGH_UM = 50.0  # F'_i at which they are solved


@dataclass(frozen=True)
class ReadingPlan:
    """Readings at even steps of the output, from an angle that is not known.

    name in words; step_turns [output turns]; both: whether the same is done backwards too, and the greater range
    counts; is_record: whether they stand for a record without gaps.
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
        """Return the plan of positions spread evenly over output revolutions."""
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
        """Return a record over turns of the cam, of which there are so many in a turn of the output."""
        name = f"record of {cam_turns:.4g} cam turn{'' if cam_turns == 1 else 's'}"
        return cls(
            name,
            max(round(cam_turns * POINTS_A_TURN), 2),
            1 / POINTS_A_TURN / ratio,
            is_record=True,
        )

    def sees_all(self, output_turns: float) -> bool:
        """Return whether no part is left out of so many output turns."""
        return self.is_record and self.readings * self.step_turns >= output_turns - 1e-9

    def seen_as(self, per_output_turn: Array) -> Array:
        """Return how often lines seem to occur in the test; 0 if all readings show the same, and it is blind to them.

        A line that comes f times an output turn goes on by f times the step from reading to reading, of which whole
        turns do not show: of N readings over k turns it looks like f k mod N, or N less that.
        """
        # readings show a line modulo whole periods from one to the next
        phase = per_output_turn * self.step_turns
        return np.asarray(np.round(np.abs(phase - np.rint(phase)) * self.readings, 6))


@dataclass(frozen=True)
class PlanDemands:
    """Demands on a test.

    wrong: share of all tested drives that may pass though beyond the limit, or fail though within, at most;
    noise_arcsec: standard uncertainty of the range that it reads; corrected: whether that is divided by the median
    share that the plan sees.
    """

    wrong: float = 0.05
    noise_arcsec: float = 0.0
    corrected: bool = False


@dataclass(frozen=True)
class _PlanJudgement:
    """The part of F'_ior that a plan sees: share at 5, 50 and 95 % of drives and starts.

    false_pass: probability that a drive passes though beyond the limit; false_fail: that it fails though within; None
    without a limit. verdict: PASS where both keep what is demanded, over the whole Monte
    Carlo interval; without a limit, where less than SEEN_SHARE of F'_ior is seen as seldom as that.
    """

    plan: ReadingPlan
    seen: tuple[float, float, float]
    false_pass: Probability | None
    false_fail: Probability | None
    verdict: Verdict


@dataclass(frozen=True, eq=False)
class DrivesUnderTest:
    """Drives that may come to a test: their error [arcsec] over the full cycle, shape (drives, points), and weights.

    cycle_output: output turns of the cycle; left_arcsec: the room that the limit leaves F'_ior, None without one;
    demands; seed of the starts and of the noise; travel: output turns in use, from where the test starts, whose range
    is F'_ior; stated_beyond: probability of being beyond the limit as check states it, None if it states none.
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
        """Where tests start, as shares of the cycle, shape (drives, starts)."""
        drives = len(self.curves)
        return np.random.default_rng(self.seed).random((drives, max(_LEAST_STARTS, _RANDOM_STARTS // drives)))

    @cached_property
    def F_ior_arcsec(self) -> Array:
        """F'_ior of each drive, shape (drives, 1); of the travel from each start, shape (drives, starts)."""
        if self.travel is None:
            return np.asarray(
                np.ptp(
                    self.curves,
                    axis=1,
                    keepdims=True,
                )
            )
        # extremes of half input revolutions, so that a travel is a few of them
        halves = self.curves.reshape(len(self.curves), -1, POINTS_A_TURN // 2)
        count = halves.shape[1]
        reach = np.arange(min(count, int(self.travel / self.cycle_output * count) + 2))
        # the travel from each start, rounded outwards
        places = np.floor(self.starts[..., None] * count + reach).astype(np.int64) % count
        high, low = (np.take_along_axis(extreme[:, None], places, axis=2) for extreme in (halves.max(2), halves.min(2)))
        return np.asarray(high.max(axis=2) - low.min(axis=2))

    def percentiles(self, values: Array) -> tuple[float, float, float]:
        """Return the 5th, 50th and 95th percentile of values, shape (drives, starts)."""
        weights = np.broadcast_to(self.weights[:, None], values.shape).ravel()
        low, middle, high = (weighted_quantile(values.ravel(), weights, share) for share in (0.05, 0.5, 0.95))
        return low, middle, high

    def probability(self, outcome: NDArray[np.bool_]) -> Probability:
        """Return the probability of an outcome, shape (drives, starts), with its Monte Carlo interval."""
        # starts of one drive are not independent: drives are the samples
        interval = probability_of(outcome.mean(axis=1), self.weights)
        return interval if len(outcome) > 1 else Probability(interval.value, interval.value, interval.value)

    @property
    def beyond(self) -> Probability | None:
        """Probability that a drive is beyond the limit; None without one."""
        if self.stated_beyond is not None:
            return self.stated_beyond
        # without a limit nothing can be beyond it
        return None if self.left_arcsec is None else self.probability(self.F_ior_arcsec > self.left_arcsec)

    def seen_shares(self, plan: ReadingPlan, starts: Array) -> Array:
        """Return the share of F'_ior that a plan sees from starts, shares of the cycle, shape (drives, starts)."""
        # as shares of the cycle
        steps = np.arange(plan.readings) * plan.step_turns / self.cycle_output
        points = self.curves.shape[1]
        places_of_starts = (np.rint((start[:, None] + steps) * points).astype(np.int64) % points for start in starts)
        ranges = [np.ptp(curve[places], axis=1) for curve, places in zip(self.curves, places_of_starts, strict=True)]
        # a drive without error shows all of it
        return np.asarray((np.array(ranges) + _LEAST_ARCSEC) / (self.F_ior_arcsec + _LEAST_ARCSEC))

    def judge(self, plan: ReadingPlan) -> _PlanJudgement:
        """Return the part that a plan sees, and how often its verdict is wrong."""
        demands = self.demands
        shares = self.seen_shares(plan, self.starts)
        rng = np.random.default_rng(self.seed)
        # numbers of the noise are not those of the starts
        rng.random(self.starts.shape)  # which the starts are
        share_percentiles = self.percentiles(shares)
        # from both sides the larger range counts, and the larger noise with it
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
        # corrected by the median share, if that is wanted
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
        """Return the test of a judged plan; ratio: cam turns an output turn; limit: with the self error.

        A reading with its guard band over the share that is seen at 5 % of drives and starts has to keep the limit; one
        beyond the limit by its guard band fails, as a test sees no more than there is.
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
        # the self error: every reading contains it
        margin_arcsec = limit - self.left_arcsec
        least = judged.seen[0]
        # a test captures at least this share of 95 % of drives
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
        """Return whether a probability of being wrong, by the ends of its Monte Carlo interval, is allowed."""
        if high <= self.demands.wrong:
            return Verdict.PASS
        return Verdict.FAIL if low > self.demands.wrong else Verdict.INCONCLUSIVE


@dataclass(frozen=True)
class EncoderData:
    """Encoders of a rig: step of the output's readings and graduation error ± [arcsec], step of the cam's [deg]."""

    step_arcsec: float = 0.0
    graduation_arcsec: float = 0.0
    cam_step_deg: float = 0.0

    @classmethod
    def of(cls, text: str) -> EncoderData:
        """Read "0.5,1,0.1". Raises UsageError: no such text."""
        numbers = [number_of(part) for part in text.split(",")]
        if len(numbers) > 3 or not all(0 <= number <= LARGEST_UNCERTAINTY for number in numbers):
            hint = (
                "output encoder: step and graduation error in arcsec; input encoder: step in deg; for example 0.5,1,0.1"
            )
            message = f"expected STEP[,GRADUATION[,CAM]], each from 0 to {LARGEST_UNCERTAINTY:g}"
            raise UsageError(f"invalid --encoders {text}: {message}", hint)
        return cls(*numbers)

    def uncertainty_arcsec(self, ratio: float) -> float:
        """Return standard uncertainty of the difference of two readings, whose errors are even within their limits."""
        # full widths of even distributions, whose variance is width^2/12
        widths = self.step_arcsec, 2 * self.graduation_arcsec, self.cam_step_deg * 3600 / ratio
        return sqrt(2 / 12) * hypot(*widths)


@dataclass(frozen=True)
class ApproachRun:
    """How positions of a plan are approached: repeats of all, dwell at each [s], warm-up [min], speed of the cam [rpm].

    lead_turns: of the cam, from before the first position, so that play and friction are taken up.
    """

    repeats: int = 1
    dwell_s: float = 5.0
    warm_up_min: float = 30.0
    cam_rpm: float = 60.0
    lead_turns: float = 1.0


@dataclass(frozen=True)
class PlannedTest:
    """A test as it can be carried out: its judgement, how it is run, standard uncertainty [arcsec] of the range read.

    passes_up_to, fails_beyond: readings [arcsec] at which a limit is kept in 95 of 100 drives of the plan,
    and surely is not; passing, failing: probability of either; None without a limit.
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
        """Readings of all passes."""
        return self.run.repeats * (1 + self.judged.plan.both) * self.judged.plan.readings

    @property
    def minutes(self) -> float:
        """Duration, warm-up included."""
        run = self.run
        passes = self.readings // self.judged.plan.readings
        first, turn_back, between_min = self._moves_min
        moving = first + (passes - 1) * turn_back + (self.readings - passes) * between_min
        return run.warm_up_min + moving + self.readings * run.dwell_s / 60

    @property
    def _moves_min(self) -> tuple[float, float, float]:
        """Duration [min] of the move to the first reading of all, to that of each later pass, and to any other."""
        plan = self.judged.plan
        run = self.run
        # input revolutions over revolutions per minute
        lead = run.lead_turns / run.cam_rpm
        between_min = plan.step_turns * self.ratio / run.cam_rpm
        # a pass one way begins where the last began
        return lead, 2 * lead + (0.0 if plan.both else between_min * (plan.readings - 1)), between_min

    @property
    def approaches(self) -> tuple[Array, Array, Array]:
        """Minute at which each reading is taken, target [deg] of the output, and side 1 or -1; all in their order."""
        plan = self.judged.plan
        run = self.run
        forth = 360 * plan.step_turns * np.arange(plan.readings)
        # from below, and if planned from above in falling order
        ways = 1 + plan.both
        target = np.tile(np.concatenate([forth, forth[::-1]][:ways]), run.repeats)
        side = np.tile(np.repeat([1, -1][:ways], plan.readings), run.repeats)
        first, turn_back, between_min = self._moves_min
        # the first move of each pass takes up the play
        moves = np.where(np.arange(len(target)) % plan.readings == 0, turn_back, between_min)
        moves[0] = first
        return run.warm_up_min + np.cumsum(moves + run.dwell_s / 60), target, side


@dataclass(frozen=True)
class _LineSeen:
    """A line of the error: how often it comes in a turn of the output and of the cam, and its share of the variance.

    seen_as: how often it seems to come in a test, 0 if that is blind to it.
    """

    per_output_turn: float
    per_cam_turn: float
    variance_share: float
    seen_as: float


@dataclass(frozen=True, eq=False)
class PlanChoice:
    """Plans of a test of a drive at a torque M_g [N*m], judged.

    judged: all plans that were compared, first the one that was asked about, where one was; enough: the fewest
    positions and the shortest record that are enough, as far as there are such; over_positions: plans by their number
    of positions, rising; lines of the error as the first plan sees them, the largest first; samples of the drive, None
    where all is known; verdict: whether the plan that was asked about is enough, without one whether any is.
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

    samples: Samples | None  # None without uncertain inputs: the drive itself is the only one then
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

        Args:
            drive: the drive.
            room_arcsec: F'_ior that its limits leave, None without a limit, shape (torques,).
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
        """The certificate of all states behind the samples, their lines and their curves."""
        certificate = self.lines.certificate + self.curves.certificate
        return certificate + self.samples.certificate if self.samples else certificate

    def under_test(
        self,
        room_arcsec: float | None,
        demands: PlanDemands,
        travel_deg: float,
        seed: int,
    ) -> DrivesUnderTest:
        """Return the samples as drives that come to a test.

        Args:
            room_arcsec: F'_ior that the limit leaves, None without a limit.
            demands: what a plan has to meet.
            travel_deg: of the output in use [deg], 0 for whole revolutions.
            seed: of the starts and of the noise.
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
    """Judge plans of a test at the first torque of a drive that has a limit, at the first one without any limit.

    Args:
        drive: the drive.
        asked: a plan to judge besides the others.
        demands: what a plan has to meet.
        test: how it is carried out.
        draws: effective sample size of the uncertain inputs, 0 for none.
        travel_deg: of the output [deg], by default the preset's.
        run: processes, progress and seed.

    Raises UsageError for rolling balls, UntrustedError as `check` does.
    """
    # lines need an error that is a function of the wheels' angles
    if not searchable(drive):
        raise UsageError("a plan needs bearing.ball_motion: locked", "use --set bearing.ball_motion=locked")
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
    """Return drives with the probability that they exceed their limit as `check` states it, of the full cycle only.

    Args:
        drives: of the samples.
        samples: of the drive.
        place: index of the torque.
    """
    # of a travel `check` states no probability
    if drives.left_arcsec is None or drives.travel:
        return drives
    return replace(drives, stated_beyond=samples.probability_within(drives.left_arcsec, place).complement)


def _travel_turns(travel_deg: float, output_turns: int) -> float | None:
    """Return a travel of the output [deg] in revolutions, None if it is no less than those of the full cycle."""
    travel_turns = travel_deg / 360
    return travel_turns if travel_turns < output_turns - 1e-9 else None


@dataclass(frozen=True)
class _JudgedPlans:
    """Plans of a test, judged; the fields as in PlanChoice, and the plan that is carried out."""

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
    """Judge plans of evenly spaced positions and of recordings, and the one that was asked about."""
    ratio = abs(kinematics.u)
    counts = range(_FEWEST_POSITIONS, round(_MOST_A_CAM_TURN * ratio) + 1)
    # all numbers, since aliasing makes single ones useless
    over_positions = tuple(drives.judge(ReadingPlan.positions(N, drives.travel or 1.0)) for N in counts)
    # the recording of everything that counts
    longest = drives.travel * ratio if drives.travel else float(kinematics.cycle_cam_revolutions)
    lengths = sorted(length for length in {1.0, 10.0, ratio, longest} if length <= longest)
    recordings = [drives.judge(ReadingPlan.record(length, ratio)) for length in lengths]
    fewest, shortest = (
        [judgement for judgement in judgements if judgement.verdict is Verdict.PASS][:1]
        for judgements in (over_positions, recordings)
    )
    asked_judgement = [drives.judge(asked)] if asked else []
    # the number that manufacturers state
    quoted = over_positions[_QUOTED_POSITIONS - _FEWEST_POSITIONS]
    # each plan once
    judged = tuple(
        {judgement.plan: judgement for judgement in [*asked_judgement, quoted, *fewest, *recordings]}.values()
    )
    # the wanted plan, else any sufficient one, else the longest recording
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
    """Return the error of sampled drives over the full cycle, that by rough teeth included.

    Args:
        drive: the drive.
        lines: of the error at the torque.
        samples: of the drive, None without uncertain inputs; F'_ior is theirs, as every page has it.
        place: index of the torque.
        run: its seed among it.

    The certificate is that of the rough teeth.
    """
    curves = lines.curves
    # the range that `check` states, whatever the curves leave out
    F_ior = samples.F_ior_arcsec[:, [place]] if samples else np.ptp(curves, axis=1, keepdims=True)
    changes = samples.values() if samples else [{}]
    rough = rough_curves(drive, drive.operation.M_g[place], changes, curves.shape[1], run)
    # single teeth first, then all of it is scaled to F'_ior
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
    """Error of drives by rough teeth over the full cycle.

    arcsec: the error, shape (drives, points).
    certificate: proof of all states behind it.
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
    """Return the error by rough teeth over the full cycle of drives.

    Of wheels whose single pitch deviation counts as 0: harmonics and noise of single teeth, in proportion to their
    composite deviation, are solved in the drive without other deviations, where the error is that of one wheel plus
    that of the other; of some wheels, in a random position in each drive. Arguments: M_g [N*m]; changes of the drive by
    path; points of the cycle; run, its seed among it.
    """
    rng = np.random.default_rng([run.seed, 2])
    cycle_states = Kinematics.of(drive).cycle_states
    certificate = EMPTY
    # rough teeth are solved at states and interpolated between them
    state, part = np.divmod(np.arange(points) * cycle_states / points, 1)
    index = state.astype(np.int64)
    curves = np.zeros((len(changes), points))
    for wheel, teeth, number in (("g", drive.gears.z_g, 1), ("b", drive.gears.z_b, 2)):
        sizes = _rough_sizes(drive, changes, number)
        if not sizes.any():
            continue
        # a few solved wheels stand for all; each drive has one in a random direction
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
    number: int,
) -> Array:
    """Return the sizes of rough teeth of drives, in those of the solved wheels, shape (drives,); 0 for known pitch.

    changes: values of the drives by path.
    number: of the wheel, 1 for the flexspline and 2 for the circular spline.
    """
    composite_path = f"tolerances.F_i{number}"
    pitch_path = f"tolerances.f_p{number}"
    composite = np.array([change.get(composite_path, drive.number(composite_path)) for change in changes])
    pitch = np.array([change.get(pitch_path, drive.number(pitch_path)) for change in changes])
    # known pitch deviations are among the sampled orders already
    return np.where(pitch, 0.0, composite / _ROUGH_UM)


@dataclass(frozen=True, eq=False)
class _RoughWheel:
    """Error of a drive by rough teeth of one wheel [arcsec], by its teeth in contact, shape (teeth,), with proof."""

    error_arcsec: Array
    certificate: Certificate


def _solved_rough_wheel(
    drive: Drive,
    M_g: float,
    wheel: str,
    rng: np.random.Generator,
    run: Run,
) -> _RoughWheel:
    """Return the error of a drive without other deviations by a wheel with drawn teeth.

    M_g: torque [N*m].
    wheel: g for the flexspline, b for the circular spline.
    """
    count = drive.gears.z_g if wheel == "g" else drive.gears.z_b
    angle = 2 * np.pi * np.arange(count) / count
    # independent teeth, and orders that fall with their number
    teeth = rng.uniform(0, _ROUGH_NOISE) * rng.standard_normal(count)
    for order in _ROUGH_ORDERS:
        teeth += _ROUGH_SIZE * rng.rayleigh() / order / 2 * np.cos(order * angle - 2 * np.pi * rng.random())
    # the effect of one wheel alone
    smooth = drive.with_values({deviation.size: 0.0 for deviation in DEVIATIONS})
    # each tooth meets each mesh zone once in so many states
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
    """Return the largest lines of drives as a plan sees them."""
    power = np.abs(lines.amplitude) ** 2
    # shares of each drive's own variance, then their mean
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
