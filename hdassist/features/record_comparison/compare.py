"""Comparison of a measured error with the predicted one: difference, orders, and the deviations that explain it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from hdassist.drive.error.waves import ErrorWaves
from hdassist.drive.model.geometry import Array, Kinematics
from hdassist.drive.preset.fields import Drive
from hdassist.drive.solve.answers import Certificate
from hdassist.features.measuring.fit import TraceFit, drift_of
from hdassist.features.measuring.measure import DRIFT_LEFT, Measurement, SweepResult
from hdassist.features.measuring.terms import curve_of
from hdassist.features.record_comparison.fit import VectorFit, VectorFitter
from hdassist.features.record_comparison.record import (
    CHI_SQUARE_CLEAR,
    ERROR_SIGNS,
    SENSES,
    VECTOR_UNITS,
    VECTORS,
    Alignment,
    OrderPair,
    RecordedOrders,
    SolvedStates,
    doubtful_waves,
    rms,
    size_and_direction,
    with_vectors,
)
from hdassist.readers.trace import MeasuredTrace
from hdassist.run.errors import UsageError
from hdassist.run.run import UNCHECKED, Run

_CLEAR_GAIN = 25.0  # chi-square of two unknowns, which noise exceeds four times in a million
_EQUAL_FIT = 9.0  # largest difference in chi-square between fits that explain a recording equally well
_BLIND_SHARE = 0.1  # largest squared share of a numeric result that may be unidentifiable
_NAMED_SHARE = 0.3  # smallest share of a combination from which a vector is named
_VAGUE_DIRECTION = 60.0  # largest standard uncertainty of a direction that is reported [deg]
_DECIMALS = 3  # largest number of decimals of a new value
_ConclusionKind = Literal["agrees", "mirrored", "one", "several", "unexplained"]
_MIRRORED_RATIO = 0.5  # largest chi-square of a mirrored file, over that of the stated file, that is reported
# largest relative chi-square at which a mirrored file is reported without a search for deviations that fit better
_CLEARLY_MIRRORED_RATIO = 0.1
_SCREEN = 0.5  # smallest linear gain for which deviations are fitted, as a share of a clear gain
_POLISHED = 2.0  # largest chi-square of a fit that is continued on the fine torus, as a multiple of the smallest
_RESIDUAL_ORDERS = 3  # number of named orders of a residual
UNIDENTIFIABLE_ANGLE = 360.0  # standard uncertainty of an angle that is not identifiable [deg]
FIT_STATES = 200_000  # approximate number of states solved by the fits of a comparison


@dataclass(frozen=True)
class VectorChange:
    """New size and direction of a deviation vector, by their paths, with standard uncertainties.

    The direction is None if it is not identifiable.

    size, direction: paths of size and direction.
    size_um, size_uncertainty_um: size and its standard uncertainty [um].
    direction_deg, direction_uncertainty_deg: direction and its standard uncertainty [deg].
    """

    size: str
    size_um: float
    size_uncertainty_um: float
    direction: str
    direction_deg: float | None
    direction_uncertainty_deg: float | None


@dataclass(frozen=True)
class Explanation:
    """The drive with some deviations fitted to the recording.

    deviations: paths of the sizes that were free.
    changes: new vectors, for identifiable sizes.
    not_told_apart: names of deviations that the recording does not distinguish, one tuple per combination.
    chi_square: chi-square of the fit.
    degrees_of_freedom: its degrees of freedom.
    explained_share: share of the excess chi-square over noise that the fit removes; None if there is no excess.
    clear: whether the improvement is too large for chance.
    sufficient: whether the residual is within noise.
    overrides: new values in the format of --set; empty if one of them is not identifiable.
    alignment: fitted alignment of the recording.
    F_ior_arcsec: F'_ior over the full cycle with the new values, from solved states [arcsec]; None without overrides.
    difference_left_arcsec: root mean square of the residual within the orders, from solved states [arcsec]; None if
        the states were not solved.
    orders_left: largest orders of the residual.
    """

    deviations: tuple[str, ...]
    changes: tuple[VectorChange, ...]
    not_told_apart: tuple[tuple[str, ...], ...]
    chi_square: float
    degrees_of_freedom: int
    explained_share: float | None
    clear: bool
    sufficient: bool
    overrides: tuple[str, ...]
    alignment: Alignment
    F_ior_arcsec: float | None = None
    difference_left_arcsec: float | None = None
    orders_left: tuple[OrderPair, ...] = ()

    @property
    def excess(self) -> float:
        """Chi-square per degree of freedom, at least 1, by which variances are multiplied."""
        return max(1.0, self.chi_square / self.degrees_of_freedom)


@dataclass(frozen=True)
class _Conclusion:
    """Conclusion of a comparison.

    kind: whether the drive agrees, the file is mirrored, one deviation explains the difference, several deviations
        together explain it, or it is unexplained.
    best: the explanation on which the conclusion is based; None if there is none.
    """

    kind: _ConclusionKind
    best: Explanation | None = None


def _explanation(
    fit: VectorFit,
    base: VectorFit,
    fitter: VectorFitter,
) -> Explanation:
    """Return the explanation that a fit gives, in fields of the preset, without solving further states.

    fit: the fit.
    base: fit of the unchanged drive.
    fitter: fitter of the drive.
    """
    record = fitter.record
    drive = fitter.drive
    unknowns = len(fit.free)
    freedom = record.freedom(unknowns)
    # a poor fit widens all its uncertainties
    excess = max(1.0, fit.chi_square / freedom)
    candidates = [_change(fit, number, excess * fit.covariance, drive) for number in range(len(fit.fitted))]
    changes = [change for change in candidates if change is not None]
    names = _not_told_apart(fit)
    # new values are printed only if all of them are determined
    is_determined = len(changes) == len(fit.fitted) and not names
    # the gain is relative to the remaining scatter
    gain = (base.chi_square - fit.chi_square) / excess
    return Explanation(
        deviations=tuple(VECTORS[k].size for k in fit.fitted),
        changes=tuple(changes),
        not_told_apart=names,
        chi_square=fit.chi_square,
        degrees_of_freedom=freedom,
        explained_share=_explained_share(fit, base, fitter),
        clear=gain > _gain_by_chance(unknowns - len(base.free)),
        sufficient=record.within_noise(fit.chi_square, unknowns),
        overrides=_overrides(fit, changes, drive) if is_determined else (),
        alignment=replace(
            record.alignment,
            start_deg=float(fit.unknowns[-2]),
            zero_deg=float(fit.unknowns[-1]),
        ),
    )


def _explained_share(
    fit: VectorFit,
    base: VectorFit,
    fitter: VectorFitter,
) -> float | None:
    """Return the share of the excess chi-square over noise that a fit removes; None if there is no excess."""
    freedom = fitter.record.freedom
    # the expected chi-square of noise alone is its degrees of freedom
    excess_before = base.chi_square - freedom(len(base.free))
    if excess_before <= 0:
        return None
    return 1 - max(fit.chi_square - freedom(len(fit.free)), 0.0) / excess_before


def _gain_by_chance(unknowns: int) -> float:
    """Return the decrease of chi-square that chance exceeds only four times in a million.

    unknowns: number of further unknowns in the fit.
    """
    return max(_CLEAR_GAIN, unknowns + CHI_SQUARE_CLEAR * float(np.sqrt(2 * unknowns)))


def _polar(fit: VectorFit, i: int) -> Array:
    """Return unit directions along and across the i-th fitted vector in the space of free unknowns, shape (2, f)."""
    vector = fit.vectors[fit.fitted[i]]
    # a step along the vector changes its size, a step across changes its direction
    unit = vector / abs(vector) if vector else 1.0
    result = np.zeros((2, len(fit.free)))
    result[:, 2 * i : 2 * i + 2] = [[unit.real, unit.imag], [-unit.imag, unit.real]]
    return result


def _change(
    fit: VectorFit,
    i: int,
    covariance: Array,
    drive: Drive,
) -> VectorChange | None:
    """Return the new value of the i-th fitted vector; None if its size is not identifiable."""
    k = fit.fitted[i]
    axes = _polar(fit, i)
    vector = VECTORS[k]
    size, direction = size_and_direction(drive, fit.vectors, k)
    # squared share of either direction that the recording does not determine
    blind = ((axes @ fit.unidentifiable) ** 2).sum(axis=1) > _BLIND_SHARE
    if blind[0]:
        return None
    along, across = (float(np.sqrt(axis @ covariance @ axis)) * float(VECTOR_UNITS[k]) for axis in axes)
    # a vector of length 0 has no direction
    turn = float(np.degrees(across / size)) if size else np.inf
    has_direction = not blind[1] and turn <= _VAGUE_DIRECTION
    return VectorChange(
        size=vector.size,
        size_um=size,
        size_uncertainty_um=along,
        direction=vector.direction,
        direction_deg=direction if has_direction else None,
        direction_uncertainty_deg=turn / vector.order if has_direction else None,
    )


def _overrides(
    fit: VectorFit,
    changes: Sequence[VectorChange],
    drive: Drive,
) -> tuple[str, ...]:
    """Return new values, rounded to a tenth of their uncertainty or finer.

    The result is empty if the preset does not allow one of them.
    """
    changed = with_vectors(drive, fit.vectors, fit.fitted)
    texts = []
    for new in changes:
        spreads = {new.size: new.size_uncertainty_um, new.direction: new.direction_uncertainty_deg}
        for path, uncertainty in spreads.items():
            # two digits of the uncertainty are sufficient
            decimals = 1 - int(np.floor(np.log10(max(uncertainty or 1.0, 1e-9))))
            value = round(changed.number(path), min(max(decimals, 0), _DECIMALS)) + 0.0
            # a preset cannot have a fitted value outside its field's range
            if not drive.allows(path, value):
                return ()
            texts.append(f"{path}={value:.10g}")
    return tuple(texts)


def _not_told_apart(fit: VectorFit) -> tuple[tuple[str, ...], ...]:
    """Return the names of vectors that the recording does not resolve, one tuple for each combination of sizes."""
    names = []
    # the vectors of an unidentifiable combination cancel in the recording
    for combination in fit.unidentifiable.T:
        parts = {VECTORS[k].size.split(".")[1]: _polar(fit, i) @ combination for i, k in enumerate(fit.fitted)}
        if max((float(along**2) for along, _ in parts.values()), default=0.0) <= _BLIND_SHARE:
            continue  # the combination contains only directions, which a different start of the recording compensates
        names.append(tuple(name for name, part in parts.items() if float(np.hypot(*part)) > _NAMED_SHARE))
    return tuple(dict.fromkeys(names))


def _conclude(
    base: Explanation,
    singles: Sequence[Explanation],
    joint: Explanation | None,
    *,
    mirrored: bool,
) -> _Conclusion:
    """Return the conclusion with the simplest explanation whose residual is within noise.

    base: explanation by the unchanged drive.
    singles: explanations by one deviation.
    joint: explanation by all deviations together; None if it was not computed.
    mirrored: whether the file is mirrored.
    """
    best = min(
        singles,
        key=lambda single: single.chi_square,
        default=base,
    )
    # the simplest explanations come first: no difference to explain, or a mirrored file
    if mirrored or (base.sufficient and not best.clear):
        return _Conclusion("mirrored" if mirrored else "agrees")
    if best.clear and best.sufficient:
        return _Conclusion("one", best)
    if joint and joint.sufficient and joint.clear:
        return _Conclusion("several", joint)
    return _Conclusion("unexplained", best if best.clear else None)


def equally_good(best: Explanation, singles: Sequence[Explanation]) -> list[Explanation]:
    """Return other single deviations that explain the difference as well as the best one."""
    # fits within three standard deviations of one unknown count as equal
    largest = best.chi_square + _EQUAL_FIT * best.excess
    return [single for single in singles if single is not best and single.clear and single.chi_square <= largest]


@dataclass(frozen=True)
class _MirroredFile:
    """Another reading of a file that fits clearly better.

    asked: alignment with the other reading.
    rms_arcsec: root mean square of its residual [arcsec].
    within_noise: whether noise alone can explain this residual.
    """

    asked: Alignment
    rms_arcsec: float
    within_noise: bool

    @property
    def options(self) -> str:
        """Command-line options that select this reading."""
        return f"--error-is {ERROR_SIGNS[self.asked.sign]} --cam-sense {SENSES[self.asked.sense]}"


class _RecordReader:
    """Fits of the unchanged drive at a torque to a recording that may be read in several ways.

    measurement: measurement with both directions as one.
    drive: the drive.
    M_g: torque [N*m].
    asked: requested counting convention of the file; all conventions have the same orders.
    run: the run.
    """

    def __init__(
        self,
        measurement: Measurement,
        drive: Drive,
        M_g: float,
        asked: Alignment,
        run: Run = Run(),
    ) -> None:
        self.measurement = measurement
        self.drive = drive
        self.torus = ErrorWaves(drive, M_g, run)
        self._doubt = partial(
            doubtful_waves,
            M_g=M_g,
            torus=self.torus,
            run=run,
        )
        # the changes are solved once for all ways to read the file
        self._changes = self._doubt(drive)
        self._orders = RecordedOrders(
            sweep=measurement.directions[0], torus=self.torus, kinematics=Kinematics.of(drive), alignment=asked
        )

    def fitted(self, asked: Alignment) -> tuple[VectorFitter, VectorFit]:
        """Return a fitter for a counting convention of the file, and its fit of start and zero if they are free."""
        record = self._orders.read_as(asked.of_file(self.measurement.trace, Kinematics.of(self.drive)))
        return VectorFitter(
            drive=self.drive, record=record, torus=self.torus, doubt=self._doubt, angles=asked.fitted
        ).doubted(self._changes)

    def mirrored(self, asked: Alignment, base: VectorFit) -> tuple[_MirroredFile, VectorFit] | None:
        """Return the best other reading of the file and its fit; None if it is not clearly better than the base fit."""
        # each reading has its own start and zero
        ways = [(alignment, *self.fitted(alignment)) for alignment in asked.swapped]
        alignment, fitter, fit = min(ways, key=lambda way: way[2].chi_square)
        # the usual reading is kept unless the chi-square is at most half
        if fit.chi_square > _MIRRORED_RATIO * base.chi_square:
            return None
        within = fitter.record.within_noise(fit.chi_square, len(base.free))
        return _MirroredFile(alignment, fitter.residual_rms_arcsec(fit), within), fit


def mirrored_reading(
    measurement: Measurement,
    drive: Drive,
    M_g: float,
    asked: Alignment,
) -> _MirroredFile | None:
    """Return another reading of a recording if it explains the recording; None if it does not.

    Another reading explains the recording if its residual is within noise or far smaller than that of the usual
    reading. It is None if the usual reading explains the recording.

    measurement: the measurement.
    drive: the drive.
    M_g: torque [N*m].
    asked: usual counting convention of the file.

    Raises UsageError for rolling balls, and UntrustedError if a state cannot be trusted.
    """
    reader = _RecordReader(
        measurement=measurement,
        drive=drive,
        M_g=M_g,
        asked=asked,
        run=UNCHECKED,
    )
    fitter, base = reader.fitted(asked)
    if _explanation(base, base, fitter).sufficient:
        return None
    better = reader.mirrored(asked, base)
    if better and (better[0].within_noise or better[1].chi_square <= _CLEARLY_MIRRORED_RATIO * base.chi_square):
        return better[0]
    return None


@dataclass(frozen=True, eq=False)
class Comparison:
    """Comparison of a measured error with the predicted error of a drive.

    drive: the drive.
    measurement: the measurement with both directions as one.
    M_g: torque [N*m].
    asked: requested counting convention of the file.
    unchanged: the drive without changes, with the alignment of the recording.
    uncertainties_deg: standard uncertainties of start and zero of this alignment [deg]; None for a given angle.
    predicted_arcsec: prediction at the bins without levels and drift [arcsec], shape (bins,).
    residual_arcsec: residual at the bins [arcsec], shape (bins,).
    orders: measured and predicted orders.
    predicted_curve, difference_curve: curves limited to the orders, at the covered angles sweep.grid_turns [arcsec].
    singles: explanations by one vector each; empty if the drive agrees with the recording.
    joint: explanation by all vectors together; None if it is not needed.
    conclusion: conclusion of the comparison.
    mirror: another reading of the file that fits clearly better, or None.
    certificate: certificate of the solved states.
    warnings: warnings about the measurement and the difference.
    """

    drive: Drive
    measurement: Measurement
    M_g: float
    asked: Alignment
    unchanged: Explanation
    uncertainties_deg: tuple[float | None, float | None]
    predicted_arcsec: Array
    residual_arcsec: Array
    orders: tuple[OrderPair, ...]
    predicted_curve: Array
    difference_curve: Array
    singles: tuple[Explanation, ...]
    joint: Explanation | None
    conclusion: _Conclusion
    mirror: _MirroredFile | None
    certificate: Certificate
    warnings: tuple[str, ...]

    @property
    def sweep(self) -> SweepResult:
        """The measured error, with both directions as one."""
        return self.measurement.directions[0]

    @property
    def measured_uncertainty_arcsec(self) -> float:
        """Standard uncertainty of the measured F'_ior [arcsec]."""
        return self.measurement.greatest.uncertainty_arcsec

    @property
    def difference_rms_arcsec(self) -> float:
        """Root mean square of the difference within the orders [arcsec]."""
        return rms(np.array([pair.difference.amplitude_arcsec for pair in self.orders]))

    @property
    def largest(self) -> tuple[float, float]:
        """The largest difference [arcsec], and its input angle on the test rig [revolutions]."""
        k = int(np.abs(self.difference_curve).argmax())
        return float(self.difference_curve[k]), float(self.sweep.grid_turns[k])


