"""The session of a preset in a file of the user's, so that work does not end with the screen."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, Field, ValidationError

from hdassist.errors import DataError, HdassistError
from hdassist.explorer.state import Session, Step, at_step, rig_of
from hdassist.preset.kinds import CLOSED
from hdassist.preset.library import preset_names
from hdassist.terminal.files import put_text
from hdassist.terminal.options import TrialOptions
from hdassist.textfile import is_there, os_reason, read_bytes

SESSION_SCHEMA = "hdassist.session/1"
MOST_SESSION_BYTES = 1_000_000  # of a session's file


def state_folder() -> Path:
    """Folder of sessions among the user's states, by the XDG base directory specification; relative without a home."""
    given = os.environ.get("XDG_STATE_HOME", "")
    base = given if os.path.isabs(given) else os.path.expanduser("~/.local/state")  # noqa: PTH111, PTH117
    return Path(base) / "hdassist" / "explore"


class KeptSession(BaseModel):
    """A session as its file has it: changes of a preset (path, value), trials, and how these were measured."""

    model_config = CLOSED

    stated_schema: Literal["hdassist.session/1"] = Field(alias="schema")
    preset: str
    sha256: str
    changes: tuple[tuple[str, str], ...]
    trials: tuple[str, ...]
    rig: TrialOptions


class SessionFile:
    """The file in which the session of a preset is kept: one a preset, by its path.

    Arguments: name of the preset as it was asked for; folder of the files, that of the user without.
    """

    def __init__(self, name: str, folder: Path | None = None) -> None:
        named = name if name in preset_names() else os.path.realpath(name)
        self._preset = named.encode("ascii", "backslashreplace").decode()
        self.path = (folder or state_folder()) / f"{sha256(self._preset.encode()).hexdigest()[:32]}.json"
        self._before = b""

    def read(self, opened: Session) -> tuple[Session, bool] | None:
        """The session that was kept, put on one just opened, and whether the preset's text is the same as then.

        None where there is none, or it holds no more than the one just opened. Raises DataError: it cannot be used.
        """
        if not is_there(self.path):
            return None
        self._before = read_bytes(self.path, MOST_SESSION_BYTES)[0]
        try:
            kept = KeptSession.model_validate_json(self._before)
            trials = tuple(text.replace(":", "=") for text in kept.trials)  # as older files have them
            there = at_step(replace(opened, rig=kept.rig), Step(kept.changes, trials))
            rig_of(there)
            if kept.preset != self._preset or not 0 < kept.rig.sure < 1:
                raise DataError(f"{kept.preset}, sure {kept.rig.sure:g}, is none of {self._preset}")
        except ValidationError as error:
            first = error.errors()[0]
            raise self._refusal(f"{'.'.join(map(str, first['loc']))} {first['msg']}") from None
        except HdassistError as error:
            raise self._refusal(error.message) from None
        if there.trials == opened.trials and _values(there) == _values(opened):
            return None
        return there, kept.sha256 == _digest(opened)

    def write(self, session: Session) -> None:
        """Keep a session in place of the one that was kept. Raises DataError: the file cannot be written."""
        head = {"schema": SESSION_SCHEMA, "preset": self._preset, "sha256": _digest(session)}
        changes = [text.partition("=")[::2] for text in session.overrides]
        self._put(json.dumps({**head, "changes": changes, "trials": session.trials, "rig": asdict(session.rig)}))

    def put_back(self) -> None:
        """Have the file as it was before. Raises DataError: it cannot be written."""
        if self._before:
            self._put(self._before.decode("utf-8", "replace"))
        else:
            self.path.unlink(missing_ok=True)

    def _put(self, text: str) -> None:
        if not self.path.is_absolute():
            raise DataError("cannot keep the session: there is no home folder", "XDG_STATE_HOME=FOLDER names another")
        try:
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError as error:
            raise DataError(f"cannot keep the session: {self.path.parent}: {os_reason(error)}") from None
        put_text(str(self.path), text)

    def _refusal(self, words: str) -> DataError:
        return DataError(f"the kept session cannot be used: {words}", f"{self.path}; the next change replaces it")


def _values(session: Session) -> dict[str, Any]:
    return session.drive.model_dump(exclude={"source"})


def _digest(session: Session) -> str:
    return sha256(session.source.text).hexdigest()
