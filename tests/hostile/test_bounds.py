"""Numbers of any size in options and files: a result or a refusal with its place, never a fault of the program."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from hdassist.drive.loading import load_text, with_changes
from hdassist.run.files import GREATEST, number_of
from tests.helpers.process import SMALL, TINY, run
from tests.helpers.rigs import text

TURNS = np.arange(31 * 60) / 60
BUDGET = "encoder=0.3,coupling=0.2,reseating=0.3,temperature=0.4"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "small.yaml").write_text(Path(SMALL).read_text())
    error = 10 * np.sin(4 * np.pi * TURNS) + 0.1 * np.random.default_rng(1).standard_normal(len(TURNS))
    (tmp_path / "t.csv").write_text(text([360 * TURNS, error], "cam_deg,error_arcsec"))
    return tmp_path


def sheet(uncertainty: str = "0", torque: str = "1", sees: str = "0.7 0.8 0.9") -> str:
    """A test sheet that was filled in, with remarks as a plan writes them."""
    rows = "".join(f"{k},{30 * (k % 12)},1,{30 * (k % 12) + 0.002 * np.sin(k % 12):.6f}\n" for k in range(24))
    head = f"# plan: small, 12 positions\n# torque: {torque}\n# sees: {sees}\n# uncertainty: {uncertainty}\n"
    return f"{head}minute,target_deg,side,actual_deg\n{rows}"


def test_numbers_are_finite_and_so_are_their_squares() -> None:
    assert number_of("1e30") == GREATEST
    assert [number_of(text) for text in ("1e31", "-1e155", "1e999")] == [math.inf, -math.inf, math.inf]


@pytest.mark.parametrize("size", ["1e155", "1e308", "1e31", "2e6"])
def test_a_huge_budget_is_refused_with_its_bound(size: str, folder: Path) -> None:
    done = run("measure", "t.csv", "--ratio", "30", "--budget", f"encoder={size}", cwd=folder)
    assert done.returncode == 2
    assert "1e+06" in done.stderr


@pytest.mark.parametrize("text", ["1e308,1e308", "0.5,1e155", "0,0,2e6", "1e300"])
def test_huge_encoders_are_refused(text: str, folder: Path) -> None:
    done = run("plan", "small.yaml", "--encoders", text, cwd=folder)
    assert done.returncode == 2
    assert "1e+06" in done.stderr


@pytest.mark.parametrize("number", ["1e300", "-1e300", "1e31", "inf", "nan"])
def test_huge_numbers_of_options_are_refused(number: str, folder: Path) -> None:
    for words in (("plan", "--noise"), ("check", "--limit"), ("compensate", "--zero"), ("check", "--torque")):
        assert run(words[0], "small.yaml", f"{words[1]}={number}", cwd=folder).returncode == 2, words


@pytest.mark.parametrize(
    ("remarks", "line"),
    [({"uncertainty": "1e308"}, 4), ({"uncertainty": "-1"}, 4), ({"torque": "1e200"}, 2), ({"sees": "1 x 1"}, 3)],
)
def test_a_sheet_with_impossible_remarks_is_refused_with_the_line(
    remarks: dict[str, str], line: int, folder: Path
) -> None:
    (folder / "read.csv").write_text(sheet(**remarks))
    for command in (
        ("measure", "read.csv"),
        ("accept", "small.yaml", "--limit", "F_ior@1=60", "--measured", "1=read.csv"),
    ):
        more = ["--measured-only", "--budget", BUDGET] * (command[0] == "accept")
        done = run(*command, *more, "--json", cwd=folder)
        assert done.returncode == 4
        assert f"read.csv:{line}:" in json.loads(done.stdout)["error"]["message"]


@pytest.mark.parametrize(
    "plan", ["0 positions", "12 positions over 1e308 output turns", "12 positions over . output turns"]
)
def test_a_plan_that_cannot_be_carried_out_promises_no_share(plan: str, folder: Path) -> None:
    (folder / "read.csv").write_text(sheet().replace("12 positions", plan))
    words = ["--limit", "F_ior@1=60", "--measured", "1=read.csv", "--measured-only", "--budget", BUDGET]
    assert run("accept", "small.yaml", *words, cwd=folder).returncode == 6


@pytest.mark.parametrize("words", ["", " over 1 output turns", " over 1 output revolutions"])
def test_a_plan_is_read_in_the_words_of_any_version(words: str, folder: Path) -> None:
    (folder / "read.csv").write_text(sheet().replace("12 positions", f"12 positions{words}"))
    limit = ["--limit", "F_ior@1=60", "--measured", "1=read.csv", "--measured-only", "--budget", BUDGET]
    assert run("accept", "small.yaml", *limit, cwd=folder).returncode == 0


def test_one_row_that_is_left_out_leaves_none(folder: Path) -> None:
    (folder / "one.csv").write_text("cam_deg,error_arcsec\ninf,2.0\n")
    done = run("measure", "one.csv", "--robust", cwd=folder)
    assert done.returncode == 4
    assert "0 rows" in done.stderr


@pytest.mark.parametrize("written", ["1.23457", "1.23456789"])
def test_sheet_is_accepted_at_its_own_printed_torque_only(written: str, folder: Path) -> None:
    (folder / "read.csv").write_text(sheet(torque=written))
    words = ["--limit", "F_ior@1.23456789=60", "--measured", "1.23456789=read.csv", "--measured-only"]
    assert run("accept", "small.yaml", *words, "--budget", BUDGET, cwd=folder).returncode == 0
    (folder / "read.csv").write_text(sheet(torque="1.235"))
    refused = run("accept", "small.yaml", *words, "--budget", BUDGET, cwd=folder)
    assert refused.returncode == 4
    assert "planned for 1.235 " in refused.stderr


def test_a_sheet_has_all_digits_of_its_torque(folder: Path) -> None:
    plan = ["--torque", "1.23456789", "--positions", "6", "--draws", "0", "--approach", "run.csv"]
    assert run("plan", "small.yaml", *plan, cwd=folder).returncode in (0, 3, 6)
    assert "# torque: 1.23456789\n" in (folder / "run.csv").read_text()


def test_plan_of_too_many_positions_is_refused_immediately(folder: Path) -> None:
    plan = ["--positions", "100000", "--repeats", "1000", "--both", "--approach", "x.csv"]
    done = run("plan", "small.yaml", *plan, cwd=folder)
    assert done.returncode == 2
    assert "200000000 readings" in done.stderr
    assert not (folder / "x.csv").exists()


def test_a_changed_name_is_saved() -> None:
    saved = with_changes(Path(TINY).read_bytes(), "tiny.yaml", ["name=other", "cam.W_0=0.5"])
    drive = load_text(saved.encode(), "tiny.yaml")
    assert (drive.name, drive.cam.W_0) == ("other", 0.5)
