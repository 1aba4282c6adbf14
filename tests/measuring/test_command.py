"""`hdassist measure` as its users meet it."""

from __future__ import annotations

import csv
import gzip
import io
import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.process import CLEAN, COMMAND, SMALL, in_a_line, run
from tests.helpers.rigs import drive_error, text, whole_range

ROOT = Path(__file__).parents[2]
REAL = ROOT.parent / "shared/data/dhem_csf17_100_digitized.csv"
TURNS = np.arange(30 * 120) / 120
CURVE = drive_error(np.random.default_rng(3), 30)
ERROR = CURVE(TURNS) + np.random.default_rng(0).standard_normal(len(TURNS))


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """A folder with the full cycle of a rig with a drive of ratio 30."""
    (tmp_path / "run.csv").write_text(text([360 * TURNS, ERROR], "cam_deg,error_arcsec"))
    return tmp_path


def test_json(rig):
    result = run("measure", "run.csv", "--drive", SMALL, "--budget", "encoder=0.1", "--json", cwd=rig)
    assert (result.returncode, result.stderr) == (0, "")
    told = json.loads(result.stdout)
    assert told["schema"] == "hdassist.measure/1"
    assert told["preset"]["name"] == "small"
    assert told["file"] == {"name": "run.csv", "sha256": told["file"]["sha256"], "rows": 3600}
    assert told["cycle"] == {
        "ratio": 30, "cam_revolutions": 30, "output_revolutions": 1, "travel_deg": None,
    }  # fmt: skip
    (found,) = told["directions"]
    low, high = found["interval_arcsec"]
    assert low < whole_range(CURVE, 30) < high
    assert found["F_ior_arcsec"] == told["F_ior_arcsec"]
    assert found["F_ior_is_lower_bound"] is False
    assert found["raw_range_arcsec"] > high
    assert found["coverage"]["share"] == pytest.approx(1, abs=1e-3)
    assert set(found["orders"][0]) == {
        "per_cam_rev", "amplitude_arcsec", "amplitude_uncertainty_arcsec", "phase_deg", "cause", "is_of_record",
    }  # fmt: skip
    assert {"source": "encoder", "standard_uncertainty_arcsec": 0.1, "origin": "stated"} in found["budget"]
    assert told["seed"] == 0


def test_a_screen_holds_the_answer_and_what_to_do_next(rig):
    (rig / "small.yaml").write_bytes(Path(SMALL).read_bytes())  # a short name: the page repeats it
    lines = run("measure", "run.csv", "--drive", "small.yaml", cwd=rig).stdout.splitlines()
    told = json.loads(run("measure", "run.csv", "--drive", SMALL, "--json", cwd=rig).stdout)
    (found,) = told["directions"]
    low, high = found["interval_arcsec"]
    assert lines[0] == f"run.csv, 3600 rows, small: F'_ior {told['F_ior_arcsec']:.2f}″"
    assert any(f"{low:.2f} to {high:.2f}" in line and line.endswith("100.0 %") for line in lines)
    labels = [match[1] for line in lines if (match := re.match(r"(orders|not in u|read as|next|more)  +\S", line))]
    assert labels == ["orders", "not in u", "read as", "next", "more"]
    assert any(re.match(r"not in u +encoder, .* \(--budget", line) for line in lines)
    assert any(re.match(r"next +hdassist mount .*small.yaml h0=run.csv", line) for line in lines)
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80


@pytest.mark.thorough
def test_measure_reports_a_lower_bound_for_part_of_the_cycle(rig):
    (rig / "part.csv").write_text(text([360 * TURNS[:600], ERROR[:600]], "cam_deg,error_arcsec"))
    lines = run("measure", "part.csv", "--ratio", "30", "--ascii", cwd=rig).stdout.splitlines()
    told = json.loads(run("measure", "part.csv", "--ratio", "30", "--json", cwd=rig).stdout)
    assert lines[0].startswith(
        f"part.csv, 600 rows: F'_ior at least {told['directions'][0]['interval_arcsec'][0]:.2f} arc"
    )
    rule = next(k for k, line in enumerate(lines) if re.fullmatch("-+", line))
    heads = " ".join(lines[lines.index("") : rule])
    assert "range" in heads and "F'_ior" not in heads  # of the part, above the lower bound
    quiet = run("measure", "part.csv", "--ratio", "30", "-q", cwd=rig).stdout
    assert quiet == f">= {told['directions'][0]['interval_arcsec'][0]:.2f}″\n"
    assert lines[1].startswith("The recording covers 16.6 % of the full mesh cycle of 30 input revolutions")
    assert len(lines) <= 24
    assert "".join(lines).isascii()
    assert not any("Readings are missing" in line for line in lines)
    alone = run("measure", "part.csv", "--no-plot", cwd=rig).stdout
    assert "without --drive or --ratio, the full mesh cycle is unknown" in in_a_line(alone)
    assert re.search(r"next +hdassist compare PRESET part\.csv\n", alone)