def torque_of(drive: Drive) -> float:
    """Return the only torque of the preset [N*m]. Raises UsageError if the preset has several torques."""
    if len(drive.operation.M_g) > 1:
        several = ", ".join(f"{M_g:g}" for M_g in drive.operation.M_g)
        raise UsageError(
            f"{drive.name} has several torques: {several}", "state the torque of the recording with --torque"
        )
    return drive.operation.M_g[0]


def zero_of(
    trace: MeasuredTrace,
    drive: Drive,
    start_deg: float | None,
) -> float | None:
    """Return the zero of a recording [deg] if none is stated; None to fit it.

    An input angle counts as phi_h. An output angle gives phi_h if the output angle at phi_h = 0 is known.

    trace: the recording.
    drive: the drive.
    start_deg: output angle at phi_h = 0 [deg], or None.
    """
    # input angles are measured from the zero of the drive's input
    if trace.angle_of == "cam":
        return 0.0
    return None if start_deg is None else -Kinematics.of(drive).u * start_deg


def _solved_singles(
    singles: Sequence[Explanation],
    fitter: VectorFitter,
    solved: SolvedStates,
) -> list[Explanation]:
    """Return explanations by one deviation with F'_ior from solved states; the best one also gets its residual."""
    least = min((single.chi_square for single in singles), default=np.inf)
    return [_solved(single, fitter, solved, curve=single.chi_square == least) for single in singles]


