"""Trials: a hidden cam offset found again from F'_ior measured in a few positions, and how sure that is."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from hdassist import load_preset
from hdassist.belief.evidence import stiffness_figures
from hdassist.error.error_map import ErrorMap
from hdassist.error.table import Mesh
from hdassist.errors import UntrustedError, UsageError
from hdassist.mounting.losses import Criterion, PositionStatistics
from hdassist.mounting.positions import rotated, usable_positions
from hdassist.mounting.trial import Trial, read_trial
from hdassist.pages.trials import (
    trials_card_facts,
    trials_exit_code,
    trials_instruction,
    trials_json,
    trials_page,
    trials_summary,
    trials_warnings,
)
from hdassist.preset.fields import Drive
from hdassist.terminal.texts import texts
from hdassist.trials.advice import TrialAdvice, advise_from_trials
from hdassist.trials.posterior import (
    AS_TOLD,
    MISFITS,
    SCALE,
    Prediction,
    drawn,
    kernel,
    learnt,
    next_trial,
    prediction,
    require_effective,
    require_reachable,
    weeded,
)
from hdassist.trials.prior import Prior, Rig, TrialEffort, open_prior, trial_prior
from tests.process import ASSUMED, SMALL
from tests.support import changed

M_G, HOLES = 4.0, 12
POSITIONS = usable_positions(HOLES, "all")
THIRDS = (0.0, 120.0, 240.0)
KNOWN = {"tolerances.e_hh": 1.0, "phases.phi_hh": 2.0}  # the cam's own offset, well measured
RIG = Rig(M_G, noise_arcsec=0.5)
FEW = TrialEffort.of(16)
COARSE = TrialEffort(2, 2, 2, 64, 16, Mesh((9, 5, 9, 9), 12))


def told(*overrides: str, **uncertainty: float) -> Drive:
    return load_preset(SMALL, overrides).model_copy(update={"uncertainty": KNOWN | uncertainty})


@pytest.fixture(scope="module")
def cloud() -> Prior:
    return trial_prior(told(), (1.0,), RIG, effort=FEW)


@cache
def measured(size: float, direction: float) -> tuple[float, ...]:
    """F'_ior [arcsec] in each hole, by search."""
    drive = load_preset(SMALL).with_values({"tolerances.e_hb": size, "phases.phi_hb": direction})
    search = ErrorMap(drive, M_G)
    return tuple(search.extremes(rotated(drive, r)).first for r in POSITIONS)


def direction_of(cloud: Prior) -> np.ndarray:
    """Directions of the standing offset [deg], samples and directions flat."""
    return cloud.offset(np.arange(cloud.weight.size))[1]


def trials(values, rotations=THIRDS) -> list[Trial]:
    return [Trial(r, values[POSITIONS.index(r)]) for r in rotations]


def synthetic(F_ior: np.ndarray, weight: np.ndarray | None = None, rig: Rig = RIG) -> Prior:
    """Samples with such F'_ior, shape (samples, holes), read without error."""
    weight = np.ones(F_ior.shape) if weight is None else weight
    return Prior(told(), rig, {rig.M_g: F_ior}, weight / weight.sum(), {}, {rig.M_g: 0.0})


def require_turned(prior: Prior, drive: Drive, sample: int, direction: int, rotation: float) -> None:
    """F'_ior of a sample of one system with the wheel turned is about that of its drive so turned, by search."""
    place = np.array([sample * prior.weight.shape[1] + direction])
    values = {path: float(of[sample, direction]) for path, of in prior.values.items()}
    assert direction_of(prior)[place][0] == pytest.approx(values["phases.phi_hb"])
    turned = rotated(drive.with_values(values), rotation)
    exact = ErrorMap(turned, M_G).extremes(turned).first
    assert prior.at([rotation], place)[0, 0] == pytest.approx(exact, rel=max(5 * prior.read_error[M_G], 0.05))


def test_turning_the_wheel_is_turning_all_that_stands_back() -> None:
    """F'_ior of samples in other positions, taken from other directions of theirs, against the wheel turned."""
    drive = load_preset(SMALL, ["tolerances.e_hh=0"])
    prior = trial_prior(drive, (), RIG, effort=FEW)
    for sample, direction, rotation in ((3, 0, 30.0), (40, 7, 120.0), (77, 11, 330.0)):
        require_turned(prior, drive, sample, direction, rotation)
    some = np.arange(0, prior.weight.size, 97)
    assert prior.at([15.0], some) == pytest.approx(prior.at([0.0, 30.0], some).mean(axis=1, keepdims=True))


