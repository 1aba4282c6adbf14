"""The error as a table over the deviations: F'_ior of very many drives that differ in their deviations alone.

At one torque the error of a state depends on the scalars of its deviations (deviations.py). A table of it over the
four that matter most, the vector of the teeth and that of the cam, with its slopes by all of them, gives F'_ior in some
0.05 ms: enough for thousands of drives. Others, harmonics or a run-out, count by their slopes. F'_ior read off it is
somewhat too small, because peaks are cut off, by nearly the same share for all drives. Orders beyond the fourth are
laid on top by their mean slopes, at more positions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from hdassist.error.error_map import Batch, ErrorMap, there_and_back
from hdassist.errors import UntrustedError
from hdassist.model.contacts import TOOTH_ORDERS, StateGaps
from hdassist.model.deviations import (
    CAM_COLUMNS,
    ODD_COLUMNS,
    SHIFT,
    SMOOTH_SCALARS,
    TEETH,
    column_of,
    factor_of,
    is_half_turn_symmetric,
)
from hdassist.model.geometry import Array
from hdassist.preset.fields import DEVIATIONS, Drive
from hdassist.solve.answers import Certificate
from hdassist.solve.walk import read_table

_READ_AT_ONCE = 16  # drives, so that arrays stay in the processor's cache
_WIDER_SPAN = 1.001  # so that rounding leaves the outermost drive inside
_ROUGH_TURNS = 48  # positions of each wheel where orders beyond the fourth are added, by their mean slopes
_LEAST_REACH = 1e-3  # mm: a table needs some width
DEVIATION_SCALARS = 6 + 2 * len(TOOTH_ORDERS)

_UNSPANNED = "deviations beyond those that the table of the error spans", "this is a bug"

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
    """The part of the deviation scalars that a table spans.

    axes: columns of its four axes, and sizes [mm] as far as they go, shape (4,); others: columns of those that it has
    slopes over.
    """

    axes: tuple[int, ...]
    sizes: Array
    others: tuple[int, ...]

    @classmethod
    def of(cls, drive: Drive) -> Reach:
        """F'_ior of a drive in any direction of its deviations."""
        mark_kind = drive.mounting.mark_kind
        teeth = SHIFT if mark_kind == "runout" else TEETH
        sizes = dict.fromkeys((teeth, CAM_COLUMNS), 0.0)
        for each in DEVIATIONS:
            if size := abs(factor_of(each, drive)) * drive.number(each.size) * 1e-3:
                column = column_of(each, mark_kind)
                sizes[column] = sizes.get(column, 0.0) + size
        spans = [_WIDER_SPAN * max(sizes.pop(column), _LEAST_REACH) for column in (teeth, CAM_COLUMNS)]
        axes = (teeth, teeth + 1, CAM_COLUMNS, CAM_COLUMNS + 1)
        return cls(axes, np.repeat(spans, 2), tuple(column + k for column in sorted(sizes) for k in (0, 1)))


