"""Weighted samples of a drive: joint draws of all unknown inputs, solved and weighted by the reference data.

Importance sampling: draws come from the prior, then from a proposal closer to the reference data. Their weight is their
likelihood over the density of the proposal.
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

EFFECTIVE_SAMPLES = 64  # default effective sample size
FEWEST_SAMPLES = 8  # smallest effective sample size with a result, if all draws give no more
_FEWEST_AT_ONCE = 4  # smallest number of draws in a batch
_SETS = 4  # number of sets of deviations on each contact system if all holes are equivalent
_HOPELESS = 256  # number of draws without any result after which no more are made
_ROUNDING = 1e-9  # relative rounding error of an effective sample size, because equal weights give a whole number
_CONTRADICTION = 300.0  # factor by which the mean likelihood grows without a figure that contradicts the other figures


@dataclass(frozen=True)
class SamplingEffort:
    """Limits of sampling.

    effective: smallest effective sample size.
    settling_draws: largest number of draws made only to settle a limit, once the effective sample size is reached.
    most_draws: largest total number of draws.
    batch: number of draws in a batch.
    least: effective sample size that is accepted after all draws; None for `effective`.
    for_action: whether there is also a result if a figure contradicts the others; such a result supports no claim.
    """

    effective: int = EFFECTIVE_SAMPLES
    settling_draws: int = 1024
    most_draws: int = 2048
    batch: int = 16
    least: int | None = None
    for_action: bool = False

    @classmethod
    def of(cls, effective: int) -> SamplingEffort:
        """Return the effort for a smallest effective sample size, with 16 times as many draws to settle a limit."""
        return cls(
            effective=effective,
            # largest number of draws for a verdict near its limit before it stays open
            settling_draws=16 * effective,
            most_draws=32 * effective,
            batch=min(16, effective),
            least=min(FEWEST_SAMPLES, effective),
        )


@dataclass(frozen=True, eq=False)
class Samples:
    """Weighted samples of a drive.

    torques: torques [N*m].
    shares: shares of each field's probability, shape (samples, fields).
    F_ior_arcsec: F'_ior [arcsec], shape (samples, torques).
    figures: other predictions by name, shape (samples,) each.
    weights: weights, shape (samples,).
    draws: number of draws.
    refused: number of draws that are not valid drives or have no trustworthy result, by reason.
    seed: seed of the draws.
    rotations_deg: rotations of the fixed wheel [deg].
    turned_arcsec: F'_ior with the fixed wheel turned [arcsec], shape (samples, torques, rotations).
    made: all draws, including those without a result.
    stages: these samples in stages of growth, from the smallest number that suffices for a range.
    few: remark if the effective sample size is smaller than requested.
    further_arcsec: F'_ior of further sets of deviations on the contact system of each sample [arcsec], shape (samples,
        sets, torques); F'_ior as mounted is stated over all sets.
    further_weights: weights of these sets, shape (samples, sets).
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
        """Remark on results from few samples."""
        if not self.few:
            return ()
        return (f"{self.few}, so the numbers are approximate; check the values of the preset, then its assumed ranges",)

    @property
    def of_ranges(self) -> Samples:
        """The first samples, on which ranges and influences are based, so that further samples do not change them."""
        return self.stages[0] if self.stages else self

    @property
    def effective(self) -> float:
        """Effective sample size."""
        return effective_number(self.weights)

    def values(self, rows: NDArray[np.integer] | None = None) -> list[dict[str, float]]:
        """Return the field values of the selected samples, by path.

        rows: indices of the samples; None selects all.
        """
        # rows index the samples, which exclude rejected draws
        draws = [draw for draw in self.made if draw.F_ior_arcsec is not None]
        if rows is None:
            rows = np.arange(len(draws))
        drawn = self.prior.values(self.shares[rows])
        return [values | draws[row].follows for row, values in zip(rows, drawn, strict=True)]

    def equal_drives(self, count: int) -> list[dict[str, float]]:
        """Return the values of some drives of equal weight by path.

        count: number of drives.
        """
        return self.values(even_rows(self.weights, count))

    def middle_sample(self, torque: int) -> int:
        """Return the index of the sample whose F'_ior at a torque is nearest to the median.

        torque: index of the torque.
        """
        # among the samples on which ranges are based, so that it does not depend on the limit
        first = self.of_ranges
        return int(np.abs(first.F_ior_arcsec[:, torque] - first.percentile(0.5, torque)).argmin())

    def percentile(self, share: float, torque: int) -> float:
        """Return a percentile of F'_ior [arcsec].

        share: share of the percentile (0.95).
        torque: index of the torque.
        """
        return weighted_quantile(self.sets_arcsec[:, :, torque].ravel(), self.set_weights.ravel(), share)

    def keeping(self, accuracy_arcsec: float, torque: int) -> Samples:
        """Return the same samples, with weights that also include an accuracy.

        accuracy_arcsec: accuracy that F'_ior meets [arcsec].
        torque: index of the torque at which it does.
        """
        # the same soft limit by which a catalogue accuracy weights samples
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
        """Return the Monte Carlo standard error of a percentile [arcsec], from percentiles one standard error away."""
        # binomial standard error of the share below the percentile
        error_of_share = np.sqrt(share * (1 - share) / self.effective)
        low = self.percentile(float(np.clip(share - error_of_share, 0, 1)), torque)
        high = self.percentile(float(np.clip(share + error_of_share, 0, 1)), torque)
        return (high - low) / 2

    def probability(self, outcome: Callable[[Samples], Array | NDArray[np.bool_]], sure: float = SURE) -> Probability:
        """Return the probability of an outcome, from the smallest number of samples that settles a verdict.

        As many further samples would hardly change it, so samples drawn for another question do not affect it.

        outcome: function that returns whether each sample has the outcome, shape (samples,).
        sure: probability that PASS needs.
        """
        return self._settled([probability_of(outcome(stage), stage.weights) for stage in self.stages or (self,)], sure)

    def probability_of_sets(self, outcome: Callable[[Array], Array | NDArray[np.bool_]], sure: float) -> Probability:
        """Return the probability of an outcome of F'_ior as mounted, over all sets, as `probability` does.

        outcome: function that returns whether each set has the outcome, shape (samples, sets), from its F'_ior
            [arcsec], shape (samples, sets, torques).
        sure: probability that PASS needs.
        """
        probabilities = []
        for stage in self.stages or (self,):
            inside = outcome(stage.sets_arcsec)
            # without further sets the samples are independent
            if stage.set_weights.shape[1] == 1:
                probabilities.append(probability_of(inside[:, 0], stage.weights))
                continue
            # sets on one contact system are not independent, so each system counts as one sample
            of_system = stage.set_weights.sum(axis=1)
            shares = (stage.set_weights * inside).sum(axis=1) / np.where(of_system > 0, of_system, 1)
            probabilities.append(probability_of_systems(shares, of_system))
        return self._settled(probabilities, sure)

    def _settled(self, probabilities: Sequence[Probability], sure: float) -> Probability:
        """Return the probability from the first stage after which as many samples would hardly change a verdict."""
        # later stages exist only because another limit needed them
        stable = [probability for probability in probabilities if probability.is_stable(sure)]
        settled = stable[0] if stable else probabilities[-1]
        return replace(settled, few=bool(self.few))

    def probability_within(
        self,
        limit_arcsec: float,
        torque: int,
        sure: float = SURE,
    ) -> Probability:
        """Return the probability that F'_ior at a torque is at most a limit [arcsec].

        torque: index of the torque.
        """
        return self.probability_of_sets(lambda F_ior: F_ior[:, :, torque] <= limit_arcsec, sure)


