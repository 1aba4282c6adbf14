"""Standard deviations of a drive's stiffnesses and clearances from the preset's, and the changes of its error by them.

No shop measures the stiffness of a support: a comparison that takes the preset as exact explains such a difference by
deviations, with far too small uncertainties. The changes widen the covariance of the orders, (14) of docs/theory.md.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from hdassist.error.waves import Complex, ErrorWaves
from hdassist.errors import UntrustedError
from hdassist.preset.fields import Drive
from hdassist.run.run import Run

DOUBTED_SHARES = {"supports.C_2": 0.3, "supports.C_3": 0.3, "contact.c_t": 0.3, "cam.W_0": 0.02}
SLOPE_WAVE_POINTS = 24  # around each wheel, for slopes
DOUBTED_CLEARANCE = 1.0  # um, of gears.j_n


def doubts_of(drive: Drive) -> dict[str, float]:
    """Standard deviations of doubtful fields of a drive by path, in their units."""
    shares = {path: drive.number(path) * share for path, share in DOUBTED_SHARES.items() if drive.number(path)}
    return shares | {"gears.j_n": DOUBTED_CLEARANCE}


def doubtful_waves(drive: Drive, M_g: float, torus: ErrorWaves, run: Run = Run()) -> Complex:
    """Changes of a drive's waves [arcsec] for a standard deviation of each doubtful field, shape (changes, waves).

    Two changes a field: half the difference of both ways, and the distance of their mean from the drive as it is. A
    field that cannot have such values in the drive is left out. Arguments: torque M_g [N*m]; torus, waves at M_g, to
    whose certificate the states solved here are added.
    """
    (own,) = torus.waves([drive], SLOPE_WAVE_POINTS)

    def moved(path: str, value: float) -> Complex:
        other = drive.with_values({path: value})
        case = ErrorWaves(other, M_g, run)
        (waves,) = case.waves([other], SLOPE_WAVE_POINTS)
        torus.certificate += case.certificate
        return np.asarray(waves - own)

    changes = []
    for path, deviation in doubts_of(drive).items():
        values = [drive.number(path) + way * deviation for way in (-1, 1)]
        if all(drive.allows(path, value) for value in values):
            with suppress(UntrustedError):
                less, more = (moved(path, value) for value in values)
                changes += [(more - less) / 2, (more + less) / 2]
    return np.reshape(changes, (len(changes), len(own)))
