"""Tables of the assembly card: F'_ior before and after, and what other positions would cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hdassist.mounting.advice import Advice
from hdassist.mounting.page import gain
from hdassist.mounting.positions import FREE_STEP, MountingCurve, Position
from hdassist.terminal.texts import Texts

TORQUES = 12  # that a card has room for
BESIDE = 4  # torques whose values stand side by side


@dataclass(frozen=True)
class Table:
    """Title, heads of the columns, rows, and a line below."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


def torques_shown(torques: Sequence[float]) -> Sequence[float]:
    """The torques that a card has room for."""
    return torques[:TORQUES]


def torques_table(advice: Advice, say: Texts) -> Table:
    """A row a torque: F'_ior now and, where the wheel is turned, afterwards; the last column is left to write in."""
    curve, turned = advice.curve, advice.worth_turning
    names = ("torque", "now", *(("after", "change") if turned else ()), "measured")
    rows = []
    values = zip(curve.torques, curve.current.F_ior_arcsec, advice.chosen.F_ior_arcsec, strict=True)
    for M_g, now, new in list(values)[:TORQUES]:
        after = (say.number(new, ".2f"), say.percent(new / now - 1, "+")) if turned else ()
        rows.append((say.number(M_g), say.number(now, ".2f"), *after, ""))
    more = len(curve.torques) - TORQUES
    note = say("torques.more", count=more) if more > 0 else ""
    return Table(say("torques.title"), tuple(say(f"torques.{name}") for name in names), tuple(rows), note)


def other_positions(advice: Advice, target: Position, say: Texts) -> Table:
    """What the positions to both sides, the second best and the worst one would cost against the target.

    Arguments: advice; target, where the wheel goes; say, the texts of a language.
    """
    curve = advice.curve
    beside = len(curve.torques) <= BESIDE
    torques = " / ".join(map(say.number, curve.torques))
    head = [
        say("others.position"),
        say("others.hole" if curve.holes else "others.turn"),
        *([say("others.values", torques=say("unit.torque", torque=torques))] if beside else []),
        say("others.against_now"),
        say("others.lost"),
    ]
    rows = []
    for words, position in _others(advice, target, say):
        if isinstance(position, int):
            rows.append((words, f"{position}", *["-"] * (len(head) - 2)))
            continue
        values = " / ".join(say.number(v, ".2f") for v in position.F_ior_arcsec)
        lost = max(new / best for new, best in zip(position.F_ior_arcsec, target.F_ior_arcsec, strict=True)) - 1
        rows.append(
            (
                words,
                f"{position.hole}" if curve.holes else say.number(position.rotation_deg),
                *([values] if beside else []),
                say.percent(gain(curve, position), "+"),
                say.percent(lost, "+"),
            )
        )
    note = say("others.counted") + ("" if beside else " " + say("others.more"))
    return Table(say("others.title"), tuple(head), tuple(rows), note if rows else "")


def _others(advice: Advice, target: Position, say: Texts) -> list[tuple[str, Position | int]]:
    """Each other position once, with all that it is; a number for a hole that is not allowed."""
    curve = advice.curve
    named: list[tuple[str, Position | int | None]] = [
        (say(words, step=_step(curve, target, found, say)), found)
        for words, found in (
            ("others.ahead", _neighbour(curve, target, 1)),
            ("others.back", _neighbour(curve, target, -1)),
        )
    ]
    if not advice.worth_turning:
        named.append((say("others.not_worth"), advice.chosen))
    if curve.holes:  # at a free angle it lies beside the best
        named.append((say("others.second"), next((p for p in advice.ranked if p not in (target, advice.chosen)), None)))
    named += [(say("seat.worst"), advice.ranked[-1]), (say("seat.now"), curve.current)]
    merged: dict[Position | int, list[str]] = {}
    for words, position in named:
        alone = words == say("seat.now") and position not in merged  # it has a table of its own
        if position is not None and position != target and not alone:
            merged.setdefault(position, []).append(words)
    return [
        ("; ".join([*words, say("others.not_allowed")] if isinstance(position, int) else words), position)
        for position, words in merged.items()
    ]


def _neighbour(curve: MountingCurve, target: Position, side: int) -> Position | int | None:
    """The position one hole further, its number where it is not allowed; at a free angle the nearest that was tried."""
    places = [curve.at(int(place)) for place in np.flatnonzero(curve.usable)]
    if curve.holes:
        wanted = ((target.hole or 0) + side) % curve.holes
        return next((p for p in places if p.hole == wanted), wanted)
    steps = [(side * _away(p, target), p) for p in places]
    return min((pair for pair in steps if pair[0] >= FREE_STEP / 2), default=(0.0, None), key=lambda pair: pair[0])[1]


def _step(curve: MountingCurve, target: Position, found: Position | int | None, say: Texts) -> str:
    """How far away a neighbour is."""
    if curve.holes or not isinstance(found, Position):
        return say.holes(1)
    return say.angle(round(abs(_away(found, target)), 6))


def _away(one: Position, other: Position) -> float:
    """Counter-clockwise turn from the other to the one [deg], in -180..180."""
    return (one.rotation_deg - other.rotation_deg + 180) % 360 - 180
