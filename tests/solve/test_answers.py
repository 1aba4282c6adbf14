"""What is kept of states, and what their proof is made of, against the system written out."""

from dataclasses import replace

import numpy as np
import pytest

from hdassist.drive.model.contacts import ROTATION, StateGaps, contact_system
from hdassist.drive.solve.answers import ARCSEC, Certificate, StateSums, proven_answers, residuals
from hdassist.drive.solve.formulation import formulate
from hdassist.drive.solve.loadcase import LoadCase
from hdassist.run.errors import UntrustedError
from tests.helpers.support import compliance, load_case


@pytest.fixture(scope="module")
def system(reference):
    return contact_system(reference)


@pytest.fixture(scope="module")
def formulation(system):
    return formulate(system)


def test_residuals_are_those_of_the_system_written_out(system):
    rng = np.random.default_rng(1)
    forces, free, torque = rng.uniform(-1, 9, len(system.delta_p)), rng.normal(0, 1e-3, 3), -70e3
    forces[rng.random(len(forces)) < 0.5] = 0
    found = residuals(system, system.delta_p[None], torque, forces[None], free[None])
    a, at = np.zeros(9), list(free)
    for k, stiffness in enumerate(system.C):
        a[k] = system.G[:, k] @ forces / stiffness if stiffness else at.pop(0)
    gap = system.delta_p + compliance(system) @ forces + system.G @ a
    most, widest = np.abs(forces).max(), np.abs(system.delta_p).max()
    assert found.shares[0, 0] == pytest.approx(-forces.min() / most)
    assert found.shares[0, 1] == pytest.approx(-gap.min() / widest)
    assert found.shares[0, 2] == pytest.approx(np.abs(gap * forces).max() / (most * widest))
    shares = [
        abs(system.G[:, k] @ forces - system.C[k] * a[k] + torque * (k == ROTATION))
        / (np.abs(system.G[:, k]) @ np.abs(forces) + abs(torque) * (k == ROTATION))
        for k in range(9)
    ]
    assert found.shares[0, 3] == pytest.approx(max(shares))
    # each state has its own
    pushing = np.maximum(forces, 0)
    alone = residuals(system, system.delta_p[None] + 0.2, torque, pushing[None], 2 * free[None])
    both = [np.stack(pair) for pair in ((system.delta_p, system.delta_p + 0.2), (forces, pushing), (free, 2 * free))]
    together = residuals(system, both[0], torque, *both[1:])
    assert together.shares == pytest.approx(np.concatenate([found.shares, alone.shares]))
    assert together.worst == pytest.approx(np.array([found.worst[0], alone.worst[0]]))
    # nothing that pushes: the torque is not held at all
    idle = residuals(system, system.delta_p[None], torque, 0 * forces[None], 0 * free[None])
    assert idle.shares[0, [0, 2, 3]].tolist() == [0, 0, 1]
    assert idle.shares[0, 1] == pytest.approx(-system.delta_p.min() / widest)


def test_stored_state_results_follow_from_the_state_forces(system, formulation):
    torque, n = -300e3, system.n_flanks
    gaps = StateGaps(np.array([[0.0] * 4, [0.03, 0.01, 0.05, -0.02]]))
    forces, free, _ = load_case(formulation, torque).forces(system.delta_p_of(gaps))
    kept = LoadCase(formulation, torque / 1e3).solve(gaps, str)
    assert kept.rotation_arcsec == pytest.approx(free[:, 0] * 180 / np.pi * 3600, abs=1e-8)
    moments = -forces[:, :n] * system.G[:n, ROTATION]  # that the flanks take off the flexspline
    for zone in (0, 1):
        assert kept.zone_share[:, zone] == pytest.approx(moments[:, system.flanks.zone == zone].sum(axis=1) / torque)
    assert kept.zone_share.sum(axis=1) == pytest.approx([1, 1])
    assert kept.tooth_force_N == pytest.approx(forces[:, :n].max(axis=1))


def test_certificates_add_up_to_the_worst_of_both():
    one, other = Certificate(3, 1e-12, 2e-12, 3e-12, 4e-12, 1), Certificate(5, 2e-12, 1e-12, 4e-12, 3e-12, 2)
    both = one + other
    assert both == Certificate(8, 2e-12, 2e-12, 4e-12, 4e-12, 3)
    assert [replace(both, **{name: 1e-9}).max_residual for name in ("negative_force", "equilibrium")] == [1e-9] * 2


def test_wind_up_limit_is_checked_at_the_state_of_maximum(system, formulation):
    torque, gaps = 80e3, StateGaps(np.array([[0.0] * 4, [0.03, 0.01, 0.05, -0.02], [0.0] * 4]))
    rotation = load_case(formulation, torque).forces(system.delta_p_of(gaps))[1][:, 0]
    limit = (rotation[0] + rotation[1]) / 2  # a quarter of a pitch of a wheel with very many teeth
    wheel = replace(system.geometry.flexspline, z=np.pi / 2 / limit)
    fine = replace(system, geometry=replace(system.geometry, flexspline=wheel))
    worst = int(np.argmax(rotation))
    assert worst == 1
    with pytest.raises(UntrustedError, match=f"wind-up of {rotation[worst] * ARCSEC:.0f}″ .* at state {worst}"):
        proven_answers(fine, torque, [load_case(formulation, torque).sums(gaps)], lambda k: f"state {k}")


def test_a_state_without_an_answer_has_no_residual(system, formulation):
    delta_p = system.delta_p_of(StateGaps(np.zeros((3, 0))))
    forces, free, _ = load_case(formulation, 80e3).forces(delta_p)
    forces[1:], free[1:] = np.nan, np.nan
    hopeless = StateSums.of(system, delta_p, 80e3, forces, free)
    with pytest.raises(UntrustedError, match="the mesh position could not be solved at state 1: no method converges"):
        proven_answers(system, 80e3, [hopeless], lambda k: f"state {k}")
