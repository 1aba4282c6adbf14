"""Least squares of a drive's deviation vectors on the orders of a trace, through the contact model.

The unknowns are x and y of each vector, then start and zero of the record. Every step of the Gauss-Newton iteration
(docs/theory.md, (13) to (16)) solves the contacts anew. Directions among the unknowns along which the standard
uncertainty would exceed any plausible deviation are unidentifiable and stay where they are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from hdassist.comparing.record import Alignment, RecordedOrders, rms
from hdassist.comparing.vectors import VECTORS, vectors_of, with_vectors
from hdassist.error.waves import COARSE, MIDDLE, POINTS, Complex, ErrorWaves
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive

DOUBT_ROUNDS = 2  # times that the alignment is fitted with the model doubted at the one before
DIFFERENCE_STEP = 1.0  # of a vector's unit, of a difference quotient
LONGEST_STEP = 30.0  # of a vector's unit, or deg
STEP_SHARES = (1.0, 0.5, 0.2, 0.05)  # of a step, until one is downhill
MOST_STEPS = 15
SMALLEST_GAIN = 0.05  # of chi-square: a step that gains less is the last
SMALLEST_GAIN_SHARE = 1e-3  # of the chi-square before the step: the same
NEARER = 0.7  # of the chi-square at the drive's own deviations: a start must be below it to be taken instead
BLIND = 0.5  # of the greatest deviation: a direction of greater standard uncertainty is unidentifiable
LEAST_BLIND = 20.0  # of a vector's unit: the same at least
DIFFERENCE_ERROR = 1e-3  # of the greatest singular value: error of difference quotients
START_TURNS = (45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0)  # deg, of a vector before the first step
START_SCALES = (0.5, 1.5, 2.0)
START_SIZE = 50.0  # of a vector's unit: where the drive's own is 0
PROFILE_BLIND = 1e-2  # squared share of the start that may be unidentifiable where its profile is computed
PROFILE_LEAST = 1.0  # deg: standard uncertainty of the start from which on its profile is computed
PROFILE_STEPS = 6  # standard uncertainties of the start, to either side
PROFILE_RISE = 12.0  # of chi-square above the least: end of a profile

COUNT = len(VECTORS)
START_PLACE, ZERO_PLACE = 2 * COUNT, 2 * COUNT + 1  # places among the unknowns
WHEEL = np.array(["gbh".index(vector.part) for vector in VECTORS])  # what each vector turns with
WAVES_AROUND = np.array([vector.order for vector in VECTORS])


@dataclass(frozen=True, eq=False)
class VectorFit:
    """Deviations and alignment that fit a record best.

    vectors: complex, in their units, shape (vectors,); fitted: places of those that were free; free: places of the free
    ones among all unknowns, shape (f,); identifiable, unidentifiable: orthonormal directions among the free unknowns,
    shapes (f, i) and (f, f - i); covariance: of the free unknowns along the identifiable directions (16), shape (f, f).
    """

    vectors: Complex
    alignment: Alignment
    fitted: tuple[int, ...]
    free: NDArray[np.int64]
    chi_square: float
    identifiable: Array
    unidentifiable: Array
    covariance: Array

    @property
    def unknowns(self) -> Array:
        """X and y of all vectors in their units, start and zero [deg], shape (2 vectors + 2,)."""
        angles = np.degrees([self.alignment.start, self.alignment.zero])
        return np.concatenate([_components(self.vectors), angles])


class VectorFitter:
    """Fits of vectors of one drive to one record.

    Arguments: record; torus, waves of the drive's error; doubt: changes of the waves of a drive with other deviations,
    see doubtful_waves; start, zero: whether these are fitted with the vectors.
    """

    def __init__(
        self,
        drive: Drive,
        record: RecordedOrders,
        torus: ErrorWaves,
        doubt: Callable[[Drive], Complex],
        *,
        start: bool,
        zero: bool,
    ) -> None:
        self._drive, self.record, self._torus, self._doubt = drive, record, torus, doubt
        self._start, self._zero = start, zero
        self._own = vectors_of(drive)
        self._blind = max(LEAST_BLIND, BLIND * float(np.abs(self._own).max()))

    def base(self, alignment: Alignment) -> VectorFit:
        """The drive as it is, with start and zero fitted as far as they are free."""
        (waves,) = self._waves(self._own, (), POINTS)
        found, _ = self.record.scan(waves, alignment, start=self._start, zero=self._zero)
        return self._descend(self._own, found, (), POINTS)

    def doubting(self, changes: Complex, alignment: Alignment) -> tuple[VectorFitter, VectorFit]:
        """A fitter with the model doubted (14) at the alignment that fits best, and the drive as it is by it.

        changes: of the drive's waves, shape (changes, waves).
        """
        fitter, fit = self, self.base(alignment)
        for _ in range(DOUBT_ROUNDS if self._start or self._zero else 1):
            fitter = self._doubting_at(fit, changes)
            fit = fitter.base(alignment)
        return fitter, fit

    def with_shift(self, fit: VectorFit) -> VectorFit:
        """A fit whose covariance has in it how far it moves where the model is doubted at its own deviations."""
        drive = with_vectors(self._drive, fit.vectors, fit.fitted)
        other = self._doubting_at(fit, self._doubt(drive)).refined(fit)
        shift = fit.identifiable @ (fit.identifiable.T @ (other.unknowns - fit.unknowns)[fit.free])
        return replace(fit, covariance=fit.covariance + np.outer(shift, shift))

    def residual_rms_arcsec(self, fit: VectorFit) -> float:
        """Rms [arcsec] of the residual of a fit within the orders."""
        (waves,) = self._waves(fit.vectors, fit.fitted, POINTS)
        return rms(self.record.measured - self.record.predicted(waves, fit.alignment))

    def single(self, vector: int, base: VectorFit) -> VectorFit:
        """One vector fitted, the others as they are, on a torus fine enough to rank the fits."""
        starts = [self._own, *self._starts(vector)]
        waves = [self._waves(vectors, (vector,), COARSE)[0] for vectors in starts]
        scans = [self.record.scan(w, base.alignment, start=self._start, zero=self._zero) for w in waves]
        best = int(np.argmin([chi_square for _, chi_square in scans]))
        if scans[best][1] > NEARER * scans[0][1]:
            return self._descend(self._own, base.alignment, (vector,), MIDDLE)
        return self._descend(starts[best], scans[best][0], (vector,), MIDDLE)

    def refined(self, fit: VectorFit, vectors: Sequence[int] | None = None) -> VectorFit:
        """A fit continued on a fine torus, of the same vectors or of others."""
        fitted = fit.fitted if vectors is None else tuple(vectors)
        return self._descend(fit.vectors, fit.alignment, fitted, POINTS)

    def linear_gains(self, base: VectorFit) -> Array:
        """Decrease of chi-square that each vector alone promises to first order, shape (vectors,)."""
        everything = tuple(range(COUNT))
        residual, waves = self._residual(base.vectors, base.alignment, (), POINTS)
        jacobian = self._jacobian(base.vectors, base.alignment, everything, waves)
        gains = []
        for k in everything:
            own = jacobian[:, [2 * k, 2 * k + 1, *range(2 * COUNT, jacobian.shape[1])]]
            predicted = own @ np.linalg.lstsq(own, residual)[0]
            gains.append(2 * residual @ predicted - (predicted**2).sum())
        return np.array(gains)

    def profiled(self, fit: VectorFit) -> VectorFit:
        """A fit of one vector with its minimum and covariance over a profile of the start, where that is uncertain.

        The valley is bent and may have other minima; each start of the profile weighs as its chi-square has it.
        """
        start = 2  # the vector's two components come first
        if not self._start or self._zero or (fit.unidentifiable[start] ** 2).sum() > PROFILE_BLIND:
            return fit
        step = float(np.sqrt(fit.covariance[start, start]))
        if step < PROFILE_LEAST:
            return fit
        held = VectorFitter(self._drive, self.record, self._torus, self._doubt, start=False, zero=False)
        profile = [held._descend(fit.vectors, fit.alignment, fit.fitted, MIDDLE)]
        for way in (1, -1):
            last = profile[0]
            for _ in range(PROFILE_STEPS):
                turned = float(last.alignment.start + way * np.radians(step))
                last = held._descend(last.vectors, replace(last.alignment, start=turned), fit.fitted, MIDDLE)
                profile.append(last)
                if last.chi_square > min(point.chi_square for point in profile) + PROFILE_RISE:
                    break
        best = min(profile, key=lambda point: point.chi_square)
        result = fit if best is profile[0] else min(fit, self.refined(best), key=lambda each: each.chi_square)
        weights = np.exp(-(np.array([point.chi_square for point in profile]) - best.chi_square) / 2)
        covariance = np.zeros_like(result.covariance)
        for share, point in zip(weights / weights.sum(), profile, strict=True):
            shift = (point.unknowns - result.unknowns)[result.free]
            covariance += share * np.outer(shift, shift)
            covariance[:start, :start] += share * point.covariance
        return replace(result, covariance=covariance)

    def _doubting_at(self, fit: VectorFit, changes: Complex) -> VectorFitter:
        """A fitter of the record with a covariance (14) of changes, taken at the alignment of a fit."""
        (waves,) = self._waves(fit.vectors, fit.fitted, POINTS)
        record = self.record.doubting(waves, changes, fit.alignment)
        return VectorFitter(self._drive, record, self._torus, self._doubt, start=self._start, zero=self._zero)

    def _waves(self, vectors: Complex, fitted: Sequence[int], points: int, *others: Complex) -> Complex:
        """Waves of the drive with its vectors as given, and with others, shape (1 + others, waves)."""
        drives = [with_vectors(self._drive, each, fitted) for each in (vectors, *others)]
        return self._torus.waves(drives, points)

    def _starts(self, vector: int) -> Iterable[Complex]:
        """The drive's own vectors with one of them scaled and, unless its direction is unidentifiable, turned."""
        own = self._own[vector] or START_SIZE
        values = [own * scale for scale in START_SCALES]
        if not self._gauges(self._own, (vector,)).shape[1]:
            values += [own * np.exp(1j * np.radians(turn)) for turn in START_TURNS]
        if not self._own[vector]:
            values.append(own)
        for value in values:
            vectors = self._own.copy()
            vectors[vector] = value
            yield vectors

    def _free(self, fitted: Sequence[int]) -> NDArray[np.int64]:
        """Places among the unknowns of those that are fitted, shape (f,)."""
        components = [place for k in fitted for place in (2 * k, 2 * k + 1)]
        return np.array(components + [START_PLACE] * self._start + [ZERO_PLACE] * self._zero, dtype=np.int64)

    def _descend(self, vectors: Complex, alignment: Alignment, fitted: tuple[int, ...], points: int) -> VectorFit:
        """Gauss-Newton with steps (15) along the identifiable directions, until chi-square (13) hardly falls."""
        free = self._free(fitted)
        residual, waves = self._residual(vectors, alignment, fitted, points)
        for _ in range(MOST_STEPS if len(free) else 0):
            jacobian = self._jacobian(vectors, alignment, fitted, waves)
            directions, _, sizes = self._split(jacobian, self._gauges(vectors, fitted))
            step = directions @ ((directions.T @ jacobian.T @ residual) / sizes**2)  # (15), shape (f,)
            step *= min(1.0, LONGEST_STEP / max(float(np.abs(step).max(initial=0.0)), 1e-12))
            before = float(residual @ residual)
            for share in STEP_SHARES:
                trial = _moved(vectors, alignment, free, share * step)
                tried, tried_waves = self._residual(*trial, fitted, points)
                if tried @ tried < before:
                    (vectors, alignment), residual, waves = trial, tried, tried_waves
                    break
            if before - float(residual @ residual) < max(SMALLEST_GAIN, SMALLEST_GAIN_SHARE * before):
                break
        jacobian = self._jacobian(vectors, alignment, fitted, waves)
        directions, others, sizes = self._split(jacobian, self._gauges(vectors, fitted))
        covariance = np.asarray((directions / sizes**2) @ directions.T)  # (16), shape (f, f)
        chi_square = float(residual @ residual)
        return VectorFit(vectors, alignment, fitted, free, chi_square, directions, others, covariance)

    def _residual(
        self, vectors: Complex, alignment: Alignment, fitted: Sequence[int], points: int
    ) -> tuple[Array, Complex]:
        """Whitened residual y of (13), shape (2 orders,), and the waves, shape (waves,)."""
        (waves,) = self._waves(vectors, fitted, points)
        return self.record.whitened(self.record.measured - self.record.predicted(waves, alignment)), waves

    def _jacobian(self, vectors: Complex, alignment: Alignment, fitted: Sequence[int], waves: Complex) -> Array:
        """Whitened slopes J of the prediction by the free unknowns, shape (2 orders, f), per unit and deg."""
        columns = np.zeros((0, len(self.record.measured)))
        if fitted:
            steps = DIFFERENCE_STEP * np.array(
                [[part * (k == j) for j in range(COUNT)] for k in fitted for part in (1, 1j)]
            )
            base, *moved = self._waves(vectors, fitted, MIDDLE, *(vectors + step for step in steps))
            columns = self.record.predicted((np.array(moved) - base) / DIFFERENCE_STEP, alignment)
        turned = np.radians(self.record.slopes(waves, alignment))[[self._start, self._zero]]
        return self.record.whitened(np.concatenate([columns, turned])).T

    def _gauges(self, vectors: Complex, fitted: Sequence[int]) -> Array:
        """Directions among the free unknowns along which the error does not change, orthonormal, shape (f, gauges).

        To begin elsewhere is to turn all vectors of a wheel, which is possible where each of them is free or 0.
        """
        free = self._free(fitted)
        angles = free[free >= START_PLACE]
        turns = np.stack([self.record.starts, -np.array(self.record.rates)], axis=1)[
            :, angles - START_PLACE
        ]  # (wheels, angles)
        pinned = (vectors != 0) & ~np.isin(np.arange(COUNT), fitted)
        held = [bool(pinned[wheel == WHEEL].any()) for wheel in range(2)]
        gauges = null_space(turns[held]) if any(held) else np.eye(len(angles))  # (angles, gauges)
        directions = []
        for gauge in gauges.T:
            back = np.append(np.radians(-turns @ gauge), 0.0)  # of flexspline, rigid wheel and cam
            unknowns = np.append(_components(1j * WAVES_AROUND * vectors * back[WHEEL]), [0.0, 0.0])
            unknowns[angles] = gauge
            directions.append(unknowns[free])
        return np.asarray(np.linalg.qr(np.array(directions).T)[0]) if directions else np.zeros((len(free), 0))

    def _split(self, jacobian: Array, gauges: Array) -> tuple[Array, Array, Array]:
        """Identifiable directions, shape (f, i), unidentifiable ones, (f, f - i), and singular values of the first."""
        if not jacobian.shape[1]:
            return np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0)
        others = null_space(gauges.T) if gauges.shape[1] else np.eye(len(gauges))
        _, sizes, directions = np.linalg.svd(jacobian @ others, full_matrices=False)  # J = U s V'
        sharp = (sizes * self._blind > 1) & (sizes > DIFFERENCE_ERROR * sizes.max(initial=0.0))
        directions = others @ directions.T
        return directions[:, sharp], np.concatenate([directions[:, ~sharp], gauges], axis=1), sizes[sharp]


def _components(vectors: Complex) -> Array:
    """X and y of vectors, one after the other, shape (2 vectors,)."""
    return np.stack([vectors.real, vectors.imag], axis=1).ravel()


def _moved(vectors: Complex, alignment: Alignment, free: NDArray[np.int64], step: Array) -> tuple[Complex, Alignment]:
    """Vectors and alignment after a step of the free unknowns, shape (f,)."""
    full = np.zeros(2 * COUNT + 2)
    full[free] = step
    start, zero = alignment.start + np.radians(full[START_PLACE]), alignment.zero + np.radians(full[ZERO_PLACE])
    moved = vectors + full[:START_PLACE:2] + 1j * full[1:START_PLACE:2]
    return moved, replace(alignment, start=float(start), zero=float(zero))
