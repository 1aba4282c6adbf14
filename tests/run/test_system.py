"""All that differs by operating system stands in one module, and does for Windows what can be tried here."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import TypeAdapter

from hdassist.drive.solve import build
from hdassist.interface.terminal.streams import require_writable, write_text
from hdassist.run import kept, system
from hdassist.run.errors import DataError, UsageError
from hdassist.run.files import in_place_of, read_bytes
from hdassist.run.kept import KeptOwner, RecordKind, open_kept, read_kept
from hdassist.run.system import SPAWN, why_not_a_windows_file, windows_command_line
from tests.helpers.process import CLEAN, TINY

PACKAGE = Path(kept.__file__).parents[1]
ASKS = re.compile(
    r"os\.name\b|sys\.platform|platform\.system\(|\bfcntl\b|\bmsvcrt\b|^\s*import resource|\bdir_fd\b|\bgeteuid\b|/proc"
    r"|\bwindll\b|\bselect\.poll\b|\bprctl\b|\bpthread_sigmask\b|\bsched_getaffinity\b|\bshlex\b",
    re.MULTILINE,
)
OWNER = KeptOwner(command="sweep", inputs={})
KIND = RecordKind(TypeAdapter(dict[str, float]))


def test_no_other_module_asks_which_system_it_runs_on() -> None:
    asking = {path.name for path in PACKAGE.rglob("*.py") if ASKS.search(path.read_text(encoding="utf-8"))}
    named = {"kept.py"}  # it names the system that an answer was computed on
    assert asking - named == {"system.py"}
    assert "sys.platform" not in (PACKAGE / "run/kept.py").read_text(encoding="utf-8")


@pytest.fixture
def beside(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lock files by others beside them, as on Windows."""
    monkeypatch.setattr(system, "locks_beside", lambda: True)


def records_of(path: Path) -> list[dict[str, float]] | None:
    return read_kept(path.read_bytes(), path.name, KIND)


