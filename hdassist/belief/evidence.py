"""Evidence on a drive: figures known of it, each with the likelihood of a prediction; and how measured F'_ior errs.

Likelihoods are heavy-tailed (Student t with 4 degrees of freedom), so that one wrong figure does not decide alone, and
wide enough for the misfit of the model. Measured F'_ior count together: no preset is the drive, and the model is off by
about as much in all positions. Of a model whose F'_ior is f in the measured positions the drive shows

(1)  y = f + SCALE u f + a GP + noise,  a = misfit mean(f),  GP ~ exp(-(2 sin(d/2) / LENGTH)^2 / 2)

with u normal, d the turn between two positions, the misfit among MISFITS, and one value perhaps misread (MISREAD).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from scipy.special import ive, logsumexp

from hdassist.error.stiffness import stiffness
from hdassist.errors import UntrustedError
from hdassist.model.geometry import Array
from hdassist.model.rules import turn_of
from hdassist.preset.fields import Drive
from hdassist.run.run import UNCHECKED
from hdassist.solve.answers import Certificate
from hdassist.solve.formulation import Formulation

_FREEDOM = 4.0  # degrees of freedom of Student's t
_MEAN_OF_TYPE = 0.15  # of a catalogue's stiffness, in the logarithm: drives of a type, and the model's misfit
_WHOLE_FLANKS = 0.30  # of K_1 with flanks that bear as a whole (numerics.stations 1)
_MISFIT = 0.10  # of values measured on the drive: the model's alone
_SOFT_EDGE = 0.25  # of a limit that every sold drive keeps
# of a limit by which each drive was selected: the model's error of what the manufacturer read, assumed
_TESTED_EDGE = 0.05
# of the typical value of a type, in the logarithm: drives of a type differ in their deviations, assumed
_DRIVES_OF_TYPE = 0.30
_NO_PLAY = 2.0  # arcsec: misfit of lost motion and play where there is hardly any

SEGMENT_STIFFNESSES = ("K_1", "K_2", "K_3")  # N*m/rad
STIFFNESS_FIGURES = (*SEGMENT_STIFFNESSES, "lost_motion", "play")  # the last two in arcsec
ACCURACY = "accuracy"
# by catalogue.accuracy_test: positions of a revolution that are read; 0 for the whole of F'_ior
_TEST_POSITIONS = {"12_positions": 12}
ACCURACY_LOAD = 0.02  # of the rated torque, under which makers test it, one way: they say none or next to none


@dataclass(frozen=True)
class Evidence:
    """A figure known of a drive: its path in the preset, value, and spread (misfit of the model included).

    figure: name of the prediction that it is held against; kind: how far off a prediction is, by its logarithm or its
    share beyond a limit, over a relative spread, or by the difference, over a spread in the unit of the value. M_g
    [N*m] and rotation_deg of a measured F'_ior, 0 and 0 of all else. positions: of an accuracy, at how many positions
    of an output revolution it is read; 0 if the whole of F'_ior counts.
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
        """Logarithm of the likelihood of predictions, 0 where they agree best, same shape."""
        predicted = np.asarray(prediction, dtype=float)
        if self.kind == "ratio":
            deviation = np.log(predicted / self.value) / self.spread
        elif self.kind == "limit":
            deviation = np.maximum(predicted / self.value - 1, 0) / self.spread
        else:
            deviation = (predicted - self.value) / self.spread
        return np.asarray(-(_FREEDOM + 1) / 2 * np.log1p(deviation**2 / _FREEDOM))


def is_error_measured(drive: Drive) -> bool:
    """Return whether the preset of a drive states values of F'_ior that were measured on it."""
    return any(figure.M_g for figure in evidence_of(drive))


