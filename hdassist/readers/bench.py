"""Records of a bench beside traces, by the names of their columns: positions that were approached, and torque loops.

Positions: a target angle of the output, the angle or the deviation that was measured there, and the side from which it
was approached, 1 or -1. A loop: torque at the output and its twist, the cam held; a number of the place in a third
column.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdassist.model.geometry import Array
from hdassist.readers.table import NumberTable
from hdassist.readers.words import TURN_ARCSEC, role_in


@dataclass(frozen=True, eq=False)
class PositionRecord:
    """Approaches of positions, each of shape (rows,): target [arcsec], deviation [arcsec], side 1 or -1."""

    table: NumberTable
    target_arcsec: Array
    deviation_arcsec: Array
    side: Array


@dataclass(frozen=True, eq=False)
class LoopRecord:
    """Torque loops, each of shape (rows,): torque [N*m], twist [arcsec], number of the place."""

    table: NumberTable
    torque_Nm: Array
    twist_arcsec: Array
    place: Array


def bench_record(table: NumberTable) -> PositionRecord | LoopRecord | None:
    """Positions or loops of a table by the names of its columns; None for any other, such as a trace."""
    roles = [role_in(name) for name in table.names]
    columns = {role: roles.index(role) for role in reversed(roles) if role}

    def read(role: str, default: str) -> Array:
        return table.in_unit(columns[role], role, default)

    def marks(role: str) -> Array:
        return table.values[:, columns[role]] if role in columns else np.ones(len(table.lines))

    angle = next((role for role in ("twist", "actual", "angle", "output") if role in columns), "")
    if "cam" in columns:
        return None
    if "target" in columns and ("error" in columns or angle):
        target = read("target", "deg")
        if "error" in columns:
            deviation = read("error", "arcsec")
        else:
            deviation = np.mod(read(angle, "deg") - target + TURN_ARCSEC / 2, TURN_ARCSEC) - TURN_ARCSEC / 2
        return PositionRecord(table, target, deviation, np.sign(marks("side")))
    if "torque" in columns and angle and "error" not in columns:
        return LoopRecord(table, read("torque", "N·m"), read(angle, "arcsec"), marks("place"))
    return None
