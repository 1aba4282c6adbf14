"""Runs that are ended at any moment: nothing lost, no file half written, no process left, and the next run goes on.

A run is judged by what an unbroken run of the same command gave. Its processes carry a mark in their environment, by
which they are found, whoever began them.
"""

from __future__ import annotations

import json
import math
import os
import re
import secrets
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from tests.helpers.process import CLEAN, COMMAND, TINY

MARK = "HDASSIST_MARK"
OLD = "what was there before\n"
STARTS = 0.1  # s: the interpreter itself starts, and what it says of an interrupt before it is its own
GRACE = 5.0  # s for what was begun to end after its parent
LONGEST = 300.0  # s of one run, on a machine that has other work
# one line says it, behind those that any run says; an answer with what there is by then may be warned of
STOPPED = re.compile(
    r"(many.csv: 100 drives\n)?(warning: ([\w.-]+: )?)?(interrupted|terminated|hung up)(: [^\n]+)?\n"
    r"(warning: [^\n]+\n)*"
)
WARNINGS = re.compile(r"(warning: [^\n]+\n)*")
TOLD = 20  # runs after which the count so far is printed
SOON = 2.0  # s in which a command ends that is told to stop
USUAL_ENDS = (0, 3, 6)
LOST = "a worker process was killed"
ENDS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}
CHANGES = re.compile(  # from run to run; a checksum is that of a time too
    r'\d{4}-\d\d-\d\d(T\d\d:\d\d:\d\d\+00:00)?|"evaluations": \d+|"checksum":"[0-9a-f]{16}"'
)

INPUTS = {
    "tiny.yaml": Path(TINY).read_text(encoding="utf-8").replace("[1, 4]", "[4]"),
    "targets.yaml": (
        "schema: hdassist.targets/1\nunknowns: {gears.j_n: {low: 15, high: 20}}\n"
        "targets: [{quantity: F_ior, M_g: 4, phase: 0, value: 131, tolerance: 1}]\n"
    ),
    "lot.csv": "serial,preset,limit F_ior@4\n"
    + "".join(f"{k},tiny.yaml,{limit}\n" for k, limit in enumerate((600, 10, 130, 140))),
    "many.csv": "serial,preset,tolerances.e_hb,limit F_ior@80\n" + "".join(f"{k},vzp160,{k},30\n" for k in range(100)),
    "run.csv": "cam_deg,error_arcsec\n"
    + "".join(f"{k},{15 * math.sin(math.radians(k)) + 3 * math.sin(math.radians(2 * k)):.4f}\n" for k in range(721)),
}


@dataclass(frozen=True)
class Case:
    """A command; whole: files that it writes at once; grows: a file that it writes line by line."""

    name: str
    arguments: tuple[str, ...]
    whole: tuple[str, ...] = ()
    grows: str = ""


def _case(name: str, arguments: str, whole: str = "", grows: str = "") -> Case:
    return Case(name, tuple(arguments.split()), tuple(whole.split()), grows)


