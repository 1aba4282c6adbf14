"""Guide logs of telescope mounts as recordings: the error of the right ascension axis over its angle.

A guide log of PHD2 (also of ASIAIR and KStars) has sections of frames. A frame has a time, the distance of the guide
star from its lock position along right ascension, and the pulse that moves the axis afterwards. With the pixel scale p
[arcsec/px] and the declination delta, a distance d [px] is an error of the axis:

    e = d p / cos(delta)                                                                              (1)

If the declination is unknown, e is a lower bound, because cos(delta) <= 1. In a guided section the pulses before a
frame have already moved the star. They are added back with the guide rate r [px/s] and their durations t_j [s], west
positive, because a pulse to the west reduces the distance:

    d_unguided = d + r sum of t_j over the frames j before                                            (2)

Pulses follow the error closely, so a relative error of r is nearly the relative error of the whole unguided error.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import cos, isfinite, isnan, nan, radians

from hdassist.run.errors import DataError
from hdassist.run.files import number_of

SIDEREAL_ARCSEC_S = 15.041067  # arcsec/s: speed of an axis that follows the sky
_BEGINNINGS = ("Guiding Begins", "Calibration Begins")  # first words of a section, which are followed by its head
_FACTS = {
    "scale": r"Pixel scale = ([-+0-9.]+)",
    "declination": r"(?<!Cal )\bDec = ([-+0-9.]+) deg",
    "calibrated": r"\bxRate = ([-+0-9.]+)",
    "at_equator": r"Norm rates RA = ([-+0-9.]+)",
    "guide_speed": r"RA Guide Speed = ([-+0-9.]+)",
}
_NO_RATE = 1.0  # px/s: rate that KStars writes for an unknown calibration
_HARMLESS = ("SETTLING STATE CHANGE", "Guiding parameter change", "Alert")  # lines that do not move the star
_GUIDING_SWITCH = "MountGuidingEnabled"
_SAME_RATE = 0.25  # relative difference from the log's guide rate above which a note names both
_SAME_DECLINATION_DEG = 1.0  # difference from the log's declination above which a note names both
_LEAST_RATE_UNCERTAINTY = 0.05  # relative standard uncertainty of a calibrated guide rate, assumed
_ONE_RATE_UNCERTAINTY = 0.10  # relative standard uncertainty of a guide rate without a second figure, assumed
_LONG_S = 1800.0  # an unguided section of this length is preferred to any guided one
_PREFERRED_SHARE = 0.5  # an unguided section this long, as a share of the longest guided one, is preferred


@dataclass(frozen=True)
class GuideForm:
    """Options for a guide log: declination [deg] and guide rate of the axis [arcsec/s], None if not stated."""

    declination_deg: float | None = None
    rate_arcsec_s: float | None = None


@dataclass(frozen=True)
class GuideRows:
    """Rows of a table made from a guide log.

    lines: texts of the table at the positions of the log's lines; empty for lines without a row.
    notes: how the log was read.
    is_lower_bound: whether the errors are lower bounds, because the declination is unknown.
    scale_uncertainty: relative standard uncertainty of the errors due to that of the guide rate.
    """

    lines: tuple[str, ...]
    notes: tuple[str, ...]
    is_lower_bound: bool
    scale_uncertainty: float


@dataclass(frozen=True)
class _Facts:
    """Values stated in the head of a section, NaN if they are not stated.

    scale: size of a pixel [arcsec].
    declination: declination of the guide star [deg].
    calibrated: guide rate [px/s].
    at_equator: calibrated rate of the axis [arcsec/s].
    guide_speed: rate of the axis as stated by the mount [arcsec/s].
    """

    scale: float = nan
    declination: float = nan
    calibrated: float = nan
    at_equator: float = nan
    guide_speed: float = nan


@dataclass(frozen=True)
class _Frame:
    """A frame of a guide log.

    line: index of its line.
    time_s: time [s].
    distance_px: distance of the guide star from its lock position [px].
    pulse_s: duration of the pulse after the frame [s], west positive.
    """

    line: int
    time_s: float
    distance_px: float
    pulse_s: float


@dataclass
class _Section:
    """Frames between which only pulses move the star, with the values of their head."""

    facts: _Facts
    frames: list[_Frame] = field(default_factory=list)

    @property
    def span_s(self) -> float:
        """The time from the first to the last frame [s]."""
        return self.frames[-1].time_s - self.frames[0].time_s if self.frames else 0.0

    @property
    def is_guided(self) -> bool:
        """Whether a pulse moved the star before the last frame."""
        return any(frame.pulse_s for frame in self.frames[:-1])


@dataclass(frozen=True)
class _GuideRate:
    """A guide rate [px/s], its relative standard uncertainty, and a description of its origin."""

    px_s: float
    uncertainty: float
    words: str


def _best_section(sections: Sequence[_Section]) -> _Section:
    """Return the section with the most information on the error of the axis.

    Raises DataError if no section gives an error.
    """
    longest = max(
        sections,
        key=lambda section: section.span_s,
        default=_Section(_Facts()),
    )
    unguided = max(
        map(_longest_unguided, sections),
        key=lambda section: section.span_s,
        default=_Section(_Facts()),
    )
    # without pulses the error does not depend on the guide rate, which is seldom known accurately
    is_preferred = unguided.span_s >= min(_LONG_S, _PREFERRED_SHARE * longest.span_s)
    chosen = unguided if is_preferred or not longest.is_guided else longest
    if not (chosen.span_s and isfinite(chosen.facts.scale)):
        raise DataError(
            "the PHD2 guide log contains no frames with a pixel scale, times, distances and pulses",
            "use a log with the pixel scale above the frames, and with the columns Time, RARawDistance and RADuration",
        )
    return chosen


def guide_rows(lines: Sequence[str], form: GuideForm) -> GuideRows:
    """Return the table of the best section of a guide log: error in right ascension over the angle of the axis.

    An unguided section is chosen if it lasts at least half an hour, or at least half as long as the longest guided
    section. If there is no such section, the longest guided one is chosen, and its pulses are added back.

    lines: lines of the log.
    form: options for the log.
    Raises DataError if no section gives an error.
    """
    sections = list(_sections(lines))
    chosen = _best_section(sections)
    where = _declination_words(chosen.facts, form)
    chosen = replace(chosen, facts=_with_stated(chosen.facts, form))
    frames = chosen.frames
    uncertainty = 0.0
    rate_words = "no pulses"
    if chosen.is_guided:
        rate = _guide_rate(chosen.facts, form)
        frames = _with_pulses_added(frames, rate.px_s)
        uncertainty = rate.uncertainty
        rate_words = f"pulses added back at {rate.words}"
    is_unknown = not isfinite(chosen.facts.declination)
    # equation (1): a distance in right ascension appears shortened by cos(declination) on the sky
    arcsec_per_px = chosen.facts.scale / (1.0 if is_unknown else cos(radians(chosen.facts.declination)))
    first = frames[0].line
    last = frames[-1].line
    rows = {frame.line: _row(frame, arcsec_per_px) for frame in frames}
    # the names replace the line above the first frame, so that line numbers do not change
    rows[first - 1] = "output_deg error_arcsec"
    total = sum(len(section.frames) for section in sections)
    notes = (
        f"a guide log of PHD2: lines {first + 1} to {last + 1}, {len(frames)} of {total} frames, {rate_words}; {where}",
        f"error in right ascension over the angle at {SIDEREAL_ARCSEC_S:g} arcsec/s; the sense is unknown",
    )
    table = tuple(rows.get(number, "") for number in range(len(lines)))
    return GuideRows(
        lines=table,
        notes=notes,
        is_lower_bound=is_unknown,
        scale_uncertainty=uncertainty,
    )


def _row(frame: _Frame, arcsec_per_px: float) -> str:
    """Return the angle of the axis [deg] and its error [arcsec] as a row of a table."""
    return f"{frame.time_s * SIDEREAL_ARCSEC_S / 3600:.7f} {frame.distance_px * arcsec_per_px:.4f}"


def _sections(lines: Sequence[str]) -> Iterator[_Section]:
    """Yield the sections of a log, each of which ends at a line that may indicate a movement of the star."""
    facts = _Facts()
    names = list[str]()
    section = _Section(facts)
    for number, line in enumerate(lines):
        # the head of the previous section does not apply to a new one
        if line.startswith(_BEGINNINGS):
            facts = _Facts()
            names = []
        facts = _with_facts(facts, line)
        if line.startswith("Frame,"):
            names = line.split(",")
        if line[:1].isdecimal():
            frame = _frame(
                number,
                dict(
                    zip(
                        names,
                        line.split(","),
                        strict=False,
                    )
                ),
            )
            if frame is not None:
                section.frames.append(frame)
        # dithering or slewing moves the star by an unknown amount
        elif line.strip() and not _is_harmless(line):
            if section.frames:
                yield section
            section = _Section(facts)
        # values of the head may follow the first frames
        section.facts = facts
    if section.frames:
        yield section


def _with_facts(facts: _Facts, line: str) -> _Facts:
    """Return the values of a head updated with those in a line."""
    stated = {name: match[1] for name, pattern in _FACTS.items() if (match := re.search(pattern, line))}
    return replace(facts, **{name: number_of(text) for name, text in stated.items()})


def _with_stated(facts: _Facts, form: GuideForm) -> _Facts:
    """Return the values of a head with the declination stated in an option."""
    return facts if form.declination_deg is None else replace(facts, declination=form.declination_deg)


def _declination_words(facts: _Facts, form: GuideForm) -> str:
    """Return a description of the declination and its origin. That of the option takes precedence over that of the log.

    facts: values stated in the log.
    """
    stated = form.declination_deg
    if stated is None:
        if not isfinite(facts.declination):
            return "declination unknown: the error is a lower bound (--declination DEG)"
        return f"declination {facts.declination:g} deg"
    if isfinite(facts.declination) and abs(stated - facts.declination) > _SAME_DECLINATION_DEG:
        return f"declination {stated:g} deg as stated, although the log states {facts.declination:g} deg"
    return f"declination {stated:g} deg"


def _is_harmless(line: str) -> bool:
    """Return whether a line between frames neither indicates a movement of the star nor switches guiding."""
    is_known = any(phrase in line for phrase in _HARMLESS)
    return is_known and _GUIDING_SWITCH not in line


def _frame(number: int, cells: dict[str, str]) -> _Frame | None:
    """Return the frame of a row, or None if it has no star or no column of pulses."""
    duration = cells.get("RADuration", "")
    time_s = number_of(cells.get("Time", ""))
    distance_px = number_of(cells.get("RARawDistance", ""))
    # the cells of a lost frame are empty
    if not (duration and isfinite(time_s) and isfinite(distance_px)):
        return None
    pulse_s = number_of(duration) / 1e3
    if not isfinite(pulse_s):
        return None
    # a pulse without a direction is marked by NaN
    west = {"W": 1.0, "E": -1.0}.get(cells.get("RADirection", "").strip().upper(), nan)
    return _Frame(
        line=number,
        time_s=time_s,
        distance_px=distance_px,
        pulse_s=west * pulse_s if pulse_s else 0.0,
    )


def _longest_unguided(section: _Section) -> _Section:
    """Return the longest part of a section without pulses. Frames that are followed by a pulse are excluded."""
    longest = _Section(section.facts)
    part = _Section(section.facts)
    for frame in section.frames:
        # the next frame shows the star after the pulse
        if frame.pulse_s:
            part = _Section(section.facts)
            continue
        part.frames.append(frame)
        if part.span_s > longest.span_s:
            longest = part
    return longest


def _guide_rate(facts: _Facts, form: GuideForm) -> _GuideRate:
    """Return the guide rate of a section: that of the option, the calibrated one, or that stated by the mount.

    Raises DataError if the guide rate or the declination is unknown.
    """
    if not isfinite(facts.declination):
        description = "the guide log does not state the declination, on which the guide rate depends"
        raise DataError(description, "state the declination: --declination DEG")
    px_per_arcsec = cos(radians(facts.declination)) / facts.scale
    rates = _rates_of_log(facts, px_per_arcsec)
    if form.rate_arcsec_s is not None:
        stated = form.rate_arcsec_s
        origin = f"{stated:g} arcsec/s as stated"
        # a wrong unit is a frequent cause of a difference, so the note gives both values
        if rates and abs(stated / rates[0][0] - 1) > _SAME_RATE:
            origin += f", although the log states {rates[0][0]:.3g} arcsec/s {rates[0][1]}"
        return _GuideRate(stated * px_per_arcsec, 0.0, origin)
    if not rates:
        description = "the guide log does not state the guide rate"
        raise DataError(description, "state it with --guide-rate ARCSEC/S, for example 7.52 for half the sidereal rate")
    rate, origin = rates[0]
    uncertainty = _ONE_RATE_UNCERTAINTY
    if len(rates) > 1:
        # half of the relative difference between two values for the same rate
        uncertainty = max(_LEAST_RATE_UNCERTAINTY, abs(rates[1][0] / rate - 1) / 2)
    description = f"{rate:.3g} arcsec/s {origin}, standard uncertainty {100 * uncertainty:.0f} % (assumed)"
    return _GuideRate(rate * px_per_arcsec, uncertainty, description)


def _rates_of_log(facts: _Facts, px_per_arcsec: float) -> list[tuple[float, str]]:
    """Return the guide rates of the axis in a log [arcsec/s], in order of preference, with their origins."""
    rates = []
    # this rate applies at the declination of the star, the other ones at the equator
    if facts.calibrated > 0 and facts.calibrated != _NO_RATE:
        rates.append((facts.calibrated / px_per_arcsec, "as calibrated"))
    elif facts.at_equator > 0:
        rates.append((facts.at_equator, "as calibrated"))
    if facts.guide_speed > 0:
        rates.append((facts.guide_speed, "as stated by the mount"))
    return rates


def _with_pulses_added(frames: Sequence[_Frame], rate_px_s: float) -> list[_Frame]:
    """Return frames with the distances that they would have without pulses, by (2).

    Raises DataError for a pulse without a direction, and for pulses that increase the distances.
    """
    if any(isnan(frame.pulse_s) for frame in frames):
        raise DataError(
            "the guide log contains pulses without a direction",
            "use a log with E or W in the column RADirection",
        )
    if sum(frame.pulse_s * frame.distance_px for frame in frames) < 0:
        raise DataError(
            "the pulses of the guide log increase the error instead of reducing it",
            "use a log recorded with the guide output off, for example by the Guiding Assistant",
        )
    moved_s = 0.0
    unguided = []
    for frame in frames:
        unguided.append(replace(frame, distance_px=frame.distance_px + rate_px_s * moved_s))
        moved_s += frame.pulse_s
    return unguided
