"""The explorer's lines of text: head, F'_ior by torque, trials and advice."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from rich.table import Table as RichTable
from rich.text import Text

from hdassist.belief.prior import prior_of
from hdassist.design.check import OperatingPoint
from hdassist.explorer.asking import Known
from hdassist.explorer.compute import is_any_hole, typical_of
from hdassist.explorer.panes import INK, MARKS, torque_style
from hdassist.explorer.state import Session
from hdassist.mounting.positions import bare
from hdassist.pages.check import F_ior_table, steps_tables
from hdassist.plaintext import visible
from hdassist.report import Block, Curve, Facts, Lines, Report, Table
from hdassist.terminal.words import named, proof
from hdassist.verdict import Verdict

VERDICT_STYLES: dict[str, str] = {
    Verdict.PASS: f"{INK[3]} bold",
    Verdict.FAIL: "red bold",
    Verdict.INCONCLUSIVE: f"{INK[1]} bold",
}


def why_no_card(report: Report | None) -> str:
    """Why there is no card of an advice; empty where there is one."""
    return "" if report else "nothing is proven yet"


def head(session: Session) -> Text:
    """The drive, how much of it is uncertain and changed, and the drive beside it."""
    drive, line = session.drive, Text(no_wrap=True, overflow="ellipsis")
    line.append(visible(drive.name), "bold")
    line.append(f"  {drive.gears.z_g}/{drive.gears.z_b}  {drive.mounting.fixed} wheel fixed", "dim")
    counts = {"uncertain": prior_of(drive).fields, "changed": session.changes}
    line.append("".join(f"  {len(found)} {word}" for word, found in counts.items() if found), INK[3])
    more = len({*session.pinned.origin.overrides} - {*session.source.overrides, session.torques})
    line.append(f"  vs {visible(session.pinned.name)}{f' with {more} changed' * (more > 0)}", INK[2])
    return line.append("  x_b keeps clearance" * session.keeps_clearance, INK[1])


def headline(session: Session, known: Known, pinned: Known | None, torque: int, width: int) -> RichTable | Text:
    """F'_ior by torque as `check` has it, as it stands and in the best hole; columns that have no room are left out.

    Arguments: session; known, of it; pinned, of the drive beside it; torque, the place of the one to mark; width,
    in characters. Before the answer is whole a typical drive, as it was and is, stands beside the old one.
    """
    found, whole = known.check or known.old, known.whole
    if not found or (known.failed and not known.check):
        return Text(f"F'_ior: {known.without}")
    page = F_ior_table(found)
    sure = f"{found.samples.effective:.0f} samples" if found.samples else "every state"
    state = f"{sure if found is known.check else 'old'}{'' if whole else ' …'}"
    torques = [f"[{torque_style(k)}]{'▸' * (k == torque)}{point.M_g:g} N·m[/]" for k, point in enumerate(found.points)]
    columns = {state: torques, **dict(zip(page.heads, map(list, zip(*page.rows, strict=True)), strict=True))}
    for name in ("self error", page.heads[0]):
        del columns[name]
    if known.first and known.old and not whole:
        both = zip(typical_of(known.old)[1], known.first.F_ior_arcsec, strict=True)
        columns["typical drive"] = [f"{before:.2f} → {now:.2f} {MARKS[known.first.sure]}" for before, now in both]
    if "limit" in columns:
        held = [(point.limit_arcsec, point.held_arcsec, point.probability) for point in found.points]
        verdicts = columns.pop("verdict")
        if found is known.check and not whole:
            verdicts = ["…"] * len(held)
        columns["verdict"] = [f"[{VERDICT_STYLES.get(word, 'dim')}]{word}[/]" for word in verdicts]
        columns["margin"] = [f"{limit - ends[1]:+.2f}" if limit and ends else "" for limit, ends, _ in held]
        columns["kept"] = [f"{100 * kept.value:.0f} %" if kept else "" for _, _, kept in held]
    if whole and pinned and pinned.whole:
        both = zip(map(middle_of, found.points), map(middle_of, pinned.whole.points), strict=True)
        columns["change"] = [f"[{INK[0]}]{now - before:+.2f}[/]" for now, before in both]
    best_deg = known.advice.choice.chosen.rotation_deg if known.advice else 0.0
    if best_deg and known.curve and not is_any_hole(session.drive):
        name, best = f"best: {bare(best_deg, session.drive.mounting.holes)}", known.curve.place(best_deg)
        columns[name] = [f"[{INK[3]}]{value:.2f}[/]" for value in known.curve.F_ior_arcsec[1, :, best]]
    widths = {name: 1 + max(Text.from_markup(cell).cell_len for cell in (name, *columns[name])) for name in columns}
    for name in reversed(widths):
        if sum(widths[name] for name in columns) > width:
            del columns[name]
    table = RichTable(box=None, padding=(0, 1, 0, 0), header_style="dim")
    for name in columns:
        table.add_column(name, justify="right", no_wrap=True)
    for cells in zip(*columns.values(), strict=True):
        table.add_row(*cells)
    return table


def middle_of(point: OperatingPoint) -> float:
    """The median of F'_ior [arcsec], or its value where all is known."""
    return point.F_ior_or_error


def order_words(known: Known) -> str:
    """The order with its reasons, or why there is none."""
    return " ".join(known.report.why) if known.report else known.without


def next_text(known: Known) -> str:
    """The order in a line, and in another one the first measurement with its gain."""
    gains = dict(facts_of(known.page).rows).get("measure", "")
    return visible(order_words(known).partition("\n")[0]) + f"\nmeasure next: {gains}" * bool(gains)


def turn_blocks(page: Report, name: str) -> Iterator[Block]:
    """The first cam turn of a page of `trace`, or its full cycle with its greatest orders."""
    for block in reversed(page.blocks):
        if isinstance(block, Curve) and name == "turn":
            first, words = block.x < 1, block.y_label.partition(":")[0]
            yield replace(block, x=block.x[first], y=block.y[first], y_label=words, over=0.0)
        elif name == "cycle" and not isinstance(block, Facts):
            yield block


def why_blocks(known: Known) -> tuple[Lines | Table | Facts, ...]:
    """Influences on F'_ior with their shares, what it would take, and other facts of check."""
    if not (found := known.whole):
        return (Lines("", (known.without,)),)
    point = found.points[found.least_sure]
    shares = (f"{100 * each.share:3.0f} % {named(each.group)}" for each in found.influences)
    return (
        *steps_tables(found),
        Lines(f"share of the variance of ln F'_ior at {point.M_g:g} N·m", tuple(shares) or ("no field stands out",)),
        facts_of(known.page, "influence", "measure"),
    )


def facts_of(report: Report | None, *left_out: str) -> Facts:
    """The labelled lines of a page, its warnings and proof, without some labels; not the command to type next."""
    if not report:
        return Facts(())
    rows = [row for block in (*report.blocks, *report.details) if isinstance(block, Facts) for row in block.rows]
    rows += [("warning", each) for each in report.warnings]
    rows.append(("proof", proof(report.certificate, report.cross_checks)))
    return Facts.of(row for row in rows if row[0] not in ("next", *left_out))
