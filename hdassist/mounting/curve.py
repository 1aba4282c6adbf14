"""F'_ior over the positions of the fixed wheel, computed: searches, full cycles, processes.

Source: Lyuminarsky et al. 2019, Fig. 3, doi 10.18698/0536-1044-2019-11-3-8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hdassist.error.cycle import KinematicError, cross_check_of, kinematic_error
from hdassist.error.error_map import Batch, error_maps, searchable
from hdassist.errors import UsageError
from hdassist.model.deviations import ToothDeviations
from hdassist.model.geometry import Array
from hdassist.model.wheels import MeasuredTeeth
from hdassist.mounting.positions import MountingCurve, phase_deg, rotated
from hdassist.preset.fields import Drive
from hdassist.run.processes import apart
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.throughcvxpy import CrossCheck

SAMPLED_STATES = 1  # random states solved again at each position, besides those of the extremes
SEARCH_TOLERANCE = 0.01  # arcsec that a search may miss where every state is solved
POSITIONS_A_TASK = 3  # positions that one task searches
HOLES = 24  # positions of which every state is solved


def is_searched(drive: Drive, positions: int, *, drawn: bool, measured: MeasuredTeeth | None) -> bool:
    """Whether extremes at so many positions are searched: of few every state is solved, unless samples are drawn too.

    The error of measured teeth is not continuous, and so cannot be searched.
    """
    return (drawn or positions > HOLES) and not measured and searchable(drive)


def mounting_curve(
    drive: Drive,
    torques: Sequence[float],
    rotations_deg: Sequence[float],
    *,
    measured: MeasuredTeeth | None = None,
    drawn: bool = False,
    run: Run = Run(),
) -> MountingCurve:
    """F'_ior over the full cycle at each torque [N*m] and each rotation [deg] of the fixed wheel.

    Of up to HOLES positions every state is solved. Of more, or where samples are drawn too, extremes are proposed by a
    grid of states and proven; where the wheel stands and at the recommended position every state is solved then, and
    should more than SEARCH_TOLERANCE have been missed there, everywhere.

    Arguments: rotations_deg, 0 first, which is where the wheel stands; measured, wheels in place of first harmonics;
    drawn, whether samples of uncertain inputs are drawn too. Raises UsageError where the present position is not the
    first, UntrustedError where an answer cannot be trusted.
    """
    if not len(rotations_deg) or rotations_deg[0] != 0:
        raise UsageError("the first rotation must be 0, the present position")
    there = [rotated(drive, rotation) for rotation in rotations_deg]
    wheels = [measured and measured.rotated(each, r) for each, r in zip(there, rotations_deg, strict=True)]
    every = np.ones((len(torques), len(rotations_deg)), dtype=bool)
    allowed = None if drive.mounting.allowed == "all" else drive.mounting.allowed
    curve = MountingCurve(
        tuple(torques), np.array(rotations_deg, dtype=float), np.array(list(map(phase_deg, there, wheels))),
        np.empty(every.shape), EMPTY, (), every, drive.mounting.holes, allowed,
    )  # fmt: skip
    if not is_searched(drive, len(rotations_deg), drawn=drawn, measured=measured):
        return _solved(curve, every, there, wheels, run)
    groups = [rotations_deg[k : k + POSITIONS_A_TASK] for k in range(0, len(rotations_deg), POSITIONS_A_TASK)]
    found, proof = [], EMPTY
    for values, states in run.map(partial(_searched, drive, curve.torques), groups):
        found.append(values)
        proof += states
        run.solved(states.states)
    curve = replace(curve, F_ior_arcsec=np.hstack(found), every_state=~every, certificate=proof)
    decisive = np.isin(rotations_deg, [0, curve.recommended.rotation_deg]) & every
    proven = _solved(curve, decisive, there, wheels, run)
    missed = np.abs(proven.F_ior_arcsec - curve.F_ior_arcsec).max() > SEARCH_TOLERANCE
    return _solved(proven, ~decisive, there, wheels, run) if missed else proven


def _solved(
    curve: MountingCurve,
    places: NDArray[np.bool_],
    there: Sequence[Drive],
    wheels: Sequence[MeasuredTeeth | None],
    run: Run,
) -> MountingCurve:
    """A curve with every state solved at some places, shape (torques, rotations), and some of them solved again.

    Arguments: there, drives with the wheel turned, and their measured wheels.
    """
    rows, columns = (each.tolist() for each in np.nonzero(places))
    drives = [wheel.in_drive(there[r]) if (wheel := wheels[r]) else (there[r], None) for r in columns]
    values, proof, errors = curve.F_ior_arcsec.copy(), curve.certificate, list[KinematicError]()
    tasks = [(*drive, curve.torques[t], run.of_task) for drive, t in zip(drives, rows, strict=True)]
    for place, (F_ior, error) in zip(np.argwhere(places), run.map(_error, *zip(*tasks, strict=True)), strict=True):
        values[tuple(place)] = F_ior
        errors.append(error)
        proof += error.certificate
        run.solved(error.certificate.states)
    checks = list(curve.cross_checks)
    if run.cross_check:
        # in one process: the import of cvxpy takes each of them most of a second, and much memory
        solved = [(*drive, error) for drive, error in zip(drives, errors, strict=True)]
        checks += next(run.map(apart, [_again], [solved], [run.of_task]))
    every, again = curve.every_state | places, tuple(checks)
    return replace(curve, F_ior_arcsec=values, every_state=every, certificate=proof, cross_checks=again)


def _searched(drive: Drive, torques: Sequence[float], rotations: Sequence[float]) -> tuple[Array, Certificate]:
    """F'_ior [arcsec] of extremes that were proposed and proven, shape (torques, rotations)."""
    found = [each.many_extremes(Batch.turned(drive, rotations)) for each in error_maps(drive, torques)]
    return np.array([each.F_ior_arcsec for each in found]), sum((each.certificate for each in found), EMPTY)


def _error(drive: Drive, teeth: ToothDeviations | None, M_g: float, run: Run) -> tuple[float, KinematicError]:
    """F'_ior [arcsec], and the error at the states that another solver is to solve again, with the proof of all."""
    error = kinematic_error(drive, M_g, teeth=teeth, run=replace(run, progress=None, cross_check=None))
    return error.F_ior_arcsec, error.sampled(SAMPLED_STATES, run.seed)


def _again(solved: Sequence[tuple[Drive, ToothDeviations | None, KinematicError]], run: Run) -> list[CrossCheck]:
    return [cross_check_of(drive, error, teeth, run=run) for drive, teeth, error in solved]
