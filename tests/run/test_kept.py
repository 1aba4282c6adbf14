"""Kept work: whole records stay, the rest is done again, what does not hold is refused, what is not ours is left."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import dataclass, replace

import pytest
from pydantic import TypeAdapter

from hdassist.run.errors import DataError, UsageError
from hdassist.run.kept import ClosedRecord, KeptOwner, Magnitude, RecordKind, open_kept, read_kept
from tests.helpers.process import CLEAN, posix_only


@dataclass(frozen=True)
class Measured(ClosedRecord):
    F_ior_arcsec: Magnitude
    note: str = ""


OWNER = KeptOwner(
    command="sweep", preset="small", inputs={"preset": "ab" * 32, "run.csv": "cd" * 32}, options={"vary": ["a=1,2"]},
    seed=3,
)  # fmt: skip
KIND = RecordKind(TypeAdapter(Measured), lambda item, record: "expected ten records" if item > 9 else "")
ANYTHING = RecordKind(TypeAdapter(dict))  # writes what no command would, with checksums that hold
RECORDS = [Measured(value) for value in (0.1 + 0.2, 1e-300, 28.000000000000004, -0.0, 5e22)]

WRITE_ON = """
import sys
from tests.run.test_kept import ANYTHING, OWNER
from hdassist.run.kept import open_kept
with open_kept(sys.argv[1], OWNER, ANYTHING) as kept:
    for k in range(kept.done, 10**9):
        kept.append([{"value": k / 3, "text": "x" * 1000}])
        print(k, flush=True)
