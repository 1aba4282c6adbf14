"""`hdassist self-error` as its users meet it."""

from __future__ import annotations

import csv
import io
import json

import pytest

from hdassist import load_preset, self_error
from tests.process import SMALL, run


def test_table_json_csv_and_quiet_agree():
    told = json.loads(run("self-error", SMALL, "--json").stdout)
    assert told["schema"] == "hdassist.self-error/1"
    assert told["certificate"]["states"] == 2 * 16
    page, quiet = run("self-error", SMALL).stdout, run("self-error", SMALL, "-q").stdout
    rows = list(csv.DictReader(io.StringIO(run("self-error", SMALL, "--csv", "-").stdout)))
    for point, own in zip(told["operating_points"], self_error(load_preset(SMALL), [1.0, 4.0]), strict=True):
        assert point["self_error_arcsec"] == pytest.approx(own.range_arcsec, abs=1e-9)
        values = [float(r["rotation_arcsec"]) for r in rows if float(r["M_g_Nm"]) == point["M_g_Nm"]]
        assert max(values) - min(values) == pytest.approx(own.range_arcsec, abs=1e-9)
        assert f"{own.range_arcsec:.2f}" in page
        assert f"{point['M_g_Nm']:g} N*m: self error {own.range_arcsec:.2f} arcsec\n" in quiet
    assert max(map(len, page.splitlines())) <= 80


def test_deviations_play_no_part():
    with_less = run("self-error", SMALL, "-q", "--set", "tolerances.F_i2=0", "--set", "phases.xi_b=10")
    assert with_less.stdout == run("self-error", SMALL, "-q").stdout


@pytest.mark.parametrize(("args", "code"), [(["--torque", "0"], 2), (["--torque", "1e6"], 5), (["--nonsense"], 2)])
def test_wrong_input(args, code):
    result = run("self-error", SMALL, *args)
    assert result.returncode == code
    assert result.stdout == ""
    assert result.stderr
