"""Corrections as a controller stores and evaluates them: tables and correction terms, fitted by least squares.

Signs: the error is the actual minus the ideal angle of the output [arcsec]. It is positive counter-clockwise, seen from
the wave generator side, like every angle. A controller subtracts it from its set-point. F_kpp, the ideal minus the
actual angle, has the opposite sign.

Zero: the position of wave generator and output at phi_h = 0 with the output angle 0 of the preset.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hdassist.drive.error.waves import Complex, ErrorLines
from hdassist.drive.model.geometry import Array
from hdassist.run.errors import UsageError

RepeatTurn = Literal["output", "cam", "half-cam"]
TRIED_POINTS: Mapping[RepeatTurn | None, Sequence[int]] = {  # numbers of table points, and for None of correction terms
    None: (20, 80, 320, 1280),
    "output": (32, 64, 100, 128, 180, 256, 360, 512, 720, 1024, 1500, 2048, 4096),
}
USUAL_POINTS = 1500  # points of a table over an output revolution
CAM_POINTS = 256  # points of a table over an input revolution or half of one


@dataclass(frozen=True)
class ExpectedResidual:
    """Range of the error over the full mesh cycle at a torque M_g [N*m], without and with a correction [arcsec].

    uncorrected_p50: median without a correction.
    p5, p50, p95: percentiles with the correction, over all uncertain inputs of the drive.
    case: "in place", with the zero of the correction off, or with a lost input revolution.
    """

    M_g: float
    uncorrected_p50: float
    p5: float
    p50: float
    p95: float
    case: str = "in place"


@dataclass(frozen=True, eq=False)
class CorrectionTable:
    """Error at even steps over a revolution, interpolated linearly; the first point also follows the last.

    turn: revolution after which the table repeats.
    error_arcsec: error to subtract at angles_deg [arcsec], shape (..., points).
    u: input revolutions per output revolution, negative if the two rotate in opposite senses.
    M_g: torque that the table is made for [N*m].
    other_direction_arcsec: error for the other direction of motion [arcsec], shape (points,); None if both are the
        same.
    other_M_g: torque for the other direction [N*m].
    preset: name of the drive.
    promised: predicted residuals with the table.
    recorded_deg: output angles at the ends of the recorded travel [deg], beyond which the table is a continuation; None
        for the full cycle.
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
        """Number of points of the table."""
        return int(self.error_arcsec.shape[-1])

    @property
    def period_deg(self) -> float:
        """Angle of the input or the output after which the table repeats [deg]."""
        return 180.0 if self.turn == "half-cam" else 360.0

    @property
    def angles_deg(self) -> Array:
        """Output or input angles of the points, increasing from 0 [deg], shape (points,)."""
        return np.asarray(np.arange(self.points) * (self.period_deg / self.points))

    def error_at(self, cam_turns: Array, *, other_direction: bool = False) -> Array:
        """Return the error to subtract at input angles [arcsec], shape (..., angles).

        cam_turns: input angles from zero [revolutions], shape (angles,).
        other_direction: whether the drive moves in the other direction.
        """
        values = self.error_arcsec
        if other_direction and self.other_direction_arcsec is not None:
            values = self.other_direction_arcsec
        return between_points(values, np.asarray(cam_turns) * periods_a_cam_turn(self.turn, self.u))


def periods_a_cam_turn(turn: RepeatTurn, u: float) -> float:
    """Return the periods of a table per input revolution, negative if the output rotates in the opposite sense."""
    return {"output": 1 / u, "cam": 1.0, "half-cam": 2.0}[turn]


def between_points(values: Array, periods: Array) -> Array:
    """Return values interpolated linearly between even steps over a period, shape (..., periods).

    values: values at the steps, shape (..., points).
    periods: positions in periods from the first step.
    """
    points = values.shape[-1]
    place = np.mod(periods, 1.0) * points
    first = np.floor(place).astype(np.int64)
    fraction = place - first
    return np.asarray(values[..., first % points] * (1 - fraction) + values[..., (first + 1) % points] * fraction)


@dataclass(frozen=True, eq=False)
class Phasors:
    """Error as correction terms: the sum of amplitude cos(2 pi per_cam_turn x + phase).

    The variable x is the input angle from zero [revolutions].

    per_output_turn: periods of each term per output revolution, shape (lines,).
    per_cam_turn: periods of each term per input revolution, shape (lines,).
    amplitude_arcsec: amplitudes [arcsec], shape (..., lines).
    phase_deg: phases [deg], shape (..., lines).
    M_g, preset, promised: as in `CorrectionTable`.
    amplitude_uncertainty_arcsec, phase_uncertainty_deg: standard uncertainties, shape (lines,); None if not determined.
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
        """Complex amplitudes of the terms [arcsec], shape (..., lines)."""
        return np.asarray(self.amplitude_arcsec * np.exp(1j * np.radians(self.phase_deg)))

    def error_at(self, cam_turns: Array) -> Array:
        """Return the error to subtract at input angles from zero [revolutions], in arcsec, shape (..., angles)."""
        phase = 2 * np.pi * self.per_cam_turn[:, None] * np.asarray(cam_turns)
        return np.asarray(self.vectors.real @ np.cos(phase) - self.vectors.imag @ np.sin(phase))


def correction_columns(correction: CorrectionTable | Phasors) -> dict[str, Array]:
    """Return the columns of a correction by name, with one value per table point or correction term."""
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

    turn: revolution after which the correction repeats; None for correction terms.
    points: number of table points or of correction terms.
    each_load: whether each torque has its own table.
    """

    turn: RepeatTurn | None
    points: int = 0
    each_load: bool = False

    @property
    def name(self) -> str:
        """Name of the form in JSON."""
        kind = f"{self.turn} turn, {self.points} points" if self.turn else f"{self.points} phasors"
        return f"{kind}, each load" if self.each_load else kind

    def fitted(self, lines: ErrorLines, M_g: float) -> CorrectionTable | Phasors:
        """Return the corrections of drives at a torque M_g [N*m], fitted to their lines; the first axis is by drive."""
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
    # one of the names above, which a type checker cannot infer from a text
    return CorrectionForm(turn, number)  # type: ignore[arg-type]


_TURN_WORDS = {"output": "output revolution", "cam": "input revolution", "half-cam": "half input revolution"}


def form_words(name: str) -> str:
    """Return the name of a form for pages, from its name in JSON ("output turn, 36 points")."""
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
    """Return the values of the tables that fit the errors of drives best [arcsec], shape (drives, points).

    A table is linear between its points. Least squares over the full cycle has a closed form: a line with h periods per
    revolution has the weight sinc^2(h/N) in the products with N triangle functions, whose own products are (4, 1, 1)/6.
    Lines without a whole number of periods average out.
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
    """Return the periods of each line per output revolution, the nearest input order, and the difference between both.

    The difference counts sidebands in periods per output revolution. Each array has shape (lines,).
    """
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
    """Return the strongest lines of the errors as correction terms at a torque M_g [N*m], by increasing frequency.

    lines: lines of the drives, whose mean power determines the strongest ones.
    number: number of terms.
    """
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
