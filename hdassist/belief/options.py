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
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from hdassist.belief.draws import turn_of_test_deg
from hdassist.belief.evidence import ACCURACY, ACCURACY_LOAD, SOFT_EDGE, Evidence, evidence_of
from hdassist.belief.holes import NO_ERROR, chosen_hole, governing_share, limits_met, losses_of
from hdassist.belief.prior import DrivePrior, prior_of
from hdassist.belief.samples import Samples, turned_samples
from hdassist.belief.statistics import Probability, effective_number, even_rows, probability_of, weighted_quantile
from hdassist.belief.steps import influences
from hdassist.error.cycle import WITHOUT_EFFECT, kinematic_error
from hdassist.error.error_map import Batch, ErrorMap, error_maps, searchable
from hdassist.error.extremes import DRAWN_GRIDS, FINE_GRIDS, many_extremes
from hdassist.errors import SURE, HdassistError
from hdassist.model.deviations import carried, no_hole_better, unknown_turn
from hdassist.model.geometry import Array
from hdassist.preset.fields import DEVIATIONS, Drive, Source, deviation_sizes
from hdassist.preset.knowledge import ACCURACY_GRADES, SUPPORT_FIELD, with_cam_support
from hdassist.run.kept import ClosedRecord, kept_answer
from hdassist.run.run import UNCHECKED, Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.walk import digits_depend_on

_MOST_SOLVED = 96  # samples that edits are solved on: these, if more of them have a weight
_SCREENED = 12  # samples that show which tolerances have no effect, and need no more of them
_NO_EFFECT = 0.005  # of F'_ior: a tolerance that reduces it by less
_THIRD_LESS = 2 / 3  # of a tolerance: a third less
_TRIED_HOLES = 4
_PHASORS_OFF = 20  # strongest waves, that a controller takes off
_CORRECTED = 5  # samples of which the full cycle is solved and corrected
_FREE_HOLES = 12  # directions where the angle of the seat is free
_LEAST_STEP_GAIN = 0.02  # of the probability, or of F'_ior without a limit: a smaller one is no step
_FEWEST_EFFECTIVE = 8.0  # samples that agree with the reference data of an edited drive: fewer tell nothing
_COUPLING = "cam.coupling"
_ASKED_COUPLINGS = ("oldham", "solid")
_SOURCE_REF = "option of hdassist check"

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

    kind; of: hole to go to, holes to try, number of phasors, path of the field, coupling, or accuracy [arcsec];
    outcomes, of a question one an answer; gain: mean move of the probability of meeting the limit, or without one of
    the median of F'_ior, as a share of it; edit: the changes of the preset that carry it out, as --set takes them, none
    where a value has to be measured first; needs, what that is; reference_data, whether they were applied again.
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


@dataclass(frozen=True, eq=False)
class _Edit:
    """An edit of a preset: name of the step, texts for --set, and the prior of the edited drive."""

    name: str
    texts: tuple[str, ...]
    prior: DrivePrior
    has_own_system: bool = False


@dataclass(frozen=True)
class _Solved:
    """F'_ior [arcsec] of a sample with each edit, by name, "" without any; None of one that makes no drive.

    F_ior at the torque; tested, at the load under which an accuracy is tested; turned, with the wheel in holes.
    """

    F_ior: Mapping[str, float | None]
    tested: Mapping[str, float | None] = field(default_factory=dict)
    turned: tuple[float, ...] = ()
    proof: Certificate = EMPTY


@dataclass(frozen=True)
class _Corrected:
    """The share of F'_ior that a correction of the strongest terms leaves of a full cycle, and the proof."""

    share: float
    proof: Certificate


_SOLVED, _CORRECTED_CYCLES = TypeAdapter(list[_Solved]), TypeAdapter(list[_Corrected])


