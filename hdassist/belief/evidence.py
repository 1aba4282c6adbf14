"""Reference data: known figures of a drive with the likelihood of predictions, and the errors of measured F'_ior.

Likelihoods are heavy-tailed (Student t with 4 degrees of freedom), so that one wrong figure does not decide alone, and
wide enough for the misfit of the model. Measured values of F'_ior are evaluated jointly, because no preset describes
the drive exactly and the model has a similar error in all positions. For a model with F'_ior f in the measured
positions, the drive shows

(1)  y = f + SCALE u f + a GP + noise,  a = misfit mean(f),  GP ~ exp(-(2 sin(d/2) / LENGTH)^2 / 2)

with a normal number u, the rotation d between two positions, a misfit from MISFITS, and at most one misread value
(MISREAD).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from scipy.special import ive, logsumexp

from hdassist.drive.error.stiffness import stiffness
from hdassist.drive.model.geometry import Array
from hdassist.drive.model.rules import turn_of
from hdassist.drive.preset.fields import Drive
from hdassist.drive.solve.answers import Certificate
from hdassist.drive.solve.formulation import Formulation
from hdassist.run.errors import UntrustedError
from hdassist.run.run import UNCHECKED

_FREEDOM = 4.0  # degrees of freedom of Student's t
# relative spread of a catalogue stiffness, in the logarithm: drives of a type, and the misfit of the model
_MEAN_OF_TYPE = 0.15
_WHOLE_FLANKS = 0.30  # relative spread of K_1 with a single contact over the whole flank (numerics.stations 1)
_MISFIT = 0.10  # relative spread of values measured on the drive, from the misfit of the model alone
_SOFT_EDGE = 0.25  # relative width of a limit that every sold drive meets
# relative width of a limit by which each drive was selected: assumed model error of the manufacturer's reading
_TESTED_EDGE = 0.05
# spread of a typical value in the logarithm: assumed differences of deviations between drives of a type
_DRIVES_OF_TYPE = 0.30
_NO_PLAY = 2.0  # arcsec; smallest misfit of lost motion and backlash

SEGMENT_STIFFNESSES = ("K_1", "K_2", "K_3")  # N*m/rad
STIFFNESS_FIGURES = (*SEGMENT_STIFFNESSES, "lost_motion", "play")  # the last two in arcsec
ACCURACY = "accuracy"
# number of positions per revolution that are read, by catalogue.accuracy_test; 0 for the full mesh cycle
_TEST_POSITIONS = {"12_positions": 12}
# torque of an accuracy test, in one direction, as a share of the rated torque; manufacturers state no or almost no load
ACCURACY_LOAD = 0.02


@dataclass(frozen=True)
class Evidence:
    """A known figure of a drive: its path in the preset, value, and spread (including the misfit of the model).

    figure: name of the prediction with which it is compared.
    kind: measure of the deviation of a prediction: ratio (logarithm over a relative spread), limit (relative excess
        over a relative spread) or difference (over a spread in the unit of the value).
    M_g: torque of a measured F'_ior [N*m], otherwise 0.
    rotation_deg: rotation of a measured F'_ior [deg], otherwise 0.
    positions: number of positions per output revolution at which an accuracy is read; 0 for the full mesh cycle.
    """

    path: str
    figure: str
    value: float
    spread: float
    kind: Literal["ratio", "limit", "difference"] = "ratio"
    M_g: float = 0.0
    rotation_deg: float = 0.0
    positions: int = 0

    @property
    def is_tight(self) -> bool:
        """Whether it is a limit by which each drive was selected, so that few samples agree with it."""
        return self.kind == "limit" and self.spread < _SOFT_EDGE

    def log_likelihood(self, prediction: Array | float) -> Array:
        """Return the log likelihood of predictions, 0 for the best agreement, same shape."""
        predicted = np.asarray(prediction, dtype=float)
        if self.kind == "ratio":
            deviation = np.log(predicted / self.value) / self.spread
        elif self.kind == "limit":
            deviation = np.maximum(predicted / self.value - 1, 0) / self.spread
        else:
            deviation = (predicted - self.value) / self.spread
        return np.asarray(-(_FREEDOM + 1) / 2 * np.log1p(deviation**2 / _FREEDOM))  # equation (9c) of docs/theory.md


def is_error_measured(drive: Drive) -> bool:
    """Return whether the preset of a drive contains measured values of F'_ior."""
    return any(figure.M_g for figure in evidence_of(drive))


