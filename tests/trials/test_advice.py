"""The advice after trials: positions, outcomes, remarks, and its report."""

import re
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from hdassist import load_preset
from hdassist.belief.evidence import evidence_of
from hdassist.belief.prior import prior_of
from hdassist.belief.samples import SamplingEffort, draw_samples
from hdassist.belief.statistics import probability_by_share
from hdassist.belief.tabled import TableEffort
from hdassist.error.error_map import ErrorMap
from hdassist.error.self_error import self_error
from hdassist.mounting.losses import PositionStatistics
from hdassist.mounting.positions import rotated
from hdassist.mounting.trial import Trial
from hdassist.pages.trials import trials_card_facts, trials_instruction, trials_report, trials_warnings
from hdassist.terminal.answers import report_object
from hdassist.terminal.console import Style
from hdassist.terminal.page import report_page
from hdassist.terminal.texts import texts
from hdassist.terminal.words import probability_words
from hdassist.trials.advice import TrialAdvice, advise_from_trials
from hdassist.trials.posterior import (
    Prediction,
)
from hdassist.trials.prior import Rig, TrialEffort
from hdassist.verdict import SURE
from tests.process import ASSUMED, SMALL, TINY
from tests.support import PROVEN, changed
from tests.trials.drives import (
    COARSE_MESH,
    M_G,
    POSITIONS,
    RIG,
    THIRDS,
    measured,
    trials,
)


def statistics_of(values: np.ndarray) -> PositionStatistics:
    """Positions 30 deg apart with such F'_ior, shape (torques, samples, positions)."""
    rotations = tuple(POSITIONS[: values.shape[2]])
    return PositionStatistics(rotations, values, values[..., 0], np.ones(values.shape[1]))


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
    assert statistics_of(values).best == 1


def test_the_torque_served_worst_decides() -> None:
    values = np.array([[[10.0, 12.0]], [[5.0, 4.0]]])
    assert statistics_of(values).best == 1


def as_json(of: TrialAdvice) -> dict[str, Any]:
    return report_object(trials_report(of))


def with_trials(of: TrialAdvice, tried: tuple[Trial, ...], **more: Any) -> TrialAdvice:
    """The advice as if after other trials."""
    return replace(of, trials=tried, draws=replace(of.draws, misread=np.resize(of.draws.misread, len(tried))), **more)


def repeated(of: TrialAdvice, **more: Any) -> TrialAdvice:
    """The advice as if its first trial had been made twice."""
    return with_trials(of, (*of.trials, of.trials[0]), **more)


def exit_code(of: TrialAdvice) -> int:
    return trials_report(of).exit_code


def prediction_of(value: float, rotation: float = 60.0, expected: float = 15.0) -> Prediction:
    return Prediction(rotation, value, expected, expected - 3, expected + 3, 0.0)


@pytest.fixture(scope="module")
def advice() -> TrialAdvice:
    tried = trials(measured(50.0, 20.0), (*THIRDS, 60.0))
    drive = load_preset(SMALL, ["operation.M_g=4", ASSUMED])
    found = advise_from_trials(drive, tried, RIG, effort=TrialEffort(8, 32, 8, 256, TableEffort(32, COARSE_MESH)))
    assert len(found.without) == 4
    return replace(found, without=())


def test_the_page_says_what_the_json_says(advice: TrialAdvice) -> None:
    told_ = as_json(advice)
    assert trials_report(advice).line == (str(told_["best_bet"]["hole"]) if told_["settled"] else "unknown")
    assert told_["settled"] == (told_["best_bet"]["probability_good"] >= told_["probability_needed"])
    assert told_["instruction"] == trials_instruction(advice)
    assert told_["unknown"] == []
    assert trials_instruction(advice).startswith("No order yet") != told_["settled"]
    assert exit_code(advice) == (0 if told_["settled"] else 6)
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
        assert exit_code(after) == code
        told_ = as_json(after)["verification"]
        assert told_["verdict"] == ("GO_BACK" if code == 3 else "KEEP")
        assert told_["position"].keys() == hole.keys()
        assert told_["position"]["rotation_deg"] == after.stay[0] == position
        place = after.losses.rotations_deg.index(position)
        assert told_["probability_good"] == pytest.approx(after.losses.probability_good[place])
        assert told_["best"]["rotation_deg"] == after.losses.rotations_deg[after.losses.best]
        assert trials_instruction(after).startswith(
            "Go back to hole 1 (30°), where 16 was" if code == 3 else "Keep it: 15″ at hole 2"
        )
        assert any("may be better" in words for words in trials_warnings(after, texts())) == (code == 6)