def evidence_of(drive: Drive, *, of_type: bool = False) -> tuple[Evidence, ...]:
    """Evidence that a preset has on a drive: its `catalogue`, and values `measured` on it.

    A catalogue's stiffnesses are means of the type; its lost motion and accuracy are limits that are kept. of_type:
    evidence on all drives of the type, of which this one shows the stiffness, but not their clearances and deviations.
    """
    whole = {"K_1": _WHOLE_FLANKS} if drive.numerics.stations == 1 else {}

    def uncertainty(path: str) -> float:
        return drive.uncertainty.get(path, 0.0) / 2

    found = []
    for section, name in product(("catalogue", "measured"), (*STIFFNESS_FIGURES, ACCURACY)):
        path, of_catalogue = f"{section}.{name}", section == "catalogue"
        value = getattr(getattr(drive, section), name, None)
        if value is None:
            continue
        if name in SEGMENT_STIFFNESSES:
            usual = _MEAN_OF_TYPE if of_catalogue or of_type else _MISFIT
            spread = np.hypot(whole.get(name, usual), uncertainty(path) / value)
            found.append(Evidence(path, name, value, float(spread)))
        elif name == ACCURACY:
            found.append(accuracy_evidence(value, drive.catalogue.accuracy_test))
        elif of_catalogue:
            found.append(Evidence(path, name, value, _SOFT_EDGE, "limit"))
        elif not of_type:
            spread = np.hypot(max(_MISFIT * value, _NO_PLAY), uncertainty(path))
            found.append(Evidence(path, name, value, float(spread), "difference"))
    return (*found, *(() if of_type else measured_errors(drive)))


def accuracy_evidence(value_arcsec: float, test: str) -> Evidence:
    """Return the evidence that the accuracy in a catalogue is.

    A tested accuracy is a limit that few drives exceed, because the others are not sold. If the test is not stated, the
    limit is soft: it may have been read at a few positions, which show a part of F'_ior. The figure is the reading of
    the test in any case.

    Args:
        value_arcsec: the accuracy [arcsec].
        test: as catalogue.accuracy_test states it.
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
    """Return at how many positions an accuracy is read; 0 if the whole of F'_ior counts.

    test: as catalogue.accuracy_test states it.
    """
    return _TEST_POSITIONS.get(test, 0)


def measured_errors(drive: Drive) -> tuple[Evidence, ...]:
    """F'_ior as measured on a drive with its fixed wheel turned from where it stands."""
    found = []
    for key, reading in drive.measured.F_ior.items():
        where, M_g = key.split("@")
        rotation = turn_of(where, drive.mounting.holes) % 360
        figure = f"F_ior@{float(M_g):g}" + (f"+{rotation:g}" if rotation else "")
        path, spread = f"measured.F_ior.{key}", reading.uncertainty / 2
        found.append(Evidence(path, figure, reading.value, spread, "difference", float(M_g), rotation))
    return tuple(found)


def stiffness_figures(drive: Drive, formulation: Formulation | None = None) -> tuple[dict[str, float], Certificate]:
    """K_1 to K_3 [N*m/rad], on the weaker side, lost motion and play [arcsec] of a drive, by name, with their proof.

    Argument: formulation of its contact system, where it is there already. Raises UntrustedError where an answer cannot
    be trusted.
    """
    found = stiffness(drive, points=1, formulation=formulation, run=UNCHECKED)
    figures = *(found.weaker(k) for k in (1, 2, 3)), found.lost_motion_arcsec, found.play_arcsec
    return dict(zip(STIFFNESS_FIGURES, figures, strict=True)), found.certificate


def log_likelihood(evidence: Sequence[Evidence], predictions: Mapping[str, float]) -> float:
    """Log likelihood of the pieces of evidence for which there is a prediction, by figure."""
    heard = [each for each in evidence if each.figure in predictions]
    alone = float(sum(each.log_likelihood(predictions[each.figure]) for each in heard if not each.M_g))
    errors = [each for each in heard if each.M_g]
    if not errors:
        return alone
    f = np.array([[predictions[each.figure] for each in errors]])
    return alone + float(log_likelihood_of_errors(f, *values_of_errors(errors))[0])


def values_of_errors(errors: Sequence[Evidence]) -> tuple[Array, Array, Array]:
    """Measured F'_ior and its spreads [arcsec], shape (errors,), and the correlation of the misfit between them."""
    y, spreads = np.array([(each.value, each.spread) for each in errors]).T
    torques, turns = np.array([each.M_g for each in errors]), [each.rotation_deg for each in errors]
    return y, spreads, kernel(turns, turns) * np.equal.outer(torques, torques)  # at another torque it is another one


