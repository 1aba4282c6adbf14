"""The file of results: whole records stay, the rest is done again, and what is not ours is left as it is."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
from dataclasses import replace

import pytest

from hdassist.errors import DataError, UsageError
from hdassist.tolerance.results import Header, open_results, read_results
from tests.process import CLEAN

HEADER = Header(
    command="sweep", preset="small", preset_sha256="ab" * 32, options={"vary": ["a=1,2"], "torques": [1.0, 4.0]}, seed=3
)
RECORDS = [{"F_ior_arcsec": value} for value in (0.1 + 0.2, 1e-300, 28.000000000000004, -0.0, 5e22)]

WRITE_ON = """
import sys
from tests.tolerance.test_results import HEADER
from hdassist.tolerance.results import open_results
with open_results(sys.argv[1], HEADER) as results:
    for k in range(results.done, 10**9):
        results.append([{"value": k / 3, "text": "x" * 1000}])
        print(k, flush=True)
"""


@pytest.fixture
def path(tmp_path):
    return tmp_path / "rows.jsonl"


@pytest.fixture
def written(path):
    with open_results(str(path), HEADER) as results:
        results.append(RECORDS[:2])
        results.append(RECORDS[2:])
    return path


def test_records_come_back_as_they_were_in_every_digit(written):
    with read_results(str(written)) as (header, records):
        assert header == HEADER
        assert [repr(record) for record in records] == [repr(record) for record in RECORDS]
    lines = [json.loads(line) for line in written.read_bytes().splitlines()]
    assert lines[0]["schema"] == "hdassist.results/1"
    assert [line["item"] for line in lines[1:]] == list(range(5))


def test_a_file_without_a_name_has_the_same_and_is_gone(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with open_results(None, HEADER) as results:
        results.append(RECORDS)
        assert results.done == 5
        assert list(results.records()) == RECORDS
        results.append(RECORDS)
        assert list(results.records()) == [*RECORDS, *RECORDS]
    assert not list(tmp_path.iterdir())


def test_wherever_a_run_was_broken_off_the_next_one_makes_the_same_file(written, monkeypatch):
    monkeypatch.setattr("os.fsync", lambda _: None)  # here it would take a hundred times as long as the rest
    whole = written.read_bytes()
    ends = [k + 1 for k, byte in enumerate(whole) if byte == 10]
    for size in {*range(0, len(whole), 7), *ends, *(end - 1 for end in ends)}:
        written.write_bytes(whole[:size])
        with open_results(str(written), HEADER) as results:
            assert results.done == max(0, whole[:size].count(b"\n") - 1)
            assert list(results.records()) == RECORDS[: results.done]
            results.append(RECORDS[results.done :])
        assert written.read_bytes() == whole


def test_zeros_that_a_loss_of_power_leaves_are_cut_off_with_what_is_behind_them(written):
    whole = written.read_bytes()
    lines = whole.splitlines(keepends=True)
    written.write_bytes(b"".join(lines[:3]) + b"\0" * len(lines[3]) + b"".join(lines[4:]))
    with open_results(str(written), HEADER) as results:
        assert results.done == 2
        results.append(RECORDS[2:])
    assert written.read_bytes() == whole


@pytest.mark.parametrize(
    ("other", "told"),
    [
        ({"preset_sha256": "cd" * 32}, "preset_sha256"),
        ({"options": {"vary": ["a=1,3"], "torques": [1.0, 4.0]}}, 'options.vary: ["a=1,2"] there, ["a=1,3"] here'),
        ({"options": {"vary": ["a=1,2"], "torques": [1.0, 4.0], "method": "sobol"}}, "options.method: null there"),
        ({"seed": 4}, "seed: 3 there, 4 here"),
        ({"version": "0.0.1"}, "version"),
        ({"command": "tolerance"}, 'command: "sweep" there, "tolerance" here'),
    ],
)
def test_results_of_another_run_are_refused_by_what_differs(written, other, told):
    with written.open("ab") as stream:
        stream.write(b'{"item":5,"half')  # cut off only by the run that it belongs to
    before = written.read_bytes()
    with pytest.raises(UsageError) as refused, open_results(str(written), replace(HEADER, **other)):
        pass
    assert told in refused.value.message
    assert refused.value.message.count(" here") == 1
    assert written.read_bytes() == before


@pytest.mark.parametrize(
    "text",
    [
        b"\n", b"x", b'{"schema": "hdassist.accept/1"}\n', b"a,b\n1,2\n", b"\0" * 100, b"[" * 100_000 + b"\n",
        b'{"schema": "hdassist.results/1"}\n', b'{"schema":"hdassist.results/1","color', b"y" * 3_000_000,
    ],
    ids=lambda text: text[:20],
)  # fmt: skip
def test_a_file_that_is_none_of_ours_is_left_as_it_is(path, text):
    path.write_bytes(text)
    times = path.stat().st_mtime_ns
    with pytest.raises(UsageError, match=r"holds (no )?results"), open_results(str(path), HEADER):
        pass
    assert path.read_bytes() == text
    assert path.stat().st_mtime_ns == times


@pytest.mark.parametrize("line", [b"{}\n", b"nonsense\n", b'{"item":3,"F_ior_arcsec":1}\n', b"y" * 3_000_000 + b"\n"])
def test_a_record_that_was_changed_is_refused_with_its_line_and_nothing_below_it_is_lost(written, line):
    lines = written.read_bytes().splitlines(keepends=True)
    changed = b"".join([*lines[:3], line, *lines[4:]])
    written.write_bytes(changed)
    with pytest.raises(DataError, match="line 4 is not the record of item 2"), open_results(str(written), HEADER):
        pass
    assert written.read_bytes() == changed
    with pytest.raises(DataError, match="line 4"), read_results(str(written)) as (_, records):
        list(records)


def test_force_begins_anew_whatever_is_there(written):
    for text in (written.read_bytes(), b"a,b\n"):
        written.write_bytes(text)
        with open_results(str(written), HEADER, force=True) as results:
            assert results.done == 0
            results.append(RECORDS[:1])
        with read_results(str(written)) as (_, records):
            assert list(records) == RECORDS[:1]


def test_numbers_that_are_none_are_never_written(path):
    with open_results(str(path), HEADER) as results:
        for number in (float("nan"), float("inf")):
            with pytest.raises(ValueError, match="JSON compliant"):
                results.append([{"F_ior_arcsec": number}])
        assert results.done == 0
    assert path.read_bytes().count(b"\n") == 1


@pytest.mark.parametrize("name", ["", "no/such/folder/rows.jsonl", "folder", "pipe", "nul\0"])
def test_what_no_file_can_be_written_to_is_a_data_error(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DataError), open_results(name, HEADER):
        pass


def test_a_killed_run_loses_no_record_and_nobody_else_writes_meanwhile(path, monkeypatch):
    monkeypatch.setattr("hdassist.tolerance.results.PATIENCE", 0.0)
    with subprocess.Popen([sys.executable, "-c", WRITE_ON, path], stdout=subprocess.PIPE, env=CLEAN) as process:
        said = [int(process.stdout.readline()) for _ in range(50)]
        for force in (False, True):
            with (
                pytest.raises(UsageError, match="is being written by another run"),
                open_results(str(path), HEADER, force=force),
            ):
                pass
        process.kill()
        said += [int(line) for line in process.stdout.read().splitlines()]
    assert process.returncode == -signal.SIGKILL
    with open_results(str(path), HEADER) as results:
        assert results.done >= said[-1] + 1 >= 50
        for k, record in enumerate(results.records()):
            assert record["value"] == k / 3
        assert k + 1 == results.done


def test_a_full_disk_leaves_whole_records_to_go_on_from(path):
    def small_files():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))

    done = subprocess.run(
        [sys.executable, "-c", WRITE_ON, path], capture_output=True, env=CLEAN, text=True, check=False,
        preexec_fn=small_files,
    )  # fmt: skip
    assert f"DataError: cannot write {path}: File too large" in done.stderr
    assert path.stat().st_size == 10_000
    with open_results(str(path), HEADER) as results:
        assert results.done == int(done.stdout.splitlines()[-1]) + 1
