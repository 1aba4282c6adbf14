"""Deviations of the parts as seen in the cam frame: up to 24 scalars, or one value per tooth.

Angles count counter-clockwise, seen from the cam side; deviations of teeth act along +theta at the contact.
Teeth: dev_g - dev_b = a sin(theta_x1) + b cos(theta_x1), and the same of order 2, 3, 4, 6 and on to 16. Cam centre:
(e_x, e_y) along x1, y1. The tooth ring of the rigid wheel off its centre, less that of the flexspline: (s_x, s_y),
which moves teeth along the radius as well. In the order a, b, e_x, e_y, s_x, s_y, a_2, b_2, a_3, b_3 and so on.

In pitch-locked states the teeth stand at fixed places before the cam, so a measured wheel can only stand there by whole
teeth. A mark between two of these places means that the states come at cam angles between those that are counted. The
pattern is turned by the nearest whole number of teeth, and the rest, up to half a pitch, turns the cam offset that
stands with the wheel by as much the other way: how the two stand to each other is exact, and no tooth's deviation is
smoothed by interpolation.

Deviations that are not given, and assumed values, may lie elsewhere: the unknown of a drive, with bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from hdassist.errors import UsageError
from hdassist.model.contacts import TOOTH_ORDERS, ContactSystem, StateGaps
from hdassist.model.geometry import Array, States
from hdassist.preset.fields import (
    CAM_OFFSETS,
    COMPOSITES,
    DEVIATIONS,
    IN_TEETH,
    Deviation,
    Drive,
    Part,
    has_own_source,
    is_overridden,
    measures,
)
from hdassist.preset.knowledge import (
    CENTRE_OFFSET,
    COARSEST_CLASS,
    HIGHER_ORDERS,
    LAWS,
    SECOND_ORDER,
    STANDING_OFFSET,
    TURNING_OFFSET,
    F_p,
    f_p,
)

_MARK_TO_PHASE = {"xi": 0.0, "runout": 180.0, "pitch": -90.0}  # deg: a mark is not a phase

Waves = dict[tuple[int, str, int], Array]


def tooth_phases(drive: Drive) -> tuple[float, float]:
    """Phases xi_g, xi_b [rad] of the teeth's first harmonics, converted from marks where the preset gives marks.

    Of a run-out, the phase of its tangential part.
    """
    turn = _MARK_TO_PHASE[drive.mounting.mark_kind]
    return float(np.radians(drive.number("phases.xi_g") + turn)), float(np.radians(drive.number("phases.xi_b") + turn))


# first columns; those of the orders follow
TEETH = 0
CAM_COLUMNS = 2
SHIFT = 4
SMOOTH_SCALARS = 12  # of teeth that deviate up to their fourth order
ODD_COLUMNS = {0, 1, 2, 3, 4, 5, 8, 9}  # columns of deviations of odd order: they change sign over half a turn
_COLUMN = {order: 6 + 2 * place for place, order in enumerate(TOOTH_ORDERS)}


def column_of(deviation: Deviation, mark_kind: str) -> int:
    """First of the two columns of scalars that a deviation counts in; mark_kind: the meaning of xi_g and xi_b."""
    if deviation.order > 1:
        return _COLUMN[deviation.order]
    if deviation.kind == "cam":
        return CAM_COLUMNS
    return TEETH if deviation.kind == "composite" and mark_kind != "runout" else SHIFT


def factor_of(deviation: Deviation, drive: Drive) -> float:
    """Share of the size of a deviation in its scalars, with the sign in which they count it."""
    if deviation.kind in ("cam", "centre"):
        return 1.0
    sign = -1.0 if deviation.part == "b" else 1.0
    if deviation.kind == "pitch":
        return sign * _amplitude_of_pitch(drive.gears.z_b if deviation.part == "b" else drive.gears.z_g)
    half = -0.5 if drive.mounting.mark_kind == "runout" else 0.5  # of F'_i, peak to peak; a run-out points other way
    return sign * half if deviation.kind == "composite" else sign


def _amplitude_of_pitch(z: int) -> float:
    """Amplitude of each order of the places of z teeth over their greatest single pitch deviation.

    Each tooth stands off its place by itself, by s: a pitch between two of them by sqrt(2) s, the greatest of z by a
    quantile of the normal law more, and each order of the places has a root mean square of 2 s/sqrt(z).
    """
    greatest = ndtri((1 + 0.5 ** (1 / z)) / 2)
    return float(2 / np.sqrt(2 * z) / greatest)


def standing_offset(drive: Drive) -> tuple[str, str]:
    """Fields of size and direction of the cam offset that stands with the fixed wheel."""
    offset = CAM_OFFSETS[_fixed_part(drive)]
    return offset.size, offset.direction


def _fixed_part(drive: Drive) -> Part:
    """The wheel that is fixed: the rigid one b, or the flexspline g."""
    return "b" if drive.mounting.fixed == "rigid" else "g"


def carried(drive: Drive) -> tuple[str, ...]:
    """Directions that turn with the fixed wheel where it is turned on its seat."""
    return tuple(d.direction for d in DEVIATIONS if d.part == _fixed_part(drive) and not d.stays_with_seat)


def is_half_turn_symmetric(drive: Drive) -> bool:
    """Whether the rotation stays the same where all deviations of odd order change their sign.

    Half a turn maps teeth, balls and bore nodes onto each other only where the number of each is even.
    """
    return all(count % 2 == 0 for count in (drive.gears.z_g, drive.bearing.N, drive.numerics.n_2))


def deviation_scalars(drive: Drive, alpha_g: Array, alpha_b: Array) -> Array:
    """Scalars [mm], shape (states, scalars), of the preset's deviations, as many as it needs.

    Arguments: alpha_g = phi_g - phi_h and alpha_b = phi_b - phi_h [rad], how each wheel stands in the
    cam frame, shape (states,).
    """
    return scalars_of(waves_of(drive.number, drive), alpha_g, alpha_b)


def waves_of(value: Callable[[str], Array | float], drive: Drive) -> Waves:
    """Amplitudes [mm] of deviations where the wheels have not turned, by column, part and order, as complex numbers.

    Arguments: value, sizes [um] and directions [deg] by the path of their field; drive, for all
    that is no deviation.
    """
    waves = Waves()
    mark_kind = drive.mounting.mark_kind
    mark = 0.0 if mark_kind == "runout" else _MARK_TO_PHASE[mark_kind]
    for each in DEVIATIONS:
        column = column_of(each, mark_kind)
        size = np.asarray(value(each.size)) * factor_of(each, drive) * 1e-3
        if size.any() or column in (TEETH, CAM_COLUMNS):
            direction = value(each.direction) + (mark if each.kind == "composite" else 0.0)
            key = column, each.part, each.order
            waves[key] = waves.get(key, 0) + size * np.exp(1j * each.order * np.radians(direction))
    return waves


def scalars_of(waves: Waves, alpha_g: Array, alpha_b: Array) -> Array:
    """Scalars [mm], shape (..., scalars), of many drives at once: the first 4, 6 or 12, or all of them.

    Arguments: waves as those of waves_of; alpha_g, alpha_b [rad], how each wheel stands in the cam frame; all shapes
    broadcast.
    """
    once = {"g": np.exp(1j * np.asarray(alpha_g)), "b": np.exp(1j * np.asarray(alpha_b)), "h": np.ones(())}
    sums: dict[int, Array] = {}
    for (column, part, order), wave in waves.items():
        sums[column] = sums.get(column, 0) + wave * once[part] ** order
    last = max(sums)
    columns = range(0, next(count for count in (4, 6, SMOOTH_SCALARS, 6 + 2 * len(TOOTH_ORDERS)) if count > last), 2)
    pairs = np.zeros((*np.broadcast_shapes(*(each.shape for each in sums.values())), 2 * len(columns)))
    for column, wave in sums.items():
        # a deviation sin(order (theta - direction)) counts by its sine and cosine, an offset by x and y
        pairs[..., column] = wave.real
        pairs[..., column + 1] = wave.imag if column in (CAM_COLUMNS, SHIFT) else -wave.imag
    return pairs


@dataclass(frozen=True)
class ToothDeviations:
    """Measured deviations of the teeth along +theta [um], in place of the preset's harmonics.

    g: one value per flexspline tooth, shape (z_g,); b: per space of the rigid wheel, shape (z_b,); None keeps
    the harmonics of that wheel. Tooth and space 0 stand on the major axis when phi_h = phi_g = 0, and
    numbers grow along +theta.
    """

    g: Array | None = None
    b: Array | None = None


def state_gaps(drive: Drive, system: ContactSystem, states: States, teeth: ToothDeviations | None = None) -> StateGaps:
    """Gaps of states by the deviations of a drive.

    Arguments: drive, its deviations; system; states; teeth, measured deviations. Raises UsageError where
    their number is not that of the wheel's teeth.
    """
    if teeth is None or (teeth.g is None and teeth.b is None):
        return StateGaps(deviation_scalars(drive, states.alpha_g, states.alpha_b))
    measured = {"g": teeth.g, "b": teeth.b}
    rest = drive.with_values(
        {size: 0.0 for wheel, values in measured.items() if values is not None for size in IN_TEETH[wheel]}
    )
    flanks = system.flanks
    deviation = np.zeros((len(states), system.n_flanks))
    if teeth.g is not None:
        deviation += _at_teeth(teeth.g, flanks.tooth, states.alpha_g, drive.gears.z_g)
    if teeth.b is not None:
        # zone 1 lies half a turn on, where tooth i faces space i + 1: z_b = z_g + 2
        deviation -= _at_teeth(teeth.b, flanks.tooth + flanks.zone, states.alpha_b, drive.gears.z_b)
    scalars = deviation_scalars(rest, states.alpha_g, states.alpha_b)
    return StateGaps(scalars, -flanks.side * np.cos(flanks.alpha) * deviation)


def _at_teeth(deviation: Array, tooth: NDArray[np.int64], turned: Array, z: int) -> Array:
    if np.shape(deviation) != (z,):
        raise UsageError(f"a wheel of {z} teeth needs {z} deviations, not {np.size(deviation)}")
    # the nearest tooth; half a pitch goes one way in every state, whatever the last digits say
    shift = np.floor(-turned * z / (2 * np.pi) + 0.5 + 1e-6).astype(np.int64)
    return np.asarray(np.asarray(deviation)[(tooth + shift[:, None]) % z] * 1e-3)


#


_MAJOR = 90.0  # deg from x: the major axis of the cam at phi_h = 0, where tooth 0 stands


@dataclass(frozen=True, eq=False)
class PitchFile:
    """Pitch deviations of a wheel, tooth by tooth from its mark on, and where they come from.

    deviation: cumulative deviations [um] without their mean, shape (teeth,), positive along +theta
    (counter-clockwise, seen from the cam side); element 0 is the tooth with the mark, and teeth follow
    counter-clockwise. mark: the number of that tooth where it was measured. flank, file, sha256: the measured flank,
    and its file. notes: conversions and assumptions.
    """

    deviation: NDArray[np.float64]
    mark: int = 1
    flank: Literal["left", "right"] | None = None
    file: str = ""
    sha256: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class MeasuredWheel:
    """Measured pitch deviations of a wheel, and the direction [deg] in which its mark stands.

    mark_deg: counter-clockwise from x, seen from the cam side, at phi_h = phi_g = 0, like phases.xi_b.
    """

    pitch: PitchFile
    mark_deg: float


@dataclass(frozen=True)
class MeasuredTeeth:
    """Measured wheels in place of the preset's first harmonics: flexspline g, rigid wheel b, None keeps a harmonic."""

    g: MeasuredWheel | None = None
    b: MeasuredWheel | None = None

    @property
    def by_name(self) -> dict[str, MeasuredWheel]:
        """The wheels that are measured, by their names."""
        return {name: wheel for name, wheel in (("b", self.b), ("g", self.g)) if wheel}

    def fixed(self, drive: Drive) -> MeasuredWheel | None:
        """The wheel that is fixed in a drive, where it is measured."""
        return self.b if drive.mounting.fixed == "rigid" else self.g

    def rotated(self, drive: Drive, rotation_deg: float) -> MeasuredTeeth:
        """The same with the fixed wheel turned on its seat [deg], counter-clockwise seen from the cam side."""
        wheel = self.fixed(drive)
        turned = wheel and replace(wheel, mark_deg=wheel.mark_deg + rotation_deg)
        return replace(self, **{_fixed_part(drive): turned})

    def without_harmonics(self, drive: Drive) -> Drive:
        """The drive with its measured wheels as if they had no deviation: what else it has, and leaves open."""
        return drive.with_values({path: 0.0 for name in self.by_name for path in IN_TEETH[name]})

    def in_drive(self, drive: Drive) -> tuple[Drive, ToothDeviations]:
        """What kinematic_error takes: the drive with its cam offsets turned by the rests, and a deviation per tooth.

        Raises UsageError where a wheel has another number of teeth than the drive's.
        """
        turned: dict[str, float] = {}
        found = {}
        for name, wheel, z in (("g", self.g, drive.gears.z_g), ("b", self.b, drive.gears.z_b)):
            if wheel is None:
                continue
            if len(wheel.pitch.deviation) != z:
                raise UsageError(f"a wheel of {z} teeth needs {z} deviations, not {len(wheel.pitch.deviation)}")
            teeth = (wheel.mark_deg - _MAJOR) / 360 * z
            found[name] = np.roll(wheel.pitch.deviation, round(teeth))
            angle = f"phases.phi_h{name}"
            turned[angle] = drive.number(angle) - (teeth - round(teeth)) * 360 / z
        return drive.with_values(turned), ToothDeviations(**found)