@dataclass(frozen=True, eq=False)
class ErrorBelief:
    """Percentiles and probabilities of F'_ior at one of the torques of samples [arcsec].

    torque: index of the torque.
    p5, p50, p95: percentiles of the first samples, which do not depend on further draws for a probability.
    """

    samples: Samples
    torque: int
    p5: float
    p50: float
    p95: float

    @classmethod
    def of(cls, samples: Samples, torque: int) -> ErrorBelief:
        """Return F'_ior at one of the torques, by its index."""
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
    """Return samples of a drive with an effective sample size of at least effort.effective, and more if needed.

    prior: prior of the drive.
    torques: torques [N*m].
    rotations_deg: rotations of the fixed wheel at which F'_ior is also computed [deg].
    evidence: reference data on the drive.
    figures_of: function that returns further figures of each sample.
    figures_name: description of the dependence of these figures other than on the drive; without it draws with figures
        are not stored.
    enough: function that returns whether samples suffice for their purpose.
    effort: limits of sampling.
    run: the run.
    seen: function called with the current samples as soon as the reference data allow one.
    sets: number of sets of deviations on each contact system.

    Raises UsageError for a drive with rolling balls, UntrustedError if a figure contradicts the others, if hardly any
    sample agrees with all of them, or if too few draws are valid drives.
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
    # once, before worker processes start
    require_programme(prior.drive, run)
    kept = sampling.kept()
    draws: list[Draw] = []
    try:
        for samples in _growing(sampling, kept, draws, effort, run):
            # the page shows results while sampling continues
            if seen and samples.weights.any():
                seen(samples)
            if samples.stages and (len(draws) >= effort.settling_draws or enough(samples)):
                break
        # all draws are used, but the effective sample size is too small
        if not samples.stages:
            samples = _few(samples, draws, evidence, effort)
        # a measured value that no sample shows makes all results doubtful
        _require_shown(sampling, draws)
        return samples
    finally:
        # stored even after an interruption, so that the next run continues
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
    """Return samples of a drive at its torques, until twice the number of samples would hardly change a verdict.

    prior: prior of the drive.
    held_arcsec: limit minus self error at each torque [arcsec]; None without a limit.
    draws: smallest effective sample size.
    sure: probability of meeting a limit that settles a verdict.
    rotations_deg, run, seen: as for `draw_samples`.
    other_torques: torques without a limit that follow those of the drive [N*m].

    Raises the errors of `draw_samples`.
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
    """Return the number of sets of deviations that share the contact system of a sample.

    It is one if the holes of the seat differ, because samples are compared in all holes with the same deviations.
    """
    # if holes are equivalent, deviations are exchangeable on one contact system, and further sets take little time
    return _SETS if unknown_turn(drive) or no_hole_better(drive) else 1


