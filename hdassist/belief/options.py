"""What it would take to meet a limit: options to act on, and questions to the manufacturer.

An option is an edit of the preset, as a user would make it, applied to the samples of the drive with the same random
numbers, so that its probability is that of a check of the edited preset. What follows from an edited field follows: a
tighter wheel has a tighter pitch and smaller harmonics too. Reference data (the accuracy) are applied again, as the
edited drive is another one that the manufacturer tests. A wheel in another hole is the same drive, which keeps its
weight. A question divides the samples by its answers.

The probability of an edit is that of `check` plus the difference that the edit makes over the solved samples:

(1)  P' = P + mean of [F' <= left] with the weights of the edited drive - mean of [F <= left]
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
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
from hdassist.error.cycle import WITHOUT_EFFECT, KinematicError, kinematic_error
from hdassist.error.error_map import error_maps, searchable
from hdassist.errors import SURE
from hdassist.model.deviations import carried, no_hole_better, unknown_turn
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.preset.knowledge import SUPPORT_FIELD
from hdassist.run.kept import ClosedRecord, kept_answer
from hdassist.run.run import UNCHECKED, Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.walk import digits_depend_on

_TRIED_HOLES = 4
_PHASORS_OFF = 20  # strongest waves, that a controller takes off
_CORRECTED = 3  # samples of which the full cycle is corrected
_CLEAR = 3.0  # standard errors by which a hole is worse that is not tried further
_NEARLY = 0.005  # of the loss, or of the probability: holes that are this near each other are all tried further
_LEVEL_PLACES = 12  # of a free seat
_FREE_POSITIONS = round(360 / FREE_STEP_DEG)  # places of a seat whose angle is free, counted as if they were holes

_StepKind = Literal["hole", "trials", "correction", "tolerance", "coupling", "accuracy", "question"]
_Needs = Literal["", "values in holes", "recording", "answer"]
_ReferenceData = Literal["kept", "applied again"]


@dataclass(frozen=True)
class Outcome(ClosedRecord):
    """F'_ior [arcsec] after a step, or with one answer to a question: percentiles, probability of meeting the limit.

    answer, in the words or number of a preset, empty of a step; chance of that answer; probability with its Monte Carlo
    interval, None without a limit; edit, the changes of the preset that state the answer.
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
    """A step on a drive and what comes of it.

    kind; of: hole to go to or holes to try (turns [deg] of a seat without holes), number of phasors, path of the field,
    coupling, or accuracy [arcsec]; outcomes, of a question one an answer; gain: mean move of the probability of meeting
    the limit, or without one of the median of F'_ior, as a share of it; edit: the changes of the preset that carry it
    out, as --set takes them, none where a value has to be measured first; needs, what that is; reference_data, whether
    they were applied again.
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
        """Whether the step is a question, and no option to act on."""
        return self.kind == "question"


@dataclass(frozen=True)
class _Corrected:
    """The share of F'_ior that a correction of the strongest terms leaves of a full cycle, and the proof."""

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
    """Return steps on a drive at one of its torques, and their proof: options by their gain, then questions by theirs.

    prior: prior of the drive.
    samples: samples of it; None where all is known.
    torques: torques of the drive [N*m].
    torque: place of the torque that the steps are for.
    left_arcsec: what a limit leaves F'_ior at each torque [arcsec]; None without a limit.
    run: the run.
    sure: probability of meeting a limit that PASS needs.
    middle: the full cycle of the sample in the middle at that torque, if it is known.
    The result is empty of drives with rolling balls. Raises UntrustedError where a state cannot be trusted.
    """
    drive = prior.drive
    if not searchable(drive):
        return (), EMPTY
    basis = OptionSamples.of(prior, samples, torque, left_arcsec[torque], sure)
    is_measured = is_error_measured(drive) and samples is not None
    if samples is not None and not (samples.sets_arcsec[:, :, torque] > 0).all():
        return (), EMPTY
    edits = [*tightened(prior), *coupled(prior)]
    if samples and not is_measured:
        edits += graded(prior)
    usable = [] if is_measured or unknown_turn(drive) else _usable_holes(drive)
    question = EditQuestion(
        samples=basis,
        edits=edits,
        torques=tuple(torques),
        tried_deg=_tried_turns(drive) if samples and unknown_turn(drive) else (),
        holes_deg=_turns_deg(drive, usable),
        is_measured=is_measured,
    )
    effects = question.effects(run)
    if not (effects.stated_arcsec > 0).all():
        return (), effects.proof
    now = _outcome_now(effects, samples)
    hole, of_hole = _hole_step(effects, usable, samples, torques, left_arcsec, run)
    corrected, of_correction = _corrected_step(effects, middle, torques[torque], now, run)
    found = [*_edited_steps(effects, edits, now, is_measured), *_tried_step(effects, now), *hole, *corrected]
    found += _questions(basis, found, now)
    gained = [replace(each, gain=_gain(now, each.outcomes)) for each in found]
    kept = [each for each in gained if each.gain >= LEAST_STEP_GAIN]
    proof = effects.proof + of_hole + of_correction
    return tuple(sorted(kept, key=lambda each: (each.is_question, -each.gain))), proof


