"""A correction from a record of the full cycle alone: its lines by least squares, each with its uncertainty.

No preset is asked, so no line has a size before the record: those of the declared orders with their beats are fitted as
`measure` fits them, and with them the harmonics of the cycle that stand out of the residuals. What they leave of the
readings, averaged where these lie at the same place, is noise or error: both ends of the promise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hdassist.comparing.record import Alignment
from hdassist.correction.correct import Correction, LoadedError, fitted_correction
from hdassist.correction.forms import CorrectionForm
from hdassist.correction.records import RECORDED_DRAWS, RecordedError
from hdassist.correction.table import Phasors
from hdassist.errors import UntrustedError, UsageError
from hdassist.measuring.fit import BINS_PER_COLUMN, TraceFit, fit_orders, residual_power
from hdassist.measuring.measure import STEPS_PER_PERIOD, Measurement
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.planning.lines import POINTS_A_TURN, ErrorLines
from hdassist.solve.answers import EMPTY

MOST_HARMONICS = 150  # beside the declared orders
HARMONIC_FALSE_ALARM = 0.01  # of a record whose residuals are noise
CLEAR = 4.0  # standard uncertainties: a smaller line is not taken off


def correction_alone(found: Measurement, asked: Alignment, M_g: float, form: CorrectionForm) -> Correction:
    """Correction from a record at a torque M_g [N*m] that was measured with its ratio, both directions as one.

    Argument: asked, how the file counts; two encoders count alike, both seen from the cam side. Raises UsageError for a
    table over the output turn and for angles of the output, UntrustedError for less than the full cycle.
    """
    trace, sweep, gearing = found.trace, found.directions[0], found.gearing
    if gearing is None or form.turn == "output" or trace.angle_of == "output":
        raise UsageError(
            "a record alone does not tell whether cam and output turn the same way",
            "with a preset: hdassist compensate PRESET FILE; or angles of the cam, and --form phasors or cam",
        )
    if sweep.is_bound:
        share = f"{100 * sweep.coverage.share:.0f} % of the full cycle" if sweep.coverage else "no full cycle"
        words = f"{trace.file}: {share}, in which lines that lie close together are not told apart"
        raise UntrustedError(words, "record the full cycle, or with a preset: hdassist compensate PRESET FILE")
    fit = clear_lines(with_harmonics(sweep.fit, gearing.cycle))
    sign = asked.sign * (-1 if trace.sense else 1)
    moving = round(2 * gearing.ratio)
    kinematics = Kinematics(moving, moving + 2, "rigid")  # the cycle is the same with the other wheel fixed
    factor = widened_factor(fit)
    noise = np.random.default_rng(found.seed).standard_normal((factor.shape[1], RECORDED_DRAWS // 2))
    apart = (factor @ np.concatenate([noise, -noise], axis=1)).T
    cosine, sine = np.split(fit.coefficients + apart, 2, axis=1)  # (drives, lines) each
    per_cycle = np.rint(fit.orders * gearing.cycle).astype(np.int64)
    lines = ErrorLines(kinematics, per_cycle, sign * (cosine - 1j * asked.sense * sine), EMPTY)
    record = RecordedError(asked.sense * fit.bins.turns, sign * fit.error)
    points = record.points(lines)
    read = np.bincount(points, minlength=lines.curves.shape[1])
    rest = np.bincount(points, sign * fit.residual, len(read)) / np.maximum(read, 1)
    is_error = np.arange(RECORDED_DRAWS) % 2  # the rest: noise in every other draw, error in the others
    error = LoadedError(lines, -lines.curves - is_error[:, None] * rest, 0.0, float(np.ptp(lines.mean.curves)))
    if form.turn is None:
        form = replace(form, points=min(form.points or len(per_cycle), len(per_cycle)))
    result = fitted_correction(None, {M_g: error}, form, {M_g: record}, trace.file)
    if not isinstance(result.correction, Phasors):
        return result
    kept = np.isin(per_cycle, np.rint(result.correction.per_cam_turn * gearing.cycle))
    along, across = (each[kept] for each in line_uncertainties(fit, factor))
    phase_deg = np.degrees(across / fit.amplitude[kept])
    unsure = replace(result.correction, amplitude_uncertainty_arcsec=along, phase_uncertainty_deg=phase_deg)
    return replace(result, corrections={M_g: unsure})


def clear_lines(fit: TraceFit) -> TraceFit:
    """A fit with the lines alone that are clear of noise, the strongest one at least: the rest is in its residuals."""
    clear = fit.amplitude > CLEAR * line_uncertainties(fit, widened_factor(fit))[0]
    return fit_orders(fit.bins, fit.orders[clear | (fit.amplitude == fit.amplitude.max())], fit.design.slow)


def with_harmonics(fit: TraceFit, cycle: int) -> TraceFit:
    """A fit with harmonics of the cycle [cam turns] that noise alone would hardly leave in its residuals."""
    bins, near = fit.bins, np.diff(fit.bins.turns)
    step = float(np.quantile(np.abs(near[near != 0]), 0.75))
    probes, power = residual_power(bins, fit.residual, fit.variance)
    often = np.rint(probes * cycle).astype(np.int64)
    strongest = np.zeros(often.max() + 1)
    np.maximum.at(strongest, often, power)
    strongest[np.rint(fit.orders * cycle).astype(np.int64)] = strongest[0] = 0
    strongest[int(min(1 / (STEPS_PER_PERIOD * step), POINTS_A_TURN / 2 - 1) * cycle) :] = 0
    room = int(len(bins) / BINS_PER_COLUMN / 2 - fit.design.columns) // 2
    found = np.argsort(-strongest)[: max(0, min(MOST_HARMONICS, room))]
    found = found[strongest[found] > np.log(len(strongest) / HARMONIC_FALSE_ALARM)]
    return fit_orders(bins, np.append(fit.orders, found / cycle), fit.design.slow)


def widened_factor(fit: TraceFit) -> Array:
    """Shape (2 lines, columns): its product with unit noise is an error of the coefficients.

    The noise floor between so many lines is known from few places: it counts where it is above independent residuals.
    """
    power, student = fit.noise
    wider = np.tile(np.maximum(1.0, student * np.sqrt(power)), 2)
    return np.asarray(fit.design.root[: 2 * len(power)] * np.sqrt(fit.variance) * wider[:, None])


def line_uncertainties(fit: TraceFit, factor: Array) -> tuple[Array, Array]:
    """Standard uncertainties [arcsec] of each line along its amplitude and across it, shape (lines,) each."""
    cosine, sine = factor.reshape(2, len(fit.orders), -1)
    a, b = (each[:, None] / np.maximum(fit.amplitude, 1e-300)[:, None] for each in fit.coefficients.reshape(2, -1))
    return np.linalg.norm(a * cosine + b * sine, axis=1), np.linalg.norm(a * sine - b * cosine, axis=1)
