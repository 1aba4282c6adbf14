"""The table of targets, with the measured values and whether they meet the targets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from benchmarks.processes import IMPORT
from benchmarks.words import WALK, WARM_DAQP

STATE_US = {80.0: 9.0, 800.0: 6.0}  # us; time of a state with the walk in AVX2, by torque [N*m]
FASTER_THAN_CVXPY, FASTER_THAN_DAQP = 1000.0, 20.0
DRAWS_RMS, DRAWS_WORST, DRAWS_STATES = 0.05, 0.5, 177  # arcsec, arcsec, half the states of a search without slopes
FIRST_OUTPUT = 0.35  # times the import of cvxpy, until a slow command shows text on a terminal
VALUE_MS, EFFICIENCY = 7.5, 0.9
DRIVES, MINUTES = 10_000, 12.0  # random drives of tolerance, and their time on two cores
GROWTH = 4.0  # largest ratio of the times for four times as many teeth
CONED = 3.0  # largest ratio of the times for coned flanks and for whole flanks
FIRST_NUMBER, PROVEN_NUMBER = 0.15, 0.6  # s
MISSED_ARCSEC, MEMORY_MB = 0.01, 250.0


@dataclass(frozen=True)
class Row:
    """A target with its measured value.

    key: key of the reasons for a missed target.
    work: measured work in words.
    target: target value.
    measured: measured value.
    unit: unit of both values.
    at_least: whether the target is a minimum instead of a maximum.
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
    """Yield every target with its measured value, except those that a quick run omits."""
    for torque in measured["engine"]:
        yield from _state(torque)
    yield from _processes(**measured["processes"])
    for group in measured["proposals"]:
        drives = f"{group['cases']} {group['group']}"
        words = f"largest difference between proposed extremes and the extremes of all states, {drives}"
        yield Row("proposals", words, MISSED_ARCSEC, group["missed_arcsec"], "″")
    for search in measured["draws"]:
        words = f"{search['searches']} searches of samples, {search['M_g']:g} N·m"
        difference = "difference of F'_ior from a search with a grid of 60 x 60"
        yield Row("draws", f"rms {difference}, {words}", DRAWS_RMS, search["rms"], "″")
        yield Row("draws", f"largest {difference}, {words}", DRAWS_WORST, search["worst"], "″")
        yield Row("draws", f"states per search, {words}", DRAWS_STATES, sum(search["states"][1:]), "")
    yield from _growth(measured["growth"])
    yield from _coned(measured["coned"])
    for case in measured["tolerance"]:
        words = (
            "time per value of F'_ior of random drives, at two torques, as assembled and in the best of 12 holes: "
            f"{case['case']}"
        )
        yield Row("random drives", words, VALUE_MS, case["value_ms"], "ms")
        words = f"utilization of two processes that compute {case['drives']} random drives: {case['case']}"
        yield Row("two processes", words, EFFICIENCY, case["efficiency"], "", at_least=True)
        parts = f"{case['drive_ms']:.3g} ms per drive and {case['law_ms']:.3g} ms for the design of each drive"
        words = f"estimated time of `tolerance` for {DRIVES} drives on two cores ({parts}): {case['case']}"
        minutes = DRIVES * (case["drive_ms"] + case["law_ms"]) / 1e3 / 60 / 2 / min(case["efficiency"], 1)
        yield Row("random drives", words, MINUTES, minutes, "min")
    for case in measured["explorer"]:
        for words, most, took in (
            ("first", FIRST_NUMBER, case["first_s"]),
            ("verified", PROVEN_NUMBER, case["proven_s"]),
        ):
            share = f"{100 * took / case['check_s']:.1f} % of the time of `check`"
            label = f"processor time from a key press to the {words} number, `explore {case['name']}` ({share})"
            yield Row("explorer", label, most, took, "s")


def engine_of(torque: dict[str, Any]) -> str:
    """Return the engine to which the targets apply: the walk in AVX2, or else the first measured engine."""
    names = torque["us"]["cycle"]
    return WALK if WALK in names else next(iter(names))


def _state(torque: dict[str, Any]) -> Iterator[Row]:
    engine, at = engine_of(torque), f"{torque['M_g']:g} N·m"
    us, others = torque["us"]["cycle"][engine], torque["us"]["cycle"][WARM_DAQP]
    yield Row("state", f"time per state, including its certificate, {at} ({engine})", STATE_US[torque["M_g"]], us, "µs")
    words = f"speed relative to DAQP with warm start and the same matrices, {at}"
    yield Row("daqp", words, FASTER_THAN_DAQP, others / us, "times", at_least=True)
    if torque["cvxpy_us"]:
        solver, least = min(torque["cvxpy_us"].items(), key=lambda item: item[1])
        words = f"speed relative to the fastest solver through cvxpy ({solver}), {at}"
        yield Row("cvxpy", words, FASTER_THAN_CVXPY, least / us, "times", at_least=True)


def _processes(runs: list[dict[str, Any]], first_output_s: dict[str, float]) -> Iterator[Row]:
    took = {run["command"]: run["processor_s"] for run in runs}
    for run in runs:
        if run["over"]:
            other, most = run["over"]
            words = f"processor time of {named(run['command'])}, relative to `{other}`"
            yield Row(_key(run), words, most, run["processor_s"] / took[other], "")
    for command, seconds in first_output_s.items():
        words = f"processor time until `{command}` shows text on a terminal, relative to `{IMPORT.words}`"
        yield Row("first output", words, FIRST_OUTPUT, seconds / took[IMPORT.words], "")
    for run in runs:
        if run["over"]:
            yield Row("memory", f"memory of {named(run['command'])}", MEMORY_MB, run["all_processes_MB"], "MB")


def named(command: str) -> str:
    """Return a measured command in code font, with the commands that were run before it in brackets."""
    words, _, earlier = command.partition(", after ")
    if not earlier:
        return f"`{words}`"
    names = " and ".join(f"`{name}`" for name in earlier.split(" and "))
    return f"`{words}` (after {names})"


def _key(run: dict[str, Any]) -> str:
    command, _, after = run["command"].partition(", after ")
    words = command.split()
    return " ".join([*(words[1:3] if "own.yaml" in words else words[1:2]), *(["again"] if after else [])])


def _growth(drives: list[dict[str, Any]]) -> Iterator[Row]:
    for M_g in sorted({drive["M_g"] for drive in drives}):
        us = {drive["z_g"]: drive["us"] for drive in drives if drive["M_g"] == M_g}
        first, last = min(us), max(us)
        teeth = f"{last}/{last + 2} teeth, divided by the time with {first}/{first + 2} teeth"
        words = f"time per state with {teeth}, {M_g:g} N·m"
        yield Row("growth", words, GROWTH, us[last] / us[first], "")


def _coned(drives: list[dict[str, Any]]) -> Iterator[Row]:
    for M_g in sorted({drive["M_g"] for drive in drives}):
        us = {drive["stations"]: drive["us"] for drive in drives if drive["M_g"] == M_g}
        last = max(us)
        words = f"time per state with {last} stations per flank, divided by the time with whole flanks, {M_g:g} N·m"
        yield Row("coned", words, CONED, us[last] / us[1], "")
