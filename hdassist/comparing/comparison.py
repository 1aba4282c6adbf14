"""What a comparison of a measured trace with a drive has found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.comparing.record import Place
from hdassist.measuring.measurement import Direction, Measurement
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Certificate

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OrderPair:
    """One order: amplitude cos(per_cam_rev phi + phase), measured and predicted, and the amplitude of their difference.

    phi: the rig's cam angle; uncertainties are standard ones; cause in words.
    """

    per_cam_rev: float
    amplitude_arcsec: float
    uncertainty_arcsec: float
    phase_deg: float
    predicted_arcsec: float
    predicted_phase_deg: float
    difference_arcsec: float
    difference_uncertainty_arcsec: float
    cause: str


@dataclass(frozen=True)
class Change:
    """New value of one deviation vector, with standard uncertainties; direction None where the record tells none."""

    vector: int
    size_um: float
    size_uncertainty_um: float
    direction_deg: float | None
    direction_uncertainty_deg: float | None


@dataclass(frozen=True)
class Explanation:
    """The drive with some deviations fitted to the record.

    vectors: places in VECTORS of those that were free; changes: of those that the record tells; untold: names of
    those that it does not tell from each other, a tuple a combination; chi_square, freedom; share: of the difference's
    chi-square above that of noise, explained; clear: a better fit than chance makes; sufficient: no more is left than
    noise; overrides: of the preset, empty where not all is told; F_ior_arcsec, of the full cycle then, solved; None
    without overrides; left_arcsec: rms of what is left within the orders, from solved states of the record; None where
    those were not solved; left_orders: order, amplitude [arcsec] and cause of the greatest of that, clear of noise.
    """

    vectors: tuple[int, ...]
    changes: tuple[Change, ...]
    untold: tuple[tuple[str, ...], ...]
    chi_square: float
    freedom: int
    share: float
    clear: bool
    sufficient: bool
    overrides: tuple[str, ...]
    F_ior_arcsec: float | None
    left_arcsec: float | None
    left_orders: tuple[tuple[float, float, str], ...]
    place: Place


@dataclass(frozen=True)
class Finding:
    """What is concluded: agrees, mirrored, one (deviation explains it), several (together), or unexplained."""

    kind: str
    best: Explanation | None = None


@dataclass(frozen=True)
class Mirror:
    """Another reading of the file that fits clearly better: the option that says so, and rms of the difference then."""

    option: str
    rms_arcsec: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """A measured trace beside what a drive should do.

    M_g [N*m]; found: the measured side; place and its standard uncertainties [deg], None where given; predicted_arcsec
    at the cells, levels and drift as the residual has none; residual_arcsec at the cells; coefficients of the orders,
    measured and predicted; ranges [arcsec] limited to the orders over the angles visited; F_ior_arcsec of the drive
    over the full cycle; chi_square and freedom of the drive as it is; singles: one of each vector; joint;
    both none where nothing is called for.
    """

    drive: Drive
    measurement: Measurement
    M_g: float
    place: Place
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
    F_ior_arcsec: float
    chi_square: float
    freedom: int
    singles: tuple[Explanation, ...]
    joint: Explanation | None
    finding: Finding
    mirror: Mirror | None
    certificate: Certificate
    warnings: tuple[str, ...]

    @property
    def found(self) -> Direction:
        """The measured side, both directions as one."""
        return self.measurement.directions[0]
