"""A measured trace beside the drive's own error: difference, orders, and which deviation would explain it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hdassist.comparing.comparison import Comparison, Explanation, Mirror, OrderPair
from hdassist.comparing.findings import BY_CHANCE, TOLD, conclude, explanation, values
from hdassist.comparing.fit import VectorFit, VectorFitter
from hdassist.comparing.record import CLEAR, Place, Record
from hdassist.comparing.solvedrecord import solved_curve
from hdassist.comparing.vectors import VECTORS
from hdassist.error.cycle import kinematic_error
from hdassist.error.search import CycleSearch, worth_searching
from hdassist.error.waves import ErrorWaves
from hdassist.errors import UsageError
from hdassist.measuring.design_matrix import CHUNK, waves
from hdassist.measuring.measure import DRIFT_LEFT, drift_left, measure
from hdassist.measuring.measurement import Direction, Measurement
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.preset.fields import Drive
from hdassist.readers.trace import MeasuredTrace
from hdassist.solve.answers import Certificate, Progress

MIRRORED = 0.5  # of the chi-square: a file read the other way round that leaves less than that is worth a word
SCREEN = 0.5  # of a clear gain: what slopes alone must promise for deviations to be looked at
POLISHED = 2.0  # times the least chi-square: fits up to that are finished on the fine torus
LEFT = 3  # orders that are named of what is left
WORK = 200_000  # states of the fits, about, for a progress bar


@dataclass(frozen=True)
class Reading:
    """How a file is to be read.

    start_deg, zero_deg: place of the record, None to fit them (Place); error_is: "cam-output", F_kpp as
    `hdassist trace` writes it, or "output-cam"; cam_sense: "ccw" or "cw", seen from the cam side.
    """

    start_deg: float | None = None
    zero_deg: float | None = 0.0
    error_is: str = "cam-output"
    cam_sense: str = "ccw"


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


def place_of(trace: MeasuredTrace, drive: Drive, reading: Reading) -> Place:
    """Where the record stands and how it counts, fitted angles 0. Raises UsageError for a reading that cannot be."""
    direct = Kinematics.of(drive).u > 0
    sense = 1.0 if reading.cam_sense == "ccw" else -1.0
    if trace.angle_of == "output" and not direct:
        sense = -sense  # the cam turns against the output
    if trace.sense:
        if reading.error_is != "cam-output":
            raise UsageError("two encoders tell the sign of the error", "leave out --error-is")
        # the output's encoder counts as the model's angles do, or the other way
        sign = -trace.sense * sense * (1.0 if direct else -1.0)
    else:
        sign = 1.0 if reading.error_is == "cam-output" else -1.0
    return Place(np.radians(reading.start_deg or 0.0), np.radians(reading.zero_deg or 0.0), sign, sense)


def compare(
    trace: MeasuredTrace,
    drive: Drive,
    M_g: float,
    *,
    reading: Reading | None = None,
    orders: str | None = None,
    drift: str = "none",
    stated: Mapping[str, float] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Comparison:
    """Compare a measured trace with a drive at a torque M_g [N*m].

    Arguments: reading, how the file counts; orders, drift, stated and seed as in measure; progress, told how many
    states were solved. Both directions count as one, each with its own level: the model knows no friction.
    Raises what measure raises; UsageError for rolling balls; UntrustedError where an answer cannot be trusted.
    """
    reading = reading or Reading()
    torus = ErrorWaves(drive, M_g, progress)
    measurement = measure(trace, drive=drive, orders=orders, drift=drift, stated=stated, seed=seed, together=True)
    record = Record(measurement.directions[0], torus, Kinematics.of(drive))
    fitter = VectorFitter(drive, record, torus, start=reading.start_deg is None, zero=reading.zero_deg is None)
    base = fitter.base(place_of(trace, drive, reading))
    now = explanation(base, base, record, drive)
    case = _Case(drive, M_g, measurement, record, torus, base)
    usual = now.chi_square <= now.freedom + np.sqrt(2 * now.freedom)
    if now.sufficient and usual and fitter.gains(base).max() < SCREEN * BY_CHANCE:
        return _solved(case, now, [], None, None)
    others = [] if now.sufficient else _mirrored(trace, fitter, base)
    if others and record.within_noise(others[0][0], base.unknowns.count):
        return _solved(case, now, [], None, Mirror(others[0][1], fitter.left_arcsec(others[0][2])))
    fits = [fitter.single(k, base) for k in range(len(VECTORS))]
    good = POLISHED * min(fit.chi_square for fit in fits)
    fits = [fitter.polished(fit) if fit.chi_square <= good else fit for fit in fits]
    best = int(np.argmin([fit.chi_square for fit in fits]))
    fits[best] = fitter.profiled(fits[best])
    singles = [explanation(fit, base, record, drive) for fit in fits]
    least = min(MIRRORED * base.chi_square, *(single.chi_square for single in singles))
    mirror = next((Mirror(way, fitter.left_arcsec(fit)) for chi, way, fit in others[:1] if chi <= least), None)
    joint = None
    if conclude(now, singles, None, mirrored=mirror is not None).kind not in ("agrees", "mirrored"):
        joint = explanation(fitter.joint(min(fits, key=lambda fit: fit.chi_square)), base, record, drive)
    return _solved(case, now, singles, joint, mirror)


@dataclass(frozen=True)
class _Case:
    drive: Drive
    M_g: float
    measurement: Measurement
    record: Record
    torus: ErrorWaves
    base: VectorFit


def _solved(
    case: _Case, now: Explanation, singles: list[Explanation], joint: Explanation | None, mirror: Mirror | None
) -> Comparison:
    """The comparison, with every range and every rest from solved states."""
    drive, record = case.drive, case.record
    found = record.found
    predicted, proof = solved_curve(drive, case.M_g, found.cells.turns, case.base.place)
    difference = found.cells.error - predicted
    solution = record.design.project(lambda rows: difference[rows, None])[:, 0]
    count, sweeps = len(record.measured), len(found.fit.level)
    levels, drift = solution[count : count + sweeps], solution[count + sweeps :]
    off = levels[found.cells.sweep]
    travel = found.cells.travel / record.design.reach
    off = off + sum((c * travel ** (k + 1) for k, c in enumerate(drift)), np.zeros(len(travel)))
    residual = difference - off
    # a drift that the prediction has too, a beat that the record does not resolve, is none
    slope = 0.0 if len(drift) else drift_left(found.cells, residual, found.range.value)
    apart = solution[:count]
    curve = _curve(found, apart)
    worst = int(np.abs(curve).argmax())
    search = _Search(drive, case.M_g)
    F_ior, more = search.F_ior(drive)
    proof += more
    best = min(singles, key=lambda single: single.chi_square, default=now)
    done = []
    for found_one in singles if joint is None else [*singles, joint]:
        each = found_one
        if each.overrides:
            there = drive.with_values(values(each.overrides))
            whole, more = search.F_ior(there)
            proof += more
            each = replace(each, F_ior_arcsec=whole)
            if each.vectors == best.vectors or len(each.vectors) > 1:
                again, more = solved_curve(there, case.M_g, found.cells.turns, each.place)
                proof += more
                left = record.measured - record.of_curve(again)
                each = replace(each, left_arcsec=_rms(left), left_orders=_left_orders(found, left, record.covariance))
        done.append(each)
    if joint is not None:
        joint = done.pop()
    finding = conclude(now, done, joint, mirrored=mirror is not None)
    uncertain = [_place_uncertainty(case.base, k, now) for k in range(2)]
    return Comparison(
        drive=drive,
        measurement=case.measurement,
        M_g=case.M_g,
        place=case.base.place,
        start_uncertainty_deg=uncertain[0],
        zero_uncertainty_deg=uncertain[1],
        predicted_arcsec=found.fit.curve(found.cells.turns) + found.fit.residual - residual,
        residual_arcsec=residual,
        orders=_pairs(found, record.measured - apart, apart, record.covariance),
        predicted_range_arcsec=float(np.ptp(_curve(found, record.measured - apart))),
        difference_range_arcsec=float(np.ptp(curve)),
        difference_rms_arcsec=_rms(apart),
        largest_arcsec=float(curve[worst]),
        largest_at_turns=float(found.grid_turns[worst]),
        F_ior_arcsec=F_ior,
        chi_square=now.chi_square,
        freedom=now.freedom,
        singles=tuple(done),
        joint=joint,
        finding=finding,
        mirror=mirror,
        certificate=proof + case.torus.certificate,
        warnings=(DRIFT_LEFT.format(slope),) if slope else (),
    )


class _Search:
    """F'_ior of drives that differ in their deviations alone."""

    def __init__(self, drive: Drive, M_g: float) -> None:
        self._M_g = M_g
        self._search = CycleSearch(drive, M_g) if worth_searching(drive) else None

    def F_ior(self, drive: Drive) -> tuple[float, Certificate]:
        if self._search:
            found = self._search.extremes(drive)
            return found.F_ior_arcsec, found.certificate
        every = kinematic_error(drive, self._M_g, cross_check=None)
        return every.F_ior_arcsec, every.certificate


