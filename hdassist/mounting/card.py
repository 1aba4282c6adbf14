"""The assembly card: what the assembler at the bench needs of an advice, as facts in the language of the reader."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date

from hdassist.mounting.advice import Advice
from hdassist.mounting.card_tables import BESIDE, Table, other_positions, torques_shown, torques_table
from hdassist.mounting.page import warnings
from hdassist.mounting.positions import hole_of
from hdassist.mounting.seat import instruction, turn, wheel
from hdassist.mounting.seat_facts import Seat, seat_of
from hdassist.preset.fields import Drive
from hdassist.preset.yamltext import shown
from hdassist.terminal.texts import Texts
from hdassist.terminal.wheels_page import wheels
from hdassist.trials.trial import Trial
from hdassist.version import __version__

WARNINGS = 4  # that a card has room for
LETTERS = 240  # of one of them
TRIALS = 8  # that it tells
DIGITS = 12  # of the preset's SHA-256


@dataclass(frozen=True)
class Lines:
    """Lines of text under a title."""

    title: str
    lines: tuple[str, ...]


@dataclass(frozen=True)
class Card:
    """One page for the bench.

    subject: label and value, an empty value being a line to write on; torques: before and after, the last column
    empty for what is measured; sign: labels of lines to write on.
    """

    language: str
    title: str
    subject: tuple[tuple[str, str], ...]
    instruction: str
    seat: Seat
    directions: tuple[str, ...]
    torques: Table
    others: Table
    chance: Lines
    checks: Lines
    warnings: Lines
    sign: tuple[str, ...]
    foot: tuple[str, ...]


def card_of(
    advice: Advice,
    say: Texts,
    *,
    serial: str = "",
    made: date,
    trials: Sequence[Trial] = (),
    at: float = 0.0,
    warned: Sequence[str] | None = None,
) -> Card:
    """The card of an advice.

    Arguments: advice, a complete one; say, the texts of a language; serial, number of the drive; made, date of making;
    trials that the advice rests on, and their torque [N*m]; warned, what to warn of, without it what the advice does.
    """
    if trials:
        say = say.variant("trials")
    turned = advice.worth_turning
    target = advice.chosen if turned else advice.curve.current
    seat = seat_of(advice, say, target, best=turned)
    return Card(
        language=say.language,
        title=say("card.title"),
        subject=_subject(advice, say, serial),
        instruction=_instruction(advice, say, trials),
        seat=seat,
        directions=tuple(f"{p.letter}: {p.words}, {say.angle(round(p.angle_deg, 1))}" for p in seat.pointers),
        torques=torques_table(advice, say),
        others=other_positions(advice, target, say),
        chance=Lines(say("chance.title"), _chance(advice, say)),
        checks=Lines(say("checks.title"), _checks(advice, say, trials)),
        warnings=Lines(say("warnings.title"), _warnings(warnings(advice, say) if warned is None else warned, say)),
        sign=(say("sign.date"), say("sign.name")),
        foot=(*_trials(advice.drive, say, trials, at), *_foot(advice, say, made)),
    )


def _subject(advice: Advice, say: Texts, serial: str) -> tuple[tuple[str, str], ...]:
    drive = advice.drive
    gears, holes = drive.gears, drive.mounting.holes
    rigid = drive.mounting.fixed == "rigid"
    fixed = wheel(drive, say)
    symbol, deviation = ("xi_b", "F'_i2") if rigid else ("xi_g", "F'_i1")
    mark = say(f"card.mark_{drive.mounting.mark_kind}", wheel=fixed, symbol=symbol, deviation=deviation)
    if measured := advice.measured and advice.measured.fixed(drive):
        mark = say("card.mark_tooth", wheel=fixed, tooth=measured.pitch.mark)
    seat = (
        say("card.seat_holes", holes=say.holes(holes), angle=say.angle(360 / holes)) if holes else say("card.seat_free")
    )
    return (
        (say("card.drive"), drive.name),
        (say("card.serial"), serial),
        (say("card.teeth"), say("card.teeth_are", z_g=gears.z_g, z_b=gears.z_b, module=say.number(gears.m))),
        (say("card.fixed"), fixed),
        (say("card.torques"), ", ".join(map(say.torque, torques_shown(drive.operation.M_g)))),
        (say("card.seat"), seat),
        (say("card.mark"), mark),
        (say("card.sense"), say("card.sense_is")),
    )


def _chance(advice: Advice, say: Texts) -> tuple[str, ...]:
    sampled, lines = advice.robust, list[str]()
    if sampled:
        count = len(sampled.merits)
        share = dict(zip(sampled.places, map(float, sampled.probability_best), strict=True))
        if advice.worth_turning:
            best, gain = say.percent(share[sampled.recommended]), say.percent(sampled.probability_gain)
            lines.append(say("chance.turn", samples=count, best=best, gain=gain))
        elif 0 in share:
            lines.append(say("chance.leave", samples=count, best=say.percent(share[0])))
            if advice.chosen != advice.curve.current:
                lines.append(say("chance.not_sure", gain=say.percent(sampled.probability_gain)))
    if advice.curve.weights:
        lines.append(say("chance.weights", weights=" / ".join(map(say.number, advice.curve.weights))))
    return tuple(lines)


def _checks(advice: Advice, say: Texts, trials: Sequence[Trial]) -> tuple[str, ...]:
    place = []
    if advice.worth_turning:
        way, hole = turn(advice.chosen, say), advice.chosen.hole
        place = [say("checks.place_angle" if hole is None else "checks.place_hole", turn=way, hole=hole)]
    elif trials:
        place = [say("checks.place_first")]
    before = [say(f"checks.{name}") for name in ("clean", "pilot")]
    return (*before, *place, *(say(f"checks.{name}") for name in ("free", "screws", "mesh")))


def _warnings(found: Sequence[str], say: Texts) -> tuple[str, ...]:
    shown = [text if len(text) <= LETTERS else f"{text[:LETTERS].rstrip()}..." for text in found[:WARNINGS]]
    return (*shown, say("warnings.more", count=len(found) - WARNINGS)) if len(found) > WARNINGS else tuple(shown)


def _instruction(advice: Advice, say: Texts, trials: Sequence[Trial]) -> str:
    """What to do; after trials the wheel lies in the last of them, and the first position is one to go to."""
    if not trials:
        return instruction(advice, say, room=BESIDE)
    if not advice.worth_turning:
        return say("instruction.first", wheel=wheel(advice.drive, say))
    return f"{instruction(advice, say, room=BESIDE)} {say('instruction.from_first')}"


def _trials(drive: Drive, say: Texts, trials: Sequence[Trial], at: float) -> tuple[str, ...]:
    if not trials:
        return ()
    holes = drive.mounting.holes
    told = []
    for trial in trials[:TRIALS]:
        hole = hole_of(trial.rotation_deg, holes)
        where = say.angle(trial.rotation_deg) if hole is None else say("foot.hole", hole=hole)
        if trial.trace:
            file, value = shown(trial.trace.file), say.number(trial.F_ior_arcsec, ".1f")
            digest = trial.trace.sha256[:DIGITS]
            told.append(say("foot.traced", where=where, file=file, digest=digest, value=value))
        else:
            told.append(say("foot.trial", where=where, value=say.number(trial.F_ior_arcsec)))
    return (say("foot.trials", torque=say.torque(at), trials="; ".join(told)),)


def _foot(advice: Advice, say: Texts, made: date) -> tuple[str, ...]:
    drive, origin = advice.drive, advice.drive.origin
    lines = [
        say("foot.source"),
        say(
            "foot.origin",
            version=__version__,
            name=drive.name,
            digest=origin.sha256[:DIGITS],
            date=say.date(made),
        ),
    ]
    for name, measured in wheels(advice.measured):
        digest = measured.pitch.sha256[:DIGITS]
        file = shown(measured.pitch.file)
        lines.append(say("foot.measured", wheel=say(f"wheel.{name}"), file=file, digest=digest))
    if origin.overrides:
        values = ", ".join(origin.overrides)
        lines.append(
            say("foot.overrides", values=values if len(values) <= LETTERS else f"{values[:LETTERS].rstrip()}...")
        )
    return tuple(lines)