# --- what may lie elsewhere than a preset has it: assumed values, and deviations not given
#
# Assumed stiffnesses, clearances and shapes have the bounds of their reason. A size that is not given may be anything
# up to the bound of its part; a direction that is not given, any direction.


def assumptions(drive: Drive) -> tuple[Unknown, ...]:
    """Fields of a drive that are assumed, or left to a default, and have a plausible range.

    A field that the preset's `source` calls assumed has the range that stands there.
    """
    found = []
    for path in measures():
        source = drive.source.get(path)
        value = drive.value(path)
        section, name = path.split(".")
        is_wanted = is_overridden(path, drive.origin.overrides) and not has_own_source(path, drive.origin.overrides)
        if value is None or path == drive.unused_tooth_field or is_wanted:
            continue  # not known, without effect, or wanted so
        if source is not None and source.kind == "assumed" and source.range:
            found.append(Unknown(path, *source.range, source.ref))
        elif source is None and name not in getattr(drive, section).model_fields_set and path in LAWS:
            law = LAWS[path]
            g = drive.gears
            if law.assumed and (bounds := law.range_at(g.pitch_diameter, g.m, value)):
                found.append(Unknown(path, *bounds, law.why))
    return tuple(a for a in found if a.low < a.high and drive.allows(a.path, a.low) and drive.allows(a.path, a.high))


