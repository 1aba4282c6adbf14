"""Positions over samples of F'_ior, as a table and as JSON: of the belief, and after trials."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict

import numpy as np

from hdassist.json_parts import Json
from hdassist.mounting.losses import PositionStatistics
from hdassist.mounting.positions import hole_words
from hdassist.preset.fields import Drive
from hdassist.report.blocks import Table

LEVELS = {"expected": 0.5, "low": 0.05, "high": 0.95}  # quantiles
SHARES = ("probability_good", "probability_best", "expected_loss")  # of a position


def losses_table(
    found: PositionStatistics, holes: int, torques: Sequence[float], title: str, most: int, *notes: str
) -> Table:
    """The positions best first, at most so many: how sure each is good, its F'_ior at each torque, its loss."""
    heads = ("position", "good, %", "median", "5 %", "95 %", "loss, %")
    rows = []
    for place in found.ranked[:most]:
        spread = [beside(found.quantile(level, place), ".1f") for level in LEVELS.values()]
        good, loss = f"{100 * found.probability_good[place]:.0f}", f"{100 * found.expected_loss[place]:.1f}"
        rows.append((hole_words(found.rotations_deg[place], holes), good, *spread, loss))
    return Table(title, heads, tuple(rows), notes=(*notes, f"F'_ior in arcsec at {beside(torques, 'g')} N·m"))


def kept_line(found: PositionStatistics, drive: Drive, torques: Sequence[float]) -> str:
    """How sure the best position keeps the preset's limits, at each torque [N*m] that has one."""
    where, words = hole_words(found.rotations_deg[found.best], drive.mounting.holes), []
    weights = found.sample_weights / found.sample_weights.sum()
    for M_g, drawn in zip(torques, found.at(found.best), strict=True):
        if (limit := drive.limit(M_g)) is not None:
            sure = 100 * weights[drawn <= limit].sum()
            words.append(
                f"{sure:.0f} % sure that {where} at {M_g:g} N·m stays below {limit:g} arcsec, self error aside"
            )
    return "; ".join(words)


def losses_object(found: PositionStatistics, drive: Drive, cam_deg: float) -> Json:
    """The positions, each with F'_ior at each torque and what is probable of it, the best, second and worst of them.

    Argument: cam_deg, where the offset points that stands with the fixed wheel.
    """

    def row(place: int | None) -> Json:
        F_ior = {name: list(found.quantile(level, place)) for name, level in LEVELS.items()}
        shares = {} if place is None else {name: float(getattr(found, name)[place]) for name in SHARES}
        return {**asdict(found.position(drive, cam_deg, place)), "F_ior_arcsec": F_ior, **shares}

    ranked = [row(place) for place in found.ranked]
    return {
        "weights": None if found.weights is None else list(found.weights),
        "criterion": found.criterion.name,
        "positions": sorted(ranked, key=lambda each: each["rotation_deg"]),
        "current": row(None),
        "best_bet": ranked[0],
        "second": ranked[1] if len(ranked) > 1 else None,
        "worst": ranked[-1],
        "gain": found.range_of(found.gains(found.best))[1],
        "probability_gain": found.probability_gain(found.best).value,
        "worst_over_best": np.array([found.range_of(each) for each in found.ratios])[:, [0, 2]].tolist(),
    }


def beside(values: Iterable[float], digits: str = ".2f") -> str:
    """Values at the torques that decide, side by side."""
    return " / ".join(format(value, digits) for value in values)
