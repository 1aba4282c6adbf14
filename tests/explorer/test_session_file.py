from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hdassist.errors import DataError
from hdassist.explorer import session_file, state
from hdassist.explorer.session_file import SessionFile
from hdassist.terminal.options import TrialOptions
from tests.explorer.rig import tiny
from tests.process import TINY


def work() -> state.Session:
    """A session with something of everything."""
    begun = tiny("gears.j_n=7", rig=TrialOptions(trial_torque=1.0, noise=0.5))
    return state.with_trials(state.edited(begun, "cam.W_0", "0.575 mm"), "h0=28.1 h4=17.3")


def test_a_session_is_read_back_onto_the_preset_as_it_is_opened(tmp_path: Path) -> None:
    SessionFile(TINY, tmp_path).write(work())
    found = SessionFile(TINY, tmp_path).read(tiny())
    assert found is not None
    there, same_text = found
    assert same_text and (there.trials, there.rig) == (work().trials, work().rig)
    assert there.drive.model_dump() == work().drive.model_dump()
    assert there.command("explore").split(" --set")[0] == work().command("explore").split(" --set")[0]
    assert sorted(there.overrides) == sorted(work().overrides)
    assert SessionFile(TINY, tmp_path).read(work()) is None  # no more than what is opened
    assert SessionFile("vzp160", tmp_path).read(tiny()) is None  # of another preset


def test_a_preset_that_has_changed_since_is_said(tmp_path: Path) -> None:
    SessionFile(TINY, tmp_path).write(work())
    other = tiny()
    found = SessionFile(TINY, tmp_path).read(
        replace(other, source=replace(other.source, text=b"#\n" + other.source.text))
    )
    assert found is not None and not found[1]


def edited(**values: Any) -> str:
    """The file of a session with some of its values in place of others."""
    rig = {"trial_torque": None, "noise": 1.0, "sure": 0.9}
    kept = {
        "schema": "hdassist.session/1",
        "preset": TINY,
        "sha256": "0",
        "changes": [],
        "trials": ["h0=3"],
        "rig": rig,
    }
    return json.dumps(kept | values | {"rig": rig | values.get("rig", {})})


def test_a_file_as_the_hostile_ones_would_be_without_their_edit_is_read(tmp_path: Path) -> None:
    kept = SessionFile(TINY, tmp_path)
    kept.path.write_text(edited())
    found = kept.read(tiny())
    assert found is not None and found[0].trials == ("h0=3",)


HOSTILE = {
    "empty": "",
    "no object": "[]",
    "deep": "[" * 100_000,
    "large": edited(trials=["h0=3"] * 200_000),
    "another schema": edited(schema="hdassist.session/2"),
    "another preset": edited(preset="vzp160"),
    "key more": edited(notes="x"),
    "key more in the rig": edited(rig={"jobs": 1}),
    "number as text": edited(rig={"noise": "1"}),
    "no number": edited(rig={"noise": float("nan")}),
    "infinite": edited(rig={"noise": float("inf")}),
    "no noise": edited(rig={"noise": 0}),
    "no torque": edited(rig={"trial_torque": 0}),
    "always sure": edited(rig={"sure": -1.0}),
    "no trial": edited(trials=["h0:nan"]),
    "no hole": edited(trials=["h99=3"]),
    "no field": edited(changes=[["gears.nosuch", "1"]]),
    "out of range": edited(changes=[["gears.j_n", "-1"]]),
    "two lines": edited(changes=[["gears.j_n", "1\n2"]]),
    "no pair": edited(changes=[["gears.j_n"]]),
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_what_no_explorer_wrote_is_refused(tmp_path: Path, text: str) -> None:
    kept = SessionFile(TINY, tmp_path)
    kept.path.write_text(text)
    with pytest.raises(DataError, match="the kept session cannot be used"):
        kept.read(tiny())


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    kept = SessionFile(TINY, tmp_path)
    kept.path.write_bytes(b"\xff\xfe\0")
    with pytest.raises(DataError, match="cannot be used"):
        kept.read(tiny())


def test_what_was_kept_before_can_be_put_back(tmp_path: Path) -> None:
    SessionFile(TINY, tmp_path).write(work())
    [file] = tmp_path.iterdir()
    before = file.read_bytes()
    kept = SessionFile(TINY, tmp_path)
    kept.read(tiny())
    kept.write(state.with_trials(tiny(), "h1=3"))
    assert file.read_bytes() != before
    kept.put_back()
    assert file.read_bytes() == before
    other = SessionFile("vzp160", tmp_path)
    other.write(state.opened_state("vzp160"))
    other.put_back()
    assert [each.name for each in tmp_path.iterdir()] == [file.name]


def test_sessions_lie_in_the_users_states_and_nowhere_without_a_home(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    SessionFile(TINY).write(work())
    assert [path.parent for path in tmp_path.rglob("*.json")] == [tmp_path / "hdassist" / "explore"]
    monkeypatch.setenv("XDG_STATE_HOME", "states")  # by the specification only an absolute path counts
    monkeypatch.setenv("HOME", "/home/me")
    assert session_file.state_folder() == Path("/home/me/.local/state/hdassist/explore")
    monkeypatch.setenv("HOME", "me")
    with pytest.raises(DataError, match="no home folder"):
        SessionFile(TINY).write(work())
    assert not (tmp_path / "me").exists()