def test_stiffnesses_and_clearances_are_drawn_as_check_draws_them_and_by_its_evidence() -> None:
    """A clearance that is assumed moves F'_ior; a catalogue's stiffness that no drive has leaves none."""
    drive = load_preset(SMALL, ["operation.M_g=4", "tolerances.e_hh=0", ASSUMED])
    effort = TrialEffort(3, 3, 3, 12, 8, Mesh((9, 5, 9, 9), 12))
    prior = trial_prior(drive, (), RIG, effort=effort)
    assert len(prior.weight) == 3 * 8
    assert prior.systems == pytest.approx(3)
    figures, _ = stiffness_figures(drive)
    agreeing = changed(drive, catalogue__K_2=figures["K_2"])
    assert 0 < trial_prior(agreeing, (), RIG, effort=effort).systems <= 12
    with pytest.raises(UntrustedError, match="of 12 draws are effective, 3 are needed: the catalogue's values"):
        trial_prior(changed(drive, catalogue__K_2=1e3 * figures["K_2"]), (), RIG, effort=effort)


def test_samples_that_are_weeded_say_what_all_say(cloud: Prior) -> None:
    tried = trials(measured(50.0, 20.0), (*THIRDS, 60.0))
    few = weeded(cloud, tried, 1500)
    assert 500 < np.count_nonzero(few.weight) < 1600
    for count in (1, 4):
        every, some = (learnt(prior, tried[:count], POSITIONS) for prior in (cloud, few))
        assert some[0].effective > 0.5 * min(every[0].effective, 1500)
        assert some[1].probability_good == pytest.approx(every[1].probability_good, abs=0.1)


def test_a_known_direction_is_bayes_on_a_grid_of_directions() -> None:
    """One unknown, the direction; no scale, misfit, or noise but the told one: against the sum over the directions."""
    shape = 20 + 8 * np.cos(2 * np.pi * np.arange(360) / 360) + 3 * np.sin(4 * np.pi * np.arange(360) / 360)
    fine = synthetic(shape.reshape(HOLES, 30).T, rig=Rig(M_G, 1.5))  # sample i in direction k stands at i + 30 k deg
    y, tried = np.array([24.0, 14.0, 19.0]), (0, 120, 240)
    at = np.array([np.roll(shape, turn) for turn in tried])  # F'_ior of each direction with the wheel turned
    exact = np.exp(-0.5 * (((y[:, None] - at) / 1.5) ** 2).sum(axis=0))
    exact /= exact.sum()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hdassist.trials.posterior.SCALE", 0.0)
        found = drawn(fine, [Trial(t, v) for t, v in zip(tried, y, strict=True)], [0.0, 60.0], AS_TOLD)
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
    pair, tried = synthetic(F_ior, weight, Rig(M_G, 1.3)), [0.0, 30.0, 90.0, 90.0]
    y = np.array([17.0, 18.0, 19.0, 21.0])
    found = drawn(pair, [Trial(r, v) for r, v in zip(tried, y, strict=True)], POSITIONS, np.array([[0.08, 1.0]]))
    f, likely, means, spreads = pair.at([*POSITIONS, *tried]), [], [], []
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


def test_intervals_hold_what_they_promise() -> None:
    """Drives drawn from what is assumed, scale, misfit and noise: 90 % of F'_ior lie in the intervals of 90 %."""
    rng = np.random.default_rng(5)
    base = 20 + 6 * np.cos(2 * np.pi * (np.arange(HOLES) / HOLES - rng.random((64, 1))))
    base *= rng.uniform(0.7, 1.5, (64, 1))
    assumed, inside, good, sure = synthetic(base, rig=Rig(M_G)), [], [], []
    for _ in range(60):
        place = int(rng.integers(base.size))
        f, misfit = assumed.at(POSITIONS, np.array([place]))[0], rng.choice(MISFITS)
        truth = f * (1 + SCALE * rng.standard_normal()) + rng.multivariate_normal(
            np.zeros(HOLES), (misfit * f.mean()) ** 2 * kernel(POSITIONS, POSITIONS)
        )
        noise = np.exp(0.35 * rng.standard_normal())
        tried = [Trial(r, truth[POSITIONS.index(r)] + noise * rng.standard_normal()) for r in (*THIRDS, 60.0)]
        draws, losses = learnt(assumed, tried, POSITIONS)
        low, high = np.quantile(draws.F_ior_arcsec[:, :HOLES], (0.05, 0.95), axis=0)
        inside.append((truth >= low) & (truth <= high))
        good.append(truth[losses.best] < 1.05 * truth.min())
        sure.append(losses.probability_good[losses.best])
    assert 0.86 < np.mean(inside) < 0.94
    assert np.mean(good) == pytest.approx(np.mean(sure), abs=0.15)  # a probability is a share of drives


