"""What an advice rests on, as a table and as JSON: whether the position stays the best over what is assumed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf

from hdassist.mounting.positions import hole_of
from hdassist.mounting.stays import End, Stays
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import short, unit_of
from hdassist.terminal.answers import Json
from hdassist.terminal.console import Style, TextTable, grid


def stays_table(drive: Drive, held: Iterable[Stays], style: Style, *, trials: bool = False) -> TextTable:
    """A row an assumption: at both ends of its range the best position, and what is said of the advised one.

    Argument: trials, whether that is the probability, in %, that it is good; else what it loses.
    """
    title = "rests on what is assumed: does the position stay the best?" + " (at the torque of the trials)" * trials
    share = "good, %" if trials else "lost"
    rows = grid(style, title, "assumed", "from", "best", share, "to", "best", share)

    def cells(end: End) -> tuple[str, str, str]:
        hole = None if end.best_deg is None else hole_of(end.best_deg, drive.mounting.holes)
        where = "-" if end.best_deg is None else f"{end.best_deg:g} deg" if hole is None else f"hole {hole}"
        good, loss = ("-" if value is None else f"{value:.0%}" for value in (end.good, end.loss))
        return short(end.value), where, good.rstrip("%") if trials else loss

    for each in held:
        path = each.assumption.path
        words = f"{path} {drive.number(path):g} {unit_of(field_table()[path])}".rstrip()
        rows.add_row(style.text(words), *(cell for end in each.ends for cell in cells(end)))
    return rows


def stays_line(drive: Drive, held: Sequence[Stays]) -> str:
    """The same in a line: at the worst end of the first what is the best there and what is lost, the others named."""
    if not held:
        return ""
    first, holes = held[0], drive.mounting.holes
    end = max(first.ends, key=lambda end: inf if end.loss is None else end.loss)
    path, words = first.assumption.path, "the position stays the best"
    if end.loss is None:
        words = f"at {short(end.value)} hardly anything explains the trials"
    elif end.loss and end.best_deg is not None:
        hole = hole_of(end.best_deg, holes)
        where = f"{end.best_deg:g} deg" if hole is None else f"hole {hole}"
        words = f"at {short(end.value)} {where} is the best, {end.loss:.0%} lost"
    words = f"assumed {path} ({words})"
    return ", ".join([words, *(each.assumption.path for each in held[1:])])


def stays_objects(drive: Drive, held: Iterable[Stays], *, trials: bool = False) -> list[Json]:
    """Assumptions: the plausible range of each, how much of it was computed, and the advice at both ends."""

    def told(end: End) -> Json:
        hole = None if end.best_deg is None else hole_of(end.best_deg, drive.mounting.holes)
        told = {"value": end.value, "best_hole": hole, "best_rotation_deg": end.best_deg, "loss": end.loss}
        return {**told, "probability_good": end.good} if trials else told

    return [
        {
            "field": each.assumption.path,
            "assumed_range": [each.assumption.low, each.assumption.high],
            "computed_range": [end.value for end in each.ends],
            "effect": [told(end) for end in each.ends],
        }
        for each in held
    ]
