"""A sweep as a report, and its rows for CSV."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from hdassist.design.sweep import Sweep, SweepRow, Swept, largest
from hdassist.design.vary import TORQUE, Axis
from hdassist.json_parts import attributes, unknown_objects
from hdassist.model.unknown import unknowns
from hdassist.report.blocks import Curve, Facts
from hdassist.report.report import Report
from hdassist.terminal.brief import again
from hdassist.verdict import worst_exit_code

ROW_COLUMNS = ("M_g_Nm", "F_ior_arcsec", "max_residual", "reason")


def columns(sweep: Sweep) -> list[str]:
    """Names of the columns of the rows: a field in its own unit, then the result."""
    return [*(axis.path for axis in sweep.axes), *ROW_COLUMNS]


def cells(record: SweepRow) -> list[Any]:
    """A record as a row of those columns."""
    return [*record.values.values(), *attributes(record, *ROW_COLUMNS).values()]


def sweep_report(swept: Swept, records: Iterable[SweepRow]) -> Report:
    """A sweep; records of its rows, where they are wanted."""
    sweep, drive = swept.sweep, swept.drive
    least, greatest = swept.end(False), swept.end(True)
    figures = list(_figures(swept))
    line = f"{least[1]:.2f} to {greatest[1]:.2f} arcsec" if least and greatest else "no answer"
    return Report(
        command="sweep",
        drive=drive,
        head=f"{drive.name}, F'_ior over {' and '.join(map(_span, sweep.axes))}, {sweep.rows} rows",
        verdict=line,
        blocks=(Facts.of(_facts(swept)), *figures[:1]),
        details=tuple(figures[1:]),
        certificate=swept,
        values={
            "unknown": unknown_objects(unknowns(largest(drive, sweep.axes))),
            "vary": [{"field": axis.path, **attributes(axis, "unit", "values")} for axis in sweep.axes],
            "least": least and dict(zip(("row", "F_ior_arcsec"), least, strict=True)),
            "greatest": greatest and dict(zip(("row", "F_ior_arcsec"), greatest, strict=True)),
            "rows": list(records),
            "rows_without_answer": swept.failed,
        },
        line=line,
        warnings=tuple(swept.warnings),
        exit_code=worst_exit_code(swept.exit_codes) if least is None else 0,
    )


def _facts(swept: Swept) -> Iterator[tuple[str, str]]:
    """Least and greatest F'_ior, rows without an answer, and the next command."""
    least, greatest = swept.end(False), swept.end(True)
    if least and greatest:
        yield "least", _at(swept, *least)
        yield "greatest", _at(swept, *greatest)
    if swept.failed:
        yield "no answer", f"{swept.failed} of {swept.sweep.rows} rows; the first: {swept.reason}"
    if least:
        values = [f"{path}={value!r}".removesuffix(".0") for path, value in swept.sweep.values(least[0]).items()]
        yield "next", again("check", swept.drive, *(word for value in values for word in ("--set", value)))


def _span(axis: Axis) -> str:
    low, high = min(axis.values), max(axis.values)
    values = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    return f"{axis.path} ({values} {_unit(axis)}".rstrip() + ")"


def _unit(axis: Axis) -> str:
    return axis.unit.replace("*", "·")


def _at(swept: Swept, row: int, F_ior: float) -> str:
    units = {axis.path: _unit(axis) for axis in swept.sweep.axes}
    values = [f"{path} = {value:g} {units[path]}".rstrip() for path, value in swept.sweep.values(row).items()]
    torque = [] if TORQUE in units else [f"{swept.sweep.torque(row):g} N·m"]
    return f"{F_ior:.2f}″ at {', '.join(values + torque)}"


def _figures(swept: Swept) -> Iterator[Curve]:
    """F'_ior over one field at each torque; none of more fields, or of fewer than two rows with an answer."""
    axis, *others = swept.sweep.axes
    order = np.argsort(axis.values)
    values, label = np.array(axis.values, dtype=float)[order], f"{axis.path}, {_unit(axis)}".removesuffix(", ")
    for k, M_g in enumerate([] if others else swept.sweep.torques or [None]):
        F_ior = swept.F_ior_arcsec[order, k]
        solved = np.isfinite(F_ior)
        words = "F'_ior, ″" if M_g is None else f"F'_ior at {M_g:g} N·m, ″"
        if not solved.all():
            words += f", {np.sum(~solved)} points without an answer left out"
        if solved.sum() > 1:
            yield Curve(values[solved], F_ior[solved], label, words)
