"""Torque that changes along a record: its wind-up is taken off, so that F'_ior is that of the mean torque.

By the record itself, a slope over the torque that is fitted together with the orders, where the torque does not go with
them, as gravity goes with the turn of the output; else by K_1 to K_3 of the drive's catalogue.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hdassist.error.stiffness import catalogue_torques
from hdassist.measuring.fit import TraceFit
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.readers.trace import MeasuredTrace

LEAST_CHANGE = 0.01  # of the greatest torque: smaller ones wind up too little to see
LOAD_APART = 0.1  # of a torque's changes: least part that does not go with orders and slow terms
CATALOGUE_SHARE = 0.1  # of a wind-up: standard uncertainty of a drive's stiffness by its catalogue; a guess
CLEAR_SENSE = 0.5  # correlation of error and wind-up
ARCSEC_PER_RAD = 648000 / np.pi


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
        K = [drive.catalogue.K_1, drive.catalogue.K_2, drive.catalogue.K_3] if drive else []
        stiffness = [each for each in K if each]
        if trace.load is None or drive is None or len(stiffness) < len(K):
            return None
        T_1, T_2 = catalogue_torques(drive)
        knees = np.array([0.0, T_1, T_2, T_2 + float(np.abs(trace.load).max())])
        twist = np.cumsum([0.0, *(np.diff(knees) / stiffness)]) * ARCSEC_PER_RAD
        load = np.sign(trace.load) * np.interp(np.abs(trace.load), knees, twist)
        sense = -1.0 if float(np.corrcoef(load, trace.error_arcsec)[0, 1]) < -CLEAR_SENSE else 1.0
        size = float(np.ptp(load))
        found = replace(self, by="catalogue", wind_up_arcsec=size, uncertainty_arcsec=CATALOGUE_SHARE * size)
        return replace(trace, error_arcsec=trace.error_arcsec - sense * load), found


def tells_compliance(fit: TraceFit) -> bool:
    """Whether the load of a fit's bins has a part that goes neither with its orders nor with its slow terms."""
    load = fit.bins.load
    return float(np.std(fit.design.residual(load))) > LOAD_APART * float(np.std(load))
