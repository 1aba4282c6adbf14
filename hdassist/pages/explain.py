"""Names that can be explained, as a report."""

from collections.abc import Iterator, Sequence

from hdassist.acceptance.limits import CODES
from hdassist.explaining import Entry, entries
from hdassist.json_parts import attributes
from hdassist.report import Facts, Paragraph, Report, ReportSection

KIND_TITLES = {
    "error": "errors",
    "quantity or word": "quantities and words",
    "symbol": "symbols",
    "section": "fields of a preset, by section or name",
}


def explain_report(found: Sequence[Entry]) -> Report:
    """What each name stands for; all names, by kind, where none is asked for."""
    first, *others = found or [Entry("section", ("hdassist explain NAME",), "any of these, English or Russian")]
    listed = [ReportSection(f"{each.names[0]}: {each.words}", (_facts(each),)) for each in others]
    return Report(
        command="explain",
        drive=None,
        head=f"{first.names[0]}: {first.words}",
        blocks=(_facts(first), *listed) if found else tuple(_all_names()),
        values={
            "names": [
                {"name": each.names[0], **attributes(each, "kind", "words"), "facts": dict(each.facts)}
                for each in found or entries()
            ]
        },
    )


def _facts(entry: Entry) -> Facts:
    return Facts.of((("is a", entry.kind), *entry.facts))


def _all_names() -> Iterator[ReportSection]:
    """The names of all there is, by kind."""
    yield ReportSection("checks and remarks", (Facts.of((item.code, item.words) for item in CODES.values()),))
    for kind, title in KIND_TITLES.items():
        names = ", ".join(entry.names[0] for entry in entries() if entry.kind == kind)
        yield ReportSection(title, (Paragraph(names),))
