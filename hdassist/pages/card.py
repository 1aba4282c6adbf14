"""The assembly card: an advice for the assembler at the bench, in the language of the reader, and its seat."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from datetime import date

from hdassist import __version__
from hdassist.model.deviations import standing_offset
from hdassist.mounting.advice import Advice
from hdassist.mounting.positions import Position, hole_of
from hdassist.preset.fields import Drive, origin_counts
from hdassist.preset.text import shown
from hdassist.report import Block, Facts, Hole, Lines, Paragraph, Seat, SeatMark, Table
from hdassist.terminal.words import HOME, Texts, texts

ENGLISH = texts()
TRADE = {"rigid": "rigid wheel (circular spline)", "flexspline": "flexspline"}  # the fixed wheel, in the trade's words


def wheel(drive: Drive, say: Texts = ENGLISH) -> str:
    """The wheel that is fixed, in words."""
    return say(f"wheel.{drive.mounting.fixed}")


def turn(position: Position, say: Texts = ENGLISH) -> str:
    """The turn to a position by the shorter way: holes, degrees and direction."""
    way = position.short_way_deg
    direction = say("turn.counter_clockwise" if way > 0 else "turn.clockwise")
    angle = say.angle(abs(way))
    if position.hole is None:
        return say("turn.angle", angle=angle, direction=direction)
    per_hole = position.rotation_deg / position.hole if position.hole else 360.0
    return say("turn.holes", holes=say.holes(round(abs(way) / per_hole)), angle=angle, direction=direction)


def hole_place(position: Position, say: Texts = ENGLISH) -> str:
    """A position in words: its hole, or the angle of the turn where the seat has none."""
    return place_at(position.rotation_deg, position.hole, say)


def place_at(rotation_deg: float, hole: int | None, say: Texts = ENGLISH) -> str:
    """The same of a turn [deg] and its hole."""
    return say.angle(rotation_deg) if hole is None else say("place.hole", hole=hole)


def instruction(advice: Advice, say: Texts = ENGLISH, *, gains: bool = True) -> str:
    """What to do with the wheel, which lies in the last trial if there were trials; gains: what it brings by torque."""
    fixed = wheel(advice.drive, say)
    if not advice.turn:
        return say("instruction.first" if advice.trials else "instruction.leave", wheel=fixed)
    values = zip(advice.torques, advice.current.F_ior_arcsec, advice.chosen.F_ior_arcsec, strict=True)
    gain = ", ".join(f"F'_ior {now:.2f} → {new:.2f}″ at {M_g:g} N·m" for M_g, now, new in values)
    order = say("instruction.turn", wheel=fixed, turn=turn(advice.chosen, say)) + f": {gain}" * gains
    return f"{order}. {say('instruction.from_first')}" if advice.trials else f"{order}."


def seat_holes(drive: Drive) -> tuple[Hole, ...]:
    """The holes of a drive's seat, none where the angle is free."""
    at = drive.mounting
    turns = [360 * k / at.holes for k in range(at.holes)]
    return tuple(Hole(k, at.first_hole + t, at.allowed == "all" or k in at.allowed) for k, t in enumerate(turns))


def seat_of(advice: Advice, say: Texts, goal: Position | None, pointers: Sequence[SeatMark] = ()) -> Seat:
    """The seat of a drive with the position now, and, unless all are equal, the worst one and the one to go to.

    Arguments: say, the texts of the reader's language; goal, where the wheel goes, None where it stays;
    pointers, directions of the mark and the cam.
    """
    mounting = advice.drive.mounting
    first, barred = mounting.first_hole, say("seat.letter_barred")
    differ = advice.word != "ANY_HOLE"
    named = {"now": advice.current, "best": goal if differ else None, "worst": advice.ranked[-1] if differ else None}
    places = [
        SeatMark(kind, first + p.rotation_deg, say(f"seat.letter_{kind}"), say(f"seat.{kind}"))
        for kind, p in named.items()
        if p
    ]
    holes = seat_holes(advice.drive)
    words = ", ".join(f"{p.letter} {p.words}" for p in places)
    legend = say("seat.legend" if holes else "seat.legend_free", places=words)
    if not all(hole.usable for hole in holes):
        legend += "; " + say("seat.barred", letter=barred)
    drawn = sorted(places, key=lambda p: ("worst", "now", "best").index(p.kind))  # the best one on top
    turned = goal.short_way_deg if goal else 0.0
    return Seat(say("seat.title"), holes, first, turned, tuple(drawn), tuple(pointers), barred, legend)


