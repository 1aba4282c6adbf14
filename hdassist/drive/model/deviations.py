"""Deviations of the parts in the frame of the wave generator: up to 24 scalars, or one value per tooth.

Angles are positive counter-clockwise, seen from the wave generator side; deviations of teeth act along +theta at the
contact. The scalars are in the order a, b, e_x, e_y, s_x, s_y, a_2, b_2, a_3, b_3 and so on:

- Teeth: dev_g - dev_b = a sin(theta_x1) + b cos(theta_x1), and likewise of orders 2, 3, 4, 6 and even orders up to 16.
- Cam centre: (e_x, e_y) along x1, y1.
- Eccentricity of the circular spline's tooth ring minus that of the flexspline: (s_x, s_y), which also moves teeth
radially.

In pitch-locked states the teeth are at fixed angles relative to the cam, so a measured wheel can only be placed by
whole teeth. If a mark lies between two of these angles, the states are at slightly different cam angles. The pattern is
turned by the nearest whole number of teeth. The remainder, up to half a pitch, turns the cam eccentricity fixed to that
wheel by the same angle in the opposite direction. The relative angle of the two is therefore exact, and interpolation
does not smooth the deviation of any tooth.

The true values of unspecified deviations and of assumed values may differ from the computed ones: they are the unknown
inputs of a drive, with bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from hdassist.drive.model.contacts import TOOTH_ORDERS, ContactSystem, StateGaps
from hdassist.drive.model.geometry import Array, States
from hdassist.drive.preset.fields import (
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
from hdassist.drive.preset.knowledge import (
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
from hdassist.run.errors import UsageError

# The high spot of a runout is opposite to the phase of its tangential part. The largest pitch deviation is at the zero
# crossing of the cumulative deviation's sine.
_MARK_TO_PHASE = {"xi": 0.0, "runout": 180.0, "pitch": -90.0}  # deg to add to the direction of a mark to obtain a phase

# complex amplitudes [mm] of deviations by column of the scalars, part (g, b, h) and order
Waves = dict[tuple[int, str, int], Array]


def tooth_phases(drive: Drive) -> tuple[float, float]:
    """Return the phases xi_g and xi_b of the teeth's first harmonics [rad].

    They are converted from marks if the preset has marks. For a runout they are the phases of its tangential part.
    """
    mark_to_phase = _MARK_TO_PHASE[drive.mounting.mark_kind]
    xi_g = drive.number("phases.xi_g") + mark_to_phase
    xi_b = drive.number("phases.xi_b") + mark_to_phase
    return float(np.radians(xi_g)), float(np.radians(xi_b))


# first column of each kind of deviation, before the columns of higher orders
TEETH = 0
CAM_COLUMNS = 2
SHIFT = 4
SMOOTH_SCALARS = 12  # number of scalars for tooth deviations up to the fourth order
# Possible numbers of scalars: first harmonics and cam; with a shift; up to the fourth order; all orders. Only as many
# columns as the deviations need are computed.
_SCALAR_COUNTS = (4, 6, SMOOTH_SCALARS, 6 + 2 * len(TOOTH_ORDERS))
ODD_COLUMNS = {0, 1, 2, 3, 4, 5, 8, 9}  # columns of deviations of odd order, which change sign over half a revolution
_COLUMN = {order: 6 + 2 * place for place, order in enumerate(TOOTH_ORDERS)}


def column_of(deviation: Deviation, mark_kind: str) -> int:
    """Return the first of the two scalar columns of a deviation.

    mark_kind: meaning of xi_g and xi_b.
    """
    # each higher order has its own columns, for every part of the drive
    if deviation.order > 1:
        return _COLUMN[deviation.order]
    if deviation.kind == "cam":
        return CAM_COLUMNS
    # a composite deviation measured as runout is a shift of the teeth, not a tangential wave
    return TEETH if deviation.kind == "composite" and mark_kind != "runout" else SHIFT


def factor_of(deviation: Deviation, drive: Drive) -> float:
    """Return the signed factor from the size of a deviation to its scalars."""
    if deviation.kind in ("cam", "centre"):
        return 1.0
    # the gaps depend on dev_g - dev_b, equation (7)
    sign = -1.0 if deviation.part == "b" else 1.0
    if deviation.kind == "pitch":
        return sign * _amplitude_of_pitch(drive.gears.z_b if deviation.part == "b" else drive.gears.z_g)
    if deviation.kind != "composite":
        return sign
    # F'_i is peak to peak; a runout has the opposite direction
    return sign * (-0.5 if drive.mounting.mark_kind == "runout" else 0.5)


def _amplitude_of_pitch(z: int) -> float:
    """Return the amplitude of each order of the positions of z teeth over the largest single pitch deviation f_p.

    Equation (8c). Each order of the positions has an amplitude of 2 s/sqrt(z) for a standard deviation s.
    """
    return float(2 * spread_of_teeth(z) / np.sqrt(z))


def spread_of_teeth(z: int) -> float:
    """Return the standard deviation s of the positions of z teeth over the largest single pitch deviation f_p.

    The position errors of the teeth are independent. The pitch between two teeth then has the standard deviation
    sqrt(2) s, and the largest of z pitch deviations is c_z times that.
    """
    c_z = ndtri((1 + 0.5 ** (1 / z)) / 2)  # median of the largest of z normal numbers
    return float(1 / np.sqrt(2) / c_z)


def largest_pitch_share(drive: Drive) -> float:
    """Return the largest f_p of a wheel over its F'_i: that of the class of ISO 1328-1:2013 that has F'_i as F_p."""
    wheel = drive.gears.pitch_diameter, drive.gears.m, COARSEST_CLASS
    return f_p(*wheel) / F_p(*wheel)


def standing_offset(drive: Drive) -> tuple[str, str]:
    """Return the fields of size and direction of the cam eccentricity that is fixed to the seat of the fixed wheel."""
    # the eccentricity of the seat in the housing belongs to the wheel that is bolted to it
    offset = CAM_OFFSETS[_fixed_part(drive)]
    return offset.size, offset.direction


def _fixed_part(drive: Drive) -> Part:
    """Return the part that is the fixed wheel: the circular spline b or the flexspline g."""
    return "b" if drive.mounting.fixed == "rigid" else "g"


def carried(drive: Drive) -> tuple[str, ...]:
    """Return the fields of the directions that change when the fixed wheel is turned on its seat."""
    fixed_part = _fixed_part(drive)
    return tuple(
        deviation.direction
        for deviation in DEVIATIONS
        if deviation.part == fixed_part and not deviation.stays_with_seat
    )


def is_half_turn_symmetric(drive: Drive) -> bool:
    """Return whether the rotation is unchanged if all deviations of odd order change their sign.

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
    """Return the scalars of the preset's deviations [mm], shape (states, scalars), with as many columns as needed.

    Args:
        drive: drive with the deviations.
        alpha_g: angle of the flexspline in the frame of the wave generator, phi_g - phi_h [rad], shape (states,).
        alpha_b: angle of the circular spline in the frame of the wave generator, phi_b - phi_h [rad], shape (states,).
    """
    return scalars_of(waves_of(drive.number, drive), alpha_g, alpha_b)