@pytest.mark.parametrize(("size", "direction"), [(50.0, 20.0), (40.0, 265.0)])
def test_a_hidden_offset_is_recovered(cloud: Prior, size: float, direction: float) -> None:
    values = measured(size, direction)
    draws, losses = learnt(cloud, trials(values, (*THIRDS, 60.0, 300.0)), POSITIONS)
    off = (direction_of(cloud)[draws.places] - direction + 180) % 360 - 180
    assert abs(off.mean()) < max(3 * off.std(), 5)
    assert off.std() < 30
    found = cloud.offset(draws.places)[0]
    assert abs(found.mean() - size) < 2 * found.std()
    assert values[losses.best] < 1.05 * min(values)
    assert losses.probability_best.sum() == pytest.approx(1)


@pytest.mark.slow
def test_the_shipped_effort_finds_the_offset_too() -> None:
    values = measured(40.0, 140.0)
    drive = load_preset(SMALL, ["operation.M_g=4"])
    found = advise_from_trials(drive, trials(values, (*THIRDS, 60.0, 300.0)), RIG)
    assert values[found.losses.best] < 1.05 * min(values)


def test_more_trials_make_it_surer_and_the_next_one_is_worth_it(cloud: Prior) -> None:
    values = measured(40.0, 140.0)
    (_, one), (draws, three), (_, six) = (
        learnt(cloud, trials(values, POSITIONS[::step][:count]), POSITIONS) for step, count in ((4, 1), (4, 3), (2, 6))
    )
    sure = [losses.probability_good[losses.best] for losses in (one, three, six)]
    assert sure == sorted(sure)
    after = next_trial(draws, three)
    assert after[1] > sure[1]
    # what is said of the next trial is what comes of it, over values that may be measured there
    rng, brought = np.random.default_rng(0), []
    place = POSITIONS.index(after[0])
    for k in rng.integers(len(draws.places), size=24):
        value = draws.F_ior_arcsec[k, place] + draws.noise_arcsec[k, place] * rng.standard_normal()
        _, then = learnt(cloud, [*trials(values), Trial(after[0], float(value))], POSITIONS)
        brought.append(then.probability_good.max())
    assert np.mean(brought) == pytest.approx(after[1], abs=0.1)


def test_repeats_tell_the_noise(cloud: Prior) -> None:
    values = measured(50.0, 20.0)
    once = drawn(cloud, trials(values), [0.0])
    close, far = (
        drawn(cloud, [*trials(values), Trial(0.0, values[0] + off), Trial(0.0, values[0] - off)], [0.0])
        for off in (0.1, 1.5)
    )
    assert close.noise.mean() < once.noise.mean() < far.noise.mean()
    assert far.noise.mean() > 1.25  # the values' own standard deviation is three times the told one
    assert far.misread.max() > 2 * close.misread.max()  # or one of them is misread


def test_a_drive_that_errs_more_than_the_model_is_found_all_the_same(cloud: Prior) -> None:
    values = measured(50.0, 20.0)
    same, more = (
        learnt(cloud, trials([factor * v for v in values], POSITIONS[::2]), POSITIONS) for factor in (1.0, 1.12)
    )
    assert more[0].scale.mean() - same[0].scale.mean() > 0.04
    assert values[more[1].best] < 1.05 * min(values)


def test_what_the_preset_knows_of_the_offset_counts() -> None:
    """A direction that is known needs no trial to tell it; nor does a size."""
    facing = told("phases.phi_hb=20", "tolerances.e_hb=50", **{"phases.phi_hb": 10.0, "tolerances.e_hb": 4.0})
    known = trial_prior(facing, (), RIG, effort=replace(COARSE, deviations=16))
    assert not known.weight[:, 1:].any()
    draws = drawn(known, [], [0.0])
    off = (direction_of(known)[draws.places] - 20 + 180) % 360 - 180
    assert abs(off.mean()) < 1
    assert off.std() == pytest.approx(5, rel=0.15)
    assert known.offset(draws.places)[0].std() == pytest.approx(2, rel=0.15)


def test_a_standing_ovality_that_is_known_does_not_turn_with_the_samples() -> None:
    oval = trial_prior(told("harmonics.a_s2=3", "harmonics.xi_s2=20"), (), RIG, effort=COARSE)
    assert not oval.weight[:, 1:].any()
    assert np.ptp(direction_of(oval).reshape(oval.weight.shape)[:, 0]) > 300
    with_flexspline = told("harmonics.a_s2=3", "mounting.fixed=flexspline", "tolerances.e_hg=30", "tolerances.e_hb=0")
    assert trial_prior(with_flexspline, (), RIG, effort=COARSE).weight[:, 1:].all()


