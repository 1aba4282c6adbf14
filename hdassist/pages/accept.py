"""Acceptance of a drive as a page, as the answer alone, in a sentence for each check, and as CSV."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields
from math import floor, log10

from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.acceptance.answer import AcceptAnswer, provenance
from hdassist.acceptance.decision import GUARD, Decision
from hdassist.acceptance.limits import Limit
from hdassist.acceptance.predictions import Belief, Predictions
from hdassist.pages.check import fitted_words
from hdassist.preset.yamltext import shown
from hdassist.terminal.answers import cross_check_words, csv_text
from hdassist.terminal.brief import facts, proof, verdict_coloured, verdict_text
from hdassist.terminal.console import Style, table
from hdassist.terminal.influence_words import influence_words, measure_words, samples_words
from hdassist.terminal.wheels import WHEEL_WORDS
from hdassist.verdict import Verdict
from hdassist.version import __version__

RULE_WORDS = {
    "guard": f"guard bands of {GUARD:g} u on each side of a limit",
    "simple": "simple acceptance up to a limit",
}
CHECK_HEADINGS = ("check", "value", "± (k=2)", "5 to 95 %", "limit", "margin", "kept", "verdict")
FIRST_COLUMNS = (
    "code", "M_g_Nm", "per_cam_rev", "basis", "extent", "value", "expanded_uncertainty", "guard", "limit", "limit_is",
    "margin", "unit", "verdict", "reason",
)  # fmt: skip
COLUMN_GAP = 3  # columns between those of a table


def number(value: float, limit: Limit) -> str:
    """A value as its table shows it: three digits of a small limit, two decimals of an arcsec at least."""
    if limit.check.unit != "arcsec":
        return f"{value:.4g}"
    return f"{value:.{max(2, 2 - floor(log10(limit.limit)))}f}"


def accept_page(
    answer: AcceptAnswer, predictions: Predictions | None, style: Style, *, details: bool = False
) -> RenderableType:
    """The verdict, a row for each limit, and what it should not be read without; with details every reason."""
    assert answer.rule is not None
    name = answer.preset.name + (f", serial {answer.serial}" if answer.serial else "")
    parts: list[RenderableType] = [verdict_text(style, f"{name}: ", Verdict(answer.status)), Text("")]
    teeth = ", ".join(f"{WHEEL_WORDS[wheel.wheel]} ({shown(wheel.file)})" for wheel in answer.pitch)
    titles = {
        "measured": f"measured: {RULE_WORDS[answer.rule.measured]}",
        "stated": f"measured otherwise: {RULE_WORDS[answer.rule.measured]}",
        "predicted": f"predicted: PASS from {100 * answer.rule.sure:g} % probability; no decision on conformity"
        + (f"; measured teeth: {teeth}" if teeth else ""),
    }
    for basis, title in titles.items():
        if rows := [_row(check) for check in answer.checks if (check.basis or "measured") == basis]:
            kept = [k for k in range(len(CHECK_HEADINGS)) if k in (1, 5) or any(row[k] for row in rows)]
            cells = [[row[k] or "-" for k in kept] for row in rows]
            parts.append(numbers(style, title, [CHECK_HEADINGS[k] for k in kept], cells))
    return Group(*parts, facts(style, _facts(answer, predictions, details)))


def numbers(style: Style, title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> RenderableType:
    """A table whose first column may be broken; sentences in its place where a terminal is too narrow for numbers."""
    headings, *rows = ([style.text(cell) for cell in row] for row in (headings, *rows))
    needed = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]
    needed[0] = max(len(word) for row in (headings, *rows) for word in row[0].split())
    if sum(needed) + COLUMN_GAP * (len(needed) - 1) + 2 * style.ascii > style.width:
        pairs = [[" ".join(pair) for pair in zip(headings, row, strict=True) if pair[1] != "-"][1:] for row in rows]
        lines = [Text(f"{row[0]}: {', '.join(pair)}") for row, pair in zip(rows, pairs, strict=True)]
        return Group(*[Text(style.text(title), style="bold")] * bool(title), *lines)
    grid = table(style, title)
    for heading in headings:
        is_text = heading in ("check", "verdict")
        grid.add_column(heading, justify="left" if is_text else "right", no_wrap=heading != "check")
    for row in rows:
        grid.add_row(*map(verdict_coloured, row))
    return grid


def _row(check: Decision) -> list[str]:
    """A cell for each of HEADINGS, empty where there is nothing."""
    value, spread, margin = (
        "" if figure is None else number(figure, check)
        for figure in (check.value, check.expanded_uncertainty, check.margin)
    )
    at_least, belief = "≥ " if check.extent == "at least" else "", check.belief
    span = f"{number(belief.p5, check)} to {number(belief.p95, check)}" if belief else ""
    kept = f"{100 * belief.probability:.0f} %" if belief else ""
    name = f"{check.label}, {check.unit.replace('*', '·')}"
    return [name, at_least + value, spread, span, bound(check), margin, kept, str(check.verdict)]


def sentence(check: Decision) -> str:
    """A check in words: value, uncertainty or range, limit, margin, how it is known."""
    _, value, spread, span, limit, margin, kept, _ = _row(check)
    if not value:
        return f"{check.label}: no value, limit {limit} {check.unit}"
    measure = value + (f" ± {spread}" if spread else "") + (f" ({span})" if span else "")
    sure = f", kept {kept}" if kept else ""
    return f"{check.label}: {measure} {check.unit}, limit {limit}, margin {margin}{sure}, {check.basis}"


def bound(limit: Limit) -> str:
    """A limit with its sign."""
    return f"{'≤' if limit.check.upper else '≥'} {limit.limit:.6g}"


def how_to_decide(check: Decision) -> str:
    """What to measure where a prediction is open; empty of any other check."""
    if check.verdict != "INCONCLUSIVE" or check.basis != "predicted":
        return ""
    torque = "" if check.M_g_Nm is None else f"{check.M_g_Nm:g}"
    name = check.check.field if check.per_cam_rev is None else f"order_{check.per_cam_rev:g}"
    value = f"--value {name}{torque and f'@{torque}'}=VALUE±U"
    return f"{check.reason}: measure it, {f'--measured {torque}=FILE' if check.check.measured and torque else value}"


def to_explain(checks: Iterable[Decision]) -> str:
    """The command that explains what failed, or is open where it was measured; empty where nothing is."""
    open_ = [each for each in checks if each.verdict in ("FAIL", "INCONCLUSIVE") and not how_to_decide(each)]
    return f"hdassist explain {' '.join(dict.fromkeys(each.code for each in open_))}" if open_ else ""


def _of_belief(predictions: Predictions | None) -> Iterator[tuple[str, str]]:
    """What predictions hang on and what to measure next, a label and a text each, as `hdassist check` has them."""
    if predictions is None or predictions.samples is None:
        return
    if (least := predictions.least_sure) and predictions.influences:
        yield "influence", f"{influence_words(predictions.influences)} at {least.M_g_Nm:g} N·m"
    yield "measure", measure_words(predictions.to_measure, held=True)
    yield "samples", samples_words(predictions.samples)
    yield "exact", fitted_words(predictions.samples.prior)


def _facts(answer: AcceptAnswer, predictions: Predictions | None, details: bool) -> Iterator[tuple[str, str]]:
    """What is to be known beside the verdicts, a label and a text each; with details all reasons, remarks and files."""
    decided = [check for check in answer.checks if check.reason]
    reasons = [f"{check.verdict}, {check.label}: {how_to_decide(check) or check.reason}" for check in decided]
    if reasons:
        more = f"; {len(reasons) - 1} more" if len(reasons) > 1 else ""
        yield "why", "\n".join(reasons) if details else reasons[0] + more
    yield from _of_belief(predictions)
    codes = list(dict.fromkeys(note.code for note in answer.remarks))
    words = f"{', '.join(codes)}: hdassist explain {' '.join(codes)}" if codes else ""
    yield "remarks", "\n".join(f"{note.code}: {note.text}" for note in answer.remarks) if details else words
    yield "next", to_explain(answer.checks)
    if predictions:
        proved, crosses = predictions.certificate, predictions.quantities.cross_checks
        yield "proof", f"{proved}{cross_check_words(crosses)}" if details else proof(proved, crosses)
    if not details:
        yield "more", "--details"
        return
    yield "version", f"{__version__}, preset sha256 {str(answer.preset.sha256)[:12]}"
    yield "files", "\n".join(f"{each.file}: sha256 {each.sha256[:12]}" for each in (*answer.measured, *answer.pitch))


def csv(answers: Sequence[AcceptAnswer]) -> str:
    """One row per drive and check; a drive without an answer has a row with its error."""
    columns = dict.fromkeys([*FIRST_COLUMNS, *(each.name for each in fields(Decision) if each.name != "belief")])
    of_belief = [each.name for each in fields(Belief)]
    rows: list[list[object]] = []
    for answer in answers:
        error = answer.error.message if answer.error else None
        for check in answer.checks or [None]:
            cells = [getattr(check, name, None) for name in columns]
            cells += [getattr(check and check.belief, name, None) for name in of_belief]
            texts = [" ".join(cell) if isinstance(cell, tuple) else cell for cell in cells]
            start, end = (answer.serial, answer.preset.name), provenance(answer).values()
            rows.append([*start, *texts, answer.exit_code, error, *end])
    header = ["serial", "preset", *columns, *(f"belief.{name}" for name in of_belief), "exit_code", "error"]
    return csv_text([*header, *provenance(answers[0])], rows)
