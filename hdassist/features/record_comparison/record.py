"""Orders of a measured error and their prediction by a model: deviation vectors, waves, and doubts of the model.

A predicted curve is fitted by the same least squares as the measured one, with the same levels and drift and at the
same angles. Both therefore have the same resolution.

Deviations are fitted as vectors, with size and direction as a complex number. Vectors that cannot be distinguished from
another one in a single position of the wheel are omitted. These are order 3 (on two opposite zones it looks like a
first harmonic), the eccentricity e_b of the circular spline, and the ovality a_s2 of its housing seat.

The stiffness of a support is usually not measured. If a comparison takes the preset as exact, it explains the resulting
difference by deviations, with far too small uncertainties. Doubts of stiffnesses and clearances therefore widen the
covariance of the orders, (14) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from hdassist.belief.prior import prior_of
from hdassist.drive.error.cycle import kinematic_error
from hdassist.drive.error.extremes import extremes_of
from hdassist.drive.error.waves import Complex, ErrorWaves
from hdassist.drive.model.geometry import Array, Kinematics, pitch_locked_states
from hdassist.drive.preset.fields import DEVIATIONS, Drive
from hdassist.drive.solve.answers import EMPTY, Certificate
from hdassist.features.measuring.measure import SweepResult
from hdassist.features.measuring.terms import order_columns
from hdassist.readers.trace import MeasuredTrace
from hdassist.run.errors import UntrustedError
from hdassist.run.run import UNCHECKED, Run

VECTORS = tuple(d for d in DEVIATIONS if d.order != 3 and d.kind not in ("pitch", "centre", "seat"))
VECTOR_ORDERS = np.array([vector.order for vector in VECTORS])
# unit of each vector [um], which gives all vectors a similar effect: first harmonics nearly cancel on two opposite
# zones
VECTOR_UNITS = np.where(VECTOR_ORDERS > 1, 0.1, 1.0)
_DOUBTED_SHARES = {"supports.C_2": 0.3, "supports.C_3": 0.3, "contact.c_t": 0.3, "cam.W_0": 0.02}
SLOPE_WAVE_POINTS = 24  # points around each wheel for slopes
_DOUBTED_CLEARANCE = 1.0  # um; standard deviation of gears.j_n
EXACT = 2e-4  # largest error of a coefficient of an exact predicted curve, as a share of F'_ior
_MODEL_ERROR = 0.03  # standard deviation of all other model errors, as a share of each order
CHI_SQUARE_CLEAR = 4.0  # largest excess of a chi-square explained by noise, in standard deviations
ERROR_SIGNS = {1.0: "cam-output", -1.0: "output-cam"}  # sign of the error of a file, as F_kpp or opposite
SENSES = {1.0: "ccw", -1.0: "cw"}  # sense of the input angle of a file, seen from the wave generator side
_SCANNED = {1: 72, 2: 48}  # grid points of each scanned angle of the alignment, by number of scanned angles


def vectors_of(drive: Drive) -> Complex:
    """Return the deviations of a drive as complex numbers in their units, shape (vectors,).

    The argument of each number is its order times its direction.
    """
    sizes, directions = np.array([[drive.number(v.size), drive.number(v.direction)] for v in VECTORS]).T
    return np.asarray(sizes / VECTOR_UNITS * np.exp(1j * np.radians(VECTOR_ORDERS * directions)))


def size_and_direction(
    drive: Drive,
    vectors: Complex,
    k: int,
) -> tuple[float, float]:
    """Return the size [um] and the direction [deg] of vector k.

    The direction is the one nearest to that of the drive.

    vectors: deviations as complex numbers, shape (vectors,).
    k: index of the vector in VECTORS.
    """
    direction_near = drive.number(VECTORS[k].direction)
    turn = 360 / VECTORS[k].order
    # the direction is the equivalent one nearest to that of the preset
    away = float(np.degrees(np.angle(vectors[k]))) / VECTORS[k].order - direction_near
    return float(abs(vectors[k]) * VECTOR_UNITS[k]), direction_near + (away + turn / 2) % turn - turn / 2


def with_vectors(
    drive: Drive,
    vectors: Complex,
    fitted: Iterable[int],
) -> Drive:
    """Return the drive with fitted vectors.

    vectors: deviations as complex numbers, shape (vectors,).
    fitted: indices of the fitted vectors in VECTORS.
    """
    values: dict[str, float] = {}
    for k in fitted:
        values[VECTORS[k].size], values[VECTORS[k].direction] = size_and_direction(drive, vectors, k)
    return drive.with_values(values)


def doubts_of(drive: Drive) -> dict[str, float]:
    """Return the standard deviations of the doubtful fields of a drive, by path, in the units of the fields."""
    shares = {path: drive.number(path) * share for path, share in _DOUBTED_SHARES.items() if drive.number(path)}
    return shares | {"gears.j_n": _DOUBTED_CLEARANCE}


def doubtful_waves(
    drive: Drive,
    M_g: float,
    torus: ErrorWaves,
    run: Run = Run(),
) -> Complex:
    """Return the wave changes for one standard deviation of each doubtful field [arcsec], shape (changes, waves).

    Each field gives two changes: half the difference between an increase and a decrease, and the deviation of their
    mean from the unchanged drive. Fields that cannot have such values in the drive are omitted.

    drive: the drive.
    M_g: torque [N*m].
    torus: waves at M_g, whose certificate is extended by the states solved here.
    run: the run.
    """
    # waves at the drive's own values, from which changes are counted
    (own_waves,) = torus.waves([drive], SLOPE_WAVE_POINTS)

    def moved(path: str, value: float) -> Complex:
        moved_drive = drive.with_values({path: value})
        case = ErrorWaves(moved_drive, M_g, run)
        (waves,) = case.waves([moved_drive], SLOPE_WAVE_POINTS)
        torus.certificate += case.certificate
        return np.asarray(waves - own_waves)

    changes = []
    for path, deviation in doubts_of(drive).items():
        values = [drive.number(path) + way * deviation for way in (-1, 1)]
        # a field is skipped if its doubt exceeds the field's range
        if all(drive.allows(path, value) for value in values):
            with suppress(UntrustedError):
                less, greater = (moved(path, value) for value in values)
                # the two changes are the slope and the curvature of the error over the field
                changes += [(greater - less) / 2, (greater + less) / 2]
    changes += _single_tooth_waves(drive, torus)
    return np.reshape(changes, (len(changes), len(own_waves)))


def _single_tooth_waves(drive: Drive, torus: ErrorWaves) -> list[Complex]:
    """Return the wave changes due to each order of single teeth with unknown phase, in two quadratures [arcsec].

    An order of a wheel makes waves with the same number of periods around the wheel, whose phase follows that of the
    order.
    """
    priors = {field.path: field for field in prior_of(drive).fields}
    changes: list[Complex] = []
    for wheel, around in (("g", torus.k_g), ("b", torus.k_b)):
        orders = [d for d in DEVIATIONS if d.kind == "pitch" and d.part == wheel and d.direction in priors]
        if not orders:
            continue
        size = orders[0].size
        size_of_preset = drive.value(orders[0].size)
        # root mean square of an unknown size, or a given size, which the drive has at phases of 0
        f_p = priors[size].root_mean_square if size_of_preset is None else sqrt(2) * size_of_preset
        # the difference of the two is due to single teeth
        smooth, rough = torus.waves([drive.with_values({size: value}) for value in (0.0, f_p)])
        for order in orders:
            single_tooth = np.where(np.abs(around) == order.order, rough - smooth, 0)
            # if the phase is unknown, both quadratures are equally likely
            changes += [single_tooth, 1j * np.sign(around) * single_tooth]
    return changes


@dataclass(frozen=True)
class Alignment:
    """Alignment of a recording with the cycle of the drive, and its sign conventions.

    start_deg: angle of the moving wheel at phi_h = 0 [deg] (phi_g0 with the circular spline fixed).
    zero_deg: phi_h at which the input angle of the test rig is 0 [deg].
    sign: F_kpp divided by the error of the file, 1 or -1.
    sense: sense of the input angle of the test rig, 1 if counter-clockwise seen from the wave generator side, else -1.
    fitted: whether start and zero are fitted.
    """

    start_deg: float = 0.0
    zero_deg: float = 0.0
    sign: float = 1.0
    sense: float = 1.0
    fitted: tuple[bool, bool] = (False, False)

    @property
    def swapped(self) -> tuple[Alignment, ...]:
        """Alignments with the sign of the error, the sense of the input angle, or both reversed."""
        ways = ((-1, 1), (1, -1), (-1, -1))
        return tuple(replace(self, sign=way * self.sign, sense=turn * self.sense) for way, turn in ways)

    def of_file(self, trace: MeasuredTrace, kinematics: Kinematics) -> Alignment:
        """Return the alignment of a file that is read by this convention.

        The requested sense applies to the angle and to the error in a file. If the file has two encoders, the sign of
        the error follows from the sense in which the output encoder counts.
        """
        # an output encoder counts in the sense of the input only if the ratio is positive
        way = 1 if kinematics.u > 0 else -1
        sense = self.sense * (way if trace.angle_of == "output" else 1)
        counted = -trace.sense * sense * way if trace.sense else self.sense
        return replace(self, sense=sense, sign=self.sign * counted)


@dataclass(frozen=True)
class OrderAmplitude:
    """Component amplitude cos(per_cam_rev phi + phase) of an order; phi is the input angle of the test rig.

    Uncertainty and phase are None if they are not used.
    """

    amplitude_arcsec: float
    uncertainty_arcsec: float | None = None
    phase_deg: float | None = None


@dataclass(frozen=True)
class OrderPair:
    """One order as measured, as predicted, and the difference between the two."""

    per_cam_rev: float
    cause: str
    measured: OrderAmplitude
    predicted: OrderAmplitude
    difference: OrderAmplitude


class RecordedOrders:
    """Coefficients of one direction of a recording, and of a model's components at its angles.

    sweep: the measured direction.
    alignment: sign conventions of the recording, and its angles if they are given.
    measured: cosines, then sines, of the error in the file [arcsec], shape (2 orders,).
    covariance: S of (14), for the difference from a model's coefficients, shape (2 orders, 2 orders).
    turns: revolutions of flexspline and circular spline relative to the input, per revolution of start and zero of the
        recording, shape (2 wheels, 2 angles).
    """

    def __init__(
        self,
        sweep: SweepResult,
        torus: ErrorWaves,
        kinematics: Kinematics,
        alignment: Alignment,
    ) -> None:
        self.sweep = sweep
        self.alignment = alignment
        design = sweep.fit.design
        self.measured: Array = sweep.fit.coefficients
        # a computed curve has no noise, and would have a singular covariance without this floor
        floor = (EXACT * sweep.range.value) ** 2
        self._noise: Array = sweep.fit.covariance() + floor * np.eye(len(self.measured))
        self._root = np.linalg.cholesky(self._noise)
        self.covariance = self._noise
        # revolutions of each wheel relative to the wave generator, per input revolution
        rates = np.array([kinematics.teeth_fixed / z for z in (kinematics.z_g, kinematics.z_b)])
        starts = [1.0, 0.0] if kinematics.fixed == "rigid" else [0.0, 1.0]
        self.turns = np.stack([starts, -rates], axis=1)
        # phase of each wave per revolution of start and zero, shape (2, waves)
        self._turning = self.turns.T @ [torus.k_g, torus.k_b]
        # both wheels lag behind the wave generator
        order = -self._turning[1]  # periods of each wave per input revolution, shape (waves,)
        cosine_and_sine = design.project(lambda rows: order_columns(design.bins.turns[rows], order))[
            : len(self.measured)
        ]
        self._cosine = cosine_and_sine[:, : len(order)].T
        self._sine = cosine_and_sine[:, len(order) :].T
        # parts of predictions, shared by all counting conventions
        self._scanned: dict[tuple[bytes, ...], tuple[Array, Array]] = {}

    def read_as(self, alignment: Alignment) -> RecordedOrders:
        """Return the recording with another counting convention; its orders are the same."""
        result = copy(self)
        result.alignment = alignment
        return result

    def doubting(
        self,
        waves: Complex,
        changes: Complex,
        angles: Array,
    ) -> RecordedOrders:
        """Return the recording with the doubts of a model in its covariance (14).

        waves: waves of the model [arcsec], shape (waves,).
        changes: wave changes for one standard deviation of each doubtful field [arcsec], shape (changes, waves).
        angles: angles of the alignment at which the changes apply [deg], shape (2,).
        """
        result = copy(self)
        # equation (14): each doubtful change adds its own outer product
        moved = self.predicted(changes, angles)  # shape (changes, 2 orders)
        cosines, sines = self.predicted(waves, angles).reshape(2, -1)
        power = np.tile((cosines**2 + sines**2) / 2, 2)
        result.covariance = self._noise + moved.T @ moved + np.diag(_MODEL_ERROR**2 * power)
        result._root = np.linalg.cholesky(result.covariance)
        return result

    def predicted(self, waves: Complex, angles: Array) -> Array:
        """Return the coefficients p of (13) of waves, as counted in the file [arcsec], shape (..., 2 orders).

        waves: waves [arcsec], shape (..., waves).
        angles: start and zero [deg], shape (..., 2).
        """
        return self._counted(*self._parts(waves, angles))

    def _parts(self, waves: Complex, angles: Array) -> tuple[Array, Array]:
        """Return the contributions of real and imaginary parts of waves to the coefficients, shape (..., 2 orders)."""
        turned = np.asarray(waves * np.exp(1j * np.radians(angles @ self._turning)))
        return turned.real @ self._cosine, turned.imag @ self._sine

    def _counted(self, real: Array, imaginary: Array) -> Array:
        """Return the coefficients in the counting convention of the file, from both contributions."""
        return np.asarray(self.alignment.sign * (real + self.alignment.sense * imaginary))

    def slopes(self, waves: Complex, angles: Array) -> Array:
        """Return the slopes of the coefficients over start and zero [arcsec/deg], shape (2, 2 orders)."""
        return self.predicted(1j * np.radians(self._turning) * waves, angles)

    def whitened(self, coefficients: Array) -> Array:
        """Return coefficients whitened by L^-1 of (13): independent, in standard deviations, shape (..., 2 orders)."""
        return np.asarray(np.linalg.solve(self._root, coefficients.T).T)

    def pairs(self, predicted: Array, difference: Array) -> tuple[OrderPair, ...]:
        """Return each order as measured, as predicted, and their difference.

        predicted: coefficients of the prediction [arcsec], shape (2 orders,).
        difference: coefficients of the difference [arcsec], shape (2 orders,).
        """
        pairs = []
        exact = EXACT * self.sweep.range.value
        for k, order in enumerate(self.sweep.orders):
            columns = [k, k + len(self.sweep.orders)]
            along = difference[columns]
            block = self.covariance[np.ix_(columns, columns)]
            size = float(np.hypot(*difference[columns]))
            # without a clear difference, its phase is only rounding, so the largest variance over all phases is used
            variance = along @ block @ along / size**2 if size > exact else np.linalg.eigvalsh(block)[-1]
            wave = complex(*predicted[columns])  # amplitude, and the negative of the phase
            prediction = OrderAmplitude(abs(wave), phase_deg=float(np.degrees(np.angle(wave.conjugate()))))
            measured = OrderAmplitude(order.amplitude_arcsec, order.uncertainty_arcsec, order.phase_deg)
            difference_amplitude = OrderAmplitude(size, float(np.sqrt(variance)))
            pairs.append(
                OrderPair(
                    per_cam_rev=order.per_cam_rev,
                    cause=order.cause,
                    measured=measured,
                    predicted=prediction,
                    difference=difference_amplitude,
                )
            )
        return tuple(pairs)

    def scan(self, waves: Complex, angles: Array) -> tuple[Array, float]:
        """Return the start and zero [deg] that fit waves best, shape (2,), and their chi-square (13).

        The fitted angles are scanned on a grid.
        """
        fitted = self.alignment.fitted
        count = _SCANNED.get(sum(fitted), 1)
        steps = [np.arange(count if is_fitted else 1) * (360 / count) for is_fitted in fitted]
        grid = angles + np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 2)
        key = waves.tobytes(), grid.tobytes()
        if key not in self._scanned:
            self._scanned.clear()
            self._scanned[key] = self._parts(waves, grid)
        chi_square = (self.whitened(self.measured - self._counted(*self._scanned[key])) ** 2).sum(axis=1)
        return grid[chi_square.argmin()], float(chi_square.min())

    def within_noise(self, chi_square: float, unknowns: int) -> bool:
        """Return whether noise alone explains a chi-square, within CHI_SQUARE_CLEAR standard deviations."""
        freedom = self.freedom(unknowns)
        return chi_square <= freedom + CHI_SQUARE_CLEAR * float(np.sqrt(2 * freedom))

    def freedom(self, unknowns: int) -> int:
        """Return the degrees of freedom of a fit with a number of unknowns, at least 1."""
        return max(1, len(self.measured) - unknowns)


def rms(coefficients: Array) -> float:
    """Return the root mean square of the curve with these coefficients, shape (2 orders,)."""
    return float(np.sqrt((coefficients**2).sum() / 2))


@dataclass
class SolvedStates:
    """Errors from solved states of drives at a torque.

    M_g: torque [N*m].
    certificate: certificate of all states solved so far.
    """

    M_g: float
    certificate: Certificate = EMPTY

    def F_ior(self, drive: Drive) -> float:
        """Return F'_ior over the full cycle [arcsec]."""
        (extremes,) = extremes_of(drive, [self.M_g])
        self.certificate += extremes.certificate
        return extremes.first

    def curve(
        self,
        drive: Drive,
        turns: Array,
        alignment: Alignment,
    ) -> Array:
        """Return the error as counted in the file, up to a constant [arcsec], shape (angles,).

        The four pitch-locked states around each angle are solved and interpolated by a cubic.

        turns: input angles of the test rig [revolutions], shape (angles,).
        """
        kinematics = Kinematics.of(drive)
        pitches = (alignment.sense * turns + alignment.zero_deg / 360) * kinematics.teeth_fixed
        first = np.floor(pitches + 1e-6).astype(np.int64) - 1
        around = np.mod(first[:, None] + np.arange(4), kinematics.cycle_states)  # shape (turns, 4)
        index, places = np.unique(around.ravel(), return_inverse=True)
        states = pitch_locked_states(kinematics, index, float(np.radians(alignment.start_deg)))
        error = kinematic_error(
            drive,
            self.M_g,
            states=states,
            run=UNCHECKED,
        )
        self.certificate += error.certificate
        # weights of a cubic, shape (turns, 4)
        weights = np.vander(pitches - first, 4) @ np.linalg.inv(np.vander(np.arange(4.0)))
        nodes = error.error_arcsec[places].reshape(-1, 4)
        return np.asarray(alignment.sign * (weights * nodes).sum(axis=1))
