"""Least squares on the deviation vectors of a drive, through its contact model.

Each vector is two unknowns; where the record begins in the drive's cycle may be one or two more. Every step solves the
contacts anew. Directions among the unknowns that the record hardly sees are left where they are: their standard
uncertainty would be above what a deviation can be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import null_space

from hdassist.comparing.record import Alignment, Record, rms, scan
from hdassist.comparing.vectors import VECTORS, vectors_of, with_vectors
from hdassist.error.waves import COARSE, MIDDLE, POINTS, Complex, ErrorWaves
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive

DOUBTS = 2  # times the alignment is looked for with the model doubted at the one before
STEP = 1.0  # of a vector's unit, of a difference quotient
FARTHEST = 30.0  # of a vector's unit, or deg, of one step
STEPS = 15
STILL = 0.05  # of chi-square: a step that gains less is the last
SLOW = 1e-3  # of the chi-square that is left: the same
NEARER = 0.7  # of the chi-square: a first look must be so much better for the way to begin there
BLIND = 0.5  # of the greatest deviation: a greater standard uncertainty says nothing
LEAST_BLIND = 20.0  # of a vector's unit
TURNED = (45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0)  # deg: directions looked at before the first step
SCALED = (0.5, 1.5, 2.0)
NEARLY = 1e-2  # of an unknown's square along what the record does not tell
SHARP = 1.0  # deg: a start that is surer leaves no room for a bend
WALK = 6  # standard uncertainties of the start to either side that are looked at
FAR = 12.0  # of chi-square above the least: far enough
SHARES = (1.0, 0.5, 0.2, 0.05)  # of a step, until one is downhill
ROUNDING = 1e-3  # of the greatest slope: as sure as difference quotients are
WHEELS = tuple(tuple(k for k, v in enumerate(VECTORS) if v.part == part) for part in "gb")  # what turns with each wheel
USUAL = 50.0  # of a vector's unit: size tried for a deviation that the preset has as 0


@dataclass(frozen=True)
class FreeParameters:
    """What is fitted: some of VECTORS by their place, two unknowns each, then start and zero of the record."""

    vectors: tuple[int, ...]
    start: bool
    zero: bool

    @property
    def vector_unknowns(self) -> int:
        """Number of unknowns that belong to the vectors."""
        return 2 * len(self.vectors)

    @property
    def count(self) -> int:
        """Number of unknowns."""
        return self.vector_unknowns + self.start + self.zero


@dataclass(frozen=True, eq=False)
class VectorFit:
    """Deviations that fit a record best.

    free: the unknowns, x and y of each free vector in its unit, then start and zero [deg]; vectors, shape (all,); seen,
    blind: orthonormal directions among the unknowns that the record tells and does not tell, shape (unknowns, ...);
    spread: standard uncertainties along seen, noise alone; wide: covariance of the unknowns over many starts, where
    slopes at one do not tell it.
    """

    free: FreeParameters
    vectors: Complex
    alignment: Alignment
    chi_square: float
    seen: Array
    blind: Array
    spread: Array
    wide: Array | None = None

    def covariance(self) -> Array:
        """Covariance of the unknowns along what the record tells, noise alone."""
        if self.wide is not None:
            return self.wide
        return np.asarray((self.seen * self.spread**2) @ self.seen.T)


class VectorFitter:
    """Fits of one record with one drive; unknowns of the alignment are the same in all of them."""

    def __init__(self, drive: Drive, record: Record, torus: ErrorWaves, *, start: bool, zero: bool) -> None:
        self._drive, self.record, self._torus = drive, record, torus
        self._start, self._zero = start, zero
        self._here = vectors_of(drive)
        self._blind = max(LEAST_BLIND, BLIND * float(np.abs(self._here).max()))

    def base(self, alignment: Alignment) -> VectorFit:
        """The drive as it is, with the alignment fitted where that is asked for."""
        (waves,) = self._torus.waves([self._drive])
        found, _ = scan(self.record, waves, alignment, start=self._start, zero=self._zero)
        return self._descend(self._here, found, (), POINTS)

    def doubting(self, changes: Complex, alignment: Alignment) -> tuple[VectorFitter, VectorFit]:
        """A fitter that doubts the model, and the drive as it is by it.

        Arguments: changes of the drive's waves, see Record.doubting; they are taken at the alignment that fits best,
        which is looked for anew with them.
        """
        (waves,) = self._torus.waves([self._drive])
        fitter, fit = self, self.base(alignment)
        for _ in range(DOUBTS if self._start or self._zero else 1):
            record = self.record.doubting(waves, changes, fit.alignment)
            fitter = VectorFitter(self._drive, record, self._torus, start=self._start, zero=self._zero)
            fit = fitter.base(alignment)
        return fitter, fit

    def bent(self, fit: VectorFit, changes: Complex) -> VectorFit:
        """A fit whose covariance has in it how far it moves with the model doubted at its own deviations.

        changes: of the waves of the drive as the fit has it, see Record.doubting.
        """
        free = fit.free.vectors
        (waves,) = self._waves([fit.vectors], free, POINTS)
        record = self.record.doubting(waves, changes, fit.alignment)
        fitter = VectorFitter(self._drive, record, self._torus, start=self._start, zero=self._zero)
        other = fitter._descend(fit.vectors, fit.alignment, free, POINTS)
        here, there = fit.alignment, other.alignment
        turned = [(there.start - here.start, self._start), (there.zero - here.zero, self._zero)]
        moved = other.vectors[list(free)] - fit.vectors[list(free)]
        away = np.array([*_parts(moved), *(float(np.degrees(angle)) for angle, wanted in turned if wanted)])
        away = fit.seen @ (fit.seen.T @ away)
        return replace(fit, wide=fit.covariance() + np.outer(away, away))

    def left_arcsec(self, fit: VectorFit) -> float:
        """Rms of what a fit leaves within the orders [arcsec]."""
        (waves,) = self._waves([fit.vectors], fit.free.vectors, POINTS)
        return rms(self.record.measured - self.record.predicted(waves, fit.alignment))

    def single(self, vector: int, base: VectorFit) -> VectorFit:
        """One vector changed, the others as they are; on a torus that is good enough to tell the good ones."""
        starts = self._starts(vector)
        waves = self._waves(starts, [vector], COARSE)
        looks = [scan(self.record, w, base.alignment, start=self._start, zero=self._zero) for w in waves]
        best = int(np.argmin([chi for _, chi in looks]))
        if looks[best][1] > NEARER * looks[0][1]:
            return self._descend(self._here, base.alignment, (vector,), MIDDLE)
        return self._descend(starts[best], looks[best][0], (vector,), MIDDLE)

    def gains(self, base: VectorFit) -> Array:
        """How much chi-square each vector alone would take off, as slopes at the drive tell, shape (all,)."""
        free = self._free(range(len(self._here)))
        left, waves = self._left(base.vectors, base.alignment, (), POINTS)
        slopes = self._slopes(base.vectors, base.alignment, free, waves)
        gains = []
        for k in free.vectors:
            own = slopes[:, [2 * k, 2 * k + 1, *range(free.vector_unknowns, free.count)]]
            taken = np.linalg.lstsq(own, left)[0]
            gains.append(2 * left @ own @ taken - ((own @ taken) ** 2).sum())
        return np.array(gains)

    def polished(self, fit: VectorFit) -> VectorFit:
        """A fit gone on with on a fine torus."""
        return self._descend(fit.vectors, fit.alignment, fit.free.vectors, POINTS)

    def profiled(self, fit: VectorFit) -> VectorFit:
        """A fit of one vector looked at over many starts, where its start is uncertain: a bent valley has other minima.

        The covariance is that over the starts, each as likely as its chi-square says.
        """
        row, vectors = fit.free.vector_unknowns, fit.free.vectors
        if not self._start or self._zero or (fit.blind[row] ** 2).sum() > NEARLY:
            return fit
        step = float(np.sqrt(fit.covariance()[row, row]))
        if step < SHARP:
            return fit
        still = VectorFitter(self._drive, self.record, self._torus, start=False, zero=False)
        found = [still._descend(fit.vectors, fit.alignment, vectors, MIDDLE)]
        for way in (1, -1):
            here = found[0]
            for _ in range(WALK):
                start = here.alignment.start + way * np.radians(step)
                here = still._descend(here.vectors, replace(here.alignment, start=float(start)), vectors, MIDDLE)
                found.append(here)
                if here.chi_square > min(f.chi_square for f in found) + FAR:
                    break
        best = min(found, key=lambda f: f.chi_square)
        result = fit
        if best is not found[0]:
            other = self._descend(best.vectors, best.alignment, vectors, POINTS)
            result = min(fit, other, key=lambda f: f.chi_square)
        weight = np.exp(-(np.array([f.chi_square for f in found]) - best.chi_square) / 2)
        wide = np.zeros((row + 1, row + 1))
        for share, each in zip(weight / weight.sum(), found, strict=True):
            moved = each.vectors[list(vectors)] - result.vectors[list(vectors)]
            turned = np.degrees(each.alignment.start - result.alignment.start)
            away = np.array([*_parts(moved), turned])
            wide += share * np.outer(away, away)
            wide[:row, :row] += share * each.covariance()
        return replace(result, wide=wide)

    def joint(self, begin: VectorFit) -> VectorFit:
        """All vectors changed, as far as the record tells them apart."""
        return self._descend(begin.vectors, begin.alignment, tuple(range(len(self._here))), POINTS)

    def _free(self, vectors: Sequence[int]) -> FreeParameters:
        return FreeParameters(tuple(vectors), self._start, self._zero)

    def _waves(self, several: Sequence[Complex], free: Sequence[int], points: int) -> Complex:
        """Waves of the drive with some of its vectors changed, shape (several, waves)."""
        return self._torus.waves([with_vectors(self._drive, vectors, free) for vectors in several], points)

    def _starts(self, vector: int) -> list[Complex]:
        """The drive's own vectors, and with one of them turned or scaled."""
        own = self._here[vector] or USUAL
        others = [own * scale for scale in SCALED]
        if not self._alike(self._here, self._free([vector])).shape[1]:
            others += [own * np.exp(1j * np.radians(turn)) for turn in TURNED]
        if not self._here[vector]:
            others.append(own)
        result = [self._here.copy() for _ in range(len(others) + 1)]
        for vectors, value in zip(result[1:], others, strict=True):
            vectors[vector] = value
        return result

    def _descend(self, vectors: Complex, alignment: Alignment, wanted: tuple[int, ...], points: int) -> VectorFit:
        free = self._free(wanted)
        left, waves = self._left(vectors, alignment, wanted, points)
        for _ in range(STEPS):
            slopes = self._slopes(vectors, alignment, free, waves)
            seen, _, sizes = self._split(slopes, self._alike(vectors, free))
            step = seen @ ((seen.T @ slopes.T @ left) / sizes**2)
            step *= min(1.0, FARTHEST / max(float(np.abs(step).max(initial=0.0)), 1e-12))
            before = float(left @ left)
            for share in SHARES:
                there = _moved(vectors, alignment, free, share * step)
                tried, other = self._left(*there, wanted, points)
                if tried @ tried < before:
                    (vectors, alignment), left, waves = there, tried, other
                    break
            if before - float(left @ left) < max(STILL, SLOW * before):
                break
        slopes = self._slopes(vectors, alignment, free, waves)
        seen, blind, sizes = self._split(slopes, self._alike(vectors, free))
        return VectorFit(free, vectors, alignment, float(left @ left), seen, blind, 1 / sizes)

    def _left(self, vectors: Complex, alignment: Alignment, free: Sequence[int], points: int) -> tuple[Array, Complex]:
        """Whitened differences that are left, and the waves."""
        (waves,) = self._waves([vectors], free, points)
        return self.record.whitened(self.record.measured - self.record.predicted(waves, alignment)), waves

    def _slopes(self, vectors: Complex, alignment: Alignment, free: FreeParameters, waves: Complex) -> Array:
        """Whitened slopes by each unknown, shape (2 orders, unknowns), per unit and deg."""
        columns = []
        if free.vectors:
            near = [vectors]
            for k in free.vectors:
                for part in (STEP, 1j * STEP):
                    near.append(vectors.copy())
                    near[-1][k] += part
            found = self._waves(near, free.vectors, MIDDLE)
            columns += list(self.record.predicted((found[1:] - found[0]) / STEP, alignment))
        moved = np.radians(self.record.slopes(waves, alignment))
        columns += [column for column, wanted in zip(moved, (free.start, free.zero), strict=True) if wanted]
        if not columns:
            return np.zeros((len(self.record.measured), 0))
        return self.record.whitened(np.array(columns)).T

    def _alike(self, vectors: Complex, free: FreeParameters) -> Array:
        """Directions among the unknowns that change nothing at all, orthonormal, shape (unknowns, ...).

        To begin elsewhere is the same as to turn all vectors of a wheel: without effect where they all are free.
        """
        wanted = [place for place, fitted in enumerate((free.start, free.zero)) if fitted]
        turns = np.stack([self.record.starts, -np.array(self.record.rates)], axis=1)[:, wanted]
        held = [any(vectors[k] and k not in free.vectors for k in wheel) for wheel in WHEELS]
        columns = []
        for gauge in (null_space(turns[held]) if any(held) else np.eye(len(wanted))).T:
            back = np.radians(-turns @ gauge)
            wheel = [next((w for w, members in enumerate(WHEELS) if k in members), None) for k in free.vectors]
            moved = [
                0j if w is None else 1j * VECTORS[k].order * vectors[k] * back[w]
                for w, k in zip(wheel, free.vectors, strict=True)
            ]
            columns.append([*_parts(moved), *gauge])
        if not columns:
            return np.zeros((free.count, 0))
        return np.asarray(np.linalg.qr(np.array(columns).T)[0])

    def _split(self, slopes: Array, alike: Array) -> tuple[Array, Array, Array]:
        """Directions among the unknowns that are seen, those that are not, and the slopes along the first."""
        if not slopes.shape[1]:
            return np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0)
        others = null_space(alike.T) if alike.shape[1] else np.eye(len(alike))
        _, sizes, directions = np.linalg.svd(slopes @ others, full_matrices=False)
        seen = (sizes * self._blind > 1) & (sizes > ROUNDING * sizes.max(initial=0.0))
        directions = others @ directions.T
        return directions[:, seen], np.concatenate([directions[:, ~seen], alike], axis=1), sizes[seen]


def _parts(vectors: Sequence[complex] | Complex) -> list[float]:
    """X and y of vectors, one after the other."""
    return [part for vector in vectors for part in (vector.real, vector.imag)]


def _moved(vectors: Complex, alignment: Alignment, free: FreeParameters, step: Array) -> tuple[Complex, Alignment]:
    """Vectors and alignment after a step of the unknowns."""
    result = vectors.copy()
    for i, k in enumerate(free.vectors):
        result[k] += step[2 * i] + 1j * step[2 * i + 1]
    rest = list(np.radians(step[free.vector_unknowns :]))
    start = alignment.start + (rest.pop(0) if free.start else 0.0)
    zero = alignment.zero + (rest.pop(0) if free.zero else 0.0)
    return result, replace(alignment, start=float(start), zero=float(zero))
