"""The form for a trace asks for columns that `hdassist measure` reads as they are named."""

import re
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from hdassist.readers.trace import read_trace

FORM = Path(__file__).parents[2] / ".github/ISSUE_TEMPLATE/trace.md"


@pytest.mark.parametrize("left_out", ["output_angle_deg", "error_arcsec"])
def test_a_record_with_the_columns_of_the_form_is_read(left_out):
    asked = re.findall(r"`(\w+)`", "".join(re.findall(r"^\| (`.*?) \|", FORM.read_text("utf-8"), flags=re.MULTILINE)))
    columns = [name for name in asked if name != left_out]
    assert len(columns) == len(asked) - 1
    cam = np.arange(0.0, 1440.0)
    error = 10 * np.sin(np.radians(2 * cam))
    values = {"cam_angle_deg": cam, "error_arcsec": error, "output_angle_deg": cam / 100 + error / 3600}
    rows = np.column_stack([values.get(name, np.full(len(cam), 20.0)) for name in columns])
    text = BytesIO()
    np.savetxt(text, rows, delimiter=",", header=",".join(columns), comments="")
    text.seek(0)
    trace = read_trace(text, ratio=100)
    assert trace.cam_deg == pytest.approx(cam)
    assert np.ptp(trace.error_arcsec) == pytest.approx(20, abs=0.01)
