"""What edits of a preset do to F'_ior of its samples: solved on a few of them, and on others only where these decide.

An edit changes F'_ior of similar samples by similar factors. It is therefore solved on a few samples first, evenly over
F'_ior. Every other sample takes the factors of those that are nearest to it in F'_ior, its donors. A sample is settled
if all donors agree on whether the limit is met and on the likelihood of the reference data. The samples that are not
settled are solved too, of edits that may still be among the best.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from hdassist.belief.draws import turn_of_test_deg
from hdassist.belief.edits import COUPLING, Edit
from hdassist.belief.evidence import ACCURACY, ACCURACY_LOAD, SOFT_EDGE, Evidence, evidence_of
from hdassist.belief.prior import DrivePrior
from hdassist.belief.samples import Samples
from hdassist.belief.statistics import effective_number, even_rows
from hdassist.error.cycle import WITHOUT_EFFECT
from hdassist.error.error_map import Batch, ErrorMap, error_maps
from hdassist.error.extremes import DRAWN_GRIDS, FINE_GRIDS, many_extremes
from hdassist.errors import HdassistError
from hdassist.model.deviations import carried, no_hole_better
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive, deviation_sizes
from hdassist.preset.knowledge import SUPPORT_FIELD
from hdassist.run.kept import kept_answer
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.walk import digits_depend_on

LEAST_STEP_GAIN = 0.02  # of the probability, or of F'_ior without a limit: a smaller one is no step
SHOWN_OPTIONS = 3  # best options, which are solved as far as the limit needs it
FIRST_SAMPLES = 24  # on which all edits are solved
_MOST_SAMPLES = 96  # that stand for all samples, if more of them have a weight
_DONORS = 8  # solved samples whose factors another sample takes
_NO_EFFECT = 0.005  # of F'_ior: a tolerance that reduces it by less
_LIKELIHOOD_SPREAD = 0.1  # of a sample's likelihood over its donors: above it the sample is not settled
_FEWEST_EFFECTIVE = 8.0  # samples that agree with the reference data of an edited drive: fewer tell nothing
TRIALS = "trials"  # name of the effect of the best of some holes


@dataclass(frozen=True, eq=False)
class OptionSamples:
    """Samples that edits are solved on, and what a limit leaves F'_ior.

    samples, None where all is known; rows, places of the samples that stand for all, and their weights; shares of each
    field's probability; torque, its place; left [arcsec], None without a limit; sure, probability that PASS needs.
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
    def of(
        cls, prior: DrivePrior, samples: Samples | None, torque: int, left: float | None, sure: float
    ) -> OptionSamples:
        """Return the samples of a drive that edits are solved on."""
        if samples is None:
            none = np.full((1, len(prior.fields)), 0.5)
            return cls(prior, None, np.zeros(1, dtype=np.int64), np.ones(1), none, torque, left, sure)
        first = samples.of_ranges
        rows = np.flatnonzero(first.weights)
        weights = first.weights[rows]
        if len(rows) > _MOST_SAMPLES:
            rows, count = np.unique(even_rows(first.weights, _MOST_SAMPLES), return_counts=True)
            weights = count.astype(float)
        return cls(prior, first, rows, weights, first.shares[rows], torque, left, sure)

    @property
    def stated_arcsec(self) -> Array | None:
        """F'_ior of the samples as all pages state it [arcsec], shape (rows,); None where all is known."""
        return None if self.samples is None else self.samples.F_ior_arcsec[self.rows, self.torque]

    @cached_property
    def first_rows(self) -> NDArray[np.int64]:
        """Places among the rows of the first samples that are solved, evenly over F'_ior."""
        if self.stated_arcsec is None:
            return np.zeros(1, dtype=np.int64)
        order = np.argsort(self.stated_arcsec, kind="stable")
        count = min(FIRST_SAMPLES, len(order))
        return np.unique(order[even_rows(self.weights[order], count)])

    @cached_property
    def draw_numbers(self) -> list[int]:
        """Number among all draws of the sample of each row."""
        if self.samples is None:
            return [0]
        made = [k for k, draw in enumerate(self.samples.made) if draw.F_ior_arcsec is not None]
        return [made[row] for row in self.rows]

    @property
    def tested_arcsec(self) -> Array | None:
        """F'_ior of the samples as the manufacturer tests it [arcsec], shape (rows,); None without an accuracy."""
        if self.samples is None:
            return None
        figures = [self.samples.made[number].figures for number in self.draw_numbers]
        if any(ACCURACY not in each for each in figures):
            return None
        return np.array([each[ACCURACY] for each in figures])

    def edited_shares(self, prior: DrivePrior, seed: int) -> Array:
        """Return shares of each field of an edited drive: those of the samples, and of a new field random ones."""
        places = {each.path: k for k, each in enumerate(self.prior.fields)}
        rng = np.random.default_rng([seed, len(prior.fields)])
        columns = []
        for each in prior.fields:
            random = rng.random(len(self.rows)) if self.samples else np.full(len(self.rows), 0.5)
            columns.append(self.shares[:, places[each.path]] if each.path in places else random)
        return np.array(columns).reshape(len(prior.fields), len(self.rows)).T

    def row_values(self, rows: Sequence[int]) -> list[dict[str, float]]:
        """Return the values by path of the samples in some rows."""
        return self.samples.values(self.rows[rows]) if self.samples else [{} for _ in rows]