"""


@pytest.fixture
def path(tmp_path):
    return tmp_path / "rows.jsonl"


@pytest.fixture
def written(path):
    with open_kept(str(path), OWNER, KIND) as kept:
        kept.append(RECORDS[:2])
        kept.append(RECORDS[2:])
    return path


def refused(path, error=DataError, **options):
    """What is said of a file that is not taken up, which stays as it is."""
    before, times = path.read_bytes(), path.stat().st_mtime_ns
    with pytest.raises(error) as found, open_kept(str(path), options.pop("owner", OWNER), KIND, **options):
        pass
    assert (path.read_bytes(), path.stat().st_mtime_ns) == (before, times)
    return found.value.message


def test_records_come_back_as_they_were_in_every_digit(written):
    assert list(map(repr, read_kept(written.read_bytes(), "rows.jsonl", KIND))) == list(map(repr, RECORDS))
    first, *lines = map(json.loads, written.read_bytes().splitlines())
    assert {**first, "checksum": ""} == {
        "schema": "hdassist.kept/1", "version": OWNER.version, "command": "sweep", "preset": "small",
        "inputs": OWNER.inputs, "options": OWNER.options, "seed": 3, "checksum": "",
    }  # fmt: skip
    assert [line["item"] for line in lines] == list(range(5))
    assert read_kept(b'{"schema": "hdassist.accept/1"}\n', "a.json", KIND) is None


def test_unnamed_file_keeps_records_and_is_deleted(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with open_kept(None, OWNER, KIND) as kept:
        kept.append(RECORDS)
        assert kept.done == 5
        assert list(kept.records()) == RECORDS
        kept.append(RECORDS)
        assert list(kept.records()) == [*RECORDS, *RECORDS]
    assert not list(tmp_path.iterdir())


def test_a_stop_behind_a_write_knows_what_is_written(tmp_path, monkeypatch):
    with open_kept(str(tmp_path / "rows.jsonl"), OWNER, KIND) as kept:
        counts = []
        monkeypatch.setattr("os.fsync", lambda _: counts.append(kept.done))  # as what a stop says
        kept.append(RECORDS[:2])
        kept.append(RECORDS[2:])
    assert counts == [2, 5]
    assert kept.done == 5


def test_interrupted_run_is_completed_to_the_same_file(written, monkeypatch):
    monkeypatch.setattr("os.fsync", lambda _: None)  # here it would take a hundred times as long as the rest
    whole = written.read_bytes()
    ends = [k + 1 for k, byte in enumerate(whole) if byte == 10]
    for size in {*range(0, len(whole), 7), *ends, *(end - 1 for end in ends)}:
        for lost in (b"", b"\0" * 9):  # zeros stand where power was lost before data came to the disk
            written.write_bytes(whole[:size] + (lost if size > ends[0] else b""))
            with open_kept(str(written), OWNER, KIND) as kept:
                assert kept.done == max(0, whole[:size].count(b"\n") - 1)
                assert list(kept.records()) == RECORDS[: kept.done]
                kept.append(RECORDS[kept.done :])
            assert written.read_bytes() == whole


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"inputs": {"preset": "cd" * 32, "run.csv": "cd" * 32}}, 'inputs.preset: "abababab'),
        ({"inputs": {"preset": "ab" * 32, "run.csv": "ef" * 32}}, 'inputs.run.csv: "cdcdcdcd'),
        ({"inputs": {"preset": "ab" * 32}}, "inputs.run.csv"),
        ({"options": {"vary": ["a=1,3"]}}, 'options.vary: ["a=1,2"] there, ["a=1,3"] here'),
        ({"options": {"vary": ["a=1,2"], "method": "sobol"}}, "options.method: null there"),
        ({"seed": 4}, "seed: 3 there, 4 here"),
        ({"version": "0.0.1"}, "version"),
        ({"command": "tolerance"}, 'command: "sweep" there, "tolerance" here'),
    ],
)
def test_the_work_of_another_run_is_refused_by_what_differs(written, other, words):
    with written.open("ab") as stream:
        stream.write(b'{"item":5,"half')  # cut off only by the run that it belongs to
    said = refused(written, UsageError, owner=replace(OWNER, **other))
    assert words in said
    assert said.count(" here") == 1


def test_records_may_be_put_in_another_order(written):
    with open_kept(str(written), OWNER, KIND) as kept:
        assert list(kept.records()) == RECORDS
        kept.rewrite(RECORDS[3:])
        assert list(kept.records()) == RECORDS[3:]
        kept.append(RECORDS[:1])
    assert [item.name for item in written.parent.iterdir()] == ["rows.jsonl"]
    with open_kept(str(written), OWNER, KIND) as kept:
        assert list(kept.records()) == [*RECORDS[3:], RECORDS[0]]


def test_failed_rewrite_leaves_the_file_unchanged(written):
    def broken():
        yield RECORDS[0]
        raise KeyboardInterrupt

    before = written.read_bytes()
    with open_kept(str(written), OWNER, KIND) as kept:
        with pytest.raises(KeyboardInterrupt):
            kept.rewrite(broken())
        assert list(kept.records()) == RECORDS
    assert written.read_bytes() == before
    assert [item.name for item in written.parent.iterdir()] == ["rows.jsonl"]


@pytest.mark.parametrize(
    "text",
    [
        b"\n", b"x", b'{"schema": "hdassist.accept/1"}\n', b"a,b\n1,2\n", b"\0" * 100, b"[" * 100_000 + b"\n",
        b'{"schema":"hdassist.results/1"}\n', b'{"schema":"hdassist.kept/1","color', b"y" * 3_000_000,
    ],
    ids=lambda text: text[:20],
)  # fmt: skip
def test_foreign_file_is_refused_and_left_unchanged(path, text):
    path.write_bytes(text)
    with pytest.raises((UsageError, DataError), match=r"was not written by hdassist|jsonl:1: invalid"):
        raise_refusal(path)


def raise_refusal(path):
    before = path.read_bytes()
    try:
        with open_kept(str(path), OWNER, KIND):
            pass
    finally:
        assert path.read_bytes() == before


LINES = {
    "a value": lambda lines: [lines[0].replace(b"28.000000000000004", b"14.0")],
    "a digit": lambda lines: [lines[0].replace(b"28.000000000000004", b"28.000000000000005")],
    "a sign": lambda lines: [lines[0].replace(b"28.", b"-28.")],
    "not a number": lambda lines: [lines[0].replace(b"28.000000000000004", b"NaN")],
    "infinite": lambda lines: [lines[0].replace(b"28.000000000000004", b"Infinity")],
    "a string": lambda lines: [lines[0].replace(b"28.000000000000004", b'"28"')],
    "a key less": lambda lines: [lines[0].replace(b',"note":""', b"")],
    "a key more": lambda lines: [lines[0].replace(b',"note"', b',"refused":"no","note"')],
    "a space": lambda lines: [lines[0].replace(b":", b": ", 1)],
    "a NUL": lambda lines: [lines[0].replace(b"2", b"\0", 1)],
    "zeros": lambda lines: [b"\0" * len(lines[0])],
    "nothing": lambda lines: [],
    "twice": lambda lines: lines[:1] * 2,
    "swapped": lambda lines: [lines[1], lines[0]],
    "swapped bodies": lambda lines: [b'{"item":2' + lines[1][9:], b'{"item":3' + lines[0][9:]],
    "empty": lambda lines: [b"\n"],
    "nonsense": lambda lines: [b"nonsense\n"],
    "nested": lambda lines: [b"[" * 100_000 + b"\n"],
    "long": lambda lines: [b"y" * 3_000_000 + b"\n"],
    "no end": lambda lines: [lines[0][:-1]],
}


@pytest.mark.parametrize("change", LINES)
def test_changed_record_is_refused_by_line_without_any_data_loss(written, change):
    lines = written.read_bytes().splitlines(keepends=True)
    changed = LINES[change](lines[3:5])
    taken = 2 if "swapped" in change else 1
    written.write_bytes(b"".join([*lines[:3], *changed, *lines[3 + taken :]]))
    line = 5 if change == "twice" else 4
    assert f"rows.jsonl:{line}: invalid record: " in refused(written)
    with pytest.raises(DataError, match=f"r:{line}: invalid record: "):
        read_kept(written.read_bytes(), "r", KIND)


def test_an_owner_that_was_changed_is_refused(written):
    text = written.read_bytes()
    for old, new in ((b'"seed":3', b'"seed":4'), (b'"seed":3', b'"seed":NaN'), (b"abab", b"cdcd")):
        written.write_bytes(text.replace(old, new, 1))
        assert "rows.jsonl:1: invalid first line" in refused(written)


@pytest.mark.parametrize("end", [b"my notes", b"x", b"\0x", b'{"item":4,'])
def test_foreign_text_after_the_last_record_is_refused(written, end):
    with written.open("ab") as stream:
        stream.write(end)
    assert "rows.jsonl:7: invalid record" in refused(written)


@pytest.mark.parametrize(
    ("record", "why"),
    [
        ({"F_ior_arcsec": -1.0}, "F_ior_arcsec: must be at least 0"),
        ({"F_ior_arcsec": "1.0"}, "F_ior_arcsec: must be a number"),
        ({"F_ior_arcsec": True}, "F_ior_arcsec: must be a number"),
        ({"F_ior_arcsec": 10**400}, "F_ior_arcsec: must be a number"),
        ({"F_ior_arcsec": None}, "F_ior_arcsec: must be a number"),
        ({"note": "x"}, "F_ior_arcsec: missing key"),
        ({"F_ior_arcsec": 1.0, "refused": "x"}, "refused: unknown key"),
        ({"F_ior_arcsec": 1.0, "item": 7}, "expected item 0"),
    ],
)
def test_impossible_record_is_refused_despite_a_valid_checksum(path, record, why):
    with open_kept(str(path), OWNER, ANYTHING) as kept:
        kept.append([record])
    assert refused(path) == f"{path}:2: invalid record: {why}"


def test_a_record_that_does_not_fit_the_work_is_refused(path):
    with open_kept(str(path), OWNER, ANYTHING) as kept:
        kept.append([{"F_ior_arcsec": 1.0}] * 11)
    assert refused(path) == f"{path}:12: invalid record: expected ten records"


def test_force_begins_anew_whatever_is_there(written):
    for text in (written.read_bytes(), b"a,b\n"):
        written.write_bytes(text)
        with open_kept(str(written), OWNER, KIND, force=True) as kept:
            assert kept.done == 0
            kept.append(RECORDS[:1])
        assert read_kept(written.read_bytes(), "", KIND) == RECORDS[:1]


def test_numbers_that_are_none_are_never_written(path):
    with open_kept(str(path), OWNER, KIND) as kept:
        for number in (float("nan"), float("inf")):
            with pytest.raises(ValueError, match="JSON compliant"):
                kept.append([Measured(number)])
        assert kept.done == 0
    assert path.read_bytes().count(b"\n") == 1


@posix_only("open files that can be removed")
def test_file_removed_or_cut_during_the_run_ends_it(written):
    whole = written.read_bytes()

    lost = pytest.raises(DataError, match="was removed, replaced or truncated")

    def replaced():
        written.rename(written.with_name("old.jsonl"))
        written.write_bytes(whole)

    for change in (written.unlink, lambda: os.truncate(written, len(whole) - 9), lambda: written.write_bytes(b"")):
        for action in (lambda kept: None, lambda kept: kept.append(RECORDS), lambda kept: list(kept.records())):
            with lost, open_kept(str(written), OWNER, KIND) as kept:
                change()
                action(kept)
            written.write_bytes(whole)
    with lost, open_kept(str(written), OWNER, KIND):
        replaced()


@pytest.mark.parametrize(
    "name",
    ["", "no/such/folder/rows.jsonl", "folder", pytest.param("pipe", marks=posix_only("named pipes")), "nul\0"],
)
def test_unwritable_target_is_a_data_error(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    if name == "pipe":
        os.mkfifo(tmp_path / name)
    with pytest.raises(DataError), open_kept(name, OWNER, KIND):
        pass


@posix_only("links that any user may make")
def test_file_is_locked_by_one_run_under_any_link_name(tmp_path, path, monkeypatch):
    monkeypatch.setattr("hdassist.run.kept.LOCK_PATIENCE", 0.0)
    (tmp_path / "link").symlink_to(path)
    with open_kept(str(path), OWNER, KIND) as kept:
        kept.rewrite(RECORDS)
        for force in (False, True):
            with (
                pytest.raises(UsageError, match="is being written by another run"),
                open_kept(str(tmp_path / "link"), OWNER, KIND, force=force),
            ):
                pass
    with open_kept(str(tmp_path / "link"), OWNER, KIND) as kept:
        kept.rewrite(kept.records())
        assert kept.done == len(RECORDS)
    assert (tmp_path / "link").is_symlink()


@pytest.mark.thorough
def test_killed_run_loses_no_record_and_locks_out_other_writers(path, monkeypatch):
    monkeypatch.setattr("hdassist.run.kept.LOCK_PATIENCE", 0.0)
    with subprocess.Popen([sys.executable, "-c", WRITE_ON, path], stdout=subprocess.PIPE, env=CLEAN) as process:
        said = [int(process.stdout.readline()) for _ in range(50)]
        with pytest.raises(UsageError, match="is being written"), open_kept(str(path), OWNER, ANYTHING, force=True):
            pass
        process.kill()
        said += [int(line) for line in process.stdout.read().splitlines()]
    assert process.returncode != 0
    with open_kept(str(path), OWNER, ANYTHING) as kept:
        assert kept.done >= said[-1] + 1 >= 50
        assert [record["value"] for record in kept.records()] == [k / 3 for k in range(kept.done)]


@pytest.mark.thorough
@posix_only("limits of processes")
def test_a_full_disk_leaves_whole_records_to_go_on_from(path):
    import resource

    def small_files():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))

    done = subprocess.run(
        [sys.executable, "-B", "-c", WRITE_ON, path],  # -B: no compiled module that is cut off
        capture_output=True, env=CLEAN, text=True, check=False, preexec_fn=small_files,
    )  # fmt: skip
    assert f"DataError: cannot write {path}: File too large" in done.stderr
    assert path.stat().st_size == 10_000
    with open_kept(str(path), OWNER, ANYTHING) as kept:
        assert kept.done == int(done.stdout.splitlines()[-1]) + 1
