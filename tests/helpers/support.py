"""Helpers of many tests: changed drives, and single mesh positions that are solved and verified."""

from __future__ import annotations

import os
import shutil
import subprocess
from typing import Any

import numpy as np

from hdassist.drive.model.contacts import TO_X1, ContactSystem, contact_system
from hdassist.drive.model.deviations import ToothDeviations, state_gaps
from hdassist.drive.model.geometry import Array, States
from hdassist.drive.preset.fields import Drive
from hdassist.drive.solve.answers import ARCSEC, N_MM, TOLERANCE, displacements, residuals
from hdassist.drive.solve.formulation import Formulation, formulate
from hdassist.drive.solve.loadcase import LoadCase
from hdassist.drive.solve.walk import walk_library

PROVEN = (
    1e-6  # arcsec; two solutions of a state differ by residuals up to TOLERANCE = 1e-8 of a wind-up of some 100 arcsec
)

COMPILER = shutil.which(os.environ.get("CC", "cc"))
HAS_COMPILER = COMPILER and subprocess.run([COMPILER, "--version"], capture_output=True, check=False).returncode == 0
HAS_WALK = HAS_COMPILER or walk_library()[0] is not None  # a wheel may contain it; with a compiler it must exist


def changed(drive: Drive, **fields: Any) -> Drive:
    """Return the drive with some fields changed; fields: new values, named section__field."""
    parts: dict[str, dict[str, Any]] = {}
    for path, value in fields.items():
        section, name = path.split("__")
        parts.setdefault(section, {})[name] = value
    update = {section: getattr(drive, section).model_copy(update=names) for section, names in parts.items()}
    return drive.model_copy(update=update)


def delta_p_of(drive: Drive, system: ContactSystem, states: States, teeth: ToothDeviations | None = None) -> Array:
    """Return the unloaded gaps of states [mm], shape (states, M)."""
    return system.delta_p_of(state_gaps(drive, system, states, teeth))


def compliance(system: ContactSystem) -> Array:
    """Return the compliance between contact candidates [mm/N], shape (M, M)."""
    return system.compliance[np.ix_(system.place, system.place)] + np.diag(system.local)


def rounding(terms: int, size: float = 1.0) -> float:
    """Return the largest difference between two sums of the same terms in different order.

    terms: number n of terms, so each sum has n - 1 additions.
    size: sum of the absolute values of the terms.
    """
    return 2 * terms * float(np.finfo(float).eps) * size


def load_case(formulation: Formulation, torque: float, like: LoadCase | None = None, **options: Any) -> LoadCase:
    """Return the load case at a torque [N*mm]; like: load case whose contact set is the start."""
    return LoadCase(formulation, torque / N_MM, like=like, **options)


def solve_state(system: ContactSystem, torque: float, delta_p: Array) -> tuple[Array, Array, float]:
    """Return the forces [N], displacements [mm, rad] and rotation [arcsec] of one state, and verify the residuals.

    torque: torque [N*mm].
    delta_p: unloaded gaps [mm], shape (M,).
    """
    forces, free, _ = load_case(formulate(system), torque).forces(delta_p[None])
    assert residuals(system, delta_p[None], torque, forces, free).worst[0] <= TOLERANCE
    rotation = float(free[0, system.free_rotation]) * ARCSEC
    return forces[0], displacements(system, forces, free)[0], rotation


def rotation(system: ContactSystem, torque: float, scalars: Array | None = None) -> float:
    """Return the rotation of one state [arcsec].

    torque: torque [N*mm].
    scalars: deviations (a, b, e_x, e_y) [mm], None for no deviations.
    """
    scalars = np.zeros(4) if scalars is None else scalars
    return solve_state(system, torque, system.delta_p + system.deviation_map[:, :4] @ scalars)[2]


def wind_up(drive: Drive, M_g: float = 80.0, tau: float = 0.0, beta: float | None = None) -> float:
    """Return the rotation of a drive without deviations [arcsec].

    M_g: torque [N*m].
    tau: tooth phase [tooth pitches].
    beta: ball phase [ball pitches], None for that of the preset.
    """
    return rotation(contact_system(drive, tau, beta), M_g * 1e3)


def first_harmonic(F_i: float, xi: float, z: int) -> Array:
    """Return the deviation of each tooth along +theta by a first harmonic [unit of F_i], shape (z,).

    F_i: peak-to-peak value.
    xi: phase [rad].
    z: number of teeth, numbered as in ToothDeviations.
    """
    return np.asarray(F_i / 2 * np.sin(2 * np.pi * np.arange(z) / z + TO_X1 - xi))


def fresh_preset(name: str) -> str:
    """Return the text of a preset as written by `hdassist presets new NAME`."""
    from hdassist.drive.loading import load_preset, similar_preset

    return similar_preset(name, load_preset("vzp160"), {})
