"""CSV that a spreadsheet reads as what it says, and computes nothing of; results as JSON."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdassist.features.report import Quantity, as_json
from hdassist.interface.terminal.output import FORMULA, csv_text, json_text
from hdassist.run.errors import Verdict
from hdassist.run.files import visible
from tests.test_hidden import EVERY_HIDDEN, hidden

HOSTILE = st.text(st.sampled_from(EVERY_HIDDEN + "=+-@\t\n,;\"' a1.") | st.characters(), max_size=8)


def cells(text: str) -> list[list[str]]:
    return list(csv.reader(io.StringIO(text, newline="")))


@given(st.lists(HOSTILE, min_size=1, max_size=4))
def test_text_can_neither_steer_nor_compute(texts: list[str]) -> None:
    made = csv_text(texts, [texts])
    assert not hidden(made)
    for told in cells(made):
        for cell, text in zip(told, texts, strict=True):
            assert cell.removeprefix("'") == visible(text).removeprefix("'")
            assert not cell.startswith(FORMULA) or float(cell) is not None


@given(st.floats(allow_nan=False), st.integers())
def test_numbers_come_back_as_they_were(number: float, whole: int) -> None:
    values = [number, whole, np.float64(number), str(whole)]
    (told,) = cells(csv_text([], [values]))[1:]
    assert [float(cell) for cell in told[:1] + told[2:3]] == [number, number]
    assert [int(told[1]), int(told[3])] == [whole, whole]


@pytest.mark.parametrize("text", ["=1+1", "+cmd", "-a", "@x", "\tx", "-1+2", "+", "＝1"])
def test_formulas_are_guarded(text: str) -> None:
    assert cells(csv_text([text], []))[0] == [f"'{text}"]


@given(HOSTILE)
def test_json_is_exact_and_printable(text: str) -> None:
    made = json_text({"name": text})
    assert json.loads(made) == {"name": text}
    assert made.isascii() and not hidden(made)


@dataclass(frozen=True)
class Inner:
    values: np.ndarray
    verdict: Verdict


@dataclass(frozen=True)
class Outer:
    inner: Inner | None
    bounds: tuple[float, float]
    by_name: dict[str, np.float64]


def test_a_result_is_json_by_its_fields():
    found = Outer(Inner(np.array([[1.0, 2.0]]), Verdict.PASS), (-1.0, 3.0), {"a": np.float64(0.5)})
    told = as_json({"found": found, "count": np.int64(2), "many": [found.inner]})
    inner = {"values": [[1.0, 2.0]], "verdict": "PASS"}
    assert told == {
        "found": {"inner": inner, "bounds": [-1.0, 3.0], "by_name": {"a": 0.5}}, "count": 2, "many": [inner],
    }  # fmt: skip
    assert json.loads(json_text(told)) == told
    for no_answer in (math.nan, math.inf, -math.inf):
        with pytest.raises(ValueError, match="JSON"):
            json_text(as_json({"value": no_answer}))


def test_a_quantity_is_the_attribute_that_it_names():
    there, not_there = Outer(Inner(np.zeros(1), Verdict.FAIL), (0.0, 1.0), {}), Outer(None, (0.0, 1.0), {})
    quantity: Quantity[Outer] = Quantity("kept", "verdict", "", "", "inner.verdict")
    assert [quantity.of(each) for each in (there, not_there)] == [Verdict.FAIL, None]
    assert [quantity.text(each) for each in (there, not_there)] == ["FAIL", "-"]
    assert Quantity[Outer]("bounds", "", "", "").of(there) == (0.0, 1.0)
    with pytest.raises(AttributeError):
        Quantity[Outer]("inner.verdct", "", "", "").of(there)