def evidence_of(drive: Drive, *, of_type: bool = False) -> tuple[Evidence, ...]:
    """Return the reference data in a preset: its `catalogue`, and the values `measured` on the drive.

    Catalogue stiffnesses are means of the type; lost motion and accuracy are limits that are met.

    of_type: whether the reference data are for all drives of the type; this drive then shows the stiffness of the type,
        but not its clearances and deviations.
    """
    # the line contact of whole flanks predicts K_1 less closely than stations along the tooth do
    misfits_of_type = {"K_1": _WHOLE_FLANKS} if drive.numerics.stations == 1 else {}

    def uncertainty(path: str) -> float:
        return drive.uncertainty.get(path, 0.0) / 2

    evidence = []
    for section, name in product(("catalogue", "measured"), (*STIFFNESS_FIGURES, ACCURACY)):
        path = f"{section}.{name}"
        is_of_catalogue = section == "catalogue"
        value = getattr(getattr(drive, section), name, None)
        if value is None:
            continue
        if name in SEGMENT_STIFFNESSES:
            usual_misfit = _MEAN_OF_TYPE if is_of_catalogue or of_type else _MISFIT
            misfit = misfits_of_type.get(name, usual_misfit)
            spread = float(np.hypot(misfit, uncertainty(path) / value))
            evidence.append(Evidence(path, name, value, spread))
        elif name == ACCURACY:
            evidence.append(accuracy_evidence(value, drive.catalogue.accuracy_test))
        elif is_of_catalogue:
            evidence.append(Evidence(path, name, value, _SOFT_EDGE, "limit"))
        elif not of_type:
            misfit_arcsec = max(_MISFIT * value, _NO_PLAY)
            spread = float(np.hypot(misfit_arcsec, uncertainty(path)))
            evidence.append(Evidence(path, name, value, spread, "difference"))
    if not of_type:
        evidence.extend(measured_errors(drive))
    return tuple(evidence)


def accuracy_evidence(value_arcsec: float, test: str) -> Evidence:
    """Return the accuracy in a catalogue as reference data.

    A tested accuracy is a limit that few drives exceed, because the others are not sold. If the test is unknown, the
    limit is soft, because the accuracy may have been read at a few positions, which show only a part of F'_ior. The
    figure is always the reading of the test.

    Args:
        value_arcsec: accuracy [arcsec].
        test: value of catalogue.accuracy_test.
    """
    is_typical = test == "typical"
    edge = _SOFT_EDGE if test == "unstated" else _TESTED_EDGE
    return Evidence(
        path=f"catalogue.{ACCURACY}",
        figure=ACCURACY,
        value=value_arcsec,
        spread=_DRIVES_OF_TYPE if is_typical else edge,
        kind="ratio" if is_typical else "limit",
        positions=tested_positions(test),
    )


def tested_positions(test: str) -> int:
    """Return the number of positions at which an accuracy is read, 0 for the full mesh cycle.

    test: value of catalogue.accuracy_test.
    """
    return _TEST_POSITIONS.get(test, 0)


def measured_errors(drive: Drive) -> tuple[Evidence, ...]:
    """Return the measured values of F'_ior of a drive, with the fixed wheel turned from its present position."""
    evidence = []
    for key, reading in drive.measured.F_ior.items():
        place, torque_text = key.split("@")
        M_g = float(torque_text)
        rotation_deg = turn_of(place, drive.mounting.holes) % 360
        turned = f"+{rotation_deg:g}" if rotation_deg else ""
        evidence.append(
            Evidence(
                path=f"measured.F_ior.{key}",
                figure=f"F_ior@{M_g:g}{turned}",
                value=reading.value,
                spread=reading.uncertainty / 2,
                kind="difference",
                M_g=M_g,
                rotation_deg=rotation_deg,
            )
        )
    return tuple(evidence)


