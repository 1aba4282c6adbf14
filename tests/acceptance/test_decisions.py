"""Decisions: the rule for measured values, and what it does with limits."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from hdassist.features.acceptance.decision import GUARD, AcceptedValue, Belief, decide
from hdassist.features.acceptance.limits import Limit, limits_of
from hdassist.interface.pages.accept import accept_report
from tests.helpers.acceptances import accept, stated, tiny
from tests.helpers.paper import on_paper
from tests.helpers.process import SMALL, run

UPPER = Limit("F_IOR", 30.0, 80.0)


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


@pytest.mark.parametrize(("few", "verdict"), [(False, "PASS"), (True, "INCONCLUSIVE")])
def test_probability_from_few_samples_is_decided_by_its_whole_interval(few, verdict):
    belief = Belief(10.0, 12.0, 14.0, 0.98, 0.79, 1.0, few)
    found = decide(UPPER, AcceptedValue(12.0, None, "predicted", "whole", belief=belief), "guard", 0.95)
    reason = (
        "probability that the limit is met: 98 % (79 to 100); PASS needs 95 % over the whole interval" if few else None
    )
    assert (found.verdict, found.reason) == (verdict, reason)


@settings(max_examples=40)
@given(
    value=st.floats(1, 100), u=st.floats(0, 20), limit=st.floats(1, 100), rule=st.sampled_from(["guard", "simple"]),
    basis=st.sampled_from(["measured", "predicted"]),
)  # fmt: skip
def test_looser_limit_never_worsens_a_verdict_and_lower_limits_mirror(value, u, limit, rule, basis):
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


def test_the_rule_of_the_preset_counts():
    found = []
    for rule in ("simple", "guard"):
        drive = tiny("lost_motion=60", overrides=(f"acceptance.rule={rule}",))
        (asked,) = limits_of(drive)
        found.append(accept(drive, stated={asked: stated(59.0, 1.0)}).verdict)
    assert found == ["PASS", "INCONCLUSIVE"]


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


def test_single_approaches_of_unknown_scatter_never_fail_a_drive(tmp_path):
    places = np.arange(120) * 3.0
    error = 6 * np.cos(np.radians(places)) + 2 * np.random.default_rng(0).standard_normal(120)  # a range of 12
    rows = [f"{place},{value:.4f},1\n" for place, value in zip(places, error, strict=True)]
    once, plan = tmp_path / "once.csv", tmp_path / "plan.csv"
    once.write_text("target_deg,deviation_arcsec,side\n" + "".join(rows))
    plan.write_text("# uncertainty: 4\n" + once.read_text())
    limits = ("--limit", "F_ior@4=12.5", "--measured-only", "-q")
    assert np.ptp(error) > 14
    assert run("accept", SMALL, "--measured", f"4={once}", *limits).returncode == 6
    assert run("accept", SMALL, "--measured", f"4={once}", "--limit", "positioning=12.5", *limits).returncode == 6
    done = run("accept", SMALL, "--measured", f"4={once}", "--json", *limits[:3])
    assert json.loads(done.stdout)["checks"][0]["extent"] == "scatter not known"
    # a plan states how far the readings scatter
    done = run("accept", SMALL, "--measured", f"4={plan}", "--json", *limits[:3])
    (check,) = json.loads(done.stdout)["checks"]
    assert check["expanded_uncertainty"] == pytest.approx(8)
