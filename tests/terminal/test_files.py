"""Files appear whole or not at all, and never over another one unasked."""

from __future__ import annotations

import io
import os
from pathlib import Path

import pytest

from hdassist.interface.terminal.streams import require_writable, write_text
from hdassist.run.errors import DataError, UsageError
from tests.helpers.process import posix_only


def test_a_file_is_written_and_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "a.yaml"
    write_text(str(target), "µm\n", force=False)
    assert target.read_bytes() == "µm\n".encode()
    assert list(tmp_path.iterdir()) == [target]
    assert capsys.readouterr() == ("", f"wrote {target}\n")


def test_minus_is_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    write_text("-", "text\n", force=False)
    assert capsys.readouterr() == ("text\n", "")


def test_standard_output_that_lacks_a_character_shows_its_escape(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr("sys.stdout", stream)
    write_text("-", "5 µm", force=False)
    stream.seek(0)
    assert stream.read() == "5 \\xb5m"


def test_an_existing_file_stays_without_force(tmp_path: Path) -> None:
    target = tmp_path / "a"
    target.write_text("old")
    for refused in (
        lambda: write_text(str(target), "new", False),
        lambda: require_writable(str(target), False),
    ):
        with pytest.raises(UsageError, match="exists"):
            refused()
    assert target.read_text() == "old"
    write_text(str(target), "new", force=True)
    assert target.read_text() == "new"


@posix_only("links that any user may make, and modes of files")
def test_replaced_file_keeps_its_mode_and_links_stay_links(tmp_path: Path) -> None:
    target, link = tmp_path / "a", tmp_path / "link"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    write_text(str(link), "new", force=True)
    assert link.is_symlink()
    assert (target.read_text(), target.stat().st_mode & 0o777) == ("new", 0o640)


def test_a_write_that_fails_leaves_everything_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "a"
    target.write_text("old")

    def full(self: Path, other: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(DataError, match="No space left"):
        write_text(str(target), "new", force=True)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("path", ["", ".", "gone/a", "a\0b"])
def test_what_cannot_be_written_is_a_data_error(path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for refused in (lambda: write_text(path, "x", True), lambda: require_writable(path, True)):
        with pytest.raises(DataError, match="cannot write"):
            refused()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_directory_without_permission_is_a_data_error(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(DataError, match="no permission"):
        write_text(str(tmp_path / "a"), "x", force=False)


def test_a_device_is_written_to_and_not_replaced() -> None:
    write_text(os.devnull, "x", force=False)
    assert not Path(os.devnull).is_file()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names")
def test_a_pipe_that_nobody_reads_is_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(DataError, match="no process reads the pipe"):
        write_text(str(pipe), "x", force=False)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_text(str(pipe), "x", force=False)
    assert os.read(reader, 9) == b"x"
    os.close(reader)