@dataclass(frozen=True)
class _Task:
    """What is solved of a sample.

    values: of the sample, by path; edits: values that edits change, by name; systems: the same of edits with another
    contact system; rotations_deg: turns of the wheel; tested_deg: turn in which the accuracy is tested, None if no
    accuracy counts; tested_edits: whether it counts for edits too.
    """

    values: Mapping[str, float]
    edits: Mapping[str, Mapping[str, float]]
    systems: Mapping[str, Mapping[str, float | str | None]]
    rotations_deg: tuple[float, ...]
    tested_deg: float | None
    tested_edits: bool


@dataclass(frozen=True, eq=False)
class _Belief:
    """Samples that edits are solved on, and what a limit leaves F'_ior.

    samples, None where all is known; rows, places of the solved samples, and their weights; torque, its place; left
    [arcsec], None without a limit; sure, probability that PASS needs.
    """

    prior: DrivePrior
    samples: Samples | None
    rows: NDArray[np.int64]
    weights: Array
    shares: Array
    torque: int
    left: float | None
    sure: float

    @classmethod
    def of(cls, prior: DrivePrior, samples: Samples | None, torque: int, left: float | None, sure: float) -> _Belief:
        """Return the samples of a drive that edits are solved on."""
        if samples is None:
            none = np.full((1, len(prior.fields)), 0.5)
            return cls(prior, None, np.zeros(1, dtype=np.int64), np.ones(1), none, torque, left, sure)
        first = samples.of_ranges
        rows = np.flatnonzero(first.weights)
        weights = first.weights[rows]
        if len(rows) > _MOST_SOLVED:
            rows, count = np.unique(even_rows(first.weights, _MOST_SOLVED), return_counts=True)
            weights = count.astype(float)
        return cls(prior, first, rows, weights, first.shares[rows], torque, left, sure)

    @property
    def stated_arcsec(self) -> Array | None:
        """F'_ior of the solved samples as all pages state it [arcsec], shape (rows,); None where all is known."""
        return None if self.samples is None else self.samples.F_ior_arcsec[self.rows, self.torque]

    def now(self, every: Samples | None, F_ior: Array) -> Outcome:
        """Return the outcome without any step; every, all stages of the samples; F_ior [arcsec] without samples."""
        if every is None or self.samples is None:
            return _outcome(F_ior, np.ones(len(F_ior)), self.left, None)
        kept = None if self.left is None else every.probability_within(self.left, self.torque, self.sure)
        return _outcome(self.samples.F_ior_arcsec[:, self.torque], self.samples.weights, self.left, kept)

    def edited_shares(self, prior: DrivePrior, seed: int) -> Array:
        """Return shares of each field of an edited drive: those of the samples, and of a new field random ones."""
        places = {each.path: k for k, each in enumerate(self.prior.fields)}
        rng = np.random.default_rng([seed, len(prior.fields)])
        columns = []
        for each in prior.fields:
            random = rng.random(len(self.rows)) if self.samples else np.full(len(self.rows), 0.5)
            columns.append(self.shares[:, places[each.path]] if each.path in places else random)
        return np.array(columns).reshape(len(prior.fields), len(self.rows)).T

    def row_values(self) -> list[dict[str, float]]:
        """Return the values by path of the solved samples."""
        return self.samples.values(self.rows) if self.samples else [{}]


