"""What a micrometre does: derivatives of F'_ior by the lengths that it hinges on."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import Executor
from dataclasses import dataclass

from hdassist.error.search import CycleSearch, searchable
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate, Progress

SEARCHES = 6  # for one sensitivity
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


def sensitivity(drive: Drive, M_g: float) -> Sensitivity | None:
    """Sensitivity of a drive at a torque M_g [N*m]; None where the cycle cannot be searched (rolling balls).

    Raises UntrustedError where an answer cannot be trusted.
    """
    if not searchable(drive):
        return None
    slopes, proof = [], EMPTY
    search: CycleSearch | None = None
    for path, micrometre in MICROMETRE.items():
        value = drive.value(path)
        down = 1 if value >= micrometre else 0
        found = []
        for steps in (-down, 1):
            there = drive.with_values({path: value + steps * micrometre})
            search = CycleSearch(there, M_g, like=search)
            found.append(search.extremes(there))
            proof += found[-1].certificate
        slopes.append((found[1].F_ior_arcsec - found[0].F_ior_arcsec) / (1 + down))
    j_n, W_0, g_b = slopes
    return Sensitivity(j_n, W_0, g_b, proof)


def sensitivities(
    cases: Iterable[tuple[Drive, float]], *, executor: Executor | None = None, progress: Progress | None = None
) -> list[Sensitivity | None]:
    """Sensitivity of several drives, each at a torque [N*m]; None where a cycle cannot be searched (rolling balls).

    Arguments: executor, to spread the work over (any concurrent.futures executor; the numbers do not depend on it);
    progress, told how many states were solved. Raises UntrustedError where an answer cannot be trusted.
    """
    drives, torques = zip(*cases, strict=True)
    results = []
    for result in (executor.map if executor else map)(sensitivity, drives, torques):
        results.append(result)
        if progress and result:
            progress(result.certificate.states)
    return results
