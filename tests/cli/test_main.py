"""The command itself: help, version, and what happens when something breaks."""

from __future__ import annotations

import subprocess
import sys
from unittest import mock

import pytest

from hdassist import __version__
from tests.helpers.process import CLEAN, SMALL, run


@pytest.mark.thorough
@pytest.mark.parametrize(
    "args",
    [
        ["--help"],
        ["-h"],
        ["check", "-h"],
        ["trace", "--help"],
        ["presets", "-h"],
        ["--version"],
        ["presets", "new", "-h"],
    ],
)
def test_help_imports_nothing_heavy(args):
    code = (
        "import sys\n"
        f"sys.argv = ['hdassist', *{args!r}]\n"
        "from hdassist.interface.cli import run_command_line\n"
        "try:\n    run_command_line()\nexcept SystemExit as end:\n    assert not end.code, end.code\n"
        "heavy = {'numpy', 'scipy', 'cvxpy', 'daqp', 'yaml'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=CLEAN, check=False)
    assert result.returncode == 0, result.stderr
    assert result.stdout


def test_version():
    assert run("--version").stdout == f"hdassist {__version__}\n"


@pytest.mark.parametrize("command", ["check", "trace"])
def test_help_starts_with_examples(command):
    text = run(command, "-h").stdout
    assert text.index("Examples:") < text.index("Options:")
    assert max(map(len, text.splitlines())) <= 80


def breaking(error: Exception, *args: str) -> subprocess.CompletedProcess[str]:
    with mock.patch("hdassist.features.design.check", side_effect=error):
        return run("check", SMALL, *args)


def test_a_bug_is_exit_code_1_and_says_so():
    result = breaking(ZeroDivisionError("oops"))
    assert result.returncode == 1
    assert "bug" in result.stderr
    assert "ZeroDivisionError: oops" in result.stderr
    assert "Traceback" not in result.stderr
    assert "Traceback" in breaking(ZeroDivisionError("oops"), "--debug").stderr


@pytest.mark.parametrize(
    ("fault", "code", "said"),
    [
        (MemoryError(), 5, "error: not enough memory"),
        (OSError(24, "Too many open files"), 4, "error: the operating system refused a resource: Too many open files"),
        (
            OSError(11, "Resource temporarily unavailable"),
            4,
            "error: the operating system refused a resource: Resource",
        ),
    ],
)
def test_what_the_system_refuses_is_no_bug(fault, code, said):
    result = breaking(fault)
    assert result.returncode == code
    assert result.stderr.startswith(said)
    assert "Traceback" not in result.stderr


def test_debug_shows_where_an_error_came_from():
    result = run("check", SMALL, "--debug", "--set", "operation.M_g=1e6")
    assert "Traceback" in result.stderr
    assert result.returncode == 5


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="closed streams of a shell")
@pytest.mark.parametrize(
    ("args", "closed", "code"),
    [("explain NOTHING", "2>&-", 2), ("check nowhere.yaml", "2> >(exec true; :)", 4)],
)
def test_a_closed_stream_changes_no_exit_code(args, closed, code, tmp_path):
    shell = f'"{sys.executable}" -m hdassist {args} {closed}'
    result = subprocess.run(["bash", "-c", shell], capture_output=True, text=True, env=CLEAN, cwd=tmp_path, check=False)
    assert (result.returncode, result.stderr) == (code, "")
