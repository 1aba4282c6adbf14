"""Drives that agree with records of part of the cycle: all that a preset leaves open, fitted through the model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtr, ndtri

from hdassist.belief.prior import prior_of
from hdassist.comparing.record import doubts_of
from hdassist.correction.records import RecordedError, solved_error
from hdassist.correction.table import between_points
from hdassist.errors import UntrustedError
from hdassist.model.geometry import Array
from hdassist.planning.lines import error_lines
from hdassist.preset.fields import Drive
from hdassist.run.run import Run

LEAST_MISFIT, FIRST_MISFIT, MOST_MISFIT = 0.01, 0.1, 0.15  # of the error, root mean square
FITS = 2  # the second by the misfit of the first, and with what lines leave of its drive's solved cycle
MISFITS_A_TURN = 24  # of the cam: independent numbers of a misfit of orders up to 12
OPEN_DIRECTION = 12**-0.5  # standard deviation, as a share of its turn
LARGEST = 3.0  # standard deviations that a field differs by, at most


def agreeing_drives(
    drive: Drive, records: Mapping[float, RecordedError], draws: int, run: Run
) -> tuple[list[dict[str, float]], float]:
    """Values by path of drives that agree with records by torque [N*m], and the misfit as a share of the error.

    The first of the drives agrees best; others that agree better than normal numbers around it would come more often.
    Angles of the records are the preset's. Fields that are open, uncertain, or doubted as `compare` does, are fitted:
    as normal numbers, directions as shares of their turn. Raises UntrustedError where no drive agrees.
    """
    doubts = {path: 2 * deviation for path, deviation in doubts_of(drive).items()}
    prior = prior_of(drive.model_copy(update={"uncertainty": doubts | drive.uncertainty}))
    fields = tuple(each for each in prior.fields if each.distribution == "normal" or drive.value(each.path) is None)
    prior, turning = replace(prior, fields=fields), np.array([each.is_any_direction for each in fields])
    cam_turns = sum(np.ptp(each.cam_turns) for each in records.values())

    def values_of(unknowns: Array) -> list[dict[str, float]]:
        return prior.values(np.where(turning, unknowns, ndtr(unknowns)))

    def levelled(by_torque: Iterable[Array]) -> Array:
        return np.concatenate([each - each.mean(axis=-1, keepdims=True) for each in by_torque], axis=-1)

    def off(unknowns: Array) -> Array:
        """Errors of the records [arcsec] beyond the lines of drives, shape (drives, readings)."""
        lines = {M_g: error_lines(drive, M_g, values_of(unknowns), run) for M_g in records}
        return levelled(
            each.error_arcsec
            - between_points(lines[M_g].curves, each.cam_turns / lines[M_g].kinematics.cycle_cam_revolutions)
            for M_g, each in records.items()
        )

    def beyond_lines(values: Mapping[str, float]) -> Array:
        """What lines leave of a drive's solved cycle [arcsec], at the readings."""
        found = []
        for M_g, each in records.items():
            lines, (solved, _) = (
                error_lines(drive, M_g, [values], run),
                solved_error(drive.with_values(values), M_g, run),
            )
            period = lines.kinematics.cycle_cam_revolutions
            found.append(np.interp(each.cam_turns, solved.cam_turns, solved.apart(lines), period=period))
        return levelled(found)

    def residuals(unknowns: Array, start: Array, scale: float, beyond: Array) -> Array:
        pull = np.where(turning, (unknowns - start) / OPEN_DIRECTION, unknowns)
        return np.concatenate([(off(unknowns) - beyond) / scale, pull], axis=1)

    shares = prior.shares(draws, run.seed)[:, : len(fields)]
    begun = np.where(turning, shares, ndtri(shares)) * [each.distribution != "normal" for each in fields]
    best, read = begun[np.argmin(off(begun).var(axis=1))], levelled(each.error_arcsec for each in records.values())
    misfit, noise, together, beyond = FIRST_MISFIT, 0.0, len(read) / (MISFITS_A_TURN * cam_turns), np.zeros(len(read))
    bounds = np.where(turning, np.inf, LARGEST)
    for _ in range(FITS):
        about = best, float(np.sqrt(noise + together * misfit**2 * np.var(read))), beyond
        fit = least_squares(
            lambda unknowns, *about: residuals(unknowns[None], *about)[0], best,
            bounds=(-bounds, bounds), ftol=1e-3, diff_step=1e-3, args=about,
        )  # fmt: skip
        best = fit.x
        beyond = beyond_lines(values_of(best[None])[0])
        left = off(best[None])[0] - beyond
        noise = float(np.var(np.diff(left))) / 2  # of a reading: a misfit goes on from one to the next
        misfit = float(np.sqrt(max((np.var(left) - noise) / np.var(read), LEAST_MISFIT**2)))
    if misfit > MOST_MISFIT:
        raise UntrustedError(
            f"no drive that {drive.name} allows shows the record: {100 * misfit:.0f} % of the error are off",
            "record the full cycle, or see what explains the difference: hdassist compare",
        )
    *_, sizes, directions = np.linalg.svd(fit.jac, full_matrices=False)
    rng = np.random.default_rng([run.seed, 2])
    apart = rng.standard_normal((draws, len(best)))
    apart[0] = 0
    near = best + apart / sizes @ directions
    logarithm = ((apart**2).sum(axis=1) - (residuals(near, *about) ** 2).sum(axis=1)) / 2
    shares = np.cumsum(np.exp(logarithm - logarithm.max()))
    rows = np.searchsorted(shares, (np.arange(1, draws) - rng.random()) * (shares[-1] / (draws - 1)))
    return values_of(near[np.append(0, rows)]), misfit
