"""Weighted samples of a drive: joint draws of all that is not known, each solved, weighted by the evidence.

Importance sampling: draws come from the prior, then from a proposal nearer the evidence, and are weighted by their
likelihood over its density. Stiffness needs some ten states, so a draw that agrees badly with evidence of stiffness
goes on to F'_ior by chance only, with a probability that its weight is divided by: the sum of weights stays right on
average.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import partial
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from hdassist.belief.draws import Draw, KeptDraws, errors_by_turn
from hdassist.belief.evidence import (
    ACCURACY,
    ACCURACY_LOAD,
    SMOOTH_NUMBERS,
    SOFT_EDGE,
    STIFFNESS_FIGURES,
    Evidence,
    error_kinds,
    errors_of_drive,
    kernel,
    log_likelihood,
    log_likelihoods,
    require_shown,
    smooth_misfits,
    stiffness_figures,
    values_of_errors,
)
from hdassist.belief.meshing import meshing_shift
from hdassist.belief.prior import DrivePrior
from hdassist.belief.proposals import PILOT_DRAWS, DeviationProposal, open_deviations, proposed_draws
from hdassist.belief.statistics import (
    Probability,
    effective_number,
    even_rows,
    probability_of,
    weighted_quantile,
)
from hdassist.error.error_map import error_maps
from hdassist.error.stiffness import rated_torque
from hdassist.errors import HdassistError, UntrustedError
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.preset.fields import Drive
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.verdict import SURE

FiguresOf = Callable[[Drive], tuple[Mapping[str, float], Certificate]]  # of a drive by name, with the proof of them

EFFECTIVE_SAMPLES = 64  # at least, where no number is asked for
KEPT_LIKELIHOOD = 0.2  # of the best one: a draw below it goes on with a probability of its likelihood over this
SHOWN_DIGITS = 6  # of an arcsec: the last ones hang on how many positions are computed at once
FEWEST_AT_ONCE = 4  # draws
HOPELESS = 256  # draws of which none has an answer: no more are made
CONTRADICTION = 300.0  # times that the mean likelihood grows without a figure which contradicts the others


@dataclass(frozen=True)
class SamplingEffort:
    """Limits of sampling: effective samples at least and at most, draws at most, and draws at a time."""

    effective: int = EFFECTIVE_SAMPLES
    most_effective: int = 1024
    most_draws: int = 2048
    batch: int = 16

    @classmethod
    def of(cls, effective: int) -> SamplingEffort:
        """The effort for at least so many effective samples, at most 16 times as many."""
        return cls(effective, 16 * effective, 32 * effective, min(16, effective))


@dataclass(frozen=True, eq=False)
class Samples:
    """Weighted samples of a drive.

    torques [N*m]; shares: of each field's probability, shape (samples, fields); F_ior_arcsec, shape (samples, torques);
    figures: predictions beside F'_ior by name, shape (samples,) each; weights, shape (samples,); draws: how many were
    made; refused: draws that are no drive, or have no trustworthy answer, by the reason; seed of the draws;
    turned_arcsec: F'_ior with the fixed wheel turned by rotations_deg, shape (samples, torques, rotations); made: each
    draw, also those without an answer; stages: these samples as they grew, from the fewest that are enough for a range.
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

    @property
    def of_ranges(self) -> Samples:
        """The first samples, which ranges and influences are of: a limit that takes more of them moves neither."""
        return self.stages[0] if self.stages else self

    @property
    def effective(self) -> float:
        """Effective number of samples."""
        return effective_number(self.weights)

    def values(self, rows: NDArray[np.integer] | None = None) -> list[dict[str, float]]:
        """Values by path of the drives of some samples, by their places; of all without these."""
        kept = [each for each in self.made if each.F_ior_arcsec is not None]
        places = range(len(kept)) if rows is None else rows
        drawn = self.prior.values(self.shares[rows] if rows is not None else self.shares)
        return [values | kept[k].follows for k, values in zip(places, drawn, strict=True)]

    def equal_drives(self, count: int) -> list[dict[str, float]]:
        """Values by path of so many drives of the same weight."""
        return self.values(even_rows(self.weights, count))

    def middle_sample(self, torque: int) -> int:
        """Place of the sample whose F'_ior at a torque, by its place, is nearest to the median."""
        first = self.of_ranges
        return int(np.abs(first.F_ior_arcsec[:, torque] - first.percentile(0.5, torque)).argmin())

    def percentile(self, share: float, torque: int) -> float:
        """Percentile [arcsec] of F'_ior, by its share (0.95), at a torque by its place."""
        return weighted_quantile(self.F_ior_arcsec[:, torque], self.weights, share)

    def keeping(self, accuracy_arcsec: float, torque: int) -> Samples:
        """The same samples weighed by an accuracy [arcsec] as well that F'_ior at a torque, by its place, keeps."""
        kept = Evidence("catalogue.accuracy", ACCURACY, accuracy_arcsec, SOFT_EDGE, "limit")
        likelihood = np.exp(kept.log_likelihood(self.F_ior_arcsec[:, torque]))
        return replace(self, weights=self.weights * likelihood, stages=())

    def percentile_error(self, share: float, torque: int) -> float:
        """Monte Carlo standard error [arcsec] of a percentile, from those one standard error off."""
        step = np.sqrt(share * (1 - share) / self.effective)
        low, high = (self.percentile(float(np.clip(share + s, 0, 1)), torque) for s in (-step, step))
        return (high - low) / 2

    def probability(self, outcome: Callable[[Samples], Array | NDArray[np.bool_]], sure: float = SURE) -> Probability:
        """Probability of an outcome, from the fewest samples of which as many again would hardly change a verdict.

        So samples that were drawn further for another question do not move it. Arguments: outcome, which of some
        samples have it, shape (samples,); sure, probability that PASS needs.
        """
        found = [probability_of(outcome(stage), stage.weights) for stage in self.stages or (self,)]
        return next((each for each in found if each.is_stable(sure)), found[-1])

    def probability_within(self, limit_arcsec: float, torque: int, sure: float = SURE) -> Probability:
        """Probability that F'_ior at a torque, by its place, is at most a limit [arcsec]; sure as in probability."""
        return self.probability(lambda samples: samples.F_ior_arcsec[:, torque] <= limit_arcsec, sure)


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
        """F'_ior at one of the torques, by its place."""
        return cls(samples, torque, *(samples.of_ranges.percentile(share, torque) for share in (0.05, 0.5, 0.95)))