def test_with_the_flexspline_fixed_its_own_offset_is_found() -> None:
    drive = told("mounting.fixed=flexspline", "tolerances.e_hb=0", "tolerances.e_hg=30")
    truth = drive.with_values({"tolerances.e_hg": 45.0, "phases.phi_hg": 130.0})
    search = ErrorMap(truth, M_G)
    tried = [Trial(r, search.extremes(rotated(truth, r)).first) for r in POSITIONS[::2]]
    found = trial_prior(drive, (), RIG, effort=FEW)
    off = (direction_of(found)[drawn(found, tried, [0.0]).places] - 130 + 180) % 360 - 180
    assert abs(off.mean()) < 2 * off.std() < 60


def test_an_error_of_the_seat_is_noise_that_grows_with_the_value() -> None:
    """Against drives whose wheel is really displaced, its teeth along the radius as well."""
    reseat = 1.0
    drive = load_preset(SMALL, ["tolerances.e_hh=0"])
    seated = trial_prior(drive, (), Rig(M_G, 1e-3, reseat), effort=FEW)
    search, turn = ErrorMap(drive, M_G), (0, 90, 180, 270)
    for low, high in ((12, 16), (20, 40)):
        some = np.argwhere((seated.F_ior_arcsec > low) & (seated.F_ior_arcsec < high))[:60:12]
        found, assumed = [], []
        for sample, direction in some:
            values = {path: float(of[sample, direction]) for path, of in seated.values.items()}
            # each component of the centre by reseat
            off = [{"tolerances.e_b": float(np.sqrt(2) * reseat), "phases.phi_eb": float(a)} for a in turn]
            found.append(np.var([search.extremes(drive.with_values({**values, **one})).first for one in off]))
            assumed.append(seated.noise(seated.F_ior_arcsec[sample, direction]) ** 2)
        assert 0.5 < np.sqrt(np.median(assumed) / np.median(found)) < 2
    firm, loose = (
        drawn(replace(seated, rig=replace(RIG, reseat_um=u)), trials(measured(50.0, 20.0)), [0.0]) for u in (0.0, 5.0)
    )
    assert loose.noise_arcsec.mean() > 1.5 * firm.noise_arcsec.mean()


def test_values_that_nothing_explains_are_refused_with_what_would_have_to_change(cloud: Prior) -> None:
    with pytest.raises(UntrustedError, match=r"no cam offset up to 60 um .*hole 4 \(120 deg\): measured 400") as far:
        require_reachable(cloud, [Trial(0, 20.0), Trial(120, 400.0)])
    assert "times as large" in far.value.hint
    with pytest.raises(UntrustedError) as little:
        require_reachable(cloud, [Trial(0, 0.2), Trial(120, 0.2)])
    assert "had to be 0." in little.value.hint
    low, high = float(cloud.F_ior_arcsec.min()), float(cloud.F_ior_arcsec.max())
    with pytest.raises(UntrustedError, match="explains the trials") as uneven:
        require_reachable(cloud, [Trial(r, v) for r, v in zip(POSITIONS, (low, high) * 6, strict=True)])
    assert "from hole to hole" in uneven.value.hint
    require_reachable(cloud, trials(measured(50.0, 20.0)))


def test_too_few_samples_are_no_cloud(cloud: Prior) -> None:
    values = measured(50.0, 20.0)
    likely = drawn(cloud, trials(values), [0.0]).places[:3]
    thin = replace(cloud, weight=np.isin(np.arange(cloud.weight.size), likely).reshape(cloud.weight.shape) / 3)
    tried = trials(values)
    draws, _ = learnt(thin, tried, POSITIONS)
    with pytest.raises(UntrustedError, match=r"too few samples .* arcsec at hole \d+ .* agrees least") as few:
        require_effective(thin, tried, draws, 64)
    assert "--draws" in few.value.hint


def test_predictions_are_those_of_the_draws(cloud: Prior) -> None:
    values = measured(50.0, 35.0)
    found = prediction(cloud, trials(values), Trial(60.0, values[2]))
    assert found.as_predicted
    draws, rng = drawn(cloud, trials(values), [60.0]), np.random.default_rng(0)
    seen = draws.F_ior_arcsec[:, 0] + draws.noise_arcsec[:, 0] * rng.standard_normal(len(draws.places))
    assert np.mean((seen > found.low_arcsec) & (seen < found.high_arcsec)) == pytest.approx(0.95, abs=0.015)
    far = prediction(cloud, trials(values), Trial(60.0, 99.0))
    assert not far.as_predicted
    assert far.surprise > 3


def statistics_of(values: np.ndarray, criterion: str = "expected", weights=None) -> PositionStatistics:
    """Positions 30 deg apart with such F'_ior, shape (torques, samples, positions)."""
    rotations = tuple(POSITIONS[: values.shape[2]])
    return PositionStatistics(
        rotations, values, values[..., 0], np.ones(values.shape[1]), Criterion.of(criterion), weights
    )


