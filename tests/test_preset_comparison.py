"""Presets side by side: the differences, what they do, and what is said where something is not known."""

from __future__ import annotations

import json
import math
import re
from dataclasses import astuple, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hdassist import kinematic_error, load_preset, mounting_curve, stiffness
from hdassist.belief.statistics import Probability, weighted_quantile
from hdassist.features.design import check
from hdassist.features.preset_comparison import (
    DrivePairs,
    at_common_torques,
    compare_drives,
    differing_fields,
    differing_rows,
    drawn_pairs,
    drive_changes,
)
from hdassist.interface.commands.design import is_preset
from hdassist.interface.pages.compare import drives_report
from hdassist.interface.terminal.output import report_object
from hdassist.run.errors import SURE
from hdassist.run.run import UNCHECKED
from tests.helpers.paper import on_paper
from tests.helpers.process import SMALL, TINY, in_a_line, run
from tests.helpers.support import PROVEN

M_G = 4.0
FAST = ("mounting.holes=4",)  # few holes: the less to compute
BETTER = ("tolerances.F_i2=25", "gears.j_n=8")


def small(*overrides: str):
    return load_preset(SMALL, [*FAST, *overrides, f"operation.M_g={M_G}"])


def F_ior(drive) -> float:
    return kinematic_error(drive, M_G, run=UNCHECKED).F_ior_arcsec


@pytest.fixture(scope="module")
def better():
    """The small drive beside one with a better circular spline and more clearance."""
    return compare_drives([small(), small(*BETTER)])


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    """A folder with two presets: the better one does not say where its cam's offset points."""
    folder = tmp_path_factory.mktemp("presets")
    text = Path(SMALL).read_text(encoding="utf-8")
    (folder / "a.yaml").write_text(text, encoding="utf-8")
    (folder / "b.YML").write_text(text.replace("F_i2: 40", "F_i2: 25").replace(" phi_hb: 0,", ""), encoding="utf-8")
    return folder


def test_what_differs_is_told_with_unit_and_origin():
    one, other = small(), small(*BETTER, "mounting.allowed=[0,3]", "catalogue.K_1=3e3", "uncertainty.phases.xi_b=10")
    found = {row[0].path: row for row in differing_rows([one, other])}
    assert list(found) == [
        "gears.j_n",
        "tolerances.F_i2",
        "phases.xi_b",
        "mounting.allowed",
        "catalogue.K_1",
        "uncertainty.phases.xi_b",
    ]
    assert [(field.value, field.unit, field.kind) for field in found["gears.j_n"]] == [
        (6, "um", "given"), (8, "um", "override"),
    ]  # fmt: skip
    assert differing_fields([one, other]) == ["gears.j_n", "tolerances.F_i2", "phases.xi_b"]


@pytest.mark.thorough
def test_the_numbers_are_those_of_the_drives_alone(better):
    here, there, F_i2, j_n = map(F_ior, (small(), small(*BETTER), small(BETTER[0]), small(BETTER[1])))
    [found] = better.changes
    assert better.sheets[1].check.points[0].error.F_ior_arcsec == pytest.approx(there, abs=PROVEN)
    assert found.together.change_arcsec == pytest.approx([there - here], abs=2 * PROVEN)
    assert [change.field for change in found.single] == ["tolerances.F_i2", "gears.j_n"]
    assert [c.change_arcsec[0] for c in found.single] == pytest.approx([F_i2 - here, j_n - here], abs=2 * PROVEN)
    assert (found.not_alone, found.F_ior_is) == ((), ("less",))
    alone = stiffness(small(*BETTER), run=UNCHECKED)
    both = zip(better.sheets[1].stiffness.positive, alone.positive, strict=True)
    assert all(astuple(segment) == pytest.approx(astuple(other), rel=1e-6) for segment, other in both)
    holes = mounting_curve(small(), [M_G], [0.0, 90.0, 180.0, 270.0], run=UNCHECKED)
    assert report_object(drives_report(better, 0))["presets"][0]["best"]["hole"] == holes.recommended.hole


