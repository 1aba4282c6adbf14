"""Positions of the fixed wheel on its seat, and F'_ior over them: the gain of turning it.

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

from hdassist.belief.holes import NO_ERROR
from hdassist.error.cycle import WITHOUT_EFFECT, KinematicError, cross_checks_of, kinematic_error, require_programme
from hdassist.error.error_map import Batch, error_maps, searchable
from hdassist.error.extremes import many_extremes
from hdassist.errors import UsageError
from hdassist.model.deviations import MeasuredTeeth, ToothDeviations, carried, tooth_phases
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.run.kept import KeptAnswer, Magnitude
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.loadcase import CrossCheck, solvers_depend_on
from hdassist.solve.walk import digits_depend_on

_FREE_STEP = 5.0  # deg between positions where the seat has no holes
LEAST_STEP = 0.01  # deg between positions: 36 000 of them


@dataclass(frozen=True)
class Position:
    """The fixed wheel turned by rotation_deg from its present position, and F'_ior [arcsec] there at each torque.

    phase_deg: direction of the fixed wheel's deviation relative to the wave generator eccentricity that is fixed to
    the housing, 0 to 360.
    hole: number of seat holes by which it is turned; None if that is not a whole number.
    """

    rotation_deg: float
    phase_deg: float
    hole: int | None
    F_ior_arcsec: tuple[float, ...]

    @property
    def short_way_deg(self) -> float:
        """The same turn by the shorter way, in -180..180: negative is clockwise."""
        return self.rotation_deg - 360 if self.rotation_deg > 180 else self.rotation_deg


@dataclass(frozen=True)
class MountingCurve:
    """F'_ior over rotations of the fixed wheel.

    torques: torques [N*m].
    rotation_deg: shape (rotations,), counter-clockwise, seen from the wave generator side, with the present position
    first.
    phase_deg: the same positions as phases.
    F_ior_arcsec: shape (torques, rotations).
    every_state: same shape; whether all states were solved, not searched.
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
        """One of the positions."""
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
        """Which positions the wheel can be mounted in, shape (rotations,)."""
        holes = [hole_of(rotation, self.holes) for rotation in self.rotation_deg.tolist()]
        free = not self.holes
        return np.array(
            [free or (hole is not None and (self.allowed is None or hole in self.allowed)) for hole in holes]
        )

    @property
    def current(self) -> Position:
        """Where the wheel stands."""
        return self.at(0)

    @property
    def recommended(self) -> Position:
        """The usable position that is best for the torque it serves worst; the first of equals."""
        return self.ranked[0]

    @property
    def ranked(self) -> list[Position]:
        """The usable positions, best first."""
        order = np.argsort(merit(self.F_ior_arcsec, self.F_ior_arcsec[:, self.usable].mean(axis=1)), kind="stable")
        return [self.at(place) for place in order[self.usable[order]].tolist()]


def merit(F_ior: Array, scale: Array) -> Array:
    """Greatest over the torques of F'_ior, shape (torques, ...), over a scale, shape (torques,); shape (...,)."""
    return np.asarray(np.max(np.moveaxis(F_ior, 0, -1) / np.maximum(scale, NO_ERROR), axis=-1))


def hole_of(rotation_deg: float, holes: int) -> int | None:
    """Holes of a seat that a turn [deg] is, None where it is no whole number of them."""
    turned = rotation_deg * holes / 360
    return round(turned) if holes and abs(turned - round(turned)) < 1e-9 else None


def hole_words(rotation_deg: float, holes: int) -> str:
    """A position in words: hole 4 (120 deg), or the angle alone."""
    hole = hole_of(rotation_deg, holes)
    return f"{rotation_deg:g}°" if hole is None else f"hole {hole} ({rotation_deg:g}°)"


def bare(rotation_deg: float, holes: int) -> str:
    """A position as a bare number: the hole, or the angle [deg] where it is none."""
    hole = hole_of(rotation_deg, holes)
    return f"{rotation_deg:g}" if hole is None else f"{hole}"


def named_position(rotation_deg: float, holes: int) -> str:
    """A position as options name it: h4, or the angle [deg] where it is no hole."""
    hole = hole_of(rotation_deg, holes)
    return f"{rotation_deg:g}" if hole is None else f"h{hole}"


def usable_positions(holes: int, allowed: Sequence[int] | str, free_step: float = _FREE_STEP) -> list[float]:
    """Turns of the fixed wheel [deg] that may be chosen: the usable holes, or steps [deg] where the angle is free."""
    if not holes:
        return [free_step * k for k in range(round(360 / free_step))]
    return [360 * k / holes for k in range(holes) if allowed == "all" or k in allowed]


