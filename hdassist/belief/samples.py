"""Weighted samples of a drive: joint draws of all unknown inputs, solved and weighted by the reference data.

The method is importance sampling: the first draws come from the prior, and later ones from a proposal closer to the
reference data. The weight of a draw is its likelihood divided by the density of the proposal.
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
from hdassist.drive.error.cycle import require_programme
from hdassist.drive.model.deviations import no_hole_better, unknown_turn
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import Drive
from hdassist.drive.solve.answers import EMPTY, Certificate
from hdassist.run.errors import SURE, UntrustedError
from hdassist.run.run import Run

EFFECTIVE_SAMPLES = 64  # default effective sample size
FEWEST_SAMPLES = 8  # smallest effective sample size that is accepted after the largest number of draws
_FEWEST_AT_ONCE = 4  # smallest number of draws in a batch
_SETS = 4  # number of sets of deviations on each contact system if all holes are equivalent
_HOPELESS = 256  # number of draws after which sampling ends if none of them has a result
_ROUNDING = 1e-9  # tolerance for rounding errors of an effective sample size that should be a whole number
# factor by which the mean likelihood must grow without a datum for it to contradict the other reference data
_CONTRADICTION = 300.0


@dataclass(frozen=True)
class SamplingEffort:
    """Limits of sampling.

    effective: smallest effective sample size.
    settling_draws: number of draws after which no more are made to settle a verdict.
    most_draws: largest total number of draws.
    batch: number of draws in a batch.
    least: effective sample size that is accepted after all draws; None for `effective`.
    for_action: whether contradictory reference data still give a result, on which an action but no claim can be based.
    """

    effective: int = EFFECTIVE_SAMPLES
    settling_draws: int = 1024
    most_draws: int = 2048
    batch: int = 16
    least: int | None = None
    for_action: bool = False

    @classmethod
    def of(cls, effective: int) -> SamplingEffort:
        """Return the effort for a smallest effective sample size."""
        return cls(
            effective=effective,
            # a verdict that is not settled after these draws stays open
            settling_draws=16 * effective,
            most_draws=32 * effective,
            batch=min(16, effective),
            least=min(FEWEST_SAMPLES, effective),
        )


@dataclass(frozen=True, eq=False)
class Samples:
    """Weighted samples of a drive.

    prior: prior of the drive.
    torques: torques [N*m].
    shares: quantile levels of the fields, shape (samples, fields).
    F_ior_arcsec: F'_ior [arcsec], shape (samples, torques).
    figures: other predicted values by name, shape (samples,) each.
    weights: weights, shape (samples,).
    draws: number of draws.
    refused: number of draws that are not valid drives or have no trustworthy result, by reason.
    seed: seed of the draws.
    rotations_deg: rotations of the fixed wheel [deg].
    turned_arcsec: F'_ior with the fixed wheel turned [arcsec], shape (samples, torques, rotations).
    made: all draws, including those without F'_ior.
    stages: the samples after each batch, from the first batch that reached the requested effective sample size.
    few: remark if the effective sample size is smaller than requested; empty if it is not.
    further_arcsec: F'_ior of further sets of deviations on the contact system of each sample [arcsec], shape (samples,
        sets, torques); percentiles and probabilities include all sets.
    further_weights: weights of the further sets, shape (samples, sets).
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
        """F'_ior of all sets of deviations [arcsec], shape (samples, sets, torques)."""
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
        """Remark that the results are approximate, if the samples are few; empty if they are not."""
        if not self.few:
            return ()
        return (f"{self.few}, so the numbers are approximate; check the values of the preset, then its assumed ranges",)

    @property
    def of_ranges(self) -> Samples:
        """The samples of the first stage, on which ranges and influences are based; later draws do not change them."""
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
        """Return the field values of drives that represent equal shares of all weights, by path.

        count: number of drives.
        """
        return self.values(even_rows(self.weights, count))

    def middle_sample(self, torque: int) -> int:
        """Return the index of the sample whose F'_ior at a torque is nearest to the median.

        torque: index of the torque.
        """
        # the first samples do not depend on the limit
        first = self.of_ranges
        return int(np.abs(first.F_ior_arcsec[:, torque] - first.percentile(0.5, torque)).argmin())

    def percentile(self, share: float, torque: int) -> float:
        """Return a percentile of F'_ior at a torque over all sets of deviations [arcsec].

        share: quantile level, for example 0.95.
        torque: index of the torque.
        """
        return weighted_quantile(self.sets_arcsec[:, :, torque].ravel(), self.set_weights.ravel(), share)

    def keeping(self, accuracy_arcsec: float, torque: int) -> Samples:
        """Return the same samples, with weights that also include the likelihood of an accuracy.

        accuracy_arcsec: accuracy that F'_ior meets [arcsec].
        torque: index of the torque at which F'_ior meets it.
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
        """Return the Monte Carlo standard error of a percentile of F'_ior [arcsec].

        It is half the difference between the percentiles at one standard error above and below the quantile level.
        """
        # binomial standard error of the share below the percentile
        error_of_share = np.sqrt(share * (1 - share) / self.effective)
        low = self.percentile(float(np.clip(share - error_of_share, 0, 1)), torque)
        high = self.percentile(float(np.clip(share + error_of_share, 0, 1)), torque)
        return (high - low) / 2

    def probability(self, outcome: Callable[[Samples], Array | NDArray[np.bool_]], sure: float = SURE) -> Probability:
        """Return the probability of an outcome, from the first stage of samples that settles the verdict.

        Twice the number of samples would hardly change the verdict. Later stages, which another limit may need, do not
        affect the probability.

        outcome: function that returns whether each sample has the outcome, shape (samples,).
        sure: probability of the outcome from which the verdict is PASS.
        """
        return self._settled([probability_of(outcome(stage), stage.weights) for stage in self.stages or (self,)], sure)

    def probability_of_sets(self, outcome: Callable[[Array], Array | NDArray[np.bool_]], sure: float) -> Probability:
        """Return the probability of an outcome of F'_ior over all sets of deviations, by the rule of `probability`.

        outcome: function that returns whether each set has the outcome, shape (samples, sets), from the F'_ior of the
            sets [arcsec], shape (samples, sets, torques).
        sure: probability of the outcome from which the verdict is PASS.
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
        """Return the probability of the first stage whose verdict twice the number of samples would hardly change.

        If there is no such stage, the result is the probability of the last stage.
        """
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
        sure: probability from which the verdict is PASS.
        """
        return self.probability_of_sets(lambda F_ior: F_ior[:, :, torque] <= limit_arcsec, sure)


@dataclass(frozen=True, eq=False)
class ErrorBelief:
    """Percentiles of F'_ior at one of the torques of samples.

    samples: the samples.
    torque: index of the torque.
    p5, p50, p95: percentiles over the first samples [arcsec]; further draws for a verdict do not change them.
    """

    samples: Samples
    torque: int
    p5: float
    p50: float
    p95: float

    @classmethod
    def of(cls, samples: Samples, torque: int) -> ErrorBelief:
        """Return the percentiles of F'_ior at a torque.

        torque: index of the torque.
        """
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
    figures_of: function that returns further predicted values of a draw; None if no further values are needed.
    figures_name: description of all inputs of figures_of except the drive; if it is empty, draws with further values
        are not stored.
    enough: function that returns whether the samples suffice for their purpose.
    effort: limits of sampling.
    run: the run.
    seen: function called with the samples after each batch, once any sample agrees with the reference data.
    sets: number of sets of deviations on each contact system.

    Raises UsageError for a drive with rolling balls, and UntrustedError if a datum contradicts the other reference
    data, if hardly any sample agrees with all of them, or if too few draws are valid drives.
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
    # the programme is checked once, before worker processes start
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
        # if no sample agrees with a measured value, all results are doubtful
        _require_shown(sampling, draws)
        return samples
    finally:
        # draws are stored even after an interruption, so the next run can continue
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
    sure: probability of meeting a limit from which the verdict is PASS.
    rotations_deg, run, seen: arguments of `draw_samples`.
    other_torques: further torques without a limit [N*m], which come after those of the drive.

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
    """Return the samples that would have been drawn with these rotations; only the missing rotations are solved.

    samples: samples whose reference data do not include a measured F'_ior.
    evidence: reference data of the samples.
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
    # the remaining draws are stored without these rotations
    fresh = samples.made[len(draws) :]
    # a draw without F'_ior has no quantile levels and is not turned, so any levels will do
    anywhere = tuple(0.5 for _ in samples.prior.fields)
    shares = [draw.shares or anywhere for draw in fresh]
    values = samples.prior.values(np.array(shares)) if shares else []
    for draw in run.map(sampling.with_turns, fresh, values):
        draws.append(draw)
        run.solved(draw.turned_proof.states)
    if len(draws) > len(kept):
        sampling.keep(draws)
    # the stages end after the same numbers of draws as before
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

    sampling: the sampling that makes the draws.
    kept: stored draws, which are used first.
    draws: list to which each batch is added.
    effort: limits of sampling.
    run: the run.
    """
    samples: Samples | None = None
    stages: tuple[Samples, ...] = ()
    # worker processes may start draws of the next batch in advance
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
    """Return whether at least _HOPELESS draws were made and none of them has F'_ior."""
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
    # a batch is at most as large as the number of previous draws, or _HOPELESS
    size = min(effort.batch, max(_HOPELESS, count))
    if samples is not None and not samples.stages:
        effective = samples.effective + _ROUNDING
        # number of draws that the requested effective sample size will probably need
        needed = int(np.ceil((effort.effective / effective - 1) * count))
        size = min(size, max(_FEWEST_AT_ONCE, needed))
    if count < PILOT_DRAWS:  # the pilot must be complete before it determines the proposal
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
    sure: probability of meeting a limit from which the verdict is PASS.
    """
    probabilities = [
        samples.probability_within(room_arcsec, torque, sure)
        for torque, room_arcsec in enumerate(left_arcsec)
        if room_arcsec is not None
    ]
    return all(probability.is_stable(sure) for probability in probabilities)


def _collected(sampling: Sampling, draws: Sequence[Draw]) -> Samples:
    """Return the samples that consist of all draws with F'_ior, with information on all draws."""
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
    """Return values as an array of a given shape, which may be empty."""
    return np.array([*values], dtype=float).reshape(shape)