_WARNINGS = 4  # that a card has room for
_LETTERS_OF_WARNINGS = 240  # of one of them
WHEELS = {"b": "rigid", "g": "flexspline"}
_DIGITS = 12  # of a SHA-256
_CARD_TRIALS = 8  # that a card has room for


@dataclass(frozen=True)
class Card:
    """One page for the bench.

    torques: before and after, the last column empty for measured values; sign: lines to write on.
    """

    language: str
    title: str
    subject: Facts
    instruction: Paragraph
    seat: Seat
    directions: Lines
    torques: Table
    chance: Lines
    checks: Lines
    warnings: Lines
    sign: Facts
    foot: Lines

    @property
    def blocks(self) -> tuple[Block, ...]:
        """All of it below the title, one after the other."""
        return tuple(getattr(self, each.name) for each in fields(self)[2:])


def card_of(advice: Advice, say: Texts, warnings: Sequence[str] = (), *, serial: str = "", made: date) -> Card:
    """The card of an advice that is complete.

    Arguments: advice, after trials with the wheel in the last of them, and turns that count from before the first; say,
    the texts of a language; warnings in it; serial, number of the drive; made, date of making.
    """
    if advice.trials:
        say = say.variant("trials")
    seat = seat_of(advice, say, advice.chosen if advice.turn else None, tuple(_pointers(advice, say)))
    return Card(
        language=say.language,
        title=say("card.title"),
        subject=_subject(advice, say, serial),
        instruction=Paragraph(instruction(advice, say, gains=False)),
        seat=seat,
        directions=Lines(
            "", tuple(f"{p.letter}: {p.words}, {say.angle(round(p.angle_deg, 1))}" for p in seat.pointers)
        ),
        torques=_torques(advice, say),
        chance=Lines(f"{say('chance.title')}: {say(f'word.{advice.word}')}", tuple(_chances(advice, say))),
        checks=Lines(say("checks.title"), tuple(_checks(advice, say)), "[ ]"),
        warnings=Lines(say("warnings.title"), tuple(_warnings(warnings, say)), "!"),
        sign=Facts(((say("sign.date"), ""), (say("sign.name"), ""))),
        foot=Lines("", tuple(_foot(advice, say, made))),
    )


def _subject(advice: Advice, say: Texts, serial: str) -> Facts:
    drive = advice.drive
    gears, holes, fixed = drive.gears, drive.mounting.holes, wheel(drive, say)
    symbol, deviation = ("xi_b", "F'_i2") if drive.mounting.fixed == "rigid" else ("xi_g", "F'_i1")
    measured = advice.measured and advice.measured.fixed(drive)
    known = drive.mounting.mark_kind if drive.value(f"phases.{symbol}") is not None else "unknown"
    kind = "tooth" if measured else known
    tooth = measured.pitch.mark if measured else None
    angle = say.angle(360 / holes) if holes else ""
    rows = {
        "drive": drive.name,
        "serial": serial,
        "teeth": say("card.teeth_are", z_g=gears.z_g, z_b=gears.z_b, module=say.number(gears.m)),
        "fixed": fixed,
        "seat": say("card.seat_holes" if holes else "card.seat_free", holes=say.holes(holes), angle=angle),
        "mark": say(f"card.mark_{kind}", wheel=fixed, symbol=symbol, deviation=deviation, tooth=tooth),
        "sense": say("card.sense_is"),
    }
    return Facts(tuple((say(f"card.{name}"), text) for name, text in rows.items()))


def _pointers(advice: Advice, say: Texts) -> Iterator[SeatMark]:
    """Directions of the mark now and afterwards (one where they are the same), and of the cam offset if it has one."""
    drive, turned = advice.drive, advice.chosen.rotation_deg
    rigid = drive.mounting.fixed == "rigid"
    measured = advice.measured and advice.measured.fixed(drive)
    mark = measured.mark_deg if measured else drive.value("phases.xi_b" if rigid else "phases.xi_g")
    if mark is None:
        pass  # nobody knows where it points
    elif turned % 360:
        yield SeatMark("now", mark % 360, "a", say("pointer.now"))
        yield SeatMark("after", (mark % 360 + turned) % 360, "b", say("pointer.after"))
    else:
        yield SeatMark("after", mark % 360, "b", say("pointer.stays"))
    offset, cam = standing_offset(drive)
    cam_deg = advice.after.facing[0] if advice.after else drive.value(cam) if drive.value(offset) else None
    if cam_deg is not None:
        yield SeatMark("cam", cam_deg % 360, "c", say("pointer.cam", symbol="e_hb" if rigid else "e_hg"))


