"""A stop while cvxpy is imported is not lost, whatever the import makes of it."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

SWALLOWS = """\
import os, signal, time
try:
    os.kill(os.getpid(), signal.Signals[os.environ["STOP"]])
    time.sleep(1)
except BaseException:
    pass
"""
IMPORTS = """\
import signal, sys
signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
signal.signal(signal.SIGHUP, lambda *_: sys.exit(1))
from hdassist.solve.cvx import cp
print("went on")
"""


@pytest.mark.parametrize(("stop", "said"), [("SIGINT", "interrupted\n"), ("SIGTERM", ""), ("SIGHUP", "")])
def test_a_stop_that_an_import_swallows_ends_the_process(tmp_path: Path, stop: str, said: str) -> None:
    (tmp_path / "cvxpy.py").write_text(SWALLOWS, encoding="utf-8")
    env = {"PYTHONPATH": f"{tmp_path}:{Path(__file__).parents[2]}", "STOP": stop}
    done = subprocess.run([sys.executable, "-c", IMPORTS], env=env, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (128 + signal.Signals[stop], "", said)


def test_handlers_are_as_they_were_afterwards() -> None:
    before = signal.getsignal(signal.SIGINT)
    from hdassist.solve.cvx import cp

    assert signal.getsignal(signal.SIGINT) is before
    assert cp.__name__ == "cvxpy"
