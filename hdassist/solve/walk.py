"""The compiled walk (walk.c): states of one contact system at one torque, solved, summed and certified in C."""

from __future__ import annotations

import ctypes
import platform
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hdassist.model.contacts import StateGaps
from hdassist.model.geometry import Array
from hdassist.run.cache import program
from hdassist.solve.answers import Residuals, StateSums
from hdassist.solve.build import SOURCE, development_folder, library_name, source_hash
from hdassist.solve.climb import Points, Rules, Starts, Torus
from hdassist.solve.formulation import Formulation, Reference
from hdassist.solve.pivoting import NEAR_STEPS, SOFT

INSTRUCTIONS = {4: "AVX-512", 3: "AVX2", 1: "any machine"}


@cache
def walk_library() -> tuple[Any, str]:
    """The compiled walk for this machine, None where there is none, and words for which one it is or why not."""
    for folder in (Path(__file__).parent, development_folder()):
        if not (folder / library_name(1)).exists():
            continue
        try:
            level = _opened(folder / library_name(1)).walk_level()
            library = folder / library_name(level)
            source = _opened(library).walk_source().decode()
        except OSError as error:
            return None, f"the compiled walk can't be loaded: {error}"
        if source != source_hash():
            return None, f"the compiled walk is older than {SOURCE.name}: install hdassist again"
        return _load(library), f"compiled walk, {INSTRUCTIONS[level]}"
    return None, "numpy: no compiled walk in this installation (no C compiler when it was made)"


def installation() -> tuple[str, ...]:
    """All that an answer depends on in this process, but for the machine: source, versions, engine."""
    return (*program("cvxpy", "daqp"), "compiled" if walk_library()[0] else "numpy")


def digits_depend_on() -> tuple[str, ...]:
    """All that the last digits of an answer depend on, beside the question."""
    return (*program("daqp", "pydantic"), walk_library()[1], platform.platform())


def _opened(path: Path) -> Any:
    """A library that says which source it is of: one of another source may lack functions."""
    opened: Any = ctypes.CDLL(str(path))
    opened.walk_source.restype = ctypes.c_char_p
    return opened


# of each function what it returns and takes: p pointer, i int, l long, d double, - nothing
_FUNCTIONS = {
    "walk_new": "ppp", "walk_free": "-p", "walk_solve": "lpldipppppppp", "walk_climb": "lpdipppdplppppppp",
    "walk_near": "iiiippppppdippp", "walk_read": "-lippppp",
}  # fmt: skip


def _load(path: Path) -> Any:
    """A library of this source, with the types of its functions."""
    loaded = _opened(path)
    kinds = {"p": ctypes.c_void_p, "i": ctypes.c_int, "l": ctypes.c_long, "d": ctypes.c_double, "-": None}
    for name, letters in _FUNCTIONS.items():
        function, (result, *arguments) = getattr(loaded, name), (kinds[letter] for letter in letters)
        function.argtypes, function.restype = arguments, result
    return loaded


class Walk:
    """The compiled walk of one contact system."""

    climbed = 0  # states that climbs of all solved, and none proved: for studies

    def __init__(self, reference: Reference) -> None:
        self._library, _ = walk_library()
        self._reference = reference
        addresses = [array.ctypes.data for array in reference.held.values()]
        sizes, arrays = (ctypes.c_int32 * len(reference.sizes)), (ctypes.c_void_p * len(addresses))
        self._walk = self._library.walk_new(sizes(*reference.sizes), arrays(*addresses))
        if not self._walk:
            raise MemoryError

    def __del__(self) -> None:
        if getattr(self, "_walk", None):
            self._library.walk_free(self._walk)

    def solve(self, gaps: StateGaps, torque: float, *, slope: bool = False) -> StateSums:
        """Sums and residuals of states; NaN where one was given up.

        Arguments: gaps; torque [N*mm]; slope, whether the slope of the rotation by the scalars is asked for.
        """
        scalars = np.ascontiguousarray(gaps.scalars, dtype=float)
        count, p = scalars.shape
        rotation, tooth_force = np.empty((2, count))
        moment, residual = np.empty((count, 2)), np.empty((count, 4))
        slopes = np.empty((count, p)) if slope else None
        sums = rotation, moment, tooth_force, residual, slopes
        arrays = (scalars, *self._reference.of_teeth(gaps), *sums)  # held until the call has ended
        given_up = self._library.walk_solve(self._walk, count, torque, p, *map(_address, arrays))
        return StateSums(rotation, moment, tooth_force, Residuals(residual), slopes, given_up)

    def climb(self, torus: Torus, torque: float, hills: Starts, rules: Rules) -> Points:
        """`climbed` of climb.py, compiled; a state that is given up counts as none."""
        (_, z_b, p), z_g, groups = torus.by_b.shape, torus.by_g.shape[1], len(hills.row)
        sizes, radius = [z_b, z_g, torus.finest, rules.steps, len(rules.radius) - 1], rules.radius
        first, top = np.append(hills.first, len(hills.point)), np.empty((groups, 2), dtype=np.int32)
        of_hills = first, hills.row, hills.sign, hills.point
        whole = [np.ascontiguousarray(each, np.int32) for each in (sizes, radius, *of_hills)]
        parts = [np.ascontiguousarray(part) for part in (torus.by_b, torus.by_g, hills.rotation, hills.slope)]
        begun = torque, p, _address(whole[0]), *map(_address, parts[:2]), rules.gain, _address(whole[1])
        states = map(_address, (*whole[2:], *parts[2:], top))
        solved = self._library.walk_climb(self._walk, *begun, groups, *states)
        if solved < 0:
            raise MemoryError
        Walk.climbed += solved
        return top.astype(np.int64)


def walk_near_state(
    formulation: Formulation, gaps: Array, right: Array, contact: NDArray[np.bool_]
) -> tuple[Array, Array] | None:
    """solve_near of near.py, compiled."""
    system = formulation.system
    ends = np.append(system.first, len(gaps)).astype(np.int32)
    held, forces, duals = contact.astype(np.uint8), np.empty(len(gaps)), np.empty(len(right))
    data = (formulation.H, formulation.local, ends, formulation.A, np.ascontiguousarray(gaps), right)
    sizes = len(gaps), len(system.first), len(right)
    made = map(_address, (held, forces, duals))
    found = walk_library()[0].walk_near(*sizes, *map(_address, data), SOFT, NEAR_STEPS, *made)
    return (forces, duals) if found else None


def read_table(table: Array, places: Array, factors: Array) -> Array:
    """Values of a table between its points, shape (points,), interpolated linearly over its axes; NaN beyond its ends.

    Arguments: table, at each point a value and its slopes by factors, shape (*axes, 1 + factors), of four axes;
    places along these, shape (points, 4); factors, shape (points, factors).
    """
    table, places, factors = map(np.ascontiguousarray, (table, places, factors))
    if library := walk_library()[0]:
        shape, values = np.array(table.shape[:-1], dtype=np.int32), np.empty(len(places))
        library.walk_read(len(places), table.shape[-1], *map(_address, (shape, table, places, factors, values)))
        return values
    from scipy.ndimage import map_coordinates  # imported in as much time as a check takes

    value, *slopes = (map_coordinates(part, places.T, order=1, cval=np.nan) for part in np.moveaxis(table, -1, 0))
    return np.asarray(value + (np.transpose(slopes) * factors).sum(axis=1))


def _address(array: Any) -> int | None:
    return None if array is None else array.ctypes.data