def compare(
    measurement: Measurement,
    drive: Drive,
    M_g: float,
    *,
    asked: Alignment,
    run: Run = Run(),
) -> Comparison:
    """Compare a measured error with a drive at a torque.

    measurement: measurement with both directions as one. Each direction has its own level because the model has no
        friction.
    drive: the drive.
    M_g: torque [N*m].
    asked: counting convention of the file.
    run: the run.
    Raises UsageError for rolling balls, and UntrustedError if a result cannot be trusted or the scale of the errors is
    unknown.
    """
    measurement.trace.require_known_scale()
    reader = _RecordReader(
        measurement=measurement,
        drive=drive,
        M_g=M_g,
        asked=asked,
        run=run,
    )
    fitter, base = reader.fitted(asked)
    unchanged = _explanation(base, base, fitter)
    # if the drive explains the recording, no other reading of its file is needed
    mirrored = None if unchanged.sufficient else reader.mirrored(asked, base)
    singles, joint, mirror = _explanations(fitter, base, unchanged, mirrored)

    # all ranges and residuals are computed from solved states
    solved = SolvedStates(M_g)
    difference = _Difference.of(fitter, drive, unchanged, solved)
    unchanged = replace(unchanged, F_ior_arcsec=solved.F_ior(drive))
    singles = _solved_singles(singles, fitter, solved)
    joint = _solved(joint, fitter, solved, curve=True) if joint else None
    conclusion = _conclude(unchanged, singles, joint, mirrored=mirror is not None)
    return Comparison(
        drive=drive,
        measurement=measurement,
        M_g=M_g,
        asked=asked,
        unchanged=unchanged,
        uncertainties_deg=_angle_uncertainties(base, unchanged),
        predicted_arcsec=difference.predicted_arcsec,
        residual_arcsec=difference.fit.error,
        orders=difference.orders,
        predicted_curve=difference.predicted_curve,
        difference_curve=difference.curve,
        singles=tuple(singles),
        joint=joint,
        conclusion=conclusion,
        mirror=mirror,
        certificate=solved.certificate + reader.torus.certificate,
        warnings=(*measurement.warnings, *difference.warnings),
    )


