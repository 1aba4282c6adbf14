"""A measured trace as a comparison sees it: coefficients of its orders, how sure they are, and what a model would give.

A predicted curve goes through the same least squares, with the same levels and drift, at the same angles as the
measured one: whatever that cannot tell apart it cannot tell apart in either.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hdassist.error.waves import Complex, ErrorWaves
from hdassist.measuring.design_matrix import Design
from hdassist.measuring.measurement import Direction
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics

SURE = 2e-4  # of F'_ior, in each coefficient: as far as a predicted curve counts as exact
CLEAR = 4.0  # standard deviations of a chi-square
STARTS = 72  # grid of starts, 5 deg
FEWER = 48  # of starts and of zeros where both are looked for


@dataclass(frozen=True)
class Place:
    """Where a record stands in the drive's cycle.

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


class Record:
    """Coefficients of one direction of a measured trace, and of a model's waves at its angles.

    measured: cosines, then sines, of the error as the file has it [arcsec], shape (2 lines,); covariance: of these,
    shape (2 lines, 2 lines), with SURE of the range.
    """

    def __init__(self, found: Direction, torus: ErrorWaves, kinematics: Kinematics) -> None:
        self.found = found
        fit, self._cells, self._kinematics = found.fit, found.cells, kinematics
        self.design = Design(found.cells, fit.orders, len(fit.drift))
        self.measured: Array = fit.coefficients
        floor = (SURE * found.range.value) ** 2
        self.covariance: Array = fit.factor @ fit.factor.T + floor * np.eye(len(self.measured))
        self._root = np.linalg.cholesky(self.covariance)
        self.k_g, self.k_b = torus.k_g, torus.k_b
        rate_g, rate_b = (kinematics.teeth_fixed / z for z in (kinematics.z_g, kinematics.z_b))
        self.order = self.k_g * rate_g + self.k_b * rate_b  # times per cam turn that a wave goes by
        self.rates = rate_g, rate_b
        self.starts = (1.0, 0.0) if kinematics.fixed == "rigid" else (0.0, 1.0)  # which wheel the start turns
        self.moving = self.k_g if kinematics.fixed == "rigid" else self.k_b
        both = self.design.project(self._waves)[: len(self.measured)]
        self._cosine, self._sine = both[:, : len(self.order)], both[:, len(self.order) :]

    def _waves(self, rows: slice) -> Array:
        angle = (2 * np.pi) * self._cells.turns[rows, None] * self.order
        return np.concatenate([np.cos(angle), np.sin(angle)], axis=1)

    def turned(self, waves: Complex, place: Place) -> Complex:
        """Waves of the torus as they stand along the record's cam angle, shape (..., waves)."""
        return np.asarray(waves * np.exp(1j * (self.moving * place.start - self.order * place.zero)))

    def predicted(self, waves: Complex, place: Place) -> Array:
        """Coefficients of the file's error [arcsec] that waves of the torus give, shape (..., 2 lines)."""
        along = self.turned(waves, place)
        return np.asarray(place.sign * (along.real @ self._cosine.T + place.sense * along.imag @ self._sine.T))

    def slopes(self, waves: Complex, place: Place) -> Array:
        """Change of the coefficients [arcsec/rad] with the start and with the zero of a place, shape (2, 2 lines)."""
        return self.predicted(np.stack([1j * self.moving * waves, -1j * self.order * waves]), place)

    def whitened(self, coefficients: Array) -> Array:
        """Coefficients, shape (..., 2 lines), in units of their noise, independent."""
        return np.asarray(np.linalg.solve(self._root, coefficients.T).T)

    def of_curve(self, values: Array) -> Array:
        """Coefficients [arcsec] of a curve with values at the cells."""
        return self.design.project(lambda rows: values[rows, None])[: len(self.measured), 0]

    def within_noise(self, chi_square: float, unknowns: int = 0) -> bool:
        """Whether noise alone would leave such a chi-square in the coefficients, but once in thousands."""
        freedom = self.freedom(unknowns)
        return chi_square <= freedom + CLEAR * float(np.sqrt(2 * freedom))

    def freedom(self, unknowns: int) -> int:
        """Degrees of freedom that so many unknowns leave."""
        return max(1, len(self.measured) - unknowns)


def scan(record: Record, waves: Complex, place: Place, *, start: bool, zero: bool) -> tuple[Place, float]:
    """Place of a record that fits waves best on a grid of starts and zeros, and its chi-square.

    Arguments: place, where to keep what is not looked for; start, zero: what is.
    """
    count = STARTS if not zero else FEWER
    starts = place.start + (np.arange(count) * (2 * np.pi / count) if start else np.zeros(1))
    zeros = place.zero + (np.arange(FEWER) * (2 * np.pi / FEWER) if zero else np.zeros(1))
    best, least = place, np.inf
    for angle in zeros:
        here = replace(place, zero=float(angle), start=0.0)
        turned = waves * np.exp(1j * record.moving * starts[:, None])
        left = record.whitened(record.measured - record.predicted(turned, here))
        chi = (left**2).sum(axis=1)
        if chi.min() < least:
            best, least = replace(here, start=float(starts[chi.argmin()])), float(chi.min())
    return best, least
