"""Sweeps: rows that agree with `check`, whoever computes them, and whoever is killed over them."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet
from pydantic import ValidationError

from hdassist import load_preset
from hdassist.features.design import Sweep, collect, read_axes
from hdassist.interface.terminal import streams
from hdassist.run.errors import DataError
from hdassist.run.files import read_preset
from hdassist.run.kept import KeptOwner, RecordKind, open_kept
from tests.helpers.process import CLEAN, COMMAND, SMALL, ends, in_a_line, run, run_cold

needs_proc = pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
GRID = ("--vary", "tolerances.e_hb=10:80:15", "--vary", "operation.M_g=2,4")


def sweep_of(*vary, overrides=()):
    text, file = read_preset(SMALL)
    drive = load_preset(SMALL, overrides)
    return Sweep.of(text, file, drive, read_axes(vary, overrides)), drive


@pytest.fixture(scope="module")
def few():
    """A small sweep with a row that has no drive: its records, and what came of it."""
    sweep, drive = sweep_of("gears.x_b=1.6,4", "tolerances.e_hb=30,60")
    records = sweep(0, sweep.rows)
    return sweep, records, collect(sweep, drive, records)


def test_sweep_rows_vary_torque_fastest_and_the_first_field_slowest(few):
    sweep, records, _ = few
    rows = [(*record.values.values(), record.M_g_Nm) for record in records]
    assert rows == [(x_b, e_hb, M_g) for x_b in (1.6, 4.0) for e_hb in (30.0, 60.0) for M_g in (1.0, 4.0)]
    assert sweep.shape == (2, 2, 2)


def test_a_row_does_not_depend_on_the_rows_around_it(few):
    sweep, records, _ = few
    assert [record for row in reversed(range(sweep.rows)) for record in sweep(row, row + 1)][::-1] == records


def test_a_row_says_what_check_says(few):
    _, records, _ = few
    answer = json.loads(run("check", SMALL, "--set", "tolerances.e_hb=60", "--torque", "4", "--json").stdout)
    point = answer["operating_points"][0]
    assert records[3].values == {"gears.x_b": 1.6, "tolerances.e_hb": 60.0}
    assert records[3].F_ior_arcsec == pytest.approx(point["F_ior_arcsec"], abs=1e-9)
    assert records[3].max_residual < 1e-9


def test_rolling_balls_are_swept_too():
    ball = ("bearing.ball_motion=rolling", "bearing.d_ball=2.4", "numerics.n_beta=4")
    sweep, _ = sweep_of("tolerances.e_hb=30", overrides=ball)
    assert sweep(1, 2)[0].F_ior_arcsec > 0


def test_a_row_without_a_drive_stays_with_its_reason(few):
    _, records, swept = few
    assert all(record.reason is None for record in records[:4])
    for record in records[4:]:
        assert record.reason.startswith("gears.x_b: ")
        assert record.F_ior_arcsec is None
        assert record.exit_code == 4
    assert swept.failed == 4
    assert swept.states == 4 * 1860


def test_the_ends_are_those_of_the_rows(few):
    _, records, swept = few
    values = [record.F_ior_arcsec for record in records[:4]]
    assert swept.ends["least"] == (int(np.argmin(values)), min(values))
    assert swept.ends["greatest"] == (int(np.argmax(values)), max(values))


def test_sweep_in_a_pipe_prints_csv_and_warns_about_unknowns():
    done = run("sweep", SMALL, "--vary", "harmonics.a_b2=0,3", "--torque", "4", "--set", "gears.x_b=1.8", "--jobs", "1")
    assert done.returncode == 0
    header, *rows = csv.reader(io.StringIO(done.stdout))
    assert header == ["harmonics.a_b2", "M_g_Nm", "F_ior_arcsec", "max_residual", "reason"]
    assert [float(row[0]) for row in rows] == [0, 3]
    assert float(rows[0][2]) != float(rows[1][2])
    assert done.stderr == "warning: small: unknown, and set to 0: harmonics.xi_b2\n"


def test_json_has_rows_and_ends(tmp_path):
    options = ("--vary", "gears.x_b=1.8,4", "--torque", "4", "--jobs", "1", "--json")
    done = run("sweep", SMALL, *options, "-o", "rows.jsonl", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "wrote rows.jsonl\n")
    told = json.loads(done.stdout, parse_constant=pytest.fail)
    kept = [json.loads(line) for line in (tmp_path / "rows.jsonl").read_text().splitlines()]
    assert told["schema"] == "hdassist.sweep/1"
    assert told["vary"] == [{"field": "gears.x_b", "unit": "", "values": [1.8, 4.0]}]
    assert [{"item": k, **row} for k, row in enumerate(told["rows"])] == [
        {key: value for key, value in row.items() if key != "checksum"} for row in kept[1:]
    ]
    assert told["least"] == told["greatest"] == {"row": 0, "F_ior_arcsec": kept[1]["F_ior_arcsec"]}
    assert told["rows_without_answer"] == 1
    assert kept[0]["options"] == {"vary": ["gears.x_b=1.8,4"], "set": ["operation.M_g=[4.0]"]}


def test_rows_of_two_fields(tmp_path):
    fields = ("--vary", "tolerances.e_hb=30,60", "--vary", "gears.x_b=1.6,4", "--torque", "4", "--jobs", "1")
    done = run("sweep", SMALL, *fields, "--csv", "rows.csv", cwd=tmp_path)
    assert done.returncode == 0
    in_csv = list(csv.DictReader(io.StringIO((tmp_path / "rows.csv").read_text())))
    assert [bool(row["F_ior_arcsec"]) for row in in_csv] == [True, False] * 2  # there are no such drives
    words = in_a_line(done.stdout)
    assert words.startswith(
        "small (nominal), F'_ior over tolerances.e_hb (30 to 60 µm) and gears.x_b (1.6 to 4), 4 rows: 22.10 to "
    )
    assert "no result 2 of 4 rows; the first: gears.x_b:" in words
    assert f"next hdassist check {SMALL} --torque=4 --set tolerances.e_hb=30 --set gears.x_b=1.6 " in words
    assert [row["gears.x_b"] for row in in_csv] == ["1.6", "4.0"] * 2


def test_parquet_table_equals_csv_and_is_written_from_kept_rows(tmp_path):
    command = (
        "sweep",
        SMALL,
        "--vary",
        "gears.x_b=1.6,1.8,4",
        "--torque",
        "4",
        "--jobs",
        "1",
        "-o",
        "rows.jsonl",
        "-q",
    )
    asked = run(*command, "--csv", "rows.csv", "--parquet", "rows.parquet", cwd=tmp_path)
    assert asked.returncode == 0, asked.stderr
    table = parquet.read_table(tmp_path / "rows.parquet")
    whole, in_csv = table.to_pylist(), list(csv.DictReader(io.StringIO((tmp_path / "rows.csv").read_text())))
    assert [{key: "" if cell is None else str(cell) for key, cell in row.items()} for row in whole] == in_csv
    assert [field.type for field in table.schema] == ["double"] * 4 + ["string"]
    owner, *kept = (json.loads(line) for line in (tmp_path / "rows.jsonl").read_text().splitlines())
    assert json.loads(table.schema.metadata[b"hdassist"]).items() <= owner.items()
    (tmp_path / "rows.jsonl").write_bytes(b"".join((tmp_path / "rows.jsonl").read_bytes().splitlines(True)[:3]))
    again = run(*command, "--parquet", "again.parquet", cwd=tmp_path)
    assert (again.returncode, again.stderr) == (0, "wrote again.parquet\nwrote rows.jsonl\n")
    assert (tmp_path / "again.parquet").read_bytes() == (tmp_path / "rows.parquet").read_bytes()
    assert len(kept) == len(whole)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("-o", "rows.parquet"), "results are written as JSON Lines, not to rows.parquet"),
        (("--parquet", "-"), "--parquet needs the name of a file, not a stream"),
        (("--parquet", os.devnull), "--parquet needs the name of a file, not a stream"),
        (("--parquet", "there.parquet"), "there.parquet already exists"),
        (("-o", "a", "--parquet", "a"), "two results would be written to a"),
    ],
)
def test_sweep_refuses_an_unwritable_table_before_it_computes(tmp_path, more, words):
    (tmp_path / "there.parquet").write_text("")
    done = run("sweep", SMALL, *GRID, *more, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr


def test_parquet_without_pyarrow_is_refused_with_the_install_command(monkeypatch):
    monkeypatch.setattr(streams, "find_spec", lambda _: None)
    done = run("sweep", SMALL, *GRID, "--parquet", "rows.parquet")
    assert done.returncode == 2
    assert "--parquet needs a package that is not installed: pyarrow" in done.stderr
    assert "pip install 'hdassist[parquet]'" in done.stderr


def test_sweep_without_results_exits_with_the_code_of_its_rows():
    done = run("sweep", SMALL, "--vary", "gears.x_b=4,5", "--torque", "4", "--jobs", "1", "-q")
    assert (done.returncode, done.stdout) == (4, "no result\n")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The file of a sweep by one process that nobody disturbed."""
    file = tmp_path_factory.mktemp("whole") / "rows.jsonl"
    done = run_cold("sweep", SMALL, *GRID, "--jobs", "1", "-o", str(file), "-q")
    assert done.returncode == 0, done.stderr
    return file.read_bytes()