def steps_of(
    prior: DrivePrior,
    samples: Samples | None,
    torques: Sequence[float],
    torque: int,
    left_arcsec: Sequence[float | None],
    run: Run = Run(),
    sure: float = SURE,
) -> tuple[tuple[Step, ...], Certificate]:
    """Return steps on a drive at one of its torques, and their proof: options by their gain, then questions by theirs.

    prior: prior of the drive.
    samples: samples of it; None where all is known.
    torques: torques of the drive [N*m].
    torque: place of the torque that the steps are for.
    left_arcsec: what a limit leaves F'_ior at each torque [arcsec]; None without a limit.
    run: the run.
    sure: probability of meeting a limit that PASS needs.
    The result is empty of drives with rolling balls. Raises UntrustedError where a state cannot be trusted.
    """
    drive = prior.drive
    if not searchable(drive):
        return (), EMPTY
    belief = _Belief.of(prior, samples, torque, left_arcsec[torque], sure)
    is_measured = any(each.M_g for each in evidence_of(drive)) and samples is not None
    edits = [*_tightened(prior), *_coupled(prior), *([] if is_measured else _graded(prior, bool(samples)))]
    solved, proof = _solved_edits(belief, edits, torques[torque], is_measured, run)
    first = np.array([each.F_ior[""] for each in solved], dtype=float)
    if not (first > 0).all():
        return (), proof
    now = belief.now(samples, first)
    found = [*_edited_steps(belief, edits, solved, now, is_measured), *_tried_step(belief, solved, now)]
    if not is_measured and (mounted := _hole_step(belief, samples, torques, left_arcsec, run)):
        step, more = mounted
        found, proof = [*found, *step], proof + more
    corrected, more = _corrected_step(belief, torques[torque], now, run)
    found, proof = [*found, *corrected, *_questions(belief, found)], proof + more
    gained = [replace(each, gain=_gain(now, each.outcomes)) for each in found]
    kept = [each for each in gained if each.gain >= _LEAST_STEP_GAIN]
    return tuple(sorted(kept, key=lambda each: (each.is_question, -each.gain))), proof


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


def _moved(kept: Probability, by: float) -> Probability:
    """Return a probability with its interval, moved by a difference."""
    value, low, high = (float(np.clip(each + by, 0, 1)) for each in (kept.value, kept.low, kept.high))
    return Probability(value, low, high)


# Edits of the preset


def _tightened(prior: DrivePrior) -> Iterator[_Edit]:
    """Yield an edit for each tolerance that a drawing can tighten: a third less of it, and all that follows from it."""
    drive = prior.drive
    fields = {each.path: each for each in prior.fields}
    for path in dict.fromkeys(each.size for each in DEVIATIONS if each.size.startswith("tolerances.")):
        size = fields.get(path)
        value, source, uncertainty = drive.value(path), dict(drive.source), dict(drive.uncertainty)
        high = size.high if size else float(value or 0)
        if not high > 0:
            continue
        if size is None or size.distribution == "drawn":
            less = _rounded(float(value))
            texts = [f"{path}={less:g}"]
        elif size.distribution == "normal":
            less, spread = _rounded(float(value)), _rounded(uncertainty[path])
            uncertainty[path] = spread
            texts = [f"{path}={less:g} ± {spread:g}"]
        else:
            low, high = _rounded(size.low), _rounded(size.high)
            less = _rounded(float(value)) if value is not None else high / 2
            source[path] = Source(kind="assumed", range=(low, high), ref=_SOURCE_REF)
            text = f"source.{path}={{kind: assumed, range: [{low:g}, {high:g}], ref: {_SOURCE_REF}}}"
            texts = [f"{path}={less:g}", text]
        edited = drive.with_values({path: less}).model_copy(update={"source": source, "uncertainty": uncertainty})
        # a range on the command line counts beside a value there
        edited._origin = replace(drive.origin, overrides=(*drive.origin.overrides, *texts))
        yield _Edit(f"tolerance:{path}", tuple(texts), prior_of(edited))


def _rounded(value: float) -> float:
    """Return a third less of a value, as a drawing states it."""
    return float(f"{_THIRD_LESS * value:.4g}")


def _coupled(prior: DrivePrior) -> Iterator[_Edit]:
    """Yield an edit for each coupling that the drive could have: a solid hub only where the coupling is open."""
    drive = prior.drive
    is_open = drive.cam.coupling == "unknown" and any(each.path == SUPPORT_FIELD for each in prior.fields)
    if drive.cam.coupling == "oldham" or not drive.number(SUPPORT_FIELD):
        return
    for coupling in _ASKED_COUPLINGS if is_open else _ASKED_COUPLINGS[:1]:
        edited = with_cam_support(drive.with_values({_COUPLING: coupling}))
        yield _Edit(f"coupling:{coupling}", (f"{_COUPLING}={coupling}",), prior_of(edited), has_own_system=True)


