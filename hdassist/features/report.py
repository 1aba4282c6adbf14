"""Result of a command as data (quantities, texts, tables and figures), and its parts as JSON."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from functools import cache, partial
from math import floor, log10
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeAlias, TypeVar

from hdassist.run.files import package_table

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from hdassist.belief.samples import Samples
    from hdassist.belief.steps import Influence, MeasurementGain
    from hdassist.drive.model.deviations import MeasuredTeeth, MeasuredWheel, Unknown
    from hdassist.drive.preset.fields import Drive
    from hdassist.drive.solve.loadcase import CrossCheck

Json = dict[str, Any]
T = TypeVar("T")
Fact: TypeAlias = tuple[str, str]  # label and text
NO_VALUE = "-"  # cell of a table without a value
# start of numeric cells; a cell with a long word, such as "2 flexspline", is not numeric
_NUMERIC = re.compile(r"(?!.*[^\W\d_]{5})(?:[-+±≤≥<>]+ ?)?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)|-?$")


_UNITS_OF_NAMES = {  # unit and format on pages, by the unit at the end of a name in JSON
    "arcsec": ("″", ".2f"),
    "deg": ("°", ".1f"),
    "Nm": ("N·m", "g"),
    "N": ("N", ".0f"),
    "um": ("µm", ".1f"),
    "revolutions": ("input revolutions", ".2f"),
}


@dataclass(frozen=True)
class Quantity(Generic[T]):
    """A reported quantity of objects of type T, described by its name by default.

    key: dotted path in JSON and column in CSV, with the unit at its end.
    label, unit: label and unit in tables; None to derive them from the key.
    digits: number format in tables, or a function that returns the text; None to derive it from the unit.
    value: dotted name of the attribute, where a number is an index of a list, or a function; empty for the key.
    """

    key: str
    label: str | None = None
    unit: str | None = None
    digits: str | Callable[[Any], str] | None = None
    value: str | Callable[[T], Any] = ""

    def of(self, thing: T) -> Any:
        """Return the quantity of an object in full precision; None if it has none."""
        if callable(self.value):
            return self.value(thing)
        value: Any = thing
        # dotted paths contain attributes and indices of tuples
        for name in (self.value or self.key).split("."):
            if value is not None:
                value = value[int(name)] if name.isdecimal() else getattr(value, name)
        return value

    def text(self, thing: T) -> str:
        """Return the quantity as shown in a table."""
        value = self.of(thing)
        # format of the unit at the end of the name
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
    """Return a number with four significant digits, without an exponent from 0.001 to 1 000 000: 39690."""
    return f"{float(f'{value:.4g}'):g}"


def to_error_digit(
    value: float,
    standard_error: float | None,
    most: int = 2,
) -> str:
    """Return a number rounded to the first digit of its standard error: 48.65 with 1.7 is 49.

    standard_error: standard error in the unit of the number; None or 0 for an exact number.
    most: maximum number of decimals.
    """
    return f"{value:.{error_decimals(standard_error, most)}f}"


def error_decimals(standard_error: float | None, most: int = 2) -> int:
    """Return the number of decimals up to the first digit of a standard error, 1 for 0.15; most: maximum number."""
    if not standard_error:
        return most
    # further digits depend on the random samples
    return min(max(-floor(log10(standard_error)), 0), most)


Quantities: TypeAlias = tuple[Quantity[T], ...]
declared_quantities = cache(partial(package_table, "features/quantities.toml"))  # quantities by page, name and key


def quantity_table(table: str, **functions: Callable[[Any], Any]) -> Quantities[Any]:
    """Return the quantities of a table of quantities.toml; functions: values and formats by their names there."""
    page, name = table.split(".")
    quantities = []
    for key, declared in declared_quantities()[page][name].items():
        value = declared.get("value", key)
        digits = declared.get("digits")
        # names of functions in the table refer to functions of the page
        shown = declared.get("label"), declared.get("unit"), functions.get(digits or "", digits)
        quantities.append(Quantity[Any](key, *shown, functions.get(value, value)))
    return tuple(quantities)


def csv_table(
    preset: str,
    quantities: Iterable[Quantity[T]],
    things: Iterable[T],
) -> tuple[list[str], list[list[Any]]]:
    """Return header and rows of CSV, one row per object with the preset's name in the first column."""
    columns = tuple(quantities)
    return ["preset", *(q.key for q in columns)], [[preset, *(q.of(thing) for q in columns)] for thing in things]


