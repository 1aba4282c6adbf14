"""A measured trace beside the drive's own error: difference, orders, and which deviation would explain it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hdassist.comparing.doubt import doubtful_waves
from hdassist.comparing.findings import BY_CHANCE, TOLD, Conclusion, Explanation, conclude, explanation
from hdassist.comparing.fit import VectorFit, VectorFitter
from hdassist.comparing.record import CHI_SQUARE_CLEAR, Alignment, OrderPair, Record, rms, solved_curve
from hdassist.comparing.vectors import VECTORS, with_vectors
from hdassist.error.error_map import extremes_of
from hdassist.error.waves import Complex, ErrorWaves
from hdassist.errors import UsageError
from hdassist.measuring.fit import curve_of
from hdassist.measuring.measure import DRIFT_LEFT, Measurement, SweepResult, drift_of, measure
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.preset.fields import Drive
from hdassist.readers.trace import MeasuredTrace
from hdassist.solve.answers import EMPTY, Certificate, Progress

MIRRORED = 0.5  # of the chi-square: a file read the other way round that leaves less than that is worth a word
SCREEN = 0.5  # of a clear gain: what slopes alone must promise for deviations to be looked at
POLISHED = 2.0  # times the least chi-square: fits up to that are finished on the fine torus
LEFT = 3  # orders that are named of what is left
UNTOLD = 360.0  # deg: standard uncertainty of an angle that the record does not tell

Swap = Literal["error_is", "cam_sense", "both"]


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
class Mirror:
    """The other way round a file fits clearly better: what of it is swapped, and rms of the difference then."""

    swapped: Swap
    rms_arcsec: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """A measured trace beside what a drive should do.

    M_g [N*m]; convention: how the file was read; found: the measured side; unchanged: the drive as it is, with the
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
    mirror: Mirror | None
    certificate: Certificate
    warnings: tuple[str, ...]

    @property
    def found(self) -> SweepResult:
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


def estimate_states() -> int:
    """States that the fits of a comparison solve, about, for a progress bar."""
    return 200_000