def _figures_beside_error(sampling: Sampling, solved: Sequence[Draw]) -> dict[str, Array]:
    """Return the predicted values of draws except F'_ior, by name, shape (draws,) each."""
    of_error = {ACCURACY, *(datum.figure for datum in sampling.measured)}
    names = [name for name in (solved[0].figures if solved else {}) if name not in of_error]
    return {name: np.array([draw.figures[name] for draw in solved]) for name in names}


def _require_shown(sampling: Sampling, draws: Sequence[Draw]) -> None:
    """Raise UntrustedError if no draw is near the measured F'_ior, so that the weights would be meaningless."""
    if not sampling.measured:
        return
    solved = [draw.figures for draw in draws if draw.F_ior_arcsec is not None]
    predicted = np.array([[figures[datum.figure] for datum in sampling.measured] for figures in solved])
    paths = [datum.path for datum in sampling.measured]
    hint = "check the measured values, their torque and their holes first, then the assumed ranges"
    require_shown(paths, predicted, *values_of_errors(sampling.measured), hint)


def _few(
    samples: Samples,
    draws: Sequence[Draw],
    evidence: tuple[Evidence, ...],
    effort: SamplingEffort,
) -> Samples:
    """Return samples with a remark that their effective sample size is smaller than requested.

    Raises UntrustedError if the samples are too few for a result, or if a datum contradicts the other reference data.
    The message names the datum or the most frequent reason for refused draws.
    """
    is_answer = samples.effective >= (effort.least or effort.effective)
    of_draws = f"from {len(draws)} samples, {effort.effective} required"
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
            f"{too_few}; {refused} samples are not valid drives (most frequent reason: {reason})",
            "narrow the assumed ranges",
        )
    likelihood_without = {
        datum: _mean_likelihood(draws, evidence[:place] + evidence[place + 1 :]) for place, datum in enumerate(evidence)
    }
    doubted = max(likelihood_without, key=likelihood_without.__getitem__)
    if likelihood_without[doubted] < _CONTRADICTION * _mean_likelihood(draws, evidence):
        if is_answer:
            return answer
        raise UntrustedError(
            f"{too_few}; too few samples agree with all reference data at once, "
            "although no single value contradicts the others",
            "narrow the assumed ranges",
        )
    raise UntrustedError(
        f"{too_few}: the value {doubted.path} = {doubted.value:g} contradicts the other reference data "
        "or the assumed ranges",
        "check this value and its unit first, then the assumed ranges",
    )


def _mean_likelihood(draws: Sequence[Draw], evidence: tuple[Evidence, ...]) -> float:
    """Return the mean likelihood over all valid draws; data that a draw does not predict are left out."""
    likelihoods = [np.exp(log_likelihood(evidence, draw.figures)) for draw in draws if not draw.refused]
    return float(np.mean(likelihoods))
