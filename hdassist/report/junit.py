"""Acceptances as JUnit XML, which build servers show: a test case for each drive and check.

FAIL and INCONCLUSIVE are failures of that type: neither may look green. A drive without an answer is an error, a limit
that was left out is skipped. There are no durations and no machine names in it; the time of an answer is a property.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from hdassist.report.lot import sentence
from hdassist.report.lot_figures import Answer, asked, provenance, status, summary
from hdassist.version import __version__

ERRORS = {1: "INTERNAL", 4: "DATA", 5: "UNTRUSTED"}
_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # in XML 1.0


def junit(name: str, answers: Sequence[Answer], facts: Mapping[str, Any]) -> str:
    """One suite with all drives.

    Arguments: name of the suite; answers; facts, properties of the suite beside the version and the summary.
    """
    suite = Element("testsuite", name=_clean(name))
    told = summary(answers)
    words = {f"drives_{verdict}": count for verdict, count in told["verdicts"].items()}
    share = {"yield_share": told["yield"]["share"], "yield_interval_95": told["yield"]["interval_95"]}
    _properties(suite, {"version": __version__, **facts, "drives": told["drives"], **words,
                        "drives_broken": told["broken"], **share})  # fmt: skip
    for answer in answers:
        _drive(suite, answer)
    cases = suite.findall("testcase")
    kinds = Counter(child.tag for case in cases for child in case)
    counts = {"tests": len(cases), "failures": kinds["failure"], "errors": kinds["error"], "skipped": kinds["skipped"]}
    root = Element("testsuites", name="hdassist accept")
    for element in (root, suite):
        element.attrib.update({key: str(count) for key, count in counts.items()})
    root.append(suite)
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def _drive(suite: Element, answer: Answer) -> None:
    facts = {"serial": answer.get("serial", ""), "preset": answer["preset"]["name"], **provenance(answer)}
    name = facts["serial"] or facts["preset"]
    if "error" in answer:
        case = _case(suite, facts["preset"], f"{name}: no answer", facts)
        error = answer["error"]
        message = f"{status(answer)}: {error['message'].splitlines()[0]}"
        body = "\n".join(filter(None, (error["message"], f"hint: {error['hint']}" if error["hint"] else "")))
        _say(case, "error", message, body, ERRORS.get(answer["exit_code"], "DATA"))
        return
    remarks = [f"remark {said['code']}: {said['text']}" for said in answer["remarks"]]
    for check in answer["checks"]:
        verdict, words = check["verdict"], f"{check['verdict']}: {sentence(check)}"
        case = _case(suite, facts["preset"], f"{name}: {asked(check).label}", {**facts, **check})
        said = [words, f"because: {check['reason']}"] if check["reason"] else [words]
        if verdict != "PASS":
            help_line = f"what to do: hdassist explain {check['code']}"
            _say(case, "failure", words, "\n".join([*said, *remarks, help_line]), verdict)
        else:
            SubElement(case, "system-out").text = _clean("\n".join([*said, *remarks]))
    for label in answer["left_out"]:
        _say(_case(suite, facts["preset"], f"{name}: {label}", facts), "skipped", "not tested: nothing was measured")
    if answer["fail_on"] == "warn" and remarks:
        case = _case(suite, facts["preset"], f"{name}: remarks", facts)
        _say(case, "failure", f"FAIL: {remarks[0]}", "\n".join(remarks), "REMARK")


def _case(suite: Element, preset: str, name: str, facts: Mapping[str, Any]) -> Element:
    case = SubElement(suite, "testcase", classname=_clean(preset), name=_clean(name))
    _properties(case, facts)
    return case


def _say(case: Element, tag: str, message: str, body: str = "", kind: str = "") -> None:
    said = SubElement(case, tag, message=_clean(message))
    said.attrib.update({"type": kind} if kind else {})
    said.text = _clean(body) or None


def _properties(element: Element, facts: Mapping[str, Any]) -> None:
    """Facts that are known, numbers in full precision."""
    place = SubElement(element, "properties")
    for name, value in facts.items():
        if value is not None and value != "":
            text = " ".join(map(repr, value)) if isinstance(value, list) else str(value)
            SubElement(place, "property", name=name, value=_clean(text))


def _clean(text: str) -> str:
    """A text without the characters that XML does not have: they are written as in Python."""
    return _ILLEGAL.sub(lambda found: found[0].encode("unicode_escape").decode(), text)
