"""Ways to meet a limit: options to act on, and questions to the manufacturer.

An option is an edit of the preset that a user could make. It is applied to the samples of the drive with the same
random numbers. Its probability is therefore that of a check of the edited preset, including all dependent changes: a
wheel with a tighter tolerance also has smaller pitch deviations and harmonics. Reference data (the accuracy) are
applied again, because the manufacturer would test the edited drive. With the wheel in another hole, the drive is the
same, and its weight does not change. A question divides the samples by the possible answers.

The probability after an edit is that of `check` plus the difference that the edit makes over the solved samples:

(1)  P' = P + mean of [F' <= left] with the weights of the edited drive - mean of [F <= left]
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from hdassist.belief.edits import ASKED_COUPLINGS, COUPLING, SOURCE_REF, Edit, coupled, graded, tightened
from hdassist.belief.effects import (
    BEST_OF_HOLES,
    LEAST_STEP_GAIN,
    EditQuestion,
    Effect,
    Effects,
    OptionSamples,
    searched,
    turned_directions,
)
from hdassist.belief.evidence import evidence_of, is_error_measured
from hdassist.belief.holes import FREE_STEP_DEG, NO_ERROR, chosen_hole, governing_share, limits_met, losses_of
from hdassist.belief.prior import DrivePrior
from hdassist.belief.samples import Samples, turned_samples
from hdassist.belief.statistics import Probability, even_rows, probability_of, weighted_quantile
from hdassist.belief.steps import influences
from hdassist.drive.error.cycle import WITHOUT_EFFECT, KinematicError, kinematic_error
from hdassist.drive.error.error_map import error_maps, searchable
from hdassist.drive.model.deviations import carried, no_hole_better, unknown_turn
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import Drive
from hdassist.drive.preset.knowledge import SUPPORT_FIELD
from hdassist.drive.solve.answers import EMPTY, Certificate
from hdassist.drive.solve.walk import digits_depend_on
from hdassist.run.errors import SURE
from hdassist.run.kept import ClosedRecord, kept_answer
from hdassist.run.run import UNCHECKED, Run

_TRIED_HOLES = 4  # largest number of holes in a trial of some holes
_PHASORS_OFF = 20  # number of phasors that a stored correction removes, the strongest first
_CORRECTED = 3  # number of samples for which a corrected full cycle is computed
_CLEAR = 3.0  # number of standard errors by which a hole must be worse than the best one to be excluded
_NEARLY = 0.005  # largest difference of loss or probability between holes that are considered nearly equal
_LEVEL_PLACES = 12  # number of positions of a free seat with which torques are compared
# number of positions of a seat with a free angle, which are treated as holes
_FREE_POSITIONS = round(360 / FREE_STEP_DEG)

_StepKind = Literal["hole", "trials", "correction", "tolerance", "coupling", "accuracy", "question"]
_Needs = Literal["", "values in holes", "recording", "answer"]
_ReferenceData = Literal["kept", "applied again"]


@dataclass(frozen=True)
class Outcome(ClosedRecord):
    """F'_ior after a step or with an answer to a question: percentiles [arcsec] and probability of meeting the limit.

    answer: answer as it is written in a preset; empty for a step.
    chance: probability of the answer; 1 for a step.
    p5, p50, p95: percentiles of F'_ior [arcsec].
    probability, probability_low, probability_high: probability of meeting the limit with its Monte Carlo interval; None
        without a limit.
    edit: changes of the preset that state the answer.
    """

    answer: str
    chance: float
    p5: float
    p50: float
    p95: float
    probability: float | None
    probability_low: float | None = None
    probability_high: float | None = None
    edit: tuple[str, ...] = ()


@dataclass(frozen=True)
class Step(ClosedRecord):
    """An option or a question that may help a drive to meet its limit, with its outcomes.

    kind: kind of the step.
    of: hole or holes (rotations [deg] for a seat without holes), number of phasors, path of the field, coupling, or
        accuracy [arcsec].
    outcomes: the outcome of an option, or the outcomes of the answers to a question.
    gain: mean change of the probability of meeting the limit; without a limit, mean relative change of the median of
        F'_ior.
    edit: changes of the preset for --set that implement the step; empty if a value must be measured first.
    needs: value or data that must be obtained first.
    reference_data: whether the reference data were applied again.
    """

    kind: _StepKind
    of: str
    outcomes: tuple[Outcome, ...]
    gain: float
    edit: tuple[str, ...] = ()
    needs: _Needs = ""
    reference_data: _ReferenceData = "kept"

    @property
    def is_question(self) -> bool:
        """Whether the step is a question rather than an option."""
        return self.kind == "question"


@dataclass(frozen=True)
class _Corrected:
    """Share of F'_ior that remains after the strongest phasors of a full cycle are corrected, with the certificate."""

    share: float
    proof: Certificate


