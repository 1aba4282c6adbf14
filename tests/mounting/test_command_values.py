"""`hdassist mount` with measured values, also by its old name `trials`, as its users meet it."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import pytest

from tests.helpers.process import ASSUMED, SMALL, in_a_line, run, run_cold

# what the drive of the preset shows in these holes at 4 N·m with an offset of 50 um at 20 deg
TRIALS = ("h0=73", "120=18.7", "h8=25", "h4=18.2", "h3=19.3")
ONE = ("mount", SMALL, "--torque", "4", "--draws", "32", "--set", "tolerances.e_hh=0")
LOOSE = (*ONE, "--set", ASSUMED)
FEW = ("--draws", "8")  # samples, for what is said whatever they are
PLACE = {"hole", "rotation_deg"}
POSITION = {
    *PLACE, "phase_deg", "F_ior_arcsec", "expected_loss", "probability_good", "probability_better", "probability_kept",
}  # fmt: skip


@pytest.fixture(scope="module")
def answer(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, str, str]:
    figures = tmp_path_factory.mktemp("trials") / "holes.csv"
    done = run(*LOOSE, *TRIALS, "--json", "--csv", str(figures))
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), done.stderr, figures.read_text()


@pytest.mark.thorough
def test_json_tells_positions_and_what_the_values_teach(answer):
    told, _, _ = answer
    assert told["schema"] == "hdassist.mount/3"
    assert [p["hole"] for p in told["positions"]] == list(range(12))
    for position in told["positions"]:
        assert set(position) == POSITION
        F_ior = position["F_ior_arcsec"]
        assert F_ior["p5"][0] <= F_ior["p50"][0] <= F_ior["p95"][0]
    best = min(told["positions"], key=lambda p: p["expected_loss"])
    assert told["hole"] == told["best_bet"]["hole"] == told["recommended"]["hole"] == best["hole"]
    assert (told["word"], told["order"], told["exit_code"]) == ("TURN", "turn", 0)
    assert told["probability"]["value"] == best["probability_better"] >= told["probability_needed"] == 0.95
    assert [m["hole"] for m in told["trials"]["measured"]] == [0, 3, 4, 4, 8]  # in an order of their own
    assert [each["values"] for each in told["worth"]] == [5, 6, 8]
    assert told["verification"] is None
    assert told["certificate"]["max_residual"] < 1e-9


@pytest.mark.thorough
@pytest.mark.usefixtures("kept")
def test_the_old_name_is_the_same_command(answer):
    old = run("trials", *LOOSE[1:], *TRIALS, "--json")
    assert json.loads(old.stdout) == answer[0]


def shape(value: object, path: str = "") -> set[str]:
    """Keys of an object, those of objects within it too; lists by their first element."""
    if isinstance(value, list):
        return shape(value[0], f"{path}[]") if value else set()
    if not isinstance(value, dict):
        return set()
    return {f"{path}.{key}" for key in value}.union(*(shape(part, f"{path}.{key}") for key, part in value.items()))


@pytest.mark.thorough
@pytest.mark.usefixtures("kept")
def test_json_has_one_shape_whatever_was_given(answer):
    few = (*LOOSE, *FEW, "--json")
    least = run(*few, "0=20", "90=20", "--set", "mounting.holes=0")
    assert least.returncode == 0, least.stderr
    done = run(*few, *TRIALS, "--torque", "1", "--trial-torque", "4", "--verify", "h4=19")
    assert done.returncode in (0, 3), done.stderr
    told, none = json.loads(done.stdout), json.loads(run(*few).stdout)
    assert told["M_g_Nm"] == [4, 1]
    assert told["verification"]["verdict"] in ("KEEP", "GO_BACK")
    assert {len(values) for values in told["positions"][3]["F_ior_arcsec"].values()} == {2}
    assert set(none) == set(told) == set(answer[0]) == set(json.loads(least.stdout))
    shapes = [
        {key for key in shape(each) if not key.startswith((".verification.", ".next.", ".suspected."))}
        for each in (told, answer[0], json.loads(least.stdout))
    ]
    assert shapes[0] == shapes[1] == shapes[2]


@pytest.mark.thorough
def test_csv_has_a_row_for_each_hole(answer):
    told, _, figures = answer
    rows = list(csv.DictReader(figures.splitlines()))
    assert [float(row["F_ior_p50_arcsec"]) for row in rows] == [p["F_ior_arcsec"]["p50"][0] for p in told["positions"]]


@pytest.mark.thorough
def test_the_same_digits_for_any_number_of_jobs(answer):
    # and for any hash seed
    assert json.loads(run_cold(*LOOSE, *TRIALS, "--json", "--jobs", "1").stdout) == answer[0]


@pytest.mark.thorough
@pytest.mark.usefixtures("kept")
def test_mount_page_states_hole_probability_next_measurement_and_next_command(answer):
    short = (Path(SMALL).name if each == SMALL else each for each in LOOSE)  # a long path takes lines of its own
    done = run(*short, *TRIALS, "--ascii", cwd=Path(SMALL).parent)
    assert done.returncode == 0
    assert done.stdout.isascii()
    assert len(done.stdout.splitlines()) <= 36  # the next command stands there as it is typed
    page = in_a_line(done.stdout)
    # the uncertainty by the default of --noise is no secret
    head = f"small, 5 measured values (+- 2 arcsec, k = 2) at 4 N*m: TURN, hole {answer[0]['hole']} Put the "
    assert page.startswith(head)
    assert (
        " ".join(
            answer[0]["instruction"]
            .replace("→", "->")
            .replace("·", "*")
            .replace("°", " deg")
            .replace("″", " arcsec")
            .split()
        )
        in page
    )
    for words in ("is better than hole 0 by more than 1 %: ", " Effective sample size: ", "F'_ior at 4 N*m, arcsec"):
        assert words in page
    following = answer[0]["next"]
    assert (f"Before bolting, measure F'_ior in hole {following['hole']}" if following else "Stop measuring: ") in page
    words = re.sub(r"next hdassist .*?F_IOR", "", page)  # the command as it was typed
    assert not re.search(r"\b(tolerances|phases|gears|bearing)\.", words)  # no paths on a fitter's page


@pytest.mark.thorough
@pytest.mark.usefixtures("kept")
def test_details_are_all_holes_and_what_was_learnt(answer):
    page = in_a_line(run(*LOOSE, *TRIALS, "--ascii", "--details").stdout)
    for words in (
        "all holes: F'_ior",
        f"stated 1 arcsec, estimated {answer[0]['trials']['noise_found_arcsec']:.2f} arcsec",
    ):
        assert words in page


@pytest.mark.thorough
@pytest.mark.usefixtures("kept")
def test_single_value_gives_a_hole_and_the_next_measurement():
    one = run(*ONE, "h0=20", "--json", "--no-plot")
    told = json.loads(one.stdout)
    assert (one.returncode, told["hole"] in range(12)) == (0, True)
    assert told["next"]["hole"] != 0
    assert run(*ONE, "h0=20", "-q", "--sure", "0.999").returncode == 6


@pytest.mark.thorough
@pytest.mark.usefixtures("kept")
def test_values_count_at_their_own_torque():
    """Of a drive at two torques: in JSON, in the outcome, on the page and on the card."""
    values = ("h0@4=73", "120@4=18.7", "h8@4=25", "h4=90", "--torque", "1")  # without one: at the lightest
    done = run(*LOOSE, *FEW, *values, "--verify", "h3@1=88", "--json")
    assert done.returncode in (0, 3), done.stderr
    found = json.loads(done.stdout)
    assert [(m["hole"], m["M_g_Nm"]) for m in found["trials"]["measured"]] == [(0, 4), (4, 1), (4, 4), (8, 4), (3, 1)]
    assert found["verification"]["M_g_Nm"] == 1
    page = run(*LOOSE, *FEW, *values, "--card", "-")
    assert page.returncode == 0, page.stderr
    for words in ("measured at 4 N·m: hole 0", "; 1 N·m: hole 4: 90″"):
        assert words in in_a_line(page.stdout)


@pytest.mark.thorough
def test_an_outcome_says_keep_or_go_back():
    doubtful = run(*ONE, *FEW, *TRIALS, "--verify", "h6=80", "-q")  # where 15 was expected
    assert (doubtful.returncode, doubtful.stdout) == (6, "6\n")
    worse = run(*ONE, *FEW, *TRIALS, "h6=80", "--verify", "h6=80.5", "-q")
    assert worse.returncode == 3
    assert worse.stdout in ("3\n", "4\n")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("h4",), "invalid trial 'h4'"),
        (("h12=17",), "h0 to h11"),
        (("0=17", "--set", "mounting.holes=0", "h1=17"), "the seat has no holes"),
        (("--verify", "h4=17"), "no measured value at 4 N·m"),
        ((*TRIALS, "--noise", "0"), "'--noise': must be at least"),
        ((*TRIALS, "--reseat", "1"), "use --noise"),
        ((*TRIALS, "--trial-torque", "0"), "invalid torque 0 N·m"),
        ((*TRIALS, "--step", "30"), "--step cannot be combined with measured values"),
        ((*TRIALS, "--compensated", "phasors"), "--compensated cannot be combined with measured values"),
        ((*TRIALS, "--trial", "h0=1"), "hdassist mount PRESET h0=28.1 h4=17.3"),
        ((*TRIALS, "--sure", "1.1"), "must be at most"),
        (("4=17",), "write h4 for hole 4"),
        ((*TRIALS, "--verify", "h4=17", "--card", "card.txt"), "--card cannot be combined with --verify"),
        (
            (*TRIALS, "--set", "tolerances.e_hb=0"),
            "measured values require tolerances.e_hb, the size of the wave generator eccentricity",
        ),
    ],
)
def test_wrong_usage_is_told_before_any_work(arguments, words):
    done = run(*ONE, *arguments)
    assert done.returncode == 2
    assert words in " ".join(done.stderr.split())
    assert done.stdout == ""


@pytest.mark.thorough
def test_values_that_no_drive_shows_name_a_hole_by_themselves():
    done = run(*ONE, *FEW, "h0=20", "h4=500", "h8=480", "--json")
    told = json.loads(done.stdout)
    assert (done.returncode, told["hole"] in (0, 1, 11)) == (0, True)
    assert told["trials"]["probability_by_values_alone"] > 0.9
    assert "no drive of this preset agrees with these values" in done.stderr


@pytest.mark.thorough
def test_values_that_fit_another_torque_better_raise_a_warning():
    done = run(*ONE, *FEW, "h0=190", "h4=189", "h8=147", "-q")
    words = " ".join(done.stderr.split())
    assert done.returncode == 0
    assert "the values agree with 1 N·m far better than with 4 N·m; " in words


@pytest.mark.thorough
@pytest.mark.usefixtures("kept")
def test_card_lists_the_measured_values_its_word_and_the_probability(answer, tmp_path: Path):
    card = tmp_path / "card.txt"
    done = run(*LOOSE, *TRIALS, "--card", str(card), "-q")
    assert (done.returncode, done.stdout) == (0, f"{answer[0]['hole']}\n"), done.stderr
    text = " ".join(card.read_text(encoding="utf-8").split())
    assert "hole 0: 73″; hole 3: 19.3″; hole 4: 18.2″; hole 4: 18.7″; hole 8: 25″" in text
    assert "Hole 0 is where the circular spline was before the first trial." in text
    assert "Probability: TURN" in text
    assert re.search(r"--verify h\d+=VALUE", text)
    stated = re.search(r" 4 ([\d.]+) ([\d.]+) ", text)
    assert stated
    values = [answer[0][name]["F_ior_arcsec"][0] for name in ("current", "best_bet")]
    assert [float(number) for number in stated.groups()] == pytest.approx(values, rel=0.05)


@pytest.mark.thorough
@pytest.mark.usefixtures("kept")
def test_values_of_the_preset_count_beside_those_given():
    values = "measured.F_ior={h0@4: 73 ± 2, h4@4: 18.5 ± 2}"
    done = run(*LOOSE, *FEW, "--set", values, "h8=25", "--json")
    given = run(*LOOSE, *FEW, "h0=73", "h4=18.5", "h8=25", "--json")
    assert done.returncode == given.returncode == 0, done.stderr
    assert json.loads(done.stdout)["positions"] == json.loads(given.stdout)["positions"]


@pytest.mark.thorough
def test_required_number_of_samples_is_the_one_in_the_help():
    """A catalogue's value that no drive has: 8 samples of --draws 16 with measured values, as the help has it."""
    few = run(
        "mount", SMALL, "--torque", "4", *TRIALS[:3], "--draws", "16", "--set", ASSUMED, "--set", "catalogue.K_2=1e9"
    )
    assert few.returncode == 5
    assert re.search(r" samples, 8 required: the value catalogue\.K_2 ", few.stderr), few.stderr
    words = in_a_line(run("mount", "-h").stdout)
    assert "half this size is sufficient if F'_ior was measured in holes. [64]" in words
