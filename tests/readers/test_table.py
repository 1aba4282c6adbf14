"""Tables of numbers as instruments write them: every dialect that is read, and every fault with its place."""

from __future__ import annotations

import hashlib
import io
import os
import tracemalloc
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdassist.readers.table import MAX_REMARKS, SAMPLED_LINES, NumberTable, read_numbers, read_texts
from hdassist.run.errors import DataError, PresetError
from hdassist.run.files import PART, STDIN, TextFile, read_bytes

NEEDS = ("tooth number", "deviation")
ROWS = [(1.0, 2.5), (2.0, -1.25)]


def read(text: str | bytes, at_most: int = 1000) -> NumberTable:
    stream = io.BytesIO(text.encode() if isinstance(text, str) else text)
    stream.name = "w.csv"  # type: ignore[attr-defined]
    return read_numbers(stream, NEEDS, at_most)


def rows(text: str | bytes) -> list[tuple[float, ...]]:
    table = read(text)
    assert not table.findings, table.findings
    return [tuple(row) for row in table.values.tolist()]


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
    assert not table.names_in_remark
    assert rows(BOM_UTF8 + text.encode()) == ROWS
    assert table.lines.tolist() == [3, 4]
    assert [remark.entry for remark in table.remarks] == [("prüfer", "Müller", 11)]


def test_latin_1_is_noted() -> None:
    table = read("Zahn;Abweichung [µm]\n1;2,5\n".encode("latin-1"))
    assert table.notes == ["not UTF-8: read as Latin-1"]
    assert table.names == ("Zahn", "Abweichung [µm]")


def test_entries_stand_in_remarks_of_every_kind() -> None:
    text = '# form: single\n// Unit = mm ;;\n%mark:17\n"# sense: cw";;\n# note: a = b: c\n# http://x.org/a\n1;2\n'
    remarks = read(text + "# end: 1\n").remarks
    assert [(remark.number, remark.entry) for remark in remarks] == [
        (1, ("form", "single", 9)), (2, ("unit", "mm", 11)), (3, ("mark", "17", 7)), (4, ("sense", "cw", 11)),
        (5, ("note", "a = b: c", 9)), (6, None), (8, ("end", "1", 8)),
    ]  # fmt: skip


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
    assert (table.names, table.names_in_remark) == (names, False)


