"""The programme solved at one contact set, for any deviations and torque: the start of the walk over states."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hdassist.model.contacts import ROTATION, StateGaps
from hdassist.model.geometry import Array
from hdassist.solve.formulation import Formulation, Springs

INVERSE = 1e-6  # error of a product that should be the identity


class Reference:
    """The programme solved at one contact set for the coordinates that the walk knows a state by, one for each place.

    The coordinate of a place with a single candidate is its value (its force in contact, its gap else), of one with
    stations the approach, in units of the programme; those of the free freedoms, their displacements, come last.
    held: as contact_system of walk.c describes, in its order; sizes: the numbers before them.
    Arguments: formulation; contact, candidates that carry force in a state near those asked for, shape (M,). Raises
    ValueError where that set does not hold the parts in place.
    """

    def __init__(self, formulation: Formulation, contact: NDArray[np.bool_]) -> None:
        system, units, local = formulation.system, formulation.units, formulation.local
        place, first, free, m = system.place, system.first, len(formulation.A), len(system.first)
        springs = Springs.of(formulation, formulation.gaps(system.delta_p), contact)
        touching, alone = springs.series > 0, np.bincount(place) == 1
        # in series with the structure: springs in contact; the compliance of a candidate that stands alone and is open
        series = np.where(touching, springs.series, np.where(alone, local[first], 0))
        matrix = formulation.structure + np.diag(np.append(series, np.zeros(free)))
        exchanged = principal_transform(matrix, np.append(touching, np.ones(free, dtype=bool)))
        stations = np.flatnonzero(touching & ~alone)  # places whose coordinate is the approach
        exchanged[stations] *= -series[stations, None]
        by_places, by_right = exchanged[:, :m].copy(), exchanged[:, m:]
        by_places[:, stations] *= series[stations]
        by_places[stations, stations] += series[stations]
        along = ~alone[place]
        gain = np.where(along & contact, -1 / local, 1)
        weight, own = np.abs(gain), np.where(along, np.where(contact, 1 / local, local), 0)
        unscaled = gain * by_places[place, place] * weight + own
        if not np.all(unscaled > 0):
            raise ValueError("no pivots to start from")
        scale = 1 / np.sqrt(unscaled)  # makes the reference's pivots one
        map_ = system.deviation_map[first].T
        self._gap_unit, self._touching, self._by_gaps = units.gap, touching, -exchanged[:, :m][:, touching].T
        self._flanks = first[: system.pairs]
        constant = (springs.lowest + springs.offset) * units.gap
        held = {
            "by_places": by_places.T,
            "law": np.vstack(
                [self._coordinates(constant[None]), -by_right @ formulation.load(1.0), self._coordinates(map_)]
            ),
            "place": place.astype(np.int32),
            "contact": contact.astype(np.uint8),
            "gain": gain * scale,
            "constant": gain * (springs.above - springs.offset[place]) * scale,
            "weight": weight * scale,
            "own": own * scale**2,
            "value_force": np.where(contact, units.force / scale, 0.0),
            "other_force": np.where(contact, 0.0, units.force * scale),
            "dual_unit": units.gap / units.load,
            "compliance": system.compliance,
            "local": system.local,
            "G": system.G[first].T,
            "C": system.C,
            "delta_p": system.delta_p,
            "map": map_,
            "lever": system.lever.T,
        }
        self.held = {name: np.ascontiguousarray(array) for name, array in held.items()}
        self.sizes = (len(place), m, free, len(self._flanks), len(map_), ROTATION)
        self.formulation, self.system = formulation, system

    def values(self, coordinates: Array, candidates: NDArray[np.int64]) -> Array:
        """Values of some candidates, shape (states, candidates), by coordinates, shape (states, m + free)."""
        held = self.held
        at_places = coordinates[:, held["place"][candidates]]
        return np.asarray(at_places * held["gain"][candidates] + held["constant"][candidates])

    def of_teeth(self, gaps: StateGaps) -> tuple[Array | None, Array | None]:
        """Gaps [mm] that measured teeth add at the places, shape (states, m), and their effect on the coordinates."""
        if gaps.at_flanks is None:
            return None, None
        at_places = np.zeros((len(gaps), len(self._touching)))
        at_places[:, : len(self._flanks)] = gaps.at_flanks[:, self._flanks]
        return at_places, self._coordinates(at_places)

    def _coordinates(self, gaps: Array) -> Array:
        """The effect of gaps at the places [mm], shape (states, m), on the coordinates, shape (states, m + free)."""
        found = gaps[:, self._touching] @ self._by_gaps
        found[:, np.flatnonzero(~self._touching)] += gaps[:, ~self._touching]
        return np.asarray(found / self._gap_unit)


def principal_transform(matrix: Array, inside: NDArray[np.bool_]) -> Array:
    """The matrix, shape (n, n), symmetric, after what it maps and what it maps to traded places inside, shape (n,).

    Raises ValueError where it has no inverse inside.
    """
    outside, n = ~inside, int(np.count_nonzero(inside))
    block, coupling = matrix[np.ix_(inside, inside)], matrix[np.ix_(inside, outside)]
    inverse, right = np.linalg.inv(block), np.hstack([np.eye(n), coupling])
    both = inverse @ right
    rest = right - block @ both
    if not np.abs(rest[:, :n]).max(initial=0) <= INVERSE:
        raise ValueError("the contact set does not hold the parts in place")
    both += inverse @ rest  # refined: without it two digits of the rotation are lost
    across = both[:, n:]
    result = np.empty_like(matrix)
    result[np.ix_(inside, inside)], result[np.ix_(inside, outside)] = both[:, :n], -across
    result[np.ix_(outside, inside)] = across.T
    result[np.ix_(outside, outside)] = matrix[np.ix_(outside, outside)] - coupling.T @ across
    return result
