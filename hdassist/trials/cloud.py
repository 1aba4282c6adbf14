"""Samples of what is not known of a drive, and the F'_ior of each in every position of its seat.

A flat cloud, drawn evenly over what is known before any trial; trials weigh it (draws.py). Turning the wheel forward is
turning back all that stands: a sample whose offset points one step further has, one position further, the F'_ior of the
sample before it. So every sample is taken in all directions, and each costs one F'_ior from a table (error/table.py).
The preset's alternatives are left out: other stiffnesses are a misfit of a few per cent, which draws.py has anyway.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from hdassist.error.many import F_ior_of_many
from hdassist.error.search import searchable
from hdassist.error.table import DEVIATIONS, ErrorTable, Mesh, error_tables
from hdassist.errors import UsageError
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate, Progress
from hdassist.trials.unknowns import direction_density, drawn_values, offset_fields, open_fields

Places = NDArray[np.int64]

OVALITY = "harmonics.xi_s2"  # direction of what the seat does to the rigid wheel; stands still where that is fixed
FINEST, COARSEST = 36, 8  # directions that a sample is taken in, at most and at least
SEAT_STEP, SEAT_SAMPLES, SEAT_BINS = 2.0, 64, 8  # um that the wheel's centre is moved by, to see what its seat does


@dataclass(frozen=True)
class Effort:
    """Samples times directions, about; mesh of the tables; positions of each wheel that stand for the cycle.

    Those of FULL miss F'_ior of vzp160 by 1.3 %, those of QUICK by 2 % and their mean; that counts as misfit.
    """

    samples: int
    mesh: Mesh
    turns: int


FULL = Effort(12_288, Mesh((25, 9, 13, 13), 8), 24)
QUICK = Effort(1536, Mesh((9, 5, 9, 9), 0), 16)  # to see within a second what can be reached at all


@dataclass(frozen=True, eq=False)
class Cloud:
    """Samples of a drive, and their F'_ior [arcsec] at the torque of the trials.

    tables by torque M_g [N*m]; rig_M_g, that of the trials; values by field, shape (samples,), in the first direction;
    weight before any trial, sums to 1, and F_ior_arcsec with the wheel at 0, shape (samples, directions); seat, some
    F'_ior and what a micrometre of the wheel's centre does to them [arcsec/um].
    """

    drive: Drive
    rig_M_g: float
    tables: Mapping[float, ErrorTable]
    turns: int
    values: Mapping[str, Array]
    weight: Array
    F_ior_arcsec: Array
    seat: tuple[Array, Array] = (np.zeros(1), np.zeros(1))

    @property
    def certificate(self) -> Certificate:
        """Proof of all that was solved."""
        return sum((table.certificate for table in self.tables.values()), EMPTY)

    @property
    def offset_um(self) -> NDArray[np.complex128]:
        """Standing offset as x + i y, shape (samples * directions,)."""
        size, direction = (self.values[path] for path in offset_fields(self.drive))
        return np.ravel(size[:, None] * np.exp(1j * np.radians(_directions(direction, self.weight.shape[1]))))

    def at(self, rotations_deg: Sequence[float], places: Places | None = None) -> Array:
        """F'_ior [arcsec] with the wheel turned, shape (places, rotations), at the torque of the trials.

        Argument: flat places among samples and directions, all of them without it.
        """
        return _turned(self.F_ior_arcsec, rotations_deg, np.arange(self.weight.size) if places is None else places)

    def at_torque(
        self, M_g: float, rotations_deg: Sequence[float], places: Places, executor: Executor | None = None
    ) -> Array:
        """The same at one of the torques [N*m], computed of the samples that are asked for alone."""
        samples, back = np.unique(places // self.weight.shape[1], return_inverse=True)
        found = self.evaluated(M_g, samples, executor)
        return _turned(found, rotations_deg, back * found.shape[1] + places % found.shape[1])

    def evaluated(self, M_g: float, samples: Places, executor: Executor | None = None, off_um: complex = 0) -> Array:
        """F'_ior [arcsec] of samples in all directions, shape (samples, directions), from the table."""
        count = self.weight.shape[1]
        values = {path: np.repeat(column[samples], count) for path, column in self.values.items()}
        standing = {offset_fields(self.drive)[1], *({OVALITY} if self.drive.mounting.fixed == "rigid" else ())}
        values |= {path: _directions(self.values[path][samples], count).ravel() for path in standing & values.keys()}
        found = F_ior_of_many(self.drive, self.tables[M_g], values, count=self.turns, off_um=off_um, executor=executor)
        return found.reshape(-1, count)


