"""Yield and percentiles of random drives, as a table and a plot, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.belief.measure import MeasurementGain
from hdassist.belief.samples import Samples
from hdassist.json_parts import Json, measure_objects
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import unit_of
from hdassist.terminal.answers import envelope
from hdassist.terminal.brief import again
from hdassist.terminal.console import Style, table
from hdassist.terminal.influence_words import measure_words
from hdassist.terminal.plot import curve
from hdassist.terminal.runs import Answer, CsvTable
from hdassist.tolerance.law import RAYLEIGH_TAIL, ProductionLaw, TolerancedSize
from hdassist.tolerance.sensitivity import to_measure
from hdassist.tolerance.yields import YIELD_TAIL as ENDS
from hdassist.tolerance.yields import AtTorque, Summary, YieldBelief
from hdassist.verdict import Verdict

PERCENTILES = (("low", "5 %", 0.05), ("median", "median", 0.5), ("high", "95 %", 0.95))
LAW_WORDS = {"rayleigh": f"Rayleigh (tolerance = {RAYLEIGH_TAIL:g} standard deviations)"}


def tolerance_answer(
    law: ProductionLaw,
    seed: int,
    summary: Summary,
    samples: Samples | None,
    *,
    plots: bool,
    interrupted: bool = False,
) -> Answer:
    """What there is to say of random drives.

    Arguments: samples of the designs, None where they are one, or were not drawn now; plots, whether one is drawn;
    interrupted, before all were done.
    """
    code = 130 if interrupted else summary.verdict.exit_code
    drive = law.drive
    return Answer(
        to_json=lambda: tolerance_json(law, seed, summary, samples, code),
        page=lambda style: tolerance_page(law, seed, summary, samples, style, plots=plots),
        summary_line=lambda: tolerance_summary(summary),
        figures=lambda: tolerance_figures(drive, summary),
        about=drive.name,
        warnings=tolerance_warnings(law, summary),
        proof=tolerance_proof(summary),
        exit_code=code,
    )


def tolerance_warnings(law: ProductionLaw, summary: Summary) -> tuple[str, ...]:
    """What a reader should know beside the numbers."""
    refused = f"{len(summary.refused)} drives have no answer, and count both ways: {summary.reason}"
    return (*law_warnings(law), *[refused] * bool(summary.refused))


def law_warnings(law: ProductionLaw) -> tuple[str, ...]:
    """Warnings about a drive and about what its random drives are drawn from."""
    words = f"no tolerance given, drawn evenly as check draws them: {', '.join(law.not_given)}"
    return (*law.drive.origin.warnings, *[words] * bool(law.not_given))


def paragraphs(style: Style, *parts: RenderableType) -> RenderableType:
    """Texts and tables with a line between them."""
    made = [Text(style.text(part)) if isinstance(part, str) else part for part in parts]
    return Group(*(line for part in made for line in (part, Text(""))))


def tolerance_page(
    law: ProductionLaw, seed: int, summary: Summary, samples: Samples | None, style: Style, *, plots: bool = True
) -> RenderableType:
    """Yield and gain, a table of both ways to build, the distribution at the first torque."""
    drive = law.drive
    of = f" of {summary.design_count} designs" if law.shared else ""
    head = f"{drive.name}: {summary.count} random drives{of}, {_law_words(law)}, seed {seed}"
    below = [tolerance_proof(summary)]
    if summary.verdict is Verdict.INCONCLUSIVE:
        words = measure_words(_to_measure(law, summary, samples), False)
        below.append(f"to measure: {words}" if words else "more drives (-n) may tell")
    below.append(f"next: {again('sensitivity', drive)}")
    first = summary.points[0]
    has_plot = plots and np.ptp(_ways(first, summary)[-1][1]) > 0
    return paragraphs(
        style,
        Text(style.text(head), style="bold"),
        "\n".join(_verdict_lines(summary, law)),
        _table(summary, style),
        *([Text(_distribution(first, summary, style))] if has_plot else []),
        "\n".join(below),
    )


def tolerance_proof(summary: Summary) -> str:
    """What stands behind the numbers, in a line."""
    return (
        f"proof: every extreme is a solved state ({summary.states} states, worst residual {summary.max_residual:.0e})"
    )


def tolerance_summary(summary: Summary) -> str:
    """The answer alone: percentiles or yields."""
    if summary.has_limit:
        turned = f", {_yield_words(summary.yield_of(True))} with the wheel turned" if summary.positions > 1 else ""
        return f"yield {_yield_words(summary.yield_of(False))} as built{turned}, {summary.verdict}"
    return "\n".join(
        f"{p.M_g:g} N*m: 95 % of drives below {summary.percentile(p.as_built, 0.95).value:.2f} arcsec as built"
        + (f", {summary.percentile(p.best, 0.95).value:.2f} with the wheel turned" if summary.positions > 1 else "")
        for p in summary.points
    )


def tolerance_json(law: ProductionLaw, seed: int, summary: Summary, samples: Samples | None, exit_code: int) -> Json:
    """The random drives as a JSON object."""
    return {
        **envelope("tolerance", law.drive, exit_code, tolerance_warnings(law, summary)),
        "drives": summary.count,
        "designs": summary.design_count,
        "refused": len(summary.refused),
        "seed": seed,
        "method": "mc",
        "positions": summary.positions,
        "scatter": [
            {
                "field": f.path, "kind": f.law if isinstance(f, TolerancedSize) else f.distribution,
                "low": f.low, "high": f.high, "unit": unit_of(field_table()[f.path]),
                "shared": f in law.shared, "assumed": f.path in law.not_given,
            }
            for f in law.joint.fields
        ],
        "operating_points": [_point_object(point, summary) for point in summary.points],
        "yield": {
            name: _yield_object(summary.yield_of(best), summary.wanted)
            for name, best in (("as_built", False), ("best_position", True))
        }
        if summary.has_limit and summary.count
        else None,
        "yield_wanted": summary.wanted,
        "sure": summary.sure,
        "to_measure": measure_objects(_to_measure(law, summary, samples)),
        "certificate": {"states": summary.states, "max_residual": summary.max_residual},
        "verdict": str(summary.verdict),
    }  # fmt: skip


def tolerance_figures(drive: Drive, summary: Summary) -> CsvTable:
    """One row per torque and way to build."""
    rows = []
    for point in summary.points:
        for way, F_ior, held in _ways(point, summary):
            numbers = _F_ior_object(F_ior, summary)
            values = [numbers[f"{name}_arcsec"] for name in NAMES]
            rows.append([drive.name, point.M_g, way, *values, held.share if point.limit is not None else None])
    return ["preset", "M_g_Nm", "wheel", *(f"{name}_arcsec" for name in NAMES), "yield"], rows


NAMES = ("low", "median", "high", "worst", "mean")


def _verdict_lines(summary: Summary, law: ProductionLaw) -> Iterable[str]:
    if summary.has_limit:
        over = (
            f" ({100 * ENDS:.0f}-{100 - 100 * ENDS:.0f} % over what is not known of the design)" if law.shared else ""
        )
        words = f"yield as built {_yield_words(summary.yield_of(False))}"
        if summary.positions > 1:
            words += f"; with the wheel in its best position {_yield_words(summary.yield_of(True))}"
        yield words + over
    if summary.wanted is not None and summary.has_limit:
        how = ", each wheel in its best position" if summary.positions > 1 else ""
        found = summary.yield_of(True).probability(summary.wanted)
        within = f" ({found.low:.2f}-{found.high:.2f})" if found.low < found.high else ""
        yield (
            f"probability that it reaches {summary.wanted:.0%}{how}: {found.value:.2f}{within}, {summary.sure:g} "
            f"needed: {summary.verdict}"
        )
    if summary.positions > 1:
        off = []
        for p in summary.points:
            low, median, high = np.quantile(p.gains(), [0.05, 0.5, 0.95])
            off.append(f"{median:.0%} at {p.M_g:g} N·m (5 to 95 % of drives: {low:.0%} to {high:.0%})")
        yield f"turning the wheel takes off F'_ior {', '.join(off)}"


def _table(summary: Summary, style: Style) -> Table:
    grid = table(style, "F'_ior, arcsec (Monte Carlo interval)")
    grid.add_column(no_wrap=True)
    heads = [*(words for _, words, _ in PERCENTILES), *(["limit", "yield, %"] if summary.has_limit else [])]
    for words in heads:
        grid.add_column(style.text(words), justify="right", no_wrap=True)
    for point in summary.points:
        for way, F_ior, held in _ways(point, summary):
            found = [summary.percentile(F_ior, share) for _, _, share in PERCENTILES]
            cells = [f"{each.value:.3g}" for each in found]
            cells[-1] += f" ({found[-1].low:.3g}-{found[-1].high:.3g})"
            if summary.has_limit:
                limit = "-" if point.limit is None else f"{point.limit:g}"
                cells += [limit, "-" if point.limit is None else _yield_cell(held)]
            grid.add_row(style.text(f"{point.M_g:g} N·m, {way}"), *map(style.text, cells))
    return grid


def _distribution(point: AtTorque, summary: Summary, style: Style) -> str:
    """Which share of the drives stays below which F'_ior, each wheel in its best position where it is turned."""
    way, F_ior, _ = _ways(point, summary)[-1]
    order = np.argsort(F_ior)
    below = np.cumsum(np.array(summary.weights)[order]) / np.sum(summary.weights)
    words = f"F'_ior at {point.M_g:g} N·m, arcsec, {way}"
    return curve(style, np.array(F_ior)[order], 100 * below, x_label=words, y_label="% of drives below")


