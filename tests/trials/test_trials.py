"""Trials: a hidden cam offset found again from F'_ior measured in a few positions."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.error.search import CycleSearch
from hdassist.errors import UntrustedError, UsageError
from hdassist.mounting.positions import rotated
from hdassist.preset.fields import Drive
from hdassist.terminal.texts import texts
from hdassist.trials.advice import TrialAdvice
from hdassist.trials.page import card_facts, exit_code, instruction, summary_line, to_json, warnings
from hdassist.trials.posterior import posterior
from hdassist.trials.prior import OffsetPrior, SampleSizes, offset_prior
from hdassist.trials.trial import Rig, Trial, read_trial, trial_positions
from hdassist.trials.verification import verify
from hdassist.trials.weighted import hills, picked, quantile
from tests.process import SMALL

M_G, HOLES = 4.0, 12
POSITIONS = trial_positions(HOLES, "all")
THIRDS = (0.0, 120.0, 240.0)
KNOWN = {"tolerances.e_hh": 1.0, "phases.phi_hh": 2.0}  # the cam's own offset, well measured
RIG = Rig(M_G, noise_arcsec=0.5)
FEW = SampleSizes(draws=8, compared=8)  # a cam that is well measured needs few draws of it


def told(**uncertainty: float) -> Drive:
    drive = load_preset(SMALL)
    return drive.model_copy(update={"uncertainty": KNOWN | uncertainty})


@pytest.fixture(scope="module")
def prior() -> OffsetPrior:
    return offset_prior(told(), (M_G,), reseat=True, sizes=FEW)


@pytest.fixture(scope="module")
def both() -> OffsetPrior:
    """The same with a torque before that of the trials, and no error of the seat."""
    return offset_prior(told(), (1.0, M_G), sizes=FEW)


def hidden(size: float, direction: float) -> Drive:
    return load_preset(SMALL).with_values({"tolerances.e_hb": size, "phases.phi_hb": direction})


@cache
def measured(size: float, direction: float) -> tuple[float, ...]:
    """F'_ior [arcsec] in each hole, by search."""
    drive = hidden(size, direction)
    search = CycleSearch(drive, M_G)
    return tuple(search.extremes(rotated(drive, r)).F_ior_arcsec for r in POSITIONS)


def trials(values: tuple[float, ...], rotations=THIRDS, off=(0.0, 0.0, 0.0)) -> list[Trial]:
    return [Trial(r, values[POSITIONS.index(r)] + o) for r, o in zip(rotations, off, strict=False)]


HIDDEN = [(50.0, 20.0), (40.0, 140.0), (40.0, 265.0)]


@pytest.mark.parametrize(("size", "direction"), HIDDEN)
def test_a_hidden_offset_is_recovered(prior: OffsetPrior, size: float, direction: float) -> None:
    known = posterior(prior, trials(measured(size, direction)), RIG, POSITIONS)
    one, *others = known.directions()
    assert not others
    off = (one.direction_deg - direction + 180) % 360 - 180
    assert abs(off) < max(3 * one.spread_deg, 5)
    assert one.spread_deg < 30
    mean, spread = known.offset_um
    assert abs(mean - size) < 3 * spread
    assert known.weight.sum() == pytest.approx(1)
    assert known.probability_best.sum() == pytest.approx(1)


@pytest.mark.slow
def test_recommends_better_than_a_sine_and_than_the_best_tried(prior: OffsetPrior) -> None:
    lost = {"trials": [], "sine": [], "tried": []}
    for seed in range(48):
        rng = np.random.default_rng(seed)
        values = np.array(measured(round(rng.uniform(10, 55), 1), round(rng.uniform(0, 360))))
        off = 0.5 * rng.standard_normal(3)
        tried = trials(tuple(values), off=off)
        y, angles = np.array([t.F_ior_arcsec for t in tried]), np.radians(THIRDS)
        sine = y @ np.cos(angles) * np.cos(np.radians(POSITIONS)) + y @ np.sin(angles) * np.sin(np.radians(POSITIONS))
        loss = values / values.min() - 1
        lost["trials"].append(loss[posterior(prior, tried, RIG, POSITIONS).best])
        lost["sine"].append(loss[int(np.argmin(sine))])
        lost["tried"].append(loss[POSITIONS.index(THIRDS[int(np.argmin(y))])])
    good = {way: np.mean(np.array(found) < 0.05) for way, found in lost.items()}
    assert good["trials"] >= 0.85
    assert good["trials"] > good["sine"]
    assert good["trials"] > good["tried"]


