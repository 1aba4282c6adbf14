"""Where to mount the fixed wheel: the gain of each position over all that is not known of the drive, and the order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from hdassist.belief.evidence import evidence_of, measured_errors
from hdassist.belief.influence import Influence, influences_on
from hdassist.belief.measure import MeasurementGain, gains_for
from hdassist.belief.prior import prior_of
from hdassist.belief.samples import (
    EFFECTIVE_SAMPLES,
    Samples,
    SamplingEffort,
    draw_samples,
    limits_settled,
)
from hdassist.belief.statistics import Probability, could_be_sure
from hdassist.error.error_map import SEARCHED, searchable
from hdassist.error.self_error import limits_left
from hdassist.error.sloped import DRAWN_STATES
from hdassist.model.deviations import standing_offset
from hdassist.model.kinematics import Kinematics
from hdassist.model.unknown import Unknown, no_hole_better, unknown_turn, unknowns
from hdassist.model.wheels import MeasuredTeeth
from hdassist.mounting.corrected import CorrectedPositions
from hdassist.mounting.curve import is_searched, mounting_curve
from hdassist.mounting.losses import LEAST_TURNED_GAIN, PositionStatistics
from hdassist.mounting.positions import Choice, MountingCurve, Position, usable_positions
from hdassist.preset.fields import Drive
from hdassist.run.run import Run
from hdassist.verdict import SURE, Verdict, verdict_by_probability

GAIN_DRAWS = 4  # times as many, at most, where chance leaves open whether a turn gains: they halve the interval


@dataclass(frozen=True, eq=False)
class Advice:
    """Advice on one drive.

    curve of the drive as the preset has it, with unknown deviations as 0; samples of the uncertain inputs, None
    without samples; positions over them; gain_probability, that of the best other
    position to be better than the present one; stay_probability, that the present one is nearly as good as the best;
    measured: wheels in place of first harmonics, for which there is the curve alone; unknown: deviations that are not
    known; open_: fields, by path, that are not known exactly; as_given: whether to order by the values as given
    without samples; needed: probability of a gain for which a turn is ordered; corrected: what a stored
    correction leaves in the positions, where the order goes by that.
    """

    drive: Drive
    curve: MountingCurve
    samples: Samples | None = None
    positions: PositionStatistics | None = None
    gain_probability: Probability | None = None
    stay_probability: Probability | None = None
    measured: MeasuredTeeth | None = None
    unknown: tuple[Unknown, ...] = ()
    open_: tuple[str, ...] = ()
    as_given: bool = True
    needed: float = SURE
    corrected: CorrectedPositions | None = None

    @property
    def chosen(self) -> Position:
        """The position to choose."""
        return self.choice.chosen

    @property
    def gain(self) -> float:
        """Share of the error of the present position that the chosen one takes off, at the torque served worst."""
        return self.gain_range[1]

    @property
    def gain_range(self) -> tuple[float, float, float]:
        """5th percentile, median and 95th percentile of the gain; all the same without samples."""
        if not self.positions:
            return (-self.curve.recommended.change_from(self.curve.current),) * 3
        return self.positions.range_of(self.positions.gains(self.positions.best))

    @property
    def best_gain_range(self) -> tuple[float, float, float]:
        """The same of the position that is the best one in each sample, whichever that is."""
        return self.positions.range_of(self.positions.best_gains) if self.positions else self.gain_range

    @property
    def any_hole(self) -> bool:
        """Whether the direction that decides is unknown, and F'_ior not measured: any hole may be the best one."""
        is_known = self.no_hole_better or measured_errors(self.drive)
        return bool(self.unknown and unknown_turn(self.drive) and not is_known)

    @property
    def no_hole_better(self) -> str:
        """Why any hole is as good as any other, as model.unknown has it; empty where one may be better."""
        found = no_hole_better(self.drive)
        return "" if found == "turning" and self.measured and self.measured.fixed(self.drive) else found

    @property
    def has_curve(self) -> bool:
        """Whether the curve means anything: without the size of the offset that stands still it is flat."""
        return not self.any_hole or self.drive.value(standing_offset(self.drive)[0]) is not None

    @cached_property
    def order(self) -> str:
        """Order on the wheel: turn, leave, or none, where unknown inputs could reverse it.

        A turn is ordered where it gains more than LEAST_GAIN with the probability that is needed; the wheel is left
        where that is as improbable, or no position is clearly better than the present one. A forbidden position is
        always left. Without unknown inputs, or where they are wanted as given, the curve decides, unless a deviation is
        not known.
        """
        forbidden = not self.curve.usable[0]
        if self.no_hole_better:
            return "turn" if forbidden else "leave"
        undrawn = not self.positions and bool(self.unknown or (self.open_ and not self.as_given))
        if self.any_hole or undrawn:
            return "none"
        if forbidden:
            return "turn"
        if self.order_corrected != "none":
            return self.order_corrected
        if self.gain_probability is None:
            return "turn" if self.gain > LEAST_TURNED_GAIN else "leave"
        verdict = verdict_by_probability(self.gain_probability.value, self.needed)
        if verdict is Verdict.PASS and self.positions and self.positions.chosen[0]:
            return "turn"
        stays = self.stay_probability is not None and self.stay_probability.value >= self.needed
        return "leave" if verdict is Verdict.FAIL or stays else "none"

    @cached_property
    def order_corrected(self) -> str:
        """Order by what a stored correction leaves; none where that tells no position from another."""
        return self.corrected.order(self.needed) if self.corrected else "none"

    @property
    def to_try(self) -> tuple[Position, ...]:
        """Usable positions, three that lie apart as far as they can, in which trials would tell; none measured yet."""
        tried = {each.rotation_deg for each in measured_errors(self.drive)}
        usable = sorted(self.choice.ranked, key=lambda p: p.rotation_deg)
        usable = [p for p in usable if p.rotation_deg not in tried] or usable
        wanted = (0.0, 120.0, 240.0)
        near = [min(usable, key=lambda p: abs((p.rotation_deg - at + 180) % 360 - 180)) for at in wanted]
        return tuple({p.rotation_deg: p for p in near}.values())

    @cached_property
    def choice(self) -> Choice:
        """The chosen position beside the others; where there are samples, with the median F'_ior over them."""
        curve, turn = self.curve, self.order == "turn"
        found = Choice(self.drive, curve.torques, curve.current, curve.recommended, turn, tuple(curve.ranked))
        if self.positions:
            found = self.positions.choice(self.drive, self.drive.number(standing_offset(self.drive)[1]))
            found = replace(found, torques=curve.torques, turn=turn)
        if self.corrected and self.order_corrected == "turn":
            best = self.corrected.most.rotations_deg[self.corrected.most.challenger or 0]
            return replace(found, chosen=next(p for p in found.ranked if p.rotation_deg == best))
        return found

    @cached_property
    def _log_ratios(self) -> np.ndarray | None:
        """Logarithm of F'_ior in the best other position over that now, at the torque served worst, (samples,)."""
        if not self.positions or (place := self.positions.challenger) is None:
            return None
        return np.asarray(np.log(np.maximum(1 - self.positions.gains(place), 1e-9)))

    @cached_property
    def influences(self) -> tuple[Influence, ...]:
        """Shares of the variance of the logarithm of that ratio by field, the largest first."""
        if self.samples is None or self._log_ratios is None:
            return ()
        return influences_on(self.samples.of_ranges, self._log_ratios)

    @cached_property
    def to_measure(self) -> tuple[MeasurementGain, ...]:
        """Measurements that would settle the order, by how much more often it would be right; empty where settled."""
        if self.order != "none" or self.samples is None or self._log_ratios is None:
            return ()
        return gains_for(self.samples.of_ranges, self._log_ratios, np.log(1 - LEAST_TURNED_GAIN))


