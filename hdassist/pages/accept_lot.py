"""A lot as a report: a line for each drive, and what they say together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hdassist.acceptance.answer import AcceptAnswer, answer_json
from hdassist.acceptance.limits import Limit
from hdassist.acceptance.lot import Lot
from hdassist.acceptance.statistics import QUANTILES, lot_summary
from hdassist.json_parts import Json
from hdassist.pages.accept import bound, by_severity, is_open, number, sentence, title, to_explain
from hdassist.report.blocks import Facts, Table
from hdassist.report.quantities import NO_VALUE
from hdassist.report.report import Report
from hdassist.terminal.answers import together
from hdassist.version import __version__

LOT_HEADINGS = ("check", "values", "least", "5 %", "50 %", "95 %", "greatest", "limit")


def lot_report(lot: Lot, answers: Sequence[AcceptAnswer]) -> Report:
    """Counts, yield, each drive with the check that decides, the spread of values, and what to do about the rest."""
    found = lot_summary(answers)
    counts = [f"{n} {verdict}" for verdict, n in found["verdicts"].items() if n]
    counts += [f"{found['broken']} broken ({100 * found['broken_share']:.3g} %)"] * bool(found["broken"])
    rows, why = found["checks"], "no drive has an answer: each line says what is wrong with its row"
    if decided := found["yield"]["with_verdict"]:
        low, high = (100 * end for end in found["yield"]["interval_95"])
        share = f"{found['yield']['passed']} of {decided} drives with a verdict, {100 * found['yield']['share']:.1f} %"
        why = f"yield: {share} (95 % interval after Wilson: {low:.1f} to {high:.1f})"
    drives = tuple((title(answer), answer.status, _deciding(answer)) for answer in answers)
    cells = tuple(_cells(row, several=len({row["preset"] for row in rows}) > 1) for row in rows)
    return Report(
        command="accept",
        drive=None,
        head=f"{lot.file}, {_drives(found['drives'])}",
        verdict=", ".join(counts),
        why=(why,),
        blocks=(
            Table("", ("drive", "verdict", "decided by"), drives, words=(0, 1, 2)),
            Table("values of each check", LOT_HEADINGS, cells),
            Facts.of(_facts(rows, answers)),
        ),
        details=(Facts((("version", __version__), ("lot", f"{lot.file}, sha256 {lot.sha256[:12]}"))),),
        values=_values(lot, answers, found),
        line="\n".join(f"{name} {status}" for name, status, _ in drives),
    )


def _deciding(answer: AcceptAnswer) -> str:
    """The check that decides: of those of the worst verdict the one with the least room; or the first error."""
    if not answer.error:
        return sentence(by_severity(answer.checks)[0])
    first, *more = answer.error.message.splitlines()
    return first + (f" (and {len(more)} more)" if more else "")


def _facts(rows: Sequence[Mapping[str, Any]], answers: Sequence[AcceptAnswer]) -> Iterator[tuple[str, str]]:
    """Values left out, remarks, what to measure and the next command, a label and a text each."""
    part = sum(row["of_part_only"] for row in rows)
    yield "left out", f"{part} values of part of the cycle, or none" if part else ""
    remarks = Counter(code for answer in answers for code in {remark.code for remark in answer.remarks})
    yield "remarks", "; ".join(f"{code}: {_drives(remarks[code])}" for code in sorted(remarks))
    checks = sorted((check for answer in answers for check in answer.checks), key=lambda check: check.code)
    open_ = sorted({check.label for check in checks if is_open(check)})
    yield "measure", f"{'; '.join(open_)}: open by its prediction" if open_ else ""
    yield "next", to_explain(checks)


def _cells(row: Mapping[str, Any], several: bool) -> tuple[str, ...]:
    """A cell for each of LOT_HEADINGS; several: whether the lot has drives of several presets."""
    limit = Limit(row["code"], row["limit_greatest"], row["M_g_Nm"], row["per_cam_rev"])
    ends = dict.fromkeys(f"{row[key]:.6g}" for key in ("limit_least", "limit_greatest"))
    found = [NO_VALUE if row[key] is None else number(row[key], limit) for key in QUANTILES]
    name = f"{row['preset']}: " * several + f"{limit.label}, {row['unit']}, {row['basis'] or 'no value'}"
    return name, str(row["values"]), *found, f"{bound(limit)[0]} {' to '.join(ends)}"


def _drives(count: int) -> str:
    return f"{count} drive{'s' * (count != 1)}"


def _values(lot: Lot, answers: Sequence[AcceptAnswer], found: Json) -> Json:
    """Every answer, and what they say together."""
    return {
        **together("accept", [answer_json(answer) for answer in answers]),
        "lot": {"name": lot.file, "sha256": lot.sha256, "rows": len(lot.rows), "notes": list(lot.notes)},
        "summary": found,
    }
