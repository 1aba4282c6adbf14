"""Files of corrections for controllers, with the columns, signs, units and steps of each controller.

Each writer follows the controller's source code or manual. The tests verify it with an independent implementation of
the controller's evaluation. Positions are those of the controller, which may count in the other sense and from another
zero; see `ControllerAxis`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from hdassist import __version__
from hdassist.drive.model.geometry import Array
from hdassist.features.correction.correct import Correction, percentiles, ranges_left
from hdassist.features.correction.forms import CorrectionTable, ExpectedResidual, RepeatTurn, form_words
from hdassist.run.errors import UsageError

_ARCSEC_A_TURN = 1_296_000
# apparent motion of an hour axis per second of clock time [arcsec/s]; it is 15 arcsec per sidereal second
_SIDEREAL_ARCSEC_A_SECOND = 15.041067
_MOTEUS_BINS = 256
_INT8_MOST = 127
_PEC_SECONDS = (61, 720)  # shortest and longest table that OnStepX stores, in sidereal seconds
_EQMOD_DIGITS = 4
_TWINCAT_STEPS_A_DEGREE = 10_000
_POOR_SHARE = 0.5  # residual of a table, as a share of the error, above which the table is called poor
_SETPOINT_STEPS = 2  # iterations for the error at a set-point; each reduces the remaining deviation a hundredfold
_RESAMPLED_POINTS = 8192  # points that represent the correction of a controller with its own points


@dataclass(frozen=True)
class ControllerAxis:
    """Axis in the convention of its controller; the first values of a table apply when the axis counts up.

    name: name of the axis, joint or source.
    sense: 1 if the axis counts up while the output rotates counter-clockwise, seen from the wave generator side, or -1
        if it counts down; for moteus, the wave generator takes the place of the output.
    zero_deg: reading of the axis when input and output are at zero [deg].
    from_deg: start of the revolution that the rows cover [deg].
    steps_per_degree: motor steps per degree of the axis, for telescope mounts.
    """

    name: str
    sense: int = 1
    zero_deg: float = 0.0
    from_deg: float = 0.0
    steps_per_degree: float = 0.0


@dataclass(frozen=True, eq=False)
class _PlayedCorrection:
    """Correction of a controller with its own points: the error that it subtracts, interpolated linearly.

    reading_deg: readings in the controller's counting [deg], shape (points,).
    error_arcsec: error subtracted at the readings, in the controller's counting [arcsec], shape (points,).
    period_deg: period of the reading [deg].
    stored: numbers in the file.
    scale: scale of the stored numbers; 1 if the file has no scale.
    is_input_angle: whether the reading is the input angle instead of the output angle.
    """

    reading_deg: Array
    error_arcsec: Array
    period_deg: float
    stored: Array
    scale: float = 1.0
    is_input_angle: bool = False


@dataclass(frozen=True)
class ControllerFormat:
    """Format of a controller's correction file.

    name: name of the controller.
    turns: revolutions after which its tables may repeat.
    lines: function that returns the lines of the file.
    setup: settings of the machine.
    most_points: largest number of points of a table; None if the machine determines it.
    by_direction: whether the file has values for each direction.
    step_arcsec: step of the stored values [arcsec].
    played: function that returns the applied correction; None if the controller uses the table's own points.
    comment: characters that start a comment; empty if the format has no comments.
    comments_at: index of the line before which the comments are inserted; None for the end.
    """

    name: str
    turns: tuple[RepeatTurn, ...]
    lines: Callable[[CorrectionTable, ControllerAxis], list[str]]
    setup: str
    most_points: int | None = None
    by_direction: bool = False
    step_arcsec: float = 0.00036
    played: Callable[[CorrectionTable, ControllerAxis], _PlayedCorrection] | None = None
    comment: str = ""
    comments_at: int | None = 0

    def require(self, turn: RepeatTurn | None, points: int) -> None:
        """Raise UsageError unless the controller stores this form and number of points.

        turn: revolution of a table; None for correction terms.
        """
        if turn not in self.turns:
            wanted = " or ".join(self.turns)
            raise UsageError(f"invalid --form {turn or 'phasors'} for {self.name}: expected --form {wanted}")
        if self.most_points and points > self.most_points:
            message = f"invalid number of points {points} for {self.name}: expected at most {self.most_points}"
            raise UsageError(message, "reduce --points")


def _error_as_read(
    table: CorrectionTable,
    axis: ControllerAxis,
    reading_deg: Array,
    direction: int = 1,
    *,
    of_cam: bool = False,
) -> Array:
    """Return the error in the controller's counting at its readings of the output, or of the input [arcsec]."""
    turned = axis.sense * (np.asarray(reading_deg) - axis.zero_deg) / 360
    cam_turns = turned if of_cam else turned * table.u
    return axis.sense * table.error_at(cam_turns, other_direction=direction < 0)


