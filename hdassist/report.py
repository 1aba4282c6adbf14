"""The answer of a command as it is declared: quantities, texts, tables and figures as data; its parts as JSON."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from functools import cache, partial
from math import floor, log10
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeAlias, TypeVar

from hdassist.files import package_table

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from hdassist.belief.samples import Samples
    from hdassist.belief.steps import Influence, MeasurementGain
    from hdassist.model.deviations import MeasuredTeeth, MeasuredWheel, Unknown
    from hdassist.preset.fields import Drive
    from hdassist.solve.loadcase import CrossCheck

Json = dict[str, Any]
T = TypeVar("T")
Fact: TypeAlias = tuple[str, str]  # a label and a text
NO_VALUE = "-"  # in a table
# how cells of numbers begin; one with a long word, as "2 flexspline", is none
_NUMERIC = re.compile(r"(?!.*[^\W\d_]{5})(?:[-+±≤≥<>]+ ?)?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)|-?$")


_UNITS_OF_NAMES = {  # by the end of a name, which is the unit in JSON: unit and format on pages
    "arcsec": ("″", ".2f"),
    "deg": ("°", ".1f"),
    "Nm": ("N·m", "g"),
    "N": ("N", ".0f"),
    "um": ("µm", ".1f"),
    "revolutions": ("input revolutions", ".2f"),
}


@dataclass(frozen=True)
class Quantity(Generic[T]):
    """A reported quantity of things T, described by its name where nothing else is given.

    key: dotted place in JSON and column of CSV, with the unit at its end; label and unit: words in tables (None: those
    of the key); digits: format of the number there (None: as its unit has it), or the function that writes it; value:
    dotted name of its attribute (empty: the key; a number is a place in a list), or a function.
    """

    key: str
    label: str | None = None
    unit: str | None = None
    digits: str | Callable[[Any], str] | None = None
    value: str | Callable[[T], Any] = ""

    def of(self, thing: T) -> Any:
        """Return the quantity of a thing in full precision; None if there is none."""
        if callable(self.value):
            return self.value(thing)
        value: Any = thing
        # dotted paths through attributes and places of tuples
        for name in (self.value or self.key).split("."):
            if value is not None:
                value = value[int(name)] if name.isdecimal() else getattr(value, name)
        return value

    def text(self, thing: T) -> str:
        """Return the quantity as a table shows it."""
        value = self.of(thing)
        # the format of the unit at the end of the name
        digits = self._number[1] if self.digits is None else self.digits
        if value is None:
            return NO_VALUE
        return digits(value) if callable(digits) else format(value, digits) if digits else str(value)

    @property
    def words(self) -> str:
        """Label with unit."""
        name = self.key.rpartition(".")[2]
        if self._number[0]:
            name = name.removesuffix(f"_{self._end}")
        label = name.replace("_", " ").replace("F ior", "F'_ior") if self.label is None else self.label
        unit = self._number[0] if self.unit is None else self.unit
        return f"{label}, {unit}" if unit else label

    @property
    def _end(self) -> str:
        return self.key.rpartition("_")[2]

    @property
    def _number(self) -> tuple[str, str]:
        return _UNITS_OF_NAMES.get(self._end, ("", ""))


def four_digits(value: float) -> str:
    """Return a number with four digits, without an exponent from a thousandth to a million: 39690."""
    return f"{float(f'{value:.4g}'):g}"


def to_error_digit(
    value: float,
    standard_error: float | None,
    most: int = 2,
) -> str:
    """Return a number to the first digit of its standard error: 48.65 with 1.7 is 49.

    standard_error: in the unit of the number; None or 0 of an exact number.
    most: number of decimals at most.
    """
    return f"{value:.{error_decimals(standard_error, most)}f}"


def error_decimals(standard_error: float | None, most: int = 2) -> int:
    """Return the number of decimals to the first digit of a standard error, most at most: of 0.15 it is 1."""
    if not standard_error:
        return most
    # further digits are chance of the samples
    return min(max(-floor(log10(standard_error)), 0), most)


Quantities: TypeAlias = tuple[Quantity[T], ...]
declared_quantities = cache(partial(package_table, "quantities.toml"))  # by page, name and key


def quantity_table(table: str, **functions: Callable[[Any], Any]) -> Quantities[Any]:
    """Return the quantities of a table of quantities.toml; functions: values and formats that have such names there."""
    page, name = table.split(".")
    quantities = []
    for key, declared in declared_quantities()[page][name].items():
        value = declared.get("value", key)
        digits = declared.get("digits")
        # names of functions in the table stand for functions of the page
        shown = declared.get("label"), declared.get("unit"), functions.get(digits or "", digits)
        quantities.append(Quantity[Any](key, *shown, functions.get(value, value)))
    return tuple(quantities)


def csv_table(
    preset: str,
    quantities: Iterable[Quantity[T]],
    things: Iterable[T],
) -> tuple[list[str], list[list[Any]]]:
    """Return the header and rows of CSV: a row for each thing, the preset's name in its first column."""
    columns = tuple(quantities)
    return ["preset", *(q.key for q in columns)], [[preset, *(q.of(thing) for q in columns)] for thing in things]


