"""F'_ior of a drawn drive as it stands and with its fixed wheel turned, from few states with slopes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hdassist.error.error_map import Batch, ErrorMap
from hdassist.error.sloped import drawn_extremes
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate


def errors_by_turn(
    maps: Sequence[ErrorMap],
    drive: Drive,
    torques: Sequence[float],
    rotations_deg: Sequence[float],
    measured: Sequence[tuple[float, float]] = (),
) -> tuple[Array, Array, Array, Certificate]:
    """F'_ior [arcsec] of a drive at torques [N*m], and with its fixed wheel turned, and the proof of both.

    Results of shape (torques,), (torques, rotations) and (measured,). Arguments: maps of its error at all torques;
    measured, single torques [N*m] with a turn each [deg]. Raises UntrustedError where an answer cannot be trusted.
    """
    proof, now, turned, there = EMPTY, dict[float, float](), dict[float, Array](), dict[tuple[float, float], float]()
    for error_map in maps:
        found = drawn_extremes(error_map, Batch.of(drive))
        M_g, now[error_map.M_g] = error_map.M_g, found.first
        turned[M_g], of_turned = _at_turns(error_map, drive, found.first, rotations_deg)
        # by themselves, so that their digits are the same whatever else is searched
        alone = [at for at in measured if at[0] == M_g]
        F_ior, of_measured = _at_turns(error_map, drive, found.first, [turn for _, turn in alone])
        there |= zip(alone, F_ior.tolist(), strict=True)
        proof += found.certificate + of_turned + of_measured
    of_turns = np.array([turned[M_g] for M_g in torques]).reshape(len(torques), len(rotations_deg))
    return np.array([now[M_g] for M_g in torques]), of_turns, np.array([there[at] for at in measured]), proof


def _at_turns(error_map: ErrorMap, drive: Drive, now: float, turns: Sequence[float]) -> tuple[Array, Certificate]:
    """F'_ior [arcsec] of a drive with its fixed wheel turned [deg], shape (turns,), and the proof of it.

    Argument: now, F'_ior as it stands.
    """
    F_ior, away = np.full(len(turns), now), np.flatnonzero(np.array(turns) % 360)
    if not len(away):
        return F_ior, EMPTY
    there = drawn_extremes(error_map, Batch.turned(drive, np.array(turns)[away]))
    F_ior[away] = there.F_ior_arcsec
    return F_ior, there.certificate
