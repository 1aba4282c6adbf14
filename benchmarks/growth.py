"""Processor time of one state for increasing numbers of teeth in a drive of constant size."""

from __future__ import annotations

import statistics
import time
from typing import Any

from hdassist import Drive, kinematic_error, load_preset
from hdassist.drive.model.contacts import contact_system
from hdassist.run.run import UNCHECKED

TEETH = (100, 200, 300, 400)
PITCH_DIAMETER = 160.0  # mm; pitch diameter of the flexspline


def drive_of(z_g: int) -> Drive:
    """Return vzp160 with other teeth on the same pitch circle.

    The module and the wave decrease with z_g, the profile shifts increase.
    """
    m = PITCH_DIAMETER / z_g
    x_g = 3.1 * z_g / 200
    fields = {"z_g": z_g, "z_b": z_g + 2, "m": m, "x_g": x_g, "x_b": x_g + 0.2}
    return load_preset("vzp160", [*(f"gears.{name}={value}" for name, value in fields.items()), f"cam.W_0={1.2 * m}"])


def measure(quick: bool) -> list[dict[str, Any]]:
    """Return the processor time per state over the full cycle of each drive [us], set-up and certificate included."""
    found = []
    for z_g in TEETH[:2] if quick else TEETH:
        drive = drive_of(z_g)
        for M_g in drive.operation.M_g:
            times = []
            for _ in range(1 if quick or z_g > 200 else 3):
                begun = time.process_time()
                error = kinematic_error(drive, M_g, run=UNCHECKED)
                times.append((time.process_time() - begun) / len(error.states) * 1e6)
            candidates = len(contact_system(drive).delta_p)
            row = {"z_g": z_g, "M_g": M_g, "states": len(error.states), "candidates": candidates}
            found.append({**row, "us": statistics.median(times)})
    return found
