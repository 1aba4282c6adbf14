"""The belief in a drive: against distributions that are known in closed form, and against samples taken another way."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import beta, norm, qmc

from hdassist import load_preset
from hdassist.belief.draws import KEPT_LIKELIHOOD, turn_of_test_deg
from hdassist.belief.evidence import Evidence, evidence_of, log_likelihood, stiffness_figures
from hdassist.belief.prior import TEETH_CORRELATION, prior_of
from hdassist.belief.samples import Samples, SamplingEffort, draw_samples
from hdassist.belief.statistics import (
    effective_number,
    probability_by_share,
    probability_of,
    weighted_quantile,
)
from hdassist.belief.steps import columns_of, influences, measurements, shares_of_variance
from hdassist.drive.error.extremes import extremes_of
from hdassist.drive.error.stiffness import stiffness
from hdassist.drive.model.deviations import unknowns
from hdassist.features.calibration import CalibrationTarget, predictions
from hdassist.features.mounting.positions import rotated
from hdassist.run.errors import UntrustedError, Verdict, percent_text, verdict_by_probability
from hdassist.run.run import Run
from tests.helpers.process import TINY
from tests.helpers.support import PROVEN

C_3 = "source.supports.C_3={kind: assumed, range: [1000, 8000], ref: judged}"
J_N = "source.gears.j_n={kind: assumed, range: [16, 20], ref: judged}"
FEW = SamplingEffort(effective=8, settling_draws=16, most_draws=64, batch=8)


def tiny(*overrides: str):
    return load_preset(TINY, ["operation.M_g=4", *overrides])


def fields_of(*overrides: str):
    return {each.path: each for each in prior_of(tiny(*overrides)).fields}


def test_each_field_has_the_distribution_that_its_preset_gives_it():
    found = fields_of(C_3, J_N, "phases.xi_b=90±8", "tolerances.e_b=unknown", "phases.phi_eb=unknown")
    assert {path: each.distribution for path, each in found.items()} == {
        "gears.j_n": "even", "supports.C_3": "logarithmic", "phases.xi_b": "normal", "tolerances.e_b": "even",
        "phases.phi_eb": "even",
    }  # fmt: skip
    share = np.array([0.0, 0.5, 1.0])
    assert found["gears.j_n"].value(share) == pytest.approx([16, 18, 20])
    assert found["supports.C_3"].value(share) == pytest.approx([1000, np.sqrt(8e6), 8000])
    assert found["phases.xi_b"].value(norm.cdf([-1.0, 0.0, 1.0])) == pytest.approx([86, 90, 94])
    assert found["phases.phi_eb"].group == "tolerances.e_b"
    assert fields_of() == {}


def test_half_of_the_wheels_have_fine_teeth():
    prior = prior_of(load_preset("size-17-100"))
    of_teeth = [field for field in prior.fields if field.distribution == "teeth"]
    assert [field.path for field in of_teeth] == ["tolerances.f_p1", "tolerances.f_p2"]
    high = of_teeth[0].high
    assert of_teeth[0].value(np.array([0, 0.25, 0.5, 0.75, 1])) == pytest.approx(np.array([0, 1, 2, 9, 16]) / 16 * high)
    columns = prior.columns(prior.shares(8192))
    f_p1, f_p2 = (columns[field.path] / field.high for field in of_teeth)
    for f_p in f_p1, f_p2:  # each wheel alone has the distribution of the prior
        assert np.mean(f_p < 1 / 8) == pytest.approx(0.5, abs=0.01)
        assert np.quantile(f_p, [0.25, 0.75]) == pytest.approx([1 / 16, 9 / 16], abs=0.01)
        assert np.sqrt(np.mean(f_p**2)) * high == pytest.approx(of_teeth[0].root_mean_square, rel=0.01)
    # Sheppard: two normal numbers with the correlation R have equal signs with the probability 1/2 + arcsin(R) / pi
    both = np.mean((f_p1 < 1 / 8) == (f_p2 < 1 / 8))
    assert both == pytest.approx(0.5 + np.arcsin(TEETH_CORRELATION) / np.pi, abs=0.015)


def test_an_assumed_range_of_pitch_deviations_from_zero():
    stated = "source.tolerances.f_p1={kind: assumed, range: [0, 8], ref: judged}"
    assert fields_of("tolerances.f_p1=4", stated)["tolerances.f_p1"].distribution == "teeth"
    from_two = stated.replace("[0, 8]", "[2, 8]")
    assert fields_of("tolerances.f_p1=4", from_two)["tolerances.f_p1"].distribution == "even"


def test_uncertainty_overrides_an_assumed_range_and_set_overrides_both():
    assert fields_of(J_N, "gears.j_n=18±1")["gears.j_n"].distribution == "normal"
    assert fields_of("gears.j_n=18") == {}
    assert list(fields_of(J_N, "gears.j_n=18")) == ["gears.j_n"]  # a range that is stated beside the value counts


def test_deviation_size_that_may_exceed_zero_has_a_direction():
    deviation_sizes = "source.tolerances.e_b={kind: assumed, range: [0, 10], ref: judged}"
    assert list(fields_of(deviation_sizes, "phases.phi_eb=unknown")) == ["tolerances.e_b", "phases.phi_eb"]


def test_a_field_is_the_designs_the_drives_or_its_assemblys():
    unknown = [f"{path}=unknown" for path in ("tolerances.e_hb", "phases.phi_hb", "tolerances.F_i1")]
    found = fields_of(C_3, J_N, *unknown)
    assert {path: each.owner for path, each in found.items()} == {
        "gears.j_n": "drive", "supports.C_3": "design", "tolerances.F_i1": "drive", "tolerances.e_hb": "assembly",
        "phases.phi_hb": "assembly",
    }  # fmt: skip


def test_uncertain_value_is_sampled_only_within_its_field_range():
    found = fields_of("uncertainty.phases.xi_b=10", "tolerances.e_hh=2", "uncertainty.tolerances.e_hh=4")
    shares = np.array([0.022750131948, 0.5, 0.977249868052])  # of a normal distribution below -2, 0 and 2
    middle = load_preset(TINY).phases.xi_b
    assert found["phases.xi_b"].value(shares) == pytest.approx([middle - 10, middle, middle + 10])
    assert found["tolerances.e_hh"].value(shares) == pytest.approx([0, 2, 6])  # not -2


def test_further_draws_keep_the_first_and_fill_every_range():
    prior = prior_of(tiny(C_3, J_N, "tolerances.e_b=unknown"))
    many = prior.shares(512, seed=3)
    assert np.array_equal(prior.shares(20, seed=3), many[:20])  # integers over a power of 2
    assert not np.array_equal(prior.shares(20, seed=4), many[:20])
    cells = np.sort((many * 512).astype(int), axis=0)  # one draw in each 512th of every range
    assert np.array_equal(cells, np.tile(np.arange(512)[:, None], many.shape[1]))


def test_weights_give_the_posterior_of_a_linear_gaussian_model():
    # x normal around 0 with 1, measured 1.2 with a standard uncertainty of 0.5: normal around 0.96 with sqrt(0.2)
    x = norm.ppf(qmc.Sobol(1, seed=1).random_base2(14).ravel())
    weights = norm.pdf((1.2 - x) / 0.5)
    posterior = norm(0.96, np.sqrt(0.2))
    for share in (0.05, 0.5, 0.95):
        assert weighted_quantile(x, weights, share) == pytest.approx(posterior.ppf(share), abs=2e-3)
    assert probability_of(x <= 1.0, weights).value == pytest.approx(posterior.cdf(1.0), abs=2e-3)
    # effective share in closed form: (E w)^2 / E w^2
    mean = norm(0, np.sqrt(1.25)).pdf(1.2)
    square = norm(0, np.sqrt(1.125)).pdf(1.2) / (2 * 0.5 * np.sqrt(np.pi))
    assert effective_number(weights) / len(x) == pytest.approx(mean**2 / square, rel=1e-3)


def test_weighted_percentiles_agree_with_numpy_for_equal_and_integer_weights():
    rng = np.random.default_rng(0)
    values = rng.random(2000)
    for share in (0.05, 0.5, 0.95):
        expected = np.quantile(values, share, method="hazen")
        assert weighted_quantile(values, np.ones(2000), share) == pytest.approx(expected, abs=1e-12)
    counts = rng.integers(1, 5, 2000)
    repeated = np.quantile(np.repeat(values, counts), 0.8, method="hazen")
    assert weighted_quantile(values, counts.astype(float), 0.8) == pytest.approx(repeated, abs=1e-3)


def test_reference_data_are_likeliest_at_their_value_with_heavy_tails():
    near = Evidence("catalogue.K_2", "K_2", 5e4, 0.15)
    assert near.log_likelihood(5e4) == 0
    assert near.log_likelihood(5e4 * 1.1) == pytest.approx(near.log_likelihood(5e4 / 1.1))
    at_2 = -0.5 * (np.log(2) / 0.15) ** 2  # the logarithm of a normal density
    assert near.log_likelihood(1e5) > at_2 / 2
    limit = Evidence("catalogue.lost_motion", "lost_motion", 60.0, 0.25, "limit")
    assert np.array_equal(limit.log_likelihood(np.array([1.0, 60.0])), [0, 0])
    assert limit.log_likelihood(75.0) == pytest.approx(-2.5 * np.log(1.25))


def test_a_catalogue_is_evidence():
    drive = tiny("catalogue.K_1=2e3", "catalogue.K_3=4e3", "catalogue.accuracy=60", "catalogue.lost_motion=90")
    found = {each.path: (each.spread, each.kind) for each in evidence_of(drive)}
    assert found == {
        "catalogue.K_1": (0.3, "ratio"), "catalogue.K_3": (0.15, "ratio"), "catalogue.lost_motion": (0.25, "limit"),
        "catalogue.accuracy": (0.25, "limit"),
    }  # fmt: skip
    assert evidence_of(tiny()) == ()


def test_stiffness_is_that_of_the_weaker_side():
    drive = tiny("bearing.beta=0.25")  # balls beside the axes: the two sides differ
    found, figures = stiffness(drive, points=1), stiffness_figures(drive)[0]
    for k in (1, 2, 3):
        one, other = (side[k - 1].stiffness for side in (found.positive, found.negative))
        assert abs(one / other - 1) > 0.01
        asked = CalibrationTarget(f"K_{k}", {}, one, one, one, 1.0)
        assert [figures[f"K_{k}"], *predictions(drive, [asked])] == pytest.approx([min(one, other)] * 2)


def test_samples_are_independent_of_workers_and_extend_earlier_ones():
    drive = tiny(C_3, J_N, "phases.phi_hb=unknown")
    prior = prior_of(drive)
    few = draw_samples(prior, (4.0,), effort=FEW, run=Run(seed=2))
    solved: list[int] = []
    with ThreadPoolExecutor(2) as executor:
        more = draw_samples(prior, (4.0,), effort=replace(FEW, effective=16), run=Run(executor, solved.append, seed=2))
    assert (few.draws, more.draws, few.effective) == (8, 16, pytest.approx(8))
    assert more.F_ior_arcsec[:8] == pytest.approx(few.F_ior_arcsec, abs=PROVEN)
    assert sum(solved) == more.certificate.states
    assert more.certificate.max_residual <= 1e-8


def test_draws_go_on_until_they_are_enough_or_the_most():
    prior = prior_of(tiny("phases.phi_hb=unknown"))
    assert draw_samples(prior, (4.0,), effort=FEW, enough=lambda samples: samples.draws >= 16).draws == 16
    assert draw_samples(prior, (4.0,), effort=FEW, enough=lambda _: False).draws == 16  # the most


def test_sampling_stops_early_if_few_draws_are_effective():
    drive = tiny("source.cam.W_0={kind: assumed, range: [1.6, 1.8], ref: judged}")
    evidence = (Evidence("catalogue.K_1", "K_1", stiffness_figures(drive)[0]["K_1"], 0.02),)
    effort = SamplingEffort(effective=4, settling_draws=32, most_draws=64, batch=16)
    samples = draw_samples(prior_of(drive), (4.0,), evidence=evidence, effort=effort, enough=lambda _: False)
    assert samples.effective < samples.draws == 32


def test_draws_that_are_no_drive_are_counted():
    wide = "source.cam.W_0={kind: assumed, range: [1.2, 3], ref: judged}"
    samples = draw_samples(prior_of(tiny(wide)), (4.0,), effort=FEW)
    assert sum(samples.refused.values()) == samples.draws - len(samples.weights) > 0
    assert any(reason.startswith("cam.W_0: ") for reason in samples.refused)


def test_weeding_by_stiffness_leaves_the_posterior_as_it_is():
    drive = tiny("source.cam.W_0={kind: assumed, range: [1.6, 1.8], ref: judged}")
    evidence = (Evidence("catalogue.K_1", "K_1", stiffness_figures(drive)[0]["K_1"], 0.02),)
    prior = prior_of(drive)
    samples = draw_samples(prior, (4.0,), evidence=evidence, effort=SamplingEffort(10, 10, 64, 64))
    # every draw, with its likelihood for a weight
    values = prior.values(prior.shares(64))
    figures = [stiffness_figures(drive.with_values(each))[0] for each in values]
    weights = np.exp([log_likelihood(evidence, each) for each in figures])
    assert len(samples.weights) < 50
    assert samples.weights.min() >= KEPT_LIKELIHOOD * (1 - 1e-12)
    assert samples.weights.sum() == pytest.approx(weights.sum(), rel=0.1)
    every = np.array([each["cam.W_0"] for each in values])
    kept = prior.fields[0].value(samples.shares[:, 0])
    for share in (0.25, 0.5, 0.75):
        expected = weighted_quantile(every, weights, share)
        assert weighted_quantile(kept, samples.weights, share) == pytest.approx(expected, abs=0.01)


@pytest.mark.thorough
def test_draws_that_all_agree_alike_badly_are_kept():
    """A figure that no draw comes near leaves them as they are: without that, one of 40 would go on to F'_ior."""
    drive = tiny("source.cam.W_0={kind: assumed, range: [1.6, 1.8], ref: judged}")
    far = Evidence("catalogue.K_1", "K_1", 1e3 * stiffness_figures(drive)[0]["K_1"], 1.8)
    effort = SamplingEffort(32, 32, 256, 64)
    samples = draw_samples(prior_of(drive), (4.0,), evidence=(far,), effort=effort)
    best = np.exp(max(log_likelihood((far,), each.figures) for each in samples.made[:64]))
    assert 0.01 < best < 0.03
    later = [each for each in samples.made[64:] if each.weight]
    assert len(later) > 0.5 * len(samples.made[64:])
    assert max(each.weight for each in later) < 3 * best