@pytest.mark.thorough
def test_the_owner_of_a_joint_is_sent_to_its_correction(rig):
    (rig / "joint.csv").write_text(text([360 * TURNS[:1800], ERROR[:1800]], "cam_deg,error_arcsec"))

    def following(*options):
        page = run("measure", *options, "--no-plot", cwd=rig).stdout
        return in_a_line(page.partition("\nnext ")[2].partition("\nmore ")[0])

    alone = following("joint.csv", "--ratio", "30", "--travel", "170", "--budget", "encoder=0.1")
    assert alone == "hdassist compensate joint.csv --ratio 30 --travel 170 --torque TORQUE --budget=encoder=0.1"
    done = run(*shlex.split(alone.replace("TORQUE", "5"))[1:], cwd=rig)
    assert (done.returncode, done.stderr) == (0, "")
    assert following("run.csv", "--ratio", "30") == "hdassist compensate run.csv --ratio 30 --torque TORQUE"
    known = following("joint.csv", "--drive", SMALL, "--travel", "170")
    assert known == f"hdassist compensate {SMALL} joint.csv --travel 170"
    assert following("joint.csv", "--ratio", "30", "--travel", "300") == "hdassist compare PRESET joint.csv"  # a part


@pytest.mark.thorough
def test_the_next_command_reads_the_file_alike(rig):
    counts = [np.rint(TURNS * 16384), np.rint((TURNS / 30 + ERROR / 1296000) * 4194304)]
    (rig / "counts.csv").write_text(text(counts, "enc1,enc2", digits=0))
    options = ["--angle=enc1", "--angle-unit=14bit,22bit", "--second=enc2", "--robust", "--budget=encoder=0.1"]
    page = run("measure", "counts.csv", "--drive", SMALL, *options, "--no-plot", cwd=rig)
    assert (page.returncode, page.stderr) == (0, "")
    _, _, following = page.stdout.partition("\nnext ")
    assert following.split()[:2] == ["hdassist", "mount"]
    assert in_a_line(following).split()[3:9] == ["h0=counts.csv", *options]
    plain = run("measure", "run.csv", "--drive", SMALL, "--no-plot", cwd=rig).stdout
    assert plain.partition("h0=run.csv")[2].split()[0] == "more"


@pytest.mark.thorough
def test_the_rest_stands_in_the_details(rig):
    whole = run("measure", "run.csv", "--ratio", "30", "--details", "--no-plot", cwd=rig).stdout
    assert max(map(len, whole.splitlines())) <= 80
    for words in ("range of the readings", "full cycle, input revolutions", "share of the full cycle covered",
                  "the 12 largest of", "not stated", "combined"):  # fmt: skip
        assert words in whole
    assert "±, ″" not in whole  # beside a ± of two u
    coupled = ERROR + 12 * np.cos(2 * np.pi * TURNS / 30)
    (rig / "coupled.csv").write_text(text([360 * TURNS, coupled], "cam_deg,error_arcsec"))
    beside = run("measure", "coupled.csv", "--drive", SMALL, "--no-plot", cwd=rig)
    assert "once per output revolution: " in in_a_line(beside.stdout)


