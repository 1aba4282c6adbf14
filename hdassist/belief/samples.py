"""Weighted samples of a drive: joint draws of all that is not known, each solved, weighted by the evidence.

Importance sampling: draws come from the prior, then from a proposal nearer the evidence, and are weighted by their
likelihood over its density.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from hdassist.belief.draws import Draw, FiguresOf, Sampling, UnderWay
from hdassist.belief.evidence import (
    ACCURACY,
    Evidence,
    accuracy_evidence,
    evidence_of,
    log_likelihood,
    require_shown,
    values_of_errors,
)
from hdassist.belief.prior import DrivePrior
from hdassist.belief.proposals import PILOT_DRAWS
from hdassist.belief.statistics import (
    Probability,
    effective_number,
    even_rows,
    probability_of,
    probability_of_systems,
    weighted_quantile,
)
from hdassist.error.cycle import require_programme
from hdassist.errors import SURE, UntrustedError
from hdassist.model.deviations import no_hole_better, unknown_turn
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate

EFFECTIVE_SAMPLES = 64  # at least, where no number is asked for
FEWEST_SAMPLES = 8  # effective ones, of which there is an answer where all draws leave no more
_FEWEST_AT_ONCE = 4  # draws
_SETS = 4  # sets of deviations on each contact system if all holes are equal
_HOPELESS = 256  # draws of which none has an answer: no more are made
_ROUNDING = 1e-9  # relative rounding of an effective sample size: equal weights give a whole number
_CONTRADICTION = 300.0  # times that the mean likelihood grows without a figure which contradicts the others


@dataclass(frozen=True)
class SamplingEffort:
    """Limits of sampling: effective samples at least, draws for a purpose and in all at most, and draws at a time.

    Draws for a purpose are those that are made for no more than to settle it, once so many samples are effective.
    least: effective samples that an answer takes once all draws are made; None: as many as at least. for_action: there
    is one also where a figure contradicts the others, which no claim is made of.
    """

    effective: int = EFFECTIVE_SAMPLES
    settling_draws: int = 1024
    most_draws: int = 2048
    batch: int = 16
    least: int | None = None
    for_action: bool = False

    @classmethod
    def of(cls, effective: int) -> SamplingEffort:
        """Return the effort for at least so many effective samples, with 16 times as many draws to settle a limit."""
        return cls(
            effective=effective,
            # a verdict near its limit is allowed that many draws before it stays open
            settling_draws=16 * effective,
            most_draws=32 * effective,
            batch=min(16, effective),
            least=min(FEWEST_SAMPLES, effective),
        )


@dataclass(frozen=True, eq=False)
class Samples:
    """Weighted samples of a drive.

    torques [N*m]; shares: of each field's probability, shape (samples, fields); F_ior_arcsec, shape (samples, torques);
    figures: predictions beside F'_ior by name, shape (samples,) each; weights, shape (samples,); draws: how many were
    made; refused: draws that are no drive, or have no trustworthy answer, by the reason; seed of the draws;
    turned_arcsec: F'_ior with the fixed wheel turned by rotations_deg, shape (samples, torques, rotations); made: each
    draw, also those without an answer; stages: these samples as they grew, from the fewest that are enough for a range;
    few: words where fewer are effective than were asked for; further_arcsec: F'_ior of further sets of deviations on
    the contact system of each sample, shape (samples, sets, torques), and further_weights, shape (samples, sets):
    F'_ior as mounted is stated over all sets.
    """

    prior: DrivePrior
    torques: tuple[float, ...]
    shares: Array
    F_ior_arcsec: Array
    figures: Mapping[str, Array]
    weights: Array
    draws: int
    refused: Mapping[str, int]
    seed: int
    certificate: Certificate
    rotations_deg: tuple[float, ...]
    turned_arcsec: Array
    made: tuple[Draw, ...]
    stages: tuple[Samples, ...] = ()
    few: str = ""
    further_arcsec: Array = field(kw_only=True)
    further_weights: Array = field(kw_only=True)

    @property
    def sets_arcsec(self) -> Array:
        """F'_ior of all sets of deviations [arcsec], that of the sample first, shape (samples, sets, torques)."""
        # the sample's own deviations are the first set
        first_set = self.F_ior_arcsec[:, None]
        if not self.further_arcsec.shape[1]:
            return first_set
        return np.concatenate([first_set, self.further_arcsec], axis=1)

    @property
    def set_weights(self) -> Array:
        """Weights of all sets of deviations, shape (samples, sets)."""
        first_set = self.weights[:, None]
        if not self.further_weights.shape[1]:
            return first_set
        return np.concatenate([first_set, self.further_weights], axis=1)

    @property
    def remarks(self) -> tuple[str, ...]:
        """A remark on numbers that few samples stand for."""
        if not self.few:
            return ()
        return (f"{self.few}, so the numbers are approximate; check the values of the preset, then its assumed ranges",)

    @property
    def of_ranges(self) -> Samples:
        """The first samples, which ranges and influences are of: a limit that takes more of them moves neither."""
        return self.stages[0] if self.stages else self

    @property
    def effective(self) -> float:
        """Effective number of samples."""
        return effective_number(self.weights)

    def values(self, rows: NDArray[np.integer] | None = None) -> list[dict[str, float]]:
        """Return the values of the drives of some samples by path; rows: places of the samples, None for all."""
        # rows count samples; refused draws have none
        draws = [draw for draw in self.made if draw.F_ior_arcsec is not None]
        if rows is None:
            rows = np.arange(len(draws))
        drawn = self.prior.values(self.shares[rows])
        return [values | draws[row].follows for row, values in zip(rows, drawn, strict=True)]

    def equal_drives(self, count: int) -> list[dict[str, float]]:
        """Return the values of some drives of the same weight by path; count: number of them."""
        return self.values(even_rows(self.weights, count))

    def middle_sample(self, torque: int) -> int:
        """Return the place of the sample whose F'_ior at a torque, by its place, is nearest to the median."""
        # of the samples that ranges are of, so that it does not move with the limit
        first = self.of_ranges
        return int(np.abs(first.F_ior_arcsec[:, torque] - first.percentile(0.5, torque)).argmin())

    def percentile(self, share: float, torque: int) -> float:
        """Return a percentile [arcsec] of F'_ior, by its share (0.95), at a torque by its place."""
        return weighted_quantile(self.sets_arcsec[:, :, torque].ravel(), self.set_weights.ravel(), share)

    def keeping(self, accuracy_arcsec: float, torque: int) -> Samples:
        """Return the same samples, weighted by an accuracy [arcsec] as well, which F'_ior meets.

        torque: place of the torque at which it does.
        """
        # the same soft limit by which the accuracy in a catalogue weights samples
        accuracy = accuracy_evidence(accuracy_arcsec, "unstated")
        likelihood = np.exp(accuracy.log_likelihood(self.F_ior_arcsec[:, torque]))
        likelihood_of_sets = np.exp(accuracy.log_likelihood(self.further_arcsec[:, :, torque]))
        return replace(
            self,
            weights=self.weights * likelihood,
            further_weights=self.further_weights * likelihood_of_sets,
            stages=(),
        )

    def percentile_error(self, share: float, torque: int) -> float:
        """Return the Monte Carlo standard error [arcsec] of a percentile, from those one standard error off."""
        # binomial error of the share below the percentile
        error_of_share = np.sqrt(share * (1 - share) / self.effective)
        low = self.percentile(float(np.clip(share - error_of_share, 0, 1)), torque)
        high = self.percentile(float(np.clip(share + error_of_share, 0, 1)), torque)
        return (high - low) / 2

    def probability(self, outcome: Callable[[Samples], Array | NDArray[np.bool_]], sure: float = SURE) -> Probability:
        """Return the probability of an outcome, from the fewest samples that settle a verdict.

        As many samples again would hardly change it, so samples that were drawn for another question do not move it.

        outcome: which of some samples have it, shape (samples,).
        sure: probability that PASS needs.
        """
        return self._settled([probability_of(outcome(stage), stage.weights) for stage in self.stages or (self,)], sure)

    def probability_of_sets(self, outcome: Callable[[Array], Array | NDArray[np.bool_]], sure: float) -> Probability:
        """Return the probability of an outcome of F'_ior as mounted, over all sets of deviations, as probability does.

        outcome: which sets have it, shape (samples, sets), by their F'_ior [arcsec], shape (samples, sets, torques).
        sure: probability that PASS needs.
        """
        probabilities = []
        for stage in self.stages or (self,):
            inside = outcome(stage.sets_arcsec)
            # without further sets the samples are independent
            if stage.set_weights.shape[1] == 1:
                probabilities.append(probability_of(inside[:, 0], stage.weights))
                continue
            # sets on one contact system are not: each system counts as one sample
            of_system = stage.set_weights.sum(axis=1)
            shares = (stage.set_weights * inside).sum(axis=1) / np.where(of_system > 0, of_system, 1)
            probabilities.append(probability_of_systems(shares, of_system))
        return self._settled(probabilities, sure)

    def _settled(self, probabilities: Sequence[Probability], sure: float) -> Probability:
        """Return the probability of the first stage of which as many samples again would hardly change a verdict."""
        # the first stable stage: later ones exist because another limit needed them
        stable = [probability for probability in probabilities if probability.is_stable(sure)]
        settled = stable[0] if stable else probabilities[-1]
        return replace(settled, few=bool(self.few))

    def probability_within(
        self,
        limit_arcsec: float,
        torque: int,
        sure: float = SURE,
    ) -> Probability:
        """Return the probability that F'_ior at a torque, by its place, is at most a limit [arcsec]."""
        return self.probability_of_sets(lambda F_ior: F_ior[:, :, torque] <= limit_arcsec, sure)


