"""Processor time of one state on one thread, sums and certificate included, for each engine and for cvxpy solvers."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import daqp
import numpy as np

from benchmarks.machine import seconds
from benchmarks.words import NUMPY, WARM_DAQP
from hdassist import Drive, load_preset
from hdassist.drive.error.error_map import Batch, ErrorMap
from hdassist.drive.error.extremes import many_extremes
from hdassist.drive.model.contacts import StateGaps, contact_system
from hdassist.drive.model.deviations import state_gaps
from hdassist.drive.model.geometry import Kinematics, neighbours_together, pitch_locked_states
from hdassist.drive.solve import walk
from hdassist.drive.solve.answers import N_MM, STATES_AT_A_TIME, Answers, StateSums, proven_answers, residuals
from hdassist.drive.solve.build import library_name
from hdassist.drive.solve.formulation import Formulation, formulate
from hdassist.drive.solve.loadcase import ALWAYS_ACTIVE, DAQP_SETTINGS, LoadCase, OneByOne, solve_through_cvxpy

SOLVERS = {"DAQP": 20, "HIGHS": 20, "CLARABEL": 20, "OSQP": 6}  # number of states solved by each solver


class Warm:
    """DAQP with a warm start from the previous state, with the sums and the certificate of the engines."""

    def __init__(self, formulation: Formulation, torque: float) -> None:
        self._formulation, self._torque = formulation, torque
        n, right = len(formulation.local), -formulation.load(torque)
        self._upper, self._lower = np.append(np.full(n, np.inf), right), np.append(np.zeros(n), right)
        self._sense = np.append(np.zeros(n), np.full(len(right), ALWAYS_ACTIVE)).astype(np.int32)
        self._A = np.ascontiguousarray(formulation.A[:, formulation.system.place])
        self._model: Any = None

    def sums(self, gaps: StateGaps) -> StateSums:
        """Solve states, as LoadCase.sums does."""
        delta_p = self._formulation.system.delta_p_of(gaps)
        forces, free = np.empty(delta_p.shape), np.empty((len(gaps), len(self._A)))
        for k, q in enumerate(self._formulation.gaps(delta_p)):
            if self._model:
                self._model.update(f=q)
            else:
                self._model = daqp.Model()
                self._model.settings = DAQP_SETTINGS
                self._model.setup(self._formulation.P, q, self._A, self._upper, self._lower, self._sense)
            x, _, _, info = self._model.solve()
            forces[k], free[k] = self._formulation.answer(x, info["lam"][len(x) :])
        return StateSums.of(self._formulation.system, delta_p, self._torque, forces, free)


def measure(quick: bool) -> list[dict[str, Any]]:
    """Return the processor time per state of vzp160 with whole flanks [us], over the cycle and in a search, by torque.

    The engines alternate. Each solves the full cycle, and the batches in which proposals of extremes are solved. A
    solver called through cvxpy solves random states of the cycle one after another; its program is formulated before.
    """
    drive = load_preset("vzp160", ["numerics.stations=1"])
    kinematics = Kinematics.of(drive)
    cycle = pitch_locked_states(kinematics)
    formulation = formulate(contact_system(drive))
    gaps = state_gaps(drive, formulation.system, cycle.take(neighbours_together(kinematics, cycle)))
    rounds, found = (1 if quick else 5), []
    for M_g in drive.operation.M_g:
        torque, orders = M_g * N_MM, {"cycle": [gaps], "search": searched(drive, M_g)}
        found.append({
            "M_g": M_g,
            "states": {name: sum(map(len, batches)) for name, batches in orders.items()},
            "us": {name: _engines(formulation, torque, batches, rounds) for name, batches in orders.items()},
            "certificate_us": _certificate(formulation, torque, gaps, rounds),
            "cvxpy_us": {} if quick else {name: _through_cvxpy(formulation, torque, gaps, name) for name in SOLVERS},
        })  # fmt: skip
    return found


def searched(drive: Drive, M_g: float) -> list[StateGaps]:
    """Return the batches of states, in order, that are solved to find the extremes of a drive by proposals."""
    batches: list[StateGaps] = []
    solve = LoadCase.solve

    def kept(case: LoadCase, gaps: StateGaps, *others: Any, **options: Any) -> Answers:
        batches.append(gaps)
        return solve(case, gaps, *others, **options)

    with patch.object(LoadCase, "solve", kept):
        many_extremes(ErrorMap(drive, M_g), Batch.of(drive))
    return batches


def chunks(solver: LoadCase | Warm, gaps: StateGaps) -> Iterator[StateSums]:
    """Yield the sums of states, solved in chunks of the size that a load case uses."""
    for first in range(0, len(gaps), STATES_AT_A_TIME):
        yield solver.sums(gaps[first : first + STATES_AT_A_TIME])


def walks() -> Iterator[tuple[str, object]]:
    """Yield the name and the library of the compiled walk for each instruction set of this machine."""
    best, _ = walk.walk_library()
    for level, words in sorted(walk.INSTRUCTIONS.items()):
        file = best and Path(best._name).parent / library_name(level)
        if file and file.exists() and level <= best.walk_level():
            yield f"compiled walk, {words}", walk._load(file)


def _engines(formulation: Formulation, torque: float, batches: list[StateGaps], rounds: int) -> dict[str, float]:
    makers: dict[str, Callable[[], Any]] = {}  # functions that make engines, by name
    for words, library in walks():
        makers[words] = partial(_with, library, formulation, torque, batches[0][:1])
    makers[NUMPY] = lambda: LoadCase(formulation, torque / N_MM, many=True, compiled=False)
    makers[WARM_DAQP] = lambda: Warm(formulation, torque)
    times: dict[str, list[float]] = {name: [] for name in makers}
    for _ in range(rounds):
        for name, made in makers.items():
            solver = made()
            begun = time.process_time()
            for gaps in batches:
                proven_answers(formulation.system, torque, chunks(solver, gaps), str)
            times[name].append(time.process_time() - begun)
    return {name: statistics.median(taken) / sum(map(len, batches)) * 1e6 for name, taken in times.items()}


def _with(library: object, formulation: Formulation, torque: float, first: StateGaps) -> LoadCase:
    """Return a load case with a library of the walk, which it selects when it solves its first state."""
    with patch.object(walk, "walk_library", lambda: (library, "")):
        engine = LoadCase(formulation, torque / N_MM, many=True)
        engine.sums(first)
    return engine


def _certificate(formulation: Formulation, torque: float, gaps: StateGaps, rounds: int) -> float:
    """Return the time that numpy needs for the residuals of a state [us]."""
    some = formulation.system.delta_p_of(gaps[:STATES_AT_A_TIME])
    forces, free, _ = OneByOne(formulation).solve(some, torque)
    return seconds(lambda: residuals(formulation.system, some, torque, forces, free), rounds) / len(some) * 1e6


def _through_cvxpy(formulation: Formulation, torque: float, gaps: StateGaps, solver: str) -> float:
    rows = np.random.default_rng(0).choice(len(gaps), 1 + SOLVERS[solver], replace=False)
    times = []
    for delta_p in formulation.system.delta_p_of(gaps[rows]):
        begun = time.process_time()
        solve_through_cvxpy(formulation, delta_p, torque, solver)
        times.append(time.process_time() - begun)
    return statistics.median(times[1:]) * 1e6  # the first time includes compilation
