"""Lots: tables read, rows worked on, answers kept, summed up and done again."""

from __future__ import annotations

import csv
import io
import json
import pickle
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.special import betaincinv

from hdassist import __version__
from hdassist.features.acceptance import accept as lotwork
from hdassist.features.acceptance import request as requests
from hdassist.features.acceptance.accept import answer_row, answer_rows, failure_of, predicted
from hdassist.features.acceptance.answer import (
    RELATIVE,
    answer_differences,
    answer_json,
    lot_summary,
    read_answers,
    still_stands,
)
from hdassist.features.acceptance.request import LotRow, Request, is_lot, read_lot
from hdassist.features.measuring.measure import Reading
from hdassist.interface.pages.accept import csv as figures
from hdassist.interface.pages.accept import lot_report, title
from hdassist.readers.pitch import WheelFiles
from hdassist.run.errors import DataError, PresetError, UsageError, Verdict
from tests.helpers.paper import on_paper
from tests.helpers.process import SMALL, TINY

HEAD = ["serial", "preset", "measured", "measured@4", "phases.xi_b", "F_ior@1", "limit F_ior@1", "Note"]
CELLS = ["17-1", "vzp160", "1=a.csv", "b.csv", "250.5", "28.1±1.2", "30", "tight, but good"]
BOUND = "order_2=9"
BASE = Request("small.yaml", overrides=("cam.W_0=0.6",), limits=(BOUND,))


def table(folder: Path, text: str | bytes, name: str = "lot.csv") -> str:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return str(path)


@pytest.mark.parametrize(
    ("separator", "mark", "end", "encoding"),
    [
        (",", ".", "\n", "utf-8"),
        (";", ",", "\r\n", "utf-8-sig"),
        ("\t", ",", "\r", "utf-16"),
        (";", ".", "\n", "latin-1"),
    ],
)  # fmt: skip
def test_dialects_say_the_same(tmp_path, separator, mark, end, encoding):
    cells = [cell.replace(".", mark) if cell[:2] in ("25", "28") else cell for cell in CELLS]
    text = io.StringIO()
    text.write(f"# a remark{end}")
    csv.writer(text, delimiter=separator, lineterminator=end).writerows([HEAD, cells])
    (row,) = read_lot(table(tmp_path, text.getvalue().encode(encoding)), BASE).rows
    beside = str(tmp_path)
    assert row == LotRow(
        Request(
            "vzp160", "17-1", ("cam.W_0=0.6", "phases.xi_b=250.5"), (BOUND, "F_ior@1=30"),
            (f"1={beside}/a.csv", f"4={beside}/b.csv"), ("F_ior@1=28.1±1.2",),
        ),
        f"{beside}/lot.csv:3",
    )  # fmt: skip


@pytest.mark.thorough
@settings(max_examples=10)
@given(
    st.lists(st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), min_size=1), min_size=1, unique=True)
)
def test_serials_come_through_as_they_are(tmp_path_factory, serials):
    folder = tmp_path_factory.mktemp("lot")
    text = io.StringIO()
    csv.writer(text, lineterminator="\n", quoting=csv.QUOTE_ALL).writerows(
        [["note", "serial"], *(["x", s] for s in serials)]
    )
    rows = read_lot(table(folder, text.getvalue()), BASE).rows
    assert [row.request.serial for row in rows] == serials
    assert not any(row.fault for row in rows)


def test_a_serial_cannot_talk_to_the_terminal():
    answer = failure_of(LotRow(Request("small", "a\x1b[31m\t\N{CYRILLIC SMALL LETTER PE}")), DataError("no"))
    assert title(answer) == "a\\x1b[31m\\t\N{CYRILLIC SMALL LETTER PE}"
    assert title(replace(answer, serial="")) == "small"


