"""The error over all tooth positions at one torque, for one drive or for many drives that differ only in deviations.

In state j each wheel has moved by j of its pitches in the frame of the wave generator, so the state is the point (j mod
z_b, j mod z_g) of a torus on which the error is continuous. Neighbouring points have nearly the same deviations, even
if they are far apart in the cycle. A single drive is solved in every state. For very many drives, either a few states
are solved (extremes.py) or F'_ior is interpolated in a table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.error.cycle import kinematic_error
from hdassist.drive.model.contacts import TOOTH_ORDERS, StateGaps, contact_system
from hdassist.drive.model.deviations import (
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
from hdassist.drive.model.geometry import Array, Kinematics, States, pitch_locked_states
from hdassist.drive.preset.fields import DEVIATIONS, Drive
from hdassist.drive.solve.answers import Certificate
from hdassist.drive.solve.formulation import Formulation, formulate
from hdassist.drive.solve.loadcase import LoadCase
from hdassist.drive.solve.walk import read_table
from hdassist.run.errors import UntrustedError, UsageError
from hdassist.run.run import UNCHECKED

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Batch:
    """Drives that differ only in their deviations."""

    drive: Drive
    columns: Mapping[str, Array]  # values of the fields by path, shape (drives,) each

    @classmethod
    def of(cls, drive: Drive, count: int = 1) -> Batch:
        """Return a batch of one drive, repeated `count` times."""
        # any field is suitable, because a column only has to hold one value per drive
        return cls(drive, {"tolerances.F_i1": np.full(count, drive.number("tolerances.F_i1"))})

    @classmethod
    def turned(cls, drive: Drive, rotations_deg: Sequence[float] | Array) -> Batch:
        """Return a batch of one drive with its fixed wheel turned on its seat.

        rotations_deg: rotations [deg], counter-clockwise seen from the wave generator side.
        """
        # the directions of all deviations that turn with the fixed wheel increase by the rotation
        return cls(drive, {path: drive.number(path) + np.array(rotations_deg) for path in carried(drive)})

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def take(self, rows: Indices) -> Batch:
        """Return the batch of the selected drives.

        rows: indices of the drives.
        """
        return Batch(self.drive, {path: column[rows] for path, column in self.columns.items()})

    def scalars(
        self,
        row: Indices,
        alpha_g: Array,
        alpha_b: Array,
    ) -> Array:
        """Return the deviation scalars of the selected drives at wheel angles [mm]; the shapes broadcast.

        row: indices of the drives.
        alpha_g: angles of the flexspline [rad].
        alpha_b: angles of the circular spline [rad].
        """
        return scalars_of({key: wave[row] for key, wave in self._waves.items()}, alpha_g, alpha_b)

    def by_wheel(self, alpha_b: Array, alpha_g: Array) -> tuple[Array, Array]:
        """Return the parts of the scalars that depend on each wheel's angle [mm], shape (drives, angles, scalars) each.

        The first part includes the scalars that turn with neither wheel.

        Args:
            alpha_b: angles of the circular spline [rad], shape (angles,).
            alpha_g: angles of the flexspline [rad], shape (angles,).
        """
        row = np.arange(len(self))[:, None]
        # scalars are sums over the wheels, so the part of each wheel is computed at its own angles only: z_b + z_g
        # values instead of z_b z_g
        waves_b = {}
        waves_g = {}
        for key, wave in self._waves.items():
            _, part, _ = key
            # eccentricities that rotate with the wave generator (part h) are constant in its frame and count with the
            # circular spline
            waves_b[key] = np.zeros(1) if part == "g" else wave[row]
            waves_g[key] = wave[row] if part == "g" else np.zeros(1)
        by_b = scalars_of(waves_b, alpha_b[None], alpha_b[None])
        by_g = scalars_of(waves_g, alpha_g[None], alpha_g[None])
        return by_b, by_g

    @cached_property
    def _waves(self) -> Waves:
        columns = self.columns
        number = self.drive.number
        waves = waves_of(lambda path: columns.get(path, number(path)), self.drive)
        # a deviation that all drives share has only one wave
        return {key: np.broadcast_to(wave, len(self)) for key, wave in waves.items()}


@dataclass(frozen=True)
class Extremes:
    """F'_ior of drives, shape (drives,)."""

    F_ior_arcsec: Array
    at_max: Indices  # number j of the state with the largest error
    at_min: Indices  # number j of the state with the smallest error
    certificate: Certificate

    @property
    def first(self) -> float:
        """F'_ior of the first drive [arcsec]."""
        return float(self.F_ior_arcsec[0])