def _outcome_now(effects: Effects, samples: Samples | None) -> Outcome:
    """Return the outcome without any step; samples: all stages of them, None where all is known."""
    basis = effects.samples
    if samples is None or basis.samples is None:
        return _outcome(effects.stated_arcsec, np.ones(1), basis.room_arcsec, None)
    kept = (
        None if basis.room_arcsec is None else samples.probability_within(basis.room_arcsec, basis.torque, basis.sure)
    )
    F_ior, weights = _all_sets(basis.samples, basis.torque)
    return _outcome(F_ior, weights, basis.room_arcsec, kept)


def _all_sets(samples: Samples, torque: int) -> tuple[Array, Array]:
    """Return F'_ior [arcsec] at a torque, by its place, of all sets of deviations, and the weights of these."""
    return samples.sets_arcsec[:, :, torque].ravel(), samples.set_weights.ravel()


def _gain(now: Outcome, outcomes: Sequence[Outcome]) -> float:
    """Return the mean move of the probability of meeting the limit, or of the median as a share.

    now: the outcome without a step.
    outcomes: that of a step, or those of the answers to a question, which count by their size either way.
    """
    total, gain = sum(each.chance for each in outcomes), 0.0
    for each in outcomes:
        move = 1 - each.p50 / now.p50
        if now.probability is not None and each.probability is not None:
            move = each.probability - now.probability
        gain += each.chance / total * (move if len(outcomes) == 1 else abs(move))
    return gain


def _outcome(F_ior: Array, weights: Array, left: float | None, kept: Probability | None) -> Outcome:
    """Return F'_ior [arcsec] over weighted samples.

    F_ior: F'_ior of the samples [arcsec], shape (samples,).
    weights: their weights, shape (samples,).
    left: what a limit leaves F'_ior [arcsec]; None without a limit.
    kept: probability of meeting it, if it is known from more samples.
    """
    p5, p50, p95 = (weighted_quantile(F_ior, weights, share) for share in (0.05, 0.5, 0.95))
    if left is None:
        return Outcome("", 1.0, p5, p50, p95, None)
    kept = kept or probability_of(left >= F_ior, weights)
    if len(F_ior) == 1:
        kept = Probability(*[float(left >= F_ior[0])] * 3)
    return Outcome("", 1.0, p5, p50, p95, kept.value, kept.low, kept.high)


def _scaled(outcome: Outcome, now: Outcome, before: Outcome) -> Outcome:
    """Return an outcome over one set of deviations of each sample, with percentiles by those of all sets.

    outcome: after a step, over one set.
    now: without the step, over all sets.
    before: without the step, over one set.
    """
    return replace(
        outcome,
        p5=outcome.p5 * now.p5 / before.p5,
        p50=outcome.p50 * now.p50 / before.p50,
        p95=outcome.p95 * now.p95 / before.p95,
    )


def _moved(kept: Probability, by: float) -> Probability:
    """Return a probability with its interval, moved by a difference."""
    value, low, high = (float(np.clip(each + by, 0, 1)) for each in (kept.value, kept.low, kept.high))
    return Probability(value, low, high)


# Steps


