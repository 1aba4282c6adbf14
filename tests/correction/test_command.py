"""`hdassist compensate` as its users meet it."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest

from hdassist.interface.pages.compensate import UNPROVEN
from tests.helpers.process import TINY, in_a_line, run

OPEN = ("--set", "phases.xi_b=unknown", "--draws", "8")


def test_a_screen_says_first_how_much_can_be_taken_off():
    page = run("compensate", "tiny.yaml", cwd=Path(TINY).parent)  # a short name: the page repeats it
    lines = page.stdout.splitlines()
    assert page.returncode == 0
    head = "tiny, correction at 1 N·m: residual F'_ior 0.3″ (1 % of 35.4″) with 320 correction terms "
    why = "The error repeats mainly 10, 22 and 21 times per output revolution; "
    assert in_a_line(page.stdout).startswith(head + why)
    assert UNPROVEN in lines
    assert "--csv correction.csv" in in_a_line(page.stdout)
    assert any("before, " in line and line.endswith("after") for line in lines)
    assert len(lines) <= 28
    assert max(map(len, lines)) <= 80


def test_fewer_correction_terms_are_optional_and_residuals_are_listed():
    found = json.loads(run("compensate", TINY, "--points", "80", "--json").stdout)
    assert len(found["correction"]["amplitude_arcsec"]) == 80
    left = found["phasors"]
    assert found["forms"][0]["residuals"][0]["p50"] == pytest.approx(left["80"])
    assert sorted(left.values(), reverse=True) == [*left.values()]
    words = in_a_line(run("compensate", TINY, "--no-plot").stdout)
    assert "residual with 20 terms: 9″, 80: 2.7″, " in words


def test_table_of_many_torques_fits_the_screen_width():
    torques = [word for M_g in ("1", "2", "-2", "4") for word in ("--torque", M_g)]
    lines = run("compensate", TINY, *torques, "--no-plot").stdout.splitlines()
    assert max(map(len, lines)) <= 80
    assert "rev. lost" in in_a_line("\n".join(lines))


def test_phasors_and_tables_are_written_as_figures():
    rows = list(csv.DictReader(io.StringIO(run("compensate", TINY, "--csv", "-").stdout)))
    assert [*rows[0]] == ["per_output_turn", "per_cam_turn", "amplitude_arcsec", "phase_deg"]
    options = ("--torque", "1", "--torque", "-1", "--form", "output", "--points", "36", "--each-load", "--csv", "-")
    rows = list(csv.DictReader(io.StringIO(run("compensate", TINY, *options).stdout)))
    assert [*rows[0]] == ["M_g_Nm", "output_deg", "error_arcsec"]
    assert [float(row["output_deg"]) for row in rows] == pytest.approx([10 * k for k in range(36)] * 2)
    assert [float(row["M_g_Nm"]) for row in rows] == [1.0] * 36 + [-1.0] * 36
    single = run("compensate", TINY, *options[2:4], *options[4:8], "--csv", "-").stdout
    alone = [float(row["error_arcsec"]) for row in csv.DictReader(io.StringIO(single))]
    assert [float(row["error_arcsec"]) for row in rows[36:]] == pytest.approx(alone)


def test_json_has_a_correction_per_load_unless_it_may_harm():
    found = json.loads(run("compensate", TINY, "--torque", "1", "--torque", "4", "--each-load", "--json").stdout)
    assert [each["M_g"] for each in found["corrections"]] == [1.0, 4.0]
    assert found["corrections"][0] == found["correction"]
    (other,) = json.loads(run("compensate", TINY, "--torque", "4", "--json").stdout)["corrections"]
    here = found["corrections"][1]
    strong = [k for k, size in enumerate(other["amplitude_arcsec"]) if size > 0.1]
    for k in strong:
        place = here["per_cam_turn"].index(other["per_cam_turn"][k])
        assert here["amplitude_arcsec"][place] == pytest.approx(other["amplitude_arcsec"][k])
    weak = ("--form", "output", "--points", "12", "--each-load")
    page = in_a_line(run("compensate", TINY, *weak, "--no-plot").stdout)
    worse = json.loads(run("compensate", TINY, *weak, "--json").stdout)["corrections"]
    assert ("stored no correction for 4 N·m, where it may increase the error" in page) == (len(worse) == 1)


def test_next_command_keeps_the_form_and_disappears_once_written(tmp_path: Path):
    options = ("compensate", TINY, "--form", "output", "--points", "36", "--each-load", "--no-plot")
    page = in_a_line(run(*options).stdout)
    assert "--form=output --points=36 --each-load --csv correction.csv" in page
    assert "next " not in run(*options, "--csv", str(tmp_path / "table.csv")).stdout


def test_json_has_all_forms_and_the_correction():
    found = json.loads(run("compensate", TINY, "--form", "cam", "--points", "16", "--json").stdout)
    assert found["schema"] == "hdassist.compensate/1"
    assert len(found["correction"]["error_arcsec"]) == 16
    assert {each["case"] for each in found["forms"][0]["residuals"]} >= {"in place", "turn lost"}
    assert [part["name"] for part in found["parts"]][:2] == ["with the cam", "beats"]


@pytest.mark.thorough
def test_correction_that_may_worsen_a_drive_is_refused(tmp_path: Path):
    table = tmp_path / "table.csv"
    page = run("compensate", TINY, *OPEN, "--csv", str(table), "--no-plot")
    assert page.returncode == 5
    assert "record the error first: " in page.stdout
    assert "correction terms: refused" in page.stderr
    few = run("compensate", TINY, *OPEN, "--form", "output", "--points", "12", "--no-plot").stdout
    assert "points over one output revolution would halve" in in_a_line(few.partition("The error repeats")[0])
    assert not table.exists()
    assert json.loads(run("compensate", TINY, *OPEN, "--json").stdout)["correction"] is None


def test_details_have_parts_forms_and_lines_before_and_after():
    page = run("compensate", TINY, "--details", "--no-plot", "--ascii").stdout
    for words in ("half input", "before, arcsec"):
        assert words in page


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--points", "1"), "--points"),
        (("--set", "bearing.ball_motion=rolling", "--set", "bearing.d_ball=5"), "requires bearing.ball_motion: locked"),
    ],
)
def test_wrong_options_are_refused_in_words(options: tuple[str, ...], words: str):
    answer = run("compensate", TINY, *options)
    assert answer.returncode == 2
    assert words in answer.stderr


def test_weak_table_is_written_with_a_warning_naming_better_formats(tmp_path: Path):
    poor = ("compensate", TINY, "--draws", "0", "--form", "output", "-q", "--write")
    done = run(*poor, "linuxcnc-1=t.comp", "--points", "30", cwd=tmp_path)
    assert done.returncode == 0
    before, _, after = done.stderr.partition("wrote t.comp")
    assert "warning: 30 points per output revolution leave " in before
    assert (
        " halves the error. Formats that can store it: csv, c, linuxcnc-1, twincat-cnc, twincat-nc, siemens-840d"
    ) in before
    assert not after.strip()
    assert "warning" not in run(*poor, "c=t.h", "--points", "720", cwd=tmp_path).stderr