def losses_of(*F_ior: float, spread: float = 0.02) -> PositionStatistics:
    """The same of one torque, with such F'_ior on the mean."""
    off = 1 + spread * np.random.default_rng(1).standard_normal((500, len(F_ior)))
    return statistics_of((np.array(F_ior) * off)[None])


def test_losses_and_what_decides_between_positions() -> None:
    losses = losses_of(20.0, 15.0, 15.5, spread=0.03)
    least = losses.F_ior_arcsec[0].min(axis=1, keepdims=True)
    assert losses.losses == pytest.approx(losses.F_ior_arcsec[0] / least - 1)
    assert losses.probability_good == pytest.approx((losses.losses < 0.05).mean(axis=0))
    assert losses.ranked == [1, 2, 0]
    # a position that is mostly the best and at times far off
    values = np.full((1, 100, 2), 10.0)
    values[0, :, 1], values[0, :3, 1] = 9.5, 12.0
    by = {c: statistics_of(values, c).best for c in ("expected", "worst", "quantile=0.9")}
    assert by == {"expected": 1, "worst": 0, "quantile=0.9": 1}


def test_the_torque_served_worst_decides_and_weights_move_it() -> None:
    values = np.array([[[10.0, 12.0]], [[5.0, 4.0]]])
    assert statistics_of(values).best == 1
    assert statistics_of(values, weights=(2.0, 1.0)).best == 0


def test_another_torque_shares_the_scale_but_not_the_misfit(cloud: Prior) -> None:
    tried = trials(measured(50.0, 20.0), POSITIONS[::2])
    draws, both = learnt(cloud, tried, POSITIONS, torques=(1.0, M_G))
    assert both.F_ior_arcsec[1] == pytest.approx(draws.F_ior_arcsec[:, :-1])
    f = cloud.at(POSITIONS, draws.places, 1.0)
    left = both.F_ior_arcsec[0] - f * draws.scale[:, None]
    spread = np.hypot(draws.misfit, cloud.read_error[1.0]) * f.mean(axis=1)
    assert (left / spread[:, None]).std() == pytest.approx(1, abs=0.1)


def prediction_of(value: float, rotation: float = 60.0, expected: float = 15.0) -> Prediction:
    return Prediction(rotation, value, expected, expected - 3, expected + 3, 0.0)


@pytest.fixture(scope="module")
def advice() -> TrialAdvice:
    tried = trials(measured(50.0, 20.0), (*THIRDS, 60.0))
    drive = load_preset(SMALL, ["operation.M_g=4", ASSUMED])
    found = advise_from_trials(drive, tried, RIG, effort=TrialEffort(8, 32, 8, 256, 32, Mesh((9, 5, 9, 9), 12)))
    assert len(found.without) == 4
    return replace(found, without=())


def test_the_page_says_what_the_json_says(advice: TrialAdvice) -> None:
    told_ = trials_json(advice)
    assert trials_summary(advice) == (str(told_["best_bet"]["hole"]) if told_["settled"] else "unknown")
    assert told_["settled"] == (told_["best_bet"]["probability_good"] >= told_["probability_needed"])
    assert told_["instruction"] == trials_instruction(advice)
    assert told_["unknown"] == []
    assert trials_instruction(advice).startswith("No order yet") != told_["settled"]
    assert trials_exit_code(advice) == (0 if told_["settled"] else 6)
    facts = trials_card_facts(advice, texts())
    assert facts.choice.chosen.F_ior_arcsec == tuple(told_["best_bet"]["F_ior_arcsec"]["expected"])
    assert facts.cam_deg == told_["offset"]["direction_deg"]
    assert len(told_["prediction_errors"]) == 3


def verified(of: TrialAdvice, *F_ior: float, value: float = 15.0, explained: bool = True) -> TrialAdvice:
    """An advice whose outcome is a value of the third position, after trials in the first two."""
    outcome, others = prediction_of(value), (Trial(0.0, 20.0), Trial(30.0, 16.0))
    tried = (*others, Trial(60.0, value)) if explained else others
    return replace(
        of, losses=losses_of(*F_ior), trials=tried, predictions=(outcome, outcome), verifies=True, explained=explained,
        draws=replace(of.draws, misread=np.zeros(len(tried))), without=(),
    )  # fmt: skip