def test_the_answer_alone_is_the_change_of_each_drive(better):
    values = [sheet.check.points[0].error.F_ior_arcsec for sheet in better.sheets]
    report = drives_report(better, 0)
    assert report.verdict == report.line == f"take B: F'_ior of B {100 * (values[1] / values[0] - 1):+.0f} %"


def test_drives_without_common_torque_use_equal_shares_of_rated_torque():
    other = tiny("operation.M_g=[2, 8]", "operation.rated=8")
    drives = at_common_torques([load_preset(SMALL), load_preset("size-14-100"), other])
    rated = load_preset("size-14-100").operation.rated
    assert [drive.operation.M_g for drive in drives] == [(1, 4), (pytest.approx(rated / 4), rated), (2, 8)]
    common = at_common_torques([load_preset(SMALL), tiny("operation.M_g=[4, 8]")])
    assert [drive.operation.M_g for drive in common] == [(4,), (4,)]
    found, _ = drive_changes(*checks(tiny(), tiny("operation.M_g=2")))  # nothing else differs
    assert found.F_ior_is in (("less",), ("more",))


def test_page_states_the_rated_share_of_drives_without_common_torque(better):
    half = load_preset(SMALL, [*FAST, *BETTER, "operation.M_g=2"])
    sheets = (better.sheets[0], replace(better.sheets[1], check=check(half)))
    page = on_paper(drives_report(replace(better, sheets=sheets), 0))
    assert "each drive is computed at 100 % of the rated torque" in in_a_line(page)
    assert re.search(r"^B +2 N·m", page, re.MULTILINE)


def checks(*drives, draws: int = 64):
    return [check(drive, draws=draws, run=UNCHECKED) for drive in drives]


def test_a_direction_is_a_verdict_only_where_it_is_sure():
    def sense(*changes):
        return DrivePairs(np.zeros((len(changes), 1)), np.array([changes]).T, np.eye(len(changes)), ()).senses()

    assert [sense(*[change] * 64) for change in (0.001, -3.0, 3.0)] == [("the same",), ("less",), ("more",)]
    assert sense(*[-3.0] * 60, *[1.0] * 4) == sense(*[-3.0] * 16) == ("unknown",)  # 16 alike may be chance
    rolling = [
        small("bearing.ball_motion=rolling", "bearing.d_ball=3", "numerics.n_beta=4", *more)
        for more in ([], ["tolerances.e_hb=unknown", "tolerances.F_i2=10"])
    ]
    found, _ = drive_changes(*checks(*rolling))
    assert found.F_ior_is == ("unknown",)  # there is no range over what is not known


def probability(value: float, low: float = 0.0, high: float = 1.0) -> Probability:
    return Probability(value, low, high, few=True)


def test_probability_of_being_better_is_the_weight_of_better_pairs(better):
    pairs = DrivePairs(np.zeros((3, 2)), np.array([[-1.0, 2], [-0.001, -2], [-3, 2]]), np.diag([0.5, 0.2, 0.3]), ())
    assert [found.value for found in pairs.probabilities_less()] == pytest.approx([0.8, 0.2])
    changes = replace(better.changes[0], probability_better=(probability(0.7),))
    assert (better.best, replace(better, changes=(changes,)).probability_best.value) == (1, 0.7)
    back = replace(
        better, sheets=better.sheets[::-1], changes=(changes, replace(changes, probability_better=(probability(0.1),)))
    )
    assert (back.best, back.probability_best.value) == (0, pytest.approx(0.3))
    one_torque_less = replace(
        changes, probability_better=(probability(0.85), probability(0.25))
    )  # than the first, and not at the other torque
    assert replace(back, changes=(one_torque_less,) * 2).probability_best.value == 0.75
    alike = replace(better, sheets=(better.sheets[0],) * 2)
    assert (alike.best, alike.word, better.word) == (0, "ANY", "TAKE")
    assert [replace(back, changes=(one_torque_less,) * 2).word, back.word] == ["KEEP", "ANY"]  # 75 and 30 % sure
    assert drives_report(alike, 0).line.startswith("any drive, because all are equal: F'_ior of B ")
    coin = replace(better, changes=(replace(changes, probability_better=(probability(0.48),)),))
    assert (coin.word, coin.best) == ("ANY", 1)
    assert drives_report(coin, 0).line.startswith("any drive, because the difference is not significant: F'_ior of B ")


