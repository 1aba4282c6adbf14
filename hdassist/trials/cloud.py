"""Samples of what is not known of a drive, and the F'_ior of each in every position of its seat, from a table.

Turning the wheel forward is turning back all that stands: a sample whose offset points one step further has, one
position further, the F'_ior of the sample before it. So every sample is taken in all directions of what stands, and all
positions of it cost one F'_ior each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from hdassist.error.many import F_ior_of_many
from hdassist.error.table import ErrorTable, Mesh, error_tables
from hdassist.model.deviations import standing_offset
from hdassist.model.geometry import Array
from hdassist.model.unknown import listed, uncertain_values, unknowns
from hdassist.preset.fields import Drive
from hdassist.run.run import Progress
from hdassist.solve.answers import EMPTY, Certificate

Places = NDArray[np.int64]
Fields = Mapping[str, tuple[float, float]]

MESH = Mesh((25, 9, 13, 13), compared=8, turns=24)  # F'_ior of vzp160 is missed by 1.3 %, and by 2 % and their mean
OVALITY = "harmonics.xi_s2"  # direction of what the seat does to the rigid wheel; stands still where that is fixed
OUTERMOST = 0.001  # shares beyond are drawn as this one: no table reaches all of a normal distribution
FINEST, COARSEST = 36, 8  # directions that a sample is taken in, at most and at least


@dataclass(frozen=True, eq=False)
class Cloud:
    """Samples of a drive, and their F'_ior [arcsec] at one torque M_g [N*m].

    tables by torque [N*m]; values by field, weight, which sums to 1, and F_ior_arcsec with the wheel at 0, all of shape
    (samples, directions); seed of all that is drawn.
    """

    drive: Drive
    M_g: float
    tables: Mapping[float, ErrorTable]
    values: Mapping[str, Array]
    weight: Array
    F_ior_arcsec: Array
    seed: int = 0

    @property
    def certificate(self) -> Certificate:
        """Proof of all that was solved."""
        return sum((table.certificate for table in self.tables.values()), EMPTY)

    @property
    def possible(self) -> Places:
        """Flat places among samples and directions that weigh anything."""
        return np.flatnonzero(self.weight)

    def at(
        self,
        rotations_deg: Sequence[float],
        places: Places | None = None,
        M_g: float | None = None,
        executor: Executor | None = None,
    ) -> Array:
        """F'_ior [arcsec] with the wheel turned, shape (places, rotations): that of directions less by as much.

        Arguments: flat places among samples and directions, all of them without it; M_g [N*m], another torque, computed
        of these samples alone.
        """
        found, count = self.F_ior_arcsec, self.weight.shape[1]
        sample, direction = np.divmod(np.arange(self.weight.size) if places is None else places, count)
        if M_g not in (None, self.M_g):
            used, sample = np.unique(sample, return_inverse=True)
            found = self.evaluated(M_g, used, executor)
        whole, part = np.divmod(np.round(np.multiply(rotations_deg, count) / 360, 9), 1)
        turned = direction[:, None] - whole.astype(int)
        here, beside = (found[sample[:, None], (turned - j) % count] for j in (0, 1))
        return np.asarray((1 - part) * here + part * beside)

    def evaluated(
        self, M_g: float | None, samples: Places, executor: Executor | None = None, off_um: complex = 0
    ) -> Array:
        """F'_ior [arcsec] of samples in all directions, shape (samples, directions), from the table of a torque [N*m].

        Argument: off_um, what the fixed wheel lies off its centre, along x + i y.
        """
        values = {path: of[samples].ravel() for path, of in self.values.items()}
        table = self.tables[self.M_g if M_g is None else M_g]
        found = F_ior_of_many(self.drive, table, values, off_um=off_um, executor=executor)
        return found.reshape(len(samples), -1)


def open_fields(drive: Drive) -> dict[str, tuple[float, float]]:
    """Fields that are not known, each with what it lies between, and those with an uncertainty, with nothing."""
    return {u.path: (u.low, u.high) for u in unknowns(drive)} | dict.fromkeys(sorted(drive.uncertainty), (0.0, 0.0))


def directions_of(drive: Drive) -> int:
    """Number of directions that samples are taken in: the seat's holes, or some of each."""
    holes = drive.mounting.holes
    return holes * -(-COARSEST // holes) if 0 < holes <= FINEST else FINEST


def any_direction(drive: Drive, open_: Fields) -> bool:
    """Whether every direction of what stands is alike likely; else samples are drawn in one, and the others weigh 0.

    A standing ovality whose direction is known does not turn with the offset.
    """
    turn = standing_offset(drive)[1]
    oval = drive.mounting.fixed == "rigid" and drive.value("harmonics.a_s2") != 0 and drive.value(OVALITY) is not None
    return turn in open_ and turn not in drive.uncertainty and not oval


def cloud_of(
    drive: Drive,
    torques: Sequence[float],
    open_: Fields,
    samples: int,
    *,
    mesh: Mesh = MESH,
    off_um: float = 0.0,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Cloud:
    """Draw what is not known of the deviations of a drive.

    Arguments: torques [N*m], the first that of F_ior_arcsec; open_, what each field that is not known lies between,
    evenly; with an uncertainty (k = 2) it is normal; samples, about how many, each in all directions; mesh of the
    tables; off_um, what these reach to beyond the samples' e_b; executor and progress as in error_tables. Raises
    UntrustedError where an answer cannot be trusted.
    """
    values, weight = _drawn(drive, open_, max(samples, 2 * mesh.compared), seed)
    # a table is compared with some of the samples, and reaches to the outermost one
    compared = np.arange(mesh.compared)
    some = {path: of[compared, 5 * compared % weight.shape[1]] for path, of in values.items()}
    widest = {path: float(of.max()) for path, of in values.items()}
    widest["tolerances.e_b"] = widest.get("tolerances.e_b", drive.number("tolerances.e_b")) + off_um
    span = [*listed(drive, some, len(compared)), drive.with_values(widest)]
    every = list(dict.fromkeys(torques))
    [found] = error_tables([(drive, span)], every, mesh=mesh, executor=executor, progress=progress)
    cloud = Cloud(drive, every[0], dict(zip(every, found, strict=True)), values, weight, weight, seed)
    return replace(cloud, F_ior_arcsec=cloud.evaluated(None, np.arange(len(weight)), executor))


def _drawn(drive: Drive, open_: Fields, samples: int, seed: int) -> tuple[dict[str, Array], Array]:
    """Values of samples by field, and how likely each is, of shape (samples, directions)."""
    turn, directions, every = standing_offset(drive)[1], directions_of(drive), any_direction(drive, open_)
    share = qmc.Sobol(len(open_), seed=seed).random(2 ** round(np.log2(samples)))
    drawn = {}
    for (path, (low, high)), of in zip(open_.items(), share.T, strict=True):
        uncertain, within = path in drive.uncertainty, np.clip(of, OUTERMOST, 1 - OUTERMOST)
        drawn[path] = uncertain_values(drive, path, within) if uncertain else low + (high - low) * of
    if every:  # of each direction its own part of the turn
        drawn[turn] = drawn[turn] / directions
    stand = [turn] if drive.mounting.fixed == "flexspline" else [turn, OVALITY]
    drawn = {path: np.full(len(share), drive.number(path)) for path in stand} | drawn
    turned = 360 / directions * np.arange(directions)
    values = {path: np.add.outer(of, turned * (path in stand)) for path, of in drawn.items()}
    values |= {path: values[path] % 360 for path in stand}
    weight = np.broadcast_to(np.arange(directions) < (directions if every else 1), values[turn].shape)
    return values, weight / weight.sum()
