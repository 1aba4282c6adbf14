"""One comparison of the model with something outside of it: a test, and a row of docs/validation.md."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import pytest


class Kind(StrEnum):
    """What an agreement is worth."""

    PREDICTED = "predicted"
    CHECK = "prior"
    READING = "reading"
    FITTED = "fitted"
    BOUND = "bound"
    CLOSED_FORM = "exact"
    CONVERGENCE = "convergence"
    MODEL = "model"


@dataclass(frozen=True)
class Case:
    """A quantity, where its expected range low..high comes from, why the range is so wide, and what we get.

    miss: the reason where the model is known to miss it. A case with a miss has to miss, one without has to agree.
    spread: the range of what is got over parameter sets, in words.
    """

    quantity: str
    unit: str
    source: str
    low: float
    high: float
    why: str
    kind: Kind
    value: Callable[[], float]
    digits: str = ".3g"
    miss: str = ""
    centre: float | None = None
    slow: bool = False
    spread: Callable[[], str] | None = None

    @cached_property
    def got(self) -> float:
        """What the model gives; computed once."""
        return float(self.value())

    @property
    def agrees(self) -> bool:
        """Whether it lies in the expected range."""
        return self.low <= self.got <= self.high

    def check(self) -> None:
        """Fail where the page would lie: a miss not said, or an agreement called a miss."""
        words = f"{self.quantity}: {self.got:g} {self.unit}, expected {self.low:g} to {self.high:g}"
        assert self.agrees != bool(self.miss), words


@dataclass(frozen=True)
class Information:
    """A quantity that nothing outside of the model bounds: shown on the page, and no test."""

    quantity: str
    unit: str
    why: str
    value: Callable[[], float]
    digits: str = ".3g"


def about(value: float, tolerance: float) -> dict[str, float]:
    """Range of a value with a tolerance."""
    return {"low": value - tolerance, "high": value + tolerance, "centre": value}


def parameters(cases: Iterable[Case]) -> list[object]:
    """Cases as parameters of a test, the slow ones marked."""
    slow = pytest.mark.slow
    return [pytest.param(case, id=case.quantity, marks=[slow] if case.slow else []) for case in cases]