@dataclass(frozen=True, eq=False)
class Effect:
    """F'_ior of samples with an edit, of each sample by its own solution or by those of its donors.

    F_ior_arcsec: shape (rows, donors).
    weights: of each of these, which differ from those of the samples by reference data, shape (rows, donors).
    is_solved: which samples the edit was solved on, shape (rows,).
    """

    F_ior_arcsec: Array
    weights: Array
    is_solved: NDArray[np.bool_]

    def values(self) -> tuple[Array, Array]:
        """Return F'_ior [arcsec] and its weights, one value of a sample whose donors agree, shape (values,) each."""
        is_one = (self.F_ior_arcsec == self.F_ior_arcsec[:, :1]).all(axis=1)
        F_ior = np.concatenate([self.F_ior_arcsec[is_one, 0], self.F_ior_arcsec[~is_one].ravel()])
        weights = np.concatenate([self.weights[is_one].sum(axis=1), self.weights[~is_one].ravel()])
        return F_ior, weights

    def met(self, left_arcsec: float) -> Array:
        """Return with which probability each sample meets what a limit leaves F'_ior [arcsec], shape (rows,)."""
        of_row = self.weights.sum(axis=1)
        met = (self.weights * (self.F_ior_arcsec <= left_arcsec)).sum(axis=1)
        return np.asarray(met / np.where(of_row > 0, of_row, 1))

    def unsettled(self, left_arcsec: float | None) -> NDArray[np.bool_]:
        """Return which samples are neither solved nor settled by their donors, shape (rows,)."""
        spread = np.ptp(self.weights, axis=1) / max(float(self.weights.max()), 1e-300)
        is_open = spread > _LIKELIHOOD_SPREAD
        if left_arcsec is not None:
            is_met = self.F_ior_arcsec <= left_arcsec
            is_open |= is_met.any(axis=1) & ~is_met.all(axis=1)
        return np.asarray(is_open & ~self.is_solved)

    def bounds(self, left_arcsec: float) -> tuple[float, float]:
        """Return the least and the greatest probability of meeting a limit that the unsettled samples leave open."""
        weights, met, is_open = self.weights.sum(axis=1), self.met(left_arcsec), self.unsettled(left_arcsec)
        low, high = (float(np.average(np.where(is_open, end, met), weights=weights)) for end in (0.0, 1.0))
        return low, high