def stiffness_figures(drive: Drive, formulation: Formulation | None = None) -> tuple[dict[str, float], Certificate]:
    """Return K_1 to K_3 [N*m/rad] on the weaker side, lost motion and backlash [arcsec] by name, with a certificate.

    formulation: programme of the contact system, if it already exists.

    Raises UntrustedError if a result cannot be trusted.
    """
    result = stiffness(
        drive,
        points=1,
        formulation=formulation,
        run=UNCHECKED,
    )
    segments = (result.weaker(segment) for segment in (1, 2, 3))
    values = (*segments, result.lost_motion_arcsec, result.play_arcsec)
    return dict(
        zip(
            STIFFNESS_FIGURES,
            values,
            strict=True,
        )
    ), result.certificate


def log_likelihood(evidence: Sequence[Evidence], predictions: Mapping[str, float]) -> float:
    """Return the log likelihood of the reference data for which there is a prediction.

    predictions: predictions by figure.
    """
    predicted = [item for item in evidence if item.figure in predictions]
    errors = [item for item in predicted if item.M_g]
    other_items = [item for item in predicted if not item.M_g]
    log_of_others = float(sum(item.log_likelihood(predictions[item.figure]) for item in other_items))
    if not errors:
        return log_of_others
    # measured F'_ior share the misfit and the scale of one drive, so they count together
    f = np.array([[predictions[item.figure] for item in errors]])
    return log_of_others + float(log_likelihood_of_errors(f, *values_of_errors(errors))[0])


def values_of_errors(errors: Sequence[Evidence]) -> tuple[Array, Array, Array]:
    """Return measured F'_ior and its spreads [arcsec], shape (errors,), and the correlation of their misfit."""
    y = np.array([item.value for item in errors])
    spreads = np.array([item.spread for item in errors])
    torques = np.array([item.M_g for item in errors])
    rotations_deg = [item.rotation_deg for item in errors]
    # misfits at different torques are independent
    is_same_torque = np.equal.outer(torques, torques)
    return y, spreads, kernel(rotations_deg, rotations_deg) * is_same_torque


SCALE = 0.10  # assumed standard deviation of the drive's F'_ior over that of the model
# rad; correlation length of the misfit over the seat, from drives that differ in stiffness (benchmarks.misfit)
LENGTH = 0.6
# equally probable standard deviations of the misfit as a share of the mean F'_ior, from the same study
MISFITS = (0.0, 0.02, 0.04, 0.08)
_SMOOTH_ORDERS = 16  # number of orders of the Fourier series of a misfit over the seat; the next one would be 1e-11
SMOOTH_NUMBERS = 2 * _SMOOTH_ORDERS + 1
LEAST_ERROR_RATIO = 0.1  # lower bound of the ratio of a drive's F'_ior to that of the model
MISREAD = 0.03  # probability that a value is misread; at most one of several values is
MISREAD_SHARE = 0.3  # standard deviation of a misread value, as a share of the value
_UNSHOWN = 18.0  # squared standard deviations beyond which a sample does not show the measured F'_ior
# largest number of values of which none is excluded as misread, because the remaining two may agree by chance
_ANY_TWO = 3


def kernel(a_deg: Sequence[float], b_deg: Sequence[float]) -> Array:
    """Return the correlation of the misfit between positions [deg], shape (a, b)."""
    distance_rad = np.radians(np.subtract.outer(a_deg, b_deg))
    chord = 2 * np.sin(distance_rad / 2)  # periodic over the seat
    return np.asarray(np.exp(-0.5 * np.square(chord / LENGTH)))


def smooth_misfits(rotations_deg: Sequence[float], normals: Array) -> Array:
    """Return misfits of variance 1 in positions, shape (draws, rotations).

    They are the Fourier series of the kernel, exp((cos d - 1)/LENGTH^2) = sum of exp(-k) I_n(k) cos(n d) with k =
    1/LENGTH^2, so the misfit in a position does not depend on other requested positions.

    rotations_deg: positions [deg].
    normals: normal numbers, shape (draws, SMOOTH_NUMBERS).
    """
    order = np.arange(_SMOOTH_ORDERS + 1)[:, None]
    angles = np.radians(rotations_deg)
    size = np.sqrt(ive(order, LENGTH**-2) * np.where(order, 2, 1))
    series = np.vstack([size * np.cos(order * angles), (size * np.sin(order * angles))[1:]])
    # one position after the other, for the same last digits
    return np.asarray((normals[:, :, None] * series).sum(axis=1))


