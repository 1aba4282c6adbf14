"""Slopes that are fitted together with the orders: over the speed, a lag between the encoders, and over the torque.

A lag times the speed is an offset that changes sign with the direction and grows with the speed. At an even speed it is
part of the level, and F'_ior has no part of it; friction and play change the level with the direction too. So a lag is
known only where the speed changes within a sweep.

The wind-up by a torque that changes along a record is taken off, so that F'_ior is that of the mean torque: by the
record itself, where the torque does not go with the orders, as gravity goes with the turn of the output; else by K_1 to
K_3 of the drive's catalogue.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hdassist.error.stiffness import catalogue_torques
from hdassist.measuring.bins import Bins
from hdassist.measuring.fit import TraceFit
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.readers.trace import MeasuredTrace
from hdassist.readers.words import TURN_ARCSEC

LEAST_SPEED_CHANGE = 0.02  # of the speed: within sweeps, from which on a lag is fitted
LEAST_CHANGE = 0.01  # of the greatest torque: smaller ones wind up too little to see
LOAD_APART = 0.1  # of a torque's changes: least part that does not go with orders and slow terms
CATALOGUE_SHARE = 0.1  # of a wind-up: standard uncertainty of a drive's stiffness by its catalogue; a guess
CLEAR_SENSE = 0.5  # correlation of error and wind-up
ARCSEC_PER_RAD = 648000 / np.pi


@dataclass(frozen=True)
class EncoderLag:
    """Lag [ms] of the output's reading behind the cam's, and its standard uncertainty."""

    ms: float
    uncertainty_ms: float


def speed_changes(bins: Bins) -> bool:
    """Whether the speed within the sweeps changes by enough to tell a lag."""
    apart = [speed - np.median(speed) for speed in (bins.speed[bins.sweep == k] for k in range(bins.sweeps))]
    low, high = np.quantile(np.concatenate(apart), (0.05, 0.95))  # a turning point alone tells no lag
    return float(high - low) / 2 > LEAST_SPEED_CHANGE * float(np.abs(bins.speed).mean())


def encoder_lag(fits: Sequence[TraceFit], ratio: float, sense: int) -> EncoderLag | None:
    """Lag by the fits of both directions; None where the speed does not change.

    Arguments: ratio, cam turns per output turn; sense, in which the two encoders count, 0 for a column of errors.
    """
    slopes = [fit.slopes["speed"] for fit in fits if "speed" in fit.slopes]
    if not slopes:
        return None
    values, spreads = np.array(slopes).T * (1e3 * ratio * (sense or 1) / TURN_ARCSEC)  # ms
    weight = np.maximum(np.abs(spreads), 1e-15) ** -2
    return EncoderLag(float(np.average(values, weights=weight)), float(weight.sum() ** -0.5))


@dataclass(frozen=True)
class RecordedTorque:
    """Torque of a record [N*m]: its mean, least and greatest, and the wind-up that was taken off.

    by: "record", "catalogue", or empty where none was; wind_up_arcsec: its range; uncertainty_arcsec: standard
    uncertainty of that; stiffness_Nm_rad: by the record, with its standard uncertainty.
    """

    mean_Nm: float
    least_Nm: float
    greatest_Nm: float
    by: str = ""
    wind_up_arcsec: float = 0.0
    uncertainty_arcsec: float = 0.0
    stiffness_Nm_rad: tuple[float, float] | None = None

    @classmethod
    def of(cls, torque: Array) -> RecordedTorque:
        """The torque of rows [N*m] in figures."""
        return cls(float(torque.mean()), float(torque.min()), float(torque.max()))

    @property
    def changes(self) -> bool:
        """Whether it changes by enough to wind up anything."""
        return self.greatest_Nm - self.least_Nm > LEAST_CHANGE * max(abs(self.least_Nm), abs(self.greatest_Nm))

    def fitted(self, slope: float, uncertainty: float) -> RecordedTorque:
        """The same with the slope over the torque that a fit has taken off, and its uncertainty [arcsec/(N*m)]."""
        size, reach = max(abs(slope), 1e-300), self.greatest_Nm - self.least_Nm
        stiffness = ARCSEC_PER_RAD / size
        own = stiffness, stiffness * uncertainty / size
        return replace(
            self, by="record", wind_up_arcsec=size * reach, uncertainty_arcsec=uncertainty * reach, stiffness_Nm_rad=own
        )

    def by_catalogue(self, trace: MeasuredTrace, drive: Drive | None) -> tuple[MeasuredTrace, RecordedTorque] | None:
        """A trace less the twist by K_1 to K_3 of a drive, towards growing angles where its sense is not clear.

        None without all three.
        """
        stiffness = [drive.catalogue.K_1, drive.catalogue.K_2, drive.catalogue.K_3] if drive else []
        if trace.load is None or drive is None or not all(stiffness):
            return None
        size = np.abs(trace.load)
        T_1, T_2 = catalogue_torques(drive)
        knees = np.array([0.0, T_1, T_2, T_2 + float(size.max())])
        twist = np.cumsum([0.0, *(np.diff(knees) / np.array(stiffness, float))]) * ARCSEC_PER_RAD
        load = np.sign(trace.load) * np.interp(size, knees, twist)
        sense = -1.0 if float(np.corrcoef(load, trace.error_arcsec)[0, 1]) < -CLEAR_SENSE else 1.0
        span = float(np.ptp(load))
        found = replace(self, by="catalogue", wind_up_arcsec=span, uncertainty_arcsec=CATALOGUE_SHARE * span)
        return replace(trace, error_arcsec=trace.error_arcsec - sense * load), found


def tells_compliance(fit: TraceFit) -> bool:
    """Whether the load of a fit's bins has a part that goes neither with its orders nor with its slow terms."""
    load = fit.bins.load
    return float(np.std(fit.design.fitted(load)[1])) > LOAD_APART * float(np.std(load))