@pytest.mark.parametrize("wrong", ["K_2", "accuracy"])
def test_evidence_that_contradicts_is_named(wrong):
    drive = tiny("phases.phi_hb=unknown")
    figures = stiffness_figures(drive)[0] | {"accuracy": 100.0}  # it is 12 at 2 % of the rated torque
    said = {name: figures[name] / (30 if name == wrong else 1) for name in ("K_1", "K_2", "lost_motion", "accuracy")}
    evidence = evidence_of(tiny(*(f"catalogue.{name}={value!r}" for name, value in said.items())))
    with pytest.raises(UntrustedError, match=rf"catalogue\.{wrong} = .* contradicts"):
        draw_samples(prior_of(drive), (4.0,), evidence=evidence, effort=replace(FEW, effective=16, most_draws=16))


def test_ranges_without_a_drive_are_named():
    prior = prior_of(tiny("source.cam.W_0={kind: assumed, range: [1.7, 3], ref: judged}"))
    beyond = replace(prior, fields=(replace(prior.fields[0], low=2.6),))
    with pytest.raises(
        UntrustedError,
        match=r"effective sample size 0 from 8 samples, 8 required; 8 samples are not valid drives \(most .*: cam\.W_0",
    ):
        draw_samples(beyond, (4.0,), effort=replace(FEW, most_draws=8))