def test_next_command_reports_the_drive_that_is_taken_or_kept(better):
    worse = replace(better.changes[0], probability_better=(probability(0.0),))
    kept = replace(better, sheets=better.sheets[::-1], changes=(worse,))
    assert (better.word, kept.word) == ("TAKE", "KEEP")
    commands = {on_paper(drives_report(found, 0)).split("next ")[1] for found in (better, kept)}
    assert len(commands) == 1  # the better of the two, whichever was named first


def test_a_change_that_unknown_inputs_could_reverse_is_open(better):
    def page(**known):
        changes = replace(better.changes[0], F_ior_is=("unknown",), **known)
        return in_a_line(on_paper(drives_report(replace(better, changes=(changes,)), 0)))

    assert ": keep A: F'_ior of B open F'_ior" not in page()
    assert ": take B: F'_ior of B open F'_ior" in page(probability_better=(None,))
    likely = page(probability_better=(probability(0.8),))
    assert re.search(r": take B: F'_ior of B -\d+ % F'_ior", likely)
    assert re.search(r" -\d+ % 80 % .*B main cause .*\(tolerances.F_i2\)", likely)
    assert "open unknown inputs may reverse the sign of the change" in likely
    few = page(probability_better=(probability(0.01, 0.0, 0.07),))
    assert "probability of the likelier sign: 99 % (93 to 100); a decision needs 95 % over the whole interval" in few


@pytest.mark.thorough
def test_how_sure_the_better_drive_is_has_its_interval():
    drawn = compare_drives([tiny(C_3), tiny(C_3, "tolerances.F_i2=10")], draws=8)
    odds = drawn.probability_best
    assert odds.low < SURE < odds.value  # of 8 samples
    report = drives_report(drawn, 0)
    assert f"Probability that B is better than A, as assembled: 100 % ({100 * odds.low:.0f} to 100)" in report.line
    assert report_object(report)["best"]["probability_better"] == odds.value
    assert report_object(report)["changes"][0]["probability_better"] == [odds.value]


def test_what_is_not_known_lies_alike_in_both():
    one, other = checks(
        tiny("tolerances.e_hb=unknown", "supports.C_2=6000±600", "supports.C_3=2000±300"),
        tiny(
            "tolerances.e_hb=unknown", "supports.C_2=6000±600", "supports.C_3=1500±100", "gears.m=1.51", "cam.W_0=1.75"
        ),
        draws=8,
    )
    found = drawn_pairs(one, other, same=False, count=8)
    assert len(found.drives) == 8
    assert found.certificate.states  # the second drive's own samples lie otherwise
    highs = [{f.path: f.high for f in each.prior.fields}["tolerances.e_hb"] for each in (one, other)]
    assert highs[0] < highs[1]
    own = set()
    for a, b in found.drives:
        assert a.number("tolerances.e_hb") / highs[0] == pytest.approx(b.number("tolerances.e_hb") / highs[1])
        assert a.number("supports.C_2") == b.number("supports.C_2")
        own.add(a.number("supports.C_3") / b.number("supports.C_3"))
    assert len(own) == 8  # known in each, and not the same way


def test_fields_that_form_no_drive_alone_are_listed_without_results():
    one = small("tolerances.F_i2=0", "phases.xi_b=unknown")
    other = small("phases.xi_b=90", "gears.z_g=62", "gears.z_b=64", "cam.W_0=0.57")
    found, _ = drive_changes(*checks(one, other))
    # teeth go in pairs; and the size of a deviation alone leaves its direction open
    assert set(found.not_alone) >= {"gears.z_g", "gears.z_b", "tolerances.F_i2"}
    assert {change.field for change in found.single} == {"phases.xi_b", "cam.W_0"}
    assert [c.change_arcsec[0] for c in found.single if c.field == "phases.xi_b"] == [0]


