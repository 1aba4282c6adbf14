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

# The high spot of a run-out stands opposite to the phase of its tangential part; the largest pitch deviation is where
# the sine of the cumulative one passes 0.
_MARK_TO_PHASE = {"xi": 0.0, "runout": 180.0, "pitch": -90.0}  # deg: a mark is not a phase

# Complex amplitudes [mm] of deviations by column of the scalars, part (g, b, h) and order.
Waves = dict[tuple[int, str, int], Array]


def tooth_phases(drive: Drive) -> tuple[float, float]:
    """Return the phases xi_g, xi_b [rad] of the teeth's first harmonics, converted from marks if the preset has marks.

    For a run-out it is the phase of its tangential part.
    """
    mark_to_phase = _MARK_TO_PHASE[drive.mounting.mark_kind]
    xi_g = drive.number("phases.xi_g") + mark_to_phase
    xi_b = drive.number("phases.xi_b") + mark_to_phase
    return float(np.radians(xi_g)), float(np.radians(xi_b))


# first column of each kind of deviation; those of the higher orders follow
TEETH = 0
CAM_COLUMNS = 2
SHIFT = 4
SMOOTH_SCALARS = 12  # number of scalars of teeth that deviate up to the fourth order
# Numbers of scalars that a drive may have: first harmonics and cam; with a shift; up to the fourth order; all orders.
# A drive pays for as many columns as its deviations need.
_SCALAR_COUNTS = (4, 6, SMOOTH_SCALARS, 6 + 2 * len(TOOTH_ORDERS))
ODD_COLUMNS = {0, 1, 2, 3, 4, 5, 8, 9}  # columns of deviations of odd order: they change sign over half a turn
_COLUMN = {order: 6 + 2 * place for place, order in enumerate(TOOTH_ORDERS)}


def column_of(deviation: Deviation, mark_kind: str) -> int:
    """Return the first of the two columns of scalars of a deviation; mark_kind: the meaning of xi_g and xi_b."""
    # each higher order has columns of its own, whatever part of the drive it belongs to
    if deviation.order > 1:
        return _COLUMN[deviation.order]
    if deviation.kind == "cam":
        return CAM_COLUMNS
    # a composite deviation measured as run-out is a shift of the teeth, not a tangential wave
    return TEETH if deviation.kind == "composite" and mark_kind != "runout" else SHIFT


def factor_of(deviation: Deviation, drive: Drive) -> float:
    """Return the factor from the size of a deviation to its scalars, with its sign."""
    if deviation.kind in ("cam", "centre"):
        return 1.0
    # the gaps depend on dev_g - dev_b, equation (7)
    sign = -1.0 if deviation.part == "b" else 1.0
    if deviation.kind == "pitch":
        return sign * _amplitude_of_pitch(drive.gears.z_b if deviation.part == "b" else drive.gears.z_g)
    if deviation.kind != "composite":
        return sign
    # F'_i is peak to peak; a run-out points the other way
    return sign * (-0.5 if drive.mounting.mark_kind == "runout" else 0.5)


def _amplitude_of_pitch(z: int) -> float:
    """Return the amplitude of each order of the places of z teeth over their largest single pitch deviation f_p.

    Equation (8c). Each tooth stands off its place independently, with standard deviation s: a pitch between two teeth
    with sqrt(2) s, the largest of z pitches is c_z times that, and each order of the places has an amplitude of
    2 s/sqrt(z).
    """
    c_z = ndtri((1 + 0.5 ** (1 / z)) / 2)  # median of the largest of z normal numbers
    return float(2 / np.sqrt(2 * z) / c_z)


def standing_offset(drive: Drive) -> tuple[str, str]:
    """Return the fields of size and direction of the cam offset that stands with the fixed wheel."""
    # an offset of the seat in the housing stands with the wheel that is bolted to it
    offset = CAM_OFFSETS[_fixed_part(drive)]
    return offset.size, offset.direction


def _fixed_part(drive: Drive) -> Part:
    """Return the part that is the fixed wheel: the rigid wheel b, or the flexspline g."""
    return "b" if drive.mounting.fixed == "rigid" else "g"