CASES = {
    case.name: case
    for case in (
        _case("lot", "accept lot.csv --jsonl a.jsonl --resume --junit a.xml --csv a.csv -o a.json --json --force "
              "--jobs 2", "a.xml a.csv a.json", "a.jsonl"),
        _case("accept", "accept tiny.yaml --limit F_ior@4=600 --junit a.xml --csv a.csv -o a.json "
              "--json --force --jobs 2", "a.xml a.csv a.json"),
        _case("calibrate", "calibrate tiny.yaml --targets targets.yaml --write found.yaml -o a.json "
              "--json --force --evaluations 8 --jobs 2", "found.yaml a.json"),
        _case("tolerance", "tolerance tiny.yaml -n 96 --results t.jsonl -o a.json --json --force --jobs 2", "a.json",
              "t.jsonl"),
        _case("sweep", "sweep tiny.yaml --vary gears.j_n=10:20:81 -o s.jsonl --jobs 2", grows="s.jsonl"),
        _case("check", "check tiny.yaml --csv a.csv -o a.json --json --force --jobs 2", "a.csv a.json"),
        _case("mount", "mount tiny.yaml --set mounting.holes=3 --draws 0 --card card.html --csv a.csv -o a.json "
              "--json --force --jobs 2", "card.html a.csv a.json"),
        _case("trials", "trials tiny.yaml h0=130 h1=125 h2=127 --set mounting.holes=3 --noise 30 --sure 0.01 "
              "--card card.html --csv a.csv -o a.json --json --force --jobs 2", "card.html a.csv a.json"),
        _case("measure", "measure run.csv --ratio 11 --csv a.csv -o a.json --json --force", "a.csv a.json"),
        _case("compare", "compare tiny.yaml run.csv --csv a.csv -o a.json --json --force", "a.csv a.json"),
        _case("trace", "trace tiny.yaml --csv a.csv -o a.json --json --force", "a.csv a.json"),
        _case("stiffness", "stiffness tiny.yaml --csv a.csv -o a.json --json --force", "a.csv a.json"),
        _case("stiffness", "stiffness tiny.yaml --csv a.csv -o a.json --json --force", "a.csv a.json"),
        _case("new", "presets new mine -o mine.yaml --force", "mine.yaml"),
    )
}  # fmt: skip
LONG = (
    _case("check", "check vzp160 --jobs 2 --set operation.M_g=[10,20,40,80,160,320,640,800]"),
    _case("mount", "mount vzp160 --step 0.5 --jobs 2"),
    _case("tolerance", "tolerance vzp160 -n 4000 --jobs 2 --results a.jsonl", grows="a.jsonl"),
    _case("sweep", "sweep vzp160 --vary gears.j_n=0:10:401 --jobs 2 -o a.jsonl", grows="a.jsonl"),
    _case("sensitivity", "sensitivity vzp160 -n 512 --jobs 2"),
    _case("calibrate", "calibrate tiny.yaml --targets targets.yaml --evaluations 4000 --jobs 1"),
    _case("accept", "accept many.csv --jsonl a.jsonl --jobs 2", grows="a.jsonl"),
    _case("trials", "trials vzp160 h0=28 h3=22 h6=17 --jobs 2"),
    _case("allocate", "allocate vzp160 --limit 20 --jobs 2"),
    _case("report", "report vzp160 --jobs 2"),
)  # fmt: skip


@dataclass(frozen=True)
class Usual:
    """What an unbroken run does: exit code, standard output, files by name, and the time it takes [s]."""

    code: int
    out: str
    files: dict[str, str]
    seconds: float


@dataclass
class Tally:
    """What came out of a study.

    runs; done: those that were over before their signal; outside: those ended by the system before our first line or
    after our last; midway: those killed with work kept; gone_on: runs that went on from what was left, to the end;
    broken: promises that were; parts: temporary files left by kills; slowest end [s], and slowest_alone, without the
    time in which a process waited for a core.
    """

    runs: int = 0
    done: int = 0
    outside: int = 0
    midway: int = 0
    gone_on: int = 0
    broken: list[str] = field(default_factory=list)
    parts: int = 0
    slowest: float = 0.0
    slowest_alone: float = 0.0
    slowest_of: str = ""


@contextmanager
def folder(old: Sequence[str] = ()) -> Iterator[Path]:
    """A folder with all inputs; old: files in it that there are already."""
    with tempfile.TemporaryDirectory(prefix="hdassist-faults-", ignore_cleanup_errors=True) as name:
        place = Path(name)
        place.chmod(0o755)
        for file, text in INPUTS.items():
            (place / file).write_text(text, encoding="utf-8")
        for file in old:
            (place / file).write_text(OLD)
        yield place


