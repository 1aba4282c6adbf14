"""The checks of an acceptance and their limits, and their notation on the command line and in lots.

The checks are declared in checks.toml. Names of limits, columns of lots, reports, `hdassist explain`, the documentation
and tests use these declarations. A limit is written 30, F_ior@80=30 or order_2=5, a measured value F_ior@80=28.1±1.2.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

from hdassist.drive.loading import Asked, load_preset
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import Acceptance, Drive, FieldKind
from hdassist.drive.preset.text import OVERRIDE
from hdassist.run.errors import DataError, UsageError
from hdassist.run.files import NUMBER, package_table
from hdassist.run.kept import ClosedRecord

_Need = Literal["cycle", "self error", "stiffness"]
Extent = Literal["whole", "at least", "at most", "part", "not known", "between torques", "scatter not known"]
Option = Literal["--limit", "--value"]
_ValueT = TypeVar("_ValueT", float, Array)


@dataclass(frozen=True, kw_only=True)
class _Explained:
    """A check or remark with a code: its name, the tested property, the meaning of a failure, and its remedy."""

    code: str
    words: str
    tests: str
    wrong: str
    change: str


@dataclass(frozen=True, kw_only=True)
class Check(_Explained):
    """A value compared with a limit of the preset.

    field: field of the preset's section acceptance that contains the limit. Its kind determines the values to which the
    limit applies.
    needs: quantities of the drive from which the value is predicted (decision.PREDICTED). If there are none, the value
    must be reported.
    of_trace: whether a recording gives the value (decision.MEASURED).
    of_part: extent of the value if the recording covers only a part of the cycle.
    upper: whether the limit is the largest value allowed, rather than the smallest.
    """

    field: str
    needs: Sequence[_Need] = ()
    of_trace: bool = False
    of_part: Extent = "at least"
    upper: bool = True

    @property
    def kind(self) -> FieldKind:
        """The kind of its limits: "limits" (one for each torque), "orders" (one for each order) or "number" (one)."""
        return Acceptance.declared()[self.field].kind

    @property
    def unit(self) -> str:
        """The unit of its value and limit in JSON."""
        return Acceptance.declared()[self.field].unit


_TABLE = package_table("features/acceptance/checks.toml")
CHECKS = tuple(Check(code=code, **declared) for code, declared in _TABLE["checks"].items())
CODES: dict[str, _Explained] = {check.code: check for check in CHECKS} | {
    code: _Explained(code=code, **declared) for code, declared in _TABLE["remarks"].items()
}
F_IOR, ORDER_CHECK = (next(check for check in CHECKS if check.code == code) for code in ("F_IOR", "ORDER"))

_ORDER_PREFIX = "order_"
_LIMIT_KINDS = {check.field: check.kind for check in CHECKS if check != ORDER_CHECK}
_HINT = f"use NAME=VALUE; NAME is one of {', '.join(_LIMIT_KINDS)}, or an order, for example order_2"
_USE: dict[Option, str] = {"--limit": "[NAME[@TORQUE]=]VALUE", "--value": "NAME[@TORQUE]=VALUE±U"}
_PER_TORQUE = "|".join(name for name, kind in _LIMIT_KINDS.items() if kind == "limits")
_OF_DRIVE = "|".join(name for name, kind in _LIMIT_KINDS.items() if kind == "number")
LIMIT_NAME = re.compile(rf"(?:{_ORDER_PREFIX}({NUMBER})|{_PER_TORQUE})(?:@({NUMBER}))?|{_OF_DRIVE}")
_OVERRIDE = re.compile(rf"^{OVERRIDE}:(\d+):\d+: (?:\S+: )?", re.MULTILINE)


@dataclass(frozen=True)
class Limit(ClosedRecord):
    """A limit of a drive, with the torque and order to which it applies.

    code: code of its check.
    limit: largest or smallest value allowed, in the unit of the check.
    M_g_Nm: torque to which it applies, None for a limit of the drive.
    per_cam_rev: order per input revolution to which it applies, None for other checks.
    """

    code: str
    limit: float
    M_g_Nm: float | None = None
    per_cam_rev: float | None = None

    @property
    def check(self) -> Check:
        """The check of the limit. Raises DataError if no check has the code."""
        entry = CODES.get(self.code)
        if not isinstance(entry, Check):
            raise DataError(f"unknown check code: {self.code}", "use one of the codes that hdassist explain lists")
        return entry

    @property
    def label(self) -> str:
        """The name of the check with its order and torque, for messages."""
        order = self.per_cam_rev
        name = self.check.words if order is None else f"amplitude of order {order:g} without sidebands"
        return name if self.M_g_Nm is None else f"{name} at {self.M_g_Nm:g} N·m"

    @property
    def option(self) -> str:
        """The option of `hdassist accept` for its measured value."""
        torque = "" if self.M_g_Nm is None else f"{self.M_g_Nm:.15g}"
        if self.check.of_trace and torque:
            return f"--measured {torque}=FILE"
        name = self.check.field if self.per_cam_rev is None else f"{_ORDER_PREFIX}{self.per_cam_rev:g}"
        return f"--value {name}{torque and f'@{torque}'}=VALUE±U"

    def room(self, value: _ValueT) -> _ValueT:
        """Return the margin of values to the limit in the unit of the check, negative beyond the limit."""
        return self.limit - value if self.check.upper else value - self.limit


class NoLimitError(DataError):
    """A drive without an acceptance limit."""


def limits_of(drive: Drive) -> tuple[Limit, ...]:
    """Return the limits of a drive: those for each torque and order, and those for the drive itself.

    The torques are operation.M_g and those named in the limits.

    Raises NoLimitError if there is no limit.
    """
    limits = tuple(limit for check in CHECKS for limit in _limits_of(check, drive))
    if not limits:
        raise NoLimitError(
            f"{drive.name} has no acceptance limit",
            f"add acceptance: {{F_ior: {{{drive.operation.M_g[0]:g}: 30}}}} to the preset, or use --limit F_ior=30",
        )
    return limits


def _limits_of(check: Check, drive: Drive) -> Iterator[Limit]:
    """Yield the limits of a check. A limit for one torque replaces that for all torques."""
    stated = drive.value(f"acceptance.{check.field}")
    if check.kind == "number":
        if stated is not None:
            yield Limit(check.code, stated)
        return
    by_order: dict[float | None, dict[float | None, float]] = {}
    for key, bound in stated.items():
        order, _, torque = key.partition("@") if check is ORDER_CHECK else ("", "", "" if key == "all" else key)
        bounds = by_order.setdefault(float(order) if order else None, {})
        bounds[float(torque) if torque else None] = bound
    for number, bounds in by_order.items():
        stated_torques = [M_g for M_g in bounds if M_g is not None]
        for M_g in dict.fromkeys([*drive.operation.M_g, *stated_torques]):
            bound = bounds.get(M_g, bounds.get(None))
            if bound is not None:
                yield Limit(check.code, bound, M_g_Nm=M_g, per_cam_rev=number)


def torques_of(limits: Iterable[Limit], need: str) -> tuple[float, ...]:
    """Return the distinct torques at which limits require a given quantity of the drive (_Need) [N*m]."""
    return tuple(
        dict.fromkeys(limit.M_g_Nm for limit in limits if need in limit.check.needs and limit.M_g_Nm is not None)
    )


@dataclass(frozen=True)
class LimitText:
    """A limit or a measured value as written: NAME[@TORQUE], and the text after the equals sign.

    name: NAME[@TORQUE].
    text: text after the equals sign.
    order: order per input revolution, None for other checks.
    torque: torque [N*m], None if it is not stated.
    """

    name: str
    text: str
    order: float | None
    torque: float | None

    @classmethod
    def parse(cls, text: str, option: Option) -> LimitText:
        """Return the parts of NAME[@TORQUE]=VALUE. A limit without a name applies to F'_ior.

        Raises UsageError for an unknown name, a missing value, or an invalid torque or order.
        """
        name, equals, value = (part.strip() for part in text.partition("="))
        if option == "--limit" and not equals and name[:1] in tuple("+-.0123456789"):
            value = name
            name = F_IOR.field
        match = LIMIT_NAME.fullmatch(name)
        if not (match and value):
            raise UsageError(f"invalid {option} {text or 'without a value'}: expected {_USE[option]}", _HINT)
        return cls(name, value, *(float(number) if number else None for number in match.groups()))

    @property
    def field(self) -> str:
        """The field of the section acceptance."""
        return self.name.partition("@")[0] if self.order is None else ORDER_CHECK.field

    def __str__(self) -> str:
        return f"{self.name}={self.text}"

    @property
    def override(self) -> str:
        """The limit as an override of the preset, so that it is checked like the preset."""
        key = self.name.removeprefix(_ORDER_PREFIX) if self.order is not None else self.name.partition("@")[2]
        return f"{'.'.join(filter(None, ('acceptance', self.field, key)))}={self.text}"

    def limit_of(self, limits: Sequence[Limit]) -> Limit:
        """Return the limit of a drive to which a value belongs.

        Raises UsageError if there is no such limit, or several.
        """
        fitting = [
            limit
            for limit in limits
            if (limit.check.field, limit.per_cam_rev) == (self.field, self.order)
            and self.torque in (None, limit.M_g_Nm)
        ]
        if not fitting:
            raise UsageError(
                f"--value {self}: the drive has no limit of this name", f"add a limit: --limit {self.name}=VALUE"
            )
        if len(fitting) > 1:
            torques = ", ".join(f"@{limit.M_g_Nm:.15g}" for limit in fitting)
            raise UsageError(f"--value {self}: the torque is missing", f"add one of {torques}")
        return fitting[0]


def load_limited(
    preset: str,
    overrides: Sequence[str],
    limits: Sequence[LimitText],
    asked: Asked = (),
) -> Drive:
    """Return the drive of a preset with overrides and limits applied.

    asked: options that become part of the drive's origin.
    Raises DataError, PresetError or UsageError; the last one names limits as they were given.
    """
    try:
        return load_preset(preset, [*overrides, *(limit.override for limit in limits)], asked)
    except UsageError as error:
        names = ["" for _ in overrides] + [f"--limit {limit}" for limit in limits]
        raise UsageError(named_overrides(error.message, names), error.hint) from None


def named_overrides(message: str, names: Sequence[str]) -> str:
    """Return a message about overrides of a preset, with numbered overrides replaced by their names.

    names: name of each override in order, empty if it has none.
    """

    def name(match: re.Match[str]) -> str:
        names_of_override = names[int(match[1]) - 1 : int(match[1])]
        return f"{names_of_override[0]}: " if any(names_of_override) else match[0]

    return _OVERRIDE.sub(name, message)