@pytest.mark.parametrize(
    ("hits", "verdict", "stable"),
    [
        (64, Verdict.PASS, True), (62, Verdict.PASS, False), (60, Verdict.INCONCLUSIVE, False),
        (50, Verdict.INCONCLUSIVE, True), (2, Verdict.FAIL, False), (0, Verdict.FAIL, True),
    ],
)  # fmt: skip
def test_probability_decides_and_sampling_continues_until_it_is_stable(hits, verdict, stable):
    found = probability_of(np.arange(64) < hits, np.ones(64))
    assert found.low <= found.value == hits / 64 <= found.high
    assert verdict_by_probability(found.value) is verdict
    assert found.is_stable() is stable
    assert verdict_by_probability(0.9989, sure=0.999) is Verdict.INCONCLUSIVE


@pytest.mark.parametrize(
    ("kept", "right", "draws"), [(0.8, 0.99, 70), (0.9, 0.97, 100), (0.97, 0.95, 180), (0.995, 0.99, 75)]
)
def test_verdicts_are_those_of_the_true_probability_with_few_draws(kept, right, draws):
    """Draws of 16 at a time, 64 to 1024 of them, until as many again would hardly change it: the rule of samples."""
    looks, rng, used, verdicts = range(64, 1025, 16), np.random.default_rng(5), [], []
    for _ in range(200):
        inside = np.cumsum(rng.random(1024) < kept)
        found = (probability_by_share(inside[count - 1] / count, count) for count in looks)
        count, last = next((c, p) for c, p in zip(looks, found, strict=True) if c == 1024 or p.is_stable())
        used.append(count)
        verdicts.append(verdict_by_probability(last.value))
    assert np.mean([each is verdict_by_probability(kept) for each in verdicts]) >= right
    assert np.mean(used) < draws


