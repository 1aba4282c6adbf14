"""`hdassist check` as its users meet it: streams, files, exit codes, terminals."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import re
import subprocess
import time
from pathlib import Path

import pytest

from hdassist import __version__, kinematic_error, load_preset, self_error
from hdassist.drive.solve.walk import walk_library
from tests.helpers.process import CLEAN, COMMAND, TINY, in_a_line, interrupted, run, run_cold


@pytest.fixture(scope="module")
def answer():
    return run("check", TINY, "--json")


def test_json_has_what_others_build_on(answer):
    assert answer.returncode == 0
    assert answer.stderr == ""
    result = json.loads(answer.stdout)
    assert result["schema"] == "hdassist.check/1"
    assert result["version"] == __version__
    assert result["preset"]["name"] == "tiny"
    assert result["preset"]["sha256"] == hashlib.sha256(Path(TINY).read_bytes()).hexdigest()
    assert (result["exit_code"], result["warnings"], result["verdict"]) == (0, [], "NO_LIMIT")
    assert result["kinematics"]["u_hg"] == -10
    assert result["kinematics"]["cycle_states"] == 220
    certificate = result["certificate"]
    # every state of both cycles and both self errors; more for what it would take
    assert certificate["states"] > 2 * (220 + 16)
    assert 0 <= certificate["max_residual"] <= 1e-8
    assert certificate["engine"] == walk_library()[1]
    assert set(certificate["cross_check"]) == {"solver", "states", "max_difference_arcsec"}
    assert certificate["cross_check"]["max_difference_arcsec"] <= 0.01
    keys = {
        "M_g_Nm", "F_ior_arcsec", "F_ior_upper_arcsec", "at_max", "at_min", "self_error_arcsec", "one_wave_share",
        "max_tooth_force_N", "limit_arcsec", "verdict",
    }  # fmt: skip
    for point in result["operating_points"]:
        assert keys <= set(point)
        assert {"phi_h_deg", "phi_g_deg"} <= set(point["at_max"]) & set(point["at_min"])


@pytest.mark.moves("catalogue.accuracy")
def test_the_accuracy_of_a_catalogue_stands_beside_and_decides_nothing(answer):
    without = json.loads(answer.stdout)
    low = min(point["F_ior_arcsec"] for point in without["operating_points"])
    given = ("--set", f"catalogue.accuracy={low / 2!r} arcsec")
    found = run("check", TINY, "--json", *given)
    told = json.loads(found.stdout)
    assert (found.returncode, told["verdict"]) == (0, "NO_LIMIT")
    assert told["operating_points"] == without["operating_points"]
    share = 200 * without["operating_points"][0]["F_ior_arcsec"] / low
    page = run("check", TINY, "--details", "--no-plot", *given).stdout
    assert f"F'_ior at 1 N·m is {share:.0f} % of the accuracy" in in_a_line(page)


@pytest.mark.parametrize(
    ("draws", "words"), [(2, r"F'_ior at 1 N·m is \d+ to \d+ % of the accuracy"), (0, "F'_ior is unknown")]
)
def test_check_compares_catalogue_accuracy_with_the_error_at_smallest_load(draws, words):
    asked = ("--no-plot", "--set", "phases.phi_hb=unknown", "--set", "operation.M_g=[-4, 1]", "--draws", str(draws))
    page = run("check", TINY, *asked, "--details", "--set", "catalogue.accuracy=1.5 arcmin").stdout
    assert re.search(rf" catalogue accuracy 90″ \(no load\); {words} ", in_a_line(page))
    assert max(map(len, page.splitlines())) <= 80


@pytest.mark.parametrize("left_out", [(), ("--set", "catalogue.play=")])
def test_check_details_list_the_reference_data_that_weight_the_samples(left_out):
    stated = ("--set", "catalogue.lost_motion=300", "--set", "catalogue.play=300")
    asked = ("--no-plot", "--set", "phases.phi_hb=unknown", "--torque", "1", "--draws", "2", *stated, *left_out)
    page = in_a_line(run("check", TINY, *asked, "--details").stdout)
    weighed = "reference data catalogue.lost_motion, catalogue.play; to omit the last one, use --set catalogue.play= "
    without = "reference data catalogue.lost_motion; to omit the last one, use --set catalogue.lost_motion= "
    assert (without if left_out else weighed) in page


@pytest.mark.thorough
def test_check_offers_usual_accuracy_if_the_catalogue_states_only_backlash():
    asked = ("--no-plot", "--set", "phases.phi_hb=unknown", "--torque", "1", "--draws", "8", "--details")
    offered = re.compile(r"an accuracy of 90″, which is usual for this size, F'_ior at 1 N·m is ([\d.]+) to ([\d.]+)″")
    page = in_a_line(run("check", TINY, *asked, "--set", "catalogue.play=300").stdout)
    low, high = map(float, offered.search(page).groups())
    assert low < high < 200  # a soft limit
    for given in ((), ("--set", "catalogue.play=300", "--set", "catalogue.accuracy=60")):
        assert not offered.search(in_a_line(run("check", TINY, *asked, *given).stdout))


def test_json_says_what_the_python_interface_says(answer):
    drive = load_preset(TINY)
    points = json.loads(answer.stdout)["operating_points"]
    for point, M_g, own in zip(points, (1, 4), self_error(drive, (1.0, 4.0)), strict=True):
        error = kinematic_error(drive, M_g)
        assert point["F_ior_arcsec"] == pytest.approx(error.F_ior_arcsec, abs=1e-9)
        assert point["self_error_arcsec"] == pytest.approx(own.range_arcsec, abs=1e-9)
        assert point["F_ior_upper_arcsec"] == pytest.approx(error.F_ior_arcsec + own.range_arcsec, abs=1e-9)
        at = error.states
        assert point["at_max"]["phi_h_deg"] == pytest.approx(at.phi_h[error.at_max] * 57.29577951308232)


@pytest.mark.thorough
def test_same_input_same_output(answer):
    # in a process of its own from the start: with another hash seed
    assert run_cold("check", TINY, "--json").stdout == answer.stdout


def test_the_rest_stands_in_the_details(answer):
    page = run("check", TINY, "--details", "--no-plot").stdout
    for words in ("single-zone", "self error, ″", "equilibrium", "input revolutions"):
        assert words in page
    (turns,) = re.search(r"largest error at phi_h, rev +([\d.]+) ", page).groups()
    told = json.loads(answer.stdout)["operating_points"][0]["at_max"]["phi_h_deg"]
    assert float(turns) == pytest.approx(told / 360, abs=0.005)


def test_torques_from_the_command_line_take_the_presets_place():
    asked = run("check", TINY, "-q", "--torque", "2", "--torque=-3").stdout.splitlines()
    assert [line.split(" N*m")[0] for line in asked] == ["2", "-3"]


def test_verbose_tells_timings_on_stderr():
    told = run("check", TINY, "-q", "-v", "--torque", "4").stderr
    assert re.search(r"\d{3,} mesh positions", told)
    assert "equilibrium" in told
    assert " s, " in told


@pytest.mark.parametrize(
    ("limit", "torques", "verdict", "code"),
    [("9000", ["1"], "PASS", 0), ("100", ["1"], "FAIL", 3), ("{1: 9000, 4: 5}", ["1", "4"], "FAIL", 3)],
)
def test_verdict_and_exit_code(limit, torques, verdict, code):
    asked = (f"--torque={torque}" for torque in torques)
    result = run("check", TINY, "--json", *asked, "--set", f"acceptance.F_ior={limit}")
    assert result.returncode == code
    assert json.loads(result.stdout)["verdict"] == verdict
    assert json.loads(result.stdout)["exit_code"] == code


@pytest.mark.parametrize(("limits", "governing"), [("{1: 9000, 4: 5000}", 4.0), ("{1: 3000, 4: 9000}", 1.0)])
def test_governing_torque_is_nearest_its_limit_when_check_passes(limits, governing):
    result = run("check", TINY, "--json", "--torque", "1", "--torque", "4", "--set", f"acceptance.F_ior={limits}")
    answer = json.loads(result.stdout)
    shares = {p["M_g_Nm"]: p["F_ior_upper_arcsec"] / p["limit_arcsec"] for p in answer["operating_points"]}
    assert answer["verdict"] == "PASS"
    assert max(shares, key=shares.__getitem__) == governing
    assert answer["least_sure_M_g_Nm"] == governing


def test_governing_torque_without_limits_has_the_largest_F_ior():
    result = run("check", TINY, "--json", "--torque", "1", "--torque", "4", "--torque", "2")
    answer = json.loads(result.stdout)
    F_ior = {p["M_g_Nm"]: p["F_ior_arcsec"] for p in answer["operating_points"]}
    assert answer["least_sure_M_g_Nm"] == max(F_ior, key=F_ior.__getitem__) == 4


def test_verdict_holds_the_upper_value(answer):
    point = json.loads(answer.stdout)["operating_points"][0]
    between = (point["F_ior_arcsec"] + point["F_ior_upper_arcsec"]) / 2
    assert run("check", TINY, "-q", "--torque", "1", "--set", f"acceptance.F_ior={between}").returncode == 3


def test_impossible_torque_gives_no_number():
    result = run("check", TINY, "--set", "operation.M_g=1e6")
    assert result.returncode == 5
    assert result.stdout == ""
    assert result.stderr.startswith("error: the wind-up of ")
    assert "M_g = 1e+06 N·m" in result.stderr
    assert "hint:" in result.stderr


def test_impossible_torque_in_json():
    result = run("check", TINY, "--json", "--set", "operation.M_g=1e6")
    assert result.returncode == 5
    told = json.loads(result.stdout)
    assert told["exit_code"] == 5
    assert "linear model" in told["error"]["message"]
    assert "operating_points" not in told


def test_several_drives_the_worst_exit_code(tmp_path):
    bad = tmp_path / "bad.yaml"
    bad.write_text(Path(TINY).read_text().replace("z_b: 22", "z_b: 23"))
    result = run("check", TINY, str(bad), TINY, "--json", "--torque", "1", "--set", "acceptance.F_ior=100")
    assert result.returncode == 4  # 4 before 3
    told = json.loads(result.stdout)
    assert told["exit_code"] == 4
    assert [r["exit_code"] for r in told["results"]] == [3, 4, 3]
    assert f"{bad}:" in result.stderr
    people = run("check", TINY, str(bad), "--torque", "1", "--no-plot")
    assert people.returncode == 4
    assert people.stdout.count("(peak-to-peak kinematic error)") == 1


def test_files_appear_whole_and_never_over_another(tmp_path):
    figures, page = tmp_path / "figures.csv", tmp_path / "answer.json"
    first = run("check", TINY, "--json", "-o", str(page), "--csv", str(figures))
    assert first.returncode == 0
    assert first.stdout == ""
    assert first.stderr == f"wrote {page}\nwrote {figures}\n"
    points = json.loads(page.read_text())["operating_points"]
    rows = list(csv.DictReader(io.StringIO(figures.read_text())))
    assert [float(r["F_ior_arcsec"]) for r in rows] == [p["F_ior_arcsec"] for p in points]
    assert [r["limit_arcsec"] for r in rows] == ["", ""]
    before = figures.stat().st_mtime_ns
    began = time.monotonic()
    again = run("check", TINY, "--csv", str(figures))
    assert again.returncode == 2
    assert "exists" in again.stderr
    assert "--force" in again.stderr
    assert figures.stat().st_mtime_ns == before
    assert time.monotonic() - began < 60
    assert run("check", TINY, "-q", "--csv", str(figures), "--force").returncode == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["answer.json", "figures.csv"]


def test_figures_on_stdout():
    result = run("check", TINY, "--csv", "-")
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert [r["M_g_Nm"] for r in rows] == ["1.0", "4.0"]


def test_nothing_is_written_when_there_is_no_answer(tmp_path):
    page = tmp_path / "figures.csv"
    assert run("check", TINY, "--csv", str(page), "--set", "operation.M_g=1e6").returncode == 5
    assert not page.exists()


def test_preset_from_stdin():
    text = Path(TINY).read_text()
    good = run("check", "-", "-q", "--torque", "4", stdin=text)
    assert good.returncode == 0
    assert good.stdout == run("check", TINY, "-q", "--torque", "4").stdout
    bad = run("check", "-", stdin=text.replace("m: 1.5", "m: -1.5"))
    assert bad.returncode == 4
    assert "<stdin>:5:" in bad.stderr


@pytest.mark.parametrize(
    ("args", "code"),
    [
        (["check"], 2),
        (["check", TINY, "--nonsense"], 2),
        (["check", TINY, "--set", "gears.m"], 2),
        (["check", TINY, "--set", "gears.mm=1"], 2),
        (["check", TINY, "--set", "gears.m=-1"], 2),
        (["check", "nosuchpreset"], 4),
        (["check", "/"], 4),
        (["check", TINY, "-o", "/nosuchdirectory/x"], 4),
        (["nosuchcommand"], 2),
    ],
)
def test_wrong_input(args, code):
    result = run(*args)
    assert result.returncode == code
    assert result.stdout == ""
    assert result.stderr
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize("option", ["--solver", "--cross-check"])
def test_unknown_solver(option):
    result = run("check", TINY, option, "nosuch")
    assert result.returncode == 2
    assert "nosuch" in result.stderr.lower()
    assert "clarabel" in result.stderr.lower()


@pytest.mark.slow
def test_another_solver_gives_the_same_numbers(answer):
    points = json.loads(answer.stdout)["operating_points"]
    other = json.loads(run("check", TINY, "--json", "--solver", "daqp", "--cross-check", "osqp").stdout)
    assert other["certificate"]["cross_check"]["solver"] == "OSQP"
    for one, two in zip(points, other["operating_points"], strict=True):
        assert two["F_ior_arcsec"] == pytest.approx(one["F_ior_arcsec"], abs=1e-6)


@pytest.mark.thorough
def test_reader_that_leaves_early_gets_silence():
    process = subprocess.Popen(
        [*COMMAND, "trace", TINY], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=CLEAN, text=True
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == ""
    process.stderr.close()
    assert process.wait(timeout=60) == 0


@pytest.mark.thorough
def test_interrupt_ends_with_130_and_leaves_nothing(tmp_path):
    many = ("check", TINY, "--json", *(f"--torque={1 + k / 10}" for k in range(31)))
    done = interrupted(*many, "-o", str(tmp_path / "answer.json"), after=0.3)
    assert done.returncode == 130
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []
