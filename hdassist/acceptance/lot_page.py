"""A lot for people: a line for each drive, and a summary; and as one JSON object."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.acceptance.answer import Answer
from hdassist.acceptance.answer import to_json as answer_json
from hdassist.acceptance.checks import check_of
from hdassist.acceptance.decision import Decision
from hdassist.acceptance.limits import Limit
from hdassist.acceptance.lot import Lot
from hdassist.acceptance.lot_summary import QUANTILES, VERDICTS, summary
from hdassist.acceptance.page import bound, how_to_decide, number, sentence
from hdassist.preset.yamltext import shown
from hdassist.terminal.answers import together
from hdassist.terminal.console import Style, table
from hdassist.verdict import SEVERITY
from hdassist.version import __version__

HEADINGS = ("values", "least", "5 %", "50 %", "95 %", "greatest", "limit")
WIDE = 80  # columns that the table of values needs


def line(answer: Answer, width: int) -> str:
    """One drive: serial, verdict, and the check that decides; width: that of the longest serial."""
    start = f"{title(answer):<{width}}  {answer.status:<12}"
    if answer.error is None:
        return f"{start}  {sentence(_decisive(answer.checks))}"
    first, *more = answer.error.message.splitlines()
    return f"{start}  {first}" + (f" (and {len(more)} more)" if more else "")


def title(answer: Answer) -> str:
    """What a drive is called on a line: its serial, whatever it has of control characters escaped."""
    name = answer.serial or answer.preset.name
    return shown(name, len(name))


def _decisive(checks: Sequence[Decision]) -> Decision:
    """The check that decides: of the worst verdict, the one with the least room for its limit."""
    return min(checks, key=lambda check: (SEVERITY.index(check.verdict), (check.margin or 0.0) / check.limit))


def render(lot: Lot, answers: Sequence[Answer], style: Style) -> RenderableType:
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
    lines = [f"left out of it: {part} values of part of the cycle, or none"] * bool(part)
    remarks = Counter(code for answer in answers for code in {remark.code for remark in answer.remarks})
    lines += [f"remark {code}: {_drives(remarks[code])}" for code in sorted(remarks)]
    checks = [check for answer in answers for check in answer.checks if check.verdict in VERDICTS[1:]]
    codes = {check.code for check in checks if not how_to_decide(check)}
    close = {f"{check.held_against.label}: measure it" for check in checks if how_to_decide(check)}
    lines += [f"not settled by its prediction, {words}" for words in sorted(close)]
    lines += [f"what to do: hdassist explain {' '.join(sorted(codes))}"] * bool(codes)
    digest = f", sha256 {lot.sha256[:12]}" if lot.sha256 else ""
    lines.append(f"hdassist {__version__}, {lot.file}{digest}; all else stands in --json or --jsonl")
    return Group(*parts, *(Text(style.text(line)) for line in lines))


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
    limit = Limit(check_of(row["code"]), row["limit_greatest"], row["M_g_Nm"], row["per_cam_rev"])
    ends = dict.fromkeys(f"{row[key]:.6g}" for key in ("limit_least", "limit_greatest"))
    found = ["-" if row[key] is None else number(row[key], limit) for key in QUANTILES]
    name = f"{row['preset']}: " if several else ""
    what = f"{name}{limit.label}, {row['unit']}, {row['basis'] or 'no value'}"
    return [what, str(row["values"]), *found, f"{bound(limit)[0]} {' to '.join(ends)}"]


def _drives(count: int) -> str:
    return f"{count} drive{'s' * (count != 1)}"


def to_json(lot: Lot, answers: Sequence[Answer]) -> dict[str, Any]:
    """The lot as one JSON object: every answer, and what they say together."""
    return {
        **together("accept", [answer_json(answer) for answer in answers]),
        "lot": {"name": lot.file, "sha256": lot.sha256, "rows": len(lot.rows), "notes": list(lot.notes)},
        "summary": summary(answers),
    }
