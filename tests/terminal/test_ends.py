"""Workers end with the process that began them, however that ends; and nobody waits for work that nobody wants."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.process import CLEAN, COMMAND, SMALL

pytestmark = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")

LONG = [
    ("check", "vzp160"),
    ("mount", "vzp160", "--step", "1", "--every-state"),
    ("accept", "vzp160", "--limit", "F_ior=1"),
    ("calibrate", SMALL, "--targets", "targets.yaml", "--evaluations", "4000"),
]
TARGETS = """
schema: hdassist.targets/1
unknowns: {gears.j_n: {low: 0, high: 10}}
targets: [{quantity: F_ior, M_g: 4, phase: 0, value: 14, tolerance: 0.5}]
"""


def workers_of(process: subprocess.Popen) -> list[int]:
    """Processes that it has begun, once there are two."""
    for _ in range(600):
        told = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        if len(told) >= 2:
            return [int(pid) for pid in told]
        assert process.poll() is None
        time.sleep(0.05)
    raise AssertionError("no workers")


def ended(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


ENDS = [(signal.SIGKILL, -9), (signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
CASES = [(arguments, *end) for arguments in LONG for end in (ENDS if arguments[0] == "check" else ENDS[:2])]


@pytest.mark.parametrize(("arguments", "number", "code"), CASES, ids=lambda one: getattr(one, "name", None))
def test_nothing_is_left_at_work(tmp_path, arguments, number, code):
    (tmp_path / "targets.yaml").write_text(TARGETS)
    process = subprocess.Popen(
        [*COMMAND, *arguments, "--jobs", "2"], cwd=tmp_path, env=CLEAN, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell has it ignored in the background
    )  # fmt: skip
    workers = workers_of(process)
    time.sleep(0.3)  # at work
    process.send_signal(number)
    out, err = process.communicate(timeout=20)
    assert process.returncode == code
    assert b"Traceback" not in err
    assert out == b""
    for _ in range(100):
        if all(map(ended, workers)):
            break
        time.sleep(0.05)
    assert all(map(ended, workers))
    assert [item.name for item in tmp_path.iterdir()] == ["targets.yaml"]


def test_a_worker_that_is_ended_from_outside_leaves_no_answer_and_is_no_bug(tmp_path):
    process = subprocess.Popen(
        [*COMMAND, "check", "vzp160", "--jobs", "2"], cwd=tmp_path, env=CLEAN, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )  # fmt: skip
    workers = workers_of(process)
    os.kill(workers[0], signal.SIGKILL)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 5
    assert out == b""
    assert err.startswith(b"error: a process that shared the work was ended from outside")
    assert all(map(ended, workers))


def test_an_interrupt_while_the_command_is_imported_ends_it_at_once():
    told = """
import signal, sys
import hdassist.__main__ as begin
print(signal.getsignal(signal.SIGINT) is signal.SIG_DFL, "typer" in sys.modules)
sys.argv[1:] = ["--version"]
try:
    begin.main()
finally:
    print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)
"""
    done = subprocess.run([sys.executable, "-c", told], env=CLEAN, capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[::2] == ["True False", "True"]


def test_what_is_ignored_stays_ignored():
    told = """
import signal
signal.signal(signal.SIGINT, signal.SIG_IGN)
import hdassist.__main__
print(signal.getsignal(signal.SIGINT) is signal.SIG_IGN)
"""
    done = subprocess.run([sys.executable, "-c", told], env=CLEAN, capture_output=True, text=True, check=False)
    assert done.stdout == "True\n"
