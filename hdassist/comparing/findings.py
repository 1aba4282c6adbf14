"""Which deviations would explain the difference between a record and a drive: fits as findings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hdassist.comparing.comparison import Change, Explanation, Finding
from hdassist.comparing.fit import VectorFit
from hdassist.comparing.record import CLEAR, Record
from hdassist.comparing.vectors import VECTORS, direction_of, with_vectors
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive

BY_CHANCE = 25.0  # chi-square of two unknowns that noise makes four times in a million
ALIKE = 9.0  # chi-square: fits that are no further apart are not told apart
TOLD = 0.1  # of an unknown's square that may lie along what the record does not tell
MAIN = 0.3  # of a combination: what has less is not named
VAGUE = 60.0  # deg: a direction that is less sure is none
FIGURES = 3  # decimals at most


def explanation(fit: VectorFit, base: VectorFit, record: Record, drive: Drive) -> Explanation:
    """What a fit says, in terms of the preset; nothing of it is solved beyond the fit itself."""
    unknowns = fit.unknowns
    freedom = record.freedom(unknowns.count)
    scale = max(1.0, fit.chi_square / freedom)
    gain = (base.chi_square - fit.chi_square) / scale
    more = fit.unknowns.count - base.unknowns.count
    covariance = scale * fit.covariance()
    told = [_change(fit, i, covariance, drive) for i in range(len(unknowns.vectors))]
    untold = _untold(fit)
    changes = tuple(change for change in told if change is not None)
    complete = len(changes) == len(unknowns.vectors) and not untold
    return Explanation(
        vectors=unknowns.vectors,
        changes=changes,
        untold=untold,
        chi_square=fit.chi_square,
        freedom=freedom,
        share=_share(fit.chi_square - freedom, base.chi_square - record.freedom(base.unknowns.count)),
        clear=gain > max(BY_CHANCE, more + CLEAR * float(np.sqrt(2 * more))),
        sufficient=record.within_noise(fit.chi_square, unknowns.count),
        overrides=_overrides(fit, changes, drive) if complete else (),
        F_ior_arcsec=None,
        left_arcsec=None,
        left_orders=(),
        place=fit.place,
    )


def _share(left: float, before: float) -> float:
    """Share that is explained of a chi-square above its degrees of freedom."""
    return 1 - max(left, 0.0) / before if before > 0 else 0.0


def _polar(fit: VectorFit, i: int) -> Array:
    """Along and across vector i, as directions among the unknowns, shape (2, unknowns)."""
    vector = fit.vectors[fit.unknowns.vectors[i]]
    unit = vector / abs(vector) if vector else 1.0
    result = np.zeros((2, fit.unknowns.count))
    result[0, 2 * i : 2 * i + 2] = unit.real, unit.imag
    result[1, 2 * i : 2 * i + 2] = -unit.imag, unit.real
    return result


def _change(fit: VectorFit, i: int, covariance: Array, drive: Drive) -> Change | None:
    """New value of vector i; None where the record does not tell its size."""
    k = fit.unknowns.vectors[i]
    along, across = _polar(fit, i)
    blind = [float(((way @ fit.blind) ** 2).sum()) for way in (along, across)]
    if blind[0] > TOLD:
        return None
    size = float(abs(fit.vectors[k]))
    spread = [float(np.sqrt(way @ covariance @ way)) for way in (along, across)]
    turn = float(np.degrees(spread[1] / size)) if size else np.inf
    vague = blind[1] > TOLD or turn > VAGUE
    direction = direction_of(fit.vectors[k], float(drive.value(VECTORS[k].direction)))
    return Change(k, size, spread[0], None if vague else direction, None if vague else turn)


def _untold(fit: VectorFit) -> tuple[tuple[str, ...], ...]:
    """Names of what the record does not tell from each other, a tuple for each combination of sizes."""
    names = []
    for combination in fit.blind.T:
        vectors = range(len(fit.unknowns.vectors))
        sizes = [abs(float(_polar(fit, i)[0] @ combination)) for i in vectors]
        if max(sizes, default=0.0) ** 2 <= TOLD:
            continue  # directions alone, against where the record begins
        names.append(
            tuple(
                VECTORS[fit.unknowns.vectors[i]].size.split(".")[1]
                for i in vectors
                if float(np.hypot(*(_polar(fit, i) @ combination))) > MAIN
            )
        )
    return tuple(dict.fromkeys(names))


def _overrides(fit: VectorFit, changes: Sequence[Change], drive: Drive) -> tuple[str, ...]:
    """What --set takes, rounded to a tenth of the uncertainty or less; empty where a preset cannot say it."""
    there = with_vectors(drive, fit.vectors, fit.unknowns.vectors)
    texts = []
    for change in changes:
        vector = VECTORS[change.vector]
        pairs = [(vector.size, change.size_uncertainty_um), (vector.direction, change.direction_uncertainty_deg)]
        for path, uncertainty in pairs:
            figures = 1 - int(np.floor(np.log10(max(uncertainty or 1.0, 1e-9))))
            value = round(float(there.value(path)), min(max(figures, 0), FIGURES)) + 0.0
            if not drive.allows(path, value):
                return ()
            texts.append(f"{path}={value:g}" if abs(value) < 1e4 else f"{path}={value}")
    return tuple(texts)


def values(overrides: Sequence[str]) -> dict[str, float]:
    """Values by path of overrides such as explanation gives."""
    return {path: float(value) for path, _, value in (text.partition("=") for text in overrides)}


def conclude(
    base: Explanation, singles: Sequence[Explanation], joint: Explanation | None, *, mirrored: bool = False
) -> Finding:
    """What the fits say together: the simplest that leaves no more than noise."""
    best = min(singles, key=lambda single: single.chi_square, default=base)
    if base.sufficient and not best.clear:
        return Finding("agrees")
    if mirrored:
        return Finding("mirrored")
    if best.clear and best.sufficient:
        return Finding("one", best)
    if joint is not None and joint.sufficient and joint.clear:
        return Finding("several", joint)
    return Finding("unexplained", best if best.clear else None)


def as_good(best: Explanation, singles: Sequence[Explanation]) -> list[Explanation]:
    """Other single deviations that explain the difference as well as the best one."""
    scale = max(1.0, best.chi_square / best.freedom)
    return [s for s in singles if s is not best and s.clear and s.chi_square - best.chi_square <= ALIKE * scale]
