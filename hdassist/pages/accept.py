"""Acceptance of a drive as a report, in a sentence for each check, and as CSV."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields
from math import floor, log10

from hdassist.acceptance.answer import AcceptAnswer, answer_json, provenance
from hdassist.acceptance.decision import GUARD, Decision
from hdassist.acceptance.limits import Limit
from hdassist.acceptance.predictions import Belief, Predictions
from hdassist.pages.check import fitted_words
from hdassist.preset.fields import Drive
from hdassist.preset.yamltext import shown
from hdassist.report.blocks import Facts, Table
from hdassist.report.quantities import NO_VALUE, Quantity
from hdassist.report.report import Report
from hdassist.terminal.answers import csv_text
from hdassist.terminal.brief import again
from hdassist.terminal.influence_words import influence_words, measure_words, samples_words
from hdassist.terminal.wheels import WHEEL_WORDS
from hdassist.verdict import SEVERITY
from hdassist.version import __version__

RULE_WORDS = {
    "guard": f"guard bands of {GUARD:g} u on each side of a limit",
    "simple": "simple acceptance up to a limit",
}
FIRST_COLUMNS = (
    "code", "M_g_Nm", "per_cam_rev", "basis", "extent", "value", "expanded_uncertainty", "guard", "limit", "limit_is",
    "margin", "unit", "verdict", "reason",
)  # fmt: skip
NAMED_CHECKS = 2  # reasons below the verdict


def number(value: float, limit: Limit) -> str:
    """A value as its table shows it: three digits of a small limit, two decimals of an arcsec at least."""
    if limit.check.unit != "arcsec":
        return f"{value:.4g}"
    return f"{value:.{max(2, 2 - floor(log10(limit.limit)))}f}"


def _number(name: str) -> Callable[[Decision], str | None]:
    return lambda d: None if (value := getattr(d, name)) is None else number(value, d)


def _value(check: Decision) -> str | None:
    found = _number("value")(check)
    return found and "≥ " * (check.extent == "at least") + found


def _range(check: Decision) -> str | None:
    return f"{number(check.belief.p5, check)} to {number(check.belief.p95, check)}" if check.belief else None


def bound(limit: Limit) -> str:
    """A limit with its sign."""
    return f"{'≤' if limit.check.upper else '≥'} {limit.limit:.6g}"


DECISION_COLUMNS: tuple[Quantity[Decision], ...] = (
    Quantity("check", "check", "", "", lambda d: f"{d.label}, {d.unit.replace('*', '·')}"),
    Quantity("verdict", "verdict", "", "", lambda d: str(d.verdict)),
    Quantity("value", "value", "", "", _value),
    Quantity("expanded_uncertainty", "± (k=2)", "", "", _number("expanded_uncertainty")),
    Quantity("range", "5 to 95 %", "", "", _range),
    Quantity("limit", "limit", "", "", bound),
    Quantity("margin", "margin", "", "", _number("margin")),
    Quantity("kept", "kept", "", "", lambda d: d.belief and f"{100 * d.belief.probability:.0f} %"),
)


def accept_report(answer: AcceptAnswer, predictions: Predictions | None, drive: Drive) -> Report:
    """An acceptance of a drive; predictions, what the model says of it, None where nothing was predicted."""
    found = by_severity(answer.checks)
    worst = [check for check in found if check.verdict == found[0].verdict]
    reasons = [f"{check.label}: {check.reason}" if check.reason else sentence(check) for check in worst[:NAMED_CHECKS]]
    reasons[-1] += f"; {len(worst) - NAMED_CHECKS} more" if len(worst) > NAMED_CHECKS else ""
    remarks = [f"{note.code}: {note.text}" for note in answer.remarks]
    files = [f"{each.file}: sha256 {each.sha256[:12]}" for each in (*answer.measured, *answer.pitch)]
    samples = predictions.samples if predictions else None
    rest = [
        ("samples", samples_words(samples) if samples else ""),
        ("exact", fitted_words(samples.prior) if samples else ""),
        ("reasons", "\n".join(f"{each.label}: {each.verdict}, {each.reason}" for each in found if each.reason)),
        ("remarks", "\n".join(remarks)),
        ("version", f"{__version__}, preset sha256 {str(answer.preset.sha256)[:12]}"),
        ("files", "\n".join(files)),
    ]
    return Report(
        command="accept",
        drive=drive,
        head=answer.preset.name + (f", serial {answer.serial}" if answer.serial else ""),
        verdict=answer.status,
        why=tuple(reasons),
        blocks=(*_tables(answer), Facts.of(_facts(answer, predictions, drive))),
        details=(Facts.of(rest),),
        certificate=predictions.certificate if predictions else None,
        cross_checks=predictions.quantities.cross_checks if predictions else (),
        values=answer_json(answer),
        line=answer.status,
        warnings=answer.warnings,
        exit_code=answer.exit_code,
    )


def by_severity(checks: Iterable[Decision]) -> list[Decision]:
    """Checks by their verdict, the worst first, and those of a verdict by their room to the limit, the least first."""
    return sorted(checks, key=lambda each: (SEVERITY.index(each.verdict), (each.margin or 0.0) / each.limit))


def _tables(answer: AcceptAnswer) -> Iterator[Table]:
    """A table of the checks that are known in one way, for each way."""
    assert answer.rule is not None
    teeth = ", ".join(f"{WHEEL_WORDS[wheel.wheel]} ({shown(wheel.file)})" for wheel in answer.pitch)
    titles = {
        "measured": f"measured: {RULE_WORDS[answer.rule.measured]}",
        "stated": f"measured otherwise: {RULE_WORDS[answer.rule.measured]}",
        "predicted": f"predicted: PASS from {100 * answer.rule.sure:g} % probability; no decision on conformity"
        + (f"; measured teeth: {teeth}" if teeth else ""),
    }
    for basis, title in titles.items():
        checks = [check for check in answer.checks if (check.basis or "measured") == basis]
        less = "margin" if any(check.belief for check in checks) else ""  # a probability stands in its place
        columns = [q for q in DECISION_COLUMNS if q.key != less and {*map(q.text, checks)} - {NO_VALUE}]
        yield Table.by_row(title, columns, checks, words=(0, 1))


def _facts(answer: AcceptAnswer, predictions: Predictions | None, drive: Drive) -> Iterator[tuple[str, str]]:
    """Largest influences, what to measure, remarks and the next command, a label and a text each."""
    if predictions and predictions.samples:
        if (least := predictions.least_sure) and predictions.influences:
            yield "influence", f"{influence_words(predictions.influences)} at {least.M_g_Nm:g} N·m"
        yield "measure", measure_words(predictions.to_measure, held=True)
    codes = " ".join(dict.fromkeys(note.code for note in answer.remarks))
    yield "remarks", f"hdassist explain {codes}" if codes else ""
    first = by_severity(answer.checks)[0]
    measured = first.basis == "predicted" and first.verdict != "FAIL"
    yield "next", f"{again('accept', drive)} {measured_option(first)}" if measured else to_explain(answer.checks)


def sentence(check: Decision) -> str:
    """A check in words: value, uncertainty or range, limit, margin, how it is known."""
    _, _, value, spread, span, limit, margin, kept = (quantity.of(check) for quantity in DECISION_COLUMNS)
    if not value:
        return f"{check.label}: no value, limit {limit} {check.unit}"
    measure = value + (f" ± {spread}" if spread else "") + (f" ({span})" if span else "")
    sure = f", kept {kept}" if kept else ""
    return f"{check.label}: {measure} {check.unit}, limit {limit}, margin {margin}{sure}, {check.basis}"


def is_open(check: Decision) -> bool:
    """Whether a prediction leaves a check open, so that measuring decides it."""
    return check.verdict == "INCONCLUSIVE" and check.basis == "predicted"


def measured_option(check: Decision) -> str:
    """The option of accept that gives a check its measured value."""
    torque = "" if check.M_g_Nm is None else f"{check.M_g_Nm:g}"
    if check.check.measured and torque:
        return f"--measured {torque}=FILE"
    name = check.check.field if check.per_cam_rev is None else f"order_{check.per_cam_rev:g}"
    return f"--value {name}{torque and f'@{torque}'}=VALUE±U"


def to_explain(checks: Iterable[Decision]) -> str:
    """The command that explains what failed, or is open where it was measured; empty where nothing is."""
    codes = [each.code for each in checks if each.verdict in ("FAIL", "INCONCLUSIVE") and not is_open(each)]
    return f"hdassist explain {' '.join(dict.fromkeys(codes))}" if codes else ""


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