def csv_columns(**columns: Any) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Return header and rows of CSV from named columns of equal length, which are arrays or lists."""
    lists = (values.tolist() if hasattr(values, "tolist") else values for values in columns.values())
    return [*columns], list(zip(*lists, strict=True))


def as_object(quantities: Iterable[Quantity[T]], thing: T) -> dict[str, Any]:
    """Return the quantities of an object as JSON; dotted keys are nested."""
    result: dict[str, Any] = {}
    for quantity in quantities:
        *parents, last = quantity.key.split(".")
        place = result
        for name in parents:
            # dotted keys make nested objects
            place = place.setdefault(name, {})
        place[last] = quantity.of(thing)
    return result


_TONES = {  # tones of verdicts and labels; all others have none
    **dict.fromkeys(("PASS", "TURN", "LEAVE", "KEEP"), "good"),
    **dict.fromkeys(("FAIL", "GO BACK", "MISSED", "broken"), "bad"),
    **dict.fromkeys(("INCONCLUSIVE", "BEST BET", "ANY HOLE"), "open"),
    "next": "loud",
    "verified": "quiet",
    "more": "quiet",
}


def tone_of(words: str) -> str:
    """Return the tone of a verdict or label from its words before a comma or colon; empty if it has no tone."""
    return _TONES.get(re.split("[,:]", words)[0], "")


def as_objects(quantities: Iterable[Quantity[T]], things: Iterable[T]) -> list[dict[str, Any]]:
    """Return the quantities of several objects as a list of JSON objects."""
    return [as_object(quantities, thing) for thing in things]


Series: TypeAlias = "NDArray[np.float64]"


@dataclass(frozen=True)
class Paragraph:
    """A paragraph of text."""

    text: str


BLANK = "_" * 12  # blank space to write on


@dataclass(frozen=True)
class Lines:
    """Sentences in lines under a title, each after a mark."""

    title: str
    lines: tuple[str, ...]
    mark: str = ""


@dataclass(frozen=True)
class Facts:
    """Labelled lines; a line without text is left blank to write on."""

    rows: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, rows: Iterable[tuple[str, str]]) -> Facts:
        """Return labelled lines from labels and texts; rows without text are omitted."""
        return cls(tuple(row for row in rows if row[1]))


@dataclass(frozen=True)
class Table:
    """Rows of cells under column heads, with a title and notes."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    named: bool = False  # whether the first column contains names, which may be numbers

    @property
    def words(self) -> list[int]:
        """Indices of the text columns; the other columns contain numbers or nothing."""
        # a single cell with words makes the column a text column
        columns = enumerate(zip(*self.rows, strict=True))
        return [k for k, cells in columns if (self.named and k == 0) or not all(map(_NUMERIC.match, cells))]

    @classmethod
    def by_row(
        cls,
        title: str,
        quantities: Iterable[Quantity[T]],
        things: Iterable[T],
    ) -> Table:
        """Return a table with one row per object, and one column per quantity that any object has."""
        rows = tuple(things)
        # a column without values is omitted
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
        """Return a table with one column per object, and one row per quantity that any object has.

        The first quantity gives the heads.
        """
        columns = tuple(things)
        head, *rows = [(q.words, *(q.text(thing) for thing in columns)) for q in quantities]
        return cls(title, head, tuple(row for row in rows if {*row[1:]} - {NO_VALUE}))


@dataclass(frozen=True)
class CurveMark:
    """A marked point of a curve.

    x, y: position of the point.
    words: text at the point.
    kind: now, target or limit.
    """

    x: float
    y: float
    words: str
    kind: str


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve y over x.

    x, y: values, each of shape (n,), with x increasing.
    x_label, y_label: labels with units.
    over: length in x around each point over which the minimum and maximum of y are drawn; 0 to draw y itself.
    limit: value of a line across the figure.
    whiskers: triples of x, minimum and maximum.
    marks: marked points.
    points: whether each point is marked.
    from_zero: whether the axis of y begins at 0.
    second: another series over x, shape (n,).
    names: names of both series.
    rows: approximate height in text rows.
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
        """One or two series of values over x."""
        return (self.y,) if self.second is None else (self.y, self.second)

    @property
    def extent(self) -> tuple[float, float]:
        """Smallest and largest value of all series and whiskers."""
        import numpy as np  # imported only when a figure is shown

        drawn = np.concatenate([*self.series, [end for _, *ends in self.whiskers for end in ends]])
        return float(drawn.min()), float(drawn.max())

    @property
    def ends(self) -> tuple[float, float]:
        """Ends of the y axis, which includes all values, the limit if there is one, and 0 if `from_zero` is set."""
        values = [*self.extent]
        if self.from_zero:
            values.append(0.0)
        if self.limit is not None:
            values.append(self.limit)
        return min(values), max(values)


@dataclass(frozen=True)
class Hole:
    """A hole of the seat: its number from the present hole, its direction [deg], and whether it may be used."""

    number: int
    angle_deg: float
    usable: bool


@dataclass(frozen=True)
class SeatMark:
    """A direction on the seat, with a letter and a text.

    kind: now, best or worst for a position of the wheel; now, after (the mark of the wheel) or cam for a pointer.
    angle_deg: the direction [deg].
    letter: the letter.
    words: the text.
    """

    kind: str
    angle_deg: float
    letter: str
    words: str


