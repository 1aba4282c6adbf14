"""After measured values: a hidden cam offset found again from F'_ior in a few holes, and how sure that is."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from hdassist import load_preset
from hdassist.belief.evidence import MISFITS, MISREAD, MISREAD_SHARE, SCALE, ErrorKind, error_kinds, kernel
from hdassist.drive.error.error_map import ErrorMap
from hdassist.features.mounting import posterior
from hdassist.features.mounting.advice import advise_after
from hdassist.features.mounting.decision import value_of_measurement
from hdassist.features.mounting.positions import rotated
from hdassist.features.mounting.posterior import (
    LOG_NOISES,
    HoleSamples,
    Trial,
    TrialSetup,
    likelier_torque,
    posterior_of,
)
from tests.helpers.process import SMALL
from tests.mounting.drives import (
    HOLES,
    M_G,
    POSITIONS,
    SETUP,
    THIRDS,
    direction_of,
    learnt,
    measured,
    shown,
    synthetic,
    told,
    trials,
)

ONE = told("operation.M_g=4")  # at the torque of the values alone


def test_a_known_direction_is_bayes_on_a_grid_of_directions() -> None:
    """One unknown, the direction; no scale, misfit, or noise but the told one: against the sum over the directions."""
    shape = 20 + 8 * np.cos(2 * np.pi * np.arange(360) / 360) + 3 * np.sin(4 * np.pi * np.arange(360) / 360)
    fine = synthetic(
        shape.reshape(HOLES, 30).T, setup=TrialSetup(M_G, 1.5)
    )  # sample i in direction k stands at i + 30 k deg
    y, tried = np.array([24.0, 14.0, 19.0]), (0, 120, 240)
    at = np.array([np.roll(shape, turn) for turn in tried])  # F'_ior of each direction with the wheel turned
    exact = np.exp(-0.5 * (((y[:, None] - at) / 1.5) ** 2).sum(axis=0))
    exact /= exact.sum()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hdassist.belief.evidence.SCALE", 0.0)
        found = posterior_of(fine, [Trial(t, v) for t, v in zip(tried, y, strict=True)], [0.0, 60.0], [ErrorKind()])
    sample, direction = np.divmod(found.places, HOLES)
    share = np.bincount(sample + 30 * direction, minlength=360) / len(found.places)
    assert np.abs(np.cumsum(share) - np.cumsum(exact)).max() < 0.01
    assert found.F_ior_arcsec[:, 0] == pytest.approx(shape[sample + 30 * direction])
    assert found.F_ior_arcsec.mean(axis=0) == pytest.approx([exact @ shape, exact @ np.roll(shape, 60)], abs=0.1)
    assert found.effective == pytest.approx(1 / np.square(exact).sum(), rel=1e-6)


def test_draws_and_weights_are_those_of_the_normal_distribution() -> None:
    """Scale, misfit and noise of two samples: against the matrix formula."""
    F_ior = np.array([np.linspace(10, 30, HOLES), np.linspace(28, 12, HOLES)])
    weight = np.zeros(F_ior.shape)
    weight[:, 0] = 1
    pair, tried = synthetic(F_ior, weight, TrialSetup(M_G, 1.3)), [0.0, 30.0, 90.0, 90.0]
    y = np.array([17.0, 18.0, 19.0, 21.0])
    found = posterior_of(pair, [Trial(r, v) for r, v in zip(tried, y, strict=True)], POSITIONS, [ErrorKind(0.08)])
    f, likely, means, spreads = shown(pair, [*POSITIONS, *tried]), [], [], []
    for k in (0, HOLES):
        everywhere = [*POSITIONS, *tried]
        both = (0.08 * F_ior[k // HOLES].mean()) ** 2 * kernel(everywhere, everywhere) + SCALE**2 * np.outer(f[k], f[k])
        seen = both[12:, 12:] + 1.3**2 * np.eye(4)
        likely.append(multivariate_normal.pdf(y, f[k, 12:], seen))
        gain = both[:12, 12:] @ np.linalg.inv(seen)
        means.append(f[k, :12] + gain @ (y - f[k, 12:]))
        spreads.append(np.sqrt(np.diag(both[:12, :12] - gain @ both[12:, :12])))
    share = np.array([np.mean(found.places == k) for k in (0, HOLES)])
    assert share == pytest.approx(np.array(likely) / np.sum(likely), abs=1e-3)
    for k, mean, spread in zip((0, HOLES), means, spreads, strict=True):
        mine = found.F_ior_arcsec[found.places == k]
        if len(mine) > 300:
            assert mine.mean(axis=0) == pytest.approx(mean, abs=4 * spread.max() / np.sqrt(len(mine)))
            assert mine.std(axis=0) == pytest.approx(spread, rel=0.15)


@pytest.mark.thorough
def test_intervals_hold_what_they_promise() -> None:
    """Drives drawn from what is assumed, scale, misfit and noise: 90 % of F'_ior lie in the intervals of 90 %."""
    rng = np.random.default_rng(5)
    base = 20 + 6 * np.cos(2 * np.pi * (np.arange(HOLES) / HOLES - rng.random((64, 1))))
    base *= rng.uniform(0.7, 1.5, (64, 1))
    spread = np.linalg.cholesky(kernel(POSITIONS, POSITIONS))
    assumed, inside, surer = synthetic(base, setup=TrialSetup(M_G)), [], []
    for _ in range(60):
        place = int(rng.integers(base.size))
        f, misfit = shown(assumed, POSITIONS, np.array([place]))[0], rng.choice(MISFITS)
        off = misfit * f.mean() * spread @ rng.standard_normal(HOLES)
        truth = f * (1 + SCALE * rng.standard_normal()) + off
        noise = np.exp(0.35 * rng.standard_normal())
        tried = [Trial(r, truth[POSITIONS.index(r)] + noise * rng.standard_normal()) for r in (*THIRDS, 60.0)]
        draws, losses = learnt(assumed, tried, POSITIONS)
        low, high = np.quantile(draws.F_ior_arcsec[:, :HOLES], (0.05, 0.95), axis=0)
        inside.append(np.mean((truth >= low) & (truth <= high)))
        surer.append(losses.probability_good[losses.best] - (truth[losses.best] < 1.05 * truth.min()))
    for share, promised in ((inside, 0.9), (surer, 0.0)):  # a probability is a share of drives
        assert np.mean(share) == pytest.approx(promised, abs=3 * np.std(share) / np.sqrt(len(share)))