def test_what_is_wrong_with_a_row_stays_with_it(tmp_path):
    text = "serial,preset,F_ior@1\nA,x,1\nA,x,1\n,x,1\nB,,1\nC,x,1,2\nD,-,1\n"
    lot = read_lot(table(tmp_path, text), Request(""))
    faults = [str(row.fault or "") for row in lot.rows]
    assert [row.request.serial for row in lot.rows] == ["A", "A", "line 4", "B", "C", "D"]
    expected = (
        "2:1: serial: also used in line 3", "3:1: serial: also used in line 2", "4:1: serial: missing",
        "5:1: preset: missing", "6:7: a cell in a column", "7:3: preset: a row cannot read standard",
    )  # fmt: skip
    for said, words in zip(faults, expected, strict=True):
        assert words in said


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ("serial,tolerances.F_i3", "the nearest name is tolerances.F_i"),
        ("seriel,preset", "the nearest name is serial"),
        ("serial,measured@x", "write the torque in N.m: measured@80"),
        ("serial,F_ior@x", "the nearest name is F_ior@80"),
        ("serial,limt F_ior@4", r"the nearest name is limit F_ior@4"),
        ("serial,limit K_1@80", "no column of a lot file has this name"),
        ("serial,F_ior@80,F_ior@80", "column 2 has the same name"),
    ],
)
def test_names_that_cannot_be_meant_are_refused(tmp_path, head, words):
    with pytest.raises(PresetError, match=words) as caught:
        read_lot(table(tmp_path, f"{head}\n1,2,3\n"), BASE)
    assert "lot.csv:1:" in caught.value.message


@pytest.mark.parametrize("text", ["serial,preset\n", "# serial\n", "", b"\x00\x01\x02\n1\n"])
def test_tables_without_rows_are_refused(tmp_path, text):
    with pytest.raises(DataError):
        read_lot(table(tmp_path, text), BASE)


def test_what_a_lot_is(tmp_path):
    assert is_lot("x.CSV")
    assert not any(map(is_lot, ("vzp160", "a.yaml", "-", str(tmp_path))))


LOT = """\
serial,phases.xi_b,limit self_error@1,limit self_error@4,F_ior@4,limit F_ior@4
one,,3000,3000,20±1,30
two,,3000,3000,21±1,30
other,80,3000,3000,,
broken,nowhere,3000,3000,,
three,,3000,3000,22±1,30
loose,,3000,5,,
"""


def worked(rows):
    return list(map(answer_row, rows))


def plain(answer):
    return replace(answer, time="", place=None)


@pytest.fixture(scope="module")
def lot(tmp_path_factory):
    return read_lot(table(tmp_path_factory.mktemp("lot"), LOT), Request(TINY))


@pytest.fixture(scope="module")
def told(lot):
    return worked(lot.rows)


def test_rows_answer_in_order_as_if_they_were_alone(lot, told, monkeypatch):
    assert [a.status for a in told] == ["PASS", "PASS", "PASS", "DATA_ERROR", "PASS", "FAIL"]
    assert [a.serial for a in told] == [row.request.serial for row in lot.rows]
    asked = []
    real = requests.predict
    monkeypatch.setattr(requests, "predict", lambda drive, *a, **k: asked.append(drive) or real(drive, *a, **k))
    predicted.cache_clear()
    together = answer_rows(lot.rows, False, 0, len(lot.rows))
    assert len(asked) == 3  # the three of a kind, the one with another phase, the one with another limit
    assert list(map(plain, together)) == list(map(plain, told))
    predicted.cache_clear()
    assert plain(worked(lot.rows[4:5])[0]) == plain(told[4])
    assert len(asked) == 4


def test_a_fault_of_a_row_comes_through_to_another_process(tmp_path):
    rows = read_lot(table(tmp_path, "serial,preset\nA,\n"), Request("")).rows
    (answer,) = pickle.loads(pickle.dumps(partial(answer_rows, rows, False)))(0, 1)
    assert answer.error.message == rows[0].fault.message
    assert answer.error.message.endswith(
        "lot.csv:2:1: preset: missing (add the column preset, or use --preset NAME for all rows)"
    )
    assert (answer.exit_code, answer.request) == (4, None)


