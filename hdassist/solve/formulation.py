"""The contact problem of a drive as one convex quadratic programme, stated once, in cvxpy.

System (1) is the optimality condition of

    minimise    1/2 F' (D + G_s C_s^-1 G_s') F + delta_p' F
    subject to  G_f' F + b_f = 0,   F >= 0

with s the supported freedoms, condensed, and f those without support: the multipliers of their
equilibrium are their displacements. Everything that solves it starts from this statement.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hdassist.model.contacts import ROTATION, ContactSystem, StateGaps
from hdassist.model.geometry import Array

if TYPE_CHECKING:
    import cvxpy as cp

_INVERSE = 1e-6  # largest error of a product that should be the identity
_MICROMETRE = 1e-3  # mm; gaps are of order one in this unit


@dataclass(frozen=True)
class _Units:
    """Units of the scaled programme, chosen so that its numbers are of order one."""

    gap: float  # [mm]
    force: float  # [N]; closes a unit of gap at the stiffest station of a tooth
    load: Array  # length that scales each row of equilibrium, 1 for a force, r_m [mm] for the moment, shape (free,)


@dataclass(frozen=True)
class Springs:
    """The candidates in contact at one place as one spring, in units of the programme.

    They are springs side by side, each of which begins to push when its own gap is closed.
    """

    series: Array  # compliance, 0 at a place without contact, shape (m,)
    offset: Array  # closing beyond `lowest` at which the spring begins to push, shape (m,)
    lowest: Array  # gap of the first candidate at each place, shape (m,)
    excess: Array  # gap of each candidate minus that of the first one at its place, shape (M,)

    @classmethod
    def of(
        cls,
        formulation: Formulation,
        gaps: Array,
        contact: NDArray[np.bool_],
    ) -> Springs:
        """Return the springs of a contact set.

        Args:
            formulation: compliances of the candidates.
            gaps: without force, in units of the programme, shape (M,).
            contact: the candidates in contact, shape (M,).
        """
        # springs side by side add their stiffnesses, each shifted by its own gap
        place = formulation.system.place
        first = formulation.system.first
        stiffness = contact / formulation.local
        at_places = np.add.reduceat(stiffness, first)
        # a place without contact has no spring: 0 marks it, as an infinite compliance cannot be stored
        series = np.divide(
            1,
            at_places,
            out=np.zeros(len(first)),
            where=at_places > 0,
        )
        lowest = gaps[first]
        excess = gaps - lowest[place]  # exactly 0 at a place with one candidate, not a difference of large numbers
        # the mean of the excess gaps, weighted by stiffness: where the joint spring begins to push
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

    The sums of the forces at the places are a variable of their own. The structure depends on these sums alone, and
    with M coupled variables solvers take three to five times as long.
    """

    problem: cp.Problem
    forces: cp.Variable  # in units.force, shape (M,)
    gaps: cp.Parameter  # delta_p in units.gap, shape (M,)
    load: cp.Parameter  # b_f in units.force * units.load, shape (free,)
    equilibrium: cp.Constraint  # its dual is the displacement of the free freedoms, in units.gap / units.load


@dataclass(frozen=True)
class Formulation:
    """The programme (2) of one contact system: minimise 1/2 x' P x + gaps' x subject to A x + load = 0, x >= 0.

    P is H between the places of two candidates, plus `local` on its diagonal. Candidates at one place have equal
    columns of A, which is stored by places.
    """

    system: ContactSystem
    units: _Units
    H: Array  # compliance of structure and supports between the places, in units, shape (m, m)
    local: Array  # compliance of each candidate by itself, in units, shape (M,)
    A: Array  # equilibrium of the free freedoms, in units, shape (free, m)
    # references of the engines by the torque [N*mm], None if the contact set does not hold the parts
    references: dict[float, Reference | None] = field(
        default_factory=dict,
        init=False,
        repr=False,
        compare=False,
    )

    @cached_property
    def digest(self) -> bytes:
        """SHA-256 of all numbers of the programme."""
        # shapes are hashed as well, so that arrays of other shapes with the same bytes differ
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
        """The programme in cvxpy, stated when it is needed first, since cvxpy takes a second to import."""
        import cvxpy as cp
        from scipy.sparse import csr_array, diags_array

        M = len(self.local)
        # the dual variables of the equilibrium are the displacements of the free freedoms
        m = len(self.H)
        # F >= 0 belongs to the variable, so that solvers get it as a bound and not as a row
        forces = cp.Variable(M, name="F", nonneg=True)
        place_forces = cp.Variable(m, name="F_places")
        gaps = cp.Parameter(M, name="delta_p")
        load = cp.Parameter(len(self.A), name="b")
        # both matrices are compliances, positive semidefinite by construction: no test for it is needed
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
        """Return gaps without force [mm], shape (..., M), in units of the programme."""
        return delta_p / self.units.gap

    def load(self, torque: float) -> Array:
        """Return the load b_f of a torque on the flexspline, in units of the programme, shape (free,).

        Args:
            torque: [N*mm], positive counter-clockwise.
        """
        # the torque acts on the flexspline's rotation alone; b is 0 for the other freedoms
        is_rotation = np.arange(len(self.A)) == self.system.free_rotation
        return np.asarray(torque * is_rotation / (self.units.force * self.units.load))

    def answer(self, forces: Array, duals: Array) -> tuple[Array, Array]:
        """Return forces [N] and displacements of the free freedoms [mm, rad] of a solution in the programme's units."""
        return forces * self.units.force, duals * (self.units.gap / self.units.load)


