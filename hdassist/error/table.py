"""The error as a table over the deviations: F'_ior of very many drives that differ in their deviations alone.

At one torque the error of a state depends on the scalars of its deviations (deviations.py). A table of it over the
four that matter most, the vector of the teeth and that of the cam, interpolated, gives F'_ior in some 0.05 ms: enough
for thousands of drives. What others add, harmonics or a run-out, is tabled as a slope over the same four. F'_ior read
off it is somewhat too small, because peaks are cut off, by nearly the same share for all drives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.error.error_map import ErrorMap
from hdassist.errors import UntrustedError
from hdassist.model.contacts import StateGaps
from hdassist.model.deviations import (
    CAM_COLUMNS,
    ODD_COLUMNS,
    SHIFT,
    TEETH,
    column_of,
    factor_of,
    is_half_turn_symmetric,
    scalars_of,
    waves_of,
)
from hdassist.model.geometry import Array
from hdassist.preset.deviations import DEVIATIONS
from hdassist.preset.fields import Drive
from hdassist.solve.answers import ARCSEC, EMPTY, N_MM, Certificate
from hdassist.solve.loadcase import LoadCase

TABLE_TORQUE_STEP = (
    0.02  # of the torque, to both sides, where slopes are taken and errors averaged: contacts that change are smoothed
)
READ_AT_ONCE = 16  # drives, so that arrays stay in the processor's cache
WIDER_SPAN = 1.001  # so that rounding leaves the outermost drive inside
LEAST_REACH = 1e-3  # mm: a table needs some width

TABLE_SECTIONS = ("tolerances.", "phases.", "harmonics.")  # sections of a preset that a table spans


@dataclass(frozen=True)
class Mesh:
    """How fine a table is.

    shape: points over a, b, e_x, e_y; a, about along the motion, weighs most; turns: positions of each wheel that stand
    for the cycle where F'_ior is read.
    """

    shape: tuple[int, int, int, int] = (25, 9, 13, 13)
    turns: int = 24

    def states(self, drive: Drive) -> int:
        """States that a table of a drive takes, about, without slopes."""
        solved = 0.403 if is_half_turn_symmetric(drive) else 0.806
        return round(solved * float(np.prod(self.shape)))


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
    def of(cls, drive: Drive) -> Reach:
        """What a drive comes to in any direction of its deviations."""
        mark_kind = drive.mounting.mark_kind
        sizes: dict[int, float] = {}
        for each in DEVIATIONS:
            column = column_of(each, mark_kind)
            size = abs(factor_of(each, mark_kind)) * drive.number(each.size) * 1e-3
            sizes[column] = sizes.get(column, 0.0) + size
        teeth = SHIFT if mark_kind == "runout" else TEETH
        pair = [WIDER_SPAN * max(sizes.get(column, 0.0), LEAST_REACH) for column in (teeth, CAM_COLUMNS)]
        rest = sorted(column for column, size in sizes.items() if size and column not in (teeth, CAM_COLUMNS))
        axes = (teeth, teeth + 1, CAM_COLUMNS, CAM_COLUMNS + 1)
        others = tuple(column + k for column in rest for k in (0, 1))
        return cls(axes, np.repeat(pair, 2), others, np.repeat([sizes[column] for column in rest], 2))


@dataclass(frozen=True)
class ErrorTable:
    """Error of drives that share a contact system, at a torque, over their deviations, interpolated linearly.

    drive, what they have in common; error [arcsec], shape of the mesh, NaN outside of the reach; slopes of it by the
    other scalars [arcsec/mm], shape (others, *shape); turns, positions of each wheel that stand for the cycle.
    """

    drive: Drive
    error: Array
    slopes: Array
    reach: Reach
    turns: int
    certificate: Certificate

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

    def F_ior(self, values: Mapping[str, Array]) -> Array:
        """F'_ior [arcsec] of drives, shape (drives,).

        Arguments: values of their deviations by path, shape (drives,) each. Raises UntrustedError for
        deviations that the table does not span.
        """
        angles, drive = 2 * np.pi * np.arange(self.turns) / self.turns, self.drive
        alpha_g, alpha_b = (alpha.ravel() for alpha in np.meshgrid(angles, angles, indexing="ij"))
        drives = {path: column[:, None] for path, column in values.items()}
        waves = waves_of(lambda path: drives.get(path, drive.number(path)), drive.mounting.mark_kind)
        ranges = []
        for k in range(0, len(next(iter(values.values()))), READ_AT_ONCE):
            some = {key: wave[k : k + READ_AT_ONCE] if np.ndim(wave) else wave for key, wave in waves.items()}
            ranges.append(np.ptp(self.rotation(scalars_of(some, alpha_g, alpha_b)), axis=-1))
        return np.concatenate(ranges)


def error_table(error_map: ErrorMap, reach: Reach, mesh: Mesh) -> ErrorTable:
    """Table of the error of drives that share a contact system, at the torque of their map.

    Raises UntrustedError where an answer cannot be trusted.
    """
    drive, M_g = error_map.drive, error_map.M_g
    shape, symmetric = mesh.shape, is_half_turn_symmetric(drive)
    order = _there_and_back(shape)
    if symmetric:
        order = order[order <= np.prod(shape) // 2]
    index = np.stack(np.unravel_index(order, shape), axis=1)
    half = (np.array(shape) - 1) / 2
    share, step = (index - half) / half, 1 / half  # -1..1 over the reach
    # the corners of every cell that the two discs touch
    near = [np.hypot(share[:, k], share[:, k + 1]) <= 1 + np.hypot(step[k], step[k + 1]) for k in (0, 2)]
    chosen = np.flatnonzero(near[0] & near[1])
    case = LoadCase(error_map.fresh.formulation, M_g, like=error_map.fresh, many=True)
    points = np.zeros((len(chosen), case.system.deviation_map.shape[1]))
    points[:, reach.axes] = share[chosen] * reach.sizes

    def where(k: int) -> str:
        (a, b), (e_x, e_y) = points[k, list(reach.axes)].reshape(2, 2) * 1e3
        return f"tooth vector ({a:.0f}, {b:.0f}) um, cam vector ({e_x:.0f}, {e_y:.0f}) um, M_g = {M_g:g} N*m"

    gaps, proof, solved = StateGaps(points), EMPTY, []
    for way in (1 - TABLE_TORQUE_STEP, 1 + TABLE_TORQUE_STEP) if reach.others else (1.0,):
        case.load(way * M_g)
        solved.append(case.solve(gaps, where, pull=bool(reach.others)))
        proof += solved[-1].certificate
    errors = [np.mean([each.rotation_arcsec for each in solved], axis=0)]
    if reach.others:
        less, more = (each.pull_N[:, reach.others] for each in solved if each.pull_N is not None)
        errors += list((more - less).T / (2 * TABLE_TORQUE_STEP * M_g * N_MM) * ARCSEC)
    values = np.full((1 + len(reach.others), np.prod(shape)), np.nan)
    values[:, order[chosen]] = errors
    if symmetric:
        signs = np.array([1, *(-1 if column in ODD_COLUMNS else 1 for column in reach.others)])
        values[:, values.shape[1] - 1 - order[chosen]] = np.array(errors) * signs[:, None]
    found = values.reshape(-1, *shape)
    return ErrorTable(drive, found[0], found[1:], reach, mesh.turns, proof)


def _there_and_back(shape: Sequence[int]) -> NDArray[np.int64]:
    """Flat places of a grid in an order in which each is next to the one before."""
    index = np.stack(np.unravel_index(np.arange(np.prod(shape)), shape), axis=1)
    path = index.copy()
    for axis in range(1, len(shape)):
        back = path[:, :axis].sum(axis=1) % 2 == 1
        path[:, axis] = np.where(back, shape[axis] - 1 - index[:, axis], index[:, axis])
    return np.asarray(np.ravel_multi_index(tuple(path.T), tuple(shape)))
