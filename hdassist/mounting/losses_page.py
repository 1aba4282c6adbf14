"""Positions over draws of F'_ior, as a table and as JSON: under uncertainty, and after trials."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict

import numpy as np
from scipy.stats import norm

from hdassist.mounting.losses import Losses
from hdassist.mounting.positions import hole_words
from hdassist.preset.fields import Drive
from hdassist.terminal.answers import Json
from hdassist.terminal.console import Style, TextTable, grid

LEVELS = {"low": 0.05, "high": 0.95}  # quantiles
COARSE = 0.05  # standard error of F'_ior, as a share of it, from which on nothing is told of limits
SHARES = ("probability_good", "probability_best", "expected_loss")  # of a position


def losses_table(
    losses: Losses, holes: int, torques: Sequence[float], style: Style, title: str, most: int
) -> TextTable:
    """The positions best first, at most so many: how sure each is good, its F'_ior at each torque, what it loses."""
    heads = ("position", "good, %", "expected", "5 %", "95 %", "loss, %")
    rows = grid(style, f"{title}\nF'_ior in arcsec at {beside(torques, 'g')} N·m", *heads)
    for place in losses.ranked[:most]:
        F_ior = losses.at(place)
        spread = (F_ior.mean(axis=1), *np.quantile(F_ior, list(LEVELS.values()), axis=1))
        good, loss = f"{100 * losses.probability_good[place]:.0f}", f"{100 * losses.expected_loss[place]:.1f}"
        where = hole_words(losses.rotations_deg[place], holes)
        rows.add_row(where, good, *(beside(values, ".1f") for values in spread), loss)
    return rows


def kept_line(losses: Losses, drive: Drive, torques: Sequence[float], errors: Sequence[float] = ()) -> str:
    """How sure the best position keeps the preset's limits, at each torque [N*m] that has one.

    Argument: errors, standard ones of F'_ior [arcsec] that are not in the draws; where they are great nothing is told.
    """
    where, told = hole_words(losses.rotations_deg[losses.best], drive.mounting.holes), []
    for M_g, drawn, error in zip(torques, losses.at(losses.best), errors or [0.0] * len(torques), strict=True):
        if (limit := drive.limit(M_g)) is not None and error < COARSE * drawn.mean():
            sure = norm.cdf(limit, drawn, error).mean() if error else np.mean(drawn <= limit)
            told.append(f"{sure:.0%} sure that {where} at {M_g:g} N·m stays below {limit:g} arcsec, self error aside")
    return "; ".join(told)


def losses_object(losses: Losses, drive: Drive, cam_deg: float) -> Json:
    """The positions, each with F'_ior at each torque and what is probable of it, the best, second and worst of them.

    Argument: cam_deg, where the offset points that stands with the fixed wheel.
    """

    def told(place: int | None) -> Json:
        F_ior, at = losses.at(place), losses.position(drive, cam_deg, place)
        spread = {name: np.quantile(F_ior, level, axis=1).tolist() for name, level in LEVELS.items()}
        shares = {} if place is None else {name: float(getattr(losses, name)[place]) for name in SHARES}
        return {**asdict(at), "F_ior_arcsec": {"expected": list(at.F_ior_arcsec), **spread}, **shares}

    ranked = [told(place) for place in losses.ranked]
    return {
        "weights": None if losses.weights is None else list(losses.weights),
        "criterion": losses.criterion.name,
        "positions": sorted(ranked, key=lambda at: at["rotation_deg"]),
        "current": told(None),
        "best_bet": ranked[0],
        "second": ranked[1] if len(ranked) > 1 else None,
        "worst": ranked[-1],
        "gain": losses.gain,
        "probability_gain": losses.probability_gain,
        "standard_error_arcsec": list(losses.standard_error_arcsec),
    }


def beside(values: Iterable[float], digits: str = ".2f") -> str:
    """Values at the torques that decide, side by side."""
    return " / ".join(format(value, digits) for value in values)
