"""`hdassist mount` as its users meet it."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path

import pytest

from hdassist import kinematic_error, load_preset
from tests.helpers.process import TINY, run, run_cold

QUICK = ("mount", TINY, "--set", "mounting.holes=6")


@pytest.fixture(scope="module")
def answer():
    return run(*QUICK, "--json", "--jobs", "2")


def test_json_has_what_others_build_on(answer):
    assert answer.returncode == 0
    assert answer.stderr == ""
    told = json.loads(answer.stdout)
    assert told["schema"] == "hdassist.mount/3"
    assert [c["M_g_Nm"] for c in told["curves"]] == [1, 4]
    for curve in told["curves"]:
        assert curve["phase_deg"] == [90, 150, 210, 270, 330, 30]
        assert len(curve["F_ior_arcsec"]) == 6
    for name in ("current", "recommended", "worst"):
        assert {"rotation_deg", "phase_deg", "hole", "F_ior_arcsec"} <= set(told[name])
    assert (told["current"]["rotation_deg"], told["current"]["hole"]) == (0, 0)
    best = told["recommended"]
    assert best["hole"] == best["rotation_deg"] / 60
    now = told["current"]["F_ior_arcsec"]
    worst_served = max(b / n for b, n in zip(best["F_ior_arcsec"], now, strict=True))
    assert told["gain"]["p50"] == pytest.approx(1 - worst_served)
    assert told["gain"]["p50"] > 0.1
    assert told["certificate"]["states"] == 12 * 220


def test_the_recommended_position_holds_when_checked_alone(answer):
    best = json.loads(answer.stdout)["recommended"]
    drive = load_preset(TINY, [f"phases.xi_b={90 + best['rotation_deg']}"])
    for M_g, value in zip((1.0, 4.0), best["F_ior_arcsec"], strict=True):
        assert kinematic_error(drive, M_g).F_ior_arcsec == pytest.approx(value, abs=1e-9)


@pytest.mark.thorough
def test_the_same_digits_for_any_number_of_jobs(answer):
    # and for any hash seed
    assert run_cold(*QUICK, "--json", "--jobs", "1").stdout == answer.stdout


def test_people_see_curve_and_tables(answer):
    page = run("mount", "tiny.yaml", *QUICK[2:], cwd=Path(TINY).parent)  # a short name, as the next command repeats it
    assert page.returncode == 0
    assert max(map(len, page.stdout.splitlines())) <= 80
    for words in ("wave generator side", "hole", "counter-clockwise", "hole (N: now", "verified"):
        assert words in page.stdout
    assert len(page.stdout.splitlines()) <= 30
    told = json.loads(answer.stdout)
    one, other = (f"{F_ior:.2f}" for F_ior in told["recommended"]["F_ior_arcsec"])
    assert re.search(rf"best +\d+ +{one} +{other} ", page.stdout)
    assert "its probability is unknown." in page.stdout
    assert run(*QUICK, "-q").stdout == f"{told['recommended']['hole']}\n"


def test_curves_and_the_other_tables_stand_in_the_details():
    page = run(*QUICK, "--details")
    for words in ("F'_ior at 1 N·m", "F'_ior at 4 N·m", "seen from the wave generator side: ", "equilibrium"):
        assert words in page.stdout


def test_figures_and_torques():
    result = run(*QUICK, "--torque", "2", "--torque", "3", "--csv", "-")
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert len(rows) == 12
    assert {float(r["M_g_Nm"]) for r in rows} == {2, 3}


@pytest.mark.parametrize(
    ("args", "code"),
    [
        (["--step", "7"], 2),
        (["--step", "0"], 2),
        (["--step", "nan"], 2),
        (["--torque", "1e6"], 5),
    ],
)
def test_wrong_input(args, code):
    result = run("mount", TINY, *args)
    assert result.returncode == code
    assert result.stdout == ""
    assert "error: " in result.stderr
    assert "Traceback" not in result.stderr