def _graded(prior: DrivePrior, drawn: bool) -> Iterator[_Edit]:
    """Yield the edit that buys the next better accuracy of the catalogue, if the drive is one of a catalogue."""
    drive = prior.drive
    given = drive.catalogue.accuracy
    if not drawn or (given is None and drive.catalogue.K_3 is None):
        return
    better = next((grade for grade in ACCURACY_GRADES if given is None or grade < given), None)
    if better is not None:
        values = drive.catalogue.model_copy(update={"accuracy": better})
        edited = drive.model_copy(update={"catalogue": values})
        yield _Edit(f"accuracy:{better:g}", (f"catalogue.accuracy={better:g}",), replace(prior, drive=edited))


# Solving them


def _solved_edits(
    belief: _Belief, edits: Sequence[_Edit], M_g: float, is_measured: bool, run: Run
) -> tuple[list[_Solved], Certificate]:
    """Return F'_ior of the samples with each edit, and the proof; a tolerance without effect is not solved on all."""
    tasks = _tasks(belief, edits, is_measured, run.seed)
    drive, drawn = belief.prior.drive, belief.samples is not None
    screened = sorted({*even_rows(belief.weights, min(_SCREENED, len(tasks))).tolist()})
    first = dict(zip(screened, _solve(drive, [tasks[k] for k in screened], M_g, drawn, run), strict=True))
    idle = {
        each.name for each in edits if each.name.startswith("tolerance:") and _is_idle(each.name, [*first.values()])
    }
    others = [k for k in range(len(tasks)) if k not in first]
    slim = [replace(tasks[k], edits={n: v for n, v in tasks[k].edits.items() if n not in idle}) for k in others]
    rest = dict(zip(others, _solve(drive, slim, M_g, drawn, run), strict=True))
    solved = [(first | rest)[k] for k in range(len(tasks))]
    return solved, sum((each.proof for each in solved), EMPTY)


def _is_idle(name: str, solved: Sequence[_Solved]) -> bool:
    """Return whether an edit hardly reduces F'_ior on any of some samples."""
    pairs = [(each.F_ior[""], each.F_ior.get(name)) for each in solved]
    reductions = [1 - after / now for now, after in pairs if now and after is not None]
    return not reductions or max(reductions) < _NO_EFFECT


def _tasks(belief: _Belief, edits: Sequence[_Edit], is_measured: bool, seed: int) -> list[_Task]:
    """Return what is solved of each sample."""
    drive, rows = belief.prior.drive, belief.row_values()
    again = any(each.figure == ACCURACY for each in evidence_of(drive)) and not is_measured and bool(belief.samples)
    graded = any(each.name.startswith("accuracy:") for each in edits)
    numbers = belief.rows.tolist()
    if belief.samples:
        made = [k for k, each in enumerate(belief.samples.made) if each.F_ior_arcsec is not None]
        numbers = [made[row] for row in belief.rows]
    shares = {each.name: belief.edited_shares(each.prior, seed) for each in edits}
    values = {each.name: each.prior.values(shares[each.name]) for each in edits}
    rotations = tuple(_tried_turns(drive)) if belief.samples and unknown_turn(drive) else ()
    tasks = []
    for k, row in enumerate(rows):
        sample = drive.with_values(row)
        changed, systems = dict[str, Mapping[str, float]](), dict[str, Mapping[str, float | str | None]]()
        for each in edits:
            edited = each.prior.drive.with_values(values[each.name][k])
            if each.has_own_system:
                systems[each.name] = {SUPPORT_FIELD: edited.number(SUPPORT_FIELD), _COUPLING: edited.cam.coupling}
            elif each.name.startswith("tolerance:"):
                sizes = {path: edited.number(path) for path in deviation_sizes()}
                changed[each.name] = {path: size for path, size in sizes.items() if size != sample.number(path)}
        tested = turn_of_test_deg(drive, [seed, numbers[k]]) if again or graded else None
        tasks.append(_Task(row, changed, systems, rotations, tested, again))
    return tasks


