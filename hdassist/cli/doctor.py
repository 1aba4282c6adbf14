"""`hdassist doctor`: whether this installation can be relied on, and the abilities of machine and terminal."""

from __future__ import annotations

import platform
import re
import sys
from collections.abc import Iterator
from dataclasses import asdict, astuple, dataclass
from typing import Literal

from hdassist.errors import HdassistError, UntrustedError
from hdassist.run.run import UNCHECKED, count
from hdassist.terminal import options as o
from hdassist.version import __version__

PRESET, M_G, STORED_F_IOR, AGREES = "vzp160", 800.0, 7.706924145663, 1e-6  # arcsec: of every state, and how near
CROSS = "HIGHS"


@dataclass(frozen=True)
class DoctorFinding:
    """A part of the installation, its status, and the finding in words; broken: there are no trustworthy answers."""

    what: str
    status: Literal["ok", "note", "broken"]
    found: str


@dataclass(frozen=True, kw_only=True)
class DoctorCommand(o.PageOptions):
    """Whether this installation can be relied on: versions, engine, cache, a self-test, cores and the terminal.

    \b
    Examples:
      hdassist doctor
      hdassist doctor --json
      hdassist doctor --empty-cache

    The self-test solves every state of a drive of the library, its extremes again by another solver, and compares with
    stored digits. Exit codes: 0 fine, 5 answers of this installation cannot be trusted.
    """

    empty_cache: bool = False

    def report(self, _out: o.Output, _preset: str) -> o.Report:
        """The installation, examined."""
        from hdassist.report import Report, Table
        from hdassist.run.cache import empty_cache
        from hdassist.terminal.output import complain

        if self.empty_cache:
            empty_cache()
        found = [*packages(), surroundings(), engine(), cache(), self_test()]
        found.sort(key=lambda each: ("broken", "note", "ok").index(each.status))
        broken = ", ".join(each.what for each in found if each.status == "broken")
        error = UntrustedError(
            f"answers of this installation cannot be trusted: {broken}",
            "install hdassist anew into a fresh environment",
        )
        if broken:
            complain(error)
        return Report(
            "doctor", None, "this installation", f"broken: {broken}" if broken else "fine",
            blocks=(Table("", ("part", "status", "found"), tuple(map(astuple, found)), words=(0, 1, 2)),),
            values={"findings": list(map(asdict, found))}, exit_code=error.exit_code if broken else 0,
        )  # fmt: skip


def packages() -> Iterator[DoctorFinding]:
    """hdassist, Python, and each package it needs."""
    from importlib.metadata import PackageNotFoundError, requires, version  # a fifth of imports of `hdassist --help`

    yield DoctorFinding("hdassist", "ok", f"{__version__}, Python {platform.python_version()}, {platform.platform()}")
    for needed in requires("hdassist") or ():
        if "extra ==" in needed:
            continue
        name = re.split("[<>=;]", needed)[0].strip()
        try:
            yield DoctorFinding(name, "ok", f"{version(name)} ({needed} needed)")
        except PackageNotFoundError:
            yield DoctorFinding(name, "broken", f"not installed: {needed} needed")


def engine() -> DoctorFinding:
    """Which engine solves the states."""
    from hdassist.solve import walk

    compiled, words = walk.walk_library()
    return DoctorFinding("engine", "ok" if compiled else "note", words)


def cache() -> DoctorFinding:
    """Where answers are kept, how large they are, and how to be rid of them."""
    from hashlib import sha256

    from hdassist.run import cache as kept

    sizes, key = kept.cached_files(), sha256(b"doctor").hexdigest()
    kept.keep("doctor", key, b"")
    if kept.cached("doctor", key) is None:
        words = kept.why_unsafe() or f"{kept.cache_folder()} can't be used"
        return DoctorFinding("cache", "note", f"{words}: no answers are kept; {kept.FOLDER} names another folder")
    held = f"{kept.cache_folder() / kept.OWN_FOLDER}, {len(sizes)} files, {sum(sizes) / 1e6:.1f} MB"
    way = "--empty-cache removes them" if kept.keeps_answers() else f"{kept.NO_CACHE} is set: no answers are kept"
    return DoctorFinding("cache", "ok", f"{held}; {kept.FOLDER} names another folder, {way}")


def surroundings() -> DoctorFinding:
    """Cores of this machine, and characters that standard output shows."""
    from hdassist.terminal.console import Style

    style = Style.of(sys.stdout)
    kind = "a terminal" if sys.stdout.isatty() else "no terminal"
    shown = f"{style.width} columns, {'7-bit' if style.ascii else 'all'} characters"
    return DoctorFinding("machine", "ok", f"{count(0)} cores; output: {kind}, {shown}")


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