def test_an_outcome_that_nothing_explains_counts_by_its_value(advice: TrialAdvice) -> None:
    for value, code in ((99.0, 3), (16.1, 6), (10.0, 6)):
        after = verified(advice, 20.0, 13.0, 15.0, value=value, explained=False)
        assert (exit_code(after), after.settled, after.stay[1]) == (code, False, 0.0)
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


def test_values_that_are_unlike_the_drive_or_each_other_are_remarked(advice: TrialAdvice) -> None:
    def said(of: TrialAdvice) -> str:
        return " ".join(trials_warnings(of, texts()))

    assert "unlike" not in said(advice)
    first, *_ = trials_warnings(replace(advice, likelier_torque=1.0), texts())
    assert first == "the values fit 1 N·m far better than 4 N·m: measured at it? (--trial-torque 1)"
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
    assert repeated(advice, needed=0.0).settled
    assert exit_code(unlike) == 6
    for one in (unlike, replace(unlike, verifies=True)):
        assert (one.unlike_told, one.settled) == (True, False)
        again = (
            f"nothing is settled before a position is measured twice: measure {advice.where(off.rotation_deg)} again"
        )
        assert again in " ".join(trials_warnings(one, texts()))
        assert "what is advised stands" not in page(one) + " ".join(trials_warnings(one, texts()))
    told_ = as_json(unlike)
    assert (told_["settled"], told_["recommended"], told_["turn"]) == (False, None, False)
    assert told_["next"] == {**told_["next"], "rotation_deg": off.rotation_deg, "probability_after": None}
    assert trials_instruction(unlike).startswith("No order yet: the values came out unlike")
    twice = repeated(unlike)
    assert (twice.unlike_told, twice.settled, exit_code(twice)) == (True, True, 0)


def test_of_values_unlike_the_drive_no_single_one_may_carry_the_choice(advice: TrialAdvice) -> None:
    """One of them, the noise or the model is off, and it is not known which: each may be the misread one."""
    carried = repeated(advice, needed=0.8, losses=losses_of(20.0, 15.0), without=(0.9, 0.7, 0.9, 0.9, 0.9))
    assert (carried.unlike_told, carried.settled) == (False, True)
    off = (*carried.predictions[:2], replace(carried.predictions[2], surprise=-3.0))
    unlike = replace(carried, predictions=off)
    assert (unlike.unlike_told, unlike.settled, unlike.hinges_on) == (True, False, advice.trials[1])
    assert "70 % without it, 80 % are wanted" in " ".join(trials_warnings(unlike, texts()))
    assert replace(unlike, without=(0.9, 0.85, 0.9, 0.9, 0.9)).settled


def test_few_values_settle_nothing_before_one_position_is_measured_twice(advice: TrialAdvice) -> None:
    """They do not tell the noise: with twice the stated one an order from three or four was as often wrong as right."""
    sure = replace(advice, needed=0.8, losses=losses_of(20.0, 15.0), predictions=())
    few, many = (tuple(Trial(30.0 * k, 15.0) for k in range(count)) for count in (5, 6))
    once = with_trials(sure, few)
    assert (once.sure, once.settled, once.to_repeat) == (True, False, few[1])  # that of the choice
    assert "none was measured twice" in trials_instruction(once)
    assert repeated(once).settled
    assert with_trials(sure, many).settled  # so many that agree tell the noise


def page(of: TrialAdvice) -> str:
    console = Console(width=1000)
    with console.capture() as captured:
        console.print(report_page(trials_report(of), Style(ascii=False, codes=False, width=1000), details=True))
    return " ".join(captured.get().split())


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
    assert "alone it decides" not in page(repeated(several, needed=0.0)) + page(replace(advice, needed=1.1))


def test_how_sure_the_best_position_keeps_a_limit_with_the_self_error(advice: TrialAdvice) -> None:
    drawn, own = advice.losses.at(advice.losses.best)[0], self_error(advice.drive, [M_G])[0].range_arcsec
    limit = round(float(np.quantile(drawn, 0.7)) + own, 3)
    drive = load_preset(SMALL, ["operation.M_g=4", ASSUMED, f"acceptance.F_ior={limit}"])
    held = replace(advice, prior=replace(advice.prior, drive=drive))
    chance = probability_by_share(float(np.mean(drawn + own <= limit)), advice.draws.effective)
    kept = f"at 4 N·m: F'_ior + self error ≤ {limit:g}″: {probability_words(chance, SURE)}"
    assert re.search(rf"limit hole \d+ \(\d+°\) {re.escape(kept)}", page(held))
    assert "self error" not in page(advice)


def test_a_probability_below_the_one_wanted_is_not_rounded_up_to_it(advice: TrialAdvice) -> None:
    good = advice.stay[1]
    short = replace(advice, needed=good + 0.001)
    assert not short.settled
    sure, wanted = re.findall(r"([\d.]+) %", trials_instruction(short))[1:3]
    assert float(sure) < float(wanted)


