"""The error as a table over the deviations: F'_ior of very many drives that differ in their deviations alone.

At one torque the error of a state depends on the scalars of its deviations (deviations.py). A table of it over the
four that matter most, the vector of the teeth and that of the cam, interpolated, gives F'_ior in half a millisecond:
enough for thousands of drives. What others add, harmonics or a run-out, is tabled as a slope over the same four. What
interpolation and slopes miss is measured on some of those drives: its mean is put back; how much of it varies from
drive to drive is the table's standard error.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hdassist.error.error_map import SEARCHED, Batch, ErrorMap
from hdassist.errors import UntrustedError
from hdassist.model.contacts import StateGaps
from hdassist.model.deviations import CAM, ODD, SHIFT, TEETH, deviation_scalars, deviations_of, is_half_turn_symmetric
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.run.run import Progress
from hdassist.solve.answers import ARCSEC, EMPTY, N_MM, Certificate
from hdassist.solve.loadcase import LoadCase

SLABS = 8  # tasks that a table is solved in
KNOWN = 40  # drives that a table is compared on
STEP = 0.02  # of the torque, to both sides, over which slopes are taken: contacts that just change are smoothed

DEVIATIONS = ("tolerances.", "phases.", "harmonics.")  # sections of a preset that a table spans


@dataclass(frozen=True)
class Mesh:
    """How fine a table is, and how many drives it is compared on, none where its mean error does not matter.

    shape: points over a, b, e_x, e_y; a, about along the motion, weighs most; turns: positions of each wheel that stand
    for the cycle where F'_ior is read.
    """

    shape: tuple[int, int, int, int] = (25, 9, 25, 25)
    compared: int = KNOWN
    turns: int = 40

    def states(self, drive: Drive) -> int:
        """States that a table of a drive takes, about."""
        solved = 0.403 if is_half_turn_symmetric(drive) else 0.806
        return round(solved * float(np.prod(self.shape))) + self.compared * SEARCHED


FINE = Mesh()
TURNS = FINE.turns


@dataclass(frozen=True)
class Reach:
    """What of the deviation scalars a table spans.

    axes: columns of its four axes, and sizes [mm] as far as they go, shape (4,); others: columns of those that it has
    slopes over, and sizes [mm] over which these are taken.
    """

    axes: tuple[int, ...]
    sizes: Array
    others: tuple[int, ...]
    steps: Array

    @classmethod
    def of(cls, drives: Sequence[Drive]) -> Reach:
        """What drives come to that differ in deviations alone."""
        mark_kind = drives[0].mounting.mark_kind
        greatest: dict[int, float] = {}
        for drive in drives:
            sizes: dict[int, float] = {}
            for each in deviations_of(mark_kind):
                size = abs(each.factor) * drive.number(each.size) * 1e-3
                sizes[each.column] = sizes.get(each.column, 0.0) + size
            greatest = {column: max(greatest.get(column, 0.0), size) for column, size in sizes.items()}
        teeth = SHIFT if mark_kind == "runout" else TEETH
        pair = [_WIDER * max(greatest.get(column, 0.0), _LEAST) for column in (teeth, CAM)]
        rest = sorted(column for column, size in greatest.items() if size and column not in (teeth, CAM))
        steps = [greatest[column] for column in rest]
        axes = (teeth, teeth + 1, CAM, CAM + 1)
        others = tuple(column + k for column in rest for k in (0, 1))
        return cls(axes, np.repeat(pair, 2), others, np.repeat(steps, 2))


_WIDER = 1.001  # so that rounding leaves the outermost inside
_LEAST = 1e-3  # mm: a table needs some width


@dataclass(frozen=True)
class ErrorTable:
    """Error of a drive at a torque over its deviations, interpolated linearly.

    error [arcsec], shape of the mesh, NaN outside of the reach; slopes of it by the other scalars [arcsec/mm], shape
    (others, *shape); turns, positions of each wheel that stand for the cycle; offset [arcsec], what is added to each
    F'_ior; standard_error [arcsec] of an F'_ior.
    """

    M_g: float
    error: Array
    slopes: Array
    reach: Reach
    certificate: Certificate
    turns: int = TURNS
    offset: float = 0.0
    standard_error: float = 0.0

    def rotation(self, scalars: Array) -> Array:
        """Rotation [arcsec], shape (...), from the scalars of states [mm], shape (..., scalars).

        Raises UntrustedError for deviations that the table does not span.
        """
        from scipy.ndimage import map_coordinates  # imported in as much time as a check takes

        reach, given = self.reach, range(scalars.shape[-1])
        along = np.stack([scalars[..., k] if k in given else np.zeros(scalars.shape[:-1]) for k in reach.axes])
        step = 2 * reach.sizes / (np.array(self.error.shape) - 1)
        away = reach.sizes.reshape(-1, *[1] * (along.ndim - 1))
        places = (along + away) / step.reshape(away.shape)
        values = map_coordinates(self.error, places, order=1, cval=np.nan)
        for column, slope in zip(reach.others, self.slopes, strict=True):
            if column in given and scalars[..., column].any():
                values += map_coordinates(slope, places, order=1, cval=np.nan) * scalars[..., column]
        beyond = [k for k in given if k not in reach.axes + reach.others]
        if not np.all(np.isfinite(values)) or scalars[..., beyond].any():
            raise UntrustedError("deviations beyond those that the table of the error spans", "this is a bug")
        return np.asarray(values)

    def F_ior(self, scalars: Array) -> Array:
        """F'_ior [arcsec], shape (...,), from the scalars of its states [mm], shape (..., states, scalars).

        Raises UntrustedError for deviations that the table does not span.
        """
        return self.range_of(self.rotation(scalars))

    def range_of(self, rotation: Array) -> Array:
        """F'_ior [arcsec], shape (...,), from the rotation in states that stand for the cycle, shape (..., states)."""
        return np.asarray(np.ptp(rotation, axis=-1) + self.offset)


