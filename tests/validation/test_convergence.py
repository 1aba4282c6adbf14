"""Numbers that the answer must not depend on: modes, nodes, window, samples."""

from functools import cache

import numpy as np
import pytest

from hdassist import kinematic_error, load_preset
from hdassist.analysis.extremes import CycleSearch
from hdassist.analysis.self_error import self_error
from hdassist.model import geometry
from hdassist.model.contacts import contact_system
from hdassist.model.kinematics import Kinematics, pitch_locked_states
from tests.support import changed
from tests.validation.case import Case, Kind, about, parameters

TITLE = "Convergence"
ABOUT = "F'_ior of `vzp160` at 80 N·m as it stands, with the model's resolution changed."
FINER = {"numerics__n_max": 80, "numerics__n_2": 200, "numerics__window": 60.0}


@cache
def F_ior(*fields: str) -> float:
    drive = changed(load_preset("vzp160"), **{name: FINER[name] for name in fields})
    return CycleSearch(drive, 80.0).extremes(drive).F_ior_arcsec


def finer(words: str, *fields: str) -> Case:
    return Case(
        f"change of F'_ior with {words}", "arcsec", "default resolution", **about(0, 0.2),
        why="below what is printed as certain", kind=Kind.CONVERGENCE,
        value=lambda: F_ior(*fields) - F_ior(), digits="+.3f",
    )  # fmt: skip


def strided() -> float:
    """Share of F'_ior that every 101st state shows: two cam angles only."""
    drive = load_preset("vzp160")
    states = pitch_locked_states(Kinematics.of(drive), np.arange(0, 20200, 101))
    return kinematic_error(drive, 80.0, states=states, cross_check=None).range_arcsec / F_ior()


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


CASES = [
    finer("n_max 80 for 40, n_2 200 for 100", "numerics__n_max", "numerics__n_2"),
    finer("n_2 200 for 100", "numerics__n_2"),
    finer("a flank window of 60° for 30°", "numerics__window"),
    finer("all of these", *FINER),
    Case(
        "change of a gap below 0.3 mm with ten times the flank samples", "nm", "401 samples", **about(0, 1),
        why="a nanometre is 0.003 arcsec", kind=Kind.CONVERGENCE, value=flank_samples,
    ),
    Case(
        "change of the self error at 800 N·m with 30 x 30 phases for 20 x 20", "arcsec", "numerics.n_phase",
        **about(0, 0.1), why="a finer grid can only find more", kind=Kind.CONVERGENCE, value=phases, digits="+.3f",
        slow=True,
    ),
    Case(
        "share of F'_ior seen by every 101st state", "", "why no state may be left out", 0, 0.95,
        why="a stride meets few cam angles; the search goes by neighbourhood instead", kind=Kind.CONVERGENCE,
        value=strided, digits=".2f",
    ),
]  # fmt: skip


@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case):
    case.check()
