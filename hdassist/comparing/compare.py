"""A measured trace beside the drive's own error: difference, orders, and which deviation would explain it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from hdassist.comparing.doubt import doubtful_waves
from hdassist.comparing.findings import BLIND_SHARE, CLEAR_GAIN, Conclusion, Explanation, conclude, explanation
from hdassist.comparing.fit import VectorFit, VectorFitter
from hdassist.comparing.record import CHI_SQUARE_CLEAR, Alignment, OrderPair, RecordedOrders, rms, solved_curve
from hdassist.comparing.vectors import VECTORS
from hdassist.error.error_map import extremes_of
from hdassist.error.waves import Complex, ErrorWaves
from hdassist.errors import UsageError
from hdassist.measuring.fit import curve_of
from hdassist.measuring.measure import DRIFT_LEFT, Measurement, SweepResult, drift_of, measure
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.preset.fields import Drive
from hdassist.readers.trace import MeasuredTrace
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate

MIRRORED = 0.5  # of the chi-square: a file read the other way round that leaves less is reported
SCREEN = 0.5  # of a clear gain: least gain to first order for which deviations are fitted
POLISHED = 2.0  # times the least chi-square: fits up to that are continued on the fine torus
RESIDUAL_ORDERS = 3  # orders of a residual that are named
UNIDENTIFIABLE_ANGLE = 360.0  # deg: standard uncertainty of an angle that is not identifiable
FIT_STATES = 200_000  # that the fits of a comparison solve, about

SwappedSigns = Literal["error_is", "cam_sense", "both"]


@dataclass(frozen=True)
class RecordConvention:
    """How the angles and errors of a file count.

    start_deg, zero_deg: alignment of the record, None to fit them; error_is: "cam-output", F_kpp as `hdassist trace`
    writes it, or "output-cam"; cam_sense: "ccw" or "cw", seen from the cam side.
    """

    start_deg: float | None = None
    zero_deg: float | None = 0.0
    error_is: str = "cam-output"
    cam_sense: str = "ccw"


@dataclass(frozen=True)
class MirroredFile:
    """The other way round a file fits clearly better: what of it is swapped, and rms of the difference then."""

    swapped: SwappedSigns
    rms_arcsec: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """A measured trace beside what a drive should do.

    M_g [N*m]; convention: how the file was read; unchanged: the drive as it is, with the
    alignment of the record; standard uncertainties of that [deg], None where it was given; predicted_arcsec at the
    bins, levels and drift as the residual has none; residual_arcsec at the bins; orders, measured and predicted; ranges
    [arcsec] limited to the orders over the angles visited; singles: one explanation of each vector; joint; both none
    where nothing is called for.
    """

    drive: Drive
    measurement: Measurement
    M_g: float
    convention: RecordConvention
    unchanged: Explanation
    start_uncertainty_deg: float | None
    zero_uncertainty_deg: float | None
    predicted_arcsec: Array
    residual_arcsec: Array
    orders: tuple[OrderPair, ...]
    predicted_range_arcsec: float
    difference_range_arcsec: float
    difference_rms_arcsec: float
    largest_arcsec: float
    largest_at_turns: float
    singles: tuple[Explanation, ...]
    joint: Explanation | None
    conclusion: Conclusion
    mirror: MirroredFile | None
    certificate: Certificate
    warnings: tuple[str, ...]

    @property
    def sweep(self) -> SweepResult:
        """The measured side, both directions as one."""
        return self.measurement.directions[0]


def torque_of(drive: Drive) -> float:
    """Torque [N*m] of a comparison: the preset's only one. Raises UsageError where it has several."""
    if len(drive.operation.M_g) > 1:
        several = ", ".join(f"{M_g:g}" for M_g in drive.operation.M_g)
        raise UsageError(f"{drive.name} has several torques: {several}", "say which was on the rig: --torque")
    return drive.operation.M_g[0]


def zero_of(trace: MeasuredTrace, drive: Drive, start_deg: float | None) -> float | None:
    """Zero [deg] of a record where none is stated, None to fit it.

    A cam angle counts as phi_h; an angle of the output says phi_h where it is known how the output stands at phi_h = 0.
    """
    if trace.angle_of == "cam":
        return 0.0
    return None if start_deg is None else -Kinematics.of(drive).u * start_deg


def alignment_of(trace: MeasuredTrace, drive: Drive, convention: RecordConvention) -> Alignment:
    """Where the record stands, fitted angles 0, and how it counts. Raises UsageError for what cannot be."""
    direct = Kinematics.of(drive).u > 0
    sense = 1.0 if convention.cam_sense == "ccw" else -1.0
    if trace.angle_of == "output" and not direct:
        sense = -sense  # the cam turns against the output
    if trace.sense:
        if convention.error_is != "cam-output":
            raise UsageError("two encoders tell the sign of the error", "leave out --error-is")
        # the output's encoder counts as the model's angles do, or the other way
        sign = -trace.sense * sense * (1.0 if direct else -1.0)
    else:
        sign = 1.0 if convention.error_is == "cam-output" else -1.0
    return Alignment(np.radians(convention.start_deg or 0.0), np.radians(convention.zero_deg or 0.0), sign, sense)


