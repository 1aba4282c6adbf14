"""Tables of numbers as instruments write them: every dialect that is read, and every fault with its place."""

from __future__ import annotations

import io
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdassist.errors import DataError, PresetError
from hdassist.readers.table import NumberTable, parse
from hdassist.textfile import STDIN, decode, read_bytes

NEEDS = ("tooth number", "deviation")
ROWS = [(1.0, 2.5), (2.0, -1.25)]


def read(text: str | bytes, at_most: int = 1000) -> NumberTable:
    return parse(text.encode() if isinstance(text, str) else text, "w.csv", NEEDS, at_most)


def rows(text: str | bytes) -> list[tuple[float, ...]]:
    table = read(text)
    assert not table.findings, table.findings
    return [row.numbers for row in table.rows]


def faults(text: str | bytes) -> list[str]:
    return [str(finding) for finding in read(text).findings]


@pytest.mark.parametrize(
    "text",
    [
        "1,2.5\n2,-1.25\n",
        "1, 2.5\n2, -1.25",
        "1;2.5\n2;-1.25",
        "1;2,5\n2;-1,25",
        "1\t2,5\n2\t-1,25",
        " 1   2.5\n 2  -1.25\n",
        "1 2,5\n2 -1,25",
        "1;2,5;\n2;-1,25;\n",
        "1,2.5,\n2,-1.25,\n",
        "1\t2.5\t\n2\t-1.25\t\n",
        "\t1\t2.5\n\t2\t-1.25\n",
        '"1";"2,5"\n"2";"-1,25"\n',
        '1,"2,5"\n2,"-1,25"\n',
        '"1" "2.5"\n"2" "-1.25"\n',
        "1;+2,5e0\n2;-,125E1\n",
        "\n1;2,5\n\n;;\n2;-1,25\n\n",
        "1;2,5\r\n2;-1,25\r\n",
        "1;2,5\r2;-1,25\r",
        "1;2,5\n2;-1,25\n\x1a",
    ],
)
def test_separators_decimal_marks_quotes_and_line_ends(text: str) -> None:
    assert rows(text) == ROWS


@pytest.mark.parametrize(
    "data",
    [
        BOM_UTF8 + "# µ\n1;2,5\n2;-1,25\n".encode(),
        BOM_UTF16_LE + "# µ\n1;2,5\n2;-1,25\n".encode("utf-16-le"),
        BOM_UTF16_BE + "# µ\r\n1;2,5\r\n2;-1,25\r\n".encode("utf-16-be"),
        "# gemessen von Müller, 20 °C\n1;2,5\n2;-1,25\n".encode("latin-1"),
    ],
)
def test_encodings(data: bytes) -> None:
    assert rows(data) == ROWS


def test_a_european_file() -> None:
    text = "# Prüfer: Müller\r\nZahn;Abweichung [µm]\r\n1;2,5\r\n2;-1,25\r\n"
    table = read(BOM_UTF8 + text.encode())
    assert not table.findings and not table.notes
    assert table.names == ("Zahn", "Abweichung [µm]")
    assert not table.names_in_comment
    assert [(row.line, row.numbers, row.columns) for row in table.rows] == [(3, ROWS[0], (1, 3)), (4, ROWS[1], (1, 3))]
    assert [(entry.key, entry.value) for entry in table.entries] == [("prüfer", "Müller")]


def test_latin_1_is_noted() -> None:
    table = read("Zahn;Abweichung [µm]\n1;2,5\n".encode("latin-1"))
    assert table.notes == ["not UTF-8: read as Latin-1"]
    assert table.names == ("Zahn", "Abweichung [µm]")


def test_names_in_another_code_page_are_refused() -> None:
    text = "# форма: шаг\nЗуб;отклонение\n1;2,5\n"
    assert faults(text) == []
    found = faults(text.encode("cp1251"))
    assert len(found) == 3
    assert found[0].startswith("w.csv:1:3: a name that is not UTF-8 text (got ")
    assert found[1].startswith("w.csv:2:1: ")
    assert all(fault.endswith("; save the file as UTF-8)") for fault in found)


