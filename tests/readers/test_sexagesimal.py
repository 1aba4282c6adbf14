"""Angles in degrees, minutes and seconds: the same numbers as in degrees, or a fault with its line."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdassist.readers.table import NumberTable, read_numbers
from hdassist.readers.words import sexagesimal_degrees
from hdassist.run.errors import PresetError
from tests.helpers.process import run

FORMS = {
    "signs": "{sign}{d}°{m:02d}'{s:07.4f}\"",
    "primes": "{sign}{d}° {m}′ {s:.4f}″",
    "letters": "{sign}{d}d{m:02d}m{s:07.4f}s",
    "colons": "{sign}{d}:{m:02d}:{s:07.4f}",
}


def written(degrees: float, form: str) -> str:
    """An angle in degrees, minutes and seconds, to 1e-4 arcsec."""
    tenths_of_mas = round(abs(degrees) * 3600 * 10_000)
    minutes, seconds = divmod(tenths_of_mas, 60 * 10_000)
    sign = "-" if degrees < 0 else ""
    return FORMS[form].format(sign=sign, d=minutes // 60, m=minutes % 60, s=seconds / 10_000)


def table_of(text: str) -> NumberTable:
    table = read_numbers(io.StringIO(text), takes_sexagesimal=True)
    table.require_sound()
    return table


@given(st.floats(-2000, 2000), st.sampled_from(sorted(FORMS)))
def test_every_form_is_read_back(degrees: float, form: str):
    found = sexagesimal_degrees(written(degrees, form), by_colons=True)
    assert found == pytest.approx(degrees, abs=1e-4 / 3600)


@pytest.mark.parametrize(
    ("text", "degrees"),
    [("12°", 12.0), ("12°30'", 12.5), ("12° 30,6'", 12.51), ("-0°30'", -0.5), ("-0:00:36", -0.01), ("1:30", 1.5)],
)
def test_parts_may_be_left_out_from_the_end(text: str, degrees: float):
    assert sexagesimal_degrees(text, by_colons=True) == pytest.approx(degrees, abs=1e-12)


@pytest.mark.parametrize("text", ["12.5", "12'30\"", "12.5°30'", "1e3°", "", "12h30m", "90d-1m"])
def test_another_text_is_none_of_them(text: str):
    assert sexagesimal_degrees(text, by_colons=True) is None


@pytest.mark.parametrize("text", ["12°60'", "12°30'75\"", "12°30.5'10\"", "12:61:00"])
def test_minutes_and_seconds_that_cannot_be_are_refused(text: str):
    with pytest.raises(ValueError):
        sexagesimal_degrees(text, by_colons=True)


def test_colons_in_a_column_of_time_are_no_angle():
    assert sexagesimal_degrees("12:30:00", by_colons=False) is None
    with pytest.raises(PresetError):
        table_of("time;error_arcsec\n12:30:00;1\n12:30:01;2\n")


@pytest.mark.thorough
@pytest.mark.parametrize("form", sorted(FORMS))
@pytest.mark.parametrize("separator", [";", ",", "\t"])
def test_a_recording_gives_the_same_error_as_in_degrees(tmp_path, form: str, separator: str):
    cam_deg = np.arange(0, 360 * 30, 12.0)
    output_deg = cam_deg / 30 + (20 * np.sin(2 * np.radians(cam_deg)) + 3 * np.sin(np.radians(cam_deg / 30))) / 3600
    rows = [f"{cam:.1f}{separator}{written(output, form)}" for cam, output in zip(cam_deg, output_deg, strict=True)]
    plain = [f"{cam:.1f}{separator}{output:.9f}" for cam, output in zip(cam_deg, output_deg, strict=True)]
    (tmp_path / "dms.csv").write_text("\n".join([f"cam_deg{separator}output", *rows]) + "\n", encoding="utf-8")
    (tmp_path / "deg.csv").write_text("\n".join([f"cam_deg{separator}output_deg", *plain]) + "\n")
    values = []
    for file in ("dms.csv", "deg.csv"):
        answer = json.loads(run("measure", file, "--ratio", "30", "--json", cwd=tmp_path).stdout)
        values.append(answer["F_ior_arcsec"])
    assert values[0] == pytest.approx(values[1], abs=2e-3)


@pytest.mark.parametrize(
    ("names", "cells", "fault"),
    [
        ("cam_deg;output", ["12.6"], "1 of 400 rows"),
        ("cam_deg;output_arcsec", [], "the unit arcsec is stated"),
        ("cam_deg;output", ["12°75'"], "minutes and seconds must be below 60"),
        ("cam_deg;torque_Nm;error", [], "is read as torque"),
    ],
)
def test_a_mixed_column_another_unit_and_another_quantity_are_refused(
    tmp_path, names: str, cells: list[str], fault: str
):
    angles = [written(12 + step / 1000, "signs") for step in range(400 - len(cells))] + cells
    error = ";1" if names.endswith("error") else ""
    rows = [f"{10 * step};{angle}{error}" for step, angle in enumerate(angles)]
    (tmp_path / "rows.csv").write_text("\n".join([names, *rows]) + "\n", encoding="utf-8")
    refused = run("measure", "rows.csv", "--ratio", "30", cwd=tmp_path)
    assert refused.returncode == 4
    assert fault in refused.stderr
