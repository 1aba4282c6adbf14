"""Forms in which a correction is stored, each fitted to the lines of an error by least squares over the full cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hdassist.correction.table import CorrectionTable, Phasors, RepeatTurn, periods_a_cam_turn
from hdassist.model.geometry import Array
from hdassist.planning.lines import ErrorLines

TRIED_POINTS: Mapping[RepeatTurn | None, Sequence[int]] = {  # of tables, and numbers of phasors
    None: (20, 80, 320, 1280),
    "output": (32, 64, 100, 128, 180, 256, 360, 512, 720, 1024, 1500, 2048, 4096),
}
USUAL_POINTS = 1500  # of a table over an output turn
CAM_POINTS = 256  # of a table over a turn of the cam, or half of one


@dataclass(frozen=True)
class CorrectionForm:
    """A form of a correction: turn after which it repeats, None for phasors; points of a table, or number of phasors.

    each_load: whether each torque has a table of its own.
    """

    turn: RepeatTurn | None
    points: int = 0
    each_load: bool = False

    @property
    def name(self) -> str:
        """Words for it."""
        kind = f"{self.turn} turn, {self.points} points" if self.turn else f"{self.points} phasors"
        return kind + ", each load" * self.each_load

    def fitted(self, lines: ErrorLines, M_g: float) -> CorrectionTable | Phasors:
        """Corrections of drives at a torque M_g [N*m], in the first axis of their values, from the lines there."""
        if self.turn is None:
            return phasors_of(lines, M_g, self.points)
        values = table_values(lines, self.turn, self.points)
        return CorrectionTable(self.turn, values, lines.kinematics.u, M_g)


USUAL_TABLES = (
    *(CorrectionForm("output", points) for points in (USUAL_POINTS, 720, 256)),
    CorrectionForm("output", USUAL_POINTS, each_load=True),
    CorrectionForm("cam", CAM_POINTS),
    CorrectionForm("half-cam", CAM_POINTS),
)


def table_values(lines: ErrorLines, turn: RepeatTurn, points: int) -> Array:
    """Values [arcsec] of tables, straight from point to point, that fit drives' errors best, shape (drives, points).

    Least squares over the full cycle in closed form: a line that comes h times in the period weighs sinc^2(h/N) in the
    products with N triangles, whose own products are (4, 1, 1)/6; lines that come no whole times average out.
    """
    kinematics = lines.kinematics
    often = lines.per_cycle / (kinematics.cycle_cam_revolutions * periods_a_cam_turn(turn, kinematics.u))
    h = np.rint(often)
    whole = np.abs(often - h) < 1e-6
    share = h[whole] / points
    weight = 3 * np.sinc(share) ** 2 / (2 + np.cos(2 * np.pi * share))
    spectrum = np.zeros((len(lines.amplitude), points), dtype=complex)
    np.add.at(spectrum.T, h[whole].astype(np.int64) % points, (lines.amplitude[:, whole] * weight).T)
    return np.asarray(-points * np.fft.ifft(spectrum).real)


def line_orders(lines: ErrorLines) -> tuple[Array, Array, Array]:
    """How often each line comes in a turn of the output, and the order of the cam and beats nearest to that."""
    cam_turns, ratio = lines.kinematics.cycle_cam_revolutions, abs(lines.kinematics.u)
    per_output = lines.per_cycle * ratio / cam_turns
    order = np.rint(lines.per_cycle / cam_turns)
    return per_output, order, per_output - order * ratio


def phasors_of(lines: ErrorLines, M_g: float, number: int) -> Phasors:
    """So many of the strongest lines of errors at a torque M_g [N*m], over all drives, rising."""
    power = (np.abs(lines.amplitude) ** 2).mean(axis=0)
    kept = np.sort(np.argsort(-power, kind="stable")[:number])
    amplitude, per_cam = -lines.amplitude[:, kept], lines.per_cycle[kept] / lines.kinematics.cycle_cam_revolutions
    per_output = line_orders(lines)[0][kept]
    return Phasors(per_output, per_cam, np.abs(amplitude), np.degrees(np.angle(amplitude)), M_g)