@pytest.mark.parametrize("heavy", [0.0, 0.4, -0.4])
@pytest.mark.parametrize("share", [0.5, 0.9, 0.95])
def test_probability_interval_contains_the_truth_for_any_sample_weights(heavy, share):
    """Normal samples weighted to a normal distribution elsewhere: those beyond the limit are heavy, alike or light."""
    rng, limit = np.random.default_rng(1), norm.ppf(share) + heavy
    found = [probability_of(x <= limit, np.exp(heavy * x)) for x in rng.standard_normal((1500, 256))]
    too_high, too_low = np.mean([(each.low > share, each.high < share) for each in found], axis=0)
    assert max(too_high, too_low) < 0.07  # 5 % beyond each end, and two standard errors of 1500 tries
    assert all(each.low <= each.value <= each.high for each in found)


@pytest.mark.parametrize(("hits", "of"), [(61, 64), (240, 256), (55, 64)])
def test_as_many_samples_again_change_a_stable_verdict_hardly_ever(hits, of):
    """The share of the further samples is any that the first ones leave likely."""
    rng = np.random.default_rng(4)
    more = rng.binomial(of, rng.beta(hits + 0.5, of - hits + 0.5, 4000))
    now, then = verdict_by_probability(hits / of), [verdict_by_probability(k) for k in (hits + more) / (2 * of)]
    changed = np.mean([each is not now for each in then])
    assert (changed < 0.07) == probability_by_share(hits / of, of).is_stable()