def cloud_of(
    drive: Drive,
    torques: Sequence[float],
    rig_M_g: float,
    *,
    reseat: bool = False,
    seed: int = 0,
    effort: Effort = FULL,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Cloud:
    """Draw what is not known of a drive.

    Arguments: torques [N*m], rig_M_g, that of the trials; reseat, whether seat is wanted (zero without); executor
    and progress as in error_tables. Raises UsageError for a drive with rolling balls, without an offset, or with an
    uncertainty in a field that is no deviation; UntrustedError where an answer cannot be trusted.
    """
    if not searchable(drive):
        raise UsageError("trials need locked balls", "bearing.ball_motion: locked")
    if others := [path for path in drive.uncertainty if not path.startswith(DEVIATIONS)]:
        raise UsageError(
            f"trials cannot take in an uncertainty of {', '.join(others)}",
            "leave it out; sets of values that agree with a calibration belong to alternatives",
        )
    every = list(dict.fromkeys([*torques, rig_M_g]))
    values, weight = _drawn(drive, effort.samples, seed)
    span = _span(drive, values, weight.shape[1], effort.mesh.compared, reseat)
    [found] = error_tables(
        [(drive, span)], every, mesh=effort.mesh, count=effort.turns, executor=executor, progress=progress
    )
    tables = dict(zip(every, found, strict=True))
    cloud = Cloud(drive, rig_M_g, tables, effort.turns, values, weight, weight)
    still = cloud.evaluated(rig_M_g, np.arange(len(weight)), executor)
    return replace(cloud, F_ior_arcsec=still, seat=_seat(cloud, still, executor) if reseat else cloud.seat)


def _seat(cloud: Cloud, F_ior: Array, executor: Executor | None) -> tuple[Array, Array]:
    """Some F'_ior and the standard deviation there for each micrometre of that of the wheel's centre.

    Drives with a large F'_ior move far more; of drives that show the same the median is taken.
    """
    some = np.arange(SEAT_SAMPLES)
    moved = [cloud.evaluated(cloud.rig_M_g, some, executor, SEAT_STEP * 1j**k) - F_ior[some] for k in range(4)]
    order = np.array_split(np.argsort(F_ior[some], axis=None), SEAT_BINS)
    # both components vary: twice the mean square over four directions, were it linear
    square = 2 * np.mean(np.square(moved), axis=0).ravel() / SEAT_STEP**2
    means = [(F_ior[some].ravel()[part].mean(), np.sqrt(np.median(square[part]))) for part in order]
    return np.array(means)[:, 0], np.array(means)[:, 1]


def _drawn(drive: Drive, count: int, seed: int) -> tuple[dict[str, Array], Array]:
    """Values by field of samples, and how likely each is in each direction."""
    open_, holes = open_fields(drive), drive.mounting.holes
    directions = holes * -(-COARSEST // holes) if 0 < holes <= FINEST else FINEST
    # a standing ovality that is known does not turn with the samples: each is taken in one direction, so there are more
    fixed = drive.mounting.fixed == "rigid" and drive.number("harmonics.a_s2") != 0 and drive.value(OVALITY) is not None
    share = qmc.Sobol(len(open_) + 1, seed=seed).random(2 ** round(np.log2(count / (3 if fixed else directions))))
    values = {
        path: drawn_values(drive, path, reach, column)
        for (path, reach), column in zip(open_.items(), share.T, strict=False)
    }
    first = (360.0 if fixed else 360 / directions) * share[:, -1]
    weight = direction_density(drive, _directions(first, directions))
    if fixed:
        weight[:, 1:] = 0
        values.setdefault(OVALITY, np.full(len(first), drive.number(OVALITY)))
    return {**values, offset_fields(drive)[1]: first}, weight / weight.sum()


def _directions(first: Array, count: int) -> Array:
    return np.asarray((first[:, None] + 360 / count * np.arange(count)) % 360)


def _span(drive: Drive, values: Mapping[str, Array], directions: int, compared: int, reseat: bool) -> list[Drive]:
    """Some of the samples, to compare a table with, and the outermost one."""
    turn = offset_fields(drive)[1]
    some = [{path: float(column[k]) for path, column in values.items()} for k in range(compared)]
    some = [{**one, turn: one[turn] + 360 * (5 * k % directions) / directions} for k, one in enumerate(some)]
    widest = {path: float(column.max()) for path, column in values.items()}
    off = {"tolerances.e_b": drive.number("tolerances.e_b") + SEAT_STEP} if reseat else {}
    return [drive.with_values(one) for one in (*some, {**widest, **off})]


def _turned(F_ior: Array, rotations_deg: Sequence[float], places: Places) -> Array:
    """F'_ior of samples with the wheel turned: that of directions less by as much, interpolated between them."""
    count = F_ior.shape[1]
    sample, direction = np.divmod(places, count)
    columns = []
    for rotation in rotations_deg:
        whole, part = divmod(round(rotation * count / 360, 9), 1)
        here, beside = (F_ior[sample, (direction - int(whole) - j) % count] for j in (0, 1))
        columns.append((1 - part) * here + part * beside)
    return np.stack(columns, axis=1)
