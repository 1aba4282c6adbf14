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
from hdassist.solve.answers import EMPTY, Certificate, Progress
from hdassist.solve.loadcase import LoadCase

TURNS = 14  # positions of each wheel: enough to tell holes apart, not for their F'_ior


@dataclass(frozen=True)
class Stays:
    """Both ends of an assumption's range, as far as they can be computed, in the field's unit.

    best: the position that is best there; loss: how far the advised one lies above it, as a share; both from a few
    states of the cycle.
    """

    assumption: Assumption
    ends: tuple[float, float]
    best: tuple[Position, Position]
    loss: tuple[float, float]
    certificate: Certificate


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

    Empty where nothing is assumed, or the cycle cannot be searched (rolling balls). Executor and progress as in
    mounting_curve. Raises UntrustedError where an answer cannot be trusted.
    """
    if not searchable(drive) or not (assumed := assumptions(drive)):
        return ()
    places = [int(place) for place in np.flatnonzero(curve.usable)]
    rotations = (0.0, *(float(curve.rotation_deg[place]) for place in places))
    ends = [(drive, a.path, end, curve.torques, rotations) for a in assumed for end in (a.low, a.high)]
    found = []
    for value, (F_ior, proof) in (executor.map if executor else map)(_curve_at, ends):
        merits = merit(F_ior[:, 1:], F_ior[:, 0], curve.weights)
        best = int(np.argmin(merits))
        loss = float(merits[rotations[1:].index(chosen.rotation_deg)] / merits[best] - 1)
        found.append((value, curve.at(places[best]), loss, proof))
        if progress:
            progress(proof.states)
    pairs = zip(assumed, found[::2], found[1::2], strict=True)
    held = [
        Stays(a, (low[0], high[0]), (low[1], high[1]), (low[2], high[2]), low[3] + high[3]) for a, low, high in pairs
    ]
    return tuple(sorted(held, key=lambda each: -max(each.loss))[:most])


_End = tuple[Drive, str, float, Sequence[float], Sequence[float]]


def _curve_at(task: _End) -> tuple[float, tuple[Array, Certificate]]:
    """Value of a field as far on the way to an end as the drive can be computed, and the curve there, roughly."""
    drive, path, end, torques, rotations = task
    return reached(drive, path, end, lambda moved: _few_states(moved, torques, rotations))


def _few_states(drive: Drive, torques: Sequence[float], rotations: Sequence[float]) -> tuple[Array, Certificate]:
    """Range of the error in a few states [arcsec], shape (torques, rotations)."""
    angles = 2 * np.pi * np.arange(TURNS) / TURNS
    alpha_g, alpha_b = (angle.ravel() for angle in np.meshgrid(angles, angles, indexing="ij"))
    rows, proof = [], EMPTY
    for M_g in torques:
        case, row = LoadCase.of(drive, M_g), []
        for rotation in rotations:
            scalars = deviation_scalars(rotated(drive, rotation), alpha_g, alpha_b)
            answers = case.solve(case.system.gaps(scalars), lambda k: f"state {k}")
            row.append(float(np.ptp(answers.rotation_arcsec)))
            proof += answers.certificate
        rows.append(row)
    return np.array(rows), proof