def start(case: Case, place: Path, mark: str, before: Sequence[str] = (), **more: Any) -> subprocess.Popen[str]:
    """Begin a run; before: a command that runs it; more: of subprocess.Popen, env upon a clean one."""
    env = CLEAN | {MARK: mark} | more.pop("env", {})
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(
        [*before, *COMMAND, *case.arguments], cwd=place, env={k: v for k, v in env.items() if v is not None},
        text=True, encoding="utf-8", errors="replace", **(streams | more),
    )  # fmt: skip


@cache
def usual(case: Case) -> Usual:
    """An unbroken run, and its time, tried once."""
    with folder() as place:
        begun = time.monotonic()
        process = start(case, place, "usual")
        out, err = process.communicate(timeout=LONGEST)
        seconds = time.monotonic() - begun
        files = texts(place)
        assert process.returncode in (0, 3, 6), err
        assert {*case.whole, *([case.grows] if case.grows else [])} == {*files} - {*INPUTS}, err
        return Usual(process.returncode, plain(out), files, seconds)


def texts(place: Path) -> dict[str, str]:
    """Files of a folder by name, without what differs from run to run."""
    return {item.name: plain(item.read_text(encoding="utf-8")) for item in place.iterdir() if item.is_file()}


def plain(text: str) -> str:
    """A text without times, and without how much of it was remembered."""
    return CHANGES.sub("-", text)


def left(mark: str) -> list[int]:
    """Processes of a run that are still at work, after some time to end."""
    until = time.monotonic() + GRACE
    while (found := [pid for pid in processes() if has_mark(pid, mark)]) and time.monotonic() < until:
        time.sleep(0.02)
    return found


def processes() -> list[int]:
    return [int(name) for name in os.listdir("/proc") if name.isdigit()]  # noqa: PTH208 (Path makes one of each)


def has_mark(pid: int, mark: str) -> bool:
    try:
        return f"{MARK}={mark}\0".encode() in Path(f"/proc/{pid}/environ").read_bytes()  # empty of one that has ended
    except OSError:
        return False


def faults_of_files(case: Case, place: Path, old: Sequence[str], known: Usual, *, ended_in_order: bool) -> list[str]:
    """What is wrong with the files that a run left: each is absent, as it was, or whole."""
    said = []
    found = texts(place)
    for name, text in found.items():
        if name in INPUTS:
            good = text == plain(INPUTS[name])
        elif name == case.grows:
            good = known.files[name].startswith(text)
        elif name in case.whole:
            good = text == known.files[name] or (name in old and text == OLD) or _says_why(name, text)
        else:
            good = not ended_in_order and name.endswith(".part")
        if not good:
            said.append(f"{name}: {text[:60]!r} of {len(text)} characters")
    return said + [f"{name}: lost" for name in (*INPUTS, *old) if name not in found]


def _says_why(name: str, text: str) -> bool:
    """Whether a file is a whole answer that says why there is none."""
    with suppress(ValueError):
        return name.endswith(".json") and bool(json.loads(text)["error"]["message"])
    return False


def goes_on(case: Case, place: Path, known: Usual) -> list[str]:
    """What is wrong with the same command run again where one was ended."""
    process = start(case, place, "again")
    out, err = process.communicate(timeout=LONGEST)
    files = {name: text for name, text in texts(place).items() if not name.endswith(".part")}
    if process.returncode != known.code or plain(out) != known.out:
        return [f"again: exit {process.returncode}: {err.strip()[-300:]}"]
    return [f"again: {name} differs" for name in {*files, *known.files} if files.get(name) != known.files.get(name)]