@pytest.mark.slow
def test_the_shipped_sample_sizes_find_the_offset_too() -> None:
    values = measured(40.0, 140.0)
    known = posterior(offset_prior(told(), (M_G,)), trials(values), RIG, POSITIONS)
    (one,) = known.directions()
    assert abs(one.direction_deg - 140) < max(3 * one.spread_deg, 5)
    assert values[known.best] < 1.05 * min(values)


def test_two_trials_leave_two_directions_and_a_third_decides(prior: OffsetPrior) -> None:
    values = measured(40.0, 135.0)
    two = posterior(prior, trials(values, THIRDS[:2]), RIG, POSITIONS)
    assert len(two.directions()) == 2
    three = posterior(prior, trials(values), RIG, POSITIONS)
    assert len(three.directions()) == 1
    assert three.expected_loss[three.best] < two.expected_loss[two.best]
    # what the next trial is said to bring is less than what is known now
    assert two.next_trial().loss < two.expected_loss[two.best]


def test_one_trial_leaves_the_direction_open(prior: OffsetPrior) -> None:
    known = posterior(prior, trials(measured(40.0, 265.0), THIRDS[:1]), RIG, POSITIONS)
    assert max(d.spread_deg for d in known.directions()) > 40
    told = warnings(TrialAdvice(prior.drive, known, known.next_trial(), None))
    assert any("do not settle it" in words for words in told)


def test_turning_the_wheel_is_turning_the_offset_back(prior: OffsetPrior) -> None:
    node = np.unravel_index(int(prior.weight.argmax()), prior.weight.shape)
    for rotation in (30.0, 77.5):
        size = 30  # place among the sizes
        direction = 40  # place among the directions, 200 deg
        drive = hidden(float(prior.size_um[size]), float(prior.direction_deg[direction]))
        exact = CycleSearch(drive, M_G).extremes(rotated(drive, rotation)).F_ior_arcsec
        found = prior.at(rotation)[0, node[0], size, direction] / prior.scale[node[0]]
        assert found == pytest.approx(exact, abs=4 * prior.standard_error_arcsec[0] + 0.5)


def test_with_the_flexspline_fixed_its_own_offset_is_found() -> None:
    drive = load_preset(SMALL, ["mounting.fixed=flexspline", "tolerances.e_hb=0", "tolerances.e_hg=30"])
    drive = drive.model_copy(update={"uncertainty": KNOWN})
    truth = drive.with_values({"tolerances.e_hg": 45.0, "phases.phi_hg": 130.0})
    search = CycleSearch(truth, M_G)
    tried = [Trial(r, search.extremes(rotated(truth, r)).F_ior_arcsec) for r in THIRDS]
    known = posterior(offset_prior(drive, (M_G,), sizes=FEW), tried, RIG, POSITIONS)
    (one,) = known.directions()
    assert abs(one.direction_deg - 130) < max(3 * one.spread_deg, 5)


def test_an_uncertain_seat_blurs_what_is_known(prior: OffsetPrior) -> None:
    tried = trials(measured(50.0, 20.0))
    firm = posterior(prior, tried, RIG, POSITIONS)
    loose = posterior(prior, tried, replace(RIG, reseat_um=5.0), POSITIONS)
    assert loose.directions()[0].spread_deg > firm.directions()[0].spread_deg
    assert np.all(loose.spread_arcsec > RIG.noise_arcsec)


@pytest.mark.parametrize(
    ("size", "direction", "rel"),
    [(28, 40, 0.1), (40, 50, 0.1), (28, 12, 0.35)],  # the last: a kink of F'_ior, where a slope tells little
)
def test_the_seats_error_is_that_of_a_displaced_wheel(
    prior: OffsetPrior, size: int, direction: int, rel: float
) -> None:
    """Against drives whose wheel is really displaced, its teeth along the radius as well."""
    reseat = 3.0
    drive = hidden(float(prior.size_um[size]), float(prior.direction_deg[direction]))
    search = CycleSearch(drive, M_G)
    found = []
    for angle in range(0, 360, 30):
        off = {"tolerances.e_b": float(np.sqrt(2) * reseat), "phases.phi_eb": float(angle)}  # each component by reseat
        found.append(search.extremes(drive.with_values(off)).F_ior_arcsec)
    seen = prior.seat_error(0.0, reseat)[0, prior.scale == 1, size, direction].mean()
    assert seen == pytest.approx(np.std(found), rel=rel)