def _solve(drive: Drive, tasks: Sequence[_Task], M_g: float, drawn: bool, run: Run) -> list[_Solved]:
    """Return what is solved of samples, kept in the user's cache."""
    if not tasks:
        return []
    parts = drive.model_dump(mode="json", exclude=WITHOUT_EFFECT)
    described = [[dict(t.values), t.edits, t.systems, t.rotations_deg, t.tested_deg, t.tested_edits] for t in tasks]
    depends = {"drive": parts, "tasks": described, "M_g": M_g, "drawn": drawn, "program": digits_depend_on()}

    def solved() -> list[_Solved]:
        found = list(run.map(partial(_solve_one, drive, M_g, drawn), tasks))
        run.solved(sum(each.proof.states for each in found))
        return found

    return kept_answer("options", depends, _SOLVED, solved)


def _solve_one(drive: Drive, M_g: float, drawn: bool, task: _Task) -> _Solved:
    """Return F'_ior of one sample with its edits."""
    sample = drive.with_values(task.values)
    load = ACCURACY_LOAD * drive.rated_torque
    loads = [M_g] if task.tested_deg is None or load == M_g else [M_g, load]
    maps = {each.M_g: each for each in error_maps(sample, loads)}
    names = ["", *task.edits]
    turns = {f"turn:{k}": turn for k, turn in enumerate(task.rotations_deg)}
    changes = [{}, *task.edits.values(), *(_turned(sample, turn) for turn in turns.values())]
    values, proof = _searched(maps[M_g], sample, changes, drawn=drawn)
    F_ior: dict[str, float | None] = dict(zip(names, values, strict=False))
    turned, tested = values[len(names) :], dict[str, float | None]()
    if task.tested_deg is not None:
        some = names if task.tested_edits else names[:1]
        there = [_turned(sample, task.tested_deg) | dict(task.edits.get(name, {})) for name in some]
        found, more = _searched(maps[load], sample, there, drawn=drawn)
        tested |= dict(zip(some, found, strict=True))
        proof += more
    for name, changed in task.systems.items():
        F_ior[name] = tested[name] = None
        with suppress(HdassistError):
            other = sample.with_values(changed)
            own = {each.M_g: each for each in error_maps(other, loads)}
            (F_ior[name],), more = _searched(own[M_g], other, [{}], drawn=drawn)
            proof += more
            if task.tested_deg is not None and task.tested_edits:
                turn = 0.0 if no_hole_better(other) else task.tested_deg
                (tested[name],), more = _searched(own[load], other, [_turned(other, turn)], drawn=drawn)
                proof += more
    return _Solved(F_ior, tested, tuple(turned), proof)


def _turned(drive: Drive, turn_deg: float) -> dict[str, float]:
    """Return the directions of a drive, by path, with the fixed wheel turned."""
    return {path: drive.number(path) + turn_deg for path in carried(drive)} if turn_deg % 360 else {}


def _searched(
    error_map: ErrorMap, drive: Drive, changes: Sequence[Mapping[str, float]], *, drawn: bool
) -> tuple[list[float], Certificate]:
    """Return F'_ior [arcsec] of a drive with each of some changes of its deviations, and the proof."""
    paths = {path for change in changes for path in change} or {"tolerances.F_i1"}
    columns = {path: np.array([each.get(path, drive.number(path)) for each in changes]) for path in sorted(paths)}
    found = many_extremes(error_map, Batch(drive, columns), DRAWN_GRIDS if drawn else FINE_GRIDS)
    return found.F_ior_arcsec.tolist(), found.certificate


# Steps