SCALE = 0.10  # standard deviation of the drive's F'_ior over the model's, assumed
LENGTH = 0.6  # rad of the seat over which a misfit is alike, as of drives that differ in stiffness (benchmarks.misfit)
MISFITS = (0.0, 0.02, 0.04, 0.08)  # standard deviation of it as a share of the mean F'_ior, all alike likely; as there
_SMOOTH_ORDERS = 16  # of the Fourier series of a misfit over the seat: the next would be 1e-11
SMOOTH_NUMBERS = 2 * _SMOOTH_ORDERS + 1
LEAST_SHOWN = 0.1  # of the model's F'_ior, that a drive has at least
MISREAD = 0.03  # probability of a value to be misread; of several values one is at most
MISREAD_SHARE = 0.3  # standard deviation of a misread value, as a share of it
_UNSHOWN = 18.0  # squared standard deviations beyond which a sample does not show F'_ior as measured
_ANY_TWO = 3  # values: of no more, none is left out as misread, for the two that agree may do so by chance


def kernel(a_deg: Sequence[float], b_deg: Sequence[float]) -> Array:
    """Correlation of the misfit between positions [deg], shape (a, b)."""
    apart = np.radians(np.subtract.outer(a_deg, b_deg))
    return np.asarray(np.exp(-0.5 * np.square(2 * np.sin(apart / 2) / LENGTH)))


def smooth_misfits(rotations_deg: Sequence[float], normals: Array) -> Array:
    """Misfits of variance 1 in positions [deg], shape (draws, rotations), from normal numbers (draws, SMOOTH_NUMBERS).

    The Fourier series of the kernel, exp((cos d - 1)/LENGTH^2) = sum of exp(-k) I_n(k) cos(n d), k = 1/LENGTH^2: so the
    misfit in a position is the same whatever other positions are looked at.
    """
    order, angles = np.arange(_SMOOTH_ORDERS + 1)[:, None], np.radians(rotations_deg)
    size = np.sqrt(ive(order, LENGTH**-2) * np.where(order, 2, 1))
    series = np.vstack([size * np.cos(order * angles), (size * np.sin(order * angles))[1:]])
    return np.asarray((normals[:, :, None] * series).sum(axis=1))  # one position after the other, to the last digit


def errors_of_drive(
    f: Array, y: Array, variance: Array, spreads: Array, correlation: Array, drawn: tuple[Array, Array, Array]
) -> tuple[Array, Array]:
    """F'_ior of the drive [arcsec], shape (draws, positions), of which y was measured, and its scale over the model's.

    Drawn without the values, then moved by the difference of these from their own draw (Matheron's rule). Arguments: f
    of the model in positions and where it was measured, shape (draws, positions + values); variance of the misfit
    [arcsec^2], shape (draws,), spreads of the values, shape (draws, values), correlation of the misfit over positions
    and values; drawn, of variance 1: deviation of the scale, misfit, and noise of the values.
    """
    of_scale, misfit, noise = drawn
    count = f.shape[1] - len(y)
    scale = 1 + SCALE * of_scale
    F_ior = f * scale[:, None] + np.sqrt(variance)[:, None] * misfit
    there, seen = f[:, count:], F_ior[:, count:] + spreads * noise
    both = variance[:, None, None] * correlation[:, count:] + SCALE**2 * f[:, :, None] * there[:, None, :]
    moved = np.linalg.solve(both[:, count:] + np.square(spreads)[:, :, None] * np.eye(len(y)), (y - seen)[..., None])
    # a normal distribution has no end, an error has
    F_ior = np.maximum(F_ior + (both * moved[:, None, :, 0]).sum(axis=2), LEAST_SHOWN * f)[:, :count]
    return F_ior, scale + SCALE**2 * (there * moved[..., 0]).sum(axis=1)


@dataclass(frozen=True)
class ErrorKind:
    """How measured values err: misfit as a share of the mean F'_ior, noise over the stated one, the misread value.

    misread: place of that value, -1 where none is; log_share: logarithm of how probable the kind is before any value.
    """

    misfit: float = 0.0
    noise: float = 1.0
    misread: int = -1
    log_share: float = 0.0

    def spreads(self, stated: Array, y: Array) -> Array:
        """Standard deviations of values y [arcsec], shape (values,), from those that are stated."""
        misread = np.arange(len(y)) == self.misread
        return self.noise * np.where(misread, np.hypot(stated, MISREAD_SHARE * y), stated)


