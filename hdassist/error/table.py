"""The error as a table over the deviations: F'_ior of very many drives that differ in their deviations alone.

At one torque the error of a state depends on four numbers, the tooth vector and the cam vector (deviations.py).
A table of it over those four, interpolated, gives F'_ior in half a millisecond: enough for thousands of drives.
What interpolation cuts off its peaks is measured on some of those drives and put back; how much of it varies from
drive to drive is the table's standard error.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from hdassist.error.search import SEARCHED, CycleSearch
from hdassist.errors import UntrustedError
from hdassist.model.deviations import deviation_scalars
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate, Progress
from hdassist.solve.loadcase import LoadCase

SHAPE = (25, 9, 25, 25)  # points over a, b, e_x, e_y; a, about along the motion, weighs most
SLABS = 8  # tasks that a table is solved in
TURNS = 40  # positions of each wheel that stand for the cycle
KNOWN = 40  # drives that a table is compared on
STATES = 56_700 + KNOWN * SEARCHED  # that a table takes, about

DEVIATIONS = ("tolerances.", "phases.")  # sections of a preset that a table spans


@dataclass(frozen=True)
class ErrorTable:
    """Error of a drive at a torque over its deviations, interpolated linearly.

    error [arcsec], shape SHAPE, NaN outside of the reach; reach [mm] of the four axes; offset [arcsec], what is
    added to each F'_ior; standard_error [arcsec] of an F'_ior.
    """

    M_g: float
    error: Array
    reach: Array
    certificate: Certificate
    offset: float = 0.0
    standard_error: float = 0.0

    def rotation(self, scalars: Array) -> Array:
        """Rotation [arcsec], shape (...), from the scalars of states [mm], shape (..., 4).

        Raises UntrustedError for deviations that the table does not span.
        """
        step = 2 * self.reach / (np.array(self.error.shape) - 1)
        places = np.moveaxis((scalars + self.reach) / step, -1, 0)
        values = map_coordinates(self.error, places, order=1, cval=np.nan)
        if not np.all(np.isfinite(values)):
            raise UntrustedError("deviations beyond those that the table of the error spans", "this is a bug")
        return np.asarray(values)

    def F_ior(self, scalars: Array) -> Array:
        """F'_ior [arcsec], shape (...,), from the scalars of its states [mm], shape (..., states, 4).

        Raises UntrustedError for deviations that the table does not span.
        """
        return self.range_of(self.rotation(scalars))

    def range_of(self, rotation: Array) -> Array:
        """F'_ior [arcsec], shape (...,), from the rotation in states that stand for the cycle, shape (..., states)."""
        return np.asarray(np.ptp(rotation, axis=-1) + self.offset)


def turns() -> tuple[Array, Array]:
    """Angles alpha_g, alpha_b [rad] of the wheels that stand for the cycle, shape (TURNS**2,) each."""
    angles = 2 * np.pi * np.arange(TURNS) / TURNS
    alpha_g, alpha_b = np.meshgrid(angles, angles, indexing="ij")
    return alpha_g.ravel(), alpha_b.ravel()


def reach_of(drives: Iterable[Drive]) -> tuple[float, float]:
    """Greatest tooth vector and greatest cam vector [mm] that drives come to."""
    sizes = [
        ((t.F_i1 + t.F_i2) / 2e3, (t.e_hh + t.e_hg + t.e_hb) / 1e3) for t in (drive.tolerances for drive in drives)
    ]
    tooth, cam = np.max(sizes, axis=0)
    return _WIDER * max(tooth, _LEAST), _WIDER * max(cam, _LEAST)


_WIDER = 1.001  # so that rounding leaves the outermost inside
_LEAST = 1e-3  # mm: a table needs some width