def _error_at_setpoint(
    table: CorrectionTable,
    axis: ControllerAxis,
    setpoint_deg: Array,
    direction: int = 1,
    *,
    from_first: bool = False,
) -> Array:
    """Return the error, in the controller's counting, at the motor position that results from a set-point [arcsec].

    from_first: whether the controller subtracts only the difference from the error at the first set-point.
    """
    error = _error_as_read(table, axis, setpoint_deg, direction)
    for _ in range(_SETPOINT_STEPS):
        taken = error - error[0] if from_first else error
        error = _error_as_read(table, axis, setpoint_deg - taken / 3600, direction)
    return error


def stored_table(
    table: CorrectionTable,
    controller: ControllerFormat,
    axis: ControllerAxis,
) -> CorrectionTable:
    """Return the table as the controller applies it, with the controller's rows and steps.

    The predicted residuals are those of the given table. Raises UsageError if the controller cannot store the table.
    """
    controller.require(table.turn, table.points)
    if table.other_direction_arcsec is not None and not controller.by_direction:
        message = f"{controller.name} cannot store a separate table for each direction"
        raise UsageError(message, "choose another controller, or torques of one sign only")
    if controller.played is None:
        step = controller.step_arcsec
        other_arcsec = table.other_direction_arcsec
        other_arcsec = None if other_arcsec is None else np.round(other_arcsec / step) * step
        return replace(
            table, error_arcsec=np.round(table.error_arcsec / step) * step, other_direction_arcsec=other_arcsec
        )
    played = controller.played(table, axis)
    angle = np.linspace(
        0,
        table.period_deg,
        _RESAMPLED_POINTS,
        endpoint=False,
    )
    turns_as_read = played.is_input_angle or table.turn == "output"
    reading = axis.zero_deg + axis.sense * angle / (1 if turns_as_read else table.u)
    error = axis.sense * np.interp(reading, played.reading_deg, played.error_arcsec, period=played.period_deg)
    return replace(table, error_arcsec=error)


def correction_file(
    result: Correction,
    controller: ControllerFormat,
    axis: ControllerAxis,
) -> tuple[str, str]:
    """Return the controller's file for a table, and its description with the residuals of the stored table.

    Raises UsageError if the controller cannot store the correction.
    """
    table = cast("CorrectionTable", result.correction)
    stored = stored_table(table, controller, axis)
    expected = []
    for M_g, error in result.errors.items():
        other_arcsec = stored.other_direction_arcsec if M_g == stored.other_M_g else None
        correction = stored if other_arcsec is None else replace(stored, error_arcsec=other_arcsec)
        residual = percentiles(ranges_left(correction, error)[0])
        expected.append(ExpectedResidual(M_g, percentiles(error.ranges)[1], *residual))
    about = replace(
        table,
        promised=tuple(expected),
        recorded_deg=result.recorded_deg,
    )
    kind, sha256 = (
        ("preset", result.drive.origin.sha256) if result.drive else ("record", result.records[result.M_g].sha256)
    )
    return controller_file(about, controller, axis, f"{kind} {table.preset}, sha256 {sha256 or '-'}")


