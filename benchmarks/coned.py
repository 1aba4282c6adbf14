"""What one state costs with coned flanks, against flanks that bear as a whole."""

from __future__ import annotations

import statistics
import time
from typing import Any

from hdassist import kinematic_error, load_preset
from hdassist.model.contacts import contact_system
from hdassist.run.run import UNCHECKED

STATIONS = (1, 3, 4, 5)


def measure(quick: bool) -> list[dict[str, Any]]:
    """Microseconds of processor time a state of vzp160 over the full cycle, set-up and certificate included.

    Numbers of stations take turns, so that what else the machine does falls on all of them.
    """
    drives = {n: load_preset("vzp160", [f"numerics.stations={n}"]) for n in STATIONS}
    found = []
    for M_g in drives[1].operation.M_g:
        times: dict[int, list[float]] = {n: [] for n in STATIONS}
        for _ in range(1 if quick else 5):
            for n, drive in drives.items():
                begun = time.process_time()
                error = kinematic_error(drive, M_g, run=UNCHECKED)
                times[n].append((time.process_time() - begun) / len(error.states) * 1e6)
        for n, drive in drives.items():
            candidates, us = len(contact_system(drive).delta_p), statistics.median(times[n])
            found.append({"stations": n, "M_g": M_g, "candidates": candidates, "us": us})
    return found