_CORRECTED_CYCLES = TypeAdapter(list[_Corrected])


def steps_of(
    prior: DrivePrior,
    samples: Samples | None,
    torques: Sequence[float],
    torque: int,
    left_arcsec: Sequence[float | None],
    run: Run = Run(),
    sure: float = SURE,
    middle: KinematicError | None = None,
) -> tuple[tuple[Step, ...], Certificate]:
    """Return the steps for a drive at one torque, and the certificate of their states.

    Options come first, followed by questions, each sorted by gain.

    prior: prior of the drive.
    samples: samples of the drive; None if all inputs are known.
    torques: torques of the drive [N*m].
    torque: index of the torque of the steps.
    left_arcsec: limit minus self error at each torque [arcsec]; None without a limit.
    run: the run.
    sure: probability of meeting a limit from which the verdict is PASS.
    middle: full cycle of the median sample at that torque; None if it is not solved.

    There are no steps for drives with rolling balls or if F'_ior is 0. Raises UntrustedError if a state cannot be
    trusted.
    """
    if not searchable(prior.drive):
        return (), EMPTY
    if samples is not None and not (samples.sets_arcsec[:, :, torque] > 0).all():
        return (), EMPTY  # a gain is a share of F'_ior, which must not be 0
    basis = OptionSamples.of(prior, samples, torque, left_arcsec[torque], sure)
    question = _edit_question(basis, torques)
    effects = question.effects(run)
    if not (effects.stated_arcsec > 0).all():
        return (), effects.proof
    unchanged = _outcome_now(effects, samples)
    hole, proof_of_hole = _hole_step(effects, samples, torques, left_arcsec, run)
    correction, proof_of_correction = _corrected_step(effects, middle, torques[torque], unchanged, run)
    steps = [*_edited_steps(effects, question.edits, unchanged, question.is_measured), *_tried_step(effects, unchanged)]
    steps += [step for step in (hole, correction) if step is not None]
    steps += _questions(basis, steps, unchanged)
    return _worthwhile(steps, unchanged), effects.proof + proof_of_hole + proof_of_correction


def _worthwhile(steps: Sequence[Step], now: Outcome) -> tuple[Step, ...]:
    """Return the steps whose gain is sufficient, with their gains: first options and then questions, each by gain."""
    with_gain = [replace(step, gain=_gain(now, step.outcomes)) for step in steps]
    worthwhile = [step for step in with_gain if step.gain >= LEAST_STEP_GAIN]
    return tuple(sorted(worthwhile, key=lambda step: (step.is_question, -step.gain)))


def _edit_question(basis: OptionSamples, torques: Sequence[float]) -> EditQuestion:
    """Return the edits and the rotations of the fixed wheel whose effects are to be solved.

    basis: samples of the drive on which edits are solved.
    torques: torques of the drive [N*m].
    """
    prior = basis.prior
    drive = prior.drive
    is_measured = is_error_measured(drive) and basis.samples is not None
    edits = [*tightened(prior), *coupled(prior)]
    if basis.samples and not is_measured:
        edits += graded(prior)
    tried_deg: tuple[float, ...] = ()
    if basis.samples and unknown_turn(drive):
        tried_deg = _turns_deg(drive, _apart(_usable_holes(drive)))
    return EditQuestion(
        samples=basis,
        edits=edits,
        torques=tuple(torques),
        tried_deg=tried_deg,
        holes_deg=_turns_deg(drive, _comparable_holes(basis)),
        is_measured=is_measured,
    )


def _outcome_now(effects: Effects, samples: Samples | None) -> Outcome:
    """Return the outcome without any step.

    samples: all stages of the samples; None if all inputs are known.
    """
    basis = effects.samples
    if samples is None or basis.samples is None:
        return _outcome(effects.stated_arcsec, np.ones(1), basis.room_arcsec, None)
    met: Probability | None = None
    if basis.room_arcsec is not None:
        met = samples.probability_within(basis.room_arcsec, basis.torque, basis.sure)
    F_ior, weights = _all_sets(basis.samples, basis.torque)
    return _outcome(F_ior, weights, basis.room_arcsec, met)


def _all_sets(samples: Samples, torque: int) -> tuple[Array, Array]:
    """Return F'_ior at a torque for all sets of deviations [arcsec], and their weights.

    torque: index of the torque.
    """
    return samples.sets_arcsec[:, :, torque].ravel(), samples.set_weights.ravel()