@pytest.mark.thorough
@pytest.mark.parametrize(("size", "direction"), [(50.0, 20.0), (40.0, 265.0)])
def test_a_hidden_offset_is_recovered(cloud: HoleSamples, size: float, direction: float) -> None:
    values = measured(size, direction)
    draws, losses = learnt(cloud, trials(values, (*THIRDS, 60.0, 300.0)), POSITIONS)
    off = (direction_of(cloud)[draws.places] - direction + 180) % 360 - 180
    assert abs(off.mean()) < max(3 * off.std(), 5)
    assert off.std() < 30
    found = draws.offset[0]
    assert abs(found.mean() - size) < 2 * found.std()
    assert values[losses.best] < 1.05 * min(values)


@pytest.mark.thorough
def test_more_values_raise_the_probability_with_the_predicted_gain(cloud: HoleSamples) -> None:
    values = measured(40.0, 140.0)
    (_, one), (draws, three), (_, six) = (
        learnt(cloud, trials(values, POSITIONS[::step][:count]), POSITIONS) for step, count in ((4, 1), (4, 3), (2, 6))
    )
    sure = [decision.probability_good[decision.best] for decision in (one, three, six)]
    assert sure == sorted(sure)
    F_ior, noise = draws.F_ior_arcsec, draws.noise * cloud.setup.noise_arcsec
    found = value_of_measurement(three, {M_G: F_ior[:, :-1]}, noise, steps=1)
    now, foreseen = found.F_ior_arcsec
    assert foreseen < now == pytest.approx(three.F_ior_arcsec[0, :, three.best].mean(), rel=0.03)
    # what is foreseen of the next value is what comes of it, over values that may be measured there
    rng, place, brought = np.random.default_rng(0), POSITIONS.index(found.rotation_deg), []
    for k in rng.integers(len(draws.places), size=24):
        value = F_ior[k, place] + noise[k] * rng.standard_normal()
        _, then = learnt(cloud, [*trials(values), Trial(found.rotation_deg, float(value))], POSITIONS)
        brought.append(F_ior[k, then.best] - F_ior[k, three.best])
    assert np.mean(brought) == pytest.approx(foreseen - now, abs=3 * np.std(brought) / np.sqrt(len(brought)) + 0.1)