def test_an_outcome_has_its_verdict_and_exit_code(advice: TrialAdvice) -> None:
    hole = {"hole": 0, "rotation_deg": 0.0}
    for values, position, code in (
        ((20.0, 13.0, 15.0), 30.0, 3),
        ((20.0, 16.0, 12.0), 60.0, 0),
        ((20.0, 15.0, 15.1), 60.0, 0),  # going back for less is not worth it
        ((20.0, 16.0, 15.0, 14.5), 60.0, 6),
    ):
        after = verified(advice, *values)
        assert trials_exit_code(after) == code
        told_ = trials_json(after)["verification"]
        assert told_["verdict"] == ("GO_BACK" if code == 3 else "KEEP")
        assert told_["position"].keys() == hole.keys()
        assert told_["position"]["rotation_deg"] == after.stay[0] == position
        place = after.losses.rotations_deg.index(position)
        assert told_["probability_good"] == pytest.approx(after.losses.probability_good[place])
        assert told_["best"]["rotation_deg"] == after.losses.rotations_deg[after.losses.best]
        assert trials_instruction(after).startswith(
            "Go back to hole 1 (30 deg), where 16 was" if code == 3 else "Keep it: 15 arcsec at hole 2"
        )
        assert any("may be better" in words for words in trials_warnings(after, texts())) == (code == 6)


def test_an_outcome_that_nothing_explains_counts_by_its_value(advice: TrialAdvice) -> None:
    for value, code in ((99.0, 3), (16.1, 6), (10.0, 6)):
        after = verified(advice, 20.0, 13.0, 15.0, value=value, explained=False)
        assert (trials_exit_code(after), after.settled, after.stay[1]) == (code, False, 0.0)
        assert after.back_to == (after.trials[1] if code == 3 else None)


def test_a_hole_that_is_not_allowed_is_left_for_one_that_is(advice: TrialAdvice) -> None:
    after = verified(advice, 20.0, 16.0)  # the wheel is in the third
    assert after.back_to == after.trials[1]
    # nor is one gone back to, whatever was measured there
    alone = verified(advice, 20.0, value=700.0, explained=False)
    assert alone.back_to == alone.trials[0]


def test_the_hole_that_the_wheel_is_in_is_none_to_go_back_to(advice: TrialAdvice) -> None:
    after = verified(advice, 20.0, 16.0, 15.0, value=700.0, explained=False)
    tried = (*after.trials, Trial(60.0, 11.0))
    assert replace(after, trials=tried).back_to == after.trials[1]


@pytest.mark.parametrize("holes", [12, 14, 25, 49])
def test_holes_of_trials_are_the_positions_of_the_seat(holes: int) -> None:
    for hole, rotation in enumerate(usable_positions(holes, "all")):
        assert read_trial(f"h{hole}=17", holes).rotation_deg == rotation
        assert read_trial(f"{rotation!r}=17", holes).rotation_deg == rotation


def test_an_outcome_in_a_hole_that_is_not_allowed_is_none() -> None:
    assert read_trial("h4=17", 12, [3, 4]) == Trial(120.0, 17.0)
    with pytest.raises(UsageError, match=r"hole 5 is not one of mounting\.allowed"):
        read_trial("h5=17", 12, [3, 4])


def test_values_that_are_unlike_the_drive_or_each_other_are_remarked(advice: TrialAdvice) -> None:
    def said(of: TrialAdvice) -> str:
        return " ".join(trials_warnings(of, texts()))

    assert "unlike" not in said(advice)
    off = replace(advice, predictions=(*advice.predictions[:2], replace(advice.predictions[2], surprise=3.0)))
    assert "unlike those of a drive as the preset has it" in said(off)
    early = replace(advice, predictions=(replace(advice.predictions[0], surprise=3.0), *advice.predictions[1:]))
    assert "unlike" not in said(early)  # three trials fit any drive
    twice = replace(
        advice, trials=(*advice.trials, replace(advice.trials[0], F_ior_arcsec=advice.trials[0].F_ior_arcsec + 6))
    )
    assert "differ by more than a noise of 0.5" in said(twice)
    assert "differ by more" not in said(replace(twice, prior=replace(twice.prior, rig=Rig(M_G, 3.0))))


def test_values_unlike_the_drive_settle_nothing_before_one_position_is_measured_twice(advice: TrialAdvice) -> None:
    off = replace(advice.predictions[2], surprise=-3.0)
    unlike = replace(advice, predictions=(*advice.predictions[:2], off), needed=0.0)
    assert replace(advice, needed=0.0).settled
    assert trials_exit_code(unlike) == 6
    for one in (unlike, replace(unlike, verifies=True)):
        assert (one.unlike_told, one.settled) == (True, False)
        again = (
            f"nothing is settled before a position is measured twice: measure {advice.where(off.rotation_deg)} again"
        )
        assert again in " ".join(trials_warnings(one, texts()))
        assert "what is advised stands" not in page(one) + " ".join(trials_warnings(one, texts()))
    told_ = trials_json(unlike)
    assert (told_["settled"], told_["recommended"], told_["turn"]) == (False, None, False)
    assert told_["next"] == {**told_["next"], "rotation_deg": off.rotation_deg, "probability_after": None}
    assert trials_instruction(unlike).startswith("No order yet: the values came out unlike")
    twice = replace(unlike, trials=(*advice.trials, advice.trials[0]))
    assert (twice.unlike_told, twice.settled, trials_exit_code(twice)) == (True, True, 0)


