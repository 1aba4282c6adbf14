"""The explorer's lines of text: head, F'_ior by torque, and advice."""

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
from hdassist.verdict import Verdict
from hdassist.visible import visible

VERDICT_STYLES = {Verdict.PASS: "green bold", Verdict.FAIL: "red bold", Verdict.INCONCLUSIVE: "yellow bold"}


def next_deg(advice: Advice) -> float | None:
    """The turn [deg] at which to measure next; None where a position is ordered."""
    return advice.to_try[0].rotation_deg if advice.order == "none" else None


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


def headline(session: Session, known: Known, of_preset: Known | None) -> Text:
    """F'_ior by torque as `check` has it, as it stands and in the best hole."""
    found = known.headline
    if found is None:
        return Text("F'_ior: no answer" if known.failed else "F'_ior: computing …", "dim")
    advice = known.advice
    size = (
        f"5-50-95 %, {found.samples:.0f} samples{' …' * (not found.whole)}" if found.samples else "every state solved"
    )
    text = Text(f"F'_ior, arcsec, as it stands ({size})", "dim")
    before = {row.M_g: row for row in of_preset.headline.rows} if of_preset and of_preset.headline else {}
    best_deg = advice.choice.chosen.rotation_deg if advice else 0.0
    place = known.curve.place(best_deg) if known.curve else None
    for k, row in enumerate(found.rows):
        text.append(f"\n{row.M_g:g} N·m {_values((row.p5, row.p50, row.p95))}")
        if row.limit_arcsec is not None:
            kept = f": kept {100 * row.probability:.0f} %" if row.probability is not None else ""
            text.append(f", limit {row.limit_arcsec:g}{kept}, ").append(row.verdict, VERDICT_STYLES[row.verdict])
            text.append(f" ({row.margin_arcsec:+.2f}″ to the limit)", "dim")
        if row.M_g in before:
            text.append(f"; preset {row.p50 - before[row.M_g].p50:+.2f}″", "cyan")
        if known.curve and advice and place:
            best = hole_words(best_deg, session.drive.mounting.holes)
            text.append(f"; best, {best}: {_values(known.curve.F_ior_arcsec[:, k, place].tolist())}", "green")
    return text


def _values(percentiles: Iterable[float]) -> str:
    """Percentiles [arcsec], or the one value that all of them are."""
    return " - ".join(f"{value:.2f}" for value in dict.fromkeys(percentiles)) + "″"


def stage(known: Known, busy: bool) -> str:
    """How sure the values over the holes are, and whether they become surer."""
    if known.failed:
        return "NO ANSWER"
    if known.curve is None:
        return "COMPUTING …" * busy
    return f"{known.curve.sure[known.curve.rotations_deg.index(0.0)]}{' …' * busy}"


def advice_text(known: Known, any_hole: bool) -> Text:
    """The order with its reasons, or why there is none yet; below it what the pages of `mount` and `check` note."""
    text, notes = Text(), []
    if known.failed:
        text.append(visible(known.failed.message), "red")
        notes.append(known.failed.hint)
    elif known.report and known.advice:
        text.append(visible(" ".join(known.report.why)), "bold" * (known.advice.order != "none"))
        notes += report_notes(known.report)
    elif any_hole:
        text.append("Directions are not known: any hole may be the best one. Measure in three holes: hdassist trials.")
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
