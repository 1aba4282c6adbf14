"""Least squares of a drive's deviation vectors on the orders of a trace, through the contact model.

The unknowns are x and y of each vector, then start and zero of the record [deg]. Every step of the Gauss-Newton
iteration (docs/theory.md, (13) to (16)) solves the contacts anew. Directions among the unknowns along which the
standard uncertainty would exceed any plausible deviation are unidentifiable and stay if they are.

This is not the fit of correction.records.agreeing_drives, which answers another question. Here: which deviation, of any
size and against the preset, would explain the difference; so no prior pulls, doubts of the model widen the covariance,
and a direction that the record does not show has no number. There: which drives that the preset allows may have made
the record, and what error do they have in turns and at torques that it has not; so a prior holds all that is open,
deviations that are given stay, doubts are fitted with the rest, and the answer is many drives. Both take the alignment,
the doubts and F'_ior of a record from the same code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from hdassist.comparing.record import (
    SLOPE_WAVE_POINTS,
    VECTOR_ORDERS,
    VECTORS,
    RecordedOrders,
    rms,
    vectors_of,
    with_vectors,
)
from hdassist.error.waves import WAVE_POINTS, Complex, ErrorWaves
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive

COARSE = 16  # positions around each wheel, for a first look at very different deviations
_DOUBT_ROUNDS = 2  # times that the alignment is fitted with the model doubted at the one before
_VECTOR_STEP = 1.0  # step of a difference quotient, in the unit of the vector
_LONGEST_STEP = 30.0  # longest step of a descent, in the unit of the vector or in deg
_STEP_SHARES = (1.0, 0.5, 0.2, 0.05)  # of a step, until one is downhill
_MOST_STEPS = 15
_SMALLEST_GAIN = 0.05  # decrease of chi-square below which a step is the last
_SMALLEST_GAIN_SHARE = 1e-3  # the same, as a share of the chi-square before the step
_NEARER = 0.7  # a start replaces the drive's own deviations if its chi-square is below this share of theirs
_BLIND = 0.5  # a direction is unidentifiable if its standard uncertainty exceeds this share of the largest deviation
_LEAST_BLIND = 20.0  # the same, at least, in the unit of a vector
_DIFFERENCE_ERROR = 1e-3  # error of difference quotients, as a share of the largest singular value
_START_TURNS = (45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0)  # deg, of a vector before the first step
_START_SCALES = (0.5, 1.5, 2.0)
_START_SIZE = 50.0  # size of a start in the unit of the vector if the drive's own size is 0
_PROFILE_BLIND = 1e-2  # squared share of the start that may be unidentifiable where its profile is computed
_PROFILE_LEAST = 1.0  # deg: standard uncertainty of the start from which on its profile is computed
_PROFILE_STEPS = 6  # standard uncertainties of the start, to either side
_PROFILE_RISE = 12.0  # a profile ends where chi-square exceeds its minimum by this much

COUNT = len(VECTORS)
_WHEEL = np.array(["gbh".index(vector.part) for vector in VECTORS])  # part that each vector turns with


@dataclass(frozen=True, eq=False)
class VectorFit:
    """Deviations and alignment that fit a record best.

    unknowns: all of them, shape (2 vectors + 2,); fitted: places of the vectors that were free; free: places of the
    free unknowns, shape (f,); unidentifiable: orthonormal directions among these, shape (f, u); covariance: of the free
    unknowns along all other directions (16), shape (f, f).
    """

    unknowns: Array
    fitted: tuple[int, ...]
    free: NDArray[np.int64]
    chi_square: float
    unidentifiable: Array
    covariance: Array

    @property
    def vectors(self) -> Complex:
        """The vectors in their units, shape (vectors,)."""
        return _complex_of(self.unknowns)


@dataclass(frozen=True, eq=False)
class VectorFitter:
    """Fits of vectors of one drive to one record.

    torus: waves of the drive's error; doubt: changes of the waves of a drive with other deviations, see doubtful_waves;
    angles: whether start and zero of the record are fitted with the vectors.
    """

    drive: Drive
    record: RecordedOrders
    torus: ErrorWaves
    doubt: Callable[[Drive], Complex]
    angles: tuple[bool, bool]

    def base(self) -> VectorFit:
        """Return the drive as it is, with start and zero fitted as far as they are free."""
        alignment = self.record.alignment
        unknowns = np.array([*vectors_of(self.drive).view(float), alignment.start_deg, alignment.zero_deg])
        # start and zero have many local minima: they are scanned before a descent
        unknowns[-2:], _ = self.record.scan(self._waves(unknowns, ())[0], unknowns[-2:])
        return self._descend(unknowns, ())

    def doubted(self, changes: Complex) -> tuple[VectorFitter, VectorFit]:
        """Return a fitter with the model doubted (14) at the alignment that fits best, and the drive as it is by it.

        changes: of the drive's waves, shape (changes, waves).
        """
        fitter = self
        fit = self.base()
        # the doubt depends on the alignment, and the alignment on the doubt
        for _ in range(_DOUBT_ROUNDS if any(self.angles) else 1):
            fitter = self._doubted_at(fit, changes)
            fit = fitter.base()
        return fitter, fit

    def with_shift(self, fit: VectorFit) -> VectorFit:
        """Return a fit whose covariance has in it how far it moves where the model is doubted at its own deviations."""
        changes = self.doubt(with_vectors(self.drive, fit.vectors, fit.fitted))
        shift = (self._doubted_at(fit, changes).refined(fit).unknowns - fit.unknowns)[fit.free]
        # a direction that the recording does not see cannot move
        shift -= fit.unidentifiable @ (fit.unidentifiable.T @ shift)
        return replace(fit, covariance=fit.covariance + np.outer(shift, shift))

    def residual_rms_arcsec(self, fit: VectorFit) -> float:
        """Return the rms [arcsec] of the residual of a fit within the orders."""
        (waves,) = self._waves(fit.unknowns, fit.fitted)
        return rms(self.record.measured - self.record.predicted(waves, fit.unknowns[-2:]))

    def single(self, vector: int, base: VectorFit) -> VectorFit:
        """Return the fit of one vector, the others as they are, on a torus fine enough to rank the fits."""
        # several sizes and directions: chi-square has more than one minimum
        starts = list(self._starts(vector, base))
        scans = [self.record.scan(self._waves(start, (vector,), COARSE)[0], start[-2:]) for start in starts]
        best = int(np.argmin([chi_square for _, chi_square in scans]))
        # the drive's own deviations are left only for a clearly better start
        if scans[best][1] <= _NEARER * scans[0][1]:
            starts[0] = np.append(starts[best][:-2], scans[best][0])
        return self._descend(starts[0], (vector,), SLOPE_WAVE_POINTS)

    def refined(self, fit: VectorFit, fitted: Sequence[int] = ()) -> VectorFit:
        """Return a fit continued on a fine torus, of the same vectors or of others."""
        return self._descend(fit.unknowns, tuple(fitted) or fit.fitted)

    def linear_gains(self, base: VectorFit) -> Array:
        """Return the decrease of chi-square that each vector alone promises to first order, shape (vectors,)."""
        # one linearisation for all vectors
        residual, waves = self._residual(base.unknowns, (), WAVE_POINTS)
        jacobian = self._jacobian(base.unknowns, tuple(range(COUNT)), waves)
        columns_of_vector = [
            jacobian[:, [2 * k, 2 * k + 1, *range(2 * COUNT, jacobian.shape[1])]] for k in range(COUNT)
        ]
        return np.array([residual @ columns @ np.linalg.lstsq(columns, residual)[0] for columns in columns_of_vector])

    def profiled(self, fit: VectorFit) -> VectorFit:
        """Return a fit of one vector with its minimum and covariance over a profile of the start, if this is uncertain.

        The valley is bent and may have other minima; each start of the profile weighs as its chi-square has it.
        """
        start = 2  # the vector's two components come first
        # only an unknown start makes the profile bend
        if self.angles != (True, False) or (fit.unidentifiable[start] ** 2).sum() > _PROFILE_BLIND:
            return fit
        step = float(np.sqrt(fit.covariance[start, start]))
        if step < _PROFILE_LEAST:
            return fit
        profile = self._profile_of(fit, step)
        chi_square = np.array([point.chi_square for point in profile])
        best = int(chi_square.argmin())
        result = min(fit, self.refined(profile[best]), key=lambda candidate: candidate.chi_square) if best else fit
        # likelihood along the profile
        weights = np.exp((chi_square[best] - chi_square) / 2)
        weights /= weights.sum()
        shifts = np.array([point.unknowns - result.unknowns for point in profile])[:, result.free]
        covariance = (weights * shifts.T) @ shifts
        covariance[:start, :start] += np.tensordot(
            weights,
            [point.covariance for point in profile],
            axes=1,
        )
        return replace(result, covariance=covariance)

    def _profile_of(self, fit: VectorFit, step: float) -> list[VectorFit]:
        """Return fits with the start fixed at steps [deg] to both sides of a fit, first at the fit itself.

        A side ends where chi-square has risen clearly above its least value.
        """
        with_fixed_angles = replace(self, angles=(False, False))
        direction = np.arange(2 * COUNT + 2) == 2 * COUNT  # of the start among the unknowns
        profile = [with_fixed_angles._descend(fit.unknowns, fit.fitted, SLOPE_WAVE_POINTS)]
        for signed_step in (step, -step):
            last = profile[0]
            for _ in range(_PROFILE_STEPS):
                unknowns = last.unknowns + signed_step * direction
                last = with_fixed_angles._descend(unknowns, fit.fitted, SLOPE_WAVE_POINTS)
                profile.append(last)
                if last.chi_square > min(point.chi_square for point in profile) + _PROFILE_RISE:
                    break
        return profile

    def _doubted_at(self, fit: VectorFit, changes: Complex) -> VectorFitter:
        """Return a fitter of the record with a covariance (14) of changes, taken at the alignment of a fit."""
        (waves,) = self._waves(fit.unknowns, fit.fitted)
        return replace(self, record=self.record.doubting(waves, changes, fit.unknowns[-2:]))

    def _waves(
        self,
        unknowns: Array,
        fitted: Sequence[int],
        points: int = WAVE_POINTS,
        *steps: Array,
    ) -> Complex:
        """Return waves of the drive with fitted vectors from the unknowns, and a step on, shape (1 + steps, waves)."""
        moved = [_complex_of(unknowns + step) for step in (np.zeros_like(unknowns), *steps)]
        return self.torus.waves([with_vectors(self.drive, vectors, fitted) for vectors in moved], points)

    def _starts(self, vector: int, base: VectorFit) -> Iterator[Array]:
        """Yield unknowns of the drive as it is, and with one vector scaled and, if its direction matters, turned."""
        yield base.unknowns
        vector_of_base = base.vectors[vector]
        factors = [*_START_SCALES]
        if not self._gauges(base.unknowns, (vector,)).shape[1]:
            factors += np.exp(1j * np.radians(_START_TURNS)).tolist()
        for factor in factors if vector_of_base else [*factors, 1.0]:
            unknowns = base.unknowns.copy()
            _complex_of(unknowns)[vector] = (vector_of_base or _START_SIZE) * factor
            yield unknowns

    def _free(self, fitted: Sequence[int]) -> NDArray[np.int64]:
        """Return the places among the unknowns of those that are fitted, shape (f,)."""
        components = [place for k in fitted for place in (2 * k, 2 * k + 1)]
        return np.array([*components, *(2 * COUNT + np.flatnonzero(self.angles))], dtype=np.int64)

    def _descend(
        self,
        unknowns: Array,
        fitted: tuple[int, ...],
        points: int = WAVE_POINTS,
    ) -> VectorFit:
        """Descend by Gauss-Newton steps (15) along the identifiable directions, until chi-square (13) hardly falls."""
        free = self._free(fitted)
        residual, waves = self._residual(unknowns, fitted, points)
        for _ in range(_MOST_STEPS if len(free) else 0):
            jacobian, directions, _, sizes = self._linearized(unknowns, fitted, waves)
            step = np.zeros_like(unknowns)
            step[free] = directions @ ((directions.T @ jacobian.T @ residual) / sizes**2)  # (15)
            step *= min(1.0, _LONGEST_STEP / max(float(np.abs(step).max()), 1e-12))
            before = float(residual @ residual)
            for share in _STEP_SHARES:
                tried = self._residual(unknowns + share * step, fitted, points)
                if tried[0] @ tried[0] < before:
                    unknowns = unknowns + share * step
                    residual, waves = tried
                    break
            if before - float(residual @ residual) < max(_SMALLEST_GAIN, _SMALLEST_GAIN_SHARE * before):
                break
        _, directions, unidentifiable, sizes = self._linearized(unknowns, fitted, waves)
        covariance = np.asarray((directions / sizes**2) @ directions.T)  # (16), shape (f, f)
        return VectorFit(
            unknowns=unknowns,
            fitted=fitted,
            free=free,
            chi_square=float(residual @ residual),
            unidentifiable=unidentifiable,
            covariance=covariance,
        )

    def _residual(
        self,
        unknowns: Array,
        fitted: Sequence[int],
        points: int,
    ) -> tuple[Array, Complex]:
        """Return the whitened residual y of (13), shape (2 orders,), and the waves, shape (waves,)."""
        (waves,) = self._waves(unknowns, fitted, points)
        return self.record.whitened(self.record.measured - self.record.predicted(waves, unknowns[-2:])), waves

    def _jacobian(
        self,
        unknowns: Array,
        fitted: Sequence[int],
        waves: Complex,
    ) -> Array:
        """Return whitened slopes J of the prediction by the free unknowns, per unit and deg, shape (2 orders, f)."""
        steps = _VECTOR_STEP * np.eye(len(unknowns))[self._free(fitted)[: 2 * len(fitted)]]
        columns = self.record.slopes(waves, unknowns[-2:])[list(self.angles)]
        if fitted:
            base, *moved = self._waves(unknowns, fitted, SLOPE_WAVE_POINTS, *steps)
            by_vectors = self.record.predicted((np.array(moved) - base) / _VECTOR_STEP, unknowns[-2:])
            columns = np.concatenate([by_vectors, columns])
        return self.record.whitened(columns).T

    def _gauges(self, unknowns: Array, fitted: Sequence[int]) -> Array:
        """Return orthonormal directions of the free unknowns along which the error does not change, shape (f, gauges).

        To begin elsewhere is to turn all vectors of a wheel, which is possible where each of them is free or 0.
        """
        free = self._free(fitted)
        vectors = _complex_of(unknowns)
        if not any(self.angles):
            return np.zeros((len(free), 0))
        pinned = (vectors != 0) & ~np.isin(np.arange(COUNT), fitted)
        is_pinned = np.array([bool(pinned[wheel == _WHEEL].any()) for wheel in range(2)])
        turns = self.record.turns[:, list(self.angles)]  # (2 wheels, angles)
        gauges = null_space(turns * is_pinned[:, None])  # (angles, gauges)
        back = np.radians(
            np.vstack([-turns @ gauges, np.zeros(gauges.shape[1])])
        )  # of flexspline, circular spline and wave generator
        moved = (1j * VECTOR_ORDERS * vectors)[:, None] * back[_WHEEL]  # (vectors, gauges)
        components = np.stack([moved.real, moved.imag], axis=1).reshape(2 * COUNT, -1)
        directions = np.concatenate([components[free[: 2 * len(fitted)]], gauges])
        return np.asarray(np.linalg.qr(directions)[0])

    def _linearized(
        self,
        unknowns: Array,
        fitted: tuple[int, ...],
        waves: Complex,
    ) -> tuple[Array, Array, Array, Array]:
        """Return slopes J, directions that are identifiable and that are not, and singular values of J along the first.

        Shapes: (2 orders, f), (f, i), (f, f - i), (i,).
        """
        jacobian = self._jacobian(unknowns, fitted, waves)
        gauges = self._gauges(unknowns, fitted)
        unidentifiable = null_space(gauges.T) if gauges.shape[1] else np.eye(len(gauges))
        _, sizes, directions = np.linalg.svd(jacobian @ unidentifiable, full_matrices=False)  # J = U s V'
        blind = max(_LEAST_BLIND, _BLIND * float(np.abs(vectors_of(self.drive)).max()))
        sharp = (sizes * blind > 1) & (sizes > _DIFFERENCE_ERROR * sizes.max(initial=0.0))
        directions = unidentifiable @ directions.T
        blurred = np.concatenate([directions[:, ~sharp], gauges], axis=1)
        return jacobian, directions[:, sharp], blurred, sizes[sharp]


def _complex_of(unknowns: Array) -> Complex:
    """Return the vectors of unknowns, shape (vectors,)."""
    return unknowns[:-2].view(complex)