def error_kinds(values: int, log_noises: Mapping[float, float]) -> list[ErrorKind]:
    """Kinds of error that so many values may have; of misread ones the noise is as stated.

    Argument: log_noises, logarithm of how probable a noise over the stated one is, but for a factor.
    """
    right = (1 - MISREAD) ** values
    whole = logsumexp(list(log_noises.values())) + np.log(len(MISFITS) / right)
    plain = [ErrorKind(s, noise, -1, log - whole) for s in MISFITS for noise, log in log_noises.items()]
    each = (1 - right) / max(values, 1) / len(MISFITS)
    return plain + [ErrorKind(s, 1.0, k, np.log(each)) for k in range(values) for s in MISFITS]


def log_likelihoods(
    kinds: Sequence[ErrorKind],
    f: Array,
    y: Array,
    stated: Array,
    correlation: Array,
    mean: Array,
    read_error: float = 0.0,
) -> Array:
    """Log likelihood of measured F'_ior of each kind of error and sample, shape (kinds, samples).

    Arguments: stated, standard deviations of y; mean F'_ior of the samples [arcsec], shape (samples,), and read_error,
    relative error of f; the others as those of likelihood_of_errors.
    """
    rows = []
    for each in kinds:
        variance = (each.misfit**2 + read_error**2) * mean**2
        rows.append(each.log_share + _likelihood_of_errors(f, y, each.spreads(stated, y), variance, correlation)[1])
    return np.array(rows)


def _likelihood_of_errors(
    f: Array, y: Array, spreads: Array, variance: Array, correlation: Array
) -> tuple[Array, Array]:
    """How far measured F'_ior lies off that of samples, squared, in standard deviations, and the log likelihood.

    Arguments: f of the samples there, y measured [arcsec], shape (samples, values) and (values,); spreads, standard
    deviations of y; variance of the misfit [arcsec^2], shape (samples,), and its correlation, shape (values, values).
    In the eigenvectors of the correlation, whitened by the spreads, the covariance is diagonal, but for the scale's,
    which has rank one.
    """
    own, basis = np.linalg.eigh(correlation / np.multiply.outer(spreads, spreads))
    f, off = f / spreads @ basis, (y - f) / spreads @ basis
    each = 1 + variance[:, None] * np.maximum(own, 0)
    more = 1 + SCALE**2 * (f**2 / each).sum(axis=1)
    squares = (off**2 / each).sum(axis=1) - (SCALE * (f * off / each).sum(axis=1)) ** 2 / more
    return squares, -0.5 * (squares + np.log(each).sum(axis=1) + np.log(more)) - np.log(spreads).sum()


def log_likelihood_of_errors(f: Array, y: Array, spreads: Array, correlation: Array, read_error: float = 0.0) -> Array:
    """Log likelihood of measured F'_ior over misfits and misread values, less that of samples with just these values.

    Arguments: read_error, relative error of f; the others as those of likelihood_of_errors. Result of shape (samples,).
    """
    both, kinds = np.vstack([f, y]), error_kinds(len(y), {1.0: 0.0})
    log = logsumexp(log_likelihoods(kinds, both, y, spreads, correlation, both.mean(axis=1), read_error), axis=0)
    return np.asarray(log[:-1] - log[-1])


def require_shown(names: Sequence[str], f: Array, y: Array, spreads: Array, correlation: Array, hint: str) -> None:
    """Raise UntrustedError where no sample comes near F'_ior as measured: of equally bad ones all weigh the same.

    Any one of more than ANY_TWO values may be misread. Arguments: names of the values, and the remedy, for the message;
    the others as those of likelihood_of_errors.
    """
    variance, every = np.square(MISFITS[-1] * f.mean(axis=1)), range(len(y))

    def nearest(some: list[int]) -> float:
        own = correlation[np.ix_(some, some)]
        return float(_likelihood_of_errors(f[:, some], y[some], spreads[some], variance, own)[0].min())

    without = [[k for k in every if k != left] for left in every] if len(y) > _ANY_TWO else [list(every)]
    if min(map(nearest, without)) > _UNSHOWN:
        rows = zip(names, y, f.min(axis=0), f.max(axis=0), strict=True)
        words = "; ".join(f"{name} = {value:g}, samples {low:.4g} to {high:.4g}" for name, value, low, high in rows)
        raise UntrustedError(f"no sampled drive reproduces the measured F'_ior, ″: {words}", hint)
