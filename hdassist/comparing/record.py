"""The orders of a measured trace, and what a model predicts of them: deviation vectors, waves, doubts of the model.

A predicted curve goes through the same least squares, with the same levels and drift, at the same angles as the
measured one, so both have the same resolution. Deviations are fitted as vectors, size and direction as a complex
number; those that look like another one in a single position of the wheel are left out: order 3 (on two opposite zones
it looks like a first harmonic), the offset e_b of the rigid wheel, and the ovality a_s2 of its seat. No shop measures
the stiffness of a support: a comparison that takes the preset as exact explains such a difference by deviations, with
far too small uncertainties, so doubts of stiffnesses and clearances widen the covariance of the orders, (14) of
docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from hdassist.error.cycle import kinematic_error
from hdassist.error.extremes import extremes_of
from hdassist.error.waves import Complex, ErrorWaves
from hdassist.errors import UntrustedError
from hdassist.measuring.measure import SweepResult
from hdassist.measuring.terms import order_columns
from hdassist.model.deviations import unknowns
from hdassist.model.geometry import Array, Kinematics, pitch_locked_states
from hdassist.preset.fields import DEVIATIONS, Drive
from hdassist.readers.trace import MeasuredTrace
from hdassist.run.run import UNCHECKED, Run
from hdassist.solve.answers import EMPTY, Certificate

VECTORS = tuple(d for d in DEVIATIONS if d.order != 3 and d.kind not in ("pitch", "centre", "seat"))
VECTOR_ORDERS = np.array([vector.order for vector in VECTORS])
# um, in which each is counted, so that all weigh about alike: first harmonics nearly cancel on two opposite zones
VECTOR_UNITS = np.where(VECTOR_ORDERS > 1, 0.1, 1.0)
_DOUBTED_SHARES = {"supports.C_2": 0.3, "supports.C_3": 0.3, "contact.c_t": 0.3, "cam.W_0": 0.02}
SLOPE_WAVE_POINTS = 24  # around each wheel, for slopes
_DOUBTED_CLEARANCE = 1.0  # um, of gears.j_n
EXACT = 2e-4  # error of each coefficient, as a share of F'_ior, up to which a predicted curve counts as exact
_MODEL_ERROR = 0.03  # standard deviation of other errors of the model, as a share of each order
CHI_SQUARE_CLEAR = 4.0  # standard deviations of a chi-square
ERROR_SIGNS = {1.0: "cam-output", -1.0: "output-cam"}  # of the error of a file, as F_kpp or against it
SENSES = {1.0: "ccw", -1.0: "cw"}  # of its input angle, seen from the wave generator side
_SCANNED = {1: 72, 2: 48}  # places of each scanned angle of the alignment, by number of scanned angles


def vectors_of(drive: Drive) -> Complex:
    """Return the deviations of a drive as complex numbers in their units, shape (vectors,).

    The angle is order times direction.
    """
    sizes, directions = np.array([[drive.number(v.size), drive.number(v.direction)] for v in VECTORS]).T
    return np.asarray(sizes / VECTOR_UNITS * np.exp(1j * np.radians(VECTOR_ORDERS * directions)))


def size_and_direction(
    drive: Drive,
    vectors: Complex,
    k: int,
) -> tuple[float, float]:
    """Return size [um] and direction [deg] of one of vectors, shape (vectors,).

    The direction is the one nearest to that of the drive.
    """
    direction_near = drive.number(VECTORS[k].direction)
    turn = 360 / VECTORS[k].order
    # the equivalent direction nearest to that of the preset
    away = float(np.degrees(np.angle(vectors[k]))) / VECTORS[k].order - direction_near
    return float(abs(vectors[k]) * VECTOR_UNITS[k]), direction_near + (away + turn / 2) % turn - turn / 2


def with_vectors(
    drive: Drive,
    vectors: Complex,
    fitted: Iterable[int],
) -> Drive:
    """Return the drive with those vectors, shape (vectors,), that were fitted, by their places in VECTORS."""
    values: dict[str, float] = {}
    for k in fitted:
        values[VECTORS[k].size], values[VECTORS[k].direction] = size_and_direction(drive, vectors, k)
    return drive.with_values(values)


def doubts_of(drive: Drive) -> dict[str, float]:
    """Return the standard deviations of doubtful fields of a drive by path, in their units."""
    shares = {path: drive.number(path) * share for path, share in _DOUBTED_SHARES.items() if drive.number(path)}
    return shares | {"gears.j_n": _DOUBTED_CLEARANCE}


def doubtful_waves(
    drive: Drive,
    M_g: float,
    torus: ErrorWaves,
    run: Run = Run(),
) -> Complex:
    """Return changes of waves [arcsec] for a standard deviation of each doubtful field, shape (changes, waves).

    Two changes a field: half the difference of both ways, and the distance of their mean from the drive as it is. A
    field that cannot have such values in the drive is left out. Arguments: torque M_g [N*m]; torus, waves at M_g, to
    whose certificate the states solved here are added.
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
        # a doubt that leaves the field's range is left out
        if all(drive.allows(path, value) for value in values):
            with suppress(UntrustedError):
                less, greater = (moved(path, value) for value in values)
                # slope and bend of the error over the field
                changes += [(greater - less) / 2, (greater + less) / 2]
    changes += _single_tooth_waves(drive, torus)
    return np.reshape(changes, (len(changes), len(own_waves)))


