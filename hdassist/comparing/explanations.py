"""Fits of a record as explanations in terms of the preset, and the conclusion from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hdassist.comparing.fit import VectorFit, VectorFitter
from hdassist.comparing.record import CHI_SQUARE_CLEAR, Alignment, OrderPair
from hdassist.comparing.vectors import VECTOR_UNITS, VECTORS, size_and_direction, with_vectors
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
    """New size and direction of a deviation vector, by their paths, with standard uncertainties.

    The direction is None where it is not identifiable.
    """

    size: str
    size_um: float
    size_uncertainty_um: float
    direction: str
    direction_deg: float | None
    direction_uncertainty_deg: float | None


@dataclass(frozen=True)
class Explanation:
    """The drive with some deviations fitted to the record.

    deviations: paths of the sizes that were free; changes: of those whose size is identifiable; not_told_apart: names
    of those that cannot be, a tuple a combination; explained_share: of the difference's chi-square above that of noise,
    None where it is below; clear: a better fit than chance makes; sufficient: the residual is within noise; overrides:
    new values as --set takes them, empty where one of them is not identifiable; F_ior_arcsec, of the full cycle then,
    solved; None without overrides; difference_left_arcsec: rms within the orders, from solved states of the record;
    None where those were not solved; orders_left: the greatest of that.
    """

    deviations: tuple[str, ...]
    changes: tuple[VectorChange, ...]
    not_told_apart: tuple[tuple[str, ...], ...]
    chi_square: float
    degrees_of_freedom: int
    explained_share: float | None
    clear: bool
    sufficient: bool
    overrides: tuple[str, ...]
    alignment: Alignment
    F_ior_arcsec: float | None = None
    difference_left_arcsec: float | None = None
    orders_left: tuple[OrderPair, ...] = ()

    @property
    def excess(self) -> float:
        """Chi-square per degree of freedom, 1 at least: variances are widened by it."""
        return max(1.0, self.chi_square / self.degrees_of_freedom)


@dataclass(frozen=True)
class Conclusion:
    """Conclusion of a comparison: agrees, mirrored, one (deviation explains it), several (together), or unexplained."""

    kind: ConclusionKind
    best: Explanation | None = None


def explanation(fit: VectorFit, base: VectorFit, fitter: VectorFitter) -> Explanation:
    """A fit in terms of the preset; states are not solved beyond the fit itself."""
    record, drive, unknowns, more = fitter.record, fitter.drive, len(fit.free), len(fit.free) - len(base.free)
    freedom, before = record.freedom(unknowns), base.chi_square - record.freedom(len(base.free))
    excess = max(1.0, fit.chi_square / freedom)
    changes = [change for i in range(len(fit.fitted)) if (change := _change(fit, i, excess * fit.covariance, drive))]
    names = _not_told_apart(fit)
    by_chance = max(CLEAR_GAIN, more + CHI_SQUARE_CLEAR * float(np.sqrt(2 * more)))
    return Explanation(
        deviations=tuple(VECTORS[k].size for k in fit.fitted),
        changes=tuple(changes),
        not_told_apart=names,
        chi_square=fit.chi_square,
        degrees_of_freedom=freedom,
        explained_share=1 - max(fit.chi_square - freedom, 0.0) / before if before > 0 else None,
        clear=(base.chi_square - fit.chi_square) / excess > by_chance,
        sufficient=record.within_noise(fit.chi_square, unknowns),
        overrides=_overrides(fit, changes, drive) if len(changes) == len(fit.fitted) and not names else (),
        alignment=replace(record.alignment, start_deg=float(fit.unknowns[-2]), zero_deg=float(fit.unknowns[-1])),
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
    k, axes = fit.fitted[i], _polar(fit, i)
    vector, (size, direction) = VECTORS[k], size_and_direction(drive, fit.vectors, k)
    blind = ((axes @ fit.unidentifiable) ** 2).sum(axis=1) > BLIND_SHARE
    if blind[0]:
        return None
    along, across = (float(np.sqrt(axis @ covariance @ axis)) * float(VECTOR_UNITS[k]) for axis in axes)
    turn = float(np.degrees(across / size)) if size else np.inf
    angles = (None, None) if blind[1] or turn > VAGUE_DIRECTION else (direction, turn / vector.order)
    return VectorChange(vector.size, size, along, vector.direction, *angles)


def _overrides(fit: VectorFit, changes: Sequence[VectorChange], drive: Drive) -> tuple[str, ...]:
    """New values, rounded to a tenth of the uncertainty or less; empty where the preset does not allow one of them."""
    changed, texts = with_vectors(drive, fit.vectors, fit.fitted), []
    for new in changes:
        spreads = {new.size: new.size_uncertainty_um, new.direction: new.direction_uncertainty_deg}
        for path, uncertainty in spreads.items():
            decimals = 1 - int(np.floor(np.log10(max(uncertainty or 1.0, 1e-9))))
            value = round(changed.number(path), min(max(decimals, 0), DECIMALS)) + 0.0
            if not drive.allows(path, value):
                return ()
            texts.append(f"{path}={value:.10g}")
    return tuple(texts)


def _not_told_apart(fit: VectorFit) -> tuple[tuple[str, ...], ...]:
    """Names of vectors that the record does not resolve, a tuple for each combination of sizes."""
    names = []
    for combination in fit.unidentifiable.T:
        parts = {VECTORS[k].size.split(".")[1]: _polar(fit, i) @ combination for i, k in enumerate(fit.fitted)}
        if max((float(along**2) for along, _ in parts.values()), default=0.0) <= BLIND_SHARE:
            continue  # directions alone, against where the record begins
        names.append(tuple(name for name, part in parts.items() if float(np.hypot(*part)) > NAMED_SHARE))
    return tuple(dict.fromkeys(names))


def conclude(
    base: Explanation, singles: Sequence[Explanation], joint: Explanation | None, *, mirrored: bool
) -> Conclusion:
    """The simplest explanation whose residual is within noise."""
    best = min(singles, key=lambda single: single.chi_square, default=base)
    if mirrored or (base.sufficient and not best.clear):
        return Conclusion("mirrored" if mirrored else "agrees")
    if best.clear and best.sufficient:
        return Conclusion("one", best)
    if joint and joint.sufficient and joint.clear:
        return Conclusion("several", joint)
    return Conclusion("unexplained", best if best.clear else None)


def equally_good(best: Explanation, singles: Sequence[Explanation]) -> list[Explanation]:
    """Other single deviations that explain the difference as well as the best one."""
    most = best.chi_square + EQUAL_FIT * best.excess
    return [single for single in singles if single is not best and single.clear and single.chi_square <= most]
