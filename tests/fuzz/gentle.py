"""Changes after which an input can still be meant: another unit, order, begin, separator, value or number of rows.

The changes of `tests.fuzz.mutate` mostly end in a refusal; these mostly reach a result. All of it is drawn from the
generator that is given: the same seed, the same input.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import yaml

from tests.fuzz.mutate import Rng, pick

Rows = list[list[str]]
UNITS = (
    "arcsec",
    "″",
    '["]',
    "[']",
    "[arcmin]",
    "_deg",
    "_mrad",
    "[µrad]",
    "_gon",
    "[Winkelminuten]",
    "_um",
    "[V]",
    "",
)
COLUMNS = ("T_C", "T [°C]", "time_s", "torque_Nm", "note", "sweep", "Drehmoment [Nm]", "speed", "temperature")
SEPARATORS = (",", ";", "\t")
SERIALS = ("#1", "%2", "//3", " 4", "5.0", "=6", "ä7", '8"', "A1", "")
MOST_ROWS = 2000


def table_text(given: str, rng: Rng) -> bytes:
    """Return a table after one to four changes that keep it a table."""
    comments = [line for line in given.split("\n") if line.startswith("#")]
    lines = [line for line in given.split("\n") if line and not line.startswith("#")]
    separator = max(("\t", ";", ","), key=lines[0].count)
    if lines[0].count(separator) == 0:
        separator = " "
    rows = [line.split(separator) for line in lines]
    for _ in range(int(rng.integers(1, 5))):
        rows = pick(rng, _CHANGES)(rows, rng)
    ending = pick(rng, ("\n", "\n", "\r\n"))
    if separator != " " and rng.random() < 0.2:
        separator = pick(rng, SEPARATORS)
    text = ending.join([*comments, *(separator.join(row) for row in rows)]) + ending
    return text.encode(pick(rng, ("utf-8", "utf-8", "utf-8", "utf-8-sig", "utf-16")))


def _numbers(rows: Rows, column: int) -> Any:
    """Return the numbers of a column below its name, nan for a cell without one."""
    numbers = np.full(len(rows), np.nan)
    for place, row in enumerate(rows):
        if column < len(row):
            cell = row[column].strip(' "').replace(",", ".")
            if re.fullmatch(r"[-+]?[\d.]+(e[-+]?\d+)?", cell) and cell.count(".") <= 1 and re.search(r"\d", cell):
                numbers[place] = float(cell)
    return numbers


def _with_numbers(rows: Rows, column: int, numbers: Any) -> Rows:
    """Return the rows with the numbers of a column replaced where there is one."""
    changed = [[*row] for row in rows]
    for row, number in zip(changed, numbers, strict=True):
        if np.isfinite(number) and column < len(row):
            has_comma = "," in row[column] and "." not in row[column]
            text = f"{number:.10g}"
            row[column] = text.replace(".", ",") if has_comma else text
    return changed


def _column(rows: Rows, rng: Rng) -> int:
    return int(rng.integers(len(rows[0])))


def _scaled(rows: Rows, rng: Rng) -> Rows:
    column = _column(rows, rng)
    factor = float(pick(rng, (-1, 1.01, 2, 60, 1 / 60, 3600, 1 / 3600, 1e3, 1e-3, 0)))
    return _with_numbers(rows, column, factor * _numbers(rows, column))


def _shifted(rows: Rows, rng: Rng) -> Rows:
    column = _column(rows, rng)
    shift = float(pick(rng, (0.5, -3, 90, 180, 360, -360, 7200, 1e5)))
    return _with_numbers(rows, column, _numbers(rows, column) + shift)


def _wrapped(rows: Rows, rng: Rng) -> Rows:
    column = _column(rows, rng)
    return _with_numbers(rows, column, _numbers(rows, column) % float(pick(rng, (360, 24, 400, 4096))))


def _noisy(rows: Rows, rng: Rng) -> Rows:
    column = _column(rows, rng)
    noise = rng.normal(0, float(pick(rng, (1e-4, 0.1, 1, 10))), len(rows))
    return _with_numbers(rows, column, _numbers(rows, column) + noise)


def _rounded(rows: Rows, rng: Rng) -> Rows:
    column = _column(rows, rng)
    return _with_numbers(rows, column, np.round(_numbers(rows, column), int(rng.integers(0, 4))))


def _spiked(rows: Rows, rng: Rng) -> Rows:
    column = _column(rows, rng)
    numbers = _numbers(rows, column)
    numbers[int(rng.integers(len(rows)))] = float(pick(rng, (0, 1e3, -1e6, 9999)))
    return _with_numbers(rows, column, numbers)


def _fewer(rows: Rows, rng: Rng) -> Rows:
    kept = rng.random(len(rows) - 1) < float(pick(rng, (0.97, 0.8, 0.5, 0.2, 0.03)))
    return [rows[0], *(row for row, is_kept in zip(rows[1:], kept, strict=True) if is_kept)]


def _part(rows: Rows, rng: Rng) -> Rows:
    first, last = sorted(rng.integers(1, len(rows) + 1, size=2).tolist())
    return [rows[0], *rows[first:last]]


def _turned(rows: Rows, rng: Rng) -> Rows:
    begin = int(rng.integers(1, len(rows) + 1))
    return [rows[0], *rows[begin:], *rows[1:begin]]


def _reversed(rows: Rows, rng: Rng) -> Rows:
    return [rows[0], *rows[:0:-1]]


def _shuffled(rows: Rows, rng: Rng) -> Rows:
    return [rows[0], *(rows[1:][k] for k in rng.permutation(len(rows) - 1))]


def _to_and_fro(rows: Rows, rng: Rng) -> Rows:
    return [*rows, *rows[:0:-1]][:MOST_ROWS]


def _twice(rows: Rows, rng: Rng) -> Rows:
    return [*rows, *rows[1:]][:MOST_ROWS]


def _swapped(rows: Rows, rng: Rng) -> Rows:
    first, second = _column(rows, rng), _column(rows, rng)
    changed = [[*row] for row in rows]
    for row in changed:
        if max(first, second) < len(row):
            row[first], row[second] = row[second], row[first]
    return changed


def _renamed(rows: Rows, rng: Rng) -> Rows:
    column = _column(rows, rng)
    head = [*rows[0]]
    stem = re.split(r"[_ \[(]", head[column])[0] or "error"
    head[column] = f"{stem}{pick(rng, (' ', '_', ''))}{pick(rng, UNITS)}"
    return [head, *rows[1:]]


def _with_a_column(rows: Rows, rng: Rng) -> Rows:
    start, step = float(pick(rng, (0, 20, 3.4))), float(pick(rng, (0, 0.1, 1)))
    cells = [pick(rng, COLUMNS), *(f"{start + step * place:g}" for place in range(len(rows) - 1))]
    return [[*row, cell] for row, cell in zip(rows, cells, strict=True)]


def _emptied(rows: Rows, rng: Rng) -> Rows:
    changed = [[*row] for row in rows]
    row = changed[int(rng.integers(1, len(rows)))] if len(rows) > 1 else changed[0]
    row[int(rng.integers(len(row)))] = ""
    return changed


_CHANGES: tuple[Callable[[Rows, Rng], Rows], ...] = (
    _scaled, _scaled, _shifted, _wrapped, _noisy, _noisy, _rounded, _spiked, _fewer, _fewer, _part, _turned, _reversed,
    _shuffled, _to_and_fro, _twice, _swapped, _renamed, _renamed, _with_a_column, _emptied,
)  # fmt: skip


def lot_text(given: str, rng: Rng) -> bytes:
    """Return a lot with other serials, limits, values, orders of rows and columns."""
    lines = [line for line in given.split("\n") if line]
    separator = max(("\t", ";", ","), key=lines[-1].count)
    rows = [line.split(separator) for line in lines]
    for _ in range(int(rng.integers(1, 4))):
        chosen = pick(rng, ("serial", "number", "row", "column", "rows"))
        place = int(rng.integers(1, len(rows)))
        if chosen == "serial":
            rows[place][0] = pick(rng, SERIALS)
        elif chosen == "number":
            column = int(rng.integers(len(rows[place])))
            changed = re.sub(r"\d+", lambda found: str(int(rng.integers(0, 200))), rows[place][column])
            rows[place][column] = changed if changed != rows[place][column] else f"{rng.uniform(0, 90):.3g}"
        elif chosen == "row":
            rows.append([pick(rng, ("C1", "C2", "C3")), *rows[place][1:]])
        elif chosen == "rows":
            rows = [rows[0], *(rows[1:][k] for k in rng.permutation(len(rows) - 1))]
        else:
            order = rng.permutation(len(rows[0])).tolist()
            rows = [[row[k] if k < len(row) else "" for k in order] for row in rows]
    text = "\n".join(separator.join(row) for row in rows) + "\n"
    return text.encode(pick(rng, ("utf-8", "utf-8", "utf-8-sig")))


def yaml_text(given: str, rng: Rng) -> bytes:
    """Return a YAML text with some of its numbers moved by some per cent, and its keys in another order."""
    data = yaml.safe_load(given)

    def moved(value: Any) -> Any:
        if isinstance(value, dict):
            keys = list(value)
            if rng.random() < 0.2:
                keys = [keys[k] for k in rng.permutation(len(keys))]
            return {key: moved(value[key]) for key in keys}
        if isinstance(value, list):
            return [moved(entry) for entry in value]
        if isinstance(value, float) and rng.random() < 0.1:
            return float(f"{value * rng.uniform(0.9, 1.1):.6g}")
        return value

    return yaml.safe_dump(moved(data), allow_unicode=True, sort_keys=False, width=200).encode()


def lines_text(given: str, rng: Rng) -> bytes:
    """Return kept lines or an answer as they are, or cut at the end of a line, as a run that was ended leaves them."""
    lines = given.splitlines(keepends=True)
    chosen = pick(rng, ("as it is", "cut", "torn", "compact"))
    if chosen == "cut":
        lines = lines[: int(rng.integers(1, len(lines) + 1))]
    elif chosen == "torn" and len(lines) > 1:
        lines[-1] = lines[-1][: int(rng.integers(1, len(lines[-1])))]
    elif chosen == "compact" and len(lines) > 1:
        return given.encode() if "checksum" in given else json.dumps(json.loads(given)).encode()
    return "".join(lines).encode()