def errors_of_drive(
    f: Array,
    y: Array,
    variance: Array,
    spreads: Array,
    correlation: Array,
    drawn: tuple[Array, Array, Array],
) -> tuple[Array, Array]:
    """Return F'_ior of the drive given measured values [arcsec], shape (draws, positions), and its scale.

    F'_ior is drawn without the values, then corrected by the difference between the values and their own draw
    (Matheron's rule).

    f: F'_ior of the model in the positions and in the measured ones [arcsec], shape (draws, positions + values).
    y: measured values [arcsec], shape (values,).
    variance: variance of the misfit [arcsec^2], shape (draws,).
    spreads: standard deviations of the values [arcsec], shape (draws, values).
    correlation: correlation of the misfit over positions and values.
    drawn: draws of variance 1 for the scale, the misfit, and the noise of the values.
    """
    of_scale, misfit, noise = drawn
    count = f.shape[1] - len(y)
    scale = 1 + SCALE * of_scale
    F_ior = f * scale[:, None] + np.sqrt(variance)[:, None] * misfit
    f_measured = f[:, count:]  # in the measured positions
    drawn_values = F_ior[:, count:] + spreads * noise
    # covariance of F'_ior in all positions with F'_ior in the measured ones, shape (draws, positions + values, values)
    covariance = variance[:, None, None] * correlation[:, count:] + SCALE**2 * f[:, :, None] * f_measured[:, None, :]
    covariance_of_values = covariance[:, count:] + np.square(spreads)[:, :, None] * np.eye(len(y))
    weights = np.linalg.solve(covariance_of_values, (y - drawn_values)[..., None])[..., 0]
    conditioned = F_ior + (covariance * weights[:, None, :]).sum(axis=2)
    # a normal distribution is unbounded, but F'_ior is not
    bounded = np.maximum(conditioned, LEAST_ERROR_RATIO * f)[:, :count]
    return bounded, scale + SCALE**2 * (f_measured * weights).sum(axis=1)


@dataclass(frozen=True)
class ErrorKind:
    """Kind of error of measured values.

    misfit: misfit as a share of the mean F'_ior.
    noise: noise over the stated noise.
    misread: index of the misread value, -1 without one.
    log_share: logarithm of the prior probability of the kind.
    """

    misfit: float = 0.0
    noise: float = 1.0
    misread: int = -1
    log_share: float = 0.0

    def spreads(self, stated: Array, y: Array) -> Array:
        """Return the standard deviations of values y [arcsec], shape (values,).

        stated: stated standard deviations [arcsec], shape (values,).
        """
        misread = np.arange(len(y)) == self.misread
        return self.noise * np.where(misread, np.hypot(stated, MISREAD_SHARE * y), stated)


def error_kinds(values: int, log_noises: Mapping[float, float]) -> list[ErrorKind]:
    """Return the possible kinds of error of measured values; kinds with a misread value have the stated noise.

    values: number of values.
    log_noises: log probability of each ratio of noise to stated noise, up to a constant.
    """
    none_misread = (1 - MISREAD) ** values
    log_total = logsumexp(list(log_noises.values())) + np.log(len(MISFITS) / none_misread)
    kinds = []
    for misfit in MISFITS:
        for noise, log_noise in log_noises.items():
            kinds.append(
                ErrorKind(
                    misfit=misfit,
                    noise=noise,
                    log_share=log_noise - log_total,
                )
            )
    for misread in range(values):
        log_share = np.log((1 - none_misread) / values / len(MISFITS))
        kinds.extend(ErrorKind(misfit=misfit, misread=misread, log_share=log_share) for misfit in MISFITS)
    return kinds