def draw_samples(
    prior: DrivePrior,
    torques: Sequence[float],
    *,
    rotations_deg: Sequence[float] = (),
    evidence: tuple[Evidence, ...] = (),
    further: FiguresOf | None = None,
    further_name: str = "",
    enough: Callable[[Samples], bool] = lambda _samples: True,
    effort: SamplingEffort = SamplingEffort(),
    run: Run = Run(),
    seen: Callable[[Samples], None] | None = None,
) -> Samples:
    """Samples of a drive at torques [N*m]: at least effort.effective of them, then more until they are enough.

    Arguments: prior of the drive; rotations_deg, turns of the fixed wheel at which F'_ior is wanted too; evidence on
    the drive; further, figures that each sample has beside F'_ior, and further_name, all that they depend on beside the
    drive, in words, without which draws with them are not kept; enough, whether samples suffice for their purpose;
    effort, limits of sampling; seen, called with the samples so far once evidence allows one.
    Raises UsageError for a drive with rolling balls, UntrustedError where too few samples agree with the evidence, or
    too few draws are drives.
    """
    rotations, errors = tuple(rotations_deg), tuple(each for each in evidence if each.M_g)
    near = DeviationProposal(prior, errors, run.seed) if errors and open_deviations(prior) else None
    solve = partial(_solved, prior, tuple(torques), rotations, evidence, further, near, run.seed)
    kept = KeptDraws(prior, tuple(torques), rotations, evidence, further_name, run.seed)
    earlier = kept.read() if further_name or not further else []
    effective = 0.0
    draws, stages, alike = list[Draw](), tuple[Samples, ...](), near.draws if near else 1
    try:
        while True:
            size = min(effort.batch, max(HOPELESS, len(draws)))
            if len(draws) and not stages and effective:  # no more than are likely to be needed
                size = min(size, max(FEWEST_AT_ONCE, int(np.ceil((effort.effective / effective - 1) * len(draws)))))
            size = min(size, PILOT_DRAWS - len(draws)) if len(draws) < PILOT_DRAWS else size
            now = slice(len(draws), min(len(draws) + size, effort.most_draws))
            solved: Iterable[list[Draw]] = ()
            if now.stop > len(earlier):
                fresh = max(now.start, len(earlier)) // alike, -(-now.stop // alike)
                pilot = draws[::alike][:PILOT_DRAWS]
                shares, density = proposed_draws(prior, evidence, pilot, *fresh, run.seed)
                solved = run.map(solve, range(*fresh), prior.values(shares), shares.tolist(), density.tolist())
            for some in chain([earlier[now]], solved):
                draws += some
                run.solved(sum(each.certificate.states for each in some))
            samples = _collected(prior, tuple(torques), rotations, evidence, draws, run.seed)
            effective = samples.effective + 1e-9  # equal weights give a whole number but for rounding
            if stages or effective >= effort.effective:
                stages = (*stages, samples)
            samples = replace(samples, stages=stages)
            if seen and samples.weights.any():
                seen(samples)
            is_last = len(draws) >= effort.most_draws or (len(draws) >= HOPELESS and not len(samples.weights))
            if is_last and effective < effort.effective:
                raise _too_few(samples, draws, evidence, effort.effective)
            if is_last or (effective >= effort.effective and (effective >= effort.most_effective or enough(samples))):
                _require_shown(draws, evidence)
                return samples
    finally:
        if len(draws) > len(earlier) and (further_name or not further):
            kept.keep(draws)