def compare(
    trace: MeasuredTrace,
    drive: Drive,
    M_g: float,
    *,
    convention: RecordConvention | None = None,
    orders: Sequence[float] | None = None,
    drift: str = "none",
    stated: Mapping[str, float] | None = None,
    run: Run = Run(),
) -> Comparison:
    """Compare a measured trace with a drive at a torque M_g [N*m].

    Arguments: convention, how the file counts; orders per cam turn to keep (None: 1 to 12); drift to take off: none,
    linear or quadratic; stated, standard uncertainties of F'_ior [arcsec] by source. Both directions count as one, each
    with its own level: the model knows no friction. Raises UsageError for rolling balls and for invalid orders, drift
    or sources; UntrustedError where the record does not tell its orders apart, or an answer cannot be trusted.
    """
    convention = convention or RecordConvention()
    torus = ErrorWaves(drive, M_g, run)
    measurement = measure(trace, drive=drive, orders=orders, drift=drift, stated=stated, seed=run.seed, together=True)
    sweep = measurement.directions[0]
    free_start, free_zero = convention.start_deg is None, convention.zero_deg is None
    doubt = partial(doubtful_waves, M_g=M_g, torus=torus, run=run)
    changes = doubt(drive)
    record = RecordedOrders(sweep, torus, Kinematics.of(drive))
    certain = VectorFitter(drive, record, torus, doubt, start=free_start, zero=free_zero)
    fitter, base = certain.doubting(changes, alignment_of(trace, drive, convention))
    record = fitter.record
    unchanged = explanation(base, base, record, drive)
    mirrored = {} if unchanged.sufficient else _mirrored(trace, certain, changes, base)
    singles, joint, mirror = _explanations(drive, fitter, base, unchanged, mirrored)

    # every range and every residual from solved states
    solved = _SolvedStates(drive, M_g)
    curve = solved.curve(drive, sweep.bins.turns, base.alignment)
    difference, residual, slope = _difference(sweep, sweep.bins.error - curve)
    predicted = record.measured - difference  # (2 orders,)
    difference_curve = curve_of(difference, sweep.fit.orders, sweep.grid_turns)
    largest = int(np.abs(difference_curve).argmax())
    unchanged = replace(unchanged, F_ior_arcsec=solved.F_ior(drive))
    best = min(singles, key=lambda single: single.chi_square, default=unchanged)
    singles = [_solved_again(single, record, solved, curve=single.vectors == best.vectors) for single in singles]
    joint = joint and _solved_again(joint, record, solved, curve=True)
    return Comparison(
        drive=drive,
        measurement=measurement,
        M_g=M_g,
        convention=convention,
        unchanged=unchanged,
        start_uncertainty_deg=_angle_uncertainty(base, 0, unchanged) if free_start else None,
        zero_uncertainty_deg=_angle_uncertainty(base, int(free_start), unchanged) if free_zero else None,
        predicted_arcsec=sweep.fit.curve(sweep.bins.turns) + sweep.fit.residual - residual,
        residual_arcsec=residual,
        orders=record.pairs(predicted, difference),
        predicted_range_arcsec=float(np.ptp(curve_of(predicted, sweep.fit.orders, sweep.grid_turns))),
        difference_range_arcsec=float(np.ptp(difference_curve)),
        difference_rms_arcsec=rms(difference),
        largest_arcsec=float(difference_curve[largest]),
        largest_at_turns=float(sweep.grid_turns[largest]),
        singles=tuple(singles),
        joint=joint,
        conclusion=conclude(unchanged, singles, joint, mirrored=mirror is not None),
        mirror=mirror,
        certificate=solved.certificate + torus.certificate,
        warnings=(*measurement.warnings, *([DRIFT_LEFT.format(slope)] if slope else [])),
    )


def _difference(sweep: SweepResult, apart: Array) -> tuple[Array, Array, float]:
    """Measured less predicted values at the bins [arcsec], shape (bins,), split into what orders and levels have of it.

    Returns coefficients of its orders, shape (2 orders,); the values without level and drift, shape (bins,); the slope
    of a drift in it that was not taken off, 0 where there is none: a drift of the prediction, too, is a beat.
    """
    design = sweep.fit.design
    orders, level, drift = design.split(design.project(lambda rows: apart[rows, None])[:, 0])
    residual = apart - (level[sweep.bins.sweep] + design.drift_at(drift, sweep.bins.travel))
    slope = 0.0 if len(drift) else drift_of(design, design.rest(apart[:, None])[:, 0], sweep.range.value)
    return orders, residual, slope


