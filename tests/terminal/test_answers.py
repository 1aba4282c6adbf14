"""CSV that a spreadsheet reads as what it says, and computes nothing of."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdassist.terminal.answers import FORMULA, csv_text, json_text
from hdassist.visible import visible
from tests.test_visible import EVERY_HIDDEN, hidden

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
