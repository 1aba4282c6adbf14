"""What an answer rests on, as a table and as JSON: deviations that are not known, and what is assumed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from rich.table import Table

from hdassist.error.rests_on import Effect, spans
from hdassist.model.unknown import Unknown
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import short, unit_of
from hdassist.terminal.answers import Json
from hdassist.terminal.console import Style, table


def unknown_objects(unknown: Iterable[Unknown]) -> list[Json]:
    """Deviations that are not known: each with the range that it may have, in the unit of its field."""
    return [{"field": u.path, "range": [u.low, u.high], "reason": u.reason} for u in unknown]


def basis_objects(effects: Iterable[Effect], torques: Sequence[float]) -> list[Json]:
    """Assumptions: the plausible range of each, how much of it was computed, and F'_ior at its two ends."""
    return [
        {
            "field": effect.assumption.path,
            "assumed_range": [effect.assumption.low, effect.assumption.high],
            "computed_range": list(effect.ends),
            "effect": [
                {"M_g_Nm": M_g, "F_ior_arcsec": ends.tolist()}
                for M_g, ends in zip(torques, effect.F_ior_arcsec, strict=True)
            ],
        }
        for effect in effects
    ]


def basis_line(effects: Sequence[Effect], torques: Sequence[float]) -> str:
    """The same in a line: the first with the range of F'_ior at the torque where that is widest, the others named."""
    if not effects:
        return ""
    first = effects[0]
    k = int(np.argmax(spans(first.F_ior_arcsec, first.at)))
    ends = [*first.F_ior_arcsec[k], first.at[k]]
    words = f"assumed {first.assumption.path} ({min(ends):.1f} to {max(ends):.1f} arcsec at {torques[k]:g} N·m)"
    return ", ".join([words, *(effect.assumption.path for effect in effects[1:])])


def basis_table(drive: Drive, effects: Iterable[Effect], torques: Sequence[float], style: Style) -> Table:
    """A row an assumption, with the range of F'_ior over it at each torque."""
    grid = table(style, "rests on what is assumed: F'_ior over the plausible range of it, arcsec")
    grid.add_column(style.text("assumed"), overflow="fold")
    for M_g in torques:
        grid.add_column(style.text(f"{M_g:g} N·m"), justify="right", no_wrap=True)
    for effect in effects:
        path, (low, high) = effect.assumption.path, effect.ends
        unit = unit_of(field_table()[path])
        words = f"{path} {drive.number(path):g} {unit}".rstrip() + f" ({short(low)} to {short(high)})"
        spans = [np.append(ends, at) for ends, at in zip(effect.F_ior_arcsec, effect.at, strict=True)]
        grid.add_row(style.text(words), *(f"{span.min():.1f} to {span.max():.1f}" for span in spans))
    return grid