@dataclass(frozen=True, eq=False)
class _Difference:
    """Difference between a recording and the solved states of a drive.

    fit: fit to the difference.
    drift: linear drift that remains in the difference [arcsec]; 0 without drift.
    orders: measured and predicted orders.
    predicted_arcsec: prediction at the bins [arcsec], shape (bins,).
    predicted_curve, curve: prediction and difference at the covered angles [arcsec], shape (angles,).
    """

    fit: TraceFit
    drift: float
    orders: tuple[OrderPair, ...]
    predicted_arcsec: Array
    predicted_curve: Array
    curve: Array

    @property
    def warnings(self) -> list[str]:
        """Warnings on drift that remains in the difference; empty without drift."""
        return [DRIFT_LEFT.format(self.drift)] if self.drift else []

    @classmethod
    def of(
        cls,
        fitter: VectorFitter,
        drive: Drive,
        unchanged: Explanation,
        solved: SolvedStates,
    ) -> _Difference:
        """Return the difference between the recording of a fitter and the unchanged drive."""
        record = fitter.record
        sweep = record.sweep
        solved_curve = solved.curve(drive, sweep.bins.turns, unchanged.alignment)
        # the difference is fitted like the recording, with the same design
        fit = TraceFit(sweep.fit.design, sweep.bins.error - solved_curve, sweep.fit.lines)
        predicted = record.measured - fit.coefficients  # shape (2 orders,)
        return cls(
            fit=fit,
            # a drift of the prediction is also a sideband
            drift=0.0 if len(fit.drift) else drift_of(fit, sweep.range.value),
            orders=record.pairs(predicted, fit.coefficients),
            predicted_arcsec=sweep.fit.error - fit.error,
            predicted_curve=curve_of(predicted, sweep.fit.orders, sweep.grid_turns),
            curve=fit.curve(sweep.grid_turns),
        )