@dataclass(frozen=True)
class _Solved:
    """F'_ior [arcsec] of a sample with each edit, by name, "" without any; None of one that makes no drive.

    F_ior at the torque; tested, at the load under which an accuracy is tested; in_holes, with the wheel in each hole,
    at all torques, shape (torques, holes).
    """

    F_ior: Mapping[str, float | None]
    tested: Mapping[str, float | None] = field(default_factory=dict)
    in_holes: tuple[tuple[float, ...], ...] = ()
    proof: Certificate = EMPTY


_SOLVED = TypeAdapter(list[_Solved])


@dataclass(frozen=True)
class _Task:
    """What is solved of a sample.

    values: of the sample, by path; edits: values that edits change, by name; systems: the same of edits with another
    contact system; tried_deg: turns of the wheel of which the best one counts; holes_deg: turns of all holes;
    tested_deg: turn in which the accuracy is tested, None if no accuracy counts; tested: names of the edits that it
    counts for.
    """

    values: Mapping[str, float]
    edits: Mapping[str, Mapping[str, float]]
    systems: Mapping[str, Mapping[str, float | str | None]]
    tried_deg: tuple[float, ...] = ()
    holes_deg: tuple[float, ...] = ()
    tested_deg: float | None = None
    tested: tuple[str, ...] = ()

    def of_edits(self, names: Iterable[str]) -> _Task:
        """Return the task of some edits alone, without the holes."""
        kept = {*names}
        return replace(
            self,
            edits={name: changed for name, changed in self.edits.items() if name in kept},
            systems={name: changed for name, changed in self.systems.items() if name in kept},
            tried_deg=self.tried_deg if TRIALS in kept else (),
            holes_deg=(),
            tested=tuple(name for name in self.tested if name in {"", *kept}),
        )


@dataclass(frozen=True, eq=False)
class Effects:
    """What edits do to F'_ior of samples.

    samples: the samples.
    stated_arcsec: F'_ior of each without any edit, shape (rows,).
    of: the effect of each edit by its name; none of an edit that makes no drive, or has no effect.
    hole_factors: F'_ior in each hole over that in the present one, of the first samples at all torques, shape (first
    rows, torques, holes).
    proof: of all states behind them.
    """

    samples: OptionSamples
    stated_arcsec: Array
    of: Mapping[str, Effect]
    hole_factors: Array
    proof: Certificate


def effects_of(
    samples: OptionSamples,
    edits: Sequence[Edit],
    torques: Sequence[float],
    *,
    tried_deg: Sequence[float] = (),
    holes_deg: Sequence[float] = (),
    is_measured: bool = False,
    run: Run = Run(),
) -> Effects:
    """Return what edits do to F'_ior of samples at a torque.

    samples: the samples, and the place of the torque.
    edits: the edits.
    torques: all torques of the drive [N*m].
    tried_deg: turns of the wheel of which the best one is an effect of its own, by the name TRIALS.
    holes_deg: turns of the holes that the first samples are solved in at all torques.
    is_measured: whether F'_ior was measured on the drive, which reference data do not count beside.
    run: the run.
    Raises UntrustedError where a state cannot be trusted.
    """
    tasks_of = partial(_tasks, samples, edits, tuple(tried_deg), tuple(holes_deg), is_measured, run.seed)
    first = samples.first_rows.tolist()
    solved = dict(zip(first, _solve(samples, tasks_of(first), torques, run), strict=True))
    names = [each.name for each in edits if not _is_idle(each, [*solved.values()])]
    names += [TRIALS] if tried_deg else []
    found = _found(samples, names, solved, is_measured)
    if further := _further(samples, found):
        rest = [task.of_edits(further[row]) for row, task in zip(further, tasks_of([*further]), strict=True)]
        solved |= zip(further, _solve(samples, rest, torques, run), strict=True)
        found = _found(samples, names, solved, is_measured)
    stated = samples.stated_arcsec
    if stated is None:
        stated = np.array([solved[0].F_ior[""]], dtype=float)
    factors = np.array([solved[row].in_holes for row in first]) if holes_deg else np.empty((len(first), 0, 0))
    if holes_deg and samples.samples is not None:
        now = samples.samples.F_ior_arcsec[samples.rows[first]]
        factors = factors / np.maximum(now, 1e-9)[:, :, None]
    return Effects(samples, stated, found, factors, sum((each.proof for each in solved.values()), EMPTY))


