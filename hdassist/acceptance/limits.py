"""Limits of a drive, and what has to be predicted of it for them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from hdassist.acceptance.checks import CHECKS, Check
from hdassist.errors import DataError
from hdassist.preset.fields import Drive


@dataclass(frozen=True)
class Limit:
    """A limit: the check, its bound in the check's unit, and what it is for: torque [N*m] and order per cam turn."""

    check: Check
    bound: float
    M_g: float | None = None
    order: float | None = None

    @property
    def label(self) -> str:
        """The check in words, with order and torque."""
        order = "" if self.order is None else f"amplitude of order {self.order:g}"
        torque = "" if self.M_g is None else f" at {self.M_g:g} N·m"
        return f"{order or self.check.words}{torque}"

    def room(self, value: float) -> float:
        """Room that a value leaves to the limit, in the unit of the check: negative beyond it."""
        return self.bound - value if self.check.upper else value - self.bound


def limits_of(drive: Drive) -> tuple[Limit, ...]:
    """Limits of a drive: for torques, those of operation.M_g and those the limits name, for orders, for the drive.

    Raises DataError: there is none.
    """
    found = tuple(_limits(drive))
    if not found:
        raise DataError(
            f"{drive.name}: no limit to accept it by",
            "acceptance: {F_ior: {80: 30}} in the preset, or --limit F_ior=30",
        )
    return found


def _limits(drive: Drive) -> Iterator[Limit]:
    for check in sorted(CHECKS, key=lambda check: ("limits", "orders", "number").index(check.kind)):
        stated = drive.value(f"acceptance.{check.field}")
        if check.kind == "limits":
            named = [float(key) for key in stated if key != "all"]
            for M_g in dict.fromkeys([*drive.operation.M_g, *named]):
                if (bound := drive.limit(M_g, check.field)) is not None:
                    yield Limit(check, bound, M_g)
        elif check.kind == "orders":
            yield from _limits_of_orders(check, drive.operation.M_g, stated)
        elif stated is not None:
            yield Limit(check, stated)


def _limits_of_orders(check: Check, torques: Sequence[float], stated: Mapping[str, float]) -> Iterator[Limit]:
    """Limits of orders: at the torques of a drive and those they name; one for a torque wins over one for each."""
    by_order: dict[float, dict[float | None, float]] = {}
    for key, value in stated.items():
        order, _, torque = key.partition("@")
        by_order.setdefault(float(order), {})[float(torque) if torque else None] = value
    for number, bounds in by_order.items():
        for M_g in dict.fromkeys([*torques, *(at for at in bounds if at is not None)]):
            bound = bounds.get(M_g, bounds.get(None))
            if bound is not None:
                yield Limit(check, bound, M_g, number)


def torques_of(limits: Iterable[Limit], need: str) -> tuple[float, ...]:
    """Torques [N*m] at which limits need something of a drive (checks.Need), each once."""
    return tuple(dict.fromkeys(limit.M_g for limit in limits if need in limit.check.needs and limit.M_g is not None))
