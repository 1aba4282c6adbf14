"""Changes to inputs that keep most of their structure, so that what is wrong is met deep inside a reader.

All of it is drawn from the generator that is given: the same seed, the same input.
"""

from __future__ import annotations

import codecs
import hashlib
import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import yaml

Rng = np.random.Generator

NUMBERS = (
    "0", "-0", "-1", "1", "7", "1e308", "-1e308", "1e309", "1e-320", "nan", "inf", "-inf", ".nan", ".inf", "1" * 400,
    "1e" + "9" * 50, "0x10", "1_000", "12:30", "1,5", "1.5.2", "1 000", "٣", "１", "½", "--1", "5%", "1±2", "1±nan",
    "±", "1 +- 1e309", "75 um", "1.2 m", "260±10 deg", "3 arcsec", "1e-5 mm/N", "1e9 GPa", "1 kN*m", "-0.0", "1e3",
    "9" * 19,
)  # fmt: skip
WORDS = (
    "", " ", "-", "~", "null", "true", "no", "none", "unknown", "all", "fit", "*a", "&a x", "!!int", "!!python/name:os",
    "<<", "# x", "=1+1", "@x", "\x1b[31m", "\u202e", "\0", "\t", "\r", "'", '"', "`", "{", "}", "[", "]", "[[[[", ":",
    "a:b", "a: b: c", "? x", "| x", "> x", "%x", "---", "...", "x" * 300, "x" * 5000, "é", "日本", "😀", "\u2028",
    "../..",
    ".", "/", "/dev/zero", "/dev/null", "C:\\x", "%s%n", "{0}", "$(ls)", "{{x}}", "<b>", "]]>", "F_ior@1", "order_2",
    "lost_motion", "gears.z_g", "gears", "schema", "name", "run.csv", "drive.yaml", "lot.csv", "__class__", "\\N{x}",
    "\\ud800",
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2, 10**30, 10**400, -(10**400), 1e308, 5e-324, float("nan"), float("inf"), [], {},
    [[]],
    [{}], {"a": 1}, {"": None}, [1, 2, 3], [None], ["x"] * 50, {"a": {"a": {"a": {}}}},
)  # fmt: skip
SEPARATORS = (";", ",", "\t", " ")
_TOKEN = re.compile(r"[^\W_]+|[-+.\d]+")


def pick(rng: Rng, choices: Any) -> Any:
    """One of some choices."""
    return choices[int(rng.integers(len(choices)))]


def word(rng: Rng) -> str:
    """A number or a word that somebody may have written where it cannot be meant."""
    return str(pick(rng, NUMBERS if rng.random() < 0.5 else WORDS))


def tree(value: Any, rng: Rng, times: int | None = None) -> Any:
    """Data with some of its values and keys changed, taken away, doubled or put elsewhere."""
    for _ in range(int(rng.geometric(0.6)) if times is None else times):
        value = _tree_once(value, rng)
    return value


def _tree_once(value: Any, rng: Rng) -> Any:
    inside = isinstance(value, dict | list) and len(value) > 0
    if not inside or rng.random() < 0.12:
        return _other(value, rng)
    keys = list(value) if isinstance(value, dict) else list(range(len(value)))
    key = pick(rng, keys)
    changed: Any = dict(value) if isinstance(value, dict) else list(value)
    what = rng.random()
    if what < 0.7:
        changed[key] = _tree_once(value[key], rng)
    elif what < 0.8:
        del changed[key]
    elif isinstance(changed, list):
        changed.insert(int(rng.integers(len(changed) + 1)), value[key] if what < 0.9 else _other(value[key], rng))
    elif what < 0.9:
        held = changed.pop(key)
        changed[pick(rng, (word(rng), str(key)[::-1], str(key)[:-1], str(key).upper(), pick(rng, keys)))] = held
    else:
        changed[word(rng)] = value[pick(rng, keys)]
    return changed


def _other(value: Any, rng: Rng) -> Any:
    what = rng.random()
    if isinstance(value, int | float) and not isinstance(value, bool) and what < 0.5:
        scaled = (
            -value,
            value + 1,
            value - 1,
            value // 2,
            value * 10,
            str(value),
            f"{value} um",
            f"{value}±1",
            [value],
        )
        return pick(rng, scaled) if abs(value) < 1e300 else 1.5
    if isinstance(value, str) and value and what < 0.4:
        return text(value, rng, 1)
    if what < 0.7:
        return word(rng)
    return pick(rng, VALUES) if what < 0.95 else {"a": value}