def _further(samples: OptionSamples, effects: Mapping[str, Effect]) -> dict[int, list[str]]:
    """Return the edits by row that are to be solved further: of those that may be among the best, unsettled samples."""
    left, stated = samples.left, samples.stated_arcsec
    if stated is None:  # a single sample, which is solved
        return {}
    contenders = {name: each for name, each in effects.items() if not name.startswith("accuracy:")}
    if left is not None:
        now = float(np.average(stated <= left, weights=samples.weights))
        bounds = {name: each.bounds(left) for name, each in contenders.items()}
        lowest = sorted((low for low, _ in bounds.values()), reverse=True)
        least = lowest[SHOWN_OPTIONS - 1] if len(lowest) >= SHOWN_OPTIONS else 0.0
        least = max(least, now + LEAST_STEP_GAIN)
        contenders = {name: each for name, each in contenders.items() if bounds[name][1] >= least}
    found = dict[int, list[str]]()
    for name, effect in contenders.items():
        for row in np.flatnonzero(effect.unsettled(left)).tolist():
            found.setdefault(row, []).append(name)
    return found


def _found(
    samples: OptionSamples, names: Sequence[str], solved: Mapping[int, _Solved], is_measured: bool
) -> dict[str, Effect]:
    """Return the effects of edits by what was solved so far; without those that make no drive of a sample."""
    evidence = None
    if not is_measured and samples.samples:
        evidence = next((each for each in evidence_of(samples.prior.drive) if each.figure == ACCURACY), None)
    effects = {}
    for name in names:
        effect = _effect(samples, name, solved, evidence)
        if effect is not None:
            effects[name] = effect
    return effects


def _effect(
    samples: OptionSamples, name: str, solved: Mapping[int, _Solved], evidence: Evidence | None
) -> Effect | None:
    """Return the effect of an edit; None if it makes no drive of a sample, or hardly a sample agrees with it."""
    is_grade = name.startswith("accuracy:")
    source = "" if is_grade else name
    rows = [row for row, each in solved.items() if source in each.F_ior]
    after = [solved[row].F_ior[source] for row in rows]
    if any(value is None for value in after):
        return None
    stated = samples.stated_arcsec
    before = np.array([solved[row].F_ior[""] for row in rows], dtype=float)
    if stated is None:
        stated = before
    factor = np.full(len(stated), np.nan)
    factor[rows] = np.array(after, dtype=float) / before
    donors = _donors(stated, factor)
    F_ior = stated[:, None] * factor[donors]
    weights = np.repeat(samples.weights[:, None] / donors.shape[1], donors.shape[1], axis=1)
    tested_now = samples.tested_arcsec
    if is_grade:
        grade = Evidence("catalogue.accuracy", ACCURACY, float(name.partition(":")[2]), SOFT_EDGE, "limit")
        tested = _tested(stated, solved, "")[donors] * stated[:, None] if tested_now is None else tested_now[:, None]
        weights = weights * np.exp(grade.log_likelihood(tested))
        if evidence and tested_now is not None:
            weights = weights / np.exp(evidence.log_likelihood(tested_now))[:, None]
    elif evidence and tested_now is not None:
        tested = tested_now[:, None] * _tested(tested_now, solved, name)[donors]
        ratio = evidence.log_likelihood(tested) - evidence.log_likelihood(tested_now)[:, None]
        weights = weights * np.exp(ratio)
    effective = effective_number(weights.sum(axis=1))
    if samples.samples and effective < min(_FEWEST_EFFECTIVE, effective_number(samples.weights)):
        return None
    is_solved = np.ones(len(stated), dtype=bool) if is_grade and tested_now is not None else ~np.isnan(factor)
    return Effect(F_ior, weights, is_solved)