def seat_positions(drive: Drive, free_step: float = _FREE_STEP) -> list[float]:
    """Turns of the fixed wheel [deg] to try: those that may be chosen, and 0, where the wheel stands."""
    return sorted({0.0, *usable_positions(drive.mounting.holes, drive.mounting.allowed, free_step)})


def rotated(drive: Drive, rotation_deg: float) -> Drive:
    """Return the drive with its fixed wheel turned on its seat.

    rotation_deg: counter-clockwise [deg], seen from the wave generator side.
    """
    return drive.with_values({path: drive.number(path) + rotation_deg for path in carried(drive)})


def phase_deg(drive: Drive, measured: MeasuredTeeth | None = None, rotation_deg: float = 0.0) -> float:
    """Return the direction of the fixed wheel's deviation relative to the housing-fixed eccentricity [deg], 0 to 360.

    For a measured fixed wheel, the direction of its mark counts. Turning the wheel turns this direction by the same
    angle.
    """
    xi_g, xi_b = np.degrees(tooth_phases(drive))
    rigid = drive.mounting.fixed == "rigid"
    if measured and (wheel := measured.fixed(drive)):
        xi_g = xi_b = wheel.mark_deg
    phase = xi_b - drive.number("phases.phi_hb") if rigid else xi_g - drive.number("phases.phi_hg")
    return float(np.mod(round(float(phase) + rotation_deg, 9), 360.0))


_SAMPLED_STATES = 1  # random states solved again at each position, besides those of the extremes
_SEARCH_TOLERANCE = 0.01  # arcsec that a search may miss where every state is solved
_POSITIONS_A_TASK = 3  # positions that one task searches
HOLES = 24  # positions of which every state is solved


def is_searched(drive: Drive, positions: int, *, drawn: bool, measured: MeasuredTeeth | None) -> bool:
    """Return whether extremes at a number of positions are searched.

    For few positions every state is solved, unless inputs are sampled too. The error of measured teeth is not
    continuous, so it cannot be searched.
    """
    return (drawn or positions > HOLES) and not measured and searchable(drive)


_CrossChecks = list[Future[list[CrossCheck]]]  # under way
_KeptCurve = tuple[
    list[list[Magnitude]], list[list[StrictBool]], Certificate, list[CrossCheck]
]  # F'_ior, every state, proofs


def _kept_curve_type(torques: int, rotations: int) -> TypeAdapter[_KeptCurve]:
    """Return the type of a stored curve for a number of torques and rotations."""

    def require_all(kept: _KeptCurve) -> _KeptCurve:
        if any([len(row) for row in rows] != [rotations] * torques for rows in kept[:2]):
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
    """The curve that `begun_curve` makes of the same arguments, with its cross-checks."""
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
    """F'_ior over the full cycle at each torque [N*m] and each rotation [deg] of the fixed wheel.

    Its cross-checks go on beside what follows: the second result waits for the curve with them, and raises
    UntrustedError where two solvers disagree. It is kept then, where the preset alone decides it. Of up to HOLES
    positions every state is solved. Of more, or where samples are drawn too, extremes are proposed by a grid of states
    and proven; where the wheel stands and at the recommended position every state is solved then, and should more than
    SEARCH_TOLERANCE have been missed there, everywhere.

    Arguments: rotations_deg, 0 first, which is where the wheel stands; measured, wheels in place of first harmonics;
    drawn, whether samples of uncertain inputs are drawn too. Raises UsageError where the present position is not the
    first, UntrustedError where an answer cannot be trusted.
    """
    if not len(rotations_deg) or rotations_deg[0] != 0:
        raise UsageError("the first rotation must be 0, the present position")
    there = [rotated(drive, rotation) for rotation in rotations_deg]
    wheels = [measured and measured.rotated(each, r) for each, r in zip(there, rotations_deg, strict=True)]
    every = np.ones((len(torques), len(rotations_deg)), dtype=bool)
    allowed = None if drive.mounting.allowed == "all" else drive.mounting.allowed
    phases = np.array([phase_deg(drive, measured, rotation) for rotation in rotations_deg])
    curve = MountingCurve(
        torques=tuple(torques),
        rotation_deg=np.array(rotations_deg, dtype=float),
        phase_deg=phases,
        F_ior_arcsec=np.empty(every.shape),
        certificate=EMPTY,
        cross_checks=(),
        every_state=every,
        holes=drive.mounting.holes,
        allowed=allowed,
    )
    searched = is_searched(drive, len(rotations_deg), drawn=drawn, measured=measured)
    known = solvers_depend_on(run.cross_check)
    parts = drive.model_dump(mode="json", exclude=WITHOUT_EFFECT)
    depends = {
        "drive": parts,
        "torques": curve.torques,
        "rotations": curve.rotation_deg.tolist(),
        "searched": searched,
        "again": [run.seed, known],
        "program": digits_depend_on(),
    }
    kept = None if measured or known is None else KeptAnswer("curve", depends, _kept_curve_type(*every.shape))
    if found := kept and kept.found():
        values, solved, proof, done = found
        run.solved(proof.states)
        curve = replace(curve, F_ior_arcsec=np.array(values), every_state=np.array(solved))
        curve = replace(curve, certificate=proof, cross_checks=tuple(done))
        return curve, lambda: curve
    require_programme(drive, run)
    compute = _searched_curve if searched else _solved
    computed, checks = compute(curve, every, there, wheels, run)

    def checked() -> MountingCurve:
        done = [check for some in checks for check in some.result()]
        if kept:
            kept.keep((computed.F_ior_arcsec.tolist(), computed.every_state.tolist(), computed.certificate, done))
        return replace(computed, cross_checks=tuple(done))

    return computed, checked


