"""How far a drive's own stiffnesses and clearances may be from the preset's, and what that does to its error.

No shop measures the stiffness of a support: a comparison that takes the preset as true explains it by deviations,
and is far too sure of them. So each may be off by a standard deviation of its own, one unknown more of the fit: what it
would do to the orders widens their covariance, and what a fit can explain by it is no deviation.
"""

from __future__ import annotations

import numpy as np

from hdassist.error.waves import MIDDLE, Complex, ErrorWaves
from hdassist.errors import Fault, UntrustedError
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Progress

# standard deviation of each, as a share of it
SHARES = {"supports.C_2": 0.3, "supports.C_3": 0.3, "contact.c_t": 0.3, "cam.W_0": 0.02}
CLEARANCE = 1.0  # um: of gears.j_n


def doubtful_waves(drive: Drive, M_g: float, torus: ErrorWaves, progress: Progress | None = None) -> Complex:
    """By what the waves of a drive [arcsec] change for a standard deviation of each field, shape (2 fields, waves).

    Half the difference of both ways, and how far their mean is from the drive as it is: what is bent. A field that the
    drive cannot have so is left out. Arguments: torus, waves of the drive at M_g [N*m], to whose certificate the states
    solved here are added.
    """
    (here,) = torus.waves([drive], MIDDLE)

    def moved(path: str, value: float) -> Complex:
        other = drive.with_values({path: value})
        waves = ErrorWaves(other, M_g, progress)
        (found,) = waves.waves([other], MIDDLE)
        torus.certificate += waves.certificate
        return np.asarray(found - here)

    spans = {path: drive.number(path) * share for path, share in SHARES.items()} | {"gears.j_n": CLEARANCE}
    changes = []
    for path, span in spans.items():
        low, high = (drive.number(path) + way * span for way in (-1, 1))
        if not (span and drive.allows(path, low) and drive.allows(path, high)):
            continue
        try:
            less, more = moved(path, low), moved(path, high)
        except UntrustedError as error:
            if error.fault == Fault.EDGE_OF_WINDOW:
                raise
            continue
        changes += [(more - less) / 2, (more + less) / 2]
    return np.reshape(changes, (len(changes), len(here)))