def waves_of(value: Callable[[str], Array | float], drive: Drive) -> Waves:
    """Return the complex amplitudes of deviations before the wheels turn [mm], equations (7), (8), (8a).

    Args:
        value: function that returns the size [um] or direction [deg] for the path of a field.
        drive: drive with all other fields.
    """
    # complex amplitudes of one column, part and order can be added before the wheels turn
    waves = Waves()
    mark_kind = drive.mounting.mark_kind
    # for a runout, factor_of accounts for the mark by the sign of the amplitude
    mark_to_phase = 0.0 if mark_kind == "runout" else _MARK_TO_PHASE[mark_kind]
    for deviation in DEVIATIONS:
        column = column_of(deviation, mark_kind)
        size = np.asarray(value(deviation.size)) * factor_of(deviation, drive) * 1e-3
        if not size.any() and column not in (TEETH, CAM_COLUMNS):
            continue  # columns beyond the first four are computed only if a deviation needs them
        # only the marks of composite deviations are converted; eccentricities and higher orders have their own
        # directions
        direction = value(deviation.direction) + (mark_to_phase if deviation.kind == "composite" else 0.0)
        # deviations of the same column, part and order form one wave
        key = column, deviation.part, deviation.order
        waves[key] = waves.get(key, 0) + size * np.exp(1j * deviation.order * np.radians(direction))
    return waves