def _explanations(
    fitter: VectorFitter,
    base: VectorFit,
    unchanged: Explanation,
    mirrored: tuple[_MirroredFile, VectorFit] | None,
) -> tuple[list[Explanation], Explanation | None, _MirroredFile | None]:
    """Return explanations by each vector, an explanation by all vectors, and the mirrored reading of the file.

    There are no explanations if none is needed. The joint explanation and the reading are None if they do not apply.
    """
    if unchanged.sufficient and _is_usual(unchanged) and fitter.linear_gains(base).max() < _SCREEN * _CLEAR_GAIN:
        return [], None, None
    # if there is no mirrored reading, the fit of the usual reading takes its place
    mirror, mirrored_base = mirrored or (None, base)
    if mirror and mirror.within_noise:
        return [], None, mirror
    fits = _single_fits(fitter, base)
    singles = [_explanation(fit, base, fitter) for fit in fits]
    best_fit = min(fits, key=lambda fit: fit.chi_square)
    # a deviation that explains more than the other reading rules it out
    if mirrored_base.chi_square > best_fit.chi_square:
        mirror = None
    if _conclude(unchanged, singles, None, mirrored=mirror is not None).kind in ("agrees", "mirrored"):
        return singles, None, mirror
    # fit all vectors together, starting from the best single one
    joint = fitter.with_shift(fitter.refined(best_fit, range(len(VECTORS))))
    return singles, _explanation(joint, base, fitter), mirror


