"""Effects of edits of a preset on F'_ior of its samples, solved on as few samples as possible.

An edit changes F'_ior of similar samples by similar factors. It is therefore first solved on a few samples, which are
spread over F'_ior. Every other sample uses the factors of its donors, the solved samples with the nearest F'_ior. For
another coupling, donors also have a similar support of the wave generator. A sample is settled if all donors agree on
whether the limit is met and on the likelihood of the reference data. For edits that may be among the best, the samples
that are not settled are also solved.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from hdassist.belief.draws import start_of_test, turn_of_test_deg
from hdassist.belief.edits import COUPLING, Edit
from hdassist.belief.evidence import (
    ACCURACY,
    ACCURACY_LOAD,
    Evidence,
    accuracy_evidence,
    evidence_of,
    tested_positions,
)
from hdassist.belief.prior import DrivePrior
from hdassist.belief.samples import Samples
from hdassist.belief.statistics import effective_number, even_rows
from hdassist.drive.error.cycle import WITHOUT_EFFECT
from hdassist.drive.error.error_map import Batch, ErrorMap, error_maps
from hdassist.drive.error.extremes import DRAWN_GRIDS, FINE_GRIDS, many_extremes
from hdassist.drive.error.readings import ranges_as_tested
from hdassist.drive.model.deviations import carried, no_hole_better
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import Drive, deviation_sizes
from hdassist.drive.preset.knowledge import SUPPORT_FIELD
from hdassist.drive.solve.answers import EMPTY, Certificate
from hdassist.drive.solve.walk import digits_depend_on
from hdassist.run.errors import HdassistError
from hdassist.run.kept import kept_answer
from hdassist.run.run import Run

# smallest gain of an option: increase of the probability or, without a limit, relative reduction of F'_ior
LEAST_STEP_GAIN = 0.02
BEST_OF_HOLES = "trials"  # name of the effect of choosing the best of several holes
_BEST_EDITS = 3  # number of edits with the largest probabilities that are solved on unsettled samples
_FIRST_SAMPLES = 24  # number of samples on which all edits are solved
_MOST_SAMPLES = 96  # largest number of samples that represent all samples
_DONORS = 8  # number of donors of a sample on which an edit is not solved
_NO_EFFECT = 0.005  # relative reduction of F'_ior below which a tighter tolerance has no effect
# largest spread of weights over the donors of a settled sample, as a share of the largest weight of all samples
_LIKELIHOOD_SPREAD = 0.1
_FEWEST_EFFECTIVE = 8.0  # effective sample size of the edited drive below which an edit has no result
_LEAST_ERROR = 1e-9  # smallest F'_ior by which others are divided [arcsec]


@dataclass(frozen=True, eq=False)
class OptionSamples:
    """Samples on which edits are solved, and the limit of F'_ior.

    prior: prior of the drive.
    samples: samples of the drive; None if all inputs are known.
    rows: indices of the samples that represent all samples.
    weights: weights of these samples, shape (rows,).
    shares: quantile levels of the fields, shape (rows, fields).
    torque: index of the torque.
    room_arcsec: limit minus self error [arcsec]; None without a limit.
    sure: probability of meeting the limit from which the verdict is PASS.
    """

    prior: DrivePrior
    samples: Samples | None
    rows: NDArray[np.int64]
    weights: Array
    shares: Array
    torque: int
    room_arcsec: float | None
    sure: float

    @classmethod
    def of(
        cls,
        prior: DrivePrior,
        samples: Samples | None,
        torque: int,
        room_arcsec: float | None,
        sure: float,
    ) -> OptionSamples:
        """Return the samples of a drive on which edits are solved; the arguments are the attributes."""
        first = None if samples is None else samples.of_ranges
        # a drive whose inputs are all known is one sample with the quantile level 0.5 of every field
        if first is None:
            rows = np.zeros(1, dtype=np.int64)
            weights = np.ones(1)
            shares = np.full((1, len(prior.fields)), 0.5)
        else:
            # samples without weight are omitted
            rows = np.flatnonzero(first.weights)
            weights = first.weights[rows]
            # even_rows may select a row several times, so the number of selections is its weight
            if len(rows) > _MOST_SAMPLES:
                rows, count = np.unique(even_rows(first.weights, _MOST_SAMPLES), return_counts=True)
                weights = count.astype(float)
            shares = first.shares[rows]
        return cls(
            prior=prior,
            samples=first,
            rows=rows,
            weights=weights,
            shares=shares,
            torque=torque,
            room_arcsec=room_arcsec,
            sure=sure,
        )

    @property
    def stated_arcsec(self) -> Array | None:
        """F'_ior of the samples without any edit [arcsec], shape (rows,); None if all inputs are known."""
        return None if self.samples is None else self.samples.F_ior_arcsec[self.rows, self.torque]

    @property
    def support_levels(self) -> Array:
        """Quantile level of the wave generator's support of each sample, shape (rows,); 0 if the support is known."""
        paths = [of_field.path for of_field in self.prior.fields]
        if SUPPORT_FIELD not in paths:
            return np.zeros(len(self.rows))
        return self.shares[:, paths.index(SUPPORT_FIELD)]

    @property
    def has_sets(self) -> bool:
        """Whether each sample has several sets of deviations."""
        return self.samples is not None and self.samples.set_weights.shape[1] > 1

    @cached_property
    def all_sets(self) -> tuple[Array, Array] | None:
        """F'_ior of all sets of deviations [arcsec] and their weights, shape (sets x rows,) each.

        The first set of every sample comes first, then the second set of every sample, and so on. The value is None if
        all inputs are known.
        """
        if self.samples is None:
            return None
        F_ior = self.samples.sets_arcsec[self.rows, :, self.torque].T.ravel()
        # weights of the sets relative to that of the sample itself
        of_sets = self.samples.set_weights[self.rows]
        weights = self.weights[:, None] * of_sets / of_sets[:, :1]
        return F_ior, weights.T.ravel()

    @cached_property
    def first_rows(self) -> NDArray[np.int64]:
        """Positions in `rows` of the samples that are solved first, which are spread over F'_ior."""
        if self.stated_arcsec is None:
            return np.zeros(1, dtype=np.int64)
        # the samples are spread over F'_ior, because the factors of an edit depend on it
        order = np.argsort(self.stated_arcsec, kind="stable")
        count = min(_FIRST_SAMPLES, len(order))
        return np.unique(order[even_rows(self.weights[order], count)])

    @cached_property
    def draw_numbers(self) -> list[int]:
        """Number of the sample of each row among all draws."""
        if self.samples is None:
            return [0]
        # rows count only draws with F'_ior, but all draws have a number
        numbers = [number for number, draw in enumerate(self.samples.made) if draw.F_ior_arcsec is not None]
        return [numbers[row] for row in self.rows]

    @property
    def tested_arcsec(self) -> Array | None:
        """Predicted reading of each sample in the accuracy test [arcsec], shape (rows,); None without an accuracy."""
        if self.samples is None:
            return None
        figures = [self.samples.made[number].figures for number in self.draw_numbers]
        if any(ACCURACY not in of_draw for of_draw in figures):
            return None
        return np.array([of_draw[ACCURACY] for of_draw in figures])

    def edited_shares(self, prior: DrivePrior, seed: int) -> Array:
        """Return the quantile levels of the fields of an edited drive, shape (rows, fields).

        prior: prior of the edited drive; fields that the samples lack get random levels.
        seed: seed of the random levels.
        """
        places = {of_field.path: place for place, of_field in enumerate(self.prior.fields)}
        rng = np.random.default_rng([seed, len(prior.fields)])
        columns = []
        for of_field in prior.fields:
            random = rng.random(len(self.rows)) if self.samples else np.full(len(self.rows), 0.5)
            columns.append(self.shares[:, places[of_field.path]] if of_field.path in places else random)
        return np.array(columns).reshape(len(prior.fields), len(self.rows)).T

    def row_values(self, rows: Sequence[int]) -> list[dict[str, float]]:
        """Return the field values of samples, by path.

        rows: positions of the samples in `rows`.
        """
        return self.samples.values(self.rows[rows]) if self.samples else [{} for _ in rows]