def searchable(drive: Drive) -> bool:
    """Return whether the error is continuous on the torus, which rolling balls prevent."""
    # with locked balls the two wheel angles determine the state
    return drive.bearing.ball_motion == "locked"


class ErrorMap:
    """The error over all tooth positions at one torque, for drives that share a contact system."""

    def __init__(
        self,
        drive: Drive,
        M_g: float,
        formulation: Formulation | None = None,
        like: LoadCase | None = None,
    ) -> None:
        """Prepare the load case and the states of the full cycle.

        Args:
            drive: drive with the properties that all drives share.
            M_g: torque [N*m].
            formulation: programme of the contact system, if it already exists.
            like: load case whose contact set is the start.

        Raises UsageError for a drive with rolling balls.
        """
        if not searchable(drive):
            raise UsageError(
                "this computation requires bearing.ball_motion: locked; with rolling balls, "
                "every mesh position would have to be solved",
                "use --set bearing.ball_motion=locked",
            )
        self.drive = drive
        self.M_g = M_g
        # this case never solves a state, so every result starts from the same contact set and is reproducible to the
        # last digit
        self.fresh = LoadCase(
            formulation or formulate(contact_system(drive)),
            M_g,
            like=like,
        )
        kinematics = Kinematics.of(drive)
        # the map contains the rotation; F_kpp is the rotation times this sign
        self.sign = kinematics.error_sign
        self.states, self.board, self.finest = _lattice(kinematics)

    def load_case(self) -> LoadCase:
        """Return a load case that solves states of the map in batches of any size."""
        return LoadCase(
            self.fresh.formulation,
            self.M_g,
            like=self.fresh,
            many=True,
        )

    def extremes(self, drive: Drive | None = None) -> Extremes:
        """Return the extremes of a drive from every state of its cycle.

        drive: the map's drive by default.
        Raises UntrustedError if a result cannot be trusted.
        """
        return every_state(drive or self.drive, self.M_g)

    def to_lattice(self, point: Array) -> Indices:
        """Return the nearest points at which there is a state, shape (..., 2)."""
        # if both numbers of teeth are even, only points with an even sum of coordinates are states
        nearest = np.rint(point).astype(np.int64)
        # if the nearest point is not a state, its neighbour along the flexspline is
        nearest[..., 1] += (self.finest - 1) * (nearest.sum(axis=-1) % 2)
        return np.asarray(nearest)

    def state(self, point: Indices) -> Indices:
        """Return the numbers j of the states at points of shape (..., 2)."""
        return np.asarray(self.board[tuple(np.moveaxis(point % self.board.shape, -1, 0))])


def every_state(drive: Drive, M_g: float) -> Extremes:
    """Return the extremes of a drive at a torque M_g [N*m] from every state of its cycle.

    Raises UntrustedError if a result cannot be trusted.
    """
    error = kinematic_error(drive, M_g, run=UNCHECKED)
    return Extremes(
        F_ior_arcsec=np.array([error.F_ior_arcsec]),
        at_max=np.array([error.at_max]),
        at_min=np.array([error.at_min]),
        certificate=error.certificate,
    )


def error_maps(
    drive: Drive,
    torques: Sequence[float],
    formulation: Formulation | None = None,
) -> list[ErrorMap]:
    """Return the error maps of a drive at several torques, which share one contact system.

    Args:
        drive: the drive.
        torques: torques M_g [N*m].
        formulation: programme of the contact system, if it already exists.
    """
    formulation = formulation or formulate(contact_system(drive))
    maps = list[ErrorMap]()
    for M_g in torques:
        # contact sets of neighbouring torques are similar
        previous_case = maps[-1].fresh if maps else None
        maps.append(
            ErrorMap(
                drive=drive,
                M_g=M_g,
                formulation=formulation,
                like=previous_case,
            )
        )
    return maps


@lru_cache(maxsize=4)  # drives that differ only in their deviations have equal kinematics and share one entry
def _lattice(kinematics: Kinematics) -> tuple[States, Indices, int]:
    """Return the states of the cycle, their numbers by coordinates, and the step from one state to the next.

    The numbers have shape (z_b, z_g) and are -1 at points without a state. If both numbers of teeth are even, both
    coordinates of a state are even or both are odd, and the step is 2.
    """
    j = np.arange(kinematics.cycle_states)
    # -1 marks points without a state of the cycle
    board = np.full(
        (kinematics.z_b, kinematics.z_g),
        -1,
        dtype=np.int64,
    )
    board[j % kinematics.z_b, j % kinematics.z_g] = j
    # one step along a single wheel leads to a state only if z_b and z_g have no common factor
    finest = 2 if board[0, 1] < 0 else 1
    return pitch_locked_states(kinematics, j), board, finest


