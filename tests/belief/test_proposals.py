"""Draws nearer the evidence: fewer of them, and the same weighted statistics as draws from the prior."""

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.belief import draws, proposals
from hdassist.belief.evidence import STIFFNESS_FIGURES, Evidence, log_likelihood, stiffness_figures
from hdassist.belief.prior import prior_of
from hdassist.belief.proposals import PILOT_DRAWS, Proposal, proposal_of
from hdassist.belief.samples import SamplingEffort, draw_samples
from hdassist.belief.statistics import weighted_quantile
from tests.helpers.process import TINY

W_0 = "source.cam.W_0={kind: assumed, range: [1.6, 1.8], ref: judged}"
J_N = "source.gears.j_n={kind: assumed, range: [16, 20], ref: judged}"
K_1 = Evidence("catalogue.K_1", "K_1", 1.0, 0.1)
EFFORT = SamplingEffort(24, 24, 1024, 16)


def pilot(K_1_of, count=PILOT_DRAWS, fields=5):
    """First draws whose stiffness depends on their shares, shape (draws, fields + 1), alone."""
    shares = np.random.default_rng(4).random((count, fields + 1))
    figures = [dict.fromkeys(STIFFNESS_FIGURES, float(K_1_of(*row))) for row in shares]
    return shares, figures


def test_a_proposal_draws_by_its_density():
    found = Proposal(1, (0.5, 0.5, 1.0, 2.0))
    shares = np.stack([np.zeros(4000), (np.arange(4000) + 0.5) / 4000, np.ones(4000)], axis=1)
    moved, density = found.drawn(shares)
    assert np.array_equal(moved[:, [0, 2]], shares[:, [0, 2]])  # left alone
    assert np.histogram(moved[:, 1], 4, (0, 1))[0] == pytest.approx([500, 500, 1000, 2000], abs=2)
    assert np.array_equal(density, np.repeat([0.5, 0.5, 1.0, 2.0], [500, 500, 1000, 2000]))
    # the mean of any function is that of the prior: a draw counts one over its density
    assert np.mean(moved[:, 1] ** 2 / density) == pytest.approx(1 / 3, abs=1e-3)


def test_the_field_that_decides_is_drawn_where_the_evidence_is():
    shares, figures = pilot(lambda *x: 0.5 + x[3] + 0.1 * x[0])  # 1 in the middle of the field
    found = proposal_of(shares, (K_1,), figures)
    assert found.field == 3
    assert np.mean(found.density) == pytest.approx(1)
    assert min(found.density) >= proposals.LEAST_DENSITY * (1 - 1e-12)
    assert found.density[7] > 1.3 > 0.7 > found.density[0]


def test_no_field_is_preferred_where_none_explains_the_likelihood():
    noise = np.random.default_rng(1)
    assert proposal_of(*_with(lambda *x: np.exp(0.3 * noise.standard_normal()))) is None
    assert proposal_of(*_with(lambda *x: 1.0)) is None
    shares, figures = pilot(lambda *x: 0.5 + x[3])
    assert proposal_of(shares, (K_1,), [{} for _ in figures]) is None


def _with(K_1_of):
    shares, figures = pilot(K_1_of)
    return shares, (K_1,), figures


@pytest.mark.thorough
def test_draws_nearer_the_evidence_are_fewer_and_say_the_same(monkeypatch):
    drive = load_preset(TINY, ["operation.M_g=4", W_0, J_N])
    prior = prior_of(drive)
    there = drive.with_values({"cam.W_0": 1.62})
    evidence = (Evidence("catalogue.K_1", "K_1", stiffness_figures(there)[0]["K_1"], 0.05),)
    near = draw_samples(prior, (4.0,), evidence=evidence, effort=EFFORT)
    monkeypatch.setattr(draws, "proposed_draws", _plain)
    plain = draw_samples(prior, (4.0,), evidence=evidence, effort=EFFORT)
    assert near.draws < 0.8 * plain.draws
    # every one of many draws, with its likelihood for a weight
    shares = prior.shares(256, seed=5)
    figures = [stiffness_figures(drive.with_values(each))[0] for each in prior.values(shares)]
    weights = np.exp([log_likelihood(evidence, each) for each in figures])
    for k in range(2):
        mean = weights @ shares[:, k] / weights.sum()
        error = np.sqrt(weights @ (shares[:, k] - mean) ** 2 / weights.sum() / near.effective)
        assert near.weights @ near.shares[:, k] / near.weights.sum() == pytest.approx(mean, abs=3 * error)
        middle = weighted_quantile(shares[:, k], weights, 0.5)
        assert weighted_quantile(near.shares[:, k], near.weights, 0.5) == pytest.approx(middle, abs=4 * error)
    # the sum of weights over the draws is the mean likelihood, however they were drawn
    assert near.weights.sum() / near.draws == pytest.approx(weights.mean(), rel=0.35)


def _plain(prior, evidence, pilot, first, last, seed):
    return prior.shares(last, seed)[first:], np.ones(last - first)
