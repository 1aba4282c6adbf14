"""F'_ior over what is not known of a drive's deviations: drives drawn from it, each of them searched and proven."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from hdassist.error.error_map import Batch, ErrorMap, searchable
from hdassist.error.table import DEVIATIONS
from hdassist.model.geometry import Array
from hdassist.model.unknown import draw, unknowns
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate, Progress

DRAWS = 64  # the greatest of 59 or more exceeds 95 of 100 drives with 95 % confidence (Wilks 1941)
CHUNK = 8  # drives a task
LOW, HIGH = 0.05, 0.95
FEW = 40  # positions of each wheel: of a drive of many 0.03 arcsec may be missed


@dataclass(frozen=True, eq=False)
class UnknownRange:
    """F'_ior [arcsec] of drives drawn at a torque M_g [N*m], in growing order, shape (draws,)."""

    M_g: float
    F_ior_arcsec: Array
    certificate: Certificate

    def quantile(self, share: float) -> float:
        """F'_ior [arcsec] that a share of the drives stay below."""
        return float(np.quantile(self.F_ior_arcsec, share))

    @property
    def low(self) -> float:
        """F'_ior [arcsec] that one of twenty drives stays below."""
        return self.quantile(LOW)

    @property
    def median(self) -> float:
        """F'_ior [arcsec] that half of the drives stay below."""
        return self.quantile(0.5)

    @property
    def high(self) -> float:
        """F'_ior [arcsec] that nineteen of twenty drives stay below."""
        return self.quantile(HIGH)

    @property
    def worst(self) -> float:
        """Greatest F'_ior [arcsec] of the drives."""
        return float(self.F_ior_arcsec[-1])


def drawn_range(drive: Drive, draws: int) -> bool:
    """Whether there is a range over what is not known, or uncertain, of a drive's deviations: its cycle is searched."""
    return draws > 0 and searchable(drive) and bool(unknowns(drive) or uncertain_deviations(drive))


def uncertain_deviations(drive: Drive) -> dict[str, float]:
    """Uncertainties of the deviations of a drive, by path."""
    return {path: spread for path, spread in drive.uncertainty.items() if spread and path.startswith(DEVIATIONS)}


def unknown_ranges(
    drive: Drive,
    torques: Sequence[float],
    *,
    draws: int = DRAWS,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> tuple[UnknownRange, ...]:
    """F'_ior of a drive at torques [N*m] over what is not known of its deviations, one range a torque.

    Empty where all is known, or the cycle cannot be searched (rolling balls). Deviations that have an uncertainty are
    not quite known: they are drawn with it. Arguments: draws, how many drives; seed, of them; executor, to spread the
    work over (the numbers do not depend on it); progress, told how many states were solved. Raises UntrustedError where
    an answer cannot be trusted.
    """
    if not drawn_range(drive, draws):
        return ()
    drawn = draw(drive.model_copy(update={"uncertainty": uncertain_deviations(drive)}), draws, seed)
    tasks = [(M_g, drawn[first : first + CHUNK]) for M_g in torques for first in range(0, draws, CHUNK)]
    found: dict[float, list[float]] = {M_g: [] for M_g in torques}
    proofs = dict.fromkeys(torques, EMPTY)
    for (M_g, _), (values, proof) in zip(tasks, (executor.map if executor else map)(_searched, tasks), strict=True):
        found[M_g] += values
        proofs[M_g] += proof
        if progress:
            progress(proof.states)
    return tuple(UnknownRange(M_g, np.sort(found[M_g]), proofs[M_g]) for M_g in torques)


def _searched(task: tuple[float, Sequence[Drive]]) -> tuple[list[float], Certificate]:
    M_g, drives = task
    error_map = ErrorMap(drives[0], M_g)
    found = [error_map.many_extremes(Batch.of(drive), grid=FEW) for drive in drives]
    return [each.first for each in found], sum((each.certificate for each in found), EMPTY)
