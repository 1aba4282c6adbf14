"""What a micrometre does: derivatives of F'_ior by the lengths that it hinges on."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from hdassist.error.nearby import Nearby
from hdassist.model.geometry import Array
from hdassist.solve.answers import Certificate, Progress

SLOPES = 2500  # states solved for a drive near which others are, and its slopes, at a torque, about
MICROMETRE = {"gears.j_n": 1.0, "cam.W_0": 1e-3, "bearing.g_b": 1.0}  # in the unit of each field


@dataclass(frozen=True)
class Sensitivity:
    """Change of F'_ior [arcsec per um] with the flank clearance j_n, the wave W_0 and the bearing clearance g_b.

    Differences over a micrometre to both sides; clearances that are less than that, to one side.
    """

    j_n: float
    W_0: float
    g_b: float
    certificate: Certificate


def sensitivity(
    known: Nearby, *, executor: Executor | None = None, progress: Progress | None = None
) -> tuple[Sensitivity, ...]:
    """Sensitivity of a drive at each of its torques.

    Arguments: known, the drive and what is near; executor, to spread the work over (any concurrent.futures executor;
    the numbers do not depend on it); progress, told how many states were solved. Raises UntrustedError where an answer
    cannot be trusted.
    """
    slopes, proofs = [], known.certificates
    for slope, more in (executor.map if executor else map)(partial(_slope, known), MICROMETRE):
        slopes.append(slope)
        proofs = [proof + part for proof, part in zip(proofs, more, strict=True)]
        if progress:
            progress(sum(part.states for part in more))
    columns = np.transpose(slopes).tolist()
    return tuple(Sensitivity(j_n, W_0, g_b, proof) for (j_n, W_0, g_b), proof in zip(columns, proofs, strict=True))


def _slope(known: Nearby, path: str) -> tuple[Array, list[Certificate]]:
    """Change of F'_ior [arcsec per um] with a length, by its path, shape (torques,), and the proof of each."""
    value, micrometre = known.drive.value(path), MICROMETRE[path]
    more, proofs = known.F_ior(known.drive.with_values({path: value + micrometre}))
    if value < micrometre:
        return more - known.F_ior_arcsec, proofs
    less, others = known.F_ior(known.drive.with_values({path: value - micrometre}))
    return (more - less) / 2, [proof + other for proof, other in zip(proofs, others, strict=True)]