def csv_columns(**columns: Any) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Return the header and rows of CSV from columns of the same length by name: arrays or lists."""
    lists = (values.tolist() if hasattr(values, "tolist") else values for values in columns.values())
    return [*columns], list(zip(*lists, strict=True))


def as_object(quantities: Iterable[Quantity[T]], thing: T) -> dict[str, Any]:
    """Return the quantities of a thing as a JSON object, dotted keys nested."""
    result: dict[str, Any] = {}
    for quantity in quantities:
        *parents, last = quantity.key.split(".")
        place = result
        for name in parents:
            # dotted keys make nested objects
            place = place.setdefault(name, {})
        place[last] = quantity.of(thing)
    return result


_TONES = {  # of verdicts and of labels of facts; any other has none
    **dict.fromkeys(("PASS", "TURN", "LEAVE", "KEEP"), "good"),
    **dict.fromkeys(("FAIL", "GO BACK", "MISSED", "broken"), "bad"),
    **dict.fromkeys(("INCONCLUSIVE", "BEST BET", "ANY HOLE"), "open"),
    "next": "loud",
    "verified": "quiet",
    "more": "quiet",
}


def tone_of(words: str) -> str:
    """Return the tone of a verdict or label, by its words before a comma or colon; empty without one."""
    return _TONES.get(re.split("[,:]", words)[0], "")


def as_objects(quantities: Iterable[Quantity[T]], things: Iterable[T]) -> list[dict[str, Any]]:
    """Return the same for each of several things."""
    return [as_object(quantities, thing) for thing in things]


Series: TypeAlias = "NDArray[np.float64]"


@dataclass(frozen=True)
class Paragraph:
    """Text."""

    text: str


BLANK = "_" * 12  # to write on


@dataclass(frozen=True)
class Lines:
    """Sentences one below the other under a title, each behind a mark."""

    title: str
    lines: tuple[str, ...]
    mark: str = ""


@dataclass(frozen=True)
class Facts:
    """Labelled lines; one without text is to be written on."""

    rows: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, rows: Iterable[tuple[str, str]]) -> Facts:
        """Return the labelled lines from labels and texts; those without text are left out."""
        return cls(tuple(row for row in rows if row[1]))


@dataclass(frozen=True)
class Table:
    """Rows of cells under heads, with a title and notes."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    named: bool = False  # whether the first column has names, which may be numbers

    @property
    def words(self) -> list[int]:
        """Places of the columns of words; the others have numbers, or nothing."""
        # one cell of words makes the whole column one
        columns = enumerate(zip(*self.rows, strict=True))
        return [k for k, cells in columns if (self.named and k == 0) or not all(map(_NUMERIC.match, cells))]

    @classmethod
    def by_row(
        cls,
        title: str,
        quantities: Iterable[Quantity[T]],
        things: Iterable[T],
    ) -> Table:
        """Return a table with a column for each quantity that any thing has and a row for each thing."""
        rows = tuple(things)
        # a column that no thing has would be empty
        shown = [q for q in quantities if any(q.of(thing) is not None for thing in rows)]
        cells = tuple(tuple(q.text(thing) for q in shown) for thing in rows)
        return cls(title, tuple(q.words.strip() for q in shown), cells)

    @classmethod
    def by_column(
        cls,
        title: str,
        quantities: Iterable[Quantity[T]],
        things: Iterable[T],
    ) -> Table:
        """A table with a row for each quantity that any thing has and a column for each thing; the first is heads."""
        columns = tuple(things)
        head, *rows = [(q.words, *(q.text(thing) for thing in columns)) for q in quantities]
        return cls(title, head, tuple(row for row in rows if {*row[1:]} - {NO_VALUE}))


