"""`hdassist mount --trial` as its users meet it."""

from __future__ import annotations

import csv
import hashlib
import json
from pathlib import Path

import pytest

from tests.process import SMALL, run, run_cold

# what the drive of the preset shows in these holes at 4 N·m with an offset of 50 um at 20 deg
TRIALS = ("--trial", "h0:73", "--trial", "120:18.7", "--trial", "h8:25")
ONE = ("mount", SMALL, "--torque", "4", "--set", "tolerances.e_hh=0")  # a cam that is true needs no draws


@pytest.fixture(scope="module")
def answer(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, str, str]:
    figures = tmp_path_factory.mktemp("trials") / "holes.csv"
    done = run(*ONE, *TRIALS, "--json", "--csv", str(figures))
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), done.stderr, figures.read_text()


def test_json_has_what_mount_has_and_what_the_trials_teach(answer):
    told, _, _ = answer
    assert told["schema"] == "hdassist.mount/1"
    assert [c["M_g_Nm"] for c in told["curves"]] == [4]
    assert len(told["curves"][0]["phase_deg"]) == len(told["curves"][0]["F_ior_arcsec"]) == 12
    for name in ("current", "recommended", "worst"):
        assert {"rotation_deg", "phase_deg", "hole", "F_ior_arcsec"} <= set(told[name])
    learnt = told["trials"]
    assert [m["hole"] for m in learnt["measured"]] == [0, 4, 8]
    assert sum(p["probability_best"] for p in learnt["positions"]) == pytest.approx(1)
    best = min(learnt["positions"], key=lambda p: p["expected_loss"])
    assert best["hole"] == told["recommended"]["hole"]
    assert sum(learnt["stiffness_sets"]) == pytest.approx(1)
    assert learnt["verify"] is None
    assert 0 < told["gain"] < 1
    assert told["certificate"]["max_residual"] < 1e-9


def test_csv_has_a_row_for_each_hole(answer):
    told, _, figures = answer
    rows = list(csv.DictReader(figures.splitlines()))
    assert [float(row["F_ior_expected_arcsec"]) for row in rows] == told["curves"][0]["F_ior_arcsec"]


def test_the_same_digits_for_any_number_of_jobs(answer):
    # and for any hash seed
    assert json.loads(run_cold(*ONE, *TRIALS, "--json", "--jobs", "1").stdout) == answer[0]


def test_people_see_the_instruction_and_tables(answer):
    done = run(*ONE, *TRIALS, "--ascii")
    assert done.returncode == 0
    assert done.stdout.isascii()
    assert "the cam offset from 3 trials at 4 N*m" in done.stdout
    assert " ".join(answer[0]["instruction"].replace("·", "*").split()) in " ".join(done.stdout.split())
    for words in (
        "hole 4 (120 deg)",
        "loss expected",
        "seen from the cam side",
        "counter-clockwise seen from the cam side",
    ):
        assert words in " ".join(done.stdout.split())


def test_trials_that_settle_nothing_have_an_exit_code_of_their_own():
    one = run(*ONE, "--trial", "h0:20", "-q")
    assert one.returncode == 6
    assert "do not settle it" in one.stderr


