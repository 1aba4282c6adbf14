"""The kinematic error of a drive under constant torque, F_kpp, and its largest range F'_ior.

Source: Lyuminarsky et al. 2019, doi 10.18698/0536-1044-2019-11-3-8. Beside it the self error, which a drive without
deviations has: rotation over tooth phase and ball phase.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import zip_longest
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter

from hdassist.errors import UsageError
from hdassist.model.contacts import WITHOUT_DEVIATIONS, ContactSystems, contact_system
from hdassist.model.deviations import ToothDeviations, state_gaps
from hdassist.model.geometry import (
    Array,
    Kinematics,
    States,
    ball_phase,
    neighbours_together,
    pitch_locked_states,
)
from hdassist.preset.fields import Drive
from hdassist.run.kept import kept_answer
from hdassist.run.run import CROSS_SOLVER, Run
from hdassist.solve.answers import EMPTY, STATES_AT_A_TIME, Certificate
from hdassist.solve.formulation import Formulation, formulate
from hdassist.solve.loadcase import CrossCheck, LoadCase, require_compiled_as_stated, require_solver, solve_again
from hdassist.solve.walk import digits_depend_on

_ONE_WAVE = 0.01  # a zone that carries less of the torque than this leaves the other one alone
# parts of a preset without any bearing on its error: words, limits, uncertainties
WITHOUT_EFFECT = {"name", "description", "acceptance", "cost", "source", "uncertainty", "fit"}
_CHECKED = 3  # random states beside the extremes that another solver solves again
_CYCLE_BLOCK = 4 * STATES_AT_A_TIME  # states whose gaps are held at once


@dataclass(frozen=True)
class KinematicError:
    """Kinematic error of a drive at one torque.

    M_g [N*m]; error_arcsec, F_kpp relative to the first state, shape (states,); rotation_arcsec, the
    twist of the flexspline against the rigid wheel (wind-up and error); zone_share, share of the torque
    that each mesh zone takes, shape (states, 2); tooth_force_N, greatest force on a flank in each state.
    """

    kinematics: Kinematics
    M_g: float
    states: States
    rotation_arcsec: Array
    zone_share: Array
    tooth_force_N: Array
    certificate: Certificate
    cross_check: CrossCheck | None

    @cached_property
    def error_arcsec(self) -> Array:
        """F_kpp [arcsec] of each state, zero in the first."""
        return np.asarray(self.kinematics.error_sign * (self.rotation_arcsec - self.rotation_arcsec[0]))

    @property
    def range_arcsec(self) -> float:
        """Greatest minus least error [arcsec]: F'_ior where the states are the full cycle."""
        return float(np.ptp(self.error_arcsec))

    @property
    def F_ior_arcsec(self) -> float:
        """F'_ior [arcsec]. Raises UsageError where the states are not the full cycle."""
        if len(self.states) < self.kinematics.cycle_states:
            raise UsageError("F'_ior needs every state of the full mesh cycle")
        return self.range_arcsec

    @property
    def at_max(self) -> int:
        """Place of the greatest error among the states."""
        return int(np.argmax(self.error_arcsec))

    @property
    def at_min(self) -> int:
        """Place of the least error among the states."""
        return int(np.argmin(self.error_arcsec))

    def sampled(self, count: int = _CHECKED, seed: int = 0) -> KinematicError:
        """The same at its extremes and at so many random states alone."""
        some = np.random.default_rng(seed).choice(len(self.states), min(count, len(self.states)), replace=False)
        rows = np.unique(np.concatenate([[self.at_max, self.at_min], some]))
        kept = {name: getattr(self, name)[rows] for name in ("rotation_arcsec", "zone_share", "tooth_force_N")}
        return replace(self, states=self.states.take(rows), **kept)

    @property
    def one_wave_share(self) -> float:
        """Share of states in which one mesh zone takes less than 1 % of the torque."""
        return float(np.mean(self.zone_share.min(axis=1) < _ONE_WAVE))

    @property
    def wind_up_arcsec(self) -> float:
        """Mean twist of the flexspline against the rigid wheel over the states [arcsec]."""
        return float(self.rotation_arcsec.mean())

    @property
    def max_tooth_force_N(self) -> float:
        """Greatest force on a flank over the states [N]."""
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
    """Kinematic error of a drive at a torque M_g [N*m], over the full cycle unless states are given.

    Deviations that are not known count as 0 here; the room `belief` has their ranges.
    Arguments: teeth, measured tooth deviations in place of first harmonics; solver, a name that cvxpy
    knows, to send each state through cvxpy instead of the engine.
    Raises UsageError for an unknown solver, UntrustedError where an answer cannot be trusted.
    """
    for name in filter(None, (solver, run.cross_check)):
        require_solver(name)
    kinematics = Kinematics.of(drive)
    states = pitch_locked_states(kinematics) if states is None else states
    count = len(states)
    rotation = np.empty(count)
    share = np.empty((count, 2))
    force = np.empty(count)
    certificate = EMPTY
    for rows, formulation in _formulations(drive, states):
        rows = rows[neighbours_together(kinematics, states.take(rows))]
        case = LoadCase(formulation, M_g, solver=solver)
        for some in np.split(rows, range(_CYCLE_BLOCK, len(rows), _CYCLE_BLOCK)):
            part = states.take(some)
            answers = case.solve(
                state_gaps(drive, case.system, part, teeth), partial(state_place, part, M_g), run.solved
            )
            rotation[some] = answers.rotation_arcsec
            share[some] = answers.zone_share
            force[some] = answers.tooth_force_N
            certificate += answers.certificate
    result = KinematicError(
        kinematics=kinematics,
        M_g=M_g,
        states=states,
        rotation_arcsec=rotation,
        zone_share=share,
        tooth_force_N=force,
        certificate=certificate,
        cross_check=None,
    )
    if not run.cross_check:
        return result
    return replace(result, cross_check=_cross_check_of(drive, result.sampled(seed=run.seed), teeth, run, {}))