def rows_of(file: Path) -> int:
    return file.read_bytes().count(b"\n") - 1 if file.exists() else 0


@contextmanager
def begun(file: Path) -> Iterator[subprocess.Popen[str]]:
    """A sweep by two processes that has added some rows to a file, and not all."""
    before = max(0, rows_of(file))
    with subprocess.Popen(
        [*COMMAND, "sweep", SMALL, *GRID, "--jobs", "2", "-o", str(file), "-q"], env=CLEAN,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    ) as process:  # fmt: skip
        try:
            until = time.monotonic() + 60
            while rows_of(file) <= before:
                assert time.monotonic() < until
                assert process.poll() is None
                time.sleep(0.002)
            assert rows_of(file) < 30
            yield process
        finally:
            process.kill()


def a_worker_of(process: subprocess.Popen[str]) -> int:
    """The youngest process that it, or a thread of it, has begun."""
    told = [task.read_text().split() for task in Path(f"/proc/{process.pid}/task").glob("*/children")]
    return max(int(pid) for children in told for pid in children)


@pytest.mark.thorough
@needs_proc
def test_sweep_resumes_its_file_after_a_worker_process_was_killed(tmp_path, whole):
    file = tmp_path / "rows.jsonl"
    with begun(file) as process:
        os.kill(a_worker_of(process), signal.SIGKILL)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 5
    assert "worker process was killed" in err
    done = run_cold("sweep", SMALL, *GRID, "--jobs", "2", "-o", str(file), "-q")
    assert (done.returncode, done.stderr) == (0, f"wrote {file}\n")
    assert re.fullmatch(r"\d+\.\d\d to \d+\.\d\d arcsec\n", done.stdout)
    assert file.read_bytes() == whole