@dataclass(frozen=True, eq=False)
class Effect:
    """F'_ior of samples with an edit, from the solution of each sample or of its donors.

    F_ior_arcsec: F'_ior of each sample by the factor of each donor [arcsec], shape (rows, donors).
    weights: weights of these values, to which the reference data were applied again, shape (rows, donors).
    is_solved: whether the edit was solved on each sample, shape (rows,).
    """

    F_ior_arcsec: Array
    weights: Array
    is_solved: NDArray[np.bool_]

    def values(self) -> tuple[Array, Array]:
        """Return F'_ior [arcsec] and its weights, shape (values,) each; equal values of a sample are merged."""
        is_one = (self.F_ior_arcsec == self.F_ior_arcsec[:, :1]).all(axis=1)
        F_ior = np.concatenate([self.F_ior_arcsec[is_one, 0], self.F_ior_arcsec[~is_one].ravel()])
        weights = np.concatenate([self.weights[is_one].sum(axis=1), self.weights[~is_one].ravel()])
        return F_ior, weights

    def met(self, left_arcsec: float) -> Array:
        """Return the probability that each sample meets a limit, shape (rows,).

        left_arcsec: limit minus self error [arcsec].
        """
        # all donors of a sample may contradict the reference data, so its weight may be 0
        of_row = self.weights.sum(axis=1)
        met = (self.weights * (self.F_ior_arcsec <= left_arcsec)).sum(axis=1)
        return np.asarray(met / np.where(of_row > 0, of_row, 1))

    def unsettled(self, left_arcsec: float | None) -> NDArray[np.bool_]:
        """Return whether each sample is neither solved nor settled by its donors, shape (rows,).

        left_arcsec: limit minus self error [arcsec]; None without a limit.
        """
        # donors disagree on whether the sample agrees with the reference data
        spread = np.ptp(self.weights, axis=1) / max(float(self.weights.max()), 1e-300)
        is_open = spread > _LIKELIHOOD_SPREAD
        if left_arcsec is not None:
            is_met = self.F_ior_arcsec <= left_arcsec
            # donors disagree on whether the limit is met
            is_open |= is_met.any(axis=1) & ~is_met.all(axis=1)
        return np.asarray(is_open & ~self.is_solved)

    def of_samples(self, left_arcsec: float, rows: int) -> tuple[Array, Array]:
        """Return the probability that a limit is met over all sets of each sample, and its weight, shape (rows,) each.

        left_arcsec: limit minus self error [arcsec].
        rows: number of samples; the array contains one block of this length per set.
        """
        weights = self.weights.sum(axis=1).reshape(-1, rows)
        met = self.met(left_arcsec).reshape(-1, rows)
        of_sample = weights.sum(axis=0)
        return np.asarray((weights * met).sum(axis=0) / np.where(of_sample > 0, of_sample, 1)), of_sample

    def bounds(self, left_arcsec: float) -> tuple[float, float]:
        """Return bounds of the probability of meeting a limit, given that some samples are not settled.

        left_arcsec: limit minus self error [arcsec].
        """
        weights = self.weights.sum(axis=1)
        met = self.met(left_arcsec)
        is_open = self.unsettled(left_arcsec)
        # either none of the unsettled samples meets the limit, or all do
        low = np.average(np.where(is_open, 0.0, met), weights=weights)
        high = np.average(np.where(is_open, 1.0, met), weights=weights)
        return float(low), float(high)