@dataclass(frozen=True, eq=False)
class ErrorBelief:
    """F'_ior [arcsec] at one of the torques of samples, by its place: percentiles and probabilities.

    Percentiles (p5, p50, p95) are of the first samples, whatever was drawn further for a probability.
    """

    samples: Samples
    torque: int
    p5: float
    p50: float
    p95: float

    @classmethod
    def of(cls, samples: Samples, torque: int) -> ErrorBelief:
        """Return F'_ior at one of the torques, by its place."""
        first = samples.of_ranges
        return cls(
            samples=samples,
            torque=torque,
            p5=first.percentile(0.05, torque),
            p50=first.percentile(0.5, torque),
            p95=first.percentile(0.95, torque),
        )


def draw_samples(
    prior: DrivePrior,
    torques: Sequence[float],
    *,
    rotations_deg: Sequence[float] = (),
    evidence: tuple[Evidence, ...] = (),
    figures_of: FiguresOf | None = None,
    figures_name: str = "",
    enough: Callable[[Samples], bool] = lambda _samples: True,
    effort: SamplingEffort = SamplingEffort(),
    run: Run = Run(),
    seen: Callable[[Samples], None] | None = None,
    sets: int = 1,
) -> Samples:
    """Return samples of a drive at torques [N*m]: at least effort.effective of them, then more until they are enough.

    prior: of the drive.
    torques: torques [N*m].
    rotations_deg: turns of the fixed wheel at which F'_ior is wanted too.
    evidence: on the drive.
    figures_of: figures that each sample has beside F'_ior.
    figures_name: what these figures depend on beside the drive; draws with figures but without this name are not kept.
    enough: whether samples suffice for their purpose.
    effort: limits of sampling.
    run: the run.
    seen: called with the samples so far once evidence allows one.
    sets: sets of deviations on each contact system.
    Raises UsageError for a drive with rolling balls, UntrustedError where a figure contradicts the others, hardly any
    sample agrees with all of them, or too few draws are drives.
    """
    sampling = Sampling(
        prior=prior,
        torques=tuple(torques),
        rotations_deg=tuple(rotations_deg),
        evidence=tuple(evidence),
        figures_of=figures_of,
        figures_name=figures_name,
        seed=run.seed,
        sets=sets,
    )
    # once, before worker processes begin
    require_programme(prior.drive, run)
    kept = sampling.kept()
    draws: list[Draw] = []
    try:
        for samples in _growing(sampling, kept, draws, effort, run):
            # numbers on the page while sampling goes on
            if seen and samples.weights.any():
                seen(samples)
            if samples.stages and (len(draws) >= effort.settling_draws or enough(samples)):
                break
        # the draws are used up and too few are effective
        if not samples.stages:
            samples = _few(samples, draws, evidence, effort)
        # a measured value that no sample shows makes all numbers doubtful
        _require_shown(sampling, draws)
        return samples
    finally:
        # kept even after an interruption, so the next run goes on
        if len(draws) > len(kept):
            sampling.keep(draws)


