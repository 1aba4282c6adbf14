"""Torque that changes along a record: its wind-up is taken off, so that F'_ior is that of the mean torque.

By the record itself, a slope over the torque that is fitted together with the orders, where the torque does not go with
them, as gravity goes with the turn of the output; else by K_1 to K_3 of the drive's catalogue. Where those are known
the slope is over their twist, which is not straight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hdassist.error.stiffness import catalogue_torques
from hdassist.measuring.fit import TraceFit
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.readers.trace import MeasuredTrace

LEAST_CHANGE = 0.01  # of the greatest torque: smaller ones wind up nothing that shows
LOAD_APART = 0.1  # of a torque's changes: least part that does not go with orders and slow terms
CATALOGUE_SHARE = 0.1  # of a wind-up: standard uncertainty of a drive's stiffness by its catalogue; a guess
CLEAR_SENSE = 0.5  # correlation of error and wind-up
ARCSEC_PER_RAD = 648000 / np.pi


@dataclass(frozen=True)
class RecordedTorque:
    """Torque of a record [N*m]: its mean, least and greatest, and the wind-up that was taken off.

    by: "record", "catalogue", or empty where none was; wind_up_arcsec: its range; uncertainty_arcsec: standard
    uncertainty of that; of a fit, with its standard uncertainty, times_catalogue, how often the catalogue's twist it
    is, or stiffness_Nm_rad without one. has_catalogue: whether the drive is known with K_1 to K_3.
    """

    mean_Nm: float
    least_Nm: float
    greatest_Nm: float
    has_catalogue: bool
    by: str = ""
    wind_up_arcsec: float = 0.0
    uncertainty_arcsec: float = 0.0
    times_catalogue: tuple[float, float] | None = None
    stiffness_Nm_rad: tuple[float, float] | None = None

    @property
    def changes(self) -> bool:
        """Whether it changes by enough to wind up anything."""
        return self.greatest_Nm - self.least_Nm > LEAST_CHANGE * max(abs(self.least_Nm), abs(self.greatest_Nm))

    def fitted(self, fit: TraceFit, load: Array) -> RecordedTorque:
        """The same with what a fit has taken off; load: see load_of."""
        slope, unsure = fit.slopes["load"]
        size, reach = abs(slope), float(np.ptp(load))
        found = replace(self, by="record", wind_up_arcsec=size * reach, uncertainty_arcsec=unsure * reach)
        if self.has_catalogue:
            return replace(found, times_catalogue=(size, unsure))
        stiffness = ARCSEC_PER_RAD / max(size, 1e-300)
        return replace(found, stiffness_Nm_rad=(stiffness, stiffness * unsure / max(size, 1e-300)))

    def by_catalogue(self, trace: MeasuredTrace) -> tuple[MeasuredTrace, RecordedTorque]:
        """A trace less its load, the wind-up by a catalogue; towards growing angles where its sense is not clear."""
        load = np.zeros(0) if trace.load is None else trace.load
        sense = -1.0 if float(np.corrcoef(load, trace.error_arcsec)[0, 1]) < -CLEAR_SENSE else 1.0
        size = float(np.ptp(load))
        found = replace(self, by="catalogue", wind_up_arcsec=size, uncertainty_arcsec=CATALOGUE_SHARE * size)
        return replace(trace, error_arcsec=trace.error_arcsec - sense * load), found


def load_of(torque: Array, drive: Drive | None) -> tuple[Array, RecordedTorque]:
    """The load of torques [N*m]: their twist [arcsec] by K_1 to K_3 of a drive's catalogue less that at the mean.

    Without a catalogue the torques less their mean. And the torques in figures.
    """
    K = [drive.catalogue.K_1, drive.catalogue.K_2, drive.catalogue.K_3] if drive else []
    known = [each for each in K if each]
    found = RecordedTorque(
        float(torque.mean()), float(torque.min()), float(torque.max()), drive is not None and len(known) == len(K)
    )
    every = np.append(torque, found.mean_Nm)
    if drive and found.has_catalogue:
        T_1, T_2 = catalogue_torques(drive)
        knees = np.array([0.0, T_1, T_2, T_2 + float(np.abs(torque).max())])
        twist = np.cumsum([0.0, *(np.diff(knees) / known)]) * ARCSEC_PER_RAD
        every = np.sign(every) * np.interp(np.abs(every), knees, twist)
    return np.asarray(every[:-1] - every[-1]), found


def tells_compliance(fit: TraceFit) -> bool:
    """Whether the load of a fit's bins has a part that goes neither with its orders nor with its slow terms."""
    load = fit.design.bins.load
    return float(np.std(fit.design.residual(load))) > LOAD_APART * float(np.std(load))