def test_values_that_nothing_explains_are_refused(prior: OffsetPrior) -> None:
    with pytest.raises(UntrustedError, match=r"no cam offset up to 60 um explains .*hole 4 \(120 deg\): measured 400"):
        posterior(prior, [Trial(0, 20.0), Trial(120, 400.0)], RIG, POSITIONS)


def test_forbidden_holes_are_not_chosen(prior: OffsetPrior) -> None:
    tried = trials(measured(50.0, 20.0))
    best = posterior(prior, tried, RIG, POSITIONS)
    left = [r for r in POSITIONS if r != POSITIONS[best.best]]
    second = posterior(prior, tried, RIG, left)
    assert left[second.best] == POSITIONS[int(np.argsort(best.expected_loss)[1])]


def test_two_torques_and_their_weights(both: OffsetPrior) -> None:
    tried = trials(measured(50.0, 20.0))
    alone = [posterior(both, tried, RIG, POSITIONS, weights=w) for w in ((1.0, 1e-9), (1e-9, 1.0))]
    for k, known in enumerate(alone):
        relative = known.F_ior_arcsec[k] / known.F_ior_arcsec[k].min(axis=1, keepdims=True)
        assert known.merits == pytest.approx(relative)
    together = posterior(both, tried, RIG, POSITIONS)
    assert together.merits == pytest.approx(np.maximum(alone[0].merits, alone[1].merits))
    # only the torques that decide count
    first = posterior(both, tried, RIG, POSITIONS, deciding=1)
    assert first.merits == pytest.approx(alone[0].merits)


def test_criteria(prior: OffsetPrior) -> None:
    tried = trials(measured(50.0, 20.0), THIRDS[:2])
    expected, worst, most = (
        posterior(prior, tried, RIG, POSITIONS, criterion=c) for c in ("expected", "worst", "quantile:0.9")
    )
    assert np.all(worst.value >= most.value)
    assert np.all(worst.value >= expected.value)
    assert most.value == pytest.approx([quantile(col, most.weight, 0.9) for col in most.losses.T])


def test_a_prior_of_the_offset_counts() -> None:
    tried = trials(measured(50.0, 20.0), THIRDS[:2])
    two = posterior(offset_prior(told(), (M_G,), sizes=FEW), tried, RIG, POSITIONS)
    other = min(two.directions(), key=lambda d: abs((d.direction_deg - 20 + 180) % 360 - 180))
    facing = told(**{"phases.phi_hb": 40.0}).with_values({"phases.phi_hb": 30.0})
    (one,) = posterior(offset_prior(facing, (M_G,), sizes=FEW), tried, RIG, POSITIONS).directions()
    assert one.direction_deg == pytest.approx(other.direction_deg, abs=10)


def test_a_drive_that_errs_more_than_the_model_is_found_all_the_same(prior: OffsetPrior) -> None:
    values = measured(50.0, 20.0)
    many = POSITIONS[::2]
    none = (0.0,) * len(many)
    same = posterior(prior, trials(values, many, none), RIG, POSITIONS)
    more = posterior(prior, trials(tuple(1.12 * v for v in values), many, none), RIG, POSITIONS)
    assert more.scale[0] - same.scale[0] > 0.04
    assert more.best == same.best
    assert more.directions()[0].direction_deg == pytest.approx(same.directions()[0].direction_deg, abs=5)


def test_stiffness_sets_are_weighed() -> None:
    drive = told()
    soft = {"supports.C_3": 1.0e3, "contact.c_t": 1.2e-4}
    drive = drive.model_copy(update={"alternatives": (soft,)})
    truth = hidden(50.0, 20.0).with_values(soft)
    search = CycleSearch(truth, M_G)
    tried = [Trial(r, search.extremes(rotated(truth, r)).F_ior_arcsec) for r in POSITIONS[::2]]
    assert posterior(offset_prior(drive, (M_G,), sizes=FEW), tried, RIG, POSITIONS).model_share[1] > 0.9


