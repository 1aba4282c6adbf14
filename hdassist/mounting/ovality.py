"""What an ovality that nobody has measured could do to the advice.

First harmonics nearly cancel on the two mesh zones, second ones do not: a few micrometres weigh as much as a whole
first harmonic. To first order a second harmonic turns the output by a_2/r sin(2 psi), psi its direction in the cam's
frame; that tells the worst direction, and searches tell what it does there.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from hdassist.error.search import CycleSearch, searchable
from hdassist.error.table import turns
from hdassist.model.deviations import deviation_scalars
from hdassist.model.geometry import Array
from hdassist.mounting.positions import MountingCurve, Position, merit, rotated
from hdassist.preset.fields import Drive
from hdassist.solve.answers import ARCSEC, EMPTY, Certificate, Progress
from hdassist.solve.loadcase import LoadCase

SHARE = 0.08  # of half of F'_i: 3 um of 37.5; assumed where nothing is known
TAKEN = 0.98  # of a_2/r, of which the output turns (0.97 to 0.99 seen)
DIRECTIONS = 12  # over half a turn


@dataclass(frozen=True)
class Ovality:
    """An ovality of the fixed wheel that the preset does not give, assumed as amplitude_um.

    field: where the preset would give it; without: worst over best position as computed, for each torque; low, high:
    the same over all directions of the ovality, to first order; worst_deg: the direction that costs the advice most;
    loss: share by which the advised position is above the best one there, searched, for the torque served worst.
    """

    field: str
    amplitude_um: float
    without: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    worst_deg: float
    loss: float
    certificate: Certificate


def unknown_ovality(
    drive: Drive,
    curve: MountingCurve,
    chosen: Position,
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Ovality | None:
    """What an unknown ovality of the fixed wheel could do to the position chosen from a curve.

    None where the preset gives the ovality, or the wheel has no deviation that it could be a share of. Executor and
    progress as in mounting_curve. Raises UntrustedError where an answer cannot be trusted.
    """
    rigid = drive.mounting.fixed == "rigid"
    name, whole = ("b", drive.tolerances.F_i2) if rigid else ("g", drive.tolerances.F_i1)
    size, direction = f"harmonics.a_{name}2", f"harmonics.xi_{name}2"
    if drive.value(size) is not None or not whole or not searchable(drive):
        return None
    amplitude = SHARE * whole / 2
    places = [int(place) for place in np.flatnonzero(curve.usable)]
    rotations = [float(curve.rotation_deg[place]) for place in places]
    run = executor.map if executor else map
    solved = list(run(_grid, [(drive, M_g, rotations) for M_g in curve.torques]))
    now = np.array([rotation[0] for rotation, _ in solved])
    grids = np.array([rotation[1:] for rotation, _ in solved])  # torques, positions, states

    directions = 180 / DIRECTIONS * np.arange(DIRECTIONS)
    found, present = [], []
    for at in directions:
        wave = np.array([_turning(drive, amplitude, at + rotation) for rotation in (0.0, *rotations)])
        present.append(np.ptp(now + wave[0], axis=-1))
        found.append(np.ptp(grids + wave[1:], axis=-1))
    ratios = np.array([F_ior.max(axis=1) / F_ior.min(axis=1) for F_ior in found])
    merits = np.array([merit(F_ior, here, curve.weights) for F_ior, here in zip(found, present, strict=True)])
    advised = rotations.index(chosen.rotation_deg)
    worst = int(np.argmax(merits[:, advised] / merits.min(axis=1)))
    rivals = np.argsort(merits[worst], kind="stable")[:2]
    cases = [rotated(drive.with_values({size: amplitude, direction: float(directions[worst])}), r)
             for r in (0.0, chosen.rotation_deg, *(rotations[k] for k in rivals))]  # fmt: skip
    searched = list(run(_searched, [(cases, M_g) for M_g in curve.torques]))
    values = np.array([F_ior for F_ior, _ in searched])
    exact = merit(values[:, 1:], values[:, 0], curve.weights)
    proof = sum((part for _, part in (*solved, *searched)), EMPTY)
    if progress:
        progress(proof.states)
    usable = curve.F_ior_arcsec[:, places]
    return Ovality(
        field=size,
        amplitude_um=amplitude,
        without=tuple(map(float, usable.max(axis=1) / usable.min(axis=1))),
        low=tuple(map(float, ratios.min(axis=0))),
        high=tuple(map(float, ratios.max(axis=0))),
        worst_deg=float(directions[worst]),
        loss=float(exact[0] / exact.min() - 1),
        certificate=proof,
    )


def _turning(drive: Drive, amplitude_um: float, direction_deg: float) -> Array:
    """What an ovality of the fixed wheel adds to the rotation at turns(), to first order [arcsec], shape (states,)."""
    alpha_g, alpha_b = turns()
    rigid = drive.mounting.fixed == "rigid"
    psi = np.radians(direction_deg) + (alpha_b if rigid else alpha_g)
    radius = drive.gears.m * drive.gears.z_g / 2 + drive.gears.m * drive.gears.x_g
    sign = 1 if rigid else -1
    return np.asarray(sign * TAKEN * amplitude_um * 1e-3 / radius * np.sin(2 * psi) * ARCSEC)


def _grid(task: tuple[Drive, float, Sequence[float]]) -> tuple[Array, Certificate]:
    """Rotation at turns() [arcsec] at the present position and some others, shape (1 + positions, states)."""
    drive, M_g, rotations = task
    case, found, proof = LoadCase.of(drive, M_g), [], EMPTY

    def where(k: int) -> str:
        alpha_g, alpha_b = (float(np.degrees(angle[k])) for angle in turns())
        return f"alpha_g = {alpha_g:.2f} deg, alpha_b = {alpha_b:.2f} deg, M_g = {M_g:g} N*m"

    for rotation in (0.0, *rotations):
        answers = case.solve(case.system.gaps(deviation_scalars(rotated(drive, rotation), *turns())), where)
        found.append(answers.rotation_arcsec)
        proof += answers.certificate
    return np.array(found), proof


def _searched(task: tuple[Sequence[Drive], float]) -> tuple[list[float], Certificate]:
    drives, M_g = task
    search = CycleSearch(drives[0], M_g)
    found = [search.extremes(drive) for drive in drives]
    return [f.F_ior_arcsec for f in found], sum((f.certificate for f in found), EMPTY)
