from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hdassist.drive.error.cycle import kinematic_error
from hdassist.drive.loading import load_text
from hdassist.features.measuring.full_cycle import with_full_cycle
from hdassist.features.measuring.measure import measure
from hdassist.interface.explorer import state
from hdassist.interface.explorer.panes import head_line
from hdassist.interface.explorer.state import Session
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.run.errors import DataError, HdassistError, UsageError
from hdassist.run.run import UNCHECKED
from tests.explorer.rig import tiny
from tests.helpers.process import TINY


@pytest.fixture
def session() -> Session:
    return state.opened_state(TINY)


def test_an_edit_is_an_override_and_makes_another_drive(session: Session) -> None:
    there = state.edited(session, "gears.j_n", "8")
    assert (session.drive.gears.j_n, there.drive.gears.j_n) == (18, 8)
    assert there.command() == f"hdassist mount {TINY} --set gears.j_n=8"
    same = load_text(there.source.text, TINY, ["gears.j_n=8"])
    assert there.drive == same and there.drive.origin.overrides == same.origin.overrides


def test_units_are_converted_as_in_a_preset(session: Session) -> None:
    assert state.edited(session, "gears.j_n", "0.008 mm").drive.gears.j_n == pytest.approx(8)


def test_a_refused_value_bears_the_loaders_words_and_changes_nothing(session: Session) -> None:
    with pytest.raises(UsageError, match=r"gears\.j_n: must be from 0 to 200 um"):
        state.edited(session, "gears.j_n", "-3")


def test_an_empty_value_takes_the_change_back(session: Session) -> None:
    assert state.edited(state.edited(session, "gears.j_n", "8"), "gears.j_n", " ").changes == ()


def test_undo_and_redo_cover_edits_and_reference_data_unlike_turns(session: Session) -> None:
    steps = [state.edited(session, "gears.j_n", "8")]
    steps.append(state.with_evidence(state.turned_state(steps[-1], 2), "h2=28.1"))
    last = steps[-1]
    assert dict(last.changes)["measured.F_ior.h2@1"] == "28.1 ± 2"
    back = state.undone(last)
    assert (back.changes, back.turn_deg) == (steps[0].changes, 60)
    assert state.undone(back).changes == ()
    assert state.redone(state.redone(state.undone(back))).changes == last.changes
    assert state.edited(back, "gears.j_n", "9").future == ()  # what was undone is forgotten


@pytest.mark.parametrize("text", ["", "h12=3", "abc", "h1:", "h1=-3", "17:3"])
def test_evidence_that_cannot_be_is_refused(session: Session, text: str) -> None:
    with pytest.raises(HdassistError):
        state.with_evidence(session, text)


def test_fewer_holes_are_refused_while_one_beyond_is_measured(session: Session) -> None:
    tried = state.with_evidence(session, "h11=20")
    with pytest.raises(UsageError, match="h0 to h5"):
        state.edited(tried, "mounting.holes", "6")


def test_several_positions_at_the_lightest_torque_are_trials(session: Session) -> None:
    one = state.with_evidence(session, "h0=28.1")
    assert one.command().startswith("hdassist mount ")
    assert state.with_evidence(one, "h4@4=17.3").command().startswith("hdassist mount ")
    two = state.with_evidence(one, "h4=17.3 ± 1")
    sets = "--set 'measured.F_ior.h0@1=28.1 ± 2' --set 'measured.F_ior.h4@1=17.3 ± 1'"
    assert two.command() == f"hdassist mount {TINY} {sets}"
    assert state.with_evidence(two, "h4=").command() == one.command()


def test_trace_command_uses_the_displayed_wheel_position(session: Session) -> None:
    looked = state.turned_state(session, 1)
    assert "--set phases.xi_b=120" in looked.trace_command(4.0, {})
    assert "phases.xi_b" not in looked.command()


def test_turning_goes_round_and_free_angles_go_by_steps() -> None:
    assert state.turned_state(tiny(), -1).turn_deg == 300
    free = tiny("mounting.holes=0")
    assert state.turned_state(free, 1).turn_deg == 5 and state.turned_state(free, 1).here == "5"


def test_of_two_values_of_a_field_the_last_one_counts() -> None:
    there = state.edited(tiny("gears.j_n=7"), "gears.j_n", "8")
    assert there.drive.gears.j_n == 8 and there.command().count("gears.j_n") == 1


def test_a_pin_is_what_others_are_compared_with(session: Session) -> None:
    there = state.edited(session, "gears.j_n", "8")
    assert state.pinned(there).pinned == there.drive
    assert state.pinned(state.pinned(there)).pinned == session.drive


def test_second_preset_is_pinned_at_the_torques_of_the_first() -> None:
    two = state.opened_state(TINY, ("operation.M_g=[3.0]",), pin="vzp160")
    assert "with" not in head_line(two).plain
    assert two.pinned.name == "vzp160" and two.pinned.operation.M_g == (3.0,)
    assert two.command("explore") == f"hdassist explore {TINY} --torque=3 --pin vzp160"
    assert "--pin" not in two.command()


def test_what_is_known_is_typed_by_name_position_or_limit(session: Session) -> None:
    there = state.with_evidence(session, "K_1=3.1e4 h4=31 ± 2 h5@1=30±1 gears.j_n=8 ± 2 limit=45")
    measured, here = there.drive.measured, f"h4@{session.trial_torque:g}"
    assert measured.K_1 == 3.1e4 and measured.F_ior[here].value == 31 and measured.F_ior["h5@1"].value == 30
    assert there.drive.gears.j_n == 8 and there.drive.uncertainty == {"gears.j_n": 2.0} and there.drive.limit(4) == 45
    assert state.with_evidence(there, f"{here}=").drive.measured.F_ior.keys() == {"h5@1"}
    with pytest.raises(UsageError, match="h0 to h11"):
        state.with_evidence(session, "h12=3 ± 1")
    with pytest.raises(DataError, match=r"nosuch\.csv"):
        state.with_evidence(session, "nosuch.csv")


@pytest.mark.usefixtures("short_chains")
def test_recording_path_is_read_as_F_ior_of_the_position(session: Session, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    error = kinematic_error(session.drive, 4.0, run=UNCHECKED)
    rows = zip(np.degrees(error.states.phi_h), error.error_arcsec, strict=True)
    path.write_text("angle_deg,error_arcsec\n" + "".join(f"{at:.4f},{value:.4f}\n" for at, value in rows))
    there = state.with_evidence(state.turned_state(session, 2), str(path))
    sweep = with_full_cycle(measure(read_trace(str(path), TraceForm(), 10.0), drive=session.drive)).directions[0]
    found = there.drive.measured.F_ior[f"h2@{session.trial_torque:g}"]
    assert found.value == pytest.approx(sweep.F_ior_arcsec, rel=1e-3)
    assert found.uncertainty == pytest.approx(2 * sweep.uncertainty_arcsec, rel=0.1)
    part = tmp_path / "part.csv"
    part.write_text("\n".join(path.read_text().splitlines()[:60]))
    with pytest.raises(HdassistError):
        state.with_evidence(session, str(part))


def test_x_b_follows_W_0_on_request(session: Session) -> None:
    gears, W_0 = session.drive.gears, session.drive.cam.W_0
    alone = state.edited(session, "cam.W_0", f"{W_0 + 0.01}").drive
    assert alone.gears.x_b == gears.x_b
    both = state.edited(replace(session, keeps_clearance=True), "cam.W_0", f"{W_0 + 0.01}").drive
    assert both.gears.m * (both.gears.x_b - gears.x_b) == pytest.approx(both.cam.W_0 - W_0, abs=1e-5)