def test_probability_of_a_reading_error_follows_the_normal_distribution() -> None:
    """One sample, the same in all positions: against densities of all kinds, none of them without its size."""
    of_one, rig = synthetic(np.full((1, 12), 20.0), setup=TrialSetup(M_G, 0.5)), 0.5
    y, tried = np.array([20.0, 20.5, 26.0]), (0.0, 120.0, 240.0)
    shares = {(misfit, noise, -1): np.exp(log) for misfit in MISFITS for noise, log in LOG_NOISES.items()}
    whole = sum(shares.values())
    shares = {kind: (1 - MISREAD) ** 3 * share / whole for kind, share in shares.items()}
    shares |= {(misfit, 1.0, k): (1 - (1 - MISREAD) ** 3) / 3 / len(MISFITS) for misfit in MISFITS for k in range(3)}
    weights = {}
    for (misfit, noise, k), share in shares.items():
        spread = noise * np.array([np.hypot(rig, MISREAD_SHARE * y[j]) if j == k else rig for j in range(3)])
        both = (20 * misfit) ** 2 * kernel(tried, tried) + (20 * SCALE) ** 2 + np.diag(spread**2)
        weights[misfit, noise, k] = share * multivariate_normal(np.full(3, 20.0), both).pdf(y)
    exact = [sum(w for (*_, k), w in weights.items() if k == wrong) for wrong in range(3)] / sum(weights.values())
    found = posterior_of(of_one, [Trial(t, v) for t, v in zip(tried, y, strict=True)], [0.0])
    assert found.misread == pytest.approx(exact, rel=1e-6)


@pytest.mark.thorough
def test_repeats_tell_the_noise(cloud: HoleSamples) -> None:
    values = measured(50.0, 20.0)
    once = posterior_of(cloud, trials(values), [0.0])
    close, far = (
        posterior_of(cloud, [*trials(values), Trial(0.0, values[0] + off), Trial(0.0, values[0] - off)], [0.0])
        for off in (0.1, 1.5)
    )
    assert close.noise.mean() < once.noise.mean() < far.noise.mean()
    assert far.noise.mean() > 1.25  # the values' own standard deviation is three times the told one
    assert np.all(far.misread[3:] > 10 * close.misread[3:])  # or one of them is misread


@pytest.mark.thorough
def test_larger_errors_than_the_model_still_give_the_best_hole(cloud: HoleSamples) -> None:
    values = measured(50.0, 20.0)
    same, more = (
        learnt(cloud, trials([factor * v for v in values], POSITIONS[::2]), POSITIONS) for factor in (1.0, 1.12)
    )
    assert more[0].scale.mean() - same[0].scale.mean() > 0.04
    assert values[more[1].best] < 1.05 * min(values)


def test_where_no_drive_shows_the_values_they_alone_decide(coarse_cloud: HoleSamples) -> None:
    """A curve over the seat that is far above all that the drive has."""
    shape = 300 + 60 * np.cos(np.radians(np.array(POSITIONS) - 140))
    tried = [Trial(r, float(shape[POSITIONS.index(r)])) for r in (*THIRDS, 60.0)]
    advice = advise_after(ONE, tried, coarse_cloud.setup, samples=coarse_cloud)
    assert advice.after and advice.after.by_values > 0.99
    assert shape[advice.decision.best] < 1.1 * shape.min()
    right = advise_after(
        ONE, trials(measured(50.0, 20.0), (*THIRDS, 60.0, 300.0)), coarse_cloud.setup, samples=coarse_cloud
    )
    assert right.after and right.after.by_values < 0.5