@dataclass(frozen=True)
class _Solved:
    """F'_ior of a sample with each edit [arcsec].

    F_ior: F'_ior at the torque by name of the edit ("" for no edit); None if the edit gives no valid drive.
    tested: reading in the accuracy test, by name of the edit.
    in_holes: F'_ior with the wheel in each hole at each torque, shape (torques, holes).
    proof: certificate of the states.
    """

    F_ior: Mapping[str, float | None]
    tested: Mapping[str, float | None] = field(default_factory=dict)
    in_holes: tuple[tuple[float, ...], ...] = ()
    proof: Certificate = EMPTY


_SOLVED = TypeAdapter(list[_Solved])


@dataclass(frozen=True)
class _Task:
    """Quantities to solve for one sample.

    values: values of the sample, by path.
    edits: sizes of deviations changed by each edit of the same contact system, by name of the edit.
    systems: values changed by each edit with its own contact system, by name of the edit.
    tried_deg: rotations of the wheel [deg], whose smallest F'_ior is the result BEST_OF_HOLES.
    holes_deg: rotations to all holes [deg], in which the sample is solved at all torques.
    tested_deg: rotation in the accuracy test [deg].
    tested: names of the edits to which the accuracy applies.
    test_start: first position of the test, as a share of the full mesh cycle.
    """

    values: Mapping[str, float]
    edits: Mapping[str, Mapping[str, float]]
    systems: Mapping[str, Mapping[str, float | str | None]]
    tried_deg: tuple[float, ...] = ()
    holes_deg: tuple[float, ...] = ()
    tested_deg: float = 0.0
    tested: tuple[str, ...] = ()
    test_start: float = 0.0

    def of_edits(self, names: Iterable[str]) -> _Task:
        """Return the task for some edits only, without the holes."""
        chosen = {*names}
        return replace(
            self,
            edits={name: changed for name, changed in self.edits.items() if name in chosen},
            systems={name: changed for name, changed in self.systems.items() if name in chosen},
            tried_deg=self.tried_deg if BEST_OF_HOLES in chosen else (),
            holes_deg=(),
            tested=tuple(name for name in self.tested if name in {"", *chosen}),
        )