def _gain(now: Outcome, outcomes: Sequence[Outcome]) -> float:
    """Return the mean change of the probability of meeting the limit or, without a limit, of the relative median.

    now: outcome without a step.
    outcomes: the outcome of an option, or the outcomes of the answers to a question, whose absolute changes count.
    """
    chances = sum(outcome.chance for outcome in outcomes)
    gain = 0.0
    for outcome in outcomes:
        move = 1 - outcome.p50 / now.p50
        if now.probability is not None and outcome.probability is not None:
            move = outcome.probability - now.probability
        size = move if len(outcomes) == 1 else abs(move)
        gain += outcome.chance / chances * size
    return gain


def _outcome(
    F_ior: Array,
    weights: Array,
    room_arcsec: float | None,
    met: Probability | None = None,
) -> Outcome:
    """Return the outcome for F'_ior over weighted samples.

    F_ior: F'_ior of the samples [arcsec], shape (samples,).
    weights: weights of the samples, shape (samples,).
    room_arcsec: limit minus self error [arcsec]; None without a limit.
    met: probability of meeting the limit, if it is known from more samples.
    """
    outcome = Outcome(
        answer="",
        chance=1.0,
        p5=weighted_quantile(F_ior, weights, 0.05),
        p50=weighted_quantile(F_ior, weights, 0.5),
        p95=weighted_quantile(F_ior, weights, 0.95),
        probability=None,
    )
    if room_arcsec is None:
        return outcome
    if len(F_ior) == 1:  # a known drive either meets the limit or does not
        value = float(room_arcsec >= F_ior[0])
        return _with_probability(outcome, Probability(value, value, value))
    return _with_probability(outcome, met or probability_of(room_arcsec >= F_ior, weights))


def _with_probability(outcome: Outcome, met: Probability) -> Outcome:
    """Return an outcome with the probability of meeting the limit."""
    return replace(
        outcome,
        probability=met.value,
        probability_low=met.low,
        probability_high=met.high,
    )


def _scaled(
    outcome: Outcome,
    now: Outcome,
    before: Outcome,
) -> Outcome:
    """Return an outcome over one set of deviations per sample, with its percentiles scaled to those of all sets.

    outcome: outcome after a step, over one set.
    now: outcome without the step, over all sets.
    before: outcome without the step, over one set.
    """
    return replace(
        outcome,
        p5=outcome.p5 * now.p5 / before.p5,
        p50=outcome.p50 * now.p50 / before.p50,
        p95=outcome.p95 * now.p95 / before.p95,
    )


def _moved(probability: Probability, by: float) -> Probability:
    """Return a probability and its interval shifted by a difference, and limited to the range from 0 to 1."""
    value, low, high = np.clip(np.array([probability.value, probability.low, probability.high]) + by, 0, 1).tolist()
    return Probability(value, low, high)


# --- steps


def _edited_steps(
    effects: Effects,
    edits: Sequence[Edit],
    now: Outcome,
    is_measured: bool,
) -> Iterator[Step]:
    """Yield the steps that are edits of the preset, and the question about the coupling if all its answers are solved.

    effects: effects of the edits.
    edits: the edits.
    now: outcome without an edit.
    is_measured: whether F'_ior was measured on the drive, so that reference data are not applied again.
    """
    is_known = effects.samples.samples is None
    reference_data: _ReferenceData = "kept" if is_measured or is_known else "applied again"
    answers = []
    for edit in edits:
        if edit.name not in effects.by_name:
            continue
        outcome = _changed_outcome(effects, effects.by_name[edit.name], now)
        if edit.kind == "coupling":
            answers.append(
                replace(
                    outcome,
                    answer=edit.of,
                    edit=edit.texts,
                )
            )
        kind = _kind_of(edit)
        if kind is not None:
            yield Step(
                kind=kind, of=edit.of, outcomes=(outcome,), gain=0.0, edit=edit.texts, reference_data=reference_data
            )
    if len(answers) == len(ASKED_COUPLINGS):
        equally_likely = tuple(replace(answer, chance=1 / len(answers)) for answer in answers)
        yield _question(COUPLING, equally_likely)


def _kind_of(edit: Edit) -> _StepKind | None:
    """Return the kind of the step for an edit; None for a coupling that is only part of a question."""
    if edit.kind == "tolerance":
        return "tolerance"
    if edit.kind == "accuracy":
        return "accuracy"
    return "coupling" if edit.of == ASKED_COUPLINGS[0] else None


