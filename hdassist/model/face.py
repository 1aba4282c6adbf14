"""Where teeth bear along their face: as a whole, or on strips of a coned rim.

The far end of the shell stays round, so the wave of the rim falls towards it, and flanks that were cut parallel
touch first at the open edge of the tooth ring. Each further strip stands off by its share of the wave.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive

PER_UM = 1e3  # um in a mm
# width of the strip at the far edge over that at the open edge, of many strips: with five of them K1 is met to 1 % and
# F'_ior to 5 %, where strips that widen evenly (edges at b_w (k/n)^2) miss F'_ior by up to 12 %
WIDENING = 14.0


@dataclass(frozen=True)
class Face:
    """Stations along the face of every flank, from the open edge of the tooth ring, shape (stations,).

    fall: share of the nominal wave that is missing there; compliance [mm/N] of a tooth pair there.
    """

    fall: Array
    compliance: Array

    @classmethod
    def of(cls, drive: Drive) -> Face:
        """Stations of a drive.

        One: the flank bears as a whole, with contact.c_t. More: strips, each wider than the one before by the same
        factor, as teeth bear on a few millimetres beside the open edge; each bears at its middle, with contact.k_face
        over its width.
        """
        n, shell = drive.numerics.stations, drive.flexspline
        if n == 1:
            return cls(fall=np.zeros(1), compliance=np.array([drive.contact.c_t]))
        edges = shell.b_w * (WIDENING ** (np.arange(n + 1) / n) - 1) / (WIDENING - 1)
        middle, width = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
        # the cam's W_0 acts at mid-face
        fall = middle / (shell.l - shell.b_w / 2)
        return cls(fall=fall, compliance=1 / (drive.contact.k_face * PER_UM * width))
