"""Whether the advised position stays the best one over the plausible range of what is assumed of a drive."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from hdassist.error.rests_on import MOST, reached
from hdassist.error.search import searchable
from hdassist.model.assumed import Assumption, assumptions
from hdassist.model.deviations import deviation_scalars
from hdassist.model.geometry import Array
from hdassist.mounting.positions import MountingCurve, Position, merit, rotated
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Progress
from hdassist.solve.loadcase import LoadCase

TURNS = 14  # positions of each wheel: enough to tell holes apart, not for their F'_ior


@dataclass(frozen=True)
class End:
    """What becomes of an advice at an end of the range of an assumption.

    value: as far on the way there as the drive can be computed, in the field's unit; best_deg: the position that is
    best there; loss: how far the advised one lies above it, as a share; good: after trials, the probability that the
    advised one is good. None where hardly anything explains the trials.
    """

    value: float
    best_deg: float | None
    loss: float | None
    good: float | None = None


@dataclass(frozen=True)
class Stays:
    """An assumption, and what becomes of an advice at both ends of its range."""

    assumption: Assumption
    ends: tuple[End, End]


def stays_best(
    drive: Drive,
    curve: MountingCurve,
    chosen: Position,
    *,
    most: int = MOST,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> tuple[Stays, ...]:
    """The assumptions over whose range a chosen position of a curve loses most, the greatest loss first.

    It takes a few states of the cycle. Empty where nothing is assumed, or the cycle cannot be searched (rolling balls).
    Executor and progress as in mounting_curve. Raises UntrustedError where an answer cannot be trusted.
    """
    if not searchable(drive) or not (assumed := assumptions(drive)):
        return ()
    usable = tuple(float(rotation) for rotation in curve.rotation_deg[curve.usable])
    rotations = (0.0, *usable)
    tasks = [(drive, a.path, end, curve.torques, rotations) for a in assumed for end in (a.low, a.high)]
    found = []
    for value, (F_ior, states) in (executor.map if executor else map)(_curve_at, tasks):
        merits = merit(F_ior[:, 1:], F_ior[:, 0], curve.weights)
        loss = float(merits[usable.index(chosen.rotation_deg)] / merits.min() - 1)
        found.append((loss, End(value, usable[int(np.argmin(merits))], loss)))
        if progress:
            progress(states)
    rows = [
        (max(low, high), Stays(a, (down, up)))
        for a, (low, down), (high, up) in zip(assumed, found[::2], found[1::2], strict=True)
    ]
    return tuple(held for _, held in sorted(rows, key=lambda row: -row[0])[:most])


_Task = tuple[Drive, str, float, Sequence[float], Sequence[float]]


def _curve_at(task: _Task) -> tuple[float, tuple[Array, int]]:
    """Value of a field as far on the way to an end as the drive can be computed, and the curve there, roughly."""
    drive, path, end, torques, rotations = task
    return reached(drive, path, end, lambda moved: _few_states(moved, torques, rotations))


def _few_states(drive: Drive, torques: Sequence[float], rotations: Sequence[float]) -> tuple[Array, int]:
    """Range of the error in a few states [arcsec], shape (torques, rotations), and how many were solved."""
    angles = 2 * np.pi * np.arange(TURNS) / TURNS
    alpha_g, alpha_b = (angle.ravel() for angle in np.meshgrid(angles, angles, indexing="ij"))
    rows = []
    for M_g in torques:
        case, row = LoadCase.of(drive, M_g), []
        for rotation in rotations:
            scalars = deviation_scalars(rotated(drive, rotation), alpha_g, alpha_b)
            answers = case.solve(case.system.gaps(scalars), lambda k: f"state {k}")
            row.append(float(np.ptp(answers.rotation_arcsec)))
        rows.append(row)
    return np.array(rows), len(alpha_g) * len(rotations) * len(torques)
