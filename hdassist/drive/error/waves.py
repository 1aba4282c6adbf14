"""The error over the input angle with its orders, as a test rig records it, and the error as waves around both wheels.

Each order has an amplitude, a phase and a cause. The error of a state depends only on alpha_g and alpha_b, the angles
of the wheels in the frame of the wave generator, so it is a function on a torus. Its solution on an even grid gives the
error at every angle of any recording; the start angle only shifts the phases of the waves. The omitted waves (beyond
_HIGHEST around a wheel) amount to some hundredths of an arcsec out of 28 within orders up to 12. Over the output angle,
each wave is a spectral line with a whole number of periods in the full cycle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.error.cycle import KinematicError, kinematic_error
from hdassist.drive.error.error_map import ErrorMap, there_and_back
from hdassist.drive.error.extremes import SHORT_CYCLE
from hdassist.drive.model.contacts import StateGaps
from hdassist.drive.model.deviations import MeasuredTeeth, deviation_scalars, is_half_turn_symmetric
from hdassist.drive.model.geometry import Array, Kinematics, pitch_locked_states
from hdassist.drive.preset.fields import DEVIATIONS, Drive
from hdassist.drive.solve.answers import EMPTY, Certificate
from hdassist.run.errors import UsageError
from hdassist.run.files import number_of
from hdassist.run.run import UNCHECKED, Run

_DEGREE = 4  # largest degree of the products of deviations that are listed as causes
_UNEXPLAINED_ORDERS = 12  # number of largest orders that are listed even without a known cause
NO_CAUSE = "no single cause known"
_FLOOR = 1e-9  # arcsec; smaller values are rounding errors
_INTERPOLATION_SHARE = 0.02  # target for the interpolation error between torques, as a share of the range
_MIN_INTERPOLATION = 0.02  # smallest target for the interpolation error [arcsec]
_MOST_TORQUES = 33  # largest number of solved torques
_PROVEN_STATES = 24  # number of states solved at their own torque as a check
_MIN_SPACING = 1e-6  # smallest distance between two solved torques, as a share of the largest torque


@dataclass(frozen=True)
class TraceOrder:
    """One order of the error: amplitude cos(per_cam_rev phi_h + phase), with a description of its cause."""

    per_cam_rev: float
    amplitude_arcsec: float
    phase_deg: float
    cause: str


def order_legend(drive: Drive) -> str:
    """Return a text that explains the names of the causes of a drive's orders."""
    even = " Each component combines an even number of orders, because z_g, N and n_2 are even."
    return (
        "circular spline: its teeth and the eccentricity fixed to its seat; flexspline: its teeth and the "
        "eccentricity fixed to it; wave generator: the eccentricity that rotates with it. The error contains sums and "
        f"differences of their orders.{even if is_half_turn_symmetric(drive) else ''}"
    )


def known_causes(drive: Drive) -> dict[tuple[int, int], tuple[float, str]]:
    """Return the order per input revolution and the cause of each product of a drive's deviations up to _DEGREE.

    The keys (k_g, k_b) are the powers of the deviations that turn with the flexspline and with the circular spline, in
    the frame of the wave generator. If half a revolution maps teeth and balls onto each other, the error is even in all
    deviations together, and an odd product also needs the rotating eccentricity e_hh.
    """
    is_symmetric = is_half_turn_symmetric(drive)
    kinematics = Kinematics.of(drive)
    # revolutions of each wheel in the frame of the wave generator per input revolution
    rate_g = kinematics.teeth_fixed / kinematics.z_g
    rate_b = kinematics.teeth_fixed / kinematics.z_b
    # a part without deviation causes no wave
    parts = {deviation.part for deviation in DEVIATIONS if drive.number(deviation.size)}
    max_g = _DEGREE if "g" in parts else 0
    max_b = _DEGREE if "b" in parts else 0
    causes = {}
    # k_g >= 0 suffices, because a real wave and its mirror image are the same
    for k_g, k_b in product(range(max_g + 1), range(-max_b, max_b + 1)):
        degree = k_g + abs(k_b)
        # products of an odd number of wheel waves cancel over half a revolution, unless the rotating eccentricity adds
        # one more
        needs_cam = is_symmetric and degree % 2 == 1
        is_own_image = k_g == 0 and k_b <= 0  # its mirror image is listed with the opposite sign
        if 0 < degree <= _DEGREE and not is_own_image and ("h" in parts or not needs_cam):
            causes[k_g, k_b] = (abs(k_g * rate_g + k_b * rate_b), _words(k_g, k_b, needs_cam))
    return causes


