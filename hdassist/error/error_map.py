"""The error over all tooth positions, at one torque: of a drive, or of many that differ in their deviations alone.

In state j each wheel stands j of its pitches on in the cam's frame, so the state is the point (j mod z_b, j mod z_g)
of a torus on which the error is continuous: neighbours there have nearly the same deviations, however far apart they
lie in the cycle. Of one drive every state is solved; of very many, few (extremes.py), or F'_ior is read off a table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from hdassist.error.cycle import kinematic_error
from hdassist.errors import UntrustedError, UsageError
from hdassist.model.contacts import TOOTH_ORDERS, StateGaps, contact_system
from hdassist.model.deviations import (
    CAM_COLUMNS,
    ODD_COLUMNS,
    SHIFT,
    SMOOTH_SCALARS,
    TEETH,
    Waves,
    carried,
    column_of,
    factor_of,
    is_half_turn_symmetric,
    scalars_of,
    waves_of,
)
from hdassist.model.geometry import Array, Kinematics, States, pitch_locked_states
from hdassist.preset.fields import DEVIATIONS, Drive
from hdassist.run.run import UNCHECKED
from hdassist.solve.answers import Certificate
from hdassist.solve.formulation import Formulation, formulate
from hdassist.solve.loadcase import LoadCase
from hdassist.solve.walk import read_table

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Batch:
    """Drives that differ in their deviations alone: a drive, and values of its fields by path, shape (drives,) each."""

    drive: Drive
    columns: Mapping[str, Array]

    @classmethod
    def of(cls, drive: Drive, count: int = 1) -> Batch:
        """A drive alone, or so many times."""
        return cls(drive, {"tolerances.F_i1": np.full(count, drive.number("tolerances.F_i1"))})

    @classmethod
    def turned(cls, drive: Drive, rotations_deg: Sequence[float] | Array) -> Batch:
        """A drive with its fixed wheel turned on its seat [deg], counter-clockwise seen from the cam side."""
        return cls(drive, {path: drive.number(path) + np.array(rotations_deg) for path in carried(drive)})

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def take(self, rows: Indices) -> Batch:
        """The drives in some rows."""
        return Batch(self.drive, {path: column[rows] for path, column in self.columns.items()})

    def scalars(self, row: Indices, alpha_g: Array, alpha_b: Array) -> Array:
        """Scalars [mm] of the drives in some rows, where their wheels stand so [rad]; shapes broadcast."""
        return scalars_of({key: wave[row] for key, wave in self._waves.items()}, alpha_g, alpha_b)

    def by_wheel(self, alpha_b: Array, alpha_g: Array) -> tuple[Array, Array]:
        """Parts of the scalars [mm] of states by the angle [rad] of each wheel, shape (drives, angles, scalars) both.

        What turns with neither wheel is part of the first.
        """
        row = np.arange(len(self))[:, None]
        parts = []
        for part, alpha in (("b", alpha_b), ("g", alpha_g)):
            is_own = {key: (key[1] == "g") == (part == "g") for key in self._waves}
            own = {key: wave[row] if is_own[key] else np.zeros(1) for key, wave in self._waves.items()}
            parts.append(scalars_of(own, alpha[None], alpha[None]))
        return parts[0], parts[1]

    @cached_property
    def _waves(self) -> Waves:
        columns = self.columns
        number = self.drive.number
        waves = waves_of(lambda path: columns.get(path, number(path)), self.drive)
        return {key: np.broadcast_to(wave, len(self)) for key, wave in waves.items()}


@dataclass(frozen=True)
class Extremes:
    """F'_ior of drives [arcsec], and the states j of the greatest and of the least error, shape (drives,) each."""

    F_ior_arcsec: Array
    at_max: Indices
    at_min: Indices
    certificate: Certificate

    @property
    def first(self) -> float:
        """F'_ior of the first drive [arcsec]."""
        return float(self.F_ior_arcsec[0])


def searchable(drive: Drive) -> bool:
    """Whether the error is continuous on the torus: rolling balls do not come back with the wheels."""
    return drive.bearing.ball_motion == "locked"