def there_and_back(shape: tuple[int, ...]) -> Indices:
    """Return the flat indices of a grid in an order in which each point is next to the previous one."""
    index = np.indices(shape).reshape(len(shape), -1)
    # each row of the grid runs in the opposite direction to the previous row, along every axis
    path = index.copy()
    for axis in range(1, len(shape)):
        is_backwards = path[:axis].sum(axis=0) % 2 == 1
        path[axis] = np.where(is_backwards, shape[axis] - 1 - index[axis], index[axis])
    return np.asarray(np.ravel_multi_index(tuple(path), shape))


# --- the error as a table over the deviations
#
# At one torque the error of a state depends on its deviation scalars (deviations.py). The table contains the error over
# the four most important scalars, the tooth vector and the cam vector, and its slopes by all scalars. It gives F'_ior
# in 0.05 ms, which is fast enough for thousands of drives. The slopes account for the remaining scalars, which are
# harmonics or a runout. F'_ior from the table is slightly too small, because interpolation cuts off peaks, by nearly
# the same share for all drives. Orders beyond the fourth are added with their mean slopes, at more positions.

_READ_AT_ONCE = 16  # number of drives whose arrays fit into the processor's cache
_WIDER_SPAN = 1.001  # factor that keeps the outermost drive inside the table in spite of rounding
_ROUGH_TURNS = 48  # positions of each wheel at which orders beyond the fourth are added
_MIN_REACH = 1e-3  # mm; smallest half-width of a table
DEVIATION_SCALARS = 6 + 2 * len(TOOTH_ORDERS)

_UNSPANNED = "the deviations exceed the range of the table of the error", "report this bug in hdassist"

TABLE_SECTIONS = ("tolerances.", "phases.", "harmonics.")  # sections of a preset that a table spans


@dataclass(frozen=True)
class Mesh:
    """Resolution of a table."""

    # points over a, b, e_x, e_y; a lies approximately along the motion and has the largest effect
    shape: tuple[int, int, int, int] = (25, 9, 13, 13)
    turns: int = 24  # positions of each wheel that represent the cycle

    def states(self, drive: Drive) -> int:
        """Return the approximate number of states in the table of a drive, without slopes."""
        # two discs in two squares contain (pi/4)^2 of the points, and the rim adds a third of that; symmetry halves the
        # number
        solved_share = 0.403 if is_half_turn_symmetric(drive) else 0.806
        return round(solved_share * float(np.prod(self.shape)))


@dataclass(frozen=True)
class Reach:
    """The part of the deviation scalars that a table spans."""

    axes: tuple[int, ...]  # columns of the four axes
    sizes: Array  # half-width of each axis [mm], shape (4,)
    other_columns: tuple[int, ...]  # columns that the slopes account for

    @classmethod
    def of(cls, drive: Drive) -> Reach:
        """Return the reach for a drive whose deviations may have any direction."""
        mark_kind = drive.mounting.mark_kind
        # if the marks show runout, the first harmonics are shifts and replace the tangential vector
        teeth = SHIFT if mark_kind == "runout" else TEETH
        # sizes in one column add up if their directions agree, so the table spans their sum
        size_of = dict.fromkeys((teeth, CAM_COLUMNS), 0.0)  # by first column [mm]
        for deviation in DEVIATIONS:
            size = abs(factor_of(deviation, drive)) * drive.number(deviation.size) * 1e-3
            if size:
                column = column_of(deviation, mark_kind)
                size_of[column] = size_of.get(column, 0.0) + size
        teeth_size = _WIDER_SPAN * max(size_of.pop(teeth), _MIN_REACH)
        cam_size = _WIDER_SPAN * max(size_of.pop(CAM_COLUMNS), _MIN_REACH)
        # the remaining deviations are small, so linear terms are sufficient
        further_columns = []
        for column in sorted(size_of):
            further_columns += [column, column + 1]
        return cls(
            axes=(teeth, teeth + 1, CAM_COLUMNS, CAM_COLUMNS + 1),
            sizes=np.array([teeth_size, teeth_size, cam_size, cam_size]),
            other_columns=tuple(further_columns),
        )