@dataclass(frozen=True)
class ErrorTable:
    """Error of drives that share a contact system, at a torque, over their deviations, interpolated.

    drive, all that they have in common; error [arcsec], shape of the mesh, NaN outside of the reach; slopes of it
    [arcsec/mm] by the scalars of the axes, then by the others, shape (4 + others, *shape); turns, positions of each
    wheel that stand for the cycle.
    """

    drive: Drive
    error: Array
    slopes: Array
    reach: Reach
    turns: int
    certificate: Certificate

    @cached_property
    def _rows(self) -> Array:
        """Value and slopes that rotation weighs, shape (*mesh, 5 + others).

        Between two points of the mesh lies the mean of the line through both and of their tangents, which is exact for
        a parabola: (x - x_i) g_i/2 at each point i beside its error.
        """
        axes = (np.linspace(-size, size, n) for size, n in zip(self.reach.sizes, self.error.shape, strict=True))
        points, halves = np.array(np.meshgrid(*axes, indexing="ij")), self.slopes[:4] / 2
        return np.stack([self.error - (points * halves).sum(axis=0), *halves, *self.slopes[4:]], axis=-1)

    def rotation(self, scalars: Array) -> Array:
        """Rotation [arcsec], shape (...), from the scalars of states [mm], shape (..., scalars).

        Raises UntrustedError for deviations that the table does not span.
        """
        reach, columns = self.reach, np.zeros((int(np.prod(scalars.shape[:-1])), DEVIATION_SCALARS))
        columns[:, : scalars.shape[-1]] = scalars.reshape(len(columns), -1)
        places = (columns[:, reach.axes] / reach.sizes + 1) * (np.array(self.error.shape) - 1) / 2
        values = read_table(self._rows, places, columns[:, reach.axes + reach.others])
        if not np.all(np.isfinite(values)) or np.delete(columns, reach.axes + reach.others, axis=1).any():
            raise UntrustedError(*_UNSPANNED)
        return values.reshape(scalars.shape[:-1])

    def F_ior(self, values: Mapping[str, Array]) -> Array:
        """F'_ior [arcsec] of drives, shape (drives,).

        Arguments: values of their deviations by path, shape (drives,) each. Raises UntrustedError for
        deviations that the table does not span.
        """
        alpha_g, alpha_b = 2 * np.pi / self.turns * np.indices((self.turns, self.turns)).reshape(2, -1)
        batch, fine = Batch(self.drive, values), np.linspace(0, 2 * np.pi, _ROUGH_TURNS, endpoint=False)
        teeth = [k + len(self.reach.axes) for k, column in enumerate(self.reach.others) if column >= SMOOTH_SCALARS]
        slopes, found = np.nanmean(self.slopes[teeth], axis=(1, 2, 3, 4)), list[Array]()
        for row in np.array_split(np.arange(len(batch)), -(-len(batch) // _READ_AT_ONCE)):
            scalars = batch.scalars(row[:, None], alpha_g, alpha_b)
            error = self.rotation(scalars[..., :SMOOTH_SCALARS])
            if scalars.shape[-1] > SMOOTH_SCALARS:
                if not teeth:
                    raise UntrustedError(*_UNSPANNED)
                b, g = (part[..., SMOOTH_SCALARS:] @ slopes for part in batch.take(row).by_wheel(fine, fine))
                finer = _finer(self.turns)
                error = finer @ error.reshape(-1, self.turns, self.turns) @ finer.T + g[:, :, None] + b[:, None]
                error = error.reshape(len(row), -1)
            found.append(np.ptp(error, axis=-1))
        return np.concatenate(found)


@cache
def _finer(n: int) -> Array:
    """Values at ROUGH_TURNS positions around a wheel of those at n, by their waves, shape (ROUGH_TURNS, n)."""
    waves = np.fft.rfft(np.eye(n), axis=0)
    if n % 2 == 0:
        waves[-1] /= 2  # the other half of the highest one is its mirror image
    return np.fft.irfft(waves, _ROUGH_TURNS, axis=0) * _ROUGH_TURNS / n


def error_table(error_map: ErrorMap, reach: Reach, mesh: Mesh) -> ErrorTable:
    """Table of the error of drives that share a contact system, at the torque of their map.

    Raises UntrustedError where an answer cannot be trusted.
    """
    drive, M_g, count = error_map.drive, error_map.M_g, int(np.prod(mesh.shape))
    half = (np.array(mesh.shape) - 1) / 2
    order = there_and_back(mesh.shape)
    share = np.stack(np.unravel_index(order, mesh.shape), axis=1) / half - 1  # of the reach, -1 to 1
    # the corners of every cell that the discs of both vectors touch; of a symmetric drive the rest is their image
    corner = np.hypot(1 / half[::2], 1 / half[1::2])
    wanted = np.all(np.hypot(share[:, ::2], share[:, 1::2]) <= 1 + corner, axis=1)
    if symmetric := is_half_turn_symmetric(drive):
        wanted &= order <= count // 2
    order, case = order[wanted], error_map.load_case()
    points = np.zeros((len(order), DEVIATION_SCALARS))
    points[:, reach.axes] = share[wanted] * reach.sizes

    def where(k: int) -> str:
        (a, b), (e_x, e_y) = points[k, list(reach.axes)].reshape(2, 2) * 1e3
        return f"tooth vector ({a:.0f}, {b:.0f}) um, cam vector ({e_x:.0f}, {e_y:.0f}) um, M_g = {M_g:g} N*m"

    solved, columns = case.solve(StateGaps(points), where, slope=True), reach.axes + reach.others
    assert solved.slope_arcsec_per_mm is not None
    values = np.full((1 + len(columns), count), np.nan)
    values[0, order] = solved.rotation_arcsec
    values[1:, order] = solved.slope_arcsec_per_mm[:, columns].T
    if symmetric:
        signs = np.array([1, *(-1 if column in ODD_COLUMNS else 1 for column in columns)])
        values[:, count - 1 - order] = values[:, order] * signs[:, None]
    error, *slopes = values.reshape(-1, *mesh.shape)
    return ErrorTable(drive, error, np.array(slopes), reach, mesh.turns, solved.certificate)