def _single_tooth_waves(drive: Drive, torus: ErrorWaves) -> list[Complex]:
    """Return changes of waves [arcsec] by each order of single teeth whose phase is unknown, in two quadratures.

    An order of a wheel makes waves that come as often around it, which turn with its phase.
    """
    high = {field.path: field.high for field in unknowns(drive)}
    changes: list[Complex] = []
    for wheel, around in (("g", torus.k_g), ("b", torus.k_b)):
        orders = [d for d in DEVIATIONS if d.kind == "pitch" and d.part == wheel and d.direction in high]
        if not orders:
            continue
        size = orders[0].size
        size_of_preset = drive.value(orders[0].size)
        # root mean square of sizes that are evenly likely; or a given one, which the drive has at phases of 0
        f_p = high[size] / sqrt(3) if size_of_preset is None else sqrt(2) * size_of_preset
        # single teeth are the difference of the two
        smooth, rough = torus.waves([drive.with_values({size: value}) for value in (0.0, f_p)])
        for order in orders:
            single_tooth = np.where(np.abs(around) == order.order, rough - smooth, 0)
            # an unknown phase: both quadratures are equally likely
            changes += [single_tooth, 1j * np.sign(around) * single_tooth]
    return changes


@dataclass(frozen=True)
class Alignment:
    """Alignment of a recording with the cycle of the drive, and its sign conventions.

    start_deg: angle of the moving wheel at phi_h = 0 (phi_g0 with the circular spline fixed).
    zero_deg: phi_h at which the input angle of the test rig is 0.
    sign: F_kpp divided by the error of the file, 1 or -1.
    sense: sense of the input angle of the test rig, 1 counter-clockwise, seen from the wave generator side, or -1.
    fitted: whether start and zero are fitted.
    """

    start_deg: float = 0.0
    zero_deg: float = 0.0
    sign: float = 1.0
    sense: float = 1.0
    fitted: tuple[bool, bool] = (False, False)

    @property
    def swapped(self) -> tuple[Alignment, ...]:
        """The record with its error, its cam angle, and both counted the other way."""
        ways = ((-1, 1), (1, -1), (-1, -1))
        return tuple(replace(self, sign=way * self.sign, sense=turn * self.sense) for way, turn in ways)

    def of_file(self, trace: MeasuredTrace, kinematics: Kinematics) -> Alignment:
        """Return the alignment of a file that is asked to be read so.

        The sense that is asked for is that of the angle and of the error of a file. Of two encoders the sign is that of
        the error as they count: the output's counts as the model does, or against.
        """
        # an output encoder counts along with the input only for positive ratios
        way = 1 if kinematics.u > 0 else -1
        sense = self.sense * (way if trace.angle_of == "output" else 1)
        counted = -trace.sense * sense * way if trace.sense else self.sense
        return replace(self, sense=sense, sign=self.sign * counted)


