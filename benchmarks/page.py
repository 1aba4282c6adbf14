"""The page docs/performance.md, made from the numbers of a run and the texts of words.py."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from benchmarks.rows import Row, engine_of, named, rows
from benchmarks.words import CHOSEN, DRAWN, HEAD, REASONS, SEARCHED, SOLVERS

PAGE = Path(__file__).parents[1] / "docs/performance.md"


def page(measured: dict[str, Any], first: dict[str, Any] | None = None) -> str:
    """Return the text of the page; first: previous run, whose numbers are shown for comparison, None without one."""
    targets = list(rows(measured))
    before = {row.key + _name(row): row for row in rows(first)} if first else {}
    parts = [
        HEAD,
        _machine(measured["machine"]),
        *_anew(measured.get("anew", {})),
        *([f"The previous run was made at load {first['machine']['load']}.\n"] if first else []),
        "## Targets\n",
        _table(
            ("quantity", "target", *(["previous run"] if first else []), "measured", "result"),
            ((*_target(row)[:2], *([_before(row, before)] if first else []), *_target(row)[2:]) for row in targets),
        ),
        _missed(targets),
        "## Solvers, one state\n",
        SOLVERS,
        _solvers(measured["engine"]),
        "## Proposed extremes\n",
        DRAWN,
        _table(
            ("drives", "cases", "range of F'_ior", "all states: number, time in ms",
             "search: number of states, time in ms", "largest difference", "differences above 0.01″"),
            map(_proposals, measured["proposals"]),
        ),
        SEARCHED,
        _table(
            ("torque", "searches", "median of F'_ior", "mean difference", "rms difference", "largest difference",
             "differences above 0.2″", "states, coarse grid: verified", "states, coarse grid: in local searches",
             "states, fine grid", "time, coarse grid, ms", "time, fine grid, ms"),
            map(_draws, measured["draws"]),
        ),
        "## Whole processes\n",
        _table(
            ("command", "runs", "elapsed time (median), s", "processor time, s", "largest process, MB",
             "all processes, MB"),
            map(_process, measured["processes"]["runs"]),
        ),
        "## Growth with the number of teeth\n",
        "The drives are `vzp160` with other numbers of teeth on the same pitch circle. The product of module and "
        "number of teeth is therefore constant. The times include the set-up of the drive.\n",
        _growth(measured["growth"]),
        "## Coned flanks\n",
        "The drives are `vzp160` with different numbers of stations along the face of each flank "
        "(`numerics.stations`). All states of the mesh cycle are solved. The times include the set-up of the drive. "
        "The factor in brackets is the time divided by the time with one station.\n",
        _coned(measured["coned"]),
        CHOSEN,
    ]  # fmt: skip
    return "\n".join(parts)


def _machine(machine: dict[str, Any]) -> str:
    versions = ", ".join(
        f"{name} {value}" for name, value in machine.items() if name not in ("processor", "cores", "load")
    )
    return f"{machine['processor']}, {machine['cores']} cores, load {machine['load']} at the start; {versions}.\n"


def _anew(loads: dict[str, float]) -> Iterable[str]:
    if loads:
        words = ", ".join(f"{part} at load {load}" for part, load in loads.items())
        yield f"Measured again later, and compared only within each part: {words}. Two runs differ by up to 15 %.\n"


def _table(heads: Iterable[str], lines: Iterable[Iterable[str]]) -> str:
    cells = [tuple(heads)]
    cells += [("---",) * len(cells[0]), *map(tuple, lines)]
    return "\n".join(f"| {' | '.join(row)} |" for row in cells) + "\n"


def _target(row: Row) -> tuple[str, ...]:
    return row.work, row.asked, row.got, "met" if row.met else "**missed**"


def _name(row: Row) -> str:
    """Return the work of a row without the measured numbers in brackets."""
    return re.sub(r" \([^()]*\)", "", row.work)


def _before(row: Row, before: dict[str, Row]) -> str:
    there = before.get(row.key + _name(row))
    return there.got + ("" if there.met == row.met else ", met" if there.met else ", **missed**") if there else ""


def _missed(targets: list[Row]) -> str:
    missed = [row for row in targets if not row.met]
    if not missed:
        return "Every target is met.\n"
    keys = dict.fromkeys(row.key for row in missed)
    lines = ["### Reasons for missed targets\n"]
    for key in keys:
        works = [f"- **{row.work}**: {row.got}, target {row.asked}" for row in missed if row.key == key]
        lines += [*works, "", f"{REASONS[key]}\n"]
    return "\n".join(lines)


def _solvers(torques: list[dict[str, Any]]) -> str:
    lines = []
    for name in torques[0]["us"]["cycle"]:
        cells = [f"{t['us'][order][name]:.1f}" for t in torques for order in ("cycle", "search")]
        lines.append([name, *cells])
    lines.append(["numpy, certificate only", *(x for t in torques for x in (f"{t['certificate_us']:.1f}", ""))])
    for solver in torques[0]["cvxpy_us"]:
        cells = []
        for t in torques:
            us = t["cvxpy_us"][solver]
            cells += [f"{us:.0f} ({us / t['us']['cycle'][engine_of(t)]:.0f} × {engine_of(t)})", ""]
        lines.append([f"{solver} through cvxpy", *cells])
    heads = (f"{order}, {t['M_g']:g} N·m" for t in torques for order in ("cycle", "search"))
    return _table(("solver", *heads), lines)


def _proposals(group: dict[str, Any]) -> tuple[str, ...]:
    low, high = group["F_ior_arcsec"]
    both = (f"{states:.0f}, {ms:.0f}" for states, ms in zip(group["states"], group["ms"], strict=True))
    missed = f"{group['missed_arcsec']:.1e}″ ({group['missed_share']:.2%})"
    return group["group"], str(group["cases"]), f"{low:.2f}″ to {high:.2f}″", *both, missed, str(group["far"])


def _draws(search: dict[str, Any]) -> tuple[str, ...]:
    missed = (f"{search[name]:.3f}″" for name in ("bias", "rms", "worst"))
    fine, verified, climbed = (f"{count:.0f}" for count in search["states"])
    times = (f"{time_ms:.1f}" for time_ms in search["ms"])
    return (
        f"{search['M_g']:g} N·m", str(search["searches"]), f"{search['F_ior_arcsec']:.1f}″", *missed,
        str(search["over"]), verified, climbed, fine, *times,
    )  # fmt: skip


def _process(run: dict[str, Any]) -> tuple[str, ...]:
    numbers = (f"{run['median_s']:.2f}", f"{run['processor_s']:.2f}")
    memory = (f"{run['one_process_MB']:.0f}", f"{run['all_processes_MB']:.0f}")
    return named(run["command"]), str(run["runs"]), *numbers, *memory


def _growth(drives: list[dict[str, Any]]) -> str:
    torques = sorted({drive["M_g"] for drive in drives})
    lines = []
    for z_g in dict.fromkeys(drive["z_g"] for drive in drives):
        here = {drive["M_g"]: drive for drive in drives if drive["z_g"] == z_g}
        first = here[torques[0]]
        times = (f"{here[M_g]['us']:.1f}" for M_g in torques)
        lines.append((f"{z_g}/{z_g + 2}", str(first["states"]), str(first["candidates"]), *times))
    return _table(("teeth", "states", "candidates", *(f"time per state in µs, {M_g:g} N·m" for M_g in torques)), lines)


def _coned(drives: list[dict[str, Any]]) -> str:
    torques = sorted({drive["M_g"] for drive in drives})
    us = {(drive["stations"], drive["M_g"]): drive["us"] for drive in drives}
    candidates = {drive["stations"]: drive["candidates"] for drive in drives}
    lines = [
        (str(n), str(count), *(f"{us[n, M_g]:.1f} ({us[n, M_g] / us[1, M_g]:.2f} ×)" for M_g in torques))
        for n, count in candidates.items()
    ]
    return _table(("stations", "candidates", *(f"time per state in µs, {M_g:g} N·m" for M_g in torques)), lines)
