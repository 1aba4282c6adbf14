"""Samples of what is not known of a drive, and the F'_ior of each in every position of its seat.

A flat cloud, drawn evenly over what is known before any trial; trials weigh it (posterior.py). Turning the wheel
forward is turning back all that stands: a sample whose offset points one step further has, one position further, the
F'_ior of the sample before it. So every sample is taken in all directions, and each costs one F'_ior from a table.
The preset's alternatives are left out: other stiffnesses are a misfit of a few per cent, which is taken anyway.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, qmc

from hdassist.error.many import F_ior_of_many
from hdassist.error.search import searchable
from hdassist.error.table import DEVIATIONS, ErrorTable, Mesh, error_tables
from hdassist.errors import UsageError
from hdassist.model.deviations import standing_offset
from hdassist.model.geometry import Array
from hdassist.model.unknown import listed, uncertain_values, unknowns
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate, Progress
from hdassist.trials.trial import Rig

Places = NDArray[np.int64]

OVALITY = "harmonics.xi_s2"  # direction of what the seat does to the rigid wheel; stands still where that is fixed
WIDEST = 2.0  # a size without an uncertainty may be so many times the preset's
NARROWEST = 2.5  # deg: a direction needs some width to be weighed over
OUTERMOST = 0.001  # shares beyond are drawn as this one: no table reaches all of a normal distribution
FINEST, COARSEST = 36, 8  # directions that a sample is taken in, at most and at least
SEAT_STEP, SEAT_SAMPLES, SEAT_BINS = 2.0, 64, 8  # um that the wheel's centre is moved by, to see what its seat does


@dataclass(frozen=True)
class Effort:
    """Samples times directions, about; mesh of the tables; positions of each wheel that stand for the cycle."""

    samples: int
    mesh: Mesh
    turns: int


# these miss F'_ior of vzp160 by 1.3 %, and by 2 % and their mean; that counts as misfit
FULL = Effort(12_288, Mesh((25, 9, 13, 13), 8), 24)
QUICK = Effort(1536, Mesh((9, 5, 9, 9), 0), 16)  # to see within a second what can be reached at all


@dataclass(frozen=True, eq=False)
class Cloud:
    """Samples of a drive, and their F'_ior [arcsec] at the torque of the rig that trials are measured on.

    tables by torque M_g [N*m]; values by field, weight before any trial, which sums to 1, and F_ior_arcsec with the
    wheel at 0, all of shape (samples, directions); seat, some F'_ior and what a micrometre of the wheel's centre does
    to them [arcsec/um]; seed of all that is drawn.
    """

    drive: Drive
    rig: Rig
    tables: Mapping[float, ErrorTable]
    turns: int
    values: Mapping[str, Array]
    weight: Array
    F_ior_arcsec: Array
    seat: tuple[Array, Array] = (np.zeros(1), np.zeros(1))
    seed: int = 0

    @property
    def certificate(self) -> Certificate:
        """Proof of all that was solved."""
        return sum((table.certificate for table in self.tables.values()), EMPTY)

    @property
    def offset_um(self) -> NDArray[np.complex128]:
        """Standing offset as x + i y, shape (samples * directions,)."""
        size, direction = (self.values[path] for path in standing_offset(self.drive))
        return np.ravel(size * np.exp(1j * np.radians(direction)))

    def noise(self, F_ior: Array) -> Array:
        """Standard deviation of values of so much F'_ior [arcsec] by what was told: noise and the seat's error."""
        return np.asarray(np.hypot(self.rig.noise_arcsec, self.rig.reseat_um * np.interp(F_ior, *self.seat)))

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
        if M_g is not None:
            used, sample = np.unique(sample, return_inverse=True)
            found = self.evaluated(M_g, used, executor)
        whole, part = np.divmod(np.round(np.multiply(rotations_deg, count) / 360, 9), 1)
        turned = direction[:, None] - whole.astype(int)
        here, beside = (found[sample[:, None], (turned - j) % count] for j in (0, 1))
        return np.asarray((1 - part) * here + part * beside)

    def evaluated(self, M_g: float, samples: Places, executor: Executor | None = None, off_um: complex = 0) -> Array:
        """F'_ior [arcsec] of samples in all directions, shape (samples, directions), from the table."""
        values = {path: of[samples].ravel() for path, of in self.values.items()}
        found = F_ior_of_many(self.drive, self.tables[M_g], values, count=self.turns, off_um=off_um, executor=executor)
        return found.reshape(len(samples), -1)


