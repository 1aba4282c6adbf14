"""The JUnit report of a lot, read back by parsers that had no part in writing it."""

from __future__ import annotations

from pathlib import Path
from xml.dom.minidom import Element, parseString
from xml.parsers import expat

import pytest
from junitparser import JUnitXml

from hdassist.features.acceptance.accept import answer_rows
from hdassist.features.acceptance.answer import AcceptAnswer, lot_summary
from hdassist.features.acceptance.request import Request, read_lot
from hdassist.interface.pages.accept import csv, junit

SMALL = str(Path(__file__).parents[1] / "data/small.yaml")
ROWS = """\
serial,F_ior@1,limit F_ior@1,limit lost_motion,measured@1
good,20±1,30,,
bad <&"'>,40±1,30,,
"open, \x07",30.1±1,30,,
broken,20±1,30,,none.csv
part,20±1,30,60,
"""
# what the strict schema of Jenkins allows: children and attributes of each element
ALLOWED: dict[str, tuple[set[str], set[str]]] = {
    "testsuites": ({"testsuite"}, {"name", "tests", "failures", "errors"}),
    "testsuite": ({"properties", "testcase", "system-out"}, {"name", "tests", "failures", "errors", "skipped"}),
    "properties": ({"property"}, set()),
    "property": (set(), {"name", "value"}),
    "testcase": ({"skipped", "error", "failure", "system-out"}, {"name", "classname"}),
    "skipped": (set(), {"type", "message"}),
    "error": (set(), {"type", "message"}),
    "failure": (set(), {"type", "message"}),
    "system-out": (set(), set()),
}


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> list[AcceptAnswer]:
    """Answers of a lot with PASS, FAIL, INCONCLUSIVE, a broken row and a limit that is left out."""
    table = tmp_path_factory.mktemp("lot") / "lot.csv"
    table.write_text(ROWS, encoding="utf-8")
    lot = read_lot(str(table), Request(SMALL, measured_only=True))
    return answer_rows(lot.rows, False, 0, len(lot.rows))


def elements(parent: Element, name: str) -> list[Element]:
    return [node for node in parent.childNodes if node.nodeName == name]


def test_each_verdict_reads_right(told):
    root = parseString(junit("lot", told, "ab")).documentElement
    assert root is not None
    suites = elements(root, "testsuite")
    read = {}
    for suite in suites:
        for case in elements(suite, "testcase"):
            (result,) = [node for node in case.childNodes if node.nodeType == node.ELEMENT_NODE]
            body = result.firstChild.data if result.firstChild else ""
            read[case.getAttribute("classname"), case.getAttribute("name")] = (
                result.nodeName, result.getAttribute("type"), result.getAttribute("message"), body
            )  # fmt: skip
    names = [suite.getAttribute("name") for suite in suites]
    assert names == ["good", "bad <&\"'>", "open, \\x07", "broken", "part"]
    where = "F'_ior at 1 N·m"
    assert read["good", where][0] == "system-out"
    assert read["good", where][3].startswith(f"PASS: {where}: 20.00 ± 1.00″, limit ≤ 30, margin 10.00")
    for name, verdict, value in (("bad <&\"'>", "FAIL", "40.00"), ("open, \\x07", "INCONCLUSIVE", "30.10")):
        tag, kind, message, body = read[name, where]
        assert (tag, kind) == ("failure", verdict)
        assert message.startswith(f"{verdict}: {where}: {value} ± 1.00″, limit ≤ 30")
        assert body.startswith(message)
        assert "hdassist explain F_IOR" in body
        actions = {"FAIL": "put the fixed wheel in another hole", "INCONCLUSIVE": "measure again with a smaller uncer"}
        assert f"what to do: {actions[verdict]}" in body
    tag, kind, message, body = read["broken", "no result"]
    assert (tag, kind) == ("error", "FILE_UNREADABLE")
    assert message.startswith("DATA_ERROR: ")
    assert "none.csv" in body
    assert body.endswith("hdassist explain FILE_UNREADABLE")
    assert read["part", "lost motion"][:3] == ("skipped", "", "not tested: no measured value")
    counts = [[int(suite.getAttribute(key)) for key in ("tests", "failures", "errors", "skipped")] for suite in suites]
    assert counts == [[1, 0, 0, 0], [1, 1, 0, 0], [1, 1, 0, 0], [1, 0, 1, 0], [2, 0, 0, 1]]
    assert [int(root.getAttribute(key)) for key in ("tests", "failures", "errors")] == [6, 2, 1]
    assert lot_summary(told)["verdicts"] == {"PASS": 2, "FAIL": 1, "INCONCLUSIVE": 1, "DATA_ERROR": 1, "BROKEN": 1}


def test_provenance_is_properties(told):
    root = parseString(junit("lot", told, "ab")).documentElement
    assert root is not None
    for suite, answer in zip(elements(root, "testsuite"), told, strict=True):
        (group,) = elements(suite, "properties")
        found = {p.getAttribute("name"): p.getAttribute("value") for p in elements(group, "property")}
        assert found["version"] == answer.version
        assert found["lot_sha256"] == "ab"
        assert found["time"] == answer.time
        assert found["seed"] == "0"
        assert found.get("preset_sha256") == answer.preset.sha256


def test_junit_report_contains_only_what_the_strict_schema_allows(told):
    path: list[str] = []

    def begin(name: str, attributes: dict[str, str]) -> None:
        assert name in (ALLOWED[path[-1]][0] if path else {"testsuites"})
        assert set(attributes) <= ALLOWED[name][1]
        path.append(name)

    parser = expat.ParserCreate()
    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda name: path.pop()
    parser.Parse(junit("lot\ud800", told).encode(), True)


def test_junitparser_counts_the_same(told, tmp_path):
    (tmp_path / "lot.xml").write_text(junit("lot", told), encoding="utf-8")
    suites = list(JUnitXml.fromfile(str(tmp_path / "lot.xml")))
    kinds = [[type(result).__name__ for case in suite for result in case.result] for suite in suites]
    assert kinds == [[], ["Failure"], ["Failure"], ["Error"], ["Skipped"]]
    # a build server shows class and name of a case together: the drive and the limit, each once, and no two alike
    cases = [(case.classname, case.name) for suite in suites for case in suite]
    assert len(set(cases)) == len(cases) == 6
    assert all(suite.name == case.classname and suite.name not in case.name for suite in suites for case in suite)


def test_remarks_stand_once_and_fail_nothing_by_themselves(told):
    text = junit("lot", told)
    assert text.count("note NOT_TESTED: lost motion") == 1
    root = parseString(text).documentElement
    assert root is not None
    *_, part = elements(root, "testsuite")
    assert [node.nodeName for node in part.childNodes if node.nodeType == node.ELEMENT_NODE][-1] == "system-out"


def test_csv_has_a_row_for_an_untested_limit(told):
    head, *rows = [line.split(",") for line in csv(told).splitlines()]
    drives = {row[head.index("serial")]: row for row in rows if row[head.index("verdict")] == "NOT_TESTED"}
    assert list(drives) == ["part"]
    assert "lost motion" in drives["part"][head.index("reason")]
    assert [row[0] for row in rows].count("part") == 2