def _words(
    k_g: int,
    k_b: int,
    needs_cam: bool,
) -> str:
    flexspline = f"{k_g if k_g > 1 else ''} flexspline" if k_g else ""
    rigid = f"{abs(k_b) if abs(k_b) > 1 else ''} circular spline" if k_b else ""
    between = (" - " if k_b < 0 else " + ") if k_g and k_b else ""
    return " ".join(f"{flexspline}{between}{rigid}{' + wave generator' if needs_cam else ''}".split())


def orders(
    drive: Drive,
    error_arcsec: Array,
    revolutions: int,
) -> list[TraceOrder]:
    """Return the orders of an error over whole input revolutions, in ascending order.

    Orders with a known cause are always listed. Other orders are listed only if they are among the largest. If several
    causes belong to one order at the resolution 1/revolutions, the simplest of them are listed together.

    Args:
        drive: drive whose deviations name the causes.
        error_arcsec: error at even steps [arcsec], shape (states,).
        revolutions: number of input revolutions.
    """
    count = len(error_arcsec)
    spectrum = np.fft.rfft(error_arcsec - np.mean(error_arcsec))
    amplitude = 2 * np.abs(spectrum) / count
    # rfft of an even number of values ends with the Nyquist bin
    if count % 2 == 0:
        amplitude[-1] /= 2  # the Nyquist bin has no mirror image
    phase = np.degrees(np.angle(spectrum))
    cause_by_bin = _causes_by_bin(drive, revolutions, len(amplitude))
    largest = np.argsort(amplitude)[::-1][:_UNEXPLAINED_ORDERS].tolist()
    listed = []
    # known orders are listed even if they are 0, because their absence is informative
    for k in sorted({*cause_by_bin, *largest} - {0}):
        if k in cause_by_bin or amplitude[k] > _FLOOR:
            order = TraceOrder(
                per_cam_rev=k / revolutions,
                amplitude_arcsec=float(amplitude[k]),
                phase_deg=float(phase[k]),
                cause=cause_by_bin.get(k, NO_CAUSE),
            )
            listed.append(order)
    return listed


def _causes_by_bin(
    drive: Drive,
    revolutions: int,
    bins: int,
) -> dict[int, str]:
    """Return the simplest causes in each bin of the spectrum over whole input revolutions."""
    causes: dict[int, list[tuple[int, str]]] = {}  # degree and cause
    for (k_g, k_b), (order, cause) in known_causes(drive).items():
        # bin of the order; several orders may share one
        k = round(order * revolutions)
        if 0 < k < bins:
            causes.setdefault(k, []).append((abs(k_g) + abs(k_b), cause))
    simplest = {}
    for k, causes_of_bin in causes.items():
        lowest_degree = min(degree for degree, _ in causes_of_bin)
        # products of more deviations are smaller, so the product of the lowest degree is the likely cause
        simplest[k] = "; ".join(cause for degree, cause in causes_of_bin if degree == lowest_degree)
    return simplest


# --- the error over input revolutions