def formulate(system: ContactSystem) -> Formulation:
    """State the programme (2) of a contact system, in units in which its numbers are of order one."""
    supported = system.supported
    free = ~system.supported
    # candidates at one place have equal rows of G
    G = system.G[system.first]  # by places, shape (m, 9)
    # the moment in units of force times r_m, so that all rows of A are of one size
    load_units = np.where(np.arange(len(free)) == ROTATION, system.geometry.r_m, 1.0)[free]
    # The unit of force follows the stiffest station: with the softest one Clarabel gives up coned flanks at light
    # torques.
    stiffest = float(system.face.compliance.min())
    units = _Units(
        gap=_MICROMETRE,
        force=_MICROMETRE / stiffest,
        load=load_units,
    )
    G_s = G[:, supported]
    # G_s C_s^-1 G_s': a supported freedom is a compliance between all places, second term of H in (2)
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
    """Change of the coordinates of a reference, m + free of them, in units of the programme."""

    by_place: Array  # by a unit of the opposite value of a candidate at each place, shape (m + free, m)
    by_gap: Array  # by a unit of gap at each touching place, shape (touching, m + free)
    by_load: Array  # by a unit of load in each row of equilibrium, shape (m + free, free)


@dataclass(frozen=True)
class _Pivots:
    """Value of each candidate from the coordinate of its place, scaled so that the first pivots are one, shape (M,)."""

    gain: Array  # of the coordinate in the value
    weight: Array  # of the candidate's opposite value in the coordinate of its place
    self_response: Array  # of the candidate's opposite value in its own value
    scale: Array


class Reference:
    """The programme solved at one contact set, in the coordinates by which the walk knows a state.

    There is one coordinate for each place. The coordinate of a place with a single candidate is its value: its force in
    contact, else its gap. The coordinate of a place with stations is its approach. The displacements of the free
    freedoms come last. All are in units of the programme.

    Attributes:
        arrays: as struct contact_system of walk.c declares them, in its order.
        sizes: the numbers before them.
    """

    def __init__(self, formulation: Formulation, contact: NDArray[np.bool_]) -> None:
        """Solve the programme at a contact set.

        Args:
            formulation: the programme.
            contact: candidates that carry force in a state near those to be solved, shape (M,).

        Raises ValueError if the contact set does not hold the parts in place.
        """
        system = formulation.system
        springs = Springs.of(formulation, formulation.gaps(system.delta_p), contact)
        # the reference is taken at the gaps without deviations; states differ from it by their gaps only
        is_touching = springs.series > 0  # shape (m,)
        is_single = np.bincount(system.place) == 1  # places with one candidate, shape (m,)
        responses = _responses(formulation, springs, is_single)
        # values of candidates follow from the coordinate of their place, so M candidates need m coordinates
        pivots = _pivots(formulation, responses, contact, is_single)
        self._gap_unit = formulation.units.gap
        self._is_touching = is_touching
        self._by_gap = responses.by_gap
        # measured teeth shift the gaps of flanks, which are the first places
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
        """Return the values of some candidates, shape (states, candidates).

        Args:
            coordinates: of the states, shape (states, m + free).
            candidates: their numbers.
        """
        place_coordinates = coordinates[:, self.arrays["place"][candidates]]
        return np.asarray(place_coordinates * self.arrays["gain"][candidates] + self.arrays["constant"][candidates])

    def of_teeth(self, gaps: StateGaps) -> tuple[Array | None, Array | None]:
        """Return the gaps [mm] that measured teeth add at the places, shape (states, m), and their effect.

        The effect is the change of the coordinates, shape (states, m + free). Both are None without measured teeth.
        """
        if gaps.at_flanks is None:
            return None, None
        place_gaps = np.zeros((len(gaps), len(self._is_touching)))
        # bore nodes and balls have no teeth: their gaps stay
        place_gaps[:, : len(self._flanks)] = gaps.at_flanks[:, self._flanks]
        return place_gaps, self._coordinates(place_gaps)

    def _coordinates(self, gaps: Array) -> Array:
        """Return the change of the coordinates by gaps at the places [mm], shape (states, m + free)."""
        coordinates = gaps[:, self._is_touching] @ self._by_gap
        # a place without contact: its coordinate is its gap, and a further gap adds to it directly
        coordinates[:, np.flatnonzero(~self._is_touching)] += gaps[:, ~self._is_touching]
        return np.asarray(coordinates / self._gap_unit)