def kills(count: int, seed: int, names: Sequence[str] = tuple(CASES)) -> Tally:
    """SIGKILL at random moments of each command in turn, up to three times until it is let to its end.

    Arguments: count, of kills; seed, of the moments; names, of cases.
    """
    tally = Tally()
    known = {name: usual(CASES[name]) for name in names}
    chain = 0
    while tally.runs < count:
        case, rng = CASES[names[chain % len(names)]], np.random.default_rng([seed, chain])
        old = case.whole if chain // len(names) % 2 else ()
        chain += 1
        with folder(old) as place:
            for _ in range(min(int(rng.integers(1, 4)), count - tally.runs)):
                _kill(case, place, old, known[case.name], rng, tally)
            after = texts(place)
            tally.parts += sum(name.endswith(".part") for name in after)
            if after != {name: plain(text) for name, text in INPUTS.items()} | dict.fromkeys(old, OLD):
                tally.gone_on += 1
                if said := goes_on(case, place, known[case.name]):
                    tally.broken.append(f"{case.name}: {'; '.join(said)}")
                    print(f"  {tally.broken[-1]}", flush=True)
    return tally


def _kill(case: Case, place: Path, old: Sequence[str], known: Usual, rng: np.random.Generator, tally: Tally) -> None:
    """Begin a run in a folder and kill it, half of the runs to all of its processes.

    Where a file grows line by line, two of three are killed soon after it has a random share of its lines: in the
    middle of the work, however busy the machine is. The others are killed after a random share of the usual time.
    """
    mark, share = secrets.token_hex(8), rng.uniform(0, 1) if rng.random() < 0.6 else rng.uniform(0.8, 1.02)
    is_by_size, is_for_all, wait = bool(case.grows) and rng.random() < 2 / 3, rng.random() < 0.5, rng.uniform(0, 0.1)
    process = start(case, place, mark, start_new_session=True)
    if is_by_size:
        least = share * len(known.files[case.grows])
        while process.poll() is None and _size(place / case.grows) < least:
            time.sleep(0.005)
        time.sleep(wait)
    else:
        time.sleep(share * known.seconds)
    with suppress(ProcessLookupError):
        (os.killpg if is_for_all else os.kill)(process.pid, signal.SIGKILL)
    process.communicate(timeout=LONGEST)
    tally.done += process.returncode != -signal.SIGKILL
    if process.returncode == -signal.SIGKILL and case.grows and _size(place / case.grows):
        tally.midway += 1
    said = [f"process {pid} left" for pid in left(mark)]
    said += faults_of_files(case, place, old, known, ended_in_order=False)
    record(tally, said, f"{case.name} killed at {share:.2f} of its {'file' if is_by_size else 'time'}")


def _size(file: Path) -> int:
    return file.stat().st_size if file.exists() else 0


