"""The mounting position under uncertainty: phases and sizes of deviations are measured, and measured wrongly."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from hdassist.error.search import SEARCHED, CycleSearch, searchable
from hdassist.error.table import DEVIATIONS, STATES, ErrorTable, error_tables, turns
from hdassist.errors import UsageError
from hdassist.model.deviations import deviation_scalars
from hdassist.model.geometry import Array
from hdassist.model.unknown import draw, unknowns
from hdassist.mounting.positions import MountingCurve, merit, rotated
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate, Progress

LEAST_PROBABILITY = 0.95  # of a gain, for a turn to be worth making
TIE = 0.999  # of the merit: positions this near to the best of a sample share it


@dataclass(frozen=True)
class Criterion:
    """What decides over samples: their mean, their worst, or a quantile."""

    name: str
    quantile: float | None = None

    @classmethod
    def of(cls, text: str) -> Criterion:
        """Read expected, worst or quantile:0.9. Raises UsageError for anything else."""
        if text in ("expected", "worst"):
            return cls(text)
        name, _, number = text.partition(":")
        try:
            quantile = float(number)
        except ValueError:
            quantile = -1.0
        if name != "quantile" or not 0 < quantile < 1:
            raise UsageError(f"no criterion {text!r}", "expected, worst, or quantile:0.9")
        return cls(text, quantile)

    def over(self, merits: Array) -> Array:
        """One number a position from merits, shape (samples, positions)."""
        if self.quantile is not None:
            return np.asarray(np.quantile(merits, self.quantile, axis=0))
        return np.asarray(merits.mean(axis=0) if self.name == "expected" else merits.max(axis=0))


@dataclass(frozen=True)
class Robust:
    """Usable positions of a curve over samples of what is uncertain.

    places: of the positions on the curve, shape (positions,); F_ior_arcsec, shape (samples, torques, positions);
    merits, shape (samples, positions), against the mean of the present position, whose own are now, shape (samples,);
    standard_error_arcsec of F_ior_arcsec at each torque where it was interpolated, else 0, shape (torques,).
    """

    criterion: Criterion
    places: tuple[int, ...]
    F_ior_arcsec: Array
    merits: Array
    now: Array
    seed: int
    certificate: Certificate
    standard_error_arcsec: tuple[float, ...] = ()

    @property
    def value(self) -> Array:
        """The criterion at each position, shape (positions,)."""
        return self.criterion.over(self.merits)

    @property
    def best(self) -> int:
        """Which of the positions is the choice."""
        return int(np.argmin(self.value))

    @property
    def recommended(self) -> int:
        """Its place on the curve."""
        return self.places[self.best]

    @property
    def probability_best(self) -> Array:
        """Share of samples in which each position is the best one, ties shared, shape (positions,)."""
        return share_best(self.merits)

    @property
    def probability_gain(self) -> float:
        """Share of samples in which the choice is better than the present position."""
        return float(np.mean(self.merits[:, self.best] < self.now))

    @property
    def gain(self) -> float:
        """What the choice takes off the mean error of the present position, as a share of it."""
        return float(1 - self.merits[:, self.best].mean() / self.now.mean())

    @property
    def losses(self) -> Array:
        """How far the choice lies above the best position of each sample, as a share, shape (samples,)."""
        return np.asarray(self.merits[:, self.best] / self.merits.min(axis=1) - 1)

    @property
    def ratios(self) -> Array:
        """F'_ior of the worst position over that of the best one, shape (samples, torques)."""
        return np.asarray(self.F_ior_arcsec.max(axis=2) / self.F_ior_arcsec.min(axis=2))

    def loss(self, place: int) -> float:
        """Expected loss of another place on the curve against the choice, as a share of the present error."""
        position = self.places.index(place)
        return float(np.mean(self.merits[:, position] - self.merits[:, self.best]))