def poor_table(result: Correction, controller: ControllerFormat) -> str:
    """Return a warning with a better form if a table leaves more than half of the error, or an empty text."""
    form = result.chosen.form
    _, residual_share, _ = result.chosen.left
    if residual_share <= _POOR_SHARE:
        return ""
    message = f"{form_words(form.name)} leave {100 * residual_share:.0f} % of the error"
    points = result.fewest_points
    if not points:
        return f"{message}; no table over the output revolution halves the error, so use correction terms"
    able = [
        name
        for name, format_ in CONTROLLER_FORMATS.items()
        if "output" in format_.turns and (format_.most_points or points) >= points
    ]
    refused_by = "" if controller in map(CONTROLLER_FORMATS.get, able) else f", but {controller.name} cannot store it"
    halved = f"--form output --points {points} halves the error{refused_by}"
    return f"{message}; {halved}. Formats that can store it: {', '.join(able)}"


def controller_file(
    table: CorrectionTable,
    controller: ControllerFormat,
    axis: ControllerAxis,
    source: str,
) -> tuple[str, str]:
    """Return the controller's file and a description, which the file contains as comments if its format has them.

    The description states kind, controller and drive in 7-bit lines.

    source: description of the preset or the recording.
    """
    way = "counter-clockwise" if axis.sense == 1 else "clockwise"
    reads_input = controller.played is not None and controller.played(table, axis).is_input_angle
    shaft = "wave generator" if reads_input else "output"
    steps = axis.steps_per_degree
    worm = [f"{table.period_deg / abs(table.u) * steps:.2f} motor steps in the period of the table"] if steps else []
    for_torque = f"for {table.M_g:g} N*m"
    if table.other_M_g is not None:
        for_torque += f" with increasing readings, {table.other_M_g:g} N*m with decreasing readings"
    travel = []
    if table.recorded_deg:
        low, high = sorted(axis.zero_deg + axis.sense * turn_deg for turn_deg in table.recorded_deg)
        travel = [
            f"recorded from {low:.6g} to {high:.6g} deg of the output; outside this range the residual is not predicted"
        ]
    about = [
        f"hdassist {__version__}: correction of the kinematic error, {controller.name}, axis {axis.name}",
        source,
        f"{for_torque}; table of the form {table.turn}, {table.points} points, linear interpolation",
        *worm,
        *travel,
        f"zero: the axis reads {axis.zero_deg:.6g} deg when input and output are at zero (phi_h = 0)",
        f"the axis reading increases as the {shaft} rotates {way}, seen from the wave generator side",
        "subtract the error (actual minus ideal output angle)",
        *(
            f"at {residual.M_g:g} "
            f"N*m{'' if residual.case == 'in place' else ', ' + residual.case}: expected residual range "
            f"{residual.p50:.2f} arcsec ({residual.p5:.2f} to {residual.p95:.2f}), without correction "
            f"{residual.uncorrected_p50:.2f}"
            for residual in table.promised
        ),
        f"setup: {controller.setup}",
    ]
    about = [line.encode("unicode_escape").decode() for line in about]
    lines = controller.lines(table, axis)
    if controller.comment:
        comment_line = len(lines) if controller.comments_at is None else controller.comments_at
        lines[comment_line:comment_line] = [f"{controller.comment} {line}" for line in about]
    return "\n".join([*lines, ""]), "\n".join([*about, ""])


