"""`hdassist plan` as its users meet it."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.features.planning import choose_plan
from hdassist.interface.pages.plan import seen_curve
from tests.helpers.process import SMALL, TINY, in_a_line, run

OPEN = ("--set", "phases.xi_b=unknown", "--draws", "8")


def test_plan_page_states_twelve_position_coverage_and_the_sufficient_test():
    page = run("plan", "tiny.yaml", cwd=Path(TINY).parent)  # a long path takes lines of its own
    lines = page.stdout.splitlines()
    assert page.returncode == 0
    assert lines[0] == "tiny, test at 1 N·m: sufficient: recording of 10 input revolutions"
    assert lines[1].startswith("12 positions capture ")
    assert any(line.startswith("next ") and "hdassist measure record.csv --drive" in line for line in lines)
    assert any("positions per output revolution" in line for line in lines)
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert "appears as (0: blind)" in run("plan", TINY, "--no-plot", "--details").stdout


def test_plot_shows_the_minimum_share_of_neighbouring_position_numbers():
    choice = choose_plan(load_preset(TINY))
    curve, seen = seen_curve(choice), {each.plan.readings: 100 * each.seen[0] for each in choice.over_positions}
    assert len(curve.x) <= 36 < len(seen)  # each has a column of a narrow terminal
    per = len(seen) / len(curve.x)
    for x, least in zip(curve.x, curve.y, strict=True):
        assert least == pytest.approx(min(share for N, share in seen.items() if abs(N - x) <= per / 2))


def test_plan_page_with_a_limit_shows_wrong_verdicts_and_fits():
    page = run("plan", TINY, *OPEN, "--torque", "4", "--limit", "2040", "--ascii", "--no-plot")
    assert "% of drives exceed the limit; " in page.stdout
    assert "false PASS   false FAIL" in page.stdout
    assert page.returncode == 0
    assert "2040 arcsec: sufficient: recording of 10 input revolutions " in in_a_line(
        page.stdout
    )  # the whole cycle; eight samples leave all others open
    assert page.stdout.isascii()
    assert max(map(len, page.stdout.splitlines())) <= 80


@pytest.mark.thorough
@pytest.mark.parametrize(("options", "is_any"), [(OPEN, False), ((*OPEN, "--noise", "30"), False), ((), True)])
def test_any_test_is_sufficient_only_if_all_listed_tests_are(options, is_any):
    page = run("plan", TINY, *options, "--torque", "4", "--limit", "2400", "--no-plot").stdout
    enough = re.findall(r"^(?:\d+ positions|recording of .*?)  .* (yes|open|no) ", page, re.M)
    assert set(enough) == {"yes"} if is_any else "open" in enough
    assert ("any of these tests is sufficient" in in_a_line(page)) is is_any
    assert re.search(r"^0\.0 % of drives exceed the limit", page, re.M)


@pytest.mark.thorough
def test_what_chance_leaves_open_asks_for_more_samples():
    page = run("plan", TINY, *OPEN, "--torque", "4", "--limit", "2102", "--no-plot").stdout
    assert re.search(r"^open +more samples .*--draws [0-9]+", page, re.M)


@pytest.mark.parametrize(
    ("limit", "noise", "last", "answer"),
    [
        ("2060", "30", "open", "possibly sufficient: recording of 10 input revolutions"),
        ("2040", "80", "no", "none of these tests is sufficient"),
    ],
)
def test_the_first_line_names_no_test_whose_row_says_no(limit, noise, last, answer):
    page = run("plan", TINY, *OPEN, "--torque", "4", "--limit", limit, "--noise", noise, "--no-plot")
    assert in_a_line(page.stdout).startswith(f"tiny, test at 4 N·m, limit {limit}″: {answer} ")
    rows = re.findall(r"^(12 positions|recording of \d+ input).* (yes|open|no) ", page.stdout, re.M)
    assert dict(rows) == {
        "12 positions": "no",
        "recording of 1 input": "no",
        "recording of 10 input": last,
    }


def test_of_a_drive_without_error_all_is_seen():
    zeros = [word for name in ("F_i1", "F_i2", "e_hb", "e_hh") for word in ("--set", f"tolerances.{name}=0")]
    found = run("plan", TINY, *zeros, "--json")
    assert found.returncode == 0
    assert json.loads(found.stdout)["plans"][0]["seen"]["p5"] == pytest.approx(1, abs=1e-3)


def test_preset_from_standard_input_is_named_in_the_next_command():
    page = run("plan", "-", "--no-plot", stdin=Path(TINY).read_text("utf-8")).stdout
    assert "hdassist measure record.csv --drive -\n" in page


def test_a_verdict_that_is_known_without_a_test_is_named():
    page = in_a_line(run("plan", TINY, "--limit", "40", "--no-plot").stdout)
    assert "100 % of drives exceed the limit, so any of these tests is sufficient for a decision." in page
    assert "of F'_ior (35." in page


def test_a_test_asked_about_is_the_first_and_decides():
    asked = run("plan", TINY, "--positions", "10", "-q")
    assert (asked.returncode, asked.stdout) == (3, "not sufficient: 10 positions\n")
    assert run("plan", TINY, "--positions", "1000", "-q").stdout == "sufficient: 1000 positions\n"
    steps = json.loads(run("plan", TINY, "--positions", "8", "--turns", "2", "--both", "--json").stdout)
    assert steps["plans"][0]["test"] == "8 positions over 2 output turns both ways"
    assert steps["plans"][0]["step_output_deg"] == pytest.approx(90)
    assert steps["plans"][1]["test"] == "12 positions"


@pytest.mark.thorough
def test_json_and_csv():
    found = json.loads(run("plan", TINY, *OPEN, "--limit", "60", "--json").stdout)
    assert found["schema"] == "hdassist.plan/1"
    assert {"p5", "p50", "p95"} == set(found["F_ior_arcsec"]) == set(found["plans"][0]["seen"])
    assert {"value", "low", "high"} == set(found["beyond_limit"]) == set(found["plans"][0]["false_pass"])
    assert {"per_output_turn", "per_cam_turn", "variance_share", "seen_as"} == set(found["lines"][0])
    assert found["certificate"]["states"] > 0
    rows = list(csv.DictReader(io.StringIO(run("plan", TINY, "--csv", "-").stdout)))
    assert [row["test"] for row in rows][:2] == ["12 positions", "record of 1 cam turn"]


def test_the_belief_is_that_of_check():
    options = (TINY, *OPEN, "--torque", "4", "--limit", "2040", "--json")
    plan, check = (json.loads(run(command, *options).stdout) for command in ("plan", "check"))
    belief = check["operating_points"][0]["belief"]
    assert [plan["F_ior_arcsec"][key] for key in ("p5", "p50", "p95")] == pytest.approx(
        [belief[f"{key}_arcsec"] for key in ("p5", "p50", "p95")]
    )
    assert plan["beyond_limit"]["value"] == pytest.approx(1 - belief["probability"])


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (("--turns", "2"), 2, "--turns and --both require --positions"),
        (("--limit", "self_error=3"), 2, "expected a limit of F_ior"),
        (
            ("--set", "bearing.ball_motion=rolling", "--set", "bearing.d_ball=5"),
            2,
            "planning a test requires bearing.ball_motion: locked",
        ),
    ],
)
def test_wrong_options_are_refused_in_words(options: tuple[str, ...], code: int, words: str):
    answer = run("plan", TINY, *options)
    assert answer.returncode == code
    assert words in answer.stderr


def read_by_a_rig(file: Path, size: float, seed: int = 0) -> str:
    """The file of a test filled in on a bench of sines: a drive of so many arcsec, play, noise, another zero."""
    rng, lines = np.random.default_rng(seed), []
    for line in file.read_text("utf-8").splitlines():
        if line.endswith(","):
            _, target, side, _ = line.split(",")
            angle = np.radians(float(target)) + rng.uniform(0, 1e-9)
            error = size / 2 * np.cos(30 * angle + 0.4) * (1 + 0.1 * np.cos(angle)) + 4 * float(side)
            line += f"{(211.7 + float(target) + (error + 0.2 * rng.standard_normal()) / 3600) % 360:.7f}"
        lines.append(line)
    return "\n".join(lines) + "\n"


def test_a_test_is_carried_out_and_decides(tmp_path):
    options = ("--positions", "29", "--both", "--repeats", "2", "--encoders", "0.2,0.3", "--torque", "4")
    files = ("--approach", "run.csv", "--sheet", "run.txt", "--serial", "17-1")
    page = run("plan", SMALL, "--draws", "0", "--limit", "40", *options, *files, "--json", cwd=tmp_path)
    carried = json.loads(page.stdout)["carried_out"]
    page = run("plan", SMALL, "--draws", "0", "--limit", "40", *options, *files, "--force", cwd=tmp_path)
    assert "measure run.csv --drive" in in_a_line(page.stdout)
    assert carried["readings"] == 2 * 2 * 29
    rows = [line for line in (tmp_path / "run.csv").read_text("utf-8").splitlines() if line.endswith(",")]
    minute, target, side = np.array([[float(cell) for cell in row.split(",")[:3]] for row in rows]).T
    assert minute[-1] == pytest.approx(carried["minutes"], abs=0.06)
    assert (np.diff(minute) >= 0).all()
    moves = np.sign(np.diff(target)) * (np.diff(side) == 0)
    assert (moves == side[1:] * (np.diff(side) == 0)).all()  # each position is approached from its side
    sheet = (tmp_path / "run.txt").read_text("utf-8")
    assert "17-1" in sheet
    assert "the list is in run.csv" in sheet  # of 116 readings
    assert "hdassist accept" in sheet and "--limit 40" in sheet  # else accept has nothing to hold the readings against

    unread = run("measure", "run.csv", cwd=tmp_path)
    assert unread.returncode == 4
    budget = ("--budget", "encoder=0,coupling=0,reseating=0,temperature=0")
    for share, code in ((0.8, 0), (1.2, 3)):
        size = carried["passes_up_to_arcsec" if code == 0 else "fails_beyond_arcsec"] * share / 1.1
        (tmp_path / "read.csv").write_text(read_by_a_rig(tmp_path / "run.csv", size))
        answer = ("accept", SMALL, "--limit", "F_ior@4=40", "--measured", "4=read.csv", "--measured-only")
        done = run(*answer, *budget, "--json", "-o", f"{code}.json", cwd=tmp_path)
        assert done.returncode == code, done.stderr
        assert run("accept", "--replay", f"{code}.json", "-q", cwd=tmp_path).returncode == 0
        without = run(*answer, "-q", cwd=tmp_path)
        assert without.returncode == (code or 6)  # no budget, no PASS
    told = json.loads(run("measure", "read.csv", "--json", cwd=tmp_path).stdout)["F_ior"]
    assert told["at_most_arcsec"] == pytest.approx(told["range_arcsec"] / told["seen"][0])
    wrong = ("--limit", "F_ior@9=40", "--measured", "9=read.csv", "--measured-only")
    elsewhere = run("accept", SMALL, *wrong, cwd=tmp_path)
    assert elsewhere.returncode == 4
    assert "planned for 4 N·m, not for 9 N·m" in elsewhere.stderr
    text = (tmp_path / "read.csv").read_text("utf-8")
    rows = [line for line in text.splitlines() if line[0].isdigit()]
    first = {tuple(row.split(",")[1:3]): row for row in reversed(rows)}.values()  # an approach a position
    remarks = [line for line in text.splitlines() if line not in rows]
    (tmp_path / "half.csv").write_text("\n".join([*remarks, *sorted(first, key=rows.index)]) + "\n")
    answer = ("accept", SMALL, "--limit", "F_ior@4=4000", "--measured-only", *budget)
    half = run(*answer, "--measured", "4=half.csv", "-q", cwd=tmp_path)
    assert (half.returncode, half.stdout) == (6, "INCONCLUSIVE\n")  # scatter is known by repetition alone
    whole = json.loads(run(*answer, "--measured", "4=read.csv", "--json", cwd=tmp_path).stdout)["checks"][0]
    assert whole["margin"] == pytest.approx(4000 - whole["at_most"])
    page = in_a_line(run(*answer, "--measured", "4=read.csv", cwd=tmp_path).stdout)
    least = whole["value"] - whole["expanded_uncertainty"]
    assert f"≥ {least:.2f} to {whole['at_most']:.4g}″" in page
    typed = "\n".join([*remarks, *(",".join([*row.split(",")[:3], f"{k % 7}"]) for k, row in enumerate(rows))])
    (tmp_path / "typed.csv").write_text(typed + "\n")
    refused = run(*answer, "--measured", "4=typed.csv", cwd=tmp_path)
    assert (refused.returncode, "differ from their targets" in refused.stderr) == (4, True)
    (tmp_path / "bare.csv").write_text("".join(line for line in text.splitlines(True) if "# sees" not in line))
    bare = run("accept", SMALL, "--limit", "F_ior@4=4000", "--measured", "4=bare.csv", *budget, "-q", cwd=tmp_path)
    assert (bare.returncode, bare.stdout) == (6, "INCONCLUSIVE\n")  # positions of no plan never pass


def test_sheet_counts_as_its_plan_only_if_carried_out(tmp_path):
    options = ("--positions", "29", "--both", "--repeats", "2", "--torque", "4", "--draws", "0", "--limit", "4000")
    assert run("plan", SMALL, *options, "--approach", "run.csv", cwd=tmp_path).returncode in (0, 3)
    text = read_by_a_rig(tmp_path / "run.csv", 30.0)
    rows = [line for line in text.splitlines() if line[0].isdigit()]
    remarks = [line for line in text.splitlines() if line not in rows]
    position = {row: float(row.split(",")[1]) for row in rows}
    sheets = {
        "whole": (0, rows),
        "without a position": (6, [row for row in rows if not 95 < position[row] < 105]),
        "without a repeat": (0, rows[1:]),
        "two positions": (6, [row for row in rows if position[row] < 20]),
        "one side": (6, [row for row in rows if row.split(",")[2] == "1"]),
    }
    asked = ("--limit", "F_ior@4=4000", "--limit", "positioning=4000", "--measured", "4=read.csv", "--measured-only")
    budget = ("--budget", "encoder=0,coupling=0,reseating=0,temperature=0")
    for name, (code, kept) in sheets.items():
        (tmp_path / "read.csv").write_text("\n".join([*remarks, *kept]) + "\n")
        answer = run("accept", SMALL, *asked, *budget, "--json", cwd=tmp_path)
        assert answer.returncode == code, name
        assert {each["verdict"] for each in json.loads(answer.stdout)["checks"]} == {"INCONCLUSIVE" if code else "PASS"}
    other = run("accept", SMALL, "--set", "name=other", *asked, *budget, cwd=tmp_path)
    assert other.returncode == 4
    assert "planned for small, not for other" in other.stderr


@pytest.mark.parametrize("text", ["x", "1,2,3,4", "-1", "nan"])
def test_data_of_encoders_are_refused_in_words(text: str):
    answer = run("plan", TINY, "--encoders", text)
    assert answer.returncode == 2
    assert "expected STEP[,GRADUATION[,CAM]]" in answer.stderr
