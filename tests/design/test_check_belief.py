"""What a check makes of all that is not known of a drive: percentiles, verdicts, influences, what to measure."""

import json
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.features.design import check
from hdassist.interface.pages.check import check_report, steps_tables
from hdassist.interface.terminal.output import report_object
from hdassist.run.errors import Verdict
from hdassist.run.run import Run
from tests.helpers.process import SMALL, TINY, run

PLAY = "source.gears.j_n={kind: assumed, range: [12, 18], ref: judged}"


@pytest.fixture(scope="module")
def open_():
    return check(load_preset(TINY, ["phases.phi_hb=unknown", PLAY]))


@pytest.mark.thorough
def test_a_verdict_is_the_probability_of_keeping_the_limit(open_):
    point = open_.points[1]
    own, belief = point.self_error.range_arcsec, point.belief
    assert belief.p5 < belief.p50 < belief.p95

    def verdict(limit: float, **change) -> Verdict:
        return replace(point, limit_arcsec=limit, **change).verdict

    values = open_.samples.sets_arcsec[:, :, 1]
    assert verdict(values.max() + own + 0.01) is Verdict.PASS
    kept = float(np.mean(values <= belief.p95))
    assert verdict(belief.p95 + own, sure=kept + 0.001) is verdict(belief.p50 + own) is Verdict.INCONCLUSIVE
    assert verdict(belief.p95 + own, sure=kept) is Verdict.PASS
    assert verdict(belief.p5 + own, sure=0.9) is Verdict.FAIL
    assert verdict(values.min() + own - 0.01) is Verdict.FAIL
    # without samples nothing is settled, however wide the limit; where all is known the value decides
    assert verdict(1e5, belief=None) is Verdict.INCONCLUSIVE
    assert verdict(1e5, belief=None, open_=False) is Verdict.PASS


@pytest.mark.thorough
def test_governing_torque_without_limits_has_the_largest_median(open_):
    medians = [point.belief.p50 for point in open_.points]
    spreads = [point.belief.p95 / point.belief.p5 for point in open_.points]
    largest = int(np.argmax(medians))
    assert open_.governing == largest != int(np.argmax(spreads))


def test_few_samples_give_a_verdict_only_if_the_interval_agrees(open_):
    first = open_.samples.of_ranges
    agrees = np.arange(len(first.weights)) < 9
    few = replace(
        first,
        few="9 of 2048 draws agree, 64 are wanted",
        weights=first.weights * agrees,
        further_weights=first.further_weights * agrees[:, np.newaxis],
    )
    found = open_.with_samples(few)
    point = found.points[1]
    assert point.belief.p5 < point.belief.p50 < point.belief.p95
    assert found.warnings[-1].startswith("9 of 2048 draws agree, 64 are wanted, so the numbers are approximate")
    kept = replace(point, limit_arcsec=1e5)
    assert (kept.probability.value, kept.verdict) == (1.0, Verdict.INCONCLUSIVE)
    held = replace(found, points=(found.points[0], kept))
    assert "PASS needs 95 % over the whole interval" in " ".join(check_report(held, 0).why)
    assert replace(kept, sure=0.7).verdict is Verdict.PASS


def test_what_is_assumed_counts_as_what_is_unknown_does():
    assumed = [PLAY, "operation.M_g=4"]
    (point,) = check(load_preset(TINY, assumed), draws=16).points
    limit = point.error.F_ior_arcsec + point.self_error.range_arcsec + 0.1  # the preset's own values keep it
    assert point.belief.p95 > point.error.F_ior_arcsec + 1
    assert replace(point, limit_arcsec=limit).verdict is not Verdict.PASS


@pytest.mark.thorough
def test_an_uncertainty_alone_is_judged_by_its_range_too():
    known = check(load_preset(SMALL, ["operation.M_g=4"]))
    assert (known.points[0].belief, known.samples, known.influences) == (None, None, ())
    found = check(load_preset(SMALL, ["operation.M_g=4", "phases.xi_b=90±60", "flexspline.h_1=0.35±0.01"]), draws=16)
    (point,) = found.points
    assert point.belief.p95 - point.belief.p5 > 1
    assert [each.path for each in found.prior.fields] == ["flexspline.h_1", "phases.xi_b"]
    own = point.self_error.range_arcsec
    assert replace(point, limit_arcsec=point.belief.p50 + own).verdict is Verdict.INCONCLUSIVE


@pytest.mark.thorough
def test_one_torque_may_be_settled_and_another_open():
    limits = "acceptance.F_ior={1: 3000, 4: 2050}"
    page = run("check", TINY, "--jobs", "1", "--no-plot", "--set", "phases.phi_hb=unknown", "--set", limits)
    assert page.returncode == 6
    verdicts = [re.search(rf"^ +{torque} .* (\w+)$", page.stdout, re.MULTILINE)[1] for torque in (1, 4)]
    assert verdicts == ["PASS", "INCONCLUSIVE"]
    assert page.stdout.splitlines()[1].startswith("4 N·m: probability that F'_ior + self error ≤ 2050″: ")


