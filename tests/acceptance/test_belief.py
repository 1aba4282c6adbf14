"""What accept makes of all that is not known of a drive: the same samples, probabilities and verdicts as check."""

from __future__ import annotations

import json
from functools import partial

import numpy as np
import pytest

from hdassist.drive.error.cycle import kinematic_error
from hdassist.drive.error.waves import estimated_cycle
from hdassist.drive.loading import load_preset
from hdassist.drive.model.geometry import Kinematics
from hdassist.features.acceptance.answer import answer_json
from hdassist.features.acceptance.decision import predict, quantities
from hdassist.features.acceptance.limits import limits_of
from hdassist.features.design import check
from hdassist.interface.pages.check import check_report
from hdassist.interface.terminal.output import report_object
from hdassist.readers.pitch import WheelFiles
from hdassist.run.errors import Verdict
from hdassist.run.run import UNCHECKED
from tests.helpers.acceptances import accept
from tests.helpers.process import TINY, in_a_line, run

PLAY = "source.gears.j_n={kind: assumed, range: [12, 18], ref: judged}"
OPEN = ("phases.phi_hb=unknown", PLAY, "numerics.n_phase=4")


def drive(*overrides: str):
    return load_preset(TINY, overrides)


def test_check_and_accept_agree_on_the_same_limit():
    there = drive(*OPEN, "acceptance.F_ior={1: 2500, 4: 2050}", "acceptance.order_amplitude={2@4: 14}")
    told = report_object(check_report(check(there, draws=4), 0))
    mine = answer_json(accept(there, draws=4))
    points = {p["M_g_Nm"]: p for p in told["operating_points"]}
    for found in (each for each in mine["checks"] if each["code"] == "F_IOR"):
        point, belief = points[found["M_g_Nm"]], found["belief"]
        own = point["self_error_arcsec"]
        assert [belief[p] - own for p in ("p5", "p50", "p95")] == pytest.approx(
            [point["belief"][f"{p}_arcsec"] for p in ("p5", "p50", "p95")], abs=1e-9
        )
        for key in ("probability", "probability_low", "probability_high"):
            assert belief[key] == point["belief"][key]
        assert (found["verdict"], found["limit"]) == (point["verdict"], point["limit_arcsec"])
        assert found["value"] == belief["p50"]
    assert mine["influence"] == told["influence"]


def test_what_is_assumed_counts_as_what_is_unknown_does():
    """A drive whose own numbers keep a limit that others inside its assumed range do not."""
    (limit,) = limits_of(drive("operation.M_g=4", "acceptance.F_ior.4=1"))
    own = predict(drive(), [limit]).quantities.value(limit)
    known, assumed = (drive(f"acceptance.F_ior.4={own + 0.1}", *more, "operation.M_g=4") for more in ((), (PLAY,)))
    assert accept(known).verdict is Verdict.PASS
    assert accept(assumed, draws=4).verdict is not Verdict.PASS


@pytest.fixture(scope="module")
def drawn():
    """Limits on everything, and what is predicted of a drive whose deviations and clearance are open."""
    names = ("turn_range.4", "self_error.4", "lost_motion", "K_1")
    there = drive(*OPEN, *(f"acceptance.{name}=1000" for name in names), "acceptance.order_amplitude={2@4: 1000}")
    return there, limits_of(there), predict(there, limits_of(there), draws=2)


@pytest.mark.thorough
def test_other_values_are_those_of_each_sample(drawn):
    there, limits, found = drawn
    samples = found.samples
    sampled = there.with_values(samples.values()[1])
    own = quantities(sampled, limits, partial(estimated_cycle, sampled), run=UNCHECKED)
    for limit in limits:
        expected = own.value(limit)
        assert samples.figures[limit.label][1] == pytest.approx(expected, rel=1e-9)
    # the second way: the error of that drive over every state
    error = kinematic_error(sampled, 4.0, run=UNCHECKED).error_arcsec
    second = 2 * abs(np.mean(error * np.exp(-2j * np.pi * 20 * np.arange(len(error)) / len(error))))
    assert samples.figures["amplitude of order 2 without sidebands at 4 N·m"][1] == pytest.approx(second, rel=1e-6)