def _curve(found: Direction, coefficients: Array) -> Array:
    """Curve of coefficients over the angles visited."""
    turns = found.grid_turns
    parts = range(0, len(turns), CHUNK)
    return np.concatenate([waves(turns[k : k + CHUNK], found.fit.orders) @ coefficients for k in parts])


def _rms(coefficients: Array) -> float:
    return float(np.sqrt((coefficients**2).sum() / 2))


def _left_orders(found: Direction, left: Array, covariance: Array) -> tuple[tuple[float, float, str], ...]:
    """The greatest orders of what is left that are clear of noise: order, amplitude, cause."""
    pairs = _pairs(found, left, left, covariance)
    clear = [pair for pair in pairs if pair.difference_arcsec > CLEAR * pair.difference_uncertainty_arcsec]
    greatest = sorted(clear, key=lambda pair: -pair.difference_arcsec)[:LEFT]
    return tuple((pair.per_cam_rev, pair.difference_arcsec, pair.cause) for pair in greatest)


def _place_uncertainty(base: VectorFit, k: int, now: Explanation) -> float | None:
    """Standard uncertainty [deg] of the start (0) or the zero (1); None where it was given, 360 where nothing tells."""
    wanted = (base.unknowns.start, base.unknowns.zero)
    if not wanted[k]:
        return None
    row = sum(wanted[:k])
    if (base.blind[row] ** 2).sum() > TOLD:
        return 360.0
    scale = max(1.0, now.chi_square / now.freedom)
    return float(np.sqrt(scale * base.covariance()[row, row]))


