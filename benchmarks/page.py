"""docs/performance.md: the numbers of a run between the texts of words.py."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from benchmarks.rows import Row, rows
from benchmarks.words import CHOSEN, DRAWN, HEAD, REASONS

PAGE = Path(__file__).parents[1] / "docs/performance.md"


def page(measured: dict[str, Any]) -> str:
    """The page as text."""
    targets = list(rows(measured))
    parts = [
        HEAD,
        _machine(measured["machine"]),
        "## Targets\n",
        _table(("work", "target", "measured", ""), map(_target, targets)),
        _missed(targets),
        "## Solvers, one state\n",
        "Microseconds of processor time a state of `vzp160`, certificate included for the first two.\n",
        _solvers(measured["engine"]),
        "## Searches\n",
        DRAWN,
        _table(
            ("drives", "cases", "F'_ior", "most states", "greatest difference", "above 0.01″",
             "a stride of 67 misses up to", "a stride of 101 misses up to"),
            (_search(name, group) for name, group in measured["search"]["groups"].items()),
        ),
        "## Whole processes\n",
        _table(
            ("command", "runs", "median, s", "processors, s", "largest process, MB", "all processes, MB"),
            map(_process, measured["processes"]["runs"]),
        ),
        "## Growth with the number of teeth\n",
        "`vzp160` with other teeth on the same pitch circle (module × teeth constant); set-up included.\n",
        _growth(measured["growth"]),
        "## Coned flanks\n",
        "`vzp160` with `numerics.stations` along the face of each flank, over the full cycle; set-up included.\n",
        _coned(measured["coned"]),
        CHOSEN,
    ]  # fmt: skip
    return "\n".join(parts)


def _machine(machine: dict[str, Any]) -> str:
    versions = ", ".join(
        f"{name} {value}" for name, value in machine.items() if name not in ("processor", "cores", "load")
    )
    return f"{machine['processor']}, {machine['cores']} cores, load {machine['load']} at the start; {versions}.\n"


def _table(heads: Iterable[str], lines: Iterable[Iterable[str]]) -> str:
    cells = [tuple(heads)]
    cells += [("---",) * len(cells[0]), *map(tuple, lines)]
    return "\n".join(f"| {' | '.join(row)} |" for row in cells) + "\n"


def _target(row: Row) -> tuple[str, ...]:
    return row.work, row.asked, row.got, "met" if row.met else "**missed**"


def _missed(targets: list[Row]) -> str:
    missed = [row for row in targets if not row.met]
    if not missed:
        return "Every target is met.\n"
    keys = dict.fromkeys(row.key for row in missed)
    lines = ["### Missed, why, and what to try next\n"]
    for key in keys:
        works = "; ".join(f"{row.work} ({row.got}, target {row.asked})" for row in missed if row.key == key)
        lines.append(f"- **{works}**: {REASONS[key]}")
    return "\n".join(lines) + "\n"


def _solvers(torques: list[dict[str, Any]]) -> str:
    names = {
        "engine_us": "engine",
        "daqp_us": "DAQP, warm from state to state",
        "certificate_us": "the certificate alone",
    }
    lines = [[words, *(f"{t[key]:.1f}" for t in torques)] for key, words in names.items()]
    for solver in torques[0]["cvxpy_us"]:
        times = [t["cvxpy_us"][solver] for t in torques]
        ratios = [f" ({us / t['engine_us']:.0f} × the engine)" for us, t in zip(times, torques, strict=True)]
        lines.append([f"{solver} through cvxpy", *(f"{us:.0f}{r}" for us, r in zip(times, ratios, strict=True))])
    return _table(("solver", *(f"{t['M_g']:g} N·m" for t in torques)), lines)


def _search(name: str, group: dict[str, Any]) -> tuple[str, ...]:
    low, high = group["F_ior_arcsec"]
    strides = (f"{share:.0%}" for share in group["missed_by_stride"].values())
    return (
        name, str(group["cases"]), f"{low:.2f}″ to {high:.2f}″", f"{group['most_states']:.0f}",
        f"{group['greatest_difference_arcsec']:.1e}″", str(group["above_0.01_arcsec"]), *strides,
    )  # fmt: skip


def _process(run: dict[str, Any]) -> tuple[str, ...]:
    numbers = (f"{run['median_s']:.2f}", f"{run['processor_s']:.2f}")
    memory = (f"{run['one_process_MB']:.0f}", f"{run['all_processes_MB']:.0f}")
    return f"`{run['command']}`", str(run["runs"]), *numbers, *memory


def _growth(drives: list[dict[str, Any]]) -> str:
    torques = sorted({drive["M_g"] for drive in drives})
    lines = []
    for z_g in dict.fromkeys(drive["z_g"] for drive in drives):
        here = {drive["M_g"]: drive for drive in drives if drive["z_g"] == z_g}
        first = here[torques[0]]
        times = (f"{here[M_g]['us']:.1f}" for M_g in torques)
        lines.append((f"{z_g}/{z_g + 2}", str(first["states"]), str(first["candidates"]), *times))
    return _table(("teeth", "states", "candidates", *(f"µs a state, {M_g:g} N·m" for M_g in torques)), lines)


def _coned(drives: list[dict[str, Any]]) -> str:
    torques = sorted({drive["M_g"] for drive in drives})
    us = {(drive["stations"], drive["M_g"]): drive["us"] for drive in drives}
    candidates = {drive["stations"]: drive["candidates"] for drive in drives}
    lines = [
        (str(n), str(count), *(f"{us[n, M_g]:.1f} ({us[n, M_g] / us[1, M_g]:.2f} ×)" for M_g in torques))
        for n, count in candidates.items()
    ]
    return _table(("stations", "candidates", *(f"µs a state, {M_g:g} N·m" for M_g in torques)), lines)
