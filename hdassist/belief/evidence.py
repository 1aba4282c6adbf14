"""Evidence on a drive: figures known of it, each with the likelihood of a prediction.

Likelihoods are heavy-tailed (Student t with 4 degrees of freedom), so that one wrong figure does not decide alone, and
wide enough for the misfit of the model. Measured F'_ior count together (belief/misfit.py): the model is off by about as
much in all positions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from hdassist.belief.misfit import kernel, log_likelihood_of_errors
from hdassist.error.stiffness import stiffness
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.preset.measured import turn_of
from hdassist.run.run import UNCHECKED
from hdassist.solve.answers import Certificate

FREEDOM = 4.0  # degrees of freedom of Student's t
MEAN_OF_TYPE = 0.15  # of a catalogue's stiffness, in the logarithm: drives of a type, and the model's misfit
WHOLE_FLANKS = 0.30  # of K_1 with flanks that bear as a whole (numerics.stations 1)
MISFIT = 0.10  # of values measured on the drive: the model's alone
SOFT_EDGE = 0.25  # of a limit that every sold drive keeps
NO_PLAY = 2.0  # arcsec: misfit of lost motion and play where there is hardly any

SEGMENT_STIFFNESSES = ("K_1", "K_2", "K_3")  # N*m/rad
STIFFNESS_FIGURES = (*SEGMENT_STIFFNESSES, "lost_motion", "play")  # the last two in arcsec
ACCURACY = "accuracy"
ACCURACY_LOAD = 0.02  # of the rated torque, under which makers test it, one way: they say none or next to none


@dataclass(frozen=True)
class Evidence:
    """A figure known of a drive: its path in the preset, value, and spread (misfit of the model included).

    figure: name of the prediction that it is held against; kind: how far off a prediction is, by its logarithm or its
    share beyond a limit, over a relative spread, or by the difference, over a spread in the unit of the value. M_g
    [N*m] and rotation_deg of a measured F'_ior, 0 and 0 of all else.
    """

    path: str
    figure: str
    value: float
    spread: float
    kind: Literal["ratio", "limit", "difference"] = "ratio"
    M_g: float = 0.0
    rotation_deg: float = 0.0

    def log_likelihood(self, prediction: Array | float) -> Array:
        """Logarithm of the likelihood of predictions, 0 where they agree best, same shape."""
        predicted = np.asarray(prediction, dtype=float)
        if self.kind == "ratio":
            deviation = np.log(predicted / self.value) / self.spread
        elif self.kind == "limit":
            deviation = np.maximum(predicted / self.value - 1, 0) / self.spread
        else:
            deviation = (predicted - self.value) / self.spread
        return np.asarray(-(FREEDOM + 1) / 2 * np.log1p(deviation**2 / FREEDOM))


def evidence_of(drive: Drive, *, of_type: bool = False) -> tuple[Evidence, ...]:
    """Evidence that a preset has on a drive: its `catalogue`, and values `measured` on it.

    A catalogue's stiffnesses are means of the type; its lost motion and accuracy are limits that are kept. of_type:
    evidence on all drives of the type, of which this one shows the stiffness, but not their clearances and deviations.
    """
    whole = {"K_1": WHOLE_FLANKS} if drive.numerics.stations == 1 else {}

    def uncertainty(path: str) -> float:
        return drive.uncertainty.get(path, 0.0) / 2

    found = []
    for section, name in product(("catalogue", "measured"), (*STIFFNESS_FIGURES, ACCURACY)):
        path, of_catalogue = f"{section}.{name}", section == "catalogue"
        value = getattr(getattr(drive, section), name, None)
        if value is None:
            continue
        if name in SEGMENT_STIFFNESSES:
            usual = MEAN_OF_TYPE if of_catalogue or of_type else MISFIT
            spread = np.hypot(whole.get(name, usual), uncertainty(path) / value)
            found.append(Evidence(path, name, value, float(spread)))
        elif of_catalogue:
            found.append(Evidence(path, name, value, SOFT_EDGE, "limit"))
        elif not of_type:
            spread = np.hypot(max(MISFIT * value, NO_PLAY), uncertainty(path))
            found.append(Evidence(path, name, value, float(spread), "difference"))
    return (*found, *(() if of_type else measured_errors(drive)))


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


def stiffness_figures(drive: Drive) -> tuple[dict[str, float], Certificate]:
    """K_1 to K_3 [N*m/rad], on the weaker side, lost motion and play [arcsec] of a drive, by name, with their proof.

    Raises UntrustedError where an answer cannot be trusted.
    """
    found = stiffness(drive, points=1, run=UNCHECKED)
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