class ErrorMap:
    """The error of drives that share a contact system, at one torque, over all tooth positions.

    Arguments: drive, all that they have in common; M_g, the torque [N*m]; formulation of the contact system, where it
    is there already; like, a load case to start from. Raises UsageError for a drive with rolling balls.
    """

    def __init__(
        self, drive: Drive, M_g: float, formulation: Formulation | None = None, like: LoadCase | None = None
    ) -> None:
        if not searchable(drive):
            raise UsageError(
                "this needs bearing.ball_motion: locked; with rolling balls every mesh position has to be solved",
                "use --set bearing.ball_motion=locked",
            )
        self.drive = drive
        self.M_g = M_g
        # never solves a state: every answer starts from it alike and so gives the same digits
        self.fresh = LoadCase(formulation or formulate(contact_system(drive)), M_g, like=like)
        kinematics = Kinematics.of(drive)
        self.sign = kinematics.error_sign
        self.states, self.board, self.finest = _lattice(kinematics)

    def load_case(self) -> LoadCase:
        """The load case of the map's states, to solve some of them, in batches however small."""
        return LoadCase(self.fresh.formulation, self.M_g, like=self.fresh, many=True)

    def extremes(self, drive: Drive | None = None) -> Extremes:
        """Extremes of a drive, by default the map's own, from every state of its cycle.

        Raises UntrustedError where an answer cannot be trusted.
        """
        return every_state(drive or self.drive, self.M_g)

    def to_lattice(self, point: Array) -> Indices:
        """The nearest points at which there is a state, shape (..., 2)."""
        near = np.rint(point).astype(np.int64)
        near[..., 1] += (self.finest - 1) * (near.sum(axis=-1) % 2)
        return np.asarray(near)

    def state(self, point: Indices) -> Indices:
        """States j at points, shape (..., 2)."""
        return np.asarray(self.board[tuple(np.moveaxis(point % self.board.shape, -1, 0))])


def every_state(drive: Drive, M_g: float) -> Extremes:
    """Extremes of a drive at a torque [N*m] from every state of its cycle.

    Raises UntrustedError where an answer cannot be trusted.
    """
    error = kinematic_error(drive, M_g, run=UNCHECKED)
    F_ior, at_max, at_min = (np.array([each]) for each in (error.F_ior_arcsec, error.at_max, error.at_min))
    return Extremes(F_ior_arcsec=F_ior, at_max=at_max, at_min=at_min, certificate=error.certificate)


def error_maps(drive: Drive, torques: Sequence[float], formulation: Formulation | None = None) -> list[ErrorMap]:
    """Maps of the error of a drive at torques [N*m], which share one contact system.

    Argument: formulation of that system, where it is there already.
    """
    formulation = formulation or formulate(contact_system(drive))
    maps = list[ErrorMap]()
    for M_g in torques:
        maps.append(ErrorMap(drive=drive, M_g=M_g, formulation=formulation, like=maps[-1].fresh if maps else None))
    return maps


@lru_cache(maxsize=4)  # of drives that differ in their deviations alone it is the same
def _lattice(kinematics: Kinematics) -> tuple[States, Indices, int]:
    """States of the cycle; states j by their coordinates, shape (z_b, z_g), -1 where there is none; steps along each.

    Where both numbers of teeth are even, k and l of every state are both even or both odd: steps of two.
    """
    j = np.arange(kinematics.cycle_states)
    board = np.full((kinematics.z_b, kinematics.z_g), -1, dtype=np.int64)
    board[j % kinematics.z_b, j % kinematics.z_g] = j
    return pitch_locked_states(kinematics, j), board, 2 if board[0, 1] < 0 else 1


def there_and_back(shape: tuple[int, ...]) -> Indices:
    """Flat places of a grid in an order in which each is next to the one before."""
    index = np.indices(shape).reshape(len(shape), -1)
    path = index.copy()
    for axis in range(1, len(shape)):
        back = path[:axis].sum(axis=0) % 2 == 1
        path[axis] = np.where(back, shape[axis] - 1 - index[axis], index[axis])
    return np.asarray(np.ravel_multi_index(tuple(path), shape))


# --- the error as a table over the deviations
#
# At one torque the error of a state depends on the scalars of its deviations (deviations.py). A table of it over the
# four that matter most, the vector of the teeth and that of the cam, with its slopes by all of them, gives F'_ior in
# some 0.05 ms: enough for thousands of drives. Others, harmonics or a run-out, count by their slopes. F'_ior read off
# it is somewhat too small, because peaks are cut off, by nearly the same share for all drives. Orders beyond the fourth
# are laid on top by their mean slopes, at more positions.

