"""Measured teeth on the command line: files as gear checkers write them, faults, and what the answers say."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from hdassist import MeasuredTeeth, MeasuredWheel, check, load_preset, read_pitch
from tests.helpers.process import SMALL, in_a_line, run

TEETH = np.arange(1, 63)
VALUES = np.round(18 * np.sin(2 * np.pi * TEETH / 62 + 1) + 6 * np.sin(4 * np.pi * TEETH / 62), 1)
QUICK = ("--set", "mounting.holes=2", "--set", "operation.M_g=4")
HEAD = "# form: cumulative\n# unit: um\n# sense: ccw\n# mark: 1\n"


def rows(values=VALUES, first: int = 1, separator: str = ";") -> str:
    return "".join(f"{k}{separator}{value}\n" for k, value in enumerate(values, first))


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    """A folder with a file for each wheel; that of the circular spline is European."""
    folder = tmp_path_factory.mktemp("pitch")
    text = (
        HEAD.replace(": um", ": µm").replace("mark: 1", "mark: 17") + "Zahn;Fp links [µm]\n" + rows().replace(".", ",")
    )
    (folder / "wheel.csv").write_bytes(text.replace("\n", "\r\n").encode("utf-8-sig"))
    (folder / "flexspline.csv").write_text(HEAD + rows(VALUES[:60]))
    return folder


def pitch(*args: str, files: Path, stdin: str | None = None):
    """Run in a folder, so that files have short names."""
    return run(*args, cwd=files, stdin=stdin)


@pytest.fixture(scope="module")
def answer(files):
    return pitch(
        "mount", SMALL, *QUICK, "--pitch-b", "wheel.csv", "--pitch-g", "flexspline.csv", "--mark-b", "-240", "--json",
        files=files,
    )  # fmt: skip


def test_json_says_what_was_measured(answer, files):
    assert answer.returncode == 0
    told = json.loads(answer.stdout)["pitch"]
    assert set(told) == {"b", "g"}
    assert told["b"] == {
        "file": "wheel.csv",
        "sha256": hashlib.sha256((files / "wheel.csv").read_bytes()).hexdigest(),
        "mark_tooth": 17,
        "mark_deg": 120.0,
        "flank": "left",
        "range_um": pytest.approx(float(np.ptp(VALUES))),
        "notes": [],
    }
    assert (told["g"]["mark_tooth"], told["g"]["mark_deg"], told["g"]["flank"]) == (1, 0, None)
    (assumed,) = told["g"]["notes"]
    assert answer.stderr == f"note: flexspline, flexspline.csv: {assumed}\n"
    assert assumed == "the mark is at 0 deg, from phases.xi_g of the preset; to change it use --mark-g"


def test_json_has_the_curve_and_nothing_that_needs_a_search(answer):
    told = json.loads(answer.stdout)
    assert (told["now"], told["samples"]) == (None, None)
    assert "sensitivity" not in told["current"]
    (curve,) = told["curves"]
    assert curve["phase_deg"] == [120, 300]
    assert curve["every_state"] == [True, True]
    assert told["certificate"]["states"] == 2 * 1860


def test_numbers_are_those_of_the_python_interface(answer, files):
    drive = load_preset(SMALL, ["operation.M_g=4"])
    b = MeasuredWheel(read_pitch(files / "wheel.csv", 62), 120.0)
    g = MeasuredWheel(read_pitch(files / "flexspline.csv", 60), 0.0)
    now, turned = json.loads(answer.stdout)["curves"][0]["F_ior_arcsec"]
    there = MeasuredTeeth(g, b)
    assert check(drive, measured=there).points[0].error.F_ior_arcsec == pytest.approx(now, abs=1e-9)
    alone = check(drive, measured=there.rotated(drive, 180.0))
    assert alone.points[0].error.F_ior_arcsec == pytest.approx(turned, abs=1e-9)
    assert now != pytest.approx(turned, abs=1)


@pytest.mark.parametrize("command", ["mount", "check", "trace"])
def test_people_see_whose_teeth_were_measured(command, files):
    args = (*QUICK, "--details") if command == "mount" else ("--torque", "4")
    page = pitch(command, SMALL, *args, "--pitch-b", "wheel.csv", "--mark-b", "120", files=files)
    assert (page.returncode, page.stderr) == (0, "")
    assert "measured pitch deviations: circular spline (wheel.csv)" in in_a_line(page.stdout)
    assert max(map(len, page.stdout.splitlines())) <= 80


def test_without_files_the_key_is_there_and_empty():
    for command in ("check", "trace"):
        assert json.loads(run(command, SMALL, "--torque", "4", "--json").stdout)["pitch"] == {"b": None, "g": None}


def test_check_and_mount_agree_where_the_wheel_stands(answer, files):
    both = ("--pitch-b", "wheel.csv", "--pitch-g", "flexspline.csv", "--mark-b", "120", "--json")
    alone = json.loads(pitch("check", SMALL, "--torque", "4", *both, files=files).stdout)
    now = json.loads(answer.stdout)["current"]["F_ior_arcsec"][0]
    assert alone["operating_points"][0]["F_ior_arcsec"] == pytest.approx(now, abs=1e-9)
    assert alone["pitch"]["b"]["mark_deg"] == 120


def test_options_say_what_a_file_does_not(files):
    single = np.round(VALUES - np.roll(VALUES, 1), 2)
    text = "tooth;left;right\n" + "".join(f"{k};{v};0\n" for k, v in zip(TEETH, -single[::-1], strict=True))
    options = ("--pitch-form", "single", "--pitch-sense", "cw", "--pitch-flank", "left")
    told = pitch("trace", SMALL, "--pitch-b", "-", *options, "--json", files=files, stdin=text)
    assert told.returncode == 0
    wheel = json.loads(told.stdout)["pitch"]["b"]
    assert (wheel["file"], wheel["flank"]) == ("<stdin>", "left")
    assert wheel["range_um"] == pytest.approx(float(np.ptp(VALUES)), abs=1e-6)
    assert "numbers reversed" in wheel["notes"]
    assert "note: circular spline, <stdin>: single pitch deviations summed up" in told.stderr


def test_an_override_without_effect_is_noted(files):
    told = pitch("trace", SMALL, "--pitch-b", "wheel.csv", "--set", "tolerances.F_i2=60", files=files)
    assert (
        "note: circular spline, wheel.csv: tolerances.F_i2 has no effect, because the teeth are measured\n"
        in told.stderr
    )
    told = pitch("trace", SMALL, "--pitch-b", "wheel.csv", "--set", "harmonics.a_b2=3", files=files)
    assert (
        "note: circular spline, wheel.csv: harmonics.a_b2 has no effect, because the teeth are measured\n"
        in told.stderr
    )
    told = pitch("trace", SMALL, "--pitch-b", "wheel.csv", "--set", "tolerances.e_b=3", files=files)
    assert "note: circular spline, wheel.csv: tolerances.e_b is added to the measured teeth" in told.stderr


def test_the_card_has_the_tooth(files):
    told = pitch(
        "mount", SMALL, *QUICK, "--pitch-b", "wheel.csv", "--mark-b", "120", "--card", "-", files=files
    )  # fmt: skip
    assert told.returncode == 0
    assert "tooth 17 of the measured circular spline" in told.stdout
    assert "measured pitch deviations: circular spline, wheel.csv, sha256" in told.stdout


@pytest.mark.thorough
@pytest.mark.parametrize(("language", "words"), [("en", "it is taken as counter-clockwise"), ("ru", "считаются")])
def test_the_card_says_where_the_sense_of_counting_is_assumed(files, tmp_path, language, words):
    (tmp_path / "silent.csv").write_text(HEAD.replace("# sense: ccw\n", "") + rows())
    for file, wanted in (("silent.csv", True), (str(files / "wheel.csv"), False)):
        for kind in ("txt", "html"):
            told = run("mount", SMALL, *QUICK, "--pitch-b", file, "--mark-b", "120", "--lang", language,
                       "--card", f"card.{kind}", "--force", "-q", cwd=tmp_path)  # fmt: skip
            assert told.returncode == 0
            card = " ".join((tmp_path / f"card.{kind}").read_text("utf-8").split())
            assert (words in card) is wanted
    warned = run("mount", SMALL, *QUICK, "--pitch-b", "silent.csv", "--mark-b", "120", "--json", cwd=tmp_path)
    assert any("silent.csv" in text for text in json.loads(warned.stdout)["warnings"])


def test_what_was_left_out_is_said(files):
    free = pitch(
        "mount", SMALL, "--torque", "4", "--step", "120", "--set", "mounting.holes=0", "--pitch-b", "wheel.csv",
        "-q", files=files,
    )  # fmt: skip
    assert free.returncode == 0
    assert float(free.stdout) in (0, 120, 240)
    warned = [line for line in free.stderr.splitlines() if line.startswith("warning:")]
    assert len(warned) == 1
    assert "free angle" in warned[0]


FAULTS = {
    "wrong count": (rows(VALUES[:61]), "1:1: column 1: the wheel has 62 teeth, the file has 61"),
    "other wheel": (rows([*VALUES, 0, 1]), "63:1: column 1: the wheel has 62 teeth, the file has 64"),
    "gap": (
        rows().replace("30;", "# 30;"),
        "1:1: column 1: the wheel has 62 teeth, the file has 61 (got no row for tooth 30",
    ),
    "duplicate": (rows().replace("30;", "29;"), "30:1: column 1: the tooth is given twice"),
    "no number": (rows().replace(f"30;{VALUES[29]}", "30;n/a"), "30:4: column 2: "),
    "unit": ("# unit: in\n" + rows(), "1:9: unit: the unit is not metric"),
    "size": ("# unit: mm\n" + rows(), "2:1: column 2: 3.91e+04 µm over the whole wheel"),
    "decimal comma": (rows(separator=",").replace(".", ","), "1:1: 2 columns of deviations"),
    "empty": ("", "1:1: the file is empty"),
    "BOM": (
        "\ufeff" + rows().replace("7;", "7.5;", 1),
        "7:1: column 1: must be a tooth number (a whole number)",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_ends_with_4_and_its_place(name, tmp_path):
    text, expected = FAULTS[name]
    (tmp_path / "wheel.csv").write_text(text)
    result = pitch("check", SMALL, "--pitch-b", "wheel.csv", files=tmp_path)
    assert (result.returncode, result.stdout) == (4, "")
    assert result.stderr.startswith("error: wheel.csv:")
    assert f"wheel.csv:{expected}" in result.stderr
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["mount", "-", "--pitch-b", "-"], "standard input can be read only once"),
        (["check", "-", "-"], "standard input can be read only once"),
        (["trace", SMALL, "--pitch-b", "-", "--pitch-g", "-"], "standard input can be read only once"),
        (["check", SMALL, SMALL, "--pitch-b", "wheel.csv"], "the pitch files belong to one drive"),
        (["mount", SMALL, "--mark-b", "20"], "--mark-b requires the pitch deviations of this wheel"),
        (
            ["mount", SMALL, "--pitch-b", "wheel.csv", "--mark-g", "20"],
            "--mark-g requires the pitch deviations of this wheel",
        ),
        (["mount", SMALL, "--pitch-b", "wheel.csv", "--mark-b", "nan"], "nan is out of range"),
        (["trace", SMALL, "--pitch-sense", "cw"], "require --pitch-b or --pitch-g"),
    ],
)
def test_what_cannot_be_meant(args, words, files):
    result = pitch(*args, files=files)
    assert (result.returncode, result.stdout) == (2, "")
    assert words in result.stderr
    assert "error: " in result.stderr


def test_an_unknown_choice_is_refused(files):
    assert pitch("trace", SMALL, "--pitch-b", "wheel.csv", "--pitch-sense", "up", files=files).returncode == 2


def test_measured_teeth_disable_sampling_and_the_nominal_values_decide(files):
    asked = ("mount", SMALL, *QUICK, "--pitch-b", "wheel.csv", "--set", "uncertainty.phases.phi_hb=9")
    for more in ((), ("--draws", "0")):
        given = pitch(*asked, "-q", *more, files=files)
        assert (given.returncode, given.stdout) == (0, "any\n")
        assert "were not sampled: 1" in given.stderr
    assert ": ANY HOLE No hole is expected to be better" in in_a_line(pitch(*asked, files=files).stdout)
    with_values = pitch(*asked, "h0=20", files=files)
    assert (with_values.returncode, "--pitch-b cannot be combined with measured values" in with_values.stderr) == (
        2,
        True,
    )


def test_inconclusive_check_of_measured_teeth_repeats_their_files_in_next(files):
    (files / "my_wheel.csv").write_bytes((files / "wheel.csv").read_bytes())
    asked = ("--limit", "400", "--set", "uncertainty.phases.phi_hb=9", "--pitch-b", "my_wheel.csv", "--mark-b", "120")
    done = pitch("check", SMALL, "--torque", "4", *asked, files=files)
    words = in_a_line(done.stdout)
    assert done.returncode == 6
    assert "1 inputs are uncertain and were not sampled" in words
    options = "--limit 400 --pitch-b=my_wheel.csv --mark-b=120"
    assert f"next hdassist mount {SMALL} --set uncertainty.phases.phi_hb=9 --torque=4 {options}" in words
