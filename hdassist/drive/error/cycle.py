"""The kinematic error of a drive under constant torque, F_kpp, and its largest range F'_ior.

Source: Lyuminarsky et al. 2019, doi 10.18698/0536-1044-2019-11-3-8. The module also computes the self error, which is
    the error of a drive without deviations: its rotation over tooth phase and ball phase.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from hdassist.drive.model.contacts import WITHOUT_DEVIATIONS, ContactSystems, contact_system
from hdassist.drive.model.deviations import ToothDeviations, state_gaps
from hdassist.drive.model.geometry import (
    Array,
    Kinematics,
    States,
    ball_phase,
    neighbours_together,
    pitch_locked_states,
)
from hdassist.drive.preset.fields import Drive
from hdassist.drive.solve.answers import EMPTY, STATES_AT_A_TIME, Certificate
from hdassist.drive.solve.formulation import Formulation, formulate
from hdassist.drive.solve.loadcase import CrossCheck, LoadCase, require_compiled_as_stated, require_solver, solve_again
from hdassist.drive.solve.walk import digits_depend_on
from hdassist.run.errors import UsageError
from hdassist.run.kept import kept_answer
from hdassist.run.kept_arrays import kept_array
from hdassist.run.run import CROSS_SOLVER, Run

_ONE_WAVE = 0.01  # share of the torque on one mesh zone below which the meshing counts as single-zone
# sections of a preset that do not affect the error, such as texts, limits and uncertainties
WITHOUT_EFFECT = {"name", "description", "acceptance", "cost", "source", "uncertainty", "fit"}
_CHECKED = 3  # random states that the cross-check solves again, in addition to the extremes
_CYCLE_BLOCK = 4 * STATES_AT_A_TIME  # states whose gaps are in memory at the same time


@dataclass(frozen=True)
class KinematicError:
    """Kinematic error of a drive at one torque."""

    kinematics: Kinematics
    M_g: float  # [N*m]
    states: States
    # rotation of the flexspline relative to the circular spline (wind-up plus error), shape (states,)
    rotation_arcsec: Array
    zone_share: Array  # share of the torque on each mesh zone, shape (states, 2)
    tooth_force_N: Array  # largest force on a flank, shape (states,)
    certificate: Certificate
    cross_check: CrossCheck | None

    @cached_property
    def error_arcsec(self) -> Array:
        """F_kpp of each state [arcsec], relative to the first state, equation (9), shape (states,)."""
        # the first state is the zero of the paper's curve; ranges do not depend on it
        return np.asarray(self.kinematics.error_sign * (self.rotation_arcsec - self.rotation_arcsec[0]))

    @property
    def range_arcsec(self) -> float:
        """Largest minus smallest error [arcsec], which is F'_ior if the states are the full cycle."""
        return float(np.ptp(self.error_arcsec))

    @property
    def F_ior_arcsec(self) -> float:
        """F'_ior [arcsec].

        Raises UsageError if the states are not the full cycle.
        """
        if len(self.states) < self.kinematics.cycle_states:
            message = "F'_ior can be computed only from all mesh positions of the full mesh cycle"
            raise UsageError(message, "compute the full mesh cycle, for example with kinematic_error")
        return self.range_arcsec

    @property
    def at_max(self) -> int:
        """Index of the state with the largest error."""
        return int(np.argmax(self.error_arcsec))

    @property
    def at_min(self) -> int:
        """Index of the state with the smallest error."""
        return int(np.argmin(self.error_arcsec))

    def sampled(self, count: int = _CHECKED, seed: int = 0) -> KinematicError:
        """Return the error at its two extremes and at some random states.

        count: number of random states.
        seed: seed of their selection.
        """
        # F'_ior depends only on the extremes, so the other solver always checks them; random states check the rest of
        # the curve
        states = len(self.states)
        random_rows = np.random.default_rng(seed).choice(
            states,
            min(count, states),
            replace=False,
        )
        rows = np.unique(np.concatenate([[self.at_max, self.at_min], random_rows]))
        return replace(
            self,
            states=self.states.take(rows),
            rotation_arcsec=self.rotation_arcsec[rows],
            zone_share=self.zone_share[rows],
            tooth_force_N=self.tooth_force_N[rows],
        )

    @property
    def one_wave_share(self) -> float:
        """Share of states in which one mesh zone carries less than 1 % of the torque."""
        return float(np.mean(self.zone_share.min(axis=1) < _ONE_WAVE))

    @property
    def wind_up_arcsec(self) -> float:
        """Mean twist of the flexspline relative to the circular spline over all states [arcsec]."""
        return float(self.rotation_arcsec.mean())

    @property
    def max_tooth_force_N(self) -> float:
        """Largest force on a flank over the states [N]."""
        return float(self.tooth_force_N.max())


