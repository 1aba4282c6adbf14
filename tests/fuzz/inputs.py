"""Everything that the tool reads, changed at random: none is a bug, takes long or much memory, or destroys a file.

Commands run in a process that has imported all of them, one input after the other, each in a folder of its own. Of most
inputs nothing is solved: what is read is answered with "not solved" (exit 5) where the first state would be. A few go
all the way.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from unittest import mock

import numpy as np

from hdassist.features.acceptance.answer import read_answers
from hdassist.run.errors import HdassistError, UntrustedError
from tests.fuzz.seeds import KINDS, Input
from tests.helpers.process import run

MOST_SECONDS = 5.0  # of processor time
MOST_MEMORY = 500.0  # MB over what the process has before
PATIENCE = 100 * MOST_SECONDS  # by the clock, on a machine that has other work
TOGETHER = 1000  # inputs that a process takes, one after the other
SOLVED = 100  # one input of so many goes all the way
SEARCHES = ("targets", "state")  # which solve many drives each
SOLVED_KINDS = ("results",)  # which solve before they read
ALL_THE_WAY = ("results", "pitch", "targets")  # of which no input has a result before states are solved
RESULTS = (0, 3, 6)  # exit codes of a result: done or PASS, FAIL, INCONCLUSIVE
MOST_TRIES = 40  # inputs a result that is wanted
GOOD = (0, 2, 3, 4, 5, 6)
TOLD = 500  # inputs after which the counts so far are printed


@dataclass(frozen=True)
class Outcome:
    """What became of an input: its number and kind, exit code, what is wrong (empty: nothing), seconds, megabytes."""

    k: int
    kind: str
    code: int
    fault: str
    seconds: float
    megabytes: float


def made(k: int, seed: int, kinds: Sequence[str] = ()) -> Input:
    """The input numbered k of a seed, of some kinds in turn."""
    names = kinds or list(KINDS)
    return KINDS[names[k % len(names)]](np.random.default_rng([seed, k]))


def outcomes(
    numbers: Sequence[int], seed: int, kinds: Sequence[str] = (), solved_kinds: Sequence[str] = SOLVED_KINDS
) -> Iterator[Outcome]:
    """What becomes of the inputs with these numbers; a process that dies or hangs is followed by another one.

    solved_kinds: kinds of which all inputs are solved, not some alone.
    """
    _import_all()
    context = multiprocessing.get_context("fork")
    at = 0
    while at < len(numbers):
        ours, theirs = context.Pipe(duplex=False)
        part = numbers[at : at + TOGETHER]
        process = context.Process(target=_work, args=(part, seed, kinds, solved_kinds, theirs))
        process.start()
        theirs.close()
        for k in part:
            at += 1
            try:
                if not ours.poll(PATIENCE):
                    raise TimeoutError
                yield ours.recv()
            except (EOFError, TimeoutError) as error:
                fault = "hangs" if isinstance(error, TimeoutError) else "died"
                yield Outcome(k, made(k, seed, kinds).kind, -1, fault, PATIENCE, 0)
                break
        if process.is_alive() and process.pid:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL if at < len(numbers) else signal.SIGCONT)
        process.join()
        ours.close()


def until_results(wanted: int, seed: int, kinds: Sequence[str] = ()) -> Iterator[Outcome]:
    """Yield what becomes of inputs until so many of each kind have reached a result, or far more were tried."""
    for kind in kinds or list(KINDS):
        results = 0
        tried = 0
        while results < wanted and tried < MOST_TRIES * wanted:
            for outcome in outcomes(range(tried, tried + max(wanted // 2, 50)), seed, [kind], ALL_THE_WAY):
                results += outcome.code in RESULTS
                tried += 1
                yield outcome


def _import_all() -> None:
    """Import what commands import when they run, so that no process has to."""
    for args in (("check", "-h"), ("presets", "list")):
        run(*args)
    # unused here: they are only to be loaded
    from hdassist.features.acceptance import accept  # noqa: F401
    from hdassist.features.calibration import calibrate  # noqa: F401
    from hdassist.features.mounting import advice  # noqa: F401
    from hdassist.interface.pages import (
        card,  # noqa: F401
        curves,  # noqa: F401
    )
    from hdassist.interface.pages import compare as compared  # noqa: F401
    from hdassist.interface.pages import measure as measured  # noqa: F401


def _work(
    numbers: Sequence[int], seed: int, kinds: Sequence[str], solved_kinds: Sequence[str], answer: Connection
) -> None:
    os.setpgid(0, 0)
    warnings.simplefilter("error")  # what numpy has to say is no message of ours
    with tempfile.TemporaryDirectory() as name:
        for k in numbers:
            folder = Path(name) / "there" / str(k)
            folder.mkdir(parents=True)
            given = made(k, seed, kinds)
            one_of_some = k % SOLVED == 0 and given.kind not in SEARCHES
            answer.send(judged(k, given, folder, solves=one_of_some or given.kind in solved_kinds))


def judged(k: int, given: Input, folder: Path, *, solves: bool) -> Outcome:
    """Run an input in a folder, which is empty, and look at what it did."""
    for name, content in given.files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)
    before = _files(folder)
    signal.setitimer(signal.ITIMER_PROF, (20 if solves else 2) * MOST_SECONDS)  # ends a process that hangs
    room, begun = _memory("VmRSS", fresh=True), time.process_time()
    with ExitStack() if solves else unsolved():
        done = run(*given.args, cwd=folder, held=False)
    seconds, megabytes = time.process_time() - begun, _memory("VmHWM") - room
    signal.setitimer(signal.ITIMER_PROF, 0)
    said = done.stdout + done.stderr
    faults = []
    if done.returncode not in GOOD or "internal error" in said:
        faults.append(f"exit {done.returncode}: {next((x for x in said.split(chr(10)) if 'internal' in x), '')[:300]}")
    if done.returncode in (2, 4, 5) and "error" not in said.lower():
        faults.append(f"exit {done.returncode} without a word")
    if seconds > MOST_SECONDS and not solves:  # a solution takes what it takes; what it may, the drives tell
        faults.append(f"{seconds:.1f} s")
    if megabytes > MOST_MEMORY:
        faults.append(f"{megabytes:.0f} MB")
    faults += _lost(given, done.returncode, before, _files(folder))
    faults += _believed(given, done.returncode)
    return Outcome(k, given.kind, done.returncode, "; ".join(faults), seconds, megabytes)


def _lost(given: Input, code: int, before: dict[str, bytes], after: dict[str, bytes]) -> Iterator[str]:
    """What became of files that should not have: changed, gone, left over; forced is what a command was told to do."""
    forced = "--force" in given.args
    for name, content in before.items():
        now = after.get(name)
        if now == content or (forced and code != 2 and now is not None):
            continue
        if name in given.kept and now is not None and code != 2 and _goes_on(content, now):
            continue
        yield f"{name} is changed" if now is not None else f"{name} is gone"
    for name in after.keys() - before.keys():
        if code == 2 or Path(name).suffix in (".part", ".lock"):
            yield f"{name} is left over"


def _believed(given: Input, code: int) -> Iterator[str]:
    """Kept work that was edited, and is no beginning of what it was, all the same gone on from."""
    for name, sound in given.sound.items():
        whole = given.files[name][: given.files[name].rfind(b"\n") + 1]
        if code not in (2, 4) and not sound.encode().startswith(whole):
            yield f"{name} is believed"


def _goes_on(before: bytes, now: bytes) -> bool:
    """Whether a file of ours has become another one of the same kind that goes on from it."""
    whole = before[: before.rfind(b"\n") + 1]
    if now.startswith(whole or before.rstrip(b"\0")):
        return True
    with tempfile.TemporaryDirectory() as name:
        (was := Path(name) / "was").write_bytes(before)
        (comes := Path(name) / "is").write_bytes(now)
        with suppress(HdassistError):
            # of a header and a line that broke off nothing can be lost
            return not read_answers(str(was)) or bool(read_answers(str(comes)))
    return False


@contextmanager
def unsolved(*, at_once: bool = False) -> Iterator[None]:
    """Commands that stop where the first state would be solved; at_once: those too that would draw another drive."""

    def refuse(*_: object, **__: object) -> None:
        raise SystemExit(UntrustedError.exit_code) if at_once else UntrustedError("not solved here", "")

    with mock.patch("hdassist.drive.solve.loadcase.LoadCase.__init__", refuse):
        yield


def _files(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def _memory(name: str, *, fresh: bool = False) -> float:
    """Memory [MB] of this process, VmRSS now or VmHWM at most; fresh: the most is counted from here on."""
    if fresh:
        Path("/proc/self/clear_refs").write_text("5")
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(name))
    return int(line.split()[1]) / 1024


def report(found: Iterator[Outcome], seed: int, kinds: Sequence[str] = (), *, one_kind: bool = False) -> bool:
    """Print what became of inputs as it comes, those that are not as promised in full; whether all are.

    one_kind: an input is numbered among those of its kind alone, as `until_results` has them.
    """
    count: Counter[tuple[str, int]] = Counter()
    slowest = most = Outcome(-1, "", 0, "", 0, 0)
    good, spent, begun = True, 0.0, time.monotonic()

    def told() -> None:
        print(
            f"{count.total()} inputs, {spent:.0f} s of processor time, {time.monotonic() - begun:.0f} s in all",
            flush=True,
        )

    for outcome in found:
        count[outcome.kind, outcome.code] += 1
        spent += outcome.seconds
        slowest = max(slowest, outcome, key=lambda one: one.seconds)
        most = max(most, outcome, key=lambda one: one.megabytes)
        if outcome.fault:
            good = False
            print(
                f"{outcome.k} ({outcome.kind}): {outcome.fault}\n"
                f"  {_shown(made(outcome.k, seed, [outcome.kind] if one_kind else kinds))}",
                flush=True,
            )
        if count.total() % TOLD == 0:
            told()
    for kind in dict.fromkeys(kind for kind, _ in sorted(count)):
        codes = sorted((code, n) for (of, code), n in count.items() if of == kind)
        print(f"{kind}: {', '.join(f'exit {code}: {n}' for code, n in codes)}")
    told()
    print(f"slowest: {slowest.seconds:.1f} s ({slowest.k}, {slowest.kind})")
    print(f"most memory: {most.megabytes:.0f} MB ({most.k}, {most.kind})")
    return good


def _shown(given: Input) -> str:
    return json.dumps(given.args)[:400]


def save(given: Input, folder: Path) -> None:
    """Write an input's files and its command line, to look at."""
    folder.mkdir(parents=True)
    for name, content in {**given.files, "args.json": json.dumps(given.args).encode()}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)
