"""Acceptance of a drive as a page, as the answer alone, and as CSV."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.analysis.acceptance import Acceptance
from hdassist.analysis.decision import GUARD, Decision
from hdassist.report.accept_figures import CHECK
from hdassist.report.console import Look, table
from hdassist.report.csvtext import to_csv

RULES = {
    "guard": f"guard bands of {GUARD:g} standard uncertainties on each side of the limit",
    "simple": "simple acceptance, up to the limit",
}
HEADINGS = ("check", "value", "U", "limit", "margin", "known", "verdict")
PREDICTED = "a prediction, not a decision on conformity to a standard"


def number(value: float, unit: str) -> str:
    """A value as its table shows it."""
    return f"{value:.2f}" if unit == "arcsec" else f"{value:.4g}"


def render(result: Acceptance, look: Look, serial: str = "") -> RenderableType:
    """The verdict, a row for each limit, and what it should not be read without."""
    name = result.drive.name + (f", serial {serial}" if serial else "")
    parts: list[RenderableType] = [Text(look.text(f"{name}: {result.verdict}"), style="bold"), Text("")]
    grid = table(look)
    for words in HEADINGS:
        grid.add_column(look.text(words), justify="left" if words in ("check", "known", "verdict") else "right",
                        overflow="fold", no_wrap=words not in ("check", "known"))  # fmt: skip
    for decision in result.decisions:
        grid.add_row(*(look.text(text) for text in _row(decision)))
    parts.append(grid)
    parts += [Text(look.text(line)) for line in _notes(result)]
    return Group(*parts)


def _row(decision: Decision) -> list[str]:
    asked, known, unit = decision.asked, decision.known, decision.asked.check.unit
    limit = ("≤ " if asked.check.upper else "≥ ") + f"{asked.limit:.6g}"
    start, end = [f"{asked.label}, {unit}"], [limit, str(decision.verdict)]
    if known is None or decision.margin is None:
        return [*start, "-", "-", end[0], "-", "-", end[1]]
    at_least = "≥ " if known.extent == "at least" else ""
    spread = "-" if decision.expanded is None else number(decision.expanded, unit)
    margin = number(decision.margin, unit)
    return [*start, at_least + number(known.value, unit), spread, end[0], margin, known.basis, end[1]]


def _notes(result: Acceptance) -> list[str]:
    acceptance = result.drive.acceptance
    lines = []
    if any(d.known and d.known.basis != "predicted" for d in result.decisions):
        lines.append(f"measured: U is the expanded uncertainty, k = 2; rule: {RULES[acceptance.rule]}")
    if result.predictions is not None:
        lines.append(f"predicted: {PREDICTED}; margin {acceptance.margin:g} % to either side")
        lines.append(f"certificate: {result.predictions.certificate}")
    lines += [f"{d.verdict}, {d.asked.label}: {d.reason}" for d in result.decisions if d.reason]
    lines += [f"remark {said.remark.code}: {said.text}" for said in result.remarks]
    codes = [d.asked.check.code for d in result.decisions if d.verdict in ("FAIL", "INCONCLUSIVE")]
    if codes:
        lines.append(f"what to do: hdassist explain {' '.join(dict.fromkeys(codes))}")
    return lines


def brief(result: Acceptance) -> str:
    """The answer alone: the verdict."""
    return str(result.verdict)


def csv(results: Sequence[tuple[str, Acceptance]]) -> str:
    """One row per drive and limit; results with the serial of each drive."""
    rows = [[serial, r.drive.name, *(q.value(d) for q in CHECK)] for serial, r in results for d in r.decisions]
    return to_csv(["serial", "preset", *(q.key for q in CHECK)], rows)
