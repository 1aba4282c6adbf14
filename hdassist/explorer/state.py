"""What the explorer shows, as one value that never changes: each action makes another one of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hdassist.errors import UsageError
from hdassist.loading.load import load_text
from hdassist.model.deviations import carried
from hdassist.mounting.positions import hole_of
from hdassist.mounting.trial import read_trial
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.library import read_preset
from hdassist.terminal.brief import again
from hdassist.terminal.options import TrialOptions
from hdassist.trials.prior import Rig

MOST_PAST = 200  # steps that can be undone
USUAL = TrialOptions()
TEETH_FIELDS = ("gears.z_g", "gears.z_b")  # change together

Change = tuple[str, str]  # path of a field, and its value as --set takes it


@dataclass(frozen=True)
class StateSource:
    """A preset as it was opened: the name that was asked for, its text, its name in messages, overrides on top."""

    name: str
    text: bytes
    file: str
    overrides: tuple[str, ...] = ()

    def drive(self, changes: tuple[Change, ...] = ()) -> Drive:
        """The drive with changes, of one field the last one.

        Raises PresetError, or UsageError with the loader's words about them.
        """
        if any("\n" in value for _, value in changes):
            raise UsageError("a value is one line")
        texts = (*self.overrides, *(f"{path}={value}" for path, value in changes))
        return load_text(self.text, self.file, list({text.partition("=")[0]: text for text in texts}.values()))


@dataclass(frozen=True)
class Step:
    """What can be undone."""

    changes: tuple[Change, ...] = ()
    trials: tuple[str, ...] = ()


@dataclass(frozen=True)
class Session:
    """A preset, what was changed of it, trials, and where its fixed wheel is looked at.

    turn_deg: from where it stands; pinned: changes of the variant that the others are compared with; past and future:
    for undo and redo.
    """

    source: StateSource
    drive: Drive
    rig: TrialOptions = USUAL
    step: Step = Step()
    turn_deg: float = 0.0
    pinned: tuple[Change, ...] = ()
    past: tuple[Step, ...] = ()
    future: tuple[Step, ...] = ()

    @property
    def changes(self) -> tuple[Change, ...]:
        """Changes of the preset."""
        return self.step.changes

    @property
    def trials(self) -> tuple[str, ...]:
        """Trials as the command takes them: h4=17.3 or 120=17.3."""
        return self.step.trials

    @property
    def trial_torque(self) -> float:
        """Torque of the trials [N*m]."""
        return self.rig.torque_of(self.drive.operation.M_g)

    @property
    def here(self) -> str:
        """The position that is looked at as trials take it: h4, or an angle [deg]."""
        hole = hole_of(self.turn_deg, self.drive.mounting.holes)
        return f"{self.turn_deg:g}" if hole is None else f"h{hole}"

    @property
    def positions(self) -> tuple[float, ...]:
        """Turns [deg] that the wheel can be looked at in."""
        holes = self.drive.mounting.holes or 72
        return tuple(360 * k / holes for k in range(holes))

    def command(self, name: str = "") -> str:
        """The command line that gives the same answer: that of a command by name, without one of mount or trials."""
        name = name or ("trials" if self.trials else "mount")
        return again(name, self.drive, *((*self.trials, *self.rig.words()) if name in ("trials", "explore") else ()))

    def trace_command(self, M_g: float) -> str:
        """The same of the cam turn at a torque [N*m], the fixed wheel as it is looked at."""
        moved = [path for path in carried(self.drive) if self.turn_deg and self.drive.value(path) is not None]
        turned = ((path, f"{self.drive.number(path) + self.turn_deg:g}") for path in moved)
        return again("trace", self.source.drive((*self.changes, *turned, ("operation.M_g", f"[{M_g}]"))))


def opened_state(name: str, overrides: tuple[str, ...] = (), rig: TrialOptions = USUAL) -> Session:
    """A session of a preset. Raises what loading it raises."""
    text, file = read_preset(name)
    source = StateSource(name, text, file, overrides)
    return Session(source, source.drive(), rig)


def rig_of(session: Session) -> Rig:
    """The rig of the trials. Raises UsageError for one that cannot be."""
    return Rig(session.trial_torque, session.rig.noise)


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
    return _stepped(session, replace(session.step, changes=tuple(changes.items())))


def with_trials(session: Session, text: str) -> Session:
    """The session with trials more: "28.1" at the hole that is looked at, or "h4=17.3", several with blanks between.

    Raises UsageError for an invalid trial.
    """
    words = text.split()
    if not words:
        raise UsageError("no trial given", "like 28.1, or h4=17.3")
    trials = [word if "=" in word or ":" in word else f"{session.here}={word}" for word in words]
    return _stepped(session, replace(session.step, trials=(*session.trials, *trials)))


def without_trial(session: Session) -> Session:
    """The session without the last of its trials."""
    return _stepped(session, replace(session.step, trials=session.trials[:-1]))


def turned_state(session: Session, by: int) -> Session:
    """The session with the wheel looked at so many positions further, counter-clockwise."""
    positions = session.positions
    here = min(range(len(positions)), key=lambda k: abs((positions[k] - session.turn_deg + 180) % 360 - 180))
    return replace(session, turn_deg=positions[(here + by) % len(positions)])


def pinned(session: Session) -> Session:
    """The session with the drive as it is now to compare with; pinned again, with the preset."""
    return replace(session, pinned=() if session.pinned == session.changes else session.changes)


def undone(session: Session) -> Session:
    """The session before its last change."""
    if not session.past:
        return session
    back = at_step(session, session.past[-1])
    return replace(back, past=session.past[:-1], future=(session.step, *session.future))


def redone(session: Session) -> Session:
    """The session with the change that was undone last."""
    if not session.future:
        return session
    on = at_step(session, session.future[0])
    return replace(on, past=(*session.past, session.step), future=session.future[1:])


def _stepped(session: Session, step: Step) -> Session:
    """The session at a new step, which forgets what was undone."""
    if step == session.step:
        return session
    return replace(at_step(session, step), past=(*session.past, session.step)[-MOST_PAST:], future=())


def at_step(session: Session, step: Step) -> Session:
    """The session at a step. Raises what loading raises."""
    drive = session.drive if step.changes == session.changes else session.source.drive(step.changes)
    for trial in step.trials:
        read_trial(trial, drive.mounting.holes)  # holes may have become fewer
    return replace(session, drive=drive, step=step)