@pytest.mark.slow
@needs_proc
def test_killed_sweep_resumes_its_file_and_refuses_other_inputs(tmp_path, whole):
    file = tmp_path / "rows.jsonl"
    with begun(file) as process:
        process.kill()
    kept = file.read_bytes()
    assert whole.startswith(kept[: kept.rindex(b"\n") + 1])
    other = run("sweep", SMALL, *GRID, "--set", "cam.W_0=0.57", "-o", str(file))
    assert other.returncode == 2
    assert "options.set" in other.stderr
    assert file.read_bytes() == kept
    done = run_cold("sweep", SMALL, *GRID, "-o", str(file), "-q")
    assert done.returncode == 0, done.stderr
    assert file.read_bytes() == whole


@pytest.mark.thorough
@needs_proc
def test_an_interrupt_says_what_is_kept_and_leaves_no_worker(tmp_path):
    file = tmp_path / "rows.jsonl"
    with begun(file) as process:
        worker = a_worker_of(process)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        out, err = process.communicate(timeout=30)
    assert (process.returncode, out) == (130, "")
    kept = rf"interrupted: (\d+) of 30 rows are stored in {re.escape(str(file))}; repeat the command to resume\n"
    said = re.fullmatch(kept, err)
    assert said
    assert int(said[1]) <= rows_of(file)
    assert ends(worker)


