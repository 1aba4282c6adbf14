"""Ranking of tolerances by the gain of one step tighter, and of measurements that narrow the unknown inputs.

Each sample is a random drive of a random design. The gain of a tolerance one step tighter is at most the gain between
the states of the present extremes; for the most promising tolerances all samples are solved again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hdassist.belief.influence import Influence, MeasurementGain, influences, measurements
from hdassist.belief.samples import Samples
from hdassist.belief.statistics import weighted_quantile
from hdassist.errors import UntrustedError
from hdassist.model.geometry import Array
from hdassist.preset.deviations import DEVIATION_FIELDS
from hdassist.tolerance.law import ProductionLaw
from hdassist.tolerance.production import TIGHTER_STEP, Production, RandomDrive

HIGH_SHARE = 0.95  # share of the drives below the percentile that is to become less
RESAMPLES = 200
ENDS = (0.05, 0.95)  # of the resampled values: the interval of a gain

Records = Callable[[Production, int], list[RandomDrive]]


@dataclass(frozen=True)
class Tightened:
    """95th percentile of F'_ior [arcsec] at a torque now, and with a tolerance (by path) one STEP tighter.

    low, high: Monte Carlo interval of the percentile then; proven: whether F'_ior was searched anew, else it may be
    greater than `then`.
    """

    path: str
    now: float
    then: float
    low: float
    high: float
    proven: bool

    @property
    def gain(self) -> float:
        """Decrease of the percentile by the step [arcsec]."""
        return self.now - self.then


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Gains of tightening and influences of inputs on F'_ior of a production.

    samples of its random drives; worst: place of the torque that is worst now (of its limit, where there are limits);
    tightened at each torque, the greatest gain first; influences there; to_measure, at the worst torque; drives, states
    and max_residual of the proof.
    """

    law: ProductionLaw
    samples: Samples
    worst: int
    tightened: tuple[tuple[Tightened, ...], ...]
    influences: tuple[tuple[Influence, ...], ...]
    to_measure: tuple[MeasurementGain, ...]
    drives: int
    states: int
    max_residual: float

    @property
    def first(self) -> Tightened:
        """The tolerance whose step takes most off at the worst torque."""
        return self.tightened[self.worst][0]

    @property
    def largest(self) -> Influence | None:
        """Input with the largest share of the variance at the worst torque; None where no share is computed."""
        return next(iter(self.influences[self.worst]), None)

    @property
    def is_worth_tightening(self) -> bool:
        """Whether a step of the first tolerance takes off anything for certain, and no field shared by all more."""
        if self.first.high >= self.first.now:
            return False
        return self.largest is None or self.largest.group in {way.path for way in self.tightened[self.worst]}


def sensitivities(production: Production, samples: Samples, records: Records) -> Sensitivities:
    """Sensitivities of a production, each of whose drives has a design of its own, and the samples of these designs.

    Argument: records, which gives so many records of a production. Raises UntrustedError where a drive has no answer.
    """
    drive, torques, law = production.drive, production.torques, production.law
    found = _sound(records(production, len(production.designs)))
    F_ior, weights = np.array([each.F_ior_arcsec for each in found]), np.array([each.weight for each in found])
    limits = [drive.limit(M_g) or 0.0 for M_g in torques]
    scale = np.array(limits) if all(limits) else np.ones(len(torques))
    now = [weighted_quantile(column, weights, HIGH_SHARE) for column in F_ior.T]
    worst = int(np.argmax(now / scale))
    sizes = [f.path for f in law.joint.fields if f.path == f.group and f.path in DEVIATION_FIELDS]
    then = {path: np.array([(each.tighter or {})[path] for each in found]) for path in sizes}
    ways = {path: _tightened(path, F_ior, then[path], weights, proven=False) for path in sizes}
    while True:
        first = min(ways, key=lambda path: ways[path][worst].then)
        if ways[first][worst].proven:
            break
        designs = tuple(
            ({**values, first: TIGHTER_STEP * values[first]}, weight) for values, weight in production.designs
        )
        again = _sound(records(replace(production, designs=designs, steps=False), len(designs)))
        ways[first] = _tightened(first, F_ior, np.array([each.F_ior_arcsec for each in again]), weights, proven=True)
        found += again
    return Sensitivities(
        law,
        samples,
        worst,
        tuple(
            tuple(sorted((way[t] for way in ways.values()), key=lambda each: each.then)) for t in range(len(torques))
        ),
        tuple(influences(samples, t) if samples.F_ior_arcsec[:, t].all() else () for t in range(len(torques))),
        to_measure(law, samples, worst),
        len(found),
        sum(each.states for each in found),
        max(each.max_residual for each in found),
    )


def to_measure(law: ProductionLaw, samples: Samples, torque: int) -> tuple[MeasurementGain, ...]:
    """The next measurements of a design, by the share of the spread of ln F'_ior that goes, the best first."""
    shared = {each.path for each in law.shared} - DEVIATION_FIELDS
    found = measurements(samples, torque) if samples.F_ior_arcsec[:, torque].all() else ()
    return tuple(each for each in found if each.measured in shared or each.measured.startswith("stiffness."))


def _sound(records: list[RandomDrive]) -> list[RandomDrive]:
    for record in records:
        if record.refused is not None:
            raise UntrustedError(f"a random drive has no answer: {record.refused}", "narrow what scatters")
    return records


def _tightened(path: str, F_ior: Array, then: Array, weights: Array, *, proven: bool) -> list[Tightened]:
    """Gain of a step of a tolerance at each torque, from F'_ior [arcsec] now and then, shape (drives, torques)."""
    resampled = np.random.default_rng(0).integers(0, len(F_ior), (RESAMPLES, len(F_ior)))
    found = []
    for before, after in zip(F_ior.T, then.T, strict=True):
        now, here = (weighted_quantile(values, weights, HIGH_SHARE) for values in (before, after))
        gains = [
            weighted_quantile(before[rows], weights[rows], HIGH_SHARE)
            - weighted_quantile(after[rows], weights[rows], HIGH_SHARE)
            for rows in resampled
        ]
        low, high = now - np.quantile(gains, ENDS[::-1])
        found.append(Tightened(path, now, here, float(low), float(high), proven))
    return found
