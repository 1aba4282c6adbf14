"""F'_ior of drives near one whose error is known all over the torus of tooth positions (search.py).

What a stiffness, a clearance or a shape changes is smoother there than the error itself. So few states tell the change;
known map and change together propose where the extremes may be, and states there prove how much they are
(proposed.py). `python -m benchmarks.nearby` compares with a search of each drive.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates

from hdassist.error.cycle import place
from hdassist.error.proposed import BLOCK, Batch, Indices, ProposedSearch
from hdassist.error.search import searchable
from hdassist.errors import UsageError
from hdassist.model.contacts import contact_system
from hdassist.model.deviations import state_gaps
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Certificate
from hdassist.solve.formulation import formulate
from hdassist.solve.loadcase import LoadCase


class Nearby:
    """Drives near one, at torques M_g [N*m]: the error of that one is solved at all points of the map.

    F_ior_arcsec, F'_ior of that one, shape (torques,); certificates of the states behind it and the map, one a torque.
    Raises UntrustedError where an answer cannot be trusted, UsageError for a drive that is not searchable.
    """

    def __init__(self, drive: Drive, torques: Sequence[float]) -> None:
        if not searchable(drive):
            raise UsageError("with rolling balls every state has to be solved")
        self.drive, self.torques = drive, tuple(torques)
        solved = [_rotation(search, drive, search.points) for search in self._searches]
        self._maps = [rotation for rotation, _ in solved]
        self.F_ior_arcsec, proofs = self._extremes(drive, self._searches, self._maps)
        self.certificates = [proof + more for (_, proof), more in zip(solved, proofs, strict=True)]

    def F_ior(self, there: Drive) -> tuple[Array, list[Certificate]]:
        """F'_ior [arcsec] of a drive at each torque, shape (torques,), and the proof of each.

        Raises UntrustedError where an answer cannot be trusted.
        """
        formulation = formulate(contact_system(there))
        searches = [ProposedSearch(there, known.M_g, formulation, known.fresh) for known in self._searches]
        few = [_rotation(search, there, search.points[::BLOCK, ::BLOCK]) for search in searches]
        maps = [
            known + _finer(rotation - known[::BLOCK, ::BLOCK], known.shape)
            for known, (rotation, _) in zip(self._maps, few, strict=True)
        ]
        found, proofs = self._extremes(there, searches, maps)
        return found, [proof + more for (_, proof), more in zip(few, proofs, strict=True)]

    def _extremes(
        self, drive: Drive, searches: list[ProposedSearch], maps: list[Array]
    ) -> tuple[Array, list[Certificate]]:
        alone = Batch.of(drive)
        found = [search.extremes(alone, rotation[None]) for search, rotation in zip(searches, maps, strict=True)]
        return np.array([float(each.F_ior_arcsec[0]) for each in found]), [each.certificate for each in found]

    @cached_property
    def _searches(self) -> list[ProposedSearch]:
        formulation = formulate(contact_system(self.drive))
        first = ProposedSearch(self.drive, self.torques[0], formulation)
        return [first, *(ProposedSearch(self.drive, M_g, formulation, first.fresh) for M_g in self.torques[1:])]

    def __getstate__(self) -> dict[str, Any]:
        """What goes to another process: what can be made there anew stays here."""
        return {name: value for name, value in self.__dict__.items() if name != "_searches"}


def _rotation(search: ProposedSearch, drive: Drive, points: Indices) -> tuple[Array, Certificate]:
    """Rotation [arcsec] of a drive at points of the torus, shape (k, l, 2), and the proof of it."""
    there = search.states.take(search.state(points).ravel())
    case = LoadCase(search.fresh.formulation, search.M_g, like=search.fresh, many=True)
    answers = case.solve(state_gaps(drive, case.system, there), partial(place, there, search.M_g))
    return answers.rotation_arcsec.reshape(points.shape[:2]), answers.certificate


def _finer(few: Array, shape: tuple[int, ...]) -> Array:
    """What a cubic spline around the torus has between points, of which there are BLOCK times as many."""
    return np.asarray(map_coordinates(few, np.indices(shape) / BLOCK, order=3, mode="grid-wrap"))