@pytest.mark.thorough
def test_both_directions_stand_side_by_side(rig):
    back = [360 * TURNS[-2::-1], ERROR[-2::-1] + 5]
    both = text([np.append(360 * TURNS, back[0]), np.append(ERROR, back[1])], "cam_deg,error_arcsec")
    (rig / "both.csv").write_text(both)
    command = ("measure", "both.csv", "--ratio", "30", "--no-plot")
    page = run(*command, cwd=rig).stdout
    told = json.loads(run(*command, "--json", cwd=rig).stdout)
    for direction in told["directions"]:
        name = {1: "increasing", -1: "decreasing"}[direction["direction"]]
        assert re.search(rf"^{name} +{direction['F_ior_arcsec']:.2f} ", page, re.MULTILINE)
    assert re.search(r"^reversal +lost motion [45]\.\d\d ± 0\.\d\d″ \(k = 2\) at reversal", page, re.MULTILINE)


def test_a_gap_longer_than_a_cam_turn_is_drawn(rig):
    kept = (TURNS < 6) | (TURNS > 15)
    (rig / "gap.csv").write_text(text([360 * TURNS[kept], ERROR[kept]], "cam_deg,error_arcsec"))
    page = run("measure", "gap.csv", "--ratio", "30", cwd=rig)
    assert (page.returncode, page.stderr) == (0, "")
    assert "covers 69.9 % of the full mesh cycle of 30 input revolutions" in in_a_line(page.stdout)
    assert "Readings are missing: gaps of more than 14.8°" in in_a_line(page.stdout)


@pytest.mark.thorough
def test_measure_prints_its_result_even_if_plot_or_page_fails(rig, monkeypatch):
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("no room")

    command = ("measure", "run.csv", "--ratio", "30")
    whole = run(*command, "--no-plot", cwd=rig)
    for place, kind, left in (
        ("hdassist.interface.terminal.plot.ticks", "plot", whole.stdout.split()),
        ("hdassist.interface.terminal.page.report_page", "page", run(*command, "-q", cwd=rig).stdout.split()),
    ):
        monkeypatch.setattr(place, broken)
        assert run(*command, cwd=rig).returncode == 1  # a fault of ours: seen by every test
        monkeypatch.setitem(CLEAN, "HDASSIST_STRICT", "")
        page = run(*command, cwd=rig)
        monkeypatch.undo()
        assert (page.returncode, page.stdout.split()) == (0, left)
        said = f"warning: no {kind}, the result is not affected: ZeroDivisionError: no room (a bug in hdassist)\n"
        assert page.stderr == said


@pytest.mark.thorough
def test_quiet_result_is_ascii_if_the_option_is_given(rig):
    plain, ascii_ = (
        run("measure", "run.csv", "--ratio", "30", "-q", *more, cwd=rig).stdout for more in ((), ("--ascii",))
    )
    assert ascii_ == plain.replace("±", "+-").replace("″", " arcsec") != plain


@pytest.mark.slow
def test_stdin_a_file_and_a_gzip_file_say_the_same(rig):
    quiet = [run("measure", "run.csv", "--ratio", "30", "-q", cwd=rig).stdout]
    quiet.append(run("measure", "-", "--ratio", "30", "-q", stdin=(rig / "run.csv").read_text()).stdout)
    (rig / "run.csv.gz").write_bytes(gzip.compress((rig / "run.csv").read_bytes()))
    quiet.append(run("measure", "run.csv.gz", "--ratio", "30", "-q", cwd=rig).stdout)
    assert len(set(quiet)) == 1
    assert re.fullmatch(r"\d+\.\d\d (± \d\.\d\d|\+\d\.\d\d -\d\.\d\d)″\n", quiet[0])


@pytest.mark.slow
def test_several_files(rig):
    again = CURVE(TURNS) + np.random.default_rng(1).standard_normal(len(TURNS))
    (rig / "again.csv").write_text(text([360 * TURNS, again], "cam_deg,error_arcsec"))
    (rig / "bad.csv").write_text("cam,err\n1,x\n")
    told = json.loads(run("measure", "run.csv", "again.csv", "--ratio", "30", "--json", cwd=rig).stdout)
    assert [r["file"]["name"] for r in told["results"]] == ["run.csv", "again.csv"]
    assert told["repeat_runs"]["files"] == 2
    mixed = run("measure", "run.csv", "bad.csv", "--ratio", "30", "--json", cwd=rig)
    assert mixed.returncode == 4
    assert "error" in json.loads(mixed.stdout)["results"][1]
    assert "bad.csv" in mixed.stderr


