"""The assembly card: the instruction for the assembler in the reader's language, with a drawing of the seat."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from datetime import date
from math import ceil, floor, log10
from pathlib import Path

from hdassist import __version__
from hdassist.drive.model.deviations import standing_offset
from hdassist.drive.preset.fields import Drive, origin_counts
from hdassist.drive.preset.text import shown
from hdassist.features.mounting.advice import Advice
from hdassist.features.mounting.decision import GOOD
from hdassist.features.mounting.positions import Position, hole_of, named_position
from hdassist.features.mounting.posterior import Trial
from hdassist.features.report import (
    Block,
    Facts,
    Hole,
    Lines,
    Paragraph,
    Seat,
    SeatMark,
    Table,
    error_decimals,
    to_error_digit,
)
from hdassist.interface.terminal.words import HOME, Texts, texts

ENGLISH = texts()
TRADE = {"rigid": "circular spline", "flexspline": "flexspline"}  # English names of the fixed wheel


def turn(position: Position, say: Texts = ENGLISH) -> str:
    """Return the shorter turn from hole 0 to a position as text: holes, degrees and direction."""
    way = position.short_way_deg
    direction = say("turn.counter_clockwise" if way > 0 else "turn.clockwise")
    angle = say.angle(abs(way))
    if position.hole is None:
        return say("turn.angle", angle=angle, direction=direction)
    per_hole = position.rotation_deg / position.hole if position.hole else 360.0
    return say(
        "turn.holes",
        holes=say.holes(round(abs(way) / per_hole)),
        angle=angle,
        direction=direction,
    )


def hole_place(position: Position, say: Texts = ENGLISH) -> str:
    """Return a position as text: the hole, or the angle from the start if the seat has no holes."""
    return place_at(position.rotation_deg, position.hole, say)


def place_at(
    rotation_deg: float,
    hole: int | None,
    say: Texts = ENGLISH,
) -> str:
    """Return a position as text: the hole, or the rotation [deg] if the seat has no holes and hole is None."""
    return say.angle(rotation_deg) if hole is None else say("place.hole", hole=hole)


def instruction(
    advice: Advice,
    say: Texts = ENGLISH,
    *,
    gains: bool = True,
) -> str:
    """Return the instruction for the fixed wheel: the destination first, then the turn to it from hole 0.

    All turns are measured from hole 0, because the present hole of the wheel is unknown after trials.

    advice: choice of a hole.
    say: texts of the reader's language.
    gains: whether F'_ior before and after the turn is appended.
    """
    say = say.variant("trials") if advice.trials else say
    fixed = say.fixed_wheel(advice.drive)
    chosen = advice.chosen
    if not advice.names_hole:
        return _any_hole(advice, say)
    if not advice.turn:
        return say(
            "instruction.leave",
            wheel=fixed,
            place=hole_place(chosen, say),
        )
    kind = "angle" if chosen.hole is None else "hole"
    parts = {"place": hole_place(chosen, say), "turn": turn(chosen, say), "start": start_of_count(advice.drive, say)}
    sentences = [
        say(
            f"instruction.{kind}",
            wheel=fixed,
            **parts,
        ),
        say(f"instruction.zero_{kind}", wheel=fixed),
    ]
    if gains:
        medians = zip(
            advice.torques,
            _median_texts(advice, advice.current),
            _median_texts(advice, chosen),
            strict=True,
        )
        changes = ", ".join(f"{present} → {new}″ at {M_g:g} N·m" for M_g, present, new in medians)
        statistic = "Median F'_ior" if advice.decision.is_sampled else "F'_ior"
        sentences.append(f"{statistic}: {changes}.")
    return " ".join(sentences)


def _median_texts(advice: Advice, position: Position) -> list[str]:
    """Return F'_ior [arcsec] in a position at each torque, rounded to the first digit of its standard error."""
    errors = advice.decision.standard_errors(0.5, advice.decision.place(position.rotation_deg))
    return [to_error_digit(value, error) for value, error in zip(position.F_ior_arcsec, errors, strict=True)]


