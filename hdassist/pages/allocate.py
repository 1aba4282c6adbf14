"""The cheapest tolerances that reach a yield as a report."""

from collections.abc import Sequence

from hdassist.belief.influence import MeasurementGain
from hdassist.json_parts import attributes, measure_objects
from hdassist.pages.tolerance import MORE_DRIVES, law_warnings, yield_range
from hdassist.report import Facts, Report, Table
from hdassist.terminal.words import MORE_DRAWS, again, field_unit, measure_words, probability_words
from hdassist.tolerance.allocation import Allocation, Allocator
from hdassist.verdict import Verdict


def allocate_report(
    found: Allocator, ways: Sequence[Allocation], self_errors: Sequence[float], to_measure: Sequence[MeasurementGain]
) -> Report:
    """The cheapest tolerances of a drive.

    Arguments: the search, ways to build the drive that it found tolerances for, self errors [arcsec] at each torque,
    and what of the design to measure.
    """
    law, choices = found.production.law, found.choices
    drive, verdicts = law.drive, {way.verdict for way in ways}
    verdict = next(each for each in (Verdict.PASS, Verdict.INCONCLUSIVE, Verdict.FAIL) if each in verdicts)
    held = [(M_g, drive.limit(M_g), own) for M_g, own in zip(found.production.torques, self_errors, strict=True)]
    limits = ", ".join(f"{limit:g}″ at {M_g:g} N·m" for M_g, limit, _ in held)
    assumed = [choice.path for choice in choices if choice.assumed_law]
    costs = f"costs are assumed, 1 now and growing as 1/tolerance: {', '.join(assumed)} (preset: cost)"
    reasons = [_words(way, found) for way in ways]
    facts = []
    if verdict is not Verdict.PASS:
        taken = ", ".join(f"{own:.1f} of {limit:g}″ at {M_g:g} N·m" for M_g, limit, own in held)
        facts.append(("self error", f"takes {taken}; no tolerance changes that"))
    if verdict is Verdict.INCONCLUSIVE:
        facts.append(("measure", measure_words(to_measure, False) or MORE_DRIVES))
    facts.append(("next", _next(found, ways, verdict, is_to_measure=bool(to_measure))))
    return Report(
        command="allocate",
        drive=drive,
        head=f"{drive.name}, tolerances for {100 * found.wanted:g} % of drives within {limits}",
        verdict=str(verdict),
        why=tuple(reasons),
        blocks=(_table(found, ways), Facts.of(facts)),
        values={
            "sure": found.sure,
            "seed": found.production.seed,
            "verdict": verdict,
            "yield_wanted": found.wanted,
            "to_measure": measure_objects(to_measure),
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
        warnings=(*law_warnings(law), *[costs] * bool(assumed)),
        exit_code=verdict.exit_code,
    )  # fmt: skip


def _words(way: Allocation, found: Allocator) -> str:
    """Whether a way to build reaches the yield, at which cost, and how sure that is."""
    how = "with the wheel in its best hole" if way.turned else "as built"
    none = "no tolerances reach it" if way.verdict is Verdict.FAIL else "none recommended: not sure enough"
    return (
        f"{how}: {f'cost {way.cost:.2f}' if way.fits else none}; {100 * way.tried.share:.1f} % of "
        f"{way.tried.drives.sum()} drives drawn anew pass, probability that {100 * found.wanted:g} % do: "
        f"{probability_words(way.probability, found.sure)}"
    )


def _next(found: Allocator, ways: Sequence[Allocation], verdict: Verdict, *, is_to_measure: bool) -> str:
    """The command to type next; is_to_measure: whether a measurement is worth more than drives."""
    drive = found.production.drive
    if verdict is Verdict.PASS:
        cheapest = min((way for way in ways if way.fits), key=lambda way: way.cost)
        values = [f"{path}={value:.3g}" for path, value in cheapest.values.items()]
        return again("tolerance", drive, *(word for value in values for word in ("--set", value)))
    if verdict is Verdict.INCONCLUSIVE and not is_to_measure:
        asked = ("--yield", f"{found.wanted:g}", "--sure", f"{found.sure:g}", "-n", str(MORE_DRAWS * found.drives))
        return again("allocate", drive, *asked)
    return again("sensitivity", drive)


def _table(found: Allocator, ways: Sequence[Allocation]) -> Table:
    rows = [
        (
            f"{choice.path}, {field_unit(choice.path)}",
            f"{choice.now:g} ({choice.law.share:.2f})",
            *(f"{way.values[choice.path]:.3g} ({choice.cost(way.values[choice.path]):.2f})" for way in ways),
        )
        for choice in found.choices
    ]
    now = sum(choice.law.share for choice in found.choices)
    rows.append(("cost", f"{now:.2f}", *(f"{way.cost:.2f}" for way in ways)))
    return Table("tolerances (cost of each)", ("field", "preset", *map(_column, ways)), tuple(rows))


def _column(way: Allocation) -> str:
    return "best hole" if way.turned else "as built"
