"""The table of targets: what is asked for, what was measured, and whether that meets it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from benchmarks.processes import FIRST_LINE, IMPORT

STATE_US, FASTER_THAN_CVXPY, FASTER_THAN_DAQP = 25.0, 1000.0, {80.0: 8.0, 800.0: 12.0}
VALUE_MS, EFFICIENCY = 7.5, 0.9
CONED = 3.0  # times: what a default may cost over the one before
CYCLE_S, SEARCH_S, SEARCH_ARCSEC, MEMORY_MB = 0.6, 0.1, 0.01, 300.0


@dataclass(frozen=True)
class Row:
    """One target: the group of reasons it belongs to, the work in words, and both numbers with their unit.

    at_least: the target is a least value, not a greatest.
    """

    key: str
    work: str
    target: float
    measured: float
    unit: str
    at_least: bool = False

    @property
    def met(self) -> bool:
        return self.measured >= self.target if self.at_least else self.measured <= self.target

    @property
    def asked(self) -> str:
        return f"{'≥' if self.at_least else '≤'} {self.target:g}{self._after}"

    @property
    def got(self) -> str:
        digits = ".1e" if self.unit == "″" else ".3g" if self.measured < 1000 else ".0f"
        return f"{self.measured:{digits}}{self._after}"

    @property
    def _after(self) -> str:
        return self.unit if self.unit in ("″", "") else f" {self.unit}"


def rows(measured: dict[str, Any]) -> Iterator[Row]:
    """Every target with what was measured for it; what a quick run leaves out is left out."""
    for torque in measured["engine"]:
        yield from _state(torque)
    for torque in measured["engine"]:
        yield Row(
            "cycle", f"F'_ior over the full cycle, {_at(torque)}, set-up included", CYCLE_S, torque["full_cycle_s"], "s"
        )
    for torque in measured["search"]["torques"]:
        yield Row("search time", f"F'_ior by search, {_at(torque)}, set-up included", SEARCH_S, torque["s"], "s")
    for name, group in measured["search"]["groups"].items():
        words = f"its greatest difference to the full cycle, {group['cases']} {name}"
        yield Row("search difference", words, SEARCH_ARCSEC, group["greatest_difference_arcsec"], "″")
    yield from _processes(**measured["processes"])
    yield from _growth(measured["growth"])
    yield from _coned(measured["coned"])
    for case in measured["tolerance"]:
        words = f"a value of F'_ior of random drives, two torques, as built and best of 12 holes: {case['case']}"
        yield Row("random drives", words, VALUE_MS, case["value_ms"], "ms")
        words = f"use of two processes, {case['drives']} random drives: {case['case']}"
        yield Row("two processes", words, EFFICIENCY, case["efficiency"], "", at_least=True)


def _processes(runs: list[dict[str, Any]], first_line_s: dict[str, float]) -> Iterator[Row]:
    took = {run["command"]: run["median_s"] for run in runs}
    for run in runs:
        if run["target_s"]:
            yield Row(_key(run), f"`{run['command']}`", run["target_s"], run["median_s"], "s")
        elif run["ratio"]:
            other, most = run["ratio"]
            words = f"`{run['command']}` against `{other}`"
            yield Row(_key(run), words, most, run["median_s"] / took[other], "times")
    for command, seconds in first_line_s.items():
        words = f"until `{command}` shows something on a terminal, against `{IMPORT.words}`"
        yield Row("first line", words, FIRST_LINE, seconds / took[IMPORT.words], "times")
    for run in runs:
        if run["command"].startswith("hdassist"):
            yield Row("memory", f"memory of `{run['command']}`", MEMORY_MB, run["all_processes_MB"], "MB")


def _at(torque: dict[str, Any]) -> str:
    return f"{torque['M_g']:g} N·m"


def _key(run: dict[str, Any]) -> str:
    words = run["command"].split()
    return {"--every-state": "every state", "-": "fig. 3"}.get(words[-1], words[1])


def _state(torque: dict[str, Any]) -> Iterator[Row]:
    us = torque["engine_us"]
    yield Row("state", f"one state, {_at(torque)}, certificate included", STATE_US, us, "µs")
    if torque["cvxpy_us"]:
        solver, least = min(torque["cvxpy_us"].items(), key=lambda item: item[1])
        words = f"faster than the fastest solver through cvxpy ({solver}), {_at(torque)}"
        yield Row("cvxpy", words, FASTER_THAN_CVXPY, least / us, "times", at_least=True)
    words = f"faster than DAQP warm on the same matrices, {_at(torque)}"
    yield Row("daqp", words, FASTER_THAN_DAQP[torque["M_g"]], torque["daqp_us"] / us, "times", at_least=True)


def _growth(drives: list[dict[str, Any]]) -> Iterator[Row]:
    for M_g in sorted({drive["M_g"] for drive in drives}):
        us = {drive["z_g"]: drive["us"] for drive in drives if drive["M_g"] == M_g}
        first, last = min(us), max(us)
        words = f"time a state, {last}/{last + 2} against {first}/{first + 2} teeth, {M_g:g} N·m"
        yield Row("growth", words, last / first, us[last] / us[first], "times")


def _coned(drives: list[dict[str, Any]]) -> Iterator[Row]:
    for M_g in sorted({drive["M_g"] for drive in drives}):
        us = {drive["stations"]: drive["us"] for drive in drives if drive["M_g"] == M_g}
        last = max(us)
        words = f"time a state, {last} stations along coned flanks against whole flanks, {M_g:g} N·m"
        yield Row("coned", words, CONED, us[last] / us[1], "times")
