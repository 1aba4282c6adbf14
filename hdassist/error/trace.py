"""The error against the cam angle, as a rig would record it, and its orders: amplitude, phase and cause of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise, product

import numpy as np

from hdassist.error.cycle import KinematicError, kinematic_error
from hdassist.errors import UsageError
from hdassist.files import number_of
from hdassist.model.deviations import MeasuredTeeth, is_half_turn_symmetric
from hdassist.model.geometry import Array, Kinematics, pitch_locked_states
from hdassist.preset.fields import DEVIATIONS, Drive
from hdassist.run.run import UNCHECKED, Run
from hdassist.solve.answers import EMPTY

_DEGREE = 4  # products of up to so many deviations are named
_UNEXPLAINED_ORDERS = 12  # orders without a known cause that are kept all the same
NO_CAUSE = "no single cause known"
_FLOOR = 1e-9  # arcsec: a smaller value is rounding
_INTERPOLATED, _LEAST_INTERPOLATED = 0.02, 0.02  # of the range, and arcsec: error of interpolation that is aimed at
_MOST_TORQUES, _PROVEN_STATES = 33, 24  # that are solved; states that are solved at their own torque
_LEAST_APART = 1e-6  # of the greatest torque: between two that are solved


@dataclass(frozen=True)
class _Order:
    """One order of the error: amplitude cos(per_cam_rev phi_h + phase), and its cause in words."""

    per_cam_rev: float
    amplitude_arcsec: float
    phase_deg: float
    cause: str


def order_legend(drive: Drive) -> str:
    """How to read the causes of a drive's orders."""
    even = ", an even number of them in all: z_g, N and n_2 are even" * is_half_turn_symmetric(drive)
    return (
        "rigid wheel: its teeth and the cam offset that stands still with it; flexspline: its teeth and the "
        "cam offset that goes with it; cam: the offset that turns with the cam. The error follows sums and "
        f"differences of their orders{even}."
    )


def known_causes(drive: Drive) -> dict[tuple[int, int], tuple[float, str]]:
    """Order per cam revolution, and cause, of each product of a drive's deviations up to DEGREE.

    Keys (k_g, k_b): how often deviations that turn with the flexspline and with the rigid wheel, as seen
    from the cam, enter. Where half a turn maps teeth and balls onto each other the error is even in all deviations
    together, and an odd product needs the offset that turns with the cam, e_hh, as well.
    """
    even = is_half_turn_symmetric(drive)
    kinematics = Kinematics.of(drive)
    rate_g = kinematics.teeth_fixed / kinematics.z_g
    rate_b = kinematics.teeth_fixed / kinematics.z_b
    deviating = {each.part for each in DEVIATIONS if drive.number(each.size)}
    most_g, most_b = _DEGREE * ("g" in deviating), _DEGREE * ("b" in deviating)
    found = {}
    for k_g, k_b in product(range(most_g + 1), range(-most_b, most_b + 1)):
        degree = k_g + abs(k_b)
        needs_cam = even and degree % 2 == 1
        if 0 < degree <= _DEGREE and (k_g > 0 or k_b > 0) and ("h" in deviating or not needs_cam):
            found[k_g, k_b] = (abs(k_g * rate_g + k_b * rate_b), _words(k_g, k_b, needs_cam))
    return found


def _words(k_g: int, k_b: int, needs_cam: bool) -> str:
    flexspline = f"{k_g if k_g > 1 else ''} flexspline" if k_g else ""
    rigid = f"{abs(k_b) if abs(k_b) > 1 else ''} rigid wheel" if k_b else ""
    between = (" - " if k_b < 0 else " + ") if k_g and k_b else ""
    return " ".join(f"{flexspline}{between}{rigid}{' + cam' if needs_cam else ''}".split())