def _any_hole(advice: Advice, say: Texts) -> str:
    """Return the instruction that the wheel may be put in any hole, or in any allowed hole."""
    mounting = advice.drive.mounting
    fixed = say.fixed_wheel(advice.drive)
    if not mounting.holes:
        return say("instruction.any_angle", wheel=fixed)
    if mounting.allowed == "all":
        return say("instruction.any", wheel=fixed)
    return say(
        "instruction.any_allowed",
        wheel=fixed,
        holes=", ".join(map(str, mounting.allowed)),
    )


def start_of_count(drive: Drive, say: Texts = ENGLISH) -> str:
    """Return the name of the position from which turns are measured, such as "hole 0"."""
    return say("place.start_hole") if drive.mounting.holes else say.angle(0.0)


def measured_value(trial: Trial, say: Texts = ENGLISH) -> str:
    """Return a measured value [arcsec] as text; the value of a recording is rounded to the first digit of its noise."""
    if not (trial.file and trial.noise_arcsec):
        return say.number(trial.F_ior_arcsec)
    decimals = max(0, -floor(log10(trial.noise_arcsec)))
    return say.number(trial.F_ior_arcsec, f".{decimals}f")


def seat_holes(drive: Drive) -> tuple[Hole, ...]:
    """Return the holes in the seat of a drive; the seat has no holes if the angle is free."""
    mounting = drive.mounting
    holes = []
    for number in range(mounting.holes):
        angle_deg = mounting.first_hole + 360 * number / mounting.holes
        holes.append(Hole(number, angle_deg, mounting.allowed == "all" or number in mounting.allowed))
    return tuple(holes)


def seat_of(
    advice: Advice,
    say: Texts,
    goal: Position | None,
    pointers: Sequence[SeatMark] = (),
) -> Seat:
    """Return the seat of a drive, in which the present, the worst and the best position are marked.

    If all holes are equal, only the present position is marked.

    advice: choice of a hole.
    say: texts of the reader's language.
    goal: destination of the wheel, which is the present position if the wheel stays.
    pointers: directions of the mark and of the eccentricity.
    """
    if not advice.names_hole:
        goal = None
    positions = {"now": advice.current}
    if goal:
        positions["best"] = goal
        positions["worst"] = advice.worst
    first_deg = advice.drive.mounting.first_hole
    marks = [_position_mark(kind, position, first_deg, say) for kind, position in positions.items()]
    # the best position is drawn last, so its mark is on top
    order = ("worst", "now", "best")
    return Seat(
        title=say("seat.title"),
        holes=seat_holes(advice.drive),
        first_deg=first_deg,
        turn_deg=goal.short_way_deg if goal else 0.0,
        places=tuple(sorted(marks, key=lambda mark: order.index(mark.kind))),
        pointers=tuple(pointers),
        barred=say("seat.letter_barred"),
        legend=_seat_legend(seat_holes(advice.drive), marks, goal, say),
        note=say("seat.filled") if goal else "",
    )


def _position_mark(
    kind: str,
    position: Position,
    first_deg: float,
    say: Texts,
) -> SeatMark:
    """Return the mark of a position; kind: now, best or worst; first_deg: direction of hole 0."""
    return SeatMark(
        kind=kind,
        angle_deg=first_deg + position.rotation_deg,
        letter=say(f"seat.letter_{kind}"),
        words=say(f"seat.{kind}"),
    )


def _seat_legend(
    holes: Sequence[Hole],
    marks: Sequence[SeatMark],
    goal: Position | None,
    say: Texts,
) -> str:
    """Return the legend of a seat with the given marks; goal: destination of the wheel, None if no hole is named."""
    entries = [f"{mark.letter} {mark.words}" for mark in marks]
    if goal and holes:
        entries.append(say("seat.goal", hole=goal.hole))
    legend = say("seat.legend" if holes else "seat.legend_free", places=", ".join(entries))
    if not all(hole.usable for hole in holes):
        legend += "; " + say("seat.barred", letter=say("seat.letter_barred"))
    return legend


_WARNINGS = 4  # largest number of warnings on a card
_LETTERS_OF_WARNINGS = 240  # largest number of characters in a warning on a card
WHEELS = {"b": "rigid", "g": "flexspline"}
_DIGITS = 12  # number of digits of a SHA-256 on a card
_CARD_TRIALS = 8  # largest number of measured values on a card