def kinematic_error(
    drive: Drive,
    M_g: float,
    *,
    states: States | None = None,
    teeth: ToothDeviations | None = None,
    solver: str | None = None,
    run: Run = Run(),
) -> KinematicError:
    """Return the kinematic error of a drive at one torque.

    Unknown deviations count as 0 here; the package `belief` samples their ranges.

    Args:
        drive: the drive.
        M_g: torque on the flexspline [N*m].
        states: states to solve; the full cycle by default.
        teeth: measured tooth deviations that replace the drive's harmonics.
        solver: name of a cvxpy solver that solves every state in place of the built-in one.
        run: processes, progress and the solver of the cross-check.

    Raises UsageError for an unknown solver, UntrustedError if a result cannot be trusted.
    """
    for name in (solver, run.cross_check):
        if name:
            require_solver(name)
    kinematics = Kinematics.of(drive)
    # the full cycle is the default, since F'_ior is defined over it
    states = pitch_locked_states(kinematics) if states is None else states
    solved = _solved_states(drive, M_g, states, teeth, solver, run)
    error = KinematicError(
        kinematics=kinematics,
        M_g=M_g,
        states=states,
        rotation_arcsec=solved.rotation_arcsec,
        zone_share=solved.zone_share,
        tooth_force_N=solved.tooth_force_N,
        certificate=solved.certificate,
        cross_check=None,
    )
    if not run.cross_check:
        return error
    return replace(error, cross_check=_cross_check_of(drive, error.sampled(seed=run.seed), teeth, run, {}))


@dataclass(frozen=True, eq=False)
class _SolvedStates:
    """Solved states with their certificate.

    rotation_arcsec: rotation [arcsec], shape (states,).
    zone_share: share of the torque on each mesh zone, shape (states, 2).
    tooth_force_N: largest tooth force [N], shape (states,).
    certificate: certificate of all states.
    """

    rotation_arcsec: Array
    zone_share: Array
    tooth_force_N: Array
    certificate: Certificate


def _solved_states(
    drive: Drive,
    M_g: float,
    states: States,
    teeth: ToothDeviations | None,
    solver: str | None,
    run: Run,
) -> _SolvedStates:
    """Solve states of a drive in an order in which consecutive states have similar contacts.

    The arguments are those of `kinematic_error`.
    """
    kinematics = Kinematics.of(drive)
    rotation = np.empty(len(states))
    zone_share = np.empty((len(states), 2))
    tooth_force = np.empty(len(states))
    certificate = EMPTY
    # one pass with locked balls, one pass per ball phase with rolling balls
    for rows, formulation in _formulations(drive, states):
        case = LoadCase(formulation, M_g, solver=solver)
        # consecutive states with similar contact sets make the walk fast
        ordered_rows = rows[neighbours_together(kinematics, states.take(rows))]
        for block in np.split(ordered_rows, range(_CYCLE_BLOCK, len(rows), _CYCLE_BLOCK)):
            block_states = states.take(block)
            gaps = state_gaps(drive, case.system, block_states, teeth)
            answers = case.solve(gaps, partial(state_place, block_states, M_g), run.solved)
            rotation[block] = answers.rotation_arcsec
            zone_share[block] = answers.zone_share
            tooth_force[block] = answers.tooth_force_N
            certificate += answers.certificate
    return _SolvedStates(
        rotation_arcsec=rotation, zone_share=zone_share, tooth_force_N=tooth_force, certificate=certificate
    )


