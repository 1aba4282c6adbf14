"""Predicted values: those of the other commands, each held against its limit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hdassist.drive.error.stiffness import stiffness
from hdassist.drive.error.waves import orders, trace, turn_range_arcsec
from hdassist.features.acceptance.answer import answer_json
from hdassist.features.acceptance.decision import predict
from hdassist.features.acceptance.limits import CHECKS, ORDER_CHECK, limits_of
from hdassist.features.acceptance.request import Request, read_lot, stated_values
from hdassist.features.design import check
from hdassist.run.errors import DataError, UsageError
from hdassist.run.run import UNCHECKED
from tests.helpers.acceptances import accept, stated, tiny
from tests.helpers.process import TINY

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
    assert len(predictions.cross_checks) == 3


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


def test_only_what_is_asked_is_predicted():
    drive = tiny("self_error@4=5")
    found = predict(drive, limits_of(drive)).quantities
    assert (list(found.errors), list(found.self_errors), found.stiffness) == ([], [4.0], ())


def test_orders_that_the_cycle_does_not_have_are_refused(predicted):
    predictions = predicted[1].quantities
    error = predictions.errors[1.0]
    wave = np.exp(-1j * 1.1 * error.states.phi_h)
    assert predictions.amplitude(1.0, 1.1) == pytest.approx(2 * abs(np.mean(error.error_arcsec * wave)), abs=1e-9)
    for order in (0.01, 2.01, 11.0):
        with pytest.raises(UsageError, match="does not exist in the full mesh cycle"):
            predictions.amplitude(1.0, order)
    assert turn_range_arcsec(predictions.errors[1.0]) <= predictions.errors[1.0].F_ior_arcsec


def test_order_absent_from_the_cycle_is_an_input_error(tmp_path):
    with pytest.raises(UsageError, match=r"order 2\.01 does not exist"):
        accept(tiny("order_2.01=3"))
    preset = tmp_path / "own.yaml"
    preset.write_text(Path(TINY).read_text() + "acceptance: {order_amplitude: {2.01: 3}}\n")
    with pytest.raises(DataError, match=r"acceptance\.order_amplitude: order 2\.01 does not exist"):
        accept(Request(str(preset)).load())


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.code)
def test_a_declaration_is_all_that_a_check_takes(check, predicted, tmp_path):
    name = {"limits": f"{check.field}@4", "orders": "order_2", "number": check.field}[check.kind]
    drive = tiny(f"{name}=7")
    (limit,) = [limit for limit in limits_of(drive) if limit.M_g_Nm in (4.0, None)]
    assert (limit.check, limit.limit, limit.per_cam_rev) == (check, 7.0, 2.0 if check == ORDER_CHECK else None)
    assert (predicted[1].quantities.value(limit) > 0) == bool(check.needs)
    assert limits_of(tiny(f"{name}=7 {check.unit}")) == limits_of(drive)
    columns = f"serial,preset,limit {name},{name if check != ORDER_CHECK else 'order_2@4'}\n1,{TINY},7,6±0.1\n"
    (tmp_path / "lot.csv").write_text(columns)
    (row,) = read_lot(str(tmp_path / "lot.csv"), Request("")).rows
    assert stated_values(row.request.values, row.request.load()) == {limit: stated(6.0, 0.05)}
    (only,) = answer_json(accept(drive, predictions=predicted[1]))["checks"][-1:]
    assert (only["code"], only["unit"], only["limit"]) == (check.code, check.unit, 7.0)