def log_likelihoods(
    kinds: Sequence[ErrorKind],
    f: Array,
    y: Array,
    stated: Array,
    correlation: Array,
    mean: Array,
    read_error: float = 0.0,
) -> Array:
    """Return the log likelihood of measured F'_ior for each kind of error and sample, shape (kinds, samples).

    stated: standard deviations of y [arcsec].
    mean: mean F'_ior of the samples [arcsec], shape (samples,).
    read_error: relative error of f.

    The other arguments are those of `_likelihood_of_errors`.
    """
    rows = []
    for kind in kinds:
        variance = (kind.misfit**2 + read_error**2) * mean**2
        _, log_likelihood_of_kind = _likelihood_of_errors(f, y, kind.spreads(stated, y), variance, correlation)
        rows.append(kind.log_share + log_likelihood_of_kind)
    return np.array(rows)


def _likelihood_of_errors(
    f: Array,
    y: Array,
    spreads: Array,
    variance: Array,
    correlation: Array,
) -> tuple[Array, Array]:
    """Return the squared distance of measured F'_ior from samples, in standard deviations, and the log likelihood.

    In the eigenvectors of the correlation, whitened by the spreads, the covariance is diagonal, except for that of the
    scale, which has rank one.

    f: F'_ior of the samples in the measured positions [arcsec], shape (samples, values).
    y: measured values [arcsec], shape (values,).
    spreads: standard deviations of y [arcsec], shape (values,).
    variance: variance of the misfit [arcsec^2], shape (samples,).
    correlation: correlation of the misfit, shape (values, values).
    """
    eigenvalues, basis = np.linalg.eigh(correlation / np.multiply.outer(spreads, spreads))
    f_whitened = f / spreads @ basis
    difference = (y - f) / spreads @ basis
    variances = 1 + variance[:, None] * np.maximum(eigenvalues, 0)
    # the term of the scale by the Sherman-Morrison formula and the matrix determinant lemma
    scale_factor = 1 + SCALE**2 * (f_whitened**2 / variances).sum(axis=1)
    along_scale = SCALE * (f_whitened * difference / variances).sum(axis=1)
    squares = (difference**2 / variances).sum(axis=1) - along_scale**2 / scale_factor
    log_likelihood = -0.5 * (squares + np.log(variances).sum(axis=1) + np.log(scale_factor))
    return squares, log_likelihood - np.log(spreads).sum()


def log_likelihood_of_errors(
    f: Array,
    y: Array,
    spreads: Array,
    correlation: Array,
    read_error: float = 0.0,
) -> Array:
    """Return the log likelihood of measured F'_ior over misfits and misread values, shape (samples,).

    It is relative to that of samples with exactly these values.

    read_error: relative error of f.

    The other arguments are those of `_likelihood_of_errors`.
    """
    f_and_exact = np.vstack([f, y])  # the last row is a sample with exactly the measured values
    kinds = error_kinds(len(y), {1.0: 0.0})
    means = f_and_exact.mean(axis=1)
    by_kind = log_likelihoods(kinds, f_and_exact, y, spreads, correlation, means, read_error)
    log = logsumexp(by_kind, axis=0)
    return np.asarray(log[:-1] - log[-1])


def require_shown(
    names: Sequence[str],
    f: Array,
    y: Array,
    spreads: Array,
    correlation: Array,
    hint: str,
) -> None:
    """Raise UntrustedError if no sample is near the measured F'_ior, because the weights would be meaningless.

    If there are more than _ANY_TWO values, any one of them may be misread.

    names: names of the values in the message.
    hint: remedy in the message.

    The other arguments are those of `_likelihood_of_errors`.
    """
    variance = np.square(MISFITS[-1] * f.mean(axis=1))
    values = list(range(len(y)))

    def nearest(indices: list[int]) -> float:
        among_these = correlation[np.ix_(indices, indices)]
        squares, _ = _likelihood_of_errors(f[:, indices], y[indices], spreads[indices], variance, among_these)
        return float(squares.min())

    considered = [values]
    if len(y) > _ANY_TWO:
        considered = [[value for value in values if value != misread] for misread in values]
    if min(map(nearest, considered)) > _UNSHOWN:
        ranges = []
        for name, value, column in zip(names, y, f.T, strict=True):
            ranges.append(f"{name} is {value:g}, but its samples range from {column.min():.4g} to {column.max():.4g}")
        words = "; ".join(ranges)
        raise UntrustedError(f"no sampled drive reproduces the measured F'_ior (in arcsec): {words}", hint)