@dataclass(frozen=True)
class ErrorTable:
    """Error of drives that share a contact system, at one torque, interpolated over their deviations."""

    drive: Drive  # drive with the properties that all drives share
    error: Array  # [arcsec], shape of the mesh, NaN outside the reach
    # slopes of the error by the scalars of the axes, then by the other columns [arcsec/mm], shape (4 + others, *mesh)
    slopes: Array
    reach: Reach
    turns: int  # positions of each wheel that represent the cycle
    certificate: Certificate

    @cached_property
    def _rows(self) -> Array:
        """Value and slopes that `rotation` interpolates, shape (*mesh, 5 + others).

        Between two mesh points the error is the mean of their chord and their tangents, which is exact for a parabola.
        The term (x - x_i) g_i/2 is therefore added to the error of each point i.
        """
        # value minus half the rise of each tangent, which makes the interpolation the mean of chord and tangents
        axes = (np.linspace(-size, size, n) for size, n in zip(self.reach.sizes, self.error.shape, strict=True))
        points = np.array(np.meshgrid(*axes, indexing="ij"))
        halves = self.slopes[:4] / 2
        return np.stack([self.error - (points * halves).sum(axis=0), *halves, *self.slopes[4:]], axis=-1)

    def rotation(self, scalars: Array) -> Array:
        """Return the rotation of states [arcsec], shape (...).

        Args:
            scalars: deviation scalars of the states [mm], shape (..., scalars).

        Raises UntrustedError for deviations outside the table.
        """
        reach = self.reach
        # scalars beyond the given columns are 0
        columns = np.zeros((int(np.prod(scalars.shape[:-1])), DEVIATION_SCALARS))
        columns[:, : scalars.shape[-1]] = scalars.reshape(len(columns), -1)
        # convert [-size, size] to indices of the mesh
        places = (columns[:, reach.axes] / reach.sizes + 1) * (np.array(self.error.shape) - 1) / 2
        values = read_table(self._rows, places, columns[:, reach.axes + reach.other_columns])
        # a deviation beyond the table, or in a column missing from it, must not count as 0
        if not np.all(np.isfinite(values)) or np.delete(columns, reach.axes + reach.other_columns, axis=1).any():
            raise UntrustedError(*_UNSPANNED)
        return values.reshape(scalars.shape[:-1])

    def F_ior(self, values: Mapping[str, Array]) -> Array:
        """Return F'_ior of drives [arcsec], shape (drives,).

        Args:
            values: values of the deviations by path, shape (drives,) each.

        Raises UntrustedError for deviations outside the table.
        """
        batch = Batch(self.drive, values)
        # the cycle is long, so its states lie densely on the torus and a grid of positions represents them
        alpha = np.linspace(
            0,
            2 * np.pi,
            self.turns,
            endpoint=False,
        )
        by_b, by_g = batch.by_wheel(alpha, alpha)
        # orders beyond the fourth need more positions than the table lookup uses
        rough = self._rough_errors(batch) if by_b.shape[-1] > SMOOTH_SCALARS else None
        by_b = by_b[..., :SMOOTH_SCALARS]
        by_g = by_g[..., :SMOOTH_SCALARS]
        F_ior = []
        for rows in np.array_split(np.arange(len(batch)), -(-len(batch) // _READ_AT_ONCE)):
            error = self.rotation(by_g[rows, :, None] + by_b[rows, None])  # shape (rows, turns, turns)
            if rough is not None:
                rough_b, rough_g = rough
                # smooth waves are computed on the coarse grid and interpolated exactly to the fine one
                finer = _finer(self.turns)
                error = finer @ error @ finer.T + rough_g[rows, :, None] + rough_b[rows, None]
            F_ior.append(np.ptp(error, axis=(1, 2)))
        return np.concatenate(F_ior)

    def ranges(self, values: Mapping[str, Array], states: States) -> Array:
        """Return the range of the error of drives over given states [arcsec], shape (drives,).

        Args:
            values: values of the deviations by path, shape (drives,) each.
            states: states of the drives, one drive after the other, with an equal number for each.

        Raises UntrustedError for deviations outside the table.
        """
        batch = Batch(self.drive, values)
        row = np.repeat(np.arange(len(batch)), len(states) // len(batch))
        scalars = batch.scalars(row, states.alpha_g, states.alpha_b)
        error = self.rotation(scalars[:, :SMOOTH_SCALARS])
        if scalars.shape[1] > SMOOTH_SCALARS:
            error = error + scalars[:, SMOOTH_SCALARS:] @ self._rough_slopes()
        return np.asarray(np.ptp(error.reshape(len(batch), -1), axis=1))

    def _rough_slopes(self) -> Array:
        """Return the mean slopes by orders beyond the fourth [arcsec/mm], shape (scalars,).

        Raises UntrustedError if the table has no such slopes.
        """
        columns = self.reach.axes + self.reach.other_columns
        rough_rows = [k for k, column in enumerate(columns) if column >= SMOOTH_SCALARS]
        if not rough_rows:
            raise UntrustedError(*_UNSPANNED)
        # the slopes vary little over the table and are NaN outside the discs
        return np.asarray(np.nanmean(self.slopes[rough_rows], axis=(1, 2, 3, 4)))

    def _rough_errors(self, batch: Batch) -> tuple[Array, Array]:
        """Return the error due to orders beyond the fourth of each wheel [arcsec], shape (drives, _ROUGH_TURNS) each.

        Raises UntrustedError if the table has no slopes by these orders.
        """
        slopes = self._rough_slopes()
        alpha = np.linspace(0, 2 * np.pi, _ROUGH_TURNS, endpoint=False)
        by_b, by_g = batch.by_wheel(alpha, alpha)
        return by_b[..., SMOOTH_SCALARS:] @ slopes, by_g[..., SMOOTH_SCALARS:] @ slopes


@cache
def _finer(n: int) -> Array:
    """Return the weights that interpolate n values around a wheel to _ROUGH_TURNS values by their Fourier series."""
    # Fourier interpolation as a matrix, because many drives use it
    waves = np.fft.rfft(np.eye(n), axis=0)
    if n % 2 == 0:
        waves[-1] /= 2  # half of the highest wave is its mirror image
    return np.fft.irfft(waves, _ROUGH_TURNS, axis=0) * _ROUGH_TURNS / n


def error_table(
    error_map: ErrorMap,
    reach: Reach,
    mesh: Mesh,
) -> ErrorTable:
    """Return the table of the error of drives that share a contact system, at the torque of their map.

    Raises UntrustedError if a result cannot be trusted.
    """
    drive = error_map.drive
    count = int(np.prod(mesh.shape))
    is_symmetric = is_half_turn_symmetric(drive)
    order, share = _solved_points(mesh, is_symmetric)
    scalars = np.zeros((len(order), DEVIATION_SCALARS))
    scalars[:, reach.axes] = share * reach.sizes

    # a state of a table has no angles, so the message gives its vectors
    def place(k: int) -> str:
        (a, b), (e_x, e_y) = scalars[k, list(reach.axes)].reshape(2, 2) * 1e3
        vectors = f"tooth vector ({a:.0f}, {b:.0f}) um, cam vector ({e_x:.0f}, {e_y:.0f}) um"
        return f"{vectors}, M_g = {error_map.M_g:g} N*m"

    answers = error_map.load_case().solve(StateGaps(scalars), place, slope=True)
    columns = reach.axes + reach.other_columns
    assert answers.slope_arcsec_per_mm is not None
    values = np.full((1 + len(columns), count), np.nan)  # the error, followed by its slopes
    values[0, order] = answers.rotation_arcsec
    # points outside the discs remain NaN
    values[1:, order] = answers.slope_arcsec_per_mm[:, columns].T
    if is_symmetric:
        # the image of a point has both vectors reversed, so its index is the last index minus that of the point
        values[:, count - 1 - order] = values[:, order] * _image_signs(columns)[:, None]
    error, *slopes = values.reshape(-1, *mesh.shape)
    return ErrorTable(
        drive=drive,
        error=error,
        slopes=np.array(slopes),
        reach=reach,
        turns=mesh.turns,
        certificate=answers.certificate,
    )


def _image_signs(columns: Sequence[int]) -> Indices:
    """Return the signs of the error and its slopes at the image of a point of a symmetric drive, shape (1 + slopes,).

    The image has the same error. Its slopes by deviations of odd order have the opposite sign.

    Args:
        columns: columns of the slopes.
    """
    return np.array([1, *(-1 if column in ODD_COLUMNS else 1 for column in columns)])


def _solved_points(mesh: Mesh, is_symmetric: bool) -> tuple[Indices, Array]:
    """Return the flat indices of the mesh points to solve, and their positions from -1 to 1 along each axis.

    The points are the corners of all cells that the discs of both vectors touch. For a symmetric drive, half of them
    are solved.
    """
    half = (np.array(mesh.shape) - 1) / 2
    order = there_and_back(mesh.shape)
    share = np.stack(np.unravel_index(order, mesh.shape), axis=1) / half - 1
    # interpolation inside the disc needs the ring of points just outside it
    corner = np.hypot(1 / half[::2], 1 / half[1::2])
    is_solved = np.all(np.hypot(share[:, ::2], share[:, 1::2]) <= 1 + corner, axis=1)
    if is_symmetric:
        # one point of each pair of images; the centre is its own image
        is_solved &= order <= int(np.prod(mesh.shape)) // 2
    return order[is_solved], share[is_solved]
