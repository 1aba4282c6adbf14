"""F'_ior over all that is not known exactly, as the explorer has it: the numbers and the verdict of check."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import pytest

from hdassist.design.check import check
from hdassist.errors import HdassistError
from hdassist.explorer.asking import Known
from hdassist.explorer.compute import ErrorRange, ExplorerAnswer, Headline, LeverEffects, drive_answers, lever_effects
from hdassist.explorer.service import Failed
from hdassist.explorer.words import headline
from hdassist.loading.load import load_preset
from hdassist.report.report import Report
from hdassist.verdict import Verdict
from tests.explorer.rig import QUICK, tiny
from tests.process import TINY, no_processes

OPEN = ("phases.phi_hb=unknown", "source.gears.j_n={kind: assumed, range: [12, 18], ref: judged}")


def believed(*overrides: str) -> list[Headline]:
    """Headlines, the whole one last."""
    told: list[ExplorerAnswer] = []
    with no_processes():
        drive_answers(load_preset(TINY, overrides), QUICK, told.append)
    return [each for each in told if isinstance(each, Headline)]


def test_it_grows_to_the_numbers_and_the_verdict_of_check() -> None:
    *grown, found = believed(*OPEN, "acceptance.F_ior={1: 3000, 4: 2050}")
    points = check(load_preset(TINY, [*OPEN, "acceptance.F_ior={1: 3000, 4: 2050}"]), draws=QUICK.draws).points
    for row, point in zip(found.rows, points, strict=True):
        assert point.belief and point.probability and point.held_arcsec and point.limit_arcsec
        assert (row.M_g, row.p5, row.p50, row.p95) == (point.M_g, point.belief.p5, point.belief.p50, point.belief.p95)
        assert (row.limit_arcsec, row.probability, row.verdict) == (
            point.limit_arcsec, point.probability.value, point.verdict,
        )  # fmt: skip
        assert row.margin_arcsec == pytest.approx(point.limit_arcsec - point.held_arcsec[1])
    sizes = [each.samples for each in grown]
    assert sizes == sorted(sizes) and sizes[0] < 9 and len(sizes) > 1 and found.whole and not grown[-1].whole
    assert grown[-1].rows == found.rows


def test_where_all_is_known_it_is_the_value_and_the_verdict_of_check() -> None:
    (found,) = believed("acceptance.F_ior={1: 3000, 4: 20}")
    points = check(load_preset(TINY, ["acceptance.F_ior={1: 3000, 4: 20}"])).points
    for row, point in zip(found.rows, points, strict=True):
        assert (row.p5, row.p95, row.verdict) == (*[point.error.F_ior_arcsec] * 2, point.verdict)
    assert [row.verdict for row in found.rows] == [Verdict.PASS, Verdict.FAIL] and found.typical == {}


def test_a_contradiction_and_rolling_balls_are_said() -> None:
    with pytest.raises(HdassistError, match="contradicts the other evidence"):
        believed(*OPEN, "catalogue.K_1=1e9", "catalogue.K_2=1", "catalogue.K_3=1")
    (found,) = believed(*OPEN, "bearing.ball_motion=rolling", "bearing.d_ball=5")
    assert found.report and any("no range over them" in note for note in found.report.warnings)


def test_an_old_answer_and_one_that_is_not_whole_are_called_so() -> None:
    row = ErrorRange(4.0, 1.0, 2.0, 3.0, 2.25, 2.5, 0.7, Verdict.INCONCLUSIVE)
    found, shown = Headline((row,), 16.2), partial(headline, tiny(), pinned=None)
    first, second = shown(Known(headline=found)).plain.split("\n")
    assert first.endswith("(5-50-95 %, 16 samples …)")
    assert second == "4 N·m 1.00 - 2.00 - 3.00″, limit 2.5: kept 70 %, INCONCLUSIVE (-0.75″ to the limit)"
    assert (
        shown(Known(headline=replace(found, report=Report("check", None, ""))))
        .plain.split("\n")[0]
        .endswith("16 samples)")
    )
    assert "(old, computing …)" in shown(Known(old=found)).plain
    assert shown(Known(old=found, failed=Failed("edge"))).plain == "F'_ior: no answer"


def test_levers_move_a_typical_drive_with_what_is_unknown_of_it() -> None:
    open_ = ("operation.M_g=[4.0]", "tolerances.e_hb=unknown")
    *_, found = believed(*open_)
    told: list[ExplorerAnswer] = []
    with no_processes():
        lever_effects(load_preset(TINY, open_), found.typical, QUICK, told.append)
    effects = told[-1]
    assert isinstance(effects, LeverEffects) and found.typical["tolerances.e_hb"] > 0
    by, (change,) = effects.steps["tolerances.e_hb"]
    assert by > 1 and abs(change) > 0.1