def scalars_of(
    waves: Waves,
    alpha_g: Array,
    alpha_b: Array,
) -> Array:
    """Return the scalars of many drives at once [mm], shape (..., scalars): the first 4, 6 or 12, or all of them.

    Args:
        waves: complex amplitudes from `waves_of`; all shapes broadcast.
        alpha_g: angle of the flexspline in the frame of the wave generator [rad].
        alpha_b: angle of the circular spline in the frame of the wave generator [rad].
    """
    # e^(i angle) in the frame of the wave generator, in which parts fixed to the cam do not turn
    turn_of = {"g": np.exp(1j * np.asarray(alpha_g)), "b": np.exp(1j * np.asarray(alpha_b)), "h": np.ones(())}
    # a wave of order n turns n times as far as its part
    sums: dict[int, Array] = {}  # by column
    for (column, part, order), wave in waves.items():
        sums[column] = sums.get(column, 0) + wave * turn_of[part] ** order
    # the smallest permitted number of columns that includes all used columns
    last_column = max(sums)
    scalar_count = next(count for count in _SCALAR_COUNTS if count > last_column)
    shape = np.broadcast_shapes(*(wave.shape for wave in sums.values()))
    # columns without a deviation remain 0
    scalars = np.zeros((*shape, scalar_count))
    for column, wave in sums.items():
        # a deviation sin(order (theta - direction)) is given by its sine and cosine, an eccentricity by x and y
        is_offset = column in (CAM_COLUMNS, SHIFT)
        scalars[..., column] = wave.real
        scalars[..., column + 1] = wave.imag if is_offset else -wave.imag
    return scalars


@dataclass(frozen=True)
class ToothDeviations:
    """Measured tooth deviations along +theta [um] that replace the preset's harmonics.

    None keeps the harmonics of a wheel. Tooth and space 0 are on the major axis when phi_h = phi_g = 0, and the numbers
    increase along +theta.
    """

    g: Array | None = None  # deviation of each flexspline tooth, shape (z_g,)
    b: Array | None = None  # deviation of each space of the circular spline, shape (z_b,)


def state_gaps(
    drive: Drive,
    system: ContactSystem,
    states: States,
    teeth: ToothDeviations | None = None,
) -> StateGaps:
    """Return the changes of the gaps of states due to the deviations of a drive.

    Args:
        drive: drive with the deviations.
        system: contact system with the flanks.
        states: positions of wave generator and wheels.
        teeth: measured tooth deviations that replace the drive's harmonics.

    Raises UsageError if the number of deviations differs from the number of teeth of a wheel.
    """
    # in the usual case no wheel was measured tooth by tooth
    if teeth is None or (teeth.g is None and teeth.b is None):
        return StateGaps(deviation_scalars(drive, states.alpha_g, states.alpha_b))
    # the measured values of a wheel contain its harmonics, which must not count twice
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
        # zone 1 is half a revolution further, where tooth i faces space i + 1, because z_b = z_g + 2
        deviation -= _at_teeth(teeth.b, flanks.tooth + flanks.zone, states.alpha_b, drive.gears.z_b)
    scalars = deviation_scalars(without_measured, states.alpha_g, states.alpha_b)
    return StateGaps(scalars, -flanks.side * np.cos(flanks.alpha) * deviation)


