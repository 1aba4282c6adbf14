"""The predicted error at the angles of a record, from solved states."""

from __future__ import annotations

import numpy as np

from hdassist.comparing.record import Place
from hdassist.error.cycle import kinematic_error
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics, pitch_locked_states
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Certificate, Progress


def solved_curve(
    drive: Drive, M_g: float, turns: Array, place: Place, progress: Progress | None = None
) -> tuple[Array, Certificate]:
    """Error as the file has it [arcsec], up to a constant, at the rig's cam angles [turns], and the states' proof.

    The four pitch-locked states around each angle are solved; a cubic goes through them.
    """
    kinematics = Kinematics.of(drive)
    pitches = place.phi_h(turns) * kinematics.teeth_fixed / (2 * np.pi)
    first = np.floor(pitches + 1e-6).astype(np.int64) - 1
    index, where = np.unique(
        np.mod(first[:, None] + np.arange(4), kinematics.cycle_states).ravel(), return_inverse=True
    )
    states = pitch_locked_states(kinematics, index, place.start)
    error = kinematic_error(drive, M_g, states=states, cross_check=None, progress=progress)
    nodes = error.error_arcsec[where].reshape(-1, 4)
    t = pitches - first
    weights = np.stack(
        [
            -(t - 1) * (t - 2) * (t - 3) / 6,
            t * (t - 2) * (t - 3) / 2,
            -t * (t - 1) * (t - 3) / 2,
            t * (t - 1) * (t - 2) / 6,
        ],
        axis=1,
    )
    return place.sign * (weights * nodes).sum(axis=1), error.certificate
