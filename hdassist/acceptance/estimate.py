"""The error of a drawn drive over its full cycle, read off waves over both wheels' angles, and its worst cam turn."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from hdassist.error.cycle import KinematicError, kinematic_error
from hdassist.error.error_map import SHORT_CYCLE
from hdassist.error.waves import ErrorWaves
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics, pitch_locked_states
from hdassist.preset.fields import Drive
from hdassist.run.run import UNCHECKED
from hdassist.solve.answers import Certificate


@dataclass(frozen=True)
class EstimatedCycle:
    """Error F_kpp [arcsec] of a drive in each state of its full cycle, up to a constant, shape (states,).

    turn_range_arcsec: the greatest range within one cam turn, from every state of the turn in which the estimate ranges
    most; certificate: of all states that were solved.
    """

    error_arcsec: Array
    turn_range_arcsec: float
    certificate: Certificate


def estimated_cycle(drive: Drive, M_g: float, *, short_cycle: int = SHORT_CYCLE) -> KinematicError | EstimatedCycle:
    """Error of a drive at a torque M_g [N*m] over its full cycle, read off its waves; of a short cycle every state.

    Argument: short_cycle, states of a cycle below which all are solved. Raises UsageError for rolling balls,
    UntrustedError where a state cannot be trusted.
    """
    kinematics = Kinematics.of(drive)
    states = kinematics.cycle_states
    if states < short_cycle:
        return kinematic_error(drive, M_g, run=UNCHECKED)
    torus = ErrorWaves(drive, M_g, UNCHECKED)
    periods = torus.k_g * (states // kinematics.z_g) + torus.k_b * (states // kinematics.z_b)  # of each wave in a cycle
    spectrum = np.zeros(states, dtype=complex)
    np.add.at(spectrum, periods % states, torus.waves([drive])[0])
    error = np.fft.fft(spectrum).real  # both wheels turn backwards in the cam's frame
    first = _turn_ranges(error, kinematics).argmax() - kinematics.teeth_fixed // 2
    turn = pitch_locked_states(kinematics, (first + np.arange(kinematics.teeth_fixed)) % states)
    worst = kinematic_error(drive, M_g, states=turn, run=UNCHECKED)
    return EstimatedCycle(error, worst.range_arcsec, torus.certificate + worst.certificate)


def turn_range_arcsec(error: KinematicError | EstimatedCycle) -> float:
    """Greatest range [arcsec] of an error over the full cycle within one cam turn."""
    if isinstance(error, EstimatedCycle):
        return error.turn_range_arcsec
    return float(_turn_ranges(error.error_arcsec, error.kinematics).max())


def _turn_ranges(error_arcsec: Array, kinematics: Kinematics) -> Array:
    """Range [arcsec] of an error over the full cycle within the cam turn around each state, shape (states,) each."""
    turn = kinematics.teeth_fixed
    extent = maximum_filter1d(error_arcsec, turn, mode="wrap") - minimum_filter1d(error_arcsec, turn, mode="wrap")
    return np.asarray(extent)