def test_a_repeat_is_asked_for_where_one_value_decides_or_before_a_seventh_position(advice: TrialAdvice) -> None:
    unsure = replace(advice, needed=1.1, losses=losses_of(20.0, 15.0, 15.5))
    few, many = (tuple(Trial(30.0 * k, 15.0) for k in range(count)) for count in (5, 6))
    assert with_trials(unsure, few, predictions=(), without=(0.3,) * 5).to_repeat is None
    due = with_trials(unsure, many, predictions=(), without=())
    assert due.to_repeat == many[1]  # in the hole of the choice
    assert replace(due, without=(0.9, 0.9, 0.3, 0.9, 0.9, 0.9)).to_repeat == many[2]
    assert replace(due, trials=(*many[:5], many[0])).to_repeat is None  # one was


def test_a_choice_that_hinges_on_one_value_is_not_settled_and_says_which(advice: TrialAdvice) -> None:
    firm = repeated(advice, needed=0.0, without=(0.9, 0.7, 0.8, 0.65, 0.9))
    assert (firm.hinges_on, firm.settled) == (None, True)
    loose = replace(advice, needed=0.0, without=(0.9, 0.7, 0.8, 0.55))
    assert (loose.hinges_on, loose.settled, exit_code(loose)) == (advice.trials[3], False, 6)
    assert loose.to_repeat == advice.trials[3]
    assert f"but not without {advice.trials[3].F_ior_arcsec:g}″ at hole" in trials_instruction(loose)
    assert f"hinges on {advice.trials[3].F_ior_arcsec:g}″ at hole" in " ".join(trials_warnings(loose, texts()))
    suspected = replace(loose, draws=replace(advice.draws, misread=np.array([0.1, 0.6, 0.0, 0.1])))
    assert suspected.to_repeat == advice.trials[1]
    assert "is probably misread (60 %)" in " ".join(trials_warnings(suspected, texts()))
    again = replace(loose, trials=(*advice.trials[:3], replace(advice.trials[3], rotation_deg=0.0)))
    assert (again.to_repeat, again.settled) == (None, False)


OPEN = [f"phases.{name}=unknown" for name in ("phi_hb", "xi_b", "xi_g", "phi_hh")] + ["tolerances.e_hb=unknown"]
SEAT = ["mounting.holes=6", "operation.M_g=4", "source.cam.W_0={kind: assumed, range: [1.6, 1.8], ref: judged}"]


def test_measured_errors_in_three_holes_mean_the_same_to_check_and_mount_as_to_trials():
    """All directions are unknown, so that hardly any draw of the prior alone agrees with all three values."""
    directions = ("phi_hb=20", "xi_b=100", "xi_g=210", "phi_hh=40")
    true = load_preset(TINY, [*(f"phases.{each}" for each in directions), "tolerances.e_hb=8", *SEAT])
    search = ErrorMap(true, 4.0)
    values = {hole: round(search.extremes(rotated(true, 60.0 * hole)).first, 2) for hole in (0, 2, 4)}
    readings = ", ".join(f"h{hole}@4: {value} ± 2" for hole, value in values.items())
    drive, holes = load_preset(TINY, [*OPEN, *SEAT, f"measured.F_ior={{{readings}}}"]), (0.0, 60.0, 120.0, 240.0)
    draw = partial(draw_samples, prior_of(drive), (4.0,), evidence=evidence_of(drive))
    samples = draw(rotations_deg=holes, effort=SamplingEffort(16, 16, 512, 32))
    found = PositionStatistics.of(samples, holes)
    tried = [Trial(60.0 * hole, value) for hole, value in values.items()]
    losses = advise_from_trials(load_preset(TINY, [*OPEN, *SEAT]), tried, Rig(4.0, 1.0)).losses
    for hole in values:  # 5th percentile, median and 95th percentile
        here, there = (each.range_of(each.at(each.place(60.0 * hole))[0]) for each in (found, losses))
        assert here == pytest.approx(there, rel=0.02)
    for place, rotation in enumerate(holes):
        there = losses.place(rotation)
        assert found.quantile(0.5, place) == pytest.approx(losses.quantile(0.5, there), rel=0.1)
    # F'_ior as mounted is that which was measured, and the same with fewer positions asked for
    fewer = draw(effort=SamplingEffort(1, 1, 16, 16)).F_ior_arcsec
    assert fewer == pytest.approx(samples.F_ior_arcsec[: len(fewer)], abs=PROVEN)
    assert samples.F_ior_arcsec[:, 0] == pytest.approx(samples.turned_arcsec[:, 0, 0], abs=PROVEN)
    assert samples.percentile(0.05, 0) < values[0] < samples.percentile(0.95, 0)
