"""A lot for people: a line for each drive, and a summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.acceptance.lot import Lot
from hdassist.acceptance.lot_figures import QUANTILE_KEYS, VERDICTS, asked, status, summary
from hdassist.acceptance.page import number
from hdassist.preset.yamltext import shown
from hdassist.terminal.console import Style, table
from hdassist.version import __version__

HEADINGS = ("values", "least", "5 %", "50 %", "95 %", "greatest", "limit")
WIDE = 80  # columns that the table of values needs


def line(answer: Mapping[str, Any], width: int) -> str:
    """One drive: serial, verdict, and the check that decides; width: that of the longest serial."""
    start = f"{title(answer):<{width}}  {status(answer):<12}"
    if "error" in answer:
        first, *more = answer["error"]["message"].splitlines()
        return f"{start}  {first}" + (f" (and {len(more)} more)" if more else "")
    return f"{start}  {sentence(_worst(answer['checks']))}"


def title(answer: Mapping[str, Any]) -> str:
    """What a drive is called on a line: its serial, whatever it has of control characters escaped."""
    name = answer["serial"] or answer["preset"]["name"]
    return shown(name, len(name))


def sentence(check: Mapping[str, Any]) -> str:
    """A check in words: value, uncertainty, limit, margin, how it is known."""
    what, unit = asked(check), check["unit"]
    limit = f"limit {'≤' if what.check.upper else '≥'} {what.limit:.6g}"
    if check["value"] is None:
        return f"{what.label}: no value, {limit} {unit}"
    at_least = "≥ " if check["extent"] == "at least" else ""
    spread = f" ± {number(check['expanded_uncertainty'], what)}" if check["expanded_uncertainty"] is not None else ""
    margin = number(check["margin"], what)
    value = f"{at_least}{number(check['value'], what)}{spread} {unit}"
    return f"{what.label}: {value}, {limit}, margin {margin}, {check['basis']}"


def _worst(checks: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """The check that decides: of the worst verdict, the one with the least room for its limit."""
    order = ("FAIL", "INCONCLUSIVE", "PASS")
    return min(checks, key=lambda c: (order.index(c["verdict"]), (c["margin"] or 0.0) / c["limit"]))


def render(lot: Lot, answers: Sequence[Mapping[str, Any]], style: Style) -> RenderableType:
    """Counts, yield, the spread of values, and what it rests on."""
    told = summary(answers)
    counts = [f"{n} {verdict}" for verdict, n in told["verdicts"].items() if n]
    counts += [f"{told['broken']} broken ({100 * told['broken_share']:.3g} %)"] * bool(told["broken"])
    parts: list[RenderableType] = [
        Text(style.text(f"{lot.file}: {_drives(told['drives'])}, {', '.join(counts)}"), style="bold")
    ]
    share = told["yield"]
    if share["with_verdict"]:
        low, high = (100 * end for end in share["interval_95"])
        parts.append(
            Text(style.text(f"yield: {share['passed']} of {share['with_verdict']} drives with a verdict, "
                           f"{100 * share['share']:.1f} % (95 % interval after Wilson: {low:.1f} to {high:.1f})"))
        )  # fmt: skip
        parts += [Text(""), _spread(told["checks"], style)]
        part = sum(row["of_part_only"] for row in told["checks"])
        if part:
            parts.append(Text(style.text(f"left out of it: {part} values of part of the cycle, or none")))
    codes = {c["code"] for a in answers for c in a.get("checks", ()) if c["verdict"] in VERDICTS[1:]}
    remarks = {said["code"] for answer in answers for said in answer.get("remarks", ())}
    for code in sorted(remarks):
        count = sum(any(said["code"] == code for said in answer.get("remarks", ())) for answer in answers)
        parts.append(Text(style.text(f"remark {code}: {_drives(count)}")))
    if codes:
        parts.append(Text(style.text(f"what to do: hdassist explain {' '.join(sorted(codes))}")))
    digest = f", sha256 {lot.sha256[:12]}" if lot.sha256 else ""
    parts.append(Text(style.text(f"hdassist {__version__}, {lot.file}{digest}; all else stands in --json or --jsonl")))
    return Group(*parts)


def _spread(rows: Sequence[Mapping[str, Any]], style: Style) -> RenderableType:
    """A table of values, or sentences where it does not fit."""
    several = len({row["preset"] for row in rows}) > 1
    cells = [[style.text(text) for text in _cells(row, several)] for row in rows]
    if style.width < WIDE:
        lines = [f"{row[0]}: " + ", ".join(map(" ".join, zip(HEADINGS, row[1:], strict=True))) for row in cells]
        return Text("\n".join(lines))
    grid = table(style)
    for words in ("check", *HEADINGS):
        grid.add_column(words, justify="left" if words == "check" else "right", no_wrap=words != "check")
    for row in cells:
        grid.add_row(*row)
    return grid


def _cells(row: Mapping[str, Any], several: bool) -> list[str]:
    """What a check is, and a cell for each of HEADINGS; several: whether the lot has drives of several presets."""
    what, unit = asked({**row, "limit": row["limit_greatest"]}), row["unit"]
    ends = dict.fromkeys(f"{row[key]:.6g}" for key in ("limit_least", "limit_greatest"))
    limit = ("≤ " if what.check.upper else "≥ ") + " to ".join(ends)
    found = ["-" if row[key] is None else number(row[key], what) for key in QUANTILE_KEYS]
    name = f"{row['preset']}: " if several else ""
    return [f"{name}{what.label}, {unit}, {row['basis'] or 'no value'}", str(row["values"]), *found, limit]


def _drives(count: int) -> str:
    return f"{count} drive{'s' * (count != 1)}"
