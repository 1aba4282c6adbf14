"""hdassist sensitivity: what it says, in each form."""

import json
import subprocess

import pytest

from tests.helpers.process import TINY, in_a_line, run

FEW = ("--torque", "4", "-n", "16", "--jobs", "1")


@pytest.fixture(scope="module")
def as_json() -> subprocess.CompletedProcess[str]:
    return run("sensitivity", TINY, *FEW, "--json")


def test_first_line_names_the_tolerance_to_tighten_and_fits() -> None:
    done = run("sensitivity", TINY, *FEW, "--distribution=uniform", "--known=phases.phi_hb", "--ascii")
    assert done.returncode == 0, done.stderr
    words = in_a_line(done.stdout)
    field = "single-flank composite deviation F'_i2 of the circular spline (tolerances.F_i2)"
    assert words.startswith(f"tiny, tighten first at 4 N*m: {field} If this tolerance is 20 % tighter, ")
    for part in ("95th percentile", "tolerances.F_i1", "verified", "next hdassist allocate", " --limit LIMIT "):
        assert part in words
    assert " over 16 random drives. The command tolerance uses 500." in words
    assert len(done.stdout.splitlines()) <= 24
    assert "..." not in done.stdout
    assert done.stdout.isascii()
    assert max(map(len, (line for line in done.stdout.splitlines() if TINY not in line))) <= 80


def test_json_has_influences_and_what_tighter_tolerances_bring(as_json: subprocess.CompletedProcess[str]) -> None:
    answer = json.loads(as_json.stdout)
    assert answer["schema"] == "hdassist.sensitivity/1"
    (point,) = answer["operating_points"]
    assert {way["field"] for way in point["tighter"]} == {f"tolerances.{n}" for n in ("F_i1", "F_i2", "e_hh", "e_hb")}
    assert point["tighter"][0]["proven"]
    assert point["F_ior_arcsec"]["p5"] < point["F_ior_arcsec"]["p50"] < point["F_ior_arcsec"]["p95"]
    assert all(0 < each["share"] <= 1 for each in point["influence"])
    first = point["tighter"][0]
    assert first["reduction"] == pytest.approx((first["now"] - first["then"]) / first["now"])
    assert 0 < first["reduction_low"] < first["reduction"] < first["reduction_high"] < 1
    assert answer["samples"]["effective"] >= 16
    assert answer["drives"] >= 32


@pytest.mark.thorough
def test_percentiles_agree_with_those_of_tolerance() -> None:
    """Both commands sample the same drives of the type, so the interval of one contains the percentile of the other."""
    few = json.loads(run("sensitivity", TINY, "--torque", "4", "-n", "96", "--jobs", "1", "--json").stdout)
    (point,) = few["operating_points"]
    stated = point["F_ior_arcsec"]
    assert stated["p95"] == point["tighter"][0]["now"]
    options = ("--torque", "4", "-n", "200", "--as-built", "--jobs", "1", "--json")
    more = json.loads(run("tolerance", TINY, *options).stdout)
    of_more = more["operating_points"][0]["as_built"]
    for name in ("p5", "p50", "p95"):
        low, high = stated[f"{name}_interval_arcsec"]
        low_of_more, high_of_more = of_more[f"{name}_interval_arcsec"]
        assert low <= of_more[f"{name}_arcsec"] <= high
        assert low_of_more <= stated[name] <= high_of_more


def test_a_share_that_is_missing_is_explained() -> None:
    page = run("sensitivity", TINY, *FEW).stdout
    assert "-: contribution too small to distinguish from chance" in page
    assert "contribution, %" not in page  # of which none is shown


def test_csv_has_a_row_a_field() -> None:
    done = run("sensitivity", TINY, *FEW, "--csv", "-")
    header, *rows = (line.split(",") for line in done.stdout.splitlines())
    assert header == ["preset", "M_g_Nm", "field", "share", "now_arcsec", "tighter_arcsec"]
    assert {"tolerances.e_hb", "tolerances.F_i1"} <= {row[2] for row in rows}


def test_the_same_whatever_the_processes(as_json: subprocess.CompletedProcess[str]) -> None:
    assert run("sensitivity", TINY, *FEW[:-1], "2", "--json").stdout == as_json.stdout


def test_a_design_of_no_drives_is_refused() -> None:
    done = run("sensitivity", TINY, "-n", "0")
    assert done.returncode == 2
    assert "-n" in done.stderr