def advice_states(drive: Drive, positions: int, *, draws: int, measured: MeasuredTeeth | None = None) -> int:
    """Number of states that an advice at so many positions solves, about, for a progress bar."""
    cycle, torques = Kinematics.of(drive).cycle_states, len(drive.operation.M_g)
    drawn = bool(draws and prior_of(drive).fields) and not measured and searchable(drive)
    if not is_searched(drive, positions, drawn=drawn, measured=measured):
        return torques * positions * cycle
    sampled = draws * DRAWN_STATES * (1 + positions) if drawn else 0
    return torques * (positions * SEARCHED + 2 * cycle + sampled)


def advise(
    drive: Drive,
    torques: Sequence[float],
    rotations_deg: Sequence[float],
    *,
    measured: MeasuredTeeth | None = None,
    draws: int = EFFECTIVE_SAMPLES,
    needed: float = SURE,
    run: Run = Run(),
) -> Advice:
    """Find the position in which to mount the fixed wheel of a drive.

    Arguments: torques [N*m]; rotations_deg, positions of the curve [deg], 0 first, where the wheel stands; measured,
    wheels in place of first harmonics, for which no deviation is drawn; draws, effective samples of uncertain inputs at
    least, 0 for none; needed, probability of a gain for which a turn is ordered, to which that of keeping a limit is
    drawn too, as `check` does. Raises UsageError for invalid positions, UntrustedError where an answer cannot be
    trusted, or the preset's catalogue contradicts its other values.
    """
    known = measured.without_harmonics(drive) if measured else drive
    prior = prior_of(known)
    drawn = draws > 0 and bool(prior.fields) and not measured and searchable(drive)
    curve = mounting_curve(drive, torques, rotations_deg, measured=measured, drawn=drawn, run=run)
    # of a measured wheel all is known
    open_ = tuple(each.path for each in prior.fields if known.value(each.path) == drive.value(each.path))
    advice = Advice(
        drive, curve, measured=measured, unknown=unknowns(known), open_=open_, as_given=not draws, needed=needed
    )
    if not drawn:
        return advice
    positions = tuple(usable_positions(drive.mounting.holes, drive.mounting.allowed))
    left, of = limits_left(drive, torques), partial(PositionStatistics.of, rotations_deg=positions)

    def with_samples(samples: Samples) -> Advice:
        """The advice with positions over the samples, and the probabilities that an order rests on."""
        found = of(samples.of_ranges)
        now, place = found.place(0.0), found.challenger
        gain = None if place is None else samples.probability(lambda stage: of(stage).is_better(place), needed)
        stay = None if now is None else samples.probability(lambda stage: of(stage).is_close(now), needed)
        return replace(advice, samples=samples, positions=found, gain_probability=gain, stay_probability=stay)

    def enough(samples: Samples) -> bool:
        found = with_samples(samples)
        gain, can_order = found.gain_probability, not found.any_hole and found.order == "none"
        more = can_order and gain and could_be_sure(gain, samples.effective, GAIN_DRAWS * draws, needed)
        return limits_settled(left, samples, needed) and not more

    samples = draw_samples(
        prior, torques, rotations_deg=sorted({0.0, *positions}), evidence=evidence_of(drive), enough=enough,
        effort=SamplingEffort.of(draws), run=run,
    )  # fmt: skip
    return with_samples(samples)