def _is_usual(explanation: Explanation) -> bool:
    """Return whether a chi-square is at most one standard deviation above its expectation."""
    freedom = explanation.degrees_of_freedom
    return bool(explanation.chi_square <= freedom + np.sqrt(2 * freedom))


def _single_fits(fitter: VectorFitter, base: VectorFit) -> list[VectorFit]:
    """Return the fit of each single vector; good fits are refined, and the best one gets its full covariance."""
    fits = [fitter.single(k, base) for k in range(len(VECTORS))]
    # poor fits are not refined on the fine torus
    largest_good = _POLISHED * min(fit.chi_square for fit in fits)
    fits = [fitter.refined(fit) if fit.chi_square <= largest_good else fit for fit in fits]
    best = int(np.argmin([fit.chi_square for fit in fits]))
    fits[best] = fitter.with_shift(fitter.profiled(fits[best]))
    return fits


def _solved(
    explained: Explanation,
    fitter: VectorFitter,
    solved: SolvedStates,
    *,
    curve: bool,
) -> Explanation:
    """Return an explanation with its F'_ior from solved states.

    curve: whether to add its residual within the orders.
    """
    if not explained.overrides:
        return explained
    record = fitter.record
    # use the rounded values that are printed instead of the fitted values
    values = (text.split("=") for text in explained.overrides)
    changed = fitter.drive.with_values({path: float(value) for path, value in values})
    explained = replace(explained, F_ior_arcsec=solved.F_ior(changed))
    if not curve:
        return explained
    bins = record.sweep.bins
    fit = record.sweep.fit
    coefficients, _ = fit.design.fitted(solved.curve(changed, bins.turns, explained.alignment))
    residual = record.measured - coefficients[: len(record.measured)]
    pairs = sorted(record.pairs(residual, residual), key=lambda pair: -pair.difference.amplitude_arcsec)
    sizes = [(pair.difference.amplitude_arcsec, pair.difference.uncertainty_arcsec or 0.0) for pair in pairs]
    # only orders that noise does not explain are reported
    clear = [pair for pair, (size, u) in zip(pairs, sizes, strict=True) if size > CHI_SQUARE_CLEAR * u]
    return replace(
        explained,
        difference_left_arcsec=rms(residual),
        orders_left=tuple(clear[:_RESIDUAL_ORDERS]),
    )


def _angle_uncertainties(base: VectorFit, unchanged: Explanation) -> tuple[float | None, float | None]:
    """Return the standard uncertainties of start and zero of the alignment [deg]; None for a given angle."""
    blind = (base.unidentifiable**2).sum(axis=1) > _BLIND_SHARE
    fitted = iter(np.where(blind, UNIDENTIFIABLE_ANGLE, np.sqrt(unchanged.excess * np.diag(base.covariance))).tolist())
    start, zero = (next(fitted) if is_fitted else None for is_fitted in unchanged.alignment.fitted)
    return start, zero
