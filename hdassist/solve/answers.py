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

TOLERANCE = 1e-8  # of each residual, as a share of its scale
Residual = Annotated[float, Field(strict=True, ge=0, le=TOLERANCE)]  # of a proven answer, in a file


@dataclass(frozen=True)
class Residuals:
    """Residuals of system (1) of states, each as a share of its scale, shape (states, 4).

    Columns: negative force, of the greatest force; negative gap, of the greatest gap without force; complementarity, of
    the product of both; equilibrium, of the sum of the forces' (and moments') sizes.
    """

    shares: Array

    @property
    def worst(self) -> Array:
        """Greatest residual of each state, shape (states,); infinite where one is not a number."""
        worst = self.shares.max(axis=1)
        return np.where(np.isnan(worst), np.inf, worst)


def displacements(system: ContactSystem, forces: Array, free: Array) -> Array:
    """Displacements a [mm, rad], shape (states, 9): those of supports from their forces, the free as given."""
    a = np.empty((len(forces), len(system.C)))
    supported = system.supported
    a[:, supported] = forces @ system.G[:, supported] / system.C[supported]
    a[:, ~supported] = free
    return a


def residuals(system: ContactSystem, delta_p: Array, torque: float | Array, forces: Array, free: Array) -> Residuals:
    """Residuals of answers to system (1).

    Arguments: delta_p, gaps without force [mm], and forces [N], both shape (states, M); torque [N*mm], of all states or
    of each; free, displacements of the freedoms without support [mm, rad], shape (states, free).
    """
    a = displacements(system, forces, free)
    moved = system.at_places(forces) @ system.compliance + a @ system.G[system.first].T
    gaps = delta_p + forces * system.local + moved[:, system.place]
    balance = forces @ system.G - a * system.C
    balance[:, ROTATION] += torque
    force_scale = np.maximum(np.abs(forces).max(axis=1), np.finfo(float).tiny)
    gap_scale = np.maximum(np.abs(delta_p).max(axis=1), np.finfo(float).tiny)
    balance_scale = np.abs(forces) @ np.abs(system.G)
    balance_scale[:, ROTATION] += np.abs(torque)
    rounding = np.finfo(float).eps * np.abs(forces).sum(axis=1)[:, None] * np.abs(system.G).max(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        # a freedom without any force on it is in balance: a ball on one axis pushes along the other by rounding alone
        unbalanced = np.where(np.abs(balance) <= rounding, 0.0, np.abs(balance) / balance_scale)
    pulled, closed = (np.maximum(-signed.min(axis=1), 0) for signed in (forces, gaps))
    product = np.abs(gaps * forces).max(axis=1) / (force_scale * gap_scale)
    return Residuals(np.stack([pulled / force_scale, closed / gap_scale, product, unbalanced.max(axis=1)], axis=1))


#


@dataclass(frozen=True)
class StateSums:
    """Sums of states, shape (states,) where no other is given; NaN in a state that was given up.

    rotation [rad] of the flexspline; moment [N*mm] of each mesh zone, shape (states, 2); tooth_force [N], greatest on a
    flank; residuals; slope of the rotation [rad/mm] by the scalars of the deviations while contacts stay as they are,
    shape (states, scalars), where asked for; given_up, how many states the first way gave up.
    """

    rotation: Array
    moment: Array
    tooth_force: Array
    residuals: Residuals
    slope: Array | None
    given_up: int

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
        """Sums of states from their forces [N], shape (states, M), and free displacements [mm, rad].

        Arguments: delta_p, gaps without force [mm], shape (states, M); torque [N*mm], of all states or of each.
        """
        flank = system.at_places(forces)[:, : system.pairs]
        return cls(
            rotation=free[:, system.free_rotation],
            moment=flank @ system.lever,
            tooth_force=flank.max(axis=1),
            residuals=residuals(system, delta_p, torque, forces, free),
            slope=slope,
            given_up=given_up,
        )

    def put(self, rows: NDArray[np.int64], there: StateSums) -> None:
        """Put the sums of other states into some rows."""
        self.residuals.shares[rows] = there.residuals.shares
        for name, values in vars(self).items():
            if isinstance(values, np.ndarray):
                values[rows] = getattr(there, name)


def rotation_slopes(formulation: Formulation, forces: Array, scalars: int) -> Array:
    """Slope of the rotation by the first scalars of the deviations [rad/mm], shape (states, scalars).

    Of each state at the contacts that carry force, forces [N], shape (states, M); NaN where none hold the parts.
    """
    system = formulation.system
    units = formulation.units
    m = len(formulation.H)
    change = system.deviation_map[system.first, :scalars]
    rotation = m + system.free_rotation
    slopes = np.full((len(forces), scalars), np.nan)
    for k, contact in enumerate(forces > 0):
        springs = Springs.of(formulation, np.zeros(len(contact)), contact)
        inside = np.append(np.flatnonzero(springs.series), np.arange(m, len(formulation.structure)))
        series = np.append(springs.series, np.zeros(len(units.load)))[inside]
        matrix = formulation.structure[np.ix_(inside, inside)] + np.diag(series)
        with suppress(np.linalg.LinAlgError):
            adjoint = np.linalg.solve(matrix, (inside == rotation).astype(float))
            slopes[k] = -adjoint[inside < m] @ change[inside[inside < m]]
    return np.asarray(slopes / units.load[system.free_rotation])


#


STATES_AT_A_TIME = 1024  # states between two reports of progress
ARCSEC = float(np.degrees(3600))  # arcsec in a radian
N_MM = 1e3  # N*mm in a N*m


@dataclass(frozen=True)
class Certificate(ClosedRecord):
    """Worst residuals over states, each a share of its scale, and how many states stood behind them.

    fallbacks: states that the warm solver gave up and another way solved.
    """

    states: Count
    negative_force: Residual
    negative_gap: Residual
    complementarity: Residual
    equilibrium: Residual
    fallbacks: Count

    @property
    def max_residual(self) -> float:
        """Greatest of the four residuals."""
        return max(self.negative_force, self.negative_gap, self.complementarity, self.equilibrium)

    def __add__(self, other: Certificate) -> Certificate:
        worst = {name: max(value, vars(other)[name]) for name, value in vars(self).items()}
        both = {"states": self.states + other.states, "fallbacks": self.fallbacks + other.fallbacks}
        return Certificate(**worst | both)


EMPTY = Certificate(0, 0.0, 0.0, 0.0, 0.0, 0)


@dataclass(frozen=True)
class Answers:
    """Results of solved states, shape (states,) where no other is given.

    rotation_arcsec: of the flexspline against the rigid wheel; zone_share: share of the torque that each mesh zone
    takes, shape (states, 2); tooth_force_N: greatest force on a flank; slope_arcsec_per_mm: change of the rotation by
    the scalars of the deviations while contacts stay as they are, shape (states, scalars), None where not asked for.
    """

    rotation_arcsec: Array
    zone_share: Array
    tooth_force_N: Array
    slope_arcsec_per_mm: Array | None
    certificate: Certificate


def proven_answers(
    system: ContactSystem,
    torque: float | Array,
    chunks: Iterable[StateSums],
    place: Callable[[int], str],
    progress: Progress | None = None,
) -> Answers:
    """Answers of states that were solved chunk by chunk, each of which is proven before the next one is asked for.

    Arguments: torque [N*mm], of all states or of each; place, words for where state k is, for
    errors; progress, called with how many states each chunk has.
    Raises UntrustedError where a state is not solved, its residuals are above TOLERANCE, or the answer is
    outside the limits of the linear model.
    """
    parts: list[StateSums] = []
    certificate = EMPTY
    for sums in chunks:
        _require_proof(sums.residuals, place, certificate.states)
        _require_linear(system, sums.rotation, place, certificate.states)
        force, gap, product, balance = sums.residuals.shares.max(axis=0).tolist()
        certificate += Certificate(len(sums.rotation), force, gap, product, balance, sums.given_up)
        parts.append(sums)
        if progress:
            progress(len(sums.rotation))
    slopes = [part.slope for part in parts if part.slope is not None]
    return Answers(
        rotation_arcsec=_joined(part.rotation for part in parts) * ARCSEC,
        zone_share=_joined(part.moment for part in parts).reshape(-1, 2) / np.reshape(torque, (-1, 1)),
        tooth_force_N=_joined(part.tooth_force for part in parts),
        slope_arcsec_per_mm=_joined(slopes) * ARCSEC if slopes else None,
        certificate=certificate,
    )


def _joined(parts: Iterable[Array]) -> Array:
    held = list(parts)
    return np.concatenate(held) if held else np.empty(0)


def _require_proof(proof: Residuals, place: Callable[[int], str], first: int) -> None:
    worst = proof.worst
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


def _require_linear(system: ContactSystem, rotation: Array, place: Callable[[int], str], first: int) -> None:
    quarter_pitch = np.pi / 2 / system.geometry.flexspline.z
    k = int(np.argmax(np.abs(rotation)))
    if abs(rotation[k]) > quarter_pitch:
        raise UntrustedError(
            f"wind-up of {abs(rotation[k]) * ARCSEC:.0f}″ exceeds a quarter of a tooth pitch "
            f"({quarter_pitch * ARCSEC:.0f}″), the limit of the linear model, at {place(first + k)}",
            "reduce the torque",
            Fault.BEYOND_MODEL,
        )