def drive_samples(
    prior: DrivePrior,
    held_arcsec: Sequence[float | None],
    *,
    draws: int = EFFECTIVE_SAMPLES,
    sure: float = SURE,
    rotations_deg: Sequence[float] = (),
    other_torques: Sequence[float] = (),
    run: Run = Run(),
    seen: Callable[[Samples], None] | None = None,
) -> Samples:
    """Return samples of a drive at its torques, until as many again would hardly change a verdict.

    prior: of the drive.
    held_arcsec: limit minus self error at each torque; None without a limit.
    draws: effective samples at least.
    sure: probability of a limit that settles a verdict.
    rotations_deg, run, seen: as those of draw_samples.
    other_torques: torques [N*m] that follow those of the drive and have no limit.
    Raises what draw_samples raises.
    """
    drive = prior.drive
    return draw_samples(
        prior,
        (*drive.operation.M_g, *other_torques),
        rotations_deg=rotations_deg,
        evidence=evidence_of(drive),
        enough=partial(limits_settled, held_arcsec, sure=sure),
        effort=SamplingEffort.of(draws),
        run=run,
        seen=seen,
        sets=deviation_sets(drive),
    )


def deviation_sets(drive: Drive) -> int:
    """Return how many sets of deviations share the contact system of a sample.

    One where the holes of the seat differ: they are compared by samples, each with its own set in all of them.
    """
    # without a hole to choose, deviations are exchangeable on one contact system, and further sets cost little
    return _SETS if unknown_turn(drive) or no_hole_better(drive) else 1


