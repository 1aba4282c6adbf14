"""Numbers of the teeth in a table: each tooth of the wheel once, counted from 0 or 1, in any order."""

from __future__ import annotations

from collections.abc import Iterable

from hdassist.readers.table import NumberTable

SHOWN = 5


def rows_by_tooth(table: NumberTable, column: int, teeth: int) -> tuple[int, list[int]]:
    """Rows in the order of the tooth numbers; what is wrong with these is added to the findings of the table.

    Arguments: table; column, where the numbers stand; teeth of the wheel.
    Result: the first tooth number, 0 or 1, and the index of the row of each tooth, from the first on.
    """
    path = table.name(column)
    found: dict[int, int] = {}
    broken = [row for row in table.rows if not row.numbers[column].is_integer()]
    few_broken = 2 * len(broken) <= len(table.rows)
    for row in broken if few_broken else broken[:1]:
        message = "must be the whole number of a tooth" if few_broken else "no column of tooth numbers"
        hint = "the first column has the tooth numbers, unless a line of names says otherwise"
        table.add(row.line, row.columns[column], path, message, f"{row.numbers[column]:g}", hint)
    for index, row in enumerate(table.rows):
        number = row.numbers[column]
        if number.is_integer() and found.setdefault(int(number), index) != index:
            hint = f"first in line {table.rows[found[int(number)]].line}; keep one row"
            table.add(row.line, row.columns[column], path, "a tooth for the second time", f"{number:g}", hint)
    start = 0 if 0 in found else 1
    wanted = range(start, start + teeth)
    if few_broken:
        _check_all(table, column, found, wanted)
    return start, [found.get(number, 0) for number in wanted]


def _check_all(table: NumberTable, column: int, found: dict[int, int], wanted: range) -> None:
    """Note which teeth of the wheel have no row, and which rows are of none of its teeth."""
    beyond, missing = sorted(found.keys() - set(wanted)), sorted(set(wanted) - found.keys())
    if not beyond and not missing:
        return
    row = table.rows[found[beyond[0]] if beyond else 0]
    place = row.line, row.columns[column], table.name(column)
    if sorted(found) == list(range(wanted[0], wanted[0] + len(found))):
        last_again = len(beyond) == 1
        hint = "leave out the first tooth, measured again" if last_again else "is it the file of the other wheel?"
        got = f"tooth {few(beyond)} too" if beyond else f"no row for tooth {few(missing)}"
        table.add(*place, f"the wheel has {len(wanted)} teeth, the file {len(found)}", got, hint)
        return
    if beyond:
        hint = "count the teeth from 0 or from 1 on"
        table.add(*place, f"tooth numbers beyond {wanted[0]} to {wanted[-1]}", few(beyond), hint)
    if missing:
        row = table.rows[0]
        message, got = f"no row for tooth {few(missing)}", f"{len(table.rows)} rows"
        table.add(row.line, row.columns[column], table.name(column), message, got, f"{len(wanted)} are needed")


def few(numbers: Iterable[int]) -> str:
    """Numbers for a message, the first ones of many: 3, 4, 5, 6, 7 ... (12 in all)."""
    listed = list(numbers)
    text = ", ".join(map(str, listed[:SHOWN]))
    return text if len(listed) <= SHOWN else f"{text} ... ({len(listed)} in all)"
