"""A sweep as a plot with its ends, as JSON, and its rows for CSV and Parquet."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from hdassist.design.sweep import Sweep, SweepRow, Swept, largest
from hdassist.design.vary import TORQUE, Axis
from hdassist.json_parts import Json, unknown_objects
from hdassist.model.unknown import unknowns
from hdassist.pages.tolerance import paragraphs
from hdassist.preset.kinds import plain
from hdassist.terminal.answers import envelope
from hdassist.terminal.console import Style
from hdassist.terminal.heat import heat
from hdassist.terminal.plot import curve
from hdassist.verdict import worst_exit_code


def columns(sweep: Sweep) -> dict[str, type]:
    """Name and type of each column of the rows: a field in its own unit, then what came of it."""
    fields = {axis.path: type(axis.values[0]) for axis in sweep.axes}
    return {**fields, "M_g_Nm": float, "F_ior_arcsec": float, "max_residual": float, "reason": str}


def cells(record: SweepRow) -> list[Any]:
    """A record as a row of those columns."""
    return [*record.values.values(), record.M_g_Nm, record.F_ior_arcsec, record.max_residual, record.reason]


def sweep_exit_code(swept: Swept) -> int:
    """0 where any row has an answer, else the worst of the rows."""
    return worst_exit_code(swept.exit_codes) if swept.end(True) is None else 0


def sweep_json(swept: Swept, records: Iterable[SweepRow]) -> Json:
    """The sweep as a JSON object, with its rows."""
    sweep, drive = swept.sweep, swept.drive
    ends = {name: swept.end(greatest) for name, greatest in (("least", False), ("greatest", True))}
    return {
        **envelope("sweep", drive, sweep_exit_code(swept), swept.warnings),
        "unknown": unknown_objects(unknowns(largest(drive, sweep.axes))),
        "vary": [
            {"field": axis.path, "unit": axis.unit, "values": list(axis.values), "effect_arcsec": swept.effect(k)}
            for k, axis in enumerate(sweep.axes)
        ],
        **{name: end and {"row": end[0], "F_ior_arcsec": end[1]} for name, end in ends.items()},
        "rows": list(map(asdict, records)),
        "rows_without_answer": swept.failed,
        "certificate": {"states": swept.states, "max_residual": swept.max_residual},
    }


def sweep_summary(swept: Swept) -> str:
    """The answer alone: the least and the greatest F'_ior."""
    least, greatest = swept.end(False), swept.end(True)
    return f"{least[1]:.2f} to {greatest[1]:.2f} arcsec" if least and greatest else "no answer"


def sweep_page(swept: Swept, style: Style, name: str, *, plots: bool = True) -> RenderableType:
    """Plot of a sweep of one field or two, its ends, what moves it most, and the next command.

    Arguments: name of the preset, as it was asked for; plots, whether it is drawn.
    """
    sweep = swept.sweep
    over = " and ".join(_span(axis) for axis in sweep.axes)
    head = f"{swept.drive.name}: F'_ior over {over}, {sweep.rows} rows"
    drawn = [Text(text) for text in _plots(swept, style)] if plots else []
    return paragraphs(style, head, *drawn, "\n".join(_facts(swept, name)))


def _facts(swept: Swept, name: str) -> Iterator[str]:
    """Least and greatest F'_ior, what moves it most, rows without an answer, proof, and the next command."""
    if least := swept.end(False):
        yield f"least    {_at(swept, *least)}"
    if greatest := swept.end(True):
        yield f"greatest {_at(swept, *greatest)}"
    effects = [
        (effect, axis.path) for k, axis in enumerate(swept.sweep.axes) if (effect := swept.effect(k)) is not None
    ]
    if effects:
        told = ", ".join(f"{path} by {effect:.2f} arcsec" for effect, path in sorted(effects, reverse=True))
        yield f"moved most by: {told}"
    if swept.failed:
        yield f"without an answer: {swept.failed} of {swept.sweep.rows} rows; the first: {swept.reason}"
    if least:
        yield f"certificate: {swept.states} states, greatest residual {swept.max_residual:.1e} of its scale"
        sets = " ".join(f"--set {path}={_exact(value)}" for path, value in swept.sweep.values(least[0]).items())
        yield f"next: hdassist check {name} {sets}"


def _span(axis: Axis) -> str:
    low, high = min(axis.values), max(axis.values)
    values = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    return f"{axis.path} ({values} {_unit(axis)}".rstrip() + ")"


def _exact(value: float) -> str:
    """A value as one would write it, in every digit that it has."""
    return plain(value) if float(plain(value)) == value else repr(value)


def _unit(axis: Axis) -> str:
    return axis.unit.replace("*", "·")


def _at(swept: Swept, row: int, F_ior: float) -> str:
    units = {axis.path: _unit(axis) for axis in swept.sweep.axes}
    told = [f"{path} = {value:g} {units[path]}".rstrip() for path, value in swept.sweep.values(row).items()]
    torque = [] if TORQUE in units else [f"{swept.sweep.torque(row):g} N·m"]
    return f"{F_ior:.2f} arcsec at {', '.join(told + torque)}"


def _plots(swept: Swept, style: Style) -> Iterator[str]:
    """A curve of one field or a map of two at each torque; none of more fields."""
    sweep = swept.sweep
    if len(sweep.axes) > 2:
        return
    orders = [np.argsort(axis.values) for axis in sweep.axes]
    labels = [f"{axis.path}, {_unit(axis)}".removesuffix(", ") for axis in sweep.axes]
    sorted_values = [np.array(axis.values, dtype=float)[order] for axis, order in zip(sweep.axes, orders, strict=True)]
    for k in range(sweep.shape[-1]):
        F_ior = swept.F_ior_arcsec[..., k][np.ix_(*orders)]
        there = np.isfinite(F_ior)
        at = f"F'_ior at {sweep.torques[k]:g} N·m, arcsec" if sweep.torques else "F'_ior, arcsec"
        if len(orders) == 1 and there.sum() > 1:
            words = at + ("" if there.all() else f", {np.sum(~there)} points without an answer left out")
            yield curve(style, sorted_values[0][there], F_ior[there], x_label=labels[0], y_label=words)
        elif len(orders) == 2 and there.any():
            x, y = (list(map(float, values)) for values in sorted_values)
            yield heat(style, x, y, F_ior, x_label=labels[0], y_label=f"{labels[1]}; {at}")