def carried(drive: Drive) -> tuple[str, ...]:
    """Return the fields of the directions that turn with the fixed wheel when it is turned on its seat."""
    fixed_part = _fixed_part(drive)
    return tuple(
        deviation.direction
        for deviation in DEVIATIONS
        if deviation.part == fixed_part and not deviation.stays_with_seat
    )


def is_half_turn_symmetric(drive: Drive) -> bool:
    """Return whether the rotation stays the same if all deviations of odd order change their sign.

    Half a revolution maps teeth, balls and bore nodes onto each other only if the number of each is even.
    """
    # z_b = z_g + 2 is even if z_g is
    counts = (drive.gears.z_g, drive.bearing.N, drive.numerics.n_2)
    return all(count % 2 == 0 for count in counts)


def deviation_scalars(
    drive: Drive,
    alpha_g: Array,
    alpha_b: Array,
) -> Array:
    """Return the scalars of the preset's deviations [mm], shape (states, scalars), as many as it needs.

    Args:
        drive: its deviations.
        alpha_g: phi_g - phi_h [rad], angle of the flexspline in the frame of the cam, shape (states,).
        alpha_b: phi_b - phi_h [rad], angle of the rigid wheel in the frame of the cam, shape (states,).
    """
    return scalars_of(waves_of(drive.number, drive), alpha_g, alpha_b)


def waves_of(value: Callable[[str], Array | float], drive: Drive) -> Waves:
    """Return the complex amplitudes [mm] of deviations, equations (7), (8), (8a), before the wheels have turned.

    Args:
        value: sizes [um] and directions [deg] by the path of their field.
        drive: everything but the deviations.
    """
    # sums of complex amplitudes: deviations of one column, part and order can be added before any wheel turns
    waves = Waves()
    mark_kind = drive.mounting.mark_kind
    # for a run-out the mark counts in factor_of, which turns the amplitude's sign
    mark_to_phase = 0.0 if mark_kind == "runout" else _MARK_TO_PHASE[mark_kind]
    for deviation in DEVIATIONS:
        column = column_of(deviation, mark_kind)
        size = np.asarray(value(deviation.size)) * factor_of(deviation, drive) * 1e-3
        if not size.any() and column not in (TEETH, CAM_COLUMNS):
            continue  # columns beyond the first four are computed only if a deviation needs them
        # only the marks of composites are converted; offsets and higher orders have directions of their own
        direction = value(deviation.direction) + (mark_to_phase if deviation.kind == "composite" else 0.0)
        # deviations that turn with the same part and order have one wave
        key = column, deviation.part, deviation.order
        waves[key] = waves.get(key, 0) + size * np.exp(1j * deviation.order * np.radians(direction))
    return waves


def scalars_of(
    waves: Waves,
    alpha_g: Array,
    alpha_b: Array,
) -> Array:
    """Return the scalars [mm] of many drives at once, shape (..., scalars): the first 4, 6 or 12, or all of them.

    Args:
        waves: as returned by waves_of; all shapes broadcast.
        alpha_g: angle of the flexspline in the frame of the cam [rad].
        alpha_b: angle of the rigid wheel in the frame of the cam [rad].
    """
    # e^(i angle) in the frame of the cam; what is fixed to the cam does not turn there
    turn_of = {"g": np.exp(1j * np.asarray(alpha_g)), "b": np.exp(1j * np.asarray(alpha_b)), "h": np.ones(())}
    # a wave of order n turns n times as far as its part
    sums: dict[int, Array] = {}  # by column
    for (column, part, order), wave in waves.items():
        sums[column] = sums.get(column, 0) + wave * turn_of[part] ** order
    # the smallest permitted width that holds all columns
    last_column = max(sums)
    scalar_count = next(count for count in _SCALAR_COUNTS if count > last_column)
    shape = np.broadcast_shapes(*(wave.shape for wave in sums.values()))
    # columns without a deviation stay 0
    scalars = np.zeros((*shape, scalar_count))
    for column, wave in sums.items():
        # a deviation sin(order (theta - direction)) counts by its sine and cosine, an offset by x and y
        is_offset = column in (CAM_COLUMNS, SHIFT)
        scalars[..., column] = wave.real
        scalars[..., column + 1] = wave.imag if is_offset else -wave.imag
    return scalars


