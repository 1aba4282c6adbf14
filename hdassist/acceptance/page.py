"""Acceptance of a drive as a page, and as the answer alone."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, log10

from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.acceptance.accept import Acceptance
from hdassist.acceptance.decision import GUARD, Asked, Decision
from hdassist.terminal.console import Style, table
from hdassist.version import __version__

RULES = {
    "guard": f"guard bands of {GUARD:g} u on each side of a limit",
    "simple": "simple acceptance up to a limit",
}

EXPANDED = "± (k=2)"
HEADINGS = ("check", "value", EXPANDED, "limit", "margin", "verdict")
GAP = 3  # columns between those of a table


def number(value: float, asked: Asked) -> str:
    """A value as its table shows it: three digits of a small limit, two decimals of an arcsec at least."""
    if asked.check.unit != "arcsec":
        return f"{value:.4g}"
    return f"{value:.{max(2, 2 - floor(log10(asked.limit)))}f}"


def render(result: Acceptance, style: Style, serial: str = "") -> RenderableType:
    """The verdict, a row for each limit, and what it should not be read without."""
    name = result.drive.name + (f", serial {serial}" if serial else "")
    parts: list[RenderableType] = [Text(style.text(f"{name}: {result.verdict}"), style="bold"), Text("")]
    for basis, title in titles(result).items():
        found = [d for d in result.decisions if (d.known.basis if d.known else "measured") == basis]
        parts += [_table(found, title, style)] * bool(found)
    parts += [Text(style.text(line)) for line in _notes(result)]
    return Group(*parts)


def titles(result: Acceptance) -> dict[str, str]:
    """What stands over the checks of each basis."""
    acceptance = result.drive.acceptance
    return {
        "measured": f"measured: {RULES[acceptance.rule]}",
        "stated": f"measured otherwise: {RULES[acceptance.rule]}",
        "predicted": f"predicted: margin {acceptance.margin:g} %; no decision on conformity to a standard",
    }


def _table(decisions: Sequence[Decision], title: str, style: Style) -> RenderableType:
    """A row for each decision; sentences in their place where a terminal is too narrow for the numbers."""
    spread = any(decision.expanded is not None for decision in decisions)
    kept = [place for place in range(len(HEADINGS)) if spread or HEADINGS[place] != EXPANDED]
    rows = [[style.text(row[place]) for place in kept] for row in map(_row, decisions)]
    headings = [style.text(HEADINGS[place]) for place in kept]
    words = [max(row[0].split(), key=len) for row in rows]  # names of checks may be broken, numbers may not
    needed = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]
    needed[0] = max(map(len, [headings[0], *words]))
    edges = 2 if style.ascii else 0
    if sum(needed) + GAP * (len(needed) - 1) + edges > style.width:
        lines = [", ".join(f"{h} {text}" for h, text in zip(headings[1:], row[1:], strict=True)) for row in rows]
        texts = [Text(f"{row[0]}: {line}") for row, line in zip(rows, lines, strict=True)]
        return Group(Text(style.text(title), style="bold"), *texts)
    grid = table(style, title)
    for heading in headings:
        left = heading in ("check", "verdict")
        grid.add_column(heading, justify="left" if left else "right", no_wrap=heading != "check")
    for row in rows:
        grid.add_row(*row)
    return grid


def _row(decision: Decision) -> list[str]:
    """Check, value, expanded uncertainty, limit, margin, verdict."""
    asked, known, unit = decision.asked, decision.known, decision.asked.check.unit
    limit = f"{'≤' if asked.check.upper else '≥'} {asked.limit:.6g}"
    if known is None or decision.margin is None:
        return [f"{asked.label}, {unit}", "-", "-", limit, "-", str(decision.verdict)]
    at_least = "≥ " if known.extent == "at least" else ""
    spread = "-" if decision.expanded is None else number(decision.expanded, asked)
    value, margin = at_least + number(known.value, asked), number(decision.margin, asked)
    return [f"{asked.label}, {unit}", value, spread, limit, margin, str(decision.verdict)]


def _notes(result: Acceptance) -> list[str]:
    lines = [f"certificate: {result.predictions.certificate}"] if result.predictions else []
    lines.append(f"hdassist {__version__}, preset sha256 {result.drive.origin.sha256[:12]}")
    lines += [f"{m.trace.file}: sha256 {m.trace.sha256[:12]}" for m in result.measurements.values()]
    lines += [f"{d.verdict}, {d.asked.label}: {d.reason}" for d in result.decisions if d.reason]
    lines += [f"remark {said.remark.code}: {said.text}" for said in result.remarks]
    codes = [d.asked.check.code for d in result.decisions if d.verdict in ("FAIL", "INCONCLUSIVE")]
    if codes:
        lines.append(f"what to do: hdassist explain {' '.join(dict.fromkeys(codes))}")
    return lines


def brief(result: Acceptance) -> str:
    """The answer alone: the verdict."""
    return str(result.verdict)
