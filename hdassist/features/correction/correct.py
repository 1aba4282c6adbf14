"""Residual error of a drive with a correction, over its uncertain inputs, and its verification by a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hdassist.belief.prior import prior_of
from hdassist.belief.samples import EFFECTIVE_SAMPLES, Samples, drive_samples
from hdassist.belief.statistics import even_rows
from hdassist.drive.error.waves import POINTS_A_TURN, WAVE_POINTS, ErrorLines, error_lines
from hdassist.drive.model.deviations import carried
from hdassist.drive.model.geometry import Array, Kinematics
from hdassist.drive.preset.fields import Drive
from hdassist.drive.solve.answers import EMPTY, Certificate
from hdassist.features.correction.directions import RECORDED_DRAWS
from hdassist.features.correction.forms import (
    TRIED_POINTS,
    USUAL_TABLES,
    CorrectionForm,
    CorrectionTable,
    ExpectedResidual,
    Phasors,
    RepeatTurn,
    between_points,
    line_orders,
)
from hdassist.features.correction.records import (
    RecordedError,
    agreeing_drives,
    alike_lines,
    drawn_errors,
    recorded_error,
    recorded_lines,
    solved_error,
    with_more_lines,
    with_scale_spread,
)
from hdassist.features.measuring.measure import Measurement
from hdassist.features.mounting.advice import Advice
from hdassist.features.mounting.decision import Decision
from hdassist.features.record_comparison.record import Alignment
from hdassist.run.errors import UntrustedError, UsageError, Verdict
from hdassist.run.run import Run

_REPORTED_SHARES = (0.05, 0.5, 0.95)
# number of drives solved over the full cycle, to determine the part of the error that their lines do not contain
_SOLVED_DRIVES = 8
_SOLVED_A_POSITION = 2  # number of drives solved over the full cycle in each position of the fixed wheel
PHASORS = CorrectionForm(None)  # correction terms whose number is chosen automatically
_ENOUGH = 1.1  # largest residual of a sufficient number of correction terms, as a multiple of the smallest residual
IN_PLACE = "in place"
TURN_LOST = "turn lost"
_ZERO_OFF_DEG = (1.0, 10.0)  # offsets of the zero that are tried [deg of the input]
_LOST_TURNS = 9  # largest number of values that are tried for the lost input revolutions
_STRONG_LINES = 3  # number of strongest lines that are named
_ANY_PHASE_DEG = 180 / 3**0.5  # standard deviation of a phase that is not known [deg]
_LEAST_AMPLITUDE = 1e-300  # arcsec; prevents division by the amplitude 0
HALVED = 0.5  # residual above which a correction is weak, as a share of the uncorrected range
# largest rms residual with a cause that is reported, relative to the rms residual with the intended correction
_EXPLAINED_RMS_SHARE = 0.5
# largest sum of squares of a cause that counts as equally good, as a multiple of the smallest sum; among equally good
# causes, the one with the smallest offset of the zero is reported
_ALIKE = 1.05
_IN_ZERO_DEG = 3.0  # largest offset of the zero that is not reported [deg of the input]


@dataclass(frozen=True, eq=False)
class _LoadedError:
    """Error of sampled drives at a torque, from its lines.

    beyond: range of the part that the lines do not contain, as a share of the range of the error; one number or shape
        (drives,).
    F_ior_arcsec: F'_ior of a recording of the full mesh cycle [arcsec]; None without such a recording.
    visited: whether each point of the cycle lies in the recorded travel, shape (points,); None for the full cycle.
    stated_arcsec: median of F'_ior over the samples, as given by `check` [arcsec]; None without samples.
    difference: samples of the error in one direction of rotation minus that in the other, of which the lines are the
        mean; None if the directions are not distinguished.
    """

    lines: ErrorLines
    beyond: Array | float = 0.0
    F_ior_arcsec: float | None = None
    visited: NDArray[np.bool_] | None = None
    stated_arcsec: float | None = None
    difference: ErrorLines | None = None

    @cached_property
    def actual(self) -> Array:
        """Actual error, for two directions of rotation that of their mean [arcsec], shape (drives, points)."""
        # F_kpp is the lag of the output, but a controller corrects the position, which has the opposite sign
        return -self.lines.curves

    @cached_property
    def by_direction(self) -> tuple[Array, ...]:
        """Actual error with increasing and with decreasing angles, or of all rotation, each as `actual`."""
        if self.difference is None:
            return (self.actual,)
        rows = np.arange(len(self.actual)) % len(self.difference.amplitude)
        half = self.difference.curves[rows] / 2
        return self.actual - half, self.actual + half

    def range_of(self, curves: Array) -> Array:
        """Return the range of each curve over the points of the travel; curves have the shape (..., points)."""
        return np.asarray(np.ptp(curves if self.visited is None else curves[..., self.visited], axis=-1))

    def corrected(
        self,
        form: CorrectionForm,
        M_g: float,
        *,
        together: bool,
    ) -> CorrectionTable | Phasors:
        """Return corrections of the given form, fitted to the error.

        form: form of the correction.
        M_g: torque [N*m].
        together: whether all drives share one correction; otherwise each drive has its own.
        """
        return form.fitted(self.lines.mean if together else self.lines, M_g)

    @property
    def ranges(self) -> Array:
        """Ranges of the error without a correction, the larger of both directions [arcsec], shape (drives,)."""
        ranges = np.max([self.range_of(curves) for curves in self.by_direction], axis=0)
        return np.asarray(ranges if self.F_ior_arcsec is None else np.full_like(ranges, self.F_ior_arcsec))

    @property
    def mean_range_arcsec(self) -> float:
        """Range of the mean error of all drives, the larger of both directions [arcsec]."""
        return max(float(self.range_of(curves.mean(axis=0))) for curves in self.by_direction)

    @property
    def uncorrected_p50(self) -> float:
        """Median of the range of the error without a correction [arcsec]."""
        return percentiles(self.ranges)[1] if self.stated_arcsec is None else self.stated_arcsec


_ErrorsByTorque = Mapping[float, _LoadedError]


@dataclass(frozen=True)
class ErrorPart:
    """A part of the error: its name, and its range at 5, 50 and 95 % of drives [arcsec]."""

    name: str
    p5: float
    p50: float
    p95: float


@dataclass(frozen=True)
class DirectionResidual:
    """Range of the error with a correction in one direction of rotation.

    direction: 1 for increasing angles of the recording, -1 for decreasing ones.
    p5, p50, p95: percentiles of the range [arcsec].
    """

    direction: int
    p5: float
    p50: float
    p95: float


@dataclass(frozen=True)
class FormResiduals:
    """Residuals of a correction of one form.

    form: form of the correction.
    residuals: residuals with the correction in place, one per torque, followed by those at the first torque with a
        wrong zero and with lost revolutions.
    left: residual with the correction in place at the first torque, as a share of the uncorrected error, at 5, 50 and
        95 % of drives.
    """

    form: CorrectionForm
    residuals: tuple[ExpectedResidual, ...]
    left: tuple[float, float, float]

    @property
    def is_refused(self) -> bool:
        """Whether the correction may make more than one drive in twenty worse."""
        return self.left[-1] >= 1


@dataclass(frozen=True, eq=False)
class Correction:
    """Corrections of a drive, designed for the first of its torques.

    drive: the drive; None for a correction from a recording only.
    errors: errors of the sampled drives, by torque [N*m].
    parts: parts of these errors.
    forms: residuals of each form. If the chosen form is refused and there is no recording of the full mesh cycle, each
        drive has its own correction, as if there were such a recording.
    chosen: residuals of the requested form, fitted to all drives together.
    corrections: corrections of the requested form, by torque [N*m]. A form with a table for each load has corrections
        for further torques, except those at which the correction may make more than one drive in twenty worse.
    fewest_points: points of a table over the output revolution that halves the error; None if no tried number does.
    phasors: median of the residual range [arcsec], by number of correction terms.
    records: recordings by torque [N*m].
    misfit: relative misfit of the drives that agree with recordings of part of the cycle; None without such recordings.
    samples: samples of the drive; None if it has no uncertain inputs.
    certificate: certificate of the solved states.
    directions: residuals of the requested form at the first torque by direction of rotation; empty unless a recording
        of both directions determines them.
    between_directions: range of the difference between the directions at the first torque; None without it.
    """

    drive: Drive | None
    errors: _ErrorsByTorque
    parts: tuple[ErrorPart, ...]
    forms: tuple[FormResiduals, ...]
    chosen: FormResiduals
    corrections: Mapping[float, CorrectionTable | Phasors]
    fewest_points: int | None
    phasors: Mapping[int, float]
    records: Mapping[float, RecordedError]
    misfit: float | None
    samples: Samples | None
    certificate: Certificate
    directions: tuple[DirectionResidual, ...] = ()
    between_directions: ErrorPart | None = None

    @property
    def M_g(self) -> float:
        """Torque that the correction is designed for [N*m]."""
        return next(iter(self.errors))

    @property
    def correction(self) -> CorrectionTable | Phasors:
        """Correction for the first torque."""
        return self.corrections[self.M_g]

    @property
    def recorded_deg(self) -> tuple[float, float] | None:
        """Output angles at the ends of a recorded travel [deg]; None for the full cycle."""
        record = self.records.get(self.M_g)
        if record is None or record.recorded_turns is None:
            return None
        # with a negative ratio, the output rotates in the opposite sense
        low, high = sorted(360 * turns / self.errors[self.M_g].lines.kinematics.u for turns in record.recorded_turns)
        return low, high

    @property
    def strong_lines(self) -> tuple[float, ...]:
        """Orders of the strongest lines, the strongest first [periods per output revolution]."""
        lines = self.errors[self.M_g].lines
        strongest = np.argsort(-(np.abs(lines.amplitude) ** 2).mean(axis=0))[:_STRONG_LINES]
        return tuple(line_orders(lines)[0][strongest].tolist())


def correct(
    drive: Drive,
    *,
    form: CorrectionForm = PHASORS,
    records: Mapping[float, RecordedError] | None = None,
    draws: int = EFFECTIVE_SAMPLES,
    run: Run = Run(),
) -> Correction:
    """Return the corrections of a drive for the first of its torques, and their residuals at each torque.

    form: requested form.
    records: recordings of the drive by torque [N*m], which define the zero of the correction.
    draws: number of sampled drives; 0 for the nominal values of the preset only.
    Raises UsageError for rolling balls, and UntrustedError as `check` and `agreeing_drives` do.
    """
    records = records or {}
    prior = prior_of(drive)
    # a recording of part of the cycle does not resolve the lines, so drives that agree with the recording are used
    if any(record.is_part for record in records.values()):
        # drives cannot be fitted to errors of unknown size
        if any(record.scale_uncertainty for record in records.values()):
            message = (
                "the guide rate, which sets the scale of the error, must be known for a recording of part of the cycle"
            )
            raise UntrustedError(message, "state the guide rate: --guide-rate ARCSEC/S")
        # the number of draws is even because they are made in pairs of opposite signs
        agreeing, misfit = agreeing_drives(drive, records, draws // 2 * 2 or RECORDED_DRAWS, run)
        return correction_of(drive, agreeing, records, form, run, misfit=misfit)
    # without uncertain inputs, one drive is enough
    if not (prior.fields and draws):
        return correction_of(drive, [{}], records, form, run)
    samples = drive_samples(
        prior,
        [None for _ in drive.operation.M_g],
        draws=draws,
        run=run,
    )
    # these samples also determine the ranges of F'_ior in all other results
    first = samples.of_ranges
    rows = even_rows(first.weights, draws)
    return correction_of(
        drive, first.values(rows), records, form, run, samples=samples, F_ior_arcsec=first.F_ior_arcsec[rows]
    )


def correction_of(
    drive: Drive,
    drives: Sequence[Mapping[str, float]],
    records: Mapping[float, RecordedError],
    form: CorrectionForm,
    run: Run,
    *,
    samples: Samples | None = None,
    F_ior_arcsec: Array | None = None,
    misfit: float | None = None,
) -> Correction:
    """Return the corrections of a drive, fitted to possible drives.

    drive: the drive.
    drives: values of the possible drives, by path.
    records: recordings of the drive by torque [N*m].
    form: form of the correction.
    run: the run.
    samples: samples that the drives come from; None if all inputs are known or recordings determine the drives.
    F_ior_arcsec: F'_ior of the drives [arcsec], shape (drives, torques); None without samples.
    misfit: misfit of the drives, as for `alike_lines`.
    Raises UntrustedError if a state cannot be trusted.
    """
    torques = drive.operation.M_g
    # drives that agree with a recording have the same error beyond its lines
    is_alike = misfit is not None or len(drives) == 1
    errors = {}
    certificate = samples.certificate if samples else EMPTY
    for k, M_g in enumerate(torques):
        sampled = None if F_ior_arcsec is None else F_ior_arcsec[:, k]
        record = records.get(M_g)
        error = _loaded_error(
            drive,
            M_g,
            drives,
            run,
            alike=is_alike,
            F_ior_arcsec=sampled,
        )
        certificate += error.lines.certificate
        # a recording of the full cycle replaces the samples
        if record and not record.is_part:
            error = _recorded_belief(error.lines, record, run)
        # at a torque without a recording, use the drives that agree with the recordings at other torques
        elif records:
            error = replace(
                error,
                lines=alike_lines(error.lines, run, misfit),
                beyond=float(np.mean(error.beyond)),
                difference=record.difference if record else None,
            )
        elif samples and sampled is not None:
            error = replace(error, stated_arcsec=samples.of_ranges.percentile(0.5, k))
        errors[M_g] = error
    return _fitted_correction(
        drive, errors, form, records, drive.name, samples=samples, misfit=misfit, certificate=certificate
    )


def _recorded_belief(
    lines: ErrorLines,
    record: RecordedError,
    run: Run,
) -> _LoadedError:
    """Return the error of drives that agree with a recording of the full cycle.

    lines: lines of the possible drives.
    record: recording of the full cycle.
    run: the run, whose seed determines the samples.
    """
    visited = record.visited(lines.kinematics) if record.recorded_turns else None
    recorded = with_scale_spread(recorded_lines(lines, record, run), record.scale_uncertainty, run.seed)
    error = _LoadedError(recorded, visited=visited, difference=record.difference)
    return replace(error, F_ior_arcsec=record.F_ior_arcsec or float(error.range_of(error.lines.mean.curves)[0]))


def _fitted_correction(
    drive: Drive | None,
    errors: _ErrorsByTorque,
    form: CorrectionForm,
    records: Mapping[float, RecordedError],
    name: str,
    *,
    samples: Samples | None = None,
    misfit: float | None = None,
    certificate: Certificate = EMPTY,
) -> Correction:
    """Return a correction designed for the first torque, with its residuals at all torques.

    drive: the drive; None for a correction from a recording only.
    errors: errors of the possible drives, by torque [N*m].
    form: requested form.
    records: recordings of the drive, by torque [N*m].
    name: name of the drive or of its recording.
    samples, misfit, certificate: as in `Correction`.
    """
    torques = tuple(errors)
    # the correction is designed for the first torque and tried at the other torques
    design = errors[torques[0]]
    is_recorded = torques[0] in records and misfit is None
    phasors = _phasor_residuals(torques[0], design, is_recorded=is_recorded)
    number = _enough_phasors(phasors)
    # the number of correction terms is chosen unless it is stated
    if not form.turn:
        number = form.points or number
        form = replace(form, points=number)
    chosen = _residuals_of(form, errors, together=True)
    # all drives share one correction unless it makes some of them worse
    is_together = is_recorded or not chosen.is_refused
    forms = _forms_to_compare(form, number, has_loads=len(torques) > 1)
    corrected = _corrected_torques(chosen, torques)
    return Correction(
        drive=drive,
        errors=errors,
        parts=_error_parts(errors),
        forms=tuple(_residuals_of(compared, errors, together=is_together) for compared in forms),
        chosen=chosen,
        corrections={M_g: _exported(chosen, errors, M_g, name) for M_g in corrected},
        fewest_points=_halving_points(design, together=is_recorded),
        phasors=phasors,
        records=records,
        misfit=misfit,
        samples=samples,
        certificate=certificate,
        directions=_direction_residuals(chosen.form, torques[0], design),
        between_directions=_between_directions(design),
    )


def _direction_residuals(
    form: CorrectionForm,
    M_g: float,
    error: _LoadedError,
) -> tuple[DirectionResidual, ...]:
    """Return the residuals of a form in each direction of rotation; empty if the directions are not distinguished.

    M_g: torque of the error [N*m].
    """
    if error.difference is None:
        return ()
    taken = correction_curve(error.corrected(form, M_g, together=True), error.lines.kinematics)
    residuals = _direction_ranges_left(taken, error)
    return tuple(
        DirectionResidual(direction, *percentiles(ranges)) for direction, ranges in zip((1, -1), residuals, strict=True)
    )


def _between_directions(error: _LoadedError) -> ErrorPart | None:
    """Return the range of the difference between the directions, or None if they are not distinguished."""
    if error.difference is None:
        return None
    return ErrorPart("between directions", *percentiles(error.range_of(error.difference.curves)))


def _halving_points(design: _LoadedError, *, together: bool) -> int | None:
    """Return the fewest points of a table over the output revolution that halves an error; None if no number does."""
    residuals = _ranges_by_points("output", design, together=together)
    most_residual = HALVED * design.uncorrected_p50
    return next((points for points, residual in residuals.items() if residual <= most_residual), None)


def _phasor_residuals(
    M_g: float,
    design: _LoadedError,
    *,
    is_recorded: bool,
) -> dict[int, float]:
    """Return the median of the residual range [arcsec] by number of correction terms.

    If the phases are so uncertain that common terms may make the error worse, each drive has its own terms.

    M_g: torque [N*m].
    design: error at this torque.
    is_recorded: whether a recording of the full cycle determines the error.
    """
    # the number of terms must suit the correction that is finally chosen
    phasors = _ranges_by_points(None, design, together=True)
    form = CorrectionForm(None, _enough_phasors(phasors))
    if not is_recorded and _residuals_of(form, {M_g: design}, together=True).is_refused:
        return _ranges_by_points(None, design)
    return phasors


def _forms_to_compare(
    form: CorrectionForm,
    phasors: int,
    *,
    has_loads: bool,
) -> list[CorrectionForm]:
    """Return the usual forms and the requested form, each once.

    form: requested form.
    phasors: number of correction terms in the usual forms.
    has_loads: whether there are several torques.
    """
    usual = [
        CorrectionForm(None, phasors),
        CorrectionForm(
            None,
            phasors,
            each_load=True,
        ),
        *USUAL_TABLES,
    ]
    if not has_loads:
        usual = [candidate for candidate in usual if not candidate.each_load]
    return list(dict.fromkeys([*usual, form]))


def _corrected_torques(chosen: FormResiduals, torques: Sequence[float]) -> list[float]:
    """Return the torques that get a correction [N*m].

    They are the first torque and, if the form has a table for each load, the torques at which the table reduces the
    error.

    chosen: form with its residuals.
    torques: torques of the drive [N*m].
    """
    corrected = [torques[0]]
    if chosen.form.each_load:
        for M_g, residual in zip(torques[1:], chosen.residuals[1:], strict=False):
            # a table is exported only if it reduces the error at its torque
            if residual.p95 < residual.uncorrected_p50:
                corrected.append(M_g)
    return corrected


def _loaded_error(
    drive: Drive,
    M_g: float,
    drives: Sequence[Mapping[str, float]],
    run: Run,
    *,
    alike: bool,
    F_ior_arcsec: Array | None = None,
    solved: int = _SOLVED_DRIVES,
) -> _LoadedError:
    """Return the error of drives at a torque.

    Some drives are solved in each state of their cycle, to determine the part of the error that their lines do not
    contain. This part may be twice as large in one drive as in another. The parts of the solved drives are assigned to
    the other drives in turn.

    drive: the drive.
    M_g: torque [N*m].
    drives: values of the possible drives, by path.
    run: the run.
    alike: whether all drives are so similar that the part of the first drive beyond its lines applies to all of them.
    F_ior_arcsec: F'_ior of the drives [arcsec], shape (drives,); None to determine it from the solved cycles.
    solved: number of drives that are solved.
    Raises UntrustedError if a state cannot be trusted.
    """
    lines = error_lines(drive, M_g, drives, run)
    # the solved drives are spaced evenly
    rows = np.linspace(0, len(drives), 1 if alike else min(solved, len(drives)), endpoint=False).astype(int)
    cycles = []
    certificate = lines.certificate
    for row in rows.tolist():
        cycle, certificate_of_cycle = solved_error(drive.with_values(drives[row]), M_g, run)
        cycles.append(cycle)
        certificate += certificate_of_cycle
    # the part of one solved cycle beyond the lines is the same in all drives
    if alike:
        remainder = cycles[0].apart(replace(lines, amplitude=lines.amplitude[:1]))
        lines = with_more_lines(lines, replace(cycles[0], error_arcsec=remainder).lines(lines.kinematics))
    # lines do not contain fine details, so their range is slightly too small
    scale = _scale_to_cycles(lines, cycles, rows, F_ior_arcsec)
    lines = replace(
        lines,
        amplitude=lines.amplitude * scale[:, None],
        certificate=certificate,
    )
    beyond = [_share_beyond(lines, row, cycle) for row, cycle in zip(rows.tolist(), cycles, strict=True)]
    return _LoadedError(lines, np.resize(beyond, len(drives)))


def _scale_to_cycles(
    lines: ErrorLines,
    cycles: Sequence[RecordedError],
    rows: NDArray[np.int64],
    F_ior_arcsec: Array | None,
) -> Array:
    """Return the factors that give the curves of lines the range of the error, shape (drives,).

    lines: lines of the drives.
    cycles: solved cycles.
    rows: indices of the solved drives.
    F_ior_arcsec: F'_ior of all drives [arcsec]; None to use the solved cycles, and their mean factor for other drives.
    """
    ranges = np.maximum(np.ptp(lines.curves, axis=1), np.finfo(float).tiny)
    # this is the range that all other results state
    if F_ior_arcsec is not None:
        return np.asarray(F_ior_arcsec / ranges)
    solved_ranges = np.array([np.ptp(cycle.error_arcsec) for cycle in cycles])
    scale = np.full(len(ranges), np.mean(solved_ranges / ranges[rows]))
    scale[rows] = solved_ranges / ranges[rows]
    return scale


def _share_beyond(
    lines: ErrorLines,
    row: int,
    cycle: RecordedError,
) -> float:
    """Return the range of the error that a drive's lines do not contain, as a share of the range of these lines.

    lines: lines of all drives.
    row: index of the drive.
    cycle: solved cycle of the drive.
    """
    lines_of_drive = replace(lines, amplitude=lines.amplitude[row : row + 1])
    line_range = max(float(np.ptp(lines_of_drive.curves)), np.finfo(float).tiny)
    return float(np.ptp(cycle.apart(lines_of_drive))) / line_range


def _enough_phasors(left_arcsec: Mapping[int, float]) -> int:
    """Return the smallest number of correction terms with a residual close to that of the best number.

    left_arcsec: median of the residual range [arcsec] by number of correction terms.
    """
    least = min(left_arcsec.values())
    return next(number for number, residual_arcsec in left_arcsec.items() if residual_arcsec <= _ENOUGH * least)


def _exported(
    chosen: FormResiduals,
    errors: _ErrorsByTorque,
    M_g: float,
    preset: str,
) -> CorrectionTable | Phasors:
    """Return the correction of a form for a torque, with its uncertainty.

    If each load has its own table, the table also contains that of the opposite torque.

    chosen: form with its residuals.
    errors: errors by torque [N*m].
    M_g: torque [N*m].
    preset: name of the drive or of its recording.
    """
    form = chosen.form
    lines = errors[M_g].lines
    # a single correction is fitted to the mean error of the drives
    exported = replace(
        form.fitted(lines.mean, M_g),
        preset=preset,
        promised=chosen.residuals,
    )
    if isinstance(exported, Phasors):
        exported = replace(
            exported,
            amplitude_arcsec=exported.amplitude_arcsec[0],
            phase_deg=exported.phase_deg[0],
        )
        return exported if len(lines.amplitude) == 1 else _with_uncertainty(exported, lines)
    # the other direction has its own table
    if form.each_load and -M_g in errors:
        opposite = form.fitted(errors[-M_g].lines.mean, -M_g)
        if isinstance(opposite, CorrectionTable):
            exported = replace(
                exported,
                other_direction_arcsec=opposite.error_arcsec[0],
                other_M_g=-M_g,
            )
    return replace(exported, error_arcsec=exported.error_arcsec[0])


def _with_uncertainty(phasors: Phasors, lines: ErrorLines) -> Phasors:
    """Return correction terms with the uncertainty of their amplitudes and phases, from the spread of the drives.

    phasors: correction terms of the mean error.
    lines: lines of several drives.
    """
    # lines are numbered by their periods per cycle
    per_cycle = np.rint(phasors.per_cam_turn * lines.kinematics.cycle_cam_revolutions)
    vectors = lines.amplitude[:, np.isin(lines.per_cycle, per_cycle)]
    # the spread along the mean vector gives the uncertainty of the amplitude, the spread across it that of the phase
    turned = vectors / np.exp(1j * np.radians(phasors.phase_deg))  # real for lines with the phase of the mean
    phase_rad = turned.imag.std(axis=0) / np.maximum(phasors.amplitude_arcsec, _LEAST_AMPLITUDE)
    return replace(
        phasors,
        amplitude_uncertainty_arcsec=turned.real.std(axis=0),
        phase_uncertainty_deg=np.minimum(np.degrees(phase_rad), _ANY_PHASE_DEG),
    )


def _residuals_of(
    form: CorrectionForm,
    errors: _ErrorsByTorque,
    *,
    together: bool,
) -> FormResiduals:
    """Return the residuals of a form fitted to the errors of all drives together, or to each drive separately."""
    design = next(iter(errors))
    turns = errors[design].lines.kinematics.cycle_cam_revolutions
    fitted = {M_g: error.corrected(form, M_g, together=together) for M_g, error in errors.items()}
    # whole revolutions may be lost if only the input has an absolute encoder
    lost = np.unique(np.linspace(1, max(turns - 1, 1), _LOST_TURNS).astype(int)).tolist()
    # the cases are the correction in place, and errors in its use: a wrong zero and lost revolutions
    cases = [(IN_PLACE, M_g, [0.0]) for M_g in errors]
    cases += [(f"zero {degrees:g} deg off", design, [-degrees / 360, degrees / 360]) for degrees in _ZERO_OFF_DEG]
    cases += [(TURN_LOST, design, lost)]
    residuals = []
    for case, M_g, off_turns in cases:
        # with a correction for each load, each torque has its own
        range_left = ranges_left(fitted[M_g if form.each_load else design], errors[M_g], off_turns)
        residuals.append(ExpectedResidual(M_g, errors[M_g].uncorrected_p50, *percentiles(range_left), case))
    uncorrected = np.maximum(errors[design].ranges, np.finfo(float).tiny)  # shape (drives,)
    share = ranges_left(fitted[design], errors[design])[0] / uncorrected
    return FormResiduals(form, tuple(residuals), percentiles(share))


def ranges_left(
    correction: CorrectionTable | Phasors,
    error: _LoadedError,
    off_turns: Sequence[float] = (0.0,),
) -> Array:
    """Return the residual ranges of an error with a correction, the larger of both directions [arcsec].

    The shape is (offsets, drives).

    correction: the correction.
    error: error of the drives at a torque.
    off_turns: offsets of the zero of the correction [input revolutions].
    """
    taken = correction_curve(correction, error.lines.kinematics)
    by_direction = [_direction_ranges_left(taken, error, off) for off in off_turns]
    return np.asarray(np.max(by_direction, axis=1))


def _direction_ranges_left(
    taken: Array,
    error: _LoadedError,
    off_turns: float = 0.0,
) -> Array:
    """Return the residual ranges over the cycle with a correction, by direction [arcsec], shape (directions, drives).

    The part of the error beyond the lines is not corrected, and its range is added in quadrature.

    taken: error that the correction removes over the cycle [arcsec], shape (..., points).
    error: error of the drives at a torque.
    off_turns: offset of the zero of the correction [input revolutions].
    """
    places = np.arange(error.actual.shape[1]) / error.actual.shape[1]
    # convert the offset to a share of the cycle
    shift = off_turns / error.lines.kinematics.cycle_cam_revolutions
    removed = between_points(taken, places + shift)
    residual_ranges = [error.range_of(curves - removed) for curves in error.by_direction]
    # the part beyond the lines is not corrected, and adds like noise
    return np.asarray(np.hypot(residual_ranges, error.beyond * error.ranges))


def correction_curve(correction: CorrectionTable | Phasors, kinematics: Kinematics) -> Array:
    """Return the error that a correction removes over the full cycle [arcsec], shape (..., points).

    An input revolution has POINTS_A_TURN points.
    """
    turns = kinematics.cycle_cam_revolutions
    if isinstance(correction, CorrectionTable):
        return correction.error_at(np.arange(POINTS_A_TURN * turns) / POINTS_A_TURN)
    per_cycle = np.rint(correction.per_cam_turn * turns).astype(np.int64)
    return ErrorLines(
        kinematics=kinematics, per_cycle=per_cycle, amplitude=np.atleast_2d(correction.vectors), certificate=EMPTY
    ).curves


def _ranges_by_points(
    turn: RepeatTurn | None,
    error: _LoadedError,
    *,
    together: bool = False,
) -> dict[int, float]:
    """Return the median of the residual range [arcsec] by number of points or correction terms.

    turn: revolution that the points of a table cover; None for correction terms.
    error: error of the drives.
    together: whether all drives share one correction; otherwise each drive has its own.
    """
    fitted = {N: error.corrected(CorrectionForm(turn, N), 0.0, together=together) for N in TRIED_POINTS[turn]}
    return {N: percentiles(ranges_left(correction, error)[0])[1] for N, correction in fitted.items()}


def _error_parts(errors: _ErrorsByTorque) -> tuple[ErrorPart, ...]:
    """Return the parts of the error by frequency, and its changes with the size and the direction of the torque."""
    design = next(iter(errors))
    design_lines = errors[design].lines
    # `beats` is the distance of each line from the nearest order of the input
    _, order, beats = line_orders(design_lines)

    def part(name: str, kept: NDArray[np.bool_]) -> ErrorPart:
        curves = replace(design_lines, amplitude=np.where(kept, design_lines.amplitude, 0)).curves
        return ErrorPart(name, *percentiles(np.ptp(curves, axis=1)))

    def change(name: str, sign: int) -> list[ErrorPart]:
        other_torques = [M_g for M_g in errors if M_g != design and np.sign(M_g) == sign * np.sign(design)]
        differences = [np.ptp(errors[M_g].actual - errors[design].actual, axis=1) for M_g in other_torques]
        return [ErrorPart(name, *percentiles(np.max(differences, axis=0)))] if other_torques else []

    slow = order == 0
    with_cam = np.abs(beats) < 1e-6
    return (
        part("with the cam", ~slow & with_cam),
        part("beats", ~slow & ~with_cam),
        part("once an output turn", slow),
        *change("with load", 1),
        *change("with direction", -1),
    )


def percentiles(values: Array) -> tuple[float, float, float]:
    """Return the 5th, 50th and 95th percentiles of equally weighted values."""
    # Weibull's plotting positions do not understate the spread of a few drives
    low, middle, high = np.quantile(values, _REPORTED_SHARES, method="weibull").tolist()
    return low, middle, high


def correction_alone(
    found: Measurement,
    asked: Alignment,
    M_g: float,
    form: CorrectionForm,
    output_turns: str | None = None,
) -> Correction:
    """Return the correction from a recording without a preset.

    A table over the input does not need the sense of the output or the full cycle. For a recording of part of the
    cycle, the table corrects the errors that agree with it (`drawn_errors`).

    found: measurement with a known ratio, in which both directions are combined.
    asked: counting convention of the file.
    M_g: torque of the recording [N*m].
    form: form of the correction.
    output_turns: sense of the output relative to the input, "with" or "against"; None if the recording of two encoders
        shows it.
    Raises UsageError for a table over the output revolution without a known sense, and for output angles with any other
    form than a table over the input. Raises UntrustedError for another form from less than the full cycle.
    """
    is_over_input = form.turn in ("cam", "half-cam")
    kinematics = _kinematics_alone(found, form, output_turns)
    sweep = found.directions[0]
    # a table over the input can use sampled errors that agree with part of the cycle
    is_drawn = is_over_input and (sweep.is_bound or found.is_of_travel)
    if sweep.is_bound and not is_drawn:
        share = f"{100 * sweep.coverage.share:.0f} % of the full cycle" if sweep.coverage else "less than a full cycle"
        message = f"{found.trace.file}: the recording covers {share}, so it does not resolve closely spaced components"
        hint = (
            "record the full mesh cycle, use a table over the input (--form cam), state the travel (--travel DEG), "
            "or use a preset: hdassist compensate PRESET FILE"
        )
        raise UntrustedError(message, hint)
    record = recorded_error(found, kinematics, asked)
    if is_drawn:
        record = replace(record, is_part=True)
        error = _drawn_belief(found, record, kinematics, asked)
    else:
        error = _recorded_belief(_no_lines(kinematics), record, Run(seed=found.seed))
    return _fitted_correction(None, {M_g: error}, form, {M_g: record}, found.trace.file)


def _kinematics_alone(
    found: Measurement,
    form: CorrectionForm,
    output_turns: str | None,
) -> Kinematics:
    """Return the kinematics of a drive from its recording: the ratio, and the sense in which the output rotates.

    The arguments and exceptions are those of `correction_alone`.
    """
    trace = found.trace
    is_over_input = form.turn in ("cam", "half-cam")
    is_by_output = trace.angle_of == "output"
    # a recording of two encoders shows the sense
    way = output_turns or {1: "with", -1: "against"}.get(trace.sense)
    if is_by_output and not way:
        way = "with"  # the input angle is then counted in the sense of the output
    needs_sense = not is_over_input and (is_by_output or (form.turn == "output" and not way))
    if found.gearing is None or needs_sense:
        raise UsageError(
            "the recording does not show whether input and output rotate in the same sense",
            "if the recording contains input angles, use --output-turns: against (circular spline fixed) or with "
            "(flexspline fixed). Otherwise name a preset",
        )
    # with two waves, the wheels differ by two teeth
    moving_teeth = round(2 * found.gearing.ratio)
    if way == "with":
        # with the flexspline fixed, the output rotates with the input
        return Kinematics(moving_teeth - 2, moving_teeth, "flexspline")
    return Kinematics(moving_teeth, moving_teeth + 2, "rigid")


def _no_lines(kinematics: Kinematics) -> ErrorLines:
    """Return an empty set of lines for a drive without a preset."""
    return ErrorLines(
        kinematics=kinematics,
        per_cycle=np.zeros(0, dtype=np.int64),
        amplitude=np.zeros((1, 0), dtype=complex),
        certificate=EMPTY,
    )


def _drawn_belief(
    found: Measurement,
    record: RecordedError,
    kinematics: Kinematics,
    asked: Alignment,
) -> _LoadedError:
    """Return sampled errors that agree with a recording of part of the cycle."""
    drawn = drawn_errors(found, kinematics, asked)
    error = _LoadedError(
        lines=with_scale_spread(drawn.lines, record.scale_uncertainty, found.seed),
        visited=record.visited(kinematics) if found.is_of_travel else None,
        difference=drawn.difference,
    )
    return replace(error, beyond=drawn.beyond_arcsec / np.maximum(error.ranges, np.finfo(float).tiny))


@dataclass(frozen=True)
class VerifiedCorrection:
    """Verification of a correction by a recording with the correction on, at the torque that it is designed for.

    F_ior_arcsec: measured residual F'_ior, from the recorded lines [arcsec].
    interval_arcsec: interval of the measured residual [arcsec]; the upper end is None for a part of the cycle.
    promised: predicted residual.
    promised_parts: predicted parts of the residual; empty for a part of the cycle.
    parts: measured parts of the residual; empty for a part of the cycle.
    cause: likely reason why the residual exceeds the prediction; empty if it does not, or if no reason is found.
    verdict: verdict on the correction.
    """

    F_ior_arcsec: float
    interval_arcsec: tuple[float, float | None]
    promised: ExpectedResidual
    promised_parts: tuple[ErrorPart, ...]
    parts: tuple[ErrorPart, ...]
    cause: str
    verdict: Verdict


def verify(
    result: Correction,
    record: RecordedError,
    run: Run,
) -> VerifiedCorrection:
    """Compare a recording with the correction on with the predicted residual.

    The interval of the measured residual covers the uncertainty from noise. The verdict is PASS if the interval is
    within the predicted residual at 95 %, and FAIL if the whole interval is above it.
    """
    promised = result.chosen.residuals[0]
    error = result.errors[result.M_g]
    lines = recorded_lines(error.lines, record, run)
    residual = _LoadedError(lines, difference=record.difference)
    F_ior_arcsec = residual.mean_range_arcsec
    # 95th percentile of the range over the errors that agree with the noisy readings
    *_, largest = percentiles(residual.ranges)
    # noise may have increased the range, so the lower end is as far below the range as the upper end is above it
    low = max(0.0, 2 * F_ior_arcsec - largest)
    # a part of the cycle gives a lower bound only
    high = None if record.is_part else largest
    verdict = _verdict_of(low, high, promised.p95)
    correction = correction_curve(result.correction, error.lines.kinematics).reshape(-1)
    promised_parts: tuple[ErrorPart, ...] = ()
    parts: tuple[ErrorPart, ...] = ()
    if not record.is_part:
        promised_parts = _error_parts({result.M_g: replace(error, lines=_corrected_lines(error.lines, correction))})
        parts = _error_parts({result.M_g: replace(error, lines=lines)})
    cause = _likely_cause(error.actual.mean(axis=0), correction, record, lines) if verdict is Verdict.FAIL else ""
    return VerifiedCorrection(
        F_ior_arcsec=F_ior_arcsec,
        interval_arcsec=(low, high),
        promised=promised,
        promised_parts=promised_parts,
        parts=parts,
        cause=cause,
        verdict=verdict,
    )


def _corrected_lines(lines: ErrorLines, correction: Array) -> ErrorLines:
    """Return the lines of the residual with a correction over the full cycle [arcsec], shape (points,)."""
    # convert the curve to amplitudes of its lines
    spectrum = np.fft.rfft(correction)[lines.per_cycle] * (2 / len(correction))
    return replace(lines, amplitude=lines.amplitude + spectrum)


def _verdict_of(
    low: float,
    high: float | None,
    limit: float,
) -> Verdict:
    """Return the verdict on an interval: PASS if it is within a limit, FAIL if it is above the limit.

    low, high: ends of the interval; high is None without an upper end.
    """
    # the whole interval must lie on one side of the limit, so that noise alone cannot decide the verdict
    if high is not None and high <= limit:
        return Verdict.PASS
    return Verdict.FAIL if low > limit else Verdict.INCONCLUSIVE


def _likely_cause(
    before: Array,
    taken: Array,
    record: RecordedError,
    lines: ErrorLines,
) -> str:
    """Return the fault of the applied correction that explains a recording best, as text; empty if no fault does.

    A fault is a flipped sign, a wrong zero, or a correction that is not on. The sum of squares of the unexplained
    difference is computed from correlations, for all offsets of the zero at once.
    before: error before the correction over the full cycle [arcsec], shape (points,).
    taken: intended correction over the full cycle [arcsec], shape (points,).
    record: recording after the correction.
    lines: lines of the recording.
    """
    count = len(taken)
    points = record.points(lines)
    # correction that was actually applied, at the readings
    applied = before[points] + record.error_arcsec  # F_kpp has the opposite sign of the actual error
    applied -= applied.mean()

    def correlation(readings: Array, curve: Array) -> Array:
        """Return the sum of the readings times the shifted curve, for each offset of the zero, shape (points,)."""
        # one product of spectra gives the sums for all offsets of the zero
        spectrum = np.fft.rfft(np.bincount(points, readings, count))
        return np.fft.irfft(np.conj(spectrum) * np.fft.rfft(curve), count)

    product = correlation(applied, taken)
    power = correlation(np.ones(len(points)), taken**2)
    # the rows are the correction as intended, with its sign flipped, and not on
    # |applied - (+/-) taken|^2 is the sum of three terms; if the correction is not on, taken is 0
    squares = applied @ applied + np.stack([power - 2 * product, power + 2 * product, 0 * power])
    # no cause is named if no sign and zero explain most of the difference from the intended correction
    if squares.min() > _EXPLAINED_RMS_SHARE**2 * squares[0, 0]:
        return ""
    offsets = np.fft.fftfreq(count, 1 / count)  # offsets of the zero in points, positive and negative
    candidates = np.argwhere(squares <= _ALIKE * squares.min()).tolist()
    # among equally good explanations, the zero nearest to its intended position is chosen
    row, point = min(candidates, key=lambda candidate: (abs(offsets[candidate[1]]), candidate[0]))
    return _cause_text(row, float(offsets[point]) / POINTS_A_TURN)


def _cause_text(row: int, off_turns: float) -> str:
    """Return the description of a cause; empty if the correction is applied as intended.

    row: 0 for the intended sign, 1 for the flipped sign, 2 if the correction is not on.
    off_turns: offset of the zero [input revolutions].
    """
    if row == 2:
        return "the correction is not active"
    turns = round(off_turns)
    off_deg = 360 * (off_turns - turns)
    causes = []
    if row == 1:
        causes.append("the sign of the correction is wrong")
    if abs(off_deg) > _IN_ZERO_DEG:
        causes.append(f"the zero of the correction is off by {abs(off_deg):.0f}° of input rotation")
    if turns:
        causes.append(f"{abs(turns)} input revolutions are lost")
    return ", ".join(causes)


# Residual of a correction in each position of the fixed wheel


def advice_corrected(
    advice: Advice,
    form: CorrectionForm,
    draws: int,
    run: Run,
) -> Advice:
    """Return the advice based on the residual of a correction that is made in each position and for each torque.

    The error of each drive in a position is that of its own lines there, as if it were recorded there, including the
    part beyond these lines. If the residuals do not distinguish any hole from another, the decision remains that
    without a correction.

    advice: advice without a correction.
    form: form of the correction.
    draws: number of equally weighted drives from the samples of the advice.
    run: the run.
    """
    # the decision is made in the same way, from the residual in place of F'_ior
    choice = advice.decision
    # if no hole is better without a correction, none is better with one
    if choice.all_alike:
        return advice
    drives = [dict[str, float]()]
    if choice.is_sampled and advice.samples:
        drives = advice.samples.of_ranges.equal_drives(draws)
    rotations = sorted({0.0, *choice.rotations_deg})
    residuals, certificate = _residuals_in_positions(advice, drives, rotations, form, run)
    columns = [rotations.index(rotation) for rotation in choice.rotations_deg]
    decision = Decision(
        rotations_deg=choice.rotations_deg,
        F_ior_arcsec=residuals[..., columns],
        now_arcsec=residuals[..., rotations.index(0.0)],
        sample_weights=np.ones(len(drives)),
        room_arcsec=(),
        cost=choice.cost,
    )
    curve = advice.curve and replace(advice.curve, certificate=advice.curve.certificate + certificate)
    advice = replace(
        advice,
        curve=curve,
        compensated=(form.name, decision),
    )
    return advice if decision.word(advice.sure) == "ANY_HOLE" else replace(advice, decision=decision, value=None)


def _residuals_in_positions(
    advice: Advice,
    drives: Sequence[dict[str, float]],
    rotations: Sequence[float],
    form: CorrectionForm,
    run: Run,
) -> tuple[Array, Certificate]:
    """Return the residuals of drives in positions [arcsec], shape (torques, drives, positions), and their certificate.

    drives: values by path.
    rotations: rotations of the fixed wheel [deg], shape (positions,).
    """
    drive = advice.drive
    certificate = EMPTY
    residuals = []
    for rotation_deg in rotations:
        rotated_drives = []
        for values in drives:
            # rotate the deviations that turn with the fixed wheel
            rotated = {path: values.get(path, drive.number(path)) + rotation_deg for path in carried(drive)}
            rotated_drives.append(values | rotated)
        for M_g in advice.torques:
            error = _loaded_error(
                drive,
                M_g,
                rotated_drives,
                run,
                alike=len(drives) == 1,
                solved=_SOLVED_A_POSITION,
            )
            certificate += error.lines.certificate
            residuals.append(ranges_left(form.fitted(error.lines, M_g), error)[0])
    by_position = np.reshape(residuals, (len(rotations), -1, len(drives)))
    return by_position.transpose(1, 2, 0), certificate


def corrected_states(
    drive: Drive,
    positions: int,
    draws: int,
) -> int:
    """Return the approximate number of states that `advice_corrected` solves, for the progress bar."""
    cycle = Kinematics.of(drive).cycle_states
    return len(drive.operation.M_g) * positions * (cycle + max(1, draws) * WAVE_POINTS**2)
