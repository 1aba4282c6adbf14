"""Acceptance of a drive as JSON: decisions, remarks, and all that it takes to do it again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

from hdassist.acceptance.accept import Acceptance
from hdassist.acceptance.decision import GUARD, Decision
from hdassist.acceptance.request import FailOn, Request, exit_code
from hdassist.errors import HdassistError
from hdassist.measuring.measure import Measurement
from hdassist.terminal.answers import certificate_object, envelope
from hdassist.terminal.answers import failure as failed
from hdassist.terminal.quantities import Quantity, as_object

CHECK: tuple[Quantity[Decision], ...] = (
    Quantity("code", "code", "", "", lambda d: d.asked.check.code),
    Quantity("M_g_Nm", "torque", "N·m", "g", lambda d: d.asked.M_g),
    Quantity("per_cam_rev", "order", "1/turn", "g", lambda d: d.asked.order),
    Quantity("basis", "known", "", "", lambda d: d.known.basis if d.known else None),
    Quantity("extent", "extent", "", "", lambda d: d.known.extent if d.known else None),
    Quantity("value", "value", "", ".2f", lambda d: d.known.value if d.known else None),
    Quantity("expanded_uncertainty", "U, k = 2", "", ".2f", lambda d: d.expanded),
    Quantity("guard", "guard", "", ".2f", lambda d: d.guard),
    Quantity("limit", "limit", "", "g", lambda d: d.asked.limit),
    Quantity("limit_is", "limit is", "", "", lambda d: "greatest" if d.asked.check.upper else "least"),
    Quantity("margin", "margin", "", ".2f", lambda d: d.margin),
    Quantity("unit", "unit", "", "", lambda d: d.asked.check.unit.replace("·", "*")),
    Quantity("verdict", "verdict", "", "", lambda d: str(d.verdict)),
    Quantity("reason", "why", "", "", lambda d: d.reason or None),
)


def answer(request: Request, result: Acceptance, fail_on: FailOn) -> dict[str, Any]:
    """The acceptance as a JSON object."""
    predictions, acceptance = result.predictions, result.drive.acceptance
    return {
        **envelope("accept", result.drive, exit_code(result, fail_on), result.drive.origin.warnings),
        "serial": request.serial,
        "verdict": str(result.verdict),
        "checks": [as_object(CHECK, decision) for decision in result.decisions],
        "left_out": [asked.label for asked in result.left_out],
        "remarks": [{"code": said.remark.code, "text": said.text} for said in result.remarks],
        "measured": _measured(result.measurements),
        "rule": {
            "measured": acceptance.rule,
            "guard_standard_uncertainties": GUARD if acceptance.rule == "guard" else 0.0,
            "prediction_margin_percent": acceptance.margin,
        },
        "certificate": certificate_object(predictions.certificate, predictions.cross_checks) if predictions else None,
        "solver": "engine" if predictions else None,
        "seed": request.seed,
        "fail_on": fail_on,
        "request": asdict(request),
        "time": _now(),
    }


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _measured(measurements: Mapping[float, Measurement]) -> list[dict[str, Any]]:
    return [
        {
            "M_g_Nm": M_g,
            "file": m.trace.file,
            "sha256": m.trace.sha256,
            "rows": len(m.trace.line),
            "F_ior_arcsec": m.F_ior_arcsec,
            "F_ior_is_lower_bound": m.directions[0].is_bound,
            "standard_uncertainty_arcsec": m.directions[0].uncertainty_arcsec,
        }
        for M_g, m in measurements.items()
    ]


def failure(request: Request, error: HdassistError) -> dict[str, Any]:
    """The answer about a drive that has none: its error."""
    return {
        **failed("accept", error, preset=request.preset),
        "serial": request.serial,
        "seed": request.seed,
        "request": asdict(request),
        "time": _now(),
    }
