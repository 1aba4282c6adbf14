"""What is known of the drive, typed on the screen."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from textual.pilot import Pilot
from textual.widgets import Input, Static

from hdassist.interface.explorer.app import Explorer, Form
from hdassist.interface.explorer.compute import typical_of
from tests.explorer.rig import QUICK, explored, filled, known_is, screen, settled, tiny, to_lever, typed
from tests.helpers.process import run


@pytest.mark.thorough
def test_evidence_that_cannot_be_is_refused_where_it_is_entered() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("e")
        assert "for F'_ior the default is 2" in str(app.screen.query_one("#hint", Static).render())
        await typed(pilot, "h99=3")
        await pilot.press("enter")
        assert isinstance(app.screen, Form) and "h0 to h5" in screen(app)
        assert "--set" not in str(app.screen.query_one("#wrong", Static).render())  # nobody typed that
        app.screen.query_one(Input).value = "K1=3.1e4"
        await pilot.press("enter")
        assert "the nearest name is K_1" in screen(app)
        await pilot.press("escape")
        assert app.session.changes == () and not isinstance(app.screen, Form)

    explored(act)


@pytest.mark.thorough
def test_failed_drive_is_reported_and_the_next_one_is_computed() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert app.known.failed is not None and "no result" in screen(app)
        assert app.known.failed.message[:30] in screen(app) and "computing" not in screen(app)
        await to_lever(app, pilot, "operation.M_g")
        await pilot.press("enter")
        app.screen.query_one(Input).value = "[4]"
        await pilot.press("enter")
        await settled(app, pilot)
        assert app.known.advice is not None

    explored(act, tiny("operation.M_g=[9000000.0]"))


@pytest.mark.thorough
def test_explorer_numbers_equal_those_of_check_along_the_documented_path(tmp_path: Path) -> None:
    """The path of docs/design.md: a limit, two measurements, and the preset that is saved."""
    saved = tmp_path / "saved.yaml"

    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert app.known.check is not None
        first = app.known.check.points[0]
        assert first.belief is not None
        widths = [first.belief.p95 - first.belief.p5]
        limit = first.belief.p50 + first.self_error.range_arcsec
        for text in (f"limit={limit:.1f}", "tolerances.e_hb=3 ± 0.3"):
            await known_is(app, pilot, text)
            belief = app.known.check.points[0].belief
            assert belief is not None
            widths.append(belief.p95 - belief.p5)
        assert widths[2] < widths[0]  # the range shrinks
        assert app.known.first is not None and app.known.old is not None
        before, (now,) = typical_of(app.known.old)[1], app.known.first.F_ior_arcsec
        assert abs(now - before[0]) > 0.01  # the typical drive has the measured value too
        told = " ".join(screen(app).split())
        await pilot.press("s")
        await filled(app, pilot, str(saved))
        answer = json.loads(run("check", str(saved), "--draws", f"{QUICK.draws}", "--json").stdout)
        (point,) = answer["operating_points"]
        F, margin = point["belief"], point["limit_arcsec"] - point["held_arcsec"][1]
        shown = f"{F['p50_arcsec']:.2f} {F['p5_arcsec']:.1f} to {F['p95_arcsec']:.1f} {limit:.1f} {point['verdict']}"
        assert f"{shown} {margin:+.2f} {100 * F['probability']:.0f} %" in told
        for one in answer["steps"][:2]:
            assert f"{100 * one['outcomes'][0]['probability']:.0f} %" in told
        for one in answer["influence"][:2]:
            assert f"{100 * one['share']:.0f} % " in told

    explored(act, tiny("tolerances.e_hb=unknown"), size=(140, 44))


@pytest.mark.thorough
def test_evidence_that_contradicts_is_shown_whole_on_the_smallest_screen() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        failed = app.known.failed
        assert failed is not None and "contradicts the other reference data" in failed.message
        assert f"{failed.message} {failed.hint}" in " ".join(screen(app).split())

    open_ = ("phases.phi_hb=unknown", "source.gears.j_n={kind: assumed, range: [12, 18], ref: judged}")
    explored(act, tiny(*open_, "catalogue.K_1=1e9", "catalogue.K_2=1", "catalogue.K_3=1"), size=(60, 18))