def _edited_steps(
    belief: _Belief, edits: Sequence[_Edit], solved: Sequence[_Solved], now: Outcome, is_measured: bool
) -> Iterator[Step]:
    """Yield the steps that are edits of the preset, and the question after the coupling where it is open."""
    evidence = None
    if not is_measured and belief.samples:
        evidence = next((each for each in evidence_of(belief.prior.drive) if each.figure == ACCURACY), None)
    answers = []
    for each in edits:
        kind, _, of = each.name.partition(":")
        outcome = _edited_outcome(belief, each.name, solved, now, evidence, is_measured)
        if outcome is None:
            continue
        reference_data: _ReferenceData = "kept" if is_measured or not belief.samples else "applied again"
        if kind == "coupling":
            answers.append(replace(outcome, answer=of, edit=each.texts))
        if kind == "tolerance":
            yield Step("tolerance", of, (outcome,), 0.0, each.texts, reference_data=reference_data)
        elif kind == "accuracy":
            yield Step("accuracy", of, (outcome,), 0.0, each.texts, reference_data=reference_data)
        elif of == _ASKED_COUPLINGS[0]:
            yield Step("coupling", of, (outcome,), 0.0, each.texts, reference_data=reference_data)
    if len(answers) == len(_ASKED_COUPLINGS):
        likely = tuple(replace(each, chance=1 / len(answers)) for each in answers)
        yield Step("question", _COUPLING, likely, 0.0, needs="answer", reference_data="applied again")


def _edited_outcome(
    belief: _Belief,
    name: str,
    solved: Sequence[_Solved],
    now: Outcome,
    evidence: Evidence | None,
    is_measured: bool,
) -> Outcome | None:
    """Return the outcome of an edit by equation (1); None if it was not solved, or hardly a sample agrees with it."""
    source = "" if name.startswith("accuracy:") else name
    after = [each.F_ior.get(source) for each in solved]
    if any(value is None for value in after):
        return None
    F_ior, before = np.array(after, dtype=float), np.array([each.F_ior[""] for each in solved], dtype=float)
    stated = belief.stated_arcsec
    if is_measured and stated is not None:
        F_ior, before = stated * F_ior / before, stated
    weights = belief.weights
    if name.startswith("accuracy:"):
        graded = Evidence("catalogue.accuracy", ACCURACY, float(name.partition(":")[2]), SOFT_EDGE, "limit")
        weights = weights * _likelihood_ratio(solved, "", graded, evidence)
    elif evidence:
        weights = weights * _likelihood_ratio(solved, name, evidence, evidence)
    if belief.samples and effective_number(weights) < min(_FEWEST_EFFECTIVE, effective_number(belief.weights)):
        return None
    found = _outcome(F_ior, weights, belief.left, None)
    if belief.left is None or now.probability is None or belief.samples is None:
        return found
    kept = probability_of(F_ior <= belief.left, weights)
    of_rows = float(np.average(before <= belief.left, weights=belief.weights))
    moved = _moved(kept, now.probability - of_rows)
    return replace(found, probability=moved.value, probability_low=moved.low, probability_high=moved.high)


def _likelihood_ratio(solved: Sequence[_Solved], name: str, after: Evidence, before: Evidence | None) -> Array:
    """Return the likelihood of the accuracy of edited samples over that of the samples, shape (rows,)."""
    edited = np.array([each.tested[name] for each in solved], dtype=float)
    ratio = after.log_likelihood(edited)
    if before:
        ratio = ratio - before.log_likelihood(np.array([each.tested[""] for each in solved], dtype=float))
    return np.asarray(np.exp(ratio))


def _tried_step(belief: _Belief, solved: Sequence[_Solved], now: Outcome) -> Iterator[Step]:
    """Yield the step to measure some holes and keep the best of them."""
    drive = belief.prior.drive
    tried = _apart(_usable_holes(drive))
    is_choice = len(tried) > 1 and unknown_turn(drive)  # if the directions are known, mount names a hole at once
    if belief.samples is None or not is_choice:
        return
    before = np.array([each.F_ior[""] for each in solved], dtype=float)
    best = np.array([min(each.turned) for each in solved])
    stated = belief.stated_arcsec
    F_ior = best if stated is None else stated * best / before
    found = _outcome(F_ior, belief.weights, belief.left, None)
    if belief.left is not None and now.probability is not None and found.probability is not None:
        of_rows = float(np.average((before if stated is None else stated) <= belief.left, weights=belief.weights))
        kept = _moved(probability_of(F_ior <= belief.left, belief.weights), now.probability - of_rows)
        found = replace(found, probability=kept.value, probability_low=kept.low, probability_high=kept.high)
    yield Step("trials", ",".join(map(str, tried)), (found,), 0.0, needs="values in holes")


