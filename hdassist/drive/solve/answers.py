"""Results of solved states and their verification: residuals of system (1), and sums over the contacts.

The residuals are computed from D, G, C and the gaps. Analyses need only the sums, apart from the forces themselves.
States are solved chunk by chunk, and each chunk is verified before the next one is solved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from hdassist.drive.model.contacts import ROTATION, ContactSystem
from hdassist.drive.model.geometry import Array
from hdassist.drive.solve.formulation import Formulation, Springs
from hdassist.run.errors import Fault, UntrustedError
from hdassist.run.kept import ClosedRecord, Count
from hdassist.run.run import Progress

TOLERANCE = 1e-8  # largest allowed residual, as a share of its scale
# residual of a verified result, as stored in a file
Residual = Annotated[float, Field(strict=True, ge=0, le=TOLERANCE)]


@dataclass(frozen=True)
class Residuals:
    """Residuals of system (1) in states, as shares of their scales.

    shares: residuals, shape (states, 4). The columns, with their scales in parentheses, are negative force (largest
        force), negative gap (largest gap without force), complementarity (product of both scales) and equilibrium (sum
        of the absolute forces or moments).
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
        system: contact system with the supports.
        forces: forces [N], shape (states, M), which give the displacements of the supported freedoms.
        free: displacements of the freedoms without support [mm, rad], shape (states, free).
    """
    # a_s = C_s^-1 G_s' F for freedoms with a support, first line of (1); the displacements of the others are unknowns
    # of the programme
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
    """Return the residuals of solutions of system (1).

    Args:
        system: the contact system.
        delta_p: gaps without force [mm], shape (states, M).
        torque: torque [N*mm], one for all states or one per state.
        forces: forces [N], shape (states, M).
        free: displacements of the freedoms without support [mm, rad], shape (states, free).
    """
    a = displacements(system, forces, free)
    # both products are computed per place, because candidates at one place have equal rows
    place_gaps = system.at_places(forces) @ system.compliance + a @ system.G[system.first].T
    gaps = delta_p + forces * system.local + place_gaps[:, system.place]  # delta = delta_p + D F + G a
    # shares of the largest force and gap of the state; the tiny number avoids 0/0 in a state without force
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
        torque: torque [N*mm], one for all states or one per state.
        forces: forces [N], shape (states, M).
        a: displacements [mm, rad], shape (states, 9).
    """
    # G' F - C a + b, shape (states, 9); a makes the rows of supported freedoms 0
    balance = forces @ system.G - a * system.C
    balance[:, ROTATION] += torque
    # the scale is the sum of absolute forces, because equal and opposite forces must not hide an imbalance
    scale = np.abs(forces) @ np.abs(system.G)
    scale[:, ROTATION] += np.abs(torque)
    rounding = np.finfo(float).eps * np.abs(forces).sum(axis=1)[:, None] * np.abs(system.G).max(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        # a freedom without force is balanced within rounding: a ball on one axis pushes along the other only by
        # rounding
        share = np.where(np.abs(balance) <= rounding, 0.0, np.abs(balance) / scale)
    return np.asarray(share.max(axis=1))


# --- sums over the contacts


@dataclass(frozen=True)
class StateSums:
    """Sums over the contacts of states, NaN in a state that was given up."""

    rotation: Array  # rotation of the flexspline [rad], shape (states,)
    moment: Array  # moment of each mesh zone [N*mm], shape (states, 2)
    tooth_force: Array  # largest force on a flank [N], shape (states,)
    residuals: Residuals
    # slope of the rotation by the deviation scalars at constant contacts [rad/mm], shape (states, scalars); None if not
    # requested
    slope: Array | None
    given_up: int  # number of states that the first method gave up

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
            torque: torque [N*mm], one for all states or one per state.
            forces: forces [N], shape (states, M).
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
        """Replace the sums of some states.

        rows: indices of the states.
        sums: sums that replace them.
        """
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
        forces: forces [N], shape (states, M); candidates with a positive force are in contact.
        scalars: number of deviation scalars, counted from the first.
    """
    system = formulation.system
    units = formulation.units
    m = len(formulation.H)
    change = system.deviation_map[system.first, :scalars]
    rotation = m + system.free_rotation
    slopes = np.full((len(forces), scalars), np.nan)
    # each state has its own contact set, so each has its own matrix
    for k, contact in enumerate(forces > 0):
        # only the compliances of the springs are needed, so the gaps are 0
        springs = Springs.of(formulation, np.zeros(len(contact)), contact)
        inside = np.append(np.flatnonzero(springs.series), np.arange(m, len(formulation.structure)))
        series = np.append(springs.series, np.zeros(len(units.load)))[inside]
        matrix = formulation.structure[np.ix_(inside, inside)] + np.diag(series)
        # a contact set that does not hold the parts has no slope, so NaN remains
        with suppress(np.linalg.LinAlgError):
            # adjoint method: one solution gives the derivatives by all deviations, equation (9a)
            adjoint = np.linalg.solve(matrix, (inside == rotation).astype(float))
            slopes[k] = -adjoint[inside < m] @ change[inside[inside < m]]
    return np.asarray(slopes / units.load[system.free_rotation])


# --- verified results


STATES_AT_A_TIME = 1024  # states between two reports of progress
ARCSEC = float(np.degrees(3600))  # arcsec per radian
N_MM = 1e3  # N*mm per N*m


@dataclass(frozen=True)
class Certificate(ClosedRecord):
    """Largest residuals over a number of states, as shares of their scales."""

    states: Count
    negative_force: Residual
    negative_gap: Residual
    complementarity: Residual
    equilibrium: Residual
    fallbacks: Count  # number of states that the first method gave up and another one solved

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


EMPTY: Certificate = Certificate(
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

    rotation_arcsec: Array  # rotation of the flexspline relative to the circular spline, shape (states,)
    zone_share: Array  # share of the torque on each mesh zone, shape (states, 2)
    tooth_force_N: Array  # largest force on a flank, shape (states,)
    # slope of the rotation by the deviation scalars at constant contacts, shape (states, scalars); None if not
    # requested
    slope_arcsec_per_mm: Array | None
    certificate: Certificate


def proven_answers(
    system: ContactSystem,
    torque: float | Array,
    chunks: Iterable[StateSums],
    place: Callable[[int], str],
    progress: Progress | None = None,
) -> Answers:
    """Return the results of states that are solved and verified chunk by chunk.

    Args:
        system: the contact system.
        torque: torque [N*mm], one for all states or one per state.
        chunks: sums of the states.
        place: function that returns a description of state k for errors.
        progress: function called with the number of states of each chunk.

    Raises UntrustedError if a state is not solved, if its residuals exceed TOLERANCE, or if the rotation exceeds the
    limits of the linear model.
    """
    parts: list[StateSums] = []
    certificate = EMPTY
    # a failing chunk stops the work at once, because later chunks would be computed in vain
    for sums in chunks:
        _require_small_residuals(sums.residuals, place, certificate.states)
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


def _require_small_residuals(
    proof: Residuals,
    place: Callable[[int], str],
    first: int,
) -> None:
    worst = proof.worst
    # the comparison treats NaN as not solved
    k = int(np.argmin(worst <= TOLERANCE))  # first state that is not solved, if any
    if not worst[k] <= TOLERANCE:
        reason = "no method converges"
        if np.isfinite(worst[k]):
            reason = f"the relative residual is {worst[k]:.1e}, at most {TOLERANCE:.0e} is allowed"
        raise UntrustedError(
            f"the mesh position could not be solved at {place(first + k)}: {reason}",
            "use another solver (--solver clarabel), or set the torque and stiffnesses closer to those of a real drive",
            Fault.UNTRUSTED_STATE,
        )


def _require_linear(
    system: ContactSystem,
    rotation: Array,
    place: Callable[[int], str],
    first: int,
) -> None:
    # the gaps are linear in the rotation for small angles only; beyond a quarter of a pitch other flanks would touch
    quarter_pitch = np.pi / 2 / system.geometry.flexspline.z
    k = int(np.argmax(np.abs(rotation)))
    if abs(rotation[k]) > quarter_pitch:
        raise UntrustedError(
            f"the wind-up of {abs(rotation[k]) * ARCSEC:.0f}″ exceeds a quarter of a tooth pitch "
            f"({quarter_pitch * ARCSEC:.0f}″), the limit of the linear model, at {place(first + k)}",
            "reduce the torque",
            Fault.BEYOND_MODEL,
        )