def whole_error(
    drive: Drive, M_g: float, *, teeth: ToothDeviations | None = None, solver: str | None = None, run: Run = Run()
) -> KinematicError:
    """Kinematic error over the full cycle, not solved again; kept for the next time, where the preset alone decides it.

    Arguments and errors as those of `kinematic_error`.
    """
    fresh = partial(kinematic_error, drive, M_g, teeth=teeth, solver=solver, run=replace(run, cross_check=None))
    if teeth or solver:
        return fresh()

    def columns() -> tuple[bytes, Certificate]:
        error = fresh()
        return np.vstack([error.rotation_arcsec, error.zone_share.T, error.tooth_force_N]).tobytes(), error.certificate

    kinematics = Kinematics.of(drive)
    parts = drive.model_dump(mode="json", exclude=WITHOUT_EFFECT)
    depends = {"drive": parts, "M_g": M_g, "program": digits_depend_on()}
    data, proof = kept_answer("cycle", depends, _columns_of(kinematics.cycle_states), columns)
    rotation, *shares, force = np.frombuffer(data).reshape(_COLUMNS, -1)
    states = pitch_locked_states(kinematics)
    return KinematicError(
        kinematics=kinematics,
        M_g=M_g,
        states=states,
        rotation_arcsec=rotation,
        zone_share=np.stack(shares, axis=1),
        tooth_force_N=force,
        certificate=proof,
        cross_check=None,
    )


_COLUMNS = 4  # of numbers of a state: rotation, share of each zone, force on a flank


def _columns_of(states: int) -> TypeAdapter[tuple[bytes, Certificate]]:
    """Type of the kept numbers of so many states, all of them finite, and their proof."""

    def finite(data: bytes) -> bytes:
        if not np.isfinite(np.frombuffer(data)).all():
            raise ValueError("expected finite numbers")
        return data

    size = _COLUMNS * states * np.dtype(float).itemsize
    of_states = Annotated[bytes, Field(min_length=size, max_length=size), AfterValidator(finite)]
    return TypeAdapter(
        tuple[of_states, Certificate], config=ConfigDict(ser_json_bytes="base64", val_json_bytes="base64")
    )


def _formulations(drive: Drive, states: States) -> Iterator[tuple[NDArray[np.int64], Formulation]]:
    """Rows of the states that share a contact system, and its programme: one for each position of the balls."""
    if drive.bearing.ball_motion == "locked":
        yield np.arange(len(states)), formulate(contact_system(drive))
        return
    systems = ContactSystems(drive)
    steps = drive.numerics.n_beta
    nearest = np.rint(ball_phase(drive, states.phi_h) * steps).astype(np.int64) % steps
    for step in np.unique(nearest):
        yield np.flatnonzero(nearest == step), formulate(systems.at(0.0, step / steps))


def _cross_check_of(
    drive: Drive, error: KinematicError, teeth: ToothDeviations | None, run: Run, stated: dict[bytes, Formulation]
) -> CrossCheck:
    """All states of an error solved again by the run's other solver.

    Arguments as those of `kinematic_error`; stated, the last programme by its digest, the next one then: cvxpy takes
    as long to compile one as to solve two states of it. Raises UntrustedError where two solvers disagree.
    """
    checks = []
    for rows, formulation in _formulations(drive, error.states):
        states = error.states.take(rows)
        torques = np.full(len(rows), error.M_g)
        delta_p = formulation.system.delta_p_of(state_gaps(drive, formulation.system, states, teeth))
        where = partial(state_place, states, error.M_g)
        solver = run.cross_check or CROSS_SOLVER
        if formulation.digest not in stated:
            stated.clear()
            stated[formulation.digest] = formulation
        programme = stated[formulation.digest]
        checks.append(solve_again(programme, torques, delta_p, error.rotation_arcsec[rows], solver, where))
    worst = max(check.max_difference_arcsec for check in checks)
    return CrossCheck(checks[0].solver, len(error.states), worst)


def require_programme(drive: Drive, run: Run) -> None:
    """Make sure that cvxpy compiles a drive's programme as stated, in the process for other solvers if there is one.

    Arguments: drive; run. Raises UntrustedError where it compiles to something else, or no teeth overlap.
    """
    require_compiled_as_stated(formulate(contact_system(drive)), run)


