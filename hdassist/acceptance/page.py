"""Acceptance of a drive as a page, as the answer alone, in a sentence for each check, and as CSV."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import astuple, fields
from math import floor, log10

from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.acceptance.accept import AcceptanceResult
from hdassist.acceptance.answer import PROVENANCE, Accepted, Answer, CheckRecord, provenance
from hdassist.acceptance.decision import GUARD, Limit, margin_of
from hdassist.acceptance.rests import rests_on_of, wheels_of
from hdassist.terminal.answers import csv_text
from hdassist.terminal.brief import facts, proof, verdict_coloured, verdict_text
from hdassist.terminal.console import Style, table
from hdassist.terminal.wheels_page import heading as of_teeth
from hdassist.version import __version__

RULES = {
    "guard": f"guard bands of {GUARD:g} u on each side of a limit",
    "simple": "simple acceptance up to a limit",
}

EXPANDED = "± (k=2)"
HEADINGS = ("check", "value", EXPANDED, "limit", "margin", "verdict")
GAP = 3  # columns between those of a table


def number(value: float, limit: Limit) -> str:
    """A value as its table shows it: three digits of a small limit, two decimals of an arcsec at least."""
    if limit.check.unit != "arcsec":
        return f"{value:.4g}"
    return f"{value:.{max(2, 2 - floor(log10(limit.bound)))}f}"


def render(result: AcceptanceResult, style: Style, serial: str = "", *, details: bool = False) -> RenderableType:
    """The verdict, a row for each limit, and what it should not be read without; with details every reason."""
    name = result.drive.name + (f", serial {serial}" if serial else "")
    parts: list[RenderableType] = [verdict_text(style, f"{name}: ", result.verdict), Text("")]
    checks = [CheckRecord.of(decision) for decision in result.decisions]
    for basis, title in _titles(result).items():
        found = [check for check in checks if (check.basis or "measured") == basis]
        parts += [_table(found, title, style)] * bool(found)
    if details:
        return Group(*parts, *(Text(style.text(line)) for line in _notes(result)))
    return Group(*parts, facts(style, _lines(result)))


def _titles(result: AcceptanceResult) -> dict[str, str]:
    """What stands over the checks of each basis."""
    acceptance = result.drive.acceptance
    return {
        "measured": f"measured: {RULES[acceptance.rule]}",
        "stated": f"measured otherwise: {RULES[acceptance.rule]}",
        "predicted": f"predicted: {margin_of(result.drive, result.predictions).words}; no decision on conformity"
        + of_teeth(result.wheels),
    }


def _table(checks: Sequence[CheckRecord], title: str, style: Style) -> RenderableType:
    """A row for each check; sentences in their place where a terminal is too narrow for the numbers."""
    spread = any(check.expanded_uncertainty is not None for check in checks)
    kept = [place for place in range(len(HEADINGS)) if spread or HEADINGS[place] != EXPANDED]
    rows = [[style.text(row[place]) for place in kept] for row in map(_row, checks)]
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
        grid.add_row(*map(verdict_coloured, row))
    return grid


def _row(check: CheckRecord) -> list[str]:
    """Check, value, expanded uncertainty, limit, margin, verdict."""
    value, spread, limit, margin = _texts(check)
    name = f"{check.held_against.label}, {check.unit.replace('*', '·')}"
    return [name, value or "-", spread or "-", limit, margin or "-", str(check.verdict)]


def sentence(check: CheckRecord) -> str:
    """A check in words: value, uncertainty, limit, margin, how it is known."""
    value, spread, limit, margin = _texts(check)
    if not value:
        return f"{check.held_against.label}: no value, limit {limit} {check.unit}"
    measure = f"{value}{f' ± {spread}' if spread else ''} {check.unit}"
    return f"{check.held_against.label}: {measure}, limit {limit}, margin {margin}, {check.basis}"


def _texts(check: CheckRecord) -> tuple[str, str, str, str]:
    """Value, expanded uncertainty, limit and margin of a check; empty where there is none."""
    held = check.held_against
    value, spread, margin = (
        "" if figure is None else number(figure, held)
        for figure in (check.value, check.expanded_uncertainty, check.margin)
    )
    at_least = "≥ " if check.extent == "at least" else ""
    return at_least + value, spread, bound(held), margin


def bound(limit: Limit) -> str:
    """A limit with its sign."""
    return f"{'≤' if limit.check.upper else '≥'} {limit.bound:.6g}"


def how_to_decide(check: CheckRecord) -> str:
    """What leaves a prediction open, its margin or what is not known, and what to measure; empty of any other check."""
    open_ = check.extent in ("open", "not known")
    near = check.value is not None and check.margin is not None and abs(check.margin) <= check.guard
    if (
        check.verdict != "INCONCLUSIVE"
        or check.basis != "predicted"
        or not (open_ or (near and check.extent == "whole"))
    ):
        return ""
    held, share = check.held_against, f"{100 * check.guard / abs(check.value or 1.0):.3g} %"
    torque = "" if held.M_g is None else f"{held.M_g:g}"
    name = held.check.field if held.order is None else f"order_{held.order:g}"
    value = f"--value {name}{torque and f'@{torque}'}=VALUE±U"
    option = f"--measured {torque}:FILE" if held.check.measured and torque else value
    if open_:
        return (
            f"what is not known, or uncertain, could take it across the limit: give it closer, or measure it, {option}"
        )
    return f"{number(check.value or 0.0, held)} is within {share} of {held.bound:.6g}: measure it, {option}"


def _reasons(result: AcceptanceResult) -> list[str]:
    """Why a check is decided as it is, or what would decide it."""
    decided = [d for d in result.decisions if d.reason]
    return [f"{d.verdict}, {d.limit.label}: {how_to_decide(CheckRecord.of(d)) or d.reason}" for d in decided]


def _to_explain(result: AcceptanceResult) -> str:
    """The command that explains what failed, or is open for another reason than a prediction's margin."""
    open_ = [d for d in result.decisions if d.verdict in ("FAIL", "INCONCLUSIVE")]
    codes = [d.limit.check.code for d in open_ if not (d.reason and how_to_decide(CheckRecord.of(d)))]
    return f"hdassist explain {' '.join(dict.fromkeys(codes))}" if codes else ""


