"""`hdassist stiffness` as its users meet it."""

from __future__ import annotations

import csv
import io
import json
import re

import pytest

from hdassist import load_preset
from hdassist.drive.error.stiffness import Stiffness, stiffness
from hdassist.interface.pages.curves import stiffness_report, stiffness_warnings
from hdassist.interface.terminal.page import report_page
from hdassist.interface.terminal.streams import Style, console
from hdassist.run.run import UNCHECKED
from tests.helpers.process import SMALL, TINY, in_a_line, run


@pytest.fixture(scope="module")
def answer():
    return run("stiffness", SMALL, "--json")


def test_json_has_what_others_build_on(answer):
    assert answer.returncode == 0
    told = json.loads(answer.stdout)
    assert told["schema"] == "hdassist.stiffness/1"
    assert set(told["curve"]) == {"torque_Nm", "twist_arcsec", "contact_arcsec", "tube_arcsec"}
    for side in ("positive", "negative"):
        assert [set(s) for s in told[side]] == 3 * [{"from_Nm", "to_Nm", "stiffness_Nm_per_rad"}]
    assert told["lost_motion_arcsec"] >= told["play_arcsec"] > 0
    assert told["certificate"]["cross_check"]["max_difference_arcsec"] <= 0.01
    # no rated torque in the preset: said, on stderr and in the answer
    assert "operation.rated" in told["warnings"][0]
    assert "operation.rated" in answer.stderr


def test_people_figures_and_the_answer_alone(answer):
    told = json.loads(answer.stdout)
    page = run("stiffness", SMALL, "--csv", "-", "--set", "operation.rated=4")
    rows = list(csv.DictReader(io.StringIO(page.stdout)))
    assert [float(r["twist_arcsec"]) for r in rows] == told["curve"]["twist_arcsec"]
    assert page.stderr == ""
    page = run("stiffness", SMALL, "--set", "operation.rated=4")
    assert max(map(len, page.stdout.splitlines())) <= 80
    for words in ("twist, ″", "K1", "K3", "lost motion", "HIGHS", "--details"):
        assert words in page.stdout
    more = run("stiffness", SMALL, "--set", "operation.rated=4", "--details").stdout
    for words in ("0 to -", "equilibrium"):
        assert words in more
    quiet = run("stiffness", SMALL, "-q").stdout.splitlines()
    assert quiet[-1] == f"lost motion: {told['lost_motion_arcsec']:.2f} arcsec"


SAID = ("--set", "catalogue.K_1=3 kN*m/rad", "--set", "catalogue.K_3=5900", "--set", "catalogue.T_1=2")


@pytest.mark.moves("catalogue.K_1", "catalogue.K_2", "catalogue.K_3", "catalogue.lost_motion")
def test_each_figure_of_the_catalogue_stands_beside_ours(answer):
    ours = json.loads(answer.stdout)
    assert ours["catalogue"] is None
    figures = {f"K_{k}": s["stiffness_Nm_per_rad"] for k, s in enumerate(ours["positive"], 1)}
    figures["lost_motion"] = ours["lost_motion_arcsec"]
    half = [part for name, value in figures.items() for part in ("--set", f"catalogue.{name}={value / 2!r}")]
    told = json.loads(run("stiffness", SMALL, "--json", *half).stdout)
    assert told["positive"] == ours["positive"]
    assert told["catalogue"]["off_percent"] == pytest.approx(dict.fromkeys(figures, 100.0))
    assert told["catalogue"]["K_2_Nm_per_rad"] == figures["K_2"] / 2
    assert told["catalogue"]["T_1_Nm"] is None


@pytest.mark.moves("catalogue.T_1", "catalogue.T_2")
def test_segments_end_where_the_catalogue_has_it_unless_asked_otherwise():
    told = json.loads(run("stiffness", SMALL, "--json", *SAID, "--set", "catalogue.T_2=6").stdout)
    assert [s["to_Nm"] for s in told["positive"]] == [2, 6, 9]
    told = json.loads(run("stiffness", SMALL, "--json", *SAID, "--t1", "3", "--t2", "5").stdout)
    assert [s["to_Nm"] for s in told["positive"]] == [3, 5, 7.5]
    # chords between other torques are other stiffnesses
    assert set(told["catalogue"]["off_percent"].values()) == {None}
    told = json.loads(run("stiffness", SMALL, "--json", *SAID, "--to", "3").stdout)
    assert [s["to_Nm"] for s in told["positive"]] == [2]
    assert told["catalogue"]["off_percent"]["K_3"] is None


