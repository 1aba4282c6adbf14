from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest
from textual.pilot import Pilot
from textual.widgets import Input

from hdassist.belief.samples import EFFECTIVE_SAMPLES
from hdassist.design.check import check
from hdassist.explorer.app import Explorer
from hdassist.explorer.asking import REST
from hdassist.explorer.compute import FULL, SURE_RANGE
from hdassist.explorer.screens import Form, Notice
from hdassist.explorer.state import Session, opened_state
from hdassist.explorer.words import middle_of, order_words
from hdassist.loading.load import load_text
from hdassist.mounting.advice import Advice
from hdassist.preset.schema import resolved_fields
from hdassist.trials.advice import TrialAdvice
from tests.explorer.rig import FEW, QUICK, explored, said, screen, settled, tiny, typed
from tests.process import SMALL, TINY, run

SETS = [word for text in FEW for word in ("--set", text)]


def test_the_screen_has_error_seat_holes_levers_cam_turn_and_the_order() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.pause(REST + 0.2)
        await settled(app, pilot)
        told = screen(app)
        assert app.known.advice is not None and "Turn the rigid wheel" in told
        assert "SEAT" in told and "LEVERS" in told and "F'_ior by hole, ″" in told
        assert f"= hdassist mount {TINY[:40]}" in told
        assert "PROVEN" in told and "80 N·m" not in told
        found = app.known.turn
        assert found is not None and told.count("cam angle, turns") == 2 and "hdassist trace" not in told
        (point,) = check(app.session.drive).points
        assert f"▸4 N·m {point.error.F_ior_arcsec:.2f}" in " ".join(told.split()) and "every state" in told

    explored(act, size=(140, 44))


def F_ior(app: Explorer, rotation_deg: float) -> float:
    """F'_ior in a position, as the holes have it."""
    curve = app.known.curve
    assert curve is not None
    place = curve.place(rotation_deg)
    assert place is not None
    return float(curve.F_ior_arcsec[1, 0, place])


def test_arrows_turn_the_wheel_and_the_values_are_those_of_the_position() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("right", "right", "left")
        assert app.session.turn_deg == 60
        assert "hole 1 (60°)" in screen(app) and f"{F_ior(app, 60):.2f}" in screen(app)
        await pilot.press("b")
        positions = [60.0 * k for k in range(6)]
        assert app.session.turn_deg == min(positions, key=lambda at: F_ior(app, at)) != 0
        await pilot.press("0")
        assert app.session.turn_deg == 0
        await pilot.press("down", "down")
        assert app.session.turn_deg == 120
        await pilot.click(app.holes, offset=(5, 4))
        assert app.session.turn_deg == 180

    explored(act)


def test_holes_that_are_not_allowed_are_marked_and_never_the_best() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        barred = [key for key in app.holes.rows if "x" in str(app.holes.get_row(key)[0])]
        assert [round(float(str(key.value)) / 60) for key in barred] == [0, 3, 4]  # the wheel stands in one of them
        await pilot.press("b")
        assert app.session.turn_deg == min([60.0, 120.0, 300.0], key=lambda at: F_ior(app, at))

    explored(act, tiny("mounting.allowed=[1, 2, 5]"), size=(140, 40))


def test_the_best_and_the_worst_hole_are_those_of_mount() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert app.known.advice is not None
        ranked = [position.hole for position in app.known.advice.choice.ranked]
        signs = {k: str(app.holes.get_row(key)[0]) for k, key in enumerate(app.holes.rows)}
        assert [k for k, text in signs.items() if "B" in text] == ranked[:1]
        assert [k for k, text in signs.items() if "W" in text] == ranked[-1:]

    explored(act, tiny("uncertainty.phases.phi_hb=60", "mounting.holes=12"), size=(140, 40))


@pytest.fixture(scope="module")
def likely() -> str:
    """F'_ior in three holes that the small drive can show: as computed of it, turned by a hole."""
    app = explored(lambda app, pilot: pilot.pause(), opened_state(SMALL, FEW))
    values = [F_ior(app, 60.0 * k) for k in range(6)]
    return " ".join(f"h{k}={values[(k - 1) % 6]:.1f}" for k in (0, 2, 4))


