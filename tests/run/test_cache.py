"""The cache: a folder for this user alone, in which no file but its own is followed, read, replaced or removed."""

from __future__ import annotations

import json
import os
import platform
import stat
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import pytest

from hdassist.run import kept
from tests.helpers.process import TINY, keep_answers, posix_only, run

KEYS = [sha256(bytes([k])).hexdigest() for k in range(5)]
WARNED = "another user can write to"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that is named for the cache, in which answers are kept, for this process and for commands."""
    keep_answers(tmp_path / "named", monkeypatch)
    return tmp_path / "named"


@pytest.fixture
def own(folder: Path) -> Path:
    """The cache's own folder in it, with three answers."""
    for k, key in enumerate(KEYS[:3]):
        kept.keep("samples", key, b"%d" % k)
    return folder / kept.OWN_FOLDER


@posix_only("permissions of files")
def test_an_answer_is_kept_for_this_user_alone(own: Path) -> None:
    assert [kept.cached("samples", key) for key in KEYS[:4]] == [b"0", b"1", b"2", None]
    assert kept.cached("others", KEYS[0]) is None
    assert {stat.S_IMODE(path.stat().st_mode) for path in (own.parent, own)} == {0o700}
    assert {stat.S_IMODE(path.stat().st_mode) for path in own.iterdir()} == {0o600}
    assert len(list(own.iterdir())) == 3  # nothing half written


@posix_only("Python before 3.12, and Wine, ask a process for the version of Windows")
def test_the_operating_system_is_named_without_a_process() -> None:
    code = """
import subprocess
from hdassist.run.kept import operating_system
del subprocess.Popen
print(operating_system())
"""
    named = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert named.startswith(f"{platform.system()} {platform.release()}")


@posix_only("links that any user may make")
@pytest.mark.parametrize("is_hard", [False, True])
def test_no_link_is_followed(own: Path, tmp_path: Path, is_hard: bool) -> None:
    mine = tmp_path / "p.txt"
    mine.write_text("mine")
    name = f"compiled-{KEYS[0][:16]}"
    for place in (own / name, own.parent / name):
        (place.hardlink_to if is_hard else place.symlink_to)(mine)
    assert kept.cached("compiled", KEYS[0]) is None
    kept.keep("compiled", KEYS[0], b"x")
    assert kept.cached("compiled", KEYS[0]) == b"x"
    assert mine.read_text() == "mine"
    assert (own.parent / name).samefile(mine)


@posix_only("links that any user may make")
def test_an_answer_is_not_read_through_a_link(own: Path, tmp_path: Path) -> None:
    path = own / f"samples-{KEYS[0][:16]}"
    (own / f"samples-{KEYS[3][:16]}").symlink_to(path.rename(tmp_path / "elsewhere"))
    path.symlink_to(tmp_path / "elsewhere")
    assert kept.cached("samples", KEYS[0]) is None


@posix_only("links that any user may make")
def test_an_own_folder_that_is_a_link_is_not_used(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    folder.mkdir(mode=0o700)
    (folder / kept.OWN_FOLDER).symlink_to(tmp_path / "elsewhere")
    kept.keep("samples", KEYS[0], b"x")
    assert kept.cached("samples", KEYS[0]) is None
    assert not list((tmp_path / "elsewhere").iterdir())


def test_the_oldest_go_and_no_file_of_others(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept, "MOST", 1000)
    foreign = [*(own.parent / f"mine-{k}" for k in range(5)), own / "notes.txt", own / "samples-2026"]
    folders = [own / f"samples-{key[:16]}" for key in KEYS[3:4]]
    for path in foreign:
        path.write_bytes(b"y" * 400)
        os.utime(path, (0, 0))
    folders[0].mkdir()
    for k, key in enumerate(KEYS[:3]):
        kept.keep("samples", key, b"x" * 200)
        os.utime(own / f"samples-{key[:16]}", (k, k))
    assert kept.cached("samples", KEYS[0]) == b"x" * 200  # used now: no longer the oldest
    kept.keep("samples", KEYS[4], b"x" * 200)
    assert [kept.cached("samples", KEYS[k]) is None for k in (0, 1, 2, 4)] == [False, True, True, False]
    assert all(path.exists() for path in [*foreign, *folders])


@pytest.mark.thorough
def test_doctor_shows_and_empties_the_answers_alone(own: Path) -> None:
    foreign = [own.parent / "thesis.tex", own / "notes.txt"]
    for path in foreign:
        path.write_bytes(b"y" * 1_000_000)

    def shown(*options: str) -> str:
        found = json.loads(run("doctor", "--json", *options).stdout)["findings"]
        return next(each["found"] for each in found if each["what"] == "cache")

    assert shown().startswith(f"{own}, 3 files, 0.0 MB;")
    assert shown("--empty-cache").startswith(f"{own}, 0 files, 0.0 MB;")
    assert {path for path in own.iterdir() if not path.name.startswith(("compiled-", "doctor-"))} == {foreign[1]}
    assert all(path.exists() for path in foreign)


def shared(path: Path) -> None:
    path.chmod(0o777)


def grouped(path: Path) -> None:
    path.chmod(0o770)


@posix_only("permissions of files")
@pytest.mark.parametrize("opened", [shared, grouped])
@pytest.mark.parametrize("which", ["named", "named/answers"])
def test_cache_folder_writable_by_others_is_ignored_with_one_warning(own: Path, which, opened) -> None:
    opened(own.parents[1] / which)
    before = sorted(own.iterdir())
    kept.keep("samples", KEYS[3], b"x")
    assert [kept.cached("samples", key) for key in KEYS] == [None] * 5
    done = run("check", TINY, "--torque", "4")
    assert done.stderr.count(WARNED) == 1
    assert f"{own.parents[1] / which}: " in done.stderr
    assert sorted(own.iterdir()) == before


@posix_only("permissions of files")
def test_a_file_that_others_could_have_written_is_not_read(own: Path) -> None:
    shared(own / f"samples-{KEYS[0][:16]}")
    assert [kept.cached("samples", key) for key in KEYS[:2]] == [None, b"1"]


@posix_only("owners of files")
def test_what_another_user_owns_is_not_used(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder is of another user than this process: the same to it as this process of another user."""
    user = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: user + 1)
    assert kept.cached("samples", KEYS[0]) is None
    assert WARNED in kept.why_unsafe()
    before = sorted(own.iterdir())
    kept.keep("samples", KEYS[3], b"x")
    assert sorted(own.iterdir()) == before


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs files of two users")
@pytest.mark.parametrize("of", ["named", "named/answers", "the file"])
def test_a_forged_answer_of_another_user_is_not_read(own: Path, of: str) -> None:
    os.chown(next(own.iterdir()) if of == "the file" else own.parents[1] / of, 12345, 12345)
    found = [kept.cached("samples", key) for key in KEYS[:3]]
    assert found.count(None) == (1 if of == "the file" else 3)


def test_a_sound_or_missing_folder_is_not_spoken_of(folder: Path) -> None:
    assert kept.why_unsafe() == ""
    assert run("check", TINY, "--torque", "4").stderr == ""
    assert kept.why_unsafe() == ""
