"""Draws of what is not known of a drive, as likely as the traces of its trials make them."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from scipy.special import softmax
from scipy.stats import chi2, norm

from hdassist.error.table import ErrorTable, turns
from hdassist.errors import UntrustedError
from hdassist.model.deviations import deviation_scalars, displaced
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.trials.trace_evidence import Evidence, Particles, squares, tempered
from hdassist.trials.trial import Rig, Trial
from hdassist.trials.unknowns import Unknowns, listed

UNLIKELY = 1e-3  # of a chance that the best explanation misses the traces so far: then there is none
REVERSED = 100.0  # times likelier with the other sign of the error: then it is meant


@dataclass(frozen=True, eq=False)
class Case:
    """One set of stiffnesses and the traces that it is to explain.

    scale: standard deviation of the drive's error over the model's, cut at so many widths of it.
    """

    drive: Drive
    response: ErrorTable
    unknowns: Unknowns
    evidence: Evidence
    scale: float
    widths: float

    def squares(self, evidence: Evidence, shares: Array) -> Array:
        """What particles are off by, from shares of size, direction, rest, scale, starts."""
        rest = 2 + len(self.unknowns.paths)
        low = norm.cdf(-self.widths)
        scale = 1 + self.scale * norm.ppf(low + (1 - 2 * low) * shares[:, rest])
        values = self.unknowns.values(shares[:, :rest])
        return squares(self.drive, self.response, evidence, values, scale, 2 * np.pi * shares[:, rest + 1 :])


def evidence_of(
    drive: Drive, response: ErrorTable, trials: Sequence[Trial], rig: Rig, standard_error_arcsec: float
) -> Evidence:
    """Traces of trials, with slow errors as large as the noise of an F'_ior, the seat's error and the table's."""
    slow = np.linalg.norm((rig.noise_arcsec, standard_error_arcsec, _seat(drive, response, rig)))
    traced = [(trial.trace, trial.rotation_deg) for trial in trials if trial.trace]
    return Evidence.of([trace for trace, _ in traced], [rotation for _, rotation in traced], float(slow))


def _seat(drive: Drive, response: ErrorTable, rig: Rig) -> float:
    """What the wheel's centre coming to lie off does to the error [arcsec], root mean square over the cycle."""
    if not rig.reseat_um:
        return 0.0
    scalars = deviation_scalars(drive, *turns())
    there = response.rotation(scalars)
    off = [np.std(response.rotation(off_centre(drive, scalars, rig.reseat_um * 1j**k)) - there) for k in (0, 1)]
    return float(np.linalg.norm(off))


def off_centre(drive: Drive, scalars: Array, off_um: complex) -> Array:
    """Scalars [mm] at turns(), shape (..., TURNS**2, scalars), of a drive whose fixed wheel came to lie off [um]."""
    alpha_g, alpha_b = turns()
    return displaced(scalars, off_um * 1e-3, alpha_b if drive.mounting.fixed == "rigid" else alpha_g)


def drawn_from_traces(
    cases: Sequence[Case], count: int, particles: int, seed: int, executor: Executor | None = None
) -> tuple[list[list[dict[str, float]]], Array]:
    """Values of the rest for each case, count draws of them or one where nothing is open, and each case's probability.

    Arguments: particles, how many the draws are taken from. Raises UntrustedError where nothing explains the traces, or
    they are far likelier with the other sign.
    """
    counts = {False: particles, True: particles // 3}  # the other sign is only weighed
    tasks = [(case, other, counts[other], seed + k) for other in (False, True) for k, case in enumerate(cases)]
    found = list((executor.map if executor else map)(_particles, tasks))
    given, reversed_ = found[: len(cases)], found[len(cases) :]
    _require_explained(cases[0], given, reversed_)
    paths = cases[0].unknowns.paths
    draws = []
    for drawn in given:
        some = drawn.shares[:: len(drawn.shares) // count][:count, : 2 + len(paths)]
        values = cases[0].unknowns.values(some)
        draws.append(listed({path: values[path] for path in paths}, count) if paths else [{}])
    return draws, np.asarray(softmax([particles.log_evidence for particles in given]))


def _particles(task: tuple[Case, bool, int, int]) -> Particles:
    case, other, count, seed = task
    evidence = case.evidence.reversed if other else case.evidence
    circular = np.concatenate([case.unknowns.circular, [False], np.ones(len(evidence.traces), dtype=bool)])
    return tempered(lambda shares: case.squares(evidence, shares), circular, [seed, int(other)], count)


def _require_explained(case: Case, given: Sequence[Particles], reversed_: Sequence[Particles]) -> None:
    log, other = (np.logaddexp.reduce([p.log_evidence for p in found]) for found in (given, reversed_))
    known = case.evidence.known
    files = ", ".join(trace.file for trace in case.evidence.traces)
    if other - log > np.log(REVERSED) and chi2.sf(min(p.squares for p in reversed_), known) >= UNLIKELY:
        raise UntrustedError(
            f"{files}: far likelier with the other sign of the error",
            "it is F_kpp = cam/u - output, as hdassist trace writes it, at angles counter-clockwise seen from the cam "
            "side; --reverse-error takes it the other way round",
        )
    if chi2.sf(min(p.squares for p in given), known) < UNLIKELY:
        raise UntrustedError(
            f"no cam offset up to {case.unknowns.widest:g} um explains {files}",
            "check the torque, the sign of the error (cam/u - output), and that the cam's angle is counted from its "
            "index and counter-clockwise seen from the cam side; a larger --noise, or a larger offset in the preset, "
            "may fit",
        )
