"""What is taken to be possible of a drive before any trial, and how a value of it may be off.

The preset's alternatives are left out: other stiffnesses are a misfit of a few per cent, which is taken anyway.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from hdassist.error.error_map import searchable
from hdassist.error.table import DEVIATIONS, Mesh
from hdassist.errors import UsageError
from hdassist.model.deviations import standing_offset
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.run.run import Progress
from hdassist.trials.cloud import MESH, Cloud, Places, any_direction, cloud_of, directions_of, open_fields

SAMPLES = 12_288  # times directions that are alike likely, about
WIDEST = 2.0  # a size without an uncertainty may be so many times the preset's
SEAT_STEP, SEAT_SAMPLES, SEAT_BINS = 2.0, 64, 8  # um that the wheel's centre is moved by, to see what its seat does


@dataclass(frozen=True)
class Rig:
    """How trials are measured: at a torque [N*m], with noise of a value [arcsec] and an error of the seat [um].

    Both are standard deviations; reseat_um is that of the wheel's centre along any direction. Raises UsageError unless
    the torque turns something and they are such.
    """

    M_g: float
    noise_arcsec: float = 1.0
    reseat_um: float = 0.0

    def __post_init__(self) -> None:
        noise, seat = 1e-6 <= self.noise_arcsec <= 1e6, 0 <= self.reseat_um <= 1e3  # beyond, squares are no numbers
        if not (0 < abs(self.M_g) <= 1e7 and noise and seat):
            told = f"{self.M_g:g} N*m with a noise of {self.noise_arcsec:g} arcsec, the seat {self.reseat_um:g} um off"
            raise UsageError(f"no trials are at {told}", "up to 1e7 N*m but 0, a noise above 0: --trial-torque 80")


@dataclass(frozen=True, eq=False, kw_only=True)
class Prior(Cloud):
    """The cloud of a drive on a rig; seat: some F'_ior and what a micrometre of the wheel's centre does [arcsec/um]."""

    rig: Rig
    seat: tuple[Array, Array] = (np.zeros(1), np.zeros(1))

    def offset(self, places: Places) -> tuple[Array, Array]:
        """Size [um] and direction [deg] of the offset that stands with the fixed wheel, shape (places,) each."""
        size, direction = (self.values[path].ravel()[places] for path in standing_offset(self.drive))
        return size, direction

    def noise(self, F_ior: Array) -> Array:
        """Standard deviation of values of so much F'_ior [arcsec] by what was told: noise and the seat's error."""
        return np.asarray(np.hypot(self.rig.noise_arcsec, self.rig.reseat_um * np.interp(F_ior, *self.seat)))


def prior_of(
    drive: Drive,
    torques: Sequence[float],
    rig: Rig,
    *,
    samples: int = SAMPLES,
    mesh: Mesh = MESH,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Prior:
    """Draw what is not known of a drive; its F'_ior are those at the torque of the rig.

    Arguments: torques [N*m] beside the rig's; samples times directions that are alike likely, about; mesh, seed,
    executor and progress as in cloud_of. Raises UsageError for a drive with rolling balls, without an offset, or with
    an uncertainty in a field that is no deviation; UntrustedError where an answer cannot be trusted.
    """
    if not searchable(drive):
        raise UsageError("trials need locked balls", "bearing.ball_motion: locked")
    if others := [path for path in drive.uncertainty if not path.startswith(DEVIATIONS)]:
        raise UsageError(
            f"trials cannot take in an uncertainty of {', '.join(others)}",
            "leave it out; sets of values that agree with a calibration belong to alternatives",
        )
    open_ = prior_fields(drive)
    # where they count in one direction alone there are more
    count = samples // (directions_of(drive) if any_direction(drive, open_) else 3)
    torques, reach = (rig.M_g, *torques), SEAT_STEP if rig.reseat_um else 0.0
    cloud = cloud_of(
        drive, torques, open_, count, mesh=mesh, off_um=reach, seed=seed, executor=executor, progress=progress
    )
    prior = Prior(**vars(cloud), rig=rig)
    return replace(prior, seat=_seat(prior, executor)) if rig.reseat_um else prior


def _seat(prior: Prior, executor: Executor | None) -> tuple[Array, Array]:
    """Some F'_ior and the standard deviation there for each micrometre of that of the wheel's centre.

    Drives with a large F'_ior move far more; of drives that show the same the median is taken.
    """
    some, still = np.arange(len(prior.weight))[:SEAT_SAMPLES], prior.F_ior_arcsec[:SEAT_SAMPLES]
    moved = [prior.evaluated(None, some, executor, SEAT_STEP * 1j**k) - still for k in range(4)]
    # both components vary: twice the mean square over four directions, were it linear
    square = 2 * np.mean(np.square(moved), axis=0).ravel() / SEAT_STEP**2
    bins = np.array_split(np.argsort(still, axis=None), SEAT_BINS)
    means = np.array([(still.ravel()[part].mean(), np.sqrt(np.median(square[part]))) for part in bins])
    return means[:, 0], means[:, 1]


def prior_fields(drive: Drive) -> dict[str, tuple[float, float]]:
    """Fields of a drive that are not known, and their ranges.

    The standing offset is anywhere up to WIDEST times the preset's, in any direction, unless the preset gives an
    uncertainty for them; so is the one that turns with the cam. Other fields vary by the uncertainty that they have
    (their range plays no part); deviations that the preset does not give, over what they may be (model/unknown.py).
    Raises UsageError where nothing is known of the size of the standing offset.
    """
    (size, direction), own = standing_offset(drive), "tolerances.e_hh"
    found = {size: (0.0, WIDEST * drive.number(size)), direction: (0.0, 360.0)}
    if drive.number(own) or any(spread for path, spread in drive.uncertainty.items() if path not in (size, direction)):
        found |= {own: (0.0, WIDEST * drive.number(own)), "phases.phi_hh": (0.0, 360.0)}
    if size not in (known := open_fields(drive)) and not drive.number(size) > 0:
        raise UsageError(
            f"nothing is known of the size of the cam offset {size}",
            f"--set {size}=80 says that up to {WIDEST:g} times 80 um are likely",
        )
    found |= known
    return {path: found[path] for path in sorted(found, key=lambda path: (path == direction, path))}
