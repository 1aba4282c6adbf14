"""States that another solver has solved again are not solved a third time, and a file alone is not believed."""

import json
from hashlib import sha256

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.model.contacts import contact_system
from hdassist.drive.solve import loadcase
from hdassist.drive.solve.formulation import formulate
from hdassist.drive.solve.loadcase import solve_again
from hdassist.run import kept
from tests.helpers.process import TINY, keep_answers
from tests.helpers.support import load_case

M_G = 4.0  # N*m


@pytest.fixture
def again(tmp_path, monkeypatch):
    """Solve a state again, with a rotation that is off by so much [arcsec]; and the differences that were computed."""
    keep_answers(tmp_path, monkeypatch)
    formulation = formulate(contact_system(load_preset(TINY)))
    delta_p = formulation.system.delta_p[None]
    _, free, _ = load_case(formulation, M_G * 1e3).forces(delta_p)
    rotation = free[:, formulation.system.free_rotation] * loadcase.ARCSEC
    computed = []
    difference = loadcase._difference
    monkeypatch.setattr(loadcase, "_difference", lambda *args: computed.append(args) or difference(*args))

    def solved(off=0.0, solver="highs"):
        return solve_again(formulation, np.array([M_G]), delta_p, rotation + off, solver, str), len(computed)

    return solved


def test_the_same_states_are_solved_again_once(again, monkeypatch):
    first, count = again()
    assert (first.solver, first.states, count) == ("HIGHS", 1, 1)
    assert again() == (first, 1)
    assert again(off=1e-6)[1] == 2  # another rotation is another question
    assert again(solver="clarabel")[1] == 3
    assert again(solver="osqp")[1] == 4
    assert again(solver="osqp")[1] == 5  # its version is not ours to know
    monkeypatch.setenv(kept.NO_CACHE, "1")
    assert again()[1] == 6


@pytest.mark.parametrize(
    "change",
    [{"states": 2}, {"max_difference_arcsec": 0.1}, {"max_difference_arcsec": None}, {"solver": "MINE"}, {"x": 1}],
)
def test_a_forged_outcome_is_not_believed(again, change, tmp_path):
    first, _ = again()
    (path,) = tmp_path.rglob("again-*")
    key, _, data = path.read_bytes().partition(b" ")
    data = json.dumps(json.loads(data.partition(b"\n")[2]) | change).encode()
    path.write_bytes(key + b" " + sha256(data).hexdigest().encode() + b"\n" + data)
    assert again() == (first, 2)
    assert again() == (first, 2)  # and kept again