def _torques(advice: Advice, say: Texts) -> Table:
    """A row a torque: F'_ior now and, where the wheel is turned, afterwards; the last column is left to write in."""
    names = ("torque", "now", *(("after", "change") if advice.turn else ()), "measured")
    rows = []
    for M_g, now, new in zip(advice.torques, advice.current.F_ior_arcsec, advice.chosen.F_ior_arcsec, strict=True):
        after = (say.number(new, ".2f"), say.percent(new / now - 1, "+")) if advice.turn else ()
        rows.append((say.number(M_g), say.number(now, ".2f"), *after, ""))
    return Table(say("torques.title"), tuple(say(f"torques.{name}") for name in names), tuple(rows))


def _chances(advice: Advice, say: Texts) -> Iterator[str]:
    """How sure the choice is, what to do if it comes out wrong, and what it rests on."""
    found = advice.decision
    if advice.word == "ANY_HOLE":
        yield say("chance.any")
    elif not found.is_sampled:
        yield say("chance.given")
    else:
        name = "chance.turn" if advice.turn else "chance.leave"
        odds = {"cost": say.percent(found.cost), "sure": say.percent(found.probability.value)}
        yield say(name, count=len(advice.open_), **odds)
    to_try = [advice.next] if advice.trials else advice.to_try
    measured = {trial.rotation_deg for trial in advice.trials}
    left = [p for p in [p for p in to_try if p] or [advice.current] if p.rotation_deg not in measured]
    holes, enough = ", ".join(hole_place(p, say) for p in left), "" if left else "_measured"
    if found.is_sampled:
        k = min(range(len(advice.torques)), key=lambda k: abs(advice.torques[k]))
        high, torque = say.number(found.quantile(0.95, found.best)[k], ".1f"), say.torque(advice.torques[k])
        yield say(f"chance.wrong{enough}", high=high, torque=torque, holes=holes)
    else:
        yield say(f"chance.worse{enough}", holes=holes)
    kinds = origin_counts(advice.drive)
    yield say("chance.values", **{kind: str(kinds[kind]) for kind in ("given", "identified", "assumed")})


def _checks(advice: Advice, say: Texts) -> list[str]:
    chosen, place = advice.chosen, ["place_first"] if advice.trials else []
    if advice.turn:
        place = ["place_angle" if chosen.hole is None else "place_hole"]
    names = ("clean", "pilot", *place, "free", "screws", "mesh")
    found = [say(f"checks.{name}", turn=turn(chosen, say), hole=chosen.hole) for name in names]
    where = hole_place(chosen, say)
    return found + [say("checks.correction", where=where)] * bool(advice.correction)


def warnings_of(drive: Drive, say: Texts) -> tuple[str, ...]:
    """Warnings of a preset, as they are; in another language than theirs how many there are."""
    origin = drive.origin
    if say.language == HOME:
        return origin.warnings
    return (say("warning.preset", count=len(origin.warnings)),) if origin.warnings else ()


def _warnings(found: Sequence[str], say: Texts) -> Iterator[str]:
    yield from map(_cut, found[:_WARNINGS])
    if len(found) > _WARNINGS:
        yield say("warnings.more", count=len(found) - _WARNINGS)


def _foot(advice: Advice, say: Texts, made: date) -> Iterator[str]:
    drive = advice.drive
    by_torque = dict[float, list[str]]()
    for trial in advice.trials[:_CARD_TRIALS]:
        where = place_at(trial.rotation_deg, hole_of(trial.rotation_deg, drive.mounting.holes), say)
        words = say("foot.trial", where=where, value=say.number(trial.F_ior_arcsec))
        by_torque.setdefault(advice.torque_of(trial), []).append(words)
    if by_torque:
        (first, words), *others = ((say.torque(M_g), "; ".join(words)) for M_g, words in by_torque.items())
        yield say("foot.trials", torque=first, trials="; ".join([words, *(": ".join(each) for each in others)]))
    yield say("foot.source")
    digest = drive.origin.sha256[:_DIGITS]
    yield say("foot.origin", version=__version__, name=drive.name, digest=digest, date=say.date(made))
    for name, measured in advice.measured.by_name.items() if advice.measured else ():
        file, digest = shown(measured.pitch.file), measured.pitch.sha256[:_DIGITS]
        yield say("foot.measured", wheel=say(f"wheel.{WHEELS[name]}"), file=file, digest=digest)
    if drive.origin.overrides:
        yield say("foot.overrides", values=_cut(", ".join(drive.origin.overrides)))


def _cut(text: str) -> str:
    """As much of a text as a card has room for."""
    return text if len(text) <= _LETTERS_OF_WARNINGS else f"{text[:_LETTERS_OF_WARNINGS].rstrip()}..."