def orders(drive: Drive, error_arcsec: Array, revolutions: int) -> list[_Order]:
    """Orders of a drive's error sampled at even steps over whole cam revolutions, by rising order.

    Arguments: drive, whose deviations name the causes; error_arcsec, shape (states,); revolutions, cam
    revolutions that they span. Known orders are always there, others where they are among the largest. Where
    several causes fall within the resolution (1/revolutions), the simplest stand together.
    """
    count = len(error_arcsec)
    spectrum = np.fft.rfft(error_arcsec - np.mean(error_arcsec))
    amplitude = 2 * np.abs(spectrum) / count
    if count % 2 == 0:
        amplitude[-1] /= 2  # the last bin has no mirror image
    causes: dict[int, list[tuple[int, str]]] = {}
    for (k_g, k_b), (order, words) in known_causes(drive).items():
        place = round(order * revolutions)
        if 0 < place < len(amplitude):
            causes.setdefault(place, []).append((abs(k_g) + abs(k_b), words))
    largest = np.argsort(amplitude)[::-1][:_UNEXPLAINED_ORDERS].tolist()
    phase, found = np.degrees(np.angle(spectrum)), []
    for place in sorted({*causes, *largest} - {0}):
        if place in causes or amplitude[place] > _FLOOR:
            least = min(causes.get(place, []), default=(0, ""))[0]
            words = "; ".join(words for degree, words in causes.get(place, []) if degree == least)
            found.append(_Order(place / revolutions, float(amplitude[place]), float(phase[place]), words or NO_CAUSE))
    return found


#


@dataclass(frozen=True)
class Gravity:
    """Torque of a weight: amplitude [N*m] times the cosine of the moving wheel's angle less a direction [deg]."""

    amplitude_Nm: float
    direction_deg: float = 0.0

    @classmethod
    def of(cls, text: str) -> Gravity:
        """Read "60,90". Raises UsageError: no such text."""
        numbers = [number_of(part) for part in text.split(",")]
        if len(numbers) > 2 or not np.isfinite(numbers).all() or not 0 < abs(numbers[0]) <= 1e7:
            hint = "amplitude in N·m, and the output's angle in deg where it is greatest: 60,90"
            raise UsageError(f"invalid --gravity {text}: expected AMPLITUDE[,ANGLE]", hint)
        return cls(*numbers)