def test_verdict_needs_at_most_512_samples():
    assert [probability_by_share(0.95, count).is_stable() for count in (256, 512)] == [False, True]


def test_interval_of_equally_weighted_samples_is_that_of_jeffreys():
    found = probability_of(np.arange(80) < 74, np.full(80, 0.3))
    assert (found.low, found.high) == pytest.approx(beta(74.5, 6.5).ppf([0.05, 0.95]))
    all_inside = probability_of(np.arange(80) < 80, np.full(80, 0.3))
    assert (all_inside.low, all_inside.high) == pytest.approx((beta(80.5, 0.5).ppf(0.05), 1))


def test_shares_of_the_variance_are_those_of_a_linear_model():
    rng = np.random.default_rng(2)
    x = {f"x{k}": rng.standard_normal((3000, 1)) for k in range(8)}
    y = (3 * x["x0"] + 2 * x["x3"] + rng.standard_normal((3000, 1)) * np.sqrt(3)).ravel()
    found = {each.group: each.share for each in shares_of_variance(x, y, np.ones(3000))}
    assert found == pytest.approx({"x0": 9 / 16, "x3": 4 / 16}, abs=0.03)
    assert shares_of_variance(x, np.ones(3000), np.ones(3000)) == ()


@pytest.fixture(scope="module")
def by_C_3():
    """Samples whose F'_ior is decided by C_3 alone, but for a little chance."""
    samples = draw_samples(prior_of(tiny(C_3, J_N, "phases.phi_hb=unknown")), (4.0,), effort=FEW)
    shares = qmc.Sobol(3, seed=1).random_base2(8)
    k = [each.path for each in samples.prior.fields].index("supports.C_3")
    F_ior = 20 * np.exp(shares[:, k] + 0.05 * np.random.default_rng(0).standard_normal(256))
    return replace(samples, shares=shares, F_ior_arcsec=F_ior[:, None], weights=np.ones(256))


def test_dominant_input_has_the_largest_contribution_and_is_measured_first(by_C_3):
    (first,) = influences(by_C_3, 0)
    assert first.group == "supports.C_3"
    assert first.share > 0.9
    found = {each.measured: each.gain for each in measurements(by_C_3, 0)}
    assert set(found) == {"supports.C_3"}
    assert 0.6 < found["supports.C_3"] < 1  # all but a little of the spread


@pytest.mark.parametrize(("f_p", "columns"), [("unknown", 2), ("5", 0)])
def test_single_tooth_deviations_contribute_by_size_never_by_phase_alone(f_p, columns):
    samples = draw_samples(prior_of(tiny(C_3, f"tolerances.f_p1={f_p}")), (4.0,), effort=FEW)
    assert columns_of(samples, samples.shares, "tolerances.f_p1").shape == (len(samples.shares), columns)
    assert {each.group for each in influences(samples, 0)} <= {"supports.C_3", "tolerances.f_p1"}
    assert {each.measured for each in measurements(samples, 0)} <= {"supports.C_3", "tolerances.f_p1"}