def test_an_outcome_is_kept_or_given_back(prior: OffsetPrior) -> None:
    values = measured(50.0, 35.0)
    known = posterior(prior, trials(values), RIG, POSITIONS)
    best = POSITIONS[known.best]
    good = verify(known, Trial(best, values[known.best]))
    assert good.keep
    assert good.as_predicted
    # the interval holds 95 % of what the posterior draws
    rng = np.random.default_rng(0)
    nodes = rng.choice(len(known.weight), 20_000, p=known.weight)
    drawn = known.F_ior_arcsec[0, nodes, known.best]
    drawn = drawn + known.spread_arcsec[nodes, known.best] * rng.standard_normal(len(nodes))
    assert np.mean((drawn > good.low_arcsec) & (drawn < good.high_arcsec)) == pytest.approx(0.95, abs=0.01)
    bad = verify(known, Trial(best, 99.0))
    assert not bad.as_predicted
    assert bad.after is None  # nothing explains it
    assert bad.back_to == min(known.trials, key=lambda t: t.F_ior_arcsec)
    worse = verify(known, Trial(0.0, values[0]))  # as predicted, in a hole that is not the best tried
    assert worse.as_predicted
    assert not worse.keep
    for outcome, code, hole in ((good, 0, known.best), (bad, 3, round(bad.stay_deg / 30))):
        advice = TrialAdvice(told().with_values({"mounting.holes": 12}), known, known.next_trial(), outcome)
        assert exit_code(advice) == code
        assert summary_line(advice) == f"{hole}"
        verdict = to_json(advice, 0)["verification"]["verdict"]
        assert verdict == ("KEEP" if code == 0 else "GO_BACK")
        assert instruction(advice).startswith("Keep it" if code == 0 else "Go back to hole")


def test_the_same_hole_again_is_kept_whatever_the_noise(prior: OffsetPrior) -> None:
    values = measured(50.0, 20.0)
    known = posterior(prior, trials(values), RIG, POSITIONS)
    least = min(known.trials, key=lambda t: t.F_ior_arcsec)
    assert verify(known, Trial(least.rotation_deg, least.F_ior_arcsec + 1)).keep


def test_an_outcome_counts_at_all_torques_that_decide(both: OffsetPrior) -> None:
    """A hole that is worse at the trials' torque may be the better one over all."""
    light = hidden(26.0, 300.0)
    search = CycleSearch(light, 1.0)
    tried = [Trial(r, search.extremes(rotated(light, r)).F_ior_arcsec) for r in THIRDS]
    known = posterior(both, tried, Rig(1.0, 1.0), POSITIONS)
    best = POSITIONS[known.best]
    value = search.extremes(rotated(light, best)).F_ior_arcsec
    assert verify(known, Trial(best, value)).keep


def test_which_hole_is_called_0_does_not_matter(both: OffsetPrior) -> None:
    """The same seat and evidence, holes counted from another one."""
    assert told().phases.xi_b == 90
    shifted = offset_prior(told().with_values({"phases.xi_b": 90.0 + 120.0}), (1.0, M_G), sizes=FEW)
    values = measured(40.0, 140.0)
    chosen = []
    for counted, first in ((both, 0.0), (shifted, 120.0)):
        tried = [Trial((r - first) % 360, values[POSITIONS.index(r)]) for r in THIRDS]
        known = posterior(counted, tried, RIG, POSITIONS)
        chosen.append((POSITIONS[known.best] + first) % 360)
    assert chosen[0] == chosen[1]


def test_what_is_known_exactly_is_no_fault() -> None:
    exact = load_preset(
        SMALL, ["tolerances.e_hh=10±0", "phases.phi_hh=0±0", "tolerances.e_hb=50±0", "phases.phi_hb=20±0"]
    )
    known = posterior(offset_prior(exact, (M_G,), sizes=FEW), trials(measured(50.0, 20.0)), RIG, POSITIONS)
    (one,) = known.directions()
    assert one.direction_deg == pytest.approx(20, abs=5)
    assert known.offset_um[0] == pytest.approx(50, abs=2)


