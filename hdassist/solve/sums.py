"""Sums over the contacts of solved states: all that analyses ask for but the forces themselves."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.model.contacts import ContactSystem
from hdassist.model.geometry import Array
from hdassist.solve.certificate import Residuals, residuals
from hdassist.solve.formulation import Formulation, Springs


@dataclass(frozen=True)
class StateSums:
    """Sums of states, shape (states,) where no other is given; NaN in a state that was given up.

    rotation [rad] of the flexspline; moment [N*mm] of each mesh zone, shape (states, 2); tooth_force [N], greatest on a
    flank; residuals; pull [N], forces along the scalars of the deviations, shape (states, scalars), where asked for;
    given_up, how many states the first way gave up.
    """

    rotation: Array
    moment: Array
    tooth_force: Array
    residuals: Residuals
    pull: Array | None
    slope: Array | None
    given_up: int

    @classmethod
    def of(
        cls,
        system: ContactSystem,
        delta_p: Array,
        torque: float,
        forces: Array,
        free: Array,
        given_up: int = 0,
        *,
        pull: bool = False,
        slope: Array | None = None,
    ) -> StateSums:
        """Sums of states from their forces [N], shape (states, M), and free displacements [mm, rad].

        Arguments: delta_p, gaps without force [mm], shape (states, M); torque [N*mm].
        """
        at_places = system.at_places(forces)
        flank = at_places[:, : system.pairs]
        return cls(
            rotation=free[:, system.free_rotation],
            moment=flank @ system.lever,
            tooth_force=flank.max(axis=1),
            residuals=residuals(system, delta_p, torque, forces, free),
            pull=at_places @ system.deviation_map[system.first] if pull else None,
            slope=slope,
            given_up=given_up,
        )

    def put(self, rows: NDArray[np.int64], there: StateSums) -> None:
        """Put the sums of other states into some rows."""
        self.residuals.shares[rows] = there.residuals.shares
        for name, values in vars(self).items():
            if isinstance(values, np.ndarray):
                values[rows] = getattr(there, name)


def rotation_slopes(formulation: Formulation, forces: Array, scalars: int) -> Array:
    """Slope of the rotation by the first scalars of the deviations [rad/mm], shape (states, scalars).

    Of each state at the contacts that carry force, forces [N], shape (states, M); NaN where none hold the parts.
    """
    system, units, m = formulation.system, formulation.units, len(formulation.H)
    change, rotation = system.deviation_map[system.first, :scalars], m + system.free_rotation
    slopes = np.full((len(forces), scalars), np.nan)
    for k, contact in enumerate(forces > 0):
        springs = Springs.of(formulation, np.zeros(len(contact)), contact)
        inside = np.append(np.flatnonzero(springs.series), np.arange(m, len(formulation.structure)))
        series = np.append(springs.series, np.zeros(len(units.load)))[inside]
        matrix = formulation.structure[np.ix_(inside, inside)] + np.diag(series)
        with suppress(np.linalg.LinAlgError):
            adjoint = np.linalg.solve(matrix, (inside == rotation).astype(float))
            slopes[k] = -adjoint[inside < m] @ change[inside[inside < m]]
    return np.asarray(slopes / units.load[system.free_rotation])
