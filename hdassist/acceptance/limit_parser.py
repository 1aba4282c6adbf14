"""Limits and values as the command line and lots write them: F_ior@80=30, order_2=5, K_1=1e5, F_ior@80=28.1±1.2."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan
from typing import Literal

from hdassist.acceptance.checks import CHECKS, ORDER
from hdassist.acceptance.decision import Value
from hdassist.acceptance.limits import Limit
from hdassist.errors import UsageError
from hdassist.measuring.uncertainty import COVERAGE_FACTOR
from hdassist.numerals import number_of
from hdassist.preset.units import UnitError, is_spread, read_spread

ORDER_PREFIX = "order_"
KINDS = {check.field: check.kind for check in CHECKS if check != ORDER}
HINT = f"NAME[@TORQUE]=VALUE, NAME one of {', '.join(KINDS)}, or order_2 and so on"

Option = Literal["--limit", "--value"]


@dataclass(frozen=True)
class LimitName:
    """The name of a limit: its field of the section acceptance, order and torque as written (empty: none)."""

    field: str
    order: str = ""
    torque: str = ""

    @classmethod
    def parse(cls, text: str, option: Option, whole: str = "") -> LimitName:
        """Read a name such as F_ior@80 or order_2; whole, what messages show.

        Raises UsageError: no such name, or a torque or order that cannot be.
        """
        name, at, torque = text.strip().partition("@")
        order = name.removeprefix(ORDER_PREFIX) if name.startswith(ORDER_PREFIX) else ""
        per_torque = bool(order) or KINDS.get(name) == "limits"
        if not (order or name in KINDS) or (at and not (torque and per_torque)):
            raise UsageError(f"{option} {whole or text}: not understood", HINT)
        if order:
            _number(order, whole or text)
        return cls(ORDER.field if order else name, order, torque)

    @classmethod
    def of_column(cls, text: str, option: Option) -> LimitName | None:
        """The name that a column has; None where it is none. Raises UsageError as parse does."""
        if text.strip().partition("@")[0] not in KINDS and not text.strip().startswith(ORDER_PREFIX):
            return None
        found = cls.parse(text, option)
        if found.torque:
            _number(found.torque, text)
        return found

    def __str__(self) -> str:
        name = ORDER_PREFIX + self.order if self.order else self.field
        return f"{name}@{self.torque}" if self.torque else name

    def fits(self, limit: Limit) -> bool:
        """Whether a limit may be meant. Raises UsageError: the torque is no number."""
        return (
            limit.check.field == self.field
            and (not self.order or limit.order == float(self.order))
            and (not self.torque or limit.M_g == _number(self.torque, str(self)))
        )


@dataclass(frozen=True)
class LimitText:
    """What is said of a limit: its name, and the text behind the equals sign."""

    name: LimitName
    text: str

    @classmethod
    def parse(cls, text: str, option: Option) -> LimitText:
        """Read NAME[@TORQUE]=VALUE. Raises UsageError: a text that is none."""
        name, _, value = text.partition("=")
        if not value.strip():
            raise UsageError(f"{option} {text}: not understood", HINT)
        return cls(LimitName.parse(name, option, text), value.strip())

    def __str__(self) -> str:
        return f"{self.name}={self.text}"

    @property
    def override(self) -> str:
        """The limit as an override of the preset: the same checks, the same errors."""
        name = self.name
        key = "@".join(filter(None, (name.order, name.torque)))
        return f"{'.'.join(filter(None, ('acceptance', name.field, key)))}={self.text}"

    def limit_of(self, limits: Sequence[Limit]) -> Limit:
        """The limit of a drive that a value is for. Raises UsageError: there is none, or several."""
        fitting = [limit for limit in limits if self.name.fits(limit)]
        if not fitting:
            raise UsageError(f"--value {self}: the drive has no such limit", f"--limit {self.name}=...")
        if len(fitting) > 1:
            torques = ", ".join(f"@{limit.M_g:g}" for limit in fitting)
            raise UsageError(f"--value {self}: at which torque?", f"one of {torques}")
        return fitting[0]

    def value_for(self, limit: Limit) -> Value:
        """The value that was measured otherwise; what stands after ± is its expanded uncertainty, k = 2.

        Raises UsageError: it is none, has no uncertainty, or is below zero.
        """
        if not is_spread(self.text):
            hint = f"like {self.text}±1.2: expanded, k = 2; ±0 for none"
            raise UsageError(f"--value {self}: without its uncertainty", hint)
        try:
            number, expanded = read_spread(self.text, limit.check.unit)
        except UnitError as error:
            raise UsageError(f"--value {self}: {error.message}", error.hint) from None
        if number < 0:
            raise UsageError(f"--value {self}: {limit.label} cannot be below zero", "its size, without a sign")
        return Value(number, expanded / COVERAGE_FACTOR, "stated")


def _number(text: str, whole: str) -> float:
    if isnan(number := number_of(text)):
        raise UsageError(f"{whole}: {text} is no number", HINT)
    return number
