"""Settings of controllers that compensate backlash only, from the lost motion of a recording in both directions.

Each setting follows the controller's manual, which docs/controllers.md names. Such a controller moves the motor by the
backlash when the direction reverses. It has no table of points, and the error within each direction remains.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hdassist import __version__
from hdassist.features.measuring.fit import COVERAGE_FACTOR
from hdassist.features.measuring.measure import Measurement
from hdassist.run.errors import DataError, UntrustedError, UsageError

_ARCSEC_PER_DEG = 3600
_DUET_DISTANCE = 10  # distance over which RepRapFirmware inserts its steps, in multiples of the backlash; its default
_GRBLHAL_AXES = "XYZABC"  # axis letters in the sequence of the settings
_GRBLHAL_FIRST = 160  # number of the setting for the first axis
_HEIDENHAIN_AXES = 9
_HEIDENHAIN_LARGEST_DEG = 1.0

NO_COMPENSATION = {  # controllers without backlash compensation and without a table of points, and the reasons
    "fluidnc": "FluidNC supports neither backlash compensation nor compensation tables; its developers have "
    "declined both",
    "grbl": "grbl supports neither backlash compensation nor compensation tables; grblHAL (grblhal) has "
    "a backlash setting",
}


@dataclass(frozen=True)
class _Backlash:
    """Lost motion at reversal, from a recording in both directions.

    arcsec: mean over the recorded angles [arcsec].
    uncertainty_arcsec: standard uncertainty of the mean [arcsec].
    departure_arcsec: largest departure from the mean [arcsec], which no single setting compensates.
    torque_Nm: torque of the recording [N*m].
    has_lag: whether a lag between the encoders may contribute.
    """

    arcsec: float
    uncertainty_arcsec: float
    departure_arcsec: float
    torque_Nm: float
    has_lag: bool

    @property
    def deg(self) -> float:
        """Lost motion in degrees of the output."""
        return self.arcsec / _ARCSEC_PER_DEG


def _duet(backlash: _Backlash, axis: str) -> str:
    """Return the command of RepRapFirmware for an axis letter. Raises UsageError if the name is not a letter."""
    if len(axis) != 1 or not axis.isalpha():
        raise UsageError(
            f"invalid --axis {axis} for Duet: expected the letter of the axis", "state the axis, for example --axis A"
        )
    return f"M425 {axis.upper()}{backlash.deg:.5f} S{_DUET_DISTANCE}"


def _grblhal(backlash: _Backlash, axis: str) -> str:
    """Return the setting of grblHAL for an axis letter. Raises UsageError for any other name."""
    if len(axis) != 1 or axis.upper() not in _GRBLHAL_AXES:
        letters = ", ".join(_GRBLHAL_AXES)
        raise UsageError(
            f"invalid --axis {axis} for grblHAL: expected one of {letters}", "state the axis, for example --axis A"
        )
    return f"${_GRBLHAL_FIRST + _GRBLHAL_AXES.index(axis.upper())}={backlash.deg:.5f}"


def _heidenhain(backlash: _Backlash, axis: str) -> str:
    """Return the machine parameter of TNC 426 and 430 for an axis number.

    Raises UsageError for any other name, and for a backlash above the limit of the parameter.
    """
    if not axis.isdecimal() or not 1 <= int(axis) <= _HEIDENHAIN_AXES:
        message = f"invalid --axis {axis} for HEIDENHAIN: expected a number from 1 to {_HEIDENHAIN_AXES}"
        raise UsageError(message, "state the number of the axis, for example --axis 4")
    if backlash.deg > _HEIDENHAIN_LARGEST_DEG:
        message = f"the backlash of {backlash.deg:.4f} deg exceeds the largest value of MP710, 1 deg"
        raise UsageError(message, "reduce the backlash of the axis first")
    return f"MP710.{axis} {backlash.deg:+.4f}"


@dataclass(frozen=True)
class BacklashFormat:
    """Format of a controller's backlash setting.

    name: name of the controller.
    line: function that returns the setting for a backlash and an axis.
    comment: characters that start a comment.
    setup: further requirements of the machine.
    why_no_table: reason why no table of points is written for the controller.
    """

    name: str
    line: Callable[[_Backlash, str], str]
    comment: str
    setup: str
    why_no_table: str


BACKLASH_FORMATS = {
    "duet": BacklashFormat(
        name="Duet (RepRapFirmware 3.5 and later)",
        line=_duet,
        comment=";",
        setup="add the line to config.g; the unit of the axis must be degrees of output rotation",
        why_no_table="RepRapFirmware does not support such tables (requested in its issue 469)",
    ),
    "grblhal": BacklashFormat(
        name="grblHAL",
        line=_grblhal,
        comment=";",
        setup="use a build with backlash compensation; the unit of the axis must be degrees of output rotation",
        why_no_table="no support for such tables was found in grblHAL or its plugins",
    ),
    "heidenhain": BacklashFormat(
        name="HEIDENHAIN TNC 426, 430",
        line=_heidenhain,
        comment=";",
        setup="enter the line in the machine parameters; the value is positive because the motor "
        "encoder leads the output",
        why_no_table="the consulted manuals do not describe the lines of a .COM file",
    ),
}


def backlash_of(measured: Measurement, torque_Nm: float) -> _Backlash:
    """Return the lost motion of a recording whose directions were measured separately.

    torque_Nm: torque of the recording [N*m].
    Raises DataError for a recording in one direction, and UntrustedError if the lost motion does not exceed its
    expanded uncertainty.
    """
    reversal = measured.reversal
    if reversal is None:
        raise DataError(
            f"{measured.trace.file}: the backlash cannot be determined from one direction", "record both directions"
        )
    value = reversal.lost_motion_arcsec
    uncertainty = reversal.lost_motion_standard_uncertainty_arcsec
    if value <= COVERAGE_FACTOR * uncertainty:
        expanded = COVERAGE_FACTOR * uncertainty
        message = (
            f"{measured.trace.file}: the lost motion, {value:.3g} ± {expanded:.3g}″, is not larger than its uncertainty"
        )
        raise UntrustedError(message, "record for longer; if the result does not change, no compensation is needed")
    return _Backlash(
        arcsec=value,
        uncertainty_arcsec=uncertainty,
        departure_arcsec=reversal.greatest_departure_arcsec,
        torque_Nm=torque_Nm,
        has_lag=reversal.by == "one speed",
    )


def backlash_file(
    backlash: _Backlash,
    controller: BacklashFormat,
    axis: str,
    source: str,
) -> tuple[str, str]:
    """Return the file with a controller's setting, and the description that the file contains as comments.

    source: description of the recording.
    Raises UsageError for an axis that the controller does not have.
    """
    expanded = COVERAGE_FACTOR * backlash.uncertainty_arcsec
    about = [
        f"hdassist {__version__}: backlash compensation, {controller.name}, axis {axis}",
        source,
        f"lost motion at {backlash.torque_Nm:g} N*m: {backlash.arcsec:.2f} +- {expanded:.2f} arcsec (k = 2)",
        "not compensated: the deviation of the lost motion from its mean (up to "
        f"{backlash.departure_arcsec:.2f} arcsec) "
        "and the kinematic error in each direction",
    ]
    if backlash.has_lag:
        about.append("the lost motion may include a lag between the encoders: record at two speeds to remove the lag")
    about.append(f"setup: {controller.setup}")
    lines = [*(f"{controller.comment} {text}" for text in about), controller.line(backlash, axis)]
    return "\n".join([*lines, ""]), "\n".join([*about, ""])