@pytest.mark.usefixtures("beside")
def test_lock_beside_a_file_holds_also_while_it_is_rewritten(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"

    def require_held() -> None:
        with (
            pytest.raises(UsageError, match="is being written by another run"),
            open_kept(str(path), OWNER, KIND, patience=0.0),
        ):
            pass

    with open_kept(str(path), OWNER, KIND) as work:
        work.append([{"value": 1.0}, {"value": 2.0}])
        require_held()
        work.rewrite([{"value": 2.0}, {"value": 1.0}])
        require_held()
        work.append([{"value": 3.0}])
        assert [record["value"] for record in work.records()] == [2.0, 1.0, 3.0]
    assert records_of(path) == [{"value": 2.0}, {"value": 1.0}, {"value": 3.0}]
    assert [item.name for item in tmp_path.iterdir()] == ["rows.jsonl"]  # the lock has gone
    with open_kept(str(path), OWNER, KIND) as work:
        assert work.done == 3


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
@pytest.mark.usefixtures("beside")
def test_no_file_is_open_when_another_one_gets_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows replaces no open file."""
    path, real, opened = tmp_path / "rows.jsonl", Path.replace, []

    def replace(new: Path, target: Path) -> Path:
        opened.extend(Path(os.path.realpath(link)) for link in Path("/proc/self/fd").iterdir())
        return real(new, target)

    monkeypatch.setattr(Path, "replace", replace)
    with open_kept(str(path), OWNER, KIND) as work:
        work.rewrite([{"value": 1.0}])
    here = {path.name for path in opened if path.parent == tmp_path}
    assert here == {".rows.jsonl.lock"}


@pytest.mark.usefixtures("beside")
def test_file_that_cannot_be_replaced_stays_and_accepts_further_records(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "rows.jsonl"

    def refuse(*_: object) -> None:
        raise PermissionError(13, "The process cannot access the file")

    with open_kept(str(path), OWNER, KIND) as work:
        work.append([{"value": 1.0}])
        with monkeypatch.context() as patched:
            patched.setattr(Path, "replace", refuse)
            with pytest.raises(DataError, match="cannot write"):
                work.rewrite([{"value": 2.0}])
        work.append([{"value": 3.0}])
    assert records_of(path) == [{"value": 1.0}, {"value": 3.0}]
    assert [item.name for item in tmp_path.iterdir()] == ["rows.jsonl"]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["check", "my-drive.yaml", "--torque=-5.5"], "check my-drive.yaml --torque=-5.5"),
        (["--set", "cam.W_0=0.5 mm"], '--set "cam.W_0=0.5 mm"'),
        (["--set", "operation.M_g=[10,20]"], '--set "operation.M_g=[10,20]"'),
        (["--set", "source.gears.j_n={kind: assumed}"], '--set "source.gears.j_n={kind: assumed}"'),
        (["C:\\my drives\\own.yaml", ""], '"C:\\my drives\\own.yaml" ""'),
        (["drives&co\\"], '"drives&co\\\\"'),
        (["it's"], '"it\'s"'),
        (["20±1"], '"20±1"'),
    ],
)
def test_a_command_is_quoted_for_both_shells_of_windows(words: list[str], line: str) -> None:
    assert windows_command_line(words) == line


@pytest.mark.parametrize(
    "name",
    ["CON", "con.yaml", "folder/AUX.csv", "LPT1", "COM¹.txt", "ab:c", "C:\\x\\a:b", "a?.csv", "x.", "x ", "nul .json"],
)
def test_a_name_that_is_no_file_of_windows_is_known(name: str) -> None:
    assert why_not_a_windows_file(name)


@pytest.mark.parametrize("name", ["rows.jsonl", "C:\\x\\rows.jsonl", "..\\a b.csv", "console.yaml", "Привод.yaml", "."])
def test_a_name_of_windows_is_taken(name: str) -> None:
    assert why_not_a_windows_file(name) == ""


def test_a_name_that_the_system_takes_for_none_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdassist.interface.terminal.streams.why_not_a_file", why_not_a_windows_file)
    with pytest.raises(DataError, match="a stream of another file"):
        require_writable(str(tmp_path / "h0:4.json"), force=True)
    assert not list(tmp_path.iterdir())


def test_folder_that_the_system_refuses_to_open_is_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own.yaml").touch()

    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(DataError, match="is a directory"):
        read_bytes(tmp_path, 10)
    with pytest.raises(DataError, match="Permission denied"):
        read_bytes(tmp_path / "own.yaml", 10)


def test_a_folder_outside_of_the_profile_is_not_private(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "home", staticmethod(lambda: tmp_path / "me"))
    with pytest.raises(system.UnsafeFolderError):
        system._folder_of_profile(tmp_path / "shared/answers", makes=True)
    (tmp_path / "me/cache").mkdir(parents=True)
    with pytest.raises(FileNotFoundError):
        system._folder_of_profile(tmp_path / "me/cache/answers", makes=False)
    folder = system._folder_of_profile(tmp_path / "me/cache/answers", makes=True)
    folder.write("a", b"first")
    folder.write("b", b"second")
    folder.replace("b", "a")
    folder.note_use("a")
    assert (folder.names(), folder.read("a", 100), folder.read("a", 3)) == (["a"], b"second", None)
    assert folder.own_status("a") and not folder.own_status("b")
    folder.remove("a")
    assert folder.names() == []


@pytest.mark.thorough
def test_result_is_identical_if_processes_are_spawned() -> None:
    command = [sys.executable, "-m", "hdassist", "check", TINY, "--torque", "4", "--json"]
    here, spawned = (
        subprocess.run(command, env=CLEAN | more, capture_output=True, check=True).stdout for more in ({}, {SPAWN: "1"})
    )
    assert here == spawned


@pytest.mark.parametrize(
    ("platform", "suffix"),
    [("win_amd64", ".dll"), ("win_arm64", ".dll"), ("manylinux_2_17_aarch64", ".so"), ("macosx_11_0_arm64", ".so")],
)
def test_library_has_the_suffix_of_its_target_system(
    platform: str, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HDASSIST_PLATFORM", platform)
    assert build.library_name(1) == f"_walk_1{suffix}"


def test_written_file_keeps_its_line_ends(tmp_path: Path) -> None:
    write_text(str(tmp_path / "a.csv"), "a\r\nb\n", force=False)
    assert (tmp_path / "a.csv").read_bytes() == b"a\r\nb\n"
    with in_place_of(tmp_path / "a.csv") as beside:
        beside.write_bytes(b"x")
    assert (tmp_path / "a.csv").read_bytes() == b"x"
