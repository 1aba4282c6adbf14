"""Whether the advised position stays the best one over the plausible range of what is assumed of a drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from hdassist.error.rests_on import MOST, reached
from hdassist.error.search import searchable
from hdassist.model.assumed import Assumption, assumptions
from hdassist.model.contacts import contact_system
from hdassist.model.deviations import deviation_scalars
from hdassist.model.geometry import Array
from hdassist.mounting.positions import MountingCurve, Position, merit, rotated
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Progress
from hdassist.solve.formulation import formulate
from hdassist.solve.loadcase import LoadCase

Told = tuple[float | None, float | None, float | None]  # what End has beside the value
TURNS = 14  # positions of each wheel: enough to tell holes apart, not for their F'_ior
FEW, FEW_ROTATIONS = 7, tuple(72.0 * k for k in range(5))  # and of the fixed one on its seat: to read changes between


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

    What each changes of the error, read between few states, tells which these are; what they do is told by more. Empty
    where nothing is assumed, or the cycle cannot be searched (rolling balls). Executor and progress as in
    mounting_curve. Raises UntrustedError where an answer cannot be trusted.
    """
    if not searchable(drive) or not (assumed := assumptions(drive)):
        return ()
    usable = tuple(float(rotation) for rotation in curve.rotation_deg[curve.usable])
    seat, few = _Seat(chosen.rotation_deg, usable, curve.torques, curve.weights), partial(_errors, turns=FEW)
    known = _errors(drive, curve.torques, (0.0, *usable)), few(drive, curve.torques, FEW_ROTATIONS)
    end = partial(over_ranges, drive, change=lambda end: end.loss or 0.0, executor=executor)
    done = partial(progress, TURNS**2 * (1 + len(usable)) * len(curve.torques)) if progress else None
    heaviest = end(assumed, partial(_read, seat, *known))[:most]
    return end([each.assumption for each in heaviest], partial(_told, seat), done=done)


def _reached(task: tuple[Drive, str, float, Callable[[Drive], Told]]) -> tuple[float, Told]:
    return reached(*task)


@dataclass(frozen=True)
class _Seat:
    """The chosen and the usable positions [deg], and torques [N*m] with their weights."""

    chosen_deg: float
    usable_deg: tuple[float, ...]
    torques: tuple[float, ...]
    weights: tuple[float, ...] | None

    def told(self, errors: Array) -> Told:
        """What becomes of the chosen position, by the error [arcsec], shape (torques, turns, turns, rotations)."""
        F_ior = np.ptp(errors, axis=(1, 2))
        merits = merit(F_ior[:, 1:], F_ior[:, 0], self.weights)
        at = self.usable_deg.index(self.chosen_deg)
        return self.usable_deg[int(np.argmin(merits))], float(merits[at] / merits.min() - 1), None


def _told(seat: _Seat, drive: Drive) -> Told:
    """What becomes of a chosen position in another drive."""
    return seat.told(_errors(drive, seat.torques, (0.0, *seat.usable_deg)))


def _read(seat: _Seat, errors: Array, few: Array, drive: Drive) -> Told:
    """The same, about, by the errors of the known drive and what few states of the other one change of them."""
    values = np.fft.fftn(_errors(drive, seat.torques, FEW_ROTATIONS, FEW) - few, axes=(1, 2, 3))
    turns = 2 * np.pi * np.arange(TURNS) / TURNS
    for axis, angles in ((1, turns), (2, turns), (3, np.radians([0.0, *seat.usable_deg]))):
        count = values.shape[axis]
        waves = np.exp(1j * np.outer(angles, np.fft.fftfreq(count, 1 / count))) / count
        values = np.moveaxis(np.tensordot(waves, values, axes=(1, axis)), 0, axis)
    return seat.told(errors + values.real)


def _errors(drive: Drive, torques: Sequence[float], rotations: Sequence[float], turns: int = TURNS) -> Array:
    """Error [arcsec] in a few states, shape (torques, turns, turns, rotations)."""
    angles = 2 * np.pi * np.arange(turns) / turns
    alpha_g, alpha_b = (angle.ravel() for angle in np.meshgrid(angles, angles, indexing="ij"))
    formulation = formulate(contact_system(drive))
    scalars = [deviation_scalars(rotated(drive, rotation), alpha_g, alpha_b) for rotation in rotations]
    # all positions of a state one after the other, as they are alike
    gaps = np.stack([formulation.system.gaps(each) for each in scalars], axis=1).reshape(turns**2 * len(rotations), -1)
    found, case = [], None
    for M_g in torques:
        case = LoadCase(formulation, M_g, like=case)
        found.append(case.solve(gaps, lambda k: f"state {k}").rotation_arcsec)
    return np.reshape(found, (len(torques), turns, turns, len(rotations)))