@pytest.mark.thorough
def test_csv_of_the_curve(rig):
    result = run("measure", "run.csv", "--ratio", "30", "--csv", "-", cwd=rig)
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert len(rows) == 3600
    fitted = np.array([float(row["fitted_arcsec"]) for row in rows])
    assert np.std(fitted - CURVE(TURNS) + CURVE(TURNS).mean()) < 0.5


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        (["none.csv"], 4, "no such file: none.csv"),
        (["."], 4, "is a directory"),
        (["run.csv", "--ratio", "99.7"], 2, "multiple of 0.5"),
        (["run.csv", "--ratio", "30", "--drive", SMALL], 2, "which states the ratio"),
        (["run.csv", "--drive", "nothing"], 4, "no such preset"),
        (["run.csv", "--orders", "a"], 2, "invalid --orders a"),
        (["run.csv", "--orders", "1-100"], 5, "too long for order 100"),
        (["run.csv", "--drift", "cubic"], 2, "invalid --drift cubic"),
        (["run.csv", "--angle-of", "motor"], 2, "'--angle-of': 'motor' is not one of 'cam', 'output'"),
        (["run.csv", "--angle-unit", "mm"], 2, "expected a unit of angle"),
        (["run.csv", "--wrap", "-1"], 2, "invalid --wrap -1"),
        (["run.csv", "--budget", "luck=1"], 2, "invalid --budget luck=1"),
        (["run.csv", "--error", "nope"], 4, "no column nope"),
        (["-", "-"], 2, "read only once"),
        (["nan.csv"], 4, "nan.csv:3:3: err: must be a finite number"),
        (["empty.csv"], 4, "the file is empty"),
        (["noise.csv"], 5, "does not exceed its noise"),
        (["short.csv"], 4, "less than one input revolution"),
    ],
)
def test_faults_end_clearly_and_write_nothing(rig, args, code, words):
    (rig / "nan.csv").write_text("cam,err\n1,2\n2,nan\n3,4\n")
    (rig / "empty.csv").write_text("")
    noise = np.random.default_rng(2).standard_normal(800)
    (rig / "noise.csv").write_text(text([360 * TURNS[:800], noise], "cam_deg,error_arcsec"))
    (rig / "short.csv").write_text(text([360 * TURNS[:80], ERROR[:80]], "cam_deg,error_arcsec"))
    before = set(rig.iterdir())
    result = run("measure", *args, "-o", "page.txt", "--csv", "figures.csv", cwd=rig)
    assert result.returncode == code
    assert result.stdout == ""
    assert words in result.stderr
    assert set(rig.iterdir()) == before


@pytest.mark.slow
def test_a_million_rows(tmp_path):
    turns = np.linspace(0, 100, 1_000_000)
    error = 10 * np.cos(4 * np.pi * turns) + np.random.default_rng(0).standard_normal(len(turns))
    np.savetxt(tmp_path / "long.csv", np.column_stack([360 * turns, error]), "%.4f", ",", header="cam_deg,error_arcsec")
    code = (
        "import resource, subprocess, sys, time\nbegun = time.monotonic()\n"
        f"done = subprocess.run({[*COMMAND, 'measure', 'long.csv', '--ratio', '100', '-q']!r}, capture_output=True)\n"
        "print(done.stdout.decode(), time.monotonic() - begun, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    told = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=CLEAN,
        capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip
    assert float(told[0]) == pytest.approx(20, abs=0.1)
    assert float(told[-2]) < 10
    assert float(told[-1]) < 500_000  # kB


@pytest.mark.skipif(not REAL.exists(), reason="the digitised trace is not there")
def test_the_real_trace():
    # the amplitudes its README gives are those of these orders alone, fitted together
    result = run("measure", str(REAL), "--error", "error_arcsec_star1", "--ratio", "100", "--orders", "1-4,6", "--json")
    told = json.loads(result.stdout)
    (found,) = told["directions"]
    orders = {o["per_cam_rev"]: o["amplitude_arcsec"] for o in found["orders"]}
    for order, amplitude in {2: 21.6, 4: 3.9, 1: 3.5, 3: 1.8, 6: 1.0}.items():
        assert round(orders[order], 1) == amplitude
    assert found["raw_range_arcsec"] == pytest.approx(55, abs=0.5)
    assert found["F_ior_is_lower_bound"] is True
    assert found["coverage"]["share"] < 0.03
    assert "2 columns of errors" in run("measure", str(REAL)).stderr