def text(given: str, rng: Rng, times: int | None = None) -> str:
    """A text with lines, words and characters changed, taken away, doubled or put elsewhere."""
    for _ in range(int(rng.geometric(0.6)) if times is None else times):
        given = pick(rng, TEXT)(given, rng)[:300_000]
    return given


def _on_lines(change: Callable[[list[str], int, Rng], None]) -> Callable[[str, Rng], str]:
    def run(given: str, rng: Rng) -> str:
        lines = given.split("\n")
        change(lines, int(rng.integers(len(lines))), rng)
        return "\n".join(lines)

    return run


def _insert(given: str, rng: Rng) -> str:
    at = int(rng.integers(len(given) + 1))
    return given[:at] + word(rng) + given[at:]


def _token(given: str, rng: Rng) -> str:
    found = list(_TOKEN.finditer(given))
    if not found:
        return _insert(given, rng)
    one = pick(rng, found)
    return given[: one.start()] + (word(rng) if rng.random() < 0.8 else pick(rng, found)[0]) + given[one.end() :]


def _cut(given: str, rng: Rng) -> str:
    a, b = sorted(rng.integers(len(given) + 1, size=2).tolist())
    return given[:a] if rng.random() < 0.3 else given[:a] + given[min(b, a + 40) :]


def _repeat(given: str, rng: Rng) -> str:
    a, b = sorted(rng.integers(len(given) + 1, size=2).tolist())
    return given[:a] + given[a : min(b, a + 60)] * int(rng.integers(2, 300)) + given[a:]


def _double(lines: list[str], at: int, rng: Rng) -> None:
    lines.insert(int(rng.integers(len(lines) + 1)), lines[at])


def _drop(lines: list[str], at: int, rng: Rng) -> None:
    del lines[at]


def _indent(lines: list[str], at: int, rng: Rng) -> None:
    lines[at] = pick(rng, (" ", "  ", "\t", "# ", "- ")) + lines[at]


def _written_in(lines: list[str], at: int, rng: Rng) -> None:
    lines.insert(at, word(rng))


def _ends(given: str, rng: Rng) -> str:
    return given.replace("\n", str(pick(rng, ("\r\n", "\r", "\n\n", "\x85", "\u2028"))))


TEXT: tuple[Callable[[str, Rng], str], ...] = (
    _insert, _token, _token, _token, _cut, _repeat, _on_lines(_double), _on_lines(_drop), _on_lines(_indent),
    _on_lines(_written_in), _ends,
)  # fmt: skip


def table(given: str, rng: Rng, times: int | None = None) -> str:
    """A table with cells, rows, columns, names or its separator changed."""
    for _ in range(int(rng.geometric(0.6)) if times is None else times):
        given = _table_once(given, rng)[:300_000]
    return given