def _ways(point: AtTorque, summary: Summary) -> list[tuple[str, Sequence[float], YieldBelief]]:
    """Ways to build: in words, F'_ior [arcsec] and yield at a torque."""
    found: list[tuple[str, Sequence[float], YieldBelief]] = []
    found.append(("as built", point.as_built, summary.yield_of(False, point)))
    if summary.positions > 1:
        found.append((f"best of {summary.positions}", point.best, summary.yield_of(True, point)))
    return found


def _law_words(law: ProductionLaw) -> str:
    laws = sorted({f.law for f in law.own if isinstance(f, TolerancedSize)})
    words = [f"given sizes {', '.join(LAW_WORDS.get(each, each) for each in laws)}"] if laws else []
    return ", ".join(words + (["others even"] if law.not_given else []))


def _to_measure(law: ProductionLaw, summary: Summary, samples: Samples | None) -> Sequence[MeasurementGain]:
    """What to measure of the design next, at the torque with the least yield."""
    if samples is None:
        return ()
    worst = min(range(len(summary.points)), key=lambda k: summary.yield_of(True, summary.points[k]).share)
    return to_measure(law, samples, worst)


def _yield_words(found: YieldBelief) -> str:
    """A range over the designs, or the yield of the only one with its interval."""
    low, middle, high = (100 * found.percentile(share) for share in (ENDS, 0.5, 1 - ENDS))
    if len(found.weights) == 1:
        return f"{100 * found.share:.1f} % ({low:.1f}-{high:.1f})"
    return f"{low:.1f} to {high:.1f} %, median {middle:.1f} %"