def compare(
    trace: MeasuredTrace,
    drive: Drive,
    M_g: float,
    *,
    convention: RecordConvention | None = None,
    orders: Sequence[float] | None = None,
    drift: str = "none",
    stated: Mapping[str, float] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Comparison:
    """Compare a measured trace with a drive at a torque M_g [N*m].

    Arguments: convention, how the file counts; orders per cam turn to keep (None: 1 to 12); drift to take off: none,
    linear or quadratic; stated, standard uncertainties of F'_ior [arcsec] by source; seed of the bootstrap; progress,
    told how many states were solved. Both directions count as one, each with its own level: the model knows no
    friction. Raises UsageError for rolling balls and for orders, drift or sources that cannot be meant; UntrustedError
    where the record does not tell its orders apart, or an answer cannot be trusted.
    """
    convention = convention or RecordConvention()
    torus = ErrorWaves(drive, M_g, progress)
    measurement = measure(trace, drive=drive, orders=orders, drift=drift, stated=stated, seed=seed, together=True)
    found = measurement.directions[0]
    record = Record(found, torus, Kinematics.of(drive))
    free_start, free_zero = convention.start_deg is None, convention.zero_deg is None

    def doubted(fit: VectorFit) -> Complex:
        there = with_vectors(drive, fit.vectors, fit.free.vectors)
        return doubtful_waves(there, M_g, torus, progress)

    changes = doubtful_waves(drive, M_g, torus, progress)
    sure = VectorFitter(drive, record, torus, start=free_start, zero=free_zero)
    fitter, base = sure.doubting(changes, alignment_of(trace, drive, convention))
    record = fitter.record
    now = explanation(base, base, record, drive)
    others = {} if now.sufficient else _mirrored(trace, sure, changes, base)
    singles, joint, mirror = _explanations(drive, fitter, base, now, others, doubted)

    # every range and every rest from solved states
    solved = _SolvedStates(drive, M_g)
    difference = found.bins.error - solved.curve(drive, found.bins.turns, base.alignment)
    design = record.design
    apart, level, drift_terms = design.split(design.project(lambda rows: difference[rows, None])[:, 0])
    residual = difference - (level[found.bins.sweep] + design.drift_at(drift_terms, found.bins.travel))
    # a drift that the prediction has too, a beat that the record does not resolve, is none
    slope = 0.0 if len(drift_terms) else drift_of(design, design.rest(difference[:, None])[:, 0], found.range.value)
    predicted = record.measured - apart
    curve = curve_of(apart, found.fit.orders, found.grid_turns)
    worst = int(np.abs(curve).argmax())
    now = replace(now, F_ior_arcsec=solved.F_ior(drive))
    best = min(singles, key=lambda single: single.chi_square, default=now)
    singles = [_solved_again(single, record, solved, curve=single.vectors == best.vectors) for single in singles]
    joint = joint and _solved_again(joint, record, solved, curve=True)
    return Comparison(
        drive=drive,
        measurement=measurement,
        M_g=M_g,
        convention=convention,
        unchanged=now,
        start_uncertainty_deg=_angle_uncertainty(base, 0, now) if free_start else None,
        zero_uncertainty_deg=_angle_uncertainty(base, int(free_start), now) if free_zero else None,
        predicted_arcsec=found.fit.curve(found.bins.turns) + found.fit.residual - residual,
        residual_arcsec=residual,
        orders=record.pairs(predicted, apart),
        predicted_range_arcsec=float(np.ptp(curve_of(predicted, found.fit.orders, found.grid_turns))),
        difference_range_arcsec=float(np.ptp(curve)),
        difference_rms_arcsec=rms(apart),
        largest_arcsec=float(curve[worst]),
        largest_at_turns=float(found.grid_turns[worst]),
        singles=tuple(singles),
        joint=joint,
        conclusion=conclude(now, singles, joint, mirrored=mirror is not None),
        mirror=mirror,
        certificate=solved.certificate + torus.certificate,
        warnings=(*measurement.warnings, *([DRIFT_LEFT.format(slope)] if slope else [])),
    )


def _explanations(
    drive: Drive,
    fitter: VectorFitter,
    base: VectorFit,
    now: Explanation,
    mirrored: Mapping[Swap, tuple[VectorFitter, VectorFit]],
    doubted: Callable[[VectorFit], Complex],
) -> tuple[list[Explanation], Explanation | None, Mirror | None]:
    """What would explain the difference: each vector alone, all together, or the file read the other way round.

    doubted: by what the waves of a drive with a fit's deviations change, see doubtful_waves.
    """
    record = fitter.record
    usual = now.chi_square <= now.freedom + np.sqrt(2 * now.freedom)
    if now.sufficient and usual and fitter.gains(base).max() < SCREEN * BY_CHANCE:
        return [], None, None
    mirror, other = None, base
    if mirrored:
        swapped, (reader, other) = min(mirrored.items(), key=lambda each: each[1][1].chi_square)
        mirror = Mirror(swapped, reader.left_arcsec(other))
        if record.within_noise(other.chi_square, base.free.count):
            return [], None, mirror
    fits = [fitter.single(k, base) for k in range(len(VECTORS))]
    good = POLISHED * min(fit.chi_square for fit in fits)
    fits = [fitter.polished(fit) if fit.chi_square <= good else fit for fit in fits]
    best = int(np.argmin([fit.chi_square for fit in fits]))
    fits[best] = fitter.profiled(fits[best])
    fits[best] = fitter.bent(fits[best], doubted(fits[best]))
    singles = [explanation(fit, base, record, drive) for fit in fits]
    if other.chi_square > min(MIRRORED * base.chi_square, *(single.chi_square for single in singles)):
        mirror = None
    if conclude(now, singles, None, mirrored=mirror is not None).kind in ("agrees", "mirrored"):
        return singles, None, mirror
    together = fitter.joint(min(fits, key=lambda fit: fit.chi_square))
    together = fitter.bent(together, doubted(together))
    return singles, explanation(together, base, record, drive), mirror


def _mirrored(
    trace: MeasuredTrace, fitter: VectorFitter, changes: Complex, base: VectorFit
) -> dict[Swap, tuple[VectorFitter, VectorFit]]:
    """The file with its signs swapped: by what is swapped, the fit and who made it."""
    here = base.alignment
    ways: dict[Swap, Alignment] = {"cam_sense": replace(here, sense=-here.sense)}
    if not trace.sense:
        ways |= {"error_is": replace(here, sign=-here.sign), "both": replace(here, sign=-here.sign, sense=-here.sense)}
    return {swapped: fitter.doubting(changes, alignment) for swapped, alignment in ways.items()}


class _SolvedStates:
    """Errors from solved states, of a drive and others with other deviations; certificate: of all states so far."""

    def __init__(self, drive: Drive, M_g: float) -> None:
        self.drive, self._M_g = drive, M_g
        self.certificate = EMPTY

    def F_ior(self, drive: Drive) -> float:
        """F'_ior [arcsec] over the full cycle."""
        (found,) = extremes_of(drive, [self._M_g])
        self.certificate += found.certificate
        return found.first

    def curve(self, drive: Drive, turns: Array, alignment: Alignment) -> Array:
        """Error as the file has it [arcsec], up to a constant, at the rig's cam angles [turns]."""
        values, certificate = solved_curve(drive, self._M_g, turns, alignment)
        self.certificate += certificate
        return values


def _solved_again(found: Explanation, record: Record, solved: _SolvedStates, *, curve: bool) -> Explanation:
    """An explanation with its F'_ior and, where curve, with what it leaves of the record, from solved states."""
    if not found.overrides:
        return found
    there = solved.drive.with_values(dict(found.overrides))
    found = replace(found, F_ior_arcsec=solved.F_ior(there))
    if not curve:
        return found
    left = record.measured - record.of_curve(solved.curve(there, record.found.bins.turns, found.alignment))
    pairs = record.pairs(left, left)
    clear = [pair for pair in pairs if pair.difference_arcsec > CHI_SQUARE_CLEAR * pair.difference_uncertainty_arcsec]
    greatest = sorted(clear, key=lambda pair: -pair.difference_arcsec)[:LEFT]
    return replace(found, left_arcsec=rms(left), left_orders=tuple(greatest))


def _angle_uncertainty(base: VectorFit, row: int, now: Explanation) -> float:
    """Standard uncertainty [deg] of a fitted angle of the alignment, the unknown in a row."""
    if (base.blind[row] ** 2).sum() > TOLD:
        return UNTOLD
    scale = max(1.0, now.chi_square / now.freedom)
    return float(np.sqrt(scale * base.covariance()[row, row]))
