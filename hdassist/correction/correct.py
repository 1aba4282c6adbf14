"""How much of a drive's error a stored correction takes off, over all that is not known of the drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hdassist.belief.prior import prior_of
from hdassist.belief.samples import EFFECTIVE_SAMPLES, Samples
from hdassist.correction.forms import CorrectionForm, line_orders, usual_forms
from hdassist.correction.table import CorrectionTable, ExpectedResidual, Phasors
from hdassist.design.check import drive_samples
from hdassist.error.self_error import self_error
from hdassist.errors import UsageError
from hdassist.model.geometry import Array
from hdassist.planning.lines import POINTS_A_TURN, ErrorLines, error_lines
from hdassist.preset.fields import Drive
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate

PERCENTILES = (0.05, 0.5, 0.95)
PHASORS = CorrectionForm(None)
IN_PLACE, TURN_LOST = "in place", "turn lost"
ZERO_OFF_DEG = (1.0, 10.0)  # of the cam
LOST_TURNS = 9  # counts of lost turns that are looked at, at most
STRONG_LINE = 0.05  # of the variance
TRIED_POINTS = (32, 64, 100, 128, 180, 200, 256, 360, 400, 512, 720, 1000, 1024, 1440, 1500, 2048, 3000, 4096)
HALVED = 0.5  # of the range: a correction that leaves more is called weak

LinesByTorque = Mapping[float, ErrorLines]


@dataclass(frozen=True)
class ErrorPart:
    """A part of the error: words, and its range [arcsec] at 5, 50 and 95 % of drives."""

    name: str
    p5: float
    p50: float
    p95: float


@dataclass(frozen=True)
class FormResiduals:
    """Residuals of a form: in place at each torque, then at the first one with the zero off, and with a turn lost.

    left: residual over the error without it at the first torque in place, at 5, 50 and 95 % of drives.
    """

    form: CorrectionForm
    residuals: tuple[ExpectedResidual, ...]
    left: tuple[float, float, float]

    @property
    def is_refused(self) -> bool:
        """Whether more than one drive in twenty may be worse with it than without."""
        return self.left[-1] >= 1

    @property
    def worse_at(self) -> tuple[float, ...]:
        """Other torques [N*m] at which the median error is greater with it than without."""
        return tuple(each.M_g for each in self.residuals if each.case == IN_PLACE and each.p50 > each.uncorrected_p50)


@dataclass(frozen=True, eq=False)
class Correction:
    """Corrections of a drive for the first of its torques.

    lines: of drives as this one may be, by torque; parts of the error; measured: residuals of each form where the error
    of the drive itself is known over its full cycle; stored: the same of the correction that is computed here, the best
    for all these drives together; correction: that of the form asked for; fewest_points: of a table over the output
    turn that halves the error, None where none of those tried does; samples: None where all is known.
    """

    drive: Drive
    lines: LinesByTorque
    parts: tuple[ErrorPart, ...]
    measured: tuple[FormResiduals, ...]
    stored: tuple[FormResiduals, ...]
    chosen: FormResiduals
    correction: CorrectionTable | Phasors
    fewest_points: int | None
    samples: Samples | None
    certificate: Certificate

    @property
    def M_g(self) -> float:
        """Torque [N*m] that it is for."""
        return next(iter(self.lines))

    @property
    def strong_lines(self) -> tuple[float, ...]:
        """Lines above STRONG_LINE of the variance, the strongest first: times a turn of the output."""
        lines = self.lines[self.M_g]
        power = (np.abs(lines.amplitude) ** 2).mean(axis=0)
        often = line_orders(lines)[0]
        return tuple(float(often[k]) for k in np.argsort(-power) if power[k] > STRONG_LINE * power.sum())


def correct(
    drive: Drive,
    *,
    form: CorrectionForm = PHASORS,
    draws: int = EFFECTIVE_SAMPLES,
    run: Run = Run(),
) -> Correction:
    """Corrections of a drive for the first of its torques, and what they leave at each.

    Arguments: form that is wanted; draws: drives as this one may be, 0 for the preset's own numbers alone. Raises
    UsageError for rolling balls, UntrustedError as `check` does.
    """
    drives, samples = believed_drives(drive, draws, run)
    return correction_of(drive, drives, samples, form, run)


def believed_drives(drive: Drive, draws: int, run: Run) -> tuple[Sequence[Mapping[str, float]], Samples | None]:
    """Values by path of drives as this one may be, all of the same weight, from its samples."""
    prior = prior_of(drive)
    if not (prior.fields and draws):
        return [{}], None
    samples = drive_samples(prior, [None] * len(drive.operation.M_g), draws=draws, run=run)
    middles = np.cumsum(samples.weights) / samples.weights.sum()
    rows = np.searchsorted(middles, (np.arange(draws) + 0.5) / draws)
    return prior.values(samples.shares[rows]), samples


def correction_of(
    drive: Drive, drives: Sequence[Mapping[str, float]], samples: Samples | None, form: CorrectionForm, run: Run
) -> Correction:
    """Corrections of a drive from the values, by path, of drives as it may be."""
    torques = drive.operation.M_g
    if form.turn and form.points < 2:
        raise UsageError(f"invalid number of points {form.points}: expected 2 or more")
    lines = {M_g: error_lines(drive, M_g, drives, run) for M_g in torques}
    mean = {M_g: replace(each, amplitude=each.amplitude.mean(axis=0)[None]) for M_g, each in lines.items()}
    forms = usual_forms(form.points if form.turn == "output" else None, several_loads=len(torques) > 1)
    forms = tuple(dict.fromkeys((*forms, form)))
    actual = {M_g: -each.curves for M_g, each in lines.items()}
    measured = tuple(residuals_of(each, lines, actual) for each in forms)
    stored = tuple(residuals_of(each, mean, actual) for each in forms)
    chosen = stored[forms.index(form)]
    own = self_error(drive, torques[:1], run=run.of_task)[0]
    parts = (*error_parts(lines, actual), ErrorPart("within a tooth pitch", *[own.range_arcsec] * 3))
    tried = (CorrectionForm("output", points) for points in TRIED_POINTS)
    first = dict([next(iter(lines.items()))])
    halving = (each.points for each in tried if residuals_of(each, first, actual).left[1] <= HALVED)
    certificate = sum((each.certificate for each in lines.values()), own.certificate + EMPTY)
    return Correction(
        drive, lines, parts, measured, stored, chosen, _exported(chosen, mean, drive.name), next(halving, None),
        samples, certificate + samples.certificate if samples else certificate,
    )  # fmt: skip


def _exported(chosen: FormResiduals, mean: LinesByTorque, preset: str) -> CorrectionTable | Phasors:
    """The correction of a form for the first torque; the other direction's, where there is the opposite torque."""
    form, M_g = chosen.form, next(iter(mean))
    found = form.fitted(mean[M_g], M_g, preset)
    if isinstance(found, Phasors):
        flat = {name: getattr(found, name)[0] for name in ("amplitude_arcsec", "phase_deg")}
        return replace(found, expected=chosen.residuals, **flat)
    other = form.fitted(mean[-M_g], -M_g) if form.each_load and -M_g in mean else None
    if isinstance(other, CorrectionTable):
        found = replace(found, other_direction_arcsec=other.error_arcsec[0], other_M_g=-M_g)
    return replace(found, error_arcsec=found.error_arcsec[0], expected=chosen.residuals)