@dataclass(frozen=True)
class ToothDeviations:
    """Measured deviations of the teeth along +theta [um], in place of the preset's harmonics.

    None keeps the harmonics of a wheel. Tooth and space 0 stand on the major axis when phi_h = phi_g = 0, and numbers
    grow along +theta.
    """

    g: Array | None = None  # of each flexspline tooth, shape (z_g,)
    b: Array | None = None  # of each space of the rigid wheel, shape (z_b,)


def state_gaps(
    drive: Drive,
    system: ContactSystem,
    states: States,
    teeth: ToothDeviations | None = None,
) -> StateGaps:
    """Return the changes of the gaps of states by the deviations of a drive.

    Args:
        drive: its deviations.
        system: its flanks.
        states: positions of cam and wheels.
        teeth: measured deviations of teeth, in place of the drive's harmonics.

    Raises UsageError if their number is not that of the wheel's teeth.
    """
    # the usual case: no wheel was measured tooth by tooth
    if teeth is None or (teeth.g is None and teeth.b is None):
        return StateGaps(deviation_scalars(drive, states.alpha_g, states.alpha_b))
    # a measured wheel has its harmonics in the measured values; they must not count twice
    replaced_sizes = list[str]()
    if teeth.g is not None:
        replaced_sizes += IN_TEETH["g"]
    if teeth.b is not None:
        replaced_sizes += IN_TEETH["b"]
    without_measured = drive.with_values(dict.fromkeys(replaced_sizes, 0.0))
    flanks = system.flanks
    # dev_g - dev_b at each flank [mm]
    deviation = np.zeros((len(states), system.n_flanks))
    if teeth.g is not None:
        deviation += _at_teeth(teeth.g, flanks.tooth, states.alpha_g, drive.gears.z_g)
    if teeth.b is not None:
        # zone 1 lies half a revolution further, where tooth i faces space i + 1, since z_b = z_g + 2
        deviation -= _at_teeth(teeth.b, flanks.tooth + flanks.zone, states.alpha_b, drive.gears.z_b)
    scalars = deviation_scalars(without_measured, states.alpha_g, states.alpha_b)
    return StateGaps(scalars, -flanks.side * np.cos(flanks.alpha) * deviation)


def _at_teeth(
    deviation: Array,
    tooth: NDArray[np.int64],
    turned: Array,
    z: int,
) -> Array:
    """Return the deviations [mm] of the teeth at flanks in states, shape (states, flanks).

    Args:
        deviation: of each tooth of the wheel [um], shape (z,).
        tooth: number of the tooth at each flank of an unturned wheel, shape (flanks,).
        turned: angle of the wheel in the frame of the cam [rad], shape (states,).
        z: teeth of the wheel.
    """
    # a file of another wheel would be read modulo its number of teeth without this check
    if np.shape(deviation) != (z,):
        raise UsageError(f"a wheel of {z} teeth needs {z} deviations, not {np.size(deviation)}")
    # the nearest tooth; half a pitch is rounded the same way in every state, whatever its last digits are
    shift = np.floor(-turned * z / (2 * np.pi) + 0.5 + 1e-6).astype(np.int64)
    return np.asarray(np.asarray(deviation)[(tooth + shift[:, None]) % z] * 1e-3)


