"""Readings of a test: the range of the error over a few positions of the output, for many drives at once."""

from __future__ import annotations

from functools import partial

import numpy as np

from hdassist.drive.error.cycle import state_place
from hdassist.drive.error.error_map import Batch, ErrorMap
from hdassist.drive.error.extremes import many_extremes
from hdassist.drive.model.contacts import StateGaps
from hdassist.drive.model.geometry import Array, Kinematics, States
from hdassist.drive.solve.answers import Certificate


def ranges_as_tested(
    error_map: ErrorMap,
    batch: Batch,
    positions: int,
    starts: Array,
    grids: tuple[int, ...],
) -> tuple[Array, Certificate]:
    """Return the range of the error as read in a test [arcsec], shape (drives,), and the certificate.

    Args:
        error_map: map of the contact system at the torque of the test.
        batch: the drives.
        positions: number of positions read over an output revolution; 0 for the full mesh cycle.
        starts: start of each test, as a share of the full mesh cycle, shape (drives,).
        grids: grids that propose the extremes over the full mesh cycle.

    Raises UntrustedError if a result cannot be trusted.
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


def position_states(
    error_map: ErrorMap,
    positions: int,
    starts: Array,
) -> States:
    """Return the states nearest to evenly spaced positions over an output revolution, test by test.

    Args:
        error_map: map of the drive.
        positions: number of positions.
        starts: first position of each test, as a share of the full mesh cycle, shape (starts,).
    """
    kinematics = Kinematics.of(error_map.drive)
    # output revolutions in the full mesh cycle
    output_revolutions = kinematics.cycle_cam_revolutions / abs(kinematics.u)
    steps = np.arange(positions) / positions / output_revolutions
    nearest = np.rint(np.add.outer(starts, steps) * kinematics.cycle_states)
    index = nearest.astype(np.int64) % kinematics.cycle_states
    return error_map.states.take(index.ravel())