def _mirrored(trace: MeasuredTrace, fitter: VectorFitter, base: VectorFit) -> list[tuple[float, str, VectorFit]]:
    """The file with its signs swapped: chi-square, what is swapped and the fit, the best first."""
    ways = [("cam_sense", base.place.sign, -base.place.sense)]
    if not trace.sense:
        ways += [("error_is", -base.place.sign, base.place.sense), ("both", -base.place.sign, -base.place.sense)]
    found = []
    for name, sign, sense in ways:
        fit = fitter.base(replace(base.place, sign=sign, sense=sense))
        found.append((fit.chi_square, name, fit))
    return sorted(found, key=lambda each: each[0])


def _pairs(found: Direction, predicted: Array, apart: Array, covariance: Array) -> tuple[OrderPair, ...]:
    count = len(found.fit.orders)
    pairs = []
    for k, order in enumerate(found.orders):
        a, b, x, y = predicted[k], predicted[count + k], apart[k], apart[count + k]
        size = float(np.hypot(x, y))
        unit = np.array([x, y]) / size if size else np.array([1.0, 0.0])
        own = covariance[np.ix_([k, count + k], [k, count + k])]
        pairs.append(
            OrderPair(
                order.per_cam_rev,
                order.amplitude_arcsec,
                order.uncertainty_arcsec,
                order.phase_deg,
                float(np.hypot(a, b)),
                float(np.degrees(np.arctan2(-b, a))),
                size,
                float(np.sqrt(unit @ own @ unit)),
                order.cause,
            )
        )
    return tuple(pairs)
