"""Texts shared by pages: the next command, the verification, deciding fields; and texts in the user's language."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

from hdassist.drive.model.deviations import assumptions, unknown_names, unknowns
from hdassist.drive.preset.fields import Drive, field_table
from hdassist.drive.preset.text import shown
from hdassist.run.errors import UsageError
from hdassist.run.files import STDIN
from hdassist.run.system import command_line

if TYPE_CHECKING:
    from hdassist.belief.samples import Samples
    from hdassist.belief.steps import Influence, MeasurementGain
    from hdassist.drive.model.deviations import MeasuredTeeth
    from hdassist.drive.solve.loadcase import CrossCheck
    from hdassist.features.report import ReportProof


DRAWN = ("tolerance", "sensitivity", "allocate")  # commands that sample random drives
_SAMPLED = ("check", "report", "mount", "plan", "accept", "compare", "compensate")  # commands that use samples
LIMITED = ("check", "report", "mount", "plan", "accept", "explore", *DRAWN)  # commands with --limit
_TOOTHED = ("check", "trace", "mount", "accept")  # commands with options for measured teeth
TAKEN_OVER = {  # commands that take over an option of another command, by the field of the option
    "draws": _SAMPLED,
    "seed": (*_SAMPLED, *DRAWN),
    "sure": ("accept", "mount"),
    "distribution": DRAWN,
    "known": DRAWN,
    **dict.fromkeys(("pitch_b", "pitch_g", "mark_b", "mark_g"), _TOOTHED),
    **dict.fromkeys(("pitch_form", "pitch_sense", "pitch_flank"), _TOOTHED),
}
_OPTION = re.compile("^(?:--[a-z-]+|-[a-z])")  # name of an option on the command line
_REPORTED = 2  # largest number of contributions, and of measurements, on a short page
ENVELOPE = "envelope per input revolution"  # label of a plot that shows the minimum and the maximum as two curves
MORE_DRAWS = 4  # factor by which more samples halve the interval of a probability


def again(command: str, drive: Drive | None, *more: str) -> str:
    """Return a shell command for the same drive, or for PRESET if the drive is unknown.

    The shell command repeats the options that were given to the command of the same name, and options of other commands
    that also apply to it.

    command: name of the command.
    drive: drive with its preset and its options, None if it is unknown.
    more: further arguments, which replace repeated options of the same name.
    """
    command_words = ["PRESET"]
    if drive:
        origin = drive.origin
        asked_options = [
            text
            for asker, field, text in origin.asked
            if command in (asker, *TAKEN_OVER.get(field, ())) and not {*_OPTION.findall(text)} & {*more}
        ]
        command_words = [preset_argument(drive), *_options(command, origin.overrides), *asked_options]
    return command_line(["hdassist", command, *command_words, *more])


def preset_argument(drive: Drive) -> str:
    """Return the preset of a drive as an argument of a command."""
    origin = drive.origin
    return "-" if origin.file == STDIN else origin.file or drive.name


def _options(command: str, overrides: Iterable[str]) -> Iterator[str]:
    """Yield overrides of a preset as options of a command: --torque and --limit where they exist, or else --set."""
    for override in overrides:
        torques = re.fullmatch(r"operation\.M_g=\[([-+.\de, ]+)\]", override)
        if torques and command != "accept":  # accept has no --torque
            yield from (f"--torque={torque.strip().removesuffix('.0')}" for torque in torques[1].split(","))
        elif command in LIMITED and (limit := re.fullmatch(r"acceptance\.F_ior(?:\.([^=]+))?=([^{]+)", override)):
            yield from ("--limit", f"F_ior@{limit[1]}={limit[2]}" if limit[1] else limit[2])
        else:
            yield from ("--set", override)


def proof(found: ReportProof | None, cross_checks: Iterable[CrossCheck | None] = ()) -> str:
    """Return one line on the verification: mesh positions, largest residual, and positions solved by another solver.

    The residual is relative to its scale. The line is empty if no mesh position was solved.
    """
    if not found or not found.states:
        return ""
    text = f"{thousands(found.states)} mesh positions, residual {found.max_residual:.0e}"
    if crosses := [cross for cross in cross_checks if cross]:
        text += f"; {crosses[0].solver} checked {sum(cross.states for cross in crosses)}"
    return text


def thousands(count: int) -> str:
    """Return a count as text with spaces between groups of three digits, such as 20 200."""
    return f"{count:,}".replace(",", " ")


def on_what(drive: Drive) -> str:
    """Return a note on the number of uncertain inputs at their nominal values; empty if there are none."""
    ranges = len(assumptions(drive))
    inputs = "inputs with an assumed or default range are at their nominal values; hdassist check samples them"
    return f"{ranges} {inputs}" if ranges else ""


def not_known(drive: Drive) -> str:
    """Return a note on the unknown deviations of a drive, which are computed as 0; empty if there are none."""
    open_ = unknowns(drive)
    return f"set to 0: {unknown_names(open_)}" if open_ else ""


def named(path: str) -> str:
    """Return the meaning of a field with its path in brackets, or the name of a computed stiffness."""
    if path not in field_table():
        return f"{path.removeprefix('stiffness.')} (hdassist stiffness)"
    return f"{field_table()[path].meaning} ({path})"


def field_unit(path: str) -> str:
    """Return the unit of a field."""
    return field_table()[path].unit


def influence_words(found: Sequence[Influence], result: str = "F'_ior") -> str:
    """Return a text on the largest contributions of fields to the variance of a result; empty if all are negligible."""
    shares = [
        f"{named(influence.group)}: {100 * influence.share:.0f} %"
        for influence in found[:_REPORTED]
        if influence.share >= 0.005
    ]
    return f"to the variance of {result}: {'; '.join(shares)}" if shares else ""


def measure_words(found: Sequence[MeasurementGain], M_g: float) -> str:
    """Return a text on the best measurements, with the relative reduction of the spread of F'_ior by each.

    found: gains from measurements, the largest first.
    M_g: torque [N*m] at which the spread is computed.
    """
    texts: list[str] = []
    for gain in found[:_REPORTED]:
        field = field_table().get(gain.measured.replace("stiffness.", "measured."))
        how = f", {field.how}" if field and field.how else ""
        name = gain.measured if how and texts else named(gain.measured)  # the first in words, others by their path
        effect = "" if texts else f"narrows the spread of F'_ior at {M_g:g} N·m "
        texts.append(f"{name}{how}: {effect}by {100 * gain.gain:.0f} %")
    return "; ".join(texts)


def more_draws(samples: Samples) -> str:
    """Return the hint that more samples may decide a verdict, with their number."""
    return f"more samples may decide the verdict without a measurement: --draws {MORE_DRAWS * round(samples.effective)}"


def samples_words(samples: Samples) -> str:
    """Return a text on the effective sample size, the number of samples, and the reasons for rejected samples."""
    refused = sum(samples.refused.values())
    text = f"effective sample size {samples.effective:.0f} from {samples.draws} samples"
    if samples.of_ranges.draws < samples.draws:
        text += f"; ranges and contributions are computed from the first {samples.of_ranges.draws}"
    if refused:
        text += f"; {refused} rejected as impossible drives ({next(iter(samples.refused))})"
    return text


HOME = "en"


@dataclass(frozen=True)
class Texts:
    """Catalogue of the texts in one language, by key; a text may contain {fields}."""

    language: str
    entries: Mapping[str, str]

    def __call__(self, key: str, **fields: object) -> str:
        """Return the text of a key with its fields filled in. Raises KeyError for an unknown key or field."""
        return self.entries[key].format(**fields)

    def variant(self, name: str) -> Texts:
        """Return a catalogue in which each entry "name.key" replaces the entry "key"."""
        entries = {
            key.removeprefix(f"{name}."): text for key, text in self.entries.items() if key.startswith(f"{name}.")
        }
        return replace(self, entries={**self.entries, **entries})

    def number(self, value: float, form: str = "g") -> str:
        """Return a number with the decimal separator of the language."""
        return f"{value:{form}}".replace(".", self("number.point"))

    def angle(self, degrees: float) -> str:
        """Return an angle with its unit."""
        return self("unit.angle", angle=self.number(degrees))

    def torque(self, M_g: float) -> str:
        """Return a torque [N*m] with its unit."""
        return self("unit.torque", torque=self.number(M_g))

    def percent(self, share: float, sign: str = "") -> str:
        """Return a share in per cent; sign: "+" if positive values have a sign, or empty."""
        return self("unit.percent", value=self.number(100 * share, f"{sign}.0f"))

    def holes(self, count: int) -> str:
        """Return a number of holes as text in the correct plural form."""
        form = next((f for f in ("one", "few") if re.search(self(f"plural.{f}"), str(count))), "many")
        return self(f"holes.{form}", count=count)

    def fixed_wheel(self, drive: Drive) -> str:
        """Return the name of the fixed wheel of a drive."""
        return self(f"wheel.{drive.mounting.fixed}")

    def date(self, day: date) -> str:
        """Return a date in the notation of the language."""
        return self(
            "date.form",
            year=f"{day.year:04}",
            month=f"{day.month:02}",
            day=f"{day.day:02}",
        )


def languages() -> list[str]:
    """Return the codes of the languages that have a catalogue."""
    folder = files(__package__) / "languages"
    return sorted(item.name.removesuffix(".yaml") for item in folder.iterdir() if item.name.endswith(".yaml"))


@cache
def texts(language: str = HOME) -> Texts:
    """Return the catalogue of a language. Raises UsageError if the language has none."""
    import yaml

    if language not in languages():
        raise UsageError(f"unknown language {language!r}", f"use one of {', '.join(languages())}")
    source = (files(__package__) / "languages" / f"{language}.yaml").read_text(encoding="utf-8")
    return Texts(language, yaml.safe_load(source))


WHEEL_WORDS = {"b": "circular spline", "g": "flexspline"}


def heading(measured: MeasuredTeeth | None) -> str:
    """Return the end of a heading, which names the wheels with measured teeth; empty if there are none."""
    wheels = measured.by_name.items() if measured else ()
    wheel_list = ", ".join(f"{WHEEL_WORDS[name]} ({shown(wheel.pitch.file)})" for name, wheel in wheels)
    return f"; measured pitch deviations: {wheel_list}" if wheel_list else ""
