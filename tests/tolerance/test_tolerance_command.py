"""hdassist tolerance: what it says, keeps, goes on from, and refuses."""

import json
import re
import subprocess
import time
from pathlib import Path

import pytest
from pyarrow import parquet

from hdassist.run.errors import UntrustedError
from tests.helpers.process import CLEAN, COMMAND, TINY, in_a_line, run

FEW = ("--torque", "1", "--as-built", "--jobs", "1")  # the least that a run can do


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The records of twelve drives, written at once by one process."""
    file = tmp_path_factory.mktemp("tolerance") / "whole.jsonl"
    done = run("tolerance", TINY, "-n", "12", "--torque", "1", "--jobs", "1", "--results", str(file))
    assert done.returncode == 0, done.stderr
    return file


def test_the_page_has_yields_both_ways_and_the_next_command() -> None:
    done = run("tolerance", TINY, "-n", "12", "--torque", "1", "--limit", "60", "--jobs", "1")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("tiny, 12 random drives: yield as assembled ")
    for words in ("best of 12 holes", "5 %", "residual", "of drives of this type"):
        assert words in done.stdout
    assert f"hdassist sensitivity {TINY}" in in_a_line(done.stdout)
    assert "stated sizes: rayleigh" not in done.stdout
    assert max(map(len, lines)) <= 80
    assert len(lines) <= 24


def test_tolerance_page_of_a_required_yield_starts_with_its_verdict() -> None:
    few = ("-n", "12", "--torque", "1", "--limit", "55", "--yield", "0.99", "--jobs", "1")
    done = run("tolerance", TINY, *few, "--details", "--no-plot", "--ascii")
    words = in_a_line(done.stdout)
    assert words.startswith(
        "tiny, 12 random drives: FAIL Probability that the best-hole yield is at least 99 %: 0 %; PASS needs 95 %"
    )
    for part in (
        "yield as assembled 0.0 %",
        "stated sizes: rayleigh; seed 0",
    ):
        assert part in words
    assert "share of the drives" not in words
    assert done.stdout.isascii()
    assert max(map(len, done.stdout.splitlines())) <= 80


def test_json_has_percentiles_yield_and_what_was_drawn(kept: Path) -> None:
    done = run("tolerance", TINY, "-n", "12", "--torque", "1", "--limit", "55", "--yield", "0.99", "--jobs=1", "--json")
    answer = json.loads(done.stdout)
    assert answer["schema"] == "hdassist.tolerance/2"
    assert (answer["drives"], answer["designs"]) == (12, 1)
    assert answer["verdict"] == "FAIL"
    assert answer["exit_code"] == done.returncode == 3
    (point,) = answer["operating_points"]
    values = [record["F_ior_arcsec"][0] for record in map(json.loads, kept.read_text().splitlines()[1:])]
    low, high = point["as_built"]["p95_interval_arcsec"]
    assert low <= point["as_built"]["p95_arcsec"] <= high
    assert answer["yield"]["as_built"]["good"] == sum(v + point["self_error_arcsec"] <= 55 for v in values)
    best = answer["yield"]["best_position"]
    assert 0 <= best["low"] <= best["median"] <= best["high"] <= 1
    assert best["probability"]["value"] <= 0.05
    assert {s["field"]: s["kind"] for s in answer["scatter"]}["tolerances.e_hb"] == "rayleigh"


@pytest.mark.thorough
def test_torque_without_a_limit_is_accepted_beside_limited_torques() -> None:
    two = ("-n", "30", "--torque", "1", "--torque", "4", "--no-plot")
    done = run("tolerance", TINY, *two, "--limit", "F_ior@4=2050")
    page, bare = in_a_line(done.stdout), run("tolerance", TINY, *two[:2], *two[4:]).stdout
    assert done.returncode == 0, done.stderr
    assert "best hole one hole per drive for all torques, " in page
    assert "one hole per drive" not in bare
    other = run("tolerance", TINY, *two, "--limit", "F_ior@3=2050")
    assert (other.returncode, other.stdout) == (2, "")
    answer = json.loads(run("tolerance", TINY, *two, "--limit", "F_ior@4=2050", "--json").stdout)
    assert [point["limit_arcsec"] for point in answer["operating_points"]] == [None, 2050]
    light = answer["operating_points"][0]
    for way, words in (("as_built", "as assembled"), ("best_position", "best of 12")):
        row = re.search(rf"\b1 {words} (?:holes )?([\d.]+) ([\d.]+) ([\d.]+) - - ", page)  # neither limit nor yield
        shown = [float(text) for text in row.groups()]
        assert shown == pytest.approx(
            [light[way][name] for name in ("p5_arcsec", "p50_arcsec", "p95_arcsec")], abs=0.051
        )


@pytest.mark.thorough
def test_yield_that_depends_on_unknown_inputs_is_a_range() -> None:
    few = ("--torque", "4", "--as-built", "--limit", "2050", "--yield", "0.9", "-n", "100", "--jobs=1", "--no-plot")
    sizes = ("--set", "tolerances.e_hb=60")
    known = run("tolerance", TINY, *few, *sizes)
    assert known.returncode == 0, known.stdout
    soft = ("--set", "source.supports.C_3={kind: assumed, range: [50, 80000], ref: judged}")
    open_ = run("tolerance", TINY, *few, *sizes, *soft)
    words = in_a_line(open_.stdout)
    assert open_.returncode == 6, open_.stdout + open_.stderr
    assert words.startswith("tiny, 100 random drives of 10 sampled designs: INCONCLUSIVE")
    yields = r"yield as assembled [\d.]+ % \([\d.]+ to 100.0\) .* yield: median \(5 to 95 %\) over designs"
    assert re.search(yields, words)
    assert "more drives (-n)" in words and "designs were sampled" not in open_.stderr
    two = run("tolerance", TINY, *few, *sizes, *soft, "-n", "20")
    assert "warning: tiny: only 2 designs were sampled; " in two.stderr
    quiet = run("tolerance", TINY, *FEW, "-n", "3", "--limit", "2050", "-q")
    assert re.fullmatch(r"yield as assembled 100.0 % \([\d.]+ to [\d.]+\)\n", quiet.stdout)


def test_two_processes_write_the_same_bytes_as_one(kept: Path, tmp_path: Path) -> None:
    file = tmp_path / "two.jsonl"
    run("tolerance", TINY, "-n", "12", "--torque", "1", "--jobs", "2", "--results", str(file))
    assert file.read_bytes() == kept.read_bytes()


@pytest.mark.thorough
def test_a_killed_run_goes_on_to_the_same_bytes(kept: Path, tmp_path: Path) -> None:
    file = tmp_path / "killed.jsonl"
    command = ["tolerance", TINY, "-n", "12", "--torque", "1", "--jobs", "1", "--results", str(file)]
    process = subprocess.Popen([*COMMAND, *command], env=CLEAN, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    begun = time.monotonic()
    while not (file.exists() and file.read_bytes().count(b"\n") > 2) and time.monotonic() - begun < 60:
        time.sleep(0.02)
    process.kill()
    process.wait()
    left = file.read_bytes()
    assert kept.read_bytes().startswith(left[: left.rfind(b"\n") + 1])
    done = run(*command)
    assert done.returncode == 0, done.stderr
    assert file.read_bytes() == kept.read_bytes()


def test_more_drives_go_on_where_fewer_ended(kept: Path, tmp_path: Path) -> None:
    file = tmp_path / "more.jsonl"
    for count in ("5", "12"):
        run("tolerance", TINY, "-n", count, "--torque", "1", "--jobs", "1", "--results", str(file))
    assert file.read_bytes() == kept.read_bytes()


def test_more_drives_of_more_designs_go_on_where_fewer_ended(tmp_path: Path) -> None:
    soft = "source.supports.C_3={kind: assumed, range: [500, 8000], ref: judged}"
    for name, counts in (("at-once", ("7",)), ("later", ("4", "7"))):
        for count in counts:
            run("tolerance", TINY, "-n", count, *FEW, "--per-design=3", "--set", soft, "--results", name, cwd=tmp_path)
    records = [json.loads(line) for line in (tmp_path / "later").read_text().splitlines()[1:]]
    assert [record["design"] for record in records] == [0, 0, 0, 1, 1, 1, 2]
    assert len({record["values"]["supports.C_3"] for record in records}) == 3
    assert (tmp_path / "later").read_bytes() == (tmp_path / "at-once").read_bytes()


def test_where_no_drive_has_an_answer_there_is_no_page(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise UntrustedError("not solved", "a hint")

    monkeypatch.setattr("hdassist.features.tolerance.production.Production._solved", refuse)
    done = run("tolerance", TINY, "-n", "2", *FEW, "--limit", "3000")
    assert (done.returncode, done.stdout) == (5, "")
    assert "no random drive has a result: not solved" in done.stderr


def test_another_preset_or_option_leaves_the_file_as_it_is(kept: Path) -> None:
    before = kept.read_bytes()
    for more, named in (
        (("--seed", "1"), "seed"),
        (("--set", "tolerances.e_hb=20"), "overrides"),
        (("--as-built",), "rotations"),
        (("--per-design", "7"), "drives_per_design"),
    ):
        done = run("tolerance", TINY, "-n", "12", "--torque", "1", "--results", str(kept), *more)
        assert done.returncode == 2
        assert named in done.stderr
    assert kept.read_bytes() == before


def test_figures_have_a_row_a_torque_and_way() -> None:
    done = run("tolerance", TINY, "-n", "3", "--jobs", "1", "--csv", "-")
    header, *rows = (line.split(",") for line in done.stdout.splitlines())
    assert [row[1:3] for row in rows] == [
        ["1.0", "as built"],
        ["1.0", "best of 12"],
        ["4.0", "as built"],
        ["4.0", "best of 12"],
    ]
    assert header[-1] == "yield"


def test_parquet_has_the_drives_that_are_kept(kept: Path, tmp_path: Path) -> None:
    file = tmp_path / "drives.parquet"
    drawn = ("-n", "12", "--torque", "1", "--jobs", "1", "--results", str(kept))
    done = run("tolerance", TINY, *drawn, "--parquet", str(file), "-q")
    assert done.returncode == 0, done.stderr
    records = [json.loads(line) for line in kept.read_text().splitlines()[1:]]
    for number, (row, record) in enumerate(zip(parquet.read_table(file).to_pylist(), records, strict=True)):
        assert (row["drive"], row["F_ior_arcsec@1"]) == (number, record["F_ior_arcsec"][0])
        assert row["best_F_ior_arcsec@1"] == record["best_F_ior_arcsec"][0]
        assert {path: row[path] for path in record["values"]} == record["values"]


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("-n", "0"), 2, "-n"),
        (("--distribution", "normal"), 2, "--distribution"),
        (("--sure", "0.1"), 2, "--sure"),
        (("--limit", "80:"), 2, "--limit"),
        (("--limit", "much"), 2, "--limit"),
        (("--limit", "F_ior@7=30"), 2, "tiny is not computed at 7 N·m, but at 1, 4"),
        (("--torque", "1", "--limit", "F_ior@4=30"), 2, "tiny is not computed at 4 N·m, but at 1"),
        (("--yield", "0.9"), 2, "no limit of F'_ior is set at 1 N·m"),
        (("--yield", "1.5", "--limit", "30"), 2, "--yield"),
        (("--known", "phases.xi_q"), 2, "phases.xi_q"),
        (("--set", "tolerances={F_i1: 0, F_i2: 0, e_hb: 0, e_hh: 0, e_hg: 0, e_b: 0}"), 2, "no field varies"),
    ],
)
def test_invalid_arguments_are_refused(arguments: tuple[str, ...], code: int, words: str) -> None:
    done = run("tolerance", TINY, *arguments)
    assert done.returncode == code, done.stderr
    assert words in done.stderr
    assert not done.stdout


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (r'"F_ior_arcsec":\[(\d)', r'"F_ior_arcsec":[0.\1'),
        (r'"F_ior_arcsec":\[', '"F_ior_arcsec":[-'),
        (r'"max_residual":[\d.e-]+', '"max_residual":0.9'),
        (r'"refused":null', '"refused":"x"'),
        (r'"item":0', '"item":0,"more":1'),
        (r'"best_rotation_deg":[\d.]+', '"best_rotation_deg":Infinity'),
    ],
)
def test_a_drive_that_was_changed_is_refused(kept: Path, tmp_path: Path, old: str, new: str) -> None:
    file = tmp_path / "r.jsonl"
    file.write_text(re.sub(old, new, kept.read_text(), count=1))
    done = run("tolerance", TINY, "-n", "12", "--torque", "1", "--jobs", "1", "--results", str(file))
    assert (done.returncode, done.stdout) == (4, "")
    assert f"{file}:2: invalid record: the checksum does not match" in done.stderr
