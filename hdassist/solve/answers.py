"""The proof of many solved states, and their results."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from hdassist.errors import Fault, UntrustedError
from hdassist.model.contacts import ContactSystem
from hdassist.model.geometry import Array
from hdassist.run.run import Progress
from hdassist.solve.certificate import TOLERANCE, Residuals
from hdassist.solve.sums import StateSums

STATES_AT_A_TIME = 1024  # states between two reports of progress
ARCSEC = float(np.degrees(3600))  # arcsec in a radian
N_MM = 1e3  # N*mm in a N*m


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

    def __add__(self, other: Certificate) -> Certificate:
        worst = {name: max(value, vars(other)[name]) for name, value in vars(self).items()}
        both = {"states": self.states + other.states, "fallbacks": self.fallbacks + other.fallbacks}
        return Certificate(**worst | both)


EMPTY = Certificate(0, 0.0, 0.0, 0.0, 0.0, 0)


@dataclass(frozen=True)
class Answers:
    """Results of solved states, shape (states,) where no other is given.

    rotation_arcsec: of the flexspline against the rigid wheel; zone_share: share of the torque that each mesh zone
    takes, shape (states, 2); tooth_force_N: greatest force on a flank; pull_N: forces along the scalars of the
    deviations, and slope_arcsec_per_mm: change of the rotation by them while contacts stay as they are, shape (states,
    scalars), None where not asked for. As the energy has one second derivative, the pull grows with the torque as the
    rotation grows with the scalars.
    """

    rotation_arcsec: Array
    zone_share: Array
    tooth_force_N: Array
    pull_N: Array | None
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
    pulls = [part.pull for part in parts if part.pull is not None]
    slopes = [part.slope for part in parts if part.slope is not None]
    return Answers(
        rotation_arcsec=_joined(part.rotation for part in parts) * ARCSEC,
        zone_share=_joined(part.moment for part in parts).reshape(-1, 2) / np.reshape(torque, (-1, 1)),
        tooth_force_N=_joined(part.tooth_force for part in parts),
        pull_N=_joined(pulls) if pulls else None,
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
        residual = f"residual {worst[k]:.1e} of its scale, {TOLERANCE:.0e} allowed"
        raise UntrustedError(
            f"state not solved at {place(first + k)}: {residual if np.isfinite(worst[k]) else 'no method ends'}",
            "try another solver (--solver clarabel), or a torque and stiffnesses nearer to a real drive",
            Fault.UNTRUSTED_STATE,
        )


def _require_linear(system: ContactSystem, rotation: Array, place: Callable[[int], str], first: int) -> None:
    quarter_pitch = np.pi / 2 / system.geometry.flexspline.z
    k = int(np.argmax(np.abs(rotation)))
    if abs(rotation[k]) > quarter_pitch:
        raise UntrustedError(
            f"outside the limits of the linear model at {place(first + k)}: wind-up of "
            f"{abs(rotation[k]) * ARCSEC:.0f}″, above a quarter of a tooth pitch ({quarter_pitch * ARCSEC:.0f}″)",
            "the torque is too great for this drive",
            Fault.BEYOND_MODEL,
        )
