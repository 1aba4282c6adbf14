"""Fits of a record as explanations in terms of the preset, and the conclusion from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hdassist.comparing.fit import VectorFit
from hdassist.comparing.record import CHI_SQUARE_CLEAR, Alignment, OrderPair, RecordedOrders
from hdassist.comparing.vectors import VECTORS, direction_of, with_vectors
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive

CLEAR_GAIN = 25.0  # chi-square of two unknowns that noise exceeds four times in a million
EQUAL_FIT = 9.0  # chi-square: fits that are no further apart explain a record equally well
BLIND_SHARE = 0.1  # squared share of an unknown that may be unidentifiable where it has a number
NAMED_SHARE = 0.3  # of a combination of vectors: those of less are not named
VAGUE_DIRECTION = 60.0  # deg: a direction of greater standard uncertainty is None
DECIMALS = 3  # of a new value, at most

ConclusionKind = Literal["agrees", "mirrored", "one", "several", "unexplained"]


@dataclass(frozen=True)
class VectorChange:
    """New value of one deviation vector with standard uncertainties; direction None where it is not identifiable."""

    vector: int
    size_um: float
    size_uncertainty_um: float
    direction_deg: float | None
    direction_uncertainty_deg: float | None


@dataclass(frozen=True)
class Explanation:
    """The drive with some deviations fitted to the record.

    vectors: places in VECTORS of those that were free; changes: of those whose size is identifiable; indistinguishable:
    names of those that cannot be told apart, a tuple a combination; chi_square, freedom; share: of the difference's
    chi-square above that of noise, explained; clear: a better fit than chance makes; sufficient: the residual is within
    noise; overrides: paths of the preset and their new values, empty where one of them is not identifiable;
    F_ior_arcsec, of the full cycle then, solved; None without overrides; residual_rms_arcsec: within the orders, from
    solved states of the record; None where those were not solved; residual_orders: the greatest of that.
    """

    vectors: tuple[int, ...]
    changes: tuple[VectorChange, ...]
    indistinguishable: tuple[tuple[str, ...], ...]
    chi_square: float
    freedom: int
    share: float
    clear: bool
    sufficient: bool
    overrides: tuple[tuple[str, float], ...]
    alignment: Alignment
    F_ior_arcsec: float | None = None
    residual_rms_arcsec: float | None = None
    residual_orders: tuple[OrderPair, ...] = ()

    @property
    def reduced_chi_square(self) -> float:
        """Chi-square per degree of freedom."""
        return self.chi_square / self.freedom

    @property
    def excess(self) -> float:
        """Chi-square per degree of freedom, 1 at least: variances are widened by it."""
        return max(1.0, self.reduced_chi_square)


@dataclass(frozen=True)
class Conclusion:
    """Conclusion of a comparison: agrees, mirrored, one (deviation explains it), several (together), or unexplained."""

    kind: ConclusionKind
    best: Explanation | None = None


def explanation(fit: VectorFit, base: VectorFit, record: RecordedOrders, drive: Drive) -> Explanation:
    """A fit in terms of the preset; states are not solved beyond the fit itself."""
    unknowns, own = len(fit.free), len(base.free)
    freedom, before = record.freedom(unknowns), base.chi_square - record.freedom(own)
    excess = max(1.0, fit.chi_square / freedom)
    found = [_change(fit, i, excess * fit.covariance, drive) for i in range(len(fit.fitted))]
    changes = tuple(change for change in found if change is not None)
    names, more = _indistinguishable(fit), unknowns - own
    by_chance = max(CLEAR_GAIN, more + CHI_SQUARE_CLEAR * float(np.sqrt(2 * more)))
    return Explanation(
        vectors=fit.fitted,
        changes=changes,
        indistinguishable=names,
        chi_square=fit.chi_square,
        freedom=freedom,
        share=1 - max(fit.chi_square - freedom, 0.0) / before if before > 0 else 0.0,
        clear=(base.chi_square - fit.chi_square) / excess > by_chance,
        sufficient=record.within_noise(fit.chi_square, unknowns),
        overrides=_overrides(fit, changes, drive) if len(changes) == len(fit.fitted) and not names else (),
        alignment=fit.alignment,
    )


def _polar(fit: VectorFit, i: int) -> Array:
    """Along and across the fitted vector i, as directions among the free unknowns, shape (2, f)."""
    vector = fit.vectors[fit.fitted[i]]
    unit = vector / abs(vector) if vector else 1.0
    result = np.zeros((2, len(fit.free)))
    result[:, 2 * i : 2 * i + 2] = [[unit.real, unit.imag], [-unit.imag, unit.real]]
    return result


def _change(fit: VectorFit, i: int, covariance: Array, drive: Drive) -> VectorChange | None:
    """New value of the fitted vector i; None where its size is not identifiable."""
    k = fit.fitted[i]
    vector, axes = VECTORS[k], _polar(fit, i)
    blind = [float(((axis @ fit.unidentifiable) ** 2).sum()) for axis in axes]
    if blind[0] > BLIND_SHARE:
        return None
    size = float(abs(fit.vectors[k]))
    along, across = (float(np.sqrt(axis @ covariance @ axis)) for axis in axes)
    turn = float(np.degrees(across / size)) if size else np.inf
    sizes = size * vector.unit, along * vector.unit
    if blind[1] > BLIND_SHARE or turn > VAGUE_DIRECTION:
        return VectorChange(k, *sizes, None, None)
    direction = direction_of(fit.vectors[k], drive.number(vector.direction), vector.order)
    return VectorChange(k, *sizes, direction, turn / vector.order)


def _indistinguishable(fit: VectorFit) -> tuple[tuple[str, ...], ...]:
    """Names of vectors that the record cannot tell apart, a tuple for each combination of sizes."""
    names = []
    for combination in fit.unidentifiable.T:
        parts = {VECTORS[k].name: _polar(fit, i) @ combination for i, k in enumerate(fit.fitted)}
        if max((float(along**2) for along, _ in parts.values()), default=0.0) <= BLIND_SHARE:
            continue  # directions alone, against where the record begins
        names.append(tuple(name for name, part in parts.items() if float(np.hypot(*part)) > NAMED_SHARE))
    return tuple(dict.fromkeys(names))


def _overrides(fit: VectorFit, changes: Sequence[VectorChange], drive: Drive) -> tuple[tuple[str, float], ...]:
    """New values, rounded to a tenth of the uncertainty or less; empty where the preset does not allow one of them."""
    changed = with_vectors(drive, fit.vectors, fit.fitted)
    values = []
    for change in changes:
        vector = VECTORS[change.vector]
        pairs = ((vector.size, change.size_uncertainty_um), (vector.direction, change.direction_uncertainty_deg))
        for path, uncertainty in pairs:
            decimals = 1 - int(np.floor(np.log10(max(uncertainty or 1.0, 1e-9))))
            value = round(float(changed.value(path)), min(max(decimals, 0), DECIMALS)) + 0.0
            if not drive.allows(path, value):
                return ()
            values.append((path, value))
    return tuple(values)


def conclude(
    base: Explanation, singles: Sequence[Explanation], joint: Explanation | None, *, mirrored: bool = False
) -> Conclusion:
    """The simplest explanation whose residual is within noise."""
    best = min(singles, key=lambda single: single.chi_square, default=base)
    if base.sufficient and not best.clear:
        return Conclusion("agrees")
    if mirrored:
        return Conclusion("mirrored")
    if best.clear and best.sufficient:
        return Conclusion("one", best)
    if joint is not None and joint.sufficient and joint.clear:
        return Conclusion("several", joint)
    return Conclusion("unexplained", best if best.clear else None)


def equally_good(best: Explanation, singles: Sequence[Explanation]) -> list[Explanation]:
    """Other single deviations that explain the difference as well as the best one."""
    most = best.chi_square + EQUAL_FIT * best.excess
    return [single for single in singles if single is not best and single.clear and single.chi_square <= most]
