"""Evidence on a drive: figures known of it, each with the likelihood of a prediction.

Likelihoods are heavy-tailed (Student t with 4 degrees of freedom), so that one wrong figure does not decide alone, and
wide enough for the misfit of the model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hdassist.error.stiffness import stiffness
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.run.run import UNCHECKED
from hdassist.solve.answers import Certificate

FREEDOM = 4.0  # degrees of freedom of Student's t
MEAN_OF_TYPE = 0.15  # of a catalogue's stiffness, in the logarithm: drives of a type, and the model's misfit
WHOLE_FLANKS = 0.30  # of K_1 with flanks that bear as a whole (numerics.stations 1)
SOFT_EDGE = 0.25  # of a limit that every sold drive keeps

STIFFNESS_FIGURES = ("K_1", "K_2", "K_3", "lost_motion")  # N*m/rad, arcsec
ACCURACY = "accuracy"


@dataclass(frozen=True)
class Evidence:
    """A figure known of a drive: its path in the preset, value, and relative spread (misfit of the model included).

    one_sided: whether the value is a limit that the drive keeps, soft by the spread of it. figure: name of the
    prediction that it is held against.
    """

    path: str
    figure: str
    value: float
    spread: float
    one_sided: bool = False

    def log_likelihood(self, prediction: Array | float) -> Array:
        """Logarithm of the likelihood of predictions, 0 where they agree best, same shape."""
        predicted = np.asarray(prediction, dtype=float)
        if self.one_sided:
            deviation = np.maximum(predicted / self.value - 1, 0) / self.spread
        else:
            deviation = np.log(predicted / self.value) / self.spread
        return np.asarray(-(FREEDOM + 1) / 2 * np.log1p(deviation**2 / FREEDOM))


def evidence_of(drive: Drive) -> tuple[Evidence, ...]:
    """Evidence that the preset's `catalogue` is: stiffnesses of the type; lost motion and accuracy as kept limits."""
    catalogue, whole = drive.catalogue, drive.numerics.stations == 1
    spreads = {"K_1": WHOLE_FLANKS if whole else MEAN_OF_TYPE, "K_2": MEAN_OF_TYPE, "K_3": MEAN_OF_TYPE}
    found = []
    for figure in (*STIFFNESS_FIGURES, ACCURACY):
        if (value := getattr(catalogue, figure)) is not None:
            limit = figure not in spreads
            found.append(Evidence(f"catalogue.{figure}", figure, value, spreads.get(figure, SOFT_EDGE), limit))
    return tuple(found)


def stiffness_figures(drive: Drive) -> tuple[dict[str, float], Certificate]:
    """Stiffnesses K_1 to K_3 [N*m/rad], on the weaker side, and lost motion [arcsec] of a drive, with their proof.

    Raises UntrustedError where an answer cannot be trusted.
    """
    found = stiffness(drive, points=1, run=UNCHECKED)
    segments = [found.weaker(k) for k in (1, 2, 3)]
    return dict(zip(STIFFNESS_FIGURES, (*segments, found.lost_motion_arcsec), strict=True)), found.certificate


def log_likelihood(evidence: tuple[Evidence, ...], predictions: Mapping[str, float]) -> float:
    """Sum of the log-likelihoods of the pieces of evidence for which there is a prediction, by figure."""
    return float(sum(e.log_likelihood(predictions[e.figure]) for e in evidence if e.figure in predictions))