def page(of: TrialAdvice) -> str:
    from rich.console import Console

    from hdassist.terminal.console import Style

    console = Console(width=1000)
    with console.capture() as seen:
        console.print(trials_page(of, Style(ascii=False, codes=False, width=1000)))
    return " ".join(seen.get().split())


def test_one_torque_alone_is_offered_where_several_do_not_settle_it(advice: TrialAdvice) -> None:
    one, losses = advice.prior, advice.losses
    twice = {name: np.repeat(getattr(losses, name), 2, axis=0) for name in ("F_ior_arcsec", "now_arcsec")}
    several = replace(
        advice,
        prior=replace(one, drive=changed(one.drive, operation__M_g=[M_G, 1.0])),
        losses=replace(losses, **twice),
    )
    alone = "as one more trial; with --torque 4 alone it decides for that torque only"
    assert alone in page(replace(several, needed=1.1))
    assert "alone it decides" not in page(replace(several, needed=0.0)) + page(replace(advice, needed=1.1))


def test_how_sure_the_best_position_keeps_a_limit(advice: TrialAdvice) -> None:
    drawn = advice.losses.at(advice.losses.best)[0]
    limit = float(np.quantile(drawn, 0.7))
    drive = load_preset(SMALL, ["operation.M_g=4", ASSUMED, f"acceptance.F_ior={limit}"])
    held = replace(advice, prior=replace(advice.prior, drive=drive))
    assert "limit 70 % sure that hole" in page(held)
    assert " sure that " not in page(advice)


def test_a_probability_below_the_one_wanted_is_not_rounded_up_to_it(advice: TrialAdvice) -> None:
    good = advice.stay[1]
    short = replace(advice, needed=good + 0.001)
    assert not short.settled
    sure, wanted = re.findall(r"([\d.]+)%", trials_instruction(short))[1:3]
    assert float(sure) < float(wanted)


def test_four_trials_without_a_repeat_ask_for_one_and_for_the_sense(advice: TrialAdvice) -> None:
    asked = "repeat hole 0 (0 deg)"
    assert asked in page(advice)
    assert "counter-clockwise, seen from the cam side" in page(advice)
    assert asked not in page(replace(advice, trials=advice.trials[:3], predictions=advice.predictions[:2]))
    repeated = replace(advice, trials=(*advice.trials[:3], replace(advice.trials[3], rotation_deg=0.0)))
    assert asked not in page(repeated)


def test_a_free_angle_and_many_holes() -> None:
    for holes, directions, count in ((0, 36, 72), (3, 9, 3), (100, 36, 100)):
        drive = told(f"mounting.holes={holes}")
        found = trial_prior(drive, (), RIG, effort=replace(COARSE, deviations=32))
        positions = usable_positions(holes, "all")
        assert found.weight.shape[1] == directions
        _, losses = learnt(found, [Trial(positions[-1], 20.0)], positions)
        assert len(losses.probability_good) == count


def test_an_error_of_the_seat_at_a_free_angle() -> None:
    free = trial_prior(told("mounting.holes=0"), (), Rig(M_G, 1.0, 1.0), effort=COARSE)
    assert np.all(free.seat[1] > 0)


def test_forbidden_holes_are_not_chosen(cloud: Prior) -> None:
    tried = trials(measured(50.0, 20.0))
    _, every = learnt(cloud, tried, POSITIONS)
    left = [r for r in POSITIONS if r != POSITIONS[every.best]]
    _, second = learnt(cloud, tried, left)
    assert values_near(left[second.best], POSITIONS[every.best])


def values_near(one: float, other: float) -> bool:
    return abs((one - other + 180) % 360 - 180) <= 60


def test_reading_trials() -> None:
    assert read_trial("120=17.3", 12) == Trial(120.0, 17.3)
    assert read_trial("h4=17.3", 12) == read_trial("H4=17.3", 12) == Trial(120.0, 17.3)
    assert read_trial("4=17.3", 0) == Trial(4.0, 17.3)
    assert read_trial("-30=17.3", 12) == Trial(330.0, 17.3)


NO_TRIALS = [
    "",
    "120",
    "120=",
    "=17",
    "h=17",
    "h12=17",
    "h-1=17",
    "h1.5=17",
    "x=17",
    "30=0",
    "30=-3",
    "30=nan",
    "inf=3",
    "4=17",
    "h4=run.csv",
]