def _lines(result: AcceptanceResult) -> Iterator[tuple[str, str]]:
    """What is to be known beside the verdicts, a label and a text each."""
    if reasons := _reasons(result):
        more = f"; {len(reasons) - 1} more" if len(reasons) > 1 else ""
        yield "why", reasons[0] + more
    found = result.predictions
    if found and (basis := rests_on_of(found)):
        yield "rests on", ", ".join([f"assumed {basis[0].words}", *(each.field for each in basis[1:])])
    remarks = list(dict.fromkeys(note.code for note in result.notes))
    yield "remarks", f"{', '.join(remarks)}: hdassist explain {' '.join(remarks)}" if remarks else ""
    yield "next", _to_explain(result)
    yield "proof", proof(found.certificate, found.cross_checks) if found else ""
    yield "more", "--details"


def _notes(result: AcceptanceResult) -> list[str]:
    lines = []
    if found := result.predictions:
        if basis := rests_on_of(found):
            words = "; ".join(each.words for each in basis)
            lines.append(f"rests on what is assumed (F'_ior without self error, arcsec): {words}")
        lines.append(f"certificate: {found.certificate}")
    lines.append(f"hdassist {__version__}, preset sha256 {result.drive.origin.sha256[:12]}")
    lines += [f"{m.trace.file}: sha256 {m.trace.sha256[:12]}" for m in result.measurements.values()]
    lines += [f"{each.file}: sha256 {each.sha256[:12]}" for each in wheels_of(result.wheels)]
    lines += _reasons(result)
    lines += [f"remark {note.code}: {note.text}" for note in result.notes]
    if command := _to_explain(result):
        lines.append(f"what to do: {command}")
    return lines


def _cells(check: CheckRecord) -> list[object]:
    return [" ".join(cell) if isinstance(cell, tuple) else cell for cell in astuple(check)]


def csv(answers: Iterable[Answer]) -> str:
    """One row per drive and check; a drive without an answer has a row with its error."""
    keys = [field.name for field in fields(CheckRecord)]
    rows: list[list[object]] = []
    for answer in answers:
        start, end = [answer.serial, answer.preset.name], list(provenance(answer).values())
        if isinstance(answer, Accepted):
            rows += [[*start, *_cells(check), answer.exit_code, None, *end] for check in answer.checks]
        else:
            rows.append([*start, *[None] * len(keys), answer.exit_code, answer.error.message, *end])
    return csv_text(["serial", "preset", *keys, "exit_code", "error", *PROVENANCE], rows)
