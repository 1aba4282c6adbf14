"""Fields that were fitted together are drawn together."""

import json
from pathlib import Path

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.belief.draws import Sampling
from hdassist.belief.evidence import STIFFNESS_FIGURES, Evidence
from hdassist.belief.prior import prior_of
from hdassist.belief.proposals import PILOT_DRAWS, proposed_draws
from hdassist.drive.loading import load_text, with_found_values
from hdassist.features.preset_comparison import differently_open
from tests.helpers.process import TINY, run

ROWS = [(18.0, 2000.0), (16.0, 2300.0), (19.0, 1900.0), (17.0, 2100.0)]
J_N, C_3 = zip(*ROWS, strict=True)
FIT = (f"fit.gears.j_n={list(J_N)}", f"fit.supports.C_3={list(C_3)}")


def fitted(*overrides: str):
    return load_preset(TINY, [*FIT, "phases.xi_b=unknown", *overrides])


def drawn(drive, count=64, seed=1):
    prior = prior_of(drive)
    return prior.values(prior.shares(count, seed))


def test_fit_draws_are_complete_and_equally_frequent():
    pairs = [(each["gears.j_n"], each["supports.C_3"]) for each in drawn(fitted())]
    assert {pair: pairs.count(pair) for pair in ROWS} == dict.fromkeys(ROWS, 16)
    directions = np.array([each["phases.xi_b"] for each in drawn(fitted())])  # drawn beside, and of each alike
    assert np.ptp([directions[[pair == row for pair in pairs]].mean() for row in ROWS]) < 90


@pytest.mark.parametrize(
    ("override", "known"),
    [("supports.C_3=2500", {2500.0}), ("supports.C_3=2000", {2000.0}), ("supports.C_3=2000 ± 0", {2000.0})],
)
def test_set_field_has_its_value_and_others_stay_fitted(override, known):
    draws, drive = drawn(fitted(override)), fitted(override)
    assert {each.get("supports.C_3", drive.supports.C_3) for each in draws} == known
    assert {each["gears.j_n"] for each in draws} == {*J_N}


def test_uncertainty_replaces_the_fit_of_its_field():
    spread = [each["supports.C_3"] for each in drawn(fitted("uncertainty.supports.C_3=200"))]
    assert np.std(spread) == pytest.approx(100, rel=0.1)


def test_value_changed_by_hand_replaces_its_fit_with_a_warning():
    text = Path(TINY).read_text(encoding="utf-8") + f"fit: {{supports.C_3: {list(C_3)}, gears.j_n: {list(J_N)}}}\n"
    changed = load_text(text.replace("C_3: 2.0e3", "C_3: 2.5e3"), "own.yaml")
    assert {each.path for each in prior_of(changed).fields} == {"gears.j_n"}
    (warning,) = changed.origin.warnings
    assert "supports.C_3: 2500 differs from the fitted value 2000" in warning


def test_values_identified_anew_are_around_no_fit_of_before():
    text = Path(TINY).read_text(encoding="utf-8") + f"fit:\n  supports.C_3: {list(C_3)}\n"
    assert (
        load_text(text, "own.yaml").fit
        and not load_text(with_found_values(text, "own", {"gears.j_n": 17.5}, "rig"), "own").fit
    )


def test_a_proposal_never_takes_a_fit_apart():
    """K_1 follows the clearance of the fit: it alone would be drawn nearer otherwise."""
    prior, K_1 = prior_of(fitted()), Evidence("catalogue.K_1", "K_1", 17.0, 0.01)
    values = prior.values(prior.shares(PILOT_DRAWS, 1))
    pilot = [dict.fromkeys(STIFFNESS_FIGURES, each["gears.j_n"]) for each in values]
    shares, _ = proposed_draws(prior, (K_1,), pilot, PILOT_DRAWS, 2 * PILOT_DRAWS, 1)
    assert {(each["gears.j_n"], each["supports.C_3"]) for each in prior.values(shares)} <= {*ROWS}


def test_kept_draws_and_pairs_know_what_belongs_together():
    other = fitted(f"fit.supports.C_3={[C_3[0], *C_3[:0:-1]]}")  # the same values of each field in another order
    one, another = (Sampling(prior_of(each), (4.0,)).answer.depends for each in (fitted(), other))
    assert one != another
    assert differently_open(fitted(), other) == ["supports.C_3"]


def test_pages_draw_and_name_the_fields_of_a_fit():
    sets = [word for each in (*FIT, "operation.M_g=4") for word in ("--set", each)]
    found = json.loads(run("check", TINY, *sets, "--draws", "16", "--json").stdout)
    assert {each["field"] for each in found["influence"]} <= {"gears.j_n", "supports.C_3"}
    (point,) = found["operating_points"]
    assert point["belief"]["p5_arcsec"] < point["belief"]["p50_arcsec"] < point["belief"]["p95_arcsec"]