@pytest.mark.thorough
def test_sample_of_a_long_cycle_needs_few_of_its_states():
    there = load_preset("vzp160", ["operation.M_g=80", "acceptance.turn_range=1000"])
    samples = predict(there, limits_of(there), draws=2, run=UNCHECKED).samples
    assert samples.certificate.states / samples.draws < Kinematics.of(there).cycle_states / 8


def test_each_limit_is_decided_by_the_samples(drawn):
    _, limits, found = drawn
    for limit in limits:
        values = found.samples.figures[limit.label]
        name = f"acceptance.{limit.check.field}"
        verdicts = []
        for bound in map(float, (values.min() * 0.999, np.median(values), values.max() * 1.001)):
            value = {
                "limits": f"{name}.4={bound!r}", "orders": f"{name}={{2@4: {bound!r}}}", "number": f"{name}={bound!r}"
            }[limit.check.kind]  # fmt: skip
            (decision,) = accept(drive(*OPEN, value), predictions=found).checks
            verdicts.append(decision.verdict)
            assert decision.belief.p5 < decision.value < decision.belief.p95
        # 16 samples that all keep a limit are not 95 % sure
        assert verdicts[1] == "INCONCLUSIVE"
        assert accept(drive(*OPEN, value), predictions=found, sure=0.8).verdict == (
            "PASS" if limit.check.upper else "FAIL"
        )


def test_deviations_leave_what_has_none_as_it_is():
    there = drive("phases.phi_hb=unknown", "acceptance.self_error.4=3000", "acceptance.K_1=1")
    result = accept(there)
    assert (result.verdict, result.samples) == ("PASS", None)


@pytest.mark.parametrize("case", ["wheels", "no draws"])
def test_without_samples_what_is_open_is_settled_by_nothing(case, tmp_path):
    there = drive("phases.phi_hb=unknown", "operation.M_g=4", "acceptance.F_ior=100000")
    (tmp_path / "b.csv").write_text("# form: cumulative\n# unit: um\n# sense: ccw\n# mark: 1\n" + "".join(
        f"{k};{k % 3}\n" for k in range(1, 23)
    ))  # fmt: skip
    wheels = WheelFiles(str(tmp_path / "b.csv"), mark_b=0.0).read(there) if case == "wheels" else None
    result = accept(there, wheels=wheels, draws=0 if case == "no draws" else 16)
    (decision,) = result.checks
    assert (result.verdict, decision.reason) == ("INCONCLUSIVE", "the uncertain inputs were not sampled")
    assert decision.belief is None


def test_accept_page_lists_the_options_and_how_to_measure():
    asked = (
        "accept",
        TINY,
        "--limit",
        "F_ior@4=2050",
        "--set",
        OPEN[0],
        "--set",
        OPEN[1],
        "--set",
        OPEN[2],
        "--jobs",
        "1",
    )
    done = run(*asked, "--draws", "8")
    page = in_a_line(done.stdout)
    assert done.returncode == 6
    assert page.startswith("tiny: INCONCLUSIVE probability that F'_ior + self error at 4 N·m is ≤ ")
    for words in ("predicted: PASS if the probability is at least 95 %", "--measured 4=FILE", "options to meet ",
                  "notes unknown deviations (hdassist explain UNKNOWN) next hdassist accept "):  # fmt: skip
        assert words in page
    page = in_a_line(run(*asked, "--draws", "4", "--sure", "0.96").stdout)
    assert "--draws=4 --sure=0.96 --measured 4=FILE" in page
    told = json.loads(run(*asked, "--draws", "4", "--sure", "0.8", "--json").stdout)
    assert told["rule"] == {"measured": "guard", "guard_standard_uncertainties": 1.65, "sure": 0.8}
    assert (told["request"]["draws"], told["request"]["sure"]) == (4, 0.8)


def test_a_margin_is_refused_with_what_there_is_instead(tmp_path):
    words = "leave it out; predictions are decided by their probability, see hdassist accept --sure"
    done = run("accept", TINY, "--limit", "F_ior=1", "--set", "acceptance.margin=10")
    assert (done.returncode, f"acceptance.margin: unknown key ({words})" in done.stderr) == (2, True)
    (tmp_path / "lot.csv").write_text("serial,acceptance.margin\n1,10\n")
    done = run("accept", "lot.csv", "--preset", TINY, cwd=tmp_path)
    assert (
        done.returncode,
        f"lot.csv:1:8: acceptance.margin: no column of a lot file has this name ({words})" in done.stderr,
    ) == (
        4,
        True,
    )