@dataclass(frozen=True)
class Card:
    """Assembly card of one page.

    condition: action required before bolting, empty if none is required.
    torques: F'_ior before and after, with an empty last column for measured values.
    sign: lines for the date and the name.
    """

    language: str
    title: str
    subject: Facts
    condition: Paragraph
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
        """Parts of the card below the title, from top to bottom."""
        blocks = tuple(getattr(self, field.name) for field in fields(self)[2:])
        return blocks if self.condition.text else tuple(block for block in blocks if block is not self.condition)


def card_of(
    advice: Advice,
    say: Texts,
    warnings: Sequence[str] = (),
    *,
    serial: str = "",
    made: date,
) -> Card:
    """Return the card for a choice of a hole.

    advice: choice of a hole.
    say: texts of the reader's language.
    warnings: warnings in the reader's language.
    serial: serial number of the drive.
    made: date of the card.
    """
    if advice.trials:
        say = say.variant("trials")
    seat = seat_of(advice, say, advice.chosen, tuple(_pointers(advice, say)))
    return Card(
        language=say.language,
        title=say("card.title"),
        subject=_subject(advice, say, serial),
        condition=Paragraph(_condition(advice, say)),
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


def _condition(advice: Advice, say: Texts) -> str:
    """Return the instruction to repeat a doubtful value before bolting; empty if no value is doubtful."""
    doubted = advice.to_repeat
    if not doubted:
        return ""
    hole = hole_of(doubted.rotation_deg, advice.drive.mounting.holes)
    place = place_at(doubted.rotation_deg, hole, say)
    value = f"{measured_value(doubted, say)}″"
    return say("instruction.repeat", place=place, value=value)


def _subject(
    advice: Advice,
    say: Texts,
    serial: str,
) -> Facts:
    drive = advice.drive
    gears = drive.gears
    holes = drive.mounting.holes
    fixed = say.fixed_wheel(drive)
    symbol, deviation = ("xi_b", "F'_i2") if drive.mounting.fixed == "rigid" else ("xi_g", "F'_i1")
    measured = advice.measured and advice.measured.fixed(drive)
    mark_kind = drive.mounting.mark_kind if drive.value(f"phases.{symbol}") is not None else "unknown"
    kind = "tooth" if measured else mark_kind
    tooth = measured.pitch.mark if measured else None
    angle = say.angle(360 / holes) if holes else ""
    rows = {
        "drive": drive.name,
        "serial": serial,
        "teeth": say("card.teeth_are", z_g=gears.z_g, z_b=gears.z_b, module=say.number(gears.m)),
        "fixed": fixed,
        "seat": say("card.seat_holes" if holes else "card.seat_free", holes=say.holes(holes), angle=angle),
        "mark": say(f"card.mark_{kind}", wheel=fixed, symbol=symbol, deviation=deviation, tooth=tooth),
        "sense": say("card.sense_is" if holes else "card.sense_free"),
    }
    return Facts(tuple((say(f"card.{name}"), text) for name, text in rows.items()))


def _pointers(advice: Advice, say: Texts) -> Iterator[SeatMark]:
    """Yield the directions of the mark now and afterwards, and the direction of the eccentricity if it is known."""
    yield from _mark_pointers(advice, say)
    drive = advice.drive
    size_path, direction_path = standing_offset(drive)
    cam_deg = None  # direction of the eccentricity
    if advice.after:
        cam_deg = advice.after.facing[0]
    elif drive.value(size_path):
        cam_deg = drive.value(direction_path)
    if cam_deg is not None:
        symbol = "e_hb" if drive.mounting.fixed == "rigid" else "e_hg"
        yield _pointer("cam", cam_deg % 360, say("pointer.cam", symbol=symbol), say)


def _mark_pointers(advice: Advice, say: Texts) -> Iterator[SeatMark]:
    """Yield the directions of the mark now and afterwards; if they are equal, only one; if unknown, none."""
    drive = advice.drive
    measured = advice.measured and advice.measured.fixed(drive)
    if measured:
        mark_deg = measured.mark_deg
    else:
        mark_deg = drive.value("phases.xi_b" if drive.mounting.fixed == "rigid" else "phases.xi_g")
    if mark_deg is None:
        return
    now_deg = mark_deg % 360
    turn_deg = advice.chosen.rotation_deg
    if not advice.names_hole:
        yield _pointer("now", now_deg, say("pointer.now"), say)
    elif turn_deg % 360:
        yield _pointer("now", now_deg, say("pointer.now"), say)
        yield _pointer("after", (now_deg + turn_deg) % 360, say("pointer.after"), say)
    else:
        yield _pointer("after", now_deg, say("pointer.stays"), say)


def _pointer(
    kind: str,
    angle_deg: float,
    words: str,
    say: Texts,
) -> SeatMark:
    """Return the mark of a direction on the seat; kind: now, after or cam; words: text in the legend."""
    return SeatMark(
        kind=kind,
        angle_deg=angle_deg,
        letter=say(f"pointer.letter_{kind}"),
        words=words,
    )


def _torques(advice: Advice, say: Texts) -> Table:
    """Return the table of F'_ior by torque: now and, if the wheel is turned, afterwards.

    The last column is empty, for measured values.
    """
    is_moved = advice.turn and advice.names_hole
    places = {"place": hole_place(advice.chosen, say), "zero": _zero(advice, say)}
    names = ("torque", "now", *(("after", "change") if is_moved else ()), "measured")
    rows = []
    errors = advice.decision.standard_errors(0.5, advice.decision.stay)
    new_errors = advice.decision.standard_errors(0.5, advice.decision.place(advice.chosen.rotation_deg))
    for k, M_g in enumerate(advice.torques):
        present = advice.current.F_ior_arcsec[k]
        new = advice.chosen.F_ior_arcsec[k]
        cells = [say.number(M_g), say.number(present, f".{error_decimals(errors[k])}f")]
        if is_moved:
            cells += [say.number(new, f".{error_decimals(new_errors[k])}f"), say.percent(new / present - 1, "+")]
        rows.append((*cells, ""))
    return Table(say("torques.title"), tuple(say(f"torques.{name}", **places) for name in names), tuple(rows))


def _zero(advice: Advice, say: Texts) -> str:
    """Return the start position as text: hole 0, or 0 deg if the seat has no holes."""
    return place_at(0.0, 0 if advice.drive.mounting.holes else None, say)


def _chances(advice: Advice, say: Texts) -> Iterator[str]:
    """Yield the probability of the choice, the action if the choice proves wrong, and the number of inputs."""
    yield _chance(advice, say)
    to_try = [advice.next] if advice.trials else advice.to_try
    measured = {trial.rotation_deg for trial in advice.trials}
    untried = [p for p in [p for p in to_try if p] or [advice.current] if p.rotation_deg not in measured]
    holes = ", ".join(hole_place(p, say) for p in untried)
    enough = "" if untried else "_measured"
    if advice.decision.is_sampled:
        yield say(f"chance.wrong{enough}", holes=holes, **_outcome_words(advice, say))
    else:
        yield say(f"chance.worse{enough}", holes=holes)
    kinds = origin_counts(advice.drive)
    yield say(
        "chance.inputs",
        uncertain=len(advice.open_),
        given=kinds["given"],
        identified=kinds["identified"],
    )


def _outcome_words(advice: Advice, say: Texts) -> dict[str, str]:
    """Return the range, torque and name of the expected F'_ior after bolting, by field of the texts of a card."""
    predicted = advice.predicted_outcome
    if predicted:
        low = predicted.low_arcsec
        high = predicted.high_arcsec
        M_g = advice.outcome_torque
    else:
        lightest = min(range(len(advice.torques)), key=lambda torque: abs(advice.torques[torque]))
        low, high = (advice.decision.quantile(share, advice.decision.best)[lightest] for share in (0.05, 0.95))
        M_g = advice.torques[lightest]
    return {
        "low": say.number(low, ".1f"),
        "high": say.number(high, ".1f"),
        "torque": say.torque(M_g),
        "name": outcome_name(advice),
    }


def outcome_name(advice: Advice) -> str:
    """Return the chosen position as --verify expects it, with the torque if it is not that of the measured values."""
    name = named_position(advice.chosen.rotation_deg, advice.drive.mounting.holes)
    return name if advice.outcome_torque == advice.setup.M_g else f"{name}@{advice.outcome_torque:g}"


def _chance(advice: Advice, say: Texts) -> str:
    """Return a sentence with the probability that the choice is right."""
    decision = advice.decision
    if not advice.names_hole:
        return say("chance.any")
    if not decision.is_sampled:
        return say("chance.given")
    probability = decision.probability
    sure = say.percent(probability.value)
    if probability.low < probability.high:  # the ends of the interval are rounded outwards, as on pages
        low = say.number(floor(round(100 * probability.low, 6)))
        high = say.number(ceil(round(100 * probability.high, 6)))
        sure = say(
            "chance.interval",
            value=sure,
            low=low,
            high=high,
        )
    place = hole_place(advice.chosen, say)
    zero = _zero(advice, say)
    if decision.stay is None:  # the wheel has to move, so the choice is compared with the best allowed hole
        return say(
            "chance.good",
            place=place,
            cost=say.percent(GOOD),
            sure=sure,
        )
    if advice.turn:
        return say(
            "chance.turn",
            place=place,
            zero=zero,
            cost=say.percent(decision.cost),
            sure=sure,
        )
    return say(
        "chance.leave",
        zero=zero,
        cost=say.percent(decision.cost),
        sure=sure,
    )


def _checks(advice: Advice, say: Texts) -> list[str]:
    chosen = advice.chosen
    drive = advice.drive
    place = ["place_first"] if advice.trials else []
    if advice.turn:
        place = ["place_angle" if chosen.hole is None else "place_hole"]
    if not advice.names_hole:
        place = []
    where = hole_place(chosen, say)
    parts = {
        "wheel": say.fixed_wheel(drive),
        "place": where,
        "turn": turn(chosen, say),
        "start": start_of_count(drive, say),
    }
    checks = [say(f"checks.{name}", **parts) for name in ("clean", "pilot", *place, "free", "screws", "mesh")]
    if advice.correction:
        checks.append(say("checks.correction", where=where))
    return checks


def warnings_of(drive: Drive, say: Texts) -> tuple[str, ...]:
    """Return the warnings of a preset in English; in another language, only their number."""
    origin = drive.origin
    if say.language == HOME:
        return origin.warnings
    return (say("warning.preset", count=len(origin.warnings)),) if origin.warnings else ()


def _warnings(found: Sequence[str], say: Texts) -> Iterator[str]:
    yield from map(_cut, found[:_WARNINGS])
    if len(found) > _WARNINGS:
        yield say("warnings.more", count=len(found) - _WARNINGS)


def _foot(
    advice: Advice,
    say: Texts,
    made: date,
) -> Iterator[str]:
    drive = advice.drive
    by_torque = dict[float, list[str]]()
    for trial in advice.trials[:_CARD_TRIALS]:
        where = place_at(trial.rotation_deg, hole_of(trial.rotation_deg, drive.mounting.holes), say)
        name = "foot.trial_of_file" if trial.file else "foot.trial"
        file = shown(Path(trial.file).name)
        value_text = say(
            name,
            where=where,
            value=measured_value(trial, say),
            file=file,
        )
        by_torque.setdefault(advice.torque_of(trial), []).append(value_text)
    if by_torque:
        (first, value_text), *further_torques = (
            (say.torque(M_g), "; ".join(words)) for M_g, words in by_torque.items()
        )
        paragraphs = [value_text, *(": ".join(entry) for entry in further_torques)]
        if len(advice.trials) > _CARD_TRIALS:
            paragraphs.append(say("foot.trials_more", count=len(advice.trials) - _CARD_TRIALS))
        yield say(
            "foot.trials",
            torque=first,
            trials="; ".join(paragraphs),
        )
    yield say("foot.source")
    digest = drive.origin.sha256[:_DIGITS]
    yield say(
        "foot.origin",
        version=__version__,
        name=drive.name,
        digest=digest,
        date=say.date(made),
    )
    for name, measured in advice.measured.by_name.items() if advice.measured else ():
        file = shown(measured.pitch.file)
        digest = measured.pitch.sha256[:_DIGITS]
        yield say(
            "foot.measured",
            wheel=say(f"wheel.{WHEELS[name]}"),
            file=file,
            digest=digest,
        )
    if drive.origin.overrides:
        yield say("foot.overrides", values=_cut(", ".join(drive.origin.overrides)))


def _cut(text: str) -> str:
    """Return a text, shortened to the largest length of a warning if it is longer."""
    return text if len(text) <= _LETTERS_OF_WARNINGS else f"{text[:_LETTERS_OF_WARNINGS].rstrip()}..."