@pytest.mark.thorough
def test_unknown_inputs_of_one_preset_give_ranges_and_any_hole(files):
    fast = [word for text in FAST for word in ("--set", text)]
    result = run("compare", "a.yaml", "b.YML", "--torque", "3", "--draws", "4", "--json", *fast, cwd=files)
    assert result.returncode == 0, result.stderr
    told = json.loads(result.stdout)
    assert (told["schema"], told["M_g_Nm"]) == ("hdassist.compare-presets/1", [3])
    assert [preset["file"] for preset in told["presets"]] == ["a.yaml", "b.YML"]
    known, open_ = told["presets"]
    assert known["operating_points"][0]["belief"]["p95_arcsec"] is None
    assert open_["operating_points"][0]["belief"]["p95_arcsec"] > 0
    assert (known["word"], known["order"]) == ("TURN", "turn")
    assert (open_["word"], open_["order"], open_["best"]["hole"]) == ("ANY_HOLE", "leave", None)
    [changed] = told["changes"]
    assert changed["pairs"] == 4
    assert changed["together"]["p5_arcsec"] < changed["together"]["p95_arcsec"]
    [better] = changed["probability_better"]
    assert 0 <= better <= 1
    assert told["best"] == {"word": "TAKE", "preset": 1, "probability_better": better}
    assert told["share_of_rated"] is None
    assert [field["field"] for field in told["differences"]] == ["tolerances.F_i2", "phases.phi_hb"]
    assert told["differences"][1]["values"][1] == {
        "value": None, "origin": "unknown", "reference": "", "range": None,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "preset"),
    [("vzp160", True), ("./vzp160", False), ("a.yaml", True), ("b.YML", True), ("run.csv", False), ("-", False)],
)
def test_preset_is_a_library_name_or_a_yaml_file(name, preset):
    assert is_preset(name) is preset


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        (["b.YML", "run.csv"], 2, "cannot compare the recording run.csv with the preset b.YML"),
        (["b.YML", "--drift", "linear"], 2, "options for reading recordings do not apply to presets"),
        (["b.YML", "--torque", "1e8"], 2, "a torque"),
        (["b.YML", "--csv", "a.csv"], 2, "use hdassist check a.yaml b.YML --csv FILE"),
        (["none.yaml"], 4, "no such file: none.yaml"),
        (["b.YML", "--set", "gears.j_n=-1"], 2, "gears.j_n: must be from"),
    ],
)
def test_what_cannot_be_meant_is_refused(files, args, code, words):
    result = run("compare", "a.yaml", *args, "-o", "page.txt", cwd=files)
    assert (result.returncode, result.stdout) == (code, "")
    assert words in result.stderr
    assert not (files / "page.txt").exists()


C_3 = "source.supports.C_3={kind: assumed, range: [1000, 8000], ref: judged}"
J_N = "source.gears.j_n={kind: assumed, range: [16, 20], ref: judged}"
W_0 = "source.cam.W_0={kind: assumed, range: [1.7, 1.8], ref: judged}"
WIDE = "source.gears.j_n={kind: assumed, range: [10, 30], ref: judged}"
CATALOGUE = ("catalogue.K_1=800", "catalogue.K_2=1400", "catalogue.accuracy=2100")


def tiny(*overrides: str):
    return load_preset(TINY, [f"operation.M_g={M_G}", *overrides])


