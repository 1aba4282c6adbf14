"""The page of `hdassist check`: on a screen, in a file, in a pipe, in 7 bits, and what it asks to do next."""

from __future__ import annotations

import json
import re
from unittest import mock

import pytest

from tests.helpers.process import ASSUMED, SMALL, TINY, in_a_line, on_terminal, run, run_cold


@pytest.fixture(scope="module")
def human():
    return run("check", TINY)


def test_people_read_it_in_80_columns(human):
    assert human.returncode == 0
    assert human.stderr == ""
    assert "\x1b" not in human.stdout
    assert max(map(len, human.stdout.splitlines())) <= 80
    assert len(run("check", TINY, "--set", "acceptance.F_ior=2050").stdout.splitlines()) <= 24
    for words in ("F'_ior", "self error", "no limit set", "verified", "HIGHS", "input angle phi_h"):
        assert words in human.stdout


@pytest.mark.thorough
def test_check_page_fits_a_screen_and_ends_with_a_command():
    asked = ("--no-plot", "--torque", "4", "--set", "phases.phi_hb=unknown", "--set", ASSUMED)
    lines = run("check", TINY, *asked, "--set", "acceptance.F_ior=2050").stdout.splitlines()
    assert lines[0] == "tiny, 20/22 teeth, circular spline fixed: INCONCLUSIVE"
    words = r"4 N·m: probability that F'_ior \+ self error ≤ 2050″: \d+ % \(\d+ to \d+\)"
    assert re.match(words, lines[1])
    assert len(lines) <= 24
    assert lines[-1].endswith("(--details)")
    labels = "options|next|verified"
    found = [match for line in lines if (match := re.match(rf"({labels}) +(\S.*)", line))]
    assert [match[1] for match in found] == labels.split("|")
    told = {match[1]: match[2] for match in found}
    assert re.fullmatch(r"to meet 2050″ at 4 N·m .*\d+ %\):", told["options"])
    assert told["next"].startswith("hdassist mount ")


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("args", "verdict", "reason"),
    [
        (("vzp160",), "no limit set", "F'_ior (peak-to-peak kinematic error) over 17 uncertain inputs"),
        (("mvz-80", "--limit", "10"), "FAIL", "10 N·m: probability that F'_ior + self error ≤ 10″: "),
        (("mvz-80", "--limit", "30"), "INCONCLUSIVE", "10 N·m: probability that F'_ior + self error ≤ 30″: "),
    ],
)
def test_a_screen_answers_an_engineer_and_has_a_plot(args, verdict, reason):
    lines = run("check", *args, "--draws", "8").stdout.splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert lines[0] == f"{args[0]}, 200/202 teeth, circular spline fixed: {verdict}"  # verdict
    assert next(filter(None, lines[1:])).startswith(reason)  # how sure, behind an empty line where no reason is given
    starts = [line.split()[0] for line in lines if line]
    assert [word for word in starts if word in ("options", "next")] == ["options", "next"]
    assert starts[-1] == "verified"


def test_a_coupling_is_a_step_where_it_is_a_lever():
    """What it would take on a drive of which all is known is what a check of the changed drive says."""
    stiff = ("--torque", "4", "--set", "cam.coupling=solid", "--set", "supports.C_3=2000")

    def told(*changes):
        return json.loads(run("check", TINY, *stiff, *changes, "--json").stdout)

    steps = {(each["kind"], each["of"]): each for each in told()["steps"]}
    after = {key: each["outcomes"][0]["p50"] for key, each in steps.items()}
    assert after["coupling", "oldham"] < 0.9 * told()["operating_points"][0]["F_ior_arcsec"]
    for key in (("tolerance", "tolerances.F_i1"), ("hole", "3")):
        changes = [word for text in steps[key]["edit"] for word in ("--set", text)]
        assert after[key] == pytest.approx(told(*changes)["operating_points"][0]["F_ior_arcsec"], rel=1e-6)


@pytest.fixture(scope="module")
def plain():
    return run("check", TINY, "--ascii")


@pytest.mark.thorough
def test_check_explains_missing_hole_options_of_a_measured_drive():
    inputs = ("supports.C_3=2000 ± 400", "phases.xi_b=90 ± 20")
    asked = ("check", TINY, "--torque", "4", "--draws", "16", *(word for text in inputs for word in ("--set", text)))
    kinds, pages = [], []
    for measured in ((), ("--set", "measured.F_ior.h0@4=130 ± 6")):
        kinds.append({step["kind"] for step in json.loads(run(*asked, *measured, "--json").stdout)["steps"]})
        pages.append(in_a_line(run(*asked, *measured, "--details").stdout))
    assert ["hole" in each for each in kinds] == [True, False]
    assert ["two options are not listed" in page for page in pages] == [False, True]


