"""The cheapest tolerances that reach a yield as a report."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hdassist.belief.measure import MeasurementGain
from hdassist.json_parts import attributes, measure_objects
from hdassist.pages.tolerance import MORE_DRIVES, law_warnings, yield_range
from hdassist.preset.fields import Drive
from hdassist.report import Fact, Facts, Report, Table
from hdassist.terminal.words import MORE_DRAWS, again, field_unit, measure_words, probability_words
from hdassist.tolerance.allocation import Allocation, Tolerance
from hdassist.tolerance.law import ProductionLaw
from hdassist.verdict import Verdict


@dataclass(frozen=True)
class Allocated:
    """The cheapest tolerances of a drive, ways to build it one after the other.

    wanted, the yield as a share, and sure, with which probability; limits and self errors [arcsec]; to_measure: what of
    the design; count, of drives drawn for each decision.
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
    count: int = 0

    @property
    def drive(self) -> Drive:
        """The drive of the preset."""
        return self.law.drive

    @property
    def verdict(self) -> Verdict:
        """Whether any way reaches the yield: the best of their verdicts."""
        verdicts = {way.verdict for way in self.ways}
        return next(each for each in (Verdict.PASS, Verdict.INCONCLUSIVE, Verdict.FAIL) if each in verdicts)


def allocate_report(found: Allocated) -> Report:
    """The cheapest tolerances of a drive."""
    drive, choices, ways = found.drive, found.choices, found.ways
    held = list(zip(drive.operation.M_g, found.limits, found.self_errors, strict=True))
    limits = ", ".join(f"{limit:g}″ at {M_g:g} N·m" for M_g, limit, _ in held)
    assumed = [choice.path for choice in choices if choice.assumed_law]
    costs = f"costs are assumed, 1 now and growing as 1/tolerance: {', '.join(assumed)} (preset: cost)"
    reasons = [_words(way, found) for way in ways]
    return Report(
        command="allocate",
        drive=drive,
        head=f"{drive.name}, tolerances for {100 * found.wanted:g} % of drives within {limits}",
        verdict=str(found.verdict),
        why=tuple(reasons),
        blocks=(_table(found), Facts.of(_facts(found))),
        values={
            **attributes(found, "sure", "seed", "verdict"),
            "yield_wanted": found.wanted,
            "to_measure": measure_objects(found.to_measure),
            "limits": [
                {"M_g_Nm": M_g, "limit_arcsec": limit, "self_error_arcsec": own} for M_g, limit, own in held
            ],
            "laws": [
                {
                    **attributes(choice, "now", "least", "most"),
                    **attributes(choice.law, "share", "k"),
                    "field": choice.path,
                    "unit": field_unit(choice.path),
                    "assumed": choice.assumed_law,
                }
                for choice in choices
            ],
            "allocations": [
                {
                    **attributes(way, "turned", "fits", "cost", "probability", "verdict"),
                    "tolerances": way.values,
                    "yield": yield_range(way.tried),
                    "drives": way.tried.drives.sum(),
                }
                for way in ways
            ],
        },
        csv=(
            ["preset", "wheel", "fits", "field", "now", "tolerance", "cost_of_all"],
            [
                [drive.name, _column(way), way.fits, choice.path, choice.now, way.values[choice.path], way.cost]
                for way in ways
                for choice in choices
            ],
        ),
        line="\n".join(reasons),
        warnings=(*law_warnings(found.law), *[costs] * bool(assumed)),
        exit_code=found.verdict.exit_code,
    )  # fmt: skip


def _words(way: Allocation, found: Allocated) -> str:
    """Whether a way to build reaches the yield, at which cost, and how sure that is."""
    how = "with the wheel in its best hole" if way.turned else "as built"
    none = "no tolerances reach it" if way.verdict is Verdict.FAIL else "none recommended: not sure enough"
    return (
        f"{how}: {f'cost {way.cost:.2f}' if way.fits else none}; {100 * way.tried.share:.1f} % of "
        f"{way.tried.drives.sum()} drives drawn anew pass, probability that {100 * found.wanted:g} % do: "
        f"{probability_words(way.probability, found.sure)}"
    )


def _facts(found: Allocated) -> Iterator[Fact]:
    """Where no way is sure enough, the share of the self error and the next measurement; the next command."""
    passed = found.verdict is Verdict.PASS
    if not passed:
        taken = (
            f"{own:.1f} of {limit:g}″ at {M_g:g} N·m"
            for M_g, own, limit in zip(found.drive.operation.M_g, found.self_errors, found.limits, strict=True)
        )
        yield "self error", f"takes {', '.join(taken)}; no tolerance changes that"
    if found.verdict is Verdict.INCONCLUSIVE:
        yield "measure", measure_words(found.to_measure, False) or MORE_DRIVES
    if passed:
        cheapest = min((way for way in found.ways if way.fits), key=lambda way: way.cost)
        values = [f"{path}={value:.3g}" for path, value in cheapest.values.items()]
        yield "next", again("tolerance", found.drive, *(word for value in values for word in ("--set", value)))
    elif found.verdict is Verdict.INCONCLUSIVE and not found.to_measure:
        asked = ("--yield", f"{found.wanted:g}", "--sure", f"{found.sure:g}", "-n", str(MORE_DRAWS * found.count))
        yield "next", again("allocate", found.drive, *asked)
    else:
        yield "next", again("sensitivity", found.drive)


def _table(found: Allocated) -> Table:
    rows = [
        (
            f"{choice.path}, {field_unit(choice.path)}",
            f"{choice.now:g} ({choice.law.share:.2f})",
            *(f"{way.values[choice.path]:.3g} ({choice.cost(way.values[choice.path]):.2f})" for way in found.ways),
        )
        for choice in found.choices
    ]
    now = sum(choice.law.share for choice in found.choices)
    rows.append(("cost", f"{now:.2f}", *(f"{way.cost:.2f}" for way in found.ways)))
    return Table("tolerances (cost of each)", ("field", "preset", *map(_column, found.ways)), tuple(rows))


def _column(way: Allocation) -> str:
    return "best hole" if way.turned else "as built"