@cache
def checked(*overrides: str):
    """The check of a tiny drive, once for all tests that need it."""
    (found,) = checks(tiny(*overrides))
    return found


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("one", "other"),
    [
        ((C_3, J_N), (C_3, J_N, "tolerances.F_i2=10")),
        ((C_3, J_N), (C_3, "gears.j_n=20")),
        ((C_3, "tolerances.e_hb=unknown"), (C_3, "tolerances.e_hb=5", "phases.xi_b=unknown")),
        (("tolerances.F_i2=10",), (C_3, J_N)),
        ((C_3, W_0, *CATALOGUE), (C_3, W_0, *CATALOGUE, "tolerances.F_i2=10")),
        ((C_3, W_0, *CATALOGUE), (C_3, *CATALOGUE, "cam.W_0=1.75", "tolerances.e_hb=unknown")),
        ((C_3, WIDE), (C_3, WIDE, "catalogue.accuracy=90")),
        ((C_3, WIDE, "catalogue.accuracy=90"), (C_3, WIDE, "gears.m=1.501")),
        ((C_3, J_N, "measured.F_ior={h0@4: 120 ± 20}"), (C_3, J_N)),
    ],
)
def test_pairs_have_the_medians_and_ranges_of_check(one, other):
    first, second = checked(*one), checked(*other)
    found = drawn_pairs(first, second, same=False)
    sides = (found.before_arcsec, found.weights.sum(1)), (found.after_arcsec, found.weights.sum(0))
    for each, (F_ior, weights) in zip((first, second), sides, strict=True):
        assert weights.sum() == pytest.approx(1)
        (point,) = each.points
        for share, error in ((0.05, 0.1), (0.5, 0.15), (0.95, 0.1)):  # of the samples: chance, twice
            near = [weighted_quantile(F_ior[:, 0], weights, float(np.clip(share + s, 0, 1))) for s in (-error, error)]
            told = point.F_ior_arcsec if share == 0.5 else point.range_arcsec[share > 0.5]
            assert near[0] * 0.98 <= told <= near[1] * 1.02


@pytest.mark.thorough
def test_derived_bound_is_a_change_of_its_own():
    one, other = checks(*(tiny("harmonics.a_b2=unknown", f"tolerances.F_i2={F}") for F in (400, 10)))
    found, _ = drive_changes(one, other)
    assert {change.field for change in found.single} == {"tolerances.F_i2", "harmonics.a_b2"}
    assert differing_fields([one.drive, other.drive]) == ["tolerances.F_i2"]


@pytest.mark.thorough
@pytest.mark.parametrize(
    "sets",
    [
        ("gears.j_n=17±0.1", "supports.C_3=2500±10"),
        ("tolerances.F_i1=10", "tolerances.F_i2=10"),
        ("phases.xi_b=unknown", "tolerances.F_i2=5"),
        ("tolerances.e_hb=unknown", "gears.j_n=21"),
    ],
)
def test_no_change_contradicts_the_medians_of_check(sets):
    one, other = checked(C_3, J_N, *CATALOGUE), checked(C_3, J_N, *CATALOGUE, *sets)
    there, back = (drive_changes(*pair)[0] for pair in ((one, other), (other, one)))
    change = other.points[0].F_ior_arcsec - one.points[0].F_ior_arcsec
    assert there.F_ior_is[0] in (("less", "unknown") if change < 0 else ("more", "unknown"))
    opposite = {"less": "more", "more": "less"}
    assert back.F_ior_is[0] in (opposite.get(there.F_ior_is[0], "unknown"), "unknown")


def test_a_share_of_no_error_is_not_said():
    none = tiny(*(f"tolerances.{size}=0" for size in ("F_i1", "F_i2", "e_hb", "e_hh")))
    found = compare_drives([none, tiny()])
    assert found.sheets[0].check.points[0].F_ior_arcsec == 0
    assert np.isfinite(found.changes[0].together.share).all()
    assert drives_report(found, 0).line == "keep A: F'_ior of B larger"


def test_three_presets_are_held_against_the_first(better):
    three = replace(better, sheets=(*better.sheets, better.sheets[1]), changes=better.changes * 2)
    report = drives_report(three, 0)
    change = report.line.removeprefix("take B: F'_ior of B ").partition(";")[0]
    assert report.line == f"take B: F'_ior of B {change}; C {change}"
    assert len(report_object(report)["changes"]) == 2


