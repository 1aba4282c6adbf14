"""Figures of a measured trace as JSON and as CSV."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hdassist.errors import HdassistError
from hdassist.measuring.measurement import Direction, Measurement
from hdassist.measuring.orders import MeasuredOrder
from hdassist.preset.fields import Drive
from hdassist.terminal.answers import csv_text
from hdassist.terminal.quantities import Quantity, as_object
from hdassist.version import __version__

SCHEMA = "hdassist.measure/1"

ORDER: tuple[Quantity[MeasuredOrder], ...] = (
    Quantity("per_cam_rev", "order", "1/turn", ".2f", lambda o: o.per_cam_rev),
    Quantity("amplitude_arcsec", "amplitude", "arcsec", ".3f", lambda o: o.amplitude_arcsec),
    Quantity("amplitude_uncertainty_arcsec", "+/-", "arcsec", ".3f", lambda o: o.uncertainty_arcsec),
    Quantity("phase_deg", "phase", "deg", ".1f", lambda o: o.phase_deg),
    Quantity("cause", "cause", "", "", lambda o: o.cause or None),
)
DIRECTION: tuple[Quantity[Direction], ...] = (
    Quantity("direction", "direction", "", "", lambda d: d.direction),
    Quantity("rows", "rows", "", "", lambda d: int(d.cells.rows.sum())),
    Quantity("sweeps", "sweeps", "", "", lambda d: len(d.fit.level)),
    Quantity("cam_revolutions", "cam turns", "", ".2f", lambda d: d.cells.span),
    Quantity("F_ior_arcsec", "F'_ior", "arcsec", ".2f", lambda d: d.range.value),
    Quantity("F_ior_is_lower_bound", "lower bound", "", "", lambda d: d.is_bound),
    Quantity("standard_uncertainty_arcsec", "u", "arcsec", ".2f", lambda d: d.uncertainty_arcsec),
    Quantity("interval_arcsec", "95 %", "arcsec", "", lambda d: list(d.interval_arcsec)),
    Quantity("revolution_range_arcsec", "within one cam turn", "arcsec", ".2f", lambda d: d.revolution.value),
    Quantity(
        "revolution_range_standard_uncertainty_arcsec",
        "its u",
        "arcsec",
        ".2f",
        lambda d: d.revolution_uncertainty_arcsec,
    ),
    Quantity("band_limited_range_arcsec", "as fitted", "arcsec", ".2f", lambda d: d.range.fitted),
    Quantity("noise_bias_arcsec", "added by noise", "arcsec", ".2f", lambda d: d.range.bias),
    Quantity("raw_range_arcsec", "raw range", "arcsec", ".2f", lambda d: d.raw_range_arcsec),
    Quantity("drift_arcsec", "drift taken off", "arcsec", ".2f", lambda d: float(d.fit.drift.sum())),
    Quantity("residuals.rms_arcsec", "residuals", "arcsec", ".2f", lambda d: float(np.std(d.fit.residual))),
    Quantity("residuals.unmodelled_arcsec", "unmodelled", "arcsec", ".2f", lambda d: d.fit.unmodelled),
    Quantity("residuals.correlated_steps", "correlated", "", ".1f", lambda d: d.fit.correlated),
    Quantity("residuals.condition", "condition", "", ".3g", lambda d: d.fit.condition),
)


def _coverage(found: Direction) -> dict[str, Any] | None:
    c = found.coverage
    if c is None:
        return None
    return {
        "share": c.share,
        "visited_cells": c.visited,
        "cells": c.cells,
        "cell_cam_deg": c.cam_deg,
        "cell_output_deg": c.output_deg,
    }


def answer(result: Measurement, drive: Drive | None) -> dict[str, Any]:
    """The measurement as a JSON object."""
    gearing, reversal = result.gearing, result.reversal
    return {
        "schema": SCHEMA,
        "version": __version__,
        "preset": {
            "name": drive.name if drive else None,
            "sha256": drive.origin.sha256 if drive else None,
            "overrides": list(drive.origin.overrides) if drive else [],
        },
        "file": {"name": result.trace.file, "sha256": result.trace.sha256, "rows": len(result.trace.line)},
        "exit_code": 0,
        "warnings": list(result.warnings),
        "notes": list(result.notes),
        "cycle": gearing
        and {
            "ratio": gearing.ratio,
            "cam_revolutions": gearing.cycle,
            "output_revolutions": gearing.cycle_output,
        },
        "F_ior_arcsec": result.F_ior_arcsec,
        "directions": [
            {
                **as_object(DIRECTION, found),
                "coverage": _coverage(found),
                "orders": [as_object(ORDER, order) for order in found.orders],
                "budget": [
                    {"source": s.name, "standard_uncertainty_arcsec": s.arcsec, "origin": s.origin}
                    for s in found.sources
                ],
            }
            for found in result.directions
        ],
        "reversal_error": reversal
        and {"mean_arcsec": reversal.mean_arcsec, "greatest_departure_arcsec": reversal.greatest_arcsec},
        "seed": result.seed,
    }


def failure(command: str, name: str, error: HdassistError) -> dict[str, Any]:
    """The answer about a file that has none: its error."""
    return {
        "schema": f"hdassist.{command}/1",
        "version": __version__,
        "preset": {"name": None, "sha256": None},
        "file": {"name": name, "sha256": None},
        "exit_code": error.exit_code,
        "warnings": [],
        "error": {"message": error.message, "hint": error.hint},
    }


def csv(results: Sequence[Measurement]) -> str:
    """One row per step of the angle, in each direction: error less its level and drift, and the fitted curve."""
    rows: list[list[Any]] = []
    for result in results:
        for found in result.directions:
            cells = found.cells
            fitted = found.fit.curve(cells.turns)
            columns = (cells.sweep, 360 * cells.turns, fitted + found.fit.residual, fitted)
            sets = zip(*(column.tolist() for column in columns), strict=True)
            rows += [[result.trace.file, found.direction, *values] for values in sets]
    return csv_text(["file", "direction", "sweep", "cam_deg", "error_arcsec", "fitted_arcsec"], rows)


def repeats(results: Sequence[Measurement]) -> dict[str, Any] | None:
    """Mean and standard deviation of F'_ior over files, as of repeat runs; None for one file."""
    values = [result.F_ior_arcsec for result in results]
    if len(values) < 2:
        return None
    spread = float(np.std(values, ddof=1))
    return {"files": len(values), "mean_arcsec": float(np.mean(values)), "standard_deviation_arcsec": spread}
