"""docs/validation.md from the cases of the tests: `python -m tests.validation [--check]`."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from importlib import import_module
from math import isinf
from pathlib import Path

from tests.validation import study
from tests.validation.case import Case, Information

PAGE = Path(__file__).parents[2] / "docs/validation.md"
SOURCES = (
    "test_lyuminarsky_2019",
    "test_catalogue_stiffness",
    "test_temperature",
    "test_cam_support",
    "test_real_trace",
    "test_bearing_theory",
    "test_ring_closed_forms",
    "test_convergence",
)
HEAD = """\
# Validation

What the model is compared with, what comes out, and what that is worth. This page is made by
`python -m tests.validation` from the cases that the tests run; CI fails when the two differ.

- **fitted**: the value was used to find others. Agreement proves nothing.
- **bound of the fit**: it kept the fit within a range, and is evidence only as far as it lies inside it.
- **predicted**: nothing was tuned towards it. This is what the model can be judged by.
- **closed form**, **convergence**: the equations were written down and solved right; that they describe a drive is
  another matter.
- **model result**: nobody has measured it; it says what the model says.

A row that misses says so, with the reason, and a test fails should it cease to miss. That the equations were written
down right is also held by reference numbers that two independent implementations gave
(`tests/validation/test_model_reference.py`) and by identities: homogeneity, half turn, mirror, rigid turn, Castigliano,
cam torque (`tests/property`).

Absolute values hinge on single micrometres of clearance and need one measurement of the real drive. What turning a
wheel brings depends on the cam's support, otherwise it is robust across parameter sets of this model; it has not been
measured: no measurement of F'_ior hole by hole is known to us ([experiment.md](experiment.md)). The paper below is a
computation: what agrees with it agrees with another model, not with a drive.
"""


def expected(case: Case) -> str:
    """The expected range in words."""
    if case.centre is not None:
        return f"{case.centre:.5g} ± {case.high - case.centre:.2g}"
    low, high = format(case.low, ".4g"), format(case.high, ".4g")
    return f"{low} or more" if isinf(case.high) else f"{low} to {high}"


def row(case: Case) -> str:
    """One line of a table."""
    unit = f" {case.unit}" if case.unit else ""
    got, verdict = format(case.got, case.digits) + unit, "yes" if case.agrees else "**no**"
    return f"| {case.quantity} | {case.source} | {expected(case)}{unit} | {got} | {verdict} | {case.kind} |"


def information(shown: Iterable[Information]) -> list[str]:
    """Lines of the table of what is shown only, if anything is."""
    rows = [f"| {item.quantity} | {item.value():{item.digits}} {item.unit} | {item.why} |" for item in shown]
    return ["| for information | got | why no range |", "| --- | --- | --- |", *rows, ""] if rows else []


def grouped(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """What stands second, by what stands first, both in their order."""
    groups: dict[str, list[str]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return groups


def page() -> str:
    """The page as text. Raises AssertionError where a case does not come out as it says."""
    parts = [HEAD]
    for name in SOURCES:
        module = import_module(f"tests.validation.{name}")
        for case in module.CASES:
            case.check()
        misses = [
            f"- **{'**; **'.join(quantities)}** {'is' if len(quantities) == 1 else 'are'} missed: {miss}."
            for miss, quantities in grouped((case.miss, case.quantity) for case in module.CASES if case.miss).items()
        ]
        whys = grouped((case.why, case.quantity) for case in module.CASES)
        reasons = [f"- {'; '.join(quantities)}: {why}." for why, quantities in whys.items()]
        table = ["| quantity | source | expected | got | agrees | worth |", "| --- | --- | --- | --- | --- | --- |"]
        table += [row(case) for case in module.CASES]
        table += ["", *information(getattr(module, "INFORMATION", ()))]
        drawn = [module.table(), ""] if hasattr(module, "table") else []
        parts.append("\n".join([f"## {module.TITLE}", "", module.ABOUT, "", *drawn, *table, *misses, *reasons, ""]))
    parts.append("\n".join([f"## {study.TITLE}", "", study.ABOUT, "", study.table(), ""]))
    return "\n".join(parts)


def main() -> None:
    """Write the page, or compare it with --check."""
    text = page()
    if "--check" not in sys.argv:
        PAGE.write_text(text, encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != text:
        sys.exit("docs/validation.md is not what the cases give: run python -m tests.validation")


if __name__ == "__main__":
    main()