@dataclass(frozen=True)
class CurveMark:
    """A place of a curve with words; kind: now, target or limit."""

    x: float
    y: float
    words: str
    kind: str


@dataclass(frozen=True, eq=False)
class Curve:
    """y over x, both shape (n,), x growing; labels with units.

    over: a length of x, around each place of which the least and the greatest
    y are drawn (0: all of y); limit: a line across; whiskers: x with a least and a greatest value; points: whether each
    x is marked; from_zero: whether the axis begins there; second: another series over x, shape (n,), with the names of
    both; rows: about how many, of characters.
    """

    x: Series
    y: Series
    x_label: str
    y_label: str
    over: float = 0.0
    limit: float | None = None
    whiskers: tuple[tuple[float, float, float], ...] = ()
    marks: tuple[CurveMark, ...] = ()
    points: bool = False
    from_zero: bool = False
    second: Series | None = None
    names: tuple[str, ...] = ()
    rows: int = 5

    @property
    def series(self) -> tuple[Series, ...]:
        """The values over x, of one series or two."""
        return (self.y,) if self.second is None else (self.y, self.second)

    @property
    def extent(self) -> tuple[float, float]:
        """The least and the greatest value of its series and whiskers."""
        import numpy as np  # with the work that a figure shows, not before it

        drawn = np.concatenate([*self.series, [end for _, *ends in self.whiskers for end in ends]])
        return float(drawn.min()), float(drawn.max())

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the greatest value of an axis that holds its limit, and 0 if it begins there, too."""
        # what is drawn beside the curve widens its axis
        values = [*self.extent]
        if self.from_zero:
            values.append(0.0)
        if self.limit is not None:
            values.append(self.limit)
        return min(values), max(values)


@dataclass(frozen=True)
class Hole:
    """A hole of the seat: its number, counted from now; its direction [deg]; whether it may be used."""

    number: int
    angle_deg: float
    usable: bool


@dataclass(frozen=True)
class SeatMark:
    """A direction on the seat [deg], with a letter and words for it.

    kind: of a place of the wheel now, best or worst; of a pointer from the centre now, after (the wheel's mark) or cam.
    """

    kind: str
    angle_deg: float
    letter: str
    words: str


@dataclass(frozen=True)
class Seat:
    """The seat of the fixed wheel, counter-clockwise from the right, seen from the cam side.

    holes: none if the angle is free; first_deg: direction of hole 0; turn_deg: the turn from now, the shorter
    way, negative for clockwise; barred: the letter of holes that are not allowed; legend: the meaning of letters
    and numbers, for a drawing in characters; note: what a drawing in HTML has below its title.
    """

    title: str
    holes: tuple[Hole, ...]
    first_deg: float
    turn_deg: float
    places: tuple[SeatMark, ...]
    pointers: tuple[SeatMark, ...]
    barred: str
    legend: str
    note: str = ""


@dataclass(frozen=True)
class Tiles:
    """Numbers to be seen at once: words, the number, and the words below each."""

    rows: tuple[tuple[str, str, str], ...]


Figure = Curve | Seat


@dataclass(frozen=True)
class ReportSection:
    """Blocks under a title."""

    title: str
    blocks: tuple[Block, ...]


Block = Paragraph | Lines | Facts | Table | Figure | Tiles | ReportSection


class ReportProof(Protocol):
    """States that were solved behind an answer, and their greatest residual as a share of its scale.

    A Certificate has the residuals one by one too.
    """

    @property
    def states(self) -> int:
        """How many there are."""

    @property
    def max_residual(self) -> float:
        """Their greatest residual."""


CsvTable = tuple[Sequence[str], Sequence[Sequence[Any]]]  # header and rows


@dataclass(frozen=True)
class Report:
    """The answer of a command about one drive or file.

    command; drive, None if there is none; head, the subject of the answer, empty if there is no page; verdict, a
    word; why, sentences below it.
    blocks of the page, and those that only --details shows; certificate and cross-checks of the states behind it.
    values: keys of JSON beside those that all answers have, results among them as as_json takes them; csv; line: the
    answer alone.
    about: the subject of warnings, the drive or its file if it is empty; warnings; exit_code.
    """

    command: str
    drive: Drive | None
    head: str
    verdict: str = ""
    why: tuple[str, ...] = ()
    blocks: tuple[Block, ...] = ()
    details: tuple[Block, ...] = ()
    certificate: ReportProof | None = None
    cross_checks: tuple[CrossCheck | None, ...] = ()
    values: Json = field(default_factory=dict)
    csv: CsvTable | None = None
    line: str = ""
    about: str = ""
    warnings: tuple[str, ...] = ()
    exit_code: int = 0

    @property
    def subject(self) -> str:
        """The subject of warnings; empty without any."""
        return self.about or (self.drive.name if self.drive else "")


_SCHEMA_NUMBERS = {
    "accept": 2,
    "accept-replay": 2,
    "mount": 3,
    "tolerance": 2,
}  # of JSON whose keys have changed; all other has 1


def as_json(value: Any) -> Any:
    """Return a value as JSON has it: results as objects, arrays and tuples as lists, enumerations as text."""
    if is_dataclass(value):
        return {item.name: as_json(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, Mapping):
        return {key: as_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(item) for item in value]
    # before the last line, since members of StrEnum are texts too
    if isinstance(value, Enum):
        return str(value)
    return value.tolist() if hasattr(value, "tolist") else value  # arrays and numbers of numpy


def attributes(thing: object, *names: str, **paths: str) -> Json:
    """Return some attributes of a result under their names, and others by dotted paths under other names."""
    return {
        name: attrgetter(path)(thing)
        for name, path in (
            dict(
                zip(
                    names,
                    names,
                    strict=True,
                )
            )
            | paths
        ).items()
    }


def objects(things: Iterable[object], *names: str, **paths: str) -> list[Json]:
    """Return the same for each of several results."""
    return [attributes(thing, *names, **paths) for thing in things]


def schema_of(command: str) -> str:
    """Return the schema of the JSON of a command."""
    return f"hdassist.{command}/{_SCHEMA_NUMBERS.get(command, 1)}"


def certificate_object(found: object, cross_checks: Iterable[CrossCheck | None] = ()) -> Json:
    """Return certificate, cross-check and engine as JSON, the worst of all torques; for kept states the residual only.

    found: certificate of states, or a kept one; the engine is that of states that no --solver was asked for.
    """
    from hdassist.solve.answers import Certificate
    from hdassist.solve.walk import walk_library

    proof = {**attributes(found, "states", "max_residual"), "engine": walk_library()[1]}
    # kept results have their largest residual only
    if not isinstance(found, Certificate):
        return proof
    crosses = [cross for cross in cross_checks if cross]
    return proof | {
        "fallbacks": found.fallbacks,
        "residuals": attributes(found, "negative_force", "negative_gap", "complementarity", "equilibrium"),
        "cross_check": {
            "solver": crosses[0].solver,
            "states": sum(cross.states for cross in crosses),
            "max_difference_arcsec": max(cross.max_difference_arcsec for cross in crosses),
        }
        if crosses
        else None,
    }


def unknown_objects(unknown: Iterable[Unknown]) -> list[Json]:
    """Return the deviations that are not known: each with the range that it may have, in the unit of its field."""
    return [{"field": u.path, "range": [u.low, u.high], "reason": u.reason} for u in unknown]


def samples_object(samples: Samples | None) -> dict[str, Any] | None:
    """Number of samples, draws (those of ranges too) and refused draws, and the seed; None where none were drawn."""
    if samples is None:
        return None
    refused = [{"reason": reason, "draws": count} for reason, count in samples.refused.items()]
    counts = attributes(samples, "effective", "draws", "seed", draws_of_ranges="of_ranges.draws")
    return {**counts, "refused": refused}


def influence_objects(found: Sequence[Influence]) -> list[dict[str, Any]]:
    """Return the influences for JSON, the largest first."""
    return objects(found, "share", field="group")


def measure_objects(found: Sequence[MeasurementGain]) -> list[dict[str, Any]]:
    """Return the measurements for JSON, the largest gain first."""
    return objects(found, "gain", what="measured")


def pitch_object(measured: MeasuredTeeth | None) -> dict[str, Any]:
    """Return the measured wheels as a JSON object, by wheel; null where a wheel has its first harmonic."""
    return {name: _wheel(getattr(measured, name, None)) for name in ("b", "g")}


def _wheel(wheel: MeasuredWheel | None) -> dict[str, Any] | None:
    if wheel is None:
        return None
    pitch = wheel.pitch
    return {
        **attributes(pitch, "file", "sha256", "flank", "notes", mark_tooth="mark"),
        "mark_deg": wheel.mark_deg,
        "range_um": float(pitch.deviation.max() - pitch.deviation.min()),
    }