@pytest.mark.thorough
def test_check_json_contains_distributions_independent_of_the_number_of_workers(open_):
    with ThreadPoolExecutor(2) as executor:
        again = check(load_preset(TINY, ["phases.phi_hb=unknown", PLAY]), run=Run(executor))
    told = report_object(check_report(open_, 0))
    assert json.dumps(report_object(check_report(again, 0))) == json.dumps(told)
    assert set(told["operating_points"][0]["belief"]) == {
        "p5_arcsec", "p50_arcsec", "p95_arcsec", "p5_error_arcsec", "p50_error_arcsec", "p95_error_arcsec",
        "probability", "probability_low", "probability_high",
    }  # fmt: skip
    assert told["samples"] == {
        "effective": pytest.approx(64), "draws": 64, "draws_of_ranges": 64, "refused": [], "seed": 0,
    }  # fmt: skip
    assert told["influence"][0]["field"] == "tolerances.e_hb"
    assert {"trials", "correction", "tolerance"} <= {each["kind"] for each in told["steps"]}
    gains = [each["gain"] for each in told["steps"] if each["kind"] != "question"]
    assert gains == sorted(gains, reverse=True)
    shares = [each["share"] for each in told["influence"]]
    assert shares == sorted(shares, reverse=True)
    assert 0 < sum(shares) <= 1


def test_without_samples_nothing_that_is_open_is_settled():
    result = run("check", TINY, "--json", "--draws", "0", "--set", PLAY, "--set", "acceptance.F_ior=1e5")
    told = json.loads(result.stdout)
    assert (result.returncode, told["verdict"], told["samples"]) == (6, "INCONCLUSIVE", None)
    assert told["warnings"] == [
        "uncertain, but not sampled: gears.j_n; computed at the given value or at 0, so results have no range"
    ]


def test_a_catalogue_that_contradicts_the_drive_ends_without_a_number():
    result = run(
        "check", TINY, "--jobs", "1", "--draws", "4", "--set", "phases.phi_hb=unknown", "--set", "catalogue.K_2=1e9"
    )
    assert (result.returncode, result.stdout) == (5, "")
    assert "catalogue.K_2 = 1e+09 contradicts" in result.stderr


def test_a_measured_figure_without_anything_open_is_remarked_upon():
    measured, words = "measured.K_2=1400 ± 90", "no effect"
    drives = [load_preset(TINY, each) for each in ([measured], [measured, PLAY], [])]
    said = [" ".join(check(drive, draws=0).warnings) for drive in drives]
    assert [words in each for each in said] == [True, False, False]


@pytest.mark.thorough
def test_extra_samples_for_a_limit_change_neither_ranges_nor_contributions():
    drive = load_preset(TINY, ["phases.phi_hb=unknown", PLAY])
    free = check(drive, draws=16)
    widest = free.points[free.governing]
    limit = widest.belief.p95 + widest.self_error.range_arcsec  # near the threshold of PASS
    held = check(
        load_preset(TINY, ["phases.phi_hb=unknown", PLAY, f"acceptance.F_ior={{{widest.M_g:g}: {limit!r}}}"]), draws=16
    )
    assert held.samples.draws > free.samples.draws
    assert held.samples.made[: free.samples.draws] == free.samples.made

    def shown(found):
        return [
            (b.p5, b.p50, b.p95, b.samples.of_ranges.percentile_error(0.95, b.torque))
            for b in (each.belief for each in found.points)
        ]

    assert shown(held) == shown(free)
    assert held.governing == free.governing
    assert held.influences == free.influences
    assert report_object(check_report(held, 0))["samples"]["draws_of_ranges"] == free.samples.draws
    # the probability is of all that was drawn
    point, k = held.points[held.governing], held.governing
    assert point.probability == held.samples.probability_within(point.left_arcsec, k)


def test_json_F_ior_is_the_median_or_null_without_samples(open_):
    points = report_object(check_report(open_, 0))["operating_points"]
    for point, told in zip(open_.points, points, strict=True):
        assert told["F_ior_arcsec"] == told["belief"]["p50_arcsec"]
        # the drive whose cycle is shown is one in the middle: no number of the preset with the unknown as 0
        assert told["F_ior_shown_arcsec"] == point.error.F_ior_arcsec
        assert point.error.F_ior_arcsec == pytest.approx(point.belief.p50, rel=0.03)
        assert told["F_ior_upper_arcsec"] == told["F_ior_arcsec"] + told["self_error_arcsec"]
    undrawn = check(load_preset(TINY, ["phases.phi_hb=unknown", "operation.M_g=4"]), draws=0)
    (told,) = report_object(check_report(undrawn, 0))["operating_points"]
    assert (told["F_ior_arcsec"], told["F_ior_upper_arcsec"]) == (None, None)
    assert told["F_ior_shown_arcsec"] > 0


@pytest.mark.thorough
@pytest.mark.parametrize(("allowed", "words"), [("0,4", "two"), ("1,4,5", "three")])
def test_check_proposes_measuring_all_usable_holes_of_a_restricted_seat(allowed: str, words: str) -> None:
    found = check(load_preset(TINY, ["phases.phi_hb=unknown", PLAY, f"mounting.allowed=[{allowed}]"]), draws=16)
    report = check_report(found, 0)
    assert [each["of"] for each in report_object(report)["steps"] if each["kind"] == "trials"] == [allowed]
    assert any(f"measure F'_ior in {words} holes" in row[0] for table in steps_tables(found) for row in table.rows)