def whole_error(
    drive: Drive,
    M_g: float,
    *,
    teeth: ToothDeviations | None = None,
    solver: str | None = None,
    run: Run = Run(),
) -> KinematicError:
    """Return the kinematic error over the full cycle without a cross-check, from the user's cache if available.

    The cache stores only results that the preset alone determines: those without measured teeth and without another
    solver. The arguments and errors are those of `kinematic_error`.
    """
    # the caller may run the cross-check in parallel with other work
    compute = partial(
        kinematic_error,
        drive,
        M_g,
        teeth=teeth,
        solver=solver,
        run=replace(run, cross_check=None),
    )
    # the cache key contains neither the measured teeth nor the solver, whose results differ in the last digits
    if teeth or solver:
        return compute()

    def columns() -> tuple[Array, Certificate]:
        error = compute()
        return np.vstack([error.rotation_arcsec, error.zone_share.T, error.tooth_force_N]), error.certificate

    kinematics = Kinematics.of(drive)
    # texts and limits do not change the error, so presets that differ only in them share one cached result
    sections = drive.model_dump(mode="json", exclude=WITHOUT_EFFECT)
    depends = {"drive": sections, "M_g": M_g, "program": digits_depend_on()}
    shape = (4, kinematics.cycle_states)  # rows: rotation, share of each zone, tooth force
    array, certificate = kept_array("cycle", depends, shape, Certificate, columns)
    rotation, share_0, share_1, tooth_force = array
    return KinematicError(
        kinematics=kinematics,
        M_g=M_g,
        states=pitch_locked_states(kinematics),
        rotation_arcsec=rotation,
        zone_share=np.stack([share_0, share_1], axis=1),
        tooth_force_N=tooth_force,
        certificate=certificate,
        cross_check=None,
    )


def _formulations(drive: Drive, states: States) -> Iterator[tuple[NDArray[np.int64], Formulation]]:
    """Yield the indices of the states that share a contact system, with its programme, for each ball phase."""
    if drive.bearing.ball_motion == "locked":
        yield np.arange(len(states)), formulate(contact_system(drive))
        return
    systems = ContactSystems(drive)
    # the cage turns continuously; phases are rounded to n_beta steps so that states can share a system
    steps = drive.numerics.n_beta
    nearest = np.rint(ball_phase(drive, states.phi_h) * steps).astype(np.int64) % steps
    # states of one ball phase share a system and its walk
    for step in np.unique(nearest):
        yield np.flatnonzero(nearest == step), formulate(systems.at(0.0, step / steps))


def _cross_check_of(
    drive: Drive,
    error: KinematicError,
    teeth: ToothDeviations | None,
    run: Run,
    stated: dict[bytes, Formulation],
) -> CrossCheck:
    """Solve all states of an error again with the other solver of the run.

    Args:
        drive: the drive.
        error: the states and their rotation.
        teeth: measured tooth deviations.
        run: names the solver; CROSS_SOLVER by default.
        stated: the last programme by its digest, replaced by that of this error. Programmes are reused, because cvxpy
            takes as long to compile one as to solve two states.

    Raises UntrustedError if the two solvers disagree.
    """
    checks = []
    for rows, formulation in _formulations(drive, error.states):
        states = error.states.take(rows)
        torques = np.full(len(rows), error.M_g)
        delta_p = formulation.system.delta_p_of(state_gaps(drive, formulation.system, states, teeth))
        where = partial(state_place, states, error.M_g)
        solver = run.cross_check or CROSS_SOLVER
        # all torques of a drive share one programme, which is compiled once; only one is stored, because it needs much
        # memory
        if formulation.digest not in stated:
            stated.clear()
            stated[formulation.digest] = formulation
        programme = stated[formulation.digest]
        checks.append(solve_again(programme, torques, delta_p, error.rotation_arcsec[rows], solver, where))
    worst = max(check.max_difference_arcsec for check in checks)
    return CrossCheck(
        solver=checks[0].solver,
        states=len(error.states),
        max_difference_arcsec=worst,
    )


def require_programme(drive: Drive, run: Run) -> None:
    """Check that cvxpy compiles a drive's programme unchanged, in the process for other solvers if there is one.

    Raises UntrustedError if the compiled data differ, or if no teeth overlap.
    """
    require_compiled_as_stated(formulate(contact_system(drive)), run)


_Solved = tuple[Drive, ToothDeviations | None, KinematicError]  # a drive, its measured teeth, and its error


def cross_checks_of(solved: Sequence[_Solved], run: Run) -> list[CrossCheck]:
    """Return the cross-check of each error with the other solver of the run.

    Raises UntrustedError if the two solvers disagree.
    """
    stated: dict[bytes, Formulation] = {}
    return [_cross_check_of(drive, error, teeth, run, stated) for drive, teeth, error in solved]


def state_place(
    states: States,
    M_g: float,
    k: int,
) -> str:
    """Return the description of state k at a torque M_g [N*m] for messages."""
    phi_h = float(np.degrees(states.phi_h[k]))
    phi_g = float(np.degrees(states.phi_g[k]))
    phi_b = float(np.degrees(states.phi_b[k]))
    # round before dividing: 359.97 deg is one turn and 0.0 deg, not 360.0 deg
    turns, angle = divmod(round(phi_h, 1), 360.0)
    unit = "turn" if turns == 1 else "turns"
    cam = f"{turns:.0f} {unit} + {angle:.1f}°"
    return f"phi_h = {cam}, phi_g = {phi_g:.3f}°, phi_b = {phi_b:.3f}°, M_g = {M_g:g} N*m"