def _searched_curve(
    curve: MountingCurve,
    every: NDArray[np.bool_],
    there: Sequence[Drive],
    wheels: Sequence[MeasuredTeeth | None],
    run: Run,
) -> tuple[MountingCurve, _CrossChecks]:
    """A curve searched at all places, and solved where that decides. Arguments as those of _solved; there, 0 first."""
    rotations_deg = curve.rotation_deg.tolist()
    drive = there[0]
    groups = [rotations_deg[k : k + _POSITIONS_A_TASK] for k in range(0, len(rotations_deg), _POSITIONS_A_TASK)]
    found = []
    proof = EMPTY
    for values, states in run.map(partial(_searched, drive, curve.torques), groups):
        found.append(values)
        proof += states
        run.solved(states.states)
    curve = replace(curve, F_ior_arcsec=np.hstack(found), every_state=~every, certificate=proof)
    decisive = np.isin(rotations_deg, [0, curve.recommended.rotation_deg]) & every
    proven, checks = _solved(curve, decisive, there, wheels, run)
    if np.abs(proven.F_ior_arcsec - curve.F_ior_arcsec).max() > _SEARCH_TOLERANCE:
        proven, more = _solved(proven, ~decisive, there, wheels, run)
        checks += more
    return proven, checks


def _solved(
    curve: MountingCurve,
    places: NDArray[np.bool_],
    there: Sequence[Drive],
    wheels: Sequence[MeasuredTeeth | None],
    run: Run,
) -> tuple[MountingCurve, _CrossChecks]:
    """A curve with every state solved at some places, shape (torques, rotations); some are being solved again.

    Arguments: there, drives with the wheel turned, and their measured wheels.
    """
    rows, columns = (each.tolist() for each in np.nonzero(places))
    drives = [wheel.in_drive(there[r]) if (wheel := wheels[r]) else (there[r], None) for r in columns]
    values = curve.F_ior_arcsec.copy()
    proof = curve.certificate
    errors = list[KinematicError]()
    tasks = [(*drive, curve.torques[t], run.of_task) for drive, t in zip(drives, rows, strict=True)]
    for place, (F_ior, error) in zip(np.argwhere(places), run.map(_error, *zip(*tasks, strict=True)), strict=True):
        values[tuple(place)] = F_ior
        errors.append(error)
        proof += error.certificate
        run.solved(error.certificate.states)
    solved = [(*drive, error) for drive, error in zip(drives, errors, strict=True)]
    checks = [run.beside(cross_checks_of, solved, run.of_task)] if run.cross_check else []
    return replace(curve, F_ior_arcsec=values, every_state=curve.every_state | places, certificate=proof), checks


def _searched(drive: Drive, torques: Sequence[float], rotations: Sequence[float]) -> tuple[Array, Certificate]:
    """Return F'_ior [arcsec] of extremes that were searched and verified, shape (torques, rotations)."""
    found = [many_extremes(each, Batch.turned(drive, rotations)) for each in error_maps(drive, torques)]
    return np.array([each.F_ior_arcsec for each in found]), sum((each.certificate for each in found), EMPTY)


def _error(drive: Drive, teeth: ToothDeviations | None, M_g: float, run: Run) -> tuple[float, KinematicError]:
    """Return F'_ior [arcsec], and the error at the states for another solver, with the certificate of all states."""
    error = kinematic_error(drive, M_g, teeth=teeth, run=replace(run, progress=None, cross_check=None))
    return error.F_ior_arcsec, error.sampled(_SAMPLED_STATES, run.seed)