def turned_samples(
    samples: Samples,
    evidence: tuple[Evidence, ...],
    rotations_deg: Sequence[float],
    run: Run = Run(),
) -> Samples:
    """Return the same samples with the fixed wheel turned as well, as if they had been drawn with these rotations.

    samples: samples without a measured F'_ior in their reference data, which would change all results together.
    evidence: their reference data.
    rotations_deg: rotations of the fixed wheel [deg].
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
    # these rotations are already solved
    if {*rotations_deg} <= {*samples.rotations_deg}:
        return samples
    kept = sampling.kept()
    draws = kept[: len(samples.made)]
    # draws whose rotations are not stored
    fresh = samples.made[len(draws) :]
    # shares of a draw that is not a valid drive and need not be turned
    anywhere = tuple(0.5 for _ in samples.prior.fields)
    shares = [draw.shares or anywhere for draw in fresh]
    values = samples.prior.values(np.array(shares)) if shares else []
    for draw in run.map(sampling.with_turns, fresh, values):
        draws.append(draw)
        run.solved(draw.turned_proof.states)
    if len(draws) > len(kept):
        sampling.keep(draws)
    # the same stages, by their number of draws
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

    sampling: all dependencies of the draws.
    kept: stored draws, which are used first.
    draws: list to which each batch is added.
    effort: limits of sampling.
    run: the run.
    """
    samples: Samples | None = None
    stages: tuple[Samples, ...] = ()
    # draws that worker processes have started before they are needed
    ahead: UnderWay = {}
    try:
        while len(draws) < effort.most_draws and not _is_hopeless(samples, draws):
            first = len(draws)
            last = min(first + _batch_size(effort, samples, len(draws)), effort.most_draws)
            # draws are made in whole groups, so a batch of stored draws ends where a batch of new draws would
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
    """Return whether many draws were made without any result."""
    return samples is not None and len(draws) >= _HOPELESS and not len(samples.weights)


def _batch_size(
    effort: SamplingEffort,
    samples: Samples | None,
    count: int,
) -> int:
    """Return the number of draws of the next batch.

    effort: limits of sampling.
    samples: current samples; None before the first batch.
    count: number of draws so far.
    """
    # a batch is not longer than all previous draws, or than needed to see that none has a result
    size = min(effort.batch, max(_HOPELESS, count))
    if samples is not None and not samples.stages:
        effective = samples.effective + _ROUNDING
        needed = int(np.ceil((effort.effective / effective - 1) * count))  # no more than are probably needed
        size = min(size, max(_FEWEST_AT_ONCE, needed))
    if count < PILOT_DRAWS:  # complete the pilot before it proposes draws
        size = min(size, PILOT_DRAWS - count)
    return size


def limits_settled(
    left_arcsec: Sequence[float | None],
    samples: Samples,
    sure: float = SURE,
) -> bool:
    """Return whether twice the number of samples would hardly change the verdict on any limit (Probability.is_stable).

    left_arcsec: limit minus self error at each torque [arcsec]; None without a limit.
    samples: samples of the drive.
    sure: probability of meeting a limit that PASS needs.
    """
    probabilities = [
        samples.probability_within(room_arcsec, torque, sure)
        for torque, room_arcsec in enumerate(left_arcsec)
        if room_arcsec is not None
    ]
    return all(probability.is_stable(sure) for probability in probabilities)


def _collected(sampling: Sampling, draws: Sequence[Draw]) -> Samples:
    """Return the draws with F'_ior as samples, together with information on all draws."""
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
    """Return values as an array of a given shape, even if there are none."""
    return np.array([*values], dtype=float).reshape(shape)


def _figures_beside_error(sampling: Sampling, solved: Sequence[Draw]) -> dict[str, Array]:
    """Return the figures of draws other than F'_ior, by name, shape (draws,) each."""
    of_error = {ACCURACY, *(datum.figure for datum in sampling.measured)}
    names = [name for name in (solved[0].figures if solved else {}) if name not in of_error]
    return {name: np.array([draw.figures[name] for draw in solved]) for name in names}


def _require_shown(sampling: Sampling, draws: Sequence[Draw]) -> None:
    """Raise UntrustedError if no draw is near the measured F'_ior, because the weights would be meaningless."""
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
    """Return samples with a remark that their effective sample size is smaller than requested.

    Raises UntrustedError if this allows no result, naming the reference data without which most samples would agree.
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
    """Return the mean likelihood of the reference data over all valid draws, as far as each draw has predictions."""
    likelihoods = [np.exp(log_likelihood(evidence, draw.figures)) for draw in draws if not draw.refused]
    return float(np.mean(likelihoods))