# --- the self error


@dataclass(frozen=True)
class SelfError:
    """Self error of a drive at one torque."""

    M_g: float  # [N*m]
    # twist of the flexspline at tooth phase tau = i/n and ball phase beta = k/n, shape (tooth phases, ball phases)
    rotation_arcsec: Array
    certificate: Certificate

    @property
    def range_arcsec(self) -> float:
        """Largest minus smallest rotation over both phases [arcsec]."""
        return float(np.ptp(self.rotation_arcsec))

    @property
    def tooth_phase_arcsec(self) -> float:
        """Range over the tooth phase [arcsec] at ball phase 0."""
        return float(np.ptp(self.rotation_arcsec[:, 0]))

    @property
    def ball_phase_arcsec(self) -> float:
        """Range over the ball phase [arcsec] at tooth phase 0."""
        return float(np.ptp(self.rotation_arcsec[0]))


_SELF_ERRORS = TypeAdapter(list[tuple[list[list[float]], Certificate]])


def self_error(
    drive: Drive,
    torques: Sequence[float],
    *,
    run: Run = Run(),
) -> list[SelfError]:
    """Return the self error of a drive at torques M_g [N*m], over numerics.n_phase tooth and ball phases.

    The user's cache stores the result. Raises UntrustedError if a result cannot be trusted.
    """
    sections = drive.model_dump(mode="json", exclude=WITHOUT_EFFECT)
    depends = {"drive": sections, "torques": list(torques), "program": digits_depend_on()}
    rotations = kept_answer("self", depends, _SELF_ERRORS, partial(_self_errors, drive, torques))
    # progress counts the states of cached results as well
    run.solved(sum(certificate.states for _, certificate in rotations))
    return [
        SelfError(M_g, np.array(rotation), certificate)
        for M_g, (rotation, certificate) in zip(torques, rotations, strict=True)
    ]


def _self_errors(drive: Drive, torques: Sequence[float]) -> list[tuple[list[list[float]], Certificate]]:
    """Return the rotation [arcsec] over both phases at each torque, with its certificate."""
    systems = ContactSystems(drive)
    # tau and beta both have period 1, so the grid omits the value 1
    grid = drive.numerics.n_phase
    rotation = np.empty((len(torques), grid, grid))
    certificates = [EMPTY for _ in torques]
    # one case per torque: contact sets of neighbouring phases are similar, those of different torques are not
    cases: dict[float, LoadCase] = {}
    for i, k in np.ndindex(grid, grid):
        formulation = formulate(systems.at(i / grid, k / grid))
        for t, M_g in enumerate(torques):
            cases[M_g] = LoadCase(
                formulation,
                M_g,
                like=cases.get(M_g, cases.get(torques[0])),
            )
            place = partial(_place, i / grid, k / grid, M_g)
            answers = cases[M_g].solve(WITHOUT_DEVIATIONS, place)
            rotation[t, i, k] = answers.rotation_arcsec[0]
            certificates[t] += answers.certificate
    return list(
        zip(
            rotation.tolist(),
            certificates,
            strict=True,
        )
    )


@dataclass(frozen=True)
class LimitRooms:
    """Difference between the limits of F'_ior and the self error."""

    arcsec: list[float | None]  # at each torque; None without a limit
    certificate: Certificate  # certificate of the self error; empty if there is no limit


def limits_left(
    drive: Drive,
    torques: Sequence[float],
    run: Run = Run(),
) -> LimitRooms:
    """Return the limits of F'_ior minus the self error at torques [N*m].

    Raises UntrustedError if a self error cannot be trusted.
    """
    limits = [drive.limit(M_g) for M_g in torques]
    # the self error is needed only if there is a limit
    self_errors = (
        self_error(
            drive,
            torques,
            run=run,
        )
        if any(limits)
        else []
    )
    certificate = sum((error.certificate for error in self_errors), EMPTY)
    # a limit applies to the measured range, which contains the self error; the difference is left for F'_ior
    rooms = [None if limit is None else limit - error.range_arcsec for limit, error in zip_longest(limits, self_errors)]
    return LimitRooms(rooms, certificate)


def _place(
    tau: float,
    beta: float,
    M_g: float,
    _: int,
) -> str:
    return f"tau = {tau:g}, beta = {beta:g}, M_g = {M_g:g} N*m, without deviations"
