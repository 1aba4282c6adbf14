"""A lot for people: a line for each drive, and a summary; and as one JSON object."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from math import sqrt
from typing import Any

import numpy as np

from hdassist.acceptance.answer import AcceptAnswer, answer_json
from hdassist.acceptance.decision import Decision
from hdassist.acceptance.limits import Limit
from hdassist.acceptance.lot import Lot
from hdassist.pages.accept import bound, by_severity, is_open, number, sentence, title, to_explain
from hdassist.report.blocks import Facts, Table
from hdassist.report.report import Report
from hdassist.terminal.answers import together
from hdassist.version import __version__

Z = 1.959963984540054  # standard normal: 95 % within
LOT_VERDICTS = ("PASS", "FAIL", "INCONCLUSIVE")
QUANTILES = {"least": 0.0, "quantile_05": 0.05, "median": 0.5, "quantile_95": 0.95, "greatest": 1.0}
LOT_HEADINGS = ("check", "values", "least", "5 %", "50 %", "95 %", "greatest", "limit")


def lot_line(answer: AcceptAnswer, width: int, *, is_short: bool = False) -> str:
    """One drive: serial, verdict, and unless it is short the check that decides; width: that of the longest serial.

    The check that decides is, of those of the worst verdict, the one with the least room for its limit.
    """
    if is_short:
        return f"{title(answer)} {answer.status}"
    if answer.error:
        first, *more = answer.error.message.splitlines()
        words = first + (f" (and {len(more)} more)" if more else "")
    else:
        words = sentence(by_severity(answer.checks)[0])
    return f"{title(answer):<{width}}  {answer.status:<12}  {words}"


def lot_report(lot: Lot, answers: Sequence[AcceptAnswer]) -> Report:
    """Counts, yield, the spread of values, and what to do about drives that do not pass."""
    found = summary(answers)
    counts = [f"{n} {verdict}" for verdict, n in found["verdicts"].items() if n]
    counts += [f"{found['broken']} broken ({100 * found['broken_share']:.3g} %)"] * bool(found["broken"])
    rows, why = found["checks"], ""
    if decided := found["yield"]["with_verdict"]:
        low, high = (100 * end for end in found["yield"]["interval_95"])
        share = f"{found['yield']['passed']} of {decided} drives with a verdict, {100 * found['yield']['share']:.1f} %"
        why = f"yield: {share} (95 % interval after Wilson: {low:.1f} to {high:.1f})"
    cells = tuple(_cells(row, several=len({row["preset"] for row in rows}) > 1) for row in rows)
    return Report(
        command="accept",
        drive=None,
        head=f"{lot.file}, {_drives(found['drives'])}",
        verdict=", ".join(counts),
        why=(why,) if why else (),
        blocks=(Table("values of each check", LOT_HEADINGS, cells), Facts.of(_facts(rows, answers))),
        details=(Facts((("version", __version__), ("lot", f"{lot.file}, sha256 {lot.sha256[:12]}"))),),
    )


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
    found = ["-" if row[key] is None else number(row[key], limit) for key in QUANTILES]
    name = f"{row['preset']}: " * several + f"{limit.label}, {row['unit']}, {row['basis'] or 'no value'}"
    return name, str(row["values"]), *found, f"{bound(limit)[0]} {' to '.join(ends)}"


def _drives(count: int) -> str:
    return f"{count} drive{'s' * (count != 1)}"


def accept_lot_json(lot: Lot, answers: Sequence[AcceptAnswer]) -> dict[str, Any]:
    """The lot as one JSON object: every answer, and what they say together."""
    return {
        **together("accept", [answer_json(answer) for answer in answers]),
        "lot": {"name": lot.file, "sha256": lot.sha256, "rows": len(lot.rows), "notes": list(lot.notes)},
        "summary": summary(answers),
    }


def summary(answers: Sequence[AcceptAnswer]) -> dict[str, Any]:
    """Counts, yield with its interval, and how the values of each check spread, as JSON has them."""
    counts = {verdict: sum(answer.status == verdict for answer in answers) for verdict in LOT_VERDICTS}
    decided = sum(counts.values())
    groups: dict[tuple[Any, ...], list[Decision]] = {}
    for answer in answers:
        for check in answer.checks:
            same = (answer.preset.name, check.code, check.M_g_Nm, check.per_cam_rev, check.basis)
            groups.setdefault(same, []).append(check)
    return {
        "drives": len(answers),
        "verdicts": counts,
        "broken": len(answers) - decided,
        "broken_share": (len(answers) - decided) / len(answers) if answers else None,
        "yield": {
            "passed": counts["PASS"],
            "with_verdict": decided,
            "share": counts["PASS"] / decided if decided else None,
            "interval_95": list(wilson(counts["PASS"], decided)),
            "interval": "Wilson",
        },
        "checks": [{"preset": preset, **_spread(checks)} for (preset, *_), checks in groups.items()],
    }


def _spread(checks: Sequence[Decision]) -> dict[str, Any]:
    """How the values of one check spread that are known in one way."""
    first, whole = checks[0], [each.value for each in checks if each.value is not None and each.extent == "whole"]
    limits = [each.limit for each in checks]
    return {
        **{key: getattr(first, key) for key in ("code", "M_g_Nm", "per_cam_rev", "basis", "unit")},
        "drives": len(checks),
        "values": len(whole),
        "of_part_only": len(checks) - len(whole),
        **(quantiles(whole) if whole else dict.fromkeys(QUANTILES)),
        "limit_is": first.limit_is,
        "limit_least": min(limits),
        "limit_greatest": max(limits),
        "passed": sum(each.verdict == "PASS" for each in checks),
    }


def wilson(passed: int, of: int) -> tuple[float, float]:
    """The 95 % interval of a share, after Wilson (1927); 0 to 1 where nothing was counted."""
    if not of:
        return 0.0, 1.0
    share, weight = passed / of, Z**2 / of
    centre = (share + weight / 2) / (1 + weight)
    half = Z / (1 + weight) * sqrt(share * (1 - share) / of + weight / (4 * of))
    return max(centre - half, 0.0), min(centre + half, 1.0)


def quantiles(values: Sequence[float]) -> dict[str, float]:
    """Least, 5 %, 50 %, 95 % and greatest of some values, straight between neighbours."""
    found = np.quantile(np.asarray(values, dtype=float), list(QUANTILES.values()))
    return dict(zip(QUANTILES, map(float, found), strict=True))