def _tried_turns(drive: Drive) -> Iterator[float]:
    """Yield the turns [deg] of the holes that are tried."""
    holes = drive.mounting.holes or _FREE_HOLES
    for hole in _apart(_usable_holes(drive)):
        yield 360 * hole / holes


def _hole_step(
    belief: _Belief,
    samples: Samples | None,
    torques: Sequence[float],
    left_arcsec: Sequence[float | None],
    run: Run,
) -> tuple[list[Step], Certificate] | None:
    """Return the step to the hole that `mount` names, from the same samples and by the same rule; None without one."""
    drive = belief.prior.drive
    holes, usable = drive.mounting.holes or _FREE_HOLES, _usable_holes(drive)
    if not usable or unknown_turn(drive):
        return None
    turns = tuple(360 * hole / holes for hole in usable)
    if samples is None:
        changes = [_turned(drive, turn) for turn in turns]
        found = [_searched(error_map, drive, changes, drawn=False) for error_map in error_maps(drive, torques)]
        F_ior, weights = np.array([values for values, _ in found])[:, None, :], np.ones(1)
        proof = sum((more for _, more in found), EMPTY)
        met = limits_met(F_ior, left_arcsec)
        kept = None if met is None else met[0].astype(float)
        turned = None
    else:
        turned = turned_samples(samples, evidence_of(drive), sorted({0.0, *turns}), run)
        first = turned.of_ranges
        columns = [turned.rotations_deg.index(turn) for turn in turns]
        F_ior, weights = np.moveaxis(first.turned_arcsec[..., columns], 0, 1), first.weights
        proof = sum((each.turned_proof for each in turned.made), EMPTY)
        kept = _kept_in_holes(turned, columns, left_arcsec, belief.sure)
    losses = np.average(losses_of(governing_share(F_ior, F_ior)), axis=0, weights=weights)
    place = chosen_hole(losses, kept, usable.index(0) if 0 in usable else None)
    if usable[place] == 0:
        return [], proof
    inside = None
    if turned is not None and belief.left is not None:
        column, left, torque = turned.rotations_deg.index(turns[place]), belief.left, belief.torque
        inside = turned.probability(lambda some: some.turned_arcsec[:, torque, column] <= left, belief.sure)
    outcome = _outcome(F_ior[belief.torque][:, place], weights, belief.left, inside)
    return [Step("hole", str(usable[place]), (outcome,), 0.0, _turn_texts(drive, turns[place]))], proof


def _kept_in_holes(
    samples: Samples, columns: Sequence[int], left_arcsec: Sequence[float | None], sure: float
) -> Array | None:
    """Return the probability of each hole to meet all limits, as `mount` states it; None without a limit."""
    if all(left is None for left in left_arcsec):
        return None

    def met(some: Samples, column: int) -> Array:
        found = limits_met(some.turned_arcsec[..., column].T, left_arcsec)
        assert found is not None
        return found

    return np.array([samples.probability(partial(met, column=column), sure).value for column in columns])


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


