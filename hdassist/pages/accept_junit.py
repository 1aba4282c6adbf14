"""Acceptances as JUnit XML, which build servers show: a suite for each drive, a test case for each of its checks.

A case's class is its drive, its name the limit; remarks on a drive stand once, in the output of its suite. FAIL and
INCONCLUSIVE are failures of that type: neither may look green. A drive without an answer is an error, a limit
that was left out is skipped. The grounds of an answer are properties of the suite, where every reader looks for them.
There are no durations and no machine names; the time of an answer is a property.
"""

from collections import Counter
from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from hdassist.acceptance.answer import AcceptAnswer, provenance
from hdassist.pages.accept import is_open, sentence
from hdassist.visible import visible

SUITES_HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n<!-- hdassist accept -->\n'
COUNTED = {"tests": "testcase", "failures": "failure", "errors": "error", "skipped": "skipped"}


def junit(name: str, answers: Sequence[AcceptAnswer], lot_sha256: str = "") -> str:
    """Suites of all drives as text; name of the whole; lot_sha256, of the table of a lot, a property of each."""
    root = Element("testsuites", name=visible(name))
    for answer in answers:
        _suite(root, answer, lot_sha256)
    for element in (*root, root):
        kinds = Counter(inner.tag for inner in element.iter())
        counted = {key: str(kinds[tag]) for key, tag in COUNTED.items() if element is not root or key != "skipped"}
        element.attrib.update(counted)
    indent(root)
    return SUITES_HEAD + tostring(root, encoding="unicode") + "\n"


def _suite(root: Element, answer: AcceptAnswer, lot_sha256: str) -> None:
    preset, serial = answer.preset.name, answer.serial
    name = serial or preset
    suite = SubElement(root, "testsuite", name=visible(name))
    place = SubElement(suite, "properties")
    known = {"serial": serial, "preset": preset, "status": answer.status, **provenance(answer)}
    known["lot_sha256"] = lot_sha256
    for key, value in known.items():
        if value is not None and value != "":
            SubElement(place, "property", name=key, value=visible(str(value)))

    def case(words: str, tag: str, message: str, kind: str, *lines: str) -> None:
        place = SubElement(suite, "testcase", classname=visible(name), name=visible(words))
        attributes = {key: visible(text) for key, text in (("message", message), ("type", kind)) if text}
        SubElement(place, tag, attributes).text = visible("\n".join(filter(None, lines))) or None

    if error := answer.error:
        hint = f"hint: {error.hint}" if error.hint else ""
        code = f"what it means: hdassist explain {error.code}" if error.code else ""
        message = f"{answer.status}: {error.message.splitlines()[0]}"
        case("no answer", "error", message, error.code or "INTERNAL", error.message, hint, code)
    for check in answer.checks:
        words = f"{check.verdict}: {sentence(check)}"
        because = f"because: {check.reason}" if check.reason else ""
        if check.verdict == "PASS":
            case(check.label, "system-out", "", "", words, because)
        else:
            todo = f"measure it, {check.option}" if is_open(check) else f"hdassist explain {check.code}"
            case(check.label, "failure", words, str(check.verdict), words, because, f"what to do: {todo}")
    for label in answer.left_out:
        case(label, "skipped", "not tested: nothing was measured", "")
    remarks = [f"remark {remark.code}: {remark.text}" for remark in answer.remarks]
    if remarks:
        SubElement(suite, "system-out").text = visible("\n".join(remarks))
