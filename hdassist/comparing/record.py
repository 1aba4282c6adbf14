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
from hdassist.solve.answers import Certificate

EXACT = 2e-4  # of F'_ior, in each coefficient: as far as a predicted curve counts as exact
ROUGH = 0.03  # of each order: what else of a model may be wrong
CHI_SQUARE_CLEAR = 4.0  # standard deviations of a chi-square
STARTS = 72  # grid of starts, 5 deg
STARTS_AND_ZEROS = 48  # of each where both are looked for


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


class Record:
    """Coefficients of one direction of a measured trace, and of a model's waves at its angles.

    measured: cosines, then sines, of the error as the file has it [arcsec], shape (2 orders,); covariance: of the
    difference to a model's, shape (2 orders, 2 orders), with EXACT of the range.
    """

    def __init__(self, found: SweepResult, torus: ErrorWaves, kinematics: Kinematics) -> None:
        self.found, self.design = found, found.fit.design
        self.measured: Array = found.fit.coefficients
        floor = (EXACT * found.range.value) ** 2
        self._noise: Array = found.fit.factor @ found.fit.factor.T + floor * np.eye(len(self.measured))
        self.covariance = self._noise
        self._root = np.linalg.cholesky(self.covariance)
        rate_g, rate_b = (kinematics.teeth_fixed / z for z in (kinematics.z_g, kinematics.z_b))
        self.order = torus.k_g * rate_g + torus.k_b * rate_b  # times per cam turn that a wave goes by
        self.rates = rate_g, rate_b
        self.starts = (1.0, 0.0) if kinematics.fixed == "rigid" else (0.0, 1.0)  # which wheel the start turns
        self.moving = torus.k_g if kinematics.fixed == "rigid" else torus.k_b
        both = self.design.project(self._waves)[: len(self.measured)]
        self._cosine, self._sine = both[:, : len(self.order)], both[:, len(self.order) :]

    def _waves(self, rows: slice) -> Array:
        angle = (2 * np.pi) * self.design.bins.turns[rows, None] * self.order
        return np.concatenate([np.cos(angle), np.sin(angle)], axis=1)

    def doubting(self, waves: Complex, changes: Complex, alignment: Alignment) -> Record:
        """The record with a covariance that has a model's doubt in it.

        Arguments: waves of the model, shape (waves,); changes of them by a standard deviation of each doubtful field,
        shape (fields, waves); alignment, at which they are taken. ROUGH of each order is doubted beside these.
        """
        result = copy(self)
        moved, own = self.predicted(changes, alignment), self.predicted(waves, alignment).reshape(2, -1)
        size = np.tile((own**2).sum(axis=0) / 2, 2)
        result.covariance = self._noise + moved.T @ moved + np.diag(ROUGH**2 * size)
        result._root = np.linalg.cholesky(result.covariance)
        return result

    def predicted(self, waves: Complex, alignment: Alignment) -> Array:
        """Coefficients of the file's error [arcsec] that waves of the torus give, shape (..., 2 orders)."""
        along = np.asarray(waves * np.exp(1j * (self.moving * alignment.start - self.order * alignment.zero)))
        return np.asarray(alignment.sign * (along.real @ self._cosine.T + alignment.sense * along.imag @ self._sine.T))

    def slopes(self, waves: Complex, alignment: Alignment) -> Array:
        """Change of the coefficients [arcsec/rad] with start and zero of an alignment, shape (2, 2 orders)."""
        return self.predicted(np.stack([1j * self.moving * waves, -1j * self.order * waves]), alignment)

    def whitened(self, coefficients: Array) -> Array:
        """Coefficients, shape (..., 2 orders), in units of their noise, independent."""
        return np.asarray(np.linalg.solve(self._root, coefficients.T).T)

    def of_curve(self, values: Array) -> Array:
        """Coefficients [arcsec] of a curve with values at the bins."""
        return self.design.project(lambda rows: values[rows, None])[: len(self.measured), 0]

    def pairs(self, predicted: Array, apart: Array) -> tuple[OrderPair, ...]:
        """Orders beside predicted coefficients [arcsec] and what they leave of the measured ones, shape (2 orders,)."""
        found = []
        for k, order in enumerate(self.found.orders):
            own = [k, len(self.found.orders) + k]
            (a, b), (x, y) = predicted[own], apart[own]
            size = float(np.hypot(x, y))
            unit = np.array([x, y]) / size if size else np.array([1.0, 0.0])
            uncertainty = float(np.sqrt(unit @ self.covariance[np.ix_(own, own)] @ unit))
            phase = float(np.degrees(np.arctan2(-b, a)))
            found.append(OrderPair(order, float(np.hypot(a, b)), phase, size, uncertainty))
        return tuple(found)

    def within_noise(self, chi_square: float, unknowns: int = 0) -> bool:
        """Whether noise alone would leave such a chi-square in the coefficients, but once in thousands."""
        freedom = self.freedom(unknowns)
        return chi_square <= freedom + CHI_SQUARE_CLEAR * float(np.sqrt(2 * freedom))

    def freedom(self, unknowns: int) -> int:
        """Degrees of freedom that so many unknowns leave."""
        return max(1, len(self.measured) - unknowns)


def rms(coefficients: Array) -> float:
    """Root mean square of the curve that has such coefficients, shape (2 orders,)."""
    return float(np.sqrt((coefficients**2).sum() / 2))


def scan(record: Record, waves: Complex, alignment: Alignment, *, start: bool, zero: bool) -> tuple[Alignment, float]:
    """Alignment of a record that fits waves best on a grid of starts and zeros, and its chi-square.

    Arguments: alignment, for what is not looked for; start, zero: what is.
    """
    count = STARTS_AND_ZEROS if zero else STARTS
    grid = np.arange(count) * (2 * np.pi / count)
    starts = alignment.start + (grid if start else np.zeros(1))
    best, least = alignment, np.inf
    for angle in alignment.zero + (grid if zero else np.zeros(1)):
        here = replace(alignment, zero=float(angle), start=0.0)
        turned = waves * np.exp(1j * record.moving * starts[:, None])
        left = record.whitened(record.measured - record.predicted(turned, here))
        chi = (left**2).sum(axis=1)
        if chi.min() < least:
            best, least = replace(here, start=float(starts[chi.argmin()])), float(chi.min())
    return best, least


def solved_curve(drive: Drive, M_g: float, turns: Array, alignment: Alignment) -> tuple[Array, Certificate]:
    """Predicted error as the file has it [arcsec], up to a constant, at the rig's cam angles [turns], and its proof.

    The four pitch-locked states around each angle are solved; a cubic goes through them.
    """
    kinematics = Kinematics.of(drive)
    pitches = alignment.phi_h(turns) * kinematics.teeth_fixed / (2 * np.pi)
    first = np.floor(pitches + 1e-6).astype(np.int64) - 1
    index, where = np.unique(
        np.mod(first[:, None] + np.arange(4), kinematics.cycle_states).ravel(), return_inverse=True
    )
    states = pitch_locked_states(kinematics, index, alignment.start)
    error = kinematic_error(drive, M_g, states=states, cross_check=None)
    nodes = error.error_arcsec[where].reshape(-1, 4)
    t = pitches - first
    weights = (
        -(t - 1) * (t - 2) * (t - 3) / 6, t * (t - 2) * (t - 3) / 2, -t * (t - 1) * (t - 3) / 2,
        t * (t - 1) * (t - 2) / 6,
    )  # fmt: skip
    return alignment.sign * (np.stack(weights, axis=1) * nodes).sum(axis=1), error.certificate
