"""A measured trace as a comparison sees it: coefficients of its orders, how sure they are, and what a model would give.

A predicted curve goes through the same least squares, with the same levels and drift, at the same angles as the
measured one: whatever that cannot tell apart it cannot tell apart in either.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from hdassist.error.cycle import kinematic_error
from hdassist.error.waves import Complex, ErrorWaves
from hdassist.measuring.measure import SweepResult
from hdassist.measuring.orders import MeasuredOrder
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics, pitch_locked_states
from hdassist.preset.fields import Drive
from hdassist.run.run import UNCHECKED
from hdassist.solve.answers import Certificate

EXACT = 2e-4  # of F'_ior, in each coefficient: as far as a predicted curve counts as exact
MODEL_ERROR = 0.03  # of each order: standard deviation of all else that a model may have wrong
CHI_SQUARE_CLEAR = 4.0  # standard deviations of a chi-square
START_GRID = 72  # starts, 5 deg apart
START_ZERO_GRID = 48  # of each where both are scanned


@dataclass(frozen=True)
class Alignment:
    """Where a record stands in the drive's cycle, and how it counts.

    start: angle of the moving wheel [rad] at phi_h = 0 (phi_g0 with the rigid wheel fixed); zero: phi_h [rad] where the
    rig's cam angle is 0; sign: F_kpp over the error of the file, 1 or -1; sense: of the rig's cam angle, 1
    counter-clockwise seen from the cam side, or -1.
    """

    start: float = 0.0
    zero: float = 0.0
    sign: float = 1.0
    sense: float = 1.0

    def phi_h(self, turns: Array) -> Array:
        """Cam angles [rad] of the drive from those of the rig [turns]."""
        return np.asarray(self.sense * 2 * np.pi * turns + self.zero)


@dataclass(frozen=True)
class OrderPair:
    """One order, measured and predicted: amplitude cos(per_cam_rev phi + phase), phi the rig's cam angle.

    difference_arcsec: amplitude of the difference of both, with its standard uncertainty.
    """

    measured: MeasuredOrder
    predicted_arcsec: float
    predicted_phase_deg: float
    difference_arcsec: float
    difference_uncertainty_arcsec: float


class RecordedOrders:
    """Coefficients of one direction of a measured trace, and of a model's waves at its angles.

    sweep: the measured direction; measured: cosines, then sines, of the error as the file has it [arcsec], shape
    (2 orders,); covariance S of (14): of the difference to a model's, shape (2 orders, 2 orders); order: how often each
    wave goes by in a cam turn, shape (waves,); rates: turns of flexspline and rigid wheel before the cam in a cam turn;
    starts: of these wheels, how far each turns with the start.
    """

    def __init__(self, sweep: SweepResult, torus: ErrorWaves, kinematics: Kinematics) -> None:
        self.sweep, self.design = sweep, sweep.fit.design
        self.measured: Array = sweep.fit.coefficients
        floor = (EXACT * sweep.range.value) ** 2
        self._noise: Array = sweep.fit.factor @ sweep.fit.factor.T + floor * np.eye(len(self.measured))
        self.covariance = self._noise
        self._root = np.linalg.cholesky(self.covariance)
        rate_g, rate_b = (kinematics.teeth_fixed / z for z in (kinematics.z_g, kinematics.z_b))
        self.order = torus.k_g * rate_g + torus.k_b * rate_b
        self.rates = rate_g, rate_b
        self.starts = (1.0, 0.0) if kinematics.fixed == "rigid" else (0.0, 1.0)
        self.moving = torus.k_g if kinematics.fixed == "rigid" else torus.k_b
        both = self.design.project(self._waves)[: len(self.measured)]
        self._cosine, self._sine = both[:, : len(self.order)], both[:, len(self.order) :]

    def _waves(self, rows: slice) -> Array:
        angle = (2 * np.pi) * self.design.bins.turns[rows, None] * self.order
        return np.concatenate([np.cos(angle), np.sin(angle)], axis=1)

    def doubting(self, waves: Complex, changes: Complex, alignment: Alignment) -> RecordedOrders:
        """The record with the doubt of a model in its covariance (14).

        Arguments: waves of the model, shape (waves,); changes of them by a standard deviation of each doubtful field,
        shape (changes, waves); alignment, at which they are taken.
        """
        result = copy(self)
        moved = self.predicted(changes, alignment)  # (changes, 2 orders)
        cosines, sines = self.predicted(waves, alignment).reshape(2, -1)
        power = np.tile((cosines**2 + sines**2) / 2, 2)
        result.covariance = self._noise + moved.T @ moved + np.diag(MODEL_ERROR**2 * power)
        result._root = np.linalg.cholesky(result.covariance)
        return result

    def predicted(self, waves: Complex, alignment: Alignment) -> Array:
        """Coefficients p of (13) that waves give in the file [arcsec], shape (..., 2 orders)."""
        turned = np.asarray(waves * np.exp(1j * (self.moving * alignment.start - self.order * alignment.zero)))
        sines = alignment.sense * turned.imag
        return np.asarray(alignment.sign * (turned.real @ self._cosine.T + sines @ self._sine.T))

    def slopes(self, waves: Complex, alignment: Alignment) -> Array:
        """Change of the coefficients [arcsec/rad] with start and zero of an alignment, shape (2, 2 orders)."""
        return self.predicted(np.stack([1j * self.moving * waves, -1j * self.order * waves]), alignment)

    def whitened(self, coefficients: Array) -> Array:
        """Coefficients, shape (..., 2 orders), in units of their standard deviation, independent: L^-1 of (13)."""
        return np.asarray(np.linalg.solve(self._root, coefficients.T).T)

    def of_curve(self, values: Array) -> Array:
        """Coefficients [arcsec] of a curve with values at the bins."""
        return self.design.project(lambda rows: values[rows, None])[: len(self.measured), 0]

    def pairs(self, predicted: Array, difference: Array) -> tuple[OrderPair, ...]:
        """Each order beside predicted coefficients and the difference of both [arcsec], shape (2 orders,) each."""
        pairs = []
        for k, order in enumerate(self.sweep.orders):
            own = [k, len(self.sweep.orders) + k]
            cosine, sine = predicted[own]
            size = float(np.hypot(*difference[own]))
            unit = difference[own] / size if size else np.array([1.0, 0.0])
            uncertainty = float(np.sqrt(unit @ self.covariance[np.ix_(own, own)] @ unit))
            phase = float(np.degrees(np.arctan2(-sine, cosine)))
            pairs.append(OrderPair(order, float(np.hypot(cosine, sine)), phase, size, uncertainty))
        return tuple(pairs)

    def scan(self, waves: Complex, alignment: Alignment, *, start: bool, zero: bool) -> tuple[Alignment, float]:
        """The alignment that fits waves best on a grid of starts and zeros, and its chi-square (13).

        Arguments: alignment, kept where it is not scanned; start, zero: what is.
        """
        count = START_ZERO_GRID if zero else START_GRID
        grid = np.arange(count) * (2 * np.pi / count)
        starts = alignment.start + (grid if start else np.zeros(1))
        best, least = alignment, np.inf
        for angle in alignment.zero + (grid if zero else np.zeros(1)):
            at_zero = replace(alignment, zero=float(angle), start=0.0)
            turned = waves * np.exp(1j * self.moving * starts[:, None])
            chi_square = (self.whitened(self.measured - self.predicted(turned, at_zero)) ** 2).sum(axis=1)
            if chi_square.min() < least:
                least = float(chi_square.min())
                best = replace(at_zero, start=float(starts[chi_square.argmin()]))
        return best, least

    def within_noise(self, chi_square: float, unknowns: int = 0) -> bool:
        """Whether noise alone may leave such a chi-square: within CHI_SQUARE_CLEAR standard deviations."""
        freedom = self.freedom(unknowns)
        return chi_square <= freedom + CHI_SQUARE_CLEAR * float(np.sqrt(2 * freedom))

    def freedom(self, unknowns: int) -> int:
        """Degrees of freedom that so many unknowns leave."""
        return max(1, len(self.measured) - unknowns)


def rms(coefficients: Array) -> float:
    """Root mean square of the curve that has such coefficients, shape (2 orders,)."""
    return float(np.sqrt((coefficients**2).sum() / 2))


def solved_curve(drive: Drive, M_g: float, turns: Array, alignment: Alignment) -> tuple[Array, Certificate]:
    """Predicted error as the file has it [arcsec], up to a constant, at the rig's cam angles [turns], and its proof.

    The four pitch-locked states around each angle are solved; a cubic goes through them.
    """
    kinematics = Kinematics.of(drive)
    pitches = alignment.phi_h(turns) * kinematics.teeth_fixed / (2 * np.pi)  # (turns,)
    first = np.floor(pitches + 1e-6).astype(np.int64) - 1
    around = np.mod(first[:, None] + np.arange(4), kinematics.cycle_states)  # (turns, 4)
    index, places = np.unique(around.ravel(), return_inverse=True)
    states = pitch_locked_states(kinematics, index, alignment.start)
    error = kinematic_error(drive, M_g, states=states, run=UNCHECKED)
    t = pitches - first
    cubic = (
        -(t - 1) * (t - 2) * (t - 3) / 6, t * (t - 2) * (t - 3) / 2, -t * (t - 1) * (t - 3) / 2,
        t * (t - 1) * (t - 2) / 6,
    )  # fmt: skip
    nodes = error.error_arcsec[places].reshape(-1, 4)
    return alignment.sign * (np.stack(cubic, axis=1) * nodes).sum(axis=1), error.certificate