def test_entries_stand_in_comments_of_every_kind() -> None:
    text = '# form: single\n// Unit = mm ;;\n%mark:17\n"# sense: cw";;\n"flank: left\n# note: a = b: c\n# http://x.org/a\n1;2\n'
    entries = read(text).entries
    assert [(entry.key, entry.value) for entry in entries] == [
        ("form", "single"), ("unit", "mm"), ("mark", "17"), ("sense", "cw"), ("flank", "left"), ("note", "a = b: c"),
    ]  # fmt: skip
    assert [tuple(entry.mark) for entry in entries] == [(1, 9), (2, 11), (3, 7), (4, 11), (5, 9), (6, 9)]


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("tooth;deviation [µm]\n1;2\n", ("tooth", "deviation [µm]")),
        ("tooth, dev (mm)\n1,2\n", ("tooth", "dev (mm)")),
        ("tooth, dev (mm)\n1 2\n", ("tooth", "dev (mm)")),
        ("tooth deviation [um]\n1 2\n", ("tooth", "deviation [um]")),
        ("tooth  single deviation\n1 2\n", ("tooth", "single deviation")),
        ("tooth deviation / um\n1 2\n", ("tooth", "deviation / um")),
        ('"tooth";"dev; of ""A"""\n"1";"2"\n', ("tooth", 'dev; of "A"')),
        ("tooth;deviation;\n1;2;\n", ("tooth", "deviation")),
        ("1;2\n", ()),
    ],
)
def test_a_line_of_names(text: str, names: tuple[str, ...]) -> None:
    table = read(text)
    assert not table.findings
    assert (table.names, table.names_in_comment) == (names, False)


def test_a_comment_may_hold_the_names() -> None:
    table = read("# wheel 17, made in March, third\n# tooth; f_pt [um]\n# unit: um\n1;2\n")
    assert (table.names, table.names_in_comment, table.names_line) == (("tooth", "f_pt [um]"), True, 2)
    assert read("# wheel\n1;2\n").names == ()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "w.csv:1:1: the file is empty (was the measurement saved?)"),
        (" \r\n\n", "w.csv:1:1: the file is empty (was the measurement saved?)"),
        ("1;2\nPK\0\n", "w.csv:2:1: a binary file (got a NUL character; save the table as text: CSV in UTF-8)"),
        ("# form: index\n", "w.csv:1:1: no rows of numbers in the file (rows of tooth number, deviation)"),
        ("# a\nDear sir,\nthanks\n",
         "w.csv:2:1: no rows of numbers in the file (got Dear sir,; rows of tooth number, deviation)"),
        ("#\n1\n2\n", "w.csv:2:1: 1 column, needs 2: tooth number, deviation "
         "(got 1; columns stand apart by ; or , or tabs or blanks)"),
        ("1;2\n2;x\n", "w.csv:2:3: column 2: must be a number (got x; put # in front of a line that is a remark)"),
        ("tooth;dev\n1;2\n2;x\n",
         "w.csv:3:3: dev: must be a number (got x; put # in front of a line that is a remark)"),
        ("1;2\n2;2,5um\n", "w.csv:2:3: column 2: must be a number "
         "(got 2,5um; a unit stands in the line of names, like deviation [um])"),
        ("1;2\n2;−5\n", "w.csv:2:3: column 2: must be a number (got −5; write an ASCII minus sign)"),
        ("1;2\n2;nan\n", "w.csv:2:3: column 2: must be a finite number "
         "(got nan; a gap in the measurement cannot be filled here)"),
        ("1;2\n2; -Inf\n", "w.csv:2:4: column 2: must be a finite number "
         "(got -Inf; a gap in the measurement cannot be filled here)"),
        ("1;2\n2;1e999\n", "w.csv:2:3: column 2: must be a finite number (got 1e999; is this cell right?)"),
        ("1;2;3\n2;;3\n", "w.csv:2:3: column 2: a number is missing "
         "(got nothing; a gap in the measurement cannot be filled here)"),
        ("1;2\n2\n3;4\n", "w.csv:2:1: a row of 1, most rows have 2 columns (got 2; one cell for each column)"),
        ("1;2\n2;3;4\n3;4\n", "w.csv:2:1: a row of 3, most rows have 2 columns (got 2 3 4; one cell for each column)"),
        ("1,2.5\n2,2,5\n3,1.5\n", "w.csv:2:1: a row of 3, most rows have 2 columns "
         "(got 2 2 5; a decimal comma? separate the columns by ;)"),
        ("1;1.234,5\n2;2,5\n", "w.csv:1:3: column 2: must be a number "
         "(got 1.234,5; nothing between thousands, and one decimal mark)"),
        ("1;1,234,567.5\n2;2.5\n", "w.csv:1:3: column 2: must be a number "
         "(got 1,234,567.5; nothing between thousands, and one decimal mark)"),
        ("1;2,5\n2;2.5\n3;1,5\n", "w.csv:2:3: column 2: a decimal point among decimal commas "
         "(got 2.5; write every number with a decimal comma)"),
        ("1 2.5\n2 2,5\n3 1.5\n", "w.csv:2:3: column 2: a decimal comma among decimal points "
         "(got 2,5; write every number with a decimal point)"),
        ("1,2,5\n2,3,5\n", "w.csv:1:1: commas between columns, or decimal commas? "
         "(got 1,2,5; separate the columns by ; or write a line of names above them)"),
        ("tooth;left;right\n1;2\n", "w.csv:1:1: the line of names does not fit 2 columns "
         "(got tooth;left;right; one name for each column, separated as the rows are)"),
        ("tooth;dev\n;um\n1;2\n", "w.csv:2:1: a line of text among the rows "
         "(got um; put # in front of it; only one line of names, above the rows)"),
        ("1;2\nend\n", "w.csv:2:1: a line of text among the rows "
         "(got end; put # in front of it; only one line of names, above the rows)"),
        (b"\xef\xbb\xbf1;2\n\xff", "w.csv:1:1: not UTF-8 text, which its first bytes say "
         "(got byte 0xff; save the file as UTF-8)"),
        (b"\xff\xfe1\0;", "w.csv:1:1: not UTF-16 text, which its first bytes say "
         "(got byte 0x3b; save the file as UTF-8)"),
        ("1;2\n" * 400, "w.csv:1:1: the file is larger than 1000 bytes (is this the file with the table?)"),
    ],
)  # fmt: skip
def test_each_fault_is_said_with_its_place(text: str | bytes, expected: str) -> None:
    assert faults(text) == [expected]


