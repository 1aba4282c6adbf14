"""`hdassist compare` as its users meet it."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from hdassist import load_preset, trace
from hdassist.run.run import UNCHECKED
from tests.helpers.process import SMALL, in_a_line, run
from tests.helpers.rigs import text

ROOT = Path(__file__).parents[2]
KEYS = {
    "schema", "version", "preset", "exit_code", "warnings", "file", "notes", "M_g_Nm", "place", "cam_revolutions",
    "measured", "predicted", "difference", "residual", "chi_square", "degrees_of_freedom", "orders", "finding",
    "mirrored", "singles", "joint", "certificate", "seed",
}  # fmt: skip
HIDDEN = ["tolerances.e_hb=45"]


@pytest.fixture(scope="module")
def rig(tmp_path_factory) -> Path:
    """A folder with records of the small drive, one of a changed one with noise."""
    folder = tmp_path_factory.mktemp("rig")
    for name, overrides, noise in (("own.csv", [], 0.0), ("changed.csv", HIDDEN, 0.5)):
        result = trace(load_preset(SMALL, overrides), 4, start_deg=20, revolutions=5, run=UNCHECKED).error
        error = result.error_arcsec + noise * np.random.default_rng(0).standard_normal(len(result.states))
        columns = [np.degrees(result.states.phi_h), np.degrees(result.states.phi_g), error]
        (folder / name).write_text(text(columns, "phi_h_deg,phi_g_deg,error_arcsec", digits=9))
    return folder


def test_what_trace_writes_agrees_with_its_drive(rig):
    written = run("trace", SMALL, "--torque", "4", "-n", "3", "--phi-g0", "20", "--csv", "traced.csv", "-q", cwd=rig)
    assert written.returncode == 0
    result = run(
        "compare", SMALL, "traced.csv", "--torque", "4", "--phi-g0", "20", "--json", "--csv", "both.csv", cwd=rig
    )
    assert (result.returncode, result.stderr) == (0, "wrote both.csv\n")
    told = json.loads(result.stdout)
    assert set(told) == KEYS
    assert told["schema"] == "hdassist.compare/1"
    assert told["preset"]["name"] == "small"
    assert told["file"]["rows"] == 3 * 62
    assert told["finding"]["kind"] == "agrees"
    assert told["residual"]["range_arcsec"] < 1e-6
    assert told["place"] == {
        "phi_g0_deg": pytest.approx(20), "phi_g0_uncertainty_deg": None, "phi_g0_fitted": False, "cam_zero_deg": 0,
        "cam_zero_uncertainty_deg": None, "cam_zero_fitted": False, "error_is": "cam-output", "cam_sense": "ccw",
    }  # fmt: skip
    rows = list(csv.DictReader(io.StringIO((rig / "both.csv").read_text())))
    assert max(abs(float(row["residual_arcsec"])) for row in rows) < 1e-6
    assert len(rows) == 3 * 62


@pytest.mark.thorough
def test_a_warning_names_the_preset_that_leaves_a_value_out(rig):
    page = run("compare", SMALL, "own.csv", "--torque", "4", "--set", "phases.xi_b=unknown", cwd=rig)
    unknown, drift = page.stderr.splitlines()
    assert unknown == "warning: small: unknown, and set to 0: phases.xi_b"
    assert drift.startswith("warning: small: own.csv: a linear drift of ")


@pytest.mark.thorough
def test_people_see_both_curves_and_what_would_explain_them(rig):
    page = run("compare", SMALL, "changed.csv", "--torque", "4", "--phi-g0", "20", "--ascii", cwd=rig)
    assert page.returncode == 0
    assert page.stdout.isascii()
    assert max(map(len, page.stdout.splitlines())) <= 80
    told = in_a_line(page.stdout)
    assert told.startswith(
        "changed.csv compared with small at 4 N*m: explained by one deviation wave generator eccentricity, "
        "fixed to the circular spline's seat (tolerances.e_hb), 4"
    )
    for words in ("* measured, o predicted", "next hdassist mount ", "--set tolerances.e_hb=4", "verified"):
        assert words in told
    assert len(page.stdout.splitlines()) <= 24 + 2  # a table in 7-bit characters has borders
    whole = run(
        "compare", SMALL, "changed.csv", "--torque", "4", "--phi-g0", "20", "--details", "--no-plot", cwd=rig
    ).stdout
    for words in ("phi_g0    20°, given", "deviations fitted one at a time"):
        assert words in whole


@pytest.mark.slow
def test_the_answer_alone_goes_back_into_the_command(rig):
    first = run("compare", SMALL, "changed.csv", "--torque", "4", "-q", "--phi-g0", "20", cwd=rig)
    kind, *options = first.stdout.split()
    assert kind == "one"
    again = run("compare", SMALL, "changed.csv", "--torque", "4", "-q", "--phi-g0", "20", *options, cwd=rig)
    assert again.stdout == "agrees\n"


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        (["own.csv"], 2, "several torques: 1, 4"),
        (["none.csv", "--torque", "4"], 4, "no such file: none.csv"),
        (["noise.csv", "--torque", "4"], 5, "does not exceed its noise"),
    ],
)
def test_faults_end_clearly_and_write_nothing(rig, args, code, words):
    turns = np.arange(240) / 60
    noise = np.random.default_rng(2).standard_normal(240)
    (rig / "noise.csv").write_text(text([360 * turns, noise], "cam_deg,error_arcsec"))
    result = run("compare", SMALL, *args, "-o", "page.txt", cwd=rig)
    assert (result.returncode, result.stdout) == (code, "")
    assert words in result.stderr
    assert not (rig / "page.txt").exists()