def test_a_bug_in_one_row_is_its_own(lot, monkeypatch):
    real = lotwork.accept

    def broken(request, *rest, **options):
        return 1 / 0 if request.serial == "two" else real(request, *rest, **options)

    monkeypatch.setattr(lotwork, "accept", broken)
    found = worked(lot.rows[:3])
    assert [a.exit_code for a in found] == [0, 1, 0]
    assert "internal error: ZeroDivisionError" in found[1].error.message


def test_lot_summary_contains_counts_and_the_yield_of_decided_drives(told):
    found = lot_summary([*told, *(replace(told[0], verdict=Verdict.INCONCLUSIVE, exit_code=6),) * 4])
    assert found["verdicts"] == {"PASS": 4, "FAIL": 1, "INCONCLUSIVE": 4, "DATA_ERROR": 1, "BROKEN": 1}
    assert (
        found["drives"] == 10 == sum(found["verdicts"].values()) - found["verdicts"]["BROKEN"]
    )  # once more, by its older name
    low, high = betaincinv(4.5, 1.5, [0.05, 0.95])
    assert found["yield"] == {"decided": 5, "share": 4 / 5, "low": pytest.approx(low), "high": pytest.approx(high)}
    assert lot_summary(told[3:4])["yield"] is None


@pytest.mark.parametrize("width", [60, 100])
def test_lines_of_a_lot_fit_their_width(lot, told, width):
    page = on_paper(lot_report(lot, told), width)
    assert max(map(len, page.splitlines())) <= width
    for words in ("reported", "20.00", "≤ 30"):
        assert words in page


def test_csv_has_a_row_for_each_check_and_its_provenance(told):
    rows = list(csv.DictReader(io.StringIO(figures(told))))
    assert len(rows) == sum(len(a.checks) or 1 for a in told)
    assert {row["version"] for row in rows} == {__version__}
    (broken,) = (row for row in rows if row["error"])
    assert (broken["serial"], broken["verdict"], broken["exit_code"]) == ("broken", "DATA_ERROR", "4")
    assert float(rows[0]["value"]) == told[0].checks[0].value


def as_text(answers):
    return json.dumps({"results": list(map(answer_json, answers))})


LINE = st.text(st.characters(exclude_characters="\n"))
TEXTS = st.lists(st.text(), max_size=2).map(tuple)
REQUESTS = st.builds(
    Request, LINE, LINE, TEXTS, TEXTS, TEXTS, TEXTS,
    st.builds(Reading, st.none() | st.text(), wrap=st.none() | st.floats(1, 360), budget=TEXTS),
    st.booleans(), st.text(), st.integers(0),
    st.builds(WheelFiles, st.none() | st.text(), mark_g=st.none() | st.floats(-720, 720), pitch_sense=st.just("cw")),
)  # fmt: skip


def test_names_of_files_that_are_no_text_come_back_too(tmp_path):
    answer = failure_of(LotRow(Request("d\udcff.yaml", measured=("t\udcff.csv",))), DataError("no \udcff"))
    assert read_answers(table(tmp_path, as_text([answer]), "a.jsonl")) == [answer]


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(REQUESTS)
def test_requests_come_back_out_of_a_file(tmp_path, asked):
    answer = failure_of(LotRow(asked), DataError("no"))
    assert read_answers(table(tmp_path, as_text([answer]), "a.jsonl")) == [answer]


@pytest.mark.parametrize(
    "change",
    [
        {"preset": None}, {"seed": "x"}, {"limits": "F_ior=3"}, {"measured": [1]}, {"more": 1}, {"reading": 3},
        {"reading": {"more": 1}},
    ],
)  # fmt: skip
def test_requests_that_cannot_be_are_refused(tmp_path, change):
    told = answer_json(failure_of(LotRow(Request("a")), DataError("no")))
    for wrong in ({**told, "request": {**told["request"], **change}}, {**told, "request": 3}):
        with pytest.raises(DataError, match=r"a\.json:1: a result is incomplete: request"):
            read_answers(table(tmp_path, json.dumps(wrong), "a.json"))
    del told["request"]
    with pytest.raises(DataError, match="is incomplete: request"):
        read_answers(table(tmp_path, json.dumps(told), "a.json"))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("checks", 0, "verdict"), "GOOD"),
        (("checks", 0, "basis"), "guessed"),
        (("certificate",), 3),
        (("preset", "sha256"), 5),
        (("more",), 1),
        (("time",), 5),
    ],
)
def test_answers_that_cannot_be_are_refused(tmp_path, told, path, value):
    with pytest.raises(DataError, match=rf"a\.json:1: a result is incomplete: {path[0]}"):
        read_answers(changed(tmp_path, told, path, value))


