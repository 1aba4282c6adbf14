"""What one state costs on one thread, certificate included: the engine, DAQP warm, and solvers called through cvxpy."""

from __future__ import annotations

import statistics
import time

import numpy as np

from benchmarks.machine import seconds
from hdassist import kinematic_error, load_preset
from hdassist.model.contacts import contact_system
from hdassist.model.deviations import gaps
from hdassist.model.kinematics import Kinematics, neighbours_together, pitch_locked_states
from hdassist.solve.activeset import ActiveSet
from hdassist.solve.answers import CHUNK, solve_states
from hdassist.solve.certificate import residuals
from hdassist.solve.compiled import compile_programme
from hdassist.solve.engine import Engine
from hdassist.solve.formulation import Formulation, formulate
from hdassist.solve.throughcvxpy import solve_through_cvxpy

SOLVERS = {"DAQP": 20, "HIGHS": 20, "CLARABEL": 20, "OSQP": 6}  # states that each one solves
N_MM = 1e3  # N*mm in a N*m


def measure(quick: bool) -> list[dict]:
    """For each torque of vzp160: microseconds a state, and seconds of the full cycle as an analysis asks for it.

    All in processor time. Engine, DAQP and the certificate take turns, each over the full cycle; a solver through
    cvxpy solves random states one after another, the programme compiled before and its parameters changed.
    """
    drive = load_preset("vzp160")
    system, kinematics = contact_system(drive), Kinematics.of(drive)
    cycle = pitch_locked_states(kinematics)
    delta_p = gaps(drive, system, cycle.take(neighbours_together(kinematics, cycle)))
    formulation = formulate(system)
    sample = delta_p[np.random.default_rng(0).choice(len(delta_p), max(SOLVERS.values()), replace=False)]
    found = []
    for M_g in drive.operation.M_g:
        costs = _over_the_cycle(formulation, M_g * N_MM, delta_p, 1 if quick else 5)
        solvers = {} if quick else SOLVERS
        through = {
            name: _through_cvxpy(formulation, M_g * N_MM, sample[:count], name) for name, count in solvers.items()
        }
        rounds = 1 if quick else 5
        full = seconds(lambda M_g=M_g: kinematic_error(drive, M_g, cross_check=None), rounds)
        found.append({"M_g": M_g, "states": len(delta_p), **costs, "full_cycle_s": full, "cvxpy_us": through})
    return found


def _over_the_cycle(formulation: Formulation, torque: float, delta_p: np.ndarray, rounds: int) -> dict[str, float]:
    system, data = formulation.system, compile_programme(formulation)
    everywhere = np.ones(delta_p.shape[1], dtype=bool)
    chunks = [delta_p[first : first + CHUNK] for first in range(0, len(delta_p), CHUNK)]
    times = []
    for _ in range(rounds):
        engine = Engine(formulation, torque)
        marks = [time.process_time()]
        solve_states(system, engine, torque, delta_p, str)
        marks.append(time.process_time())
        daqp = ActiveSet(formulation, data, torque, everywhere)
        answers = [daqp.solve(chunk) for chunk in chunks]
        marks.append(time.process_time())
        for chunk, (forces, free, _) in zip(chunks, answers, strict=True):
            residuals(system, chunk, torque, forces, free)
        marks.append(time.process_time())
        times.append(np.diff(marks))
    engine_us, daqp_us, certificate_us = (float(t) for t in np.median(times, axis=0) / len(delta_p) * 1e6)
    # DAQP alone is handed out without the certificate: that is added, so that both rows have it
    return {"engine_us": engine_us, "daqp_us": daqp_us + certificate_us, "certificate_us": certificate_us}


def _through_cvxpy(formulation: Formulation, torque: float, sample: np.ndarray, solver: str) -> float:
    solve_through_cvxpy(formulation, sample[0], torque, solver)
    times = []
    for delta_p in sample:
        begun = time.process_time()
        solve_through_cvxpy(formulation, delta_p, torque, solver)
        times.append(time.process_time() - begun)
    return statistics.median(times) * 1e6
