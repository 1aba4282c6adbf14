"""What the search misses of every state, on many random drives: `python -m benchmarks.search_study --n 1000`.

Drives are those of tests/searched_drives.py. Each is a line of a file when it is done, and a later run goes on from
there; the file belongs to one state of the code.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

KINDS = ("light", "heavy", "any")  # of tests/searched_drives.py
ARCSEC, SHARE = 0.01, 0.01  # that no drive may be missed by
WORST = 5  # drives that are named

Task = tuple[str, int, tuple[str, ...]]


@dataclass(frozen=True)
class Compared:
    """One drive: F'_ior [arcsec] from every state and as searched, None outside the limits of the model."""

    kind: str
    seed: int
    overrides: tuple[str, ...]
    every_state: float | None = None
    searched: float | None = None
    states: int = 0

    @property
    def task(self) -> Task:
        return self.kind, self.seed, self.overrides

    @property
    def missed(self) -> float:
        return abs(self.every_state - self.searched)

    @property
    def share(self) -> float:
        return self.missed / self.every_state


def compare(task: Task) -> Compared:
    from hdassist import kinematic_error
    from hdassist.error.error_map import ErrorMap
    from hdassist.errors import UntrustedError
    from tests.searched_drives import searched_drive

    drive, M_g = searched_drive(*task)
    try:
        full = kinematic_error(drive, M_g, cross_check=None)
        found = ErrorMap(drive, M_g).extremes(drive)
    except UntrustedError:
        return Compared(*task)
    return Compared(*task, full.F_ior_arcsec, found.F_ior_arcsec, found.certificate.states)


def remembered(file: Path) -> Iterator[Compared]:
    if file.exists():
        for line in file.read_text(encoding="utf-8").splitlines():
            told = json.loads(line)
            yield Compared(**told | {"overrides": tuple(told["overrides"])})


def report(kind: str, rows: Sequence[Compared]) -> None:
    rows = sorted((row for row in rows if row.every_state is not None), key=lambda row: -row.missed)
    values, states = [row.every_state for row in rows], [row.states for row in rows]
    print(
        f"{kind}: {len(rows)} drives of {min(values):.2f} to {max(values):.2f} arcsec, {sum(states) / len(rows):.0f} "
        f"states searched, {max(states)} at most; missed at most {rows[0].missed:.1e} arcsec, "
        f"{sum(row.missed > ARCSEC for row in rows)} above {ARCSEC:g} arcsec, at most "
        f"{max(row.share for row in rows):.1e} of the error, {sum(row.share > SHARE for row in rows)} above {SHARE:.0%}"
    )
    for row in rows[:WORST]:
        if row.missed > ARCSEC:
            print(f"  seed {row.seed}: {row.every_state:.4f} arcsec, searched {row.searched:.4f}")


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--n", type=int, default=1000, help="drives of each kind")
    reader.add_argument("--kinds", nargs="*", choices=KINDS, default=KINDS)
    reader.add_argument("--set", nargs="*", default=(), metavar="FIELD=VALUE", help="fields of all drives")
    reader.add_argument("--file", type=Path, default=Path("build/search_study.jsonl"))
    options = reader.parse_args()
    options.file.parent.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # numpy is not loaded yet
    tasks = [(kind, seed, tuple(options.set)) for kind in options.kinds for seed in range(options.n)]
    known = {row.task: row for row in remembered(options.file)}
    missing = [task for task in tasks if task not in known]
    with ProcessPoolExecutor(os.cpu_count()) as executor, options.file.open("a", encoding="utf-8") as stream:
        for row in executor.map(compare, missing):
            known[row.task] = row
            print(json.dumps(asdict(row)), file=stream, flush=True)
    for kind in options.kinds:
        report(kind, [known[task] for task in tasks if task[0] == kind])


if __name__ == "__main__":
    main()