@dataclass(frozen=True)
class Gravity:
    """Torque of a weight: amplitude times the cosine of the output angle minus a direction.

    amplitude_Nm: amplitude [N*m].
    direction_deg: output angle of the maximum [deg].
    """

    amplitude_Nm: float
    direction_deg: float = 0.0

    @classmethod
    def of(cls, text: str) -> Gravity:
        """Parse a text such as "60,90".

        Raises UsageError if the text is invalid.
        """
        numbers = [number_of(part) for part in text.split(",")]
        if len(numbers) > 2 or not np.isfinite(numbers).all() or not 0 < abs(numbers[0]) <= 1e7:
            hint = "write the amplitude in N·m and the output angle in deg at its maximum, for example 60,90"
            raise UsageError(f"invalid --gravity {text}: expected AMPLITUDE[,ANGLE]", hint)
        return cls(*numbers)


@dataclass(frozen=True)
class ErrorAlong:
    """Properties of an error that was interpolated to the varying torque of a weight.

    gravity: torque of the weight.
    least_Nm, greatest_Nm: smallest and largest torque [N*m].
    torques_Nm: solved torques [N*m].
    ranges_arcsec: range of the error at each solved torque [arcsec].
    wind_up_arcsec: range of the mean twist, which is excluded from the error [arcsec].
    bound_arcsec: largest error of linear interpolation between the torques that was found in the middle of intervals
        and in states solved at their own torque [arcsec].
    """

    gravity: Gravity
    least_Nm: float
    greatest_Nm: float
    torques_Nm: tuple[float, ...]
    ranges_arcsec: tuple[float, ...]
    wind_up_arcsec: float
    bound_arcsec: float


@dataclass(frozen=True)
class Trace:
    """Error over whole input revolutions from phi_h = 0.

    error: the error in each state.
    start_deg: angle of the moving wheel at phi_h = 0 [deg].
    revolutions: number of input revolutions.
    orders: orders of the error.
    measured: measured wheels that replace the first harmonics.
    along: varying torque of a weight, in which case the error excludes the mean wind-up; None for a constant torque.
    """

    error: KinematicError
    start_deg: float
    revolutions: int
    orders: tuple[TraceOrder, ...]
    measured: MeasuredTeeth | None = None
    along: ErrorAlong | None = None

    @property
    def slope_arcsec_per_deg(self) -> float:
        """Largest absolute slope of the error over the output angle between adjacent states [arcsec/deg]."""
        output_deg = np.degrees(self.error.states.phi_h) / abs(self.error.kinematics.u)
        return float(np.abs(np.diff(self.error.error_arcsec) / np.diff(output_deg)).max())


def trace(
    drive: Drive,
    M_g: float,
    *,
    measured: MeasuredTeeth | None = None,
    start_deg: float = 0.0,
    revolutions: int = 1,
    gravity: Gravity | None = None,
    solver: str | None = None,
    run: Run = Run(),
) -> Trace:
    """Return the error of a drive at a torque M_g [N*m] over whole input revolutions, and its orders.

    measured: measured wheels that replace the first harmonics.
    start_deg: angle of the moving wheel at phi_h = 0 [deg] (phi_g0 if the circular spline is fixed); rounded to a whole
        tooth for measured wheels.
    revolutions: number of input revolutions.
    gravity: torque of a weight in addition to M_g.
    solver: name of a cvxpy solver that solves every state in place of the built-in one.

    Raises UsageError for less than one revolution, for more than the full cycle, for a start angle that is not finite
    or for an unknown solver, and UntrustedError if a result cannot be trusted.
    """
    kinematics = Kinematics.of(drive)
    if not 1 <= revolutions <= kinematics.cycle_cam_revolutions:
        raise UsageError(
            f"invalid number of revolutions {revolutions}: expected 1 to {kinematics.cycle_cam_revolutions}",
            "use at most the full mesh cycle, after which the error repeats",
        )
    if not np.isfinite(start_deg):
        raise UsageError(f"invalid start angle {start_deg}: expected a finite number", "state the angle in degrees")
    # one state per pitch of the fixed wheel, from the start angle of the moving wheel
    states = pitch_locked_states(
        kinematics, np.arange(revolutions * kinematics.teeth_fixed), float(np.radians(start_deg))
    )
    solved_drive, teeth = measured.in_drive(drive) if measured else (drive, None)
    error = kinematic_error(
        solved_drive,
        M_g,
        states=states,
        teeth=teeth,
        solver=solver,
        run=run,
    )
    along = None
    if gravity:
        solve = partial(
            kinematic_error,
            solved_drive,
            teeth=teeth,
            solver=solver,
            run=UNCHECKED,
        )
        error, along = _error_along(error, gravity, solve)
    return Trace(
        error=error,
        start_deg=start_deg,
        revolutions=revolutions,
        orders=tuple(orders(drive, error.error_arcsec, revolutions)),
        measured=measured,
        along=along,
    )


