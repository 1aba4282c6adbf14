"""The explorer's lines of text: head, F'_ior by torque, trials and advice."""

from __future__ import annotations

from collections.abc import Iterator

from rich.table import Table as RichTable
from rich.text import Text

from hdassist.design.check import OperatingPoint
from hdassist.explorer.asking import Known
from hdassist.explorer.compute import is_any_hole, typical_of
from hdassist.explorer.panes import INK, torque_style
from hdassist.explorer.state import Session
from hdassist.model.assumed import assumptions
from hdassist.model.unknown import unknowns
from hdassist.mounting.advice import Advice
from hdassist.mounting.positions import bare
from hdassist.pages.check import F_ior_table
from hdassist.report.blocks import Facts, Lines
from hdassist.report.report import Report
from hdassist.terminal.brief import proof
from hdassist.terminal.influence_words import named
from hdassist.verdict import Verdict
from hdassist.visible import visible

VERDICT_STYLES: dict[str, str] = {
    Verdict.PASS: f"{INK[3]} bold",
    Verdict.FAIL: "red bold",
    Verdict.INCONCLUSIVE: f"{INK[1]} bold",
}


def why_no_card(report: Report | None) -> str:
    """Why there is no card of an advice; empty where there is one."""
    return "" if report and not report.exit_code else "nothing is ordered" if report else "nothing is proven yet"


def head(session: Session) -> Text:
    """The drive, how much of it is unknown, assumed and changed, and what it is compared with."""
    drive, line = session.drive, Text(no_wrap=True, overflow="ellipsis")
    line.append(visible(drive.name), "bold")
    line.append(f"  {drive.gears.z_g}/{drive.gears.z_b}  {drive.mounting.fixed} wheel fixed", "dim")
    counts = {"unknown": unknowns(drive), "assumed": assumptions(drive), "changed": session.changes}
    line.append("".join(f"  {len(found)} {word}" for word, found in counts.items() if found), INK[3])
    more = len({*session.pinned.origin.overrides} - {*session.source.overrides})
    line.append(f"  vs {visible(session.pinned.name)}{f' with {more} changed' * (more > 0)}", INK[2])
    return line.append("  x_b keeps clearance" * session.keeps_clearance, INK[1])


def headline(session: Session, known: Known, pinned: Known | None, torque: int) -> RichTable | Text:
    """F'_ior by torque as `check` has it, as it stands and in the best hole.

    Arguments: session; known, of it; pinned, of what it is compared with; torque, the place of the one to mark. Before
    the answer is whole a typical drive, as it was and is, stands beside the old one.
    """
    found, whole = known.check or known.old, known.whole
    if known.failed or not found:
        return Text("F'_ior: no answer" if known.failed else "F'_ior: computing …", "dim")
    page = F_ior_table(found)
    columns = dict(zip(page.heads, map(list, zip(*page.rows, strict=True)), strict=True))
    del columns["self error"]
    if known.first and known.old and not whole:
        both = zip(typical_of(known.old)[1], known.first.F_ior_arcsec, strict=True)
        columns["typical drive"] = [f"{before:.2f} → {now:.2f}" for before, now in both]
    if "limit" in columns:
        held = [(point.limit_arcsec, point.held_arcsec, point.probability) for point in found.points]
        columns["margin"] = [f"{limit - ends[1]:+.2f}" if limit and ends else "" for limit, ends, _ in held]
        columns["kept"] = [f"{100 * kept.value:.0f} %" if kept else "" for _, _, kept in held]
        columns["verdict"] = [f"[{VERDICT_STYLES.get(word, 'dim')}]{word}[/]" for word in columns.pop("verdict")]
    if whole and pinned and pinned.whole and len(pinned.whole.points) == len(found.points):
        both = zip(map(middle_of, found.points), map(middle_of, pinned.whole.points), strict=True)
        columns["change"] = [f"[{INK[0]}]{now - before:+.2f}[/]" for now, before in both]
    best_deg = known.advice.chosen.rotation_deg if isinstance(known.advice, Advice) else 0.0
    if best_deg and known.curve and not is_any_hole(session.drive):
        hole, place = bare(best_deg, session.drive.mounting.holes), known.curve.place(best_deg)
        columns[f"best: {hole}"] = [f"[{INK[3]}]{value:.2f}[/]" for value in known.curve.F_ior_arcsec[1, :, place]]
    state = f"{found.samples.effective:.0f} samples" if found.samples else "every state"
    state = f"{'old' if found is not known.check else state}{'' if whole else ' …'}"
    table = RichTable(box=None, padding=(0, 1, 0, 0), header_style="dim")
    for name in (state, *list(columns)[1:]):
        table.add_column(name, justify="right", no_wrap=True)
    for k, (M_g, *cells) in enumerate(zip(*columns.values(), strict=True)):
        table.add_row(f"[{torque_style(k)}]{'▸' if k == torque else ''}{M_g} N·m[/]", *cells)
    return table