def share_best(merits: Array) -> Array:
    """Share of samples in which each position is the best one, ties shared, shape (positions,).

    Arguments: merits, shape (samples, positions).
    """
    first = merits <= merits.min(axis=1, keepdims=True) / TIE
    return np.asarray((first / first.sum(axis=1, keepdims=True)).mean(axis=0))


def robust(
    drive: Drive,
    curve: MountingCurve,
    *,
    samples: int = 200,
    criterion: str = "expected",
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Robust:
    """Sample what a preset does not know, or gives an uncertainty for, and look at each usable position of a curve.

    Uncertainties are expanded ones (k = 2) of normal distributions, cut where a field ends; what is not known is drawn
    evenly. Executor and progress as in mounting_curve. Raises UsageError where all is known, for an unknown criterion,
    or with rolling balls; UntrustedError where an answer cannot be trusted.
    """
    how = Criterion.of(criterion)
    if not is_open(drive):
        raise UsageError("the preset gives no uncertainty", "like --set uncertainty.phases.xi_b=10")
    if not searchable(drive):
        raise UsageError("uncertainty needs locked balls", "bearing.ball_motion: locked")
    places = tuple(int(p) for p in np.flatnonzero(curve.usable))
    rotations = [0.0, *(float(curve.rotation_deg[p]) for p in places)]
    drives = draw(drive, samples, seed)
    if interpolates(drive, samples, len(rotations)):
        # compared in every position, as it is used
        span = [rotated(sample, rotations[k % len(rotations)]) for k, sample in enumerate(drives)]
        [table] = error_tables([(drive, span)], curve.torques, executor=executor, progress=progress)
        found = np.array([_interpolated(sample, table, rotations) for sample in drives])
        proof, errors = sum((r.certificate for r in table), EMPTY), tuple(r.standard_error for r in table)
    else:
        tasks = [(sample, curve.torques, rotations) for sample in drives]
        F_ior, proof, errors = [], EMPTY, tuple(0.0 for _ in curve.torques)
        for values, certificate in (executor.map if executor else map)(_sampled, tasks):
            F_ior.append(values)
            proof += certificate
            if progress:
                progress(certificate.states)
        found = np.array(F_ior)
    # found: samples, torques, positions with the present one first
    merits = merit(np.moveaxis(found, 1, 0), found[:, :, 0].mean(axis=0), curve.weights)
    return Robust(how, places, found[:, :, 1:], merits[:, 1:], merits[:, 0], seed, proof, errors)


def is_open(drive: Drive) -> bool:
    """Whether there is anything to sample: what is not known, or has an uncertainty."""
    return bool(drive.uncertainty) or bool(unknowns(drive))


def interpolates(drive: Drive, samples: int, positions: int) -> bool:
    """Whether samples differ in deviations alone and are so many that a table of the error pays."""
    deviations = all(path.startswith(DEVIATIONS) for path in drive.uncertainty)
    return deviations and samples * positions * SEARCHED > STATES


def sample_states(drive: Drive, samples: int, positions: int) -> int:
    """Number of states that the samples take at one torque, about, for a progress bar."""
    if not is_open(drive) or not samples:
        return 0
    searched = samples * positions * SEARCHED
    return STATES if interpolates(drive, samples, positions) else searched


def _sampled(task: tuple[Drive, Sequence[float], Sequence[float]]) -> tuple[list[list[float]], Certificate]:
    drive, torques, rotations = task
    rows: list[list[float]] = []
    proofs: list[Certificate] = []
    for M_g in torques:
        search = CycleSearch(drive, M_g)
        found = [search.extremes(rotated(drive, rotation)) for rotation in rotations]
        rows.append([f.F_ior_arcsec for f in found])
        proofs += [f.certificate for f in found]
    return rows, sum(proofs, EMPTY)


def _interpolated(drive: Drive, table: Sequence[ErrorTable], rotations: Sequence[float]) -> Array:
    """F'_ior [arcsec] from tables, shape (torques, rotations)."""
    scalars = np.array([deviation_scalars(rotated(drive, rotation), *turns()) for rotation in rotations])
    return np.array([response.F_ior(scalars) for response in table])
