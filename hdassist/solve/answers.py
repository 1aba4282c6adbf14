"""What an answer is, and its proof: residuals of system (1) from D, G, C and the gaps; sums over the contacts.

Sums are all that analyses ask for but the forces themselves. States are solved chunk by chunk, and each chunk is proven
before the next one is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from hdassist.errors import Fault, UntrustedError
from hdassist.model.contacts import ROTATION, ContactSystem
from hdassist.model.geometry import Array
from hdassist.run.kept import ClosedRecord, Count
from hdassist.run.run import Progress
from hdassist.solve.formulation import Formulation, Springs

TOLERANCE = 1e-8  # largest residual of a verified state, as a share of its scale
Residual = Annotated[float, Field(strict=True, ge=0, le=TOLERANCE)]  # of a proven answer, in a file


@dataclass(frozen=True)
class Residuals:
    """Residuals of system (1) of states, as shares of their scales.

    Columns: negative force, of the largest force; negative gap, of the largest gap without force; complementarity, of
    the product of both; equilibrium, of the sum of the absolute forces (and moments).
    """

    shares: Array  # shape (states, 4)

    @property
    def worst(self) -> Array:
        """Largest residual of each state, infinite if one is not a number, shape (states,)."""
        worst = self.shares.max(axis=1)
        return np.where(np.isnan(worst), np.inf, worst)


def displacements(
    system: ContactSystem,
    forces: Array,
    free: Array,
) -> Array:
    """Return the displacements a [mm, rad], shape (states, 9).

    Args:
        system: its supports.
        forces: [N], shape (states, M); they give the displacements of supported freedoms.
        free: displacements of the freedoms without support [mm, rad], shape (states, free).
    """
    # a_s = C_s^-1 G_s' F for freedoms with a support, first line of (1); the others are unknowns of their own
    a = np.empty((len(forces), len(system.C)))
    supported = system.supported
    a[:, supported] = forces @ system.G[:, supported] / system.C[supported]
    a[:, ~supported] = free
    return a


def residuals(
    system: ContactSystem,
    delta_p: Array,
    torque: float | Array,
    forces: Array,
    free: Array,
) -> Residuals:
    """Return the residuals of answers to system (1).

    Args:
        system: the contact system.
        delta_p: gaps without force [mm], shape (states, M).
        torque: [N*mm], of all states or of each.
        forces: [N], shape (states, M).
        free: displacements of the freedoms without support [mm, rad], shape (states, free).
    """
    a = displacements(system, forces, free)
    # both products by places: candidates at one place have equal rows
    place_gaps = system.at_places(forces) @ system.compliance + a @ system.G[system.first].T
    gaps = delta_p + forces * system.local + place_gaps[:, system.place]  # delta = delta_p + D F + G a
    # shares of the state's own largest force and gap; tiny avoids 0/0 in a state without force
    force_scale = np.maximum(np.abs(forces).max(axis=1), np.finfo(float).tiny)
    gap_scale = np.maximum(np.abs(delta_p).max(axis=1), np.finfo(float).tiny)
    negative_force = np.maximum(-forces.min(axis=1), 0)
    negative_gap = np.maximum(-gaps.min(axis=1), 0)
    # the four conditions of (1): F >= 0, delta >= 0, delta_j F_j = 0, equilibrium
    shares = [
        negative_force / force_scale,
        negative_gap / gap_scale,
        np.abs(gaps * forces).max(axis=1) / (force_scale * gap_scale),
        _unbalanced_share(system, torque, forces, a),
    ]
    return Residuals(np.stack(shares, axis=1))


def _unbalanced_share(
    system: ContactSystem,
    torque: float | Array,
    forces: Array,
    a: Array,
) -> Array:
    """Return the residual of G' F - C a + b = 0 as a share of the sum of the absolute forces, shape (states,).

    Args:
        system: the contact system.
        torque: [N*mm], of all states or of each.
        forces: [N], shape (states, M).
        a: displacements [mm, rad], shape (states, 9).
    """
    # G' F - C a + b, shape (states, 9); supported freedoms are 0 by construction of a
    balance = forces @ system.G - a * system.C
    balance[:, ROTATION] += torque
    # the sum of absolute forces: equal and opposite forces must not hide an imbalance
    scale = np.abs(forces) @ np.abs(system.G)
    scale[:, ROTATION] += np.abs(torque)
    rounding = np.finfo(float).eps * np.abs(forces).sum(axis=1)[:, None] * np.abs(system.G).max(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        # A freedom without force is in balance within rounding: a ball on one axis pushes along the other by rounding.
        share = np.where(np.abs(balance) <= rounding, 0.0, np.abs(balance) / scale)
    return np.asarray(share.max(axis=1))


# --- sums over the contacts


@dataclass(frozen=True)
class StateSums:
    """Sums over the contacts of states, NaN in a state that was given up."""

    rotation: Array  # of the flexspline [rad], shape (states,)
    moment: Array  # of each mesh zone [N*mm], shape (states, 2)
    tooth_force: Array  # largest on a flank [N], shape (states,)
    residuals: Residuals
    # of the rotation by the deviation scalars at constant contacts [rad/mm], shape (states, scalars), None if not
    # wanted
    slope: Array | None
    given_up: int  # states that the first method gave up

    @classmethod
    def of(
        cls,
        system: ContactSystem,
        delta_p: Array,
        torque: float | Array,
        forces: Array,
        free: Array,
        given_up: int = 0,
        *,
        slope: Array | None = None,
    ) -> StateSums:
        """Return the sums of states.

        Args:
            system: the contact system.
            delta_p: gaps without force [mm], shape (states, M).
            torque: [N*mm], of all states or of each.
            forces: [N], shape (states, M).
            free: displacements of the freedoms without support [mm, rad], shape (states, free).
            given_up: number of states that the first method gave up.
            slope: slopes of the rotation by the deviation scalars [rad/mm], shape (states, scalars).
        """
        flank_forces = system.at_places(forces)[:, : system.pairs]
        return cls(
            rotation=free[:, system.free_rotation],
            moment=flank_forces @ system.lever,
            tooth_force=flank_forces.max(axis=1),
            residuals=residuals(system, delta_p, torque, forces, free),
            slope=slope,
            given_up=given_up,
        )

    def put(self, rows: NDArray[np.int64], sums: StateSums) -> None:
        """Replace the sums in some rows by those of other states."""
        self.rotation[rows] = sums.rotation
        self.moment[rows] = sums.moment
        self.tooth_force[rows] = sums.tooth_force
        self.residuals.shares[rows] = sums.residuals.shares
        if self.slope is not None:
            self.slope[rows] = sums.slope


def rotation_slopes(
    formulation: Formulation,
    forces: Array,
    scalars: int,
) -> Array:
    """Return the slope of the rotation by deviation scalars at constant contacts [rad/mm], shape (states, scalars).

    Equation (9a). The slopes are NaN if the contacts do not hold the parts.

    Args:
        formulation: the programme.
        forces: [N]; candidates with a force are in contact, shape (states, M).
        scalars: number of deviation scalars, the first ones.
    """
    system = formulation.system
    units = formulation.units
    m = len(formulation.H)
    change = system.deviation_map[system.first, :scalars]
    rotation = m + system.free_rotation
    slopes = np.full((len(forces), scalars), np.nan)
    # each state has its own contact set, so each has its own matrix
    for k, contact in enumerate(forces > 0):
        # only the compliance is wanted, not the gaps
        springs = Springs.of(formulation, np.zeros(len(contact)), contact)
        inside = np.append(np.flatnonzero(springs.series), np.arange(m, len(formulation.structure)))
        series = np.append(springs.series, np.zeros(len(units.load)))[inside]
        matrix = formulation.structure[np.ix_(inside, inside)] + np.diag(series)
        # at a contact set that does not hold the parts there is no slope: NaN remains
        with suppress(np.linalg.LinAlgError):
            # adjoint method: one solution gives the derivative by all deviations, equation (9a)
            adjoint = np.linalg.solve(matrix, (inside == rotation).astype(float))
            slopes[k] = -adjoint[inside < m] @ change[inside[inside < m]]
    return np.asarray(slopes / units.load[system.free_rotation])


# --- proven answers


STATES_AT_A_TIME = 1024  # states between two reports of progress
ARCSEC = float(np.degrees(3600))  # arcsec in a radian
N_MM = 1e3  # N*mm in a N*m


@dataclass(frozen=True)
class Certificate(ClosedRecord):
    """Largest residuals over a number of states, as shares of their scales."""

    states: Count
    negative_force: Residual
    negative_gap: Residual
    complementarity: Residual
    equilibrium: Residual
    fallbacks: Count  # states that the first method gave up and another one solved

    @property
    def max_residual(self) -> float:
        """Largest of the four residuals."""
        return max(self.negative_force, self.negative_gap, self.complementarity, self.equilibrium)

    def __add__(self, other: Certificate) -> Certificate:
        return Certificate(
            states=self.states + other.states,
            negative_force=max(self.negative_force, other.negative_force),
            negative_gap=max(self.negative_gap, other.negative_gap),
            complementarity=max(self.complementarity, other.complementarity),
            equilibrium=max(self.equilibrium, other.equilibrium),
            fallbacks=self.fallbacks + other.fallbacks,
        )


EMPTY = Certificate(
    states=0,
    negative_force=0.0,
    negative_gap=0.0,
    complementarity=0.0,
    equilibrium=0.0,
    fallbacks=0,
)


@dataclass(frozen=True)
class Answers:
    """Results of solved states with their certificate."""

    rotation_arcsec: Array  # of the flexspline against the rigid wheel, shape (states,)
    zone_share: Array  # share of the torque on each mesh zone, shape (states, 2)
    tooth_force_N: Array  # largest force on a flank, shape (states,)
    # of the rotation by the deviation scalars at constant contacts, shape (states, scalars), None if not wanted
    slope_arcsec_per_mm: Array | None
    certificate: Certificate


def proven_answers(
    system: ContactSystem,
    torque: float | Array,
    chunks: Iterable[StateSums],
    place: Callable[[int], str],
    progress: Progress | None = None,
) -> Answers:
    """Return the answers of states that are solved chunk by chunk; each chunk is proven before the next one is solved.

    Args:
        system: the contact system.
        torque: [N*mm], of all states or of each.
        chunks: sums of the states.
        place: returns the words that say where state k is, for errors.
        progress: called with the number of states of each chunk.

    Raises UntrustedError if a state is not solved, its residuals are above TOLERANCE, or the rotation is outside the
    limits of the linear model.
    """
    parts: list[StateSums] = []
    certificate = EMPTY
    # a chunk that fails stops the work at once: later chunks would be computed for nothing
    for sums in chunks:
        _require_proof(sums.residuals, place, certificate.states)
        _require_linear(system, sums.rotation, place, certificate.states)
        force, gap, product, balance = sums.residuals.shares.max(axis=0).tolist()
        certificate += Certificate(
            states=len(sums.rotation),
            negative_force=force,
            negative_gap=gap,
            complementarity=product,
            equilibrium=balance,
            fallbacks=sums.given_up,
        )
        parts.append(sums)
        if progress:
            progress(len(sums.rotation))
    slopes = [part.slope for part in parts if part.slope is not None]
    return Answers(
        rotation_arcsec=_joined(part.rotation for part in parts) * ARCSEC,
        # moments of both zones add up to the torque
        zone_share=_joined(part.moment for part in parts).reshape(-1, 2) / np.reshape(torque, (-1, 1)),
        tooth_force_N=_joined(part.tooth_force for part in parts),
        slope_arcsec_per_mm=_joined(slopes) * ARCSEC if slopes else None,
        certificate=certificate,
    )


def _joined(parts: Iterable[Array]) -> Array:
    arrays = list(parts)
    return np.concatenate(arrays) if arrays else np.empty(0)


def _require_proof(
    proof: Residuals,
    place: Callable[[int], str],
    first: int,
) -> None:
    worst = proof.worst
    # NaN compares as not solved
    k = int(np.argmin(worst <= TOLERANCE))  # the first one that is not solved, if any
    if not worst[k] <= TOLERANCE:
        reason = "no method converges"
        if np.isfinite(worst[k]):
            reason = f"residual {worst[k]:.1e} of its scale, {TOLERANCE:.0e} allowed"
        raise UntrustedError(
            f"mesh position not solved at {place(first + k)}: {reason}",
            "use another solver (--solver clarabel), or a torque and stiffnesses closer to a real drive",
            Fault.UNTRUSTED_STATE,
        )


def _require_linear(
    system: ContactSystem,
    rotation: Array,
    place: Callable[[int], str],
    first: int,
) -> None:
    # the gaps are linear in the rotation for small angles only; beyond a quarter of a pitch other flanks would meet
    quarter_pitch = np.pi / 2 / system.geometry.flexspline.z
    k = int(np.argmax(np.abs(rotation)))
    if abs(rotation[k]) > quarter_pitch:
        raise UntrustedError(
            f"wind-up of {abs(rotation[k]) * ARCSEC:.0f}″ exceeds a quarter of a tooth pitch "
            f"({quarter_pitch * ARCSEC:.0f}″), the limit of the linear model, at {place(first + k)}",
            "reduce the torque",
            Fault.BEYOND_MODEL,
        )
