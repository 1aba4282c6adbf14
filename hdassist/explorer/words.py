"""The explorer's lines of text: its head, the trials, and the advice."""

from __future__ import annotations

from rich.text import Text

from hdassist.explorer.answers import Curve, Sure, TorqueBelief
from hdassist.explorer.known import Known
from hdassist.explorer.pictures import Inks
from hdassist.explorer.state import Session
from hdassist.mounting.positions import hole_of
from hdassist.visible import visible


def where(rotation_deg: float, holes: int) -> str:
    """A position in few letters: h4, or its angle."""
    hole = hole_of(rotation_deg, holes)
    return f"{rotation_deg:g}°" if hole is None else f"h{hole}"


def head(session: Session, known: Known, inks: Inks) -> Text:
    """The drive, what is not known and assumed of it, and how far the computing has come."""
    drive, facts = session.drive, known.facts
    gears = drive.gears
    line = Text(no_wrap=True, overflow="ellipsis")
    line.append(visible(drive.name), f"{inks.text} bold")
    line.append(f"  {gears.z_g}/{gears.z_b}  m {gears.m:g} mm  {drive.mounting.fixed} fixed", inks.muted)
    if facts and facts.any_hole:
        line.append("  PHASES UNKNOWN", inks.limit)
    elif facts and facts.unknown:
        line.append(f"  {len(facts.unknown)} unknown", inks.limit)
    if facts and facts.assumed:
        line.append(f"  {facts.assumed} ranges assumed", inks.muted)
    if session.changes:
        line.append(f"  {len(session.changes)} changed", inks.best)
    return line


def basis(known: Known, of_trials: Known | None) -> str:
    """What the curve rests on, in its title; empty where all is known."""
    facts = known.facts if known.curve else None
    if of_trials and of_trials.advised:
        return " · 90 % band"
    return (
        " · unknown as 0" if facts and facts.unknown else " · the preset's own numbers" if facts and facts.open_ else ""
    )


def belief(known: Known) -> list[str]:
    """F'_ior over all that is not known exactly, a line a torque; what is old is said to be."""
    found = known.belief or known.old
    if found is None or not (found.rows or found.failed):
        return []
    if found.failed:
        return [f"no range of F'_ior: {visible(found.failed)}"]
    state = (
        "old, computing …" if found is not known.belief else f"{found.samples:.0f} samples{' …' * (not found.whole)}"
    )
    return [f"F'_ior over all that is not known exactly, 5-50-95 % ({state})", *map(_row, found.rows)]


def _row(row: TorqueBelief) -> str:
    words = f"{row.M_g:g} N·m {row.p5:.2f} - {row.p50:.2f} - {row.p95:.2f}″"
    if row.limit_arcsec is None or row.probability is None:
        return words
    return f"{words}, limit {row.limit_arcsec:g}: kept {100 * row.probability:.0f} %, {row.verdict}"


def stage(known: Known, of_trials: Known | None, busy: bool, inks: Inks) -> Text:
    """How sure the curve is by now, and whether it is being made surer."""
    if known.failed:
        return Text("NO ANSWER", inks.limit)
    if of_trials and of_trials.advised:
        return Text("FITTED", inks.best)
    curve, advised = known.curve, known.advised
    if known.facts and known.facts.any_hole:
        return Text("NO ORDER", inks.limit)
    if curve is None:
        return Text("computing", inks.muted)
    if advised and not busy:
        return Text("PROVEN" if Sure.PROVEN in {p.sure for p in curve.places} else f"{curve.sure}", inks.best)
    return Text.assemble(
        (f"{curve.sure}", inks.text), (" proving …" if curve.sure is Sure.REFINED else " …", inks.muted)
    )


def trials_text(session: Session, trial_torque: float, inks: Inks) -> Text:
    """The trials so far, and how to add one."""
    text = Text()
    for k, trial in enumerate(session.trials):
        place, _, value = trial.partition(":")
        text.append("  " if k else "")
        text.append(f"{place}:", inks.muted)
        text.append(value, inks.trial)
    if not session.trials:
        text.append("none yet. ", inks.muted)
        text.append("t", f"{inks.text} bold")
        text.append(f" adds F'_ior measured at {trial_torque:g} N·m in a position", inks.muted)
    return text


def advice_text(session: Session, known: Known, of_trials: Known | None, inks: Inks) -> Text:
    """What to do, how sure that is, and what it rests on."""
    text = Text()
    here = of_trials or known
    if here.failed:
        text.append(visible(here.failed.message), inks.limit)
        if here.failed.hint:
            text.append(f"\n{visible(here.failed.hint)}", inks.muted)
    elif advised := here.advised:
        text.append(visible(advised.words), f"{inks.text} bold" if advised.settled else inks.text)
        first = "c writes the card" if advised.settled else f"no card: {advised.why_not}"
        text.append(f"\n{visible(' · '.join([first, *advised.reasons]))}", inks.muted)
        for warning in advised.warnings:
            text.append(f"\n{visible(warning)}", inks.trial)
    elif of_trials is not None:
        by_now = f"{of_trials.share:.0%} of the tables, after them what is assumed"
        text.append(f"Weighing the trials … {by_now}", inks.muted)
    elif known.facts and known.facts.any_hole:
        text.append("Directions are not known: any hole may be the best one. Measure in three holes (t).", inks.text)
    elif known.curve and len(known.curve.places) > 1:
        text.append_text(_preview(session, known, known.curve, inks))
    else:
        text.append("Computing …", inks.muted)
    if known.curve and of_trials is None and not here.failed:
        text.append("".join(f"\n{line}" for line in belief(known)), inks.muted)
    return text


def _preview(session: Session, known: Known, curve: Curve, inks: Inks) -> Text:
    """What looks best by now; nothing is ordered from that."""
    best, now = curve.best, curve.places[0]
    if known.facts and known.facts.unknown:
        return Text("What is not known is taken as 0 so far; the order takes it in …", inks.text)
    if best is now:
        return Text(f"{curve.sure}: best where it stands, by now. No order before it is proven …", inks.text)
    gain = 1 - curve.merit(best)
    hole = where(best.rotation_deg, session.drive.mounting.holes)
    return Text(f"{curve.sure}: {hole} looks best, {gain:.0%} less than now. No order before it is proven …", inks.text)