def cloud_of(
    drive: Drive,
    torques: Sequence[float],
    rig: Rig,
    *,
    seed: int = 0,
    effort: Effort = FULL,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Cloud:
    """Draw what is not known of a drive.

    Arguments: torques [N*m] beside the rig's; executor and progress as in error_tables. Raises UsageError for a drive
    with rolling balls, without an offset, or with an uncertainty in a field that is no deviation; UntrustedError where
    an answer cannot be trusted.
    """
    if not searchable(drive):
        raise UsageError("trials need locked balls", "bearing.ball_motion: locked")
    if others := [path for path in drive.uncertainty if not path.startswith(DEVIATIONS)]:
        raise UsageError(
            f"trials cannot take in an uncertainty of {', '.join(others)}",
            "leave it out; sets of values that agree with a calibration belong to alternatives",
        )
    every = list(dict.fromkeys([*torques, rig.M_g]))
    values, weight = _drawn(drive, effort.samples, seed)
    # a table is compared with some of the samples, and reaches to the outermost one
    compared, turn, count = np.arange(effort.mesh.compared), standing_offset(drive)[1], weight.shape[1]
    some = {path: of[compared, 0] for path, of in values.items()}
    some[turn] = some[turn] + 360 * (5 * compared % count) / count
    widest = {path: float(of.max()) for path, of in values.items()}
    widest |= {"tolerances.e_b": drive.number("tolerances.e_b") + SEAT_STEP} if rig.reseat_um else {}
    span = [*listed(drive, some, len(compared)), drive.with_values(widest)]
    [found] = error_tables(
        [(drive, span)], every, mesh=effort.mesh, count=effort.turns, executor=executor, progress=progress
    )
    cloud = Cloud(drive, rig, dict(zip(every, found, strict=True)), effort.turns, values, weight, weight, seed=seed)
    cloud = replace(cloud, F_ior_arcsec=cloud.evaluated(rig.M_g, np.arange(len(weight)), executor))
    return replace(cloud, seat=_seat(cloud, executor)) if rig.reseat_um else cloud


def _seat(cloud: Cloud, executor: Executor | None) -> tuple[Array, Array]:
    """Some F'_ior and the standard deviation there for each micrometre of that of the wheel's centre.

    Drives with a large F'_ior move far more; of drives that show the same the median is taken.
    """
    some, still = np.arange(SEAT_SAMPLES), cloud.F_ior_arcsec[:SEAT_SAMPLES]
    moved = [cloud.evaluated(cloud.rig.M_g, some, executor, SEAT_STEP * 1j**k) - still for k in range(4)]
    # both components vary: twice the mean square over four directions, were it linear
    square = 2 * np.mean(np.square(moved), axis=0).ravel() / SEAT_STEP**2
    bins = np.array_split(np.argsort(still, axis=None), SEAT_BINS)
    means = np.array([(still.ravel()[part].mean(), np.sqrt(np.median(square[part]))) for part in bins])
    return means[:, 0], means[:, 1]


def open_fields(drive: Drive) -> dict[str, tuple[float, float]]:
    """Fields of a drive that are not known, and their ranges; the direction of the standing offset is left out.

    The standing offset is anywhere up to WIDEST times the preset's, unless the preset gives an uncertainty for it; so
    is the one that turns with the cam, in any direction. Other fields vary by the uncertainty that they have (their
    range plays no part); deviations that the preset does not give, over what they may be (model/unknown.py). Raises
    UsageError where nothing is known of the size of the standing offset.
    """
    (size, direction), own = standing_offset(drive), "tolerances.e_hh"
    found = {size: (0.0, WIDEST * drive.number(size))}
    if drive.number(own) or any(spread for path, spread in drive.uncertainty.items() if path not in (size, direction)):
        found |= {own: (0.0, WIDEST * drive.number(own)), "phases.phi_hh": (0.0, 360.0)}
    known = {each.path: (each.low, each.high) for each in unknowns(drive)} | dict.fromkeys(
        drive.uncertainty, (0.0, 0.0)
    )
    if size not in known and not drive.number(size) > 0:
        raise UsageError(
            f"nothing is known of the size of the cam offset {size}",
            f"--set {size}=80 says that up to {WIDEST:g} times 80 um are likely",
        )
    found |= known
    return {path: found[path] for path in sorted(found.keys() - {direction})}


def _drawn(drive: Drive, count: int, seed: int) -> tuple[dict[str, Array], Array]:
    """Values of samples by field, and how likely each is, of shape (samples, directions)."""
    open_, (_, turn), holes = open_fields(drive), standing_offset(drive), drive.mounting.holes
    directions = holes * -(-COARSEST // holes) if 0 < holes <= FINEST else FINEST
    turned = 360 / directions * np.arange(directions)
    stand = {turn} if drive.mounting.fixed == "flexspline" else {turn, OVALITY}
    # a standing ovality that is known does not turn with the samples: each is taken in one direction, so there are more
    fixed = OVALITY in stand and drive.number("harmonics.a_s2") != 0 and drive.value(OVALITY) is not None
    share = qmc.Sobol(len(open_) + 1, seed=seed).random(2 ** round(np.log2(count / (3 if fixed else directions))))
    drawn = {turn: (360.0 if fixed else 360 / directions) * share[:, -1]}
    drawn |= {OVALITY: np.full(len(share), drive.number(OVALITY))} if fixed else {}
    for (path, (low, high)), of in zip(open_.items(), share.T, strict=False):
        uncertain, within = path in drive.uncertainty, np.clip(of, OUTERMOST, 1 - OUTERMOST)
        drawn[path] = uncertain_values(drive, path, within) if uncertain else low + (high - low) * of
    values = {path: of[:, None] + turned * (path in stand) for path, of in drawn.items()}
    values |= {path: values[path] % 360 for path in stand & values.keys()}
    weight = np.ones((len(share), directions))
    if turn in drive.uncertainty:
        away = (values[turn] - drive.number(turn) + 180) % 360 - 180
        weight = norm.pdf(away, 0, max(drive.uncertainty[turn] / 2, NARROWEST))
    if fixed:
        weight[:, 1:] = 0
    return values, weight / weight.sum()
