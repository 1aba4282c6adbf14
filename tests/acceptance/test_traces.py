"""Measured traces: of the full cycle or of a part, in one direction or two, with all that is stated of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hdassist.features.acceptance.accept import covered_cycle
from hdassist.features.acceptance.answer import answer_json
from hdassist.features.acceptance.decision import GUARD
from hdassist.features.acceptance.limits import limits_of
from hdassist.features.acceptance.request import Request, torque_and_file
from hdassist.features.measuring.full_cycle import full_cycle, with_full_cycle
from hdassist.features.measuring.measure import measure
from hdassist.features.measuring.orders import STATED
from hdassist.interface.pages.accept import accept_report
from hdassist.run.errors import DataError, UsageError
from tests.helpers.acceptances import accept, small, stated, tiny
from tests.helpers.paper import facts_of
from tests.helpers.process import TINY
from tests.helpers.rigs import drive_error, recorded, turn_range, whole_range

CYCLE = 30  # cam turns of the small drive
RATE = 60  # states of a trace in each
NOTHING = dict.fromkeys(STATED, 0.0)  # every source of the budget stated to be none
RNG = np.random.default_rng(3)
CURVE = drive_error(RNG, CYCLE)


def rig(turns: int, noise: float = 0.2):
    x = np.arange(turns * RATE) / RATE
    return recorded(x, CURVE(x) + noise * np.random.default_rng(turns).standard_normal(len(x)))


def test_a_trace_of_the_full_cycle_decides():
    drive = small("F_ior@4=50", "turn_range@4=50", "order_2=50")
    found = accept(drive, {4.0: measure(rig(CYCLE), drive=drive)}, measured_only=True)
    F_ior, within, second = found.checks
    assert F_ior.value == pytest.approx(whole_range(CURVE, CYCLE), abs=1.5 * F_ior.expanded_uncertainty)
    fine = np.arange(CYCLE * 720) / 720
    assert within.value == pytest.approx(turn_range(CURVE, CYCLE), abs=1.5 * within.expanded_uncertainty)
    spectrum = 2 * np.abs(np.fft.rfft(CURVE(fine))) / len(fine)
    assert second.value == pytest.approx(spectrum[2 * CYCLE], abs=2 * second.expanded_uncertainty)
    assert {k.extent for k in (F_ior, within, second)} == {"whole"}
    assert found.left_out == ("amplitude of order 2 without sidebands at 1 N·m",)
    assert {note.code for note in found.remarks} == {"BUDGET", "NOT_TESTED"}


@pytest.mark.thorough
def test_short_partial_cycle_can_fail_a_drive_but_never_pass():
    measured = {4.0: measure(rig(5), drive=small())}
    for limit, verdict in ((1.0, "FAIL"), (1000.0, "INCONCLUSIVE")):
        drive = small(f"F_ior@4={limit}", f"turn_range@4={limit}")
        found = accept(drive, measured)
        assert [d.verdict for d in found.checks] == [verdict] * 2
        assert "COVERAGE" in [note.code for note in found.remarks]
    facts = facts_of(accept_report(found, None, drive))
    assert (
        facts["measure"] == "the full mesh cycle of 30 input revolutions; a recording of less than a third of the "
        "cycle cannot result in PASS"
    )
    assert facts["next"].endswith("--measured 4=FILE --budget encoder=U,coupling=U,reseating=U,temperature=U")
    assert accept(small("order_2=1"), measured, measured_only=True).verdict == "INCONCLUSIVE"


@pytest.mark.thorough
def test_half_cycle_passes_by_the_upper_end_of_its_model():
    measured = {4.0: measure(rig(CYCLE // 2), drive=small(), stated=NOTHING)}
    (direction,) = measured[4.0].directions
    at_most = full_cycle(measured[4.0], direction).at_most_arcsec
    assert whole_range(CURVE, CYCLE) < at_most
    checks = {}
    for limit in (0.5 * direction.interval_arcsec[0], at_most - 0.1, at_most + 0.1):
        (check,) = accept(small(f"F_ior@4={limit!r}"), measured, measured_only=True).checks
        checks[check.verdict] = check
    assert list(checks) == ["FAIL", "INCONCLUSIVE", "PASS"]
    passed = checks["PASS"]
    assert (passed.extent, passed.at_most, passed.margin) == ("at least", at_most, pytest.approx(0.1))
    assert passed.full_cycle.share == pytest.approx(0.5, abs=0.02)
    first, last = passed.full_cycle.record_next_deg
    assert 170 < first < last < 361
    unstated = {4.0: measure(rig(CYCLE // 2), drive=small())}
    assert accept(small("F_ior@4=1000"), unstated, measured_only=True).verdict == "INCONCLUSIVE"
    only_bounded = accept(small("turn_range@4=1000"), measured, measured_only=True)  # it has no upper end
    assert only_bounded.verdict == "INCONCLUSIVE"


def test_less_than_a_third_of_the_cycle_never_passes():
    measured = {4.0: measure(rig(CYCLE // 4), drive=small(), stated=NOTHING)}
    (check,) = accept(small("F_ior@4=1000"), measured, measured_only=True).checks
    assert (check.verdict, check.at_most) == ("INCONCLUSIVE", None)
    assert check.full_cycle.why_open
    assert check.full_cycle.record_next_deg


def test_order_absent_from_the_recording_is_refused():
    measured = {4.0: measure(rig(CYCLE), drive=small())}
    with pytest.raises(
        UsageError, match=r"2\.01 does not exist in the full mesh cycle"
    ):  # not that of order 2, its neighbour
        accept(small("order_2.01=1"), measured, measured_only=True)


@pytest.mark.thorough
def test_partial_cycle_beside_a_full_cycle_changes_no_verdict():
    x = np.concatenate([np.arange(CYCLE * RATE), np.arange(CYCLE * RATE, 20 * RATE, -1)]) / RATE
    both = recorded(x, 0.2 * np.random.default_rng(8).standard_normal(len(x)) + CURVE(x))
    drive = small("F_ior@4=1000", "turn_range@4=1000", "order_2=1000")
    found = accept(drive, {4.0: measure(both, drive=drive, stated=NOTHING)}, measured_only=True)
    assert [d.verdict for d in found.checks] == ["PASS"] * 3
    assert {d.extent for d in found.checks} == {"whole"}


@pytest.mark.thorough
def test_unstated_uncertainty_source_prevents_pass_unless_the_rule_is_simple():
    trace, limits = rig(CYCLE), ("F_ior@4=500", "turn_range@4=500", "order_2=500")
    for missing in ("encoder", "temperature"):
        stated_of = {name: 0.0 for name in STATED if name != missing}
        measured = {4.0: measure(trace, drive=small(), stated=stated_of)}
        found = accept(small(*limits), measured, measured_only=True)
        assert [d.verdict for d in found.checks] == ["INCONCLUSIVE"] * 3
        assert {d.reason for d in found.checks} == {
            f"no standard uncertainty is stated for {missing}: use --budget {missing}=U "
            "(in ″; 0 for a source without effect)"
        }
        lenient = small(*limits, overrides=("acceptance.rule=simple",))
        assert accept(lenient, measured, measured_only=True).verdict == "PASS"
        assert accept(small("F_ior@4=1"), measured, measured_only=True).verdict == "FAIL"  # that much is known
    assert accept(small(*limits), {4.0: measure(trace, drive=small(), stated=NOTHING)}, measured_only=True).verdict == (
        "PASS"
    )


@pytest.mark.thorough
def test_limit_must_leave_room_for_lines_in_another_cycle():
    x = np.arange(CYCLE * RATE) / RATE
    error = CURVE(x) + 2 * np.cos(2 * np.pi * 12.96 * x) + 0.1 * np.random.default_rng(2).standard_normal(len(x))
    measured = measure(recorded(x, error), drive=small(), stated=NOTHING)
    (found,) = measured.directions
    within = found.range.value + GUARD * found.uncertainty_arcsec
    verdicts = []
    for limit in (within + 0.5 * found.range.rise, within + 1.01 * found.range.rise):
        told = accept(small(f"F_ior@4={limit!r}"), {4.0: measured}, measured_only=True)
        verdicts.append(told.verdict)
        assert [note.code for note in told.remarks if note.code == "LINES"] == ["LINES"]
        (check,) = answer_json(told)["checks"]
        assert (check["rise"], check["unstated"]) == (found.range.rise, [])
    assert verdicts == ["INCONCLUSIVE", "PASS"]


def test_full_cycle_passes_by_the_upper_end_of_its_model():
    measured = {4.0: measure(rig(CYCLE), drive=small(), stated=NOTHING)}
    at_most = full_cycle(measured[4.0], measured[4.0].greatest).at_most_arcsec
    assert whole_range(CURVE, CYCLE) < at_most
    verdicts = []
    for limit in (at_most - 0.01, at_most + 0.01):
        (check,) = accept(small(f"F_ior@4={limit!r}"), measured, measured_only=True).checks
        verdicts.append(check.verdict)
        assert (check.extent, check.margin) == ("whole", pytest.approx(limit - check.value))
        assert check.full_cycle.at_most == at_most
    assert verdicts == ["INCONCLUSIVE", "PASS"]
    value = with_full_cycle(measured[4.0]).F_ior_arcsec
    simple = small(f"F_ior@4={value + 0.001!r}", overrides=("acceptance.rule=simple",))
    assert accept(simple, measured, measured_only=True).verdict == "PASS"  # up to the limit, as its name says


@pytest.mark.thorough
@pytest.mark.parametrize("turns", [CYCLE, CYCLE // 2])
def test_accept_states_the_interval_of_measure(turns):
    result = measure(rig(turns), drive=small(), stated=NOTHING)
    (direction,) = with_full_cycle(result).directions
    (check,) = accept(small("F_ior@4=1000"), {4.0: result}, measured_only=True).checks
    assert check.value == direction.F_ior_arcsec
    assert check.full_cycle.interval == direction.interval_arcsec


def test_full_cycle_fails_by_the_lower_end_of_its_model():
    measured = {4.0: measure(rig(CYCLE), drive=small(), stated=NOTHING)}
    at_least = full_cycle(measured[4.0], measured[4.0].greatest).at_least_arcsec
    assert at_least < whole_range(CURVE, CYCLE)
    limits = at_least - 0.01, at_least + 0.01
    found = [accept(small(f"F_ior@4={limit!r}"), measured, measured_only=True).verdict for limit in limits]
    assert found == ["FAIL", "INCONCLUSIVE"]


def test_full_cycle_without_an_upper_end_does_not_pass():
    result = with_full_cycle(measure(rig(CYCLE), drive=small(), stated=NOTHING))
    (direction,) = result.directions
    few = replace(result, directions=(replace(direction, full_cycle="the model has too few effective samples"),))
    (check,) = accept(small("F_ior@4=1000"), {4.0: few}, measured_only=True).checks
    assert (check.verdict, check.reason) == ("INCONCLUSIVE", "the model has too few effective samples")
    (check,) = accept(small("F_ior@4=1"), {4.0: few}, measured_only=True).checks
    assert check.verdict == "FAIL"


def there_and_back_to(last):
    """A measurement of the whole cycle there, and back to an angle [rev]."""
    x = np.concatenate([np.arange(CYCLE * RATE), np.arange(CYCLE * RATE, last * RATE, -1)]) / RATE
    both = recorded(x, 0.2 * np.random.default_rng(8).standard_normal(len(x)) + CURVE(x))
    return with_full_cycle(measure(both, drive=small(), stated=NOTHING))


@pytest.mark.thorough
def test_a_long_part_in_one_direction_must_pass_too():
    measured = there_and_back_to(CYCLE // 3)
    whole, part = sorted(measured.directions, key=lambda each: each.is_bound)
    ends = [each.full_cycle.at_most_arcsec for each in (whole, part)]
    for limit, verdict in ((min(ends) - 0.01, "INCONCLUSIVE"), (max(ends) + 0.01, "PASS")):
        assert accept(small(f"F_ior@4={limit!r}"), {4.0: measured}, measured_only=True).verdict == verdict
    between = accept(small(f"F_ior@4={0.5 * sum(ends)!r}"), {4.0: measured}, measured_only=True)
    assert between.verdict == "INCONCLUSIVE"


@pytest.mark.thorough
def test_two_halves_are_no_part_of_the_cycle():
    x = np.concatenate([np.arange(CYCLE // 2 * RATE), np.arange(CYCLE * RATE, CYCLE // 2 * RATE, -1)]) / RATE
    error = CURVE(x) + 0.2 * np.random.default_rng(4).standard_normal(len(x))
    halves = with_full_cycle(measure(recorded(x, error), drive=small(), stated=NOTHING))
    limit = 0.5 * sum(max(each.full_cycle.interval_arcsec[end] for each in halves.directions) for end in (0, 1))
    together = accept(small(f"F_ior@4={limit!r}"), {4.0: halves}, measured_only=True)
    assert together.verdict == "INCONCLUSIVE"
    assert "COVERAGE" not in [note.code for note in together.remarks]
    back = next(each for each in halves.directions if each.direction == -1)
    back = replace(back, full_cycle=replace(back.full_cycle, record_next_rev=(CYCLE / 6, CYCLE / 3)))
    cycle = covered_cycle(limits_of(small("F_ior@4=24"))[0], halves, back)
    assert cycle.advice == "; next, record output angles from 60 to 120° with decreasing input angle"
    # a limit that each direction must meet by its own readings
    alone = accept(small(f"F_ior@4={limit!r}", "turn_range@4=50"), {4.0: halves}, measured_only=True)
    assert "COVERAGE" in [note.code for note in alone.remarks]


@pytest.mark.thorough
def test_a_short_return_does_not_prevent_a_pass():
    measured = there_and_back_to(CYCLE - CYCLE // 4)
    whole, part = sorted(measured.directions, key=lambda each: each.is_bound)
    assert part.full_cycle.at_most_arcsec is None
    limit = 1.2 * whole.full_cycle.at_most_arcsec
    found = accept(small(f"F_ior@4={limit!r}"), {4.0: measured}, measured_only=True)
    assert (found.verdict, found.checks[0].extent) == ("PASS", "whole")


@pytest.mark.thorough
def test_the_worse_verdict_of_two_directions_counts():
    x = np.concatenate([np.arange(CYCLE * RATE), np.arange(CYCLE * RATE, 0, -1)]) / RATE
    grows = np.arange(len(x)) < CYCLE * RATE
    noise = np.where(grows, 4.0, 0.05) * np.random.default_rng(5).standard_normal(len(x))
    both = recorded(x, noise + np.where(grows, 1.1, 1.0) * CURVE(x))
    found = measure(both, drive=small())
    clean, noisy = sorted(found.directions, key=lambda d: d.uncertainty_arcsec)
    reach = GUARD * clean.uncertainty_arcsec, GUARD * noisy.uncertainty_arcsec
    limit = clean.range.value - 2 * reach[0]
    assert clean.range.value < noisy.range.value < limit + reach[1]  # the greater one by itself does not fail
    assert accept(small(f"F_ior@4={limit}"), {4.0: found}, measured_only=True).verdict == "FAIL"


@pytest.mark.thorough
def test_remarks_that_count():
    drive = small("F_ior@4=25", overrides=("operation.rated=3",))
    noisy = accept(drive, {4.0: measure(rig(CYCLE, noise=12.0), drive=drive)})
    codes = [note.code for note in noisy.remarks]
    assert "UNCERTAINTY" in codes
    assert "RATED" in codes
    clean = accept(drive, stated={limits_of(drive)[0]: stated(20.0, 0.1)})
    assert clean.exit_code == 0


def test_what_has_no_limit_is_refused():
    with pytest.raises(DataError, match="has no acceptance limit"):
        accept(tiny())
    with pytest.raises(DataError, match="measured at 1 N\\*m, for which no limit is set"):
        accept(small("F_ior@4=3"), {1.0: measure(rig(5), drive=small())})
    with pytest.raises(DataError, match="none of the limits has a measured value"):
        accept(tiny("F_ior@4=3"), measured_only=True)


def test_the_torque_of_a_trace():
    drive = tiny("F_ior@4=9")
    texts = ("run.csv", "4=a:b.csv", "4.4.4=run.csv", "x=run.csv")
    assert list(map(torque_and_file, texts)) == [("", texts[0]), ("4", "a:b.csv"), ("", texts[2]), ("", texts[3])]
    assert Request(TINY, measured=texts[:1]).traces(drive) == {4.0: "run.csv"}
    assert Request(TINY, measured=texts[1:2]).traces(drive) == {4.0: "a:b.csv"}
    with pytest.raises(UsageError, match="the torque is missing"):
        Request(TINY, measured=texts[:1]).traces(tiny("F_ior=9"))
    with pytest.raises(UsageError, match="two recordings at 4"):
        Request(TINY, measured=texts[:2]).read(drive)
