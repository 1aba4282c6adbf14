"""Deviations of the parts as seen in the cam frame: four scalars, or one value per tooth.

Angles count counter-clockwise, seen from the cam side; deviations act along +theta at the contact.
Teeth: dev_g - dev_b = a sin(theta_x1) + b cos(theta_x1). Cam centre: (e_x, e_y) along x1, y1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import UsageError
from hdassist.model.contacts import ContactSystem
from hdassist.model.geometry import Array
from hdassist.model.kinematics import States
from hdassist.preset.fields import Drive

MARK_TO_PHASE = {"xi": 0.0, "runout": 180.0, "pitch": -90.0}  # deg: a mark is not a phase


def tooth_phases(drive: Drive) -> tuple[float, float]:
    """Phases xi_g, xi_b [rad] of the tooth deviations, converted from marks where the preset gives marks."""
    turn = MARK_TO_PHASE[drive.mounting.mark_kind]
    return float(np.radians(drive.phases.xi_g + turn)), float(np.radians(drive.phases.xi_b + turn))


def deviation_scalars(drive: Drive, alpha_g: Array, alpha_b: Array) -> Array:
    """Scalars (a, b, e_x, e_y) [mm], shape (states, 4), of the preset's first harmonics.

    Arguments: alpha_g = phi_g - phi_h and alpha_b = phi_b - phi_h [rad], how each wheel stands in the
    cam frame, shape (states,).
    """
    sizes, phases = drive.tolerances, drive.phases
    xi_g, xi_b = tooth_phases(drive)
    return scalars_of(
        (sizes.F_i1, xi_g),
        (sizes.F_i2, xi_b),
        (sizes.e_hh, np.radians(phases.phi_hh)),
        (sizes.e_hg, np.radians(phases.phi_hg)),
        (sizes.e_hb, np.radians(phases.phi_hb)),
        alpha_g,
        alpha_b,
    )


Polar = tuple[Array | float, Array | float]


def scalars_of(
    teeth_g: Polar, teeth_b: Polar, offset_h: Polar, offset_g: Polar, offset_b: Polar, alpha_g: Array, alpha_b: Array
) -> Array:
    """Scalars (a, b, e_x, e_y) [mm], shape (..., 4), of many drives at once.

    Arguments: F'_i1, F'_i2 [um] with their phases xi_g, xi_b; e_hh, e_hg, e_hb [um] with their directions; alpha_g,
    alpha_b, how each wheel stands in the cam frame; all angles [rad], all shapes broadcast.
    """
    turned_g, turned_b = np.exp(1j * alpha_g), np.exp(1j * alpha_b)
    g, b, h, cam_g, cam_b = (
        np.asarray(size) * np.exp(1j * np.asarray(angle)) * 1e-3
        for size, angle in (teeth_g, teeth_b, offset_h, offset_g, offset_b)
    )
    teeth = (g * turned_g - b * turned_b) / 2
    cam = h + cam_g * turned_g + cam_b * turned_b
    return np.stack([teeth.real, -teeth.imag, cam.real, cam.imag], axis=-1)


@dataclass(frozen=True)
class ToothDeviations:
    """Measured deviations of the teeth along +theta [um], in place of the preset's first harmonics.

    g: one value per flexspline tooth, shape (z_g,); b: per space of the rigid wheel, shape (z_b,); None keeps
    the first harmonic of that wheel. Tooth and space 0 stand on the major axis when phi_h = phi_g = 0, and
    numbers grow along +theta.
    """

    g: Array | None = None
    b: Array | None = None


def gaps(drive: Drive, system: ContactSystem, states: States, teeth: ToothDeviations | None = None) -> Array:
    """Gaps without force delta_p [mm] of states, shape (states, M).

    Arguments: drive, its deviations; system; states; teeth, measured deviations. Raises UsageError where
    their number is not that of the wheel's teeth.
    """
    if teeth is None or (teeth.g is None and teeth.b is None):
        return system.gaps(deviation_scalars(drive, states.alpha_g, states.alpha_b))
    measured = {"F_i1": teeth.g, "F_i2": teeth.b}
    rest = drive.with_values({f"tolerances.{name}": 0.0 for name, values in measured.items() if values is not None})
    result = gaps(rest, system, states)
    flanks = system.flanks
    seen = np.zeros((len(states), system.n_flanks))
    if teeth.g is not None:
        seen += _at_teeth(teeth.g, flanks.tooth, states.alpha_g, drive.gears.z_g)
    if teeth.b is not None:
        # zone 1 lies half a turn on, where tooth i faces space i + 1: z_b = z_g + 2
        seen -= _at_teeth(teeth.b, flanks.tooth + flanks.zone, states.alpha_b, drive.gears.z_b)
    result[:, : system.n_flanks] -= flanks.side * np.cos(flanks.alpha) * seen
    return result


def _at_teeth(deviation: Array, tooth: NDArray[np.int64], turned: Array, z: int) -> Array:
    if np.shape(deviation) != (z,):
        raise UsageError(f"a wheel of {z} teeth needs {z} deviations, not {np.size(deviation)}")
    # the nearest tooth; half a pitch goes one way in every state, whatever the last digits say
    shift = np.floor(-turned * z / (2 * np.pi) + 0.5 + 1e-6).astype(np.int64)
    return np.asarray(np.asarray(deviation)[(tooth + shift[:, None]) % z] * 1e-3)
