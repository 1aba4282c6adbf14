"""Several sets of deviations on the contact system of a sample: F'_ior as mounted is stated over all of them."""

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.belief.draws import _SETS, Sampling
from hdassist.belief.evidence import evidence_of
from hdassist.belief.prior import prior_of
from hdassist.belief.samples import SamplingEffort, deviation_sets, draw_samples
from hdassist.belief.statistics import probability_of, probability_of_systems
from hdassist.drive.error.error_map import ErrorMap
from tests.helpers.process import TINY
from tests.helpers.support import PROVEN

OPEN = ("source.supports.C_3={kind: assumed, range: [1000, 8000], ref: judged}", "operation.M_g=4")
UNKNOWN = (*OPEN, "phases.xi_b=unknown", "tolerances.e_hb=unknown")


def test_sets_share_the_contact_system_and_differ_in_their_deviations():
    prior = prior_of(load_preset(TINY, UNKNOWN))
    sampling = Sampling(prior, (4.0,), sets=3)
    shares = prior.shares(1)
    (draw,) = sampling.solved(0, prior.values(shares)[0], shares[0].tolist(), 1.0)
    assert len(draw.sets_arcsec) == 2 and draw.set_weights == (1.0, 1.0)
    of_set = np.random.default_rng([0, 0, _SETS]).random((2, len(sampling._set_places)))
    for random, F_ior in zip(of_set, draw.sets_arcsec, strict=True):
        own = np.array([draw.shares])
        own[0, sampling._set_places] = random
        values = prior.values(own)[0]
        assert values["supports.C_3"] == prior.values(shares)[0]["supports.C_3"]
        drive = prior.drive.with_values(values)
        assert F_ior[0] == pytest.approx(ErrorMap(drive, 4.0).extremes(drive).first, abs=PROVEN)


def test_reference_data_weigh_each_set_by_itself():
    drive = load_preset(TINY, (*UNKNOWN, "catalogue.accuracy=15", "operation.rated=50"))
    prior = prior_of(drive)
    samples = draw_samples(prior, (4.0,), evidence=evidence_of(drive), effort=SamplingEffort(4, 4, 8, 4), sets=4)
    assert samples.set_weights.shape == (len(samples.weights), 4)
    assert (samples.set_weights[:, 0] == samples.weights).all()
    assert (samples.sets_arcsec[:, 0] == samples.F_ior_arcsec).all()
    assert (np.ptp(samples.set_weights, axis=1) > 0).any()


def test_percentiles_and_probability_are_those_of_all_sets():
    prior = prior_of(load_preset(TINY, UNKNOWN))
    samples = draw_samples(prior, (4.0,), effort=SamplingEffort(16, 16, 16, 16), sets=4)
    F_ior = samples.sets_arcsec[:, :, 0]
    limit = float(np.median(F_ior))
    assert samples.percentile(0.5, 0) == pytest.approx(np.quantile(F_ior, 0.5, method="hazen"))
    kept = samples.probability_within(limit, 0)
    assert kept.value == pytest.approx(np.mean(F_ior <= limit))
    of_one = probability_of(samples.F_ior_arcsec[:, 0] <= limit, samples.weights)
    assert kept.high - kept.low < of_one.high - of_one.low


def test_holes_that_differ_are_compared_by_one_set():
    assert deviation_sets(load_preset(TINY, UNKNOWN)) == 4
    assert deviation_sets(load_preset(TINY, (*OPEN, "phases.xi_b=90", "mounting.holes=6"))) == 1


def test_interval_of_systems_equals_that_of_samples_if_sets_agree():
    rng = np.random.default_rng(1)
    inside = (rng.random(30) < 0.7).astype(float)
    weights = rng.random(30)
    one = probability_of(inside, weights)
    systems = probability_of_systems(inside, weights)
    assert (systems.value, systems.low, systems.high) == pytest.approx((one.value, one.low, one.high))


def test_the_interval_of_systems_covers_where_their_sets_are_alike():
    """Of 400 experiments with 30 systems of four sets each, 90 % of the intervals hold the truth."""
    rng = np.random.default_rng(2)
    covered = 0
    for _ in range(400):
        of_system = rng.beta(1, 1, 30)  # chance of an outcome, the same in all sets of a system
        shares = rng.binomial(4, of_system) / 4
        kept = probability_of_systems(shares, np.ones(30))
        covered += kept.low <= 0.5 <= kept.high
    assert 0.86 <= covered / 400 <= 0.95