def _responses(
    formulation: Formulation,
    springs: Springs,
    is_single: NDArray[np.bool_],
) -> _Responses:
    """Return how the coordinates of a reference respond at the contact set of its springs.

    Raises ValueError if the contact set does not hold the parts in place.
    """
    m = len(springs.series)
    is_touching = springs.series > 0
    # compliance in series with the structure: of springs in contact, and of a single candidate that is open
    open_compliance = np.where(is_single, formulation.local[formulation.system.first], 0)
    series = np.where(is_touching, springs.series, open_compliance)
    matrix = formulation.structure.copy()
    matrix[np.arange(m), np.arange(m)] += series
    # in contact the force answers to the gap; the free freedoms answer to the equilibrium
    is_traded = np.append(is_touching, np.ones(len(formulation.A), dtype=bool))
    traded = principal_transform(matrix, is_traded)
    # places with stations in contact: their coordinate is the approach, not the force
    # several stations share the force of their place, so its approach says more than the sum
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
    """Return the values of candidates by the coordinates of their places.

    Raises ValueError if a first pivot is not positive.
    """
    place = formulation.system.place
    local = formulation.local
    # a candidate alone at its place is its coordinate itself, up to the sign
    is_station = ~is_single[place]  # shape (M,)
    gain = np.where(is_station & contact, -1 / local, 1)
    weight = np.abs(gain)
    self_response = np.where(is_station, np.where(contact, 1 / local, local), 0)
    # change of a candidate's value by its own opposite value: the pivot if it changes sides
    unscaled = gain * responses.by_place[place, place] * weight + self_response
    # compliances are positive; another sign means that the contact set lets a part move freely
    if not np.all(unscaled > 0):
        raise ValueError("no pivots to start from")
    return _Pivots(
        gain=gain,
        weight=weight,
        self_response=self_response,
        scale=1 / np.sqrt(unscaled),
    )


def principal_transform(matrix: Array, inside: NDArray[np.bool_]) -> Array:
    """Return a symmetric matrix after arguments and results have traded places inside a set.

    Args:
        matrix: shape (n, n).
        inside: the set, shape (n,).

    Raises ValueError if the block inside has no inverse.
    """
    # the block inside is inverted as one matrix
    order = np.argsort(~inside, kind="stable")  # the set first
    n = int(np.count_nonzero(inside))
    ordered = matrix[order].take(order, axis=1)
    block = ordered[:n, :n]
    coupling = ordered[:n, n:]
    # right sides: the identity, for the inverse, and the coupling to the rows outside
    right = ordered[:n].copy()
    right[:, :n] = np.eye(n)
    solution = np.linalg.solve(block, right)
    inverse = solution[:, :n].copy()
    # the condition of the block is not known before, so the product with the inverse is tested
    residual = right - block @ solution
    if not np.abs(residual[:, :n]).max(initial=0) <= _INVERSE:
        raise ValueError("the contacts do not constrain the parts")
    solution += inverse @ residual  # one step of refinement: without it two digits of the rotation are lost
    across = solution[:, n:]
    # Schur complement: what remains outside once the inside is solved
    ordered[n:, n:] -= coupling.T @ across
    ordered[:n, :n] = solution[:, :n]
    ordered[:n, n:] = -across
    ordered[n:, :n] = across.T
    # rows and columns return to their places
    back = np.argsort(order)
    return ordered[back].take(back, axis=1)
