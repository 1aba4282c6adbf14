"""Traces measured in a trial: the error over the angle of the cam from its index, as a few dozen means.

A trace carries phase: it is compared with the model as a curve. Its level is free, and so is where in the output's
turn it began. What it may be off by from the best of the model's curves is of two kinds: noise of the readings, seen
in the readings themselves, which averages out; and what does not: slow errors of rig and model, as large as the noise
of a trial's F'_ior, mostly alike over BLUR of the cam's angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.linalg import solve_triangular

from hdassist.error.table import TURNS
from hdassist.errors import DataError
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.preset.fields import Drive
from hdassist.readers.sweeps import Sweep
from hdassist.readers.trace import MeasuredTrace, read_trace

CELLS = TURNS  # of a cam turn: where the wheels stand for which the prior computes the error
TOGETHER = 15.0  # deg of the output over which cam turns are folded, one turn at least
APART = 90.0  # deg of the output between stretches of a record that tell something of their own
SHORTEST = 0.99  # cam turns
DENSE = 20  # readings of a cam turn, at least
BLUR = 20.0  # deg of the cam over which slow errors are alike
ROUGH = 0.2  # share of their square that is not alike even in neighbouring cells
ANY = 1e3  # arcsec: standard deviation of what is not known at all


@dataclass(frozen=True, eq=False)
class TrialTrace:
    """A trace of a trial, in stretches of a few cam turns that were folded into one.

    phi_h: cam angle of the cells [rad], shape (CELLS,); travel: cam angle amid each stretch [rad], shape (stretches,);
    error: F_kpp, and variance of the means by noise of the readings [arcsec, arcsec^2], shape (stretches, CELLS), with
    infinite variance where nothing was read; reading_noise [arcsec]; range_arcsec of the means; cam_turns that were
    recorded; growing: whether at growing angles of the cam.
    """

    file: str
    sha256: str
    phi_h: Array
    travel: Array
    error: Array
    variance: Array
    reading_noise_arcsec: float
    range_arcsec: float
    cam_turns: float
    growing: bool
    notes: tuple[str, ...] = ()

    @property
    def known(self) -> int:
        """Cells in which something was read."""
        return int(np.isfinite(self.variance).sum())

    def whitened(self, slow_arcsec: float) -> tuple[Array, Array]:
        """Matrices whose product with what a curve is off by has unit variance, and that with the error itself.

        Argument: slow_arcsec, standard deviation of slow errors. Shapes (stretches, CELLS, CELLS), (stretches, CELLS).
        """
        apart = self.phi_h[:, None] - self.phi_h
        alike = np.exp(-2 * (np.sin(apart / 2) / np.radians(BLUR)) ** 2)
        slow = slow_arcsec**2 * ((1 - ROUGH) * alike + ROUGH * np.eye(CELLS))
        noise = np.minimum(self.variance, ANY**2)
        matrices = [
            solve_triangular(np.linalg.cholesky(slow + np.diag(row) + ANY**2), np.eye(CELLS), lower=True)
            for row in noise
        ]
        return np.array(matrices), np.array([m @ row for m, row in zip(matrices, self.error, strict=True)])


def read_trial_trace(path: str | Path, drive: Drive, rotation_deg: float, *, reverse: bool = False) -> TrialTrace:
    """Read the file of a trace as trial_trace takes it. Raises what read_trace and trial_trace do."""
    ratio = abs(Kinematics.of(drive).u)
    return trial_trace(read_trace(path, ratio=ratio), drive, rotation_deg, reverse=reverse)


def trial_trace(trace: MeasuredTrace, drive: Drive, rotation_deg: float, *, reverse: bool = False) -> TrialTrace:
    """A measured trace as a trial of a drive whose fixed wheel is turned by rotation_deg; reverse: its error.

    Taken are the moves at growing angles of the cam, else those at falling ones. Raises DataError for angles of the
    output, less than one cam turn in one direction, or readings too far apart.
    """
    if trace.angle_of == "output":
        hint = "count the cam's own angle, from its index (phi_h = 0)"
        raise DataError(f"{trace.file}: angles of the output do not tell where the cam stands", hint)
    kinematics = Kinematics.of(drive)
    moves, growing = _moves(trace)
    rows = np.concatenate([np.arange(move.start, move.stop) for move in moves])
    turns, sign = trace.cam_deg[rows] / 360, _sign(trace, kinematics) * (-1 if reverse else 1)
    error = sign * trace.error_arcsec[rows]
    dense = len(turns) / sum(abs(trace.cam_deg[m.stop - 1] - trace.cam_deg[m.start]) / 360 for m in moves)
    if dense < DENSE:
        hint = f"{DENSE} or more are needed"
        raise DataError(f"{trace.file}: {dense:.3g} readings in a turn of the cam are too few for its curve", hint)
    noise = _noise(trace, moves)
    # the wheels then stand where the prior has them, from the present position of the fixed wheel
    phi_h = np.radians(rotation_deg) + 2 * np.pi * np.arange(CELLS) / CELLS
    travel, means, variances = [], [], []
    width = max(abs(kinematics.u) * TOGETHER / 360, 1.0) + 1 / CELLS
    for start in _stretches(turns, width, abs(kinematics.u)):
        chosen = (turns >= start) & (turns < start + width)
        if not chosen.any():
            continue
        mean, count = _folded(turns[chosen], error[chosen], phi_h)
        travel.append(2 * np.pi * float(turns[chosen].mean()))
        means.append(mean - mean.mean())
        variances.append(np.where(count > 0, noise**2 / np.maximum(count, 1), np.inf))
    found = np.array(means)
    return TrialTrace(
        file=trace.file,
        sha256=trace.sha256,
        phi_h=phi_h,
        travel=np.array(travel),
        error=found,
        variance=np.array(variances),
        reading_noise_arcsec=noise,
        range_arcsec=float(np.ptp(found, axis=1).max()),
        cam_turns=float(np.ptp(turns)),
        growing=growing,
        notes=trace.notes,
    )


def _moves(trace: MeasuredTrace) -> tuple[list[Sweep], bool]:
    """Moves in one direction of more than a turn, those at growing angles if there are any."""
    longest = 0.0
    for sign in (1, -1):
        moves = [move for move in trace.sweeps if move.direction == sign]
        spans = [abs(trace.cam_deg[m.stop - 1] - trace.cam_deg[m.start]) / 360 for m in moves]
        # from the first reading to the last a whole turn lacks a step
        if any(span + span / max(m.stop - m.start - 1, 1) >= SHORTEST for m, span in zip(moves, spans, strict=True)):
            return moves, sign > 0
        longest = max([longest, *spans])
    raise DataError(
        f"{trace.file}: less than one cam turn in one direction ({longest:.2g})",
        "a trial's trace has one turn of the cam or more, two are better",
    )


def _sign(trace: MeasuredTrace, kinematics: Kinematics) -> float:
    """Sign of F_kpp = cam/u - output against the error of the trace.

    A column of errors is F_kpp, as hdassist trace writes it. Two encoders give output - sense cam/|u|: the opposite
    where both count the same way round, as they do if sense is the sign of u, else one of them counts backwards.
    """
    return 1.0 if not trace.sense else -trace.sense * float(np.sign(kinematics.u))


def _noise(trace: MeasuredTrace, moves: list[Sweep]) -> float:
    """Standard deviation of the readings [arcsec] about what goes on straight from one to the next but one."""
    bends = [np.diff(trace.error_arcsec[m.start : m.stop], 2) for m in moves]
    return float(np.hypot(np.sqrt(np.mean(np.square(np.concatenate(bends))) / 6), trace.step_arcsec / np.sqrt(12)))


def _stretches(turns: Array, width: float, ratio: float) -> list[float]:
    """First cam turns of the stretches of a record, which are so wide [turns], evenly over it."""
    first, spare = float(turns.min()), max(float(np.ptp(turns)) - width, 0.0)
    count = min(1 + int(spare / (ratio * APART / 360)), round(360 / APART))
    return [first + k * spare / max(count - 1, 1) for k in range(count)]


def _folded(turns: Array, error: Array, phi_h: Array) -> tuple[Array, Array]:
    """Error at cam angles phi_h [rad] from the means of what was read near each, and how many readings those are."""
    place = turns - phi_h[0] / (2 * np.pi) + 0.5 / CELLS
    cell = np.floor(place % 1 * CELLS).astype(np.int64) % CELLS
    count = np.bincount(cell, minlength=CELLS)
    some = count > 0
    off = place % 1 * CELLS - cell - 0.5
    where = (np.bincount(cell, off, CELLS)[some] / count[some]) + np.flatnonzero(some)
    mean = np.bincount(cell, error, CELLS)[some] / count[some]
    return np.interp(np.arange(CELLS), where, mean, period=CELLS), count.astype(float)
