"""The drive of the paper with flanks that bear as a whole, and the stiffnesses that were identified with them."""

from __future__ import annotations

from functools import cache
from typing import Any

from hdassist import Drive, load_preset
from hdassist.drive.error.error_map import ErrorMap
from tests.helpers.support import changed

FOUND = {
    "numerics.stations": 1, "gears.j_n": 5.937, "flexspline.k_t": 1.186, "bearing.ring_h": 3.907,
    "supports.C_1": 1.83e6, "supports.C_2": 2.928e4, "supports.C_3": 7.412e3, "contact.c_t": 3.944e-5,
    "contact.c_ball": 1.861e-5, "bearing.beta": 0,
}  # fmt: skip


@cache
def whole_flanks() -> Drive:
    """The preset vzp160 with these values, whichever it ships with."""
    return load_preset("vzp160", [f"{path}={value}" for path, value in FOUND.items()])


@cache
def F_ior(M_g: float, **fields: Any) -> float:
    """F'_ior [arcsec] of it at a torque [N*m], with some fields changed, named section__field."""
    drive = changed(whole_flanks(), **fields)
    return ErrorMap(drive, M_g).extremes(drive).first