def signals(count: int, seed: int, seconds: float = 8.0) -> Tally:
    """SIGINT, SIGTERM or SIGHUP at a random moment of long commands, to one process or to all, as a terminal does it.

    In a third of the runs a worker is killed instead. Arguments: count, of runs; seed, of the moments; seconds after
    the start in which they lie.
    """
    tally = Tally()
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        number, whom = list(ENDS)[k // len(LONG) % 3], ("it", "all", "a worker")[int(rng.integers(3))]
        _interrupt(LONG[k % len(LONG)], number, rng.uniform(0, seconds), whom, tally)
    return tally


def _interrupt(case: Case, number: signal.Signals, moment: float, whom: str, tally: Tally) -> None:
    with folder() as place:
        mark = secrets.token_hex(8)
        process = start(case, place, mark, start_new_session=True)
        time.sleep(moment)
        lost = max(_workers_of(process.pid, mark), default=0) if whom == "a worker" else 0
        is_done, sent, queued = _is_over(process), time.monotonic(), _queued(process.pid)
        with suppress(ProcessLookupError):
            if lost:
                os.kill(lost, signal.SIGKILL)
            elif not is_done:
                (os.killpg if whom == "all" else os.kill)(process.pid, number)
        out, err, queued_later = _end_of(process)
        seconds, turn = time.monotonic() - sent, max(0.0, queued_later - queued)
        said = [f"process {pid} left" for pid in left(mark)]
        where = f"{case.name}, {'a worker killed' if lost else number.name} after {moment:.2f} s"
        where += " to all" if whom == "all" else ""
        if is_done or (lost and process.returncode in USUAL_ENDS):
            is_done = True
            tally.done += 1
            said += [] if process.returncode in USUAL_ENDS else [f"exit {process.returncode}: {err[-300:]}"]
        elif lost:
            said += [] if process.returncode == 5 and LOST in err else [f"exit {process.returncode}: {err[-600:]}"]
        elif moment < STARTS and process.returncode != ENDS[number] and "hdassist" not in err:  # the interpreter began
            tally.outside += 1
        elif process.returncode == -number and WARNINGS.fullmatch(err):  # by the system: it was ending
            tally.outside += 1
            said += [] if out else ["ended by the system at work"]
        else:
            said += [] if process.returncode == ENDS[number] else [f"exit {process.returncode}"]
            said += [] if STOPPED.fullmatch(err) else [f"{err.count(chr(10))} lines: {err[-600:]}"]
            said += [f"left {item.name}" for item in place.iterdir() if item.name not in (*INPUTS, case.grows)]
        if not is_done:
            said += [f"{seconds:.1f} s, {turn:.1f} s of them in the queue for a core"] if seconds - turn > SOON else []
            tally.slowest_alone = max(tally.slowest_alone, seconds - turn)
            if seconds > tally.slowest:
                tally.slowest, tally.slowest_of = seconds, where
        record(tally, said, where)


def _workers_of(parent: int, mark: str) -> list[int]:
    """Processes that were forked for a run, and run no other program."""
    with suppress(OSError):
        line = Path(f"/proc/{parent}/cmdline").read_bytes()
        marked = [pid for pid in processes() if pid != parent and has_mark(pid, mark)]
        return [pid for pid in marked if Path(f"/proc/{pid}/cmdline").read_bytes() == line]
    return []


def _is_over(process: subprocess.Popen[str]) -> bool:
    """Whether a process has ended; it can still be waited for, unlike after its poll()."""
    return os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT | os.WNOHANG) is not None


def _end_of(process: subprocess.Popen[str]) -> tuple[str, str, float]:
    """Both streams of a process to its end, and how long its first thread has waited for a core by then [s]."""
    with ThreadPoolExecutor(1) as beside:
        streams = beside.submit(lambda: [stream.read() for stream in (process.stdout, process.stderr) if stream])
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        queued = _queued(process.pid)
        out, err = streams.result(timeout=LONGEST)
    with process:  # its streams are closed, and it is waited for
        return out, err, queued


def _queued(pid: int) -> float:
    """How long the first thread of a process has waited for a core [s]: on a quiet machine it would not."""
    with suppress(OSError, IndexError):
        return int(Path(f"/proc/{pid}/schedstat").read_text().split()[1]) / 1e9
    return 0.0


def record(tally: Tally, said: Sequence[str], where: str) -> None:
    """Count a run; said, what was wrong with it; where, of which run it is said."""
    tally.runs += 1
    if tally.runs % TOLD == 0:
        print(f"  {tally.runs} runs", flush=True)
    if said:
        tally.broken.append(f"{where}: {'; '.join(said)}")
        print(f"  {tally.broken[-1]}", flush=True)


def report(name: str, tally: Tally) -> bool:
    """Print what came out; whether every promise was kept."""
    ends = f", slowest end {tally.slowest:.1f} s ({tally.slowest_of})" if tally.slowest_of else ""
    ends += f", {tally.slowest_alone:.1f} s without waits for a core" if tally.slowest_alone else ""
    parts = f", {tally.parts} temporary files left" if tally.parts else ""
    ends += f", {tally.done} done before" if tally.done else ""
    ends += f", {tally.outside} ended while the interpreter began or ended" if tally.outside else ""
    ends += f", {tally.midway} with work kept" if tally.midway else ""
    ends += f", {tally.gone_on} gone on with to the end" if tally.gone_on else ""
    print(f"{name}: {tally.runs} runs, {len(tally.broken)} of them broke a promise{parts}{ends}", flush=True)
    return not tally.broken