def _rows_of_one_turn(
    table: CorrectionTable,
    axis: ControllerAxis,
    digits: int,
) -> tuple[Array, Array, Array]:
    """Return set-points over one revolution, including both ends [deg], and the errors counting up and down [arcsec].

    The set-points are chosen so that the motor reaches the table's points once the controller has subtracted the error,
    which is the mean of both directions. Both ends of the revolution are added.
    """
    points = axis.zero_deg + axis.sense * table.angles_deg
    shift = (_error_as_read(table, axis, points) + _error_as_read(table, axis, points, -1)) / 7200
    turned = np.mod(points + shift - axis.from_deg, 360)
    setpoint = np.unique(np.round([*turned, 0, 360], digits)) + axis.from_deg
    return setpoint, _error_at_setpoint(table, axis, setpoint), _error_at_setpoint(table, axis, setpoint, -1)


def _linuxcnc(table: CorrectionTable, axis: ControllerAxis) -> list[str]:
    """Return the rows with nominal position and forward and reverse trim [deg], which is added to the position."""
    rows = zip(*_rows_of_one_turn(table, axis, 6), strict=True)
    return [f"{nominal:.6f} {-up / 3600:.7f} {-down / 3600:.7f}" for nominal, up, down in rows]


def _twincat_cnc(table: CorrectionTable, axis: ControllerAxis) -> list[str]:
    """Return the lines of a list of positions and errors for both directions, in steps of 0.0001 deg."""
    reading, *errors = _rows_of_one_turn(table, axis, 4)
    places, *columns = (
        np.rint(values * _TWINCAT_STEPS_A_DEGREE).astype(int) for values in (reading, *(e / 3600 for e in errors))
    )
    named = {"setpoint": places, "pos": columns[0], "neg": columns[1]}
    head = {"unit": 1, "interval": 0, "kw_startpos": places[0], "kw_nr_max": len(places), "bilateral": 1, "modulo": 1}
    return [
        *(f"kw.ssfk.{name} {value}" for name, value in head.items()),
        *(f"kw.ssfk.table[{i}].{name} {value}" for name, values in named.items() for i, value in enumerate(values)),
    ]


def _even_setpoints(table: CorrectionTable, axis: ControllerAxis) -> Array:
    """Return even set-points over one revolution [deg], from the first step after the axis's zero, with both ends."""
    start = axis.zero_deg % (360 / table.points)
    return np.linspace(start, start + 360, table.points + 1)


def _twincat_nc_played(table: CorrectionTable, axis: ControllerAxis) -> _PlayedCorrection:
    """Return the error that is subtracted at even set-points; the controller interpolates linearly between them."""
    setpoint = _even_setpoints(table, axis)[:-1]
    error = _error_at_setpoint(table, axis, setpoint)
    return _PlayedCorrection(
        reading_deg=setpoint - error / 3600,
        error_arcsec=error,
        period_deg=360.0,
        stored=error,
    )


def _twincat_nc(table: CorrectionTable, axis: ControllerAxis) -> list[str]:
    """Return the lines with even set-points over a revolution and the additions to them [deg], for each direction."""
    setpoint = _even_setpoints(table, axis)
    ways = [("Both", 1)] if table.other_direction_arcsec is None else [("Positive", 1), ("Negative", -1)]
    lines = ["VAR_GLOBAL"]
    for name, way in ways:
        added = -_error_at_setpoint(table, axis, setpoint, way) / 3600
        head = (
            f"MinPosition := {setpoint[0]:.9f}, MaxPosition := {setpoint[-1]:.9f}, NoOfTableElements := {len(setpoint)}"
        )
        rows = [
            f"        (Position := {position_deg:.9f}, Compensation := {value:.9f}),"
            for position_deg, value in zip(setpoint, added, strict=True)
        ]
        lines += [
            f"    Parameter{name} : ST_PositionCompensationTableParameter := ({head},",
            f"        Direction := WorkDirection{name}, Modulo := TRUE);",
            f"    Table{name} : ARRAY[0..{table.points}] OF ST_PositionCompensationTableElement := [",
            *rows[:-1],
            f"{rows[-1][:-1]}];",
        ]
    return [*lines, "END_VAR"]


