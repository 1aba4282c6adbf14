"""The error that a drive without deviations has: rotation over tooth phase and ball phase."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest

import numpy as np

from hdassist.model.contacts import WITHOUT_DEVIATIONS, ContactSystems
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.formulation import formulate
from hdassist.solve.loadcase import LoadCase


@dataclass(frozen=True)
class SelfError:
    """Self error of a drive at a torque M_g [N*m].

    rotation_arcsec, shape (tooth phases, ball phases): twist of the flexspline at tau = i/phases,
    beta likewise.
    """

    M_g: float
    rotation_arcsec: Array
    certificate: Certificate

    @property
    def range_arcsec(self) -> float:
        """Greatest minus least rotation over both phases [arcsec]."""
        return float(np.ptp(self.rotation_arcsec))

    @property
    def tooth_phase_arcsec(self) -> float:
        """Range over the tooth phase alone [arcsec], the ball phase as in the first column."""
        return float(np.ptp(self.rotation_arcsec[:, 0]))

    @property
    def ball_phase_arcsec(self) -> float:
        """Range over the ball phase alone [arcsec], the tooth phase 0."""
        return float(np.ptp(self.rotation_arcsec[0]))


def self_error(drive: Drive, torques: Sequence[float], *, run: Run = Run()) -> list[SelfError]:
    """Self error of a drive at torques M_g [N*m], over numerics.n_phase tooth and ball phases.

    Raises UntrustedError where an answer cannot be trusted.
    """
    systems, grid = ContactSystems(drive), drive.numerics.n_phase
    rotation, certificates = np.empty((len(torques), grid, grid)), [EMPTY] * len(torques)
    cases: dict[float, LoadCase] = {}  # one a torque: contact sets of neighbours are near, of torques they are not
    for i, k in np.ndindex(grid, grid):
        formulation = formulate(systems.at(i / grid, k / grid))
        for t, M_g in enumerate(torques):
            cases[M_g] = LoadCase(formulation, M_g, like=cases.get(M_g, cases.get(torques[0])))
            place = partial(_place, i / grid, k / grid, M_g)
            answers = cases[M_g].solve(WITHOUT_DEVIATIONS, place, run.solved)
            rotation[t, i, k] = answers.rotation_arcsec[0]
            certificates[t] += answers.certificate
    return list(map(SelfError, torques, rotation, certificates))


def limits_left(drive: Drive, torques: Sequence[float]) -> list[float | None]:
    """Room that limits of a drive leave F'_ior beside self error [arcsec] at torques [N*m]; None without a limit."""
    limits = [drive.limit(M_g) for M_g in torques]
    own = self_error(drive, torques) if any(limits) else []
    return [None if limit is None else limit - each.range_arcsec for limit, each in zip_longest(limits, own)]


def _place(tau: float, beta: float, M_g: float, _: int) -> str:
    return f"tau = {tau:g}, beta = {beta:g}, M_g = {M_g:g} N*m, without deviations"