def residuals_of(form: CorrectionForm, lines: LinesByTorque, actual: Mapping[float, Array]) -> FormResiduals:
    """Residuals of a form fitted to lines by torque, of the errors [arcsec] of drives, shape (drives, points)."""
    design, fitted = next(iter(lines)), {M_g: form.fitted(each, M_g) for M_g, each in lines.items()}
    turns = lines[design].kinematics.cycle_cam_revolutions
    cam_turns = np.arange(turns * POINTS_A_TURN) / POINTS_A_TURN
    found = []

    def left(M_g: float, *off_turns: float) -> Array:
        correction = fitted[M_g if form.each_load else design]
        corrected = (actual[M_g] - correction.error_at(cam_turns + off) for off in off_turns)
        return np.array([np.ptp(curves, axis=1) for curves in corrected])

    def add(case: str, M_g: float, *off_turns: float) -> None:
        uncorrected = percentiles(np.ptp(actual[M_g], axis=1))[1]
        found.append(ExpectedResidual(M_g, uncorrected, *percentiles(left(M_g, *off_turns)), case))

    for M_g in lines:
        add(IN_PLACE, M_g, 0.0)
    for degrees in ZERO_OFF_DEG:
        add(f"zero {degrees:g} deg off", design, -degrees / 360, degrees / 360)
    if turns > 1:
        lost = np.unique(np.linspace(1, turns - 1, LOST_TURNS).astype(int))
        add(TURN_LOST, design, *map(float, lost))
    share = left(design, 0.0)[0] / np.maximum(np.ptp(actual[design], axis=1), np.finfo(float).tiny)
    return FormResiduals(form, tuple(found), percentiles(share))


def error_parts(lines: LinesByTorque, actual: Mapping[float, Array]) -> tuple[ErrorPart, ...]:
    """Parts of the error of drives: by how often they come, and what other loads and the other direction change."""
    design = next(iter(lines))
    each, (_, order, beats) = lines[design], line_orders(lines[design])

    def part(name: str, kept: NDArray[np.bool_]) -> ErrorPart:
        curves = replace(each, amplitude=np.where(kept, each.amplitude, 0)).curves
        return ErrorPart(name, *percentiles(np.ptp(curves, axis=1)))

    def change(name: str, sign: int) -> list[ErrorPart]:
        others = [M_g for M_g in lines if M_g != design and np.sign(M_g) == sign * np.sign(design)]
        apart = [np.ptp(actual[M_g] - actual[design], axis=1) for M_g in others]
        return [ErrorPart(name, *percentiles(np.max(apart, axis=0)))] if others else []

    slow, with_cam = order == 0, np.abs(beats) < 1e-6
    return (
        part("repeats with the cam", ~slow & with_cam),
        part("beats with the wheels", ~slow & ~with_cam),
        part("once or so an output turn", slow),
        *change("changes with load", 1),
        *change("changes with direction", -1),
    )


def percentiles(values: Array) -> tuple[float, float, float]:
    """5th, 50th and 95th percentile of values of equal weight."""
    low, middle, high = np.quantile(values, PERCENTILES, method="weibull").tolist()
    return low, middle, high