def _error_along(
    mean: KinematicError,
    gravity: Gravity,
    solve: Callable[..., KinematicError],
) -> tuple[KinematicError, ErrorAlong]:
    """Return the error under gravity in addition to a mean torque, interpolated between solved torques.

    Args:
        mean: error at the mean torque.
        gravity: torque of the weight.
        solve: function that returns the error at a torque [N*m] in given states.
    """
    states = mean.states
    # the weight is attached to the output
    moving_angle = states.phi_g if mean.kinematics.fixed == "rigid" else states.phi_b
    torque = mean.M_g + gravity.amplitude_Nm * np.cos(moving_angle - np.radians(gravity.direction_deg))
    # a few torques are solved in all states, and the error of each state is interpolated to its own torque
    torques = _SolvedTorques(mean, torque, solve)
    torques.refine()
    rotation = torques.interpolated()
    # the interpolation is checked in the middle of intervals, and by states solved at their own torque
    bound = max(torques.largest_miss, torques.proven_miss(rotation))
    along = ErrorAlong(
        gravity=gravity,
        least_Nm=float(torque.min()),
        greatest_Nm=float(torque.max()),
        torques_Nm=tuple(torques.nodes.tolist()),
        ranges_arcsec=tuple(torques.errors[M_g].range_arcsec for M_g in torques.nodes.tolist()),
        wind_up_arcsec=float(np.ptp(torques.wind_up(torque))),
        bound_arcsec=bound,
    )
    certificate = sum((error.certificate for error in torques.errors.values()), EMPTY)
    return replace(mean, rotation_arcsec=rotation, certificate=certificate), along