def _at_teeth(
    deviation: Array,
    tooth: NDArray[np.int64],
    turned: Array,
    z: int,
) -> Array:
    """Return the deviations of the teeth at flanks in states [mm], shape (states, flanks).

    Args:
        deviation: deviation of each tooth of the wheel [um], shape (z,).
        tooth: index of the tooth at each flank of an unturned wheel, shape (flanks,).
        turned: angle of the wheel in the frame of the wave generator [rad], shape (states,).
        z: number of teeth of the wheel.
    """
    # without this check, a file of another wheel would be read modulo its number of teeth
    if np.shape(deviation) != (z,):
        raise UsageError(f"expected {z} deviations for a wheel with {z} teeth, not {np.size(deviation)}")
    # nearest tooth; half a pitch is rounded in the same direction in every state, regardless of rounding errors
    shift = np.floor(-turned * z / (2 * np.pi) + 0.5 + 1e-6).astype(np.int64)
    return np.asarray(np.asarray(deviation)[(tooth + shift[:, None]) % z] * 1e-3)


# --- measured wheels


_MAJOR = 90.0  # deg from x; major axis of the cam at phi_h = 0, where tooth 0 is


@dataclass(frozen=True, eq=False)
class PitchFile:
    """Pitch deviations of a wheel tooth by tooth, starting at its mark, with their source.

    deviation: cumulative deviations without their mean [um], shape (teeth,), positive along +theta, which is
        counter-clockwise seen from the wave generator side; element 0 is the tooth with the mark, and the teeth follow
        counter-clockwise.
    mark: number of the marked tooth in the measurement.
    flank: measured flank.
    file, sha256: file of the measurement and its hash.
    notes: conversions and assumptions.
    """

    deviation: NDArray[np.float64]
    mark: int = 1
    flank: Literal["left", "right"] | None = None
    file: str = ""
    sha256: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class MeasuredWheel:
    """Measured pitch deviations of a wheel, and the direction of its mark.

    mark_deg: direction of the mark [deg], counter-clockwise from x, seen from the wave generator side, at phi_h = phi_g
        = 0, as for phases.xi_b.
    """

    pitch: PitchFile
    mark_deg: float