#


@dataclass(frozen=True)
class Unknown:
    """A field that is assumed or not given, by path: the bounds of its true value, in the field's unit, and why."""

    path: str
    low: float
    high: float
    reason: str


def unknowns(drive: Drive) -> tuple[Unknown, ...]:
    """Deviations of a drive that are not known, and matter: a direction without a size does not."""
    found = dict[str, Unknown]()  # by path: all orders of a wheel's pitch share their size
    for each in DEVIATIONS:
        high, reason = _largest(drive, each)
        if high and drive.value(each.size) is None:
            found[each.size] = Unknown(path=each.size, low=0.0, high=high, reason=reason)
        if high and drive.value(each.direction) is None:
            found[each.direction] = Unknown(
                path=each.direction, low=0.0, high=360.0 / each.order, reason="any direction"
            )
    return tuple(found.values())


def unknown_turn(drive: Drive) -> tuple[str, ...]:
    """Directions that decide how the fixed wheel's deviations lie to those that stand still with its seat, if unknown.

    Where all of the one side are, or all of the other, any hole is as good as any other; else none is returned.
    """
    sides = [[each.direction for each in side] for side in reversed(_sides(drive))]
    open_ = [path for side in sides if all(drive.value(path) is None for path in side) for path in side]
    return tuple(open_)


