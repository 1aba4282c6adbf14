"""F'_ior over all that is not known exactly, as the explorer has it: the numbers and the verdict of check."""

from __future__ import annotations

from dataclasses import replace

from hdassist.design.check import check
from hdassist.explorer.answers import Answer, Believed, TorqueBelief
from hdassist.explorer.compute import answers
from hdassist.explorer.known import Known
from hdassist.explorer.questions import BeliefQuestion
from hdassist.explorer.words import belief
from hdassist.loading.load import load_preset
from tests.explorer.rig import QUICK
from tests.process import TINY

OPEN = ("phases.phi_hb=unknown", "source.gears.j_n={kind: assumed, range: [12, 18], ref: judged}")


def believed(*overrides: str) -> tuple[list[Answer], Believed]:
    """What is told on the way, and the answer."""
    told: list[Answer] = []
    (found,) = answers(BeliefQuestion(load_preset(TINY, overrides), QUICK), told.append)
    assert isinstance(found, Believed)
    return told, found


def test_it_grows_to_the_numbers_and_the_verdict_of_check() -> None:
    told, found = believed(*OPEN, "acceptance.F_ior={1: 3000, 4: 2050}")
    points = check(load_preset(TINY, [*OPEN, "acceptance.F_ior={1: 3000, 4: 2050}"]), draws=QUICK.draws).points
    for row, point in zip(found.rows, points, strict=True):
        assert point.belief and point.probability
        assert (row.M_g, row.p5, row.p50, row.p95) == (point.M_g, point.belief.p5, point.belief.p50, point.belief.p95)
        assert (row.limit_arcsec, row.probability, row.verdict) == (
            point.limit_arcsec, point.probability.value, point.verdict,
        )  # fmt: skip
    grown = [each.samples for each in told if isinstance(each, Believed) and not each.whole]
    assert grown == sorted(grown) and grown[0] < 9 and len(grown) > 1 and found.whole


def test_nothing_is_drawn_where_all_is_known_and_a_contradiction_is_said() -> None:
    assert believed()[1] == Believed(())
    _, found = believed(*OPEN, "catalogue.K_1=1e9", "catalogue.K_2=1", "catalogue.K_3=1")
    assert found.rows == () and "contradicts the other evidence" in found.failed
    assert belief(Known(belief=found)) == [f"no range of F'_ior: {found.failed}"]
    _, rolling = believed(*OPEN, "bearing.ball_motion=rolling", "bearing.d_ball=5")
    assert "cannot be searched" in rolling.failed


def test_what_is_old_or_not_whole_is_said_to_be() -> None:
    found = Believed((TorqueBelief(4.0, 1.0, 2.0, 3.0, 2.5, 0.7, "INCONCLUSIVE"),), 16.2, whole=False)
    head, row = belief(Known(belief=found))
    assert head.endswith("5-50-95 % (16 samples …)")
    assert row == "4 N·m 1.00 - 2.00 - 3.00″, limit 2.5: kept 70 %, INCONCLUSIVE"
    assert belief(Known(belief=replace(found, whole=True)))[0].endswith("(16 samples)")
    assert belief(Known(old=found))[0].endswith("(old, computing …)")
    assert belief(Known()) == []
