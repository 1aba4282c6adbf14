"""hdassist sensitivity: what it says, in each form."""

import json
import subprocess

import pytest

from tests.process import TINY, run

FEW = ("--torque", "4", "-n", "20", "--jobs", "1")


@pytest.fixture(scope="module")
def as_json() -> subprocess.CompletedProcess[str]:
    return run("sensitivity", TINY, *FEW, "--json")


def test_the_page_says_what_to_tighten_first_and_fits_a_terminal() -> None:
    uniform = ("--distribution=uniform", "--known=phases.phi_hb")
    done = run("sensitivity", TINY, *FEW, *uniform, "--set", "gears.j_n=5", "--ascii")
    assert done.returncode == 0, done.stderr
    told = " ".join(done.stdout.split())
    assert "no single tolerance is worth tightening by 20%: over 40 drives" in told
    again = f"hdassist sensitivity {TINY} --set gears.j_n=5 --torque=4 -n 80 --distribution=uniform"
    assert f"surer, with more drives: {again} --known=phases.phi_hb" in told
    for words in ("alone: the share", "tolerances.F_i1", "cam.W_0", "proof:", "next: hdassist allocate"):
        assert words in done.stdout
    assert "..." not in done.stdout
    assert done.stdout.isascii()
    assert max(map(len, (line for line in done.stdout.splitlines() if TINY not in line))) <= 80


def test_json_has_indices_and_slopes(as_json: subprocess.CompletedProcess[str]) -> None:
    told = json.loads(as_json.stdout)
    assert told["schema"] == "hdassist.sensitivity/1"
    (point,) = told["operating_points"]
    assert {index["field"] for index in point["indices"]} == {
        f"tolerances.{n}" for n in ("F_i1", "F_i2", "e_hh", "e_hb")
    }
    assert {way["field"] for way in point["tighter"]} == {index["field"] for index in point["indices"]}
    assert told["drives"] == 20 * 6
    steepest = told["slopes"][0]
    assert steepest["unit"] == "mm"
    assert len(steepest["arcsec_per_unit"]) == 1


def test_csv_has_a_row_a_field() -> None:
    done = run("sensitivity", TINY, *FEW, "--csv", "-")
    header, *rows = (line.split(",") for line in done.stdout.splitlines())
    assert header == ["preset", "M_g_Nm", "field", "arcsec_per_unit", "elasticity", "first", "total"]
    assert {"tolerances.e_hb", "cam.W_0"} <= {row[2] for row in rows}


def test_the_same_whatever_the_processes(as_json: subprocess.CompletedProcess[str]) -> None:
    assert run("sensitivity", TINY, *FEW[:-1], "2", "--json").stdout == as_json.stdout


def test_a_design_of_nothing_is_refused() -> None:
    done = run("sensitivity", TINY, "-n", "0")
    assert done.returncode == 2
    assert "-n" in done.stderr
