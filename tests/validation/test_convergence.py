"""Numbers that the answer must not depend on: modes, nodes, window, samples."""

from functools import cache

import numpy as np
import pytest

from hdassist import Drive, kinematic_error, load_preset
from hdassist.drive.error.cycle import self_error
from hdassist.drive.error.error_map import ErrorMap
from hdassist.drive.model import geometry
from hdassist.drive.model.contacts import contact_system
from hdassist.drive.model.geometry import Kinematics, pitch_locked_states
from hdassist.run.run import UNCHECKED
from tests.helpers.support import changed
from tests.validation.case import Case, Kind, about, parameters

TITLE = "Convergence"
ABOUT = (
    "The table gives the change of F'_ior of `vzp160` if the resolution of the model is increased. Three numbers "
    "determine the resolution: the harmonics of the rings (n_max), the nodes between bore and outer ring (n_2), and "
    "the points along a flank."
)
FINER = {"numerics__n_max": 80, "numerics__n_2": 200}


def refined(*fields: str) -> Drive:
    return changed(load_preset("vzp160"), **{name: FINER[name] for name in fields})


@cache
def F_ior(M_g: float, *fields: str) -> float:
    return ErrorMap(refined(*fields), M_g).extremes().first


def finer(words: str, M_g: float, *fields: str) -> Case:
    return Case(
        f"change of F'_ior, {M_g:g} N·m, {words}",
        "arcsec",
        "default resolution",
        **about(0, 0.2),
        why=CERTAIN,
        kind=Kind.CONVERGENCE,
        value=lambda: F_ior(M_g, *fields) - F_ior(M_g),
        digits="+z.3f",
    )


def worst_change(M_g: float) -> float:
    """The change of F'_ior [arcsec] with all of it finer that is greatest in size, over xi_b in steps of 15 deg."""
    usual, fine = ((drive, ErrorMap(drive, M_g)) for drive in (refined(), refined(*FINER)))
    changes = [at_phase(*fine, phase) - at_phase(*usual, phase) for phase in np.arange(0.0, 360.0, 15.0)]
    return max(changes, key=abs)


def at_phase(drive: Drive, search: ErrorMap, phase: float) -> float:
    return search.extremes(changed(drive, phases__xi_b=phase)).first


def strided() -> float:
    """Share of F'_ior that every 101st state shows: two cam angles only."""
    drive = load_preset("vzp160")
    states = pitch_locked_states(Kinematics.of(drive), np.arange(0, 20200, 101))
    return kinematic_error(drive, 80.0, states=states, run=UNCHECKED).range_arcsec / F_ior(80.0)


def flank_samples() -> float:
    """Change of a gap that could close [nm] with ten times the samples along the flank."""
    usual = contact_system(load_preset("vzp160")).delta_p
    near = usual < 0.3  # mm; loads and deviations move nothing so far
    before, geometry.FLANK_SAMPLES = geometry.FLANK_SAMPLES, 10 * (geometry.FLANK_SAMPLES - 1) + 1
    try:
        return float(np.abs(contact_system(load_preset("vzp160")).delta_p - usual)[near].max() * 1e6)
    finally:
        geometry.FLANK_SAMPLES = before


def phases() -> float:
    """Change of the self error at 800 N·m with 1.5 times the phases."""
    drive = load_preset("vzp160")
    return self_error(changed(drive, numerics__n_phase=30), [800.0])[0].range_arcsec - (
        self_error(drive, [800.0])[0].range_arcsec
    )


CERTAIN = "The accepted change is smaller than the stated uncertainty of F'_ior"
CASES = [
    *(
        finer(words, M_g, *fields)
        for M_g in (80.0, 800.0)
        for words, fields in (
            ("n_max 80 instead of 40", ["numerics__n_max"]),
            ("n_2 200 instead of 100", ["numerics__n_2"]),
            ("both changes", FINER),
        )
    ),
    Case(
        "change of F'_ior, 800 N·m, both changes, largest over the mounting phase",
        "arcsec",
        "default resolution",
        **about(0, 0.2),
        why=CERTAIN,
        kind=Kind.CONVERGENCE,
        value=lambda: worst_change(800.0),
        digits="+z.3f",
        slow=True,
    ),
    Case(
        "change of gaps below 0.3 mm, with ten times as many points along a flank",
        "nm",
        "default of 401 points",
        **about(0, 1),
        why="A gap of one nanometre corresponds to 0.003 arcsec",
        kind=Kind.CONVERGENCE,
        value=flank_samples,
    ),
    Case(
        "change of the self error at 800 N·m, with 30 x 30 phases instead of 20 x 20",
        "arcsec",
        "numerics.n_phase",
        **about(0, 0.1),
        why="The self error is the range over a grid of phases, so a finer grid can only increase it",
        kind=Kind.CONVERGENCE,
        value=phases,
        digits="+.3f",
        slow=True,
    ),
    Case(
        "share of F'_ior found if only every 101st mesh position is solved",
        "",
        "no external source",
        0.2,
        0.8,
        why="Every 101st position has one of only two input angles, so part of F'_ior is missed",
        kind=Kind.CONVERGENCE,
        value=strided,
        digits=".2f",
    ),
]


@pytest.mark.thorough
@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case):
    case.check()
