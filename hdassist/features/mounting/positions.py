"""Positions of the fixed wheel on its seat, F'_ior over them, and thus the gain of turning the wheel.

Source: Lyuminarsky et al. 2019, Fig. 3, doi 10.18698/0536-1044-2019-11-3-8.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ConfigDict, StrictBool, TypeAdapter

from hdassist.belief.holes import FREE_STEP_DEG, NO_ERROR
from hdassist.drive.error.cycle import (
    WITHOUT_EFFECT,
    KinematicError,
    cross_checks_of,
    kinematic_error,
    require_programme,
)
from hdassist.drive.error.error_map import Batch, error_maps, searchable
from hdassist.drive.error.extremes import many_extremes
from hdassist.drive.model.deviations import MeasuredTeeth, ToothDeviations, carried, tooth_phases
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import Drive
from hdassist.drive.solve.answers import EMPTY, Certificate
from hdassist.drive.solve.loadcase import CrossCheck, solvers_depend_on
from hdassist.drive.solve.walk import digits_depend_on
from hdassist.run.errors import UsageError
from hdassist.run.kept import KeptAnswer, Magnitude
from hdassist.run.run import Run

LEAST_STEP = 0.01  # deg; smallest step between positions, which gives 36 000 of them


@dataclass(frozen=True)
class Position:
    """The fixed wheel turned by rotation_deg from its present position, with F'_ior at each torque [arcsec].

    phase_deg: direction of the fixed wheel's deviation relative to the wave generator eccentricity that is fixed to the
        housing, 0 to 360.
    hole: number of seat holes by which the wheel is turned; None if that is not a whole number.
    """

    rotation_deg: float
    phase_deg: float
    hole: int | None
    F_ior_arcsec: tuple[float, ...]

    @property
    def short_way_deg(self) -> float:
        """The same rotation in the shorter direction, -180 to 180; negative is clockwise."""
        return self.rotation_deg - 360 if self.rotation_deg > 180 else self.rotation_deg


@dataclass(frozen=True)
class MountingCurve:
    """F'_ior over rotations of the fixed wheel.

    torques: torques [N*m].
    rotation_deg: rotations [deg], shape (rotations,), counter-clockwise, seen from the wave generator side, with the
        present position first.
    phase_deg: the same positions as phases [deg].
    F_ior_arcsec: F'_ior [arcsec], shape (torques, rotations).
    every_state: whether all states were solved, in contrast to a search, shape (torques, rotations).
    holes: number of holes of the seat; 0 for a free angle.
    allowed: allowed hole numbers; None for all.
    """

    torques: tuple[float, ...]
    rotation_deg: Array
    phase_deg: Array
    F_ior_arcsec: Array
    certificate: Certificate
    cross_checks: tuple[CrossCheck, ...]
    every_state: NDArray[np.bool_]
    holes: int = 0
    allowed: tuple[int, ...] | None = None

    def at(self, place: int) -> Position:
        """Return one of the positions by its index."""
        values = tuple(self.F_ior_arcsec[:, place].tolist())
        rotation = float(self.rotation_deg[place])
        return Position(
            rotation_deg=rotation,
            phase_deg=float(self.phase_deg[place]),
            hole=hole_of(rotation, self.holes),
            F_ior_arcsec=values,
        )

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Whether the wheel can be mounted in each position, shape (rotations,)."""
        holes = [hole_of(rotation, self.holes) for rotation in self.rotation_deg.tolist()]
        free = not self.holes
        return np.array(
            [free or (hole is not None and (self.allowed is None or hole in self.allowed)) for hole in holes]
        )

    @property
    def current(self) -> Position:
        """Present position of the wheel."""
        return self.at(0)

    @property
    def recommended(self) -> Position:
        """The best usable position at the governing torque; the first of equal ones."""
        return self.ranked[0]

    @property
    def ranked(self) -> list[Position]:
        """The usable positions, best first."""
        order = np.argsort(merit(self.F_ior_arcsec, self.F_ior_arcsec[:, self.usable].mean(axis=1)), kind="stable")
        return [self.at(place) for place in order[self.usable[order]].tolist()]


def merit(F_ior: Array, scale: Array) -> Array:
    """Return the largest F'_ior over the torques, relative to a scale, shape (...,).

    F_ior: F'_ior, shape (torques, ...).
    scale: scale at each torque, shape (torques,).
    """
    return np.asarray(np.max(np.moveaxis(F_ior, 0, -1) / np.maximum(scale, NO_ERROR), axis=-1))