@dataclass(frozen=True, eq=False)
class Effects:
    """Effects of edits on F'_ior of samples.

    samples: the samples.
    stated_arcsec: F'_ior of each sample without any edit [arcsec], shape (rows,).
    by_name: effect of each edit; edits that give no valid drive or have no effect are omitted.
    hole_factors: ratio of F'_ior in each hole to that in the present hole, for the first samples at all torques, shape
        (first rows, torques, holes).
    proof: certificate of all states.
    """

    samples: OptionSamples
    stated_arcsec: Array
    by_name: Mapping[str, Effect]
    hole_factors: Array
    proof: Certificate


@dataclass(frozen=True, eq=False)
class EditQuestion:
    """Edits and rotations of the fixed wheel whose effects are to be solved.

    samples: the samples, with the index of the torque.
    edits: the edits.
    torques: all torques of the drive [N*m].
    tried_deg: rotations of the wheel [deg], the best of which is a separate effect with the name BEST_OF_HOLES.
    holes_deg: rotations to the holes in which the first samples are solved at all torques [deg].
    is_measured: whether F'_ior was measured on the drive, so that the catalogue accuracy is not applied again.
    """

    samples: OptionSamples
    edits: Sequence[Edit]
    torques: tuple[float, ...]
    tried_deg: tuple[float, ...] = ()
    holes_deg: tuple[float, ...] = ()
    is_measured: bool = False

    def effects(self, run: Run = Run()) -> Effects:
        """Return the effects of the edits on F'_ior at the torque.

        Raises UntrustedError if a state cannot be trusted.
        """
        samples = self.samples
        # all edits are solved on a few samples, and on the other samples only if these are not settled
        first = samples.first_rows.tolist()
        solved = dict(
            zip(
                first,
                self._solve(self._tasks(first, run.seed), run),
                strict=True,
            )
        )
        # an edit without effect on any sample is not an option
        names = [edit.name for edit in self.edits if not _is_idle(edit, [*solved.values()])]
        if self.tried_deg:
            names.append(BEST_OF_HOLES)
        effects = self._effects(names, solved)
        # unsettled samples are solved with the edits that may be among the best
        undecided = _undecided(samples, effects)
        if undecided:
            tasks = zip(
                undecided,
                self._tasks([*undecided], run.seed),
                strict=True,
            )
            answers = self._solve([task.of_edits(undecided[row]) for row, task in tasks], run)
            solved |= zip(undecided, answers, strict=True)
            effects = self._effects(names, solved)
        stated = samples.stated_arcsec
        return Effects(
            samples=samples,
            stated_arcsec=np.array([solved[0].F_ior[""]], dtype=float) if stated is None else stated,
            by_name=effects,
            hole_factors=self._hole_factors([solved[row] for row in first]),
            proof=sum((answer.proof for answer in solved.values()), EMPTY),
        )

    def _hole_factors(self, answers: Sequence[_Solved]) -> Array:
        """Return the ratio of F'_ior in each hole to that in the present hole for the first samples.

        The shape is (first samples, torques, holes).

        The result is empty without holes, and if all inputs are known.
        """
        samples = self.samples
        if not self.holes_deg or samples.samples is None:
            return np.empty((len(answers), 0, 0))
        present = samples.samples.F_ior_arcsec[samples.rows[samples.first_rows]]
        in_holes = np.array([answer.in_holes for answer in answers])
        return np.asarray(in_holes / np.maximum(present, _LEAST_ERROR)[:, :, None])

    def _effects(self, names: Sequence[str], solved: Mapping[int, _Solved]) -> dict[str, Effect]:
        """Return the effects of edits from solved samples, omitting edits that give no valid drive for a sample."""
        evidence = None
        # a measured F'_ior takes precedence over the catalogue's accuracy
        if not self.is_measured and self.samples.samples:
            data = evidence_of(self.samples.prior.drive)
            evidence = next((datum for datum in data if datum.figure == ACCURACY), None)
        effects = {}
        for name in names:
            effect = _effect(self.samples, name, solved, evidence)
            if effect is not None:
                effects[name] = effect
        return effects

    def _tasks(self, rows: Sequence[int], seed: int) -> list[_Task]:
        """Return the task of each of several samples.

        rows: positions of the samples in `samples.rows`.
        seed: seed of the draws.
        """
        samples = self.samples
        drive = samples.prior.drive
        # a better accuracy grade changes only the weights of samples, so it needs no solution
        changing = [edit for edit in self.edits if edit.kind != "accuracy"]
        tested = self._tested_edits(changing)
        values = {edit.name: edit.prior.values(samples.edited_shares(edit.prior, seed)[rows]) for edit in changing}
        tasks = []
        for place, of_sample in enumerate(samples.row_values(rows)):
            changed = dict[str, Mapping[str, float]]()
            systems = dict[str, Mapping[str, float | str | None]]()
            for edit in changing:
                edited = edit.prior.drive.with_values(values[edit.name][place])
                # a support changes the contact system, deviations change only the gaps
                if edit.has_own_system:
                    systems[edit.name] = {SUPPORT_FIELD: edited.number(SUPPORT_FIELD), COUPLING: edited.cam.coupling}
                else:
                    changed[edit.name] = _changed_sizes(drive.with_values(of_sample), edited)
            of_draw = [seed, samples.draw_numbers[rows[place]]]
            task = _Task(
                values=of_sample,
                edits=changed,
                systems=systems,
                tried_deg=self.tried_deg,
                holes_deg=self.holes_deg,
                tested_deg=turn_of_test_deg(drive, of_draw) if tested else 0.0,
                tested=tested,
                test_start=start_of_test(of_draw) if tested else 0.0,
            )
            tasks.append(task)
        return tasks

    def _tested_edits(self, changing: Sequence[Edit]) -> tuple[str, ...]:
        """Return the names of the edits to solve in the accuracy test ("" for the drive without any edit)."""
        if self.samples.tested_arcsec is None:
            return ("",) if len(changing) < len(self.edits) else ()
        return () if self.is_measured else tuple(edit.name for edit in changing)

    def _solve(self, tasks: Sequence[_Task], run: Run) -> list[_Solved]:
        """Return the results of tasks, from the user's cache if they are stored there."""
        samples = self.samples
        drive = samples.prior.drive
        is_drawn = samples.samples is not None
        # the key contains everything on which the results depend, but no texts and limits
        depends = {
            "drive": drive.model_dump(mode="json", exclude=WITHOUT_EFFECT),
            "tasks": [_described(task) for task in tasks],
            "M_g": [samples.torque, *self.torques],
            "drawn": is_drawn,
            "program": digits_depend_on(),
        }

        def solved() -> list[_Solved]:
            solve = partial(_solve_one, drive, self.torques, samples.torque, is_drawn)
            answers = list(run.map(solve, tasks))
            run.solved(sum(answer.proof.states for answer in answers))
            return answers

        return kept_answer("options", depends, _SOLVED, solved)