def _question(of: str, answers: tuple[Outcome, ...]) -> Step:
    """Return a question with the outcomes of its answers, for which the reference data were applied again."""
    return Step(
        kind="question",
        of=of,
        outcomes=answers,
        gain=0.0,
        needs="answer",
        reference_data="applied again",
    )


def _changed_outcome(
    effects: Effects,
    effect: Effect,
    now: Outcome,
) -> Outcome:
    """Return the outcome of an edit from its effect, with the probability of equation (1)."""
    basis = effects.samples
    outcome = _outcome(*effect.values(), basis.room_arcsec)
    if basis.room_arcsec is None or now.probability is None or basis.all_sets is None:
        return outcome
    before, weights = basis.all_sets
    met_before = float(np.average(before <= basis.room_arcsec, weights=weights))
    met_after = probability_of(*effect.of_samples(basis.room_arcsec, len(basis.rows)))
    return _with_probability(outcome, _moved(met_after, now.probability - met_before))


def _tried_step(effects: Effects, now: Outcome) -> Iterator[Step]:
    """Yield the step to measure F'_ior in some holes and to use the best one, if its effect was solved."""
    drive = effects.samples.prior.drive
    tried = _apart(_usable_holes(drive))
    if BEST_OF_HOLES in effects.by_name and len(tried) > 1:
        outcome = _changed_outcome(effects, effects.by_name[BEST_OF_HOLES], now)
        places = ",".join(_place_text(drive, hole) for hole in tried)
        yield Step(
            kind="trials",
            of=places,
            outcomes=(outcome,),
            gain=0.0,
            needs="values in holes",
        )


def _turns_deg(drive: Drive, holes: Sequence[int]) -> tuple[float, ...]:
    """Return the rotations of the fixed wheel to holes [deg]."""
    return tuple(360 * hole / (drive.mounting.holes or _FREE_POSITIONS) for hole in holes)


def _place_text(drive: Drive, hole: int) -> str:
    """Return the number of a hole as text, or the rotation [deg] if the seat has a free angle."""
    return str(hole) if drive.mounting.holes else f"{hole * FREE_STEP_DEG:g}"


def _hole_step(
    effects: Effects,
    samples: Samples | None,
    torques: Sequence[float],
    left_arcsec: Sequence[float | None],
    run: Run,
) -> tuple[Step | None, Certificate]:
    """Return the step to turn the wheel to the hole that `mount` names, and the certificate.

    It uses the samples and the rule of `mount`. The step is None if no hole can be named, or if the wheel should stay.

    effects: effects with the factors of F'_ior in all holes.
    samples: all stages of the samples; None if all inputs are known.
    torques: torques of the drive [N*m].
    left_arcsec: limit minus self error at each torque [arcsec]; None without a limit.
    run: the run.
    """
    usable = _comparable_holes(effects.samples)
    if not usable:
        return None, EMPTY
    stay = usable.index(0) if 0 in usable else None
    if samples is None:
        place, outcome, proof = _exact_hole(effects, usable, stay, torques, left_arcsec)
    else:
        place, outcome, proof = _sampled_hole(effects, usable, stay, samples, left_arcsec, run)
    if outcome is None:
        return None, proof
    drive = effects.samples.prior.drive
    hole = usable[place]
    [turn_deg] = _turns_deg(drive, [hole])
    step = Step(
        kind="hole", of=_place_text(drive, hole), outcomes=(outcome,), gain=0.0, edit=_turn_texts(drive, turn_deg)
    )
    return step, proof


def _exact_hole(
    effects: Effects,
    usable: Sequence[int],
    stay: int | None,
    torques: Sequence[float],
    left_arcsec: Sequence[float | None],
) -> tuple[int, Outcome | None, Certificate]:
    """Return the index of the hole to choose for a completely known drive, its outcome, and the certificate.

    The outcome is None if the wheel should stay. The other arguments are those of `_hole_step`.

    usable: holes that may be chosen.
    stay: index of the present hole; None if the wheel may not stay there.
    """
    basis = effects.samples
    drive = basis.prior.drive
    # the drive is solved in all usable holes
    changes = [turned_directions(drive, turn_deg) for turn_deg in _turns_deg(drive, usable)]
    F_ior_of_torque = []
    proof = EMPTY
    for error_map in error_maps(drive, torques):
        values, proof_of_torque = searched(error_map, drive, changes, is_drawn=False)
        F_ior_of_torque.append(values)
        proof += proof_of_torque
    # the drive counts as a single sample
    F_ior = np.array(F_ior_of_torque)[:, None, :]  # shape (torques, one drive, holes)
    met = limits_met(F_ior, left_arcsec)
    losses = losses_of(governing_share(F_ior, F_ior))[0]
    place = chosen_hole(losses, None if met is None else met[0].astype(float), stay)
    if usable[place] == 0:
        return place, None, proof
    return place, _outcome(F_ior[basis.torque][:, place], np.ones(1), basis.room_arcsec), proof