def _yield_cell(found: YieldBelief) -> str:
    middle = found.share if len(found.weights) == 1 else found.percentile(0.5)
    return f"{100 * middle:.0f} ({100 * found.percentile(ENDS):.0f}-{100 * found.percentile(1 - ENDS):.0f})"


def _yield_object(found: YieldBelief, wanted: float | None) -> Json:
    return {
        "share": found.share,
        "low": found.percentile(ENDS),
        "median": found.percentile(0.5),
        "high": found.percentile(1 - ENDS),
        "good": int(found.passed.sum()),
        "probability": None if wanted is None else asdict(found.probability(wanted)),
    }


def _F_ior_object(F_ior: Sequence[float], summary: Summary) -> Json:
    found = {name: summary.percentile(F_ior, share) for name, _, share in PERCENTILES}
    return {
        **{f"{name}_arcsec": each.value for name, each in found.items()},
        **{f"{name}_interval_arcsec": [each.low, each.high] for name, each in found.items()},
        "worst_arcsec": max(F_ior),
        "mean_arcsec": float(np.average(F_ior, weights=summary.weights)),
    }


def _point_object(point: AtTorque, summary: Summary) -> Json:
    gains = np.quantile(point.gains(), [0.05, 0.5, 0.95]).tolist()
    return {
        "M_g_Nm": point.M_g,
        "limit_arcsec": point.limit,
        "self_error_arcsec": point.self_error,
        "as_built": _F_ior_object(point.as_built, summary),
        "best_position": _F_ior_object(point.best, summary),
        "gain": dict(zip(("low", "median", "high"), gains, strict=True)),
    }
