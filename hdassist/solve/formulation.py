"""The contact problem of a drive as one convex quadratic programme, stated once, in cvxpy.

System (1) is the optimality condition of

    minimise    1/2 F' (D + G_s C_s^-1 G_s') F + delta_p' F
    subject to  G_f' F + b_f = 0,   F >= 0

with s the supported freedoms, condensed, and f those without support: the multipliers of their
equilibrium are their displacements. Everything that solves it starts from this statement.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from functools import cache, cached_property
from hashlib import sha256
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hdassist.model.contacts import ROTATION, ContactSystem, StateGaps
from hdassist.model.geometry import Array

if TYPE_CHECKING:
    import cvxpy as cp

_INVERSE = 1e-6  # error of a product that should be the identity
_MICROMETRE = 1e-3  # mm: gaps of the scaled programme are of order one in it


@dataclass(frozen=True)
class _Units:
    """Units of the scaled programme, chosen so that its numbers are of order one.

    gap [mm]; force [N], which closes a gap unit on the stiffest station of a tooth; load, shape (free,): length that
    scales each equilibrium row (1 for a force, r_m in mm for the moment).
    """

    gap: float
    force: float
    load: Array


@dataclass(frozen=True)
class Springs:
    """Candidates in contact at one place, springs side by side, as one, shape (m,), in units of the programme.

    series: compliance, 0 where none is in contact; offset: how far it closes before it pushes, beyond lowest, the gap
    of the first candidate there; above: the gap of each candidate beyond that, shape (M,).
    """

    series: Array
    offset: Array
    lowest: Array
    above: Array

    @classmethod
    def of(cls, formulation: Formulation, gaps: Array, contact: NDArray[np.bool_]) -> Springs:
        """Springs of candidates in contact, shape (M,), with gaps without force, shape (M,)."""
        place = formulation.system.place
        first = formulation.system.first
        stiffness = contact / formulation.local
        at_places = np.add.reduceat(stiffness, first)
        series = np.divide(1, at_places, out=np.zeros(len(first)), where=at_places > 0)
        above = gaps - gaps[first][place]  # so that a place with one candidate has 0, not a difference of large numbers
        return cls(series, np.add.reduceat(stiffness * above, first) * series, gaps[first], above)


@dataclass(frozen=True)
class _Statement:
    """The programme in cvxpy, DPP in the parameters gaps and load.

    forces: variable, shape (M,), in units.force, whose sums at the places are a variable of their own: the structure
    knows no others, and M coupled variables take solvers three to five times as long; gaps: parameter delta_p, shape
    (M,), in units.gap; load: parameter b_f, shape (free,), in units.force * units.load; equilibrium: the constraint
    whose dual is the displacement of the free freedoms in units.gap / units.load.
    """

    problem: cp.Problem
    forces: cp.Variable
    gaps: cp.Parameter
    load: cp.Parameter
    equilibrium: cp.Constraint


@dataclass(frozen=True)
class Formulation:
    """The programme of one contact system: minimise 1/2 x' P x + gaps' x subject to A x + load = 0, x >= 0.

    P is H, compliance between the places of structure and supports together, shape (m, m), and on the diagonal local,
    that of each candidate by itself, shape (M,); A is given at the places, shape (free, m), of which candidates have
    copies; all in units. references: solutions of the engines, by the torque [N*mm].
    """

    system: ContactSystem
    units: _Units
    H: Array
    local: Array
    A: Array
    references: dict[float, Reference | None] = field(default_factory=dict, init=False, repr=False, compare=False)

    @cached_property
    def digest(self) -> bytes:
        """SHA-256 of all numbers of the programme."""
        digest = sha256()
        units = self.units.load, np.array([self.units.gap, self.units.force])
        for array in (self.H, self.local, self.A, self.system.place, *units):
            digest.update(f"{array.shape}".encode() + array.tobytes())
        return digest.digest()

    @cached_property
    def P(self) -> Array:
        """Compliance between candidates, shape (M, M)."""
        place = self.system.place
        return np.asarray(self.H[np.ix_(place, place)] + np.diag(self.local))

    @cached_property
    def structure(self) -> Array:
        """H and A in one symmetric matrix of forces at the places and displacements, shape (m + free, m + free)."""
        m = len(self.H)
        n = len(self.H) + len(self.A)
        matrix = np.zeros((n, n))
        matrix[:m, :m] = self.H
        matrix[:m, m:] = self.A.T
        matrix[m:, :m] = self.A
        return matrix

    @cached_property
    def statement(self) -> _Statement:
        """The programme in cvxpy; stated when first asked for, as cvxpy takes a second to import."""
        from scipy.sparse import csr_array, diags_array

        cp = imported_cvxpy()
        M = len(self.local)
        m = len(self.H)
        forces = cp.Variable(M, name="F", nonneg=True)
        at_places = cp.Variable(m, name="F_places")
        gaps = cp.Parameter(M, name="delta_p")
        load = cp.Parameter(len(self.A), name="b")
        of_structure = 0.5 * cp.quad_form(at_places, cp.psd_wrap(self.H))
        of_candidates = 0.5 * cp.quad_form(forces, cp.psd_wrap(diags_array(self.local)))
        equilibrium = self.A @ at_places + load == 0
        sums = csr_array((np.ones(M), (self.system.place, np.arange(M))), shape=(m, M))
        constraints = [equilibrium, sums @ forces - at_places == 0]
        problem = cp.Problem(cp.Minimize(of_candidates + of_structure + gaps @ forces), constraints)
        return _Statement(problem=problem, forces=forces, gaps=gaps, load=load, equilibrium=equilibrium)

    def gaps(self, delta_p: Array) -> Array:
        """Gaps without force [mm], shape (..., M), in units of the programme."""
        return delta_p / self.units.gap

    def load(self, torque: float) -> Array:
        """Load of a torque on the flexspline [N*mm], positive counter-clockwise, in units of the programme, (free,)."""
        turning = np.arange(len(self.A)) == self.system.free_rotation
        return np.asarray(torque * turning / (self.units.force * self.units.load))

    def answer(self, forces: Array, duals: Array) -> tuple[Array, Array]:
        """Forces [N] and displacements of the free freedoms [mm, rad] of a solution in units of the programme."""
        return forces * self.units.force, duals * (self.units.gap / self.units.load)


@cache
def imported_cvxpy() -> Any:
    """The module cvxpy, imported without scipy.stats, which takes more than half of that time.

    cvxpy has the value of one atom from there, which no programme of ours has: it is imported when that is asked for,
    and at once where cvxpy asks for more.
    """
    name = "scipy.stats"
    stand_in = ModuleType("scipy.stats")

    def of_stats(wanted: str) -> Any:
        if wanted.startswith("__"):  # asked for by the import itself
            raise AttributeError(wanted)
        if sys.modules.get(name) is stand_in:
            del sys.modules[name]
        return getattr(import_module(name), wanted)

    vars(stand_in).update(__getattr__=of_stats, entropy=lambda *values, **more: of_stats("entropy")(*values, **more))
    sys.modules.setdefault(name, stand_in)
    try:
        return import_module("cvxpy")
    finally:
        if sys.modules.get(name) is stand_in:
            del sys.modules[name]


def formulate(system: ContactSystem) -> Formulation:
    """State the programme of a contact system."""
    supported = system.supported
    free = ~system.supported
    at_supports = system.G[system.first][:, supported]
    load_units = np.where(np.arange(len(free)) == ROTATION, system.geometry.r_m, 1.0)[free]
    # the softest instead makes Clarabel give up coned flanks at light torques
    stiffest = float(system.face.compliance.min())
    units = _Units(gap=_MICROMETRE, force=_MICROMETRE / stiffest, load=load_units)
    H = (at_supports / system.C[supported]) @ at_supports.T
    H += system.compliance
    H *= units.force / units.gap
    return Formulation(
        system,
        units,
        H=H,
        local=system.local * (units.force / units.gap),
        A=np.ascontiguousarray((system.G[system.first][:, free] / load_units).T),
    )


class Reference:
    """The programme solved at one contact set for the coordinates that the walk knows a state by, one for each place.

    The coordinate of a place with a single candidate is its value (its force in contact, its gap else), of one with
    stations the approach, in units of the programme; those of the free freedoms, their displacements, come last.
    held: as contact_system of walk.c describes, in its order; sizes: the numbers before them.
    Arguments: formulation; contact, candidates that carry force in a state near those asked for, shape (M,). Raises
    ValueError where that set does not hold the parts in place.
    """

    def __init__(self, formulation: Formulation, contact: NDArray[np.bool_]) -> None:
        system = formulation.system
        units = formulation.units
        local = formulation.local
        place = system.place
        first = system.first
        free = len(formulation.A)
        m = len(system.first)
        springs = Springs.of(formulation, formulation.gaps(system.delta_p), contact)
        touching = springs.series > 0
        alone = np.bincount(place) == 1
        # in series with the structure: springs in contact; the compliance of a candidate that stands alone and is open
        series = np.where(touching, springs.series, np.where(alone, local[first], 0))
        matrix = formulation.structure.copy()
        matrix[np.arange(m), np.arange(m)] += series
        exchanged = principal_transform(matrix, np.append(touching, np.ones(free, dtype=bool)))
        stations = np.flatnonzero(touching & ~alone)  # places whose coordinate is the approach
        exchanged[stations] *= -series[stations, None]
        by_places = exchanged[:, :m].copy()
        by_right = exchanged[:, m:]
        by_places[:, stations] *= series[stations]
        by_places[stations, stations] += series[stations]
        along = ~alone[place]
        gain = np.where(along & contact, -1 / local, 1)
        weight = np.abs(gain)
        own = np.where(along, np.where(contact, 1 / local, local), 0)
        unscaled = gain * by_places[place, place] * weight + own
        if not np.all(unscaled > 0):
            raise ValueError("no pivots to start from")
        scale = 1 / np.sqrt(unscaled)  # makes the reference's pivots one
        map_ = system.deviation_map[first].T
        self._gap_unit = units.gap
        self._touching = touching
        self._by_gaps = -exchanged[:, :m][:, touching].T
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
    # those inside first
    order = np.argsort(~inside, kind="stable")
    n = int(np.count_nonzero(inside))
    ordered = matrix[order].take(order, axis=1)
    block = ordered[:n, :n]
    coupling = ordered[:n, n:]
    right = ordered[:n].copy()
    right[:, :n] = np.eye(n)
    both = np.linalg.solve(block, right)
    inverse = both[:, :n].copy()
    rest = right - block @ both
    if not np.abs(rest[:, :n]).max(initial=0) <= _INVERSE:
        raise ValueError("the contacts do not constrain the parts")
    both += inverse @ rest  # refined: without it two digits of the rotation are lost
    across = both[:, n:]
    ordered[n:, n:] -= coupling.T @ across
    ordered[:n, :n] = both[:, :n]
    ordered[:n, n:] = -across
    ordered[n:, :n] = across.T
    back = np.argsort(order)
    return ordered[back].take(back, axis=1)
