"""Reported quantities, declared once: key in JSON and CSV, words in tables, unit, format."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Generic, TypeAlias, TypeVar

T = TypeVar("T")
Fact: TypeAlias = tuple[str, str]  # a label and a text
NO_VALUE = "-"  # in a table


@dataclass(frozen=True)
class Quantity(Generic[T]):
    """A reported quantity of things T.

    key: dotted place in JSON, with the unit in its last part; label and unit: words in tables; digits: format of the
    number there, or the function that writes it; value: dotted name of its attribute (empty: the key), or a function.
    """

    key: str
    label: str = ""
    unit: str = ""
    digits: str | Callable[[Any], str] = ""
    value: str | Callable[[T], Any] = ""

    def of(self, thing: T) -> Any:
        """The quantity of a thing in full precision; None where there is none."""
        if callable(self.value):
            return self.value(thing)
        found: Any = thing
        for name in (self.value or self.key).split("."):
            found = None if found is None else getattr(found, name)
        return found

    def text(self, thing: T) -> str:
        """The quantity as a table shows it."""
        value = self.of(thing)
        if value is None:
            return NO_VALUE
        if callable(self.digits):
            return self.digits(value)
        return format(value, self.digits) if self.digits else str(value)

    @property
    def words(self) -> str:
        """Label with unit."""
        return f"{self.label}, {self.unit}" if self.unit else self.label


Quantities: TypeAlias = tuple[Quantity[T], ...]


def csv_table(preset: str, quantities: Iterable[Quantity[T]], things: Iterable[T]) -> tuple[list[str], list[list[Any]]]:
    """Header and rows of CSV: a row for each thing, the preset's name in its first column."""
    columns = tuple(quantities)
    return ["preset", *(q.key for q in columns)], [[preset, *(q.of(thing) for q in columns)] for thing in things]


def csv_columns(**columns: Any) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Header and rows of CSV from columns of the same length by name: arrays or lists."""
    lists = (values.tolist() if hasattr(values, "tolist") else values for values in columns.values())
    return [*columns], list(zip(*lists, strict=True))


def as_object(quantities: Iterable[Quantity[T]], thing: T) -> dict[str, Any]:
    """The quantities of a thing as a JSON object, dotted keys nested."""
    result: dict[str, Any] = {}
    for quantity in quantities:
        *parents, last = quantity.key.split(".")
        place = result
        for name in parents:
            place = place.setdefault(name, {})
        place[last] = quantity.of(thing)
    return result