def estimates(table: ErrorTable, error_map: ErrorMap, batch: Batch) -> Array:
    """Rotation [arcsec] at the points of a map, of drives whose deviations a table spans, shape (drives, k, l).

    The table's contact system may differ a little from theirs.
    """
    points = error_map.state(error_map.points())
    there = error_map.states.take(points.ravel())
    # one by one, so that arrays stay in the cache
    rows = (np.array([row]) for row in range(len(batch)))
    found = [table.rotation(batch.scalars(row, there.alpha_g, there.alpha_b)) for row in rows]
    return np.reshape(found, (len(batch), *points.shape))


def turns(count: int = TURNS) -> tuple[Array, Array]:
    """Angles alpha_g, alpha_b [rad] of the wheels that stand for the cycle, shape (count**2,) each."""
    angles = 2 * np.pi * np.arange(count) / count
    alpha_g, alpha_b = np.meshgrid(angles, angles, indexing="ij")
    return alpha_g.ravel(), alpha_b.ravel()


def error_tables(
    spans: Sequence[tuple[Drive, Sequence[Drive]]],
    torques: Sequence[float],
    *,
    mesh: Mesh = FINE,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> list[list[ErrorTable]]:
    """Tables of several drives, for each of them one a torque, compared with searches on drives that they span.

    Arguments: spans, each drive with others that differ from it at most in deviations and their phases; torques M_g
    [N*m]; mesh; executor, to spread the work over (any concurrent.futures executor; the numbers do not depend on it);
    progress, told how many states were solved.
    Raises UntrustedError where an answer cannot be trusted, UsageError for a drive that is not searchable.
    """
    cases = [(drive, M_g, Reach.of(span), tuple(span[: mesh.compared])) for drive, span in spans for M_g in torques]
    run = executor.map if executor else map
    slabs = [(drive, M_g, reach, mesh.shape, slab) for drive, M_g, reach, _ in cases for slab in range(SLABS)]
    solved, parts = [], run(_slab, slabs)
    known = run(_searched, [(drive, M_g, span) for drive, M_g, _, span in cases])
    for drive, _, reach, _ in cases:
        values, proof = np.full((1 + len(reach.others), np.prod(mesh.shape)), np.nan), EMPTY
        for _ in range(SLABS):
            places, errors, part = next(parts)
            values[:, places] = errors
            if is_half_turn_symmetric(drive):
                signs = np.array([1, *(-1 if column in ODD else 1 for column in reach.others)])
                values[:, values.shape[1] - 1 - places] = errors * signs[:, None]
            proof += part
            if progress:
                progress(part.states)
        solved.append((values.reshape(-1, *mesh.shape), proof))
    found = []
    for (_, M_g, reach, span), (error, proof), (exact, part) in zip(cases, solved, known, strict=True):
        table = ErrorTable(M_g, error[0], error[1:], reach, proof + part, mesh.turns)
        scalars = [deviation_scalars(d, *turns(mesh.turns)) for d in span]
        found.append(_compared(table, scalars, np.array(exact)) if exact else table)
        if progress:
            progress(part.states)
    return [found[first : first + len(torques)] for first in range(0, len(found), len(torques))]


def _compared(table: ErrorTable, scalars: Sequence[Array], exact: Array) -> ErrorTable:
    missed = exact - np.array([table.F_ior(each) for each in scalars])
    return replace(table, offset=float(missed.mean()), standard_error=float(missed.std(ddof=1)))


_Slab = tuple[Drive, float, Reach, tuple[int, ...], int]


def _slab(task: _Slab) -> tuple[NDArray[np.int64], Array, Certificate]:
    """Places in the flat table, errors [arcsec] and slopes there, and their proof, of one slab of a table."""
    drive, M_g, reach, shape, slab = task
    order = _there_and_back(shape)
    if is_half_turn_symmetric(drive):
        order = order[order <= np.prod(shape) // 2]
    index = np.stack(np.unravel_index(order, shape), axis=1)
    half = (np.array(shape) - 1) / 2
    share = (index - half) / half  # -1..1 over the reach
    step = 1 / half
    # the corners of every cell that the two discs touch
    near = [np.hypot(share[:, k], share[:, k + 1]) <= 1 + np.hypot(step[k], step[k + 1]) for k in (0, 2)]
    chosen = np.array_split(np.flatnonzero(near[0] & near[1]), SLABS)[slab]
    case = LoadCase.of(drive, M_g)
    points = np.zeros((len(chosen), case.system.deviation_map.shape[1]))
    points[:, reach.axes] = share[chosen] * reach.sizes

    def where(k: int) -> str:
        (a, b), (e_x, e_y) = points[k, list(reach.axes)].reshape(2, 2) * 1e3
        return f"tooth vector ({a:.0f}, {b:.0f}) um, cam vector ({e_x:.0f}, {e_y:.0f}) um, M_g = {M_g:g} N*m"

    gaps = StateGaps(points)
    answers = case.solve(gaps, where)
    errors, proof = [answers.rotation_arcsec], answers.certificate
    if reach.others:
        pulls = []
        for way in (1 - STEP, 1 + STEP):
            case.load(way * M_g)
            moved = case.solve(gaps, where, pull=True)
            assert moved.pull_N is not None
            pulls.append(moved.pull_N[:, reach.others])
            proof += moved.certificate
        errors += list((pulls[1] - pulls[0]).T / (2 * STEP * M_g * N_MM) * ARCSEC)
    return order[chosen], np.array(errors), proof


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
    if not span:
        return [], EMPTY
    error_map = ErrorMap(drive, M_g)
    found = [error_map.many_extremes(Batch.of(other)) for other in span]
    return [f.first for f in found], sum((f.certificate for f in found), EMPTY)
