"""What every JSON answer has around its figures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from hdassist.errors import HdassistError
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Certificate
from hdassist.solve.loadcase import CrossCheck
from hdassist.verdict import worst_exit_code
from hdassist.version import __version__


def envelope(command: str, drive: Drive, exit_code: int, warnings: Sequence[str]) -> dict[str, Any]:
    """Keys common to all answers about one drive."""
    return {
        "schema": f"hdassist.{command}/1",
        "version": __version__,
        "preset": {
            "name": drive.name,
            "sha256": drive.origin.sha256,
            "overrides": list(drive.origin.overrides),
        },
        "exit_code": exit_code,
        "warnings": list(warnings),
    }


def failure(command: str, name: str, error: HdassistError) -> dict[str, Any]:
    """The answer about a drive that has none: its error."""
    return {
        "schema": f"hdassist.{command}/1",
        "version": __version__,
        "preset": {"name": name, "sha256": None},
        "exit_code": error.exit_code,
        "warnings": [],
        "error": {"message": error.message, "hint": error.hint},
    }


def combine(command: str, results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """One object for all drives: the answer itself where there is one, else a list of them."""
    return results[0] if len(results) == 1 else together(command, results)


def together(command: str, results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """One object with a list of answers, be it one or many; its exit code is the worst of theirs."""
    return {
        "schema": f"hdassist.{command}/1",
        "version": __version__,
        "exit_code": worst_exit_code(result["exit_code"] for result in results),
        "warnings": [],
        "results": list(results),
    }


def certificate_object(certificate: Certificate, cross_checks: Sequence[CrossCheck]) -> dict[str, Any]:
    """Certificate and cross-check as JSON: the worst of all torques."""
    return {
        "states": certificate.states,
        "max_residual": certificate.max_residual,
        "residuals": {
            "negative_force": certificate.negative_force,
            "negative_gap": certificate.negative_gap,
            "complementarity": certificate.complementarity,
            "equilibrium": certificate.equilibrium,
        },
        "fallbacks": certificate.fallbacks,
        "cross_check": {
            "solver": cross_checks[0].solver,
            "states": sum(c.states for c in cross_checks),
            "max_difference_arcsec": max(c.max_difference_arcsec for c in cross_checks),
        }
        if cross_checks
        else None,
    }


def to_json(answer: dict[str, Any]) -> str:
    """The answer as text; never NaN or Infinity."""
    return json.dumps(answer, indent=2, ensure_ascii=True, allow_nan=False) + "\n"
