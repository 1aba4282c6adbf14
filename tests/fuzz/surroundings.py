"""Runs where the system gives little: the right answer, or an error that says what is missing; never a bug.

Each surrounding is a shell's line that runs the command as "$@". What needs root lies in a mount namespace of its own,
and is skipped where that is not given.
"""

from __future__ import annotations

import secrets
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz import faults
from tests.fuzz.faults import CASES, LONGEST, Case, Tally, Usual, folder, left, record, start, texts, usual

REFUSED = (2, 4, 5)
MOUNTS = ("unshare", "-m")
OTHER_USER = ("setpriv", "--reuid", "54321", "--clear-groups", "--inh-caps", "+dac_read_search")
OTHER_USER += ("--ambient-caps", "+dac_read_search")  # reads Python wherever it is, and may do nothing else


@dataclass(frozen=True)
class Surrounding:
    """A shell's line around "$@"; by, what runs that shell; silent, whether standard error or output are away."""

    name: str
    line: str
    by: tuple[str, ...] = ()
    silent: bool = False


NO_SHM = """
mkdir dev; for name in null zero full random urandom tty; do touch dev/$name; mount --bind /dev/$name dev/$name; done
mount --rbind dev /dev; umount -R dev; exec "$@"
"""
FULL_DISK = """
mkdir disk; mount -t tmpfs -o size=64k tmpfs disk; cp *.* disk; cd disk; head -c 100000 /dev/zero > fill
"$@"; code=$?; rm fill; find . -name '*.*' -type f -exec cp {} .. \\; ; exit $code
"""
READ_ONLY = 'mount --bind . . && mount -o remount,bind,ro . && cd "$PWD" && exec "$@"'
SHM_READ_ONLY = 'mount -t tmpfs -o ro tmpfs /dev/shm; exec "$@"'
SHM_FULL = 'mount -t tmpfs -o size=4k tmpfs /dev/shm; head -c 4096 /dev/zero > /dev/shm/fill; exec "$@"'

SURROUNDINGS = (
    Surrounding("disk full", FULL_DISK, MOUNTS),
    Surrounding("no file above 512 bytes", 'ulimit -f 1; PYTHONDONTWRITEBYTECODE=1 exec "$@"'),
    Surrounding("folder read-only", READ_ONLY, MOUNTS),
    Surrounding("folder of another user", 'exec "$@"', OTHER_USER),
    Surrounding("shared memory read-only", SHM_READ_ONLY, MOUNTS),
    Surrounding("shared memory full", SHM_FULL, MOUNTS),
    Surrounding("no shared memory", NO_SHM, MOUNTS),
    Surrounding("no HOME", 'unset HOME; exec "$@"'),
    Surrounding("HOME not writable", 'HOME=/proc; exec "$@"'),
    Surrounding("HOME not there", 'HOME=/nowhere; exec "$@"'),
    Surrounding("TMPDIR not there", 'export TMPDIR=/nowhere; exec "$@"'),
    Surrounding(
        "no environment",
        'exec env -i PYTHONPATH="$PYTHONPATH" HDASSIST_CACHE="$HDASSIST_CACHE" HDASSIST_MARK="$HDASSIST_MARK" "$@"',
    ),
    Surrounding("LANG=C", 'LANG=C; exec "$@"'),
    Surrounding("LC_ALL=C", 'export LC_ALL=C; exec "$@"'),
    Surrounding("LC_ALL=C without UTF-8", 'export LC_ALL=C PYTHONUTF8=0 PYTHONCOERCECLOCALE=0; exec "$@"'),
    Surrounding("streams of ASCII", 'export PYTHONIOENCODING=ascii; exec "$@"'),
    Surrounding("standard input closed", 'exec "$@" <&-'),
    Surrounding("standard output closed", 'exec "$@" >&-', silent=True),
    Surrounding("standard error closed", 'exec "$@" 2>&-', silent=True),
    Surrounding("all streams closed", 'exec "$@" <&- >&- 2>&-', silent=True),
    Surrounding("standard error full", 'exec "$@" 2> /dev/full', silent=True),
    Surrounding("one core", 'exec taskset -c 0 "$@"'),
    *(Surrounding(f"{n} open files", f'ulimit -n {n}; exec "$@"') for n in (6, 8, 10, 12, 14, 16, 20)),
    *(Surrounding(f"{n} MB of addresses", f'ulimit -v {n}000; exec "$@"') for n in (60, 100, 200, 350, 520, 600)),
    *(Surrounding(f"{n} processes", f'exec prlimit --nproc={n} "$@"', OTHER_USER) for n in (1, 2, 3, 4)),
)
LEADS = (0.0, 0.01, 0.1, 0.4, 0.7, 0.9)
TRIED = ("lot", "calibrate", "check", "mount", "measure", "compare", "new")