def test_a_remark_may_hold_the_names() -> None:
    table = read("# wheel 17, made in March, third\n# tooth; f_pt [um]\n# unit: um\n1;2\n")
    assert (table.names, table.names_in_remark, table.names_line) == (("tooth", "f_pt [um]"), True, 2)
    assert read("# wheel\n1;2\n").names == ()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "w.csv:1:1: the file is empty (check that the measurement was saved)"),
        (" \r\n\n", "w.csv:1:1: the file is empty (check that the measurement was saved)"),
        ("1;2\nPK\0\n", "w.csv:2:1: the file is binary (got a NUL character; save the table as text: CSV in UTF-8)"),
        ("# form: index\n", "w.csv:1:1: the file contains no rows of numbers (write rows of tooth number, deviation)"),
        ("# a\nDear sir,\nthanks\n",
         "w.csv:2:1: the file contains no rows of numbers (got Dear sir,; write rows of tooth number, deviation)"),
        ("#\n1\n2\n", "w.csv:2:1: the rows have 1 column, but 2 are needed: tooth number, deviation "
         "(got 1; separate the columns by ; or , or tabs or blanks)"),
        ("1;2\n2;x\n", "w.csv:2:3: column 2: must be a number (got x; put # in front of a comment line)"),
        ("tooth;dev\n1;2\n2;x\n",
         "w.csv:3:3: dev: must be a number (got x; put # in front of a comment line)"),
        ("1;2\n2;2,5um\n", "w.csv:2:3: column 2: must be a number "
         "(got 2,5um; write the unit in the line of names, for example deviation [um])"),
        ("1;2\n2;−5\n", "w.csv:2:3: column 2: must be a number (got −5; write an ASCII minus sign)"),
        ("1;2\n2;nan\n", "w.csv:2:3: column 2: must be a finite number "
         "(got nan; fill in the number, or leave out the row)"),
        ("1;2\n2; -Inf\n", "w.csv:2:4: column 2: must be a finite number "
         "(got -Inf; fill in the number, or leave out the row)"),
        ("1;2\n2;-1e31\n", "w.csv:2:3: column 2: must be a number up to 1e+30 (got -1e31; check this cell)"),
        ("1;2\n2;1e999\n", "w.csv:2:3: column 2: must be a finite number (got 1e999; check this cell)"),
        ("1;2;3\n2;;3\n", "w.csv:2:3: column 2: a number is missing "
         "(got nothing; fill in the number, or leave out the row)"),
        ("1;2\n2\n3;4\n", "w.csv:2:1: columns in this row: 1; in most rows: 2 "
         "(got 2; a cell is missing, or the file is cut off here)"),
        ("1;2\n2;3;4\n3;4\n", "w.csv:2:1: columns in this row: 3; in most rows: 2 "
         "(got 2 3 4; write one cell for each column)"),
        ("1,2.5\n2,2,5\n3,1.5\n", "w.csv:2:1: columns in this row: 3; in most rows: 2 "
         "(got 2 2 5; with decimal commas separate the columns by ;)"),
        ("1,2.5\n2,2.5\n3", "w.csv:3:1: columns in this row: 1; in most rows: 2 "
         "(got 3; a cell is missing, or the file is cut off here)"),
        ("1;1.234,5\n2;2,5\n", "w.csv:1:3: column 2: must be a number "
         "(got 1.234,5; write one decimal mark, and no separator between thousands)"),
        ("1;1,234,567.5\n2;2.5\n", "w.csv:1:3: column 2: must be a number "
         "(got 1,234,567.5; write one decimal mark, and no separator between thousands)"),
        ("1;2,5\n2;2.5\n3;1,5\n", "w.csv:2:3: column 2: a decimal point among decimal commas "
         "(got 2.5; write every number with a decimal comma)"),
        ("1 2.5\n2 2,5\n3 1.5\n", "w.csv:2:3: column 2: a decimal comma among decimal points "
         "(got 2,5; write every number with a decimal point)"),
        ("tooth;left;right\n1;2\n", "w.csv:1:1: the line of names does not fit 2 columns "
         "(got tooth;left;right; write one name for each column, with the separator of the rows)"),
        ("tooth;dev\n;um\n1;2\n", "w.csv:2:1: a line of text among the rows "
         "(got um; put # in front of it; only one line of names is allowed, above the rows)"),
        ("1;2\nend\n", "w.csv:2:1: a line of text among the rows "
         "(got end; put # in front of it; only one line of names is allowed, above the rows)"),
        (b"\xef\xbb\xbf1;2\n\xff", "w.csv:1:1: the text is not valid UTF-8, "
         "although its first bytes indicate this encoding "
         "(got byte 0xff; save the file as UTF-8)"),
        (b"\xff\xfe1\0;", "w.csv:1:1: the text is not valid UTF-16, although its first bytes indicate this encoding "
         "(got byte 0x3b; save the file as UTF-8)"),
        (b"\x1f\x8b\x08rubbish", "w.csv:1:1: the gzip file is damaged or incomplete (compress or copy it again)"),
        ("1;2\n" * 400, "w.csv:1:1: the file is larger than 1000 bytes (check that this is the file with the table)"),
    ],
)  # fmt: skip
def test_each_fault_is_said_with_its_place(text: str | bytes, expected: str) -> None:
    assert faults(text) == [expected]


def test_all_faults_are_found_at_once() -> None:
    assert [(finding.line, finding.got) for finding in read("a;b\n1;x\n2;3;4\nend\n4;nan\n5;6\n").findings] == [
        (2, "x"), (3, "2 3 4"), (4, "end"), (5, "nan"),
    ]  # fmt: skip


def test_columns_of_comma_separated_integers_are_read_with_names() -> None:
    assert rows("tooth,left,right\n1,2,5\n2,3,5\n") == [(1, 2, 5), (2, 3, 5)]
    assert rows("1,2,5.0\n2,3,5.0\n") == [(1, 2, 5), (2, 3, 5)]


def test_a_decimal_comma_before_three_digits_is_one() -> None:
    assert rows("1;1,234\n2;2,345\n") == [(1, 1.234), (2, 2.345)]


def test_a_very_long_line_is_refused_and_not_searched() -> None:
    data = b"1;2\n" + b'"1" ' * 5000
    assert [finding.message for finding in read_numbers(data, NEEDS).findings] == ["the line has 20000 characters"]
    assert [finding.message for finding in read_numbers(b"1," * 9000).findings] == ["the line has 18000 characters"]


