"""Which deviations would explain the difference between a record and a drive: fits as findings, and the conclusion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hdassist.comparing.fit import VectorFit
from hdassist.comparing.record import CHI_SQUARE_CLEAR, Alignment, OrderPair, Record
from hdassist.comparing.vectors import VECTORS, direction_of, with_vectors
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive

BY_CHANCE = 25.0  # chi-square of two unknowns that noise makes four times in a million
ALIKE = 9.0  # chi-square: fits that are no further apart are not told apart
TOLD = 0.1  # of an unknown's square that may lie along what the record does not tell
MAIN = 0.3  # of a combination: what has less is not named
VAGUE = 60.0  # deg: a direction that is less sure is none
DECIMALS = 3  # of a new value, at most

ConclusionKind = Literal["agrees", "mirrored", "one", "several", "unexplained"]


@dataclass(frozen=True)
class Change:
    """New value of one deviation vector, with standard uncertainties; direction None where the record tells none."""

    vector: int
    size_um: float
    size_uncertainty_um: float
    direction_deg: float | None
    direction_uncertainty_deg: float | None


@dataclass(frozen=True)
class Explanation:
    """The drive with some deviations fitted to the record.

    vectors: places in VECTORS of those that were free; changes: of those that the record tells; untold: names of
    those that it does not tell from each other, a tuple a combination; chi_square, freedom; share: of the difference's
    chi-square above that of noise, explained; clear: a better fit than chance makes; sufficient: no more is left than
    noise; overrides: paths of the preset and their new values, empty where not all is told; F_ior_arcsec, of the full
    cycle then, solved; None without overrides; left_arcsec: rms of what is left within the orders, from solved states
    of the record; None where those were not solved; left_orders: the greatest of that.
    """

    vectors: tuple[int, ...]
    changes: tuple[Change, ...]
    untold: tuple[tuple[str, ...], ...]
    chi_square: float
    freedom: int
    share: float
    clear: bool
    sufficient: bool
    overrides: tuple[tuple[str, float], ...]
    alignment: Alignment
    F_ior_arcsec: float | None = None
    left_arcsec: float | None = None
    left_orders: tuple[OrderPair, ...] = ()


@dataclass(frozen=True)
class Conclusion:
    """What is concluded: agrees, mirrored, one (deviation explains it), several (together), or unexplained."""

    kind: ConclusionKind
    best: Explanation | None = None


def explanation(fit: VectorFit, base: VectorFit, record: Record, drive: Drive) -> Explanation:
    """What a fit says, in terms of the preset; nothing of it is solved beyond the fit itself."""
    vectors, unknowns = fit.free.vectors, fit.free.count
    freedom = record.freedom(unknowns)
    scale = max(1.0, fit.chi_square / freedom)
    gain = (base.chi_square - fit.chi_square) / scale
    more = unknowns - base.free.count
    covariance = scale * fit.covariance()
    told = [_change(fit, i, covariance, drive) for i in range(len(vectors))]
    changes = tuple(change for change in told if change is not None)
    untold = _untold(fit)
    before = base.chi_square - record.freedom(base.free.count)
    return Explanation(
        vectors=vectors,
        changes=changes,
        untold=untold,
        chi_square=fit.chi_square,
        freedom=freedom,
        share=1 - max(fit.chi_square - freedom, 0.0) / before if before > 0 else 0.0,
        clear=gain > max(BY_CHANCE, more + CHI_SQUARE_CLEAR * float(np.sqrt(2 * more))),
        sufficient=record.within_noise(fit.chi_square, unknowns),
        overrides=_overrides(fit, changes, drive) if len(changes) == len(vectors) and not untold else (),
        alignment=fit.alignment,
    )


def _polar(fit: VectorFit, i: int) -> Array:
    """Along and across vector i, as directions among the unknowns, shape (2, unknowns)."""
    vector = fit.vectors[fit.free.vectors[i]]
    unit = vector / abs(vector) if vector else 1.0
    result = np.zeros((2, fit.free.count))
    result[0, 2 * i : 2 * i + 2] = unit.real, unit.imag
    result[1, 2 * i : 2 * i + 2] = -unit.imag, unit.real
    return result


def _change(fit: VectorFit, i: int, covariance: Array, drive: Drive) -> Change | None:
    """New value of vector i; None where the record does not tell its size."""
    k = fit.free.vectors[i]
    vector = VECTORS[k]
    along, across = _polar(fit, i)
    blind = [float(((way @ fit.blind) ** 2).sum()) for way in (along, across)]
    if blind[0] > TOLD:
        return None
    size = float(abs(fit.vectors[k]))
    spread = [float(np.sqrt(way @ covariance @ way)) for way in (along, across)]
    turn = float(np.degrees(spread[1] / size)) if size else np.inf
    vague = blind[1] > TOLD or turn > VAGUE
    direction = direction_of(fit.vectors[k], drive.number(vector.direction), vector.order)
    sizes = size * vector.unit, spread[0] * vector.unit
    return Change(k, *sizes, None if vague else direction, None if vague else turn / vector.order)


def _untold(fit: VectorFit) -> tuple[tuple[str, ...], ...]:
    """Names of what the record does not tell from each other, a tuple for each combination of sizes."""
    names = []
    for combination in fit.blind.T:
        # along and across each vector
        shares = {VECTORS[k].name: _polar(fit, i) @ combination for i, k in enumerate(fit.free.vectors)}
        if max((abs(float(along)) for along, _ in shares.values()), default=0.0) ** 2 <= TOLD:
            continue  # directions alone, against where the record begins
        names.append(tuple(name for name, share in shares.items() if float(np.hypot(*share)) > MAIN))
    return tuple(dict.fromkeys(names))


def _overrides(fit: VectorFit, changes: Sequence[Change], drive: Drive) -> tuple[tuple[str, float], ...]:
    """New values of the preset, rounded to a tenth of the uncertainty or less; empty where a preset cannot say it."""
    there = with_vectors(drive, fit.vectors, fit.free.vectors)
    found = []
    for change in changes:
        vector = VECTORS[change.vector]
        pairs = [(vector.size, change.size_uncertainty_um), (vector.direction, change.direction_uncertainty_deg)]
        for path, uncertainty in pairs:
            decimals = 1 - int(np.floor(np.log10(max(uncertainty or 1.0, 1e-9))))
            value = round(float(there.value(path)), min(max(decimals, 0), DECIMALS)) + 0.0
            if not drive.allows(path, value):
                return ()
            found.append((path, value))
    return tuple(found)


def conclude(
    base: Explanation, singles: Sequence[Explanation], joint: Explanation | None, *, mirrored: bool = False
) -> Conclusion:
    """What the fits say together: the simplest that leaves no more than noise."""
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


def as_good(best: Explanation, singles: Sequence[Explanation]) -> list[Explanation]:
    """Other single deviations that explain the difference as well as the best one."""
    scale = max(1.0, best.chi_square / best.freedom)
    return [s for s in singles if s is not best and s.clear and s.chi_square - best.chi_square <= ALIKE * scale]
