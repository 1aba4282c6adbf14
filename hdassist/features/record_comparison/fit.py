"""Least-squares fit of a drive's deviation vectors to the orders of a recording, through the contact model.

The unknowns are x and y of each vector, then start and zero of the recording [deg]. Every step of the Gauss-Newton
iteration (docs/theory.md, (13) to (16)) solves the contacts again. A direction in the space of unknowns is
unidentifiable if its standard uncertainty exceeds any plausible deviation. The fit does not move along such directions.

The fit of correction.records.agreeing_drives differs because it answers another question. This module asks which
deviation, of any size and against the preset, explains the difference. No prior therefore pulls the unknowns, doubts of
the model widen the covariance, and a direction that the recording does not determine has no value. agreeing_drives asks
which drives allowed by the preset may have made the recording, and which error they have at angles and torques without
a recording. A prior therefore covers all open fields, given deviations stay, doubts are fitted together with the other
fields, and the result is many drives. Both use the same code for the alignment, the doubts and F'_ior of a recording.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from hdassist.drive.error.waves import WAVE_POINTS, Complex, ErrorWaves
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import Drive
from hdassist.features.record_comparison.record import (
    SLOPE_WAVE_POINTS,
    VECTOR_ORDERS,
    VECTORS,
    RecordedOrders,
    rms,
    vectors_of,
    with_vectors,
)

COARSE = 16  # points around each wheel for a first estimate with very different deviations
_DOUBT_ROUNDS = 2  # number of fits of the alignment, each with the model doubts at the previous alignment
_VECTOR_STEP = 1.0  # step of a difference quotient, in a vector's unit
_LONGEST_STEP = 30.0  # longest step of an unknown, in a vector's unit or deg
_STEP_SHARES = (1.0, 0.5, 0.2, 0.05)  # shares of a step that are tried until one reduces chi-square
_MOST_STEPS = 15
_SMALLEST_GAIN = 0.05  # smallest gain in chi-square after which the iteration continues
_SMALLEST_GAIN_SHARE = 1e-3  # the same, as a share of the chi-square before the step
_NEARER = 0.7  # largest chi-square of a start that replaces the drive's own deviations, as a share of their chi-square
_BLIND = 0.5  # largest standard uncertainty of an identifiable direction, as a share of the largest deviation
_LEAST_BLIND = 20.0  # lower bound of this uncertainty, in a vector's unit
_DIFFERENCE_ERROR = 1e-3  # error of difference quotients, as a share of the largest singular value
_START_TURNS = (45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0)  # rotations of a vector before the first step [deg]
_START_SCALES = (0.5, 1.5, 2.0)
_START_SIZE = 50.0  # size of a vector that is 0 in the drive, in the vector's unit
_PROFILE_BLIND = 1e-2  # largest squared share of the start that may be unidentifiable if its profile is computed
_PROFILE_LEAST = 1.0  # smallest standard uncertainty of the start for which its profile is computed [deg]
_PROFILE_STEPS = 6  # largest number of steps to each side; a step is one standard uncertainty of the start
_PROFILE_RISE = 12.0  # rise of chi-square above the minimum at which a profile ends

COUNT = len(VECTORS)
_WHEEL = np.array(["gbh".index(vector.part) for vector in VECTORS])  # part that each vector rotates with


@dataclass(frozen=True, eq=False)
class VectorFit:
    """Deviations and alignment that fit a recording best.

    unknowns: all unknowns, shape (2 vectors + 2,).
    fitted: indices of the free vectors.
    free: indices of the free unknowns, shape (f,).
    chi_square: chi-square of the fit.
    unidentifiable: orthonormal directions of the free unknowns that are unidentifiable, shape (f, u).
    covariance: covariance of the free unknowns along all other directions (16), shape (f, f).
    """

    unknowns: Array
    fitted: tuple[int, ...]
    free: NDArray[np.int64]
    chi_square: float
    unidentifiable: Array
    covariance: Array

    @property
    def vectors(self) -> Complex:
        """Deviation vectors in their units, shape (vectors,)."""
        return _complex_of(self.unknowns)


@dataclass(frozen=True, eq=False)
class VectorFitter:
    """A fitter of the deviation vectors of one drive to one recording.

    drive: the drive.
    record: orders of the recording.
    torus: waves of the drive's error.
    doubt: function that returns, for a drive with any deviations, the changes of its waves; see `doubtful_waves`.
    angles: whether start and zero of the recording are fitted together with the vectors.
    """

    drive: Drive
    record: RecordedOrders
    torus: ErrorWaves
    doubt: Callable[[Drive], Complex]
    angles: tuple[bool, bool]

    def base(self) -> VectorFit:
        """Return the fit of the unchanged drive, with start and zero fitted to the recording if they are free."""
        alignment = self.record.alignment
        unknowns = np.array([*vectors_of(self.drive).view(float), alignment.start_deg, alignment.zero_deg])
        # start and zero have many local minima, so they are scanned before the descent
        unknowns[-2:], _ = self.record.scan(self._waves(unknowns, ())[0], unknowns[-2:])
        return self._descend(unknowns, ())

    def doubted(self, changes: Complex) -> tuple[VectorFitter, VectorFit]:
        """Return a fitter with model doubts (14) at the best alignment, and its fit of the unchanged drive.

        changes: wave changes of the drive [arcsec], shape (changes, waves).
        """
        fitter = self
        fit = self.base()
        # the doubt depends on the alignment, and the alignment on the doubt
        for _ in range(_DOUBT_ROUNDS if any(self.angles) else 1):
            fitter = self._doubted_at(fit, changes)
            fit = fitter.base()
        return fitter, fit

    def with_shift(self, fit: VectorFit) -> VectorFit:
        """Return a fit whose covariance includes its shift when the model doubts are those at its own deviations."""
        changes = self.doubt(with_vectors(self.drive, fit.vectors, fit.fitted))
        shift = (self._doubted_at(fit, changes).refined(fit).unknowns - fit.unknowns)[fit.free]
        # the fit cannot move along a direction that the recording does not determine
        shift -= fit.unidentifiable @ (fit.unidentifiable.T @ shift)
        return replace(fit, covariance=fit.covariance + np.outer(shift, shift))

    def residual_rms_arcsec(self, fit: VectorFit) -> float:
        """Return the root mean square of the residual of a fit within the orders [arcsec]."""
        (waves,) = self._waves(fit.unknowns, fit.fitted)
        return rms(self.record.measured - self.record.predicted(waves, fit.unknowns[-2:]))

    def single(self, vector: int, base: VectorFit) -> VectorFit:
        """Return the fit of one vector, with the other vectors unchanged, on a torus fine enough to rank the fits."""
        # chi-square has more than one minimum, so several sizes and directions are tried
        starts = list(self._starts(vector, base))
        scans = [self.record.scan(self._waves(start, (vector,), COARSE)[0], start[-2:]) for start in starts]
        best = int(np.argmin([chi_square for _, chi_square in scans]))
        # the fit starts from the drive's own deviations unless another start is clearly better
        if scans[best][1] <= _NEARER * scans[0][1]:
            starts[0] = np.append(starts[best][:-2], scans[best][0])
        return self._descend(starts[0], (vector,), SLOPE_WAVE_POINTS)

    def refined(self, fit: VectorFit, fitted: Sequence[int] = ()) -> VectorFit:
        """Return a fit continued on a fine torus, with the same free vectors or with others."""
        return self._descend(fit.unknowns, tuple(fitted) or fit.fitted)

    def linear_gains(self, base: VectorFit) -> Array:
        """Return the decrease of chi-square that each single vector gives to first order, shape (vectors,)."""
        # one linearisation serves all vectors
        residual, waves = self._residual(base.unknowns, (), WAVE_POINTS)
        jacobian = self._jacobian(base.unknowns, tuple(range(COUNT)), waves)
        columns_of_vector = [
            jacobian[:, [2 * k, 2 * k + 1, *range(2 * COUNT, jacobian.shape[1])]] for k in range(COUNT)
        ]
        return np.array([residual @ columns @ np.linalg.lstsq(columns, residual)[0] for columns in columns_of_vector])

    def profiled(self, fit: VectorFit) -> VectorFit:
        """Return a fit of one vector with its minimum and covariance from a profile of the start.

        The fit is returned unchanged if the start is not fitted or not uncertain. The valley of chi-square is curved
        and may have other minima. Each start of the profile is weighted by its likelihood.
        """
        start = 2  # the vector's two components are the first unknowns
        # only an unknown start curves the valley
        if self.angles != (True, False) or (fit.unidentifiable[start] ** 2).sum() > _PROFILE_BLIND:
            return fit
        step = float(np.sqrt(fit.covariance[start, start]))
        if step < _PROFILE_LEAST:
            return fit
        profile = self._profile_of(fit, step)
        chi_square = np.array([point.chi_square for point in profile])
        best = int(chi_square.argmin())
        result = min(fit, self.refined(profile[best]), key=lambda candidate: candidate.chi_square) if best else fit
        # weight each point of the profile by its likelihood
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
        """Return fits with the start fixed at steps [deg] to both sides of a fit, beginning with the fit itself.

        A side ends once chi-square is clearly above its minimum.
        """
        with_fixed_angles = replace(self, angles=(False, False))
        direction = np.arange(2 * COUNT + 2) == 2 * COUNT  # index of the start among the unknowns, as a mask
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
        """Return a fitter whose recording has the covariance (14) of wave changes, at the alignment of a fit."""
        (waves,) = self._waves(fit.unknowns, fit.fitted)
        return replace(self, record=self.record.doubting(waves, changes, fit.unknowns[-2:]))

    def _waves(
        self,
        unknowns: Array,
        fitted: Sequence[int],
        points: int = WAVE_POINTS,
        *steps: Array,
    ) -> Complex:
        """Return the waves of the drive with fitted vectors, at the unknowns and at each step from them.

        The shape is (1 + steps, waves).
        """
        moved = [_complex_of(unknowns + step) for step in (np.zeros_like(unknowns), *steps)]
        return self.torus.waves([with_vectors(self.drive, vectors, fitted) for vectors in moved], points)

    def _starts(self, vector: int, base: VectorFit) -> Iterator[Array]:
        """Yield the unknowns of the unchanged drive, and those with one vector scaled or rotated.

        A vector is rotated only if its direction matters.
        """
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
        """Return the indices of the fitted unknowns, shape (f,)."""
        components = [place for k in fitted for place in (2 * k, 2 * k + 1)]
        return np.array([*components, *(2 * COUNT + np.flatnonzero(self.angles))], dtype=np.int64)

    def _descend(
        self,
        unknowns: Array,
        fitted: tuple[int, ...],
        points: int = WAVE_POINTS,
    ) -> VectorFit:
        """Descend by Gauss-Newton steps (15) along identifiable directions until chi-square (13) hardly decreases."""
        free = self._free(fitted)
        residual, waves = self._residual(unknowns, fitted, points)
        for _ in range(_MOST_STEPS if len(free) else 0):
            jacobian, directions, _, sizes = self._linearized(unknowns, fitted, waves)
            step = np.zeros_like(unknowns)
            step[free] = directions @ ((directions.T @ jacobian.T @ residual) / sizes**2)  # equation (15)
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
        covariance = np.asarray((directions / sizes**2) @ directions.T)  # equation (16), shape (f, f)
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
        """Return the whitened slopes J of the prediction, per unit or deg of free unknowns, shape (2 orders, f)."""
        steps = _VECTOR_STEP * np.eye(len(unknowns))[self._free(fitted)[: 2 * len(fitted)]]
        columns = self.record.slopes(waves, unknowns[-2:])[list(self.angles)]
        if fitted:
            base, *moved = self._waves(unknowns, fitted, SLOPE_WAVE_POINTS, *steps)
            by_vectors = self.record.predicted((np.array(moved) - base) / _VECTOR_STEP, unknowns[-2:])
            columns = np.concatenate([by_vectors, columns])
        return self.record.whitened(columns).T

    def _gauges(self, unknowns: Array, fitted: Sequence[int]) -> Array:
        """Return orthonormal directions of the free unknowns along which the error is constant, shape (f, gauges).

        A different start of the recording is equivalent to a rotation of all vectors of a wheel, which is possible if
        each of them is free or 0.
        """
        free = self._free(fitted)
        vectors = _complex_of(unknowns)
        if not any(self.angles):
            return np.zeros((len(free), 0))
        pinned = (vectors != 0) & ~np.isin(np.arange(COUNT), fitted)
        is_pinned = np.array([bool(pinned[wheel == _WHEEL].any()) for wheel in range(2)])
        turns = self.record.turns[:, list(self.angles)]  # shape (2 wheels, angles)
        gauges = null_space(turns * is_pinned[:, None])  # shape (angles, gauges)
        back = np.radians(
            np.vstack([-turns @ gauges, np.zeros(gauges.shape[1])])
        )  # rows: flexspline, circular spline and wave generator
        moved = (1j * VECTOR_ORDERS * vectors)[:, None] * back[_WHEEL]  # shape (vectors, gauges)
        components = np.stack([moved.real, moved.imag], axis=1).reshape(2 * COUNT, -1)
        directions = np.concatenate([components[free[: 2 * len(fitted)]], gauges])
        return np.asarray(np.linalg.qr(directions)[0])

    def _linearized(
        self,
        unknowns: Array,
        fitted: tuple[int, ...],
        waves: Complex,
    ) -> tuple[Array, Array, Array, Array]:
        """Return slopes J, identifiable and other directions, and the singular values of J along the identifiable ones.

        The shapes are (2 orders, f), (f, i), (f, f - i) and (i,).
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
    """Return the vectors among the unknowns as complex numbers, shape (vectors,)."""
    return unknowns[:-2].view(complex)