FAR = 1500  # rows


class Dribble(io.BytesIO):
    """A stream that gives few bytes at once, so that a file has many parts."""

    few = 1000

    def read(self, size: int | None = -1) -> bytes:
        return super().read(self.few)


def test_streams_of_text_and_of_bytes_are_read_like_files(tmp_path: Path) -> None:
    text = "# µ\r\ntooth;dev\r\n1;2,5\r\n2;-1,25\r\n"
    file = tmp_path / "w.csv"
    file.write_bytes(text.encode())
    named = io.StringIO(text, newline="")
    named.name = "rig 7"  # type: ignore[misc]
    with file.open("rb") as raw, file.open(encoding="utf-8", newline="") as decoded:
        tables = [read_numbers(source) for source in (file, str(file), text.encode(), named, raw, decoded)]
    assert [table.file for table in tables] == [str(file), str(file), "<bytes>", "rig 7", str(file), str(file)]
    for table in tables:
        assert (table.names, table.values.tolist(), table.findings) == (("tooth", "dev"), [[1, 2.5], [2, -1.25]], [])
        assert table.sha256 == hashlib.sha256(text.encode()).hexdigest()
    assert read_texts(io.StringIO("a;b\n1;2\n")).rows == ((2, (("1", 1), ("2", 3))),)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("good", "bad", "words"),
    [
        ("{k};{m}", "5;nan", "column 2: must be a finite number"),
        ("{k};{m}", "5;1e31", "column 2: must be a number up to 1e+30"),
        ("{k};{m}", "word", "a line of text among the rows"),
        ("{k};{m}", '"5;6', "must be a number"),
        ("{k};{m}", '"5";"6', "must be a number"),
        ("{k};{m}", '5"6";7', "must be a number"),
        ('"{k}";"{m}"', '"5";6"', "must be a number"),
        ('"{k}" "{m}"', '"5 6"', "columns in this row: 1; in most rows: 2"),
        ('"{k}","{m}"', '"5,6","7"', "a decimal comma among decimal points"),
        ("{k},{m}", "5,6,7", "columns in this row: 3; in most rows: 2"),
        ("{k} {m}", "5", "columns in this row: 1; in most rows: 2"),
        ("{k};{m}", "5;6.", ""),
        ("{k};{m}", "5;_6", "must be a number"),
        ("{k};{m}", "5;0x1", "must be a number"),
        ("{k};{m}", "5;1_0", "must be a number"),
        ("{k};{m}", "5;1e", "must be a number"),
        ("{k};{m}", "5;1 2", "must be a number"),
        ("{k};{m}", "5;;", "columns in this row: 1; in most rows: 2"),
        ("{k};{m}", ";5", "a number is missing"),
        ("{k},{m}", "5,", "columns in this row: 1; in most rows: 2"),
    ],
)
def test_row_is_read_by_the_same_rules_at_every_line(good: str, bad: str, words: str) -> None:
    number = "{}.5" if "," in good else "{}.25"
    lines = [good.format(k=k, m=number.format(k % 7)) for k in range(FAR)]
    for place in (2, SAMPLED_LINES + 5, FAR // 2, FAR - 1):
        table = read_numbers(Dribble("\n".join([*lines[:place], bad, *lines[place:]]).encode()), NEEDS)
        assert [finding.line for finding in table.findings] == [place + 1] * bool(words)
        assert all(words in str(finding) for finding in table.findings)
        assert words or table.values[place].tolist() == [5, 6]


def test_remarks_blank_lines_and_quotes_far_down() -> None:
    lines = [f"{k};{k % 7},5" for k in range(FAR)]
    lines[FAR // 2] = f'"{FAR // 2}"; "{FAR // 2 % 7},5" ;'
    lines[FAR // 3 : FAR // 3] = ["# paused", "", " ; "]
    table = read_numbers(Dribble("\n".join(lines).encode()), NEEDS)
    assert not table.findings
    assert table.values.tolist() == [[k, k % 7 + 0.5] for k in range(FAR)]
    assert (table.lines[0], table.lines[-1], np.diff(table.lines).max()) == (1, FAR + 3, 4)


def test_a_line_of_blanks_at_the_end_is_no_row() -> None:
    table = read_numbers(b"1 2.5\n" * SAMPLED_LINES + b" ", NEEDS)
    assert (len(table.values), table.findings) == (SAMPLED_LINES, [])


def test_a_decimal_comma_may_come_late() -> None:
    lines = ["0;0"] * SAMPLED_LINES * 2 + ["1;2,5"]
    assert read_numbers("\n".join(lines).encode(), NEEDS).values[-1].tolist() == [1, 2.5]
    far = ["0 0"] * FAR + ["1 2,5", "1 2.5"]
    assert [f.line for f in read_numbers(Dribble("\n".join(far).encode()), NEEDS).findings] == [FAR + 2]


@pytest.mark.parametrize("few", [3, 4, 5, 7, 50])
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
def test_letters_and_line_ends_may_lie_across_parts(few: int, encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Dribble, "few", few)
    text = "# µ: ü\r\n\r\nx [µ]\té\r\n" + "1,5\t2\r\n" * 9 + "# µ\r\r3\t4"
    table = read_numbers(Dribble(text.encode(encoding)), NEEDS)
    assert not table.findings
    assert (table.names, table.remarks[0].entry) == (("x [µ]", "é"), ("µ", "ü", 6))
    assert table.values.tolist() == [[1.5, 2]] * 9 + [[3, 4]]
    assert table.lines.tolist() == [*range(4, 13), 15]


def test_many_comments_are_cheap_and_the_last_may_contain_names() -> None:
    text = "# a: 1\n" * 60_000 + "# tooth; dev\n1;2\n" + "# x\n" * 1000
    table = read_numbers(text.encode(), NEEDS)
    assert (table.names, table.lines.tolist(), len(table.remarks)) == (("tooth", "dev"), [60_002], MAX_REMARKS)
    assert len(read_texts(b"a;b\n" + b"# x\n" * 60_000 + b"1;2\n").remarks) == 60_000


@pytest.mark.thorough
def test_memory_is_that_of_the_numbers() -> None:
    """A line without end is not kept, and text only while it is read."""

    class Endless(io.RawIOBase):
        given, line = 0, b"7" * 1000

        def read(self, size: int = -1) -> bytes:
            type(self).given += size
            return self.line * (size // len(self.line) + 1)

    (finding,) = read_numbers(Endless(), NEEDS, 10**9).findings
    assert finding.message == "the line has more than 10000 characters"
    assert Endless.given < 10 * PART
    Endless.line, Endless.given = b"123456.5;0.5\n" * 1000, 0
    tracemalloc.start()
    (finding,) = read_numbers(Endless(), NEEDS, 5_000_000).findings
    assert finding.message == "the file is larger than 5 MB"
    numbers = 8 * 3 * 5_000_000 / 13
    assert tracemalloc.get_traced_memory()[1] < 1.2 * numbers + 40 * PART
    tracemalloc.stop()


def test_a_size_in_megabytes() -> None:
    with pytest.raises(PresetError, match="larger than 5 MB"):
        list(TextFile(b"1\n" * 2_500_001, 5_000_000).parts())


@pytest.mark.thorough
@given(
    st.binary(max_size=80)
    | st.text(max_size=80).map(str.encode)
    | st.text('1,;. \t\n"#:=x-', max_size=40).map(str.encode)
)
def test_whatever_the_bytes_are_there_are_rows_or_findings(data: bytes) -> None:
    table = read_numbers(data, NEEDS)
    assert table.findings or (table.values.shape[0] == len(table.lines) >= 1 and table.values.shape[1] >= 2)
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
        (tmp_path / "wheel.cvs", "no such file: ", f"the nearest name is {tmp_path / 'wheel.csv'}"),
        (tmp_path / "qqqqqq", "no such file: ", "check the path"),
        (tmp_path / "a/b.csv", "no such file: ", str(tmp_path / "a")),
        (tmp_path, "is a directory, not a file", "name a file in it"),
        ("a\0b", "cannot read a\0b: embedded null", ""),
        (tmp_path / "wheel.csv/x", "cannot read " if os.name == "posix" else "no such file: ", ""),
        ("", "no such file: the name is empty", ""),
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

    monkeypatch.setattr("hdassist.run.files.open_at_once", refuse)
    with pytest.raises(DataError, match=r"cannot read wheel\.csv: Permission denied"):
        read_bytes("wheel.csv", 100)
