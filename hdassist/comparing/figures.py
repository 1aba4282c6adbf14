"""Figures of a comparison as JSON and as CSV."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hdassist.comparing.compare import Reading
from hdassist.comparing.comparison import Comparison, Explanation, OrderPair
from hdassist.comparing.vectors import VECTORS
from hdassist.model.kinematics import Kinematics
from hdassist.terminal.answers import certificate_object, csv_text, envelope
from hdassist.terminal.quantities import Quantity, as_object

ORDER: tuple[Quantity[OrderPair], ...] = (
    Quantity("per_cam_rev", "order", "1/turn", ".2f", lambda o: o.per_cam_rev),
    Quantity("measured.amplitude_arcsec", "measured", "arcsec", ".3f", lambda o: o.amplitude_arcsec),
    Quantity("measured.uncertainty_arcsec", "+/-", "", ".3f", lambda o: o.uncertainty_arcsec),
    Quantity("measured.phase_deg", "phase", "deg", ".0f", lambda o: o.phase_deg),
    Quantity("predicted.amplitude_arcsec", "predicted", "arcsec", ".3f", lambda o: o.predicted_arcsec),
    Quantity("predicted.phase_deg", "phase", "deg", ".0f", lambda o: o.predicted_phase_deg),
    Quantity("difference.amplitude_arcsec", "difference", "arcsec", ".3f", lambda o: o.difference_arcsec),
    Quantity("difference.uncertainty_arcsec", "+/-", "", ".3f", lambda o: o.difference_uncertainty_arcsec),
    Quantity("cause", "cause", "", "", lambda o: o.cause),
)


def start_name(result: Comparison) -> str:
    """Name of the angle at which the output stands where phi_h is 0."""
    return "phi_g0" if Kinematics.of(result.drive).fixed == "rigid" else "phi_b0"


def turned(angle: float) -> float:
    """An angle [rad] in degrees from -180 to 180."""
    return float((np.degrees(angle) + 180) % 360 - 180)


def explained(result: Comparison, found: Explanation) -> dict[str, Any]:
    """One explanation as a JSON object."""
    return {
        "deviations": [VECTORS[k].size for k in found.vectors],
        "changes": [
            {
                "size": VECTORS[change.vector].size,
                "size_um": change.size_um,
                "size_uncertainty_um": change.size_uncertainty_um,
                "direction": VECTORS[change.vector].direction,
                "direction_deg": change.direction_deg,
                "direction_uncertainty_deg": change.direction_uncertainty_deg,
            }
            for change in found.changes
        ],
        "not_told_apart": [list(names) for names in found.untold],
        "chi_square": found.chi_square,
        "degrees_of_freedom": found.freedom,
        "explained_share": found.share,
        "clear": found.clear,
        "sufficient": found.sufficient,
        "overrides": list(found.overrides),
        "F_ior_arcsec": found.F_ior_arcsec,
        "difference_left_arcsec": found.left_arcsec,
        "orders_left": [
            {"per_cam_rev": order, "amplitude_arcsec": size, "cause": cause} for order, size, cause in found.left_orders
        ],
        f"{start_name(result)}_deg": turned(found.place.start),
        "cam_zero_deg": turned(found.place.zero),
    }


def answer(result: Comparison, reading: Reading) -> dict[str, Any]:
    """The comparison as a JSON object."""
    found, trace, best = result.found, result.measurement.trace, result.finding.best
    return {
        **envelope("compare", result.drive, 0, [*result.drive.origin.warnings, *result.warnings]),
        "file": {"name": trace.file, "sha256": trace.sha256, "rows": len(trace.line)},
        "notes": list(result.measurement.notes),
        "M_g_Nm": result.M_g,
        "place": {
            f"{start_name(result)}_deg": turned(result.place.start),
            f"{start_name(result)}_uncertainty_deg": result.start_uncertainty_deg,
            f"{start_name(result)}_fitted": result.start_uncertainty_deg is not None,
            "cam_zero_deg": turned(result.place.zero),
            "cam_zero_uncertainty_deg": result.zero_uncertainty_deg,
            "cam_zero_fitted": result.zero_uncertainty_deg is not None,
            "error_is": "cam-output" if result.place.sign > 0 else "output-cam",
            "cam_sense": "ccw" if result.place.sense > 0 else "cw",
        },
        "cam_revolutions": found.cells.span,
        "measured": {
            "range_arcsec": found.range.value,
            "standard_uncertainty_arcsec": found.uncertainty_arcsec,
            "is_full_cycle": not found.is_bound,
        },
        "predicted": {"range_arcsec": result.predicted_range_arcsec, "F_ior_arcsec": result.F_ior_arcsec},
        "difference": {
            "range_arcsec": result.difference_range_arcsec,
            "rms_arcsec": result.difference_rms_arcsec,
            "largest_arcsec": result.largest_arcsec,
            "largest_at_cam_deg": 360 * result.largest_at_turns,
        },
        "residual": {
            "rms_arcsec": float(np.std(result.residual_arcsec)),
            "range_arcsec": float(np.ptp(result.residual_arcsec)),
        },
        "chi_square": result.chi_square,
        "degrees_of_freedom": result.freedom,
        "orders": [as_object(ORDER, order) for order in result.orders],
        "finding": {
            "kind": result.finding.kind,
            "deviations": [VECTORS[k].size for k in best.vectors] if best else [],
            "overrides": list(best.overrides) if best else [],
            "F_ior_arcsec": best.F_ior_arcsec if best else None,
        },
        "mirrored": result.mirror
        and {"option": options(result.mirror.option, reading), "difference_rms_arcsec": result.mirror.rms_arcsec},
        "singles": [explained(result, single) for single in result.singles],
        "joint": result.joint and explained(result, result.joint),
        "certificate": certificate_object(result.certificate, []),
        "seed": result.measurement.seed,
    }


def options(way: str, reading: Reading) -> str:
    """Options that read a file the other way round: its error, its cam angle, or both."""
    error = "output-cam" if reading.error_is == "cam-output" else "cam-output"
    sense = "cw" if reading.cam_sense == "ccw" else "ccw"
    return " ".join(
        text
        for text, wanted in ((f"--error-is {error}", "error_is"), (f"--cam-sense {sense}", "cam_sense"))
        if way in (wanted, "both")
    )


def csv(results: Sequence[Comparison]) -> str:
    """One row per step of the angle: error less level and drift, prediction, residual."""
    rows: list[list[Any]] = []
    for result in results:
        cells = result.found.cells
        columns = (
            cells.sweep, 360 * cells.turns, result.predicted_arcsec + result.residual_arcsec,
            result.predicted_arcsec, result.residual_arcsec,
        )  # fmt: skip
        name = result.measurement.trace.file
        rows += [[name, *values] for values in zip(*(column.tolist() for column in columns), strict=True)]
    return csv_text(["file", "sweep", "cam_deg", "measured_arcsec", "predicted_arcsec", "residual_arcsec"], rows)