class _SolvedTorques:
    """Errors of the same states at several torques, between which the error is interpolated linearly."""

    def __init__(
        self,
        mean: KinematicError,
        torque: Array,
        solve: Callable[..., KinematicError],
    ) -> None:
        """Solve the smallest and the largest torque.

        Args:
            mean: error at the mean torque.
            torque: torque in each state [N*m], shape (states,).
            solve: function that returns the error at a torque [N*m] in given states.
        """
        self._mean = mean
        self._states = mean.states
        self._torque = torque
        self._solve = solve
        low = float(torque.min())
        high = float(torque.max())
        # the first nodes are both ends and the mean torque
        self.errors = {M_g: solve(M_g, states=self._states) for M_g in (low, high)}
        self.errors[mean.M_g] = mean
        self._min_spacing = _MIN_SPACING * max(abs(low), abs(high))
        self._misses: dict[tuple[float, float], float] = {}  # interpolation error by interval of torques [arcsec]

    @property
    def nodes(self) -> Array:
        """Solved torques in ascending order [N*m]."""
        return np.array(sorted(self.errors))

    @property
    def largest_miss(self) -> float:
        """Largest interpolation error in the middle of an interval [arcsec]."""
        return max(self._misses.values())

    def refine(self) -> None:
        """Halve the worst interval until the interpolation is accurate enough or there are _MOST_TORQUES torques."""
        # the target is a share of the range, but not below the resolution of a test rig
        target = max(_INTERPOLATION_SHARE * self._mean.range_arcsec, _MIN_INTERPOLATION)
        for low, high in pairwise(sorted(self.errors)):
            self._measure_miss(low, high)
        while self.largest_miss > target and len(self.errors) < _MOST_TORQUES:
            # the worst interval is halved first
            low, high = max(self._misses, key=self._misses.__getitem__)
            # its middle was solved when its interpolation error was measured
            middle = next(M_g for M_g in self.errors if low < M_g < high)
            self._measure_miss(low, middle)
            self._measure_miss(middle, high)
            del self._misses[low, high]

    def _measure_miss(self, low: float, high: float) -> None:
        """Solve the middle of an interval, and store the largest interpolation error of the states in the interval."""
        share = 0.5 if low + high else 0.4  # the middle must not be 0 N*m, where the error is undefined
        middle = low + share * (high - low)
        is_inside = (self._torque >= low) & (self._torque <= high)
        self._misses[low, high] = 0.0
        if is_inside.any() and high - low > self._min_spacing:
            self.errors[middle] = self._solve(middle, states=self._states)
            # exclude the wind-up, which is strongly nonlinear near 0 N*m
            line = (1 - share) * self._without_wind_up(low) + share * self._without_wind_up(high)
            miss = np.abs(self._without_wind_up(middle) - line)[is_inside].max()
            self._misses[low, high] = float(miss)

    def _without_wind_up(self, M_g: float) -> Array:
        """Return the rotation at a torque minus its mean [arcsec], shape (states,)."""
        return self.errors[M_g].rotation_arcsec - self.errors[M_g].wind_up_arcsec

    def interpolated(self) -> Array:
        """Return the rotation of each state at its own torque without wind-up [arcsec], shape (states,)."""
        nodes = self.nodes
        # index of the lower node of the interval; the last node belongs to the last interval
        interval = np.clip(np.searchsorted(nodes, self._torque) - 1, 0, len(nodes) - 2)
        share = (self._torque - nodes[interval]) / np.diff(nodes)[interval]
        rotations = np.array([self._without_wind_up(M_g) for M_g in nodes.tolist()])
        rows = np.arange(len(self._states))
        return np.asarray(rotations[interval, rows] * (1 - share) + rotations[interval + 1, rows] * share)

    def wind_up(self, torque: Array | float) -> Array:
        """Return the wind-up at torques [N*m], interpolated between the solved torques [arcsec]."""
        nodes = self.nodes
        return np.asarray(np.interp(torque, nodes, [self.errors[M_g].wind_up_arcsec for M_g in nodes.tolist()]))

    def proven_miss(self, rotation: Array) -> float:
        """Return the largest error of an interpolated rotation [arcsec], from states solved at their own torque.

        rotation: interpolated rotation [arcsec], shape (states,).
        """
        largest = 0.0
        # the checked states are evenly spaced, so their torques cover the whole range
        for k in np.linspace(0, len(self._states) - 1, _PROVEN_STATES).astype(np.int64).tolist():
            M_g = float(self._torque[k])
            solved = self._solve(M_g, states=self._states.take(np.array([k]))).rotation_arcsec[0]
            largest = max(largest, abs(float(solved - self.wind_up(M_g) - rotation[k])))
        return largest


# --- over both wheels' angles

WAVE_POINTS = 40  # number of grid points around each wheel
_HIGHEST = 18  # largest number of periods of a wave around a wheel
Complex = NDArray[np.complex128]
POINTS_A_TURN = 180  # number of points of a curve per input revolution