def _described(task: _Task) -> list[object]:
    """Return all values of a task, in a form for the key of the user's cache."""
    turns = [task.tried_deg, task.holes_deg, task.tested_deg, task.tested]
    return [dict(task.values), task.edits, task.systems, *turns, task.test_start]


def _changed_sizes(drive: Drive, edited: Drive) -> dict[str, float]:
    """Return the sizes of deviations that an edit changes, with their edited values, by path."""
    sizes = {path: edited.number(path) for path in deviation_sizes()}
    return {path: size for path, size in sizes.items() if size != drive.number(path)}


def _undecided(samples: OptionSamples, effects: Mapping[str, Effect]) -> dict[int, list[str]]:
    """Return the edits that may be among the best and are to be solved on unsettled samples, by row of the sample."""
    limit = samples.room_arcsec
    if samples.all_sets is None:  # a single sample is already solved
        return {}
    stated, weights = samples.all_sets
    contenders = [name for name in effects if not name.startswith("accuracy:")]
    if limit is not None:
        present = float(np.average(stated <= limit, weights=weights))
        bounds = {name: effects[name].bounds(limit) for name in contenders}
        surest = sorted((low for low, _ in bounds.values()), reverse=True)
        of_best = surest[_BEST_EDITS - 1] if len(surest) >= _BEST_EDITS else 0.0
        least = max(of_best, present + LEAST_STEP_GAIN)
        contenders = [name for name in contenders if bounds[name][1] >= least]
    undecided = dict[int, list[str]]()
    for name in contenders:
        for row in np.flatnonzero(effects[name].unsettled(limit)[: len(samples.rows)]).tolist():
            undecided.setdefault(row, []).append(name)
    return undecided


