"""docs/validation.md from the cases of the tests: `python -m tests.validation [--check]`."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from importlib import import_module
from math import isinf
from pathlib import Path
from types import ModuleType

from tests.validation import study
from tests.validation.case import Case, Information

PAGE = Path(__file__).parents[2] / "docs/validation.md"
SOURCES = (
    "test_lyuminarsky_2019",
    "test_catalogue_stiffness",
    "test_temperature",
    "test_cam_support",
    "test_prior_predictive",
    "test_published_drives",
    "test_harmonics_bound",
    "test_drawn_sizes",
    "test_robot_joint",
    "test_cam_torque",
    "test_bearing_theory",
    "test_ring_closed_forms",
    "test_convergence",
)
HEAD = """\
# Validation

This page compares the model with independent sources, and states the significance of each comparison. `python -m
tests.validation` generates the page from the cases in the tests. CI fails if the page and the cases differ, or if a row
marked as missed agrees. The column *note* gives the reason for a tolerance or for a miss. If the column *source* is
empty, the source of the row above applies. The value *got* is in the unit of *expected*, with the 5th to 95th
percentile over parameter sets in brackets.

|worth|meaning|
|---|---|
|fitted|used to find other values, so agreement verifies nothing|
|bound|kept the fit within a range|
|predicted|held back, without any tuning towards it; this is the test of the model|
|prior|must lie within the assumed range; a miss refutes, and an agreement verifies nothing|
|reading|a value read from a recording, before any model|
|exact, convergence|the equations were stated and solved correctly|
|model|has not been measured|

We know of no measurement of F'_ior in each hole of a drive ([the experiment](experiment.md)). The gain from moving a
wheel depends on the support of the wave generator. For a given support, the predicted gain is similar for different
parameter sets of this model. The gain has not been measured. Absolute values of F'_ior depend on single micrometres, so
they require at least one measurement. The equations are checked by reference values from two implementations
(`tests/validation/test_model_reference.py`) and by identities (`tests/property`).
"""


def expected(case: Case) -> str:
    """The expected range in words."""
    if case.centre is not None:
        return f"{case.centre:.5g}±{case.high - case.centre:.2g}"
    low, high = format(case.low, ".4g"), format(case.high, ".4g")
    return f"≥{low}" if isinf(case.high) else f"{low}–{high}"


def row(case: Case, above: str, notes: list[str]) -> str:
    """One line of a table below one of some source, with the numbers of its notes; notes not there yet are added."""
    unit = f" {case.unit}" if case.unit else ""
    spread = f" ({case.spread()})" if case.spread else ""
    got, verdict = format(case.got, case.digits) + spread, "yes" if case.agrees else "**no**"
    numbers = []
    for note in filter(None, (case.why, case.miss and f"**missed**: {case.miss}")):
        notes += [note] * (note not in notes)
        numbers.append(str(notes.index(note) + 1))
    source = "" if case.source == above else case.source
    cells = (case.quantity, source, expected(case) + unit, got, verdict, case.kind, ", ".join(numbers))
    return f"|{'|'.join(cells)}|"


def information(shown: Iterable[Information]) -> list[str]:
    """Lines of the table of what is shown only, if anything is."""
    rows = [f"|{item.quantity}|{item.value():{item.digits}} {item.unit}|{item.why}|" for item in shown]
    return ["", "|for information|got|why no range|", "|---|---|---|", *rows] if rows else []


def section(module: ModuleType) -> str:
    """A section of the page: tables, notes by their numbers, words. Raises AssertionError where a case fails."""
    for case in module.CASES:
        case.check()
    notes: list[str] = []
    table = ["|quantity|source|expected|got|agrees|worth|note|", f"|{'---|' * 7}"]
    above = ["", *(case.source for case in module.CASES)]
    table += [row(case, source, notes) for case, source in zip(module.CASES, above, strict=False)]
    numbered = [f"{number}. {note}." for number, note in enumerate(notes, 1)]
    drawn = [module.table(), ""] if hasattr(module, "table") else []
    shown = information(getattr(module, "INFORMATION", ()))
    return "\n".join([f"## {module.TITLE}", "", *drawn, *table, *shown, "", *numbered, "", module.ABOUT.strip(), ""])


def page() -> str:
    """The page as text. Raises AssertionError where a case does not come out as it says."""
    sections = [section(import_module(f"tests.validation.{name}")) for name in SOURCES]
    return "\n".join([HEAD, *sections, f"## {study.TITLE}", "", study.table(), "", study.ABOUT, ""])


def main() -> None:
    """Write the page, or compare it with --check."""
    text = page()
    if "--check" not in sys.argv:
        PAGE.write_text(text, encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != text:
        sys.exit("docs/validation.md is not what the cases give: run python -m tests.validation")


if __name__ == "__main__":
    main()
