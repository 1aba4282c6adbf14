"""Whether the advised position stays the best one over the plausible range of what is assumed of a drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from hdassist.error.error_map import searchable
from hdassist.error.rests_on import MOST, reached
from hdassist.model.assumed import Assumption, assumptions
from hdassist.model.contacts import StateGaps, contact_system
from hdassist.model.deviations import deviation_scalars
from hdassist.model.geometry import Array
from hdassist.mounting.positions import MountingCurve, Position, merit, rotated
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Progress
from hdassist.solve.formulation import formulate
from hdassist.solve.loadcase import LoadCase

Told = tuple[float | None, float | None, float | None]  # what End has beside the value
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


def over_ranges(
    drive: Drive,
    assumed: Sequence[Assumption],
    look: Callable[[Drive], Told],
    change: Callable[[End], float],
    *,
    executor: Executor | None = None,
    done: Callable[[], None] | None = None,
) -> tuple[Stays, ...]:
    """Assumptions of a drive with what becomes of an advice at both ends of their ranges, the greatest change first.

    Arguments: look, what becomes of it in the drive as far on the way to such an end as it can be computed; change, how
    much that is; executor, to spread the work over; done, called after each end.
    """
    ends = []
    tasks = [(drive, a.path, end, look) for a in assumed for end in (a.low, a.high)]
    for value, told in (executor.map if executor else map)(_reached, tasks):
        ends.append(End(value, *told))
        if done:
            done()
    held = [Stays(a, both) for a, both in zip(assumed, zip(ends[::2], ends[1::2], strict=True), strict=True)]
    return tuple(sorted(held, key=lambda each: -max(map(change, each.ends))))


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
    look = partial(_told, chosen.rotation_deg, usable, curve.torques, curve.weights)
    states = TURNS**2 * (1 + len(usable)) * len(curve.torques)
    done = partial(progress, states) if progress else None
    return over_ranges(drive, assumed, look, lambda end: end.loss or 0.0, executor=executor, done=done)[:most]


def _reached(task: tuple[Drive, str, float, Callable[[Drive], Told]]) -> tuple[float, Told]:
    return reached(*task)


def _told(
    chosen_deg: float,
    usable_deg: Sequence[float],
    torques: Sequence[float],
    weights: Sequence[float] | None,
    drive: Drive,
) -> Told:
    """What becomes of a chosen position in another drive."""
    F_ior = _few_states(drive, torques, (0.0, *usable_deg))
    merits = merit(F_ior[:, 1:], F_ior[:, 0], weights)
    return usable_deg[int(np.argmin(merits))], float(merits[usable_deg.index(chosen_deg)] / merits.min() - 1), None


def _few_states(drive: Drive, torques: Sequence[float], rotations: Sequence[float]) -> Array:
    """Range of the error in a few states [arcsec], shape (torques, rotations)."""
    angles = 2 * np.pi * np.arange(TURNS) / TURNS
    alpha_g, alpha_b = (angle.ravel() for angle in np.meshgrid(angles, angles, indexing="ij"))
    formulation = formulate(contact_system(drive))
    scalars = [deviation_scalars(rotated(drive, rotation), alpha_g, alpha_b) for rotation in rotations]
    rows, case = [], None
    for M_g in torques:
        case = LoadCase(formulation, M_g, like=case)
        answers = [case.solve(StateGaps(each), lambda k: f"state {k}") for each in scalars]
        rows.append([float(np.ptp(each.rotation_arcsec)) for each in answers])
    return np.array(rows)