def _corrected_step(belief: _Belief, M_g: float, now: Outcome, run: Run) -> tuple[list[Step], Certificate]:
    """Return the step to record a drive and to correct its strongest phasors, from a few solved cycles, and the proof.

    What a correction leaves as a share of F'_ior is taken from each of these cycles for each sample.
    """
    drive, rows = belief.prior.drive, belief.row_values()
    places = even_rows(belief.weights, min(_CORRECTED if belief.samples else 1, len(rows)))
    cycles = [rows[place] for place in places.tolist()]
    parts = drive.model_dump(mode="json", exclude=WITHOUT_EFFECT)
    depends = {"drive": parts, "cycles": cycles, "M_g": M_g, "terms": _PHASORS_OFF, "program": digits_depend_on()}

    def corrected() -> list[_Corrected]:
        return list(run.map(partial(_corrected, drive, M_g), cycles))

    found = kept_answer("options", depends, _CORRECTED_CYCLES, corrected)
    shares, proof = [each.share for each in found], sum((each.proof for each in found), EMPTY)
    F_ior, weights = np.array([now.p50]), np.ones(1)
    if belief.samples:
        F_ior, weights = belief.samples.F_ior_arcsec[:, belief.torque], belief.samples.weights
    left = np.multiply.outer(F_ior, shares).ravel()
    kept = None
    if belief.left is not None and belief.samples:  # a sample is one case, however many cycles are tried on it
        kept = probability_of((np.multiply.outer(F_ior, shares) <= belief.left).mean(axis=1), weights)
    outcome = _outcome(left, np.repeat(weights, len(shares)), belief.left, kept)
    return [Step("correction", str(_PHASORS_OFF), (outcome,), 0.0, needs="recording")], proof


def _corrected(drive: Drive, M_g: float, values: Mapping[str, float]) -> _Corrected:
    """Return what a correction leaves of the full cycle of one sample at a torque [N*m]."""
    error = kinematic_error(drive.with_values(values), M_g, run=UNCHECKED)
    curve = error.error_arcsec
    spectrum = np.fft.rfft(curve)
    spectrum[np.argsort(-np.abs(spectrum), kind="stable")[:_PHASORS_OFF]] = 0
    whole = max(float(np.ptp(curve)), NO_ERROR)
    return _Corrected(float(np.ptp(np.fft.irfft(spectrum, len(curve)))) / whole, error.certificate)


def _questions(belief: _Belief, found: Sequence[Step]) -> Iterator[Step]:
    """Yield questions after the inputs of most influence: the samples on either side of the median of each."""
    samples = belief.samples
    if samples is None:
        return
    fields = {each.path: (k, each) for k, each in enumerate(samples.prior.fields)}
    asked = {each.of for each in found if each.is_question}
    F_ior = samples.F_ior_arcsec[:, belief.torque]
    for each in influences(samples, belief.torque):
        if each.group not in fields or (each.group == SUPPORT_FIELD and _COUPLING in asked):
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
                outcome = _outcome(F_ior[some], samples.weights[some], belief.left, None)
                answers.append(replace(outcome, answer=answer, chance=chance, edit=_range_texts(prior.path, *ends)))
        if len(answers) == 2:
            yield Step("question", each.group, tuple(answers), 0.0, needs="answer", reference_data="applied again")


def _range_texts(path: str, low: float, high: float) -> tuple[str, ...]:
    """Return changes of a preset that state a range of a field."""
    low, high = float(f"{low:.4g}"), float(f"{high:.4g}")
    range_text = f"source.{path}={{kind: assumed, range: [{low:g}, {high:g}], ref: {_SOURCE_REF}}}"
    return f"{path}={(low + high) / 2:.4g}", range_text


# Holes


def _usable_holes(drive: Drive) -> list[int]:
    """Return the holes that the fixed wheel may be put in, of a free seat directions; none if no hole is better."""
    if no_hole_better(drive):
        return []
    if not drive.mounting.holes:
        return list(range(_FREE_HOLES))
    if drive.mounting.allowed == "all":
        return list(range(drive.mounting.holes))
    return sorted(drive.mounting.allowed)


def _apart(holes: Sequence[int]) -> list[int]:
    """Return up to _TRIED_HOLES of some holes, as far apart as they can be."""
    count = min(_TRIED_HOLES, len(holes))
    return [holes[round(k * len(holes) / count)] for k in range(count)]