def hole_of(rotation_deg: float, holes: int) -> int | None:
    """Return the number of seat holes in a rotation [deg], None if it is not a whole number."""
    turned = rotation_deg * holes / 360
    return round(turned) if holes and abs(turned - round(turned)) < 1e-9 else None


def hole_words(rotation_deg: float, holes: int) -> str:
    """Return the name of a position in words: hole 4 (120 deg), or only the angle."""
    hole = hole_of(rotation_deg, holes)
    return f"{rotation_deg:g}°" if hole is None else f"hole {hole} ({rotation_deg:g}°)"


def bare(rotation_deg: float, holes: int) -> str:
    """Return the name of a position as a bare number: the hole, or the angle [deg] if there is no hole."""
    hole = hole_of(rotation_deg, holes)
    return f"{rotation_deg:g}" if hole is None else f"{hole}"


def named_position(rotation_deg: float, holes: int) -> str:
    """Return the name of a position as in options: h4, or the angle [deg] if there is no hole."""
    hole = hole_of(rotation_deg, holes)
    return f"{rotation_deg:g}" if hole is None else f"h{hole}"


def usable_positions(
    holes: int,
    allowed: Sequence[int] | str,
    free_step: float = FREE_STEP_DEG,
) -> list[float]:
    """Return the rotations to the usable positions [deg]: the usable holes, or equal steps if the angle is free."""
    if not holes:
        return [free_step * k for k in range(round(360 / free_step))]
    return [360 * k / holes for k in range(holes) if allowed == "all" or k in allowed]


def seat_positions(drive: Drive, free_step: float = FREE_STEP_DEG) -> list[float]:
    """Return the rotations to try [deg]: those to the usable positions, and 0, the present position."""
    return sorted({0.0, *usable_positions(drive.mounting.holes, drive.mounting.allowed, free_step)})


def rotated(drive: Drive, rotation_deg: float) -> Drive:
    """Return the drive with its fixed wheel turned on its seat.

    rotation_deg: rotation [deg], counter-clockwise seen from the wave generator side.
    """
    return drive.with_values({path: drive.number(path) + rotation_deg for path in carried(drive)})


def phase_deg(
    drive: Drive,
    measured: MeasuredTeeth | None = None,
    rotation_deg: float = 0.0,
) -> float:
    """Return the direction of the fixed wheel's deviation relative to the housing-fixed eccentricity [deg], 0 to 360.

    For a measured fixed wheel, the direction of its mark counts. A rotation of the wheel changes the direction by the
    same angle.
    """
    xi_g, xi_b = np.degrees(tooth_phases(drive))
    rigid = drive.mounting.fixed == "rigid"
    if measured and (wheel := measured.fixed(drive)):
        xi_g = xi_b = wheel.mark_deg
    phase = xi_b - drive.number("phases.phi_hb") if rigid else xi_g - drive.number("phases.phi_hg")
    return float(np.mod(round(float(phase) + rotation_deg, 9), 360.0))


_SAMPLED_STATES = 1  # random states solved again at each position, in addition to the extremes
_SEARCH_TOLERANCE = 0.01  # arcsec; largest error of a search before every state is solved
_POSITIONS_A_TASK = 3  # number of positions searched by one task
HOLES = 24  # largest number of positions at which every state is solved


def is_searched(
    drive: Drive,
    positions: int,
    *,
    drawn: bool,
    measured: MeasuredTeeth | None,
) -> bool:
    """Return whether extremes at a number of positions are found by search.

    For a few positions every state is solved, unless inputs are sampled as well. The error of measured teeth is not
    continuous, so it cannot be searched.
    """
    return (drawn or positions > HOLES) and not measured and searchable(drive)


_CrossChecks = list[Future[list[CrossCheck]]]  # cross-checks in progress
_KeptCurve = tuple[
    list[list[Magnitude]], list[list[StrictBool]], Certificate, list[CrossCheck]
]  # F'_ior, whether every state was solved, certificate and cross-checks


