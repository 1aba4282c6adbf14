"""F'_ior over the holes, the seat, and where the wheel is looked at."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from textual.pilot import Pilot

from hdassist.belief.samples import EFFECTIVE_SAMPLES
from hdassist.features.design import check
from hdassist.features.mounting.advice import Advice
from hdassist.interface.explorer.app import Explorer, Form
from hdassist.interface.explorer.asking import REST, Known
from hdassist.interface.explorer.compute import FULL, SURE_RANGE
from hdassist.interface.explorer.panes import next_text, order_words
from hdassist.interface.explorer.state import Session, opened_state
from hdassist.interface.pages.check import F_ior_table
from hdassist.interface.pages.mount import mount_report
from tests.explorer.rig import FEW, QUICK, F_ior, explored, known_is, screen, settled, tiny
from tests.helpers.advices import advice_of
from tests.helpers.process import SMALL


@pytest.mark.thorough
def test_arrow_keys_turn_the_wheel_and_show_the_position_values() -> None:
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
        await pilot.click(app.holes, offset=(5, 5))
        await pilot.pause()
        assert app.session.turn_deg == 180

    explored(act)


@pytest.mark.thorough
def test_holes_that_are_not_allowed_are_marked_and_never_best() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        barred = [key for key in app.holes.rows if "x" in str(app.holes.get_row(key)[0])]
        assert [round(float(str(key.value)) / 60) for key in barred] == [0, 3, 4]  # the wheel stands in one of them
        await pilot.press("b")
        assert app.session.turn_deg == min([60.0, 120.0, 300.0], key=lambda at: F_ior(app, at))

    explored(act, tiny("mounting.allowed=[1, 2, 5]"), size=(140, 40))


@pytest.mark.thorough
def test_the_best_and_the_worst_hole_are_those_of_mount() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        assert app.known.advice is not None
        ranked = [position.hole for position in app.known.advice.ranked]
        signs = {k: str(app.holes.get_row(key)[0]) for k, key in enumerate(app.holes.rows)}
        assert [k for k, text in signs.items() if "B" in text] == ranked[:1]
        assert [k for k, text in signs.items() if "W" in text] == [app.known.advice.worst.hole]

    explored(act, tiny("uncertainty.phases.phi_hb=60", "mounting.holes=12"), size=(140, 40))


@pytest.fixture(scope="module")
def likely() -> str:
    """F'_ior in three holes that the small drive can show: as computed of it, turned by a hole."""
    app = explored(lambda app, pilot: pilot.pause(), opened_state(SMALL, FEW))
    values = [F_ior(app, 60.0 * k) for k in range(6)]
    return " ".join(f"h{k}={values[(k - 1) % 6]:.1f}" for k in (0, 2, 4))


@pytest.mark.thorough
def test_several_measured_positions_have_the_answer_of_mount(likely: str) -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await known_is(app, pilot, likely)
        found = app.known
        assert isinstance(found.advice, Advice) and found.curve is not None and found.report is not None
        assert found.advice.values == len(likely.split())
        told = screen(app)
        assert "◆" in told and "90 % RANGE" in told and "hdassist mount" in told and "any position" not in told
        assert set(found.curve.sure) == {SURE_RANGE}
        assert order_words(found) == " ".join(found.report.why) and found.report.command == "mount"
        await pilot.press("u")
        await settled(app, pilot)
        assert isinstance(app.known.advice, Advice) and "◆" not in screen(app)
        await pilot.press("r")
        assert app.known is found

    explored(act, opened_state(SMALL, FEW), size=(140, 40))


TURNABLE = ("phases.xi_b=unknown", "phases.phi_eb=unknown", "tolerances.e_b=0")  # any hole may be the best


def range_of_check(session: Session) -> str:
    """F'_ior over all that is not known exactly, as `hdassist check` has it and the explorer writes it."""
    assert FULL.draws == EFFECTIVE_SAMPLES
    ((_, median, ends, *_),) = F_ior_table(check(session.drive, draws=QUICK.draws)).rows
    return f"{median} {ends}"