def limits_settled(left_arcsec: Sequence[float | None], samples: Samples, sure: float = SURE) -> bool:
    """Whether as many samples again would hardly change the verdict on any limit (Probability.is_stable).

    Arguments: left_arcsec, at each torque the room that a limit leaves F'_ior beside the self error, None without a
    limit; sure, probability that PASS needs.
    """
    found = [samples.probability_within(left, k, sure) for k, left in enumerate(left_arcsec) if left is not None]
    return all(each.is_stable(sure) for each in found)


def _solved(
    prior: DrivePrior,
    torques: tuple[float, ...],
    rotations_deg: tuple[float, ...],
    evidence: tuple[Evidence, ...],
    further: FiguresOf | None,
    near: DeviationProposal | None,
    seed: int,
    number: int,
    values: dict[str, float],
    shares: list[float],
    density: float,
) -> list[Draw]:
    """A draw solved: stiffness first where there is evidence of it, then F'_ior if the draw is kept, by its chance.

    Arguments: near, which draws deviations anew near F'_ior as measured, for several draws that share all else; seed;
    number of the draw; its values, by path, and their shares of probability, with the chance behind them; density that
    it was drawn with, over the prior's.
    """
    *of_fields, chance = shares
    drive, count = prior.drive, near.draws if near else 1
    if outside := next((path for path, value in values.items() if not drive.allows(path, value)), None):
        return [Draw(refused=f"{outside}: out of range")] * count
    figures: Mapping[str, float] = {}
    follows: dict[str, float] = {}
    drive, proof, probability = drive.with_values(values), EMPTY, 1.0
    if prior.meshing:
        try:
            place, beyond = prior.meshing
            shift, proof = meshing_shift(drive)
            follows = {beyond.path: shift + float(beyond.value(np.array(shares[place])))}
        except HdassistError as error:
            return [Draw(refused=str(error.fault))] * count
        drive = drive.with_values(follows)
    if conflict := first_conflict(drive):
        return [Draw(refused=f"{conflict.path}: {conflict.message}")] * count
    measured, solved = [each for each in evidence if each.M_g], list[Draw]()
    places = [(each.M_g, each.rotation_deg) for each in measured]
    if torques and any(each.figure == ACCURACY for each in evidence):
        places.append((ACCURACY_LOAD * rated_torque(drive), 0.0))
    try:
        if any(each.figure in STIFFNESS_FIGURES for each in evidence):
            figures, stiff = stiffness_figures(drive)
            proof += stiff
            probability = min(1.0, float(np.exp(log_likelihood(evidence, figures))) / density / KEPT_LIKELIHOOD)
        if chance >= probability:
            return [Draw(figures=figures, proof=astuple(proof), follows=follows)] * count
        maps = error_maps(drive, list(dict.fromkeys((*torques, *(M_g for M_g, _ in places)))))
        chosen, found = near.drawn(maps, number) if near else ([({}, 1.0)], EMPTY)
        proof += found
        for nearer, its_density in chosen:
            its_shares = [nearer.get(f.path, share) for f, share in zip(prior.fields, of_fields, strict=True)]
            moved = drive.with_values(prior.values(np.array([its_shares]))[0])
            F_ior, turned, there, found = errors_by_turn(maps, moved, torques, rotations_deg, places)
            more, more_proof = further(moved) if further else ({}, EMPTY)
            held = [*(each.figure for each in measured), *([ACCURACY] if len(places) > len(measured) else [])]
            now = {**figures, **more, **dict(zip(held, there.tolist(), strict=True))}
            weight = float(np.exp(log_likelihood(evidence, now))) / (density * its_density) / probability
            if measured:
                at = [seed, number * count + len(solved)]
                F_ior, turned = errors_shown(
                    measured, there[: len(measured)], torques, rotations_deg, F_ior, turned, at
                )
            at_turns, whole = tuple(map(tuple, turned.tolist())), astuple(proof + found + more_proof)
            solved.append(Draw("", now, tuple(F_ior.tolist()), at_turns, weight, tuple(its_shares), whole, follows))
            proof = EMPTY
    except HdassistError as error:
        return [Draw(refused=str(error.fault))] * count
    return solved