def _table_once(given: str, rng: Rng) -> str:
    lines = given.split("\n")
    separator = max(SEPARATORS, key=lambda mark: (lines[len(lines) // 2].count(mark), -SEPARATORS.index(mark)))
    rows = [line.split(separator) for line in lines]
    at = int(rng.integers(len(rows))) if rng.random() < 0.6 else int(rng.integers(min(len(rows), 4)))
    column = int(rng.integers(len(rows[at])))
    what = rng.random()
    if what < 0.2:
        rows[at][column] = _other_number(rows[at][column], rng)
    elif what < 0.35:
        rows[at][column] = word(rng)
    elif what < 0.45:
        rows[at].insert(column, word(rng))
    elif what < 0.5:
        del rows[at][column]
    elif what < 0.58:
        rows = [row[:column] + row[column + 1 :] for row in rows]
    elif what < 0.66:
        rows = [[*row, *row[column : column + 1]] for row in rows]
    elif what < 0.74:
        separator = pick(rng, SEPARATORS)
    elif what < 0.8:
        rows[at][column] = f'"{rows[at][column]}' + ('"' if rng.random() < 0.6 else "")
    elif what < 0.85:
        rows = [[cell.replace(".", ",") for cell in row] for row in rows]
    elif what < 0.9:
        rows = rows[:1] + rows[: int(rng.integers(-len(rows), 0))]
    else:
        return text(given, rng, 1)
    return "\n".join(separator.join(row) for row in rows)


def _other_number(cell: str, rng: Rng) -> str:
    """Another number written as that in a cell is; a word where there is none."""
    try:
        value = float(cell.strip(' "').replace(",", "."))
    except ValueError:
        return word(rng)
    changed = pick(rng, (-value, value + 1e-3, value * 1.01, value * 10, value / 3, 0.0, value + 360, value // 1))
    return cell.replace(cell.strip(' "'), f"{changed:.6g}".replace(".", "," if "," in cell else "."))


def data(given: bytes, rng: Rng) -> bytes:
    """Bytes as they are mostly, or with some changed, cut off, or in another encoding."""
    what = rng.random()
    if what < 0.9 or not given:
        return given
    at = int(rng.integers(len(given)))
    if what < 0.93:
        return given[:at] + bytes([int(rng.integers(256))]) + given[at + (rng.random() < 0.5) :]
    if what < 0.95:
        return given[:at]
    if what < 0.96:
        return codecs.BOM_UTF8 + given
    if what < 0.975:
        return given.decode("utf-8", "replace").encode(pick(rng, ("utf-16", "utf-16-be", "utf-32")))
    if what < 0.99:
        return given.decode("utf-8", "replace").encode("latin-1", "replace") + b"\xe9\n"
    return pick(rng, (b"\x1f\x8b", b"PK\x03\x04", b"\0", b"\xff\xfe", b"\n" * 999, b"")) + given[:at]


def yaml_text(given: str, rng: Rng) -> bytes:
    """A YAML text with its tree, its text or its bytes changed."""
    if rng.random() < 0.5:
        changed = tree(yaml.safe_load(given), rng)
        told = json.dumps(changed) if rng.random() < 0.7 else yaml.safe_dump(changed, allow_unicode=True, width=200)
    else:
        told = text(given, rng)
    return data(_encoded(told), rng)


def json_text(given: str, rng: Rng) -> bytes:
    """A text of JSON, one object or a line each, with a tree, the text or the bytes changed."""
    told = given
    if rng.random() < 0.75:
        lines = [given] if _is_json(given) else [line for line in given.split("\n") if line]
        at = int(rng.integers(len(lines)))
        lines[at] = json.dumps(tree(json.loads(lines[at]), rng))
        told = "\n".join(lines) + "\n"
    if rng.random() < 0.35:
        told = text(told, rng)
    return data(_encoded(told), rng)


def kept_text(given: str, rng: Rng) -> bytes:
    """Kept work with lines changed, taken away, doubled or put elsewhere, under numbers and checksums that hold."""
    lines = [json.loads(line) for line in given.splitlines()]
    for line in lines:
        del line["checksum"]
    at = int(rng.integers(len(lines)))
    if rng.random() < 0.7:
        lines[at] = tree(lines[at], rng)
    else:
        changed = "\n".join(map(json.dumps, lines))
        for _ in range(int(rng.integers(1, 4))):
            changed = pick(rng, (_on_lines(_double), _on_lines(_drop)))(changed, rng)
        lines = [json.loads(line) for line in changed.split("\n") if line]
    above, sealed = "", []
    for item, line in enumerate(lines, -1):
        numbered = line | {"item": item} if isinstance(line, dict) and "item" in line else line
        text = json.dumps(numbered, separators=(",", ":"))
        above = hashlib.sha256((above + text).encode()).hexdigest()[:16]
        sealed.append(f'{text[:-1]},"checksum":"{above}"}}\n')
    return data("".join(sealed).encode(), rng)


def table_text(given: str, rng: Rng) -> bytes:
    """A table with its cells, its text or its bytes changed."""
    return data(_encoded(table(given, rng)), rng)


def _is_json(given: str) -> bool:
    try:
        json.loads(given)
    except ValueError:
        return False
    return True


def _encoded(told: str) -> bytes:
    return told.encode("utf-8", "surrogatepass")
