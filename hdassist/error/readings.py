"""What a test reads of the error: its range over a few positions of the output, of many drives at once."""

from __future__ import annotations

from functools import partial

import numpy as np

from hdassist.error.cycle import state_place
from hdassist.error.error_map import Batch, ErrorMap
from hdassist.error.extremes import many_extremes
from hdassist.model.contacts import StateGaps
from hdassist.model.geometry import Array, Kinematics, States
from hdassist.solve.answers import Certificate


def ranges_as_tested(
    error_map: ErrorMap,
    batch: Batch,
    positions: int,
    starts: Array,
    grids: tuple[int, ...],
) -> tuple[Array, Certificate]:
    """Return the range of the error that a test reads [arcsec], shape (drives,), and the proof.

    Args:
        error_map: of the contact system, at the torque of the test.
        batch: the drives.
        positions: that are read over an output revolution; 0 for the whole of F'_ior.
        starts: where each test starts, as a share of the full mesh cycle, shape (drives,).
        grids: that propose the extremes of the whole of F'_ior.

    Raises UntrustedError if an answer cannot be trusted.
    """
    if not positions:
        extremes = many_extremes(error_map, batch, grids)
        return extremes.F_ior_arcsec, extremes.certificate
    states = position_states(error_map, positions, starts)
    row = np.repeat(np.arange(len(batch)), positions)
    scalars = batch.scalars(row, states.alpha_g, states.alpha_b)
    answers = error_map.load_case().solve(StateGaps(scalars), partial(state_place, states, error_map.M_g))
    readings = answers.rotation_arcsec.reshape(len(batch), positions)
    return np.ptp(readings, axis=1), answers.certificate


def position_states(error_map: ErrorMap, positions: int, starts: Array) -> States:
    """Return the states nearest to even positions over an output revolution, those of one test after the other.

    Args:
        error_map: of the drive.
        positions: their number.
        starts: the first position of each test, as a share of the full mesh cycle, shape (starts,).
    """
    kinematics = Kinematics.of(error_map.drive)
    output_revolutions = kinematics.cycle_cam_revolutions / abs(kinematics.u)  # of the full mesh cycle
    steps = np.arange(positions) / positions / output_revolutions
    nearest = np.rint(np.add.outer(starts, steps) * kinematics.cycle_states)
    index = nearest.astype(np.int64) % kinematics.cycle_states
    return error_map.states.take(index.ravel())