def _siemens(table: CorrectionTable, axis: ControllerAxis) -> list[str]:
    """Return the lines with the error at even points over a revolution, both ends included.

    A positive value moves the axis back.
    """
    step = 360 / table.points
    start = axis.zero_deg % step
    values = _error_as_read(table, axis, np.linspace(start, start + 360, table.points + 1)) / 3600
    name = axis.name
    return [
        "%_N_AX_EEC_INI",
        "CHANDATA(1)",
        *(f"$AA_ENC_COMP[0,{i},{name}]={value:.7f}" for i, value in enumerate(values)),
        f"$AA_ENC_COMP_STEP[0,{name}]={step:.10f}",
        f"$AA_ENC_COMP_MIN[0,{name}]={start:.7f}",
        f"$AA_ENC_COMP_MAX[0,{name}]={start + 360:.7f}",
        f"$AA_ENC_COMP_IS_MODULO[0,{name}]=1",
        "M17",
    ]


def _moteus_played(table: CorrectionTable, axis: ControllerAxis) -> _PlayedCorrection:
    """Return 256 values of 8 bits over a revolution of the input encoder, which the firmware adds to its reading.

    The addition is u times the error of the output. Value i is at i/256 of the revolution, as the firmware evaluates
    it, although a comment there names the middle of a bin.
    """
    reading = np.linspace(0, 360, _MOTEUS_BINS, endpoint=False)
    added_turns = table.u * _error_as_read(table, axis, reading, of_cam=True) / _ARCSEC_A_TURN
    scale = float(np.abs(added_turns).max()) or 1.0
    stored = np.rint(added_turns * (_INT8_MOST / scale))
    step_arcsec = scale / _INT8_MOST * _ARCSEC_A_TURN / table.u
    return _PlayedCorrection(
        reading_deg=reading,
        error_arcsec=stored * step_arcsec,
        period_deg=360.0,
        stored=stored.astype(int),
        scale=scale,
        is_input_angle=True,
    )


def _moteus(table: CorrectionTable, axis: ControllerAxis) -> list[str]:
    played = _moteus_played(table, axis)
    source = f"conf set motor_position.sources.{axis.name}.compensation_"
    rows = (f"{source}table.{i} {value}" for i, value in enumerate(played.stored))
    return [*rows, f"{source}scale {played.scale:.9g}", "conf write"]


def _worm_deg(table: CorrectionTable, axis: ControllerAxis) -> float:
    """Return the output angle per period of the table [deg]."""
    if axis.steps_per_degree <= 0:
        steps = axis.steps_per_degree
        message = f"invalid number of steps per degree {steps:g}: expected a positive number"
        raise UsageError(message, "state it with --steps-per-degree N")
    return table.period_deg / abs(table.u)


def _onstepx_played(table: CorrectionTable, axis: ControllerAxis) -> _PlayedCorrection:
    """Return the motor steps in each sidereal second of a worm revolution; a row is played one second late.

    The first and the last two seconds contain no steps, because the controller plays them longer or shorter if the
    revolution does not last a whole number of seconds.
    """
    worm_deg = _worm_deg(table, axis)
    seconds = round(worm_deg * 240)
    if not _PEC_SECONDS[0] <= seconds <= _PEC_SECONDS[1]:
        range_s = f"{_PEC_SECONDS[0]} to {_PEC_SECONDS[1]} s"
        hint = "use a table over half an input revolution, which takes half as long"
        raise UsageError(f"the table takes {seconds} sidereal seconds, but OnStepX stores tables of {range_s}", hint)
    setpoint = np.arange(seconds + 1, dtype=float) / 240
    error = _error_at_setpoint(table, axis, setpoint, from_first=True)
    steps = np.rint((error[0] - error) * (axis.steps_per_degree / 3600))
    steps[[0, 1, -2, -1]] = 0
    largest_step = min(_INT8_MOST, round(axis.steps_per_degree / 240))
    if (changes := np.abs(np.diff(steps)).max()) > largest_step:
        message = f"the table changes by {changes:g} steps in one second, but OnStepX allows {largest_step}"
        raise UsageError(message, "check --steps-per-degree")
    step = 3600 / axis.steps_per_degree
    rows = np.roll(np.diff(steps), -1).astype(int)
    reading = (setpoint + steps / axis.steps_per_degree)[:-1]
    return _PlayedCorrection(
        reading_deg=reading, error_arcsec=error[0] - steps[:-1] * step, period_deg=worm_deg, stored=rows
    )