def _explanations(
    drive: Drive,
    fitter: VectorFitter,
    base: VectorFit,
    unchanged: Explanation,
    mirrored: Mapping[SwappedSigns, tuple[VectorFitter, VectorFit]],
) -> tuple[list[Explanation], Explanation | None, MirroredFile | None]:
    """Explanations of the difference: each vector alone, all together, or the file read the other way round."""
    record = fitter.record
    usual = unchanged.chi_square <= unchanged.freedom + np.sqrt(2 * unchanged.freedom)
    if unchanged.sufficient and usual and fitter.linear_gains(base).max() < SCREEN * CLEAR_GAIN:
        return [], None, None
    mirror, other = None, base
    if mirrored:
        swapped, (reader, other) = min(mirrored.items(), key=lambda each: each[1][1].chi_square)
        mirror = MirroredFile(swapped, reader.residual_rms_arcsec(other))
        if record.within_noise(other.chi_square, len(base.free)):
            return [], None, mirror
    fits = [fitter.single(k, base) for k in range(len(VECTORS))]
    good = POLISHED * min(fit.chi_square for fit in fits)
    fits = [fitter.refined(fit) if fit.chi_square <= good else fit for fit in fits]
    best = int(np.argmin([fit.chi_square for fit in fits]))
    fits[best] = fitter.with_shift(fitter.profiled(fits[best]))
    singles = [explanation(fit, base, record, drive) for fit in fits]
    if other.chi_square > min(MIRRORED * base.chi_square, *(single.chi_square for single in singles)):
        mirror = None
    if conclude(unchanged, singles, None, mirrored=mirror is not None).kind in ("agrees", "mirrored"):
        return singles, None, mirror
    joint = fitter.with_shift(fitter.refined(min(fits, key=lambda fit: fit.chi_square), range(len(VECTORS))))
    return singles, explanation(joint, base, record, drive), mirror


def _mirrored(
    trace: MeasuredTrace, fitter: VectorFitter, changes: Complex, base: VectorFit
) -> dict[SwappedSigns, tuple[VectorFitter, VectorFit]]:
    """Fits of the drive as it is to the file with its signs swapped, each with its fitter."""
    own = base.alignment
    ways: dict[SwappedSigns, Alignment] = {"cam_sense": replace(own, sense=-own.sense)}
    if not trace.sense:
        ways |= {"error_is": replace(own, sign=-own.sign), "both": replace(own, sign=-own.sign, sense=-own.sense)}
    return {swapped: fitter.doubting(changes, alignment) for swapped, alignment in ways.items()}


class _SolvedStates:
    """Errors from solved states, of a drive and others with other deviations; certificate: of all states so far."""

    def __init__(self, drive: Drive, M_g: float) -> None:
        self.drive, self._M_g = drive, M_g
        self.certificate = EMPTY

    def F_ior(self, drive: Drive) -> float:
        """F'_ior [arcsec] over the full cycle."""
        (extremes,) = extremes_of(drive, [self._M_g])
        self.certificate += extremes.certificate
        return extremes.first

    def curve(self, drive: Drive, turns: Array, alignment: Alignment) -> Array:
        """Error as the file has it [arcsec], up to a constant, at the rig's cam angles [turns]."""
        values, certificate = solved_curve(drive, self._M_g, turns, alignment)
        self.certificate += certificate
        return values


def _solved_again(found: Explanation, record: RecordedOrders, solved: _SolvedStates, *, curve: bool) -> Explanation:
    """An explanation with its F'_ior and, where curve, with its residual within the orders, from solved states."""
    if not found.overrides:
        return found
    drive = solved.drive.with_values(dict(found.overrides))
    found = replace(found, F_ior_arcsec=solved.F_ior(drive))
    if not curve:
        return found
    residual = record.measured - record.of_curve(solved.curve(drive, record.sweep.bins.turns, found.alignment))
    pairs = sorted(record.pairs(residual, residual), key=lambda pair: -pair.difference_arcsec)
    clear = [p for p in pairs if p.difference_arcsec > CHI_SQUARE_CLEAR * p.difference_uncertainty_arcsec]
    return replace(found, residual_rms_arcsec=rms(residual), residual_orders=tuple(clear[:RESIDUAL_ORDERS]))


def _angle_uncertainty(base: VectorFit, row: int, unchanged: Explanation) -> float:
    """Standard uncertainty [deg] of a fitted angle of the alignment, by its row among the free unknowns."""
    if (base.unidentifiable[row] ** 2).sum() > BLIND_SHARE:
        return UNIDENTIFIABLE_ANGLE
    return float(np.sqrt(unchanged.excess * base.covariance[row, row]))
