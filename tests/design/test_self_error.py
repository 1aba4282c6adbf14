"""The self error as users of `hdassist check` meet it."""

from __future__ import annotations

import csv
import io
import json

import pytest

from hdassist import load_preset, self_error
from tests.helpers.process import SMALL, run

KEYS = {"self_error_arcsec": "range_arcsec", "tooth_phase_arcsec": "tooth_phase_arcsec",
        "ball_phase_arcsec": "ball_phase_arcsec"}  # fmt: skip


@pytest.mark.thorough
def test_table_json_and_csv_agree():
    points = json.loads(run("check", SMALL, "--json").stdout)["operating_points"]
    page = run("check", SMALL, "--details").stdout
    rows = csv.DictReader(io.StringIO(run("check", SMALL, "--csv", "-").stdout))
    for point, row, own in zip(points, rows, self_error(load_preset(SMALL), [1.0, 4.0]), strict=True):
        for key, name in KEYS.items():
            assert point[key] == pytest.approx(getattr(own, name), abs=1e-9)
            assert float(row[key]) == point[key]
            assert f"{getattr(own, name):.2f}" in page


def test_deviations_play_no_part():
    with_less = json.loads(run("check", SMALL, "--json", "--set", "tolerances.F_i2=0", "--draws", "0").stdout)
    points = json.loads(run("check", SMALL, "--json", "--draws", "0").stdout)["operating_points"]
    for less, point in zip(with_less["operating_points"], points, strict=True):
        assert less["self_error_arcsec"] == point["self_error_arcsec"]
