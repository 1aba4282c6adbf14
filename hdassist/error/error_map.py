"""The error over all tooth positions, at one torque: of a drive, or of many that differ in their deviations alone.

In state j each wheel stands j of its pitches on in the cam's frame, so the state is the point (j mod z_b, j mod z_g)
of a torus on which the error is continuous: neighbours there have nearly the same deviations, however far apart they
lie in the cycle. Of one drive every state is solved; of very many, few: extremes.py.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from hdassist.error.cycle import kinematic_error
from hdassist.errors import UsageError
from hdassist.model.contacts import contact_system
from hdassist.model.deviations import Waves, carried, scalars_of, waves_of
from hdassist.model.geometry import Array, Kinematics, States, pitch_locked_states
from hdassist.preset.fields import Drive
from hdassist.run.run import UNCHECKED
from hdassist.solve.answers import Certificate
from hdassist.solve.formulation import Formulation, formulate
from hdassist.solve.loadcase import LoadCase

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Batch:
    """Drives that differ in their deviations alone: a drive, and values of its fields by path, shape (drives,) each."""

    drive: Drive
    columns: Mapping[str, Array]

    @classmethod
    def of(cls, drive: Drive, count: int = 1) -> Batch:
        """A drive alone, or so many times."""
        return cls(drive, {"tolerances.F_i1": np.full(count, drive.number("tolerances.F_i1"))})

    @classmethod
    def turned(cls, drive: Drive, rotations_deg: Sequence[float] | Array) -> Batch:
        """A drive with its fixed wheel turned on its seat [deg], counter-clockwise seen from the cam side."""
        return cls(drive, {path: drive.number(path) + np.array(rotations_deg) for path in carried(drive)})

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def take(self, rows: Indices) -> Batch:
        """The drives in some rows."""
        return Batch(self.drive, {path: column[rows] for path, column in self.columns.items()})

    def scalars(self, row: Indices, alpha_g: Array, alpha_b: Array) -> Array:
        """Scalars [mm] of the drives in some rows, where their wheels stand so [rad]; shapes broadcast."""
        return scalars_of({key: wave[row] for key, wave in self._waves.items()}, alpha_g, alpha_b)

    def by_wheel(self, alpha_b: Array, alpha_g: Array) -> tuple[Array, Array]:
        """Parts of the scalars [mm] of states by the angle [rad] of each wheel, shape (drives, angles, scalars) both.

        What turns with neither wheel is part of the first.
        """
        row, parts = np.arange(len(self))[:, None], []
        for part, alpha in (("b", alpha_b), ("g", alpha_g)):
            own = {key: wave[row] * ((key[1] == "g") == (part == "g")) for key, wave in self._waves.items()}
            parts.append(scalars_of(own, alpha[None], alpha[None]))
        return parts[0], parts[1]

    @cached_property
    def _waves(self) -> Waves:
        columns, number = self.columns, self.drive.number
        waves = waves_of(lambda path: columns.get(path, number(path)), self.drive)
        return {key: np.broadcast_to(wave, len(self)) for key, wave in waves.items()}


@dataclass(frozen=True)
class Extremes:
    """F'_ior of drives [arcsec], and the states j of the greatest and of the least error, shape (drives,) each."""

    F_ior_arcsec: Array
    at_max: Indices
    at_min: Indices
    certificate: Certificate

    @property
    def first(self) -> float:
        """F'_ior of the first drive [arcsec]."""
        return float(self.F_ior_arcsec[0])


def searchable(drive: Drive) -> bool:
    """Whether the error is continuous on the torus: rolling balls do not come back with the wheels."""
    return drive.bearing.ball_motion == "locked"


class ErrorMap:
    """The error of drives that share a contact system, at one torque, over all tooth positions.

    Arguments: drive, all that they have in common; M_g, the torque [N*m]; formulation of the contact system, where it
    is there already; like, a load case to start from. Raises UsageError for a drive with rolling balls.
    """

    def __init__(
        self, drive: Drive, M_g: float, formulation: Formulation | None = None, like: LoadCase | None = None
    ) -> None:
        if not searchable(drive):
            raise UsageError(
                "this needs locked balls: of rolling ones every state has to be solved",
                "--set bearing.ball_motion=locked",
            )
        self.drive, self.M_g = drive, M_g
        # never solves a state: every answer starts from it alike and so gives the same digits
        self.fresh = LoadCase(formulation or formulate(contact_system(drive)), M_g, like=like)
        kinematics = Kinematics.of(drive)
        self.sign = kinematics.error_sign
        self.states, self.board, self.finest = _lattice(kinematics)

    def load_case(self) -> LoadCase:
        """The load case of the map's states, to solve some of them, in batches however small."""
        return LoadCase(self.fresh.formulation, self.M_g, like=self.fresh, many=True)

    def extremes(self, drive: Drive | None = None) -> Extremes:
        """Extremes of a drive, by default the map's own, from every state of its cycle.

        Raises UntrustedError where an answer cannot be trusted.
        """
        return every_state(drive or self.drive, self.M_g)

    def to_lattice(self, point: Array) -> Indices:
        """The nearest points at which there is a state, shape (..., 2)."""
        near = np.rint(point).astype(np.int64)
        near[..., 1] += (self.finest - 1) * (near.sum(axis=-1) % 2)
        return np.asarray(near)

    def state(self, point: Indices) -> Indices:
        """States j at points, shape (..., 2)."""
        return np.asarray(self.board[tuple(np.moveaxis(point % self.board.shape, -1, 0))])


def every_state(drive: Drive, M_g: float) -> Extremes:
    """Extremes of a drive at a torque [N*m] from every state of its cycle.

    Raises UntrustedError where an answer cannot be trusted.
    """
    error = kinematic_error(drive, M_g, run=UNCHECKED)
    F_ior, at_max, at_min = (np.array([each]) for each in (error.F_ior_arcsec, error.at_max, error.at_min))
    return Extremes(F_ior, at_max, at_min, error.certificate)


def error_maps(drive: Drive, torques: Sequence[float], formulation: Formulation | None = None) -> list[ErrorMap]:
    """Maps of the error of a drive at torques [N*m], which share one contact system.

    Argument: formulation of that system, where it is there already.
    """
    formulation, maps = formulation or formulate(contact_system(drive)), list[ErrorMap]()
    for M_g in torques:
        maps.append(ErrorMap(drive, M_g, formulation, maps[-1].fresh if maps else None))
    return maps


@lru_cache(maxsize=4)  # of drives that differ in their deviations alone it is the same
def _lattice(kinematics: Kinematics) -> tuple[States, Indices, int]:
    """States of the cycle; states j by their coordinates, shape (z_b, z_g), -1 where there is none; steps along each.

    Where both numbers of teeth are even, k and l of every state are both even or both odd: steps of two.
    """
    j = np.arange(kinematics.cycle_states)
    board = np.full((kinematics.z_b, kinematics.z_g), -1, dtype=np.int64)
    board[j % kinematics.z_b, j % kinematics.z_g] = j
    return pitch_locked_states(kinematics, j), board, 2 if board[0, 1] < 0 else 1


def there_and_back(shape: tuple[int, ...]) -> Indices:
    """Flat places of a grid in an order in which each is next to the one before."""
    index = np.indices(shape).reshape(len(shape), -1)
    path = index.copy()
    for axis in range(1, len(shape)):
        back = path[:axis].sum(axis=0) % 2 == 1
        path[axis] = np.where(back, shape[axis] - 1 - index[axis], index[axis])
    return np.asarray(np.ravel_multi_index(tuple(path), shape))
