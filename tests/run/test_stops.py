"""Workers end with the process that began them, however that ends; and nobody waits for work that nobody wants."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.helpers.process import CLEAN, COMMAND, SMALL, TINY, ends

pytestmark = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")

DRIVE = ("vzp160", "--set", "numerics.stations=1")  # a long cycle, soon begun
LONG = [
    ("check", *DRIVE),
    ("mount", *DRIVE, "--step", "1"),
    ("accept", *DRIVE, "--limit", "F_ior=1"),
    ("tolerance", *DRIVE, "-n", "400"),
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


ENDS = [(signal.SIGKILL, -9), (signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
OF = {"check": ENDS, "mount": ENDS[:1], "accept": ENDS[:1], "tolerance": ENDS[:2], "calibrate": ENDS[:2]}
CASES = [(arguments, *end) for arguments in LONG for end in OF[arguments[0]]]


@pytest.mark.thorough
@pytest.mark.parametrize(("arguments", "number", "code"), CASES, ids=lambda one: getattr(one, "name", None))
def test_nothing_is_left_at_work(tmp_path, arguments, number, code):
    (tmp_path / "targets.yaml").write_text(TARGETS)
    process = subprocess.Popen(
        [*COMMAND, *arguments, "--jobs", "2"], cwd=tmp_path, env=CLEAN, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    workers = workers_of(process)
    time.sleep(0.3)  # at work
    process.send_signal(number)
    out, err = process.communicate(timeout=20)
    assert process.returncode == code
    assert out == b""
    assert err.count(b"\n") == (number != signal.SIGKILL)
    assert all(map(ends, workers))
    assert [item.name for item in tmp_path.iterdir()] == ["targets.yaml"]


@pytest.mark.thorough
def test_killed_worker_gives_exit_5_and_no_result(tmp_path):
    process = subprocess.Popen(
        [*COMMAND, "check", *DRIVE, "--jobs", "2"], cwd=tmp_path, env=CLEAN, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )  # fmt: skip
    workers = workers_of(process)
    os.kill(workers[-1], signal.SIGKILL)  # the first may be the resource tracker of spawned processes
    out, err = process.communicate(timeout=60)
    assert process.returncode == 5
    assert out == b""
    assert err.startswith(b"error: a worker process was killed")
    assert all(map(ends, workers))


IMPORTED = """
import os, signal, sys

class Stopped:
    def find_spec(self, name, *_):
        if name == "typer":
            os.kill(os.getpid(), signal.{0})

sys.meta_path.insert(0, Stopped())
sys.argv = ["hdassist", "check", {1!r}]
import hdassist.__main__ as begin
try:
    begin.main()
except BaseException as error:  # as an import does that tries another way
    print("swallowed", repr(error))
"""
LINES = [("SIGINT", "interrupted"), ("SIGTERM", "terminated"), ("SIGHUP", "hung up")]


@pytest.mark.parametrize(("stop", "line"), LINES)
def test_stop_swallowed_by_an_import_still_ends_the_command(stop, line):
    done = subprocess.run(
        [sys.executable, "-c", IMPORTED.format(stop, TINY)], env=CLEAN, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (128 + signal.Signals[stop], "", f"{line}\n")


HANGS = """
import os, time
from hdassist.run.stops import at_stop, end_at_stops

end_at_stops()
with at_stop(lambda: (os.write(1, b"putting away\\n"), time.sleep(3600))):
    os.write(1, b"at work\\n")
    time.sleep(3600)
"""


@pytest.mark.parametrize("stop", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_second_stop_ends_a_command_that_hangs_in_the_first(stop):
    with subprocess.Popen([sys.executable, "-c", HANGS], env=CLEAN, stdout=subprocess.PIPE, text=True) as process:
        for line in ("at work\n", "putting away\n"):
            assert process.stdout.readline() == line
            process.send_signal(signal.Signals[stop])
        assert process.wait(timeout=20) == -signal.Signals[stop]


PARTIAL = """
import os, signal
from hdassist.run.stops import at_stop, end_at_stops, until_interrupted

def numbers():
    for number in range(4):
        if number == {0}:
            os.kill(os.getpid(), signal.SIGINT)
        yield number

def items():
    found = yield from until_interrupted(numbers())
    print("interrupted", found, flush=True)

end_at_stops()
with at_stop(lambda: "put away"):
    for number in items():
        print(number, flush=True)
        if number == {1}:
            os.kill(os.getpid(), signal.SIGINT)
print("answered", list(until_interrupted(numbers())), flush=True)
os.kill(os.getpid(), signal.SIGINT)
"""


@pytest.mark.parametrize(
    ("moment", "out"),
    [
        ("2, 9", "0\n1\ninterrupted True\nanswered []\n"),  # while it waits for the next item
        ("9, 1", "0\n1\ninterrupted True\nanswered []\n"),  # while it works on one
        ("9, 3", "0\n1\n2\n3\ninterrupted True\nanswered []\n"),
    ],
)
def test_first_interrupt_allows_a_partial_result_and_the_second_ends(moment, out):
    code = PARTIAL.format(*moment.split(", "))
    done = subprocess.run([sys.executable, "-c", code], env=CLEAN, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, out, "interrupted\n")


def ignoring() -> None:
    for stop in (signal.SIGINT, signal.SIGHUP):
        signal.signal(stop, signal.SIG_IGN)


@pytest.mark.thorough
def test_signals_ignored_by_the_caller_stay_ignored_in_workers():
    with subprocess.Popen(
        [*COMMAND, "check", *DRIVE, "--draws", "1", "-q", "--jobs", "2"], env=CLEAN, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, start_new_session=True, preexec_fn=ignoring,
    ) as process:  # fmt: skip
        workers_of(process)
        for stop in (signal.SIGINT, signal.SIGHUP):
            os.killpg(process.pid, stop)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out.count(b"\n")) == (0, 2)
    assert [line.split(b":")[0] for line in err.splitlines()] == [b"warning"]  # of the stations


SENDS = """
import subprocess, sys
from tests.helpers.process import COMMAND, hear_what_is_ignored

hear_what_is_ignored()
with subprocess.Popen([*COMMAND, "check", "vzp160"], stderr=subprocess.PIPE, text=True) as process:
    process.send_signal(__import__("signal").SIGHUP)
    print(process.wait())
"""


@pytest.mark.thorough
def test_children_of_tests_that_were_begun_under_nohup_hear_signals():
    done = subprocess.run(
        [sys.executable, "-c", SENDS], env=CLEAN, capture_output=True, text=True, check=False, preexec_fn=ignoring
    )
    assert int(done.stdout) in (-signal.SIGHUP, 129)  # the first before the command has begun