def turned_samples(
    samples: Samples,
    evidence: tuple[Evidence, ...],
    rotations_deg: Sequence[float],
    run: Run = Run(),
) -> Samples:
    """Return the same samples with the fixed wheel turned as well, as a drawing with these turns would have them.

    samples: samples without a measured F'_ior among their evidence, which would move them together with their turns.
    evidence: their evidence.
    rotations_deg: turns of the fixed wheel [deg].
    run: the run.
    Raises UntrustedError if a state cannot be trusted.
    """
    sampling = Sampling(
        prior=samples.prior,
        torques=samples.torques,
        rotations_deg=tuple(rotations_deg),
        evidence=tuple(evidence),
        seed=samples.seed,
        sets=samples.set_weights.shape[1],
    )
    # these turns are solved already
    if {*rotations_deg} <= {*samples.rotations_deg}:
        return samples
    kept = sampling.kept()
    draws = kept[: len(samples.made)]
    # draws whose turns are not kept
    fresh = samples.made[len(draws) :]
    anywhere = tuple(0.5 for _ in samples.prior.fields)  # of a draw that made no drive, which is not turned
    shares = [draw.shares or anywhere for draw in fresh]
    values = samples.prior.values(np.array(shares)) if shares else []
    for draw in run.map(sampling.with_turns, fresh, values):
        draws.append(draw)
        run.solved(draw.turned_proof.states)
    if len(draws) > len(kept):
        sampling.keep(draws)
    # the same stages, by the number of their draws
    stages = tuple(_collected(sampling, draws[: len(stage.made)]) for stage in samples.stages)
    return replace(
        _collected(sampling, draws),
        stages=stages,
        few=samples.few,
    )


