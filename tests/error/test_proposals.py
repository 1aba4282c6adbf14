"""Extremes of many drives that a grid of states proposes, against every state of the cycle."""

import numpy as np
import pytest

from hdassist import kinematic_error, load_preset
from hdassist.drive.error import extremes
from hdassist.drive.error.error_map import Batch, ErrorMap
from hdassist.drive.error.extremes import many_extremes
from hdassist.drive.model.contacts import contact_system
from hdassist.drive.preset.fields import Drive
from hdassist.drive.solve.formulation import formulate
from hdassist.run.run import UNCHECKED
from tests.helpers.process import SMALL

COUNT = 16
MOST = {  # um
    "tolerances.F_i1": 40.0, "tolerances.F_i2": 40.0, "tolerances.e_hb": 30.0, "tolerances.e_hh": 10.0,
    "tolerances.e_b": 2.0, "harmonics.a_b2": 1.0, "harmonics.a_g3": 0.5,
}  # fmt: skip
DIRECTIONS = ("phases.xi_g", "phases.xi_b", "phases.phi_hb", "phases.phi_hh", "phases.phi_eb", "harmonics.xi_b2")


@pytest.fixture(scope="module")
def small() -> Drive:
    return load_preset(SMALL)


@pytest.fixture(scope="module")
def batch(small: Drive) -> Batch:
    rng = np.random.default_rng(3)
    sizes = {path: most * rng.random(COUNT) for path, most in MOST.items()}
    return Batch(small, sizes | {path: 360 * rng.random(COUNT) for path in DIRECTIONS})


@pytest.fixture(scope="module")
def exact(small: Drive, batch: Batch) -> np.ndarray:
    drives = [small.with_values({p: float(v[k]) for p, v in batch.columns.items()}) for k in range(COUNT)]
    return np.array([kinematic_error(d, 1.0, run=UNCHECKED).F_ior_arcsec for d in drives])


@pytest.fixture(autouse=True)
def few_states(monkeypatch) -> None:
    """From grids, though the cycle is short."""
    monkeypatch.setattr(extremes, "SHORT_CYCLE", 0)


def test_they_are_those_of_every_state(small: Drive, batch: Batch, exact: np.ndarray) -> None:
    found = many_extremes(ErrorMap(small, 1.0), batch)
    assert np.abs(found.F_ior_arcsec - exact).max() < 1e-6
    assert found.certificate.states < COUNT * 1860 / 2
    assert found.certificate.max_residual < 1e-8


def test_the_states_are_the_extremes(small: Drive, batch: Batch) -> None:
    found = many_extremes(ErrorMap(small, 1.0), batch.take(np.array([5])))
    drive = small.with_values({p: float(v[5]) for p, v in batch.columns.items()})
    error = kinematic_error(drive, 1.0, run=UNCHECKED)
    assert (found.at_max[0], found.at_min[0]) == (error.at_max, error.at_min)


def test_extremes_are_reproducible_and_independent_of_other_contacts(
    small: Drive, batch: Batch, exact: np.ndarray
) -> None:
    softer = small.with_values({"contact.c_t": 6.6e-5})
    like = ErrorMap(small, 1.0, formulate(contact_system(small)))
    rows = np.array([2, 7])
    found, again = (
        many_extremes(ErrorMap(softer, 1.0, formulate(contact_system(softer)), like=like.fresh), batch.take(rows))
        for _ in range(2)
    )
    assert (found.F_ior_arcsec == again.F_ior_arcsec).all()
    for row, value in zip(rows, found.F_ior_arcsec, strict=True):
        drive = softer.with_values({p: float(v[row]) for p, v in batch.columns.items()})
        assert value == pytest.approx(kinematic_error(drive, 1.0, run=UNCHECKED).F_ior_arcsec, abs=1e-6)
        assert abs(value - exact[row]) > 0.01, "the other stiffness moves it"