def _onstepx(table: CorrectionTable, axis: ControllerAxis) -> list[str]:
    rows = _onstepx_played(table, axis).stored
    return [*(f":WR{i},{value:+d}#" for i, value in enumerate(rows)), ":$QZ!#"]


def _eqmod_played(table: CorrectionTable, axis: ControllerAxis) -> _PlayedCorrection:
    """Return the error at each second of a worm revolution; the controller removes the drift from first to last row."""
    worm_deg = _worm_deg(table, axis)
    rows = round(worm_deg * 3600 / _SIDEREAL_ARCSEC_A_SECOND)
    setpoint = np.arange(rows, dtype=float) * (_SIDEREAL_ARCSEC_A_SECOND / 3600)
    stored = _error_at_setpoint(table, axis, setpoint, from_first=True).round(_EQMOD_DIGITS)
    played = stored - np.arange(rows) * ((stored[-1] - stored[0]) / (rows + 1))
    reading = setpoint - (played - played[0]) / 3600
    return _PlayedCorrection(
        reading_deg=reading,
        error_arcsec=played,
        period_deg=worm_deg,
        stored=stored,
    )


def _eqmod(table: CorrectionTable, axis: ControllerAxis) -> list[str]:
    played = _eqmod_played(table, axis)
    steps_a_second = _SIDEREAL_ARCSEC_A_SECOND / 3600 * axis.steps_per_degree
    motor = np.rint(np.arange(len(played.stored)) * steps_a_second).astype(int)
    return [
        "# time - motor - smoothed PE",
        f"!WormPeriod={len(motor)}",
        f"!StepsPerWorm={round(played.period_deg * axis.steps_per_degree)}",
        *(
            f"{i} {steps} {error:.{_EQMOD_DIGITS}f}"
            for i, (steps, error) in enumerate(
                zip(
                    motor,
                    played.stored,
                    strict=True,
                )
            )
        ),
    ]


def _rows_from_zero(table: CorrectionTable, axis: ControllerAxis) -> tuple[Array, list[Array]]:
    """Return the points of the table from the zero of the axis [deg], and the errors for each direction [arcsec]."""
    reading = axis.zero_deg + table.angles_deg
    ways = (1,) if table.other_direction_arcsec is None else (1, -1)
    return reading, [_error_as_read(table, axis, reading, way, of_cam=table.turn != "output") for way in ways]


def _plain_csv(table: CorrectionTable, axis: ControllerAxis) -> list[str]:
    reading, errors = _rows_from_zero(table, axis)
    names = ["reading_deg", "error_arcsec", "error_counting_down_arcsec"][: 1 + len(errors)]
    rows = zip(reading, *errors, strict=True)
    return [
        ",".join(names),
        *(",".join((f"{reading_deg:.7f}", *(f"{error:.5f}" for error in row))) for reading_deg, *row in rows),
    ]


