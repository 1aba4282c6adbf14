from __future__ import annotations

import pytest

from hdassist.errors import UsageError
from hdassist.explorer import state
from hdassist.explorer.state import Session
from hdassist.loading.load import load_text
from tests.explorer.rig import tiny
from tests.process import TINY


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
    with pytest.raises(UsageError, match=r"gears\.j_n: out of range: 0 to 200 um"):
        state.edited(session, "gears.j_n", "-3")
    with pytest.raises(UsageError, match="one line"):
        state.edited(session, "gears.j_n", "3\n4")


def test_an_empty_value_takes_the_change_back(session: Session) -> None:
    assert state.edited(state.edited(session, "gears.j_n", "8"), "gears.j_n", " ").changes == ()


def test_undo_and_redo_go_over_edits_but_not_turns(session: Session) -> None:
    first = state.edited(session, "gears.j_n", "8")
    last = state.edited(state.turned_state(first, 2), "gears.j_n", "9")
    back = state.undone(last)
    assert (back.changes, back.turn_deg) == (first.changes, 60)
    assert state.undone(back).changes == state.undone(state.undone(back)).changes == ()
    assert state.redone(state.redone(state.undone(back))).changes == last.changes
    assert state.edited(back, "gears.j_n", "7").future == ()  # what was undone is forgotten


def test_turning_goes_round_and_free_angles_go_by_steps() -> None:
    assert state.turned_state(tiny(), -1).turn_deg == 300
    free = tiny("mounting.holes=0")
    assert state.turned_state(free, 1).turn_deg == 5


def test_of_two_values_of_a_field_the_last_one_counts() -> None:
    there = state.edited(tiny("gears.j_n=7"), "gears.j_n", "8")
    assert there.drive.gears.j_n == 8 and there.command().count("gears.j_n") == 1