_READ_AT_ONCE = 16  # drives, so that arrays stay in the processor's cache
_WIDER_SPAN = 1.001  # so that rounding leaves the outermost drive inside
_ROUGH_TURNS = 48  # positions of each wheel where orders beyond the fourth are added, by their mean slopes
_LEAST_REACH = 1e-3  # mm: a table needs some width
DEVIATION_SCALARS = 6 + 2 * len(TOOTH_ORDERS)

_UNSPANNED = "the deviations exceed the range of the table of the error", "report this bug in hdassist"

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
        points = np.array(np.meshgrid(*axes, indexing="ij"))
        halves = self.slopes[:4] / 2
        return np.stack([self.error - (points * halves).sum(axis=0), *halves, *self.slopes[4:]], axis=-1)

    def rotation(self, scalars: Array) -> Array:
        """Rotation [arcsec], shape (...), from the scalars of states [mm], shape (..., scalars).

        Raises UntrustedError for deviations that the table does not span.
        """
        reach = self.reach
        columns = np.zeros((int(np.prod(scalars.shape[:-1])), DEVIATION_SCALARS))
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
        batch = Batch(self.drive, values)
        found = list[Array]()
        alpha, fine = (np.linspace(0, 2 * np.pi, n, endpoint=False) for n in (self.turns, _ROUGH_TURNS))
        b, g = batch.by_wheel(alpha, alpha)
        if is_rough := b.shape[-1] > SMOOTH_SCALARS:
            reached = self.reach.axes + self.reach.others
            teeth = [k for k, column in enumerate(reached) if column >= SMOOTH_SCALARS]
            if not teeth:
                raise UntrustedError(*_UNSPANNED)
            slopes = np.nanmean(self.slopes[teeth], axis=(1, 2, 3, 4))
            finer = _finer(self.turns)
            rough_b, rough_g = (part[..., SMOOTH_SCALARS:] @ slopes for part in batch.by_wheel(fine, fine))
            b = b[..., :SMOOTH_SCALARS]
            g = g[..., :SMOOTH_SCALARS]
        for row in np.array_split(np.arange(len(batch)), -(-len(batch) // _READ_AT_ONCE)):
            error = self.rotation(g[row, :, None] + b[row, None])
            if is_rough:
                error = finer @ error @ finer.T + rough_g[row, :, None] + rough_b[row, None]
            found.append(np.ptp(error, axis=(1, 2)))
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
    drive = error_map.drive
    M_g = error_map.M_g
    count = int(np.prod(mesh.shape))
    half = (np.array(mesh.shape) - 1) / 2
    order = there_and_back(mesh.shape)
    share = np.stack(np.unravel_index(order, mesh.shape), axis=1) / half - 1  # of the reach, -1 to 1
    # the corners of every cell that the discs of both vectors touch; of a symmetric drive the rest is their image
    corner = np.hypot(1 / half[::2], 1 / half[1::2])
    wanted = np.all(np.hypot(share[:, ::2], share[:, 1::2]) <= 1 + corner, axis=1)
    if symmetric := is_half_turn_symmetric(drive):
        wanted &= order <= count // 2
    order = order[wanted]
    case = error_map.load_case()
    points = np.zeros((len(order), DEVIATION_SCALARS))
    points[:, reach.axes] = share[wanted] * reach.sizes

    def where(k: int) -> str:
        (a, b), (e_x, e_y) = points[k, list(reach.axes)].reshape(2, 2) * 1e3
        return f"tooth vector ({a:.0f}, {b:.0f}) um, cam vector ({e_x:.0f}, {e_y:.0f}) um, M_g = {M_g:g} N*m"

    solved = case.solve(StateGaps(points), where, slope=True)
    columns = reach.axes + reach.others
    assert solved.slope_arcsec_per_mm is not None
    values = np.full((1 + len(columns), count), np.nan)
    values[0, order] = solved.rotation_arcsec
    values[1:, order] = solved.slope_arcsec_per_mm[:, columns].T
    if symmetric:
        signs = np.array([1, *(-1 if column in ODD_COLUMNS else 1 for column in columns)])
        values[:, count - 1 - order] = values[:, order] * signs[:, None]
    error, *slopes = values.reshape(-1, *mesh.shape)
    return ErrorTable(
        drive=drive, error=error, slopes=np.array(slopes), reach=reach, turns=mesh.turns, certificate=solved.certificate
    )
