"""Corrections as files of their own: JSON that is written and read again, and columns for a table."""

from __future__ import annotations

import json
from math import isfinite
from typing import Any

import numpy as np

from hdassist.correction.table import CorrectionTable, ExpectedResidual, Phasors
from hdassist.errors import DataError
from hdassist.json_parts import Json, as_json
from hdassist.model.geometry import Array
from hdassist.textfile import Readable, TextFile
from hdassist.version import __version__

CORRECTION_SCHEMA = "hdassist.correction/1"
LARGEST_CORRECTION_FILE = 20_000_000  # bytes
CORRECTION_KINDS = {"table": CorrectionTable, "phasors": Phasors}
_UNITS = {"M_g": "M_g_Nm", "other_M_g": "other_M_g_Nm", "uncorrected_p50": "uncorrected_p50_arcsec"}
_UNITS |= {name: f"{name}_arcsec" for name in ("p5", "p50", "p95")}
_NAMES = {unit: name for name, unit in _UNITS.items()}


def correction_object(correction: CorrectionTable | Phasors, preset_sha256: str | None) -> Json:
    """A correction as JSON, with units in the names, which `read_correction` reads."""
    kind = "table" if isinstance(correction, CorrectionTable) else "phasors"
    fields = _renamed(as_json(correction), _UNITS)
    preset = {"name": fields.pop("preset"), "sha256": preset_sha256}
    return {"schema": CORRECTION_SCHEMA, "version": __version__, "preset": preset, "kind": kind, **fields}


def correction_columns(correction: CorrectionTable | Phasors) -> dict[str, Array]:
    """Columns of a correction by their names, of the same length each: points of a table, or lines."""
    if isinstance(correction, CorrectionTable):
        shaft = "output" if correction.turn == "output" else "cam"
        columns = {f"{shaft}_deg": correction.angles_deg, "error_arcsec": correction.error_arcsec}
        other = correction.other_direction_arcsec
        return columns if other is None else {**columns, "other_direction_arcsec": other}
    names = ("per_output_turn", "per_cam_turn", "amplitude_arcsec", "phase_deg", "uncertainty_arcsec")
    return {name: values for name in names if (values := getattr(correction, name)) is not None}


def read_correction(source: Readable) -> CorrectionTable | Phasors:
    """A correction from its JSON. Raises DataError: a file that is none, or whose numbers cannot be."""
    file = TextFile(source, LARGEST_CORRECTION_FILE)
    try:
        fields = json.loads("\n".join(text for _, text in file.parts()))
        if fields.pop("schema") != CORRECTION_SCHEMA:
            raise ValueError(f"expected schema {CORRECTION_SCHEMA}")
        fields.pop("version")
        fields = _renamed(fields, _NAMES) | {"preset": str(fields["preset"]["name"])}
        fields["expected"] = tuple(ExpectedResidual(**each) for each in fields["expected"])
        arrays = {name: np.array(value, dtype=float) for name, value in fields.items() if isinstance(value, list)}
        sizes = {each.shape for each in arrays.values()}
        if len(sizes) != 1 or len(min(sizes)) != 1 or not all(len(a) and np.isfinite(a).all() for a in arrays.values()):
            raise ValueError("expected lists of finite numbers, of the same length")
        correction: CorrectionTable | Phasors = CORRECTION_KINDS[fields.pop("kind")](**fields | arrays)
        if isinstance(correction, CorrectionTable) and not (isfinite(correction.u) and correction.u):
            raise ValueError("expected a ratio u that is not 0")
        if not np.isfinite(correction.error_at(np.zeros(1))).all():
            raise ValueError("expected a turn and a torque")
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError) as error:
        hint = "expected a file that `hdassist compensate` wrote"
        raise DataError(f"{file.name}: invalid correction: {type(error).__name__}: {error}", hint) from None
    return correction


def _renamed(value: Any, names: dict[str, str]) -> Any:
    """An object with its keys renamed, and those of objects in its lists."""
    if isinstance(value, dict):
        return {names.get(key, key): _renamed(each, names) for key, each in value.items()}
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return [_renamed(each, names) for each in value]
    return value