def _effect(
    samples: OptionSamples,
    name: str,
    solved: Mapping[int, _Solved],
    evidence: Evidence | None,
) -> Effect | None:
    """Return the effect of an edit on all samples.

    The result is None if the edit gives an invalid drive for a solved sample, or if too few samples agree with the
    reference data after the edit.

    samples: the samples.
    name: name of the edit.
    solved: results of the solved samples by row.
    evidence: the catalogue accuracy; None without one, or if F'_ior was measured.
    """
    grade = name.partition(":")[2] if name.startswith("accuracy:") else ""
    source = "" if grade else name
    answers = {row: answer for row, answer in solved.items() if source in answer.F_ior}
    stated, stated_weights = samples.all_sets or (np.array([solved[0].F_ior[""]], dtype=float), samples.weights)
    factor = _factor(len(stated), answers, source)
    if factor is None:
        return None
    every_donor = _donors(stated, _levels(samples, name), factor)
    count = len(samples.rows)
    is_solved = ~np.isnan(factor)
    if grade:
        is_solved[:count] |= samples.tested_arcsec is not None
    likelihood = _likelihood(samples, name, answers, every_donor[:count], evidence)
    # a further set uses the likelihood of its donors
    likelihood = np.vstack([likelihood, likelihood[every_donor[count:], 0]])
    weights = stated_weights[:, None] / every_donor.shape[1] * likelihood
    effective = effective_number(weights[:count].sum(axis=1))
    if samples.samples and effective < min(_FEWEST_EFFECTIVE, effective_number(samples.weights)):
        return None
    return Effect(stated[:, None] * factor[every_donor], weights, is_solved)


def _likelihood(
    samples: OptionSamples,
    name: str,
    answers: Mapping[int, _Solved],
    donors: NDArray[np.int64],
    evidence: Evidence | None,
) -> Array:
    """Return the ratio of the reference data's likelihood with an edit to that without it, shape (rows, donors)."""
    if name.startswith("accuracy:"):
        return _grade_likelihood(samples, float(name.partition(":")[2]), answers, donors, evidence)
    if evidence:
        return _likelihood_ratio(samples, name, answers, donors, evidence)
    return np.ones(donors.shape)


def _factor(
    rows: int,
    answers: Mapping[int, _Solved],
    name: str,
) -> Array | None:
    """Return the ratio of F'_ior with an edit to that without it, shape (rows,), which is NaN for unsolved samples.

    The result is None if the edit gives an invalid drive for a sample, or if F'_ior without it is 0.
    """
    factor = np.full(rows, np.nan)
    for row, answer in answers.items():
        edited = answer.F_ior[name]
        unedited = answer.F_ior[""]
        if edited is None or not unedited:
            return None
        factor[row] = edited / unedited
    return factor


def _likelihood_ratio(
    samples: OptionSamples,
    name: str,
    answers: Mapping[int, _Solved],
    donors: NDArray[np.int64],
    evidence: Evidence,
) -> Array:
    """Return the ratio of the likelihood of the accuracy with an edit to that without it, shape (rows, donors)."""
    tested = samples.tested_arcsec
    if tested is None:
        return np.ones(donors.shape)
    tested_with = tested[:, None] * _tested_factor(tested, answers, name)[donors]
    before = evidence.log_likelihood(tested)
    return np.asarray(np.exp(evidence.log_likelihood(tested_with) - before[:, None]))


def _grade_likelihood(
    samples: OptionSamples,
    grade_arcsec: float,
    answers: Mapping[int, _Solved],
    donors: NDArray[np.int64],
    evidence: Evidence | None,
) -> Array:
    """Return the ratio of the likelihood of a better accuracy to that of the present one, shape (rows, donors).

    samples: the samples, with their readings in the accuracy test if the catalogue states an accuracy.
    grade_arcsec: the better accuracy [arcsec].
    answers: results of the solved samples by row.
    donors: donors of each sample, shape (rows, donors).
    evidence: the present accuracy; None without one.
    """
    grade = accuracy_evidence(grade_arcsec, samples.prior.drive.catalogue.accuracy_test)
    stated = samples.stated_arcsec
    assert stated is not None
    tested = samples.tested_arcsec
    if tested is None:
        return np.asarray(np.exp(grade.log_likelihood(stated[:, None] * _tested_factor(stated, answers, "")[donors])))
    log = grade.log_likelihood(tested)
    if evidence:
        log = log - evidence.log_likelihood(tested)
    return np.repeat(
        np.exp(log)[:, None],
        donors.shape[1],
        axis=1,
    )


def _tested_factor(
    over_arcsec: Array,
    answers: Mapping[int, _Solved],
    name: str,
) -> Array:
    """Return the ratio of readings in the accuracy test with an edit to other values, shape (rows,).

    The ratio is NaN for unsolved samples.

    over_arcsec: the values by which readings are divided [arcsec], shape (rows,).
    answers: results of the solved samples by row.
    name: name of the edit.
    """
    factor = np.full(len(over_arcsec), np.nan)
    for row, answer in answers.items():
        tested = answer.tested.get(name)
        if tested is not None:
            factor[row] = tested / over_arcsec[row]
    return factor