@dataclass(frozen=True)
class MeasuredTeeth:
    """Measured wheels that replace the preset's first harmonics; None keeps the harmonics of a wheel.

    g: flexspline.
    b: circular spline.
    """

    g: MeasuredWheel | None = None
    b: MeasuredWheel | None = None

    @property
    def by_name(self) -> dict[str, MeasuredWheel]:
        """The measured wheels by name."""
        wheels = {"b": self.b, "g": self.g}
        return {name: wheel for name, wheel in wheels.items() if wheel}

    def fixed(self, drive: Drive) -> MeasuredWheel | None:
        """Return the measured fixed wheel of a drive, None if it is not measured."""
        return self.b if drive.mounting.fixed == "rigid" else self.g

    def rotated(self, drive: Drive, rotation_deg: float) -> MeasuredTeeth:
        """Return the wheels with the fixed wheel turned on its seat.

        Args:
            drive: drive that determines the fixed wheel.
            rotation_deg: rotation [deg], counter-clockwise seen from the wave generator side.
        """
        wheel = self.fixed(drive)
        # the mark is on the wheel and turns with it
        turned = wheel and replace(wheel, mark_deg=wheel.mark_deg + rotation_deg)
        return replace(self, **{_fixed_part(drive): turned})

    def without_harmonics(self, drive: Drive) -> Drive:
        """Return the drive with sizes of 0 for the deviations that the measured wheels replace."""
        return drive.with_values({path: 0.0 for name in self.by_name for path in IN_TEETH[name]})

    def in_drive(self, drive: Drive) -> tuple[Drive, ToothDeviations]:
        """Return the arguments of kinematic_error: a drive, and the deviation of each tooth.

        The pattern of a wheel is turned by whole teeth. The remainder, up to half a pitch, turns the drive's cam
        eccentricity in the opposite direction.

        Raises UsageError if the number of teeth of a measured wheel differs from that of the drive.
        """
        directions: dict[str, float] = {}  # directions of the cam eccentricities [deg]
        deviations = {}
        teeth_of = {"g": drive.gears.z_g, "b": drive.gears.z_b}
        for name, z in teeth_of.items():
            wheel = self.by_name.get(name)
            if wheel is None:
                continue
            if len(wheel.pitch.deviation) != z:
                count = len(wheel.pitch.deviation)
                raise UsageError(f"expected {z} deviations for a wheel with {z} teeth, not {count}")
            # angle of the mark, in pitches from tooth 0
            mark_in_teeth = (wheel.mark_deg - _MAJOR) / 360 * z
            whole_teeth = round(mark_in_teeth)
            # tooth 0 of the result is the tooth on the major axis
            deviations[name] = np.roll(wheel.pitch.deviation, whole_teeth)
            direction = f"phases.phi_h{name}"
            # turning wheel and cam together changes nothing, so the cam is turned back by the remainder of the wheel
            directions[direction] = drive.number(direction) - (mark_in_teeth - whole_teeth) * 360 / z
        return drive.with_values(directions), ToothDeviations(**deviations)


# --- uncertain inputs of a preset: assumed values and unspecified deviations
#
# Assumed stiffnesses, clearances and shapes have the bounds of their assumption. An unspecified size may have any value
# up to the bound for its part, and an unspecified direction any value.


def assumptions(drive: Drive) -> tuple[Unknown, ...]:
    """Return the fields of a drive that are assumed or have a default, and whose plausible range is known.

    A field that the preset's `source` declares as assumed has the range given there.
    """
    # a range beyond the limits of the field cannot be sampled
    fields = [field for path in measures() if (field := _assumption(drive, path))]
    return tuple(
        field
        for field in fields
        if field.low < field.high and drive.allows(field.path, field.low) and drive.allows(field.path, field.high)
    )


def _assumption(drive: Drive, path: str) -> Unknown | None:
    """Return the range of a field; None if its value is not assumed, has no effect, or was set by an override."""
    overrides = drive.origin.overrides
    # a value set on the command line counts as known, unless its source is set as well
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
    # a value in the preset without a source counts as known
    is_default = name not in getattr(drive, section).model_fields_set
    if not is_default or path not in LAWS or not LAWS[path].assumed:
        return None
    # ranges depend on the size of the drive
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


# --- unknown deviations


@dataclass(frozen=True)
class Unknown:
    """A field that is assumed or not specified, with the bounds of its true value in the field's unit."""

    path: str
    low: float
    high: float
    reason: str


def unknowns(drive: Drive) -> tuple[Unknown, ...]:
    """Return the unknown deviations of a drive, without directions of deviations whose size is 0."""
    # a dictionary, because all orders of a wheel's pitch deviation share one size
    unknown_by_path = dict[str, Unknown]()
    for deviation in DEVIATIONS:
        high, reason = _largest(drive, deviation)
        # a part without deviation needs no direction
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
                # order n repeats n times per revolution, so its directions do as well
                path=direction,
                low=0.0,
                high=360.0 / deviation.order,
                reason="any direction",
            )
    return tuple(unknown_by_path.values())


