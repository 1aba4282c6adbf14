"""The programme by the places of candidates, of which there are fewer: what the compiled walk starts from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hdassist.model.contacts import ROTATION
from hdassist.model.geometry import Array
from hdassist.solve.formulation import Formulation
from hdassist.solve.pivoting import Reference


class PlaceReference:
    """The programme solved at one contact set for the coordinates that the walk knows a state by, one for each place.

    Candidates that share a place are springs side by side. The coordinate of a place with a single candidate is its
    value (its force in contact, its gap else), of one with stations the approach, in units of the programme.
    Arguments: formulation; contact, candidates that carry force in a state near those asked for, shape (M,). Raises
    ValueError where that set does not hold the parts in place.
    """

    def __init__(self, formulation: Formulation, contact: NDArray[np.bool_]) -> None:
        system, units, local = formulation.system, formulation.units, formulation.local
        place, first = system.place, system.first
        gaps = formulation.gaps(system.delta_p)
        lowest = gaps[first]
        above, alone = gaps - lowest[place], np.bincount(place) == 1
        springs = contact / local
        stiffness = np.add.reduceat(springs, first)
        touching = stiffness > 0
        stiff = np.where(touching, stiffness, 1)
        offset = np.add.reduceat(springs * above, first) / stiff
        # in series with the structure: springs in contact; the compliance of a candidate that stands alone and is open
        series = np.where(touching, 1 / stiff, np.where(alone, local[first], 0))
        reference = Reference.at(formulation.H + np.diag(series), formulation.A_places, touching)
        if reference is None:
            raise ValueError("the contact set does not hold the parts in place")
        self.formulation, self._reference = formulation, reference
        stations = np.flatnonzero(touching & ~alone)  # places whose coordinate is the approach
        self._to_coordinate = np.ones(len(first) + len(formulation.A))
        self._to_coordinate[stations] = -series[stations]
        by_places = reference.by_others * self._to_coordinate[:, None]
        by_places[:, stations] *= series[stations]
        by_places[stations, stations] += series[stations]
        along = ~alone[place]
        gain = np.where(along & contact, -1 / local, 1)
        weight, own = np.abs(gain), np.where(along, np.where(contact, 1 / local, local), 0)
        scale = 1 / np.sqrt(gain * by_places[place, place] * weight + own)  # makes the reference's pivots one
        map_ = system.deviation_map[first].T
        freedom = np.full(len(system.C), -1, dtype=np.int32)
        freedom[~system.supported] = np.arange(len(formulation.A))
        self.flanks = first[: system.n_flanks // len(system.face.fall)]
        held = {
            "by_places": by_places.T,
            "law": self.coordinates(np.vstack([lowest + offset, formulation.gaps(map_)])),
            "place": place.astype(np.int32),
            "contact": contact.astype(np.uint8),
            "gain": gain * scale,
            "constant": gain * (above - offset[place]) * scale,
            "weight": weight * scale,
            "own": own * scale**2,
            "value_force": np.where(contact, units.force / scale, 0.0),
            "other_force": np.where(contact, 0.0, units.force * scale),
            "dual_unit": units.gap / units.load,
            "compliance": system.compliance,
            "local": system.local,
            "G": system.G[first].T,
            "C": system.C,
            "freedom": freedom,
            "delta_p": system.delta_p,
            "map": map_,
            "lever": system.lever[self.flanks],
            "zone": system.flanks.zone[self.flanks].astype(np.int8),
            "edge": system.flanks.edge[self.flanks].astype(np.uint8),
        }
        self.held = {name: np.ascontiguousarray(array) for name, array in held.items()}
        columns = len(map_)
        self.sizes = (len(place), len(first), len(formulation.A), columns, len(self.flanks), columns, ROTATION)

    def coordinates(self, gaps: Array) -> Array:
        """What gaps at the places, shape (states, m), add to the coordinates, shape (states, m + free)."""
        return np.asarray(self._reference.at_gaps(gaps) * self._to_coordinate)

    def of_torque(self, torque: float) -> Array:
        """What a torque [N*mm] adds to the coordinates, shape (m + free,)."""
        return np.asarray(self._reference.by_right @ self.formulation.right_side(torque) * self._to_coordinate)