def _edited_steps(effects: Effects, edits: Sequence[Edit], now: Outcome, is_measured: bool) -> Iterator[Step]:
    """Yield the steps that are edits of the preset, and the question after the coupling where it is open."""
    is_known = effects.samples.samples is None
    reference_data: _ReferenceData = "kept" if is_measured or is_known else "applied again"
    answers = []
    for edit in edits:
        if edit.name not in effects.by_name:
            continue
        outcome = _changed_outcome(effects, effects.by_name[edit.name], now)
        if edit.kind == "coupling":
            answers.append(replace(outcome, answer=edit.of, edit=edit.texts))
        if edit.kind == "tolerance":
            yield Step("tolerance", edit.of, (outcome,), 0.0, edit.texts, reference_data=reference_data)
        elif edit.kind == "accuracy":
            yield Step("accuracy", edit.of, (outcome,), 0.0, edit.texts, reference_data=reference_data)
        elif edit.of == ASKED_COUPLINGS[0]:
            yield Step("coupling", edit.of, (outcome,), 0.0, edit.texts, reference_data=reference_data)
    if len(answers) == len(ASKED_COUPLINGS):
        likely = tuple(replace(each, chance=1 / len(answers)) for each in answers)
        yield Step("question", COUPLING, likely, 0.0, needs="answer", reference_data="applied again")


def _changed_outcome(effects: Effects, effect: Effect, now: Outcome) -> Outcome:
    """Return the outcome of an effect by equation (1)."""
    basis = effects.samples
    outcome = _outcome(*effect.values(), basis.room_arcsec, None)
    if basis.room_arcsec is None or now.probability is None or basis.all_sets is None:
        return outcome
    before, weights = basis.all_sets
    kept = probability_of(*effect.of_samples(basis.room_arcsec, len(basis.rows)))
    moved = _moved(kept, now.probability - float(np.average(before <= basis.room_arcsec, weights=weights)))
    return replace(outcome, probability=moved.value, probability_low=moved.low, probability_high=moved.high)


def _tried_step(effects: Effects, now: Outcome) -> Iterator[Step]:
    """Yield the step to measure some holes and keep the best of them; if the directions are known, mount names it."""
    drive = effects.samples.prior.drive
    tried = _apart(_usable_holes(drive))
    if BEST_OF_HOLES in effects.by_name and len(tried) > 1:
        outcome = _changed_outcome(effects, effects.by_name[BEST_OF_HOLES], now)
        yield Step(
            "trials", ",".join(_place_text(drive, hole) for hole in tried), (outcome,), 0.0, needs="values in holes"
        )


def _tried_turns(drive: Drive) -> tuple[float, ...]:
    """Return the turns [deg] of the holes that are tried."""
    return _turns_deg(drive, _apart(_usable_holes(drive)))


def _turns_deg(drive: Drive, holes: Sequence[int]) -> tuple[float, ...]:
    """Return the turns [deg] of the fixed wheel in holes."""
    return tuple(360 * hole / (drive.mounting.holes or _FREE_POSITIONS) for hole in holes)


def _place_text(drive: Drive, hole: int) -> str:
    """Return a hole by its number; of a free seat, its turn [deg]."""
    return str(hole) if drive.mounting.holes else f"{hole * FREE_STEP_DEG:g}"