def _c_array(table: CorrectionTable, axis: ControllerAxis) -> list[str]:
    """Return the lines of an array and its lookup function for custom firmware; each direction has its own row."""
    _, errors = _rows_from_zero(table, axis)
    rows = ("    {" + ", ".join(f"{value:.5f}" for value in row) + "}," for row in errors)
    way = "counts_down ? 1 : 0" if len(errors) > 1 else "0"
    return [
        "#include <math.h>",
        f"#define HDASSIST_POINTS {table.points}",
        f"static const double hdassist_error_arcsec[{len(errors)}][HDASSIST_POINTS] = {{",
        *rows,
        "};",
        "/* error [arcsec] at a reading [deg]: subtract it from the set-point;",
        "   counts_down: 1 if the reading decreases, else 0 */",
        "static double hdassist_error(double reading_deg, int counts_down) {",
        f"    const double *values = hdassist_error_arcsec[{way}];",
        f"    double turns = (reading_deg - ({axis.zero_deg:.9g})) / {table.period_deg:g};",
        "    double place = (turns - floor(turns)) * HDASSIST_POINTS;",
        "    int first = (int)place;",
        "    double rest = place - first;",
        "    (void)counts_down;",
        "    return values[first % HDASSIST_POINTS] * (1 - rest) + values[(first + 1) % HDASSIST_POINTS] * rest;",
        "}",
    ]


CONTROLLER_FORMATS = {
    "csv": ControllerFormat(
        name="plain CSV",
        turns=("output", "cam", "half-cam"),
        lines=_plain_csv,
        setup="interpolate linearly between rows, and continue with the first row after the last",
        by_direction=True,
        step_arcsec=1e-5,
        comment="#",
    ),
    "c": ControllerFormat(
        name="C",
        turns=("output", "cam", "half-cam"),
        lines=_c_array,
        setup="include the file, and subtract hdassist_error(reading_deg, counts_down) from the set-point",
        by_direction=True,
        step_arcsec=1e-5,
        comment="//",
    ),
    "linuxcnc-1": ControllerFormat(
        name="LinuxCNC, type 1",
        turns=("output",),
        lines=_linuxcnc,
        setup="set COMP_FILE and COMP_FILE_TYPE = 1 in [JOINT_n]; outside the rows the nearest row is used",
        most_points=254,
        by_direction=True,
        comment="#",
        comments_at=None,
    ),
    "twincat-cnc": ControllerFormat(
        name="TwinCAT CNC",
        turns=("output",),
        lines=_twincat_cnc,
        setup="insert below kopf.* in the compensation list of the axis, and set lr_param.ssfk to 1",
        most_points=1497,
        by_direction=True,
        step_arcsec=0.36,
        comment="#",
    ),
    "twincat-nc": ControllerFormat(
        name="TwinCAT NC",
        turns=("output",),
        lines=_twincat_nc,
        setup=(
            "save as a global variable list; pass ADR and SIZEOF of the array to MC_TableBasedPositionCompensation, "
            "with a high Ramp"
        ),
        by_direction=True,
        played=_twincat_nc_played,
        comment="//",
    ),
    "siemens-840d": ControllerFormat(
        name="SINUMERIK 840D",
        turns=("output",),
        lines=_siemens,
        setup="load the file with MD32700 ENC_COMP_ENABLE = 0, then set it to 1; MD38000 must exceed "
        "the number of points",
        comment=";",
        comments_at=2,
    ),
    "moteus": ControllerFormat(
        name="moteus",
        turns=("cam", "half-cam"),
        lines=_moteus,
        setup="load with moteus_tool --write-config; the firmware needs compensation_scale, and the "
        "source the input angle",
        played=_moteus_played,
    ),
    "eqmod": ControllerFormat(
        name="EQMOD",
        turns=("cam", "half-cam"),
        lines=_eqmod,
        setup="set gain x1, threshold 0 and the northern hemisphere; in Windows, set a point as decimal separator",
        played=_eqmod_played,
        comment="#",
    ),
    "onstepx": ControllerFormat(
        name="OnStepX",
        turns=("cam", "half-cam"),
        lines=_onstepx,
        setup="before sending the rows, set PEC_STEPS_PER_WORM_ROTATION to the number of motor steps above",
        played=_onstepx_played,
    ),
}
