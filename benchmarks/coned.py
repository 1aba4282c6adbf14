"""Processor time of one state with coned flanks, compared with whole flanks."""

from __future__ import annotations

import statistics
import time
from typing import Any

from hdassist import kinematic_error, load_preset
from hdassist.drive.model.contacts import contact_system
from hdassist.run.run import UNCHECKED

STATIONS = (1, 3, 4, 5)


def measure(quick: bool) -> list[dict[str, Any]]:
    """Return the processor time per state of vzp160 over the full cycle [us], set-up and certificate included.

    The numbers of stations alternate, so that other load of the machine affects all of them equally.
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