def test_torque_at_which_values_are_far_more_probable_is_named(coarse_cloud: HoleSamples) -> None:
    drive = load_preset(SMALL).with_values({"tolerances.e_hb": 50.0, "phases.phi_hb": 20.0})
    search = ErrorMap(drive, 1.0)
    at_one = trials([search.extremes(rotated(drive, r)).first for r in POSITIONS])
    assert likelier_torque(coarse_cloud, at_one) == 1.0
    assert likelier_torque(coarse_cloud, trials(measured(50.0, 20.0))) is None
    # by hand, of one sample in one direction, whose values at the other torque are those measured: 2 are 3 off
    weight = np.eye(1, len(POSITIONS))
    one = synthetic(np.full(weight.shape, 30.0), weight)
    one = replace(one, F_ior_by_torque={M_G: np.full(weight.shape, 30.0), 1.0: np.full(weight.shape, 20.0)})
    assert likelier_torque(one, [Trial(0, 20.0), Trial(120, 20.0), Trial(240, 20.0)]) == 1.0
    assert likelier_torque(one, [Trial(0, 28.0), Trial(120, 28.0), Trial(240, 28.0)]) is None


def test_few_remaining_samples_lower_the_probability_but_give_a_result(coarse_cloud: HoleSamples) -> None:
    tried = trials(measured(50.0, 20.0))
    likely = posterior_of(coarse_cloud, tried, [0.0]).places[:3]
    weight = np.isin(np.arange(coarse_cloud.weight.size), likely).reshape(coarse_cloud.weight.shape) / 3
    advice = advise_after(ONE, tried, coarse_cloud.setup, samples=replace(coarse_cloud, weight=weight))
    assert advice.after and advice.after.effective > 1
    assert advice.word in ("TURN", "BEST_BET")


@pytest.mark.thorough
def test_an_outcome_stands_beside_the_prediction_of_the_draws(cloud: HoleSamples) -> None:
    values = measured(50.0, 35.0)
    tried, hole = trials(values), POSITIONS.index(60.0)
    good, far = (
        advise_after(ONE, tried, cloud.setup, outcome=Trial(60.0, value), samples=cloud).verification
        for value in (values[hole], 99.0)
    )
    assert good and far
    assert good.as_predicted and not far.as_predicted
    assert far.back_to and far.back_to.F_ior_arcsec == min(each.F_ior_arcsec for each in tried)
    draws, rng = posterior_of(cloud, tried, [60.0]), np.random.default_rng(0)
    read = draws.F_ior_arcsec[:, 0] + draws.noise * cloud.setup.noise_arcsec * rng.standard_normal(len(draws.places))
    assert np.mean((read > good.low_arcsec) & (read < good.high_arcsec)) == pytest.approx(0.95, abs=0.05)


def test_another_torque_shares_the_scale_but_not_the_misfit(coarse_cloud: HoleSamples) -> None:
    tried = trials(measured(50.0, 20.0), POSITIONS[::2])
    draws, both = learnt(coarse_cloud, tried, POSITIONS, torques=(1.0, M_G))
    assert both.F_ior_arcsec[1] == pytest.approx(draws.F_ior_arcsec[:, :-1])
    f = shown(coarse_cloud, POSITIONS, draws.places, 1.0)
    left = both.F_ior_arcsec[0] - f * draws.scale[:, None]
    spread = (
        np.hypot(draws.misfit, coarse_cloud.read_error) * coarse_cloud.mean(draws.places) * coarse_cloud.levels[1.0]
    )
    assert (left / spread[:, None]).std() == pytest.approx(1, abs=0.1)