@pytest.mark.parametrize("text", NO_TRIALS)
def test_what_is_no_trial(text: str) -> None:
    with pytest.raises(UsageError, match=r"trial|holes|no hole"):
        read_trial(text, 12)


@pytest.mark.parametrize(("old", "new"), [("h4:17.3", "h4=17.3"), ("120:17.3", "120=17.3")])
def test_the_old_form_has_the_new_one_in_its_hint(old: str, new: str) -> None:
    with pytest.raises(UsageError, match=f"invalid trial '{old}': expected HOLE=VALUE") as refused:
        read_trial(old, 12)
    assert refused.value.hint == new


def test_holes_of_a_seat_without_holes() -> None:
    with pytest.raises(UsageError, match="has none"):
        read_trial("h1=17", 0)


@pytest.mark.parametrize("rig", [(0.0,), (4.0, 0.0), (4.0, -1.0), (4.0, 1.0, -1.0), (float("nan"),)])
def test_rigs_that_are_none(rig: tuple[float, ...]) -> None:
    with pytest.raises(UsageError):
        Rig(*rig)


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["bearing.ball_motion=rolling", "bearing.d_ball=2"], "locked balls"),
        (["tolerances.e_hb=0"], "unknown size of the cam offset"),
    ],
)
def test_drives_that_trials_cannot_take(overrides: list[str], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        trial_prior(load_preset(SMALL, overrides), (), RIG, effort=FEW)


def test_what_a_preset_does_not_give_is_open_in_trials_too() -> None:
    paths = ["tolerances.e_hb", "tolerances.e_hh", "phases.phi_hb", "harmonics.a_s2"]
    drive = load_preset(SMALL, [f"{path}=unknown" for path in paths])
    found = {each.path: (each.low, each.high) for each in open_prior(drive).fields}
    assert {*paths, "harmonics.xi_s2"} == set(found)
    for path, high in (("tolerances.e_hb", 0.5 * 30), ("harmonics.xi_s2", 180)):
        assert found[path] == (0, pytest.approx(high))
    known = {each.path: (each.low, each.high) for each in open_prior(load_preset(SMALL)).fields}
    assert known["tolerances.e_hb"] == (0, 60)


def test_one_misread_value_of_six_carries_no_order(cloud: Prior) -> None:
    """Of six values that in the best of their holes is read 15 arcsec too high: it is suspected, nothing is settled."""
    values = measured(50.0, 20.0)
    tried = trials(values, (*THIRDS, 60.0, 90.0, 150.0))
    right, losses = learnt(cloud, tried, POSITIONS)
    wrong = [tried[0], replace(tried[1], F_ior_arcsec=tried[1].F_ior_arcsec + 15.0), *tried[2:]]
    require_reachable(cloud, wrong)
    draws, misread = learnt(cloud, wrong, POSITIONS)
    assert right.misread.max() < 0.3
    assert int(np.argmax(draws.misread)) == 1
    assert draws.misread[1] > 0.5
    assert values[losses.best] < 1.05 * min(values)
    assert misread.probability_good.max() < 0.9


def test_a_value_of_three_that_no_drive_shows_beside_the_others_is_named(cloud: Prior) -> None:
    tried = [*trials(measured(50.0, 20.0), THIRDS[:2]), Trial(240.0, 900.0)]
    with pytest.raises(UntrustedError, match=r"hole 8 \(240 deg\): measured 900 arcsec contradicts the others"):
        require_reachable(cloud, tried)


def test_a_choice_that_hinges_on_one_value_is_not_settled_and_says_which(advice: TrialAdvice) -> None:
    firm = replace(advice, needed=0.0, without=(0.9, 0.7, 0.8, 0.65))
    assert (firm.hinges_on, firm.settled) == (None, True)
    loose = replace(firm, without=(0.9, 0.7, 0.8, 0.55))
    assert (loose.hinges_on, loose.settled, trials_exit_code(loose)) == (advice.trials[3], False, 6)
    assert loose.to_repeat == advice.trials[3]
    assert f"hinges on {advice.trials[3].F_ior_arcsec:g} arcsec at hole" in " ".join(trials_warnings(loose, texts()))
    suspected = replace(loose, draws=replace(advice.draws, misread=np.array([0.1, 0.6, 0.0, 0.1])))
    assert suspected.to_repeat == advice.trials[1]
    assert "is probably misread (60 %)" in " ".join(trials_warnings(suspected, texts()))
    repeated = replace(loose, trials=(*advice.trials[:3], replace(advice.trials[3], rotation_deg=0.0)))
    assert repeated.to_repeat is None
