"""The cheapest tolerances as a table, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.belief.measure import MeasurementGain
from hdassist.json_parts import Json, measure_objects
from hdassist.pages.tolerance import law_warnings, paragraphs
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import unit_of
from hdassist.terminal.answers import envelope
from hdassist.terminal.console import Style, table
from hdassist.terminal.influence_words import measure_words
from hdassist.terminal.runs import Answer, CsvTable
from hdassist.tolerance.allocation import Allocation, Tolerance
from hdassist.tolerance.law import ProductionLaw
from hdassist.tolerance.yields import YIELD_TAIL
from hdassist.verdict import Verdict


@dataclass(frozen=True)
class Allocated:
    """The cheapest tolerances of a drive, ways to build it one after the other.

    wanted, the yield as a share, and sure, with which probability; limits and self errors [arcsec]; to_measure: what of
    the design.
    """

    law: ProductionLaw
    wanted: float
    sure: float
    limits: Sequence[float]
    self_errors: Sequence[float]
    choices: Sequence[Tolerance]
    ways: Sequence[Allocation]
    seed: int = 0
    to_measure: Sequence[MeasurementGain] = ()

    @property
    def drive(self) -> Drive:
        """The drive of the preset."""
        return self.law.drive

    @property
    def verdict(self) -> Verdict:
        """Whether any way reaches the yield: the best of their verdicts."""
        verdicts = {way.verdict for way in self.ways}
        return next(each for each in (Verdict.PASS, Verdict.INCONCLUSIVE, Verdict.FAIL) if each in verdicts)


def allocate_answer(found: Allocated) -> Answer:
    """What there is to say of the cheapest tolerances."""
    return Answer(
        to_json=lambda: allocate_json(found),
        page=lambda style: allocate_page(found, style),
        summary_line=lambda: "\n".join(_words(way, found) for way in found.ways),
        figures=lambda: allocate_figures(found),
        about=found.drive.name,
        warnings=allocate_warnings(found),
        exit_code=found.verdict.exit_code,
    )


def allocate_warnings(found: Allocated) -> tuple[str, ...]:
    """What a reader should know beside the numbers."""
    assumed = [choice.path for choice in found.choices if choice.assumed_law]
    words = f"costs are assumed, 1 now and growing as 1/tolerance: {', '.join(assumed)} (preset: cost)"
    return (*law_warnings(found.law), *[words] * bool(assumed))


def allocate_page(found: Allocated, style: Style) -> RenderableType:
    """What each way costs, and a column of tolerances for each."""
    limits = ", ".join(
        f"{limit:g} at {M:g} N·m" for M, limit in zip(found.drive.operation.M_g, found.limits, strict=True)
    )
    head = f"{found.drive.name}: cheapest tolerances for {found.wanted:.0%} of drives within {limits} arcsec"
    lines = [_words(way, found) for way in found.ways]
    if found.verdict is not Verdict.PASS:
        lines += _why_not(found)
    elif saved := _saved(found):
        lines.append(saved)
    return paragraphs(style, Text(style.text(head), style="bold"), "\n".join(lines), _table(found, style))


def _words(way: Allocation, found: Allocated) -> str:
    p = way.probability
    within = f" ({p.low:.2f}-{p.high:.2f})" if p.low < p.high else ""
    chance = f"probability that {found.wanted:.0%} pass: {p.value:.2f}{within}"
    how = "with the wheel in its best hole" if way.turned else "as built"
    if way.classes:
        how += ", classes " + ", ".join(f"{path.split('.')[1]} {grade}" for path, grade in way.classes.items())
    if way.fits:
        return (
            f"{how}: cost {way.cost:.2f}; {way.tried.share:.1%} of {way.tried.drives.sum()} other drives pass, {chance}"
        )
    reason = "no tolerances reach it" if way.verdict is Verdict.FAIL else "none recommended: not sure enough"
    return f"{how}: {reason}; with those tried {way.tried.share:.1%} of {way.tried.drives.sum()} drives pass, {chance}"


def _why_not(found: Allocated) -> Iterator[str]:
    """What stands in the way of an answer, and how to come by one."""
    if any(value > choice.now for way in found.ways for choice in found.choices for value in [way.values[choice.path]]):
        yield "nothing is to be loosened from this: the preset's own assumptions do not bear it"
    self_errors = [
        f"at {M_g:g} N·m the self error takes {own:.1f} of {limit:g} arcsec"
        for M_g, own, limit in zip(found.drive.operation.M_g, found.self_errors, found.limits, strict=True)
    ]
    yield f"{'; '.join(self_errors)}; the rest is what the least tolerances leave (hdassist sensitivity)"
    if found.verdict is Verdict.INCONCLUSIVE:
        words = measure_words(found.to_measure, False)
        yield f"to measure: {words}" if words else "more drives (-n) may tell"


def _saved(found: Allocated) -> str:
    plain = next((way for way in found.ways if not way.turned and not way.classes and way.fits), None)
    turned = next((way for way in found.ways if way.turned and not way.classes and way.fits), None)
    if turned is None:
        return ""
    if plain is None:
        return "turning the wheel is what makes it possible"
    return f"turning the wheel saves {1 - turned.cost / plain.cost:.0%} of what the tolerances cost"


def _table(found: Allocated, style: Style) -> Table:
    grid = table(style, "tolerances, and their costs")
    for words in ("field", "preset", *(_column(way) for way in found.ways)):
        grid.add_column(style.text(words), justify="left" if words == "field" else "right", no_wrap=words == "field")
    for choice in found.choices:
        unit = unit_of(field_table()[choice.path])
        cells = [f"{way.values[choice.path]:.3g} ({choice.cost(way.values[choice.path]):.2f})" for way in found.ways]
        grid.add_row(*map(style.text, (f"{choice.path}, {unit}", f"{choice.now:g} ({choice.law.share:.2f})", *cells)))
    now = sum(choice.law.share for choice in found.choices)
    grid.add_row("cost", f"{now:.2f}", *(f"{way.cost:.2f}" for way in found.ways))
    return grid


def _column(way: Allocation) -> str:
    return ("best hole" if way.turned else "as built") + (", classes" if way.classes else "")


def allocate_json(found: Allocated) -> Json:
    """The allocations as a JSON object."""
    torques = found.drive.operation.M_g
    return {
        **envelope("allocate", found.drive, found.verdict.exit_code, allocate_warnings(found)),
        "yield_wanted": found.wanted,
        "sure": found.sure,
        "to_measure": measure_objects(found.to_measure),
        "limits": [
            {"M_g_Nm": M_g, "limit_arcsec": limit, "self_error_arcsec": own}
            for M_g, limit, own in zip(torques, found.limits, found.self_errors, strict=True)
        ],
        "laws": [
            {
                "field": choice.path, "unit": unit_of(field_table()[choice.path]), "now": choice.now,
                "least": choice.least, "most": choice.most, "share": choice.law.share, "k": choice.law.k,
                "assumed": choice.assumed_law,
            }
            for choice in found.choices
        ],
        "allocations": [
            {
                "turned": way.turned,
                "fits": way.fits,
                "tolerances": dict(way.values),
                "classes": dict(way.classes),
                "cost": way.cost,
                "yield": {
                    "share": way.tried.share,
                    "low": way.tried.percentile(YIELD_TAIL),
                    "high": way.tried.percentile(1 - YIELD_TAIL),
                },
                "probability": asdict(way.probability),
                "verdict": str(way.verdict),
                "drives": int(way.tried.drives.sum()),
            }
            for way in found.ways
        ],
        "seed": found.seed,
        "verdict": str(found.verdict),
    }  # fmt: skip


def allocate_figures(found: Allocated) -> CsvTable:
    """One row per way and tolerance."""
    rows = [
        [found.drive.name, _column(way), way.fits, choice.path, choice.now, way.values[choice.path], way.cost]
        for way in found.ways
        for choice in found.choices
    ]
    return ["preset", "wheel", "fits", "field", "now", "tolerance", "cost_of_all"], rows