def test_all_faults_are_found_at_once() -> None:
    assert [(finding.line, finding.got) for finding in read("a;b\n1;x\n2;3;4\nend\n4;nan\n5;6\n").findings] == [
        (4, "end"), (3, "2 3 4"), (2, "x"), (5, "nan"),
    ]  # fmt: skip


def test_columns_of_whole_numbers_between_commas_are_read_with_their_names() -> None:
    assert rows("tooth,left,right\n1,2,5\n2,3,5\n") == [(1, 2, 5), (2, 3, 5)]
    assert rows("1,2,5.0\n2,3,5.0\n") == [(1, 2, 5), (2, 3, 5)]


def test_a_decimal_comma_before_three_digits_is_one() -> None:
    assert rows("1;1,234\n2;2,345\n") == [(1, 1.234), (2, 2.345)]


def test_a_very_long_line_is_refused_and_not_searched() -> None:
    data = b"1;2\n" + b'"1" ' * 5000
    assert [finding.message for finding in parse(data, "f", NEEDS).findings] == ["a line of 20000 characters"]
    assert [finding.message for finding in parse(b"1," * 9000, "f").findings] == ["a line of 18000 characters"]


def test_a_size_in_megabytes() -> None:
    with pytest.raises(PresetError, match="larger than 5 MB"):
        decode(b"1" * 5_000_001, "f", 5_000_000)


@given(
    st.binary(max_size=80)
    | st.text(max_size=80).map(str.encode)
    | st.text('1,;. \t\n"#:=x-', max_size=40).map(str.encode)
)
def test_whatever_the_bytes_are_there_are_rows_or_findings(data: bytes) -> None:
    table = parse(data, "f", NEEDS)
    assert bool(table.findings) or len({len(row.numbers) for row in table.rows}) == 1
    assert table.findings or len(table.rows[0].numbers) >= 2
    assert all(finding.line >= 1 and finding.column >= 1 for finding in table.findings)


def test_files_and_standard_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "wheel.csv"
    file.write_bytes(b"1;2\n")
    assert read_bytes(file, 3) == (b"1;2", str(file))
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"1;2\n")))
    assert read_bytes("-", 100) == (b"1;2\n", STDIN)
    monkeypatch.setattr("sys.stdin", None)
    with pytest.raises(DataError, match="standard input: it is closed"):
        read_bytes("-", 100)


def test_what_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "wheel.csv").write_text("")
    cases: list[tuple[str | Path, str, str]] = [
        (tmp_path / "wheel.cvs", "no such file: ", f"did you mean {tmp_path / 'wheel.csv'}?"),
        (tmp_path / "qqqqqq", "no such file: ", "is the path right?"),
        (tmp_path / "a/b.csv", "no such file: ", f"there is no directory {tmp_path / 'a'} either"),
        (tmp_path, "is a directory, not a file", "name the file in it"),
        ("a\0b", "cannot read a\0b: embedded null byte", ""),
        (tmp_path / "wheel.csv/x", "cannot read ", ""),
        ("", "no such file: an empty name", ""),
    ]
    for path, message, hint in cases:
        with pytest.raises(DataError) as caught:
            read_bytes(path, 100)
        assert caught.value.exit_code == 4
        assert message in caught.value.message
        assert hint in caught.value.hint


def test_a_file_that_may_not_be_read(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(DataError, match=r"cannot read wheel\.csv: Permission denied"):
        read_bytes("wheel.csv", 100)
