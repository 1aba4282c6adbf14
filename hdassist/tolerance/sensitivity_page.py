"""What F'_ior hangs on, over random drives and about the preset's values: tornado and tables, JSON, CSV."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Literal

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.error.slopes import Slope
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import unit_of
from hdassist.solve.answers import Certificate
from hdassist.terminal.answers import Json, certificate_object, envelope
from hdassist.terminal.brief import again
from hdassist.terminal.console import Style, table
from hdassist.terminal.runs import Answer, Figures
from hdassist.tolerance.indices import TIGHTER, Design, Indices, Tightened

BAR = 10  # columns of the longest bar
COLUMNS = (
    "alone: the share of the variance that goes with this one alone; with others: with all that it acts together with, "
    "so that these may add up to more than 100 % (first and total Sobol index)"
)
SHOWN = 8  # slopes that a table lists


@dataclass(frozen=True)
class Sensitivities:
    """What F'_ior of a drive hangs on: slopes about its values, indices over random drives, what tighter ones bring.

    F_ior_arcsec, at the preset's values, one a torque; slopes, the steepest first; design; indices and tightened, one
    a torque; proofs: of the slopes' states, and (states, worst residual) of the random drives; surer: the options that
    ask the same of more drives, None where there can be no more.
    """

    drive: Drive
    F_ior_arcsec: Sequence[float]
    slopes: Sequence[Slope]
    design: Design
    indices: Sequence[Indices]
    tightened: Sequence[Sequence[Tightened]]
    certificate: Certificate
    states: int
    max_residual: float
    surer: Sequence[str] | None

    @property
    def torques(self) -> Sequence[float]:
        """Torques [N*m]."""
        return self.drive.operation.M_g

    @property
    def is_sure(self) -> bool:
        """Whether the tolerance to tighten first would bring something for certain; nothing to tighten is sure too."""
        return self.first is None or self.first[1].high < self.first[1].now

    @property
    def first(self) -> tuple[float, Tightened] | None:
        """The tolerance to tighten first, at the torque that is worst now (of its limit, where there are limits)."""
        limits = [self.drive.limit(M_g) or 0.0 for M_g in self.torques]
        scale = limits if all(limits) else [1.0] * len(limits)
        ways = [
            (some[0].now / limit, M_g, some)
            for M_g, limit, some in zip(self.torques, scale, self.tightened, strict=True)
            if some
        ]
        if not ways:
            return None
        _, M_g, some = max(ways, key=lambda way: way[0])
        return M_g, min(some, key=lambda way: way.then)


def answer(found: Sensitivities) -> Answer:
    """What there is to say of a drive's sensitivities."""
    return Answer(
        to_json=lambda: to_json(found),
        page=lambda style: render(found, style),
        summary_line=lambda: summary_line(found),
        figures=lambda: figures(found),
        about=found.drive.name,
        warnings=found.drive.origin.warnings,
        proof=proof(found),
    )


def summary_line(found: Sensitivities) -> str:
    """The tolerance to tighten first, and what that brings."""
    if found.first is None:
        return f"nothing to tighten: no size of a deviation scatters (steepest: {found.slopes[0].path})"
    M_g, way = found.first
    if not found.is_sure:
        return (
            f"no single tolerance is worth tightening by {1 - TIGHTER:.0%}: over {2 * found.design.count} drives, none "
            "moves the 95 % value for certain"
        )
    return (
        f"tighten first: {way.path}: {1 - TIGHTER:.0%} tighter takes the F'_ior that 95 % of drives stay below at "
        f"{M_g:g} N*m from {way.now:.1f} to {way.then:.1f} arcsec ({way.low:.1f} to {way.high:.1f})"
    )


def proof(found: Sensitivities) -> str:
    """What stands behind the numbers, in a line."""
    states, worst = found.states + found.certificate.states, max(found.max_residual, found.certificate.max_residual)
    return f"proof: {found.design.total} random drives; {states} states solved, worst residual {worst:.0e}"


def render(found: Sensitivities, style: Style) -> RenderableType:
    """What to tighten first, a tornado a torque, slopes."""
    parts: list[RenderableType] = [
        Text(style.text(f"{found.drive.name}: what F'_ior hangs on"), style="bold"),
        Text(style.text(summary_line(found))),
    ]
    if not found.is_sure and found.surer:
        parts.append(Text(style.text(f"surer, with more drives: {again('sensitivity', found.drive, *found.surer)}")))
    for M_g, index, ways in zip(found.torques, found.indices, found.tightened, strict=True):
        parts.append(_tornado(found, M_g, index, ways, style))
    parts += [Text(style.text(COLUMNS)), _slopes(found, style)]
    parts.append(Text(style.text(f"{proof(found)}\nnext: {again('allocate', found.drive)} --limit ARCSEC")))
    return Group(*(line for part in parts for line in (part, Text(""))))


