"""The error over the output's angle as lines: how often each comes in a full cycle, and how large it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hdassist.error.waves import Complex, ErrorWaves, wave_numbers
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.preset.fields import Drive
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate

POINTS_A_TURN = 180  # of the cam, at which curves are computed


@dataclass(frozen=True, eq=False)
class ErrorLines:
    """Lines of the error of drives with the same teeth at one torque: the sum of amplitude exp(i per_cycle angle).

    per_cycle: how often each line comes in the full cycle, shape (lines,); amplitude [arcsec], with its phase, shape
    (drives, lines); certificate of the states behind them.
    """

    kinematics: Kinematics
    per_cycle: NDArray[np.int64]
    amplitude: Complex
    certificate: Certificate

    @property
    def curves(self) -> Array:
        """Errors [arcsec] over the full cycle from its state 0, POINTS_A_TURN a cam turn, shape (drives, points)."""
        points = POINTS_A_TURN * self.kinematics.cycle_cam_revolutions
        spectrum = np.zeros((len(self.amplitude), points // 2 + 1), dtype=complex)
        spectrum[:, self.per_cycle] = self.amplitude
        return np.asarray(np.fft.irfft(spectrum, points) * points / 2)

    @property
    def mean(self) -> ErrorLines:
        """Mean of the drives, as lines of one."""
        return replace(self, amplitude=self.amplitude.mean(axis=0)[None])


def error_lines(drive: Drive, M_g: float, changes: Sequence[Mapping[str, float]], run: Run = Run()) -> ErrorLines:
    """Lines of a drive at a torque M_g [N*m] with the values of each of some changes, by path.

    A wave that goes k_g times around the flexspline and k_b times around the rigid wheel comes k_g L/z_g + k_b L/z_b
    times in the cycle of L = lcm(z_g, z_b) states. Raises UsageError for rolling balls, UntrustedError where a state
    cannot be trusted.
    """
    waves, certificate = [], EMPTY
    for found, proof in run.map(partial(_waves_of, drive, M_g), changes):
        waves.append(found)
        certificate += proof
        run.finished(proof.states)
    kinematics = Kinematics.of(drive)
    k_g, k_b = wave_numbers()
    often = k_g * (kinematics.cycle_states // drive.gears.z_g) + k_b * (kinematics.cycle_states // drive.gears.z_b)
    per_cycle = np.unique(np.abs(often[often != 0]))
    turning = np.where(often > 0, np.conj(waves), waves)  # both wheels turn backwards in the cam's frame
    amplitude = turning @ (np.abs(often)[:, None] == per_cycle)
    return ErrorLines(kinematics, per_cycle, amplitude, certificate)


def _waves_of(drive: Drive, M_g: float, change: Mapping[str, float]) -> tuple[Complex, Certificate]:
    there = drive.with_values(change)
    waves = ErrorWaves(there, M_g)
    return waves.waves([there])[0], waves.certificate