@dataclass(frozen=True)
class Seat:
    """The seat of the fixed wheel, seen from the wave generator side, with angles counter-clockwise from the right.

    title: title of the figure.
    holes: the holes; empty if the angle is free.
    first_deg: direction of hole 0 [deg].
    turn_deg: rotation from the present position in the shorter sense [deg], negative for clockwise.
    places: marked positions of the wheel.
    pointers: pointers from the centre.
    barred: letter of holes that are not allowed.
    legend: meaning of letters and numbers in a drawing in text characters.
    note: text below the title of a drawing in HTML.
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
    """Prominent numbers, each with a text above and below."""

    rows: tuple[tuple[str, str, str], ...]


Figure = Curve | Seat


@dataclass(frozen=True)
class ReportSection:
    """Blocks under a title."""

    title: str
    blocks: tuple[Block, ...]


Block = Paragraph | Lines | Facts | Table | Figure | Tiles | ReportSection


class ReportProof(Protocol):
    """Solved states behind a result, and their largest residual relative to its scale.

    A Certificate also has the single residuals.
    """

    @property
    def states(self) -> int:
        """Number of states."""

    @property
    def max_residual(self) -> float:
        """Largest residual of the states."""


CsvTable = tuple[Sequence[str], Sequence[Sequence[Any]]]  # header and rows


@dataclass(frozen=True)
class Report:
    """Result of a command about one drive or file.

    command: name of the command.
    drive: the drive; None if there is none.
    head: subject of the result; empty if there is no page.
    verdict: the verdict in a word.
    why: sentences below the verdict.
    blocks: blocks of the page.
    details: blocks that only --details shows.
    certificate, cross_checks: certificate and cross-checks of the states behind the result.
    values: JSON keys besides those of all results; the values may be any that `as_json` accepts.
    csv: table for CSV.
    line: the result in one line.
    about: subject of warnings; empty for the drive or its file.
    warnings: warnings.
    exit_code: exit code of the command.
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
        """Subject of warnings; empty if the result has neither a subject nor a drive."""
        return self.about or (self.drive.name if self.drive else "")


_SCHEMA_NUMBERS = {
    "accept": 2,
    "accept-replay": 2,
    "mount": 3,
    "tolerance": 2,
}  # schema numbers of JSON whose keys have changed; all others are 1


def as_json(value: Any) -> Any:
    """Return a value in JSON types: results as objects, arrays and tuples as lists, enumerations as text."""
    if is_dataclass(value):
        return {item.name: as_json(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, Mapping):
        return {key: as_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(item) for item in value]
    # must precede the last line because members of StrEnum are also texts
    if isinstance(value, Enum):
        return str(value)
    return value.tolist() if hasattr(value, "tolist") else value  # arrays and numbers of numpy


def attributes(thing: object, *names: str, **paths: str) -> Json:
    """Return attributes of a result by name, and further attributes by dotted paths.

    names: attributes with the same names in the result.
    paths: dotted paths by their names in the result.
    """
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
    """Return attributes of several results, as `attributes` does for one."""
    return [attributes(thing, *names, **paths) for thing in things]


def schema_of(command: str) -> str:
    """Return the name of the JSON schema of a command."""
    return f"hdassist.{command}/{_SCHEMA_NUMBERS.get(command, 1)}"


def certificate_object(found: object, cross_checks: Iterable[CrossCheck | None] = ()) -> Json:
    """Return certificate, cross-checks and engine as JSON, with the worst values of all torques.

    The engine is that of states solved without --solver.

    found: certificate of states, or a cached certificate, which has only its largest residual.
    cross_checks: cross-checks; None for a torque without one.
    """
    from hdassist.drive.solve.answers import Certificate
    from hdassist.drive.solve.walk import walk_library

    proof = {**attributes(found, "states", "max_residual"), "engine": walk_library()[1]}
    # cached results have only their largest residual
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
    """Return the unknown deviations as JSON, each with its possible range in the unit of its field."""
    return [{"field": u.path, "range": [u.low, u.high], "reason": u.reason} for u in unknown]


def samples_object(samples: Samples | None) -> dict[str, Any] | None:
    """Return the numbers of samples, draws and rejected draws, and the seed, as JSON; None without samples."""
    if samples is None:
        return None
    refused = [{"reason": reason, "draws": count} for reason, count in samples.refused.items()]
    counts = attributes(samples, "effective", "draws", "seed", draws_of_ranges="of_ranges.draws")
    return {**counts, "refused": refused}


def influence_objects(found: Sequence[Influence]) -> list[dict[str, Any]]:
    """Return the contributions as JSON, the largest first."""
    return objects(found, "share", field="group")


def measure_objects(found: Sequence[MeasurementGain]) -> list[dict[str, Any]]:
    """Return the measurements as JSON, the largest gain first."""
    return objects(found, "gain", what="measured")


def pitch_object(measured: MeasuredTeeth | None) -> dict[str, Any]:
    """Return the measured wheels as a JSON object, by wheel; null for a wheel with a first harmonic."""
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