def test_the_card_says_what_the_text_says(prior: OffsetPrior) -> None:
    drive = told().with_values({"mounting.holes": 12})
    known = posterior(replace(prior, drive=drive), trials(measured(50.0, 20.0)), RIG, POSITIONS)
    advice = TrialAdvice(drive, known, known.next_trial(), None)
    facts = card_facts(advice, texts())
    assert facts.choice.chosen.rotation_deg == POSITIONS[known.best]
    assert facts.choice.turn == bool(known.best)
    assert facts.cam_deg == pytest.approx(known.directions()[0].direction_deg)
    answer = to_json(advice, 0)
    assert facts.choice.chosen.F_ior_arcsec == tuple(answer["recommended"]["F_ior_arcsec"]["expected"])
    assert [p.rotation_deg for p in facts.choice.ranked] == [POSITIONS[place] for place in advice.ranked]
    few = posterior(replace(prior, drive=drive), trials(measured(40.0, 265.0), THIRDS[:1]), RIG, POSITIONS)
    open_one = TrialAdvice(drive, few, few.next_trial(), None)
    assert card_facts(open_one, texts()).cam_deg is None  # no arrow to a direction that is not known
    assert exit_code(open_one) == 6


def test_reading_trials() -> None:
    assert read_trial("120:17.3", 12) == Trial(120.0, 17.3)
    assert read_trial("h4:17.3", 12) == read_trial("H4:17.3", 12) == Trial(120.0, 17.3)
    assert read_trial("4:17.3", 0) == Trial(4.0, 17.3)
    assert read_trial("-30:17.3", 12) == Trial(330.0, 17.3)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "120",
        "120:",
        ":17",
        "h:17",
        "h12:17",
        "h-1:17",
        "h1.5:17",
        "x:17",
        "30:0",
        "30:-3",
        "30:nan",
        "inf:3",
        "4:17",
    ],
)
def test_what_is_no_trial(text: str) -> None:
    with pytest.raises(UsageError, match=r"trial|holes|no hole"):
        read_trial(text, 12)


def test_holes_of_a_seat_without_holes() -> None:
    with pytest.raises(UsageError, match="has none"):
        read_trial("h1:17", 0)


@pytest.mark.parametrize("rig", [Rig(0.0), Rig(4.0, 0.0), Rig(4.0, -1.0), Rig(4.0, 1.0, -1.0), Rig(float("nan"))])
def test_rigs_that_are_none(prior: OffsetPrior, rig: Rig) -> None:
    with pytest.raises(UsageError):
        rig.require_sound()


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["bearing.ball_motion=rolling", "bearing.d_ball=2"], "locked balls"),
        (["tolerances.e_hb=0"], "nothing is known of the size"),
        (["uncertainty.gears.j_n=1"], "cannot take in an uncertainty of gears.j_n"),
    ],
)
def test_drives_that_trials_cannot_take(overrides: list[str], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        offset_prior(load_preset(SMALL, overrides), (M_G,), sizes=FEW)


def test_hills_of_a_density_on_a_circle() -> None:
    angle = np.arange(72) * 5.0

    def near(middle: float, width: float) -> np.ndarray:
        return np.exp(-0.5 * (((angle - middle + 180) % 360 - 180) / width) ** 2)

    one = hills(near(355, 20))
    assert len(one) == 1
    assert len(one[0]) == 72
    two = hills(near(350, 15) + 0.6 * near(120, 15))
    assert len(two) == 2
    assert sorted(np.concatenate(two)) == list(range(72))
    assert {70 in part for part in two} == {True, False}
    assert len(hills(near(100, 30) + 0.9 * near(150, 30))) == 1  # a shallow valley parts nothing


def test_quantiles_and_draws_of_weighted_values() -> None:
    values = np.array([3.0, 1.0, 2.0])
    weight = np.array([0.2, 0.5, 0.3])
    assert [quantile(values, weight, q) for q in (0.0, 0.4, 0.6, 0.9, 1.0)] == [1.0, 1.0, 2.0, 3.0, 3.0]
    assert np.bincount(picked(weight, 1000)).tolist() == [200, 500, 300]