def _kept_curve_type(torques: int, rotations: int) -> TypeAdapter[_KeptCurve]:
    """Return the type of a stored curve for a number of torques and rotations."""

    def require_all(kept: _KeptCurve) -> _KeptCurve:
        for rows in kept[:2]:
            if len(rows) != torques or any(len(row) != rotations for row in rows):
                raise ValueError(f"expected {torques} times {rotations} values")
        return kept

    return TypeAdapter(Annotated[_KeptCurve, AfterValidator(require_all)], config=ConfigDict(allow_inf_nan=False))


def mounting_curve(
    drive: Drive,
    torques: Sequence[float],
    rotations_deg: Sequence[float],
    *,
    measured: MeasuredTeeth | None = None,
    drawn: bool = False,
    run: Run = Run(),
) -> MountingCurve:
    """Return the curve of `begun_curve` for the same arguments, with its cross-checks."""
    return begun_curve(drive, torques, rotations_deg, measured=measured, drawn=drawn, run=run)[1]()


def begun_curve(
    drive: Drive,
    torques: Sequence[float],
    rotations_deg: Sequence[float],
    *,
    measured: MeasuredTeeth | None = None,
    drawn: bool = False,
    run: Run = Run(),
) -> tuple[MountingCurve, Callable[[], MountingCurve]]:
    """Return F'_ior over the full cycle at each torque and each rotation of the fixed wheel, before its cross-checks.

    The cross-checks run in parallel with later work. The second result is a function that waits for them, returns the
    curve with them and stores it if the preset alone determines it. The function raises UntrustedError if two solvers
    disagree.

    Every state is solved for up to HOLES positions. For more positions, or if samples are drawn as well, a grid of
    states proposes extremes, which are verified. Every state is then solved at the present and at the recommended
    position, and everywhere if the search was wrong there by more than _SEARCH_TOLERANCE.

    torques: torques [N*m].
    rotations_deg: rotations [deg], starting with 0, the present position.
    measured: measured wheels that replace first harmonics.
    drawn: whether uncertain inputs are sampled as well.

    Raises UsageError if the present position is not the first, UntrustedError if a result cannot be trusted.
    """
    if not len(rotations_deg) or rotations_deg[0] != 0:
        raise UsageError("the first rotation must be 0, which is the present position", "start the list with 0")
    drives = [rotated(drive, rotation) for rotation in rotations_deg]
    wheels = [
        measured and measured.rotated(turned, rotation) for turned, rotation in zip(drives, rotations_deg, strict=True)
    ]
    all_places = np.ones((len(torques), len(rotations_deg)), dtype=bool)
    curve = MountingCurve(
        torques=tuple(torques),
        rotation_deg=np.array(rotations_deg, dtype=float),
        phase_deg=np.array([phase_deg(drive, measured, rotation) for rotation in rotations_deg]),
        F_ior_arcsec=np.empty(all_places.shape),
        certificate=EMPTY,
        cross_checks=(),
        every_state=all_places,
        holes=drive.mounting.holes,
        allowed=None if drive.mounting.allowed == "all" else drive.mounting.allowed,
    )
    searched = is_searched(
        drive,
        len(rotations_deg),
        drawn=drawn,
        measured=measured,
    )
    kept_answer = None if measured else _kept_curve_of(drive, curve, searched, run)
    kept = kept_answer.found() if kept_answer else None
    if kept:
        values, solved, certificate, cross_checks = kept
        run.solved(certificate.states)
        kept_curve = replace(
            curve,
            F_ior_arcsec=np.array(values),
            every_state=np.array(solved),
            certificate=certificate,
            cross_checks=tuple(cross_checks),
        )
        return kept_curve, lambda: kept_curve
    require_programme(drive, run)
    compute = _searched_curve if searched else _solved
    computed, pending_checks = compute(curve, all_places, drives, wheels, run)

    def checked() -> MountingCurve:
        cross_checks = [check for pending in pending_checks for check in pending.result()]
        if kept_answer:
            values = computed.F_ior_arcsec.tolist()
            kept_answer.keep((values, computed.every_state.tolist(), computed.certificate, cross_checks))
        return replace(computed, cross_checks=tuple(cross_checks))

    return computed, checked


def _kept_curve_of(
    drive: Drive,
    curve: MountingCurve,
    searched: bool,
    run: Run,
) -> KeptAnswer[_KeptCurve] | None:
    """Return the cache entry of a curve, None if the version of its cross-check solver is unknown."""
    solver_versions = solvers_depend_on(run.cross_check)
    if solver_versions is None:
        return None
    depends = {
        "drive": drive.model_dump(mode="json", exclude=WITHOUT_EFFECT),
        "torques": curve.torques,
        "rotations": curve.rotation_deg.tolist(),
        "searched": searched,
        "again": [run.seed, solver_versions],
        "program": digits_depend_on(),
    }
    return KeptAnswer("curve", depends, _kept_curve_type(*curve.every_state.shape))