def test_three_drives_with_assembled_and_best_errors_fit_one_screen(better):
    three = replace(better, sheets=(*better.sheets, better.sheets[1]), changes=better.changes * 2)
    page = on_paper(drives_report(three, 0))
    lines = page.splitlines()
    share = 100 * better.changes[0].together.share[0]
    files = ", ".join(f"{letter} {SMALL}" for letter in "ABC")
    assert in_a_line(page).startswith(f"{files}: take B: F'_ior of B {-share:+.0f} %; C {-share:+.0f} % ")
    for letter, sheet in zip("ABC", three.sheets, strict=True):
        built = sheet.check.points[0].error.F_ior_arcsec
        best = sheet.advice.chosen
        change = r"- +-$" if letter == "A" else rf"{-share:+.0f} % +100 %$"
        row = rf"^{letter} +4 N·m +{built:.1f} +{best.F_ior_arcsec[0]:.1f}, hole {best.hole} +{change}"
        assert re.search(row, page, re.MULTILINE), row
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80


def test_the_rest_stands_in_the_details(better):
    report = drives_report(better, 0)
    short, long = (on_paper(report, ascii=True, details=details) for details in (False, True))
    plain = in_a_line(short)
    assert "differs gears.j_n, tolerances.F_i2 next hdassist report" in plain
    for words in ("fields that differ", "25 (override)", "equilibrium", "a single field is changed from A to B"):
        assert words in long
        assert words not in short


@pytest.mark.thorough
def test_drawn_pairs_are_searched_as_samples_are():
    sets = ["operation.M_g=80", "tolerances.e_hb=unknown"]
    one, other = load_preset("vzp160", sets), load_preset("vzp160", [*sets, "tolerances.F_i2=60"])
    found, proof = drive_changes(*checks(one, other, draws=4), pairs=4)
    searches = 2 * found.pairs + 2 + found.pairs  # of both drives, of the one field screened, and of it in all pairs
    assert proof.states < 1000 * searches


@pytest.mark.thorough
def test_limit_gives_drives_their_probability_as_assembled_and_best(tmp_path):
    text = Path(SMALL).read_text(encoding="utf-8")
    (tmp_path / "a.yaml").write_text(text, encoding="utf-8")
    (tmp_path / "b.yaml").write_text(text.replace("F_i2: 40", "F_i2: 25"), encoding="utf-8")
    uncertain = "phases.xi_b=90 ± 60"
    options = ["--set", uncertain, "--set", FAST[0], "--torque", "4", "--draws", "16", "--json"]
    limited = [*options, "--limit", "30"]
    answer = json.loads(run("compare", "a.yaml", "b.yaml", *limited, cwd=tmp_path).stdout)
    for name, preset in zip(("a.yaml", "b.yaml"), answer["presets"], strict=True):
        checked = json.loads(run("check", name, *limited, cwd=tmp_path).stdout)
        [point] = checked["operating_points"]
        assert preset["operating_points"][0]["belief"]["probability"] == point["belief"]["probability"]
        mounted = json.loads(run("mount", name, *limited, cwd=tmp_path).stdout)
        [best] = [each for each in mounted["positions"] if each["hole"] == preset["best"]["hole"]]
        assert preset["best"]["probability"] == [best["probability_kept"]]
        [low], [high] = preset["best"]["probability_low"], preset["best"]["probability_high"]
        assert low <= best["probability_kept"] <= high
        assert 0.01 < high - low < 0.6  # 16 effective samples
    page = run("compare", "a.yaml", "b.yaml", *[word for word in limited if word != "--json"], cwd=tmp_path).stdout
    for preset in answer["presets"]:
        low, high = (preset["best"][f"probability_{end}"][0] for end in ("low", "high"))
        assert f"({math.floor(round(100 * low, 6))}-{math.ceil(round(100 * high, 6))})" in page
    without = json.loads(run("compare", "a.yaml", "b.yaml", *options, cwd=tmp_path).stdout)
    assert [preset["best"]["probability"] for preset in without["presets"]] == [[None], [None]]


def test_a_limit_does_not_apply_to_a_recording(tmp_path):
    (tmp_path / "run.csv").write_text("0,1\n", encoding="utf-8")
    answer = run("compare", SMALL, "run.csv", "--limit", "30", cwd=tmp_path)
    assert answer.returncode == 2 and "--limit" in answer.stderr
