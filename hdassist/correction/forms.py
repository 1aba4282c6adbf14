"""Stored corrections as a controller evaluates them, tables and correction terms, fitted by least squares.

Signs: the error is the actual minus the ideal angle of the output [arcsec]. It is counted counter-clockwise, seen
from the wave generator side, as every angle. A controller subtracts it from its set-point. F_kpp, the ideal minus the
actual angle, has the opposite sign.

Zero: the position of wave generator and output at phi_h = 0 with the output angle 0 of the preset.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hdassist.error.waves import Complex, ErrorLines
from hdassist.errors import UsageError
from hdassist.model.geometry import Array

RepeatTurn = Literal["output", "cam", "half-cam"]
TRIED_POINTS: Mapping[RepeatTurn | None, Sequence[int]] = {  # of tables, and numbers of correction terms
    None: (20, 80, 320, 1280),
    "output": (32, 64, 100, 128, 180, 256, 360, 512, 720, 1024, 1500, 2048, 4096),
}
USUAL_POINTS = 1500  # points of a table over an output revolution
CAM_POINTS = 256  # points of a table over an input revolution, or half of one


@dataclass(frozen=True)
class ExpectedResidual:
    """Range [arcsec] of the error over the full mesh cycle at a torque M_g [N*m], without a correction and with it.

    uncorrected_p50, p5, p50, p95: percentiles over all uncertain inputs of the drive.
    case: "in place", or with the zero of the correction off, or with a lost input revolution.
    """

    M_g: float
    uncorrected_p50: float
    p5: float
    p50: float
    p95: float
    case: str = "in place"


@dataclass(frozen=True, eq=False)
class CorrectionTable:
    """Error over a turn, at even steps with straight lines between; after the last point the first comes again.

    turn: after which it repeats; error_arcsec, shape (..., points): to be taken off, at angles_deg of that turn;
    u: cam turns in a turn of the output, negative where they turn apart; M_g [N*m]: torque that it is for;
    other_direction_arcsec, shape (points,): for the other direction of motion, None if both share the first, and
    other_M_g, the torque of that; preset: name of the drive; promised: residuals with it; recorded_deg: of the
    output, ends of the travel that a record has, beyond which the table is its continuation; None of the full cycle.
    """

    turn: RepeatTurn
    error_arcsec: Array
    u: float
    M_g: float
    other_direction_arcsec: Array | None = None
    other_M_g: float | None = None
    preset: str = ""
    promised: tuple[ExpectedResidual, ...] = ()
    recorded_deg: tuple[float, float] | None = None

    @property
    def points(self) -> int:
        """Number of its points."""
        return int(self.error_arcsec.shape[-1])

    @property
    def period_deg(self) -> float:
        """Angle of the cam or of the output after which the table repeats [deg]."""
        return 180.0 if self.turn == "half-cam" else 360.0

    @property
    def angles_deg(self) -> Array:
        """Angles of the points [deg], of the output or of the cam, rising from 0, shape (points,)."""
        return np.asarray(np.arange(self.points) * (self.period_deg / self.points))

    def error_at(self, cam_turns: Array, *, other_direction: bool = False) -> Array:
        """Return the error to take off [arcsec] where the cam has turned so far from zero, shape (..., turns)."""
        values = self.error_arcsec
        if other_direction and self.other_direction_arcsec is not None:
            values = self.other_direction_arcsec
        return between_points(values, np.asarray(cam_turns) * periods_a_cam_turn(self.turn, self.u))


def periods_a_cam_turn(turn: RepeatTurn, u: float) -> float:
    """Return the periods of a table in a turn of the cam; negative where the output turns against it."""
    return {"output": 1 / u, "cam": 1.0, "half-cam": 2.0}[turn]


def between_points(values: Array, periods: Array) -> Array:
    """Return values between even steps over a period, by straight lines, at periods from the first step.

    The values at the steps have the shape (..., points).
    """
    points = values.shape[-1]
    place = np.mod(periods, 1.0) * points
    first = np.floor(place).astype(np.int64)
    fraction = place - first
    return np.asarray(values[..., first % points] * (1 - fraction) + values[..., (first + 1) % points] * fraction)


@dataclass(frozen=True, eq=False)
class Phasors:
    """Error as lines: the sum of amplitude cos(2 pi per_cam_turn x + phase), x the turns of the cam from zero.

    per_output_turn, per_cam_turn: how often each line comes, shape (lines,); amplitude_arcsec; phase_deg, shape
    (..., lines) each; M_g, preset and promised as of a table; standard uncertainties of amplitude and phase, shape
    (lines,), of a record alone: two of them hold 95 %.
    """

    per_output_turn: Array
    per_cam_turn: Array
    amplitude_arcsec: Array
    phase_deg: Array
    M_g: float
    preset: str = ""
    promised: tuple[ExpectedResidual, ...] = ()
    amplitude_uncertainty_arcsec: Array | None = None
    phase_uncertainty_deg: Array | None = None

    @property
    def vectors(self) -> Complex:
        """Amplitudes with their phases [arcsec], shape (..., lines)."""
        return np.asarray(self.amplitude_arcsec * np.exp(1j * np.radians(self.phase_deg)))

    def error_at(self, cam_turns: Array) -> Array:
        """Return the error to take off [arcsec] where the cam has turned so far from zero, shape (..., turns)."""
        phase = 2 * np.pi * self.per_cam_turn[:, None] * np.asarray(cam_turns)
        return np.asarray(self.vectors.real @ np.cos(phase) - self.vectors.imag @ np.sin(phase))


def correction_columns(correction: CorrectionTable | Phasors) -> dict[str, Array]:
    """Return the columns of a correction by their names, of the same length each: points of a table, or lines."""
    if isinstance(correction, CorrectionTable):
        shaft = "output" if correction.turn == "output" else "cam"
        columns = {f"{shaft}_deg": correction.angles_deg, "error_arcsec": correction.error_arcsec}
        other_arcsec = correction.other_direction_arcsec
        return columns if other_arcsec is None else {**columns, "other_direction_arcsec": other_arcsec}
    names = ("per_output_turn", "per_cam_turn", "amplitude_arcsec", "phase_deg")
    uncertainties = ("amplitude_uncertainty_arcsec", "phase_uncertainty_deg")
    columns = {name: getattr(correction, name) for name in (*names, *uncertainties)}
    return {name: column for name, column in columns.items() if column is not None}


@dataclass(frozen=True)
class CorrectionForm:
    """Form of a correction.

    turn: revolution after which it repeats; None for correction terms.
    points: points of a table, or number of correction terms.
    each_load: whether each torque has its own table.
    """

    turn: RepeatTurn | None
    points: int = 0
    each_load: bool = False

    @property
    def name(self) -> str:
        """Words for it."""
        kind = f"{self.turn} turn, {self.points} points" if self.turn else f"{self.points} phasors"
        return f"{kind}, each load" if self.each_load else kind

    def fitted(self, lines: ErrorLines, M_g: float) -> CorrectionTable | Phasors:
        """Return the corrections of drives at a torque M_g [N*m] from the lines there, by drives in the first axis."""
        if self.turn is None:
            return phasors_of(lines, M_g, self.points)
        values = table_values(lines, self.turn, self.points)
        return CorrectionTable(
            turn=self.turn,
            error_arcsec=values,
            u=lines.kinematics.u,
            M_g=M_g,
        )


USUAL_TABLES = (
    *(CorrectionForm("output", points) for points in (USUAL_POINTS, 720, 256)),
    CorrectionForm("output", USUAL_POINTS, each_load=True),
    CorrectionForm("cam", CAM_POINTS),
    CorrectionForm("half-cam", CAM_POINTS),
)


def form_of_text(text: str) -> CorrectionForm:
    """Read a form such as phasors, phasors:80, output:720, cam or half-cam. Raises UsageError for any other text."""
    name, _, points = text.partition(":")
    usual = {"phasors": TRIED_POINTS[None][-1], "output": USUAL_POINTS, "cam": CAM_POINTS, "half-cam": CAM_POINTS}
    number = int(points) if points.isdecimal() else usual.get(name, 0) if not points else 0
    if name not in usual or not 2 <= number <= 100000:
        expected = "expected a form, optionally with its number of points, for example output:720"
        raise UsageError(f"invalid --compensated {text}: {expected}", f"use one of these forms: {', '.join(usual)}")
    turn = None if name == "phasors" else name
    return CorrectionForm(turn, number)  # type: ignore[arg-type]  # one of the names above, which a text cannot show


_TURN_WORDS = {"output": "output revolution", "cam": "input revolution", "half-cam": "half input revolution"}


def form_words(name: str) -> str:
    """Return the name of the form of a correction for pages, from that in JSON ("output turn, 36 points")."""
    turn, is_table, points = name.partition(" turn, ")
    if is_table:
        number, _, each_load = points.partition(", ")
        return ", ".join(filter(None, (f"{number} per {_TURN_WORDS[turn]}", each_load)))
    return name.replace("phasors", "correction terms")


def table_values(
    lines: ErrorLines,
    turn: RepeatTurn,
    points: int,
) -> Array:
    """Return values [arcsec] of tables that fit the errors of drives best, shape (drives, points).

    Between points tables are straight.

    Least squares over the full cycle in closed form: a line that comes h times in the period weighs sinc^2(h/N) in the
    products with N triangles, whose own products are (4, 1, 1)/6; lines that come no whole times average out.
    """
    kinematics = lines.kinematics
    often = lines.per_cycle / (kinematics.cycle_cam_revolutions * periods_a_cam_turn(turn, kinematics.u))
    h = np.rint(often)
    is_half_turn = np.abs(often - h) < 1e-6
    share = h[is_half_turn] / points
    weight = 3 * np.sinc(share) ** 2 / (2 + np.cos(2 * np.pi * share))
    spectrum = np.zeros((len(lines.amplitude), points), dtype=complex)
    np.add.at(spectrum.T, h[is_half_turn].astype(np.int64) % points, (lines.amplitude[:, is_half_turn] * weight).T)
    return np.asarray(-points * np.fft.ifft(spectrum).real)


def line_orders(lines: ErrorLines) -> tuple[Array, Array, Array]:
    """Return how often each line comes in a turn of the output, and the order of the cam and beats nearest to that."""
    cam_turns = lines.kinematics.cycle_cam_revolutions
    ratio = abs(lines.kinematics.u)
    per_output = lines.per_cycle * ratio / cam_turns
    order = np.rint(lines.per_cycle / cam_turns)
    return per_output, order, per_output - order * ratio


def phasors_of(
    lines: ErrorLines,
    M_g: float,
    number: int,
) -> Phasors:
    """Return a number of the strongest lines of errors at a torque M_g [N*m], over all drives, rising."""
    power = (np.abs(lines.amplitude) ** 2).mean(axis=0)
    kept = np.sort(np.argsort(-power, kind="stable")[:number])
    amplitude = -lines.amplitude[:, kept]
    per_cam = lines.per_cycle[kept] / lines.kinematics.cycle_cam_revolutions
    per_output = line_orders(lines)[0][kept]
    return Phasors(
        per_output_turn=per_output,
        per_cam_turn=per_cam,
        amplitude_arcsec=np.abs(amplitude),
        phase_deg=np.degrees(np.angle(amplitude)),
        M_g=M_g,
    )
