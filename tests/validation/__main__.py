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

This page compares results of the model with published values, textbook solutions and a second implementation. Agreement
with data to which the model was fitted is no test of the model. The column *kind* therefore states how strong each
comparison is as a test of the model:

|kind|meaning|
|---|---|
|predicted|The expected value was not used in any fit. Only these rows test the model.|
|fitted|The expected value was used in a fit of other inputs. Agreement is therefore no test of the model.|
|bound|The expected range limited a fit. Agreement is therefore no test of the model.|
|prior|The value is compared with sampled drives. A miss speaks against the assumed ranges, but does not refute them.|
|reading|The value was read from a recording without use of the model.|
|exact|The expected value is a closed-form solution. Agreement verifies the solution of the equations.|
|convergence|The result must not depend on the resolution of the computation.|
|model|The expected value also comes from a computation. It has not been measured.|

In the tables, *expected* is the accepted range with its unit, and *result* is the value from hdassist in the same unit.
If the result is followed by a range in brackets, this range extends from the 5th to the 95th percentile of parameter
sets that were not fitted to any data. The numbers in the column *note* refer to the notes below each table, which
explain the width of the accepted range or the cause of a miss. If the column *source* is empty, the source of the row
above applies.

Rows of the kind *prior* are weaker tests than predictions. Even if the assumed ranges are correct, one in ten actual
drives lies outside the range from the 5th to the 95th percentile. Load, coupling and size of the published drives are
also partly unknown. Only several misses in the same direction, by drives with known conditions, would refute the
ranges.

The gain from moving the fixed wheel is the reduction of F'_ior in another hole. The predicted gain has not been
measured, and no published measurement of F'_ior in each hole of a drive is known ([the experiment](experiment.md)). In
the model, the gain depends mainly on the support of the wave generator. For a given support, the predicted gain is
similar for different parameter sets. A difference of a single micrometre in a clearance changes the absolute value of
F'_ior, so the prediction of an absolute value requires at least one measurement of the drive.

The equations themselves are verified by reference values from two implementations
(`tests/validation/test_model_reference.py`) and by identities that hold for every drive (`tests/property`). The command
`python -m tests.validation` generates this page from the cases in the tests. The continuous integration fails if the
page differs from the cases, or if a result marked as missed lies within its accepted range.
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
    for note in filter(None, (case.why, case.miss and f"**Missed.** {case.miss}")):
        notes += [note] * (note not in notes)
        numbers.append(str(notes.index(note) + 1))
    source = "" if case.source == above else case.source
    cells = (case.quantity, source, expected(case) + unit, got, verdict, case.kind, ", ".join(numbers))
    return f"|{'|'.join(cells)}|"


def information(shown: Iterable[Information]) -> list[str]:
    """Lines of the table of what is shown only, if anything is."""
    rows = [f"|{item.quantity}|{item.value():{item.digits}} {item.unit}|{item.why}|" for item in shown]
    return ["", "|for information|result|why no range is given|", "|---|---|---|", *rows] if rows else []


def section(module: ModuleType) -> str:
    """A section of the page: text, tables, notes by their numbers. Raises AssertionError where a case fails."""
    for case in module.CASES:
        case.check()
    notes: list[str] = []
    table = ["|quantity|source|expected|result|agrees|kind|note|", f"|{'---|' * 7}"]
    above = ["", *(case.source for case in module.CASES)]
    table += [row(case, source, notes) for case, source in zip(module.CASES, above, strict=False)]
    numbered = [f"{number}. {note}." for number, note in enumerate(notes, 1)]
    drawn = [module.table(), ""] if hasattr(module, "table") else []
    shown = information(getattr(module, "INFORMATION", ()))
    return "\n".join([f"## {module.TITLE}", "", module.ABOUT.strip(), "", *drawn, *table, *shown, "", *numbered, ""])


def page() -> str:
    """The page as text. Raises AssertionError where a case does not come out as it says."""
    sections = [section(import_module(f"tests.validation.{name}")) for name in SOURCES]
    return "\n".join([HEAD, *sections, f"## {study.TITLE}", "", study.ABOUT, "", study.table(), ""])


def main() -> None:
    """Write the page, or compare it with --check."""
    text = page()
    if "--check" not in sys.argv:
        PAGE.write_text(text, encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != text:
        sys.exit("docs/validation.md is not what the cases give: run python -m tests.validation")


if __name__ == "__main__":
    main()
