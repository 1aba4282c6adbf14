"""F'_ior by search for the extremes: how long it takes, and what it misses of what solving every state finds."""

from __future__ import annotations

import os
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

from benchmarks.machine import seconds
from hdassist import Drive, kinematic_error, load_preset, preset_names
from hdassist.error.error_map import ErrorMap
from hdassist.errors import UntrustedError
from hdassist.mounting.positions import rotated

RANDOM = 200  # drives
FIRST = 2000  # seed
STRIDES = (67, 101)  # states; what a look at some of the states would miss
OFFSETS = (0.0, 80.0, 120.0)  # um, of the cam offset that stands still
HOLES = 24  # positions among which the extreme ones are looked for
ROUNDS = 7

# Each drive deviates by a share of these, uniformly drawn; um. Phases are anywhere.
DEVIATIONS = {"F_i1": 150.0, "F_i2": 150.0, "e_hb": 140.0, "e_hh": 60.0, "e_hg": 30.0}
PHASES = ("xi_g", "xi_b", "phi_hb", "phi_hh", "phi_hg")
CLEARANCES = {"gears.j_n": (0.0, 20.0), "bearing.g_b": (0.0, 10.0)}  # um
TORQUES = {"vzp160": (20.0, 1000.0), "synthetic-160-162": (2.5, 125.0)}  # N*m, uniform in the logarithm


@dataclass(frozen=True)
class Case:
    """One drive at one torque M_g [N*m], and the group it belongs to."""

    group: str
    drive: Drive
    M_g: float


def measure(quick: bool) -> dict:
    """Seconds of a search, and its greatest difference [arcsec] against the full cycle by group of cases."""
    drive = load_preset("vzp160")
    found = []
    for M_g in drive.operation.M_g:
        ready = ErrorMap(drive, M_g)
        whole = seconds(lambda M_g=M_g: ErrorMap(drive, M_g).extremes(drive), 2 if quick else ROUNDS)
        alone = seconds(lambda ready=ready: ready.extremes(drive), 2 if quick else ROUNDS)
        states = ready.extremes(drive).certificate.states
        found.append({"M_g": M_g, "s": whole, "without_set_up_s": alone, "states": states})
    with ProcessPoolExecutor(os.cpu_count()) as executor:
        cases = [*_presets(), *_hard(), *executor.map(_random, range(FIRST, FIRST + (10 if quick else RANDOM)))]
        groups: dict[str, list[dict[str, float]]] = {}
        for case, differences in zip(cases, executor.map(_compare, cases), strict=True):
            groups.setdefault(case.group, []).append(differences)
    return {"torques": found, "groups": {name: _worst(rows) for name, rows in groups.items()}}


def _presets() -> Iterable[Case]:
    for name in preset_names():
        drive = load_preset(name)
        yield from (Case("presets", drive, M_g) for M_g in drive.operation.M_g)


def _hard() -> Iterable[Case]:
    """Cam offsets from none to large, each with the wheel where the error is least and where it is greatest."""
    drive = load_preset("vzp160")
    for M_g in drive.operation.M_g:
        search = ErrorMap(drive, M_g)
        for e_hb in OFFSETS:
            turned = [rotated(drive.with_values({"tolerances.e_hb": e_hb}), 360 * k / HOLES) for k in range(HOLES)]
            values = [search.extremes(there).first for there in turned]
            for place in (np.argmin(values), np.argmax(values)):
                yield Case("hard cases", turned[place], M_g)


def _random(seed: int) -> Case:
    """A random drive; drawn anew where its answer would be outside the limits of the model."""
    rng = np.random.default_rng(seed)
    name, (low, high) = list(TORQUES.items())[seed % len(TORQUES)]
    while True:
        values = {f"tolerances.{key}": rng.uniform(0, most) for key, most in DEVIATIONS.items()}
        values |= {f"phases.{key}": rng.uniform(0, 360) for key in PHASES}
        values |= {path: rng.uniform(*ends) for path, ends in CLEARANCES.items()}
        case = Case(
            "random drives", load_preset(name).with_values(values), float(np.exp(rng.uniform(*np.log([low, high]))))
        )
        try:
            ErrorMap(case.drive, case.M_g).extremes(case.drive)
        except UntrustedError:
            continue
        return case


def _compare(case: Case) -> dict[str, float]:
    """What the search, and looks at every so many-th state, miss of the full cycle [arcsec and its share]."""
    full = kinematic_error(case.drive, case.M_g, cross_check=None)
    found = ErrorMap(case.drive, case.M_g).extremes(case.drive)
    told = {
        "F_ior": full.F_ior_arcsec,
        "search": full.F_ior_arcsec - found.F_ior_arcsec,
        "states": float(found.certificate.states),
    }
    for stride in STRIDES:
        told[f"stride {stride}"] = 1 - float(np.ptp(full.error_arcsec[::stride])) / full.F_ior_arcsec
    return told


def _worst(rows: list[dict[str, float]]) -> dict:
    missed = [abs(row["search"]) for row in rows]
    return {
        "cases": len(rows),
        "F_ior_arcsec": [min(row["F_ior"] for row in rows), max(row["F_ior"] for row in rows)],
        "most_states": max(row["states"] for row in rows),
        "greatest_difference_arcsec": max(missed),
        "above_0.01_arcsec": sum(miss > 0.01 for miss in missed),
        "missed_by_stride": {str(stride): max(row[f"stride {stride}"] for row in rows) for stride in STRIDES},
    }
