"""A sweep as a report, and its rows for CSV."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from hdassist.design.sweep import Sweep, SweepRow, Swept
from hdassist.design.vary import Axis
from hdassist.json_parts import attributes, unknown_objects
from hdassist.model.unknown import unknowns
from hdassist.report import Curve, Fact, Facts, Report
from hdassist.terminal.words import again
from hdassist.verdict import worst_exit_code

ROW_COLUMNS = ("M_g_Nm", "F_ior_arcsec", "max_residual", "reason")


def columns(sweep: Sweep) -> list[str]:
    """Names of the columns of the rows: a field in its own unit, then the result."""
    return [*(axis.path for axis in sweep.varied), *ROW_COLUMNS]


def cells(record: SweepRow) -> list[Any]:
    """A record as a row of those columns."""
    return [*record.values.values(), *attributes(record, *ROW_COLUMNS).values()]


def sweep_report(swept: Swept, records: Iterable[SweepRow]) -> Report:
    """A sweep; records of its rows, where they are wanted."""
    sweep, drive, ends, figures = swept.sweep, swept.drive, swept.ends, list(_figures(swept))
    line = " to ".join(f"{F_ior:.2f}" for _, F_ior in ends.values()) + " arcsec" if ends else "no answer"
    values = ((axis, min(axis.values), max(axis.values)) for axis in sweep.varied)
    spans = (_of(axis, f"{low:g}" if low == high else f"{low:g} to {high:g}", " (") + ")" for axis, low, high in values)
    found = {end: {"row": row, "F_ior_arcsec": F_ior} for end, (row, F_ior) in ends.items()}
    return Report(
        command="sweep",
        drive=drive,
        head=f"{drive.name}, F'_ior over {' and '.join(spans)}, {sweep.rows} rows",
        verdict=line,
        blocks=(Facts.of(_facts(swept)), *figures[:1]),
        details=tuple(figures[1:]),
        certificate=swept,
        values={
            "unknown": unknown_objects(unknowns(swept.largest)),
            "vary": [{"field": axis.path, **attributes(axis, "unit", "values")} for axis in sweep.varied],
            **{end: found.get(end) for end in ("least", "greatest")},
            "rows": list(records),
            "rows_without_answer": swept.failed,
        },
        line=line,
        warnings=tuple(swept.warnings),
        exit_code=0 if ends else worst_exit_code(swept.exit_codes),
    )


def _facts(swept: Swept) -> Iterator[Fact]:
    """Least and greatest F'_ior, rows without an answer, and the next command."""
    sweep, ends = swept.sweep, swept.ends
    for end, (row, F_ior) in ends.items():
        values = sweep.values(row)
        yield end, f"{F_ior:.2f}″ at " + ", ".join(_of(axis, f"{values[axis.path]:g}", " = ") for axis in sweep.axes)
    if swept.failed:
        yield "no answer", f"{swept.failed} of {sweep.rows} rows; the first: {swept.reason}"
    if ends:
        values = sweep.values(ends["least"][0])
        sets = [f"{axis.path}={values[axis.path]!r}".removesuffix(".0") for axis in sweep.varied]
        yield "next", again("check", swept.drive, *(word for text in sets for word in ("--set", text)))


def _of(axis: Axis, values: str, sign: str) -> str:
    """Values along an axis, in its unit."""
    return f"{axis.path}{sign}{values} {axis.unit.replace('*', '·')}".rstrip()


def _figures(swept: Swept) -> Iterator[Curve]:
    """F'_ior over one field at each torque; none of more fields, or of fewer than two rows with an answer."""
    axis, *others = swept.sweep.varied
    torques = [f" at {M_g:g} N·m" for further in swept.sweep.further for M_g in further.values] or [""]
    order = np.argsort(axis.values)
    values = np.array(axis.values, dtype=float)[order]
    if others:
        return
    curves = swept.F_ior_arcsec.reshape(len(values), -1)[order].T
    for torque, F_ior in zip(torques, curves, strict=True):
        solved = np.isfinite(F_ior)
        gaps = "" if solved.all() else f", {np.sum(~solved)} points without an answer left out"
        if solved.sum() > 1:
            label = _of(axis, "", ",").rstrip(",")
            yield Curve(values[solved], F_ior[solved], label, f"F'_ior{torque}, ″{gaps}")
