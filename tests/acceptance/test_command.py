"""`hdassist accept` and `hdassist explain` as their users meet them."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest

from hdassist.features.acceptance.decision import GUARD
from tests.helpers.process import SMALL, TINY, in_a_line, run
from tests.helpers.rigs import drive_error, text, whole_range

ROOT = Path(__file__).parents[2]
TURNS = np.arange(30 * 60) / 60
CURVE = drive_error(np.random.default_rng(3), 30)
TRUE = whole_range(CURVE, 30)


@pytest.fixture(scope="module")
def rig(tmp_path_factory) -> Path:
    """A folder with the full cycle of a rig, a part of it, and a file that is no trace."""
    folder = tmp_path_factory.mktemp("rig")
    error = CURVE(TURNS) + 0.3 * np.random.default_rng(0).standard_normal(len(TURNS))
    (folder / "run.csv").write_text(text([360 * TURNS, error], "cam_deg,error_arcsec"))
    (folder / "part.csv").write_text(text([360 * TURNS[:300], error[:300]], "cam_deg,error_arcsec"))
    (folder / "bad.csv").write_text("cam_deg,error_arcsec\n1,x\n")
    return folder


NOTHING = "encoder=0,coupling=0,reseating=0,temperature=0"


def accepted(rig: Path, *args: str, budget: str = NOTHING):
    return run("accept", SMALL, "--measured-only", "--budget", budget, *args, cwd=rig)


def test_json_has_all_that_it_takes_to_do_it_again(rig):
    done = accepted(rig, "--measured", "4=run.csv", "--limit", f"F_ior@4={TRUE + 3}", "--json", "--serial", "17",
                    budget=NOTHING.replace("encoder=0", "encoder=0.1"))  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    told = json.loads(done.stdout)
    assert {k: told[k] for k in ("schema", "verdict", "exit_code", "serial", "seed", "certificate", "left_out")} == {
        "schema": "hdassist.accept/2", "verdict": "PASS", "exit_code": 0, "serial": "17", "seed": 0,
        "certificate": None, "left_out": [],
    }  # fmt: skip
    (found,) = told["checks"]
    assert {k: found[k] for k in ("code", "M_g_Nm", "basis", "extent", "unit", "verdict", "limit", "limit_is")} == {
        "code": "F_IOR", "M_g_Nm": 4.0, "basis": "measured", "extent": "whole", "unit": "arcsec", "verdict": "PASS",
        "limit": TRUE + 3, "limit_is": "greatest",
    }  # fmt: skip
    assert abs(found["value"] - TRUE) <= 1.5 * found["expanded_uncertainty"]
    assert found["margin"] == found["limit"] - found["value"]
    (measured,) = told["measured"]
    assert (measured["file"], measured["rows"], len(measured["sha256"])) == ("run.csv", 1800, 64)
    assert told["rule"] == {
        "measured": "guard", "guard_standard_uncertainties": 1.65, "sure": 0.95,
    }  # fmt: skip
    assert (found["rise"], found["unstated"]) == (0, [])
    assert told["request"]["measured"] == ["4=run.csv"]
    assert re.fullmatch(r"20\d\d-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00", told["time"])


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        (["--measured", "4=run.csv", "--limit", f"F_ior@4={TRUE + 3}"], 0, "PASS"),
        (["--measured", "4=part.csv", "--limit", "F_ior@4=900"], 6, "INCONCLUSIVE"),
        (["--measured", "4=run.csv", "--limit", "F_ior@4=1"], 3, "FAIL"),
        (["--value", "F_ior@4=8±1", "--limit", "F_ior@4=8.5", "--set", "acceptance.rule=simple"], 0, "PASS"),
        (["--value", "F_ior@4=8±1", "--limit", "F_ior@4=8.5"], 6, "INCONCLUSIVE"),
    ],
)
def test_verdicts_and_exit_codes(rig, args, code, words):
    done = accepted(rig, "-q", *args)
    assert (done.returncode, done.stdout) == (code, f"{words}\n")


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        ([], 4, "has no acceptance limit"),
        (["--limit", "F_ior=3"], 4, "none of the limits has a measured value"),
        (["--limit", "F_ior=3", "--measured", "4=bad.csv"], 4, "bad.csv:2"),
        (["--limit", "F_ior=3", "--measured", "4=none.csv"], 4, "no such file: none.csv"),
        (["--limit", "F_ior=3", "--measured", "run.csv"], 2, "the torque is missing"),
        (["--limit", "F_iro=3"], 2, "invalid --limit F_iro=3: expected"),
        (["--limit", "F_ior=-3"], 2, "--limit F_ior=-3: must be above 0"),
        (["--limit", "F_ior=3", "--sure", "2"], 2, "'--sure'"),
        (["--limit", "F_ior=3", "--value", "F_ior@4=3"], 2, "for example 3±1.2"),
        (["--limit", "F_ior=3", "--value", "F_ior@4=abc"], 2, "for example 28.1±1.2"),
        (["--limit", "F_ior@4=3", "--measured", "4=run.csv", "--orders", "1,40"], 5, "too long for order 40"),
    ],
)
def test_what_cannot_be_decided_has_a_code_of_its_own(rig, args, code, words):
    done = accepted(rig, *args)
    assert (done.returncode, done.stdout) == (code, "")
    assert words in done.stderr


@pytest.mark.thorough
def test_partial_cycle_is_judged_by_the_lower_end_of_measure(rig):
    measured = run("measure", "part.csv", "--drive", SMALL, "-q", cwd=rig).stdout
    low = measured.removeprefix(">= ").removesuffix("″\n")
    for limit, verdict in (("900", "INCONCLUSIVE"), ("1", "FAIL")):
        page = accepted(rig, "--measured", "4=part.csv", "--limit", f"F_ior@4={limit}").stdout
        row = next(line for line in page.splitlines() if line.startswith("F'_ior at 4 N·m, ″"))
        assert row.split()[5:9] == [verdict, "≥", low, low]  # the last one begins the interval
        assert row.split()[-2:] == ["≤", limit]
        assert "margin" not in page
    within = accepted(rig, "--measured", "4=part.csv", "--limit", f"F_ior@4={float(low) + 1}",
                      "--set", "acceptance.rule=simple")  # fmt: skip
    assert within.returncode == 3
    assert "the decision rule of the test plan rejects the estimate" in in_a_line(within.stdout)


@pytest.mark.thorough
def test_unstated_uncertainty_source_is_inconclusive_and_named_with_its_option(rig):
    args = ("--measured", "4=run.csv", "--limit", f"F_ior@4={TRUE + 3}")
    done = accepted(rig, *args, budget="encoder=0.1,reseating=0")
    assert done.returncode == 6
    words = (
        "no standard uncertainty is stated for coupling, temperature: use --budget coupling=U,temperature=U (in ″; 0"
    )
    page = in_a_line(done.stdout)
    assert words in page
    following = page.partition("next ")[2].partition(" more ")[0]
    assert following.endswith("--budget coupling=U,temperature=U") and "--measured=4=run.csv" in following
    stated = accepted(rig, *args, "--budget", "coupling=0.1,temperature=0", budget="encoder=0.1,reseating=0")
    assert stated.returncode == 0
    found = json.loads(accepted(rig, *args, "--json", budget="coupling=0").stdout)["checks"][0]
    assert (found["verdict"], found["unstated"]) == ("INCONCLUSIVE", ["encoder", "reseating", "temperature"])
    assert accepted(rig, *args, "--set", "acceptance.rule=simple", budget="coupling=0").returncode == 0


def test_people_see_each_check_with_how_it_is_known(rig):
    args = ("--measured", "4=run.csv", "--limit", "F_ior=400", "--limit", "order_2@4=1")
    done = run("accept", SMALL, *args[:4], "--limit", "order_2=1", "--limit", "lost_motion=1", "--ascii", "--details",
               cwd=rig)  # fmt: skip
    assert done.returncode == 3
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert done.stdout.isascii()
    for words in ("small: FAIL", "measured: guard band of 1.65 u", "predicted: PASS if the probability", "<= 400",
                  "F'_ior at 4 N*m", "BUDGET: run.csv", "equilibrium",
                  "explain F_IOR ORDER LOST_MOTION"):  # fmt: skip
        assert words in done.stdout


FAILED_LIMITS = ("--limit", "F_ior@4=1", "--limit", "lost_motion=1")


def test_short_accept_page_shows_the_verdict_and_the_next_command(rig):
    done = accepted(rig, "--measured", "4=run.csv", *FAILED_LIMITS, budget="encoder=0.1")
    lines = done.stdout.splitlines()
    assert lines[0] == "small: FAIL"
    value = r"F'_ior at 4 N·m: (\d+\.\d\d) \((\d+\.\d\d) to (\d+\.\d\d)\)″, limit ≤ 1, margin -\d+\.\d\d, measured"
    found = re.match(value, " ".join(lines[1:3]))
    assert found and float(found[2]) < float(found[1]) < float(found[3])
    assert len(lines) <= 24
    assert "sha256" not in done.stdout
    command = in_a_line(done.stdout).partition(" next hdassist ")[2].partition(" more ")[0].split()
    assert command[0] == "mount"


@pytest.mark.thorough
def test_next_command_of_a_failed_drive_runs(rig):
    done = accepted(rig, "--measured", "4=run.csv", *FAILED_LIMITS, budget="encoder=0.1")
    command = in_a_line(done.stdout).partition(" next hdassist ")[2].partition(" more ")[0].split()
    assert run(*command, cwd=rig).returncode == 0


def test_lower_bound_of_a_part_is_no_trial_value(rig):
    done = accepted(rig, "--measured", "4=part.csv", "--limit", "F_ior@4=1", budget="encoder=0.1")
    assert done.returncode == 3
    command = in_a_line(done.stdout).partition(" next hdassist ")[2].partition(" more ")[0].split()
    assert command[0] == "mount"
    assert not any(word.startswith("h0=") for word in command)


def test_figures_of_several_drives_and_the_worst_code(rig, tmp_path):
    # a bad preset, a FAIL and a PASS: the bad preset's code is the worst
    (tmp_path / "bad.yaml").write_text("schema: hdassist.preset/1\n")
    args = ("--limit", "lost_motion=1", "--json", "--csv", str(tmp_path / "figures.csv"))
    done = run("accept", SMALL, str(tmp_path / "bad.yaml"), SMALL, *args)
    told = json.loads(done.stdout)
    assert [r["exit_code"] for r in told["results"]] == [3, 4, 3]
    assert done.returncode == told["exit_code"] == 4
    rows = list(csv.DictReader(io.StringIO((tmp_path / "figures.csv").read_text())))
    found = ("LOST_MOTION", "predicted", "FAIL", "3")
    told = [(r["code"], r["basis"], r["verdict"], r["exit_code"]) for r in rows]
    assert told == [found, ("", "", "DATA_ERROR", "4"), found]
    assert float(rows[0]["margin"]) == float(rows[0]["limit"]) - float(rows[0]["value"])
    again = run("accept", SMALL, "--limit", "lost_motion=1", "--csv", str(tmp_path / "figures.csv"))
    assert again.returncode == 2
    both = run("accept", SMALL, SMALL, "--measured", "4=run.csv", "--limit", "F_ior=3", cwd=rig)
    assert (both.returncode, "measured values apply to a single drive" in both.stderr) == (2, True)


def test_a_limit_that_nothing_predicts_asks_for_its_own_value():
    done = run("accept", TINY, "--limit", "repeatability=5")
    assert done.returncode == 4
    assert "hint: use --value repeatability=VALUE±U (hdassist" in done.stderr


def test_positions_of_no_plan_are_a_lower_bound(tmp_path):
    rows = "".join(f"{30 * k},{k % 5},{side}\n" for side in (1, -1) for k in range(12))
    (tmp_path / "positions.csv").write_text(f"target_deg,error_arcsec,side\n{rows}{rows}")
    done = run(
        "accept", TINY, "--limit", "F_ior@4=60", "--measured", "4=positions.csv", "--measured-only", cwd=tmp_path
    )
    assert done.returncode == 6
    assert "F'_ior at 4 N·m, ″   INCONCLUSIVE   ≥ 4.00" in done.stdout
    loop = "".join(f"{torque},{3 * torque}\n" for torque in (*range(-20, 20), *range(20, -20, -1)))
    (tmp_path / "loop.csv").write_text(f"torque_Nm,twist_arcsec\n{loop}")
    done = run("accept", TINY, "--limit", "F_ior@4=60", "--measured", "4=loop.csv", "--measured-only", cwd=tmp_path)
    assert done.returncode == 4
    assert "loop.csv: F'_ior cannot be computed from a torque loop" in done.stderr
    assert "--value NAME=VALUE±U" in done.stderr


@pytest.mark.thorough
def test_a_value_beside_a_record_of_the_same_is_refused(rig, tmp_path):
    limits = "--limit", "F_ior@4=60", "--limit", "lost_motion=60"
    both = accepted(rig, *limits, "--measured", "4=run.csv", "--value", "F_ior@4=8±1")
    assert both.returncode == 2
    assert "both a value and a recording are given for F'_ior at 4 N·m" in both.stderr
    assert "leave out one of the two" in both.stderr
    other = accepted(rig, *limits, "--measured", "4=run.csv", "--value", "lost_motion=8±1", "-q")
    assert (other.returncode, other.stdout) == (0, "PASS\n")
    lot = tmp_path / "lot.csv"
    lot.write_text(f"serial;measured@4;F_ior@4;limit F_ior@4\n1;{rig / 'run.csv'};8±1;60\n")
    row = run("accept", str(lot), "--preset", SMALL, "--measured-only", cwd=rig)
    assert row.returncode == 4
    assert "both a value and a recording are given for F'_ior at 4 N·m" in in_a_line(row.stdout)


def test_the_guard_is_in_the_unit_of_its_row(rig):
    value, limit = "K_1=1.2e5±5e3", "K_1=20 N*m/arcmin"
    page = in_a_line(accepted(rig, "--value", value, "--limit", limit).stdout)
    guard = float(re.findall(r"guard band ([\d.]+)", page)[0])
    assert guard == pytest.approx(GUARD * 2500 * np.pi / 180 / 60, rel=0.01)


@pytest.mark.thorough
def test_a_turn_has_no_more_than_the_whole_cycle(rig):
    limits = "--limit", "F_ior@4=60", "--limit", "turn_range@4=60"
    for seed in range(3):
        noise = np.random.default_rng(seed).standard_normal(len(TURNS))
        error = 8 * np.cos(4 * np.pi * TURNS) + 0.5 * noise  # each turn alike: the greatest of 30 is more by its noise
        (rig / "even.csv").write_text(text([360 * TURNS, error], "cam_deg,error_arcsec"))
        checks = json.loads(accepted(rig, *limits, "--measured", "4=even.csv", "--json").stdout)["checks"]
        value = {check["code"]: check["value"] for check in checks}
        assert value["TURN_RANGE"] <= value["F_IOR"] + 1e-9


@pytest.mark.thorough
def test_assumed_unit_and_removed_step_are_on_page_and_json(rig):
    error = CURVE(TURNS) + 0.3 * np.random.default_rng(1).standard_normal(len(TURNS))
    (rig / "plain.csv").write_text(text([360 * TURNS, error], "angle,error"))
    (rig / "stepped.csv").write_text(text([360 * TURNS, error + 50 * (TURNS > 12)], "cam_deg,error_arcsec"))
    for name, words in (("plain", '"error": error, no unit stated, arcsec assumed'), ("stepped", "the error steps by")):
        asked = "--limit", "F_ior@4=60", "--measured", f"4={name}.csv"
        page = in_a_line(accepted(rig, *asked).stdout)
        assert f"{name}.csv, 4 N·m: " in page
        assert words in page
        assert "hdassist explain RECORD" in page
        remarks = json.loads(accepted(rig, *asked, "--json").stdout)["remarks"]
        assert any(note["code"] == "RECORD" and words in note["text"] for note in remarks)
    clean = accepted(rig, "--limit", "F_ior@4=60", "--measured", "4=run.csv")
    assert "RECORD" not in clean.stdout


@pytest.mark.thorough
def test_next_command_replaces_the_recording_that_leaves_a_check_open(rig):
    asked = "--limit", "F_ior@4=60", "--limit", "F_ior@1=60", "--measured", "1=run.csv", "--measured", "4=part.csv"
    page = in_a_line(accepted(rig, *asked).stdout)
    assert "--measured 1=run.csv --measured 4=FILE" in page
    assert "part.csv --measured" not in page
    again = accepted(rig, *asked[:6], "--measured", "4=run.csv", "-q")
    assert (again.returncode, again.stdout) == (0, "PASS\n")
    silent = in_a_line(run("accept", SMALL, "--measured-only", *asked[:2], *asked[6:], cwd=rig).stdout)
    assert "--measured 4=FILE --budget encoder=U,coupling=U,reseating=U,temperature=U" in silent
    travel = in_a_line(accepted(rig, *asked, "--set", "acceptance.travel=180").stdout)
    assert "the whole travel of 180° at the output (15 input revolutions)" in travel
