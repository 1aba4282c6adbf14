"""What the strict YAML reader promises: values, places, and every trap refused with its place."""

from __future__ import annotations

import math

import pytest

from hdassist.drive.preset.text import MAX_DEPTH, MOST_PRESET_BYTES, Mark, read_yaml, scalar_value, shown


def findings(text: bytes | str) -> list[str]:
    return [str(finding) for finding in read_yaml(text, "a.yaml").findings]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("1.e3", 1000.0),
        (".5", 0.5),
        ("+3", 3),
        ("-2.5E+2", -250.0),
        ("010", 10),
        ("null", None),
        ("~", None),
        ("", None),
        ("true", True),
        ("false", False),
    ],
)
def test_plain_scalars_are_read_as_yaml_1_2(text: str, value: object) -> None:
    assert scalar_value(text) == value
    assert type(scalar_value(text)) is type(value)


@pytest.mark.parametrize(
    "text",
    ["12:30", "1_000", "no", "on", "off", "yes", "y", "True", "NULL", ".inf", ".nan", "nan", "0x10", "0o7",
     "1e",
     "e3", "1.2.3", "2020-01-01", "<<", "=", "\u0663"],
)  # fmt: skip
def test_what_looks_like_a_value_elsewhere_stays_text(text: str) -> None:
    assert scalar_value(text) == text
    assert read_yaml(f"a: {text}", "f").data == {"a": text}


def test_quoted_scalars_stay_text() -> None:
    assert read_yaml("a: '1'\nb: \"true\"\nc: |\n  2\n", "f").data == {"a": "1", "b": "true", "c": "2\n"}


def test_numbers_beyond_floats_become_infinite_and_do_not_stall() -> None:
    assert scalar_value("1e999") == math.inf
    assert scalar_value("9" * 100_000) == math.inf


def test_places_count_from_one_and_name_key_and_value() -> None:
    document = read_yaml("# head\ngears:\n  z_g: 200\nM: [80, '800']\n", "f")
    assert document.places["gears", "z_g"].key == Mark(3, 3)
    assert document.places["gears", "z_g"].value == Mark(3, 8)
    assert document.places["M", 1].value == Mark(4, 9)
    assert document.places["M", 1].quoted and not document.places["M", 0].quoted
    assert document.places["gears", "z_g"].text == "200"


@pytest.mark.parametrize("text", ["\ufeffa: 1\r\nb: 2\r\n", b"\xef\xbb\xbfa: 1\r\nb: 2\r\n"])
def test_byte_order_mark_and_crlf_are_fine(text: bytes | str) -> None:
    document = read_yaml(text, "f")
    assert document.data == {"a": 1, "b": 2}
    assert document.findings == []
    assert document.places["b",].value == Mark(2, 4)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\nb: 2\na: 3\n", "a.yaml:3:1: a: duplicate key (it is given first in line 1, column 1)"),
        ("g: {m: 1, 'm': 2}", "a.yaml:1:11: g.m: duplicate key (it is given first in line 1, column 5)"),
        ("a: &x 1", "a.yaml:1:4: a: YAML anchors are not allowed (got &x; leave the anchor out)"),
        ("a: !!float 3", "a.yaml:1:4: a: YAML tags are not allowed (got !!float; leave the tag out)"),
        ("a: !x 3", "a.yaml:1:4: a: YAML tags are not allowed (got !x; leave the tag out)"),
        ("? [a]\n: 1", "a.yaml:1:3: a key must be a single word (a text or a number)"),
        ('a: "\\uD800"', "a.yaml:1:4: a: half of a surrogate pair is not a character (got \\ud800)"),
        ("a: 1\n---\nb: 2", "a.yaml:2:1: a second document (write one document per preset)"),
        ("a: 1\n\tb: 2", "a.yaml:2:1: not valid YAML: a tab (indent with spaces)"),
        ("a: b: c", "a.yaml:1:5: not valid YAML: a ':' in a place where it is not allowed "
         "(wrong indentation, or a text that needs quotes)"),
        ("a: [1,\nb: 2", "a.yaml:2:5: not valid YAML: a bracket is not closed, or a comma is missing "
         "(opened in line 1, column 4)"),
        ("a: 'b\n", "a.yaml:2:1: not valid YAML: quotes are not closed (opened in line 1, column 4)"),
        ("a: 1\n b: 2", "a.yaml:2:3: not valid YAML: a ':' in a place where it is not allowed "
         "(wrong indentation, or a text that needs quotes)"),
        ("a: @x", "a.yaml:1:4: not valid YAML: a character with which unquoted text cannot start "
         "(put the text in quotes)"),
        ('a: "\\q"', "a.yaml:1:6: not valid YAML: a bad escape in a quoted text "
         "(use single quotes for a literal \\)"),
        ("a: \x07", "a.yaml:1:4: a control character, which YAML does not allow (got \\x07)"),
        (b"a: 1\nb: \xfc\n", "a.yaml:2:4: not UTF-8 text (got byte 0xfc; save the file as UTF-8)"),
        ("a: 1".encode("utf-16"), "a.yaml:1:1: not UTF-8 text (got byte 0xff; save the file as UTF-8)"),
    ],
)  # fmt: skip
def test_traps_are_refused_with_their_place(text: bytes | str, message: str) -> None:
    assert findings(text) == [message]


def test_an_alias_bomb_is_refused_and_not_expanded() -> None:
    bomb = "a: &a [x, x]\n" + "".join(f"{b}: &{b} [*{a}, *{a}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True))
    document = read_yaml(bomb, "f")
    assert [f.message for f in document.findings].count("YAML aliases are not allowed") == 16
    assert document.data["i"] == [None, None]
    assert {("i", 0), ("i", 1)} <= document.bad


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "? "])
def test_deep_nesting_is_refused(opening: str) -> None:
    document = read_yaml(opening * 60_000, "f")
    assert document.data is None
    assert document.bad == {()}
    assert [f.message for f in document.findings] == [f"nested deeper than {MAX_DEPTH} levels"]


def test_nesting_up_to_the_limit_is_read() -> None:
    inside = MAX_DEPTH - 1
    assert read_yaml("[" * inside + "1" + "]" * inside, "f").findings == []


def test_oversized_preset_is_refused_and_one_at_the_limit_accepted() -> None:
    assert findings("#" * (MOST_PRESET_BYTES + 1)) == [
        "a.yaml:1:1: the file is larger than 256 KiB (check that the file is a preset)"
    ]
    assert findings("#" * MOST_PRESET_BYTES) == []


def test_all_findings_are_collected_and_the_rest_is_still_read() -> None:
    document = read_yaml("a: &x 1\nb: *x\na: 2\n? [d]\n: 4\nc: 3\n", "f")
    assert [(f.line, f.path) for f in document.findings] == [(1, "a"), (2, "b"), (3, "a"), (4, "")]
    assert document.data == {"a": 2, "b": None, "c": 3}
    assert document.bad == {("b",)}


@pytest.mark.parametrize("text", ['a: "\\U99999999"', 'a: "\\UFFFFFFFF"'])
def test_escapes_beyond_unicode_are_a_finding(text: str) -> None:
    assert len(findings(text)) == 1


def test_messages_stay_on_one_line_and_show_no_control_codes() -> None:
    assert shown("a\x1b[2Jb\n\u202ec") == "a\\x1b[2Jb\\n\\u202ec"
    assert len(shown("x" * 1000)) == 60
