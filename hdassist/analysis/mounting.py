"""F'_ior against the mounting angle of the fixed wheel: what turning it on its seat brings.

Source: Lyuminarsky et al. 2019, Fig. 3, doi 10.18698/0536-1044-2019-11-3-8.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import product

import numpy as np

from hdassist.analysis.kinematic_error import CrossCheck, kinematic_error
from hdassist.errors import UsageError
from hdassist.model.deviations import tooth_phases
from hdassist.model.geometry import Array
from hdassist.preset.drive import Drive
from hdassist.solve.answers import EMPTY, Certificate, Progress

SAMPLE = 1  # random states solved again at each position, besides those of the extremes


@dataclass(frozen=True)
class Position:
    """The fixed wheel turned by rotation_deg from where it stands, and F'_ior [arcsec] there at each torque.

    phase_deg: direction of the fixed wheel's deviation from the cam offset that stands with it, in 0..360.
    """

    rotation_deg: float
    phase_deg: float
    F_ior_arcsec: tuple[float, ...]


@dataclass(frozen=True)
class MountingCurve:
    """F'_ior over rotations of the fixed wheel.

    torques [N*m]; rotation_deg, shape (rotations,), counter-clockwise seen from the cam side, the present
    position first; phase_deg, the same positions as phases; F_ior_arcsec, shape (torques, rotations).
    """

    torques: tuple[float, ...]
    rotation_deg: Array
    phase_deg: Array
    F_ior_arcsec: Array
    certificate: Certificate
    cross_checks: tuple[CrossCheck, ...]

    def at(self, place: int) -> Position:
        """One of the positions."""
        values = tuple(float(v) for v in self.F_ior_arcsec[:, place])
        return Position(float(self.rotation_deg[place]), float(self.phase_deg[place]), values)

    @property
    def relative(self) -> Array:
        """Greatest over the torques of F'_ior against that of the present position, shape (rotations,)."""
        return np.asarray((self.F_ior_arcsec / self.F_ior_arcsec[:, :1]).max(axis=0))

    @property
    def current(self) -> Position:
        """Where the wheel stands."""
        return self.at(0)

    @property
    def recommended(self) -> Position:
        """The position that is best for the torque it serves worst; the least turn of equals."""
        return self.at(int(np.argmin(self.relative)))

    @property
    def worst(self) -> Position:
        """The position that is worst for some torque."""
        return self.at(int(np.argmax(self.relative)))

    def extremes(self, torque: int) -> tuple[Position, Position]:
        """Best and worst position for one torque alone, by its place."""
        values = self.F_ior_arcsec[torque]
        return self.at(int(np.argmin(values))), self.at(int(np.argmax(values)))


def rotated(drive: Drive, rotation_deg: float) -> Drive:
    """The drive with its fixed wheel turned on its seat [deg], counter-clockwise seen from the cam side."""
    name = "xi_b" if drive.mounting.fixed == "rigid" else "xi_g"
    turned = {name: getattr(drive.phases, name) + rotation_deg}
    return drive.model_copy(update={"phases": drive.phases.model_copy(update=turned)})


def phase_deg(drive: Drive) -> float:
    """Direction of the fixed wheel's deviation from the cam offset that stands with it [deg], in 0..360."""
    xi_g, xi_b = np.degrees(tooth_phases(drive))
    rigid = drive.mounting.fixed == "rigid"
    phase = xi_b - drive.phases.phi_hb if rigid else xi_g - drive.phases.phi_hg
    return float(np.mod(round(float(phase), 9), 360.0))


def mounting_curve(
    drive: Drive,
    torques: Sequence[float],
    rotations_deg: Sequence[float],
    *,
    cross_check: str | None = "CLARABEL",
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> MountingCurve:
    """F'_ior over the full cycle at each torque [N*m] and each rotation [deg] of the fixed wheel.

    Arguments: rotations_deg, 0 first, which is where the wheel stands; executor, to spread the work over
    (any concurrent.futures executor; the numbers do not depend on it); progress, told how many positions
    were computed. Raises UsageError where the present position is not the first, UntrustedError where an
    answer cannot be trusted.
    """
    if not len(rotations_deg) or rotations_deg[0] != 0:
        raise UsageError("the first rotation must be 0, the present position")
    work = [(rotated(drive, r), M_g, cross_check, seed) for M_g, r in product(torques, rotations_deg)]
    values, certificate, checks = [], EMPTY, []
    answers: Iterator[_Answer] = executor.map(_one, work) if executor else map(_one, work)
    for F_ior, proof, check in answers:
        values.append(F_ior)
        certificate += proof
        checks += [check] if check else []
        if progress:
            progress(1)
    return MountingCurve(
        torques=tuple(torques),
        rotation_deg=np.array(rotations_deg, dtype=float),
        phase_deg=np.array([phase_deg(rotated(drive, r)) for r in rotations_deg]),
        F_ior_arcsec=np.array(values).reshape(len(torques), len(rotations_deg)),
        certificate=certificate,
        cross_checks=tuple(checks),
    )


_Answer = tuple[float, Certificate, CrossCheck | None]


def _one(work: tuple[Drive, float, str | None, int]) -> _Answer:
    drive, M_g, cross_check, seed = work
    error = kinematic_error(drive, M_g, cross_check=cross_check, sample=SAMPLE, seed=seed)
    return error.F_ior_arcsec, error.certificate, error.cross_check
