"""Drives that agree with records of part of the cycle: all that a preset leaves open, fitted through the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtr, ndtri

from hdassist.belief.prior import prior_of
from hdassist.comparing.doubt import doubts_of
from hdassist.correction.records import RecordedError
from hdassist.correction.table import between_points
from hdassist.errors import UntrustedError
from hdassist.model.geometry import Array
from hdassist.planning.lines import error_lines
from hdassist.preset.fields import Drive
from hdassist.run.run import Run

LEAST_MISFIT, FIRST_MISFIT, MOST_MISFIT = 0.01, 0.1, 0.15  # of the error, root mean square
FITS = 2  # the second by the misfit of the first
MISFITS_A_TURN = 24  # of the cam: independent numbers of a misfit of orders up to 12
OPEN_DIRECTION = 12**-0.5  # standard deviation, as a share of its turn
LARGEST = 3.0  # standard deviations that a field differs by, at most


def agreeing_drives(
    drive: Drive, records: Mapping[float, RecordedError], draws: int, run: Run
) -> tuple[list[dict[str, float]], float]:
    """Values by path of drives that agree with records by torque [N*m], and the misfit as a share of the error.

    The first of the drives agrees best.
    Angles of the records are the preset's. Fields that are open, uncertain, or doubted as `compare` does, are fitted:
    as normal numbers, directions as shares of their turn. Raises UntrustedError where no drive agrees.
    """
    doubts = {path: 2 * deviation for path, deviation in doubts_of(drive).items()}
    prior = prior_of(drive.model_copy(update={"uncertainty": doubts | drive.uncertainty}))
    fields = tuple(each for each in prior.fields if each.distribution == "normal" or drive.value(each.path) is None)
    prior, turning = replace(prior, fields=fields), np.array([each.is_any_direction for each in fields])
    read = np.concatenate([each.error_arcsec - each.error_arcsec.mean() for each in records.values()])
    cam_turns = sum(np.ptp(each.cam_turns) for each in records.values())

    def values_of(unknowns: Array) -> list[dict[str, float]]:
        return prior.values(np.where(turning, unknowns, ndtr(unknowns)))

    def off(unknowns: Array) -> Array:
        """Error of the records [arcsec] beyond that of a drive, shape (readings,)."""
        found = []
        for M_g, each in records.items():
            lines = error_lines(drive, M_g, values_of(unknowns[None]))
            periods = each.cam_turns / lines.kinematics.cycle_cam_revolutions
            apart = each.error_arcsec - between_points(lines.curves[0], periods)
            found.append(apart - apart.mean())
        return np.concatenate(found)

    def residual(unknowns: Array, start: Array, scale: float) -> Array:
        return np.append(off(unknowns) / scale, (unknowns - start * turning) / np.where(turning, OPEN_DIRECTION, 1))

    shares = prior.shares(draws, run.seed)[:, : len(fields)]
    begun = np.where(turning, shares, ndtri(shares)) * [each.distribution != "normal" for each in fields]
    best = min(begun, key=lambda each: float(np.var(off(each))))
    misfit, noise, together = FIRST_MISFIT, 0.0, len(read) / (MISFITS_A_TURN * cam_turns)
    bounds = np.where(turning, np.inf, LARGEST)
    for _ in range(FITS):
        scale = float(np.sqrt(noise + together * misfit**2 * np.var(read)))
        fit = least_squares(residual, best, bounds=(-bounds, bounds), ftol=1e-3, diff_step=1e-3, args=(best, scale))
        best, left = fit.x, off(fit.x)
        noise = float(np.var(np.diff(left))) / 2  # of a reading: a misfit goes on from one to the next
        misfit = float(np.sqrt(max((np.var(left) - noise) / np.var(read), LEAST_MISFIT**2)))
    if misfit > MOST_MISFIT:
        raise UntrustedError(
            f"no drive that {drive.name} allows shows the record: {100 * misfit:.0f} % of the error are off",
            "record the full cycle, or see what explains the difference: hdassist compare",
        )
    *_, sizes, directions = np.linalg.svd(fit.jac, full_matrices=False)
    drawn = np.random.default_rng([run.seed, 2]).standard_normal((draws // 2, len(best)))
    apart = np.concatenate([np.zeros((1, len(best))), drawn, -drawn])
    return values_of(best + apart / sizes @ directions), misfit