@dataclass(frozen=True)
class OrderAmplitude:
    """Amplitude cos(per_cam_rev phi + phase) of an order, phi the rig's cam angle, as far as it is of use."""

    amplitude_arcsec: float
    uncertainty_arcsec: float | None = None
    phase_deg: float | None = None


@dataclass(frozen=True)
class OrderPair:
    """One order as it was measured, as it was predicted, and the difference of both."""

    per_cam_rev: float
    cause: str
    measured: OrderAmplitude
    predicted: OrderAmplitude
    difference: OrderAmplitude


class RecordedOrders:
    """Coefficients of one direction of a recording, and of a model's components at its angles.

    sweep: the measured direction.
    alignment: sign conventions of the recording, and its angles as far as they are given.
    measured: cosines, then sines, of the error as in the file [arcsec], shape (2 orders,).
    covariance: S of (14), of the difference to a model's coefficients, shape (2 orders, 2 orders).
    turns: revolutions of flexspline and circular spline before the input, with start and zero of the recording, shape
    (2 wheels, 2 angles).
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
        # a computed curve has no noise, and a singular covariance without this
        floor = (EXACT * sweep.range.value) ** 2
        self._noise: Array = sweep.fit.covariance() + floor * np.eye(len(self.measured))
        self._root = np.linalg.cholesky(self._noise)
        self.covariance = self._noise
        # revolutions of each wheel against the cam, in an input revolution
        rates = np.array([kinematics.teeth_fixed / z for z in (kinematics.z_g, kinematics.z_b)])
        starts = [1.0, 0.0] if kinematics.fixed == "rigid" else [0.0, 1.0]
        self.turns = np.stack([starts, -rates], axis=1)
        self._turning = self.turns.T @ [torus.k_g, torus.k_b]  # of each wave with start and zero, shape (2, waves)
        # both wheels fall behind the cam
        order = -self._turning[1]  # how often each wave goes by in a cam turn, shape (waves,)
        cosine_and_sine = design.project(lambda rows: order_columns(design.bins.turns[rows], order))[
            : len(self.measured)
        ]
        self._cosine = cosine_and_sine[:, : len(order)].T
        self._sine = cosine_and_sine[:, len(order) :].T
        self._scanned: dict[tuple[bytes, ...], tuple[Array, Array]] = {}  # parts of predictions, of all ways to count

    def read_as(self, alignment: Alignment) -> RecordedOrders:
        """Return the record counted otherwise; its orders are the same."""
        result = copy(self)
        result.alignment = alignment
        return result

    def doubting(
        self,
        waves: Complex,
        changes: Complex,
        angles: Array,
    ) -> RecordedOrders:
        """Return the record with the doubt of a model in its covariance (14).

        Arguments: waves of the model, shape (waves,); changes of them by a standard deviation of each doubtful field,
        shape (changes, waves); angles of the alignment [deg] at which they are taken.
        """
        result = copy(self)
        # equation (14): each doubtful change adds its own outer product
        moved = self.predicted(changes, angles)  # (changes, 2 orders)
        cosines, sines = self.predicted(waves, angles).reshape(2, -1)
        power = np.tile((cosines**2 + sines**2) / 2, 2)
        result.covariance = self._noise + moved.T @ moved + np.diag(_MODEL_ERROR**2 * power)
        result._root = np.linalg.cholesky(result.covariance)
        return result

    def predicted(self, waves: Complex, angles: Array) -> Array:
        """Return the coefficients p of (13) that waves give in the file [arcsec], shape (..., 2 orders).

        Arguments: waves, shape (..., waves); angles: start and zero [deg], shape (..., 2).
        """
        return self._counted(*self._parts(waves, angles))

    def _parts(self, waves: Complex, angles: Array) -> tuple[Array, Array]:
        """Return real and the imaginary parts of waves in the order of the coefficients, shape (..., 2 orders) each."""
        turned = np.asarray(waves * np.exp(1j * np.radians(angles @ self._turning)))
        return turned.real @ self._cosine, turned.imag @ self._sine

    def _counted(self, real: Array, imaginary: Array) -> Array:
        """Return the coefficients as the file counts, of both parts."""
        return np.asarray(self.alignment.sign * (real + self.alignment.sense * imaginary))

    def slopes(self, waves: Complex, angles: Array) -> Array:
        """Change of the coefficients [arcsec/deg] with start and zero of the alignment, shape (2, 2 orders)."""
        return self.predicted(1j * np.radians(self._turning) * waves, angles)

    def whitened(self, coefficients: Array) -> Array:
        """Return independent coefficients in units of their standard deviation, shape (..., 2 orders): L^-1 of (13)."""
        return np.asarray(np.linalg.solve(self._root, coefficients.T).T)

    def pairs(self, predicted: Array, difference: Array) -> tuple[OrderPair, ...]:
        """Return each order with predicted coefficients and their difference [arcsec], shape (2 orders,) each."""
        pairs = []
        exact = EXACT * self.sweep.range.value
        for k, order in enumerate(self.sweep.orders):
            columns = [k, k + len(self.sweep.orders)]
            along = difference[columns]
            block = self.covariance[np.ix_(columns, columns)]
            size = float(np.hypot(*difference[columns]))
            # the phase of a difference that is none is rounding alone: then the greatest over all phases
            variance = along @ block @ along / size**2 if size > exact else np.linalg.eigvalsh(block)[-1]
            wave = complex(*predicted[columns])  # amplitude, and less the phase
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
        """Start and zero [deg] that fit waves best on a grid of the fitted ones, shape (2,), and chi-square (13)."""
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
        """Return whether noise alone may leave such a chi-square: within CHI_SQUARE_CLEAR standard deviations."""
        freedom = self.freedom(unknowns)
        return chi_square <= freedom + CHI_SQUARE_CLEAR * float(np.sqrt(2 * freedom))

    def freedom(self, unknowns: int) -> int:
        """Return the degrees of freedom that a number of unknowns leaves."""
        return max(1, len(self.measured) - unknowns)


def rms(coefficients: Array) -> float:
    """Return the root mean square of the curve that has such coefficients, shape (2 orders,)."""
    return float(np.sqrt((coefficients**2).sum() / 2))


@dataclass
class SolvedStates:
    """Errors from solved states of drives, at a torque M_g [N*m]; certificate: of all that were solved so far."""

    M_g: float
    certificate: Certificate = EMPTY

    def F_ior(self, drive: Drive) -> float:
        """Return F'_ior [arcsec] over the full cycle."""
        (extremes,) = extremes_of(drive, [self.M_g])
        self.certificate += extremes.certificate
        return extremes.first

    def curve(
        self,
        drive: Drive,
        turns: Array,
        alignment: Alignment,
    ) -> Array:
        """Return error as in the file [arcsec], up to a constant, at the rig's input angles [turns], shape (turns,).

        The four pitch-locked states around each angle are solved; a cubic goes through them.
        """
        kinematics = Kinematics.of(drive)
        pitches = (alignment.sense * turns + alignment.zero_deg / 360) * kinematics.teeth_fixed
        first = np.floor(pitches + 1e-6).astype(np.int64) - 1
        around = np.mod(first[:, None] + np.arange(4), kinematics.cycle_states)  # (turns, 4)
        index, places = np.unique(around.ravel(), return_inverse=True)
        states = pitch_locked_states(kinematics, index, float(np.radians(alignment.start_deg)))
        error = kinematic_error(
            drive,
            self.M_g,
            states=states,
            run=UNCHECKED,
        )
        self.certificate += error.certificate
        weights = np.vander(pitches - first, 4) @ np.linalg.inv(np.vander(np.arange(4.0)))  # of a cubic, (turns, 4)
        nodes = error.error_arcsec[places].reshape(-1, 4)
        return np.asarray(alignment.sign * (weights * nodes).sum(axis=1))
