"""Decisions on limits: the rules, the predicted and the measured values, the words of limits."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from hdassist.acceptance.answer import answer_json
from hdassist.acceptance.checks import CHECKS, CODES, ORDER_CHECK
from hdassist.acceptance.decision import GUARD, AcceptedValue, decide
from hdassist.acceptance.limits import Limit, LimitText, limits_of
from hdassist.acceptance.lot import read_lot
from hdassist.acceptance.predictions import predict
from hdassist.acceptance.request import Request, stated_values, torque_and_file
from hdassist.design.check import check
from hdassist.error.orders import orders
from hdassist.error.stiffness import stiffness
from hdassist.error.trace import trace
from hdassist.errors import DataError, PresetError, UsageError
from hdassist.loading.load import load_text
from hdassist.measuring.measure import measure
from hdassist.measuring.uncertainty import STATED
from hdassist.pages.accept import accept_report, number
from hdassist.run.run import UNCHECKED
from tests.acceptances import accept
from tests.paper import on_paper
from tests.process import TINY
from tests.rigs import drive_error, recorded, turn_range, whole_range

ROOT = Path(__file__).parents[2]
SMALL = str(ROOT / "tests/data/small.yaml")
CYCLE = 30  # cam turns of the small drive
RATE = 60  # states of a trace in each
UPPER = Limit("F_IOR", 30.0, 80.0)


def bounds(*texts: str) -> tuple[LimitText, ...]:
    return tuple(LimitText.parse(text, "--limit") for text in texts)


def tiny(*limits: str, **request):
    return Request(TINY, limits=limits, **request).load()


def small(*limits: str, **request):
    return Request(SMALL, limits=limits, **request).load()


def stated(number: float, uncertainty: float) -> AcceptedValue:
    return AcceptedValue(number, 2 * uncertainty, "stated", "whole")


@pytest.mark.parametrize(
    ("value", "u", "extent", "rule", "verdict"),
    [
        (29.0, 0.5, "whole", "guard", "PASS"),  # 1 = 2 u below
        (29.5, 0.5, "whole", "guard", "INCONCLUSIVE"),
        (30.5, 0.5, "whole", "guard", "INCONCLUSIVE"),
        (31.0, 0.5, "whole", "guard", "FAIL"),
        (29.9, 0.5, "whole", "simple", "PASS"),
        (30.0, 0.0, "whole", "guard", "PASS"),  # the limit itself is allowed
        (30.1, 0.5, "whole", "simple", "FAIL"),
        (20.0, 0.5, "at least", "guard", "INCONCLUSIVE"),  # a part of the cycle never passes
        (20.0, 0.5, "at least", "simple", "INCONCLUSIVE"),
        (31.0, 0.5, "at least", "guard", "FAIL"),  # but it can fail
        (99.0, 0.1, "part", "guard", "INCONCLUSIVE"),
    ],
)
def test_measured_values_are_decided_by_the_rule(value, u, extent, rule, verdict):
    found = decide(UPPER, AcceptedValue(value, 2 * u, "measured", extent), rule, 0.95)
    assert found.verdict == verdict
    assert found.margin == 30 - value
    assert found.expanded_uncertainty == 2 * u
    assert bool(found.reason) == (verdict == "INCONCLUSIVE")


@settings(max_examples=40)
@given(
    value=st.floats(1, 100), u=st.floats(0, 20), limit=st.floats(1, 100), rule=st.sampled_from(["guard", "simple"]),
    basis=st.sampled_from(["measured", "predicted"]),
)  # fmt: skip
def test_a_looser_limit_never_hurts_and_a_least_value_is_the_mirror_image(value, u, limit, rule, basis):
    better = ["FAIL", "INCONCLUSIVE", "PASS"]
    known = AcceptedValue(value, 2 * u, basis, "whole")
    verdicts = [better.index(decide(Limit("F_IOR", x), known, rule, 0.95).verdict) for x in (limit, limit + 1)]
    assert verdicts[0] <= verdicts[1]
    upper, lower = (decide(Limit(code, limit), known, rule, 0.95) for code in ("F_IOR", "K_1"))
    assert upper.margin == -lower.margin
    assume(abs(upper.margin) not in (0, upper.guard))  # at the edge both may pass
    swap = {"PASS": "FAIL", "FAIL": "PASS", "INCONCLUSIVE": "INCONCLUSIVE"}
    assert lower.verdict == swap[upper.verdict]


def test_the_guard_band_accepts_wrongly_once_in_twenty():
    rng, u = np.random.default_rng(0), 0.5
    true = 30.0  # at the limit: the worst that conforms
    read = true + u * rng.standard_normal(10_000)
    accepted = np.mean(
        [
            decide(UPPER, AcceptedValue(value, 2 * u, "measured", "whole"), "guard", 0.95).verdict == "PASS"
            for value in read
        ]
    )
    assert accepted == pytest.approx(norm.sf(GUARD), abs=0.005)
    assert norm.sf(GUARD) == pytest.approx(0.05, abs=1e-3)


LIMITS = (
    "F_ior=40",
    "turn_range=40",
    "self_error=40",
    "order_2=40",
    "lost_motion=400",
    "K_1=1",
    "K_2=1",
    "K_3=1",
)


@pytest.fixture(scope="module")
def predicted():
    drive = tiny(*LIMITS)
    return drive, predict(drive, limits_of(drive))


def values(found):
    drive, predictions = found
    return {(a.code, a.M_g_Nm): predictions.quantities.value(a) for a in limits_of(drive)}


def test_predicted_values_are_those_of_the_other_commands(predicted):
    drive, predictions = predicted
    told, own = values(predicted), check(drive)
    for point in own.points:
        M_g, error = point.M_g, point.error
        assert told["F_IOR", M_g] == pytest.approx(point.F_ior_upper_arcsec, abs=1e-9)
        assert told["SELF_ERROR", M_g] == pytest.approx(point.self_error.range_arcsec, abs=1e-9)
        table = orders(drive, error.error_arcsec, error.kinematics.cycle_cam_revolutions)
        (second,) = [o.amplitude_arcsec for o in table if o.per_cam_rev == 2]
        assert told["ORDER", M_g] == pytest.approx(second, abs=1e-9)
        # a turn that begins later is a trace that begins where the moving wheel then stands
        later = [trace(drive, M_g, start_deg=start, run=UNCHECKED).error.range_arcsec for start in (0, -12, 12, 36)]
        assert max(later) <= told["TURN_RANGE", M_g] + 1e-6
        around = np.concatenate([error.error_arcsec] * 2)
        turn = error.kinematics.teeth_fixed
        brute = max(np.ptp(around[k : k + turn]) for k in range(len(error.error_arcsec)))
        assert told["TURN_RANGE", M_g] == pytest.approx(brute, abs=1e-12)
    twist = stiffness(drive)
    assert told["LOST_MOTION", None] == pytest.approx(twist.lost_motion_arcsec, abs=1e-9)
    for k in range(3):
        weaker = min(twist.positive[k].stiffness, twist.negative[k].stiffness)
        assert told[f"K_{k + 1}", None] == pytest.approx(weaker, rel=1e-9)
    assert predictions.certificate.states > 2 * 220
    assert len(predictions.quantities.cross_checks) == 3


@pytest.mark.parametrize("limit", LIMITS)
def test_each_limit_decides(predicted, limit):
    # just out of reach, and just within: the same value, other verdicts
    name = limit.partition("=")[0]
    value = max(
        v for (code, _), v in values(predicted).items() if code in (name.upper(), name.partition("_")[0].upper())
    )
    upper = not name.startswith("K")
    verdicts = []
    for factor in (0.99, 1.01):
        drive = tiny(f"{name}={value * factor!r}")
        verdicts.append(accept(drive, predictions=predicted[1]).verdict)
    assert verdicts == (["FAIL", "PASS"] if upper else ["PASS", "FAIL"])


def test_the_rule_of_the_preset_counts():
    found = []
    for rule in ("simple", "guard"):
        drive = tiny("lost_motion=60", overrides=(f"acceptance.rule={rule}",))
        (asked,) = limits_of(drive)
        found.append(accept(drive, stated={asked: stated(59.0, 1.0)}).verdict)
    assert found == ["PASS", "INCONCLUSIVE"]


def test_only_what_is_asked_is_predicted():
    drive = tiny("self_error@4=5")
    found = predict(drive, limits_of(drive)).quantities
    assert (list(found.errors), list(found.self_errors), found.stiffness) == ([], [4.0], None)


def test_orders_that_the_cycle_does_not_have_are_refused(predicted):
    predictions = predicted[1].quantities
    error = predictions.errors[1.0]
    wave = np.exp(-1j * 1.1 * error.states.phi_h)
    assert predictions.amplitude(1.0, 1.1) == pytest.approx(2 * abs(np.mean(error.error_arcsec * wave)), abs=1e-9)
    for order in (0.01, 2.01, 11.0):
        with pytest.raises(UsageError, match="none of the full cycle"):
            predictions.amplitude(1.0, order)
    assert predictions.turn_range(1.0) <= predictions.errors[1.0].F_ior_arcsec


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
    assert found.left_out == ("amplitude of order 2 alone at 1 N·m",)
    assert {note.code for note in found.remarks} == {"BUDGET", "NOT_TESTED"}


def test_a_part_of_the_cycle_can_fail_a_drive_and_never_pass_it():
    measured = {4.0: measure(rig(5), drive=small())}
    for limit, verdict in ((1.0, "FAIL"), (1000.0, "INCONCLUSIVE")):
        drive = small(f"F_ior@4={limit}", f"turn_range@4={limit}")
        found = accept(drive, measured)
        assert [d.verdict for d in found.checks] == [verdict] * 2
        assert "COVERAGE" in [note.code for note in found.remarks]
    assert accept(small("order_2=1"), measured, measured_only=True).verdict == "INCONCLUSIVE"


def test_an_order_of_a_trace_is_the_one_that_was_asked_for():
    measured = {4.0: measure(rig(CYCLE), drive=small())}
    with pytest.raises(UsageError, match=r"2\.01 is none of the full cycle"):  # not that of order 2, its neighbour
        accept(small("order_2.01=1"), measured, measured_only=True)


def test_a_part_beside_the_whole_cycle_leaves_what_the_whole_says():
    x = np.concatenate([np.arange(CYCLE * RATE), np.arange(CYCLE * RATE, 20 * RATE, -1)]) / RATE
    both = recorded(x, 0.2 * np.random.default_rng(8).standard_normal(len(x)) + CURVE(x))
    drive = small("F_ior@4=1000", "turn_range@4=1000", "order_2=1000")
    found = accept(drive, {4.0: measure(both, drive=drive, stated=NOTHING)}, measured_only=True)
    assert [d.verdict for d in found.checks] == ["PASS"] * 3
    assert {d.extent for d in found.checks} == {"whole"}


def test_a_source_that_nobody_has_stated_keeps_a_drive_from_passing():
    trace, limits = rig(CYCLE), ("F_ior@4=500", "turn_range@4=500", "order_2=500")
    for missing in ("encoder", "temperature"):
        stated_of = {name: 0.0 for name in STATED if name != missing}
        measured = {4.0: measure(trace, drive=small(), stated=stated_of)}
        found = accept(small(*limits), measured, measured_only=True)
        assert [d.verdict for d in found.checks] == ["INCONCLUSIVE"] * 3
        assert {d.reason for d in found.checks} == {
            f"nothing stated of {missing}: --budget {missing}=U, U in ″, 0 where a source adds nothing"
        }
        lenient = small(*limits, overrides=("acceptance.rule=simple",))
        assert accept(lenient, measured, measured_only=True).verdict == "PASS"
        assert accept(small("F_ior@4=1"), measured, measured_only=True).verdict == "FAIL"  # that much is known
    assert accept(small(*limits), {4.0: measure(trace, drive=small(), stated=NOTHING)}, measured_only=True).verdict == (
        "PASS"
    )


def test_what_lines_may_add_in_another_cycle_has_to_find_room():
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


def test_no_width_cuts_a_number():
    drive = tiny("F_ior@4=50", "order_2=12.5", "K_1=1234.5")
    told = {a: stated(1876.54, 3.21) for a in limits_of(drive) if a.M_g_Nm != 1}
    found = accept(drive, stated=told, measured_only=True)
    for plain in (False, True):
        for width in range(14, 90, 5):
            page = on_paper(accept_report(found, None, drive), width, ascii=plain)
            words = page.replace("|", " ").replace(",", " ").split()
            missing = {"1876.54", "6.42", "-1826.54", "12.5", "1234.5"} - set(words)
            assert not missing, (plain, width, missing)
            assert (words.count("PASS"), words.count("FAIL")) == (1, 3)


def test_remarks_that_count():
    drive = small("F_ior@4=50", overrides=("operation.rated=3",))
    noisy = accept(drive, {4.0: measure(rig(CYCLE, noise=12.0), drive=drive)})
    codes = [note.code for note in noisy.remarks]
    assert "UNCERTAINTY" in codes
    assert "RATED" in codes
    clean = accept(drive, stated={limits_of(drive)[0]: stated(20.0, 0.1)})
    assert clean.exit_code == 0


def test_an_order_that_the_cycle_has_not_is_the_fault_of_who_asked(tmp_path):
    with pytest.raises(UsageError, match=r"order 2\.01 is none"):
        accept(tiny("order_2.01=3"))
    preset = tmp_path / "own.yaml"
    preset.write_text(Path(TINY).read_text() + "acceptance: {order_amplitude: {2.01: 3}}\n")
    with pytest.raises(DataError, match=r"acceptance\.order_amplitude: order 2\.01 is none"):
        accept(Request(str(preset)).load())


def test_small_limits_keep_their_digits():
    asked = limits_of(tiny("order_2=0.004"))[0]
    assert number(0.0041, asked) == "0.00410"
    assert number(28.094, Limit("F_IOR", 30.0)) == "28.09"


def test_what_has_no_limit_is_refused():
    with pytest.raises(DataError, match="no limit to accept it by"):
        accept(tiny())
    with pytest.raises(DataError, match="measured at 1 N\\*m, where it has no limit"):
        accept(small("F_ior@4=3"), {1.0: measure(rig(5), drive=small())})
    with pytest.raises(DataError, match="nothing was measured"):
        accept(tiny("F_ior@4=3"), measured_only=True)


def test_limits_name_torques_beyond_those_of_operation():
    drive = tiny("F_ior=9", "F_ior@7=3", "order_2=1")
    assert [(a.code, a.M_g_Nm, a.limit) for a in limits_of(drive)] == [
        ("F_IOR", 1.0, 9.0), ("F_IOR", 4.0, 9.0), ("F_IOR", 7.0, 3.0), ("ORDER", 1.0, 1.0), ("ORDER", 4.0, 1.0),
    ]  # fmt: skip


def test_a_limit_of_an_order_at_one_torque_wins_over_that_at_each():
    drive = tiny("order_2=5", "order_2@4=3", "order_0.1@7=1")
    assert [(a.per_cam_rev, a.M_g_Nm, a.limit) for a in limits_of(drive)] == [(2, 1, 5), (2, 4, 3), (0.1, 7, 1)]
    assert [(a.per_cam_rev, a.M_g_Nm, a.limit) for a in limits_of(tiny("order_2@1=3"))] == [(2, 1, 3)]
    preset = (
        Path(TINY).read_text() + "acceptance: {order_amplitude: {2: 5, 2@4: 3 arcsec, 2.0@4.0: 4, 0@4: 1, x@4: 1}}\n"
    )
    with pytest.raises(PresetError) as caught:
        load_text(preset, "own.yaml")
    assert [(f.path, f.message) for f in caught.value.findings] == [
        ("acceptance.order_amplitude.2.0@4.0", "given twice"),
        ("acceptance.order_amplitude.0@4", "must be an order per cam turn, or ORDER@TORQUE in N*m"),
        ("acceptance.order_amplitude.x@4", "must be an order per cam turn, or ORDER@TORQUE in N*m"),
    ]


def test_words_of_limits():
    texts = ("F_ior@80=30", "F_ior=0.5 arcmin", "order_2=5", "K_1=30 N*m/arcmin", "order_0.01=1", "order_2@80=4")
    assert [str(limit) for limit in bounds(*texts)] == list(texts)
    assert [limit.override for limit in bounds(*texts)] == [
        "acceptance.F_ior.80=30", "acceptance.F_ior=0.5 arcmin", "acceptance.order_amplitude.2=5",
        "acceptance.K_1=30 N*m/arcmin", "acceptance.order_amplitude.0.01=1",
        "acceptance.order_amplitude.2@80=4",
    ]  # fmt: skip
    drive = tiny("order_0.1=1", "K_1=30 N*m/arcmin")
    assert [a.per_cam_rev for a in limits_of(drive)] == [0.1, 0.1, None]
    assert limits_of(drive)[-1].limit == pytest.approx(30 * 10800 / np.pi)
    assert bounds("30", "0.5 arcmin") == bounds("F_ior=30", "F_ior=0.5 arcmin")
    for bad in (
        "",
        "F_ior",
        "@4=30",
        "F_ior=",
        "F_iro=3",
        "K_1@80=3",
        "F_ior@=3",
        "order_x=3",
        "order_2@=3",
        "order_@80=3",
    ):
        with pytest.raises(UsageError):
            bounds(bad)


def test_words_of_stated_values():
    drive = tiny("F_ior=9", "lost_motion=60", "order_2=5")
    first, second, *_, lost = limits_of(drive)
    told = stated_values(["F_ior@4=8.1 ± 0.4", "lost_motion=1+-6 arcsec"], drive)
    assert told == {second: stated(8.1, 0.2), lost: stated(1.0, 3.0)}
    assert next(iter(stated_values(["order_2@1=3±1"], drive))).per_cam_rev == 2
    for bad, why in (
        ("F_ior=8±1", "at which torque"), ("lost_motion=3", "without its uncertainty"), ("K_1=3±1", "no such limit"),
        ("F_ior@5=8±1", "no such limit"), ("lost_motion=x±1", "must be a number"),
        ("F_ior@4=-8±1", "cannot be below zero"),
    ):  # fmt: skip
        with pytest.raises(UsageError, match=why):
            stated_values([bad], drive)
    with pytest.raises(UsageError, match="twice"):
        stated_values(["F_ior@4=8±1"] * 2, drive)
    assert first not in told


def test_the_torque_of_a_trace():
    drive = tiny("F_ior@4=9")
    texts = ("run.csv", "4=a:b.csv", "4.4.4=run.csv", "x=run.csv")
    assert list(map(torque_and_file, texts)) == [("", texts[0]), ("4", "a:b.csv"), ("", texts[2]), ("", texts[3])]
    assert Request(TINY, measured=texts[:1]).traces(drive) == {4.0: "run.csv"}
    assert Request(TINY, measured=texts[1:2]).traces(drive) == {4.0: "a:b.csv"}
    with pytest.raises(UsageError, match="at which torque"):
        Request(TINY, measured=texts[:1]).traces(tiny("F_ior=9"))
    with pytest.raises(UsageError, match="two traces at 4"):
        Request(TINY, measured=texts[:2]).read(drive)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.code)
def test_a_declaration_is_all_that_a_check_takes(check, predicted, tmp_path):
    name = {"limits": f"{check.field}@4", "orders": "order_2", "number": check.field}[check.kind]
    drive = tiny(f"{name}=7")
    (limit,) = [limit for limit in limits_of(drive) if limit.M_g_Nm in (4.0, None)]
    assert (limit.check, limit.limit, limit.per_cam_rev) == (check, 7.0, 2.0 if check == ORDER_CHECK else None)
    assert (predicted[1].quantities.value(limit) > 0) == (check.predicted is not None)
    assert limits_of(tiny(f"{name}=7 {check.unit}")) == limits_of(drive)
    columns = f"serial,preset,limit {name},{name if check != ORDER_CHECK else 'order_2@4'}\n1,{TINY},7,6±0.1\n"
    (tmp_path / "lot.csv").write_text(columns)
    (row,) = read_lot(str(tmp_path / "lot.csv"), Request("")).rows
    assert stated_values(row.request.values, row.request.load()) == {limit: stated(6.0, 0.05)}
    (only,) = answer_json(accept(drive, predictions=predicted[1]))["checks"][-1:]
    assert (only["code"], only["unit"], only["limit"]) == (check.code, check.unit, 7.0)


def test_codes_are_explained_and_in_the_docs():
    page = (ROOT / "docs/accept.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `([A-Z_0-9]+)` \|", page, flags=re.MULTILINE)) == set(CODES)
    for item in CODES.values():
        assert item.words == item.words.strip() != ""
        sentences = (item.tests, item.wrong, item.change)
        assert len(set(sentences)) == 3
        assert all(re.fullmatch(r"\S.{20,}\.", text) for text in sentences)
    fields = {c.field for c in CHECKS}
    limits = set(type(tiny().acceptance).model_fields) - {"rule"}
    assert fields == limits