def no_hole_better(drive: Drive) -> Literal["", "floating", "standing", "turning"]:
    """Why the fixed wheel of a drive is as good in any hole: its cam floats, or no deviation stands to turn against.

    floating: offsets of the cam are not felt; standing: no part that stands still with the seat deviates; turning: the
    fixed wheel has no deviation. Empty where one hole may be better than another.
    """
    standing, turning = _sides(drive)
    if standing and turning:
        return ""
    if not turning:
        return "turning"
    return "standing" if drive.value(standing_offset(drive)[0]) == 0 else "floating"


def _sides(drive: Drive) -> tuple[list[Deviation], list[Deviation]]:
    """Deviations, known or not, of parts that stand still with the seat of the fixed wheel, and of that wheel.

    Offsets of a cam that floats (C_3 = 0) are not felt, and not among them.
    """
    floats = not drive.number("supports.C_3")
    sides: tuple[list[Deviation], list[Deviation]] = ([], [])
    for each in DEVIATIONS:
        if each.part == _fixed_part(drive) and _largest(drive, each)[0] and not (floats and each.kind == "cam"):
            sides[not each.stays_with_seat].append(each)
    return sides


def unknown_notes(drive: Drive) -> tuple[str, ...]:
    """A warning where a deviation is not known and counts as 0; none where all are known."""
    open_ = unknowns(drive)
    return (f"unknown, and computed as 0: {unknown_names(open_)}",) if open_ else ()