def _levels(samples: OptionSamples, name: str) -> Array:
    """Return the quantile levels of the field on which the effect of an edit depends, shape (sets x rows,).

    The effect of another coupling depends on the present support of the wave generator: it is larger for a stiff one.
    The levels of other edits are 0.

    name: name of the edit.
    """
    rows = len(samples.rows)
    levels = samples.support_levels if name.startswith("coupling:") else np.zeros(rows)
    if samples.all_sets is None:
        return levels
    # the sets of a sample have the same support
    F_ior, _ = samples.all_sets
    return np.tile(levels, len(F_ior) // rows)


def _donors(
    F_ior_arcsec: Array,
    levels: Array,
    factor: Array,
) -> NDArray[np.int64]:
    """Return the indices of the donors of each sample, shape (rows, donors).

    A solved sample is its own and only donor.

    F_ior_arcsec: F'_ior of the samples [arcsec], shape (rows,).
    levels: quantile levels of a field on which the effect also depends, shape (rows,); equal levels have no effect.
    factor: ratio of F'_ior with an edit to that without it, shape (rows,), NaN for unsolved samples.
    """
    places = np.flatnonzero(~np.isnan(factor))
    log_F_ior = np.log(F_ior_arcsec)
    distance = np.abs(np.subtract.outer(log_F_ior, log_F_ior[places]))
    distance += np.abs(np.subtract.outer(levels, levels[places]))
    donors = places[np.argsort(distance, axis=1, kind="stable")[:, :_DONORS]]
    donors[places] = places[:, None]
    return donors


def _is_idle(edit: Edit, answers: Sequence[_Solved]) -> bool:
    """Return whether an edit is a tighter tolerance that reduces F'_ior of no solved sample noticeably."""
    if edit.kind != "tolerance":
        return False
    pairs = [(answer.F_ior[""], answer.F_ior.get(edit.name)) for answer in answers]
    reductions = [1 - edited / unedited for unedited, edited in pairs if unedited and edited is not None]
    return not reductions or max(reductions) < _NO_EFFECT


# --- solution of one sample


def _solve_one(
    drive: Drive,
    torques: tuple[float, ...],
    torque: int,
    is_drawn: bool,
    task: _Task,
) -> _Solved:
    """Return the results of the task of one sample.

    drive: drive without sampled values.
    torques: all torques of the drive [N*m].
    torque: index of the torque of the edits.
    is_drawn: whether the drive is a sample, for which coarser grids are sufficient.
    task: quantities to solve.
    """
    sample = drive.with_values(task.values)
    M_g = torques[torque]
    test_load = ACCURACY_LOAD * drive.rated_torque
    loads = [M_g, *(torques if task.holes_deg else ()), *((test_load,) if task.tested else ())]
    maps = {error_map.M_g: error_map for error_map in error_maps(sample, [*dict.fromkeys(loads)])}
    F_ior, proof = _as_mounted(maps[M_g], sample, task, is_drawn)
    tested, of_test = _tested(maps, test_load, sample, task, is_drawn)
    for name, changed in task.systems.items():
        F_ior[name] = None
        with suppress(HdassistError):
            edited = sample.with_values(changed)
            F_ior[name], tested[name], of_system = _solve_system(edited, M_g, task, is_drawn, name in task.tested)
            proof += of_system
    in_holes, of_holes = _in_holes([maps[load] for load in torques if load in maps], sample, task.holes_deg, is_drawn)
    return _Solved(F_ior, tested, in_holes, proof=proof + of_test + of_holes)


def _as_mounted(
    error_map: ErrorMap,
    drive: Drive,
    task: _Task,
    is_drawn: bool,
) -> tuple[dict[str, float | None], Certificate]:
    """Return F'_ior in the present position for edits of the same contact system [arcsec], and the certificate.

    If some holes are tried, the smallest F'_ior in them is added with the name BEST_OF_HOLES.
    """
    turned = [turned_directions(drive, turn) for turn in task.tried_deg]
    values, proof = searched(
        error_map,
        drive,
        [{}, *task.edits.values(), *turned],
        is_drawn=is_drawn,
    )
    F_ior: dict[str, float | None] = dict(
        zip(
            ("", *task.edits),
            values,
            strict=False,
        )
    )
    if turned:
        F_ior[BEST_OF_HOLES] = min(values[-len(turned) :])
    return F_ior, proof


def _tested(
    maps: Mapping[float, ErrorMap],
    load: float,
    drive: Drive,
    task: _Task,
    is_drawn: bool,
) -> tuple[dict[str, float | None], Certificate]:
    """Return the readings in the accuracy test for edits of the same contact system [arcsec], and the certificate."""
    names = [name for name in task.tested if name not in task.systems]
    if not names:
        return {}, EMPTY
    direction = turned_directions(drive, task.tested_deg)
    changes = [direction | dict(task.edits.get(name, {})) for name in names]
    F_ior, proof = _as_tested(maps[load], drive, changes, task.test_start, is_drawn)
    return dict(zip(names, F_ior, strict=True)), proof


def _solve_system(
    drive: Drive,
    M_g: float,
    task: _Task,
    is_drawn: bool,
    is_tested: bool,
) -> tuple[float, float | None, Certificate]:
    """Return F'_ior of an edited drive with its own contact system, its test reading [arcsec], and the certificate.

    The reading is None if the accuracy does not apply.

    drive: the edited drive.
    M_g: torque of F'_ior [N*m].

    task: task with the rotation and first position of the accuracy test.
    is_drawn: whether the drive is a sample, for which coarser grids are sufficient.
    is_tested: whether the accuracy applies to this drive.

    Raises UntrustedError if a result cannot be trusted.
    """
    if not is_tested:
        [error_map] = error_maps(drive, [M_g])
        F_ior, proof = searched(
            error_map,
            drive,
            [{}],
            is_drawn=is_drawn,
        )
        return F_ior[0], None, proof
    load = ACCURACY_LOAD * drive.rated_torque
    maps = {error_map.M_g: error_map for error_map in error_maps(drive, [*dict.fromkeys((M_g, load))])}
    F_ior, proof = searched(
        maps[M_g],
        drive,
        [{}],
        is_drawn=is_drawn,
    )
    direction = turned_directions(drive, 0.0 if no_hole_better(drive) else task.tested_deg)
    tested, of_test = _as_tested(maps[load], drive, [direction], task.test_start, is_drawn)
    return F_ior[0], tested[0], proof + of_test


def _as_tested(
    error_map: ErrorMap,
    drive: Drive,
    changes: Sequence[Mapping[str, float]],
    start: float,
    is_drawn: bool,
) -> tuple[list[float], Certificate]:
    """Return the manufacturer's readings of a drive with each of several changes [arcsec], and the certificate.

    All changes are tested from the same first position, because they are compared with each other.

    changes: changed values by path.
    start: first position, as a share of the full mesh cycle.
    """
    grids = DRAWN_GRIDS if is_drawn else FINE_GRIDS
    positions = tested_positions(drive.catalogue.accuracy_test)
    starts = np.full(len(changes), start)
    readings, proof = ranges_as_tested(error_map, _changed(drive, changes), positions, starts, grids)
    return readings.tolist(), proof


def _in_holes(
    maps: Sequence[ErrorMap],
    drive: Drive,
    holes_deg: Sequence[float],
    is_drawn: bool,
) -> tuple[tuple[tuple[float, ...], ...], Certificate]:
    """Return F'_ior of a drive in several holes [arcsec], shape (torques, holes), and the certificate.

    The result is empty without holes.
    """
    if not holes_deg:
        return (), EMPTY
    changes = [turned_directions(drive, turn) for turn in holes_deg]
    answers = [searched(error_map, drive, changes, is_drawn=is_drawn) for error_map in maps]
    return tuple(tuple(F_ior) for F_ior, _ in answers), sum((proof for _, proof in answers), EMPTY)


def turned_directions(drive: Drive, turn_deg: float) -> dict[str, float]:
    """Return the directions of the deviations that turn with the fixed wheel, after it is turned, by path [deg].

    The result is empty if the rotation is a whole number of revolutions.
    """
    return {path: drive.number(path) + turn_deg for path in carried(drive)} if turn_deg % 360 else {}


def searched(
    error_map: ErrorMap,
    drive: Drive,
    changes: Sequence[Mapping[str, float]],
    *,
    is_drawn: bool,
) -> tuple[list[float], Certificate]:
    """Return F'_ior of a drive with each of several changes of its deviations [arcsec], and the certificate."""
    extremes = many_extremes(error_map, _changed(drive, changes), DRAWN_GRIDS if is_drawn else FINE_GRIDS)
    return extremes.F_ior_arcsec.tolist(), extremes.certificate


def _changed(drive: Drive, changes: Sequence[Mapping[str, float]]) -> Batch:
    """Return a batch of a drive with each of several changes of its deviations, by path."""
    paths = {path for change in changes for path in change} or {"tolerances.F_i1"}
    columns = {path: np.array([change.get(path, drive.number(path)) for change in changes]) for path in sorted(paths)}
    return Batch(drive, columns)