def test_a_page_says_what_is_compared():
    page = run("stiffness", SMALL, "--no-plot", *SAID, "--ascii", "--set", "catalogue.lost_motion=5 arcmin").stdout
    assert max(map(len, page.splitlines())) <= 80
    heads, *rows = [re.split(" {2,}", line) for line in page.splitlines() if re.match(r" +torque,|K[123] ", line)]
    assert heads[3:5] == ["catalogue", "difference"]
    assert [row[3] for row in rows] == 2 * ["0.3", "-", "0.59"]
    assert [bool(re.fullmatch(r"[-+]\d+ %", row[4])) for row in rows] == 2 * [True, False, True]
    assert re.search(r"catalogue +at most 300 arcsec.* is below this limit", in_a_line(page))
    page = run("stiffness", SMALL, "--no-plot", *SAID, "--t1", "3", "--details", "--ascii").stdout
    assert "so their stiffnesses are not compared" in in_a_line(page)
    assert "catalogue" not in run("stiffness", SMALL, "--no-plot").stdout


@pytest.mark.parametrize(("args", "code"), [(["--t1", "5", "--t2", "2"], 2), (["--to", "1e4"], 5), (["--to", "x"], 2)])
def test_wrong_input(args, code):
    result = run("stiffness", SMALL, *args)
    assert result.returncode == code
    assert result.stdout == ""


@pytest.fixture(scope="module")
def found() -> Stiffness:
    return stiffness(load_preset(SMALL), points=8, run=UNCHECKED)


@pytest.mark.parametrize("ascii", [True, False])
def test_headings_and_numbers_are_whole_in_forty_columns(found: Stiffness, ascii: bool) -> None:
    style, stream = Style(ascii, False, 40), io.StringIO()
    report = stiffness_report(load_preset(SMALL, ["catalogue.K_1=2e4"]), found)
    console(stream, style).print(report_page(report, style, plots=False, details=True))
    segments = stream.getvalue().split("torsional stiffness in")[1].split("lost motion")[0]
    assert "…" not in segments
    assert max(map(len, segments.splitlines())) <= 40
    words = segments.replace("|", " ").split()
    numbers = [f"{s.stiffness / 1e4:.3g}" for s in (*found.positive, *found.negative)]
    assert {"torque,", "N*m/rad" if ascii else "N·m/rad", "catalogue", "2", *numbers} <= set(words)


def test_stiffness_reports_how_far_lost_motion_exceeds_the_catalogue_limit(found: Stiffness) -> None:
    limit = found.lost_motion_arcsec / 1.25
    drive = load_preset(SMALL, [f"catalogue.lost_motion={limit}"])
    (fact,) = [text for label, text in stiffness_report(drive, found).blocks[1].rows if label.strip() == "catalogue"]
    assert fact.endswith("exceeds this limit by 25 %")


def test_torque_options_do_not_change_the_rated_torque() -> None:
    own = load_preset(SMALL)
    asked = load_preset(SMALL, ["operation.M_g=[0.5]"])
    assert own.operation.rated is None
    assert asked.rated_torque == own.rated_torque == 4.0
    assert load_preset(SMALL, ["operation.M_g=[0.5]", "operation.rated=3"]).rated_torque == 3.0
    changed = asked.with_values({"gears.j_n": 1.0})  # a sample of the drive
    assert changed.rated_torque == 4.0
    lost_motions = {stiffness(drive, points=2, run=UNCHECKED).lost_motion_arcsec for drive in (own, asked)}
    assert len(lost_motions) == 1


def test_warnings_name_the_torque_that_replaces_the_rated_torque(found: Stiffness) -> None:
    for overrides in ([], ["operation.M_g=[0.5]"]):
        (warning,) = stiffness_warnings(load_preset(SMALL, overrides), found)
        assert "4 N*m, the largest torque in operation.M_g" in warning
    assert stiffness_warnings(load_preset(SMALL, ["operation.rated=4"]), found) == ()


def test_figures_on_standard_output_leave_the_page_to_its_file(tmp_path):
    target = tmp_path / "page.txt"
    printed = run("stiffness", TINY, "--csv", "-", "-o", str(target)).stdout
    assert printed.startswith("torque_Nm,")
    assert target.read_text(encoding="utf-8").startswith("tiny: torsional stiffness")


def test_two_answers_on_standard_output_are_refused():
    refused = run("stiffness", "none", "--json", "--csv", "-")  # before the preset is read
    assert (refused.returncode, json.loads(refused.stdout)["error"]["code"]) == (2, "USAGE")
    assert "only one of --csv and --json can use standard output" in refused.stderr