# --- measured wheels


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
        """The measured wheels by their names."""
        wheels = {"b": self.b, "g": self.g}
        return {name: wheel for name, wheel in wheels.items() if wheel}

    def fixed(self, drive: Drive) -> MeasuredWheel | None:
        """Return the fixed wheel of a drive, None if it is not measured."""
        return self.b if drive.mounting.fixed == "rigid" else self.g

    def rotated(self, drive: Drive, rotation_deg: float) -> MeasuredTeeth:
        """Return the wheels with the fixed one turned on its seat.

        Args:
            drive: says which wheel is fixed.
            rotation_deg: counter-clockwise, seen from the cam side.
        """
        wheel = self.fixed(drive)
        # a mark stands on the wheel, so it turns as far as the wheel does
        turned = wheel and replace(wheel, mark_deg=wheel.mark_deg + rotation_deg)
        return replace(self, **{_fixed_part(drive): turned})

    def without_harmonics(self, drive: Drive) -> Drive:
        """Return the drive with sizes of 0 for the deviations that the measured wheels replace."""
        return drive.with_values({path: 0.0 for name in self.by_name for path in IN_TEETH[name]})

    def in_drive(self, drive: Drive) -> tuple[Drive, ToothDeviations]:
        """Return the arguments of kinematic_error: a drive, and the deviation of each tooth.

        The pattern of a wheel is turned by whole teeth. The remainder, up to half a pitch, turns the drive's cam offset
        the other way.

        Raises UsageError if a wheel does not have the number of teeth of the drive's.
        """
        directions: dict[str, float] = {}  # of the cam offsets [deg]
        deviations = {}
        teeth_of = {"g": drive.gears.z_g, "b": drive.gears.z_b}
        for name, z in teeth_of.items():
            wheel = self.by_name.get(name)
            if wheel is None:
                continue
            if len(wheel.pitch.deviation) != z:
                raise UsageError(f"a wheel of {z} teeth needs {z} deviations, not {len(wheel.pitch.deviation)}")
            # where the mark stands, in pitches from tooth 0
            mark_in_teeth = (wheel.mark_deg - _MAJOR) / 360 * z
            whole_teeth = round(mark_in_teeth)
            # tooth 0 of the result is the tooth on the major axis
            deviations[name] = np.roll(wheel.pitch.deviation, whole_teeth)
            direction = f"phases.phi_h{name}"
            # turning wheel and cam together changes nothing, so the remainder of the wheel is given to the cam,
            # backwards
            directions[direction] = drive.number(direction) - (mark_in_teeth - whole_teeth) * 360 / z
        return drive.with_values(directions), ToothDeviations(**deviations)


# --- what may lie elsewhere than a preset has it: assumed values, and deviations not given
#
# Assumed stiffnesses, clearances and shapes have the bounds of their reason. A size that is not given may be anything
# up to the bound of its part; a direction that is not given, any direction.


def assumptions(drive: Drive) -> tuple[Unknown, ...]:
    """Return the fields of a drive that are assumed, or left to a default, and have a plausible range.

    A field that the preset's `source` calls assumed has the range that stands there.
    """
    # a range that leaves the limits of the field cannot be sampled
    fields = [field for path in measures() if (field := _assumption(drive, path))]
    return tuple(
        field
        for field in fields
        if field.low < field.high and drive.allows(field.path, field.low) and drive.allows(field.path, field.high)
    )


def _assumption(drive: Drive, path: str) -> Unknown | None:
    """Return the range of a field, None if its value is not assumed, has no effect, or was set by an override."""
    overrides = drive.origin.overrides
    # who sets a value on the command line knows it, unless the origin is set as well
    is_overridden_value = is_overridden(path, overrides) and not has_own_source(path, overrides)
    value = drive.value(path)
    if value is None or path == drive.unused_tooth_field or is_overridden_value:
        return None
    source = drive.source.get(path)
    # the preset's own statement takes precedence over the general laws
    if source is not None:
        if source.kind != "assumed" or not source.range:
            return None
        low, high = source.range
        return Unknown(
            path=path,
            low=low,
            high=high,
            reason=source.ref,
        )
    section, name = path.split(".")
    # a value that stands in the preset without a source counts as given
    is_default = name not in getattr(drive, section).model_fields_set
    if not is_default or path not in LAWS or not LAWS[path].assumed:
        return None
    # ranges grow with the size of the drive
    bounds = LAWS[path].range_at(drive.gears.pitch_diameter, drive.gears.m, value)
    if not bounds:
        return None
    low, high = bounds
    return Unknown(
        path=path,
        low=low,
        high=high,
        reason=LAWS[path].why,
    )


# --- deviations that are not known


@dataclass(frozen=True)
class Unknown:
    """A field that is assumed or not given, with the bounds of its true value in the field's unit."""

    path: str
    low: float
    high: float
    reason: str