def _tested(over_arcsec: Array, solved: Mapping[int, _Solved], name: str) -> Array:
    """Return F'_ior as tested with an edit over other values [arcsec], shape (rows,), NaN if unsolved."""
    tested = np.full(len(over_arcsec), np.nan)
    for row, each in solved.items():
        value = each.tested.get(name)
        if value is not None:
            tested[row] = value / over_arcsec[row]
    return tested


def _donors(F_ior_arcsec: Array, factor: Array) -> NDArray[np.int64]:
    """Return the solved samples whose factors a sample takes, shape (rows, donors): itself alone if it is solved.

    F_ior_arcsec: F'_ior of the samples [arcsec], shape (rows,).
    factor: of F'_ior with an edit, shape (rows,), NaN if not solved.
    """
    places = np.flatnonzero(~np.isnan(factor))
    distance = np.abs(np.subtract.outer(np.log(F_ior_arcsec), np.log(F_ior_arcsec[places])))
    donors = places[np.argsort(distance, axis=1, kind="stable")[:, :_DONORS]]
    donors[places] = places[:, None]
    return donors


def _is_idle(edit: Edit, solved: Sequence[_Solved]) -> bool:
    """Return whether a tolerance hardly reduces F'_ior of any of some samples."""
    if edit.kind != "tolerance":
        return False
    pairs = [(each.F_ior[""], each.F_ior.get(edit.name)) for each in solved]
    reductions = [1 - after / now for now, after in pairs if now and after is not None]
    return not reductions or max(reductions) < _NO_EFFECT


def _tasks(
    samples: OptionSamples,
    edits: Sequence[Edit],
    tried_deg: tuple[float, ...],
    holes_deg: tuple[float, ...],
    is_measured: bool,
    seed: int,
    rows: Sequence[int],
) -> list[_Task]:
    """Return what is solved of the samples in some rows."""
    drive = samples.prior.drive
    is_tested = not is_measured and samples.tested_arcsec is not None
    is_graded = any(each.kind == "accuracy" for each in edits) and samples.tested_arcsec is None
    changing = [each for each in edits if each.kind != "accuracy"]
    values = {each.name: each.prior.values(samples.edited_shares(each.prior, seed)[rows]) for each in changing}
    tested = (*((each.name for each in changing) if is_tested else ()), *(("",) if is_graded else ()))
    tasks = []
    for k, (row, of_sample) in enumerate(zip(rows, samples.row_values(rows), strict=True)):
        sample = drive.with_values(of_sample)
        changed, systems = dict[str, Mapping[str, float]](), dict[str, Mapping[str, float | str | None]]()
        for each in changing:
            edited = each.prior.drive.with_values(values[each.name][k])
            if each.has_own_system:
                systems[each.name] = {SUPPORT_FIELD: edited.number(SUPPORT_FIELD), COUPLING: edited.cam.coupling}
            else:
                sizes = {path: edited.number(path) for path in deviation_sizes()}
                changed[each.name] = {path: size for path, size in sizes.items() if size != sample.number(path)}
        turn = turn_of_test_deg(drive, [seed, samples.draw_numbers[row]]) if tested else None
        tasks.append(_Task(of_sample, changed, systems, tried_deg, holes_deg, turn, tested))
    return tasks


def _solve(samples: OptionSamples, tasks: Sequence[_Task], torques: Sequence[float], run: Run) -> list[_Solved]:
    """Return what is solved of samples, kept in the user's cache."""
    drive, is_drawn = samples.prior.drive, samples.samples is not None
    parts = drive.model_dump(mode="json", exclude=WITHOUT_EFFECT)
    described = [[dict(t.values), t.edits, t.systems, t.tried_deg, t.holes_deg, t.tested_deg, t.tested] for t in tasks]
    loads = [samples.torque, *torques]
    depends = {"drive": parts, "tasks": described, "M_g": loads, "drawn": is_drawn, "program": digits_depend_on()}

    def solved() -> list[_Solved]:
        solve = partial(_solve_one, drive, tuple(torques), samples.torque, is_drawn)
        answers = list(run.map(solve, tasks))
        run.solved(sum(each.proof.states for each in answers))
        return answers

    return kept_answer("options", depends, _SOLVED, solved)