def _searched_curve(
    curve: MountingCurve,
    all_places: NDArray[np.bool_],
    drives: Sequence[Drive],
    wheels: Sequence[MeasuredTeeth | None],
    run: Run,
) -> tuple[MountingCurve, _CrossChecks]:
    """Return a curve found by search in all positions, with every state solved in those that decide.

    The arguments are those of `_solved`; the first drive is not turned.
    """
    rotations_deg = curve.rotation_deg.tolist()
    drive = drives[0]
    groups = [rotations_deg[k : k + _POSITIONS_A_TASK] for k in range(0, len(rotations_deg), _POSITIONS_A_TASK)]
    F_ior = []
    certificate = EMPTY
    for values, proof in run.map(partial(_searched, drive, curve.torques), groups):
        F_ior.append(values)
        certificate += proof
        run.solved(proof.states)
    curve = replace(
        curve,
        F_ior_arcsec=np.hstack(F_ior),
        every_state=~all_places,
        certificate=certificate,
    )
    decisive = np.isin(rotations_deg, [0, curve.recommended.rotation_deg]) & all_places
    proven, checks = _solved(curve, decisive, drives, wheels, run)
    if np.abs(proven.F_ior_arcsec - curve.F_ior_arcsec).max() > _SEARCH_TOLERANCE:
        proven, further_checks = _solved(proven, ~decisive, drives, wheels, run)
        checks += further_checks
    return proven, checks


def _solved(
    curve: MountingCurve,
    places: NDArray[np.bool_],
    drives: Sequence[Drive],
    wheels: Sequence[MeasuredTeeth | None],
    run: Run,
) -> tuple[MountingCurve, _CrossChecks]:
    """Return a curve with every state solved in some positions, and pending cross-checks of some states.

    Args:
        curve: curve whose other values do not change.
        places: whether each position is solved, shape (torques, rotations).
        drives: drives with the wheel turned, by rotation.
        wheels: measured wheels of these drives.
        run: processes and progress.
    """
    rows, columns = (index.tolist() for index in np.nonzero(places))
    solved_drives = [wheel.in_drive(drives[r]) if (wheel := wheels[r]) else (drives[r], None) for r in columns]
    values = curve.F_ior_arcsec.copy()
    proof = curve.certificate
    errors = list[KinematicError]()
    tasks = [(*drive, curve.torques[t], run.of_task) for drive, t in zip(solved_drives, rows, strict=True)]
    for place, (F_ior, error) in zip(np.argwhere(places), run.map(_error, *zip(*tasks, strict=True)), strict=True):
        values[tuple(place)] = F_ior
        errors.append(error)
        proof += error.certificate
        run.solved(error.certificate.states)
    solved = [(*drive, error) for drive, error in zip(solved_drives, errors, strict=True)]
    checks = [run.beside(cross_checks_of, solved, run.of_task)] if run.cross_check else []
    return replace(curve, F_ior_arcsec=values, every_state=curve.every_state | places, certificate=proof), checks


def _searched(
    drive: Drive,
    torques: Sequence[float],
    rotations: Sequence[float],
) -> tuple[Array, Certificate]:
    """Return F'_ior [arcsec] from extremes found by search, shape (torques, rotations), with their certificate."""
    extremes = [many_extremes(error_map, Batch.turned(drive, rotations)) for error_map in error_maps(drive, torques)]
    F_ior = np.array([of_torque.F_ior_arcsec for of_torque in extremes])
    return F_ior, sum((of_torque.certificate for of_torque in extremes), EMPTY)


def _error(
    drive: Drive,
    teeth: ToothDeviations | None,
    M_g: float,
    run: Run,
) -> tuple[float, KinematicError]:
    """Return F'_ior [arcsec], and the error in the states for the cross-check, with the certificate of all states."""
    error = kinematic_error(
        drive,
        M_g,
        teeth=teeth,
        run=replace(run, progress=None, cross_check=None),
    )
    return error.F_ior_arcsec, error.sampled(_SAMPLED_STATES, run.seed)
