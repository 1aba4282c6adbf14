"""`hdassist trace` as its users meet it."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path

import pytest

from tests.helpers.process import SMALL, TINY, in_a_line, run


def test_one_turn_in_json():
    result = run("trace", SMALL, "--torque", "4", "--phi-g0", "20", "--json")
    assert result.returncode == 0
    told = json.loads(result.stdout)
    assert told["schema"] == "hdassist.trace/1"
    assert (told["M_g_Nm"], told["phi_g0_deg"]) == (4, 20)
    assert len(told["phi_h_deg"]) == len(told["error_arcsec"]) == 62
    assert told["phi_h_deg"][1] == pytest.approx(360 / 62)
    assert told["error_arcsec"][0] == 0
    assert told["range_arcsec"] == pytest.approx(max(told["error_arcsec"]) - min(told["error_arcsec"]))
    assert told["certificate"]["states"] == 62
    assert {"per_cam_rev", "amplitude_arcsec", "phase_deg", "cause"} == set(told["orders"][0])


def test_whole_cycle_as_csv():
    rows = list(csv.DictReader(io.StringIO(run("trace", SMALL, "-n", "30", "--csv", "-").stdout)))
    assert len(rows) == 1860
    assert float(rows[-1]["phi_h_deg"]) == pytest.approx(30 * 360 - 360 / 62)
    # the flexspline has gone one turn back
    assert float(rows[-1]["phi_g_deg"]) == pytest.approx(-360 + 360 / 62 / 30)


def test_a_screen_holds_the_range_the_orders_and_the_curve():
    page = run("trace", "small.yaml", cwd=Path(SMALL).parent)  # a short name: the page repeats it
    lines = page.stdout.splitlines()
    told = json.loads(run("trace", SMALL, "--json").stdout)
    assert page.returncode == 0
    assert lines[0] == f"small (nominal), 1 N·m, 1 input revolution from phi_g0 = 0°: range {told['range_arcsec']:.2f}″"
    assert lines[1] == "The curve covers 1 of 30 input revolutions, so F'_ior is at least as large."
    greatest = max(told["orders"], key=lambda order: order["amplitude_arcsec"])
    row = rf" *{greatest['per_cam_rev']:.2f} +{greatest['amplitude_arcsec']:.2f} +{greatest['cause'][:20]}"
    assert any(re.match(row, line) for line in lines)
    assert any(re.match(r"next +hdassist trace .* -n 30 ", line) for line in lines)
    assert lines[-1].startswith("verified  ")
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert "amplitude·cos(order·phi_h + phase)" in run("trace", SMALL, "--no-plot", "--details").stdout
    whole = run("trace", SMALL, "-n", "30").stdout
    assert "of the full cycle:" not in whole
    assert "envelope per input revolution" in in_a_line(whole)


def test_quiet_prints_the_range():
    told = json.loads(run("trace", SMALL, "--json").stdout)
    assert run("trace", SMALL, "-q").stdout == f"{told['range_arcsec']:.2f} arcsec\n"


@pytest.mark.parametrize(
    ("args", "code"),
    [
        (["-n", "0"], 2),
        (["-n", "31"], 2),
        (["--torque", "nan"], 2),
        (["--torque", "1e6"], 5),
        (["--phi-g0", "nan"], 2),
    ],
)
def test_wrong_input(args, code):
    result = run("trace", SMALL, *args)
    assert result.returncode == code
    assert result.stdout == ""
    assert result.stderr


def test_a_start_angle_moves_the_trace():
    ranges = {run("trace", SMALL, "-q", "--phi-g0", angle).stdout for angle in ("0", "90", "180")}
    assert len(ranges) == 3


def test_a_solver_that_doubts_itself_says_nothing_on_stderr():
    # so stiff a seat makes the cross-check's solver warn of its own accuracy; the comparison is what counts
    result = run("trace", "vzp160", "-q", "--set", "contact.c_bore=1e-9")
    assert result.returncode == 0
    assert result.stderr == ""


def test_trace_names_unknown_inputs_that_it_computes_as_zero():
    done = run("trace", SMALL, "--torque", "4", "--set", "phases.phi_hb=unknown", "--json")
    told = json.loads(done.stdout)
    assert [each["field"] for each in told["unknown"]] == ["phases.phi_hb"]
    assert told["warnings"] == ["unknown, and set to 0: phases.phi_hb"]
    assert told["warnings"][0] in done.stderr


def test_trace_uses_nominal_values_and_notes_that_measurements_are_ignored():
    measured = run("trace", TINY, "--set", "measured.lost_motion=50", "--no-plot").stdout
    plain = run("trace", TINY, "--no-plot").stdout
    assert all(page.startswith("tiny (nominal), 1 N·m, ") for page in (measured, plain))
    assert "measurements of the drive are not taken into account" in measured
    assert "what was measured" not in plain
    assert json.loads(run("trace", TINY, "--json").stdout)["statistic"] == "nominal"


def test_trace_without_known_deviations_lists_no_orders_of_zero_amplitude():
    unknown = [word for size in ("F_i1", "F_i2", "e_hb", "e_hh") for word in ("--set", f"tolerances.{size}=unknown")]
    page = run("trace", TINY, "--torque", "4", *unknown).stdout
    assert "Unknown inputs are set to 0" in in_a_line(page)
    assert not re.search(r"^ *\d+\.\d\d +0\.00 ", page, re.MULTILINE)