@pytest.mark.thorough
@needs_proc
@pytest.mark.parametrize("change", [Path.unlink, lambda file: os.truncate(file, 50)])
def test_sweep_fails_if_its_file_is_removed_or_cut_meanwhile(tmp_path, change):
    file = tmp_path / "rows.jsonl"
    with begun(file) as process:
        change(file)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (4, "")
    assert f"{file} was removed, replaced or truncated during this run" in err
    assert "wrote" not in err


EDITS = {
    "half": lambda text: text.replace('"F_ior_arcsec":', '"F_ior_arcsec":0.5', 1),
    "no number": lambda text: re.sub(r'"F_ior_arcsec":[\d.]+', '"F_ior_arcsec":NaN', text),
    "a proof of nothing": lambda text: re.sub(r'"max_residual":[\d.e-]+', '"max_residual":0.9', text, count=1),
    "bodies swapped": lambda text: re.sub(
        r'(\{"item":1,)(.*)\n(\{"item":2,)(.*)\n', lambda m: f"{m[1]}{m[4]}\n{m[3]}{m[2]}\n", text
    ),
    "a NUL": lambda text: text.replace('"item":1', '"it\0em":1'),
}


@pytest.mark.thorough
@pytest.mark.parametrize("edit", EDITS)
def test_a_row_that_was_changed_is_refused(tmp_path, whole, edit):
    (tmp_path / "rows.jsonl").write_text(changed := EDITS[edit](whole.decode()))
    done = run("sweep", SMALL, *GRID, "--jobs", "1", "-o", "rows.jsonl", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (4, "")
    assert re.search(r"rows\.jsonl:[23]: invalid record", done.stderr)
    assert (tmp_path / "rows.jsonl").read_text() == changed


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda rows: [*rows, rows[-1]], ":10: invalid record: expected 8 rows"),
        (lambda rows: [*rows[:-1], rows[0]], ":9: invalid record: expected the values of row 8"),
        (lambda rows: [*rows[:-1], replace(rows[-1], M_g_Nm=2.0)], ":9: invalid record: expected the values of row 8"),
    ],
)
def test_row_outside_the_grid_is_refused_despite_a_valid_checksum(tmp_path, few, change, words):
    sweep, records, _ = few
    path, owner = str(tmp_path / "rows.jsonl"), KeptOwner(command="sweep", inputs={})
    with open_kept(path, owner, RecordKind(sweep.kind.adapter)) as kept:
        kept.append(change(records))
    with pytest.raises(DataError, match=words), open_kept(path, owner, sweep.kind):
        pass


def test_sweep_row_with_an_inconsistent_exit_code_is_refused(few):
    sweep, records, _ = few
    failed = next(each for each in records if each.reason)
    for change in ({"exit_code": 7}, {"exit_code": 0}, {"reason": None, "exit_code": 0}):
        with pytest.raises(ValidationError, match="exit code"):
            sweep.kind.adapter.validate_python(asdict(failed) | change)


def test_a_residual_beyond_its_tolerance_is_no_proof(few):
    sweep, records, _ = few
    fields = asdict(records[0])
    assert sweep.kind.adapter.validate_python(fields) == records[0]
    for change in ({"max_residual": 0.9}, {"max_residual": -1.0}, {"F_ior_arcsec": -1.0}, {"F_ior_arcsec": "2"}):
        with pytest.raises(ValueError, match="Input should be"):
            sweep.kind.adapter.validate_python({**fields, **change})


def test_a_sweep_says_that_it_takes_unknown_inputs_as_zero(tmp_path):
    vary = ("--vary", "operation.M_g=1:4:2", "--no-plot")
    pages = []
    for number, value in enumerate(("0", "unknown")):
        rows = str(tmp_path / f"{number}.jsonl")  # a page stands on the terminal if the rows go to a file
        pages.append(in_a_line(run("sweep", SMALL, *vary, "--set", f"tolerances.e_hh={value}", "-o", rows).stdout))
    told = json.loads(run("sweep", SMALL, *vary, "--set", "tolerances.e_hh=unknown", "--json").stdout)
    assert [("set to 0" in page) for page in pages] == [False, True]
    assert told["statistic"] == "nominal"
    assert "tolerances.e_hh" in [field["field"] for field in told["unknown"]]
