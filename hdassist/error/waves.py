"""The error of a drive over both wheels' angles in the cam's frame, as waves around each of them.

A state's error depends on alpha_g and alpha_b alone: it is a function on a torus. Solved on an even grid there it is
known at any angle of any record, wherever that begins: the waves only turn. The rest (waves beyond HIGHEST
around a wheel) is some hundredths of an arcsec of 28 within orders up to 12. Over the output's angle each wave is a
line, which comes so often in the full cycle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hdassist.error.cycle import KinematicError, kinematic_error
from hdassist.error.error_map import ErrorMap, there_and_back
from hdassist.error.extremes import SHORT_CYCLE
from hdassist.model.contacts import StateGaps
from hdassist.model.deviations import deviation_scalars
from hdassist.model.geometry import Array, Kinematics, pitch_locked_states
from hdassist.preset.fields import Drive
from hdassist.run.run import UNCHECKED, Run
from hdassist.solve.answers import EMPTY, Certificate

WAVE_POINTS = 40  # around each wheel
_HIGHEST = 18  # times around a wheel: waves that are kept
Complex = NDArray[np.complex128]
POINTS_A_TURN = 180  # of the cam, at which curves are computed


def _wave_numbers() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """How often each wave goes around the flexspline's and the rigid wheel's angle, shape (waves,) each."""
    k_g, k_b = np.meshgrid(np.arange(_HIGHEST + 1), np.arange(-_HIGHEST, _HIGHEST + 1), indexing="ij")
    half = (k_g > 0) | (k_b > 0)  # the others are their mirror images
    return k_g[half], k_b[half]


class ErrorWaves:
    """Errors of a drive at a torque M_g [N*m], and of drives that differ from it in their deviations alone.

    k_g, k_b: wave_numbers; certificate: of all states that were solved so far. Argument: error_map of the drive at that
    torque, where there is one. Raises UsageError for a drive with rolling balls.
    """

    def __init__(self, drive: Drive, M_g: float, run: Run = Run(), error_map: ErrorMap | None = None) -> None:
        self._map, self._run = error_map or ErrorMap(drive, M_g), run
        self._case = self._map.load_case()
        self.certificate = EMPTY
        self.k_g, self.k_b = _wave_numbers()

    def waves(self, drives: Sequence[Drive], points: int = WAVE_POINTS) -> Complex:
        """Waves [arcsec] of the error F_kpp of drives, shape (drives, waves).

        The error is the real part of sum z exp(i (k_g alpha_g + k_b alpha_b)), up to a constant. Waves that a grid of
        so many points does not hold are 0. Raises UntrustedError where a state cannot be trusted.
        """
        path = there_and_back((points, points))
        alpha_g, alpha_b = 2 * np.pi / points * np.stack(np.divmod(path, points))

        def where(k: int) -> str:
            g, b = (float(np.degrees(angle[k])) for angle in (alpha_g, alpha_b))
            return f"alpha_g = {g:.2f}°, alpha_b = {b:.2f}°, M_g = {self._map.M_g:g} N*m"

        held = np.maximum(np.abs(self.k_g), np.abs(self.k_b)) < points / 2
        error, found = np.empty(points**2), []
        for drive in drives:
            answers = self._case.solve(StateGaps(deviation_scalars(drive, alpha_g, alpha_b)), where, self._run.solved)
            self.certificate += answers.certificate
            error[path] = self._map.sign * answers.rotation_arcsec
            spectrum = np.fft.fft2(error.reshape(points, points)) / points**2
            found.append(np.where(held, 2 * spectrum[self.k_g % points, self.k_b % points], 0))
        return np.array(found)


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
    from scipy.ndimage import maximum_filter1d, minimum_filter1d  # 20 ms, which draws do without

    turn = kinematics.teeth_fixed
    extent = maximum_filter1d(error_arcsec, turn, mode="wrap") - minimum_filter1d(error_arcsec, turn, mode="wrap")
    return np.asarray(extent)


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
    k_g, k_b = _wave_numbers()
    often = k_g * (kinematics.cycle_states // drive.gears.z_g) + k_b * (kinematics.cycle_states // drive.gears.z_b)
    per_cycle = np.unique(np.abs(often[often != 0]))
    turning = np.where(often > 0, np.conj(waves), waves)  # both wheels turn backwards in the cam's frame
    amplitude = turning @ (np.abs(often)[:, None] == per_cycle)
    return ErrorLines(kinematics, per_cycle, amplitude, certificate)


def _waves_of(drive: Drive, M_g: float, change: Mapping[str, float]) -> tuple[Complex, Certificate]:
    there = drive.with_values(change)
    waves = ErrorWaves(there, M_g)
    return waves.waves([there])[0], waves.certificate