def unknowns(drive: Drive) -> tuple[Unknown, ...]:
    """Return the deviations of a drive that are not known. A direction without a size has no effect and is omitted."""
    unknown_by_path = dict[str, Unknown]()  # all orders of a wheel's pitch share their size
    for deviation in DEVIATIONS:
        high, reason = _largest(drive, deviation)
        # a part that cannot deviate needs no direction
        if not high:
            continue
        size = deviation.size
        direction = deviation.direction
        if drive.value(size) is None:
            unknown_by_path[size] = Unknown(
                path=size,
                low=0.0,
                high=high,
                reason=reason,
            )
        if drive.value(direction) is None:
            unknown_by_path[direction] = Unknown(
                # order n repeats n times a revolution, so its directions do too
                path=direction,
                low=0.0,
                high=360.0 / deviation.order,
                reason="any direction",
            )
    return tuple(unknown_by_path.values())


def unknown_turn(drive: Drive) -> tuple[str, ...]:
    """Return the unknown directions between the fixed wheel's deviations and those that stand still with its seat.

    If all directions of the fixed wheel are unknown, or all that stand still, any hole is as good as any other;
    otherwise none is returned.
    """
    # a hole changes the angle between both sides only; if one side may stand at any angle, the holes are
    # exchangeable
    standing, turning = _sides(drive)
    unknown_paths = []
    for side in (turning, standing):
        directions = [deviation.direction for deviation in side]
        # one known direction on a side already fixes how it stands to the other
        if all(drive.value(path) is None for path in directions):
            unknown_paths += directions
    return tuple(unknown_paths)


def no_hole_better(drive: Drive) -> Literal["", "floating", "standing", "turning"]:
    """Return the reason why all holes of a drive are equally good, empty if one may be better than another.

    floating: the cam floats, so its offset has no effect; standing: no part that stands still with the seat deviates;
    turning: the fixed wheel has no deviation.
    """
    standing, turning = _sides(drive)
    if standing and turning:
        return ""
    if not turning:
        return "turning"
    return "standing" if drive.value(standing_offset(drive)[0]) == 0 else "floating"


def _sides(drive: Drive) -> tuple[list[Deviation], list[Deviation]]:
    """Return the deviations, known or not, that stand still with the fixed wheel's seat, and those of that wheel.

    The offset of a cam that floats (C_3 = 0) has no effect and is not among them.
    """
    # a cam without support centres itself under the load
    is_floating = not drive.number("supports.C_3")
    fixed_part = _fixed_part(drive)
    standing = list[Deviation]()
    turning = list[Deviation]()
    for deviation in DEVIATIONS:
        largest_um, _ = _largest(drive, deviation)
        # unknown sizes count with their upper bound: they may have an effect
        has_effect = largest_um and not (is_floating and deviation.kind == "cam")
        if deviation.part == fixed_part and has_effect:
            (standing if deviation.stays_with_seat else turning).append(deviation)
    return standing, turning


def unknown_notes(drive: Drive) -> tuple[str, ...]:
    """Return a warning that names the deviations which are not known and count as 0; none if all are known."""
    unknown_fields = unknowns(drive)
    if not unknown_fields:
        return ()
    return (f"unknown, and computed as 0: {unknown_names(unknown_fields)}",)


def unknown_names(fields: Sequence[Unknown], most: int = 4) -> str:
    """Return the paths of fields; of more than `most` their number, and the first of them."""
    paths = ", ".join(field.path for field in fields[:most])
    if len(fields) <= most:
        return paths
    return f"{len(fields)} inputs, including {paths}"


def _largest(drive: Drive, deviation: Deviation) -> tuple[float, str]:
    """Return the largest size [um] that a deviation has or is assumed to have, and the reason."""
    size = drive.value(deviation.size)
    # known sizes need no bound
    if size is not None:
        return size, "given"
    # the coarsest class in use bounds a wheel of unknown quality
    if deviation.kind == "composite":
        grade = F_p(drive.gears.pitch_diameter, drive.gears.m, COARSEST_CLASS)
        return grade, f"F_p of class {COARSEST_CLASS}, ISO 1328-1:2013"
    if deviation.kind in ("cam", "centre"):
        # the offset of the seat is larger than those that turn, as for the drive of the paper
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
