"""What F'_ior comes from and which tolerance to tighten first: a line and two tables, JSON, CSV."""

from __future__ import annotations

from dataclasses import asdict

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.json_parts import Json, influence_objects, measure_objects
from hdassist.pages.tolerance import law_warnings, paragraphs
from hdassist.terminal.answers import envelope
from hdassist.terminal.brief import again
from hdassist.terminal.console import Style, table
from hdassist.terminal.influence_words import measure_words, named
from hdassist.terminal.runs import Answer, CsvTable
from hdassist.tolerance.production import TIGHTER_STEP
from hdassist.tolerance.sensitivity import Sensitivities

BAR = 10  # columns of the longest bar
LISTED = 8  # fields of a table


def sensitivity_answer(found: Sensitivities) -> Answer:
    """What there is to say of a drive's sensitivities."""
    return Answer(
        to_json=lambda: sensitivity_json(found),
        page=lambda style: sensitivity_page(found, style),
        summary_line=lambda: sensitivity_summary(found),
        figures=lambda: sensitivity_figures(found),
        about=found.law.drive.name,
        warnings=law_warnings(found.law),
        proof=sensitivity_proof(found),
    )


def sensitivity_summary(found: Sensitivities) -> str:
    """The tolerance to tighten first and what a step brings, or what to measure before."""
    first, largest, M_g = found.first, found.largest, found.samples.torques[found.worst]
    at = f"the 95th percentile of F'_ior at {M_g:g} N·m"
    measure = f"measure {named(largest.group)} first, {largest.share:.0%} of the spread" if largest else ""
    if found.is_worth_tightening:
        return (
            f"tighten first: {named(first.path)}: {1 - TIGHTER_STEP:.0%} tighter takes {first.gain:.2f} arcsec "
            f"({first.now - first.high:.2f}-{first.now - first.low:.2f}) off {at}, {first.now:.2f}"
        )
    tolerances = {way.path for way in found.tightened[found.worst]}
    hint = measure if largest and largest.group not in tolerances else ""
    return (
        f"no tolerance {1 - TIGHTER_STEP:.0%} tighter moves {at}, {first.now:.2f}, by more than "
        f"{max(first.gain, 0):.2f} arcsec"
        + ("; " + hint if hint else f" for certain: more drives (-n {4 * len(found.samples.weights)}) tell")
    )


def sensitivity_page(found: Sensitivities, style: Style) -> RenderableType:
    """The answer, a table a torque, what to measure, and the next command."""
    drive, samples = found.law.drive, found.samples
    head = f"{drive.name}: {len(samples.weights)} random drives, each of a design of its own, seed {samples.seed}"
    tables = [_table(found, t, style) for t in range(len(samples.torques))]
    measure = measure_words(found.to_measure, False)
    below = [sensitivity_proof(found), *[f"to measure: {measure}"] * bool(measure), f"next: {again('allocate', drive)}"]
    return paragraphs(
        style, head, Text(style.text(sensitivity_summary(found)), style="bold"), *tables, "\n".join(below)
    )


def sensitivity_proof(found: Sensitivities) -> str:
    """What stands behind the numbers, in a line."""
    return f"proof: {found.states} states of {found.drives} drives, worst residual {found.max_residual:.0e}"


def _table(found: Sensitivities, torque: int, style: Style) -> Table:
    """Shares of the variance of ln F'_ior by field, and what a tighter tolerance takes off, the greatest first."""
    shares = {each.group: each.share for each in found.influences[torque]}
    ways = {way.path: way for way in found.tightened[torque]}
    M_g = found.samples.torques[torque]
    grid = table(
        style, f"at {M_g:g} N·m: share of the variance of ln F'_ior; 95th percentile, {1 - TIGHTER_STEP:.0%} tighter"
    )
    grid.add_column(style.text("field"), no_wrap=True)
    grid.add_column(style.text("share, %"), justify="right", no_wrap=True)
    grid.add_column("", no_wrap=True)
    grid.add_column(style.text("arcsec"), justify="right", no_wrap=True)
    most = max(shares.values(), default=1.0)
    for path in sorted(shares | ways, key=lambda p: -shares.get(p, 0.0))[:LISTED]:
        way, share = ways.get(path), shares.get(path, 0.0)
        bar = ("#" if style.ascii else "█") * round(max(share, 0) / most * BAR)
        then = f"{way.now:.2f} > {way.then:.2f}" + ("" if way.proven else " or more") if way else "-"
        grid.add_row(*map(style.text, (path, f"{100 * share:.0f}" if path in shares else "-", bar, then)))
    return grid


def sensitivity_json(found: Sensitivities) -> Json:
    """The sensitivities as a JSON object."""
    samples = found.samples
    return {
        **envelope("sensitivity", found.law.drive, 0, law_warnings(found.law)),
        "operating_points": [
            {
                "M_g_Nm": M_g,
                "F_ior_arcsec": {f"p{p}": samples.percentile(p / 100, t) for p in (5, 50, 95)},
                "influence": influence_objects(found.influences[t]),
                "tighter": [
                    {"field" if key == "path" else key: value for key, value in asdict(way).items()}
                    for way in found.tightened[t]
                ],
            }
            for t, M_g in enumerate(samples.torques)
        ],
        "tighter_factor": TIGHTER_STEP,
        "tighten_first": found.first.path if found.is_worth_tightening else None,
        "to_measure": measure_objects(found.to_measure),
        "samples": {"effective": samples.effective, "draws": samples.draws, "seed": samples.seed},
        "drives": found.drives,
        "seed": samples.seed,
        "certificate": {"states": found.states, "max_residual": found.max_residual},
    }


def sensitivity_figures(found: Sensitivities) -> CsvTable:
    """One row per torque and field."""
    rows: list[list[object]] = []
    for t, M_g in enumerate(found.samples.torques):
        shares = {each.group: each.share for each in found.influences[t]}
        ways = {way.path: way for way in found.tightened[t]}
        for path in dict.fromkeys((*shares, *ways)):
            way = ways.get(path)
            rows.append([found.law.drive.name, M_g, path, shares.get(path), way and way.now, way and way.then])
    return ["preset", "M_g_Nm", "field", "share", "now_arcsec", "tighter_arcsec"], rows