@pytest.mark.thorough
def test_unknown_directions_give_a_range_and_an_any_hole_card(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)

    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        told = screen(app)
        assert "no hole is expected to be better than another" in told and "PROVEN" not in told
        assert app.known.curve is not None and range_of_check(app.session) in " ".join(told.split())
        low, _, high = app.known.curve.F_ior_arcsec[:, 0, 0]
        assert f"{low:.1f}…{high:.1f}" in told and "best:" not in told
        (point,) = check(app.session.drive, draws=QUICK.draws).points
        assert point.held_arcsec is not None
        margin = 2050 - point.held_arcsec[1]
        assert f"2050 {point.verdict} {margin:+.2f} {100 * point.probability.value:.0f} %" in " ".join(told.split())
        assert app.known.check is not None
        assert app.known.check.steps and "option" in told
        await pilot.press("c")
        await pilot.pause()
        assert isinstance(app.screen, Form) and not list(tmp_path.iterdir())

    explored(act, tiny(*TURNABLE, "acceptance.F_ior=2050"), size=(140, 40))


@pytest.mark.thorough
def test_result_with_an_unknown_deviation_is_never_called_proven() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        curve = app.known.curve
        assert curve is not None and set(curve.sure) == {SURE_RANGE}
        told = screen(app)
        assert range_of_check(app.session) in " ".join(told.split())
        low, _, high = curve.F_ior_arcsec[:, 0, 0]
        assert 0 < low < high and f"{low:.1f}…{high:.1f}" in told
        await pilot.press("right")
        await pilot.pause(REST + 0.2)
        await settled(app, pilot)
        assert "REVOLUTION of a typical drive" in screen(app) and "hdassist mount" in screen(app)
        await pilot.press("4")
        await settled(app, pilot)
        assert "hdassist trace" in screen(app) and "PROVEN" not in told + screen(app)
        at = shlex.split(app.command_line())
        assert any(word.startswith("tolerances.e_hh=") for word in at)  # the typical drive's, not 0

    explored(act, tiny("tolerances.e_hh=unknown"), size=(160, 45))


@pytest.mark.thorough
def test_limits_are_drawn_above_ranges_and_action_precedes_reason() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        bars = [str(app.holes.get_row(key)[-1]) for key in app.holes.rows]
        (limit,) = {bar.index("│") for bar in bars if "│" in bar}
        assert any(bar[limit - 1] == bar[limit + 1] == "─" for bar in bars)
        assert next_text(app.known).startswith(
            "The circular spline may be put in any hole. The direction of the deviations is unknown"
        )
        assert "torque" not in str(app.lines["keys"].content)

    explored(act, tiny(*TURNABLE, "acceptance.F_ior=110"), size=(140, 40))


@pytest.mark.thorough
def test_without_colours_no_style_has_one() -> None:
    code = "from hdassist.interface.explorer import panes as p\n"
    code += "print(p._VERDICT_STYLES, p._LETTER_STYLES, p._torque_style(1))"
    shown = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "NO_COLOR": "1"}, capture_output=True, text=True, check=True
    )
    assert "not dim bold" in shown.stdout and "#" not in shown.stdout and "red" not in shown.stdout


@pytest.mark.parametrize("holes", [12, 24])
def test_next_step_begins_with_an_action_that_fits_80_columns(holes: int) -> None:
    for best in (1, holes // 2 - 1, holes - 2):
        F_ior = [30.0 + 2 * (k != best) for k in range(holes)]
        advice = advice_of(F_ior, overrides=(f"mounting.holes={holes}",))
        order, *_ = next_text(Known(advice=advice, report=mount_report(advice, 0))).split("\n")
        assert order.startswith(f"Put the circular spline in hole {best}. That is ")
        assert re.search(r"\(\d+°\) (counter-)?clockwise", order[:78])
