"""`hdassist trials` as its users meet it."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from tests.process import ASSUMED, SMALL, run, run_cold

# what the drive of the preset shows in these holes at 4 N·m with an offset of 50 um at 20 deg
TRIALS = ("h0=73", "120=18.7", "h8=25", "h4=18.2", "h3=19.3")
ONE = ("trials", SMALL, "--torque", "4", "--draws", "16", "--set", "tolerances.e_hh=0")
LOOSE = (*ONE, "--set", ASSUMED)
# as many that no single one carries the choice
MANY = ("h0=71.2", "h4=16.5", "h8=25", "h4=16.6", "h5=17.6", "h3=18.6", "h2=20.4", "h5=17.7", "--noise", "0.4")
OF_MOUNT = ("--step", "--cross-check", "--pitch-b")
PLACE = {"hole", "rotation_deg"}
POSITION = {*PLACE, "phase_deg", "F_ior_arcsec", "probability_good", "expected_loss"}


@pytest.fixture(scope="module")
def answer(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, str, str]:
    figures = tmp_path_factory.mktemp("trials") / "holes.csv"
    done = run(*LOOSE, *TRIALS, "--json", "--csv", str(figures))
    assert done.returncode in (0, 6), done.stderr
    return json.loads(done.stdout), done.stderr, figures.read_text()


def test_json_tells_positions_and_what_the_trials_teach(answer):
    told, _, _ = answer
    assert told["schema"] == "hdassist.trials/1"
    assert told["M_g_Nm"] == [4]
    assert [p["hole"] for p in told["positions"]] == list(range(12))
    for position in told["positions"]:
        assert set(position) == POSITION
        F_ior = position["F_ior_arcsec"]
        assert F_ior["low"][0] <= F_ior["expected"][0] <= F_ior["high"][0]
    for name in ("best_bet", "worst"):
        assert told[name] == told["positions"][told[name]["hole"]]
    now = told["current"]["F_ior_arcsec"]
    assert now["low"] == pytest.approx(told["positions"][0]["F_ior_arcsec"]["low"])
    assert now["expected"] == pytest.approx(told["positions"][0]["F_ior_arcsec"]["expected"])
    assert [m["hole"] for m in told["trials"]["measured"]] == [0, 4, 8, 4, 3]
    assert [p["hole"] for p in told["prediction_errors"]] == [4, 8, 4, 3]
    assert told["prediction_errors"][2]["as_predicted"]
    assert abs(told["prediction_errors"][2]["surprise"]) < 3
    best = min(told["positions"], key=lambda p: p["expected_loss"])
    assert best == told["best_bet"]
    assert (told["recommended"], told["turn"]) == ((best, bool(best["hole"])) if told["settled"] else (None, False))
    assert told["verification"] is None
    assert told["probability_needed"] == 0.9
    assert told["settled"] == (best["probability_good"] >= 0.9)
    assert told["exit_code"] == (0 if told["settled"] else 6)
    assert set(told["next"]) == {*PLACE, "probability_after"}
    assert told["certificate"]["max_residual"] < 1e-9


def shape(value: object, path: str = "") -> set[str]:
    """Keys of an object, those of objects within it too; lists by their first element."""
    if isinstance(value, list):
        return shape(value[0], f"{path}[]") if value else set()
    if not isinstance(value, dict):
        return set()
    return {f"{path}.{key}" for key in value}.union(*(shape(part, f"{path}.{key}") for key, part in value.items()))


def test_json_has_one_shape_whatever_was_given(answer):
    least = run(*LOOSE, "0=20", "90=20", "--set", "mounting.holes=0", "--json")
    assert least.returncode in (0, 6), least.stderr
    done = run(*LOOSE, *TRIALS, "--torque", "1", "--trial-torque", "4", "--verify", "h4=19", "--json")
    assert done.returncode in (0, 3, 6), done.stderr
    told = json.loads(done.stdout)
    assert told["M_g_Nm"] == [4, 1]
    assert told["verification"]["verdict"] in ("KEEP", "GO_BACK")
    for position in (told["best_bet"], told["current"]):
        assert {name: len(values) for name, values in position["F_ior_arcsec"].items()} == dict.fromkeys(
            ("expected", "low", "high"), 2
        )
    more = {key for key in shape(told) if key.startswith(".verification.")}
    assert shape(json.loads(least.stdout)) == shape(answer[0]) == shape(told) - more


def test_csv_has_a_row_for_each_hole(answer):
    told, _, figures = answer
    rows = list(csv.DictReader(figures.splitlines()))
    assert [float(row["F_ior_expected_arcsec"]) for row in rows] == [
        p["F_ior_arcsec"]["expected"][0] for p in told["positions"]
    ]


def test_the_same_digits_for_any_number_of_jobs(answer):
    # and for any hash seed
    assert json.loads(run_cold(*LOOSE, *TRIALS, "--json", "--jobs", "1").stdout) == answer[0]


def test_people_see_the_instruction_the_best_positions_and_where_to_go_on(answer):
    done = run(*LOOSE, *TRIALS, "--ascii")
    assert done.returncode == answer[0]["exit_code"]
    assert done.stdout.isascii()
    assert len(done.stdout.splitlines()) <= 28
    page = " ".join(done.stdout.split())
    assert page.startswith("small, 5 trials at 4 N*m: MEASURE FIRST No order yet: hole ")
    assert " ".join(answer[0]["instruction"].replace("·", "*").replace("°", " deg").split()) in page
    for words in (
        "hole 4 (120 deg)",
        "90 % are needed",
        "Five or six trials are normal",
        "counter-clockwise from the cam side",
        "F'_ior at 4 N*m, arcsec: median, 5 to 95 %; M measured",
        f"next the same command with the value of hole {answer[0]['next']['hole']} (",
        "(more: --details)",
    ):
        assert words in page
    assert "misfit" not in page


def test_details_are_the_trials_more_positions_and_what_was_learnt(answer):
    page = " ".join(run(*LOOSE, *TRIALS, "--ascii", "--details").stdout.split())
    for words in (
        "trial 18.7 arcsec at hole 4 (120 deg), predicted ",
        f"noise given 1, found {answer[0]['trials']['noise_found_arcsec']:.2f} arcsec",
        f"misfit (0 to 12 % assumed) {answer[0]['misfit']:.0%}",
    ):
        assert words in page
    assert "--details" not in page


def test_trials_that_settle_nothing_have_an_exit_code_of_their_own():
    one = run(*ONE, "h0=20", "-q")
    assert one.returncode == 6
    assert one.stdout == "unknown\n"


def test_an_outcome_says_keep_or_go_back():
    worse = run(*ONE, *TRIALS, "--verify", "h6=80", "-q")
    assert worse.returncode == 3
    assert worse.stdout in ("3\n", "4\n")
    assert "outside of what the trials predict" in worse.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("h4",), "invalid trial 'h4'"),
        (("h12=17",), "h0 to h11"),
        (("0=17", "--set", "mounting.holes=0", "h1=17"), "has none"),
        ((), "no trials at 4 N·m"),
        (("--verify", "h4=17"), "no trials at 4 N·m"),
        ((*TRIALS, "--noise", "0"), "'--noise': Input should be greater"),
        ((*TRIALS, "--reseat", "1"), "--noise, the spread of repeats with the wheel mounted again"),
        ((*TRIALS, "--trial-torque", "0"), "invalid trials: 0 N·m"),
        *(((*TRIALS, option, "1"), f"No such option: {option}") for option in OF_MOUNT),
        ((*TRIALS, "--sure", "1"), "'--sure': Input should be less"),
        (("4=17",), "was hole 4 meant? h4"),
        ((*TRIALS, "--verify", "h4=17", "--card", "card.txt"), "for the mounting that --verify comes after"),
        ((*TRIALS, "--set", "tolerances.e_hb=0"), "unknown size of the cam offset"),
    ],
)
def test_wrong_usage_is_told_before_any_work(arguments, words):
    done = run(*ONE, *arguments)
    assert done.returncode == 2
    assert words in " ".join(done.stderr.split())
    assert done.stdout == ""


@pytest.mark.parametrize("option", ["--trial", "--verify", "--trial-torque", "--noise"])
def test_mount_names_the_command_that_takes_trials(option):
    done = run("mount", SMALL, option, "h0=73")
    assert done.returncode == 2
    assert "hdassist trials PRESET h0=28.1" in done.stderr
    assert option not in run("mount", "--help").stdout


def test_trials_that_nothing_explains_have_no_answer(tmp_path: Path):
    figures = tmp_path / "none.csv"
    done = run(*ONE, "h0=20", "h4=500", "--csv", str(figures))
    assert done.returncode == 5
    words = " ".join(done.stderr.split())
    assert "no draw shows F'_ior as measured, ″: hole 0 (0°) = 20, drawn" in words
    assert "hole 4 (120°) = 500, drawn" in words
    assert done.stdout == ""
    assert not figures.exists()


def test_values_of_another_torque_are_refused_with_the_torque_that_they_fit():
    done = run(*ONE, "h0=190", "h4=189", "h8=147")
    words = " ".join(done.stderr.split())
    assert done.returncode == 5
    assert "error: measured at another torque? The trials fit 1 N·m far better than 4 N·m" in words
    assert "hint: --trial-torque 1; if not, " in words


def test_a_card_tells_the_trials_it_rests_on(answer, tmp_path: Path):
    card = tmp_path / "card.txt"
    best = answer[0]["best_bet"]["probability_good"]
    done = run(*ONE, *TRIALS, "--card", str(card), "-q", "--sure", f"{best + 0.01}")
    assert (done.returncode, done.stdout) == (6, "unknown\n")
    assert "no card: nothing can be ordered" in done.stderr
    assert not card.exists()
    done = run(*LOOSE, *MANY, "--card", str(card), "-q", "--sure", "0.3")
    assert (done.returncode, done.stdout) == (0, "4\n"), done.stderr
    text = " ".join(card.read_text(encoding="utf-8").split())
    assert "hole 0: 71.2″; hole 4: 16.5″; hole 8: 25″" in text
    assert "not from the last trial" in text
    told = json.loads(run(*LOOSE, *MANY, "--json", "--sure", "0.3").stdout)
    now, best = (f"{told[name]['F_ior_arcsec']['expected'][0]:.2f}" for name in ("current", "best_bet"))
    assert f" 4 {now} {best} " in text
    assert (told["settled"], told["probability_needed"]) == (True, 0.3)
    assert min(told["trials"]["probability_good_without"]) >= 0.6


def test_a_lower_demand_does_not_settle_what_hinges_on_one_value(answer):
    best = answer[0]["best_bet"]["probability_good"]
    done = run(*LOOSE, *TRIALS, "--sure", f"{best - 0.01}", "--json")
    assert done.returncode == 6
    told = json.loads(done.stdout)
    assert (told["settled"], told["recommended"], told["probability_needed"]) == (False, None, best - 0.01)
    assert min(told["trials"]["probability_good_without"]) < 0.6
    assert "the choice hinges on 73″ at hole 0" in done.stderr


def test_values_of_the_preset_are_enough():
    values = "measured.F_ior={h0@4: 73 ± 2, h4@4: 18.5 ± 2, h8@4: 25 ± 2}"
    done = run(*LOOSE, "--set", values, "--json")
    given = run(*LOOSE, "h0=73", "h4=18.5", "h8=25", "--json")
    assert done.returncode == given.returncode and done.returncode in (0, 6), done.stderr
    assert json.loads(done.stdout)["positions"] == json.loads(given.stdout)["positions"]
