"""Session of the explorer as one immutable value, and the fields of a preset as inputs."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import floor, isfinite, log10

from hdassist.belief.evidence import measured_errors
from hdassist.belief.holes import FREE_STEP_DEG
from hdassist.drive.loading import OVERRIDE_PLACE, load_text
from hdassist.drive.model.deviations import carried
from hdassist.drive.preset.fields import Drive, PresetField, ResolvedField, field_table, text_of
from hdassist.features.measuring.full_cycle import with_full_cycle
from hdassist.features.measuring.measure import measure
from hdassist.features.measuring.orders import gearing_of
from hdassist.features.mounting.positions import named_position
from hdassist.interface.terminal.options import TrialOptions
from hdassist.interface.terminal.words import again
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.run.errors import UsageError
from hdassist.run.files import number_of, read_preset

TRIALS = TrialOptions()  # defaults of the command's options

_Changes = tuple[tuple[str, str], ...]  # path of a field, and its value in the format of --set


@dataclass(frozen=True)
class _StateSource:
    """A preset as it was opened.

    name: requested name.
    text: text of the preset.
    file: name of the file in messages.
    overrides: overrides of the preset.
    """

    name: str
    text: bytes
    file: str
    overrides: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, overrides: tuple[str, ...] = ()) -> _StateSource:
        """Read a preset by its name or file. Raises DataError if there is no such preset."""
        return cls(name, *read_preset(name), overrides)

    def drive(self, changes: _Changes = ()) -> Drive:
        """Return the drive with changes, where the last change of a field counts.

        Raises PresetError, or UsageError with the message of the loader.
        """
        texts = (*self.overrides, *(f"{path}={value}" for path, value in changes))
        return load_text(self.text, self.file, list({text.partition("=")[0]: text for text in texts}.values()))


@dataclass(frozen=True)
class Session:
    """A preset with its changes and the selected position of its fixed wheel.

    source: the preset as it was opened.
    drive: the drive with the changes.
    pinned: drive for comparison.
    changes: changed fields with their values.
    turn_deg: rotation from the present position of the wheel [deg].
    keeps_clearance: whether x_b changes with W_0 to keep the clearance.
    past, future: changes for undo and redo.
    """

    source: _StateSource
    drive: Drive
    pinned: Drive
    changes: _Changes = ()
    turn_deg: float = 0.0
    keeps_clearance: bool = False
    past: tuple[_Changes, ...] = ()
    future: tuple[_Changes, ...] = ()

    @property
    def torques(self) -> str:
        """Torques in the format of --set."""
        return f"operation.M_g={list(self.drive.operation.M_g)}"

    @property
    def trial_torque(self) -> float:
        """Torque of the measured values in holes [N*m]."""
        return TRIALS.torque_of(self.drive.operation.M_g)

    @property
    def here(self) -> str:
        """Name of the selected position: h4, or an angle [deg]."""
        return named_position(self.turn_deg, self.drive.mounting.holes)

    @property
    def positions(self) -> tuple[float, ...]:
        """Rotations that can be selected for the wheel [deg]."""
        holes = self.drive.mounting.holes or round(360 / FREE_STEP_DEG)
        return tuple(360 * k / holes for k in range(holes))

    def command(self, name: str = "") -> str:
        """Return the command line that gives the same result, for a command by name or for `mount`."""
        pinned = self.pinned.origin.file
        pin_options = ("--pin", pinned) if name == "explore" and pinned != self.drive.origin.file else ()
        return again(name or "mount", self.drive, *pin_options)

    def trace_command(self, M_g: float, typical: Mapping[str, float]) -> str:
        """Return the command line for the error of a typical drive, with the wheel in the selected position.

        M_g: torque [N*m].
        typical: values of the typical drive, by path.
        """
        drive = self.drive.with_values(typical)
        moved = [path for path in carried(drive) if self.turn_deg and drive.value(path) is not None]
        turned = {path: drive.number(path) + self.turn_deg for path in moved}
        values = [(path, f"{value:.6g}") for path, value in {**typical, **turned}.items()]
        return again("trace", self.source.drive((*self.changes, *values, ("operation.M_g", f"[{M_g}]"))))


def opened_state(
    name: str,
    overrides: tuple[str, ...] = (),
    pin: str = "",
) -> Session:
    """Return a session of a preset, compared with its opened state or with another preset.

    Raises the errors of loading a preset.
    """
    source = _StateSource.of(name, overrides)
    session = Session(source, source.drive(), source.drive())
    return replace(session, pinned=_StateSource.of(pin, (session.torques,)).drive()) if pin else session


def is_tried(drive: Drive) -> bool:
    """Return whether F'_ior was measured in several positions of the fixed wheel."""
    return len({value.rotation_deg for value in measured_errors(drive)}) > 1


def edited(
    session: Session,
    path: str,
    value: str,
) -> Session:
    """Return the session with a changed field; an empty value reverts the change.

    Both numbers of teeth change together and keep their difference; the value may also be the ratio (100:1). Raises
    UsageError with the message of the loader if the value is invalid.
    """
    drive = session.drive
    value = value.strip()
    if path in TEETH_FIELDS and value.endswith(":1"):
        path = TEETH_FIELDS[drive.mounting.fixed != "rigid"]  # the number of teeth of the wheel that rotates
        value = f"{number_of(value[:-2]) * (drive.gears.z_b - drive.gears.z_g):g}"
    values = {path: value}
    if path in TEETH_FIELDS:
        other_field = TEETH_FIELDS[path == TEETH_FIELDS[0]]
        follows = drive.value(other_field) - drive.value(path)
        values[other_field] = f"{int(value) + follows}" if value.isdecimal() else ""
    changed = _with_fields(session, values)
    if path == "cam.W_0" and session.keeps_clearance:
        x_b = drive.gears.x_b + (changed.drive.cam.W_0 - drive.cam.W_0) / drive.gears.m
        changed = _with_fields(session, {**values, "gears.x_b": f"{x_b:.6g}"})
    return changed