def _growing(
    sampling: Sampling,
    kept: Sequence[Draw],
    draws: list[Draw],
    effort: SamplingEffort,
    run: Run,
) -> Iterator[Samples]:
    """Yield the samples after each batch of draws.

    sampling: what the draws depend on.
    kept: draws that are kept, which are taken first.
    draws: grows by each batch.
    effort: limits of sampling.
    run: the run.
    """
    samples: Samples | None = None
    stages: tuple[Samples, ...] = ()
    # draws that worker processes have begun before they are needed
    ahead: UnderWay = {}
    try:
        while len(draws) < effort.most_draws and not _is_hopeless(samples, draws):
            first = len(draws)
            last = min(first + _batch_size(effort, samples, len(draws)), effort.most_draws)
            # in whole groups, as they are made: kept ones are taken up as far as new ones would go
            last += -last % sampling.alike
            batch: Iterable[list[Draw]] = [list(kept[first:last])]
            if last > len(kept):
                new = sampling.new(draws[:first], max(first, len(kept)), last, run, ahead, effort.most_draws)
                batch = chain(batch, new)
            for group in batch:
                draws += group
                run.solved(sum(draw.certificate.states for draw in group))
            samples = _collected(sampling, draws)
            if stages or samples.effective + _ROUNDING >= effort.effective:
                stages = (*stages, samples)
            samples = replace(samples, stages=stages)
            yield samples
    finally:
        for future in ahead.values():
            future.cancel()


def _is_hopeless(samples: Samples | None, draws: Sequence[Draw]) -> bool:
    """Return whether many draws were made, and none of them has an answer."""
    return samples is not None and len(draws) >= _HOPELESS and not len(samples.weights)


def _batch_size(
    effort: SamplingEffort,
    samples: Samples | None,
    count: int,
) -> int:
    """Return the number of draws of the next batch.

    effort: limits of sampling.
    samples: those so far; None before the first batch.
    count: number of draws so far.
    """
    # no batch is longer than all draws before it, or than it takes to see that none has an answer
    size = min(effort.batch, max(_HOPELESS, count))
    if samples is not None and not samples.stages:
        effective = samples.effective + _ROUNDING
        needed = int(np.ceil((effort.effective / effective - 1) * count))  # no more than are likely to be needed
        size = min(size, max(_FEWEST_AT_ONCE, needed))
    if count < PILOT_DRAWS:  # the pilot is complete before any draw is proposed by it
        size = min(size, PILOT_DRAWS - count)
    return size


def limits_settled(
    left_arcsec: Sequence[float | None],
    samples: Samples,
    sure: float = SURE,
) -> bool:
    """Return whether as many samples again would hardly change the verdict on any limit (Probability.is_stable).

    left_arcsec: limit minus self error at each torque; None without a limit.
    samples: of the drive.
    sure: probability of meeting a limit that PASS needs.
    """
    probabilities = [
        samples.probability_within(room_arcsec, torque, sure)
        for torque, room_arcsec in enumerate(left_arcsec)
        if room_arcsec is not None
    ]
    return all(probability.is_stable(sure) for probability in probabilities)


def _collected(sampling: Sampling, draws: Sequence[Draw]) -> Samples:
    """Return draws as samples: those that have F'_ior, and what is known of all."""
    solved = [draw for draw in draws if draw.F_ior_arcsec is not None]
    count = len(solved)
    torques = sampling.torques
    sets = len(solved[0].set_weights) if solved else 0

    return Samples(
        prior=sampling.prior,
        torques=torques,
        shares=_stacked((draw.shares for draw in solved), count, len(sampling.prior.fields)),
        F_ior_arcsec=_stacked((draw.F_ior_arcsec for draw in solved), count, len(torques)),
        figures=_figures_beside_error(sampling, solved),
        weights=_stacked((draw.weight for draw in solved), count),
        draws=len(draws),
        refused=dict(sorted(Counter(draw.refused for draw in draws if draw.refused).items())),
        seed=sampling.seed,
        certificate=sum((draw.certificate for draw in draws), EMPTY),
        rotations_deg=sampling.rotations_deg,
        turned_arcsec=_stacked(
            (draw.turned_arcsec for draw in solved), count, len(torques), len(sampling.rotations_deg)
        ),
        made=tuple(draws),
        further_arcsec=_stacked((draw.sets_arcsec for draw in solved), count, sets, len(torques)),
        further_weights=_stacked((draw.set_weights for draw in solved), count, sets),
    )


