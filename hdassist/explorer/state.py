"""What the explorer shows, as one value that never changes: each action makes another one of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hdassist.errors import UsageError
from hdassist.loading.load import load_text
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.library import read_preset
from hdassist.terminal.brief import again

MOST_PAST = 200  # steps that can be undone
TEETH_FIELDS = ("gears.z_g", "gears.z_b")  # change together

Changes = tuple[tuple[str, str], ...]  # paths of fields, and their values as --set takes them


@dataclass(frozen=True)
class StateSource:
    """A preset as it was opened: the name that was asked for, its text, its name in messages, overrides on top."""

    name: str
    text: bytes
    file: str
    overrides: tuple[str, ...] = ()

    def drive(self, changes: Changes = ()) -> Drive:
        """The drive with changes, of one field the last one.

        Raises PresetError, or UsageError with the loader's words about them.
        """
        if any("\n" in value for _, value in changes):
            raise UsageError("a value is one line")
        texts = (*self.overrides, *(f"{path}={value}" for path, value in changes))
        return load_text(self.text, self.file, list({text.partition("=")[0]: text for text in texts}.values()))


@dataclass(frozen=True)
class Session:
    """A preset, what was changed of it, and where its fixed wheel is looked at.

    turn_deg: from where it stands; past and future: changes, for undo and redo.
    """

    source: StateSource
    drive: Drive
    changes: Changes = ()
    turn_deg: float = 0.0
    past: tuple[Changes, ...] = ()
    future: tuple[Changes, ...] = ()

    @property
    def positions(self) -> tuple[float, ...]:
        """Turns [deg] that the wheel can be looked at in."""
        holes = self.drive.mounting.holes or 72
        return tuple(360 * k / holes for k in range(holes))

    def command(self, name: str = "mount") -> str:
        """The command line that gives the same answer, of a command by name."""
        return again(name, self.drive)


def opened_state(name: str, overrides: tuple[str, ...] = ()) -> Session:
    """A session of a preset. Raises what loading it raises."""
    text, file = read_preset(name)
    source = StateSource(name, text, file, overrides)
    return Session(source, source.drive())


def edited(session: Session, path: str, value: str) -> Session:
    """The session with a field changed; an empty value takes the change back.

    Teeth change together: one number of them keeps their difference, 120/122 gives both. Raises UsageError with the
    loader's words where the value is refused.
    """
    if path not in field_table():
        raise UsageError(f"no field {path}")
    value = value.strip()
    values = {path: value}
    if path in TEETH_FIELDS:
        other = TEETH_FIELDS[path == TEETH_FIELDS[0]]
        follows = session.drive.value(other) - session.drive.value(path)
        values[other] = f"{int(value) + follows}" if value.isdecimal() else ""
        if "/" in value:
            values = dict(zip(TEETH_FIELDS, map(str.strip, value.split("/", 1)), strict=True))
    changes = {key: text for key, text in session.changes if key not in values}
    changes |= {key: text for key, text in values.items() if text}
    fresh = tuple(changes.items())
    if fresh == session.changes:
        return session
    past = (*session.past, session.changes)[-MOST_PAST:]
    return replace(_changed(session, fresh), past=past, future=())


def turned_state(session: Session, by: int) -> Session:
    """The session with the wheel looked at so many positions further, counter-clockwise."""
    positions = session.positions
    here = min(range(len(positions)), key=lambda k: abs((positions[k] - session.turn_deg + 180) % 360 - 180))
    return replace(session, turn_deg=positions[(here + by) % len(positions)])


def undone(session: Session) -> Session:
    """The session before its last change."""
    if not session.past:
        return session
    back = _changed(session, session.past[-1])
    return replace(back, past=session.past[:-1], future=(session.changes, *session.future))


def redone(session: Session) -> Session:
    """The session with the change that was undone last."""
    if not session.future:
        return session
    on = _changed(session, session.future[0])
    return replace(on, past=(*session.past, session.changes), future=session.future[1:])


def _changed(session: Session, changes: Changes) -> Session:
    """The session with other changes. Raises what loading raises."""
    return replace(session, drive=session.source.drive(changes), changes=changes)