def _with_fields(session: Session, values: Mapping[str, str]) -> Session:
    """Return the session with changed fields, by path; empty values revert changes."""
    changes = {path: text for path, text in {**dict(session.changes), **values}.items() if text}
    step = tuple(changes.items())
    if step == session.changes:
        return session
    return replace(
        _at_step(session, step),
        past=(*session.past, session.changes),
        future=(),
    )


def with_evidence(session: Session, text: str) -> Session:
    """Return the session with further data of its drive: values by name, separated by blanks or ;, or a recording.

    A name is a field, a quantity in `measured` (K_1), a position with measured F'_ior (h4, h4@80), or `limit`. A
    recording belongs to the selected position and the torque of measured values. Values may have an expanded
    uncertainty with k = 2 (31 ± 2), which has a default for F'_ior. An empty value removes the entry.

    Raises UsageError with the message of the loader, and the errors of measuring a recording.
    """
    values = {}
    for word in re.split(r"[;\s]+(?=[^\s=]+=)", text.strip()):
        name, equals, value = word.partition("=")
        if not equals:
            name = session.here
            value = _measured_value(session, word)
        value = value.strip()
        torque = "" if "@" in name else f"@{session.trial_torque:g}"
        if name == "limit":
            path = "acceptance.F_ior"
        elif name.partition(".")[0] in {path.partition(".")[0] for path in field_table()}:
            path = name
        elif re.match(r"h?[-\d]", name):
            path = f"measured.F_ior.{name}{torque}"
            is_bare = number_of(value) == number_of(value)
            value += f" ± {2 * TRIALS.noise:g}" if is_bare else ""
        else:
            path = f"measured.{name}"
        values[path] = value
    return _with_fields(session, values)


def _measured_value(session: Session, path: str) -> str:
    """Return F'_ior of a recording with its expanded uncertainty [arcsec], as text."""
    gearing = gearing_of(session.drive, None)
    trace = read_trace(path, TraceForm(), gearing.ratio if gearing else None)
    sweep = with_full_cycle(measure(trace, drive=session.drive)).directions[0]
    if sweep.is_bound:
        raise UsageError(
            f"{path} covers only part of the full mesh cycle, so its F'_ior is a lower bound",
            f"evaluate the recording with hdassist measure {path}",
        )
    return f"{sweep.F_ior_arcsec:.4g} ± {2 * sweep.uncertainty_arcsec:.2g}"


def turned_state(session: Session, by: int) -> Session:
    """Return the session with the selected position moved by a number of positions, counter-clockwise."""
    positions = session.positions
    place = round(session.turn_deg * len(positions) / 360) + by
    return replace(session, turn_deg=positions[place % len(positions)])


def pinned(session: Session) -> Session:
    """Return the session compared with its present drive, or with the preset if this is pinned already."""
    is_pinned = session.pinned.origin == session.drive.origin
    return replace(session, pinned=session.source.drive() if is_pinned else session.drive)


def undone(session: Session) -> Session:
    """Return the session before its last change, which must exist."""
    back = _at_step(session, session.past[-1])
    return replace(
        back,
        past=session.past[:-1],
        future=(session.changes, *session.future),
    )


def redone(session: Session) -> Session:
    """Return the session with the last undone change, which must exist."""
    on = _at_step(session, session.future[0])
    return replace(
        on,
        past=(*session.past, session.changes),
        future=session.future[1:],
    )


def _at_step(session: Session, changes: _Changes) -> Session:
    """Return the session with other changes of its preset. Raises UsageError with the message of the loader."""
    try:
        return replace(
            session,
            drive=session.source.drive(changes),
            changes=changes,
        )
    except UsageError as error:
        raise UsageError(OVERRIDE_PLACE.sub("", error.message), error.hint) from None


SETTING_SECTIONS = (
    "mounting",
    "operation",
    "catalogue",
    "measured",
    "acceptance",
    "numerics",
)  # sections that do not describe the drive
TEETH_FIELDS = ("gears.z_g", "gears.z_b")  # numbers of teeth, which change together
_LEVER_STEPS = {"um": 1.0, "deg": 5.0, "N*m": 10.0}  # steps in units with a natural step


def about_field(field: ResolvedField) -> str:
    """Return the path, meaning and range of a field."""
    reach = field_table()[field.path].range_words(field.unit)
    return f"{field.path}: {field.meaning}{f'; {reach}' if reach else ''}"


def key_step(field: PresetField, value: float) -> float:
    """Return the step size of a field at a value.

    It is 1 for a count, otherwise the usual step of the unit, or the power of ten between 1 and 10 % of the value. The
    step of the unit is used only if it is at most a tenth of the field's range: 5 deg for a phase, but not for a
    pressure angle.
    """
    natural = _LEVER_STEPS.get(field.unit, 0.0)
    high = field.le
    low = field.ge if isfinite(field.ge) else 0.0
    if field.kind == "count":
        return 1.0
    if 0 < 10 * natural <= high - low:
        return natural
    reach = abs(value) or (high if isfinite(high) else 1.0) / 100
    return 10.0 ** floor(log10(reach) - 1)


def stepped(
    drive: Drive,
    path: str,
    steps: int,
) -> str | None:
    """Return the value of a field after a number of steps, as text; None if it has no steps."""
    field = field_table()[path]
    value = drive.value(path)
    if field.kind not in ("number", "count") or value is None:
        return None
    return text_of(float(f"{value + steps * key_step(field, value):.10g}"))
