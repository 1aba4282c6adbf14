"""`hdassist stiffness` as its users meet it."""

from __future__ import annotations

import csv
import io
import json

import pytest

from hdassist import load_preset
from hdassist.design.stiffness_page import render, warnings
from hdassist.error.stiffness import Stiffness, stiffness
from hdassist.terminal.console import Style, console
from tests.process import SMALL, run


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
    # at the torques of the preset that the curve reaches
    assert [t["M_g_Nm"] for t in told["tangents"]] == [1, 4]
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
    for words in ("twist, arcsec", "K1", "K3", "tangent", "lost motion", "again by CLARABEL", "--details"):
        assert words in page.stdout
    slopes = [f"{t['stiffness_Nm_per_rad'] / 1e4:.3g} at {t['M_g_Nm']:g} N·m" for t in told["tangents"]]
    assert ", ".join(slopes) in page.stdout
    more = run("stiffness", SMALL, "--set", "operation.rated=4", "--details", "--at", "3", "--at=-3").stdout
    for words in ("K the other way", "tangent stiffness dT/dphi", "certificate"):
        assert words in more
    assert [line.split()[0] for line in more.split("dT/dphi")[1].splitlines()[3:5]] == ["3", "-3"]
    quiet = run("stiffness", SMALL, "-q").stdout.splitlines()
    assert quiet[-1] == f"lost motion: {told['lost_motion_arcsec']:.2f} arcsec"


@pytest.mark.parametrize(("args", "code"), [(["--t1", "5", "--t2", "2"], 2), (["--to", "1e4"], 5), (["--to", "x"], 2)])
def test_wrong_input(args, code):
    result = run("stiffness", SMALL, *args)
    assert result.returncode == code
    assert result.stdout == ""


@pytest.fixture(scope="module")
def found() -> Stiffness:
    return stiffness(load_preset(SMALL), points=8, cross_check=None)


@pytest.mark.parametrize("ascii", [True, False])
def test_headings_and_numbers_are_whole_in_forty_columns(found: Stiffness, ascii: bool) -> None:
    style, stream = Style(ascii, False, 40), io.StringIO()
    console(stream, style).print(render(load_preset(SMALL), found, style, plots=False, details=True))
    segments = stream.getvalue().split("torsional stiffness")[1].split("near zero")[0]
    assert "…" not in segments and "arcmin" not in segments
    assert max(map(len, segments.splitlines())) <= 40
    words = segments.replace("|", " ").split()
    numbers = [f"{s.stiffness / 1e4:.3g}" for s in (*found.positive, *found.negative)]
    assert {"segment", "torque,", "other", *numbers} <= set(words)


def test_a_torque_asked_for_that_stands_for_the_rated_one_is_called_so(found: Stiffness) -> None:
    (told,) = warnings(load_preset(SMALL), found)
    assert "4 N*m, the greatest of operation.M_g, stands for it" in told
    (told,) = warnings(load_preset(SMALL, ["operation.M_g=[4.0]"]), found)
    assert "4 N*m, the greatest torque asked for, stands for it" in told and "--set operation.rated=T" in told
    assert warnings(load_preset(SMALL, ["operation.rated=4"]), found) == ()