def test_a_drive_without_error_is_weighed_like_any_other(by_C_3):
    F_ior = by_C_3.F_ior_arcsec.copy()
    F_ior[3] = 0.0  # of a tiny drive
    none = replace(by_C_3, F_ior_arcsec=F_ior)
    assert influences(none, 0)[0].group == "supports.C_3"
    assert all(np.isfinite(each.gain) for each in measurements(none, 0))


def test_the_interval_of_a_percentile_holds_the_true_one(by_C_3):
    rng = np.random.default_rng(3)
    inside = []
    for _ in range(100):
        some = replace(by_C_3, F_ior_arcsec=rng.standard_normal((256, 1)) + 10)
        inside.append(abs(some.percentile(0.95, 0) - norm.ppf(0.95) - 10) < 1.96 * some.percentile_error(0.95, 0))
    assert sum(inside) >= 85


def test_a_probability_is_of_the_first_samples_that_settle_it(by_C_3):
    """Samples that are drawn on for another question have no part in it."""

    def first(count: int) -> Samples:
        return replace(by_C_3, F_ior_arcsec=F_ior[:count], weights=np.ones(count), stages=())

    F_ior = np.array([[10.0]] * 60 + [[30.0]] * 60)
    stages = tuple(map(first, (20, 60, 120)))
    samples = replace(stages[-1], stages=stages)
    assert samples.probability_within(20.0, 0) == stages[1].probability_within(20.0, 0)  # 20 leave 95 % open
    assert samples.probability_within(20.0, 0).value == 1
    assert samples.probability_within(20.0, 0, sure=0.9) == stages[0].probability_within(20.0, 0)
    assert samples.probability_within(20.0, 0, sure=0.999).value == 0.5  # none leaves that clear


def test_probability_text_never_contradicts_the_verdict():
    for kept in (*np.linspace(0.90, 0.999, 100), 0.94501, 0.94999, 0.95, 0.05001, 0.0549, 0.05, 0.0):
        shown = float(percent_text(kept, kept, kept, 0.95).split()[0])
        assert verdict_by_probability(shown / 100) is verdict_by_probability(kept)
    assert percent_text(0.94999, 0.93, 0.97, 0.95) == "94.9 % (93 to 97); PASS needs 95 %"
    assert percent_text(0.93, 0.9161, 0.951, 0.95) == "93 % (91 to 96); PASS needs 95 %"
    assert percent_text(0.0, 0.0, 0.0, 0.95) == "0 %; PASS needs 95 %"


def test_catalogue_accuracy_is_compared_with_the_error_near_no_load():
    drive = tiny(C_3, "operation.rated=10", "catalogue.accuracy=30")
    samples = draw_samples(prior_of(drive), (4.0,), evidence=evidence_of(drive), effort=FEW)
    number = next(k for k, each in enumerate(samples.made) if each.F_ior_arcsec is not None)
    kept, tested_deg = samples.made[number], turn_of_test_deg(drive, [0, number])
    there = rotated(drive.with_values(samples.values()[0]), tested_deg)
    assert kept.figures["accuracy"] == pytest.approx(extremes_of(there, [0.2])[0].F_ior_arcsec[0], abs=1e-6)


def test_samples_that_meet_an_accuracy_keep_their_weight():
    samples = draw_samples(prior_of(tiny(C_3)), (4.0,), effort=FEW)
    F_ior = samples.F_ior_arcsec[:, 0]
    limit = float(np.median(F_ior))
    kept = samples.keeping(limit, 0)
    assert np.array_equal(kept.weights[F_ior <= limit], samples.weights[F_ior <= limit])
    assert np.all(kept.weights[F_ior > limit] < samples.weights[F_ior > limit])


@pytest.mark.parametrize("name", ["vzp160", "size-25-100", "mvz-80"])
def test_kinds_of_uncertain_inputs_add_up(name: str) -> None:
    drive = load_preset(name)
    prior = prior_of(drive)
    counts = prior.counts()
    assert sum(counts.values()) == len(prior.fields)
    drawn = {field.path for field in prior.fields}
    assert counts["unknown"] == len({unknown.path for unknown in unknowns(drive)} & drawn)
