"""`hdassist doctor`: whether this installation can be relied on, and what this machine and terminal offer."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from hdassist.errors import HdassistError, UntrustedError
from hdassist.report.quantities import Quantity, as_object
from hdassist.run.run import UNCHECKED
from hdassist.terminal import options as o
from hdassist.version import __version__

if TYPE_CHECKING:
    from hdassist.report.report import Report

PRESET, M_G, STORED_F_IOR, AGREES = "vzp160", 800.0, 7.706924145663, 1e-6  # arcsec: what every state gave, and how near
CROSS = "HIGHS"


@dataclass(frozen=True)
class DoctorFinding:
    """A part of the installation, its status, and the finding in words; broken: there are no trustworthy answers."""

    what: str
    status: Literal["ok", "note", "broken"]
    found: str


FINDING_COLUMNS: tuple[Quantity[DoctorFinding], ...] = (
    Quantity("what", "part", "", "", lambda each: each.what),
    Quantity("status", "status", "", "", lambda each: each.status),
    Quantity("found", "found", "", "", lambda each: each.found),
)


@dataclass(frozen=True, kw_only=True)
class DoctorCommand(o.PageOptions):
    """Whether this installation can be relied on: versions, solvers, a self-test, the terminal, cores and memory.

    \b
    Examples:
      hdassist doctor
      hdassist doctor --json

    The self-test solves every state of a drive of the library, its extremes again by another solver, and compares with
    stored digits. Exit codes: 0 fine, 5 answers of this installation cannot be trusted.
    """

    def run(self) -> int:
        """Examine the installation; returns the exit code."""
        from hdassist.terminal.runs import give_report

        out = self.open()
        found = [*packages(), *machine(), engine(), cache(), *terminal(), self_test(), library_finding()]
        broken = any(finding.status == "broken" for finding in found)
        code = UntrustedError.exit_code if broken else 0
        give_report(doctor_report(found, code), out, json=self.json)
        if broken:
            wrong = ", ".join(finding.what for finding in found if finding.status == "broken")
            raise UntrustedError(
                f"answers of this installation cannot be trusted: {wrong}",
                "install hdassist anew into a fresh environment",
            )
        return code


def doctor_report(found: Sequence[DoctorFinding], exit_code: int) -> Report:
    """Whether an installation can be relied on: what is broken first, then what is to be noted."""
    from hdassist.report.blocks import Table
    from hdassist.report.report import Report

    broken = ", ".join(each.what for each in found if each.status == "broken")
    worst = sorted(found, key=lambda each: ("broken", "note", "ok").index(each.status))
    return Report(
        command="doctor",
        drive=None,
        head="this installation",
        verdict=f"broken: {broken}" if broken else "fine",
        blocks=(Table.by_row("", FINDING_COLUMNS, worst, words=(0, 1, 2)),),
        values={"findings": [as_object(FINDING_COLUMNS, each) for each in found]},
        exit_code=exit_code,
    )


def packages() -> Iterator[DoctorFinding]:
    """hdassist, Python, and each package it needs."""
    from importlib.metadata import PackageNotFoundError, requires, version  # a fifth of what `hdassist --help` imports

    yield DoctorFinding("hdassist", "ok", f"{__version__}, Python {platform.python_version()}, {platform.platform()}")
    for needed in requires("hdassist") or ():
        name = needed.split(">")[0].split("<")[0].split("=")[0].split(";")[0].strip()
        if "extra ==" in needed:
            continue
        try:
            yield DoctorFinding(name, "ok", f"{version(name)} ({needed} needed)")
        except PackageNotFoundError:
            yield DoctorFinding(name, "broken", f"not installed: {needed} needed")


def machine() -> Iterator[DoctorFinding]:
    """Cores, memory, threads of linear algebra."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    yield DoctorFinding("cores", "ok", f"{cores} that this process may use")
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
        yield DoctorFinding("memory", "ok" if memory >= 1 else "note", f"{memory:.1f} GB")
    except (AttributeError, ValueError, OSError):
        yield DoctorFinding("memory", "note", "not told by this system")
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "")
    yield DoctorFinding(
        "OPENBLAS_NUM_THREADS", "ok" if threads == "1" else "note", f"{threads or 'not set'}; 1 is fastest"
    )


def engine() -> DoctorFinding:
    """Which engine solves the states."""
    from hdassist.solve import walk

    compiled, words = walk.walk_library()
    return DoctorFinding("engine", "ok" if compiled else "note", words)


def cache() -> DoctorFinding:
    """Where answers are kept, how large they are, and how to be rid of them."""
    from hashlib import sha256

    from hdassist.run.cache import FOLDER, NO_CACHE, cache_folder, cached, cached_files, keep, keeps_answers

    folder, key = cache_folder(), sha256(b"doctor").hexdigest()
    keep("doctor", key, b"")
    if cached("doctor", key) is None:
        return DoctorFinding("cache", "note", f"{folder} can't be used: nothing is kept; {FOLDER} names another folder")
    files = cached_files()
    size = f"{len(files)} files, {sum(each for _, each, _ in files) / 1e6:.1f} MB"
    found = f"{folder}, {size}; remove the folder to empty it, {FOLDER} names another one"
    return DoctorFinding(
        "cache", "ok", found if keeps_answers() else f"{found}; {NO_CACHE} is set: no answers are kept"
    )


def terminal() -> Iterator[DoctorFinding]:
    """What standard output shows."""
    from hdassist.terminal.console import Style

    style = Style.of(sys.stdout)
    kind = "a terminal" if sys.stdout.isatty() else "no terminal"
    yield DoctorFinding("output", "ok", f"{kind}, {style.width} columns, encoding {sys.stdout.encoding}")
    plain = "plots in 7-bit characters" if style.ascii else "plots in braille"
    yield DoctorFinding("characters", "ok", f"{plain}, {'colours' if style.codes else 'no colours'}")


def self_test() -> DoctorFinding:
    """Every state of a known drive against stored digits, and its extremes by another solver."""
    from hdassist.error.cycle import kinematic_error
    from hdassist.error.error_map import ErrorMap
    from hdassist.loading.load import load_preset
    from hdassist.model.kinematics import Kinematics, pitch_locked_states

    try:
        drive = load_preset(PRESET)
        found = ErrorMap(drive, M_G).extremes()
        import numpy as np

        states = pitch_locked_states(Kinematics.of(drive), np.array([*found.at_max, *found.at_min]))
        again = kinematic_error(drive, M_G, states=states, solver=CROSS, run=UNCHECKED).range_arcsec
    except HdassistError as error:
        return DoctorFinding("self-test", "broken", error.message)
    off, apart = abs(found.first - STORED_F_IOR), abs(again - found.first)
    told = f"{found.first:.6f} arcsec, {off:.0e} from what is stored; {apart:.0e} by {CROSS}"
    fine = off <= AGREES and apart <= 1e-3 and found.certificate.max_residual <= 1e-8
    return DoctorFinding(
        "self-test", "ok" if fine else "broken", f"{told}; residual {found.certificate.max_residual:.0e}"
    )


def library_finding() -> DoctorFinding:
    """Whether the drives of the library are there."""
    from hdassist.preset.library import preset_names

    names = preset_names()
    return DoctorFinding("presets", "ok" if PRESET in names else "broken", f"{len(names)} drives in the library")
