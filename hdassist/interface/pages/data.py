"""Reports of a calibration and of the names that the tool explains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite
from typing import TYPE_CHECKING

from hdassist.drive.preset.fields import short
from hdassist.features.acceptance.limits import CODES
from hdassist.features.report import (
    Facts,
    Json,
    Paragraph,
    Report,
    ReportSection,
    Table,
    attributes,
    four_digits,
    quantity_table,
)
from hdassist.interface.explaining import Entry, entries
from hdassist.interface.terminal.words import again
from hdassist.run.errors import Verdict
from hdassist.run.system import command_line

if TYPE_CHECKING:
    from hdassist.features.calibration import Calibration, CalibrationTarget, Fit, Targets

_UNDETERMINED = 0.1  # relative narrowing of an interval below which the targets do not determine the value
_FOUND_VALUES = quantity_table(
    "calibrate.values",
    number=short,
    two_digits=lambda half_width: short(float(f"{half_width:.2g}")),
    percent=lambda share: f"{100 * share:.0f}",
)
_NOTE = "agreement with fitted targets does not validate the model; agreement with other targets does"


def calibrate_report(result: Calibration, written: str | None = None) -> Report:
    """Return the report of a calibration; written: file of the preset with the fitted values, None if none exists."""
    wanted = result.targets
    sets = [_set_object(wanted, fit) for fit in result.fits]
    met = sets[0]["targets_met"]
    return Report(
        command="calibrate",
        drive=result.drive,
        head=f"{result.drive.name}, calibration" + (f" ({wanted.name})" if wanted.name else ""),
        verdict=f"{met.count(False) or len(met)} of {len(met)} targets {'met' if all(met) else 'MISSED'}",
        why=(result.shortfall or f"sets of values that meet all targets: {len(result.fits)}",),
        blocks=(
            Table.by_row("fitted values with half-widths of their intervals, and bounds", _FOUND_VALUES, result.values),
            _targets_table(wanted, sets[0]),
            Facts((("note", _NOTE), ("next", _after_calibration(result, written)))),
        ),
        details=(_sets_table(result),),
        values={
            "targets_file": attributes(wanted, "name", "sha256"),
            "targets": [_target_object(target) for target in wanted.targets],
            "unknowns": result.values,
            "best": sets[0],
            "alternatives": sets[1:],
            **attributes(result, "indistinct", "evaluations", "seed"),
        },
        # each line can be used as an argument of --set
        line="\n".join(f"{value.path}={value.found!r}" for value in result.values),
        warnings=tuple(_warnings(result)),
        exit_code=0 if all(met) else Verdict.FAIL.exit_code,
    )


def _after_calibration(result: Calibration, written: str | None) -> str:
    """Return the next command, or the action required before it; written: file of the preset, None if none exists."""
    if result.shortfall:
        return "check the measured values; if they are correct, widen the bounds or add unknowns"
    if written:
        return command_line(["hdassist", "check", written])
    if result.drive.origin.overrides:
        return "copy the values of --set to the preset file, then repeat the command with --write FILE"
    return again("calibrate", result.drive, "--write", "found.yaml")


def _targets_table(wanted: Targets, fitted: Json) -> Table:
    """Return the table that compares the targets with the values of a fit; fitted: fit as JSON."""
    rows = []
    columns = zip(
        wanted.targets,
        fitted["found"],
        fitted["off_tolerances"],
        fitted["targets_met"],
        strict=True,
    )
    for target, value, off_tolerances, is_met in columns:
        state = "met" if is_met else "MISSED"
        rows.append((target.words, target.unit, target.wanted, four_digits(value), f"{off_tolerances:+.2f}", state))
    return Table("targets", ("quantity", "unit", "target", "fitted", "deviation/tolerance", ""), tuple(rows))


def _sets_table(result: Calibration) -> Table:
    """Return the table of all sets of values that meet the targets."""
    heads = ("field", "best", *(f"other {k}" for k in range(1, len(result.fits))))
    rows = tuple((value.path, *(f"{fit.values[k]:g}" for fit in result.fits)) for k, value in enumerate(result.values))
    return Table("sets of values that meet the targets", heads, rows)


def _target_object(target: CalibrationTarget) -> Json:
    """Return a target as JSON; a missing bound is null."""
    return {
        **attributes(target, "quantity", "unit", "asked", "value", "tolerance"),
        "low": target.low if isfinite(target.low) else None,
        "high": target.high if isfinite(target.high) else None,
    }


def _warnings(result: Calibration) -> Iterator[str]:
    """Yield the warnings of a calibration."""
    from hdassist.drive.model.deviations import unknown_notes  # loads scipy, which `explain` does not need

    yield from result.drive.origin.warnings
    if any(target.quantity.startswith("F_ior") for target in result.targets.targets):  # deviations affect F'_ior
        yield from unknown_notes(result.drive)
    if result.shortfall:
        yield (
            f"targets are missed: {result.shortfall}; the values are the nearest that were found, and "
            "--write writes no preset"
        )
    if open_ := [value.path for value in result.values if value.determined < _UNDETERMINED]:
        yield f"the targets do not determine {', '.join(open_)}"
    for a, b, correlation in result.indistinct:
        yield f"the targets do not distinguish {a} from {b} (correlation {correlation:+.2f})"


def _set_object(targets: Targets, fit: Fit) -> Json:
    met = targets.met(fit.predictions)
    return {
        "values": targets.by_path(fit.values),
        "off_tolerances": targets.deviations(fit.predictions),
        "found": fit.predictions,
        "targets_met": met,
        "met": all(met),
    }


_KIND_TITLES = {
    "error": "errors",
    "quantity or word": "quantities and words",
    "symbol": "symbols",
    "section": "fields of a preset, by section or name",
}


def explain_report(found: Sequence[Entry]) -> Report:
    """Return the meaning of names as a report; if there are none, the report lists all names by kind."""
    first, *further_entries = found or [
        Entry("section", ("hdassist explain NAME",), "any name listed here, in English or Russian")
    ]
    listed = [ReportSection(f"{entry.names[0]}: {entry.words}", (_entry_facts(entry),)) for entry in further_entries]
    return Report(
        command="explain",
        drive=None,
        head=f"{first.names[0]}: {first.words}",
        blocks=(_entry_facts(first), *listed) if found else tuple(_all_names()),
        values={
            "names": [
                {"name": entry.names[0], **attributes(entry, "kind", "words"), "facts": dict(entry.facts)}
                for entry in found or entries()
            ]
        },
    )


def _entry_facts(entry: Entry) -> Facts:
    return Facts.of((("kind", entry.kind), *entry.facts))


def _all_names() -> Iterator[ReportSection]:
    """Yield a section for each kind of names, with all names of that kind."""
    yield ReportSection("checks and notes", (Facts.of((item.code, item.words) for item in CODES.values()),))
    for kind, title in _KIND_TITLES.items():
        names = ", ".join(dict.fromkeys(entry.names[0] for entry in entries() if entry.kind == kind))
        yield ReportSection(title, (Paragraph(names),))