def _sampled_hole(
    effects: Effects,
    usable: Sequence[int],
    stay: int | None,
    samples: Samples,
    left_arcsec: Sequence[float | None],
    run: Run,
) -> tuple[int, Outcome | None, Certificate]:
    """Return the index of the hole to choose over the samples of a drive, its outcome, and the certificate.

    Only holes that may be the best are solved. The outcome is None if the wheel should stay. The arguments are those of
    `_hole_step` and `_exact_hole`.
    """
    basis = effects.samples
    drive = basis.prior.drive
    turns_deg = _turns_deg(drive, usable)
    # only holes that may be the best are solved; a free seat also needs some positions for the comparison of torques
    places = sorted({*_contending_holes(effects, left_arcsec, stay), *_level_places(drive)})
    solved_deg = sorted({0.0, *(turns_deg[place] for place in places)})
    turned = turned_samples(samples, evidence_of(drive), solved_deg, run)
    proof = sum((draw.turned_proof for draw in turned.made), EMPTY)
    columns = {place: turned.rotations_deg.index(turns_deg[place]) for place in places}
    # losses are exact in solved holes, and estimated in other holes from the factors of the first samples
    losses = _mean_losses(effects, turned, columns)
    probabilities = _kept_in_holes(turned, columns, len(turns_deg), left_arcsec, basis.sure)
    place = chosen_hole(losses, probabilities, stay)
    if usable[place] == 0:
        return place, None, proof
    return place, _turned_outcome(basis, turned, columns[place]), proof


def _turned_outcome(
    basis: OptionSamples,
    turned: Samples,
    column: int,
) -> Outcome:
    """Return the outcome of a rotation of the fixed wheel.

    column: index of the rotation among those of the samples.
    """
    met: Probability | None = None
    if basis.room_arcsec is not None:
        room_arcsec = basis.room_arcsec
        met = turned.probability(lambda stage: stage.turned_arcsec[:, basis.torque, column] <= room_arcsec, basis.sure)
    first = turned.of_ranges
    return _outcome(first.turned_arcsec[:, basis.torque, column], first.weights, basis.room_arcsec, met)


def _contending_holes(
    effects: Effects,
    left_arcsec: Sequence[float | None],
    stay: int | None,
) -> list[int]:
    """Return the indices of the present hole and of all holes that may be the best according to the first samples.

    effects: effects with the factors of F'_ior in all holes.
    left_arcsec: limit minus self error at each torque [arcsec]; None without a limit.
    stay: index of the present hole; None if the wheel may not stay there.
    """
    basis = effects.samples
    assert basis.samples is not None
    F_ior = basis.samples.F_ior_arcsec[basis.rows]  # shape (rows, torques)
    first = basis.first_rows
    # the factors relate F'_ior in each hole to that in the present hole
    F_first = np.moveaxis(F_ior[first][:, :, None] * effects.hole_factors, 1, 0)  # shape (torques, first rows, holes)
    losses = losses_of(governing_share(F_first, F_first))
    best = int(losses.mean(axis=0).argmin())
    # paired differences over samples, which remove common effects of all holes
    behind = losses - losses[:, [best]]
    standard_error = behind.std(axis=0, ddof=min(1, len(first) - 1)) / np.sqrt(len(first))
    # a hole may win if it is within _CLEAR standard errors of the best hole, or nearly as good
    may_win = behind.mean(axis=0) <= _CLEAR * standard_error + _NEARLY

    bounds = _probability_bounds(effects, F_ior, left_arcsec)
    if bounds is not None:
        low, high = bounds
        # a hole whose upper bound is below this cannot have the largest probability
        surest = float(low.max())
        # a hole that may have the largest probability is chosen regardless of its loss
        may_win = (high >= surest - _NEARLY) & (may_win | (high > surest + _NEARLY))
    places = set(np.flatnonzero(may_win).tolist())
    if stay is not None:
        places.add(stay)
    return sorted(places)