def unknown_turn(drive: Drive) -> tuple[str, ...]:
    """Return the unknown directions that make the holes of a drive exchangeable.

    If all directions of the fixed wheel's deviations are unknown, or all directions of the stationary deviations of its
    seat, no hole can be better than another. Otherwise the result is empty.
    """
    # a hole changes only the angle between both sides; if one side may have any angle, the holes are exchangeable
    standing, turning = _sides(drive)
    unknown_paths = []
    for side in (turning, standing):
        directions = [deviation.direction for deviation in side]
        # one known direction on a side already determines its angle to the other side
        if all(drive.value(path) is None for path in directions):
            unknown_paths += directions
    return tuple(unknown_paths)


def no_hole_better(drive: Drive) -> Literal["", "floating", "standing", "turning"]:
    """Return the reason why all holes of a drive are equally good, empty if one may be better than another.

    The reasons are floating (the cam floats, so its eccentricity has no effect), standing (no stationary deviation of
    the seat) and turning (the fixed wheel has no deviation).
    """
    standing, turning = _sides(drive)
    if standing and turning:
        return ""
    if not turning:
        return "turning"
    return "standing" if drive.value(standing_offset(drive)[0]) == 0 else "floating"


def _sides(drive: Drive) -> tuple[list[Deviation], list[Deviation]]:
    """Return the deviations, known or unknown, of the fixed wheel's stationary seat, and those of the fixed wheel.

    The eccentricity of a floating cam (C_3 = 0) has no effect and is excluded.
    """
    # a cam without support centres itself under load
    is_floating = not drive.number("supports.C_3")
    fixed_part = _fixed_part(drive)
    standing = list[Deviation]()
    turning = list[Deviation]()
    for deviation in DEVIATIONS:
        largest_um, _ = _largest(drive, deviation)
        # an unknown size counts with its upper bound, because it may have an effect
        has_effect = largest_um and not (is_floating and deviation.kind == "cam")
        if deviation.part == fixed_part and has_effect:
            (standing if deviation.stays_with_seat else turning).append(deviation)
    return standing, turning


def unknown_notes(drive: Drive) -> tuple[str, ...]:
    """Return a warning that names the unknown deviations computed as 0, or nothing if all are known."""
    unknown_fields = unknowns(drive)
    if not unknown_fields:
        return ()
    return (f"unknown, and set to 0: {unknown_names(unknown_fields)}",)


def unknown_names(fields: Sequence[Unknown], most: int = 4) -> str:
    """Return the paths of fields, or their number and the first paths if there are many.

    most: largest number of fields that are all named.
    """
    paths = ", ".join(field.path for field in fields[:most])
    if len(fields) <= most:
        return paths
    return f"{len(fields)} inputs, including {paths}"


def _largest(drive: Drive, deviation: Deviation) -> tuple[float, str]:
    """Return the largest actual or assumed size of a deviation [um], and the reason."""
    size = drive.value(deviation.size)
    # a known size needs no bound
    if size is not None:
        return size, "given"
    # the coarsest class in use bounds a wheel of unknown quality
    if deviation.kind == "composite":
        grade = F_p(drive.gears.pitch_diameter, drive.gears.m, COARSEST_CLASS)
        return grade, f"F_p of class {COARSEST_CLASS}, ISO 1328-1:2013"
    if deviation.kind in ("cam", "centre"):
        # the eccentricity of the seat is larger than the rotating eccentricities, as for the drive of the paper
        share = STANDING_OFFSET if deviation.size == standing_offset(drive)[0] else TURNING_OFFSET
        share = CENTRE_OFFSET if deviation.kind == "centre" else share
        return share * drive.gears.pitch_diameter, f"assumed: {share:g} um for each mm of the pitch diameter"
    composite = COMPOSITES[deviation.part]
    share = SECOND_ORDER if deviation.order == 2 else HIGHER_ORDERS
    size, _ = _largest(drive, composite)
    if deviation.kind == "pitch":
        reason = f"f_p of the class of ISO 1328-1:2013 that {composite.name} has as F_p"
        return size * largest_pitch_share(drive), reason
    return share * size / 2, f"assumed: {share:.0%} of half of {composite.name}"
