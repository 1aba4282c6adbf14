"""What F'_ior does when a single number of a drive moves a little: slopes by tolerances, stiffnesses, clearances."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass

from hdassist.error.error_map import extremes_of, searchable
from hdassist.errors import HdassistError, UsageError
from hdassist.model.deviations import deviations_of
from hdassist.model.rules import first_conflict
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import unit_of
from hdassist.solve.answers import EMPTY, Certificate, Progress

STEP = 0.005  # of a value, to both sides
PARTS = (  # of a drive, whose stiffness, clearance or wave F'_ior may hang on
    "gears.j_n", "cam.W_0", "bearing.g_b", "bearing.ring_h", "flexspline.h_1", "flexspline.h_3", "flexspline.k_t",
    "supports.C_1", "supports.C_2", "supports.C_3", "contact.c_t", "contact.k_face", "contact.c_ball", "contact.c_bore",
    "material.E",
)  # fmt: skip


@dataclass(frozen=True)
class Slope:
    """How F'_ior [arcsec] of a drive hangs on a field, by path, about its value, one number a torque each.

    per_unit [arcsec per unit of the field]; elasticity: per cent that F'_ior grows by where the value grows by one,
    None where the value is 0.
    """

    path: str
    value: float
    per_unit: tuple[float, ...]
    elasticity: tuple[float, ...] | None


def slopes(
    drive: Drive,
    torques: Sequence[float],
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> tuple[list[Slope], list[float], Certificate]:
    """Slopes of a drive by its deviations, stiffnesses and clearances, the steepest first; F'_ior [arcsec]; the proof.

    Differences over STEP of a value to both sides, or to one where the other side is no drive; of a clearance of 0
    over a micrometre. Arguments: torques [N*m]; executor, to spread the work over; progress, told how many states were
    solved. Raises UntrustedError where an answer cannot be trusted, UsageError for a drive that cannot be searched.
    """
    if not searchable(drive):
        raise UsageError("with rolling balls the cycle cannot be searched", "set bearing.ball_motion=locked")
    sizes = [each.size for each in deviations_of(drive.mounting.mark_kind) if drive.number(each.size) > 0]
    paths = [*sizes, *(path for path in PARTS if path != drive.unused_tooth_field)]
    tasks = [(drive, tuple(torques), path) for path in ("", *paths)]
    found, proof = [], EMPTY
    for low, values, part in (executor.map if executor else map)(_ends, tasks):
        found.append((low, values))
        proof += part
        if progress:
            progress(part.states)
    (_, (here, _)), *others = found
    result = []
    for path, (width, (below, above)) in zip(paths, others, strict=True):
        if not width:
            continue
        value = drive.number(path)
        per_unit = tuple((b - a) / width for a, b in zip(below, above, strict=True))
        elastic = tuple(slope * value / F for slope, F in zip(per_unit, here, strict=True)) if value else None
        result.append(Slope(path, value, per_unit, elastic))
    result.sort(key=lambda slope: -max(map(abs, slope.elasticity or (0.0,))))
    return result, list(here), proof


_Task = tuple[Drive, tuple[float, ...], str]


def _ends(task: _Task) -> tuple[float, tuple[list[float], list[float]], Certificate]:
    """Width of the step in the field's unit, and F'_ior [arcsec] on both sides; 0 where there is no other side."""
    drive, torques, path = task
    if not path:
        here, proof = _at(drive, torques)
        return 0.0, (here, here), proof
    value = drive.number(path)
    step = STEP * value if value else float(unit_of(field_table()[path]) == "um")
    if not step:
        return 0.0, ([], []), EMPTY
    found = []
    for there in (value - step, value + step):
        moved = drive.with_values({path: there})
        if drive.allows(path, there) and first_conflict(moved) is None:
            with suppress(HdassistError):
                found.append((there, *_at(moved, torques)))
    if len(found) == 1:
        found.append((value, *_at(drive, torques)))
    if not found:
        return 0.0, ([], []), EMPTY
    (low, below, first), (high, above, second) = sorted(found, key=lambda end: end[0])
    return high - low, (below, above), first + second


def _at(drive: Drive, torques: Sequence[float]) -> tuple[list[float], Certificate]:
    found = extremes_of(drive, torques)
    return [each.first for each in found], sum((each.certificate for each in found), EMPTY)