@dataclass(frozen=True)
class ErrorAlong:
    """An error along which the torque changes [N*m]: least, greatest, and those solved with their ranges [arcsec].

    wind_up_arcsec: range of the mean twist, which the error is without; bound_arcsec: of what the straight line from
    one torque to the next leaves of the error, by torques halfway and by states solved at their own.
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
    """Error over whole cam revolutions from phi_h = 0.

    start_deg: the moving wheel's angle there; measured: wheels in place of first harmonics; along: where the torque
    changes along it, of which the mean is the error's; then the error is without the mean wind-up.
    """

    error: KinematicError
    start_deg: float
    revolutions: int
    orders: tuple[_Order, ...]
    measured: MeasuredTeeth | None = None
    along: ErrorAlong | None = None

    @property
    def slope_arcsec_per_deg(self) -> float:
        """Greatest slope of the error over the angle of the output, from state to state."""
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
    """Error of a drive at a torque M_g [N*m] over whole cam revolutions, and its orders.

    Arguments: gravity, on top of M_g; measured, wheels in place of first harmonics; start_deg, angle of the moving
    wheel at phi_h = 0 (phi_g0 with the rigid wheel fixed) [deg], measured ones to the nearest of their teeth;
    solver, a name that cvxpy knows, to send each state through cvxpy instead of the engine.
    Raises UsageError for less than one revolution, more than a cycle, a start angle that is no number or an unknown
    solver, UntrustedError where an answer cannot be trusted.
    """
    kinematics = Kinematics.of(drive)
    if not 1 <= revolutions <= kinematics.cycle_cam_revolutions:
        raise UsageError(
            f"revolutions must be 1 to {kinematics.cycle_cam_revolutions}, not {revolutions}",
            "after the full cycle the error repeats itself",
        )
    if not np.isfinite(start_deg):
        raise UsageError(f"the start angle must be a number, not {start_deg}")
    states = pitch_locked_states(
        kinematics, np.arange(revolutions * kinematics.teeth_fixed), float(np.radians(start_deg))
    )
    there, teeth = measured.in_drive(drive) if measured else (drive, None)
    error = kinematic_error(there, M_g, states=states, teeth=teeth, solver=solver, run=run)
    along = None
    if gravity:
        more = partial(kinematic_error, there, teeth=teeth, solver=solver, run=UNCHECKED)
        error, along = _error_along(error, gravity, more)
    found = orders(drive, error.error_arcsec, revolutions)
    return Trace(error, start_deg, revolutions, tuple(found), measured, along)


def _error_along(
    mean: KinematicError, gravity: Gravity, solve: Callable[..., KinematicError]
) -> tuple[KinematicError, ErrorAlong]:
    """Error with gravity on top of a mean torque, whose error is there, straight between torques that are solved.

    Torques halfway are solved until lines miss them by no more than INTERPOLATED of the range. Argument: solve, gives
    the error at a torque [N*m] in some states.
    """
    states = mean.states
    moving = states.phi_g if mean.kinematics.fixed == "rigid" else states.phi_b
    torque = mean.M_g + gravity.amplitude_Nm * np.cos(moving - np.radians(gravity.direction_deg))
    low, high = float(torque.min()), float(torque.max())
    solved = {M_g: solve(M_g, states=states) for M_g in (low, high)}
    solved[mean.M_g] = mean

    def rest(M_g: float) -> Array:
        """Rotation in each state at a torque less its mean, shape (states,) [arcsec]."""
        return solved[M_g].rotation_arcsec - solved[M_g].wind_up_arcsec

    missed: dict[tuple[float, float], float] = {}  # by lines between two torques, halfway, in the states between them
    open_ = list(pairwise(sorted(solved)))
    while open_:
        for below, above in open_:
            share = 0.5 if below + above else 0.4  # no error at no torque at all
            between, own = below + share * (above - below), (torque >= below) & (torque <= above)
            missed[below, above] = 0.0
            if own.any() and above - below > _LEAST_APART * max(abs(low), abs(high)):
                solved[between] = solve(between, states=states)
                line = (1 - share) * rest(below) + share * rest(above)
                missed[below, above] = float(np.abs(rest(between) - line)[own].max())
        worst = max(missed, key=missed.__getitem__)
        aim = max(_INTERPOLATED * mean.range_arcsec, _LEAST_INTERPOLATED)
        open_ = []
        if missed[worst] > aim and len(solved) < _MOST_TORQUES:
            between = next(M_g for M_g in solved if worst[0] < M_g < worst[1])
            open_ = [(worst[0], between), (between, worst[1])]
            del missed[worst]
    bound = max(missed.values())
    nodes = np.array(sorted(solved))
    place = np.clip(np.searchsorted(nodes, torque) - 1, 0, len(nodes) - 2)
    shares = (torque - nodes[place]) / np.diff(nodes)[place]
    every, each = np.array([rest(M_g) for M_g in nodes.tolist()]), np.arange(len(states))
    rotation = every[place, each] * (1 - shares) + every[place + 1, each] * shares
    twist = [solved[M_g].wind_up_arcsec for M_g in nodes.tolist()]
    for k in np.linspace(0, len(states) - 1, _PROVEN_STATES).astype(np.int64).tolist():
        own = solve(float(torque[k]), states=states.take(np.array([k]))).rotation_arcsec[0]
        bound = max(bound, abs(float(own - np.interp(torque[k], nodes, twist) - rotation[k])))
    certificate = sum((one.certificate for one in solved.values()), EMPTY)
    ranges = tuple(solved[M_g].range_arcsec for M_g in nodes.tolist())
    wind_up = float(np.ptp(np.interp(torque, nodes, twist)))
    along = ErrorAlong(gravity, low, high, tuple(nodes.tolist()), ranges, wind_up, bound)
    return replace(mean, rotation_arcsec=rotation, certificate=certificate), along