def _hole_step(
    effects: Effects,
    usable: Sequence[int],
    samples: Samples | None,
    torques: Sequence[float],
    left_arcsec: Sequence[float | None],
    run: Run,
) -> tuple[list[Step], Certificate]:
    """Return the step to the hole that `mount` names, from the same samples and by the same rule, and its proof."""
    basis, drive = effects.samples, effects.samples.prior.drive
    if not usable:
        return [], EMPTY
    turns = _turns_deg(drive, usable)
    stay = usable.index(0) if 0 in usable else None
    if samples is None:
        changes = [turned_directions(drive, turn) for turn in turns]
        found = [searched(error_map, drive, changes, is_drawn=False) for error_map in error_maps(drive, torques)]
        F_ior = np.array([values for values, _ in found])[:, None, :]
        proof = sum((more for _, more in found), EMPTY)
        met = limits_met(F_ior, left_arcsec)
        losses = losses_of(governing_share(F_ior, F_ior))[0]
        place = chosen_hole(losses, None if met is None else met[0].astype(float), stay)
        if usable[place] == 0:
            return [], proof
        outcome = _outcome(F_ior[basis.torque][:, place], np.ones(1), basis.room_arcsec, None)
        return [_turned_step(drive, usable[place], outcome)], proof
    places = sorted({*_contending_holes(effects, left_arcsec, stay), *_level_places(drive)})
    some = sorted({0.0, *(turns[place] for place in places)})
    turned = turned_samples(samples, evidence_of(drive), some, run)
    proof = sum((each.turned_proof for each in turned.made), EMPTY)
    columns = {place: turned.rotations_deg.index(turns[place]) for place in places}
    losses, kept = (
        _mean_losses(effects, turned, columns),
        _kept_in_holes(turned, columns, len(turns), left_arcsec, basis.sure),
    )
    place = chosen_hole(losses, kept, stay)
    if usable[place] == 0:
        return [], proof
    column, inside = columns[place], None
    if basis.room_arcsec is not None:
        left, torque = basis.room_arcsec, basis.torque
        inside = turned.probability(lambda stage: stage.turned_arcsec[:, torque, column] <= left, basis.sure)
    first = turned.of_ranges
    outcome = _outcome(first.turned_arcsec[:, basis.torque, column], first.weights, basis.room_arcsec, inside)
    return [_turned_step(drive, usable[place], outcome)], proof


def _turned_step(drive: Drive, hole: int, outcome: Outcome) -> Step:
    """Return the step to put the fixed wheel in a hole."""
    [turn] = _turns_deg(drive, [hole])
    return Step("hole", _place_text(drive, hole), (outcome,), 0.0, _turn_texts(drive, turn))


def _contending_holes(effects: Effects, left_arcsec: Sequence[float | None], stay: int | None) -> list[int]:
    """Return the places of the holes that may be the best by what the first samples show, and that of the present one.

    effects: with the factors of F'_ior in all holes.
    left_arcsec: what a limit leaves F'_ior at each torque [arcsec]; None without a limit.
    stay: place of the present hole; None if the wheel may not stay there.
    """
    basis = effects.samples
    assert basis.samples is not None
    now = basis.samples.F_ior_arcsec[basis.rows]  # shape (rows, torques)
    first = basis.first_rows
    F_first = np.moveaxis(now[first][:, :, None] * effects.hole_factors, 1, 0)  # shape (torques, first rows, holes)
    losses = losses_of(governing_share(F_first, F_first))
    best = int(losses.mean(axis=0).argmin())
    lost = losses - losses[:, [best]]
    error = lost.std(axis=0, ddof=min(1, len(first) - 1)) / np.sqrt(len(first))
    may_win = lost.mean(axis=0) <= _CLEAR * error + _NEARLY
    # of every sample with the factors of every first one, shape (torques, rows x first rows, holes)
    every = np.einsum("rt,fth->trfh", now, effects.hole_factors).reshape(now.shape[1], -1, losses.shape[1])
    met = limits_met(every, left_arcsec)
    if met is not None:
        met = met.reshape(len(now), len(first), -1)
        low, high = (np.average(end, axis=0, weights=basis.weights) for end in (met.all(axis=1), met.any(axis=1)))
        surest = float(low.max())
        may_win = (high >= surest - _NEARLY) & (may_win | (high > surest + _NEARLY))
    places = {*np.flatnonzero(may_win).tolist(), *([] if stay is None else [stay])}
    return sorted(places)


