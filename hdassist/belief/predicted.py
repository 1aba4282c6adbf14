"""Comparison of measured F'_ior of a drive with the range predicted by its preset without measured values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from hdassist.belief.evidence import evidence_of, measured_errors
from hdassist.belief.prior import DrivePrior
from hdassist.belief.samples import EFFECTIVE_SAMPLES, SamplingEffort, draw_samples
from hdassist.belief.statistics import weighted_quantile
from hdassist.drive.model.geometry import Array
from hdassist.run.run import Run

_PREDICTED_SHARES = (0.05, 0.95)  # percentiles at the ends of a predicted range
_COVERAGE_FACTOR = 2.0  # coverage factor of a measured value


@dataclass(frozen=True)
class MeasuredBeside:
    """A measured F'_ior with its predicted range.

    place: field of the preset that contains the value, with its hole or rotation and its torque.
    value_arcsec, uncertainty_arcsec: the value and its standard uncertainty.
    low_arcsec, high_arcsec: 5th and 95th percentile of the prediction without measured values.
    """

    place: str
    value_arcsec: float
    uncertainty_arcsec: float
    low_arcsec: float
    high_arcsec: float

    @property
    def is_above(self) -> bool:
        """Whether the value minus its expanded uncertainty lies above the range."""
        return self.value_arcsec - _COVERAGE_FACTOR * self.uncertainty_arcsec > self.high_arcsec

    @property
    def is_below(self) -> bool:
        """Whether the value plus its expanded uncertainty lies below the range."""
        return self.value_arcsec + _COVERAGE_FACTOR * self.uncertainty_arcsec < self.low_arcsec


def measured_beside(
    value_arcsec: float,
    uncertainty_arcsec: float,
    predicted_arcsec: Array,
    weights: Array,
    place: str = "",
) -> MeasuredBeside:
    """Return a measured value with its predicted range.

    value_arcsec, uncertainty_arcsec: the value and its standard uncertainty.
    predicted_arcsec: F'_ior of the samples under the conditions of the measurement [arcsec], shape (samples,).
    weights: weights of the samples without measured values, shape (samples,).
    place: field of the preset that contains the value.
    """
    low, high = (weighted_quantile(predicted_arcsec, weights, share) for share in _PREDICTED_SHARES)
    return MeasuredBeside(
        place=place,
        value_arcsec=value_arcsec,
        uncertainty_arcsec=uncertainty_arcsec,
        low_arcsec=low,
        high_arcsec=high,
    )


def beside_prediction(
    prior: DrivePrior,
    *,
    draws: int = EFFECTIVE_SAMPLES,
    run: Run = Run(),
) -> tuple[MeasuredBeside, ...]:
    """Return the measured values of F'_ior of a drive with the ranges predicted without them.

    The samples are those of `check` for the preset without measured values, so they are often stored already.

    prior: prior of the drive with its measured values.
    draws: smallest effective sample size.
    run: the run.

    Raises UntrustedError if too few draws are valid drives.
    """
    drive = prior.drive
    figures = measured_errors(drive)
    if not figures:
        return ()
    # values may have been measured at other torques than those of the drive
    torques = tuple(dict.fromkeys((*drive.operation.M_g, *(figure.M_g for figure in figures))))
    turns = tuple(dict.fromkeys(figure.rotation_deg for figure in figures if figure.rotation_deg))
    # the prediction must not use the values with which it is compared
    bare = drive.model_copy(update={"measured": drive.measured.model_copy(update={"F_ior": {}})})
    evidence = evidence_of(bare)
    effort = SamplingEffort.of(draws)
    samples = draw_samples(
        replace(prior, drive=bare), torques, rotations_deg=turns, evidence=evidence, effort=effort, run=run
    )
    compared = []
    for figure in figures:
        torque = torques.index(figure.M_g)
        # in the present position all sets of deviations count; with the wheel turned only that of the sample does
        predicted_arcsec = samples.sets_arcsec[:, :, torque].ravel()
        weights = samples.set_weights.ravel()
        if figure.rotation_deg:
            predicted_arcsec = samples.turned_arcsec[:, torque, turns.index(figure.rotation_deg)]
            weights = samples.weights
        compared.append(measured_beside(figure.value, figure.spread, predicted_arcsec, weights, figure.path))
    return tuple(compared)


def beyond_words(compared: Sequence[MeasuredBeside]) -> list[str]:
    """Return a sentence for each value beyond its range, with the wording of `mount` (interface/terminal/languages)."""
    sentences = []
    for value in compared:
        if not (value.is_above or value.is_below):
            continue
        side = "above" if value.is_above else "below"
        predicted = f"{value.low_arcsec:.3g} to {value.high_arcsec:.3g}″ (5 to 95 %)"
        wider = "; hdassist presets new --quality unknown assumes wider tolerances" if value.is_above else ""
        sentences.append(
            f"{value.place}: {value.value_arcsec:g}″ is {side} the range that the preset predicts without measured "
            f"values, {predicted}: check the value, its torque and the tolerances{wider}"
        )
    return sentences
