"""What stands on the screen, at each size."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest
from textual.pilot import Pilot

from hdassist.drive.preset.fields import resolved_fields
from hdassist.features.design import check
from hdassist.interface.explorer.app import Explorer, Notice
from hdassist.interface.explorer.asking import REST
from hdassist.interface.explorer.state import opened_state
from tests.explorer.rig import FEW, explored, known_is, said, screen, settled, tiny, to_lever
from tests.helpers.process import TINY


@pytest.mark.thorough
def test_screen_shows_error_seat_holes_inputs_curve_and_recommendation() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.pause(REST + 0.2)
        await settled(app, pilot)
        told = screen(app)
        assert app.known.advice is not None and "Put the circular spline in hole " in told
        assert "SEAT" in told and "INPUTS" in told and "F'_ior by hole, ″" in told
        assert f"= hdassist mount {TINY[:40]}" in told
        assert "PROVEN" in told and "80 N·m" not in told
        found = app.known.turn
        assert found is not None and told.count("input angle, revolutions") == 2 and "hdassist trace" not in told
        (point,) = check(app.session.drive).points
        assert f"▸4 N·m ─●─ {point.error.F_ior_arcsec:.2f}" in " ".join(told.split()) and "every position" in told

    explored(act, size=(140, 44))


@pytest.mark.thorough
def test_every_screen_shows_the_pinned_preset_and_the_torque() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert "▸1 N·m" in screen(app) and "vs tiny " in screen(app)
        await pilot.press("m")
        assert "▸4 N·m" in screen(app) and "▸1 N·m" not in screen(app)
        await known_is(app, pilot, "gears.j_n=8")
        await pilot.press("p")
        assert "vs tiny with 1 changed" in screen(app)

    explored(act, tiny("operation.M_g=[1.0, 4.0]"), size=(80, 24))


@pytest.mark.thorough
def test_a_drive_at_another_torque_is_compared_with_none() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        def heads() -> list[str]:
            return screen(app).partition("1 holes")[0].split()

        await known_is(app, pilot, "gears.j_n=8")
        assert "change," in heads() and "┄" in screen(app)
        await known_is(app, pilot, "operation.M_g=[1]")
        assert "change," not in heads() and "┄" not in screen(app)

    explored(act, size=(120, 30))


@pytest.mark.thorough
def test_verdict_stays_at_the_top_in_sixty_columns() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        top = screen(app).partition("1 holes")[0]
        assert "verdict" in top and "F'_ior, ″" in top and " 5 to 95 %, ″" in top
        assert "margin" not in top

    explored(act, tiny("acceptance.F_ior=500", "source.bearing.g_b={kind: assumed, range: [0, 3]}"), size=(60, 18))


@pytest.mark.thorough
def test_one_pane_at_a_time_where_there_is_little_room() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert "INPUTS" not in screen(app) and all(len(row) == 80 for row in screen(app).split("\n"))
        assert all(key in screen(app) for key in ("e evidence", "p pin", "c card", "w report"))  # each in one line
        assert "F'_ior by hole, ″" in screen(app)
        for key, title in (
            ("3", "INPUTS"),
            ("2", "270"),
            ("4", "REVOLUTION"),
            ("6", "WHY"),
            ("7", "ADVICE"),
            ("1", "F'_ior by hole, ″"),
        ):
            await pilot.press(key)
            await pilot.pause()
            assert title in screen(app)
        await pilot.resize_terminal(60, 18)
        await pilot.pause()
        assert "hole 0 (0°), present hole" in screen(app) and "too small" not in screen(app)
        await pilot.resize_terminal(140, 40)
        await pilot.pause()
        assert "INPUTS" in screen(app) and "SEAT" in screen(app)
        await pilot.resize_terminal(50, 15)
        await pilot.pause()
        assert "needs at least 60 x 18" in screen(app) and "INPUTS" not in screen(app)
        await pilot.resize_terminal(100, 30)
        await settled(app, pilot)
        assert "INPUTS" in screen(app) and "too small" not in screen(app)

    explored(act, size=(80, 24))


@pytest.mark.thorough
def test_seat_with_all_holes_and_angles_fits_80_columns() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert all(f"\n{hole:>4} " in screen(app) for hole in range(12))
        await pilot.press("2")
        await pilot.pause()
        told = screen(app)
        assert all(f" {angle} " in told for angle in (90, 180, 270)) and all(f" {k} " in told for k in range(12))

    explored(act, tiny("mounting.holes=12"), size=(80, 24))


@pytest.mark.thorough
def test_bottom_line_lists_keys_of_the_focus_and_accepts_clicks() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        def keys() -> str:
            return str(app.lines["keys"].render())

        assert "e evidence" in keys() and "x_b with W_0" not in keys() and "undo" not in keys()
        await pilot.press("3", "tab")
        await to_lever(app, pilot, "gears.j_n")
        assert "k x_b with W_0" in keys() and "o by group" in keys()
        await pilot.press("plus")
        assert "u undo" in keys()
        await pilot.press("k")
        assert "x_b follows W_0" in screen(app)
        shown = list(app.levers.rows)
        await pilot.press("o")
        in_order = [field.path for field in resolved_fields(app.session.drive)]
        grouped = [str(key.value) for key in app.levers.rows]
        assert grouped == [path for path in in_order if path in grouped] and "numerics.window" not in grouped
        assert shown != list(app.levers.rows) or app.known.effects is None
        await pilot.click(app.lines["tabs"], offset=(3, 0))
        await pilot.pause()
        assert app.all.has_class("holes")

    explored(act, size=(100, 30))


@pytest.mark.thorough
def test_two_torques_have_bars_of_their_own_within_the_pane() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        for size in ((140, 40), (100, 30), (80, 24), (60, 20)):
            await pilot.resize_terminal(*size)
            await settled(app, pilot)
            bars = [str(app.holes.get_row(key)[3]) for key in app.holes.rows]
            assert len(bars[0]) >= 10 and all("◌" in bar and "▫" in bar for bar in bars), size  # without colour too
            assert sum(column.width for column in app.holes.columns.values()) <= app.holes.size.width, size
            assert {"1 N·m", "4 N·m"} <= {str(column.label).strip() for column in app.holes.columns.values()}
        assert "▸1 N·m ─◌─" in screen(app) and "4 N·m ═▫═" in screen(app) and "F'_ior, ″" in screen(app)

    explored(act, tiny("operation.M_g=[1.0, 4.0]", "uncertainty.cam.W_0=0.001"), size=(140, 40))


@pytest.mark.thorough
def test_seat_has_a_legend_and_inputs_keep_their_sequence() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.pause(REST + 0.2)
        await settled(app, pilot)
        assert "N now  B best  W worst  o selected" in screen(app)
        before = list(app.levers.rows)
        await known_is(app, pilot, "gears.j_n=9")
        await pilot.pause(REST + 0.2)
        await settled(app, pilot)
        assert list(app.levers.rows) == before

    explored(act, size=(140, 40))


@pytest.mark.thorough
def test_dialog_hides_the_keys_of_the_screen_until_it_closes() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        for key, words in (("question_mark", "Escape closes"), ("e", "Escape cancels"), ("c", "Escape cancels")):
            await pilot.press(key)
            await pilot.pause()
            assert words in screen(app) and "evidence" not in screen(app), key
            await pilot.press("escape")
            await pilot.pause()
            assert "e evidence" in screen(app), key

    explored(act)


def test_no_key_is_silent() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        app.answers.clear()
        await pilot.press("b", "c")
        assert "no best hole yet: computing … ─" in said(app) and "no card: computing … ─" in said(app)

    explored(act)


@pytest.mark.thorough
def test_explanation_and_torque_are_a_key_away() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("question_mark")
        assert isinstance(app.screen, Notice) and "SCREEN" in screen(app)
        await pilot.press("escape", "4", "m")
        await pilot.pause(REST + 0.2)
        await settled(app, pilot)
        assert (
            "kinematic error F_kpp at 4 N·m" in screen(app)
            and "hdassist trace" in screen(app)
            and "▸4 N·m" in screen(app)
        )

    explored(act, tiny("operation.M_g=[1.0, 4.0]"))


@pytest.mark.thorough
def test_ascii_screen_has_the_same_width_and_content() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        views = [told := screen(app)]
        assert "SEAT" in told and "4 N*m" in told and "@ PROVEN" in told and "computing ~" not in told[:400]
        await pilot.press("question_mark")
        await pilot.pause()
        views.append(screen(app))
        assert "o 0  the extremes of the cycle" in views[1]
        assert all(view.isascii() for view in views) and "e evidence" in told
        assert {len(line) for view in views for line in view.splitlines()} == {140}

    explored(act, size=(140, 40), ascii=True)


@pytest.mark.thorough
def test_text_of_a_preset_steers_no_terminal(tmp_path: Path) -> None:
    file = tmp_path / "drive.yaml"
    text = Path(TINY).read_text().replace("name: tiny", 'name: "a\\u202eb"').replace("mounting", "mounting")
    file.write_text(text)

    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert "\u202e" not in screen(app) and "a\\u202eb" in screen(app)

    explored(act, opened_state(str(file), FEW))


@pytest.mark.thorough
def test_explorer_without_a_terminal_leaves_signals_to_its_process() -> None:
    before = signal.getsignal(signal.SIGTERM)

    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert signal.getsignal(signal.SIGTERM) is before

    explored(act)