def _wave_numbers() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the periods of each wave around the flexspline and around the circular spline, shape (waves,) each."""
    k_g, k_b = np.meshgrid(
        np.arange(_HIGHEST + 1),
        np.arange(-_HIGHEST, _HIGHEST + 1),
        indexing="ij",
    )
    half = (k_g > 0) | (k_b > 0)  # the remaining waves are mirror images
    return k_g[half], k_b[half]


class ErrorWaves:
    """Errors of a drive at a torque M_g [N*m], and of drives that differ from it only in their deviations.

    k_g, k_b: periods of each wave around the flexspline and the circular spline, shape (waves,).
    certificate: certificate of all states solved so far.
    error_map: map of the drive at that torque, if it already exists.

    Raises UsageError for a drive with rolling balls.
    """

    def __init__(
        self,
        drive: Drive,
        M_g: float,
        run: Run = Run(),
        error_map: ErrorMap | None = None,
    ) -> None:
        self._map = error_map or ErrorMap(drive, M_g)
        self._run = run
        self._case = self._map.load_case()
        self.certificate = EMPTY
        self.k_g, self.k_b = _wave_numbers()

    def waves(self, drives: Sequence[Drive], points: int = WAVE_POINTS) -> Complex:
        """Return the waves of the error F_kpp of drives [arcsec], shape (drives, waves).

        The error is the real part of sum z exp(i (k_g alpha_g + k_b alpha_b)), up to a constant.

        points: grid points around each wheel; waves that the grid does not resolve are 0.

        Raises UntrustedError if a state cannot be trusted.
        """
        # the walk solves neighbouring points one after the other
        path = there_and_back((points, points))
        alpha_g, alpha_b = 2 * np.pi / points * np.stack(np.divmod(path, points))

        def where(k: int) -> str:
            g, b = (float(np.degrees(angle[k])) for angle in (alpha_g, alpha_b))
            return f"alpha_g = {g:.2f}°, alpha_b = {b:.2f}°, M_g = {self._map.M_g:g} N*m"

        # a wave with at least half as many periods as grid points would be an alias of another wave
        is_resolved = np.maximum(np.abs(self.k_g), np.abs(self.k_b)) < points / 2
        error = np.empty(points**2)
        waves = []
        for drive in drives:
            answers = self._case.solve(StateGaps(deviation_scalars(drive, alpha_g, alpha_b)), where, self._run.solved)
            self.certificate += answers.certificate
            # the results are in the order of the walk, and the grid needs its own order
            error[path] = self._map.sign * answers.rotation_arcsec
            # the error is real, so the waves of half the plane have twice the amplitude
            spectrum = np.fft.fft2(error.reshape(points, points)) / points**2
            waves.append(np.where(is_resolved, 2 * spectrum[self.k_g % points, self.k_b % points], 0))
        return np.array(waves)


@dataclass(frozen=True)
class EstimatedCycle:
    """Error F_kpp of a drive [arcsec] in each state of its full cycle, up to a constant, shape (states,).

    turn_range_arcsec: range within the input revolution with the largest estimated range, all of whose states are
        solved [arcsec].
    certificate: certificate of all solved states.
    """

    error_arcsec: Array
    turn_range_arcsec: float
    certificate: Certificate


def estimated_cycle(
    drive: Drive,
    M_g: float,
    *,
    short_cycle: int = SHORT_CYCLE,
) -> KinematicError | EstimatedCycle:
    """Return the error of a drive at a torque M_g [N*m] over its full cycle, estimated from its waves.

    short_cycle: number of states; a cycle with fewer states is solved in all of them.

    Raises UsageError for rolling balls, and UntrustedError if a state cannot be trusted.
    """
    kinematics = Kinematics.of(drive)
    states = kinematics.cycle_states
    if states < short_cycle:
        return kinematic_error(drive, M_g, run=UNCHECKED)
    torus = ErrorWaves(drive, M_g, UNCHECKED)
    # A cycle of L states contains L/z_g and L/z_b revolutions of the wheels, which gives the periods of each wave.
    periods = torus.k_g * (states // kinematics.z_g) + torus.k_b * (states // kinematics.z_b)
    spectrum = np.zeros(states, dtype=complex)
    np.add.at(spectrum, periods % states, torus.waves([drive])[0])
    error = np.fft.fft(spectrum).real  # both wheels turn backwards in the frame of the wave generator
    # waves omit the finest details, so every state of the worst revolution is solved
    first = _turn_ranges(error, kinematics).argmax() - kinematics.teeth_fixed // 2
    turn = pitch_locked_states(kinematics, (first + np.arange(kinematics.teeth_fixed)) % states)
    worst = kinematic_error(drive, M_g, states=turn, run=UNCHECKED)
    return EstimatedCycle(error, worst.range_arcsec, torus.certificate + worst.certificate)


def turn_range_arcsec(error: KinematicError | EstimatedCycle) -> float:
    """Return the largest range of the error within any one input revolution of the full cycle [arcsec]."""
    if isinstance(error, EstimatedCycle):
        return error.turn_range_arcsec
    return float(_turn_ranges(error.error_arcsec, error.kinematics).max())


def _turn_ranges(error_arcsec: Array, kinematics: Kinematics) -> Array:
    """Return the range of the error within the input revolution around each state [arcsec], shape (states,)."""
    # scipy.ndimage is imported here, because its import takes 20 ms and sampling does not need it
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    turn = kinematics.teeth_fixed
    # the cycle is periodic, so windows wrap around
    extent = maximum_filter1d(error_arcsec, turn, mode="wrap") - minimum_filter1d(error_arcsec, turn, mode="wrap")
    return np.asarray(extent)


@dataclass(frozen=True, eq=False)
class ErrorLines:
    """Spectral lines of the error of drives with the same numbers of teeth at one torque.

    The error is the real part of the sum of amplitude exp(i per_cycle angle), where the cycle has the angle 2 pi.

    kinematics: ratio and cycle of the drives.
    per_cycle: number of periods of each line in the full cycle, shape (lines,).
    amplitude: complex amplitude of each line [arcsec], shape (drives, lines).
    certificate: certificate of the solved states.
    """

    kinematics: Kinematics
    per_cycle: NDArray[np.int64]
    amplitude: Complex
    certificate: Certificate

    @property
    def curves(self) -> Array:
        """Errors over the full cycle from state 0 [arcsec], shape (drives, points).

        A curve has POINTS_A_TURN points per input revolution.
        """
        points = POINTS_A_TURN * self.kinematics.cycle_cam_revolutions
        spectrum = np.zeros((len(self.amplitude), points // 2 + 1), dtype=complex)
        # one inverse transform computes the sum of cosines
        spectrum[:, self.per_cycle] = self.amplitude
        return np.asarray(np.fft.irfft(spectrum, points) * points / 2)

    @property
    def mean(self) -> ErrorLines:
        """Lines with the mean amplitudes of all drives, as a single drive."""
        return replace(self, amplitude=self.amplitude.mean(axis=0)[None])


def error_lines(
    drive: Drive,
    M_g: float,
    changes: Sequence[Mapping[str, float]],
    run: Run = Run(),
) -> ErrorLines:
    """Return the spectral lines of the error of a drive at a torque M_g [N*m], for each of several changes.

    A wave with k_g periods around the flexspline and k_b periods around the circular spline has k_g L/z_g + k_b L/z_b
    periods in the cycle of L = lcm(z_g, z_b) states.

    changes: changed values by path, one mapping per drive.

    Raises UsageError for rolling balls, and UntrustedError if a state cannot be trusted.
    """
    waves = []
    certificate = EMPTY
    # each drive is one task
    for drive_waves, proof in run.map(partial(_waves_of, drive, M_g), changes):
        waves.append(drive_waves)
        certificate += proof
        run.finished(proof.states)
    kinematics = Kinematics.of(drive)
    k_g, k_b = _wave_numbers()
    often = k_g * (kinematics.cycle_states // drive.gears.z_g) + k_b * (kinematics.cycle_states // drive.gears.z_b)
    # waves of opposite direction with the same frequency form one line
    per_cycle = np.unique(np.abs(often[often != 0]))
    # both wheels turn backwards in the frame of the wave generator
    turning = np.where(often > 0, np.conj(waves), waves)
    amplitude = turning @ (np.abs(often)[:, None] == per_cycle)
    return ErrorLines(
        kinematics=kinematics,
        per_cycle=per_cycle,
        amplitude=amplitude,
        certificate=certificate,
    )


def _waves_of(
    drive: Drive,
    M_g: float,
    change: Mapping[str, float],
) -> tuple[Complex, Certificate]:
    changed_drive = drive.with_values(change)
    waves = ErrorWaves(changed_drive, M_g)
    return waves.waves([changed_drive])[0], waves.certificate
