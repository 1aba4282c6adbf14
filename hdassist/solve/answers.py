"""Solve many states, prove each answer, and keep what the analyses ask for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np

from hdassist.errors import Fault, UntrustedError
from hdassist.model.contacts import ContactSystem
from hdassist.model.geometry import Array
from hdassist.solve.certificate import TOLERANCE, Residuals, residuals
from hdassist.solve.window import EdgeOfWindowError

CHUNK = 256  # states whose forces are held at once: in the cache
EDGE_SHARE = 1e-6  # of the tangential force M_g/r_m: less at the edge of the window is no contact
ARCSEC = float(np.degrees(3600))  # arcsec in a radian
N_MM = 1e3  # N*mm in a N*m

Progress = Callable[[int], None]


class StateSolver(Protocol):
    """Anything that solves states of one contact system at one torque."""

    def load(self, torque: float) -> None:
        """Go on with another torque [N*mm]."""
        ...

    def solve(self, delta_p: Array) -> tuple[Array, Array, int]:
        """Forces [N] (states, M), displacements of the free freedoms [mm, rad] (states, free), fallbacks.

        Arguments: delta_p, gaps without force [mm], shape (states, M). Fallbacks counts the states that the
        first way gave up. A state that nothing solves has an answer without proof, or NaN; states behind it are not
        tried, and NaN.
        """
        ...


@dataclass(frozen=True)
class Certificate:
    """Worst residuals over states, each a share of its scale, and how many states stood behind them.

    fallbacks: states that the warm solver gave up and another way solved.
    """

    states: int
    negative_force: float
    negative_gap: float
    complementarity: float
    equilibrium: float
    fallbacks: int

    @property
    def max_residual(self) -> float:
        """Greatest of the four residuals."""
        return max(self.negative_force, self.negative_gap, self.complementarity, self.equilibrium)

    def __str__(self) -> str:
        residuals = ", ".join(f"{f.name.replace('_', ' ')} {getattr(self, f.name):.1e}" for f in fields(Residuals))
        return f"{self.states} states, worst residuals: {residuals}; {self.fallbacks} fallbacks"

    def __add__(self, other: Certificate) -> Certificate:
        worst = {f.name: max(getattr(self, f.name), getattr(other, f.name)) for f in fields(Residuals)}
        return Certificate(self.states + other.states, fallbacks=self.fallbacks + other.fallbacks, **worst)


EMPTY = Certificate(0, 0.0, 0.0, 0.0, 0.0, 0)


@dataclass(frozen=True)
class Answers:
    """What is kept of solved states, shape (states,) unless said otherwise.

    rotation_arcsec: of the flexspline against the rigid wheel; zone_share: share of the torque that each mesh zone
    takes, shape (states, 2); tooth_force_N: greatest force on a flank; pull_N: forces along the scalars of the
    deviations, shape (states, scalars). As the energy has one second derivative, the pull grows with the torque as the
    rotation grows with the scalars.
    """

    rotation_arcsec: Array
    zone_share: Array
    tooth_force_N: Array
    pull_N: Array
    certificate: Certificate


def solve_states(
    system: ContactSystem,
    solver: StateSolver,
    torque: float,
    delta_p: Array,
    place: Callable[[int], str],
    progress: Progress | None = None,
    chunk: int = CHUNK,
) -> Answers:
    """Solve states of one contact system and prove each answer.

    Arguments: torque [N*mm]; delta_p, gaps without force [mm], shape (states, M); place, words for where
    state k is, for errors; progress, told how many states were solved since the last call; chunk, states whose forces
    are held at once.
    Raises UntrustedError where a state is not solved, its residuals are above TOLERANCE, or the answer is
    outside the limits of the linear model.
    """
    count = len(delta_p)
    rotation, force = np.empty(count), np.empty(count)
    moment, pull = np.empty((count, 2)), np.empty((count, system.deviation_map.shape[1]))
    certificate = EMPTY
    for first in range(0, count, chunk):
        part = slice(first, min(first + chunk, count))
        forces, free, fallbacks = solver.solve(delta_p[part])
        proof = residuals(system, delta_p[part], torque, forces, free)
        _require_proof(proof, place, first)
        rotation[part] = free[:, system.free_rotation]
        flank = system.on_flanks(forces)
        _require_linear(system, torque, rotation[part], flank, place, first)
        tangential = forces[:, : system.n_flanks] * system.lever
        moment[part] = np.stack([tangential[:, system.flanks.zone == z].sum(axis=1) for z in (0, 1)], axis=1)
        force[part] = flank.max(axis=1)
        pull[part] = forces @ system.deviation_map
        worst = {f.name: float(getattr(proof, f.name).max()) for f in fields(Residuals)}
        certificate += Certificate(len(forces), fallbacks=fallbacks, **worst)
        if progress:
            progress(len(forces))
    return Answers(rotation * ARCSEC, moment / torque, force, pull, certificate)


def _require_proof(proof: Residuals, place: Callable[[int], str], first: int) -> None:
    worst = proof.worst
    k = int(np.argmin(worst <= TOLERANCE))  # the first one that is not solved, if any
    if not worst[k] <= TOLERANCE:
        residual = f"residual {worst[k]:.1e} of its scale, {TOLERANCE:.0e} allowed"
        raise UntrustedError(
            f"state not solved at {place(first + k)}: {residual if np.isfinite(worst[k]) else 'no method ends'}",
            "try another solver (--solver clarabel), or a torque and stiffnesses nearer to a real drive",
            Fault.UNTRUSTED_STATE,
        )


def _require_linear(
    system: ContactSystem,
    torque: float,
    rotation: Array,
    flank: Array,
    place: Callable[[int], str],
    first: int,
) -> None:
    quarter_pitch = np.pi / 2 / system.geometry.flexspline.z
    k = int(np.argmax(np.abs(rotation)))
    if abs(rotation[k]) > quarter_pitch:
        raise UntrustedError(
            f"outside the limits of the linear model at {place(first + k)}: wind-up of "
            f"{abs(rotation[k]) * ARCSEC:.0f} arcsec, above a quarter of a tooth pitch "
            f"({quarter_pitch * ARCSEC:.0f} arcsec)",
            "the torque is too great for this drive",
            Fault.BEYOND_MODEL,
        )
    at_edge = flank[:, system.flanks.edge[:: len(system.face.fall)]].max(axis=1, initial=0.0)
    k = int(np.argmax(at_edge))
    if at_edge[k] > EDGE_SHARE * abs(torque) / system.geometry.r_m:
        raise EdgeOfWindowError(
            f"outside the limits of the linear model at {place(first + k)}: {at_edge[k]:.3g} N on the outermost "
            "tooth of the flank window",
            "widen numerics.window, like --set numerics.window=60, or lower the torque",
        )