def surroundings(names: Sequence[str] = TRIED, which: Sequence[Surrounding] = SURROUNDINGS) -> Tally:
    """Each command in each surrounding: its usual answer, or a refusal."""
    tally = Tally()
    known = {name: usual(CASES[name]) for name in names}
    for surrounding in which:
        if reason := unavailable(surrounding):
            print(f"  {surrounding.name}: skipped, {reason}", flush=True)
            continue
        ends = [run_in(surrounding, CASES[name], known[name], tally) for name in names]
        print(f"  {surrounding.name}: exit codes {' '.join(map(str, ends))}", flush=True)
    return tally


def unavailable(surrounding: Surrounding) -> str:
    """Why a surrounding cannot be had here; empty where it can."""
    if not surrounding.by:
        return "" if shutil.which("taskset") or "taskset" not in surrounding.line else "no taskset"
    tried = [*surrounding.by, "sh", "-c", "mount -t tmpfs tmpfs /mnt" if surrounding.by == MOUNTS else "true"]
    if not shutil.which(tried[0]):
        return f"no {tried[0]}"
    return subprocess.run(tried, capture_output=True, text=True, check=False).stderr.strip()


def run_in(surrounding: Surrounding, case: Case, known: Usual, tally: Tally) -> int:
    """Run a command in a surrounding and judge it; returns its exit code."""
    with folder() as place:
        if surrounding.by == OTHER_USER and "prlimit" in surrounding.line:
            place.chmod(0o777)  # it is not the folder that lacks
        mark = secrets.token_hex(8)
        process = start(case, place, mark, (*surrounding.by, "sh", "-c", surrounding.line, "sh"))
        try:
            out, err = process.communicate(timeout=LONGEST)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            out, err = process.communicate()
        said = _wrong(surrounding, process.returncode, out, err, known)
        said += [f"process {pid} left" for pid in left(mark)]
        said += faults.faults_of_files(case, place, (), known, ended_in_order=True)
        if process.returncode == known.code:
            said += [f"{name}: absent" for name in known.files if name not in texts(place)]
        record(tally, said, f"{surrounding.name}, {case.name}")
        return process.returncode


def _wrong(surrounding: Surrounding, code: int, out: str, err: str, known: Usual) -> list[str]:
    """What is wrong with how a run ended."""
    if any(words in err for words in ("Traceback", "internal error", "Exception ignored")):
        return [f"exit {code}: {err[-300:]}"]
    if code in REFUSED:
        return [] if "error: " in err or surrounding.silent else [f"exit {code} without an error: {err[-300:]}"]
    return [] if code == known.code else [f"exit {code}: {err[-300:]}"]


def two_at_once(names: Sequence[str] = ("lot", "sweep"), leads: Sequence[float] = LEADS) -> Tally:
    """Two runs on one file that grows: one writes it whole, the other is refused, or comes after it.

    leads: of the usual time, by which one begins before the other.
    """
    tally = Tally()
    for name in names:
        case, known = CASES[name], usual(CASES[name])
        for lead in leads:
            with folder() as place:
                mark, ends = secrets.token_hex(8), []

                def run(wait: float, case: Case = case, place: Path = place, mark: str = mark) -> None:
                    time.sleep(wait)
                    process = start(case, place, mark)
                    ends.append((process.communicate(timeout=LONGEST), process.returncode))  # noqa: B023

                threads = [threading.Thread(target=run, args=(wait,)) for wait in (0.0, lead * known.seconds)]
                for thread in threads:
                    thread.start()
                for thread in threads:
                    thread.join()
                codes = sorted(code for _, code in ends)
                good = codes in (sorted([2, known.code]), [known.code] * 2)
                said = [] if good else [f"exit codes {codes}: {ends}"]
                said += ["Traceback"] * any("Traceback" in err for (_, err), _ in ends)
                said += [f"process {pid} left" for pid in left(mark)]
                said += faults.faults_of_files(case, place, (), known, ended_in_order=True)
                said += [f"{file}: absent" for file in known.files if file not in texts(place)]
                record(tally, said, f"two runs of {name}, {lead} of the time apart")
    return tally