@pytest.mark.parametrize(
    "path", [("checks", 0, "value"), ("certificate", "max_residual"), ("request", "reading", "wrap")]
)
@pytest.mark.parametrize("value", [float("inf"), float("nan")])
def test_numbers_that_are_none_are_no_answer(tmp_path, told, path, value):
    with pytest.raises(DataError, match=r"a\.json is not valid JSON: Out of range"):
        read_answers(changed(tmp_path, told, path, value))


def changed(tmp_path, told, path, value):
    """A file with an answer in which one value is another."""
    wrong = json.loads(json.dumps(answer_json(told[0])))
    place = wrong
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return table(tmp_path, json.dumps(wrong), "a.json")


def test_an_answer_stands_as_long_as_nothing_has_changed(tmp_path, told):
    preset = table(tmp_path, Path(SMALL).read_bytes(), "d.yaml")
    text = "serial,F_ior@1,limit F_ior@1\nA,3±1,30\n"
    (row,) = read_lot(table(tmp_path, text), Request(preset, measured_only=True)).rows
    (answer,) = read_answers(table(tmp_path, as_text(worked([row])), "a.jsonl"))
    assert still_stands(answer, row.request)
    for request in (replace(row.request, seed=1), replace(row.request, limits=("F_ior@1=31",))):
        assert not still_stands(answer, request)
    assert not still_stands(replace(answer, version="0.0.0"), row.request)
    assert not still_stands(told[3], told[3].request)
    Path(preset).write_text(Path(SMALL).read_text() + "# turned\n")
    assert not still_stands(answer, row.request)


def test_differences_are_those_beyond_the_tolerance(told):
    def with_value(factor):
        first, *rest = told[0].checks
        return replace(told[0], checks=(replace(first, value=first.value * factor), *rest))

    assert not answer_differences(told[0], told[0])
    limit, value = told[0].checks[0].limit, told[0].checks[0].value
    scale = max(limit, value) / value
    assert not answer_differences(told[0], with_value(1 + 0.5 * RELATIVE * scale))
    (found,) = answer_differences(told[0], with_value(1 + 2 * RELATIVE * scale))
    assert found.key == "checks.1 F'_ior at 4 N·m.value"
    verdict, error = answer_differences(told[0], told[3])
    assert (verdict.recorded, verdict.now, error.recorded) == ("PASS", "DATA_ERROR", None)
    assert error.now == told[3].error.message
    *_, last = told[0].checks
    (found,) = answer_differences(told[0], replace(told[0], checks=told[0].checks[:-1]))
    assert (found.key, found.now) == (f"checks.{len(told[0].checks)} {last.label}", None)


def test_a_file_that_breaks_off_is_refused(tmp_path, told):
    whole = as_text(told)
    assert read_answers(table(tmp_path, whole, "a.json")) == told
    for text in (
        whole[:-40],
        "[1]",
        "{}\n{}\n",
        "no",
        '{"schema":"hdassist.accept/1"}',
        '{"results": []}',
    ):
        with pytest.raises(DataError):
            read_answers(table(tmp_path, text, "c.json"))


def test_usage_error_in_a_row_counts_as_wrong_data(lot):
    row = replace(lot.rows[0], request=replace(lot.rows[0].request, values=("F_ior@4=20",)))
    assert UsageError.exit_code == 2
    assert worked([row])[0].exit_code == 4