def unknown_names(fields: Sequence[Unknown], most: int = 4) -> str:
    """Return the paths of fields; of more than `most` their number, and the first of them."""
    paths = ", ".join(field.path for field in fields[:most])
    if len(fields) <= most:
        return paths
    return f"{len(fields)} inputs, including {paths}"


def _largest(drive: Drive, deviation: Deviation) -> tuple[float, str]:
    """Greatest size [um] that a deviation has, or is taken to have, and why."""
    if (given := drive.value(deviation.size)) is not None:
        return given, "given"
    if deviation.kind == "composite":
        grade = F_p(drive.gears.pitch_diameter, drive.gears.m, COARSEST_CLASS)
        return grade, f"F_p of class {COARSEST_CLASS}, ISO 1328-1:2013"
    if deviation.kind in ("cam", "centre"):
        share = STANDING_OFFSET if deviation.size == standing_offset(drive)[0] else TURNING_OFFSET
        share = CENTRE_OFFSET if deviation.kind == "centre" else share
        return share * drive.gears.pitch_diameter, f"assumed: {share:g} um for each mm of the pitch diameter"
    composite = COMPOSITES[deviation.part]
    share = SECOND_ORDER if deviation.order == 2 else HIGHER_ORDERS
    size, _ = _largest(drive, composite)
    if deviation.kind == "pitch":
        wheel = drive.gears.pitch_diameter, drive.gears.m, COARSEST_CLASS
        return size * f_p(*wheel) / F_p(*wheel), f"f_p of the class of ISO 1328-1:2013 that {composite.name} has as F_p"
    return share * size / 2, f"assumed: {share:.0%} of half of {composite.name}"