def _probability_bounds(
    effects: Effects,
    F_ior: Array,
    left_arcsec: Sequence[float | None],
) -> tuple[Array, Array] | None:
    """Return bounds of the probability that all limits are met in each hole, shape (holes,) each; None without a limit.

    A sample counts for the lower bound if it meets the limits with the factors of every first sample, and for the upper
    bound if it meets them with the factors of at least one first sample.

    effects: effects with the factors of F'_ior in all holes.
    F_ior: F'_ior of all samples in the present position [arcsec], shape (rows, torques).
    left_arcsec: limit minus self error at each torque [arcsec]; None without a limit.
    """
    factors = effects.hole_factors  # shape (first rows, torques, holes)
    first, torques, holes = factors.shape
    # the factors of all first samples give the range of possible errors of each sample
    in_holes = np.einsum("rt,fth->trfh", F_ior, factors)
    met = limits_met(in_holes.reshape(torques, -1, holes), left_arcsec)
    if met is None:
        return None
    met = met.reshape(len(F_ior), first, holes)
    weights = effects.samples.weights
    return np.average(met.all(axis=1), axis=0, weights=weights), np.average(met.any(axis=1), axis=0, weights=weights)


def _level_places(drive: Drive) -> list[int]:
    """Return evenly spaced positions of a free seat, whose mean F'_ior is the reference at each torque.

    The result is empty for a seat with holes, because all holes are then the reference.
    """
    return [] if drive.mounting.holes else list(range(0, _FREE_POSITIONS, _FREE_POSITIONS // _LEVEL_PLACES))


def _mean_losses(
    effects: Effects,
    turned: Samples,
    columns: Mapping[int, int],
) -> Array:
    """Return the mean loss of each hole, shape (holes,); it is infinite for unsolved holes.

    effects: effects with the factors of F'_ior in all holes.
    turned: samples with F'_ior in the solved holes.
    columns: index of the rotation among those of the samples, by index of the solved hole.
    """
    first = turned.of_ranges
    mean_factors = effects.hole_factors.mean(axis=0)  # shape (torques, holes)
    F_ior = first.F_ior_arcsec.T[:, :, None] * mean_factors[:, None, :]  # shape (torques, samples, holes)
    for place, column in columns.items():
        F_ior[:, :, place] = first.turned_arcsec[:, :, column].T
    level = F_ior[:, :, _level_places(first.prior.drive) or slice(None)]
    losses = np.average(
        losses_of(governing_share(F_ior, level)),
        axis=0,
        weights=first.weights,
    )
    not_solved = [place for place in range(len(losses)) if place not in columns]
    # an unsolved hole cannot be chosen
    losses[not_solved] = np.inf
    return np.asarray(losses)


def _kept_in_holes(
    samples: Samples,
    columns: Mapping[int, int],
    holes: int,
    left_arcsec: Sequence[float | None],
    sure: float,
) -> Array | None:
    """Return the probability that all limits are met in each hole, shape (holes,); None without a limit.

    It is the probability that `mount` states.

    samples: samples with F'_ior in the solved holes.
    columns: index of the rotation among those of the samples, by index of the solved hole; the result for unsolved
        holes is 0.
    """
    if all(room_arcsec is None for room_arcsec in left_arcsec):
        return None

    def met(stage: Samples, column: int) -> Array:
        is_met = limits_met(stage.turned_arcsec[..., column].T, left_arcsec)
        assert is_met is not None
        return is_met

    probabilities = np.zeros(holes)
    for place, column in columns.items():
        probabilities[place] = samples.probability(partial(met, column=column), sure).value
    return probabilities


def _turn_texts(drive: Drive, turn_deg: float) -> tuple[str, ...]:
    """Return the changes of a preset that turn the fixed wheel; directions without a stated value are omitted."""
    texts = []
    for path in carried(drive):
        value = drive.value(path)
        if value is None:
            continue
        # the values have the six digits that are printed for --set
        turned = float(f"{(float(value) + turn_deg) % 360:.6g}")
        spread = drive.uncertainty.get(path)
        texts.append(f"{path}={turned:g} ± {spread:g}" if spread else f"{path}={turned:g}")
    return tuple(texts)


def _corrected_step(
    effects: Effects,
    middle: KinematicError | None,
    M_g: float,
    now: Outcome,
    run: Run,
) -> tuple[Step, Certificate]:
    """Return the step to record a drive and to correct its strongest phasors, and the certificate.

    The share of F'_ior that remains after the correction is computed for a few full cycles and applied to each sample.
    The cycles are that of the median sample, if it is solved, and those of further samples, evenly over F'_ior.

    effects: effects with the samples of the drive.
    middle: full cycle of the median sample; None if it is not solved.
    M_g: torque [N*m].
    now: outcome without the step.
    run: the run.
    """
    basis = effects.samples
    # the full cycle of the median sample needs no further solution
    shares = [] if middle is None else [_share_left(middle)]
    proof = EMPTY
    for corrected in _corrected_cycles(effects, M_g, len(shares), run):
        shares.append(corrected.share)
        proof += corrected.proof
    F_ior = np.array([now.p50])
    weights = np.ones(1)
    if basis.samples:
        F_ior, weights = _all_sets(basis.samples, basis.torque)
    # the residual share hardly depends on F'_ior, so all sets are combined with all cycles
    corrected_arcsec = np.multiply.outer(F_ior, shares)  # shape (sets of all samples, cycles)
    met: Probability | None = None
    if basis.room_arcsec is not None and basis.samples:
        met = _met_by_correction(corrected_arcsec <= basis.room_arcsec, basis.samples.set_weights)
    weights_of_cycles = np.repeat(weights, len(shares))
    outcome = _outcome(corrected_arcsec.ravel(), weights_of_cycles, basis.room_arcsec, met)
    step = Step(
        kind="correction",
        of=str(_PHASORS_OFF),
        outcomes=(outcome,),
        gain=0.0,
        needs="recording",
    )
    return step, proof


def _corrected_cycles(
    effects: Effects,
    M_g: float,
    available: int,
    run: Run,
) -> list[_Corrected]:
    """Return the residual shares of F'_ior in corrected full cycles of some samples, which are spread over F'_ior.

    effects: effects with the samples of the drive.
    M_g: torque [N*m].
    available: number of cycles that are already known.
    run: the run.
    """
    basis = effects.samples
    drive = basis.prior.drive
    count = (_CORRECTED if basis.samples else 1) - available
    if not count:
        return []
    order = np.argsort(effects.stated_arcsec, kind="stable")
    # the samples are spread over F'_ior at equal steps of weight
    rows = order[even_rows(basis.weights[order], count)]
    cycles = basis.row_values(rows.tolist())
    depends = {
        "drive": drive.model_dump(mode="json", exclude=WITHOUT_EFFECT),
        "cycles": cycles,
        "M_g": M_g,
        "terms": _PHASORS_OFF,
        "program": digits_depend_on(),
    }

    def corrected() -> list[_Corrected]:
        return list(run.map(partial(_corrected, drive, M_g), cycles))

    return kept_answer("options", depends, _CORRECTED_CYCLES, corrected)


def _met_by_correction(is_met: NDArray[np.bool_], set_weights: Array) -> Probability:
    """Return the probability that corrected samples meet the limit.

    Each sample is one independent case, regardless of the number of its cycles and sets of deviations.

    is_met: whether each set meets the limit with each cycle, shape (sets of all samples, cycles).
    set_weights: weights of the sets, shape (samples, sets).
    """
    # cycles have equal weights
    met_of_set = is_met.mean(axis=1).reshape(set_weights.shape)
    weights = set_weights.sum(axis=1)
    met_of_sample = (set_weights * met_of_set).sum(axis=1) / np.maximum(weights, 1e-300)
    return probability_of(met_of_sample, weights)


def _corrected(
    drive: Drive,
    M_g: float,
    values: Mapping[str, float],
) -> _Corrected:
    """Return the residual share of F'_ior in the corrected full cycle of one sample at a torque [N*m]."""
    error = kinematic_error(drive.with_values(values), M_g, run=UNCHECKED)
    return _Corrected(_share_left(error), error.certificate)


def _share_left(error: KinematicError) -> float:
    """Return the share of F'_ior that remains if the strongest phasors of a full cycle are removed."""
    curve = error.error_arcsec
    spectrum = np.fft.rfft(curve)
    strongest = np.argsort(-np.abs(spectrum), kind="stable")[:_PHASORS_OFF]
    # a stored correction removes the strongest terms exactly
    spectrum[strongest] = 0
    F_ior = max(float(np.ptp(curve)), NO_ERROR)
    return float(np.ptp(np.fft.irfft(spectrum, len(curve)))) / F_ior


def _questions(
    basis: OptionSamples,
    steps: Sequence[Step],
    now: Outcome,
) -> Iterator[Step]:
    """Yield a question about each input with a large influence: whether it is below or above its median.

    basis: samples of the drive.
    steps: other steps; if they ask about the coupling, no question about the support follows.
    now: outcome without an answer.
    """
    samples = basis.samples
    if samples is None:
        return
    place_of = {field_prior.path: place for place, field_prior in enumerate(samples.prior.fields)}
    is_coupling_asked = any(step.is_question and step.of == COUPLING for step in steps)
    # inputs that explain most of the variance are worth a question
    for influence in influences(samples, basis.torque):
        group = influence.group
        if group not in place_of or (group == SUPPORT_FIELD and is_coupling_asked):
            continue
        answers = _answers_about(basis, samples, place_of[group], now)
        if len(answers) == 2:
            yield _question(group, answers)


def _answers_about(
    basis: OptionSamples,
    samples: Samples,
    place: int,
    now: Outcome,
) -> tuple[Outcome, ...]:
    """Return the outcomes of the answers that a field is below or above its median, except answers without samples.

    basis, samples: samples of the drive.
    place: index of the field in the prior.
    now: outcome without an answer.
    """
    field_prior = samples.prior.fields[place]
    values = samples.prior.columns(samples.shares)[field_prior.path]
    # three digits are enough for a question that a person answers
    median = float(f"{weighted_quantile(values, samples.weights, 0.5):.3g}")
    is_below = values < median
    F_ior = samples.F_ior_arcsec[:, basis.torque]
    before = _outcome(F_ior, samples.weights, basis.room_arcsec)
    answers = []
    for answer, has_answer, low, high in (
        (f"< {median:g}", is_below, field_prior.low, median),
        (f"> {median:g}", ~is_below, median, field_prior.high),
    ):
        # an answer selects the samples on its side
        weights = samples.weights * has_answer
        if not weights.any():
            continue
        rows = has_answer & (samples.weights > 0)
        outcome = _answered(F_ior[rows], samples.weights[rows], basis, now, before)
        chance = float(weights.sum() / samples.weights.sum())
        range_texts = _range_texts(field_prior.path, low, high)
        answers.append(
            replace(
                outcome,
                answer=answer,
                chance=chance,
                edit=range_texts,
            )
        )
    return tuple(answers)


def _answered(
    F_ior: Array,
    weights: Array,
    basis: OptionSamples,
    now: Outcome,
    before: Outcome,
) -> Outcome:
    """Return the outcome of an answer, over the samples that have it.

    F_ior: F'_ior of these samples [arcsec], shape (samples,).
    weights: weights of these samples, shape (samples,).
    basis: all samples.
    now: outcome without an answer, over all sets of deviations.
    before: outcome without an answer, over one set of deviations of each sample.
    """
    outcome = _outcome(F_ior, weights, basis.room_arcsec)
    # the stated outcome includes further sets of deviations, so the outcome over one set is scaled to it
    if not basis.has_sets:
        return outcome
    outcome = _scaled(outcome, now, before)
    if basis.room_arcsec is None or now.probability is None or before.probability is None:
        return outcome
    met = probability_of(basis.room_arcsec >= F_ior, weights)
    return _with_probability(outcome, _moved(met, now.probability - before.probability))


def _range_texts(
    path: str,
    low: float,
    high: float,
) -> tuple[str, ...]:
    """Return the changes of a preset that state a range for a field."""
    # rounding as in print makes the printed command reproduce the printed result
    low = float(f"{low:.4g}")
    high = float(f"{high:.4g}")
    range_text = f"source.{path}={{kind: assumed, range: [{low:g}, {high:g}], ref: {SOURCE_REF}}}"
    return f"{path}={(low + high) / 2:.4g}", range_text


# --- holes


def _usable_holes(drive: Drive) -> list[int]:
    """Return the usable holes of the fixed wheel, or the positions of a free seat.

    The result is empty if no hole is better than another.
    """
    # turning the wheel has no effect
    if no_hole_better(drive):
        return []
    if not drive.mounting.holes:
        return list(range(_FREE_POSITIONS))
    if drive.mounting.allowed == "all":
        return list(range(drive.mounting.holes))
    return sorted(drive.mounting.allowed)


def _comparable_holes(basis: OptionSamples) -> list[int]:
    """Return the holes that can be compared without measured values.

    The result is empty if the directions of the deviations are unknown. It is also empty if F'_ior was measured on the
    drive, because `mount` then compares the holes by these values.
    """
    drive = basis.prior.drive
    is_measured = is_error_measured(drive) and basis.samples is not None
    return [] if is_measured or unknown_turn(drive) else _usable_holes(drive)


def _apart(holes: Sequence[int]) -> list[int]:
    """Return up to _TRIED_HOLES of the given holes, as far apart as possible."""
    count = min(_TRIED_HOLES, len(holes))
    # the list is in the order of the seat, so even steps in it are far apart
    return [holes[round(k * len(holes) / count)] for k in range(count)]