def errors_shown(
    errors: Sequence[Evidence],
    there: Array,
    torques: Sequence[float],
    rotations_deg: Sequence[float],
    F_ior: Array,
    turned: Array,
    seed: list[int],
) -> tuple[Array, Array]:
    """F'_ior [arcsec] of the drive, where the model of a draw has F_ior and turned, by F'_ior as measured on it.

    A draw of its scale, misfit, noise and misread value (belief/evidence.py), the same whatever else is asked for.
    Arguments: there, F'_ior of the model as measured, shape (errors,); the others as results of errors_by_turn.
    """
    y, stated, correlation = values_of_errors(errors)
    f, rng, kinds = there[None], np.random.default_rng(seed), error_kinds(len(y), {1.0: 0.0})
    mean = f.mean(axis=1)
    kind = kinds[rng.choice(len(kinds), p=softmax(log_likelihoods(kinds, f, y, stated, correlation, mean)[:, 0]))]
    of_scale, noise = rng.standard_normal(1), rng.standard_normal((1, len(y)))
    points = [(M_g, turn) for M_g in torques for turn in (0.0, *rotations_deg)]
    loads, turns = np.array([*points, *((each.M_g, each.rotation_deg) for each in errors)]).T
    misfit = np.zeros((1, len(turns)))
    for M_g in np.unique(loads):
        numbers = np.random.default_rng([*seed, int(M_g.view(np.uint64))]).standard_normal((1, SMOOTH_NUMBERS))
        misfit[:, loads == M_g] = smooth_misfits(turns[loads == M_g], numbers)
    every = np.append(np.column_stack([F_ior, turned]), there)[None]
    spreads, alike = kind.spreads(stated, y)[None], kernel(turns, turns) * np.equal.outer(loads, loads)
    shown, _ = errors_of_drive(every, y, (kind.misfit * mean) ** 2, spreads, alike, (of_scale, misfit, noise))
    shown = np.round(shown, SHOWN_DIGITS).reshape(len(torques), -1)
    return shown[:, 0], shown[:, 1:]


