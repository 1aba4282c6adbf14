"""The contact problem of a drive as one convex quadratic programme, stated in cvxpy.

System (1) is the optimality condition of

    minimise    1/2 F' (D + G_s C_s^-1 G_s') F + delta_p' F
    subject to  G_f' F + b_f = 0,   F >= 0

The supported freedoms s are condensed. The freedoms f have no support, and the multipliers of their equilibrium are
their displacements. All engines and solvers start from this statement.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.model.contacts import ROTATION, ContactSystem, StateGaps
from hdassist.drive.model.geometry import Array

if TYPE_CHECKING:
    import cvxpy as cp

_INVERSE = 1e-6  # largest error of a product that should be the identity
_MICROMETRE = 1e-3  # mm; gaps are of order one in this unit


@dataclass(frozen=True)
class _Units:
    """Units of the scaled programme, chosen so that its numbers are of order one."""

    gap: float  # [mm]
    force: float  # force [N] that closes one unit of gap at the stiffest station of a tooth
    load: Array  # length that scales each row of the equilibrium: 1 for a force, r_m [mm] for the moment, shape (free,)


@dataclass(frozen=True)
class Springs:
    """The candidates in contact at one place as one spring, in units of the programme.

    The candidates are parallel springs, each of which begins to push when its own gap closes.
    """

    series: Array  # compliance, shape (m,); 0 at a place without contact
    offset: Array  # approach beyond `lowest` at which the spring begins to push, shape (m,)
    lowest: Array  # gap of the first candidate at each place, shape (m,)
    excess: Array  # gap of each candidate minus that of the first candidate at its place, shape (M,)

    @classmethod
    def of(
        cls,
        formulation: Formulation,
        gaps: Array,
        contact: NDArray[np.bool_],
    ) -> Springs:
        """Return the springs of a contact set.

        Args:
            formulation: programme with the compliances of the candidates.
            gaps: gaps without force, in units of the programme, shape (M,).
            contact: whether each candidate is in contact, shape (M,).
        """
        # stiffnesses of parallel springs add up, each shifted by its own gap
        place = formulation.system.place
        first = formulation.system.first
        stiffness = contact / formulation.local
        at_places = np.add.reduceat(stiffness, first)
        # a place without contact has no spring; 0 marks it, because an infinite compliance cannot be stored
        series = np.divide(
            1,
            at_places,
            out=np.zeros(len(first)),
            where=at_places > 0,
        )
        lowest = gaps[first]
        # exactly 0 at a place with one candidate, instead of a difference of large numbers
        excess = gaps - lowest[place]
        # the joint spring begins to push at the mean of the excess gaps, weighted by stiffness
        offset = np.add.reduceat(stiffness * excess, first) * series
        return cls(
            series=series,
            offset=offset,
            lowest=lowest,
            excess=excess,
        )


@dataclass(frozen=True)
class _Statement:
    """The programme in cvxpy, DPP in the parameters gaps and load.

    The sums of the forces at the places are a separate variable, because the structure depends only on these sums.
    Solvers take three to five times as long with M coupled variables.
    """

    problem: cp.Problem
    forces: cp.Variable  # in units.force, shape (M,)
    gaps: cp.Parameter  # delta_p in units.gap, shape (M,)
    load: cp.Parameter  # b_f in units.force * units.load, shape (free,)
    # equilibrium of the free freedoms; its dual is their displacement, in units.gap / units.load
    equilibrium: cp.Constraint


@dataclass(frozen=True)
class Formulation:
    """The programme (2) of one contact system: minimise 1/2 x' P x + gaps' x subject to A x + load = 0, x >= 0.

    P consists of the elements of H for the places of two candidates, plus `local` on the diagonal. Candidates at one
    place have equal columns of A, so A is stored by places.
    """

    system: ContactSystem
    units: _Units
    H: Array  # compliance of structure and supports between the places, in units, shape (m, m)
    local: Array  # local compliance of each candidate, in units, shape (M,)
    A: Array  # equilibrium of the free freedoms, in units, shape (free, m)
    # references of the engines by torque [N*mm]; None if the contact set does not hold the parts
    references: dict[float, Reference | None] = field(
        default_factory=dict,
        init=False,
        repr=False,
        compare=False,
    )

    @cached_property
    def digest(self) -> bytes:
        """SHA-256 of all numbers of the programme."""
        # the hash includes the shapes, so that arrays with equal bytes but different shapes differ
        digest = sha256()
        scalar_units = np.array([self.units.gap, self.units.force])
        for array in (self.H, self.local, self.A, self.system.place, self.units.load, scalar_units):
            digest.update(f"{array.shape}".encode() + array.tobytes())
        return digest.digest()

    @cached_property
    def P(self) -> Array:
        """Compliance between candidates, shape (M, M)."""
        place = self.system.place
        return np.asarray(self.H[np.ix_(place, place)] + np.diag(self.local))

    @cached_property
    def structure(self) -> Array:
        """H and A as one symmetric matrix over forces at the places and displacements, shape (m + free, m + free)."""
        m = len(self.H)
        n = m + len(self.A)
        matrix = np.zeros((n, n))
        matrix[:m, :m] = self.H
        matrix[:m, m:] = self.A.T
        matrix[m:, :m] = self.A
        return matrix

    @cached_property
    def statement(self) -> _Statement:
        """The programme in cvxpy, stated on first use, because importing cvxpy takes a second."""
        import cvxpy as cp
        from scipy.sparse import csr_array, diags_array

        M = len(self.local)
        # the dual variables of the equilibrium are the displacements of the free freedoms
        m = len(self.H)
        # F >= 0 is an attribute of the variable, so that solvers receive it as a bound and not as a row
        forces = cp.Variable(M, name="F", nonneg=True)
        place_forces = cp.Variable(m, name="F_places")
        gaps = cp.Parameter(M, name="delta_p")
        load = cp.Parameter(len(self.A), name="b")
        # both matrices are compliances and therefore positive semidefinite, so cvxpy need not test them
        structure_energy = 0.5 * cp.quad_form(place_forces, cp.psd_wrap(self.H))
        contact_energy = 0.5 * cp.quad_form(forces, cp.psd_wrap(diags_array(self.local)))
        # second line of (2): the free freedoms are in equilibrium without a support
        equilibrium = self.A @ place_forces + load == 0
        sums = csr_array((np.ones(M), (self.system.place, np.arange(M))), shape=(m, M))
        constraints = [equilibrium, sums @ forces - place_forces == 0]
        problem = cp.Problem(cp.Minimize(contact_energy + structure_energy + gaps @ forces), constraints)
        return _Statement(
            problem=problem,
            forces=forces,
            gaps=gaps,
            load=load,
            equilibrium=equilibrium,
        )

    def gaps(self, delta_p: Array) -> Array:
        """Return gaps in units of the programme.

        delta_p: gaps without force [mm], shape (..., M).
        """
        return delta_p / self.units.gap

    def load(self, torque: float) -> Array:
        """Return the load b_f of a torque on the flexspline, in units of the programme, shape (free,).

        Args:
            torque: torque [N*mm], positive counter-clockwise.
        """
        # the torque acts only on the rotation of the flexspline, so b is 0 for the other freedoms
        is_rotation = np.arange(len(self.A)) == self.system.free_rotation
        return np.asarray(torque * is_rotation / (self.units.force * self.units.load))

    def answer(self, forces: Array, duals: Array) -> tuple[Array, Array]:
        """Return forces [N] and free displacements [mm, rad] of a solution in units of the programme."""
        return forces * self.units.force, duals * (self.units.gap / self.units.load)


def formulate(system: ContactSystem) -> Formulation:
    """Return the programme (2) of a contact system, in units in which its numbers are of order one."""
    supported = system.supported
    free = ~system.supported
    # candidates at one place have equal rows of G
    G = system.G[system.first]  # rows of G by place, shape (m, 9)
    # the moment is in units of force times r_m, so that all rows of A have similar magnitudes
    load_units = np.where(np.arange(len(free)) == ROTATION, system.geometry.r_m, 1.0)[free]
    # the unit of force follows from the stiffest station, because with the softest one Clarabel fails at coned flanks
    # under light torques
    stiffest = float(system.face.compliance.min())
    units = _Units(
        gap=_MICROMETRE,
        force=_MICROMETRE / stiffest,
        load=load_units,
    )
    G_s = G[:, supported]
    # G_s C_s^-1 G_s': a supported freedom adds a compliance between all places, second term of H in (2)
    H = (G_s / system.C[supported]) @ G_s.T
    H += system.compliance
    H *= units.force / units.gap
    return Formulation(
        system=system,
        units=units,
        H=H,
        local=system.local * (units.force / units.gap),
        A=np.ascontiguousarray((G[:, free] / load_units).T),
    )


# --- the programme solved at one contact set


@dataclass(frozen=True)
class _Responses:
    """Changes of the m + free coordinates of a reference, in units of the programme."""

    by_place: Array  # change per unit of the opposite value of a candidate at each place, shape (m + free, m)
    by_gap: Array  # change per unit of gap at each touching place, shape (touching, m + free)
    by_load: Array  # change per unit of load in each row of the equilibrium, shape (m + free, free)


@dataclass(frozen=True)
class _Pivots:
    """Factors that give the value of each candidate from the coordinate of its place, shape (M,).

    The scale makes the first pivots one.
    """

    gain: Array  # weight of the coordinate in the value
    weight: Array  # weight of the candidate's opposite value in the coordinate of its place
    self_response: Array  # weight of the candidate's opposite value in its own value
    scale: Array


class Reference:
    """The programme solved at one contact set, in the coordinates with which the walk describes a state.

    There is one coordinate for each place. At a place with a single candidate, the coordinate is its value: the force
    in contact, otherwise the gap. At a place with stations, the coordinate is the approach. The displacements of the
    free freedoms follow. All coordinates are in units of the programme.

    Attributes:
        arrays: arrays in the order of struct contact_system of walk.c.
        sizes: numbers that precede the arrays.
    """

    def __init__(self, formulation: Formulation, contact: NDArray[np.bool_]) -> None:
        """Solve the programme at a contact set.

        Args:
            formulation: the programme.
            contact: candidates that carry force in a state similar to those to be solved, shape (M,).

        Raises ValueError if the contact set does not hold the parts in place.
        """
        system = formulation.system
        springs = Springs.of(formulation, formulation.gaps(system.delta_p), contact)
        # the reference has the gaps without deviations; states differ from it only in their gaps
        is_touching = springs.series > 0  # shape (m,)
        is_single = np.bincount(system.place) == 1  # places with one candidate, shape (m,)
        responses = _responses(formulation, springs, is_single)
        # the coordinate of a place gives the values of its candidates, so M candidates need m coordinates
        pivots = _pivots(formulation, responses, contact, is_single)
        self._gap_unit = formulation.units.gap
        self._is_touching = is_touching
        self._by_gap = responses.by_gap
        # measured teeth change the gaps of flanks, which are the first places
        self._flanks = system.first[: system.pairs]
        arrays = self._walk_arrays(formulation, contact, springs, responses, pivots)
        self.arrays = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
        self.sizes = (
            len(system.place),
            len(system.first),
            len(formulation.A),
            len(self._flanks),
            system.deviation_map.shape[1],
            ROTATION,
        )

    def _walk_arrays(
        self,
        formulation: Formulation,
        contact: NDArray[np.bool_],
        springs: Springs,
        responses: _Responses,
        pivots: _Pivots,
    ) -> dict[str, NDArray[Any]]:
        """Return the arrays of struct contact_system of walk.c, in its order."""
        system = formulation.system
        units = formulation.units
        gap_by_deviation = system.deviation_map[system.first].T  # by places, shape (scalars, m)
        constant_gap = (springs.lowest + springs.offset) * units.gap
        # coordinates of a state: constant row + torque * second row + scalars @ further rows
        constant_row = self._coordinates(constant_gap[None])
        torque_row = -responses.by_load @ formulation.load(1.0)
        law = np.vstack([constant_row, torque_row, self._coordinates(gap_by_deviation)])
        return {
            "by_places": responses.by_place.T,
            "law": law,
            "place": system.place.astype(np.int32),
            "contact": contact.astype(np.uint8),
            "gain": pivots.gain * pivots.scale,
            "constant": pivots.gain * (springs.excess - springs.offset[system.place]) * pivots.scale,
            "weight": pivots.weight * pivots.scale,
            "own": pivots.self_response * pivots.scale**2,
            "value_force": np.where(contact, units.force / pivots.scale, 0.0),
            "other_force": np.where(contact, 0.0, units.force * pivots.scale),
            "dual_unit": units.gap / units.load,
            "compliance": system.compliance,
            "local": system.local,
            "G": system.G[system.first].T,
            "C": system.C,
            "delta_p": system.delta_p,
            "map": gap_by_deviation,
            "lever": system.lever.T,
        }

    def values(self, coordinates: Array, candidates: NDArray[np.int64]) -> Array:
        """Return the values of candidates, shape (states, candidates).

        Args:
            coordinates: coordinates of the states, shape (states, m + free).
            candidates: indices of the candidates.
        """
        place_coordinates = coordinates[:, self.arrays["place"][candidates]]
        return np.asarray(place_coordinates * self.arrays["gain"][candidates] + self.arrays["constant"][candidates])

    def of_teeth(self, gaps: StateGaps) -> tuple[Array | None, Array | None]:
        """Return the gaps that measured teeth add at the places [mm], shape (states, m), and their effect.

        The effect is the change of the coordinates, shape (states, m + free). Both are None without measured teeth.
        """
        if gaps.at_flanks is None:
            return None, None
        place_gaps = np.zeros((len(gaps), len(self._is_touching)))
        # measured teeth do not change the gaps of bore nodes and balls
        place_gaps[:, : len(self._flanks)] = gaps.at_flanks[:, self._flanks]
        return place_gaps, self._coordinates(place_gaps)

    def _coordinates(self, gaps: Array) -> Array:
        """Return the change of the coordinates due to gaps at the places, shape (states, m + free).

        gaps: gaps [mm], shape (states, m).
        """
        coordinates = gaps[:, self._is_touching] @ self._by_gap
        # the coordinate of a place without contact is its gap, to which a further gap is added directly
        coordinates[:, np.flatnonzero(~self._is_touching)] += gaps[:, ~self._is_touching]
        return np.asarray(coordinates / self._gap_unit)


def _responses(
    formulation: Formulation,
    springs: Springs,
    is_single: NDArray[np.bool_],
) -> _Responses:
    """Return the responses of the coordinates of a reference at the contact set of its springs.

    Raises ValueError if the contact set does not hold the parts in place.
    """
    m = len(springs.series)
    is_touching = springs.series > 0
    # compliance in series with the structure: that of springs in contact, and that of a single open candidate
    open_compliance = np.where(is_single, formulation.local[formulation.system.first], 0)
    series = np.where(is_touching, springs.series, open_compliance)
    matrix = formulation.structure.copy()
    matrix[np.arange(m), np.arange(m)] += series
    # in contact the force is the response to the gap; the free freedoms are the response to the load
    is_traded = np.append(is_touching, np.ones(len(formulation.A), dtype=bool))
    traded = principal_transform(matrix, is_traded)
    # at places with stations in contact the coordinate is the approach instead of the force, because several stations
    # share the force of their place
    approached = np.flatnonzero(is_touching & ~is_single)
    traded[approached] *= -series[approached, None]
    by_place = traded[:, :m].copy()
    by_place[:, approached] *= series[approached]
    by_place[approached, approached] += series[approached]
    return _Responses(
        by_place=by_place,
        by_gap=-traded[:, :m][:, is_touching].T,
        by_load=traded[:, m:],
    )


def _pivots(
    formulation: Formulation,
    responses: _Responses,
    contact: NDArray[np.bool_],
    is_single: NDArray[np.bool_],
) -> _Pivots:
    """Return the factors that give the values of candidates from the coordinates of their places.

    Raises ValueError if a first pivot is not positive.
    """
    place = formulation.system.place
    local = formulation.local
    # the value of a single candidate at its place is the coordinate itself, up to the sign
    is_station = ~is_single[place]  # shape (M,)
    gain = np.where(is_station & contact, -1 / local, 1)
    weight = np.abs(gain)
    self_response = np.where(is_station, np.where(contact, 1 / local, local), 0)
    # change of a candidate's value by its own opposite value, which is the pivot when it changes sides
    unscaled = gain * responses.by_place[place, place] * weight + self_response
    # compliances are positive, so another sign means that a part can move freely at this contact set
    if not np.all(unscaled > 0):
        raise ValueError("the contact set leaves a part free to move")
    return _Pivots(
        gain=gain,
        weight=weight,
        self_response=self_response,
        scale=1 / np.sqrt(unscaled),
    )


def principal_transform(matrix: Array, inside: NDArray[np.bool_]) -> Array:
    """Return a symmetric matrix after arguments and results have been exchanged for a set of indices.

    Args:
        matrix: the matrix, shape (n, n).
        inside: whether each index belongs to the set, shape (n,).

    Raises ValueError if the block of the set has no inverse.
    """
    # the block of the set is inverted as one matrix
    order = np.argsort(~inside, kind="stable")  # indices of the set first
    n = int(np.count_nonzero(inside))
    ordered = matrix[order].take(order, axis=1)
    block = ordered[:n, :n]
    coupling = ordered[:n, n:]
    # right-hand sides: the identity for the inverse, and the coupling to the remaining rows
    right = ordered[:n].copy()
    right[:, :n] = np.eye(n)
    solution = np.linalg.solve(block, right)
    inverse = solution[:, :n].copy()
    # the condition of the block is not known in advance, so the product with the inverse is checked
    residual = right - block @ solution
    if not np.abs(residual[:, :n]).max(initial=0) <= _INVERSE:
        raise ValueError("the contact set does not constrain all parts")
    solution += inverse @ residual  # one step of refinement, without which the rotation loses two digits
    across = solution[:, n:]
    # Schur complement of the remaining block
    ordered[n:, n:] -= coupling.T @ across
    ordered[:n, :n] = solution[:, :n]
    ordered[:n, n:] = -across
    ordered[n:, :n] = across.T
    # restore the original order of rows and columns
    back = np.argsort(order)
    return ordered[back].take(back, axis=1)