def test_an_outcome_says_keep_or_go_back():
    worse = run(*ONE, *TRIALS, "--verify", "h6:80", "-q")
    assert worse.returncode == 3
    assert worse.stdout == "4\n"
    assert "outside of what the trials predict" in worse.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--trial", "h4"), "'h4' is no trial"),
        (("--trial", "h12:17"), "h0 to h11"),
        (("--trial", "0:17", "--set", "mounting.holes=0", "--trial", "h1:17"), "has none"),
        (("--verify", "h4:17"), "--verify needs the trials"),
        ((*TRIALS, "--noise", "0"), "noise of a trial"),
        ((*TRIALS, "--reseat", "-1"), "error of the seat"),
        ((*TRIALS, "--trial-torque", "0"), "torque of a trial"),
        (
            (*TRIALS, "--step", "10", "--samples", "9", "--cross-check", "osqp"),
            "--step and --samples and --cross-check: no",
        ),
        ((*TRIALS, "--reverse-error"), "is for traces of trials"),
        (("--trial", "h4:none.csv"), "neither a number nor a file"),
        (("--trial", "4:17"), "was hole 4 meant? h4:17"),
        (("--noise", "2"), "are those of trials"),
        ((*TRIALS, "--verify", "h4:17", "--card", "card.txt"), "for the mounting that --verify comes after"),
        ((*TRIALS, "--weights", "1,2"), "weights must be 1 positive"),
        ((*TRIALS, "--criterion", "best"), "no criterion"),
        ((*TRIALS, "--set", "tolerances.e_hb=0"), "nothing is known of the size"),
        ((*TRIALS, "--set", "uncertainty.gears.j_n=1"), "cannot take in"),
    ],
)
def test_wrong_usage_is_told_before_any_work(arguments, words):
    done = run(*ONE, *arguments)
    assert done.returncode == 2
    assert words in " ".join(done.stderr.split())
    assert done.stdout == ""


def test_trials_that_nothing_explains_have_no_answer(tmp_path: Path):
    figures = tmp_path / "none.csv"
    done = run(*ONE, "--trial", "h0:20", "--trial", "h4:500", "--csv", str(figures))
    assert done.returncode == 5
    assert "no cam offset up to 60 um explains the trials" in done.stderr
    assert done.stdout == ""
    assert not figures.exists()


def test_a_card_tells_the_trials_it_rests_on(answer, tmp_path: Path):
    card = tmp_path / "card.txt"
    done = run(*ONE, *TRIALS, "--card", str(card), "-q")
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"{answer[0]['recommended']['hole']}\n"
    text = " ".join(card.read_text(encoding="utf-8").split())
    assert "hole 0: 73 arcsec; hole 4: 18.7 arcsec; hole 8: 25 arcsec" in text
    assert "not from the last trial" in text
    now, best = (f"{answer[0][name]['F_ior_arcsec'][0]:.2f}" for name in ("current", "recommended"))
    assert f"F'_ior {now} -> {best} arcsec at 4" in text


def test_a_trace_beside_a_number(tmp_path: Path):
    """A trace of a drive with an offset of 50 um at 20 deg, as hdassist trace writes it."""
    record, card = tmp_path / "run.csv", tmp_path / "card.txt"
    offset = ("--set", "tolerances.e_hb=50", "--set", "phases.phi_hb=20")
    assert run("trace", *ONE[1:], *offset, "-n", "2", "--phi-g0", "100", "--csv", str(record), "-q").returncode == 0
    done = run(*ONE, "--trial", f"h0:{record}", "--trial", "h4:18.7", "--noise", "0.5", "--json", "--card", str(card))
    assert done.returncode in (0, 6), done.stderr
    told = json.loads(done.stdout)["trials"]
    traced, number = told["measured"]
    assert traced["F_ior_arcsec"] is None
    assert traced["trace"]["sha256"] == hashlib.sha256(record.read_bytes()).hexdigest()
    assert traced["trace"]["file"] == str(record)
    assert traced["trace"]["angles"] == "growing"
    assert 0 < traced["trace"]["range_arcsec"] < traced["explained_arcsec"] + 3 * traced["explained_sd_arcsec"]
    assert (number["hole"], number["F_ior_arcsec"], number["trace"]) == (4, 18.7, None)
    text = " ".join(card.read_text(encoding="utf-8").split())
    assert f"sha256 {traced['trace']['sha256'][:12]}, range" in text
    assert "hole 0 is where the wheel stood before the first trial" in text
    record.write_text("\n".join(record.read_text().splitlines()[:40]))
    short = run(*ONE, "--trial", f"h0:{record}")
    assert short.returncode == 4
    assert "less than one cam turn" in short.stderr