def middle_of(point: OperatingPoint) -> float:
    """The median of F'_ior [arcsec], or its value where all is known."""
    return point.belief.p50 if point.belief else point.error.F_ior_arcsec


def advice_text(session: Session, known: Known, of_trials: Known | None) -> Text:
    """The order with its reasons, or why there is none yet; below it the trials, and what the page of it notes."""
    here, text = of_trials or known, Text()
    if failed := here.failed or known.failed:
        text.append(visible(failed.message), "red").append(f"\n{visible(failed.hint)}")
    elif here.report and here.advice:
        why = why_no_card(here.report)
        text.append(visible(" ".join(here.report.why)), "" if why else "bold")
        text.append(f"\n{f'no card: {why}' if why else 'c writes the card'}", "dim")
    else:
        text.append("Nothing is ordered before it is proven …", "dim")
    trials = "  ".join(session.trials) or f"t adds F'_ior measured at {session.trial_torque:g} N·m in a position"
    text.append(f"\ntrials: {trials}", INK[2])
    return text.append(visible("".join(f"\n{note}" for note in report_notes(here.report))), "dim")


def next_text(advice: Text, known: Known) -> Text:
    """The order in a line, and in another one what to measure first with what that brings."""
    text = Text(advice.plain.partition("\n")[0], no_wrap=True, overflow="ellipsis")
    gains = why_blocks(known)[1].lines if known.whole and known.whole.to_measure else ()
    return text.append(f"\nmeasure next: {'; '.join(gains[:2])}" * bool(gains))


def why_blocks(known: Known) -> tuple[Lines, ...]:
    """Influences on F'_ior with their shares, measurements with what each of them brings, and warnings."""
    if not (found := known.whole):
        return (Lines("", ("computing …",)),)
    point = found.points[found.least_sure]
    gain = "less spread" if point.limit_arcsec is None else "more sure"
    shares = (f"{100 * each.share:3.0f} % {named(each.group)}" for each in found.influences)
    gains = (f"{100 * each.gain:3.0f} % {gain}: {named(each.measured)}" for each in found.to_measure)
    return (
        Lines(f"share of the variance of ln F'_ior at {point.M_g:g} N·m", tuple(shares) or ("no field stands out",)),
        Lines("measure next, and what it brings", tuple(gains) or ("nothing that brings more",)),
        Lines("", tuple(report_notes(known.page))),
    )


def report_notes(report: Report | None) -> Iterator[str]:
    """The labelled facts of a report's page, its warnings and proof; not the command to type next."""
    for block in report.blocks if report else ():
        if isinstance(block, Facts):
            yield from (f"{label}: {text}" for label, text in block.rows if label != "next")
    if report:
        yield from (*report.warnings, f"proof of {report.command}: {proof(report.certificate, report.cross_checks)}")
