"""Sums over the contacts of solved states: all that analyses ask for but the forces themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.model.contacts import ContactSystem
from hdassist.model.geometry import Array
from hdassist.solve.certificate import Residuals, residuals


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
            given_up=given_up,
        )

    def put(self, rows: NDArray[np.int64], there: StateSums) -> None:
        """Put the sums of other states into some rows."""
        self.residuals.shares[rows] = there.residuals.shares
        for name, values in vars(self).items():
            if isinstance(values, np.ndarray):
                values[rows] = getattr(there, name)