def _stacked(values: Iterable[object], *shape: int) -> Array:
    """Return values as an array of a shape, also if there are none."""
    return np.array([*values], dtype=float).reshape(shape)


def _figures_beside_error(sampling: Sampling, solved: Sequence[Draw]) -> dict[str, Array]:
    """Return the figures of draws beside F'_ior, by name, shape (draws,) each."""
    of_error = {ACCURACY, *(datum.figure for datum in sampling.measured)}
    names = [name for name in (solved[0].figures if solved else {}) if name not in of_error]
    return {name: np.array([draw.figures[name] for draw in solved]) for name in names}


def _require_shown(sampling: Sampling, draws: Sequence[Draw]) -> None:
    """Raise UntrustedError where no draw comes near F'_ior as measured: of equally bad ones all weigh the same."""
    if not sampling.measured:
        return
    solved = [draw.figures for draw in draws if draw.F_ior_arcsec is not None]
    predicted = np.array([[figures[datum.figure] for datum in sampling.measured] for figures in solved])
    paths = [datum.path for datum in sampling.measured]
    hint = "check the values, torque and holes first, then the assumed ranges"
    require_shown(paths, predicted, *values_of_errors(sampling.measured), hint)


def _few(
    samples: Samples,
    draws: Sequence[Draw],
    evidence: tuple[Evidence, ...],
    effort: SamplingEffort,
) -> Samples:
    """Return samples with a remark that fewer are effective than were asked for.

    Raises UntrustedError if that allows no answer, with the evidence without which most would agree.
    """
    is_answer = samples.effective >= (effort.least or effort.effective)
    of_draws = f"of {len(draws)} draws, {effort.effective} required"
    answer = replace(samples, few=f"effective sample size {samples.effective:.3g} {of_draws}")
    if is_answer and effort.for_action:
        return answer
    too_few = f"effective sample size {samples.effective:.0f} {of_draws}"
    refused = sum(samples.refused.values())
    if refused > len(draws) / 2 or not evidence:
        reason = max(
            samples.refused,
            key=samples.refused.__getitem__,
            default="no result",
        )
        raise UntrustedError(
            f"{too_few}: {refused} samples are not valid drives (mostly: {reason})", "narrow the assumed ranges"
        )
    likelihood_without = {
        datum: _mean_likelihood(draws, evidence[:place] + evidence[place + 1 :]) for place, datum in enumerate(evidence)
    }
    doubted = max(likelihood_without, key=likelihood_without.__getitem__)
    if likelihood_without[doubted] < _CONTRADICTION * _mean_likelihood(draws, evidence):
        if is_answer:
            return answer
        raise UntrustedError(
            f"{too_few}: too few samples agree with all reference data together, "
            "although no single value contradicts the rest",
            "narrow the assumed ranges",
        )
    raise UntrustedError(
        f"{too_few}: {doubted.path} = {doubted.value:g} contradicts the other reference data or the assumed ranges",
        "check that value and its unit, then the assumed ranges",
    )


def _mean_likelihood(draws: Sequence[Draw], evidence: tuple[Evidence, ...]) -> float:
    """Return the mean likelihood of evidence over all draws that are drives, as far as each was predicted."""
    likelihoods = [np.exp(log_likelihood(evidence, draw.figures)) for draw in draws if not draw.refused]
    return float(np.mean(likelihoods))