def test_several_measured_positions_have_the_answer_of_trials(likely: str) -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await known_is(app, pilot, likely)
        found = app.known
        assert isinstance(found.advice, TrialAdvice) and found.curve is not None and found.report is not None
        assert [trial.F_ior_arcsec for trial in found.advice.trials] == [
            float(word.partition("=")[2]) for word in likely.split()
        ]
        told = screen(app)
        assert "◆" in told and "90 % RANGE" in told and "hdassist trials" in told and "any position" not in told
        assert set(found.curve.sure) == {SURE_RANGE}
        assert order_words(found) == " ".join(found.report.why) and found.report.command == "trials"
        assert not found.advice.settled
        await pilot.press("c")
        assert "no card: nothing is ordered" in said(app)
        await pilot.press("u")
        await settled(app, pilot)
        assert isinstance(app.known.advice, Advice) and "◆" not in screen(app)
        await pilot.press("r")
        assert app.known is found

    explored(act, opened_state(SMALL, FEW), size=(140, 40))


def test_evidence_that_cannot_be_is_refused_where_it_is_entered() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("e")
        await typed(pilot, "h99=3")
        await pilot.press("enter")
        assert isinstance(app.screen, Form) and "h0 to h5" in screen(app)
        await pilot.press("escape")
        assert app.session.changes == () and not isinstance(app.screen, Form)

    explored(act)


async def to_lever(app: Explorer, pilot: Pilot[int], path: str) -> None:
    if path not in app.levers.rows:  # no part of the drive: it has to be looked for
        app.wanted.value = path
        await pilot.pause()
    app.levers.focus()
    await pilot.pause()  # from then on the cursor stays on its field when others are ranked above it
    app.levers.move_cursor(row=app.levers.get_row_index(path))
    await pilot.pause()


def test_a_field_is_edited_marked_compared_and_taken_back() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await to_lever(app, pilot, "gears.j_n")
        assert "gears.j_n: clearance per flank" in str(app.lines["about"].render())
        before = app.known
        assert before.check is not None
        await pilot.press("enter")
        await typed(pilot, "8")
        await pilot.press("enter")
        await settled(app, pilot)
        assert app.session.changes == (("gears.j_n", "8"),) and app.session.drive.gears.j_n == 8
        told = screen(app)
        assert app.known.check is not None and app.known is not before
        change = middle_of(app.known.check.points[0]) - middle_of(before.check.points[0])
        assert "j_n *" in told and "1 changed" in told and "┄" in told and f"{change:+.2f}" in told
        assert "--set gears.j_n=8" in app.command_line()
        await pilot.press("p")
        assert app.session.pinned == app.session.drive and "┄" not in screen(app)
        assert "vs tiny with 1 changed" in screen(app)
        await pilot.press("u")
        assert app.session.changes == () and app.known is before and f"{-change:+.2f}" in screen(app)

    explored(act, size=(150, 40))


def test_a_value_out_of_range_is_refused_with_the_loaders_words() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await to_lever(app, pilot, "gears.j_n")
        await pilot.press("enter")
        await typed(pilot, "-3")
        await pilot.press("enter")
        assert isinstance(app.screen, Form) and "out of range: 0 to 200 um" in screen(app)
        await pilot.press("escape")
        assert app.session.changes == ()

    explored(act)


def test_a_step_is_a_key() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await to_lever(app, pilot, "gears.j_n")
        await pilot.press("plus", "plus", "minus")
        assert app.session.changes == (("gears.j_n", "19"),)
        await to_lever(app, pilot, "bearing.g_b")
        await pilot.press("minus")
        assert app.session.changes == (("gears.j_n", "19"),) and "out of range" in said(app)
        await to_lever(app, pilot, "mounting.fixed")
        await pilot.press("plus")
        assert app.session.changes == (("gears.j_n", "19"),)  # no knob

    explored(act)


def test_a_drive_that_cannot_be_computed_is_said_and_the_next_one_is_computed() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert app.known.failed is not None and "NO ANSWER" in screen(app)
        assert app.known.failed.message[:30] in screen(app)
        await to_lever(app, pilot, "operation.M_g")
        await pilot.press("enter")
        app.screen.query_one(Input).value = "[4]"
        await pilot.press("enter")
        await settled(app, pilot)
        assert app.known.advice is not None

    explored(act, tiny("operation.M_g=[9000000.0]"))