def _solve_one(drive: Drive, torques: tuple[float, ...], torque: int, is_drawn: bool, task: _Task) -> _Solved:
    """Return F'_ior of one sample with its edits."""
    sample = drive.with_values(task.values)
    M_g, load = torques[torque], ACCURACY_LOAD * drive.rated_torque
    loads = dict.fromkeys((M_g, *(torques if task.holes_deg else ()), *((load,) if task.tested else ())))
    maps = {each.M_g: each for each in error_maps(sample, [*loads])}
    changes = [{}, *task.edits.values(), *(turned_directions(sample, turn) for turn in task.tried_deg)]
    values, proof = searched(maps[M_g], sample, changes, is_drawn=is_drawn)
    F_ior: dict[str, float | None] = dict(zip(("", *task.edits), values, strict=False))
    tested = dict[str, float | None]()
    if task.tried_deg:
        F_ior[TRIALS] = min(values[1 + len(task.edits) :])
    if task.tested and task.tested_deg is not None:
        some = [name for name in task.tested if not name or name in task.edits]
        turned = turned_directions(sample, task.tested_deg)
        there = [turned | dict(task.edits.get(name, {})) for name in some]
        found, more = searched(maps[load], sample, there, is_drawn=is_drawn) if some else ([], EMPTY)
        tested |= zip(some, found, strict=True)
        proof += more
    for name, changed in task.systems.items():
        F_ior[name] = tested[name] = None
        with suppress(HdassistError):
            other = sample.with_values(changed)
            own_loads = [M_g, load] if name in task.tested and load != M_g else [M_g]
            own = {each.M_g: each for each in error_maps(other, own_loads)}
            (as_mounted,), more = searched(own[M_g], other, [{}], is_drawn=is_drawn)
            proof += more
            if name in task.tested and task.tested_deg is not None:
                turn = 0.0 if no_hole_better(other) else task.tested_deg
                (tested[name],), more = searched(own[load], other, [turned_directions(other, turn)], is_drawn=is_drawn)
                proof += more
            F_ior[name] = as_mounted
    in_holes, of_holes = _in_holes([maps[each] for each in torques if each in maps], sample, task.holes_deg, is_drawn)
    return _Solved(F_ior, tested, in_holes, proof + of_holes)


def _in_holes(
    maps: Sequence[ErrorMap], drive: Drive, holes_deg: Sequence[float], is_drawn: bool
) -> tuple[tuple[tuple[float, ...], ...], Certificate]:
    """Return F'_ior [arcsec] of a drive in holes, shape (torques, holes), and the proof; nothing without holes."""
    if not holes_deg:
        return (), EMPTY
    changes = [turned_directions(drive, turn) for turn in holes_deg]
    found = [searched(error_map, drive, changes, is_drawn=is_drawn) for error_map in maps]
    return tuple(tuple(values) for values, _ in found), sum((proof for _, proof in found), EMPTY)


def turned_directions(drive: Drive, turn_deg: float) -> dict[str, float]:
    """Return the directions of a drive, by path, with the fixed wheel turned."""
    return {path: drive.number(path) + turn_deg for path in carried(drive)} if turn_deg % 360 else {}


def searched(
    error_map: ErrorMap, drive: Drive, changes: Sequence[Mapping[str, float]], *, is_drawn: bool
) -> tuple[list[float], Certificate]:
    """Return F'_ior [arcsec] of a drive with each of some changes of its deviations, and the proof."""
    paths = {path for change in changes for path in change} or {"tolerances.F_i1"}
    columns = {path: np.array([each.get(path, drive.number(path)) for each in changes]) for path in sorted(paths)}
    found = many_extremes(error_map, Batch(drive, columns), DRAWN_GRIDS if is_drawn else FINE_GRIDS)
    return found.F_ior_arcsec.tolist(), found.certificate