def two_torques() -> HoleSamples:
    """Drives whose F'_ior goes once around the seat, at 1 N*m in a direction of its own, and four times as small."""
    turn = 2 * np.pi * np.arange(HOLES) / HOLES
    light, heavy = np.meshgrid(np.arange(HOLES), np.arange(HOLES), indexing="ij")
    F_ior = 24 + 8 * np.cos(turn - turn[light.ravel(), None])
    one = synthetic(F_ior, np.tile(np.eye(1, HOLES), (len(F_ior), 1)))
    return replace(one, F_ior_by_torque={M_G: F_ior, 1.0: 6 + 2 * np.cos(turn - turn[heavy.ravel(), None])})


BOTH = told("operation.M_g=[1, 4]")
LIGHT_VALUES = [Trial(0.0, 32.0), Trial(120.0, 20.0), Trial(240.0, 20.0)]  # best at 180 deg


def test_values_at_a_second_torque_resolve_holes_the_first_cannot() -> None:
    """By values at 4 N*m nothing is known of 1 N*m: a value there is worth most, and says where it is best."""
    samples = two_torques()
    setup = TrialSetup(M_G, 0.5, others=(1.0,))
    blind = advise_after(BOTH, LIGHT_VALUES, setup, samples=replace(samples, setup=setup))
    assert blind.value and blind.value.M_g == 1.0
    more = [*LIGHT_VALUES, *(Trial(turn, 6 + 2 * np.cos(np.radians(turn - 90)), M_g=1.0) for turn in (0, 90, 180))]
    known = advise_after(BOTH, more, setup, samples=replace(samples, setup=setup))
    assert known.decision.of_torque(0).best == 9 and known.decision.of_torque(1).best == 6  # 270 and 180 deg
    assert known.decision.best in (7, 8)
    assert known.decision.expected_loss[known.decision.best] < blind.decision.expected_loss[blind.decision.best]
    only = advise_after(BOTH, LIGHT_VALUES, SETUP, samples=samples)  # who said that it is measured at 4 N*m alone
    assert only.value and only.value.M_g == M_G


@pytest.mark.thorough
@given(order=st.permutations(range(5)))
@settings(max_examples=6, deadline=None)
def test_the_order_of_values_does_not_matter(order: list[int]) -> None:
    samples = two_torques()
    values = [*LIGHT_VALUES, Trial(90.0, 8.0, M_g=1.0), Trial(270.0, 4.5, M_g=1.0)]
    first, other = (advise_after(BOTH, tried, SETUP, samples=samples) for tried in (values, [values[k] for k in order]))
    assert other.trials == first.trials  # in an order of their own
    assert np.array_equal(other.decision.F_ior_arcsec, first.decision.F_ior_arcsec)
    assert first.after and other.after
    assert np.array_equal(other.after.misread, first.after.misread)
    assert other.value == first.value


def test_forbidden_holes_are_not_chosen(coarse_cloud: HoleSamples) -> None:
    tried = trials(measured(50.0, 20.0))
    _, every = learnt(coarse_cloud, tried, POSITIONS)
    left = [r for r in POSITIONS if r != POSITIONS[every.best]]
    _, second = learnt(coarse_cloud, tried, left)
    assert values_near(left[second.best], POSITIONS[every.best])


def values_near(one: float, other: float) -> bool:
    return abs((one - other + 180) % 360 - 180) <= 60


@pytest.mark.thorough
def test_one_reading_error_among_six_values_is_named(cloud: HoleSamples) -> None:
    """The value in the best of the holes is read 15 arcsec too high, or that in a good one 20."""
    values = measured(50.0, 20.0)
    tried = trials(values, (*THIRDS, 60.0, 90.0, 150.0))
    assert advise_after(ONE, tried, cloud.setup, samples=cloud).suspected is None
    for k, off in ((1, 15.0), (4, 20.0)):
        wrong = [*tried]
        wrong[k] = replace(tried[k], F_ior_arcsec=tried[k].F_ior_arcsec + off)
        advice = advise_after(ONE, wrong, cloud.setup, samples=cloud)
        assert advice.suspected == advice.to_repeat == wrong[k]
        assert advice.next and advice.next.rotation_deg == wrong[k].rotation_deg
        assert values[advice.decision.best] < 1.05 * min(values)


