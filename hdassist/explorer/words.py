"""The explorer's lines of text: head, F'_ior by torque, trials and advice."""

from __future__ import annotations

from rich.text import Text

from hdassist.explorer.asking import Known
from hdassist.explorer.compute import ErrorRange, Headline, is_any_hole
from hdassist.explorer.state import Session
from hdassist.model.assumed import assumptions
from hdassist.model.unknown import unknowns
from hdassist.mounting import page as mount_page
from hdassist.mounting.advice import Advice
from hdassist.mounting.positions import hole_of
from hdassist.terminal.texts import texts
from hdassist.trials import page as trials_page
from hdassist.trials.advice import TrialAdvice
from hdassist.verdict import Verdict
from hdassist.visible import visible

VERDICTS = {Verdict.PASS: "green bold", Verdict.FAIL: "red bold", Verdict.INCONCLUSIVE: "yellow bold"}


def where(rotation_deg: float, holes: int) -> str:
    """A position in few letters: h4, or its angle."""
    hole = hole_of(rotation_deg, holes)
    return f"{rotation_deg:g}°" if hole is None else f"h{hole}"


def is_settled(advice: Advice | TrialAdvice) -> bool:
    """Whether an advice orders something: only then there is a card."""
    return advice.order != "none" if isinstance(advice, Advice) else advice.settled


def best_deg(advice: Advice | TrialAdvice) -> float:
    """The turn [deg] at which the wheel would be best."""
    return advice.chosen.rotation_deg if isinstance(advice, Advice) else advice.losses.chosen[0]


def next_deg(advice: Advice | TrialAdvice) -> float | None:
    """The turn [deg] at which to measure next; None where it is settled."""
    if is_settled(advice):
        return None
    return advice.to_try[0].rotation_deg if isinstance(advice, Advice) else advice.to_measure_next[0]


def why_no_card(advice: Advice | TrialAdvice | None) -> str:
    """Why there is no card; empty where there is one."""
    if advice is None:
        return "nothing is ordered before it is proven"
    if is_settled(advice):
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
    found, text = known.headline or known.old, Text()
    if found is None:
        return Text("F'_ior: no answer" if known.failed else "F'_ior: computing …", "dim")
    state = "old, computing …" if found is not known.headline else _samples(found)
    text.append(f"F'_ior, arcsec, as it stands ({state})", "dim")
    before = {row.M_g: row for row in pinned.headline.rows} if pinned and pinned.headline else {}
    for k, row in enumerate(found.rows):
        text.append(f"\n{error_words(row)}", "dim" if found is not known.headline else "")
        if row.limit_arcsec is not None:
            text.append(f", {row.verdict}", VERDICTS[row.verdict])
            text.append(f" ({row.margin_arcsec:+.2f}″ to the limit)", "dim")
        if row.M_g in before:
            text.append(f"; {'pinned' if session.pinned else 'preset'} {row.p50 - before[row.M_g].p50:+.2f}″", "cyan")
        if (advice := known.advice) and known.curve and (place := known.curve.place(best_deg(advice))):
            there = " - ".join(
                f"{value:.2f}" for value in dict.fromkeys(known.curve.F_ior_arcsec[:, k, place].tolist())
            )
            text.append(f"; best, {where(best_deg(advice), session.drive.mounting.holes)}: {there}″", "green")
    return text


def _samples(found: Headline) -> str:
    if not found.samples:
        return "every state solved"
    return f"5-50-95 %, {found.samples:.0f} samples{' …' * (not found.whole)}"


def error_words(row: ErrorRange) -> str:
    """F'_ior at a torque, with its limit and the probability of keeping it."""
    values = dict.fromkeys((row.p5, row.p50, row.p95))
    words = f"{row.M_g:g} N·m {' - '.join(f'{value:.2f}' for value in values)}″"
    kept = f": kept {100 * row.probability:.0f} %" if row.probability is not None else ""
    return words if row.limit_arcsec is None else f"{words}, limit {row.limit_arcsec:g}{kept}"


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
    """The order with its reasons, or why there is none yet; below it the notes of `check`."""
    text, here = Text(), of_trials or known
    if failed := here.failed or known.failed:
        text.append(visible(failed.message), "red")
        text.append(visible(f"\n{failed.hint}"), "dim")
    elif advice := here.advice:
        words = mount_page.what_to_do(advice) if isinstance(advice, Advice) else trials_page.instruction(advice)
        text.append(visible(words), "bold" if is_settled(advice) else "")
        why = why_no_card(advice)
        text.append(f"\n{f'no card: {why}' if why else 'c writes the card'}", "dim")
        if isinstance(advice, Advice):
            lines = [f"{label}: {fact}" for label, fact in mount_page.gain_lines(advice) if fact]
            warnings = mount_page.warnings(advice)
        else:
            lines = [f"P(good) {advice.losses.chosen[1]:.0%}, {advice.needed:.0%} wanted"]
            warnings = tuple(trials_page.warnings(advice, texts()))
        text.append("".join(f"\n{visible(line)}" for line in lines), "dim")
        text.append("".join(f"\n{visible(line)}" for line in warnings), "yellow")
    elif of_trials is not None:
        text.append("Weighing the trials …", "dim")
    elif any_hole:
        text.append("Directions are not known: any hole may be the best one. Measure in three holes (t).")
    else:
        text.append("Computing: nothing is ordered before it is proven …", "dim")
    if known.headline:
        text.append("".join(f"\n{visible(line)}" for line in known.headline.notes), "dim")
    return text
