"""The levers: fields that are edited, stepped and ranked."""

from __future__ import annotations

import pytest
from textual.pilot import Pilot
from textual.widgets import Input

from hdassist.interface.explorer.app import Explorer, Form
from hdassist.interface.explorer.asking import REST
from tests.explorer.rig import explored, said, screen, settled, tiny, to_lever, typed


@pytest.mark.thorough
def test_a_field_is_edited_marked_compared_and_taken_back() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await to_lever(app, pilot, "gears.j_n")
        assert "gears.j_n: flank clearance" in str(app.lines["about"].render())
        before = app.known
        assert before.check is not None
        await pilot.press("enter")
        await typed(pilot, "8")
        await pilot.press("enter")
        await settled(app, pilot)
        assert app.session.changes == (("gears.j_n", "8"),) and app.session.drive.gears.j_n == 8
        told = screen(app)
        assert app.known.check is not None and app.known is not before
        change = app.known.check.points[0].F_ior_or_error - before.check.points[0].F_ior_or_error
        assert "j_n *" in told and "1 changed" in told and "┄" in told and f"{change:+.2f}" in told
        assert "--set gears.j_n=8" in app.command_line()
        await pilot.press("p")
        assert app.session.pinned == app.session.drive and "┄" not in screen(app)
        assert "vs tiny with 1 changed" in screen(app)
        await pilot.press("u")
        assert app.session.changes == () and app.known is before and f"{-change:+.2f}" in screen(app)

    explored(act, size=(150, 40))


@pytest.mark.thorough
def test_value_out_of_range_is_refused_with_the_loader_message() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await to_lever(app, pilot, "gears.j_n")
        await pilot.press("enter")
        await typed(pilot, "-3")
        await pilot.press("enter")
        assert isinstance(app.screen, Form) and "must be from 0 to 200 um" in screen(app)
        await pilot.press("escape")
        assert app.session.changes == ()

    explored(act)


@pytest.mark.thorough
def test_a_step_is_a_key() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await to_lever(app, pilot, "gears.j_n")
        await pilot.press("plus", "plus", "minus")
        assert app.session.changes == (("gears.j_n", "19"),)
        await to_lever(app, pilot, "bearing.g_b")
        await pilot.press("minus")
        assert app.session.changes == (("gears.j_n", "19"),) and "must be from" in said(app)
        await to_lever(app, pilot, "mounting.fixed")
        await pilot.press("plus")
        assert app.session.changes == (("gears.j_n", "19"),)  # no knob

    explored(act)


@pytest.mark.thorough
def test_inputs_are_ranked_by_the_effect_of_a_plausible_step() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.pause(REST + 0.2)
        await settled(app, pilot)
        effects = app.known.effects
        assert effects is not None
        changes = {path: abs(change[0]) for path, (_, change) in effects.steps.items()}
        assert "of a typical drive" in str(app.side.border_subtitle)
        shown = [str(key.value) for key in app.levers.rows]
        assert shown[: len(changes)] == sorted(changes, key=lambda path: -changes[path])
        assert (
            app.levers.cursor_row == 0 and "operation.dT" in changes
        )  # not known exactly, though no part of the drive
        by, (change,) = effects.steps["gears.j_n"]
        assert by > 1  # about a standard deviation of its plausible range
        row = [str(cell).strip() for cell in app.levers.get_row("gears.j_n")]
        assert row[0].startswith("j_n") and row[1].startswith("flank") and row[3:] == [f"{by:+.4g}", f"{change:+.2f}"]
        heads = [str(column.label).strip() for column in app.levers.columns.values()]
        assert heads == ["field", "meaning", "value", "step", "change"]
        await pilot.press("slash")
        await typed(pilot, "eccentricity")
        await pilot.press("enter")
        found = [str(key.value) for key in app.levers.rows]
        assert {"tolerances.e_hb", "tolerances.e_hh"} <= set(found) and "gears.j_n" not in found

    assumed = ("source.gears.j_n={kind: assumed, range: [12, 18], ref: judged}", "uncertainty.operation.dT=2")
    explored(act, tiny(*assumed), size=(140, 40))


@pytest.mark.thorough
def test_teeth_change_together() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await to_lever(app, pilot, "gears.z_g")
        await pilot.press("plus")
        assert dict(app.session.changes) == {"gears.z_g": "21", "gears.z_b": "23"}
        await pilot.press("u")
        assert app.session.changes == () and app.session.drive.gears.z_b == 22
        await pilot.press("enter")
        app.screen.query_one(Input).value = "12:1"
        await pilot.press("enter")
        assert dict(app.session.changes) == {"gears.z_g": "24", "gears.z_b": "26"}

    explored(act)