def test_free_curves_are_smooth_and_gain_nothing_near_the_values(monkeypatch) -> None:
    """Drives whose F'_ior goes once around the seat, by a tenth: other curves do too, and their level is not given."""
    monkeypatch.setattr(posterior, "_FREE_SHARE", 0.5)
    monkeypatch.setattr(posterior, "_PHASOR_SHARE", 0.0)
    turn = 2 * np.pi * (np.arange(HOLES) / HOLES - np.linspace(0, 1, 64, endpoint=False)[:, None])
    once, tried = synthetic(20 * np.exp(0.1 * np.cos(turn))), [Trial(0.0, 20.0), Trial(120.0, 20.5), Trial(60.0, 18.5)]
    near = posterior_of(once.with_free_curves(tried), tried, [0.0, 180.0])
    assert near.by_values < 0.3  # the level of drives agrees with the values, of others it could be any
    # against very many of them, drawn whatever the values are
    rng = np.random.default_rng(0)
    level, one, other = rng.standard_normal((3, 40_000, 1))
    factors, log_shares = posterior._wave_factors()
    size = 0.1 / np.sqrt(2) * rng.choice(factors[:, 1], (40_000, 1), p=np.exp(log_shares))
    curves = 20 * np.exp(level + size * (one * np.cos(turn[0]) + other * np.sin(turn[0])))
    weight = np.vstack([np.full((64, HOLES), 1 / (64 * HOLES)), np.zeros(curves.shape)])
    weight[64:, 0] = 1 / len(curves)
    every = posterior_of(synthetic(np.vstack([once.F_ior_arcsec, curves]), weight), tried, [0.0, 180.0])
    of_curves = every.places >= 64 * HOLES
    assert near.by_values == pytest.approx(of_curves.mean(), rel=0.1)
    found, free = near.F_ior_arcsec[near.places >= 64 * HOLES], every.F_ior_arcsec[of_curves]
    assert found.mean(axis=0) == pytest.approx(free.mean(axis=0), abs=0.4)
    assert found.std(axis=0) == pytest.approx(free.std(axis=0), rel=0.25)


def test_curves_of_two_phasors_gain_nothing_near_the_values(monkeypatch) -> None:
    """They are those that very many draws before any value have, weighed by the values."""
    monkeypatch.setattr(posterior, "_FREE_SHARE", 0.0)
    monkeypatch.setattr(posterior, "_PHASOR_SHARE", 0.5)
    turn = 2 * np.pi * np.arange(HOLES) / HOLES
    drives = synthetic(np.full((64, HOLES), 20.0))
    tried = [Trial(0.0, 20.0), Trial(120.0, 26.0), Trial(60.0, 25.0)]
    near = posterior_of(drives.with_free_curves(tried), tried, [90.0, 180.0])
    rng = np.random.default_rng(0)
    constant = np.exp(2 * rng.standard_normal(100_000))
    radius = np.sqrt(rng.random(100_000))  # even over the circle
    direction = rng.uniform(0, 2 * np.pi, 100_000)
    curves = 20 * np.sqrt(constant * (1 + radius * np.cos(turn[:, None] - direction))).T
    weight = np.vstack([np.full((64, HOLES), 1 / (64 * HOLES)), np.zeros(curves.shape)])
    weight[64:, 0] = 1 / len(curves)
    all_curves = posterior_of(synthetic(np.vstack([drives.F_ior_arcsec, curves]), weight), tried, [90.0, 180.0])
    is_curve = all_curves.places >= 64 * HOLES
    assert near.by_values == pytest.approx(is_curve.mean(), rel=0.15)
    near_curves = near.F_ior_arcsec[near.places >= 64 * HOLES]
    assert near_curves.mean(axis=0) == pytest.approx(all_curves.F_ior_arcsec[is_curve].mean(axis=0), abs=0.5)
    assert near_curves.std(axis=0) == pytest.approx(all_curves.F_ior_arcsec[is_curve].std(axis=0), rel=0.25)


