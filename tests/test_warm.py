"""The warm start is the true one: the same bytes and exit codes as `python -m hdassist` from nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import process
from tests.process import CLEAN, SMALL, run, run_cold
from tests.warm import Warm

pytestmark = pytest.mark.skipif(not process.WARM, reason="every run is a cold one")


@pytest.mark.parametrize(
    ("args", "stdin", "code"),
    [
        (("stiffness", SMALL, "--set", "operation.rated=4"), None, 0),
        (("self-error", "-", "--json"), Path(SMALL).read_text(), 0),
        (("trace", "small.yaml", "-o", "trace.txt", "--csv", "-"), None, 0),
        (("measure", "trace.csv", "--ratio", "30", "--ascii"), None, 5),
        (("presets", "list"), None, 0),
        (("check", SMALL, "--nonsense"), None, 2),
        (("calibrate", SMALL, "--targets", "none.yaml"), None, 4),
    ],
)
def test_bytes_files_and_exit_codes_are_those_of_a_cold_start(tmp_path, args, stdin, code):
    told = []
    for way in (run, run_cold):
        folder = tmp_path / way.__name__
        folder.mkdir()
        (folder / "small.yaml").write_text(Path(SMALL).read_text())
        (folder / "trace.csv").write_text("cam_deg,error_arcsec\n" + "".join(f"{k},{k % 7}\n" for k in range(900)))
        done = way(*args, stdin=stdin, cwd=folder)
        files = {file.name: file.read_bytes() for file in folder.iterdir()}
        told.append((done.args, done.returncode, done.stdout, done.stderr, files))
    warm, cold = told
    assert warm == cold
    assert warm[1] == code
    assert warm[2] or warm[3]


def test_a_run_leaves_nothing_to_the_next(tmp_path):
    first = run("trace", SMALL, "-q").stdout
    assert run("check", "-", stdin="x: [", cwd=tmp_path).returncode == 4
    assert run("trace", SMALL, "-q", cwd=tmp_path).stdout == first
    # more than a pipe holds, in and out
    text = "".join(f"# {k:60d}\n" for k in range(9999)) + Path(SMALL).read_text()
    assert run("presets", "show", "-", stdin=text).stdout == text


def test_an_end_that_is_no_exit_and_a_start_that_fails():
    warm = Warm(CLEAN)
    try:
        # a run that has no folder ends as any Python does
        code, out, err = warm.run(["--version"], b"", "/none")
        assert (code, out) == (1, b"")
        assert b"FileNotFoundError" in err
        assert warm.run(["--version"], b"", "/")[0] == 0
    finally:
        warm.close()
    broken = Warm(CLEAN | {"PYTHONHOME": "/none"})
    with pytest.raises(RuntimeError, match="has ended"):
        broken.run(["--version"], b"", "/")
    broken.close()