def test_ascii_option(plain, human):
    assert plain.returncode == 0
    assert plain.stdout.isascii()
    assert "N*m" in plain.stdout
    numbers = [line.split() for line in human.stdout.splitlines() if re.match(r" +[14] +\d", line)]
    assert len(numbers) == 2
    rows = [line.split() for line in plain.stdout.splitlines()]
    assert [row for row in rows if row in numbers] == numbers
    tables = [[line for line in page.splitlines() if re.match(r"torque,|[-─]+$| +[14] +\d", line)] for page in
              (plain.stdout, human.stdout.replace("·", "*").replace("─", "-"))]  # fmt: skip
    assert tables[0] == tables[1] and len(tables[0]) == 4


@pytest.mark.thorough
@pytest.mark.parametrize("env", [{"LC_ALL": "C"}, {"PYTHONIOENCODING": "ascii"}, {"PYTHONIOENCODING": "latin-1"}])
def test_seven_bits_where_there_are_no_more(env):
    told = run_cold("presets", "list", env=env)
    assert (told.returncode, told.stdout) == (0, run("presets", "list", "--ascii").stdout)
    assert told.stdout.isascii()
    assert told.stdout != run("presets", "list").stdout


@pytest.mark.thorough
@pytest.mark.parametrize("columns", [60, 120])
def test_on_a_terminal_nothing_is_cut(columns, human):
    code, page = on_terminal("check", TINY, "--torque", "4", columns=columns, env={"NO_COLOR": "1"})
    assert code == 0
    assert "\x1b" not in page
    assert max(map(len, page.splitlines())) <= columns
    assert "…" not in page
    wanted = next(line for line in human.stdout.splitlines() if re.match(" +4 ", line)).split()
    assert wanted in [line.split() for line in page.splitlines()]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("env", "codes"),
    [({}, True), ({"TERM": "dumb"}, False), ({"NO_COLOR": ""}, True)],  # NO_COLOR=1: the test before
)
def test_control_codes_only_where_they_belong(env, codes):
    code, page = on_terminal("presets", "list", columns=80, env=env)
    assert code == 0
    assert ("\x1b" in page) == codes


@pytest.mark.thorough
def test_no_color_option_on_a_terminal():
    code, page = on_terminal("presets", "list", "--no-color", columns=80)
    assert code == 0
    assert "\x1b" not in page


def test_many_torques_stay_within_the_width():
    page = run("check", TINY, "--set", "operation.M_g=[1, 1.5, 2, 2.5, 3, 3.5, 4]", "--no-plot").stdout
    assert max(map(len, page.splitlines())) <= 80
    rows = [line.split() for line in page.splitlines() if re.match(r" +\d", line)]
    assert [float(row[0]) for row in rows] == [1, 1.5, 2, 2.5, 3, 3.5, 4]


def test_quiet_prints_the_answer_alone(human):
    quiet = run("check", TINY, "-q")
    lines = quiet.stdout.splitlines()
    assert len(lines) == 2
    number = next(line for line in human.stdout.splitlines() if re.match(" +1 ", line)).split()[1]
    assert lines[0] == f"1 N*m: F'_ior {number} arcsec, NO_LIMIT"
    several = run("check", TINY, "nosuch.yaml", TINY, "-q").stdout.splitlines()
    assert several == 2 * [f"{TINY}: {line}" for line in lines]  # that of which drive, also where one has no answer


@pytest.mark.thorough
def test_human_page_in_a_file_is_plain(tmp_path, human):
    page = tmp_path / "page.txt"
    code, sent = on_terminal("check", TINY, "-o", str(page), columns=70)
    assert code == 0
    assert page.read_text() == human.stdout
    assert "F'_ior" not in sent


@pytest.mark.thorough
def test_progress_shows_on_a_terminal_only():
    work = ("check", SMALL, "--set", "numerics.n_phase=16", *(f"--torque={torque}" for torque in range(1, 6)), "-q")
    _, page = on_terminal(*work, columns=80)
    assert "small" in page
    assert "%" in page
    with mock.patch("hdassist.interface.terminal.output.BAR_PATIENCE", 0.0):
        assert run("check", TINY, "-q").stderr == ""


def test_the_next_command_keeps_what_was_asked_for():
    asked = ["--set", "phases.phi_hb=unknown", "--torque=4", "--draws=2", "--seed=3"]
    page = run("check", TINY, *asked, "--jobs", "1", "--no-plot").stdout
    assert f"next hdassist mount {TINY} {' '.join(asked)} verified" in in_a_line(page)


def test_which_holes_to_measure_is_the_answer_of_mount_alone():
    page = run("check", TINY, "--torque", "4", "--limit", "2035", "--set", "phases.xi_b=unknown", "--draws", "8").stdout
    assert "measure F'_ior in four holes" in in_a_line(page)
    assert not re.search("in holes [0-9]", page)