def test_no_hole_is_measured_next_that_cannot_become_the_choice(coarse_cloud: HoleSamples) -> None:
    """Values 120 deg apart with one low one: the hole opposite to that one is not worth a value."""
    tried = [Trial(0.0, 72.0), Trial(120.0, 23.8), Trial(240.0, 75.4)]
    advice = advise_after(ONE, tried, coarse_cloud.setup, samples=coarse_cloud)
    place = advice.decision.place(advice.next.rotation_deg)
    assert advice.decision.probability_good[place] > 0.01
    assert values_near(advice.next.rotation_deg, 120.0)


def test_any_value_may_be_misread_and_an_outlier_is_named() -> None:
    shares = {k: sum(np.exp(e.log_share) for e in error_kinds(6, LOG_NOISES) if e.misread == k) for k in range(-1, 6)}
    assert sum(shares.values()) == pytest.approx(1)
    assert [shares[k] for k in range(6)] == pytest.approx([(1 - (1 - MISREAD) ** 6) / 6] * 6)
    turn = 2 * np.pi * (np.arange(HOLES) / HOLES - np.linspace(0, 1, 64, endpoint=False)[:, None])
    once = synthetic(20 * np.exp(0.3 * np.cos(turn)))
    right = once.F_ior_arcsec[5]
    for wrong in (0, 3):
        y = {hole: right[hole] * (1.6 if hole == HOLES // 6 * wrong else 1) for hole in range(0, HOLES, 2)}
        tried = [Trial(POSITIONS[hole], float(value)) for hole, value in y.items()]
        found = posterior_of(once.with_free_curves(tried), tried, [0.0]).misread
        assert found.argmax() == wrong and found[wrong] > 0.9


def test_weighted_smooth_curves_have_their_prior_of_several_sizes() -> None:
    """Numbers drawn near a value, weighted, have the moments of a mixture of normal distributions of two sizes."""
    sizes = np.array([[1.0, 0.5], [1.0, 2.0]])
    log_sizes = np.log([0.75, 0.25])
    basis = np.array([[1.0, 0.4]])
    kinds = [ErrorKind(log_share=np.log(0.5)), ErrorKind(noise=4.0, log_share=np.log(0.5))]
    covariances = np.array([[[0.8]], [[3.0]]])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(posterior, "_FREE_CURVES", 200_000)
        numbers, weights = posterior._numbers_near(
            basis,
            np.array([0.7]),
            covariances,
            kinds,
            np.random.default_rng(0),
            sizes=sizes,
            log_sizes=log_sizes,
        )
    share = weights / len(weights)
    assert share.sum() == pytest.approx(1, abs=0.02)
    assert share @ numbers == pytest.approx(np.zeros(2), abs=0.03)
    assert share @ np.square(numbers) == pytest.approx(np.exp(log_sizes) @ np.square(sizes), rel=0.04)
    fourth = 3 * np.exp(log_sizes) @ sizes[:, 1] ** 4  # normal numbers have three times the squared variance
    assert share @ numbers[:, 1] ** 4 == pytest.approx(fourth, rel=0.15)


def test_factors_of_waves_are_probabilities_with_their_medians() -> None:
    factors, log_shares = posterior._wave_factors()
    shares = np.exp(log_shares)
    assert shares.sum() == pytest.approx(1)
    assert (factors[:, 0] == 1).all()  # the level keeps its size
    first, higher = factors[:, 1], factors[:, 2]
    assert (factors[:, 2:5] == higher[:, None]).all()
    # the first wave is smaller than those of the samples more often than the higher waves
    assert shares @ np.log(first) < shares @ np.log(higher) < 0