TURNABLE = ("phases.xi_b=unknown", "phases.phi_eb=unknown", "tolerances.e_b=0")  # any hole may be the best


def range_of_check(session: Session) -> str:
    """F'_ior over all that is not known exactly, as `hdassist check` has it and the explorer writes it."""
    (point,) = check(session.drive, draws=QUICK.draws).points
    assert FULL.draws == EFFECTIVE_SAMPLES and point.belief
    return f"{point.belief.p50:.2f} {point.belief.p5:.1f} to {point.belief.p95:.1f}"


def test_unknown_directions_have_a_range_with_its_verdict_no_order_and_no_card(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        told = screen(app)
        assert "any position may be the best" in told and "PROVEN" not in told
        assert app.known.curve is not None and range_of_check(app.session) in told
        low, _, high = app.known.curve.F_ior_arcsec[:, 0, 0]
        assert f"{low:.1f}…{high:.1f}" in told and "best:" not in told
        (point,) = check(app.session.drive, draws=QUICK.draws).points
        assert point.held_arcsec is not None
        margin = 2050 - point.held_arcsec[1]
        assert f"2050 {point.verdict} {margin:+.2f} {100 * point.probability.value:.0f} %" in " ".join(told.split())
        assert (
            app.known.check and f"{100 * app.known.check.to_measure[0].gain:3.0f} % more sure: F'_ior at 4 N·m" in told
        )
        await pilot.press("c")
        await pilot.pause()
        assert "no card" in said(app) and not isinstance(app.screen, Form) and not list(tmp_path.iterdir())

    explored(act, tiny(*TURNABLE, "acceptance.F_ior=2050"), size=(140, 40))


def test_nothing_computed_with_an_unknown_size_at_0_is_called_proven() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        curve = app.known.curve
        assert curve is not None and set(curve.sure) == {SURE_RANGE}
        told = screen(app)
        assert range_of_check(app.session) in told
        low, _, high = curve.F_ior_arcsec[:, 0, 0]
        assert 0 < low < high and f"{low:.1f}…{high:.1f}" in told
        await pilot.press("right")
        await pilot.pause(REST + 0.2)
        await settled(app, pilot)
        assert "CAM TURN, of a typical drive" in screen(app) and "hdassist mount" in screen(app)
        await pilot.press("4")
        await settled(app, pilot)
        assert "hdassist trace" in screen(app) and "PROVEN" not in told + screen(app)
        at = shlex.split(app.command_line())
        assert any(word.startswith("tolerances.e_hh=") for word in at)  # the typical drive's, not 0

    explored(act, tiny("tolerances.e_hh=unknown"), size=(160, 45))


def test_levers_are_ranked_by_what_a_plausible_step_changes_and_filtered() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.pause(REST + 0.2)
        await settled(app, pilot)
        effects = app.known.effects
        assert effects is not None
        changes = {path: abs(change[0]) for path, (_, change) in effects.steps.items()}
        shown = [str(key.value) for key in app.levers.rows]
        assert shown[: len(changes)] == sorted(changes, key=lambda path: -changes[path])
        assert (
            app.levers.cursor_row == 0 and "operation.dT" in changes
        )  # not known exactly, though no part of the drive
        by, (change,) = effects.steps["gears.j_n"]
        assert by > 1  # about a standard deviation of its plausible range
        assert f"{by:+.4g}: {change:+.2f}" in str(app.levers.get_row("gears.j_n")[2])
        await pilot.press("slash")
        await typed(pilot, "cam offset")
        await pilot.press("enter")
        found = [str(key.value) for key in app.levers.rows]
        assert {"tolerances.e_hb", "tolerances.e_hh"} <= set(found) and "gears.j_n" not in found

    assumed = ("source.gears.j_n={kind: assumed, range: [12, 18], ref: judged}", "uncertainty.operation.dT=2")
    explored(act, tiny(*assumed), size=(140, 40))


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


def test_one_pane_at_a_time_where_there_is_little_room() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert "LEVERS" not in screen(app) and all(len(row) == 80 for row in screen(app).split("\n"))
        assert "F'_ior by hole, ″" in screen(app)
        for key, title in (
            ("3", "LEVERS"),
            ("2", "270"),
            ("4", "CAM TURN"),
            ("6", "WHY"),
            ("7", "ADVICE"),
            ("1", "F'_ior by hole, ″"),
        ):
            await pilot.press(key)
            await pilot.pause()
            assert title in screen(app)
        await pilot.resize_terminal(60, 18)
        await pilot.pause()
        assert "hole 0 (0°), where it stands" in screen(app) and "too small" not in screen(app)
        await pilot.resize_terminal(140, 40)
        await pilot.pause()
        assert "LEVERS" in screen(app) and "SEAT" in screen(app)
        await pilot.resize_terminal(50, 15)
        await pilot.pause()
        assert "too small for the explorer" in screen(app) and "LEVERS" not in screen(app)
        await pilot.resize_terminal(100, 30)
        await settled(app, pilot)
        assert "LEVERS" in screen(app) and "too small" not in screen(app)

    explored(act, size=(80, 24))


def test_explanation_and_torque_are_a_key_away() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("question_mark")
        assert isinstance(app.screen, Notice) and "REFINED" in screen(app)
        await pilot.press("escape", "4", "m")
        await pilot.pause(REST + 0.2)
        await settled(app, pilot)
        assert "error F_kpp, ″, at 4 N·m" in screen(app) and "hdassist trace" in screen(app) and "▸4 N·m" in screen(app)

    explored(act, tiny("operation.M_g=[1.0, 4.0]"))


def test_in_seven_bits_the_screen_is_as_wide_and_says_the_same() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        views = [told := screen(app)]
        assert "SEAT" in told and "4 N*m" in told and "@ PROVEN" in told and "computing ~" not in told[:400]
        await pilot.press("question_mark")
        await pilot.pause()
        views.append(screen(app))
        assert "o  the extremes of the cycle" in views[1]
        assert all(view.isascii() for view in views) and "e evidence" in told
        assert {len(line) for view in views for line in view.splitlines()} == {140}

    explored(act, size=(140, 40), ascii=True)


def test_text_of_a_preset_steers_no_terminal(tmp_path: Path) -> None:
    file = tmp_path / "drive.yaml"
    text = Path(TINY).read_text().replace("name: tiny", 'name: "a\\u202eb"').replace("mounting", "mounting")
    file.write_text(text)

    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert "\u202e" not in screen(app) and "a\\u202eb" in screen(app)

    explored(act, opened_state(str(file), FEW))


def test_a_picture_is_of_the_screen_and_loads_nothing(tmp_path: Path) -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("g")
        app.screen.query_one(Input).value = str(tmp_path / "screen.svg")
        await pilot.press("enter")
        await pilot.pause(0.3)
        made = (tmp_path / "screen.svg").read_text()
        assert made.startswith("<svg") and "LEVERS" in made and "@font-face" not in made

    explored(act)


def test_the_preset_is_saved_with_its_comments_and_never_over_a_file_unasked(tmp_path: Path) -> None:
    original = Path(TINY).read_text()
    there = tmp_path / "mine.yaml"

    async def save(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("s")
        app.screen.query_one(Input).value = str(there)
        await pilot.press("enter")
        await pilot.pause(0.3)

    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await to_lever(app, pilot, "gears.j_n")
        await pilot.press("plus")
        await save(app, pilot)
        wanted = original.replace("j_n: 18", "j_n: 19").replace("[1, 4]", "[4.0]")
        assert there.read_text() == f"{wanted}mounting:\n  holes: 6\n"
        assert load_text(there.read_bytes(), str(there)).gears.j_n == 19 and f"wrote {there}" in said(app)
        there.write_text("precious")
        await save(app, pilot)
        assert isinstance(app.screen, Notice)
        await pilot.press("n")
        assert there.read_text() == "precious"
        await save(app, pilot)
        await pilot.press("y")
        assert "j_n: 19" in there.read_text()
        await pilot.press("q")
        await pilot.pause()
        assert app.is_running and "comes back to this session" in screen(app) and "gears.j_n=19" in screen(app)
        await pilot.press("y")
        await pilot.pause()
        assert not app.is_running

    explored(act)


def test_a_file_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("s")
        app.screen.query_one(Input).value = str(tmp_path / "nowhere" / "mine.yaml")
        await pilot.press("enter")
        await pilot.pause(0.3)
        assert "cannot write" in said(app) and "there is no directory" in said(app)

    explored(act)


def test_the_card_is_that_of_the_command(tmp_path: Path) -> None:
    from tests.process import run

    card = tmp_path / "card.txt"
    assert run("mount", TINY, *SETS, "--draws", "8", "-q", "--card", str(card)).returncode == 0

    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("c")
        app.screen.query_one(Input).value = str(tmp_path / "card.pdf")
        await pilot.press("enter")
        await pilot.pause(0.3)
        assert "its name ends in .txt, .html" in said(app)
        await pilot.press("c")
        app.screen.query_one(Input).value = str(tmp_path / "mine.txt")
        await pilot.press("enter")
        await pilot.pause(0.3)
        assert (tmp_path / "mine.txt").read_text() == card.read_text()

    explored(act)


async def known_is(app: Explorer, pilot: Pilot[int], text: str) -> None:
    """Type what is known of the drive, and wait for the answer."""
    await pilot.press("e")
    app.screen.query_one(Input).value = text
    await pilot.press("enter")
    await settled(app, pilot)
    assert not isinstance(app.screen, Form), screen(app)


def test_from_a_limit_to_what_to_measure_every_number_is_that_of_check(tmp_path: Path) -> None:
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
        told = " ".join(screen(app).split())
        await pilot.press("s")
        app.screen.query_one(Input).value = str(saved)
        await pilot.press("enter")
        await pilot.pause(0.3)
        answer = json.loads(run("check", str(saved), "--draws", f"{QUICK.draws}", "--json").stdout)
        (point,) = answer["operating_points"]
        F, margin = point["belief"], point["limit_arcsec"] - point["held_arcsec"][1]
        shown = f"{F['p50_arcsec']:.2f} {F['p5_arcsec']:.1f} to {F['p95_arcsec']:.1f} {limit:.1f} {point['verdict']}"
        assert f"{shown} {margin:+.2f} {100 * F['probability']:.0f} %" in told
        for one in answer["to_measure"][:2]:
            assert f"{100 * one['gain']:.0f} % more sure" in told
        for one in answer["influence"][:2]:
            assert f"{100 * one['share']:.0f} % " in told

    explored(act, tiny("tolerances.e_hb=unknown"), size=(140, 44))


def test_what_is_pinned_and_which_torque_is_shown_stand_on_every_screen() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert "▸1 N·m" in screen(app) and "vs tiny " in screen(app)
        await pilot.press("m")
        assert "▸4 N·m" in screen(app) and "▸1 N·m" not in screen(app)
        await known_is(app, pilot, "gears.j_n=8")
        await pilot.press("p")
        assert "vs tiny with 1 changed" in screen(app)

    explored(act, tiny("operation.M_g=[1.0, 4.0]"), size=(80, 24))


def test_the_whole_seat_with_its_quarters_and_every_hole_have_room_in_80_columns() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert all(f"\n{hole:>4} " in screen(app) for hole in range(12))
        await pilot.press("2")
        await pilot.pause()
        told = screen(app)
        assert all(f" {angle} " in told for angle in (90, 180, 270)) and all(f" {k} " in told for k in range(12))

    explored(act, tiny("mounting.holes=12"), size=(80, 24))


def test_keys_at_the_bottom_are_those_that_work_where_the_focus_is_and_are_pressed_by_a_click() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        def keys() -> str:
            return str(app.lines["keys"].render()).replace("\N{NO-BREAK SPACE}", " ")

        assert "e evidence" in keys() and "x_b with W_0" not in keys() and "undo" not in keys()
        await pilot.press("3", "tab")
        await to_lever(app, pilot, "gears.j_n")
        assert "k x_b with W_0" in keys() and "o by group" in keys()
        await pilot.press("plus")
        assert "u undo" in keys()
        await pilot.press("k")
        assert "x_b keeps clearance" in screen(app)
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


def test_the_report_is_the_page_of_check(tmp_path: Path) -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("w")
        app.screen.query_one(Input).value = str(tmp_path / "page.md")
        await pilot.press("enter")
        await pilot.pause(0.3)
        assert app.known.check is not None
        value = f"{app.known.check.points[0].error.F_ior_arcsec:.2f}"
        assert value in (tmp_path / "page.md").read_text()

    explored(act)