def _collected(
    prior: DrivePrior,
    torques: tuple[float, ...],
    rotations_deg: tuple[float, ...],
    evidence: tuple[Evidence, ...],
    draws: Sequence[Draw],
    seed: int,
) -> Samples:
    kept = [each for each in draws if each.F_ior_arcsec is not None]
    given = {ACCURACY, *(each.figure for each in evidence if each.M_g)}  # F'_ior, and no figures beside it
    names = [name for name in (kept[0].figures if kept else {}) if name not in given]
    return Samples(
        prior,
        torques,
        np.array([each.shares for each in kept]).reshape(len(kept), len(prior.fields)),
        np.array([each.F_ior_arcsec for each in kept]).reshape(len(kept), len(torques)),
        {name: np.array([each.figures[name] for each in kept]) for name in names},
        np.array([each.weight for each in kept]),
        len(draws),
        dict(sorted(Counter(each.refused for each in draws if each.refused).items())),
        seed,
        sum((each.certificate for each in draws), EMPTY),
        rotations_deg,
        np.array([each.turned_arcsec for each in kept]).reshape(len(kept), len(torques), len(rotations_deg)),
        tuple(draws),
    )


def _require_shown(draws: Sequence[Draw], evidence: tuple[Evidence, ...]) -> None:
    """Raise UntrustedError where no draw comes near F'_ior as measured: of equally bad ones all weigh the same."""
    errors = [each for each in evidence if each.M_g]
    kept = [each.figures for each in draws if each.F_ior_arcsec is not None]
    if not errors:
        return
    f = np.array([[figures[each.figure] for each in errors] for figures in kept])
    hint = "check values, torque and holes, then the ranges of what is assumed"
    require_shown([each.path for each in errors], f, *values_of_errors(errors), hint)


def _too_few(samples: Samples, draws: Sequence[Draw], evidence: tuple[Evidence, ...], needed: int) -> UntrustedError:
    """The error where fewer samples are effective than needed, with the evidence without which most would agree."""
    found = f"{samples.effective:.0f} of {len(draws)} draws are effective, {needed} are needed"
    if (count := sum(samples.refused.values())) > len(draws) / 2 or not evidence:
        reason = max(samples.refused, key=lambda each: samples.refused[each], default="no answer")
        return UntrustedError(f"{found}: {count} are no drive (most: {reason})", "narrow the assumed ranges")
    without = {each: _mean_likelihood(draws, tuple(e for e in evidence if e is not each)) for each in evidence}
    doubted = max(without, key=lambda each: without[each])
    if without[doubted] < CONTRADICTION * _mean_likelihood(draws, evidence):
        return UntrustedError(
            f"{found}: too few draws agree with all evidence at once, though no figure contradicts the others",
            "narrow the assumed ranges, or ask for fewer samples: --draws 16",
        )
    return UntrustedError(
        f"{found}: {doubted.path} = {doubted.value:g} contradicts the other evidence or the assumed ranges",
        "check that value and its unit, then the ranges of what is assumed",
    )


def _mean_likelihood(draws: Sequence[Draw], evidence: tuple[Evidence, ...]) -> float:
    """Mean likelihood of evidence over all draws that are drives, as far as each was predicted."""
    return float(np.mean([np.exp(log_likelihood(evidence, each.figures)) for each in draws if not each.refused]))