def _level_places(drive: Drive) -> list[int]:
    """Return places of a free seat, evenly apart, by whose mean the torques are compared; none of a seat with holes."""
    return [] if drive.mounting.holes else list(range(0, _FREE_POSITIONS, _FREE_POSITIONS // _LEVEL_PLACES))


def _mean_losses(effects: Effects, turned: Samples, columns: Mapping[int, int]) -> Array:
    """Return the mean loss of each hole, shape (holes,): of those that are no column of the samples by the factors."""
    first = turned.of_ranges
    F_ior = (
        first.F_ior_arcsec.T[:, :, None] * effects.hole_factors.mean(axis=0)[:, None, :]
    )  # (torques, samples, holes)
    for place, column in columns.items():
        F_ior[:, :, place] = first.turned_arcsec[:, :, column].T
    level = F_ior[:, :, _level_places(first.prior.drive) or slice(None)]
    losses = np.average(losses_of(governing_share(F_ior, level)), axis=0, weights=first.weights)
    losses[[place for place in range(len(losses)) if place not in columns]] = np.inf
    return np.asarray(losses)


def _kept_in_holes(
    samples: Samples, columns: Mapping[int, int], holes: int, left_arcsec: Sequence[float | None], sure: float
) -> Array | None:
    """Return the probability of each hole to meet all limits, as `mount` states it; None without a limit.

    columns: place among the turns of the samples of each hole that may be chosen; all others have the probability 0.
    """
    if all(left is None for left in left_arcsec):
        return None

    def met(some: Samples, column: int) -> Array:
        answer = limits_met(some.turned_arcsec[..., column].T, left_arcsec)
        assert answer is not None
        return answer

    kept = np.zeros(holes)
    for place, column in columns.items():
        kept[place] = samples.probability(partial(met, column=column), sure).value
    return kept


def _turn_texts(drive: Drive, turn_deg: float) -> tuple[str, ...]:
    """Return changes of a preset that turn the fixed wheel; none where a direction is drawn from a range."""
    texts = []
    for path in carried(drive):
        value = drive.value(path)
        if value is None:
            continue
        turned = float(f"{(float(value) + turn_deg) % 360:.6g}")
        spread = drive.uncertainty.get(path)
        texts.append(f"{path}={turned:g}" + (f" ± {spread:g}" if spread else ""))
    return tuple(texts)


def _corrected_step(
    effects: Effects, middle: KinematicError | None, M_g: float, now: Outcome, run: Run
) -> tuple[list[Step], Certificate]:
    """Return the step to record a drive and to correct its strongest phasors, from a few solved cycles, and the proof.

    What a correction leaves as a share of F'_ior is taken from each of these cycles for each sample: from that of the
    sample in the middle, which is known already, and from those of some others, evenly over F'_ior.
    """
    basis = effects.samples
    drive = basis.prior.drive
    shares = [] if middle is None else [_share_left(middle)]
    count = (_CORRECTED if basis.samples else 1) - len(shares)
    order = np.argsort(effects.stated_arcsec, kind="stable")
    rows = order[even_rows(basis.weights[order], count)] if count else np.zeros(0, dtype=np.int64)
    cycles = basis.row_values(rows.tolist())
    parts = drive.model_dump(mode="json", exclude=WITHOUT_EFFECT)
    depends = {"drive": parts, "cycles": cycles, "M_g": M_g, "terms": _PHASORS_OFF, "program": digits_depend_on()}

    def corrected() -> list[_Corrected]:
        return list(run.map(partial(_corrected, drive, M_g), cycles))

    found = kept_answer("options", depends, _CORRECTED_CYCLES, corrected) if cycles else []
    shares += [each.share for each in found]
    proof = sum((each.proof for each in found), EMPTY)
    F_ior, weights = np.array([now.p50]), np.ones(1)
    if basis.samples:
        F_ior, weights = _all_sets(basis.samples, basis.torque)
    left = np.multiply.outer(F_ior, shares)
    kept = None
    if basis.room_arcsec is not None and basis.samples:  # a sample is one case, however many cycles are tried on it
        met = (left <= basis.room_arcsec).mean(axis=1).reshape(basis.samples.set_weights.shape)
        of_sample = basis.samples.set_weights.sum(axis=1)
        kept = probability_of((basis.samples.set_weights * met).sum(axis=1) / np.maximum(of_sample, 1e-300), of_sample)
    outcome = _outcome(left.ravel(), np.repeat(weights, len(shares)), basis.room_arcsec, kept)
    return [Step("correction", str(_PHASORS_OFF), (outcome,), 0.0, needs="recording")], proof


def _corrected(drive: Drive, M_g: float, values: Mapping[str, float]) -> _Corrected:
    """Return what a correction leaves of the full cycle of one sample at a torque [N*m]."""
    error = kinematic_error(drive.with_values(values), M_g, run=UNCHECKED)
    return _Corrected(_share_left(error), error.certificate)


def _share_left(error: KinematicError) -> float:
    """Return the share of F'_ior of a full cycle that is left without its strongest phasors."""
    curve = error.error_arcsec
    spectrum = np.fft.rfft(curve)
    spectrum[np.argsort(-np.abs(spectrum), kind="stable")[:_PHASORS_OFF]] = 0
    whole = max(float(np.ptp(curve)), NO_ERROR)
    return float(np.ptp(np.fft.irfft(spectrum, len(curve)))) / whole


def _questions(basis: OptionSamples, found: Sequence[Step], now: Outcome) -> Iterator[Step]:
    """Yield questions after the inputs of most influence: the samples on either side of the median of each."""
    samples = basis.samples
    if samples is None:
        return
    fields = {each.path: (k, each) for k, each in enumerate(samples.prior.fields)}
    asked = {each.of for each in found if each.is_question}
    F_ior = samples.F_ior_arcsec[:, basis.torque]
    before = _outcome(F_ior, samples.weights, basis.room_arcsec, None)
    for each in influences(samples, basis.torque):
        if each.group not in fields or (each.group == SUPPORT_FIELD and COUPLING in asked):
            continue
        place, prior = fields[each.group]
        x = prior.value(samples.shares[:, place])
        middle = float(f"{weighted_quantile(x, samples.weights, 0.5):.3g}")
        answers = []
        for answer, inside, ends in (
            (f"< {middle:g}", x < middle, (prior.low, middle)),
            (f"> {middle:g}", x >= middle, (middle, prior.high)),
        ):
            weights = samples.weights * inside
            if weights.any():
                chance = float(weights.sum() / samples.weights.sum())
                some = inside & (samples.weights > 0)
                outcome = _answered(F_ior[some], samples.weights[some], basis, now, before)
                answers.append(replace(outcome, answer=answer, chance=chance, edit=_range_texts(prior.path, *ends)))
        if len(answers) == 2:
            yield Step("question", each.group, tuple(answers), 0.0, needs="answer", reference_data="applied again")


def _answered(F_ior: Array, weights: Array, basis: OptionSamples, now: Outcome, before: Outcome) -> Outcome:
    """Return the outcome of an answer, over the samples that have it.

    F_ior: F'_ior of these samples [arcsec], shape (samples,).
    weights: their weights, shape (samples,).
    basis: all samples.
    now, before: the outcome without an answer, over all sets of deviations and over one set of each sample.
    """
    outcome = _outcome(F_ior, weights, basis.room_arcsec, None)
    if not basis.has_sets:
        return outcome
    outcome = _scaled(outcome, now, before)
    if basis.room_arcsec is None or now.probability is None or before.probability is None:
        return outcome
    moved = _moved(probability_of(basis.room_arcsec >= F_ior, weights), now.probability - before.probability)
    return replace(outcome, probability=moved.value, probability_low=moved.low, probability_high=moved.high)


def _range_texts(path: str, low: float, high: float) -> tuple[str, ...]:
    """Return changes of a preset that state a range of a field."""
    low, high = float(f"{low:.4g}"), float(f"{high:.4g}")
    range_text = f"source.{path}={{kind: assumed, range: [{low:g}, {high:g}], ref: {SOURCE_REF}}}"
    return f"{path}={(low + high) / 2:.4g}", range_text


# Holes


def _usable_holes(drive: Drive) -> list[int]:
    """Return the holes that the fixed wheel may be put in, or the places of a free seat; none if no hole is better."""
    if no_hole_better(drive):
        return []
    if not drive.mounting.holes:
        return list(range(_FREE_POSITIONS))
    if drive.mounting.allowed == "all":
        return list(range(drive.mounting.holes))
    return sorted(drive.mounting.allowed)


def _apart(holes: Sequence[int]) -> list[int]:
    """Return up to _TRIED_HOLES of some holes, as far apart as they can be."""
    count = min(_TRIED_HOLES, len(holes))
    return [holes[round(k * len(holes) / count)] for k in range(count)]
