"""What random drives come to, as a table and histograms, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import unit_of
from hdassist.terminal.answers import Json, envelope
from hdassist.terminal.brief import again
from hdassist.terminal.console import Style, table
from hdassist.terminal.quantities import Quantity, as_object
from hdassist.terminal.runs import Answer, Figures
from hdassist.tolerance.scatter import TAIL, Draws, Scatter
from hdassist.tolerance.summary import AtTorque, Summary
from hdassist.tolerance.tally import MOST, Share, Tally

BINS = 12  # of a histogram
BAR = 22  # columns of its longest bar

TALLY: tuple[Quantity[Tally], ...] = (
    Quantity("low_arcsec", "5 %", "", ".2f", lambda t: t.quantile(0.05)),
    Quantity("median_arcsec", "median", "", ".2f", lambda t: t.quantile(0.5)),
    Quantity("high_arcsec", "95 %", "", ".2f", lambda t: t.quantile(0.95)),
    Quantity("worst_arcsec", "worst", "", ".2f", lambda t: t.greatest),
    Quantity("mean_arcsec", "mean", "", ".2f", lambda t: t.mean),
)


def answer(drive: Drive, draws: Draws, summary: Summary, *, plots: bool, interrupted: bool = False) -> Answer:
    """What there is to say of random drives; plots, whether histograms are drawn; interrupted, before all were done."""
    code = 130 if interrupted else summary.verdict.exit_code
    return Answer(
        to_json=lambda: to_json(drive, draws, summary, code),
        page=lambda style: render(drive, draws, summary, style, plots=plots),
        summary_line=lambda: summary_line(summary),
        figures=lambda: figures(drive, summary),
        about=drive.name,
        warnings=warnings(drive, draws, summary),
        proof=proof(summary),
        exit_code=code,
    )


def warnings(drive: Drive, draws: Draws, summary: Summary) -> tuple[str, ...]:
    """What a reader should know beside the numbers."""
    found = list(drive.origin.warnings)
    if guessed := [s.path for s in draws.scatters if s.assumed]:
        found.append(f"not given, drawn up to an assumed tolerance: {', '.join(guessed)}")
    if summary.refused:
        found.append(f"{summary.refused} drives have no answer, and count as open: {summary.reason}")
    if draws.method == "sobol":
        found.append("bounds of yields are those of independent drives; these are spread evenly, and so surer")
    return tuple(found)


def render(drive: Drive, draws: Draws, summary: Summary, style: Style, *, plots: bool = True) -> RenderableType:
    """Yield and gain, a table of both ways to build, a histogram a torque."""
    head = f"{drive.name}: {summary.count} random drives, {_drawn_words(draws)}"
    parts: list[RenderableType] = [Text(style.text(head), style="bold")]
    parts.append(Text(style.text("\n".join(_verdict_lines(summary)))))
    parts.append(_table(summary, style))
    parts += [Text(_histogram(point, summary, style)) for point in summary.points] if plots else []
    below = [proof(summary), f"next: {again('sensitivity', drive)}"]
    parts.append(Text(style.text("\n".join(below))))
    return Group(*(line for part in parts for line in (part, Text(""))))


def proof(summary: Summary) -> str:
    """What stands behind the numbers, in a line."""
    return (
        f"proof: every extreme is a solved state ({summary.states} states, worst residual {summary.max_residual:.0e}); "
        "where to look was told by a table"
    )


def summary_line(summary: Summary) -> str:
    """The answer alone: quantiles or yields."""
    if summary.has_limit:
        turned = f", {_percent(summary.yield_best)} with the wheel turned" if summary.positions > 1 else ""
        return f"yield {_percent(summary.yield_as_built)} as built{turned}, {summary.verdict}"
    return "\n".join(
        f"{p.M_g:g} N*m: 95 % of drives below {p.as_built.quantile(0.95):.2f} arcsec as built"
        + (f", {p.best.quantile(0.95):.2f} with the wheel turned" if summary.positions > 1 else "")
        for p in summary.points
    )


def to_json(drive: Drive, draws: Draws, summary: Summary, exit_code: int) -> Json:
    """The random drives as a JSON object."""
    ways = [("as_built", summary.yield_as_built), ("best_position", summary.yield_best)]
    return {
        **envelope("tolerance", drive, exit_code, warnings(drive, draws, summary)),
        "drives": summary.count,
        "refused": summary.refused,
        "seed": draws.seed,
        "method": draws.method,
        "positions": summary.positions,
        "scatter": [_scatter_object(s) for s in draws.scatters],
        "operating_points": [_point_object(point) for point in summary.points],
        "yield": {name: _share_object(share) for name, share in ways} if summary.has_limit else None,
        "yield_wanted": summary.wanted,
        "certificate": {"states": summary.states, "max_residual": summary.max_residual},
        "verdict": str(summary.verdict),
    }


def figures(drive: Drive, summary: Summary) -> Figures:
    """One row per torque and way to build."""
    rows = [
        [drive.name, point.M_g, way, *(q.value(tally) for q in TALLY), share.share if point.limit is not None else None]
        for point in summary.points
        for way, tally, share in _ways(point, summary)
    ]
    return ["preset", "M_g_Nm", "wheel", *(q.key for q in TALLY), "yield"], rows


def _verdict_lines(summary: Summary) -> Iterable[str]:
    if summary.has_limit:
        told, how = f"yield as built {_percent(summary.yield_as_built)}", ""
        if summary.positions > 1:
            how = ", each wheel in its best position"
            told += f"; with the wheel in its best position {_percent(summary.yield_best)}"
        yield told + ("" if summary.wanted is None else f"; {summary.wanted:.0%} wanted{how}: {summary.verdict}")
    if summary.positions > 1:
        off = [
            f"{p.gain(0.5):.0%} at {p.M_g:g} N·m (5 to 95 % of drives: {p.gain(0.05):.0%} to {p.gain(0.95):.0%})"
            for p in summary.points
        ]
        yield f"turning the wheel takes off F'_ior {', '.join(off)}"


def _table(summary: Summary, style: Style) -> Table:
    grid = table(style, "F'_ior, arcsec")
    grid.add_column()
    shown = TALLY[:4]
    for q in shown:
        grid.add_column(style.text(q.label), justify="right", no_wrap=True)
    if summary.has_limit:
        grid.add_column(style.text("limit"), justify="right", no_wrap=True)
        grid.add_column(style.text("yield, 95 % sure"), justify="right", no_wrap=True)
    for point in summary.points:
        for way, tally, share in _ways(point, summary):
            cells = [q.text(tally) for q in shown]
            if summary.has_limit:
                limit = "-" if point.limit is None else f"{point.limit:g}"
                cells += [limit, "-" if point.limit is None else _percent(share)]
            grid.add_row(style.text(f"{point.M_g:g} N·m, {way}"), *map(style.text, cells))
    return grid


def _histogram(point: AtTorque, summary: Summary, style: Style) -> str:
    """Bars of how many drives lie between round values, as built and in the best position side by side."""
    ways = _ways(point, summary)
    edges = _edges(min(t.quantile(0.001) for _, t, _ in ways), max(t.quantile(0.999) for _, t, _ in ways))
    counts = [tally.between(np.array([0.0, *edges[1:-1], MOST])) for _, tally, _ in ways]
    scale = BAR / max(int(c.max()) for c in counts)
    mark = "#" if style.ascii else "█"
    number = f".{max(0, -int(np.floor(np.log10(edges[1] - edges[0]))))}f"
    spans = [f"{low:{number}} to {high:{number}}" for low, high in pairwise(edges)]
    head = f"F'_ior at {point.M_g:g} N·m, arcsec"
    width = max(len(head), *map(len, spans)) + 2
    lines = [head.ljust(width) + "".join(way.ljust(BAR + 2) for way, _, _ in ways)]
    for k, span in enumerate(spans):
        bars = "".join((mark * round(c[k] * scale)).ljust(BAR + 2) for c in counts)
        lines.append(f"{span.rjust(width - 2)}  {bars}".rstrip())
    return style.text("\n".join(lines))


def _edges(low: float, high: float) -> list[float]:
    """Round numbers around low and high, about BINS apart."""
    span = max(high - low, 1e-6)
    power = 10.0 ** np.floor(np.log10(span / BINS))
    step = next(s * power for s in (1, 2, 5, 10) if span / (s * power) <= BINS)
    first, last = int(np.floor(low / step)), int(np.ceil(high / step))
    return [float(k * step) for k in range(first, max(last, first + 1) + 1)]


def _ways(point: AtTorque, summary: Summary) -> list[tuple[str, Tally, Share]]:
    """Ways to build: in words, its values and its yield at a torque."""
    found = [("as built", point.as_built, Share(point.passed_as_built, summary.count, summary.refused))]
    if summary.positions > 1:
        share = Share(point.passed_best, summary.count, summary.refused)
        found.append((f"best of {summary.positions}", point.best, share))
    return found


def _drawn_words(draws: Draws) -> str:
    kinds = sorted({s.kind for s in draws.scatters if s.is_size})
    told = {"rayleigh": f"Rayleigh (tolerance = {TAIL:g} standard deviations)"}
    return f"sizes {', '.join(told.get(kind, kind) for kind in kinds)}, seed {draws.seed}"


def _percent(share: Share) -> str:
    low, high = (100 * bound for bound in share.bounds)
    return f"{100 * share.share:.1f} % ({low:.1f}-{high:.1f})"


def _share_object(share: Share) -> Json:
    low, high = share.bounds
    return {"share": share.share, "low": low, "high": high, "good": share.good}


def _scatter_object(scatter: Scatter) -> Json:
    unit = unit_of(field_table()[scatter.path])
    return {
        "field": scatter.path, "kind": scatter.kind, "low": scatter.low, "high": scatter.high, "unit": unit,
        "assumed": scatter.assumed,
    }  # fmt: skip


def _point_object(point: AtTorque) -> Json:
    return {
        "M_g_Nm": point.M_g,
        "limit_arcsec": point.limit,
        "self_error_arcsec": point.self_error,
        "as_built": as_object(TALLY, point.as_built),
        "best_position": as_object(TALLY, point.best),
        "gain": {name: point.gain(share) for name, share in (("low", 0.05), ("median", 0.5), ("high", 0.95))},
    }