def error_tables(
    spans: Sequence[tuple[Drive, Sequence[Drive]]],
    torques: Sequence[float],
    *,
    compared: int = KNOWN,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> list[list[ErrorTable]]:
    """Tables of several drives, for each of them one a torque, compared with searches on drives that they span.

    Arguments: spans, each drive with others that differ from it at most in deviations and their phases; torques M_g
    [N*m]; compared, how many of those others are enough; executor, to spread the work over (any concurrent.futures
    executor; the numbers do not depend on it); progress, told how many states were solved.
    Raises UntrustedError where an answer cannot be trusted, UsageError for a drive that is not searchable.
    """
    cases = [(drive, M_g, reach_of(span), tuple(span[:compared])) for drive, span in spans for M_g in torques]
    run = executor.map if executor else map
    slabs = [(drive, M_g, reach, slab) for drive, M_g, reach, _ in cases for slab in range(SLABS)]
    solved, parts = [], run(_slab, slabs)
    known = run(_searched, [(drive, M_g, span) for drive, M_g, _, span in cases])
    for _ in cases:
        values, proof = np.full(np.prod(SHAPE), np.nan), EMPTY
        for _ in range(SLABS):
            places, errors, part = next(parts)
            values[places] = errors
            values[len(values) - 1 - places] = errors  # all deviations reversed: half a turn on, the same rotation
            proof += part
            if progress:
                progress(part.states)
        solved.append((values.reshape(SHAPE), proof))
    found = []
    for (_, M_g, reach, span), (error, proof), (exact, part) in zip(cases, solved, known, strict=True):
        table = ErrorTable(M_g, error, np.repeat(reach, 2), proof + part)
        found.append(_compared(table, np.array([deviation_scalars(d, *turns()) for d in span]), np.array(exact)))
        if progress:
            progress(part.states)
    return [found[first : first + len(torques)] for first in range(0, len(found), len(torques))]


def _compared(table: ErrorTable, scalars: Array, exact: Array) -> ErrorTable:
    missed = exact - table.F_ior(scalars)
    return replace(table, offset=float(missed.mean()), standard_error=float(missed.std(ddof=1)))


_Slab = tuple[Drive, float, tuple[float, float], int]


def _slab(task: _Slab) -> tuple[NDArray[np.int64], Array, Certificate]:
    """Places in the flat table, errors [arcsec] there and their proof, of one slab of half a table."""
    drive, M_g, reach, slab = task
    order = _there_and_back(SHAPE)
    order = order[order <= np.prod(SHAPE) // 2]
    index = np.stack(np.unravel_index(order, SHAPE), axis=1)
    half = (np.array(SHAPE) - 1) / 2
    share = (index - half) / half  # -1..1 over the reach
    step = 1 / half
    # the corners of every cell that the two discs touch
    near = [np.hypot(share[:, k], share[:, k + 1]) <= 1 + np.hypot(step[k], step[k + 1]) for k in (0, 2)]
    chosen = np.array_split(np.flatnonzero(near[0] & near[1]), SLABS)[slab]
    points = share[chosen] * np.repeat(reach, 2)
    case = LoadCase.of(drive, M_g)

    def where(k: int) -> str:
        a, b, e_x, e_y = points[k] * 1e3
        return f"tooth vector ({a:.0f}, {b:.0f}) um, cam vector ({e_x:.0f}, {e_y:.0f}) um, M_g = {M_g:g} N*m"

    answers = case.solve(case.system.gaps(points), where)
    return order[chosen], answers.rotation_arcsec, answers.certificate


def _there_and_back(shape: Sequence[int]) -> NDArray[np.int64]:
    """Flat places of a grid in an order in which each is next to the one before."""
    index = np.stack(np.unravel_index(np.arange(np.prod(shape)), shape), axis=1)
    path = index.copy()
    for axis in range(1, len(shape)):
        back = path[:, :axis].sum(axis=1) % 2 == 1
        path[:, axis] = np.where(back, shape[axis] - 1 - index[:, axis], index[:, axis])
    return np.asarray(np.ravel_multi_index(tuple(path.T), tuple(shape)))


def _searched(task: tuple[Drive, float, Sequence[Drive]]) -> tuple[list[float], Certificate]:
    drive, M_g, span = task
    search = CycleSearch(drive, M_g)
    found = [search.extremes(other) for other in span]
    return [f.F_ior_arcsec for f in found], sum((f.certificate for f in found), EMPTY)
