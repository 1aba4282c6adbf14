"""The explorer's lines of text: head, F'_ior by torque, trials and advice."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rich.text import Text

from hdassist.explorer.asking import Known
from hdassist.explorer.compute import is_any_hole
from hdassist.explorer.state import Session
from hdassist.model.assumed import assumptions
from hdassist.model.unknown import unknowns
from hdassist.mounting.advice import Advice
from hdassist.mounting.positions import hole_words
from hdassist.report.blocks import Facts
from hdassist.report.report import Report
from hdassist.terminal.brief import proof
from hdassist.trials.advice import TrialAdvice
from hdassist.verdict import Verdict
from hdassist.visible import visible

VERDICT_STYLES = {Verdict.PASS: "green bold", Verdict.FAIL: "red bold", Verdict.INCONCLUSIVE: "yellow bold"}


def is_order_settled(advice: Advice | TrialAdvice) -> bool:
    """Whether an advice orders something: only then there is a card."""
    return advice.order != "none" if isinstance(advice, Advice) else advice.settled


def next_deg(advice: Advice | TrialAdvice) -> float | None:
    """The turn [deg] at which to measure next; None where it is settled."""
    if is_order_settled(advice):
        return None
    return advice.to_try[0].rotation_deg if isinstance(advice, Advice) else advice.to_measure_next[0]


def why_no_card(advice: Advice | TrialAdvice | None) -> str:
    """Why there is no card; empty where there is one."""
    if advice is None:
        return "nothing is ordered before it is proven"
    if is_order_settled(advice):
        return ""
    return "unknown inputs could change the order" if isinstance(advice, Advice) else "the trials do not settle it"


def head(session: Session) -> Text:
    """The drive, and how much of it is unknown, assumed and changed."""
    drive, line = session.drive, Text(no_wrap=True, overflow="ellipsis")
    line.append(visible(drive.name), "bold")
    line.append(f"  {drive.gears.z_g}/{drive.gears.z_b}  m {drive.gears.m:g} mm  {drive.mounting.fixed} fixed", "dim")
    if is_any_hole(drive):
        line.append("  PHASES UNKNOWN", "red")
    elif unknown := unknowns(drive):
        line.append(f"  {len(unknown)} unknown", "red")
    if assumed := assumptions(drive):
        line.append(f"  {len(assumed)} ranges assumed", "dim")
    if session.changes:
        line.append(f"  {len(session.changes)} changed", "green")
    return line


def headline(session: Session, known: Known, pinned: Known | None) -> Text:
    """F'_ior by torque as `check` has it, as it stands and in the best hole; an old answer is called so."""
    found = known.headline or (None if known.failed else known.old)
    if found is None:
        return Text("F'_ior: no answer" if known.failed else "F'_ior: computing …", "dim")
    is_old, advice = found is not known.headline, known.advice
    size = (
        f"5-50-95 %, {found.samples:.0f} samples{' …' * (not found.whole)}" if found.samples else "every state solved"
    )
    text = Text(f"F'_ior, arcsec, as it stands ({'old, computing …' if is_old else size})", "dim")
    behind = pinned.headline if pinned else None  # compared once both are whole: fewer samples differ by chance
    before = {row.M_g: row for row in behind.rows} if behind and behind.whole and found.whole else {}
    best_deg = advice.choice.chosen.rotation_deg if advice else 0.0
    place = known.curve.place(best_deg) if known.curve else None
    for k, row in enumerate(found.rows):
        text.append(f"\n{row.M_g:g} N·m {_values((row.p5, row.p50, row.p95))}", "dim" if is_old else "")
        if row.limit_arcsec is not None:
            kept = f": kept {100 * row.probability:.0f} %" if row.probability is not None else ""
            text.append(f", limit {row.limit_arcsec:g}{kept}, ").append(row.verdict, VERDICT_STYLES[row.verdict])
            text.append(f" ({row.margin_arcsec:+.2f}″ to the limit)", "dim")
        if row.M_g in before:
            text.append(f"; {'pinned' if session.pinned else 'preset'} {row.p50 - before[row.M_g].p50:+.2f}″", "cyan")
        if known.curve and advice and place:
            best = hole_words(best_deg, session.drive.mounting.holes)
            text.append(f"; best, {best}: {_values(known.curve.F_ior_arcsec[:, k, place].tolist())}", "green")
    return text


def _values(percentiles: Iterable[float]) -> str:
    """Percentiles [arcsec], or the one value that all of them are."""
    return " - ".join(f"{value:.2f}" for value in dict.fromkeys(percentiles)) + "″"


def stage(known: Known, of_trials: Known | None, busy: bool) -> str:
    """How sure the values over the holes are, and whether they become surer."""
    curve = of_trials.curve if of_trials else known.curve
    more = " …" if busy else ""
    return (
        "NO ANSWER"
        if known.failed
        else "COMPUTING …" * busy
        if curve is None
        else f"{curve.sure[curve.rotations_deg.index(0.0)]}{more}"
    )


def trials_text(session: Session) -> Text:
    """The trials so far, and how to add one."""
    if session.trials:
        return Text("  ".join(session.trials), "magenta")
    text = Text("none yet. ", "dim")
    text.append("t", "bold")
    return text.append(f" adds F'_ior measured at {session.trial_torque:g} N·m in a position", "dim")


def advice_text(known: Known, of_trials: Known | None, any_hole: bool) -> Text:
    """The order with its reasons, or why there is none yet; below it what the pages of it and of `check` note."""
    here, text, notes = of_trials or known, Text(), []
    if failed := here.failed or known.failed:
        text.append(visible(failed.message), "red")
        notes.append(failed.hint)
    elif here.report and here.advice:
        text.append(visible(" ".join(here.report.why)), "bold" * is_order_settled(here.advice))
        why = why_no_card(here.advice)
        text.append(f"\n{f'no card: {why}' if why else 'c writes the card'}", "dim")
        notes += report_notes(here.report)
    elif of_trials is not None:
        text.append("Weighing the trials …", "dim")
    elif any_hole:
        text.append("Directions are not known: any hole may be the best one. Measure in three holes (t).")
    else:
        text.append("Computing: nothing is ordered before it is proven …", "dim")
    if known.headline and known.headline.report:
        notes += report_notes(known.headline.report)
    return text.append(visible("".join(f"\n{note}" for note in dict.fromkeys(notes))), "dim")


def report_notes(report: Report) -> Iterator[str]:
    """The labelled facts of a report's page, its warnings and proof; not the command to type next."""
    for block in report.blocks:
        if isinstance(block, Facts):
            yield from (f"{label}: {text}" for label, text in block.rows if label != "next")
    yield from report.warnings
    if report.certificate:
        yield f"proof of {report.command}: {proof(report.certificate, report.cross_checks)}"