def _tornado(found: Sensitivities, M_g: float, index: Indices, ways: Sequence[Tightened], style: Style) -> Table:
    title = f"{M_g:g} N·m, as built: where the variance of F'_ior comes from, % (95 % sure); what 95 % of drives stay "
    grid = table(style, title + f"below, arcsec, now and with it {1 - TIGHTER:.0%} tighter")
    for words in ("scatters", "alone", "with others", "", "95 % below"):
        side: Literal["left", "right"] = "right" if words in ("alone", "with others") else "left"
        grid.add_column(style.text(words), justify=side, no_wrap=True)
    by_path = {way.path: way for way in ways}
    most = max(*index.total, 1e-9)
    for k in sorted(range(len(found.design.groups)), key=lambda k: -index.total[k]):
        path, _ = found.design.groups[k]
        way = by_path.get(path)
        then = f"{way.now:.1f} > {way.then:.1f}" if way else "-"
        bar = ("#" if style.ascii else "█") * round(max(index.total[k], 0) / most * BAR)
        shares = (_share(index.first[k], index.first_bounds[k]), _share(index.total[k], index.total_bounds[k]))
        grid.add_row(*map(style.text, (path, *shares, bar, then)))
    return grid


def _share(value: float, bounds: Iterable[float]) -> str:
    low, high = (max(100 * bound, 0) for bound in bounds)
    return f"{max(100 * value, 0):.0f} ({low:.0f}-{high:.0f})"


def _slopes(found: Sensitivities, style: Style) -> Table:
    values = ", ".join(f"{F:.2f} at {M_g:g} N·m" for M_g, F in zip(found.torques, found.F_ior_arcsec, strict=True))
    grid = table(style, f"about the preset's values, F'_ior {values}: arcsec per unit (per cent for a per cent)")
    grid.add_column(style.text("field"), no_wrap=True)
    for M_g in found.torques:
        grid.add_column(style.text(f"{M_g:g} N·m"), justify="right", no_wrap=True)
    for slope in found.slopes[:SHOWN]:
        unit = unit_of(field_table()[slope.path])
        cells = [
            f"{per:+.3g}" + (f" ({slope.elasticity[t]:+.2f})" if slope.elasticity else "")
            for t, per in enumerate(slope.per_unit)
        ]
        grid.add_row(*map(style.text, (f"{slope.path} = {slope.value:g} {unit}".rstrip(), *cells)))
    return grid


def to_json(found: Sensitivities) -> Json:
    """The sensitivities as a JSON object."""
    names = [name for name, _ in found.design.groups]
    return {
        **envelope("sensitivity", found.drive, 0, found.drive.origin.warnings),
        "operating_points": [
            {
                "M_g_Nm": M_g,
                "F_ior_arcsec": F,
                "indices": [
                    {
                        "field": name,
                        "first": float(index.first[k]),
                        "first_range": index.first_bounds[k].tolist(),
                        "total": float(index.total[k]),
                        "total_range": index.total_bounds[k].tolist(),
                    }
                    for k, name in enumerate(names)
                ],
                "tighter": [
                    {("field" if key == "path" else key): value for key, value in asdict(way).items()} for way in ways
                ],
            }
            for M_g, F, index, ways in zip(
                found.torques, found.F_ior_arcsec, found.indices, found.tightened, strict=True
            )
        ],
        "tighter_factor": TIGHTER,
        "slopes": [
            {
                "field": slope.path,
                "value": slope.value,
                "unit": unit_of(field_table()[slope.path]),
                "arcsec_per_unit": list(slope.per_unit),
                "elasticity": None if slope.elasticity is None else list(slope.elasticity),
            }
            for slope in found.slopes
        ],
        "drives": found.design.total,
        "seed": found.design.seed,
        "certificate": certificate_object(found.certificate)
        | {"drives_states": found.states, "drives_max_residual": found.max_residual},
    }


def figures(found: Sensitivities) -> Figures:
    """One row per field and torque: slopes of all, indices of what scatters."""
    rows: list[list[object]] = []
    for t, M_g in enumerate(found.torques):
        index = {name: k for k, (name, _) in enumerate(found.design.groups)}
        slope = {s.path: s for s in found.slopes}
        for path in dict.fromkeys((*index, *slope)):
            k, s = index.get(path), slope.get(path)
            told = [None, None] if k is None else [float(found.indices[t].first[k]), float(found.indices[t].total[k])]
            elastic = s.elasticity[t] if s and s.elasticity else None
            rows.append([found.drive.name, M_g, path, s.per_unit[t] if s else None, elastic, *told])
    return ["preset", "M_g_Nm", "field", "arcsec_per_unit", "elasticity", "first", "total"], rows
