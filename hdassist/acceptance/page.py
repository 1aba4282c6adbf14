"""Acceptance of a drive as a page, as the answer alone, in a sentence for each check, and as CSV."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields
from math import floor, log10

from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.acceptance.accept import AcceptanceResult
from hdassist.acceptance.answer import PROVENANCE, Answer, provenance
from hdassist.acceptance.decision import GUARD, Decision
from hdassist.acceptance.limits import Limit
from hdassist.acceptance.predictions import Belief
from hdassist.design.check_page import fitted_words
from hdassist.terminal.answers import cross_checked, csv_text
from hdassist.terminal.brief import facts, proof, verdict_coloured, verdict_text
from hdassist.terminal.console import Style, table
from hdassist.terminal.influence_words import influence_words, measure_words, samples_words
from hdassist.terminal.wheels_page import heading as of_teeth
from hdassist.terminal.wheels_page import wheels
from hdassist.version import __version__

RULES = {
    "guard": f"guard bands of {GUARD:g} u on each side of a limit",
    "simple": "simple acceptance up to a limit",
}

HEADINGS = ("check", "value", "± (k=2)", "5 to 95 %", "limit", "margin", "kept", "verdict")
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
    for basis, title in _titles(result).items():
        found = [check for check in result.decisions if (check.basis or "measured") == basis]
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
        "predicted": f"predicted: PASS from {100 * result.sure:g} % probability; no decision on conformity"
        + of_teeth(result.wheels),
    }


def _table(checks: Sequence[Decision], title: str, style: Style) -> RenderableType:
    """A row for each check; sentences in their place where a terminal is too narrow for the numbers."""
    cells = [_row(check) for check in checks]
    kept = [k for k in range(len(HEADINGS)) if HEADINGS[k] in ("value", "margin") or any(row[k] for row in cells)]
    rows = [[style.text(row[place] or "-") for place in kept] for row in cells]
    headings = [style.text(HEADINGS[place]) for place in kept]
    words = [max(row[0].split(), key=len) for row in rows]  # names of checks may be broken, numbers may not
    needed = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]
    needed[0] = max(map(len, [headings[0], *words]))
    edges = 2 if style.ascii else 0
    if sum(needed) + GAP * (len(needed) - 1) + edges > style.width:
        named = [zip(headings[1:], row[1:], strict=True) for row in rows]
        lines = [", ".join(f"{heading} {text}" for heading, text in row if text != "-") for row in named]
        texts = [Text(f"{row[0]}: {line}") for row, line in zip(rows, lines, strict=True)]
        return Group(Text(style.text(title), style="bold"), *texts)
    grid = table(style, title)
    for heading in headings:
        left = heading in ("check", "verdict")
        grid.add_column(heading, justify="left" if left else "right", no_wrap=heading != "check")
    for row in rows:
        grid.add_row(*map(verdict_coloured, row))
    return grid


def _row(check: Decision) -> list[str]:
    """A cell for each of HEADINGS, empty where there is nothing."""
    limit, belief = check.held_against, check.belief
    value, spread, margin = (
        "" if figure is None else number(figure, limit)
        for figure in (check.value, check.expanded_uncertainty, check.margin)
    )
    at_least = "≥ " if check.extent == "at least" else ""
    span = f"{number(belief.p5, limit)} to {number(belief.p95, limit)}" if belief else ""
    name = f"{limit.label}, {check.unit.replace('*', '·')}"
    kept = f"{100 * belief.probability:.0f} %" if belief else ""
    return [name, at_least + value, spread, span, bound(limit), margin, kept, str(check.verdict)]


def sentence(check: Decision) -> str:
    """A check in words: value, uncertainty or range, limit, margin, how it is known."""
    _, value, spread, span, limit, margin, kept, _ = _row(check)
    label = check.held_against.label
    if not value:
        return f"{label}: no value, limit {limit} {check.unit}"
    measure = value + (f" ± {spread}" if spread else "") + (f" ({span})" if span else "")
    sure = f", kept {kept}" if kept else ""
    return f"{label}: {measure} {check.unit}, limit {limit}, margin {margin}{sure}, {check.basis}"


def bound(limit: Limit) -> str:
    """A limit with its sign."""
    return f"{'≤' if limit.check.upper else '≥'} {limit.bound:.6g}"


def how_to_decide(check: Decision) -> str:
    """What to measure where a prediction is open; empty of any other check."""
    if check.verdict != "INCONCLUSIVE" or check.basis != "predicted":
        return ""
    held = check.held_against
    torque = "" if held.M_g is None else f"{held.M_g:g}"
    name = held.check.field if held.order is None else f"order_{held.order:g}"
    value = f"--value {name}{torque and f'@{torque}'}=VALUE±U"
    option = f"--measured {torque}:FILE" if held.check.measured and torque else value
    return f"{check.reason}: measure it, {option}"


def _reasons(result: AcceptanceResult) -> list[str]:
    """Why a check is decided as it is, or what would decide it."""
    decided = [d for d in result.decisions if d.reason]
    return [f"{d.verdict}, {d.held_against.label}: {how_to_decide(d) or d.reason}" for d in decided]


def _to_explain(result: AcceptanceResult) -> str:
    """The command that explains what failed, or is open where it was measured."""
    open_ = [d for d in result.decisions if d.verdict in ("FAIL", "INCONCLUSIVE")]
    codes = [d.code for d in open_ if not how_to_decide(d)]
    return f"hdassist explain {' '.join(dict.fromkeys(codes))}" if codes else ""


def _of_belief(result: AcceptanceResult) -> Iterator[tuple[str, str]]:
    """What predictions hang on and what to measure next, a label and a text each, as `hdassist check` has them."""
    samples = result.predictions.samples if result.predictions else None
    if samples is None:
        return
    if (least := result.least_sure) and result.influences:
        yield "influence", f"{influence_words(result.influences)} at {least.M_g_Nm:g} N·m"
    yield "measure", measure_words(result.to_measure, held=True)
    yield "samples", samples_words(samples)
    yield "exact", fitted_words(samples.prior)


def _lines(result: AcceptanceResult) -> Iterator[tuple[str, str]]:
    """What is to be known beside the verdicts, a label and a text each."""
    if reasons := _reasons(result):
        more = f"; {len(reasons) - 1} more" if len(reasons) > 1 else ""
        yield "why", reasons[0] + more
    yield from _of_belief(result)
    remarks = list(dict.fromkeys(note.code for note in result.notes))
    yield "remarks", f"{', '.join(remarks)}: hdassist explain {' '.join(remarks)}" if remarks else ""
    yield "next", _to_explain(result)
    if found := result.predictions:
        yield "proof", proof(found.certificate, found.quantities.cross_checks)
    yield "more", "--details"


def _notes(result: AcceptanceResult) -> list[str]:
    lines = [f"{label}: {text}" for label, text in _of_belief(result) if text]
    if found := result.predictions:
        lines.append(f"certificate: {found.certificate}{cross_checked(found.quantities.cross_checks)}")
    lines.append(f"hdassist {__version__}, preset sha256 {result.drive.origin.sha256[:12]}")
    read = [m.trace for m in result.measurements.values()]
    lines += [f"{each.file}: sha256 {each.sha256[:12]}" for each in read]
    lines += [f"{wheel.pitch.file}: sha256 {wheel.pitch.sha256[:12]}" for _, wheel in wheels(result.wheels)]
    lines += _reasons(result)
    lines += [f"remark {note.code}: {note.text}" for note in result.notes]
    if command := _to_explain(result):
        lines.append(f"what to do: {command}")
    return lines


def _cells(check: Decision) -> list[object]:
    *cells, belief = (getattr(check, field.name) for field in fields(check))
    cells += [getattr(belief, field.name, None) for field in fields(Belief)]
    return [" ".join(cell) if isinstance(cell, tuple) else cell for cell in cells]


def csv(answers: Iterable[Answer]) -> str:
    """One row per drive and check; a drive without an answer has a row with its error."""
    keys = [field.name for field in fields(Decision)][:-1] + [f"belief.{field.name}" for field in fields(Belief)]
    rows: list[list[object]] = []
    for answer in answers:
        start, end = [answer.serial, answer.preset.name], list(provenance(answer).values())
        rows += [[*start, *_cells(check), answer.exit_code, None, *end] for check in answer.checks]
        if error := answer.error:
            rows.append([*start, *[None] * len(keys), answer.exit_code, error.message, *end])
    return csv_text(["serial", "preset", *keys, "exit_code", "error", *PROVENANCE], rows)
