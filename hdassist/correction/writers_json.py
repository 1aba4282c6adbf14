"""A correction as figures, and read again from the JSON of `hdassist compensate`."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from hdassist.correction.table import CorrectionTable, ExpectedResidual, Phasors
from hdassist.errors import DataError
from hdassist.model.geometry import Array
from hdassist.textfile import Readable, TextFile

COMPENSATE_SCHEMA = "hdassist.compensate/1"
LARGEST_CORRECTION_FILE = 50_000_000  # bytes


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
    """The correction of an answer of `compensate --json`.

    Raises DataError: a file that is none, an answer whose correction was refused, or numbers that cannot be.
    """
    file = TextFile(source, LARGEST_CORRECTION_FILE)
    try:
        answer = json.loads("\n".join(text for _, text in file.parts()))
        if answer["schema"] != COMPENSATE_SCHEMA:
            raise ValueError(f"expected schema {COMPENSATE_SCHEMA}")
        fields = answer["correction"]
        if fields is None:
            raise ValueError("it was refused, as it may make the drive worse")
        arrays: dict[str, Any] = {name: np.array(each) for name, each in fields.items() if isinstance(each, list)}
        arrays["expected"] = tuple(ExpectedResidual(**each) for each in fields["expected"])
        correction: CorrectionTable | Phasors = (CorrectionTable if "turn" in fields else Phasors)(**fields | arrays)
        figures = np.array([*correction_columns(correction).values()], dtype=float)
        if not (np.isfinite(figures).all() and np.isfinite(correction.error_at(np.ones(1))).all()):
            raise ValueError("expected lists of finite numbers, of the same length")
    except (ValueError, ArithmeticError, KeyError, TypeError, AttributeError, RecursionError) as error:
        hint = "expected the answer of `hdassist compensate --json`"
        raise DataError(f"{file.name}: invalid correction: {type(error).__name__}: {error}", hint) from None
    return correction