_Solved = tuple[Drive, ToothDeviations | None, KinematicError]  # a drive, its measured teeth, and its error


def cross_checks_of(solved: Sequence[_Solved], run: Run) -> list[CrossCheck]:
    """Cross-check of each of some errors by the run's other solver; raises UntrustedError where two disagree."""
    stated: dict[bytes, Formulation] = {}
    return [_cross_check_of(drive, error, teeth, run, stated) for drive, teeth, error in solved]


def state_place(states: States, M_g: float, k: int) -> str:
    """Words for where state k of some states is, at a torque [N*m]."""
    phi_h, phi_g, phi_b = (float(np.degrees(x[k])) for x in (states.phi_h, states.phi_g, states.phi_b))
    turns, rest = divmod(round(phi_h, 1), 360.0)
    cam = f"{turns:.0f} turn{'s' * (turns != 1)} + {rest:.1f}°"
    return f"phi_h = {cam}, phi_g = {phi_g:.3f}°, phi_b = {phi_b:.3f}°, M_g = {M_g:g} N*m"


#


@dataclass(frozen=True)
class SelfError:
    """Self error of a drive at a torque M_g [N*m].

    rotation_arcsec, shape (tooth phases, ball phases): twist of the flexspline at tau = i/phases,
    beta likewise.
    """

    M_g: float
    rotation_arcsec: Array
    certificate: Certificate

    @property
    def range_arcsec(self) -> float:
        """Greatest minus least rotation over both phases [arcsec]."""
        return float(np.ptp(self.rotation_arcsec))

    @property
    def tooth_phase_arcsec(self) -> float:
        """Range over the tooth phase alone [arcsec], the ball phase as in the first column."""
        return float(np.ptp(self.rotation_arcsec[:, 0]))

    @property
    def ball_phase_arcsec(self) -> float:
        """Range over the ball phase alone [arcsec], the tooth phase 0."""
        return float(np.ptp(self.rotation_arcsec[0]))


_SELF_ERRORS = TypeAdapter(list[tuple[list[list[float]], Certificate]])


def self_error(drive: Drive, torques: Sequence[float], *, run: Run = Run()) -> list[SelfError]:
    """Self error of a drive at torques M_g [N*m], over numerics.n_phase tooth and ball phases, kept for the next time.

    Raises UntrustedError where an answer cannot be trusted.
    """
    parts = drive.model_dump(mode="json", exclude=WITHOUT_EFFECT)
    depends = {"drive": parts, "torques": list(torques), "program": digits_depend_on()}
    found = kept_answer("self", depends, _SELF_ERRORS, partial(_self_errors, drive, torques))
    run.solved(sum(proof.states for _, proof in found))
    return [SelfError(M_g, np.array(rows), proof) for M_g, (rows, proof) in zip(torques, found, strict=True)]


def _self_errors(drive: Drive, torques: Sequence[float]) -> list[tuple[list[list[float]], Certificate]]:
    """Rotation [arcsec] over both phases at each torque, and its proof."""
    systems = ContactSystems(drive)
    grid = drive.numerics.n_phase
    rotation = np.empty((len(torques), grid, grid))
    certificates = [EMPTY] * len(torques)
    cases: dict[float, LoadCase] = {}  # one a torque: contact sets of neighbours are near, of torques they are not
    for i, k in np.ndindex(grid, grid):
        formulation = formulate(systems.at(i / grid, k / grid))
        for t, M_g in enumerate(torques):
            cases[M_g] = LoadCase(formulation, M_g, like=cases.get(M_g, cases.get(torques[0])))
            place = partial(_place, i / grid, k / grid, M_g)
            answers = cases[M_g].solve(WITHOUT_DEVIATIONS, place)
            rotation[t, i, k] = answers.rotation_arcsec[0]
            certificates[t] += answers.certificate
    return list(zip(rotation.tolist(), certificates, strict=True))


@dataclass(frozen=True)
class _LimitRooms:
    """Room that limits leave F'_ior beside the self error.

    arcsec: the room at each torque, None without a limit there.
    certificate: proof of the self error, empty without any limit.
    """

    arcsec: list[float | None]
    certificate: Certificate


def limits_left(drive: Drive, torques: Sequence[float], run: Run = Run()) -> _LimitRooms:
    """Return the room that limits of a drive leave F'_ior beside the self error at torques [N*m].

    Raises UntrustedError if a self error cannot be trusted.
    """
    limits = [drive.limit(M_g) for M_g in torques]
    own = self_error(drive, torques, run=run) if any(limits) else []
    proof = sum((each.certificate for each in own), EMPTY)
    rooms = [None if limit is None else limit - each.range_arcsec for limit, each in zip_longest(limits, own)]
    return _LimitRooms(rooms, proof)


def _place(tau: float, beta: float, M_g: float, _: int) -> str:
    return f"tau = {tau:g}, beta = {beta:g}, M_g = {M_g:g} N*m, without deviations"
